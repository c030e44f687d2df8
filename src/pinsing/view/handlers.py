"""What the server of a live page answers: files of the page, and a link over which it is led.

Every request must come to the right host, under an address that holds one of the server's tokens;
a link must come from a page of this server as well. All of that is judged before anything is read
or upgraded.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, Protocol

from tornado.iostream import StreamClosedError
from tornado.web import HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

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
    """What all requests share.

    Attributes
    ----------
    stage : Served or None
        What is shown, once it is there.
    texts : Mapping
        Type and content of the page's files, by name; some contents are still to come.
    policies : Mapping
        Content security policy of pages, by the token in their address.
    is_ours : callable
        Whether a Host header names this server.
    clients : set
        Links that are open.
    """

    stage: Served | None
    texts: Mapping[str, tuple[str, Content | Future[Content]]]
    policies: Mapping[str, str]
    is_ours: Callable[[str], bool]
    clients: set[Live] = field(default_factory=set)

    def policy(self, host: str, token: str) -> str:
        """Return the policy for a request.

        Raises
        ------
        HTTPError
            403 for a wrong host or token.
        """
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

    def log_exception(self, *error: Any) -> None:
        """Log faults of our own only."""
        if not isinstance(error[1], HTTPError):
            super().log_exception(*error)


class PagePart(_Quiet):
    """A file of the page, held in memory."""

    def prepare(self) -> None:
        """Judge host and token."""
        policy = self.site.policy(self.request.host, self.path_args[0] or "")
        self.set_header("Content-Security-Policy", policy)

    def set_default_headers(self) -> None:
        """Keep the page out of caches, and its address to itself."""
        self.set_header("Cache-Control", "no-store")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Cross-Origin-Resource-Policy", "same-origin")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Content-Security-Policy", "default-src 'none'; frame-ancestors 'none'")

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


class Live(_Quiet, WebSocketHandler):  # type: ignore[misc,unused-ignore]
    """Tells one page what to show; a page says nothing, for it computes all by itself."""

    def prepare(self) -> None:
        """Judge host, token and origin, before anything is upgraded."""
        host = self.request.host
        self.site.policy(host, self.path_args[0] or "")
        origin = self.request.headers.get("Origin", "").lower()
        if origin not in (f"http://{host}".lower(), f"https://{host}".lower()):
            raise HTTPError(403)
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
