"""Polynomials modulo primes at which 2 and 3 are squares."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from flint import Ordering, fmpz_mod_mpoly_ctx, nmod_mpoly_ctx

from pinsing._batch import engine
from pinsing.algebra.ring import Poly, Ring, terms_of
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


def covered(prime: int) -> bool:
    """Whether the engine is there, and takes residues modulo a prime."""
    return engine.available() and prime > 2 and prime.bit_length() <= 62


def engine_polynomial(prime: int, terms: Mapping[Any, int]) -> Any:
    """A polynomial of the engine; None where it is not covered.

    Parameters
    ----------
    prime : int
        Its characteristic.
    terms : mapping of exponents to int
        Coefficients from 0 to the prime, exclusive.
    """
    if not covered(prime):
        return None
    module = engine.module()
    if max(map(max, terms), default=0) > module.MOST_EXPONENT:
        return None
    return module.ModularPolynomial(prime, list(terms), list(terms.values()))


def engine_point(
    field: Any, count: int, fixed: Iterable[tuple[int, int]], free: Mapping[int, Any]
) -> Any:
    """A point of the engine; None where it is not covered.

    Parameters
    ----------
    field : fq_default_ctx
        Of the coordinates.
    count : int
        Number of variables.
    fixed : iterable of (int, int)
        Variables, and residues that they are.
    free : mapping of int to fq_default
        Variables, and elements of the field that they are.
    """
    prime, degree = int(field.characteristic()), int(field.degree())
    if not covered(prime) or len(free) > engine.module().MOST_FREE:
        return None
    modulus = [int(c) for c in field.modulus().coeffs()] if degree > 1 else [0, 1]
    given = [(v, [int(c) for c in x.to_list()]) for v, x in free.items()]
    return engine.module().FieldPoint(prime, modulus, count, list(fixed), given)


def field_elements(field: Any, lines: Sequence[Sequence[int]]) -> list[Any]:
    """Elements of a field, from the coefficients that the engine tells."""
    if int(field.degree()) == 1:
        return [field(line[0]) for line in lines]
    return [field(list(line)) for line in lines]
