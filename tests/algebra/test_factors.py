"""Factors of forms in half-angle coordinates: as flint finds them, and in its order of joints."""

import random
from fractions import Fraction
from typing import Any

import pytest

from pinsing.algebra.ring import make_ring

RING = make_ring((False, True, False, False))
X1, Y1, Z, X3, Y3, X4, Y4 = RING.context.gens()


def form(chance: random.Random, degrees: tuple[int, int, int, int], terms: int) -> Any:
    """A polynomial, homogeneous in the variables of each joint that turns."""
    first, slide, third, last = degrees
    found = RING.zero
    for _ in range(terms):
        a, s, b, c = (chance.randint(0, d) for d in (first, slide, third, last))
        number = Fraction(chance.choice((-1, 1)) * chance.randint(1, 40), chance.randint(1, 9))
        monomial = X1**a * Y1 ** (first - a) * Z**s * X3**b * Y3 ** (third - b)
        found += RING.number(number) * monomial * X4**c * Y4 ** (last - c)
    return found


def by_flint(poly: Any) -> list[str]:
    """Without x^2 + y^2."""
    factors = [f for f, _ in poly.factor()[1]]
    return sorted(str(f) for f in factors if all(w is None or f != w for w in RING.w))


@pytest.mark.parametrize("seed", range(12))
def test_forms_fall_into_the_same_factors(seed: int) -> None:
    chance = random.Random(seed)
    one = form(chance, (2, seed % 3, 3, 2), 9)
    other = form(chance, (1, 1, 0, 2), 5)
    square = form(chance, (0, seed % 2, 2, 1), 4)
    for poly in (
        one * other,
        one * X1 * Y1**2 * Y4 * (X3**2 + Y3**2),
        one * other * square**2 * Z * Y3,
        (one * other) * 7 * X4,
    ):
        whole = RING._of_form(poly)
        found = [f for f in whole if all(w is None or f != w for w in RING.w)]
        assert sorted(map(str, found)) == by_flint(poly) == sorted(map(str, RING.factors(poly)))
        joints = [min(RING.joints_of(f)) for f in found]
        assert joints == sorted(joints, reverse=True)


def test_what_is_no_form_is_left_to_flint() -> None:
    poly = (X1 + Y1 + 1) * (form(random.Random(3), (2, 1, 2, 2), 14) + 5)
    assert len(poly) >= 20
    assert RING._of_form(poly) is None
    assert sorted(map(str, RING.factors(poly))) == by_flint(poly)
    whole = form(random.Random(4), (2, 1, 2, 2), 30)
    for v in (X1, Y1, X3, Y3, X4, Y4):
        assert RING._of_form(whole * v + whole) is None
    assert RING._of_form(whole * Z + whole) is not None  # a slide may have any power
