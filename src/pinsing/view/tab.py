"""A page in a browser tab, and the server behind it: what all viewers have in common."""

from __future__ import annotations

import html
import webbrowser
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from pinsing.atomic_write import write_text
from pinsing.errors import OptionError, UnknownNameError
from pinsing.interface import checked
from pinsing.measures import Array
from pinsing.robot.arm import Arm
from pinsing.robot.mechanism import Mechanism
from pinsing.view.scene import ARROWS, LEAST, Links, Recorder, Sizes, draw_scene, read_links
from pinsing.view.server import Server, static_html

if TYPE_CHECKING:
    from typing_extensions import Self


KINDS = ("into", "along")


SIDE = (0.74, 0.36, 0.57)
"""Where the camera looks from: three.js axes, y up."""


class Tab(ABC):
    """A robot in a browser tab: drawn, with a list, at a configuration that can be set.

    Its server starts when the address is first asked for, on loopback and the first free port from
    7000 on unless ``host`` and ``port`` say otherwise. Without meshes if ``skeleton``; bones lead
    to ``ends`` (frames) too. ``entries`` of the list have a ``name`` and ``poses``, those of an arm
    a ``family``.
    """

    entries: Sequence[Any]

    def __init__(
        self,
        robot: Arm | Mechanism,
        size: Sizes,
        skeleton: bool,
        ends: Sequence[int],
        host: str,
        port: int | None,
    ) -> None:
        self._robot, self._sizes, self._skeleton = robot, size, skeleton
        self._links = Links(None) if skeleton else read_links(robot)
        self._drawn = Recorder()
        self._notes = draw_scene(self._drawn.root, robot, self._links, size, ends)
        self._host, self._port = host, port
        self._server: Server | None = None
        # The configuration (n,) that is shown, its entry and pose if it is of the list, words.
        self._q: Array = np.zeros(0)
        self._chosen: tuple[int, int] | None = None
        self._words = ""

    @property
    def name(self) -> str:
        """Of the robot."""
        return self._robot.name

    @property
    def q(self) -> Array:
        """Configuration (n,) that was shown last, radians and metres."""
        return self._q.copy()

    @property
    def notes(self) -> tuple[str, ...]:
        """What could not be drawn."""
        return self._notes

    @property
    def url(self) -> str:
        """Address of the page; starts the server."""
        if self._server is None:
            hand_over(self, Server(self.name, self._host, self._port))
        assert self._server is not None
        return self._server.url

    @abstractmethod
    def _page(self, live: bool) -> dict[str, Any]:
        """The fixed part of a page."""

    def _start(self) -> dict[str, Any]:
        """What a page shows first."""
        entry, pose = self._chosen if self._chosen is not None else (None, 0)
        said = {"words": self._words} if self._words else {}
        return {"q": self._q.tolist(), "entry": entry, "pose": pose} | said

    def _settings(self, mode: str, side: Sequence[float] = SIDE) -> dict[str, Any]:
        """How a page draws."""
        size, names, model = self._sizes, self._robot.joints, self._robot.model
        return {
            "reach": size.reach,
            "translation": float(f"{size.translation:.3g}"),
            "rotation": float(f"{size.rotation:.3g}"),
            "thickness": 2 * LEAST * size.reach,
            "mode": mode,
            "shapes": self._links.geometry is not None and not self._skeleton,
            "bare": list(self._links.bare(self._robot)),
            "jointOf": [names.index(n) if n in names else -1 for n in list(model.names)[1:]],
            "lines": ARROWS,
            "side": list(side),
        }

    def open(self) -> bool:
        """Open the page in the user's browser; tell whether there is one."""
        return webbrowser.open(self.url, new=2)

    def _move(self, q: Array, chosen: tuple[int, int] | None, words: str = "") -> None:
        """Show a configuration in every open page, with words on it."""
        self._q, self._chosen, self._words = q, chosen, words
        self._send(self._start())

    def html(self) -> str:
        """The page in one file, with all that it computes from, that needs no program behind it.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.Viewer(pinsing.load("planar3r"), skeleton=True).html().splitlines()[0]
        '<!DOCTYPE html>'
        """
        page = {**self._page(live=False), "start": self._start()}
        return static_html(f"pinsing: {self.name}", page, *self._drawn.parts())

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

    def _place(self, wanted: Any, pose: int) -> int:
        """Return the index of an entry: itself, or by a name, a title or a family."""
        # UnknownNameError if there is none, OptionError if it has no such pose.
        named = {e.name: k for k, e in enumerate(self.entries)}
        families = ((k, getattr(e, "family", None)) for k, e in enumerate(self.entries))
        titled = {f.title: k for k, f in reversed([*families]) if f is not None and f.title}
        wanted = getattr(wanted, "name", wanted)
        index = wanted if isinstance(wanted, int) else (named | titled).get(wanted, -1)
        UnknownNameError.refuse_if(
            not 0 <= index < len(self.entries), "family", str(wanted), list(named)
        )
        poses = self.entries[index].poses
        OptionError.refuse_if(
            not 0 <= pose < len(poses),
            f"{self.entries[index].name} has {len(poses)} poses within the limits; "
            f"there is no pose {pose}",
        )
        return int(index)

    def _go(self, wanted: Any, pose: int) -> None:
        """Show a pose of the list in every open page."""
        index = self._place(wanted, pose)
        self._move(self.entries[index].poses[pose].copy(), (index, pose))

    def _play(self, wanted: Any, kind: str, pose: int) -> None:
        """Play a motion in every open page."""
        index = self._place(wanted, pose)
        OptionError.refuse_if(
            kind not in KINDS, f"unknown kind of path {kind!r}: {' or '.join(KINDS)}"
        )
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

        return HTML(self._cell(height, live))  # type: ignore[no-untyped-call]

    def _repr_html_(self) -> str:
        return self._cell(600, False)

    def _cell(self, height: int, live: bool) -> str:
        if live:
            self.url  # noqa: B018 (starts the server)
            assert self._server is not None
            shown = f'src="{html.escape(self._server.framed_url)}"'
        else:
            # A page of its own: whatever a robot's file says, scripts cannot reach the notebook.
            sandbox = 'sandbox="allow-scripts allow-downloads" allow="clipboard-write"'
            shown = f'{sandbox} srcdoc="{html.escape(self.html())}"'
        return (
            f'<div><iframe title="{html.escape(f"pinsing: {self.name}")}" {shown} style="width: '
            f'100%; height: {int(height)}px; border: 1px solid #dfe4ea; border-radius: 6px">'
            "</iframe></div>"
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def hand_over(tab: Tab, server: Server) -> None:
    """Let a server that was started ahead of a tab serve it."""
    try:
        server.fill(
            tab._page(live=True), *tab._drawn.parts(), tab._start, getattr(tab, "_dropped", None)
        )
    except BaseException:
        server.close()
        raise
    tab._server = server
