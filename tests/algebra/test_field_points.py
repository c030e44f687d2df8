"""Points over finite fields: the compiled engine against flint's elements."""

import dataclasses
import itertools
import random
from typing import Any

import numpy as np
import pytest
from flint import fq_default_ctx

from pinsing._batch import engine
from pinsing.algebra.budget import Budget
from pinsing.algebra.generic_points import Residues, SlicePoint, slice_points
from pinsing.algebra.jacobian_matrix import jacobian_matrix
from pinsing.algebra.matrix import reduce_matrix
from pinsing.algebra.minors import Minors
from pinsing.algebra.ring import make_ring
from pinsing.algebra.zeros import (
    SECOND_PRIME,
    WORD_PRIME,
    engine_point,
    engine_polynomial,
    field_elements,
    modular_context,
    zeros,
)
from pinsing.robot.load import load
from pinsing.robot.nominal import nominal

compiled = pytest.mark.skipif(not engine.available(), reason="the engine is not compiled here")
RNG = np.random.default_rng


def slow(point: SlicePoint) -> SlicePoint:
    """The same point, for flint's elements."""
    other = dataclasses.replace(point, monomials={}, on_slice=type(point.on_slice)())
    other.__dict__["_compiled"] = None
    return other


def no_check(_: float) -> None:
    """Time enough."""


@compiled
@pytest.mark.parametrize("prime", [WORD_PRIME, SECOND_PRIME, 3, 65_537])
@pytest.mark.parametrize("degree", [1, 2, 5, 17])
def test_polynomials_have_the_values_that_flint_says(prime: int, degree: int) -> None:
    chance = random.Random(prime + degree)
    field = fq_default_ctx(prime, degree, fq_type="FQ_NMOD")

    def element() -> Any:
        return field([chance.randrange(prime) for _ in range(degree)])

    free = {1: element(), 3: element(), 4: field.zero()}
    fixed = {0: chance.randrange(prime), 2: 0}
    point = engine_point(field, 5, fixed.items(), free)
    known = {**{v: field(x) for v, x in fixed.items()}, **free}
    for terms in (0, 1, 2, 30):
        poly = {
            tuple(chance.choice((0, 0, 1, 2, 7, 255)) for _ in range(5)): chance.randrange(prime)
            for _ in range(terms)
        }
        made = engine_polynomial(prime, poly)
        value = field.zero()
        for m, c in poly.items():
            term = field(c)
            for v, e in enumerate(m):
                term *= known[v] ** e
            value += term
        (told,) = field_elements(field, [point.value(made)])
        assert told == value
        assert point.is_zero(made) == value.is_zero()
        assert point.is_zero(engine_polynomial(prime, {(0,) * 5: 0}))


@compiled
@pytest.mark.parametrize("degree", [1, 4])
def test_a_line_is_the_polynomial_in_what_is_left(degree: int) -> None:
    prime = WORD_PRIME
    field = fq_default_ctx(prime, degree, fq_type="FQ_NMOD")
    x = field([5, 7, 11, 13][:degree])
    poly = {(2, 3): prime - 4, (0, 3): 9, (1, 0): 6, (4, 1): 1}
    lines = engine_point(field, 2, (), {0: x}).line(engine_polynomial(prime, poly), 1)
    told = field_elements(field, lines)
    assert told == [x * 6, x**4, field.zero(), field(9) - x * x * 4]


@compiled
def test_what_is_not_covered_is_left_to_flint(monkeypatch: pytest.MonkeyPatch) -> None:
    assert engine_polynomial(WORD_PRIME, {(256, 0): 1}) is None
    assert engine_polynomial(2**64 + 13, {(1, 0): 1}) is None
    assert engine_polynomial(2, {(1, 0): 1}) is None
    field = fq_default_ctx(WORD_PRIME, 1, fq_type="FQ_NMOD")
    many = {v: field(v) for v in range(17)}
    assert engine_point(field, 17, (), many) is None
    monkeypatch.setattr(engine, "_missing", "not there")
    assert engine_polynomial(WORD_PRIME, {(1, 0): 1}) is None
    assert engine_point(field, 1, (), {0: field(1)}) is None


@compiled
def test_what_makes_no_sense_is_refused() -> None:
    module = engine.module()
    poly = module.ModularPolynomial(7, [(1, 0, 2)], [3])
    point = module.FieldPoint(7, [0, 1], 3, [(0, 2)], [(2, [3])])
    assert point.value(poly) == [3 * 2 * 9 % 7]
    other = module.ModularPolynomial(11, [(1, 0, 2)], [3])
    unknown = module.ModularPolynomial(7, [(0, 1, 0)], [3])
    longer = module.ModularPolynomial(7, [(0, 0, 0, 1)], [3])
    for call in (
        lambda: point.value(other),
        lambda: point.is_zero(unknown),
        lambda: point.value(longer),
        lambda: point.rank([[poly, poly], [poly]]),
        lambda: point.line(unknown, 0),
        lambda: point.line(unknown, 9),
        lambda: point.along(0, 1, 1, 1),
        lambda: point.equals(5, 1),
        lambda: module.ModularPolynomial(8, [(1,)], [1]),
        lambda: module.ModularPolynomial(2**62 + 1, [(1,)], [1]),
        lambda: module.ModularPolynomial(7, [(1,)], [1, 2]),
        lambda: module.ModularPolynomial(7, [(-1,)], [1]),
        lambda: module.FieldPoint(7, [1], 1, [], []),
        lambda: module.FieldPoint(7, [1, 2], 1, [], []),
        lambda: module.FieldPoint(7, [0, 1], 1, [(1, 2)], []),
        lambda: module.FieldPoint(7, [0, 1], 1, [(0, 2)], [(0, [1])]),
        lambda: module.FieldPoint(7, [0, 1], 1, [], [(0, [1, 2])]),
    ):
        with pytest.raises(ValueError, match=r"."):
            call()


@compiled
@pytest.mark.parametrize("robot", ["panda", "stanford"])
def test_points_on_slices_say_what_flint_says(robot: str) -> None:
    geometry = nominal(load(robot))
    ring = make_ring(tuple(bool(p) for p in geometry.arm.prismatic))
    matrix = jacobian_matrix(geometry, ring, geometry.arm.task, Budget(60))
    rows, rank = reduce_matrix(matrix, 6, ring, Budget(60))
    minors = list(itertools.islice(Minors(rows, rank, ring, Budget(60)), 5))
    entries = [x for row in rows for x in row if len(x) > 1] + minors
    residues = Residues(ring)
    x2, y2, z = (ring.context.gens()[i] for i in (2, 3, 4))
    p, g = x2**2 - 3 * z**2 * x2 * y2 - 2 * y2**2, z * x2 - 5 * y2
    if robot == "panda":
        p, g = (max(ring.factors(minors[i]), key=len) for i in (1, 4))
    degrees = set()
    for s in slice_points((p, g), residues, RNG(3), {}, no_check):
        other = slow(s)
        degrees.add(int(s.field.degree()))
        assert s._compiled is not None
        assert s.is_zero(p)
        assert s.is_zero(g)
        for x in entries:
            assert s.is_zero(x) == other.is_zero(x)
        for some in (rows, rows[:2], [rows[0], rows[0]]):
            assert s.rank(some) == other.rank(some)
        for j, slides in enumerate(ring.prismatic):
            for value in ((0,),) if slides else ((1, 0), (0, 1), (1, 1)):
                assert s.has(j, value) == other.has(j, value)
    assert len(degrees) > 1


@compiled
def test_zeros_are_those_of_flint(monkeypatch: pytest.MonkeyPatch) -> None:
    plane = modular_context(("a", "b"), WORD_PRIME)
    a, b = plane.gens()
    polys = [a**3 * b - 5 * a * b**2 + 7, b**4 + a * b - 3 * a**2 + 1]
    circles = {0: a * a + 1, 1: b * b + 1}

    def found(patient: bool) -> list[tuple[int, list[str]]]:
        told = zeros(polys, range(2), circles, RNG(0), no_check, patient)
        return [(int(z.field.degree()), [str(z.at[0]), str(z.at[1])]) for z in told]

    now = found(True)
    assert sum(degree for degree, _ in now) == 14
    assert found(False) == now
    monkeypatch.setattr(engine, "_missing", "not there")
    assert found(True) == now
