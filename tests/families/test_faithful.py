"""What is stated is the exact components, and every answer is checked for that."""

import math
from dataclasses import replace

import numpy as np
import pytest
from public import script
from singular_sets import ring_for
from tiers import tiered_rows

import pinsing
from pinsing.algebra import real_roots as roots
from pinsing.algebra.ring import make_ring
from pinsing.families import describe
from pinsing.families.certificate import prove
from pinsing.families.faithful import disagreements

EVEN = [(0, 0, 0.2, 0), (0, 0, 0.2, -90), (0, 0, 0.2, 90), (0, 0, 0, 0)]
"""Links alike: all of q3 = 180° is singular, and of q3 = 0 what has q2 = 0 or 180°."""
SYMMETRIC = [(0, 0.4, 0, 90), (-90, 0, 0.3, -90), *[(0, 0.25, 0.2, 180)] * 2, (-90, 0, 0.3, -90)]
SYMMETRIC += [(0, 0.4, 0, 90)]


def chain(rows, task="pose"):
    chains = script("oracle.chains")
    return chains.arm_of(chains.Spec(tuple(chains.Row(*r) for r in rows), task))


def on_no_family(form, arm, **degrees):
    """How many of 40 singular points with joints at values lie on no family, and of how many."""
    q = np.random.default_rng(0).uniform(-3, 3, (40, arm.n))
    for name, value in degrees.items():
        q[:, int(name[1:]) - 1] = math.radians(value)
    sizes = pinsing.singular_values(arm, q)
    q = q[sizes[:, form.generic_rank - 1] < 1e-12 * sizes[:, 0]]
    return sum(form.family_of(x) is None for x in q), len(q)


@pytest.mark.parametrize("turned", [0, 180])
def test_a_rational_value_lies_only_where_it_is(turned):
    """0 was taken for 180 degrees, and a component dropped as a part of q3 = 180 degrees."""
    arm = chain(EVEN)
    form = pinsing.closed_form(arm, seconds=60, prove=False)
    assert form.complete, form.gaps
    assert on_no_family(form, arm, q2=turned, q3=0) == (0, 40)
    assert on_no_family(form, arm, q3=180) == (0, 40)


@pytest.mark.slow
def test_what_is_nearly_zero_is_no_error():
    """An equation is 1e-11 of its terms at a joint value without singular configurations."""
    a, d = (0, 0, 0.0825, -0.0835, 0, 0.088, 0), (0.333, 0, 0.316, 0, 0.384, 0, 0.107)
    alpha = (-90, 90, 90, -90, 90, 90, 0)
    form = pinsing.closed_form(chain([(0, *row) for row in zip(d, a, alpha, strict=True)]))
    assert (form.word, len(form.families)) == ("proven", 4)


@pytest.mark.slow
def test_a_relation_that_is_a_product_has_all_of_its_roots():
    """sin q3 = 0 was solved as q3 = 0."""
    arm = chain(SYMMETRIC, "vx,vy,vz,wz")
    form = pinsing.closed_form(arm, seconds=60, prove=False)
    assert form.complete, form.gaps
    for q3 in (0, 180):
        for q5 in (2 * math.degrees(math.atan(1 / 3)), 2 * math.degrees(math.atan(1 / 3)) - 180):
            assert on_no_family(form, arm, q3=q3, q4=0, q5=q5) == (0, 40)


def test_a_value_read_wrongly_is_no_complete_answer(monkeypatch):
    real = describe.PieceMaker._at_exact_values

    def at_half_a_turn(self, branch, components):
        held = [replace(v, exact=(0, 1)) if v.joint == 2 else v for v in branch.values]
        return real(self, replace(branch, values=tuple(held)), components)

    monkeypatch.setattr(describe.PieceMaker, "_at_exact_values", at_half_a_turn)
    form = pinsing.closed_form(chain(EVEN), seconds=60, prove=True)
    assert not form.complete
    assert any("on no family that is stated" in gap for gap in form.gaps)


@pytest.mark.slow
def test_a_root_that_is_lost_is_no_complete_answer(monkeypatch):
    monkeypatch.setattr(
        describe, "real_roots", lambda *a: [v for v in roots.real_roots(*a) if v.ball is not None]
    )
    form = pinsing.closed_form(chain(SYMMETRIC, "vx,vy,vz,wz"), seconds=60)
    assert not form.complete
    assert any("on no family that is stated" in gap for gap in form.gaps)


TOLD = [("ur5", "pose"), ("puma560", "position"), ("panda", "pose")]


@pytest.mark.parametrize(("name", "task"), tiered_rows(TOLD, TOLD[:2]))
def test_a_branch_that_is_missing_or_another_is_told(name, task):
    form = pinsing.closed_form(pinsing.load(name, task=task), seconds=60)
    geometry = form.geometry
    ring = ring_for(geometry)

    def said(families):
        return disagreements(families, form.left_out, ring, geometry, form.symbols)

    assert said(form.families) == []
    for i, family in enumerate(form.families):
        others = [*form.families[:i], *form.families[i + 1 :]]
        for k, branch in enumerate(family.branches):
            less = family.branches[:k] + family.branches[k + 1 :]
            assert said([*others, replace(family, branches=less)])
            if branch.values:
                first = branch.values[0]
                moved = replace(first, value=first.value + 0.3)
                wrong = replace(branch, values=(moved, *branch.values[1:]))
            else:
                e = branch.equations[0]
                off = e.cos + np.where(np.arange(len(e.cos)) == 0, 1e-3, 0.0)
                wrong = replace(branch, equations=(replace(e, cos=off), *branch.equations[1:]))
            assert said([*others, replace(family, branches=(*less, wrong))])


def test_no_certificate_is_of_branches_that_are_not_the_components():
    form = pinsing.closed_form(pinsing.load("stanford"))
    first, *rest = form.families
    less = replace(first, branches=first.branches[:1])
    assert prove(form).word == "proven"
    unproven = prove(replace(form, families=(less, *rest)))
    assert unproven.word != "proven"
    assert "on no family that is stated" in unproven.proof.reason


def test_isolated_zeros_of_a_touching_equation_are_held_against_it():
    """3 + cos q1 + cos q2 ... has none; 2 + cos q1 + cos q2 one, at which its slope is zero."""
    ring = make_ring((False, False))
    x, y, u, v = ring.context.gens()
    poly = 4 * x**2 * u**2 + 2 * x**2 * v**2 + 2 * y**2 * u**2
    form = pinsing.closed_form(chain([(0, 0, 0.2, 0), (0, 0, 0.2, 0)], "position"))
    component = replace(form.families[0].components[0], values={}, relations=(poly,), codimension=1)
    at = ring, form.geometry, form.symbols
    (found,) = disagreements([], [component], *at)
    assert "on no family that is stated" in found
    empty = replace(component, relations=(poly + x**2 * u**2 + y**2 * v**2,))
    assert disagreements([], [empty], *at) == []
