"""Factors of forms in half-angle coordinates: those that flint finds without knowing of forms."""

import itertools

import numpy as np
import pytest
from flint import fmpq

from pinsing.algebra.ring import make_ring

RING = make_ring((False, False, True, False))


def some_form(rng, degrees):
    """A random form: of a degree in each turning joint's pair, a polynomial in the slider."""
    terms = {}
    for powers in itertools.product(*(range(d + 1) for d in degrees)):
        a, b, z, c = powers
        m = (degrees[0] - a, a, degrees[1] - b, b, z, degrees[3] - c, c)
        terms[m] = fmpq(int(rng.integers(-9, 10)), int(rng.integers(1, 5)))
    return RING.context.from_dict({m: c for m, c in terms.items() if c})


@pytest.mark.parametrize("seed", range(12))
def test_factors_of_forms_are_those_that_flint_finds(seed):
    rng = np.random.default_rng(seed)
    parts = [some_form(rng, rng.integers(0, 3, 4).tolist()) for _ in range(3)]
    poly = parts[0] * parts[1] * parts[2] ** int(rng.integers(1, 3))
    poly *= RING.context.gens()[int(rng.integers(7))] ** int(rng.integers(0, 3))
    found = RING._of_form(poly)
    assert found is not None
    asked = [f for f, _ in poly.factor()[1]]
    told = [sorted(str(f / f.leading_coefficient()) for f in some) for some in (found, asked)]
    assert told[0] == told[1]


@pytest.mark.parametrize("seed", range(6))
def test_what_is_no_form_is_left_to_flint(seed):
    rng = np.random.default_rng(seed)
    form = some_form(rng, [2, 1, 1, 2])
    gens = RING.context.gens()
    for v in (0, 1, 2, 3, 5, 6):
        assert RING._of_form(form * gens[v] + form) is None
    assert RING._of_form(form * gens[4] + form) is not None  # a slider may have any power
