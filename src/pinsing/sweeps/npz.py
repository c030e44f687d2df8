"""Sweeps as NumPy files: the curves as plain arrays, the rest as JSON text.

A sweep in a folder ends with a file `CURVES`. Curves that are too large for it, and were to be
kept, are in the chunks of the folder; `kept_curves` goes through them one by one.
"""

from __future__ import annotations

import json
import os
import tempfile
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pinsing.errors import OutputError, ResultError
from pinsing.runs.run_folder import RunFolder, recorded
from pinsing.sweeps.curves import CurveTable, axis_values
from pinsing.sweeps.result import SweepCurve, SweepResult, curves_of

CURVES = "sweep.npz"
"""File of the folder of a complete sweep that holds its result, with the curves if kept in it."""


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
    joints = result.arm.joints
    samples = result.plan.samples if result.curves else 0
    fixed = np.full((len(result.curves), len(joints)), np.nan)
    ranges = np.array([e.range for e in result.plan.effects], dtype=float)
    for row, curve in zip(fixed, result.curves, strict=True):
        row[[joints.index(name) for name in curve.fixed]] = list(curve.fixed.values())
    header = replace(result, curves=()).to_dict()
    arrays = {
        "header": np.array(json.dumps(header, allow_nan=False).encode()),
        "number": np.array([c.number for c in result.curves], dtype=np.int64),
        "level": np.array([c.level for c in result.curves], dtype=np.int64),
        "moving": np.array([c.moving for c in result.curves], dtype=np.int64),
        "forced": np.array([c.forced for c in result.curves], dtype=bool),
        "fixed": fixed,
        "x": axis_values(ranges, result.plan.samples, np.arange(samples)[None]),
        "sigma_min": np.array([c.sigma_min for c in result.curves]).reshape(len(fixed), samples),
        "sigma_ratio": np.array([c.sigma_ratio for c in result.curves]).reshape(
            len(fixed), samples
        ),
    }
    try:
        handle, name = tempfile.mkstemp(suffix=".npz.part", dir=target.parent)
    except OSError as error:
        raise OutputError(f"cannot write {target}: {error.strerror}") from None
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
        os.replace(name, target)
    except OSError as error:
        raise OutputError(f"cannot write {target}: {error.strerror}") from None
    finally:
        Path(name).unlink(missing_ok=True)
    return target


def load_npz(path: str | os.PathLike[str]) -> SweepResult:
    """Read what ``save_npz`` wrote.

    Raises
    ------
    ResultError
        If the file is missing, damaged, or something else.
    """
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as data:
            arrays = {key: data[key] for key in data.files}
        header: dict[str, Any] = json.loads(arrays["header"].item())
        bare = SweepResult.from_dict(header)
        curves = _curves(bare, arrays)
    except OSError as error:
        raise ResultError(f"cannot read {path}: {error.strerror or error}") from None
    except (KeyError, IndexError, TypeError, ValueError, EOFError, zipfile.BadZipFile) as error:
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
    chunks = int(identity["chunks"])
    run = RunFolder(root, identity, chunks)
    rest = np.empty((2, 0))
    number = 0
    for index in range(chunks):
        record = run.load(index)
        if record is None:
            raise ResultError(
                f"{run.chunk_path(index)} is missing or damaged: run the same sweep again, which "
                "computes it anew"
            )
        new = np.array([record["sigma_min"], record["sigma_ratio"]], dtype=float)
        rest = np.concatenate([rest, new], axis=1)
        count = rest.shape[1] // samples
        last, ratio = rest[:, : count * samples].reshape(2, count, samples)
        yield from curves_of(table, np.arange(number, number + count), x, last, ratio)
        number, rest = number + count, rest[:, count * samples :]


def _curves(bare: SweepResult, arrays: dict[str, Any]) -> tuple[SweepCurve, ...]:
    joints, x = bare.arm.joints, arrays["x"]
    curves = []
    for i, moving in enumerate(arrays["moving"].tolist()):
        held = np.flatnonzero(~np.isnan(arrays["fixed"][i]))
        curves.append(
            SweepCurve(
                level=int(arrays["level"][i]),
                fixed={joints[j]: float(arrays["fixed"][i, j]) for j in held},
                forced=bool(arrays["forced"][i]),
                moving=int(moving),
                x=x[moving],
                sigma_min=arrays["sigma_min"][i],
                sigma_ratio=arrays["sigma_ratio"][i],
                number=int(arrays["number"][i]),
            )
        )
    return tuple(curves)
