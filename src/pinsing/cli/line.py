"""``pinsing line``: a straight line of the tip."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pinsing.cli.grouped import command
from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    deg_option,
    fail_option,
    joint_vector,
    json_option,
    once_option,
    parse_numbers,
)
from pinsing.cli.output import emit_json, emit_lines
from pinsing.errors import OptionError
from pinsing.prose import listed

if TYPE_CHECKING:
    from pinsing.proximity.line import LineCheck, LinePosture

_LISTED = 12
_STILL = 1e-6
"""Share of the speed asked for below which an allowed speed is none."""


@command("line")
@arm_options
@once_option(
    "--q",
    "q",
    required=True,
    metavar="Q1,Q2,...",
    help="Where it starts: joint values, base to tip, radians (or --deg) and metres.",
)
@once_option(
    "--to",
    "target",
    required=True,
    metavar="X,Y,Z[,R,P,Y]",
    help="Target of the tip in the base frame: metres; roll, pitch, yaw, or as it is.",
)
@click.option(
    "--speed", type=float, default=0.25, show_default=True, metavar="M/S", help="Tip speed."
)
@deg_option
@json_option
@fail_option
def line_command(
    request: RobotRequest,
    q: str,
    target: str,
    speed: float,
    deg: bool,
    json_target: str | Path | None,
    fail_if_singular: bool,
) -> int:
    """Follow a straight line of the tip: where it ends, what it meets, which speed is possible.

    Example: pinsing line ur5 --q 10,-70,75,-90,-80,0 --deg --to 0.3,0.2,0.5
    """
    parse_numbers(q, "--q", deg)
    pose = parse_numbers(target, "--to", deg)
    if len(pose) not in (3, 6):
        raise OptionError(f"--to needs 3 numbers (x, y, z) or 6 (and roll, pitch, yaw): {target!r}")
    if deg:
        pose[3:] = [math.radians(x) for x in pose[3:]]
    arm = request.load()
    from pinsing.families.solve import form_to_measure
    from pinsing.postures.motions import line_postures
    from pinsing.proximity.line import check_line

    start = joint_vector(arm, q, "--q", deg)
    form = form_to_measure(arm)
    line = check_line(arm, start, pose, speed, forms=form)
    if line.outcome != "reached" or _stopped(line) or _left(line, deg):
        line = replace(line, postures=line_postures(arm, start, pose, forms=form))
    if not emit_json(line, json_target):
        emit_lines(_text(line, deg))
    met = line.outcome == "singular" or bool(line.crossings)
    return int(fail_if_singular and met)


def _stopped(line: LineCheck) -> bool:
    """Whether no speed is slow enough at some place."""
    return line.allowed_speed < _STILL * line.speed


def _text(line: LineCheck, deg: bool) -> str:
    turns = [not p for p in line.arm.prismatic]
    q = ", ".join(
        f"{math.degrees(x):.3f}°" if deg and turn else f"{x:.6g}"
        for x, turn in zip(line.q_end, turns, strict=True)
    )
    whole = f"{line.length:.6g}"
    left = _left(line, deg)
    met = line.outcome != "singular" and line.crossings
    faults = [
        words
        for words, found in (
            (f"it meets {_called(line, met[0].family)}" if met else "", met),
            ("joints leave their limits", left),
            (f"joints are too fast at {line.speed:g} m/s", line.too_fast),
            (f"it comes within {math.degrees(line.near):.3g}° of a family", line.stretches),
        )
        if found
    ]
    but = ", but " * bool(faults) + listed(faults)
    lines = {
        "reached": f"{'SINGULAR: the' if met else 'The'} line is followed to its end, {whole} m"
        f"{but}. There q = {q}.",
        "singular": f"SINGULAR: the line ends after {line.s_end:.9g} of {whole} m on "
        f"{_called(line, line.family)}, at q = {q}; beyond it this posture has no solution.",
        "undecided": f"NOT DECIDED: the line was followed for {line.s_end:.6g} of {whole} m{but}. "
        f"There q = {q}.",
    }[line.outcome]
    out = [lines, *left]
    for c in line.crossings[:_LISTED]:
        if not (line.outcome == "singular" and c.t >= line.s_end - 1e-9):
            out.append(f"  {c.kind} {_called(line, c.family)} at {c.t:.6g} m")
    for a in line.approaches:
        if a.upper > 0:
            near = f"{math.degrees(a.upper):.3g}°"
            out.append(f"  nearest to {_called(line, a.family)}: {near}, at {a.t:.6g} m")
    if _stopped(line):
        start = min(o.s for o in line.too_fast)
        out.append(
            f"At {line.speed:g} m/s joints are too fast from {start:.6g} m on. At the singularity "
            "itself no speed is slow enough, as joint speeds grow without bound: stop the line "
            "before it, or take another posture."
        )
    elif line.allowed_speed < line.speed:
        out.append(
            f"At {line.speed:g} m/s joints are too fast; {line.allowed_speed:.4g} m/s keeps all "
            "limits on all of it."
        )
    else:
        out.append(f"At {line.speed:g} m/s all joints keep their speed limits.")
    for o in line.too_fast[:_LISTED]:
        unbounded = o.allowed < _STILL * line.speed
        worst = "without bound" if unbounded else f"{o.worst:.4g}"
        allowed = "" if unbounded else f"; allowed there: {o.allowed:.4g} m/s"
        out.append(
            f"  {o.joint}: {worst} (limit {o.limit:.4g}) from {o.s:.6g} to {o.s_end:.6g} m{allowed}"
        )
    out += _postures(line, deg)
    out += [f"note: {n}" for n in line.notes]
    return "\n".join(out)


def _called(line: LineCheck, family: str) -> str:
    """``the wrist singularity (F2)``, or ``F2``."""
    title = next((a.title for a in line.approaches if a.family == family), "")
    return f"the {title} singularity ({family})" if title else family


def _left(line: LineCheck, deg: bool) -> list[str]:
    """Where joints leave their limits first."""
    space = line.arm.space
    return [
        f"OUTSIDE: {name} leaves its limits, {space.range_words(j, deg)}, at "
        f"{line.s[left.argmax()]:.4g} m"
        for j, (name, left) in enumerate(zip(space.names, space.outside(line.q).T, strict=True))
        if left.any()
    ]


def _postures(line: LineCheck, deg: bool) -> list[str]:
    """Which other postures of the start would do."""
    from pinsing.joint_text import typed  # NumPy: not for what only asks for help

    if not line.postures:
        return []
    good = [p for p in line.postures if p.outcome == "reached" and p.within_limits]
    others = [p for p in line.postures if not any(_turns(line, p))]
    turned = [p for p in good if p not in others]
    count, out = len(others), []
    for p in turned:
        said = ", ".join(
            f"{name} {360 * k:+d}\u00b0"
            for name, k in zip(line.arm.joints, _turns(line, p), strict=True)
            if k
        )
        out.append(f"The same posture would do, whole turns away ({said}):")
        out.append(f"    {typed(p.q, line.arm.prismatic, deg, digits=6)}")
    good = [p for p in good if p in others]
    if not good and others:
        far = max(others, key=lambda p: p.s_end)
        none = f"None of {count} other posture{'s' * (count != 1)} of the start follows the line to"
        return [
            *out,
            f"{none} its end within the joint limits; the farthest gets {far.s_end:.6g} m.",
        ]
    if good and not turned:
        out.append(
            f"Another posture is needed; of {count} others of the start, {len(good)} would do:"
        )
    elif good:
        out.append(f"Of {count} other postures of the start, {len(good)} would do:")
    for p in good:
        near = f"{math.degrees(p.clearance):.3g}\u00b0"
        called = f"{', '.join(p.names)}; " if p.names else ""
        out.append(f"  {called}stays {near} away from every family")
        out.append(f"    {typed(p.q, line.arm.prismatic, deg, digits=6)}")
    return out


def _turns(line: LineCheck, posture: LinePosture) -> list[int]:
    """Whole turns of each joint from where the line was asked to start; zeros of others."""
    gap = (posture.q - line.q[0]) / (2 * math.pi)
    whole = gap.round()
    same = bool(abs(gap - whole).max() < 1e-7)
    return [int(k) * same for k in whole]
