"""The curves of a sweep as work in chunks, reduced, the same to the last bit however they are cut.

A curve of more than `PIECE` samples is cut into pieces of that many. Each piece is computed
with one sample more on either side, so that a minimum at its border is seen once and whole.
Neither pieces nor the blocks that are computed at a time depend on the chunks.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.chunk_file import Record
from pinsing.kinematics.evaluator import Evaluator, run_identity
from pinsing.sampling.curves import CurveRows, CurveTable, axis_values
from pinsing.sampling.minima import DIPS, Pool, kinds, minima
from pinsing.sampling.sweep_plan import SweepPlan
from pinsing.sampling.tally import Tally
from pinsing.sampling.tally_check import (
    TALLY,
    check_names,
    check_tally,
    check_values,
    finite,
    tally_room,
    whole,
)

PIECE = 32_768
"""Samples of a curve that are treated at a time, at most."""

_BLOCK = 4096  # configurations that are treated at a time, of shorter curves


@dataclass(frozen=True)
class Kept:
    """What chunks keep.

    Attributes
    ----------
    values : bool
        All of sigma_r and sigma_r / sigma_1: 16 bytes for each Jacobian.
    worst : int
        How many of the worst configurations.
    candidates : int
        How many dips at most.
    """

    values: bool
    worst: int
    candidates: int


@dataclass(frozen=True, eq=False)
class Work:
    """What one chunk needs, and no more.

    Attributes
    ----------
    evaluator : Evaluator
        The arm, on a fixed engine.
    ranges : (n, 2) array
        Ends of what each joint moves over.
    samples : int
        Of a curve.
    rows : CurveRows
        The curves that the chunk has a part of.
    start, stop : int
        Numbers of its Jacobians.
    kept : Kept
        What to keep.
    """

    evaluator: Evaluator
    ranges: Array
    samples: int
    rows: CurveRows
    start: int
    stop: int
    kept: Kept


def span_of(index: int, size: int, curves: int, samples: int) -> tuple[int, int]:
    """Numbers of the Jacobians of a chunk of ``size`` pieces: from, and to before."""
    pieces = -(-samples // PIECE)
    start, stop = (
        divmod(min(piece, curves * pieces), pieces) for piece in (index * size, (index + 1) * size)
    )
    return start[0] * samples + start[1] * PIECE, stop[0] * samples + stop[1] * PIECE


def regular_count(table: CurveTable, start: int, stop: int) -> int:
    """How many of these Jacobians are of curves that are not singular throughout."""
    samples = table.plan.samples
    rows = table.rows(np.arange(start // samples, -(-stop // samples)))
    first = rows.numbers * samples
    own = np.minimum(first + samples, stop) - np.maximum(first, start)
    return int(own[~rows.singular].sum())


def curves_room(kept: Kept, count: int) -> int:
    """Bytes that the arrays of a chunk of ``count`` Jacobians take at most."""
    dips = 32 * min(kept.candidates, count)
    return tally_room(kept.worst, count) + dips + (16 * count if kept.values else 0)


def check_curves(record: Record, kept: Kept, start: int, stop: int, regular: int) -> None:
    """Judge the record of a chunk, of whose Jacobians so many are not of singular curves.

    Raises
    ------
    ValueError
        If it cannot be that; the message says what is wrong.
    """
    values = ("sigma_min", "sigma_ratio")
    check_names(record, TALLY + DIPS + ("first",) + (values if kept.values else ()))
    check_tally(record, kept.worst, regular, start, stop)
    whole(record, "first", (), start, start + 1)
    found = int(whole(record, "dips_found", (), 0, regular + 1))
    size = (min(found, kept.candidates),)
    if (np.diff(whole(record, "dip_number", size, start, stop)) <= 0).any():
        raise ValueError("its dips are not in order")
    whole(record, "dip_kind", size, 0, 1 << 62)
    for name in ("dip_sigma", "dip_ratio"):
        finite(record, name, size)
    if kept.values:
        for name in values:
            finite(record, name, (stop - start,))


class SweepJob:
    """The curves of a sweep, some in each chunk.

    Parameters
    ----------
    plan : SweepPlan
        What to do.
    evaluator : Evaluator
        The arm, on a fixed engine.
    chunk : int
        Jacobians of a chunk, more or less.
    kept : Kept
        What to keep.

    Attributes
    ----------
    table : CurveTable
        All curves.
    """

    def __init__(self, plan: SweepPlan, evaluator: Evaluator, chunk: int, kept: Kept) -> None:
        self.plan, self.evaluator, self.kept = plan, evaluator, kept
        self.table = CurveTable(plan)
        samples = plan.samples
        self._pieces = -(-samples // PIECE)
        block = _curves_per_block(samples)
        if self._pieces == 1:
            self._size = max(1, chunk // samples // block) * block
        else:
            self._size = max(1, chunk // PIECE)

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return -(-len(self.table) * self._pieces // self._size)

    def identity(self) -> Mapping[str, Any]:
        """What decides the numbers, as plain JSON values."""
        plan = self.plan
        digest = hashlib.sha256(self.table.ranges.tobytes())
        for level in plan.levels:
            digest.update(f"{level.level} {level.swept} {level.values.shape};".encode())
            digest.update(level.joints.astype(np.int64).tobytes())
            digest.update(level.values.tobytes() + level.forced.tobytes())
        digest.update(repr([(e.swept, e.reason) for e in plan.effects]).encode())
        return run_identity("sweep", self.evaluator) | {
            "joints": list(plan.arm.joints),
            "nominal": plan.nominal.tolist(),
            "samples": plan.samples,
            "curves": len(self.table),
            "chunks": self.chunks,
            "pieces_of_a_chunk": self._size,
            "keep": self.kept.values,
            "worst": self.kept.worst,
            "candidates": self.kept.candidates,
            "ranges and special values": digest.hexdigest(),
        }

    def span(self, index: int) -> tuple[int, int]:
        """Numbers of the Jacobians of one chunk: from, and to before."""
        return span_of(index, self._size, len(self.table), self.plan.samples)

    def part(self, index: int) -> Callable[[], Record]:
        """One chunk, with no more than it needs."""
        start, stop = self.span(index)
        samples = self.plan.samples
        rows = self.table.rows(np.arange(start // samples, -(-stop // samples)))
        ranges = self.table.ranges
        work = Work(self.evaluator, ranges, samples, rows, start, stop, self.kept)
        return functools.partial(compute_curves, work)

    def check(self, index: int, record: Record) -> None:
        """Raise a ValueError that says why ``record`` cannot be that of a chunk."""
        start, stop = self.span(index)
        check_curves(record, self.kept, start, stop, regular_count(self.table, start, stop))
        check_values(record, self.table.configuration, self.evaluator.last_and_ratio)

    def room(self, index: int) -> int:
        """Bytes that the arrays of a chunk take at most."""
        start, stop = self.span(index)
        return curves_room(self.kept, stop - start)


def compute_curves(work: Work) -> Record:
    """Tally and candidates of one chunk as arrays.

    With ``work.kept.values`` also ``sigma_min`` and ``sigma_ratio`` (N,) of its Jacobians, in
    the order of their numbers, the first of which is ``first``.
    """
    samples, rows = work.samples, work.rows
    tally, pool = Tally(work.kept.worst), Pool(work.kept.candidates)
    sigma_min: list[Array] = []
    sigma_ratios: list[Array] = []
    for some, start, stop in _blocks(work):
        moving = rows.moving[some]
        before, after = start > 0, stop < samples
        places = np.arange(start - before, stop + after)[None]
        Q = np.repeat(rows.base[some, None], places.size, axis=1)
        moved = axis_values(work.ranges[moving], samples, places)
        np.put_along_axis(Q, moving[:, None, None], moved[..., None], axis=2)
        found = work.evaluator.measure(Q.reshape(-1, Q.shape[2]))
        wide = found.sigma[:, -1].reshape(Q.shape[:2])
        last = wide[:, before : before + stop - start]
        ratio = found.ratio.reshape(wide.shape)[:, before : before + stop - start]
        numbers = rows.numbers[some, None] * samples + np.arange(start, stop)
        regular = ~rows.singular[some]
        tally.add(0, last[regular].ravel(), ratio[regular].ravel(), numbers[regular].ravel())

        end = np.full(len(moving), np.inf)
        beside = wide[:, 0] if before else end, wide[:, -1] if after else end
        dip = minima(last, ratio, *beside) & regular[:, None]
        row, column = np.nonzero(dip)
        kind = kinds(rows, samples, row + some.start, column + start)
        pool.add(numbers[dip], kind, last[dip], ratio[dip])
        if work.kept.values:
            sigma_min.append(last.ravel())
            sigma_ratios.append(ratio.ravel())
    record = tally.record() | pool.record() | {"first": np.array(work.start)}
    if work.kept.values:
        record["sigma_min"] = np.concatenate(sigma_min)
        record["sigma_ratio"] = np.concatenate(sigma_ratios)
    return record


def _blocks(work: Work) -> Iterator[tuple[slice, int, int]]:
    """Rows of ``work`` that are computed together, and which of their samples."""
    samples, first = work.samples, int(work.rows.numbers[0])
    if samples <= PIECE:
        block, count = _curves_per_block(samples), len(work.rows.numbers)
        for row in range(0, count, block):
            yield slice(row, min(count, row + block)), 0, samples
        return
    number = work.start
    while number < work.stop:
        curve, start = divmod(number, samples)
        stop = min(samples, start + PIECE)
        yield slice(curve - first, curve - first + 1), start, stop
        number = curve * samples + stop


def _curves_per_block(samples: int) -> int:
    return max(1, _BLOCK // samples)
