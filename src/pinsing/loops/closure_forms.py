"""Singular loci from the closure equations themselves, exactly: for loops of any kind and cut.

With G the Jacobian of the closure equations, the joints that carry no actuator move with all
actuators held where the columns of G that are theirs are dependent; a motion leaves the output at
rest where the columns of G over the rows of the output are. Both are matrices of polynomials in
the joint angles. Where they have more rows than columns (overconstrained loops, more actuators
than freedoms) all their largest minors vanish there together.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.algebra.ring import Ring, make_ring, rational
from pinsing.loops.closure import ranks
from pinsing.loops.leg_chain import Row, Turn, dot, leg_chain, rational_turn
from pinsing.loops.leg_wrenches import PLANE, SIZE, AtZero, path_to, room_of
from pinsing.loops.structure import structure
from pinsing.robot.mechanism import Loop, Mechanism

Step = tuple[int, int]
"""A joint, and 1 where it is passed outwards, -1 where towards the base."""

_STILL = rational_turn(np.eye(3))


@dataclass(frozen=True, eq=False)
class ClosureForms:
    """The two matrices.

    Attributes
    ----------
    ring : Ring
        Of all joints.
    held : list of rows of Poly
        A column for each passive joint: they move with the actuators held where these are
        dependent.
    at_rest : list of rows of Poly
        A column for each joint: a motion leaves the output at rest where these are dependent.
    off : float
        By how much numbers of the file were changed to be exact.
    """

    ring: Ring
    held: list[Row]
    at_rest: list[Row]
    off: float


def closure_forms(mechanism: Mechanism) -> ClosureForms:
    """The matrices of a mechanism, whatever its legs are."""
    ring = make_ring(mechanism.prismatic.tolist())
    made = _Velocities(mechanism, ring)
    rows = [row for loop in mechanism.loops for row in made.loop(loop)]
    held = [[row[j] for j in mechanism.passive] for row in rows]
    whole = [*rows, *made.output()]
    return ClosureForms(ring, _not_zero(held), _not_zero(whole), made.off)


def _not_zero(rows: list[Row]) -> list[Row]:
    return [row for row in rows if any(x != 0 for x in row)]


class _Velocities:
    """Rows of Jacobians: velocities by all joints, seen from a body between them."""

    def __init__(self, mechanism: Mechanism, ring: Ring) -> None:
        self.mechanism = mechanism
        self.ring = ring
        self.zero = AtZero(mechanism, structure(mechanism))
        self.kind, self.turn, _ = room_of(mechanism)
        self.off = 0.0
        self._frames = {f.name: k for k, f in enumerate(mechanism.model.frames)}

    def loop(self, loop: Loop) -> list[Row]:
        """One loop's rows, seen from the middle of the joints that it goes through."""
        frames = self.mechanism.model.frames
        a, b = self._frames[loop.frame_a], self._frames[loop.frame_b]
        first, second = (path_to(self.mechanism, int(frames[k].parentJoint)) for k in (a, b))
        shared = sum(x == y for x, y in zip(first, second, strict=False))
        round_ = [(j, -1) for j in reversed(first[shared:])] + [(j, 1) for j in second[shared:]]
        if loop.kind == "6d":
            return self._whole(round_)
        # The rows of a planar loop are along the axes of its first frame: it is the one that rests.
        planar = loop.kind == "planar" and self.kind != PLANE
        rows = self._zero()
        back, on = _parted(round_, 0 if planar else len(round_) // 2)
        for side, frame, steps in ((-1, a, back), (1, b, on)):
            self._add(rows, side, np.array(self.zero.frames[frame].translation), steps, self.turn)
        if planar:
            axes = rational_turn(np.array(self.zero.frames[a].rotation))
            unit = [[self.ring.one * rational(axes[i][k]) for i in range(3)] for k in range(2)]
            return [
                [dot(u, [row[j] for row in rows[:3]], self.ring.zero)
                 for j in range(self.mechanism.n)]
                for u in unit
            ]  # fmt: skip
        return rows[:2] if self.kind == PLANE else rows[:3]

    def output(self) -> list[Row]:
        """Rows of the output that count; where all do they may be those of another point."""
        task = self.mechanism.task.rows
        path = [(j, 1) for j in path_to(self.mechanism, structure(self.mechanism).output)]
        if SIZE[self.kind] == len(task) == ranks(self.mechanism).output:
            return self._whole(path)
        rows = self._zero()
        place = self.zero.frames[self.mechanism.output_id]
        self._add(rows, 1, np.array(place.translation), path, _STILL)
        return [rows[k] for k in task]

    def _zero(self) -> list[Row]:
        return [[self.ring.zero] * self.mechanism.n for _ in range(6)]

    def _whole(self, steps: Sequence[Step]) -> list[Row]:
        """All of a motion between two bodies: that of a point of a body in the middle."""
        rows = self._zero()
        middle = len(steps) // 2
        at = self.zero.origins[steps[middle][0]]
        for side, part in zip((-1, 1), _parted(steps, middle), strict=True):
            self._add(rows, side, at, part, self.turn, rests=True)
        return [rows[0], rows[1], rows[5]] if self.kind == PLANE else rows

    def _add(
        self, rows: list[Row], side: int, at: Array, steps: Sequence[Step], turn: Turn,
        rests: bool = False,
    ) -> None:  # fmt: skip
        """What joints do to a point and to the turn of its body, by their columns.

        The point is one of the last body, or of the first where it ``rests``.
        """
        if not steps:
            return
        joints = [j for j, _ in steps]
        # A joint that is passed from its own body to the one before moves that the other way.
        axes = self.zero.axes[joints] * np.array([float(sign) for _, sign in steps])[:, None]
        chain = leg_chain(self.ring, joints, axes, self.zero.origins[joints], turn)
        self.off = max(self.off, chain.off)
        point, scale = chain.point(at), chain.scale
        if rests:
            point, scale = chain.fixed(at), self.ring.one
        times = rational(Fraction(side))
        for hinge in chain.hinges:
            reach = [hinge.scale * b for b in point] if rests else point
            grown = hinge.scale if rests else scale
            for k, x in enumerate(chain.in_base(chain.velocity(hinge, reach, grown))):
                rows[k][hinge.joint] += times * x
            if not hinge.slides:
                for k, x in enumerate(chain.in_base([scale * x for x in hinge.axis])):
                    rows[3 + k][hinge.joint] += times * x


def _parted(steps: Sequence[Step], middle: int) -> tuple[list[Step], list[Step]]:
    """The ways from the middle of some steps back to their start, and on to their end."""
    return [(j, -sign) for j, sign in reversed(steps[:middle])], list(steps[middle:])
