"""Run a map: chunk by chunk, in bounded memory, and in a folder if it is to last."""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import two_sided
from pinsing.arguments import checked
from pinsing.chunk_file import Record
from pinsing.errors import OptionError, UnknownNameError
from pinsing.families.solve import form_to_measure
from pinsing.kinematics.engine import PINOCCHIO
from pinsing.kinematics.verdict import Evaluator, run_identity
from pinsing.proximity.watched import Forms, require_forms_of, watch
from pinsing.robot.arm import Arm
from pinsing.sampling.execute import Progress, RunOptions, Tell, planned_evaluator, running
from pinsing.sampling.map_plan import BLOCK, WORST, MapPlan, plan_map, rows_of
from pinsing.sampling.map_result import ClearancePoint, ClearanceSpread, MapResult, result_of
from pinsing.sampling.tally import (
    TALLY,
    Tally,
    check_names,
    check_tally,
    check_values,
    distributions,
    finite,
    tally_room,
)

MEASURES = ("sigma", "clearance")
"""What a map measures."""

RESULT = "result.json"
"""File of a folder that holds the result of a complete map."""


_PREFIX = "clearance_"

CLEARANCE_TALLY = tuple(_PREFIX + name for name in TALLY)
"""Names of the arrays of the tally of the clearance in a record."""


@dataclass(frozen=True, eq=False)
class Nearness:
    """The families of a map as flat arrays: small, and able to be pickled.

    Attributes
    ----------
    names : tuple of str
        Of the families.
    complete : bool
        Whether the closed form is complete.
    conditions : Conditions
        The families.
    """

    names: tuple[str, ...]
    complete: bool
    conditions: Conditions

    @classmethod
    def of(cls, arm: Arm, forms: Forms | None) -> Nearness:
        """Families of ``forms``, by default of the closed form of ``arm``.

        Raises
        ------
        OptionError
            If they are of another arm, or there is no family at all.
        """
        if forms is None:
            forms = form_to_measure(arm)
        require_forms_of(forms, arm)
        watched = watch(forms)
        if not watched.names:
            raise OptionError(
                f"{arm.name} has no known family of singular configurations, so that every "
                "clearance is infinite: map sigma instead"
            )
        return cls(watched.names, watched.complete, watched.conditions)

    def fingerprint(self) -> str:
        """SHA-256 of the names and of every number of the families."""
        digest = hashlib.sha256(repr(self.names).encode())
        c = self.conditions
        numbers = {"families": c.families, **c.flat, "norm": c.norm}
        for name, value in numbers.items():
            data = value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()
            digest.update(f"{name}:{len(data)};".encode() + data)
        return digest.hexdigest()

    def add(self, tally: Tally, first: int, Q: Array, engine: str) -> None:
        """Count the bounds at configurations Q (N, n) with numbers from ``first`` on."""
        tally.add(first, *self.bounds(Q, engine))

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
        family = two_sided(self.conditions, Q).family
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


def put_clearance(record: Record, tally: Tally) -> None:
    """Put a tally of the clearance into the record of a chunk."""
    record.update({_PREFIX + name: array for name, array in tally.record().items()})


def clearance_part(record: Record) -> Record:
    """The arrays of the clearance of a record, under their plain names."""
    start = len(_PREFIX)
    return {name[start:]: a for name, a in record.items() if name.startswith(_PREFIX)}


def check_clearance(record: Record, worst: int, start: int, stop: int) -> None:
    """Raise a ValueError that says why the clearance of a record cannot be that of a chunk."""
    try:
        check_tally(clearance_part(record), worst, stop - start, start, stop, ratios=False)
    except ValueError as error:
        raise ValueError(f"of the clearance, {error}") from None


def clearance_room(worst: int, count: int) -> int:
    """Bytes that the clearance takes in a record at most."""
    return tally_room(worst, count) + 4096


@dataclass(frozen=True, eq=False)
class MapJob:
    """A map as work in chunks: small, and able to be pickled.

    Attributes
    ----------
    plan : MapPlan
        What to do.
    evaluator : Evaluator
        The arm, on a fixed engine.
    keep_values : bool
        All singular values are part of the records.
    near : Nearness, optional
        The families, if the clearance is part of the records.
    """

    plan: MapPlan
    evaluator: Evaluator
    keep_values: bool = False
    near: Nearness | None = None

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return self.plan.chunks

    def identity(self) -> Mapping[str, Any]:
        """What decides the numbers, as plain JSON values."""
        values: dict[str, Any] = {"keep_values": self.keep_values}
        if self.near is not None:
            values["clearance"] = self.near.fingerprint()
        return run_identity("map", self.evaluator) | self.plan.identity() | values

    def part(self, index: int) -> Callable[[], Record]:
        """Return what computes one chunk."""
        return functools.partial(compute_map_chunk, self, index)

    def span(self, index: int) -> tuple[int, int]:
        """Numbers of the configurations of one chunk: from, and to before."""
        start = index * self.plan.chunk
        return start, min(self.plan.count, start + self.plan.chunk)

    def check(self, index: int, record: Record) -> None:
        """Raise a ValueError that says why ``record`` cannot be that of a chunk."""
        start, stop = self.span(index)
        names = TALLY + (("sigma",) if self.keep_values else ())
        check_names(record, names + (CLEARANCE_TALLY if self.near is not None else ()))
        if self.near is not None:
            check_clearance(record, self.plan.worst, start, stop)
        check_tally(record, self.plan.worst, stop - start, start, stop)
        if self.keep_values:
            finite(record, "sigma", (stop - start, self.evaluator.rank))

        def locate(number: int) -> Array:
            return np.asarray(rows_of(self.plan, number, number + 1)[0])

        check_values(record, locate, self.evaluator.last_and_ratio)
        if self.near is not None:
            near, engine = self.near, self.evaluator.engine
            check_values(clearance_part(record), locate, lambda Q: near.bounds(Q, engine))

    def room(self, index: int) -> int:
        """Bytes that the arrays of a chunk take at most."""
        start, stop = self.span(index)
        values = 8 * self.evaluator.rank * (stop - start) if self.keep_values else 0
        if self.near is not None:
            values += clearance_room(self.plan.worst, stop - start)
        return tally_room(self.plan.worst, stop - start) + values


def compute_map_chunk(job: MapJob, index: int) -> Record:
    """Tally of one chunk as arrays, with ``sigma`` (N, r) if values are kept.

    Blocks begin at multiples of BLOCK whatever the chunks, so that each array operation has
    the same operands and gives the same bits.
    """
    plan = job.plan
    start, stop = job.span(index)
    tally, distances = Tally(plan.worst), Tally(plan.worst)
    kept = []
    for first in range(start, stop, BLOCK):
        Q = rows_of(plan, first, min(stop, first + BLOCK))
        found = job.evaluator.measure(Q)
        tally.add(first, found.sigma[:, -1], found.ratio)
        if job.near is not None:
            job.near.add(distances, first, Q, job.evaluator.engine)
        if job.keep_values:
            kept.append(found.sigma)
    record = tally.record()
    if job.near is not None:
        put_clearance(record, distances)
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
    q: npt.ArrayLike | None = None,
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
        Map whole circles.
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
    >>> result = pinsing.sigma_map(pinsing.load("planar3r"), count=4096)
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
    if measure not in MEASURES:
        raise UnknownNameError("measure", measure, MEASURES)
    if measure == "sigma" and forms is not None:
        raise OptionError("forms belong to a map of the clearance: give measure='clearance'")
    near = Nearness.of(arm, forms) if measure == "clearance" else None
    return run_map(arm, plan, options, keep_values, near)


def run_map(
    arm: Arm,
    plan: MapPlan,
    options: RunOptions | None = None,
    keep_values: bool = False,
    near: Nearness | None = None,
) -> MapResult:
    """Run a plan that was made for ``arm``; see `sigma_map`."""
    options = RunOptions() if options is None else options
    if keep_values and options.out is None:
        raise OptionError("keep_values needs a folder to keep them in: give out")
    job = MapJob(plan, planned_evaluator(arm, options), keep_values, near)
    tally, distances, notes = Tally(plan.worst), Tally(plan.worst), []
    with running(job, options) as (chunks, folder):
        try:
            for _, record in chunks:
                tally.join(Tally.from_record(record, plan.worst))
                if near is not None:
                    distances.join(Tally.from_record(clearance_part(record), plan.worst))
                if options.progress is not None:
                    options.progress(tally.done, plan.count)
        except KeyboardInterrupt:
            notes.append(f"stopped after {tally.done:,} of {plan.count:,} configurations")
        if not tally.done:
            raise KeyboardInterrupt
        spread = None
        if near is not None:
            spread = near.spread(distances, lambda i: plan.configurations(i, i + 1)[0])
        result = result_of(plan, job.evaluator.engine, tally, tuple(notes), spread)
        if folder is not None and result.complete:
            folder.write_text(RESULT, result.to_json() + "\n")
    return result
