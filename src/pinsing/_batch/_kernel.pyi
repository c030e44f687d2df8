from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAX_RANK: int
MAX_COLUMNS: int
MAX_JOINTS: int
CHUNK: int
WALK_JOINTS: int
WALK_EQUATIONS: int
SPEED_COLUMNS: int
SOURCES: str
MAX_CONDITION_JOINTS: int

class ConditionSet:
    def __init__(self, families: int, flat: dict[str, NDArray[Any]], largest: bool) -> None: ...
    def clearances(
        self,
        X: NDArray[np.float64],
        each: bool,
        points: bool,
        isa: str,
        threads: int,
    ) -> tuple[Any, ...]: ...
    def nearest(
        self,
        X: NDArray[np.float64],
        lower_limit: NDArray[np.float64],
        upper_limit: NDArray[np.float64],
        limited: bool,
        far: float,
        gap: float,
        boxes: int,
        threads: int,
    ) -> tuple[Any, ...]: ...
    def watch(
        self,
        x: NDArray[np.float64],
        velocity: NDArray[np.float64],
        horizon: float,
        gap: float,
        boxes: int,
        out: NDArray[np.float64],
        isa: str,
    ) -> int: ...

class Motions:
    def __init__(
        self,
        q: NDArray[np.float64],
        to: NDArray[np.float64],
        near: NDArray[np.float64],
        near_to: NDArray[np.float64],
        joints: NDArray[np.float64],
        counted: NDArray[np.int64],
        turns: NDArray[np.int64],
    ) -> None: ...
    def onward(
        self,
        source: NDArray[np.int64],
        far: NDArray[np.bool_],
        best: NDArray[np.float64],
        value: NDArray[np.float64],
        room: NDArray[np.float64],
        within: NDArray[np.bool_],
        floor: float,
        margin: float,
        found: NDArray[np.float64],
        origin: NDArray[np.int64],
        relaxed: NDArray[np.float64],
    ) -> tuple[tuple[NDArray[Any], ...], tuple[NDArray[Any], ...]]: ...
    def onward_back(
        self,
        source: NDArray[np.int64],
        through: NDArray[np.float64],
        passing: NDArray[np.float64],
        room: NDArray[np.float64],
        least: float,
        back: NDArray[np.float64],
    ) -> tuple[NDArray[Any], ...]: ...

def isa_names() -> list[str]: ...
def built_names() -> list[str]: ...
def jacobians(
    R: NDArray[np.float64],
    t: NDArray[np.float64],
    prismatic: NDArray[np.bool_],
    Q: NDArray[np.float64],
    isa: str,
    threads: int,
) -> NDArray[np.float64]: ...
def singular_values(
    R: NDArray[np.float64],
    t: NDArray[np.float64],
    prismatic: NDArray[np.bool_],
    rows: Sequence[int],
    factors: Sequence[float],
    Q: NDArray[np.float64],
    isa: str,
    threads: int,
) -> NDArray[np.float64]: ...
def svdvals(
    A: NDArray[np.float64],
    isa: str,
    threads: int,
) -> NDArray[np.float64]: ...
def walks(
    R: NDArray[np.float64],
    t: NDArray[np.float64],
    prismatic: NDArray[np.bool_],
    rows: Sequence[int],
    rank: int,
    size: float,
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    rules: Sequence[float],
    Q: NDArray[np.float64],
    free: NDArray[np.float64],
    isa: str,
    threads: int,
    max_iterations: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def joint_speeds(
    rows: NDArray[np.float64],
    linear: int,
    limits: NDArray[np.float64],
    far: NDArray[np.float64],
    turns: NDArray[np.bool_],
    moving: NDArray[np.bool_],
    speeds: Sequence[float],
    middle: int,
    rounds: int,
    J: NDArray[np.float64],
    R: NDArray[np.float64],
    isa: str,
    threads: int,
) -> NDArray[np.float64]: ...
def tubes(
    terms: NDArray[np.float64],
    start: Sequence[int],
    about: NDArray[np.float64],
    families: int,
    near: float,
    boxes: NDArray[np.float64],
    isa: str,
    threads: int,
) -> NDArray[np.float64]: ...
def to_poses(
    R: NDArray[np.float64],
    t: NDArray[np.float64],
    prismatic: NDArray[np.bool_],
    free: NDArray[np.bool_],
    position: NDArray[np.float64],
    rotation: NDArray[np.float64],
    scale: float,
    small: float,
    near: float,
    slower: float,
    Q: NDArray[np.float64],
    threads: int,
) -> None: ...
def distinct(
    Q: NDArray[np.float64],
    prismatic: NDArray[np.bool_],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    rounding: float,
    small: float,
    threads: int,
) -> None: ...
def divided(
    source: NDArray[np.int64],
    part: NDArray[np.int64],
    value: NDArray[np.float64],
    half: NDArray[np.float64],
    last_value: NDArray[np.float64],
    last_half: NDArray[np.float64],
    reach: float,
    cyclic: bool,
    none: int,
    before: NDArray[np.int32],
) -> NDArray[np.int32]: ...
def link_nodes(
    Q: NDArray[np.float64],
    turn: NDArray[np.float64],
    whole: NDArray[np.float64],
    scale: NDArray[np.float64],
    cyclic: bool,
    before: NDArray[np.int32],
    step: NDArray[np.float64],
    beside: NDArray[np.int32],
    ends: NDArray[np.bool_],
    way: NDArray[np.float64],
    threads: int,
) -> None: ...
def put_words(
    block: NDArray[np.uint64],
    heads: NDArray[np.uint64],
    place: int,
    columns: NDArray[np.int64],
    low: NDArray[np.float64],
    width: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None: ...
def count_values(
    values: NDArray[np.float64],
    shift: int,
    first: int,
    bins: NDArray[np.int64],
    low: float,
    high: float,
) -> tuple[int, int, int, int]: ...
