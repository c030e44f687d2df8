"""Kinematics of DH tables written independently of pinsing: textbook matrices, in NumPy only.

It reads the YAML itself too, so that units, pi and joint types are compared as well.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml


@dataclass(frozen=True)
class Reference:
    convention: str
    alpha: np.ndarray
    a: np.ndarray
    d: np.ndarray
    theta: np.ndarray
    sliding: np.ndarray  # bool, one per row
    lower: np.ndarray
    upper: np.ndarray
    tool: np.ndarray  # 4x4

    @property
    def n(self) -> int:
        return len(self.alpha)


def read(path: Path) -> Reference:
    raw = yaml.safe_load(Path(path).read_text())
    angle = 1.0 if raw["units"]["angle"] == "rad" else np.pi / 180
    length = 1.0 if raw["units"]["length"] == "m" else 1e-3
    rows = raw["rows"]

    def column(key: str, unit: float) -> np.ndarray:
        return np.array([number(row[key]) * unit for row in rows])

    sliding = np.array([row["type"] == "prismatic" for row in rows])
    unit = np.where(sliding, length, angle)
    limits = np.array([[number(x) for x in row.get("limits", (-np.inf, np.inf))] for row in rows])
    tool = np.eye(4)
    if "tool" in raw:
        spec = raw["tool"]
        if "alpha" in spec:
            units = {"alpha": angle, "a": length, "d": length, "theta": angle}
            of_row = (number(spec[key]) * unit for key, unit in units.items())
            tool = row_matrix(raw["convention"], *of_row)
        else:
            roll, pitch, yaw = (number(x) * angle for x in spec.get("rpy", (0, 0, 0)))
            tool = rot("z", yaw) @ rot("y", pitch) @ rot("x", roll)
            tool[:3, 3] = [number(x) * length for x in spec.get("xyz", (0, 0, 0))]
    columns = (column("alpha", angle), column("a", length), column("d", length))
    limits = (limits * unit[:, None]).T
    return Reference(raw["convention"], *columns, column("theta", angle), sliding, *limits, tool)


def number(value: float | str) -> float:
    if not isinstance(value, str):
        return float(value)
    result, operator = 1.0, "*"
    text = value.replace(" ", "")
    if text[0] in "+-":
        result, text = (-1.0 if text[0] == "-" else 1.0), text[1:]
    for part in text.replace("*", " * ").replace("/", " / ").split():
        if part in "*/":
            operator = part
            continue
        factor = np.pi if part == "pi" else float(part)
        result = result * factor if operator == "*" else result / factor
    return result


def rot(axis: str, angle: float) -> np.ndarray:
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    T = np.eye(4)
    T[i, i] = T[j, j] = np.cos(angle)
    T[i, j], T[j, i] = -np.sin(angle), np.sin(angle)
    return T


def row_matrix(convention: str, alpha: float, a: float, d: float, theta: float) -> np.ndarray:
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    if convention == "standard":  # Paul 1981
        rows = [ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d]
    else:  # Craig 1986, Eq. (3.6)
        rows = [ct, -st, 0, a], [st * ca, ct * ca, -sa, -sa * d], [st * sa, ct * sa, ca, ca * d]
    return np.array([*rows, [0, 0, 0, 1]])


def frames(table: Reference, q: np.ndarray) -> list[np.ndarray]:
    """Frames 0, 1, ..., n in the base, then the tool's."""
    T = [np.eye(4)]
    for i in range(table.n):
        slide, turn = (q[i], 0.0) if table.sliding[i] else (0.0, q[i])
        row = (table.alpha[i], table.a[i], table.d[i] + slide, table.theta[i] + turn)
        T.append(T[-1] @ row_matrix(table.convention, *row))
    T.append(T[-1] @ table.tool)
    return T


def jacobian(table: Reference, q: np.ndarray) -> np.ndarray:
    """Geometric Jacobian of the tool's origin in base axes, translation over rotation (6, n)."""
    T = frames(table, q)
    J = np.zeros((6, table.n))
    for i in range(table.n):
        axis_frame = T[i] if table.convention == "standard" else T[i + 1]
        z, origin = axis_frame[:3, 2], axis_frame[:3, 3]
        if table.sliding[i]:
            J[:3, i] = z
        else:
            J[:3, i] = np.cross(z, T[-1][:3, 3] - origin)
            J[3:, i] = z
    return J
