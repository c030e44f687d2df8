"""Division of forms by forms, one joint at a time: what vanishes where others do, and why.

A checker of certificates only sees whether one form is a multiple of another one. What follows
from several is found here, and told it as a sum of multiples.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence

from pinsing.proof.checker import MOST_WORK, Poly, Rejected, Ring

_STEP = 10_000_000
"""Products of terms that one question may take: a small part of what the checker spends in all."""


def divisions(
    ring: Ring, form: Poly, forms: Sequence[Poly]
) -> Iterator[tuple[Poly, Poly, list[Poly]]]:
    """Ways to divide a form by others, from the last to the first, that leave nothing.

    Each form is divided by in a joint that the ones before it do not have.

    Yields
    ------
    tops : Poly
        Product of the forms' leading coefficients, each once.
    times : Poly
        The same to the powers that make ``times`` form a sum of multiples of the forms.
    multiples : list of Poly
        What these forms are multiplied by.
    """
    order = sorted(range(len(forms)), key=lambda k: len(ring.joints(forms[k])))
    seen = [{*ring.joints(forms[k])} for k in order]
    own = [joints.difference(*seen[:k]) for k, joints in enumerate(seen)]
    for ways in itertools.product(*own):
        left, tops, times, xs = form, ring.one, ring.one, ring.one
        multiples = [ring.zero] * len(forms)
        for k, j in reversed(list(zip(order, ways, strict=True))):
            p, (x, y) = forms[k], ring.pairs[j]
            top, degree = top_of(ring, p, j), ring.degree(p, j)
            tops = ring.times(tops, top)
            while tops != 0 and left != 0 and (more := ring.degree(left, j) - degree) >= 0:
                quotient = ring.times(top_of(ring, left, j), y**more)
                left = divmod(ring.times(left, top) - ring.times(quotient, p), x)[0]
                multiples = [ring.times(m, top) for m in multiples]
                multiples[k] += ring.times(xs, quotient)
                times, xs = ring.times(times, top), xs * x
        if left == 0:
            yield tops, times, multiples


def top_of(ring: Ring, form: Poly, joint: int) -> Poly:
    """What the highest power of y of a joint, without its x, is multiplied by."""
    x, y = ring.names[2 * joint : 2 * joint + 2]
    return form.subs({x: 0, y: 1})


def empty(ring: Ring, forms: Sequence[Poly]) -> bool:
    """Whether forms have no common zero, as one of them is a number."""
    return any(f != 0 and not ring.joints(f) for f in forms)


def shown(ring: Ring, question: Callable[[], bool]) -> bool:
    """Whether something is seen, and not only after long; the work is not counted."""
    ring.work = MOST_WORK - _STEP
    try:
        return question()
    except Rejected:
        return False
    finally:
        ring.work = 0


def vanishes(ring: Ring, form: Poly, forms: Sequence[Poly]) -> bool:
    """Whether ``form`` is shown to be zero wherever all of ``forms`` are."""
    if ring.vanishes(form, ({}, list(forms))):
        return True
    outside: list[Poly] = []  # zero where dividing, for some choice of joints, tells nothing
    for tops, _, _ in divisions(ring, form, forms) if len(forms) > 1 else ():
        outside.append(tops)
        # No component of so few forms has a larger codimension: none is in ``outside``.
        if ring.codimension_at_least(len(forms) + 1, [*forms, *outside]):
            return True
    return False
