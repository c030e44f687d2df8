"""Where things go: results to stdout or a file, all else to stderr."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pinsing.atomic_write import write_text
from pinsing.prose import Page, is_terminal, safe, shows_colour, visible

if TYPE_CHECKING:
    from pinsing.serialization import JsonResult

STDOUT = "-"
_NOT_ASCII = re.compile(r"[^\x00-\x7e]")

STOPPED = 130
"""Exit code after Ctrl-C, as shells have it."""


def emit(text: str) -> None:
    """Print a result; what it was painted with goes to terminals alone."""
    print(safe(text, painted=shows_colour(sys.stdout)))


def emit_lines(text: str) -> None:
    """Print a result that is finished text, wrapped to the width of the terminal."""
    emit(Page.of().fitted(text))


def say(text: str) -> None:
    """Print a message that is no result."""
    _tell(f"pinsing: {visible(text)}")


def complain(text: str) -> None:
    """Print an error, in one line whatever a parser had to say."""
    _tell(f"pinsing: error: {' '.join(text.split())}")


def _tell(text: str) -> None:
    """One line on stderr; on a terminal as many as it takes, broken between words."""
    if is_terminal(sys.stderr):
        click.echo(Page.of(sys.stderr).paragraph(text, rest="  "), err=True)
    else:
        click.echo(safe(text), err=True)


def emit_json(result: JsonResult, target: str | Path | None) -> bool:
    """Write JSON where it was asked for; tell whether stdout is taken by it."""
    return target is not None and emit_json_data(result.to_dict(), target)


def emit_json_data(data: Mapping[str, Any], target: str | Path | None) -> bool:
    """Write plain data as JSON; as `emit_json`."""
    if target is None:
        return False
    text = json.dumps(data, indent=2, allow_nan=False, ensure_ascii=False)
    # Marks that turn or hide text have no place in a terminal; JSON has another way to write them.
    text = _NOT_ASCII.sub(lambda c: c[0] if c[0].isprintable() else json.dumps(c[0])[1:-1], text)
    if target == STDOUT:
        click.echo(text)
        return True
    write_text(target, text + "\n")
    say(f"wrote {target}")
    return False
