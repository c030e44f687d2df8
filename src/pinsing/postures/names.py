"""Names of postures where the field has some: shoulder left or right, elbow up or down, wrist.

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

import numpy as np

from pinsing._types import Array
from pinsing.postures.ladder import Ladder, ladder_of
from pinsing.robot.nominal import Nominal

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
    words = [*_shoulder_and_elbow(ladder, Q), _wrist(ladder, Q)]
    return [tuple(w) for w in zip(*words, strict=True)]


def _wrist(ladder: Ladder, Q: Array) -> list[str]:
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
