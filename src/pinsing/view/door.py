"""The way into a server: how many links are held at once, and what is no request at all.

Whatever comes here may be from anyone on this computer, before host and token are judged. None of
it is worth a line in the log, and none may cost the process its last open file.
"""

from __future__ import annotations

import errno
import socket
import sys
import time
from collections.abc import Callable
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPInputError, HTTPMessageDelegate

_MOST_LINKS = 512
_LONGEST_HOST = 300  # of a name, 253 at most, and a port
_NO_FILES = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM})
_PAUSE = 0.05


class Listener(socket.socket):
    """A socket that waits, and says nothing, while no file can be opened."""

    def accept(self) -> tuple[socket.socket, Any]:
        """Take a link, if there is one and room for it."""
        try:
            return super().accept()
        except OSError as error:
            if error.errno not in _NO_FILES:
                raise
            time.sleep(_PAUSE)  # it is asked again and again until some are closed
            raise BlockingIOError from None


class Door(HTTPServer):  # type: ignore[misc,unused-ignore]
    """A server that holds a limited number of links.

    One more takes the place of the link that has waited longest without a request: links that say
    nothing keep nobody out. Where all are being answered, it is dropped.
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
            super().start_request(server_conn, request_conn),
            lambda: self._silent.pop(stream, None),
        )


class _Request(HTTPMessageDelegate):  # type: ignore[misc,unused-ignore]
    """Passes a request on, but for one that tornado itself stumbles over."""

    def __init__(self, then: HTTPMessageDelegate, complete: Callable[[], object]) -> None:
        self._then, self._complete = then, complete

    def headers_received(self, start_line: Any, headers: Any) -> Any:
        if len(headers.get("Host", "")) > _LONGEST_HOST:
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
    if sys.platform == "win32":
        return _MOST_LINKS
    import resource

    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return _MOST_LINKS if files == resource.RLIM_INFINITY else min(_MOST_LINKS, files // 2)
