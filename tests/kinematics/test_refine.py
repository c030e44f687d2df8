"""Walks to singular configurations: they arrive, stay near, keep what is fixed, and the limits."""

import sys

import arms
import numpy as np
import pytest
from tiers import sampled

from pinsing._batch import engine as kernel
from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.kinematics.jacobian import batch, generic_rank, own_scale, singular_values
from pinsing.kinematics.refine import approach, constraint_gradient, refine, refine_many

ARMS = {
    "stanford": lambda: arms.textbook("stanford"),
    "surgical7": lambda: arms.textbook("surgical7"),
    "puma560": lambda: arms.textbook("puma560"),
    "irb1400": lambda: arms.textbook("irb1400"),
    "iiwa14": lambda: arms.textbook("iiwa14"),
    "ur5": arms.ur5,
    "scara": lambda: arms.textbook("scara"),  # n < m
    "planar3r": lambda: arms.textbook("planar3r"),  # r = n < m
    "planar4r pose": lambda: arms.planar((1, 0.8, 0.5, 0.3), task="pose"),  # r < n < m
    "planar4r position": lambda: arms.planar((1, 0.8, 0.5, 0.3)),  # r < m < n
    "puma560 position": lambda: arms.textbook("puma560", task="position"),
}


@pytest.mark.parametrize("name", ARMS)
def test_random_starts_all_arrive(name, rng):
    """Machine accuracy from anywhere, S-R-S arms and every relation of m, n and r included."""
    arm = ARMS[name]()
    Q = rng.uniform(-1, 1, (100, arm.n)) * np.where(arm.prismatic, 0.5, np.pi)
    end = approach(arm, Q)
    assert end.converged.all()
    assert end.singular.all()
    assert np.median(end.ratio) < 1e-15
    sigma = singular_values(arm, end.q)
    np.testing.assert_array_less(sigma[:, -1], 1e-9 * sigma[:, 0])
    # The second but last value tells that ranks are lost one by one, not by a collapse of J.
    assert np.median(end.sigma[:, 0]) > 0.1


@pytest.mark.parametrize("name", ARMS)
def test_gradient_against_finite_differences(name, rng):
    """First row of the equations: d sigma_r / dq = u' dJ v, where sigma_r is simple."""
    arm = ARMS[name]()
    q = rng.uniform(-1, 1, arm.n)
    B, sigma = constraint_gradient(arm, q)
    m, r = len(arm.task.rows), generic_rank(arm)
    assert B.shape == (1, (m - r + 1) * (arm.n - r + 1), arm.n)
    own = batch(arm).own_sigma  # free of units, as its moves are
    np.testing.assert_allclose(sigma, own(q[None])[:, :r], rtol=1e-12)
    slopes = arms.differences(lambda x: own(x[None])[0, r - 1], q) * own_scale(arm).columns
    np.testing.assert_allclose(B[0, 0], slopes, atol=1e-8)


def test_double_zero_of_the_stanford_arm():
    """det has d3 squared: sigma_min touches zero, where a plain Newton step halves the error."""
    arm = arms.textbook("stanford")
    found = refine(arm, [0.3, 0.8, 0.1, 0.7, 0.9, 0.2], fixed=["q1", "q2", "q4", "q5", "q6"])
    assert found.singular
    assert found.sigma_ratio < 1e-15
    assert abs(found.q[2]) < 1e-7
    assert found.iterations < 15


def test_fixed_joints_stay(rng):
    arm = arms.textbook("surgical7")
    start = np.array([0.05, 0.1, 0.2, 0.8, 0.9, 0.3, 0.4])
    found = refine(arm, start, fixed=["d1", "q3", "q4", "q5"])
    assert found.singular
    np.testing.assert_array_equal(found.q[[0, 2, 3, 4]], start[[0, 2, 3, 4]])
    mask = np.ones(7, dtype=bool)
    nothing = refine(arm, start, fixed=mask)
    np.testing.assert_array_equal(nothing.q, start)
    assert not nothing.singular
    both = refine_many(arm, np.array([start, start]), fixed=np.array([mask, ~mask]))
    assert [c.singular for c in both] == [False, True]


def test_minimum_above_zero_is_near_singular():
    """The valley beside q2 = q6 = 0 of an S-R-S arm, along q2: converged, and not singular."""
    arm = arms.textbook("iiwa14")
    others = [name for name in arm.joints if name != "q2"]
    found = refine(arm, [0.1, 0.02, 0.4, 1.0, 0.6, 0.005, 0.1], fixed=others)
    assert found.status == "near-singular"
    assert found.converged
    assert 1e-9 < found.sigma_ratio <= found.near_rtol
    assert found.residual == found.sigma[-1]
    grid = np.repeat([found.q], 401, axis=0)
    grid[:, 1] += np.linspace(-0.1, 0.1, 401)
    assert found.sigma[-1] <= singular_values(arm, grid)[:, -1].min() * (1 + 1e-6)
    start = [0.1, 0.8, 0.4, 1.0, 0.6, 0.5, 0.1]
    assert refine(arm, start, fixed=arm.joints).status == "regular"


def test_limits_are_kept_where_that_is_possible(rng):
    arm = arms.textbook("irb1400")  # its elbow families lie outside
    low, high = arm.span
    found = refine_many(arm, rng.uniform(low, high, (200, 6)))
    assert sum(c.within_limits for c in found) > 150
    assert all(c.singular for c in found)
    inside = np.array([c.q for c in found if c.within_limits])
    assert (inside >= arm.lower - 1e-12).all()
    assert (inside <= arm.upper + 1e-12).all()


def test_wrong_input():
    arm = arms.textbook("puma560")
    with pytest.raises(ConfigurationError, match="needs 6 values"):
        refine(arm, [0, 0])
    with pytest.raises(UnknownNameError, match="q55"):
        refine(arm, np.zeros(6), fixed=["q55"])
    with pytest.raises(OptionError, match="fixed"):
        refine(arm, np.zeros(6), fixed=[1, 2])
    with pytest.raises(OptionError, match="fixed"):
        refine_many(arm, np.zeros((3, 6)), fixed=np.zeros((2, 6), dtype=bool))


@pytest.mark.skipif(not kernel.available(), reason="no compiled kernel")
@pytest.mark.parametrize("name", sampled(ARMS))
def test_compiled_walks_are_those_in_numpy(name, rng, monkeypatch):
    """Joints held at random, with and without limits: the same ends, and as exact."""
    arm = ARMS[name]()
    Q = rng.uniform(-1, 1, (60, arm.n)) * np.where(arm.prismatic, 0.5, np.pi)
    Q[::2] = np.clip(Q[::2], arm.lower, arm.upper)
    free = rng.random(Q.shape) < 0.7
    ends = [approach(arm, Q, free), approach(arm, Q[::2], bounded=True)]
    monkeypatch.setattr(kernel, "walks_covered", lambda *given: False)
    for ours, theirs in zip(
        ends, [approach(arm, Q, free), approach(arm, Q[::2], bounded=True)], strict=True
    ):
        assert (ours.singular == theirs.singular).mean() > 0.95
        assert (ours.converged == theirs.converged).mean() > 0.95
        sharp = ours.singular & theirs.singular
        assert np.median(ours.ratio[sharp]) < 1e-15
        # Some walks pass a place where rounding alone decides which way they go.
        assert (np.abs(ours.q - theirs.q).max(axis=1) < 1e-6).mean() > 0.7
    assert (ends[0].q[~free] == Q[~free]).all()
    assert (ends[1].q >= arm.lower).all()
    assert (ends[1].q <= arm.upper).all()


@pytest.mark.skipif(not kernel.available(), reason="no compiled kernel")
def test_compiled_walks_refuse_what_does_not_fit():
    chain = batch(arms.ur5()).own_chain()
    ok = {
        "Q": np.zeros((2, 6)), "free": np.ones((2, 6), bool), "rows": range(6), "rank": 6,
        "limits": (np.full(6, -1.0), np.ones(6)), "size": 0.0, "max_iterations": 3,
        "rules": sys.modules["pinsing.kinematics.refine"]._RULES,
    }  # fmt: skip
    kernel.walks(chain, **ok)
    for wrong in (
        {"Q": np.zeros((2, 5))}, {"Q": np.full((2, 6), np.nan)}, {"free": np.ones((1, 6), bool)},
        {"limits": (np.zeros(5), np.ones(5))}, {"rows": [7]}, {"isa": "abacus"}, {"rank": 7},
        {"rank": 1},  # 36 equations
    ):  # fmt: skip
        with pytest.raises(ValueError):
            kernel.walks(chain, **{**ok, **wrong})
