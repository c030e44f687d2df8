"""A trajectory check in words: five lines to act on, and the list behind them."""

from __future__ import annotations

import math

from pinsing.prose import listed
from pinsing.proximity.speeds import Excess
from pinsing.proximity.trajectory import TrajectoryCheck

_LISTED = 8


def summary(check: TrajectoryCheck, degrees: bool = True) -> str:
    """Five lines: what is met, what is near, the end, speeds, and what to do."""
    return "\n".join(
        [_met(check), _nearest(check), _near(check, degrees), _speeds(check), _advice(check)]
    )


def details(check: TrajectoryCheck, degrees: bool = True) -> str:
    """Every meeting, approach and excess, the first of each kind."""
    lines: list[str] = []
    if check.crossings:
        lines.append("meetings:")
        for c in check.crossings[:_LISTED]:
            until = f" to {c.t_end:.6g}" if c.t_end > c.t else ""
            q = ", ".join(_joint(check, j, float(x), degrees) for j, x in enumerate(c.q))
            lines.append(f"  t = {c.t:.6g}{until}: {c.kind} {c.family}, q = {q}")
        lines += _more(len(check.crossings), check.cut)
    if check.aspect_changes:
        lines.append("changes of aspect (as `pinsing aspects` numbers them):")
        for a in check.aspect_changes[:_LISTED]:
            before, after = _called(a.before, a.names_before), _called(a.after, a.names_after)
            where = ", ".join(a.families)
            lines.append(f"  t = {a.t:.6g} ({where}): from {before} to {after}")
        lines += _more(len(check.aspect_changes), False)
    lines.append("nearest approach to each family:")
    for near in check.approaches:
        lines.append(
            f"  {near.family}: {_angle(near.upper)} at t = {near.t:.6g}, "
            f"nowhere below {_angle(near.lower)} (proven)"
        )
    if check.stretches:
        lines.append(f"within {_angle(check.near)}:")
        for s in check.stretches[:_LISTED]:
            least = f"{_angle(s.clearance)} from {s.family}"
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
        of = "1 sample" if check.samples == 1 else f"{check.samples} samples, proven in between"
        none = "Meets no singular configuration" if check.complete else "Meets no known family"
        return f"{none}{', but ' * bool(faults)}{listed(faults)}: {of}."
    first = check.crossings[0]
    names = sorted({c.family for c in check.crossings})
    times = "once" if len(check.crossings) == 1 else f"{len(check.crossings)} times"
    also = [words for words in faults if not words.startswith("comes")]
    return (
        f"SINGULAR {times} ({', '.join(names)}): first at t = {first.t:.6g}, "
        f"{first.kind} {first.family}{'; also ' * bool(also)}{listed(also)}."
    )


def _nearest(check: TrajectoryCheck) -> str:
    if not check.approaches:
        return "There is no family of singular configurations to come near to."
    met = {c.family for c in check.crossings}
    a = next((x for x in check.approaches if x.family not in met and x.upper > 0), None)
    if a is None:
        return "Every family of singular configurations is met."
    return f"Nearest without meeting: {_angle(a.upper)} from {a.family} at t = {a.t:.6g}."


def _near(check: TrajectoryCheck, degrees: bool) -> str:
    total = sum(s.t_end - s.t for s in check.stretches)
    span = check.t_last - check.t_first
    share = f"{_percent(total / span)} of the time" if span > 0 else "all of it"
    if not check.stretches:
        words = f"Never within {_angle(check.near)}"
    else:
        words = f"Within {_angle(check.near)} in {_stretches(len(check.stretches))}, {share}"
    ends = {"toward": "it ends moving toward", "away": "it ends moving away from"}
    end = ends.get(check.trend)
    return words + (f"; {end} the nearest family." if end else ".")


def _speeds(check: TrajectoryCheck) -> str:
    parts = []
    if check.jumps:
        parts.append(f"{_times(len(check.jumps), 'jump')} between samples ({check.jumps[0].joint})")
    if check.too_fast:
        parts.append(f"joint speeds above limits {len(check.too_fast)} times")
    if check.too_abrupt:
        parts.append(f"joint accelerations above limits {len(check.too_abrupt)} times")
    if check.outside:
        parts.append(f"outside joint limits ({check.outside[0].joint})")
    if not check.timed:
        parts.append("no times, so speeds were not judged")
    if check.timed and not (check.jumps or check.too_fast or check.outside):
        parts.append("the motion keeps joint limits and speed limits")
    if check.costly:
        tip = f"a tip speed of {check.tip_speed:g} (m/s, rad/s)"
        parts.append(f"in the worst direction {tip} would need more of {check.costly[0].joint}")
    words = "; ".join(parts)
    return words[0].upper() + words[1:] + "."


def _advice(check: TrajectoryCheck) -> str:
    if check.jumps:
        e = check.jumps[0]
        return f"Look first at the jump of {e.joint} at t = {e.t:.6g}: is it wrapped by a turn?"
    if check.crossings:
        c = check.crossings[0]
        return (
            f"Plan around t = {c.t:.6g}: there tip speeds are lost; other inverse kinematics "
            f"solutions may stay on one side of {c.family}."
        )
    if check.outside:
        return f"Bring {check.outside[0].joint} within its limits."
    if check.too_fast:
        e = max(check.too_fast, key=lambda x: x.worst / x.limit)
        return (
            f"Slow down to {100 * e.limit / e.worst:.3g} % around t = {e.t_worst:.6g} ({e.joint})."
        )
    if check.too_abrupt:
        e = max(check.too_abrupt, key=lambda x: x.worst / x.limit)
        return f"Accelerate less around t = {e.t_worst:.6g} ({e.joint})."
    if check.stretches:
        s = min(check.stretches, key=lambda x: x.clearance)
        return f"Slow down, or keep away from {s.family}, around t = {s.t:.6g} to {s.t_end:.6g}."
    if check.costly:
        e = check.costly[0]
        return (
            f"Nothing to do for this motion; others need tip speeds below {check.tip_speed:g} "
            f"(m/s, rad/s) around t = {e.t_worst:.6g} ({e.joint}), or another posture."
        )
    if not check.complete:
        return "The closed form is not complete: look at singular values along it as well."
    return "Nothing to do."


def _stretches(count: int) -> str:
    return "1 stretch" if count == 1 else f"{count} stretches"
