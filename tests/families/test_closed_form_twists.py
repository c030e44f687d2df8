"""Arms with axes 15, 30, 45, 60 or 75 degrees apart: exact, with square roots."""

import math

import numpy as np
import pinocchio as pin
import pytest
from arms import place, serial
from singular_sets import check_all
from tiers import tiered

from pinsing.families import ClosedForm, closed_form, prove
from pinsing.families.form import coverage_words
from pinsing.robot.load import load

DHRows = list[tuple[float, float, float]]
"""a, alpha in degrees, d."""

HOLLOW: DHRows = [(0, 90, 0.5), (0.43, 0, 0), (0.02, -90, 0.15), (0, 60, 0.43), (0, -60, 0)]
JACO: DHRows = [(0, 90, 0.2755), (0.41, 180, 0), (0, 90, -0.0098), (0, 60, -0.2501)]
JACO += [(0, 60, -0.0856), (0, 180, -0.2028)]
SEVEN: DHRows = [(0, 90, 0.3), (0, 60, 0), (0, -60, 0.4), (0, 90, 0), (0, -90, 0.4), (0, 90, 0)]


def arm_of(rows: DHRows):
    turned = [(math.radians(alpha), a, d) for a, alpha, d in rows]
    places = [place((a, 0, d), pin.utils.rotate("x", alpha)) for alpha, a, d in turned]
    joints = [(pin.JointModelRZ(), p) for p in (place(), *places[:-1])]
    return load(serial(joints, places[-1], -3, 3, "twisted"), tip="tip")


def swapped(rows: DHRows, new: float) -> DHRows:
    """With twists of another size in place of those of 60 degrees."""
    return [(a, math.copysign(new, al) if abs(al) == 60 else al, d) for a, al, d in rows]


@pytest.mark.slow
@pytest.mark.parametrize("twist", tiered([15, 30, 45, 60, 75], (15,)))
def test_hollow_wrists(twist):
    """Three wrist axes through one point, at any twist: the families of a PUMA."""
    arm = arm_of([*swapped(HOLLOW, twist), (0, 0, 0.1)])
    found = closed_form(arm)
    assert found.snaps == ()
    assert [f.proof for f in found.families] == ["algebra"] * 3
    texts = [f.text for f in found.families]
    assert "q5 = 0° or 180°" in texts
    assert "0.43 cos q2 + 0.02 cos(q2+q3) - 0.43 sin(q2+q3) = 0" in texts
    assert check_all(arm, found, 1e-10) > 100


def test_a_wrist_without_a_centre():
    """Kinova's Jaco with the 60 degree wrist: one surface that does not fall apart."""
    arm = arm_of(JACO)
    found = closed_form(arm)
    assert found.snaps == ()
    (family,) = found.families
    assert (family.codimension, family.proof) == (1, "algebra")
    assert check_all(arm, found, 1e-10) > 100


@pytest.mark.parametrize("twist", tiered([30, 45, 60], ()))
def test_seven_joints(twist):
    arm = arm_of([*swapped(SEVEN, twist), (0, 0, 0.1)])
    found = closed_form(arm)
    assert (found.snaps, found.fully_decomposed) == ((), True)
    assert sorted(f.codimension for f in found.families) == [1, 2, 2, 2]
    assert check_all(arm, found, 1e-10) > 100


def test_three_axes_that_meet():
    """Three axes that meet, 30 and 60 degrees apart, lie in a plane at half turns only."""
    arm = arm_of([(0, 30, 0.2), (0, 60, 0), (0, 0, 0.1)])
    arm = load(arm.model, tip="tip", task="orientation")
    found = closed_form(arm)
    assert [f.text for f in found.families] == ["q2 = 0° or 180°"]
    assert check_all(arm, found, 1e-10) > 100


@pytest.mark.slow
def test_a_bennett_linkage_stays_closed():
    """Of a geometry 1.5e-12 beside it, the surface on which it moves is two isolated curves."""
    arm = arm_of([(0.4, 90, 0), (0.2, 30, 0), (0.4, 90, 0), (0.2, 30, 0)])
    found = closed_form(load(arm.model, tip="tip", task="vx,vy,vz,wx,wz"))
    assert found.complete
    assert found.families[0].text == "cos((q2+q3)/2) + 0.267949 cos((q2-q3)/2) = 0"
    q = [1.84617633, 2.74673804, 0.66704847, 1.46702977]
    assert found.family_of(q, tol=1e-6) is not None


def test_an_answer_about_another_geometry_says_so_first():
    rows = [(0, 90, 0.3), (0.4, 0, 0), (0.3, 0, 0)]
    exact = closed_form(arm_of([*rows, (0.1, 0, 0)]))
    assert exact.deviation is None
    assert "design" not in str(exact)
    model = arm_of([*rows, (0.1, 0, 0)]).model
    model.jointPlacements[2] = pin.SE3(pin.utils.rotate("x", 1.5708), np.array([0, 0, 0.3]))
    design = prove(closed_form(load(model, tip="tip")))
    assert (design.word, design.deviation.angle) == ("proven", pytest.approx(3.673e-6, rel=1e-3))
    assert "proven for the nominal design" in " ".join(str(design).split())
    said = "the nominal design: angles moved by at most 3.7e-06 rad (0.0002°), lengths as written"
    assert said in str(design)
    assert said in design.certificate["robot"]
    assert said in design._repr_html_()
    assert coverage_words(design).startswith("Proven for the nominal design (angles moved by")
    assert ClosedForm.from_json(design.to_json()).deviation == design.deviation
    twisted = closed_form(arm_of([(0, 90, 0.3), (0.4, 52, 0), (0.3, 0, 0), (0.1, 0, 0)]))
    assert twisted.deviation.angle == twisted.deviation.length == 0
    assert 0 < twisted.deviation.twist < 1e-11
    assert "a rational geometry beside the file's: twists by at most" in " ".join(
        str(twisted).split()
    )
