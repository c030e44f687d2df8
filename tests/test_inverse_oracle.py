"""Inverse solutions against closed formulas of their own, and proofs that they exist."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import pinsing
from pinsing.kinematics.jacobian import tip_placement


def ur5_inverse(T):
    """All solutions of the UR5 of the description, after Hawkins (2013), from T of its base.

    The standard table: d1, a2, a3, d4, d5, d6; angles as in that table.
    """
    d1, a2, a3, d4, d5, d6 = 0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823
    out = []
    p5 = T[:3, 3] - d6 * T[:3, 2]
    radius = np.hypot(p5[0], p5[1])
    if radius < d4:
        return out
    for s1, s5, s3 in itertools.product((1, -1), repeat=3):
        q1 = np.arctan2(p5[1], p5[0]) + s1 * np.arccos(d4 / radius) + np.pi / 2
        c5 = (T[0, 3] * np.sin(q1) - T[1, 3] * np.cos(q1) - d4) / d6
        if abs(c5) > 1:
            continue
        q5 = s5 * np.arccos(c5)
        x, y = T[:3, 0], T[:3, 1]
        side = np.array([np.sin(q1), -np.cos(q1), 0])
        q6 = np.arctan2(-(y @ side) / np.sin(q5), (x @ side) / np.sin(q5))
        T01 = dh(q1, d1, 0, np.pi / 2)
        T14 = np.linalg.inv(T01) @ T @ np.linalg.inv(dh(q5, d5, 0, -np.pi / 2) @ dh(q6, d6, 0, 0))
        px, py = T14[0, 3], T14[1, 3]
        c3 = (px**2 + py**2 - a2**2 - a3**2) / (2 * a2 * a3)
        if abs(c3) > 1:
            continue
        q3 = s3 * np.arccos(c3)
        q2 = np.arctan2(py, px) - np.arctan2(a3 * np.sin(q3), a2 + a3 * np.cos(q3))
        q234 = np.arctan2(T14[1, 0], T14[0, 0])
        out.append([q1, q2, q3, q234 - q2 - q3, q5, q6])
    return out


def dh(theta, d, a, alpha):
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array(
        [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
    )


def forward(q):
    rows = [(0.089159, 0, 90), (0, -0.425, 0), (0, -0.39225, 0), (0.10915, 0, 90)]
    rows += [(0.09465, 0, -90), (0.0823, 0, 0)]
    T = np.eye(4)
    for theta, (d, a, alpha) in zip(q, rows, strict=True):
        T = T @ dh(theta, d, a, np.radians(alpha))
    return T


@pytest.fixture(scope="module")
def ur5(tmp_path_factory):
    """The table as a robot of its own, so that angles are those of the formulas."""
    from pinsing.description.dh_urdf import dh_to_urdf, read_dh

    rows = [(0.089159, 0, 90), (0, -0.425, 0), (0, -0.39225, 0), (0.10915, 0, 90)]
    rows += [(0.09465, 0, -90), (0.0823, 0, 0)]
    text = "name: made\nconvention: standard\nunits: {angle: deg, length: m}\nrows:\n"
    for d, a, alpha in rows:
        text += f"  - {{alpha: {alpha}, a: {a}, d: {d}, theta: 0, type: revolute, "
        text += "limits: [-180, 180]}\n"
    path = tmp_path_factory.mktemp("ur5") / "ur5.dh.yaml"
    path.write_text(text)
    return pinsing.load(dh_to_urdf(read_dh(path)))


def compare(arm, count, seed):
    rng = np.random.default_rng(seed)
    total = 0
    for q in arm.space.sample(count, rng, True):
        T = forward(q)
        assert np.abs(tip_placement(arm, q).homogeneous - T).max() < 1e-12
        theirs = np.array(ur5_inverse(T))
        found = pinsing.inverse(arm, T)
        ours = found.q
        assert len(ours) == len(theirs)
        for s in theirs:
            assert np.abs(arm.space.wrap(ours - s)).max(axis=1).min() < 1e-6
        assert found.certified == len(ours)
        total += len(ours)
    return total


def test_ur5_against_its_closed_form(ur5):
    assert compare(ur5, 4, 0) > 4 * 2


@pytest.mark.slow
def test_ur5_against_its_closed_form_at_500_poses(ur5):
    assert compare(ur5, 500, 1) > 500 * 4


def test_a_full_set_is_known_to_be_full():
    arm = pinsing.load("puma560")
    found = pinsing.inverse(arm, [0.4, 0.2, 0.3, 0.1, 0.2, 0.3])
    assert len(found) == 8
    assert found.certified == 8
    assert found.doubt == ""
    assert any("no more regular ones" in n for n in found.notes)
    assert pinsing.InverseSolutions.from_dict(found.to_dict()).certified == 8


class TestRadius:
    def test_the_true_solution_is_within(self):
        """Solutions are moved away; the radius grows so that the true one stays within."""
        from pinsing.postures.inverse import Solver
        from pinsing.postures.kantorovich import radii

        for name in ("ur5", "stanford", "kinova"):
            arm = pinsing.load(name)
            q = arm.space.sample(1, np.random.default_rng(5), True)[0]
            T = tip_placement(arm, q)
            nothing = np.full(6, np.nan)
            solver = Solver.of(arm, T.translation, T.rotation, nothing, np.arange(6))
            rng = np.random.default_rng(0)
            for size in (1e-9, 1e-7, 1e-5, 1e-4):
                Q = q + rng.normal(size=(40, 6)) * size
                r = radii(solver, Q)
                assert (r > np.linalg.norm(Q - q, axis=1)).all()
                assert size > 1e-9 or (r < 1e-4).all()
            far = radii(solver, q + rng.normal(size=(40, 6)))
            assert np.isinf(far).all()

    def test_a_singular_solution_is_not_certified(self):
        arm = pinsing.load("puma560")
        q = np.array([0.2, 0.3, 0.5, 0.4, 0.0, 0.1])
        found = pinsing.inverse(arm, tip_placement(arm, q).homogeneous)
        assert all(np.isinf(s.radius) for s in found if not s.regular)
