"""The array types that the whole package speaks of."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike as ArrayLike, NDArray as NDArray

Array: TypeAlias = NDArray[np.float64]  # numbers, SI units
Bool: TypeAlias = NDArray[np.bool_]
Ints: TypeAlias = NDArray[np.int64]
