"""Closed forms of real arms, against Pinocchio and against a search that knows no algebra."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from singular_sets import ROBOTS, arm_of, check_families, check_search, closed, drop
from tiers import tiered

from pinsing.families import closed_form
from pinsing.robot.nominal import nominal

SYSTEMS = {"baxter", "g1", "tiago_pro"}
"""Arms of which one family stays a system of several equations."""
LONG = {"baxter", "g1", "tiago", "so101"}
"""Arms whose closed forms take a second and more: looked at in the slow tier."""
QUICK = set(ROBOTS) - LONG


@pytest.mark.parametrize("name", tiered(ROBOTS, QUICK))
def test_complete(name: str) -> None:
    form = closed(name)
    assert form.complete, form.gaps
    assert form.families
    assert all(f.real for f in form.families)
    if name not in SYSTEMS | {"so101"}:
        assert form.fully_decomposed


@pytest.mark.parametrize("name", tiered(sorted(set(ROBOTS) - SYSTEMS), QUICK - SYSTEMS))
def test_points_are_singular(name: str) -> None:
    check_families(arm_of(name), closed(name), 60)


@pytest.mark.parametrize("name", tiered(sorted(SYSTEMS), SYSTEMS - LONG))
def test_points_of_systems_are_singular(name: str) -> None:
    check_families(arm_of(name), closed(name), 12)


@pytest.mark.parametrize("name", tiered(ROBOTS, QUICK))
def test_search_finds_nothing_else(name: str) -> None:
    assert check_search(arm_of(name), closed(name), 60) >= 50


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_a_thousand_points_are_singular(name: str) -> None:
    check_families(arm_of(name), closed(name), 1000, seed=2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_three_hundred_searches_find_nothing_else(name: str) -> None:
    assert check_search(arm_of(name), closed(name), 320, seed=3) >= 300


@pytest.mark.parametrize("name", tiered(sorted(set(ROBOTS) - SYSTEMS), QUICK - SYSTEMS))
def test_near_misses_are_regular(name: str) -> None:
    """A random step of 0.05 leaves the singular set, but by rare chance."""
    arm, form = arm_of(name), closed(name)
    exact = nominal(arm).arm
    rng = np.random.default_rng(4)
    for family in form.families:
        Q = family.points(20, rng)
        free = np.ones(arm.n)
        # Only joints that matter: a step along the others stays on the family.
        free[[j for j in range(arm.n) if arm.joints[j] not in family.joints]] = 0.0
        step = rng.normal(size=Q.shape) * free
        moved = Q + 0.05 * step / np.linalg.norm(step, axis=1, keepdims=True)
        regular = drop(exact, moved, form.generic_rank) > 1e-7
        assert regular.mean() >= 0.9, family
        assert not family.contains(moved[regular], 1e-9).any(), family


@pytest.mark.parametrize(
    "name", tiered(["xarm7", "icub_left", "so101", "g1"], ("xarm7", "icub_left"))
)
def test_raw_ratio_is_told_where_the_file_is_not_exact(name: str) -> None:
    form = closed(name)
    assert form.snaps
    assert form.jacobian_change > 1e-12
    for family in form.families:
        assert family.raw_ratio is not None
        assert family.raw_ratio <= np.sqrt(arm_of(name).n) * form.jacobian_change


@pytest.mark.parametrize("name", ["iiwa14", "panda", "talos_arm", "pr2"])
def test_exact_files_need_no_words(name: str) -> None:
    assert all(f.raw_ratio is None for f in closed(name).families)


@pytest.mark.parametrize("name", tiered(ROBOTS, QUICK))
def test_rank_and_words_at_the_generic_point(name: str) -> None:
    form = closed(name)
    for family in form.families:
        assert family.generic is not None
        assert family.contains(family.generic)
        assert family.rank is not None
        assert family.rank < form.generic_rank
        assert family.lost
        assert family.reason
        assert family.kind in ("boundary", "interior", "undecided", "varies")
        assert 1 <= family.codimension <= arm_of(name).n


@pytest.mark.parametrize("name", tiered(ROBOTS, QUICK))
def test_no_family_lies_in_another(name: str) -> None:
    rng = np.random.default_rng(6)
    families = closed(name).families
    for a in families:
        Q = a.points(6, rng)
        for b in families:
            assert b is a or not b.contains(Q, 1e-7).all(), (a, b)


def test_budget_is_kept_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock of its own: each look at it is a millisecond, and soon nothing looks any more."""
    looks = itertools.count()
    clock = SimpleNamespace(monotonic=lambda: next(looks) * 1e-3, process_time=lambda: 0.0)
    monkeypatch.setattr("pinsing.algebra.budget.time", clock)
    form = closed_form(arm_of("g1"), seconds=0.05)
    assert not form.complete
    assert any("time" in gap for gap in form.gaps)
    assert next(looks) < 3 * 50


def test_budget_that_suffices_for_nothing() -> None:
    form = closed_form(arm_of("baxter"), seconds=1e-9)
    assert not form.complete
    assert not form.families
    assert "NOT complete" in str(form)
