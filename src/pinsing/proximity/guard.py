"""export_guard: families as one file without dependencies, in C or in Python, for control loops."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._version import __version__
from pinsing.algebra.conditions import Conditions
from pinsing.arguments import checked
from pinsing.errors import OptionError
from pinsing.families import ClosedForm, Family, closed_form
from pinsing.kinematics.evaluator import fingerprint
from pinsing.proximity.guard_c import c_text
from pinsing.proximity.guard_python import python_text
from pinsing.proximity.guard_source import GuardSource
from pinsing.proximity.watched import Forms, every_name, require_forms_of, watch
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import nominal

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
