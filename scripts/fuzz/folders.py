"""Damaged folders of runs: gone on with to the same bytes, or refused."""

from __future__ import annotations

import contextlib
import functools
import json
import math
import os
import random
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from fuzz.documents import broken
from fuzz.judge import Ended, Wrong

_RUNS = (
    ("map", "planar3r", "--count", "9000", "--chunk", "4096", "--threads", "1"),
    ("map", "planar3r", "--count", "9000", "--chunk", "4096", "--threads", "1", "--keep-values"),
    (
        "analyze",
        "--sweep",
        "planar3r",
        "--levels",
        "1",
        "--samples",
        "2001",
        "--chunk",
        "1",
        "--threads",
        "1",
    ),
)


@functools.cache
def _run(words: tuple[str, ...], call: Callable[[list[str]], Ended]) -> Path:
    place = Path(tempfile.mkdtemp(prefix="pinsing-fuzz-")) / "run"
    outcome, said = call([*words, "-o", str(place)])
    assert outcome == "result", said
    return place


def run_folder(
    rngs: list[random.Random], folder: Path, call: Callable[[list[str]], Ended]
) -> Ended:
    """A damaged folder is gone on with to the same numbers, or refused in one line."""
    words = rngs[0].choice(_RUNS)
    good, place = _run(words, call), folder / "run"
    _remove(place)
    shutil.copytree(good, place)
    for rng in rngs:
        for _ in range(rng.choice([1, 1, 2, 4])):
            _damage(rng, place)
    outcome, said = call([*words, "-o", str(place)])
    if outcome == "result":
        for path in sorted(good.rglob("*")):
            name = path.relative_to(good)
            if path.is_file() and path.name not in ("lock", "plan.json"):
                other = place / name
                if not other.is_file() or other.read_bytes() != path.read_bytes():
                    raise Wrong(f"{name} is another one afterwards")
    _remove(place)
    return outcome, said


def _remove(place: Path) -> None:
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place, ignore_errors=True)
    else:
        place.unlink(missing_ok=True)


def _damage(rng: random.Random, place: Path) -> None:
    paths = [p for p in sorted(place.rglob("*")) if p.name != "lock"]
    files = [p for p in paths if p.is_file() and not p.is_symlink()]
    files = [p for p in files if p.stat().st_size < 1 << 24]  # not the huge one, made before
    if not files:
        return
    path = rng.choice(files)
    data = path.read_bytes()
    spot = rng.randrange(len(data) + 1)
    way = rng.randrange(9)
    if way == 0:
        path.write_bytes(data[:spot])
    elif way == 1:
        path.write_bytes(data[:spot] + bytes([rng.randrange(256)]) + data[spot + 1 :])
    elif way == 2:
        path.write_bytes(rng.choice([b"", b"\0" * len(data), data + data, b"PK\5\6" + b"\0" * 18]))
    elif way == 3:
        plan = place / "plan.json"
        if plan in files:
            text = broken(rng, plan.read_text(errors="replace")) if _is_json(plan) else "{}"
            plan.write_bytes(text.encode("utf-8", "surrogatepass"))
    elif way == 4:
        _remove(rng.choice(paths))
    elif way == 5:
        _put_another(rng, rng.choice(paths))
    elif way == 6:
        other = rng.choice(files)
        path.write_bytes(other.read_bytes())
    elif way == 7:
        name = rng.choice(
            ["000099.npz", "-00001.npz", "0.npz", "x", ".hidden", "000000.npz.1", "é"]
        )
        (path.parent / name).write_bytes(rng.choice([data, b"", b"x"]))
    elif path.suffix == ".npz" and path.parent.name == "chunks":
        _forge(rng, path)


def _is_json(path: Path) -> bool:
    with contextlib.suppress(ValueError):
        json.loads(path.read_text(encoding="utf-8"))
        return True
    return False


def _put_another(rng: random.Random, path: Path) -> None:
    """Something else under the name: a link, a pipe, a folder, a huge file full of nothing."""
    _remove(path)
    way = rng.randrange(5)
    if way == 0:
        path.symlink_to(rng.choice(["/dev/zero", "/etc/passwd", path.name, "nothing", ".."]))
    elif way == 1:
        os.mkfifo(path)
    elif way == 2:
        path.mkdir()
    elif way == 3:
        with path.open("wb") as file:
            file.truncate(8 << 30)


def _forge(rng: random.Random, path: Path) -> None:
    """A chunk whose digest is right and whose arrays cannot be."""
    import numpy as np

    from pinsing.chunk_file import DamagedError, pack, read_arrays

    try:
        record = read_arrays(path.read_bytes(), 1 << 30)
    except DamagedError:
        return
    run, index = str(record.pop("_run", "")), int(record.pop("_chunk", np.array(0)))
    if not record:
        return
    name = rng.choice(sorted(record))
    array = record[name]
    way = rng.randrange(7)
    if way == 0:
        del record[name]
    elif way == 1:
        record[name] = array.astype(rng.choice([np.float32, np.int8, np.str_, np.bool_]))
    elif way == 2:
        record[name] = array.reshape(1, *array.shape)
    elif way == 3 and array.size:
        bad = np.full_like(array, -1)
        record[name] = bad
    elif way == 4 and array.size and array.dtype.kind == "f":
        array = array.copy()
        array.flat[rng.randrange(array.size)] = rng.choice([math.nan, math.inf, -1e308])
        record[name] = array
    elif way == 5:
        record[rng.choice(["more", "", "../x", "_run "])] = np.zeros(3)
    else:
        index += 1
    path.write_bytes(pack(record, run, index))
