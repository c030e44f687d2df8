"""Work in chunks: on threads, on any ``concurrent.futures.Executor``, kept in a folder or not.

No scheduler: chunks are handed to the executor a few at a time, and taken as they are done.
"""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from multiprocessing import resource_tracker
from typing import Any, Protocol

from pinsing._batch.engine import cpu_count
from pinsing.errors import OptionError, PinsingError, WorkerError
from pinsing.kinematics.evaluator import Evaluator, evaluator, recorded_engine
from pinsing.robot.arm import Arm
from pinsing.runs.run_folder import Record, RunFolder, open_run, recorded

_PER_WORKER = 2  # chunks handed out at a time: one to work on, one waiting


class Job(Protocol):
    """Work that falls into chunks."""

    @property
    def chunks(self) -> int:
        """How many chunks there are."""

    def identity(self) -> Mapping[str, Any]:
        """What decides the numbers, as plain JSON values."""

    def part(self, index: int) -> Callable[[], Record]:
        """Return what computes one chunk: small, able to be pickled, the same anywhere."""


Chunks = Generator[tuple[int, Record], None, None]
"""Numbers and records of chunks, as they are done."""

Folder = str | os.PathLike[str]


def planned_evaluator(arm: Arm, engine: str, out: Folder | None) -> Evaluator:
    """Fix the engine of a run: that which ``out`` was begun with, if it has been.

    Raises
    ------
    EngineError, OptionError
        As `pinsing.kinematics.evaluator.evaluator`.
    OutputError
        If ``out`` holds a plan that cannot be read.
    """
    return evaluator(arm, recorded_engine(None if out is None else recorded(out), engine))


@contextlib.contextmanager
def running(
    job: Job,
    *,
    out: Folder | None = None,
    threads: int | None = None,
    executor: Executor | None = None,
    parallel: int | None = None,
    tell: Callable[[str], object] | None = None,
) -> Iterator[tuple[Chunks, RunFolder | None]]:
    """Run ``job`` for as long as the block lasts: its chunks as they are done, and its folder.

    Parameters
    ----------
    job : Job
        What to do.
    out : path-like, optional
        Folder that each finished chunk is put in before it is yielded.
    threads : int, optional
        Of this process; as many as it may use by default.
    executor : Executor, optional
        Takes the chunks instead of threads.
    parallel, tell
        As `finished_chunks`.

    Raises
    ------
    OptionError
        If both threads and an executor are given.
    OutputError, WorkerError
        As `pinsing.runs.run_folder.open_run` and `finished_chunks`.
    """
    if executor is not None and threads is not None:
        raise OptionError("give either threads or an executor, not both")
    with contextlib.ExitStack() as stack:
        folder = None
        if out is not None:
            folder = stack.enter_context(open_run(out, job.identity(), job.chunks))
        if executor is None:
            executor, parallel = stack.enter_context(local_threads(threads))
        chunks = finished_chunks(job, executor, folder, parallel, tell)
        yield stack.enter_context(contextlib.closing(chunks)), folder


def finished_chunks(
    job: Job,
    executor: Executor,
    folder: RunFolder | None = None,
    parallel: int | None = None,
    tell: Callable[[str], object] | None = None,
) -> Chunks:
    """Run all chunks of ``job``, in any order; those that ``folder`` has come first, as they are.

    Parameters
    ----------
    job : Job
        What to do.
    executor : Executor
        Where.
    folder : RunFolder, optional
        Each chunk is on the disk before it is yielded; a damaged one is done again.
    parallel : int, optional
        How many chunks the executor works on at once; the number of processors by default.
    tell : callable, optional
        Called with sentences on what the folder had.

    Raises
    ------
    OutputError
        If a chunk cannot be kept.
    WorkerError
        If a worker died, or failed in a way that is no error of pinsing.
    """
    have: set[int] = set()
    if folder is not None:
        kept = folder.kept()
        for index in kept:
            record = folder.load(index)
            if record is not None:
                have.add(index)
                yield index, record
        if tell is not None and kept:
            tell(f"{len(have)} of {job.chunks} chunks were done before")
            damaged = sorted(have.symmetric_difference(kept))
            if damaged:
                tell(f"damaged and done again: chunks {', '.join(map(str, damaged))}")
    pending: dict[Future[Record], int] = {}
    waiting = (index for index in range(job.chunks) if index not in have)
    limit = _PER_WORKER * (cpu_count() if parallel is None else parallel)
    try:
        while True:
            for index in waiting:
                pending[_submit(executor, job, index)] = index
                if len(pending) >= limit:
                    break
            if not pending:
                return
            done, _ = wait(pending, return_when=FIRST_COMPLETED)
            for future in sorted(done, key=pending.__getitem__):
                index = pending.pop(future)
                record = _outcome(future, index)
                if folder is not None:
                    folder.save(index, record)
                yield index, record
    finally:
        for future in pending:
            future.cancel()


def _submit(executor: Executor, job: Job, index: int) -> Future[Record]:
    part = job.part(index)
    # Processes that the executor starts now inherit that Ctrl-C is blocked: it is for this one.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return executor.submit(part)
    except BrokenExecutor as error:
        raise _died(error) from error
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _outcome(future: Future[Record], index: int) -> Record:
    try:
        error = future.exception()
    except CancelledError as cancelled:
        error = cancelled
    if isinstance(error, CancelledError):
        raise WorkerError(f"chunk {index} was cancelled by the executor") from None
    if error is None:
        return future.result()
    if isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker":
        raise _died(error) from error
    if isinstance(error, PinsingError) or not isinstance(error, Exception):
        raise error
    raise WorkerError(
        f"a worker failed at chunk {index}: {type(error).__name__}: {error} "
        "(has it the same pinsing installed?)"
    ) from error


def _died(error: BaseException) -> WorkerError:
    return WorkerError(
        f"a worker process died, killed or out of memory ({error}); what is kept in a folder is "
        "safe: run the same again, with fewer workers or smaller chunks if it was memory"
    )


@contextlib.contextmanager
def local_threads(threads: int | None = None) -> Iterator[tuple[Executor, int]]:
    """Threads of this process, as many as it has processors by default."""
    count = _count(threads, "threads")
    executor = ThreadPoolExecutor(count, thread_name_prefix="pinsing")
    try:
        yield executor, count
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def local_processes(workers: int | None = None) -> Iterator[tuple[Executor, int]]:
    """Processes of this machine, as many as there are processors by default.

    They leave Ctrl-C to this process, and end when it does, however that is.
    """
    count = _count(workers, "workers")
    resource_tracker.ensure_running()  # else the first worker starts it, which unblocks Ctrl-C
    executor = ProcessPoolExecutor(
        count, mp_context=multiprocessing.get_context("spawn"), initializer=_follow_parent
    )
    try:
        yield executor, count
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def dask_cluster(address: str, timeout: float = 10.0) -> Iterator[tuple[Executor, int]]:
    """Workers of a running dask.distributed cluster; a chunk of a lost worker is done elsewhere.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://host:8786``.
    timeout : float
        Seconds to wait for it, and for its first worker.

    Raises
    ------
    WorkerError
        If dask.distributed is not installed, nothing answers, or there are no workers.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise WorkerError(
            "dask.distributed is not installed; pip install 'pinsing[cluster]'"
        ) from None
    try:
        client = distributed.Client(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError, ImportError) as error:
        raise WorkerError(f"no dask scheduler at {address}: {error}") from None
    try:
        try:
            client.wait_for_workers(1, timeout=timeout)
        except (TimeoutError, distributed.TimeoutError):  # one class only from Python 3.11 on
            raise WorkerError(f"the dask scheduler at {address} has no workers") from None
        count = sum(client.nthreads().values())
        yield _Cluster(client), count
    finally:
        client.close()


class _Cluster(Executor):
    """Calls on a dask cluster.

    As ``Client.get_executor``, which however takes a result for an error if the worker that it
    was fetched from dies right then: it asks for the state after the result.
    """

    def __init__(self, client: Any) -> None:
        self._client = client

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        there = self._client.submit(fn, *args, pure=False, **kwargs)
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
            else:
                here.set_exception(error)

        here.add_done_callback(lambda done: there.cancel() if done.cancelled() else None)
        self._client.loop.add_callback(follow)
        return here


def _count(asked: int | None, what: str) -> int:
    if asked is None:
        return cpu_count()
    if asked < 1:
        raise OptionError(f"{what} must be at least 1, got {asked}")
    return int(asked)


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
