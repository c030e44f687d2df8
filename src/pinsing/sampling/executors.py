"""Processes of this machine and workers of a dask.distributed cluster, as executors."""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing
import multiprocessing.connection
import os
import re
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import resource_tracker
from typing import Any

from pinsing._version import __version__
from pinsing.errors import WorkerError
from pinsing.sampling.execute import connection_lost, how_many


@contextlib.contextmanager
def local_processes(workers: int | None = None) -> Iterator[tuple[Executor, int]]:
    """Yield processes of this machine, by default one a processor, and how many."""
    # They leave Ctrl-C to this process, and end when it does, however that is.
    count = how_many(workers, "workers")
    resource_tracker.ensure_running()  # else the first worker starts it, which unblocks Ctrl-C
    executor = _Processes(
        count, mp_context=multiprocessing.get_context("spawn"), initializer=_follow_parent
    )
    ended = threading.Event()
    watcher = threading.Thread(target=executor.watch, args=(ended,), daemon=True)
    watcher.start()
    try:
        yield executor, count
    finally:
        executor.shutdown(wait=True, cancel_futures=True)
        ended.set()


class _Processes(ProcessPoolExecutor):
    def watch(self, ended: threading.Event) -> None:
        """See that a worker that dies is noticed, until the end."""
        # The executor misses one amid the writing of a result: it and all workers would wait for
        # ever.
        while not ended.wait(0.5):
            workers = list((getattr(self, "_processes", None) or {}).values())
            if any(not worker.is_alive() for worker in workers):
                if ended.wait(2.0):
                    return
                for worker in workers:
                    worker.kill()
                with contextlib.suppress(AttributeError, OSError):
                    # Nobody else can write to it now: the rest is an end of file.
                    self._result_queue._writer.close()  # type: ignore[attr-defined]
                return

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        # Processes that are started now inherit that Ctrl-C is blocked: it is for this one.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return super().submit(fn, *args, **kwargs)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _follow_parent() -> None:
    """Start of a worker process: no Ctrl-C of its own, and no life after its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None  # only worker processes come here
    watcher = threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True)
    watcher.start()


def _end_with(sentinel: int) -> None:
    multiprocessing.connection.wait([sentinel])
    os._exit(1)


_ADDRESS = re.compile(r"(?:(?:tcp|tls|ws|wss|ucx|ucxx)://)?(?:[\w.-]+|\[[0-9A-Fa-f:.%\w]+\]):(\d+)")


@contextlib.contextmanager
def dask_cluster(address: str, timeout: float = 10.0) -> Iterator[tuple[Executor, int]]:
    """Workers of a running dask.distributed cluster; a chunk of a lost worker is done elsewhere."""
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise WorkerError(
            "dask.distributed is not installed; pip install 'pinsing[cluster]'"
        ) from None
    import asyncio  # a tenth of a second of a start, and nobody else needs it

    port = _ADDRESS.fullmatch(address)
    WorkerError.refuse_if(
        port is None or not 0 < int(port[1]) < 65536,
        f"no dask scheduler at {address[:100]}: that is no address such as tcp://HOST:PORT",
    )
    try:
        # A client that cannot connect is sometimes left half made, and ends 20 s later, loudly.
        with ThreadPoolExecutor(1) as aside:
            aside.submit(asyncio.run, _knock(distributed, address, timeout)).result()
        client = distributed.Client(address, timeout=timeout, set_as_default=False)
    except Exception as error:  # of whatever part of the network, down to its certificates
        raise WorkerError(f"no dask scheduler at {address}: {_first_line(error)}") from None
    executor = _Cluster(client, address)
    try:
        yield executor, _workers(distributed, client, address, timeout)
    finally:
        executor.shutdown()
        # One that has died cannot say goodbye.
        with contextlib.suppress(TimeoutError, OSError, distributed.TimeoutError):
            client.close(timeout=timeout)


def call_there(version: str, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """Return what a worker runs."""
    WorkerError.refuse_if(
        version != __version__, _other_version("a dask worker", __version__, version)
    )
    return fn(*args, **kwargs)


async def _knock(distributed: Any, address: str, timeout: float) -> None:
    """Connect to a scheduler, and leave."""
    how = distributed.Security().get_connection_args("client")
    link = await distributed.comm.connect(address, timeout=timeout, **how)
    await link.close()


def _workers(distributed: Any, client: Any, address: str, timeout: float) -> int:
    """Wait for the first worker, judge all that are there, and count their threads."""
    from importlib import metadata

    missing = metadata.PackageNotFoundError
    try:
        client.wait_for_workers(1, timeout=timeout)
        # A function that any worker has, whatever its pinsing.
        versions = client.run(metadata.version, "pinsing", on_error="return")
        count = int(sum(client.nthreads().values()))
    except (TimeoutError, distributed.TimeoutError):  # one class only from Python 3.11 on
        raise WorkerError(f"the dask scheduler at {address} has no workers") from None
    except Exception as error:
        raise WorkerError(f"the dask scheduler at {address} fails: {_first_line(error)}") from None
    installed = any(metadata.distributions(name="pinsing"))  # else there is nothing to compare
    for worker, found in sorted(versions.items()):
        version = "" if isinstance(found, missing) else str(found)
        WorkerError.refuse_if(
            installed and isinstance(found, str | missing) and version != __version__,
            _other_version(f"the dask worker {worker}", version, __version__),
        )
    return count


def _other_version(who: str, found: str, wanted: str) -> str:
    has = f"pinsing {found}" if found else "no pinsing"
    return f"{who} has {has} installed, and this is {wanted}: install the same there"


def _first_line(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return lines[0][:300] if lines else type(error).__name__


class _Cluster(Executor):
    """Calls on a dask cluster.

    ``Client.get_executor`` takes a result for an error if its worker dies right then: it asks for
    the state after the result.
    """

    def __init__(self, client: Any, address: str) -> None:
        self._client, self._address, self._ours = client, address, True

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        if self._client.status not in ("running", "connecting"):
            raise self._gone()
        there = self._client.submit(call_there, __version__, fn, *args, pure=False, **kwargs)
        here: Future[Any] = Future()

        async def follow() -> None:
            result, error = None, None
            try:
                result = await there
            except BaseException as raised:  # whatever it is, who waits has to hear of it
                error = raised
            if not here.set_running_or_notify_cancel():
                return
            if error is None:
                here.set_result(result)
            elif self._ours and (self._client.status != "running" or connection_lost(error)):
                here.set_exception(self._gone())
            else:
                here.set_exception(error)

        here.add_done_callback(lambda done: there.cancel() if done.cancelled() else None)
        self._client.loop.add_callback(follow)
        return here

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """From now on the connection ends because we end it."""
        self._ours = False

    def _gone(self) -> WorkerError:
        return WorkerError(
            f"the dask scheduler at {self._address} has gone, or its network; what is kept in a "
            "folder is safe: run the same again when it is back"
        )
