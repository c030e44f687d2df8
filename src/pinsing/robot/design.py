"""The design of a robot: what its file is an imperfect copy of, and how far it is from that.

Two chains are compared by their joint axes at zero, as lines in space, once they lie on each other
as well as they can: neither the base nor where a file puts its frames on an axis matters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from pinsing.errors import OptionError
from pinsing.measures import FLOAT_NOISE, Array, Chain
from pinsing.robot.arm import Arm
from pinsing.robot.chain import chain_model, flatten, keep_chain
from pinsing.robot.nominal import Deviation, nominal

ANGLE, LENGTH = 1e-2, 1e-3
"""Radians and metres within which a detected design has right angles, no offset, equal lengths."""


@dataclass(frozen=True)
class AxisDifference:
    """How far a joint's axis is from where the design has it.

    Attributes
    ----------
    joint : str
        Name of the joint.
    angle : float
        Radians between the two axes.
    length : float
        Metres of the joint's origin from the axis of the design.
    """

    joint: str
    angle: float
    length: float

    def __str__(self) -> str:
        return f"{self.joint} {np.degrees(self.angle):.2g}° and {1e3 * self.length:.2g} mm"


def design_of(
    robot: Arm, design: Arm | bool, angle_tol: float = ANGLE, snap_length: float = LENGTH
) -> Arm:
    """Return the arm on the geometry of a design; OptionError if that is another robot."""
    OptionError.refuse_if(
        robot.coupling is not None, "a design goes with arms without mimic joints in the chain"
    )
    if isinstance(design, bool):
        geometry = nominal(robot, angle_tol, snap_length)
        chain = flatten(geometry.arm)
        if Deviation.of(geometry.snaps) is not None:
            chain = replace(chain, t=_with_equal_lengths(chain.t, snap_length))
        return _on(robot, chain)
    OptionError.refuse_if(
        design.coupling is not None or list(design.prismatic) != list(robot.prismatic),
        f"the design {design.name!r} has {design.n} joints of other kinds than the {robot.n} "
        f"of {robot.name!r}: name the design of this robot",
    )
    made = _on(robot, flatten(nominal(design).arm))
    require_same(robot, made, f"the design {design.name!r}")
    return made


def _on(robot: Arm, chain: Chain) -> Arm:
    """The arm with another chain, which is a design: it has none itself."""
    made = replace(robot, model=chain_model(chain, robot), design=None)
    keep_chain(made, chain)
    return made


def _with_equal_lengths(t: Array, within: float) -> Array:
    """Make nearly equal lengths of placements (n, 3) equal, so that they can cancel."""
    out, left = t.copy(), np.flatnonzero(t)
    left = left[np.argsort(np.abs(t.flat[left]), kind="stable")]
    while len(left):
        size = np.abs(t.flat[left])
        if (count := int((size - size[0] < 2 * within).sum())) > 1:
            out.flat[left[:count]] = np.copysign(size[:count].mean().round(6), t.flat[left[:count]])
        left = left[count:]
    return np.asarray(out)


def require_same(robot: Arm, design: Arm, called: str) -> None:
    """Raise OptionError if an axis is elsewhere by 0.1 rad, or a tenth of all links' length."""
    size = float(np.linalg.norm(flatten(design).t, axis=1).sum())
    worst = max(differences(robot, design), key=lambda d: max(d.angle, d.length / size))
    OptionError.refuse_if(
        max(worst.angle, worst.length / size) > 0.1,
        f"{called} is another robot, or has its joint zeros elsewhere: the axis of "
        f"{worst.joint} differs by {np.degrees(worst.angle):.3g}° and "
        f"{1e3 * worst.length:.3g} mm",
    )


def is_odd(robot: Arm) -> bool:
    """Return True if most axes are off, as after a calibration, and small offsets are left."""
    left = np.abs(flatten(robot.design or robot).t)
    if not ((left > 1e-9) & (left < 10 * LENGTH)).any():
        return False
    return len({s.where for s in nominal(robot, 0.0).snaps if s.what == "twist"}) > robot.n / 2


def differences(robot: Arm, design: Arm | Chain) -> tuple[AxisDifference, ...]:
    """Return how far each axis of a robot is from that of its design, base to tip."""
    made = design if isinstance(design, Chain) else flatten(design)
    (d, p), (d0, p0) = axes(flatten(robot)), axes(made)
    R, t = alignment((d, p), (d0, p0))
    d0, p0 = d0 @ R.T, p0 @ R.T + t
    angle = np.arctan2(np.linalg.norm(np.cross(d, d0), axis=1), (d * d0).sum(axis=1))
    away = np.linalg.norm(np.cross(p - p0, d0), axis=1) * ~np.asarray(robot.prismatic)
    return tuple(map(AxisDifference, robot.joints, angle.tolist(), away.tolist()))


def deviation_of(assumed: Sequence[AxisDifference]) -> Deviation:
    """Return how far a robot is from its design at most."""
    return Deviation(max(a.angle for a in assumed), max(a.length for a in assumed), 0.0)


def assumptions(assumed: Sequence[AxisDifference]) -> str:
    """Return what is assumed of each joint, in a sentence."""
    return "axes of this robot differ from the design's by " + ", ".join(map(str, assumed))


def assumed_design(robot: Arm) -> Arm | None:
    """Return the design of a robot most of whose placements are off one, as after a calibration."""
    # By 0.1 mrad, or by offsets of 0.02 mm that the design has not, of these two at least: angles
    # alone are off where somebody wrote 1.57. Rounding is far less.
    if robot.coupling is not None:
        return None
    snaps = nominal(robot, ANGLE, LENGTH).snaps
    offset = {s.where for s in snaps if s.what == "length" and s.size > 2e-5}
    turned = {s.where for s in snaps if s.what == "angle" and s.size > 1e-4}
    few = len(offset) < 2 or len(offset | turned) <= robot.n / 2
    return None if few else design_of(robot, True)


def axes(chain: Chain) -> tuple[Array, Array]:
    """Directions and points (n, 3) of the joint axes at zero."""
    R, p, directions, points = np.eye(3), np.zeros(3), [], []
    for turn, step in zip(chain.R[:-1], chain.t[:-1], strict=True):
        p, R = p + R @ step, R @ turn
        directions.append(R[:, 2])
        points.append(p)
    return np.array(directions), np.array(points)


def alignment(to: tuple[Array, Array], lines: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the motion (R, t) that best puts lines on others, by Gauss-Newton."""
    (d, p), (d0, p0) = to, lines
    size = max(float(np.abs(p - p.mean(axis=0)).max()), 1e-9)
    middle, origin = p.mean(axis=0), p0.mean(axis=0)
    m, m0 = np.cross((p - middle) / size, d), np.cross((p0 - origin) / size, d0)
    u, _, v = np.linalg.svd(d.T @ d0 + m.T @ m0)
    turn = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    found = []
    for R in (np.eye(3), turn):
        b = np.zeros(3)
        for _ in range(20):
            here, moment = d0 @ R.T, m0 @ R.T
            moment = moment + np.cross(b, here)
            off = np.concatenate([d - here, m - moment]).ravel()
            turned, moved = (np.cross(np.eye(3)[:, None], x) for x in (here, moment))
            rise = np.block([[[turned], [moved]], [[0 * turned], [turned]]])
            step = np.linalg.lstsq(rise.reshape(6, -1).T, off, rcond=1e-9)[0]
            spin = pin.exp3(step[:3])
            R, b = spin @ R, spin @ b + step[3:]
            if np.abs(step).max() < FLOAT_NOISE:
                break
        found.append((float(np.abs(off).max()), R, middle + size * b - R @ origin))
    return min(found, key=lambda f: f[0])[1:]
