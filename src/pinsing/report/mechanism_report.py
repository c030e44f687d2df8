"""The report of a mechanism with closed loops, as one HTML text."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pinsing.loops import MechanismAnalysis, MechanismState, analyze_mechanism, mechanism_at
from pinsing.loops.analysis import Line, joint_lines, pose_lines
from pinsing.loops.closure import planar_dyad
from pinsing.loops.map import COARSE, free_coordinates, pose_slice
from pinsing.loops.motion import home
from pinsing.loops.solve import (
    InfeasibleError,
    Interval,
    assemblies,
)
from pinsing.measures import ROUNDING, Array
from pinsing.plot.mechanism import (
    draw_linkage,
    input_map,
    mode_sheet,
    motion_curve,
    panels,
    pose_maps,
)
from pinsing.plot.style import SMALL, labelled, legend_of_all
from pinsing.prose import Page, escaped as text
from pinsing.report.document import (
    Section,
    badge,
    bullets,
    counted,
    document,
    figure,
    limit_text,
    math as formula,
    name,
    paragraph,
    png,
    section,
    table,
    terms,
)
from pinsing.robot.mechanism import Mechanism

TYPES = {
    "type 1": "The output cannot move in some direction, whatever the inputs do.",
    "type 2": "The output can move although all inputs are locked: forces on it are not held.",
    "type 3": "Both at once.",
    "constraint": "The mechanism gains motions that its mobility does not count.",
}
_PAGE = Page(84)
_MOST_TRIED = 8


def input_values(mechanism: Mechanism, inputs: Array) -> str:
    """Inputs by name."""
    return ", ".join(
        f"{key} = {limit_text(float(v), bool(mechanism.prismatic[j]))}"
        for key, v, j in zip(mechanism.inputs, inputs, mechanism.actuated, strict=True)
    )


def loci(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
    """Every closed form that there is, and if there is none, why."""
    parts = [*_over_inputs(mechanism, a), *_over_pose(a), *_in_joints(a)]
    if not parts:
        words = (
            "There is no closed form: neither does a planar dyad close the loops, nor does each "
            "leg pass one force, nor have the closure equations a determinant. The singular "
            "points below are numeric."
        )
        parts = [paragraph(text(words))]
    return section("families", "The loci", *parts)


def modes(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
    """All modes side by side."""
    drawn = mode_sheet(mechanism, found=((a.direct, a.assemblies), (a.inverse, a.working)))
    for ax in drawn.axes:
        ax.set_title(ax.get_title().replace(", elbows", "\nelbows"), fontsize=8)
    alt = (
        "The mechanism drawn in each of its modes: those at the inputs of home, and those at the "
        "pose of home."
    )
    words = [text(f"At the inputs of home: {a.direct}.")]
    if a.inverse:
        words.append(text(f"For the pose of home: {a.inverse}."))
    caption = text("The modes side by side; driven links are blue, the output is red.")
    return section("modes", "The modes", paragraph(*words), figure(png(drawn), alt, caption))


def aspects(mechanism: Mechanism, a: MechanismAnalysis) -> Section | None:
    """A slice through the workspace, or all poses of one freedom."""
    if a.mobility == 1:
        drawn = motion_curve(mechanism).figure
        words = "All poses of the mechanism, by assembly mode, with what is singular."
        return section(
            "aspects", "The motion", figure(png(drawn), f"A curve: {words}", text(words))
        )
    if a.joint_forms is None or not a.joint_forms.complete:
        return None
    over = _telling(mechanism)
    names = " and ".join(over)
    words = (
        f"What the output reaches over {names}, the rest of its pose as at home, within the limits "
        "of all joints: no singular pose parts what has one colour. Green and blue are the "
        "assembly mode of home."
    )
    drawn = pose_maps(mechanism, over)
    return section(
        "aspects", "The workspace by mode", figure(png(drawn), f"Maps. {words}", text(words))
    )


def _telling(mechanism: Mechanism) -> tuple[str, str]:
    """Two coordinates over which the slice at home shows more than one aspect; else the first."""
    free = free_coordinates(mechanism)
    pairs = [(a, b) for k, a in enumerate(free) for b in free[k + 1 :]]
    # Two positions are easiest to read, then a position and a turn.
    pairs.sort(key=lambda pair: sum(name in ("roll", "pitch", "yaw") for name in pair))
    for pair in pairs[:_MOST_TRIED]:
        found = pose_slice(mechanism, pair, [home(mechanism)], COARSE)
        if len(panels(mechanism, found, [""])[0].positive) > 1:
            return pair
    return pairs[0]


def _over_inputs(mechanism: Mechanism, a: MechanismAnalysis) -> Iterator[str]:
    if a.forms is None:
        return
    yield f"<h3>{text('Over the inputs')}</h3>"
    for k, locus in enumerate(a.forms.loci, 1):
        yield f'<h3 id="L{k}">{text(f"L{k}: {locus.kind}")}</h3>'
        yield f'<div class="equation">{formula(locus.equation.latex())}</div>'
        yield paragraph(text(f"{locus.words}. {TYPES[locus.kind]}"))
        if locus.points_only:
            yield paragraph(text("Only single points of the inputs fulfil it."))
        if locus.witness is None:
            yield paragraph(text("No configuration that closes the loops was found on it."))
            continue
        values = input_values(mechanism, locus.witness.inputs)
        yield paragraph(text("For instance at"), name(values) + text("."))
        yield _picture(mechanism, locus.witness.q, locus.kind)
    symbols = [name(joint) for joint in mechanism.inputs]
    yield paragraph(text("The angles are those of"), ", ".join(symbols) + ".", kind="sub")


def _over_pose(a: MechanismAnalysis) -> Iterator[str]:
    if a.pose_forms is None:
        return
    yield f"<h3>{text('Over the pose of the output')}</h3>"
    if {"e0"} & set(a.pose_forms.variables):
        words = (
            "x, y, z in metres, and the unit quaternion e0, e1, e2, e3 of the output (e0 first)."
        )
    else:
        words = "x, y, z in metres; φ is the rotation of the output."
    yield paragraph(text(words), kind="sub")
    yield _written(list(pose_lines(a.pose_forms)))


def _in_joints(a: MechanismAnalysis) -> Iterator[str]:
    if a.joint_forms is None:
        return
    yield f"<h3>{text('In the joint angles')}</h3>"
    lines = list(joint_lines(a.joint_forms, True))
    # Letters of written-out determinants; longer ones are left to the JSON.
    if sum(map(len, map(_plain, lines))) > 12_000:
        lines = list(joint_lines(a.joint_forms, False))
    yield _written(lines)


def _written(lines: Sequence[Line]) -> str:
    return f"<pre>{text(chr(10).join(_plain(line) for line in lines))}</pre>"


def _plain(line: Line) -> str:
    return _PAGE.paragraph(*line[1], first=line[0], rest=line[0] + "  ")


def _picture(mechanism: Mechanism, q: Array, kind: str) -> str:
    """The linkage in its plane, where it has one."""
    if planar_dyad(mechanism) is None:
        return ""
    from matplotlib import pyplot as plt

    drawn, ax = plt.subplots(figsize=(3.4, 3.0))
    draw_linkage(mechanism, q, ax)
    labelled(ax, "x [m]", "y [m]", numbers=SMALL - 1)
    marks = {
        "type 1": "the red ellipse of output velocities has become a line",
        "type 2": "blue arrows show the motion that locked inputs do not hold",
    }
    # Velocities are drawn of an output whose motion in the plane counts.
    moved = {0, 1} <= set(mechanism.task.rows)
    caption = (
        f"The linkage there: {marks[kind]}." if kind in marks and moved else "The linkage there."
    )
    return figure(png(drawn), f"The linkage drawn in its plane at that configuration; {caption}",
                  text(caption))  # fmt: skip


_TONES = {"regular": "good"}


@dataclass(frozen=True, eq=False)
class SpecialInputs:
    """Inputs that people ask about first, and each way to close the loops there.

    Where there is none, ``word`` and ``why`` say so.
    """

    name: str
    inputs: Array
    states: tuple[MechanismState, ...]
    why: str
    word: str


def summary(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
    """Return what it is and what is met on the way."""
    kinds = [k for k in TYPES if any(p.kind == k for p in a.points)]
    met = ", ".join(kinds) if kinds else "no singular configuration"
    lead = paragraph(
        name(a.name),
        text(f"has {counted(len(a.joints), 'joint', 'joints')} and"),
        text(f"{counted(a.mobility, 'degree', 'degrees')} of freedom. It is driven by"),
        text(" and ").join(map(name, a.inputs)) + text("; what counts is the motion of"),
        name(a.output),
        text(f"({a.task})."),
        kind="lead",
    )
    said = f"Where one input moves and the others stay at home, the analysis meets: {met}."
    architecture = a.pose_forms.architecture if a.pose_forms is not None else ""
    home = badge(a.state.kind, _TONES.get(a.state.kind, "alarm"))
    rows, header = _listed(a)
    return section(
        "summary",
        "Summary",
        lead,
        certainty(a),
        paragraph(text(said)),
        bullets(f"<b>{text(kind)}.</b> {text(TYPES[kind])}" for kind in kinds),
        paragraph(text("At home the mechanism is"), home + "."),
        paragraph(text(f"Architecture: {architecture}.")) if architecture else "",
        table("Singular loci in closed form", header, rows) if rows else "",
    )


def _listed(a: MechanismAnalysis) -> tuple[list[tuple[str, ...]], tuple[str, ...]]:
    """The loci in words: over the inputs, else over the pose, else in the joint angles."""
    if a.forms is not None:
        header: tuple[str, ...] = (
            "", "kind", "what is in line", "configuration that closes the loops"
        )  # fmt: skip
        told = [(x.kind, x.words, "found" if x.witness else "none found") for x in a.forms.loci]
        return [(text(f"L{k}"), *map(text, words)) for k, words in enumerate(told, 1)], header
    pairs = [(x.kind, x.words) for x in (a.pose_forms.loci if a.pose_forms is not None else ())]
    if not pairs and a.joint_forms is not None:
        pairs = [(x.kind, x.words) for x in a.joint_forms.loci if x.kind != "passive"]
    distinct = list(dict.fromkeys(pairs))
    return [(text(kind), text(words)) for kind, words in distinct], ("kind", "what happens there")


def robot(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
    """Joints, loops and ranges."""
    pairs = [
        ("mechanism", name(a.name)),
        ("described by", name(a.source)),
        ("loops", "<br>".join(map(name, a.loops))),
        ("degrees of freedom", text(str(a.mobility))),
        (
            "closure equations",
            text(f"{a.constraint_rank} independent of {a.constraint_rows} written"),
        ),
        ("output", f"{name(a.output)} {text(f'({a.task})')}"),
        ("length scale", text(f"{a.length_scale:g} m")),
    ]
    limits = (mechanism.prismatic.tolist(), mechanism.lower.tolist(), mechanism.upper.tolist())
    rows = [
        (
            name(joint),
            text("prismatic" if slides else "revolute"),
            text("driven" if i in mechanism.actuated else "passive"),
            text(limit_text(low, slides)),
            text(limit_text(high, slides)),
        )
        for i, (joint, slides, low, high) in enumerate(zip(mechanism.joints, *limits, strict=True))
    ]
    header = ("joint", "type", "", "from", "to")
    ranges = [
        (name(key), text(" or ".join(_interval(mechanism, key, i) for i in found) or "nothing"))
        for key, found in a.ranges.items()
    ]
    return section(
        "robot",
        "The mechanism",
        terms(pairs),
        table("Joints with their limits", header, rows, (3, 4)),
        paragraph(text("The loops close, the other inputs at home, for:")),
        terms(ranges),
    )


def assumed(a: MechanismAnalysis) -> Section:
    """Return what the answers rest on."""
    rows = (
        *a.notes,
        *(a.forms.notes if a.forms else ()),
        "Points are found along curves on which one input moves and the others stay at home, "
        "within the limits of all joints, active and passive. Collisions, backlash and "
        "stiffness are not looked at.",
    )
    return section("assumed", "What was assumed", bullets(map(text, rows)))


def maps(mechanism: Mechanism) -> Section | None:
    """Maps over two inputs, for a planar dyad."""
    if planar_dyad(mechanism) is None or len(mechanism.inputs) != 2:
        return None
    from matplotlib import pyplot as plt

    drawn, axes = plt.subplots(1, 2, figsize=(7.0, 3.3), layout="constrained")
    for ax, sign in zip(axes, "+-", strict=True):
        input_map(mechanism, sign, ax, samples=361)
    legend_of_all(axes)
    alt = (
        f"Two maps over {mechanism.inputs[0]} and {mechanism.inputs[1]}, one for each assembly "
        "mode: where the loops close, and the curves of type 1 and type 2 singularities."
    )
    caption = text("Where the loops close (light green), and the singular loci, by assembly mode.")
    return section("map", "Map over the inputs", figure(png(drawn), alt, caption))


def points(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
    """Singular points where one input moves."""
    rows = [
        (
            text(p.kind),
            name(input_values(mechanism, p.inputs)),
            text(p.mode),
            text("end of the range" if p.range_end else ""),
        )
        for p in a.points[:60]
    ]
    header = ("kind", "inputs", "mode", "")
    more = len(a.points) - len(rows)
    return section(
        "points",
        "Singular points on the path",
        paragraph(text("One input moves, the others stay at home.")),
        table("Singular points", header, rows) if rows else paragraph(text("None.")),
        paragraph(text(f"{more} more are in the JSON.")) if more else "",
    )


def verdicts(mechanism: Mechanism, special: Sequence[SpecialInputs]) -> Section:
    """Special inputs, each way to close the loops judged."""
    rows = []
    for s in special:
        where = name(input_values(mechanism, s.inputs))
        if not s.states:
            rows.append((name(s.name), where, badge(s.word), text(s.why), ""))
        for k, state in enumerate(s.states, 1):
            which = s.name if len(s.states) == 1 else f"{s.name} ({k} of {len(s.states)})"
            said = badge(
                "near-singular" if state.near and state.kind == "regular" else state.kind,
                "caution" if state.near and state.kind == "regular"
                else _TONES.get(state.kind, "alarm"),
            )  # fmt: skip
            rows.append(
                (
                    name(which),
                    where,
                    said,
                    text(state.mode),
                    text(f"{state.output_ratio:.2g} / {state.input_ratio:.2g}"),
                )
            )
    header = ("", "inputs", "verdict", "mode", "type 1 / type 2 measure")
    return section("special", "Special configurations", table("Verdicts", header, rows))


def certainty(a: MechanismAnalysis) -> str:
    """Return how sure it is that nothing is missing."""
    whole = [
        words
        for forms, words in (
            (a.forms, "over the inputs"), (a.pose_forms, "over the pose of the output"),
            (a.joint_forms, "in the joint angles"),
        )
        if forms is not None and forms.complete
    ]  # fmt: skip
    if whole:
        return paragraph(
            badge("complete", "good"),
            text(f"The loci {' and '.join(whole)} hold every singular configuration: each step is "
                 "exact. No certificate exists for mechanisms."),
        )  # fmt: skip
    if a.forms is None and a.pose_forms is None:
        return paragraph(
            badge("numeric"),
            text("The list holds what lies on the curves that were followed, and claims no more."),
        )
    return paragraph(badge("not complete", "caution"), text("See what was assumed."))


def sure(a: MechanismAnalysis) -> Section:
    """Return what is exact and what is numeric."""
    said = certainty(a)
    if not a.checks:
        said += paragraph(
            text("The sweep met no singular point that could be compared with the equations.")
        )
    rows = [
        f"{badge('agrees' if c.passed else 'DISAGREES', 'good' if c.passed else 'alarm')} "
        f"{text(c.words)}"
        for c in a.checks
    ]
    return section("proof", "How sure this is", said, bullets(rows))


def words() -> Section:
    """The terms of the report."""
    mode = "One solution of the loops at given inputs; it changes at type 2."
    pairs = [(text(a), text(b)) for a, b in {**TYPES, "assembly mode": mode}.items()]
    return section("words", "What the words mean", terms(pairs))


def _interval(mechanism: Mechanism, key: str, found: Interval) -> str:
    if found.whole:
        return "the full circle"
    slides = bool(mechanism.prismatic[mechanism.joints.index(key)])
    return f"{limit_text(found.lower, slides)} to {limit_text(found.upper, slides)}"


def mechanism_report(
    mechanism: Mechanism, poses: Mapping[str, Array], page: bool, beside: str | None, skeleton: bool
) -> tuple[str, str | None]:
    """Return the report of a mechanism, judging ``poses`` (inputs (n_a,)); pages as of an arm."""
    started = time.monotonic()
    found = analyze_mechanism(mechanism)
    if found.missing:  # Ctrl-C
        raise KeyboardInterrupt
    special = tuple(_special(mechanism, found, poses))
    shown = _page(mechanism, found, skeleton) if page or beside is not None else None
    sections = [
        summary(mechanism, found),
        maps(mechanism),
        modes(mechanism, found),
        aspects(mechanism, found),
        loci(mechanism, found),
        points(mechanism, found),
        verdicts(mechanism, special),
        sure(found),
        robot(mechanism, found),
        assumed(found),
    ]
    html = document(
        mechanism.name,
        f"driven by {', '.join(mechanism.inputs)}",
        sections,
        words(),
        {
            "mechanism": found.to_dict(),
            "special": [
                {
                    "name": s.name,
                    "inputs": s.inputs.tolist(),
                    "states": [x.to_dict() for x in s.states],
                }
                for s in special
            ],
        },
        started=started,
        engine="Pinocchio",
        page=shown if page else None,
        beside=beside,
    )
    return html, shown


def _page(mechanism: Mechanism, found: MechanismAnalysis, skeleton: bool) -> str:
    from pinsing.view.mechanism_viewer import MechanismViewer

    with MechanismViewer(mechanism, found, skeleton=skeleton) as viewer:
        return viewer.html()


def _special(
    mechanism: Mechanism, found: MechanismAnalysis, poses: Mapping[str, Array]
) -> Iterator[SpecialInputs]:
    actuated = list(mechanism.actuated)
    lower, upper = mechanism.lower[actuated], mechanism.upper[actuated]
    ends = np.isfinite(lower) & np.isfinite(upper)
    middle = np.where(ends, (np.where(ends, lower, 0) + np.where(ends, upper, 0)) / 2, 0.0)
    alike = ends.any() and not middle.any()
    zero = "zero, which is mid-range" if alike else "zero"
    named = {"home": found.state.inputs, zero: np.zeros(len(actuated))}
    if ends.any() and not alike:  # without limits there is no middle
        named["mid-range"] = middle
    for key, inputs in {**named, **poses}.items():
        states: tuple[MechanismState, ...] = ()
        why, word = "", "does not close"
        beyond = [
            name
            for name, v, low, high in zip(mechanism.inputs, inputs, lower, upper, strict=True)
            if not low - ROUNDING <= v <= high + ROUNDING
        ]
        if key == "home":
            states = (found.state,)
        elif beyond:
            why, word = f"{', '.join(beyond)}: beyond the limits", "outside the limits"
        else:
            try:
                closed = assemblies(mechanism, inputs)
                states = tuple(mechanism_at(mechanism, s.q) for s in closed)
            except InfeasibleError as problem:
                why = str(problem)
        yield SpecialInputs(key, inputs, states, why, word)
