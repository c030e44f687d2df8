"""Arrays, chains made of them, measures of Jacobians, and the tolerances that pinsing shares.

The measures take NumPy arrays and give numbers. All of them work on stacks: J has shape
(..., m, n), with rows in one unit (divide translation rows by a length scale first).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike as ArrayLike, NDArray as NDArray

Array: TypeAlias = NDArray[np.float64]  # numbers, SI units
Bool: TypeAlias = NDArray[np.bool_]
Ints: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Chain:
    """Tip placement C_0 M_0(q_0) C_1 ... C_k; C_i is (R[i], t[i]), M_i turns about z or slides."""

    R: Array  # (k + 1, 3, 3)
    t: Array  # (k + 1, 3), metres
    prismatic: Bool  # (k,)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.prismatic)


SINGULAR_RTOL = 1e-9
"""sigma_r / sigma_1 at or below this is singular."""

NEAR_RTOL = 1e-2
"""sigma_r / sigma_1 at or below this, and above SINGULAR_RTOL, is near-singular."""

ROUNDING = 1e-9
"""Radians, metres, and ratios: what rounding makes. Within it values are equal and limits kept."""

NOISE = 1e-12
"""What a few operations on doubles leave of zero, relative to what was added up."""

FLOAT_NOISE = 1e-13
"""What rounding alone makes of numbers of about one that are right to the last digits."""

ALIKE = 1e-6
"""Radians, metres, ratios: what is found where only half of the digits hold, as of double roots.

What differs by less is one, and what is smaller is zero.
"""

PRACTICAL = 1e-5
"""Radians, metres, ratios: of no matter to a machine, and far above what rounding makes."""

SOLVED = 1e-11
"""Radians, metres over the length scale: what is left of equations that are solved."""

SEED = 20
"""Of what is drawn at random where nobody gives another."""

Status = Literal["singular", "near-singular", "regular"]


class Reachability(str, Enum):
    """Whether a set of configurations has one within the joint limits.

    The members are the texts that JSON holds: ``Reachability.INSIDE == "reachable"``.
    """

    INSIDE = "reachable"
    AT_LIMIT = "at the joint limit"
    OUTSIDE = "not reachable"
    UNKNOWN = "none found"

    @property
    def known(self) -> bool | None:
        """True, False (proven), or None if no configuration within the limits was found."""
        return {"OUTSIDE": False, "UNKNOWN": None}.get(self.name, True)

    @property
    def words(self) -> str:
        """The same in a sentence."""
        return {
            "INSIDE": "within the joint limits",
            "AT_LIMIT": "at the joint limit",
            "OUTSIDE": "outside the joint limits",
            "UNKNOWN": "no point found within the joint limits",
        }[self.name]

    @staticmethod
    def of(known: bool | None) -> Reachability:
        """The member that ``known`` tells of."""
        inside, outside = Reachability.INSIDE, Reachability.OUTSIDE
        return {None: Reachability.UNKNOWN, True: inside, False: outside}[known]

    def __str__(self) -> str:
        return self.value


class Ellipsoid(NamedTuple):
    """Velocity ellipsoid of three task rows under unit joint speed.

    Attributes
    ----------
    axes : (..., 3, 3) array
        Columns are the directions of the semi-axes, a right-handed frame.
    radii : (..., 3) array
        Lengths of the semi-axes, largest first: the singular values.
    """

    axes: Array
    radii: Array


def singular_values(J: ArrayLike) -> Array:
    """Singular values of J (..., m, n), largest first: (..., min(m, n))."""
    return np.linalg.svd(np.asarray(J, dtype=float), compute_uv=False)


def rank(J: ArrayLike, rtol: float = SINGULAR_RTOL) -> NDArray[np.intp]:
    """Number of singular values of J (..., m, n) above ``rtol`` times the largest."""
    sigma = singular_values(J)
    return np.asarray((sigma > rtol * sigma[..., :1]).sum(axis=-1))


def sigma_ratio(sigma: ArrayLike, generic_rank: int | None = None, size: float = 0.0) -> Array:
    """sigma_r / sigma_1 from singular values (..., k), largest first; 0 for a zero Jacobian.

    Where all of J can vanish, sigma_1 says nothing of how small sigma_r is: it then counts
    as no smaller than ``size``, a typical sigma_1 (see `pinsing.kinematics.jacobian`).
    """
    sigma = np.asarray(sigma, dtype=float)
    r = sigma.shape[-1] if generic_rank is None else generic_rank
    first = np.maximum(sigma[..., 0], size)
    return np.asarray(
        np.divide(sigma[..., r - 1], first, out=np.zeros_like(first), where=first > 0)
    )


def status_of(ratio: float, rtol: float = SINGULAR_RTOL, near_rtol: float = NEAR_RTOL) -> Status:
    """Word for a ratio sigma_r / sigma_1: at or below ``rtol``, or ``near_rtol``, or above."""
    if ratio <= rtol:
        return "singular"
    return "near-singular" if ratio <= near_rtol else "regular"


def manipulability(J: ArrayLike, generic_rank: int | None = None) -> Array:
    """Yoshikawa's measure sqrt(det(J J^T)) of J (..., m, n), paper Eq. (14).

    Computed as the product of the first ``generic_rank`` singular values (all of them by
    default): the determinant itself loses half of the digits and can come out negative.
    """
    sigma = singular_values(J)
    r = sigma.shape[-1] if generic_rank is None else generic_rank
    return np.asarray(np.prod(sigma[..., :r], axis=-1))


def condition_number(J: ArrayLike, generic_rank: int | None = None) -> Array:
    """sigma_1 / sigma_r of J (..., m, n), paper Eq. (17); infinite where sigma_r is zero.

    A value that rounding alone has kept from zero (below max(m, n) eps sigma_1) counts as zero.
    """
    sigma = singular_values(J)
    r = sigma.shape[-1] if generic_rank is None else generic_rank
    last, first = sigma[..., r - 1], sigma[..., 0]
    infinite = np.full_like(last, np.inf)
    nonzero = last > max(np.shape(J)[-2:]) * np.finfo(float).eps * first
    return np.divide(first, last, out=infinite, where=nonzero)


def determinant(J: ArrayLike) -> Array:
    """det(J) where J (..., m, n) is square, det(J J^T) where it is wide (paper Eqs. (4), (5)).

    The latter is the squared product of the singular values; a tall J, whose J J^T is
    singular everywhere, gives det(J^T J), which is that product as well.
    """
    J = np.asarray(J, dtype=float)
    if J.shape[-1] == J.shape[-2]:
        return np.asarray(np.linalg.det(J))
    return np.asarray(np.prod(singular_values(J), axis=-1) ** 2)


def velocity_ellipsoid(J: ArrayLike) -> Ellipsoid:
    """Ellipsoid of tip velocities that unit joint speed reaches, paper Eqs. (15), (16).

    Parameters
    ----------
    J : (..., 3, n) array
        Three rows, either all translations or all rotations.

    Returns
    -------
    Ellipsoid
        Axes and radii in the units of J; a lost direction has radius zero (not floored).
    """
    J = np.asarray(J, dtype=float)
    m, n = J.shape[-2:]
    if m != 3:
        raise ValueError(f"an ellipsoid needs 3 rows, got {m}")
    axes, sigma, _ = np.linalg.svd(J, full_matrices=True)
    radii = np.zeros((*J.shape[:-2], 3))
    radii[..., : min(3, n)] = sigma
    axes = axes.copy()
    axes[..., :, 2] *= np.sign(np.linalg.det(axes))[..., None]
    return Ellipsoid(axes, radii)


def pure_ellipsoids(J: Array) -> tuple[Ellipsoid, Ellipsoid]:
    """Ellipsoids of the tip velocities without rotation, and of the rotations of a resting tip.

    Those of all motions, paper Eqs. (15), (16), stay round at most singularities of a pose
    task: a wrist with two axes in line still turns every way, only not without moving the
    tip. The motions that leave the other part at rest do collapse there: if the wrench
    (f, m) needs no joint torque, J^T (f, m) = 0, then every qdot with w(qdot) = 0 has
    f . v(qdot) = 0, and every one with v(qdot) = 0 has m . w(qdot) = 0. So the first
    ellipsoid is flat along f, the second one along m.

    Parameters
    ----------
    J : (6, n) array
        Frame Jacobian, translation rows first.

    Returns
    -------
    (translations, rotations)
        In m/s and rad/s at unit joint speed.
    """
    v, w = J[:3], J[3:]
    return velocity_ellipsoid(v @ _at_rest(w)), velocity_ellipsoid(w @ _at_rest(v))


def pure_by_default(task: str, generic_rank: int) -> bool:
    """Return True if pure motions are what to draw: of a pose, by arms that can move every way.

    Both ellipsoids have volume in general exactly where all six rows are independent.
    """
    return task == "pose" and generic_rank == 6


def _at_rest(rows: Array) -> Array:
    """Projector (n, n) onto the joint velocities that leave ``rows`` (3, n) at rest."""
    _, sigma, Vt = np.linalg.svd(rows, full_matrices=False)
    V = Vt[sigma > SINGULAR_RTOL * max(float(sigma[0]), 1e-300)]
    return np.asarray(np.eye(rows.shape[1]) - V.T @ V)
