"""Long algebra runs in a child process, which is stopped when the time is up or at Ctrl-C."""

import os
import signal
import threading

import pytest
from flint import fmpz

import pinsing
from pinsing.algebra import budget
from pinsing.algebra.budget import Apart, Budget, BudgetExceeded, in_child
from pinsing.families import closed_form

pytestmark = pytest.mark.skipif(not budget.possible(), reason="processes cannot be forked here")


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


def test_what_comes_of_a_child():
    assert in_child(lambda: [1, 2], Budget(30), 30) == [1, 2]

    def broken() -> int:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        in_child(broken, Budget(30), 30)
    with pytest.raises(BudgetExceeded, match="ended"):
        in_child(lambda: os.kill(os.getpid(), signal.SIGKILL), Budget(30), 30)


def test_a_single_call_into_flint_is_stopped(forked):
    with pytest.raises(BudgetExceeded, match="ran out in one step"):
        in_child(endless, Budget(0.5), 0.5)
    assert gone(forked)


@pytest.mark.slow
def test_ctrl_c_is_heard_during_a_single_call(forked):
    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        in_child(endless, Budget(60), 60)
    assert gone(forked)


@pytest.mark.slow
def test_what_was_told_before_the_end_is_kept():
    here = Apart(Budget(0.5), 0.5)

    def work() -> int:
        here.tell("found one")
        return endless()

    outcome = here.run(work, at_once=True)
    assert outcome.result is None
    assert outcome.told == ["found one"]
    assert outcome.reason


@pytest.mark.slow
def test_the_families_are_the_same_in_a_child(forked, monkeypatch):
    arm = pinsing.load("surgical7")
    here = closed_form(arm)
    monkeypatch.setattr(budget, "_LONG", 0.0)
    there = closed_form(arm)
    assert forked
    assert [f.text for f in there.families] == [f.text for f in here.families]
    assert there.complete
    assert there.random_steps == here.random_steps


def test_a_search_that_is_stopped_keeps_its_components_and_says_so(monkeypatch):
    """Every child is killed at once: what was found before is left, and nothing is complete."""
    monkeypatch.setattr(budget, "_LONG", 0.0)
    monkeypatch.setattr(
        Apart, "_wait", lambda self: (self._end(), budget.Outcome(None, [], "killed"))[1]
    )
    found = closed_form(pinsing.load("ur5"), prove=False)
    assert not found.complete
    assert found.word == "not complete"
    assert "not all minors were searched: killed" in found.gaps
