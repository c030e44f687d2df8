"""Why a family is singular: minors that are multiples of its forms, and others by these."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from pinsing.proof.checker import Certificate, Poly, Rejected
from pinsing.proof.division import divisions
from pinsing.proof.forms import Forms
from pinsing.proof.place import NotFound, Place, place_text
from pinsing.proof.skeleton import form_text

Sum = list[list[Any]]
"""Terms: a polynomial as text, and the number of the form of a family that it is times."""
Lines = tuple[tuple[int, ...], tuple[int, ...]]
"""Rows and columns of a minor."""
_TRIED = 12
"""Pivots that are tried, the shortest first."""


@dataclass
class Soundness:
    """What a certificate says for a family: the minors that have the pivot's lines vanish there.

    Attributes
    ----------
    pivot : Lines
        A minor that is zero on no component; without lines it is 1, and all minors are meant.
    apart : list of Poly
        Forms that are zero on no component: the minors may be multiplied by them.
    multiples : list of Sum
        Sums of multiples of the family's forms that these minors are multiples of.
    """

    pivot: Lines = ((), ())
    apart: list[Poly] = field(default_factory=list)
    multiples: list[Sum] = field(default_factory=list)


def soundness(draft: Certificate, tidy: Forms, family: Place, codimension: int) -> Soundness:
    """Why all minors vanish on a family, of a codimension.

    Raises
    ------
    NotFound
        If that was not seen.
    """
    minors = dict(_minors(draft, family, draft.rank))
    place = (family.values, family.relations)
    plain = {lines for lines, minor in minors.items() if draft.ring.vanishes(minor, place)}
    if len(plain) == len(minors):
        return Soundness()
    # Only of as many forms as its codimension is a family known to have nothing smaller.
    exact = codimension == len(family.forms)
    tried: set[Lines] = set()
    pivot = _pivot(draft, family, plain, tried) if exact else None
    if pivot is not None:
        return Soundness(pivot)
    multiples, totals = sums_to_minors(draft, family)
    place = (family.values, [*family.relations, *totals])
    if all(draft.ring.vanishes(minor, place) for minor in minors.values()):
        return Soundness(multiples=multiples)
    found = Soundness()
    for lines, minor in sorted(minors.items(), key=lambda item: len(item[1])) if exact else ():
        if lines not in plain and _by_division(draft, tidy, family, minor, found):
            plain.add(lines)
            pivot = _pivot(draft, family, plain, tried)
            if pivot is not None:
                found.pivot = pivot
                return found
    raise NotFound(f"{place_text(family)} is not shown to be singular")


def _by_division(
    draft: Certificate, tidy: Forms, family: Place, minor: Poly, found: Soundness
) -> bool:
    """Add a sum that a minor is a multiple of, but for what is zero on no component."""
    ring, first = draft.ring, len(family.values)
    for f, _ in tidy.factors(minor):
        for tops, times, multiples in divisions(ring, f, family.relations):
            if not _is_apart(draft, family, tops):
                continue
            terms = [[form_text(c), first + k] for k, c in enumerate(multiples) if c != 0]
            found.multiples.append(terms)
            for factor, power in tidy.factors(times):
                found.apart += [factor] * (power - found.apart.count(factor))
            return True
    return False


def _is_apart(draft: Certificate, family: Place, form: Poly) -> bool:
    """Whether a form is seen to be zero on no component of a family."""
    draft.ring.work = 0  # what is counted is one step here, the whole check there
    forms = [*family.relations, *draft.ring.stripped(form)]
    try:
        return draft.ring.codimension_at_least(len(family.relations) + 1, forms)
    except Rejected:  # it would take too long to see
        return False
    finally:
        draft.ring.work = 0


def _minors(draft: Certificate, family: Place, size: int) -> Iterator[tuple[Lines, Poly]]:
    for rows in itertools.combinations(range(draft.sides[0]), size):
        for columns in itertools.combinations(range(draft.sides[1]), size):
            yield (rows, columns), draft.at(family.values)(rows, columns)


def _pivot(draft: Certificate, family: Place, plain: set[Lines], tried: set[Lines]) -> Lines | None:
    """A minor of one line less, zero on no component, that only plain ones have: the shortest.

    Without lines where all are plain.
    """
    if len(plain) == math.comb(draft.sides[0], draft.rank) * math.comb(draft.sides[1], draft.rank):
        return (), ()
    found = []
    for lines, minor in _minors(draft, family, draft.rank - 1):
        wider = (
            [tuple(sorted((*part, k))) for k in range(count) if k not in part]
            for part, count in zip(lines, draft.sides, strict=True)
        )
        if minor != 0 and lines not in tried and plain.issuperset(itertools.product(*wider)):
            found.append((len(draft.ring.stripped(minor)[0]), lines))
    for _, lines in sorted(found)[:_TRIED]:
        tried.add(lines)
        if _is_apart(draft, family, draft.at(family.values)(*lines)):
            return lines
    return None


def sums_to_minors(draft: Certificate, family: Place) -> tuple[list[Sum], list[Poly]]:
    """Sums of multiples of a family's forms that are minors, but for units; and what they are.

    A row of the matrix with one more column than a minor has gives a sum that is zero: its
    entries times the minors without their columns, with signs (Laplace). Where all but one of
    these are multiples of the family's forms, or their entry is zero, so is the last one.
    """
    ring, size = draft.ring, draft.rank
    if draft.sides[1] <= size or not family.relations:
        return [], []
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
    return found, totals


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
