"""Arms whose inverse solution goes step by step, each with two answers that a sign tells apart.

**Theorem.** Let each step of an inverse solution leave at most two values of one joint, given the
pose and the joints found before, of opposite signs of a function that is zero only where the arm
is singular. Then no two regular inverse solutions of a pose agree in all signs. A sign cannot
change along a way without a singular configuration. So two inverse solutions of one pose are
never in one aspect: the arm is not cuspidal, and a pose has at most 2^k regular solutions, k the
number of steps.

Why the functions are zero only at singular configurations: let ``g(x; T) = 0`` be the equation of
a step, x its joint and T the pose, which holds for all configurations. If ``dg/dx = 0`` at one,
then for every velocity of the joints dg is zero, so dg/dT is zero on every velocity of the tip
that keeps the joints found before: on all of them, if the arm is regular. In each step here dg/dT
is not zero unless the arm is singular for a reason that the step names.

- *Spherical wrist* (the last three axes meet in a point; or the first three, the chain then read
  from tip to base): the point is moved by three joints alone (`pinsing.postures.three_joints`);
  then the rotation of the wrist is known, and with it the angle of its outer axes, which leaves
  two values of the middle one, of opposite signs of the derivative; the outer ones are then known
  unless their axes are parallel, where the arm is singular.
- *Three parallel axes* between one and two joints, these two crossing (or the mirror image): the
  crossing point is known from the pose, and so is its height along the parallel axes, which
  leaves two values of the first joint; the angle between them and the last axis leaves two of the
  joint before it; the last one is then known; in the plane of the three, two links reach a point.
- *All axes parallel*: two links reach a point in a plane; a slide along them changes nothing.

Names of postures where the field has some: shoulder left or right, elbow up or down, wrist.

After Lee and Ziegler (1984), put so that they do not depend on the frames of a drawing. For arms
whose second axis is at right angles to the first, with a point C that is known from the pose
(the centre of the wrist):

- *shoulder left*, *right*: seen from the first axis towards C, the plane in which the arm moves
  passes on the left, or on the right. Where it passes through the first axis, *front* means that
  C is on the side where axis 2 is, or else where C is with all joints at zero.
- *elbow up*, *down*: axis 3 is above, or below, the line from axis 2 to C (to axis 4 where that is
  parallel to both, as of a UR5) while C is ahead. Above is where the first axis points, turned to
  the upper half of the base. Axes 2 and 3 are parallel.
- *wrist no-flip*, *flip*: joint 5 turns axis 6 away from axis 4 by 0 to 180 degrees, or by 180 to
  360 degrees, counted from where axes 4 and 6 are nearest to having one direction.

Each changes only at a singular configuration, since signs of `pinsing.postures.ladder` do.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from pinsing._types import Array
from pinsing.postures.exact_chain import ExactChain
from pinsing.postures.three_joints import SolutionStage, ways_of
from pinsing.robot.nominal import Nominal, exact_generic_rank


@dataclass(frozen=True, eq=False)
class Ladder:
    """Steps of an inverse solution whose signs tell all solutions of a pose apart.

    Attributes
    ----------
    stages : tuple of SolutionStage
        The steps with two answers.
    kind : str
        What the arm is: in a few words.
    chain : ExactChain
        The chain as it is read: from base to tip, or from tip to base.
    point : tuple of int and float, or None
        A point that is known from the pose: a place in the chain, and a height along its axis.
    """

    stages: tuple[SolutionStage, ...]
    kind: str
    chain: ExactChain
    point: tuple[int, float] | None

    @property
    def most(self) -> int:
        """A pose has no more regular solutions."""
        return 1 << len(self.stages)

    @property
    def reason(self) -> str:
        """Why the arm is not cuspidal."""
        steps = "; ".join(s.reason for s in self.stages)
        count = f"{len(self.stages)} signs" if len(self.stages) > 1 else "one sign"
        tell = "tell" if len(self.stages) > 1 else "tells"
        return (
            f"{self.kind}: {count}, which only a singular configuration changes, {tell} all "
            f"inverse solutions of a pose apart, at most {self.most} ({steps})"
        )

    def signs(self, Q: Array) -> Array:
        """Signs (N, k) at configurations (N, n)."""
        return np.stack([np.sign(s.value(Q)) for s in self.stages], axis=1)


def ladder_of(geometry: Nominal) -> Ladder | None:
    """The steps of an arm, or None where no theorem that is known here holds for it.

    Parameters
    ----------
    geometry : Nominal
        Its exact geometry.
    """
    arm = geometry.arm
    if arm.coupling is not None:
        return None
    return arm.once("ladder", lambda: _ladder(geometry))


def _ladder(geometry: Nominal) -> Ladder | None:
    rows, n = geometry.arm.task.rows, geometry.arm.n
    if geometry.arm.task.at_tip or exact_generic_rank(geometry, geometry.arm.task) != n:
        return None
    chain = ExactChain.of(geometry)
    if rows == (0, 1, 2) and n == 3:
        stages = ways_of(chain, chain.seen_before(3, Fraction(0)))
        return None if stages is None else Ladder(stages, "three joints move a point", chain, None)
    if rows == tuple(range(6)) and n == 6 and not any(chain.prismatic[3:]):
        found = _wrist(chain) or _planar_middle(chain)
        if found is not None:
            return found
    if rows == tuple(range(6)) and n == 6:
        back = chain.backward()
        if not any(back.prismatic[3:]):
            return _wrist(back) or _planar_middle(back)
        return None
    if rows == tuple(range(6)) or (rows == (0, 1, 5) and _upright(chain)):
        return _planar(chain)
    return None


def _wrist(chain: ExactChain) -> Ladder | None:
    point = chain.common_point(3)
    if point is None:
        return None
    height = point[2]
    stages = ways_of(chain, chain.seen_before(3, height))
    if stages is None:
        return None
    where = "wrist" if chain.sign > 0 else "shoulder"
    kind = f"three axes of the {where} meet in a point"
    return Ladder((*stages, _bent(chain, 4, where)), kind, chain, (3, float(height)))


def _bent(chain: ExactChain, j: int, name: str) -> SolutionStage:
    """The angle of axes j - 1 and j + 1 as a step that finds joint j."""

    def value(Q: Array) -> Array:
        x = chain.values(Q)[:, j]
        C, _ = chain.numbers
        a, b = C[j][2], C[j + 1][:, 2]
        c, s = np.cos(x), np.sin(x)
        return np.asarray(-s * (a[0] * b[0] + a[1] * b[1]) + c * (a[1] * b[0] - a[0] * b[1]))

    joint = chain.order[j]
    outer = sorted((chain.order[j - 1] + 1, chain.order[j + 1] + 1))
    said = f"the angle between axes {outer[0]} and {outer[1]} leaves two values of joint"
    return SolutionStage(name, joint, value, f"{said} {joint + 1}")


def _planar_middle(chain: ExactChain) -> Ladder | None:
    height = chain.planar_middle()
    if height is None:
        return None

    def shoulder(Q: Array) -> Array:
        R, p = chain.frames(chain.values(Q))
        c = p[:, 4] + height * R[:, 4, :, 2]
        across = np.cross(R[:, 0, :, 2], R[:, 1, :, 2])
        return np.asarray((across * (c - p[:, 0])).sum(axis=1))

    axes = ", ".join(str(j + 1) for j in sorted(chain.order[1:4]))
    first = chain.order[0]
    said = f"the height of a known point along axes {axes} leaves two values of joint {first + 1}"
    stages = (
        SolutionStage("shoulder", first, shoulder, said),
        _two_links(chain, (1, 2, 3)),
        _bent(chain, 4, "wrist"),
    )
    return Ladder(stages, f"axes {axes} are parallel, and two others cross", chain, (4, height))


def _planar(chain: ExactChain) -> Ladder | None:
    turning = [j for j in range(chain.n) if not chain.prismatic[j]]
    if len(turning) != 3 or not all(chain.parallel(j) for j in range(chain.n - 1)):
        return None
    stage = _two_links(chain, (turning[0], turning[1], turning[2]))
    return Ladder((stage,), "all axes are parallel", chain, None)


def _two_links(chain: ExactChain, places: tuple[int, int, int]) -> SolutionStage:
    i, j, k = places

    def value(Q: Array) -> Array:
        R, p = chain.frames(chain.values(Q))
        inner, outer = p[:, j] - p[:, i], p[:, k] - p[:, j]
        return np.asarray((inner * np.cross(R[:, j, :, 2], outer)).sum(axis=1))

    joint = chain.order[j]
    said = f"two links reach a point in a plane by two values of joint {joint + 1}"
    return SolutionStage("elbow", joint, value, said)


def _upright(chain: ExactChain) -> bool:
    """Whether the first axis is along z of the base."""
    C = chain.rotation[0]
    return bool(C[0][2] == 0 and C[1][2] == 0)


_LEVEL = 1e-9


def posture_names(geometry: Nominal, Q: Array) -> list[tuple[str, ...]]:
    """Names of the posture at configurations Q (N, n); empty where the field has none.

    Parameters
    ----------
    geometry : Nominal
        Exact geometry of the arm.
    Q : (N, n) array
        Configurations.
    """
    ladder = ladder_of(geometry)
    out: list[tuple[str, ...]] = [() for _ in Q]
    if ladder is None or ladder.point is None or ladder.chain.sign < 0 or not len(Q):
        return out
    words = [*_shoulder_and_elbow(ladder, Q), _wrist_names(ladder, Q)]
    return [tuple(w) for w in zip(*words, strict=True)]


def _wrist_names(ladder: Ladder, Q: Array) -> list[str]:
    """The derivative of the cosine of the angle is negative while that grows."""
    value = ladder.stages[-1].value(Q)
    return ["wrist no-flip" if v < 0 else "wrist flip" for v in value]


def _shoulder_and_elbow(ladder: Ladder, Q: Array) -> list[list[str]]:
    chain = ladder.chain
    if any(chain.prismatic[:2]) or not chain.perpendicular(0):
        return []
    ahead, aside, out, bend = _seen(ladder, np.concatenate([np.zeros((1, chain.n)), Q]))
    if np.ptp(aside) > _LEVEL:
        return []
    words = []
    if np.abs(aside).max() > _LEVEL:
        words.append(
            [
                "shoulder " + ("right" if a * s > 0 else "left")
                for a, s in zip(ahead, aside, strict=True)
            ][1:]
        )
    else:
        side = out[0] if abs(out[0]) > _LEVEL else ahead[0]
        front = -1.0 if side < -_LEVEL else 1.0
        words.append(["shoulder " + ("front" if a * front > 0 else "back") for a in ahead[1:]])
    if chain.parallel(1) and not chain.prismatic[2]:
        words.append(
            [
                "elbow " + ("up" if a * b > 0 else "down")
                for a, b in zip(ahead[1:], bend[1:], strict=True)
            ]
        )
    return words


def _seen(ladder: Ladder, Q: Array) -> tuple[Array, Array, Array, Array]:
    """Of C: how far ahead of axis 1, how far along axis 2; of axis 2: how far ahead; the bend."""
    chain = ladder.chain
    if ladder.point is None:
        raise ValueError("there is no point")
    place, height = ladder.point
    R, p = chain.frames(chain.values(Q))
    up, across = R[:, 0, :, 2], R[:, 1, :, 2]
    up = np.where(up[:, 2:] < -_LEVEL, -up, up)
    ahead = np.cross(up, across)
    C = p[:, place] + height * R[:, place, :, 2] - p[:, 0]
    shoulder, elbow = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    # Where axis 4 is parallel too, the bend of the links between these three tells the postures.
    end = p[:, 3] - p[:, 0] if chain.parallel(1) and chain.parallel(2) else C
    bend = np.cross(end - shoulder, elbow - shoulder)
    return tuple(
        (a * b).sum(axis=1) for a, b in ((ahead, C), (across, C), (ahead, shoulder), (across, bend))
    )
