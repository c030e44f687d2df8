"""Polynomials modulo primes at which 2 and 3 are squares."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

from flint import Ordering, fmpz_mod_mpoly_ctx, nmod_mpoly_ctx

from pinsing.algebra.ring import Poly, Ring
from pinsing.geometry.surd import SQUARES, Exact, parts_of

WORD_PRIME = 4611686018427387817
"""The largest prime below 2^62 that is 1 modulo 24."""
SECOND_PRIME = 4611686018427387409
"""The next one: what random points modulo the first say is asked again modulo this one."""


def residue(value: Exact, prime: int) -> int:
    """A number modulo a prime, square roots at one of their values there."""
    total = 0
    for square, part in zip(SQUARES, parts_of(value), strict=True):
        if part:
            scale = part.numerator * pow(part.denominator, -1, prime)
            total += scale * root_modulo(square, prime)
    return total % prime


def image(poly: Poly, ring: Ring, prime: int) -> Any:
    """A polynomial modulo a prime, in the joints' variables."""
    terms = {m: residue(c, prime) for m, c in ring.terms(poly).items()}
    names = tuple(ring.context.names()[: ring.nvars])
    return modular_context(names, prime).from_dict({m: c for m, c in terms.items() if c})


@functools.cache
def modular_context(names: tuple[str, ...], prime: int) -> Any:
    """Flint's ring of polynomials modulo a prime, lexicographic order."""
    kind = nmod_mpoly_ctx if prime.bit_length() < 64 else fmpz_mod_mpoly_ctx
    return kind.get(list(names), prime, Ordering.lex)


@functools.cache
def root_modulo(square: int, prime: int) -> int:
    """Square root of 1, 2, 3 or 6 modulo a prime that is 1 modulo 24.

    sqrt(2) = z + 1/z for a z of order 8, sqrt(3) for one of order 12.
    """
    if square == 1:
        return 1
    if square == 6:
        return root_modulo(2, prime) * root_modulo(3, prime) % prime
    order = {2: 8, 3: 12}[square]
    for base in range(2, 1000):
        z = pow(base, (prime - 1) // order, prime)
        root = (z + pow(z, -1, prime)) % prime
        if (root * root - square) % prime == 0:
            return root
    raise ArithmeticError(f"no square root of {square} modulo {prime}")


def rank_over(field_rows: Sequence[Sequence[Any]]) -> int:
    """Rank of a matrix over a finite field, by elimination."""
    rows = [list(row) for row in field_rows]
    rank = 0
    while rows and rows[0]:
        k = next((i for i, row in enumerate(rows) if not row[0].is_zero()), None)
        if k is None:
            rows = [row[1:] for row in rows]
            continue
        pivot = rows.pop(k)
        inverse = pivot[0].inverse()
        rows = [
            [x - row[0] * inverse * p for x, p in zip(row[1:], pivot[1:], strict=True)]
            for row in rows
        ]
        rank += 1
    return rank
