"""What the whole package speaks of: arrays, and chains made of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

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
