"""Where a server listens: addresses, ports and sockets."""

from __future__ import annotations

import contextlib
import ipaddress
import os
import socket

from pinsing.errors import OptionError
from pinsing.view.door import Listener

FIRST_PORT = 7000
_TRIED_PORTS = 100


def is_loopback(host: str) -> bool:
    """Whether only this computer can reach a server on ``host``."""
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == "localhost"


def is_address(name: str) -> bool:
    """Whether a host is a bare address, no name."""
    # A bare address cannot be pointed elsewhere by somebody's name server.
    with contextlib.suppress(ValueError):
        ipaddress.ip_address(name)
        return True
    return False


def bind(host: str, port: int | None) -> list[socket.socket]:
    """Return sockets that listen, on one port.

    Raises
    ------
    OptionError
        If the port is taken, or there is no such address.
    """
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
            here = Listener(family, kind, protocol)
            sockets.append(here)
            if os.name != "nt":
                here.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                here.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            here.setblocking(False)
            here.bind(address)
            here.listen(128)
    except OSError:
        for made in sockets:
            made.close()
        raise
    return sockets
