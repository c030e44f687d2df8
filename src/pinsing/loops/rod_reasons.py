"""Why a mechanism has no loci over the pose, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinsing._types import Array
from pinsing.loops.rod import End, Sample, end_point
from pinsing.loops.structure import Structure
from pinsing.robot.mechanism import Mechanism

_SMALL = 1e-9


def leg_reason(
    mechanism: Mechanism,
    built: Structure,
    samples: Sequence[Sample],
    path: Sequence[int],
    end: End,
    planar: bool,
) -> str:
    """Of a leg that is of another kind than those with a wrench over the pose."""
    at_end = () if end.centre is None else end.centre.joints
    joints = [*path, *at_end, *reversed(end.hanging)]
    name = f"the leg of {', '.join(mechanism.joints[j] for j in joints) or 'no joints'}"
    driven = [j for j in joints if j in mechanism.actuated]
    slides = [j for j in joints if mechanism.prismatic[j]]
    where = "is not supported over the pose"
    if not driven:
        return f"{name} has no actuated joint, which {where}"
    told = " and ".join(mechanism.joints[j] for j in driven)
    if end.hanging:
        return f"{name}, written from the output and driven at {told}, {where}"
    loose = [j for j in slides if j not in driven]
    if slides and _askew(mechanism, built, samples, path, end, slides, planar):
        across = mechanism.joints[slides[0]]
        return f"{name} slides ({across}) beside the line from its foot to its end, which {where}"
    if loose and path and loose[0] == path[0]:
        first = mechanism.joints[loose[0]]
        return f"{name} is driven at {told} behind the passive slide {first}, which {where}"
    if len(driven) > 1:
        return f"{name} has {len(driven)} actuated joints ({told}), which {where}"
    return f"{name}, driven at {told}, {where}"


def _askew(
    mechanism: Mechanism, built: Structure, samples: Sequence[Sample], path: Sequence[int],
    end: End, slides: Sequence[int], planar: bool,
) -> bool:  # fmt: skip
    """Whether a slide after turning joints does not point along the line through the leg's ends."""
    turning = [j for j in path if not mechanism.prismatic[j]]
    if len(slides) != 1 or slides[0] not in path or not turning or path[-1] != slides[0]:
        return False
    centre = next((c for c in built.centres if c.joints[0] == turning[0]), None)
    flat = np.array([1.0, 1.0, 0.0]) if planar else np.ones(3)

    def foot(s: Sample) -> Array:
        at = s.joints[turning[0] + 1]
        return np.array(at.translation if centre is None else at.act(centre.point))

    reach = np.array([(end_point(s, end) - foot(s)) * flat for s in samples])
    along = np.array([s.axis[slides[0]] for s in samples])
    return bool(np.abs(np.cross(reach, along)).max() > _SMALL)


def tree_reason(mechanism: Mechanism, path: Sequence[int]) -> str:
    """Of the leg that carries the output in the tree where it does not end in a pin or ball."""
    names = ", ".join(mechanism.joints[j] for j in path)
    last = path[-1]
    if last in mechanism.actuated:
        how = f"is driven at its joint with the output ({mechanism.joints[last]})"
    elif mechanism.prismatic[last]:
        how = f"ends in a slide at the output ({mechanism.joints[last]})"
    else:
        how = f"does not end in a pin or a ball at the output ({mechanism.joints[last]})"
    return f"the leg of {names} {how}, which is not supported over the pose"
