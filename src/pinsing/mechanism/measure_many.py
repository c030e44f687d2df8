"""The measures of many closed configurations at once: the same numbers as `motions` gives."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL
from pinsing.mechanism.batch import BatchLoops
from pinsing.mechanism.closure import ranks


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
    generic = ranks(mechanism)
    placed = loops.place(Q)
    G = loops.closure(Q, placed=placed)[1]
    J = loops.output(Q, placed)[2][:, list(mechanism.task.rows)]
    _, sigma, Vt = np.linalg.svd(G, full_matrices=True)
    r = generic.constraint
    top = sigma[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        constraint = np.where(top > 0, sigma[:, r - 1] / top, 0.0)
    N = np.swapaxes(Vt[:, r:], 1, 2)
    inputs = N[:, list(mechanism.actuated)]
    size = np.linalg.norm(J, 2, axis=(1, 2))
    moved = np.linalg.svd(J @ N, compute_uv=False)
    held = np.linalg.svd(inputs, compute_uv=False)
    d = N.shape[2]
    two = held[:, d - 1] if d <= held.shape[1] else np.zeros(len(Q))
    with np.errstate(divide="ignore", invalid="ignore"):
        one = np.where(size > 0, moved[:, generic.output - 1] / size, 0.0)
    lost = np.flatnonzero(constraint <= rtol)
    if len(lost):
        from pinsing.mechanism.motion import motions

        # More motions than the mobility: the basis is wider there, and few are.
        for k in lost.tolist():
            found = motions(mechanism, Q[k], rtol)
            one[k], two[k] = found.output_ratio, found.input_ratio
    return ManyMeasures(one, two, constraint)
