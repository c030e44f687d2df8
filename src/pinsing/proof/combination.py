"""A form as a sum of multiples of others, by solving for the multiples' coefficients."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from flint import fmpq_mat

from pinsing.proof.checker import Poly, Ring

_UNITS = 3
"""Powers of units that a form is multiplied by, less one: they are zero at no configuration."""
_MOST = 600
"""Unknown coefficients beyond which nothing is solved."""


def combination(ring: Ring, form: Poly, others: Sequence[Poly]) -> list[Poly] | None:
    """What others are multiplied by so that the sum is a form times units; None if none was found.

    Unlike division it needs no order of the joints: the others may all have the same ones.
    """
    if ring.squares:
        return None
    joints = sorted({j for p in others for j in ring.joints(p)})
    for _ in range(_UNITS):
        found = _solved(ring, form, others)
        if found is not None:
            return found
        for j in joints:
            form = form * ring.unit[j]
    return None


def _solved(ring: Ring, form: Poly, others: Sequence[Poly]) -> list[Poly] | None:
    terms = [(k, m) for k, p in enumerate(others) for m in _monomials(ring, form, p)]
    if not terms or len(terms) > _MOST:
        return None
    columns = [(others[k] * m).to_dict() for k, m in terms]
    target = form.to_dict()
    rows = {m: i for i, m in enumerate(sorted({*target, *itertools.chain(*columns)}))}
    matrix = fmpq_mat(len(rows), len(columns) + 1)
    for at, column in enumerate([*columns, target]):
        for m, c in column.items():
            matrix[rows[m], at] = c
    ring.spend(matrix.nrows() * matrix.ncols())
    reduced, rank = matrix.rref()
    found = [ring.zero for _ in others]
    for i in range(rank):
        lead = next(at for at in range(len(columns) + 1) if reduced[i, at] != 0)
        if lead == len(columns):
            return None
        k, m = terms[lead]
        found[k] += reduced[i, len(columns)] * m
    return found


def _monomials(ring: Ring, form: Poly, p: Poly) -> Iterator[Poly]:
    """What a form of the degree of ``form`` over ``p`` may consist of."""
    parts = []
    for j, (x, y) in enumerate(ring.pairs):
        left = ring.degree(form, j) - ring.degree(p, j)
        if left < 0:
            return
        parts.append([x ** (left - e) * y**e for e in range(left + 1)])
    for factors in itertools.product(*parts):
        product = ring.one
        for f in factors:
            product = product * f
        yield product
