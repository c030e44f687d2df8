"""Threads of this process, as an executor that ends well."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor

from pinsing._batch.engine import cpu_count
from pinsing.errors import OptionError


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
