"""The paper's joint-angle parameterization method: run the plan, reduce it as it goes.

One, two, three, ... joints at special values while each remaining joint runs over its range
and the rest stay at the nominal configuration (paper, Section 3.2, steps (1) to (4)).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor

import numpy as np
import numpy.typing as npt

from pinsing._types import Ints
from pinsing.arguments import checked
from pinsing.chunk_file import Record
from pinsing.errors import OptionError
from pinsing.kinematics.evaluator import Evaluator
from pinsing.kinematics.verdict import status_of
from pinsing.robot.arm import Arm
from pinsing.sampling.curves import CurveTable, axis_values
from pinsing.sampling.distribution import distributions, worst_points
from pinsing.sampling.execute import planned_evaluator, running
from pinsing.sampling.minima import CANDIDATES, Pool
from pinsing.sampling.npz import CURVES, pack_sweep
from pinsing.sampling.options import Progress, RunOptions, Tell
from pinsing.sampling.planning import planned_sweep
from pinsing.sampling.special_values import SPECIAL_ANGLES, Special
from pinsing.sampling.sweep_job import Kept, SweepJob
from pinsing.sampling.sweep_plan import SAMPLES, SweepOptions, SweepPlan
from pinsing.sampling.sweep_result import (
    HOW_TO_KEEP,
    SweepCurve,
    SweepResult,
    SweepSummary,
    UniformRow,
    curves_of,
)
from pinsing.sampling.tally import Tally

__all__ = [
    "KEEP_BYTES",
    "SweepCurve",
    "SweepResult",
    "SweepSummary",
    "UniformRow",
    "run_sweep",
    "sweep",
]

KEEP_BYTES = 64 << 20
"""Curves are part of the result up to this size: 16 bytes for each Jacobian."""

WORST = 20

_PER_JACOBIAN = 16  # bytes: sigma_r and sigma_r / sigma_1

# Jacobians of a chunk, if none are asked for: the least, in memory and in a folder, where one
# is then 1 MB with its curves; and, without curves, the most, in as many chunks as that.
_CHUNK, _CHUNK_ON_DISK = 16_384, 65_536
_LARGEST_CHUNK, _CHUNKS = 524_288, 256


@checked
def sweep(
    arm: Arm,
    nominal: npt.ArrayLike | None = None,
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
        Sweep whole circles.
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
        Keep the curves. By default they are part of the result up to 4 million Jacobians.

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
    >>> result = pinsing.sweep(pinsing.load("planar3r"))
    >>> len(result.curves), result.complete
    (3, True)
    """
    options = SweepOptions(nominal, special, levels, samples, joints, ignore_limits, prune, seed)
    plan = planned_sweep(arm, options, geometry)
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
    """Run a plan that was made for ``arm``.

    The memory taken does not depend on the number of Jacobians: some 3 MB a thread, about 100
    bytes for each of ``candidates``, and the curves if they are part of the result, which is
    up to `KEEP_BYTES`. The result does not depend on ``chunk``, threads or executor, to the
    last bit.

    Parameters
    ----------
    arm, plan
        What to do.
    progress : callable, optional
        As for `sweep`.
    keep : bool, optional
        Keep the curves. By default they are part of the result up to `KEEP_BYTES` (4 million
        Jacobians), and not kept beyond. Larger ones can be kept in ``out`` alone:
        `pinsing.sampling.npz.kept_curves` reads them from there.
    worst : int
        How many of the worst configurations to keep.
    candidates : int
        How many dips of the curves to keep for `pinsing.singular_configurations`; if there are
        more, a note says so, and `pinsing.sampling.minima` how they are chosen.
    chunk : int, optional
        Jacobians of a chunk, more or less.
    out : path-like, optional
        Folder that finished chunks are put in. A run that was stopped, or killed, goes on when
        called again.
    engine, threads, executor, parallel, tell
        As in ``sigma_map``.

    Returns
    -------
    SweepResult
        After Ctrl-C, of what was done until then, with ``complete`` False.

    Raises
    ------
    OptionError
        If curves are to be kept that are too large for the memory, and there is no ``out``.
    EngineError, OutputError, WorkerError
        As `pinsing.sampling.sigma_map`.
    """
    for name, number in (("worst", worst), ("candidates", candidates), ("chunk", chunk)):
        if number is not None and number < 1:
            raise OptionError(f"{name} must be at least 1, got {number}")
    options = RunOptions(out, engine, threads, executor, parallel, progress, tell)
    inside = check_keep(plan, keep, out is not None)
    kept = Kept(keep is not False and (inside or keep is True), int(worst), int(candidates))
    size = _chunk(plan, kept.values, out is not None) if chunk is None else int(chunk)
    job = SweepJob(plan, planned_evaluator(arm, options), size, kept)
    return _run(job, options, inside, keep)


def _run(job: SweepJob, options: RunOptions, inside: bool, keep: bool | None) -> SweepResult:
    """All chunks of a sweep, joined; the curves too if they fit ``inside`` the result."""
    plan, kept = job.plan, job.kept
    uniform = _uniform(job.evaluator, plan)
    tally, pool = Tally(kept.worst), Pool(kept.candidates)
    curves = _Curves(job.table) if inside and kept.values else None
    notes = list(plan.notes)
    done = 0
    with running(job, options) as (chunks, folder):
        try:
            for index, record in chunks:
                tally.join(Tally.from_record(record, kept.worst))
                pool.join(record)
                if curves is not None:
                    curves.add(record)
                start, stop = job.span(index)
                done += stop - start
                if options.progress is not None:
                    options.progress(len(uniform) + done, plan.n_jacobians)
        except KeyboardInterrupt:
            notes.append(_stopped(done, len(job.table), plan.samples))
        complete = done == len(job.table) * plan.samples
        found = pool.candidates(plan.samples)
        if found.found > len(found):
            notes.append(
                f"{found.found:,} dips of sigma_min, of which {len(found):,} are refined: "
                "the smallest of each combination of joints, spread over their ranges"
            )
        if curves is None and keep is not False:
            need = plan.n_jacobians * _PER_JACOBIAN
            notes.append(f"the curves are not part of the result: they take {_size(need)}")
        result = SweepResult(
            plan=plan,
            uniform=uniform,
            curves=() if curves is None else curves.found(),
            complete=complete,
            notes=tuple(notes),
            engine=job.evaluator.engine,
            kept=curves is not None,
            done=len(uniform) + done,
            summary=_summary(tally, job.table),
            candidates=found,
        )
        if folder is not None and complete:
            folder.write_bytes(CURVES, pack_sweep(result))
    return result


def check_keep(plan: SweepPlan, keep: bool | None, folder: bool) -> bool:
    """Whether the curves of ``plan`` fit into a result.

    Raises
    ------
    OptionError
        If they do not, are to be kept, and there is no ``folder`` to keep them in.
    """
    need = plan.n_jacobians * _PER_JACOBIAN
    if need > KEEP_BYTES and keep and not folder:
        raise OptionError(
            f"the curves of {plan.n_jacobians:,} Jacobians take {_size(need)}, and a result holds "
            f"at most {_size(KEEP_BYTES)}; {HOW_TO_KEEP}"
        )
    return need <= KEEP_BYTES


def _chunk(plan: SweepPlan, values: bool, folder: bool) -> int:
    least = _CHUNK_ON_DISK if folder else _CHUNK
    most = _CHUNK_ON_DISK if values else _LARGEST_CHUNK
    return max(least, min(most, plan.n_jacobians // _CHUNKS))


class _Curves:
    """The curves that are part of a result, as their chunks come in."""

    def __init__(self, table: CurveTable) -> None:
        self.table, samples = table, table.plan.samples
        self.values = np.empty((2, len(table) * samples))
        self.seen: Ints = np.zeros(len(table), dtype=np.int64)

    def add(self, record: Record) -> None:
        """Take the values of one chunk."""
        start = int(record["first"])
        stop, samples = start + len(record["sigma_min"]), self.table.plan.samples
        self.values[0, start:stop] = record["sigma_min"]
        self.values[1, start:stop] = record["sigma_ratio"]
        curves = np.arange(start // samples, -(-stop // samples))
        ends = np.minimum(stop, (curves + 1) * samples) - np.maximum(start, curves * samples)
        self.seen[curves] += ends

    def found(self) -> tuple[SweepCurve, ...]:
        """Those that are whole, in the order of the plan."""
        samples = self.table.plan.samples
        whole = np.flatnonzero(self.seen == samples)
        x = axis_values(self.table.ranges, samples, np.arange(samples)[None])
        last, ratio = self.values.reshape(2, -1, samples)
        return tuple(
            curves_of(self.table, whole, x, (last[i] for i in whole), (ratio[i] for i in whole))
        )


def _summary(tally: Tally, table: CurveTable) -> SweepSummary | None:
    if not tally.done:
        return None
    sigma_min, ratio = distributions(tally, table.configuration)
    worst = worst_points(tally, table.configuration)
    return SweepSummary(tally.done, tally.singular, tally.near, sigma_min, ratio, worst)


def _stopped(done: int, curves: int, samples: int) -> str:
    if done % samples:
        return f"stopped after {done:,} of {curves * samples:,} Jacobians of the curves"
    return f"stopped after {done // samples} of {curves} curves"


def _size(need: int) -> str:
    return f"{need / 2**30:.3g} GiB" if need >= 2**30 else f"{need / 2**20:.3g} MiB"


def _uniform(evaluator: Evaluator, plan: SweepPlan) -> tuple[UniformRow, ...]:
    if not len(plan.uniform):
        return ()
    sigma, ratios = evaluator.measure(plan.uniform)
    return tuple(
        UniformRow(float(value), float(last), float(ratio), status_of(float(ratio)))
        for value, last, ratio in zip(plan.uniform_values, sigma[:, -1], ratios, strict=True)
    )
