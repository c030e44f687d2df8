"""Arms on rails, gantries, positioners and mobile bases: chains of seven to ten joints."""

import numpy as np
import pinocchio as pin
import pytest
from singular_sets import check_beside, check_families
from tiers import tiered_rows

import pinsing

X, Y, Z = pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ
TILT, TURN = pin.JointModelRY, pin.JointModelRZ
CARRIERS = {
    "rail": [Y], "two rails": [X, Y], "gantry": [X, Y, Z], "positioner": [TILT, TURN],
    "mobile base": [X, Y, TURN],
}  # fmt: skip


def carried(carrier, robot, **spec):
    arm = pinsing.load(robot, **spec)
    model, parent = pin.Model(), 0
    model.name = f"{robot} on a {carrier}"
    for i, kind in enumerate(CARRIERS[carrier]):
        place = pin.SE3(np.eye(3), np.array([0.05, 0.02, 0.1]) * (i > 0))
        parent = model.addJoint(parent, kind(), place, f"carrier{i + 1}")
        model.lowerPositionLimit[-1], model.upperPositionLimit[-1] = -2, 2
    model.addFrame(pin.Frame("mount", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    place = pin.SE3(np.eye(3), np.array([0.1, 0.05, 0.4]))
    whole = pin.appendModel(model, arm.model, model.getFrameId("mount"), place)
    return pinsing.load(whole, tip=arm.tip)


CARRIED = [
    ("rail", "ur5", [2] * 5), ("rail", "iiwa14", [2, 2, 3, 3, 3, 3, 3]),
    ("two rails", "irb1400", [2, 3, 3, 3]), ("gantry", "irb1400", [3]), ("gantry", "panda", [5]),
    ("positioner", "ur5", [3] * 7), ("mobile base", "ur5", [2, 3, 3]),
]  # fmt: skip


@pytest.mark.parametrize(("carrier", "robot", "codimensions"), tiered_rows(CARRIED, CARRIED[:1]))
def test_all_families_of_a_carried_arm(carrier, robot, codimensions):
    spec = {"tip": "panda_hand_tcp"} if robot == "panda" else {}
    arm = carried(carrier, robot, **spec)
    assert arm.n == len(CARRIERS[carrier]) + pinsing.load(robot, **spec).n
    form = pinsing.closed_form(arm, seconds=120)
    assert form.complete, form.gaps
    assert sorted(f.codimension for f in form.families) == codimensions
    check_families(arm, form, 4 * len(form.families))
    check_beside(arm, form, 20)
