"""Closed forms of real arms, against Pinocchio and against a search that knows no algebra."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from singular_sets import (
    ROBOTS,
    arm_of,
    check_apart,
    check_beside,
    check_families,
    check_search,
    closed,
)
from tiers import sampled, tiered

from pinsing.families import closed_form

SYSTEMS = {"baxter", "g1", "tiago_pro"}
"""Arms of which one family stays a system of several equations."""
LONG = {
    "baxter", "g1", "icub_left", "icub_right", "so101", "talos_left", "tiago", "tiago_pro", "xarm7",
}  # fmt: skip
"""Arms whose closed forms take half a second and more: looked at in the slow tier."""
QUICK = set(ROBOTS) - LONG


@pytest.mark.parametrize("name", sampled(tiered(ROBOTS, QUICK)))
def test_complete(name: str) -> None:
    form = closed(name)
    assert form.complete, form.gaps
    assert form.families
    if name not in SYSTEMS | {"so101"}:
        assert form.fully_decomposed
    for family in form.families:
        assert family.real
        assert family.contains(family.generic)
        assert family.rank < form.generic_rank
        assert family.lost
        assert family.reason
        assert family.kind in ("boundary", "interior", "undecided", "varies")
        assert 1 <= family.codimension <= arm_of(name).n
    check_apart(form, 6, 1e-7)


@pytest.mark.parametrize("name", tiered(ROBOTS, QUICK))
def test_points_are_singular(name: str) -> None:
    check_families(arm_of(name), closed(name), 12 if name in SYSTEMS else 60)


@pytest.mark.parametrize("name", tiered(ROBOTS, QUICK))
def test_search_finds_nothing_else(name: str) -> None:
    assert check_search(arm_of(name), closed(name), 60) >= 50


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_a_thousand_points_and_three_hundred_searches(name: str) -> None:
    check_families(arm_of(name), closed(name), 1000, seed=2)
    assert check_search(arm_of(name), closed(name), 320, seed=3) >= 300


@pytest.mark.parametrize("name", tiered(sorted(set(ROBOTS) - SYSTEMS), QUICK - SYSTEMS))
def test_near_misses_are_regular(name: str) -> None:
    check_beside(arm_of(name), closed(name), 20)


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(["xarm7", "icub_left", "so101", "g1"], ("xarm7",)))
def test_raw_ratio_is_told_where_the_file_is_not_exact(name: str) -> None:
    form = closed(name)
    assert form.snaps
    assert form.jacobian_change > 1e-12
    for family in form.families:
        assert family.raw_ratio <= np.sqrt(arm_of(name).n) * form.jacobian_change
    for exact in ("iiwa14", "panda"):
        assert all(f.raw_ratio is None for f in closed(exact).families)


def test_budget_is_kept_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock of its own: each look at it is a millisecond, and soon nothing looks any more."""
    looks = itertools.count()
    clock = SimpleNamespace(monotonic=lambda: next(looks) * 1e-3, process_time=lambda: 0.0)
    monkeypatch.setattr("pinsing.algebra.budget.time", clock)
    form = closed_form(arm_of("g1"), seconds=0.05)
    assert not form.complete
    assert any("time" in gap for gap in form.gaps)
    assert next(looks) < 3 * 50
