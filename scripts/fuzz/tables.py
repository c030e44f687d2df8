"""Damaged tables of numbers: trajectories (CSV, NPY, NPZ) and saved sweeps (NPZ)."""

from __future__ import annotations

import functools
import io
import random
from pathlib import Path
from typing import Any

from fuzz.judge import Ended, Wrong, refused
from fuzz.mutants import NUMBERS

_WORDS = (
    *NUMBERS,
    "",
    " ",
    "t",
    "time",
    "q1",
    "q2",
    "q3",
    '"',
    "'",
    "#",
    "1e5 2",
    "\x00",
    "x" * 5000,
)
_LARGEST = 200_000


@functools.cache
def _goods() -> dict[str, bytes]:
    import numpy as np

    import pinsing
    from pinsing.sampling.sweeps import pack_sweep

    arm = pinsing.load("planar3r")
    Q = np.linspace([-1.0, -0.5, 0.4], [1.0, 0.6, -0.3], 7)
    t = np.arange(7.0)
    rows = "\n".join(",".join(map(repr, map(float, (a, *b)))) for a, b in zip(t, Q, strict=True))
    names = ",".join(arm.joints)
    packed, plain = io.BytesIO(), io.BytesIO()
    np.savez_compressed(packed, q=Q, t=t)
    np.save(plain, Q)
    sweep = pinsing.sampling.sweep(arm, levels=[1], samples=11)
    return {
        "path.csv": f"t,{names}\n{rows}\n".encode(),
        "bare.csv": rows.replace(",", " ").encode(),
        "path.npz": packed.getvalue(),
        "path.npy": plain.getvalue(),
        "sweep.npz": pack_sweep(sweep),
    }


def table(rngs: list[random.Random], folder: Path) -> Ended:
    """A trajectory that is read is finite or not, but of the arm's width; a sweep can be shown."""
    import numpy as np

    import pinsing
    from pinsing.errors import PinsingError
    from pinsing.proximity.trajectory_file import read_trajectory
    from pinsing.sampling.sweeps import load_npz

    name = rngs[0].choice(sorted(_goods()))
    data = _goods()[name]
    for rng in rngs:
        for _ in range(rng.choice([1, 1, 2, 4])):
            data = _damaged(rng, data, name)[:_LARGEST]
    path = folder / name
    path.write_bytes(data)
    try:
        if name == "sweep.npz":
            made: Any = load_npz(path)
            str(made)
            made.to_json()
        else:
            found = read_trajectory(path, _arm())
            if found.Q.ndim != 2 or found.Q.shape[1] != 3 or found.Q.dtype != np.float64:
                raise Wrong(f"samples of shape {found.Q.shape}, {found.Q.dtype}")
            if np.isfinite(found.Q).all():
                pinsing.check_trajectory(_arm(), found.Q, found.t)
    except PinsingError as error:
        return refused(str(error))
    return "result", ""


@functools.cache
def _arm() -> Any:
    import pinsing

    return pinsing.load("planar3r")


def _damaged(rng: random.Random, data: bytes, name: str) -> bytes:
    spot = rng.randrange(len(data) + 1)
    way = rng.randrange(7)
    if way == 0:
        return data[:spot]
    if way == 1:
        return data[:spot] + bytes([rng.randrange(256)]) + data[spot + 1 :]
    if way == 2:
        return data[:spot] + data[: rng.randrange(len(data) + 1)] + data[spot:]
    if name.endswith(".csv"):
        lines = data.decode("utf-8", "replace").split("\n")
        at = rng.randrange(len(lines))
        words = lines[at].split(",")
        if way == 3:
            words[rng.randrange(len(words))] = rng.choice(_WORDS)
        elif way == 4:
            words.insert(rng.randrange(len(words) + 1), rng.choice(_WORDS))
        else:
            rng.shuffle(words)
        lines[at] = rng.choice([",", ",", ",", ";", "\t"]).join(words)
        return "\n".join(lines).encode("utf-8", "replace")
    return _other_arrays(rng, data, name)


def _other_arrays(rng: random.Random, data: bytes, name: str) -> bytes:
    """Whole files whose arrays are of another type, shape or name."""
    import numpy as np

    try:
        held = np.load(io.BytesIO(data), allow_pickle=False)
        arrays = {"": held} if name.endswith(".npy") else dict(held)
    except Exception:  # damaged before
        return data
    if not arrays:
        return data
    key = rng.choice(sorted(arrays))
    array, way = np.asarray(arrays[key]), rng.randrange(6)
    if way == 0:
        kind = rng.choice(["f4", "i1", "U5", "c16", "?", "M8[s]", "f8,f8"])
        array = np.zeros(array.shape, dtype=kind)
    elif way == 1:
        array = array.reshape(-1)[: rng.randrange(9)]
    elif way == 2:
        array = array[None]
    elif way == 3 and array.dtype.kind == "f" and array.size:
        array = array.copy()
        array.flat[rng.randrange(array.size)] = rng.choice([np.nan, np.inf, -1e308, 1e-320])
    elif way == 4 and array.dtype.kind in "iu" and array.size:
        array = array.copy()
        odd = rng.choice([-1, 0, 2**31, 2**62])
        array.flat[rng.randrange(array.size)] = np.int64(odd).astype(array.dtype)
    elif way == 5 and key:
        arrays[rng.choice(["x", "t", "q", "number", "header"])] = array
        del arrays[key]
        return _packed(arrays)
    if not key:
        plain = io.BytesIO()
        np.save(plain, array, allow_pickle=False)
        return plain.getvalue()
    return _packed({**arrays, key: array})


def _packed(arrays: dict[str, Any]) -> bytes:
    import numpy as np

    made = io.BytesIO()
    np.savez_compressed(made, **arrays)
    return made.getvalue()
