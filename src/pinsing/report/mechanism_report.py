"""The report of a mechanism with closed loops, as one HTML text."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pinsing._types import Array
from pinsing._version import __version__
from pinsing.mechanism import MechanismAnalysis, MechanismState, analyze_mechanism, mechanism_at
from pinsing.mechanism.dyad import planar_dyad
from pinsing.mechanism.feasible import Interval
from pinsing.mechanism.problems import assemblies
from pinsing.mechanism.solve import InfeasibleError
from pinsing.report.arm_report import SCHEMA
from pinsing.report.arm_sections import counted
from pinsing.report.closing import computed, data, model, result
from pinsing.report.content import Made
from pinsing.report.document import document
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
from pinsing.report.pictures import png, quiet_backend
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
class _Special:
    """Inputs that people ask about first, and what each way to close the loops there is."""

    name: str
    inputs: Array
    states: tuple[MechanismState, ...]
    why: str


def mechanism_report(
    mechanism: Mechanism,
    poses: Mapping[str, Array],
    page: bool,
    beside: str | None,
    skeleton: bool,
) -> tuple[str, str | None]:
    """The report of a mechanism, and the interactive page that belongs beside it.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    poses : mapping of str to (n_a,) array
        More inputs to judge.
    page, beside, skeleton
        As for the report of an arm.
    """
    quiet_backend()
    started = time.monotonic()
    found = analyze_mechanism(mechanism)
    special = tuple(_special(mechanism, found, poses))
    shown = _page(mechanism, found, skeleton) if page or beside is not None else None
    sections = [
        _summary(mechanism, found),
        _robot(mechanism, found),
        _assumed(found),
        _maps(mechanism),
        _loci(mechanism, found),
        _points(mechanism, found),
        _verdicts(mechanism, special),
        _sure(found),
        model(shown if page and shown is not None else None, beside if shown is not None else None),
    ]
    made = Made.since(started)
    sections += [computed(made, "Pinocchio", []), _words(), data(SCHEMA)]
    html = document(
        title=f"Singular configurations of {mechanism.name}",
        subtitle=f"driven by {', '.join(mechanism.inputs)}; {made.when}",
        sections=[s for s in sections if s is not None],
        data={
            "schema": SCHEMA,
            "made": made.when,
            "seconds": made.seconds,
            "versions": dict(made.versions),
            "mechanism": result(found),
            "special": [
                {
                    "name": s.name,
                    "inputs": s.inputs.tolist(),
                    "states": [result(x) for x in s.states],
                }
                for s in special
            ],
        },
        page=shown if page else None,
        foot=f"Made by pinsing {__version__}.",
    )
    return html, shown


def _page(mechanism: Mechanism, found: MechanismAnalysis, skeleton: bool) -> str:
    from pinsing.view.mechanism.viewer import MechanismViewer

    with MechanismViewer(mechanism, found, skeleton=skeleton) as viewer:
        return viewer.html()


def _special(
    mechanism: Mechanism, found: MechanismAnalysis, poses: Mapping[str, Array]
) -> Iterator[_Special]:
    actuated = list(mechanism.actuated)
    lower, upper = mechanism.lower[actuated], mechanism.upper[actuated]
    ends = np.isfinite(lower) & np.isfinite(upper)
    middle = np.where(ends, (np.where(ends, lower, 0) + np.where(ends, upper, 0)) / 2, 0.0)
    named = {"home": found.state.inputs, "zero": np.zeros(len(actuated)), "mid-range": middle}
    if np.array_equal(named["zero"], middle):
        del named["mid-range"]
        named = {("zero, which is mid-range" if k == "zero" else k): v for k, v in named.items()}
    for key, inputs in {**named, **poses}.items():
        if key == "home":
            yield _Special(key, inputs, (found.state,), "")
            continue
        try:
            closed = assemblies(mechanism, inputs)
        except InfeasibleError as problem:
            yield _Special(key, inputs, (), str(problem))
            continue
        yield _Special(key, inputs, tuple(mechanism_at(mechanism, s.q) for s in closed), "")


def _summary(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
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


def _robot(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
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


def _assumed(a: MechanismAnalysis) -> Section:
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


def _maps(mechanism: Mechanism) -> Section | None:
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


def _loci(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
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


def _points(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
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


def _verdicts(mechanism: Mechanism, special: Sequence[_Special]) -> Section:
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


def _sure(a: MechanismAnalysis) -> Section:
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


def _words() -> Section:
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
