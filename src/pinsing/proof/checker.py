"""Accept or reject a certificate: that the singular configurations of an arm are those stated.

    python checker.py FILE.json

Needs Python and python-flint, nothing of pinsing; computes with polynomials over Q, exactly: no
factoring, no floats, no random numbers. docs/proof.md has the theorem, the format, and why every
step is right. A joint is a point (x : y): its angle is 2 atan(y/x), or its position y/x metres.
"""

from __future__ import annotations

import functools
import itertools
import json
import re
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

from flint import Ordering, fmpq, fmpq_mpoly_ctx, fmpq_poly

SCHEMA = "pinsing/certificate/1"
EYE = [["1", "0", "0"], ["0", "1", "0"], ["0", "0", "1"]]
MOST_WORK = 5_000_000  # products of terms in one step, so that no file keeps the checker for ever
LONGEST_FILE, MOST_TERMS, SHORT = 4_000_000, 60_000, 200  # characters, terms, terms
NUMBER = re.compile(r"(\d{1,400})(?:/(\d{1,400}))?", re.ASCII)
POWER = re.compile(r"([xys]\d{1,2})(?:\^(\d{1,2}))?", re.ASCII)
MALFORMED = (ArithmeticError, AttributeError, LookupError, MemoryError, TypeError, ValueError)
Poly = Any  # fmpq_mpoly: python-flint ships no types
Matrix = list[list[Poly]]
Values = dict[int, tuple[Poly, Poly]]  # joint: x, y
Where = tuple[Values, list[Poly]]  # joint values and relations
Step = tuple[Matrix, Matrix, Poly]  # a rigid motion and its inverse, both times a unit; it
Chosen = tuple[int, ...]


class Rejected(Exception):
    """The file does not prove what it states."""


def need(truth: bool, otherwise: str) -> None:
    """Reject unless something holds."""
    if not truth:
        raise Rejected(otherwise)


def bounded(a: Poly, b: Poly, times: int = 1) -> None:
    """Reject what would take too long: a product of two polynomials, or so many."""
    need(len(a) * len(b) * times <= MOST_WORK, "polynomials are too long")


def whole(number: Any) -> int:
    """A number that may be an index."""
    need(type(number) is int and 0 <= number < 100_000, f"{str(number)[:20]!r} is no index")
    return int(number)


def flipped(lines: Matrix) -> Matrix:
    """Rows of a matrix from its columns, and back."""
    return [list(line) for line in zip(*lines, strict=True)]


class Ring:
    """Polynomials in x, y of every joint, over Q or with square roots of 2 and 3 adjoined."""

    def __init__(self, slides: list[bool], roots: list[int]) -> None:
        need(0 < len(slides) <= 16, "the chain has no joint, or more than 16")
        need(roots in ([], [2], [3], [2, 3]), "square roots are of 2 and 3 alone")
        own = [f"{v}{j}" for j in range(1, len(slides) + 1) for v in "xy"]
        self.context = fmpq_mpoly_ctx.get([*own, *(f"s{d}" for d in roots)], Ordering.lex)
        self.names, gens = list(self.context.names()), self.context.gens()
        self.roots = list(zip(gens[len(own) :], roots, strict=True))
        self.pairs = [(gens[2 * j], gens[2 * j + 1]) for j in range(len(slides))]
        # Zero at no configuration: x of a prismatic joint, x^2 + y^2 of a revolute one.
        self.unit = [
            x if s else x * x + y * y for s, (x, y) in zip(slides, self.pairs, strict=True)
        ]
        self.zero, self.one = self.context.constant(0), self.context.constant(1)

    def parse(self, text: str) -> Poly:
        """Read a sum of products, such as ``2*x1^2*y3 - 1/3*y1*s2``."""
        need(type(text) is str and text.strip(" ") != "", "a polynomial is no text")
        terms: dict[Chosen, Any] = {}
        pieces = text.replace(" ", "").replace("-", "+-").split("+")
        for piece in pieces[pieces[0] == "" :]:
            factor, powers = fmpq(-1 if piece.startswith("-") else 1), [0] * len(self.names)
            for part in piece.removeprefix("-").split("*"):
                if found := NUMBER.fullmatch(part):
                    factor *= fmpq(int(found[1]), int(found[2] or 1))
                elif found := POWER.fullmatch(part):
                    powers[self.names.index(found[1])] += int(found[2] or 1)
                else:
                    raise Rejected(f"{part[:20]!r} is neither a number nor a power")
            terms[tuple(powers)] = terms.get(tuple(powers), fmpq(0)) + factor
        poly = self.reduced(self.context.from_dict(terms))
        for j in range(len(self.pairs)):
            same = len({m[2 * j] + m[2 * j + 1] for m in poly.monoms()}) < 2
            need(same, f"terms differ in their degree in joint {j + 1}: {text[:40]!r}")
        return poly

    def constant(self, text: str) -> Poly:
        """Read a number."""
        number = self.parse(text)
        need(not self.joints(number), f"{text[:20]!r} is no number")
        return number

    def reduced(self, poly: Poly) -> Poly:
        """The form with s2^2 = 2 and s3^2 = 3 put in: it is 0 only for what is 0."""
        need(len(poly) <= MOST_TERMS, "a polynomial becomes too long")
        for s, d in self.roots:
            poly = divmod(poly, s * s - d)[1]
        return poly

    def joints(self, poly: Poly) -> list[int]:
        """Joints that occur."""
        degrees = poly.degrees()
        return [j for j in range(len(self.pairs)) if max(degrees[2 * j : 2 * j + 2]) > 0]

    def degree(self, form: Poly, joint: int) -> int:
        """Degree in x and y of a joint, of a form that is not zero."""
        return int(sum(form.monomial(0)[2 * joint : 2 * joint + 2]))

    def divides(self, p: Poly, poly: Poly) -> bool:
        """Whether ``poly`` is shown to be zero wherever ``p`` is."""
        return bool(self.reduced(divmod(poly, p)[1]) == 0)

    def stripped(self, poly: Poly) -> Poly:
        """Without factors that are zero at no configuration."""
        for unit in self.unit:
            while poly != 0 and (parts := divmod(poly, unit))[1] == 0:
                poly = parts[0]
        return poly

    def same(self, a: Poly, b: Poly) -> bool:
        """Whether two polynomials are one up to a constant, which their values at a point tell."""
        at = {j: (self.one, (5 + 3 * j) * self.one) for j in range(len(self.pairs))}
        p, q = self.put(a, at), self.put(b, at)
        return bool(q != 0 and self.reduced(a * q - b * p) == 0)

    def put(self, poly: Poly, values: Values) -> Poly:
        """The polynomial with some joints at values."""
        images = list(self.context.gens())
        for j, value in values.items():
            images[2 * j : 2 * j + 2] = value
        return self.reduced(poly.compose(*images, ctx=self.context)) if values else poly

    def lead(self, poly: Poly, joint: int) -> tuple[int, Poly]:
        """Degree in y of a joint where its x is 1, and the coefficient."""
        x, y = self.names[2 * joint : 2 * joint + 2]
        poly = poly.subs({x: 1})
        top = int(poly.degrees()[2 * joint + 1])
        terms = {m: c for m, c in poly.to_dict().items() if m[2 * joint + 1] == top}
        return top, self.context.from_dict(terms).subs({y: 1})

    def resultant(self, p: Poly, g: Poly, joint: int) -> Poly:
        """Resultant of two forms of positive degree in a joint: 0 where they share a root."""
        x, y = self.names[2 * joint : 2 * joint + 2]
        (top_p, lead_p), (top_g, lead_g) = self.lead(p, joint), self.lead(g, joint)
        fewer_p, fewer_g = self.degree(p, joint) - top_p, self.degree(g, joint) - top_g
        if fewer_p and fewer_g:
            return self.zero  # x = 0 is a root of both
        bounded(p, g, self.degree(p, joint) + self.degree(g, joint))
        found = self.reduced(p.subs({x: 1}).resultant(g.subs({x: 1}), y))
        return self.reduced(found * lead_g**fewer_p * lead_p**fewer_g)

    def no_common_zero(self, forms: list[Poly], joints: list[int], strip: bool = False) -> bool:
        """Whether forms are shown to have no common zero for almost all values of other joints.

        With ``strip``, none at a configuration; if no other joint occurs "almost all" is "all".
        """
        forms = [self.stripped(f) if strip else f for f in forms if f != 0]
        if any(not {*joints} & {*self.joints(f)} for f in forms):
            return True
        if not joints or len(forms) < 2:
            return False
        j = joints[0]
        having = sorted((f for f in forms if self.degree(f, j)), key=len)
        rest = [f for f in forms if not self.degree(f, j)]
        if len(having) > 2 and not strip:  # also a sum of all but the first, brought to one degree
            total = self.zero
            for k, f in enumerate(having[1:], 1):
                for i in joints:
                    top, (x, y) = max(self.degree(g, i) for g in having[1:]), self.pairs[i]
                    f = f * (x + (2 + i) * y) ** (top - self.degree(f, i))
                total += k * f
            having += [total] if total != 0 else []
        rest += [self.resultant(having[0], f, j) for f in having[1:]]
        return self.no_common_zero(rest, joints[1:], strip)

    def codimension_at_least(self, least: int, relations: list[Poly]) -> bool:
        """Whether that is shown of all components of the common zeros of some forms.

        A component of less has points at all values of all joints but least - 1, whichever these
        are: to see one choice of values without a point is enough, or that almost all have none.
        """
        if least <= 0 or any(p != 0 and not self.joints(p) for p in relations):
            return True
        involved = sorted({j for p in relations for j in self.joints(p)})
        for some in itertools.combinations(involved, min(least - 1, len(involved))):
            free, held = list(some), [j for j in involved if j not in some]
            choices = ({j: (self.one, (a + 3 * j) * self.one) for j in held} for a in range(2, 6))
            points = ([self.put(p, at) for p in relations] for at in choices)
            if any(self.no_common_zero(forms, free) for forms in points):
                continue
            if sum(map(len, relations)) > SHORT or not self.no_common_zero(relations, free, True):
                return False
        return True

    def vanishes(self, poly: Poly, relations: list[Poly]) -> bool:
        """Whether ``poly`` is shown to be zero wherever all relations are."""
        if poly == 0 or any(self.divides(p, poly) for p in relations):
            return True
        outside: list[Poly] = []  # zero where a way to divide, by other joints' y, tells nothing
        relations = sorted(relations, key=lambda p: len(self.joints(p)))
        own = [{*self.joints(p)} for p in relations]
        own = [js.difference(*own[:k]) for k, js in enumerate(own)]
        for ways in itertools.product(*own) if len(relations) > 1 else ():
            left, times = poly, self.one
            for p, j in reversed(list(zip(relations, ways, strict=True))):
                x, (degree, lead) = self.names[2 * j], self.lead(p, j)
                times = self.reduced(
                    times * lead * self.pairs[j][0] ** (self.degree(p, j) - degree)
                )
                p, left = p.subs({x: 1}), left.subs({x: 1})
                while left != 0 and (top := self.lead(left, j))[0] >= degree:
                    shift = self.pairs[j][1] ** (top[0] - degree)
                    bounded(left, lead)
                    bounded(p, top[1])
                    left = self.reduced(left * lead - top[1] * p * shift)
            outside += [times] if left == 0 else []
            # No component of so few relations has a larger codimension: none is in ``outside``.
            if left == 0 and self.codimension_at_least(len(ways) + 1, [*relations, *outside]):
                return True
        return False


class Certificate:
    """A certificate, read; its matrix is made here, from the placements alone."""

    def __init__(self, data: dict[str, Any]) -> None:
        need(data["schema"] == SCHEMA, f"the schema is not {SCHEMA}")
        self.slides = [{"revolute": False, "prismatic": True}[j["kind"]] for j in data["joints"]]
        self.ring, self.data = Ring(self.slides, data["square_roots"]), data
        self.rows, self.left = [whole(r) for r in data["rows"]], whole(data["rank"])
        few = sorted({*self.rows} & {*range(6)})
        need(self.rows == few != [], "rows are some of 0 to 5, in order")
        self.polys = [self.ring.parse(text) for text in data["polynomials"]]
        need(all(self.ring.joints(p) for p in self.polys), "a constant is among the polynomials")
        self.known: dict[str, Callable[[Chosen, Chosen], Poly]] = {}
        self.matrix = self.jacobian(data["chain"], data["tip"])
        for step in data["reduction"]:
            self.reduce(step)
        self.sides = len(self.matrix), len(self.matrix[0]) if self.matrix else 0
        # Eagon and Northcott: no component of where the rank drops has a larger codimension.
        self.bound = (self.sides[0] - self.left + 1) * (self.sides[1] - self.left + 1)
        self.families = [self.where(f) for f in data["families"]]
        self.places = [self.where(p) for p in data["places"]]

    def where(self, entry: dict[str, Any]) -> tuple[Values, list[Poly]]:
        """Joint values and relations, of a family or of a place."""
        values: Values = {}
        for text, (x, y) in entry["values"].items():
            j, point = whole(int(text)), (self.ring.constant(x), self.ring.constant(y))
            need(any(point) and not (self.slides[j] and point[0] == 0), "a value is none")
            values[j] = point
        relations = [self.polys[whole(k)] for k in entry["relations"]]
        for p in relations:
            need(not any(j in values for j in self.ring.joints(p)), "a joint is fixed and free")
        return values, relations

    def jacobian(self, chain: list[dict[str, Any]], tip: list[str]) -> Matrix:
        """Task Jacobian, columns times units, in a frame that leaves its rank the task's."""
        ring, steps = self.ring, [self.step(link) for link in chain]
        need(0 < len(chain) <= 16, "the chain is too long")
        middle = len(chain) // 2 if len(self.rows) == 6 else len(chain)  # else seen from the tip
        screws: dict[int, tuple[Matrix, Poly]] = {}  # matrices that take points to velocities
        for i in [*reversed(range(middle, len(chain))), *range(middle)]:
            there, back, unit = steps[i] if i >= middle else (steps[i][1], steps[i][0], steps[i][2])
            own = [[ring.zero] * 4 for _ in range(4)]
            if self.slides[chain[i]["joint"]]:
                own[2][3] = ring.one
            else:
                own[1][0], own[0][1] = ring.one, -ring.one
            carried = [k for k in screws if (k < middle) == (i < middle)]
            screws[i] = own, ring.one
            for k in [*carried, i] if i >= middle else carried:  # to the next link on the way
                X = self.times(self.times(there, screws[k][0]), back)
                X = [[divmod(x, unit)[0] for x in row] for row in X]
                screws[k] = X, screws[k][1] * unit
        if len(self.rows) < 6:  # at the tip, and in base axes where axes matter
            A, B, _ = self.with_inverse(self.placed(EYE, tip))
            if self.rows not in ([0, 1, 2], [3, 4, 5]):
                T = functools.reduce(self.times, (there for there, _, _ in steps))
                T = [[*row[:3], x] for row, x in zip(T, [*[ring.zero] * 3, T[3][3]], strict=True)]
                A, B = self.times(A, flipped(T)), self.times(T, B)
            screws = {i: (self.times(self.times(B, X), A), u) for i, (X, u) in screws.items()}
        columns = [([ring.zero] * 6, ring.one) for _ in self.slides]
        for i, (X, unit) in screws.items():
            times, (total, common) = ring.constant(chain[i]["multiple"]), columns[chain[i]["joint"]]
            screw = [X[0][3], X[1][3], X[2][3], X[2][1], X[0][2], X[1][0]]
            sums = [a * unit + times * b * common for a, b in zip(total, screw, strict=True)]
            columns[chain[i]["joint"]] = [ring.reduced(x) for x in sums], common * unit
        return self.primitive([[column[r] for r in self.rows] for column, _ in columns])

    def step(self, link: dict[str, Any]) -> Step:
        """Placement of a joint, and its motion about or along z."""
        ring, o, j, turns = self.ring, self.ring.zero, whole(link["joint"]), link["multiple"]
        (x, y), c, s, z, u = ring.pairs[j], ring.one, o, o, ring.one
        if self.slides[j]:
            z, c, u = ring.constant(turns) * y + ring.constant(link["plus"]) * x, x, x
        else:
            c, s = (ring.constant(text) for text in link["plus"])
            need(abs(int(turns)) < 7 and ring.reduced(c * c + s * s) == 1, "no angle or multiple")
            for _ in range(abs(int(turns))):
                a, b = x * x - y * y, 2 * x * y * (1 if int(turns) > 0 else -1)
                c, s, u = ring.reduced(c * a - s * b), ring.reduced(c * b + s * a), u * ring.unit[j]
        M = [[c, -s, o, o], [s, c, o, o], [o, o, u, z], [o, o, o, u]]
        return self.with_inverse(self.times(self.placed(link["rotation"], link["translation"]), M))

    def placed(self, rotation: list[list[str]], translation: list[str]) -> Matrix:
        """A constant rigid motion, if it is one."""
        R, t = [[self.ring.constant(x) for x in row] for row in rotation], translation
        need([len(row) for row in R] == [3, 3, 3] and len(t) == 3, "a placement is no 3 x 3 and 3")
        straight = [[self.ring.constant(x) for x in row] for row in EYE]
        proper = self.minors_of(R)((0, 1, 2), (0, 1, 2)) == 1
        need(proper and self.times(R, flipped(R)) == straight, "a rotation is none")
        G = [[*row, self.ring.constant(x)] for row, x in zip(R, t, strict=True)]
        return [*G, [*[self.ring.zero] * 3, self.ring.one]]

    def with_inverse(self, G: Matrix) -> Step:
        """A rigid motion times a unit, its inverse times the same, and the unit."""
        unit, R = G[3][3], flipped([row[:3] for row in G[:3]])
        t = self.times(R, [[row[3]] for row in G[:3]])
        B = [[*row, divmod(-x, unit)[0]] for row, (x,) in zip(R, t, strict=True)]
        return G, [*B, G[3]], unit

    def times(self, A: Matrix, B: Matrix) -> Matrix:
        """Product of two matrices."""
        pairs = [[zip(row, c, strict=True) for c in zip(*B, strict=True)] for row in A]
        return [
            [self.ring.reduced(sum((a * b for a, b in p), self.ring.zero)) for p in r]
            for r in pairs
        ]

    def primitive(self, lines: Matrix) -> Matrix:
        """Columns, then rows, without the units that all their entries share; rows come back."""
        for _ in range(2):
            for line in lines:
                for unit in self.ring.unit:
                    while any(line) and not any(divmod(x, unit)[1] for x in line):
                        line[:] = [divmod(x, unit)[0] for x in line]
            lines = flipped(lines)
        return flipped(lines)

    def reduce(self, step: dict[str, Any]) -> None:
        """Use up a pivot that is never zero, or drop a row or column that others make up."""
        M, ring = self.matrix, self.ring
        if "pivot" in step:
            i, j = (whole(k) for k in step["pivot"])
            p = M[i][j]
            need(p != 0 and not ring.joints(ring.stripped(p)), "a pivot may become zero")
            M = [[ring.reduced(x * p - r[j] * y) for x, y in zip(r, M[i], strict=True)] for r in M]
            columns = flipped(M[:i] + M[i + 1 :])
            self.matrix, self.left = self.primitive(columns[:j] + columns[j + 1 :]), self.left - 1
            return
        kind = "row" if "row" in step else "column"
        M = M if kind == "row" else flipped(M)
        i, terms = whole(step[kind]), step["is"]
        sums = M[i]
        for k, factor in terms.items():
            need(whole(int(k)) != i, "a line is stated by itself")
            sums = [a - b * ring.constant(factor) for a, b in zip(sums, M[int(k)], strict=True)]
        need(not any(ring.reduced(x) for x in sums), "a line is not made up by others")
        self.matrix = M[:i] + M[i + 1 :] if kind == "row" else flipped(M[:i] + M[i + 1 :])

    def minors_of(self, M: Matrix) -> Callable[[Chosen, Chosen], Poly]:
        """Determinants of chosen rows and columns, each by its first row."""

        @functools.cache
        def minor(rows: Chosen, columns: Chosen) -> Poly:
            total = self.ring.zero if rows else self.ring.one
            for k, j in enumerate(columns):
                if M[rows[0]][j] != 0:
                    rest = minor(rows[1:], columns[:k] + columns[k + 1 :])
                    bounded(M[rows[0]][j], rest)
                    total = self.ring.reduced(total + (-1) ** k * M[rows[0]][j] * rest)
            return total

        return minor

    def at(self, values: Values) -> Callable[[Chosen, Chosen], Poly]:
        """Minors of the matrix with joints at values."""
        if (key := str(sorted(values.items()))) not in self.known:
            M = [[self.ring.put(x, values) for x in row] for row in self.matrix]
            self.known[key] = self.minors_of(M)
        return self.known[key]

    def minors(self, size: int, values: Values) -> Iterator[Poly]:
        """All minors of a size, with joints at values."""
        for rows in itertools.combinations(range(self.sides[0]), size):
            for columns in itertools.combinations(range(self.sides[1]), size):
                yield self.at(values)(rows, columns)

    # What is claimed -----------------------------------------------------------------

    def check(self) -> None:
        """Every family is singular, and nothing else is; or `Rejected`."""
        need(0 <= self.left <= min(self.sides), "the rank is impossible")
        need(any(self.minors(self.left, {})), "the rank is less")
        need(not any(self.minors(self.left + 1, {})), "the rank is more")
        for f, (values, relations) in zip(self.data["families"], self.families, strict=True):
            for minor in self.minors(self.left, values):
                need(self.ring.vanishes(minor, relations), f"a family is regular somewhere: {f}")
            least = whole(f["least_codimension"]) - len(values)
            need(self.ring.codimension_at_least(least, relations), f"a family is larger: {f}")
        need(self.places[0] == ({}, []), "the first place is not everywhere")
        for number, place in enumerate(self.data["places"]):
            try:
                self.check_place(number, place)
            except Rejected as reason:
                raise Rejected(f"place {number}: {reason}") from None

    def check_place(self, number: int, place: dict[str, Any]) -> None:
        """Components of the singular set inside a place lie in families, or have no real point."""
        ring, (values, relations) = self.ring, self.places[number]
        if "family" in place:
            family = self.families[whole(place["family"])]
            need(self.lies_in(values, relations, family), "it is not in the family")
        elif "too_small" in place:
            least = self.bound + 1 - len(values)
            need(ring.codimension_at_least(least, relations), "it may be large enough")
        elif "no_real_point" in place:
            need(self.unreal(place["no_real_point"], relations), "it may have a real point")
        else:
            product = ring.one
            for k, times, _ in place["cases"]:
                for _ in range(whole(times)):
                    bounded(product, self.polys[whole(k)])
                    product = ring.reduced(product * self.polys[whole(k)])
            vanishing = ring.stripped(ring.reduced(self.vanishing(place, values, relations)))
            need(vanishing != 0, "a polynomial that is zero everywhere tells nothing")
            need(ring.same(vanishing, ring.stripped(product)), "the cases are not all factors")
            for k, _, then in place["cases"]:
                self.check_case(number, self.polys[k], then)

    def vanishing(self, place: dict[str, Any], values: Values, relations: list[Poly]) -> Poly:
        """A polynomial that is zero on every component inside a place."""
        ring = self.ring
        if "relation" in place:
            return relations[whole(place["relation"])]
        if "resultant" in place:
            a, b, j = (whole(k) for k in place["resultant"])
            return ring.resultant(relations[a], relations[b], j)
        if "sum" in place:
            return sum((ring.parse(p) * relations[whole(k)] for p, k in place["sum"]), ring.zero)
        rows, columns = (tuple(whole(k) for k in part) for part in place["minor"])
        need(len(rows) == len(columns) == self.left, "a minor is of another size")
        minor = ring.stripped(self.at(values)(rows, columns))
        if "coefficient" not in place:
            return minor
        # Components are all of a place's own: whatever the joints that occur nowhere, they go on.
        least = self.bound - len(values)
        need(ring.codimension_at_least(least, relations), "a component may be only a part")
        bound = {j for p in relations for j in ring.joints(p)}
        power = ring.parse(place["coefficient"])
        need(len(power) == 1 and not bound & {*ring.joints(power)}, "a power of a joint not free")
        held = [e for j in range(len(self.slides)) if j not in bound for e in (2 * j, 2 * j + 1)]
        wanted = [power.monomial(0)[e] for e in held]
        found = {m: c for m, c in minor.to_dict().items() if [m[e] for e in held] == wanted}
        return ring.context.from_dict(found).subs({ring.names[e]: 1 for e in held})

    def check_case(self, number: int, f: Poly, then: int | None) -> None:
        """What a place and one polynomial more make is empty, or lies in a later place."""
        ring, (values, relations) = self.ring, self.places[number]
        j, relations = ring.joints(f)[0], [*relations, f]
        if ring.joints(f) == [j] and ring.degree(f, j) == 1:  # it fixes a joint
            x = ring.put(f, {j: (ring.zero, ring.one)})
            values = {**values, j: (x, -ring.put(f, {j: (ring.one, ring.zero)}))}
            relations = [ring.stripped(ring.put(p, {j: values[j]})) for p in relations]
        if any(p != 0 and not ring.joints(p) for p in relations):
            return  # empty
        need(then is not None and whole(then) > number, "a case is left open")
        inside = self.lies_in(values, [p for p in relations if p != 0], self.places[whole(then)])
        need(inside, "a case leads to a place that it is not in")

    def lies_in(self, values: Values, relations: list[Poly], other: Where) -> bool:
        """Whether joint values and relations are shown to follow from others."""
        for j, (x, y) in other[0].items():
            if j not in values or self.ring.reduced(x * values[j][1] - y * values[j][0]) != 0:
                return False
        return all(self.ring.vanishes(self.ring.put(p, values), relations) for p in other[1])

    def unreal(self, why: dict[str, Any], relations: list[Poly]) -> bool:
        """Whether a relation is shown to be zero at no real configuration."""
        ring, p = self.ring, relations[whole(why["relation"])]
        if "squares" in why:  # a sum of squares that have no common zero
            parts = [(ring.constant(c), ring.parse(g)) for c, g in why["squares"]]
            positive = all(NUMBER.fullmatch(c) for c, _ in why["squares"])
            need(positive and all(c != 0 for c, _ in parts), "a factor is not positive")
            total = sum((c * g * g for c, g in parts), ring.zero)
            joints = sorted({j for _, g in parts for j in ring.joints(g)})
            apart = ring.no_common_zero([g for _, g in parts], joints)
            return apart and ring.same(ring.stripped(total), ring.stripped(p))
        (j,) = ring.joints(p)
        degree = ring.lead(p, j)[0]
        terms = {m[2 * j + 1]: c for m, c in p.to_dict().items()}
        need(not ring.roots and degree == ring.degree(p, j), "it is zero at x = 0")
        chain = [fmpq_poly([terms.get(k, 0) for k in range(degree + 1)])]
        chain.append(chain[0].derivative())
        while chain[-1].degree() > 0:  # Sturm's chain: changes of sign at both ends
            chain.append(-(chain[-2] % chain[-1]))
        ends = [[f[f.degree()] * way ** f.degree() > 0 for f in chain if f != 0] for way in (-1, 1)]
        changes = [sum(a != b for a, b in itertools.pairwise(signs)) for signs in ends]
        return bool(changes[0] == changes[1])


def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object, if no key is there twice."""
    need(len(dict(pairs)) == len(pairs), "a key is there twice")
    return dict(pairs)


def no_number(text: str) -> None:
    """Numbers in a certificate are whole, or text."""
    raise Rejected(f"{text[:20]} is no exact number")


def verify(text: str) -> dict[str, Any]:
    """Check a certificate and return it; `Rejected` says what is wrong with it."""
    need(len(text) <= LONGEST_FILE, f"longer than {LONGEST_FILE} characters")
    try:
        data = json.loads(
            text, object_pairs_hook=unique, parse_float=no_number, parse_constant=no_number
        )
        Certificate(data).check()
        statement(data)  # names prove nothing, but are said
    except (*MALFORMED, RecursionError) as error:
        raise Rejected(f"malformed ({type(error).__name__}: {str(error)[:80]})") from None
    return dict(data)


def statement(data: dict[str, Any]) -> str:
    """What a certificate that was accepted proves."""
    names = ", ".join(dict.fromkeys(str(f["name"]) for f in data["families"])) or "nothing"
    rows = " ".join(("vx", "vy", "vz", "wx", "wy", "wz")[r] for r in data["rows"])
    text = f"{data['robot']}, {len(data['joints'])} joints, rows {rows}: "
    text += f"the rank is below {data['rank']} exactly on {names}"
    return "".join(c for c in text[:1000] if c.isprintable())


def main(path: str) -> int:
    """Check a file, say so in one line, and return 0 if it is accepted."""
    started = time.perf_counter()
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read(LONGEST_FILE + 1)
        print(f"ACCEPTED: {statement(verify(text))}", end="")
    except (OSError, UnicodeDecodeError, Rejected) as reason:
        print(f"REJECTED: {str(reason)[:200]!r}")
        return 1
    print(f" ({len(text)} bytes, {1e3 * (time.perf_counter() - started):.0f} ms)")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]) if len(sys.argv) == 2 else f"usage: {sys.argv[0]} FILE.json")
