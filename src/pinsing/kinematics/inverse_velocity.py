"""Joint speeds for a twist of the tip, near singular configurations too.

With ``J = U diag(sigma) V^T`` and a twist ``x``, joint speeds are
``sum_i gain_i (u_i . x) v_i``; the pseudoinverse has ``gain_i = 1 / sigma_i``, and what is achieved
along ``u_i`` is ``gain_i sigma_i`` of what is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pinsing.errors import ConfigurationError, OptionError
from pinsing.interface import JsonResult, checked
from pinsing.measures import NOISE, Array, ArrayLike, Ints

METHODS = ("pinv", "dls", "filter", "sdls", "jparse")

_HUGE = 1e100


def damped_gains(
    method: str,
    sigma: Array,
    damping: float,
    threshold: float,
    isotropic: float,
    manipulability: float | None,
    gamma: float,
) -> Array:
    """Return gains (..., k) of singular values (..., k), descending; all methods but "sdls"."""
    # A singular value that cannot be told from zero has gain zero with "pinv".
    largest = sigma[..., :1]
    if method == "pinv":
        lost = sigma <= NOISE * largest
        return np.where(lost, 0.0, 1 / np.where(lost, 1.0, sigma))
    if method == "dls":
        # Nakamura and Hanafusa: lambda^2 = lambda_0^2 (1 - w / w_0)^2 where w < w_0. With w the
        # product of all singular values, and w_0 that product with `threshold` as the last one,
        # w / w_0 is the last one over `threshold`.
        if manipulability is None:
            share = sigma[..., -1:] / threshold
        else:
            share = np.prod(sigma, axis=-1, keepdims=True) / manipulability
        return _over(sigma, (damping * np.maximum(1 - share, 0.0)) ** 2)
    if method == "filter":
        # Maciejewski and Klein: J^T (J J^T + lambda^2 1 + beta^2 u_m u_m^T)^-1, u_m the direction
        # that is lost. Each direction below the threshold has a beta of its own, so that nothing
        # jumps where two of them change places; with one it is theirs.
        beta = damping**2 * np.maximum(1 - (sigma / threshold) ** 2, 0.0)
        return _over(sigma, beta + isotropic**2)
    # J-PARSE: J_s^+ J_p J_p^+ + J_s^+ Phi; singular values below gamma sigma_max are that in J_s,
    # missing in J_p, and sigma / (gamma sigma_max) in Phi.
    least = np.where(largest > 0, gamma * largest, 1.0)
    return np.where(sigma > least, 1 / np.maximum(sigma, least), sigma / least**2)


def _over(sigma: Array, square: Array) -> Array:
    below = sigma**2 + square
    lost = (below <= 0) | ((square == 0) & (sigma <= NOISE * sigma[..., :1]))
    return np.asarray(np.where(lost, 0.0, sigma / np.where(lost, 1.0, below)))


def selective_gains(J: Array, sigma: Array, V: Array, wanted: Array, gamma_max: float) -> Array:
    """Return gains (..., k) of selectively damped least squares for components u_i . x (..., k).

    Buss and Kim: with rho_j the length of column j of J and N_i = |u_i| = 1 (one tip), M_i = sum_j
    |v_ji| rho_j / sigma_i, and joint speeds of direction i are cut to gamma_i = min(1, N_i / M_i)
    gamma_max (radians per second).
    """
    lost = sigma <= NOISE * sigma[..., :1]
    inverse = np.where(lost, 0.0, 1 / np.where(lost, 1.0, sigma))
    M = inverse * np.einsum("...jk,...j->...k", np.abs(V), np.linalg.norm(J, axis=-2))
    allowed = gamma_max * np.minimum(1.0, 1 / np.maximum(M, 1e-300))
    asked = np.abs(inverse * wanted) * np.abs(V).max(axis=-2)
    return np.asarray(inverse * np.minimum(1.0, allowed / np.maximum(asked, 1e-300)))


@dataclass(frozen=True, eq=False)
class InverseVelocity(JsonResult):
    """Joint speeds for twists of the tip, and what was given up for them.

    Singular directions and values are those of the Jacobian whose linear rows are divided by
    ``length_scale``; twists are in the units that were given.

    Attributes
    ----------
    dq : (..., n) array
        Joint speeds, radians and metres per second.
    achieved : (..., m) array
        The twist that they make: ``J dq``.
    missed : (..., m) array
        What was asked for less that.
    sigma : (..., k) array
        Singular values, descending, k = min(m, n).
    directions : (..., m, k) array
        Singular directions of the scaled twist, in columns: direction i belongs to ``sigma[i]``.
    kept : (..., k) array
        Share of the twist along each direction that is achieved: 1 is all of it. Before
        ``speed_scale``.
    damped : (...) array
        The largest of ``1 - kept``: 0 where nothing was given up.
    lost : (...) array of int
        The direction of which least is kept.
    speed_scale : (...) array
        What all joint speeds were multiplied by to keep the joint speed limits.
    method : str
        How.
    length_scale : float
        Metres.
    """

    schema: ClassVar[str] = "pinsing/inverse_velocity/1"

    dq: Array
    achieved: Array
    missed: Array
    sigma: Array
    directions: Array
    kept: Array
    damped: Array
    lost: Ints
    speed_scale: Array
    method: str
    length_scale: float


@checked
def inverse_velocity(
    J: ArrayLike,
    twist: ArrayLike,
    method: str = "dls",
    *,
    damping: float = 0.05,
    threshold: float = 0.1,
    isotropic: float = 0.0,
    manipulability: float | None = None,
    gamma: float = 0.1,
    gamma_max: float = np.pi / 4,
    length_scale: float = 1.0,
    weights: ArrayLike | None = None,
    speed_limits: ArrayLike | None = None,
) -> InverseVelocity:
    """Compute joint speeds for a twist of the tip, by a method that handles singularities.

    Methods and their sources:

    - "pinv": the pseudoinverse; speeds grow without bound towards a singular configuration.
    - "dls": damped least squares, ``J^T (J J^T + lambda^2 1)^-1``, with
      ``lambda = damping (1 - w / w_0)`` where the manipulability w is below w_0 (Y. Nakamura,
      H. Hanafusa, "Inverse kinematic solutions with singularity robustness for robot manipulator
      control", J. Dyn. Sys. Meas. Control 108 (1986)). w_0 is ``manipulability``, or by default
      the w at which the least singular value, alone, would be ``threshold``.
    - "filter": numerical filtering, ``J^T (J J^T + isotropic^2 1 + beta^2 u u^T)^-1``: only the
      lost direction u is damped (A. A. Maciejewski, C. A. Klein, "Numerical filtering for the
      operation of robotic manipulators through kinematically singular configurations", J. Robotic
      Systems 5 (1988)); ``beta^2 = damping^2 (1 - (sigma / threshold)^2)`` below ``threshold``,
      for each direction that is lost by its own sigma.
    - "sdls": selectively damped least squares: speeds of each direction are cut by how far they
      would carry the tip (S. R. Buss, J.-S. Kim, "Selectively damped least squares for inverse
      kinematics", J. Graphics Tools 10 (2005)), here with speeds in the place of steps, one tip,
      and ``gamma_max`` as the largest speed.
    - "jparse": J-PARSE (arXiv 2505.00306) with gain K_p = 1: directions whose singular value is
      below ``gamma`` times the largest are followed by ``(sigma / (gamma sigma_1))^2``.

    Parameters
    ----------
    J : (..., m, n) array_like
        Jacobians, such as those of ``frame_jacobian``.
    twist : (..., m) array_like
        What the tip is to do, in the rows of J: metres and radians per second.
    method : str
        "pinv", "dls", "filter", "sdls" or "jparse".
    damping, threshold, isotropic, manipulability
        Of "dls" and "filter", in units of singular values (or their product).
    gamma : float
        Of "jparse", between 0 and 1.
    gamma_max : float
        Of "sdls", radians per second.
    length_scale : float
        Metres; the first three of six rows, which are linear velocities, are divided by it before
        anything is measured. Other Jacobians have to be scaled by the caller.
    weights : (n,) array_like, optional
        What joint speeds are multiplied by where they are measured; 1 by default. With sliding
        joints 1 / length scale.
    speed_limits : (n,) array_like, optional
        Largest joint speeds; where one is exceeded, all are reduced by the same factor, so that
        the direction of motion stays.

    Returns
    -------
    InverseVelocity
        Joint speeds, the twist achieved, and where and how much was damped.

    Raises
    ------
    ConfigurationError
        If J and twist do not fit each other, or a value is not finite.
    OptionError
        If an option makes no sense.

    Examples
    --------
    >>> import numpy as np, pinsing
    >>> J = pinsing.frame_jacobian(pinsing.load("ur5"), [0, -1, 1, -1, 0.001, 0])
    >>> found = pinsing.inverse_velocity(J, [0, 0, 0, 0, 0.1, 0.1], "pinv")
    >>> bool(abs(found.dq).max() > 10)
    True
    >>> found = pinsing.inverse_velocity(J, [0, 0, 0, 0, 0.1, 0.1], "dls")
    >>> bool(abs(found.dq).max() < 1), bool(found.damped > 0.9)
    (True, True)
    """
    OptionError.refuse_if(
        method not in METHODS, f"method must be one of {', '.join(METHODS)}, got {method!r}"
    )
    positive = {"damping": damping, "threshold": threshold, "gamma_max": gamma_max}
    for name, value in {**positive, "manipulability": manipulability}.items():
        OptionError.refuse_if(
            value is not None and not 0 < value < _HUGE,
            f"{name} must be a positive number, got {value!r}",
        )
    OptionError.refuse_if(
        not 0 <= isotropic < _HUGE, f"isotropic must not be negative, got {isotropic!r}"
    )
    OptionError.refuse_if(not 0 < gamma < 1, f"gamma must be between 0 and 1, got {gamma!r}")
    jacobians, twists = _arrays(J, twist)
    m, n = jacobians.shape[-2:]
    OptionError.refuse_if(
        not 0 < length_scale < _HUGE, f"length_scale must be positive, got {length_scale!r}"
    )
    OptionError.refuse_if(
        length_scale != 1.0 and m != 6,
        f"length_scale is for Jacobians of 6 rows; scale the {m} rows of this one",
    )
    # What each row is divided by.
    rows = np.array([float(length_scale)] * 3 + [1.0] * 3) if m == 6 else np.ones(m)
    weight = _positive(weights, n, "weights", np.ones(n))
    OptionError.refuse_if(
        not np.isfinite(weight).all(), f"weights must be finite, got {weight.tolist()}"
    )
    scaled = jacobians / rows[:, None] / weight
    U, sigma, VT = np.linalg.svd(scaled, full_matrices=False)
    wanted = np.einsum("...mk,...m->...k", U, twists / rows)
    V = np.swapaxes(VT, -1, -2)
    if method == "sdls":
        gains = selective_gains(scaled, sigma, V, wanted, gamma_max)
    else:
        gains = damped_gains(method, sigma, damping, threshold, isotropic, manipulability, gamma)
    y = np.einsum("...nk,...k->...n", V, gains * wanted)
    if method == "sdls":
        y = y * np.minimum(1.0, gamma_max / np.maximum(np.abs(y).max(axis=-1), 1e-300))[..., None]
    dq = y / weight
    limits = _positive(speed_limits, n, "speed_limits", np.full(n, np.inf))
    scale = 1 / np.maximum((np.abs(dq) / limits).max(axis=-1), 1.0)
    dq = dq * scale[..., None]
    achieved = np.einsum("...mn,...n->...m", jacobians, dq)
    kept = gains * sigma
    return InverseVelocity(
        dq=dq,
        achieved=achieved,
        missed=twists - achieved,
        sigma=sigma,
        directions=U,
        kept=kept,
        damped=np.maximum(1 - kept.min(axis=-1), 0.0),
        lost=np.asarray(kept.argmin(axis=-1), dtype=np.int64),
        speed_scale=np.asarray(scale),
        method=method,
        length_scale=float(length_scale),
    )


def _arrays(J: ArrayLike, twist: ArrayLike) -> tuple[Array, Array]:
    jacobians, twists = np.array(J, dtype=float), np.array(twist, dtype=float)
    ConfigurationError.refuse_if(
        jacobians.ndim < 2 or 0 in jacobians.shape[-2:],
        f"J has shape (..., m, n), got {jacobians.shape}",
    )
    m = jacobians.shape[-2]
    ConfigurationError.refuse_if(
        twists.ndim == 0 or twists.shape[-1] != m,
        f"twist needs {m} values, one a row of J {jacobians.shape}; got shape {twists.shape}",
    )
    for name, array in (("J", jacobians), ("twist", twists)):
        ConfigurationError.refuse_if(
            not np.isfinite(array).all(), f"{name} has a value that is not finite"
        )
    try:
        shape = np.broadcast_shapes(jacobians.shape[:-2], twists.shape[:-1])
    except ValueError:
        raise ConfigurationError(
            f"J {jacobians.shape} and twist {twists.shape} are not as many"
        ) from None
    jacobians = np.broadcast_to(jacobians, (*shape, *jacobians.shape[-2:]))
    return jacobians, np.broadcast_to(twists, (*shape, m))


def _positive(given: ArrayLike | None, n: int, name: str, default: Array) -> Array:
    if given is None:
        return default
    array = np.array(given, dtype=float)
    OptionError.refuse_if(
        array.shape != (n,) or not (array > 0).all(),
        f"{name} needs {n} positive numbers, got {array.tolist()}",
    )
    return array
