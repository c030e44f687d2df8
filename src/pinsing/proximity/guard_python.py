"""A guard in Python, for NumPy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pinsing.algebra.conditions import Conditions
from pinsing.proximity.guard_source import COMBINED, PLACE, GuardSource, template


def python_text(source: GuardSource) -> str:
    """The module, ASCII only."""
    c = source.conditions
    constants: dict[str, Any] = {
        "ROBOT": source.robot,
        "TASK": source.task,
        "LENGTH_SCALE": source.length_scale,
        "VERSION": source.version,
        "ROBOT_HASH": source.robot_hash,
        "JOINTS": source.joints,
        "LOWER": source.lower.tolist(),
        "UPPER": source.upper.tolist(),
        "FAMILIES": [name for name, _ in source.families],
        "TEXTS": [text for _, text in source.families],
        "COMPLETE": source.complete,
        "WORD": source.word,
        "NOTES": source.notes,
        "TOLERANCE": source.tolerance,
        "JACOBIAN_CHANGE": source.change,
        "WEIGHT": c.weight.tolist(),
        "TURN": c.turn.tolist(),
    }
    said = {
        "COMPLETE": "False: families are known to be missing, so that clearance is always 0",
        "WORD": "that FAMILIES are all of them is proven, probable, or not complete; see NOTES",
        "TOLERANCE": "radians: angles of the description were moved by at most this",
        "JACOBIAN_CHANGE": "which changes no column of the Jacobian by more than this",
        "WEIGHT": "what joint differences are multiplied by",
        "TURN": "a whole turn, weighted; 0 for joints that slide",
        "LOWER": "radians and metres; infinite where there is no limit",
    }
    lines = []
    for key, value in constants.items():
        if key in said:
            lines.append(f"# {said[key]}")
        lines.append(f"{key} = {_literal(value)}")
    branches = [
        (
            int(c.family[b]),
            tuple(
                (int(c.value_joint[i]), float(c.value[i]))
                for i in range(c.value_start[b], c.value_start[b + 1])
            ),
            tuple(range(int(c.equation_start[b]), int(c.equation_start[b + 1]))),
        )
        for b in range(c.branches)
    ]
    parts = {
        "constants": "\n".join(lines),
        "branches": _rows(branches),
        "equations": _rows([_equation(c, e) for e in range(len(c.noise))]),
        "combined": str(COMBINED),
    }
    # Each place is looked for in the template, not in what was put in before.
    pieces = PLACE.split(template("guard.py.in"))
    pieces[1::2] = [parts[key] for key in pieces[1::2]]
    return "".join(pieces)


def _equation(c: Conditions, e: int) -> tuple[object, ...]:
    terms = []
    for t in range(c.term_start[e], c.term_start[e + 1]):
        rates = range(c.rate_start[t], c.rate_start[t + 1])
        powers = range(c.power_start[t], c.power_start[t + 1])
        terms.append(
            (
                float(c.amplitude[t]),
                float(c.phase[t]),
                float(c.rate_norm[t]),
                tuple((int(c.rate_joint[k]), float(c.rate[k])) for k in rates),
                tuple((int(c.power_joint[k]), int(c.power[k])) for k in powers),
            )
        )
    curvature = None if c.sliding[e] else float(c.curvature[e])
    return float(c.noise[e]), float(c.reach[e]), curvature, float(c.steepness[e]), tuple(terms)


def _rows(values: Sequence[object]) -> str:
    if not values:
        return "()"
    return "(\n" + "".join(f"    {_literal(v)},\n" for v in values) + ")"


def _literal(value: object) -> str:
    """What Python reads as the same value, in ASCII whatever a name holds."""
    if isinstance(value, float) and math.isinf(value):
        return 'float("inf")' if value > 0 else '-float("inf")'
    if isinstance(value, str):
        return ascii(value)
    if isinstance(value, tuple | list):
        words = [_literal(v) for v in value]
        return f"({', '.join(words)}{',' if len(words) == 1 else ''})"
    return repr(value)
