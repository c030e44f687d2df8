"""Motions that a configuration cannot produce, wrenches that it carries for free, and why.

A wrench w with J^T w = 0 needs no joint torque, and no motion of the tip has power against it:
that is what is lost. A pure force through the tip takes a translation away, a pure moment a
rotation, a force off the tip the motion of a line along itself, any other wrench the motion on
a screw (J. K. Davidson and K. H. Hunt, "Robots and Screw Theory", 2004).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np

from pinsing._batch import engine as kernel
from pinsing.kinematics.jacobian import (
    PINOCCHIO,
    SINGULAR_RTOL,
    Batch,
    generic_rank,
    generic_task,
    random_turns,
    scale_rows,
    zero_of,
)
from pinsing.measures import PRACTICAL, Array, Bool, NDArray
from pinsing.prose import listed
from pinsing.robot.arm import Arm, kept
from pinsing.robot.task import TOOL_AXES


def cross(a: Array, b: Array) -> Array:
    """Vector product of a (3,) and b (3,)."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def length(a: Array) -> float:
    """Euclidean norm of a (k,)."""
    return math.sqrt(float(a @ a))


STRUCTURE_TOL = 2e-5
"""Radians, and share of the arm's size: parallel or meeting within what files round angles to."""


@dataclass(frozen=True, eq=False)
class JointAxes:
    """Joint axes at one configuration, base axes, metres."""

    direction: Array  # (n, 3), unit
    point: Array  # (n, 3), the point of each turning axis nearest to the tip
    prismatic: Bool  # (n,), those have a direction only
    tip: Array  # (3,)
    size: float  # greatest distance of an axis from the tip, 1 without any

    @classmethod
    def each(cls, J: Array, prismatic: Bool, tip: Array) -> list[JointAxes]:
        """Axes from frame Jacobians (N, 6, n): columns (z x (tip - p), z), or (z, 0)."""
        v, w = J[:, :3].swapaxes(1, 2), J[:, 3:].swapaxes(1, 2)
        directions = np.where(prismatic[:, None], v, w)
        arms = np.where(prismatic[:, None], 0.0, np.cross(v, w))  # from the axis to the tip
        sizes = np.linalg.norm(arms, axis=2).max(axis=1, initial=0.0)
        return [
            cls(direction, tip - arm, prismatic, tip, float(size) or 1.0)
            for direction, arm, size in zip(directions, arms, sizes, strict=True)
        ]

    def parallel(self, ids: Sequence[int], tol: float) -> bool:
        """Return True if all these axes have one direction, up to sign."""
        first = self.direction[ids[0]]
        return all(length(cross(first, self.direction[i])) <= tol for i in ids[1:])

    def pass_through(self, ids: Sequence[int], point: Array, tol: float) -> bool:
        """Return True if all these turning axes pass through a point (3,)."""
        far = tol * self.size
        return all(length(cross(self.direction[i], point - self.point[i])) <= far for i in ids)

    def meeting_point(self, ids: Sequence[int], tol: float) -> Array | None:
        """Return the point (3,) that all these turning axes pass through, if there is one."""
        z, p = self.direction[list(ids)], self.point[list(ids)] - self.tip
        # The normal equations of least squares: the sum of (1 - z z^T)(x - p) is zero.
        values, V = np.linalg.eigh(len(z) * np.eye(3) - z.T @ z)
        if values[0] <= (10 * tol) ** 2:  # nearly parallel
            return None
        across = p - (p * z).sum(axis=1, keepdims=True) * z
        point = self.tip + V @ (V.T @ across.sum(axis=0) / values)
        return point if self.pass_through(ids, point, tol) else None

    def in_one_plane(self, ids: Sequence[int], tol: float, *points: Array) -> bool:
        """Return True if these turning axes, and the given points (3,), lie in one plane."""
        apart = np.array([*self.point[list(ids)], *points]) - self.point[ids[0]]
        spanned = np.concatenate([self.direction[list(ids)], apart / self.size])
        return bool(np.linalg.svd(spanned, compute_uv=False)[2] <= tol)

    def twists(self, ids: Sequence[int], point: Array) -> Array:
        """Twists (k, 6) of these joints at a point (3,), base axes, metres over the size."""
        z, slides = self.direction[list(ids)], self.prismatic[list(ids), None]
        arms = (point - self.point[list(ids)]) / self.size
        # np.cross takes three times as long for so few rows.
        moved = np.array([cross(*pair) for pair in zip(z, arms, strict=True)]).reshape(-1, 3)
        return np.concatenate([np.where(slides, z, moved), np.where(slides, 0.0, z)], axis=1)

    def velocity_rank(self, ids: Sequence[int], point: Array, tol: float) -> int:
        """Dimension of the velocities that these joints give to a point (3,)."""
        rows = self.twists(ids, point)[:, :3]
        return int((np.linalg.svd(rows, compute_uv=False) > tol).sum())


@dataclass(frozen=True)
class AxesCentre:
    """Three turning axes in a row (``ids``) that meet in one point at every configuration."""

    ids: tuple[int, ...]
    short: str  # ``wrist centre``, ``shoulder centre``, or empty for one in the middle

    def named(self) -> str:
        """``the wrist centre (where axes 4, 5 and 6 meet)``."""
        meet = f"where axes {numbers(self.ids)} meet"
        return f"the {self.short} ({meet})" if self.short else f"the point {meet}"


def numbers(ids: Sequence[int]) -> str:
    """Joint numbers, counted from 1: ``1``, ``1 and 2``, ``1, 2 and 3``."""
    return listed([str(i + 1) for i in ids])


def joints_of(ids: Sequence[int]) -> str:
    """``joint 1`` or ``joints 1 and 2``."""
    return f"joint{'s' * (len(ids) > 1)} {numbers(ids)}"


def _are(what: str, ids: Sequence[int], one: str = "is", many: str = "are") -> str:
    """``axis 1 is``, ``prismatic joints 3 and 4 are``."""
    if len(ids) == 1:
        return f"{what} {numbers(ids)} {one}"
    return f"{'axes' if what == 'axis' else what + 's'} {numbers(ids)} {many}"


ALIGNED = math.radians(0.1)
"""Radians; a direction this close to an axis of the tool or the base goes by that axis."""

_SAID = {
    "translation": ("translate", "translation", "along", "a force along it"),
    "rotation": ("rotate", "rotation", "about", "a moment about it"),
    "line": ("move", "motion", "along the line", "a force along it"),
    "screw": (
        "move", "motion", "on the screw of pitch {:.3g} m/rad about the line", "a wrench on it"
    ),
}  # fmt: skip
"""Of each kind of lost motion: verb, noun, way, and the wrench that needs no joint torque."""


@dataclass(frozen=True, eq=False)
class LostMotion:
    """One independent motion that cannot be produced.

    Attributes
    ----------
    kind : str
        ``translation``, ``rotation``, ``line`` or ``screw``.
    direction : (3,) array
        Unit vector, base axes.
    point : (3,) array
        A point of the line or screw axis, metres, in the base; for the others the tip.
    pitch : float
        Of the screw, metres per radian; 0 for a line and a translation, infinite for a rotation.
    wrench : (6,) array
        Force (N) and moment about the tip (N m), base axes, that needs no joint torque. The
        force has length 1, or the moment where there is no force.
    twist : (6,) array
        Tip velocity (m/s) and angular velocity (rad/s), base axes, that is perpendicular to all
        producible ones, translations measured in units of the length scale.
    speed : float
        What is left of the motion at unit joint speed: the greatest power against the wrench,
        in m/s, or in rad/s for a rotation; zero up to rounding where it is truly lost.
    words : str
        What cannot be done.
    """

    kind: str
    direction: Array
    point: Array
    pitch: float
    wrench: Array
    twist: Array
    speed: float
    words: str

    @property
    def free_wrench(self) -> str:
        """Wrench that needs no joint torque, in words that follow those of the motion."""
        return _SAID[self.kind][3]

    def __str__(self) -> str:
        return self.words


@dataclass(frozen=True, eq=False)
class Tool:
    """Where the tip is, for words."""

    position: Array  # (3,), metres, in the base
    rotation: Array  # (3, 3), columns are the tool axes, in base axes
    size: float  # length that a lever arm is small against, metres
    landmarks: Mapping[str, Array]  # points worth a name, such as the wrist centre


def lost_motions(
    U: Array,
    J: Array,
    own_length: float,
    length_scale: float,
    tool: Tool,
    tol: float = PRACTICAL,
    hardly: bool = False,
) -> tuple[LostMotion, ...]:
    """Describe a space of lost motions by translations, rotations, lines and screws.

    ``U`` (6, d) is an orthonormal basis, translations over ``own_length``; twists are over
    ``length_scale`` (metres). ``tol``: the share of a wrench that "pure" neglects. ``hardly``: say
    "nearly loses", with the speed that is left, in place of "cannot".
    """
    forces, moments = U[:3], U[3:]
    # Coefficients of the wrenches in U without moment, and of those without force.
    no_moment, no_force = _null_space(moments, tol), _null_space(forces, tol)
    mixed = U @ _null_space(np.concatenate([no_moment, no_force], axis=1).T, 1e-6)
    pure = []
    for rows, directions in (
        (slice(0, 3), forces @ no_moment),
        (slice(3, 6), moments @ no_force),
    ):
        for direction in nice_basis(directions, tool.rotation):
            if hardly:
                # What is left is a semi-axis of the tip's ellipsoid, told with the same number.
                axes = np.linalg.svd(J[rows])[0].T
                near = axes[np.argmax(np.abs(axes @ direction))]
                direction = near if length(cross(near, direction)) <= tol else direction
            u = np.zeros(6)
            u[rows] = direction
            pure.append(u)
    own, scale = np.repeat([[own_length, 1.0], [length_scale, 1.0]], 3, axis=1)
    found = []
    for u in (*pure, *mixed.T):
        wrench, point, pitch = u / own, np.array(tool.position), 0.0
        if length(u[:3]) <= tol:
            wrench /= length(wrench[3:])
            kind, direction, pitch = "rotation", wrench[3:], math.inf
        else:
            wrench /= length(wrench[:3])
            kind, direction = "translation", wrench[:3]
            turn, lever = float(direction @ wrench[3:]), cross(direction, wrench[3:])
            if length(lever) > tol * tool.size:
                kind, point = "line", point + lever
            if abs(turn) > tol * tool.size:
                kind, pitch = "screw", turn
        # Of d and -d, the one whose largest component is positive.
        direction = direction * np.sign(direction[np.argmax(np.abs(direction).round(9))])
        verb, noun, way, _ = _SAID[kind]
        if kind in ("line", "screw"):
            axis = _line_words(direction, point, tool, tol)
        else:
            axis = axis_name(direction, tool.rotation)
        where = f"{way.format(pitch)} {axis}"
        speed = float(np.linalg.norm(J.T @ wrench))
        words = f"cannot {verb} {where}"
        if hardly:
            unit = "rad/s" if kind == "rotation" else "m/s"
            left = f"({speed:.4g} {unit} at unit joint speed)"
            words = f"nearly loses {noun} {where} {left}"
        twist = scale**2 * wrench / np.linalg.norm(scale * wrench)
        found.append(LostMotion(kind, direction, point, pitch, wrench, twist, speed, words))
    return tuple(found)


def _null_space(A: Array, tol: float) -> Array:
    """Orthonormal coefficients (d, k) of combinations of the columns of A (m, d) that vanish."""
    _, sigma, Vt = np.linalg.svd(A)
    return np.asarray(Vt[int((sigma > tol).sum()) :].T)


def nice_basis(span: Array, rotation: Array) -> list[Array]:
    """Basis of the space of the columns of ``span`` (3, k): tool axes, base axes, then any."""
    if span.shape[1] == 0:
        return []
    left, sigma, _ = np.linalg.svd(span, full_matrices=False)
    inside = left[:, sigma > 0.5 * sigma[0]]
    chosen: list[Array] = []
    for axis in (*rotation.T, *np.eye(3), *inside.T):
        inner = inside @ (inside.T @ axis)
        rest = inner.copy()
        for other in chosen:
            rest -= (rest @ other) * other
        if np.linalg.norm(axis - inner) <= ALIGNED and np.linalg.norm(rest) >= 0.1:
            chosen.append(rest / np.linalg.norm(rest))
    return chosen


def axis_name(direction: Array, rotation: Array) -> str:
    """``tool x``, ``base z``, both, or the components in tool axes."""
    tool = _aligned(rotation.T @ direction)
    base = _aligned(direction)
    if tool and base:
        return f"tool {tool} (base {base})"
    if tool or base:
        return f"tool {tool}" if tool else f"base {base}"
    return f"{vector(rotation.T @ direction)} of the tool"


def _aligned(direction: Array) -> str:
    k = int(np.argmax(np.abs(direction)))
    return "xyz"[k] if float(np.linalg.norm(np.delete(direction, k))) <= math.sin(ALIGNED) else ""


def vector(components: Array, digits: int = 3) -> str:
    """``(0.707, 0, -0.707)``."""
    return "(" + ", ".join(f"{x:.{digits}f}" for x in np.round(components, digits) + 0.0) + ")"


def _line_words(direction: Array, point: Array, tool: Tool, tol: float) -> str:
    on_it = [
        name
        for name, place in tool.landmarks.items()
        if length(cross(direction, place - point)) <= 10 * tol * tool.size
    ]
    if len(on_it) > 1:
        return "through " + " and ".join(on_it[:2])
    through = vector(point) + " m"
    if on_it:
        through = f"{on_it[0]} {vector(tool.landmarks[on_it[0]])} m"
    base = _aligned(direction)
    along = f"base {base}" if base else f"{vector(direction)} of the base"
    return f"through {through} in direction {along}"


# Which joint axes are linearly dependent -----------------------------------------------


class ColumnRanks:
    """Ranks of sets of columns of one task Jacobian, here and in general.

    Singular values at or below ``rtol`` times the largest are zero.
    """

    def __init__(self, arm: Arm, J: Array, q: Array, rtol: float) -> None:
        self.J, self.generic = scale_rows(arm, J, q, own=True), generic_task(arm)
        self.zero = zero_of(arm, kernel.svdvals(self.J[None], threads=1)[0], rtol)
        self.used = self.generic.moving
        self.spare = len(self.used) - generic_rank(arm)
        self.lost = int(self.nullities([self.used])[0]) - self.spare

    def rank(self, ids: Sequence[int]) -> int:
        """Rank of the columns ``ids`` at the configuration."""
        return len(ids) - int(self.nullities([ids])[0])

    def nullities(self, sets: Sequence[Sequence[int]] | NDArray[np.intp]) -> NDArray[np.intp]:
        """Return how many (N,) of each set (N, k) of columns the others of it make up for."""
        sets = np.asarray(sets, dtype=np.intp)
        stack = self.J[:, sets].transpose(1, 0, 2)  # (N, m, k)
        return np.asarray(
            sets.shape[1] - (kernel.svdvals(stack, threads=1) > self.zero).sum(axis=-1)
        )

    def generic_rank(self, ids: Sequence[int]) -> int:
        """Rank of the columns ``ids`` at almost every configuration."""
        sigma = kernel.svdvals(self.generic.J[:, :, list(ids)], threads=1)
        return int((sigma > SINGULAR_RTOL * sigma.max()).sum(axis=-1).max())

    def causes(self) -> list[tuple[int, ...]]:
        """Sets that force the loss, one for each rank lost."""
        found: list[tuple[int, ...]] = []
        for ids in self._by_size(self.used, self.spare + 1):
            union = sorted({*ids}.union(*found))
            if self.nullities([union])[0] > self.spare + len(found):
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
            larger = self.nullities([wider])[0] > self.nullities([union])[0]
            if larger and self.rank(part) < self.generic_rank(part):
                found.append(part)
                union = wider
            if self.nullities([union])[0] > self.spare:
                break
        return found

    def _by_size(self, ids: Sequence[int], nullity: int) -> Iterator[tuple[int, ...]]:
        """Sets within ``ids``, smallest first, of at least this nullity."""
        for size in range(1, len(ids) + 1):
            # sets of joints; beyond, the whole arm is named without a search
            if math.comb(len(ids), size) > 60_000:
                yield tuple(ids)
                return
            flat = chain.from_iterable(combinations(ids, size))
            sets = np.fromiter(flat, np.intp).reshape(-1, size)
            yield from map(tuple, sets[self.nullities(sets) >= nullity].tolist())


DEPENDENCE_RTOL = 10 * SINGULAR_RTOL
"""Part of an arm may be this much less singular than the whole and still be its cause."""


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
    columns = ColumnRanks(arm, J, q, rtol)
    if columns.lost <= 0:
        return ()
    words = _Reasons(arm, axes, columns, rtol)
    return tuple(
        AxisDependence(tuple(arm.joints[i] for i in ids), ids, words.reason(ids))
        for ids in columns.causes()
    )


@kept
def arm_centres(arm: Arm) -> tuple[AxesCentre, ...]:
    """Sets of three turning axes in a row that meet in one point at every configuration."""
    if arm.coupling is not None:
        return ()
    samples, turns = generic_axes(arm), ~arm.prismatic
    rows = [(i, i + 1, i + 2) for i in range(arm.n - 2) if turns[i : i + 3].all()]
    short = {0: "shoulder centre", arm.n - 3: "wrist centre"}
    return tuple(
        AxesCentre(ids, short.get(ids[0], ""))
        for ids in rows
        if all(axes.meeting_point(ids, STRUCTURE_TOL) is not None for axes in samples)
    )


def generic_axes(arm: Arm) -> list[JointAxes]:
    """Joint axes at random configurations, with the base as origin."""
    J = Batch(arm, PINOCCHIO).frame_jacobians(random_turns(arm, 4))
    return JointAxes.each(J, arm.prismatic, np.zeros(3))


class _Reasons:
    """Says why sets of axes are dependent."""

    def __init__(self, arm: Arm, axes: JointAxes, columns: ColumnRanks, rtol: float) -> None:
        self.arm, self.axes, self.columns = arm, axes, columns
        self.task = arm.task.name if arm.coupling is None else "coupled"
        self.centres = arm_centres(arm)
        # Geometry is looked for at a tolerance that fits how singular the arm is: radians, and a
        # share of the arm's size.
        self.tol = float(np.clip(30 * rtol, STRUCTURE_TOL, 0.05))

    def reason(self, ids: tuple[int, ...]) -> str:
        """Why these axes are dependent; of a redundant arm, also why the others do not help."""
        # Axes of which each three that lie in a plane need not be named
        if len(ids) > 3 and (words := self._in_line(ids)):
            return words
        parts = self.columns.pieces(ids)
        if parts == [ids]:
            return self._one(ids)
        line = self._reciprocal(ids) if self.task == "pose" else ""
        # Beside the line, or the whole, only small sets are worth naming.
        most = 2 if self.arm.task.name != "pose" else 4 if line else 6
        named = [part for part in _merged(parts) if len(part) <= most]
        idle = [part[0] for part in named if len(part) == 1]
        by_rows = self.task not in ("pose", "position", "orientation", "coupled")
        if by_rows and self.arm.task.tool_axis is None and len(idle) > 1:
            said = [self._idle(idle), *(self._one(part) for part in named if len(part) > 1)]
        else:
            said = [self._one(part) for part in named]
        if line:
            plain = {self._together(part) for part in named}  # the line says more
            said = [*(words for words in said if words not in plain), line]
        elif self.task in ("position", "orientation"):
            said.append(self._one(ids))
        else:
            rank, general = self.columns.rank(ids), self.columns.generic_rank(ids)
            several = "motion" if rank == 1 else "motions"
            who = "together they" if said else joints_of(ids)
            said.append(f"{who} give {rank} independent {several} instead of {general}")
        return "; ".join(dict.fromkeys(said))

    def _in_line(self, ids: tuple[int, ...]) -> str:
        """What is said of parallel axes that turn, and lie in one plane; nothing of others."""
        if self.task in ("coupled", "position") or self.axes.prismatic[list(ids)].any():
            return ""
        if not self.axes.parallel(ids, self.tol) or not self.axes.in_one_plane(ids, self.tol):
            return ""
        if self.task != "pose" and not self._as_twists(ids):
            return ""
        which = "all axes" if len(ids) == self.arm.n else f"axes {numbers(ids)}"
        return f"links in line: {which} are parallel and lie in one plane"

    def _one(self, ids: tuple[int, ...]) -> str:
        """Why these axes, the smallest set, are dependent in the rows of the task."""
        axes, task = self.axes, self.arm.task
        if self.task == "coupled":
            return self._together(ids)
        if self.task == "position":
            words = self._moves(ids, axes.tip, "the tip")
            every = len(ids) == self.arm.n > 2 and not axes.prismatic.any()
            straight = every and axes.parallel(ids, self.tol)
            if straight and axes.velocity_rank(ids, axes.tip, self.tol) == 1:
                return f"all links in line: {words}"
            return words
        if self.task == "orientation":
            turning = [i for i in ids if not axes.prismatic[i]]
            plane = "" if axes.parallel(turning, self.tol) else " to one plane"
            return f"axes {numbers(turning)} are parallel{plane}"
        if self.task == "pose" or self._as_twists(ids):
            return self._of_twists(ids)
        if len(task.rows) == 5 and task.tool_axis is not None:
            turn = f"a turn about the tool's own {TOOL_AXES[task.tool_axis]} axis"
            if len(ids) == 1:
                return f"all that joint {ids[0] + 1} moves is {turn}"
            return f"{self._together(ids)}, but for {turn}"
        if len(ids) == 1:
            return self._idle(ids)
        return self._together(ids, ", ".join(task.row_names), "at zero")

    def _together(self, ids: Sequence[int], who: str = "the tip", how: str = "at rest") -> str:
        """Say no more than what it means that columns are linearly dependent."""
        return f"{joints_of(ids)} can move together with {who} {how}"

    def _idle(self, ids: Sequence[int]) -> str:
        """Return what is said of joints that move none of the rows of a task."""
        move = "moves" if len(ids) == 1 else "move"
        rows = ", ".join(self.arm.task.row_names)
        return f"{joints_of(ids)} {move} none of the rows {rows}"

    def _as_twists(self, ids: tuple[int, ...]) -> bool:
        """Return True if the whole twists are dependent, and not the chosen rows alone."""
        twists = self.axes.twists(ids, self.axes.tip)
        twists[self.axes.prismatic[list(ids)]] /= self.axes.size
        sigma = np.linalg.svd(twists, compute_uv=False)
        return len(ids) > 6 or bool(sigma[-1] <= self.tol * sigma[0])

    def _of_twists(self, ids: tuple[int, ...]) -> str:
        """Why axes ``ids``, the smallest set of dependent twists, are dependent."""
        axes, tol = self.axes, self.tol
        turning = [i for i in ids if not axes.prismatic[i]]
        sliding = [i for i in ids if axes.prismatic[i]]
        if len(ids) == 1:  # beside a slide of kilometres
            return self._together(ids)
        if not turning:
            words = "parallel" if axes.parallel(ids, tol) else "parallel to one plane"
            return f"prismatic joints {numbers(ids)} are {words}"
        several, parallel = f"axes {numbers(ids)}", axes.parallel(turning, tol)
        flat = not sliding and axes.in_one_plane(ids, tol)
        if parallel and not sliding:
            if axes.pass_through(ids[1:], axes.point[ids[0]], tol):
                return f"{several} are collinear"
            plane = " and lie in one plane" if flat else ""
            return f"{several} are parallel{plane}"
        z = axes.direction[turning[0]]
        if parallel and len(turning) > 1 and (np.abs(axes.direction[sliding] @ z) <= tol).all():
            across = f"{_are('prismatic joint', sliding)} perpendicular to"
            if (len(turning), len(sliding)) != (2, 1):
                return f"{_are('axis', turning)} parallel and {across} them"
            apart = axes.point[turning[1]] - axes.point[turning[0]]
            if abs(axes.direction[sliding[0]] @ (apart - (apart @ z) * z)) <= tol * axes.size:
                return f"{across} the plane of axes {numbers(turning)}"
        # With all turns about a centre at hand, the others must move the centre independently.
        for centre in self.centres:
            rest = tuple(i for i in ids if i not in centre.ids)
            point = axes.meeting_point(centre.ids, STRUCTURE_TOL)
            few = len(rest) == len(ids) - 3 and len(rest) in (1, 2, 3)
            if few and point is not None and axes.velocity_rank(rest, point, tol) != len(rest):
                return self._moves(rest, point, centre.named())
        if not sliding and axes.meeting_point(ids, tol) is not None:
            if flat and len(ids) == 3:
                return f"{several} meet in one point and lie in one plane"
            return f"{several} meet in one point"
        if flat and len(ids) > 3:
            return f"{several} lie in one plane"
        return self._reciprocal(ids) or self._together(ids)

    def _moves(self, ids: tuple[int, ...], point: Array, name: str) -> str:
        """Say why joints move a point in fewer directions than their number would allow."""
        axes, tol = self.axes, self.tol
        turning = not axes.prismatic[list(ids)].any()
        rank = axes.velocity_rank(ids, point, tol)
        if len(ids) == 1 and rank == 0:
            return f"{name} lies on axis {numbers(ids)}"
        if len(ids) == 2 and turning and axes.in_one_plane(ids, tol, point):
            kind = "the parallel axes" if axes.parallel(ids, tol) else "axes"
            return f"{name} lies in the plane of {kind} {numbers(ids)}"
        for pair in combinations(ids, 2) if len(ids) == 3 and turning else ():
            (other,) = set(ids) - set(pair)
            if axes.parallel(pair, tol) and not axes.parallel((other, pair[0]), tol):
                normal = cross(axes.direction[other], axes.direction[pair[0]])
                if abs((point - axes.point[other]) @ normal) <= tol * axes.size * length(normal):
                    plane = f"the plane through axis {other + 1} parallel to axes {numbers(pair)}"
                    return f"{name} lies in {plane}"
        if rank == 0:
            return f"{joints_of(ids)} do not move {name}"
        if rank == 1:
            return f"{joints_of(ids)} move {name} along the same line"
        return f"{joints_of(ids)} move {name} within one plane only"

    def _reciprocal(self, ids: tuple[int, ...]) -> str:
        """Which line meets all of these axes or is parallel to them, or their complex, if any.

        Five independent twists have one reciprocal wrench. A force has no moment about any of the
        axes: its line meets them or is parallel to them (Merlet, "Singular configurations of
        parallel manipulators and Grassmann geometry", 1989). Where its pitch is not zero, the lines
        that it does no work on are those of a linear complex of that pitch (K. H. Hunt, "Kinematic
        Geometry of Mechanisms", 1978).
        """
        axes, tol = self.axes, self.tol
        # The force, and the moment about the tip in units of size.
        _, sigma, Vt = np.linalg.svd(axes.twists(ids, axes.tip))
        if (sigma > tol * sigma[0]).sum() != 5:
            return ""
        force, moment = Vt[5, :3], Vt[5, 3:]
        strength = length(force)
        turning = [i for i in ids if not axes.prismatic[i]]
        sliding = [i for i in ids if axes.prismatic[i]]
        if strength <= tol:
            return f"axes {numbers(turning)} are parallel to one plane"
        pitch = float(force @ moment) / strength**2
        point = axes.tip + cross(force, moment) / strength**2 * axes.size
        met, along = [], []
        for i in turning:
            normal = cross(axes.direction[i], force) / strength
            sine = length(normal)
            if sine <= tol:
                along.append(i)
            elif abs((axes.point[i] - point) @ normal) <= 10 * tol * axes.size * sine:
                met.append(i)
        across = f"{_are('prismatic joint', sliding)} perpendicular to"
        if abs(pitch) <= tol and met and len(met) + len(along) == len(turning):
            meet = _are("axis", met, "meets", "meet")
            words = f"{'all axes meet' if len(met) == self.arm.n else meet} a common line"
            others = [f"{_are('axis', along)} parallel to it"] * bool(along)
            others += [f"{across} it"] * bool(sliding)
            return ", and ".join([", ".join([words, *others[:-1]]), *others[-1:]])
        count = {6: "six ", 5: "five ", 7: "seven "}.get(len(turning), "")
        every = len(turning) == self.arm.n
        who = f"all {count}axes" if every else f"axes {numbers(turning)}"
        words = f"{who} belong to one linear complex, here of pitch"
        words += f" {pitch * axes.size:.3g} m/rad"
        return f"{words}, and {across} its axis" if sliding else words


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
