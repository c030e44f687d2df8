"""Sections of the report of a mechanism."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.loops import MechanismAnalysis, MechanismState
from pinsing.loops.dyad import planar_dyad
from pinsing.loops.solve import Interval
from pinsing.report.arm_sections import counted
from pinsing.report.document import (
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
from pinsing.report.mechanism_loci import TYPES, input_value, input_values
from pinsing.report.pictures import png
from pinsing.robot.mechanism import Mechanism

Section = tuple[str, str, str]

_TONES = {"regular": "good"}


@dataclass(frozen=True, eq=False)
class SpecialInputs:
    """Inputs that people ask about first, and what each way to close the loops there is.

    Where there is none, ``word`` and ``why`` say so.
    """

    name: str
    inputs: Array
    states: tuple[MechanismState, ...]
    why: str
    word: str = "does not close"


def summary(mechanism: Mechanism, a: MechanismAnalysis) -> Section:
    """What it is and what is met on the way."""
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
    loci = a.pose_forms.loci if a.pose_forms is not None else ()
    pairs = [(x.kind, x.words) for x in loci]
    if a.pose_forms is not None:
        pairs += [(x.kind, str(x)) for x in a.pose_forms.everywhere if hasattr(x, "kind")]
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
    rows = []
    for i, joint in enumerate(mechanism.joints):
        slides = bool(mechanism.prismatic[i])
        low, high = float(mechanism.lower[i]), float(mechanism.upper[i])
        rows.append(
            (
                name(joint),
                text("prismatic" if slides else "revolute"),
                text("driven" if i in mechanism.actuated else "passive"),
                text(input_value(low, slides) if math.isfinite(low) else "none"),
                text(input_value(high, slides) if math.isfinite(high) else "none"),
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
            "Points are found along curves on which one input moves and the others stay at home, "
            "within the limits of all joints, active and passive. Collisions, backlash and "
            "stiffness are not looked at."
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
        map_legend(ax, mechanism)
    drawn.tight_layout()
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
        "Singular points on the way",
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


def sure(a: MechanismAnalysis) -> Section:
    """What is exact and what is numeric."""
    whole = [
        words
        for forms, words in (
            (a.forms, "over the inputs"), (a.pose_forms, "over the pose of the output"),
            (a.joint_forms, "in the joint angles"),
        )
        if forms is not None and forms.complete
    ]  # fmt: skip
    if whole:
        said = paragraph(
            badge("complete", "good"),
            text(f"The loci {' and '.join(whole)} hold every singular configuration: each step is "
                 "exact. No certificate exists for mechanisms."),
        )  # fmt: skip
    elif a.forms is None and a.pose_forms is None:
        said = paragraph(
            badge("numeric"),
            text("The list holds what lies on the curves that were followed, and claims no more."),
        )
    else:
        said = paragraph(badge("not complete", "caution"), text("See what was assumed."))
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
    pairs = [(text(kind), text(words)) for kind, words in TYPES.items()]
    pairs.append(
        (
            text("assembly mode"),
            text("One of the ways to close the loops at given inputs; it changes at type 2."),
        )
    )
    return section("words", "What the words mean", terms(pairs))


def _interval(mechanism: Mechanism, key: str, found: Interval) -> str:
    if found.whole:
        return "the whole circle"
    slides = bool(mechanism.prismatic[mechanism.joints.index(key)])
    return f"{input_value(found.lower, slides)} to {input_value(found.upper, slides)}"
