"""How a mechanism is built, and how its loops close.

Of its structure: the legs between base and output, and passive joints that share a centre. Of its
loops: residuals, constraint Jacobians, generic ranks, Newton steps. One configuration goes through
Pinocchio's constraint models: a point anchor for loops of kind ``3d`` and ``planar`` (which keeps
its first two rows), a frame anchor for ``6d``. Arrays of configurations give the same numbers at
once. Rows of a loop are in the axes of its first frame; translations before rotations.

A planar loop may be closed by a dyad, exactly. The 5R (RR-RR) and the four-bar (RR-R): two links
meet in a pin P. Each hangs on the end of an actuated crank, or on a fixed pivot; so the passive
angles follow from the intersection of two circles.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing.errors import OptionError, PinsingError, Refusal
from pinsing.kinematics.jacobian import least_turns, rotation_vectors
from pinsing.measures import (
    ALIKE,
    NOISE,
    ROUNDING,
    SEED,
    SINGULAR_RTOL,
    SOLVED,
    Array,
    ArrayLike,
    Bool,
    NDArray,
)
from pinsing.robot.arm import kept
from pinsing.robot.mechanism import (
    Loop,
    Mechanism,
    Sample,
    closing,
    joint_axes,
    meeting_point,
    path_to,
)
from pinsing.robot.models import axis_rotation


@dataclass(frozen=True)
class Leg:
    """What connects base and output on a way of its own."""

    joints: tuple[int, ...]  # indices of its joints, in the model's order
    loops: tuple[int, ...]  # the loops that close it
    carries: bool  # whether the spanning tree reaches the output through it


@dataclass(frozen=True, eq=False)
class Centre:
    """Passive joints in a row whose axes meet in a point: a universal joint or a ball."""

    # indices, from the base outwards; a joint that shares its point with none is alone
    joints: tuple[int, ...]
    point: Array  # (3,): the common point, metres, in the frame of the first of the joints


@dataclass(frozen=True, eq=False)
class Structure:
    """Legs and centres of a mechanism."""

    output: int  # joint of the model that carries the output; 0 for the base itself
    legs: tuple[Leg, ...]  # in the order of their first joints
    centres: tuple[Centre, ...]  # all passive turning joints, each in one


class NotThisKind(Refusal):
    """The legs are others; the message says in which way."""


def at_zero(mechanism: Mechanism) -> Sample:
    """Everything with all joints at zero, in the base."""
    return Sample(mechanism, np.zeros(mechanism.n))


def plane_normal(mechanism: Mechanism, axes: Array) -> Array | None:
    """Normal (3,) of the plane in which joints with these axes (n, 3) move; None in space."""
    turning = ~mechanism.prismatic
    if not turning.any():
        return None
    normal = axes[int(np.argmax(turning))]
    normal = normal * np.sign(normal[int(np.argmax(np.abs(normal).round(6)))])
    flat = np.abs(np.abs(axes @ normal) - turning).max() <= ROUNDING
    return np.array(normal) if flat else None


def plane_axes(mechanism: Mechanism) -> tuple[Array, Array] | None:
    """Return axes of the base (rows) and output (columns) of the plane in which all moves, or None.

    The normal is the third; axes of the base are taken in turn where it is one of them. Those of
    the output are along them when its rotation is none but about the normal.
    """
    zero = at_zero(mechanism)
    normal = plane_normal(mechanism, zero.axis)
    if normal is None:
        return None
    k = int(np.argmax(np.abs(normal)))
    if abs(normal[k] - 1) <= ROUNDING:
        axes = np.roll(np.eye(3), 2 - k, axis=0)
    else:
        first = np.cross([0.0, 1.0, 0.0] if k != 1 else [0.0, 0.0, 1.0], normal)
        first /= np.linalg.norm(first)
        axes = np.array([first, np.cross(normal, first), normal])
    turned = axes @ zero.output.rotation
    for own in (axes.T, np.eye(3)):
        if abs((turned @ own)[2, 2] - 1) <= ROUNDING:
            return axes, np.array(own)
    return axes, np.array(turned.T)


def position_in(axes: Array, rows: Sequence[int]) -> bool:
    """Whether rows of a task are the position in a plane, whose axes are the first rows (2, 3)."""
    across = [k for k in range(3) if k not in rows]
    return set(rows) <= {0, 1, 2} and bool((np.abs(axes[:2, across]) <= ROUNDING).all())


def bodies(mechanism: Mechanism) -> tuple[tuple[int, int], ...]:
    """The two bodies (joints of the model, 0 the base) that each loop holds together."""
    frames = mechanism.model.frames
    a, b = ([int(frames[k].parentJoint) for k in side] for side in closing(mechanism))
    return tuple(zip(a, b, strict=True))


def loop_ends(mechanism: Mechanism) -> Iterator[tuple[Loop, int, int, list[int], list[int]]]:
    """Yield each loop, its frames, and the tree's ways to them; what leads to the output last."""
    frames, output = mechanism.model.frames, structure(mechanism).output
    for loop, a, b in zip(mechanism.loops, *closing(mechanism), strict=True):
        one, two = (path_to(mechanism, int(frames[k].parentJoint)) for k in (a, b))
        yield (loop, b, a, two, one) if output - 1 in one else (loop, a, b, one, two)


def idle_link(mechanism: Mechanism) -> str:
    """Return words on a link that turns by itself between passive joints of one axis; or ""."""
    model = mechanism.model
    busy = {b for pair in bodies(mechanism) for b in pair} | {structure(mechanism).output}
    for parent, j in _coaxial(mechanism):
        alone = sum(int(p) == parent + 1 for p in model.parents) == 1
        if {j, parent} & set(mechanism.actuated) or not alone or parent + 1 in busy:
            continue
        return (
            f"{mechanism.joints[parent]} and {mechanism.joints[j]} turn about one axis, and "
            "nothing else is on the link between them, so that it turns by itself: give it its "
            "length, or leave one of the two joints out"
        )
    return ""


def _coaxial(mechanism: Mechanism) -> list[tuple[int, int]]:
    """Joints that turn about the axis of the joint before them: that one, and they."""
    model, axes = mechanism.model, joint_axes(mechanism)
    out = []
    for j in range(mechanism.n):
        parent = int(model.parents[j + 1]) - 1
        if parent < 0 or mechanism.prismatic[[j, parent]].any():
            continue
        place = model.jointPlacements[j + 1]
        turned = np.array(place.rotation) @ axes[j]
        apart = np.cross(axes[parent], np.array(place.translation))
        if max(np.abs(np.cross(axes[parent], turned)).max(), np.abs(apart).max()) <= ROUNDING:
            out.append((parent, j))
    return out


def without_length(mechanism: Mechanism) -> str:
    """What is to be said of neighbours that turn about one axis, one of them driven; or nothing."""
    pairs = [
        f"{mechanism.joints[parent]} and {mechanism.joints[j]}"
        for parent, j in _coaxial(mechanism)
        if (j in mechanism.actuated) != (parent in mechanism.actuated)
    ]
    words = (
        f"{', '.join(pairs)} turn about one axis: the link between them has no length, and the "
        "driven one moves nothing; give the link its length"
    )
    return words if pairs else ""


@kept
def structure(mechanism: Mechanism) -> Structure:
    """Legs and centres of a mechanism."""
    output = int(mechanism.model.frames[mechanism.output_id].parentJoint)
    return Structure(output, _legs(mechanism, output), tuple(_centres(mechanism, output)))


def _legs(mechanism: Mechanism, output: int) -> tuple[Leg, ...]:
    """Connected parts of what remains without base and output."""
    n, fixed = mechanism.n, {0, output}
    edges = [(int(mechanism.model.parents[j + 1]), j + 1) for j in range(n)]
    edges += bodies(mechanism)
    group = list(range(n + 1))
    for a, b in edges:
        if not fixed & {a, b}:
            group = [group[b] if g == group[a] else g for g in group]
    # An edge from base to output is a leg of its own, known by a number no body has.
    of = [next((group[x] for x in e if x not in fixed), -1 - k) for k, e in enumerate(edges)]
    legs = []
    for key in dict.fromkeys(of):
        joints = tuple(k for k in range(n) if of[k] == key)
        loops = tuple(k - n for k in range(n, len(of)) if of[k] == key)
        legs.append(Leg(joints, loops, output - 1 in joints))
    return tuple(sorted(legs, key=lambda leg: leg.joints or (n,)))


def _centres(mechanism: Mechanism, output: int) -> list[Centre]:
    """Passive turning joints by the points that their axes share."""
    model, busy = mechanism.model, {b for pair in bodies(mechanism) for b in pair} | {output}
    zero = at_zero(mechanism)  # neighbours meet at all configurations or at none
    left, out = {j for j in mechanism.passive if not mechanism.prismatic[j]}, []

    def run(first: int) -> tuple[Centre, int]:
        """Joints from ``first`` on whose axes share a point, and how many sit in it."""
        chain, point = [first], zero.origins[first]
        while chain[-1] + 1 not in busy:
            after = [int(j) - 1 for j in model.children[chain[-1] + 1]]
            longer = [*chain, *after]
            if len(after) != 1 or after[0] not in left:
                break
            met = meeting_point(zero.axis[longer], zero.origins[longer])
            if met is None:
                break
            chain, point = longer, met
        away = np.linalg.norm(zero.origins[chain] - point, axis=1)
        start = np.array(zero.joints[first + 1].actInv(point))
        return Centre(tuple(chain), start), int((away <= ROUNDING).sum())

    while left:
        # An axis may pass through two centres: joints that sit in the point go first.
        runs = map(run, sorted(left))
        best = max(runs, key=lambda x: (x[1], len(x[0].joints), -x[0].joints[0]))[0]
        out.append(best)
        left -= set(best.joints)
    return sorted(out, key=lambda c: c.joints)


def likeness(mechanism: Mechanism, Q: Array, joints: Sequence[int] | None = None) -> Array:
    """Return numbers (N, k) that configurations Q (N, n) of one mode share."""
    # Only of ``joints`` (a leg's) where some are given.
    loops, scale, count = BatchLoops(mechanism), mechanism.length_scale, len(Q)
    placed = loops.place(Q)
    chosen = range(mechanism.n) if joints is None else joints
    balls = [c for c in structure(mechanism).centres if len(c.joints) > 2]
    held = {j for ball in balls for j in ball.joints}
    out: list[Array] = [np.zeros((count, 0))]
    if joints is None:
        R, p, _ = loops.output(Q, placed)
        out += [x / scale for x in (p, *(loops.frame(placed, a)[1] for a, *_ in loops.loops))]
        out.append(R.reshape(count, 9))
    out += [loops.centre(placed, c) / scale for c in balls if set(chosen) & set(c.joints)]
    for j in chosen:
        x, axis, at = Q[:, [j]], placed.axis[j], placed.position[j + 1]
        if j in mechanism.actuated:
            out += [x / scale] if mechanism.prismatic[j] else [np.cos(x), np.sin(x)]
        elif j not in held:
            # Its axis, and where it is nearest to the origin, or where the slide is.
            along = 0.0 if mechanism.prismatic[j] else (at * axis).sum(axis=1, keepdims=True)
            line = axis[:, :, None] * axis[:, None, :]
            out += [line.reshape(count, 9), (at - along * axis) / scale]
    return np.concatenate(out, axis=1)


def extent(mechanism: Mechanism, q: Array) -> float:
    """Return the greatest distance of two of base, joints and ends of links at q (n,), metres."""
    sample = Sample(mechanism, q)
    ends = {mechanism.output_id}.union(*closing(mechanism))
    places = (*sample.joints, *(sample.frames[k] for k in ends))
    points = np.array([place.translation for place in places])
    return max(float(np.linalg.norm(points[:, None] - points[None], axis=-1).max()), 1e-3)


def output_pose(mechanism: Mechanism, q: Array) -> pin.SE3:
    """Placement of the output frame at q (n,)."""
    return Sample(mechanism, q).output


def groups(
    marks: Iterable[Array], within: float = ALIKE, wrap: Callable[[Array], Array] = np.asarray
) -> list[list[int]]:
    """Numbers of marks (k,) that are alike; each group by its first one, in their order."""
    # ``wrap`` makes of a difference what counts of it.
    firsts: list[Array] = []
    out: list[list[int]] = []
    for k, mark in enumerate(marks):
        gaps = (np.abs(wrap(x - mark)).max(initial=0.0) for x in firsts)
        i = next((i for i, gap in enumerate(gaps) if gap <= within), len(out))
        if i == len(out):
            firsts.append(mark)
            out.append([])
        out[i].append(k)
    return out


def same(a: Array, b: Array) -> bool:
    """Whether two likenesses (k,) are of one mode."""
    return bool(np.abs(a - b).max(initial=0.0) <= ALIKE)


SPACE, PLANE, SPHERE = "space", "plane", "sphere"


def in_room(kind: str, whole: list[Any]) -> list[Any]:
    """Of six coordinates, those of the point before those of the turn, what a kind has."""
    return {SPACE: whole, PLANE: [whole[0], whole[1], whole[5]], SPHERE: whole[3:]}[kind]


SIZE = {kind: len(in_room(kind, [*range(6)])) for kind in (SPACE, PLANE, SPHERE)}
"""Dimension of the motions that each kind of mechanism has room for."""


@kept
def room_of(mechanism: Mechanism) -> tuple[str, Array, Array]:
    """Return ``space``, ``plane`` or ``sphere``: what the motions of all joints have room in."""
    # And the plane's normal, z where there is none, and the sphere's centre.
    drawn = Sample(mechanism, mechanism.space.sample(1, np.random.default_rng(SEED))[0])
    none, z = np.zeros(3), np.array([0.0, 0.0, 1.0])
    normal = plane_normal(mechanism, drawn.axis)
    if normal is not None:
        return PLANE, normal, none
    centre = None if mechanism.prismatic.any() else meeting_point(drawn.axis, drawn.origins)
    return (SPACE, z, none) if centre is None else (SPHERE, z, centre)


@dataclass(frozen=True, eq=False)
class Placed:
    """Placements of N configurations, metres."""

    # (n + 1, N, 3, 3): of each joint's frame, turned so that z is the axis; entry 0 is the base
    rotation: Array
    position: Array  # (n + 1, N, 3): of its origin
    axis: Array  # (n, N, 3): axes of the joints
    # (n + 1, N, 3): a point of each joint's axis: ``position``, but for what is turned about
    # another one
    pivot: Array


class BatchLoops:
    """Closure of the loops, and the motion of the output, of many configurations at once."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        model = mechanism.model
        # Bodies are turned so that the axes of all joints are their z axes.
        self.own = [np.eye(3), *map(axis_rotation, joint_axes(mechanism))]
        places = zip(model.parents[1:], model.jointPlacements[1:], self.own[1:], strict=True)
        self._steps = [self._fixed(int(k), place, turned) for k, place, turned in places]
        self._above = np.zeros((mechanism.n + 1, mechanism.n), dtype=bool)
        for body in range(1, mechanism.n + 1):
            self._above[body, path_to(mechanism, body)] = True
        fixed = [self._fixed(int(f.parentJoint), f.placement, np.eye(3)) for f in model.frames]
        self.loops = [
            (fixed[a], fixed[b], x.kind, x.rows)
            for x, a, b in zip(mechanism.loops, *closing(mechanism), strict=True)
        ]
        self._output = fixed[mechanism.output_id]
        self._scale = mechanism.length_scale
        self.units = mechanism.space.metric

    def _fixed(self, body: int, place: pin.SE3, turned: Array) -> tuple[int, Array]:
        """A body, and where something is on it (3, 4): axes that are turned, and the origin."""
        at = np.column_stack([place.rotation @ turned, place.translation])
        return body, np.asarray(self.own[body].T @ at)

    def place(self, Q: Array) -> Placed:
        """Placements of all joints at Q (N, n)."""
        count, n = Q.shape
        R, p, axis = (
            np.empty((n + 1, count, 3, 3)),
            np.empty((n + 1, count, 3)),
            np.empty((n, count, 3)),
        )
        placed = Placed(R, p, axis, p)
        R[0], p[0] = np.eye(3), 0.0
        c, s = np.cos(Q.T)[..., None], np.sin(Q.T)[..., None]
        for j, step in enumerate(self._steps):
            up, p[j + 1] = self.frame(placed, step)
            R[j + 1], axis[j] = up, up[..., 2]
            if self.mechanism.prismatic[j]:
                p[j + 1] += Q[:, j, None] * axis[j]
            else:
                R[j + 1, ..., 0] = c[j] * up[..., 0] + s[j] * up[..., 1]
                R[j + 1, ..., 1] = c[j] * up[..., 1] - s[j] * up[..., 0]
        return placed

    def frame(self, placed: Placed, which: tuple[int, Array]) -> tuple[Array, Array]:
        """Rotation (N, 3, 3) and origin (N, 3) of what is fixed to a body."""
        body, at = which
        # One product of matrices: of many small ones it takes many times as long.
        whole = (placed.rotation[body].reshape(-1, 3) @ at).reshape(-1, 3, 4)
        return whole[..., :3], placed.position[body] + whole[..., 3]

    def _velocity(self, placed: Placed, body: int, point: Array) -> tuple[Array, Array]:
        """Velocity of a point (N, 3) of a body, and its turning, per joint: (N, 3, n) each."""
        count, n = point.shape[0], self.mechanism.n
        linear, angular = np.zeros((count, 3, n)), np.zeros((count, 3, n))
        above = np.flatnonzero(self._above[body])
        axis = placed.axis[above]
        slides = self.mechanism.prismatic[above]
        moved = _cross(axis, point - placed.pivot[above + 1])
        moved[slides] = axis[slides]
        linear[:, :, above] = moved.transpose(1, 2, 0)
        angular[:, :, above] = np.where(slides[:, None, None], 0.0, axis).transpose(1, 2, 0)
        return linear, angular

    def closure(
        self, Q: Array, loops: tuple[int, ...] | None = None, placed: Placed | None = None
    ) -> tuple[Array, Array]:
        """Residual (N, k) and Jacobian (N, k, n) of loops at Q, lengths over the length scale."""
        placed = self.place(Q) if placed is None else placed
        errors, rows = [np.zeros((len(Q), 0))], [np.zeros((len(Q), 0, self.mechanism.n))]
        for k in range(len(self.loops)) if loops is None else loops:
            a, b, kind, count = self.loops[k]
            Ra, pa = self.frame(placed, a)
            Rb, pb = self.frame(placed, b)
            one, turn_a = self._velocity(placed, a[0], pb)
            two, turn_b = self._velocity(placed, b[0], pb)
            back = np.swapaxes(Ra, 1, 2)
            e = (back @ (pb - pa)[:, :, None])[:, :, 0] / self._scale
            J = back @ (two - one) / self._scale
            errors.append(e[:, : min(count, 3)])
            rows.append(J[:, : min(count, 3)])
            if kind == "6d":
                errors.append(rotation_vectors(back @ Rb))
                rows.append(back @ (turn_b - turn_a))
        return np.concatenate(errors, axis=1), np.concatenate(rows, axis=1) * self.units

    def centre(self, placed: Placed, centre: Centre) -> Array:
        """Where passive axes meet (N, 3)."""
        first = centre.joints[0] + 1
        local = self.own[first].T @ centre.point
        return np.asarray(placed.position[first] + placed.rotation[first] @ local)

    def output(self, Q: Array, placed: Placed | None = None) -> tuple[Array, Array, Array]:
        """Return rotation (N, 3, 3), position (N, 3) and Jacobian (N, 6, n) of the output."""
        # Base axes; lengths over the length scale in the Jacobian only.
        placed = self.place(Q) if placed is None else placed
        R, p = self.frame(placed, self._output)
        linear, angular = self._velocity(placed, self._output[0], p)
        return R, p, np.concatenate([linear / self._scale, angular], axis=1) * self.units


def newton(
    loops: BatchLoops,
    Q: Array,
    free: Bool,
    which: tuple[int, ...] | None = None,
    target: tuple[Array, Array, tuple[int, ...]] | None = None,
    steps: int = 60,
) -> tuple[Array, Array]:
    """Return configurations (N, n) and residuals (N,) of damped Gauss-Newton on many starts.

    Joints that are not ``free`` (n,) stay. ``which`` are the loops to close, all by default;
    ``target`` is a pose of the output to reach: rotation (3, 3) or (N, 3, 3), position (3,) or (N,
    3), and which of its six rows count.
    """
    Q = Q.copy()
    columns = np.flatnonzero(free)
    active = np.arange(len(Q))
    for _ in range(steps + 1):
        if not len(active):
            break
        error, J = _system(loops, Q[active], which, target, active)
        moving = np.abs(error).max(axis=1, initial=0.0) > 1e-13
        step = _step(J[:, :, columns][moving], error[moving])
        longest = np.abs(step).max(axis=1, initial=0.0)
        step *= np.minimum(1.0, 0.5 / np.maximum(longest, 1e-300))[:, None]
        active = active[moving]
        Q[np.ix_(active, columns)] += step * loops.units[columns]
        # What has stopped moving without having arrived is at a minimum that is not zero.
        active = active[longest > 1e-12]
    error, _ = _system(loops, Q, which, target, np.arange(len(Q)))
    return Q, np.abs(error).max(axis=1, initial=0.0)


def _system(
    loops: BatchLoops,
    X: Array,
    which: tuple[int, ...] | None,
    target: tuple[Array, Array, tuple[int, ...]] | None,
    active: NDArray[np.intp],
) -> tuple[Array, Array]:
    placed = loops.place(X)
    error, J = loops.closure(X, which, placed)
    if target is not None:
        rotation, position, rows = target
        rotation = rotation if rotation.ndim == 2 else rotation[active]
        position = position if position.ndim == 1 else position[active]
        R, p, K = loops.output(X, placed)
        away = R @ np.swapaxes(rotation, -1, -2)
        free = [k for k in range(3) if k + 3 not in rows]
        if len(free) == 1:
            # The other turns bring the axis of this one into place.
            k, unit = free[0], np.broadcast_to(np.eye(3), away.shape)
            turn = least_turns(unit[:, k], away[:, :, k], unit[:, k - 1])
        else:
            turn = rotation_vectors(away)
        miss = np.concatenate([(p - position) / loops.mechanism.length_scale, turn], axis=1)
        error = np.concatenate([error, miss[:, list(rows)]], axis=1)
        J = np.concatenate([J, K[:, list(rows)]], axis=1)
    return error, J


def _step(J: Array, error: Array) -> Array:
    """Least steps of Levenberg and Marquardt; the damping goes with the square of the error."""
    damping = 1e-13 + 1e-3 * np.minimum(1.0, (error**2).sum(axis=1))
    Jt = np.swapaxes(J, 1, 2)
    wide = J.shape[1] <= J.shape[2]
    A = J @ Jt if wide else Jt @ J
    # Of long links the products are so large that this would be rounded away.
    damping = np.maximum(damping, 1e-15 * np.trace(A, axis1=1, axis2=2))
    A = A + damping[:, None, None] * np.eye(A.shape[-1])
    e = error[:, :, None]
    return np.asarray(
        -(Jt @ np.linalg.solve(A, e) if wide else np.linalg.solve(A, Jt @ e))[:, :, 0]
    )


def _cross(a: Array, b: Array) -> Array:
    """Vector products over the last axis; NumPy's own takes many times as long for few."""
    (x, y, z), (u, v, w) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def locked(loops: BatchLoops, Q: Array) -> Bool:
    """Whether a ball is locked, or nearly: (N,) bool at Q (N, n)."""
    out, balls = np.zeros(len(Q), dtype=bool), hinged_balls(loops.mechanism)
    if balls:
        axis = loops.place(Q).axis
        for ball in balls:
            # Near: the volume that the three axes span is at most a tenth of what it can be.
            out |= np.abs(np.linalg.det(np.swapaxes(axis[list(ball.joints)], 0, 1))) <= 0.1
    return out


def ball_jacobians(loops: BatchLoops, Q: Array) -> tuple[Array, Array]:
    """Return the constraint Jacobian (N, k, n) and output rows (N, m, n), balls taken as one."""
    # Columns of a ball's three hinges are of its angular velocity, base axes; lengths are over the
    # length scale.
    mechanism = loops.mechanism
    placed = loops.place(Q)
    axis, pivot = placed.axis.copy(), placed.position.copy()
    for ball in hinged_balls(mechanism):
        at = loops.centre(placed, ball)
        for joint, along in zip(ball.joints, np.eye(3), strict=True):
            axis[joint], pivot[joint + 1] = along, at
    whole = replace(placed, axis=axis, pivot=pivot)
    G = loops.closure(Q, placed=whole)[1]
    return G, loops.output(Q, whole)[2][:, list(mechanism.task.rows)]


def hinge_rates(loops: BatchLoops, q: Array, basis: Array) -> Array:
    """Return joint velocities (n, d) of motions (n, d) at q in which balls count as one."""
    # Three hinges in a plane show of a turn what they can: its part in that plane.
    out = basis.copy()
    axis = loops.place(q[None]).axis[:, 0]
    for ball in hinged_balls(loops.mechanism):
        rows = list(ball.joints)
        out[rows] = np.linalg.pinv(axis[rows].T, rcond=1e-6) @ basis[rows]
    return out


def hinged_balls(mechanism: Mechanism) -> tuple[Centre, ...]:
    """Balls of three hinges that carry nothing between them, with their centres."""
    return tuple(c for c in structure(mechanism).centres if len(c.joints) == 3)


_STEP = 0.03
_FAR = 30.0


@kept
def to_its_size(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism on a length scale of its own size, where that is far from the given."""
    # Newton's steps depend on it: columns of a linkage of millimetres are lost beside those of
    # turning.
    ends = np.array([mechanism.lower, mechanism.upper])[:, mechanism.prismatic]
    size = max(_longest(mechanism), float(np.abs(ends[np.isfinite(ends)]).max(initial=0.0)))
    near = size == 0 or 1 / _FAR <= size / mechanism.length_scale <= _FAR
    return mechanism if near else replace(mechanism, length_scale=size)


def _longest(mechanism: Mechanism) -> float:
    """The longest shift from one joint, or frame, to the next, metres."""
    model = mechanism.model
    places = [*model.jointPlacements, *(f.placement for f in model.frames)]
    return max(float(np.linalg.norm(p.translation)) for p in places)


class Loops:
    """Pinocchio's constraint models of a mechanism with data of their own: one per thread."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        model = mechanism.model
        self._data = model.createData()
        self._output = mechanism.output_id
        self._task = np.array(mechanism.task.rows)
        self._anchors = []
        scales: list[float] = []
        for loop, i, k in zip(mechanism.loops, *closing(mechanism), strict=True):
            a, b = model.frames[i], model.frames[k]
            kind = (
                pin.FrameAnchorConstraintModel
                if loop.kind == "6d"
                else pin.PointAnchorConstraintModel
            )
            anchor = kind(model, a.parentJoint, a.placement, b.parentJoint, b.placement)
            self._anchors.append((anchor, anchor.createData(), loop.rows))
            scales += [1 / mechanism.length_scale if row < 3 else 1.0 for row in range(loop.rows)]
        self._neutral = pin.neutral(model)
        self.row_scale = np.array(scales)
        self.column_scale = mechanism.space.metric
        self.task_scale = np.where(self._task < 3, 1 / mechanism.length_scale, 1.0)

    def model_q(self, q: Array) -> Array:
        """Pinocchio's configuration for q (n,), without checks."""
        return np.asarray(pin.integrate(self.mechanism.model, self._neutral, q))

    def at(self, q: Array) -> tuple[Array, Array]:
        """Residual (k,) and constraint Jacobian (k, n) at q (n,), metres and radians."""
        model, data = self.mechanism.model, self._data
        # The order matters: without calc() the Jacobian is silently that of the last call.
        pin.computeJointJacobians(model, data, self.model_q(q))
        residual, rows = [], []
        for anchor, store, count in self._anchors:
            anchor.calc(model, data, store)
            residual.append(np.array(store.constraint_position_error)[:count])
            rows.append(np.array(anchor.jacobian(model, data, store))[:count])
        return np.concatenate(residual), np.vstack(rows)

    def scaled(self, q: Array) -> tuple[Array, Array]:
        """Residual and Jacobian without units: lengths are over the length scale."""
        residual, G = self.at(q)
        return residual * self.row_scale, G * self.row_scale[:, None] * self.column_scale

    def output(self, q: Array) -> tuple[pin.SE3, Array]:
        """Placement of the output frame and its task rows (m, n), metres and radians."""
        model, data = self.mechanism.model, self._data
        J = pin.computeFrameJacobian(
            model, data, self.model_q(q), self._output, pin.LOCAL_WORLD_ALIGNED
        )
        return pin.SE3(pin.updateFramePlacement(model, data, self._output)), np.array(J)[self._task]

    def output_scaled(self, q: Array) -> Array:
        """Output Jacobian without units (m, n)."""
        return np.asarray(self.output(q)[1] * self.task_scale[:, None] * self.column_scale)


@dataclass(frozen=True)
class Ranks:
    """Generic ranks of a mechanism, on its loop-closed configurations."""

    # of the constraint Jacobian; less than its rows where loops are overconstrained (planar ones
    # closed in space)
    constraint: int
    mobility: int  # dimension of the motions: joints minus the rank of the constraints
    output: int  # of the output velocity over all motions


@kept
def passive_joints(mechanism: Mechanism) -> Bool:
    """Which joints (n,) carry no actuator."""
    return np.isin(np.arange(mechanism.n), mechanism.passive)


def residual(mechanism: Mechanism, q: ArrayLike) -> Array:
    """Return the loop-closure error at q (n,): (k,), metres and radians."""
    return Loops(mechanism).at(mechanism.check(q))[0]


def gauss_newton(
    loops: Loops,
    q: Array,
    free: Bool | slice = slice(None),
    steps: int = 60,
    reach: float = np.inf,
    more: Callable[[Array], tuple[Array, Array]] | None = None,
) -> tuple[Array, float]:
    """Close the loops by moving ``free`` joints least: configuration and residual."""

    # No further than ``reach``, and to where ``more`` is zero as well: values, and their slopes (k,
    # n) without units. Steps are cut at half a radian (half a length scale): else they would jump
    # between assembly modes.
    def system(q: Array) -> tuple[Array, Array]:
        error, G = loops.scaled(q)
        values, slopes = (np.zeros(0), np.zeros((0, len(q)))) if more is None else more(q)
        return np.append(error, values), np.vstack([G, slopes])

    start, best, q = q, np.inf, q.copy()
    kept = start
    for _ in range(steps):
        error, G = system(q)
        size = float(np.abs(error).max())
        if size >= best and best <= SOLVED:
            break
        best, kept = size, q.copy()
        step = np.linalg.lstsq(G[:, free], -error, rcond=1e-11)[0]
        longest = float(np.abs(step).max(initial=0.0))
        if longest > 0.5:
            step *= 0.5 / longest
        q[free] += step * loops.column_scale[free]
        if not np.isfinite(q).all() or np.abs(q - start).max() > reach:
            return kept, best
        if size <= 1e-15:
            break
    last = float(np.abs(system(q)[0]).max())
    return (q, last) if last <= best else (kept, best)


def random_closed(mechanism: Mechanism, count: int, rng: np.random.Generator) -> list[Array]:
    """Closed configurations that random starts lead to."""
    reach = np.where(mechanism.prismatic, mechanism.length_scale, np.pi)
    return _closed_from(mechanism, rng.uniform(-1, 1, (count, mechanism.n)) * reach)


def _closed_from(mechanism: Mechanism, starts: Array) -> list[Array]:
    """Closed configurations that starts (N, n) lead to."""
    loops = Loops(mechanism)
    found = (gauss_newton(loops, q) for q in starts)
    return [mechanism.space.wrap(q) for q, error in found if error <= SOLVED]


def near_home(mechanism: Mechanism) -> list[Array]:
    """Closed configurations from home and from starts around it."""
    away = np.array([0.0, *np.repeat((0.05, 0.2), 4)])[:, None]
    drawn = np.random.default_rng(SEED).uniform(-1, 1, (len(away), mechanism.n))
    return _closed_from(mechanism, mechanism.home + away * drawn * mechanism.space.metric)


def _beside_home(mechanism: Mechanism, loops: Loops) -> list[Array]:
    """Return a few closed configurations beside a closed home, on its branch, or none."""
    # Only where fewer constraints are independent there than elsewhere, and motions of a finite
    # length show that this is no single point.
    q, error = gauss_newton(loops, mechanism.home)
    if error > SOLVED or np.abs(loops.scaled(mechanism.home)[0]).max() > 1e-6:
        return []
    out = [q]
    for away in (_STEP, -_STEP):
        at = q
        for _ in range(4):
            G = loops.scaled(at)[1]
            free = np.linalg.svd(G)[2][_rank(G, 1e-7) :]
            if not len(free):
                return []
            drawn = np.random.default_rng(SEED).normal(size=len(free)) @ free
            start = at + away * drawn / np.linalg.norm(drawn) * loops.column_scale
            at, error = gauss_newton(loops, start)
            if error > SOLVED or np.abs((at - start) / loops.column_scale).max() > _STEP / 2:
                return []
            out.append(at)
    # A rank that changes at once is that of a singular point: the others tell what is generic.
    counted = {_rank(loops.scaled(x)[1], 1e-7) for x in out}
    return out if len(counted) == 1 else []


def _rank(M: Array, rtol: float, size: float | None = None) -> int:
    """Singular values that are more than ``rtol`` times the largest, or another size."""
    sigma = np.linalg.svd(M, compute_uv=False)
    return int((sigma > rtol * (sigma[0] if size is None else size)).sum())


@kept
def ranks(mechanism: Mechanism) -> Ranks:
    """Return the generic ranks, from closed configurations drawn at random (seeded).

    Raises
    ------
    PinsingError
        If the loops close nowhere.
    OptionError
        If fewer joints are actuated than there are degrees of freedom. More are redundant
        actuation, and taken as such.
    """
    idle = idle_link(mechanism)
    PinsingError.refuse_if(idle, f"{mechanism.name}: {idle}")
    loops = Loops(mechanism)
    # Branches may differ in their mobility: that of home is meant, where home closes the loops.
    around = _beside_home(mechanism, loops)
    around = around or random_closed(mechanism, 12, np.random.default_rng(SEED))
    if len(around) < 3:
        around += near_home(mechanism)
    if not around:
        size = _longest(mechanism)
        advice = "check the frames, the lengths and the kinds of the loops"
        if size > 20.0 * mechanism.length_scale:
            advice = (
                f"lengths of the file are up to {size:.3g} m; if they are in millimetres, write "
                "them in metres or give a length scale (--length-scale "
                f"{10 ** round(np.log10(size)):.0f})"
            )
        raise PinsingError(
            f"{mechanism.name}: the loops {', '.join(str(x) for x in mechanism.loops)} close "
            f"nowhere, as far as was looked: {advice}"
        )
    found = [loops.scaled(q)[1] for q in around]
    known = [_rank(G, SINGULAR_RTOL) for G in found]
    rank, output = max(known), 0
    PinsingError.refuse_if(
        rank == mechanism.n,
        f"{mechanism.name}: the loops leave no motion ({mechanism.n} joints, "
        f"{rank} independent constraints): check the kinds of the loops",
    )
    for q, G, here in zip(around, found, known, strict=True):
        if here == rank:
            J = loops.output_scaled(q)
            moved = J @ np.linalg.svd(G)[2][rank:].T
            output = max(output, _rank(moved, SINGULAR_RTOL, float(np.linalg.norm(J, 2))))
    mobility, count = mechanism.n - rank, len(mechanism.actuated)
    OptionError.refuse_if(
        mobility > count,
        f"{mechanism.name} has {mobility} degrees of freedom, but {count} "
        f"{'joints are' if count > 1 else 'joint is'} actuated ({', '.join(mechanism.inputs)}): "
        f"name_mot must list {mobility} or more",
    )
    return Ranks(rank, mobility, output)


@dataclass(frozen=True, eq=False)
class Dyad:
    """The loop of a mechanism that two links close in a pin P; points are complex numbers, metres.

    Arrays have an entry for each side, the first as in the loop's first frame; vectors are those
    with all joints at zero.
    """

    mechanism: Mechanism  # the whole
    basis: Array  # (2, 3): axes of the plane, in those of the root
    pivots: Any  # fixed points A
    arms: Any  # from A to B; none where the link of the dyad hangs on A itself (B = A)
    links: Any  # from B to P
    cranks: NDArray[np.int_]  # joints that turn the arms; -1 where there is none
    senses: Array  # of these joints in the plane; 0 where there is none
    pins: NDArray[np.int_]  # passive joints at B
    pin_senses: Array

    @property
    def rods(self) -> Array:
        """Lengths of both links, metres."""
        return np.asarray(abs(self.links))

    def turns(self, q: Array) -> Any:
        """By what the cranks turn their links (..., 2) at q (..., n)."""
        return np.exp(1j * self.senses * q[..., self.cranks])

    def _driven(self, inputs: ArrayLike) -> Array:
        """Configurations (..., n) with passive joints at zero."""
        q = np.zeros((*np.shape(inputs)[:-1], self.mechanism.n))
        q[..., list(self.mechanism.actuated)] = inputs
        return q

    def ends(self, inputs: ArrayLike) -> Any:
        """Points B1 and B2 (..., 2) that the dyad hangs on, at inputs (..., n_a)."""
        return self.pivots + self.turns(self._driven(inputs)) * self.arms

    def pin(self, inputs: ArrayLike, left: bool, slack: float = NOISE) -> Any:
        """P (...) at inputs (..., n_a), to the left or right of B1 -> B2; NaN if infeasible."""
        # Circles of the rods that miss each other by ``slack``, of a squared rod, touch.
        first, second = np.moveaxis(self.ends(inputs), -1, 0)
        (d1, d2), distance = self.rods, abs(second - first)
        with np.errstate(invalid="ignore", divide="ignore"):
            along = (distance**2 + d1**2 - d2**2) / (2 * distance)
            square = d1**2 - along**2
            square = np.where(np.abs(square) <= slack * d1**2, 0.0, square)
            height = np.sqrt(square) * (1 if left else -1)
            return first + (along + 1j * height) * (second - first) / distance

    def configuration(self, inputs: ArrayLike, left: bool, slack: float = NOISE) -> Array:
        """All joints (..., n) of one assembly mode at inputs (..., n_a); NaN if infeasible."""
        return self.reaching(inputs, self.pin(inputs, left, slack))

    def reaching(self, inputs: ArrayLike, P: Any) -> Array:
        """All joints (..., n) at inputs (..., n_a) whose rods reach for P (...)."""
        q = self._driven(inputs)
        away = np.asarray(P)[..., None] - self.ends(inputs)
        q[..., self.pins] = self.pin_senses * np.angle(away / (self.turns(q) * self.links))
        return self.mechanism.space.wrap(q)

    def bend(self, q: ArrayLike, leg: int | None) -> Any:
        """Turn (...) from the crank to the rod of a leg, or from rod to rod, at q (..., n).

        1 where they are stretched, -1 where folded.
        """
        q = np.asarray(q, dtype=float)
        turned = np.exp(1j * self.pin_senses * q[..., self.pins]) * self.links / self.rods
        if leg is not None:
            return (turned * np.exp(-1j * np.angle(self.arms)))[..., leg]
        one, two = np.moveaxis(self.turns(q) * turned, -1, 0)
        return -np.conj(one) * two

    def at_pin(self) -> bool:
        """Whether the output is the position of the pin, in the plane."""
        mechanism, frames = self.mechanism, self.mechanism.model.frames
        output = frames[mechanism.output_id]
        pins = [frames[k] for (k,) in closing(mechanism)]
        meets = any(
            output.parentJoint == p.parentJoint
            and np.allclose(output.placement.translation, p.placement.translation, atol=1e-12)
            for p in pins
        )
        return meets and position_in(self.basis, mechanism.task.rows)

    def close(self, inputs: ArrayLike, slack: float = NOISE) -> tuple[Array, ...]:
        """Return all configurations (n,) at inputs (n_a,): two, one at type 2, or none."""
        # Two of many where both links are equally long and their ends coincide: P is free on a
        # circle.
        inputs = self.mechanism.check_inputs(inputs)
        first, second = self.ends(inputs)
        d1, d2 = self.rods
        if abs(second - first) <= NOISE and np.isclose(d1, d2, rtol=1e-12):
            return tuple(self.reaching(inputs, first + way) for way in (d1, -d1))
        ways = [self.configuration(inputs, left, slack) for left in (True, False)]
        found = [q for q in ways if np.isfinite(q).all()]
        return tuple(found[k] for k, *_ in groups(found, 1e-12, self.mechanism.space.wrap))

    def working_modes(self, point: complex) -> tuple[Array, ...]:
        """All configurations (n,) that put the pin at a point of the plane: up to four."""
        values: list[list[float]] = []
        sides = zip(self.pivots, self.arms, self.rods, self.cranks, self.senses, strict=True)
        for pivot, arm, rod, crank, sense in sides:
            far, length = abs(point - pivot), abs(arm)
            if crank < 0:
                values.append([0.0] if abs(far - rod) <= 1e-9 * rod else [])
                continue
            cosine = (far**2 + length**2 - rod**2) / (2 * far * length) if far > 0 else np.inf
            away = float(np.angle((point - pivot) / arm))
            bend = float(np.arccos(np.clip(cosine, -1, 1)))
            turns = [] if abs(cosine) > 1 + NOISE else [bend, -bend] if bend > 0 else [0.0]
            values.append([sense * (away + turn) for turn in turns])
        order = [self.cranks.tolist().index(j) for j in self.mechanism.actuated]
        every = itertools.product(*values)
        return tuple(self.reaching(np.array(pair)[order], point) for pair in every)


@kept
def planar_dyad(mechanism: Mechanism) -> Dyad | None:
    """Return the dyad that closes a single planar loop; None if the mechanism is another."""
    # Asked for: one loop; each of its frames at the end of an actuated crank and a passive link, or
    # of a passive link alone; all axes parallel; both frames in one plane; no other joint.
    zero, plane = at_zero(mechanism), plane_axes(mechanism)
    kinds = [loop.kind for loop in mechanism.loops]
    if kinds not in (["planar"], ["3d"]) or mechanism.prismatic.any() or plane is None:
        return None
    basis, normal = plane[0][:2], plane[0][2]
    paths = [path_to(mechanism, body) for body in bodies(mechanism)[0]]
    ends = np.array([zero.frames[k].translation for (k,) in closing(mechanism)])
    # Ends that miss each other along the axes never close as points in space.
    apart = kinds == ["3d"] and abs(float((ends[0] - ends[1]) @ normal)) > 1e-9
    driven = [[j in mechanism.actuated for j in path] for path in paths]
    if apart or sum(map(len, paths)) != mechanism.n or any(
        x not in ([True, False], [False]) for x in driven
    ):  # fmt: skip
        return None
    first, pins = np.array([[path[0], path[-1]] for path in paths]).T
    cranks = np.where(first == pins, -1, first)
    A, B, P = ((x @ basis.T) @ [1, 1j] for x in (zero.origins[first], zero.origins[pins], ends))
    if (P == B).any() or ((B == A) & (cranks >= 0)).any():
        return None
    senses = np.sign(zero.axis @ normal)
    cranked = np.where(cranks < 0, 0.0, senses[cranks])
    return Dyad(mechanism, basis, A, B - A, P - B, cranks, cranked, pins, senses[pins])
