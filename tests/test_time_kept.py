"""What keeps searches within their time: counted in steps, never by a clock."""

from __future__ import annotations

import numpy as np
import pytest

import pinsing
from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.equation import Equation
from pinsing.families import zero_set
from pinsing.families.empty_box import proven_empty
from pinsing.families.zero_set import search, thrown
from pinsing.geometry.nominal import nominal
from pinsing.proof.checker import Ring
from pinsing.proof.reduction import without_dependent_lines
from pinsing.proof.skeleton import roots_in, skeleton

_JOINTS = 6
_LOW, _HIGH = np.full(_JOINTS, -np.pi), np.full(_JOINTS, np.pi)
_FREE, _FIXED = np.ones(_JOINTS, dtype=bool), np.zeros(_JOINTS)


def made(terms: int, constant: float) -> Equation:
    """A constant and cosines of random sums of angles, half of them twice the angle, size one."""
    rng = np.random.default_rng(terms)
    frequencies = 2 * rng.integers(-2, 3, (terms, _JOINTS))
    frequencies[0] = 0
    cos = np.full(terms, 1.0 / terms)
    cos[0] = constant
    names = tuple(f"q{i}" for i in range(1, _JOINTS + 1))
    zero = np.zeros(terms)
    powers = np.zeros_like(frequencies)
    return Equation(names, frequencies, powers, cos, zero, np.zeros(_JOINTS))


class Patience:
    """Says stop from the k-th question on, and counts the questions."""

    def __init__(self, k: int) -> None:
        self.left, self.asked = k, 0

    def __call__(self) -> bool:
        self.asked += 1
        return self.asked > self.left


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many points each evaluation of a system was at."""
    seen: list[int] = []
    values = zero_set.System.values

    def counted(self: zero_set.System, q: np.ndarray) -> np.ndarray:
        seen.append(len(q))
        return values(self, q)

    monkeypatch.setattr(zero_set.System, "values", counted)
    return seen


@pytest.mark.parametrize("patience", [0, 3, 20])
def test_a_long_system_without_points_is_left_when_time_is_over(
    patience: int, steps: list[int]
) -> None:
    nowhere = [made(400, 2.0), made(401, 2.0)]  # the constant outweighs all cosines
    stop = Patience(patience)
    rng = np.random.default_rng(0)
    found = search(nowhere, _LOW, _HIGH, _FREE, _FIXED, 8, rng, stop=stop)
    assert len(found) == 0
    assert len(steps) <= patience + 20  # without stop: hundreds
    steps.clear()
    assert len(thrown(nowhere, _LOW, _HIGH, _FREE, _FIXED, 8, rng, Patience(patience))) == 0
    assert len(steps) <= patience + 1


def test_without_a_stop_it_is_looked_for_much_longer(steps: list[int]) -> None:
    nowhere = [made(400, 2.0), made(401, 2.0)]
    search(nowhere, _LOW, _HIGH, _FREE, _FIXED, 8, np.random.default_rng(0), rounds=4)
    assert len(steps) > 100


def test_a_short_system_is_looked_at_once_though_time_is_over(steps: list[int]) -> None:
    short = [made(30, 0.0)]
    rng = np.random.default_rng(0)
    found = search(short, _LOW, _HIGH, _FREE, _FIXED, 8, rng, stop=lambda: True)
    assert len(found) == 8
    assert np.abs(short[0](found)).max() < 1e-10
    nowhere = [made(30, 2.0)]
    steps.clear()
    assert len(search(nowhere, _LOW, _HIGH, _FREE, _FIXED, 8, rng, stop=lambda: True)) == 0
    once = len(steps)
    steps.clear()
    assert len(search(nowhere, _LOW, _HIGH, _FREE, _FIXED, 8, rng)) == 0
    assert once < len(steps)


def test_points_that_were_reached_are_kept() -> None:
    """Points of a long system are on it, however early the search for more ends."""
    long = [made(600, 0.0)]
    rng = np.random.default_rng(0)
    counts = []
    for patience in (2, 40, 10_000):
        found = search(long, _LOW, _HIGH, _FREE, _FIXED, 50, rng, stop=Patience(patience))
        assert np.abs(long[0](found)).max(initial=0.0) < 1e-10
        counts.append(len(found))
    assert counts[-1] == 50
    assert counts[0] <= counts[-1]


def test_a_proof_of_emptiness_ends_with_the_time() -> None:
    away, small = [made(30, 2.0)], np.full(_JOINTS, 0.1)
    assert proven_empty(away, -small, small)
    assert not proven_empty(away, -small, small, stop=lambda: True)


def test_families_take_a_stop() -> None:
    family = pinsing.closed_form(pinsing.load("ur5")).families[2]
    some = family.points(5, np.random.default_rng(0), stop=lambda: True)
    assert len(some) == 5
    assert family.contains(some).all()


def test_the_jacobian_of_a_certificate_ends_with_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of fifteen joints it takes long: it is begun, and left at the first look at the time."""
    arm = pinsing.load("talos", base="left_sole_link", tip="gripper_left_base_link")
    geometry = nominal(arm, rational=True)
    data = skeleton(geometry, 6, roots_in(geometry))
    spent: list[int] = []
    spend = Ring.spend

    def counted(self: Ring, work: int) -> None:
        spent.append(work)
        spend(self, work)

    monkeypatch.setattr(Ring, "spend", counted)
    with pytest.raises(BudgetExceeded):
        without_dependent_lines(data, Budget(0.0))
    assert len(spent) < 10
