"""The chain of an arm in exact numbers: right angles, roots, written decimals, rational twists.

What is moved is listed with its size; `nominal` says which arm that makes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from pinsing._types import Array, Chain
from pinsing.measures import FLOAT_NOISE, ROUNDING
from pinsing.robot.arm import Arm
from pinsing.robot.chain import rotation_angle, with_fixed_joints_put
from pinsing.robot.surd import Exact, Surd, cosine, sine


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


def shortest_decimal(value: float, noise: float) -> Fraction:
    """The decimal with the fewest digits within float ``noise`` of a length: the one written."""
    for digits in range(16):
        rounded = round(value, digits)
        if abs(rounded - value) <= noise:
            return Fraction(repr(rounded))
    return Fraction(repr(value))


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

        def put(i: int, R: Array) -> Array | None:
            found = self._signed_permutation(i, R)
            quarter = None if found is None else np.array(found, dtype=float)
            near = quarter is None or rotation_angle(quarter.T @ R) <= FLOAT_NOISE
            return None if near else quarter

        R, t = with_fixed_joints_put(arm, put)
        if (R != self.raw.R).any() or (t != self.raw.t).any():
            self.raw = Chain(R, t, self.raw.prismatic)

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
        rotation = [
            self._rational_rotation(i, R[i]) if m is None else m for i, m in enumerate(twist)
        ]
        rotation.append(IDENTITY)
        self.translation = self._lengths(self._slid_to_common_normals(R, t, twist, rotation))
        self.tip_rotation = self._tip_rotation(tip_turn) if with_tip else None
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
            self._replace_snap(Snap(self.places[i], "angle", angle, 0.0))
        a, b, c = ((Fraction(x), Fraction(y), Fraction(z)) for x, y, z in P.astype(int).tolist())
        return a, b, c

    def _replace_snap(self, snap: Snap) -> None:
        self.snaps = [s for s in self.snaps if (s.where, s.what) != (snap.where, snap.what)]
        self.snaps.append(snap)

    def _snap_angle(self, i: int, angle: float) -> float:
        """Put ``angle`` on a multiple of 90 degrees, or (a hundred times closer) of 15 degrees."""
        quarter = round(angle / (math.pi / 2)) * (math.pi / 2)
        fine = round(angle / FIFTEEN) * FIFTEEN
        nominal_angle = angle
        if abs(angle - quarter) <= self.angle_tol:
            nominal_angle = quarter
        elif abs(angle - fine) <= self.fine_tol:
            nominal_angle = fine
        if abs(nominal_angle - angle) > FLOAT_NOISE:
            self._replace_snap(Snap(self.places[i], "angle", angle, nominal_angle))
        return nominal_angle

    def _rational_rotation(self, i: int, R: Array) -> Matrix:
        """Rz(a) Rx(alpha) near R, in exact numbers."""
        alpha = math.atan2(math.hypot(R[0, 2], R[1, 2]), R[2, 2])
        yaw = math.atan2(R[1, 0], R[0, 0])
        # After both passes R = Rx(alpha), but for the first, which has no joint before it.
        tilt = alpha if (turn_about_z(yaw).T @ R)[2, 1] >= 0 else -alpha
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
        fine = round(angle / FIFTEEN)
        if fine % 6:
            moved = abs(fine * FIFTEEN - angle)
            if moved <= self.fine_tol:
                if moved > FLOAT_NOISE:
                    self._replace_snap(Snap(self.places[i], "angle", angle, fine * FIFTEEN))
                return cosine(fine), sine(fine)
        quarter = round(angle / (math.pi / 2))
        rest = angle - quarter * math.pi / 2
        if abs(rest) <= self.angle_tol:
            if abs(rest) > FLOAT_NOISE:
                self._replace_snap(Snap(self.places[i], "angle", angle, angle - rest))
            c, s = Fraction(1), Fraction(0)
        else:
            half = Fraction(math.tan(rest / 2)).limit_denominator(10**6)
            c, s = (1 - half**2) / (1 + half**2), 2 * half / (1 + half**2)
            exact = 2 * math.atan(half) + quarter * math.pi / 2
            if abs(exact - angle) > 1e-15:
                self.snaps.append(Snap(self.places[i], "twist", angle, exact))
        for _ in range(quarter % 4):
            c, s = -s, c
        return c, s

    def _lengths(self, t: list[Array]) -> tuple[Length3, ...]:
        """The decimals that were written; below ``snap_length``, zero."""
        rows: list[Length3] = []
        for i, vector in enumerate(t):
            row = []
            for value in vector.tolist():
                exact = Fraction(0)
                if abs(value) >= self.snap_length:
                    exact = shortest_decimal(value, self.noise)
                elif abs(value) > self.noise:
                    self.snaps.append(Snap(self.places[i], "length", value, 0.0))
                row.append(exact)
            rows.append((row[0], row[1], row[2]))
        return tuple(rows)


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
