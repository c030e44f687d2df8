"""How a mechanism is built: the legs between base and output, and joints that share a centre."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing.errors import Refusal
from pinsing.loops.exact import Turn, rational_turn, turn_to
from pinsing.measures import ALIKE, ROUNDING, SEED, Array
from pinsing.robot.mechanism import (
    Loop,
    Mechanism,
    Sample,
    closing,
    joint_axes,
    meeting_point,
    path_to,
)
from pinsing.robot.source import kept


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
    model = mechanism.model
    ends = [(int(model.parents[j + 1]), j + 1) for j in range(mechanism.n)]
    ends += bodies(mechanism)
    fixed = {0, output}
    group = list(range(model.njoints))
    for a, b in ends:
        if not fixed & {a, b}:
            group = [group[b] if g == group[a] else g for g in group]
    parts: dict[int, tuple[list[int], list[int]]] = {}
    for k, (a, b) in enumerate(ends):
        inner = [x for x in (a, b) if x not in fixed]
        # An edge from base to output is a leg of its own, known by a number no body has.
        key = group[inner[0]] if inner else -1 - k
        joints, loops = parts.setdefault(key, ([], []))
        (joints if k < mechanism.n else loops).append(k if k < mechanism.n else k - mechanism.n)
    found = (Leg(tuple(own), tuple(loops), output - 1 in own) for own, loops in parts.values())
    return tuple(sorted(found, key=lambda leg: leg.joints or (mechanism.n,)))


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


def likeness(mechanism: Mechanism, q: Array, joints: Sequence[int] | None = None) -> Array:
    """Return numbers (k,) that two configurations q (n,) of one mode share."""
    # Only of ``joints`` (a leg's) where some are given.
    sample, scale = Sample(mechanism, q), mechanism.length_scale
    chosen = range(mechanism.n) if joints is None else joints
    out: list[Array] = []
    if joints is None:
        places = [sample.output, *(sample.frames[k] for k in closing(mechanism)[0])]
        out += [place.translation / scale for place in places]
        out.append(np.array(sample.output.rotation).ravel())
    for j in chosen:
        if j in mechanism.actuated:
            slides = mechanism.prismatic[j]
            out.append(np.array([q[j] / scale] if slides else [np.cos(q[j]), np.sin(q[j])]))
        elif mechanism.prismatic[j]:
            out += [np.outer(sample.axis[j], sample.axis[j]).ravel(), sample.origins[j] / scale]
    for centre in (c for c in structure(mechanism).centres if set(chosen) & set(c.joints)):
        if len(centre.joints) > 1:
            out.append(np.array(sample.joints[centre.joints[0] + 1].act(centre.point)) / scale)
        for j in centre.joints if len(centre.joints) <= 2 else ():
            axis, at = sample.axis[j], sample.origins[j]
            out.append(np.outer(axis, axis).ravel())
            if len(centre.joints) == 1:
                out.append((at - (at @ axis) * axis) / scale)
    return np.concatenate(out) if out else np.zeros(0)


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
def room_of(mechanism: Mechanism) -> tuple[str, Turn, Array]:
    """Return ``space``, ``plane`` or ``sphere``: what the motions of all joints have room in."""
    # And the turn that makes the plane's normal z, and the sphere's centre.
    drawn = Sample(mechanism, mechanism.space.sample(1, np.random.default_rng(SEED))[0])
    still, none = rational_turn(np.eye(3)), np.zeros(3)
    normal = plane_normal(mechanism, drawn.axis)
    if normal is not None:
        return PLANE, rational_turn(turn_to(normal).T), none
    centre = None if mechanism.prismatic.any() else meeting_point(drawn.axis, drawn.origins)
    if centre is not None:
        return SPHERE, still, centre
    return SPACE, still, none
