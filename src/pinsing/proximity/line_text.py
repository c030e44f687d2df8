"""A straight line of the tip in words: what it meets and what to do, and the list behind that."""

from __future__ import annotations

import math

from pinsing.joint_text import typed
from pinsing.prose import listed
from pinsing.proximity.line import LineCheck, LinePosture
from pinsing.proximity.trajectory import angle_text, singularity, titled

_LISTED = 8
_STILL = 1e-6
"""Share of the speed asked for below which an allowed speed is none."""


def stopped(line: LineCheck) -> bool:
    """Return True if no speed is slow enough at some place."""
    return line.allowed_speed < _STILL * line.speed


def line_summary(
    line: LineCheck, degrees: bool = True, robot: str = "ROBOT", same: str = ""
) -> str:
    """Return where a line ends and what it meets, what is near, speeds, and what to do.

    Parameters
    ----------
    line : LineCheck
        The answer.
    degrees : bool
        Angles in degrees.
    robot, same : str
        How commands name the robot, and the options that say which line.
    """
    met, left, titles = line.crossings, left_limits(line, degrees), _titles(line)
    first = [f"it meets {singularity(c.family, c.title, c.where)}" for c in met[:1]]
    faults = [
        *first,
        *["joints leave their limits"] * bool(left),
        *[f"joints are too fast at {line.speed:g} m/s"] * bool(line.too_fast),
        *[f"it comes within {angle_text(line.near, degrees)} of a family"] * bool(line.stretches),
    ]
    but = f", but {listed(faults)}" if faults else " and meets no singularity"
    whole, done = f"line of {line.length:.4g} m", f"{line.s_end:.6g} m"
    end = next((c.where for c in met if c.family == line.family), "")
    if line.outcome == "reached":
        head = f"{'SINGULAR, ' * bool(met)}the {whole} is followed to its end{but}"
    elif line.outcome == "singular":
        family = singularity(line.family, titles.get(line.family, ""), end)
        head = (
            f"SINGULAR, the {whole} ends at {family} after {done}; beyond it this posture has no "
            "solution"
        )
    else:
        head = f"NOT DECIDED, the {whole} was followed for {done}{but * bool(faults)}"
    out = [*left]
    apart = {c.family for c in met} | {line.family}
    near = next((a for a in line.approaches if a.upper > 0 and a.family not in apart), None)
    if near is not None:
        other = " elsewhere" * bool(apart - {""})
        far = f"{angle_text(near.upper, degrees)} at {near.t:.4g} m"
        out.append(f"Closest approach{other}: {titled(near.family, near.title)}, {far}")
    out.append(f"Joint speeds at {line.speed:g} m/s: {_line_speeds(line)}")
    good = [p for p in line.postures if p.outcome == "reached" and p.within_limits]
    if good:
        start = typed(good[0].q, line.arm.prismatic, True, digits=6)
        out.append(f"From another posture it works: pinsing line {robot} {start} {same}")
    elif line.postures:
        others = [p for p in line.postures if not any(_turns(line, p))]
        farthest = max((p.s_end for p in others), default=line.s_end)
        count = f"{len(others)} other posture{'s' * (len(others) != 1)}"
        out.append(
            f"None of {count} of the start follows it to its end within the joint limits; the "
            f"farthest gets {farthest:.6g} m"
        )
    last = typed(line.q_end, line.arm.prismatic, True, digits=6)
    out.append(f"See its end: pinsing view {robot} {last}")
    return "\n".join([f"{line.arm.name}: {head}", "", *(f"  {words}" for words in out)])


def _line_speeds(line: LineCheck) -> str:
    """What joint speeds allow."""
    if not line.too_fast:
        return "all are within their limits"
    start = min(o.s for o in line.too_fast)
    if stopped(line):
        return (
            f"too fast from {start:.4g} m on; at the singularity itself no speed is slow enough: "
            "stop before it"
        )
    return f"too fast from {start:.4g} m on; {line.allowed_speed:.4g} m/s keeps all limits"


def line_details(line: LineCheck, degrees: bool) -> str:
    """Return the end, every meeting, approach and excess, and the other postures."""
    q = ", ".join(
        f"{math.degrees(x):.3f}°" if degrees and not slides else f"{x:.6g}"
        for x, slides in zip(line.q_end, line.arm.prismatic, strict=True)
    )
    out = [f"end, at {line.s_end:.9g} of {line.length:.6g} m:", f"  q = {q}"]
    if line.crossings:
        out.append("meetings:")
        out += [
            f"  {c.kind} {titled(c.family, c.title)} at {c.t:.6g} m"
            for c in line.crossings[:_LISTED]
        ]
    out.append("nearest approach to each family:")
    out += [
        f"  {titled(a.family, a.title)}: {angle_text(a.upper, degrees)}, at {a.t:.6g} m"
        for a in line.approaches
    ]
    if line.too_fast:
        out.append(f"joint speeds above their limits at {line.speed:g} m/s:")
    for o in line.too_fast[:_LISTED]:
        unbounded = o.allowed < _STILL * line.speed
        unit, factor = _unit(line, o.joint, degrees)
        worst = "without bound" if unbounded else f"{factor * o.worst:.4g} {unit}/s"
        allowed = "" if unbounded else f"; allowed there: {o.allowed:.4g} m/s"
        out.append(
            f"  {o.joint}: {worst} (limit {factor * o.limit:.4g} {unit}/s) from {o.s:.6g} to "
            f"{o.s_end:.6g} m{allowed}"
        )
    out += _postures(line, degrees)
    out += [f"note: {n}" for n in line.notes]
    return "\n".join(out)


def _unit(line: LineCheck, joint: str, degrees: bool) -> tuple[str, float]:
    """Unit of a joint, and what radians or metres are multiplied by."""
    if line.arm.prismatic[line.arm.joints.index(joint)]:
        return "m", 1.0
    return ("deg", 180 / math.pi) if degrees else ("rad", 1.0)


def _titles(line: LineCheck) -> dict[str, str]:
    """Titles of the families by name."""
    return {a.family: a.title for a in line.approaches}


def left_limits(line: LineCheck, degrees: bool = True) -> list[str]:
    """Return where joints leave their limits first, in words."""
    space = line.arm.space
    return [
        f"Outside: {name} leaves its limits, {space.range_words(j, degrees)}, at "
        f"{line.s[left.argmax()]:.4g} m"
        for j, (name, left) in enumerate(zip(space.names, space.outside(line.q).T, strict=True))
        if left.any()
    ]


def _postures(line: LineCheck, degrees: bool) -> list[str]:
    """Which postures of the start would do."""
    good = [p for p in line.postures if p.outcome == "reached" and p.within_limits]
    out = ["starts from which the line works:"] if good else []
    for p in good:
        turned = ", ".join(
            f"{name} {360 * k:+d}°"
            for name, k in zip(line.arm.joints, _turns(line, p), strict=True)
            if k
        )
        called = f"the same posture, whole turns away ({turned})" if turned else ", ".join(p.names)
        near = f"stays {angle_text(p.clearance, degrees)} away from every family"
        out.append(f"  {called}{'; ' * bool(called)}{near}")
        out.append(f"    {typed(p.q, line.arm.prismatic, degrees, digits=6)}")
    return out


def _turns(line: LineCheck, posture: LinePosture) -> list[int]:
    """Whole turns of each joint from where the line was asked to start; zeros of others."""
    gap = (posture.q - line.q[0]) / (2 * math.pi)
    whole = gap.round()
    same = bool(abs(gap - whole).max() < 1e-7)
    return [int(k) * same for k in whole]
