"""Modes of loops on three pins, against circles that are cut here without pinsing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import pinsing
from pinsing.loops import home, mechanism_at, pose_forms
from pinsing.loops.pose_slice import pose_slice

JOINT = (
    '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="{xyz}" rpy="0 0 {yaw}"/><axis xyz="{axis}"/>'
    '<limit lower="{low}" upper="{high}" effort="1" velocity="1"/></joint>'
)


def joint(name, kind, parent, child, xyz=(0, 0, 0), yaw=0.0, axis="0 0 1", limits=(-9, 9)):
    text = " ".join(map(str, xyz))
    return JOINT.format(
        name=name, kind=kind, parent=parent, child=child, xyz=text, yaw=yaw, axis=axis,
        low=limits[0], high=limits[1],
    )  # fmt: skip


def loaded(folder: Path, joints: list[str], loops: str) -> pinsing.Mechanism:
    body = "".join(joints)
    links = sorted(
        {part.split('"')[0] for part in body.replace("child", "parent").split('<parent link="')[1:]}
    )
    text = "".join(f'<link name="{name}"/>' for name in links)
    path = folder / "m.urdf"
    path.write_text(f'<robot name="m">{text}{body}</robot>')
    (folder / "m.loops.yaml").write_text(loops)
    return pinsing.load_mechanism(path, folder / "m.loops.yaml")


def two_slides(folder: Path, a: float, b: float, yaw: float, limits=(-9, 9)) -> pinsing.Mechanism:
    """Slides along x and along a line through (0, 0.3) that is turned; rods of lengths a, b."""
    return loaded(
        folder,
        [
            joint("d1", "prismatic", "base", "s1", axis="1 0 0", limits=limits),
            joint("a1", "continuous", "s1", "r1"),
            joint("f1", "fixed", "r1", "p1", (a, 0, 0)),
            joint("d2", "prismatic", "base", "s2", (0, 0.3, 0), yaw, "1 0 0", limits),
            joint("a2", "continuous", "s2", "r2", axis="0 0 -1"),
            joint("f2", "fixed", "r2", "p2", (0, b, 0)),
        ],
        "closed_loop: [[p1, p2]]\ntype: [3d]\nname_mot: [d1, d2]\n"
        "output: {frame: p1, rows: [vx, vy]}\n",
    )


def welded_five_bar(folder: Path) -> pinsing.Mechanism:
    """Cranks of 0.3 at x = 0 and 0.5, rods of 0.45 and 0.4; the loop welds the second rod's end."""
    return loaded(
        folder,
        [
            joint("q1", "continuous", "base", "c1"),
            joint("b1", "continuous", "c1", "r1", (0.3, 0, 0)),
            joint("pin", "continuous", "r1", "r2", (0.45, 0, 0)),
            joint("e1", "fixed", "r2", "end", (0.4, 0, 0)),
            joint("q2", "continuous", "base", "c2", (0.5, 0, 0)),
            joint("b2", "continuous", "c2", "stub", (0.3, 0, 0)),
        ],
        "closed_loop: [[end, stub]]\ntype: [6d]\nname_mot: [q1, q2]\n"
        "output: {frame: r2, rows: [vx, vy]}\n",
    )


def crossings(B1: np.ndarray, B2: np.ndarray, a: float, b: float) -> list[np.ndarray]:
    gap = B2 - B1
    d = float(np.hypot(*gap))
    x = (d * d + a * a - b * b) / (2 * d)
    if x * x > a * a:
        return []
    up = np.array([-gap[1], gap[0]]) / d
    return [B1 + x * gap / d + s * math.sqrt(a * a - x * x) * up for s in (1, -1)]


@pytest.mark.parametrize("seed", range(4))
def test_two_slides(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, yaw = rng.uniform(0.4, 0.8), rng.uniform(0.4, 0.8), rng.uniform(-1, 1)
    mechanism = two_slides(tmp_path, a, b, yaw)
    along = np.array([math.cos(yaw), math.sin(yaw)])
    told = 0
    for _ in range(6):
        d = rng.uniform(-0.5, 0.5, 2)
        B = np.array([d[0], 0.0]), np.array([0, 0.3]) + d[1] * along
        expected = crossings(*B, a, b)
        found = pinsing.assembly_modes(mechanism, d)
        assert len(found.modes) == len(expected)
        if not expected:
            continue
        told += 1
        assert found.complete
        assert "all there are" in found.statement
        got = sorted(list(m.pose.position[:2]) for m in found.modes)
        np.testing.assert_allclose(got, sorted(p.tolist() for p in expected), atol=1e-8)
        # A point nearer to both rails than the rods are long: each slide has two places.
        P = expected[0]
        away = abs(P[1]), abs(along[0] * (P[1] - 0.3) - along[1] * P[0])
        back = pinsing.working_modes(mechanism, [P[0], P[1]])
        assert away[0] < a
        assert away[1] < b
        assert len(back.modes) == 4
        assert back.complete
    assert told >= 2


def test_limits_leave_some_working_modes(tmp_path: Path) -> None:
    mechanism = two_slides(tmp_path, 0.5, 0.6, 0.0, limits=(-0.3, 0.3))
    back = pinsing.working_modes(mechanism, [0.1, 0.35])
    # d1 = 0.1 +- sqrt(0.25 - 0.1225), d2 = 0.1 +- sqrt(0.36 - 0.0025)
    inside = [
        (d1, d2)
        for d1 in (0.1 + math.sqrt(0.1275), 0.1 - math.sqrt(0.1275))
        for d2 in (0.1 + math.sqrt(0.3575), 0.1 - math.sqrt(0.3575))
        if max(abs(d1), abs(d2)) <= 0.3
    ]
    assert len(back.modes) == len(inside)


def test_a_double_solution_is_one_mode(tmp_path: Path) -> None:
    """Rods in line: Newton's method ends with half of the digits, in as many places as starts."""
    mechanism = two_slides(tmp_path, 0.5, 0.6, 0.0)
    far = math.sqrt(1.1**2 - 0.3**2)
    found = pinsing.assembly_modes(mechanism, [0.0, far])
    assert len(found.modes) == 1
    assert found.complete
    near = pinsing.assembly_modes(mechanism, [0.0, far - 1e-6])  # two of them, 0.8 mm apart
    assert len(near.modes) == 2


def test_a_welded_five_bar(tmp_path: Path) -> None:
    mechanism = welded_five_bar(tmp_path)
    rng = np.random.default_rng(3)
    told = 0
    for _ in range(6):
        q1, q2 = rng.uniform(-2, 2, 2)
        B1 = 0.3 * np.array([math.cos(q1), math.sin(q1)])
        B2 = np.array([0.5, 0]) + 0.3 * np.array([math.cos(q2), math.sin(q2)])
        expected = crossings(B1, B2, 0.45, 0.4)
        found = pinsing.assembly_modes(mechanism, [q1, q2])
        assert len(found.modes) == len(expected)
        if expected:
            told += 1
            assert found.complete
            got = sorted(list(m.pose.position[:2]) for m in found.modes)
            np.testing.assert_allclose(got, sorted(p.tolist() for p in expected), atol=1e-8)
            back = pinsing.working_modes(mechanism, expected[0].tolist())
            assert len(back.modes) == 4
            assert back.complete
    assert told >= 2


def cross(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def variables(names: tuple[str, ...], P: np.ndarray, inputs: dict[str, float]) -> list[float]:
    known = {"x": float(P[0]), "y": float(P[1])}
    for name, value in inputs.items():
        known |= {name: value, f"cos {name}": math.cos(value), f"sin {name}": math.sin(value)}
    return [known[n] for n in names]


def values_of(forms, kind, P, inputs) -> list[float]:
    return [
        float(locus.equation(np.array(variables(locus.equation.names, P, inputs))))
        for locus in forms.loci
        if locus.kind == kind
    ]


@pytest.mark.parametrize("seed", range(3))
def test_loci_over_the_position_of_two_slides(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(40 + seed)
    a, b, yaw = rng.uniform(0.4, 0.8), rng.uniform(0.4, 0.8), rng.uniform(-1, 1)
    mechanism = two_slides(tmp_path, a, b, yaw)
    forms = pose_forms(mechanism)
    assert forms is not None
    assert forms.complete
    assert {x.kind for x in forms.loci} == {"type 1", "type 2"}
    told = 0
    for _ in range(60):  # closed ones: the loci against the measures of the mechanism
        d = rng.uniform(-0.4, 0.4, 2)
        found = pinsing.assembly_modes(mechanism, d)
        for mode in found.modes:
            P = np.array(mode.pose.position[:2])
            state = mechanism_at(mechanism, mode.q)
            inputs = {"d1": float(d[0]), "d2": float(d[1])}
            two = min(abs(v) for v in values_of(forms, "type 2", P, inputs))
            one = min(abs(v) for v in values_of(forms, "type 1", P, inputs))
            assert (two <= 1e-7) == (state.input_ratio <= 1e-7)
            assert (one <= 1e-7) == (state.output_ratio <= 1e-7)
            for equation in forms.closing:
                at = np.array(variables(equation.names, P, inputs))
                assert abs(float(equation(at))) <= 1e-9
            told += 1
        if told > 12:
            break
    assert told > 4
    # Across the first slide: P straight above or below it; beside that place it is not.
    for sign in (1, -1):
        P = np.array([0.05, sign * a])
        assert min(abs(v) for v in values_of(forms, "type 1", P, {"d1": 0.05, "d2": 9.0})) <= 1e-12
        beside = {"d1": 0.05 + 1e-3, "d2": 9.0}
        assert min(abs(v) for v in values_of(forms, "type 1", P, beside)) > 1e-4


def test_loci_of_a_welded_five_bar(tmp_path: Path) -> None:
    mechanism = welded_five_bar(tmp_path)
    forms = pose_forms(mechanism)
    assert forms is not None
    assert forms.complete
    rng = np.random.default_rng(9)
    for _ in range(8):
        q1, angle, shift = rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(0.05, 0.4)
        B1 = 0.3 * np.array([math.cos(q1), math.sin(q1)])
        # P on the circle of rod 1; rod 2 in line with it is B2 = P + 0.4 u.
        u = np.array([math.cos(angle), math.sin(angle)])
        P = B1 + 0.45 * u
        B2 = P + 0.4 * u
        q2 = math.atan2(B2[1], B2[0] - 0.5)
        true = np.array([0.5, 0]) + 0.3 * np.array([math.cos(q2), math.sin(q2)])
        inline = abs(cross(P - B1, P - true))
        got = [abs(v) for v in values_of(forms, "type 2", P, {"q1": q1, "q2": q2})]
        assert len(got) == 1
        assert np.sign(got[0]) == np.sign(inline) or inline < 1e-9
        # The left side is the cross product, up to a constant.
        other = angle + shift
        P2 = B1 + 0.45 * np.array([math.cos(other), math.sin(other)])
        more = abs(cross(P2 - B1, P2 - true))
        [value] = [abs(v) for v in values_of(forms, "type 2", P2, {"q1": q1, "q2": q2})]
        if inline > 1e-6:
            assert value / got[0] == pytest.approx(more / inline, rel=1e-7)
        # Type 1: crank 1 and its rod in line.
        for sign in (1, -1):
            P3 = (0.3 + sign * 0.45) * np.array([math.cos(q1), math.sin(q1)])
            assert min(abs(v) for v in values_of(forms, "type 1", P3, {"q1": q1, "q2": q2})) < 1e-9


def test_a_slice_holds_all_that_the_rods_reach(tmp_path: Path) -> None:
    """Joints that are close to each other at home do not make a robot small."""
    mechanism = two_slides(tmp_path, 0.5, 0.6, 0.0, limits=(-1, 1))
    found = pose_slice(mechanism, ("x", "y"), [home(mechanism)], samples=41)
    assert found.y[0] < -0.3 < 0.5 < found.y[-1]  # |y| <= 0.5 and |y - 0.3| <= 0.6
    y = found.y[found.inside[0].any(axis=1)]
    assert y.min() < -0.25
    assert y.max() > 0.45
    x = found.x[found.inside[0].any(axis=0)]
    assert x.min() < -0.3
    assert x.max() > 1.3
