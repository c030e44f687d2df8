"""Sweeps as NumPy files: the curves as plain arrays, the rest as JSON text."""

from __future__ import annotations

import json
import os
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from pinsing.errors import OutputError, ResultError
from pinsing.sweep import SweepCurve, SweepResult


def save_npz(result: SweepResult, path: str | os.PathLike[str]) -> Path:
    """Write a sweep to ``path`` (``.npz``), readable with ``numpy.load`` alone.

    Arrays, for C curves of S samples of an arm of n joints: ``level`` (C,), ``moving`` (C,),
    ``forced`` (C,), ``fixed`` (C, n) with NaN where a joint is not at a special value,
    ``x`` (n, S), ``sigma_min`` and ``sigma_ratio`` (C, S), ``header`` (JSON text).

    Raises
    ------
    OutputError
        If the file cannot be written; nothing half-written is left.
    """
    target = Path(path)
    if target.suffix != ".npz":
        target = target.with_name(target.name + ".npz")
    joints, samples = result.arm.joints, result.plan.samples
    fixed = np.full((len(result.curves), len(joints)), np.nan)
    x = np.array([np.linspace(e.range[0], e.range[1], samples) for e in result.plan.effects])
    for row, curve in zip(fixed, result.curves, strict=True):
        row[[joints.index(name) for name in curve.fixed]] = list(curve.fixed.values())
    header = {**result.to_dict(), "curves": []}
    arrays = {
        "header": np.array(json.dumps(header, allow_nan=False)),
        "level": np.array([c.level for c in result.curves], dtype=np.int64),
        "moving": np.array([c.moving for c in result.curves], dtype=np.int64),
        "forced": np.array([c.forced for c in result.curves], dtype=bool),
        "fixed": fixed,
        "x": x,
        "sigma_min": np.array([c.sigma_min for c in result.curves]).reshape(-1, samples),
        "sigma_ratio": np.array([c.sigma_ratio for c in result.curves]).reshape(-1, samples),
    }
    try:
        handle, name = tempfile.mkstemp(suffix=".npz", dir=target.parent)
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
        header: dict[str, Any] = json.loads(str(arrays["header"]))
        bare = SweepResult.from_dict(header)
        curves = _curves(bare, arrays)
    except OSError as error:
        raise ResultError(f"cannot read {path}: {error.strerror or error}") from None
    except (KeyError, IndexError, TypeError, ValueError, EOFError, zipfile.BadZipFile) as error:
        if isinstance(error, ResultError):
            raise ResultError(f"{path}: {error}") from None
        raise ResultError(f"{path} is not a saved sweep, or is damaged: {error}") from None
    return SweepResult(bare.plan, bare.uniform, curves, bare.complete, bare.notes)


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
            )
        )
    return tuple(curves)
