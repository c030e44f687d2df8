"""A guard for control loops: families as one file without dependencies, in C or in Python."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing._version import __version__
from pinsing.algebra.conditions import Conditions
from pinsing.arguments import checked
from pinsing.errors import OptionError
from pinsing.families import ClosedForm, Family, closed_form
from pinsing.kinematics.verdict import fingerprint
from pinsing.prose import visible
from pinsing.proximity.watched import Forms, every_name, require_forms_of, watch
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import nominal

PLACE = re.compile("@([a-z_]+)@")
"""Where something is put into a template."""

COMBINED = 12
"""Equations of a branch that are combined into one bound."""


@dataclass(frozen=True, eq=False)
class GuardSource:
    """What goes into the file.

    Attributes
    ----------
    prefix : str
        What names begin with.
    robot, task : str
        In words.
    length_scale : float
        Metres.
    version, robot_hash : str
        Of pinsing, and of the numbers of the arm.
    tolerance : float
        Radians: the most that an angle of the description was moved by.
    change : float
        The most that this changes a column of the Jacobian by.
    joints : tuple of str
        Base to tip.
    lower, upper : (n,) arrays
        Limits, infinite where there are none.
    families : tuple of (str, str)
        Name and text of each.
    conditions : Conditions
        Of these families.
    complete : bool
        Whether nothing is known to be missing.
    word : str
        How sure that is: "proven", "probable" or "not complete".
    notes : tuple of str
        What one should know.
    """

    prefix: str
    robot: str
    task: str
    length_scale: float
    version: str
    robot_hash: str
    tolerance: float
    change: float
    joints: tuple[str, ...]
    lower: Array
    upper: Array
    families: tuple[tuple[str, str], ...]
    conditions: Conditions
    complete: bool
    word: str
    notes: tuple[str, ...]


def template(name: str) -> str:
    """The part of the file that is the same for all robots."""
    return (Path(__file__).parent / "templates" / name).read_text(encoding="ascii")


def plain(text: str) -> str:
    """A text in ASCII, on one line."""
    readable = text.replace("°", " deg").replace("±", "+-").replace("π", "pi")
    return visible(readable).encode("ascii", "backslashreplace").decode("ascii")


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


def python_text(source: GuardSource) -> str:
    """The module, ASCII only."""
    c = source.conditions
    constants: dict[str, Any] = {
        "ROBOT": source.robot,
        "TASK": source.task,
        "LENGTH_SCALE": source.length_scale,
        "VERSION": source.version,
        "ROBOT_HASH": source.robot_hash,
        "JOINTS": source.joints,
        "LOWER": source.lower.tolist(),
        "UPPER": source.upper.tolist(),
        "FAMILIES": [name for name, _ in source.families],
        "TEXTS": [text for _, text in source.families],
        "COMPLETE": source.complete,
        "WORD": source.word,
        "NOTES": source.notes,
        "TOLERANCE": source.tolerance,
        "JACOBIAN_CHANGE": source.change,
        "WEIGHT": c.weight.tolist(),
        "TURN": c.turn.tolist(),
    }
    said = {
        "COMPLETE": "False: families are known to be missing, so that clearance is always 0",
        "WORD": "that FAMILIES are all of them is proven, probable, or not complete; see NOTES",
        "TOLERANCE": "radians: angles of the description were moved by at most this",
        "JACOBIAN_CHANGE": "which changes no column of the Jacobian by more than this",
        "WEIGHT": "what joint differences are multiplied by",
        "TURN": "a whole turn, weighted; 0 for joints that slide",
        "LOWER": "radians and metres; infinite where there is no limit",
    }
    lines = []
    for key, value in constants.items():
        if key in said:
            lines.append(f"# {said[key]}")
        lines.append(f"{key} = {_literal(value)}")
    branches = [
        (
            int(c.family[b]),
            tuple(
                (int(c.value_joint[i]), float(c.value[i]))
                for i in range(c.value_start[b], c.value_start[b + 1])
            ),
            tuple(range(int(c.equation_start[b]), int(c.equation_start[b + 1]))),
        )
        for b in range(c.branches)
    ]
    parts = {
        "constants": "\n".join(lines),
        "branches": _rows(branches),
        "equations": _rows([_equation(c, e) for e in range(len(c.noise))]),
        "combined": str(COMBINED),
    }
    # Each place is looked for in the template, not in what was put in before.
    pieces = PLACE.split(template("guard.py.in"))
    pieces[1::2] = [parts[key] for key in pieces[1::2]]
    return "".join(pieces)


def _equation(c: Conditions, e: int) -> tuple[object, ...]:
    terms = []
    for t in range(c.term_start[e], c.term_start[e + 1]):
        rates = range(c.rate_start[t], c.rate_start[t + 1])
        powers = range(c.power_start[t], c.power_start[t + 1])
        terms.append(
            (
                float(c.amplitude[t]),
                float(c.phase[t]),
                float(c.rate_norm[t]),
                tuple((int(c.rate_joint[k]), float(c.rate[k])) for k in rates),
                tuple((int(c.power_joint[k]), int(c.power[k])) for k in powers),
            )
        )
    curvature = None if c.sliding[e] else float(c.curvature[e])
    return float(c.noise[e]), float(c.reach[e]), curvature, float(c.steepness[e]), tuple(terms)


def _rows(values: Sequence[object]) -> str:
    if not values:
        return "()"
    return "(\n" + "".join(f"    {_literal(v)},\n" for v in values) + ")"


def _literal(value: object) -> str:
    """What Python reads as the same value, in ASCII whatever a name holds."""
    if isinstance(value, float) and math.isinf(value):
        return 'float("inf")' if value > 0 else '-float("inf")'
    if isinstance(value, str):
        return ascii(value)
    if isinstance(value, tuple | list):
        words = [_literal(v) for v in value]
        return f"({', '.join(words)}{',' if len(words) == 1 else ''})"
    return repr(value)


MOST_TERMS = 20_000
"""Of all equations together; a family that goes beyond it is left out, and that is said."""

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_LONGEST = 31


@dataclass(frozen=True)
class Guard:
    """The text of a guard.

    Attributes
    ----------
    text : str
        The file, ASCII only.
    prefix : str
        What its names begin with (C).
    complete : bool
        Whether no singular configuration is known to be missing; else nothing is ever clear to it.
    word : str
        How sure it is that none is missing: "proven", "probable" or "not complete".
    notes : tuple of str
        What is missing, and what was assumed.
    """

    text: str
    prefix: str
    complete: bool
    word: str
    notes: tuple[str, ...]


@checked
def export_guard(
    arm: Arm,
    language: Literal["c", "python"] = "c",
    *,
    forms: Forms | None = None,
    families: Sequence[str] | None = None,
    prefix: str | None = None,
) -> str:
    """Write the families of an arm as one self-contained file: a guard for a control loop.

    It holds f, gradient and proven distance of each family, the joint names and limits, the
    tolerance, the version and a hash of the robot; C99 without any allocation, or Python with
    NumPy. Its clearance is never above the distance to the families, rounding included; where
    some are known to be missing it is 0. How sure it is that they are all singular
    configurations is a constant of the file: "proven", "probable" or "not complete".

    Parameters
    ----------
    arm : Arm
        A serial arm.
    language : str
        "c" or "python".
    forms : ClosedForm or sequence of ClosedForm, optional
        Of the arm, such as those of two tasks; if not given they are computed, with a
        certificate where one is found in two seconds.
    families : sequence of str, optional
        Names of the families that count; by default all. A guard of some is not complete.
    prefix : str, optional
        What names in C begin with: letters, digits and underscores. By default the robot's name.

    Returns
    -------
    str
        The file.

    Raises
    ------
    OptionError, UnknownNameError
        If the prefix is no name in C, forms are of another arm, or there is no family of a name.

    Examples
    --------
    >>> import pinsing
    >>> text = pinsing.export_guard(pinsing.load("ur5"), "c")
    >>> "ur5_clearance(const double q[UR5_JOINTS]" in text
    True
    """
    return make_guard(arm, language, forms=forms, families=families, prefix=prefix).text


def make_guard(
    arm: Arm,
    language: str,
    *,
    forms: Forms | None = None,
    families: Sequence[str] | None = None,
    prefix: str | None = None,
) -> Guard:
    """As `export_guard`, with what one should know of the file."""
    if prefix is None:
        prefix = _prefix(arm.name)
    elif not _IDENTIFIER.fullmatch(prefix) or len(prefix) > _LONGEST or prefix.endswith("_"):
        raise OptionError(
            f"prefix must be a name of at most {_LONGEST} letters, digits and underscores that "
            f"begins with a letter and does not end with an underscore, got {prefix!r:.60}"
        )
    if forms is not None:
        require_forms_of(forms, arm)
    forms = closed_form(arm) if forms is None else forms
    all_of_them = every_name(forms)
    watched = watch(forms, all_of_them if families is None else families)
    every = [forms] if isinstance(forms, ClosedForm) else list(forms)
    notes: list[str] = []
    if not watched.complete:
        gaps = "; ".join(dict.fromkeys(gap for form in every for gap in form.gaps))
        notes.append(f"the closed form is not complete: {gaps or 'see pinsing families'}")
    left = [name for name in all_of_them or () if name not in watched.names]
    if left:
        notes.append(f"not asked for: {', '.join(left)}")
    kept, room = [], MOST_TERMS
    for name, family in zip(watched.names, watched.families, strict=True):
        size = sum(len(e.cos) for e in family.equations)
        room -= size
        if room < 0:
            notes.append(
                f"{name} is left out: its equations have {size} terms, too many for a file"
            )
            room += size
        else:
            kept.append((name, family))
    complete = not notes
    word = _word(every) if complete else "not complete"
    if word == "probable":
        notes.append(f"that no family is missing is probable, not proven: {_unproven(every)}")
    change = max(form.jacobian_change for form in every)
    if change > 1e-12:
        notes.append(
            f"the description is rounded; made exact this changes no column of the Jacobian by "
            f"more than {change:.1e}"
        )
    source = GuardSource(
        prefix=prefix,
        robot=f"{arm.name} ({arm.source.label}), {arm.base} to {arm.tip}",
        task=", ".join(dict.fromkeys(form.arm.task for form in every)),
        length_scale=arm.length_scale,
        version=__version__,
        robot_hash=f"sha256:{fingerprint(arm)}",
        tolerance=_tolerance(arm, every),
        change=change,
        joints=arm.joints,
        lower=arm.lower,
        upper=arm.upper,
        families=tuple((name, family.text) for name, family in kept),
        conditions=_conditions([family for _, family in kept], arm, watched.weight),
        complete=complete,
        word=word,
        notes=tuple(notes),
    )
    text = c_text(source) if language == "c" else python_text(source)
    return Guard(text, prefix, complete, word, tuple(notes))


def _word(forms: Sequence[ClosedForm]) -> str:
    """The word that is true of all of them, none of which is not complete."""
    return "proven" if all(form.word == "proven" for form in forms) else "probable"


def _unproven(forms: Sequence[ClosedForm]) -> str:
    """Why there is no certificate."""
    reasons = [
        "no certificate was looked for" if form.proof is None else form.proof.reason
        for form in forms
        if form.word != "proven"
    ]
    return "; ".join(dict.fromkeys(reasons))


def _conditions(families: Sequence[Family], arm: Arm, weight: np.ndarray) -> Conditions:
    return Conditions.of([f.branches for f in families], np.array(arm.prismatic), weight)


def _tolerance(arm: Arm, forms: Sequence[ClosedForm]) -> float:
    """The most that an angle of the description was moved by."""
    geometries = [form.geometry or nominal(arm) for form in forms]
    sizes = [s.size for g in geometries for s in g.snaps if s.what != "length"]
    return max(sizes, default=0.0)


def _prefix(name: str) -> str:
    """A name in C out of any name."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_").lower()[:_LONGEST].strip("_")
    return plain if re.match(r"[a-z]", plain) else f"robot_{plain}".strip("_")[:_LONGEST]
