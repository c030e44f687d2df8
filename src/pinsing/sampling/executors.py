"""Processes of this machine, as an executor that ends well."""

from __future__ import annotations

import contextlib
import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from multiprocessing import resource_tracker
from typing import Any

from pinsing.sampling.threads import how_many

_LOOK_EVERY = 0.5
_TIME_TO_NOTICE = 2.0


@contextlib.contextmanager
def local_processes(workers: int | None = None) -> Iterator[tuple[Executor, int]]:
    """Processes of this machine, as many as there are processors by default.

    They leave Ctrl-C to this process, and end when it does, however that is.

    Raises
    ------
    OptionError
        If there would be none.
    """
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
        """See that a worker that dies is noticed, until the end.

        The executor does so by itself, but where the worker was amid the writing of a result: then
        it waits for the rest for ever, and so does every other worker that has one.
        """
        while not ended.wait(_LOOK_EVERY):
            workers = list((getattr(self, "_processes", None) or {}).values())
            if any(not worker.is_alive() for worker in workers):
                if ended.wait(_TIME_TO_NOTICE):
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
