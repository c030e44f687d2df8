"""Where things go: results to stdout, a file or a browser, all else to stderr; and long runs.

Of a run: how far it is, how it stops, what it does.
"""

from __future__ import annotations

import contextlib
import errno
import gc
import io
import json
import math
import os
import re
import select
import shlex
import signal
import stat
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click
from click.core import ParameterSource

from pinsing.atomic_write import write_bytes, write_text
from pinsing.cli import STOPPED
from pinsing.errors import (
    ConfigurationError,
    OptionError,
    OutputError,
    ResultError,
    shown_path,
    why,
)
from pinsing.prose import Page, is_terminal, safe, shows_colour, visible

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from typing_extensions import Buffer

    from pinsing.interface import JsonResult
    from pinsing.view.server import Server
    from pinsing.view.tab import Tab

STDOUT = "-"
_NOT_ASCII = re.compile(r"[^\x00-\x7e]")
_DEGREES = re.compile(r"(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?)°")
_CELL = re.compile(r"([^\n]*?°[^\n]*?)(  +|$)", re.MULTILINE)  # and the room to the next column


def in_radians() -> bool:
    """Return True if ``--rad`` was typed: answers are in radians then, otherwise in degrees."""
    context = click.get_current_context(silent=True)  # none where Python calls
    if context is None or context.params.get("deg") is not False:
        return False
    return context.get_parameter_source("deg") is ParameterSource.COMMANDLINE


def _in_unit(text: str) -> str:
    """What is kept in degrees, as families' conditions are, in radians where they are asked for."""
    if "°" not in text or not in_radians():
        return text
    from pinsing.interface import number_text

    def number(found: re.Match[str]) -> str:
        new = number_text(math.radians(float(found[1])), False, False, 4)
        return new if new == "0" or "pi" in new else f"{new} rad"

    def cell(found: re.Match[str]) -> str:
        new = _DEGREES.sub(number, found[1])
        return new.ljust(len(found[0]) - 2) + "  " if found[2] else new

    return _CELL.sub(cell, text)


def emit(text: str) -> None:
    """Print a result; what it was painted with goes to terminals alone."""
    print(safe(_in_unit(text), painted=shows_colour(sys.stdout)))


def emit_lines(text: str) -> None:
    """Print a result that is finished text, wrapped to the width of the terminal."""
    emit(Page.of().fitted(_in_unit(text)))


def say(text: str) -> None:
    """Print a message that is no result."""
    _tell(f"pinsing: {visible(_in_unit(text))}")


def complain(text: str) -> None:
    """Print an error, in one line whatever a parser had to say."""
    _tell(f"pinsing: error: {' '.join(text.split())}")


def _tell(text: str) -> None:
    """One line on stderr; on a terminal as many as it takes, broken between words."""
    if is_terminal(sys.stderr):
        click.echo(Page.of(sys.stderr).paragraph(text, rest="  "), err=True)
    else:
        click.echo(safe(text), err=True)


def emit_json(result: JsonResult, target: str | Path | None) -> bool:
    """Write JSON where it was asked for; tell whether stdout is taken by it."""
    return target is not None and emit_json_data(result.to_dict(), target)


def emit_json_data(data: Mapping[str, Any], target: str | Path | None) -> bool:
    """Write plain data as JSON; as `emit_json`."""
    if target is None:
        return False
    text = json.dumps(data, indent=2, allow_nan=False, ensure_ascii=False)
    # Marks that turn or hide text have no place in a terminal; JSON has another way to write them.
    text = _NOT_ASCII.sub(lambda c: c[0] if c[0].isprintable() else json.dumps(c[0])[1:-1], text)
    put(text + "\n", target)
    return target == STDOUT


def put(text: str, target: str | Path) -> None:
    """Write text to a file, and say so, or to stdout."""
    if target == STDOUT:
        click.echo(text, nl=False)
    else:
        write_text(target, text)
        say(f"wrote {target}")


READER_GONE = 141
"""Exit code when the reader of a pipe has gone, as shells have it (128 + SIGPIPE)."""


class StdoutError(OutputError):
    """Standard output that is closed, full, or a pipe that nobody reads any more.

    ``reader_gone``: the latter, as after ``| head``, which is no failure to report.
    """

    def __init__(self, error: OSError) -> None:
        self.reader_gone = error.errno == errno.EPIPE
        said = "it is closed" if error.errno == errno.EBADF else why(error)
        super().__init__(f"cannot write to standard output: {said}")


def guard_streams() -> None:
    """Take over the streams of this process; not where something else stands in for them."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # The next file that is opened would get the number, and all that is printed. Of
            # standard output it is noticed that nothing can be written there.
            null = os.open(os.devnull, os.O_WRONLY if number == 2 else os.O_RDONLY)
            if null != number:
                os.dup2(null, number)
                os.close(null)
    if sys.stdout is sys.__stdout__:
        sys.stdout = _stream(_Stdout(1, "wb", closefd=False))
    if sys.stderr is sys.__stderr__:
        sys.stderr = _stream(_Stderr(2, "wb", closefd=False), always=True)


@contextlib.contextmanager
def followed(file: Path) -> Iterator[tuple[Iterator[str], bool]]:
    """Open a stream of lines, - for standard input; with it, if it is one that goes on."""
    from pinsing.proximity.monitor import lines_of

    typed = str(file) == "-"
    try:
        with io.FileIO(0 if typed else str(file), closefd=not typed) as stream:
            yield lines_of(stream), not stat.S_ISREG(os.fstat(stream.fileno()).st_mode)
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise ConfigurationError(f"cannot read {file}: {error.strerror or error}") from None


def give_up_stdout() -> None:
    """Lose what is still to be written, and all that will be."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.close(null)
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()


def _stream(raw: io.FileIO, always: bool = False) -> io.TextIOWrapper:
    # A name that the terminal cannot show is no reason to fail.
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=getattr(sys.__stdout__ or sys.__stderr__, "encoding", "utf-8"),
        errors="backslashreplace",
        line_buffering=always or raw.isatty(),
    )


class _Stdout(io.FileIO):
    def write(self, data: Buffer, /) -> int:
        while True:
            try:
                written = super().write(data)
            except OSError as error:
                raise StdoutError(error) from None
            if written is not None:
                return written
            select.select([], [self.fileno()], [])  # set not to wait by someone who shares it


class _Stderr(io.FileIO):
    def write(self, data: Buffer, /) -> int:
        with contextlib.suppress(OSError):
            super().write(data)
        return len(memoryview(data))


def off_screen() -> None:
    """Have figures drawn into files only, whatever windows the environment asks for."""
    os.environ["MPLBACKEND"] = "agg"  # it is read, and may be refused, when matplotlib comes in
    _leave_out_what_is_no_file()
    import logging  # here, as it comes with matplotlib

    # Where it keeps its fonts is of no interest to who wants a figure.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    import matplotlib

    matplotlib.use("agg")


def _leave_out_what_is_no_file() -> None:
    """Have matplotlib read no settings out of a device or pipe, which may have no end."""
    if not (named := os.environ.get("MATPLOTLIBRC")):
        return
    for path in (named, os.path.join(named, "matplotlibrc")):
        if os.path.exists(path) and not os.path.isdir(path):
            if not os.path.isfile(path):
                del os.environ["MATPLOTLIBRC"]
                say(f"note: MATPLOTLIBRC is ignored: {shown_path(path)} is no file")
            return


def save_figure(figure: Figure, out: Path, **options: Any) -> None:
    """Write a figure and close it, written or not; the same one gives the same bytes."""
    import matplotlib
    from matplotlib import pyplot as plt

    # No date, and numbered marks.
    metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(out.suffix.lower())
    picture = io.BytesIO()
    with (
        matplotlib.rc_context({"svg.hashsalt": "pinsing"}),
        warnings.catch_warnings(record=True) as heard,
    ):
        warnings.simplefilter("always")
        try:
            figure.savefig(picture, format=out.suffix[1:].lower(), metadata=metadata, **options)
        finally:
            plt.close(figure)
    write_bytes(out, picture.getvalue())
    # A robot may have a name in any script; matplotlib complains of each letter.
    missing = [w for w in heard if "missing from" in str(w.message)]
    for other in heard:
        if other not in missing:
            warnings.warn_explicit(other.message, other.category, other.filename, other.lineno)
    if missing:
        say("note: letters of a name that the figure's font lacks are drawn as boxes")
    say(f"wrote {out}")


@contextlib.contextmanager
def served_ahead(name: str, host: str, port: int | None, no_open: bool) -> Iterator[Server]:
    """Serve a page whose content follows: the browser starts meanwhile."""
    # Warns first where others can reach the page. Ctrl-C ends it, and what it is served to, with 0.
    import webbrowser  # with subprocess and shutil: for commands that open one

    from pinsing.view.server import Server, is_loopback

    if not is_loopback(host):
        say(
            f"warning: listening on {host}: other computers can reach the page. Whoever knows "
            "the address below can see the robot and control the page; nothing is encrypted, so "
            "whoever listens on the network learns the address"
        )
    server = Server(name, host=host, port=port)
    given, before = False, signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        click.echo(server.url)
        sys.stdout.flush()
        # Without a desktop Python would start a text browser in this very terminal.
        asked = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        desktop = asked or not sys.platform.startswith("linux")
        if not no_open and not (desktop and webbrowser.open(server.url, new=2)):
            say("no browser could be opened; open the address above in one")
        given = True
        yield server
    except KeyboardInterrupt:
        say("ended")
        if not given:  # there is no body yet that could be left
            raise click.exceptions.Exit(0) from None
        gc.freeze()  # nothing is to be collected any more: that took a third of a second
    finally:
        signal.signal(signal.SIGTERM, before)
        server.close()


def show_page(
    name: str,
    make: Callable[[Callable[[str], None]], Tab],
    live: bool,
    *,
    late: bool = True,
    html: Path | None = None,
    png: Path | None = None,
    size: tuple[int, int] = (1200, 900),
    panel: bool = False,
    host: str = "127.0.0.1",
    port: int | None = None,
    no_open: bool = False,
    lead: Callable[[Any], None] | None = None,
) -> None:
    """Write the page that ``make`` gives, a picture of it, and serve it if ``live``.

    ``make`` is given what shows the step it is at. The browser opens before unless ``late``; what
    can be refused is judged by then. ``lead`` is called with the page that is served.
    """
    with contextlib.ExitStack() as stack:
        page = served_ahead(name, host, port, no_open)
        server = stack.enter_context(page) if live and not late else None
        with waiting() as at:
            tab = stack.enter_context(make(at))
            at("")
            for note in tab.notes:
                say(f"note: {note}")
            if html is not None:
                at("writing the page")
                tab.save_html(html)
                at("")
                say(f"wrote {html}")
            if png is not None:
                at("taking the picture in Chromium")
                tab.save_png(png, size, panel)
                at("")
                say(f"wrote {png}")
        if live:
            from pinsing.view.tab import hand_over

            hand_over(tab, server or stack.enter_context(page))
            say("press Ctrl-C to end")
            if lead is not None:
                lead(tab)
            while True:
                time.sleep(3600)


def picture_size(text: str, option: str, degrees: bool | None = None) -> tuple[int, int]:
    """Return width and height of ``1200x900``; OptionError for other text."""
    width, cross, height = text.lower().partition("x")
    OptionError.refuse_if(
        not (cross and width.isdigit() and height.isdigit()),
        f"{option} {text!r} is not of the form 1200x900",
    )
    return int(width), int(height)


def read_result(path: Path, *kinds: type[JsonResult]) -> Any:
    """Return the result in a JSON file, one of ``kinds``; ResultError if that is not in it."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ResultError(f"{path}: not JSON: {' '.join(str(error).split())}") from None
    schema = data.get("schema") if isinstance(data, dict) else None
    try:
        return next((k for k in kinds if k.schema == schema), kinds[-1]).from_dict(data)
    except ResultError as error:
        raise ResultError(f"{path}: {error}") from None


Place = Callable[[], AbstractContextManager[dict[str, Any]]]
"""Of a run: called for a context, whose value is keyword arguments of it."""

WORDS = "pinsing.words"
"""Where a context has the words of the command line."""

_BAR = 30  # columns
_REDRAW_SECONDS = 0.1
_QUIET_SECONDS = 30.0  # between two lines where there is no terminal to draw on


@contextlib.contextmanager
def run_place(
    engine: str, threads: int | None, workers: int | None, dask: str | None
) -> Iterator[dict[str, Any]]:
    """Keyword arguments of a run, that say where it takes place; its executor ends with the block.

    With an engine as of `sigma_map`, in threads of this process, in processes of this machine, or
    at the scheduler of an address.
    """
    from pinsing.sampling.execute import second_ctrl_c_ends_process

    with contextlib.ExitStack() as stack:
        stack.enter_context(second_ctrl_c_ends_process())
        if dask is not None:
            from pinsing.sampling.executors import dask_cluster

            stack.enter_context(_only_our_lines())
            executor, count = stack.enter_context(dask_cluster(dask))
            say(f"{count} dask worker threads at {dask}")
            yield {"engine": engine, "executor": executor, "parallel": count}
        elif workers is not None:
            from pinsing.sampling.executors import local_processes

            executor, count = stack.enter_context(local_processes(workers))
            yield {"engine": engine, "executor": executor, "parallel": count}
        else:
            yield {"engine": engine, "threads": threads}


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


def stopped(out: Path | None) -> NoReturn:
    """End a run after Ctrl-C, and tell how to resume it."""
    if out is None:
        say("stopped; a run with -o FOLDER can be resumed")
    else:
        words = click.get_current_context().find_root().meta.get(WORDS, [])
        same = f" ({shlex.join(words)})" if words else ""
        say(f"stopped; what is done is in {out}: run the same command to resume{same}")
    raise click.exceptions.Exit(STOPPED)


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
