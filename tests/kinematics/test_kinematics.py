"""Jacobians and their derivatives against Pinocchio and finite differences."""

import numpy as np
import pinocchio as pin
import pytest
from arms import CATALOGUE, differences, draw, pinocchio_jacobian
from dh_arms import dh_arm
from tiers import sampled

from pinsing.errors import OptionError
from pinsing.kinematics import jacobian as kinematics
from pinsing.robot.arm import Arm
from pinsing.robot.load import load


@pytest.fixture(scope="module", params=CATALOGUE, ids=[name for name, _ in CATALOGUE])
def arm(request) -> Arm:
    name, tip = request.param
    return load(name, tip=tip)


def test_equals_pinocchio(arm, rng):
    Q = draw(arm, rng, 20)
    J = kinematics.frame_jacobians(arm, Q)
    assert J.shape == (20, 6, arm.n)
    assert kinematics.frame_jacobians(arm, Q[:0]).shape == (0, 6, arm.n)
    np.testing.assert_allclose(J, [pinocchio_jacobian(arm, q) for q in Q], atol=1e-12)
    np.testing.assert_allclose(kinematics.frame_jacobian(arm, Q[3]), J[3], atol=1e-13)
    loop = kinematics.frame_jacobians(arm, Q, engine="pinocchio")
    np.testing.assert_array_equal(kinematics.frame_jacobian(arm, Q[3]), loop[3])


@pytest.mark.parametrize(
    ("task", "rows"),
    [
        ("pose", [0, 1, 2, 3, 4, 5]), ("position", [0, 1, 2]), ("orientation", [3, 4, 5]),
        ("vx,vy,wz", [0, 1, 5]), (["wz", "vx"], [0, 5]),
    ],
)  # fmt: skip
def test_task_rows_and_length_scale(rng, task, rows):
    arm = load("ur5", task=task, length_scale=0.25)
    Q = draw(arm, rng, 4)
    J = kinematics.frame_jacobians(arm, Q)
    J[:, :3] /= 0.25
    np.testing.assert_allclose(kinematics.task_jacobians(arm, Q), J[:, rows], atol=1e-13)
    np.testing.assert_allclose(kinematics.task_jacobian(arm, Q[1]), J[1, rows], atol=1e-13)
    sigma = np.linalg.svd(J[:, rows], compute_uv=False)
    np.testing.assert_allclose(kinematics.singular_values(arm, Q), sigma, atol=1e-14)


def test_derivative_against_finite_differences(arm, rng):
    q = draw(arm, rng, 1)[0]
    H = kinematics.jacobian_derivative(kinematics.frame_jacobian(arm, q))
    assert H.shape == (6, arm.n, arm.n)
    numeric = differences(lambda x: kinematics.frame_jacobian(arm, x), q, 1e-5)
    np.testing.assert_allclose(H, numeric, atol=2e-9)


@pytest.mark.slow
def test_task_derivatives_are_scaled_like_the_task(rng):
    rows = [(90, 0, 20), (90, 20, 0), (0, 0, 20, 0, "prismatic"), (90, 0, 10)]
    arm, size = dh_arm(rows).with_task("vx,vz,wy", length_scale=0.5), 100.0
    Q = draw(arm, rng, 6)
    J, H = kinematics.own_jacobians_and_derivatives(arm, Q)
    full = kinematics.jacobian_derivative(kinematics.frame_jacobians(arm, Q))
    rows = np.array([1 / size, 1 / size, 1.0])[:, None]
    columns = np.where(arm.prismatic, size, 1.0)
    unscaled = kinematics.task_jacobians(arm, Q) * np.array([0.5, 0.5, 1.0])[:, None]
    np.testing.assert_allclose(J, unscaled * rows * columns, rtol=1e-14)
    assert H.shape == (6, 3, 4, 4)
    expected = full[:, [0, 2, 4]] * rows[..., None] * columns[:, None] * columns
    np.testing.assert_allclose(H, expected, rtol=1e-14)
    arm = load("panda")
    other = arm.with_task("position", length_scale=0.1)
    loaded = load("panda", task="position", length_scale=0.1)
    Q = draw(arm, rng, 3)
    np.testing.assert_array_equal(
        kinematics.task_jacobians(other, Q), kinematics.task_jacobians(loaded, Q)
    )
    assert (arm.task.name, arm.length_scale) == ("pose", 1.0)
    assert (kinematics.generic_rank(arm), kinematics.generic_rank(other)) == (6, 3)


@pytest.mark.parametrize(
    ("robot", "task", "r"),
    sampled([
        ("ur5", "pose", 6), ("ur5", "position", 3), ("ur5", "orientation", 3),
        ("stanford", "pose", 6), ("puma560", "pose", 6), ("irb1400", "pose", 6),
        ("panda", "pose", 6), ("iiwa14", "pose", 6), ("surgical7", "pose", 6), ("xarm7", "pose", 6),
        ("tiago", "pose", 6), ("so100", "pose", 5), ("so101", "pose", 5), ("so101", "position", 3),
        ("scara", "pose", 4), ("scara", "position", 3), ("scara", "vx,vy,wz", 3),
        ("scara", "orientation", 1), ("planar3r", "pose", 3), ("planar3r", "position", 2),
    ]),
)  # fmt: skip
def test_generic_rank(robot, task, r):
    arm = load(robot, task=task)
    assert kinematics.generic_rank(arm) == r
    assert kinematics.singular_values(arm, np.full((2, arm.n), 0.3)).shape == (2, r)


def test_generic_rank_is_of_the_nominal_geometry(make_model):
    """Axes parallel but for a rounded angle: the third direction is a rounding error."""
    tilt = pin.SE3(pin.utils.rotate("x", 2e-6), np.array([0.5, 0.0, 0.0]))
    straight = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
    model = make_model(
        [(pin.JointModelRZ(), p) for p in (pin.SE3.Identity(), tilt, straight, tilt)], straight
    )
    arm = load(model, tip="tip")
    assert kinematics.generic_rank(arm) == 3
    raw = np.linalg.matrix_rank(kinematics.frame_jacobian(arm, [0.3, 0.5, 0.7, 0.2]))
    assert raw == 4


@pytest.mark.slow
def test_a_task_that_nothing_but_rounding_serves(rng):
    rows = [(-90, 0, 0, -90, "prismatic"), (0, 0, 0, 180), (-90, 0.25, 0, 0), (180, 0, 0.4, -90)]
    arm = dh_arm(rows, task="vx")
    q = np.random.default_rng(1).uniform(-1, 1, 4)
    assert 0 < np.abs(kinematics.frame_jacobian(arm, q)[0]).max() < 1e-15
    with pytest.raises(OptionError, match="no joint of made moves tip"):
        kinematics.generic_rank(arm)
    arm = load("kinova", units="rad")
    assert (arm.model.nq, arm.n) == (9, 6)
    assert np.isinf(arm.upper[[0, 3, 5]]).all()
    q = draw(arm, rng, 1)[0]
    turn = 2 * np.pi * np.array([1, 0, 0, -2, 0, 3])
    np.testing.assert_allclose(
        kinematics.frame_jacobian(arm, q + turn), kinematics.frame_jacobian(arm, q), atol=1e-13
    )
