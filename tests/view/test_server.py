"""The server of a live page against other sites, other users, and tabs that misbehave."""

import contextlib
import errno
import json
import logging
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import meshcat
import pytest
from command_line import soon, started

from pinsing.view.server import (
    _FAREWELL,
    Listener,
    Server,
    asset,
    is_loopback,
    meshcat_script,
    static_html,
)

SECONDS = 120
"""What does not end within these, even on a busy machine, never does."""


OPENED = contextlib.ExitStack()


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    """What a test opens is closed at its end: servers, links, tabs."""
    with OPENED:
        yield


def served(port: int | None = None, filled: bool = True) -> Server:
    """A server, whose page has come where it is filled."""
    made = Server("test", port=port)
    OPENED.callback(made.close)
    if filled:
        made.fill({}, b"scene", b"", lambda: {"q": [0.5]})
    return made


@pytest.fixture
def server() -> Server:
    return served(port=0)


def token(server: Server) -> str:
    return server.url.split("/")[3]


def linked(server: Server, sent: bytes = b"", timeout: float = 5) -> socket.socket:
    link = socket.create_connection(("127.0.0.1", server.port), timeout=timeout)
    OPENED.enter_context(link).sendall(sent)
    return link


def request(server: Server, path: str, **headers: str) -> bytes:
    """A request as given, to our host where no other is."""
    sent = {"Host": f"127.0.0.1:{server.port}", **headers}
    lines = [f"{k.replace('_', '-')}: {v}" for k, v in sent.items() if v]
    return "\r\n".join([f"GET {path} HTTP/1.1", *lines, "", ""]).encode("latin-1")


def upgrading(server: Server, path: str, **headers: str) -> bytes:
    """One that asks for a link, as our page does but for some headers."""
    ours = {"Origin": f"http://127.0.0.1:{server.port}", "Sec_WebSocket_Version": "13"}
    ours |= {"Upgrade": "websocket", "Connection": "Upgrade", "Sec_WebSocket_Key": "A" * 22 + "=="}
    return request(server, path, **ours | headers)


def raw(
    server: Server, path: str, ask: Callable[..., bytes] = request, **headers: str
) -> tuple[int, str]:
    """Send a request; return its status and the head of the answer."""
    head = linked(server, ask(server, path, **headers)).recv(65536).decode("latin-1")
    return int(head.split()[1]), head.split("\r\n\r\n")[0]


def upgrade(server: Server, path: str, **headers: str) -> int:
    return raw(server, path, upgrading, **headers)[0]


def test_the_right_page_gets_through(server):
    key = token(server)
    assert upgrade(server, f"/{key}/live") == 101
    for part in ("", "begin.js", "page.css", "page.js", "meshcat.js", "page.json", "scene"):
        assert raw(server, f"/{key}/{part}")[0] == 200
    assert raw(server, f"/{key}/nothing")[0] == 404
    assert raw(server, f"/{key}/../pyproject.toml")[0] == 403
    assert raw(server, f"/{key}/page.json", Host=f"localhost:{server.port}")[0] == 200
    hosts = ("127.0.0.1", "localhost", "::1", "0.0.0.0", "192.168.1.2")
    assert [is_loopback(host) for host in hosts] == [True] * 3 + [False] * 2
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(f"http://127.0.0.1:{server.port}/", timeout=SECONDS)
    assert "printed in its terminal" in refused.value.read().decode()


def test_only_our_page_gives_a_file(server: Server) -> None:
    given: list[tuple[str, int]] = []

    def read(name: str, content: bytes, degrees: bool | None) -> dict[str, Any]:
        given.append((name, len(content)))
        return {"error": "x" if degrees is None else degrees}

    server.read = read
    ours = f"http://127.0.0.1:{server.port}"

    def post(origin: str, key: str, size: int) -> int:
        address = f"{ours}/{key}/trajectory?name=a.csv&units=deg"
        asked = urllib.request.Request(address, b"1" * size, {"Origin": origin})
        try:
            return int(urllib.request.urlopen(asked, timeout=SECONDS).status)
        except urllib.error.HTTPError as error:
            return error.code

    assert post(ours, token(server), 200_000) == 200  # larger than any other request
    assert post("http://evil.com", token(server), 3) == post(ours, "x", 3) == 403
    assert raw(server, f"/{token(server)}/trajectory", Origin=ours)[0] == 404
    assert given == [("a.csv", 200_000)]


EVIL = {"Host": "evil.com:7000", "Origin": "http://evil.com:7000"}
NONE = {"Sec_Fetch_Site": "none"}


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": ""}, {"Origin": "null"}, {"Origin": "http://["}, {"Origin": "http://evil.com"},
        {"Origin": "http://127.0.0.1:1"}, {"Origin": "", **NONE}, EVIL, {**EVIL, **NONE},
        {"Origin": "http://evil.com", "Sec_Fetch_Site": "same-origin"},
        {"Origin": "", "Sec_Websocket_Origin": "http://127.0.0.1"}, {"Host": "["},
        {"Host": "127.0.0.1"}, {"Host": "127.0.0.1:99999999"}, {"Host": "a@127.0.0.1:7000"},
        {"Host": "127.0.0.1.evil.com:7000"},
    ],
)  # fmt: skip
def test_a_link_from_elsewhere_is_refused_before_it_is_upgraded(server, headers):
    headers = {k: v.replace("7000", str(server.port)) for k, v in headers.items()}
    for path in (f"/{token(server)}/live", "/live"):
        assert upgrade(server, path, **headers) in (400, 403)
    assert len(server.clients) == 0


@pytest.mark.parametrize("path", ["", "live", "page.json", "scene", "/scene", "x/scene", "x/live"])
def test_without_the_token_there_is_nothing(server: Server, path: str) -> None:
    assert raw(server, f"/{path}")[0] == upgrade(server, f"/{path}") == 403


def test_tokens_are_long_and_new_each_time(server: Server) -> None:
    found = {token(server), token(served(port=0)), server.framed_url.split("/")[3]}
    assert [len(text) >= 32 for text in found] == [True] * 3
    wrong = token(server)[:-1] + ("A" if token(server)[-1] != "A" else "B")
    assert raw(server, f"/{wrong}/scene")[0] == 403


def test_headers_keep_the_page_to_itself(server: Server) -> None:
    for path in ("", "page.js", "scene", "nothing"):
        _, head = raw(server, f"/{token(server)}/{path}")
        assert "frame-ancestors 'none'" in head
        assert "Content-Security-Policy: default-src 'none'" in head
        assert "no-referrer" in head
    _, head = raw(server, f"/{token(server)}/")
    assert "connect-src 'self'" in head
    assert "ws:" not in head
    assert "frame-ancestors 'none'" in raw(server, "/")[1]
    framed = server.framed_url.split("/")[3]
    assert "frame-ancestors" not in raw(server, f"/{framed}/")[1]


class Tab:
    """A page that speaks WebSocket over a plain socket."""

    def __init__(self, server: Server, buffer: int | None = None) -> None:
        self.link = OPENED.enter_context(socket.socket())
        if buffer is not None:
            self.link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
        self.link.settimeout(10)
        self.link.connect(("127.0.0.1", server.port))
        self.link.sendall(upgrading(server, f"/{token(server)}/live"))
        self.answer = OPENED.enter_context(self.link.makefile("rb"))
        assert b"101" in b"".join(iter(self.answer.readline, b"\r\n"))

    def read(self) -> dict[str, Any]:
        first, size = self.answer.read(2)
        assert first == 0x81
        if size > 125:
            size = int.from_bytes(self.answer.read(2 if size == 126 else 8), "big")
        found: dict[str, Any] = json.loads(self.answer.read(size))
        return found


def test_a_page_is_told_where_to_start_and_says_nothing_itself(server: Server) -> None:
    tab, other = Tab(server), Tab(server)
    assert tab.read() == other.read() == {"q": [0.5]}
    tab.link.sendall(b"\x81\x83" + bytes(4) + b"any")  # a message of three letters
    assert tab.answer.read() == b""  # no page of ours
    server.send({"shown": 1})
    assert other.read() == {"shown": 1}


def test_tabs_that_do_not_read_harm_nobody_else(server: Server) -> None:
    for _ in range(5):  # which stay open
        Tab(server, buffer=4096)
    good = Tab(server)
    assert "q" in good.read()
    for _ in range(50):
        server.send({"shown": "x" * 1_000_000})
        assert "shown" in good.read()
    assert len(server.clients) == 1
    server.close()
    # It has ended by itself, after two waits: ``close`` does not wait for ever.
    assert not server._thread.is_alive()
    assert 2 * _FAREWELL < 1


def test_more_tabs_than_anyone_opens_are_refused(server: Server, monkeypatch: Any) -> None:
    monkeypatch.setattr("pinsing.view.server.MOST_PAGES", 3)
    for _ in range(3):
        Tab(server)
    assert upgrade(server, f"/{token(server)}/live") == 503


def what_comes(link: socket.socket) -> bytes:
    """The first letters of an answer, or none."""
    try:
        return link.recv(10)
    except ConnectionError:
        return b""


@pytest.mark.parametrize(
    "request_text",
    [
        "GET / HTTP/1.1\r\nHost: 127.0.0.1:" + "9" * 5000 + "\r\n\r\n",
        "GET /%ff/live HTTP/1.1\r\nHost: 127.0.0.1:1\r\n\r\n",
        "POST /x/ HTTP/1.1\r\nHost: 127.0.0.1:1\r\nContent-Type: multipart/form-data; boundary=x"
        "\r\nContent-Length: 4\r\n\r\n--x\r",
        "\x16\x03\x01\x02\r\n\r\n",
    ],
    ids=["long port", "no text", "no form", "TLS"],
)
def test_what_is_no_request_leaves_no_line_in_the_log(request_text, server, caplog):
    link = linked(server, request_text.encode("latin-1"))
    assert what_comes(link) in (b"", b"HTTP/1.1 4")
    assert raw(server, f"/{token(server)}/")[0] == 200
    assert not [r for r in caplog.records if r.levelno >= logging.WARNING]


HALF = (
    b"", b"GET /", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n",
    b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\nx",
)  # fmt: skip


def test_half_open_links_lock_nobody_out_and_are_dropped(monkeypatch: Any, caplog: Any) -> None:
    monkeypatch.setattr("pinsing.view.server._MOST_LINKS", 5)
    monkeypatch.setattr("pinsing.view.server._REQUEST_SECONDS", 1.5)
    server = served()
    tabs = [Tab(server) for _ in range(7)]  # pages are counted by themselves
    held = [linked(server, half, 10) for half in HALF * 60]
    begun = time.monotonic()
    assert [what_comes(link) for link in held[:3]] == [b""] * 3  # the oldest make room
    for _ in range(3):
        assert raw(server, f"/{token(server)}/")[0] == 200
    assert time.monotonic() - begun < 1
    for link in held:  # a slow one is dropped,
        what_comes(link)
    assert time.monotonic() - begun < 8
    soon(lambda: server._http is not None and not server._http._held, 5)
    server.send({"shown": 1})  # a page is not
    for tab in tabs:
        assert [tab.read(), tab.read()] == [{"q": [0.5]}, {"shown": 1}]
    assert not caplog.records


def test_the_viewer_comes_with_the_licences_of_what_is_in_it(server: Server) -> None:
    static = static_html("page", {}, b"", b"")
    for text in (static, server.texts["meshcat.js"][1]):
        for words in ("2010-2021 three.js authors", "Robin Deits", "Apache License", "AS IS"):
            assert words in text
    script = Path(meshcat.__file__).parent / "viewer/dist/main.js"  # as the page's, with its parts
    parts = set(re.findall(r"\./node_modules/([^/]+)/", script.read_text(encoding="utf-8")))
    assert len(parts) == 10
    named = re.findall(r"[\w.-]+(?= \d+\.\d+\.\d+ \()", asset("licences.txt"))
    assert parts - {"three"} <= {*named} >= {"three.js"}
    code = meshcat_script()
    assert code.startswith("/*\n")
    assert code.index("*/") == len("/*\n" + asset("licences.txt"))  # the comment ends where it must


def test_a_process_out_of_files_says_nothing_and_takes_up_again(monkeypatch: Any) -> None:
    taken: list[bool] = []
    accept = socket.socket.accept

    def refused(self: socket.socket) -> Any:
        taken.append(True)
        if len(taken) < 4:
            raise OSError(errno.EMFILE, "Too many open files")
        return accept(self)

    listener = OPENED.enter_context(Listener())
    monkeypatch.setattr(socket.socket, "accept", refused)
    for _ in range(3):
        with pytest.raises(BlockingIOError):
            listener.accept()
    listener.bind(("127.0.0.1", 0))
    listener.listen()
    with socket.create_connection(listener.getsockname(), timeout=5) as link:
        there, address = listener.accept()
        assert address == link.getsockname()
        there.close()


@pytest.fixture
def command() -> Iterator[tuple[subprocess.Popen[str], SimpleNamespace]]:
    """A page shown by the command line, and its address and port."""
    process = started("-m", "pinsing", "view", "scara", "--skeleton", "--no-open")
    url = process.stdout.readline().strip()
    yield process, SimpleNamespace(url=url, port=urllib.parse.urlsplit(url).port)
    process.kill()
    process.communicate()


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_signal_ends_a_page_with_tabs_open(command, how: signal.Signals) -> None:
    """Tabs that stay, and a request that never ends, do not hold it; nothing is left behind."""
    page, there = command
    children = Path(f"/proc/{page.pid}/task/{page.pid}/children")
    assert not children.exists() or not children.read_text().split()
    for _ in range(5):
        Tab(there)
    linked(there, b"GET / HTTP/1.1\r\n")
    page.send_signal(how)
    said = page.communicate(timeout=SECONDS)[1]
    with pytest.raises(ConnectionRefusedError):
        linked(there)
    if how != signal.SIGKILL:
        assert page.returncode == 0
        assert said.splitlines()[-1] == "pinsing: ended"


@pytest.mark.skipif(not Path("/proc/self/net/tcp").exists(), reason="Linux")
def test_no_port_is_open_but_the_one(command) -> None:
    process, there = command
    assert urllib.request.urlopen(there.url).status == 200
    files = Path(f"/proc/{process.pid}/fd").iterdir()
    mine = {os.readlink(file) for file in files if file.is_socket()}
    tables = (Path(f"/proc/{process.pid}/net/{name}").read_text() for name in ("tcp", "tcp6"))
    rows = [line.split() for table in tables for line in table.splitlines()[1:]]
    listening = [row[1] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in mine]
    assert listening == [f"0100007F:{there.port:04X}"]


def test_a_page_that_comes_early_waits_for_what_it_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "resource", None)  # as where there is none
    server = served(port=0, filled=False)
    assert raw(server, f"/{token(server)}/")[0] == 200
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(raw, server, f"/{token(server)}/page.json")
        assert wait([asked], 0.2).not_done
        tab = Tab(server)
        server.fill({}, b"scene", b"links", lambda: {"q": [0.5]})
        assert asked.result(5)[0] == 200
        assert tab.read() == {"q": [0.5]}


def test_a_page_that_waits_is_told_when_nothing_comes() -> None:
    server = served(port=0, filled=False)
    link = linked(server, request(server, f"/{token(server)}/scene"), 0.2)
    with pytest.raises(TimeoutError):
        link.recv(1)
    server.close()
    link.settimeout(10)
    assert link.recv(65536)[:12] in (b"", b"HTTP/1.1 503")
