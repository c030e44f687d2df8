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
from tiers import tiered, tiered_rows

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


def around(arm, q, count, radius, every=1, tool=FLANGE):
    """Poses of a tool along a circle that begins at a configuration, its rotation kept."""
    T = np.tile(*poses_of(arm, q, tool=tool), (count, 1, 1))
    a = np.linspace(0, 2 * np.pi, count)
    T[:, :2, 3] += radius * np.stack([np.cos(a) - 1, np.sin(a)], axis=1)
    return T[::every]


def between(arm, begin, end, count, tool=FLANGE):
    """Poses of a tool on the straight way from one configuration to another."""
    return poses_of(arm, *np.linspace(begin, end, count), tool=tool)


def circle(count, radius=0.12):
    """Poses of the torch of a UR5 along a circle, its rotation kept."""
    return around(pinsing.load("ur5"), START, count, radius, tool=TORCH)


def turned(angle):
    """A turn about z, as a matrix."""
    return pin.SE3(pin.utils.rotate("z", angle), np.zeros(3)).homogeneous


def reached(arm, plan, T, tool):
    """The path's configurations are at the poses, turned about the tool's z by its values."""
    for q, value, pose in zip(plan.q, plan.values, T, strict=True):
        goal = pose @ turned(value if plan.free == "roll" else 0.0)
        np.testing.assert_allclose(tip_placement(arm, q).homogeneous @ tool, goal, atol=1e-7)
    if plan.free in arm.joints:
        there = plan.q[:, arm.joints.index(plan.free)]
        np.testing.assert_allclose(there, plan.values, atol=1e-9)


def only_within(plan, form):
    """The path meets no family, leaves no limit, and makes no jump."""
    check = pinsing.check_trajectory(form.loaded, plan.q, forms=form)
    assert not check.crossings
    assert not check.outside
    assert not check.jumps


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


IRB120 = [-1.0, -1.62, 0.48, -1.84, -1.54, np.pi - 1.85]
IRB1200 = (
    [2.5787, 2.0684, -0.1198, -2.3086, -2.2167, -2.9245],
    [2.6759, 2.0843, 0.3056, -2.1356, -2.268828, -2.8727],
)
KR10 = [-1.173, -1.226, 0.111, -1.083, -1.222, 1.367], [-1.427, -1.72, 1.094, -1.081, -1.271, 1.254]
KR10_TOOL = pin.SE3(pin.rpy.rpyToMatrix(0.701, -0.808, -0.369), np.array([-0.11, -0.088, 0.02]))
IIWA7 = (
    [-2.07, -1.1, 1.51, 0.34, -2.03, -0.28, -0.1],
    [-2.16, -1.45, 2.84, 0.43, -2.17, -0.39, -0.37],
)
PANDA = [-0.83, -0.46, 0.6, -1.45, -0.81, 1.74, -0.04]
ENDS = [-1.03, -0.75, 0.67, 3.01, -0.13, 1.26, -1.9], [-1.03, -0.67, 0.62, 2.95, -0.27, 0.88, -2.26]
TURN = [-2.32, 1.86, 2.27, 1.36, 1.63, 0.34, 0.22], [-1.9, 1.79, 2.34, 1.58, 1.71, 0.12, 0.71]
# The example of docs/how-to/toolpath.md.
APART = [[0.4, -0.15, 0.1], [0.45, -0.05, 0.1], [0.45, 0.05, 0.1], [0.4, 0.15, 0.1]]
ROLL, LAST = {"free": "roll", "tool": TORCH}, {"free": 6}


def downwards(_, places):
    """Poses at these places, with the tool's z axis down."""
    T = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (len(places), 1, 1))
    T[:, :3, 3] = places
    return T


PLANS = {
    # A value on the grid is beyond a limit, and part of the way from it to the next is not.
    "a limit": ("irb120", around, (IRB120, 12, 0.025, 3, TORCH), ROLL, (5, 1), 55),
    # Between a value and where its branch turns back.
    "3 poses": ("panda", around, (BENT_PANDA, 3, 0.12), LAST, (10, 2), 80),
    "8 poses": ("panda", around, (BENT_PANDA, 8, 0.12), LAST, (10, 2), 80),
    # Where the branch moves fast along the joint.
    "60 poses": ("panda", around, (PANDA, 60, 0.12), LAST, (3,), 0),
    # Where branches end, or a joint goes through half a turn, finer paths had 0.4 degrees more.
    "an end": ("xarm7", between, (*ENDS, 9), LAST, (5, 1.25), 46),
    "half a turn": ("xarm7", between, (*TURN, 7), LAST, (20, 5), 87),
    # Motions that are long at both ends: of short ones there is a path of 8 degrees.
    "long motions": ("kr10_r1100", between, (*KR10, 2, KR10_TOOL.homogeneous),
                     {"free": "roll", "tool": KR10_TOOL.homogeneous}, (10, 3), 20),
    # A motion of 29 degrees, where the clearances at the ends add up to less than 20.
    "29 degrees": ("irb1200", between, (*IRB1200, 2), {"free": "roll", "start": IRB1200[0]},
                   (60,), 7.9),
    "29 degrees, kept": ("irb1200", between, (*IRB1200, 2), {"start": IRB1200[0]}, (60,), 7.9),
    # Whose clearance between poses is looked at in three places: 11.9 degrees of 19.5 were left.
    "as good": ("iiwa7", between, (*IIWA7, 4), {"free": 1, "start": IIWA7[0]}, (2.865,), 19),
    "far apart": ("ur5", downwards, (APART,), ROLL, (20, 4), 70.9),
}  # fmt: skip


@pytest.mark.parametrize("case", tiered(PLANS, {"a limit", "as good"}))
def test_a_path_is_clear_and_none_on_another_grid_is_better_than_its_bound(case):
    """At least as clear as was found by hand, and the finest grid has what its bound is near."""
    name, build, given, options, steps, least = PLANS[case]
    form = known(name)
    T, free = build(form.loaded, *given), options.get("free", "branch")
    options = {**options, "free": form.loaded.joints[free] if isinstance(free, int) else free}
    plans = [plan_path(form, T, step=np.radians(s), **options) for s in steps]
    for plan in plans:
        reached(form.loaded, plan, T, options.get("tool", FLANGE))
        only_within(plan, form)
        idle = any("changes no clearance, only whether that joint" in x for x in plan.notes)
        assert idle == (case == "29 degrees")  # the roll about the axis of the last joint
    clear, bounds = np.degrees([[p.clearance for p in plans], [p.bound for p in plans]])
    assert least < clear.min() <= clear.max() <= bounds.min()
    assert bounds[-1] - clear[-1] < 1


def written(file, T):
    """A file of poses."""
    rows = [[*P[:3, 3], *pin.Quaternion(P[:3, :3]).coeffs()] for P in T]
    np.savetxt(file, rows, delimiter=",", header="x,y,z,qx,qy,qz,qw", comments="")
    return file


TURNS = [
    # arm, where it begins, turns about the last joint's axis, whether its value there is given
    ("ur5", [*START], 1.9, False, True),
    ("ur5", [*START], 2.1, False, False),
    ("ur5", [*START[:5], -6.0], 1.5, True, True),
    ("ur5", [*START[:5], -1.0], 1.5, True, False),
    ("gen3_6", [0.2, 0.5, -1.2, 0.4, 0.9, 0.1], 4.0, False, True),
]


@pytest.mark.parametrize(("name", "q", "turns", "told", "ends"), tiered_rows(TURNS, TURNS[2:4]))
def test_a_joint_turns_as_far_as_a_path_needs_and_its_limits_let_it(name, q, turns, told, ends):
    """Two turns of a UR5's wrist; four of a joint without limits were called degrees."""
    form = known(name)
    spin = np.array([turned(a) for a in np.linspace(0, 2 * np.pi * turns, 40)])
    T = poses_of(form.loaded, q) @ spin
    plan = plan_path(form, T, start=q if told else None)
    assert bool(len(plan.q)) == ends
    assert ("winds wrist_3_joint beyond its limits" in plan.reason) != ends
    if ends:
        reached(replace(form.loaded, units="rad"), plan, T, FLANGE)
        assert not form.loaded.space.outside(plan.q).any()
        np.testing.assert_allclose(np.ptp(plan.q, axis=0), [0] * 5 + [2 * np.pi * turns], atol=1e-6)
        assert not told or np.allclose(plan.q[0], q, atol=1e-6)
        path_sheet(plan, form)


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


@pytest.mark.slow
def test_turns_that_nothing_needs_are_left_out():
    a = np.linspace(0, np.pi / 2, 4)
    T = np.array([turned(x) for x in a])
    T[:, :3, :3] = T[:, :3, :3] @ pin.utils.rotate("y", np.pi + 0.5)
    T[:, :3, 3] = np.stack([0.4 + 0.15 * np.cos(a), 0.15 * np.sin(a), 0.2 + 0 * a], axis=1)
    form = known("gen3_6")
    plan = plan_path(form, T, free="roll", step=np.radians(20), tool=TORCH)
    reached(form.loaded, plan, T, TORCH)
    assert np.abs(plan.q[0]).max() <= np.pi


OFTEN = [(name, None, 10_000) for name in ("ur5", "puma560", "z1", "aubo_i5")]
FEW = [("aubo_i5", None, 2), ("gen3_7", 5, 2)]


@pytest.mark.parametrize(("name", "held", "count"), tiered_rows([*FEW, *OFTEN], FEW))
def test_eaik_misses_nothing_that_ours_finds(name, held, count, monkeypatch):
    """It takes one of opposite axes for the other, or knows zero alone where joints line up."""
    arm = pinsing.load(name)
    many = InverseMany(arm, held)
    assert many.exact == (held is None)
    Q = np.random.default_rng(3).uniform(-2.5, 2.5, (count, arm.n))
    Q = np.clip(Q, arm.space.span[0], arm.space.span[1])
    values = None
    if held is not None:
        Q[:, held] = values = np.array([0.7])
    T = poses_of(arm, *Q)
    found = many.solve(T[:, None, :3, 3], T[:, None, :3, :3], values)[:, 0]
    apart = np.abs(arm.space.wrap(found - Q[:, None])).max(axis=-1)
    assert np.nan_to_num(apart, nan=np.inf).min(axis=1).max() < 1e-5
    monkeypatch.setattr(sys.modules["pinsing.kinematics.inverse"], "decomposed", lambda *_: None)
    for k, pose in enumerate(T[:60]):
        here = found[k][np.isfinite(found[k][:, 0])]
        for q in here:
            np.testing.assert_allclose(tip_placement(arm, q).homogeneous, pose, atol=1e-8)
        ours = [s for s in pinsing.inverse(arm, pose) if s.regular] if held is None else ()
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
REFUSED = [
    ("ur5", {"place": {}}, OptionError, "needs a range"),
    ("ur5", {"place": {"x": (0.1, 0.1)}}, OptionError, "x needs two ascending values"),
    ("ur5", {"place": {"z": (0.1, np.inf)}}, OptionError, "z needs two ascending values"),
    ("ur5", {"place": {"yaw": (-30, 30)}}, OptionError, "over a turn"),
    ("ur5", {"place": {"x": (0, 1)}, "start": START}, OptionError, "give one of them"),
    ("ur5", {"free": "elbow"}, OptionError, "neither branch, roll, nor a joint"),
    ("ur5", {"poses": SHEARED}, ConfigurationError, "poses: number 1 is no rigid motion"),
    ("ur5", {"without": "kernel"}, EngineError, "toolpaths need the compiled kernel"),
    ("panda", {"free": "roll"}, OptionError, r"7 free joints .* may be one of panda_joint1, "),
    # With its elbow held an arm reaches poses of one distance from its shoulder alone.
    ("iiwa7", {"free": "q4"}, OptionError, r"q4 held do not move .* one of q1, q2, q3, q5, q6, q7"),
]


@pytest.mark.parametrize(("name", "options", "error", "said"), tiered_rows(REFUSED, REFUSED[:8]))
def test_what_makes_no_sense_is_refused(monkeypatch, name, options, error, said):
    if options.pop("without", None):
        monkeypatch.setattr(engine, "available", lambda: False)
    with pytest.raises(error, match=said):
        plan_path(known(name), **{"poses": TWO, **options})


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
def test_the_picture_has_what_the_best_branch_has_along_the_path_and_away_from_it(form):
    # Where estimates of nodes are 15 degrees too high.
    T = downwards(form.loaded, APART)
    plan = plan_path(form, T, free="roll", step=np.radians(4), tool=TORCH)
    for k, i in ((0, 7), (1, 50), (3, 75)):
        every = pinsing.inverse(form.loaded, T[k] @ turned(plan.grid[i]) @ np.linalg.inv(TORCH))
        most = max(pinsing.clearance(form, s.q, certify=True).upper for s in every)
        assert most - 1e-6 < plan.room[k, i] < most + np.radians(16)


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


def test_what_is_divided_is_left_as_it_was(form):
    """A search of the parts forgot from which nodes all motions to a pose far away begin."""
    whole = _Planner(form, form.loaded, circle(5, 0.2), np.linalg.inv(TORCH), "roll",
                     np.radians(60), None, lambda *_: None)  # fmt: skip
    whole._chosen()
    sources = [*whole.pool]
    whole.finer(whole.reached, whole.relaxed).path()
    assert any(x is not None for x in sources)
    assert whole.pool == sources


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
    only_within(plan, form)
    beside = np.stack([np.roll(plan.room, turn, axis=1) for turn in (1, -1)])
    assert np.degrees(plan.room - beside.max(axis=0)).max() < 1
    assert np.degrees(beside.min(axis=0) - plan.room).max() < 1


def test_no_path_within_joint_speeds_is_no_error():
    """Values were divided of poses that nothing leads to."""
    rows = np.array([
        [0.22494, -0.73719, -0.78004, -3.14159, -1.3491, -1.97052],
        [0.25465, -0.75033, -0.79629, 2.78169, -1.44361, -1.813],
        [0.19979, -0.74037, -0.74761, 3.13976, -1.1354, -1.81738],
        [0.25217, -0.75051, -0.84458, 0.74887, -1.31986, 0.21355],
        [0.21563, -0.776, -0.70583, 2.82328, -0.77003, -1.58401],
        [-0.07441, -0.04022, -0.0754, 0.09137, 0.12567, 0.21823],
    ])  # fmt: skip
    *T, tool = (pin.SE3(pin.rpy.rpyToMatrix(*x[3:]), x[:3]).homogeneous for x in rows)
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
