"""Tip speeds that joint speed limits allow: against the inverse, and a linear program."""

import re

import numpy as np
import pytest
from scipy.optimize import linprog
from tiers import tiered

import pinsing
from pinsing.kinematics import frame_jacobian, tip_speeds
from pinsing.kinematics.tip_speed import SpeedJudge


def _longest(J, c, x):
    """The longest multiple of the twist x (6,) that joint speeds up to c (n,) give."""
    n = J.shape[1]
    found = linprog(
        np.r_[np.zeros(n), -1], A_eq=np.c_[J, -x], b_eq=np.zeros(len(x)),
        bounds=[*((-a, a) for a in c), (0, None)],
    )  # fmt: skip
    return found.x[-1]


def test_of_a_square_jacobian_each_joint_has_a_row_of_the_inverse():
    arm = pinsing.load("ur5")
    q, c = [0.3, -1.2, 1.3, -1, 0.7, 0.2], np.linspace(1, 2, 6)
    found = tip_speeds(arm, q, 0.25, 0.5, joint_speeds=c)
    v, w = (
        np.linalg.norm(x, axis=1) for x in np.split(np.linalg.inv(frame_jacobian(arm, q)), 2, 1)
    )
    assert found.linear == pytest.approx((c / v).min())
    assert found.angular == pytest.approx((c / w).min())
    assert found.share == pytest.approx(((0.25 * v + 0.5 * w) / c).max())
    assert found.linear_joints == (arm.joints[int((c / v).argmin())],)
    shares = SpeedJudge(arm, c).shares(np.array([q]), 0.25, 0.5)[0]
    np.testing.assert_allclose(shares, (0.25 * v + 0.5 * w) / c)


@pytest.mark.parametrize("seed", tiered(range(4), {0}))
def test_of_a_redundant_arm_no_direction_is_slower(seed):
    arm, rng = pinsing.load("panda"), np.random.default_rng(seed)
    q, c = rng.uniform(-1.5, 1.5, 7), rng.uniform(1, 3, 7)
    J, found = frame_jacobian(arm, q), tip_speeds(arm, q, joint_speeds=c)
    for speed, direction, rows in (
        (found.linear, found.linear_direction, slice(0, 3)),
        (found.angular, found.angular_direction, slice(3, 6)),
    ):
        x = np.zeros(6)
        x[rows] = direction
        assert _longest(J, c, x) == pytest.approx(speed, rel=1e-6)
        for u in rng.normal(size=(20, 3)):
            x[rows] = u / np.linalg.norm(u)
            assert _longest(J, c, x) >= speed * (1 - 1e-9)


def test_at_a_singularity_some_direction_is_lost():
    arm = pinsing.load("ur5")
    state = pinsing.at(arm, [0, -1.2, 1.3, -1, 0, 0])
    assert state.singular
    assert state.tip_speeds.linear == state.tip_speeds.angular == 0
    assert state.tip_speeds.share == np.inf
    assert "wrist_3_joint" in state.tip_speeds.share_joints
    assert pinsing.State.from_json(state.to_json()).tip_speeds.share == np.inf
    all_of_them = pinsing.load("planar3r", task="vx")
    assert tip_speeds(all_of_them, np.zeros(3), joint_speeds=np.ones(3)).linear == 0
    near = str(pinsing.at(arm, [0, -1.5, 1.5, 0, 1e-3, 0]))
    assert re.search(r"at most \d+,\d+ % of the limit", " ".join(near.split()))
