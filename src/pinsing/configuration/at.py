"""at: everything about one configuration."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pinsing import measures
from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.configuration.axis_dependence import (
    DEPENDENCE_RTOL,
    AxisDependence,
    dependences_of,
    landmarks,
)
from pinsing.configuration.line_geometry import JointAxes
from pinsing.configuration.lost_motion import EXACT_TOL, LostMotion, Tool, lost_motions
from pinsing.configuration.state import (
    NEAR_SINGULAR,
    REGULAR,
    ROUNDED_AWAY,
    SINGULAR,
    SelfMotion,
    State,
    VelocityEllipsoid,
)
from pinsing.kinematics.batch import in_base, own_scale, random_turns
from pinsing.kinematics.jacobian import (
    frame_jacobians,
    scale_rows,
    tip_and_jacobian,
)
from pinsing.kinematics.verdict import (
    NEAR_RTOL,
    SINGULAR_RTOL,
    Status,
    check_tolerances,
    generic_rank,
    rank_of,
    ratio_of,
    ratios,
    scale_notes,
    status_of,
)
from pinsing.prose import listed
from pinsing.robot.arm import Arm, summarize
from pinsing.robot.nominal import nominal


@checked
def at(
    arm: Arm, q: npt.ArrayLike, rtol: float = SINGULAR_RTOL, near_rtol: float = NEAR_RTOL
) -> State:
    """Everything about the configuration q (n,), radians and metres, of an arm.

    Parameters
    ----------
    arm : Arm
        Any arm; its geometry is taken as it is (the raw one, unless it is ``nominal(arm).arm``).
    q : (n,) or (nq,) array_like
        Radians or metres; may lie outside the limits, which is then said.
    rtol, near_rtol : float
        sigma_r / sigma_1 at or below which q is called singular, or near-singular.

    Returns
    -------
    State
        With ``str()``: all of it in words.

    Raises
    ------
    ConfigurationError
        If q has the wrong length or is not finite.
    OptionError
        Unless 0 <= rtol <= near_rtol < 1; or if no joint ever moves the task.

    Examples
    --------
    >>> import pinsing
    >>> state = pinsing.at(pinsing.load("ur5"), [0, -1.2, 0, -1, -1.5, 0])
    >>> state.status, state.rank, state.generic_rank
    ('singular', 5, 6)
    """
    check_tolerances(rtol, near_rtol)
    q = arm.check_one(q)
    r = generic_rank(arm)
    loss = loss_at(arm, q, rtol, near_rtol)
    J, status, ratio = loss.J, loss.status, loss.ratio
    Js = scale_rows(arm, J, q)
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
        translational=_ellipsoid(J[:3], position, "m/s"),
        rotational=_ellipsoid(J[3:], position, "rad/s"),
        lost=loss.lost,
        always_missing=loss.always_missing,
        self_motions=_self_motions(scale.columns[:, None] * loss.still, arm.prismatic),
        always_idle=arm.n - r,
        dependences=loss.dependences,
        notes=tuple(_notes(arm, q, r, ratio, rtol)),
    )


@dataclass(frozen=True, eq=False)
class Loss:
    """What is lost at a configuration, and why: the part of a State that a family needs.

    Attributes
    ----------
    J : (6, n) array
        Frame Jacobian, metres and radians.
    sigma : (k,) array
        Singular values of the task Jacobian at the arm's own scale.
    ratio : float
        sigma_r / sigma_1 of these.
    status : str
        As of a State.
    rank : int
        Number of them that are not zero.
    still : (n, d) array
        Orthonormal joint velocities, at the own scale, that give none of the others.
    tool : Tool
        The tip.
    lost, always_missing, dependences
        As of a State.
    """

    J: Array
    sigma: Array
    ratio: float
    status: Status
    rank: int
    still: Array
    tool: Tool
    lost: tuple[LostMotion, ...] = ()
    always_missing: int = 0
    dependences: tuple[AxisDependence, ...] = ()


def loss_at(arm: Arm, q: Array, rtol: float = SINGULAR_RTOL, near_rtol: float = NEAR_RTOL) -> Loss:
    """What is lost at q (n,), which is in order, and why; arguments as of ``at``."""
    position, rotation, J = tip_and_jacobian(arm, q)
    scale = own_scale(arm)
    U, sigma, Vt = np.linalg.svd(scale.apply(arm, J, q))
    ratio = float(ratio_of(arm, sigma))
    status = status_of(ratio, rtol, near_rtol)
    # Nearly lost is what is not better than sigma_r, give or take a factor.
    zero = {SINGULAR: rtol, NEAR_SINGULAR: min(3 * ratio, near_rtol), REGULAR: rtol}[status]
    rank = rank_of(arm, sigma, zero)
    tool = Tool(position, rotation, _size(J), {})
    found = Loss(J, sigma, ratio, status, rank_of(arm, sigma, rtol), Vt[rank:].T, tool)
    if status == REGULAR:
        return found
    never = never_produced(arm)
    missing = _in_all_rows(arm, _without(U[:, rank:], never), q)
    hardly = status == NEAR_SINGULAR
    axes = JointAxes.of(J, arm.prismatic, position)
    tool = replace(tool, landmarks=landmarks(arm, axes))
    tol = max(EXACT_TOL, min(3 * ratio, 0.05)) if hardly else EXACT_TOL
    return replace(
        found,
        tool=tool,
        lost=lost_motions(missing, J, scale.length, arm.length_scale, tool, tol, hardly),
        always_missing=len(arm.task.rows) - generic_rank(arm) - never.shape[1],
        dependences=dependences_of(arm, J, q, axes, zero if hardly else max(DEPENDENCE_RTOL, rtol)),
    )


def _ellipsoid(rows: Array, center: Array, unit: str) -> VelocityEllipsoid:
    axes, radii = measures.velocity_ellipsoid(rows)
    return VelocityEllipsoid(center, axes, radii, unit)


def _size(J: Array) -> float:
    """Greatest speed of the tip at unit speed of one joint: how long the arm is, metres."""
    turning = J[3:].any(axis=0)
    return math.sqrt(float(np.square(J[:3, turning]).sum(axis=0).max(initial=0.0))) or 1.0


def never_produced(arm: Arm) -> Array:
    """Orthonormal task directions (m, k) that the arm can produce at no configuration."""
    return arm.once("never_produced", lambda: _never_produced(arm))


def _never_produced(arm: Arm) -> Array:
    exact = nominal(arm).arm
    Q = random_turns(exact, 6, 77041)
    J = own_scale(exact).apply(exact, frame_jacobians(exact, Q), Q)
    U, sigma, _ = np.linalg.svd(np.concatenate(list(J), axis=1))
    return np.asarray(U[:, int((sigma > SINGULAR_RTOL * sigma[0]).sum()) :])


def _without(U: Array, other: Array) -> Array:
    """Orthonormal basis of what is left of the columns of U (m, d) beside those of ``other``."""
    if U.shape[1] == 1 and not other.shape[1]:
        return U
    rest = U - other @ (other.T @ U)
    left, sigma, _ = np.linalg.svd(rest, full_matrices=False)
    return np.asarray(left[:, sigma > 0.5])


def _in_all_rows(arm: Arm, U: Array, q: Array) -> Array:
    """Task directions (m, d) as directions (6, d), base axes, none of what the task leaves out."""
    out = in_base(arm, U, q)
    tip = arm.task.tip_rows
    # Rows in the axes of both need not be perpendicular.
    return out if all(tip) or not any(tip) else np.asarray(np.linalg.qr(out)[0])


def _self_motions(V: Array, prismatic: npt.NDArray[np.bool_]) -> tuple[SelfMotion, ...]:
    """Null space V (n, d) by combinations of few joints: Gauss-Jordan with column pivoting."""
    V = V.copy()
    d = V.shape[1]
    pivots: list[int] = []
    for k in range(d):
        free = [i for i in range(len(V)) if i not in pivots]
        pivot = max(free, key=lambda i: float(np.abs(V[i, k:]).max().round(9)))
        column = k + int(np.argmax(np.abs(V[pivot, k:])))
        V[:, [k, column]] = V[:, [column, k]]
        V[:, k] /= V[pivot, k]
        others = [c for c in range(d) if c != k]
        V[:, others] -= np.outer(V[:, k], V[pivot, others])
        pivots.append(pivot)
    V /= np.abs(V).max(axis=0, initial=1e-300)
    V[np.abs(V) < 1e-9] = 0.0
    order = sorted(range(d), key=lambda c: int(np.flatnonzero(V[:, c])[0]))
    return tuple(_self_motion(V[:, c], prismatic) for c in order)


def _self_motion(v: Array, prismatic: npt.NDArray[np.bool_]) -> SelfMotion:
    first = v[np.flatnonzero(np.abs(v) > 1e-6)[0]]
    v = v * np.sign(first) + 0.0
    parts = [
        f"joint {i + 1} at {v[i]:+.3g} {'m/s' if prismatic[i] else 'rad/s'}"
        for i in np.flatnonzero(np.abs(v) > 1e-6)
    ]
    return SelfMotion(v, listed(parts))


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
