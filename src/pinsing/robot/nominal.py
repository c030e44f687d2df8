"""The chain of an arm as plain numbers, as exact ones (nominal geometry), and its design.

A chain is constant placements between z axes. Model files carry rounded angles (``rpy="1.5708"``)
and the float noise of composed placements. The nominal chain puts angles near multiples of 90
degrees exactly there, keeps multiples of 15 degrees as the square roots that they are made of,
leaves lengths at their decimal value, and replaces any other twist by a rational point of the unit
circle. Everything that was moved is listed with its size.

A turn about a joint's own axis is no geometry at all: it only shifts where the joint's
zero is. Such turns are taken out of the placements and kept as joint offsets, so that a
link turned by 45 degrees about its axis stays exact.

The design of a robot is what its file is an imperfect copy of. Two chains are compared by their
joint axes at zero, as lines in space, once they lie on each other as well as they can: neither the
base nor where a file puts its frames on an axis matters.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing.errors import OptionError
from pinsing.interface import checked
from pinsing.measures import FLOAT_NOISE, ROUNDING, Array, Chain
from pinsing.prose import one_line
from pinsing.robot.arm import Arm
from pinsing.robot.models import add_joint, axis_rotation, joint_axis
from pinsing.robot.surd import Exact, Surd, cosine, sine


def flatten(arm: Arm) -> Chain:
    """Return the chain with every axis along z, a joint for each model velocity; read-only."""
    return arm.once("chain", lambda: _flatten(arm))


def _flatten(arm: Arm) -> Chain:
    model = arm.model
    rotations, translations, sliding = [], [], []
    before = np.eye(3)
    for index in range(1, model.njoints):
        axis, prismatic = joint_axis(model.joints[index])
        turned = axis_rotation(axis)
        placement = model.jointPlacements[index]
        rotations.append(before.T @ placement.rotation @ turned)
        translations.append(before.T @ placement.translation)
        sliding.append(prismatic)
        before = turned
    tip = model.frames[arm.tip_id].placement
    rotations.append(before.T @ tip.rotation)
    translations.append(before.T @ tip.translation)
    return _frozen(
        Chain(np.array(rotations), np.array(translations), np.array(sliding, dtype=bool))
    )


def chain_differs(arm: Arm, placements: Array) -> bool:
    """Whether joints of an arm are placed otherwise than ``placements`` (k + 1, 3, 4) say."""
    here = placements_of(arm)
    return here.shape != placements.shape or bool(np.abs(here - placements).max() > ROUNDING)


def placements_of(arm: Arm) -> Array:
    """Return where joints and tip are in the joint before (k + 1, 3, 4): rotations, and metres."""
    chain = flatten(arm)
    return np.concatenate([chain.R, chain.t[..., None]], axis=2)


def on_chain(arm: Arm, chain: Chain, **changes: Any) -> Arm:
    """Return an arm with its joint names, limits and tip on another chain, and other fields."""
    model, last = pin.Model(), 0
    model.name = arm.name
    for i, slides in enumerate(chain.prismatic):
        kind = pin.JointModelPZ() if slides else pin.JointModelRZ()
        last = add_joint(model, last, kind, pin.SE3(chain.R[i], chain.t[i]), arm.model, i + 1)
    tip = pin.SE3(chain.R[-1], chain.t[-1])
    model.addFrame(pin.Frame(arm.tip, last, 0, tip, pin.FrameType.OP_FRAME))
    made = replace(arm, model=model, **changes)
    R, t = (np.add(x, 0.0, order="C") for x in (chain.R, chain.t))  # no zero has a sign
    made.once("chain", lambda: _frozen(Chain(R, t, chain.prismatic)))
    return made


def _frozen(chain: Chain) -> Chain:
    for array in (chain.R, chain.t, chain.prismatic):
        array.flags.writeable = False
    return chain


def jacobian_change(one: Chain, other: Chain, arm: Arm, tip_angle: float = 0.0) -> float:
    """Bound the norm by which scaled Jacobian columns differ between two chains, over the limits.

    With e_k the angle and d_k the length by which C_k differs, column i (z x p, z) turns by at most
    E_i, the sum of e_k, k <= i, and p moves by at most D_i, the sum over k > i of d_k plus
    |t_k| (e_{i+1} + ... + e_{k-1}), slides included: so the bounds are D_i + E_i reach (over the
    length scale) and E_i. The tip's own axes turn by all angles and ``tip_angle`` (radians) more.
    """
    n = one.n
    angle = np.array([rotation_angle(a.T @ b) for a, b in zip(one.R, other.R, strict=True)])
    angle[n] = 0.0  # what it turns is the tip frame alone
    with_tip = float(angle.sum()) + tip_angle if arm.task.at_tip else 0.0
    shift = np.linalg.norm(one.t - other.t, axis=1)
    travel = np.maximum(np.abs(arm.lower), np.abs(arm.upper))  # of each joint from its zero
    if arm.coupling is not None:
        matrix = np.abs(arm.coupling.matrix)
        travel = _product(matrix, travel).sum(axis=1) + np.abs(arm.coupling.offset)
    step = (np.linalg.norm(one.t, axis=1) + np.linalg.norm(other.t, axis=1)) / 2
    step[1:] += np.where(one.prismatic, travel, 0.0)
    turned = np.cumsum(angle)
    between = np.maximum(turned - angle - turned[:n, None], 0.0)  # [i, k]: of joint i and C_k
    beyond, later = (np.cumsum(x[::-1])[::-1][1:] for x in (step, shift))  # of all after each
    spun = turned[:n] + with_tip
    # An unlimited slide has an infinite step: no turn before it, no change.
    moved = later + _product(between, step).sum(axis=1) + _product(spun, beyond)
    moved, spun = np.where(one.prismatic, [spun, 0 * spun], [moved, spun])
    if arm.coupling is not None:  # a free joint moves its followers along
        moved, spun = _product(matrix.T, moved).sum(axis=-1), matrix.T @ spun
    return float(np.hypot(moved / arm.length_scale, spun).max())


def _product(a: Array | float, b: Array | float) -> Array:
    """Product in which zero times infinity is zero."""
    out = np.zeros(np.broadcast_shapes(np.shape(a), np.shape(b)))
    return np.multiply(a, b, out=out, where=(np.asarray(a) != 0) & (np.asarray(b) != 0))


def rotation_angle(R: Array) -> float:
    """Angle (radians) of a rotation matrix, accurate near zero."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R.tolist()
    return math.atan2(math.hypot(zy - yz, xz - zx, yx - xy) / 2, (xx + yy + zz - 1) / 2)


@dataclass(frozen=True)
class Snap:
    """One number of the geometry that was moved.

    Attributes
    ----------
    where : str
        Between which joints.
    what : str
        ``angle``, ``length``, or ``twist`` (a rational rotation near the given one).
    raw, nominal : float
        Value before and after, radians or metres.
    """

    where: str
    what: str
    raw: float
    nominal: float

    @property
    def size(self) -> float:
        """Distance moved, radians or metres."""
        return abs(self.nominal - self.raw)

    def __str__(self) -> str:
        unit = "m" if self.what == "length" else "rad"
        return (
            f"{self.where}: {self.what} {self.raw:.10g} -> {self.nominal:.10g} {unit} "
            f"(moved {self.size:.1e})"
        )


@dataclass(frozen=True)
class Deviation:
    """How far the geometry of an answer is from the file's, where that is more than rounding.

    Attributes
    ----------
    angle : float
        Radians; the largest angle that was moved to a multiple of 15 degrees.
    length : float
        Metres; the largest length that was put to zero, by ``snap_length`` alone.
    twist : float
        Radians, and so no entry of a rotation differs by more; the largest angle for which a
        rational rotation stands that is as near as ten digits tell.
    """

    angle: float
    length: float
    twist: float

    @classmethod
    def of(cls, snaps: Iterable[Snap]) -> Deviation | None:
        """Return what was moved by more than rounding; None where nothing was."""
        largest = {"angle": ROUNDING, "length": ROUNDING, "twist": 0.0}
        start = dict(largest)
        for snap in snaps:
            largest[snap.what] = max(largest[snap.what], snap.size)
        if largest == start:
            return None
        return cls(**{what: size if size > start[what] else 0.0 for what, size in largest.items()})

    @property
    def geometry(self) -> str:
        """Geometry that the answer is about."""
        if self.angle or self.length:
            return "the nominal design"
        return "a rational geometry beside the file's"

    @property
    def change(self) -> str:
        """By how much that differs from the file."""
        said = []
        if self.angle:
            degrees = math.degrees(self.angle)
            said.append(f"angles moved by at most {self.angle:.1e} rad ({degrees:.1g}°)")
        if self.twist:
            said.append(f"twists by at most {self.twist:.1e} rad, to rational rotations")
        moved = f"by at most {1e3 * self.length:.3g} mm" if self.length else "as written"
        return ", ".join([*said, f"lengths {moved}"])

    def __str__(self) -> str:
        return f"{self.geometry}: {self.change}"


Length3 = tuple[Fraction, Fraction, Fraction]
Row = tuple[Exact, Exact, Exact]
Matrix = tuple[Row, Row, Row]
FIFTEEN = math.pi / 12
IDENTITY: Matrix = tuple(tuple(Fraction(i == k) for k in range(3)) for i in range(3))  # type: ignore[assignment]


class ExactPlacements:
    """A chain in exact numbers, and the raw one with its axes turned alike.

    ``angle`` (radians) and ``length`` (metres) snap to multiples of 90 degrees and to zero;
    ``rotation``, ``translation`` and ``offset`` are as in ``Nominal``. ``raw`` has its fixed joints
    near right angles put there; ``turned`` has turned axes, too: what else differs was snapped.
    """

    def __init__(
        self,
        raw: Chain,
        places: Sequence[str],
        angle: float,
        length: float = 0.0,
        with_tip: bool = False,
        arm: Arm | None = None,
    ) -> None:
        self.raw, self.places = raw, places
        self.angle_tol, self.snap_length = max(angle, ROUNDING), length
        self.fine_tol = max(angle / 100, ROUNDING)  # to a multiple of 15 degrees
        self.noise = FLOAT_NOISE * (float(np.linalg.norm(raw.t, axis=1).sum()) or 1.0)
        self.snaps: list[Snap] = []
        self.tip_rotation: Matrix | None = None
        if arm is not None:
            self.put_fixed_joints(arm)
        self._make(with_tip)

    def put_fixed_joints(self, arm: Arm) -> None:
        """Put fixed joints at right angles, where they are near, before all else."""
        raw, model, joint = self.raw, arm.model, pin.FrameType.JOINT
        R, t = raw.R.copy(), raw.t.copy()
        own = {f.parentJoint: f.parentFrame for f in model.frames if f.type == joint}
        before = np.eye(3)
        for i in range(raw.n + 1):
            tip = model.frames[arm.tip_id]
            at = own.get(i + 1, 0) if i < raw.n else tip.parentFrame
            place = model.jointPlacements[i + 1] if i < raw.n else tip.placement
            composed = []
            while at and (here := model.frames[at]).parentJoint == i and here.type != joint:
                composed.append(here.placement)
                at = here.parentFrame
            made, last, moved = pin.SE3.Identity(), pin.SE3.Identity(), False
            for here in reversed(composed):
                step, last = last.actInv(here), here
                found = self._signed_permutation(i, step.rotation)
                quarter = step.rotation if found is None else np.array(found, dtype=float)
                if rotation_angle(quarter.T @ step.rotation) > FLOAT_NOISE:
                    step, moved = pin.SE3(quarter, step.translation), True
                made = made * step
            if moved:
                made = made * last.actInv(place)
                R[i] = before.T @ made.rotation @ place.rotation.T @ before @ R[i]
                t[i] = before.T @ made.translation
            if i < raw.n:
                before = axis_rotation(joint_axis(model.joints[i + 1])[0])
        if (R != raw.R).any() or (t != raw.t).any():
            self.raw = Chain(R, t, raw.prismatic)

    def _make(self, with_tip: bool) -> None:
        raw, n = self.raw, self.raw.n
        R, t = [r + 0.0 for r in raw.R], [np.array(v) for v in raw.t]  # no zero has a sign
        twist: list[Matrix | None] = [self._signed_permutation(i, R[i]) for i in range(n)]
        offset = np.zeros(n)
        # Backwards: Rz(a) at the left of C_i goes into the joint before it, or on beyond a slide.
        # A turn about z alone is left to the second pass, which keeps t as it was written.
        for i in range(n - 1, 0, -1):
            if twist[i] is not None or not self._tilted(R[i]):
                continue
            a = self._snap_angle(i, math.atan2(R[i][0, 2], -R[i][1, 2]))
            if math.cos(a) == 1.0:
                continue
            turn = turn_about_z(a)
            R[i], t[i] = turn.T @ R[i], turn.T @ t[i]
            if raw.prismatic[i - 1]:
                R[i - 1] = R[i - 1] @ turn
                twist[i - 1] = self._signed_permutation(i - 1, R[i - 1])
            else:
                offset[i - 1] += a
        # Forwards: Rz(b) at the right of C_i goes into the joint after it, or on beyond a slide.
        for i in range(n):
            if twist[i] is not None:
                continue
            if self._tilted(R[i]):
                b = math.atan2(R[i][2, 0], R[i][2, 1])
            else:
                b = math.copysign(1.0, R[i][2, 2]) * _yaw(R[i])
            b = self._snap_angle(i, b)
            turn = turn_about_z(b)
            R[i] = R[i] @ turn.T
            if not raw.prismatic[i]:
                offset[i] += b
            elif b:
                R[i + 1], t[i + 1] = turn @ R[i + 1], turn @ t[i + 1]
                if i + 1 < n:
                    twist[i + 1] = self._signed_permutation(i + 1, R[i + 1])
        tip_turn = R[n]
        rotation = [self._exact_rotation(i, R[i]) if m is None else m for i, m in enumerate(twist)]
        rotation.append(IDENTITY)
        moved = self._slid_to_common_normals(R, t, twist, rotation)
        rows = ([self._length(i, x) for x in v.tolist()] for i, v in enumerate(moved))
        self.translation: tuple[Length3, ...] = tuple((x, y, z) for x, y, z in rows)
        if with_tip:
            exact = self._signed_permutation(n, tip_turn)
            self.tip_rotation = exact or self._exact_rotation(n, tip_turn)
        # So far R and t are the raw geometry still, only with turned axes: what was snapped
        # is the difference between them and the rational numbers.
        R[n] = np.eye(3)
        self.turned = Chain(np.array(R), np.array(t), raw.prismatic)
        self.rotation, self.offset, self.tip_turn = tuple(rotation), offset, tip_turn

    def _slid_to_common_normals(
        self, R: list[Array], t: list[Array], twist: list[Matrix | None], rotation: Sequence[Matrix]
    ) -> list[Array]:
        """Move the origins of tilted axes along them, to where the axes come closest.

        With R = Rx(alpha), t is (a, 0, d) plus d' along the new axis, which commutes with the joint
        and goes into the next placement: a is zero, no rounding of it, where axes meet. Origins of
        ``t`` move along raw axes, those returned along exact ones. Decimals beside a root stay.
        """
        moved = [np.array(v) for v in t]
        for i in range(1, self.raw.n):
            raw = R[i][:, 2]  # (0, -sin alpha, cos alpha), up to what is snapped
            if twist[i] is not None or abs(raw[1]) < 0.2:
                continue  # nearly parallel axes come closest far away, if at all
            exact = [row[2] for row in rotation[i]]
            rooted = any(isinstance(x, Surd) for x in exact)
            # A rational twist is close to the raw one, of which lengths may be multiples.
            whole = rooted or all(x in (-1, 0, 1) for x in exact)
            axis = np.array([float(x) for x in exact]) if whole else raw
            beyond = moved[i][1] / axis[1]
            there = moved[i] - beyond * axis
            if rooted and not (self._written(beyond) and self._written(there[2])):
                continue
            moved[i] = there
            moved[i][1] = 0.0
            t[i] = t[i] - beyond * raw
            for of in (moved, t):
                of[i + 1] = of[i + 1] + np.array([0.0, 0.0, beyond])
        return moved

    def _written(self, value: float) -> bool:
        """Return True for a length that somebody wrote; a product with a root has more digits."""
        return abs(round(value, 8) - value) <= self.noise

    def _tilted(self, R: Array) -> bool:
        return bool(np.hypot(R[0, 2], R[1, 2]) > self.angle_tol)

    def _signed_permutation(self, i: int, R: Array) -> Matrix | None:
        """The quarter-turn matrix within the angle tolerance of R, if there is one."""
        P = np.rint(R)
        if (np.abs(P).sum(axis=0) != 1).any() or np.linalg.det(P) < 0.5:
            return None
        angle = rotation_angle(P.T @ R)
        if angle > self.angle_tol:
            return None
        if angle > FLOAT_NOISE:
            self._note_snap(Snap(self.places[i], "angle", angle, 0.0))
        a, b, c = ((Fraction(x), Fraction(y), Fraction(z)) for x, y, z in P.astype(int).tolist())
        return a, b, c

    def _note_snap(self, snap: Snap) -> None:
        """Keep of each placement the number that moved farthest."""
        same = [s for s in self.snaps if (s.where, s.what) == (snap.where, snap.what)]
        self.snaps = [s for s in self.snaps if s not in same]
        self.snaps.append(max([snap, *same], key=lambda s: abs(s.raw - s.nominal)))

    def _snap_angle(self, i: int, angle: float) -> float:
        """Put ``angle`` on a multiple of 90 degrees, or (a hundred times closer) of 15 degrees."""
        for step, tolerance in ((math.pi / 2, self.angle_tol), (FIFTEEN, self.fine_tol)):
            near = round(angle / step) * step
            if abs(angle - near) <= tolerance:
                if abs(angle - near) > FLOAT_NOISE:
                    self._note_snap(Snap(self.places[i], "angle", angle, near))
                return near
        return angle

    def _exact_rotation(self, i: int, R: Array) -> Matrix:
        """Rz(a) Rx(alpha) Rz(b) near R, in exact numbers; b is that of the tip alone."""
        # After both passes R = Rx(alpha), but for the first, which has no joint before it.
        at_tip = i == self.raw.n
        tilted = at_tip and self._tilted(R)
        first = math.atan2(R[0, 2], -R[1, 2]) if tilted else _yaw(R)
        tilt = math.atan2(math.hypot(R[0, 2], R[1, 2]), R[2, 2])
        tilt = tilt if at_tip else math.copysign(tilt, R[2, 1])
        last = math.atan2(R[2, 0], R[2, 1]) if tilted else 0.0
        (ca, sa), (c, s), (cb, sb) = (self._circle(i, angle) for angle in (first, tilt, last))
        return (
            (ca * cb - sa * c * sb, -ca * sb - sa * c * cb, sa * s),
            (sa * cb + ca * c * sb, -sa * sb + ca * c * cb, -ca * s),
            (s * sb, s * cb, c),
        )

    def _circle(self, i: int, angle: float) -> tuple[Exact, Exact]:
        """Exact (cos, sin) near ``angle``, rational but at multiples of 15 degrees."""
        snapped = self._snap_angle(i, angle)
        fine = round(snapped / FIFTEEN)
        if abs(snapped - fine * FIFTEEN) <= FLOAT_NOISE:
            return cosine(fine), sine(fine)
        quarter = round(angle / (math.pi / 2))
        half = Fraction(math.tan((angle - quarter * math.pi / 2) / 2)).limit_denominator(10**6)
        c, s = (1 - half**2) / (1 + half**2), 2 * half / (1 + half**2)
        exact = 2 * math.atan(half) + quarter * math.pi / 2
        if abs(exact - angle) > 1e-15:
            self.snaps.append(Snap(self.places[i], "twist", angle, exact))
        for _ in range(quarter % 4):
            c, s = -s, c
        return c, s

    def _length(self, i: int, value: float) -> Fraction:
        """The decimal that was written, the shortest within noise; below ``snap_length``, zero."""
        if abs(value) >= self.snap_length:
            decimals = (round(value, digits) for digits in range(16))
            near = (decimal for decimal in decimals if abs(decimal - value) <= self.noise)
            return Fraction(repr(next(near, value)))
        if abs(value) > self.noise:
            self.snaps.append(Snap(self.places[i], "length", value, 0.0))
        return Fraction(0)


def turn_about_z(angle: float) -> Array:
    """Rotation matrix, exact at right angles."""
    quarter = angle / (math.pi / 2)
    whole = quarter == round(quarter)
    c, s = (
        (cosine(6 * round(quarter)), sine(6 * round(quarter)))
        if whole
        else (math.cos(angle), math.sin(angle))
    )
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=float)


def _yaw(R: Array) -> float:
    return math.atan2(R[1, 0], R[0, 0])


ANGLE_TOL = 2e-3
"""Default tolerance, radians, for moving an angle to a multiple of 90 degrees (1.57, 3.14)."""

USUAL = (ANGLE_TOL, 0.0)
_ITSELF = "nominal geometry of itself"


@dataclass(frozen=True, eq=False)
class Nominal:
    """Exact geometry of an arm.

    The tip placement is C_0 M_0(q_0 + offset_0) C_1 ... C_n up to the orientation of
    the tip frame itself, which only tasks with rows in the tip's axes depend on.

    Attributes
    ----------
    arm : Arm
        The same arm on the nominal geometry: same joint vectors, tip, task and limits.
    rotation : tuple of n + 1 exact 3x3 matrices
        Rotation of each C_i, of Fractions and, for twists of 15 degrees and its multiples,
        of Surds; the last is the identity.
    translation : tuple of n + 1 rational triples
        Translation of each C_i, metres.
    tip_rotation : exact 3x3 matrix
        Rotation of the tip frame after C_n, where the task has rows in its axes; else the identity.
    prismatic : tuple of bool
        Which joints slide.
    offset : (n,) array
        Radians; added to the joint vector of the model (zero for most arms); with mimic
        joints in the chain, n counts these too.
    snaps : tuple of Snap
        What was moved.
    jacobian_change : float
        Upper bound, at any configuration within the limits, of the change of any column
        of the scaled task Jacobian (translation rows over the length scale); infinite
        if a prismatic joint without limits makes it so.
    """

    arm: Arm
    rotation: tuple[Matrix, ...]
    translation: tuple[Length3, ...]
    tip_rotation: Matrix
    prismatic: tuple[bool, ...]
    offset: Array
    snaps: tuple[Snap, ...]
    jacobian_change: float

    def __repr__(self) -> str:
        moved = f"{len(self.snaps)} numbers moved" if self.snaps else "nothing moved"
        change = f"Jacobian columns change by at most {self.jacobian_change:.1e}"
        return one_line("Nominal", f"{self.arm.name}: {moved}, {change}")

    @property
    def exact(self) -> bool:
        """True if the nominal geometry agrees with the raw one to 1e-12."""
        return self.jacobian_change <= 1e-12


@checked
def nominal(arm: Arm, angle_tol: float = ANGLE_TOL, snap_length: float = 0.0) -> Nominal:
    """Make the geometry of ``arm`` exact. That of an arm made so stays.

    Parameters
    ----------
    arm : Arm
        Any arm.
    angle_tol : float
        Radians; an angle closer than this to a multiple of 90 degrees is put there. What is
        within 1e-9 always is.
    snap_length : float
        Metres; a coordinate of a placement shorter than this is put to zero. Off by default:
        lengths stay the decimals that the file has.

    Returns
    -------
    Nominal
        The exact chain, the arm on it, and what was moved.

    Raises
    ------
    OptionError
        If a tolerance is negative or not finite, or ``angle_tol`` is 45 degrees or more.

    Examples
    --------
    >>> import pinsing
    >>> exact = pinsing.robot.nominal(pinsing.load("ur5"))
    >>> exact.snaps[0].what, exact.snaps[0].nominal, exact.jacobian_change < 1e-10
    ('angle', 0.0, True)
    """
    OptionError.refuse_if(
        not 0 <= angle_tol < math.pi / 4,
        f"angle_tol must lie in [0, pi/4) radians, got {angle_tol!r}",
    )
    OptionError.refuse_if(
        not 0 <= snap_length < math.inf,
        f"snap_length must be zero or a positive length, got {snap_length!r}",
    )
    key = (float(angle_tol), float(snap_length))
    if key == USUAL and _ITSELF in arm.known:  # made for each who asks: an arm holds not itself
        return Nominal(arm=arm, **arm.known[_ITSELF], snaps=(), jacobian_change=0.0)
    return arm.once(f"nominal {key}", lambda: _nominal(arm, key))


def _nominal(arm: Arm, key: tuple[float, float]) -> Nominal:
    ends = [arm.base, *list(arm.model.names)[1:], arm.tip]
    places = [f"{a} to {b}" for a, b in itertools.pairwise(ends)]
    raw = flatten(arm)
    found = ExactPlacements(raw, places, *key, with_tip=bool(arm.task.at_tip), arm=arm)
    tip_turn, exact_tip, n = found.tip_turn, found.tip_rotation, raw.n
    offset = found.offset
    R = [np.array([[float(x) for x in row] for row in m]) for m in found.rotation]
    t = np.array([[float(x) for x in row] for row in found.translation])
    tip_angle = 0.0
    if exact_tip is not None:
        there = np.array([[float(x) for x in row] for row in exact_tip])
        tip_angle, tip_turn = rotation_angle(there.T @ tip_turn), there
    change = jacobian_change(found.turned, Chain(np.array(R), t, raw.prismatic), arm, tip_angle)
    if found.raw is not raw:
        change += jacobian_change(raw, found.raw, arm, rotation_angle(raw.R[n].T @ found.raw.R[n]))
    for i in range(n):
        if offset[i] != 0.0:  # fold the offset back: the arm keeps the user's joint zero
            R[i] = R[i] @ turn_about_z(float(offset[i]))
    R[n] = R[n] @ tip_turn
    chain = Chain(np.array(R), t, raw.prismatic)
    on_it = on_chain(arm, chain)
    exact: dict[str, Any] = {
        "rotation": found.rotation,
        "translation": found.translation,
        "tip_rotation": found.rotation[n] if exact_tip is None else exact_tip,
        "prismatic": tuple(bool(p) for p in raw.prismatic),
        "offset": offset,
    }
    on_it.known[_ITSELF] = exact
    snaps = tuple(s for s in found.snaps if s.size > 0)
    return Nominal(arm=on_it, **exact, snaps=snaps, jacobian_change=change)


PRIMES = (4611686018427387817, 4611686018427387409)
"""The two largest primes below 2^62 that are 1 modulo 24."""


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
        return on_chain(robot, chain, design=None)
    OptionError.refuse_if(
        design.coupling is not None or list(design.prismatic) != list(robot.prismatic),
        f"the design {design.name!r} has {design.n} joints of other kinds than the {robot.n} "
        f"of {robot.name!r}: name the design of this robot",
    )
    made = on_chain(robot, flatten(nominal(design).arm), design=None)
    require_same(robot, made, f"the design {design.name!r}")
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
