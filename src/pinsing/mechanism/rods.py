"""Legs that pass one force: along the line from a point of the base, or of a crank, to the output.

A leg of this kind has two passive centres, C and B, and one actuated joint: a slide along C B (UPS,
SPS, RPR), or a crank or slide before C (RUS, PUS, RRR, PRR). With the actuator locked everything
that the leg can pass on is a force along C B, since each passive axis meets that line. Where the
inner centre is a single turning joint in space (RPS) it passes a second force: through B, along
that joint's axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

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
    """

    joint: int
    slides: bool
    outer: Array
    inner: Array
    first: Array
    second: Array
    hinge: Array | None

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
        Whether everything moves in planes parallel to z = 0.
    """

    mechanism: Mechanism
    rods: tuple[Rod, ...]
    planar: bool


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
    space = mechanism.space
    samples = [_Sample(mechanism, built, q) for q in space.sample(4, rng)]
    axes = samples[0].axis
    planar = all(
        bool(abs(abs(axes[j][2]) - 1) <= _SMALL)
        if not mechanism.prismatic[j]
        else bool(abs(axes[j][2]) <= _SMALL)
        for j in range(mechanism.n)
    )
    ends = _ends(mechanism, built)
    out = []
    for path, end in ends or ():
        rod = _rod(mechanism, built, samples, path, end, planar)
        if rod is None:
            return None
        out.append(rod)
    wrenches = len(out) + sum(rod.hinge is not None for rod in out)
    if wrenches != (3 if planar else 6) or {r.joint for r in out} != set(mechanism.actuated):
        return None
    return Rods(mechanism, tuple(out), planar)


class _Sample:
    """Placements at one configuration of the tree, closed or not."""

    def __init__(self, mechanism: Mechanism, built: Structure, q: Array) -> None:
        self.q, self.data = q, mechanism.model.createData()
        pin.forwardKinematics(mechanism.model, self.data, mechanism.model_q(q))
        pin.updateFramePlacements(mechanism.model, self.data)
        self.axis = np.array(
            [self.data.oMi[j + 1].rotation @ built.axes[j] for j in range(mechanism.n)]
        )


@dataclass(frozen=True, eq=False)
class _End:
    """Where a leg meets the output: a loop's two frames, or joints of the tree at a centre."""

    frame: int | None
    other: int | None
    centre: Centre | None


def _ends(mechanism: Mechanism, built: Structure) -> list[tuple[list[int], _End]] | None:
    """For each leg's connection with the output, the joints from the base to it."""
    model = mechanism.model
    frames = {f.name: i for i, f in enumerate(model.frames)}
    out: list[tuple[list[int], _End]] = []
    for loop in mechanism.loops:
        a, b = frames[loop.frame_a], frames[loop.frame_b]
        bodies = [int(model.frames[k].parentJoint) for k in (a, b)]
        if built.output not in bodies or loop.kind == "6d":
            return None
        if bodies[0] == built.output:
            a, b, bodies = b, a, bodies[::-1]
        out.append((_path(mechanism, bodies[0]), _End(a, b, None)))
    path = _path(mechanism, built.output)
    last = [c for c in built.centres if built.output - 1 in c.joints]
    if not last or path[-len(last[0].joints) :] != list(last[0].joints):
        return None
    return [(path[: -len(last[0].joints)], _End(None, None, last[0])), *out]


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
    C = np.array([s.data.oMi[centre.joints[0] + 1].act(centre.point) for s in samples])
    B = np.array([_end_point(s, end) for s in samples])
    outer = _in_output(mechanism, samples[0], end)
    zero = np.zeros(3)
    after = path.index(joint) > path.index(centre.joints[-1])
    if after:
        along = np.array([s.axis[joint] for s in samples])
        reach = B - C
        flat = reach * (1.0, 1.0, 0.0) if planar else reach
        if not mechanism.prismatic[joint] or np.abs(np.cross(flat, along)).max() > _SMALL:
            return None
        values = np.array([s.q[joint] for s in samples])
        if np.abs(np.abs((flat * along).sum(axis=1)) - np.abs(values)).max() > _SMALL:
            return None
        axis = samples[0].axis[centre.joints[0]] if hinge else None
        if axis is not None and np.abs(along @ axis).max() > _SMALL:
            return None
        return Rod(joint, True, outer, C[0], zero, zero, axis)
    if hinge or path != [joint, *centre.joints]:
        return None
    # C moves with the one joint before it.
    start, axis = samples[0].data.oMi[joint + 1], samples[0].axis[joint]
    if mechanism.prismatic[joint]:
        return Rod(joint, False, outer, C[0] - samples[0].q[joint] * axis, axis, zero, None)
    at = np.array(start.translation)
    arm = C[0] - at
    rest = (arm @ axis) * axis
    c, s = np.cos(samples[0].q[joint]), np.sin(samples[0].q[joint])
    turned = arm - rest
    first = c * turned - s * np.cross(axis, turned)
    if np.linalg.norm(first) <= _SMALL:
        return None
    return Rod(joint, False, outer, at + rest, first, np.cross(axis, first), None)


def _end_point(sample: _Sample, end: _End) -> Array:
    if end.centre is not None:
        return np.array(sample.data.oMi[end.centre.joints[0] + 1].act(end.centre.point))
    return np.array(sample.data.oMf[end.frame].translation)


def _in_output(mechanism: Mechanism, sample: _Sample, end: _End) -> Array:
    """B in the frame of the output; the same at all configurations."""
    output = sample.data.oMf[mechanism.output_id]
    if end.centre is None:
        return np.array(output.actInv(sample.data.oMf[end.other].translation))
    return np.array(output.actInv(_end_point(sample, end)))
