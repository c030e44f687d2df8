"""How sure a closed form is, in words: what that rests on, or what is missing."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

from pinsing.algebra.components import RandomSteps
from pinsing.families.slice_count import SliceCount
from pinsing.prose import PLAIN, Page, caution, good, unbroken
from pinsing.robot.exact_placements import Deviation


@dataclass(frozen=True)
class Proof:
    """Outcome of the search for a certificate.

    Attributes
    ----------
    accepted : bool
        Whether there is one, and the checker accepted it.
    reason : str
        Why there is none; empty where there is.
    size : int
        Bytes of the certificate; 0 if there is none.
    places : int
        Case splits and what ends them.
    seconds : float
        Time that finding it took.
    check_seconds : float
        Time that the checker took.
    primes : tuple of int
        Primes modulo which the families were found: what rests on, where there is none.
    certificate : dict or None
        It; not written to JSON with the rest, but to a file of its own.
    out_of_time : bool
        Whether there is none because the search was stopped; more time may find one.
    """

    accepted: bool
    reason: str
    size: int
    places: int
    seconds: float
    check_seconds: float
    primes: tuple[int, ...]
    certificate: dict[str, Any] | None = field(default=None, repr=False, metadata={"json": False})
    out_of_time: bool = field(default=False, metadata={"optional": True})


class Answer(Protocol):
    """What of a ``ClosedForm`` says how sure it is."""

    @property
    def word(self) -> str:
        """Proven, probable, or not complete."""

    @property
    def gaps(self) -> tuple[str, ...]:
        """Why not complete."""

    @property
    def proof(self) -> Proof | None:
        """Outcome of the search for a certificate."""

    @property
    def random_steps(self) -> RandomSteps | None:
        """Steps that rest on random points."""

    @property
    def slice_count(self) -> SliceCount | None:
        """Result of random slices."""

    @property
    def deviation(self) -> Deviation | None:
        """Difference between its geometry and the file's."""

    @property
    def tube(self) -> object | None:
        """Text about a robot whose design has the families."""


def coverage_words(forms: Answer) -> str:
    """Return how sure it is that none is missing, in a few words for a page that lists families."""
    of = "" if forms.deviation is None else f" for {forms.deviation.geometry}"
    how = "" if forms.deviation is None else f" ({forms.deviation.change})"
    robot = "" if forms.tube is None else f" {forms.tube}"
    if forms.word == "proven":
        return f"Proven{of}{how}: there are no others.{robot}"
    if forms.word == "probable":
        sure = "nothing is known to be missing, but there is no certificate"
        return f"Probable{of}{how}: {sure}.{robot}"
    return (
        f"NOT complete{of}{how}: {'; '.join(forms.gaps)}. Distances are to what is "
        "listed: other singular configurations may be nearer."
    )


def certainty(forms: Answer, page: Page = PLAIN) -> str:
    """Return how sure it is that none is missing, and what that rests on, or what is missing."""
    if forms.word != "not complete":
        return proof_text(forms, page)
    said = (caution("not complete"), ": ")
    lines = [page.paragraph(*said, gap, first="  ") for gap in forms.gaps]
    if forms.slice_count is not None and not forms.slice_count.off:
        lines.append(page.paragraph(forms.slice_count.evidence(), first="  "))
    return "\n".join(lines)


def proof_text(forms: Answer, page: Page = PLAIN) -> str:
    """Return what the word rests on: a certificate, or random points."""
    proof = forms.proof
    of = "" if forms.deviation is None else f" for {forms.deviation.geometry}"
    if proof is not None and proof.accepted:
        size = unbroken(f"{proof.size / 1e3:.1f} kB")
        took = unbroken(f"{1e3 * proof.check_seconds:.0f} ms")
        return page.paragraph(
            good("proven"), f"{of}: certificate of {size}, checked in {took}", first="  "
        )
    counted = f"; it rests on a count: {forms.slice_count.sentence()}" if forms.slice_count else ""
    if proof is None:
        return page.paragraph(f"probable: no certificate was looked for{counted}", first="  ")
    steps = _random_steps(forms)
    if counted and (forms.random_steps is None or not forms.random_steps.systems):
        steps, counted = counted.removeprefix("; "), ""
    return page.paragraph(
        f"probable: nothing is known to be missing, but {steps}{counted}; "
        f"no certificate: {proof.reason}",
        first="  ",
    )


CHANCE = 1e-12
"""Bound of the chance that a random point modulo one prime misleads: degree / prime (Schwartz,
1980; Zippel, 1979), with degrees
below 4e6 (eliminants are cut off at 3,000) and primes of 62 bits."""


def _random_steps(forms: Answer) -> str:
    """Return what rests on random points of finite fields, with primes and seeds."""
    steps = forms.random_steps
    if steps is None or not steps.systems:
        return "no step of the search rested on random points"
    primes = " and ".join(str(p) for p in steps.primes)
    seeds = " and ".join(str(s) for s in steps.seeds)
    systems = "one system" if steps.systems == 1 else f"{steps.systems} systems"
    return (
        f"{systems} of equations rested on random points modulo {primes} (seeds {seeds}), "
        f"where one is wrong with a chance below {CHANCE:.0e} unless a prime divides what must not "
        "vanish"
    )
