"""Polynomials modulo primes at which 2 and 3 are squares."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

from flint import Ordering, fmpz_mod_mpoly_ctx, nmod_mpoly_ctx

from pinsing.algebra.ring import Poly, Ring
from pinsing.algebra.terms import terms_of
from pinsing.robot.nominal import PRIMES
from pinsing.robot.surd import residue, root_modulo

WORD_PRIME, SECOND_PRIME = PRIMES
"""What random points modulo the first say is asked again modulo the second."""

__all__ = [
    "SECOND_PRIME",
    "WORD_PRIME",
    "image",
    "image_of",
    "modular_context",
    "rank_over",
    "residue",
    "residues_of",
    "root_modulo",
]


def image(poly: Poly, ring: Ring, prime: int) -> Any:
    """A polynomial modulo a prime, in the joints' variables."""
    return image_of(residues_of(poly, ring, prime), ring, prime)


def image_of(terms: Mapping[Any, int], ring: Ring, prime: int) -> Any:
    """The polynomial of what ``residues_of`` gave."""
    names = tuple(ring.context.names()[: ring.nvars])
    return modular_context(names, prime).from_dict({m: c for m, c in terms.items() if c})


def residues_of(poly: Poly, ring: Ring, prime: int) -> dict[Any, int]:
    """Exponents of the joints' variables, and coefficients modulo a prime, some perhaps zero."""
    if ring.rational:
        inverse: dict[Any, int] = {}
        terms = {}
        for m, c in terms_of(poly).items():
            if c.q not in inverse:
                inverse[c.q] = pow(int(c.q), -1, prime)
            terms[m] = int(c.p) * inverse[c.q] % prime
        return terms
    return {m: residue(c, prime) for m, c in ring.terms(poly).items()}


@functools.cache
def modular_context(names: tuple[str, ...], prime: int) -> Any:
    """Flint's ring of polynomials modulo a prime, lexicographic order."""
    kind = nmod_mpoly_ctx if prime.bit_length() < 64 else fmpz_mod_mpoly_ctx
    return kind.get(list(names), prime, Ordering.lex)


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
