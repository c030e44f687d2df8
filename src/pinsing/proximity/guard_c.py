"""A guard in C99."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence

import numpy as np

from pinsing.proximity.guard_source import COMBINED, PLACE, GuardSource, plain, template

_WIDTH = 96


def c_text(source: GuardSource) -> str:
    """The header, ASCII only."""
    c, p = source.conditions, source.prefix
    families = [f"{name}: {text}" for name, text in source.families]
    parts = {
        "head": _comment([f"Guard of {source.robot}; task {source.task}.", *_made(source)]),
        "notes": _comment(
            [
                *(f"Note: {note}" for note in source.notes),
                "Families:" if families else "Families: none.",
                *(f"  {line}" for line in families),
            ],
            first="",
        ),
        "joints": str(len(source.joints)),
        "families": str(len(families)),
        "equations": str(len(c.noise)),
        "complete": str(int(source.complete)),
        "word": _string(source.word),
        "version": _string(source.version),
        "hash": _string(source.robot_hash),
        "tolerance": _number(source.tolerance),
        "change": _number(source.change),
        "combined": str(COMBINED),
        "branches": str(c.branches),
        "name_tables": "\n".join(
            [
                _strings(f"{p}_joint_name", source.joints),
                _strings(f"{p}_family_name", [name for name, _ in source.families]),
                _strings(f"{p}_family_text", [text for _, text in source.families]),
            ]
        ),
        "limit_tables": "\n".join(
            [_reals(f"{p}_lower_limit", source.lower), _reals(f"{p}_upper_limit", source.upper)]
        ),
        "metric_tables": "\n".join([_reals(f"{p}_weight", c.weight), _reals(f"{p}_turn", c.turn)]),
        "branch_tables": "\n".join(
            [
                _whole(f"{p}_branch_family", c.family),
                _whole(f"{p}_value_start", c.value_start),
                _whole(f"{p}_value_joint", c.value_joint),
                _reals(f"{p}_value", c.value),
                _whole(f"{p}_equation_start", c.equation_start),
            ]
        ),
        "equation_tables": "\n".join(
            [
                _whole(f"{p}_term_start", c.term_start),
                _reals(f"{p}_noise", c.noise),
                _reals(f"{p}_reach", c.reach),
                _reals(f"{p}_curvature", c.curvature),
                _reals(f"{p}_steepness", c.steepness),
                _whole(f"{p}_sliding", c.sliding.astype(np.int64)),
                _reals(f"{p}_amplitude", c.amplitude),
                _reals(f"{p}_phase", c.phase),
                _reals(f"{p}_rate_norm", c.rate_norm),
                _whole(f"{p}_rate_start", c.rate_start),
                _whole(f"{p}_rate_joint", c.rate_joint),
                _reals(f"{p}_rate", c.rate),
                _whole(f"{p}_power_start", c.power_start),
                _whole(f"{p}_power_joint", c.power_joint),
                _whole(f"{p}_power", c.power),
            ]
        ),
    }
    text = template("guard.h.in").replace("@p@", p).replace("@P@", p.upper())
    # Each place is looked for in the template, not in what was put in before.
    pieces = PLACE.split(text)
    pieces[1::2] = [parts[key] for key in pieces[1::2]]
    return "".join(pieces)


def _made(source: GuardSource) -> list[str]:
    return [
        f"Made by pinsing {source.version}; do not edit, export it again.",
        f"Robot hash {source.robot_hash}, length scale {source.length_scale:g} m.",
    ]


def _comment(lines: Iterable[str], first: str = " * ") -> str:
    """Lines inside of a comment, which none of them ends."""
    out = [" *"] if not first else []
    for line in lines:
        text = plain(line)
        for mark, instead in (("*/", "* /"), ("/*", "/ *"), ("??", "? ?")):
            while mark in text:
                text = text.replace(mark, instead)
        indent = " * " + " " * (len(line) - len(line.lstrip()))
        wrapped = textwrap.wrap(
            text.strip(), _WIDTH, initial_indent=indent, subsequent_indent=indent + "  "
        )
        # Breaking a line must not put together what was taken apart, nor end it in a backslash.
        out += [part + "." if part.endswith("\\") else part for part in wrapped]
    return "\n".join(out)


def _string(text: str) -> str:
    """A string literal: any byte beside plain letters as three octal digits."""
    out = ""
    for byte in text.encode("utf-8", "backslashreplace"):
        letter = chr(byte)
        safe = 32 <= byte < 127 and letter not in '"\\?'
        out += letter if safe else f"\\{byte:03o}"
    return f'"{out}"'


def _strings(name: str, values: Sequence[str]) -> str:
    lines = [_string(v) for v in values] or ['""']
    body = ",\n    ".join(lines)
    return f"static const char *const {name}[] = {{\n    {body}\n}};"


def _number(value: float) -> str:
    if math.isinf(value):
        return "HUGE_VAL" if value > 0 else "-HUGE_VAL"
    return repr(float(value))


def _reals(name: str, values: Iterable[float]) -> str:
    return _table("double", name, [_number(v) for v in values] or ["0.0"])


def _whole(name: str, values: Iterable[int]) -> str:
    return _table("int", name, [str(int(v)) for v in values] or ["0"])


def _table(kind: str, name: str, words: Sequence[str]) -> str:
    head = f"static const {kind} {name}[] = {{"
    line = f"{head} {', '.join(words)} }};"
    if len(line) <= _WIDTH:
        return line
    body = textwrap.fill(", ".join(words), _WIDTH, initial_indent="    ", subsequent_indent="    ")
    return f"{head}\n{body}\n}};"
