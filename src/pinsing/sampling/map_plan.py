"""What a map covers: joints, ranges, how many configurations, in what order."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.kinematics.batch import batch, own_scale
from pinsing.kinematics.verdict import scale_notes
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.sampling.sample import (
    MAX_DIMENSION,
    SAMPLINGS,
    grid_axis,
    grid_points,
    moving_ranges,
    put_points,
)
from pinsing.serialization import JsonResult

COUNT = 1 << 20
"""Configurations of a map unless asked otherwise."""

BLOCK = 4096
"""Configurations that are treated at a time; a chunk is a number of whole blocks."""

CHUNK, CHUNK_OF_VALUES = 128 * BLOCK, 16 * BLOCK
"""Configurations of a chunk; fewer if all singular values are kept."""

WORST = 20

_MAX_COUNT = 10**15
_MAX_STEPS = 1_000_000
_MAX_WORST = 100_000


@dataclass(frozen=True, eq=False)
class MapPlan(JsonResult):
    """Everything that decides which configurations a map looks at.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    sampling : str
        ``grid``, ``sobol`` or ``random``.
    count : int
        Configurations.
    moving : tuple of int
        Indices of the joints that are mapped.
    ranges : (k, 2) array
        Ends of their ranges, radians or metres.
    steps : tuple of int
        Values of each in a grid, the last one changing fastest; empty otherwise.
    base : (n,) array
        Where the other joints stay, radians or metres.
    seed : int
        Of a Sobol or random sample.
    worst : int
        How many of the worst configurations are kept.
    chunk : int
        Configurations of a chunk. The result does not depend on it.
    notes : tuple of str
        What was assumed.
    """

    schema: ClassVar[str] = "pinsing/map-plan/1"
    made_by: ClassVar[str] = "pinsing.plan_map(arm)"

    arm: ArmSummary
    sampling: str
    count: int
    moving: tuple[int, ...]
    ranges: Array
    steps: tuple[int, ...]
    base: Array
    seed: int
    worst: int
    chunk: int
    notes: tuple[str, ...]

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.count // self.chunk)

    @checked
    def configurations(self, start: int, stop: int) -> Array:
        """Return the configurations of some numbers.

        Parameters
        ----------
        start, stop : int
            The first, and the one after the last, counted from 0.

        Returns
        -------
        (stop - start, n) array
            Radians and metres.

        Raises
        ------
        OptionError
            If there are none of these numbers.

        Examples
        --------
        >>> import pinsing
        >>> plan = pinsing.plan_map(pinsing.load("scara"), "grid", steps=3, joints=["q2"])
        >>> plan.configurations(0, 3)[:, 1].round(2)
        array([-2.62,  0.  ,  2.62])
        """
        if not 0 <= start <= stop <= self.count:
            raise OptionError(
                f"configurations {start} to {stop} are outside 0 to {self.count} of the map"
            )
        return rows_of(self, start, stop)

    def identity(self) -> dict[str, Any]:
        """What decides the numbers and the chunks, as plain JSON values."""
        data = self.to_dict()
        named = {"joints": [self.arm.joints[i] for i in self.moving]}
        return named | {k: v for k, v in data.items() if k not in ("arm", "notes", "moving")}

    def __str__(self) -> str:
        names = ", ".join(self.arm.joints[i] for i in self.moving)
        how = {"grid": "grid", "sobol": "Sobol sample", "random": "random sample"}[self.sampling]
        size = " x ".join(map(str, self.steps)) + " = " if len(self.steps) > 1 else ""
        return f"{how} of {size}{self.count:,} configurations over {names}"


def rows_of(plan: MapPlan, start: int, stop: int) -> Array:
    """Configurations (stop - start, n) of a plan, of numbers that there are."""
    moving, count = list(plan.moving), stop - start
    every = moving == list(range(plan.arm.n))
    Q = np.empty((count, plan.arm.n)) if every else np.tile(plan.base, (count, 1))
    if plan.sampling == "grid":
        sliding = plan.arm.prismatic[moving]
        axes = [
            grid_axis(float(low), float(high), steps, bool(slides))
            for (low, high), steps, slides in zip(plan.ranges, plan.steps, sliding, strict=True)
        ]
        Q[:, moving] = grid_points(axes, start, stop)
    else:
        put_points(Q, moving, plan.sampling, start, plan.ranges, plan.seed)
    return Q


@checked
def plan_map(
    arm: Arm,
    sampling: str = "sobol",
    *,
    count: int | None = None,
    steps: int | Mapping[str, int] | None = None,
    joints: Sequence[str] | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    q: npt.ArrayLike | None = None,
    ignore_limits: bool = False,
    seed: int = 0,
    worst: int = WORST,
    chunk: int | None = None,
    keep_values: bool = False,
) -> MapPlan:
    """Choose the configurations of a map, and compute nothing yet.

    Parameters
    ----------
    arm, sampling, count, steps, joints, ranges, q, ignore_limits, seed, worst, chunk, keep_values
        As in ``sigma_map``; ``keep_values`` only makes chunks smaller.

    Returns
    -------
    MapPlan
        What `sigma_map` would look at.

    Raises
    ------
    ConfigurationError
        If ``q`` or a range is outside the limits or not finite.
    OptionError
        If an option makes no sense.
    UnknownNameError
        If a joint or sampling does not exist.

    Examples
    --------
    >>> import pinsing
    >>> pinsing.plan_map(pinsing.load("planar3r"), "grid", steps=90).count
    8100
    """
    if sampling not in SAMPLINGS:
        raise UnknownNameError("sampling", sampling, SAMPLINGS)
    notes = list(scale_notes(arm))
    moving = _moving(arm, joints, ranges, steps, notes)
    limits = _ranges(arm, ranges or {}, ignore_limits, notes)
    names = [arm.joints[i] for i in moving]
    sizes = _steps(names, steps, count) if sampling == "grid" else ()
    if sampling == "grid":
        if count is not None and steps is not None:
            raise OptionError("give either the steps of a grid or a count, not both")
        count = math.prod(sizes)
    elif steps is not None:
        raise OptionError(f"steps belong to a grid, not to a {sampling} sample: give a count")
    count = COUNT if count is None else int(count)
    if not 1 <= count <= _MAX_COUNT:
        raise OptionError(f"a map has between 1 and {_MAX_COUNT:,} configurations, not {count:,}")
    if sampling == "sobol" and len(moving) > MAX_DIMENSION:
        raise OptionError(
            f"a Sobol sample has at most {MAX_DIMENSION} joints, not {len(moving)}; "
            "choose fewer joints, or a random sample"
        )
    if not 0 <= seed < 2**64:
        raise OptionError(f"seed must lie between 0 and 2**64 - 1, got {seed}")
    if not 1 <= worst <= _MAX_WORST:
        raise OptionError(f"worst must lie between 1 and {_MAX_WORST:,}, got {worst}")
    return MapPlan(
        arm=summarize(arm),
        sampling=sampling,
        count=count,
        moving=moving,
        ranges=limits[list(moving)],
        steps=sizes,
        base=_base(arm, q, limits, moving, ignore_limits),
        seed=seed,
        worst=worst,
        chunk=_chunk(chunk, keep_values),
        notes=tuple(notes),
    )


def _moving(
    arm: Arm,
    joints: Sequence[str] | None,
    ranges: Mapping[str, tuple[float, float]] | None,
    steps: int | Mapping[str, int] | None,
    notes: list[str],
) -> tuple[int, ...]:
    named = [*(joints or ()), *(ranges or ()), *(steps if isinstance(steps, Mapping) else ())]
    for name in named:
        if name not in arm.joints:
            raise UnknownNameError("joint", name, arm.joints)
    if joints is not None:
        if not joints:
            raise OptionError("a map needs at least one joint")
        if len(set(joints)) < len(joints):
            raise OptionError("a joint is named twice")
        outside = [name for name in named if name not in joints]
        if outside:
            raise OptionError(f"joint {outside[0]} has a range or steps but is not mapped")
        return tuple(arm.joints.index(name) for name in joints)
    matter = _effective(arm)
    chosen = tuple(i for i in range(arm.n) if matter[i] or arm.joints[i] in named)
    if not chosen:
        return tuple(range(arm.n))
    idle = [name for i, name in enumerate(arm.joints) if i not in chosen]
    if idle:
        notes.append(f"not mapped: {', '.join(idle)} (no singular value depends on it)")
    return chosen


def _effective(arm: Arm) -> npt.NDArray[np.bool_]:
    """Which joints (n,) change any singular value, by several turns from random places."""
    rng = np.random.default_rng(0)
    reach = np.where(arm.prismatic, own_scale(arm).length, np.pi)
    start = rng.uniform(-1, 1, (8, arm.n)) * reach
    turned = np.repeat(start[None], arm.n, axis=0)
    for i in range(arm.n):
        turned[i, :, i] += rng.uniform(0.2, 1, len(start)) * reach[i]
    on = batch(arm)
    sigma = on.own_sigma(start)
    moved = on.own_sigma(turned.reshape(-1, arm.n)).reshape(arm.n, *sigma.shape)
    return np.asarray((np.abs(moved - sigma) > 1e-9 * sigma[:, :1]).any(axis=(1, 2)))


def _ranges(
    arm: Arm, given: Mapping[str, tuple[float, float]], ignore_limits: bool, notes: list[str]
) -> Array:
    limits = moving_ranges(arm, ignore_limits)
    for name, pair in given.items():
        i = arm.joints.index(name)
        low, high = (float(x) for x in pair)
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ConfigurationError(f"range [{low:g}, {high:g}] of {name} is empty or not finite")
        within = arm.lower[i] - 1e-9 <= low and high <= arm.upper[i] + 1e-9
        if not within and not ignore_limits:
            raise ConfigurationError(
                f"range [{low:g}, {high:g}] of {name} is outside its limits "
                f"[{arm.lower[i]:g}, {arm.upper[i]:g}]; change it, or map with ignore_limits",
                joint=name,
                limits=(float(arm.lower[i]), float(arm.upper[i])),
            )
        limits[i] = low, high
    if ignore_limits:
        notes.append("limits of revolute joints are ignored: whole circles unless a range is given")
    return limits


def _steps(
    names: Sequence[str], steps: int | Mapping[str, int] | None, count: int | None
) -> tuple[int, ...]:
    if steps is None:  # as many as fit, the same for all joints
        wanted = COUNT if count is None else count
        fit = max(1, round(wanted ** (1 / len(names))))
        while fit > 1 and fit ** len(names) > wanted:
            fit -= 1
        found = [fit] * len(names)
    elif isinstance(steps, Mapping):
        missing = [name for name in names if name not in steps]
        if missing:
            raise OptionError(f"steps of {', '.join(missing)} are missing")
        found = [int(steps[name]) for name in names]
    else:
        found = [int(steps)] * len(names)
    if min(found) < 1 or max(found) > _MAX_STEPS:
        raise OptionError(f"steps of a joint must lie between 1 and {_MAX_STEPS:,}")
    return tuple(found)


def _base(
    arm: Arm,
    q: npt.ArrayLike | None,
    limits: Array,
    moving: tuple[int, ...],
    ignore_limits: bool,
) -> Array:
    if q is None:
        return np.asarray(limits.mean(axis=1))
    base = arm.check_one(q)
    off = arm.space.outside(base)
    off[list(moving)] = False
    if off.any() and not ignore_limits:
        i = int(off.argmax())
        raise ConfigurationError(
            f"q is outside the limits of {arm.joints[i]}; change it, or map with ignore_limits",
            joint=arm.joints[i],
            value=float(base[i]),
            limits=(float(arm.lower[i]), float(arm.upper[i])),
        )
    return base


def _chunk(asked: int | None, keep_values: bool) -> int:
    if asked is None:
        return CHUNK_OF_VALUES if keep_values else CHUNK
    if asked < 1:
        raise OptionError(f"chunk must be at least 1, got {asked}")
    return -(-int(asked) // BLOCK) * BLOCK
