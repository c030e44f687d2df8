"""Work in chunks: on threads, on any ``concurrent.futures.Executor``, kept in a folder or not.

No scheduler: chunks are handed to the executor a few at a time, and taken as they are done.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import re
import signal
import stat
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from types import FrameType
from typing import Any

from pinsing._batch.engine import cpu_count
from pinsing.atomic_write import is_temporary, replace_file, sync_folder
from pinsing.chunk_file import DamagedError, Record, pack, read_bounded, unpack
from pinsing.errors import OptionError, OutputError, PinsingError, WorkerError, why
from pinsing.kinematics.jacobian import PINOCCHIO, Batch, fixed_batch
from pinsing.prose import LISTED
from pinsing.robot.arm import Arm

_SCHEMA = "pinsing/run/1"
_PLAN, _CHUNKS, _LOCK = "plan.json", "chunks", "lock"
_CHUNK = re.compile(r"([0-9]{6}|[1-9][0-9]{6,17})\.npz")
_ROBOT = "robot"
_FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


class RunFolder:
    """One run on disk, made by `open_run`.

    ``identity``: plain JSON values that decide the numbers of the run. ``chunks``: how many it has.
    """

    def __init__(self, path: Path, identity: Mapping[str, Any], chunks: int) -> None:
        self.path, self.identity, self.chunks = path, dict(identity), chunks
        self.digest = _identity_digest(self.identity)

    def chunk_path(self, index: int) -> Path:
        """File of one chunk."""
        return self.path / _CHUNKS / f"{index:06d}.npz"

    def save(self, index: int, record: Record) -> None:
        """Put a finished chunk on the disk, all of it or nothing."""
        data = pack(record, self.digest, index)
        if not (self.path / _CHUNKS).exists():  # somebody has tidied up
            make_chunks(self.path)
        self.write_bytes(self.chunk_path(index), data)

    def read(self, index: int, room: int = 256 << 20) -> Record:
        """Return the record of a chunk whose arrays take at most ``room`` bytes."""
        path = self.chunk_path(index)
        try:
            # Arrays that cannot be compressed grow by less than a thousandth.
            data = read_bounded(path, room + room // 512 + (64 << 10))
        except OSError as error:
            if isinstance(error, FileNotFoundError):
                raise
            raise OutputError(f"cannot read {path}: {why(error)}") from None
        return unpack(data, self.digest, index, room)

    def kept(self) -> tuple[int, ...]:
        """Return the numbers of the chunks that have a file, damaged or not."""
        names: list[str] = []
        with contextlib.suppress(FileNotFoundError):
            names = os.listdir(self.path / _CHUNKS)
        numbers = (int(found[1]) for found in map(_CHUNK.fullmatch, names) if found)
        return tuple(sorted(n for n in numbers if n < self.chunks))

    def write_bytes(self, target: Path, data: bytes) -> None:
        """Write a file of the run, such as a chunk or its result, all of it or nothing."""
        try:
            replace_file(target, data)
        except OSError as error:
            done, advice = len(self.kept()), "run the same command again when that is mended"
            if error.errno in _FULL:
                advice = "make room and run the same command again"
            raise OutputError(
                f"cannot write {target}: {why(error)}; the {done} of {self.chunks} chunks on the "
                f"disk are safe: {advice}"
            ) from None


def recorded(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """Identity of the run in folder ``path``; None if there is no run yet."""
    plan = Path(path) / _PLAN
    advice = f"give another folder, or delete {path} to start anew"
    try:
        text = read_bounded(plan, 16 << 20).decode()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except DamagedError as error:
        raise OutputError(f"cannot use {plan}: {error}; {advice}") from None
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot read {plan}: {why(error)}") from None
    with contextlib.suppress(ValueError, KeyError, TypeError, RecursionError):
        data = json.loads(text)
        identity, said = data["identity"], (data["schema"], data["sha256"])
        if isinstance(identity, dict) and said == (_SCHEMA, _identity_digest(identity)):
            return identity
    raise OutputError(f"{plan} is damaged; {advice}")


@contextlib.contextmanager
def open_run(
    path: str | os.PathLike[str], identity: Mapping[str, Any], chunks: int
) -> Iterator[RunFolder]:
    """Start a run in a new or empty folder, or go on with the same one."""
    # The lock keeps other processes out, and ends with this one, however it ends.
    root = Path(path)
    identity = json.loads(json.dumps(identity))  # as it will be read back
    with _locked(root):
        folder = RunFolder(root, identity, chunks)
        known = recorded(root)
        if known not in (None, identity):
            raise OutputError(f"{root} holds another run: {_difference(known, identity)}")
        make_chunks(root)
        if known is None:
            plan = {"schema": _SCHEMA, "identity": folder.identity, "sha256": folder.digest}
            folder.write_bytes(root / _PLAN, (json.dumps(plan, indent=2) + "\n").encode())
        # What killed processes were writing goes; what no chunk can be written over is refused.
        with _reported(f"cannot use {root}"):
            for place in (root, root / _CHUNKS):
                with os.scandir(place) as entries:
                    for entry in list(entries):
                        if is_temporary(entry.name) and entry.is_file(follow_symlinks=False):
                            os.unlink(entry.path)
            for path in map(folder.chunk_path, folder.kept()):
                OutputError.refuse_if(
                    stat.S_ISDIR(os.lstat(path).st_mode),
                    f"cannot use {path}: it is a folder; remove it",
                )
        yield folder


def make_chunks(root: Path) -> None:
    """Make the folder of the chunks if there is none."""
    chunks = root / _CHUNKS
    with _reported(f"cannot make {chunks}"):
        with contextlib.suppress(FileExistsError):
            os.mkdir(chunks)
            sync_folder(root)
        OutputError.refuse_if(
            not stat.S_ISDIR(os.lstat(chunks).st_mode),
            f"cannot use {chunks}: it is no folder; remove it, or give another",
        )


@contextlib.contextmanager
def _reported(what: str) -> Iterator[None]:
    """Say of a failure of the system what could not be done."""
    try:
        yield
    except OutputError:
        raise
    except (OSError, ValueError) as error:
        raise OutputError(f"{what}: {why(error)}") from None


@contextlib.contextmanager
def _locked(root: Path) -> Iterator[None]:
    """Lock a folder, which is made if it is not there."""
    try:
        import fcntl
    except ImportError:
        raise OutputError(
            f"cannot lock {root}: runs in folders need Linux or macOS (on Windows: WSL)"
        ) from None
    with _reported(f"cannot use {root}"):
        if not root.is_dir():
            try:
                os.mkdir(root)
            except FileExistsError:
                kind = "a link to what is not there" if root.is_symlink() else "a file or device"
                raise OutputError(f"cannot use {root}: it is {kind}; give a folder") from None
            except FileNotFoundError:
                raise OutputError(f"cannot make {root}: there is no folder {root.parent}") from None
            sync_folder(root.parent)
        elif not (root / _PLAN).exists() and not all(
            p.name in (_LOCK, _CHUNKS) or is_temporary(p.name) for p in root.iterdir()
        ):  # more than an interrupted start can leave in a folder
            raise OutputError(
                f"{root} is not empty and holds no run of pinsing; give a new or empty folder"
            )
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        handle = os.open(root / _LOCK, flags, 0o666)
    with open(handle, "rb"):
        OutputError.refuse_if(
            not stat.S_ISREG(os.fstat(handle).st_mode),
            f"cannot use {root / _LOCK}: it is no file; remove it",
        )
        with _reported(f"cannot lock {root}"):
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise OutputError(
                    f"another process is at work in {root}; wait for it, or give another folder"
                ) from None
        yield


def _difference(known: Mapping[str, Any], asked: Mapping[str, Any]) -> str:
    names = [n for n in {**known, **asked} if known.get(n) != asked.get(n)]
    if _ROBOT in names:
        return (
            "the robot's geometry, task or length scale has changed; give another folder, or "
            "put the robot back as it was"
        )
    parts = []
    for name in names[:4]:
        there, here = (json.dumps(x.get(name)) for x in (known, asked))
        long = max(len(there), len(here)) > 60
        parts.append(f"{name} differs" if long else f"{name} is {there} there and {here} here")
    return ", ".join(parts) + "; give the same options as then, or another folder"


def _identity_digest(identity: Mapping[str, Any]) -> str:
    text = json.dumps(identity, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


_AT_ONCE = b"\npinsing: ended at once; what is in a folder is kept\n"

_ends_process = False
_outer: Inbox | None = None


class Inbox:
    """Futures as they are done, and if the run is to stop.

    ``asked``: how often Ctrl-C was pressed, once to stop after what has begun, twice without
    waiting. ``heeded``: the run has stopped for it. ``done``: futures that are done, cancelled, or
    have failed; None for anything else.
    """

    def __init__(self) -> None:
        self.asked = 0
        self.heeded = False
        # Its ``put`` may be called from a signal handler, whatever it interrupts.
        self.done: SimpleQueue[Future[Any] | None] = SimpleQueue()

    def stop(self) -> None:
        """Ask the run to stop."""
        self.asked += 1
        self.done.put(None)


@contextlib.contextmanager
def ctrl_c_to(inbox: Inbox) -> Iterator[None]:
    """Have Ctrl-C speak to ``inbox`` as long as the block lasts; the third one raises again.

    Blocks may be nested: an inner inbox is told of what the outer one has heard, and the outer one
    of what came too late to stop the inner run. Nothing changes outside of the main thread, which
    alone hears of Ctrl-C, nor where the program has put it off (``nohup``) or handles it outside of
    Python.
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
    """Put Ctrl-C off to the end of the block, so that its work is kept; runs in it still stop."""
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


Folder = str | os.PathLike[str]

Progress = Callable[[int, int], object]
"""Called with how much is done, and of all, after each chunk."""

Tell = Callable[[str], object]
"""Called with a sentence about what goes on."""


def how_many(asked: int | None, what: str) -> int:
    """A number of workers that was asked for, or that of the processors."""
    if asked is None:
        return cpu_count()
    OptionError.refuse_if(asked < 1, f"{what} must be at least 1, got {asked}")
    return int(asked)


_AGAIN = "what is kept in a folder is safe: run the same again"


class Job(ABC):
    """Work on ``count`` configurations, ``size`` in each chunk."""

    count: int
    size: int

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.count // self.size)

    def span(self, index: int) -> tuple[int, int]:
        """Numbers of what one chunk computes: from, and to before."""
        return index * self.size, min(self.count, (index + 1) * self.size)

    @abstractmethod
    def identity(self) -> Mapping[str, Any]:
        """Return what decides the numbers, as plain JSON values."""

    @abstractmethod
    def part(self, index: int) -> Callable[[], Record]:
        """Return what computes one chunk: small, able to be pickled, the same anywhere."""

    @abstractmethod
    def check(self, index: int, record: Record) -> None:
        """Raise a DamagedError that says why ``record`` cannot be that of a chunk."""

    @abstractmethod
    def room(self, index: int) -> int:
        """Bytes that the arrays of a chunk take at most."""


def planned_batch(arm: Arm, out: Folder | None, engine: str) -> Batch:
    """Fix the engine of a run: that of its folder, unless another is asked for by name."""
    known = None if out is None else recorded(out)
    if known is not None and engine in ("auto", "batch"):
        begun = str(known.get("engine", engine))
        engine = engine if engine == "batch" and begun == PINOCCHIO else begun
    return fixed_batch(arm, engine)


class Run:
    """A job at work, made by `running`: chunks as they are done, kept in ``folder`` if any.

    ``done``: how much of it was reduced, as progress counts it.
    """

    def __init__(
        self,
        job: Job,
        folder: RunFolder | None,
        executor: Executor,
        parallel: int,
        inbox: Inbox,
        progress: Progress | None,
        tell: Tell | None,
    ) -> None:
        self.job, self.folder, self.progress, self.tell = job, folder, progress, tell
        self.executor, self.inbox = executor, inbox
        self.limit = 2 * parallel  # chunks handed out at a time: one to work on, one waiting
        self.done = 0

    def reduce(self, take: Callable[[int, Record], object], before: int = 0) -> bool:
        """Give all chunks to ``take``, with their first numbers; False if Ctrl-C has stopped it."""
        # Progress counts from ``before``.
        try:
            with contextlib.closing(self._chunks()) as chunks:
                for index, record in chunks:
                    start, stop = self.job.span(index)
                    take(start, record)
                    self.done += stop - start
                    if self.progress is not None:
                        self.progress(before + self.done, before + self.job.count)
        except KeyboardInterrupt:
            return False
        return True

    def _chunks(self) -> Generator[tuple[int, Record], None, None]:
        """Yield numbers and records in any order, those of the folder first."""
        # A chunk is on the disk before it is yielded; a damaged one is done again. When the inbox
        # is asked to stop, what has begun is still done, kept and yielded.
        have: set[int] = set()
        for index, record in self._kept():
            have.add(index)
            yield index, record
        pending: dict[Future[Record], int] = {}
        waiting = (index for index in range(self.job.chunks) if index not in have)
        left = self.job.chunks - len(have)
        try:
            while left:
                if not self.inbox.asked:
                    for index in waiting:
                        try:
                            future = self.executor.submit(self.job.part(index))
                        except BrokenExecutor as error:
                            raise _died(error) from error
                        pending[future] = index
                        future.add_done_callback(self.inbox.done.put)
                        if len(pending) >= self.limit:
                            break
                else:
                    for future in [f for f in pending if f.cancel()]:
                        del pending[future]  # no worker has begun it
                    if self.inbox.asked > 1 or not pending:
                        self.inbox.heeded = True
                        raise KeyboardInterrupt
                done = self.inbox.done.get()
                if done is None or done not in pending:
                    continue
                index = pending.pop(done)
                record = _outcome(done, self.job, index)
                if self.folder is not None:
                    self.folder.save(index, record)
                left -= 1
                yield index, record
        finally:
            for future in pending:
                future.cancel()

    def _kept(self) -> Iterator[tuple[int, Record]]:
        """Chunks that the folder has; those that are damaged are told of at the end."""
        if self.folder is None:
            return
        kept, damaged = self.folder.kept(), []
        for index in kept:
            if self.inbox.asked:
                self.inbox.heeded = True
                raise KeyboardInterrupt
            try:
                record = self.folder.read(index, self.job.room(index))
                self.job.check(index, record)
            except FileNotFoundError:
                damaged.append(f"{index} (it has gone)")
            except DamagedError as error:
                damaged.append(f"{index} ({error})")
            else:
                yield index, record
        if self.tell is not None and kept:
            self.tell(f"{len(kept) - len(damaged)} of {self.job.chunks} chunks were done before")
            if damaged:
                more = f" and {len(damaged) - LISTED} more" if len(damaged) > LISTED else ""
                self.tell(f"damaged and done again: chunks {', '.join(damaged[:LISTED])}{more}")


@contextlib.contextmanager
def running(
    job: Job,
    out: Folder | None,
    threads: int | None,
    executor: Executor | None,
    parallel: int | None,
    progress: Progress | None,
    tell: Tell | None,
) -> Iterator[Run]:
    """Run ``job`` for as long as the block lasts; meanwhile Ctrl-C is as of `ctrl_c_to`."""
    OptionError.refuse_if(
        executor is not None and threads is not None,
        "give either threads or an executor, not both",
    )
    inbox = Inbox()
    with contextlib.ExitStack() as stack:
        stack.enter_context(ctrl_c_to(inbox))
        folder = None
        if out is not None:
            folder = stack.enter_context(open_run(out, job.identity(), job.chunks))
        if executor is None:
            parallel = how_many(threads, "threads")
            executor = pool = ThreadPoolExecutor(parallel, thread_name_prefix="pinsing")
            # Pressed twice, nobody waits for what the threads are doing.
            stack.callback(lambda: pool.shutdown(wait=inbox.asked < 2, cancel_futures=True))
        parallel = cpu_count() if parallel is None else parallel
        yield Run(job, folder, executor, parallel, inbox, progress, tell)


def _outcome(future: Future[Record], job: Job, index: int) -> Record:
    """The record of a chunk, judged; WorkerError for what went wrong elsewhere."""
    installed = "(has it the same pinsing installed?)"
    try:
        record = future.result()
    except BaseException as error:
        if _named(error, "CancelledError", "FutureCancelledError"):
            raise WorkerError(f"chunk {index} was cancelled by the executor; {_AGAIN}") from None
        if _named(error, "BrokenExecutor", "KilledWorker") or connection_lost(error):
            raise _died(error) from error
        if isinstance(error, PinsingError) or not isinstance(error, Exception):
            raise
        said = f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
        raise WorkerError(f"a worker failed at chunk {index}: {said} {installed}") from error
    try:
        job.check(index, record)
    except (DamagedError, ValueError, TypeError, AttributeError) as wrong:
        said = f"a worker returned something else for chunk {index}: {wrong}"
        raise WorkerError(f"{said} {installed}") from None
    return record


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
