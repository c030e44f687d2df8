"""What a map covers: joints, ranges, how many configurations, in what order."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pinsing._batch import engine
from pinsing.arguments import checked
from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.kinematics.batch import batch, own_scale
from pinsing.kinematics.verdict import scale_notes
from pinsing.measures import Array, ArrayLike, Bool, NDArray
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.serialization import JsonResult

Words = NDArray[np.uint64]

SAMPLINGS = ("grid", "sobol", "random")

BITS = np.finfo(float).nmant
"""Binary digits of a coordinate of a Sobol point, and of its number: those of a float."""

MAX_DIMENSION = 64
"""Coordinates that the compiled kernel puts."""


def moving_ranges(arm: Arm, ignore_limits: bool, notes: list[str] | None = None) -> Array:
    """Range (n, 2) that each joint moves over: its limits, but no more than one turn."""
    low, high = arm.space.range(ignore_limits)
    turn = 2 * math.pi
    long = ~arm.prismatic & (high - low > turn * (1 + 1e-6))
    # From -pi on if that is in the range.
    low = np.where(long, np.maximum(low, np.minimum(-np.pi, high - turn)), low)
    high = np.where(long, low + turn, high)
    if notes is not None and long.any():
        names = ", ".join(np.array(arm.joints)[long])
        notes.append(f"one turn of {names} is swept: the rest of the range only repeats it")
    return np.stack([low, high], axis=1)


def put_points(
    out: Array, columns: Sequence[int], sampling: str, start: int, ranges: Array, seed: int
) -> None:
    """Put a Sobol or random sample of ``ranges`` (k, 2) into columns of a C-contiguous (N, n)."""
    k, low = len(columns), np.ascontiguousarray(ranges[:, 0])
    width = ranges[:, 1] - low
    if sampling == "sobol" and engine.available():
        words = _shift(k, seed) ^ np.float64(1.0).view(np.uint64)  # of floats from 1 to 2
        heads, where = _heads(start, start + len(out), k) ^ words, np.array(columns, dtype=np.int64)
        engine.put_words(out, _first_block(k), heads, start % BLOCK, where, low, width)
    else:
        out[:, columns] = unit_points(sampling, start, start + len(out), k, seed) * width + low


def unit_points(sampling: str, start: int, stop: int, dimension: int, seed: int) -> Array:
    """Return points of a Sobol or random sample of the unit cube: (N, dimension).

    Random points come from the counter-based generator Philox4x64-10 (Salmon et al., "Parallel
    random numbers: as easy as 1, 2, 3", 2011) with the seed as its key. Sobol points are shifted
    digit by digit (exclusive-or) by a vector drawn with the seed.
    """
    if sampling == "sobol":
        return np.asarray((sobol(start, stop, dimension) ^ _shift(dimension, seed)) * 2.0**-BITS)
    skip, rest = divmod(start * dimension, 4)  # a step of the counter gives four numbers
    raw = np.random.Philox(key=seed).advance(skip).random_raw(rest + (stop - start) * dimension)
    return np.asarray((raw[rest:] >> np.uint64(11)) * 2.0**-53).reshape(-1, dimension)


def sobol(start: int, stop: int, dimension: int) -> Words:
    """Return Sobol points as integers (N, dimension) of BITS digits."""
    points = _heads(start, stop, dimension)[:, None] ^ _first_block(dimension)
    return np.asarray(points.reshape(-1, dimension)[start % BLOCK :][: stop - start])


def _heads(start: int, stop: int, dimension: int) -> Words:
    """The first point (H, dimension) of each block that a stretch is in."""
    # Digits of a Gray code are those of where a block begins, and those of the place in it.
    begin = np.arange(start - start % BLOCK, stop, BLOCK, dtype=np.uint64)
    return _of_gray_codes(begin, dimension)


@functools.cache
def _first_block(dimension: int) -> Words:
    return _of_gray_codes(np.arange(BLOCK, dtype=np.uint64), dimension)


def _of_gray_codes(i: Words, dimension: int) -> Words:
    """Points i (N,): the exclusive-or of the direction numbers at the digits of its Gray code."""
    place = np.arange(int(i.max(initial=0)).bit_length(), dtype=np.uint64)
    digits = ((i ^ i >> np.uint64(1))[:, None] >> place) & np.uint64(1)
    numbers = directions(dimension)[: len(place)]
    return np.asarray(np.bitwise_xor.reduce(digits[:, :, None] * numbers, axis=1))


@functools.cache
def directions(dimension: int) -> Words:
    """Return direction numbers (BITS, dimension) of a Sobol sequence, scaled to BITS digits.

    S. Joe and F. Y. Kuo, "Constructing Sobol sequences with better two-dimensional projections",
    SIAM J. Sci. Comput. 30 (2008) 2635-2654. Their table is read from SciPy's file: to import
    ``scipy.stats`` takes longer than a small map.
    """
    folders = getattr(find_spec("scipy"), "submodule_search_locations", None) or [""]
    try:
        with np.load(Path(folders[0], "stats", "_sobol_direction_numbers.npz")) as table:
            polynomials = table["poly"][:dimension].tolist()
            first_numbers = table["vinit"][:dimension].tolist()
    except OSError:
        raise OptionError(
            "this SciPy has no table for Sobol samples: choose a random one"
        ) from None
    v = np.zeros((BITS, dimension), dtype=np.uint64)
    v[:, 0] = [1 << (BITS - 1 - j) for j in range(BITS)]
    for k in range(1, dimension):
        degree = polynomials[k].bit_length() - 1
        column = [x << (BITS - 1 - j) for j, x in enumerate(first_numbers[k][:degree])]
        for j in range(degree, BITS):
            new = column[j - degree] ^ (column[j - degree] >> degree)
            for i in range(1, degree):
                if polynomials[k] >> (degree - i) & 1:
                    new ^= column[j - i]
            column.append(new)
        v[:, k] = column
    v.setflags(write=False)
    return v


@functools.cache
def _shift(dimension: int, seed: int) -> Words:
    return np.random.Philox(key=seed).random_raw(dimension) >> np.uint64(64 - BITS)


def grid_axis(low: float, high: float, steps: int, prismatic: bool) -> Array:
    """Values (steps,) of one joint of a grid; of a whole turn, its end is left out."""
    if steps == 1:
        return np.array([(low + high) / 2])
    whole = not prismatic and high - low > 2 * math.pi * (1 - 1e-9)
    return low + (high - low) * (np.arange(steps) / (steps if whole else steps - 1))


def grid_points(axes: list[Array], start: int, stop: int) -> Array:
    """Points ``start`` to ``stop`` of the grid of ``axes``, the last joint fastest: (N, k)."""
    places = np.unravel_index(np.arange(start, stop), [len(axis) for axis in axes])
    return np.stack([axis[place] for axis, place in zip(axes, places, strict=True)], axis=1)


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
    made_by: ClassVar[str] = "pinsing.sampling.plan_map(arm)"

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
        >>> plan = pinsing.sampling.plan_map(pinsing.load("scara"), "grid", steps=3, joints=["q2"])
        >>> plan.configurations(0, 3)[:, 1].round(2)
        array([-2.62,  0.  ,  2.62])
        """
        OptionError.refuse_if(
            not 0 <= start <= stop <= self.count,
            f"configurations {start} to {stop} are outside 0 to {self.count} of the map",
        )
        return rows_of(self, start, stop)

    def configuration(self, index: int) -> Array:
        """Return the joint vector (n,) of one number.

        Parameters
        ----------
        index : int
            From 0.
        """
        return np.asarray(rows_of(self, index, index + 1)[0])

    def identity(self) -> dict[str, Any]:
        """Return what decides the numbers and the chunks, as plain JSON values."""
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
    q: ArrayLike | None = None,
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
    >>> pinsing.sampling.plan_map(pinsing.load("planar3r"), "grid", steps=90).count
    8100
    """
    UnknownNameError.refuse_if(sampling not in SAMPLINGS, "sampling", sampling, SAMPLINGS)
    notes = list(scale_notes(arm))
    moving = _moving(arm, joints, ranges, steps, notes)
    limits = _ranges(arm, ranges or {}, ignore_limits, notes)
    sizes = _steps([arm.joints[i] for i in moving], steps, count) if sampling == "grid" else ()
    if sampling == "grid":
        OptionError.refuse_if(
            count is not None and steps is not None,
            "give either the steps of a grid or a count, not both",
        )
        count = math.prod(sizes)
    elif steps is not None:
        raise OptionError(f"steps belong to a grid, not to a {sampling} sample: give a count")
    count = COUNT if count is None else int(count)
    OptionError.refuse_if(
        not 1 <= count <= _MAX_COUNT,
        f"a map has between 1 and {_MAX_COUNT:,} configurations, not {count:,}",
    )
    OptionError.refuse_if(
        sampling == "sobol" and len(moving) > MAX_DIMENSION,
        f"a Sobol sample has at most {MAX_DIMENSION} joints, not {len(moving)}; "
        "choose fewer joints, or a random sample",
    )
    OptionError.refuse_if(
        not 0 <= seed < 2**64, f"seed must lie between 0 and 2**64 - 1, got {seed}"
    )
    OptionError.refuse_if(
        not 1 <= worst <= _MAX_WORST, f"worst must lie between 1 and {_MAX_WORST:,}, got {worst}"
    )
    if chunk is None:
        chunk = CHUNK_OF_VALUES if keep_values else CHUNK
    elif chunk < 1:
        raise OptionError(f"chunk must be at least 1, got {chunk}")
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
        chunk=-(-int(chunk) // BLOCK) * BLOCK,
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
        UnknownNameError.refuse_if(name not in arm.joints, "joint", name, arm.joints)
    if joints is not None:
        OptionError.refuse_if(not joints, "a map needs at least one joint")
        OptionError.refuse_if(len(set(joints)) < len(joints), "a joint is named twice")
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


def _effective(arm: Arm) -> Bool:
    """Return which joints (n,) change any singular value, by several turns from random places."""
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
        ConfigurationError.refuse_if(
            not (math.isfinite(low) and math.isfinite(high) and low < high),
            f"range [{low:g}, {high:g}] of {name} is empty or not finite",
        )
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
        notes.append("limits of revolute joints are ignored: full circles unless a range is given")
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
        OptionError.refuse_if(missing, f"steps of {', '.join(missing)} are missing")
        found = [int(steps[name]) for name in names]
    else:
        found = [int(steps)] * len(names)
    OptionError.refuse_if(
        min(found) < 1 or max(found) > _MAX_STEPS,
        f"steps of a joint must lie between 1 and {_MAX_STEPS:,}",
    )
    return tuple(found)


def _base(
    arm: Arm, q: ArrayLike | None, limits: Array, moving: tuple[int, ...], ignore_limits: bool
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
