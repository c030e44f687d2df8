"""The same runs on a dask.distributed cluster: a real scheduler and worker processes, here."""

from __future__ import annotations

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

import arms
import pytest
from click.testing import CliRunner

from pinsing.cli.app import command
from pinsing.errors import WorkerError
from pinsing.maps import sigma_map
from pinsing.maps.plan import BLOCK
from pinsing.robot.load import load
from pinsing.runs.cluster import dask_cluster
from pinsing.sweeps.plan import plan_sweep
from pinsing.sweeps.run import run_sweep

distributed = pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")

SECONDS = 60


@dataclass
class Cluster:
    address: str
    workers: list[subprocess.Popen[bytes]]


def dask(*words: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )


@contextlib.contextmanager
def cluster(folder: Path, workers: int) -> Iterator[Cluster]:
    """Scheduler on the loopback interface, and worker processes without a nanny to revive them."""
    file = folder / "scheduler.json"
    where = ["--host", "127.0.0.1", "--no-dashboard"]
    with contextlib.ExitStack() as stack:

        def start(*words: str) -> subprocess.Popen[bytes]:
            process = stack.enter_context(dask(*words))
            stack.callback(process.kill)
            return process

        start("scheduler", *where, "--port", "0", "--scheduler-file", str(file))
        deadline = time.monotonic() + SECONDS
        while not (file.exists() and file.stat().st_size):
            assert time.monotonic() < deadline, "the scheduler has not come up"
            time.sleep(0.05)
        address = json.loads(file.read_text())["address"]
        options = ["--no-nanny", "--nthreads", "1", "--local-directory", str(folder), *where]
        yield Cluster(address, [start("worker", address, *options) for _ in range(workers)])


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with cluster(tmp_path_factory.mktemp("dask"), 2) as found:
        yield found


def test_a_cluster_gives_the_same_bits(shared: Cluster) -> None:
    arm = arms.textbook("surgical7")
    options = {"count": 20 * BLOCK + 3, "chunk": BLOCK}
    with dask_cluster(shared.address, timeout=SECONDS) as (executor, parallel):
        result = sigma_map(arm, **options, executor=executor, parallel=parallel)
    assert result.to_json() == sigma_map(arm, **options).to_json()


def test_a_sweep_on_a_cluster(shared: Cluster) -> None:
    arm = arms.textbook("puma560")
    plan = plan_sweep(arm, samples=41)
    with dask_cluster(shared.address, timeout=SECONDS) as (executor, parallel):
        result = run_sweep(arm, plan, executor=executor, parallel=parallel)
    assert result.to_json() == run_sweep(arm, plan).to_json()


def test_the_command(shared: Cluster, tmp_path: Path) -> None:
    words = ["map", "ur5", "--count", "2e5", "--chunk", "20000", "--json", "-"]
    done = CliRunner().invoke(
        command, [*words, "--dask", shared.address, "--out", str(tmp_path / "run")]
    )
    assert done.exit_code == 0, done.output
    assert f"dask worker threads at {shared.address}" in done.stderr
    assert done.stdout == CliRunner().invoke(command, words).stdout
    assert len(list((tmp_path / "run" / "chunks").iterdir())) == 10


def test_a_worker_lost_right_after_its_result_was_fetched(
    shared: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The result is here, though the cluster no longer has it."""
    fetched = distributed.Future._result

    async def lost(future: Any, raiseit: bool = True) -> Any:
        result = await fetched(future, raiseit)
        future._state.lose()
        return result

    monkeypatch.setattr(distributed.Future, "_result", lost)
    with dask_cluster(shared.address, timeout=SECONDS) as (executor, _):
        assert executor.submit(sum, (1, 2, 3, 4)).result(SECONDS) == 10


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


def test_a_worker_killed_in_the_middle(tmp_path: Path) -> None:
    arm = load("panda")
    options = {"count": 24 * BLOCK, "chunk": BLOCK, "engine": "pinocchio"}
    with (
        cluster(tmp_path, 2) as found,
        dask_cluster(found.address, timeout=SECONDS) as (executor, _),
    ):
        deadline = time.monotonic() + SECONDS
        while len(executor._client.nthreads()) < 2:
            assert time.monotonic() < deadline, "the workers have not come up"
            time.sleep(0.05)
        seen: list[int] = []

        def progress(done: int, total: int) -> None:
            seen.append(done)
            if len(seen) == 3:
                found.workers[0].send_signal(signal.SIGKILL)

        result = sigma_map(
            arm,
            **options,
            executor=executor,
            parallel=2,
            progress=progress,
            out=tmp_path / "run",
        )
        assert found.workers[0].wait(SECONDS) == -signal.SIGKILL
        assert len(executor._client.nthreads()) == 1
    assert len(seen) == 24  # each chunk once
    assert result.to_json() == sigma_map(arm, **options).to_json()


def test_nobody_answers() -> None:
    with (
        pytest.raises(WorkerError, match=r"no dask scheduler at tcp://127\.0\.0\.1:9"),
        dask_cluster("tcp://127.0.0.1:9", timeout=0.3),
    ):
        pass
    with (
        pytest.raises(WorkerError, match="no dask scheduler at nonsense://x"),
        dask_cluster("nonsense://x", timeout=0.3),
    ):
        pass


def test_a_scheduler_without_workers(tmp_path: Path) -> None:
    with (
        cluster(tmp_path, 0) as found,
        pytest.raises(WorkerError, match="has no workers"),
        dask_cluster(found.address, timeout=1),
    ):
        pass


def test_without_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(WorkerError, match=r"pip install 'pinsing\[cluster\]'"), dask_cluster("x"):
        pass
