"""A polynomial in half-angle coordinates as an exact sum of cosines and sines.

With w = exp(i q), cos(q/2) and sin(q/2) are (w + 1) and -i (w - 1), both over 2 exp(i q/2): put
in, a form of degree d is a polynomial in w whose coefficients are rational where the form's are,
and w^k stands for the frequency k - d/2. Nothing is rounded, and nothing dropped: the coefficients
are a table of whole numbers, a direction a joint, and one joint after the other is put in.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from pinsing.algebra.ring import Poly, Ring, terms_of
from pinsing.robot.surd import SQUARES, Exact, surd

Key = tuple[tuple[int, ...], tuple[int, ...]]
"""Twice the multiple of each angle, the first one that is not 0 positive; powers of sliders."""
Ints = npt.NDArray[np.int64]


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
    terms = terms_of(poly)
    some = next(iter(terms))
    slides = np.array(ring.prismatic, dtype=bool)
    degree = [
        0 if slide else sum(int(some[v]) for v in ring.variables(j))
        for j, slide in enumerate(ring.prismatic)
    ]
    places, kinds, numbers = _put_in(terms, ring, degree)
    frequencies = np.where(slides, 0, 2 * places - np.array(degree))
    powers = np.where(slides, places, 0)
    eighths = frequencies @ np.array(quarters, dtype=np.int64)
    # An odd number of them is odd for all terms: times exp(i pi/4), up to sqrt 2.
    both = bool(eighths[0] % 2)
    turns = (eighths // 2).tolist()
    varying = [any(f) for f in frequencies.tolist()]
    keys = zip(map(tuple, frequencies.tolist()), map(tuple, powers.tolist()), strict=True)
    gathered: dict[Key, list[list[int]]] = {}
    for i, key in enumerate(keys):
        sums = gathered.get(key)
        if sums is None:
            sums = gathered[key] = [[0] * 4, [0] * 4]
        imaginary, square = kinds[i]
        # It is real: w^-k has the conjugate coefficient, and with it the same part of the sum.
        c = 2 * numbers[i] if varying[i] else numbers[i]
        for turn in (imaginary, imaginary + 1) if both else (imaginary,):
            quarter = (turn + turns[i]) % 4
            if quarter % 2 and not varying[i]:
                continue  # a constant has no sine
            sums[quarter % 2][square] += -c if quarter >= 2 else c
    out = {}
    for key, (real, imag) in gathered.items():
        pair = _exact(real), -_exact(imag)
        if any(pair):  # a Surd is never zero
            out[key] = pair
    return out


def _exact(parts: Sequence[int]) -> Exact:
    """A sum of whole numbers of the roots of SQUARES."""
    if any(parts[1:]):
        return surd(*map(Fraction, parts))
    return Fraction(parts[0])


def _put_in(
    terms: Mapping[Any, Any], ring: Ring, degree: Sequence[int]
) -> tuple[Ints, list[tuple[int, int]], list[int]]:
    """Powers of w and of sliders (N, n), whether times i and which root, and whole numbers.

    Of each frequency and its opposite only the one whose first entry that is not 0 is positive.
    """
    roots, count = tuple(getattr(ring, "roots", ())), ring.nvars
    turning = [j for j, d in enumerate(degree) if d]
    seconds = [ring.variables(j)[1] for j in turning]
    sliders = [j for j, slide in enumerate(ring.prismatic) if slide]
    lengths = [ring.variables(j)[0] for j in sliders]
    shape = [degree[j] + 1 for j in turning]
    scale = math.lcm(*{int(c.q) for c in terms.values()})  # sums of whole numbers are cheap
    tables: dict[tuple[tuple[int, ...], int], dict[tuple[int, ...], int]] = {}
    for m, c in terms.items():
        square = math.prod([d for d, e in zip(roots, m[count:], strict=True) if e])
        block = tables.setdefault((tuple([m[v] for v in lengths]), square), {})
        second = [m[v] for v in seconds]
        turns = sum(second) % 4
        # Of (-i)^k: 1, -i, -1, i.
        block[(turns % 2, *second)] = int(c.p) * (scale // int(c.q)) * (1, -1, -1, 1)[turns]
    found: list[tuple[Ints, list[int], int]] = []
    for (powers, square), block in tables.items():
        at, numbers = _transformed(block, shape)
        whole = np.zeros((len(at), len(degree) + 2), dtype=np.int64)
        whole[:, 0], whole[:, -1] = at[:, 0], square
        whole[:, [1 + j for j in sliders]] = powers
        whole[:, [1 + j for j in turning]] = at[:, 1:]
        found.append((whole, numbers, SQUARES.index(square)))
    places = np.concatenate([whole for whole, _, _ in found])
    numbers = [c for _, several, _ in found for c in several]
    which = [k for _, several, k in found for _ in several]
    # Those of the real part first; then greater powers before lesser ones.
    order = np.lexsort([*(-places[:, :0:-1]).T, places[:, 0]]).tolist()
    kinds = [(int(places[i, 0]), which[i]) for i in order]
    return places[order, 1:-1], kinds, [numbers[i] for i in order]


def _transformed(
    block: Mapping[tuple[int, ...], int], shape: Sequence[int]
) -> tuple[Ints, list[int]]:
    """Places (N, 1 + k) in a table and what is there, each x^a y^b as (w + 1)^a (w - 1)^b.

    As much of each number at a time as a machine's numbers have room for. Only what is not zero,
    and of two places that are opposite to each other only one.
    """
    grown = sum(d - 1 for d in shape)  # a joint of degree d makes numbers 2^d times as large
    # Of a machine's whole number, and what is left of it for less than so many is not worth it.
    room = 62 - grown - 1
    numbers = list(block.values())
    longest = max(abs(c).bit_length() for c in numbers)
    kind: npt.DTypeLike = np.int64
    if room < 8:
        room, kind = longest, object
    limbs = max(1, -(-longest // room))
    table = np.zeros((2, *shape, limbs), dtype=kind)
    at = tuple(np.array(list(block), dtype=np.intp).T)
    mask = (1 << room) - 1
    for k in range(limbs):
        parts = [(abs(c) >> (k * room) & mask) * (1 if c > 0 else -1) for c in numbers]
        table[(*at, k)] = np.array(parts, dtype=kind)
    for axis, d in enumerate(shape, 1):
        put = np.tensordot(table, _powers(d - 1).astype(kind), axes=([axis], [0]))
        table = np.moveaxis(put, -1, axis)
    places = np.argwhere(table.any(axis=-1))
    twice = 2 * places[:, 1:] + 1 - np.array(shape, dtype=np.int64)
    first = (twice != 0).argmax(axis=1) if len(shape) else 0
    if len(shape):
        places = places[twice[np.arange(len(twice)), first] >= 0]
    found = table[tuple(places.T)].T.tolist()
    out = found[0]
    for k in range(1, limbs):
        out = [c + (more << (k * room)) for c, more in zip(out, found[k], strict=True)]
    there = [i for i, c in enumerate(out) if c]
    return places[there], [out[i] for i in there]


@functools.cache
def _powers(degree: int) -> npt.NDArray[np.int64]:
    """Coefficients of w^k (columns) in (w + 1)^(degree - b) (w - 1)^b (rows)."""
    rows = []
    for b in range(degree + 1):
        row = [1]
        for factor in [1] * (degree - b) + [-1] * b:
            row = [factor * low + high for low, high in zip([*row, 0], [0, *row], strict=True)]
        rows.append(row)
    return np.array(rows, dtype=np.int64)
