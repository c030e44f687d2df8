"""Nominal geometry: the chain of an arm with exact numbers, and what that changed.

Model files carry rounded angles (``rpy="1.5708"``) and the float noise of composed
placements. The nominal chain puts angles near multiples of 90 degrees exactly there,
keeps multiples of 15 degrees as the square roots that they are made of, gives lengths
their shortest decimal value, and replaces any other twist by a rational point of the unit
circle. Everything that was moved is listed with its size.

A turn about a joint's own axis is no geometry at all: it only shifts where the joint's
zero is. Such turns are taken out of the placements and kept as joint offsets, so that a
link turned by 45 degrees about its axis stays exact.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.errors import OptionError
from pinsing.geometry.chain import Chain, chain_model, flatten
from pinsing.geometry.jacobian_bound import jacobian_change, rotation_angle
from pinsing.geometry.snap import Snap, shortest_decimal
from pinsing.geometry.surd import Exact, cosine, sine
from pinsing.notebook import one_line
from pinsing.robot.arm import Arm

ANGLE_TOL = 2e-3
"""Default tolerance, radians, for moving an angle to a multiple of 90 degrees (1.57, 3.14)."""
_FINE = 1e-2
"""Fraction of the tolerance within which an angle goes to a multiple of 15 degrees."""

Length3 = tuple[Fraction, Fraction, Fraction]
Row = tuple[Exact, Exact, Exact]
Matrix = tuple[Row, Row, Row]
_FIFTEEN = math.pi / 12
_QUARTER: tuple[tuple[int, int], ...] = ((1, 0), (0, 1), (-1, 0), (0, -1))
_FLOAT_NOISE = 1e-13
_TWIST_DENOMINATOR = 10**6
_STEEP = 0.2  # sine of a twist from which on origins are slid along their axes


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
def nominal(
    arm: Arm,
    angle_tol: float = ANGLE_TOL,
    snap_length: float = 0.0,
    *,
    rational: bool = False,
) -> Nominal:
    """Make the geometry of ``arm`` exact.

    Parameters
    ----------
    arm : Arm
        Any arm.
    angle_tol : float
        Radians; an angle closer than this to a multiple of 90 degrees is put there.
    snap_length : float
        Metres; a coordinate of a placement shorter than this is put to zero. Off by default.
    rational : bool
        Replace twists of 15, 30, 45, 60, 75 degrees by rational ones nearby, like any other.

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
    >>> exact = pinsing.nominal(pinsing.load("ur5"))
    >>> exact.snaps[0].what, exact.snaps[0].nominal, exact.jacobian_change < 1e-10
    ('angle', 0.0, True)
    """
    if not 0 <= angle_tol < math.pi / 4:
        raise OptionError(f"angle_tol must lie in [0, pi/4) radians, got {angle_tol!r}")
    if not 0 <= snap_length < math.inf:
        raise OptionError(f"snap_length must be zero or a positive length, got {snap_length!r}")
    key = (float(angle_tol), float(snap_length), bool(rational))
    return arm.once(f"nominal {key}", lambda: _Maker(arm, flatten(arm), *key).make())


class _Maker:
    """Carries the lists that the passes over one chain fill."""

    def __init__(
        self, arm: Arm, raw: Chain, angle_tol: float, snap_length: float, rational: bool
    ) -> None:
        self.arm, self.raw, self.rational = arm, raw, rational
        self.angle_tol, self.snap_length = angle_tol, snap_length
        self.snaps: list[Snap] = []
        names = list(arm.model.names)[1:]
        ends = [arm.base, *names, arm.tip]
        self.places = [f"{a} to {b}" for a, b in itertools.pairwise(ends)]

    def make(self) -> Nominal:
        raw, n = self.raw, self.raw.n
        R, t = [np.array(r) for r in raw.R], [np.array(v) for v in raw.t]
        twist: list[Matrix | None] = [self._signed_permutation(i, R[i]) for i in range(n)]
        offset = np.zeros(n)
        tip_turn = R[n]
        # Backwards: Rz(a) at the left of C_i goes into the joint before it.
        carried = np.eye(3)  # rotation that a prismatic joint passes on to the left
        for i in range(n, -1, -1):
            if i < n:
                R[i] = R[i] @ carried
                carried_here = not np.array_equal(carried, np.eye(3))
                if carried_here:
                    twist[i] = self._signed_permutation(i, R[i])
            carried = np.eye(3)
            # A turn about z alone is left to the second pass, which keeps t as it was written.
            if i == n or twist[i] is not None or i == 0 or not self._tilted(R[i]):
                continue
            a = math.atan2(R[i][0, 2], -R[i][1, 2])
            a = self._snap_angle(i, a)
            if math.cos(a) == 1.0:
                continue
            turn = _rz(a)
            R[i], t[i] = turn.T @ R[i], turn.T @ t[i]
            if raw.prismatic[i - 1]:
                carried = turn
            else:
                offset[i - 1] += a
        # Forwards: Rz(b) at the right of C_i goes into the joint after it.
        carried = np.eye(3)
        for i in range(n):
            if not np.array_equal(carried, np.eye(3)):
                R[i], t[i] = carried @ R[i], carried @ t[i]
                twist[i] = self._signed_permutation(i, R[i])
            carried = np.eye(3)
            if twist[i] is not None:
                continue
            if self._tilted(R[i]):
                b = math.atan2(R[i][2, 0], R[i][2, 1])
            else:
                b = math.copysign(1.0, R[i][2, 2]) * _yaw(R[i])
            b = self._snap_angle(i, b)
            turn = _rz(b)
            R[i] = R[i] @ turn.T
            if raw.prismatic[i]:
                carried = turn
            else:
                offset[i] += b
        if not np.array_equal(carried, np.eye(3)):
            t[n], tip_turn = carried @ t[n], carried @ tip_turn
        self._slide_to_common_normals(R, t, twist)
        rotation = [
            self._rational_rotation(i, R[i]) if m is None else m for i, m in enumerate(twist)
        ]
        rotation.append(_identity())
        exact_tip = self._tip_rotation(tip_turn) if self.arm.task.at_tip else None
        lengths = self._lengths(t)
        # So far R and t are the raw geometry still, only with turned axes: what was snapped
        # is the difference between them and the rational numbers.
        R[n] = np.eye(3)
        turned = Chain(np.array(R), np.array(t), raw.prismatic)
        return self._finish(turned, rotation, lengths, offset, tip_turn, exact_tip)

    def _slide_to_common_normals(
        self, R: list[Array], t: list[Array], twist: list[Matrix | None]
    ) -> None:
        """Move the origins of tilted axes along them, to where the axes come closest.

        An origin may sit anywhere on its axis. With R = Rx(alpha), the translation is
        (a, 0, d) plus d' along the new axis, which commutes with the joint's motion and goes
        into the next placement; axes that meet then have a = 0 and not a rounding of it.
        """
        for i in range(1, self.raw.n):
            axis = R[i][:, 2]  # (0, -sin alpha, cos alpha), up to what will be snapped
            if twist[i] is not None or abs(axis[1]) < _STEEP:
                continue  # nearly parallel axes come closest far away, if at all
            beyond = t[i][1] / axis[1]
            t[i] = t[i] - beyond * axis
            t[i][1] = 0.0
            t[i + 1] = t[i + 1] + np.array([0.0, 0.0, beyond])

    def _tilted(self, R: Array) -> bool:
        return bool(np.hypot(R[0, 2], R[1, 2]) > self.angle_tol)

    def _signed_permutation(self, i: int, R: Array) -> Matrix | None:
        """The quarter-turn matrix within the angle tolerance of R, if there is one."""
        P = np.round(R)
        if not np.array_equal(np.abs(P).sum(axis=0), np.ones(3)) or np.linalg.det(P) < 0.5:
            return None
        angle = rotation_angle(P.T @ R)
        if angle > self.angle_tol:
            return None
        if angle > _FLOAT_NOISE:
            self._replace_snap(Snap(self.places[i], "angle", angle, 0.0))
        rows = [tuple(Fraction(int(x)) for x in row) for row in P]
        return (rows[0], rows[1], rows[2])  # type: ignore[return-value]

    def _replace_snap(self, snap: Snap) -> None:
        self.snaps = [s for s in self.snaps if (s.where, s.what) != (snap.where, snap.what)]
        self.snaps.append(snap)

    def _snap_angle(self, i: int, angle: float) -> float:
        """Put ``angle`` on a multiple of 90 degrees, or (a hundred times closer) of 15 degrees."""
        quarter = round(angle / (math.pi / 2)) * (math.pi / 2)
        fine = round(angle / _FIFTEEN) * _FIFTEEN
        nominal_angle = angle
        if abs(angle - quarter) <= self.angle_tol:
            nominal_angle = quarter
        elif abs(angle - fine) <= self.angle_tol * _FINE:
            nominal_angle = fine
        if abs(nominal_angle - angle) > _FLOAT_NOISE:
            self._replace_snap(Snap(self.places[i], "angle", angle, nominal_angle))
        return nominal_angle

    def _rational_rotation(self, i: int, R: Array) -> Matrix:
        """Rz(a) Rx(alpha) near R, in exact numbers."""
        alpha = math.atan2(math.hypot(R[0, 2], R[1, 2]), R[2, 2])
        yaw = math.atan2(R[1, 0], R[0, 0])
        # After both passes R = Rx(alpha), but for the first, which has no joint before it.
        tilt = alpha if (_rz(yaw).T @ R)[2, 1] >= 0 else -alpha
        cos_yaw, sin_yaw = self._circle(i, yaw)
        cos_tilt, sin_tilt = self._circle(i, tilt)
        return (
            (cos_yaw, -sin_yaw * cos_tilt, sin_yaw * sin_tilt),
            (sin_yaw, cos_yaw * cos_tilt, -cos_yaw * sin_tilt),
            (Fraction(0), sin_tilt, cos_tilt),
        )

    def _tip_rotation(self, R: Array) -> Matrix:
        """Rz(a) Rx(alpha) Rz(b) near R, in exact numbers."""
        n = self.raw.n
        quarters = self._signed_permutation(n, R)
        if quarters is not None:
            return quarters
        tilted = self._tilted(R)
        first = math.atan2(R[0, 2], -R[1, 2]) if tilted else _yaw(R)
        tilt = math.atan2(math.hypot(R[0, 2], R[1, 2]), R[2, 2])
        last = math.atan2(R[2, 0], R[2, 1]) if tilted else 0.0
        (ca, sa), (c, s), (cb, sb) = (self._circle(n, angle) for angle in (first, tilt, last))
        return (
            (ca * cb - sa * c * sb, -ca * sb - sa * c * cb, sa * s),
            (sa * cb + ca * c * sb, -sa * sb + ca * c * cb, -ca * s),
            (s * sb, s * cb, c),
        )

    def _circle(self, i: int, angle: float) -> tuple[Exact, Exact]:
        """Exact (cos, sin) near ``angle``, rational but at multiples of 15 degrees."""
        fine = round(angle / _FIFTEEN)
        if not self.rational and fine % 6:
            moved = abs(fine * _FIFTEEN - angle)
            if moved <= self.angle_tol * _FINE:
                if moved > _FLOAT_NOISE:
                    self._replace_snap(Snap(self.places[i], "angle", angle, fine * _FIFTEEN))
                return cosine(fine), sine(fine)
        quarter = round(angle / (math.pi / 2))
        rest = angle - quarter * math.pi / 2
        if abs(rest) <= self.angle_tol:
            if abs(rest) > _FLOAT_NOISE:
                self._replace_snap(Snap(self.places[i], "angle", angle, angle - rest))
            c, s = Fraction(1), Fraction(0)
        else:
            half = Fraction(math.tan(rest / 2)).limit_denominator(_TWIST_DENOMINATOR)
            c, s = (1 - half**2) / (1 + half**2), 2 * half / (1 + half**2)
            exact = 2 * math.atan(half) + quarter * math.pi / 2
            if abs(exact - angle) > 1e-15:
                self.snaps.append(Snap(self.places[i], "twist", angle, exact))
        qc, qs = _QUARTER[quarter % 4]
        return c * qc - s * qs, s * qc + c * qs

    def _lengths(self, t: list[Array]) -> list[Length3]:
        """Shortest decimals, within what the moved angles leave uncertain anyway."""
        reach = float(sum(np.linalg.norm(v) for v in t)) or 1.0
        moved = max((s.size for s in self.snaps if s.what == "angle"), default=0.0)
        slack = moved * reach
        rows: list[Length3] = []
        for i, vector in enumerate(t):
            row = []
            for value in vector:
                value = float(value)
                if abs(value) < self.snap_length:
                    exact = Fraction(0)
                else:
                    exact = shortest_decimal(value, slack, _FLOAT_NOISE * reach)
                if abs(float(exact) - value) > _FLOAT_NOISE * reach:
                    self.snaps.append(Snap(self.places[i], "length", value, float(exact)))
                row.append(exact)
            rows.append((row[0], row[1], row[2]))
        return rows

    def _finish(
        self,
        turned: Chain,
        rotation: list[Matrix],
        lengths: list[Length3],
        offset: Array,
        tip_turn: Array,
        exact_tip: Matrix | None,
    ) -> Nominal:
        raw, n = self.raw, self.raw.n
        R = [np.array([[float(x) for x in row] for row in m]) for m in rotation]
        t = np.array([[float(x) for x in row] for row in lengths])
        tip_angle = 0.0
        if exact_tip is not None:
            there = np.array([[float(x) for x in row] for row in exact_tip])
            tip_angle, tip_turn = rotation_angle(there.T @ tip_turn), there
        at_zero = Chain(np.array(R), t, raw.prismatic)
        change = jacobian_change(turned, at_zero, self.arm, tip_angle)
        for i in range(n):
            if offset[i] != 0.0:  # fold the offset back: the arm keeps the user's joint zero
                turn = _rz(float(offset[i]))
                R[i] = R[i] @ turn
        R[n] = R[n] @ tip_turn
        chain = Chain(np.array(R), t, raw.prismatic)
        arm = replace(self.arm, model=chain_model(chain, self.arm))
        return Nominal(
            arm=arm,
            rotation=tuple(rotation),
            translation=tuple(lengths),
            tip_rotation=_identity() if exact_tip is None else exact_tip,
            prismatic=tuple(bool(p) for p in raw.prismatic),
            offset=offset,
            snaps=tuple(s for s in self.snaps if s.size > 0),
            jacobian_change=change,
        )


def _rz(angle: float) -> Array:
    quarter = angle / (math.pi / 2)
    if quarter == round(quarter):
        c, s = _QUARTER[round(quarter) % 4]
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=float)
    c_, s_ = math.cos(angle), math.sin(angle)
    return np.array([[c_, -s_, 0], [s_, c_, 0], [0, 0, 1]])


def _yaw(R: Array) -> float:
    return math.atan2(R[1, 0], R[0, 0])


def _identity() -> Matrix:
    one, zero = Fraction(1), Fraction(0)
    return ((one, zero, zero), (zero, one, zero), (zero, zero, one))
