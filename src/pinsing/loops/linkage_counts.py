"""How many modes there are, by algebra: one rod in a loop, hinges at the feet, a level output.

One rod that ties two links, each on one joint (four-bar, RSSR, slider-crank): with one of the
joints given its length is a quadratic equation of the other. Three legs on hinges (3-RPS): a height
and a tilt of the output leave two solutions of a line and a circle, and each leg two lengths. An
output that keeps the axes of the base (Delta): its position is on three spheres, and each crank has
the two solutions of a quadratic equation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pinsing._types import Array
from pinsing.loops.likeness import output_pose
from pinsing.loops.mode_counts import TOUCHING, count_working, inside, values
from pinsing.loops.modes import home
from pinsing.loops.rod import Rod, Sample
from pinsing.loops.rods import carried, rods
from pinsing.loops.structure import structure
from pinsing.loops.three_distances import count_poses, rod_length
from pinsing.loops.three_pins import count_of_point, count_triangles
from pinsing.robot.mechanism import Mechanism

_SMALL = 1e-9
_LEVEL = 1e-7


def number_of_modes(
    mechanism: Mechanism,
    inputs: Array,
    target: tuple[Array, Array, tuple[int, ...]] | None,
    found: Sequence[Array],
) -> tuple[int | None, str]:
    """Poses at inputs (n_a,), limits left aside, or values of the inputs for a target pose.

    With words for how they are counted; None where algebra does not tell. ``found``: one
    configuration for each pose.
    """
    number = count_one_rod(mechanism, found, target is None)
    if number is not None:
        return number, "the quadratic equation of its rod"
    if target is None:
        number = count_triangles(mechanism, found)
        if number is not None:
            return number, "the triangle of its three pins"
        return count_poses(mechanism, inputs), "the real roots of a polynomial of degree 6"
    number = count_of_point(mechanism, target[1])
    if number is not None:
        return number, "the two solutions of each leg"
    number = count_hinged(mechanism, target[0], target[1])
    if number is not None:
        return number, "the planes of its hinges and the two solutions of each leg"
    return count_working(mechanism, target[0], target[1]), "the two solutions of each leg"


def count_one_rod(mechanism: Mechanism, found: Sequence[Array], direct: bool) -> int | None:
    """Poses (direct), or working modes within limits, of one rod between two joints, or None.

    ``found``: configurations; that they agree in the joint that is given is looked at.
    """
    ends = _one_rod(mechanism)
    if ends is None or not found:
        return None
    driven, other = ends
    carries = structure(mechanism).output - 1
    if carries != other or not (direct or _shown(mechanism, other)):
        return None
    given, sought = (driven, other) if direct else (other, driven)
    at = np.array([q[given] for q in found])
    if np.abs(mechanism.space.wrap(np.array(found) - found[0])[:, given]).max() > _SMALL:
        return None
    zero = Sample(mechanism, structure(mechanism), np.zeros(mechanism.n), np.eye(3), np.eye(3))
    start = Sample(mechanism, structure(mechanism), home(mechanism), np.eye(3), np.eye(3))
    points = dict(zip(ends, _ends(mechanism, zero), strict=True))
    length = float(np.linalg.norm(np.subtract(*_ends(mechanism, start))))
    held = carried(mechanism, zero, given, points[given], np.zeros(3))
    moving = carried(mechanism, zero, sought, points[sought], np.zeros(3))
    if held is None or moving is None:
        return None
    roots = values(mechanism, moving, _at(mechanism, held, float(at[0])), False, length)
    if roots is None or direct:
        return None if roots is None else len(roots)
    return sum(inside(mechanism, sought, v) for v in roots)


def count_hinged(mechanism: Mechanism, R: Array, p: Array) -> int | None:
    """Working modes of three legs on hinges within the limits of their slides; None of others."""
    made = rods(mechanism)
    if made is None or made.planar or len(made.rods) != 3:
        return None
    if any(r.hinge is None or not r.slides for r in made.rods):
        return None
    rows = set(mechanism.task.rows)
    moves, turns = [k for k in range(3) if k in rows], [k for k in range(3) if k + 3 in rows]
    if (len(moves), len(turns)) != (1, 2):
        return None
    poses = _hinged_poses(made.rods, R, p, moves[0], 3 - sum(turns))
    if poses is None:
        return None
    total = 0
    for turned, at in poses:
        count = 1
        for rod in made.rods:
            reach = float(np.linalg.norm(at + turned @ rod.outer - rod.inner))
            if reach <= TOUCHING:
                return None
            count *= sum(inside(mechanism, rod.joint, v - rod.offset) for v in (reach, -reach))
        total += count
    return total


def _hinged_poses(
    legs: Sequence[Rod], R: Array, p: Array, move: int, turn: int
) -> list[tuple[Array, Array]] | None:
    """Poses at this height and tilt that keep each leg's end in the plane across its hinge."""
    axis, across = np.eye(3)[turn], [k for k in range(3) if k != move]
    height = p[move] * np.eye(3)[move]
    rows, right = [], []
    for rod in legs:
        n, v = rod.hinge, R @ rod.outer
        assert n is not None
        along = (v @ axis) * axis
        rows.append([*(n[k] for k in across), n @ (v - along), n @ np.cross(axis, v)])
        right.append(n @ (rod.inner - along - height))
    U, sigma, Vt = np.linalg.svd(np.array(rows))
    if sigma[-1] <= 1e-9 * sigma[0]:
        return None
    x = Vt[:3].T @ ((U.T @ np.array(right)) / sigma)
    v = Vt[3]
    # cos^2 + sin^2 = 1 along the line x + t v.
    a, b, c = v[2:] @ v[2:], 2 * x[2:] @ v[2:], x[2:] @ x[2:] - 1
    left = b * b - 4 * a * c
    if a <= TOUCHING or abs(left) <= TOUCHING:
        return None
    out = []
    for t in () if left < 0 else ((-b + np.sqrt(left)) / (2 * a), (-b - np.sqrt(left)) / (2 * a)):
        y = x + t * v
        c_, s_ = y[2:]
        K = np.cross(np.eye(3), axis).T
        turned = (np.eye(3) + s_ * K + (1 - c_) * (K @ K)) @ R
        at = height.copy()
        at[across] = y[:2]
        out.append((turned, at))
    return out


def level_words(mechanism: Mechanism, found: Sequence[Array], direct: bool, p: Array) -> str:
    """How many of the configurations keep the output's axes, against what algebra gives; or none.

    ``found``: those within the limits; ``p`` (3,) is the position of the inverse problem.
    """
    pairs = _level_pairs(mechanism)
    if pairs is None:
        return ""
    mine = [q for q in found
            if np.abs(output_pose(mechanism, q).rotation - np.eye(3)).max() <= _LEVEL]  # fmt: skip
    if direct:
        q = found[0] if len(found) else home(mechanism)
        number, by = _three_spheres(mechanism, pairs, q), "three spheres"
    else:
        number, by = _cranks(mechanism, pairs, p), "the two solutions of each crank"
    if number is None:
        return ""
    all_ = "all there are" if number == len(mine) else f"of {number} that there are"
    return f"; {len(mine)} with the output not turned: {all_}, by {by}"


def _level_pairs(mechanism: Mechanism) -> list[Rod] | None:
    """One rod of each crank, where the others of the crank do the same for a level output."""
    made = rods(mechanism)
    if made is None or made.planar or set(mechanism.task.rows) != {0, 1, 2}:
        return None
    out: dict[int, Rod] = {}
    for rod in made.rods:
        if not rod.moved or rod.hinge is not None:
            return None
        first = out.setdefault(rod.joint, rod)
        gap = (rod.inner - rod.outer) - (first.inner - first.outer)
        unlike = abs(rod_length(mechanism, rod) - rod_length(mechanism, first))
        moved = max(np.abs(rod.first - first.first).max(), np.abs(rod.second - first.second).max())
        if max(float(np.abs(gap).max()), unlike, float(moved)) > _LEVEL:
            return None
    away = np.abs(output_pose(mechanism, home(mechanism)).rotation - np.eye(3)).max()
    return list(out.values()) if len(out) == 3 and away <= _LEVEL else None


def _cranks(mechanism: Mechanism, pairs: Sequence[Rod], p: Array) -> int | None:
    count = 1
    for rod in pairs:
        length = rod_length(mechanism, rod)
        roots = values(mechanism, rod, p + rod.outer, False, length)
        if roots is None:
            return None
        count *= sum(inside(mechanism, rod.joint, v) for v in roots)
    return count


def _three_spheres(mechanism: Mechanism, pairs: Sequence[Rod], q: Array) -> int | None:
    """Positions of the output at the inputs of q, limits of passive joints left aside."""
    centres = np.array([_at(mechanism, r, float(q[r.joint])) - r.outer for r in pairs])
    sizes = np.array([rod_length(mechanism, r) for r in pairs])
    rows = 2 * (centres[1:] - centres[0])
    right = (centres[1:] ** 2).sum(axis=1) - centres[0] @ centres[0] - sizes[1:] ** 2
    right = right + sizes[0] ** 2
    normal = np.cross(*rows)
    size = float(np.linalg.norm(normal))
    if size <= _SMALL:
        return None
    x = np.linalg.lstsq(rows, right, rcond=None)[0] - centres[0]
    n = normal / size
    foot = x - (x @ n) * n
    left = float(sizes[0] ** 2 - foot @ foot)
    return None if abs(left) <= TOUCHING else 2 * (left > 0)


def _at(mechanism: Mechanism, rod: Rod, value: float) -> Array:
    """C (3,) of a rod at a value of its joint."""
    slides = mechanism.prismatic[rod.joint]
    c, s = (value, 0.0) if slides else (float(np.cos(value)), float(np.sin(value)))
    return np.asarray(rod.inner + c * rod.first + s * rod.second)


def _one_rod(mechanism: Mechanism) -> tuple[int, int] | None:
    """The driven joint and the other one; None where it is not one rod between two joints."""
    if len(mechanism.loops) != 1 or mechanism.loops[0].kind == "6d":
        return None
    if len(mechanism.actuated) != 1 or len(mechanism.task.rows) != 1:
        return None
    sides = _sides(mechanism)
    if sides is None:
        return None
    first, second, _ = sides
    driven = mechanism.actuated[0]
    return {first: (first, second), second: (second, first)}.get(driven)


def _sides(mechanism: Mechanism) -> tuple[int, int, tuple[int, ...]] | None:
    """The joint before the rod, the joint beyond the loop, and those of the rod's centre."""
    frames = {f.name: int(f.parentJoint) for f in mechanism.model.frames}
    loop = mechanism.loops[0]
    paths = []
    for name in (loop.frame_a, loop.frame_b):
        path: list[int] = []
        body = frames[name]
        while body:
            path.insert(0, body - 1)
            body = int(mechanism.model.parents[body])
        paths.append(path)
    long, short = sorted(paths, key=len, reverse=True)
    if len(short) != 1 or len(long) < 2 or set(long) & set(short):
        return None
    if len(long) + 1 != mechanism.n:
        return None
    centre = tuple(long[1:])
    if not any(c.joints == centre for c in structure(mechanism).centres):
        return None
    flat = loop.kind == "planar"
    return None if flat and len(centre) != 1 else (long[0], short[0], centre)


def _ends(mechanism: Mechanism, sample: Sample) -> tuple[Array, Array]:
    """Both ends of the rod, in the order of `_one_rod`: on the driven joint's side first."""
    sides = _sides(mechanism)
    assert sides is not None  # asked for only where there is one rod
    first, second, centre = sides
    point = next(c.point for c in structure(mechanism).centres if c.joints == centre)
    C = np.array(sample.joints[centre[0] + 1].act(point))
    frames = {f.name: k for k, f in enumerate(mechanism.model.frames)}
    loop = mechanism.loops[0]
    a, b = frames[loop.frame_a], frames[loop.frame_b]
    far = b if int(mechanism.model.frames[b].parentJoint) == second + 1 else a
    B = np.array(sample.frames[far].translation)
    return (C, B) if mechanism.actuated[0] == first else (B, C)


def _shown(mechanism: Mechanism, joint: int) -> bool:
    """Whether the one row of the output is the motion of this joint."""
    row = mechanism.task.rows[0]
    zero = Sample(mechanism, structure(mechanism), np.zeros(mechanism.n), np.eye(3), np.eye(3))
    turning = not mechanism.prismatic[joint]
    if turning != (row >= 3):
        return False
    return bool(abs(abs(float(zero.axis[joint][row % 3])) - 1) <= _SMALL)
