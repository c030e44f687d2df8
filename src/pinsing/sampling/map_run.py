"""Run a map: chunk by chunk, in bounded memory, and in a folder if it is to last."""

from __future__ import annotations

import functools
import hashlib
import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from pinsing.algebra.conditions import Conditions
from pinsing.algebra.nearest import two_sided
from pinsing.arguments import checked, typed
from pinsing.chunk_file import Record
from pinsing.errors import OptionError, UnknownNameError
from pinsing.families.solve import form_to_measure
from pinsing.kinematics.batch import PINOCCHIO, Batch
from pinsing.kinematics.verdict import generic_rank, measured, run_identity
from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL, Array, ArrayLike
from pinsing.prose import PLAIN, Page, Span, Table, alarm, caution, verdict
from pinsing.proximity.clearance import nearest_family
from pinsing.proximity.watched import Forms, require_forms_of, watch
from pinsing.robot.arm import Arm
from pinsing.sampling.execute import Job, Progress, RunOptions, Tell, planned_batch, running
from pinsing.sampling.map_plan import BLOCK, WORST, MapPlan, plan_map, rows_of
from pinsing.sampling.tally import (
    QUANTILE_ERROR,
    Distribution,
    Tally,
    WorstPoint,
    check_names,
    distributions,
    finite,
    worst_points,
)
from pinsing.serialization import JsonResult

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


@dataclass(frozen=True, eq=False)
class Nearness:
    """The families of a map as flat arrays: small, and able to be pickled."""

    names: tuple[str, ...]  # of the families
    complete: bool  # whether the closed form is complete
    conditions: Conditions  # the families

    @classmethod
    def of(cls, arm: Arm, forms: Forms | None) -> Nearness:
        """Families of ``forms``, by default of the closed form of ``arm``."""
        if forms is None:
            forms = form_to_measure(arm)
        require_forms_of(forms, arm)
        watched = watch(forms)
        OptionError.refuse_if(
            not watched.names,
            f"{arm.name} has no known family of singular configurations, so that every "
            "clearance is infinite: map sigma instead",
        )
        return cls(watched.names, watched.complete, watched.conditions)

    def fingerprint(self) -> str:
        """SHA-256 of the names and of every number of the families."""
        digest = hashlib.sha256(repr(self.names).encode())
        c = self.conditions
        for name, value in {"families": c.families, **c.flat, "norm": c.norm}.items():
            data = value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()
            digest.update(f"{name}:{len(data)};".encode() + data)
        return digest.hexdigest()

    def bounds(self, Q: Array, engine: str) -> tuple[Array, Array]:
        """Return the upper and lower bounds (N,) at configurations Q (N, n)."""
        compiled = engine != PINOCCHIO
        found = two_sided(
            self.conditions, Q, compiled=compiled, threads=1, isa=engine if compiled else None
        )
        return found.upper, found.lower

    def spread(self, tally: Tally, locate: Callable[[int], Array]) -> ClearanceSpread:
        """Turn a tally that has seen something into a result."""
        upper, lower = distributions(tally, locate)
        numbers = tally.worst_index.tolist()
        Q = np.stack([locate(i) for i in numbers])
        family = nearest_family(self.conditions, Q)[0]
        rows = zip(numbers, Q, tally.worst_ratio, tally.worst_sigma, family, strict=True)
        return ClearanceSpread(
            families=self.names,
            complete=self.complete,
            lower=lower,
            upper=upper,
            nearest=tuple(
                ClearancePoint(i, q, float(low), float(high), self.names[k])
                for i, q, low, high, k in rows
            ),
        )


class MapJob(Job):
    """A map as work in chunks: small, and able to be pickled.

    ``keep_values``: all singular values are part of the records; ``near``: so is the clearance.
    """

    def __init__(
        self, plan: MapPlan, batch: Batch, keep_values: bool = False, near: Nearness | None = None
    ) -> None:
        self.plan, self.batch, self.keep_values, self.near = plan, batch, keep_values, near
        self.count, self.size = plan.count, plan.chunk

    def tallies(self) -> list[Tally]:
        """Empty tallies of what is measured."""
        found = [Tally(self.plan.worst)]
        if self.near is not None:
            found.append(Tally(self.plan.worst, "clearance_", ratios=False))
        return found

    def measure(self, Q: Array) -> tuple[Array, list[tuple[Array, Array]]]:
        """Singular values (N, r) at Q (N, n), and what each tally counts of them."""
        sigma, ratio = measured(self.batch, Q)
        found = [(sigma[:, -1], ratio)]
        if self.near is not None:
            found.append(self.near.bounds(Q, self.batch.engine))
        return sigma, found

    def counted(self, k: int, Q: Array) -> tuple[Array, Array]:
        """Return what tally ``k`` counts at Q (N, n)."""
        return self.measure(Q)[1][k]

    def identity(self) -> Mapping[str, Any]:
        """Return what decides the numbers, as plain JSON values."""
        values: dict[str, Any] = {"keep_values": self.keep_values}
        if self.near is not None:
            values["clearance"] = self.near.fingerprint()
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
            again = functools.partial(self.counted, k)
            tally.check(record, stop - start, start, stop, self.plan.configuration, again)

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
    options = RunOptions(out, engine, threads, executor, parallel, progress, tell)
    UnknownNameError.refuse_if(measure not in MEASURES, "measure", measure, MEASURES)
    OptionError.refuse_if(
        measure == "sigma" and forms is not None,
        "forms belong to a map of the clearance: give measure='clearance'",
    )
    OptionError.refuse_if(
        keep_values and out is None, "keep_values needs a folder to keep them in: give out"
    )
    near = Nearness.of(arm, forms) if measure == "clearance" else None
    job = MapJob(plan, planned_batch(arm, options), keep_values, near)
    tally, *distances = tallies = job.tallies()
    notes = plan.notes

    def take(start: int, record: Record) -> None:
        for one in tallies:
            one.join(record)

    with running(job, options) as run:
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
            clearance=None if near is None else near.spread(distances[0], locate),
        )
        if run.folder is not None and result.complete:
            run.folder.write_bytes(run.folder.path / RESULT, (result.to_json() + "\n").encode())
    return result
