"""What ``view`` does for arms and mechanisms alike: serve a tab, read a file, size a picture."""

from __future__ import annotations

import contextlib
import gc
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pinsing.cli.output import say
from pinsing.errors import OptionError, ResultError

if TYPE_CHECKING:
    from pinsing.view.server import Server
    from pinsing.view.tab import Tab


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
        if not no_open and not (_has_desktop() and webbrowser.open(server.url, new=2)):
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


def show(tab: Tab, html: Path | None, view: bool, no_open: bool) -> None:
    """Write the page of a result, serve it on this computer, or both."""
    with tab:
        for note in tab.notes:
            say(f"note: {note}")
        write_files(tab, html)
        if view:
            with served_ahead(tab.name, "127.0.0.1", None, no_open) as server:
                stay(tab, server)


def stay(tab: Tab, server: Server, lead: Callable[[], None] | None = None) -> None:
    """Give a tab to a server that runs, and lead it, until the user has seen enough."""
    from pinsing.view.tab import hand_over

    hand_over(tab, server)
    say("press Ctrl-C to end")
    if lead is not None:
        lead()
    while True:
        time.sleep(3600)


def write_files(
    tab: Tab,
    html: Path | None,
    png: Path | None = None,
    size: tuple[int, int] = (1200, 900),
    panel: bool = False,
    at: Callable[[str], object] = str,
) -> None:
    """Write the page, a picture of it, or both; ``at`` is told what is being done."""
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


def _has_desktop() -> bool:
    # Without one, Python would start a text browser in this very terminal.
    if sys.platform.startswith("linux"):
        return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return True


def picture_size(text: str) -> tuple[int, int]:
    """Return width and height of ``1200x900``; OptionError for other text."""
    width, cross, height = text.lower().partition("x")
    OptionError.refuse_if(
        not (cross and width.isdigit() and height.isdigit()),
        f"--size {text!r} is not of the form 1200x900",
    )
    return int(width), int(height)


def read_json(path: Path) -> Any:
    """Return the content of a JSON file; ResultError if it cannot be read, or is not JSON."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ResultError(f"{path}: not JSON: {' '.join(str(error).split())}") from None
