"""Equations of a mechanism as text for people."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from pinsing._types import Array
from pinsing.joint_text import typed
from pinsing.loops.forms import SHORT, JointForms, PoseForms
from pinsing.loops.loop_forms import LoopForms
from pinsing.loops.motion import MechanismState
from pinsing.loops.pose import Column, pose_table
from pinsing.loops.singular_points import SingularPoint
from pinsing.loops.solve import Interval, Solution
from pinsing.prose import PLAIN, Page, Span, alarm, caution, formula, good, unbroken
from pinsing.serialization import JsonResult

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
    return _written(lines, page)


def _written(lines: Iterable[Line], page: Page) -> str:
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
    yield from (("  ", (note,)) for note in forms.notes)


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
        yield from (("      ", (formula(x),)) for x in (locus.equation.rows(True) if exact else ()))
    closing = [x for x in forms.closing if exact or len(x.values) <= SHORT]
    if closing:
        yield "  ", ("the loops close where",)
    for equation in closing:
        yield "    ", (formula(equation.exact() if exact else str(equation)),)
    yield from (("  ", (f"{family}",)) for family in forms.everywhere)
    for locus in forms.inputs:
        none = "" if locus.real else " (no real points found)"
        written = locus.equation.exact() if exact else str(locus.equation)
        yield "  ", (f"{locus.kind} {locus.words}{none}: ", formula(written))
    for locus in forms.level:
        yield "  ", (f"{locus.kind}, {locus.words}: ", formula(str(locus.equation)))
    yield from (("  ", (note,)) for note in forms.notes)


def joint_lines(forms: JointForms, whole: bool, longest: int | None = None) -> Iterator[Line]:
    """Loci in the joint angles; determinants written out on request, up to a length."""
    if not forms.complete:
        yield "", (f"Closed forms in the joint angles: {'; '.join(forms.notes)}",)
        return
    title = "Closed forms in the joint angles, where the loops close, "
    yield "", (title, good("complete"), ":")
    for locus in (x for x in forms.loci if x.kind != "passive"):
        yield "  ", (f"{locus.kind}: {locus.words}",)
        yield "    ", (formula(locus.statement()),)
        rows = locus.rows() if whole else []
        if longest is not None and sum(map(len, rows)) > longest:
            yield "      ", ("rows too long for this page: families --loops writes them out",)
            continue
        yield from (("      ", (formula(row),)) for row in rows)
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
    yield from (("  ", (note,)) for note in forms.notes)


_MEANING = {
    "type 1": "a direction of the output is lost",
    "type 2": "the output moves with the actuators locked",
    "type 3": "both",
    "constraint": "more motions than the mobility",
}

FORMS = "closed forms over the "
"""What the stages of an analysis are called that look for them."""

_WHY = "why was not kept in this file"
_FEW = 7
"""Joints up to which a text lists the values of all of them."""


@dataclass(frozen=True)
class Check:
    """One agreement between the sweep and the closed forms.

    Attributes
    ----------
    words : str
        What was compared.
    passed : bool
        Whether it agrees.
    """

    words: str
    passed: bool


@dataclass(frozen=True, eq=False)
class MechanismAnalysis(JsonResult):
    """What was found out about a mechanism.

    Attributes
    ----------
    name, source, loop_file : str
        Where it comes from.
    joints, inputs : tuple of str
        All joints, and the actuated ones.
    loops : tuple of str
        What is held together.
    output, task : str
        Frame and rows of the output.
    length_scale : float
        Metres.
    mobility, constraint_rank, constraint_rows : int
        Degrees of freedom; independent and written closure equations.
    state : MechanismState
        At the configuration analysed.
    assemblies : tuple of Solution
        The assembly modes at its inputs (direct problem), one configuration each.
    direct : str
        How many, and how sure it is that these are all.
    working : tuple of Solution
        The working modes for its pose of the output (inverse problem); empty where a pose
        leaves a freedom open.
    inverse : str
        How many, and how sure it is that these are all.
    ranges : dict of str to tuple of Interval
        For each input, the others held, where the loops close.
    points : tuple of SingularPoint
        Singular points along the curves of each input, the others held.
    forms : LoopForms or None
        The loci as equations, where the algebra is at hand.
    pose_forms : PoseForms or None
        The loci as equations in the pose of the output, where each leg passes one force.
    checks : tuple of Check
        Sweep against closed forms.
    notes : tuple of str
        What was assumed.
    joint_forms : JointForms or None
        The loci as equations in the mechanism's own joint angles.
    missing : tuple of str
        What was cut short, by the time or by Ctrl-C.
    why_none : str
        Why there are no closed forms over the pose, where there are none.
    """

    schema: ClassVar[str] = "pinsing/mechanism-analysis/2"

    name: str
    source: str
    loop_file: str
    joints: tuple[str, ...]
    inputs: tuple[str, ...]
    loops: tuple[str, ...]
    output: str
    task: str
    length_scale: float
    mobility: int
    constraint_rank: int
    constraint_rows: int
    state: MechanismState
    assemblies: tuple[Solution, ...]
    direct: str
    working: tuple[Solution, ...]
    inverse: str
    ranges: dict[str, tuple[Interval, ...]]
    points: tuple[SingularPoint, ...]
    forms: LoopForms | None
    pose_forms: PoseForms | None
    checks: tuple[Check, ...]
    notes: tuple[str, ...]
    joint_forms: JointForms | None = field(default=None, metadata={"optional": True})
    missing: tuple[str, ...] = field(default=(), metadata={"optional": True})
    why_none: str = field(default=_WHY, metadata={"optional": True})

    def __str__(self) -> str:
        return analysis_text(self)


def analysis_answer(
    a: MechanismAnalysis,
    degrees: bool = False,
    sliding: Collection[str] = (),
    robot: str = "ROBOT",
) -> str:
    """Return at most eight lines: how it is at home, what is nearest of each type, what to do."""
    values = Values(degrees, frozenset(sliding))
    singular = a.state.kind != "regular"
    how = f"SINGULAR ({a.state.kind})" if singular else "near-singular" * a.state.near or "regular"
    lines = [f"{a.name}: {how} at {values.named(a.inputs, a.state.inputs, 4)}"]
    modes = [f"{len(a.assemblies)} assembly", *[f"{len(a.working)} working"] * bool(a.working)]
    lines.append(f"  Modes found: {' and '.join(modes)}")
    for kind, meaning in _MEANING.items():
        here = [p for p in a.points if p.kind == kind]
        if here:
            p = min(here, key=lambda p: sum(abs(p.inputs - a.state.inputs)))
            lines.append(f"  {kind} ({meaning}): at {values.named(a.inputs, p.inputs, 4)}")
    if not a.points:
        lines.append("  No singular points on the curves through these inputs")
    lines += [f"  Next: pinsing families {robot}", f"        pinsing view {robot}"]
    return "\n".join(lines).replace("\u00a0", " ")


def analysis_text(
    a: MechanismAnalysis,
    page: Page = PLAIN,
    degrees: bool = False,
    sliding: Collection[str] = (),
    joints: bool | None = None,
) -> str:
    """Plain text of an analysis.

    Parameters
    ----------
    a : MechanismAnalysis
        What to print.
    page : Page
        What it is fitted to.
    degrees : bool
        Angles in degrees.
    sliding : collection of str
        Joints whose values are no angles.
    joints : bool or None
        List the values of all joints of each mode; None: where there are few.
    """
    joints = len(a.joints) <= _FEW if joints is None else joints
    values = Values(degrees, frozenset(sliding))
    lines = [*_head(a, values), *_configurations(a, values, joints, page), *_points(a, values)]
    return _written([*lines, *_forms(a, values, page), *_checks(a)], page)


def _head(a: MechanismAnalysis, values: Values) -> Iterator[Line]:
    redundant = a.constraint_rows - a.constraint_rank
    spare = f", {redundant} of {a.constraint_rows} redundant" if redundant else ""
    yield (
        "",
        (
            f"{a.name}: {len(a.joints)} joints, "
            f"{a.mobility} degree{'s' * (a.mobility != 1)} of freedom "
            f"({a.constraint_rank} independent closure equations{spare})",
        ),
    )
    yield (
        "  ",
        (
            f"driven by {', '.join(a.inputs)}; output {a.output} ({a.task}); "
            f"loops {', '.join(a.loops)}; length scale {a.length_scale:g} m; angles in "
            f"{'degrees' if values.degrees else 'radians'}",
        ),
    )
    yield "", ()
    kind: Span = a.state.kind if a.state.kind == "regular" else alarm(unbroken(a.state.kind))
    near = (" (", caution("near-singular"), ")") if a.state.near else ()
    yield "", (f"At {values.named(a.inputs, a.state.inputs)}: ", kind, *near)
    yield (
        "  ",
        (
            f"measures: type 1 {a.state.output_ratio:.4g}, type 2 {a.state.input_ratio:.4g}, "
            f"constraint {a.state.constraint_ratio:.4g}",
        ),
    )


def _configurations(
    a: MechanismAnalysis, values: Values, joints: bool, page: Page
) -> Iterator[Line]:
    yield "  ", (f"direct problem, at these inputs: {a.direct}",)
    yield from _modes(a, a.assemblies, values, joints, page)
    if a.working:
        yield "  ", (f"inverse problem, for the pose there: {a.inverse}",)
        yield from _modes(a, a.working, values, joints, page, a.inputs)
    if a.ranges:
        yield (
            "  ",
            ("the loops close, the other inputs held, at least for (curves from random starts)",),
        )
    for name, found in a.ranges.items():
        ends = " or ".join(values.interval(name, i) for i in found)
        yield "    ", (f"{name} in {ends or 'nothing'}",)


def _modes(
    a: MechanismAnalysis,
    modes: Sequence[Solution],
    values: Values,
    joints: bool,
    page: Page,
    inputs: Sequence[str] = (),
) -> Iterator[Line]:
    """A table: the pose of the output first, then the ``inputs`` that tell modes apart."""
    rows = [s.pose for s in modes if s.pose is not None]
    count = min(len(rows), len(modes) if joints else 16)
    for line in pose_table(
        rows[:count],
        [(str(s.ways), s.mode) for s in modes[:count]],
        ("ways", "mode"),
        values.degrees,
        page.width - 4,
        [
            Column(name, [float(s.inputs[k]) for s in modes[:count]], name not in values.sliding)
            for k, name in enumerate(inputs)
        ],
    ):
        yield "    ", (line,)
    if count < len(modes):
        yield "    ", (f"{len(modes) - count} more are in the JSON (-o FILE.json)",)
    if joints:
        for k, s in enumerate(modes, 1):
            yield "    ", (f"{k}: {values.named(a.joints, s.q)}",)


def _points(a: MechanismAnalysis, values: Values) -> Iterator[Line]:
    for kind in ("type 1", "type 2", "type 3", "constraint"):
        here = [p for p in a.points if p.kind == kind]
        if not here:
            continue
        yield "", ()
        title = f" ({_MEANING[kind]}), along the curves through these inputs:"
        yield "", (alarm(unbroken(kind)), title)
        told: Counter[tuple[str, str]] = Counter()
        for p in here:
            rest = f": {p.mode}" if p.mode else ""
            if p.whole_curve or p.range_end:
                rest += " (the whole curve through it)" if p.whole_curve else " (end of the range)"
            names, where = a.inputs, p.inputs
            if len(names) <= 3:
                where = where.round(12)
            else:
                if p.moving:
                    names, where = (p.moving,), where[[names.index(p.moving)]]
                at = ", ".join(f"{x + 0.0:.6g}" for x in p.position.round(12))
                rest += f"; output at {unbroken(f'({at})')} m"
            told[values.named(names, where, 10), rest] += 1
        for (shown, rest), alike in told.items():
            # Inputs and mode alike: told apart by the pose and the passive joints alone.
            count = f" [{alike} configurations]" if alike > 1 else ""
            yield "  ", (f"{shown}{rest}{count}",)


def _forms(a: MechanismAnalysis, values: Values, page: Page) -> Iterator[Line]:
    yield "", ()
    if a.forms is not None:
        yield from loop_lines(a.inputs, a.forms, values, page)
    elif a.pose_forms is not None:
        yield from pose_lines(a.pose_forms)
    elif not any(text.startswith(FORMS) for text in a.missing):
        yield (
            "",
            (
                "Closed forms over the inputs or the pose: none (no planar dyad closes the loops, "
                f"and {a.why_none}); the points are numeric.",
            ),
        )
    if a.joint_forms is not None:
        yield "", ()
        yield from joint_lines(a.joint_forms, False)
    if a.missing:
        yield "", ()
        yield "", (caution("Missing:"),)
        yield from (("  ", (f"- {text}",)) for text in a.missing)


def _checks(a: MechanismAnalysis) -> Iterator[Line]:
    yield "", ()
    for check in a.checks:
        yield "", (good("ok") if check.passed else alarm("DISAGREES"), f": {check.words}")
    yield from (("", (f"note: {note}",)) for note in a.notes)
