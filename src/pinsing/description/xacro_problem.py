"""What went wrong in a xacro file, in one line with file and line.

Runs in the xacro child process only.
"""

from __future__ import annotations

import os
import re
from typing import Any
from xml.parsers import expat

from pinsing.description.xacro_places import Places, RefusedAt
from pinsing.description.xacro_values import Refused

_QUOTED = re.compile(r"'([^'\n]+)'|\"([^\"\n]+)\"")
_LONGEST_SHOWN = 120


def explain(error: BaseException, xacro: Any, places: Places) -> dict[str, Any]:
    """Turn an exception into problem, file and line."""
    errors = causes(error)
    files = list(
        dict.fromkeys(f for f in [macro_file(xacro), (xacro.filestack or [None])[-1]] if f)
    )
    problem = ""
    for found in errors:
        if isinstance(found, expat.ExpatError):
            problem = f"is not well-formed XML: {expat.ErrorString(found.code)}"
            return {"problem": problem, "file": files[-1] if files else None, "line": found.lineno}
        if isinstance(found, RefusedAt):
            return {"problem": str(found), "file": found.file, "line": found.line}
        if isinstance(found, Refused):
            problem = str(found)
        elif isinstance(found, RecursionError):
            problem = "macros, includes or elements without end (nested too deeply)"
        elif isinstance(found, MemoryError):
            problem = "an expression needs too much memory"
        elif isinstance(found, OSError) and found.filename:
            problem = f"cannot open {found.filename}: {found.strerror}"
    if not problem:
        problem = " ".join(str(errors[-1]).split()) or type(errors[-1]).__name__
    suffixes = [" ".join(str(getattr(e, "suffix", None) or "").split()) for e in errors]
    expressions = [suffix for suffix in suffixes if suffix]
    if expressions and expressions[-1] not in problem:
        problem += " " + _cut(expressions[-1])
    wanted = needles(" ".join([str(e) for e in errors] + [problem]), error)
    file, line = locate(files, wanted, places)
    return {"problem": f"xacro: {problem}", "file": file, "line": line}


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 4] + "...'"


def causes(error: BaseException) -> list[BaseException]:
    """Return an error and what caused it, outermost first (xacro keeps causes in ``exc``)."""
    errors: list[BaseException] = []
    current: BaseException | None = error
    while current is not None and current not in errors:
        errors.append(current)
        current = getattr(current, "exc", None) or current.__cause__
    return errors


def macro_file(xacro: Any) -> str | None:
    """Return the file that defines the innermost macro being expanded."""
    stack = xacro.macrostack or []
    return stack[-1].history[-1][-1] if stack and stack[-1].history else None


def needles(message: str, error: BaseException) -> list[str]:
    """Return what to look for in the source to find the line that a message speaks of."""
    expressions = re.findall(r"evaluating expression '([^\n]*?)'(?:\s|$)", message)
    found = [start + text for text in expressions for start in ("${", "$(eval ")]
    names = re.findall(r"unknown macro name: xacro:(\S+)", message)
    names += [macro.body.getAttribute("name") for macro in getattr(error, "macros", [])]
    found += [f"<xacro:{name}{end}" for name in names for end in " />"]
    found += [
        f"$({command} {name})" for name in _texts(message) for command in ("arg", "find", "env")
    ]
    found += [os.path.basename(m) for m in re.findall(r"cannot open (\S+):", message)]
    return [n for n in found + _texts(message) if n]


def _texts(message: str) -> list[str]:
    return [a or b for a, b in _QUOTED.findall(message)]


def locate(files: list[str], wanted: list[str], places: Places) -> tuple[str | None, int | None]:
    """Return file and line of the first wanted text that stands on one line only.

    A text that occurs twice is looked for in the element that was being expanded, the one that
    occurs nowhere stands for that element.
    """
    current = places.current
    for needle in wanted:
        for file in files:
            lines = places.texts.get(file, "").splitlines()
            hits = [i for i, line in enumerate(lines, 1) if needle in line]
            if len(hits) == 1:
                return file, hits[0]
            if current is not None and file == current[0]:
                inside = [i for i in hits if current[1] <= i <= current[2]]
                if inside:
                    return file, inside[0]
    if current is not None:
        return current[0], current[1]
    return (files[-1] if files else None), None
