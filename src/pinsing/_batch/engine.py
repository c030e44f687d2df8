"""The batch kernel behind checked NumPy functions.

An instruction set ("isa") is one of the names that :func:`isa_names` returns. Results are
bit-for-bit equal for any number of threads and any split of the input on one instruction set, and
agree to rounding across instruction sets.

Fixed limits of the kernel: singular values of matrices with a smaller side of at most 6 and a
larger one of at most 32; beyond them NumPy computes the singular values.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinsing._batch.built_from import why_stale
from pinsing.measures import Chain

try:
    import pinsing._batch._kernel as _kernel
except ImportError as error:  # not built at install time, or built for another Python
    _missing: str | None = (
        "the compiled batch engine is not installed: no working C++ compiler (GCC or Clang) was "
        f"found when pinsing was installed; install one and reinstall pinsing ({error})"
    )
else:
    _missing = why_stale(getattr(_kernel, "SOURCES", None), Path(__file__).parent)
    if _missing is None and not _kernel.isa_names():
        _missing = (
            f"the compiled batch engine was built for {', '.join(_kernel.built_names())} alone, "
            "which this processor does not have: install pinsing again on this machine"
        )

_HERE: tuple[str, ...] = () if _missing is not None else tuple(_kernel.isa_names())

Floats = NDArray[np.float64]


def available() -> bool:
    """Return True if the compiled kernel is installed."""
    return _missing is None


def unavailable_reason() -> str | None:
    """Why the kernel is not available, in one sentence; None where it is."""
    return _missing


def module() -> Any:
    """Return the compiled module; RuntimeError where it is not available."""
    if _missing is not None:
        raise RuntimeError(_missing)
    return _kernel


def isa_names() -> tuple[str, ...]:
    """Return the instruction sets that this machine can run, best last; empty without a kernel."""
    # "baseline" (what every machine of this kind has, SSE2 on x86), "avx2" (with FMA) and "avx512"
    # (F, DQ, VL, BW).
    return _HERE


def built_names() -> tuple[str, ...]:
    """Return the instruction sets that were compiled, best last, run here or not."""
    # `scripts/setup` without tests compiles the best one of its machine only; wheels have all.
    return () if _missing is not None else tuple(_kernel.built_names())


def cpu_count() -> int:
    """Count the processors that this process may use (its affinity mask)."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def jacobians(
    chain: Chain,
    Q: ArrayLike,
    *,
    threads: int | None = None,
    isa: str | None = None,
) -> Floats:
    """Return Jacobians (N, 6, n) of the tip at Q (N, n), LOCAL_WORLD_ALIGNED, translations first.

    ``threads`` are by default all, ``isa`` the best instruction set. ValueError for bad arguments,
    RuntimeError without the kernel.
    """
    how = np.require(Q, np.float64, ("C", "A")), *_how(isa, threads)
    return np.asarray(module().jacobians(chain.R, chain.t, chain.prismatic, *how))


def singular_values(
    chain: Chain,
    Q: ArrayLike,
    *,
    rows: Sequence[int] = (0, 1, 2, 3, 4, 5),
    length_scale: float = 1.0,
    threads: int | None = None,
    isa: str | None = None,
) -> Floats:
    """Return singular values (N, min(m, n)), descending, of the ``rows`` of Jacobians at Q (N, n).

    ``rows`` are m different ones of 0..5; translations are divided by ``length_scale`` (metres). As
    accurate as LAPACK's, small ones included. Else as `jacobians`.
    """
    rows, Q = list(rows), np.require(Q, np.float64, ("C", "A"))
    scale = [1.0 / length_scale if row < 3 else 1.0 for row in rows]
    if chain.n > module().MAX_COLUMNS:
        J = jacobians(chain, Q, threads=threads, isa=isa)
        return _lapack(J[:, rows] * np.array(scale)[:, None])
    how = rows, scale, Q, *_how(isa, threads)
    return np.asarray(module().singular_values(chain.R, chain.t, chain.prismatic, *how))


def svdvals(J: ArrayLike, *, threads: int | None = None, isa: str | None = None) -> Floats:
    """Return singular values (N, min(m, n)), descending, of matrices J (N, m, n).

    Without the kernel, and for what it has no room for, they are LAPACK's. Else as `jacobians`.
    """
    A = np.require(J, np.float64, ("C", "A"))
    small, large = sorted(A.shape[1:])
    if _missing is not None or not 0 < small <= _kernel.MAX_RANK or large > _kernel.MAX_COLUMNS:
        return _lapack(A)
    return np.asarray(_kernel.svdvals(A, *_how(isa, threads)))


def _lapack(A: Floats) -> Floats:
    return np.asarray(np.linalg.svd(A, compute_uv=False), dtype=np.float64)


def _how(isa: str | None, threads: int | None) -> tuple[str, int]:
    """An instruction set and a number of threads: the best, and all, where none is given."""
    return isa or isa_names()[-1], min(threads or cpu_count(), 1024)


def condition_set(families: int, flat: dict[str, NDArray[Any]], largest: bool) -> Any | None:
    """Return conditions in the kernel; None where it is missing or has no room for the joints."""
    # ``flat`` holds arrays of `pinsing.algebra.conditions` by name; ``largest`` is the metric.
    if _missing is not None or len(flat["turn"]) > _kernel.MAX_CONDITION_JOINTS:
        return None
    return _kernel.ConditionSet(families, flat, largest)


@dataclass(frozen=True, eq=False)
class WalkRules:
    """When walks end and how far their steps go: `pinsing.kinematics.refine` has the reasons.

    In the order of the kernel.
    """

    floor: float  # sigma_r / sigma_1 that only rounding is left of
    good: float  # the same from which on a step that does not improve is the end
    stationary: float  # square of the slope over sigma_1 sigma_r that counts as zero
    no_minimum: float  # sigma_r / sigma_1 below which that is no minimum
    longest: float  # length of a step
    most_damping: float  # at which a walk is given up
    stretch: float  # factor of the second step that is tried


def walks_covered(n: int, m: int, rank: int) -> bool:
    """Return True if walks of n joints, m rows and a generic rank are compiled."""
    equations = (m - rank + 1) * (n - rank + 1)
    return available() and n <= _kernel.WALK_JOINTS and equations <= _kernel.WALK_EQUATIONS


def walks(
    chain: Chain,
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
    """Walk from Q (N, n) to nearby configurations where the task Jacobian loses rank.

    Returned are ends (N, n), derivatives taken (N,), -1 where singular values did not converge and
    the end means nothing, and (N,) whether a walk rests at a nonzero minimum, or at damping without
    end.

    ``chain`` and Q are in the arm's own length; ``free`` (N, n) joints move within ``limits`` (n,).
    ``rows`` are m different ones of 0..5, ``rank`` the generic rank, ``size`` the least that
    sigma_1 counts as. ValueError for what does not fit, is not finite, or is not `walks_covered`.
    """
    X, ends = module().walks(
        chain.R,
        chain.t,
        chain.prismatic,
        [int(row) for row in rows],
        rank,
        float(size),
        *(np.ascontiguousarray(limit, dtype=np.float64) for limit in limits),
        astuple(rules),
        np.ascontiguousarray(Q, dtype=np.float64),
        np.ascontiguousarray(free, dtype=np.float64),
        *_how(isa, threads),
        min(max_iterations, 2**31 - 1),
    )
    return X, ends[:, 0].astype(np.intp), ends[:, 1] > 0
