"""Pages out of parts: the live one in several files, the static one in a single file."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import gzip
import hmac
import html
import importlib.util
import json
import re
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any, Protocol

from tornado.iostream import StreamClosedError
from tornado.web import HTTPError, RequestHandler, stream_request_body
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from pinsing.proximity.trajectory_file import LARGEST_TEXT

MOST_PAGES = 64

Content = str | bytes
"""Of a file of the page."""


class Served(Protocol):
    """What a server needs to know of what it serves."""

    @property
    def name(self) -> str:
        """Name of the robot, for the title of the page."""

    def page(self, live: bool) -> dict[str, Any]:
        """The fixed part of a page, ready for JSON."""

    def start(self) -> dict[str, Any]:
        """What a page shows first: a configuration ``q``, and its place in the list."""


@dataclass
class Site:
    """What all requests share."""

    stage: Served | None  # None until it is there
    # type and content of the page's files, by name
    texts: Mapping[str, tuple[str, Content | Future[Content]]]
    policies: Mapping[str, str]  # content security policies, by the token in the address
    is_ours: Callable[[str], bool]  # tells if a Host header names this server
    clients: set[Live] = field(default_factory=set)  # open links
    # page data of a trajectory file: its name, content, and if in degrees
    read: Callable[[str, bytes, bool | None], dict[str, Any]] | None = None

    def policy(self, host: str, token: str) -> str:
        """Return the policy for a request; HTTPError 403 for a wrong host or token."""
        if self.is_ours(host):
            for known, policy in self.policies.items():
                if hmac.compare_digest(known.encode(), token.encode()):
                    return policy
        raise HTTPError(403)


class _Quiet(RequestHandler):  # type: ignore[misc,unused-ignore]
    """Says nothing of a request that is refused: anyone may send one."""

    def initialize(self, site: Site) -> None:
        """Take what all requests share."""
        self.site, self.unread = site, 0

    def require_own_page(self) -> None:
        """Refuse who is no page of this server."""
        host = self.request.host
        self.site.policy(host, self.path_args[0] or "")
        origin = self.request.headers.get("Origin", "").lower()
        if origin not in (f"http://{host}".lower(), f"https://{host}".lower()):
            raise HTTPError(403)

    def log_exception(self, *error: Any) -> None:
        """Log faults of our own only."""
        if not isinstance(error[1], HTTPError):
            super().log_exception(*error)


_HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "Content-Security-Policy": "default-src 'none'; frame-ancestors 'none'",
}


class PagePart(_Quiet):
    """A file of the page, held in memory."""

    def prepare(self) -> None:
        """Judge host and token."""
        policy = self.site.policy(self.request.host, self.path_args[0] or "")
        self.set_header("Content-Security-Policy", policy)

    def set_default_headers(self) -> None:
        """Keep the page out of caches, and its address to itself."""
        for name, value in _HEADERS.items():
            self.set_header(name, value)

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        """Say to whoever has an address without its token where the whole one is."""
        if status_code == 403:
            self.set_header("Content-Type", "text/plain; charset=utf-8")
            self.finish(
                "403: this address lacks the secret part of the link, or has an old one.\n\n"
                "Open the whole link that pinsing printed in its terminal (http://.../SECRET/).\n"
            )
        else:
            super().write_error(status_code, **kwargs)

    async def get(self, _token: str, name: str) -> None:
        """Send the file, as soon as it is there."""
        if name not in self.site.texts:
            raise HTTPError(404)
        kind, content = self.site.texts[name]
        if isinstance(content, Future):
            try:
                content = await asyncio.shield(asyncio.wrap_future(content))
            except asyncio.CancelledError:
                raise HTTPError(503) from None
        charset = "; charset=utf-8" if isinstance(content, str) else ""
        self.set_header("Content-Type", kind + charset)
        self.write(content)


class Nothing(PagePart):
    """Any address without a token."""

    def prepare(self) -> None:
        """Refuse."""
        raise HTTPError(403)


@stream_request_body
class Dropped(_Quiet):
    """Reads a trajectory file that was dropped onto a page, as the command line reads it."""

    def prepare(self) -> None:
        """Judge host, token and origin, before a file is taken in."""
        self.require_own_page()
        if self.request.method != "POST" or self.site.read is None:
            raise HTTPError(404)
        self.request.connection.set_max_body_size(LARGEST_TEXT)
        self.request.connection.set_body_timeout(60)
        self.content = bytearray()

    def data_received(self, chunk: bytes) -> None:
        """Take a piece of it."""
        self.content += chunk

    async def post(self, _token: str) -> None:
        """Answer with what the page shows."""
        assert self.site.read is not None
        name, units = self.get_query_argument("name", "path.csv"), self.get_query_argument("units")
        degrees = {"deg": True, "rad": False}.get(units)
        loop = asyncio.get_running_loop()
        self.write(
            await loop.run_in_executor(None, self.site.read, name, bytes(self.content), degrees)
        )


class Live(_Quiet, WebSocketHandler):  # type: ignore[misc,unused-ignore]
    """Tells one page what to show; a page says nothing, for it computes all by itself."""

    def prepare(self) -> None:
        """Judge host, token and origin, before anything is upgraded."""
        self.require_own_page()
        if len(self.site.clients) >= MOST_PAGES:
            raise HTTPError(503)

    def check_origin(self, origin: str) -> bool:
        """Whether a page is ours: `prepare` has judged that."""
        return True

    def open(self, *args: str, **kwargs: str) -> None:
        """Count this page, and tell it what is shown first."""
        self.site.clients.add(self)
        if self.site.stage is not None:
            self.tell(json.dumps(self.site.stage.start(), allow_nan=False))

    def on_close(self) -> None:
        """Count it no more."""
        self.site.clients.discard(self)

    def tell(self, text: str) -> None:
        """Send a text, if the page is still there; one that does not read is let go."""
        if self.unread + len(text) > 8 * 2**20:
            self.drop()
            return
        task = asyncio.ensure_future(self._send(text))
        task.add_done_callback(lambda done: done.cancelled() or done.exception())

    async def _send(self, text: str) -> None:
        self.unread += len(text)
        try:
            await self.write_message(text)
        except (WebSocketClosedError, StreamClosedError):
            self.drop()
        finally:
            self.unread -= len(text)

    def drop(self) -> None:
        """End the link without asking the other side."""
        self.site.clients.discard(self)
        if self.ws_connection is not None:
            with contextlib.suppress(StreamClosedError, AttributeError):
                self.ws_connection.stream.close()

    def on_message(self, message: str | bytes) -> None:
        """Let go of what is no page of ours."""
        self.drop()


ENGINE = (
    "limits",
    "linear",
    "orthogonal",
    "chain",
    "balls",
    "measures",
    "measured",
    "families",
    "sums",
    "boxes",
    "distance",
    "lost",
    "missing",
    "reasons",
    "arm",
    "paths",
    "nearest",
    "clearance",
    "led",
    "trajectory",
    "crossings",
    "meet",
    "locus",
    "loops",
    "mechanism",
    "drive",
    "pose_drive",
    "curve",
    "singular_points",
    "dyad",
    "working_modes",
    "surroundings",
    "health",
    "follow",
    "mechanism_words",
    "mechanism_frame",
    "mechanism_paths",
)
"""Modules of the engine, each after those that it imports."""

SCRIPTS = (
    "labels.js",
    "pace.js",
    "scene.js",
    "panel.js",
    "locus.js",
    "source.js",
    "player.js",
    "drag.js",
    "postures.js",
    "take.js",
    "main.js",
    "aside.js",
    "pose_sliders.js",
    "mechanism_panel.js",
    "mechanism.js",
    "start.js",
)

_IMPORT = re.compile(r'^import \{([^}]*)\} from "\./(\w+)\.mjs";', re.MULTILINE)
_EXPORT = re.compile(r"^export (const|function\*?|class) (\w+)", re.MULTILINE)

# Nothing is ever fetched from elsewhere; meshcat adds styles, and textures as data.
LIVE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self' data: blob:; worker-src blob:; "
    "base-uri 'none'; form-action 'none'"
)
_STATIC_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src data: blob:; worker-src blob:; base-uri 'none'; "
    "form-action 'none'"
)


@cache
def asset(name: str) -> str:
    """Text of a file that belongs to the page."""
    return files("pinsing.view").joinpath("assets", name).read_text(encoding="utf-8")


@cache
def meshcat_script() -> str:
    """Meshcat's own viewer, three.js included, after the texts of their licences."""
    # Found, not imported: its Python side brings IPython, and a browser waits for this file.
    spec = importlib.util.find_spec("meshcat")
    assert spec is not None
    assert spec.origin is not None
    folder = Path(spec.origin).parent / "viewer" / "dist"
    code = (folder / "main.min.js").read_text(encoding="utf-8")
    return f"/*\n{asset('licences.txt')}*/\n{code}"


@cache
def engine_script() -> str:
    """Return the engine as one classic script that sets ``Engine``."""
    # A page from a file may not import modules: each becomes a function that returns its exports.
    folder = files("pinsing.view").joinpath("engine")
    parts, names = [], []
    for name in ENGINE:
        code = folder.joinpath(f"{name}.mjs").read_text(encoding="utf-8")
        code = _IMPORT.sub(lambda m: f"const {{{m[1]}}} = engine_{m[2]};", code)
        exported = _EXPORT.findall(code)
        code = _EXPORT.sub(lambda m: f"{m[1]} {m[2]}", code)
        given = ", ".join(what for _, what in exported)
        parts.append(f"const engine_{name} = (() => {{\n{code}\nreturn {{ {given} }};\n}})();")
        names.append(f"...engine_{name}")
    # As a function, so that a worker beside the page can have its own.
    inside = "\n".join([*parts, f"return {{ {', '.join(names)} }};"])
    return f"function engineOf() {{\n{inside}\n}}\nconst Engine = engineOf();"


def script() -> str:
    """Our part of the page's program."""
    return "\n".join([engine_script(), *(asset(name) for name in SCRIPTS)])


def live_html(title: str) -> str:
    """The page that fetches its parts from the server."""
    return Template(asset("page.html")).substitute(
        title=html.escape(title),
        head=_policy(LIVE_POLICY) + '\n<link rel="icon" href="data:,">',
        style='<link rel="stylesheet" href="page.css">',
        data="",
        scripts='<script src="begin.js"></script>',
        links="",
    )


def static_html(title: str, page: dict[str, Any], scene: bytes, links: bytes) -> str:
    """Return the page that opens from a file, meshes last: the skeleton shows before them."""
    text = json.dumps(page, separators=(",", ":"), allow_nan=False)
    baked = [_baked("page", text.encode()), _baked("scene", scene)]
    scripts = [f"<script>\n{code}\n</script>" for code in (meshcat_script(), script())]
    return Template(asset("page.html")).substitute(
        title=html.escape(title),
        head=_policy(_STATIC_POLICY) + '\n<link rel="icon" href="data:,">',
        style=f"<style>\n{asset('page.css')}\n</style>",
        data="\n".join(baked),
        scripts="\n".join(scripts),
        links=_baked("links", links),
    )


def _baked(name: str, data: bytes) -> str:
    # mtime=0: the same arm gives the same bytes. Level 9 takes ten times as long, for 5 percent.
    packed = base64.b64encode(gzip.compress(data, 4, mtime=0)).decode("ascii")
    return f'<script id="baked-{name}" type="application/octet-stream">{packed}</script>'


def _policy(policy: str) -> str:
    return f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
