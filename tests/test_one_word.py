"""How sure a closed form is: one word in all that a command prints, and a reason that is true."""

from __future__ import annotations

import pytest
from click.testing import CliRunner, Result
from singular_sets import arm_of

import pinsing
from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.cli.app import command
from pinsing.families import proving
from pinsing.families.certainty import certainty
from pinsing.families.form import families_text
from pinsing.families.proving import prove_briefly, within
from pinsing.proof import produce
from pinsing.proof.forms import Forms


def run(*words: str) -> Result:
    return CliRunner().invoke(command, list(words), prog_name="pinsing")


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search that nobody asked for never has the time."""
    monkeypatch.setattr(proving, "SHORT", 0.0)


@pytest.mark.usefixtures("slow")
def test_what_took_longer_has_one_headline() -> None:
    done = run("families", "puma560", "--prove")
    assert done.exit_code == 0, done.stderr
    text, last = " ".join(done.stdout.split()), done.stdout.splitlines()[-1]
    assert text.startswith("3 families of singular configurations (closed forms, ")
    assert "; whether these are all stands at the end: F1 " in text
    assert last.startswith("  proven: certificate of ")
    assert "probable" not in done.stdout
    assert "no certificate" not in done.stdout


@pytest.mark.slow
def test_the_end_says_what_is_missing_where_no_proof_mends_it() -> None:
    done = run("families", "panda", "--seconds", "0.02", "--prove")
    assert done.exit_code == 0, done.stderr
    assert "probable" not in done.stdout
    assert "proven" not in done.stdout
    head, *lines = done.stdout.split("\n  not complete: ")
    assert "whether these are all stands at the end" in " ".join(head.split())
    assert lines
    assert not any(line.startswith("  F") for line in "\n".join(lines).splitlines())


@pytest.mark.usefixtures("slow")
def test_without_time_it_says_how_much_there_was_and_what_to_do() -> None:
    done = run("families", "puma560")
    assert done.exit_code == 0
    text = " ".join(done.stdout.split())
    assert "no certificate: none was found in the 0 s of processor time allowed" in text
    assert "--prove, or prove=True, looks for one for 60 s" in text
    assert text.startswith("3 families of singular configurations, probable (")


def test_which_of_the_two_times_ran_out() -> None:
    form = pinsing.closed_form(arm_of("puma560"))
    reasons = {}
    for seconds, processor in ((1e-6, 100.0), (100.0, 1e-6), (1e-6, float("inf"))):
        proof = within(form, Budget(seconds, processor), None).proof
        assert proof is not None
        assert proof.out_of_time
        reasons[seconds, processor] = proof.reason
    on_clock = "none was found in the 1e-06 s allowed"
    assert list(reasons.values()) == [
        on_clock,
        "none was found in the 1e-06 s of processor time allowed",
        on_clock,
    ]


def test_a_search_that_failed_is_not_called_out_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise produce.NotFound("a place could not be split")

    monkeypatch.setattr(proving, "certificate", fail)
    form = prove_briefly(pinsing.closed_form(arm_of("puma560")), 100.0)
    assert form.proof is not None
    assert form.proof.reason == "a place could not be split"
    assert not form.proof.out_of_time
    assert "no certificate: a place could not be split" in " ".join(certainty(form).split())


def test_the_proof_of_each_family_asks_for_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A long family took twenty times the two seconds: nothing asked while it was shown sound."""
    asked: list[int] = []

    def out_of_time(self: Forms) -> None:
        asked.append(1)
        if len(asked) > 1:
            raise BudgetExceeded("no time")

    monkeypatch.setattr(Forms, "require_time", out_of_time)
    form = within(pinsing.closed_form(arm_of("puma560")), Budget(60.0), None)
    assert form.word == "probable"
    assert form.proof is not None
    assert form.proof.out_of_time


def test_undecided_leaves_out_every_word() -> None:
    form = pinsing.closed_form(arm_of("panda"), seconds=0.02)
    assert form.word == "not complete"
    text = families_text(form, undecided=True).lower()
    assert "complete" not in text
    assert "probable" not in text
