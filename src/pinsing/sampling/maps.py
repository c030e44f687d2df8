"""Maps: over which joints and ranges, how many configurations in what order; and what is found.

A map runs chunk by chunk, in bounded memory, and in a folder if it is to last.
"""

from __future__ import annotations

import functools
import hashlib
import math
import operator
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pinsing._batch import engine as kernel
from pinsing.algebra.conditions import two_sided
from pinsing.chunk_file import Record
from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.families.solve import form_to_measure
from pinsing.interface import JsonResult, checked, typed
from pinsing.kinematics.jacobian import (
    PINOCCHIO,
    Batch,
    batch,
    generic_rank,
    measured,
    own_scale,
    run_identity,
    scale_notes,
)
from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL, Array, ArrayLike, Bool, NDArray
from pinsing.prose import PLAIN, Page, Span, Table, alarm, caution, verdict
from pinsing.proximity.clearance import (
    Forms,
    Watched,
    forms_of,
    nearest_family,
    watch,
)
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.sampling.execute import Job, Progress, Tell, planned_batch, running
from pinsing.sampling.tally import (
    BLOCK,
    QUANTILE_ERROR,
    WORST,
    Distribution,
    Tally,
    WorstPoint,
    check_names,
    distributions,
    finite,
    worst_points,
)

Words = NDArray[np.uint64]

SAMPLINGS = ("grid", "sobol", "random")

BITS = np.finfo(float).nmant
"""Binary digits of a coordinate of a Sobol point, and of its number: those of a float."""

MAX_DIMENSION = 64
"""Coordinates that the compiled kernel puts."""


def put_points(
    out: Array, columns: Sequence[int], sampling: str, start: int, ranges: Array, seed: int
) -> None:
    """Put a Sobol or random sample of ``ranges`` (k, 2) into columns of a C-contiguous (N, n)."""
    k, low = len(columns), np.ascontiguousarray(ranges[:, 0])
    width = ranges[:, 1] - low
    if sampling == "sobol" and kernel.available():
        words = _shift(k, seed) ^ np.float64(1.0).view(np.uint64)  # of floats from 1 to 2
        heads, where = _heads(start, start + len(out), k) ^ words, np.array(columns, dtype=np.int64)
        put_words = kernel.module().put_words
        put_words(_first_block(k), heads, start % BLOCK, where, low, width, out)
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
        taps = [i for i in range(1, degree + 1) if polynomials[k] >> (degree - i) & 1]
        for j in range(degree, BITS):
            ahead = [column[j - i] for i in taps]
            column.append(functools.reduce(operator.xor, ahead, column[j - degree] >> degree))
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

CHUNK, CHUNK_OF_VALUES = 128 * BLOCK, 16 * BLOCK
"""Configurations of a chunk; fewer if all singular values are kept."""

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
    limits = arm.space.one_turn(ignore_limits)
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


_SHOWN_WORST = 5
_DIGITS = 9


@dataclass(frozen=True, eq=False)
class ClearancePoint:
    """One of the configurations nearest to a family."""

    index: int  # its number in the map
    q: Array  # (n,): radians or metres
    # lower and upper: bounds of the distance to the nearest family, radians (metres over the length
    # scale); ``upper`` is infinite where the closed formula gives none
    lower: float
    upper: float
    family: str  # the nearest family found


@dataclass(frozen=True, eq=False)
class ClearanceSpread:
    """How the clearance is distributed over a map."""

    # the families that distances are taken to: all with real points, whatever the limits
    families: tuple[str, ...]
    # whether the closed form is complete. Otherwise a singular configuration that belongs to no
    # family may be nearer than ``lower``
    complete: bool
    # lower and upper: of the proven lower bound, and of the upper bound, as ``pinsing.clearance``
    # gives them. Radians; of joints that slide, metres over the length scale
    lower: Distribution
    upper: Distribution
    # the configurations of smallest lower bound, smallest first
    nearest: tuple[ClearancePoint, ...]


@dataclass(frozen=True, eq=False)
class MapResult(JsonResult):
    """All that a map keeps of its configurations.

    Attributes
    ----------
    plan : MapPlan
        What was asked for.
    engine : str
        ``pinocchio``, or the instruction set: the same one gives the same bits.
    done : int
        Configurations seen; fewer than planned if the map was stopped.
    singular, near_singular : int
        How many of them are that (ratio at most 1e-9; above it and at most 1e-2).
    sigma_min, ratio : Distribution
        Of sigma_r, and of sigma_r / sigma_1.
    worst : tuple of WorstPoint
        Those of smallest ratio, smallest first, the first of equals first.
    complete : bool
        False if the map was stopped.
    notes : tuple of str
        The notes of the plan, and what happened on the way.
    clearance : ClearanceSpread, optional
        Bounds of the distance to the nearest family, if the map was asked for them.
    """

    schema: ClassVar[str] = "pinsing/map/1"
    made_by: ClassVar[str] = "pinsing.sampling.sigma_map(arm)"

    plan: MapPlan
    engine: str
    done: int
    singular: int
    near_singular: int
    sigma_min: Distribution
    ratio: Distribution
    worst: tuple[WorstPoint, ...]
    complete: bool
    notes: tuple[str, ...]
    clearance: ClearanceSpread | None = field(default=None, metadata={"optional": True})

    @checked
    def text(self, page: Page = PLAIN, degrees: bool = False) -> str:
        """Return the answer in lines of text, fitted to a page.

        Parameters
        ----------
        page : Page
            Width and colour (`pinsing.prose`); plain text of 100 columns by default.
        degrees : bool
            Angles in degrees, labelled, instead of radians.

        Examples
        --------
        >>> import pinsing
        >>> result = pinsing.sampling.sigma_map(pinsing.load("planar3r"), count=1000)
        >>> print(result.text(degrees=True).splitlines()[0])
        planar3r: 6.7 % of the configurations are singular or near-singular
        """
        arm = self.plan.arm
        of = "" if self.complete else f" ({self.done:,} done)"
        share = 100 * (self.singular + self.near_singular) / self.done
        lines: list[tuple[Span, ...]] = [
            (f"{arm.name}: {share:.3g} % of the configurations are singular or near-singular",),
            (
                alarm("singular") if self.singular else "singular",
                f" (sigma_r/sigma_1 <= {SINGULAR_RTOL:g}): {self.singular:,}; ",
                caution("near-singular") if self.near_singular else "near-singular",
                f" (<= {NEAR_RTOL:g}): {self.near_singular:,}",
            ),
            (f"{self.plan}{of}",),
            (
                f"tip {arm.tip}, task {arm.task}, length scale {arm.length_scale:g} m; "
                f"engine {self.engine}",
            ),
        ]
        if self.worst:
            q = typed(self.worst[0].q, arm.prismatic, degrees, _DIGITS, room=page.width - 34)
            lines.insert(1, (f"smallest ratio: {self.worst[0].ratio:.3g}, at {q}",))
        rows = _quantile_rows(self.sigma_min, self.ratio)
        parts = [
            "\n".join(
                page.paragraph(*line, first="  " * (line is not lines[0]), rest="    ")
                for line in lines
            )
        ]
        if self.clearance is not None:
            parts += _clearance_text(self.clearance, self.plan, degrees, page)
        parts.append(page.table(Table(("share", "sigma_min", "ratio"), rows, frozenset({0, 1, 2}))))
        worst = [f"quantiles to {100 * QUANTILE_ERROR:.1f} %; the smallest ratios:"]
        for point in self.worst[:_SHOWN_WORST]:
            q = typed(point.q, arm.prismatic, degrees, _DIGITS, room=page.width - 34)
            spans = (f"{point.ratio:.3g} (", verdict(point.status), f") at {q}")
            worst.append(page.paragraph(*spans, first="  ", rest="    "))
        worst += [page.paragraph(f"note: {note}", rest="  ") for note in self.notes]
        return "\n\n".join([*parts, "\n".join(worst)])


def _quantile_rows(
    one: Distribution, two: Distribution, scale: float = 1.0
) -> tuple[tuple[str, str, str], ...]:
    """Share of the configurations, and what both values are at most there."""
    rows = []
    for p in (0.0, 0.001, 0.01, 0.1, 0.5, 0.9, 0.99, 1.0):
        share = {0.0: "smallest", 0.5: "median", 1.0: "largest"}.get(p, f"{100 * p:g} %")
        values = (scale * d.quantile(p) for d in (one, two))
        a, b = (f"{value:.4g}" if value < math.inf else "-" for value in values)
        rows.append((share, a, b))
    return tuple(rows)


def _clearance_text(spread: ClearanceSpread, plan: MapPlan, degrees: bool, page: Page) -> list[str]:
    """Quantiles of both bounds, and the configurations that are nearest to a family."""
    slides = any(plan.arm.prismatic)
    unit = "degrees" if degrees else "rad"
    what = f"clearance: distance to the nearest of {', '.join(spread.families)}, in {unit}" + (
        f" (of joints that slide, metres over {plan.arm.length_scale:g} m count as rad)"
        if slides
        else ""
    )
    if not spread.complete:
        what += (
            "; the closed form is NOT complete: singular configurations of no family may be nearer"
        )
    scale = 180 / math.pi if degrees else 1.0
    rows = _quantile_rows(spread.lower, spread.upper, scale)
    table = Table(("share", "at least", "at most"), rows, frozenset({0, 1, 2}))
    lines = ["the smallest clearances:"]
    for point in spread.nearest[:_SHOWN_WORST]:
        q = typed(point.q, plan.arm.prismatic, degrees, _DIGITS, room=page.width - 34)
        said = f"{scale * point.lower:.3g} from {point.family} at {q}"
        lines.append(page.paragraph(said, first="  ", rest="    "))
    return [page.paragraph(what, rest="  "), page.table(table), "\n".join(lines)]


MEASURES = ("sigma", "clearance")
"""What a map measures."""

RESULT = "result.json"
"""File of a folder that holds the result of a complete map."""


def _families(arm: Arm, forms: Forms | None) -> Watched:
    """Families of ``forms``, by default of the closed form of ``arm``."""
    watched = watch(forms_of(arm, forms, form_to_measure))
    OptionError.refuse_if(
        not watched.names,
        f"{arm.name} has no known family of singular configurations, so that every "
        "clearance is infinite: map sigma instead",
    )
    return watched


def _spread(near: Watched, tally: Tally, locate: Callable[[int], Array]) -> ClearanceSpread:
    """Turn a tally that has seen something into a result."""
    upper, lower = distributions(tally, locate)
    Q = np.stack([locate(i) for i in tally.points["index"].tolist()])
    family = nearest_family(near.conditions, Q)[0]
    nearest = tuple(
        ClearancePoint(i, q, low, high, near.names[k])
        for (i, high, low), q, k in zip(tally.points.tolist(), Q, family, strict=True)
    )
    return ClearanceSpread(near.names, near.complete, lower, upper, nearest)


class MapJob(Job):
    """A map as work in chunks: small, and able to be pickled.

    ``keep_values``: all singular values are part of the records; ``near``: so is the clearance.
    """

    def __init__(
        self, plan: MapPlan, batch: Batch, keep_values: bool = False, near: Watched | None = None
    ) -> None:
        self.plan, self.batch, self.keep_values = plan, batch, keep_values
        self.count, self.size = plan.count, plan.chunk
        self.names: tuple[str, ...] = () if near is None else near.names
        self.conditions = None if near is None else near.conditions

    def tallies(self) -> list[Tally]:
        """Empty tallies of what is measured."""
        found = [Tally(self.plan.worst)]
        if self.conditions is not None:
            found.append(Tally(self.plan.worst, "clearance_", ratios=False))
        return found

    def measure(self, Q: Array) -> tuple[Array, list[tuple[Array, Array]]]:
        """Singular values (N, r) at Q (N, n), and what each tally counts of them."""
        sigma, ratio = measured(self.batch, Q)
        found = [(sigma[:, -1], ratio)]
        if self.conditions is not None:
            isa = None if self.batch.engine == PINOCCHIO else self.batch.engine
            near = two_sided(self.conditions, Q, compiled=isa is not None, threads=1, isa=isa)
            found.append((near.upper, near.lower))
        return sigma, found

    def identity(self) -> Mapping[str, Any]:
        """Return what decides the numbers, as plain JSON values."""
        values: dict[str, Any] = {"keep_values": self.keep_values}
        if (c := self.conditions) is not None:
            digest = hashlib.sha256(repr(self.names).encode())
            for name, value in {
                "families": c.families,
                **c.flat,
                "norm": c.norm,
                "sure": c.sure,
            }.items():
                data = value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()
                digest.update(f"{name}:{len(data)};".encode() + data)
            values["clearance"] = digest.hexdigest()
        return run_identity("map", self.batch) | self.plan.identity() | values

    def part(self, index: int) -> Callable[[], Record]:
        """Return what computes one chunk."""
        return functools.partial(compute_map_chunk, self, index)

    def check(self, index: int, record: Record) -> None:
        """Raise a DamagedError that says why ``record`` cannot be that of a chunk."""
        start, stop = self.span(index)
        names = [name for tally in self.tallies() for name in tally.names]
        check_names(record, (*names, *(["sigma"] if self.keep_values else [])))
        if self.keep_values:
            finite(record, "sigma", (stop - start, generic_rank(self.batch.arm)))
        for k, tally in enumerate(self.tallies()):

            def again(numbers: list[int], k: int = k) -> tuple[Array, Array]:
                return self.measure(np.stack([self.plan.configuration(i) for i in numbers]))[1][k]

            tally.check(record, stop - start, start, stop, again)

    def room(self, index: int) -> int:
        """Bytes that the arrays of a chunk take at most."""
        start, stop = self.span(index)
        values = 8 * generic_rank(self.batch.arm) * (stop - start) if self.keep_values else 0
        return values + sum(tally.room(stop - start) for tally in self.tallies())


def compute_map_chunk(job: MapJob, index: int) -> Record:
    """Return tallies of one chunk as arrays, with ``sigma`` (N, r) if values are kept."""
    # Blocks begin at multiples of BLOCK whatever the chunks: the same operands give the same bits.
    start, stop = job.span(index)
    tallies, kept = job.tallies(), []
    for first in range(start, stop, BLOCK):
        sigma, values = job.measure(rows_of(job.plan, first, min(stop, first + BLOCK)))
        for tally, both in zip(tallies, values, strict=True):
            tally.add(first, *both)
        if job.keep_values:
            kept.append(sigma)
    record = {name: array for tally in tallies for name, array in tally.record().items()}
    if job.keep_values:
        record["sigma"] = np.concatenate(kept)
    return record


@checked
def sigma_map(
    arm: Arm,
    sampling: str = "sobol",
    *,
    measure: str = "sigma",
    forms: Forms | None = None,
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
    out: str | os.PathLike[str] | None = None,
    engine: str = "auto",
    threads: int | None = None,
    executor: Executor | None = None,
    parallel: int | None = None,
    progress: Progress | None = None,
    tell: Tell | None = None,
) -> MapResult:
    """Map sigma_r, or the clearance, over the joints: how it is distributed, where it is smallest.

    The memory taken does not depend on ``count``: some 2 MB a thread, and with
    ``keep_values`` two chunks of singular values a thread (8 r bytes a configuration).
    The result does not depend on ``chunk``, threads or executor, to the last bit.

    Parameters
    ----------
    arm : Arm
        Any arm; its own (raw) geometry.
    sampling : str
        ``sobol`` (evenly spread, the default), ``random``, or ``grid``.
    measure : str
        ``sigma``, or ``clearance``: the proven lower bound and the upper bound of the distance
        to the nearest family as well, as ``pinsing.clearance`` gives them without ``certify``.
    forms : ClosedForm or sequence of ClosedForm, optional
        For the clearance; ``closed_form(arm)`` by default.
    count : int, optional
        Configurations; 2**20 by default. A grid takes as many as fit.
    steps : int or mapping of joint names to int, optional
        Values of each joint in a grid. Where a range is a whole turn its end is left out.
    joints : sequence of str, optional
        Joints to map, in a grid the last changing fastest; all that change a singular value
        by default.
    ranges : mapping of joint names to (low, high), optional
        Radians or metres; the limits by default, of a joint without limits one turn.
    q : (n,) or (nq,) array_like, optional
        Where the other joints stay; the middle of their ranges by default.
    ignore_limits : bool
        Ignore joint limits.
    seed : int
        Of the sample.
    worst : int
        How many of the worst configurations to keep.
    chunk : int, optional
        Configurations of a chunk, made a multiple of 4096.
    keep_values : bool
        Keep all singular values in ``out``: ``sigma`` in ``chunks/*.npz``, for the
        configurations that ``plan.configurations`` gives.
    out : path-like, optional
        Folder that each finished chunk is put in. A run that was stopped, or killed, goes on
        when called again.
    engine : str
        ``auto``, ``batch``, ``pinocchio``, or an instruction set (``baseline``, ``avx2``,
        ``avx512``). A run that goes on keeps the one it began with.
    threads : int, optional
        As many as the process may use by default.
    executor : Executor, optional
        Takes the chunks instead of threads: any ``concurrent.futures.Executor``.
    parallel : int, optional
        How many chunks it works on at once; the number of processors here by default.
    progress : callable, optional
        Called with (configurations done, all of them).
    tell : callable, optional
        Called with sentences for people: how much was there already, what was damaged.

    Returns
    -------
    MapResult
        After Ctrl-C, of what was done until then, with ``complete`` False.

    Raises
    ------
    ConfigurationError, OptionError, UnknownNameError
        As `plan_map`.
    EngineError
        If the engine is not there or disagrees with Pinocchio.
    OutputError
        If ``out`` cannot be used, holds another run, or the disk is full.
    WorkerError
        If a worker died, or failed.

    Examples
    --------
    >>> import pinsing
    >>> result = pinsing.sampling.sigma_map(pinsing.load("planar3r"), count=4096)
    >>> result.done, result.singular, result.near_singular
    (4096, 0, 276)
    """
    plan = plan_map(
        arm,
        sampling,
        count=count,
        steps=steps,
        joints=joints,
        ranges=ranges,
        q=q,
        ignore_limits=ignore_limits,
        seed=seed,
        worst=worst,
        chunk=chunk,
        keep_values=keep_values,
    )
    UnknownNameError.refuse_if(measure not in MEASURES, "measure", measure, MEASURES)
    OptionError.refuse_if(
        measure == "sigma" and forms is not None,
        "forms belong to a map of the clearance: give measure='clearance'",
    )
    OptionError.refuse_if(
        keep_values and out is None, "keep_values needs a folder to keep them in: give out"
    )
    near = _families(arm, forms) if measure == "clearance" else None
    job = MapJob(plan, planned_batch(arm, out, engine), keep_values, near)
    tally, *distances = tallies = job.tallies()
    notes = plan.notes

    def take(start: int, record: Record) -> None:
        for one in tallies:
            one.join(record)

    with running(job, out, threads, executor, parallel, progress, tell) as run:
        if not run.reduce(take):
            notes += (f"stopped after {tally.done:,} of {plan.count:,} configurations",)
        if not tally.done:
            raise KeyboardInterrupt
        locate = plan.configuration
        sigma_min, ratio = distributions(tally, locate)
        result = MapResult(
            plan=plan,
            engine=job.batch.engine,
            done=tally.done,
            singular=tally.singular,
            near_singular=tally.near,
            sigma_min=sigma_min,
            ratio=ratio,
            worst=worst_points(tally, locate),
            complete=tally.done == plan.count,
            notes=notes,
            clearance=None if near is None else _spread(near, distances[0], locate),
        )
        if run.folder is not None and result.complete:
            run.folder.write_bytes(run.folder.path / RESULT, (result.to_json() + "\n").encode())
    return result
