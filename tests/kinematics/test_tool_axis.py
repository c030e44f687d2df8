"""Rows in the tip's axes, and the task that leaves the turn about the tool's own axis free."""

import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from arms import differences
from command_line import run
from node import ask, needs_node
from tiers import tiered
from urdf_text import J, Y, Z, urdf

import pinsing
from pinsing._batch import engine
from pinsing.errors import OptionError
from pinsing.kinematics.jacobian import own_jacobians_and_derivatives, tip_placement, tip_rotations
from pinsing.robot.task import parse_task
from pinsing.view.scene import sizes
from pinsing.view.viewer import engine_data

AXES = {"tool-axis": 2, "tool-axis-x": 0, "tool-axis-y": 1}

ELBOW = urdf([
    J("one", "base", "a", (0.1, 0, 0.2), Z, "revolute", (-3, 3), (0.3, 0, 0)),
    J("two", "a", "b", (0.5, 0, 0), Y, "prismatic", (-1, 1)),
    J("three", "b", "c", (0.3, 0, 0.1), Y, "revolute", (-3, 3)),
    J("end", "c", "tool", (0.2, 0.05, 0), kind="fixed", rpy=(0.4, -1.1, 0.7)),
])  # fmt: skip


@pytest.fixture(scope="module")
def ur5():
    return pinsing.load("ur5", task="tool-axis")


@pytest.fixture(scope="module")
def form(ur5):
    return pinsing.closed_form(ur5, prove=True)


def local(arm, q):
    """Pinocchio's Jacobian in the tip's own axes."""
    data = arm.model.createData()
    return pin.computeFrameJacobian(arm.model, data, arm.model_q(q), arm.tip_id, pin.LOCAL)


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


@pytest.mark.parametrize("name", ["ur5", "stanford", "odd"])
def test_rows_at_the_tip_are_pinocchios_local_ones(name, tmp_path, rng):
    robot = name
    if name == "odd":
        robot = tmp_path / "odd.urdf"
        robot.write_text(ELBOW)
    arm = pinsing.load(robot, task="vy@tip,wx@tip,wz@tip", length_scale=0.5)
    for q in arm.space.sample(3, rng):
        J = local(arm, q)[[1, 3, 5]] / np.array([[0.5], [1], [1]])
        np.testing.assert_allclose(pinsing.kinematics.task_jacobian(arm, q), J, atol=1e-12)
        sigma = np.linalg.svd(J, compute_uv=False)
        np.testing.assert_allclose(pinsing.at(arm, q).sigma, sigma, atol=1e-12)
        np.testing.assert_allclose(pinsing.singular_values(arm, [q])[0], sigma, atol=1e-12)
    assert pinsing.kinematics.generic_rank(arm) == np.linalg.matrix_rank(J)


@pytest.mark.parametrize("task", ["tool-axis-x", "vx@tip,wy@tip", "vz,wx@tip,wy@tip"])
def test_derivatives_and_engines_agree(task, rng):
    arm = pinsing.load("puma560", task=task)
    Q = arm.space.sample(3, rng)
    _, H = own_jacobians_and_derivatives(arm, Q)
    numeric = differences(lambda x: own_jacobians_and_derivatives(arm, x)[0], Q)
    np.testing.assert_allclose(H, numeric, atol=1e-8)
    compiled = ("auto", "baseline") if engine.available() else ("auto",)
    by = [pinsing.singular_values(arm, Q, engine=e) for e in (*compiled, "pinocchio")]
    np.testing.assert_allclose(by, [by[0]] * len(by), atol=1e-12)
    np.testing.assert_allclose(
        tip_rotations(arm, Q), tip_rotations(arm, Q, "pinocchio"), atol=1e-12
    )


def with_the_turn(arm, q, axis):
    """Rank of all six rows with the turn about the tool's axis as one joint more, less one."""
    J = pinsing.frame_jacobian(arm, q)
    turn = np.append(np.zeros(3), tip_placement(arm, q).rotation[:, axis])
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


def test_a_tip_at_odd_angles_has_families_of_its_own(tmp_path, rng):
    path = tmp_path / "odd.urdf"
    path.write_text(ELBOW)
    arm = pinsing.load(path, task="vx@tip,vy@tip,wz@tip")
    found = pinsing.closed_form(arm)
    assert found.complete
    assert found.families
    for family in found.families:
        for q in family.sample(3, rng):
            J = local(found.geometry.arm, q)[[0, 1, 5]]
            assert np.linalg.svd(J, compute_uv=False)[-1] < 1e-9
    assert found.jacobian_change < 1e-5


def test_rows_of_both_axes_have_no_certificate_and_say_so(rng):
    arm = pinsing.load("scara", task="vz,wx@tip,wz")
    found = pinsing.closed_form(arm, prove=True)
    assert found.word != "proven"
    assert not found.proof.accepted
    assert "all in the tip's" in found.proof.reason


@pytest.mark.slow
@needs_node
@pytest.mark.parametrize("task", tiered(["tool-axis", "vz,wx@tip,wy@tip"], {"tool-axis"}))
def test_the_page_computes_the_same(task, rng):
    arm = pinsing.load("puma560", task=task)
    Q = np.concatenate(
        [arm.space.sample(20, rng), *(f.sample(3, rng) for f in pinsing.closed_form(arm).families)]
    )
    data = engine_data(arm, (), sizes(arm))
    found = ask("Q.map((q) => m.frameAt(data, q))", data=data, Q=Q)
    for q, here in zip(Q, found, strict=True):
        there = pinsing.at(arm, q)
        np.testing.assert_allclose(here["sigma"], there.sigma, atol=1e-9)
        assert (here["status"], here["rank"]) == (there.status, there.rank)
        assert [m["kind"] for m in here["lost"]] == [m.kind for m in there.lost]


def test_inverse_solutions_point_the_tool_and_leave_its_turn(rng):
    arm = pinsing.load("so101", task="tool-axis")
    q = arm.space.sample(1, rng)[0]
    goal = tip_placement(arm, q)
    found = pinsing.inverse(arm, goal.homogeneous)
    turned = 0.0
    for solution in found:
        there = tip_placement(arm, solution.q)
        np.testing.assert_allclose(there.translation, goal.translation, atol=1e-9)
        np.testing.assert_allclose(there.rotation[:, 2], goal.rotation[:, 2], atol=1e-9)
        turned = max(turned, float(np.abs(there.rotation - goal.rotation).max()))
    assert len(found) > 1
    assert turned > 0.1
    assert min(np.abs(arm.space.wrap(s.q - q)).max() for s in found) < 1e-8
    with pytest.raises(OptionError, match="how the tip moves"):
        pinsing.inverse(arm.with_task("vx@tip,vy@tip"), goal.homogeneous)


def test_a_line_turns_the_tool_the_shortest_way(rng):
    arm = pinsing.load("ur5", task="tool-axis")
    q = np.array([0.3, -1.2, 1.4, -0.9, 1.1, 0.2])
    start = tip_placement(arm, q)
    goal = start.homogeneous.copy()
    goal[:3, 3] += [0.05, 0.02, -0.03]
    goal[:3, :3] = (
        pin.exp3(np.array([0.1, 0.2, 0.0])) @ start.rotation @ pin.exp3(np.array([0.0, 0.0, 2.0]))
    )
    line = pinsing.check_line(arm, q, goal)
    end = tip_placement(arm, line.q[-1])
    np.testing.assert_allclose(end.translation, goal[:3, 3], atol=1e-9)
    np.testing.assert_allclose(end.rotation[:, 2], goal[:3, 2], atol=1e-9)
    assert np.abs(end.rotation - goal[:3, :3]).max() > 0.5  # its turn was not asked for
    with pytest.raises(OptionError, match="how the tip moves"):
        pinsing.check_line(arm.with_task("vx@tip"), q, goal)


def test_sweep_map_and_guard_take_it(ur5, form):
    swept = pinsing.sampling.sweep(ur5, levels=1, samples=64, joints=[ur5.joints[2], ur5.joints[4]])
    straight = min(c.sigma_ratio.min() for c in swept.curves)
    assert straight < 1e-6  # q3 = 0 and q5 = 0 are on the curves
    assert pinsing.sampling.sigma_map(ur5, count=200, seed=1)
    text = pinsing.export_guard(ur5, "c", forms=form)
    assert "tool-axis" in text


@pytest.mark.slow
def test_the_command_line_takes_it(tmp_path: Path):
    for words in (
        ["--tool-axis", "z"],
        ["--task", "tool-axis"],
        ["--task", "tool-axis", "--tool-axis", "z"],
    ):
        done = run("families", "puma560", "-v", *words)
        assert done.exit_code == 0
        assert "tool's own z" in done.output
    done = run("at", "ur5", "--q", "0,0,0,0,0,0", "--task", "vx@tip,wy@tip")
    assert done.exit_code == 0
    assert "task vx@tip,wy@tip" in done.output
    done = run("families", "ur5", "--task", "pose", "--tool-axis", "x")
    assert done.exit_code == 2
    assert "Traceback" not in done.output
    done = run("families", "ur5", "--tool-axis", "q")
    assert done.exit_code == 2


def test_the_command_for_welders_keeps_where_the_tool_points() -> None:
    page = (Path(__file__).parents[2] / "docs/how-to/all-singularities.md").read_text("utf-8")
    shown = page.split("welding torch")[1].split("$ pinsing ")[1].split("\n")[0].split()
    found = json.loads(run(*shown, "-o", "-").stdout)
    assert found["arm"]["task"] == "tool-axis"
    arm = pinsing.load(shown[1], task="tool-axis")
    assert pinsing.singular_values(arm, np.zeros((1, arm.n))).shape == (1, 5)
