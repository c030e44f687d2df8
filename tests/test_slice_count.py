"""Singular configurations on slices over small finite fields, where nothing is proven."""

from __future__ import annotations

import importlib
import random
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.families import solve
from pinsing.families.form import families_html, families_text
from pinsing.families.searched import searched
from pinsing.families.slice_count import FIELDS, SliceCount, _ModularChain, count_on_slices


@pytest.fixture(scope="module")
def panda():
    return pinsing.load("panda", tip="panda_hand_tcp")


@pytest.fixture(scope="module")
def kept(panda):
    """What a search of the Panda's families comes to."""
    out = []

    def keep(*given):
        out.append(searched(*given))
        return out[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(solve, "searched", keep)
        form = pinsing.closed_form(panda, seconds=120)
    assert form.complete
    assert form.slice_count is None  # nothing is open: there is nothing to count
    return out[0]


@pytest.fixture(scope="module")
def field():
    sys.path.insert(0, str(Path(__file__).parent.parent / "scripts"))
    try:
        return importlib.import_module("oracle_field")
    finally:
        sys.path.pop(0)


@pytest.mark.parametrize("prime", FIELDS)
@pytest.mark.parametrize("chosen", [(3,), (1, 3), (4, 5), (1, 2, 5)])
def test_all_singular_points_of_a_slice_are_met_and_no_others(kept, field, prime, chosen):
    """Against ranks one by one, of Jacobians that are built another way."""
    if len(chosen) == 3 and prime > FIELDS[0]:
        chosen = chosen[:2]
    chain = _ModularChain(kept.geometry, prime)
    x, y = chain.singular(chosen, random.Random(3))
    draw, values = random.Random(3), [chain._every(j) for j in range(7)]
    at = [draw.randrange(len(v[0])) for v in values]
    axes = [range(len(v[0])) if j in chosen else [at[j]] for j, v in enumerate(values)]
    index = np.stack([i.ravel() for i in np.meshgrid(*axes, indexing="ij")])
    every = [np.stack([v[k][i] for v, i in zip(values, index, strict=True)]) for k in (0, 1)]
    points = field.Points(prime, *(e.astype(np.int32) for e in every))
    short = field.ranks(field.jacobians(kept.geometry, range(6), points), prime) < 6
    expected = {tuple(p) for p in np.concatenate([e[:, short] for e in every]).T.tolist()}
    assert {tuple(p) for p in np.concatenate([x, y]).T.tolist()} == expected


def test_all_points_lie_on_complete_families_and_one_less_is_noticed(kept):
    ring = kept.maker.ring
    whole = count_on_slices(kept.geometry, ring, kept.components, 2, Budget(60))
    assert (whole.joints, whole.slices, whole.choices, whole.off) == (2, 10, 10, 0)
    assert whole.points > 10
    for k in range(len(kept.components)):
        some = [c for i, c in enumerate(kept.components) if i != k]
        less = count_on_slices(kept.geometry, ring, some, 2, Budget(60))
        if less.off:
            break
    else:
        pytest.fail("no component was missed")


def test_what_is_missing_is_a_gap_and_what_is_not_is_evidence(panda, kept, monkeypatch):
    open_end = replace(kept, gaps=["one branch was left"])
    monkeypatch.setattr(solve, "searched", lambda *given: open_end)
    form = pinsing.closed_form(panda, seconds=60)
    said = form.slice_count.sentence()
    assert said.startswith("all ")
    assert "10 random slices of 2 joints" in said
    assert form.word == "not complete"
    assert f"evidence, no proof: {said}" in " ".join(families_text(form).split())
    assert "evidence, no proof" in families_html(form)
    assert pinsing.ClosedForm.from_json(form.to_json()).slice_count == form.slice_count
    less = replace(open_end, components=[])
    monkeypatch.setattr(solve, "searched", lambda *given: less)
    form = pinsing.closed_form(panda, seconds=60)
    assert form.slice_count.off == form.slice_count.points > 0
    assert any("lie on no family" in gap and "something is missing" in gap for gap in form.gaps)
    assert "evidence" not in families_text(form)


def test_words():
    count = SliceCount(4, 1, 35, 0, 0, 23, 31)
    assert count.sentence().startswith("no singular point was met on one random slice of 4 joints")
    assert replace(count, points=2_000, off=1).sentence().startswith("1 of 2,000 singular points")
