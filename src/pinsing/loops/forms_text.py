"""Equations of a mechanism as text for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.joint_text import typed
from pinsing.loops.feasible import Interval
from pinsing.loops.joint_forms import JointForms
from pinsing.loops.loci import LoopForms
from pinsing.loops.pose_equation import SHORT
from pinsing.loops.pose_forms import PoseForms
from pinsing.prose import PLAIN, Page, Span, alarm, caution, formula, good, unbroken

Line = tuple[str, tuple[Span, ...]]
"""An indent, and what follows it."""

_DECIMALS = 12
"""Of joint values: what is behind them is rounding."""


def forms_text(
    inputs: Sequence[str],
    forms: LoopForms | PoseForms | None,
    page: Page = PLAIN,
    degrees: bool = False,
    exact: bool = False,
    joints: JointForms | None = None,
    longest: int | None = None,
) -> str:
    """The loci of a mechanism alone, as text.

    Parameters
    ----------
    inputs : sequence of str
        Names of the actuated joints.
    forms : LoopForms or PoseForms
        What to print.
    page : Page
        What it is fitted to.
    degrees : bool
        Angles in degrees.
    exact : bool
        Whole equations over the pose with exact coefficients, however long.
    joints : JointForms, optional
        The loci in the joint angles, whose determinants are written out.
    longest : int, optional
        Characters beyond which a determinant is given by its size alone.
    """
    lines: list[Line] = []
    if isinstance(forms, PoseForms):
        lines += pose_lines(forms, exact)
    elif forms is not None:
        lines += loop_lines(inputs, forms, Values(degrees, frozenset()), page)
    if joints is not None:
        lines += [("", ())] if lines else []
        lines += joint_lines(joints, True, longest)
    return "\n".join(
        page.paragraph(*spans, first=indent, rest=indent + "  ") for indent, spans in lines
    )


@dataclass(frozen=True)
class Values:
    """Joint values with their names."""

    degrees: bool
    sliding: frozenset[str]

    def named(self, names: Sequence[str], values: Array, digits: int = 6) -> str:
        """Names with their values."""
        pairs = zip(names, values.tolist(), strict=True)
        return ", ".join(unbroken(f"{n} = {self.value(n, v, digits)}") for n, v in pairs)

    def value(self, name: str, value: float, digits: int = 6) -> str:
        """A value with its unit left to the reader."""
        if self.degrees and name not in self.sliding:
            return f"{round(math.degrees(value), _DECIMALS) + 0.0:.{digits}g}°"
        return f"{round(value, _DECIMALS) + 0.0:.{digits}g}"

    def interval(self, name: str, found: Interval) -> str:
        """Both ends, or the whole circle."""
        if found.whole:
            return "the whole circle"
        return unbroken(f"[{self.value(name, found.lower)}, {self.value(name, found.upper)}]")

    def pasted(self, names: Sequence[str], values: Array, room: int) -> str:
        """As it is typed at the command line."""
        return typed(values, [n in self.sliding for n in names], self.degrees, room=room)


def loop_lines(
    inputs: Sequence[str], forms: LoopForms, values: Values, page: Page
) -> Iterator[Line]:
    """Loci over the inputs."""
    whole = good("complete") if forms.complete else caution("NOT complete")
    yield "", ("Closed forms of the singular loci over the inputs, in m², ", whole, ":")
    if not forms.loci and forms.complete:
        yield "  ", ("none: no inputs are singular",)
    for locus in forms.loci:
        extra = " (isolated points)" if locus.points_only else ""
        extra += "" if locus.witness else " (no configuration found that closes the loops)"
        yield "  ", (f"{locus.kind}: {locus.words}{extra}",)
        yield "    ", (formula(str(locus.equation)),)
        if locus.witness:
            q = values.pasted(inputs, locus.witness.inputs, page.width - 9)
            yield "    ", (f"e.g. {q}",)
    for note in forms.notes:
        yield "  ", (note,)


def pose_lines(forms: PoseForms, exact: bool = False) -> Iterator[Line]:
    """Loci over the pose of the output; ``exact`` writes out what is long."""
    whole = good("complete") if forms.complete else caution("NOT complete")
    yield "", ("Closed forms of the singular loci over the pose of the output, ", whole, ":")
    if forms.architecture:
        yield "  ", (alarm(forms.architecture),)
    for locus in forms.loci:
        none = "" if locus.real else " (no real points found)"
        yield "  ", (f"{locus.kind}: {locus.words}{none}",)
        matrix = bool(locus.equation.matrix)
        written = locus.equation.exact() if exact and not matrix else str(locus.equation)
        yield "    ", (formula(written),)
        for row in locus.equation.rows(True) if exact else ():
            yield "      ", (formula(row),)
    closing = [x for x in forms.closing if exact or len(x.values) <= SHORT]
    if closing:
        yield "  ", ("the loops close where",)
    for equation in closing:
        yield "    ", (formula(equation.exact() if exact else str(equation)),)
    for family in forms.everywhere:
        yield "  ", (f"{family}",)
    for locus in forms.inputs:
        none = "" if locus.real else " (no real points found)"
        written = locus.equation.exact() if exact else str(locus.equation)
        yield "  ", (f"{locus.kind} {locus.words}{none}: ", formula(written))
    for locus in forms.level:
        yield "  ", (f"{locus.kind}, {locus.words}: ", formula(str(locus.equation)))
    for note in forms.notes:
        yield "  ", (note,)


def joint_lines(forms: JointForms, whole: bool, longest: int | None = None) -> Iterator[Line]:
    """Loci in the joint angles; determinants written out on request, up to a length."""
    if not forms.complete:
        yield "", (f"Closed forms in the joint angles: {'; '.join(forms.notes)}",)
        return
    title = "Closed forms in the joint angles, where the loops close, "
    yield "", (title, good("complete"), ":")
    for locus in forms.loci:
        if locus.kind == "passive":
            continue
        yield "  ", (f"{locus.kind}: {locus.words}",)
        yield "    ", (formula(locus.statement()),)
        rows = locus.rows() if whole else []
        if longest is not None and sum(map(len, rows)) > longest:
            yield "      ", ("rows too long for this page: families --loops writes them out",)
            continue
        for row in rows:
            yield "      ", (formula(row),)
    own: dict[str, list[str]] = {}
    for locus in forms.loci:
        if locus.kind == "passive":
            own.setdefault(locus.words, []).append(locus.statement())
    if own:
        yield "  ", ("passive joints move by themselves, the output at rest:",)
    for words, statements in own.items():
        yield "    ", (f"{words}: ", formula(" or ".join(statements)))
    if not whole and any(x.matrix for x in forms.loci):
        yield "  ", ("families --loops writes the determinants out",)
    for note in forms.notes:
        yield "  ", (note,)
