"""Accept or reject a certificate: that the singular configurations of an arm are those stated.

    python checker.py FILE.json

Needs Python and python-flint, nothing of pinsing; computes with polynomials over Q, exactly: no
factoring, no floats, no random numbers. docs/proof.md has the theorem, the format, and why every
step is right. A joint is a point (x : y): its angle is 2 atan(y/x), or its position y/x metres.
"""

from __future__ import annotations

import functools
import json
import re
import sys
from collections.abc import Callable, Iterator
from itertools import combinations
from typing import Any

from flint import Ordering, fmpq, fmpq_mpoly_ctx

SCHEMA = "pinsing/certificate/3"
LONGEST_FILE, MOST_WORK, LONG = 4_000_000, 300_000_000, 10_000  # characters, products of terms
NUMBER = r"(-?\d{1,400})(?:/([1-9]\d{0,399}))?"
TERM = re.compile(NUMBER + r"((?:[xys][1-9]\d?(?:\^[1-9]\d?)?)*)", re.ASCII)
POWER = re.compile(r"([xys]\d+)(?:\^(\d+))?", re.ASCII)
POSITIVE = re.compile(r"[1-9]\d{0,399}(?:/[1-9]\d{0,399})?", re.ASCII)
MALFORMED = ArithmeticError, LookupError, MemoryError, RecursionError, TypeError, ValueError
Poly = Any  # fmpq_mpoly: python-flint ships no types
Matrix = list[list[Poly]]
Where = tuple[dict[int, tuple[Poly, Poly]], list[Poly]]  # joints at points; forms that vanish
# What a file looks like: [s] is a list of s, (s, t) one of just s and t.
LINES, SUM, PLACEMENT = ([int], [int]), [(str, int)], {"rotation": [[str]], "translation": [str]}
SOUND = {"pivot": LINES, "apart": [int], "multiples": [SUM]}
SOURCES = {"of_minors": [(str, LINES, [int])], "of_resultants": [(str, int, int, int)]}
SHAPE: dict[str, Any] = {
    **dict.fromkeys(("schema", "robot", "base", "tip_frame", "task"), str),
    "joints": [{"name": str, "kind": str}],
    "square_roots": [int],
    "chain": [{**PLACEMENT, "joint": int, "multiple": str}],
    "tip": PLACEMENT,
    "rows": [int],
    "axes": int,
    "row_steps": [(int, int, str)],
    "column_steps": [(int, int, str)],
    "rank": int,
    "polynomials": [str],
    "families": [{"name": str, "forms": [int], "least_codimension": int, **SOUND}],
    "places": [
        {"forms": [int], "of_forms": SUM, **SOURCES, "cases": [([int], [str], int, str, int)]}
    ],
}


class Rejected(Exception):
    """The file does not prove what it states."""


def need(truth: bool, otherwise: str) -> None:
    """Reject unless something holds."""
    if not truth:
        raise Rejected(otherwise)


def pick(items: Any, k: int) -> Any:
    """Entry number k, counted from 0."""
    need(0 <= k < len(items), f"{str(k)[:20]} is no index")
    return items[k]


def fits(item: Any, shape: Any) -> bool:
    """Return True if what was read has the types and keys of a shape, no more and no fewer."""
    if isinstance(shape, type):
        return type(item) is shape
    if isinstance(shape, dict):
        same = type(item) is dict and item.keys() == shape.keys()
        return same and all(fits(item[key], shape[key]) for key in shape)
    shapes = shape if isinstance(shape, tuple) else shape * len(item) if type(item) is list else ()
    return type(item) is list and len(item) == len(shapes) and all(map(fits, item, shapes))


def flipped(lines: Matrix) -> Matrix:
    """Rows of a matrix from its columns, and back."""
    return [list(line) for line in zip(*lines, strict=True)]


def gcd(a: Poly, b: Poly) -> Poly:
    """Greatest common divisor."""
    return a.gcd(b)


def cross(a: list[Poly], b: list[Poly]) -> list[Poly]:
    """Cross product."""
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


class Ring:
    """Forms in x, y of every joint over K: Q, or Q with square roots of 2 and 3 adjoined."""

    def __init__(self, slides: list[bool], roots: list[int]) -> None:
        need(len(slides) <= 16, "more than 16 joints")
        need(roots in ([], [2], [3], [2, 3]), "square roots are of 2 and 3 alone")
        n, names = len(slides), [f"{v}{j}" for j in range(1, len(slides) + 1) for v in "xy"]
        self.names = [*names, *(f"s{d}" for d in roots)]
        self.context = fmpq_mpoly_ctx.get(self.names, Ordering.lex)
        self.zero, self.one, self.work = self.context.constant(0), self.context.constant(1), 0
        self.gens = gens = self.context.gens()
        self.squares = [s * s - d for s, d in zip(gens[2 * n :], roots, strict=True)]
        self.pairs = [(gens[2 * j], gens[2 * j + 1]) for j in range(n)]
        # Zero at no configuration: x of a prismatic joint, x^2 + y^2 of a revolute one.
        both = zip(slides, self.pairs, strict=True)
        self.unit = [x if slide else x * x + y * y for slide, (x, y) in both]
        self.least = [1 if slide else 2 for slide in slides]  # power of x in a multiple of the unit
        self.parse = functools.cache(self.read)

    def read(self, text: str) -> Poly:
        """Read a sum of terms, such as ``2 -1/3y1^2y3s2``: powers of x complete each of them."""
        keys: list[list[int]] = []
        numbers: list[Any] = []
        terms: dict[tuple[int, ...], Any] = {}
        for term in text.split(" "):
            if (match := TERM.fullmatch(term)) is None:
                raise Rejected(f"no form: {text[:40]!r}")
            keys.append([0] * len(self.names))
            numbers.append(fmpq(int(match[1]), int(match[2] or 1)))
            for name, power in POWER.findall(match[3]):
                keys[-1][self.names.index(name)] += int(power or 1)
        for x in range(0, 2 * len(self.pairs), 2):
            degree = max(key[x] + key[x + 1] for key in keys)
            for key in keys:
                key[x] = degree - key[x + 1]
        for key, number in zip(keys, numbers, strict=True):
            terms[tuple(key)] = terms.get(tuple(key), 0) + number
        return self.reduced(self.context.from_dict(terms))

    def number(self, text: str) -> Poly:
        """Read a number."""
        number = self.parse(text)
        need(not self.joints(number), f"{text[:20]!r} is no number")
        return number

    def reduced(self, form: Poly) -> Poly:
        """The form with s2^2 = 2 and s3^2 = 3 put in: it is 0 only for what is 0."""
        for square in self.squares:
            form = divmod(form, square)[1]
        return form

    def spend(self, work: int) -> None:
        """Count products of terms, so that no file keeps the checker for ever."""
        self.work += work
        if self.work > MOST_WORK:
            raise Rejected("it would take too long")

    def times(self, first: Poly, *factors: Poly) -> Poly:
        """Product."""
        product = self.reduced(first)
        for f in factors:
            self.spend(len(product) * len(f))
            product = self.reduced(product * f)
        return product

    def dot(self, a: list[Poly], b: list[Poly]) -> Poly:
        """Scalar product."""
        both = [(p, q) for p, q in zip(a, b, strict=True) if p != 0 and q != 0]
        return sum((self.times(p, q) for p, q in both), self.zero)

    def joints(self, form: Poly) -> list[int]:
        """Joints that occur."""
        degrees = form.degrees()
        return [j for j in range(len(self.pairs)) if degrees[2 * j] > 0 or degrees[2 * j + 1] > 0]

    def degree(self, form: Poly, joint: int) -> int:
        """Degree in x and y of a joint, of a form that is not zero."""
        return int(sum(form.monomial(0)[2 * joint : 2 * joint + 2]))

    def degrees(self, form: Poly) -> list[int]:
        """Degrees in x and y of all joints."""
        return [self.degree(form, j) for j in range(len(self.pairs))]

    def divides(self, p: Poly, form: Poly) -> bool:
        """Return True if ``form`` is shown to be a multiple of ``p``: zero wherever that is."""
        self.spend(len(form) * len(p))
        return bool(self.reduced(divmod(form, p)[1]) == 0)

    def stripped(self, *forms: Poly) -> list[Poly]:
        """Forms without the units, zero at no configuration, that all of them share."""
        first = next((f for f in forms if f != 0), None)
        if first is None:
            return list(forms)
        # The first monomial of a multiple is one times that of the unit, and so is the last one.
        top, low = first.monomial(0), first.monomial(len(first) - 1)
        for j, least in enumerate(self.least):
            x, y = top[2 * j], low[2 * j + least - 1]
            while x >= least <= y and all(self.divides(self.unit[j], f) for f in forms):
                forms = tuple(divmod(f, self.unit[j])[0] for f in forms)
                x, y = x - least, y - least
        return list(forms)

    def put(self, form: Poly, values: dict[int, Any]) -> Poly:
        """The form with some joints at points."""
        degrees = form.degrees() if values else []
        inside = [j for j in values if degrees[2 * j] > 0 or degrees[2 * j + 1] > 0]
        if not inside:
            return form
        self.spend(100 * len(values) + len(form))
        images = list(self.gens)
        for j in inside:
            images[2 * j : 2 * j + 2] = values[j]
        return self.reduced(form.compose(*images, ctx=self.context))

    def where(self, forms: list[Poly]) -> Where:
        """Return the meaning of vanishing forms: joints at points, and the forms left."""
        values: dict[int, tuple[Poly, Poly]] = {}
        forms = [f for form in forms for f in self.stripped(form) if f != 0]
        while linear := [f for f in forms if sum(f.monomial(0)[: 2 * len(self.pairs)]) == 1]:
            for form in linear:
                (j,) = self.joints(form)
                if j not in values:  # ax + by is zero at (b : -a), and its derivatives are a and b
                    values[j] = (form.derivative(2 * j + 1), -form.derivative(2 * j))
                    forms.remove(form)
            forms = [g for f in forms for g in self.stripped(self.put(f, values)) if g != 0]
        return values, forms

    def vanishes(self, form: Poly, place: Where) -> bool:
        """Return True if a form is shown to be zero at a place: a multiple of one that vanishes."""
        (image,) = self.stripped(self.put(form, place[0]))
        return image == 0 or any(self.divides(p, image) for p in place[1])

    def resultant(self, p: Poly, g: Poly, joint: int) -> Poly:
        """A form without a joint that is zero wherever two forms with it are."""
        x, y = self.names[2 * joint : 2 * joint + 2]
        size = self.degree(p, joint) + self.degree(g, joint)
        self.spend(1000 + min(work := len(p) * len(g) * size, LONG))
        if work > LONG:
            return self.zero  # which tells nothing
        tops = [f.subs({x: 0, y: 1}) for f in (p, g)]  # x = 0 counts, too
        p, g = p.subs({x: 1}), g.subs({x: 1})
        if len(p) == 1:  # c y^k, and g of degree n: c^n g(0)^k, which remainders take minutes for
            k, n = (f.degrees()[2 * joint + 1] for f in (p, g))
            found = self.reduced(p.subs({y: 1}) ** n * g.subs({y: 0}) ** k)
        else:
            found = self.reduced(p.resultant(g, y))
        return found if all(tops) else self.times(found, sum(tops, self.zero))

    def codimension_at_least(self, least: int, forms: list[Poly]) -> bool:
        """Return True if that is shown of all components of the common zeros of some forms."""
        # A component of less has points at all values of all joints but least - 1, whichever these
        # are: one choice of values without a point is enough.
        forms = [f for f in forms if f != 0]
        if least <= 0 or self.has_gaps(least, forms):
            return True
        # Zeros at a complex zero of a unit, which may fill the gaps, are none of the resultants'.
        for p, g in combinations(forms, 2):
            for j in {*self.joints(p)} & {*self.joints(g)}:
                forms = forms + self.stripped(self.resultant(p, g, j))
        return self.has_gaps(least, forms)

    def has_gaps(self, least: int, forms: list[Poly]) -> bool:
        """Return True if common zeros have no points at some values of all joints but least - 1."""
        involved = sorted({j for p in forms for j in self.joints(p)})
        return all(
            any(self.apart(forms, {*involved} - {*free}, free, a) for a in range(2, 6))
            for free in combinations(involved, min(least - 1, len(involved)))
        )

    def apart(self, forms: list[Poly], held: set[int], free: tuple[int, ...], a: int) -> bool:
        """Return True if forms are shown to have no common zero with some joints at integers."""
        values = {j: (self.one, self.one * (a + 3 * j)) for j in held}
        forms = [f for p in forms if (f := self.put(p, values)) != 0]
        for j in free if all(map(self.joints, forms)) else ():  # else a number vanishes
            having = sorted((f for f in forms if self.degree(f, j)), key=len)
            forms = [f for f in forms if not self.degree(f, j)]
            if j == free[-1] and len(having) > 3 and self.joints(functools.reduce(gcd, having)):
                return False  # they have a common zero
            for pair in combinations(having, 2):
                forms += [f for f in [self.resultant(*pair, j)] if f != 0]
                if not all(map(self.joints, forms[-1:])):
                    return True
        return not all(map(self.joints, forms))


class Certificate:
    """A certificate, read; its matrix is made here, from the placements alone."""

    def __init__(self, data: dict[str, Any]) -> None:
        kinds = [joint["kind"] for joint in data["joints"]]
        need({*kinds} <= {"revolute", "prismatic"}, "joints are revolute or prismatic")
        self.slides = [kind == "prismatic" for kind in kinds]
        self.data, self.rank = data, data["rank"]
        self.ring = Ring(self.slides, data["square_roots"])
        rows = self.without_dependent(self.jacobian(), data["row_steps"])
        columns = self.without_dependent(flipped(rows), data["column_steps"])
        self.matrix = flipped(columns)
        self.sides = len(self.matrix), len(columns)
        need(self.rank > 0, "impossible rank")
        # Eagon and Northcott: no component of where the rank drops has a larger codimension.
        self.bound = (self.sides[0] - self.rank + 1) * (self.sides[1] - self.rank + 1)
        self.polys = [self.ring.parse(text) for text in data["polynomials"]]
        self.known: dict[str, Callable[..., Poly]] = {}
        self.real: set[int] = set()  # places of which every real point counts

    def product(self, a: Matrix, b: Matrix) -> Matrix:
        """Two motions, 4 x 4 over their last entry, one after the other."""
        both = [(row, column) for row in a for column in flipped(b)]
        entries = self.ring.stripped(*(self.ring.dot(*lines) for lines in both))
        return [entries[i : i + 4] for i in (0, 4, 8, 12)]

    def placement(self, placed: dict[str, Any]) -> Matrix:
        """Motion of a rotation and a translation."""
        ring, o = self.ring, self.ring.zero
        R = [[ring.number(text) for text in row] for row in placed["rotation"]]
        t = [ring.number(text) for text in placed["translation"]]
        need([len(row) for row in [*R, t]] == [3] * 4, "a placement is none")
        dots = [[ring.dot(a, b) for a in R] for b in R]
        proper = [ring.reduced(a) for a in cross(R[0], R[1])] == R[2]
        need(proper and dots == [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "a rotation is none")
        return [*([*row, a] for row, a in zip(R, t, strict=True)), [o, o, o, ring.one]]

    def motion(self, link: dict[str, Any]) -> Matrix:
        """Motion of a link: its placement, then about or along z."""
        ring, o, motion = self.ring, self.ring.zero, self.placement(link)
        (x, y), unit = pick(ring.pairs, link["joint"]), ring.unit[link["joint"]]
        if self.slides[link["joint"]]:
            way = ring.number(link["multiple"]) * y
            return self.product(motion, [[x, o, o, o], [o, x, o, o], [o, o, x, way], [o, o, o, x]])
        need(re.fullmatch("-?[0-6]", link["multiple"]) is not None, "no multiple of turns")
        times = int(link["multiple"])
        c, s, u = x * x - y * y, 2 * x * y * (1 if times > 0 else -1), unit
        for _ in range(abs(times)):
            motion = self.product(motion, [[c, -s, o, o], [s, c, o, o], [o, o, u, o], [o, o, o, u]])
        return motion

    def frames(self, axes: int, motions: list[Matrix]) -> list[Matrix]:
        """All frames of the chain, base to tip, seen from one of them."""
        o, one = self.ring.zero, self.ring.one
        frames = {axes: [[one * (i == k) for k in range(4)] for i in range(4)]}
        for k in range(axes, len(motions)):
            frames[k + 1] = self.product(frames[k], motions[k])
        for k in reversed(range(axes)):
            a, d = motions[k], motions[k][3][3]
            columns = [[row[i] for row in a[:3]] for i in range(4)]  # of the rotation; translation
            back = [
                [d * c for c in columns[i]] + [-self.ring.dot(columns[i], columns[3])]
                for i in range(3)
            ]
            frames[k] = self.product(frames[k + 1], [*back, [o, o, o, d * d]])
        return [frames[k] for k in range(len(motions) + 1)]

    def jacobian(self) -> Matrix:
        """Task Jacobian, columns times units, in a frame that leaves its rank the task's."""
        ring, data, rows = self.ring, self.data, self.data["rows"]
        need(len(data["chain"]) <= 16, "more than 16 links")
        need([*rows] == sorted({pick(range(6), r) for r in rows}), "rows are not in order")
        motions = [*map(self.motion, data["chain"]), self.placement(data["tip"])]
        invariant = rows in ([*range(6)], [0, 1, 2], [3, 4, 5])
        axes = pick(range(len(motions) + 1), data["axes"])
        need(invariant or axes in (0, len(motions)), "axes that change the task")
        frames = self.frames(axes, motions)
        point = frames[axes] if len(rows) == 6 else frames[-1]
        columns = [[ring.zero] * 6 + [ring.one] for _ in self.slides]  # over their last entry
        for link, frame in zip(data["chain"], frames[1:], strict=False):
            z, d, D = [row[2] for row in frame[:3]], frame[3][3], point[3][3]
            arm = [a[3] * d - b[3] * D for a, b in zip(point[:3], frame[:3], strict=True)]
            turns = [*cross(z, arm), *(d * D * a for a in z), d * d * D]
            screw = [*z, *[ring.zero] * 3, d] if self.slides[link["joint"]] else turns
            multiple, total = ring.number(link["multiple"]), columns[link["joint"]]
            both = zip(screw[:6], total[:6], strict=True)
            sums = [multiple * a * total[6] + b * screw[6] for a, b in both]
            sums = [ring.reduced(a) for a in (*sums, screw[6] * total[6])]
            columns[link["joint"]] = ring.stripped(*sums)
        columns = [ring.stripped(*(column[r] for r in rows)) for column in columns]
        return [ring.stripped(*row) for row in flipped(columns)]

    def without_dependent(self, lines: Matrix, steps: list[Any]) -> Matrix:
        """Rows or columns, after multiples of one are taken from another, that are not zero."""
        lines = [*lines]
        for i, k, factor in steps:
            need(i != k, "a line is taken from itself")
            c, both = self.ring.number(factor), [*zip(pick(lines, i), pick(lines, k), strict=True)]
            degrees = [[self.ring.degrees(a) for a in ab] for ab in both if ab[0] != 0 != ab[1]]
            need(any(a == b for a, b in degrees), "a step mixes lines of different degrees")
            lines[i] = [self.ring.reduced(a - c * b) for a, b in both]
        return [line for line in lines if any(line)]

    def at(self, values: dict[int, Any]) -> Callable[..., Poly]:
        """Determinants of chosen rows and columns, in order, with joints at points."""
        if (key := str(sorted(values.items()))) not in self.known:
            M = [[self.ring.put(a, values) for a in row] for row in self.matrix]
            size = [sum(map(len, row)) for row in M]

            @functools.cache
            def minor(rows: tuple[int, ...], columns: tuple[int, ...]) -> Poly:
                if not rows:
                    return self.ring.one
                i = rows.index(min(rows, key=size.__getitem__))
                total = self.ring.zero
                for k, j in enumerate(columns):
                    if (entry := M[rows[i]][j]) != 0:
                        rest = minor(rows[:i] + rows[i + 1 :], columns[:k] + columns[k + 1 :])
                        total += self.ring.times(entry, rest) * (-1) ** (i + k)
                return total

            self.known[key] = minor
        return self.known[key]

    def lines(self, chosen: list[list[int]]) -> tuple[tuple[int, ...], ...]:
        """Rows and columns of a minor."""
        for part, count in zip(chosen, self.sides, strict=True):
            need(sorted({pick(range(count), k) for k in part}) == part, "lines are not in order")
        need(len(chosen[0]) == len(chosen[1]), "a minor is none")
        return tuple(map(tuple, chosen))

    def minors(self, size: int, values: dict[int, Any], within: Any = ((), ())) -> Iterator[Poly]:
        """All minors of a size that have some lines, with joints at points."""
        minor = self.at(values)
        for rows in combinations(range(self.sides[0]), size):
            for columns in combinations(range(self.sides[1]), size):
                if {*within[0]} <= {*rows} and {*within[1]} <= {*columns}:
                    yield minor(rows, columns)

    def forms(self, entry: dict[str, Any]) -> list[Poly]:
        """Forms of a family or a place."""
        return [pick(self.polys, k) for k in entry["forms"]]

    def sum(self, terms: list[Any], forms: list[Poly]) -> Poly:
        """A sum of multiples of forms."""
        products = (self.ring.times(self.ring.parse(c), pick(forms, k)) for c, k in terms)
        return sum(products, self.ring.zero)

    def check(self) -> None:
        """Every family is singular, and nothing else is; or `Rejected`."""
        need(any(self.minors(self.rank, {})), "the rank is less")
        need(not any(self.minors(self.rank + 1, {})), "the rank is more")
        for family in self.data["families"]:
            self.check_family(f"family {family['name'][:20]}", family)
        need(pick(self.data["places"], 0)["forms"] == [], "the first place is not everywhere")
        for number, place in enumerate(self.data["places"]):
            try:
                self.check_place(number, place)
            except Rejected as reason:
                raise Rejected(f"place {number}: {reason}") from None

    def check_family(self, name: str, family: dict[str, Any]) -> None:
        """A family is singular, and not larger than stated."""
        ring, forms, lines = self.ring, self.forms(family), self.lines(family["pivot"])
        values, left = ring.where(forms)
        sums = [ring.put(self.sum(terms, forms), values) for terms in family["multiples"]]
        place = values, left + [p for total in sums for p in ring.stripped(total) if p != 0]
        apart = [pick(self.polys, k) for k in family["apart"]]
        for minor in self.minors(self.rank, values, lines):
            shown = ring.vanishes(ring.times(minor, *apart), place)
            need(shown, f"{name} is not shown to be singular")
        # No component of so few forms has a larger codimension: none is where one of these is zero.
        need(len(lines[0]) < self.rank, f"{name}: a pivot is too large")
        for form in (self.at(values)(*lines), *apart):
            more = left + ring.stripped(ring.put(form, values))
            smaller = ring.codimension_at_least(len(left) + 1, more)
            need(smaller, f"{name} has a component where a pivot is zero")
        least = family["least_codimension"] - len(values)
        need(ring.codimension_at_least(least, left), f"{name} may be larger")

    def check_place(self, number: int, place: dict[str, Any]) -> None:
        """Check that components of the singular set in a place have their real points in families.

        At a real place that is shown of all real singular points: components may lie there in part.
        """
        ring, forms = self.ring, self.forms(place)
        total, found = self.sum(place["of_forms"], forms), ring.one
        for c, i, k, j in place["of_resultants"]:
            p, g = pick(forms, i), pick(forms, k)
            need(j in ring.joints(p) and j in ring.joints(g), "a resultant is none")
            total += ring.times(ring.parse(c), ring.resultant(p, g, j))
        for c, lines, free in place["of_minors"]:
            total += ring.times(ring.parse(c), self.minor(number, forms, self.lines(lines), free))
        for zeros, weights, times, to, k in place["cases"]:
            parts = [pick(self.polys, zero) for zero in zeros]
            need(all(POSITIVE.fullmatch(w) for w in weights), "a weight is not positive")
            need(len(parts) == (len(weights) or 1), "a case is neither a form nor a sum of squares")
            products = map(ring.times, map(ring.number, weights), parts, parts)
            factor = sum(products, ring.zero) if weights else parts[0]
            found = ring.times(found, *[factor] * pick(range(100), times))
            self.check_case(number, [*forms, *parts], number in self.real or weights != [], to, k)
        need(ring.stripped(total) == ring.stripped(found), "the sum is something else")

    def minor(self, number: int, forms: list[Poly], lines: Any, free: list[int]) -> Poly:
        """A minor at a place; free joints put at points, where components go all round them."""
        ring, (values, left) = self.ring, self.ring.where(forms)
        need(len(lines[0]) == self.rank, "a minor has another size")
        if free:
            at, rest = ring.where([pick(self.polys, k) for k in free])
            bound = {*values, *(j for p in left for j in ring.joints(p))}
            need(not rest and not bound & {*at} and number not in self.real, "a joint is not free")
            whole = ring.codimension_at_least(self.bound - len(values), left)
            need(whole, "a component may be only a part")
            values = {**values, **at}
        return self.at(values)(*lines)

    def check_case(self, number: int, forms: list[Poly], real: bool, to: str, k: int) -> None:
        """A case is in a family or a later place, or too small for a component or a point."""
        values, left = self.ring.where(forms)
        if to == "nowhere":
            least = (len(self.slides) if real else self.bound) + 1 - len(values)
            return need(self.ring.codimension_at_least(least, left), "a case is not too small")
        need(to in ("family", "place"), "a case leads nowhere")
        need(to == "family" or k > number, "a case leads back")
        target = pick(self.data["families" if to == "family" else "places"], k)
        if to == "place" and real:
            self.real.add(k)
        inside = all(self.ring.vanishes(f, (values, left)) for f in self.forms(target))
        need(inside, "a case is not where it leads to")


def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object, if no key is there twice."""
    need(len(dict(pairs)) == len(pairs), "a key is there twice")
    return dict(pairs)


def verify(text: str, most_work: int = MOST_WORK) -> dict[str, Any]:
    """Check a certificate within so much work, and return it; `Rejected` says what is wrong."""
    short = isinstance(text, str | bytes) and len(text) <= LONGEST_FILE
    need(short, f"no text of at most {LONGEST_FILE} characters")
    try:
        data = json.loads(text, object_pairs_hook=unique)
        need(type(data) is dict, "no JSON object")
        need(data.get("schema") == SCHEMA, f"the schema is not {SCHEMA}; make the certificate anew")
        wrong = [key for key in {**SHAPE, **data} if not fits(data.get(key), SHAPE.get(key))]
        need(not wrong, f"not the types of the format: {', '.join(wrong)[:80]}")
        certificate = Certificate(data)
        certificate.ring.work += MOST_WORK - most_work
        certificate.check()
        return dict(data)
    except MALFORMED as error:
        raise Rejected(f"malformed ({type(error).__name__}: {str(error)[:80]})") from None


def statement(data: dict[str, Any]) -> str:
    """Return what a certificate that was accepted proves."""
    names = ", ".join(dict.fromkeys(str(f["name"]) for f in data["families"])) or "nothing"
    rows = " ".join(("vx", "vy", "vz", "wx", "wy", "wz")[r] for r in data["rows"])
    rows += " in the tip's axes" if data["axes"] > len(data["chain"]) else ""
    text = f"{data['robot']}, {len(data['joints'])} joints, rows {rows}: "
    text += f"the rank is below {data['rank']} exactly on {names}"
    return "".join(c for c in text[:1000] if c.isprintable())


def main(path: str) -> int:
    """Check a file, say so in one line, and return 0 if it is accepted."""
    try:
        with open(path, encoding="utf-8") as file:
            print(f"ACCEPTED: {statement(verify(file.read(LONGEST_FILE + 1)))}")
    except (OSError, UnicodeDecodeError, Rejected) as reason:
        print(f"REJECTED: {str(reason)[:200]!r}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]) if len(sys.argv) == 2 else f"usage: {sys.argv[0]} FILE.json")
