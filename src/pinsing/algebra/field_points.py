"""Polynomials at points over finite fields in the compiled engine, where it covers them.

What is not covered (no engine, a prime of more than 62 bits, long exponents, many free variables)
is None here, and is computed with flint's elements by those who ask.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pinsing._batch import engine

_BITS = 62


def covered(prime: int) -> bool:
    """Whether the engine is there, and takes residues modulo a prime."""
    return engine.available() and prime > 2 and prime.bit_length() <= _BITS


def polynomial(prime: int, terms: Mapping[Any, int]) -> Any:
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


def point(
    field: Any,
    count: int,
    fixed: Iterable[tuple[int, int]],
    free: Mapping[int, Any],
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


def elements(field: Any, lines: Sequence[Sequence[int]]) -> list[Any]:
    """Elements of a field, from the coefficients that the engine tells."""
    if int(field.degree()) == 1:
        return [field(line[0]) for line in lines]
    return [field(list(line)) for line in lines]
