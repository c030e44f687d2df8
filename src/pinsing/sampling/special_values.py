"""Where a sweep starts from and what it sets: nominal configuration, ranges, special values."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.kinematics.verdict import NEAR_RTOL, SINGULAR_RTOL, ratios
from pinsing.robot.arm import Arm
from pinsing.robot.joint_space import SLACK
from pinsing.robot.nominal import ANGLE_TOL
from pinsing.sampling.joint_condition import value_text

SPECIAL_ANGLES = (0.0, math.pi / 2, -math.pi / 2, math.pi, -math.pi)
"""Special values of revolute joints, radians (paper, Section 3.2)."""

Special = Sequence[float] | Mapping[str, Sequence[float]]
"""Special angles of all revolute joints, or the special values of single joints by name."""

_LISTED = 2  # values that a note names one by one
_NOMINAL_TRIES = 200
_TURN = 2 * math.pi


def moving_ranges(arm: Arm, ignore_limits: bool, notes: list[str] | None = None) -> Array:
    """Range (n, 2) that each joint moves over: its limits, but no more than one turn."""
    low, high = arm.space.range(ignore_limits)
    long = ~arm.prismatic & (high - low > _TURN * (1 + 1e-6))
    # From -pi on if that is in the range.
    low = np.where(long, np.maximum(low, np.minimum(-np.pi, high - _TURN)), low)
    high = np.where(long, low + _TURN, high)
    if notes is not None and long.any():
        names = ", ".join(np.array(arm.joints)[long])
        notes.append(f"one turn of {names} is swept: the rest of the range only repeats it")
    return np.stack([low, high], axis=1)


def uniform_configurations(
    arm: Arm, nominal: Array, special: Special, ignore_limits: bool, notes: list[str]
) -> tuple[tuple[float, Array], ...]:
    """Step (2): all revolute joints at one special value, prismatic ones at ``nominal``.

    Returns
    -------
    tuple of (value, (n,) array)
        None twice, none outside the limits.
    """
    if arm.prismatic.all():
        return ()
    flat = itertools.chain(*special.values()) if isinstance(special, Mapping) else special
    found: list[tuple[float, Array]] = []
    outside: list[str] = []
    for value in flat:
        if any(_same(value, known, False) for known, _ in found):
            continue
        q = np.where(arm.prismatic, nominal, value)
        if not ignore_limits and arm.space.unreachable(q).any():
            outside.append(value_text(value))
            continue
        found.append((float(value), q if ignore_limits else arm.fold(q)))
    if outside:
        places = ", ".join(outside)
        notes.append(f"not tried, being outside the joint limits: all joints at {places} at once")
    return tuple(found)


def choose_nominal(
    arm: Arm, given: npt.ArrayLike | None, ignore_limits: bool, rng: np.random.Generator
) -> tuple[Array, str]:
    """Step (1): a regular configuration (n,), given or found, and where it is from.

    All revolute joints at pi/3, as in the paper, if that is inside the limits and well
    conditioned; else the best conditioned of some random configurations.

    Raises
    ------
    ConfigurationError
        If the given one is singular or outside the limits, or none is regular.
    """
    if given is not None:
        q = arm.check_one(given, "nominal")
        if not ignore_limits and not arm.within_limits(q):
            bad = np.flatnonzero(arm.space.outside(q))
            names = ", ".join(arm.joints[i] for i in bad)
            raise ConfigurationError(
                f"the nominal configuration is outside the limits of {names}; "
                "change it, or sweep with ignore_limits",
                joint=arm.joints[bad[0]],
                value=float(q[bad[0]]),
                limits=(float(arm.lower[bad[0]]), float(arm.upper[bad[0]])),
            )
        given_ratio = float(ratios(arm, q)[0])
        if given_ratio <= SINGULAR_RTOL:
            raise ConfigurationError(
                f"the nominal configuration is singular (sigma_r/sigma_1 = {given_ratio:.1e}); "
                "choose a regular one, or leave it out and one is found"
            )
        return q, "given"
    low, high = arm.span
    # Four fifths of the range: the paper's 0.3 m for d3 of the Stanford arm in [-0.5, 0.5].
    paper = np.where(arm.prismatic, low + 0.8 * (high - low), np.pi / 3)
    inside = ignore_limits or bool(arm.within_limits(paper))
    if inside and ratios(arm, paper)[0] > NEAR_RTOL:
        return paper, "pi/3"
    tries = arm.space.sample(_NOMINAL_TRIES, rng, ignore_limits)
    ratio = ratios(arm, tries)
    if ratio.max() <= SINGULAR_RTOL:
        raise ConfigurationError(
            f"{arm.name} is singular at every configuration within its limits; "
            "widen them or sweep with ignore_limits"
        )
    return tries[int(ratio.argmax())], "random"


def special_values(
    arm: Arm, special: Special, ignore_limits: bool, notes: list[str]
) -> list[Array]:
    """Special values of each joint inside its limits, none twice.

    A prismatic joint takes 0 and the middle of its range. What is left out goes to ``notes``.

    Raises
    ------
    ConfigurationError
        If a value that the caller chose lies outside the limits of its joint, or of all joints.
    OptionError
        If a value is not finite.
    UnknownNameError
        If a joint does not exist.
    """
    by_joint = special if isinstance(special, Mapping) else {}
    for name in by_joint:
        if name not in arm.joints:
            raise UnknownNameError("joint", name, arm.joints)
    common = SPECIAL_ANGLES if isinstance(special, Mapping) else tuple(special)
    own = special is not SPECIAL_ANGLES
    result, left_out = [], []
    used: set[float] = set()
    merged = False
    for i, name in enumerate(arm.joints):
        if name in by_joint:
            wanted: Sequence[float] = by_joint[name]
        elif arm.prismatic[i]:
            low, high = arm.span[0][i], arm.span[1][i]
            wanted = (0.0, float(low + high) / 2)
        else:
            wanted = common
        kept: list[float] = []
        for value in wanted:
            if not math.isfinite(value):
                raise OptionError(f"special value {value} of {name} is not finite")
            row = np.zeros(arm.n)
            row[i] = value
            arm.check(row, "special")
            folded = value if ignore_limits else float(arm.fold(row)[i])
            room = SLACK if arm.prismatic[i] else ANGLE_TOL  # files say 1.5707 for 90 degrees
            if not ignore_limits and not arm.lower[i] - room <= folded <= arm.upper[i] + room:
                if name in by_joint:
                    raise ConfigurationError(
                        f"special value {value:g} of {name} is outside its limits "
                        f"[{arm.lower[i]:g}, {arm.upper[i]:g}]; "
                        "change it, or sweep with ignore_limits",
                        joint=name,
                        value=float(value),
                        limits=(float(arm.lower[i]), float(arm.upper[i])),
                    )
                left_out.append(f"{name} = {value_text(value, bool(arm.prismatic[i]))}")
                continue
            used.add(value)
            if any(_same(folded, k, bool(arm.prismatic[i])) for k in kept):
                merged = merged or not arm.prismatic[i]
                continue
            kept.append(folded)
        result.append(np.array(kept, dtype=float))
    if own and not isinstance(special, Mapping) and not arm.prismatic.all():
        for value in common:
            if value not in used:
                raise ConfigurationError(
                    f"special value {value:g} is outside the limits of every joint; "
                    "change it, or sweep with ignore_limits"
                )
    if merged:
        notes.append("special values a whole turn apart are swept once")
    if left_out:
        notes.append(_left_out(left_out))
    return result


def _left_out(words: Sequence[str]) -> str:
    """One line with their number, and the values themselves where they are few."""
    count = len(words)
    if count > _LISTED:
        return f"{count} special values are outside the joint limits: left out"
    what = "special value is" if count == 1 else "special values are"
    return f"{count} {what} outside the joint limits: left out ({', '.join(words)})"


def _same(a: float, b: float, prismatic: bool) -> bool:
    return abs(a - b if prismatic else math.remainder(a - b, _TURN)) < 1e-9
