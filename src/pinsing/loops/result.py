"""What was found out about a mechanism, and its text for people."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import field
from typing import ClassVar

from pinsing._dataclass import dataclass
from pinsing.loops.feasible import Interval
from pinsing.loops.forms_text import Line, Values, joint_lines, loop_lines, pose_lines
from pinsing.loops.joint_forms import JointForms
from pinsing.loops.loci import LoopForms
from pinsing.loops.motion import MechanismState
from pinsing.loops.pose_forms import PoseForms
from pinsing.loops.pose_table import Column, pose_table
from pinsing.loops.singular_points import SingularPoint
from pinsing.loops.solve import Solution
from pinsing.prose import PLAIN, Page, Span, alarm, caution, good, unbroken
from pinsing.serialization import JsonResult

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
_FEW_INPUTS = 3
_MOST_ROWS = 16


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
    lines += [*_forms(a, values, page), *_checks(a)]
    return "\n".join(
        page.paragraph(*spans, first=indent, rest=indent + "  ") for indent, spans in lines
    )


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
    count = min(len(rows), len(modes) if joints else _MOST_ROWS)
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
        yield "    ", (f"{len(modes) - count} more are in the JSON (--json)",)
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
        told: dict[tuple[str, str], int] = {}
        for p in here:
            mode = (f": {p.mode}" if p.mode else "") + (
                " (the whole curve through it)"
                if p.whole_curve
                else " (end of the range)"
                if p.range_end
                else ""
            )
            if len(a.inputs) <= _FEW_INPUTS:
                shown = values.named(a.inputs, p.inputs.round(12), 10)
                told[shown, mode] = told.get((shown, mode), 0) + 1
                continue
            k = a.inputs.index(p.moving) if p.moving else None
            names, where = (a.inputs, p.inputs) if k is None else ((p.moving,), p.inputs[k : k + 1])
            at = ", ".join(f"{x + 0.0:.6g}" for x in p.position.round(12))
            shown = values.named(names, where, 10)
            rest = f"{mode}; output at {unbroken(f'({at})')} m"
            told[shown, rest] = told.get((shown, rest), 0) + 1
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
        for text in a.missing:
            yield "  ", (f"- {text}",)


def _checks(a: MechanismAnalysis) -> Iterator[Line]:
    yield "", ()
    for check in a.checks:
        yield "", (good("ok") if check.passed else alarm("DISAGREES"), f": {check.words}")
    for note in a.notes:
        yield "", (f"note: {note}",)
