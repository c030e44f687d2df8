"""Legs that pass one force: along the line from a point of the base, or of a crank, to the output.

A leg of this kind has two passive centres, C and B, and one actuated joint: a slide along C B (UPS,
SPS, RPR), or a crank or slide before C (RUS, PUS, RRR, PRR). With the actuator locked everything
that the leg can pass on is a force along C B, since each passive axis meets that line. Where the
inner centre is a single turning joint in space (RPS, PRS, RRS) it passes a second force: through B,
along that joint's axis.

A leg that is driven at its foot and has a passive slide along C B (RPR, RPS, UPS) passes a force
through B across C B: with a the axis of the foot's first joint, along a x CB where that joint is
driven, along (a x CB) x CB where the second one is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pinsing._types import Array
from pinsing.loops.rod import End, Rod, Rods, Sample, end_point, in_output, slide_offset
from pinsing.loops.rod_foot import foot_driven
from pinsing.loops.rod_reasons import leg_reason, tree_reason
from pinsing.loops.structure import Structure, structure
from pinsing.robot.mechanism import Mechanism

_SMALL = 1e-9
_SEED = 4177
_MOST = {(True, 3): 6, (False, 6): 40}


def rods(mechanism: Mechanism) -> Rods | None:
    """Recognise a mechanism whose legs pass one force each; None for another one."""
    found = mechanism.once("rods", lambda: _rods(mechanism))
    return found if isinstance(found, Rods) else None


def why_no_rods(mechanism: Mechanism) -> str:
    """What keeps the legs from passing one force each; empty where they do."""
    found = mechanism.once("rods", lambda: _rods(mechanism))
    return found if isinstance(found, str) else ""


def most_assemblies(mechanism: Mechanism) -> int | None:
    """How many poses given inputs can have at most; None where no number is known.

    Three distances of a body in a plane: 6 (Gosselin and Sefrioui 1991); six in space: 40
    (Raghavan 1991, Lazard 1992); 3-RPS: 16 (Nanua, Waldron and Murthy 1990).
    """
    found = rods(mechanism)
    if found is None:
        return None
    if any(rod.side for rod in found.rods):
        return None
    if any(rod.hinge is not None for rod in found.rods):
        return 16 if len(found.rods) == 3 and not found.planar else None
    return _MOST.get((found.planar, len(found.rods)))


def _rods(mechanism: Mechanism) -> Rods | str:
    """The rods, or why there are none."""
    built = structure(mechanism)
    if built.output == 0:
        return f"the output {mechanism.output} is not on a link that moves between legs"
    ends = _ends(mechanism, built)
    if isinstance(ends, str):
        return ends
    rng = np.random.default_rng(_SEED)
    drawn = mechanism.space.sample(4, rng)
    plane = plane_axes(mechanism)
    planar = plane is not None
    axes, own = plane or (np.eye(3), np.eye(3))
    samples = [Sample(mechanism, built, q, axes, own) for q in drawn]
    out = []
    for path, end in ends:
        legs = foot_driven(mechanism, built, samples, path, end, planar)
        rod = None if legs else _rod(mechanism, built, samples, path, end, planar)
        if rod is None and not legs:
            return leg_reason(mechanism, built, samples, path, end, planar)
        out += [rod] if rod is not None else legs
    wrenches = len(out) + sum(rod.hinge is not None for rod in out)
    needed = 3 if planar else 6
    if wrenches != needed:
        return (
            f"the legs pass {wrenches} force{'s' * (wrenches != 1)} where {needed} hold the output"
        )
    if {r.joint for r in out} != set(mechanism.actuated):
        return "there are actuated joints that are on no leg from the base to the output"
    return Rods(mechanism, tuple(out), planar, axes, own)


def plane_axes(mechanism: Mechanism) -> tuple[Array, Array] | None:
    """Axes of the base and of the output, as of ``Rods``, of the plane in which all moves; or None.

    None in space.
    """
    zero = Sample(mechanism, structure(mechanism), np.zeros(mechanism.n), np.eye(3), np.eye(3))
    normal = _normal(mechanism, zero.axis)
    if normal is None:
        return None
    axes = _level(normal)
    return axes, _upright(axes @ zero.output.rotation, axes)


def _upright(turned: Array, axes: Array) -> Array:
    """Axes of the output (columns) that make its rotation one about the normal of the plane."""
    for own in (axes.T, np.eye(3)):
        if abs((turned @ own)[2, 2] - 1) <= _SMALL:
            return np.array(own)
    return np.array(turned.T)


def _normal(mechanism: Mechanism, axes: Array) -> Array | None:
    """Normal (3,) of the plane in which everything moves; None in space."""
    turning = np.flatnonzero(~mechanism.prismatic)
    if not len(turning):
        return None
    normal = axes[turning[0]]
    normal = normal * np.sign(normal[int(np.argmax(np.abs(normal).round(6)))])
    across = np.abs(axes @ normal)
    flat = np.abs(across - ~mechanism.prismatic).max() <= _SMALL
    return np.array(normal) if flat else None


def _level(normal: Array) -> Array:
    """Axes (rows) with the normal last; those of the base in turn where it is one of them."""
    k = int(np.argmax(np.abs(normal)))
    if abs(normal[k] - 1) <= _SMALL:
        return np.roll(np.eye(3), 2 - k, axis=0)
    first = np.cross([0.0, 1.0, 0.0] if k != 1 else [0.0, 0.0, 1.0], normal)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first), normal])


def _ends(mechanism: Mechanism, built: Structure) -> list[tuple[list[int], End]] | str:
    """For each leg's connection with the output, the joints from the base to it; or why not."""
    model = mechanism.model
    frames = {f.name: i for i, f in enumerate(model.frames)}
    out: list[tuple[list[int], End]] = []
    for loop in mechanism.loops:
        a, b = frames[loop.frame_a], frames[loop.frame_b]
        if loop.kind == "6d":
            return f"the loop {loop} is welded"
        paths = [_path(mechanism, int(model.frames[k].parentJoint)) for k in (a, b)]
        if built.output - 1 in paths[0]:
            a, b, paths = b, a, paths[::-1]
        if built.output - 1 not in paths[1] or built.output - 1 in paths[0]:
            return f"the loop {loop} does not join a leg to the link of the output"
        hanging = tuple(paths[1][paths[1].index(built.output - 1) + 1 :])
        out.append((paths[0], End(a, b, None, hanging)))
    path = _path(mechanism, built.output)
    last = [c for c in built.centres if built.output - 1 in c.joints]
    if not last or path[-len(last[0].joints) :] != list(last[0].joints):
        return tree_reason(mechanism, path)
    return [(path[: -len(last[0].joints)], End(0, 0, last[0])), *out]


def _path(mechanism: Mechanism, body: int) -> list[int]:
    path: list[int] = []
    while body:
        path.insert(0, body - 1)
        body = int(mechanism.model.parents[body])
    return path


def _rod(
    mechanism: Mechanism,
    built: Structure,
    samples: list[Sample],
    path: list[int],
    end: End,
    planar: bool,
) -> Rod | None:
    if end.hanging:
        return _hanging(mechanism, built, samples, path, end, planar)
    driven = [j for j in path if j in mechanism.actuated]
    passive = [j for j in path if j not in mechanism.actuated]
    inner = [c for c in built.centres if passive and c.joints == tuple(passive)]
    if len(driven) != 1 or len(inner) != 1:
        return None
    joint, centre = driven[0], inner[0]
    count = len(centre.joints)
    ball = end.centre is None or len(end.centre.joints) == (1 if planar else 3)
    if not ball or count > (1 if planar else 3):
        return None
    hinge = count == 1 and not planar
    C = np.array([s.joints[centre.joints[0] + 1].act(centre.point) for s in samples])
    B = np.array([end_point(s, end) for s in samples])
    outer = in_output(mechanism, samples[0], end)
    zero = np.zeros(3)
    after = path.index(joint) > path.index(centre.joints[-1])
    if after:
        along = np.array([s.axis[joint] for s in samples])
        if planar and not mechanism.prismatic[joint]:
            elbow = samples[0].joints[joint + 1].translation
            links = tuple(float(np.linalg.norm((elbow - p[0])[:2])) for p in (C, B))
            return Rod(joint, False, outer, C[0], zero, zero, None, True, links=links)
        offset = _slides_along(mechanism, samples, joint, B - C, planar)
        if offset is None:
            return None
        axis = samples[0].axis[centre.joints[0]] if hinge else None
        if axis is not None and np.abs(along @ axis).max() > _SMALL:
            return None
        return Rod(joint, True, outer, C[0], zero, zero, axis, offset=offset)
    if path != [joint, *centre.joints]:
        return None
    if hinge:
        return _hinged_after(mechanism, samples, joint, centre.joints[0], C, B, outer)
    return carried(mechanism, samples[0], joint, C[0], outer)


def _hinged_after(
    mechanism: Mechanism, samples: list[Sample], joint: int, turning: int, C: Array, B: Array,
    outer: Array,
) -> Rod | None:  # fmt: skip
    """A rod on a hinge that a slide or a crank with the same axis carries (PRS, RRS)."""
    axis = samples[0].axis[turning]
    if max(np.abs(s.axis[turning] - axis).max() for s in samples) > _SMALL:
        return None
    # The point of the hinge that is straight across from the end of the rod.
    off = (B - C) @ axis
    if np.abs(off - off[0]).max() > _SMALL:
        return None
    found = carried(mechanism, samples[0], joint, C[0] + off[0] * axis, outer)
    return None if found is None else replace(found, hinge=axis)


def _slides_along(
    mechanism: Mechanism, samples: list[Sample], joint: int, reach: Array, planar: bool
) -> float | None:
    """What to add to a joint's value for the length (samples, 3) that it slides along, or None."""
    along = np.array([s.axis[joint] for s in samples])
    flat = reach * (1.0, 1.0, 0.0) if planar else reach
    if not mechanism.prismatic[joint] or np.abs(np.cross(flat, along)).max() > _SMALL:
        return None
    return slide_offset(flat, along, np.array([s.q[joint] for s in samples]))


def carried(mechanism: Mechanism, sample: Sample, joint: int, C: Array, outer: Array) -> Rod | None:
    """A rod whose inner end, at C (3,) there, moves with the one joint before it.

    None where C is on the axis of that joint.
    """
    start, axis, zero = sample.joints[joint + 1], sample.axis[joint], np.zeros(3)
    if mechanism.prismatic[joint]:
        return Rod(joint, False, outer, C - sample.q[joint] * axis, axis, zero, None)
    at = np.array(start.translation)
    arm = C - at
    rest = (arm @ axis) * axis
    c, s = np.cos(sample.q[joint]), np.sin(sample.q[joint])
    turned = arm - rest
    first = c * turned - s * np.cross(axis, turned)
    if np.linalg.norm(first) <= _SMALL:
        return None
    return Rod(joint, False, outer, at + rest, first, np.cross(axis, first), None)


def _hanging(
    mechanism: Mechanism,
    built: Structure,
    samples: list[Sample],
    path: list[int],
    end: End,
    planar: bool,
) -> Rod | None:
    """A leg written from the output towards the base, the loop at its foot or at the crank."""
    passive = tuple(j for j in end.hanging if j not in mechanism.actuated)
    driven = [j for j in end.hanging if j in mechanism.actuated]
    centre = next((c for c in built.centres if passive and c.joints == passive), None)
    if centre is None or len(passive) not in ((1,) if planar else (2, 3)):
        return None
    B = np.array([s.joints[centre.joints[0] + 1].act(centre.point) for s in samples])
    C = np.array([s.frames[end.frame].translation for s in samples])
    E = np.array([s.frames[end.other].translation for s in samples])
    outer = np.array(samples[0].output.actInv(B[0]))
    if not driven and len(path) == 1 and path[0] in mechanism.actuated:
        return carried(mechanism, samples[0], path[0], C[0], outer)
    if len(driven) != 1 or path or end.hanging != (*passive, *driven):
        return None
    offset = _slides_along(mechanism, samples, driven[0], E - B, planar)
    if offset is None:
        return None
    zero = np.zeros(3)
    return Rod(driven[0], True, outer, C[0], zero, zero, None, offset=offset)
