"""Configurations over two coordinates of the output's pose, one for each working mode.

A pose fixes each leg by itself, so that a working mode is followed from pose to pose by Newton from
a neighbour, all neighbours at once: on a coarse grid first, then on a fine one of what was reached.
What is reached only past other poses is sought from random starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool
from pinsing.loops.batch import newton
from pinsing.loops.led_pose import led_pose
from pinsing.loops.pose_way import CLOSED_LOOPS, PoseWay
from pinsing.loops.pose_way import COORDINATES as COORDINATES
from pinsing.robot.mechanism import Mechanism

_COARSE = 41
_CHUNK = 4096
_NEAR_STEPS, _FAR_STEPS = 10, 30
_JUMP = 1.0
_TRIES = 3
_SEEDS = 120
_SEED = 1201
_SIZE = 1.3
_WIDER = 3


@dataclass(frozen=True, eq=False)
class PoseSlice:
    """A slice through the workspace.

    Attributes
    ----------
    names : (str, str)
        The two coordinates.
    x, y : (nx,), (ny,) arrays
        Their values, metres and radians.
    q : (modes, ny, nx, n) array
        Configurations that close the loops; NaN where none was found in that working mode.
    inside : (modes, ny, nx) array of bool
        Where they are within all limits of joints, active and passive.
    margin : (modes, ny, nx) array
        How far the joint that is nearest to a limit is inside; NaN as q, infinite without limits.
    """

    names: tuple[str, str]
    x: Array
    y: Array
    q: Array
    inside: Bool
    margin: Array


def pose_slice(
    mechanism: Mechanism, over: Sequence[str], starts: Sequence[Array], samples: int = 161
) -> PoseSlice:
    """Follow working modes over two coordinates of the pose; the others stay as at the start.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    over : two of x, y, z, roll, pitch, yaw
        In the order of the axes.
    starts : sequence of (n,) arrays
        One closed configuration of each mode, all at the same pose of the output.
    samples : int
        Grid points a side.

    Raises
    ------
    OptionError
        If the output cannot be led along these coordinates.
    """
    way = PoseWay(mechanism, over, starts[0])
    way.keep_turn(starts)
    size = [_SIZE, _SIZE]
    for _ in range(_WIDER):
        side = [way.side(k, _COARSE, size[k]) for k in (0, 1)]
        coarse = _Grid(way, side[0], side[1], len(starts))
        coarse.begin(starts)
        coarse.flood(2 * _COARSE)
        coarse.scatter()
        inside = np.asarray(coarse.judged()[0].any(axis=0))
        found: Bool = np.asarray(inside if inside.any() else coarse.solved.any(axis=0))
        # What goes on beyond the grid is looked for there.
        cut = [way.rows[k] < 3 and bool(np.take(found, (0, -1), axis=1 - k).any()) for k in (0, 1)]
        if not any(cut):
            break
        size = [1.6 * s if more else s for s, more in zip(size, cut, strict=True)]
    fine = [
        way.cropped(k, coarse.sides[k], found.any(axis=k), samples) for k in (0, 1)
    ]  # axis 0 of the mask is y
    for _ in range(_WIDER):
        grid = _Grid(way, fine[0], fine[1], len(starts))
        grid.follow(coarse)
        grid.flood(12)
        inside, margin = grid.judged()
        # What is thinner than a cell of the coarse grid may go on.
        fine, more = way.widened(fine, np.asarray(inside.any(axis=0)))
        if not more:
            break
    names = (COORDINATES[way.rows[0]], COORDINATES[way.rows[1]])
    return PoseSlice(names, grid.sides[0], grid.sides[1], grid.q, inside, margin)


def keeps_turn(mechanism: Mechanism, over: Sequence[str], start: Array) -> bool:
    """Whether the output keeps its axes wherever it is led from ``start`` (n,), by position alone.

    ``over`` is as of `pose_slice`, which raises the same.
    """
    return PoseWay(mechanism, over, start).keep_turn([start])


def free_coordinates(mechanism: Mechanism) -> tuple[str, ...]:
    """Coordinates of the pose along which the output can be led."""
    return tuple(COORDINATES[row] for row in led_pose(mechanism)["rows"])


class _Grid:
    """Configurations over a grid, being filled."""

    def __init__(self, way: PoseWay, x: Array, y: Array, modes: int) -> None:
        self.way, self.sides, self.modes = way, (x, y), modes
        shape = (modes, len(y), len(x))
        self.q = np.full((*shape, way.mechanism.n), np.nan)
        self.solved = np.zeros(shape, dtype=bool)
        self.fresh = np.zeros(shape, dtype=bool)
        self.tried = np.zeros(shape, dtype=np.int8)
        self.marks: list[Array] = []

    def begin(self, starts: Sequence[Array]) -> None:
        """The cells nearest to the start."""
        x, y = self.sides
        i = int(np.argmin(np.abs(x - self.way.start(0))))
        j = int(np.argmin(np.abs(y - self.way.start(1))))
        self.marks = [self.way.signs(q[None])[0] for q in starts]
        cells = np.array([(k, j, i) for k in range(self.modes)])
        self._take(cells, np.array(starts), far=np.inf)

    def follow(self, coarse: _Grid) -> None:
        """Every cell from the nearest one of a coarser grid."""
        from scipy.ndimage import distance_transform_edt

        self.marks = coarse.marks
        places = []
        for fine, rough in zip(self.sides, coarse.sides, strict=True):
            step = float(rough[1] - rough[0])
            places.append(np.clip(np.rint((fine - rough[0]) / step), 0, len(rough) - 1).astype(int))
        for k in range(self.modes):
            if not coarse.solved[k].any():
                continue
            away, (j, i) = distance_transform_edt(~coarse.solved[k], return_indices=True)
            jj, ii = np.meshgrid(places[1], places[0], indexing="ij")
            near = away[jj, ii] <= 2
            from_q = coarse.q[k, j[jj, ii], i[jj, ii]]
            cells = np.argwhere(near)
            cells = np.concatenate([np.full((len(cells), 1), k), cells], axis=1)
            self._take(cells, from_q[near])
        self.fresh = self.solved.copy()

    def flood(self, layers: int) -> None:
        """Go on from what is solved to its neighbours."""
        for _ in range(layers):
            source = np.full((*self.solved.shape, 2), -1)
            open_ = ~self.solved & (self.tried < _TRIES)
            chosen = np.zeros_like(self.solved)
            for dj, di in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                moved = np.zeros_like(self.fresh)
                to = (slice(None), _shifted(dj, True), _shifted(di, True))
                at = (slice(None), _shifted(dj, False), _shifted(di, False))
                moved[to] = self.fresh[at]
                new = moved & open_ & ~chosen
                chosen |= new
                source[new] = (-dj, -di)
            cells = np.argwhere(chosen)
            if not len(cells):
                return
            shift = source[chosen]
            from_q = self.q[cells[:, 0], cells[:, 1] + shift[:, 0], cells[:, 2] + shift[:, 1]]
            before = self.solved.copy()
            self.tried[chosen] += 1
            self._take(cells, from_q)
            # Cells that were tried in vain may be reached from another neighbour.
            self.fresh = self.solved & ~before

    def scatter(self) -> None:
        """Seek the same modes at poses that no way of neighbours has led to."""
        way = self.way
        rng = np.random.default_rng(_SEED)
        low, high = way.mechanism.space.span
        for k in range(self.modes):
            left = np.argwhere(~self.solved[k])
            if not len(left):
                continue
            left = left[rng.permutation(len(left))[:_SEEDS]]
            cells = np.concatenate([np.full((len(left), 1), k), left], axis=1)
            drawn = rng.uniform(low, high, (len(cells), way.mechanism.n))
            self._take(cells, drawn, far=np.inf, within=True)
        self.fresh = self.solved.copy()
        self.tried[:] = 0
        self.flood(2 * _COARSE)

    def judged(self) -> tuple[Bool, Array]:
        """What is within the limits, and by how much."""
        space = self.way.mechanism.space
        inside = np.zeros_like(self.solved)
        margin = np.full(self.solved.shape, np.nan)
        Q = space.fold(self.q[self.solved])
        inside[self.solved] = ~space.unreachable(Q).any(axis=1)
        room = np.minimum(Q - space.lower, space.upper - Q) / space.metric
        margin[self.solved] = room.min(axis=1)
        return inside, margin

    def _take(self, cells: Any, begin: Array, far: float = _JUMP, within: bool = False) -> None:
        """Solve cells (N, 3) from configurations (N, n), and keep what is of the same mode."""
        way = self.way
        x, y = self.sides
        for k in range(0, len(cells), _CHUNK):
            here, Q0 = cells[k : k + _CHUNK], begin[k : k + _CHUNK]
            R, p = way.targets(x[here[:, 2]], y[here[:, 1]])
            Q, error = newton(
                way.loops,
                Q0,
                way.free,
                target=(R, p, way.targets_rows),
                steps=_NEAR_STEPS if np.isfinite(far) else _FAR_STEPS,
            )
            ok = error <= CLOSED_LOOPS
            if np.isfinite(far):
                gap = np.abs(way.mechanism.space.wrap(Q - Q0)) / way.mechanism.space.metric
                ok &= gap.max(axis=1) <= far
            if within:
                ok &= ~way.mechanism.space.unreachable(Q).any(axis=1)
            ok[ok] &= self._alike(here[ok, 0], Q[ok])
            c = here[ok]
            self.q[c[:, 0], c[:, 1], c[:, 2]] = Q[ok]
            self.solved[c[:, 0], c[:, 1], c[:, 2]] = True
            self.fresh[c[:, 0], c[:, 1], c[:, 2]] = True

    def _alike(self, modes: Any, Q: Array) -> Bool:
        if not len(Q) or not self.way.ones:
            return np.ones(len(Q), dtype=bool)
        marks = np.array(self.marks)[modes]
        return np.asarray((self.way.signs(Q) * marks >= 0).all(axis=1))


def _shifted(by: int, to: bool) -> slice:
    """The part of an axis that a shift by -1, 0 or 1 leads to, or from."""
    if by == 0:
        return slice(None)
    return slice(1, None) if (by > 0) == to else slice(None, -1)
