"""Keep a UR5 away from its shoulder singularity, with pink (pip install 'pinsing[extra]')."""

import numpy as np
import pink
import pinocchio as pin
from pink.barriers import Barrier

import pinsing

form = pinsing.closed_form(arm := pinsing.load("ur5"))
shoulder = form.families[2].equations[0]  # zero where the arm is singular, of one sign beside it


class Clear(Barrier):
    """Keeps the equation on its side: h = side f(q) - margin stays positive."""

    def __init__(self, q, margin):
        super().__init__(dim=1, gain=5.0)
        self.side, self.margin = np.sign(shoulder(q)), margin

    def compute_barrier(self, configuration):
        return np.array([self.side * shoulder(configuration.q) - self.margin])

    def compute_jacobian(self, configuration):
        return self.side * shoulder.gradient(configuration.q)[None]


start, up = np.array([0, -1.2, 1.2, -0.9, -1.4, 0]), pin.rpy.rpyToMatrix(0, 3, 0)
for barriers in ([], [Clear(start, 0.1)]):
    configuration, nearest = pink.Configuration(arm.model, arm.model.createData(), start), np.inf
    task = pink.FrameTask("tool0", position_cost=1.0, orientation_cost=0.1, gain=0.1)
    task.set_target(pin.SE3(up, np.array([0.0, 0.1, 0.7])))
    for _ in range(400):
        v = pink.solve_ik(configuration, [task], 0.01, solver="quadprog", barriers=barriers)
        configuration.integrate_inplace(v, 0.01)
        found = pinsing.clearance(form, configuration.q, families=["F3"], certify=True)
        nearest = min(nearest, float(found.lower))
    print(f"{'with' if barriers else 'without'} barrier: nearest {np.degrees(nearest):.2f} degrees")
