"""Arms with axes 15, 30, 45, 60 or 75 degrees apart: exact, with square roots."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from tiers import tiered

from pinsing.configuration.rank_drop import approach
from pinsing.families import closed_form
from pinsing.kinematics.verdict import ratios
from pinsing.robot.load import load

DHRows = list[tuple[float, float, float]]
"""a, alpha in degrees, d."""

HOLLOW: DHRows = [(0, 90, 0.5), (0.43, 0, 0), (0.02, -90, 0.15), (0, 60, 0.43), (0, -60, 0)]
JACO: DHRows = [(0, 90, 0.2755), (0.41, 180, 0), (0, 90, -0.0098), (0, 60, -0.2501)]
JACO += [(0, 60, -0.0856), (0, 180, -0.2028)]
SEVEN: DHRows = [(0, 90, 0.3), (0, 60, 0), (0, -60, 0.4), (0, 90, 0), (0, -90, 0.4), (0, 90, 0)]


def arm_of(rows: DHRows, name: str = "twisted"):
    model = pin.Model()
    model.name = name
    parent, before = 0, pin.SE3.Identity()
    for i, (a, alpha, d) in enumerate(rows):
        parent = model.addJoint(parent, pin.JointModelRZ(), before, f"j{i + 1}")
        model.addJointFrame(parent)
        model.lowerPositionLimit[i], model.upperPositionLimit[i] = -3, 3
        turned = pin.SE3(pin.utils.rotate("x", math.radians(alpha)), np.array([a, 0, d]))
        before = turned
    model.addFrame(pin.Frame("tip", parent, 0, before, pin.FrameType.OP_FRAME))
    return load(model, tip="tip")


def swapped(rows: DHRows, old: float, new: float) -> DHRows:
    return [
        (a, math.copysign(new, alpha) if abs(alpha) == old else alpha, d) for a, alpha, d in rows
    ]


def check(arm, found, count=200):
    """Families are singular in Pinocchio; what a search finds is on them; near misses are not."""
    rng = np.random.default_rng(3)
    for f in found.families:
        Q = f.points(count, rng)
        assert len(Q)
        assert ratios(arm, Q).max() < 1e-10
        off = Q + 0.05 * rng.normal(size=Q.shape)
        away = np.array([not found.family_of(q, tol=1e-3) for q in off])
        assert away.mean() > 0.5
        assert ratios(arm, off[away]).min() > 1e-8
    walks = rng.uniform(arm.lower, arm.upper, (300, arm.n))
    ends = approach(arm, walks)
    singular = ends.q[ends.singular]
    assert len(singular) > 100
    assert all(found.family_of(q, tol=1e-5) for q in singular)


@pytest.mark.parametrize("twist", tiered([15, 30, 45, 60, 75], (15, 45)))
def test_hollow_wrists(twist):
    """Three wrist axes through one point, at any twist: the families of a PUMA."""
    arm = arm_of([*swapped(HOLLOW, 60, twist), (0, 0, 0.1)])
    found = closed_form(arm)
    assert found.complete
    assert found.snaps == ()
    assert [f.proof for f in found.families] == ["algebra"] * 3
    texts = [f.text for f in found.families]
    assert "q5 = 0° or 180°" in texts
    assert "0.43 cos q2 + 0.02 cos(q2+q3) - 0.43 sin(q2+q3) = 0" in texts
    check(arm, found)


def test_a_wrist_without_a_centre():
    """Kinova's Jaco with the 60 degree wrist: one surface that does not fall apart."""
    arm = arm_of(JACO)
    found = closed_form(arm)
    assert found.complete
    assert found.snaps == ()
    (family,) = found.families
    assert family.codimension == 1
    assert family.proof == "algebra"
    check(arm, found)


@pytest.mark.parametrize("twist", tiered([30, 45, 60], ()))
def test_seven_joints(twist):
    arm = arm_of([*swapped(SEVEN, 60, twist), (0, 0, 0.1)])
    found = closed_form(arm)
    assert found.complete
    assert found.snaps == ()
    assert found.fully_decomposed
    assert sorted(f.codimension for f in found.families) == [1, 2, 2, 2]
    check(arm, found)


def test_three_axes_that_meet():
    """Three axes that meet, 30 and 60 degrees apart, lie in a plane at half turns only."""
    arm = arm_of([(0, 30, 0.2), (0, 60, 0), (0, 0, 0.1)])
    arm = load(arm.model, tip="tip", task="orientation")
    found = closed_form(arm)
    assert found.complete
    assert [f.text for f in found.families] == ["q2 = 0° or 180°"]
    check(arm, found)


@pytest.mark.slow
def test_too_much_for_square_roots_falls_back_and_says_so():
    rows = [(0.25, -60, 0.3), (0.25, 15, 0.2), (0.1, -90, 0), (0.1, 90, 0), (0.25, 75, 0)]
    arm = arm_of([*rows, (0.1, 0, 0)])
    found = closed_form(arm, seconds=0.6)
    assert any("twist" in s for s in found.snaps)
    assert 0 < found.jacobian_change < 1e-10
    exact = closed_form(arm, seconds=600)  # some seconds of work, whatever else runs
    assert exact.snaps == ()
    assert exact.complete


def test_other_angles_are_rational_and_stated():
    arm = arm_of([*swapped(HOLLOW, 60, 55), (0, 0, 0.1)])
    found = closed_form(arm)
    assert found.complete
    assert any("twist" in s for s in found.snaps)
    check(arm, found)
