"""Links that spin about their own line between two balls: the spin is taken out.

A leg between two balls (S-P-S, S-S) turns about the line of their centres, and so does one whose
own hinge lies on a line through a ball. That moves nothing else and no actuator holds it: it is no
freedom of the mechanism. One passive hinge is held where it is at home, and that is said.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.robot.chains import frame_index
from pinsing.robot.joint_space import model_q
from pinsing.robot.joints import joint_axis
from pinsing.robot.loop_joints import without_joint
from pinsing.robot.mechanism import Mechanism

_SMALL = 1e-9
_ACROSS = 1e-6
_SEED = 2203


def without_idle_spins(mechanism: Mechanism, keep_output: bool = True) -> Mechanism:
    """Hold one hinge of each link that spins idly; the mechanism itself where none does.

    Parameters
    ----------
    mechanism : Mechanism
        As the files describe it.
    keep_output : bool
        The spin of the link that carries the output is one of its motions, and stays.
    """
    held: list[str] = []
    while (found := _idle(mechanism, keep_output)) is not None:
        held.append(mechanism.joints[found])
        mechanism = _holding(mechanism, found)
    if not held:
        return mechanism
    spins = "link spins" if len(held) == 1 else "links spin"
    note = (
        f"{len(held)} {spins} about the own line, which moves nothing else: held at home is "
        f"{', '.join(held)}"
    )
    return replace(mechanism, notes=(*mechanism.notes, note))


def _holding(mechanism: Mechanism, joint: int) -> Mechanism:
    """The mechanism with a joint fixed where it is at home."""
    model = without_joint(mechanism.model, joint + 1, float(mechanism.home[joint]))
    kept = np.arange(mechanism.n) != joint
    number = np.cumsum(kept) - 1
    return replace(
        mechanism,
        model=model,
        joints=tuple(model.names)[1:],
        prismatic=mechanism.prismatic[kept],
        lower=mechanism.lower[kept],
        upper=mechanism.upper[kept],
        actuated=tuple(int(number[j]) for j in mechanism.actuated),
        home=mechanism.home[kept],
    )


@dataclass(frozen=True, eq=False)
class _Sampled:
    """Axes (n, 3) and places (n, 3) of the joints, and the frames, at some q."""

    axes: Array
    places: Array
    frames: list[pin.SE3]


class _SpanningTree:
    """The spanning tree: what hangs on each body, and what loops hold there."""

    def __init__(self, mechanism: Mechanism, keep_output: bool) -> None:
        self.mechanism, model = mechanism, mechanism.model
        n = mechanism.n
        self.own = np.array(
            [joint_axis(model.joints[j + 1], mechanism.joints[j])[0] for j in range(n)]
        )
        self.after: list[list[int]] = [[] for _ in range(n + 1)]
        for j in range(n):
            self.after[int(model.parents[j + 1])].append(j)
        self.cuts: list[list[tuple[int, int, str]]] = [[] for _ in range(n + 1)]
        for loop in mechanism.loops:
            a, b = (frame_index(model, name) for name in (loop.frame_a, loop.frame_b))
            for one, two in ((a, b), (b, a)):
                self.cuts[int(model.frames[one].parentJoint)].append((one, two, loop.kind))
        output = int(model.frames[mechanism.output_id].parentJoint)
        self.output = output if keep_output else None
        rng = np.random.default_rng(_SEED)
        drawn = rng.uniform(0.3, 1.2, (2, n))
        # At home a slide may have no length yet.
        home = np.where(mechanism.prismatic & (mechanism.home == 0), 1.0, mechanism.home)
        self.samples = [self.at(q) for q in (*drawn, home)]

    def at(self, q: Array) -> _Sampled:
        model, data = self.mechanism.model, self.mechanism.model.createData()
        pin.forwardKinematics(model, data, model_q(model, q))
        pin.updateFramePlacements(model, data)
        return _Sampled(
            np.array([data.oMi[j + 1].rotation @ a for j, a in enumerate(self.own)]),
            np.array([data.oMi[j + 1].translation for j in range(len(self.own))]),
            [pin.SE3(m) for m in data.oMf],
        )

    def hinge(self, joint: int) -> bool:
        """Whether it is passive and turns."""
        m = self.mechanism
        return joint not in m.actuated and not m.prismatic[joint]

    def next(self, joint: int) -> int | None:
        """The only joint behind the body of a joint, where nothing else is fixed to it."""
        body = joint + 1
        if body == self.output or self.cuts[body] or len(self.after[body]) != 1:
            return None
        return self.after[body][0]

    def ball(self, first: int) -> tuple[int, int, int] | None:
        """Three passive hinges from ``first`` on whose axes meet in a point, none in a plane."""
        second = self.next(first)
        third = None if second is None else self.next(second)
        if second is None or third is None:
            return None
        run = (first, second, third)
        if not all(self.hinge(j) for j in run) or self.centre(run) is None:
            return None
        return run

    def centre(self, run: tuple[int, int, int]) -> Array | None:
        """The point (samples, 3) in which three axes meet."""
        out, apart = [], 0.0
        for s in self.samples:
            axes, places = s.axes[list(run)], s.places[list(run)]
            rows = np.concatenate([np.eye(3) - np.outer(a, a) for a in axes])
            right = np.concatenate([p - (a @ p) * a for a, p in zip(axes, places, strict=True)])
            point, _, rank, _ = np.linalg.lstsq(rows, right, rcond=None)
            size = max(1.0, float(np.abs(places).max()))
            if rank < 3 or np.abs(rows @ point - right).max() > _SMALL * size:
                return None
            apart = max(apart, abs(float(np.linalg.det(axes))))
            out.append(point)
        return np.array(out) if apart > _ACROSS else None

    def end(self, joint: int, kind: str) -> tuple[int, int] | None:
        """The two frames that a loop of a kind holds, if that is all there is at a leg's end."""
        body = joint + 1
        ends = self.cuts[body]
        if body == self.output or self.after[body] or len(ends) != 1 or ends[0][2] != kind:
            return None
        return ends[0][0], ends[0][1]

    def far(self, joint: int) -> Array | None:
        """Centre (samples, 3) of the next ball outwards from the body of a joint."""
        here: int | None = joint
        while here is not None:
            held = self.end(here, "3d")
            if held is not None:
                return np.array([s.frames[held[0]].translation for s in self.samples])
            welded = self.end(here, "6d")
            if welded is not None:
                return self.across(*welded)
            here = self.next(here)
            if here is not None and (run := self.ball(here)) is not None:
                return self.centre(run)
        return None

    def across(self, a: int, b: int) -> Array | None:
        """Centre of the first ball on the other side of a weld, seen from this side."""
        here = int(self.mechanism.model.frames[b].parentJoint) - 1
        if here < 0 or self.end(here, "6d") is None:
            return None
        while (above := self.before(here)) is not None:
            top = self.before(above)
            run = None if top is None else self.ball(top)
            if run is not None and (centre := self.centre(run)) is not None:
                return np.array(
                    [s.frames[a].act(s.frames[b].actInv(c))
                     for s, c in zip(self.samples, centre, strict=True)]
                )  # fmt: skip
            here = above
        return None

    def before(self, joint: int) -> int | None:
        """The joint that alone carries this one."""
        above = int(self.mechanism.model.parents[joint + 1]) - 1
        return above if above >= 0 and self.next(above) == joint else None


def _idle(mechanism: Mechanism, keep_output: bool) -> int | None:
    """A hinge to hold, or None where no link spins idly."""
    tree = _SpanningTree(mechanism, keep_output)
    for first in range(mechanism.n):
        run = tree.ball(first)
        if run is None:
            continue
        far, near = tree.far(run[2]), tree.centre(run)
        if far is not None and near is not None:
            return _best(tree, run, near, far)
    for joint in range(mechanism.n):
        if tree.hinge(joint) and (
            _on_line(tree, joint) or _back_on_line(tree, joint) or _twice(tree, joint)
        ):
            return joint
    return None


def _twice(tree: _SpanningTree, joint: int) -> bool:
    """Whether a hinge is written twice: a weld holds its link to another's on the same axis."""
    model = tree.mechanism.model
    for a, b, kind in tree.cuts[joint + 1]:
        other = int(model.frames[b].parentJoint) - 1
        if kind != "6d" or other < 0 or not tree.hinge(other) or tree.end(joint, "6d") is None:
            continue
        if len(tree.cuts[other + 1]) != 1 or tree.after[other + 1]:
            continue
        lines = []
        for frame, one in ((a, joint), (b, other)):
            place, s = tree.samples[0].frames[frame], tree.samples[0]
            axis = place.rotation.T @ s.axes[one]
            lines.append(np.concatenate([axis, np.cross(place.actInv(s.places[one]), axis)]))
        if min(np.abs(lines[0] - lines[1]).max(), np.abs(lines[0] + lines[1]).max()) <= _SMALL:
            return True
    return False


def _best(tree: _SpanningTree, run: tuple[int, int, int], near: Array, far: Array) -> int:
    """Which of a ball's hinges the others do best without.

    The two that stay point the link: they reach every direction where the link is across the
    second of them and that across the first; and at home they should move it two ways.
    """
    scores = []
    for k in range(3):
        a, b = (j for i, j in enumerate(run) if i != k)
        square, spread = True, 0.0
        for s, away in zip(tree.samples, far - near, strict=True):
            along = away / max(float(np.linalg.norm(away)), _SMALL)
            square &= max(abs(s.axes[b] @ along), abs(s.axes[a] @ s.axes[b])) <= _ACROSS
            # The last sample is home.
            spread = abs(float(np.linalg.det([s.axes[a], s.axes[b], along])))
        scores.append((square, round(spread, 6), k))
    return run[max(scores)[2]]


def _on_line(tree: _SpanningTree, joint: int) -> bool:
    """Whether a hinge's axis passes through the ball at the end of its link, slides along it."""
    here: int | None = joint
    while here is not None:
        held = tree.end(here, "3d")
        if held is not None:
            return _through(
                tree, joint, np.array([s.frames[held[0]].translation for s in tree.samples])
            )
        here = tree.next(here)
        if here is None:
            return False
        run = tree.ball(here)
        if run is not None:
            centre = tree.centre(run)
            return centre is not None and _through(tree, joint, centre)
        if tree.hinge(here) or not tree.mechanism.prismatic[here]:
            return False
    return False


def _back_on_line(tree: _SpanningTree, joint: int) -> bool:
    """The same with the ball at the inner end of its link."""
    above = tree.before(joint)
    while above is not None and tree.mechanism.prismatic[above]:
        above = tree.before(above)
    middle = None if above is None else tree.before(above)
    first = None if middle is None else tree.before(middle)
    run = None if first is None else tree.ball(first)
    centre = None if run is None else tree.centre(run)
    return centre is not None and _through(tree, joint, centre)


def _through(tree: _SpanningTree, joint: int, points: Array) -> bool:
    return all(
        float(np.linalg.norm(np.cross(p - s.places[joint], s.axes[joint])))
        <= _SMALL * max(1.0, float(np.abs(p).max()))
        for s, p in zip(tree.samples, points, strict=True)
    )
