"""Work in chunks: on threads, on any ``concurrent.futures.Executor``, kept in a folder or not.

No scheduler: chunks are handed to the executor a few at a time, and taken as they are done.
"""

from __future__ import annotations

import contextlib
import functools
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass
from queue import SimpleQueue
from types import FrameType
from typing import Any, Protocol, TypeVar

from pinsing._batch.engine import cpu_count
from pinsing.chunk_file import DamagedError, Record
from pinsing.errors import OptionError, PinsingError, WorkerError
from pinsing.kinematics.verdict import Evaluator, evaluator, recorded_engine
from pinsing.robot.arm import Arm
from pinsing.sampling.run_folder import RunFolder, open_run, recorded

_AT_ONCE = b"\npinsing: ended at once; what is in a folder is kept\n"

_ends_process = False
_outer: Inbox | None = None


class Inbox:
    """Futures as they are done, and whether the run is to stop.

    Attributes
    ----------
    asked : int
        How often Ctrl-C was pressed: once, to stop when what has begun is done and kept; twice,
        without waiting for it.
    heeded : bool
        Whether the run has stopped for that; one that was about to end has not.
    """

    def __init__(self) -> None:
        self.asked = 0
        self.heeded = False
        # Its ``put`` may be called from a signal handler, whatever it interrupts.
        self._queue: SimpleQueue[Future[Any] | None] = SimpleQueue()

    def follow(self, future: Future[Any]) -> None:
        """Have ``next`` return ``future`` when it is done, cancelled, or has failed."""
        future.add_done_callback(self._queue.put)

    def next(self) -> Future[Any] | None:
        """Wait for a future that is done, or None: something else has happened."""
        return self._queue.get()

    def stop(self) -> None:
        """Ask the run to stop."""
        self.asked += 1
        self._queue.put(None)


@contextlib.contextmanager
def ctrl_c_to(inbox: Inbox) -> Iterator[None]:
    """Have Ctrl-C speak to ``inbox`` as long as the block lasts; the third one raises again.

    Blocks may be nested: an inner inbox is told of what the outer one has heard, and the outer one
    of what came too late to stop the inner run. Nothing is changed outside of the main thread,
    which alone hears of Ctrl-C, nor where the program has put it off (as ``nohup`` does) or
    handles it outside of Python.
    """
    global _outer
    before, outer = signal.getsignal(signal.SIGINT), _outer
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return

    def heard(number: int, frame: FrameType | None) -> None:
        inbox.stop()
        if inbox.asked >= 2 and _ends_process:
            with contextlib.suppress(OSError):
                os.write(2, _AT_ONCE)
            os._exit(130)
        if inbox.asked >= 3:
            before(number, frame)

    signal.signal(signal.SIGINT, heard)
    _outer = inbox
    try:
        # Only now, when nothing can be heard by the outer one alone.
        for _ in range(0 if outer is None else outer.asked):
            inbox.stop()
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        _outer = outer
        if outer is not None and inbox.asked and not (inbox.heeded or outer.asked):
            outer.stop()


@contextlib.contextmanager
def ctrl_c_afterwards() -> Iterator[None]:
    """Put Ctrl-C off to the end of the block: what is computed and written there is kept.

    A run within the block stops for it as ever.

    Raises
    ------
    KeyboardInterrupt
        At the end, if Ctrl-C was pressed and no run has stopped for it.
    """
    inbox = Inbox()
    with ctrl_c_to(inbox):
        yield
    if inbox.asked:
        raise KeyboardInterrupt


@contextlib.contextmanager
def second_ctrl_c_ends_process() -> Iterator[None]:
    """For programs of their own: a second Ctrl-C waits for nothing, not even for threads."""
    global _ends_process
    _ends_process, before = True, _ends_process
    try:
        yield
    finally:
        _ends_process = before


T = TypeVar("T")


class Stages:
    """Runs stages until the time is up, or Ctrl-C; what is missing then is listed.

    Parameters
    ----------
    seconds : float or None
        Time from now on; None: as long as it takes.
    """

    def __init__(self, seconds: float | None) -> None:
        self.seconds = math.inf if seconds is None else seconds
        self.until = time.monotonic() + self.seconds
        self.missing: list[str] = []
        self.interrupted = False

    @property
    def over(self) -> bool:
        """Whether nothing more should be begun."""
        return self.interrupted or time.monotonic() > self.until

    @property
    def why(self) -> str:
        """What ended it."""
        return "stopped" if self.interrupted else f"the time of {self.seconds:g} s was up"

    def run(self, name: str, stage: Callable[[], T], otherwise: T, whole: bool = False) -> T:
        """The result of a stage; ``otherwise``, and a line for what is missing, without it.

        A ``whole`` stage looks at no clock: its result has all of it, however late.
        """
        if self.over:
            self.missing.append(f"{name}: not begun, {self.why}")
            return otherwise
        try:
            result = stage()
        except KeyboardInterrupt:
            self.interrupted = True
            self.missing.append(f"{name}: stopped before its end")
            return otherwise
        if self.over and not whole:
            self.missing.append(f"{name}: perhaps not all of it, {self.why}")
        return result

    def watched(self, progress: Callable[[int, int], None] | None) -> Callable[[int, int], None]:
        """A callback for a sweep that ends it, as Ctrl-C would, when the time is up."""

        def tell(done: int, count: int) -> None:
            if progress is not None:
                progress(done, count)
            if time.monotonic() > self.until and done < count:
                raise KeyboardInterrupt

        return tell


Folder = str | os.PathLike[str]

Progress = Callable[[int, int], object]
"""Called with how much is done, and of all, after each chunk."""

Tell = Callable[[str], object]
"""Called with a sentence about what goes on."""


@dataclass(frozen=True, eq=False)
class RunOptions:
    """What decides no number of a run, but for the instruction set.

    Attributes
    ----------
    out : path-like or None
        Folder that each finished chunk is put in; a run that was stopped, or killed, can be
        resumed from it.
    engine : str
        ``auto``, ``batch``, ``pinocchio``, or an instruction set (``baseline``, ``avx2``,
        ``avx512``). A run that is resumed keeps the one it began with.
    threads : int or None
        As many as the process may use by default.
    executor : Executor or None
        Takes the chunks instead of threads: any ``concurrent.futures.Executor``.
    parallel : int or None
        How many chunks it works on at once; the number of processors here by default.
    progress : callable or None
        Called with how much is done, and of all.
    tell : callable or None
        Called with sentences for people: how much was there already, what was damaged.
    """

    out: Folder | None = None
    engine: str = "auto"
    threads: int | None = None
    executor: Executor | None = None
    parallel: int | None = None
    progress: Progress | None = None
    tell: Tell | None = None


@contextlib.contextmanager
def local_threads(
    threads: int | None = None, patient: Callable[[], bool] = lambda: True
) -> Iterator[tuple[Executor, int]]:
    """Threads of this process, as many as it has processors by default.

    Parameters
    ----------
    patient : callable
        Asked at the end, whether to wait for what the threads are doing.

    Raises
    ------
    OptionError
        If there would be none.
    """
    count = how_many(threads, "threads")
    executor = ThreadPoolExecutor(count, thread_name_prefix="pinsing")
    try:
        yield executor, count
    finally:
        executor.shutdown(wait=patient(), cancel_futures=True)


def how_many(asked: int | None, what: str) -> int:
    """A number of workers that was asked for, or that of the processors.

    Raises
    ------
    OptionError
        If it is below 1.
    """
    if asked is None:
        return cpu_count()
    if asked < 1:
        raise OptionError(f"{what} must be at least 1, got {asked}")
    return int(asked)


_NAMED = 8  # damaged chunks that are named
_AGAIN = "what is kept in a folder is safe: run the same again"


class Job(Protocol):
    """Work that falls into chunks."""

    @property
    def chunks(self) -> int:
        """How many chunks there are."""

    def identity(self) -> Mapping[str, Any]:
        """What decides the numbers, as plain JSON values."""

    def span(self, index: int) -> tuple[int, int]:
        """Numbers of what one chunk computes: from, and to before."""

    def part(self, index: int) -> Callable[[], Record]:
        """Return what computes one chunk: small, able to be pickled, the same anywhere."""

    def check(self, index: int, record: Record) -> None:
        """Raise a ValueError that says why ``record`` cannot be that of a chunk."""

    def room(self, index: int) -> int:
        """Bytes that the arrays of a chunk take at most."""


Chunks = Generator[tuple[int, Record], None, None]
"""Numbers and records of chunks, as they are done."""


def planned_evaluator(arm: Arm, options: RunOptions) -> Evaluator:
    """Fix the engine of a run: that which its folder was begun with, if it has been.

    Raises
    ------
    EngineError, OptionError
        As `pinsing.kinematics.verdict.evaluator`.
    OutputError
        If ``options.out`` holds a plan that cannot be read.
    """
    known = None if options.out is None else recorded(options.out)
    return evaluator(arm, recorded_engine(known, options.engine))


class Run:
    """A job at work: its chunks as they are done, and its folder."""

    def __init__(
        self, job: Job, chunks: Chunks, folder: RunFolder | None, progress: Progress | None
    ) -> None:
        self.job, self.chunks, self.folder, self.progress = job, chunks, folder, progress
        self.done = 0

    def reduce(self, parts: Sequence[Callable[[Record], object]], before: int, count: int) -> bool:
        """Give all chunks to each of ``parts``; False if Ctrl-C has stopped that.

        ``before`` and ``count`` are what progress counts: from, and to.
        """
        try:
            for index, record in self.chunks:
                for part in parts:
                    part(record)
                start, stop = self.job.span(index)
                self.done += stop - start
                if self.progress is not None:
                    self.progress(before + self.done, count)
        except KeyboardInterrupt:
            return False
        return True


@contextlib.contextmanager
def running(job: Job, options: RunOptions) -> Iterator[Run]:
    """Run ``job`` for as long as the block lasts.

    So long Ctrl-C raises nothing by itself: see `pinsing.sampling.execute`.

    Raises
    ------
    OptionError
        If both threads and an executor are given.
    OutputError, WorkerError
        As `pinsing.sampling.run_folder.open_run` and `finished_chunks`.
    """
    executor, parallel = options.executor, options.parallel
    if executor is not None and options.threads is not None:
        raise OptionError("give either threads or an executor, not both")
    inbox = Inbox()
    with contextlib.ExitStack() as stack:
        stack.enter_context(ctrl_c_to(inbox))
        folder = None
        if options.out is not None:
            folder = stack.enter_context(open_run(options.out, job.identity(), job.chunks))
        if executor is None:
            pool = local_threads(options.threads, patient=lambda: inbox.asked < 2)
            executor, parallel = stack.enter_context(pool)
        chunks = finished_chunks(job, executor, folder, parallel, options.tell, inbox)
        yield Run(job, stack.enter_context(contextlib.closing(chunks)), folder, options.progress)


def finished_chunks(
    job: Job,
    executor: Executor,
    folder: RunFolder | None = None,
    parallel: int | None = None,
    tell: Callable[[str], object] | None = None,
    inbox: Inbox | None = None,
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
    inbox : Inbox, optional
        When it is asked to stop, what has begun is still done, kept and yielded.

    Raises
    ------
    KeyboardInterrupt
        If the inbox was asked to stop, and some chunks are not done.
    OutputError
        If a chunk cannot be kept.
    WorkerError
        If a worker died, or failed in a way that is no error of pinsing.
    """
    inbox = Inbox() if inbox is None else inbox
    have: set[int] = set()
    if folder is not None:
        for index, record in _kept(job, folder, inbox, tell):
            have.add(index)
            yield index, record
    pending: dict[Future[Record], int] = {}
    waiting = (index for index in range(job.chunks) if index not in have)
    # chunks handed out at a time: one to work on, one waiting
    limit = 2 * (cpu_count() if parallel is None else parallel)
    left = job.chunks - len(have)
    try:
        while left:
            if not inbox.asked:
                for index in waiting:
                    try:
                        future = executor.submit(job.part(index))
                    except BrokenExecutor as error:
                        raise _died(error) from error
                    pending[future] = index
                    inbox.follow(future)
                    if len(pending) >= limit:
                        break
            elif inbox.asked > 1 or not _begun(pending):
                inbox.heeded = True
                raise KeyboardInterrupt
            done = inbox.next()
            if done is None or done not in pending:
                continue
            index = pending.pop(done)
            record = _outcome(done, job, index)
            if folder is not None:
                folder.save(index, record)
            left -= 1
            yield index, record
    finally:
        for future in pending:
            future.cancel()


def _kept(
    job: Job, folder: RunFolder, inbox: Inbox, tell: Callable[[str], object] | None
) -> Iterator[tuple[int, Record]]:
    """Chunks that the folder has; those that are damaged are told of at the end."""
    damaged = []
    kept = folder.kept()
    for index in kept:
        if inbox.asked:
            inbox.heeded = True
            raise KeyboardInterrupt
        try:
            record = folder.read(index, functools.partial(job.check, index), job.room(index))
        except FileNotFoundError:
            damaged.append(f"{index} (it has gone)")
        except DamagedError as error:
            damaged.append(f"{index} ({error})")
        else:
            yield index, record
    if tell is not None and kept:
        tell(f"{len(kept) - len(damaged)} of {job.chunks} chunks were done before")
        if damaged:
            more = f" and {len(damaged) - _NAMED} more" if len(damaged) > _NAMED else ""
            tell(f"damaged and done again: chunks {', '.join(damaged[:_NAMED])}{more}")


def _begun(pending: dict[Future[Record], int]) -> bool:
    """Give back what no worker has begun; whether there is something that one has."""
    for future in [f for f in pending if f.cancel()]:
        del pending[future]
    return bool(pending)


def _outcome(future: Future[Record], job: Job, index: int) -> Record:
    try:
        error = future.exception()
    except CancelledError as cancelled:
        error = cancelled
    if isinstance(error, CancelledError) or type(error).__name__ == "FutureCancelledError":
        raise WorkerError(f"chunk {index} was cancelled by the executor; {_AGAIN}") from None
    if error is None:
        record = future.result()
        try:
            job.check(index, record)
        except (ValueError, TypeError, AttributeError) as wrong:
            raise WorkerError(
                f"a worker returned something else for chunk {index}: {wrong} "
                "(has it the same pinsing installed?)"
            ) from None
        return record
    if isinstance(error, BrokenExecutor) or _named(error, "KilledWorker") or connection_lost(error):
        raise _died(error) from error
    if isinstance(error, PinsingError) or not isinstance(error, Exception):
        raise error
    said = " ".join(str(error).split())[:300]
    raise WorkerError(
        f"a worker failed at chunk {index}: {type(error).__name__}: {said} "
        "(has it the same pinsing installed?)"
    ) from error


def _died(error: BaseException) -> WorkerError:
    said = " ".join(str(error).split())[:300]
    return WorkerError(
        f"a worker process died, killed or out of memory ({said}); what is kept in a folder is "
        "safe: run the same again, with fewer workers or smaller chunks if it was memory"
    )


def connection_lost(error: BaseException) -> bool:
    """Return True if a call on a cluster has failed with the way to its worker."""
    return _named(error, "CommClosedError", "ClosedClientError")


def _named(error: BaseException, *names: str) -> bool:
    """Return True if an error is of a class of that name, whose library need not be imported."""
    return any(kind.__name__ in names for kind in type(error).__mro__)
