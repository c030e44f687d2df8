"""The web server of a live page: inside this process, on loopback, gone when it ends."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import json
import os
import socket
import threading
from collections.abc import Callable, Mapping
from typing import Any, Protocol
from urllib.parse import urlsplit

from tornado.httpserver import HTTPServer
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from pinsing.errors import OptionError, PinsingError
from pinsing.view.page import asset, live_html, meshcat_script, script

FIRST_PORT = 7000
_TRIED_PORTS = 100
_LONGEST_MESSAGE = 64 * 1024
_LOOPBACK = ("127.0.0.1", "localhost", "::1")


class Served(Protocol):
    """What a server needs to know of what it serves."""

    @property
    def name(self) -> str:
        """Name of the robot, for the title of the page."""

    def page(self, live: bool) -> dict[str, Any]:
        """The fixed part of a page, ready for JSON."""

    def answer(self, request: Mapping[str, Any]) -> Any:
        """Answer a question of a page, its ``want``, ready for JSON.

        Raises
        ------
        PinsingError
            If it cannot be answered; the page is told why.
        """


class Server:
    """Serves one stage from a daemon thread.

    Parameters
    ----------
    stage : Served
        What is shown.
    scene : bytes
        Drawing commands of the scene.
    host : str
        Address to listen on.
    port : int, optional
        By default the first free one from 7000 on.

    Raises
    ------
    OptionError
        If the port is taken, or there is no such address.
    """

    def __init__(
        self, stage: Served, scene: bytes, host: str = "127.0.0.1", port: int | None = None
    ) -> None:
        self.host = host
        self._sockets = _bind(host, port)
        self.port = int(self._sockets[0].getsockname()[1])
        self._clients: set[_Live] = set()
        self._loop = asyncio.new_event_loop()
        self._http: HTTPServer | None = None
        self._app = _application(stage, scene, self._clients, self._is_ours)
        ready = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(ready,), name="pinsing view", daemon=True
        )
        self._thread.start()
        ready.wait()

    @property
    def url(self) -> str:
        """Address of the page."""
        everywhere = self.host in ("", "0.0.0.0", "::")
        host = "127.0.0.1" if everywhere else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/"

    @property
    def pages(self) -> int:
        """How many pages are open."""
        return len(self._clients)

    def send(self, message: dict[str, Any]) -> None:
        """Send a message to every open page."""
        text = json.dumps(message, allow_nan=False)
        self._loop.call_soon_threadsafe(self._broadcast, text)

    def close(self) -> None:
        """Stop, and give the port back."""
        if not self._thread.is_alive():
            return
        self._loop.call_soon_threadsafe(self._stop)
        self._thread.join(timeout=5)

    def _run(self, ready: threading.Event) -> None:
        asyncio.set_event_loop(self._loop)
        self._http = HTTPServer(self._app)
        self._http.add_sockets(self._sockets)
        self._loop.call_soon(ready.set)
        self._loop.run_forever()
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        self._loop.close()

    def _stop(self) -> None:
        assert self._http is not None
        self._http.stop()
        for client in list(self._clients):
            client.close()
        self._loop.create_task(self._finish())

    async def _finish(self) -> None:
        assert self._http is not None
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._http.close_all_connections(), timeout=2)
        self._loop.stop()

    def _broadcast(self, text: str) -> None:
        for client in list(self._clients):
            client.tell(text)

    def _is_ours(self, host: str) -> bool:
        """Whether a Host header names this server: other names may be another site's trick."""
        with contextlib.suppress(ValueError):
            parts = urlsplit(f"//{host}")
            name, port = parts.hostname or "", parts.port
            if (80 if port is None else port) != self.port:
                return False
            if self.host in _LOOPBACK:
                return name in _LOOPBACK
            return name == self.host or name in _LOOPBACK or _is_address(name)
        return False


def is_loopback(host: str) -> bool:
    """Whether only this computer can reach a server on ``host``."""
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == "localhost"


def _is_address(name: str) -> bool:
    # A bare address cannot be pointed elsewhere by somebody's name server.
    with contextlib.suppress(ValueError):
        ipaddress.ip_address(name)
        return True
    return False


def _bind(host: str, port: int | None) -> list[socket.socket]:
    if port is not None and not 0 <= port <= 65535:
        raise OptionError(f"port must be between 0 and 65535, got {port}")
    tries = [port] if port is not None else [*range(FIRST_PORT, FIRST_PORT + _TRIED_PORTS), 0]
    problem: OSError | None = None
    for candidate in tries:
        try:
            return _listen(host, candidate)
        except socket.gaierror:
            raise OptionError(f"there is no address {host!r} to listen on") from None
        except OSError as error:
            problem = error
    reason = (problem.strerror if problem else None) or str(problem)
    raise OptionError(f"cannot listen on {host} port {port}: {reason}; leave out --port") from None


def _listen(host: str, port: int) -> list[socket.socket]:
    """Sockets on every address that ``host`` stands for, on one port."""
    sockets: list[socket.socket] = []
    try:
        found = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
        for family, kind, protocol, _, address in dict.fromkeys(found):
            if sockets and port == 0:  # the one that the system chose
                address = (address[0], sockets[0].getsockname()[1], *address[2:])
            here = socket.socket(family, kind, protocol)
            sockets.append(here)
            if os.name != "nt":
                here.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                here.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            here.setblocking(False)
            here.bind(address)
            here.listen(128)
    except OSError:
        for here in sockets:
            here.close()
        raise
    return sockets


def _application(
    stage: Served, scene: bytes, clients: set[_Live], is_ours: Callable[[str], bool]
) -> Application:
    page = json.dumps(stage.page(live=True), allow_nan=False)
    texts = {
        "": ("text/html", live_html(f"pinsing: {stage.name}")),
        "page.css": ("text/css", asset("page.css")),
        "page.js": ("text/javascript", script()),
        "meshcat.js": ("text/javascript", meshcat_script()),
        "page.json": ("application/json", page),
        "scene": ("application/octet-stream", scene),
    }
    common = {"is_ours": is_ours}
    return Application(
        [
            (r"/live", _Live, {**common, "stage": stage, "clients": clients}),
            (r"/(.*)", _Part, {**common, "texts": texts}),
        ],
        log_function=lambda handler: None,
        websocket_max_message_size=_LONGEST_MESSAGE,
    )


class _Part(RequestHandler):  # type: ignore[misc,unused-ignore]
    """A file of the page, held in memory."""

    def initialize(
        self, is_ours: Callable[[str], bool], texts: dict[str, tuple[str, str | bytes]]
    ) -> None:
        self.is_ours, self.texts = is_ours, texts

    def prepare(self) -> None:
        if not self.is_ours(self.request.host):
            raise HTTPError(403)

    def set_default_headers(self) -> None:
        self.set_header("Cache-Control", "no-store")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Cross-Origin-Resource-Policy", "same-origin")
        self.set_header("Referrer-Policy", "no-referrer")

    def get(self, name: str) -> None:
        if name not in self.texts:
            raise HTTPError(404)
        kind, content = self.texts[name]
        charset = "; charset=utf-8" if isinstance(content, str) else ""
        self.set_header("Content-Type", kind + charset)
        self.write(content)


class _Live(WebSocketHandler):  # type: ignore[misc,unused-ignore]
    """Answers the questions of one page."""

    def initialize(
        self, is_ours: Callable[[str], bool], stage: Served, clients: set[_Live]
    ) -> None:
        self.is_ours, self.stage, self.clients = is_ours, stage, clients

    def check_origin(self, origin: str) -> bool:
        host = self.request.host
        return self.is_ours(host) and urlsplit(origin).netloc.lower() == host.lower()

    def open(self, *args: str, **kwargs: str) -> None:
        if self.request.headers.get("Origin") is None:
            self.close(1008, "a page of this server is expected")
            return
        self.clients.add(self)

    def on_close(self) -> None:
        self.clients.discard(self)

    def tell(self, text: str) -> None:
        """Send a text, if the page is still there."""
        with contextlib.suppress(WebSocketClosedError):
            # It may still close while the text is on its way: asked for, the failure is no news.
            sent = self.write_message(text)
            sent.add_done_callback(lambda done: done.cancelled() or done.exception())

    def on_message(self, message: str | bytes) -> None:
        number: Any = None
        try:
            request = json.loads(message)
            number = request["id"]
            answer: dict[str, Any] = {"id": number, "answer": self.stage.answer(request)}
        except PinsingError as error:
            answer = {"id": number, "error": str(error)}
        except (ValueError, KeyError, TypeError, RecursionError):
            answer = {"id": number, "error": "this request is not understood"}
        self.tell(json.dumps(answer, allow_nan=False))
