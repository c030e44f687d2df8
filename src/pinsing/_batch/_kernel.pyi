from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

MAX_RANK: int
MAX_COLUMNS: int
MAX_JOINTS: int
CHUNK: int

def isa_names() -> list[str]: ...
def jacobians(
    R: NDArray[np.float64],
    t: NDArray[np.float64],
    prismatic: NDArray[np.bool_],
    Q: NDArray[np.float64],
    out: NDArray[np.float64],
    isa: str,
    threads: int,
) -> None: ...
def singular_values(
    R: NDArray[np.float64],
    t: NDArray[np.float64],
    prismatic: NDArray[np.bool_],
    rows: Sequence[int],
    factors: Sequence[float],
    Q: NDArray[np.float64],
    out: NDArray[np.float64],
    isa: str,
    threads: int,
    max_sweeps: int,
) -> int: ...
def svdvals(
    A: NDArray[np.float64],
    out: NDArray[np.float64],
    isa: str,
    threads: int,
    max_sweeps: int,
) -> int: ...
