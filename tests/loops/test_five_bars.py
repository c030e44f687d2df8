"""Five-bars on cranks and slides in any plane, cut at the pin, at an elbow, or welded.

Held against circles and the cross products of their rods, cranks and rails, written here without
pinsing.
"""

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import circles, cross, left_sides, value
from tiers import tiered_rows
from urdf_text import J, X, frame, loop_text, written

import pinsing
from pinsing.loops import mechanism_at, pose_forms
from pinsing.loops.pose_loci import variables_at

PLANES = {
    "level": ((0.0, 0.0, 0.0), "vx, vy"),
    "upright": ((math.pi / 2, 0.0, 0.0), "vx, vz"),
    "oblique": ((0.3, 0.4, 0.5), "vx, vy, vz"),
}
AT = np.array([0.1, 0.2, 0.3])


class FiveBar:
    """Two legs in a plane, each a crank or a slide with a rod; the second written from the pin."""

    def __init__(self, folder: Path, kinds: str, cut: str, plane: str, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.kinds = kinds
        self.feet = np.array([[0.0, 0.0], [0.6, 0.0]]) + rng.uniform(-0.1, 0.1, (2, 2))
        self.yaw = rng.uniform(-0.6, 0.6, 2)
        self.cranks, self.rods = rng.uniform(0.2, 0.35, 2), rng.uniform(0.4, 0.6, 2)
        self.senses = rng.choice([1, -1], 2)
        turn, rows = PLANES[plane]
        self.turn = pin.rpy.rpyToMatrix(*turn)
        raised = 0.05  # of the second leg's foot
        axes = [(0, 0, s) for s in self.senses]
        joints = [J("w", "world", "base", AT, kind="fixed", rpy=turn)]
        ends = []
        for k in (0, 1):
            how = (axes[k], "continuous", None) if kinds[k] == "R" else (X, "prismatic", (-1, 1))
            foot = (*self.feet[k], raised * k)
            joints.append(J(f"m{k}", "base", f"c{k}", foot, *how, (0, 0, self.yaw[k])))
            ends.append((self.cranks[k] if kinds[k] == "R" else 0, 0, 0))
        joints.append(J("b0", "c0", "r0", ends[0], axes[0]))
        joints.append(frame("p0", "r0", (self.rods[0], 0, 0)))
        if cut == "pin":
            joints.append(J("b1", "c1", "r1", ends[1], axes[1], rpy=(0, 0, 0.4)))
            joints.append(frame("p1", "r1", (0, self.rods[1], -raised)))
            loop, output = ("p0", "p1"), "p1"
        else:
            joints.append(J("pin", "p0", "r1", axis=axes[1]))
            joints.append(frame("e1", "r1", (self.rods[1], 0, raised)))
            kind = "fixed" if cut == "elbow" else "continuous"
            joints.append(J("b1", "c1", "s1", ends[1], axes[1], kind))
            loop, output = ("e1", "s1"), "r1"
        text = loop_text([loop], ["m1", "m0"], output, rows, "6d" if cut == "weld" else "3d")
        self.mechanism = pinsing.load_mechanism(written(folder, joints, text))
        self.rows = ["xyz".index(row[1]) for row in rows.split(", ")]

    def ways(self, P: np.ndarray) -> int:
        """How many inputs within the limits put the pin there."""
        count = 1
        for k in (0, 1):
            if self.kinds[k] == "R":
                count *= 2
                continue
            away = P - self.feet[k]
            u = np.array([math.cos(self.yaw[k]), math.sin(self.yaw[k])])
            reach = math.sqrt(self.rods[k] ** 2 - cross(u, away) ** 2)
            count *= sum(abs(away @ u + sign * reach) <= 1 for sign in (1, -1))
        return count

    def elbows(self, m: tuple[float, float]) -> list[np.ndarray]:
        out = []
        for k in (0, 1):
            along = self.yaw[k] + (self.senses[k] * m[k] if self.kinds[k] == "R" else 0)
            u = np.array([math.cos(along), math.sin(along)])
            out.append(self.feet[k] + (self.cranks[k] if self.kinds[k] == "R" else m[k]) * u)
        return out

    def measures(self, m: tuple[float, float], P: np.ndarray) -> tuple[float, list[float]]:
        """What is zero at type 2, and for each leg at type 1."""
        B = self.elbows(m)
        ones = []
        for k in (0, 1):
            if self.kinds[k] == "R":
                ones.append(cross(B[k] - self.feet[k], P - B[k]))
            else:
                rail = np.array([math.cos(self.yaw[k]), math.sin(self.yaw[k])])
                ones.append(float((P - B[k]) @ rail))
        return cross(B[0] - P, B[1] - P), ones


CASES = [
    ("PP", "pin", "upright"), ("PP", "elbow", "level"), ("RP", "elbow", "level"),
    ("PR", "elbow", "upright"), ("RR", "elbow", "oblique"), ("RP", "pin", "oblique"),
    ("PR", "weld", "upright"), ("RR", "weld", "oblique"),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("kinds", "cut", "plane"), tiered_rows(CASES, CASES[:1]))
def test_loci_and_modes(tmp_path: Path, kinds: str, cut: str, plane: str) -> None:
    bar = FiveBar(tmp_path, kinds, cut, plane, 5)
    forms = pose_forms(bar.mechanism)
    assert forms is not None
    assert forms.complete
    assert [x.kind for x in forms.loci] == ["type 2", "type 1", "type 1"]
    assert any("in the plane of the mechanism" in n for n in forms.notes) == (plane != "level")
    rng = np.random.default_rng(8)
    seen, values = [], []
    while len(seen) < 12:
        m = tuple(
            float(rng.uniform(-1.5, 1.5) if kind == "R" else rng.uniform(-0.4, 0.4))
            for kind in kinds
        )
        (one, two), (a, b) = bar.elbows(m), bar.rods
        expected = circles(one, a, two, b)
        found = pinsing.loops.assembly_modes(bar.mechanism, [m[1], m[0]])
        assert len(found.modes) == len(expected)
        if not expected:
            continue
        assert found.complete
        assert "all there are" in found.statement
        if len(seen) < 4:
            place = AT + bar.turn @ [*expected[0], 0]
            back = pinsing.loops.working_modes(bar.mechanism, place[bar.rows])
            assert len(back.modes) == bar.ways(expected[0])
            assert back.complete
        got = sorted((bar.turn.T @ (np.array(x.pose.position) - AT)).tolist() for x in found.modes)
        assert np.ptp(np.array(got)[:, 2]) <= 1e-9
        np.testing.assert_allclose(
            np.array(got)[:, :2], sorted(P.tolist() for P in expected), atol=1e-8
        )
        for mode in found.modes:
            P = (bar.turn.T @ (np.array(mode.pose.position) - AT))[:2]
            at = variables_at(bar.mechanism, mode.q)
            two, ones = bar.measures(m, P)
            seen.append([two, *ones])
            values.append([value(x.equation, at) for x in forms.loci])
            np.testing.assert_allclose([value(e, at) for e in forms.closing], 0, atol=1e-9)
    # Each left side is a cross or a dot product, up to a constant of its own.
    ratios = np.array(values) / np.array(seen)
    np.testing.assert_allclose(ratios, np.tile(ratios[:1], (len(ratios), 1)), rtol=1e-6)


@pytest.mark.parametrize("cut", ["elbow", "weld"])
def test_a_rod_across_its_slide_is_singular_and_beside_it_not(tmp_path: Path, cut: str) -> None:
    bar = FiveBar(tmp_path, "RP", cut, "level", 5)
    forms = pose_forms(bar.mechanism)
    assert forms is not None
    # P across the slide from the foot of rod 2, within reach of leg 1; m0 from two circles.
    rail = np.array([math.cos(bar.yaw[1]), math.sin(bar.yaw[1])])
    m1 = -0.45
    for beside, singular in ((0.0, True), (1e-3, False)):
        angle = math.pi / 2 + beside
        away = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        P = bar.feet[1] + m1 * rail + bar.rods[1] * away @ rail
        B = circles(bar.feet[0], bar.cranks[0], P, bar.rods[0])[0]
        m0 = bar.senses[0] * (math.atan2(*(B - bar.feet[0])[::-1]) - bar.yaw[0])
        found = pinsing.loops.assembly_modes(bar.mechanism, [m1, m0])
        mode = min(
            found.modes, key=lambda x: float(np.hypot(*(np.array(x.pose.position) - AT)[:2] - P))
        )
        state = mechanism_at(bar.mechanism, mode.q)
        assert (state.output_ratio <= 1e-7) == singular
        ones = np.abs(left_sides(bar.mechanism, forms, mode.q, "type 1"))
        assert (ones.min() <= 1e-8) == singular


def two_slides(folder: Path, limits: tuple[float, float] = (-9, 9)) -> pinsing.robot.Mechanism:
    """Slides along x, the second at y = 0.3; rods of 0.5 and 0.6."""
    joints = [
        J("d1", "base", "s1", axis=X, kind="prismatic", limits=limits),
        J("a1", "s1", "r1"),
        frame("p1", "r1", (0.5, 0, 0)),
        J("d2", "base", "s2", (0, 0.3, 0), X, "prismatic", limits),
        J("a2", "s2", "r2", axis=(0, 0, -1)),
        frame("p2", "r2", (0, 0.6, 0)),
    ]
    text = loop_text([("p1", "p2")], ["d1", "d2"], "p1", "vx, vy")
    return pinsing.load_mechanism(written(folder, joints, text))


def test_limits_leave_some_working_modes(tmp_path: Path) -> None:
    back = pinsing.loops.working_modes(two_slides(tmp_path, (-0.3, 0.3)), [0.1, 0.35])
    # d1 = 0.1 +- sqrt(0.25 - 0.1225), d2 = 0.1 +- sqrt(0.36 - 0.0025)
    reach = [0.1 + sign * math.sqrt(x) for x in (0.1275, 0.3575) for sign in (1, -1)]
    assert len(back.modes) == math.prod(
        sum(abs(d) <= 0.3 for d in part) for part in (reach[:2], reach[2:])
    )


def test_a_double_solution_is_one_mode(tmp_path: Path) -> None:
    """Rods in line: Newton's method ends with half of the digits, in as many places as starts."""
    mechanism = two_slides(tmp_path)
    far = math.sqrt(1.1**2 - 0.3**2)
    found = pinsing.loops.assembly_modes(mechanism, [0.0, far])
    assert len(found.modes) == 1
    assert found.complete
    near = pinsing.loops.assembly_modes(mechanism, [0.0, far - 1e-6])  # two of them, 0.8 mm apart
    assert len(near.modes) == 2
