"""Chains with mimic joints: closed forms follow them, or say which they cannot follow."""

import numpy as np
import pytest
from command_line import run
from singular_sets import check_all
from tiers import tiered_rows
from urdf_text import J, frame, urdf

from pinsing.families import closed_form
from pinsing.robot.load import load
from pinsing.robot.mimic import NotFollowed, drives
from pinsing.robot.nominal import nominal

Z = "0 0 1"


def robot(joints, task="pose"):
    """Joints (kind, axis, xyz, rpy, mimic) from base to tip, with a tool at the end."""
    made = []
    for i, (kind, *numbers, mimic) in enumerate(joints, 1):
        axis, xyz, rpy = (np.array(text.split(), dtype=float) for text in numbers)
        made.append(J(f"j{i}", f"l{i - 1}", f"l{i}", xyz, axis, kind, (-3, 3), rpy, mimic))
    made.append(frame("tool", f"l{len(joints)}", (0.3, 0, 0)))
    return load(urdf(made, "coupled"), tip="tool", task=task)


def finger(last="revolute", mimic=""):
    """Three parallel axes of which the last may follow; its position."""
    first, second = ("revolute", Z, "0 0 0", "0 0 0", ""), ("revolute", Z, "0.5 0 0", "0 0 0", "")
    return robot([first, second, (last, Z, "0.4 0 0", "0 0 0", mimic)], "position")


def follows(leader, multiplier, offset=0.0):
    return f'<mimic joint="j{leader}" multiplier="{multiplier}" offset="{offset}"/>'


FOLLOWING = [
    (1, 0.0), (-1, 0.0), (2, 0.0), (-2, 0.0), (3, 0.5), (-1, 0.3), (1, np.pi / 4), (0, 0.7),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("multiplier", "offset"), tiered_rows(FOLLOWING, FOLLOWING[1:5:3]))
def test_a_planar_finger(multiplier, offset):
    """The last of three parallel axes is a multiple of the second."""
    arm = finger(mimic=follows(2, multiplier, offset))
    assert arm.n == 2
    form = closed_form(arm)
    on = check_all(arm, form)
    assert on > 20 or not form.families
    # By hand: the tip's lever about joint 1, crossed with its velocity by joint 2.
    m, o = multiplier, offset
    a = np.linspace(-3, 3, 4000)
    tip = 0.4 * np.exp(1j * a) + 0.3 * np.exp(1j * ((1 + m) * a + o))
    rate = 1j * (0.4 * np.exp(1j * a) + 0.3 * (1 + m) * np.exp(1j * ((1 + m) * a + o)))
    area = np.imag(np.conj(1j * (0.5 + tip)) * rate)
    crossings = int((np.diff(np.sign(area)) != 0).sum())
    roots = {round(v.value, 6) for f in form.families for b in f.branches for v in b.values}
    inside = [r for r in roots if abs(r) < 3]
    assert len(inside) == crossings
    for r in inside:
        assert np.abs(np.interp(r, a, area)) < 1e-3


@pytest.mark.slow
def test_a_wrist_that_is_driven_from_the_elbow():
    """Axes in space, a placement that turns about the axis, and an offset of a quarter turn."""
    arm = robot(
        [
            ("revolute", "0 0 1", "0 0 0.3", "0 0 0.4", ""),
            ("revolute", "0 1 0", "0 0 0", "0 0 0", ""),
            ("revolute", "0 1 0", "0.4 0 0", "0 0.2 0", ""),
            ("revolute", "0 1 0", "0.3 0 0", "0 0 0", follows(3, -1, np.pi / 2)),
            ("revolute", "1 0 0", "0.1 0 0.02", "0.3 0 0", ""),
        ],
        task="position",
    )
    assert arm.n == 4
    assert check_all(arm, closed_form(arm)) > 20


def test_two_slides_that_open_together():
    arm = robot(
        [
            ("revolute", "0 0 1", "0 0 0", "0 0 0", ""),
            ("prismatic", "1 0 0", "0.2 0 0", "0 0 0", ""),
            ("prismatic", "1 0 0", "0.1 0 0", "0 0 0", follows(2, 0.5, 0.02)),
        ],
        task="vx,vy",
    )
    form = closed_form(arm)
    # Rank drops where the tip is on the axis: 0.6 + d + 0.5 d + 0.02 = 0.
    ((branch,),) = (f.branches for f in form.families)
    assert [v.value for v in branch.values] == pytest.approx([-0.62 / 1.5])
    check_all(arm, form)


@pytest.mark.parametrize(
    ("kind", "mimic", "said"),
    [
        ("revolute", follows(2, 0.5), "small integer"),
        ("revolute", follows(2, -0.25), "'j2' follows 'j3' by -4 instead"),
        ("revolute", follows(2, 1.5), "1.5, which is not a small integer$"),
        ("revolute", follows(2, 12), "small integer"),
        ("revolute", follows(2, 0.33333), "no simple ratio"),
        ("prismatic", follows(2, 0.5), "slides with a turn"),
    ],
)
def test_what_is_not_followed_is_said(kind, mimic, said):
    arm = finger(kind, mimic)
    form = closed_form(arm)
    assert (form.complete, form.families) == (False, ())
    for words in ("j3", said.rstrip("$"), "`pinsing analyze`"):
        assert words in form.gaps[0]
    with pytest.raises(NotFollowed, match=said):
        drives(nominal(arm))


@pytest.mark.parametrize("angle", [np.pi / 3, 1.0])
def test_an_offset_is_exact_or_said(angle):
    first = ("revolute", Z, "0 0 0", "0 0 0", "")
    second = ("revolute", Z, "0.5 0 0", "0 0 0", follows(1, 1, angle))
    (_, drive), snaps = drives(nominal(robot([first, second], task="position")))
    assert [float(x) for x in drive.turn] == pytest.approx(
        [np.cos(angle), np.sin(angle)], abs=1e-11
    )
    assert sum(x * x for x in drive.turn) == 1
    assert snaps == () or angle == 1.0
    assert all(s.size < 1e-11 for s in snaps)


def test_a_trajectory_across_a_family_gets_its_verdict(tmp_path):
    (tmp_path / "coupled.urdf").write_text(finger(mimic=follows(2, 1)).source.xml)
    (tmp_path / "a.csv").write_text("j1,j2\n0,-0.5\n0,0.5\n")
    arm, path = str(tmp_path / "coupled.urdf"), str(tmp_path / "a.csv")
    done = run("check", arm, path, "--tip", "tool", "--task", "vx,vy")
    assert done.exit_code == 0, done.stderr
    assert "Keep away from F1, at sample 0.5; other postures are not" in done.stdout
