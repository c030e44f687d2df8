"""Motions that a configuration cannot produce, wrenches that it carries for free, and why.

A wrench w with J^T w = 0 needs no joint torque, and no motion of the tip has power against it:
that is what is lost. A pure force through the tip takes a translation away, a pure moment a
rotation, a force off the tip the motion of a line along itself, any other wrench the motion on
a screw (J. K. Davidson and K. H. Hunt, "Robots and Screw Theory", 2004).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np

from pinsing._batch import engine as kernel
from pinsing.kinematics.jacobian import (
    SINGULAR_RTOL,
    frame_jacobians,
    generic_rank,
    generic_task,
    own_scale,
    random_turns,
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

    def distance(self, i: int, point: Array) -> float:
        """Distance of a point (3,) from turning axis i, metres."""
        return length(cross(self.direction[i], point - self.point[i]))

    def meeting_point(self, ids: Sequence[int], tol: float) -> Array | None:
        """Return the point (3,) that all these turning axes pass through, if there is one."""
        z, p = self.direction[list(ids)], self.point[list(ids)] - self.tip
        # The normal equations of least squares: the sum of (1 - z z^T)(x - p) is zero.
        values, V = np.linalg.eigh(len(z) * np.eye(3) - z.T @ z)
        if values[0] <= (10 * tol) ** 2:  # nearly parallel
            return None
        across = p - (p * z).sum(axis=1, keepdims=True) * z
        point = self.tip + V @ (V.T @ across.sum(axis=0) / values)
        return point if all(self.distance(i, point) <= tol * self.size for i in ids) else None

    def in_one_plane(self, ids: Sequence[int], tol: float, *points: Array) -> bool:
        """Return True if these turning axes, and the given points (3,), lie in one plane."""
        start = self.point[ids[0]]
        others = [p - start for p in (*self.point[list(ids)], *points)]
        spanned = np.array([*self.direction[list(ids)], *(p / self.size for p in others)])
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
    n: int

    @property
    def short(self) -> str:
        """``wrist centre``, ``shoulder centre``, or empty for one in the middle."""
        if self.ids[-1] == self.n - 1:
            return "wrist centre"
        return "shoulder centre" if self.ids[0] == 0 else ""

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


def dependent(
    ids: Sequence[int], nearly: str = "", who: str = "the tip", how: str = "at rest"
) -> str:
    """Say no more than what it means that columns are linearly dependent."""
    return f"{joints_of(ids)} can move together with {who} {nearly}{how}"


def pose_reason(
    axes: JointAxes,
    ids: tuple[int, ...],
    centres: Sequence[AxesCentre],
    tol: float,
    nearly: str = "",
) -> str:
    """Return why axes ``ids``, the smallest set of dependent twists, are dependent."""
    # ``tol`` is in radians, and a share of the arm's size; ``nearly`` is empty or "nearly ".
    turning = tuple(i for i in ids if not axes.prismatic[i])
    sliding = tuple(i for i in ids if axes.prismatic[i])
    reason = None
    if len(ids) == 1:  # beside a slide of kilometres
        pass
    elif not sliding:
        reason = _of_turning(axes, ids, centres, tol, nearly)
    elif not turning:
        words = "parallel" if axes.parallel(ids, tol) else "parallel to one plane"
        reason = f"prismatic joints {numbers(ids)} are {nearly}{words}"
    elif axes.parallel(turning, tol) and len(turning) > 1:
        reason = _parallel_and_sliding(axes, turning, sliding, tol, nearly)
    return (
        reason
        or _through_a_centre(axes, ids, centres, tol, nearly)
        or reciprocal_reason(axes, ids, tol, nearly)
        or dependent(ids, nearly)
    )


def _of_turning(
    axes: JointAxes, ids: tuple[int, ...], centres: Sequence[AxesCentre], tol: float, nearly: str
) -> str | None:
    several = f"axes {numbers(ids)}"
    flat = axes.in_one_plane(ids, tol)
    if axes.parallel(ids, tol):
        if all(axes.distance(ids[0], axes.point[i]) <= tol * axes.size for i in ids[1:]):
            return f"{several} are {nearly}collinear"
        if flat:
            return f"{several} are parallel and lie {nearly}in one plane"
        return f"{several} are {nearly}parallel"
    if axes.meeting_point(ids, tol) is not None:
        for centre in centres:
            rest = sorted(set(ids) - set(centre.ids))
            if set(centre.ids) < set(ids) and len(rest) == 1:
                return f"{centre.named()} lies {nearly}on axis {numbers(rest)}"
        if flat and len(ids) == 3:
            return f"{several} meet in one point and lie {nearly}in one plane"
        return f"{several} {nearly}meet in one point"
    return f"{several} lie {nearly}in one plane" if flat and len(ids) > 3 else None


def _parallel_and_sliding(
    axes: JointAxes, turning: tuple[int, ...], sliding: tuple[int, ...], tol: float, nearly: str
) -> str | None:
    z = axes.direction[turning[0]]
    if (np.abs(axes.direction[list(sliding)] @ z) > tol).any():
        return None
    across = f"{_are('prismatic joint', sliding)} {nearly}perpendicular to"
    if len(turning) == 2 and len(sliding) == 1:
        apart = axes.point[turning[1]] - axes.point[turning[0]]
        if abs(axes.direction[sliding[0]] @ (apart - (apart @ z) * z)) <= tol * axes.size:
            return f"{across} the plane of axes {numbers(turning)}"
        return None
    return f"{_are('axis', turning)} parallel and {across} them"


def _through_a_centre(
    axes: JointAxes, ids: tuple[int, ...], centres: Sequence[AxesCentre], tol: float, nearly: str
) -> str | None:
    """With all turns about a centre at hand, the others must move the centre independently."""
    for centre in centres:
        rest = tuple(i for i in ids if i not in centre.ids)
        point = axes.meeting_point(centre.ids, STRUCTURE_TOL)
        if not set(centre.ids) < set(ids) or point is None or len(rest) > 3:
            continue
        if axes.velocity_rank(rest, point, tol) != len(rest):
            return _moves(axes, rest, point, centre.named(), tol, nearly)
    return None


def _moves(
    axes: JointAxes, ids: tuple[int, ...], point: Array, name: str, tol: float, nearly: str
) -> str:
    """Say why joints move a point in fewer directions than their number would allow."""
    turning = not axes.prismatic[list(ids)].any()
    rank = axes.velocity_rank(ids, point, tol)
    if len(ids) == 1 and rank == 0:
        return f"{name} lies {nearly}on axis {numbers(ids)}"
    if len(ids) == 2 and turning and axes.in_one_plane(ids, tol, point):
        kind = "the parallel axes" if axes.parallel(ids, tol) else "axes"
        return f"{name} lies {nearly}in the plane of {kind} {numbers(ids)}"
    for pair in combinations(ids, 2) if len(ids) == 3 and turning else ():
        (other,) = set(ids) - set(pair)
        if axes.parallel(pair, tol) and not axes.parallel((other, pair[0]), tol):
            normal = cross(axes.direction[other], axes.direction[pair[0]])
            if abs((point - axes.point[other]) @ normal / length(normal)) <= tol * axes.size:
                plane = (
                    f"the plane through axis {numbers([other])} parallel to axes {numbers(pair)}"
                )
                return f"{name} lies {nearly}in {plane}"
    if rank == 0:
        return f"{joints_of(ids)} do {nearly}not move {name}"
    if rank == 1:
        return f"{joints_of(ids)} {nearly}move {name} along the same line"
    return f"{joints_of(ids)} move {name} {nearly}within one plane only"


def reciprocal_reason(axes: JointAxes, ids: tuple[int, ...], tol: float, nearly: str) -> str | None:
    """Return which line meets all of these axes or is parallel to them, or their complex.

    Five independent twists have one reciprocal wrench. A force has no moment about any of the axes:
    its line meets them or is parallel to them (Merlet, "Singular configurations of parallel
    manipulators and Grassmann geometry", 1989). Where its pitch is not zero, the lines that it does
    no work on are those of a linear complex of that pitch (K. H. Hunt, "Kinematic Geometry of
    Mechanisms", 1978).
    """
    # The force, and the moment about the tip in units of size.
    _, sigma, Vt = np.linalg.svd(axes.twists(ids, axes.tip))
    if (sigma > tol * sigma[0]).sum() != 5:
        return None
    force, moment = Vt[5, :3], Vt[5, 3:]
    strength = length(force)
    turning = [i for i in ids if not axes.prismatic[i]]
    if strength <= tol:
        return f"axes {numbers(turning)} are {nearly}parallel to one plane"
    if abs(force @ moment) <= tol * strength**2:
        point = axes.tip + cross(force, moment) / strength**2 * axes.size
        line = _common_line(axes, ids, force / strength, point, tol, nearly)
        if line is not None:
            return line
    sliding = [i for i in ids if axes.prismatic[i]]
    pitch = float(force @ moment) / strength**2 * axes.size
    every = len(turning) == len(axes.prismatic)
    count = {6: "six ", 5: "five ", 7: "seven "}.get(len(turning), "")
    who = f"all {count}axes" if every else f"axes {numbers(turning)}"
    words = f"{who} {nearly}belong to one linear complex, here of pitch {pitch:.3g} m/rad"
    if sliding:
        words += f", and {_are('prismatic joint', sliding)} {nearly}perpendicular to its axis"
    return words


def _common_line(
    axes: JointAxes, ids: Sequence[int], direction: Array, point: Array, tol: float, nearly: str
) -> str | None:
    """Say which joints meet a line, are parallel or perpendicular to it; None if some do not."""
    met, along, across = [], [], []
    for i in ids:
        normal = cross(axes.direction[i], direction)
        sine = length(normal)
        if axes.prismatic[i]:
            across.append(i)
        elif sine <= tol:
            along.append(i)
        elif abs((axes.point[i] - point) @ normal) <= 10 * tol * axes.size * sine:
            met.append(i)
        else:
            return None
    if not met:
        return None
    meet = _are("axis", met, f"{nearly}meets", f"{nearly}meet")
    if len(met) == len(axes.prismatic):
        meet = f"all axes {nearly}meet"
    words = [f"{meet} a common line"]
    for ids, what, how in (
        (along, "axis", "parallel"),
        (across, "prismatic joint", "perpendicular"),
    ):
        if ids:
            words.append(f"{_are(what, ids)} {nearly}{how} to it")
    return ", ".join(words[:-1]) + ", and " + words[-1] if words[1:] else words[0]


def position_reason(axes: JointAxes, ids: tuple[int, ...], tol: float, nearly: str = "") -> str:
    """Say why joints move the tip in fewer directions than their number would allow."""
    words = _moves(axes, ids, axes.tip, "the tip", tol, nearly)
    every = len(ids) == len(axes.prismatic) > 2 and not axes.prismatic.any()
    if every and axes.parallel(ids, tol) and axes.velocity_rank(ids, axes.tip, tol) == 1:
        return f"all links {nearly}in line: {words}"
    return words


ALIGNED = math.radians(0.1)
"""Radians; a direction this close to an axis of the tool or the base goes by that axis."""


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
        return {"rotation": "a moment about it", "screw": "a wrench on it"}.get(
            self.kind, "a force along it"
        )

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
    pure = np.concatenate([no_moment, no_force], axis=1)
    rest = _null_space(pure.T, 1e-6) if pure.size else np.eye(U.shape[1])

    def slowest(directions: Array, rows: Array) -> list[Array]:
        nice = nice_basis(directions, tool.rotation)
        if not (hardly and nice):
            return nice
        # What is left of a pure motion is a semi-axis of its ellipsoid, told with the same number.
        axes = np.linalg.svd(rows)[0].T
        near = [axes[np.argmax(np.abs(axes @ d))] for d in nice]
        return [a if length(cross(a, d)) <= tol else d for a, d in zip(near, nice, strict=True)]

    columns = [np.append(d, np.zeros(3)) for d in slowest(forces @ no_moment, J[:3])]
    columns += [np.append(np.zeros(3), d) for d in slowest(moments @ no_force, J[3:])]
    columns += list((U @ rest).T)

    def described(u: Array) -> LostMotion:
        force, moment = u[:3] / own_length, u[3:]
        at_scale = np.append(length_scale * force, moment)
        at_scale /= np.linalg.norm(at_scale)
        strength = float(np.linalg.norm(force))
        is_moment = strength * own_length <= tol
        wrench = np.append(force, moment) / (np.linalg.norm(moment) if is_moment else strength)
        force, moment = wrench[:3], wrench[3:]
        point, pitch = tool.position, math.inf
        direction = moment if is_moment else force
        if not is_moment:
            pitch, lever = float(force @ moment), cross(force, moment)
            point = point if length(lever) <= tol * tool.size else point + lever
        # Of d and -d, the one whose largest component is positive.
        largest = int(np.argmax(np.abs(direction).round(9)))
        direction = np.asarray(direction * np.sign(direction[largest]))
        if is_moment:
            kind, noun, verb = "rotation", "rotation", "rotate"
            where = f"about {axis_name(direction, tool.rotation)}"
        elif abs(pitch) > tol * tool.size:
            kind, noun, verb = "screw", "motion", "move"
            line = _line_words(direction, point, tool, tol)
            where = f"on the screw of pitch {pitch:.3g} m/rad about the line {line}"
        elif point is tool.position:
            kind, noun, verb, pitch = "translation", "translation", "translate", 0.0
            where = f"along {axis_name(direction, tool.rotation)}"
        else:
            kind, noun, verb, pitch = "line", "motion", "move", 0.0
            where = f"along the line {_line_words(direction, point, tool, tol)}"
        speed = float(np.linalg.norm(J.T @ wrench))
        words = f"cannot {verb} {where}"
        if hardly:
            unit = "rad/s" if is_moment else "m/s"
            words = f"nearly loses {noun} {where} ({speed:.4g} {unit} at unit joint speed)"
        return LostMotion(
            kind=kind,
            direction=direction,
            point=np.array(point),
            pitch=pitch,
            wrench=wrench,
            twist=np.append(length_scale * at_scale[:3], at_scale[3:]),
            speed=speed,
            words=words,
        )

    return tuple(described(u) for u in columns)


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
        r = generic_rank(arm)
        self.spare = len(self.used) - r
        self.lost = r - self.rank(self.used)

    def rank(self, ids: Sequence[int]) -> int:
        """Rank of the columns ``ids`` at the configuration."""
        return int(self._ranks(np.array([ids], dtype=np.intp))[0])

    def nullity(self, ids: Sequence[int]) -> int:
        """Return how many of the columns ``ids`` the others of these make up for."""
        return len(ids) - self.rank(ids)

    def generic_rank(self, ids: Sequence[int]) -> int:
        """Rank of the columns ``ids`` at almost every configuration."""
        sigma = singular_values(self.generic[:, :, list(ids)])
        return int((sigma > SINGULAR_RTOL * sigma.max()).sum(axis=-1).max())

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
            larger = self.nullity(wider) > self.nullity(union)
            if larger and self.rank(part) < self.generic_rank(part):
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
            if math.comb(len(ids), size) > 60_000:
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
    columns = ColumnRanks(arm, J, q, rtol, generic_task(arm), moving_columns(arm))
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
    if arm.coupling is not None:
        return ()
    samples, turns = generic_axes(arm), ~arm.prismatic
    rows = [(i, i + 1, i + 2) for i in range(arm.n - 2) if turns[i : i + 3].all()]
    return tuple(
        AxesCentre(ids, arm.n)
        for ids in rows
        if all(axes.meeting_point(ids, STRUCTURE_TOL) is not None for axes in samples)
    )


@kept
def moving_columns(arm: Arm) -> tuple[int, ...]:
    """Joints (indices) that move the task at some configuration."""
    general = np.linalg.norm(generic_task(arm), axis=1).max(axis=0)
    return tuple(int(i) for i in np.flatnonzero(general > SINGULAR_RTOL * general.max()))


def generic_axes(arm: Arm) -> list[JointAxes]:
    """Joint axes at random configurations, with the base as origin."""
    return JointAxes.each(frame_jacobians(arm, random_turns(arm, 4)), arm.prismatic, np.zeros(3))


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
            turning = tuple(i for i in ids if not self.axes.prismatic[i])
            plane = "" if self.axes.parallel(turning, self.tol) else " to one plane"
            return f"axes {numbers(turning)} are {self.nearly}parallel{plane}"
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
        twists = self.axes.twists(ids, self.axes.tip)
        twists[self.axes.prismatic[list(ids)]] /= self.axes.size
        sigma = np.linalg.svd(twists, compute_uv=False)
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
