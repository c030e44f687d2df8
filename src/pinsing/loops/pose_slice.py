"""Poses of the output as two of their coordinates move, the others as they are at a start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing.errors import OptionError
from pinsing.loops.closure import BatchLoops, newton
from pinsing.loops.joint_loci import joint_forms
from pinsing.loops.motion import COORDINATES, home, led_pose
from pinsing.loops.structure import extent, output_pose
from pinsing.measures import ROUNDING, Array, ArrayLike, Bool
from pinsing.robot.mechanism import Mechanism


class PoseWay:
    """Poses of the output as two of their coordinates move."""

    def __init__(self, mechanism: Mechanism, over: Sequence[str], start: Array) -> None:
        self.mechanism = mechanism
        self.loops = BatchLoops(mechanism)
        self.led = led_pose(mechanism)
        led = self.led["rows"]
        free = tuple(COORDINATES[row] for row in led)
        names = ["yaw" if n in ("phi", "φ") else n for n in over]
        OptionError.refuse_if(
            len(names) != 2 or names[0] == names[1] or not set(names) <= set(free),
            f"a map over the pose goes over two of {', '.join(free)}; got {', '.join(over)}",
        )
        self.rows = (COORDINATES.index(names[0]), COORDINATES.index(names[1]))
        self.turn = self.led["turn"] or {"kind": "none"}
        OptionError.refuse_if(
            self.turn["kind"] == "angles" and {3, 4} - set(led),
            f"{mechanism.name}: its turns are tied to each other, so that a slice through its "
            "poses is none; take pinsing map --loops --over poses",
        )
        self.targets_rows = tuple(led)
        self.extent = extent(mechanism, home(mechanism))
        self.place = output_pose(mechanism, start)
        self.angles = pin.rpy.matrixToRpy(np.array(self.place.rotation))
        self.free = np.ones(mechanism.n, dtype=bool)
        forms = joint_forms(mechanism)
        slides = {n for n, p in zip(mechanism.joints, mechanism.prismatic, strict=True) if p}
        self.ones = [
            x
            for x in (forms.loci if forms.complete else ())
            if (x.kind == "type 1" or (x.kind == "passive" and set(x.joints) <= slides))
            and (x.equation is not None or len(x.matrix) == len(x.matrix[0]))
        ]

    def keep_turn(self, starts: Sequence[Array]) -> bool:
        """Demand the rotation of the starts from now on, if poses around them have it.

        An output that keeps its axes over an open set of positions does so in all of that mode,
        beyond constraint singularities too, where it could turn instead and pass into another mode.
        With its turn fixed these are no singular points of the equations.
        """
        if set(self.targets_rows) & {3, 4, 5}:
            return False
        around = 1e-3 * self.extent * np.array([[1.0, 0.3], [-0.3, 1.0], [-1.0, -0.7]])
        first, second = (np.tile(self.start(k) + around[:, k], len(starts)) for k in (0, 1))
        R, p = self.targets(first, second)
        Q, error = newton(
            self.loops,
            np.repeat(np.array(starts), len(around), axis=0),
            self.free,
            target=(R, p, self.targets_rows),
        )
        turned = np.abs(self.loops.output(Q)[0] - np.array(self.place.rotation)).max()
        kept = bool(error.max() <= ROUNDING and turned <= 1e-9)
        if kept:
            self.targets_rows = (*self.targets_rows, 3, 4, 5)
        return kept

    def start(self, k: int) -> float:
        """Value of a coordinate (0 or 1) at the start."""
        at = np.array([*self.place.translation, *self.angles])[self.rows[k]]
        turned = self.rows[k] > 2 and self.turn["kind"] == "axis"
        return float(self.turn["at"] if turned else at)

    def side(self, k: int, samples: int, times: float) -> Array:
        """Values of a coordinate: a whole turn, or about as far as the linkage is large."""
        if self.rows[k] > 2:
            return self._turn(k, samples)
        size = times * self.extent
        return self.start(k) + np.linspace(-size, size, samples)

    def _turn(self, k: int, samples: int) -> Array:
        # Where yaw follows, pitch beyond a quarter of a turn is a pose that has been before.
        tied = self.rows[k] == 4 and self.turn["kind"] == "angles"
        most = np.radians(89.5) if tied else np.pi
        return np.linspace(-most, most, samples)

    def cropped(self, k: int, side: Array, there: ArrayLike, samples: int) -> Array:
        """From a little before the first value that is reached to a little after the last."""
        if self.rows[k] > 2:
            return self._turn(k, samples)
        places = np.flatnonzero(there)
        if not len(places):
            return np.linspace(side[0], side[-1], samples)
        step = float(side[1] - side[0])
        low, high = float(side[places[0]]) - 1.5 * step, float(side[places[-1]]) + 1.5 * step
        return np.linspace(low, high, samples)

    def targets(self, first: Array, second: Array) -> tuple[Array, Array]:
        """Rotations (N, 3, 3) and positions (N, 3) where the coordinates have these values."""
        count = len(first)
        p = np.repeat(np.array(self.place.translation)[None], count, axis=0)
        angles = np.repeat(self.angles[None], count, axis=0)
        R = np.repeat(np.array(self.place.rotation)[None], count, axis=0)
        for row, value in zip(self.rows, (first, second), strict=True):
            if row < 3:
                p[:, row] = value
            elif self.turn["kind"] == "axis":
                turns = np.multiply.outer(value - self.turn["at"], np.eye(3)[row - 3])
                R = np.array([pin.exp3(v) for v in turns]) @ np.array(self.turn["zero"])
            else:
                angles[:, row - 3] = value
                R = np.array([pin.rpy.rpyToMatrix(*a) for a in angles])
        return R, p

    def signs(self, Q: Array) -> Array:
        """Return signs (N, k) that the configurations of one working mode have."""
        # Of the type 1 equations, and of the lengths of legs: beyond zero a leg is turned round.
        values = [locus.value(Q, self.mechanism.joints) for locus in self.ones]
        return np.sign(np.stack(values, axis=1)) if values else np.zeros((len(Q), 0))


COARSE = 41
_SIZE = 1.3
_WIDER = 3


@dataclass(frozen=True, eq=False)
class PoseSlice:
    """A slice through the workspace."""

    names: tuple[str, str]  # the two coordinates
    # x and y: (nx,): their values, metres and radians
    x: Array
    y: Array
    # (modes, ny, nx, n): configurations that close the loops; NaN where none was found in that
    # working mode
    q: Array
    # (modes, ny, nx) of bool: where they are within all limits of joints, active and passive
    inside: Bool
    # (modes, ny, nx): how far the joint that is nearest to a limit is inside; NaN as q, infinite
    # without limits
    margin: Array


def pose_slice(
    mechanism: Mechanism, over: Sequence[str], starts: Sequence[Array], samples: int = 161
) -> PoseSlice:
    """Follow working modes over two coordinates of the pose; the others stay as at the start."""
    # ``starts`` are closed (n,), one of each mode, all at the same pose of the output.
    way = PoseWay(mechanism, over, starts[0])
    way.keep_turn(starts)
    size = [_SIZE, _SIZE]
    for _ in range(_WIDER):
        side = [way.side(k, COARSE, size[k]) for k in (0, 1)]
        coarse = _Grid(way, side[0], side[1], len(starts))
        coarse.begin(starts)
        coarse.flood(2 * COARSE)
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
        # What is thinner than a cell of the coarse grid may go on where it meets the border.
        reached, more = np.asarray(inside.any(axis=0)), False
        for k, line in enumerate(fine):
            ends = np.asarray(np.take(reached, (0, -1), axis=1 - k).any(axis=k))
            if way.rows[k] < 3 and ends.any():
                low, high, more = float(line[0]), float(line[-1]), True
                room = 0.15 * (high - low) * ends
                fine[k] = np.linspace(low - room[0], high + room[1], len(line))
        if not more:
            break
    names = (COORDINATES[way.rows[0]], COORDINATES[way.rows[1]])
    return PoseSlice(names, grid.sides[0], grid.sides[1], grid.q, inside, margin)


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
        self._take(np.array([(k, j, i) for k in range(self.modes)]), np.array(starts), far=np.inf)

    def follow(self, coarse: _Grid) -> None:
        """Every cell from the nearest one of a coarser grid."""
        self.marks = coarse.marks
        sides = zip(self.sides, coarse.sides, strict=True)
        places = (np.rint((fine - rough[0]) / (rough[1] - rough[0])) for fine, rough in sides)
        i, j = (np.clip(x, 0, COARSE - 1).astype(int) for x in places)
        self._spread(coarse, coarse.solved, np.ix_(range(self.modes), j, i), 2)
        self.tried[:] = 0

    def flood(self, layers: int) -> None:
        """Go on from what is solved to its neighbours."""
        for _ in range(layers):
            # Cells that were tried in vain may be reached from another neighbour.
            fresh, self.fresh = self.fresh, np.zeros_like(self.fresh)
            self._spread(self, fresh, ..., 1)

    def _spread(self, other: _Grid, there: Bool, places: Any, most: float) -> None:
        """Try the cells at ``places`` of a grid that are near to those that are ``there`` in it."""
        from scipy.ndimage import distance_transform_edt

        if there.any():
            # Modes are far from each other.
            away, near = distance_transform_edt(~there, (1e9, 1, 1), return_indices=True)
            chosen = (away[places] <= most) & ~self.solved & (self.tried < 3)
            self.tried[chosen] += 1
            begin = other.q[tuple(x[places][chosen] for x in near)]
            self._take(np.argwhere(chosen), begin)

    def scatter(self) -> None:
        """Seek the same modes at poses that no way of neighbours has led to."""
        way = self.way
        rng = np.random.default_rng(1201)
        for k in range(self.modes):
            left = np.argwhere(~self.solved[k])
            cells = np.insert(left[rng.permutation(len(left))[:120]], 0, k, axis=1)
            drawn = way.mechanism.space.sample(len(cells), rng)
            self._take(cells, drawn, far=np.inf, within=True)
        self.fresh = self.solved.copy()
        self.tried[:] = 0
        self.flood(2 * COARSE)

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

    def _take(self, cells: Any, begin: Array, far: float = 1.0, within: bool = False) -> None:
        """Solve cells (N, 3) from configurations (N, n), and keep what is of the same mode."""
        way = self.way
        x, y = self.sides
        block = 4096  # cells that are treated at a time
        for k in range(0, len(cells), block):
            here, Q0 = cells[k : k + block], begin[k : k + block]
            R, p = way.targets(x[here[:, 2]], y[here[:, 1]])
            steps = 10 if np.isfinite(far) else 30
            Q, error = newton(way.loops, Q0, way.free, None, (R, p, way.targets_rows), steps)
            ok = error <= ROUNDING
            if np.isfinite(far):
                gap = np.abs(way.mechanism.space.wrap(Q - Q0)) / way.mechanism.space.metric
                ok &= gap.max(axis=1) <= far
            if within:
                ok &= ~way.mechanism.space.unreachable(Q).any(axis=1)
            ok[ok] &= (way.signs(Q[ok]) * np.array(self.marks)[here[ok, 0]] >= 0).all(axis=1)
            at = tuple(here[ok].T)
            self.q[at] = Q[ok]
            self.solved[at] = self.fresh[at] = True
