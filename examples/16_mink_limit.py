"""Keep an arm clear of its singularities with mink (pip install mink daqp).

A limit of mink, G dq <= h: the clearance falls by no more than a share of what is left of it.
"""

from __future__ import annotations

import sys
from pathlib import Path

import mink
import mujoco
import numpy as np

import pinsing

MARGIN, GAIN = np.radians(10), 0.2


class Clear(mink.Limit):
    """From the proven clearance and its gradient."""

    def __init__(self, form):
        self.form = form

    def compute_qp_inequalities(self, configuration, dt):
        now = pinsing.clearance(self.form, configuration.q)
        room = GAIN * (float(now.lower) - MARGIN)
        return mink.Constraint(G=-now.gradient[None], h=np.array([max(room, 0.0)]))


def main(file):
    """Pull the tip of a MuJoCo model out of reach, with and without the limit."""
    form = pinsing.closed_form(pinsing.load(file))
    model = mujoco.MjModel.from_xml_path(file)
    kept = mink.ConfigurationLimit(model)
    for limits in ([kept], [kept, Clear(form)]):
        configuration = mink.Configuration(model)
        configuration.update(np.array([0.0, -0.5, 1.4, 0.3, 0.9, 0.0]))
        task = mink.FrameTask("tip", "site", position_cost=1, orientation_cost=0, gain=0.02)
        goal = configuration.get_transform_frame_to_world("tip", "site")
        task.set_target(mink.SE3.from_translation(np.array([0.5, 0, 0])).multiply(goal))
        least = np.inf
        for _ in range(200):
            v = mink.solve_ik(configuration, [task], 0.02, "daqp", damping=1e-2, limits=limits)
            configuration.integrate_inplace(v, 0.02)
            least = min(least, float(pinsing.clearance(form, configuration.q).lower))
        which = "with" if len(limits) > 1 else "without"
        print(f"{which} the limit: {np.degrees(least):.1f} deg at least")


if __name__ == "__main__":
    main(*sys.argv[1:] or [str(Path(__file__).parent / "arm.xml")])
