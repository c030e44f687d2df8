"""Pictures of a report: matplotlib figures as small PNG files."""

from __future__ import annotations

import io
from collections.abc import Sequence
from itertools import combinations
from typing import Any

from pinsing.families import Branch, Family
from pinsing.robot.arm import Arm


def png(figure: Any, dpi: int = 130) -> bytes:
    """A figure as PNG of few colours, which takes a third of the room; the figure is closed."""
    from matplotlib import pyplot as plt
    from PIL import Image

    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=dpi, bbox_inches="tight", pad_inches=0.05)
    plt.close(figure)
    image = Image.open(drawn).convert("RGB")
    out = io.BytesIO()
    reduced = image.quantize(128, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    reduced.save(out, format="png", optimize=True)
    return out.getvalue()


def quiet_backend() -> None:
    """Draw without a screen, unless somebody has chosen how to draw already."""
    import sys

    import matplotlib as mpl

    if "matplotlib.pyplot" not in sys.modules:
        mpl.use("agg")


def map_planes(arm: Arm, families: Sequence[Family]) -> list[tuple[int, int]]:
    """Pairs of joints (indices) over which maps show the most: at most two.

    The first pair shows the most families, the second the most curves that need both joints.
    """
    pairs = list(combinations(range(arm.n), 2))
    if not pairs:
        return []

    def shown(pair: tuple[int, int]) -> list[int]:
        return [k for k, f in enumerate(families) if any(_shows(b, pair) for b in f.branches)]

    def curves(pair: tuple[int, int]) -> int:
        return sum(
            any(_shows(b, pair) and any(set(pair) <= set(e.involved) for e in b.equations)
                for b in f.branches)
            for f in families
        )  # fmt: skip

    first = max(pairs, key=lambda p: (len(shown(p)), curves(p), -p[0], -p[1]))
    if not shown(first):
        return []
    second = max(pairs, key=lambda p: (curves(p), len(shown(p)), -p[0], -p[1]))
    more = second != first and curves(second) > curves(first)
    return [first, second] if more else [first]


def _shows(branch: Branch, pair: tuple[int, int]) -> bool:
    """Whether a branch meets the plane of two joints, whatever the others are."""
    values = {v.joint for v in branch.values}
    if not values <= set(pair):
        return False
    return (
        all(set(e.involved) & set(pair) for e in branch.equations)
        and len(branch.equations) + len(values) <= 2
    )


def pose_picture(arm: Arm, state: Any) -> bytes:
    """The arm at a configuration, with its velocity ellipsoids and what is lost."""
    from pinsing.plot.ellipsoids import ellipsoids

    return png(ellipsoids(state, arm=arm).figure)


def map_picture(arm: Arm, families: Sequence[Family], pair: tuple[int, int]) -> bytes:
    """sigma_min over two joints, in degrees, with the loci."""
    from pinsing.plot.plane import sigma_plane

    a, b = (arm.joints[j] for j in pair)
    axes = sigma_plane(arm, a, b, families=families, degrees=True, samples=121)
    return png(axes.figure, 150)
