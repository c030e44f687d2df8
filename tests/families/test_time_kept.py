"""What keeps searches within their time: counted in steps, and by a clock for what runs away."""

import math
import time
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from tiers import tiered
from urdf_text import J, Z, urdf

import pinsing
from pinsing.algebra import budget
from pinsing.algebra.budget import PER_SECOND, Budget, BudgetExceeded, in_child
from pinsing.algebra.equation import Equation
from pinsing.families import zero_set
from pinsing.families.proof_forms import Draft, roots_in, skeleton
from pinsing.families.zero_set import SearchBox, proven_empty, search, thrown
from pinsing.proof.checker import Ring
from pinsing.robot.nominal import nominal

_JOINTS = 6
_PI = np.full(_JOINTS, np.pi)
_BOX = SearchBox(-_PI, _PI, np.ones(_JOINTS, dtype=bool), np.zeros(_JOINTS))


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


@pytest.mark.slow
@pytest.mark.parametrize("patience", tiered([0, 3, 20], {3}))
def test_a_long_system_without_points_is_left_when_time_is_over(patience, steps):
    nowhere = [made(400, 2.0), made(401, 2.0)]  # the constant outweighs all cosines
    stop = Patience(patience)
    rng = np.random.default_rng(0)
    found = search(nowhere, _BOX, 8, rng, stop=stop)
    assert len(found) == 0
    assert len(steps) <= patience + 20  # without stop: hundreds
    steps.clear()
    assert len(thrown(nowhere, _BOX, 8, rng, Patience(patience))) == 0
    assert len(steps) <= patience + 1
    steps.clear()
    search(nowhere, _BOX, 8, rng, rounds=4)
    assert len(steps) > 100


def test_a_proof_of_emptiness_ends_with_the_time() -> None:
    away, small = [made(30, 2.0)], np.full(_JOINTS, 0.1)
    assert proven_empty(away, -small, small)
    assert not proven_empty(away, -small, small, stop=lambda: True)
    family = pinsing.closed_form(pinsing.load("ur5")).families[2]
    some = family.points(5, np.random.default_rng(0), stop=lambda: True)
    assert len(some) == 5
    assert family.contains(some).all()


def test_the_jacobian_of_a_certificate_ends_with_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = pinsing.load("talos", base="left_sole_link", tip="gripper_left_base_link")
    geometry = nominal(arm)
    data = skeleton(geometry, 6, roots_in(geometry))
    spent: list[int] = []
    spend = Ring.spend

    def counted(self: Ring, work: int) -> None:
        spent.append(work)
        spend(self, work)

    monkeypatch.setattr(Ring, "spend", counted)
    with pytest.raises(BudgetExceeded):
        Draft(data, Budget(0.0))
    assert len(spent) < 10


def test_parts_of_a_budget_count_together_and_take_shares_of_work() -> None:
    whole = Budget(100.0)
    half = whole.part(0.5)
    with pytest.raises(BudgetExceeded, match="work budget of 50 s"):
        half.check(51 * PER_SECOND)
    half.check(40 * PER_SECOND)
    assert whole.left == pytest.approx(60.0, abs=0.1)
    assert half.left == pytest.approx(10.0, abs=0.1)
    assert not whole.over
    whole.spend(11 * PER_SECOND)  # what others did is gone from the share, too
    assert half.over
    assert whole.part(0.0, least=0.2).left == pytest.approx(20.0)
    assert whole.at_most(3.0).left == pytest.approx(3.0)


def test_what_a_child_did_is_counted(monkeypatch):
    whole = Budget(100.0)

    def work() -> int:
        whole.check(30 * PER_SECOND)
        return 1

    assert in_child(work, whole, 30.0) == 1
    assert whole.meter.done == pytest.approx(30 * PER_SECOND, rel=0.01)
    monkeypatch.setattr(budget, "_MEMORY", 100_000_000)
    with pytest.raises(BudgetExceeded, match="memory"):
        in_child(lambda: len(bytes(400_000_000)), Budget(30.0), 30.0)


@pytest.mark.slow
def test_work_stops_a_search_whatever_the_clock_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is found does not depend on how fast the machine is: here a hundred times as fast."""
    arm = pinsing.load("panda", task="position")
    monkeypatch.setattr(budget, "possible", lambda: False)
    found = []
    for rate in (0.1, 0.001):
        monkeypatch.setattr(budget, "time", SimpleNamespace(monotonic=slowed(rate)))
        form = pinsing.closed_form(arm, seconds=0.3)
        found.append(([f.text for f in form.families], form.gaps))
    assert found[0] == found[1]
    assert any("work budget" in gap for gap in found[0][1])


def slowed(rate: float) -> Callable[[], float]:
    """A clock that goes slower than the time."""
    began = time.monotonic()
    return lambda: began + rate * (time.monotonic() - began)


_LONG_PROOF = [
    ("revolute", (0, 0, 0), (0, 0, 0), ""),
    ("prismatic", (0, -0.25, 0), (-90, 0, -90), ""),
    ("continuous", (0.4, 0, 0), (180, 0, 0), ""),
    ("continuous", (0, 0, 0), (-45, 0, 90), ""),
    ("revolute", (0, 0.4, 0.25), (180, 0, 90), '<mimic joint="j1" multiplier="1" offset="0"/>'),
    ("revolute", (0, 0, 0), (-90, 0, 0), ""),
]


@pytest.mark.slow
def test_one_factor_of_a_proof_does_not_go_on_for_minutes() -> None:
    """By the clock, and generously: of 2.5 s it took 150, and 3.7 GB."""
    joints = [
        J(f"j{k}", f"l{k - 1}", f"l{k}", at, Z, kind, (-math.pi, math.pi), np.radians(rpy), more)
        for k, (kind, at, rpy, more) in enumerate(_LONG_PROOF, 1)
    ]
    joints.append(J("j7", "l6", "tip", kind="fixed", rpy=(math.pi, 0, 0)))
    arm = pinsing.load(urdf(joints), tip="tip", task="vx,vy,vz,wz")
    began = time.monotonic()
    form = pinsing.closed_form(arm, seconds=2.5)
    assert time.monotonic() - began < 15.0
    assert form.proof.accepted or form.proof.out_of_time
