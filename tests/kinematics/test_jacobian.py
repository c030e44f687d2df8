"""Jacobians against Pinocchio, by either engine and in the tip's axes; one verdict of them all."""

import json
import shutil
from pathlib import Path

import arms
import numpy as np
import pinocchio as pin
import pytest
from arms import CATALOGUE, differences, draw, pinocchio_jacobian, serial
from command_line import run
from dh_arms import dh_arm
from kernel import needs_kernel
from tiers import sampled, tiered
from urdf_text import J, Y, Z, urdf

import pinsing
from pinsing._batch import engine as kernel
from pinsing._batch.built_from import SUFFIXES, fingerprint, why_stale
from pinsing.errors import EngineError, OptionError
from pinsing.kinematics import jacobian as kinematics
from pinsing.kinematics.refine import describe
from pinsing.measures import status_of
from pinsing.robot.arm import Arm
from pinsing.robot.task import parse_task
from pinsing.sampling import sigma_map, sweep

AXES = {"tool-axis": 2, "tool-axis-x": 0, "tool-axis-y": 1}

ELBOW = urdf([
    J("one", "base", "a", (0.1, 0, 0.2), Z, "revolute", (-3, 3), (0.3, 0, 0)),
    J("two", "a", "b", (0.5, 0, 0), Y, "prismatic", (-1, 1)),
    J("three", "b", "c", (0.3, 0, 0.1), Y, "revolute", (-3, 3)),
    J("end", "c", "tool", (0.2, 0.05, 0), kind="fixed", rpy=(0.4, -1.1, 0.7)),
])  # fmt: skip


AT_BASE = pin.LOCAL_WORLD_ALIGNED


def by_pinocchio(arm, q, frame=pin.LOCAL):
    """Pinocchio's Jacobian, in the tip's own axes but where said otherwise."""
    data = arm.model.createData()
    return pin.computeFrameJacobian(arm.model, data, arm.model_q(q), arm.tip_id, frame)


@pytest.fixture(scope="module", params=CATALOGUE, ids=[name for name, _ in CATALOGUE])
def arm(request) -> Arm:
    name, tip = request.param
    return pinsing.load(name, tip=tip)


def test_equals_pinocchio_and_its_derivative_finite_differences(arm, rng):
    Q = draw(arm, rng, 20)
    J = kinematics.frame_jacobians(arm, Q)
    assert J.shape == (20, 6, arm.n)
    assert kinematics.frame_jacobians(arm, Q[:0]).shape == (0, 6, arm.n)
    np.testing.assert_allclose(J, [pinocchio_jacobian(arm, q) for q in Q], atol=1e-12)
    one = kinematics.frame_jacobian(arm, Q[3])
    np.testing.assert_allclose(one, J[3], atol=1e-13)
    loop = kinematics.frame_jacobians(arm, Q, engine="pinocchio")
    np.testing.assert_array_equal(one, loop[3])
    numeric = differences(lambda x: kinematics.frame_jacobian(arm, x), Q[3], 1e-5)
    np.testing.assert_allclose(kinematics.jacobian_derivative(one), numeric, atol=2e-9)


@pytest.mark.parametrize(
    ("task", "rows", "frame"),
    [
        ("pose", [0, 1, 2, 3, 4, 5], AT_BASE), ("position", [0, 1, 2], AT_BASE),
        ("orientation", [3, 4, 5], AT_BASE), ("vx,vy,wz", [0, 1, 5], AT_BASE),
        (["wz", "vx"], [0, 5], AT_BASE), ("vy@tip,wx@tip,wz@tip", [1, 3, 5], pin.LOCAL),
    ],
)  # fmt: skip
@pytest.mark.parametrize("robot", ["ur5", "stanford", ELBOW], ids=["ur5", "stanford", "odd"])
def test_task_rows_and_length_scale(rng, robot, task, rows, frame):
    arm = pinsing.load(robot, task=task, length_scale=0.25)
    Q = draw(arm, rng, 4)
    J = np.array([by_pinocchio(arm, q, frame) for q in Q])
    J[:, :3] /= 0.25
    J = J[:, rows]
    sigma = np.linalg.svd(J, compute_uv=False)[:, : np.linalg.matrix_rank(J[0])]
    np.testing.assert_allclose(kinematics.task_jacobians(arm, Q), J, atol=1e-12)
    np.testing.assert_allclose(kinematics.task_jacobian(arm, Q[1]), J[1], atol=1e-12)
    np.testing.assert_allclose(kinematics.singular_values(arm, Q), sigma, atol=1e-12)
    np.testing.assert_allclose(pinsing.at(arm, Q[2]).sigma[: sigma.shape[1]], sigma[2], atol=1e-12)


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
    arm = pinsing.load(robot, task=task)
    assert kinematics.generic_rank(arm) == r
    assert kinematics.singular_values(arm, np.full((2, arm.n), 0.3)).shape == (2, r)


def test_generic_rank_is_of_the_nominal_geometry():
    """Axes parallel but for a rounded angle: the third direction is a rounding error."""
    tilt = pin.SE3(pin.utils.rotate("x", 2e-6), np.array([0.5, 0.0, 0.0]))
    straight = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
    places = pin.SE3.Identity(), tilt, straight, tilt
    arm = pinsing.load(serial([(pin.JointModelRZ(), p) for p in places], straight), tip="tip")
    assert kinematics.generic_rank(arm) == 3
    assert np.linalg.matrix_rank(kinematics.frame_jacobian(arm, [0.3, 0.5, 0.7, 0.2])) == 4


@pytest.mark.slow
def test_a_task_that_nothing_but_rounding_serves():
    rows = [(-90, 0, 0, -90, "prismatic"), (0, 0, 0, 180), (-90, 0.25, 0, 0), (180, 0, 0.4, -90)]
    arm = dh_arm(rows, task="vx")
    q = np.random.default_rng(1).uniform(-1, 1, 4)
    assert 0 < np.abs(kinematics.frame_jacobian(arm, q)[0]).max() < 1e-15
    with pytest.raises(OptionError, match="no joint of made moves tip"):
        kinematics.generic_rank(arm)


@needs_kernel
def test_a_kernel_that_differs_is_refused(monkeypatch):
    arm = pinsing.load("ur5")
    honest = kernel.jacobians
    monkeypatch.setattr(kernel, "jacobians", lambda *a, **k: honest(*a, **k) + 1e-11)
    assert kinematics.fixed_engine(arm) == kinematics.PINOCCHIO
    assert "differs from Pinocchio" in kinematics.engine_name(arm)
    with pytest.raises(EngineError, match="differs from Pinocchio"):
        kinematics.frame_jacobians(arm, np.zeros((1, 6)), engine="batch")
    J = kinematics.frame_jacobians(arm, np.zeros((1, 6)))[0]
    np.testing.assert_array_equal(J, kinematics.frame_jacobian(arm, np.zeros(6)))


@needs_kernel
def test_a_kernel_of_other_sources_is_not_used(tmp_path):
    """In a copy of the folder where one line of C++ has changed since the build."""
    here = Path(kernel.__file__).parent
    built = fingerprint(here)
    if built is None:
        pytest.skip("an installation without sources")
    assert built == kernel._kernel.SOURCES  # CMake computes the same
    for other in (None, "0" * 64):  # of before fingerprints, and another
        assert "build it again with pip install" in why_stale(other, here)
    for file in here.iterdir():
        if file.suffix in SUFFIXES:
            shutil.copy(file, tmp_path)
    assert why_stale(built, tmp_path) is None
    with (tmp_path / "module.hpp").open("a") as file:
        file.write("// changed\n")
    assert "\n" not in why_stale(built, tmp_path)
    for file in tmp_path.iterdir():
        file.unlink()
    assert why_stale(built, tmp_path) is None  # a wheel without sources
    assert why_stale(None, tmp_path) is None


@pytest.mark.parametrize("rounded", [-1e-12, 0.0, 1e-12])
def test_half_a_turn_is_negative_however_it_is_rounded(rounded):
    near = pinsing.load("ur5").space.wrap(np.full(6, np.pi + rounded))
    np.testing.assert_allclose(near, -np.pi, atol=1e-9)


def test_a_kernel_of_other_sources_is_left_aside_and_pinocchio_runs(monkeypatch, rng):
    monkeypatch.setattr(kernel, "_missing", "it is older than the sources")
    arm = pinsing.load("scara")
    Q = rng.uniform(-3, 3, (3, 4))
    assert kinematics.engine_name(arm) == "Pinocchio and NumPy (it is older than the sources)"
    expected = [by_pinocchio(arm, q, AT_BASE) for q in Q]
    np.testing.assert_array_equal(kinematics.frame_jacobians(arm, Q), expected)
    assert kinematics.singular_values(arm, Q).shape == (3, 4)
    with pytest.raises(EngineError, match="older than the sources"):
        kinematics.singular_values(arm, Q, engine="batch")
    with pytest.raises(EngineError, match="zones need the compiled kernel: it is older"):
        pinsing.zones(pinsing.closed_form(arm), joint_speeds=[5, 5, 1, 10])


def test_bad_options():
    arm = pinsing.load("ur5")
    with pytest.raises(OptionError, match="unknown engine 'gpu'"):
        kinematics.frame_jacobians(arm, np.zeros((1, 6)), engine="gpu")
    with pytest.raises(OptionError, match="threads must be at least 1"):
        kinematics.singular_values(arm, np.zeros((1, 6)), threads=0)


@pytest.mark.parametrize(
    ("given", "name", "rows", "at_tip"),
    [
        ("tool-axis", "tool-axis", (0, 1, 2, 3, 4), (True,) * 5),
        ("tool-axis-z", "tool-axis", (0, 1, 2, 3, 4), (True,) * 5),
        ("tool-axis-x", "tool-axis-x", (0, 1, 2, 4, 5), (True,) * 5),
        ("vx,vy,vz,wx@tip,wy@tip", "tool-axis", (0, 1, 2, 3, 4), (True,) * 5),
        ("wy@tip, vx@tip", "vx@tip,wy@tip", (0, 4), (True, True)),
        ("vx@tip,vy@tip,vz@tip", "position", (0, 1, 2), ()),
        ("vz,wx@tip,wy@tip", "vz,wx@tip,wy@tip", (2, 3, 4), (False, True, True)),
        ("vx@tip,vy@tip,vz@tip,wz", "vx,vy,vz,wz", (0, 1, 2, 5), ()),
        ("vx,vy,vz,wz@tip", "vx,vy,vz,wz@tip", (0, 1, 2, 5), (True,) * 4),
    ],
)
def test_a_task_has_one_name(given, name, rows, at_tip):
    task = parse_task(given)
    assert (task.name, task.rows, task.at_tip) == (name, rows, at_tip)
    assert parse_task(task.name) == task == parse_task(task.row_names)


@pytest.mark.parametrize(
    ("robot", "task"),
    [("puma560", "tool-axis-x"), ("puma560", "vx@tip,wy@tip"), ("puma560", "vz,wx@tip,wy@tip"),
     ("stanford", "vx,vz,wy")],
)  # fmt: skip
def test_derivatives_and_engines_agree(robot, task, rng):
    arm = scaled(pinsing.load(robot, task=task), 100.0).with_task(length_scale=0.5)
    Q, on = arm.space.sample(3, rng), kinematics.batch(arm)
    J, H = kinematics.own_jacobians_and_derivatives(on, Q)
    rows = np.where(np.array(arm.task.rows) < 3, 0.5 / 100, 1.0)[:, None]
    free = kinematics.task_jacobians(arm, Q) * rows * np.where(arm.prismatic, 100, 1)
    np.testing.assert_allclose(J, free, atol=1e-13)
    numeric = differences(lambda x: kinematics.own_jacobians_and_derivatives(on, x)[0], Q)
    np.testing.assert_allclose(H, numeric * np.where(arm.prismatic, 100, 1), atol=1e-8)
    compiled = ("auto", "baseline") if kernel.available() else ("auto",)
    by = [kinematics.singular_values(arm, Q, engine=e) for e in (*compiled, "pinocchio")]
    np.testing.assert_allclose(by, [by[0]] * len(by), atol=1e-12)
    compiled, loop = (kinematics.tip_rotations(arm, Q, e) for e in ("auto", "pinocchio"))
    np.testing.assert_allclose(compiled, loop, atol=1e-12)


def with_the_turn(arm, q, axis):
    """Rank of all six rows with the turn about the tool's axis as one joint more, less one."""
    J = kinematics.frame_jacobian(arm, q)
    turn = np.append(np.zeros(3), kinematics.tip_placement(arm, q).rotation[:, axis])
    sigma = np.linalg.svd(np.column_stack([J, turn]), compute_uv=False)
    return int((sigma > 1e-8 * sigma[0]).sum()) - 1


@pytest.mark.parametrize("task", AXES)
@pytest.mark.parametrize("name", tiered(["ur5", "puma560", "kinova", "irb1400"], ("puma560",)))
def test_the_families_are_where_the_turn_makes_up_for_nothing(name, task, rng):
    """An oracle without rows in the tip's axes: the whole twists and one more."""
    arm = pinsing.load(name, task=task)
    found = pinsing.closed_form(arm)
    exact = pinsing.robot.nominal(arm).arm
    assert found.complete
    for family in found.families:
        for q in family.sample(3, rng):
            assert with_the_turn(exact, q, AXES[task]) < 5
    for q in exact.space.sample(20, rng):
        assert with_the_turn(exact, q, AXES[task]) == 5


def test_a_tip_at_odd_angles_has_families_of_its_own(rng):
    found = pinsing.closed_form(pinsing.load(ELBOW, task="vx@tip,vy@tip,wz@tip"))
    assert found.complete
    assert found.families
    for family in found.families:
        for q in family.sample(3, rng):
            J = by_pinocchio(found.geometry.arm, q)[[0, 1, 5]]
            assert np.linalg.svd(J, compute_uv=False)[-1] < 1e-9
    assert found.jacobian_change < 1e-5


def test_rows_of_both_axes_have_no_certificate_and_say_so():
    arm = pinsing.load("scara", task="vz,wx@tip,wz")
    found = pinsing.closed_form(arm, prove=True)
    assert found.word != "proven"
    assert not found.proof.accepted
    assert "all in the tip's" in found.proof.reason


def test_inverse_solutions_point_the_tool_and_leave_its_turn(rng):
    arm = pinsing.load("so101", task="tool-axis")
    q = arm.space.sample(1, rng)[0]
    goal = kinematics.tip_placement(arm, q)
    found = pinsing.inverse(arm, goal.homogeneous)
    turned = 0.0
    for solution in found:
        there = kinematics.tip_placement(arm, solution.q)
        np.testing.assert_allclose(there.translation, goal.translation, atol=1e-9)
        np.testing.assert_allclose(there.rotation[:, 2], goal.rotation[:, 2], atol=1e-9)
        turned = max(turned, float(np.abs(there.rotation - goal.rotation).max()))
    assert len(found) > 1
    assert turned > 0.1
    assert min(np.abs(arm.space.wrap(s.q - q)).max() for s in found) < 1e-8
    with pytest.raises(OptionError, match="how the tip moves"):
        pinsing.inverse(arm.with_task("vx@tip,vy@tip"), goal.homogeneous)


def test_a_line_turns_the_tool_the_shortest_way():
    ur5 = pinsing.load("ur5", task="tool-axis")
    q = np.array([0.3, -1.2, 1.4, -0.9, 1.1, 0.2])
    start = kinematics.tip_placement(ur5, q)
    goal = start.homogeneous.copy()
    goal[:3, 3] += [0.05, 0.02, -0.03]
    tilt, turn = pin.exp3(np.array([0.1, 0.2, 0.0])), pin.exp3(np.array([0.0, 0.0, 2.0]))
    goal[:3, :3] = tilt @ start.rotation @ turn
    line = pinsing.check_line(ur5, q, goal)
    end = kinematics.tip_placement(ur5, line.q[-1])
    np.testing.assert_allclose(end.translation, goal[:3, 3], atol=1e-9)
    np.testing.assert_allclose(end.rotation[:, 2], goal[:3, 2], atol=1e-9)
    assert np.abs(end.rotation - goal[:3, :3]).max() > 0.5  # its turn was not asked for
    with pytest.raises(OptionError, match="how the tip moves"):
        pinsing.check_line(ur5.with_task("vx@tip"), q, goal)


def test_the_command_line_takes_it_as_the_command_for_welders_does() -> None:
    page = (Path(__file__).parents[2] / "docs/how-to/all-singularities.md").read_text("utf-8")
    shown = page.split("welding torch")[1].split("$ pinsing ")[1].split("\n")[0]
    how = "--tool-axis z", "--task tool-axis", "--task tool-axis --tool-axis z"
    every = [shown, *(f"families puma560 {words}" for words in how)]
    said = [json.loads(run(*words.split(), "-o", "-").stdout) for words in every]
    assert {form["arm"]["task"] for form in said} == {"tool-axis"}
    assert said[1]["families"] == said[2]["families"] == said[3]["families"]


TASKS = ("pose", "position", "orientation", "vx", "vx,wz", "vz,wx")
SCALES = (1e-10, 1.0, 3e8)


def scaled(arm: Arm, factor: float) -> Arm:
    """The same arm in another unit of length: joint 1 of 0.3 m is then 0.3 * factor long."""
    model = pin.Model(arm.model)
    for i in range(1, model.njoints):
        model.jointPlacements[i].translation *= factor
    for frame in model.frames:
        frame.placement.translation *= factor
    for i, slides in enumerate(arm.prismatic):
        if slides:
            model.lowerPositionLimit[i] *= factor
            model.upperPositionLimit[i] *= factor
    return pinsing.load(model, tip=arm.tip, task=arm.task.name)


def questions(arm: Arm) -> np.ndarray:
    """Configurations to ask about: of special and other values, and some at random."""
    rng = np.random.default_rng(5)
    Q = rng.choice([0.0, 0.4, np.pi / 2], (20, arm.n))
    low, high = arm.span
    Q[:, arm.prismatic] = (low + rng.choice([0.5, 0.7], (20, 1)) * (high - low))[:, arm.prismatic]
    return np.concatenate([Q, rng.uniform(low, high, (5, arm.n))])


CASES = [
    ("planar3r", "position", 1), ("planar3r", "vx", 1), ("planar3r", "vx,wz", 1),
    ("planar3r", "orientation", 1), ("stanford", "pose", 1), ("stanford", "position", 1),
    ("stanford", "vz,wx", 1), ("scara", "pose", 1), ("surgical7", "pose", 1),
    ("puma560", "orientation", 1), ("ur5", "pose", 1), ("ur5", "pose", 1e-8),
    ("stanford", "pose", 1e-8),
]  # fmt: skip
"""Robots, tasks, and the length of what the file calls a metre."""


def judged(name: str, task: str, metre: float, length_scale: float) -> Arm:
    arm = arms.ur5().with_task(task) if name == "ur5" else arms.textbook(name, task)
    return (arm if metre == 1 else scaled(arm, metre)).with_task(length_scale=length_scale)


@pytest.mark.parametrize("length_scale", tiered(SCALES, (1.0,)))
@pytest.mark.parametrize(("name", "task", "metre"), sampled(CASES))
def test_all_that_judge_agree(name: str, task: str, metre: float, length_scale: float) -> None:
    arm = judged(name, task, metre, length_scale)
    Q = questions(arm)
    states = [pinsing.at(arm, q) for q in Q]
    expected = [s.status for s in states]
    assert "regular" in expected
    assert "singular" in expected or (str(arm.task) == "orientation" and arm.n == 3)
    for ratios in (
        kinematics.ratios(arm, Q),
        kinematics.ratios(arm, Q, engine="pinocchio"),
        kinematics.measured(kinematics.fixed_batch(arm), Q).ratio,
        kinematics.own_shares(arm, Q)[:, -1],
    ):
        assert [status_of(float(r)) for r in ratios] == expected
    assert [describe(arm, q).status for q in Q] == expected
    for state, q in zip(states, Q, strict=True):
        assert state.singular == (state.rank < state.generic_rank) == describe(arm, q).singular
        assert bool(state.lost) == (state.status != "regular")
        assert bool(state.dependences) or not state.singular


@pytest.mark.parametrize("length_scale", tiered([1e-10, 3e8], {3e8}))
@pytest.mark.parametrize(("name", "task", "metre"), [*CASES[1::3], ("ur5", "tool-axis", 1)])
def test_maps_and_sweeps_count_what_at_says(name, task, metre, length_scale: float) -> None:
    arm = judged(name, task, metre, length_scale)
    found = sigma_map(arm, "grid", steps=3, joints=arm.joints[-3:], ignore_limits=True)
    here = [pinsing.at(arm, q).status for q in found.plan.configurations(0, found.plan.count)]
    assert found.singular == here.count("singular")
    assert found.near_singular == here.count("near-singular")
    assert all(p.status == pinsing.at(arm, p.q).status for p in found.worst)
    swept = sweep(arm, levels=1, samples=5, ignore_limits=True)
    for curve in swept.curves[:3]:
        Q = np.tile(swept.plan.nominal, (len(curve.x), 1))
        for name, value in curve.fixed.items():
            Q[:, arm.joints.index(name)] = value
        Q[:, curve.moving] = curve.x
        states = [pinsing.at(arm, q) for q in Q]
        assert [status_of(float(r)) for r in curve.sigma_ratio] == [s.status for s in states]
        sigma = [s.sigma[s.generic_rank - 1] for s in states]
        atol = 1e-13 * max(float(s.sigma[0]) for s in states)
        np.testing.assert_allclose(curve.sigma_min, sigma, rtol=1e-6, atol=atol)
    for row, q in zip(swept.uniform, swept.plan.uniform, strict=True):
        assert row.status == pinsing.at(arm, q).status
    for point in swept.summary.worst:
        assert point.status == pinsing.at(arm, point.q).status


@pytest.mark.parametrize("task", sampled(TASKS))
@pytest.mark.parametrize("name", ["planar3r", "stanford", "puma560", "surgical7", "scara"])
def test_units_change_sigma_and_no_verdict(name: str, task: str) -> None:
    """The length scale, and what the file calls a metre."""
    if name == "planar3r" and task == "vz,wx":
        pytest.skip("a planar arm moves in neither row")
    plain = arms.textbook(name, task)
    Q, angular = questions(plain), np.array(plain.task.rows) >= 3
    expected, of_plain = kinematics.ratios(plain, Q), kinematics.measure(plain, Q).sigma
    for metre, length_scale in (*((1.0, s) for s in SCALES), (1e-8, 1.0), (1e-3, 1.0), (1e3, 1.0)):
        arm = scaled(plain, metre).with_task(length_scale=length_scale)
        assert kinematics.generic_rank(arm) == kinematics.generic_rank(plain)
        long = kinematics.own_scale(plain).length * metre
        assert kinematics.own_scale(arm).length == pytest.approx(long)
        there = Q * np.where(plain.prismatic, metre, 1.0)
        close = {"rtol": 1e-9, "atol": 1e-15} if metre == 1 else {"rtol": 1e-6, "atol": 1e-14}
        np.testing.assert_allclose(kinematics.ratios(arm, there), expected, **close)
        sigma = kinematics.measure(arm, there).sigma
        if not angular.any() and (metre == 1 or not plain.prismatic.any()):
            np.testing.assert_allclose(sigma * length_scale / metre, of_plain, **close)
        elif angular.all():
            np.testing.assert_allclose(sigma, of_plain, **close)
