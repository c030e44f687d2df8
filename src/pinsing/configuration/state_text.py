"""A State as text for people."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from pinsing._types import Array
from pinsing.configuration.lost_motion import axis_name, vector
from pinsing.prose import PLAIN, Page, Span, measured, unbroken, verdict

if TYPE_CHECKING:
    from pinsing.configuration.state import State, VelocityEllipsoid

_LABEL = 18

Line = tuple[str, Span | tuple[Span, ...]]


def state_text(state: State, degrees: bool = False, page: Page = PLAIN) -> str:
    """All that is worth reading about a state, aligned, with units.

    Parameters
    ----------
    state : State
        What to print.
    degrees : bool
        Print revolute joint values in degrees.
    page : Page
        What it is fitted to.
    """
    return page.fields(_lines(state, degrees), _LABEL)


def _lines(state: State, degrees: bool) -> Iterator[Line]:
    arm = state.arm
    yield "arm", f"{arm.name}, tip {arm.tip}, base {arm.base}"
    yield "", f"task {arm.task}, length scale {arm.length_scale:g} m"
    yield from _joints(state, degrees)
    yield "", ""
    yield "status", _verdict(state)
    yield from _meaning(state)
    yield "", ""
    yield "sigma", "  ".join(_short(s) for s in state.sigma)
    yield "manipulability", _short(state.manipulability)
    yield "condition number", _short(state.condition_number)
    yield _determinant_label(state), _short(state.determinant)
    yield "", ""
    yield "tip position", measured(f"{vector(state.tip_position, 4)} m")
    yield from _ellipsoid("translation", state.translational, state.tip_rotation)
    yield from _ellipsoid("rotation", state.rotational, state.tip_rotation)
    for note in state.notes:
        yield "", ""
        yield "note", note


def _meaning(state: State) -> Iterator[Line]:
    """What cannot be done, why, and what moves although the tip rests."""
    if state.lost:
        yield "", ""
        label = "lost" if state.singular else "nearly lost"
        for motion in state.lost:
            torque = "no" if state.singular else "almost no"
            text = f"{motion.words}; {motion.free_wrench} needs {torque} joint torque"
            yield label, measured(text)
            label = ""
        if state.always_missing:
            are = "is" if state.always_missing == 1 else "are"
            yield (
                "",
                f"({state.always_missing} of these {len(state.lost)} {are} missing at every "
                f"configuration: the arm reaches rank {state.generic_rank} in a task of "
                f"{_rows(state)} rows)",
            )
    if state.dependences:
        yield "", ""
        label = "why"
        for dependence in state.dependences:
            yield label, dependence.reason
            yield "", f"({', '.join(dependence.joints)})"
            label = ""
    if state.self_motions:
        yield "", ""
        nearly = "nearly " if state.status == "near-singular" else ""
        label = "self-motion"
        for self_motion in state.self_motions:
            verb = "leaves" if np.count_nonzero(self_motion.direction) == 1 else "leave"
            rest = "tip" if state.arm.task == "pose" else "task"
            yield label, measured(f"{self_motion.words} {verb} the {rest} {nearly}at rest")
            label = ""
        if state.always_idle:
            yield (
                "",
                f"(dimension {state.always_idle} at every configuration: the arm is redundant)",
            )


def _joints(state: State, degrees: bool) -> Iterator[Line]:
    arm = state.arm
    width = max(len(name) for name in arm.joints)
    label = "q"
    for i, name in enumerate(arm.joints):
        value, unit = state.q[i], "rad"
        if arm.prismatic[i]:
            unit = "m"
        elif degrees:
            value, unit = np.degrees(value), "deg"
        outside = "  (outside its limits)" if name in state.outside else ""
        left = unbroken(f"{i + 1:>2} {name:<{width}}")
        yield label, f"{left} {unbroken(f'{value:>11.6g} {unit}')}{outside}"
        label = ""


def _verdict(state: State) -> tuple[Span, ...]:
    r = state.generic_rank
    ratio = unbroken(f"sigma_{r}/sigma_1 = {state.sigma_ratio:.2g}")
    if state.status == "singular":
        said = verdict(state.status, "SINGULAR")
        return said, f": rank {state.rank} instead of {r} ({ratio} <= {state.rtol:g})"
    if state.status == "near-singular":
        more = f"(singular from {state.rtol:g}); rank {state.rank}"
        return verdict(state.status), f": {ratio} <= {state.near_rtol:g} {more}"
    more = f"(near-singular from {state.near_rtol:g})"
    return verdict(state.status), f": rank {state.rank}, {ratio} {more}"


def _determinant_label(state: State) -> str:
    m, n = _rows(state), state.arm.n
    return "det J" if m == n else "det J J^T" if m < n else "det J^T J"


def _rows(state: State) -> int:
    named = {"pose": 6, "position": 3, "orientation": 3}
    return named.get(state.arm.task) or len(state.arm.task.split(","))


def _ellipsoid(what: str, ellipsoid: VelocityEllipsoid, rotation: Array) -> Iterator[Line]:
    label = f"{what} speed"
    verb = "along" if what == "translation" else "about"
    for radius, direction in zip(ellipsoid.radii, ellipsoid.axes.T, strict=True):
        speed = unbroken(f"{_short(radius):>9} {ellipsoid.unit}")
        yield label, measured(f"{speed} {verb} {axis_name(direction, rotation)}")
        label = ""


def _short(value: float) -> str:
    return f"{value + 0.0:.4g}"  # no minus zero
