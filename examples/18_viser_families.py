"""The families of singular configurations in Pinocchio's viser viewer.

    pip install viser trimesh
    python examples/18_viser_families.py arm.urdf

A menu chooses a family; a slider walks through configurations of it.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
import viser
from pinocchio.visualize import ViserVisualizer

import pinsing

COUNT = 50


def show(file, server):
    """Draw the robot of a URDF, and a menu of its families; return menu, slider and text."""
    # Meshes of package://NAME are in a folder NAME of one of these.
    folders = [str(folder) for folder in Path(file).resolve().parents]
    whole = pin.RobotWrapper.BuildFromURDF(file, folders)
    form = pinsing.closed_form(arm := pinsing.load(whole))
    viewer = ViserVisualizer(whole.model, whole.collision_model, whole.visual_model)
    viewer.initViewer(viewer=server, loadModel=True)
    rng = np.random.default_rng(0)
    families = {f"{f.name} {f.title}": f for f in form.families}
    poses = {label: f.sample(COUNT, rng) for label, f in families.items()}
    menu = server.gui.add_dropdown("family", list(families))
    slider = server.gui.add_slider("configuration", 0, COUNT - 1, 1, 0)
    text = server.gui.add_markdown("")

    def draw(_=None):
        rows = poses[menu.value]
        if not len(rows):
            text.content = f"{families[menu.value]}: none within the limits was found"
            return
        q = rows[min(slider.value, len(rows) - 1)]
        viewer.display(arm.full_q(q))
        text.content = f"{families[menu.value]}: sigma_min {pinsing.at(arm, q).sigma[-1]:.1e}"

    menu.on_update(draw)
    slider.on_update(draw)
    draw()
    return menu, slider, text


if __name__ == "__main__":
    show(*sys.argv[1:], viser.ViserServer(port=8000))
    print("http://localhost:8000, Ctrl-C to end")
    while True:
        time.sleep(3600)
