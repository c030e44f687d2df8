"""Exact numbers modulo primes, square roots at one of their values there."""

from __future__ import annotations

import functools

from pinsing.robot.surd import SQUARES, Exact, parts_of

_SMALL = 1000
"""Primes below which all residues are tried."""


def residue(value: Exact, prime: int) -> int:
    """A number modulo a prime, square roots at one of their values there."""
    total = 0
    for square, part in zip(SQUARES, parts_of(value), strict=True):
        if part:
            scale = part.numerator * pow(part.denominator, -1, prime)
            total += scale * root_modulo(square, prime)
    return total % prime


@functools.cache
def root_modulo(square: int, prime: int) -> int:
    """Square root of 1, 2, 3 or 6 modulo a prime that is 1 modulo 24, or a small one.

    sqrt(2) = z + 1/z for a z of order 8, sqrt(3) for one of order 12.

    Raises
    ------
    ValueError
        If there is none modulo the prime.
    """
    if square == 1:
        return 1
    if square == 6:
        return root_modulo(2, prime) * root_modulo(3, prime) % prime
    if prime < _SMALL:
        for root in range(1, prime):
            if (root * root - square) % prime == 0:
                return root
        raise ValueError(f"no square root of {square} modulo {prime}")
    order = {2: 8, 3: 12}[square]
    for base in range(2, 1000):
        z = pow(base, (prime - 1) // order, prime)
        root = (z + pow(z, -1, prime)) % prime
        if (root * root - square) % prime == 0:
            return root
    raise ValueError(f"no square root of {square} modulo {prime}")
