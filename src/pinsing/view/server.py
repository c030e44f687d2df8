"""Pages out of parts, the static one in a single file; and the web server of a live page.

The server is inside this process, on loopback, and gone when it ends. Its address holds a random
token, without which nothing is answered: other users of the computer, and pages of other sites,
cannot guess it. A second token is for notebooks, whose pages frame ours; under the first no page
may do so.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import errno
import gzip
import hmac
import html
import importlib.util
import ipaddress
import json
import re
import secrets
import socket
import threading
import time
import warnings
from collections.abc import Callable
from concurrent.futures import Future
from functools import cache
from graphlib import TopologicalSorter
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any
from urllib.parse import urlsplit

from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPInputError, HTTPMessageDelegate
from tornado.iostream import StreamClosedError
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler, stream_request_body
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from pinsing.errors import OptionError
from pinsing.proximity.trajectory_file import LARGEST_TEXT

SCRIPTS = (
    "labels.js",
    "pace.js",
    "scene.js",
    "panel.js",
    "locus.js",
    "source.js",
    "player.js",
    "drag.js",
    "take.js",
    "main.js",
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
def engine_modules() -> dict[str, str]:
    """Return the code of each module of the engine, after those that it imports."""
    folder = files("pinsing.view").joinpath("engine")
    found = [file for file in folder.iterdir() if file.name.endswith(".mjs")]
    code = {file.name[:-4]: file.read_text(encoding="utf-8") for file in found}
    needs = {name: [m[1] for m in _IMPORT.findall(code[name])] for name in sorted(code)}
    return {name: code[name] for name in TopologicalSorter(needs).static_order()}


@cache
def engine_script() -> str:
    """Return the engine as one classic script that sets ``Engine``."""
    # A page from a file may not import modules: each becomes a function that returns its exports.
    parts, names = [], []
    for name, code in engine_modules().items():
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
    return "\n".join(['"use strict";', engine_script(), *(asset(name) for name in SCRIPTS)])


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


MOST_PAGES = 64

Content = str | bytes
"""Of a file of the page."""


class _Quiet(RequestHandler):  # type: ignore[misc,unused-ignore]
    """Says nothing of a request that is refused: anyone may send one."""

    def initialize(self, site: Server) -> None:
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
        """Judge host and token; an address without one is refused."""
        token = self.path_args[0] if self.path_args else ""
        policy = self.site.policy(self.request.host, token or "")
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
        if self.site.start is not None:
            self.tell(json.dumps(self.site.start(), allow_nan=False))

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


_MOST_LINKS = 512
_NO_FILES = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM})


class Listener(socket.socket):
    """A socket that waits, and says nothing, while no file can be opened."""

    def accept(self) -> tuple[socket.socket, Any]:
        """Take a link, if there is one and room for it."""
        try:
            return super().accept()
        except OSError as error:
            if error.errno not in _NO_FILES:
                raise
            time.sleep(0.05)  # it is asked again and again until some are closed
            raise BlockingIOError from None


class Door(HTTPServer):  # type: ignore[misc,unused-ignore]
    """A server that holds a limited number of links.

    One more replaces the link that has waited longest without a request; if all are being answered,
    it is dropped.
    """

    def initialize(self, *args: Any, **kwargs: Any) -> None:
        """Take what `HTTPServer` takes."""
        super().initialize(*args, **kwargs)
        self._held, self._most = 0, most_links()
        self._silent: dict[Any, None] = {}  # streams without a whole request, the oldest first

    def handle_stream(self, stream: Any, address: Any) -> None:
        """Take a new link, or drop it."""
        if self._held >= self._most:
            oldest = next(iter(self._silent), stream)
            self._silent.pop(oldest, None)
            oldest.close()
            if oldest is stream:
                return
        self._held += 1
        self._silent[stream] = None
        super().handle_stream(stream, address)

    def on_close(self, server_conn: object) -> None:
        """Count a link no more that has ended, or has become one of a page."""
        self._held -= 1
        self._silent.pop(getattr(server_conn, "stream", None), None)
        super().on_close(server_conn)

    def start_request(self, server_conn: object, request_conn: Any) -> HTTPMessageDelegate:
        """Read a request."""
        stream = getattr(server_conn, "stream", None)
        if stream is not None and not stream.closed():
            self._silent[stream] = None
        return _Request(
            super().start_request(server_conn, request_conn), lambda: self._silent.pop(stream, None)
        )


class _Request(HTTPMessageDelegate):  # type: ignore[misc,unused-ignore]
    """Passes a request on, but for one that tornado itself stumbles over."""

    def __init__(self, then: HTTPMessageDelegate, complete: Callable[[], object]) -> None:
        self._then, self._complete = then, complete

    def headers_received(self, start_line: Any, headers: Any) -> Any:
        # Of a name, 253 at most, and a port.
        if len(headers.get("Host", "")) > 300:
            raise HTTPInputError("no host has such a name")
        return self._then.headers_received(start_line, headers)

    def data_received(self, chunk: bytes) -> Any:
        return self._then.data_received(chunk)

    def finish(self) -> None:
        self._complete()
        self._then.finish()

    def on_connection_close(self) -> None:
        self._then.on_connection_close()


def most_links() -> int:
    """How many links may be open at once: half of the files that this process may have."""
    try:
        import resource
    except ImportError:  # Windows
        return _MOST_LINKS
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return _MOST_LINKS if files == resource.RLIM_INFINITY else min(_MOST_LINKS, files // 2)


def is_loopback(host: str) -> bool:
    """Whether only this computer can reach a server on ``host``."""
    found = _address(host)
    return host == "localhost" if found is None else found.is_loopback


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """A bare address, which cannot be pointed elsewhere by somebody's name server, else None."""
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(name)
    return None


def bind(host: str, port: int | None) -> list[socket.socket]:
    """Return sockets on all addresses of ``host``, one port; OptionError if taken or unknown."""
    OptionError.refuse_if(
        port is not None and not 0 <= port <= 65535, f"port must be between 0 and 65535, got {port}"
    )
    problem = ""
    with warnings.catch_warnings():
        # Of several addresses the first ones are left to the collector where a later one is taken.
        warnings.simplefilter("ignore", ResourceWarning)
        for candidate in [*range(7000, 7100), 0] if port is None else [port]:
            try:
                found = bind_sockets(candidate, host)
            except (socket.gaierror, UnicodeError):
                raise OptionError(f"there is no address {host!r} to listen on") from None
            except OSError as error:
                problem = error.strerror or str(error)
            else:
                return [Listener(s.family, s.type, s.proto, s.detach()) for s in found]
    raise OptionError(f"cannot listen on {host} port {port}: {problem}; leave out --port")


_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_FAREWELL = 0.3
_REQUEST_SECONDS = 4.0
"""How long a request may take to come, from the link or the answer before; no matter for pages."""
_LONGEST = 64 << 10  # of heads and bodies of requests
_LATER = ("page.json", "scene", "links")


class Server:
    """Serves one page from a daemon thread, whose content `fill` gives.

    By default on the first free port from 7000 on. OptionError if the port is taken, or there is no
    such address.
    """

    def __init__(self, name: str, host: str = "127.0.0.1", port: int | None = None) -> None:
        self.host = host
        self._sockets = bind(host, port)
        self.port = int(self._sockets[0].getsockname()[1])
        self._token, self._framed = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
        self._policies = {
            self._token: f"{LIVE_POLICY}; frame-ancestors 'none'",
            self._framed: LIVE_POLICY,
        }
        self._later: dict[str, Future[Content]] = {name: Future() for name in _LATER}
        # type and content of the page's files, by name
        self.texts: dict[str, tuple[str, Content | Future[Content]]] = {
            "": ("text/html", live_html(f"pinsing: {name}")),
            "begin.js": ("text/javascript", asset("begin.js")),
            "page.css": ("text/css", asset("page.css")),
            "page.js": ("text/javascript", script()),
            "meshcat.js": ("text/javascript", meshcat_script()),
            "page.json": ("application/json", self._later["page.json"]),
            "scene": ("application/octet-stream", self._later["scene"]),
            "links": ("application/octet-stream", self._later["links"]),
        }
        self.start: Callable[[], dict[str, Any]] | None = None  # what is shown first, if known
        self.clients: set[Live] = set()  # open links
        # page data of a trajectory file: its name, content, and if in degrees
        self.read: Callable[[str, bytes, bool | None], dict[str, Any]] | None = None
        self._loop = asyncio.new_event_loop()
        self._http: Door | None = None
        self._app = Application(
            [
                (r"/([^/]+)/live", Live, {"site": self}),
                (r"/([^/]+)/trajectory", Dropped, {"site": self}),
                (r"/([^/]+)/([^/]*)", PagePart, {"site": self}),
                (r".*", PagePart, {"site": self}),
            ],
            log_function=lambda handler: None,
            websocket_max_message_size=1024,  # pages say nothing
        )
        ready = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(ready,), name="pinsing view", daemon=True
        )
        self._thread.start()
        ready.wait()

    def fill(
        self,
        page: dict[str, Any],
        scene: bytes,
        links: bytes,
        start: Callable[[], dict[str, Any]],
        read: Callable[[str, bytes, bool | None], dict[str, Any]] | None = None,
    ) -> None:
        """Give what is shown to the pages that wait for it; drawing commands as bytes."""
        contents: tuple[Content, ...] = (json.dumps(page, allow_nan=False), scene, links)
        for name, content in zip(_LATER, contents, strict=True):
            self._later[name].set_result(content)
        self.start, self.read = start, read
        self.send(start())  # to pages that wait

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"{self._origin}/{self._token}/"

    @property
    def framed_url(self) -> str:
        """Address of the page for a frame within another, as of a notebook."""
        return f"{self._origin}/{self._framed}/"

    @property
    def _origin(self) -> str:
        host = "127.0.0.1" if self.host in ("", "0.0.0.0", "::") else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}"

    def send(self, message: dict[str, Any]) -> None:
        """Send a message to every open page."""
        text = json.dumps(message, allow_nan=False)

        def broadcast() -> None:
            for client in list(self.clients):
                client.tell(text)

        self._loop.call_soon_threadsafe(broadcast)

    def close(self) -> None:
        """Stop, and give the port back."""
        if not self._thread.is_alive():
            return
        self._loop.call_soon_threadsafe(self._stop)
        self._thread.join(timeout=5)

    def _run(self, ready: threading.Event) -> None:
        asyncio.set_event_loop(self._loop)
        self._http = Door(
            self._app,
            max_body_size=_LONGEST,
            max_header_size=_LONGEST,
            idle_connection_timeout=_REQUEST_SECONDS,
            body_timeout=_REQUEST_SECONDS,
        )
        self._http.add_sockets(self._sockets)
        self._loop.call_soon(ready.set)
        self._loop.run_forever()
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        self._loop.close()

    def _stop(self) -> None:
        assert self._http is not None
        self._http.stop()
        for content in self._later.values():
            content.cancel()  # a page may wait for it
        for client in list(self.clients):
            client.close()
        self._loop.create_task(self._finish())

    async def _finish(self) -> None:
        assert self._http is not None
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._http.close_all_connections(), timeout=_FAREWELL)
        for client in list(self.clients):
            client.drop()
        # What waits for a link to take an answer ends with the link.
        others = asyncio.all_tasks() - {asyncio.current_task()}
        if others:
            await asyncio.wait(others, timeout=_FAREWELL)
        self._loop.stop()

    def policy(self, host: str, token: str) -> str:
        """Return the content security policy for a request; HTTPError 403 for a wrong one."""
        if self._is_ours(host):
            for known, policy in self._policies.items():
                if hmac.compare_digest(known.encode(), token.encode()):
                    return policy
        raise HTTPError(403)

    def _is_ours(self, host: str) -> bool:
        """Whether a Host header names this server: other names may be another site's trick."""
        with contextlib.suppress(ValueError):
            parts = urlsplit(f"//{host}")
            name, port = parts.hostname or "", parts.port
            if (80 if port is None else port) != self.port or parts.username is not None:
                return False
            if self.host in _LOOPBACK:
                return name in _LOOPBACK
            return name == self.host or name in _LOOPBACK or _address(name) is not None
        return False
