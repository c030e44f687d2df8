"""The part of a certificate that states the arm: its chain in exact numbers."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np

from pinsing.algebra.budget import Budget
from pinsing.algebra.mimic import drives
from pinsing.algebra.ring import Ring as AlgebraRing, rational
from pinsing.proof.checker import SCHEMA, Certificate, Matrix, Poly, Ring, flipped
from pinsing.robot.exact_placements import IDENTITY, Deviation
from pinsing.robot.nominal import Nominal
from pinsing.robot.surd import SQUARES, Exact, parts_of, surd

_ROOTS = ("", "s2", "s3", "s2s3")


class NotStated(Exception):
    """Certificates have no words for the task."""


def number_text(value: Exact | int) -> str:
    """An exact number as certificates write it: ``1/2``, ``-1/4s2 1/4s2s3``."""
    parts = zip(_ROOTS, parts_of(value), strict=True)
    return " ".join(f"{part}{root}" for root, part in parts if part) or "0"


def form_text(form: Poly) -> str:
    """Return a polynomial as certificates write it: ``2 -1/3y1^2y3``."""
    # Powers of x complete the degree in each joint, and are left out but where that of y is
    # highest.
    names, tops = form.context().names(), form.degrees()
    texts = []
    for m, c in zip(form.monoms(), form.coeffs(), strict=True):
        text = str(c)
        for k, power in enumerate(m):
            if power and (names[k][0] != "x" or m[k + 1] == tops[k + 1]):
                text += f"{names[k]}^{power}" if power > 1 else names[k]
        texts.append(text)
    return " ".join(texts) or "0"


def roots_in(geometry: Nominal) -> tuple[int, ...]:
    """Return what the numbers of a chain have square roots of: 2 or 3, both or none."""
    numbers = [x for R in geometry.rotation for row in R for x in row]
    numbers += [x for row in geometry.tip_rotation for x in row]
    numbers += [x for drive in drives(geometry)[0] for x in drive.turn]
    used = {k for x in numbers for k, part in enumerate(parts_of(x)) if part}
    return tuple(d for d in (2, 3) if any(SQUARES[k] % d == 0 for k in used))


def skeleton(geometry: Nominal, rank: int, roots: Sequence[int]) -> dict[str, Any]:
    """A certificate of an arm that states no family, proves nothing and reduces nothing."""
    arm, chain = geometry.arm, _chain(geometry)
    task, links = arm.task, len(chain["chain"])
    invariant = list(task.rows) in ([*range(6)], [0, 1, 2], [3, 4, 5])
    if task.at_tip and not all(task.at_tip):
        raise NotStated("certificates have all rows in the base's axes or all in the tip's")
    deviation = Deviation.of((*geometry.snaps, *drives(geometry)[1]))
    axes = links // 2 if invariant else links + 1 if task.at_tip else 0
    return {
        "schema": SCHEMA,
        "robot": arm.name if deviation is None else f"{arm.name}, {deviation}",
        "base": arm.base,
        "tip_frame": arm.tip,
        "task": str(arm.task),
        "joints": [
            {"name": name, "kind": "prismatic" if slides else "revolute"}
            for name, slides in zip(arm.joints, arm.prismatic, strict=True)
        ],
        "square_roots": list(roots),
        **chain,
        "rows": list(arm.task.rows),
        "axes": axes,
        "rank": rank,
        "row_steps": [],
        "column_steps": [],
        "polynomials": [],
        "families": [],
        "places": [],
    }


def _chain(geometry: Nominal) -> dict[str, Any]:
    """Placements and motions; constant motions become part of a placement."""
    chain: list[dict[str, Any]] = []
    placed: list[Any] = []
    for i, drive in enumerate(drives(geometry)[0]):
        placed.append(_motion(geometry.rotation[i], geometry.translation[i]))
        if geometry.prismatic[i] and drive.shift != 0:
            placed.append(_motion(shift=(0, 0, drive.shift)))
        elif not geometry.prismatic[i] and (drive.turn[0] != 1 or drive.turn[1] != 0):
            c, s = drive.turn
            placed.append(_motion([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
        if drive.multiple != 0:
            multiple = number_text(drive.multiple)
            chain.append({**_placement(placed), "joint": drive.leader, "multiple": multiple})
            placed = []
    placed.append(_motion(geometry.tip_rotation, geometry.translation[-1]))
    return {"chain": chain, "tip": _placement(placed)}


def _motion(turn: Sequence[Sequence[Any]] = IDENTITY, shift: Sequence[Any] = (0, 0, 0)) -> Any:
    """A rigid motion in exact numbers, (4, 4)."""
    rows = [[*row, x] for row, x in zip(turn, shift, strict=True)]
    return np.array([*rows, [0, 0, 0, 1]], dtype=object)


def _placement(motions: Sequence[Any]) -> dict[str, Any]:
    """Motions one after the other."""
    whole = functools.reduce(np.matmul, motions)
    rows = [[number_text(x) for x in row] for row in whole[:3].tolist()]
    return {"rotation": [row[:3] for row in rows], "translation": [row[3] for row in rows]}


def form_of(poly: Poly, own: AlgebraRing, context: Any, roots: Sequence[int]) -> Poly:
    """A polynomial of an arm's ring as a form of a certificate's, z of sliders as y over x."""
    terms: Mapping[tuple[int, ...], Exact] = own.terms(poly)
    degrees = poly.degrees()
    found: dict[tuple[int, ...], Any] = {}
    for monomial, c in terms.items():
        powers: list[int] = []
        for j, slides in enumerate(own.prismatic):
            first = own.start[j]
            if slides:
                powers += [int(degrees[first]) - monomial[first], monomial[first]]
            else:
                powers += monomial[first : first + 2]
        for square, part in zip(SQUARES, parts_of(c), strict=True):
            if part:
                key = (*powers, *(int(square % d == 0) for d in roots))
                found[key] = rational(part)
    return context.from_dict(found)


Number: TypeAlias = Any
"""An exact number: fmpq over the rationals, `Exact` where there are square roots."""

_ASKED_AFTER = 100_000
"""Products of terms, some milliseconds, between two questions to the budget."""


class Draft(Certificate):
    """A certificate in the making: the Jacobian of its chain is found once for all drafts.

    All that its ring does is counted, and ends with a budget.
    """

    def __init__(
        self, data: dict[str, Any], budget: Budget, jacobian: Matrix | None = None
    ) -> None:
        self.known_jacobian = jacobian
        self._budget = budget
        self._unasked = _ASKED_AFTER  # the first product asks: there may be no time at all
        super().__init__(data)
        self._resultants: dict[tuple[str, str, int], Poly] = {}
        self._kept = 0
        self._resultant, self.ring.resultant = self.ring.resultant, self._known_resultant  # type: ignore[method-assign]

    def _known_resultant(self, p: Poly, g: Poly, joint: int) -> Poly:
        """As the checker finds it; a search asks for the same ones again and again."""
        # Terms of resultants that are kept: some hundred megabytes.
        if self._kept > 1_000_000:
            return self._resultant(p, g, joint)
        key = (str(p), str(g), joint)
        self.ring.spend(1000)  # finding it again takes time, too
        if key not in self._resultants:
            self._resultants[key] = self._resultant(p, g, joint)
            self._kept += len(p) + len(g) + len(self._resultants[key])
        return self._resultants[key]

    def jacobian(self) -> Matrix:
        """As the checker finds it, which does so by itself in the end."""
        self.ring.spend = self._in_time  # type: ignore[method-assign]
        if self.known_jacobian is None:
            self.known_jacobian = super().jacobian()
        return self.known_jacobian

    def _in_time(self, work: int) -> None:
        """Count as the checker does, unless the budget has no room for so many products."""
        # Products of terms that take as long as what else a step does, some microseconds.
        self._unasked += work + 30
        if self._unasked > _ASKED_AFTER:
            self._budget.check(self._unasked)
            self._unasked = 0
        Ring.spend(self.ring, work)


def without_dependent_lines(
    data: Mapping[str, Any], budget: Budget
) -> tuple[dict[str, Any], Matrix]:
    """The certificate with the steps that make dependent lines zero, and its whole Jacobian."""
    whole = Draft({**data, "rank": 1, "row_steps": [], "column_steps": []}, budget)
    rows = _steps(whole, whole.jacobian(), budget)
    columns = _steps(whole, flipped(whole.without_dependent(whole.jacobian(), rows)), budget)
    return {**data, "row_steps": rows, "column_steps": columns}, whole.jacobian()


def _steps(certificate: Certificate, lines: Matrix, budget: Budget) -> list[list[Any]]:
    """Return which multiple of which line is taken from which."""
    vectors = []
    for line in lines:
        budget.check()
        vectors.append(_vector(certificate, line))
    found = _dependent(vectors, budget)
    text = number_text if certificate.data["square_roots"] else str
    return [[i, k, text(c)] for i, terms in found.items() for k, c in terms.items()]


def _vector(certificate: Certificate, line: list[Any]) -> dict[Any, Number]:
    """Coefficients of a row or column, by entry and monomial."""
    if not certificate.data["square_roots"]:
        return {(k, m): c for k, x in enumerate(line) for m, c in x.to_dict().items()}
    count = 2 * len(certificate.ring.pairs)
    roots = certificate.data["square_roots"]
    parts: dict[Any, list[Fraction]] = {}
    for k, x in enumerate(line):
        for m, c in x.to_dict().items():
            at = dict(zip(roots, m[count:], strict=True))
            place = at.get(2, 0) + 2 * at.get(3, 0)  # among SQUARES
            four = parts.setdefault((k, tuple(m[:count])), [Fraction(0)] * 4)
            four[place] += Fraction(int(c.p), int(c.q))
    return {key: surd(*four) for key, four in parts.items()}


def _dependent(lines: list[dict[Any, Number]], budget: Budget) -> dict[int, dict[int, Number]]:
    """Lines that are sums of multiples of earlier ones that stay, and these multiples."""
    basis: list[tuple[Any, dict[Any, Number], dict[int, Number]]] = []
    found: dict[int, dict[int, Number]] = {}
    for i, line in enumerate(lines):
        # One as a number of the line's kind; a line of zeros stands for itself.
        one = next((c / c for c in line.values()), Fraction(1))
        vector, terms = dict(line), dict[int, Number]({i: one})
        for lead, other, other_terms in basis:
            if lead in vector:
                budget.check()
                ratio = vector[lead] / other[lead]
                vector = _less(vector, ratio, other)
                terms = _less(terms, ratio, other_terms)
        if vector:
            basis.append((next(iter(vector)), vector, terms))
        else:
            found[i] = {k: -c for k, c in terms.items() if k != i}
    return found


def _less(a: Mapping[Any, Number], ratio: Number, b: Mapping[Any, Number]) -> dict[Any, Number]:
    """Return a - ratio b, without zeros."""
    out = dict(a)
    for key, c in b.items():
        out[key] = out[key] - ratio * c if key in out else -(ratio * c)
    return {k: c for k, c in out.items() if c != 0}
