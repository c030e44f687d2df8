"""The clearest posture that reaches a point: SciPy, with the gradient of the clearance.

Maximizes the proven clearance of a KUKA iiwa 14, its tip held at a point.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.optimize import minimize

import pinsing


def main():
    form = pinsing.closed_form(arm := pinsing.load("iiwa14"))
    data, tip = arm.model.createData(), arm.model.getFrameId(arm.tip)

    def at(q):
        pin.framesForwardKinematics(arm.model, data, q)
        return data.oMf[tip].translation.copy()

    start = np.array([0.3, 0.6, 0.2, -1.0, 0.3, 0.2, 0.0])
    point = at(start)
    found = minimize(
        lambda q: -float(pinsing.clearance(form, q).lower),
        start,
        jac=lambda q: -pinsing.clearance(form, q).gradient,
        bounds=list(zip(arm.lower, arm.upper, strict=True)),
        constraints={
            "type": "eq",
            "fun": lambda q: at(q) - point,
            "jac": lambda q: pinsing.frame_jacobian(arm, q)[:3],
        },
        method="SLSQP",
    )
    before, after = (float(pinsing.clearance(form, q).lower) for q in (start, found.x))
    moved = np.linalg.norm(at(found.x) - point)
    print(f"clearance {np.degrees(before):.1f} -> {np.degrees(after):.1f} deg (proven bounds)")
    print(f"the tip moved by {moved:.1e} m")


if __name__ == "__main__":
    main()
