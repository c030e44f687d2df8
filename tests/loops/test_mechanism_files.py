"""Mechanisms as people write them: links that spin, welds in the middle of rods, errors."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mechanisms import URDF, assembled, four_bar
from urdf_text import J, X, ball, five_bar, frame

import pinsing
from pinsing.errors import JointError, OptionError, RobotFileError
from pinsing.loops import home
from pinsing.loops.closure import ranks, residual
from pinsing.robot.mechanism import Mechanism


def four_bar_in_space(weld: bool) -> list[J]:
    """A crank about z, a rod between two balls, a rocker about x: R-S-S-R, the rod in halves."""
    joints = [
        J("crank", "base", "arm"),
        *ball("s", "arm", "near", (0.3, 0, 0)),
        J("rocker", "base", "far_arm", (1, 0, 0), X),
        frame("far_end", "far_arm", (0, 0.6, 0)),
        frame("half", "near", (0.4 if weld else 0.9, 0, 0)),
    ]
    other = [*ball("t", "far_end", "far"), frame("other_half", "far", (-0.5, 0, 0))]
    return [*joints, *other] if weld else joints


@pytest.mark.parametrize("weld", [False, True])
def test_a_rod_between_two_balls_leaves_one_freedom(weld, tmp_path):
    far, kind = ("other_half", "6d") if weld else ("far_end", "3d")
    said = [("half", far)], ["crank"], "far_arm", "wx", kind, {"rocker": 0.6}
    mechanism = assembled(tmp_path, four_bar_in_space(weld), *said)
    assert ranks(mechanism).mobility == 1
    assert any("1 link spins about the own line" in note for note in mechanism.notes)
    assert np.abs(residual(mechanism, home(mechanism))).max() < 1e-10
    # The rocker's angle follows from the distance of the balls alone.
    for mode in pinsing.loops.assembly_modes(mechanism, [0.7]).modes:
        r = mode.q[mechanism.joints.index("rocker")]
        a = 0.3 * np.array([np.cos(0.7), np.sin(0.7), 0])
        b = np.array([1, 0.6 * np.cos(r), 0.6 * np.sin(r)])
        assert np.linalg.norm(b - a) == pytest.approx(0.9, abs=1e-9)


def test_joints_of_a_loop_file_stand_for_those_of_the_urdf(tmp_path):
    """The coupler of the RSSR on a ball, whose spin is held or driven, or on a universal joint."""
    text = (URDF / "rssr.loops.yaml").read_text().partition("home:")[0]
    path, q = tmp_path / "made.loops.yaml", np.array([0.3, 0.2, -0.4, 0.7])
    plain = pinsing.load_mechanism(URDF / "rssr.urdf")
    for kind, more, names, mobility in (
        ("SPHERICAL", "", ["ball_x_X", "ball_x_Y"], 1),
        ("SPHERICAL", ", ball_x_Z", ["ball_x_X", "ball_x_Y", "ball_x_Z"], 2),
        ("UJOINT_XY", "", ["ball_x_X", "ball_x_Y"], 1),
        ("UJOINT_ZY", "", ["ball_x_Z", "ball_x_Y"], None),
        ("ujoint_yx", "", ["ball_x_Y", "ball_x_X"], None),
    ):
        kinds = f"joint_name: [ball_x, ball_y]\njoint_type: [{kind}, FIXED]\n"
        path.write_text(text.replace("[crank]", f"[crank{more}]") + kinds)
        made = pinsing.load_mechanism(URDF / "rssr.urdf", path)
        assert made.joints == ("crank", *names, "rocker")
        assert mobility in (None, ranks(made).mobility)
        held = any("held at home is ball_x_Z" in note for note in made.notes)
        assert held == (kind == "SPHERICAL" and not more)
        if made.n == 4 and mobility:
            np.testing.assert_allclose(residual(made, q), residual(plain, q), atol=1e-12)


def test_a_pin_that_is_written_twice_turns_once(tmp_path):
    """Both rods of a five-bar end in the same pin, and a weld holds the two halves together."""
    pins = [J(f"pin{k}", f"P{k}", f"half{k}") for k in (1, 2)]
    joints = [*five_bar((-0.5, 0.5), 0.8, 1), *pins]
    mechanism = assembled(tmp_path, joints, [("half1", "half2")], ["q1", "q2"], kind="6d")
    assert (mechanism.n, ranks(mechanism).mobility) == (5, 2)


def test_joints_without_limits_move_without_end(tmp_path):
    joints = [
        J("q1", "base", "arm", kind="revolute", more='<limit effort="1" velocity="20"/>'),
        J("b1", "arm", "rod", (0.4, 0, 0), kind="revolute"),
        J("q2", "base", "slide", (0.5, 0, 0), X, "prismatic", more='<limit effort="1"/>'),
        frame("end", "rod", (0.6, 0, 0)),
    ]
    mechanism = assembled(tmp_path, joints, [("end", "slide")], ["q1"], "slide", "vx")
    assert np.isinf([mechanism.lower, mechanism.upper]).all()
    assert "no usable limits, so they move without end: q1, b1, q2" in mechanism.notes
    assert not any("cannot be analysed" in n or "not analysed" in n for n in mechanism.notes)
    slides = [m.q[2] for m in pinsing.loops.assembly_modes(mechanism, [np.pi / 2]).modes]
    reach = np.sqrt(0.6**2 - 0.4**2)
    np.testing.assert_allclose(sorted(slides), [-0.5 - reach, -0.5 + reach], atol=1e-9)


def test_a_joint_that_mimics_another_is_driven_or_refused(tmp_path):
    joints = [
        replace(j, more='<mimic joint="q1"/>') if j.name == "q2" else j
        for j in five_bar((-0.5, 0.5), 0.8, 1)
    ]
    loops, more = [("P1", "P2")], ("P1", "vx, vy")
    assert ranks(assembled(tmp_path, joints, loops, ["q1", "q2"], *more)).mobility == 2
    with pytest.raises(JointError, match=r"q2.*mimics another joint.*or drive it \(name_mot\)"):
        assembled(tmp_path, joints, loops, ["q1", "b2"], *more)


def test_lengths_in_millimetres_are_suspected():
    mechanism = four_bar(1700, 400, 500, 300)
    with pytest.raises(pinsing.PinsingError, match=r"up to 1.7e\+03 m; if they are in millimetres"):
        pinsing.loops.analyze_mechanism(mechanism)


GOOD = """closed_loop: [[P, P2]]
type: [3d]
name_mot: [q1, q2]
output: {frame: P, rows: [vx, vy]}
"""


def five_bar_with(tmp_path: Path, *change: str) -> Mechanism:
    """The five-bar with a loop file that is changed in one place."""
    path = tmp_path / "made.loops.yaml"
    path.write_text(GOOD.replace(*change))
    return pinsing.load_mechanism(URDF / "five_bar.urdf", path)


def test_files_of_example_parallel_robots_are_read_whole(tmp_path):
    """No output is named there, and joints of the URDF stand for balls and universal joints."""
    output, joints = "output: {frame: P, rows: [vx, vy]}\n", "joint_name: []\njoint_type: []\n"
    mechanism = five_bar_with(tmp_path, output, joints)
    assert mechanism.output == "P"
    assert any("names no output: taken is P" in note for note in mechanism.notes)
    assert ranks(mechanism).mobility == 2


@pytest.mark.parametrize(
    ("change", "line", "message"),
    [
        (("[[P, P2]]", "[[P, P3]]"), 1, "unknown frame 'P3': did you mean 'P'"),
        (("[[P, P2]]", "[[P]]"), 1, "expected a list of 2 values, found 1"),
        (("[[P, P2]]", "[[P, rod1]]"), 1, "fixed to the same link"),
        (("[3d]", "[4d]"), 2, "unknown value '4d'"),
        (("[3d]", "[3d, 3d]"), 2, "1 loops need 1 types, found 2"),
        (("[q1, q2]", "[q1, q3]"), 3, "unknown joint 'q3': did you mean"),
        (("[q1, q2]", "[q1, q1]"), 3, "given twice"),
        (("[q1, q2]", "[q1, q2, b1, b2]"), 3, "every joint is actuated"),
        (("frame: P", "frame: Q"), 4, "unknown frame 'Q'"),
        (("[vx, vy]", "[vx, xx]"), 4, "unknown value 'xx'"),
        (("[vx, vy]", "[vx, vx]"), 4, "names a row twice"),
        (("name_mot", "name_motor"), 3, "unknown key 'name_motor': did you mean 'name_mot'"),
        (("frame: P", "frame: base_link"), 4, "'base_link' is fixed to the base"),
        (("type:", "joint_name: [b1]\ntype:"), 2, "missing key 'joint_type'"),
        (("type:", "joint_name: [b9]\njoint_type: [FIXED]\ntype:"), 2, "unknown joint 'b9'"),
        (("type:", "joint_name: [b1]\njoint_type: [BALL]\ntype:"), 3, "unknown value 'BALL'"),
        (("type:", "joint_name: [b1]\njoint_type: []\ntype:"), 3, "1 joints need 1 types"),
    ],
)
def test_side_car_errors_name_the_file_and_the_line(tmp_path, change, line, message):
    with pytest.raises(RobotFileError, match=re.escape(message)) as caught:
        five_bar_with(tmp_path, *change)
    assert (caught.value.path, caught.value.line) == (tmp_path / "made.loops.yaml", line)


def test_wrong_number_of_actuators_is_said(tmp_path):
    mechanism = five_bar_with(tmp_path, "[q1, q2]", "[q1]")
    with pytest.raises(OptionError, match="2 degrees of freedom, but 1 joint is actuated"):
        pinsing.loops.analyze_mechanism(mechanism)
