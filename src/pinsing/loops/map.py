"""Maps of mechanisms: over two coordinates of the output's pose, and at random inputs or poses.

Over two coordinates the others are as they are at a start, and each working mode is followed.

At random inputs the loops may be unable to close, which distances prove where Newton only finds
nothing. Two legs that pass forces along C B and C' B' make a quadrilateral C B B' C'. Whatever the
pose of the output, B B' is a length of its own; the inputs tell C C', and C B and C' B' are the
lengths of the rods. Where one of the four is longer than the three others together, nothing closes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from pinsing.errors import OptionError
from pinsing.interface import MAX_STARTS, JsonResult, checked
from pinsing.loops.analysis import independent_inputs
from pinsing.loops.closure import (
    BatchLoops,
    extent,
    near_home,
    newton,
    output_pose,
    random_closed,
    ranks,
)
from pinsing.loops.joint_loci import joint_forms
from pinsing.loops.legs import rods
from pinsing.loops.motion import (
    COORDINATES,
    Pose,
    aligned,
    closed_from_random,
    home,
    kinds_of,
    led_pose,
    measure_many,
    mode_of,
    pose_of,
    pose_table,
)
from pinsing.measures import NEAR_RTOL, ROUNDING, SINGULAR_RTOL, Array, Bool
from pinsing.prose import PLAIN, Page
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
        turned = pin.rpy.matrixToRpy(np.array(self.place.rotation))
        self.pose = np.concatenate([self.place.translation, turned])
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
        turned = self.rows[k] > 2 and self.turn["kind"] == "axis"
        return float(self.turn["at"] if turned else self.pose[self.rows[k]])

    def line(self, k: int, low: float, high: float, samples: int) -> Array:
        """Values of a coordinate: from one to another, or a whole turn of one that turns."""
        if self.rows[k] > 2:
            # Where yaw follows, pitch beyond a quarter of a turn is a pose that has been before.
            tied = self.rows[k] == 4 and self.turn["kind"] == "angles"
            high = np.radians(89.5) if tied else np.pi
            low = -high
        return np.linspace(low, high, samples)

    def targets(self, first: Array, second: Array) -> tuple[Array, Array]:
        """Rotations (N, 3, 3) and positions (N, 3) where the coordinates have these values."""
        pose = np.tile(self.pose, (len(first), 1))
        for row, value in zip(self.rows, (first, second), strict=True):
            pose[:, row] = value
        R = np.tile(np.array(self.place.rotation), (len(first), 1, 1))
        if max(self.rows) > 2 and self.turn["kind"] == "axis":
            row = max(self.rows)
            turns = np.multiply.outer(pose[:, row] - self.turn["at"], np.eye(3)[row - 3])
            R = np.array([pin.exp3(v) for v in turns]) @ np.array(self.turn["zero"])
        elif max(self.rows) > 2:
            R = np.array([pin.rpy.rpyToMatrix(*angles) for angles in pose[:, 3:]])
        return R, pose[:, :3]

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
    middle, size = (way.start(0), way.start(1)), [_SIZE * way.extent] * 2
    for _ in range(_WIDER):
        rough = [way.line(k, middle[k] - size[k], middle[k] + size[k], COARSE) for k in (0, 1)]
        coarse = _Grid(way, rough[0], rough[1], len(starts))
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
    fine = []
    for k, line in enumerate(rough):  # axis 0 of the mask is y
        places = np.flatnonzero(found.any(axis=k))
        low, high, room = line[0], line[-1], 1.5 * (line[1] - line[0])
        if len(places):
            low, high = line[places[0]] - room, line[places[-1]] + room
        fine.append(way.line(k, low, high, samples))
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


def cannot_close(mechanism: Mechanism, inputs: Array) -> Bool:
    """Return which inputs (N, n_a) leave the loops open, by the inequality of four distances."""
    # Proven, with 1e-9 to spare for rounding; those not returned may close or not. Only for `rods`.
    out = np.zeros(len(inputs), dtype=bool)
    found = rods(mechanism)
    if found is None:
        return out
    values = dict(zip(mechanism.actuated, inputs.T, strict=True))
    # Driven at the foot or at the elbow C B has another length, that is not among the inputs.
    lengths = ((rod, rod.distance(values[rod.joint], found.length(rod))) for rod in found.rods)
    known = [
        (found.flattened(rod.foot(values[rod.joint])), found.flattened(rod.outer), x)
        for rod, x in lengths
        if x is not None
    ]
    for (C, B, length), (D, E, other) in itertools.combinations(known, 2):
        between = np.full(len(inputs), np.linalg.norm(B - E))
        sides = np.stack([np.linalg.norm(C - D, axis=-1), between, length, other])
        longest = sides.max(axis=0)
        # What is too long by less than this may be rounding.
        out |= 2 * longest - sides.sum(axis=0) > 1e-9 * longest
    return out


TRIES = 4
_STEPS = 30


def draw_closed(
    loops: BatchLoops,
    actuated: list[int],
    over: str,
    count: int,
    rng: np.random.Generator,
    known: Array,
) -> tuple[Array, int]:
    """Return closed configurations (M, n) of those drawn, and how many cannot close."""
    # Over inputs ``actuated`` are drawn; ``known`` (N, n), from `known_closed`, are starts near by,
    # and the box and orientations of poses.
    mechanism, scale, target = loops.mechanism, loops.mechanism.length_scale, None
    free, left = np.ones(mechanism.n, dtype=bool), np.arange(count)
    if over == "inputs":
        low, high = (x[actuated] for x in mechanism.space.span)
        free[actuated] = False
        held = rng.uniform(low, high, (count, len(actuated)))
        have, want = (x / loops.units[actuated] for x in (known[:, actuated], held))
        # Of redundant actuators some follow from the others: nothing is proven by these alone.
        if tuple(actuated) == tuple(mechanism.actuated):
            left = np.flatnonzero(~cannot_close(mechanism, held))
    else:
        R, p, _ = loops.output(known)
        chosen = rng.integers(len(known), size=count)
        target = R[chosen], rng.uniform(p.min(axis=0), p.max(axis=0), (count, 3))
        have, want = (
            np.concatenate([at / scale, turn.reshape(-1, 9)], axis=1)
            for turn, at in ((R, p), target)
        )
    impossible = count - len(left)
    out, kept = np.zeros((count, mechanism.n)), np.zeros(count, dtype=bool)
    for k in range(TRIES):
        # From home first, so that most are in its mode; then from near by; then from anywhere.
        if k > 1:
            # Drawn for all, so that a start does not depend on what others came to.
            Q = mechanism.space.sample(count, rng)[left]
        elif k and len(known):
            Q = known[((have**2).sum(axis=1) - 2 * want[left] @ have.T).argmin(axis=1)]
        else:
            Q = np.tile(home(mechanism), (len(left), 1))
        if over == "inputs":
            Q[:, actuated] = held[left]
        here = target and (target[0][left], target[1][left], mechanism.task.rows)
        Q, size = newton(loops, Q, free, target=here, steps=_STEPS)
        done = size <= ROUNDING
        Q = mechanism.space.fold(Q)
        # One beyond a limit is kept until it is found within it another way.
        out[left[done]], kept[left[done]] = Q[done], True
        left = left[~done | mechanism.space.unreachable(Q).any(axis=1)]
    return out[kept], impossible


def known_closed(loops: BatchLoops) -> Array:
    """Closed configurations (N, n) from random starts; within the limits where enough are."""
    mechanism = loops.mechanism
    rng, everything = np.random.default_rng(64), np.ones(mechanism.n, dtype=bool)
    Q = closed_from_random(loops, mechanism.home, everything, 512, rng, steps=_STEPS)
    Q = mechanism.space.fold(Q)
    if not len(Q):
        # Starts within narrow limits lead nowhere; those that told the ranks did.
        spare = random_closed(mechanism, 64, rng) + near_home(mechanism)
        Q = mechanism.space.fold(np.array(spare).reshape(-1, mechanism.n))
    inside = Q[~mechanism.space.unreachable(Q).any(axis=1)]
    return inside if len(inside) >= 8 else Q


OVER = ("inputs", "poses")
_CHUNK = 2048
_QUANTILES = (0.0, 0.01, 0.1, 0.5, 0.9, 1.0)
_KINDS = ("regular", "near", "type 1", "type 2", "type 3", "constraint")
_NEAR = ("type 1", "type 2", "constraint")


@dataclass(frozen=True, eq=False)
class WorstConfiguration:
    """One of the configurations of smallest measure.

    Attributes
    ----------
    measure : float
        The least of the three.
    kind : str
        ``regular``, ``near``, ``type 1``, ``type 2``, ``type 3`` or ``constraint``.
    q : (n,) array
        All joints, radians and metres.
    inputs : (n_a,) array
        The actuated ones.
    pose : Pose
        Of the output.
    mode : str
        Assembly and working mode.
    """

    measure: float
    kind: str
    q: Array
    inputs: Array
    pose: Pose
    mode: str


@dataclass(frozen=True, eq=False)
class MechanismMap(JsonResult):
    """What a map over a mechanism has found.

    Attributes
    ----------
    name : str
        Name of the mechanism.
    over : str
        ``inputs`` or ``poses``: what was drawn at random.
    count, seed, tries : int
        How many were drawn, with which seed, and from how many starts each was to close: home,
        the closed configuration that is nearest (of some known beforehand), then random ones.
    closed : int
        How many closed the loops.
    impossible : int
        At how many of the others the loops cannot close, by distances (proven); at what is left
        none of the starts closed them.
    thin : bool
        Whether all configurations known beforehand are of type 2: inputs that close the loops are
        then a set without volume, which random ones do not meet.
    beyond : int
        How many of the closed are beyond a limit of a joint; they are left out below.
    kinds : dict of str to int
        How many of the others are regular, near-singular, type 1, type 2, type 3, constraint.
    near : dict of str to int
        For ``type 1``, ``type 2`` and ``constraint``, at how many of them that measure is at most
        0.01: singular or near it. One configuration may count for several.
    quantiles : tuple of float
        Shares at which the measures are given.
    output_ratio, input_ratio, constraint_ratio : (len(quantiles),) arrays
        The measures of type 1, type 2 and constraint there.
    worst : tuple of WorstConfiguration
        Smallest measure first.
    """

    schema: ClassVar[str] = "pinsing/mechanism-map/2"
    made_by: ClassVar[str] = "pinsing.loops.mechanism_map(mechanism)"

    name: str
    over: str
    count: int
    seed: int
    tries: int
    closed: int
    impossible: int
    thin: bool
    beyond: int
    kinds: dict[str, int]
    near: dict[str, int]
    quantiles: tuple[float, ...]
    output_ratio: Array
    input_ratio: Array
    constraint_ratio: Array
    worst: tuple[WorstConfiguration, ...]

    def __str__(self) -> str:
        return map_text(self)


def map_text(found: MechanismMap, page: Page = PLAIN, degrees: bool = False) -> str:
    """A map as text for people."""
    what = "inputs" if found.over == "inputs" else "poses of the output"
    kept = found.closed - found.beyond
    lines = [
        page.paragraph(
            f"{found.name}: {found.count} {what} drawn at random (seed {found.seed}); the loops "
            f"closed at {found.closed} of them ({100 * found.closed / found.count:.3g} %), "
            f"{found.beyond} of these beyond the limits of joints"
        ),
        *(page.paragraph(x, first="  ", rest="    ") for x in _open(found)),
        page.paragraph(
            f"of the {kept} within: "
            + ", ".join(f"{n} {k}" for k, n in found.kinds.items() if n or k == "regular"),
            first="  ",
            rest="    ",
        ),
    ]
    if kept:
        shares = (f"{k} {n} ({100 * n / kept:.3g} %)" for k, n in found.near.items())
        near = f"singular or near (measure at most {NEAR_RTOL:g}): {', '.join(shares)}"
        told = zip(found.output_ratio, found.input_ratio, found.constraint_ratio, strict=True)
        rows = [
            (f"{100 * p:g} %", *(f"{x:.3g}" for x in measures))
            for p, measures in zip(found.quantiles, told, strict=True)
        ]
        table = aligned(("share", "type 1", "type 2", "constraint"), rows, 4)
        lines.append(page.paragraph(near, first="  ", rest="    "))
        lines += ["", *(f"  {line}" for line in table), "", "smallest measures:"]
        lines += [
            "  " + line.replace("\u00a0", " ")  # these lines are not broken
            for line in pose_table(
                [w.pose for w in found.worst],
                [(f"{w.measure:.3g}", w.kind) for w in found.worst],
                ("measure", "kind"),
                degrees,
                page.width - 4,
            )
        ]
    return "\n".join(lines)


def _open(found: MechanismMap) -> Iterator[str]:
    """Why the loops did not close at the others."""
    rest = found.count - found.closed - found.impossible
    if found.impossible:
        yield (
            f"at {found.impossible} they cannot: the ends of two legs would be too far apart or "
            "too near to each other (proven, by four distances)"
        )
    if rest:
        yield (
            f"at {rest} {'others ' if found.impossible else ''}none of {found.tries} starts (home, "
            f"the nearest closed configuration known, {found.tries - 2} random ones) closed them: "
            "whether they close another way is not known"
        )
    if found.thin and found.over == "inputs":
        yield (
            "every closed configuration that was looked at is of type 2: inputs that close the "
            "loops are a set without volume, which random ones do not meet; --over poses shows them"
        )


@checked
def mechanism_map(
    mechanism: Mechanism,
    over: str = "inputs",
    count: int = 10_000,
    seed: int = 0,
    *,
    worst: int = 5,
    ignore_limits: bool = False,
) -> MechanismMap:
    """Map how near to singular a mechanism is, at random inputs or poses of the output.

    Inputs are drawn evenly within their limits; positions evenly in the box that holds those of
    closed configurations known beforehand (from random starts, within the limits where enough are),
    orientations from these. The loops are closed from home, else from the nearest of those, else
    from random starts, thousands at once, and all constraint Jacobians are taken apart together.
    Inputs that cannot close the loops, by the distances between legs, are counted and not tried.

    Parameters
    ----------
    mechanism : Mechanism
        From ``load_mechanism``.
    over : str
        ``inputs`` or ``poses``.
    count : int
        How many to draw.
    seed : int
        The same seed gives the same map.
    worst : int
        How many of the smallest measures to keep.
    ignore_limits : bool
        Let all joints, active and passive, go beyond their limits.

    Returns
    -------
    MechanismMap
        With ``str()``: a table.

    Raises
    ------
    OptionError
        If ``over`` is neither, a number is below 1, or a pose leaves a freedom open.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.loops.mechanism_map(pinsing.load_mechanism("planar_3rrr"), count=200)
    >>> found.closed <= 200, sorted(found.kinds)[0]
    (True, 'constraint')
    """
    OptionError.refuse_if(
        over not in OVER, f"a map of a mechanism goes over inputs or poses, not {over!r}"
    )
    for name, value in (("count", count), ("worst", worst)):
        OptionError.refuse_if(value < 1, f"{name} must be 1 or more, got {value}")
    OptionError.refuse_if(
        count > MAX_STARTS, f"count must be at most {MAX_STARTS}, got {count}: take several seeds"
    )
    OptionError.refuse_if(seed < 0, f"seed must be 0 or more, got {seed}")
    if ignore_limits:
        mechanism = mechanism.without_limits()
    generic = ranks(mechanism)
    OptionError.refuse_if(
        over == "poses" and generic.output < generic.mobility,
        f"{mechanism.name} has {generic.mobility} degrees of freedom, but its output shows "
        f"{generic.output}: a pose leaves the others open; take a map over inputs",
    )
    loops = BatchLoops(mechanism)
    # Of more actuators than freedoms those that are independent are drawn; the others follow.
    driven = list(independent_inputs(mechanism, generic, home(mechanism)).actuated)
    known = known_closed(loops)
    thin = bool(len(known)) and bool((measure_many(loops, known)[1] <= SINGULAR_RTOL).all())
    closed = impossible = 0
    parts = [np.zeros((3, 0))]
    least: list[tuple[float, int, Array, Array]] = []
    for k, start in enumerate(range(0, count, _CHUNK)):
        rng = np.random.default_rng([seed, k])
        Q, ruled_out = draw_closed(loops, driven, over, min(_CHUNK, count - start), rng, known)
        closed += len(Q)
        impossible += ruled_out
        Q = Q[~mechanism.space.unreachable(Q).any(axis=1)]
        if len(Q):
            found = measure_many(loops, Q)
            parts.append(found)
            low = found.min(axis=0)
            lowest = np.argsort(low, kind="stable")[:worst].tolist()
            least += [(float(low[i]), start + i, found[:, [i]], Q[i]) for i in lowest]
            least = sorted(least, key=lambda x: x[:2])[:worst]
    every = np.concatenate(parts, axis=1)
    names, kept = kinds_of(every), every.shape[1]
    kinds = {kind: int((names == kind).sum()) for kind in _KINDS}
    near = dict(zip(_NEAR, (every <= NEAR_RTOL).sum(axis=1).tolist(), strict=True))
    told = np.full((len(_QUANTILES), 3), math.nan)
    if kept:
        told = np.quantile(every, _QUANTILES, axis=1, method="inverted_cdf")
    listed = tuple(
        WorstConfiguration(
            low, str(kinds_of(at)[0]), q, q[list(mechanism.actuated)],
            pose_of(output_pose(mechanism, q)), mode_of(mechanism, q),
        )
        for low, _, at, q in least
    )  # fmt: skip
    return MechanismMap(
        mechanism.name, over, count, seed, TRIES, closed, impossible, thin, closed - kept, kinds,
        near, _QUANTILES, told[:, 0], told[:, 1], told[:, 2], listed,
    )  # fmt: skip
