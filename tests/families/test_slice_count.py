"""Singular configurations on slices over small finite fields, where nothing is proven."""

import random
from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from public import script

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component
from pinsing.families import slices
from pinsing.families.form import families_html, families_text
from pinsing.families.slices import ModularChain
from pinsing.families.solve import ComponentSearch


@pytest.fixture(scope="module")
def panda():
    return pinsing.load("panda", tip="panda_hand_tcp")


@pytest.fixture(scope="module")
def field():
    return script("oracle.field")


@pytest.fixture(scope="module")
def kept(panda):
    """What a search of the Panda's families comes to."""
    out = []

    def keep(self):
        out.append(run(self))
        return out[-1]

    run = ComponentSearch.run
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ComponentSearch, "run", keep)
        form = pinsing.closed_form(panda, seconds=120)
    assert form.complete
    assert form.slice_count is None  # nothing is open: there is nothing to count
    return out[0]


@pytest.mark.parametrize("prime", [23, 47])
@pytest.mark.parametrize("chosen", [(3,), (1, 3), (4, 5), (1, 2, 5)])
def test_all_singular_points_of_a_slice_are_met_and_no_others(kept, field, prime, chosen):
    if len(chosen) == 3 and prime > 23:
        chosen = chosen[:2]
    chain = ModularChain(kept.maker.geometry, kept.task, prime)
    x, y = chain.singular(chosen, random.Random(3))
    draw, values = random.Random(3), [chain.every(j) for j in range(7)]
    at = [draw.randrange(len(v[0])) for v in values]
    axes = [range(len(v[0])) if j in chosen else [at[j]] for j, v in enumerate(values)]
    index = np.stack([i.ravel() for i in np.meshgrid(*axes, indexing="ij")])
    every = [np.stack([v[k][i] for v, i in zip(values, index, strict=True)]) for k in (0, 1)]
    points = field.Points(prime, *(e.astype(np.int32) for e in every))
    short = field.ranks(field.jacobians(kept.maker.geometry, range(6), points), prime) < 6
    expected = {tuple(p) for p in np.concatenate([e[:, short] for e in every]).T.tolist()}
    assert {tuple(p) for p in np.concatenate([x, y]).T.tolist()} == expected


def test_all_points_lie_on_complete_families_and_one_less_is_noticed(kept, panda):
    given = kept.maker.geometry, panda.task, kept.maker.ring
    whole = slices.count_on_slices(*given, kept.components, 2, Budget(60))
    assert (whole.joints, whole.slices, whole.choices, whole.off) == (2, 10, 10, 0)
    assert whole.points > 10
    for k in range(len(kept.components)):
        some = [c for i, c in enumerate(kept.components) if i != k]
        less = slices.count_on_slices(*given, some, 2, Budget(60))
        if less.off:
            break
    else:
        pytest.fail("no component was missed")


def test_what_is_missing_is_a_gap_and_what_is_not_is_evidence(panda, kept, monkeypatch):
    open_end = copy(kept)
    open_end.gaps = ["one branch was left"]
    monkeypatch.setattr(ComponentSearch, "run", lambda self: open_end)
    form = pinsing.closed_form(panda, seconds=60, prove=False)
    said = form.slice_count.sentence()
    assert said.startswith("all ")
    assert "10 random slices of 2 joints" in said
    assert form.word == "not complete"
    assert f"evidence, no proof: {said}" in " ".join(families_text(form).split())
    assert "evidence, no proof" in families_html(form)
    assert pinsing.ClosedForm.from_json(form.to_json()).slice_count == form.slice_count
    less = copy(open_end)
    less.components = []
    monkeypatch.setattr(ComponentSearch, "run", lambda self: less)
    form = pinsing.closed_form(panda, seconds=60)
    assert form.slice_count.off == form.slice_count.points > 0
    assert any("lie on no family" in gap and "something is missing" in gap for gap in form.gaps)
    assert "evidence" not in families_text(form)


def test_a_field_in_which_minus_one_is_a_square(kept, field):
    """Where x^2 + y^2 is zero there is no angle: such points are left out."""
    prime, chosen = 13, (1, 5)
    chain = ModularChain(kept.maker.geometry, kept.task, prime)
    assert all(((x * x + y * y) % prime != 0).all() for x, y in map(chain.every, range(7)))
    x, y = chain.singular(chosen, random.Random(3))
    assert x.shape[1]
    points = field.Points(prime, x.astype(np.int32), y.astype(np.int32))
    assert (field.ranks(field.jacobians(kept.maker.geometry, range(6), points), prime) < 6).all()


def test_slices_lead_to_what_is_missing(kept, panda):
    task, ring = panda.task, kept.maker.ring
    at_values = [c for c in kept.components if len(c.values) > 1]
    assert at_values
    some = [c for c in kept.components if c is not at_values[0]]
    found = slices.SliceSearch(kept.maker.geometry, task, ring, some, 2, Budget(60))
    found.run()
    assert found.enough
    assert found.count.off == 0
    assert found.count.met >= 0.8 * found.count.known
    assert len(found.count.primes) >= 3
    assert at_values[0].values in [c.values for c in found.components]
    assert len(found.components) == len(kept.components)


def test_with_little_known_and_no_time_nothing_is_said(kept, panda):
    given = kept.maker.geometry, panda.task, kept.maker.ring
    found = slices.SliceSearch(*given, [], 2, Budget(1e-6))
    found.run()
    assert not found.enough
    assert found.components == []
    count = slices.SliceCount(4, 1, 35, 0, 0, 23, 31)
    assert count.sentence().startswith("no singular point was met on one random slice of 4 joints")
    assert replace(count, points=2_000, off=1).sentence().startswith("1 of 2,000 singular points")


@pytest.mark.slow
def test_real_points_lead_where_no_slice_does(kept, monkeypatch):
    n = len(kept.ring.prismatic)
    real = slices.RandomSingular.of(kept.maker, Budget(60))
    assert not real.off(kept.components).any()

    def none(self, prime, time):
        raise ValueError

    monkeypatch.setattr(slices.Slices, "turn", none)
    tried = 0
    for out in kept.components:
        others = [c for c in kept.components if c is not out]
        if not out.values or not real.off(others).any():
            continue
        tried += 1
        given = kept.maker.geometry, kept.maker.geometry.arm.task, kept.ring
        found = slices.SliceSearch(*given, others, n - 5, Budget(60), real=real)
        found.run()
        assert not real.off(found.components).any()
        assert not found.enough  # no slice was asked
    assert tried


class Told(slices.SlicePoints):
    """Points of which it is told which of them each component has."""

    def held(self, component):
        return np.array(self.of["small" if component.values[0] == (0, 1) else "large"][self.prime])


def test_values_that_are_the_same_over_one_field_alone_stay_apart():
    """q3 = 180°, sin q4 = 0.536 has, modulo 7, only points at q4 = 90°: it was dropped."""
    small, large = (Component({0: v}, (), True, 1) for v in ((0, 1), (1, 0)))
    known = [small, large]
    every, some, none = [True] * 20, [True] * 10 + [False] * 10, [False] * 20

    def left(small, large, off=None):
        of = {
            "small": dict(zip((7, 11), small, strict=True)),
            "large": dict(zip((7, 11), large, strict=True)),
        }
        return slices.without_parts([Told(of, p, 1, None, None) for p in (7, 11)], known, off)

    for second in (none, some):  # ten points are too few to tell
        assert left((every, second), (every, every)) == known
    assert len(left((every, every), (every, every))) == 1
    assert left((every, every), (every, [True] * 15 + [False] * 5)) == [small]

    def off(components):  # one real point on each alone
        return ~np.array([small in components, large in components])

    assert left((every, every), (every, every), off) == known


def test_no_points_are_on_no_component():
    """Slices of a KUKA with a tool have none of some kind, before any component is known."""
    none = slices.SlicePoints(
        None, 7, 1, np.zeros((0, 4), dtype=int), np.zeros((2, 6, 0), dtype=int)
    )
    assert none.on([]).shape == (0, 0)
    assert len(none.left([])) == 0
