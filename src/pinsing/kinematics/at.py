"""at: everything about one configuration."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import chain, repeat
from typing import ClassVar

import numpy as np

from pinsing import measures, notebook
from pinsing.errors import OptionError
from pinsing.interface import JsonResult, checked
from pinsing.kinematics.jacobian import (
    NEAR_RTOL,
    SINGULAR_RTOL,
    Status,
    generic_rank,
    generic_task,
    own_scale,
    rank_of,
    ratio_of,
    ratios,
    scale_notes,
    scale_rows,
    status_of,
    task_rows,
    tip_and_jacobian,
)
from pinsing.kinematics.lost_motion import (
    DEPENDENCE_RTOL,
    STRUCTURE_TOL,
    AxisDependence,
    JointAxes,
    LostMotion,
    Tool,
    arm_centres,
    axis_name,
    dependences_of,
    lost_motions,
    vector,
)
from pinsing.kinematics.refine import approach
from pinsing.kinematics.tip_speed import TIP_SPEED, TURN_SPEED, SpeedJudge, TipSpeeds, check_speeds
from pinsing.measures import PRACTICAL, Array, ArrayLike
from pinsing.prose import (
    PLAIN,
    Page,
    Span,
    html_text,
    listed,
    measured,
    one_line,
    unbroken,
    verdict,
)
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.robot.nominal import nominal
from pinsing.robot.task import parse_task

SINGULAR, NEAR_SINGULAR, REGULAR = "singular", "near-singular", "regular"
ROUNDED_AWAY = "singular if the rounded numbers of the file"
"""What the note begins with where only rounding keeps a configuration from being singular."""

LABEL = 18
"""Width of the labels of a state's lines."""

Line = tuple[str, Span | tuple[Span, ...]]


@dataclass(frozen=True, eq=False)
class VelocityEllipsoid:
    """Tip velocities at unit joint speed, paper Eqs. (15), (16).

    Attributes
    ----------
    center : (3,) array
        Tip position in the base, metres.
    axes : (3, 3) array
        Columns are the directions of the semi-axes, a right-handed frame in base axes.
    radii : (3,) array
        Semi-axes, largest first, in ``unit`` per unit joint speed; zero where lost.
    unit : str
        ``m/s`` or ``rad/s``.
    """

    center: Array
    axes: Array
    radii: Array
    unit: str


@dataclass(frozen=True, eq=False)
class SelfMotion:
    """Joint velocities that leave the task at rest.

    Attributes
    ----------
    direction : (n,) array
        rad/s or m/s; the largest is 1.
    words : str
        The same in words, joints by name.
    """

    direction: Array
    words: str

    def __str__(self) -> str:
        return self.words


@dataclass(frozen=True, eq=False)
class State(JsonResult):
    """What an arm can and cannot do at one configuration.

    Attributes
    ----------
    arm : ArmSummary
        The arm, its tip, task and length scale.
    q : (n,) array
        Radians or metres.
    within_limits : bool
        Whether all joints are, whole turns aside.
    outside : tuple of str
        Joints that are not.
    tip_position : (3,) array
        Metres, in the base.
    tip_rotation : (3, 3) array
        Columns are the tool axes, in base axes.
    J : (6, n) array
        Frame Jacobian, LOCAL_WORLD_ALIGNED at the tip in base axes, metres and radians.
    sigma : (min(m, n),) array
        Singular values of the task Jacobian (translation rows over the length scale).
    rank, generic_rank : int
        Here, and at almost every configuration.
    sigma_ratio : float
        sigma_r / sigma_1 with r the generic rank, at the arm's own scale
        (`pinsing.kinematics.jacobian`): that of ``sigma`` for a length scale as long as the arm.
    rtol, near_rtol : float
        The ratio at or below which the configuration is singular, or near-singular.
    status : str
        ``singular``, ``near-singular`` or ``regular``.
    manipulability : float
        Product of the first r singular values, paper Eq. (14).
    condition_number : float
        sigma_1 / sigma_r, paper Eq. (17); may be infinite.
    determinant : float
        det J of a square task Jacobian; det(J J^T) of a wide one, det(J^T J) of a tall one.
    translational, rotational : VelocityEllipsoid
        Of the rows vx, vy, vz and wx, wy, wz of J.
    lost : tuple of LostMotion
        Directions that cannot be produced here; nearly lost ones where near-singular. Those
        that the arm can produce nowhere are left out.
    always_missing : int
        How many of ``lost`` are missing at every configuration, in directions that move with
        q: an arm with five joints always misses one of six.
    self_motions : tuple of SelfMotion
        Basis of the joint velocities that leave the task at rest (nearly, where near-singular).
    always_idle : int
        Dimension of that space at almost every configuration: positive for redundant arms.
    dependences : tuple of AxisDependence
        Which joint axes line up, and how; of a near-singular configuration, and of one that is
        singular by a loose ``rtol`` alone, where the singular one beside it is (by a walk on the
        nominal geometry), none if it is farther than 0.2 rad.
    notes : tuple of str
        What else one should know.
    tip_speeds : TipSpeeds or None
        What the joint speed limits allow in every direction; None where no limits are known, or
        the arm cannot move its tip in every direction of its task anywhere.
    """

    schema: ClassVar[str] = "pinsing/state/1"
    made_by: ClassVar[str] = "pinsing.at(arm, q)"

    arm: ArmSummary
    q: Array
    within_limits: bool
    outside: tuple[str, ...]
    tip_position: Array
    tip_rotation: Array
    J: Array
    sigma: Array
    rank: int
    generic_rank: int
    sigma_ratio: float
    rtol: float
    near_rtol: float
    status: str
    manipulability: float
    condition_number: float
    determinant: float
    translational: VelocityEllipsoid
    rotational: VelocityEllipsoid
    lost: tuple[LostMotion, ...]
    always_missing: int
    self_motions: tuple[SelfMotion, ...]
    always_idle: int
    dependences: tuple[AxisDependence, ...]
    notes: tuple[str, ...]
    tip_speeds: TipSpeeds | None = field(default=None, metadata={"optional": True})

    @property
    def singular(self) -> bool:
        """True if the rank is below the generic one, to ``rtol``."""
        return self.status == SINGULAR

    def __repr__(self) -> str:
        said = "SINGULAR" if self.singular else self.status
        r = self.generic_rank
        ratio = f"sigma_{r}/sigma_1 = {self.sigma_ratio:.2g}"
        return one_line("State", f"{self.arm.name}, {said}: rank {self.rank} of {r}, {ratio}")

    def __str__(self) -> str:
        return state_text(self)

    def _repr_latex_(self) -> str:
        """For notebooks: rank and ratio."""
        r = self.generic_rank
        return (
            rf"$$\operatorname{{rank}} J = {self.rank},\quad r = {r},\quad "
            rf"\sigma_{{{r}}}/\sigma_1 = {_latex_number(self.sigma_ratio)}$$"
        )

    def _repr_html_(self) -> str:
        """For notebooks, which prefer it: verdict in colour, what is lost and why."""
        text = html_text
        tone = {SINGULAR: "alarm", NEAR_SINGULAR: "caution"}.get(self.status, "good")
        said = "SINGULAR" if self.status == SINGULAR else self.status
        ratio = rf"\sigma_{{{self.generic_rank}}}/\sigma_1 = {_latex_number(self.sigma_ratio)}"
        values = zip(self.arm.joints, self.q, self.arm.prismatic, strict=True)
        rows = [
            (text("verdict"), f"{notebook.verdict(said, tone)} {notebook.formula(ratio)}"),
            (text("rank"), f"{self.rank} {text('of')} {self.generic_rank}"),
            *(
                (notebook.name(joint), text(f"{value:.6g} {'m' if slides else 'rad'}"))
                for joint, value, slides in values
            ),
            *((text("lost"), text(motion.words)) for motion in self.lost),
            *((text(_why(self)), text(axes.reason)) for axes in self.dependences),
            *((text("note"), text(note)) for note in self.notes),
        ]
        arm, tip = notebook.name(self.arm.name), notebook.name(self.arm.tip)
        return f"<p>{arm} {text('tip')} {tip}</p>{notebook.table(rows)}"


def _latex_number(value: float) -> str:
    """A number with its power of ten written as one."""
    mantissa, _, exponent = f"{value:.2g}".partition("e")
    return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa


def state_text(state: State, degrees: bool = False, page: Page = PLAIN) -> str:
    """Return all that is worth reading about a state, aligned, with units."""
    return page.fields(_lines(state, degrees), LABEL)


def _lines(state: State, degrees: bool) -> Iterator[Line]:
    arm = state.arm
    yield "arm", f"{arm.name}, tip {arm.tip}, base {arm.base}"
    yield "", f"task {arm.task}, length scale {arm.length_scale:g} m"
    yield from _joints(state, degrees)
    yield "", ""
    yield "status", _verdict(state)
    if any(note.startswith(ROUNDED_AWAY) for note in state.notes):
        yield "", "(singular but for the rounding of the file, see the note)"
    yield from _meaning(state)
    yield "", ""
    yield "sigma", "  ".join(_short(s) for s in state.sigma)
    yield "manipulability", _short(state.manipulability)
    yield "condition number", _short(state.condition_number)
    more = _rows(state) - arm.n
    yield ("det J J^T", "det J", "det J^T J")[(more >= 0) + (more > 0)], _short(state.determinant)
    yield "", ""
    yield "tip position", measured(f"{vector(state.tip_position, 4)} m")
    yield from _ellipsoid("translation", state.translational, state.tip_rotation)
    yield from _ellipsoid("rotation", state.rotational, state.tip_rotation)
    if state.tip_speeds is not None:
        yield from _allowed(state, state.tip_speeds)
    for note in state.notes:
        yield "", ""
        yield "note", note


def _labelled(label: str, lines: Iterable[Span]) -> Iterator[Line]:
    """Lines of which the first has the label."""
    yield from zip(chain([label], repeat("")), lines, strict=False)


def _meaning(state: State) -> Iterator[Line]:
    """Return what cannot be done, why, and what moves although the tip rests."""
    torque = "no" if state.singular else "almost no"
    lost = (f"{m.words}; {m.free_wrench} needs {torque} joint torque" for m in state.lost)
    are = "is" if state.always_missing == 1 else "are"
    missing = (
        f"({state.always_missing} of these {len(state.lost)} {are} missing at every "
        f"configuration: the arm reaches rank {state.generic_rank} in a task of "
        f"{_rows(state)} rows)"
    )
    why = ((d.reason, f"({', '.join(d.joints)})") for d in state.dependences)
    nearly = "nearly " if state.status == NEAR_SINGULAR else ""
    at_rest = f"the {'tip' if state.arm.task == 'pose' else 'task'} {nearly}at rest"
    still = (
        f"{m.words} {'leaves' if np.count_nonzero(m.direction) == 1 else 'leave'} {at_rest}"
        for m in state.self_motions
    )
    idle = f"(dimension {state.always_idle} at every configuration: the arm is redundant)"
    for label, lines, more in (
        (f"{nearly}lost", [*map(measured, lost)], [missing] * bool(state.always_missing)),
        (_why(state), [*chain.from_iterable(why)], []),
        ("self-motion", [*map(measured, still)], [idle] * bool(state.always_idle)),
    ):
        if lines:
            yield "", ""
            yield from _labelled(label, [*lines, *more])


def _why(state: State) -> str:
    return "why" if state.singular and state.sigma_ratio <= DEPENDENCE_RTOL else "near where"


def _joints(state: State, degrees: bool) -> Iterator[Line]:
    arm = state.arm
    width = max(len(name) for name in arm.joints)
    for i, name in enumerate(arm.joints):
        turned = degrees and not arm.prismatic[i]
        value = np.degrees(state.q[i]) if turned else state.q[i]
        unit = "m" if arm.prismatic[i] else "deg" if degrees else "rad"
        limits = arm.space.range_words(i, degrees)
        outside = f"  (outside its limits, {limits})" if name in state.outside else ""
        left = unbroken(f"{i + 1:>2} {name:<{width}}")
        yield "" if i else "q", f"{left} {unbroken(f'{value:>11.6g} {unit}')}{outside}"


def _verdict(state: State) -> tuple[Span, str]:
    rank, r = state.rank, state.generic_rank
    ratio = unbroken(f"sigma_{r}/sigma_1 = {state.sigma_ratio:.2g}")
    near = f"{ratio} <= {state.near_rtol:g} (singular from {state.rtol:g})"
    more = {
        SINGULAR: f"rank {rank} instead of {r} ({ratio} <= {state.rtol:g})",
        NEAR_SINGULAR: f"{near}; rank {rank}",
    }.get(state.status, f"rank {rank}, {ratio} (near-singular from {state.near_rtol:g})")
    return verdict(state.status, "SINGULAR" if state.singular else ""), f": {more}"


def _rows(state: State) -> int:
    return len(parse_task(state.arm.task).rows)


def _ellipsoid(what: str, ellipsoid: VelocityEllipsoid, rotation: Array) -> Iterator[Line]:
    verb = "along" if what == "translation" else "about"
    lines = (
        f"{unbroken(f'{_short(radius):>9} {ellipsoid.unit}')} {verb} {axis_name(axis, rotation)}"
        for radius, axis in zip(ellipsoid.radii, ellipsoid.axes.T, strict=True)
    )
    yield from _labelled(f"{what} speed", map(measured, lines))


def _allowed(state: State, speeds: TipSpeeds) -> Iterator[Line]:
    """Return what the joint speed limits allow in every direction, and what limits it."""
    rows = parse_task(state.arm.task).rows
    how = "held" if min(rows) < 3 <= max(rows) else "free"
    lines: list[Span] = []
    for speed, unit, joints, direction, verb, held in (
        (speeds.linear, "m/s", speeds.linear_joints, speeds.linear_direction, "along",
         "orientation"),
        (speeds.angular, "rad/s", speeds.angular_joints, speeds.angular_direction, "about",
         "position"),
    ):  # fmt: skip
        if math.isfinite(speed):
            number = unbroken(f"{_short(speed):>9} {unit}")
            limit = f"(limit: {listed(joints)}, {verb} {vector(direction, 3)})"
            lines.append(measured(f"{number} in every direction, {held} {how} {limit}"))
    share = "some direction is lost"
    if math.isfinite(speeds.share):
        percent = f"{100 * speeds.share:{',.0f' if speeds.share > 9.99 else '.3g'}} %"
        share = f"at most {percent} of the limit of {listed(speeds.share_joints)}"
    at_once = f"{speeds.tip_speed:g} m/s and {speeds.turn_speed:g} rad/s at once"
    lines.append(f"{at_once}, in any directions: {share}")
    if speeds.unlimited:
        lines.append(f"({listed(speeds.unlimited)}: no speed limit known, not counted)")
    yield from _labelled("allowed speed", lines)


def _short(value: float) -> str:
    return f"{value + 0.0:.4g}"  # no minus zero


@checked
def at(
    arm: Arm,
    q: ArrayLike,
    rtol: float = SINGULAR_RTOL,
    near_rtol: float = NEAR_RTOL,
    *,
    tip_speed: float = TIP_SPEED,
    turn_speed: float = TURN_SPEED,
    joint_speeds: ArrayLike | None = None,
) -> State:
    """Analyze one configuration q (n,) of an arm, radians and metres.

    Parameters
    ----------
    arm : Arm
        Any arm; its geometry is taken as it is (the raw one, unless it is ``nominal(arm).arm``).
    q : (n,) or (nq,) array_like
        Radians or metres; may lie outside the limits, which is then said.
    rtol, near_rtol : float
        sigma_r / sigma_1 at or below which q is called singular, or near-singular.
    tip_speed, turn_speed : float
        m/s and rad/s that the joint speed limits are held against.
    joint_speeds : (n,) array_like, optional
        Speed limits, rad/s and m/s; those of the description if not given.

    Returns
    -------
    State
        With ``str()``: all of it in words.

    Raises
    ------
    ConfigurationError
        If q has the wrong length or is not finite.
    OptionError
        Unless 0 <= rtol <= near_rtol < 1; if no joint ever moves the task; or speeds make no sense.

    Examples
    --------
    >>> import pinsing
    >>> state = pinsing.at(pinsing.load("ur5"), [0, -1.2, 0, -1, -1.5, 0])
    >>> state.status, state.rank, state.generic_rank
    ('singular', 5, 6)
    """
    OptionError.refuse_if(
        not 0 <= rtol <= near_rtol < 1,
        f"need 0 <= rtol <= near_rtol < 1, got {rtol:g} and {near_rtol:g}",
    )
    check_speeds(tip_speed, turn_speed)
    q = arm.check_one(q)
    r = generic_rank(arm)
    loss = loss_at(arm, q, rtol, near_rtol)
    J, status, ratio = loss.J, loss.status, loss.ratio
    Js = scale_rows(arm, J, q)
    judge = SpeedJudge(arm, joint_speeds)
    scale = own_scale(arm)
    position, rotation = loss.tool.position, loss.tool.rotation
    outside = tuple(np.array(arm.joints)[arm.space.outside(q)].tolist())
    return State(
        arm=summarize(arm),
        q=q,
        within_limits=not outside,
        outside=outside,
        tip_position=position,
        tip_rotation=rotation,
        J=J,
        sigma=measures.singular_values(Js),
        rank=loss.rank,
        generic_rank=r,
        sigma_ratio=ratio,
        rtol=rtol,
        near_rtol=near_rtol,
        status=status,
        manipulability=float(measures.manipulability(Js, r)),
        condition_number=float(measures.condition_number(Js, r)),
        determinant=float(measures.determinant(Js)),
        translational=VelocityEllipsoid(position, *measures.velocity_ellipsoid(J[:3]), "m/s"),
        rotational=VelocityEllipsoid(position, *measures.velocity_ellipsoid(J[3:]), "rad/s"),
        lost=loss.lost,
        always_missing=loss.always_missing,
        self_motions=_self_motions(scale.columns[:, None] * loss.still, arm),
        always_idle=arm.n - r,
        dependences=loss.dependences,
        notes=tuple(_notes(arm, q, r, ratio, rtol)),
        tip_speeds=None if judge.reason else judge.at(J, q, tip_speed, turn_speed),
    )


@dataclass(frozen=True, eq=False)
class Loss:
    """What is lost at a configuration, and why: the part of a State that a family needs."""

    J: Array  # (6, n), frame Jacobian, metres and radians
    sigma: Array  # (k,), of the task Jacobian at the arm's own scale
    ratio: float  # sigma_r / sigma_1
    status: Status
    rank: int  # how many are not zero
    # (n, d), orthonormal joint velocities at the own scale that give none of the others
    still: Array
    tool: Tool
    lost: tuple[LostMotion, ...] = ()
    always_missing: int = 0
    dependences: tuple[AxisDependence, ...] = ()


def loss_at(arm: Arm, q: Array, rtol: float = SINGULAR_RTOL, near_rtol: float = NEAR_RTOL) -> Loss:
    """Return what is lost at q (n,), which is in order, and why; arguments as of ``at``."""
    position, rotation, J = tip_and_jacobian(arm, q)
    scale = own_scale(arm)
    U, sigma, Vt = np.linalg.svd(scale_rows(arm, J, q, own=True))
    ratio = float(ratio_of(arm, sigma))
    status = status_of(ratio, rtol, near_rtol)
    # Nearly lost is what is not better than sigma_r, give or take a factor.
    zero = {SINGULAR: rtol, NEAR_SINGULAR: min(3 * ratio, near_rtol), REGULAR: rtol}[status]
    rank = rank_of(arm, sigma, zero)
    turning = J[3:].any(axis=0)
    # Greatest speed of the tip at unit speed of one joint: how long the arm is, metres.
    size = math.sqrt(float(np.square(J[:3, turning]).sum(axis=0).max(initial=0.0))) or 1.0
    tool = Tool(position, rotation, size, {})
    found = Loss(J, sigma, ratio, status, rank_of(arm, sigma, rtol), Vt[rank:].T, tool)
    if status == REGULAR:
        return found
    missing, never = U[:, rank:], generic_task(arm).never
    if never.shape[1] or missing.shape[1] > 1:  # an orthonormal basis of what is left
        left, sizes, _ = np.linalg.svd(missing - never @ (never.T @ missing), full_matrices=False)
        missing = left[:, sizes > 0.5]
    missing = np.asarray(task_rows(arm, np.eye(6), q).T @ missing)  # as directions in base axes
    tip = arm.task.tip_rows
    if any(tip) and not all(tip):  # rows in the axes of both need not be perpendicular
        missing = np.linalg.qr(missing)[0]
    hardly = status == NEAR_SINGULAR
    (axes,) = JointAxes.each(J[None], arm.prismatic, position)
    centres = {
        c.short: axes.meeting_point(c.ids, STRUCTURE_TOL) for c in arm_centres(arm) if c.short
    }
    tool = replace(tool, landmarks={f"the {c}": p for c, p in centres.items() if p is not None})
    tol = max(PRACTICAL, min(3 * ratio, 0.05)) if hardly else PRACTICAL
    if hardly or ratio > DEPENDENCE_RTOL:
        dependences = _beside(arm, q)
    else:
        dependences = dependences_of(arm, J, q, axes, max(DEPENDENCE_RTOL, rtol))
    return replace(
        found,
        tool=tool,
        lost=lost_motions(missing, J, scale.length, arm.length_scale, tool, tol, hardly),
        always_missing=len(arm.task.rows) - generic_rank(arm) - never.shape[1],
        dependences=dependences,
    )


def _beside(arm: Arm, q: Array) -> tuple[AxisDependence, ...]:
    """Return which axes are dependent at the singular configuration that q (n,) is near, if any."""
    exact = nominal(arm.design or arm).arm
    end = approach(exact, q)
    far = np.linalg.norm((end.q[0] - q) / own_scale(exact).columns)
    return (
        loss_at(exact, end.q[0]).dependences if end.ratio[0] <= SINGULAR_RTOL and far < 0.2 else ()
    )


def _self_motions(V: Array, arm: Arm) -> tuple[SelfMotion, ...]:
    """Null space V (n, d) by combinations of few joints: Gauss-Jordan with column pivoting."""
    V = V.copy()
    d = V.shape[1]
    pivots: list[int] = []
    for k in range(d):
        sizes = np.abs(V[:, k:]).max(axis=1).round(9)
        sizes[pivots] = -1.0
        pivot = int(sizes.argmax())
        column = k + int(np.argmax(np.abs(V[pivot, k:])))
        V[:, [k, column]] = V[:, [column, k]]
        V[:, k] /= V[pivot, k]
        V -= np.outer(V[:, k], np.where(np.arange(d) == k, 0.0, V[pivot]))
        pivots.append(pivot)
    V /= np.abs(V).max(axis=0, initial=1e-300)
    V[np.abs(V) < 1e-9] = 0.0
    found = []
    for v in sorted(V.T, key=lambda v: int(np.flatnonzero(v)[0])):
        moving = np.flatnonzero(np.abs(v) > 1e-6)
        v = v * np.sign(v[moving[0]]) + 0.0
        parts = [
            f"{arm.joints[i]} at {v[i]:+.3g} {'m/s' if arm.prismatic[i] else 'rad/s'}"
            for i in moving
        ]
        found.append(SelfMotion(v, listed(parts)))
    return tuple(found)


def _notes(arm: Arm, q: Array, r: int, ratio: float, rtol: float) -> Iterator[str]:
    """Say what the verdict stands on, and where the file's rounded numbers hide a singularity."""
    yield from scale_notes(arm)
    exact = nominal(arm)
    if exact.exact or ratio <= rtol:
        return
    there = float(ratios(exact.arm, q)[0])
    if there <= rtol:
        yield (
            f"{ROUNDED_AWAY} are made exact (nominal geometry, which "
            f"changes no Jacobian column by more than {exact.jacobian_change:.1e}): "
            f"sigma_{r}/sigma_1 = {there:.1e} there"
        )
