"""An arm that no file describes: a pin.Model made in Python, a slide with two joints on it."""

import numpy as np
import pinocchio as pin

import pinsing

model = pin.Model()
model.name = "gantry"
out = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
rail = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "rail")
shoulder = model.addJoint(rail, pin.JointModelRZ(), pin.SE3.Identity(), "shoulder")
elbow = model.addJoint(shoulder, pin.JointModelRZ(), out, "elbow")
model.addFrame(pin.Frame("hand", elbow, 0, out, pin.FrameType.OP_FRAME))
model.lowerPositionLimit[:] = [-1, -3, -3]
model.upperPositionLimit[:] = [1, 3, 3]

arm = pinsing.load(model, tip="hand", task="vx,vy")
form = pinsing.closed_form(arm)
for family in form.families:
    print(family)
    state = pinsing.at(arm, family.generic)
    print(f"  at {np.round(family.generic, 3)}: {state.status}")
