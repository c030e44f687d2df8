"""One force that a leg passes on the output, and what legs are read from."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.loops.structure import Centre, Structure
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
