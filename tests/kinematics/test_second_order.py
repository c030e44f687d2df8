"""What is lost, and boundary or interior, on arms where the answer is known."""

import arms
import numpy as np
import pytest
from dh_arms import dh_arm
from tiers import sampled

from pinsing import closed_form, load
from pinsing.kinematics.jacobian import (
    frame_jacobian,
    generic_rank,
    jacobian_derivative,
    task_jacobian,
    tip_placement,
)
from pinsing.kinematics.refine import clear_kinds, describe_many, kinds_many, refine
from pinsing.robot.nominal import nominal

PI = np.pi


def kind_at(arm, q):
    return describe_many(arm, [q])[0].kind


@pytest.mark.parametrize(
    ("lengths", "q", "kind"),
    [
        ((1.0, 0.8), [0.3, 0.0], "boundary"),
        ((1.0, 0.8), [0.3, PI], "boundary"),
        ((1.0, 0.8, 0.5), [0.3, 0.0, 0.0], "boundary"),
        ((1.0, 0.8, 0.5), [0.3, PI, 0.0], "interior"),
        ((1.0, 0.8, 0.5), [0.3, 0.0, PI], "interior"),
        # Folded with the first link longer than the others together: the inner boundary.
        ((2.0, 0.8, 0.5), [0.3, PI, 0.0], "boundary"),
    ],
)
def test_planar_arms(lengths, q, kind):
    assert kind_at(arms.planar(lengths), q) == kind


@pytest.mark.parametrize(
    ("name", "q", "kind"),
    [
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
        ("scara", [0.1, 0.0, 0.1, 0.3], "boundary"),
        ("planar3r", [0.1, 0.0, 0.5], "boundary"),
    ],
)
def test_textbook_arms(name, q, kind):
    assert kind_at(arms.textbook(name), q) == kind


@pytest.mark.parametrize("name", ["puma560", "iiwa14", "scara", "planar3r", "stanford"])
def test_null_spaces(name, rng):
    """Lost directions and self-motions are orthonormal, and are what they are called."""
    arm = arms.textbook(name)
    for start in rng.uniform(-2, 2, (10, arm.n)):
        found = refine(arm, start, ignore_limits=True)
        J = task_jacobian(arm, found.q)
        lost, N = found.lost, found.self_motion
        assert lost.shape == (len(J), generic_rank(arm) - found.rank)
        assert N.shape == (arm.n, arm.n - found.rank)
        np.testing.assert_allclose(lost.T @ lost, np.eye(lost.shape[1]), atol=1e-12)
        np.testing.assert_allclose(J.T @ lost, 0, atol=1e-9)
        np.testing.assert_allclose(J @ N, 0, atol=1e-9)


def test_second_order_form_is_the_second_derivative_of_the_tip():
    """u' d2x along a self-motion, against finite differences of the forward kinematics."""
    arm = arms.textbook("iiwa14", task="position")
    q = refine(arm, [0.3, 0.4, 0.2, 0.05, 0.3, 0.1, 0.2], ignore_limits=True).q
    found = describe_many(arm, [q])[0]
    u, H = found.lost[:, 0], jacobian_derivative(frame_jacobian(arm, q))[:3]
    h = 1e-4
    for n in found.self_motion.T:
        x = [tip_placement(arm, q + s * h * n).translation for s in (-1, 0, 1)]
        second = u @ (x[0] - 2 * x[1] + x[2]) / h**2
        np.testing.assert_allclose(np.einsum("r,rij,i,j", u, H, n, n), second, atol=1e-6)


def test_a_small_form_is_a_form():
    """A PUMA as Craig has it: folded, its wrist is half a millimetre from axis 2."""
    rows = [(90, 0, 0), (0, 0.4318, 0), (-90, 0.0203, 0.1245), (90, 0, 0.4318), (-90, 0, 0),
            (0, 0, 0)]  # fmt: skip
    arm = dh_arm(rows)
    Q = closed_form(arm)["elbow"].sample(300, np.random.default_rng(2))
    assert set(kinds_many(arm, Q)) == {"boundary"}


def test_points_that_take_longer_are_asked_wherever_they_stand():
    """UR5, position, tip in the plane of axes 1 and 2, wrist straight or folded back.

    Straight, the form is indefinite, which is seen at once. Folded back it is definite but for
    self-motions that stay singular: such points must be asked though many others come first.
    """
    arm = load("ur5", task="position")
    q2, q3 = np.random.default_rng(0).uniform(-3, 3, (2, 300))
    s = (0.425 * np.cos(q2) + 0.39225 * np.cos(q2 + q3)) / 0.09465
    q2, q3, s = (v[np.abs(s) < 0.95][:20] for v in (q2, q3, s))
    q5 = np.where(np.arange(20) < 10, 0.0, PI)
    Q = np.stack([q5 * 0 + 0.4, q2, q3, np.arcsin(s) - q2 - q3, q5, q5 * 0], axis=1)
    assert kinds_many(arm, Q, 6) == ["interior"] * 10 + ["boundary"] * 6 + [None] * 4
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
