"""A trajectory as pages show it: what it meets in words, poses with times, where to jump."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from pinsing.errors import PinsingError
from pinsing.measures import Array
from pinsing.proximity.clearance import titled
from pinsing.proximity.trajectory import TrajectoryCheck, check_trajectory, summary
from pinsing.proximity.trajectory_file import read_trajectory
from pinsing.robot.arm import Arm

FRAMES = 400
"""Poses of a trajectory that a page shows, evenly in time, besides those it is judged by."""
_STOPS = 30
_KINDS = frozenset({".csv", ".txt", ".tsv", ".npy", ".npz", ".yaml", ".yml", ".ls", ".script"})


def trajectory_data(
    arm: Arm,
    check: TrajectoryCheck,
    Q: Array,
    t: Array | None = None,
    *,
    name: str = "path",
    robot: str = "",
    notes: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Return what a page shows of a trajectory Q (N, n) at times t (N,), ready for JSON."""
    # The first lines of ``check`` are the page's; ``robot`` is how commands name it.
    times = np.arange(len(Q), dtype=float) if t is None else np.asarray(t, dtype=float)
    first, last = float(times[0]), float(times[-1])
    judged = [(c.t, c.q, "meets", titled(c.family, c.title)) for c in check.crossings[:_STOPS]]
    met = {c.family for c in check.crossings}
    # The approaches come nearest first.
    others = [a for a in check.approaches if a.family not in met and np.isfinite(a.upper)]
    judged += [(a.t, a.q, "nearest", titled(a.family, a.title)) for a in others[:1]]
    few = len(times) < FRAMES
    even = np.linspace(first, last, max(FRAMES - len(times), 2) if few else FRAMES)
    moments = np.unique([*even, *(times if few else ()), *(at for at, *_ in judged)])
    rows = np.stack([np.interp(moments, times, column) for column in Q.T], axis=1)
    for at, q, *_ in judged:
        rows[np.searchsorted(moments, at)] = q
    verdict, *lines = summary(check, True, name, robot or arm.name).splitlines()
    faults = check.jumps or check.outside or check.too_fast
    spans = [(c.t, c.t_end, "meets") for c in check.crossings]
    return {
        "verdict": verdict,
        "tone": "singular" if met else "near-singular" if faults or check.stretches else "regular",
        "lines": [line.strip() for line in lines if line.strip()],
        "notes": list(notes),
        "rows": rows.tolist(),
        "times": moments.tolist(),
        "timed": check.timed,
        "stops": [{"t": at, "kind": k, "family": f} for at, _, k, f in judged],
        "spans": [[s.t, s.t_end, "near"] for s in check.stretches] + [list(s) for s in spans],
    }


def dropped(arm: Arm, name: str, content: bytes, degrees: bool | None) -> dict[str, Any]:
    """Return page data of a file dropped onto a page, or ``error`` in words."""
    with tempfile.TemporaryDirectory() as folder:
        kind = Path(name).suffix.lower()
        file = Path(folder) / f"path{kind if kind in _KINDS else '.csv'}"
        file.write_bytes(content)
        try:
            read = read_trajectory(file, arm, degrees)
            check = check_trajectory(arm, read.Q, read.t)
        except PinsingError as error:
            words, asked, _ = str(error).replace(str(file), name).partition("For degrees add")
            words += "If these are degrees, choose that beside the button." if asked else ""
            return {"error": words if name in words else f"{name}: {words}"}
    return trajectory_data(arm, check, read.Q, read.t, name=name, notes=read.notes)
