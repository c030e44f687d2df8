"""Modes that count, the direct and the inverse problem, limits kept, driving by the inputs."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import analyzed, four_bar, hexagons, linkage, planar_chains, shipped
from platforms import ups
from tiers import tiered
from urdf_text import J, X, stewart, written

import pinsing
from pinsing import loops
from pinsing.errors import ConfigurationError, OptionError, PinsingError
from pinsing.loops import closure, motion
from pinsing.loops.analysis import locus_distance
from pinsing.loops.solve import drive, intervals, trace
from pinsing.robot.mechanism import Mechanism
from pinsing.robot.task import parse_task

STEWART = shipped("gough_stewart")


@pytest.mark.slow
def test_assembly_modes_of_the_platform_have_the_legs_asked_for():
    """Leg lengths from the pose of the output alone, by subtraction of points."""
    without_limits = loops.assembly_modes(STEWART.without_limits(), starts=120)
    asked = loops.home(STEWART)[list(STEWART.actuated)]
    base, top = hexagons("gough_stewart")
    places = np.array([s.pose.se3.homogeneous for s in without_limits.modes])
    ends = places[:, None, :3, 3] + top @ places[:, :3, :3].transpose(0, 2, 1)
    np.testing.assert_allclose(np.linalg.norm(ends - base, axis=2), [asked] * len(ends), atol=1e-9)
    assert len(places) >= 8
    for a, b in itertools.combinations(places, 2):
        assert np.abs(a - b).max() > 1e-3
    # Two ways for each of six universal joints, and two for the ball of the first leg.
    assert {s.ways for s in without_limits.modes} == {128}
    assert "from 120 starts" in without_limits.statement
    assert not without_limits.complete


def test_limits_leave_modes_out_and_say_so():
    found = loops.assembly_modes(STEWART, starts=150)
    assert 1 <= len(found.modes) < 8
    assert found.beyond >= 1
    assert "beyond the joint limits" in found.statement
    for s in found.modes:
        assert not STEWART.space.outside(s.q).any()
        assert s.ways == 1
        assert np.abs(loops.residual(STEWART, s.q)).max() < 1e-10


@pytest.mark.slow
def test_working_modes_of_the_platform():
    pose = np.array([0.05, -0.02, 1.05, 0.1, -0.05, 0.2])
    found = loops.working_modes(STEWART, pose, starts=20)
    (mode,) = found.modes
    np.testing.assert_allclose([*mode.pose.position, *mode.pose.angles], pose, atol=1e-9)
    both = loops.working_modes(STEWART.without_limits(), pose, starts=20)
    # A leg may reach with a negative length.
    lengths = np.abs([s.inputs for s in both.modes])
    np.testing.assert_allclose(lengths, np.tile(lengths[:1], (64, 1)), atol=1e-9)


def test_flipped_joints_are_the_same_mode():
    q = loops.home(STEWART)
    flipped = q.copy()
    k = STEWART.joints.index("u2x")
    flipped[k] += np.pi
    flipped[k + 1] = np.pi - q[k + 1]
    assert np.abs(loops.residual(STEWART, flipped)).max() < 1e-12
    assert closure.same(*closure.likeness(STEWART, np.array([q, flipped])))
    a, b = loops.mechanism_at(STEWART, q), loops.mechanism_at(STEWART, flipped)
    assert a.input_ratio == pytest.approx(b.input_ratio, abs=1e-12)


def test_architecture_singular_platforms_have_a_curve_of_poses():
    found = loops.assembly_modes(shipped("griffis_duffy").without_limits(), starts=60)
    assert found.loose > 8
    assert "points of curves of poses" in found.statement
    assert not found.complete


def test_ranges_have_a_length_and_end_at_limits():
    mechanism = shipped("planar_3rpr")
    short = mechanism.upper.copy()
    short[mechanism.joints.index("p2")] = 0.6
    tight = replace(mechanism, upper=short)
    q = loops.home(tight)
    inputs = q[list(tight.actuated)]
    found = intervals(tight, loops.curves(tight, inputs, 1), 1)
    assert all(i.upper > i.lower for i in found)
    assert max(i.upper for i in found) == pytest.approx(0.6, abs=1e-7)
    # Passive joints end a range too: here the first leg may not turn far.
    turns = 0.02 * (np.array(tight.joints) == "r1")
    bounds = (np.where(turns, q + s * turns, x) for s, x in ((-1, tight.lower), (1, tight.upper)))
    held = replace(tight, **dict(zip(("lower", "upper"), bounds, strict=True)))
    for t in loops.curves(held, inputs, 1):
        gaps = np.abs(t.q - q)[:, turns > 0]
        assert gaps.max() <= 0.02 + 1e-7
        assert gaps[[0, -1]].max() > 0.019


CRANK = replace(shipped("five_bar"), task=shipped("four_bar").task)
OPEN = [0.0, 0.0, np.pi, 0.0]


@pytest.mark.parametrize(
    ("ask", "given", "error", "words"),
    [
        (loops.working_modes, (STEWART, [1, 2]), ConfigurationError, "center has 6 numbers"),
        (loops.working_modes, (STEWART, np.eye(3)), ConfigurationError, "got an array"),
        (loops.working_modes, (STEWART, np.zeros((4, 4))), ConfigurationError, "is not a rotation"),
        (loops.working_modes, (STEWART, np.eye(7)[2]), ConfigurationError, "quaternion of"),
        (loops.working_modes, (STEWART, [0, 0, np.nan, 0, 0, 0]), ConfigurationError, "not finite"),
        (loops.working_modes, (CRANK,), OptionError, "a pose leaves the others open"),
        (loops.assembly_modes, (STEWART, [9.0] * 6), ConfigurationError, "p1 = 9 is outside its"),
        (loops.assembly_modes, (STEWART, None, 0), OptionError, "starts must be 1 or more"),
        (trace, (shipped("five_bar"), OPEN, 0), PinsingError, "do not close at the start"),
    ],
)
def test_wrong_questions_are_said(ask, given, error, words):
    with pytest.raises(error, match=words):
        ask(*given)


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
    inside = [
        q for q in closure.random_closed(mechanism, 60, rng) if not mechanism.space.outside(q).any()
    ]
    assert not inside
    q = loops.home(mechanism)
    assert np.abs(loops.residual(mechanism, q)).max() < 1e-9
    assert not mechanism.space.outside(q).any()


@pytest.mark.slow
def test_the_platform_is_analysed_once_over():
    found = loops.analyze_mechanism(STEWART)
    assert found.mobility == 6
    for name, ranges in found.ranges.items():
        assert ranges, name
        assert all(i.upper - i.lower > 1e-3 and i.lower >= 0.3 - 1e-9 for i in ranges)
    marks = closure.likeness(STEWART, np.array([p.q for p in found.points]))
    assert not any(closure.same(a, b) for a, b in itertools.combinations(marks, 2))
    assert not any(STEWART.space.outside(p.q, 1e-6).any() for p in found.points)
    assert "u1x =" not in str(found)  # values of joints; determinants may name some
    assert "s1z" in found.to_json() or "s1z" in found.joints


@pytest.mark.slow
def test_a_curve_that_is_singular_throughout_is_told_once():
    # The Agile Eye: the output turns with the inputs held where one input is at a right angle and
    # the next two are at 0; and there are orientations in which the inputs do not move it at all.
    found = loops.analyze_mechanism(shipped("agile_eye"))
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
        mechanism = ups(tmp_path, *points, limits=(0.05, 5))
    inputs = loops.home(mechanism)[list(mechanism.actuated)]
    found = loops.curves(mechanism, inputs, 0)
    assert 1 <= len(found) < 8
    for one, other in itertools.permutations(found, 2):
        marks = closure.likeness(mechanism, other.q)
        steps = np.linalg.norm(np.diff(marks, axis=0), axis=1).max()
        for q in one.q[:: max(1, len(one.q) // 5)]:
            away = np.linalg.norm(marks - closure.likeness(mechanism, q[None]), axis=1).min()
            assert away > 0.05 * steps


@pytest.mark.slow
@pytest.mark.parametrize(("moving", "seed"), [*itertools.product(range(3), (20, 7))])
def test_every_arm_of_a_delta_has_the_same_singular_points_whatever_is_drawn(moving, seed):
    """Few random starts are within the limits before universal joints are flipped."""
    mechanism = shipped("delta")
    traces = loops.curves(
        mechanism, loops.home(mechanism)[list(mechanism.actuated)], moving, seed=seed
    )
    (whole,) = intervals(mechanism, traces, moving)
    assert (whole.lower, whole.upper) == pytest.approx((-2.4, 2.4))
    points = loops.find_singular(mechanism, traces)
    at = {k: [p.inputs[moving] for p in points if p.kind == k] for k in ("type 1", "type 2")}
    one = [-1.59077, -1.53324, -1.53324, -0.71368, 1.58631, 1.58631, 1.64293, 2.32444]
    assert at["type 1"] == pytest.approx(one, abs=1e-5)
    assert at["type 2"] == pytest.approx([-1.55225, -0.73172, 1.60419, 2.33931], abs=1e-5)
    assert all(loops.mechanism_at(mechanism, p.q).kind == p.kind for p in points)


def test_points_of_a_curve_on_which_a_leg_moves_by_itself_are_one_mode():
    """Sarrus: both chains folded the second turns freely; unfolded its elbow has two sides."""
    joints = []
    for name, turn in (("x", 0.0), ("y", np.pi / 2)):
        link, at, rpy = "base", (0, 0, 0), (0, 0, turn)
        for k, reach in enumerate((0.4, 0.4, 0.0), 1):
            joints.append(J(f"{name}{k}", link, f"{name}_{k}", at, X, rpy=rpy))
            link, at, rpy = f"{name}_{k}", (0, 0, reach), (0, 0, 0)
        joints.append(J(f"{name}_at", link, f"{name}_end", kind="fixed", rpy=(0, 0, -turn)))
    start = {"x1": -0.6, "x2": 1.2, "x3": -0.6, "y1": 0.6, "y2": -1.2, "y3": 0.6}
    made = linkage(joints, [("x_end", "y_end")], ["x1"], "x_end", "vz", "6d", home=start)
    found = loops.assembly_modes(made)
    folded, *others = sorted(found.modes, key=lambda s: abs(s.pose.position[2]))
    assert abs(folded.pose.position[2]) < 1e-6
    assert sorted(s.q[made.joints.index("y1")].round(6) for s in others) == [-0.6, 0.6]
    assert "at 1 of them a leg moves by itself" in found.statement


NAMES = ["five_bar", "four_bar", "planar_3rrr"]


def moved(mechanism: Mechanism, q: np.ndarray, k: int, value: float) -> np.ndarray:
    inputs = q[list(mechanism.actuated)].copy()
    inputs[k] = value
    return inputs


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_long_drags_never_change_the_assembly_mode(name: str, rng: np.random.Generator) -> None:
    mechanism = shipped(name)
    q = loops.home(mechanism)
    mode, stopped = motion.assembly_sign(mechanism, q), 0
    for _ in range(60):
        k = int(rng.integers(len(mechanism.inputs)))
        here = q[mechanism.actuated[k]]
        found = drive(mechanism, moved(mechanism, q, k, here + rng.uniform(-1.5, 1.5)), q)
        assert np.abs(loops.residual(mechanism, found.q)).max() < 1e-9
        assert motion.assembly_sign(mechanism, found.q) == mode
        if not found.converged:
            stopped += 1
            # It stops where the mode ends.
            assert motion.motions(mechanism, found.q).input_ratio < 0.02
        q = mechanism.fold(found.q)
    assert 5 < stopped < 55


@pytest.mark.parametrize("name", tiered(NAMES, ("four_bar",)))
def test_type_2_is_left_to_where_the_loops_close(name: str) -> None:
    mechanism = shipped(name)
    ends = [p for p in analyzed(name).points if p.range_end]
    assert ends
    for point in ends:
        k = mechanism.inputs.index(point.moving)
        goals = (moved(mechanism, point.q, k, point.inputs[k] + step) for step in (-0.1, 0.1))
        ways = {w.converged: w for w in (drive(mechanism, x, point.q) for x in goals)}
        assert set(ways) == {False, True}
        assert motion.motions(mechanism, ways[True].q).kind() == "regular"


def _locked(name, middle, rng):
    """Closed configurations at which the middle hinge of a ball is at a right angle."""
    mechanism = shipped(name).without_limits()
    closing, free = closure.BatchLoops(mechanism), np.array(mechanism.joints) != middle
    Q = rng.uniform(-1, 1, (80, mechanism.n)) * np.where(mechanism.prismatic, 1, np.pi)
    Q[:, ~free] = np.pi / 2
    found, error = closure.newton(closing, Q, free)
    return mechanism, closing, found[error <= 1e-11]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rps3", "delta", "gough_stewart"])
def test_a_gimbal_lock_is_singular_only_where_the_pose_is(name, rng):
    mechanism, closing, Q = _locked(name, "s1y", rng)
    assert len(Q) > 5
    ball = [mechanism.joints.index(x) for x in ("s1x", "s1y", "s1z")]
    forms = loops.pose_forms(mechanism)
    many = motion.measure_many(closing, Q)
    told = set()
    for q, kind, two in zip(Q, motion.kinds_of(many), many[1], strict=True):
        # The hinges turn idly, the loops closed: as written this would be of type 2.
        columns = closing.closure(q[None])[1][0][:, ball]
        assert np.linalg.svd(columns, compute_uv=False)[-1] < 1e-9
        state = loops.mechanism_at(mechanism, q)
        assert kind == ("near" if state.near else state.kind)
        assert two == pytest.approx(state.input_ratio, rel=1e-7, abs=1e-11)
        told.add(state.kind)
        if name != "delta":  # its equation is of the output that does not turn
            assert (state.kind != "regular") == (locus_distance(mechanism, forms, q) < 1e-9)
    # Hinges of the base across the ball's: a 3-RPS is of type 2 wherever that ball locks.
    assert ("type 2" in told) if name == "rps3" else (told == {"regular"})


def test_beside_a_lock_measures_go_on_smoothly(rng):
    """With balls whole a measure does not fall to zero with the angle to the lock."""
    mechanism, closing, Q = _locked("gough_stewart", "s1y", rng)
    middle = np.array(mechanism.joints) == "s1y"
    at = motion.motions(mechanism, Q[0]).input_ratio
    found, error = closure.newton(closing, Q[0] + np.outer([1e-3, 1e-5, 1e-7], middle), ~middle)
    assert error.max() <= 1e-11
    for q in found:
        assert motion.motions(mechanism, q).input_ratio == pytest.approx(at, rel=0.2)


def test_a_driven_elbow_is_told_like_another() -> None:
    links = {"one": ((0.0, 0.0), [("a", 0.6), ("b", 0.7)]),
             "two": ((1.0, 0.0), [("c", 0.6), ("d", 0.7)])}  # fmt: skip
    closing = [("one_end", "two_end")]
    made = linkage(planar_chains(links), closing, ["a", "b", "c"], "one_end", "vx,vy")
    found = loops.working_modes(made, closure.output_pose(made, loops.home(made)).homogeneous).modes
    assert len({s.mode for s in found}) == len(found) == 4


def test_only_what_the_output_can_do_is_led() -> None:
    """A turn about one axis is an angle; of what is coupled, as many rows as there are freedoms."""
    assert motion.led_pose(shipped("delta")) == {"rows": [0, 1, 2], "turn": None}
    assert motion.led_pose(shipped("gough_stewart"))["turn"] == {"kind": "full"}
    assert motion.led_pose(shipped("rps3")) == {"rows": [2, 3, 4], "turn": {"kind": "angles"}}
    assert motion.led_pose(shipped("planar_3rrr"))["turn"]["kind"] == "axis"
    four = replace(four_bar(0.9, 0.3, 0.8, 0.6), output="one_end", task=parse_task("vx,vy,wz"))
    assert len(motion.led_pose(four)["rows"]) == 1


def test_what_has_an_elbow() -> None:
    """A leg on a sphere, and a rod that leaves the plane of its crank; no leg that lengthens."""
    for name, number, mode in (
        ("agile_eye", 3, "assembly +, elbows ---"),
        ("rssr", 1, "assembly +, elbows +"),
        ("gough_stewart", 0, "assembly +"),
    ):
        mechanism = shipped(name)
        assert len(motion.elbows(mechanism)) == number
        assert motion.mode_of(mechanism, loops.home(mechanism)) == mode
