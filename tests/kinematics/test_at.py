"""One configuration: numbers against NumPy and Pinocchio, words against known geometry.

And which axes are dependent, tip speeds that joint speed limits allow (against the inverse and a
linear program), and balls in which an arm is regular.
"""

import functools
import itertools
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from arms import coupled, pinocchio_jacobian, place, serial
from golden import Golden
from hypothesis import given, strategies as st
from scipy.optimize import linprog
from tiers import sampled, tiered

import pinsing
from pinsing.families import closed_form
from pinsing.kinematics import frame_jacobian, regular_radius, tip_speeds
from pinsing.kinematics.at import _short, at
from pinsing.kinematics.lost_motion import ColumnRanks, JointAxes, Tool, lost_motions
from pinsing.kinematics.refine import refine
from pinsing.kinematics.tip_speed import SpeedJudge
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


exact = functools.partial(arm_of, exact=True)


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
    assert state.lost == state.dependences == ()
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, arm.model_q(q))
    tip = data.oMf[arm.tip_id]
    np.testing.assert_allclose(state.tip_position, tip.translation, atol=1e-14)
    np.testing.assert_allclose(state.tip_rotation, tip.rotation, atol=1e-14)
    ellipsoids = (state.translational, "m/s", J[:3]), (state.rotational, "rad/s", J[3:])
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
    arm = exact(name, task, length_scale)
    state = at(arm, q)
    assert state.status == "singular"
    assert len(state.lost) == state.generic_rank - state.rank > 0
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


REASONS = Golden(Path(__file__).with_name("reasons.txt"))


@pytest.mark.parametrize("head", REASONS.cases)
def test_words_of_what_is_lost_and_why(head):
    """Also off the special angles, and of collinear axes that others make up for."""
    robot, task, _ = head.split()
    state = at(exact(robot, task), np.array(REASONS.text(head).split(), dtype=float))
    why = [f"why: {d} ({', '.join(d.joints)})" for d in state.dependences]
    still = [f"still: {motion}" for motion in state.self_motions if len(state.self_motions) == 1]
    REASONS.hold(head, "\n".join([state.status, *map(str, state.lost), *why, *still]))


def test_near_singular_says_how_little_is_left():
    arm = exact("puma560")
    state = at(arm, [0.1, 0.2, 0.3, 0.4, 1e-3, 0.5])
    assert (state.status, state.rank, state.generic_rank) == ("near-singular", 6, 6)
    assert 1e-9 < state.sigma_ratio < 1e-2
    (motion,) = state.lost
    assert motion.words.startswith("nearly loses ")
    assert "at unit joint speed" in motion.words
    # The power of the wrench at the best of all unit joint speeds.
    assert np.linalg.norm(motion.wrench @ state.J) == pytest.approx(motion.speed)
    assert [d.reason for d in state.dependences] == ["axes 4 and 6 are collinear"]
    assert at(arm, state.q, near_rtol=1e-5).status == "regular"
    loose = at(arm, state.q, rtol=1e-2)
    assert (loose.status, loose.dependences) == ("singular", state.dependences)
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
    state = at(arm, refine(arm, [0.0, 0.3, 0.1, -0.2, 0.1]).q)
    assert (state.status, state.always_missing, len(state.lost)) == ("singular", 1, 2)
    assert "1 of these 2 is missing at every configuration" in " ".join(str(state).split())
    # A planar arm misses the same three everywhere: they are no loss.
    assert at(arm_of("planar3r"), [0.1, 0, 0]).always_missing == 0


def test_limits_are_the_same_for_all():
    """A bounded value counts as it is: at, trajectories, lines and arms say so alike."""
    arm = arm_of("ur5")
    q = np.array([9.0, -1.2, 1.3, -1, 0.5, 0])  # limits of 2 pi; a whole turn aside it is inside
    state, folded = at(arm, q), at(arm, arm.fold(q))
    assert (state.within_limits, state.outside) == (False, (arm.joints[0],))
    assert (folded.within_limits, folded.outside) == (True, ())
    check = pinsing.check_trajectory(arm, [q, q + 0.01])
    assert {e.joint for e in check.outside} == {arm.joints[0]}
    line = pinsing.check_line(arm, q, at(arm, q).tip_position + 0.01)
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


def chain(*joints: tuple[object, tuple[float, float, float]], tip: tuple[float, float, float]):
    """A model of given joints, each placed after the one before without turning."""
    return serial([(joint, place(at)) for joint, at in joints], place(tip), -3, 3)


RX, RY, RZ = pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ
PX, PY = pin.JointModelPX, pin.JointModelPY


HERE, AWAY = (0, 0, 0), (1, 0, 0)


@pytest.mark.parametrize(
    ("joints", "q", "reason"),
    [
        # A slider across two parallel axes, perpendicular to their plane at q2 = pi/2.
        ([(PX(), HERE), (RZ(), HERE), (RZ(), AWAY)], [0.1, np.pi / 2, 0.3],
         "prismatic joint 1 is perpendicular to the plane of axes 2 and 3"),
        # A slider that the second joint turns into the plane of the others.
        ([(PX(), HERE), (PY(), HERE), (RZ(), HERE), (PX(), AWAY)], [0.1, 0.2, 0.3, 0.4], None),
        ([(PX(), HERE), (RZ(), HERE), (PX(), (0.4, 0, 0))], [0.1, 0, 0.3],
         "prismatic joints 1 and 3 are parallel"),
        # Three axes through one point, in one plane at q2 = 0.
        ([(RZ(), HERE), (RX(), HERE), (RY(), HERE)], [0.1, np.pi / 2, 0.2],
         "axes 1 and 3 are collinear"),
    ],
)  # fmt: skip
def test_reasons_with_sliders_and_short_chains(joints, q, reason):
    found = at(load(chain(*joints, tip=(0.3, 0.2, 0.1))), q).dependences
    assert [d.reason for d in found[:1]] == [reason] * (reason is not None)


def test_near_a_singularity_the_words_are_of_the_singular_configuration_beside():
    """A hundredth off the wrist singularity loose ranks would blame joints 2, 4 and 6 together."""
    for robot in ("puma560", "irb1400", "rv7frl", "meca500"):
        arm = load(robot)
        wrist = closed_form(arm, prove=False)["wrist"]
        for q in wrist.points(5, np.random.default_rng(3)):
            state = at(arm, q + 0.01 * np.eye(6)[4])
            assert state.status == "near-singular"
            assert [d.reason for d in state.dependences] == ["axes 4 and 6 are collinear"]
            assert "near where" in state.text()


def test_mimic_joints_have_no_axis_of_their_own():
    model = chain((RZ(), HERE), (RZ(), AWAY), (RZ(), AWAY), tip=AWAY)
    follows = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    arm = coupled(load(model, tip="tip", task="position"), follows, np.zeros(3))
    (found,) = at(arm, [0.3, 0.0]).dependences
    assert found.reason == "joints 1 and 2 can move together with the tip at rest"
    # A follower that turns twice as far is at its limit at half of the leader's speed.
    arm.model.velocityLimit[:] = 3, 4, 1
    slower = SpeedJudge(coupled(arm, follows * [[1], [1], [-2]], np.zeros(3)))
    assert (slower.limits.tolist(), slower.reason) == ([3, 0.5], "")


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(
    ("name", "q"),
    [
        ("puma560", [0.1, 0.2, 0.3, 0.4, 0, 0.5]),
        ("stanford", [0.1, 0, 0.3, 0.4, 0, 0.5]),
        ("iiwa14", [0.1, 0, 0.3, 1.4, np.pi / 2, 0, 0.5]),
        ("ur5", [0, 0, 0, 0, 0, 0]),
    ],
)
def test_ranks_of_all_sets_are_those_of_each(name, q, compiled, monkeypatch):
    """All sets at once, with or without the kernel, and each set by LAPACK."""
    if not compiled:
        monkeypatch.setattr("pinsing._batch.engine._missing", "not installed")
    arm = exact(name)
    found = ColumnRanks(arm, frame_jacobian(arm, q), np.array(q), 1e-8)
    for size in range(1, len(q) + 1):
        for ids in itertools.combinations(range(len(q)), size):
            sigma = np.linalg.svd(found.J[:, ids], compute_uv=False)
            assert found.rank(ids) == (sigma > found.zero).sum(), ids
            general = np.linalg.svd(found.generic.J[:, :, ids], compute_uv=False)
            assert found.generic_rank(ids) == (general > 1e-9 * general.max()).sum(axis=1).max()
    assert found.lost > 0


def _longest(J, c, x):
    """The longest multiple of the twist x (6,) that joint speeds up to c (n,) give."""
    n = J.shape[1]
    found = linprog(
        np.r_[np.zeros(n), -1], A_eq=np.c_[J, -x], b_eq=np.zeros(len(x)),
        bounds=[*((-a, a) for a in c), (0, None)],
    )  # fmt: skip
    return found.x[-1]


def test_of_a_square_jacobian_each_joint_has_a_row_of_the_inverse():
    arm, q, c = pinsing.load("ur5"), np.array([0.3, -1.2, 1.3, -1, 0.7, 0.2]), np.linspace(1, 2, 6)
    found = tip_speeds(arm, q, 0.25, 0.5, joint_speeds=c)
    v, w = np.linalg.norm(np.linalg.inv(frame_jacobian(arm, q)).reshape(6, 2, 3), axis=2).T
    assert found.linear == pytest.approx((c / v).min())
    assert found.angular == pytest.approx((c / w).min())
    assert found.linear_joints == (arm.joints[int((c / v).argmin())],)
    shares = (0.25 * v + 0.5 * w) / c
    assert found.share == pytest.approx(shares.max())
    np.testing.assert_allclose(SpeedJudge(arm, c).shares(q[None], 0.25, 0.5)[0], shares)


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
    all_of_them = pinsing.load("planar3r", task="vx")
    assert tip_speeds(all_of_them, np.zeros(3), joint_speeds=np.ones(3)).linear == 0
    near = str(pinsing.at(arm, [0, -1.5, 1.5, 0, 1e-3, 0]))
    assert re.search(r"at most \d+,\d+ % of the limit", " ".join(near.split()))


ARMS = (
    "ur5", "puma560", "stanford", "scara", "planar3r", "panda", "iiwa14", "xarm7", "ur5:position",
    "puma560:orientation",
)  # fmt: skip


@pytest.mark.parametrize("name", sampled(tiered(ARMS, (*ARMS[1:6], ARMS[-1]))))
def test_nothing_singular_is_nearer(name):
    robot, _, task = name.partition(":")
    arm = pinsing.load(robot, task=task or "pose")
    form = pinsing.closed_form(arm, prove=False)
    rng = np.random.default_rng(1)
    scale = np.where(arm.prismatic, arm.length_scale, 1.0)
    parts = [rng.uniform(*arm.span, (60, arm.n))]
    for family in form.families:
        points = family.points(25, rng)
        size = np.where(np.arange(len(points)) % 5, 0.02, 1e-6)[:, None]
        parts.append(points + size * scale * rng.normal(size=points.shape))
    for k, Q in enumerate(parts):
        far = pinsing.clearance(form, Q, certify=True).upper
        radius = regular_radius(form.geometry.arm, Q)  # files are rounded, families are not
        assert (radius <= far + 1e-12).all()
        assert np.median((radius / far)[far > 1e-4]) > (0.35 if k else 0.1)


def test_other_tasks_and_what_is_singular_have_none():
    arm = pinsing.load("ur5")
    assert regular_radius(arm, [0, -1, 0, 0, 1, 0]) == 0
    assert regular_radius(arm.with_task("tool-axis"), [[0, -1, 1, 0, 1, 0]]).tolist() == [0]
    planar = pinsing.load("planar3r").with_task("position")  # no motion along z
    assert regular_radius(planar, [0, 1, 1]) == 0


def test_weights_and_norms_of_an_incomplete_form():
    form = pinsing.closed_form(pinsing.load("ur5"), seconds=1e-9, prove=False)
    assert (form.complete, form.families) == (False, ())
    q, radius = [0, -1.2, 1.3, -1, -1.5, 0], {}
    for norm in ("euclidean", "max"):
        radius[norm] = float(pinsing.clearance(form, q, norm=norm).lower)
    assert radius["euclidean"] == pytest.approx(float(regular_radius(form.loaded, q)))
    assert radius["max"] == pytest.approx(radius["euclidean"] / np.sqrt(6))
    double = pinsing.clearance(form, q, weights=[2] * 6).lower
    assert double == pytest.approx(2 * radius["euclidean"])
    assert pinsing.is_clear(form, q, 0.1)
    assert not pinsing.is_clear(form, q, 0.3)
