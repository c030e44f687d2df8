"""Make the moving picture of the README: a UR5 led along each family of its singular set.

Usage: moving_picture.py [docs/images/moving.webp]. Each frame is `pinsing.plot.ellipsoids` of a
point of the family: the arm, its ellipsoid of pure translations, what is lost.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image

matplotlib.use("agg")
import matplotlib.pyplot as plt

import pinsing
from pinsing import plot

ROOT = Path(__file__).parent.parent
FRAMES = 10  # of each family, there and back
MILLISECONDS = 160
POSE = np.radians([-40, -75, 70, -85, -60, 0])
SWING = np.radians([35, 14, 14, 20, 15, 0])


def picture(arm: pinsing.Arm, family: pinsing.Family, q: np.ndarray) -> Image.Image:
    """Draw the arm at one of a family's points, the same space around it in all frames."""
    figure = plt.figure(figsize=(5.2, 4.4), dpi=100)
    axes = figure.add_subplot(projection="3d")
    plot.ellipsoids(pinsing.at(arm, q), axes, kind="translational", motions="pure", arm=arm)
    axes.set(xlim=(-0.8, 0.8), ylim=(-0.8, 0.8), zlim=(-0.2, 1.1), title="")
    axes.view_init(elev=18, azim=-60)  # one camera for all frames
    axes.set_box_aspect((1.6, 1.6, 1.3), zoom=1.25)
    if axes.get_legend() is not None:
        axes.get_legend().remove()
    figure.suptitle(f"{family.name}   {family.text}", fontsize=9)
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    plt.close(figure)
    return Image.open(stream).convert("RGB")


def main(words: list[str]) -> int:
    """Draw the frames and write the file."""
    target = Path(words[0]) if words else ROOT / "docs/images/moving.webp"
    arm = pinsing.load("ur5")
    frames = []
    for family in pinsing.closed_form(arm).families:
        for turn in 2 * np.pi * (np.arange(FRAMES) + 0.25) / FRAMES:
            q = family.distance(POSE + np.sin(turn) * SWING).q
            frames.append(picture(arm, family, q))
    frames[0].save(
        target,
        save_all=True,
        append_images=frames[1:],
        duration=MILLISECONDS,
        loop=0,
        quality=75,
    )
    print(f"{target.name}: {len(frames)} frames, {target.stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
