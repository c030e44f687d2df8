"""Analysis of a mechanism: modes, ranges, singular points, closed forms; and their text."""

from __future__ import annotations

import functools
import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from pinsing.algebra.budget import Stages
from pinsing.errors import OptionError
from pinsing.interface import JsonResult, checked, typed
from pinsing.loops.closure import BatchLoops, Ranks, output_pose, planar_dyad, ranks, without_length
from pinsing.loops.forms import SHORT, JointForms, PoseForms
from pinsing.loops.joint_loci import LoopForms, joint_forms, loop_forms, roots
from pinsing.loops.legs import why_no_rods
from pinsing.loops.motion import (
    MechanismState,
    home,
    home_error,
    home_outside,
    measure_many,
    mechanism_at,
    motions,
    pose_of,
    pose_table,
)
from pinsing.loops.pose_loci import locus_distance, pose_forms
from pinsing.loops.solve import (
    MOST_CURVES,
    InfeasibleError,
    Interval,
    SingularPoint,
    Solution,
    Trace,
    assembly_modes,
    curves,
    feasible,
    find_singular,
    intervals,
    working_modes,
)
from pinsing.measures import ROUNDING, Array, ArrayLike
from pinsing.prose import PLAIN, Page, Span, alarm, caution, formula, good, unbroken
from pinsing.robot.mechanism import Mechanism

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
) -> str:
    """Return the loci of a mechanism alone as text; ``exact``: equations over the pose in full."""
    # Of ``joints`` the determinants are written out.
    lines: list[Line] = []
    if isinstance(forms, PoseForms):
        lines += pose_lines(forms, exact)
    elif forms is not None:
        lines += loop_lines(inputs, forms, Values(degrees, frozenset()), page)
    if joints is not None:
        lines += [("", ())] if lines else []
        lines += joint_lines(joints, True)
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
            slides = [name in values.sliding for name in inputs]
            q = typed(locus.witness.inputs, slides, values.degrees, room=page.width - 9)
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
    yield from (("    ", (formula(x.exact() if exact else str(x)),)) for x in closing)
    yield from (("  ", (f"{family}",)) for family in forms.everywhere)
    for locus in forms.inputs:
        none = "" if locus.real else " (no real points found)"
        written = locus.equation.exact() if exact else str(locus.equation)
        yield "  ", (f"{locus.kind} {locus.words}{none}: ", formula(written))
    for locus in forms.level:
        yield "  ", (f"{locus.kind}, {locus.words}: ", formula(str(locus.equation)))
    yield from (("  ", (note,)) for note in forms.notes)


def joint_lines(forms: JointForms, whole: bool) -> Iterator[Line]:
    """Loci in the joint angles; determinants written out on request."""
    if not forms.complete:
        yield "", (f"Closed forms in the joint angles: {'; '.join(forms.notes)}",)
        return
    yield "", ("Closed forms in the joint angles, where the loops close, ", good("complete"), ":")
    for locus in (x for x in forms.loci if x.kind != "passive"):
        yield "  ", (f"{locus.kind}: {locus.words}",)
        yield "    ", (formula(locus.statement()),)
        yield from (("      ", (formula(row),)) for row in (locus.rows() if whole else []))
    own: dict[str, list[str]] = {}
    for locus in forms.loci:
        if locus.kind == "passive":
            own.setdefault(locus.words, []).append(locus.statement())
    if own:
        yield "  ", ("passive joints move by themselves, the output at rest:",)
    yield from (("    ", (f"{words}: ", formula(" or ".join(x)))) for words, x in own.items())
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

_FEW = 7
"""Joints up to which a text lists the values of all of them."""


@dataclass(frozen=True)
class Check:
    """One agreement between the sweep and the closed forms."""

    words: str  # what was compared
    passed: bool  # whether it agrees


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
    why_none: str = field(default="why was not kept in this file", metadata={"optional": True})

    def __str__(self) -> str:
        return analysis_text(self)


def analysis_answer(
    a: MechanismAnalysis, degrees: bool = False, sliding: Collection[str] = (), robot: str = "ROBOT"
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
    """Return plain text of an analysis; ``joints``: with all joint values, None: if few."""
    joints = len(a.joints) <= _FEW if joints is None else joints
    values = Values(degrees, frozenset(sliding))
    lines = [*_state(a, values, joints, page), *_points(a, values)]
    lines += [*_forms(a, values, page), ("", ())]
    for check in a.checks:
        lines.append(("", (good("ok") if check.passed else alarm("DISAGREES"), f": {check.words}")))
    lines += [("", (f"note: {note}",)) for note in a.notes]
    return _written(lines, page)


def _state(a: MechanismAnalysis, values: Values, joints: bool, page: Page) -> Iterator[Line]:
    """What it is, how it is at the configuration, and its modes and ranges there."""
    redundant = a.constraint_rows - a.constraint_rank
    spare = f", {redundant} of {a.constraint_rows} redundant" if redundant else ""
    degrees = f"{a.mobility} degree{'s' * (a.mobility != 1)} of freedom"
    equations = f"({a.constraint_rank} independent closure equations{spare})"
    yield "", (f"{a.name}: {len(a.joints)} joints, {degrees} {equations}",)
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
        ends = " or ".join(
            "the whole circle"
            if x.whole
            else unbroken(f"[{values.value(name, x.lower)}, {values.value(name, x.upper)}]")
            for x in found
        )
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
    shown = modes[:count]
    units = [1.0 if n in values.sliding or not values.degrees else 180 / math.pi for n in inputs]
    columns = [
        (n, [unit * float(s.inputs[k]) for s in shown])
        for k, (n, unit) in enumerate(zip(inputs, units, strict=True))
    ]
    more = [(str(s.ways), s.mode) for s in shown]
    yield from (
        ("    ", (line,))
        for line in pose_table(
            rows[:count], more, ("ways", "mode"), values.degrees, page.width - 4, columns
        )
    )
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
        told = Counter(_place(a.inputs, p, values) for p in here)
        for (shown, rest), alike in told.items():
            # Inputs and mode alike: told apart by the pose and the passive joints alone.
            count = f" [{alike} configurations]" if alike > 1 else ""
            yield "  ", (f"{shown}{rest}{count}",)


def _place(inputs: tuple[str, ...], p: SingularPoint, values: Values) -> tuple[str, str]:
    """Inputs of a singular point, and what else tells it from others."""
    rest = f": {p.mode}" * bool(p.mode)
    end = " (end of the range)" * p.range_end
    rest += " (the whole curve through it)" if p.whole_curve else end
    if len(inputs) <= 3:
        return values.named(inputs, p.inputs.round(12), 10), rest
    names = (p.moving,) if p.moving else inputs
    at = ", ".join(f"{x + 0.0:.6g}" for x in p.position.round(12))
    shown = values.named(names, p.inputs[[inputs.index(n) for n in names]], 10)
    return shown, f"{rest}; output at {unbroken(f'({at})')} m"


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


@checked
def analyze_mechanism(
    mechanism: Mechanism,
    inputs: ArrayLike | None = None,
    *,
    ignore_limits: bool = False,
    seconds: float | None = None,
) -> MechanismAnalysis:
    """Find the singular configurations of a mechanism and state them.

    Each input in turn moves over all the values at which the loops close, through every
    assembly mode, while the others stay at ``inputs``; what is singular there is refined. Where a
    dyad closes the loop, all loci follow in closed form, and each method checks the other.

    Parameters
    ----------
    mechanism : Mechanism
        From ``load_mechanism``.
    inputs : (n_a,) array_like, optional
        Values of the actuated joints, radians and metres; home by default.
    ignore_limits : bool
        Let all joints, active and passive, go beyond their limits.
    seconds : float, optional
        Time for all of it; as long as it takes if not given. Assembly modes are always counted,
        and what has begun of modes and closed forms is brought to its end; the curves of the
        inputs come last. What there is when the time is up, or at Ctrl-C after the assembly
        modes, is returned, and ``missing`` says what is not.

    Returns
    -------
    MechanismAnalysis
        With ``str()``: all of it in words.

    Raises
    ------
    InfeasibleError
        If the loops do not close there; it says where they do.
    OptionError
        If fewer joints are actuated than there are degrees of freedom, or ``seconds`` is no
        positive number.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.loops.analyze_mechanism(pinsing.load_mechanism("four_bar"))
    >>> found.mobility, found.inputs, len(found.assemblies)
    (1, ('crank',), 2)
    """
    if seconds is not None and not seconds > 0:
        raise OptionError(f"seconds must be positive, got {seconds:g}")
    if ignore_limits:
        mechanism = mechanism.without_limits()
    stages = Stages(seconds)
    generic = ranks(mechanism)
    q = home(mechanism)
    asked = q[list(mechanism.actuated)] if inputs is None else mechanism.check_inputs(inputs)
    direct = assembly_modes(mechanism, inputs if inputs is None else asked)
    if not direct.modes:
        if inputs is None and home_outside(mechanism):
            raise home_error(mechanism)
        raise InfeasibleError(mechanism, asked, feasible(mechanism, asked), direct.beyond)
    if inputs is not None:
        q = direct.modes[0].q
    notes = list(mechanism.notes)
    if len(mechanism.actuated) > generic.mobility:
        notes.append(
            f"redundantly actuated: {len(mechanism.actuated)} actuators for {generic.mobility} "
            "degrees of freedom; type 2 means that the output moves with all of them held. They "
            "are moved as far as they are independent, and the others follow"
        )
    notes += filter(None, (without_length(mechanism), home_outside(mechanism)))
    inverse = None
    if generic.output >= generic.mobility:  # else a pose leaves a freedom open
        at_home = output_pose(mechanism, q).homogeneous
        inverse = stages.run("working modes", lambda: working_modes(mechanism, at_home), None, True)
    poses = stages.run(f"{FORMS}pose", lambda: pose_forms(mechanism), None, True)
    forms = stages.run(f"{FORMS}inputs", lambda: loop_forms(mechanism), None, True)
    joints = stages.run(
        "closed forms in the joint angles", lambda: joint_forms(mechanism), None, True
    )
    fixed = poses is None or not poses.architecture
    moved = independent_inputs(mechanism, generic, q)
    ranges: dict[str, tuple[Interval, ...]] = {}
    points: list[SingularPoint] = []
    at = asked if moved is mechanism else q[list(moved.actuated)]
    swept = []
    for k, name in enumerate(moved.inputs if fixed else ()):
        before = len(stages.missing)
        along = stages.run(
            f"curves of {name}, its range and singular points",
            functools.partial(_along, mechanism, moved, at, k, stages),
            None,
        )
        if along is not None:
            found, covered, here = along
            points += here
            if found:
                ranges[name] = covered
            if len(found) == MOST_CURVES:
                notes.append(f"of the curves of {name} {MOST_CURVES} were followed; there are more")
        if len(stages.missing) == before:
            swept.append(name)
    if not fixed:
        notes.append("every pose is of type 2: ranges and points along the inputs are left out")
    return MechanismAnalysis(
        name=mechanism.name,
        source=mechanism.source.label.encode("utf-8", "backslashreplace").decode(),
        loop_file="" if mechanism.loop_file is None else str(mechanism.loop_file),
        joints=mechanism.joints,
        inputs=mechanism.inputs,
        loops=tuple(str(x) for x in mechanism.loops),
        output=mechanism.output,
        task=mechanism.task.name,
        length_scale=mechanism.length_scale,
        mobility=generic.mobility,
        constraint_rank=generic.constraint,
        constraint_rows=mechanism.rows,
        state=mechanism_at(mechanism, q),
        assemblies=direct.modes,
        direct=direct.statement,
        working=() if inverse is None else inverse.modes,
        inverse="" if inverse is None else inverse.statement,
        ranges=ranges,
        points=tuple(points),
        forms=forms,
        pose_forms=poses,
        checks=(
            *_checks(mechanism, asked, tuple(points), forms, swept),
            *_pose_checks(mechanism, poses, tuple(points)),
        ),
        notes=tuple(notes),
        joint_forms=joints,
        missing=tuple(stages.missing),
        why_none="" if poses is not None else why_no_rods(mechanism),
    )


def _along(
    mechanism: Mechanism, moved: Mechanism, inputs: Array, moving: int, stages: Stages
) -> tuple[tuple[Trace, ...], tuple[Interval, ...], tuple[SingularPoint, ...]]:
    """The curves of one input, its range, and what is singular along them."""
    found = judged = curves(moved, inputs, moving, over=lambda: stages.over)
    if moved is not mechanism:
        # With the measures that all actuators together give.
        loops, k = BatchLoops(mechanism), mechanism.actuated.index(moved.actuated[moving])
        judged = tuple(replace(t, input_ratio=measure_many(loops, t.q)[1], moving=k) for t in found)
    points = find_singular(mechanism, judged, over=lambda: stages.over)
    return found, intervals(moved, found, moving), points


def independent_inputs(mechanism: Mechanism, generic: Ranks, q: Array) -> Mechanism:
    """The mechanism driven by as many inputs as it has freedoms; itself where it is."""
    if len(mechanism.actuated) == generic.mobility:
        return mechanism
    inputs = motions(mechanism, q).inputs
    chosen: list[int] = []
    for k in range(len(inputs)):
        if (
            len(chosen) < generic.mobility
            and np.linalg.svd(inputs[[*chosen, k]], compute_uv=False)[len(chosen)] > ROUNDING
        ):
            chosen.append(k)
    return mechanism.with_actuated([mechanism.inputs[k] for k in chosen])


def _checks(
    mechanism: Mechanism,
    inputs: Array,
    points: tuple[SingularPoint, ...],
    forms: LoopForms | None,
    swept: Sequence[str],
) -> list[Check]:
    """Points against loci, and roots of the loci against the inputs ``swept`` to the end."""
    dyad = planar_dyad(mechanism)
    if forms is None or dyad is None:
        return []
    known = {locus.kind for locus in forms.loci}
    # Of a curve that is singular throughout no equation over the inputs tells; the notes do.
    judged = [p for p in points if (p.kind in known or p.kind == "type 3") and not p.whole_curve]
    worst = max(
        (min(abs(float(x.equation(p.inputs))) / x.equation.size for x in forms.loci)
         for p in judged),
        default=0.0,
    )  # fmt: skip
    words = f"{_lie(judged)} on a locus (largest relative value {worst:.1e})"
    # Of nothing, nothing is said.
    out = [Check(words, worst <= ROUNDING)] if judged else []
    asked = [
        (k, name, locus.kind, value)
        for k, name in enumerate(mechanism.inputs)
        if name in swept
        for locus in forms.loci
        for value in roots(locus.equation, inputs, k)
        if dyad.close(np.where(np.arange(len(inputs)) == k, value, inputs), ROUNDING)
    ]
    met = [(p.moving, p.inputs) for p in points]
    missed = [
        f"{name} = {value:.9g} ({kind})"
        for k, name, kind, value in asked
        if all(m != name or abs(np.sin((at[k] - value) / 2)) > ROUNDING for m, at in met)
    ]
    count = len(asked)
    words = f"the sweep missed {len(missed)} of {count} roots: {', '.join(missed)}" if missed else (
        f"the sweep found all {count} feasible roots of the loci along its curves"
    )  # fmt: skip
    return [*out, Check(words, not missed)] if asked else out


def _pose_checks(
    mechanism: Mechanism, forms: PoseForms | None, points: tuple[SingularPoint, ...]
) -> list[Check]:
    """The numbers against the loci over the pose, at each point of the sweep."""
    if forms is None or not forms.loci:
        return []
    if "z" in forms.variables and "e0" not in forms.variables:
        # The equations are of the mode in which the output is not turned.
        points = tuple(
            p for p in points if pose_of(output_pose(mechanism, p.q)).quaternion[0] > 1 - ROUNDING
        )
    if not any(locus.kind == "type 1" for locus in forms.loci):
        # What else is of type 1 the notes say.
        points = tuple(p for p in points if p.kind != "type 1")
    # Of passive joints that are dependent by themselves the pose does not tell.
    own = joint_forms(mechanism)
    alone = [x for x in own.loci if x.kind == "passive"]
    points = tuple(
        p for p in points if all(float(x.ratio(p.q, own.joints)) > ROUNDING for x in alone)
    )
    if not points:
        return []
    worst = max(float(locus_distance(mechanism, forms, p.q)) for p in points)
    regular = locus_distance(mechanism, forms, home(mechanism))
    words = (
        f"{_lie(points)} on a locus over the pose (largest relative value {worst:.1e}; "
        f"{regular:.1e} at home)"
    )
    return [Check(words, worst <= 1e-7)]


def _lie(points: Sequence[SingularPoint]) -> str:
    which = "the one point" if len(points) == 1 else f"each of the {len(points)} points"
    return f"{which} of the sweep lies"
