"""Joint values as people type and read them."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from pinsing.prose import unbroken

_EXACT = 12
"""Digits after which a configuration is as singular as it was."""


def typed(
    q: npt.ArrayLike,
    prismatic: npt.ArrayLike,
    degrees: bool = False,
    digits: int = _EXACT,
    *,
    loose: Collection[int] = (),
    room: int | None = None,
) -> str:
    """A configuration as an option that can be pasted: ``--q 0.4,pi/2,-1.2``, ``--deg --q ...``.

    Parameters
    ----------
    q : (n,) array_like
        Radians and metres.
    prismatic : (n,) array_like of bool
        Which joints slide.
    degrees : bool
        Give revolute joints in degrees, and say so.
    digits : int
        Significant digits.
    loose : collection of int
        Joints that six digits do for.
    room : int, optional
        Columns that there are; if they are too few the numbers stand in quotes, so that a line may
        end between two of them.
    """
    slides = np.asarray(prismatic, dtype=bool)
    words = [
        _number(float(value), bool(slides[j]), degrees, 6 if j in loose else digits)
        for j, value in enumerate(np.asarray(q, dtype=float))
    ]
    option = f"{'--deg ' if degrees else ''}--q "
    line = unbroken(option) + ",".join(words)
    if room is None:
        return line.replace("\u00a0", " ")
    if len(line) <= room or len(words) < 2:
        return line
    return f'{unbroken(option)}"{", ".join(words)}"'


def _number(value: float, slides: bool, degrees: bool, digits: int) -> str:
    quarters = round(value / (math.pi / 2))
    if not slides and quarters and abs(value - quarters * math.pi / 2) < 1e-14 * abs(value):
        return f"{90 * quarters}" if degrees else _quarter_turns(quarters)
    if abs(value) < 10.0 ** -min(digits + 3, _EXACT):
        return "0"
    return f"{math.degrees(value) if degrees and not slides else value:.{digits}g}"


def _quarter_turns(quarters: int) -> str:
    """``pi/2``, ``-pi``, ``3pi/2``."""
    sign = "-" if quarters < 0 else ""
    top, bottom = (abs(quarters), "/2") if quarters % 2 else (abs(quarters) // 2, "")
    return f"{sign}{top if top > 1 else ''}pi{bottom}"
