"""Make the moving picture of the README: a UR5 led along each family of its singular set.

Usage: moving_picture.py [docs/images/moving.webp]. Needs Chromium, and Pillow. Every frame is a
picture of the page that `pinsing view` shows, its arm at a point of the family.
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import pinsing

ROOT = Path(__file__).parent.parent
FRAMES = 12  # of each family, there and back
SIZE = (720, 540)
SHOWN = (560, 420)
MILLISECONDS = 110
POSE = np.radians([-40, -75, 70, -85, -60, 0])
SWING = np.radians([35, 14, 14, 20, 15, 0])


def motion(family: pinsing.Family) -> list[np.ndarray]:
    """Points of a family near a swinging arm, the last beside the first."""
    turns = 2 * np.pi * np.arange(FRAMES) / FRAMES
    return [family.distance(POSE + np.sin(turn) * SWING).q for turn in turns]


def main(words: list[str]) -> int:
    """Take the pictures and write the file."""
    target = Path(words[0]) if words else ROOT / "docs/images/moving.webp"
    frames = []
    with tempfile.TemporaryDirectory() as folder, pinsing.Viewer(pinsing.load("ur5")) as viewer:
        families = pinsing.closed_form(pinsing.load("ur5")).families
        for number, family in enumerate(families):
            for step, q in enumerate(motion(family)):
                viewer.show(q)
                picture = Path(folder) / f"{number}-{step}.png"
                viewer.save_png(picture, size=SIZE)
                frames.append(Image.open(io.BytesIO(picture.read_bytes())).convert("RGB"))
    small = [frame.resize(SHOWN, Image.Resampling.LANCZOS) for frame in frames]
    small[0].save(
        target,
        save_all=True,
        append_images=small[1:],
        duration=MILLISECONDS,
        loop=0,
        quality=70,
        method=6,
    )
    print(f"{target}: {len(small)} frames, {target.stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
