"""A page in a browser tab, and the server behind it: what all viewers have in common."""

from __future__ import annotations

import html
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.atomic_write import write_text
from pinsing.errors import OptionError, UnknownNameError
from pinsing.view.page import Served, static_html
from pinsing.view.server import Server
from pinsing.view.stage import KINDS

if TYPE_CHECKING:
    from typing_extensions import Self


class Shown(Served, Protocol):
    """A stage: what a server serves, at a configuration that can be set."""

    q: Array
    chosen: tuple[int, int] | None
    notes: tuple[str, ...]


class Tab:
    """A stage in a browser tab.

    The server is started when its address is first asked for, inside this process and on
    loopback only unless ``host`` says otherwise.

    Parameters
    ----------
    stage : Shown
        What is shown.
    scene, links : bytes
        Drawing commands of the scene, and those of the links' shapes, which follow.
    host, port : str, int
        Where to listen; by default loopback, the first free port from 7000 on.
    """

    def __init__(
        self, stage: Shown, scene: bytes, links: bytes, host: str, port: int | None
    ) -> None:
        self._shown, self._scene, self._links = stage, scene, links
        self._host, self._port = host, port
        self._server: Server | None = None

    @property
    def name(self) -> str:
        """Of the robot."""
        return self._shown.name

    @property
    def q(self) -> Array:
        """Configuration (n,) that was shown last, radians and metres."""
        return self._shown.q.copy()

    @property
    def notes(self) -> tuple[str, ...]:
        """What could not be drawn."""
        return self._shown.notes

    @property
    def url(self) -> str:
        """Address of the page; starts the server."""
        if self._server is None:
            self._server = Server(
                self._shown, self._scene, self._host, self._port, links=self._links
            )
        return self._server.url

    def take_over(self, server: Server) -> None:
        """Let a server that was started ahead of this tab serve it."""
        server.fill(self._shown, self._scene, self._links)
        self._server = server

    def open(self) -> bool:
        """Open the page in the user's browser; tell whether there is one."""
        return webbrowser.open(self.url, new=2)

    def _move(self, q: Array, chosen: tuple[int, int] | None) -> dict[str, Any]:
        """Show a configuration in every open page; what they are told."""
        self._shown.q, self._shown.chosen = q, chosen
        start = self._shown.start()
        self._send(start)
        return start

    def html(self) -> str:
        """The page in one file, with all that it computes from, that needs no program behind it.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.Viewer(pinsing.load("planar3r"), skeleton=True).html().splitlines()[0]
        '<!DOCTYPE html>'
        """
        page = {**self._shown.page(live=False), "start": self._shown.start()}
        return static_html(f"pinsing: {self._shown.name}", page, self._scene, self._links)

    @checked
    def save_html(self, path: str | Path) -> None:
        """Write `html` to a file.

        Parameters
        ----------
        path : path-like
            The file.

        Raises
        ------
        OutputError
            If it cannot be written.

        Examples
        --------
        >>> import pathlib, pinsing
        >>> pinsing.Viewer(pinsing.load("planar3r"), skeleton=True).save_html("arm.html")
        >>> pathlib.Path("arm.html").is_file()
        True
        """
        write_text(path, self.html())

    def _play(self, index: int, pose: int, kind: str) -> None:
        """Play a motion in every open page."""
        if kind not in KINDS:
            raise OptionError(f"unknown kind of path {kind!r}: {' or '.join(KINDS)}")
        self._send({"play": kind, "entry": index, "pose": pose})

    def _send(self, message: dict[str, Any]) -> None:
        """Send a message to every open page; none is open before the address was asked for."""
        if self._server is not None:
            self._server.send(message)

    @checked
    def save_png(
        self, path: str | Path, size: tuple[int, int] = (1200, 900), panel: bool = False
    ) -> None:
        """Write a picture of what is shown; needs Chromium or Chrome.

        Parameters
        ----------
        path : path-like
            The file.
        size : (int, int)
            Width and height, pixels.
        panel : bool
            The page with its panel, in place of the arm alone.

        Raises
        ------
        OutputError
            If there is no Chromium, it fails, or the file cannot be written.
        """
        from pinsing.view.picture import take_picture

        take_picture(self.url + ("" if panel else "#picture"), path, size)

    def close(self) -> None:
        """Stop the server.

        Examples
        --------
        >>> import pinsing
        >>> viewer = pinsing.Viewer(pinsing.load("planar3r"), skeleton=True)
        >>> viewer.url  # starts it
        'http://127.0.0.1:...'
        >>> viewer.close()
        """
        if self._server is not None:
            self._server.close()
            self._server = None

    @checked
    def jupyter_cell(self, height: int = 600, live: bool = False) -> Any:
        """The page as a notebook cell.

        The cell holds the page itself, as it is now: it works where the notebook is opened again,
        on another computer, and after this program has ended.

        Parameters
        ----------
        height : int
            Pixels.
        live : bool
            Frame the page of the server instead: it follows `show`, for as long as this program
            runs, on this computer.
        """
        from IPython.display import HTML

        cell = self._live_frame(height) if live else self._frame(height)
        return HTML(cell)  # type: ignore[no-untyped-call]

    def _repr_html_(self) -> str:
        return self._frame(600)

    def _frame(self, height: int) -> str:
        # A page of its own: its scripts cannot reach the notebook, whatever a robot's file says.
        page = html.escape(self.html())
        sandbox = 'sandbox="allow-scripts allow-downloads" allow="clipboard-write"'
        return _iframe(f'{sandbox} srcdoc="{page}"', self._shown.name, height)

    def _live_frame(self, height: int) -> str:
        self.url  # noqa: B018 (starts the server)
        assert self._server is not None
        return _iframe(f'src="{html.escape(self._server.framed_url)}"', self._shown.name, height)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _iframe(what: str, name: str, height: int) -> str:
    return (
        f'<div><iframe title="{html.escape(f"pinsing: {name}")}" {what} style="width: 100%; '
        f'height: {int(height)}px; border: 1px solid #dfe4ea; border-radius: 6px">'
        "</iframe></div>"
    )


def place_in_list(entries: Sequence[tuple[str, int]], wanted: str | int, pose: int) -> int:
    """Place of an entry, given by its name or by that place, in the list of a page.

    Parameters
    ----------
    entries : sequence of (str, int)
        Name and number of poses of each.
    wanted : str or int
        The entry.
    pose : int
        One of its poses, counted from 0.

    Raises
    ------
    UnknownNameError
        If the list has no such entry.
    OptionError
        If the entry has no such pose.
    """
    names = [name for name, _ in entries]
    known = 0 <= wanted < len(names) if isinstance(wanted, int) else wanted in names
    if not known:
        raise UnknownNameError("family", str(wanted), names)
    index = wanted if isinstance(wanted, int) else names.index(wanted)
    name, count = entries[index]
    if not 0 <= pose < count:
        raise OptionError(f"{name} has {count} poses within the limits; there is no pose {pose}")
    return index
