"""Walks to rank drops, and second orders there, in the compiled kernel behind NumPy functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinsing._batch import engine
from pinsing._batch.engine import FlatChain

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WalkRules:
    """When walks end and how far their steps go: `pinsing.configuration.refine` has the reasons.

    Attributes
    ----------
    floor, good : float
        sigma_r / sigma_1 that only rounding is left of, and from which on a step that does not
        improve is the end.
    stationary, no_minimum : float
        Square of the slope over sigma_1 sigma_r that counts as zero, and sigma_r / sigma_1 below
        which that is no minimum.
    longest : float
        Length of a step.
    most_damping : float
        Damping at which a walk is given up.
    stretch : float
        Factor of the second step that is tried.
    """

    floor: float
    good: float
    stationary: float
    no_minimum: float
    longest: float
    most_damping: float
    stretch: float

    def numbers(self) -> list[float]:
        """In the order of the kernel."""
        first = [self.floor, self.good, self.stationary, self.no_minimum]
        return [*first, self.longest, self.most_damping, self.stretch]


def covered(n: int, m: int, rank: int) -> bool:
    """Return True if walks of n joints, m rows and a generic rank are compiled."""
    if not engine.available():
        return False
    kernel = engine.module()
    equations = (m - rank + 1) * (n - rank + 1)
    return bool(n <= kernel.WALK_JOINTS and equations <= kernel.WALK_EQUATIONS)


def walks(
    chain: FlatChain,
    Q: ArrayLike,
    free: NDArray[np.bool_],
    limits: tuple[Floats, Floats],
    *,
    rows: Sequence[int],
    rank: int,
    size: float,
    rules: WalkRules,
    max_iterations: int,
    threads: int | None = None,
    isa: str | None = None,
) -> tuple[Floats, NDArray[np.intp], NDArray[np.bool_]]:
    """Walk from many configurations to nearby ones where the task Jacobian loses rank.

    Parameters
    ----------
    chain : FlatChain
        The chain in the arm's own length, n joints.
    Q : array_like, shape (N, n)
        Starts: radians, and lengths of the arm. Never modified.
    free : ndarray of bool, shape (N, n)
        Joints that may move.
    limits : pair of ndarrays, shape (n,)
        Least and largest joint values, perhaps infinite.
    rows : sequence of int
        Rows of the Jacobian that make the task, m different ones of 0..5.
    rank : int
        The generic rank.
    size : float
        What sigma_1 counts as at least.
    rules : WalkRules
        When walks end.
    max_iterations : int
        Bound on the derivatives for one start.
    threads, isa
        As for `pinsing._batch.engine.jacobians`.

    Returns
    -------
    X : ndarray, shape (N, n)
        Where walks end.
    iterations : ndarray of int, shape (N,)
        Derivatives taken; -1 where singular values did not converge: then X means nothing.
    stationary : ndarray of bool, shape (N,)
        Whether the walk came to rest at a minimum that is not zero, or at damping without end.

    Raises
    ------
    ValueError
        For shapes that do not fit, values that are not finite, or what is not `covered`.
    """
    kernel = engine.module()
    Q = np.ascontiguousarray(Q, dtype=np.float64)
    X, ends = np.empty_like(Q), np.empty((len(Q), 2))
    kernel.walks(
        chain.R,
        chain.t,
        chain.prismatic,
        [int(row) for row in rows],
        rank,
        float(size),
        *(np.ascontiguousarray(limit, dtype=np.float64) for limit in limits),
        rules.numbers(),
        Q,
        np.ascontiguousarray(free, dtype=np.float64),
        X,
        ends,
        isa or engine.isa_names()[-1],
        engine.cpu_count() if threads is None else threads,
        min(max_iterations, 2**31 - 1),
        engine.MAX_SWEEPS,
    )
    return X, ends[:, 0].astype(np.intp), ends[:, 1] > 0


def second_orders_covered(n: int, m: int) -> bool:
    """Return True if configurations of n joints and m rows, of rank m in general, are compiled."""
    return engine.available() and m <= n <= int(engine.module().WALK_JOINTS)


def second_orders(
    chain: FlatChain,
    Q: ArrayLike,
    *,
    rows: Sequence[int],
    zero: float,
    size: float,
    threads: int | None = None,
    isa: str | None = None,
) -> Floats:
    """Return what is known to second order of configurations where one motion is lost.

    Parameters
    ----------
    chain : FlatChain
        The chain in the arm's own length, n joints.
    Q : array_like, shape (N, n)
        Radians, and lengths of the arm. Never modified.
    rows : sequence of int
        Rows of the Jacobian that make the task, m different ones of 0..5; the generic rank is m.
    zero : float
        Share of sigma_1 up to which a singular value is zero.
    size : float
        What sigma_1 counts as at least.
    threads, isa
        As of `pinsing._batch.engine.jacobians`.

    Returns
    -------
    (N, 6) array
        How many singular values are not zero. With the last left singular vector u, the last
        n - m + 1 right ones N, and B_ij = u . dJ_i / dq_j: least and greatest eigenvalue of
        Q = sym(N^T B N), its largest entry, the norm of B N, and the largest entry of dJ.
    """
    Q = np.ascontiguousarray(Q, dtype=np.float64)
    out = np.empty((len(Q), 6))
    engine.module().second_orders(
        chain.R,
        chain.t,
        chain.prismatic,
        list(rows),
        zero,
        size,
        Q,
        out,
        isa or engine.isa_names()[-1],
        engine.cpu_count() if threads is None else threads,
    )
    return out
