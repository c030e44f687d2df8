"""The same runs on a dask.distributed cluster: a real scheduler and worker processes, here."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from command_line import run, soon, started

from pinsing._version import __version__
from pinsing.errors import WorkerError
from pinsing.robot.load import load
from pinsing.sampling import sigma_map
from pinsing.sampling.executors import call_there, dask_cluster
from pinsing.sampling.maps import BLOCK


@pytest.fixture(autouse=True, scope="module")
def _distributed() -> None:
    """Half a second, for these tests alone."""
    global distributed
    distributed = pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")


SECONDS = 60


@dataclass
class Cluster:
    address: str
    workers: list[subprocess.Popen[str]]
    scheduler: subprocess.Popen[str]


@contextlib.contextmanager
def cluster(folder: Path, workers: int, there: dict[str, str] | None = None) -> Iterator[Cluster]:
    """Scheduler on the loopback interface, and worker processes without a nanny to revive them."""
    file = folder / "scheduler.json"
    where = ["--host", "127.0.0.1", "--no-dashboard"]
    with contextlib.ExitStack() as stack:

        def start(*words: str, **more: str) -> subprocess.Popen[str]:
            streams = dict.fromkeys(("stdout", "stderr"), subprocess.DEVNULL)
            env = {**os.environ, "OMP_NUM_THREADS": "1", **more}
            process = stack.enter_context(started("-m", "dask", *words, env=env, **streams))
            stack.callback(process.kill)
            return process

        scheduler = start("scheduler", *where, "--port", "0", "--scheduler-file", str(file))
        soon(lambda: file.exists() and file.stat().st_size)
        address = json.loads(file.read_text())["address"]
        options = ["--no-nanny", "--nthreads", "1", "--local-directory", str(folder), *where]
        more = there or {}
        made = [start("worker", address, *options, **more) for _ in range(workers)]
        yield Cluster(address, made, scheduler)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with cluster(tmp_path_factory.mktemp("dask"), 2) as found:
        yield found


@pytest.mark.slow
def test_the_command(shared: Cluster, tmp_path: Path) -> None:
    words = ["map", "ur5", "--count", "2e5", "--chunk", "20000", "-o", "-"]
    done = run(*words, "--dask", shared.address, "-o", tmp_path / "run")
    assert done.exit_code == 0, done.output
    assert f"dask worker threads at {shared.address}" in done.stderr
    assert done.stdout == run(*words).stdout
    assert len(list((tmp_path / "run" / "chunks").iterdir())) == 10


@pytest.mark.slow
def test_a_worker_lost_right_after_its_result_was_fetched(shared, monkeypatch):
    """The result is here, though the cluster no longer has it."""
    fetched = distributed.Future._result

    async def lost(future: Any, raiseit: bool = True) -> Any:
        result = await fetched(future, raiseit)
        future._state.lose()
        return result

    monkeypatch.setattr(distributed.Future, "_result", lost)
    with dask_cluster(shared.address, timeout=SECONDS) as (executor, _):
        assert executor.submit(sum, (1, 2, 3, 4)).result(SECONDS) == 10


@pytest.mark.slow
def test_errors_and_ends_reach_who_waits(shared: Cluster) -> None:
    with dask_cluster(shared.address, timeout=SECONDS) as (executor, _):
        with pytest.raises(ZeroDivisionError):
            executor.submit(divmod, 1, 0).result(SECONDS)
        never, ended = (executor.submit(time.sleep, 2) for _ in range(2))
        assert never.cancel()
    with pytest.raises(CancelledError):
        never.result(SECONDS)
    with pytest.raises(CancelledError):  # by the end of the connection
        ended.result(SECONDS)


@pytest.mark.slow
def test_a_worker_killed_in_the_middle(tmp_path: Path) -> None:
    arm = load("panda")
    options = {"count": 24 * BLOCK, "chunk": BLOCK, "engine": "pinocchio"}
    with (
        cluster(tmp_path, 2) as found,
        dask_cluster(found.address, timeout=SECONDS) as (executor, _),
    ):
        soon(lambda: len(executor._client.nthreads()) == 2)
        seen: list[int] = []

        def progress(done: int, total: int) -> None:
            seen.append(done)
            if len(seen) == 3:
                found.workers[0].send_signal(signal.SIGKILL)

        result = sigma_map(
            arm, **options, executor=executor, parallel=2, progress=progress, out=tmp_path / "run"
        )
        assert found.workers[0].wait(SECONDS) == -signal.SIGKILL
        assert len(executor._client.nthreads()) == 1
    assert len(seen) == 24  # each chunk once
    assert result.to_json() == sigma_map(arm, **options).to_json()


OUT_OF_REACH = ["tcp://127.0.0.1:9", "tls://127.0.0.1:1", "ucxx://127.0.0.1:1", "a..b:1"]
NO_ADDRESS = ["junk", "", "tcp://", "http://[", "tcp://127.0.0.1:99999", "inproc://x", "a b:1"]
NO_ADDRESS += ["nonsense://x"]


@pytest.mark.parametrize("address", [*OUT_OF_REACH, *NO_ADDRESS])
def test_an_address_that_cannot_be_reached_is_one_line(address, monkeypatch):
    """No client is left half made: it says so 20 s later, in a traceback on stderr."""
    asked: list[Any] = []
    monkeypatch.setattr(distributed, "Client", lambda *given, **_: asked.append(given))
    if address in NO_ADDRESS:  # nobody is asked, so nothing is waited for
        monkeypatch.setattr("pinsing.sampling.executors._knock", lambda *given: asked.append(given))
    with pytest.raises(WorkerError) as caught, dask_cluster(address, 0.3):
        pass
    assert not asked
    said = str(caught.value)
    assert said.startswith(f"no dask scheduler at {address}")
    assert "\n" not in said
    assert ("no address such as tcp://HOST:PORT" in said) == (address in NO_ADDRESS)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_scheduler_that_dies(tmp_path: Path, number: signal.Signals) -> None:
    out = tmp_path / "run"
    words = ["map", "planar3r", "--count", "2e6", "--chunk", "4096", "-o", str(out)]
    with cluster(tmp_path, 2) as found:
        child = started("-m", "pinsing", *words, "--dask", found.address)
        soon(lambda: len([*out.glob("chunks/*")]) >= 3)
        found.scheduler.send_signal(number)
        error = child.communicate(timeout=SECONDS)[1]
    assert child.returncode == 2, error
    lines = [x for x in error.splitlines() if "note: " not in x and "worker threads" not in x]
    assert len(lines) == 1, error
    assert lines[0].startswith("pinsing: error: ")
    assert "what is kept in a folder is safe" in lines[0]
    kept = len(os.listdir(out / "chunks"))
    done = run(*words)
    assert f"{kept} of 489 chunks were done before" in done.stderr


OLD = "has pinsing 0\\.0\\.9 installed, and this is .*: install"


@pytest.mark.slow
@pytest.mark.parametrize(("workers", "said"), [(1, OLD), (0, "has no workers")])
def test_a_cluster_that_is_of_no_use(tmp_path: Path, workers: int, said: str) -> None:
    old = tmp_path / "old" / "pinsing-0.0.9.dist-info"
    old.mkdir(parents=True)
    (old / "METADATA").write_text("Metadata-Version: 2.1\nName: pinsing\nVersion: 0.0.9\n")
    with (
        cluster(tmp_path, workers, {"PYTHONPATH": str(old.parent)}) as found,
        pytest.raises(WorkerError, match=said),
        dask_cluster(found.address, timeout=SECONDS if workers else 1),
    ):
        pass


def test_a_worker_that_joined_later_with_another_version() -> None:
    assert call_there(__version__, divmod, 7, 2) == (3, 1)
    with pytest.raises(WorkerError, match=r"a dask worker has pinsing .* and this is 9\.9"):
        call_there("9.9", divmod, 7, 2)


def test_without_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(WorkerError, match=r"pip install 'pinsing\[cluster\]'"), dask_cluster("x"):
        pass
