"""Toolpaths: the best joint path, held against brute force, and files of poses."""

import json
import re
import runpy
import sys
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from command_line import run
from golden import Golden
from kernel import needs_kernel
from tiers import tiered

import pinsing
from pinsing._batch import engine
from pinsing.errors import ConfigurationError, EngineError, OptionError, RobotFileError
from pinsing.kinematics.inverse import InverseMany
from pinsing.kinematics.jacobian import tip_placement
from pinsing.kinematics.ladder import posture_names
from pinsing.plot.curves import path_sheet
from pinsing.postures import placement
from pinsing.postures.placement import read_poses
from pinsing.postures.toolpath import PathPlan, _Planner, plan_path

pytestmark = needs_kernel  # without it a plan takes minutes

ROOT = Path(__file__).parents[2]
TORCH = pin.SE3(pin.utils.rotate("x", np.radians(45)), np.array([0.0, 0.05, 0.15])).homogeneous
FLANGE = np.eye(4)
BENT_PANDA = [0.1, -0.4, 0.2, -2.0, 0.1, 1.7, 0.6]
START = np.radians([20, -80, 95, -105, -12, 20])


def known(arm):
    """The families of an arm, given itself or by name."""
    arm = pinsing.load(arm) if isinstance(arm, str) else arm
    return pinsing.closed_form(arm, prove=False)


@pytest.fixture(scope="module")
def form():
    return known("ur5")


def poses_of(arm, *Q, tool=FLANGE):
    """Poses of a tool, as matrices."""
    return np.array([tip_placement(arm, np.array(q)).homogeneous for q in Q]) @ tool


def round_from(pose, count, radius):
    """Poses along a circle, their rotation kept."""
    T = np.tile(pose, (count, 1, 1))
    a = np.linspace(0, 2 * np.pi, count)
    T[:, :2, 3] += radius * np.stack([np.cos(a) - 1, np.sin(a)], axis=1)
    return T


def as_poses(*rows):
    """Poses of rows of text: x, y, z, roll, pitch, yaw."""
    numbers = [np.array(row.split(), dtype=float) for row in rows]
    return [pin.SE3(pin.rpy.rpyToMatrix(*x[3:]), x[:3]).homogeneous for x in numbers]


def circle(count, radius=0.12):
    """Poses of the torch of a UR5 along a circle, its rotation kept."""
    return round_from(*poses_of(pinsing.load("ur5"), START, tool=TORCH), count, radius)


def turned(angle):
    """A turn about z, as a matrix."""
    return pin.SE3(pin.utils.rotate("z", angle), np.zeros(3)).homogeneous


def reached(arm, plan, T, tool):
    """The path's configurations are at the poses, turned about the tool's z by its values."""
    for q, value, pose in zip(plan.q, plan.values, T, strict=True):
        goal = pose @ turned(value if plan.free == "roll" else 0.0)
        np.testing.assert_allclose(tip_placement(arm, q).homogeneous @ tool, goal, atol=1e-7)


def only_within(plan, form):
    """The path meets no family, and leaves no limit."""
    check = pinsing.check_trajectory(form.loaded, plan.q, forms=form)
    assert not check.crossings
    assert not check.outside


@pytest.mark.slow
def test_a_torch_on_a_circle(form):
    T = circle(60)
    plan = plan_path(form, T, free="roll", step=np.radians(6), tool=TORCH)
    reached(form.loaded, plan, T, TORCH)
    assert np.degrees(plan.clearance) > 48
    assert 0 <= np.degrees(plan.bound - plan.clearance) < 2
    assert max(plan.fixed) < np.radians(25)
    only_within(plan, form)
    # Between the samples, too, the clearance is no less than what is said.
    s = np.linspace(0, 1, 7)[:, None, None]
    between = (plan.q[:-1] * (1 - s) + plan.q[1:] * s).reshape(-1, 6)
    true = pinsing.clearance(form, between, certify=True)
    assert true.upper.min() >= plan.clearance - 1e-9
    assert PathPlan.from_json(plan.to_json()).clearance == plan.clearance
    assert {"clearance", "bound"} <= json.loads(plan.to_json()).keys()
    above, _, _ = path_sheet(plan, form).axes
    # What is drawn for the tool as given: solutions of the poses themselves, as far as they go.
    drawn = [x for x in above.lines if x.get_color() == above.lines[-1].get_color()]
    assert len(drawn) == len(plan.fixed) == len(plan.kept)
    assert np.isfinite(plan.kept[:, 0]).all()
    for line, least in zip(plan.kept, plan.fixed, strict=True):
        ends = np.isnan(line).any()
        assert least == (0 if ends else line.min())
        assert not np.isfinite(line[np.isnan(line).argmax() :]).any() or not ends
    kept = plan_path(form, T, free="branch", tool=TORCH)
    assert kept.clearance == pytest.approx(max(plan.fixed), abs=np.radians(3))


@pytest.mark.parametrize("seed", tiered(range(4), {2}))
def test_the_optimum_is_that_of_brute_force(form, seed):
    """Over four poses and six values, by our own inverse; edges as the module defines them."""
    rng = np.random.default_rng(seed)
    T = circle(4, 0.02)
    T[:, :3, :3] = T[:, :3, :3] @ pin.exp3(0.3 * rng.normal(size=3))
    step = np.radians(60)
    plan = plan_path(form, T, free="roll", step=step, tool=TORCH)
    back, nodes = np.linalg.inv(TORCH), []
    for pose in T:
        found = [pinsing.inverse(form.loaded, pose @ turned(k * step) @ back) for k in range(6)]
        nodes.append(np.array([s.q for each in found for s in each if s.within_limits]))
    clear = [pinsing.clearance(form, q) for q in nodes]
    sure = [pinsing.clearance(form, q, certify=True, gap=1e-3).upper for q in nodes]
    reach = sure[0].copy()
    for k in range(1, 4):
        gap = np.linalg.norm(form.loaded.space.wrap(nodes[k][:, None] - nodes[k - 1]), axis=-1)
        ok = clear[k].lower[:, None] + clear[k - 1].lower > gap
        reach = np.minimum(np.where(ok, reach, -np.inf).max(axis=1), sure[k])
    best = reach.max()
    at_poses = pinsing.clearance(form, plan.q, certify=True, gap=1e-3).upper.min()
    grid = _Planner(form, form.loaded, T, back, "roll", step, None, lambda *_: None)
    assert grid.estimate() == pytest.approx(best, abs=2e-2)
    assert best - 2e-2 < at_poses <= plan.bound + 1e-3


def no_finer_path_is_better(form, T, free, coarse, fine, **options):
    """Plans at steps of so many degrees: no path of either is better than a bound."""
    plans = [plan_path(form, T, free=free, step=np.radians(s), **options) for s in (coarse, fine)]
    assert max(plan.clearance for plan in plans) <= plans[0].bound
    return plans


def test_the_bound_counts_what_is_within_limits_between_two_values():
    """A value on the grid is beyond a limit, and part of the way from it to the next is not."""
    form = known("irb120")
    q = [-1.0, -1.62, 0.48, -1.84, -1.54, np.pi - 1.85]
    T = round_from(*poses_of(form.loaded, q, tool=TORCH), 12, 0.025)[::3]
    fine = no_finer_path_is_better(form, T, "roll", 5, 1, tool=TORCH)[1]
    assert fine.clearance > np.radians(55)


def test_a_rotation_about_the_last_axis_cannot_help(form):
    T = poses_of(form.loaded, *[START] * 5)
    T[:, 0, 3] += np.linspace(0, 0.05, 5)
    plan = plan_path(form, T, free="roll", step=np.radians(60))
    assert any("changes no clearance, only whether that joint" in note for note in plan.notes)
    assert plan.bound == pytest.approx(plan_path(form, T).bound, abs=1e-3)
    assert max(plan.fixed) == pytest.approx(plan.clearance, abs=1e-3)
    torch = plan_path(form, circle(5), free="roll", step=np.radians(60), tool=TORCH)
    assert not any("changes no clearance" in note for note in torch.notes)


def test_why_there_is_no_path(form):
    far = circle(5)
    far[3, 0, 3] += 3.0
    plan = plan_path(form, far, tool=TORCH)
    assert plan.reason.startswith("pose 3 at (")
    assert "out of reach" in plan.reason
    assert not len(plan.q)
    # Elbow up at the first pose, and only elbow down where joint limits leave nothing else.
    q = np.array([[0.1, -1.2, 0.4, -1.0, 0.8, 0.0], [0.1, -0.8, -0.4, -1.0, 0.8, 0.0]])
    poses = poses_of(form.loaded, *q)
    crossing = plan_path(form, poses, start=q[0])
    assert crossing.clearance > 0
    with pytest.raises(ConfigurationError, match="does not reach"):
        plan_path(form, poses, start=q[0] + 0.1)
    rushed = plan_path(form, poses, start=q[0], t=[0.0, 1e-3])
    assert "speed limit between poses 0 and 1" in rushed.reason


def written(file, T):
    """A file of poses."""
    rows = [[*P[:3, 3], *pin.Quaternion(P[:3, :3]).coeffs()] for P in T]
    np.savetxt(file, rows, delimiter=",", header="x,y,z,qx,qy,qz,qw", comments="")
    return file


@pytest.mark.parametrize(
    ("turns", "start", "reached"),
    [
        pytest.param(1.9, None, True, marks=pytest.mark.slow),
        pytest.param(2.1, None, False, marks=pytest.mark.slow),
        (1.5, -1.0, False),
        (1.5, -6.0, True),
    ],
)
def test_a_path_within_two_turns_of_a_joint(form, turns, start, reached):
    first = None if start is None else np.append(START[:5], start)
    # Turned about the last joint's axis, which is the tip's z.
    spin = np.array([turned(a) for a in np.linspace(0, 2 * np.pi * turns, 40)])
    T = poses_of(form.loaded, START if first is None else first) @ spin
    plan = plan_path(form, T, start=first)
    assert bool(len(plan.q)) == reached
    assert ("winds wrist_3_joint beyond its limits" in plan.reason) != reached
    if reached:
        assert not form.loaded.space.outside(plan.q).any()
        assert np.ptp(plan.q[:, 5]) == pytest.approx(2 * np.pi * turns, abs=1e-6)
        assert first is None or np.allclose(plan.q[0], first, atol=1e-6)


@pytest.mark.parametrize("began", [False, True])
def test_a_path_with_the_roll_kept_is_one_of_those_that_the_bound_is_of(began):
    """Its best branch winds a joint beyond the limits of two turns."""
    form = known("lrmate200id")
    T = np.tile(np.eye(4), (12, 1, 1))
    T[:, :3, :3] = pin.rpy.rpyToMatrix(1.15, 1.8, -1.94) @ pin.utils.rotate("x", np.pi)
    T[:, :3, 3] = np.linspace([0.472, -0.075, 0.194], [0.355, 0.051, 0.229], 12)
    plan = plan_path(form, T, free="roll", step=np.radians(5))
    if began:
        start = plan_path(form, T).q[0]
        plan = plan_path(form, T, free="roll", step=np.radians(5), start=start)
        assert len(plan.fixed) == 1
    assert 0 < max(plan.fixed) <= plan.bound
    late = plan_path(form, T[:1].repeat(2, 0), free="roll", step=0.5, t=[0, 1])
    assert "with roll kept: no path" in replace(late, fixed=(0.0,)).text()


@pytest.mark.slow
@pytest.mark.parametrize("free", ["branch", "roll"])
def test_a_long_motion_that_is_clear_is_a_path(free):
    """Of 29 degrees, where the clearances at the ends add up to less than 20."""
    form = known("irb1200")
    q = [
        [2.5787, 2.0684, -0.1198, -2.3086, -2.2167, -2.9245],
        [2.6759, 2.0843, 0.3056, -2.1356, -2.268828, -2.8727],
    ]
    T = poses_of(form.loaded, *q)
    plan = plan_path(form, T, free=free, step=np.radians(60), start=q[0])
    assert np.radians(7.9) < plan.clearance <= plan.bound, plan.reason
    slow = plan_path(form, T, free=free, step=np.radians(60), start=q[0], t=[0, 0.01])
    assert "q3 would exceed its speed limit between poses 0 and 1" in slow.reason


@pytest.mark.parametrize(
    ("limits", "q", "started", "reason"),
    [
        ({2: (-2.0, 1.0)}, [{2: 0.99}, {2: 1.01}], True,
         "1 the way on leaves the limits of elbow_joint: within them the nearest"),
        ({2: (0.98, 1.0)}, [{2: 0.99}, {0: 0.6, 1: -0.7, 2: 1.49, 3: -0.5, 4: 1.4, 5: 0.5}], False,
         "at pose 1 every solution is outside the limits of elbow_joint"),
        # Within these nothing but the wrist's singularity lies between two solutions.
        ({2: (-1.0, 1.0), 4: (-0.5, 3.0)}, [{4: 0.3}, {4: -0.3}], True,
         "crosses wrist (F2) between poses 0 and 1"),
    ],
)  # fmt: skip
def test_what_ends_the_way_within_narrow_limits_is_named(form, limits, q, started, reason):
    model, Q = form.loaded.model.copy(), np.tile([0.1, -1.2, 0.8, -1.0, 0.9, 0.0], (2, 1))
    for j, ends in limits.items():
        model.lowerPositionLimit[j], model.upperPositionLimit[j] = ends
    for row, other in zip(Q, q, strict=True):
        row[[*other]] = [*other.values()]
    narrow = known(pinsing.load(model, tip=form.loaded.tip))
    plan = plan_path(narrow, poses_of(form.loaded, *Q), start=Q[0] if started else None)
    assert reason in plan.reason
    assert not len(plan.q)


@pytest.mark.parametrize(("name", "held"), [("aubo_i5", None), ("gen3_7", 5)])
def test_poses_of_opposite_axes_and_of_joints_that_line_up_at_zero_are_reached(name, held):
    """No solution was found: EAIK takes one of opposite axes for the other, or knows zero alone."""
    arm = pinsing.load(name)
    many = InverseMany(arm, held)
    for q in np.random.default_rng(3).uniform(-1.5, 1.5, (2, arm.n)):
        tip = tip_placement(arm, q)
        values = None if held is None else q[[held]]
        found = many.solve(tip.translation[None, None], tip.rotation[None, None], values)[0, 0]
        assert np.nanmin(np.abs(arm.space.wrap(found - q)).max(axis=1)) < 1e-6


@pytest.mark.slow
def test_joints_without_limits_make_as_many_turns_as_a_path_needs():
    """Four turns of the tool were called degrees, and so were turns that nothing needed."""
    form = known("gen3_6")
    T = poses_of(form.loaded, *[[0.2, 0.5, -1.2, 0.4, 0.9, 0.1]] * 25)
    for pose, a in zip(T, np.linspace(0, 8 * np.pi, 25), strict=True):
        pose[:3, :3] = pose[:3, :3] @ pin.utils.rotate("z", a)
    plan = plan_path(form, T)
    reached(replace(form.loaded, units="rad"), plan, T, FLANGE)
    np.testing.assert_allclose(np.ptp(plan.q, axis=0), [0, 0, 0, 0, 0, 8 * np.pi], atol=1e-9)
    path_sheet(plan, form)
    T = np.tile(np.eye(4), (4, 1, 1))
    for pose, a in zip(T, np.linspace(0, np.pi / 2, 4), strict=True):
        pose[:3, :3] = pin.utils.rotate("z", a) @ pin.utils.rotate("y", np.pi + 0.5)
        pose[:3, 3] = 0.4 + 0.15 * np.cos(a), 0.15 * np.sin(a), 0.2
    plan = plan_path(form, T, free="roll", step=np.radians(20), tool=TORCH)
    reached(form.loaded, plan, T, TORCH)
    assert np.abs(plan.q[0]).max() <= np.pi


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5", "puma560", "z1", "aubo_i5"])
def test_eaik_misses_nothing_that_ours_finds(name, monkeypatch):
    arm = pinsing.load(name)
    many = InverseMany(arm)
    assert many.exact
    Q = np.random.default_rng(3).uniform(-2.5, 2.5, (10_000, arm.n))
    Q = np.clip(Q, arm.space.span[0], arm.space.span[1])
    T = poses_of(arm, *Q)
    found = many.solve(T[:, None, :3, 3], T[:, None, :3, :3])[:, 0]
    monkeypatch.setattr(sys.modules["pinsing.kinematics.inverse"], "decomposed", lambda *_: None)
    apart = np.abs(arm.space.wrap(found - Q[:, None])).max(axis=-1)
    assert np.nan_to_num(apart, nan=np.inf).min(axis=1).max() < 1e-5
    for k, pose in enumerate(T[:60]):
        here = found[k][np.isfinite(found[k][:, 0])]
        for q in here:
            np.testing.assert_allclose(tip_placement(arm, q).homogeneous, pose, atol=1e-8)
        ours = [s for s in pinsing.inverse(arm, pose) if s.regular]
        assert len(here) >= len(ours)
        for s in ours:
            assert np.abs(arm.space.wrap(here - s.q)).max(axis=1).min() < 1e-5


@pytest.mark.parametrize("cyclic", [True, False])
def test_neighbours_are_those_of_the_largest_sum_of_cosines(cyclic):
    """Beside another value a branch that ends turns back, to the nearest other of its own value."""
    rng = np.random.default_rng(2)
    N, G, S, n = 3, 7, 4, 6
    Q = rng.uniform(-0.4, 0.4, (N, 1, 1, n)) + rng.uniform(-3, 3, (S, n))
    Q = Q + 0.2 * np.arange(G)[:, None, None]
    Q[rng.random(Q.shape[:3]) < 0.3] = np.nan
    before, beside = np.empty((N, G * S), np.int32), np.empty((N, 2, G * S), np.int32)
    step, way, ends = np.empty((N, G * S)), np.empty((N, G * S)), np.empty(beside.shape, bool)
    whole, found = np.full(n, 2 * np.pi), (before, step, beside, ends, way)
    engine.module().link_nodes(Q, whole, whole, np.ones(n), cyclic, *found, 1)
    flat, there = Q.reshape(N, G * S, n), np.isfinite(Q[..., 0])

    def nearest(q, k, i, less=0.0):
        alike = np.where(there[k, i], np.cos(Q[k, i] - q).sum(axis=1), less)
        return i * S + int(np.argmax(np.nan_to_num(alike, nan=less)))

    for k, x in zip(*np.nonzero(there.reshape(N, -1)), strict=True):
        i, q, last = x // S, flat[k, x], max(k - 1, 0)
        assert before[k, x] == nearest(q, last, i)
        if k and there[last].ravel()[before[k, x]]:
            off = (q - flat[last, before[k, x]] + np.pi) % (2 * np.pi) - np.pi
            assert step[k, x] == pytest.approx(np.linalg.norm(off))
        for side, to in enumerate((i - 1, i + 1)):
            to = to % G if cyclic else min(max(to, 0), G - 1)
            y = nearest(q, k, to)
            back = there[k].ravel()[y] and nearest(flat[k, y], k, i) == x
            assert ends[k, side, x] == (to != i and not back)
            if not ends[k, side, x]:
                assert beside[k, side, x] == y
            else:
                others = [z for z in range(i * S, i * S + S) if z != x and there[k].ravel()[z]]
                best = max(others, key=lambda z: np.cos(flat[k, z] - q).sum(), default=None)
                assert best is None or beside[k, side, x] == best


@pytest.mark.slow
def test_an_arm_that_has_no_decomposition_is_followed(form, monkeypatch):
    monkeypatch.setattr(sys.modules[InverseMany.__module__], "decomposed", lambda *_: None)
    T = circle(8)
    plan = plan_path(form, T, free="roll", step=np.radians(30), tool=TORCH)
    reached(form.loaded, plan, T, TORCH)
    assert any("by continuation" in note for note in plan.notes)
    monkeypatch.undo()
    exact = plan_path(form, T, free="roll", step=np.radians(30), tool=TORCH)
    assert plan.nodes == pytest.approx(exact.nodes, rel=0.02)
    assert plan.clearance == pytest.approx(exact.clearance, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("q", "count", "step", "gap"),
    [(BENT_PANDA, 6, 5, np.inf), ([-0.83, -0.46, 0.6, -1.45, -0.81, 1.74, -0.04], 60, 3, 1)],
)
def test_a_seventh_joint_is_free(q, count, step, gap):
    """Also where the branch moves fast along it the bound is near."""
    form = known("panda")
    T = round_from(*poses_of(form.loaded, q), count, 0.12)
    plan = plan_path(form, T, free=form.loaded.joints[6], step=np.radians(step))
    reached(form.loaded, plan, T, FLANGE)
    np.testing.assert_allclose(plan.q[:, 6], plan.values, atol=1e-9)
    assert plan.clearance > 0
    assert 0 <= np.degrees(plan.bound - plan.clearance) < gap
    only_within(plan, form)


@pytest.mark.slow
def test_what_may_be_free_of_seven_joints_is_said():
    T = poses_of(pinsing.load("panda"), BENT_PANDA, BENT_PANDA)
    with pytest.raises(OptionError, match=r"7 free joints .* may be one of panda_joint1, "):
        plan_path(known("panda"), T, free="roll")
    # With its elbow held an arm reaches poses of one distance from its shoulder alone.
    with pytest.raises(OptionError, match=r"q4 held do not move .* one of q1, q2, q3, q5, q6, q7"):
        plan_path(known("iiwa7"), T, free="q4")


@pytest.mark.parametrize("step", tiered([1, 60], {60}))
def test_a_path_begins_at_its_start_whatever_the_grid(step):
    """A start between two values of what is free was moved to the next one, or refused."""
    bent = np.array([0.1, -0.4, 0.2, -1.9, 0.3, 1.7, 0.83])
    for form, q, least, tool, free in (
        (known("panda"), bent, 70, FLANGE, "panda_joint7"),
        (known("ur5"), START, 5, TORCH, "roll"),
    ):
        arm = form.loaded
        Q = q + np.linspace(0, 0.1, 5)[:, None] * np.array([1, 1, 0, 1, 0, 1, 0])[: arm.n]
        T = poses_of(arm, *Q, tool=tool)
        T[:, :3, :3] = T[:, :3, :3] @ pin.utils.rotate("z", 0.1 if free == "roll" else 0.0)
        options = {"free": free, "step": np.radians(step), "tool": tool}
        plan = plan_path(form, T, start=q, **options)
        np.testing.assert_allclose(plan.q[0], q, atol=1e-12)
        assert plan.values[0] == pytest.approx(-0.1 if free == "roll" else 0.83)
        assert max(plan.fixed) > np.radians(least)
        assert plan.clearance <= plan.bound
        reached(arm, plan, T, tool)
        with pytest.raises(ConfigurationError, match="start does not reach the first pose"):
            plan_path(form, T, start=q + 0.1, **options)
        beyond = plan_path(form, T, start=q + 2 * np.pi * np.eye(arm.n)[0], **options)
        assert f"start is outside the limits of {arm.joints[0]}" in beyond.reason


@pytest.mark.slow
@pytest.mark.parametrize("count", [3, 8])
def test_the_bound_counts_what_lies_between_a_value_and_where_its_branch_turns_back(count):
    form = known("panda")
    T = round_from(*poses_of(form.loaded, BENT_PANDA), count, 0.12)
    no_finer_path_is_better(form, T, form.loaded.joints[6], 10, 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("begin", "end", "count", "step"),
    [
        ("-1.03 -.75 .67 3.01 -.13 1.26 -1.9", "-1.03 -.67 .62 2.95 -.27 .88 -2.26", 9, 5),
        ("-2.32 1.86 2.27 1.36 1.63 .34 .22", "-1.9 1.79 2.34 1.58 1.71 .12 .71", 7, 20),
    ],
)
def test_the_bound_counts_solutions_far_from_those_at_the_next_value(begin, end, count, step):
    """Where branches end or a joint goes through half a turn finer paths had 0.4 degrees more."""
    form = known("xarm7")
    ends = np.array([begin.split(), end.split()], dtype=float)
    T = poses_of(form.loaded, *np.linspace(*ends, count))
    no_finer_path_is_better(form, T, form.loaded.joints[6], step, step / 4)


@pytest.mark.slow
def test_motions_between_values_are_counted(monkeypatch):
    """There were 14 million of them: 0.7 GB and 7 s for 20 poses, no better path or bound."""
    counts, finer = [], _Planner.finer

    def counted(self, *ends):
        part = finer(self, *ends)
        counts.append(0 if part is None else sum(e.size for e in part.edges))
        assert part is None or part.floor >= self.floor  # of less room some nodes were left out
        return part

    monkeypatch.setattr(_Planner, "finer", counted)
    form = known("panda")
    a = [-2.1871, -0.8528, -0.5460, -0.1623, -1.9567, 3.2145, -1.9525]
    b = [-2.4927, -0.7399, -0.6996, -0.0698, -1.8934, 2.9909, -1.8722]
    T = poses_of(form.loaded, *np.linspace(a, b, 20))
    plan = plan_path(form, T, free=form.loaded.joints[6], step=np.radians(10))
    assert 0 < max(counts) < 8e6
    assert np.degrees(plan.bound - plan.clearance) < 1.7


FILES = Golden(Path(__file__).with_name("poses.txt"))


@pytest.mark.parametrize("head", FILES.cases)
def test_files_of_poses(tmp_path, head):
    """Place and z axis of the first pose, which all have, times, and whether the roll is said."""
    file = tmp_path / "poses.csv"
    file.write_text(FILES.text(head))
    try:
        read = read_poses(file, degrees="deg" in head.split(), millimetres="mm" in head.split())
    except RobotFileError as error:
        FILES.hold(head, str(error).replace(f"{tmp_path}/", ""))
        return
    assert np.ptp(read.poses, axis=0).max() == 0
    numbers = np.concatenate([read.poses[0, :3, 3], read.poses[0, :3, 2]]).round(9) + 0.0
    times = None if read.t is None else read.t.tolist()
    FILES.hold(head, f"{numbers.tolist()}, times {times}, roll {read.has_roll}")


def test_the_command_writes_a_path_that_check_takes(form, tmp_path):
    T = circle(5, 0.06)
    poses, out, picture = (tmp_path / n for n in ("poses.csv", "joints.csv", "path.png"))
    tool = "0,0.05,0.15,45,0,0"
    written(poses, T)
    arguments = ["path", "ur5", str(poses), "--free", "roll", "--step", "60deg", "--tool", tool]
    done = run(*arguments, "--deg", "-o", out, "-o", picture, "-o", "-.json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["clearance"] > 0.7
    assert out.read_text().splitlines()[0].split(",") == [f"{j} (deg)" for j in form.loaded.joints]
    assert run(*arguments, "--deg", "-o", "-.csv").stdout.endswith(out.read_text())
    assert picture.stat().st_size > 10_000
    for units in ([], ["--deg"]):
        check = run("check", "ur5", str(out), *units)
        assert check.exit_code == 0, check.output
    T[3, 0, 3] += 5.0
    written(poses, T)
    none = run(*arguments, "--deg")
    assert none.exit_code == 1
    assert "No path: pose 3 at (" in none.stdout
    bad = run("path", "ur5", str(Path("nothere.csv")))
    assert bad.exit_code == 2
    poses.write_text("x,y,z,i,j,k,t\n0.4,0,0.2,0,0,1,0\n0.4,0.1,0.2,0,0,1,1\n")
    both = run("path", "ur5", str(poses), "--free", "roll", "--feed", "0.1")
    assert (both.exit_code, "column t" in both.stderr) == (2, True)


RANGES = {"x": (-0.15, 0.15), "y": (-0.2, 0.1), "yaw": (-0.5, 0.5)}


@pytest.mark.slow
def test_a_workpiece_is_put_as_well_as_by_brute_force(form):
    T = circle(6)
    options = {"free": "roll", "step": np.radians(20), "tool": TORCH}
    plan = plan_path(form, T, place=RANGES, **options)
    at = plan.placement
    given = plan_path(form, T, **options)
    assert at.before == given.clearance
    middle = (T[:, :3, 3].min(axis=0) + T[:, :3, 3].max(axis=0)) / 2
    best = 0.0
    for x, y, yaw in product(*(np.linspace(*ends, 4) for ends in RANGES.values())):
        moved = turned(yaw) @ T
        moved[:, :3, 3] += middle + np.array([x, y, 0]) - turned(yaw)[:3, :3] @ middle
        best = max(best, plan_path(form, moved, **options).clearance)
    assert best > given.clearance + np.radians(5)
    assert plan.clearance > best - np.radians(0.5)
    # What is said to be done leads to that path.
    turn = pin.utils.rotate("z", at.yaw)
    np.testing.assert_allclose(at.transform[:3, :3], turn, atol=1e-12)
    np.testing.assert_allclose(at.transform[:3] @ [*middle, 1], middle + np.array([at.x, at.y, 0]))
    assert (at.z, at.roll, at.pitch) == (0, 0, 0)
    reached(form.loaded, plan, at.transform @ T, TORCH)
    again = plan_path(form, at.transform @ T, **options)
    assert (plan.clearance, plan.bound) == (again.clearance, again.bound)
    assert PathPlan.from_json(plan.to_json()).placement.yaw == at.yaw
    for value in (at.x / 1e-3, at.y / 1e-3, at.yaw / np.radians(0.1)):
        assert value == pytest.approx(round(value), abs=1e-6)
    assert f"x = {at.x:+.3f} m" in plan.text()


@pytest.mark.slow
def test_a_workpiece_that_lies_well_stays(form):
    """What was given is not given up for less, where the ranges allow it."""
    T = circle(4)
    options = {"free": "roll", "step": np.radians(30), "tool": TORCH}
    best = plan_path(form, T, place=RANGES, **options)
    T = best.placement.transform @ T
    near = {"x": (-0.4, 0.002), "z": (-0.3, 0.001)}
    again = plan_path(form, T, place=near, **options)
    assert again.clearance >= best.clearance
    only = plan_path(form, T, place={"x": (-0.4, -0.3)}, **options)
    assert only.placement.x <= -0.3
    assert only.clearance < best.clearance


TWO = np.tile(np.eye(4), (2, 1, 1))
SHEARED = TWO + np.outer([0, 0.1], np.eye(16)[12]).reshape(2, 4, 4)


@pytest.mark.parametrize(
    ("T", "options", "error", "said"),
    [
        (TWO, {"place": {}}, OptionError, "needs a range"),
        (TWO, {"place": {"w": (0, 1)}}, OptionError, "'w' is none of x, y, z, roll, pitch, yaw"),
        (TWO, {"place": {"x": (0.1, 0.1)}}, OptionError, "x needs two ascending values"),
        (TWO, {"place": {"x": (0.1, -0.1)}}, OptionError, "x needs two ascending values"),
        (TWO, {"place": {"z": (0.1, np.inf)}}, OptionError, "z needs two ascending values"),
        (TWO, {"place": {"yaw": (-30, 30)}}, OptionError, "over a turn"),
        (TWO, {"place": {"x": (0, 1)}, "start": START}, OptionError, "give one of them"),
        (TWO, {"free": "elbow"}, OptionError, "neither branch, roll, nor a joint"),
        (SHEARED, {}, ConfigurationError, "poses: number 1 is no rigid motion"),
        (TWO, {"without": "kernel"}, EngineError, "toolpaths need the compiled kernel"),
    ],
)
def test_what_makes_no_sense_is_refused(form, monkeypatch, T, options, error, said):
    if options.pop("without", None):
        monkeypatch.setattr(engine, "available", lambda: False)
    with pytest.raises(error, match=said):
        plan_path(form, T, **options)


def test_the_best_of_the_placements_that_are_tried_is_taken():
    tried = {}

    def value(at):
        tried[tuple(at.values())] = -abs(at["x"] - 0.04) - abs(at["yaw"] - 0.2)
        return tried[tuple(at.values())]

    best, count = placement.search(value, {"x": (-0.1, 0.1), "yaw": (-0.5, 0.5)})
    assert tried[tuple(best.values())] == max(tried.values()) > -0.02
    assert len(tried) <= count <= placement.TRIED


def test_no_placement_is_reached(form, monkeypatch):
    monkeypatch.setattr(placement, "TRIED", 16)
    plan = plan_path(form, circle(3), tool=TORCH, place={"x": (3, 4)})
    assert "placements tried has one; at the best of them pose" in plan.reason
    assert "out of reach" in plan.reason
    assert plan.placement is None
    assert not len(plan.q)


@pytest.mark.slow
def test_poses_far_apart_have_the_same_path_on_every_grid(form):
    # The example of docs/how-to/toolpath.md, where estimates of nodes are 15 degrees too high.
    T = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (4, 1, 1))
    T[:, :3, 3] = [[0.4, -0.15, 0.1], [0.45, -0.05, 0.1], [0.45, 0.05, 0.1], [0.4, 0.15, 0.1]]
    for step in (20, 4):
        plan = plan_path(form, T, free="roll", step=np.radians(step), tool=TORCH)
        reached(form.loaded, plan, T, TORCH)
        assert np.degrees(plan.clearance) > 70.9
        assert np.degrees(plan.bound) < 71.6
    # The picture has what the best branch has at each value, along the path and away from it.
    for k, i in ((0, 7), (1, 50), (3, 75)):
        every = pinsing.inverse(form.loaded, T[k] @ turned(plan.grid[i]) @ np.linalg.inv(TORCH))
        most = max(pinsing.clearance(form, s.q, certify=True).upper for s in every)
        assert most - 1e-6 < plan.room[k, i] < most + np.radians(16)


def test_of_paths_that_seem_as_good_none_of_long_motions_is_taken():
    # Whose clearance between poses is looked at in three places: 11.9 degrees of 19.5 were left.
    form = known("iiwa7")
    begin = [-2.07, -1.1, 1.51, 0.34, -2.03, -0.28, -0.1]
    end = [-2.16, -1.45, 2.84, 0.43, -2.17, -0.39, -0.37]
    T = poses_of(form.loaded, *np.linspace(begin, end, 4))
    plan = plan_path(form, T, free=form.loaded.joints[1], step=0.05, start=begin)
    reached(form.loaded, plan, T, FLANGE)
    assert plan.bound - plan.clearance < np.radians(0.1)


@pytest.mark.slow
def test_few_poses_have_as_good_a_path_at_fine_steps_as_at_coarse_ones(form):
    # Fine steps turned at most 18 degrees from pose to pose: 58.4, where 20 degrees had 59.1.
    dome = runpy.run_path(ROOT / "scripts/bench/toolpath.py")["toolpaths"](60)
    plan = plan_path(form, dome["5-axis spiral on a dome"], free="roll", tool=TORCH)
    assert np.degrees([plan.clearance, plan.bound]) == pytest.approx([60, 60], abs=0.5)


def test_a_posture_named_as_start_is_kept_and_one_below_the_base_is_told(tmp_path):
    form = known("m1013")
    lean, turn = np.radians(np.linspace(5, 10, 4)), np.linspace(0, 1, 4)
    out = np.stack([np.sin(lean) * np.cos(turn), np.sin(lean) * np.sin(turn), np.cos(lean)], 1)
    rows = np.hstack([[0.65, 0.1, 0.05] + 0.2 * out, -out])  # a spiral on a dome
    np.savetxt(tmp_path / "p.csv", rows, delimiter=",", header="x,y,z,i,j,k", comments="")
    T = read_poses(tmp_path / "p.csv").poses
    options = {"free": "roll", "step": np.radians(60), "tool": TORCH}
    best = plan_path(form, T, **options)
    assert best.notes[-1].startswith("q3 is 0.")
    assert "m below the base at pose" in best.notes[-1]
    plan = plan_path(form, T, start="elbow up, shoulder right", **options)
    names = posture_names(form.geometry, plan.q)
    assert all({"elbow up", "shoulder right"} <= set(n) for n in names)
    assert 0.05 < plan.clearance < best.clearance
    assert not any("below" in note for note in plan.notes)
    for wrong, why in (("limits", "it may be elbow down"), ("elbow up, elbow down", "no posture")):
        with pytest.raises(OptionError, match=f"start.*{why}"):
            plan_path(form, T, start=wrong, **options)


def test_the_command_places_a_workpiece(tmp_path, monkeypatch):
    monkeypatch.setattr(placement, "TRIED", 16)  # how good the best of all is slow tests say
    poses, out = written(tmp_path / "poses.csv", circle(3)), tmp_path / "joints.csv"
    options = ["--step", "60deg", "--tool", "0,0.05,0.15,45,0,0", "--deg"]
    frame = ["--base-frame", "0.02,0,0,0,0,5"]
    place = ["--place", "x=-0.15..0.15, yaw=-30..30"]
    words = ["path", "ur5", str(poses), *options]
    done = run(*words, *frame, *place, "-o", str(out))
    assert done.exit_code == 0, done.output
    said = re.search(r"clearance (\S+)° becomes (\S+)°", " ".join(done.stdout.split()))
    assert float(said[2]) > float(said[1])
    # What is proposed next writes the page that plays it.
    words_next = " ".join(done.stdout.split()).partition("play the path: pinsing ")[2]
    assert run(*words_next.split()).exit_code == 0
    assert out.with_suffix(".html").stat().st_size > 100_000
    # The frame that is printed is where the poses are now.
    moved = re.search(r"--base-frame (\S+)", done.stdout)[1]
    again = json.loads(run(*words, "--base-frame", moved, "-o", "-.json").stdout)
    assert np.degrees(again["clearance"]) == pytest.approx(float(said[2]), abs=0.06)


def test_how_far_the_tool_leaves_the_line_between_poses_is_told(form):
    T = circle(9)
    plan = plan_path(form, T, tool=TORCH)
    middles = (plan.q[:-1] + plan.q[1:]) / 2
    at = poses_of(form.loaded, *middles, tool=TORCH)[:, :3, 3]
    off = 1e3 * np.linalg.norm(at - (T[:-1, :3, 3] + T[1:, :3, 3]) / 2, axis=1)
    k = off.argmax()
    assert any(f"poses {k} and {k + 1}" in n and f"is {off[k]:.1f} mm" in n for n in plan.notes)
    assert not any("mm" in n for n in plan_path(form, circle(99), tool=TORCH).notes)


def test_turns_of_two_joints_are_told_apart(form, monkeypatch):
    """The kernel refused how they lay in memory: a seam of a CRX ended in a TypeError."""
    best = partial(plan_path, form, circle(3), free="roll", step=np.radians(20))
    plain, link = best(), _Planner._link

    def counted(self):
        link(self)
        self._count_turns(np.arange(form.loaded.n) > 3)

    monkeypatch.setattr(_Planner, "_link", counted)
    plan = best()
    assert (plan.clearance, plan.bound) == pytest.approx((plain.clearance, plain.bound))


def test_a_planner_begins_anew_where_the_poses_are_moved(form):
    """What it had found where they lay was a bound there: 64.7 degrees where a path has 67.4."""
    T = circle(3)
    step, back = np.radians(60), np.linalg.inv(TORCH)
    used = _Planner(form, form.loaded, T, back, "roll", step, None, lambda *_: 0)
    used.plan(None)
    moves = {"x": 0.15, "y": 0.1, "yaw": -0.5}
    turn = placement.place_at(moves, T[:, :3, 3].mean(axis=0)).transform
    moved = used.moved(turn).plan(None)
    fresh = plan_path(form, turn @ T, free="roll", step=step, tool=TORCH)
    assert (moved.clearance, moved.bound) == (fresh.clearance, fresh.bound)
    beyond = used.moved(np.block([[np.eye(3), np.full((3, 1), 5.0)], [0, 0, 0, 1]])).plan(None)
    assert "out of reach" in beyond.reason


SEAM = """x,y,z,i,j,k
0.5,-0.2,0.2,0.2,0,0.98
0.55,-0.1,0.2,0.1,0,0.995
0.55,0.0,0.25,0,0,1
0.55,0.1,0.2,-0.1,0,0.995
0.5,0.2,0.2,-0.2,0,0.98
"""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "least"), [("ur15", 60), ("kr10_r1100_2", 66)])
def test_a_short_path_has_no_jumps_and_its_map_no_stripes(tmp_path, name, least):
    """Of greater clearance one led q1, between -170 and 170 degrees, all the way round.

    A value that is searched more often than its neighbours does not stand out from both.
    """
    form, file = known(name), tmp_path / "seam.csv"
    file.write_text(SEAM)
    plan = plan_path(form, read_poses(file).poses, free="roll", tool=TORCH)
    assert np.degrees(plan.clearance) > least
    assert not pinsing.check_trajectory(form.loaded, plan.q, forms=form).jumps
    beside = np.stack([np.roll(plan.room, turn, axis=1) for turn in (1, -1)])
    assert np.degrees(plan.room - beside.max(axis=0)).max() < 1
    assert np.degrees(beside.min(axis=0) - plan.room).max() < 1


@pytest.mark.slow
def test_the_bound_counts_motions_that_are_long_at_both_ends():
    """Another path, of short motions, has 8 degrees, and was the bound: a finer grid had 20."""
    T = as_poses(".166 .205 1.406 1.475 -.009 -.093", ".106 .182 1.34 1.126 .121 .172")
    (tool,) = as_poses("-.11 -.088 .02 .701 -.808 -.369")
    coarse, fine = no_finer_path_is_better(known("kr10_r1100"), T, "roll", 10, 3, tool=tool)
    assert min(coarse.clearance, fine.clearance) > np.radians(20)
    assert max(coarse.clearance, fine.clearance) <= fine.bound


def test_no_path_within_joint_speeds_is_no_error():
    """Values were divided of poses that nothing leads to."""
    T = as_poses(
        ".22494 -.73719 -.78004 -3.14159 -1.3491 -1.97052",
        ".25465 -.75033 -.79629 2.78169 -1.44361 -1.813",
        ".19979 -.74037 -.74761 3.13976 -1.1354 -1.81738",
        ".25217 -.75051 -.84458 .74887 -1.31986 .21355",
        ".21563 -.776 -.70583 2.82328 -.77003 -1.58401",
    )
    (tool,) = as_poses("-.07441 -.04022 -.0754 .09137 .12567 .21823")
    t = [0.0, 0.04359, 0.13241, 0.26523, 0.44011]
    plan = plan_path(known("m1013"), T, free="roll", step=np.radians(10), tool=tool, t=t)
    assert "would exceed its speed limit between poses 0 and 1" in plan.reason


@pytest.mark.slow
def test_the_roll_of_the_poses_as_given_does_not_matter_where_it_is_free(form):
    """Turned by up to 180 degrees from pose to pose they had no path."""
    T = circle(8, 0.05)
    rolls = 2 * np.pi * np.random.default_rng(2).random(8)
    given = np.array([P @ turned(a) for P, a in zip(T, rolls, strict=True)])
    options = {"free": "roll", "step": np.radians(10), "tool": TORCH}
    plan = plan_path(form, given, **options)
    reached(form.loaded, plan, given, TORCH)
    assert plan.clearance == pytest.approx(plan_path(form, T, **options).clearance, abs=0.01)
    as_given = [s.q for s in pinsing.inverse(form.loaded, given[0] @ np.linalg.inv(TORCH))]
    near = pinsing.clearance(form, np.array(as_given), certify=True).upper
    assert np.abs(near - plan.kept[:, :1]).min(axis=1) == pytest.approx(0, abs=1e-2)
    at = np.rint(plan.values / plan.grid[1]).astype(int) % len(plan.grid)
    assert (plan.room[range(8), at] > plan.clearance - 0.1).all()
