"""A polynomial in half-angle coordinates as an exact sum of cosines and sines.

With w = exp(i q), cos(q/2) and sin(q/2) are (w + 1) and -i (w - 1), both over 2 exp(i q/2): put
in, a form of degree d is a polynomial in w whose coefficients are rational where the form's are,
and w^k stands for the frequency k - d/2. Nothing is rounded, and nothing dropped.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from flint import Ordering, fmpq_mpoly_ctx

from pinsing.algebra.ring import Poly, Ring
from pinsing.geometry.surd import SQUARES, Exact, surd

Key = tuple[tuple[int, ...], tuple[int, ...]]
"""Twice the multiple of each angle, the first one that is not 0 positive; powers of sliders."""
_SIGNS = (1, -1, -1, 1)
"""Of (-i)^k: 1, -i, -1, i."""


def fourier(poly: Poly, ring: Ring, quarters: Sequence[int]) -> dict[Key, tuple[Exact, Exact]]:
    """Coefficients of cos(k.q/2) and sin(k.q/2), up to a common positive factor; none is (0, 0).

    Parameters
    ----------
    poly : Poly
        Homogeneous in each revolute joint's pair of variables.
    ring : Ring
        Its ring.
    quarters : sequence of int
        Right angles by which the ring's angle of each joint exceeds q.
    """
    n = len(ring.prismatic)
    halves: tuple[dict[Any, Any], dict[Any, Any]] = ({}, {})  # real and imaginary coefficients
    seconds = [ring.variables(j)[1] for j in range(n) if not ring.prismatic[j]]
    some: tuple[int, ...] = ()
    terms = poly.to_dict()
    scale = math.lcm(*(int(c.q) for c in terms.values()))  # sums of whole numbers are cheap
    for m, c in terms.items():
        some = m
        turns = sum(int(m[v]) for v in seconds) % 4
        halves[turns % 2][m] = c * (scale * _SIGNS[turns])
    degree = [
        0 if ring.prismatic[j] else sum(int(some[v]) for v in ring.variables(j)) for j in range(n)
    ]
    gathered: dict[Key, list[list[int]]] = {}
    for imaginary, half in enumerate(halves):
        if not half:
            continue
        context, images = _target(ring.prismatic, tuple(getattr(ring, "roots", ())))
        there = ring.context.from_dict(half).compose(*images, ctx=context)
        for m, c in there.to_dict().items():
            square = 1
            for d, e in zip(getattr(ring, "roots", ()), m[n:], strict=True):
                square *= d if e else 1
            _add(m, imaginary, square, int(c.p), ring, degree, quarters, gathered)
    out = {}
    for key, (real, imag) in gathered.items():
        pair = surd(*map(Fraction, real)), -surd(*map(Fraction, imag))
        if any(pair):  # a Surd is never zero
            out[key] = pair
    return out


def _add(
    m: Sequence[int],
    imaginary: int,
    square: int,
    c: int,
    ring: Ring,
    degree: Sequence[int],
    quarters: Sequence[int],
    gathered: dict[Key, list[list[int]]],
) -> None:
    """Add Re(c i^imaginary w^m) to the sums of what is known of its frequency."""
    prismatic = ring.prismatic
    joints = range(len(degree))
    frequency = tuple([0 if prismatic[j] else 2 * int(m[j]) - degree[j] for j in joints])
    power = tuple([int(m[j]) if prismatic[j] else 0 for j in joints])
    parts = [(c, imaginary)]
    eighths = sum(k * q for k, q in zip(frequency, quarters, strict=True))
    if eighths % 2:  # so it is for all terms: times exp(i pi/4), up to sqrt 2
        parts.append((c, imaginary + 1))
    lead = next((k for k in frequency if k), 0)
    if lead < 0:
        frequency = tuple(-k for k in frequency)
    sums = gathered.setdefault((frequency, power), [[0] * 4, [0] * 4])
    for value, turn in parts:
        quarter = (turn + eighths // 2) % 4
        value = -value if quarter >= 2 else value
        if quarter % 2 and lead < 0:  # Re(c e^{i phi}) = Re(conj(c) e^{-i phi})
            value = -value
        if quarter % 2 and lead == 0:
            continue  # a constant has no sine
        sums[quarter % 2][SQUARES.index(square)] += value


@functools.cache
def _target(prismatic: tuple[bool, ...], roots: tuple[int, ...]) -> tuple[Any, list[Any]]:
    """The ring in w, and what the variables of the ring in half-angles become there."""
    names = [f"w{j}" for j in range(len(prismatic))] + [f"s{d}" for d in roots]
    context = fmpq_mpoly_ctx.get(names, Ordering.lex)
    gens = context.gens()
    images: list[Any] = []
    for j, slides in enumerate(prismatic):
        images += [gens[j]] if slides else [gens[j] + 1, gens[j] - 1]
    return context, [*images, *gens[len(prismatic) :]]
