"""A trajectory check in words: five lines to act on, and the list behind them."""

from __future__ import annotations

import math

from pinsing.joint_text import typed
from pinsing.prose import listed
from pinsing.proximity.speeds import Excess
from pinsing.proximity.trajectory import TrajectoryCheck

_LISTED = 8


def summary(
    check: TrajectoryCheck, degrees: bool = True, file: str = "", robot: str = "ROBOT"
) -> str:
    """At most six lines: what is met and when, what is near, speeds, and what to do.

    Parameters
    ----------
    check : TrajectoryCheck
        The answer.
    degrees : bool
        Unit of speeds of revolute joints; distances from singularities are in degrees.
    file, robot : str
        How the trajectory is called, and how commands name the robot.
    """
    evidence = [_nearest(check), _near(check, degrees), *_speeds(check, degrees)]
    lines = [*evidence, _advice(check, robot)]
    return "\n".join(
        [f"{file or check.arm.name}: {_met(check)}", "", *(f"  {x}" for x in lines if x)]
    )


def details(check: TrajectoryCheck, degrees: bool = True) -> str:
    """Every meeting, approach and excess, the first of each kind."""
    lines: list[str] = []
    if check.crossings:
        lines.append("meetings:")
        for c in check.crossings[:_LISTED]:
            until = f" to {c.t_end:.6g}" if c.t_end > c.t else ""
            q = ", ".join(_joint(check, j, float(x), degrees) for j, x in enumerate(c.q))
            lines.append(f"  t = {c.t:.6g}{until}: {c.kind} {_title(check, c.family)}, q = {q}")
        lines += _more(len(check.crossings), check.cut)
    if check.aspect_changes:
        lines.append("changes of aspect (as `pinsing postures` numbers them):")
        for a in check.aspect_changes[:_LISTED]:
            before, after = _called(a.before, a.names_before), _called(a.after, a.names_after)
            where = ", ".join(a.families)
            lines.append(f"  t = {a.t:.6g} ({where}): from {before} to {after}")
        lines += _more(len(check.aspect_changes), False)
    lines.append("nearest approach to each family:")
    for near in check.approaches:
        lines.append(
            f"  {_title(check, near.family)}: {_angle(near.upper)} at t = {near.t:.6g}, "
            f"at least {_angle(near.lower)} (proven)"
        )
    if check.stretches:
        lines.append(f"within {_angle(check.near)}:")
        for s in check.stretches[:_LISTED]:
            least = f"{_angle(s.clearance)} from {_title(check, s.family)}"
            lines.append(f"  t = {s.t:.6g} to {s.t_end:.6g}: at least {least}")
        lines += _more(len(check.stretches), False)
    tip = f"a tip speed of {check.tip_speed:g} (m/s, rad/s)"
    for name, per, found in (
        ("joint speeds above their limits", "/s", check.too_fast),
        ("joint accelerations above the limits given", "/s²", check.too_abrupt),
        (f"joint speeds that {tip} would take in the worst direction", "/s", check.costly),
        ("jumps between two samples", "", check.jumps),
        ("outside the joint limits", "", check.outside),
    ):
        if found:
            often = len({e.joint for e in found}) < len(found)
            lines.append(f"{name}{', one line a stretch of time' if often else ''}:")
            lines += [f"  {_excess(check, e, per, degrees)}" for e in found[:_LISTED]]
            lines += _more(len(found), False)
    return "\n".join([*lines, *(f"note: {n}" for n in check.notes)])


def _called(number: int | None, names: tuple[str, ...]) -> str:
    return f"{number}" + (f" ({', '.join(names)})" if names else "")


def _angle(x: float) -> str:
    """Distance in joint space; degrees where it is one of angles."""
    return f"{math.degrees(x):.3g}°" if math.isfinite(x) else "any distance"


def _joint(check: TrajectoryCheck, j: int, value: float, degrees: bool) -> str:
    if degrees and not check.arm.prismatic[j]:
        return f"{math.degrees(value):.2f}°"
    return f"{value:.5g}"


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %" if share < 0.9995 else "all"


def _times(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


def _more(count: int, cut: bool) -> list[str]:
    if count <= _LISTED:
        return []
    return [f"  and {count - _LISTED} more" + (" and others" if cut else "")]


def _excess(check: TrajectoryCheck, e: Excess, per: str, degrees: bool) -> str:
    """One excess, ``per`` second or second squared or as it is, in the units of its joint."""
    slides = bool(check.arm.prismatic[check.arm.joints.index(e.joint)])
    unit, factor = ("m", 1.0) if slides else ("rad", 1.0)
    if degrees and not slides:
        unit, factor = "deg", 180 / math.pi
    worst, limit = (f"{factor * x:.4g} {unit}{per}" for x in (e.worst, e.limit))
    return (
        f"{e.joint}: {worst} at t = {e.t_worst:.6g} (limit {limit}), t = {e.t:.6g} to {e.t_end:.6g}"
    )


def _met(check: TrajectoryCheck) -> str:
    faults = [
        words
        for words, found in (
            ("jumps", check.jumps),
            ("leaves joint limits", check.outside),
            ("exceeds joint speed limits", check.too_fast),
            ("exceeds joint acceleration limits", check.too_abrupt),
            (f"comes within {_angle(check.near)} of one", check.stretches),
        )
        if found
    ]
    if not check.crossings:
        none = "meets no singular configuration" if check.complete else "meets no known family"
        if not faults:
            sure = "proven between samples" if check.samples > 1 else "1 sample"
            return f"{none} ({sure})"
        return f"{none}, but {listed(faults)}"
    first = check.crossings[0]
    verb = {"crossing": "crosses", "touch": "touches", "along": "stays on"}[first.kind]
    more = [f"{_times(len(check.crossings) - 1, 'more meeting')}"] * (len(check.crossings) > 1)
    also = [*more, *(words for words in faults if not words.startswith("comes"))]
    place = f" ({first.where})" if first.where else ""
    singular = f"{verb} {_singularity(first.family, first.title)}{place}"
    return f"{singular} {_when(check, first.t)}{'; also ' * bool(also)}{listed(also)}"


def _singularity(family: str, title: str) -> str:
    return f"the {title} singularity" if title else f"singularity {family}"


def _title(check: TrajectoryCheck, family: str) -> str:
    title = next((a.title for a in check.approaches if a.family == family), "")
    return f"{title} ({family})" if title else family


def _when(check: TrajectoryCheck, t: float, end: float | None = None) -> str:
    first = f"{t:.6g} s" if check.timed else f"sample {t:.6g}"
    if end is None or end <= t:
        return f"at t = {first}" if check.timed else f"at {first}"
    return f"from {first} to {end:.6g}{' s' * check.timed}"


def _nearest(check: TrajectoryCheck) -> str:
    met = {c.family for c in check.crossings}
    a = next((x for x in check.approaches if x.family not in met and x.upper > 0), None)
    if a is None:
        return ""
    where = "elsewhere" if met else f"(at least {_angle(a.lower)}, proven)"
    return (
        f"Closest approach {where}: {_title(check, a.family)}, {_angle(a.upper)} "
        f"{_when(check, a.t)}"
    )


def _near(check: TrajectoryCheck, degrees: bool) -> str:
    total = sum(s.t_end - s.t for s in check.stretches)
    span = check.t_last - check.t_first
    share = f"{_percent(total / span)} of the time" if span > 0 else "all of it"
    ends = {"toward": "ends moving toward", "away": "ends moving away from"}
    end = f"; it {ends[check.trend]} the nearest family" if check.trend in ends else ""
    if not check.stretches:
        return ""
    return f"Within {_angle(check.near)} of one for {share}{end}"


def _speeds(check: TrajectoryCheck, degrees: bool) -> list[str]:
    """One line for each kind of excess, its first or worst."""
    out = []
    for what, found in (
        ("Joint speeds", check.too_fast),
        ("Joint accelerations", check.too_abrupt),
        ("Joint limits", check.outside),
    ):
        if found:
            e = found[0]
            more = f" and {_times(len(found) - 1, 'more')}" if len(found) > 1 else ""
            verb = "leaves its limits" if found is check.outside else "exceeds its limit"
            out.append(f"{what}: {e.joint} {verb} {_when(check, e.t, e.t_end)}{more}")
    if not check.timed:
        out.append("Joint speeds: not judged, the file has no times")
    elif not out:
        out.append("Joint speeds and limits are kept")
    return out


def _advice(check: TrajectoryCheck, robot: str) -> str:
    if check.jumps:
        e = check.jumps[0]
        return f"Look at the jump of {e.joint} {_when(check, e.t)}: is it wrapped by a turn?"
    if check.crossings:
        c = check.crossings[0]
        start = c.q if check.start is None else check.start
        other = f"the other {c.title}" if c.title in ("wrist", "elbow") else "another posture"
        q = typed(start, check.arm.prismatic, True, digits=6)
        return f"Try {other}: pinsing postures {robot} {q}"
    if check.outside:
        return f"Bring {check.outside[0].joint} within its limits"
    if check.too_fast:
        e = max(check.too_fast, key=lambda x: x.worst / x.limit)
        share = f"{100 * e.limit / e.worst:.3g} %"
        return f"Slow down to {share} around {_when(check, e.t_worst)[3:]} ({e.joint})"
    if check.too_abrupt:
        e = max(check.too_abrupt, key=lambda x: x.worst / x.limit)
        return f"Accelerate less around {_when(check, e.t_worst)[3:]} ({e.joint})"
    if check.stretches:
        s = min(check.stretches, key=lambda x: x.clearance)
        at = _when(check, s.t, s.t_end)
        return f"Slow down, or keep away from {_title(check, s.family)}, {at}"
    if not check.complete:
        return "The closed form is not complete: look at singular values along it as well"
    return ""
