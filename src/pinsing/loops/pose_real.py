"""Whether an equation over the pose has real points, as far as is looked."""

from __future__ import annotations

import numpy as np

from pinsing.loops.pose_equation import PoseEquation

_TRIES = 400
_SEED = 2718


def has_real_points(found: PoseEquation) -> bool:
    """Whether it changes its sign over random poses and inputs."""
    x = np.random.default_rng(_SEED).normal(size=(_TRIES, len(found.names)))
    x *= np.random.default_rng(_SEED + 1).choice([0.1, 1.0, 3.0], size=(_TRIES, 1))
    for k, name in enumerate(found.names[:-1]):
        # A cosine and its sine are of one angle.
        if name.startswith("cos ") and found.names[k + 1] == f"sin {name[4:]}":
            angle = np.random.default_rng(_SEED + 2 + k).uniform(-np.pi, np.pi, _TRIES)
            x[:, k], x[:, k + 1] = np.cos(angle), np.sin(angle)
    values = found(x)
    return bool((values > 0).any() and (values < 0).any())
