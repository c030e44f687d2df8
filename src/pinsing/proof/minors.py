"""Minors that vanish on a family because others do, by the relations between minors."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

from pinsing.proof.checker import Certificate, Poly
from pinsing.proof.place import Place
from pinsing.proof.skeleton import form_text

Sum = list[list[Any]]
"""Terms: a polynomial as text, and the number of the form of a family that it is times."""


def sums_to_minors(draft: Certificate, family: Place) -> list[Sum]:
    """Sums of multiples of a family's forms that are minors, but for units.

    A row of the matrix with one more column than a minor has gives a sum that is zero: its
    entries times the minors without their columns, with signs (Laplace). Where all but one of
    these are multiples of the family's forms, or their entry is zero, so is the last one.
    """
    ring, size = draft.ring, draft.rank
    if draft.sides[1] <= size or not family.relations:
        return []
    minor = draft.at(family.values)
    found: list[Sum] = []
    totals: list[Poly] = []
    for rows in itertools.combinations(range(draft.sides[0]), size):
        for columns in itertools.combinations(range(draft.sides[1]), size):
            value = minor(rows, columns)
            if value == 0 or any(ring.divides(p, value) for p in [*family.relations, *totals]):
                continue
            for total in _as_sum(draft, family, minor, rows, columns):
                found.append(total)
                totals += ring.stripped(ring.put(draft.sum(total, family.forms), family.values))
    return found


def _as_sum(
    draft: Certificate,
    family: Place,
    minor: Callable[..., Poly],
    rows: tuple[int, ...],
    columns: tuple[int, ...],
) -> list[Sum]:
    """The shortest sum that is one minor, if there is one."""
    ring, first = draft.ring, len(family.values)
    found: list[Sum] = []
    for i, extra in itertools.product(rows, range(draft.sides[1])):
        entries = [ring.put(x, family.values) for x in draft.matrix[i]]
        if extra in columns or entries[extra] == 0:
            continue
        if ring.joints(ring.stripped(entries[extra])[0]):
            continue
        every = tuple(sorted({*columns, extra}))
        terms: dict[int, Poly] = {}
        for k, j in enumerate(every):
            if j == extra or entries[j] == 0:
                continue
            other = minor(rows, every[:k] + every[k + 1 :])
            at = next((a for a, p in enumerate(family.relations) if ring.divides(p, other)), None)
            if at is None:
                break
            times = ring.reduced(divmod(other, family.relations[at])[0] * entries[j] * (-1) ** k)
            terms[at] = terms.get(at, ring.zero) + times
        else:
            # Units are taken out: the sum is compared without, and they make it many times longer.
            short = zip(terms, ring.stripped(*terms.values()), strict=True)
            found.append([[form_text(c), first + at] for at, c in short if c != 0])
    return sorted(found, key=lambda total: sum(len(text) for text, _ in total))[:1]
