"""Second order of lost motions in the compiled kernel, behind checked NumPy functions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinsing._batch import engine
from pinsing._batch.chain import FlatChain

Floats = NDArray[np.float64]


def covered(n: int, m: int) -> bool:
    """Whether configurations of n joints and m rows, of rank m in general, are compiled."""
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
    """What is known to second order of configurations where one motion is lost.

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
