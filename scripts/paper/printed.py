"""What the paper prints. Nothing here is computed, and nothing else is typed in by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PI = np.pi
THIRD = PI / 3

# Tables 1 and 2: alpha, a, d, and which row slides. q and d of the joint itself are added.
TABLE_1 = (
    (-PI / 2, 0, 0.08, False),
    (PI / 2, 0, 0.06, False),
    (0, 0, 0, True),
    (-PI / 2, 0, 0, False),
    (PI / 2, 0, 0, False),
    (0, 0, 0.08, False),
)
TABLE_2 = (
    (0, 0, 0, True),
    (PI / 2, 0.02, 0, False),
    (0, 0.05, 0, False),
    (PI / 2, 0.05, 0, False),
    (PI / 2, 0, 0.1, False),
    (PI / 2, 0, 0, False),
    (PI / 2, 0.02, 0, False),
)

STANFORD_D3 = 0.3
STANFORD_THIRD, STANFORD_HALF = "0.1447", "0.209"

SURGICAL_D1 = 0.3
SURGICAL_D1_RANGE = (-0.1, 0.1)
SURGICAL_THIRD, SURGICAL_HALF = "0.000472", "0.000442"


def surgical_configuration(angle: float = np.pi / 3, **joints: float) -> np.ndarray:
    """Section 3.2.2: d1 at 0.3 m, all joints at pi/3 but those named."""
    q = np.full(7, angle)
    q[0] = SURGICAL_D1
    for name, value in joints.items():
        q[int(name[1:]) - 1] = value
    return q


FIVE_BAR_CONFIGURATION, FIVE_BAR_MECHANISM = "0.4714", "0.8485"


@dataclass(frozen=True)
class Table3Row:
    """One row of Table 3.

    Attributes
    ----------
    special : tuple of str
        Joints at 0, or at pi or -pi.
    fixed : dict
        Joints at other printed values; a sequence where both signs are printed.
    det, omega, K : str
        As printed.
    """

    special: tuple[str, ...]
    fixed: dict[str, tuple[float, ...]]
    det: str
    omega: str
    K: str


TABLE_3 = (
    Table3Row(("q2", "q3", "q4"), {}, "0", "0", "inf"),
    Table3Row(("q4", "q5"), {}, "0", "0", "inf"),
    Table3Row(("q2", "q3"), {"q5": (PI / 2, -PI / 2)}, "0", "0", "inf"),
    Table3Row(("q2",), {"q3": (-0.1571,)}, "0.00000027", "0.000523", "613002"),
    Table3Row(("q2",), {"q3": (2.9845,)}, "0.00000000215", "0.0000464", "8500392"),
    Table3Row(("q2",), {"q4": (-0.3142,)}, "0.0000000248", "0.0001575", "4423851"),
    Table3Row(("q2",), {"q5": (-0.3142,)}, "0.00000000147", "0.0000383", "113310832"),
    Table3Row(("q4",), {"q2": (-2.3562,)}, "0.0000000463", "0.000215", "2410219"),
    Table3Row(("q4",), {"q2": (1.2566,)}, "0.0000000324", "0.00018", "2364066"),
    Table3Row(("q4",), {"q3": (1.5708,)}, "0.0000000155", "0.0001246", "2777778"),
    Table3Row(("q4",), {"q3": (2.513,)}, "0.000000001", "0.0000314", "20703933"),
    Table3Row(("q2", "q5"), {"q3": (2.3562, -2.3562)}, "0.000000001", "0.0000308", "77294250"),
    Table3Row(("q3", "q4"), {"q2": (1.7279, -1.7279)}, "0.0000002081", "0.000456", "705496"),
)

# Table 4: (q1, q2); det and omega are printed as 0, K as infinite.
TABLE_4 = (("pi/3", "1.40924"), ("pi/3", "2.70535"), ("pi/3", "1.96856"), ("0.86476", "pi/3"))

# Tables 5 and 6: kind of manipulator, complexity, solves det(J) = 0, obtains the configurations.
TABLE_5 = (
    ("serial, satisfying Pieper's criterion", "no determinant transformation", "No", "Yes"),
    ("serial, not satisfying it", "no determinant transformation", "No", "Yes"),
    ("parallel", "no determinant transformation", "No", "Yes"),
)
TABLE_6 = (
    ("serial, satisfying Pieper's criterion", "average complexity", "Yes", "Yes"),
    ("serial, not satisfying it", "very complex", "Yes", "No"),
    ("parallel", "very complex", "Yes", "No"),
)


def puma_locus(q2: np.ndarray, q3: np.ndarray, a2: float, a3: float, d4: float) -> np.ndarray:
    """Section 5: a singular configuration of the PUMA 560 that the paper's method cannot find."""
    return d4 * np.sin(q2 + q3) + a2 * np.cos(q2) + a3 * np.cos(q2 + q3)


def irb_locus(
    q2: np.ndarray, q3: np.ndarray, a1: float, a2: float, a3: float, d4: float
) -> np.ndarray:
    """Section 5: the same of the ABB IRB 1400."""
    return a3 * np.sin(q2 + q3) - d4 * np.cos(q2 + q3) + a2 * np.sin(q2) - a1


def appendix_J(q: np.ndarray, d2: float) -> np.ndarray:
    """Appendix A: Jacobian of the Stanford arm, as printed; q = (q1, q2, d3, q4, q5, q6)."""
    q1, q2, d3, q4, q5 = q[:5]
    c1, s1, c2, s2 = np.cos(q1), np.sin(q1), np.cos(q2), np.sin(q2)
    c4, s4, c5, s5 = np.cos(q4), np.sin(q4), np.cos(q5), np.sin(q5)
    J11 = [
        [-d2 * c1 - d3 * s1 * s2, d3 * c1 * c2, c1 * s2],
        [-d2 * s1 + d3 * c1 * s2, d3 * s1 * c2, s1 * s2],
        [0, -d3 * s2, c2],
    ]
    J21 = [[0, -s1, 0], [0, c1, 0], [1, 0, 0]]
    J22 = [
        [c1 * s2, -c1 * c2 * s4 - s1 * c4, (c1 * c2 * c4 - s1 * s4) * s5 + c1 * s2 * c5],
        [s1 * s2, -s1 * c2 * s4 + c1 * c4, (s1 * c2 * c4 + c1 * s4) * s5 + s1 * s2 * c5],
        [c2, s2 * s4, -s2 * c4 * s5 + c2 * c5],
    ]
    return np.block([[np.array(J11), np.zeros((3, 3))], [np.array(J21), np.array(J22)]])


R1, R2, R3 = 1.2, 1.0, 0.8


def five_bar_point(q1: float, q2: float) -> tuple[float, float]:
    """Section 3.2.3: P of the 5R, with the paper's root y."""
    den = 2 * R3 + R1 * np.cos(q2) - R1 * np.cos(q1)
    e = R1 * (np.sin(q1) - np.sin(q2)) / den
    f = R1 * R3 * (np.cos(q1) + np.cos(q2)) / den
    d = 1 + e**2
    g = 2 * (e * f - e * R1 * np.cos(q1) + e * R3 - R1 * np.sin(q1))
    h = f**2 - 2 * f * (R1 * np.cos(q1) - R3) - 2 * R1 * R3 * np.cos(q1)
    h += R3**2 + R1**2 - R2**2
    y = (np.sqrt(g**2 - 4 * d * h) - g) / (2 * d)
    return float(e * y + f), float(y)


def five_bar_matrices(q1: float, q2: float) -> tuple[np.ndarray, np.ndarray]:
    """Equation (13): the matrices printed as J_x and J_q."""
    x, y = five_bar_point(q1, q2)
    J_x = R1 * np.diag(
        [y * np.cos(q1) - (x + R3) * np.sin(q1), y * np.cos(q2) + (-x + R3) * np.sin(q2)]
    )
    J_q = np.array(
        [
            [x + R3 - R1 * np.cos(q1), y - R1 * np.sin(q1)],
            [x - R3 - R1 * np.cos(q2), y - R1 * np.sin(q2)],
        ]
    )
    return J_x, J_q


def dh_placement(
    table: tuple[tuple[float, float, float, bool], ...], q: np.ndarray, modified: bool
) -> np.ndarray:
    """Placement (4, 4) of the last frame, straight from a DH table: an independent check."""
    T = np.eye(4)
    for (alpha, a, d, slides), value in zip(table, q, strict=True):
        theta, length = (0.0, d + value) if slides else (value, d)
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        turn = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, length], [0, 0, 0, 1]])
        link = np.array([[1, 0, 0, a], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
        T = T @ (link @ turn if modified else turn @ link)
    return T
