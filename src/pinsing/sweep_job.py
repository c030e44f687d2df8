"""The curves of a sweep as work in chunks, the same to the last bit however they are cut."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pinsing.durable import Record
from pinsing.evaluate import Evaluator, run_identity
from pinsing.measures import sigma_ratio
from pinsing.robot.arm import Array
from pinsing.sweep_plan import NOT_ASKED, SweepPlan

_BLOCK = 4096  # configurations that are treated at a time


@dataclass(frozen=True)
class CurveSpec:
    """Which curve: joints at special values, and the one that moves.

    Attributes
    ----------
    joints, values : tuples
        Indices of the joints at special values, and these, radians or metres.
    forced : bool
        The set alone is singular whatever the others.
    moving : int
        Index of the joint that moves.
    """

    joints: tuple[int, ...]
    values: tuple[float, ...]
    forced: bool
    moving: int


def curve_specs(plan: SweepPlan) -> list[CurveSpec]:
    """All curves of a plan: first each joint from the nominal configuration, then by level."""
    specs = [
        CurveSpec((), (), False, i) for i, e in enumerate(plan.effects) if e.reason != NOT_ASKED
    ]
    for level in plan.levels:
        if not level.swept:
            continue
        rows = zip(level.joints.tolist(), level.values.tolist(), level.forced.tolist(), strict=True)
        for joints, values, forced in rows:
            specs += [
                CurveSpec(tuple(joints), tuple(values), forced, m) for m in plan.moving(joints)
            ]
    return specs


def curve_axes(plan: SweepPlan) -> Array:
    """Values (n, samples) that each joint moves over, radians or metres."""
    ends = np.array([effect.range for effect in plan.effects])
    return np.array([np.linspace(low, high, plan.samples) for low, high in ends])


@dataclass(frozen=True, eq=False)
class SweepJob:
    """The curves of a sweep, some in each chunk.

    Attributes
    ----------
    plan : SweepPlan
        What to do.
    evaluator : Evaluator
        The arm, on a fixed engine.
    specs : list of CurveSpec
        All curves.
    size : int
        Curves of a chunk; see `curves_per_chunk`.
    """

    plan: SweepPlan
    evaluator: Evaluator
    specs: list[CurveSpec]
    size: int

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return -(-len(self.specs) // self.size)

    def identity(self) -> Mapping[str, Any]:
        """What decides the numbers, as plain JSON values."""
        plan = self.plan
        digest = hashlib.sha256(curve_axes(plan).tobytes())
        for spec in self.specs:
            digest.update(repr((spec.joints, spec.values, spec.forced, spec.moving)).encode())
        return run_identity("sweep", self.evaluator) | {
            "joints": list(plan.arm.joints),
            "nominal": plan.nominal.tolist(),
            "samples": plan.samples,
            "curves": len(self.specs),
            "curves_of_a_chunk": self.size,
            "ranges and special values": digest.hexdigest(),
        }

    def span(self, index: int) -> range:
        """Numbers of the curves of one chunk."""
        return range(index * self.size, min(len(self.specs), (index + 1) * self.size))

    def part(self, index: int) -> Callable[[], Record]:
        """One chunk, with no more than it needs."""
        span = self.span(index)
        specs, axes = self.specs[span.start : span.stop], curve_axes(self.plan)
        return functools.partial(compute_curves, self.evaluator, self.plan.nominal, axes, specs)


def curves_per_chunk(samples: int, configurations: int) -> int:
    """Return how many whole curves make a chunk of about so many configurations."""
    block = _curves_per_block(samples)
    return max(1, configurations // samples // block) * block


def compute_curves(
    evaluator: Evaluator, nominal: Array, axes: Array, specs: list[CurveSpec]
) -> Record:
    """``sigma_min`` and ``sigma_ratio``, each (C, samples), of some curves."""
    samples, n = axes.shape[1], len(nominal)
    sigma_min, ratio = np.empty((2, len(specs), samples))
    block = _curves_per_block(samples)
    for start in range(0, len(specs), block):
        some = specs[start : start + block]
        Q = np.tile(nominal, (len(some), samples, 1))
        for row, spec in zip(Q, some, strict=True):
            row[:, list(spec.joints)] = spec.values
            row[:, spec.moving] = axes[spec.moving]
        sigma = evaluator.sigma(Q.reshape(-1, n)).reshape(len(some), samples, -1)
        sigma_min[start : start + block] = sigma[..., -1]
        ratio[start : start + block] = sigma_ratio(sigma)
    return {"sigma_min": sigma_min, "sigma_ratio": ratio}


def _curves_per_block(samples: int) -> int:
    return max(1, _BLOCK // samples)
