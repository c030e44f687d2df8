"""The loci of a mechanism in its report: over the inputs, over the pose, in the joint angles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from pinsing._types import Array
from pinsing.loops import MechanismAnalysis
from pinsing.loops.dyad import planar_dyad
from pinsing.loops.pose_slice import free_coordinates
from pinsing.loops.result import Line, joint_lines, pose_lines
from pinsing.prose import Page
from pinsing.report.document import figure, name, paragraph, section, text
from pinsing.report.document import math as formula
from pinsing.report.pictures import png
from pinsing.robot.mechanism import Mechanism

Section = tuple[str, str, str]

TYPES = {
    "type 1": "The output cannot move in some direction, whatever the inputs do.",
    "type 2": "The output can move although all inputs are locked: forces on it are not held.",
    "type 3": "Both at once.",
    "constraint": "The mechanism gains motions that its mobility does not count.",
}
_PAGE = Page(84)
_ROUGH, _MOST_TRIED = 41, 8


def input_value(value: float, slides: bool) -> str:
    """A value with its unit, for people."""
    return f"{value:.6g} m" if slides else f"{math.degrees(value) + 0.0:.6g}°"


def input_values(mechanism: Mechanism, inputs: Array) -> str:
    """Inputs by name."""
    return ", ".join(
        f"{key} = {input_value(float(v), bool(mechanism.prismatic[j]))}"
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
    from pinsing.loops.problems import Modes
    from pinsing.plot.mode_sheet import mode_sheet

    def found(problem: str, solutions: object, statement: str) -> Modes:
        return Modes(problem, solutions, 0, (), 0, 0, None, False, statement)  # type: ignore[arg-type]

    direct = found("direct", a.assemblies, a.direct)
    inverse = found("inverse", a.working, a.inverse) if a.inverse else None
    drawn = mode_sheet(mechanism, a.state.inputs, True, direct, inverse)
    alt = (
        "The mechanism drawn in each of its modes: those at the inputs of home, and those at the "
        "pose of home."
    )
    words = [text(f"At the inputs of home: {a.direct}.")]
    if a.inverse:
        words.append(text(f"For the pose of home: {a.inverse}."))
    caption = text("The modes side by side; driven links are blue, the output is red.")
    return section("modes", "The modes", paragraph(*words), figure(png(drawn, 110), alt, caption))


def aspects(mechanism: Mechanism, a: MechanismAnalysis) -> Section | None:
    """A slice through the workspace, or all poses of one freedom."""
    if a.mobility == 1:
        from pinsing.plot.motion_curve import motion_curve

        drawn = motion_curve(mechanism).figure
        words = "All poses of the mechanism, by assembly mode, with what is singular."
        return section(
            "aspects", "The motion", figure(png(drawn), f"A curve: {words}", text(words))
        )
    if a.joint_forms is None or not a.joint_forms.complete:
        return None
    from pinsing.plot.pose_map import pose_maps

    over = _telling(mechanism)
    names = " and ".join(over)
    words = (
        f"What the output reaches over {names}, the rest of its pose as at home, within the limits "
        "of all joints: no singular pose parts what has one colour. Green and blue are the "
        "assembly mode of home."
    )
    drawn = pose_maps(mechanism, over)
    return section(
        "aspects", "The workspace by mode", figure(png(drawn, 110), f"Maps. {words}", text(words))
    )


def _telling(mechanism: Mechanism) -> tuple[str, str]:
    """Two coordinates over which the slice at home shows more than one aspect; else the first."""
    from pinsing.loops.modes import home
    from pinsing.loops.pose_slice import pose_slice
    from pinsing.plot.pose_map import panels

    free = free_coordinates(mechanism)
    pairs = [(a, b) for k, a in enumerate(free) for b in free[k + 1 :]]
    # Two positions are easiest to read, then a position and a turn.
    pairs.sort(key=lambda pair: sum(name in ("roll", "pitch", "yaw") for name in pair))
    for pair in pairs[:_MOST_TRIED]:
        found = pose_slice(mechanism, pair, [home(mechanism)], _ROUGH)
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
        words = "x, y, z in metres; φ is the turn of the output."
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
    # Velocities are drawn of an output whose motion in the plane counts.
    moved = {0, 1} <= set(mechanism.task.rows)
    caption = (
        f"The linkage there: {marks[kind]}." if kind in marks and moved else "The linkage there."
    )
    return figure(png(drawn), f"The linkage drawn in its plane at that configuration; {caption}",
                  text(caption))  # fmt: skip
