"""Why a family is singular: minors that are multiples of its forms, and others by these."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import field

from pinsing._dataclass import dataclass
from pinsing.proof.checker import Certificate, Poly, Rejected
from pinsing.proof.combination import combination
from pinsing.proof.division import divisions
from pinsing.proof.forms import Forms
from pinsing.proof.laplace import Lines, Sum, sum_of, sums_to_minors
from pinsing.proof.place import NotFound, Place, place_text

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
    BudgetExceeded
        If the time of ``tidy`` is over.
    """
    minors = dict(_minors(draft, tidy, family, draft.rank))
    place = (family.values, family.relations)
    plain: set[Lines] = set()
    for lines, minor in minors.items():
        tidy.require_time()
        if draft.ring.vanishes(minor, place):
            plain.add(lines)
    if len(plain) == len(minors):
        return Soundness()
    # Only of as many forms as its codimension is a family known to have nothing smaller.
    exact = codimension == len(family.forms)
    tried: set[Lines] = set()
    pivot = _pivot(draft, tidy, family, plain, tried) if exact else None
    if pivot is not None:
        return Soundness(pivot)
    found = Soundness()
    for lines, minor in sorted(minors.items(), key=lambda item: len(item[1])) if exact else ():
        if lines not in plain and _by_division(draft, tidy, family, minor, found):
            plain.add(lines)
            pivot = _pivot(draft, tidy, family, plain, tried)
            if pivot is not None:
                found.pivot = pivot
                return found
    multiples, totals = sums_to_minors(draft, tidy, family)
    for minor in minors.values():
        tidy.require_time()
        draft.ring.work = 0  # what is counted is one step here, the whole check there
        place = (family.values, [*family.relations, *totals])
        if draft.ring.vanishes(minor, place):
            continue
        combined = combination(draft.ring, draft.ring.stripped(minor)[0], family.relations)
        if combined is None:
            break
        multiples.append(sum_of(len(family.values), dict(enumerate(combined))))
        totals += draft.ring.stripped(minor)
    else:
        return Soundness(multiples=multiples)
    raise NotFound(f"{place_text(family)} is not shown to be singular")


def _by_division(
    draft: Certificate, tidy: Forms, family: Place, minor: Poly, found: Soundness
) -> bool:
    """Add a sum that a minor is a multiple of, but for what is zero on no component."""
    ring = draft.ring
    for f, _ in tidy.factors(minor):
        tidy.require_time()
        for tops, times, multiples in divisions(ring, f, family.relations):
            if not _is_apart(draft, family, tops):
                continue
            found.multiples.append(sum_of(len(family.values), dict(enumerate(multiples))))
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


def _minors(
    draft: Certificate, tidy: Forms, family: Place, size: int
) -> Iterator[tuple[Lines, Poly]]:
    minor = draft.at(family.values)
    for rows in itertools.combinations(range(draft.sides[0]), size):
        for columns in itertools.combinations(range(draft.sides[1]), size):
            tidy.require_time()
            yield (rows, columns), minor(rows, columns)


def _pivot(
    draft: Certificate, tidy: Forms, family: Place, plain: set[Lines], tried: set[Lines]
) -> Lines | None:
    """A minor of one line less, zero on no component, that only plain ones have: the shortest.

    Without lines where all are plain.
    """
    if len(plain) == math.comb(draft.sides[0], draft.rank) * math.comb(draft.sides[1], draft.rank):
        return (), ()
    found = []
    for lines, minor in _minors(draft, tidy, family, draft.rank - 1):
        wider = (
            [tuple(sorted((*part, k))) for k in range(count) if k not in part]
            for part, count in zip(lines, draft.sides, strict=True)
        )
        if minor != 0 and lines not in tried and plain.issuperset(itertools.product(*wider)):
            found.append((len(draft.ring.stripped(minor)[0]), lines))
    for _, lines in sorted(found)[:_TRIED]:
        tidy.require_time()
        tried.add(lines)
        if _is_apart(draft, family, draft.at(family.values)(*lines)):
            return lines
    return None
