"""Joint speeds near singularities: each method against its formula, and that nothing jumps."""

import numpy as np
import pytest
from tiers import sampled

import pinsing
from pinsing.errors import ConfigurationError, OptionError
from pinsing.kinematics.inverse_velocity import METHODS

DAMPED = [m for m in METHODS if m != "pinv"]
rng = np.random.default_rng(0)


def ur5(q: object) -> np.ndarray:
    return pinsing.frame_jacobian(pinsing.load("ur5"), q)


def wrist(q5: float) -> np.ndarray:
    return ur5([0.3, -1, 1, -1, q5, 0])


def test_the_pseudoinverse_is_that_of_numpy() -> None:
    for shape in ((6, 6), (6, 7), (3, 6), (6, 4), (1, 3)):
        J, x = rng.normal(size=(20, *shape)), rng.normal(size=(20, shape[0]))
        found = pinsing.inverse_velocity(J, x, "pinv")
        np.testing.assert_allclose(found.dq, np.einsum("...nm,...m->...n", np.linalg.pinv(J), x))
        np.testing.assert_allclose(found.achieved + found.missed, x)
        np.testing.assert_allclose(found.kept, 1)
        assert (found.damped < 1e-12).all()


@pytest.mark.parametrize("q5", [0.0, 1e-6, 0.01, 0.05, 0.2, 1.0])
def test_damped_least_squares_are_their_formula(q5: float) -> None:
    J, x = wrist(q5), rng.normal(size=6)
    sigma = np.linalg.svd(J)[1]
    found = pinsing.inverse_velocity(J, x, "dls", damping=0.07, threshold=0.2)
    square = (0.07 * max(1 - sigma[-1] / 0.2, 0)) ** 2
    np.testing.assert_allclose(found.dq, J.T @ np.linalg.solve(J @ J.T + square * np.eye(6), x))
    w, w0 = np.sqrt(abs(np.linalg.det(J @ J.T))), 0.05
    found = pinsing.inverse_velocity(J, x, "dls", damping=0.07, manipulability=w0)
    square = (0.07 * max(1 - w / w0, 0)) ** 2
    np.testing.assert_allclose(
        found.dq, J.T @ np.linalg.solve(J @ J.T + square * np.eye(6), x), rtol=1e-6
    )


@pytest.mark.parametrize("q5", [0.0, 1e-6, 0.01, 0.05, 1.0])
def test_numerical_filtering_is_its_formula(q5: float) -> None:
    J, x = wrist(q5), rng.normal(size=6)
    U, sigma, _ = np.linalg.svd(J)
    threshold = (sigma[-1] + sigma[-2]) / 2  # one direction is below it
    found = pinsing.inverse_velocity(
        J, x, "filter", damping=0.3, threshold=threshold, isotropic=0.01
    )
    square = 0.3**2 * (1 - (sigma[-1] / threshold) ** 2)
    A = J @ J.T + 1e-4 * np.eye(6) + square * np.outer(U[:, -1], U[:, -1])
    np.testing.assert_allclose(found.dq, J.T @ np.linalg.solve(A, x), rtol=1e-8)


def test_selective_damping_is_its_algorithm() -> None:
    """Buss and Kim 2005, step by step in loops, for one target."""
    for J in (wrist(0.0), wrist(0.02), wrist(1.0), rng.normal(size=(3, 7))):
        x, limit = rng.normal(size=len(J)), 0.6
        U, s, VT = np.linalg.svd(J, full_matrices=False)
        total = np.zeros(J.shape[1])
        for i in range(len(s)):
            if s[i] <= 1e-12 * s[0]:
                continue
            N = np.linalg.norm(U[:, i])
            M = sum(abs(VT[i, j]) * np.linalg.norm(J[:, j]) for j in range(J.shape[1])) / s[i]
            gamma = min(1.0, N / M) * limit
            part = U[:, i] @ x / s[i] * VT[i]
            total += part * min(1.0, gamma / max(np.abs(part).max(), 1e-300))
        total *= min(1.0, limit / np.abs(total).max())
        found = pinsing.inverse_velocity(J, x, "sdls", gamma_max=limit)
        np.testing.assert_allclose(found.dq, total, atol=1e-12)
        assert np.abs(found.dq).max() <= limit * (1 + 1e-12)


@pytest.mark.parametrize("q5", [0.0, 1e-3, 0.05, 0.2, 1.0])
def test_jparse_is_its_equation(q5: float) -> None:
    """J_s^+ J_p J_p^+ + J_s^+ Phi of arXiv 2505.00306, with matrices."""
    J, x, gamma = wrist(q5), rng.normal(size=6), 0.15
    U, s, VT = np.linalg.svd(J)
    low = s <= gamma * s[0]
    safety = U @ np.diag(np.where(low, gamma * s[0], s)) @ VT
    projection = U @ np.diag(np.where(low, 0, s)) @ VT
    phi = U @ np.diag(np.where(low, s / (gamma * s[0]), 0)) @ U.T
    inverse = np.linalg.pinv(safety)
    wanted = inverse @ projection @ np.linalg.pinv(projection, rcond=1e-9) @ x + inverse @ phi @ x
    found = pinsing.inverse_velocity(J, x, "jparse", gamma=gamma)
    np.testing.assert_allclose(found.dq, wanted, atol=1e-10)


@pytest.mark.parametrize("method", METHODS)
def test_far_from_singularities_all_is_achieved(method: str) -> None:
    J, x = wrist(1.2), 0.05 * rng.normal(size=6)
    found = pinsing.inverse_velocity(J, x, method, threshold=0.02, gamma=0.01, gamma_max=10.0)
    np.testing.assert_allclose(found.achieved, x, atol=1e-12)
    assert found.damped < 1e-9


@pytest.mark.parametrize("method", sampled(DAMPED))
def test_speeds_stay_bounded_and_do_not_jump_through_a_singularity(method: str) -> None:
    q5 = np.linspace(-0.3, 0.3, 6001)
    Q = np.tile([0.3, -1, 1, -1, 0, 0], (len(q5), 1))
    Q[:, 4] = q5
    J = pinsing.kinematics.frame_jacobians(pinsing.load("ur5"), Q)
    x = np.array([0, 0.1, 0.1, 0.3, 0.2, 0.1])
    found = pinsing.inverse_velocity(J, x, method)
    assert np.abs(found.dq).max() < 6
    assert np.abs(np.diff(found.dq, axis=0)).max() < 0.05
    plain = pinsing.inverse_velocity(J, x, "pinv")
    assert np.abs(plain.dq).max() > 1000  # so that this could fail
    assert found.damped[3000] == pytest.approx(1, abs=1e-6)
    assert found.damped.min() < 0.9


@pytest.mark.parametrize("method", ["dls", "filter", "jparse"])
def test_two_lost_directions_that_change_places_make_no_jump(method: str) -> None:
    a = np.linspace(0.01, 0.04, 2001)
    J = np.zeros((len(a), 3, 3))
    J[:, 0, 0], J[:, 1, 1], J[:, 2, 2] = 1, a, 0.05 - a
    found = pinsing.inverse_velocity(J, [0.1, 0.2, 0.3], method)
    assert np.abs(np.diff(found.dq, axis=0)).max() < 0.01


def test_joint_speed_limits_keep_the_direction() -> None:
    J, x = wrist(0.05), np.array([0.3, 0, 0.2, 0, 0.5, 0.1])
    free = pinsing.inverse_velocity(J, x, "pinv")
    limits = np.array([1, 1, 1, 0.4, 1, np.inf])
    held = pinsing.inverse_velocity(J, x, "pinv", speed_limits=limits)
    assert (np.abs(held.dq) <= limits * (1 + 1e-12)).all()
    assert (np.abs(held.dq) / limits).max() == pytest.approx(1)
    np.testing.assert_allclose(held.dq, free.dq * held.speed_scale)
    np.testing.assert_allclose(held.achieved, held.speed_scale * x, atol=1e-12)


@pytest.mark.parametrize(
    ("J", "twist", "options", "error", "words"),
    [
        (np.eye(6), np.ones(5), {}, ConfigurationError, "6 values"),
        (np.ones(6), np.ones(6), {}, ConfigurationError, "shape"),
        (np.full((6, 6), np.nan), np.ones(6), {}, ConfigurationError, "finite"),
        (np.ones((3, 6, 6)), np.ones((4, 6)), {}, ConfigurationError, "as many"),
        (np.eye(6), np.ones(6), {"method": "magic"}, OptionError, "pinv, dls"),
        (np.eye(6), np.ones(6), {"damping": 0.0}, OptionError, "damping"),
        (np.eye(6), np.ones(6), {"gamma": 1.0}, OptionError, "gamma"),
        (np.eye(6), np.ones(6), {"length_scale": -1.0}, OptionError, "length_scale"),
        (np.eye(3), np.ones(3), {"length_scale": 0.5}, OptionError, "of 6 rows"),
        (np.eye(6), np.ones(6), {"weights": np.zeros(6)}, OptionError, "weights"),
        (np.eye(6), np.ones(6), {"speed_limits": [1.0]}, OptionError, "speed_limits"),
    ],
)
def test_bad_input(J: object, twist: object, options: dict, error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        pinsing.inverse_velocity(J, twist, **options)
