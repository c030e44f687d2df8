"""Sections of the report of a mechanism."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.mechanism import MechanismAnalysis, MechanismState
from pinsing.mechanism.dyad import planar_dyad
from pinsing.mechanism.feasible import Interval
from pinsing.report.arm_sections import counted
from pinsing.report.markup import (
    badge,
    bullets,
    figure,
    name,
    paragraph,
    section,
    table,
    terms,
    text,
)
from pinsing.report.markup import math as formula
from pinsing.report.pictures import png
from pinsing.robot.mechanism import Mechanism

Section = tuple[str, str, str]

_TYPES = {
    "type 1": "The output cannot move in some direction, whatever the inputs do.",
    "type 2": "The output can move although all inputs are locked: forces on it are not held.",
    "type 3": "Both at once.",
    "constraint": "The mechanism gains motions that its mobility does not count.",
}
_TONES = {"regular": "good"}
_MOST_POINTS = 60


@dataclass(frozen=True, eq=False)
class SpecialInputs:
    """Inputs that people ask about first, and what each way to close the loops there is."""

    name: str
    inputs: Array
    states: tuple[MechanismState, ...]
    why: str


def summary(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
    """What it is and what is met on the way."""
    kinds = [k for k in _TYPES if any(p.kind == k for p in a.points)]
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
    home = badge(a.state.kind, _TONES.get(a.state.kind, "alarm"))
    rows = [
        (
            text(f"L{k}"),
            text(locus.kind),
            text(locus.words),
            text("found" if locus.witness else "none found"),
        )
        for k, locus in enumerate(a.forms.loci if a.forms else (), 1)
    ]
    header = ("", "kind", "what is in line", "configuration that closes the loops")
    return section(
        "summary",
        "Summary",
        lead,
        paragraph(text(said)),
        bullets(f"<b>{text(kind)}.</b> {text(_TYPES[kind])}" for kind in kinds),
        paragraph(text("At home the mechanism is"), home + "."),
        table("Singular loci over the inputs", header, rows) if rows else "",
    )


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
    rows = []
    for i, joint in enumerate(mechanism.joints):
        slides = bool(mechanism.prismatic[i])
        low, high = float(mechanism.lower[i]), float(mechanism.upper[i])
        rows.append(
            (
                name(joint),
                text("prismatic" if slides else "revolute"),
                text("driven" if i in mechanism.actuated else "passive"),
                text(_value(low, slides) if math.isfinite(low) else "none"),
                text(_value(high, slides) if math.isfinite(high) else "none"),
            )
        )
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
    """What the answers rest on."""
    rows = [text(note) for note in a.notes]
    rows += [text(note) for note in (a.forms.notes if a.forms else ())]
    rows.append(
        text(
            "Points are found along curves on which one input moves and the others stay at home; "
            "joint limits are not applied to them. Collisions, backlash and stiffness are not "
            "looked at."
        )
    )
    return section("assumed", "What was assumed", bullets(rows))


def maps(mechanism: Mechanism) -> Section | None:
    """Maps over two inputs, for a planar dyad."""
    if planar_dyad(mechanism) is None or len(mechanism.inputs) != 2:
        return None
    from matplotlib import pyplot as plt

    from pinsing.plot.mechanism import input_map, map_legend

    drawn, axes = plt.subplots(1, 2, figsize=(9, 5.2))
    for ax, sign in zip(axes, "+-", strict=True):
        input_map(mechanism, sign, ax, samples=361)
        map_legend(ax)
    drawn.tight_layout()
    alt = (
        f"Two maps over {mechanism.inputs[0]} and {mechanism.inputs[1]}, one for each assembly "
        "mode: where the loops close, and the curves of type 1 and type 2 singularities."
    )
    caption = text("Where the loops close (light green), and the singular loci, by assembly mode.")
    return section("map", "Map over the inputs", figure(png(drawn), alt, caption))


def loci(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
    """Each locus with its equation and a picture."""
    if a.forms is None:
        words = (
            "No closed form: no planar dyad closes the loops, so that the singular points below "
            "are numeric."
        )
        return section("families", "The loci", paragraph(text(words)))
    parts = []
    for k, locus in enumerate(a.forms.loci, 1):
        parts.append(f'<h3 id="L{k}">{text(f"L{k}: {locus.kind}")}</h3>')
        parts.append(f'<div class="equation">{formula(locus.equation.latex())}</div>')
        parts.append(paragraph(text(f"{locus.words}. {_TYPES[locus.kind]}")))
        if locus.points_only:
            parts.append(paragraph(text("Only single points of the inputs fulfil it.")))
        if locus.witness is None:
            parts.append(paragraph(text("No configuration that closes the loops was found on it.")))
            continue
        values = _inputs(mechanism, locus.witness.inputs)
        parts.append(paragraph(text("For instance at"), name(values) + text(".")))
        parts.append(_picture(mechanism, locus.witness.q, locus.kind))
    symbols = [f"{name(joint)}" for joint in mechanism.inputs]
    parts.append(paragraph(text("Angles are those of"), ", ".join(symbols) + ".", kind="sub"))
    return section("families", "The loci", *parts)


def _picture(mechanism: Mechanism, q: Array, kind: str) -> str:
    """The linkage in its plane, where it has one."""
    if planar_dyad(mechanism) is None:
        return ""
    from matplotlib import pyplot as plt

    from pinsing.plot.mechanism import draw_linkage

    drawn, ax = plt.subplots(figsize=(4.6, 4.0))
    draw_linkage(mechanism, q, ax)
    ax.set_xlabel("x [m]", fontsize=8)
    ax.set_ylabel("y [m]", fontsize=8)
    ax.tick_params(labelsize=7)
    marks = {
        "type 1": "the red ellipse of output velocities has become a line",
        "type 2": "blue arrows show the motion that locked inputs do not hold",
    }
    caption = f"The linkage there: {marks[kind]}." if kind in marks else "The linkage there."
    return figure(png(drawn), f"The linkage drawn in its plane at that configuration; {caption}",
                  text(caption))  # fmt: skip


def points(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
    """Singular points where one input moves."""
    rows = [
        (
            text(p.kind),
            name(_inputs(mechanism, p.inputs)),
            text(p.mode),
            text("end of the range" if p.range_end else ""),
        )
        for p in a.points[:_MOST_POINTS]
    ]
    header = ("kind", "inputs", "mode", "")
    more = len(a.points) - len(rows)
    return section(
        "points",
        "Singular points on the way",
        paragraph(text("One input moves, the others stay at home.")),
        table("Singular points", header, rows) if rows else paragraph(text("None.")),
        paragraph(text(f"{more} more are in the JSON.")) if more else "",
    )


def verdicts(mechanism: Mechanism, special: Sequence[SpecialInputs]) -> Section:
    """Special inputs, each way to close the loops judged."""
    rows = []
    for s in special:
        where = name(_inputs(mechanism, s.inputs))
        if not s.states:
            rows.append((name(s.name), where, badge("does not close"), text(s.why), ""))
        for state in s.states:
            said = badge(
                "near-singular" if state.near and state.kind == "regular" else state.kind,
                "caution" if state.near and state.kind == "regular"
                else _TONES.get(state.kind, "alarm"),
            )  # fmt: skip
            rows.append(
                (
                    name(s.name),
                    where,
                    said,
                    text(state.mode),
                    text(f"{state.output_ratio:.2g} / {state.input_ratio:.2g}"),
                )
            )
    header = ("", "inputs", "verdict", "mode", "type 1 / type 2 measure")
    return section("special", "Special configurations", table("Verdicts", header, rows))


def sure(a: MechanismAnalysis) -> Section:
    """What is exact and what is numeric."""
    if a.forms is None:
        said = paragraph(
            badge("numeric"),
            text("The list holds what lies on the curves that were followed, and claims no more."),
        )
    elif a.forms.complete:
        said = paragraph(
            badge("complete", "good"),
            text("The loci follow by exact elimination; no certificate exists for mechanisms."),
        )
    else:
        said = paragraph(badge("not complete", "caution"), text("See what was assumed."))
    rows = [
        f"{badge('agrees' if c.passed else 'DISAGREES', 'good' if c.passed else 'alarm')} "
        f"{text(c.words)}"
        for c in a.checks
    ]
    return section("proof", "How sure this is", said, bullets(rows))


def words() -> Section:
    """The terms of the report."""
    pairs = [(text(kind), text(words)) for kind, words in _TYPES.items()]
    pairs.append(
        (
            text("assembly mode"),
            text("One of the ways to close the loops at given inputs; it changes at type 2."),
        )
    )
    return section("words", "What the words mean", terms(pairs))


def _inputs(mechanism: Mechanism, inputs: Array) -> str:
    return ", ".join(
        f"{key} = {_value(float(v), bool(mechanism.prismatic[j]))}"
        for key, v, j in zip(mechanism.inputs, inputs, mechanism.actuated, strict=True)
    )


def _value(value: float, slides: bool) -> str:
    return f"{value:.6g} m" if slides else f"{math.degrees(value) + 0.0:.6g}°"


def _interval(mechanism: Mechanism, key: str, found: Interval) -> str:
    if found.whole:
        return "the whole circle"
    slides = bool(mechanism.prismatic[mechanism.joints.index(key)])
    return f"{_value(found.lower, slides)} to {_value(found.upper, slides)}"
