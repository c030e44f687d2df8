"""Steps that make the matrix of a certificate smaller, found for the checker to repeat."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from pinsing.geometry.surd import Exact, surd
from pinsing.proof.checker import Certificate, flipped
from pinsing.proof.skeleton import number_text

_POSITION = {(0, 0): 0, (1, 0): 1, (0, 1): 2, (1, 1): 3}


def find_reduction(certificate: Certificate) -> list[dict[str, Any]]:
    """Reduce the matrix of a certificate as far as it goes; what was done, step by step."""
    steps: list[dict[str, Any]] = []
    while certificate.matrix and certificate.left > 0:
        step = _next(certificate)
        if step is None:
            break
        certificate.reduce(step)
        steps.append(step)
    return steps


def _next(certificate: Certificate) -> dict[str, Any] | None:
    for kind, lines in (("row", certificate.matrix), ("column", flipped(certificate.matrix))):
        found = _dependent([_vector(certificate, line) for line in lines])
        if found is not None:
            return {kind: found[0], "is": {str(k): number_text(c) for k, c in found[1].items()}}
    return _pivot(certificate)


def _pivot(certificate: Certificate) -> dict[str, Any] | None:
    """An entry that is never zero, the one that disturbs the rest least."""
    ring, best = certificate.ring, None
    for i, row in enumerate(certificate.matrix):
        in_row = sum(len(x) for x in row)
        for j, x in enumerate(row):
            if x == 0 or ring.joints(ring.stripped(x)):
                continue
            below = sum(len(r[j]) for k, r in enumerate(certificate.matrix) if k != i)
            cost = below * in_row + (1000 if ring.joints(x) else 0)
            if best is None or cost < best[0]:
                best = (cost, i, j)
    return None if best is None else {"pivot": [best[1], best[2]]}


def _vector(certificate: Certificate, line: list[Any]) -> dict[Any, Exact]:
    """Coefficients of a row or column, by entry and monomial."""
    count = 2 * len(certificate.ring.pairs)
    roots = [d for _, d in certificate.ring.roots]
    parts: dict[Any, list[Fraction]] = {}
    for k, x in enumerate(line):
        for m, c in x.to_dict().items():
            at = dict(zip(roots, m[count:], strict=True))
            place = _POSITION[at.get(2, 0), at.get(3, 0)]
            four = parts.setdefault((k, tuple(m[:count])), [Fraction(0)] * 4)
            four[place] += Fraction(int(c.p), int(c.q))
    return {key: surd(*four) for key, four in parts.items()}


def _dependent(lines: list[dict[Any, Exact]]) -> tuple[int, Mapping[int, Exact]] | None:
    """A line that is a sum of multiples of earlier ones, and these multiples."""
    basis: list[tuple[Any, dict[Any, Exact], dict[int, Exact]]] = []
    for i, line in enumerate(lines):
        vector, made = dict(line), {i: Fraction(1)}
        terms: dict[int, Exact] = dict(made)
        for lead, other, other_terms in basis:
            if lead not in vector:
                continue
            ratio = vector[lead] / other[lead]
            vector = _less(vector, ratio, other)
            terms = _less(terms, ratio, other_terms)
        if not vector:
            return i, {k: -c for k, c in terms.items() if k != i}
        basis.append((next(iter(vector)), vector, terms))
    return None


def _less(a: Mapping[Any, Exact], ratio: Exact, b: Mapping[Any, Exact]) -> dict[Any, Exact]:
    """Return a - ratio b, without zeros."""
    out = dict(a)
    for key, c in b.items():
        out[key] = out.get(key, Fraction(0)) - ratio * c
    return {k: c for k, c in out.items() if c != 0}
