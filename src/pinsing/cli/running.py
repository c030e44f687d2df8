"""Long runs on the command line: where they run, how far they are, how they stop, what they do."""

from __future__ import annotations

import contextlib
import functools
import math
import shlex
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from pinsing.cli import completion
from pinsing.cli.output import say
from pinsing.errors import OptionError
from pinsing.prose import Page, is_terminal

if TYPE_CHECKING:
    from concurrent.futures import Executor


F = TypeVar("F", bound=Callable[..., Any])

WORDS = "pinsing.words"
"""Where a context has the words of the command line."""

_BAR = 30  # columns
_REDRAW_SECONDS = 0.1
_QUIET_SECONDS = 30.0  # between two lines where there is no terminal to draw on


@dataclass(frozen=True)
class RunPlace:
    """Where a run takes place."""

    engine: str  # as of `sigma_map`
    threads: int | None  # of this process
    workers: int | None  # processes of this machine
    dask: str | None  # address of a scheduler

    @contextlib.contextmanager
    def options(self) -> Iterator[dict[str, Any]]:
        """Keyword arguments of a run; the executor ends with the block."""
        from pinsing.sampling.execute import second_ctrl_c_ends_process

        chosen: dict[str, Any] = {"engine": self.engine}
        with contextlib.ExitStack() as stack:
            stack.enter_context(second_ctrl_c_ends_process())
            if (pool := self._pool(stack)) is None:
                chosen["threads"] = self.threads
            else:
                chosen["executor"], chosen["parallel"] = pool
            yield chosen

    def _pool(self, stack: contextlib.ExitStack) -> tuple[Executor, int] | None:
        if self.dask is not None:
            from pinsing.sampling.executors import dask_cluster

            stack.enter_context(_only_our_lines())
            executor, count = stack.enter_context(dask_cluster(self.dask))
            say(f"{count} dask worker threads at {self.dask}")
            return executor, count
        if self.workers is not None:
            from pinsing.sampling.executors import local_processes

            return stack.enter_context(local_processes(self.workers))
        return None


def place_options(command: F) -> F:
    """Add ``--engine``, ``--threads``, ``--workers``, ``--dask``; passed as ``place``."""

    @click.option(
        "--engine",
        default="auto",
        show_default=True,
        metavar="NAME",
        shell_complete=completion.choices(
            "auto", "batch", "pinocchio", "baseline", "avx2", "avx512"
        ),
        help="auto, batch, pinocchio, or an instruction set: baseline, avx2, avx512.",
    )
    @click.option(
        "--threads",
        type=click.IntRange(min=1),
        metavar="N",
        help="Threads.  [default: all processors]",
    )
    @click.option(
        "--workers",
        type=click.IntRange(min=1),
        metavar="N",
        help="Worker processes instead of threads.",
    )
    @click.option(
        "--dask", metavar="ADDRESS", help="Run on a dask.distributed cluster: tcp://HOST:PORT."
    )
    @functools.wraps(command)
    def wrapper(
        *args: Any,
        engine: str,
        threads: int | None,
        workers: int | None,
        dask: str | None,
        **rest: Any,
    ) -> Any:
        given = [n for n, v in (("threads", threads), ("workers", workers), ("dask", dask)) if v]
        if len(given) > 1:
            raise OptionError(f"--{given[0]} and --{given[1]} exclude each other")
        return command(*args, place=RunPlace(engine, threads, workers, dask), **rest)

    return wrapper  # type: ignore[return-value]


class Meter:
    """Rate and remaining time of a run, from what was done since it began to count."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._began: tuple[float, int] | None = None

    def text(self, done: int, total: int) -> str:
        """Such as ``12.5 M of 100 M, 4.21 M/s, 21 s left``."""
        now = self._clock()
        if self._began is None:  # what a folder had already tells nothing about the rate
            self._began = now, done
        since, before = self._began
        parts = [f"{short(done)} of {short(total)}"]
        if done > before and now > since:
            rate = (done - before) / (now - since)
            parts += [f"{short(rate)}/s", f"{duration((total - done) / rate)} left"]
        return ", ".join(parts)


def short(number: float) -> str:
    """Three digits and k, M, G or T."""
    for unit, size in (("T", 1e12), ("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if number >= size:
            return f"{number / size:.3g} {unit}"
    return f"{number:.3g}"


def duration(seconds: float) -> str:
    """``45 s``, ``3 min 20 s``, ``5 h 10 min``, ``2 d 4 h``."""
    s = round(seconds)
    for size, unit, less, lesser in (
        (86400, "d", 3600, "h"),
        (3600, "h", 60, "min"),
        (60, "min", 1, "s"),
    ):
        if s >= size:
            return f"{s // size} {unit} {s % size // less} {lesser}"
    return f"{s} s"


@contextlib.contextmanager
def run_progress() -> Iterator[Callable[[int, int], None]]:
    """Callback ``(done, total)``: a bar on a terminal, else a line on stderr now and then."""
    meter, draws = Meter(), is_terminal(sys.stderr)
    told = -math.inf if draws else time.monotonic()

    def show(done: int, total: int) -> None:
        nonlocal told
        text, now = meter.text(done, total), time.monotonic()
        if draws and (now - told >= _REDRAW_SECONDS or done >= total):
            told = now
            redraw(_bar(min(done / total, 1.0) if total else 1.0, text))
        elif not draws and now - told >= _QUIET_SECONDS:
            told = now
            say(text)

    try:
        yield show
    finally:
        if draws and told > -math.inf:
            redraw("")


def _bar(share: float, text: str) -> str:
    full, width = round(_BAR * share), Page.of(sys.stderr).width - 1
    line = f"{'━' * full}{'─' * (_BAR - full)} {100 * share:3.0f} %  {text}"
    while len(line) > width and ", " in line:  # no half of a number at the edge
        line = line.rpartition(", ")[0]
    return line[:width]


def redraw(line: str) -> None:
    """Write a line of a terminal over again."""
    sys.stderr.write(f"\r\x1b[K{line}")
    sys.stderr.flush()


@contextlib.contextmanager
def _only_our_lines() -> Iterator[None]:
    """Keep a library's log and warnings from the terminal: what matters we say ourselves."""
    import logging  # for commands that run long

    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def say_stopped(out: Path | None) -> None:
    """Tell how to resume after Ctrl-C."""
    if out is None:
        say("stopped; a run with -o FOLDER can be resumed")
        return
    context = click.get_current_context(silent=True)
    words = [] if context is None else context.find_root().meta.get(WORDS, [])
    same = f" ({shlex.join(words)})" if words else ""
    say(f"stopped; what is done is in {out}: run the same command to resume{same}")


_AFTER = 1.0  # seconds that pass in silence
_AGAIN = 0.25


@contextlib.contextmanager
def waiting(after: float = _AFTER) -> Iterator[Callable[..., None]]:
    """Yield a callback that takes the step a command is at, as ``reading meshes``, and progress."""
    # A step over ``after`` seconds shows: on a terminal as one line with the seconds so far, drawn
    # over again and gone at the end; elsewhere as one line on stderr.
    line = _Line(after)
    line.thread.start()
    try:
        yield line.step
    finally:
        line.ended.set()
        line.thread.join()
        line.clear()


@contextlib.contextmanager
def doing(text: str) -> Iterator[None]:
    """Show on a terminal what is being done, as `waiting` does; elsewhere nothing."""
    with waiting() as step:
        if is_terminal(sys.stderr):
            step(text)
        yield


class _Line:
    def __init__(self, after: float) -> None:
        self._after, self._drawn = after, False
        self._step = self._text = self._far = ""
        self._began = time.monotonic()
        self._redraws = is_terminal(sys.stderr)
        self._lock, self.ended = threading.Lock(), threading.Event()
        self.thread = threading.Thread(target=self._run, name="pinsing progress", daemon=True)

    def step(self, text: str, far: str = "") -> None:
        """The command is at a new step, or farther in the one it was at; an empty text is none."""
        with self._lock:
            if text != self._step:
                self.clear()
                self._step = self._text = text
                self._began = time.monotonic()
            self._far = far

    def _run(self) -> None:
        while not self.ended.wait(min(_AGAIN, self._after)):
            with self._lock:
                taken = time.monotonic() - self._began
                if not self._text or taken < self._after:
                    continue
                if self._redraws:
                    text = f"pinsing: {self._text} \u2026 {taken:.0f} s {self._far}".rstrip()
                    redraw(text[: Page.of(sys.stderr).width - 1])
                    self._drawn = True
                else:
                    say(f"{self._text} \u2026")
                    self._text = ""  # once is enough

    def clear(self) -> None:
        if self._drawn:
            redraw("")
            self._drawn = False
