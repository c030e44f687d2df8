"""Runs in a folder: whatever happens to the process, the disk or the files, nothing is lost.

Folders that somebody has been in: what is strange is named, nothing is believed. Short runs of
scripts/durability, and proof that it would notice.
"""

import contextlib
import errno
import importlib
import itertools
import os
import re
import shutil
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import arms
import numpy as np
import pytest
from command_line import python, run, soon, started
from public import SCRIPTS, script
from tiers import tiered

from pinsing import singular_values
from pinsing._batch import engine as kernel
from pinsing.chunk_file import DamagedError, pack, read_arrays, read_bounded
from pinsing.cli.app import command as program
from pinsing.errors import EngineError, OutputError, ResultError
from pinsing.kinematics.jacobian import fixed_batch
from pinsing.sampling import MapResult, plan_map, sigma_map
from pinsing.sampling.execute import RunFolder, ctrl_c_afterwards, open_run, recorded
from pinsing.sampling.maps import BLOCK, MapJob, compute_map_chunk
from pinsing.sampling.sweeps import load_npz, plan_sweep, run_sweep
from pinsing.view.picture import find_browser

IDENTITY = {"kind": "test", "size": 3}
RECORD = {"a": np.arange(5.0), "b": np.array([1, 2])}


def same(one: dict, two: dict | None) -> bool:
    return two is not None and all(np.array_equal(one[k], two[k]) for k in one.keys() | two.keys())


def read(folder: RunFolder, index: int) -> dict | None:
    """A chunk; None if it is not there, damaged, or of another run or place."""
    with contextlib.suppress(FileNotFoundError, DamagedError):
        return folder.read(index)
    return None


def test_chunks_come_back_as_they_were_and_any_damage_is_found(tmp_path: Path) -> None:
    with open_run(tmp_path / "run", IDENTITY, 3) as folder:
        assert folder.kept() == ()
        assert read(folder, 1) is None
        folder.save(1, RECORD)
        folder.save(2, {"a": np.zeros(0)})
    assert recorded(tmp_path / "run") == IDENTITY
    assert recorded(tmp_path / "nowhere") is None
    with open_run(tmp_path / "run", IDENTITY, 3) as folder:
        assert folder.kept() == (1, 2)
        path = folder.chunk_path(1)
        with np.load(path) as archive:  # NumPy alone reads them too
            np.testing.assert_array_equal(archive["a"], RECORD["a"])
        whole = path.read_bytes()
        damaged = [whole + b"\0"]
        for position in [*range(0, len(whole), 7), *range(len(whole) - 90, len(whole))]:
            changed = bytearray(whole)
            changed[position] ^= 1 << (position % 8)
            damaged += [whole[:position], bytes(changed)]
        for data in damaged:
            path.write_bytes(data)
            assert read(folder, 1) is None
        path.write_bytes(whole)
        assert same(RECORD, read(folder, 1))
        shutil.copy(path, folder.chunk_path(2))  # whole, but not what its name says
        assert read(folder, 2) is None
    assert read(RunFolder(tmp_path / "run", IDENTITY | {"size": 4}, 3), 1) is None


def test_folders_that_cannot_be_used(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("x")
    full = tmp_path / "full"
    full.mkdir()
    (full / "thesis.tex").write_text("x")
    for path, text in (
        (file, "it is a file"),
        (full, "is not empty and holds no run"),
        (tmp_path / "no" / "where", "there is no folder"),
        (file / "below", "cannot"),
        (tmp_path / "nul\0l", "cannot"),
    ):
        with pytest.raises(OutputError, match=text), open_run(path, IDENTITY, 3):
            pass
    assert [path.name for path in full.iterdir()] == ["thesis.tex"]


PLANS = ["", "{", "[]", '{"schema": "pinsing/run/1"}', '"x"', "\ud800", "[" * 100_000]
PLANS += ['{"identity": {"a": NaN}, "sha256": "", "schema": 1}']


@pytest.mark.parametrize("text", PLANS, ids=range(len(PLANS)))
def test_a_damaged_plan_is_refused(tmp_path: Path, text: str) -> None:
    with open_run(tmp_path, IDENTITY, 3):
        pass
    plan = tmp_path / "plan.json"
    changed = plan.read_text().replace('"size": 3', '"size": 4')
    for held in (text, changed):
        plan.write_bytes(held.encode("utf-8", "surrogatepass"))
        with pytest.raises(OutputError, match=r"plan\.json( is damaged;|: )"):
            recorded(tmp_path)
    os.truncate(plan, 1 << 40)
    with pytest.raises(OutputError, match=r"plan\.json: .*more than the"):
        recorded(tmp_path)


def test_two_at_once(tmp_path: Path) -> None:
    code = (
        "import time; from pinsing.sampling.execute import open_run\n"
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


def test_a_full_disk_is_an_error_and_loses_nothing(whole, tmp_path, monkeypatch):
    room, fsync = iter(range(10)), os.fsync

    def full(handle: int) -> None:
        if next(room, None) is None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(handle)

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OutputError, match=r"No space left on device; the 3 of 4 chunks .* safe"):
        mapped(tmp_path / "run")
    monkeypatch.undo()
    assert resume(tmp_path / "run", whole) == ["3 of 4 chunks were done before"]


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
        "        print([executor.submit(os.getpid).result() for _ in range(9)], flush=True)\n"
        "        time.sleep(60)\n"
    )
    script = tmp_path / "parent.py"
    script.write_text(code)
    with started(script) as parent:
        assert parent.stdout.readline()
        parent.kill()
        parent.communicate(timeout=10)  # what it has begun, and nobody else, holds its pipes


def test_a_changed_robot_or_plan_or_engine_is_refused(tmp_path: Path) -> None:
    arm, out = arms.ur5(), tmp_path / "run"
    sigma_map(arm, count=BLOCK, out=out)
    other = arm.with_task(length_scale=0.5)
    for given, options, said in (
        (other, {}, "geometry, task or length scale has changed"),
        (arm, {"count": BLOCK + 1}, "count is 4096 there and 4097 here"),
        (arm, {"seed": 1}, "seed is 0 there and 1 here"),
    ):
        with pytest.raises(OutputError, match=said):
            sigma_map(given, **{"count": BLOCK, **options}, out=out)
    with pytest.raises(OutputError, match="kind is"):
        run_sweep(arm, plan_sweep(arm, levels=1), out=out)
    with pytest.raises(OutputError, match="x is null there and 1 here"):
        open_run(out, recorded(out) | {"x": 1}, 1).__enter__()


@pytest.mark.skipif(len(kernel.isa_names()) < 2, reason="one instruction set only")
def test_a_run_keeps_the_instruction_set_it_began_with(tmp_path, monkeypatch):
    arm, best = arms.ur5(), kernel.isa_names()[-1]
    first = sigma_map(arm, count=BLOCK, engine="baseline", out=tmp_path / "run")
    again = sigma_map(arm, count=BLOCK, out=tmp_path / "run")
    assert again.engine == "baseline"
    assert again.to_json() == first.to_json()
    with pytest.raises(OutputError, match="engine is"):
        sigma_map(arm, count=BLOCK, engine=best, out=tmp_path / "run")
    sigma_map(arm, count=BLOCK, out=tmp_path / "best")
    monkeypatch.setattr(kernel, "isa_names", lambda: ("baseline",))
    with pytest.raises(EngineError, match=f"engine {best} does not run on this machine"):
        sigma_map(arm, count=BLOCK, out=tmp_path / "best")


def test_all_values_are_kept_on_request(tmp_path: Path) -> None:
    arm, out = arms.textbook("surgical7"), tmp_path / "run"
    count = 2 * BLOCK + 5
    options = {"count": count, "chunk": 1, "keep_values": True, "out": out}
    result = sigma_map(arm, **options)
    parts = [np.load(path)["sigma"] for path in sorted((out / "chunks").iterdir())]
    Q = plan_map(arm, count=count).configurations(0, count)
    np.testing.assert_array_equal(np.concatenate(parts), singular_values(arm, Q))
    with pytest.raises(OutputError, match="keep_values is true there and false here"):
        sigma_map(arm, count=count, chunk=1, out=out)
    assert result.plan.chunk == BLOCK


def test_a_sweep_in_a_folder(tmp_path: Path) -> None:
    arm, out = arms.textbook("puma560"), tmp_path / "run"
    plan = plan_sweep(arm, samples=361)

    def stop(done: int, total: int) -> None:
        signal.raise_signal(signal.SIGINT)

    assert not run_sweep(arm, plan, stop, chunk=1, out=out, threads=1).complete
    kept = len(list((out / "chunks").iterdir()))  # what had begun was done, and kept
    told: list[str] = []
    named = "batch" if kernel.available() else "pinocchio"  # what auto has taken
    rest = run_sweep(arm, plan, chunk=1, out=out, engine=named, tell=told.append)
    assert told[0].startswith(f"{kept} of ")
    assert rest.to_json() == run_sweep(arm, plan).to_json()


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
    assert load_npz(out if out.is_file() else out / "sweep.npz").complete
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if name == "run":
        monkeypatch.undo()
        again = run(*words, "-o", str(out))
        assert again.exit_code == 0
        assert "1 of 1 chunks were done before" in again.stderr
        other = run(*words, "--samples", "22", "-o", str(out))
        assert other.exit_code == 2
        assert "holds another run" in other.stderr


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


COUNT = 4 * BLOCK


def mapped(out: Path, **more: Any) -> MapResult:
    """A map of four chunks."""
    return sigma_map(arms.ur5(), count=COUNT, chunk=1, out=out, **more)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("map") / "run"
    mapped(out)
    return out


@pytest.fixture
def made(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "run"))


def resume(made: Path, whole: Path) -> list[str]:
    """Go on with a run; what was told. All bytes are those of the run at one stretch."""
    told: list[str] = []
    (made / "result.json").unlink(missing_ok=True)
    result = mapped(made, tell=told.append)
    assert result.complete
    assert (made / "result.json").read_bytes() == (whole / "result.json").read_bytes()
    for index in range(4):
        name = f"chunks/{index:06d}.npz"
        assert not (made / name).is_symlink()
        assert (made / name).read_bytes() == (whole / name).read_bytes()
    return told


@pytest.mark.parametrize("name", ["3.npz", "0000003.npz", "²²²²²².npz"])
def test_only_exact_names_count_and_litter_of_killed_writes_is_removed(made, whole, name):
    shutil.copy(made / "chunks" / "000003.npz", made / "chunks" / name)
    litter = [made / ".plan.json.0123.part", made / "chunks" / ".000001.npz.0123.part"]
    for path in litter:
        path.write_bytes(b"half")
    (made / "plan.json").unlink()  # whose write was killed
    assert resume(made, whole) == ["4 of 4 chunks were done before"]
    assert not any(path.exists() for path in litter)
    (made / "chunks" / "000003.npz").unlink()
    assert resume(made, whole) == ["3 of 4 chunks were done before"]


def other_contents(path: Path) -> None:
    run = path.parents[1]
    RunFolder(run, recorded(run), 4).save(2, RECORD)


def of_another_run(path: Path) -> None:
    other = path.parents[2] / "other"
    mapped(other, seed=1)
    shutil.copy(other / "chunks" / path.name, path)


STRANGE: dict[str, tuple[Callable[[Path], object], str]] = {
    "whole, of other contents": (other_contents, "does not belong"),
    "a link to a device": (lambda p: p.symlink_to("/dev/zero"), "it is a link"),
    "a link to another chunk": (lambda p: p.symlink_to("000001.npz"), "it is a link"),
    "a link to nothing": (lambda p: p.symlink_to("nothing"), "it is a link"),
    "a pipe": (lambda p: os.mkfifo(p), "a device or pipe"),
    "of another run": (of_another_run, "it belongs to another run"),
    "of another place": (lambda p: shutil.copy(p.with_name("000001.npz"), p), "another place"),
    "nothing at all": (lambda p: p.write_bytes(b""), "not as it was written"),
    "a terabyte of nothing": (lambda p: os.truncate(os.open(p, 65), 1 << 40), "more than the"),
}


@pytest.mark.parametrize("kind", STRANGE)
def test_what_is_no_chunk_is_named_and_done_again(made: Path, whole: Path, kind: str) -> None:
    path = made / "chunks" / "000002.npz"
    path.unlink()
    make, said = STRANGE[kind]
    make(path)
    told = resume(made, whole)
    assert told[0] == "3 of 4 chunks were done before"
    assert re.fullmatch(rf"damaged and done again: chunks 2 \(.*{said}.*\)", told[1])


def test_chunks_that_are_deleted_during_the_run(tmp_path: Path) -> None:
    out = tmp_path / "run"

    def tidy(done: int, total: int) -> None:
        if done == 2 * BLOCK:
            shutil.rmtree(out / "chunks")

    assert mapped(out, threads=1, progress=tidy).complete


@pytest.mark.parametrize(
    ("name", "make"),
    [
        *itertools.product(("plan.json", "lock"), (os.mkfifo, STRANGE["a link to a device"][0])),
        ("chunks/000002.npz", os.mkdir),
    ],
)
def test_what_is_no_file_is_an_error_before_anything_is_computed(made, name, make):
    (made / name).unlink()
    make(made / name)
    with pytest.raises(OutputError, match=f"cannot use .*(run|{name})"):
        mapped(made)


CHANGED: dict[str, Callable[[np.ndarray], Any]] = {
    "more": lambda a: a + 1, "less": lambda a: a - 1, "far": lambda a: a + 10**6,
    "of another chunk": lambda a: a + BLOCK, "of a whole run": lambda a: a * [4] * (len(a) == 3),
    "one more": lambda a: a + (np.arange(a.size) == 0).reshape(a.shape),
    "another more": lambda a: a + (np.arange(a.size) == 1).reshape(a.shape),
    "all": lambda a: np.resize([BLOCK, BLOCK, 1], a.shape), "negative": lambda a: -a,
    "larger": lambda a: a * 1.001, "backwards": lambda a: a[..., ::-1], "fewer": lambda a: a[:-1],
    "nothing": lambda a: a * 0, "one number": lambda a: a * 0 + 2 * BLOCK,
    "first of the block": lambda a: a // BLOCK * BLOCK,
    "others of the block": lambda a: np.sort(a) // BLOCK * BLOCK + np.arange(a.shape[-1]),
    "no number": lambda a: a * np.nan, "infinite": lambda a: a + np.inf, "half": lambda a: a // 2,
    "text": lambda a: a.astype(str), "floats": lambda a: a.astype(float), "a scalar": np.max,
    "another shape": lambda a: a[None], "large": lambda a: np.full((2, 2), 2**62),
}  # fmt: skip
"""Of each array of a chunk; some leave some arrays as they are."""
UNSEEN = {
    "backwards": ("sigma_counts", "ratio_counts"), "another more": ("sigma_bins", "ratio_bins"),
    "first of the block": ("counts",),
}  # fmt: skip
"""What only the work done again would tell."""


@pytest.mark.parametrize("kind", CHANGED)
def test_contents_that_no_chunk_has(kind: str) -> None:
    plan = plan_map(arms.ur5(), count=COUNT, chunk=1)
    job = MapJob(plan, fixed_batch(arms.ur5(), "auto"), False, None)
    record = compute_map_chunk(job, 2)
    job.check(2, record)
    changed = [{}, {**record, "sigma": np.ones(1)}]
    for name, array in record.items():
        other = np.asarray(CHANGED[kind](array))
        same_as_before = other.dtype == array.dtype and np.array_equal(other, array)
        if not same_as_before and name not in UNSEEN.get(kind, ()):
            changed.append({**record, name: other})
    assert len(changed) > 6
    for wrong in changed:
        with pytest.raises(DamagedError):
            job.check(2, wrong)


def test_arrays_that_are_not_what_they_may_be_are_not_read(tmp_path: Path) -> None:
    bomb = pack({"a": np.zeros(5_000_000)}, "run", 0)  # 40 MB
    assert len(bomb) < 50_000
    many = pack({f"a{i}": np.zeros(1) for i in range(68)}, "run", 0)
    np.savez(tmp_path / "x.npz", a=np.array([{}, print], dtype=object), allow_pickle=True)
    objects = (tmp_path / "x.npz").read_bytes()
    np.savez(tmp_path / "x.npz", a=np.zeros(3))
    # Stored as it is: the header can be changed, and then the sum over it is wrong too.
    data = (tmp_path / "x.npz").read_bytes()
    more, less = (data.replace(b"(3,),", wrong) for wrong in (b"(9,),", b"(-3,)"))
    for held, said in (
        (bomb, "too large"),
        (many, "holds 70 arrays"),
        (objects, "kind 'O'"),
        (more, None),
        (less, None),
    ):
        with pytest.raises(DamagedError, match=said):
            read_arrays(held, 1 << 20)


def test_reading_never_waits(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        with pytest.raises((DamagedError, OSError)):
            read_bounded(path, 100, follow=True)
        with pytest.raises(ResultError):
            load_npz(path)


commands, failures, power = (
    script(f"durability.{name}") for name in ("commands", "failures", "power")
)


QUICK = {"at .json"}


@pytest.mark.parametrize("command", tiered(sorted(commands.COMMANDS), QUICK))
def test_each_operation_fails_in_turn(tmp_path: Path, command: str) -> None:
    if command in commands.BROWSER and find_browser() is None:
        pytest.skip("there is no browser")
    rows, wrong = failures.failures(command, tmp_path)
    assert wrong == []
    operations = {row["operation"].split(",")[0] for row in rows}
    assert operations >= {"open", "write", "fsync", "replace", "fsync of a folder"}
    assert all(row["good"] == row["cases"] > 0 for row in rows)


def test_every_command_that_writes_is_here() -> None:
    """Found from the program itself, so that a new option cannot be forgotten."""
    assert commands.uncovered(program) == []


@pytest.mark.parametrize("command", tiered(["map FOLDER", "sweep FOLDER"], ("map FOLDER",)))
def test_loss_of_power(tmp_path: Path, command: str) -> None:
    row, wrong = power.cuts(command, 12, 1, tmp_path)
    assert wrong == []
    assert row["good"] == 12
    assert row["operations"] > 20


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["map, threads", "sweep, threads", "map, worker processes"])
def test_kills(tmp_path: Path, kind: str) -> None:
    """In a process of its own: what is forked must not have threads."""
    words = ("-m", "durability", "kills", "--kills", "40", "--kind", kind)
    done = python(*words, "--json", tmp_path / "kills.json", cwd=SCRIPTS, timeout=540)
    assert done.returncode == 0, done.stderr
