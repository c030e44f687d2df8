"""Sweeps as NumPy files: the curves as plain arrays, the rest as JSON text.

A sweep in a folder ends with a file `CURVES`. Curves that are too large for it, and were to be
kept, are in the chunks of the folder; `kept_curves` goes through them one by one.
"""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pinsing.atomic_write import write_bytes
from pinsing.chunk_file import DamagedError, read_arrays, read_bounded
from pinsing.errors import ResultError
from pinsing.sampling.curves import CurveTable, axis_values
from pinsing.sampling.run_folder import RunFolder, recorded
from pinsing.sampling.sweep_result import CURVES, SweepCurve, SweepResult, curves_of, pack_sweep
from pinsing.sampling.sweep_run import Kept, SweepJob

_ROOM = 1 << 30  # bytes that a saved sweep may take
_NUMBERS = ("chunks", "pieces_of_a_chunk", "worst", "candidates")  # of a plan


def save_npz(result: SweepResult, path: str | os.PathLike[str]) -> Path:
    """Write a sweep to ``path`` (``.npz``), readable with ``numpy.load`` alone.

    Arrays, for C curves of S samples of an arm of n joints: ``number`` (C,), ``level`` (C,),
    ``moving`` (C,), ``forced`` (C,), ``fixed`` (C, n) with NaN where a joint is not at a
    special value, ``x`` (n, S), ``sigma_min`` and ``sigma_ratio`` (C, S), ``header`` (JSON
    text). If the curves are not part of the result, C and S are 0.

    Raises
    ------
    OutputError
        If the file cannot be written; nothing half-written is left.
    """
    target = Path(path)
    if target.suffix != ".npz":
        target = target.with_name(target.name + ".npz")
    write_bytes(target, pack_sweep(result))
    return target


def load_npz(path: str | os.PathLike[str]) -> SweepResult:
    """Read what ``save_npz`` wrote.

    Raises
    ------
    ResultError
        If the file is missing, damaged, or something else.
    """
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


def kept_curves(folder: str | os.PathLike[str]) -> Iterator[SweepCurve]:
    """Go through the curves of a complete sweep that were kept in its folder, one at a time.

    Raises
    ------
    ResultError
        If there is no complete sweep, its curves were not kept, or some are damaged.
    """
    root = Path(folder)
    plan, identity = load_npz(root / CURVES).plan, recorded(root)
    if identity is None or identity.get("keep") is not True:
        raise ResultError(f"the curves of the sweep in {root} were not kept: sweep with keep=True")
    table, samples = CurveTable(plan), plan.samples
    x = axis_values(table.ranges, samples, np.arange(samples)[None])
    try:
        chunks, size, *most = (int(identity[name]) for name in _NUMBERS)
    except (KeyError, TypeError, ValueError):
        raise ResultError(f"the folder {root} has no plan of a sweep") from None
    job = SweepJob(plan, None, size, Kept(True, *most))
    run = RunFolder(root, identity, chunks)
    rest = np.empty((2, 0))
    number = 0
    for index in range(chunks):
        try:
            record = run.read(index, functools.partial(job.check, index), job.room(index))
        except (FileNotFoundError, DamagedError) as error:
            said = "it is missing" if isinstance(error, FileNotFoundError) else error
            raise ResultError(
                f"{run.chunk_path(index)} is missing or damaged: run the same sweep again, which "
                f"computes it anew ({said})"
            ) from None
        new = np.array([record["sigma_min"], record["sigma_ratio"]], dtype=float)
        rest = np.concatenate([rest, new], axis=1)
        count = rest.shape[1] // samples
        last, ratio = rest[:, : count * samples].reshape(2, count, samples)
        yield from curves_of(table, np.arange(number, number + count), x, last, ratio)
        number, rest = number + count, rest[:, count * samples :]
