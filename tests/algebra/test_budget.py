"""What keeps searches within their time, in this process and in a child that is stopped."""

import itertools
import os
import signal
import threading
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from flint import fmpz
from singular_sets import terms
from tiers import tiered

import pinsing
from pinsing.algebra import budget
from pinsing.algebra.budget import PER_SECOND, Apart, Budget, BudgetExceeded, in_child
from pinsing.algebra.equation import Equation, System
from pinsing.families.proof_forms import Draft, roots_in, skeleton
from pinsing.families.zero_set import SearchBox, proven_empty, search, thrown
from pinsing.proof.checker import Ring
from pinsing.robot.nominal import nominal

forks = pytest.mark.skipif(not budget.FORKS, reason="processes cannot be forked here")
_JOINTS = 6
_PI = np.full(_JOINTS, np.pi)
_BOX = SearchBox(-_PI, _PI, np.ones(_JOINTS, dtype=bool), np.zeros(_JOINTS))


def made(count: int, constant: float) -> Equation:
    """A constant and cosines of random sums of angles, half of them twice the angle, size one."""
    frequencies = 2 * np.random.default_rng(count).integers(-2, 3, (count, _JOINTS))
    none = [0] * _JOINTS
    others = ((frequency, none, 1.0 / count, 0.0) for frequency in frequencies[1:])
    return terms((none, none, constant, 0.0), *others)


def after(questions: int) -> Callable[[], bool]:
    """Says stop when it is asked once more."""
    asked = itertools.count()
    return lambda: next(asked) >= questions


def counted(owner: type, name: str) -> Any:
    """Calls of a method are counted."""
    return patch.object(owner, name, autospec=True, side_effect=getattr(owner, name))


@pytest.mark.slow
@pytest.mark.parametrize("patience", tiered([0, 3, 20], {3}))
def test_a_long_system_without_points_is_left_when_time_is_over(patience, rng):
    nowhere = [made(400, 2.0), made(401, 2.0)]  # the constant outweighs all cosines
    with counted(System, "values") as values:
        assert len(search(nowhere, _BOX, 8, rng, stop=after(patience))) == 0
        assert values.call_count <= patience + 20  # without stop: hundreds
        values.reset_mock()
        assert len(thrown(nowhere, _BOX, 8, rng, after(patience))) == 0
        assert values.call_count <= patience + 1
        values.reset_mock()
        search(nowhere, _BOX, 8, rng, rounds=4)
        assert values.call_count > 100


def test_a_proof_of_emptiness_ends_with_its_boxes() -> None:
    away, small = [made(30, 2.0)], np.full(_JOINTS, 0.1)
    assert proven_empty(away, -small, small)
    assert not proven_empty(away, -8 * small, 8 * small, boxes=1)
    family = pinsing.closed_form(pinsing.load("ur5")).families[2]
    some = family.points(5, np.random.default_rng(0), stop=lambda: True)
    assert family.contains(some).tolist() == [True] * 5


def test_the_jacobian_of_a_certificate_ends_with_the_time() -> None:
    arm = pinsing.load("talos", base="left_sole_link", tip="gripper_left_base_link")
    geometry = nominal(arm)
    data = skeleton(geometry, 6, roots_in(geometry))
    with counted(Ring, "spend") as spend, pytest.raises(BudgetExceeded):
        Draft(data, Budget(0.0))
    assert spend.call_count < 10


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


@pytest.mark.slow
def test_work_stops_a_search_whatever_the_clock_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is found does not depend on how fast the machine is: here a hundred times as fast."""
    arm = pinsing.load("panda", task="position")
    monkeypatch.setattr(budget, "FORKS", False)
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


def endless() -> int:
    """One call into flint that takes hours: a product of two large primes."""
    return len(((fmpz(2) ** 521 - 1) * (fmpz(2) ** 607 - 1)).factor())


@pytest.fixture
def forked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Every child that is made, by its number."""
    made: list[int] = []
    fork = os.fork
    monkeypatch.setattr(os, "fork", lambda: made.append(fork()) or made[-1])
    return made


def gone(children: list[int]) -> bool:
    """Whether each has ended, and has been waited for."""
    for child in children:
        with pytest.raises(ChildProcessError):
            os.waitpid(child, os.WNOHANG)
    return len(children) == 1


@forks
def test_what_comes_of_a_child_and_its_work_is_counted(monkeypatch):
    whole = Budget(100.0)

    def work() -> list[int]:
        whole.check(30 * PER_SECOND)
        return [1, 2]

    def broken() -> int:
        raise ValueError("no")

    assert in_child(work, whole, 30.0) == [1, 2]
    assert whole.meter.done == pytest.approx(30 * PER_SECOND, rel=0.01)
    with pytest.raises(ValueError, match="no"):
        in_child(broken, Budget(30), 30)
    with pytest.raises(BudgetExceeded, match="ended"):
        in_child(lambda: os.kill(os.getpid(), signal.SIGKILL), Budget(30), 30)
    monkeypatch.setattr(budget, "_MEMORY", 100_000_000)
    with pytest.raises(BudgetExceeded, match="memory"):
        in_child(lambda: len(bytes(400_000_000)), Budget(30.0), 30.0)


@forks
def test_a_single_call_into_flint_is_stopped_and_what_was_told_before_is_kept(forked):
    here = Apart(Budget(0.5), 0.5)

    def work() -> int:
        here.tell("found one")
        return endless()

    outcome = here.run(work, at_once=True)
    assert (outcome.result, outcome.told) == (None, ["found one"])
    assert outcome.reason
    assert gone(forked)
    with pytest.raises(BudgetExceeded, match="ran out in one step"):
        in_child(endless, Budget(0.5), 0.5)


@forks
@pytest.mark.slow
def test_ctrl_c_is_heard_during_a_single_call(forked):
    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        in_child(endless, Budget(60), 60)
    assert gone(forked)


@forks
@pytest.mark.slow
def test_the_families_are_the_same_in_a_child(forked, monkeypatch):
    arm = pinsing.load("surgical7")
    here = pinsing.closed_form(arm)
    monkeypatch.setattr(budget, "_LONG", 0.0)
    there = pinsing.closed_form(arm)
    assert forked
    assert [f.text for f in there.families] == [f.text for f in here.families]
    assert there.complete
    assert there.random_steps == here.random_steps


@forks
def test_a_search_that_is_stopped_keeps_its_components_and_says_so(monkeypatch):
    """Every child is killed at once: what was found before is left, and nothing is complete."""
    monkeypatch.setattr(budget, "_LONG", 0.0)
    killed = budget.Outcome(None, [], "killed")
    monkeypatch.setattr(Apart, "_wait", lambda self: (self._end(), killed)[1])
    found = pinsing.closed_form(pinsing.load("ur5"), prove=False)
    assert not found.complete
    assert found.word == "not complete"
    assert "not all minors were searched: killed" in found.gaps
