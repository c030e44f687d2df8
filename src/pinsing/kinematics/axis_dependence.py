"""Which joint axes are linearly dependent at a configuration, and why."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, combinations
from math import comb

import numpy as np

from pinsing._batch import engine as kernel
from pinsing._types import Array, NDArray
from pinsing.kinematics.batch import own_scale, random_turns
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.kinematics.lost_motion import (
    STRUCTURE_TOL,
    AxesCentre,
    JointAxes,
    dependent,
    find_centres,
    joints_of,
    numbers,
    orientation_reason,
    pose_reason,
    position_reason,
    reciprocal_reason,
)
from pinsing.kinematics.verdict import SINGULAR_RTOL, generic_rank, zero_of
from pinsing.measures import SEED
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import nominal
from pinsing.robot.source import kept
from pinsing.robot.task import TOOL_AXES

Ints = NDArray[np.intp]


class ColumnRanks:
    """Ranks of sets of columns of one task Jacobian, here and in general.

    Singular values at or below ``rtol`` times the largest are zero. ``generic`` (k, m, n):
    Jacobians at random configurations, without units. ``used``: joints that move the task
    somewhere.
    """

    def __init__(
        self, arm: Arm, J: Array, q: Array, rtol: float, generic: Array, used: tuple[int, ...]
    ) -> None:
        self.J = own_scale(arm).apply(arm, J, q)
        self.generic, self.used = generic, used
        self.zero = zero_of(arm, singular_values(self.J[None])[0], rtol)
        self._rank: dict[tuple[int, ...], int] = {(): 0}
        self._generic: dict[tuple[int, ...], int] = arm.once("generic_column_ranks", dict)
        r = generic_rank(arm)
        self.spare = len(self.used) - r
        self.lost = r - self.rank(self.used)

    def rank(self, ids: Sequence[int]) -> int:
        """Rank of the columns ``ids`` at the configuration."""
        key = tuple(ids)
        if key not in self._rank:
            self._rank[key] = int(self._ranks(np.array([ids]))[0])
        return self._rank[key]

    def nullity(self, ids: Sequence[int]) -> int:
        """Return how many of the columns ``ids`` the others of these make up for."""
        return len(ids) - self.rank(ids)

    def generic_rank(self, ids: Sequence[int]) -> int:
        """Rank of the columns ``ids`` at almost every configuration."""
        key = tuple(ids)
        if key not in self._generic:
            sigma = singular_values(self.generic[:, :, list(ids)])
            self._generic[key] = int((sigma > SINGULAR_RTOL * sigma.max()).sum(axis=-1).max())
        return self._generic[key]

    def deficient(self, ids: Sequence[int]) -> bool:
        """Return True if the columns ``ids`` have a smaller rank here than in general."""
        return self.rank(ids) < self.generic_rank(ids)

    def causes(self) -> list[tuple[int, ...]]:
        """Sets that force the loss, one for each rank lost."""
        found: list[tuple[int, ...]] = []
        for ids in self._by_size(self.used, self.spare + 1):
            if self.nullity(sorted(set(chain(ids, *found)))) - self.spare > len(found):
                found.append(ids)
            if len(found) == self.lost:
                break
        return found

    def pieces(self, ids: tuple[int, ...]) -> list[tuple[int, ...]]:
        """Return the smallest sets within ``ids`` that are dependent beyond what is general."""
        # As many as are needed for the nullity that forces the loss.
        if self.spare == 0:
            return [ids]
        found: list[tuple[int, ...]] = []
        union: list[int] = []
        for part in self._by_size(ids, 1):
            wider = sorted({*union, *part})
            if self.nullity(wider) > self.nullity(union) and self.deficient(part):
                found.append(part)
                union = wider
            if self.nullity(union) > self.spare:
                break
        return found

    def _ranks(self, sets: Ints) -> Ints:
        """Ranks at the configuration of sets (N, k) of columns."""
        stack = self.J[:, sets].transpose(1, 0, 2)  # (N, m, k)
        return np.asarray((singular_values(stack) > self.zero).sum(axis=-1))

    def _by_size(self, ids: Sequence[int], nullity: int) -> Iterator[tuple[int, ...]]:
        """Sets within ``ids``, smallest first, of at least this nullity."""
        for size in range(1, len(ids) + 1):
            # sets of joints; beyond, the whole arm is named without a search
            if comb(len(ids), size) > 60_000:
                break
            sets = np.array(ids)[_combinations(len(ids), size)]
            for k in np.flatnonzero(size - self._ranks(sets) >= nullity):
                yield tuple(int(i) for i in sets[k])
        else:
            return
        yield tuple(ids)


def singular_values(stack: Array) -> Array:
    """Singular values (N, k) of small matrices (N, m, n), in the compiled kernel if it is there."""
    if kernel.available() and min(stack.shape[1:]) > 0:
        return kernel.svdvals(stack, threads=1)
    return np.asarray(np.linalg.svd(stack, compute_uv=False), dtype=np.float64)


@functools.cache
def _combinations(n: int, size: int) -> Ints:
    """Sets (N, size) of that many out of n, as indices."""
    return np.array(list(combinations(range(n), size)), dtype=np.intp)


DEPENDENCE_RTOL = 10 * SINGULAR_RTOL
"""Part of an arm may be this much less singular than the whole and still be its cause."""

_SAMPLES = 4


@dataclass(frozen=True)
class AxisDependence:
    """Joints whose axes are linearly dependent although in general they are not.

    Attributes
    ----------
    joints : tuple of str
        Their names, base to tip.
    indices : tuple of int
        Their places in ``arm.joints``, counted from 0.
    reason : str
        Why, in words; joints are numbered from 1 there.
    """

    joints: tuple[str, ...]
    indices: tuple[int, ...]
    reason: str

    def __str__(self) -> str:
        return self.reason


def dependences_of(
    arm: Arm, J: Array, q: Array, axes: JointAxes, rtol: float
) -> tuple[AxisDependence, ...]:
    """Return independent reasons of a loss of rank, one for each rank lost, smallest set first.

    A set S of columns of the task Jacobian alone forces rank < r when its nullity ``|S| - rank(S)``
    exceeds n - r: the other columns cannot make up for it. Columns that never move the task are
    left out of n. Singular values at or below ``rtol`` times the largest are zero.
    """
    columns = ColumnRanks(arm, J, q, rtol, _generic_task(arm), moving_columns(arm))
    if columns.lost <= 0:
        return ()
    words = _Reasons(arm, axes, columns, rtol)
    return tuple(
        AxisDependence(tuple(arm.joints[i] for i in ids), ids, words.reason(ids))
        for ids in columns.causes()
    )


def landmarks(arm: Arm, axes: JointAxes) -> dict[str, Array]:
    """Return points (3,) where three axes in a row always meet: the wrist and shoulder centre."""
    if arm.coupling is not None:
        return {}
    found = {}
    for centre in arm_centres(arm):
        point = axes.meeting_point(centre.ids, STRUCTURE_TOL)
        if centre.short and point is not None:
            found[f"the {centre.short}"] = point
    return found


@kept
def arm_centres(arm: Arm) -> tuple[AxesCentre, ...]:
    """Sets of three turning axes in a row that meet in one point at every configuration."""
    return () if arm.coupling is not None else find_centres(generic_axes(arm))


@kept
def moving_columns(arm: Arm) -> tuple[int, ...]:
    """Joints (indices) that move the task at some configuration."""
    general = np.linalg.norm(_generic_task(arm), axis=1).max(axis=0)
    return tuple(int(i) for i in np.flatnonzero(general > SINGULAR_RTOL * general.max()))


def generic_axes(arm: Arm) -> list[JointAxes]:
    """Joint axes at random configurations, with the base as origin."""
    return JointAxes.each(_generic_jacobians(arm), arm.prismatic, np.zeros(3))


@kept
def _generic_task(arm: Arm) -> Array:
    """Task Jacobians (k, m, n) of the nominal geometry at random configurations, without units."""
    exact = nominal(arm).arm
    Q = random_turns(exact, _SAMPLES, SEED)
    return own_scale(exact).apply(exact, _generic_jacobians(exact), Q)


class _Reasons:
    """Says why sets of axes are dependent."""

    def __init__(self, arm: Arm, axes: JointAxes, columns: ColumnRanks, rtol: float) -> None:
        self.arm, self.columns = arm, columns
        self.task = arm.task.name
        self.coupled = arm.coupling is not None
        self.axes = axes
        self.centres = arm_centres(arm)
        named = self.task in ("pose", "position", "orientation") or arm.task.tool_axis is not None
        self.by_rows = not named and not self.coupled
        # Geometry is looked for at a tolerance that fits how singular the arm is.
        self.tol = float(np.clip(30 * rtol, STRUCTURE_TOL, 0.05))
        self.nearly = "" if rtol <= DEPENDENCE_RTOL else "nearly "

    def reason(self, ids: tuple[int, ...]) -> str:
        # Axes of which each three that lie in a plane need not be named
        if len(ids) > 3 and (words := self._in_line(ids)):
            return words
        parts = self.columns.pieces(ids)
        if parts == [ids]:
            return self._one(ids)
        # A redundant arm: what lines up, and why the other joints do not help.
        line = None
        if self.task == "pose" and not self.coupled:
            line = reciprocal_reason(self.axes, ids, self.tol, self.nearly)
        # Beside the line, or the whole, only small sets are worth naming.
        most = 2 if self.task != "pose" else 6 if line is None else 4
        named = [part for part in _merged(parts) if len(part) <= most]
        idle = [part[0] for part in named if len(part) == 1]
        said = [self._one(part) for part in named]
        if self.by_rows and len(idle) > 1:
            said = [self._idle(idle), *(self._one(part) for part in named if len(part) > 1)]
        if line is not None:
            plain = {dependent(part, self.nearly) for part in named}  # the line says more
            said = [*(words for words in said if words not in plain), line]
        elif self.task in ("position", "orientation") and not self.coupled:
            said.append(self._one(ids))
        else:
            rank, general = self.columns.rank(ids), self.columns.generic_rank(ids)
            several = "motion" if rank == 1 else "motions"
            who = "together they" if said else joints_of(ids)
            said.append(f"{who} give {rank} independent {several} instead of {general}")
        return "; ".join(dict.fromkeys(said))

    def _in_line(self, ids: tuple[int, ...]) -> str:
        """What is said of parallel axes that turn, and lie in one plane; nothing of others."""
        task = self.task == "pose" or (self.task != "position" and self._as_twists(ids))
        if self.coupled or not task or self.axes.prismatic[list(ids)].any():
            return ""
        if not self.axes.parallel(ids, self.tol) or not self.axes.in_one_plane(ids, self.tol):
            return ""
        which = "all axes" if len(ids) == self.arm.n else f"axes {numbers(ids)}"
        return f"links {self.nearly}in line: {which} are parallel and lie in one plane"

    def _one(self, ids: tuple[int, ...]) -> str:
        if self.coupled:
            return dependent(ids, self.nearly)
        if self.task == "position":
            return position_reason(self.axes, ids, self.tol, self.nearly)
        if self.task == "orientation":
            return orientation_reason(self.axes, ids, self.tol, self.nearly)
        if self.task == "pose" or self._as_twists(ids):
            return pose_reason(self.axes, ids, self.centres, self.tol, self.nearly)
        task = self.arm.task
        if len(task.rows) == 5 and task.tool_axis is not None:
            turn = f"a turn about the tool's own {TOOL_AXES[task.tool_axis]} axis"
            if len(ids) == 1:
                return f"all that joint {ids[0] + 1} moves is {self.nearly}{turn}"
            return f"{dependent(ids, self.nearly)}, but for {turn}"
        rows = ", ".join(task.row_names)
        return self._idle(ids) if len(ids) == 1 else dependent(ids, self.nearly, rows, "at zero")

    def _idle(self, ids: Sequence[int]) -> str:
        """Return what is said of joints that move none of the rows of a task."""
        move = "moves" if len(ids) == 1 else "move"
        rows = ", ".join(self.arm.task.row_names)
        return f"{joints_of(ids)} {move} {self.nearly}none of the rows {rows}"

    def _as_twists(self, ids: tuple[int, ...]) -> bool:
        """Return True if the whole twists are dependent, and not the chosen rows alone."""
        axes = self.axes
        v = np.array([axes.velocity(i, axes.tip) for i in ids])
        w = np.where(axes.prismatic[list(ids), None], 0.0, axes.direction[list(ids)])
        sigma = np.linalg.svd(np.concatenate([v / axes.size, w], axis=1), compute_uv=False)
        return len(ids) > 6 or bool(sigma[-1] <= self.tol * sigma[0])


def _merged(parts: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Join pairs that share a joint: collinear with one another, they are all collinear."""
    merged: list[tuple[int, ...]] = []
    for part in parts:
        for k, other in enumerate(merged):
            if len(part) == 2 and set(part) & set(other):
                merged[k] = tuple(sorted({*part, *other}))
                break
        else:
            merged.append(part)
    return merged


@kept
def _generic_jacobians(arm: Arm) -> Array:
    """Frame Jacobians (k, 6, n) at random configurations, whole circles."""
    return frame_jacobians(arm, random_turns(arm, _SAMPLES, SEED))
