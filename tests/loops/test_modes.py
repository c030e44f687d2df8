"""Modes that count, the direct and the inverse problem, limits kept."""

import itertools
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import URDF, from_model, shipped
from tiers import sampled
from urdf_text import stewart, written

import pinsing
from pinsing.errors import ConfigurationError, OptionError
from pinsing.loops import (
    analyze_mechanism,
    assembly_modes,
    curves,
    find_singular,
    home,
    mechanism_at,
    ranks,
    residual,
    working_modes,
)
from pinsing.loops.closure import BatchLoops, Loops, likeness, random_closed, same
from pinsing.loops.solve import Modes, intervals
from pinsing.robot.mechanism import Loop

SHELF = {
    # joints, closure equations written and independent, degrees of freedom
    "gough_stewart": (21, 15, 15, 6), "stewart_6_3": (21, 15, 15, 6),
    "griffis_duffy": (21, 15, 15, 6), "hexaglide": (21, 15, 15, 6), "rus6": (21, 15, 15, 6),
    "rps3": (9, 6, 6, 3), "planar_3rpr": (7, 6, 4, 3), "planar_3rrr": (7, 6, 4, 3),
    "five_bar": (4, 3, 2, 2), "four_bar": (3, 2, 2, 1), "delta": (18, 15, 15, 3),
    "agile_eye": (7, 6, 4, 3), "rssr": (4, 3, 3, 1), "bennett": (4, 6, 3, 1),
}  # fmt: skip
BASE = np.radians([-10, 10, 110, 130, 230, 250])
PLATFORM = np.radians([-50, 50, 70, 170, 190, 290])


def polar(radius, angles):
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), 0 * angles], axis=1)


@pytest.fixture(scope="module")
def platform():
    return shipped("gough_stewart")


@pytest.fixture(scope="module")
def without_limits(platform):
    return assembly_modes(platform.without_limits(), starts=120)


@pytest.mark.parametrize("name", sampled(SHELF))
def test_mobility_of_the_shelf(name):
    mechanism = shipped(name)
    joints, rows, rank, mobility = SHELF[name]
    found = ranks(mechanism)
    assert (mechanism.n, mechanism.rows) == (joints, rows)
    assert (found.constraint, found.mobility, found.output) == (rank, mobility, mobility)
    assert np.abs(residual(mechanism, home(mechanism))).max() < 1e-11


def test_a_batch_closes_a_weld_as_pinocchio_does(rng):
    mechanism = shipped("bennett")
    _, jacobians = BatchLoops(mechanism).closure(home(mechanism)[None])
    G = Loops(mechanism).scaled(home(mechanism))[1]
    np.testing.assert_allclose(np.abs(jacobians[0]), np.abs(G), atol=1e-9)


@pytest.mark.slow
def test_assembly_modes_of_the_platform_have_the_legs_asked_for(platform, without_limits):
    """Leg lengths from the pose of the output alone, by subtraction of points."""
    asked = home(platform)[list(platform.actuated)]
    base, top = polar(1.0, BASE), polar(0.6, PLATFORM)
    poses = []
    for s in without_limits.modes:
        at, R = np.array(s.pose.position), s.pose.se3.rotation
        lengths = np.linalg.norm(at + top @ R.T - base, axis=1)
        np.testing.assert_allclose(lengths, asked, atol=1e-9)
        poses.append(np.concatenate([at, R.ravel()]))
    assert len(poses) >= 8
    for a, b in itertools.combinations(poses, 2):
        assert np.abs(a - b).max() > 1e-3
    # Two ways for each of six universal joints, and two for the ball of the first leg.
    assert {s.ways for s in without_limits.modes} == {128}
    assert "from 120 starts" in without_limits.statement
    assert not without_limits.complete


def test_limits_leave_modes_out_and_say_so(platform):
    found = assembly_modes(platform, starts=150)
    assert 1 <= len(found.modes) < 8
    assert found.beyond >= 1
    assert "beyond the joint limits" in found.statement
    for s in found.modes:
        assert not platform.space.outside(s.q).any()
        assert s.ways == 1
        assert np.abs(residual(platform, s.q)).max() < 1e-10
    assert Modes.from_json(found.to_json()).statement == found.statement


@pytest.mark.slow
def test_working_modes_of_the_platform(platform):
    pose = np.array([0.05, -0.02, 1.05, 0.1, -0.05, 0.2])
    found = working_modes(platform, pose, starts=20)
    assert len(found.modes) == 1
    np.testing.assert_allclose(found.modes[0].pose.position, pose[:3], atol=1e-9)
    np.testing.assert_allclose(found.modes[0].pose.angles, pose[3:], atol=1e-9)
    both = working_modes(platform.without_limits(), pose, starts=20)
    # A leg may reach with a negative length.
    assert len(both.modes) == 64
    values = np.array([s.inputs for s in both.modes])
    np.testing.assert_allclose(np.abs(values), np.abs(values[:1]).repeat(64, axis=0), atol=1e-9)


def test_flipped_joints_are_the_same_mode(platform):
    q = home(platform)
    flipped = q.copy()
    k = platform.joints.index("u2x")
    flipped[k] += np.pi
    flipped[k + 1] = np.pi - q[k + 1]
    assert np.abs(residual(platform, flipped)).max() < 1e-12
    assert same(*likeness(platform, np.array([q, flipped])))
    a, b = mechanism_at(platform, q), mechanism_at(platform, flipped)
    assert a.input_ratio == pytest.approx(b.input_ratio, abs=1e-12)
    elbow = shipped("planar_3rrr")
    one, *others = (s.q for s in working_modes(elbow, starts=40).modes)
    assert not any(same(*likeness(elbow, np.array([one, x]))) for x in others)


def test_working_modes_of_a_3rrr_bend_each_elbow_both_ways():
    mechanism = shipped("planar_3rrr")
    found = working_modes(mechanism, starts=60)
    assert len(found.modes) == 8
    assert len({s.mode.split("elbows ")[1] for s in found.modes}) == 8


def test_architecture_singular_platforms_have_a_curve_of_poses():
    found = assembly_modes(shipped("griffis_duffy").without_limits(), starts=60)
    assert found.loose > 8
    assert "points of curves of poses" in found.statement
    assert not found.complete


def test_ranges_have_a_length_and_end_at_limits(platform):
    mechanism = shipped("planar_3rpr")
    short = mechanism.upper.copy()
    short[mechanism.joints.index("p2")] = 0.6
    tight = replace(mechanism, upper=short)
    inputs = home(tight)[list(tight.actuated)]
    found = intervals(tight, curves(tight, inputs, 1), 1)
    assert found
    assert all(i.upper > i.lower for i in found)
    assert max(i.upper for i in found) == pytest.approx(0.6, abs=1e-7)
    # Passive joints end a range too: here the first leg may not turn far.
    narrow = tight.upper.copy()
    low = tight.lower.copy()
    k = tight.joints.index("r1")
    low[k], narrow[k] = inputs[0] * 0 + home(tight)[k] - 0.02, home(tight)[k] + 0.02
    held = replace(tight, lower=low, upper=narrow)
    for t in curves(held, inputs, 1):
        assert (t.q[:, k] <= narrow[k] + 1e-7).all()
        assert (t.q[:, k] >= low[k] - 1e-7).all()
        assert max(abs(t.q[0, k] - home(tight)[k]), abs(t.q[-1, k] - home(tight)[k])) > 0.019


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        ([1.0, 2.0], "a pose of platform_center has 6 numbers"),
        (np.eye(3), "got an array"),
        (np.zeros((4, 4)), "is not a rotation"),
        ([0, 0, 1, 0, 0, 0, 0], "quaternion of the pose is zero"),
        ([0, 0, np.nan, 0, 0, 0], "not finite"),
    ],
)
def test_wrong_poses_are_said(platform, pose, message):
    with pytest.raises(ConfigurationError, match=message):
        working_modes(platform, pose)


def test_wrong_questions_are_said(platform):
    with pytest.raises(ConfigurationError, match="p1 = 9 is outside its limits"):
        assembly_modes(platform, [9.0] * 6)
    with pytest.raises(OptionError, match="starts must be 1 or more"):
        assembly_modes(platform, starts=0)
    crank = replace(shipped("five_bar"), task=shipped("four_bar").task)
    with pytest.raises(OptionError, match="a pose leaves the others open"):
        working_modes(crank)


def within(folder, name, joint, old, new):
    """A mechanism of the shelf with other limits of some joints; the path of its URDF."""
    text = (URDF / f"{name}.urdf").read_text()
    head, tail = text.split(f'name="{joint}"')
    assert old in tail
    path = folder / f"{name}.urdf"
    path.write_text(f'{head}name="{joint}"{tail.replace(old, new, 1)}')
    (folder / f"{name}.loops.yaml").write_text((URDF / f"{name}.loops.yaml").read_text())
    return path


@pytest.mark.slow
def test_home_is_found_within_narrow_limits(tmp_path):
    """Few of the configurations that close the loops keep the limits of all joints."""
    rng = np.random.default_rng(0)
    base, top = (np.round(rng.uniform(-a, a, (6, 3)), 2) * [1, 1, 0] for a in (1, 0.6))
    joints, text = stewart(base, top, limits=(0.3, 2.5))
    tight = [
        replace(j, kind="revolute", limits=(-0.5, 0.5)) if j.kind == "continuous" else j
        for j in joints
    ]
    mechanism = pinsing.load_mechanism(written(tmp_path, tight, text))
    inside = [q for q in random_closed(mechanism, 60, rng) if not mechanism.space.outside(q).any()]
    assert not inside
    q = home(mechanism)
    assert np.abs(residual(mechanism, q)).max() < 1e-9
    assert (q >= mechanism.lower).all()
    assert (q <= mechanism.upper).all()


@pytest.mark.slow
def test_the_platform_is_analysed_once_over(platform):
    found = analyze_mechanism(platform)
    assert found.mobility == 6
    for name, ranges in found.ranges.items():
        assert ranges, name
        assert all(i.upper - i.lower > 1e-3 and i.lower >= 0.3 - 1e-9 for i in ranges)
    marks = likeness(platform, np.array([p.q for p in found.points]))
    assert not any(same(a, b) for a, b in itertools.combinations(marks, 2))
    assert not any(platform.space.outside(p.q, 1e-6).any() for p in found.points)
    text = str(found)
    assert "u1x =" not in text  # values of joints; determinants may name some
    assert "s1z" in found.to_json() or "s1z" in found.joints


@pytest.mark.slow
def test_a_curve_that_is_singular_throughout_is_told_once():
    # The Agile Eye: the output turns with the inputs held where one input is at a right angle and
    # the next two are at 0; and there are orientations in which the inputs do not move it at all.
    found = analyze_mechanism(shipped("agile_eye"))
    assert len(found.points) < 120
    for k, name in enumerate(("a1", "a2", "a3")):
        whole = [p for p in found.points if p.whole_curve and p.moving == name]
        at = {tuple(np.degrees(p.inputs).round(6) + 0.0) for p in whole if p.kind == "type 3"}
        assert at == {tuple(v * np.eye(3)[k] + 0.0) for v in (90.0, -90.0)}
        assert any(p.kind == "type 1" for p in whole)
    text = str(found)
    assert "(the whole curve through it)" in text
    # The equations are as long as they are: what is told of points is short.
    assert len(text[: text.index("Closed forms")].splitlines()) < 133


@pytest.mark.slow
@pytest.mark.parametrize("case", ["rssr", "stewart"])
def test_flipped_joints_are_no_curves_of_their_own(case, tmp_path):
    if case == "rssr":
        mechanism = shipped("rssr").without_limits()
    else:
        drawn = np.random.default_rng(3).uniform(-1, 1, (2, 6, 3))
        points = np.round(drawn * [1, 1, 0.2] * [[[1.0]], [[0.5]]], 2)
        made = stewart(*points, limits=(0.05, 5))
        mechanism = pinsing.load_mechanism(written(tmp_path, *made))
    inputs = home(mechanism)[list(mechanism.actuated)]
    found = curves(mechanism, inputs, 0)
    assert 1 <= len(found) < 8
    for one, other in itertools.permutations(found, 2):
        marks = likeness(mechanism, other.q)
        steps = np.linalg.norm(np.diff(marks, axis=0), axis=1).max()
        for q in one.q[:: max(1, len(one.q) // 5)]:
            away = np.linalg.norm(marks - likeness(mechanism, q[None]), axis=1).min()
            assert away > 0.05 * steps


@pytest.mark.slow
@pytest.mark.parametrize(("moving", "seed"), [*itertools.product(range(3), (20, 7))])
def test_every_arm_of_a_delta_has_the_same_singular_points_whatever_is_drawn(moving, seed):
    """Few random starts are within the limits before universal joints are flipped."""
    mechanism = shipped("delta")
    traces = curves(mechanism, home(mechanism)[list(mechanism.actuated)], moving, seed=seed)
    (whole,) = intervals(mechanism, traces, moving)
    assert (whole.lower, whole.upper) == pytest.approx((-2.4, 2.4))
    points = find_singular(mechanism, traces)
    at = {k: [p.inputs[moving] for p in points if p.kind == k] for k in ("type 1", "type 2")}
    one = [-1.59077, -1.53324, -1.53324, -0.71368, 1.58631, 1.58631, 1.64293, 2.32444]
    assert at["type 1"] == pytest.approx(one, abs=1e-5)
    assert at["type 2"] == pytest.approx([-1.55225, -0.73172, 1.60419, 2.33931], abs=1e-5)
    assert all(mechanism_at(mechanism, p.q).kind == p.kind for p in points)


def test_points_of_a_curve_on_which_a_leg_moves_by_itself_are_one_mode():
    """Sarrus: both chains folded the second turns freely; unfolded its elbow has two sides."""
    model = pin.Model()
    model.name = "sarrus"
    ends = []
    for name, turn in (("x", 0.0), ("y", np.pi / 2)):
        parent = 0
        place = pin.SE3(pin.rpy.rpyToMatrix(0, 0, turn), np.zeros(3))
        for k, reach in enumerate((0.4, 0.4, 0.0), 1):
            parent = model.addJoint(parent, pin.JointModelRUBX(), place, f"{name}{k}")
            place = pin.SE3(np.eye(3), np.array([0.0, 0.0, reach]))
        back = pin.SE3(pin.rpy.rpyToMatrix(0, 0, -turn), np.zeros(3))
        model.addFrame(pin.Frame(f"{name}_end", parent, 0, back, pin.FrameType.OP_FRAME))
        ends.append(f"{name}_end")
    start = {"x1": -0.6, "x2": 1.2, "x3": -0.6, "y1": 0.6, "y2": -1.2, "y3": 0.6}
    made = from_model(model, [Loop(*ends, "6d")], ["x1"], "x_end", "vz", home=start)
    found = assembly_modes(made)
    folded = [s for s in found.modes if abs(s.pose.position[2]) < 1e-6]
    assert len(found.modes) == 3
    assert len(folded) == 1
    assert sorted(
        s.q[made.joints.index("y1")].round(6) for s in found.modes if s not in folded
    ) == [-0.6, 0.6]
    assert "at 1 of them a leg moves by itself" in found.statement
