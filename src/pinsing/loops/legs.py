"""One force that a leg passes on the output, and what legs are read from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.loops.structure import Centre, Structure, structure
from pinsing.robot.mechanism import Mechanism

_SMALL = 1e-9


@dataclass(frozen=True, eq=False)
class Rod:
    """One force that a leg passes, along the line through C and B.

    Attributes
    ----------
    joint : int
        The actuated joint of the leg.
    slides : bool
        Whether that is the length of C B itself.
    outer : (3,) array
        B in the frame of the output, metres.
    inner : (3,) array
        C in the base; with a crank or slide before it the part that does not move.
    first, second : (3,) arrays
        C = inner + cos(q) first + sin(q) second for a crank, inner + q first for a slide before
        C; zero otherwise.
    hinge : (3,) array or None
        Axis of the only passive joint at C, in space: the leg passes a force along it too.
    bends : bool
        Whether the actuated joint is an elbow between C and B, in the plane.
    across : (3,) array or None
        a, of a leg that is driven at its foot: the force is not along C B but across it.
    side : int
        0: along C B; 1: along a x CB; 2: along (a x CB) x CB.
    slide : int
        Of such a leg, the joint that slides along C B; -1 elsewhere.
    offset : float
        What is added to the value of the joint that slides along C B to have the length, metres;
        a length below zero is one the other way.
    links : tuple of float
        Of a leg that is driven at its elbow the lengths of both links, metres; empty elsewhere.
    """

    joint: int
    slides: bool
    outer: Array
    inner: Array
    first: Array
    second: Array
    hinge: Array | None
    bends: bool = False
    across: Array | None = None
    side: int = 0
    slide: int = -1
    offset: float = 0.0
    links: tuple[float, ...] = ()

    @property
    def sliding(self) -> int:
        """The joint whose value, with the offset, is the length of C B; -1 where there is none."""
        return self.slide if self.side else self.joint if self.slides else -1

    @property
    def moved(self) -> bool:
        """Whether C moves with the actuated joint."""
        return bool(np.linalg.norm(self.first) > _SMALL)


@dataclass(frozen=True, eq=False)
class Rods:
    """All forces on the output.

    Attributes
    ----------
    mechanism : Mechanism
        The mechanism.
    rods : tuple of Rod
        In the order of the legs; several may share a crank.
    planar : bool
        Whether everything moves in parallel planes.
    axes : (3, 3) array
        Rows: axes of the base in which all of this is; in the plane the third is its normal.
    own : (3, 3) array
        Columns: axes of the output that are along those when it is not turned.
    """

    mechanism: Mechanism
    rods: tuple[Rod, ...]
    planar: bool
    axes: Array
    own: Array

    @property
    def tilted(self) -> bool:
        """Whether these are not the axes of the base, or of the output."""
        eye = np.eye(3)
        return bool(max(np.abs(self.axes - eye).max(), np.abs(self.own - eye).max()) > _SMALL)

    def placed(self, pose: pin.SE3) -> pin.SE3:
        """A pose of the output in these axes: in the plane a turn about the third."""
        return pin.SE3(self.axes @ pose.rotation @ self.own, self.axes @ pose.translation)


class Sample:
    """Placements at one configuration of the tree, closed or not, in given axes (rows)."""

    def __init__(
        self, mechanism: Mechanism, built: Structure, q: Array, axes: Array, own: Array
    ) -> None:
        data = mechanism.model.createData()
        pin.forwardKinematics(mechanism.model, data, mechanism.model_q(q))
        pin.updateFramePlacements(mechanism.model, data)
        turn = pin.SE3(axes, np.zeros(3))
        self.q = q
        self.joints = [turn * m for m in data.oMi]
        self.frames = [turn * m for m in data.oMf]
        self.output = self.frames[mechanism.output_id] * pin.SE3(own, np.zeros(3))
        self.axis = np.array(
            [self.joints[j + 1].rotation @ built.axes[j] for j in range(mechanism.n)]
        )


@dataclass(frozen=True, eq=False)
class End:
    """Where a leg meets the output: a loop's two frames, or joints of the tree at a centre.

    With a centre the frames mean nothing. ``hanging``: joints between the output and the loop, of
    a leg that is written from there.
    """

    frame: int
    other: int
    centre: Centre | None
    hanging: tuple[int, ...] = ()


def end_point(sample: Sample, end: End) -> Array:
    """B (3,) of a leg there."""
    if end.centre is not None:
        return np.array(sample.joints[end.centre.joints[0] + 1].act(end.centre.point))
    return np.array(sample.frames[end.frame].translation)


def slide_offset(reach: Array, along: Array, values: Array) -> float | None:
    """What a slide's values (N,) need to be the lengths of reach (N, 3) along unit axes (N, 3).

    Slides are often counted from mid-stroke. None where the two do not go together.
    """
    lengths = (reach * along).sum(axis=1)
    for sign in (1.0, -1.0):
        off = sign * lengths - values
        if np.abs(off - off[0]).max() <= _SMALL:
            return 0.0 if abs(off[0]) <= _SMALL else round(float(off[0]), 12)
    return None


def in_output(mechanism: Mechanism, sample: Sample, end: End) -> Array:
    """B in the frame of the output; the same at all configurations."""
    output = sample.output
    if end.centre is None:
        return np.array(output.actInv(sample.frames[end.other].translation))
    return np.array(output.actInv(end_point(sample, end)))


def foot_driven(
    mechanism: Mechanism,
    built: Structure,
    samples: list[Sample],
    path: list[int],
    end: End,
    planar: bool,
) -> list[Rod]:
    """The forces of one leg that is driven at its foot; empty for another one."""
    size = 1 if planar else 3
    if end.hanging or (end.centre is not None and len(end.centre.joints) != size):
        return []
    slides = mechanism.prismatic[path]
    if not 2 <= len(path) <= (2 if planar else 3) or slides[:-1].any() or not slides[-1]:
        return []
    first, slide = path[0], path[-1]
    if not set(path[:-1]) & set(mechanism.actuated):
        return []
    flat = np.array([1.0, 1.0, 0.0]) if planar else np.ones(3)
    axis = samples[0].axis[first]
    foot = np.array(samples[0].joints[first + 1].translation)
    B = np.array([end_point(s, end) for s in samples])
    along = np.array([s.axis[slide] for s in samples])
    if np.abs(along @ axis).max() > _SMALL and len(path) == 2:
        return []
    if len(path) == 3:
        met = _universal(samples, path, along)
        if met is None:
            return []
        foot = foot + met * axis
    else:
        # Straight across from the end.
        off = (B - foot) @ axis
        if np.abs(off - off[0]).max() > _SMALL:
            return []
        foot = foot + off[0] * axis
    if np.abs(np.cross((B - foot) * flat, along)).max() > _SMALL:
        return []
    offset = slide_offset((B - foot) * flat, along, np.array([s.q[slide] for s in samples]))
    if offset is None:
        return []
    outer, zero = in_output(mechanism, samples[0], end), np.zeros(3)
    hinge = axis if len(path) == 2 and not planar else None
    out = []
    for side, joint in ((0, slide), *enumerate(path[:-1], 1)):
        if joint in mechanism.actuated:
            out.append(
                Rod(
                    joint, side == 0, outer, foot, zero, zero, hinge, False, axis, side, slide,
                    offset,
                )
            )  # fmt: skip
            hinge = None
    return out


def _universal(samples: list[Sample], path: list[int], along: object) -> float | None:
    """Where along the first axis the second one meets it, all crossed at right angles, or None."""
    found = []
    for s, slide in zip(samples, np.asarray(along), strict=True):
        a, b = s.axis[path[0]], s.axis[path[1]]
        if max(abs(float(a @ b)), abs(float(b @ slide))) > _SMALL:
            return None
        gap = np.array(s.joints[path[1] + 1].translation - s.joints[path[0] + 1].translation)
        if abs(float(gap @ np.cross(a, b))) > _SMALL:
            return None
        found.append(float(gap @ a))
    return found[0]


def leg_reason(
    mechanism: Mechanism,
    built: Structure,
    samples: Sequence[Sample],
    path: Sequence[int],
    end: End,
    planar: bool,
) -> str:
    """Of a leg that is of another kind than those with a wrench over the pose."""
    at_end = () if end.centre is None else end.centre.joints
    joints = [*path, *at_end, *reversed(end.hanging)]
    name = f"the leg of {', '.join(mechanism.joints[j] for j in joints) or 'no joints'}"
    driven = [j for j in joints if j in mechanism.actuated]
    slides = [j for j in joints if mechanism.prismatic[j]]
    where = "is not supported over the pose"
    if not driven:
        return f"{name} has no actuated joint, which {where}"
    told = " and ".join(mechanism.joints[j] for j in driven)
    if end.hanging:
        return f"{name}, written from the output and driven at {told}, {where}"
    loose = [j for j in slides if j not in driven]
    if slides and _askew(mechanism, built, samples, path, end, slides, planar):
        across = mechanism.joints[slides[0]]
        return f"{name} slides ({across}) beside the line from its foot to its end, which {where}"
    if loose and path and loose[0] == path[0]:
        first = mechanism.joints[loose[0]]
        return f"{name} is driven at {told} behind the passive slide {first}, which {where}"
    if len(driven) > 1:
        return f"{name} has {len(driven)} actuated joints ({told}), which {where}"
    return f"{name}, driven at {told}, {where}"


def _askew(
    mechanism: Mechanism, built: Structure, samples: Sequence[Sample], path: Sequence[int],
    end: End, slides: Sequence[int], planar: bool,
) -> bool:  # fmt: skip
    """Whether a slide after turning joints does not point along the line through the leg's ends."""
    turning = [j for j in path if not mechanism.prismatic[j]]
    if len(slides) != 1 or slides[0] not in path or not turning or path[-1] != slides[0]:
        return False
    centre = next((c for c in built.centres if c.joints[0] == turning[0]), None)
    flat = np.array([1.0, 1.0, 0.0]) if planar else np.ones(3)

    def foot(s: Sample) -> Array:
        at = s.joints[turning[0] + 1]
        return np.array(at.translation if centre is None else at.act(centre.point))

    reach = np.array([(end_point(s, end) - foot(s)) * flat for s in samples])
    along = np.array([s.axis[slides[0]] for s in samples])
    return bool(np.abs(np.cross(reach, along)).max() > _SMALL)


def tree_reason(mechanism: Mechanism, path: Sequence[int]) -> str:
    """Of the leg that carries the output in the tree where it does not end in a pin or ball."""
    names = ", ".join(mechanism.joints[j] for j in path)
    last = path[-1]
    if last in mechanism.actuated:
        how = f"is driven at its joint with the output ({mechanism.joints[last]})"
    elif mechanism.prismatic[last]:
        how = f"ends in a slide at the output ({mechanism.joints[last]})"
    else:
        how = f"does not end in a pin or a ball at the output ({mechanism.joints[last]})"
    return f"the leg of {names} {how}, which is not supported over the pose"


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
