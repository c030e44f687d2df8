"""Whether two sets of families separate the same joint space."""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.algebra.equation import Equation
from pinsing.errors import OptionError
from pinsing.families import Family
from pinsing.families.parts import Branch
from pinsing.proximity.watched import Watched

_SAME = 1e-9


def require_same_families(asked: Watched, given: Watched) -> None:
    """Refuse aspects (their families ``given``) that are not those of the forms ``asked`` about.

    Arms may share the names of their joints and all their limits, and differ in lengths: so the
    families are compared themselves.

    Raises
    ------
    OptionError
        Saying what differs.
    """
    if asked is given:
        return
    for what in ("joints", "prismatic", "lower", "upper"):
        if not np.array_equal(getattr(asked, what), getattr(given, what)):
            raise OptionError(f"the aspects given are of another arm: {_PLURAL[what]} differ")
    one, other = _separating(asked), _separating(given)
    if len(one) != len(other) or not all(map(_same, one, other)):
        raise OptionError("the aspects given are of another arm: what is singular differs")


_PLURAL = {
    "joints": "its joints",
    "prismatic": "the kinds of its joints",
    "lower": "its joint limits",
    "upper": "its joint limits",
}


def _separating(watched: Watched) -> list[Family]:
    return [f for f in watched.families if f.real and f.codimension == 1]


def _same(a: Family, b: Family) -> bool:
    return len(a.branches) == len(b.branches) and all(map(_alike, a.branches, b.branches))


def _alike(a: Branch, b: Branch) -> bool:
    if len(a.values) != len(b.values) or len(a.equations) != len(b.equations):
        return False
    values = all(
        v.joint == w.joint and abs(v.value - w.value) <= _SAME
        for v, w in zip(a.values, b.values, strict=True)
    )
    return values and all(map(_equal, a.equations, b.equations))


def _equal(a: Equation, b: Equation) -> bool:
    if not (np.array_equal(a.frequencies, b.frequencies) and np.array_equal(a.powers, b.powers)):
        return False
    return _near(a.cos, b.cos) and _near(a.sin, b.sin) and _near(a.shift, b.shift)


def _near(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max(initial=0.0) <= _SAME * max(1.0, np.abs(a).max(initial=0.0)))
