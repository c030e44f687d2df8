"""Walks to singular configurations, and what is lost there: boundary or interior."""

import sys

import arms
import numpy as np
import pytest
from dh_arms import dh_arm
from kernel import needs_kernel
from tiers import sampled

from pinsing import closed_form, load
from pinsing._batch import engine as kernel
from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.kinematics import jacobian
from pinsing.kinematics.refine import (
    approach,
    clear_kinds,
    constraint_gradient,
    describe_many,
    kinds_many,
    refine,
    refine_many,
)
from pinsing.robot.nominal import nominal

# Of 4 joints n < m, of planar3r r = n < m, of planar4r r < n < m, and of its position r < m < n.
ARMS = (
    "stanford", "surgical7", "puma560", "irb1400", "iiwa14", "ur5", "scara", "planar3r",
    "planar4r", "planar4r position", "puma560 position",
)  # fmt: skip


def made(words):
    """An arm, and its task where that is not the pose."""
    name, task = (*words.split(), "pose")[:2]
    if name == "planar4r":
        return arms.planar((1, 0.8, 0.5, 0.3), task)
    return arms.ur5() if name == "ur5" else arms.textbook(name, task)


@pytest.mark.parametrize("name", ARMS)
def test_random_starts_all_arrive(name, rng):
    """Machine accuracy from anywhere, S-R-S arms and every relation of m, n and r included."""
    arm = made(name)
    Q = rng.uniform(-1, 1, (100, arm.n)) * np.where(arm.prismatic, 0.5, np.pi)
    end = approach(arm, Q)
    assert end.converged.all()
    assert end.singular.all()
    assert np.median(end.ratio) < 1e-15
    sigma = jacobian.singular_values(arm, end.q)
    np.testing.assert_array_less(sigma[:, -1], 1e-9 * sigma[:, 0])
    # The second but last value tells that ranks are lost one by one, not by a collapse of J.
    assert np.median(end.sigma[:, 0]) > 0.1


@pytest.mark.parametrize("name", ARMS)
def test_gradient_against_finite_differences(name, rng):
    """First row of the equations: d sigma_r / dq = u' dJ v, where sigma_r is simple."""
    arm = made(name)
    q = rng.uniform(-1, 1, arm.n)
    B, sigma = constraint_gradient(arm, q)
    m, r = len(arm.task.rows), jacobian.generic_rank(arm)
    assert B.shape == (1, (m - r + 1) * (arm.n - r + 1), arm.n)
    own = jacobian.batch(arm).own_sigma  # free of units, as its moves are
    np.testing.assert_allclose(sigma, own(q[None])[:, :r], rtol=1e-12)
    slopes = arms.differences(lambda x: own(x[None])[0, r - 1], q) * jacobian.own_scale(arm).columns
    np.testing.assert_allclose(B[0, 0], slopes, atol=1e-8)


def test_double_zero_of_the_stanford_arm():
    """det has d3 squared: sigma_min touches zero, where a plain Newton step halves the error."""
    arm = arms.textbook("stanford")
    found = refine(arm, [0.3, 0.8, 0.1, 0.7, 0.9, 0.2], fixed=["q1", "q2", "q4", "q5", "q6"])
    assert found.sigma_ratio < 1e-15
    assert abs(found.q[2]) < 1e-7
    assert found.iterations < 15


def test_fixed_joints_stay():
    arm = arms.textbook("surgical7")
    start = np.array([0.05, 0.1, 0.2, 0.8, 0.9, 0.3, 0.4])
    found = refine(arm, start, fixed=["d1", "q3", "q4", "q5"])
    assert found.singular
    np.testing.assert_array_equal(found.q[[0, 2, 3, 4]], start[[0, 2, 3, 4]])
    mask = np.ones(7, dtype=bool)
    nothing, other = refine_many(arm, np.array([start, start]), fixed=np.array([mask, ~mask]))
    np.testing.assert_array_equal(nothing.q, start)
    assert (nothing.singular, other.singular) == (False, True)


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
    assert found.sigma[-1] <= jacobian.singular_values(arm, grid)[:, -1].min() * (1 + 1e-6)
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


@pytest.mark.parametrize(
    ("starts", "fixed", "error", "words"),
    [
        (np.zeros((1, 2)), [], ConfigurationError, "needs 6 values"),
        (np.zeros((1, 6)), ["q55"], UnknownNameError, "q55"),
        (np.zeros((1, 6)), [1, 2], OptionError, "fixed"),
        (np.zeros((3, 6)), np.zeros((2, 6), dtype=bool), OptionError, "fixed"),
    ],
)
def test_wrong_input(starts, fixed, error, words):
    with pytest.raises(error, match=words):
        refine_many(arms.textbook("puma560"), starts, fixed=fixed)


@needs_kernel
@pytest.mark.parametrize("name", sampled(ARMS))
def test_compiled_walks_are_those_in_numpy(name, rng, monkeypatch):
    """Joints held at random, with and without limits: the same ends, and as exact."""
    arm = made(name)
    Q = rng.uniform(-1, 1, (60, arm.n)) * np.where(arm.prismatic, 0.5, np.pi)
    Q[::2] = np.clip(Q[::2], arm.lower, arm.upper)
    free = rng.random(Q.shape) < 0.7
    ways = {"Q": Q, "free": free}, {"Q": Q[::2], "bounded": True}
    ends = [approach(arm, **way) for way in ways]
    monkeypatch.setattr(kernel, "walks_covered", lambda *given: False)
    for ours, way in zip(ends, ways, strict=True):
        theirs = approach(arm, **way)
        assert (ours.singular == theirs.singular).mean() > 0.95
        assert (ours.converged == theirs.converged).mean() > 0.95
        sharp = ours.singular & theirs.singular
        assert np.median(ours.ratio[sharp]) < 1e-15
        # Some walks pass a place where rounding alone decides which way they go.
        assert (np.abs(ours.q - theirs.q).max(axis=1) < 1e-6).mean() > 0.7
    assert (ends[0].q[~free] == Q[~free]).all()
    assert ((ends[1].q >= arm.lower) & (ends[1].q <= arm.upper)).all()


@needs_kernel
def test_compiled_walks_refuse_what_does_not_fit():
    chain = jacobian.batch(arms.ur5()).own_chain()
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


PI = np.pi


def kind_at(arm, q):
    return describe_many(arm, [q])[0].kind


@pytest.mark.parametrize(
    ("name", "q", "kind"),
    [
        ((1.0, 0.8), [0.3, 0.0], "boundary"), ((1.0, 0.8), [0.3, PI], "boundary"),
        ((1.0, 0.8, 0.5), [0.3, 0.0, 0.0], "boundary"),
        ((1.0, 0.8, 0.5), [0.3, PI, 0.0], "interior"),
        ((1.0, 0.8, 0.5), [0.3, 0.0, PI], "interior"),
        # Folded with the first link longer than the others together: the inner boundary.
        ((2.0, 0.8, 0.5), [0.3, PI, 0.0], "boundary"),
        ("puma560", [0.3, 0.4, -0.5, 0.7, 0.0, 0.9], "interior"),  # wrist
        ("stanford", [0.3, 0.8, 0.3, 0.7, 0.0, 0.2], "interior"),  # wrist
        # The shoulder offset keeps the wrist off axis 1: the inside of a hollow cylinder.
        ("stanford", [0.3, 0.0, 0.3, 0.7, 0.9, 0.2], "boundary"),
        # Here the determinant only touches zero: no second order to decide by.
        ("stanford", [0.3, 0.8, 0.0, 0.7, 0.9, 0.2], "undecided"),
        # The elbow stretched. The upper arm may spin about itself: a kernel that changes nothing.
        ("iiwa14", [0.3, 0.5, 0.3, 0.0, 0.9, 0.2, 0.2], "boundary"),
        ("iiwa14", [0.3, 0.0, PI / 2, 0.7, 0.9, 0.2, 0.2], "interior"),
        ("iiwa14", [0.3, 0.0, 0.5, 0.7, 0.5, 0.0, 0.2], "interior"),
        ("scara", [0.1, 0.0, 0.1, 0.3], "boundary"), ("planar3r", [0.1, 0.0, 0.5], "boundary"),
    ],
)  # fmt: skip
def test_kinds_of_textbook_arms_and_of_planar_ones_of_given_lengths(name, q, kind):
    arm = arms.textbook(name) if isinstance(name, str) else arms.planar(name)
    assert kind_at(arm, q) == kind


@pytest.mark.parametrize("name", ["puma560", "iiwa14", "scara", "planar3r", "stanford"])
def test_null_spaces(name, rng):
    """Lost directions and self-motions are orthonormal, and are what they are called."""
    arm = arms.textbook(name)
    for start in rng.uniform(-2, 2, (10, arm.n)):
        found = refine(arm, start, ignore_limits=True)
        J = jacobian.task_jacobian(arm, found.q)
        lost, N = found.lost, found.self_motion
        assert lost.shape == (len(J), jacobian.generic_rank(arm) - found.rank)
        assert N.shape == (arm.n, arm.n - found.rank)
        np.testing.assert_allclose(lost.T @ lost, np.eye(lost.shape[1]), atol=1e-12)
        np.testing.assert_allclose(J.T @ lost, 0, atol=1e-9)
        np.testing.assert_allclose(J @ N, 0, atol=1e-9)


def test_second_order_form_is_the_second_derivative_of_the_tip():
    """u' d2x along a self-motion, against finite differences of the forward kinematics."""
    arm = arms.textbook("iiwa14", task="position")
    q = refine(arm, [0.3, 0.4, 0.2, 0.05, 0.3, 0.1, 0.2], ignore_limits=True).q
    found = describe_many(arm, [q])[0]
    u, H = found.lost[:, 0], jacobian.jacobian_derivative(jacobian.frame_jacobian(arm, q))[:3]
    h = 1e-4
    for n in found.self_motion.T:
        x = [jacobian.tip_placement(arm, q + s * h * n).translation for s in (-1, 0, 1)]
        second = u @ (x[0] - 2 * x[1] + x[2]) / h**2
        np.testing.assert_allclose(np.einsum("r,rij,i,j", u, H, n, n), second, atol=1e-6)


def test_a_small_form_is_a_form():
    """A PUMA as Craig has it: folded, its wrist is half a millimetre from axis 2."""
    rows = [(90, 0, 0), (0, 0.4318, 0), (-90, 0.0203, 0.1245), (90, 0, 0.4318), (-90, 0, 0),
            (0, 0, 0)]  # fmt: skip
    arm = dh_arm(rows)
    Q = closed_form(arm)["elbow"].sample(300, np.random.default_rng(2))
    assert set(kinds_many(arm, Q)) == {"boundary"}


def test_points_that_take_longer_stand_among_others():
    """UR5, position, tip in the plane of axes 1 and 2, wrist straight or folded back.

    Straight, the form is indefinite, which is seen at once. Folded back it is definite but for
    self-motions that stay singular.
    """
    arm = load("ur5", task="position")
    q2, q3 = np.random.default_rng(0).uniform(-3, 3, (2, 300))
    s = (0.425 * np.cos(q2) + 0.39225 * np.cos(q2 + q3)) / 0.09465
    q2, q3, s = (v[np.abs(s) < 0.95][:20] for v in (q2, q3, s))
    q5 = np.where(np.arange(20) < 10, 0.0, PI)
    Q = np.stack([q5 * 0 + 0.4, q2, q3, np.arcsin(s) - q2 - q3, q5, q5 * 0], axis=1)
    assert kinds_many(arm, Q) == ["interior"] * 10 + ["boundary"] * 10
    assert [kind_at(arm, q) for q in Q[::4]] == ["interior"] * 3 + ["boundary"] * 2


CASES = {
    "6 joints": {"robot": "ur5"}, "a slider": {"robot": "stanford"},
    "7 joints": {"robot": "panda"}, "three rows": {"robot": "planar3r", "task": "vx,vy,wz"},
    "position of 6 joints": {"robot": "ur5", "task": "position"},
}  # fmt: skip


@pytest.mark.parametrize("case", sampled([*CASES.values()]), ids=str)
def test_clear_kinds_are_those_of_one_at_a_time(case):
    loaded = load(**case)
    arm = nominal(loaded).arm
    rng = np.random.default_rng(6)
    Q = np.concatenate([f.points(20, rng) for f in closed_form(loaded).families])
    alone = [describe_many(arm, [q])[0].kind for q in Q]
    told = clear_kinds(arm, Q)
    clear = [kind is not None for kind in told]
    assert sum(clear) > 10
    assert [a for a, c in zip(alone, clear, strict=True) if c] == [k for k in told if k is not None]
    regular = rng.uniform(-1, 1, (5, arm.n))
    assert clear_kinds(arm, regular) == [None] * 5
