"""The web server of a live page: inside this process, on loopback, gone when it ends.

Its address holds a random token, without which nothing is answered: other users of the computer,
and pages of other sites, cannot guess it. A second token is for notebooks, whose pages frame ours;
under the first no page may do so.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
import threading
from concurrent.futures import Future
from typing import Any
from urllib.parse import urlsplit

from tornado.web import Application

from pinsing.view.door import Door
from pinsing.view.handlers import Content, Live, Nothing, PagePart, Served, Site
from pinsing.view.listen import bind, is_address, is_loopback
from pinsing.view.messages import LONGEST
from pinsing.view.page import LIVE_POLICY, asset, live_html, meshcat_script, script

__all__ = ["Served", "Server", "is_loopback"]

_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_FAREWELL = 0.3
_REQUEST_SECONDS = 4.0
"""How long a request may take to come, from the link or the answer before; no matter for pages."""
_LATER = ("page.json", "scene", "links")


class Server:
    """Serves one stage from a daemon thread.

    Parameters
    ----------
    stage : Served or str
        What is shown; or its name, where it follows by `fill` and pages wait for it.
    scene, links : bytes
        Drawing commands of the scene, and those of the links' shapes.
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
        self,
        stage: Served | str,
        scene: bytes = b"",
        host: str = "127.0.0.1",
        port: int | None = None,
        *,
        links: bytes = b"",
    ) -> None:
        self.host = host
        self._sockets = bind(host, port)
        self.port = int(self._sockets[0].getsockname()[1])
        self._token, self._framed = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
        policies = {
            self._token: f"{LIVE_POLICY}; frame-ancestors 'none'",
            self._framed: LIVE_POLICY,
        }
        self._later: dict[str, Future[Content]] = {name: Future() for name in _LATER}
        name = stage if isinstance(stage, str) else stage.name
        self._site = Site(None, _texts(name, self._later), policies, self._is_ours)
        if not isinstance(stage, str):
            self.fill(stage, scene, links)
        self._loop = asyncio.new_event_loop()
        self._http: Door | None = None
        self._app = Application(
            [
                (r"/([^/]+)/live", Live, {"site": self._site}),
                (r"/([^/]+)/([^/]*)", PagePart, {"site": self._site}),
                (r".*", Nothing, {"site": self._site}),
            ],
            log_function=lambda handler: None,
            websocket_max_message_size=LONGEST,
        )
        ready = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(ready,), name="pinsing view", daemon=True
        )
        self._thread.start()
        ready.wait()

    def fill(self, stage: Served, scene: bytes, links: bytes) -> None:
        """Give what is shown to the pages that wait for it."""
        page = json.dumps(stage.page(live=True), allow_nan=False)
        self._site.stage = stage
        contents: tuple[Content, ...] = (page, scene, links)
        for name, content in zip(_LATER, contents, strict=True):
            self._later[name].set_result(content)

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
        everywhere = self.host in ("", "0.0.0.0", "::")
        host = "127.0.0.1" if everywhere else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}"

    @property
    def pages(self) -> int:
        """How many pages are open."""
        return len(self._site.clients)

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
        self._http = Door(
            self._app,
            max_body_size=LONGEST,
            max_header_size=LONGEST,
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
        for client in list(self._site.clients):
            client.close()
        self._loop.create_task(self._finish())

    async def _finish(self) -> None:
        assert self._http is not None
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._http.close_all_connections(), timeout=_FAREWELL)
        for client in list(self._site.clients):
            client.drop()
        # What waits for a link to take an answer ends with the link.
        others = asyncio.all_tasks() - {asyncio.current_task()}
        if others:
            await asyncio.wait(others, timeout=_FAREWELL)
        self._loop.stop()

    def _broadcast(self, text: str) -> None:
        for client in list(self._site.clients):
            client.tell(text)

    def _is_ours(self, host: str) -> bool:
        """Whether a Host header names this server: other names may be another site's trick."""
        with contextlib.suppress(ValueError):
            parts = urlsplit(f"//{host}")
            name, port = parts.hostname or "", parts.port
            if (80 if port is None else port) != self.port or parts.username is not None:
                return False
            if self.host in _LOOPBACK:
                return name in _LOOPBACK
            return name == self.host or name in _LOOPBACK or is_address(name)
        return False


def _texts(
    title: str, later: dict[str, Future[Content]]
) -> dict[str, tuple[str, Content | Future[Content]]]:
    return {
        "": ("text/html", live_html(f"pinsing: {title}")),
        "begin.js": ("text/javascript", asset("begin.js")),
        "page.css": ("text/css", asset("page.css")),
        "page.js": ("text/javascript", script()),
        "meshcat.js": ("text/javascript", meshcat_script()),
        "page.json": ("application/json", later["page.json"]),
        "scene": ("application/octet-stream", later["scene"]),
        "links": ("application/octet-stream", later["links"]),
    }
