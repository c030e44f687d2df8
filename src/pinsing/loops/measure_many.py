"""The measures of many closed configurations at once: the same numbers as `motions` gives."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.loops.batch import BatchLoops
from pinsing.loops.closure import ranks
from pinsing.loops.whole_balls import ball_jacobians, locked
from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL
from pinsing.robot.mechanism import Mechanism

_ZERO = 1e-12


@dataclass(frozen=True, eq=False)
class ManyMeasures:
    """Measures of N configurations, without units.

    Attributes
    ----------
    output_ratio, input_ratio, constraint_ratio : (N,) arrays
        Zero at type 1, type 2 and constraint singularities, as of `Motions`.
    """

    output_ratio: Array
    input_ratio: Array
    constraint_ratio: Array

    def kinds(self, rtol: float = SINGULAR_RTOL) -> npt.NDArray[np.str_]:
        """``regular``, ``near``, ``type 1``, ``type 2``, ``type 3`` or ``constraint``, each."""
        one, two = self.output_ratio <= rtol, self.input_ratio <= rtol
        least = np.minimum(np.minimum(self.output_ratio, self.input_ratio), self.constraint_ratio)
        return np.select(
            [self.constraint_ratio <= rtol, one & two, one, two, least <= NEAR_RTOL],
            ["constraint", "type 3", "type 1", "type 2", "near"],
            "regular",
        )


def measure_many(loops: BatchLoops, Q: Array, rtol: float = SINGULAR_RTOL) -> ManyMeasures:
    """Measures at closed configurations Q (N, n)."""
    mechanism = loops.mechanism
    placed = loops.place(Q)
    J = loops.output(Q, placed)[2][:, list(mechanism.task.rows)]
    ratios = _ratios(mechanism, loops.closure(Q, placed=placed)[1], J)
    beside = ratios.min(axis=0) <= NEAR_RTOL
    beside[beside] = locked(mechanism, Q[beside])
    if beside.any():  # a ball that is locked as written turns as a ball does
        ratios[:, beside] = _ratios(mechanism, *ball_jacobians(loops, Q[beside]))
    lost = np.flatnonzero(ratios[2] <= rtol)
    if len(lost):
        from pinsing.loops.motion import motions

        for k in lost.tolist():  # more motions than the mobility; few are
            found = motions(mechanism, Q[k], rtol)
            ratios[:, k] = found.output_ratio, found.input_ratio, found.constraint_ratio
    return ManyMeasures(*ratios)


def _ratios(mechanism: Mechanism, G: Array, J: Array) -> Array:
    """Measures (3, N), in their order, from Jacobians of closure (N, k, n) and output (N, m, n)."""
    generic = ranks(mechanism)
    r = generic.constraint
    sigma, N = _motions(G, r)
    top = sigma[:, 0]
    inputs = N[:, list(mechanism.actuated)]
    size = np.sqrt(np.maximum(np.linalg.eigvalsh(J @ np.swapaxes(J, 1, 2))[:, -1], 0.0))
    moved = np.linalg.svd(J @ N, compute_uv=False)
    held = np.linalg.svd(inputs, compute_uv=False)
    d = N.shape[2]
    two = held[:, d - 1] if d <= held.shape[1] else np.zeros(len(G))
    with np.errstate(divide="ignore", invalid="ignore"):
        one = np.where(size > 0, moved[:, generic.output - 1] / size, 0.0)
        constraint = np.where(top > 0, sigma[:, r - 1] / top, 0.0)
    return np.array([one, two, constraint], dtype=float)


def _motions(G: Array, rank: int) -> tuple[Array, Array]:
    """Singular values of G (N, k, n), and a basis (N, n, n - rank) of what it sends to zero.

    Where as many rows as the rank are other than zero, those of the triangle of G' = Q R are those
    of G, and the last columns of Q are the basis: that takes two thirds of the time.
    """
    rows = np.flatnonzero(np.abs(G).max(axis=(0, 2)) > _ZERO)
    if len(rows) != rank:
        _, sigma, Vt = np.linalg.svd(G, full_matrices=True)
        return sigma, np.swapaxes(Vt[:, rank:], 1, 2)
    Q, R = np.linalg.qr(np.swapaxes(G[:, rows], 1, 2), mode="complete")
    return np.linalg.svd(R[:, :rank], compute_uv=False), Q[:, :, rank:]
