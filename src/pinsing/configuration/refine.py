"""From a configuration that is nearly singular to one that is so to machine accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._types import Array, Bool
from pinsing.arguments import checked
from pinsing.configuration.rank_drop import RankDrops, approach
from pinsing.configuration.second_order import Kind, second_order_many
from pinsing.errors import OptionError
from pinsing.kinematics.verdict import (
    NEAR_RTOL,
    SINGULAR_RTOL,
    Status,
    generic_rank,
    measure,
    status_of,
)
from pinsing.robot.arm import Arm
from pinsing.serialization import JsonResult


@dataclass(frozen=True, eq=False)
class SingularConfiguration(JsonResult):
    """A configuration and all that is known of its singularity.

    Attributes
    ----------
    joints : tuple of str
        Names of the joints, base to tip.
    q : (n,) array
        Joint vector, radians or metres.
    sigma : (r,) array
        Singular values of the task Jacobian (translation rows over the length scale),
        largest first.
    sigma_ratio : float
        sigma_r / sigma_1 at the arm's own scale, which the verdict stands on.
    rank, generic_rank : int
        Rank here (to ``rtol``) and r, the rank at almost every configuration.
    status : str
        ``singular`` (ratio <= ``rtol``), ``near-singular`` (ratio <= ``near_rtol``)
        or ``regular``.
    rtol, near_rtol : float
        Those tolerances.
    lost : (m, k) array
        Orthonormal task directions, translation rows over the length scale, base axes, that
        the tip cannot move in here but can at generic configurations; k = 0 if not singular.
    self_motion : (n, n - rank) array
        Orthonormal joint velocities that leave the tip still.
    residual : float
        Largest norm of J^T u over the lost directions u (sigma_r if not singular).
    iterations : int
        Derivative evaluations of the walk that ended here.
    converged : bool
        At a singularity, or at a minimum of sigma_r that is not zero.
    within_limits : bool
        All joints inside their limits, whole turns aside.
    kind : str
        ``boundary``, ``interior`` or ``undecided``; the last also if not singular.
    """

    schema: ClassVar[str] = "pinsing/singular-configuration/1"
    made_by: ClassVar[str] = "pinsing.refine(arm, q)"

    joints: tuple[str, ...]
    q: Array
    sigma: Array
    sigma_ratio: float
    rank: int
    generic_rank: int
    status: Status
    rtol: float
    near_rtol: float
    lost: Array
    self_motion: Array
    residual: float
    iterations: int
    converged: bool
    within_limits: bool
    kind: Kind

    @property
    def singular(self) -> bool:
        """True if the rank is below the generic one, to ``rtol``."""
        return self.status == "singular"

    def __str__(self) -> str:
        values = ", ".join(f"{name} = {x:.6g}" for name, x in zip(self.joints, self.q, strict=True))
        text = f"{self.status} at {values}: sigma_r/sigma_1 = {self.sigma_ratio:.1e}"
        if self.singular:
            text += f", rank {self.rank} of {self.generic_rank}"
            text += "" if self.kind == "undecided" else f", {self.kind}"
        return text + ("" if self.within_limits else ", outside the joint limits")


@checked
def refine(
    arm: Arm,
    q0: npt.ArrayLike,
    *,
    fixed: Sequence[str] | Bool | Sequence[bool] | None = None,
    ignore_limits: bool = False,
    max_iterations: int = 60,
) -> SingularConfiguration:
    """Walk from ``q0`` to a near singular configuration, or to the bottom of its dip.

    Solves J(q)^T u = 0 for a unit u (see ``configuration.rank_drop`` for what that becomes when the
    generic rank is below m, and how rank-deficient cases are survived).

    Parameters
    ----------
    arm : Arm
        Any arm.
    q0 : (n,) or (nq,) array_like
        Start, radians or metres.
    fixed : joint names or (n,) mask, optional
        Joints that keep their value.
    ignore_limits : bool
        Walk on whole circles from the start. Otherwise the walk keeps to the limits, and
        leaves them only if it finds no singular configuration inside.
    max_iterations : int
        Bound on the derivative evaluations.

    Returns
    -------
    SingularConfiguration
        Not necessarily singular: see ``status`` and ``converged``.

    Raises
    ------
    ConfigurationError
        If q0 has the wrong length or is not finite.
    UnknownNameError
        If ``fixed`` names a joint that does not exist.
    OptionError
        If ``fixed`` is neither names nor a mask.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.refine(pinsing.load("planar3r"), [0.3, 0.1, 1])
    >>> found.status, found.kind, bool(abs(found.q[1]) < 1e-9)
    ('singular', 'boundary', True)
    """
    q0 = arm.check_one(q0, "q0").reshape(1, arm.n)
    return refine_many(
        arm, q0, fixed=fixed, ignore_limits=ignore_limits, max_iterations=max_iterations
    )[0]


@checked
def refine_many(
    arm: Arm,
    Q0: npt.ArrayLike,
    *,
    fixed: Sequence[str] | Bool | Sequence[bool] | None = None,
    ignore_limits: bool = False,
    max_iterations: int = 60,
) -> tuple[SingularConfiguration, ...]:
    """Walk from each of many configurations, as `refine` does from one.

    Parameters
    ----------
    arm : Arm
        Any arm.
    Q0 : (N, n) or (N, nq) array_like
        Starts, radians or metres.
    fixed : joint names, (n,) or (N, n) mask, optional
        Joints that keep their value, at all starts or at each.
    ignore_limits, max_iterations
        As in ``refine``.

    Returns
    -------
    tuple of SingularConfiguration
        One for each start.

    Raises
    ------
    ConfigurationError
        If Q0 has the wrong shape or is not finite.
    OptionError
        If ``fixed`` is neither names nor such a mask.
    UnknownNameError
        If ``fixed`` names a joint that does not exist.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.refine_many(pinsing.load("planar3r"), [[0.3, 0.1, 1], [0, 3, 1]])
    >>> [c.q[1].round(3).item() + 0 for c in found]
    [0.0, 3.142]
    """
    Q0 = arm.check_many(Q0, "Q0")
    return _describe(arm, walk(arm, Q0, _free(arm, fixed), ignore_limits, max_iterations))


def walk(
    arm: Arm,
    Q0: Array,
    free: Bool | None = None,
    ignore_limits: bool = False,
    max_iterations: int = 60,
) -> RankDrops:
    """The walks of ``refine_many``, without a description of where they end."""
    start = np.atleast_2d(arm.space.fold(Q0))
    mask = np.broadcast_to(True if free is None else free, start.shape)
    inside = arm.within_limits(start) & (not ignore_limits)
    start = np.where(inside[:, None], np.clip(start, arm.lower, arm.upper), start)
    q, (sigma, ratio) = start.copy(), measure(arm, start)
    iterations = np.zeros(len(q), dtype=np.intp)
    converged = np.zeros(len(q), dtype=bool)
    rows = np.flatnonzero(inside)
    for bounded in (True, False):
        if len(rows):
            got = approach(arm, start[rows], mask[rows], bounded, max_iterations)
            iterations[rows] += got.iterations
            # From inside the limits, only what is singular is worth leaving them for.
            take = got.singular | bounded | ~inside[rows]
            kept = rows[take]
            q[kept], sigma[kept], ratio[kept] = got.q[take], got.sigma[take], got.ratio[take]
            converged[kept] = got.converged[take]
        rows = np.flatnonzero(~inside | (ratio > SINGULAR_RTOL))
    return RankDrops(arm.space.fold(q), sigma, ratio, iterations, converged)


def describe(arm: Arm, q: npt.ArrayLike) -> SingularConfiguration:
    """All that is known of the configuration q (n,) as it is, without moving it."""
    return describe_many(arm, arm.check_one(q)[None])[0]


def describe_many(arm: Arm, Q: npt.ArrayLike) -> tuple[SingularConfiguration, ...]:
    """The same of each row of Q (N, n)."""
    Q = arm.check_many(Q)
    here = RankDrops(Q, *measure(arm, Q), np.zeros(len(Q), int), np.ones(len(Q), bool))
    return _describe(arm, here)


def _describe(arm: Arm, drops: RankDrops) -> tuple[SingularConfiguration, ...]:
    r, inside = generic_rank(arm), arm.within_limits(drops.q)
    found = []
    for i, second in enumerate(second_order_many(arm, drops.q)):
        found.append(
            SingularConfiguration(
                joints=arm.joints,
                q=drops.q[i],
                sigma=second.sigma,
                sigma_ratio=second.ratio,
                rank=second.rank,
                generic_rank=r,
                status=status_of(second.ratio),
                rtol=SINGULAR_RTOL,
                near_rtol=NEAR_RTOL,
                lost=second.lost,
                self_motion=second.self_motion,
                residual=second.residual,
                iterations=int(drops.iterations[i]),
                converged=bool(drops.converged[i]),
                within_limits=bool(inside[i]),
                kind=second.kind,
            )
        )
    return tuple(found)


def _free(arm: Arm, fixed: Sequence[str] | npt.ArrayLike | None) -> Bool | None:
    """Mask of the joints that may move."""
    if fixed is None:
        return None
    given = [fixed] if isinstance(fixed, str) else fixed
    array = np.asarray(given)
    if array.dtype.kind == "U":
        return ~arm.space.mask(array.ravel().tolist())
    if array.dtype == bool and array.shape[-1:] == (arm.n,):
        return np.asarray(~array)
    if array.size == 0:
        return None
    raise OptionError(f"fixed must be joint names or a mask of {arm.n} booleans")
