"""Fixed transforms in the terms of a URDF, with right angles kept exact."""

from __future__ import annotations

import math

from pinsing._dataclass import dataclass

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Placement:
    """A fixed transform: a translation, then the rotation ``Rz(yaw) Ry(pitch) Rx(roll)``.

    Attributes
    ----------
    xyz : tuple of 3 floats
        Translation [m].
    rpy : tuple of 3 floats
        Roll, pitch and yaw [rad], as in the ``<origin>`` of a URDF.
    """

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)


def cos_sin(angle: float) -> tuple[float, float]:
    """Return cosine and sine, exactly 0 or ±1 where the angle [rad] is a double of k·pi/2."""
    quarters = round(angle / (math.pi / 2))
    if angle == quarters * (math.pi / 2):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarters % 4]
    return math.cos(angle), math.sin(angle)


def screw(
    theta: float = 0.0, d: float = 0.0, a: float = 0.0, alpha: float = 0.0, beyond: float = 0.0
) -> Placement:
    """Return ``Rz(theta) Tz(d) Tx(a) Rx(alpha) Tz(beyond)``; angles [rad], lengths [m].

    With ``beyond`` = 0 this is a row of a standard Denavit-Hartenberg table. Its rotation is
    roll = alpha, yaw = theta, as given and without rounding, which no row of a modified table
    (``Rx Tx Rz Tz``) offers.
    """
    c, s = cos_sin(theta)
    ca, sa = cos_sin(alpha)
    # "+ 0.0" turns -0.0 into 0.0.
    xyz = (a * c + beyond * sa * s + 0.0, a * s - beyond * sa * c + 0.0, d + beyond * ca + 0.0)
    return Placement(xyz, (alpha, 0.0, theta))


def modified_row(alpha: float, a: float, d: float, theta: float) -> Placement:
    """Return ``Rx(alpha) Tx(a) Rz(theta) Tz(d)`` (Craig 1986, Eq. 3.6)."""
    c, s = cos_sin(theta)
    ca, sa = cos_sin(alpha)
    rpy = roll_pitch_yaw(((c, -s, 0.0), (ca * s, ca * c, -sa), (sa * s, sa * c, ca)))
    return Placement((a + 0.0, -d * sa + 0.0, d * ca + 0.0), rpy)


def roll_pitch_yaw(R: tuple[Vector, Vector, Vector]) -> Vector:
    """Return the roll, pitch and yaw [rad] of a rotation matrix, given by rows.

    Accurate to rounding everywhere, gimbal lock (pitch = ±pi/2) included: yaw is taken of the
    matrix with the roll undone, so that an ill-determined roll cancels against it.
    """
    pitch = math.atan2(-R[2][0], math.hypot(R[0][0], R[1][0]))
    roll = math.atan2(R[2][1], R[2][2])
    c, s = cos_sin(roll)
    yaw = math.atan2(s * R[0][2] - c * R[0][1], c * R[1][1] - s * R[1][2])
    return roll + 0.0, pitch + 0.0, yaw + 0.0


def pointing(direction: Vector) -> Vector:
    """Return the roll, pitch and yaw [rad] that turn the z axis into a direction."""
    x, y, z = direction
    return 0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x)
