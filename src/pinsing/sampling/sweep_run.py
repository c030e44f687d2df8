"""The paper's joint-angle parameterization method: run the plan in chunks, reduce it as it goes.

One, two, three, ... joints at special values while each remaining joint runs over its range
and the rest stay at the nominal configuration (paper, Section 3.2, steps (1) to (4)).

The result is the same to the last bit however the curves are shared out among chunks: the blocks
that are computed at a time do not depend on them.
"""

from __future__ import annotations

import functools
import hashlib
import io
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pinsing.arguments import checked, typed, whole_number
from pinsing.atomic_write import MEBIBYTE, write_bytes
from pinsing.chunk_file import DamagedError, Record, read_arrays, read_bounded
from pinsing.errors import OptionError, ResultError, UnknownNameError
from pinsing.kinematics.batch import Batch
from pinsing.kinematics.verdict import Status, last_and_ratio, measured, run_identity, status_of
from pinsing.measures import Array, ArrayLike
from pinsing.prose import PLAIN, Page, Span, alarm, unbroken, verdict
from pinsing.robot.arm import Arm, ArmSummary
from pinsing.sampling.execute import (
    Job,
    Progress,
    RunOptions,
    Tell,
    planned_batch,
    running,
)
from pinsing.sampling.generalize import Finding, apart, finding_spans, value_text
from pinsing.sampling.map_plan import WORST
from pinsing.sampling.sweep_plan import (
    SAMPLES,
    SPECIAL_ANGLES,
    CurveRows,
    CurveTable,
    Special,
    SweepPlan,
    axis_values,
    kinds,
    plan_sweep,
)
from pinsing.sampling.tally import (
    CANDIDATES,
    Candidates,
    Distribution,
    Pool,
    Tally,
    WorstPoint,
    check_names,
    distributions,
    finite,
    minima,
    worst_points,
)
from pinsing.serialization import JsonResult

CURVES = "sweep.npz"
"""File of the folder of a complete sweep that holds its result, with the curves if kept."""


@dataclass(frozen=True, eq=False)
class SweepCurve:
    """Distribution of sigma_r along one joint."""

    # number of joints at special values; 0 for the curves from the nominal configuration
    level: int
    fixed: Mapping[str, float]  # joints at special values, radians or metres
    forced: bool  # ``fixed`` alone is singular whatever the others, and so is the whole curve
    moving: int  # index of the joint that moves
    x: Array  # (samples,): its values, radians or metres
    sigma_min: Array  # (samples,): sigma_r of the task Jacobian, raw geometry
    sigma_ratio: Array  # (samples,): sigma_r / sigma_1
    number: int  # its place in the plan

    def holds(self, values: Mapping[str, float], arm: ArmSummary) -> bool:
        """Return True if those joints, and no others, are at these special values."""
        slides = dict(zip(arm.joints, arm.prismatic, strict=True))
        return set(values) == set(self.fixed) and all(
            apart(value, self.fixed[name], bool(slides[name])) < 1e-9
            for name, value in values.items()
        )


@dataclass(frozen=True)
class UniformRow:
    """All revolute joints at one special value: step (2)."""

    value: float  # radians
    # sigma_min and sigma_ratio: sigma_r, and sigma_r / sigma_1
    sigma_min: float
    sigma_ratio: float
    status: Status  # ``singular``, ``near-singular`` or ``regular``


@dataclass(frozen=True, eq=False)
class SweepSummary:
    """How sigma_r is distributed over the samples of all curves.

    Curves whose special values alone are singular whatever the others are left out: all of
    them is rounding. The number of a configuration is that of its curve times the samples of a
    curve, plus that of the sample.
    """

    count: int  # configurations
    # singular and near_singular: how many of them are that (ratio at most 1e-9; above it and at
    # most 1e-2)
    singular: int
    near_singular: int
    # sigma_min and ratio: of sigma_r, and of sigma_r / sigma_1
    sigma_min: Distribution
    ratio: Distribution
    # those of smallest ratio, smallest first, the first of equals first
    worst: tuple[WorstPoint, ...]

    def __str__(self) -> str:
        ratio = self.ratio
        shown = ", ".join(
            f"{name} {ratio.quantile(p):.3g}"
            for p, name in ((0.01, "1 %"), (0.1, "10 %"), (0.5, "median"))
        )
        return (
            f"sigma_r/sigma_1 over {self.count:,} configurations: "
            f"smallest {ratio.smallest.value:.3g}, {shown}, largest {ratio.largest.value:.3g}; "
            f"{self.singular:,} singular, {self.near_singular:,} near-singular"
        )


@dataclass(frozen=True, eq=False)
class SweepResult(JsonResult):
    """All that a sweep has computed.

    Attributes
    ----------
    plan : SweepPlan
        What was asked for.
    uniform : tuple of UniformRow
        All joints at each special value.
    curves : tuple of SweepCurve
        In the order of the plan; empty if they are not kept.
    complete : bool
        False if the sweep was stopped.
    notes : tuple of str
        The notes of the plan, and what happened on the way.
    engine : str
        ``pinocchio``, or the instruction set: the same one gives the same bits.
    kept : bool
        Whether ``curves`` has them.
    done : int
        Jacobians computed.
    summary : SweepSummary or None
        How sigma_r is distributed over the curves; None if there was no curve to look at.
    candidates : Candidates
        The dips of the curves.
    """

    schema: ClassVar[str] = "pinsing/sweep/1"
    made_by: ClassVar[str] = "pinsing.sampling.sweep(arm)"

    plan: SweepPlan
    uniform: tuple[UniformRow, ...]
    curves: tuple[SweepCurve, ...]
    complete: bool
    notes: tuple[str, ...]
    engine: str
    kept: bool
    done: int
    summary: SweepSummary | None
    candidates: Candidates

    @property
    def arm(self) -> ArmSummary:
        """The arm that was swept."""
        return self.plan.arm

    @checked
    def curve(self, fixed: Mapping[str, float] | None, moving: str | int) -> SweepCurve:
        """Look up the curve of joint ``moving`` with ``fixed`` at special values.

        Parameters
        ----------
        fixed : mapping of str to float
            Radians or metres; values of revolute joints up to whole turns. Empty for level 0.
        moving : str or int
            Name or index of the joint.

        Returns
        -------
        SweepCurve
            Its ``x`` and ``sigma_min``, among others.

        Raises
        ------
        UnknownNameError
            If a joint does not exist.
        OptionError
            If there is no such curve, or the curves are not kept.

        Examples
        --------
        >>> import pinsing
        >>> curve = pinsing.sampling.sweep(pinsing.load("planar3r")).curve({}, "q2")
        >>> curve.x.shape, curve.sigma_min.max().round(3).item()
        ((181,), 0.206)
        """
        names = self.arm.joints
        wanted = dict(fixed or {})
        self._known((*wanted, *([moving] if isinstance(moving, str) else [])))
        index = (
            names.index(moving)
            if isinstance(moving, str)
            else whole_number(moving, "moving", 0, len(names) - 1)
        )
        for curve in self.curves:
            if curve.moving == index and curve.holds(wanted, self.arm):
                return curve
        OptionError.refuse_if(
            not self.kept,
            f"the curves of this sweep are not kept ({self.plan.n_jacobians:,} Jacobians); sweep "
            "fewer of them",
        )
        raise OptionError(
            f"there is no curve of {names[index]} with {self.set_text(wanted) or 'no joint fixed'}"
            ": outside the plan, or left out because a part of it is singular already"
        )

    @checked
    def set_text(self, fixed: Mapping[str, float]) -> str:
        """Return the special values in words.

        Parameters
        ----------
        fixed : mapping of str to float
            Radians or metres, by names of joints.

        Raises
        ------
        UnknownNameError
            If a joint does not exist.

        Examples
        --------
        >>> import math, pinsing
        >>> pinsing.sampling.sweep(pinsing.load("planar3r")).set_text({"q2": 0, "q3": math.pi / 2})
        'q2 = 0, q3 = 90 deg'
        """
        self._known(fixed)
        sliding = dict(zip(self.arm.joints, self.arm.prismatic, strict=True))
        return ", ".join(f"{n} = {value_text(v, bool(sliding[n]))}" for n, v in fixed.items())

    def _known(self, joints: Iterable[str]) -> None:
        for name in joints:
            UnknownNameError.refuse_if(name not in self.arm.joints, "joint", name, self.arm.joints)

    def __str__(self) -> str:
        return sweep_text(self)


def sweep_text(
    result: SweepResult,
    findings: Sequence[Finding] | None = None,
    page: Page = PLAIN,
    degrees: bool = False,
) -> str:
    """Return what was swept, what was found, and what was left out."""
    lines = [page.paragraph(*spans, rest="  ") for spans in _swept(result, degrees, page.width - 2)]
    if findings is not None:
        title: Span = "Found, refined and generalised:" if findings else "Nothing singular found."
        lines += ["", page.paragraph(title)]
        lines += [page.paragraph(*finding_spans(f), first="  - ") for f in findings]
    if result.notes:
        lines += ["", "Notes:"]
        lines += [page.paragraph(note, first="  - ") for note in result.notes]
    return "\n".join(lines)


def _swept(result: SweepResult, degrees: bool, room: int) -> Iterator[tuple[Span, ...]]:
    plan = result.plan
    yield (f"sweep of {result.arm.name}: {plan}",)
    at = typed(plan.nominal, result.arm.prismatic, degrees, 9, room=room)
    origin = {
        "given": "as given",
        "pi/3": "60 degrees, as in the paper",
        "random": "the best conditioned of some random ones",
    }.get(plan.nominal_origin, plan.nominal_origin)
    sigma = unbroken(f"sigma_min = {plan.nominal_sigma[-1]:.6g}")
    yield (f"nominal configuration ({origin}): {at}; {sigma}",)
    for row in result.uniform:
        value = unbroken(value_text(row.value))
        yield (
            f"all joints at {value}: {unbroken(f'sigma_min = {row.sigma_min:.3g}')}, ",
            verdict(row.status),
        )
    for fixed in plan.forced:
        condition = unbroken(result.set_text(fixed)).replace(",\u00a0", ", ")
        yield f"{condition}: ", alarm("singular"), " whatever the others"
    if result.summary is not None:
        yield (str(result.summary).replace(" %", "\u00a0%"),)


def curves_of(
    table: CurveTable,
    numbers: ArrayLike,
    x: Array,
    sigma_min: Iterable[Array],
    sigma_ratio: Iterable[Array],
) -> Iterator[SweepCurve]:
    """Curves ``numbers`` (C,) of a table, from their values and those (n, S) of all joints."""
    rows = table.rows(numbers)
    values = zip(rows.numbers.tolist(), sigma_min, sigma_ratio, strict=True)
    for k, (number, last, ratio) in enumerate(values):
        yield SweepCurve(
            level=int(rows.fixed[k].sum()),
            fixed=table.fixed_values(rows, k),
            forced=bool(rows.forced[k]),
            moving=int(rows.moving[k]),
            x=x[rows.moving[k]],
            sigma_min=last,
            sigma_ratio=ratio,
            number=number,
        )


def pack_sweep(result: SweepResult) -> bytes:
    """Bytes of the file that `save_npz` writes."""
    table = CurveTable(result.plan)
    rows = table.rows([c.number for c in result.curves])
    shape = len(result.curves), result.plan.samples if result.curves else 0
    header = replace(result, curves=()).to_dict()
    arrays = {
        "header": np.array(json.dumps(header, allow_nan=False).encode()),
        "number": rows.numbers,
        "level": rows.fixed.sum(axis=1),
        "moving": rows.moving,
        "forced": rows.forced,
        "fixed": np.where(rows.fixed, rows.base, np.nan),
        "x": axis_values(table.ranges, result.plan.samples, np.arange(shape[1])[None]),
        "sigma_min": np.array([c.sigma_min for c in result.curves]).reshape(shape),
        "sigma_ratio": np.array([c.sigma_ratio for c in result.curves]).reshape(shape),
    }
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)
    return packed.getvalue()


# Jacobians of a chunk at least, in memory and in a folder, where it is 1 MB with its curves.
_CHUNK, _CHUNK_ON_DISK = 16_384, 65_536


@dataclass(frozen=True)
class Kept:
    """What chunks keep."""

    values: bool  # all of sigma_r and sigma_r / sigma_1: 16 bytes for each Jacobian
    worst: int  # how many of the worst configurations
    candidates: int  # how many dips at most


class SweepJob(Job):
    """The curves of a sweep, ``curves`` in each chunk; ``table`` has all."""

    def __init__(self, plan: SweepPlan, batch: Batch, curves: int, kept: Kept) -> None:
        self.plan, self.batch, self.kept, self.curves = plan, batch, kept, curves
        self.table = CurveTable(plan)
        self.count, self.size = len(self.table) * plan.samples, curves * plan.samples

    def identity(self) -> Mapping[str, Any]:
        """Return what decides the numbers, as plain JSON values."""
        plan = self.plan
        digest = hashlib.sha256(self.table.ranges.tobytes())
        for level in plan.levels:
            digest.update(f"{level.level} {level.swept} {level.values.shape};".encode())
            digest.update(level.joints.astype(np.int64).tobytes())
            digest.update(level.values.tobytes() + level.forced.tobytes())
        digest.update(repr([(e.swept, e.reason) for e in plan.effects]).encode())
        return run_identity("sweep", self.batch) | {
            "records": 2,  # of this form; those of another are no damaged ones
            "joints": list(plan.arm.joints),
            "nominal": plan.nominal.tolist(),
            "samples": plan.samples,
            "curves": len(self.table),
            "chunks": self.chunks,
            "curves_of_a_chunk": self.curves,
            "keep": self.kept.values,
            "worst": self.kept.worst,
            "candidates": self.kept.candidates,
            "ranges and special values": digest.hexdigest(),
        }

    def _rows(self, index: int) -> CurveRows:
        start, stop = (number // self.plan.samples for number in self.span(index))
        return self.table.rows(np.arange(start, stop))

    def part(self, index: int) -> Callable[[], Record]:
        """One chunk, with no more than it needs."""
        return functools.partial(
            compute_curves, self.batch, self.kept, self.table.ranges, self.plan.samples,
            self._rows(index),
        )  # fmt: skip

    def check(self, index: int, record: Record) -> None:
        """Raise a DamagedError that says why ``record`` cannot be that of a chunk."""
        start, stop = self.span(index)
        tally, pool = Tally(self.kept.worst), Pool(self.kept.candidates)
        values = VALUES if self.kept.values else ()
        check_names(record, (*tally.names, *pool.names, *values))
        regular = int((~self._rows(index).singular).sum()) * self.plan.samples
        measure = functools.partial(last_and_ratio, self.batch)
        tally.check(record, regular, start, stop, self.table.configuration, measure)
        pool.check(record, start, stop, regular)
        for name in values:
            finite(record, name, (stop - start,))

    def room(self, index: int) -> int:
        """Bytes that the arrays of a chunk take at most."""
        start, stop = self.span(index)
        count, kept = stop - start, self.kept
        dips = 32 * min(kept.candidates, count)
        return Tally(kept.worst).room(count) + dips + (16 * count if kept.values else 0)


def compute_curves(
    batch: Batch,
    kept: Kept,
    ranges: Array,
    samples: int,
    rows: CurveRows,
) -> Record:
    """Return the tally and candidates of one chunk as arrays.

    With ``kept.values`` also ``sigma_min`` and ``sigma_ratio`` (N,). Joints move over ``ranges``
    (n, 2) in ``samples``; ``rows`` are its curves.
    """
    tally, pool = Tally(kept.worst), Pool(kept.candidates)
    sigma_min: list[Array] = []
    sigma_ratios: list[Array] = []
    places, block = np.arange(samples)[None], _curves_per_block(samples)
    for first in range(0, len(rows.numbers), block):
        some = slice(first, first + block)
        moving = rows.moving[some]
        Q = np.repeat(rows.base[some, None], samples, axis=1)
        moved = axis_values(ranges[moving], samples, places)
        np.put_along_axis(Q, moving[:, None, None], moved[..., None], axis=2)
        found = measured(batch, Q.reshape(-1, Q.shape[2]))
        last, ratio = (x.reshape(Q.shape[:2]) for x in (found.sigma[:, -1], found.ratio))
        numbers = rows.numbers[some, None] * samples + places
        regular = ~rows.singular[some]
        tally.add(0, last[regular].ravel(), ratio[regular].ravel(), numbers[regular].ravel())
        dip = minima(last, ratio) & regular[:, None]
        row, column = np.nonzero(dip)
        kind = kinds(rows, samples, row + first, column)
        pool.add(numbers[dip], kind, last[dip], ratio[dip])
        if kept.values:
            sigma_min.append(last.ravel())
            sigma_ratios.append(ratio.ravel())
    record = tally.record() | pool.record()
    if kept.values:
        record |= zip(VALUES, map(np.concatenate, (sigma_min, sigma_ratios)), strict=True)
    return record


def _curves_per_block(samples: int) -> int:
    return max(1, 4096 // samples)  # configurations that are treated at a time, of shorter curves


KEEP_BYTES = 64 * MEBIBYTE
"""Curves are part of the result up to this size: 16 bytes for each Jacobian."""

VALUES = ("sigma_min", "sigma_ratio")
"""Names of the arrays of kept curves in a record: 16 bytes for each Jacobian."""


@checked
def sweep(
    arm: Arm,
    nominal: ArrayLike | None = None,
    special: Special = SPECIAL_ANGLES,
    levels: int | Iterable[int] | None = None,
    samples: int = SAMPLES,
    joints: Sequence[str] | None = None,
    ignore_limits: bool = False,
    prune: bool = True,
    progress: Progress | None = None,
    seed: int = 0,
    geometry: Arm | None = None,
    keep: bool | None = None,
) -> SweepResult:
    """Sweep an arm the paper's way, level by level.

    Parameters
    ----------
    arm : Arm
        Any arm; the curves are of its own (raw) geometry.
    nominal : (n,) or (nq,) array_like, optional
        Configuration that the joints rest at, radians or metres; found if not given: pi/3 for
        all revolute joints (the paper's choice) if that will do.
    special : sequence of float, or mapping of joint names to such
        Special values of the revolute joints, radians, or of single joints. Prismatic joints
        take 0 and the middle of their range.
    levels : int or iterable of int, optional
        How many joints are at special values at once; an int means 1 up to it. 1 and 2 by
        default, up to n - 1.
    samples : int
        Points of a curve.
    joints : sequence of str, optional
        Joints that take part; all that change sigma_min by default.
    ignore_limits : bool
        Ignore joint limits.
    prune : bool
        Leave out sets that contain one that is singular whatever the others. False keeps
        everything, as the paper's figures do.
    progress : callable, optional
        Called with (Jacobians done, all of them).
    seed : int
        Of all random values.
    geometry : Arm, optional
        Geometry for the tests whether a set is singular whatever the others, instead of the
        nominal geometry of ``arm``.
    keep : bool, optional
        Keep the curves, of 4 million Jacobians at most; by default where they are no more.

    Returns
    -------
    SweepResult
        After Ctrl-C, what was done until then, with ``complete`` False.

    Raises
    ------
    ConfigurationError, OptionError, UnknownNameError
        As ``plan_sweep``.

    Examples
    --------
    >>> import pinsing
    >>> result = pinsing.sampling.sweep(pinsing.load("planar3r"))
    >>> len(result.curves), result.complete
    (3, True)
    """
    plan = plan_sweep(
        arm, nominal, special, levels, samples, joints, ignore_limits, prune, seed, geometry
    )
    return run_sweep(arm, plan, progress, keep=keep)


def run_sweep(
    arm: Arm,
    plan: SweepPlan,
    progress: Progress | None = None,
    *,
    keep: bool | None = None,
    worst: int = WORST,
    candidates: int = CANDIDATES,
    chunk: int | None = None,
    out: str | os.PathLike[str] | None = None,
    engine: str = "auto",
    threads: int | None = None,
    executor: Executor | None = None,
    parallel: int | None = None,
    tell: Tell | None = None,
) -> SweepResult:
    """Run a plan made for ``arm``; after Ctrl-C ``complete`` is False. Options as of `sweep`.

    The memory taken does not depend on the number of Jacobians: some 3 MB a thread, about 100 bytes
    a candidate, and the curves, which are part of the result up to `KEEP_BYTES` unless ``keep``
    says. ``worst`` configurations and ``candidates`` for `singular_configurations` are kept
    (`pinsing.sampling.tally` says which). A stopped run in ``out`` goes on when called again. The
    result does not depend on ``chunk`` (Jacobians, about), threads or executor, to the last bit.
    OptionError if curves that are to be kept are larger.
    """
    for name, number in (("worst", worst), ("candidates", candidates), ("chunk", chunk)):
        OptionError.refuse_if(
            number is not None and number < 1, f"{name} must be at least 1, got {number}"
        )
    options = RunOptions(out, engine, threads, executor, parallel, progress, tell)
    kept = Kept(keep is not False and check_keep(plan, keep), int(worst), int(candidates))
    if chunk is None:
        most = _CHUNK_ON_DISK if kept.values else 524_288  # in 256 chunks, without the curves
        chunk = max(_CHUNK if out is None else _CHUNK_ON_DISK, min(most, plan.n_jacobians // 256))
    block = _curves_per_block(plan.samples)
    size = max(1, chunk // plan.samples // block) * block
    job = SweepJob(plan, planned_batch(arm, options), int(size), kept)
    return _run(job, options, keep)


def _run(job: SweepJob, options: RunOptions, keep: bool | None) -> SweepResult:
    """All chunks of a sweep, joined; the curves too if they are kept."""
    plan, kept, table, batch = job.plan, job.kept, job.table, job.batch
    some = len(plan.uniform) > 0
    last, ratio = last_and_ratio(batch, plan.uniform) if some else (np.empty(0), np.empty(0))
    uniform = tuple(
        UniformRow(value, sigma_min, sigma_ratio, status_of(sigma_ratio))
        for value, sigma_min, sigma_ratio in zip(
            plan.uniform_values.tolist(), last.tolist(), ratio.tolist(), strict=True
        )
    )
    tally, pool = Tally(kept.worst), Pool(kept.candidates)
    values = np.full((2, job.count if kept.values else 0), np.nan)  # of curves that have come in
    notes = list(plan.notes)

    def take(start: int, record: Record) -> None:
        tally.join(record)
        pool.join(record)
        for row, name in zip(values, VALUES if kept.values else (), strict=False):
            row[start : start + len(record[name])] = record[name]

    with running(job, options) as run:
        if not run.reduce(take, len(uniform)):
            notes.append(f"stopped after {run.done // plan.samples} of {len(table)} curves")
        found = pool.candidates(plan.samples)
        if found.found > len(found):
            notes.append(
                f"{found.found:,} dips of sigma_min, of which {len(found):,} are refined: "
                "the smallest of each combination of joints, spread over their ranges"
            )
        if not kept.values and keep is not False:
            need = _size(16 * plan.n_jacobians)
            notes.append(f"the curves are not part of the result: they take {need}")
        summary = None
        if tally.done:
            spread = distributions(tally, table.configuration)
            worst = worst_points(tally, table.configuration)
            summary = SweepSummary(tally.done, tally.singular, tally.near, *spread, worst)
        x = axis_values(table.ranges, plan.samples, np.arange(plan.samples)[None])
        last, ratio = values.reshape(2, -1, plan.samples)
        there = np.flatnonzero(~np.isnan(last[:, 0]))
        curves = curves_of(table, there, x, (last[i] for i in there), (ratio[i] for i in there))
        result = SweepResult(
            plan=plan,
            uniform=uniform,
            curves=tuple(curves),
            complete=run.done == job.count,
            notes=tuple(notes),
            engine=batch.engine,
            kept=kept.values,
            done=len(uniform) + run.done,
            summary=summary,
            candidates=found,
        )
        if run.folder is not None and result.complete:
            run.folder.write_bytes(run.folder.path / CURVES, pack_sweep(result))
    return result


def check_keep(plan: SweepPlan, keep: bool | None) -> bool:
    """Return True if the curves of ``plan`` fit into a result."""
    need = 16 * plan.n_jacobians
    OptionError.refuse_if(
        need > KEEP_BYTES and keep,
        f"the curves of {plan.n_jacobians:,} Jacobians take {_size(need)}, and a result holds "
        f"at most {_size(KEEP_BYTES)}; sweep fewer of them",
    )
    return need <= KEEP_BYTES


def _size(need: int) -> str:
    return f"{need / 2**30:.3g} GiB" if need >= 2**30 else f"{need / 2**20:.3g} MiB"


_ROOM = 1024 * MEBIBYTE  # bytes that a saved sweep may take


def save_npz(result: SweepResult, path: str | os.PathLike[str]) -> Path:
    """Write a sweep to ``path`` (``.npz``), readable with ``numpy.load`` alone, or nothing.

    Arrays, for C curves of S samples of an arm of n joints: ``number`` (C,), ``level`` (C,),
    ``moving`` (C,), ``forced`` (C,), ``fixed`` (C, n) with NaN where a joint is not at a special
    value, ``x`` (n, S), ``sigma_min`` and ``sigma_ratio`` (C, S), ``header`` (JSON text). If the
    curves are not part of the result, C and S are 0.
    """
    target = Path(path)
    if target.suffix != ".npz":
        target = target.with_name(target.name + ".npz")
    write_bytes(target, pack_sweep(result))
    return target


def load_npz(path: str | os.PathLike[str]) -> SweepResult:
    """Return what ``save_npz`` wrote; ResultError if it is missing, damaged, or something else."""
    try:
        arrays: dict[str, Any] = dict(
            read_arrays(read_bounded(Path(path), _ROOM, follow=True), _ROOM)
        )
        header: dict[str, Any] = json.loads(arrays["header"].item())
        bare = SweepResult.from_dict(header)
        values = (arrays[name] for name in ("number", "x", "sigma_min", "sigma_ratio"))
        curves = tuple(curves_of(CurveTable(bare.plan), *values))
    except OSError as error:
        raise ResultError(f"cannot read {path}: {error.strerror or error}") from None
    except (KeyError, IndexError, TypeError, ValueError, RecursionError, DamagedError) as error:
        if isinstance(error, ResultError):
            raise ResultError(f"{path}: {error}") from None
        raise ResultError(f"{path} is not a saved sweep, or is damaged: {error}") from None
    return replace(bare, curves=curves)
