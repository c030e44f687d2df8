"""For which lengths an equation has no solution at all.

An equation ``c + sum of A_k cos(phase_k) = 0`` whose phases take all values independently, which
they do where their frequencies are linearly independent, has a real solution exactly where |c| is
at most the sum of the |A_k|.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pinsing.algebra.equation import Equation

_MOST = 3
"""Phases beyond which nobody reads the condition."""

Sum = dict[tuple[int, ...], int]
"""A polynomial in the lengths: whole coefficients of products of powers."""


def unreal(e: Equation, n: int) -> str:
    """The lengths at which an equation in n joints has no solution; empty where it always has one.

    Parameters
    ----------
    e : Equation
        In joints and, after these, in lengths.
    n : int
        Number of joints.

    Returns
    -------
    str
        ``|a1| > |a2| + sqrt(d4^2 + a3^2)``; empty too where this way does not tell.
    """
    if e.powers[:, :n].any() or e.frequencies[:, n:].any() or not e.exact:
        return ""
    found: dict[tuple[int, ...], tuple[Sum, Sum]] = {}
    for f, p, pair in zip(e.frequencies, e.powers, e.exact, strict=True):
        both = found.setdefault(tuple(int(k) for k in f), ({}, {}))
        for part, number in zip(both, pair, strict=True):
            try:
                value = int(number)
            except ValueError:  # with a square root
                return ""
            if value:
                part[tuple(int(k) for k in p[n:])] = value
    if not e.powers.any():
        return ""
    constant = found.pop((0,) * e.frequencies.shape[1], None)
    if constant is None or not found or len(found) > _MOST:
        return ""
    if np.linalg.matrix_rank(np.array(list(found))) < len(found):
        return ""
    shared = _shared([constant, *found.values()])
    names = e.joints[n:]
    return f"{_size(constant, names, shared)} > " + " + ".join(
        _size(pair, names, shared) for pair in found.values()
    )


def _shared(pairs: Sequence[tuple[Sum, Sum]]) -> tuple[int, ...]:
    """Powers that all terms have: a common factor."""
    every = [m for pair in pairs for part in pair for m in part]
    return tuple(min(column) for column in zip(*every, strict=True))


def _size(pair: tuple[Sum, Sum], names: Sequence[str], shared: Sequence[int]) -> str:
    """The largest value of A cos + B sin, written out."""
    parts = [_written(part, names, shared) for part in pair if part]
    if len(parts) == 1:
        return f"|{parts[0]}|" if not parts[0].isdigit() else parts[0]
    squares = [f"{p}^2" if p.isidentifier() or p.isdigit() else f"({p})^2" for p in parts]
    return f"sqrt({' + '.join(squares)})"


def _written(
    part: Mapping[tuple[int, ...], int], names: Sequence[str], shared: Sequence[int]
) -> str:
    """``2 a2 d4 - a3^2``, its first term positive: only its square or size counts."""
    sign = 1 if next(iter(part.values())) > 0 else -1
    out = ""
    for m, value in part.items():
        powers = [(name, k - less) for name, k, less in zip(names, m, shared, strict=True)]
        factors = [name if k == 1 else f"{name}^{k}" for name, k in powers if k]
        number = value * sign
        body = " ".join([str(abs(number))] * (abs(number) != 1 or not factors) + factors)
        out += f" {'-' if number < 0 else '+'} {body}" if out else body
    return out
