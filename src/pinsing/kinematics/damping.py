"""How much of each singular direction an inverse of the Jacobian keeps, by five methods.

With ``J = U diag(sigma) V^T`` and a twist ``x``, joint speeds are
``sum_i gain_i (u_i . x) v_i``; the pseudoinverse has ``gain_i = 1 / sigma_i``, and what is achieved
along ``u_i`` is ``gain_i sigma_i`` of what is asked for.
"""

from __future__ import annotations

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.errors import OptionError

METHODS = ("pinv", "dls", "filter", "sdls", "jparse")

_HUGE = 1e100
_ZERO = 1e-12
"""Singular values are zero at or below this times the largest."""


@dataclass(frozen=True)
class DampingOptions:
    """What the methods are told.

    Attributes
    ----------
    damping : float
        Largest damping factor lambda ("dls", "filter"), in units of singular values.
    threshold : float
        Singular value from which on damping begins ("dls", "filter").
    isotropic : float
        Damping of all directions ("filter").
    manipulability : float or None
        Manipulability w_0 below which "dls" damps, instead of the threshold.
    gamma : float
        Smallest share of the largest singular value that is left as it is ("jparse").
    gamma_max : float
        Largest joint speed that one direction may ask for ("sdls"), radians per second.
    """

    damping: float = 0.05
    threshold: float = 0.1
    isotropic: float = 0.0
    manipulability: float | None = None
    gamma: float = 0.1
    gamma_max: float = np.pi / 4

    def __post_init__(self) -> None:
        for name in ("damping", "threshold", "gamma_max", "manipulability"):
            value = getattr(self, name)
            if value is not None and not 0 < value < _HUGE:
                raise OptionError(f"{name} must be a positive number, got {value!r}")
        if not 0 <= self.isotropic < _HUGE:
            raise OptionError(f"isotropic must not be negative, got {self.isotropic!r}")
        if not 0 < self.gamma < 1:
            raise OptionError(f"gamma must be between 0 and 1, got {self.gamma!r}")


def damped_gains(method: str, sigma: Array, options: DampingOptions) -> Array:
    """Gains (..., k) of singular values (..., k), descending; all methods but "sdls".

    A singular value that cannot be told from zero has gain zero with "pinv".
    """
    o = options
    largest = sigma[..., :1]
    if method == "pinv":
        lost = sigma <= _ZERO * largest
        return np.where(lost, 0.0, 1 / np.where(lost, 1.0, sigma))
    if method == "dls":
        # Nakamura and Hanafusa: lambda^2 = lambda_0^2 (1 - w / w_0)^2 where w < w_0. With w the
        # product of all singular values, and w_0 that product with `threshold` as the last one,
        # w / w_0 is the last one over `threshold`.
        if o.manipulability is None:
            share = sigma[..., -1:] / o.threshold
        else:
            share = np.prod(sigma, axis=-1, keepdims=True) / o.manipulability
        square = (o.damping * np.maximum(1 - share, 0.0)) ** 2
        return _over(sigma, square)
    if method == "filter":
        # Maciejewski and Klein: J^T (J J^T + lambda^2 1 + beta^2 u_m u_m^T)^-1, u_m the direction
        # that is lost. Each direction below the threshold has a beta of its own, so that nothing
        # jumps where two of them change places; with one it is theirs.
        beta = o.damping**2 * np.maximum(1 - (sigma / o.threshold) ** 2, 0.0)
        return _over(sigma, beta + o.isotropic**2)
    # J-PARSE: J_s^+ J_p J_p^+ + J_s^+ Phi; singular values below gamma sigma_max are that in J_s,
    # missing in J_p, and sigma / (gamma sigma_max) in Phi.
    least = np.where(largest > 0, o.gamma * largest, 1.0)
    return np.where(sigma > least, 1 / np.maximum(sigma, least), sigma / least**2)


def _over(sigma: Array, square: Array) -> Array:
    below = sigma**2 + square
    lost = (below <= 0) | ((square == 0) & (sigma <= _ZERO * sigma[..., :1]))
    return np.asarray(np.where(lost, 0.0, sigma / np.where(lost, 1.0, below)))


def selective_gains(J: Array, sigma: Array, V: Array, wanted: Array, gamma_max: float) -> Array:
    """Gains (..., k) of selectively damped least squares for components u_i . x (..., k).

    Buss and Kim: with rho_j the length of column j of J and N_i = |u_i| = 1 (one tip),
    M_i = sum_j |v_ji| rho_j / sigma_i, and joint speeds of direction i are cut to
    gamma_i = min(1, N_i / M_i) gamma_max.

    Parameters
    ----------
    J : (..., m, n) array
        The Jacobian.
    sigma : (..., k) array
        Its singular values, descending.
    V : (..., n, k) array
        Its right singular vectors.
    wanted : (..., k) array
        Components of the twist along the left ones.
    gamma_max : float
        Radians per second.
    """
    lost = sigma <= _ZERO * sigma[..., :1]
    inverse = np.where(lost, 0.0, 1 / np.where(lost, 1.0, sigma))
    columns = np.linalg.norm(J, axis=-2)
    M = inverse * np.einsum("...jk,...j->...k", np.abs(V), columns)
    allowed = gamma_max * np.minimum(1.0, 1 / np.maximum(M, 1e-300))
    asked = np.abs(inverse * wanted) * np.abs(V).max(axis=-2)
    return np.asarray(inverse * np.minimum(1.0, allowed / np.maximum(asked, 1e-300)))
