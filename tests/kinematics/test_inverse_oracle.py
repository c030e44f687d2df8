"""Inverse solutions against closed formulas of their own, and proofs that they exist."""

import functools
import itertools

import dh_arms
import numpy as np
import pytest
from dh_reference import row_matrix
from tiers import tiered_rows

import pinsing
from pinsing.kinematics.inverse import FoundSolutions, Solver, drawn
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


def puma_inverse(T):
    """All solutions of the table below, after Paul, Shimano and Mayer (1981), from T of its base.

    The first joint from the side, the third from the distance, the second from the direction.
    """
    a2, a3, d3, d4 = 0.4318, 0.0203, 0.15005, 0.4318
    x, y, z = T[:3, 3]
    radius = np.hypot(x, y)
    out = []
    if radius < d3:
        return out
    for s1, s3, s5 in itertools.product((1, -1), repeat=3):
        side = np.arcsin(d3 / radius)
        q1 = np.arctan2(y, x) + (side if s1 > 0 else np.pi - side)
        ahead = x * np.cos(q1) + y * np.sin(q1)
        c3 = (ahead**2 + z**2 - a2**2 - a3**2 - d4**2) / (2 * a2 * np.hypot(a3, d4))
        if abs(c3) > 1:
            continue
        q3 = s3 * np.arccos(c3) - np.arctan2(d4, a3)
        c, s = np.cos(q3), np.sin(q3)
        q2 = np.arctan2(z, ahead) - np.arctan2(a3 * s + d4 * c, a2 + a3 * c - d4 * s)
        M = placed(PUMA[:3], [q1, q2, q3])[:3, :3].T @ T[:3, :3]
        q5 = s5 * np.arccos(M[2, 2])
        q4 = np.arctan2(-s5 * M[1, 2], -s5 * M[0, 2])
        q6 = np.arctan2(-s5 * M[2, 1], s5 * M[2, 0])
        out.append([q1, q2, q3, q4, q5, q6])
    return out


UR5 = (
    (0.089159, 0, 90), (0, -0.425, 0), (0, -0.39225, 0), (0.10915, 0, 90), (0.09465, 0, -90),
    (0.0823, 0, 0),
)  # fmt: skip
PUMA = (
    (0, 0, 90), (0, 0.4318, 0), (0.15005, 0.0203, -90), (0.4318, 0, 90), (0, 0, -90), (0, 0, 0),
)  # fmt: skip
CRX = tuple((d, a, alpha) for alpha, a, d, *_ in dh_arms.CRX)


def dh(theta, d, a, alpha):
    return row_matrix("standard", alpha, a, d, theta)


def placed(rows, q):
    T = np.eye(4)
    for theta, (d, a, alpha) in zip(q, rows, strict=True):
        T = T @ dh(theta, d, a, np.radians(alpha))
    return T


@functools.cache
def made(rows, task="pose"):
    """A table as a robot of its own, so that angles are those of the formulas."""
    return dh_arms.dh_arm([(alpha, a, d) for d, a, alpha in rows], task)


def compare(arm, rows, formula, count, seed):
    """Every solution of the formula is found, or the pose carries a doubt; none is made up."""
    rng = np.random.default_rng(seed)
    total = certified = 0
    for q in arm.space.sample(count, rng, True):
        T = placed(rows, q)
        assert np.abs(tip_placement(arm, q).homogeneous - T).max() < 1e-12
        theirs = np.array(formula(T))
        found = pinsing.inverse(arm, T)
        ours = found.q
        assert len(ours) <= len(theirs)
        missed = [s for s in theirs if np.abs(arm.space.wrap(ours - s)).max(axis=1).min() > 1e-6]
        assert found.doubt or not missed
        assert found.certified <= len(ours)
        certified += found.certified
        total += len(ours) - len(missed)
    return total, certified


CLOSED = [(UR5, ur5_inverse, 4), (PUMA, puma_inverse, 7.9)]


@pytest.mark.parametrize("count", [10, pytest.param(500, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("rows", "formula", "mean"), tiered_rows(CLOSED, CLOSED[1:]), ids=["ur5", "puma"]
)
def test_against_a_closed_formula(rows, formula, mean, count):
    """A PUMA meets poses so near its shoulder's singularity that no proof is to be had there."""
    total, certified = compare(made(rows), rows, formula, count, count > 10)
    assert total > count * mean
    assert certified == total if count == 10 or rows is UR5 else certified > 0.99 * total


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rows", "formula", "mean"), tiered_rows(CLOSED, CLOSED[:1]), ids=["ur5", "puma"]
)
def test_pairs_next_to_a_singularity_are_told_apart(rows, formula, mean):
    """Stretched elbows but for 1e-4 and less: two solutions that near, of opposite signs."""
    arm = made(rows)
    stretched = 0.0 if rows is UR5 else -np.arctan2(0.4318, 0.0203)
    least = []
    for q in arm.space.sample(8, np.random.default_rng(9), True):
        q[2] = stretched + 4e-5
        T = placed(rows, q)
        found, theirs = pinsing.inverse(arm, T), np.array(formula(T))
        gaps = [np.abs(arm.space.wrap(found.q - s)).max(axis=1).min() for s in theirs]
        assert found.doubt or max(gaps) < 1e-5
        turn = arm.space.wrap(found.q[:, None] - found.q)
        least.append(np.abs(turn).max(axis=2)[~np.eye(len(found), dtype=bool)].min())
    assert min(least) < 2e-4


@pytest.mark.slow
@pytest.mark.parametrize("rows", [UR5, PUMA, CRX], ids=["ur5", "puma", "crx"])
def test_against_another_library_at_500_poses(rows):
    """ssik (BSD-3), where it is installed: each solution of either is one of the other's.

    Of an offset wrist ssik derives its equations once, which takes two minutes, and keeps them.
    """
    ssik = pytest.importorskip("ssik", reason="pip install ssik cython")
    arm = made(rows)
    d, a, alpha = np.array(rows, dtype=float).T
    other = ssik.Manipulator.from_dh(np.radians(alpha), a, d)
    total = 0
    for q in arm.space.sample(500, np.random.default_rng(5), True):
        pose = tip_placement(arm, q).homogeneous
        ours = pinsing.inverse(arm, pose)
        theirs = np.array([s.q for s in other.solve(pose)])
        gap = np.abs(arm.space.wrap(ours.q[:, None] - theirs[None])).max(axis=2)
        assert (gap.min(axis=0) < 1e-4).all() or ours.doubt
        assert (gap.min(axis=1) < 1e-4).all()
        total += len(ours)
    assert total > 500 * 6


@pytest.mark.slow
def test_offset_wrist_against_four_times_the_starts():
    """They find no more, of another seed, where there is no doubt."""
    arm, counts = made(CRX), set()
    for q in arm.space.sample(120, np.random.default_rng(11), True):
        T = tip_placement(arm, q).homogeneous
        found, more = pinsing.inverse(arm, T), pinsing.inverse(arm, T, starts=1024, seed=7)
        assert found.doubt or len(found) >= len(more)
        for s in found.q:
            assert np.abs(tip_placement(arm, s).homogeneous - T).max() < 1e-9
        assert found.doubt or len(found) % 2 == 0
        counts.add(len(found))
    assert counts >= {4, 8, 12}


@pytest.mark.slow
def test_a_cuspidal_arm_of_three_joints_has_all_its_points():
    """Its equation of degree four has two or four solutions; 2048 starts are the judge."""
    arm = made(((0, 1, -90), (1, 2, 90), (0, 1.5, 0)), "position")
    counts = set()
    for q in arm.space.sample(6, np.random.default_rng(2), True):
        p = tip_placement(arm, q).translation
        found, more = pinsing.inverse(arm, p), pinsing.inverse(arm, p, starts=2048, seed=3)
        assert len(found) == len(more)
        counts.add(len(found))
    assert counts == {2, 4}


def test_a_sign_that_lacks_is_known():
    """Solutions of a pose with one left out: the determinants do not balance, and starts follow."""
    arm = made(CRX)
    q = np.array([0.3, -0.8, 1.1, 0.4, 0.9, -0.5])
    T = tip_placement(arm, q)
    solver = Solver(arm, T.translation, T.rotation)
    known = pinsing.inverse(arm, T.homogeneous)
    found = FoundSolutions(solver)
    found.add(known.q, np.zeros(len(known)))
    assert found.lacking == 0
    for out in range(len(known)):
        found = FoundSolutions(solver)
        rest = np.delete(known.q, out, axis=0)
        found.add(rest, np.zeros(len(rest)))
        assert found.lacking == solver.signs(known.q[out : out + 1])[0]
        assert not found.settled()
        rng = np.random.default_rng(0)
        Q = drawn(solver, 40, rng, found.lacking)
        assert (solver.signs(Q) == found.lacking).all()


def test_a_full_set_is_known_to_be_full():
    arm = pinsing.load("puma560")
    found = pinsing.inverse(arm, [0.4, 0.2, 0.3, 0.1, 0.2, 0.3])
    assert len(found) == 8
    assert (found.certified, found.doubt) == (8, "")
    assert any("no more regular ones" in n for n in found.notes)
    assert pinsing.kinematics.InverseSolutions.from_dict(found.to_dict()).certified == 8


class TestRadius:
    def test_the_true_solution_is_within(self):
        from pinsing.kinematics.inverse import radii

        for name in ("ur5", "stanford", "kinova"):
            arm = pinsing.load(name)
            q = arm.space.sample(1, np.random.default_rng(5), True)[0]
            T = tip_placement(arm, q)
            solver = Solver(arm, T.translation, T.rotation)
            rng = np.random.default_rng(0)
            for size in (1e-9, 1e-7, 1e-5, 1e-4):
                Q = q + rng.normal(size=(40, 6)) * size
                r = radii(solver, Q)
                assert (r > np.linalg.norm(Q - q, axis=1)).all()
                assert size > 1e-9 or (r < 1e-4).all()
            far = radii(solver, q + rng.normal(size=(40, 6)))
            assert np.isinf(far).all()
