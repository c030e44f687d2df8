"""Legs that pass one force: along the line from a point of the base, or of a crank, to the output.

A leg of this kind has two passive centres, C and B, and one actuated joint: a slide along C B (UPS,
SPS, RPR), or a crank or slide before C (RUS, PUS, RRR, PRR). With the actuator locked everything
that the leg can pass on is a force along C B, since each passive axis meets that line. Where the
inner centre is a single turning joint in space (RPS) it passes a second force: through B, along
that joint's axis.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.mechanism.structure import Centre, Structure, structure
from pinsing.robot.mechanism import Mechanism

_SMALL = 1e-9
_SEED = 4177
_MOST = {(True, 3): 6, (False, 6): 40}


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
    """

    joint: int
    slides: bool
    outer: Array
    inner: Array
    first: Array
    second: Array
    hinge: Array | None
    bends: bool = False

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


def rods(mechanism: Mechanism) -> Rods | None:
    """Recognise a mechanism whose legs pass one force each; None for another one."""
    return mechanism.once("rods", lambda: _rods(mechanism))


def most_assemblies(mechanism: Mechanism) -> int | None:
    """How many poses given inputs can have at most; None where no number is known.

    Three distances of a body in a plane: 6 (Gosselin and Sefrioui 1991); six in space: 40
    (Raghavan 1991, Lazard 1992); 3-RPS: 16 (Nanua, Waldron and Murthy 1990).
    """
    found = rods(mechanism)
    if found is None:
        return None
    if any(rod.hinge is not None for rod in found.rods):
        return 16 if len(found.rods) == 3 and not found.planar else None
    return _MOST.get((found.planar, len(found.rods)))


def _rods(mechanism: Mechanism) -> Rods | None:
    built = structure(mechanism)
    if built.output == 0:
        return None
    rng = np.random.default_rng(_SEED)
    drawn = mechanism.space.sample(4, rng)
    axes, own = np.eye(3), np.eye(3)
    zero = _Sample(mechanism, built, np.zeros(mechanism.n), axes, own)
    normal = _normal(mechanism, zero.axis)
    planar = normal is not None
    if normal is not None:
        axes = _level(normal)
        own = _upright(axes @ zero.output.rotation, axes)
    samples = [_Sample(mechanism, built, q, axes, own) for q in drawn]
    out = []
    for path, end in _ends(mechanism, built) or ():
        rod = _rod(mechanism, built, samples, path, end, planar)
        if rod is None:
            return None
        out.append(rod)
    wrenches = len(out) + sum(rod.hinge is not None for rod in out)
    if wrenches != (3 if planar else 6) or {r.joint for r in out} != set(mechanism.actuated):
        return None
    return Rods(mechanism, tuple(out), planar, axes, own)


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


class _Sample:
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
class _End:
    """Where a leg meets the output: a loop's two frames, or joints of the tree at a centre.

    With a centre the frames mean nothing. ``hanging``: joints between the output and the loop, of
    a leg that is written from there.
    """

    frame: int
    other: int
    centre: Centre | None
    hanging: tuple[int, ...] = ()


def _ends(mechanism: Mechanism, built: Structure) -> list[tuple[list[int], _End]] | None:
    """For each leg's connection with the output, the joints from the base to it."""
    model = mechanism.model
    frames = {f.name: i for i, f in enumerate(model.frames)}
    out: list[tuple[list[int], _End]] = []
    for loop in mechanism.loops:
        a, b = frames[loop.frame_a], frames[loop.frame_b]
        if loop.kind == "6d":
            return None
        paths = [_path(mechanism, int(model.frames[k].parentJoint)) for k in (a, b)]
        if built.output - 1 in paths[0]:
            a, b, paths = b, a, paths[::-1]
        if built.output - 1 not in paths[1] or built.output - 1 in paths[0]:
            return None
        hanging = tuple(paths[1][paths[1].index(built.output - 1) + 1 :])
        out.append((paths[0], _End(a, b, None, hanging)))
    path = _path(mechanism, built.output)
    last = [c for c in built.centres if built.output - 1 in c.joints]
    if not last or path[-len(last[0].joints) :] != list(last[0].joints):
        return None
    return [(path[: -len(last[0].joints)], _End(0, 0, last[0])), *out]


def _path(mechanism: Mechanism, body: int) -> list[int]:
    path: list[int] = []
    while body:
        path.insert(0, body - 1)
        body = int(mechanism.model.parents[body])
    return path


def _rod(
    mechanism: Mechanism,
    built: Structure,
    samples: list[_Sample],
    path: list[int],
    end: _End,
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
    B = np.array([_end_point(s, end) for s in samples])
    outer = _in_output(mechanism, samples[0], end)
    zero = np.zeros(3)
    after = path.index(joint) > path.index(centre.joints[-1])
    if after:
        along = np.array([s.axis[joint] for s in samples])
        if planar and not mechanism.prismatic[joint]:
            return Rod(joint, False, outer, C[0], zero, zero, None, bends=True)
        if not _slides_along(mechanism, samples, joint, B - C, planar):
            return None
        axis = samples[0].axis[centre.joints[0]] if hinge else None
        if axis is not None and np.abs(along @ axis).max() > _SMALL:
            return None
        return Rod(joint, True, outer, C[0], zero, zero, axis)
    if hinge or path != [joint, *centre.joints]:
        return None
    return _driven(mechanism, samples[0], joint, C[0], outer)


def _slides_along(
    mechanism: Mechanism, samples: list[_Sample], joint: int, reach: Array, planar: bool
) -> bool:
    """Whether a joint slides along what it reaches (samples, 3), and its value is that length."""
    along = np.array([s.axis[joint] for s in samples])
    flat = reach * (1.0, 1.0, 0.0) if planar else reach
    if not mechanism.prismatic[joint] or np.abs(np.cross(flat, along)).max() > _SMALL:
        return False
    values = np.array([s.q[joint] for s in samples])
    return bool(np.abs(np.abs((flat * along).sum(axis=1)) - np.abs(values)).max() <= _SMALL)


def _driven(
    mechanism: Mechanism, sample: _Sample, joint: int, C: Array, outer: Array
) -> Rod | None:
    """A rod whose inner end, at C (3,) there, moves with the one joint before it."""
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
    samples: list[_Sample],
    path: list[int],
    end: _End,
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
        return _driven(mechanism, samples[0], path[0], C[0], outer)
    if len(driven) != 1 or path or end.hanging != (*passive, *driven):
        return None
    if not _slides_along(mechanism, samples, driven[0], E - B, planar):
        return None
    zero = np.zeros(3)
    return Rod(driven[0], True, outer, C[0], zero, zero, None)


def _end_point(sample: _Sample, end: _End) -> Array:
    if end.centre is not None:
        return np.array(sample.joints[end.centre.joints[0] + 1].act(end.centre.point))
    return np.array(sample.frames[end.frame].translation)


def _in_output(mechanism: Mechanism, sample: _Sample, end: _End) -> Array:
    """B in the frame of the output; the same at all configurations."""
    output = sample.output
    if end.centre is None:
        return np.array(output.actInv(sample.frames[end.other].translation))
    return np.array(output.actInv(_end_point(sample, end)))
