"""Chromium without a window: pictures of a page, through its debugging protocol, and PDF."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import itertools
import json
import os
import re
import shutil
import subprocess
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from pinsing.atomic_write import check_writable, write_bytes
from pinsing.errors import OptionError, OutputError, why

BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "microsoft-edge",
    "brave-browser",
)
"""Programs that are looked for, in this order; the variable CHROMIUM names another one."""

_APPS = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
)
_SECONDS = 120.0


def find_browser() -> str | None:
    """Path of a Chromium or Chrome, None where there is none."""
    for name in (os.environ.get("CHROMIUM", ""), *BROWSERS, *_APPS):
        found = shutil.which(name) if name else None
        if found:
            return found
    return None


def take_picture(url: str, path: str | os.PathLike[str], size: tuple[int, int]) -> None:
    """Write a page, once drawn, as PNG; OptionError for the size, OutputError for all else."""
    OptionError.refuse_if(
        not all(16 <= side <= 8192 for side in size),
        f"the size of a picture must be within 16 and 8192 pixels, got {size}",
    )
    path = check_writable(path)
    browser = check_browser(path, "a picture", "-o FILE.html needs none")
    try:
        picture = _taken(browser, url, size)
    except (OSError, asyncio.TimeoutError) as error:  # it may not start, or say no more
        said = why(error) or f"no picture within {_SECONDS:g} s"
        raise OutputError(f"cannot write {path}: {browser}: {said}") from None
    write_bytes(path, picture)


def check_browser(
    path: str | os.PathLike[str],
    what: str = "PDF",
    instead: str = "the HTML prints from any browser",
) -> str:
    """Return the browser that will write ``path``; OutputError, before any work, if none."""
    browser = find_browser()
    if browser is None:
        raise OutputError(
            f"cannot write {path}: {what} needs Chromium or Chrome, and none is installed "
            f"(apt install chromium, or name one in the variable CHROMIUM); {instead}"
        )
    return browser


def printed(html: str, path: str | os.PathLike[str]) -> bytes:
    """Return a page as PDF, for ``path`` in messages; OutputError without a working browser."""
    browser = check_browser(path)
    with tempfile.TemporaryDirectory(prefix="pinsing-", ignore_cleanup_errors=True) as folder:
        page, out = Path(folder, "report.html"), Path(folder, "report.pdf")
        page.write_text(html, encoding="utf-8")
        arguments = [
            *(browser, *_arguments(f"{folder}/profile")),
            "--disable-gpu",
            "--no-pdf-header-footer",
            "--generate-pdf-document-outline",
            f"--print-to-pdf={out}",
        ]
        try:
            done = subprocess.run(
                [*arguments, page.as_uri()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                timeout=_SECONDS,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise OutputError(
                f"cannot write {path}: the browser did not print within {_SECONDS:g} s"
            ) from None
        except OSError as error:
            raise OutputError(f"cannot write {path}: {browser}: {why(error)}") from None
        data = out.read_bytes() if out.is_file() else b""
        if not data.startswith(b"%PDF"):
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            raise OutputError(
                f"cannot write {path}: the browser printed nothing: "
                f"{lines[-1] if lines else 'no message'}"
            )
    return data


def _taken(browser: str, url: str, size: tuple[int, int]) -> bytes:
    """The picture, as PNG."""
    # The profile may still be written to for a moment after the end.
    with tempfile.TemporaryDirectory(prefix="pinsing-", ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            [
                *(browser, *_arguments(profile)),
                "--remote-debugging-port=0",
                f"--window-size={size[0]},{size[1]}",
                "--use-gl=angle",
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
                "--hide-scrollbars",
                "--mute-audio",
                "about:blank",
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        try:
            address = _debugging_address(process, Path(profile))
            work = asyncio.wait_for(_capture(address, url, size), _SECONDS)
            with ThreadPoolExecutor(1) as pool:  # a loop may be running here (a notebook)
                return pool.submit(asyncio.run, work).result()
        except BaseException:
            process.kill()
            raise
        finally:
            try:
                process.communicate(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()


def _arguments(profile: str) -> list[str]:
    arguments = [
        "--headless=new",
        f"--user-data-dir={profile}",
        "--no-first-run",
        "--no-default-browser-check",
        "--disable-extensions",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
    ]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        arguments.append("--no-sandbox")  # Chromium refuses to start as root with it
    return arguments


def _debugging_address(process: subprocess.Popen[bytes], profile: Path) -> str:
    """Wait for the file in which the browser says where it listens."""
    file = profile / "DevToolsActivePort"
    limit = time.monotonic() + 30
    while time.monotonic() < limit:
        if process.poll() is not None:
            assert process.stderr is not None
            said = process.stderr.read().decode(errors="replace").strip().splitlines()
            raise OutputError(f"the browser ended at once: {said[-1] if said else 'no message'}")
        with contextlib.suppress(OSError):
            match = re.fullmatch(r"(\d+)\n(/\S+)\s*", file.read_text())
            if match:
                return f"ws://127.0.0.1:{match.group(1)}{match.group(2)}"
        time.sleep(0.05)
    raise OutputError("the browser did not start within 30 s")


async def _capture(address: str, url: str, size: tuple[int, int]) -> bytes:
    from tornado.websocket import websocket_connect

    socket = await websocket_connect(address, max_message_size=256 * 1024 * 1024)
    numbers = itertools.count(1)

    async def ask(method: str, session: str | None = None, **parameters: Any) -> Any:
        """Ask a numbered question, and wait for the answer of that number."""
        message = {"id": next(numbers), "method": method, "params": parameters}
        if session is not None:
            message["sessionId"] = session
        await socket.write_message(json.dumps(message))
        while True:
            text = await socket.read_message()
            if text is None:
                raise OutputError("the browser ended before the picture was taken")
            answer = json.loads(text)
            if answer.get("id") == message["id"]:
                if "error" in answer:
                    raise OutputError(f"the browser refused {method}: {answer['error']}")
                return answer["result"]

    target = (await ask("Target.createTarget", url="about:blank"))["targetId"]
    session = (await ask("Target.attachToTarget", targetId=target, flatten=True))["sessionId"]
    await ask(
        "Emulation.setDeviceMetricsOverride",
        session,
        width=size[0],
        height=size[1],
        deviceScaleFactor=1,
        mobile=False,
    )
    await ask("Page.navigate", session, url=url)
    limit = time.monotonic() + _SECONDS - 10
    ready = (
        "document.body && (document.body.dataset.ready || "
        "(document.getElementById('busy')?.textContent.startsWith('The page cannot') && 'failed'))"
    )
    while True:
        found = await ask("Runtime.evaluate", session, expression=ready)
        value = found["result"].get("value")
        if value == "yes":
            break
        OutputError.refuse_if(
            value == "failed" or time.monotonic() > limit, "the page did not come up in the browser"
        )
        await asyncio.sleep(0.1)
    # Two frames later the last change is on the screen.
    settle = "new Promise(r => requestAnimationFrame(() => requestAnimationFrame(() => r(1))))"
    await ask("Runtime.evaluate", session, expression=settle, awaitPromise=True)
    shot = await ask("Page.captureScreenshot", session, format="png")
    # Asked to, the browser ends its own children as well.
    await socket.write_message(json.dumps({"id": 0, "method": "Browser.close"}))
    while await socket.read_message() is not None:
        pass
    socket.close()
    return base64.b64decode(shot["data"])
