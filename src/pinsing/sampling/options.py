"""How a run is computed: where it is kept, on what, by how many, and who hears of it."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Executor

from pinsing._dataclass import dataclass

Folder = str | os.PathLike[str]

Progress = Callable[[int, int], object]
"""Called with how much is done, and of all, after each chunk."""

Tell = Callable[[str], object]
"""Called with a sentence about what goes on."""


@dataclass(frozen=True, eq=False)
class RunOptions:
    """What decides no number of a run, but for the instruction set.

    Attributes
    ----------
    out : path-like or None
        Folder that each finished chunk is put in; a run that was stopped, or killed, can be
        resumed from it.
    engine : str
        ``auto``, ``batch``, ``pinocchio``, or an instruction set (``baseline``, ``avx2``,
        ``avx512``). A run that is resumed keeps the one it began with.
    threads : int or None
        As many as the process may use by default.
    executor : Executor or None
        Takes the chunks instead of threads: any ``concurrent.futures.Executor``.
    parallel : int or None
        How many chunks it works on at once; the number of processors here by default.
    progress : callable or None
        Called with how much is done, and of all.
    tell : callable or None
        Called with sentences for people: how much was there already, what was damaged.
    """

    out: Folder | None = None
    engine: str = "auto"
    threads: int | None = None
    executor: Executor | None = None
    parallel: int | None = None
    progress: Progress | None = None
    tell: Tell | None = None
