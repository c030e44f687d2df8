"""A serial chain as plain arrays: what the batch kernel computes on."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pinsing._dataclass import dataclass

_ROTATION_TOL = 1e-9


def _frozen(values: ArrayLike, dtype: type[np.generic], name: str) -> NDArray[np.generic]:
    array: NDArray[np.generic] = np.array(values, dtype=dtype, order="C", copy=True)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds a value that is not finite")
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class FlatChain:
    """A serial chain whose every joint turns about, or slides along, its own z axis.

    ``T(q) = C[0] M[0](q[0]) C[1] ... M[n-1](q[n-1]) C[n]`` with the constant placements
    ``C[i] = [[R[i], t[i]], [0, 1]]`` and ``M[i]`` a rotation about z (revolute) or a translation
    along z (prismatic). ``T`` places the tip in the base frame.

    Attributes
    ----------
    R : ndarray, shape (n + 1, 3, 3)
        Rotations of the constant placements.
    t : ndarray, shape (n + 1, 3)
        Their translations [m].
    prismatic : ndarray of bool, shape (n,)
        Which joints are prismatic.

    All arrays are copied, C-contiguous, float64 (bool) and read-only.

    Raises
    ------
    ValueError
        For shapes that do not fit, values that are not finite, or an ``R[i]`` that is no rotation.
    """

    R: NDArray[np.float64]
    t: NDArray[np.float64]
    prismatic: NDArray[np.bool_]

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", _frozen(self.R, np.float64, "R"))
        object.__setattr__(self, "t", _frozen(self.t, np.float64, "t"))
        object.__setattr__(self, "prismatic", _frozen(self.prismatic, np.bool_, "prismatic"))
        if self.prismatic.ndim != 1 or self.prismatic.size == 0:
            raise ValueError(f"prismatic: shape {self.prismatic.shape}, not (n,) with n >= 1")
        n = self.prismatic.size
        if self.R.shape != (n + 1, 3, 3):
            raise ValueError(f"R: shape {self.R.shape}, not {(n + 1, 3, 3)}")
        if self.t.shape != (n + 1, 3):
            raise ValueError(f"t: shape {self.t.shape}, not {(n + 1, 3)}")
        defect = np.abs(self.R @ self.R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        wrong = np.flatnonzero((defect > _ROTATION_TOL) | (np.linalg.det(self.R) < 0))
        if wrong.size:
            raise ValueError(f"R[{wrong[0]}] is not a rotation")

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.prismatic.size)
