"""A guard for control loops: families as one file without dependencies, in C or in Python."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pinsing._version import __version__
from pinsing.algebra import trig_sum
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.trig_sum import COMBINED
from pinsing.errors import OptionError
from pinsing.families import Family, closed_form
from pinsing.interface import checked
from pinsing.kinematics.jacobian import fingerprint
from pinsing.measures import ROUNDING, Array, NDArray
from pinsing.prose import visible
from pinsing.proximity.clearance import Forms, each_of, every_name, require_forms_of, watch
from pinsing.proximity.zones import Zones, zone_distances
from pinsing.robot.arm import Arm, summarize
from pinsing.robot.nominal import nominal


@dataclass(frozen=True, eq=False)
class Guard:
    """What goes into the file, whatever its language: see the templates."""

    language: str  # "c" or "python"
    prefix: str  # of its names (C)
    arm: Arm
    task: str
    tolerance: float
    change: float
    families: tuple[tuple[str, str], ...]  # names, and in words
    conditions: Conditions
    margin: tuple[float, float, float, float]
    complete: bool  # all singular configurations count; else nothing is ever clear
    word: str  # "proven", "probable" (perhaps "of the design") or "not complete"
    notes: tuple[str, ...]  # what is missing, and what was assumed
    zones: Zones | None

    @cached_property
    def text(self) -> str:
        """The file, ASCII only."""
        return _c_text(self) if self.language == "c" else _python_text(self)

    @property
    def robot(self) -> str:
        """The robot in words."""
        arm = self.arm
        return f"{arm.name} ({summarize(arm).described}), {arm.base} to {arm.tip}"

    @property
    def robot_hash(self) -> str:
        """What tells the robot from others."""
        return f"sha256:{fingerprint(self.arm)}"

    @property
    def zone_tables(self) -> dict[str, Array]:
        """Distances from families, and the middle and half of the joint ranges that they are of."""
        if self.zones is None:
            return {}
        low, high = self.zones.lower, self.zones.upper
        far = np.array([self.zones.distances.get(name, 0.0) for name, _ in self.families])
        return {
            "zone": far,
            "zone_middle": (low + high) / 2,
            "zone_half": (high - low) / 2 + ROUNDING,
        }

    def zones_filled(self, name: str, parts: Mapping[str, str], prefix: str = "") -> str:
        """What the file says and does about zones; empty without them."""
        if self.zones is None:
            return ""
        v, w = repr(self.zones.tip_speed), repr(self.zones.turn_speed)
        return _filled(name, {"tip_speed": v, "turn_speed": w, **parts}, prefix)

    @property
    def zone_title(self) -> str:
        """Where zones are of, on one line of ASCII."""
        words = () if self.zones is None else self.zones.within
        return _plain(f"Zones, of {', '.join(words) or 'all configurations'}.")


def _filled(name: str, parts: Mapping[str, str], prefix: str = "") -> str:
    """A template with its places filled in; places in what is filled in stay as they are."""
    text = (Path(__file__).parent / "templates" / name).read_text(encoding="ascii")
    text = text.replace("@p@", prefix).replace("@P@", prefix.upper())
    pieces = re.split("@([a-z_]+)@", text)
    pieces[1::2] = [parts[key] for key in pieces[1::2]]
    return "".join(pieces)


def _plain(text: str) -> str:
    """A text in ASCII, on one line."""
    readable = text.replace("°", " deg").replace("±", "+-").replace("π", "pi")
    return visible(readable).encode("ascii", "backslashreplace").decode("ascii")


_WIDTH = 96


def _c_text(source: Guard) -> str:
    """The header in C99, ASCII only."""
    c, p = source.conditions, source.prefix
    families = [f"{name}: {text}" for name, text in source.families]
    made = [
        f"Guard of {source.robot}; task {source.task}.",
        f"Made by pinsing {__version__}; do not edit, export it again.",
        f"Robot hash {source.robot_hash}, length scale {source.arm.length_scale:g} m.",
    ]
    notes = [
        *(f"Note: {note}" for note in source.notes),
        "Families:" if families else "Families: none.",
        *(f"  {line}" for line in families),
    ]
    tables = {"lower_limit": source.arm.lower, "upper_limit": source.arm.upper, **c.flat}
    tables["margin"] = np.array(source.margin)
    tables["branch_family"] = tables.pop("family")
    return _filled(
        "guard.h.in",
        {
            "head": _comment(made),
            "notes": " *\n" + _comment(notes),
            "joints": str(len(source.arm.joints)),
            "families": str(len(families)),
            "equations": str(len(c.sums)),
            "complete": str(int(source.complete)),
            "word": _string(source.word),
            "version": _string(__version__),
            "hash": _string(source.robot_hash),
            "tolerance": repr(source.tolerance),
            "change": repr(source.change),
            "combined": str(COMBINED),
            "branches": str(len(c.branches)),
            "name_tables": "\n".join(
                [
                    _strings(f"{p}_joint_name", source.arm.joints),
                    _strings(f"{p}_family_name", [name for name, _ in source.families]),
                    _strings(f"{p}_family_text", [text for _, text in source.families]),
                ]
            ),
            "tables": "\n".join(_table(f"{p}_{name}", table) for name, table in tables.items()),
            "zones": source.zones_filled(
                "zones.h.in",
                {
                    "title": _comment([source.zone_title]),
                    "tables": "\n".join(
                        _table(f"{p}_{name}", table) for name, table in source.zone_tables.items()
                    ),
                },
                p,
            ),
        },
        p,
    )


def _comment(lines: Iterable[str]) -> str:
    """Lines inside of a comment, which none of them ends."""
    out: list[str] = []
    for line in lines:
        text = _plain(line)
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
    body = ",\n    ".join([_string(v) for v in values] or ['""'])
    return f"static const char *const {name}[] = {{\n    {body}\n}};"


def _table(name: str, values: NDArray[Any]) -> str:
    """An array of C; an empty one holds a zero."""
    if values.dtype.kind != "f":
        kind, words = "int", [str(int(v)) for v in values]
    else:
        kind = "double"
        words = [
            f"{'-' if v < 0 else ''}HUGE_VAL" if math.isinf(v) else repr(float(v)) for v in values
        ]
    head, inside = f"static const {kind} {name}[] = {{", ", ".join(words or ["0"])
    if len(head) + len(inside) + 4 <= _WIDTH:
        return f"{head} {inside} }};"
    body = textwrap.fill(inside, _WIDTH, initial_indent="    ", subsequent_indent="    ")
    return f"{head}\n{body}\n}};"


def _python_text(source: Guard) -> str:
    """The module for NumPy, ASCII only."""
    c = source.conditions
    constants: dict[str, Any] = {
        "ROBOT": source.robot,
        "TASK": source.task,
        "LENGTH_SCALE": source.arm.length_scale,
        "VERSION": __version__,
        "ROBOT_HASH": source.robot_hash,
        "RADIANS": source.arm.units is not None,
        "JOINTS": source.arm.joints,
        "LOWER": source.arm.lower.tolist(),
        "UPPER": source.arm.upper.tolist(),
        "FAMILIES": [name for name, _ in source.families],
        "TEXTS": [text for _, text in source.families],
        "COMPLETE": source.complete,
        "WORD": source.word,
        "NOTES": source.notes,
        "TOLERANCE": source.tolerance,
        "JACOBIAN_CHANGE": source.change,
        "WEIGHT": c.weight.tolist(),
        "TURN": c.turn.tolist(),
        "MARGIN": source.margin,
    }
    said = {
        "COMPLETE": "False: distances are not known of the robot, so that clearance is always 0",
        "WORD": "that FAMILIES are all is proven, probable (of the design), or not complete; NOTES",
        "TOLERANCE": "radians: angles of the description were moved by at most this",
        "JACOBIAN_CHANGE": "which changes no column of the Jacobian by more than this",
        "WEIGHT": "what joint differences are multiplied by",
        "TURN": "a whole turn, weighted; 0 for joints that slide",
        "RADIANS": "True: values that make sense in degrees only are not refused",
        "LOWER": "radians and metres; infinite where there is no limit",
        "MARGIN": "taken off distances: alone, where families meet, near is, 1: within limits",
    }
    lines = []
    for key, value in constants.items():
        if key in said:
            lines.append(f"# {said[key]}")
        lines.append(f"{key} = {_literal(value)}")
    count, branches = 0, []
    for b in c.branches:
        numbers = tuple(range(count, count + len(b.sums)))
        branches.append((b.family, tuple(b.joints.tolist()), tuple(b.values.tolist()), numbers))
        count += len(b.sums)
    sums = [(s.amplitude, s.phase, s.rate, s.power) for s in c.sums]
    parameters = [
        (*(a.tolist() for a in arrays), s.noise) for arrays, s in zip(sums, c.sums, strict=True)
    ]
    code = Path(trig_sum.__file__).read_text(encoding="ascii")
    parts = {
        "constants": "\n".join(lines),
        "code": code.partition("import Array, ArrayLike\n")[2].strip(),
        "branches": _rows(branches),
        "sums": _rows(parameters),
        "zones": source.zones_filled(
            "zones.py.in",
            {
                "title": textwrap.fill(
                    source.zone_title, _WIDTH, initial_indent="# ", subsequent_indent="# "
                ),
                "tables": "\n".join(
                    f"{name.upper()} = {_literal(table.tolist())}"
                    for name, table in source.zone_tables.items()
                ),
            },
        ),
    }
    return _filled("guard.py.in", parts)


def _rows(values: Sequence[object]) -> str:
    return "(\n" + "".join(f"    {_literal(v)},\n" for v in values) + ")" if values else "()"


def _literal(value: object) -> str:
    """Return what Python reads as the same value, in ASCII whatever a name holds."""
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


@checked
def export_guard(
    arm: Arm,
    language: Literal["c", "python"] = "c",
    *,
    forms: Forms | None = None,
    families: Sequence[str] | None = None,
    prefix: str | None = None,
    zones: Zones | None = None,
) -> str:
    """Write the families of an arm as one self-contained file: a guard for a control loop.

    It holds f, gradient and proven distance of each family, the joint names and limits, the
    tolerance, the version and a hash of the robot; C99 without any allocation, or Python with
    NumPy. Its clearance is never above the distance to the families, rounding included; where
    some are known to be missing it is 0. How sure it is that they are all singular
    configurations is a constant of the file: "proven", "probable" or "not complete"; "proven of
    the design" where the robot's numbers differ from its nominal design and no tube is proven.

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
    zones : Zones, optional
        Those of the arm, from `pinsing.zones`: the file then tells whether a configuration is
        proven to be outside, where tip speeds keep the joint speed limits.

    Returns
    -------
    str
        The file.

    Raises
    ------
    OptionError, UnknownNameError
        If the prefix is no name in C, forms or zones are of another arm, or there is no family of a
        name.

    Examples
    --------
    >>> import pinsing
    >>> text = pinsing.export_guard(pinsing.load("ur5"), "c")
    >>> "ur5_clearance(const double q[UR5_JOINTS]" in text
    True
    """
    return make_guard(
        arm, language, forms=forms, families=families, prefix=prefix, zones=zones
    ).text


def make_guard(
    arm: Arm,
    language: str,
    *,
    forms: Forms | None = None,
    families: Sequence[str] | None = None,
    prefix: str | None = None,
    zones: Zones | None = None,
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
    every = each_of(forms)
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
    taken = watched.margin
    if taken is not None and math.isinf(taken.meeting):
        notes.append(watched.tube)
    complete = not notes
    unproven = [form.proof for form in every if form.word != "proven"]
    word = "not complete"
    if complete:  # of several forms the less sure one's
        word = "probable" if unproven else "proven"
    if watched.nominal:
        notes.append(f"distances are not of {summarize(arm).described} itself. {watched.tube}")
    if word == "probable":
        reasons = ["no certificate was looked for" if p is None else p.reason for p in unproven]
        because = "; ".join(dict.fromkeys(reasons))
        notes.append(f"that no family is missing is probable, not proven: {because}")
    word += " of the design" * (complete and watched.nominal)
    change = max(form.jacobian_change for form in every)
    if change > 1e-12 and taken is None:
        notes.append(
            f"the description is rounded; made exact this changes no column of the Jacobian by "
            f"more than {change:.1e}"
        )
    margin = (0.0, 0.0, 0.0, 0.0)
    if taken is not None:
        notes += [watched.tube] * math.isfinite(taken.meeting)
        whole = len(kept) == len(watched.names)
        alone = float(taken.alone.max()) if whole else taken.meeting
        margin = (alone, taken.meeting, taken.near, float(taken.limits is not None))
    if zones is not None:
        zone_distances(zones, every[0].arm, arm, [name for name, _ in kept])
    geometries = [form.geometry or nominal(arm) for form in every]
    return Guard(
        language=language,
        prefix=prefix,
        arm=arm,
        task=", ".join(dict.fromkeys(form.arm.task for form in every)),
        tolerance=max(
            (s.size for g in geometries for s in g.snaps if s.what != "length"), default=0.0
        ),
        change=change,
        families=tuple((name, _text(family)) for name, family in kept),
        conditions=Conditions.of([f.branches for _, f in kept], watched.prismatic, watched.weight),
        margin=margin,
        complete=complete,
        word=word,
        notes=tuple(notes),
        zones=zones,
    )


def _text(family: Family) -> str:
    return f"{family.title}: {family.text}" if family.title else family.text


def _prefix(name: str) -> str:
    """A name in C out of any name."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_").lower()[:_LONGEST].strip("_")
    return plain if re.match(r"[a-z]", plain) else f"robot_{plain}".strip("_")[:_LONGEST]
