"""The search for a certificate that a closed form is all there is, and what became of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from pinsing.algebra.budget import Apart, Budget, BudgetExceeded
from pinsing.algebra.jacobian_matrix import constants
from pinsing.algebra.mimic import NotFollowed
from pinsing.algebra.surd_ring import ring_of
from pinsing.families.certificate import Stated, certificate, text_of
from pinsing.families.faithful import disagreements
from pinsing.families.form import ClosedForm, Proof
from pinsing.families.proof_forms import NotFound
from pinsing.proof.checker import Rejected, verify
from pinsing.robot.surd import Surd

SHORT = 10.0
"""Seconds of work for a search where nobody asked for one; as a rule they take three."""
LONG = 60.0
"""Seconds of work for one that was asked for."""


def prove(
    form: ClosedForm, seconds: float = LONG, progress: Callable[[str], None] | None = None
) -> ClosedForm:
    """Look for a certificate that a closed form is the whole singular set, and have it checked.

    Parameters
    ----------
    form : ClosedForm
        As `closed_form` gave it.
    seconds : float
        Time for the search; the check comes on top.
    progress : callable
        Told now and then how far the search is.

    Returns
    -------
    ClosedForm
        The same, with ``proof``; complete and without gaps if the certificate was accepted.
    """
    return within(form, Budget(seconds), progress)


def prove_briefly(
    form: ClosedForm, seconds: float, progress: Callable[[str], None] | None = None
) -> ClosedForm:
    """The same where nobody asked for it: for `SHORT` seconds of work, and so many on the clock."""
    found = within(form, Budget(max(seconds, 0.0), SHORT), progress)
    if found.proof is None or found.proof.accepted or not found.proof.out_of_time:
        return found
    said = f"{found.proof.reason}; --prove, or prove=True, looks for one for {LONG:g} s"
    return replace(found, proof=replace(found.proof, reason=said))


def within(form: ClosedForm, budget: Budget, progress: Callable[[str], None] | None) -> ClosedForm:
    """The same, within a budget; what becomes long goes on in a child, which can be stopped."""
    search = Apart(budget, budget.on_clock, progress or (lambda text: None))

    def say(text: str) -> None:
        if search.child:
            search.tell(text)
        elif progress is not None:
            progress(text)

    started = time.monotonic()
    # With square roots one resultant of few terms may take minutes, of which no count warns.
    roots = form.geometry is not None and any(
        isinstance(x, Surd)
        for part in (*form.geometry.rotation, *form.geometry.translation)
        for x in np.ravel(np.asarray(part, dtype=object))
    )
    ended = search.run(lambda: _proof(form, budget, say), at_once=roots)
    if (proof := ended.result) is None:
        reason = f"none was found: {ended.reason}"
        proof = _none(form, reason, True, time.monotonic() - started)
    if not proof.accepted:
        return replace(form, proof=proof)
    return replace(form, proof=proof, complete=True, gaps=())


def _proof(form: ClosedForm, budget: Budget, progress: Callable[[str], None]) -> Proof:
    """Return what becomes of the search: first of families as stated, then of these in parts."""
    started = time.monotonic()
    reason, stopped = "", False
    for in_parts in (False, True):
        if budget.over:
            stopped = True
            break
        try:
            # Half of the work for the first way, so that some is left for the second.
            share = budget.part(1.0 if in_parts else 0.5)
            data = _made(form, share, progress, in_parts)
            found = time.monotonic()
            text = text_of(data)
            verify(text)
        except NotFound as problem:
            reason, stopped = str(problem), stopped or share.over
        except Rejected as problem:
            reason = f"the checker says: {problem}"
        except BudgetExceeded:
            stopped = True
        except (OverflowError, RecursionError) as problem:
            reason = f"the search for one was given up: {problem}"
        else:
            return Proof(
                accepted=True,
                reason="",
                size=len(text),
                places=len(data["places"]),
                seconds=found - started,
                check_seconds=time.monotonic() - found,
                primes=(),
                certificate=data,
            )
    if stopped:
        reason = f"none was found in the {budget.allowed} allowed"
    return _none(form, reason, stopped, time.monotonic() - started)


def _made(
    form: ClosedForm, budget: Budget, progress: Callable[[str], None] | None, in_parts: bool
) -> dict[str, Any]:
    if (geometry := form.geometry) is None:
        raise NotFound("the closed form was read from a file: without its exact polynomials")
    try:
        numbers = constants(geometry, geometry.arm.task)
    except NotFollowed as reason:
        raise NotFound(f"the algebra does not follow a mimic joint: {reason}") from None
    ring = ring_of(tuple(bool(p) for p in geometry.arm.prismatic), numbers, budget)
    # The certificate is of the polynomials, not of what is stated: unless these are known to agree.
    if form.families is not form.faithful:
        for off in disagreements(form.families, (), ring, geometry, form.symbols):
            raise NotFound(off)
    stated = [Stated(f.name, c) for f in form.families for c in f.components]
    return certificate(
        geometry, ring, form.generic_rank, stated, budget, progress, in_parts=in_parts
    )


def _none(form: ClosedForm, reason: str, stopped: bool, seconds: float) -> Proof:
    primes = () if form.random_steps is None else form.random_steps.primes
    return Proof(False, reason, 0, 0, seconds, 0.0, primes, out_of_time=stopped)
