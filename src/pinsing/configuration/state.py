"""Everything about one configuration."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing import measures
from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.configuration.axis_dependence import (
    DEPENDENCE_RTOL,
    AxisDependence,
    axis_dependences,
    landmarks,
)
from pinsing.configuration.lost_motion import EXACT_TOL, LostMotion, Tool, lost_motions
from pinsing.geometry.nominal import nominal
from pinsing.kinematics.jacobian import (
    frame_jacobian,
    frame_jacobians,
    scale_rows,
    tip_placement,
)
from pinsing.kinematics.own_scale import own_scale, random_turns
from pinsing.kinematics.verdict import (
    NEAR_RTOL,
    SINGULAR_RTOL,
    check_tolerances,
    generic_rank,
    rank_of,
    ratio_of,
    ratios,
    scale_notes,
    status_of,
)
from pinsing.notebook import formula, name, table, text, verdict
from pinsing.robot.arm import Arm
from pinsing.robot.arm_summary import ArmSummary, summarize
from pinsing.serialization import JsonResult

SINGULAR, NEAR_SINGULAR, REGULAR = "singular", "near-singular", "regular"

_SEED = 77041


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
        The same in words, joints numbered from 1.
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
        (`pinsing.kinematics.own_scale`): that of ``sigma`` for a length scale as long as the arm.
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
        Which joint axes line up, and how.
    notes : tuple of str
        What else one should know.
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

    @property
    def singular(self) -> bool:
        """Whether the rank is below the generic one, to ``rtol``."""
        return self.status == SINGULAR

    def __str__(self) -> str:
        from pinsing.configuration.state_text import state_text

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
        tone = {SINGULAR: "alarm", NEAR_SINGULAR: "caution"}.get(self.status, "good")
        said = "SINGULAR" if self.status == SINGULAR else self.status
        ratio = rf"\sigma_{{{self.generic_rank}}}/\sigma_1 = {_latex_number(self.sigma_ratio)}"
        rows = [
            (text("verdict"), f"{verdict(said, tone)} {formula(ratio)}"),
            (text("rank"), f"{self.rank} {text('of')} {self.generic_rank}"),
            *(
                (name(joint), text(f"{value:.6g} {'m' if slides else 'rad'}"))
                for joint, value, slides in zip(
                    self.arm.joints, self.q, self.arm.prismatic, strict=True
                )
            ),
            *((text("lost"), text(motion.words)) for motion in self.lost),
            *((text("why"), text(dependence.reason)) for dependence in self.dependences),
            *((text("note"), text(note)) for note in self.notes),
        ]
        return f"<p>{name(self.arm.name)} {text('tip')} {name(self.arm.tip)}</p>{table(rows)}"


def _latex_number(value: float) -> str:
    """A number with its power of ten written as one."""
    mantissa, _, exponent = f"{value:.2g}".partition("e")
    return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa


@checked
def at(
    arm: Arm, q: npt.ArrayLike, rtol: float = SINGULAR_RTOL, near_rtol: float = NEAR_RTOL
) -> State:
    """Everything about the configuration q (n,), radians and metres, of an arm.

    Parameters
    ----------
    arm : Arm
        Any arm; its geometry is taken as it is (the raw one, unless it is ``nominal(arm).arm``).
    q : (n,) array_like
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
    J = frame_jacobian(arm, q)
    Js = scale_rows(arm, J)
    r = generic_rank(arm)
    scale = own_scale(arm)
    U, sigma, Vt = np.linalg.svd(scale.apply(arm, J))
    ratio = float(ratio_of(arm, sigma))
    status = status_of(ratio, rtol, near_rtol)
    # Nearly lost is what is not better than sigma_r, give or take a factor.
    zero = {SINGULAR: rtol, NEAR_SINGULAR: min(3 * ratio, near_rtol), REGULAR: rtol}[status]
    rank = rank_of(arm, sigma, zero)
    place = tip_placement(arm, q)
    position, rotation = np.array(place.translation), np.array(place.rotation)
    lost: tuple[LostMotion, ...] = ()
    always_missing = 0
    dependences: tuple[AxisDependence, ...] = ()
    if status != REGULAR:
        never = never_produced(arm)
        missing = _in_all_rows(arm, _without(U[:, rank:], never))
        always_missing = len(arm.task.rows) - r - never.shape[1]
        hardly = status == NEAR_SINGULAR
        tool = Tool(position, rotation, _size(J), landmarks(arm, J, position))
        tol = max(EXACT_TOL, min(3 * ratio, 0.05)) if hardly else EXACT_TOL
        lost = lost_motions(missing, J, scale.length, arm.length_scale, tool, tol, hardly)
        dependences = axis_dependences(arm, q, zero if hardly else max(DEPENDENCE_RTOL, rtol))
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
        rank=rank_of(arm, sigma, rtol),
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
        lost=lost,
        always_missing=always_missing,
        self_motions=_self_motions(scale.columns[:, None] * Vt[rank:].T, arm.prismatic),
        always_idle=arm.n - r,
        dependences=dependences,
        notes=tuple(_notes(arm, q, r, ratio, rtol)),
    )


def _ellipsoid(rows: Array, center: Array, unit: str) -> VelocityEllipsoid:
    axes, radii = measures.velocity_ellipsoid(rows)
    return VelocityEllipsoid(center, axes, radii, unit)


def _size(J: Array) -> float:
    """Greatest speed of the tip at unit speed of one joint: how long the arm is, metres."""
    turning = np.linalg.norm(J[3:], axis=0) > 0
    return float(np.linalg.norm(J[:3, turning], axis=0).max(initial=0.0)) or 1.0


def never_produced(arm: Arm) -> Array:
    """Orthonormal task directions (m, k) that the arm can produce at no configuration."""
    exact = nominal(arm).arm
    J = frame_jacobians(exact, random_turns(exact, 6, _SEED))
    U, sigma, _ = np.linalg.svd(np.concatenate(list(own_scale(exact).apply(exact, J)), axis=1))
    return np.asarray(U[:, int((sigma > SINGULAR_RTOL * sigma[0]).sum()) :])


def _without(U: Array, other: Array) -> Array:
    """Orthonormal basis of what is left of the columns of U (m, d) beside those of ``other``."""
    rest = U - other @ (other.T @ U)
    left, sigma, _ = np.linalg.svd(rest, full_matrices=False)
    return np.asarray(left[:, sigma > 0.5])


def _in_all_rows(arm: Arm, U: Array) -> Array:
    """Task directions (m, d) as directions (6, d), zero in the rows that the task leaves out."""
    out = np.zeros((6, U.shape[1]))
    out[list(arm.task.rows)] = U
    return out


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
    words = parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1]
    return SelfMotion(v, words)


def _notes(arm: Arm, q: Array, r: int, ratio: float, rtol: float) -> Iterator[str]:
    """Say what the verdict stands on, and where the file's rounded numbers hide a singularity."""
    yield from scale_notes(arm)
    exact = nominal(arm)
    if exact.exact or ratio <= rtol:
        return
    there = float(ratios(exact.arm, q)[0])
    if there <= rtol:
        yield (
            "singular if the rounded numbers of the file are made exact (nominal geometry, which "
            f"changes no Jacobian column by more than {exact.jacobian_change:.1e}): "
            f"sigma_{r}/sigma_1 = {there:.1e} there"
        )
