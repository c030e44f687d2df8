"""Runs in a folder: whatever happens to the process, the disk or the files, nothing is lost."""

import contextlib
import errno
import importlib
import json
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import arms
import numpy as np
import pytest
from command_line import run, soon, started
from tiers import tiered

from pinsing import singular_values
from pinsing._batch import engine as kernel
from pinsing.chunk_file import DamagedError
from pinsing.errors import EngineError, OutputError
from pinsing.sampling import plan_map, sigma_map
from pinsing.sampling.execute import RunFolder, ctrl_c_afterwards, open_run, recorded
from pinsing.sampling.maps import BLOCK
from pinsing.sampling.sweeps import SweepResult, load_npz, plan_sweep, run_sweep

IDENTITY = {"kind": "test", "size": 3}
RECORD = {"a": np.arange(5.0), "b": np.array([1, 2])}


def same(one: dict, two: dict | None) -> bool:
    return two is not None and all(np.array_equal(one[k], two[k]) for k in one.keys() | two.keys())


def read(folder: RunFolder, index: int) -> dict | None:
    """A chunk; None if it is not there, damaged, or of another run or place."""
    with contextlib.suppress(FileNotFoundError, DamagedError):
        return folder.read(index)
    return None


class Crash(BaseException):
    """What a process does not survive: no handler in the code under test may catch it."""


# ---- one folder


def test_chunks_come_back_as_they_were(tmp_path: Path) -> None:
    with open_run(tmp_path / "run", IDENTITY, 3) as folder:
        assert folder.kept() == ()
        assert read(folder, 1) is None
        folder.save(1, RECORD)
        folder.save(2, {"a": np.zeros(0)})
    with open_run(tmp_path / "run", IDENTITY, 3) as folder:
        assert folder.kept() == (1, 2)
        assert same(RECORD, read(folder, 1))
        with np.load(folder.chunk_path(1)) as archive:  # NumPy alone reads them too
            np.testing.assert_array_equal(archive["a"], RECORD["a"])
    assert recorded(tmp_path / "run") == IDENTITY
    assert recorded(tmp_path / "nowhere") is None


def test_any_damage_is_found(tmp_path: Path) -> None:
    with open_run(tmp_path, IDENTITY, 3) as folder:
        folder.save(0, RECORD)
        path = folder.chunk_path(0)
        whole = path.read_bytes()
        for position in [*range(0, len(whole), 7), *range(len(whole) - 90, len(whole))]:
            path.write_bytes(whole[:position])  # torn
            assert read(folder, 0) is None
            changed = bytearray(whole)
            changed[position] ^= 1 << (position % 8)
            path.write_bytes(changed)
            assert read(folder, 0) is None
        path.write_bytes(whole + b"\0")
        assert read(folder, 0) is None
        path.write_bytes(whole)
        assert same(RECORD, read(folder, 0))
        shutil.copy(path, folder.chunk_path(2))  # whole, but not what its name says
        assert read(folder, 2) is None
    other = RunFolder(tmp_path, IDENTITY | {"size": 4}, 3)
    assert read(other, 0) is None


def test_a_crash_while_a_run_starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def crash(*_: object) -> None:
        raise Crash

    for name in ("os.fsync", "os.replace"):
        with monkeypatch.context() as patch:
            patch.setattr(os, "unlink", lambda *_, **__: None)
            patch.setattr(name, crash)
            with pytest.raises(Crash), open_run(tmp_path, IDENTITY, 3):
                pass
        assert recorded(tmp_path) is None
    with open_run(tmp_path, IDENTITY, 3) as folder:
        folder.save(0, RECORD)
    assert recorded(tmp_path) == IDENTITY


def test_folders_that_cannot_be_used(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("x")
    full = tmp_path / "full"
    full.mkdir()
    (full / "thesis.tex").write_text("x")
    cases = {
        file: "it is a file",
        full: "is not empty and holds no run",
        tmp_path / "no" / "where": "there is no folder",
        file / "below": "cannot",
        tmp_path / "nul\0l": "cannot",
    }
    for path, text in cases.items():
        with pytest.raises(OutputError, match=text), open_run(path, IDENTITY, 3):
            pass
    assert (full / "thesis.tex").exists()
    assert len(list(full.iterdir())) == 1


@pytest.mark.parametrize("text", ["", "{", "[]", '{"schema": "pinsing/run/1"}', '"x"', "\ud800"])
def test_a_damaged_plan_is_refused(tmp_path: Path, text: str) -> None:
    with open_run(tmp_path, IDENTITY, 3):
        pass
    plan = tmp_path / "plan.json"
    good = json.loads(plan.read_text())
    plan.write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(OutputError, match=r"plan\.json"):
        recorded(tmp_path)
    good["identity"]["size"] = 4
    plan.write_text(json.dumps(good))
    with pytest.raises(OutputError, match="damaged"):
        recorded(tmp_path)


def test_two_at_once(tmp_path: Path) -> None:
    code = (
        "import sys, time; from pinsing.sampling.execute import open_run\n"
        f"with open_run({str(tmp_path)!r}, {IDENTITY!r}, 3):\n"
        "    print('in', flush=True); time.sleep(60)"
    )
    with started("-c", code) as child:
        assert child.stdout.readline() == "in\n"
        with pytest.raises(OutputError, match="another process is at work"):
            open_run(tmp_path, IDENTITY, 3).__enter__()
        child.kill()
    with open_run(tmp_path, IDENTITY, 3) as folder:  # the lock has died with its holder
        folder.save(0, RECORD)


# ---- a full disk


def test_a_full_disk_is_an_error_and_loses_nothing(tmp_path, monkeypatch):
    arm, out = arms.ur5(), tmp_path / "run"
    real, count = os.fsync, 0

    def full(handle: int) -> None:
        nonlocal count
        count += 1
        if count > 10:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(handle)

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OutputError, match=r"No space left on device; the 3 of 6 chunks .* safe"):
        sigma_map(arm, count=6 * BLOCK, chunk=1, out=out)
    monkeypatch.undo()
    assert len(list((out / "chunks").iterdir())) == 3
    told: list[str] = []
    again = sigma_map(arm, count=6 * BLOCK, chunk=1, out=out, tell=told.append)
    assert told == ["3 of 6 chunks were done before"]
    assert again.to_json() == sigma_map(arm, count=6 * BLOCK, chunk=1).to_json()


# ---- killed


@pytest.mark.slow
@pytest.mark.parametrize("where", tiered(["--threads", "--workers"], ("--threads",)))
def test_ctrl_c_at_a_terminal(tmp_path: Path, where: str) -> None:
    out = tmp_path / "run"
    words = ["map", "ur5", "--count", "1e9", "-o", str(out), "--chunk", "65536", where, "2"]
    with started("-m", "pinsing", *words, start_new_session=True) as child:
        soon((out / "plan.json").exists)  # workers are about to start
        time.sleep(0.15)
        os.killpg(child.pid, signal.SIGINT)  # a terminal sends it to all of them
        error = child.communicate(timeout=60)[1]
    assert child.returncode == 130
    assert "run the same command to resume" in error
    assert "Traceback" not in error


@pytest.mark.slow
def test_workers_do_not_outlive_a_killed_parent(tmp_path: Path) -> None:
    code = (
        "import os, time\n"
        "from pinsing.sampling.executors import local_processes\n"
        "if __name__ == '__main__':\n"
        "    with local_processes(2) as (executor, _):\n"
        "        print(*{executor.submit(os.getpid).result() for _ in range(9)}, flush=True)\n"
        "        time.sleep(60)\n"
    )
    script = tmp_path / "parent.py"
    script.write_text(code)
    with started(script) as parent:
        workers = [int(word) for word in parent.stdout.readline().split()]
        assert workers
        parent.kill()
    soon(lambda: not any(alive(pid) for pid in workers), 10)


def alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def test_what_only_one_of_two_runs_has_is_named(tmp_path: Path) -> None:
    with open_run(tmp_path, IDENTITY, 3):
        pass
    with pytest.raises(OutputError, match="x is null there and 1 here"):
        open_run(tmp_path, IDENTITY | {"x": 1}, 3).__enter__()


# ---- what a map and a sweep keep


def test_a_changed_robot_or_plan_or_engine_is_refused(tmp_path: Path) -> None:
    arm = arms.ur5()
    sigma_map(arm, count=BLOCK, out=tmp_path / "run")
    with pytest.raises(OutputError, match="geometry, task or length scale has changed"):
        sigma_map(arm.with_task(length_scale=0.5), count=BLOCK, out=tmp_path / "run")
    with pytest.raises(OutputError, match="count is 4096 there and 4097 here"):
        sigma_map(arm, count=BLOCK + 1, out=tmp_path / "run")
    with pytest.raises(OutputError, match="seed is 0 there and 1 here"):
        sigma_map(arm, count=BLOCK, seed=1, out=tmp_path / "run")
    with pytest.raises(OutputError, match="kind is"):
        run_sweep(arm, plan_sweep(arm, levels=1), out=tmp_path / "run")


@pytest.mark.skipif(len(kernel.isa_names()) < 2, reason="one instruction set only")
def test_a_run_keeps_the_instruction_set_it_began_with(tmp_path, monkeypatch):
    arm = arms.ur5()
    first = sigma_map(arm, count=BLOCK, engine="baseline", out=tmp_path / "run")
    again = sigma_map(arm, count=BLOCK, out=tmp_path / "run")
    assert again.engine == "baseline"
    assert again.to_json() == first.to_json()
    with pytest.raises(OutputError, match="engine is"):
        sigma_map(arm, count=BLOCK, engine=kernel.isa_names()[-1], out=tmp_path / "run")
    best = kernel.isa_names()[-1]
    sigma_map(arm, count=BLOCK, out=tmp_path / "best")
    monkeypatch.setattr(kernel, "isa_names", lambda: ("baseline",))
    with pytest.raises(EngineError, match=f"engine {best} does not run on this machine"):
        sigma_map(arm, count=BLOCK, out=tmp_path / "best")


def test_all_values_are_kept_on_request(tmp_path: Path) -> None:
    arm, out = arms.textbook("surgical7"), tmp_path / "run"
    count = 2 * BLOCK + 5
    options = {"count": count, "chunk": 1, "keep_values": True, "out": out}
    result = sigma_map(arm, **options)
    parts = []
    for path in sorted((out / "chunks").iterdir()):
        with np.load(path) as archive:
            parts.append(archive["sigma"])
    Q = plan_map(arm, count=count).configurations(0, count)
    np.testing.assert_array_equal(np.concatenate(parts), singular_values(arm, Q))
    with pytest.raises(OutputError, match="keep_values is true there and false here"):
        sigma_map(arm, count=count, chunk=1, out=out)
    assert result.plan.chunk == BLOCK


@pytest.mark.slow
def test_a_sweep_in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[run_sweep.__module__], "_CHUNK_ON_DISK", 1000)
    arm = arms.textbook("puma560")
    plan = plan_sweep(arm, samples=61, levels=3)
    whole = run_sweep(arm, plan)
    out = tmp_path / "run"

    stopped: list[int] = []

    def stop(done: int, total: int) -> None:
        stopped.append(done)
        if len(stopped) == 1:
            signal.raise_signal(signal.SIGINT)

    part = run_sweep(arm, plan, stop, out=out, threads=1)
    assert not part.complete
    assert 0 < len(part.curves) < len(whole.curves)
    kept = len(list((out / "chunks").iterdir()))  # what had begun was done, and kept
    told: list[str] = []
    rest = run_sweep(arm, plan, out=out, tell=told.append, threads=1)
    assert told[0].startswith(f"{kept} of ")
    assert rest.to_json() == whole.to_json()
    damaged = out / "chunks" / "000001.npz"
    damaged.write_bytes(damaged.read_bytes()[:-9])
    named = "batch" if kernel.available() else "pinocchio"  # what auto has taken
    assert run_sweep(arm, plan, out=out, engine=named).to_json() == whole.to_json()
    with pytest.raises(OutputError, match="samples is 61 there and 62 here"):
        run_sweep(arm, plan_sweep(arm, samples=62, levels=3), out=out)


def _ctrl_c_before(function: Callable[..., Any]) -> Callable[..., Any]:
    def interrupted(*args: Any, **kwargs: Any) -> Any:
        signal.raise_signal(signal.SIGINT)
        return function(*args, **kwargs)

    return interrupted


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("run", "pinsing.sampling.sweeps.pack_sweep"),
        ("run", "pinsing.sampling.singular_configurations"),
        ("curves.npz", "pinsing.sampling.sweeps.save_npz"),
        ("curves.npz", "pinsing.sampling.singular_configurations"),
    ],
)
def test_ctrl_c_after_the_last_chunk_of_a_sweep(name, place, tmp_path, monkeypatch):
    """All that was swept is kept and told; the findings, which come after, are left out."""
    home, _, function = place.rpartition(".")
    module = importlib.import_module(home)
    monkeypatch.setattr(module, function, _ctrl_c_before(getattr(module, function)))
    words = ["analyze", "planar3r", "--sweep", "--levels", "1", "--samples", "21", "--threads", "1"]
    out = tmp_path / name
    done = run(*words, "-o", str(out))
    assert done.exit_code == 130
    assert "there are no findings" in done.stdout
    assert "pinsing: stopped" in done.stderr
    kept = load_npz(out if out.is_file() else out / "sweep.npz")
    assert isinstance(kept, SweepResult)
    assert kept.complete
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_when_a_map_is_complete_takes_nothing_away(tmp_path, monkeypatch):
    module = importlib.import_module("pinsing.sampling.maps")
    monkeypatch.setattr(module, "distributions", _ctrl_c_before(module.distributions))
    words = ["map", "planar3r", "--count", "4096", "--threads", "1"]
    done = run(*words, "-o", str(tmp_path / "run"))
    assert done.exit_code == 0
    assert "planar3r: " in done.stdout
    assert (tmp_path / "run" / "result.json").exists()


def test_a_run_hears_of_ctrl_c_that_came_before_it() -> None:
    arm = arms.textbook("stanford")
    plan = plan_sweep(arm, samples=21, levels=1)
    results = []

    @ctrl_c_afterwards()
    def interrupted() -> None:
        signal.raise_signal(signal.SIGINT)
        results.append(run_sweep(arm, plan, threads=1))

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [result.complete for result in results] == [False]
    with ctrl_c_afterwards():
        assert run_sweep(arm, plan, threads=1).complete


def test_sweep_command_in_a_folder(tmp_path: Path) -> None:
    words = ["analyze", "planar3r", "--sweep", "--levels", "1", "--samples", "21"]
    done = run(*words, "-o", str(tmp_path / "run"), "--threads", "2")
    assert done.exit_code == 0
    kept = load_npz(tmp_path / "run" / "sweep.npz")
    assert isinstance(kept, SweepResult)
    assert kept.complete
    again = run(*words, "-o", str(tmp_path / "run"))
    assert "1 of 1 chunks were done before" in again.stderr
    assert again.stdout == done.stdout
    other = run("analyze", "planar3r", "--sweep", "--samples", "22", "-o", str(tmp_path / "run"))
    assert other.exit_code == 2
    assert "holds another run" in other.stderr
