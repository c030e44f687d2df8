"""What surrounds a pose: how far each input can go, and the other modes to choose from."""

from __future__ import annotations

from typing import Any

import numpy as np

from pinsing._types import Array
from pinsing.mechanism.drive import Stretch, stretch
from pinsing.mechanism.dyad import planar_dyad
from pinsing.mechanism.modes import mode_of
from pinsing.mechanism.solve import InfeasibleError, assemblies
from pinsing.robot.mechanism import Mechanism
from pinsing.view.frame import rounded
from pinsing.view.mechanism.groups import input_text

_SAME = 1e-4
_HERE = 1e-7


def around(mechanism: Mechanism, q: Array) -> dict[str, Any]:
    """Surroundings of a closed q (n,), ready for JSON.

    Keys: ``stretches``, per input the values within reach in this mode, with the singular
    ``marks`` on the way; ``ahead``, the nearest of them in words; ``assemblies``, all ways to
    close the loops at these inputs, and ``working``, all ways to reach this output, each with
    ``name``, ``q`` and whether it is the present one (``here``).
    """
    found = [stretch(mechanism, q, k) for k in range(len(mechanism.inputs))]
    return {
        "stretches": [_stretch(mechanism, k, s) for k, s in enumerate(found)],
        "ahead": _ahead(mechanism, q, found),
        "assemblies": _assemblies(mechanism, q),
        "working": _working(mechanism, q),
    }


def _stretch(mechanism: Mechanism, k: int, found: Stretch) -> dict[str, Any]:
    index = mechanism.actuated[k]
    return {
        "lower": found.lower,
        "upper": found.upper,
        "whole": found.whole,
        "marks": [
            {
                "kind": p.kind,
                "value": float(p.q[index]),
                "words": f"{p.kind} at {input_text(mechanism, k, float(p.q[index]))}",
            }
            for p in found.points
        ],
    }


def _ahead(mechanism: Mechanism, q: Array, found: list[Stretch]) -> str:
    """The singular pose that the least move of one input leads to; empty if it is this one."""
    best: tuple[float, str] | None = None
    for k, s in enumerate(found):
        index = mechanism.actuated[k]
        unit = mechanism.length_scale if mechanism.prismatic[index] else 1.0
        for p in s.points:
            gap = float(p.q[index] - q[index])
            if abs(gap) <= _HERE * unit:
                return ""
            if best is None or abs(gap) / unit < best[0]:
                sign = "+" if gap > 0 else "\u2212"
                far = input_text(mechanism, k, abs(gap))
                best = abs(gap) / unit, f"{p.kind} is nearest: {s.name} {sign} {far}"
    return "" if best is None else best[1]


def _assemblies(mechanism: Mechanism, q: Array) -> list[dict[str, Any]]:
    try:
        found = [s.q for s in assemblies(mechanism, q[list(mechanism.actuated)])]
    except InfeasibleError:
        # At a type 2 singularity rounding decides whether the loops close at all.
        found = []
    return _modes(mechanism, q, found)


def _working(mechanism: Mechanism, q: Array) -> list[dict[str, Any]]:
    dyad = planar_dyad(mechanism)
    return [] if dyad is None else _modes(mechanism, q, list(dyad.working_modes(dyad.point(q))))


def _modes(mechanism: Mechanism, q: Array, found: list[Array]) -> list[dict[str, Any]]:
    """Each mode once, the present one always among them; those of one name numbered."""
    away = [float(np.abs(mechanism.space.wrap(x - q)).max()) for x in found]
    here = int(np.argmin(away)) if away and min(away) <= _SAME else None
    if here is None:
        found, here = [q, *found], 0
    names = [mode_of(mechanism, q if i == here else x) for i, x in enumerate(found)]
    return [
        {
            "name": name if names.count(name) == 1 else f"{name} ({names[: i + 1].count(name)})",
            "q": rounded(q if i == here else x, 12),
            "here": i == here,
        }
        for i, (name, x) in enumerate(zip(names, found, strict=True))
    ]
