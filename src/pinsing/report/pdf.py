"""A report on paper: Chromium prints it to PDF."""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

from pinsing.errors import OutputError

_SECONDS = 120.0


def check_browser(path: str | os.PathLike[str]) -> str:
    """The browser that will write ``path``, before anything is computed.

    Raises
    ------
    OutputError
        If there is none.
    """
    from pinsing.view.picture import find_browser

    browser = find_browser()
    if browser is None:
        raise OutputError(
            f"cannot write {path}: PDF needs Chromium or Chrome, and none is installed "
            "(apt install chromium, or name one in the variable CHROMIUM); the HTML prints from "
            "any browser"
        )
    return browser


def printed(html: str, path: str | os.PathLike[str]) -> bytes:
    """A page as PDF, meant for ``path``, which is left alone.

    Raises
    ------
    OutputError
        If there is no browser, or it fails.
    """
    browser = check_browser(path)
    with tempfile.TemporaryDirectory(prefix="pinsing-", ignore_cleanup_errors=True) as folder:
        page, out = Path(folder, "report.html"), Path(folder, "report.pdf")
        page.write_text(html, encoding="utf-8")
        arguments = [
            browser,
            "--headless=new",
            f"--user-data-dir={folder}/profile",
            "--disable-gpu",
            "--no-first-run",
            "--no-default-browser-check",
            "--disable-extensions",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--no-pdf-header-footer",
            "--generate-pdf-document-outline",
            f"--print-to-pdf={out}",
        ]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            arguments.append("--no-sandbox")  # Chromium refuses to start as root with it
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
            raise OutputError(f"cannot write {path}: {browser}: {error.strerror}") from None
        data = out.read_bytes() if out.is_file() else b""
        if not data.startswith(b"%PDF"):
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            raise OutputError(
                f"cannot write {path}: the browser printed nothing: "
                f"{lines[-1] if lines else 'no message'}"
            )
    return data
