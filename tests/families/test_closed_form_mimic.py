"""Chains with mimic joints: closed forms follow them, or say which they cannot follow."""

from __future__ import annotations

import numpy as np
import pytest

from pinsing.algebra.mimic import NotFollowed, drives
from pinsing.configuration.refine import approach
from pinsing.families import closed_form
from pinsing.kinematics.jacobian import singular_values
from pinsing.kinematics.verdict import ratios
from pinsing.robot.load import load
from pinsing.robot.nominal import nominal

LINK = '<link name="{}"/>'
JOINT = """<joint name="j{i}" type="{kind}"><parent link="l{p}"/><child link="l{i}"/>
<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/>{mimic}</joint>"""


def robot(folder, joints, task="pose"):
    """Joints (kind, axis, xyz, rpy, mimic) from base to tip, with a tool at the end."""
    body = [LINK.format("l0")]
    for i, (kind, axis, xyz, rpy, mimic) in enumerate(joints, 1):
        body.append(LINK.format(f"l{i}"))
        body.append(JOINT.format(i=i, p=i - 1, kind=kind, axis=axis, xyz=xyz, rpy=rpy, mimic=mimic))
    last = len(joints)
    body.append('<link name="tool"/>')
    body.append(
        f'<joint name="tool" type="fixed"><parent link="l{last}"/><child link="tool"/>'
        '<origin xyz="0.3 0 0"/></joint>'
    )
    path = folder / "coupled.urdf"
    path.write_text(f'<robot name="coupled">{"".join(body)}</robot>')
    return load(path, tip="tool", task=task)


def follows(leader, multiplier, offset=0.0):
    return f'<mimic joint="j{leader}" multiplier="{multiplier}" offset="{offset}"/>'


def check(arm, form):
    assert form.complete, form.gaps
    rng = np.random.default_rng(2)
    r = form.generic_rank - 1
    for family in form.families:
        Q = family.points(50, rng)
        assert len(Q)
        s = singular_values(arm, Q)
        assert (s[:, r] / s[:, 0]).max() < 1e-8
        off = Q + 0.05 * rng.normal(size=Q.shape)
        away = np.array([form.family_of(q, tol=1e-3) is None for q in off])
        assert ratios(arm, off[away]).min(initial=1.0) > 1e-8
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    ends = approach(arm, rng.uniform(low, high, (200, arm.n)))
    singular = ends.q[ends.singular]
    assert all(form.family_of(q, tol=1e-5) for q in singular)
    return len(singular)


@pytest.mark.parametrize(
    ("multiplier", "offset"),
    [(1, 0.0), (-1, 0.0), (2, 0.0), (-2, 0.0), (3, 0.5), (-1, 0.3), (1, np.pi / 4), (0, 0.7)],
)
def test_a_planar_finger(tmp_path, multiplier, offset):
    """Three parallel axes, the last one a multiple of the second."""
    z = "0 0 1"
    arm = robot(
        tmp_path,
        [
            ("revolute", z, "0 0 0", "0 0 0", ""),
            ("revolute", z, "0.5 0 0", "0 0 0", ""),
            ("revolute", z, "0.4 0 0", "0 0 0", follows(2, multiplier, offset)),
        ],
        task="position",
    )
    assert arm.n == 2
    form = closed_form(arm)
    on = check(arm, form)
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


def test_a_wrist_that_is_driven_from_the_elbow(tmp_path):
    """Axes in space, a placement that turns about the axis, and an offset of a quarter turn."""
    arm = robot(
        tmp_path,
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
    assert check(arm, closed_form(arm)) > 20


def test_two_slides_that_open_together(tmp_path):
    arm = robot(
        tmp_path,
        [
            ("revolute", "0 0 1", "0 0 0", "0 0 0", ""),
            ("prismatic", "1 0 0", "0.2 0 0", "0 0 0", ""),
            ("prismatic", "1 0 0", "0.1 0 0", "0 0 0", follows(2, 0.5, 0.02)),
        ],
        task="vx,vy",
    )
    form = closed_form(arm)
    assert form.complete
    # Rank drops where the tip is on the axis: 0.6 + d + 0.5 d + 0.02 = 0.
    assert len(form.families) == 1
    (branch,) = form.families[0].branches
    assert [v.value for v in branch.values] == pytest.approx([-0.62 / 1.5])
    check(arm, form)


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
def test_what_is_not_followed_is_said(tmp_path, kind, mimic, said):
    arm = robot(
        tmp_path,
        [
            ("revolute", "0 0 1", "0 0 0", "0 0 0", ""),
            ("revolute", "0 0 1", "0.5 0 0", "0 0 0", ""),
            (kind, "0 0 1", "0.4 0 0", "0 0 0", mimic),
        ],
        task="position",
    )
    form = closed_form(arm)
    assert not form.complete
    assert not form.families
    assert "j3" in form.gaps[0]
    assert said.rstrip("$") in form.gaps[0]
    assert "`pinsing analyze`" in form.gaps[0]
    with pytest.raises(NotFollowed, match=said):
        drives(nominal(arm))


def test_an_offset_is_exact_or_said(tmp_path):
    def offset_by(angle):
        joints = [
            ("revolute", "0 0 1", "0 0 0", "0 0 0", ""),
            ("revolute", "0 0 1", "0.5 0 0", "0 0 0", follows(1, 1, angle)),
        ]
        return drives(nominal(robot(tmp_path, joints, task="position")))

    (_, second), snaps = offset_by(np.pi / 3)
    assert [float(x) for x in second.turn] == pytest.approx([0.5, np.sqrt(0.75)], abs=1e-15)
    assert snaps == ()
    (_, second), snaps = offset_by(1.0)
    assert [float(x) for x in second.turn] == pytest.approx([np.cos(1), np.sin(1)], abs=1e-11)
    assert sum(x * x for x in second.turn) == 1
    assert all(s.size < 1e-11 for s in snaps)


@pytest.mark.slow
def test_a_gripper_of_pr2_with_its_arm():
    """Two fingers' worth of joints that turn together, at the end of seven."""
    arm = load("pr2", tip="l_gripper_l_finger_tip_link", base="torso_lift_link")
    assert arm.n == 8
    assert arm.coupling is not None
    form = closed_form(arm)
    assert len(form.families) == 7
    assert check(arm, form) > 20
