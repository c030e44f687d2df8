"""The line that says what a command does, where that takes longer than it should."""

import time

import pytest

from pinsing.cli import output as module
from pinsing.cli.output import waiting


def test_a_long_step_is_said_once_and_a_short_one_never(capsys: pytest.CaptureFixture[str]) -> None:
    with waiting(after=0.2) as at:
        at("short")
        time.sleep(0.01)
        at("long")
        time.sleep(0.5)
        at("")
        time.sleep(0.3)
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err == "pinsing: long \u2026\n"


def test_on_a_terminal_the_line_counts_and_goes(capsys, monkeypatch):
    monkeypatch.setattr(module, "is_terminal", lambda stream: True)
    with waiting(after=0.05) as at:
        for k in range(26):
            at("long", f"{k} boxes")
            time.sleep(0.05)
    told = capsys.readouterr().err
    assert "pinsing: long \u2026 0 s" in told
    assert "pinsing: long \u2026 1 s 2" in told
    assert told.endswith("\r\x1b[K")
    assert "\n" not in told


def test_an_error_takes_the_line_away(capsys, monkeypatch):
    monkeypatch.setattr(module, "is_terminal", lambda stream: True)

    def interrupted() -> None:
        with waiting(after=0.05) as at:
            at("long")
            time.sleep(0.4)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert capsys.readouterr().err.endswith("\r\x1b[K")
