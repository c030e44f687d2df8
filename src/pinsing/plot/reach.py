"""How many inverse solutions a 3-joint position arm has at each place, with cusps and nodes.

The first joint turns, so the workspace is one of revolution: r, the distance of the tip from the
first axis, and z along it are functions of the other two joints. A place (r, z) has as many
solutions as the map of those joints has points there. The count changes only across the images of
singular configurations (Wenger, 2007: "Cuspidal and noncuspidal robot manipulators"); these have
*cusps*, where three solutions meet, and *nodes*, where two pairs meet at one place. With
R = r^2 / 2 the map is smooth, and singular where f = R_2 z_3 - R_3 z_2 = 0; a cusp is where the
direction that the map forgets is tangent to that curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from pinsing.arguments import checked, whole_number
from pinsing.errors import OptionError
from pinsing.kinematics.jacobian import generic_rank, tip_and_jacobian
from pinsing.measures import Array, Ints
from pinsing.plot.style import SMALL, legend_below, new_axes, plain
from pinsing.proximity.clearance import STEP
from pinsing.robot.arm import Arm

_FIT = (0.0, 2.0, 4.0)
_FLAT = 1e-7
_CROSS = 1e-3
"""Where f is so much flatter than along its curve, two curves of singular joint values cross."""
_ANGLE = 0.03
"""Curves that touch at a smaller angle, radians, do not cross there."""
_NEAR = 5e-3
"""Nodes are farther from cusps and from each other than this share of the size."""
_SHIFT = 0.1234
"""Whole circles begin at no round angle: special lines are then not on a line of the grid."""


@dataclass(frozen=True, eq=False)
class Reach:
    """The half plane r >= 0, z of the workspace, counted."""

    # r and z: (M,): places, metres: distance from the first axis, and along it from the base
    r: Array
    z: Array
    count: Ints  # (N, M) of int: inverse solutions there
    curves: tuple[Array, ...]  # images (r, z) of singular configurations
    # cusps and nodes: (C, 2): places (r, z) of the cusps and nodes of these
    cusps: Array
    nodes: Array
    cusp_joints: Array  # (C, 2): values of the second and third joint at the cusps
    within_limits: bool  # whether the second and third joint end at their limits


@dataclass(frozen=True, eq=False)
class Section:
    """The tip with joint 1 at 0: ``tensor`` (a, b, 3), across the first axis, and along it last.

    In products of functions: 1, cos and sin of a joint that turns; 1 and the value of a slide.
    """

    slides: tuple[bool, bool]
    tensor: Array

    @classmethod
    def of(cls, arm: Arm) -> Section:
        """Read off the arm at a few configurations, exactly but for rounding."""
        if arm.n != 3 or arm.coupling is not None or generic_rank(arm) != 3:
            raise OptionError(
                "inverse solutions by position are drawn for arms of 3 joints and task position: "
                f"this one has {arm.n} joints and task {arm.task}, of rank {generic_rank(arm)}"
            )
        OptionError.refuse_if(
            arm.task.rows != (0, 1, 2), f"the task must be position, not {arm.task}"
        )
        OptionError.refuse_if(
            arm.prismatic[0],
            "the first joint must be revolute: the workspace is then one of revolution",
        )
        slides = bool(arm.prismatic[1]), bool(arm.prismatic[2])
        every = [_FIT[:2] if s else _FIT for s in slides]
        tips, axis, foot = [], np.zeros(3), np.zeros(3)
        for a, b in product(*every):
            tip, _, J = tip_and_jacobian(arm, np.array([0.0, a, b]))
            axis = J[3:, 0]
            foot = tip - np.cross(J[:3, 0], axis)
            tips.append(tip)
        foot = foot - axis * (axis @ foot)
        x = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        x /= np.linalg.norm(x)
        known = (np.array(tips) - foot) @ np.stack([x, np.cross(axis, x), axis]).T
        A, B = (basis(np.array(v), s) for v, s in zip(every, slides, strict=True))
        tensor = np.linalg.solve(np.kron(A, B), known).reshape(A.shape[1], B.shape[1], 3)
        return cls(slides, np.where(np.abs(tensor) < 1e-13 * np.abs(tensor).max(), 0.0, tensor))

    def on(self, x: Array, a: int = 0, b: int = 0) -> Array:
        """Coordinates (..., 3) at joint values (..., 2), or their derivatives of orders a, b."""
        A, B = (
            basis(x[..., k], s, order)
            for k, (s, order) in enumerate(zip(self.slides, (a, b), strict=True))
        )
        a_done = (A @ self.tensor.reshape(A.shape[-1], -1)).reshape(*B.shape, 3)
        return np.asarray((a_done * B[..., None]).sum(axis=-2))

    def place(self, x: Array) -> Array:
        """Places (..., 2): r and z."""
        p = self.on(x)
        return np.stack([np.hypot(p[..., 0], p[..., 1]), p[..., 2]], axis=-1)

    def slopes(self, x: Array) -> Array:
        """Derivatives (..., 2, 2) of r^2 / 2 and z by the two joints."""
        p = self.on(x)
        d = np.stack([self.on(x, 1, 0), self.on(x, 0, 1)], axis=-1)
        R = p[..., 0, None] * d[..., 0, :] + p[..., 1, None] * d[..., 1, :]
        return np.stack([R, d[..., 2, :]], axis=-2)

    def singular(self, x: Array) -> Array:
        """Values (...) of f: zero where the arm is singular off its first axis."""
        return np.asarray(np.linalg.det(self.slopes(x)))

    def steepest(self, x: Array) -> Array:
        """Gradient (..., 2) of f, by differences."""
        e = STEP * np.eye(2)
        return np.stack(
            [(self.singular(x + v) - self.singular(x - v)) / (2 * STEP) for v in e], axis=-1
        )

    def tangent(self, x: Array) -> Array:
        """Return the slope of f along what the map forgets, from r and from z, (..., 2)."""
        # Both are zero at a cusp; one alone may be where its own row of the map is.
        A, g = self.slopes(x), self.steepest(x)
        return np.asarray(A[..., 0] * g[..., 1, None] - A[..., 1] * g[..., 0, None])


def basis(value: Array, slides: bool, order: int = 0) -> Array:
    """Functions (..., k) of a joint value: 1, cos, sin or 1, value; or their derivative."""
    one, zero = np.ones_like(value), np.zeros_like(value)
    if slides:
        return np.stack([zero, one] if order else [one, value], axis=-1)
    c, s = np.cos(value), np.sin(value)
    return np.stack([zero, -s, c] if order else [one, c, s], axis=-1)


def cusps_of(section: Section, curves: list[Array]) -> Array:
    """Joint values (C, 2) of the cusps on curves (K, 2) of singular joint values."""
    from scipy.optimize import root

    size = float(np.abs(section.tensor).max()) ** 3
    found: list[Array] = []
    for curve in curves:
        t = section.tangent(curve)
        steep = np.linalg.norm(section.steepest(curve), axis=-1)
        row = np.argmax(np.linalg.norm(section.slopes(curve), axis=-1), axis=-1)
        for k in range(len(curve) - 1):
            a, b = t[k, row[k]], t[k + 1, row[k]]
            flat = min(steep[k], steep[k + 1]) < _FLAT * size
            if a * b >= 0 or flat or min(abs(a), abs(b)) < _FLAT * size * size:
                continue
            tangent = int(row[k])
            x = root(
                lambda y, tangent=tangent: [section.singular(y), section.tangent(y)[tangent]],
                (curve[k] + curve[k + 1]) / 2,
                tol=1e-12,
            ).x
            if np.linalg.norm(section.steepest(x)) < _CROSS * float(np.median(steep)):
                continue
            near = np.linalg.norm(x - curve[k]) < 4 * np.linalg.norm(curve[k + 1] - curve[k])
            if near and not any(_alike(section, x, y) for y in found):
                found.append(x)
    return np.array(found).reshape(-1, 2)


def _alike(section: Section, x: Array, y: Array) -> bool:
    gap = x - y
    gap = gap - np.where(section.slides, 0.0, 2 * math.pi * np.round(gap / (2 * math.pi)))
    return bool(np.abs(gap).max() < 1e-4)


def nodes_of(section: Section, lines: list[Array], cusps: Array, size: float) -> Array:
    """Return places (D, 2) where images of singular curves (K, 2) cross at an angle."""
    # Each is solved for on the curves themselves: where two have one image, as where a joint turns
    # over, the drawing crosses itself by rounding only.
    if not lines:
        return np.zeros((0, 2))
    images = [section.place(x) for x in lines]
    x, p = (np.concatenate([c[:-1] for c in each]) for each in (lines, images))
    v, u = (np.concatenate([np.diff(c, axis=0) for c in each]) for each in (lines, images))
    length = np.linalg.norm(u, axis=1)
    # Pieces of curves whose images are shorter than this share of the size are one place
    drawn = length > 1e-7 * size
    x, p, v, u, length = (each[drawn] for each in (x, p, v, u, length))
    low, high = np.minimum(p, p + u), np.maximum(p, p + u)
    steep = _CROSS * float(np.median(np.linalg.norm(section.steepest(x), axis=-1)))
    found: list[Array] = []
    for i in range(len(p) - 1):
        rest = np.arange(i + 1, len(p))
        j = rest[(low[rest] <= high[i]).all(axis=1) & (high[rest] >= low[i]).all(axis=1)]
        cross = u[i, 0] * u[j, 1] - u[i, 1] * u[j, 0]
        j = j[np.abs(cross) > _ANGLE * length[i] * length[j]]
        gap = p[j] - p[i]
        cross = u[i, 0] * u[j, 1] - u[i, 1] * u[j, 0]
        s = (gap[:, 0] * u[j, 1] - gap[:, 1] * u[j, 0]) / cross
        t = (gap[:, 0] * u[i, 1] - gap[:, 1] * u[i, 0]) / cross
        for k in np.flatnonzero((s >= 0) & (s < 1) & (t >= 0) & (t < 1)):
            both = np.stack([x[i] + s[k] * v[i], x[j[k]] + t[k] * v[j[k]]])
            at = _crossed(section, both, size, steep)
            if at is not None and all(
                np.linalg.norm(at - f) > _NEAR * size for f in [*cusps, *found]
            ):
                found.append(at)
    return np.array(found).reshape(-1, 2)


def _crossed(section: Section, both: Array, size: float, steep: float) -> Array | None:
    """Return the place of a node by Newton, from two joint values (2, 2) near it, or None."""
    # Both are singular, and have one place: four equations, which are regular where the images
    # cross at an angle. At the first axis curves end against their mirror images: that is no node.
    from scipy.optimize import root

    def value(y: Array) -> Array:
        places = section.place(y.reshape(2, 2))
        f = section.singular(y.reshape(2, 2)) / size**3
        return np.concatenate([f, (places[0] - places[1]) / size])

    y = np.asarray(root(value, both.ravel(), tol=1e-12).x).reshape(2, 2)
    # A node is nearer than this to where drawn curves cross, radians or metres.
    if np.abs(y - both).max() > 0.1:
        return None
    at = np.asarray(section.place(y)[0])
    if np.abs(value(y.ravel())).max() > 1e-9 or at[0] < _NEAR * size:
        return None
    g = section.steepest(y)
    if _alike(section, y[0], y[1]) or np.linalg.norm(g, axis=-1).min() < steep:
        return None
    along = np.stack([-g[:, 1], g[:, 0]], axis=-1)
    along /= np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-300)
    w = (section.place(y + 1e-6 * along) - section.place(y - 1e-6 * along)) / 2e-6
    turn = abs(float(w[0, 0] * w[1, 1] - w[0, 1] * w[1, 0]))
    crossed = turn > _ANGLE * float(np.linalg.norm(w[0]) * np.linalg.norm(w[1]))
    return at if crossed and np.linalg.norm(w, axis=1).min() > 1e-6 * size else None


def reach_of(arm: Arm, samples: int, limits: bool) -> Reach:
    """Count the solutions over the half plane, and find the curves, cusps and nodes."""
    section = Section.of(arm)
    ranges = np.stack(arm.space.range(not limits), axis=1)[1:]
    if not limits:
        whole = ~np.array(section.slides) & (np.ptp(ranges, axis=1) >= 2 * math.pi - 1e-9)
        ranges[whole] = [-math.pi + _SHIFT, math.pi + _SHIFT]
    joints = [np.linspace(a, b, 300 + 1) for a, b in ranges]
    X = np.stack(np.meshgrid(*joints, indexing="ij"), axis=-1)
    places = section.place(X)
    f = section.singular(X)
    OptionError.refuse_if(
        np.abs(f).max() < _FLAT * np.abs(section.tensor).max() ** 3,
        "this arm is singular everywhere off its first axis",
    )
    drawn = Figure().add_subplot().contour(joints[0], joints[1], f.T, levels=[0.0])
    lines = [_onto(section, np.asarray(line)) for line in drawn.allsegs[0] if len(line) > 2]
    size = float(np.ptp(places.reshape(-1, 2), axis=0).max())
    lines = [x for x in lines if np.ptp(section.place(x), axis=0).max() > 1e-6 * size]
    joints_at = cusps_of(section, lines)
    cusps = _distinct(section.place(joints_at), size)
    top = float(places[..., 0].max())
    low, high = float(places[..., 1].min()), float(places[..., 1].max())
    margin = 0.03 * size
    axes = [np.linspace(a, b, 480 + 1) for a, b in ranges]
    tiles = section.place(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))
    r = np.linspace(0.0, top + margin, samples) + 0.37 * (top + margin) / samples
    z = np.linspace(low - margin, high + margin, samples)
    return Reach(
        r=r,
        z=z,
        count=count_of(tiles, r, z),
        curves=tuple(section.place(x) for x in lines),
        cusps=cusps,
        nodes=nodes_of(section, lines, cusps, size),
        cusp_joints=joints_at,
        within_limits=limits,
    )


def _distinct(places: Array, size: float) -> Array:
    out: list[Array] = []
    for p in places:
        if all(np.linalg.norm(p - o) > 1e-5 * size for o in out):
            out.append(p)
    return np.array(out).reshape(-1, 2)


def _onto(section: Section, x: Array) -> Array:
    """The same points, moved onto f = 0 along its gradient."""
    for _ in range(2):
        g = section.steepest(x)
        square = (g * g).sum(axis=-1)
        step = np.where(square > 1e-12, section.singular(x) / np.maximum(square, 1e-12), 0.0)
        x = x - np.clip(step[:, None] * g, -0.01, 0.01)
    return x


def count_of(at: Array, r: Array, z: Array) -> Ints:
    """Return the number of solutions in two joints for each (r, z), (N, M), by triangles.

    ``at`` (K, L, 2) has places of a grid of joint values, linear between: wrong only within about
    1e-5 of the size from where the count changes.
    """
    # Places by cells; half a cell is added so that no place is on a side of a triangle.
    u = (at[..., 0] - r[0]) / (r[1] - r[0])
    corners = np.stack([u, (at[..., 1] - z[0]) / (z[1] - z[0])], axis=-1)
    a, b, c, d = (
        corners[i : len(u) - 1 + i, j : u.shape[1] - 1 + j].reshape(-1, 2)
        for i, j in ((0, 0), (1, 0), (0, 1), (1, 1))
    )
    count = np.zeros((len(z), len(r)), dtype=np.int64)
    for triangle in ((a, b, c), (d, c, b)):
        _add(count, np.stack(triangle, axis=1))
    # What differs from all places around, next to the curves, is taken from them.
    around = np.stack(
        [np.roll(count, s, (0, 1)) for s in product((-1, 0, 1), repeat=2) if s != (0, 0)]
    )
    return np.where((around != count).all(axis=0), np.sort(around, axis=0)[4], count)


def _add(count: Ints, corners: Array) -> None:
    """Add one to the places that are inside of each triangle (K, 3, 2)."""
    first = np.maximum(np.ceil(corners.min(axis=1)), 0).astype(np.int64)
    last = np.minimum(np.floor(corners.max(axis=1)), np.array(count.shape[::-1]) - 1)
    wide = last.astype(np.int64) - first + 1
    keep = (wide > 0).all(axis=1)
    corners, first, wide = corners[keep], first[keep], wide[keep]
    each = wide.prod(axis=1)
    which = np.repeat(np.arange(len(corners)), each)
    place = np.arange(int(each.sum())) - np.repeat(np.cumsum(each) - each, each)
    x = first[which] + np.stack([place % wide[which, 0], place // wide[which, 0]], axis=1)
    p = corners[which]
    e, g = np.roll(p, -1, axis=1) - p, x[:, None] - p
    side = e[..., 0] * g[..., 1] - e[..., 1] * g[..., 0]
    inside = (side > 0).all(axis=1) | (side < 0).all(axis=1)
    np.add.at(count, (x[inside, 1], x[inside, 0]), 1)


SAMPLES = 400
_COLOURS = ("#FFFFFF", "#E3EEF7", "#B8D4EA", "#86B6DB", "#5594C8", "#2F74B0", "#1B5590", "#123E6C")


@checked
def inverse_count(
    arm: Arm, ax: Axes | None = None, *, limits: bool = False, samples: int = SAMPLES
) -> Axes:
    """Draw the workspace of a 3-joint position arm, coloured by how many inverse solutions it has.

    The first joint turns and is taken to turn endlessly: half a plane through its axis shows all.
    Lines are where the arm is singular; cusps and nodes of these are marked. An arm with a cusp
    can change its posture without meeting a singularity (Omri and Wenger, 1995).

    Parameters
    ----------
    arm : Arm
        Three joints, the first of which turns, and the task "position".
    ax : Axes, optional
        Where to draw.
    limits : bool
        Whether the second and third joint end at their limits; slides always do.
    samples : int
        Places to each side.

    Returns
    -------
    Axes
        r, the distance from the first axis, along x; z along y, metres. The legend says the
        number of cusps and nodes.

    Raises
    ------
    OptionError
        If the arm is of another kind, or ``samples`` makes no sense.

    Examples
    --------
    >>> import pinsing
    >>> from pinsing import plot
    >>> arm = pinsing.load("ur5", task="position", tip="tool0", joints=[
    ...     "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"])
    >>> axes = plot.inverse_count(arm, samples=40)
    >>> [t.get_text() for t in axes.get_legend().get_texts()]
    ['4 solutions']
    """
    whole_number(samples, "samples", 20, 2000)
    found = reach_of(arm, samples, limits)
    ax = new_axes(4.2) if ax is None else ax
    most = int(found.count.max(initial=0))
    colours = [_COLOURS[min(k, len(_COLOURS) - 1)] for k in range(most + 1)]
    ax.pcolormesh(
        found.r, found.z, found.count, cmap=ListedColormap(colours), vmin=-0.5, vmax=most + 0.5,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    for curve in found.curves:
        ax.plot(curve[:, 0], curve[:, 1], color="#333333", linewidth=0.9)
    for k in np.unique(found.count[found.count > 0]).tolist():
        said = f"{k} solution{'s' * (k != 1)}"
        ax.plot([], [], "s", color=colours[k], markeredgecolor="#888888", label=said)
    for points, mark, colour, word in (
        (found.cusps, "o", "#D55E00", "cusp"),
        (found.nodes, "D", "#009E73", "node"),
    ):
        if len(points):
            said = f"{len(points)} {word}{'s' * (len(points) != 1)}"
            ax.plot(
                points[:, 0], points[:, 1], mark, color=colour, markersize=4.5, zorder=3,
                markeredgecolor="white", markeredgewidth=0.6, label=said,
            )  # fmt: skip
    ax.set(aspect="equal", xlim=(0, float(found.r[-1])))
    ax.set_xlabel("distance from the first axis, r [m]", fontsize=SMALL + 1)
    ax.set_ylabel("along it, z [m]", fontsize=SMALL + 1)
    ax.tick_params(labelsize=SMALL)
    where = "within the joint limits" if found.within_limits else "without joint limits"
    ax.set_title(f"{plain(arm.name)}: inverse solutions by position, {where}", fontsize=SMALL)
    legend_below(ax, 2, left=True)
    return ax
