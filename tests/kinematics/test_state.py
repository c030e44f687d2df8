"""One configuration: numbers against NumPy and Pinocchio, words against known geometry."""

import functools
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from arms import pinocchio_jacobian
from hypothesis import given, strategies as st

import pinsing
from pinsing.kinematics.at import _short, at
from pinsing.kinematics.lost_motion import JointAxes, Tool, lost_motions
from pinsing.kinematics.refine import refine
from pinsing.robot.arm import Arm
from pinsing.robot.load import load
from pinsing.robot.nominal import nominal

REGULAR_Q = {
    "ur5": [0.1, -1.0, 0.8, 0.3, 0.9, 0.2], "stanford": [0.1, 0.7, 0.3, 0.4, 0.7, 0.5],
    "iiwa14": [0.1, 0.7, 0.3, 0.8, 0.4, 0.5, 0.6], "kinova": [0.1, 2.5, 2.0, 0.3, 1.5, 0.2],
    "scara": [0.3, 0.7, 0.1, 0.2], "so101": [0.3, 0.2, 0.4, -0.5, 0.2],
}  # fmt: skip


@functools.cache
def arm_of(name: str, task: str = "pose", length_scale: float = 1.0, exact: bool = False) -> Arm:
    arm = load(name, task=task, length_scale=length_scale)
    return nominal(arm).arm if exact else arm


@pytest.mark.parametrize("name", REGULAR_Q)
@pytest.mark.parametrize("length_scale", [1.0, 0.25])
def test_numbers_against_numpy_and_pinocchio(name, length_scale):
    arm, q = arm_of(name, length_scale=length_scale), REGULAR_Q[name]
    state = at(arm, q)
    J = pinocchio_jacobian(arm, q)
    np.testing.assert_allclose(state.J, J, atol=1e-14)
    scaled = J / np.array([length_scale] * 3 + [1] * 3)[:, None]
    gram = scaled @ scaled.T if arm.n >= 6 else scaled.T @ scaled
    eigenvalues = np.sort(np.linalg.eigvalsh(gram))[::-1]
    np.testing.assert_allclose(state.sigma**2, eigenvalues, atol=1e-12)
    assert state.status == "regular"
    assert state.rank == state.generic_rank == np.linalg.matrix_rank(scaled) == min(6, arm.n)
    det = np.linalg.det(gram)
    assert state.manipulability == pytest.approx(np.sqrt(det), rel=1e-9)
    square = np.linalg.det(scaled) if arm.n == 6 else det
    assert state.determinant == pytest.approx(square, rel=1e-9)
    assert state.condition_number == pytest.approx(state.sigma[0] / state.sigma[-1])
    own = np.linalg.svd(J, compute_uv=False)  # these arms are as long as the metre
    assert state.sigma_ratio == pytest.approx(own[-1] / own[0])
    if length_scale == 1:
        assert state.sigma_ratio == pytest.approx(1 / state.condition_number)
    assert state.lost == state.dependences == ()


@pytest.mark.parametrize("name", REGULAR_Q)
def test_ellipsoids_are_those_of_the_rows_and_stand_at_the_tip(name):
    arm, q = arm_of(name), REGULAR_Q[name]
    state = at(arm, q)
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, arm.model_q(q))
    tip = data.oMf[arm.model.getFrameId(arm.tip)]
    np.testing.assert_allclose(state.tip_position, tip.translation, atol=1e-14)
    np.testing.assert_allclose(state.tip_rotation, tip.rotation, atol=1e-14)
    ellipsoids = (state.translational, "m/s", state.J[:3]), (state.rotational, "rad/s", state.J[3:])
    for ellipsoid, unit, rows in ellipsoids:
        assert ellipsoid.unit == unit
        np.testing.assert_array_equal(ellipsoid.center, state.tip_position)
        reached = np.linalg.norm(rows.T @ ellipsoid.axes, axis=0)  # the best unit joint speed
        np.testing.assert_allclose(reached, ellipsoid.radii, atol=1e-12)


SINGULAR_Q = [
    ("ur5", [0.1, -1.0, 0.8, 0.3, 0, 0.2], "pose"),
    ("ur5", [0.1, -1.0, 0, 0.3, 0.9, 0.2], "pose"), ("stanford", [0, 0, 0, 0, 0, 0], "pose"),
    ("stanford", [0.1, 0, 0.3, 0.4, 0.7, 0.5], "pose"),
    ("iiwa14", [0.1, 0.7, 0.3, 0, 0.4, 0.5, 0.6], "pose"),
    ("iiwa14", [0, 0, 0, 0, 0, 0, 0], "pose"), ("scara", [0.3, 0, 0.1, 0.2], "pose"),
    ("planar3r", [0.3, 0, 0], "position"), ("planar3r", [0.3, 0, 0], "pose"),
    ("planar3r", [0.3, 0, 0], "vx,vy,wz"),
]  # fmt: skip


@pytest.mark.parametrize("length_scale", [1.0, 0.2])
@pytest.mark.parametrize(("name", "q", "task"), SINGULAR_Q)
def test_lost_motions_are_lost_and_self_motions_move_nothing(name, q, task, length_scale):
    arm = arm_of(name, task, length_scale, exact=True)
    state = at(arm, q)
    assert state.status == "singular"
    assert state.singular
    assert state.rank < state.generic_rank
    assert len(state.lost) == state.generic_rank - state.rank
    wrenches = np.array([motion.wrench for motion in state.lost])
    assert np.linalg.matrix_rank(wrenches) == len(wrenches)
    J = state.J
    left_out = [r for r in range(6) if r not in arm.task.rows]
    # Producible twists in rows over the length scale.
    producible = np.delete(J / np.array([length_scale] * 3 + [1] * 3)[:, None], left_out, axis=0)
    for motion in state.lost:
        np.testing.assert_allclose(J.T @ motion.wrench, 0, atol=1e-12)  # no joint torque
        np.testing.assert_array_equal(motion.wrench[left_out], 0)
        assert motion.speed < 1e-12
        scaled = np.delete(motion.twist / ([length_scale] * 3 + [1] * 3), left_out)
        np.testing.assert_allclose(producible.T @ scaled, 0, atol=1e-12)
        assert np.linalg.norm(scaled) == pytest.approx(1)
        assert np.linalg.norm(motion.direction) == pytest.approx(1)
        assert motion.words.startswith("cannot ")
        if motion.kind == "rotation":
            np.testing.assert_allclose(motion.wrench[:3], 0, atol=1e-9)
            assert motion.pitch == np.inf
        else:
            # Moved to the point of the line, the moment that is left is pitch times force.
            force, moment = motion.wrench[:3], motion.wrench[3:]
            left = moment - np.cross(motion.point - state.tip_position, force)
            np.testing.assert_allclose(left, motion.pitch * force, atol=1e-5)
    assert len(state.self_motions) == arm.n - state.rank
    assert state.always_idle == arm.n - state.generic_rank
    still = np.array([motion.direction for motion in state.self_motions])
    assert np.linalg.matrix_rank(still) == len(still)
    np.testing.assert_allclose(J[list(arm.task.rows)] @ still.T, 0, atol=1e-9)
    np.testing.assert_allclose(np.abs(still).max(axis=1), 1)


def test_self_motion_names_the_joints_that_cancel():
    state = at(arm_of("puma560", exact=True), [0.1, 0.2, 0.3, 0.4, 0, 0.5])
    assert [str(m) for m in state.self_motions] == ["q4 at +1 rad/s and q6 at -1 rad/s"]


def test_what_is_left_of_a_translation_is_one_number():
    for task, q in (("pose", [0.2, 0.0087, 0.1, 0.2]), ("position", [0.2, 0.003, 0.1, 0.2])):
        state = at(arm_of("scara", task), q)
        (lost,) = state.lost
        assert (state.status, lost.kind) == ("near-singular", "translation")
        slow = int(np.argmin(state.translational.radii))
        assert lost.speed == pytest.approx(state.translational.radii[slow], rel=1e-9)
        assert f"({_short(lost.speed)} m/s at unit joint speed)" in lost.words
        along = state.translational.axes[:, slow]
        assert abs(along @ lost.direction) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "task", "q", "words"),
    [
        ("planar3r", "pose", [0, 0, 0], "cannot translate along tool x (base x)"),
        ("planar3r", "position", [0.3, 0, 0], "cannot translate along tool x"),
        ("ur5", "pose", [0, -np.pi / 2, np.pi / 2, 0, 0, 0.4], "cannot rotate about base x"),
        ("stanford", "pose", [0, 0, 0.3, 0.4, 0.7, 0.5],
         "cannot move along the line through the wrist centre (0.000, 0.060, 0.380) m in direction "
         "base y"),
        ("iiwa14", "pose", [0.1, 0.7, 0.3, 0, 0.4, 0.5, 0.6],
         "cannot move along the line through the shoulder centre and the wrist centre"),
    ],
)  # fmt: skip
def test_words_of_what_is_lost(name, task, q, words):
    state = at(arm_of(name, task, exact=True), q)
    assert [motion.words for motion in state.lost] == [words]
    assert str(state.lost[0]) == words


def test_near_singular_says_how_little_is_left():
    arm = arm_of("puma560", exact=True)
    state = at(arm, [0.1, 0.2, 0.3, 0.4, 1e-3, 0.5])
    assert state.status == "near-singular"
    assert not state.singular
    assert state.rank == state.generic_rank == 6
    assert 1e-9 < state.sigma_ratio < 1e-2
    (motion,) = state.lost
    assert motion.words.startswith("nearly loses ")
    assert "at unit joint speed" in motion.words
    speeds = np.random.default_rng(1).normal(size=(6, 2000))
    speeds /= np.linalg.norm(speeds, axis=0)
    power = np.abs(motion.wrench @ state.J @ speeds)
    assert power.max() <= motion.speed + 1e-15
    assert [d.reason for d in state.dependences] == ["axes 4 and 6 are collinear"]
    assert at(arm, state.q, near_rtol=1e-5).status == "regular"
    loose = at(arm, state.q, rtol=1e-2)
    assert loose.status == "singular"
    assert loose.dependences == state.dependences
    assert "near where         axes 4 and 6 are collinear" in str(loose)


def test_beside_a_singularity_a_design_has_the_task_of_its_robot():
    arm, q = arm_of("ur5e"), [0.1, -1.03, 0.002, -0.8, 1.34, 0.3]
    alone, copy = (a.with_task("position") for a in (arm, replace(arm, design=arm)))
    (found,) = at(copy, q).dependences
    assert (found,) == at(alone, q).dependences
    assert found.reason == "joints 1, 2, 3, 4 and 5 move the tip within one plane only"


@pytest.mark.parametrize("slide", [1e3, 1e9])
def test_beside_a_slide_of_kilometres_one_joint_alone_counts_for_nothing(slide):
    state = at(arm_of("stanford"), [0, 1.5, slide, 0, 0.5, 0])
    assert "collinear" not in str(state)
    assert all("can move together with the tip" in d.reason for d in state.dependences)


def test_five_joints_always_miss_one_direction():
    arm = arm_of("so101")
    found = refine(arm, [0.0, 0.3, 0.1, -0.2, 0.1])
    state = at(arm, found.q)
    assert state.status == "singular"
    assert state.always_missing == 1
    assert len(state.lost) == 2
    for motion in state.lost:
        np.testing.assert_allclose(state.J.T @ motion.wrench, 0, atol=1e-9)
    assert "1 of these 2 is missing at every configuration" in " ".join(str(state).split())
    # A planar arm misses the same three everywhere: they are no loss.
    assert at(arm_of("planar3r"), [0.1, 0, 0]).always_missing == 0


def test_limits_are_the_same_for_all():
    """A bounded value counts as it is: at, trajectories, lines and arms say so alike."""
    arm = arm_of("ur5")
    q = np.array([9.0, -1.2, 1.3, -1, 0.5, 0])  # limits of 2 pi; a whole turn aside it is inside
    state, folded = at(arm, q), at(arm, arm.fold(q))
    assert (state.within_limits, state.outside) == (False, (arm.joints[0],))
    assert str(state).count("outside its limits") == 1
    assert (folded.within_limits, folded.outside) == (True, ())
    form = pinsing.closed_form(arm)
    check = pinsing.check_trajectory(arm, [q, q + 0.01], forms=form)
    assert {e.joint for e in check.outside} == {arm.joints[0]}
    line = pinsing.check_line(arm, q, at(arm, q).tip_position + 0.01, forms=form)
    assert any(arm.joints[0] in note for note in line.notes)


unit = st.floats(-1, 1, allow_nan=False)


@given(st.lists(unit, min_size=24, max_size=24), st.integers(1, 3))
def test_words_span_the_space_they_describe(numbers, d):
    """Whatever the space of wrenches: its basis by kinds spans the same space."""
    A = np.round(np.reshape(numbers[: 6 * d], (6, d)), 1)
    if np.linalg.matrix_rank(A, tol=1e-3) < d:
        return
    U = np.linalg.qr(A)[0]
    tool = Tool(np.array([0.1, 0.2, 0.3]), np.eye(3), 1.0, {})
    found = lost_motions(U, np.zeros((6, 2)), 1.0, 1.0, tool)
    assert len(found) == d
    W = np.array([m.wrench for m in found]).T
    inside = U @ (U.T @ W)
    # Directions within 0.1 degree of an axis are put on it.
    np.testing.assert_allclose(inside, W, atol=5e-3 * np.abs(W).max())


@pytest.mark.parametrize("spread", [1.0, 1e-1, 1e-3])
def test_lines_through_one_point_meet_there(spread: float):
    """Also nearly parallel ones; others that miss each other, or are parallel, meet nowhere."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        k = int(rng.integers(2, 6))
        z = rng.normal(size=3) + spread * rng.normal(size=(k, 3))
        z /= np.linalg.norm(z, axis=1)[:, None]
        meet, tip = rng.normal(size=(2, 3))
        points = meet + rng.normal(size=(k, 1)) * z
        axes = JointAxes(z, points, np.zeros(k, dtype=bool), tip, 1.0)
        found = axes.meeting_point(range(k), 1e-6)
        np.testing.assert_allclose(found, meet, atol=1e-6)
        normal = np.cross(z[0], z[1])
        points[0] += normal / np.linalg.norm(normal)
        assert axes.meeting_point(range(k), 1e-6) is None
    parallel = JointAxes(np.tile(z[0], (k, 1)), points, np.zeros(k, dtype=bool), tip, 1.0)
    assert parallel.meeting_point(range(k), 1e-6) is None
