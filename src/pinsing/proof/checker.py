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
from collections.abc import Callable, Iterator
from typing import Any

from flint import Ordering, fmpq, fmpq_mpoly_ctx

SCHEMA = "pinsing/certificate/2"
LONGEST_FILE, MOST_WORK, LONG = 4_000_000, 100_000_000, 10_000  # characters, products of terms
NUMBER, POWER = r"-?\d{1,400}(?:/[1-9]\d{0,399})?", r"([xys][1-9]\d?)(?:\^([1-9]\d?))?"
POSITIVE = re.compile(r"0*[1-9]\d{0,399}(?:/[1-9]\d{0,399})?", re.ASCII)
FORM = re.compile(rf"{NUMBER}(?:{POWER})*(?: {NUMBER}(?:{POWER})*)*", re.ASCII)
Poly = Any  # fmpq_mpoly: python-flint ships no types
Matrix = list[list[Poly]]
Move = tuple[Matrix, list[Poly], Poly]  # takes a screw (v, w) to (R v + t x w, R w), times a unit
Where = tuple[dict[int, tuple[Poly, Poly]], list[Poly]]  # joints at points; forms that vanish


class OneOf(tuple[Any, ...]):
    """Shapes, of which one fits."""


# What a file looks like: [s] is a list of s, (s, t) one of just s and t; `fits` says it.
FORMS, LATER = [int], OneOf((int, type(None)))
MINOR = {"minor": ([int], [int])}
SOURCE = OneOf((int, MINOR, {**MINOR, "at": FORMS}, {"resultant": (int, int, int)}))
SUM, NUMBERS = [(str, SOURCE)], (str, str, str)
CLOSED: list[dict[str, Any]] = [
    {"family": int},
    {"too_small": True},
    {"sum": SUM, "cases": [(int, int, LATER)]},
    {"sum": SUM, "squares": [(str, int)], "then": LATER},
]
PLACE = OneOf({"forms": FORMS, **c, **p} for c in CLOSED for p in ({}, {"points": True}))
LINK = {"rotation": (NUMBERS,) * 3, "translation": NUMBERS, "joint": int, "multiple": str}
FAMILY = {"name": str, "forms": FORMS, "sums": [[(str, int)]], "least_codimension": int}
SHAPE: dict[Any, Any] = {
    **dict.fromkeys(("schema", "robot", "base", "tip_frame", "task"), str),
    "joints": [{"name": str, "kind": OneOf(("revolute", "prismatic"))}],
    "square_roots": [int],
    "chain": [{**LINK, "plus": OneOf((str, (str, str)))}],
    "tip": OneOf((NUMBERS, {"translation": NUMBERS, "rotation": (NUMBERS,) * 3})),
    "rows": [int],
    **dict.fromkeys(("axes", "rank"), int),
    "dependent_rows": {str: {str: str}},
    "dependent_columns": {str: {str: str}},
    "polynomials": [str],
    "families": [FAMILY],
    "places": [PLACE],
}


class Rejected(Exception):
    """The file does not prove what it states."""


def fits(item: Any, shape: Any) -> bool:
    """Whether what was read has the types and keys of a shape, no more and no fewer."""
    if isinstance(shape, OneOf):
        return any(fits(item, one) for one in shape)
    if isinstance(shape, tuple):
        return type(item) is list and len(item) == len(shape) and all(map(fits, item, shape))
    if isinstance(shape, list):
        return type(item) is list and all(fits(part, shape[0]) for part in item)
    if isinstance(shape, dict):
        keys = dict.fromkeys(item, shape[str]) if str in shape and type(item) is dict else shape
        same = type(item) is dict and item.keys() == keys.keys()
        return same and all(fits(item[k], keys[k]) for k in keys)
    if isinstance(shape, type):
        return type(item) is shape
    return type(item) is type(shape) and bool(item == shape)


def need(truth: bool, otherwise: str) -> None:
    """Reject unless something holds."""
    if not truth:
        raise Rejected(otherwise)


def pick(items: Any, k: Any) -> Any:
    """Entry number k, counted from 0."""
    need(type(k) is int and 0 <= k < len(items), f"{str(k)[:20]!r} is no index")
    return items[k]


def flipped(lines: Matrix) -> Matrix:
    """Rows of a matrix from its columns, and back."""
    return [list(line) for line in zip(*lines, strict=True)]


def cross(a: list[Poly], b: list[Poly]) -> list[Poly]:
    """Cross product."""
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


class Ring:
    """Forms in x, y of every joint, over Q or with square roots of 2 and 3 adjoined."""

    def __init__(self, slides: list[bool], roots: list[int]) -> None:
        need(0 < len(slides) <= 16, "the chain has no joint, or more than 16")
        need(roots in ([], [2], [3], [2, 3]), "square roots are of 2 and 3 alone")
        names = [f"{v}{j}" for j in range(1, len(slides) + 1) for v in "xy"]
        self.context = fmpq_mpoly_ctx.get([*names, *(f"s{d}" for d in roots)], Ordering.lex)
        self.names, gens = list(self.context.names()), self.context.gens()
        self.zero, self.one, self.work = self.context.constant(0), self.context.constant(1), 0
        self.read: dict[str, Poly] = {}
        self.resultants: dict[Any, Poly] = {}  # the same ones are asked for again and again
        self.squares = [s * s - d for s, d in zip(gens[len(names) :], roots, strict=True)]
        self.pairs = [(gens[2 * j], gens[2 * j + 1]) for j in range(len(slides))]
        # Zero at no configuration: x of a prismatic joint, x^2 + y^2 of a revolute one.
        both = zip(slides, self.pairs, strict=True)
        self.unit = [x if slide else x * x + y * y for slide, (x, y) in both]

    def parse(self, text: str) -> Poly:
        """Read a sum of terms, such as ``2x1^2y3 -1/3x1y1y3s2``; the same text is read once."""
        if text not in self.read:
            self.read[text] = self.parsed(text)
        return self.read[text]

    def parsed(self, text: str) -> Poly:
        """The same, of a text that was not read before."""
        need(FORM.fullmatch(text) is not None, f"no form: {text[:40]!r}")
        terms: dict[tuple[int, ...], Any] = {}
        for term in text.split(" "):
            number, key = re.split("[xys]", term)[0], [0] * len(self.names)
            for name, exponent in re.findall(POWER, term):
                key[self.names.index(name)] += int(exponent or 1)
            terms[tuple(key)] = terms.get(tuple(key), 0) + fmpq(*map(int, number.split("/")))
        form = self.reduced(self.context.from_dict(terms))
        for j in range(len(self.pairs)):
            degrees = {m[2 * j] + m[2 * j + 1] for m in form.monoms()}
            need(len(degrees) < 2, f"terms differ in their degree in joint {j + 1}: {text[:40]!r}")
        return form

    def number(self, text: str) -> Poly:
        """Read a number."""
        number = self.parse(text)
        need(not self.joints(number), f"{text[:20]!r} is no number")
        return number

    def vector(self, texts: list[str]) -> list[Poly]:
        """Read numbers."""
        return [self.number(text) for text in texts]

    def reduced(self, form: Poly) -> Poly:
        """The form with s2^2 = 2 and s3^2 = 3 put in: it is 0 only for what is 0."""
        for square in self.squares:
            form = divmod(form, square)[1]
        return form

    def spend(self, work: int) -> None:
        """Count products of terms, so that no file keeps the checker for ever."""
        self.work += work
        need(self.work <= MOST_WORK, "it would take too long")

    def times(self, *factors: Poly) -> Poly:
        """Product."""
        product = self.one
        for f in factors:
            self.spend(len(product) * len(f))
            product = self.reduced(product * f)
        return product

    def joints(self, form: Poly) -> list[int]:
        """Joints that occur."""
        degrees = form.degrees()
        return [j for j in range(len(self.pairs)) if max(degrees[2 * j : 2 * j + 2]) > 0]

    def degree(self, form: Poly, joint: int) -> int:
        """Degree in x and y of a joint, of a form that is not zero."""
        return int(sum(form.monomial(0)[2 * joint : 2 * joint + 2]))

    def divides(self, p: Poly, form: Poly) -> bool:
        """Whether ``form`` is shown to be zero wherever ``p`` is."""
        self.spend(len(form) * len(p))
        return bool(self.reduced(divmod(form, p)[1]) == 0)

    def stripped(self, *forms: Poly) -> list[Poly]:
        """Forms without the units, zero at no configuration, that all of them share."""
        for unit in self.unit:
            while any(forms) and all(self.divides(unit, f) for f in forms):
                forms = tuple(divmod(f, unit)[0] for f in forms)
        return list(forms)

    def same(self, a: Poly, b: Poly) -> bool:
        """Whether two forms are the same but for a constant."""
        n = 2 * len(self.pairs)
        first = a.monomial(0)[:n]
        p, q = (  # the numbers that both have before one monomial
            {(*[0] * n, *m[n:]): c for m, c in form.to_dict().items() if m[:n] == first}
            for form in (a, b)
        )
        p, q = self.context.from_dict(p), self.context.from_dict(q)
        return bool(q != 0 and self.times(a, q) == self.times(b, p))

    def put(self, form: Poly, values: dict[int, Any]) -> Poly:
        """The form with some joints at points."""
        if not (inside := {*self.joints(form)} & {*values}):
            return form
        self.spend(100 * len(values) + len(form))
        images = list(self.context.gens())
        for j in inside:
            images[2 * j : 2 * j + 2] = values[j]
        return self.reduced(form.compose(*images, ctx=self.context))

    def where(self, forms: list[Poly]) -> Where:
        """What it means that forms vanish: joints at points, and what is left of the forms."""
        values: dict[int, tuple[Poly, Poly]] = {}
        forms = [f for form in forms for f in self.stripped(form) if f != 0]
        while linear := [f for f in forms if sum(f.monomial(0)[: 2 * len(self.pairs)]) == 1]:
            (j,) = self.joints(linear[0])
            a, b = (self.put(linear[0], {j: (self.one * k, self.one * (1 - k))}) for k in (1, 0))
            values[j] = (b, -a)
            forms = [g for f in forms for g in self.stripped(self.put(f, values)) if g != 0]
        return values, forms

    def empty(self, forms: list[Poly]) -> bool:
        """Whether a number other than zero is among forms that vanish."""
        return any(f != 0 and not self.joints(f) for f in forms)

    def top(self, form: Poly, joint: int) -> Poly:
        """What the highest power of y of a joint, without its x, is multiplied by."""
        x, y = self.names[2 * joint : 2 * joint + 2]
        return form.subs({x: 0, y: 1})

    def resultant(self, p: Poly, g: Poly, joint: int) -> Poly:
        """A form without a joint that is zero wherever two forms with it are."""
        x, y = self.names[2 * joint : 2 * joint + 2]
        size = self.degree(p, joint) + self.degree(g, joint)
        if len(p) * len(g) * size > LONG:
            return self.zero  # which tells nothing
        self.spend(len(p) * len(g) * size)
        if (key := (str(p), str(g), joint)) not in self.resultants:
            found = self.reduced(p.subs({x: 1}).resultant(g.subs({x: 1}), y))
            tops = self.top(p, joint), self.top(g, joint)  # x = 0 counts, too
            self.resultants[key] = found if all(tops) else self.times(found, sum(tops, self.zero))
        return self.resultants[key]

    def apart(self, forms: list[Poly], joints: tuple[int, ...]) -> bool:
        """Whether forms in a few joints are shown to have no common zero."""
        if self.empty(forms):
            return True
        forms = [f for f in forms if f != 0]
        if not joints or len(forms) < 2:
            return False
        having = sorted((f for f in forms if self.degree(f, joints[0])), key=len)
        rest = [f for f in forms if not self.degree(f, joints[0])]
        rest += [self.resultant(*pair, joints[0]) for pair in itertools.combinations(having, 2)]
        return self.apart(rest, joints[1:])

    def codimension_at_least(self, least: int, forms: list[Poly]) -> bool:
        """Whether that is shown of all components of the common zeros of some forms.

        A component of less has points at all values of all joints but least - 1, whichever these
        are: to see one choice of values without a point is enough.
        """
        if least <= 0 or self.empty(forms):
            return True
        # Zeros at a complex zero of a unit, which may fill the gaps, are none of the resultants'.
        plain = self.has_gaps(least, forms)
        return plain or self.has_gaps(least, [*forms, *self.eliminated(forms)])

    def eliminated(self, forms: list[Poly]) -> Iterator[Poly]:
        """Resultants of each two forms, in each joint of both, without units."""
        for p, g in itertools.combinations([f for f in forms if f != 0], 2):
            for j in {*self.joints(p)} & {*self.joints(g)}:
                yield from self.stripped(self.resultant(p, g, j))

    def has_gaps(self, least: int, forms: list[Poly]) -> bool:
        """Whether common zeros have no points at some values of all joints but least - 1."""
        involved = sorted({j for p in forms for j in self.joints(p)})
        for free in itertools.combinations(involved, min(least - 1, len(involved))):
            held = [
                {j: (self.one, self.one * (a + 3 * j)) for j in involved if j not in free}
                for a in range(2, 6)
            ]
            if not any(self.apart([self.put(p, at) for p in forms], free) for at in held):
                return False
        return True

    def vanishes(self, form: Poly, forms: list[Poly]) -> bool:
        """Whether ``form`` is shown to be zero wherever all of ``forms`` are."""
        if form == 0 or self.empty(forms) or any(self.divides(p, form) for p in forms):
            return True
        forms = sorted(forms, key=lambda p: len(self.joints(p)))
        seen = [{*self.joints(p)} for p in forms]
        own = [joints.difference(*seen[:k]) for k, joints in enumerate(seen)]
        outside: list[Poly] = []  # zero where dividing, for some choice of joints, tells nothing
        for ways in itertools.product(*own) if len(forms) > 1 else ():
            left, tops = form, self.one
            for p, j in reversed(list(zip(forms, ways, strict=True))):
                top, degree = self.top(p, j), self.degree(p, j)
                tops = self.times(tops, top)
                while tops != 0 and left != 0 and (more := self.degree(left, j) - degree) >= 0:
                    less = self.times(self.top(left, j), p, self.pairs[j][1] ** more)
                    left = divmod(self.times(left, top) - less, self.pairs[j][0])[0]
            outside += [tops] if left == 0 else []
            # No component of so few forms has a larger codimension: none is in ``outside``.
            if left == 0 and self.codimension_at_least(len(forms) + 1, [*forms, *outside]):
                return True
        return False


class Certificate:
    """A certificate, read; its matrix is made here, from the placements alone."""

    def __init__(self, data: dict[str, Any]) -> None:
        need(data["schema"] == SCHEMA, f"the schema is not {SCHEMA}")
        self.slides = [joint["kind"] == "prismatic" for joint in data["joints"]]
        self.data, self.ring = data, Ring(self.slides, data["square_roots"])
        self.rows, self.rank = data["rows"], data["rank"]
        need(
            sorted({pick(range(6), r) for r in self.rows}) == self.rows != [],
            "rows are not in order",
        )
        matrix = self.independent(self.jacobian(), data["dependent_rows"])
        self.matrix = flipped(self.independent(flipped(matrix), data["dependent_columns"]))
        self.sides = len(self.matrix), len(self.matrix[0])
        need(type(self.rank) is int and 0 < self.rank <= min(self.sides), "impossible rank")
        # Eagon and Northcott: no component of where the rank drops has a larger codimension.
        self.bound = (self.sides[0] - self.rank + 1) * (self.sides[1] - self.rank + 1)
        self.polys = [self.ring.parse(text) for text in data["polynomials"]]
        self.known: dict[str, Callable[..., Poly]] = {}

    def moves(self) -> tuple[list[Move], list[int]]:
        """Motions from the base to the tip, and how many of them lead to each link's frame."""
        ring, eye = self.ring, [[self.ring.one * (i == j) for j in range(3)] for i in range(3)]
        o, one, moves, ends = ring.zero, ring.one, list[Move](), list[int]()
        for link in self.data["chain"]:
            moves += [
                (eye, ring.vector(link["translation"]), one),
                (self.turn(link), [o] * 3, one),
            ]
            (x, y), unit = pick(ring.pairs, link["joint"]), pick(ring.unit, link["joint"])
            plus_fits = (type(link["plus"]) is str) == self.slides[link["joint"]]
            need(plus_fits, "a constant is not of the joint's kind")
            if self.slides[link["joint"]]:
                way = ring.number(link["multiple"]) * y + ring.number(link["plus"]) * x
                moves.append(([[x * a for a in row] for row in eye], [o, o, way], unit))
            else:
                c, s = ring.vector(link["plus"])
                need(ring.reduced(c * c + s * s) == 1, "no angle")
                need(re.fullmatch("-?[0-6]", link["multiple"]) is not None, "no multiple of turns")
                times = int(link["multiple"])
                moves.append(([[c, -s, o], [s, c, o], [o, o, one]], [o] * 3, one))
                c, s = x * x - y * y, 2 * x * y * (1 if times > 0 else -1)
                moves += [([[c, -s, o], [s, c, o], [o, o, unit]], [o] * 3, unit)] * abs(times)
            ends.append(len(moves))
        tip = self.data["tip"]
        if type(tip) is list:
            return [*moves, (eye, ring.vector(tip), one)], ends
        # Rows in the axes of the tip, which is one frame more.
        moves += [(eye, ring.vector(tip["translation"]), one), (self.turn(tip), [o] * 3, one)]
        return moves, [*ends, len(moves)]

    def turn(self, link: dict[str, Any]) -> Matrix:
        """Rotation of a link, or of the tip."""
        ring = self.ring
        R = [ring.vector(row) for row in link["rotation"]]
        products = [
            ring.reduced(sum(a * b for a, b in zip(R[i], R[j], strict=True)))
            for i, j in ((0, 0), (0, 1), (1, 1))
        ]
        proper = [ring.reduced(a) for a in cross(R[0], R[1])] == R[2]
        need(products == [1, 0, 1] and proper, "a rotation is none")
        return R

    def carried(self, screw: list[Poly], move: Move, back: bool, turn: bool) -> list[Poly]:
        """A screw, and its common denominator, seen from before a move, or after it."""
        R, t, unit = move
        R, t = (flipped(R), [-a for a in t]) if back else (R, t)
        v, w = (
            [sum((a * b for a, b in zip(row, part, strict=True)), self.ring.zero) for row in R]
            for part in (screw[:3], screw[3:6])
        )
        v = v if turn else [a + b for a, b in zip(v, cross(t, screw[3:6]), strict=True)]
        return self.ring.stripped(*(self.ring.reduced(a) for a in [*v, *w, unit * screw[6]]))

    def jacobian(self) -> Matrix:
        """Task Jacobian, columns times units, in a frame that leaves its rank the task's."""
        ring, (moves, ends), axes = self.ring, self.moves(), self.data["axes"]
        invariant = self.rows in ([*range(6)], [0, 1, 2], [3, 4, 5])
        at = 0 if type(self.data["tip"]) is list else len(ends)
        need(invariant or axes == at, "axes that change the task")
        need(len(self.data["chain"]) <= 16, "more than 16 links")
        frame, columns = pick([0, *ends], axes), [[ring.zero] * 6 + [ring.one] for _ in self.slides]
        for link, at in zip(self.data["chain"], ends, strict=False):
            screw = [ring.zero] * 6 + [ring.one]
            screw[2 if self.slides[link["joint"]] else 5] = ring.number(link["multiple"])
            for k in range(at, frame if len(self.rows) == 6 else len(moves)):
                screw = self.carried(screw, moves[k], back=True, turn=False)
            for k in reversed(range(frame, at if len(self.rows) == 6 else len(moves))):
                screw = self.carried(screw, moves[k], back=False, turn=len(self.rows) < 6)
            total = columns[link["joint"]]
            sums = [
                ring.reduced(a * screw[6] + b * total[6]) for a, b in zip(total, screw, strict=True)
            ]
            columns[link["joint"]] = ring.stripped(*sums[:6], ring.times(total[6], screw[6]))
        columns = [ring.stripped(*(column[r] for r in self.rows)) for column in columns]
        return [ring.stripped(*row) for row in flipped(columns)]

    def independent(self, lines: Matrix, gone: dict[str, dict[str, str]]) -> Matrix:
        """Rows or columns without those that are sums of multiples of the others that stay."""
        number = {str(k): k for k in range(len(lines))}
        for k, terms in gone.items():
            sums = lines[number[k]]
            for i, factor in terms.items():
                need(i not in gone, "a line is stated by one that goes")
                c = self.ring.number(factor)
                sums = [a - c * b for a, b in zip(sums, lines[number[i]], strict=True)]
            need(not any(map(self.ring.reduced, sums)), "a line is not made up by others")
        return [lines[i] for k, i in number.items() if k not in gone]

    def at(self, values: dict[int, Any]) -> Callable[..., Poly]:
        """Determinants of chosen rows and columns, in order, with joints at points."""
        if (key := str(sorted(values.items()))) not in self.known:
            M = [[self.ring.put(a, values) for a in row] for row in self.matrix]

            @functools.cache
            def minor(rows: tuple[int, ...], columns: tuple[int, ...]) -> Poly:
                if not rows:
                    return self.ring.one
                i = min(range(len(rows)), key=lambda i: sum(len(M[rows[i]][j]) for j in columns))
                total = self.ring.zero
                for k, j in enumerate(columns):
                    if (entry := M[rows[i]][j]) != 0:
                        rest = minor(rows[:i] + rows[i + 1 :], columns[:k] + columns[k + 1 :])
                        total += self.ring.times(entry, rest) * (-1) ** (i + k)
                return total

            self.known[key] = minor
        return self.known[key]

    def minors(self, size: int, values: dict[int, Any]) -> Iterator[Poly]:
        """All minors of a size, with joints at points."""
        for rows in itertools.combinations(range(self.sides[0]), size):
            for columns in itertools.combinations(range(self.sides[1]), size):
                yield self.at(values)(rows, columns)

    def check(self) -> None:
        """Every family is singular, and nothing else is; or `Rejected`."""
        need(any(self.minors(self.rank, {})), "the rank is less")
        need(not any(self.minors(self.rank + 1, {})), "the rank is more")
        for f in self.data["families"]:
            self.check_family(f)
        need(self.data["places"][0]["forms"] == [], "the first place is not everywhere")
        for number, place in enumerate(self.data["places"]):
            try:
                self.check_place(number, place)
            except Rejected as reason:
                raise Rejected(f"place {number}: {reason}") from None

    def check_family(self, f: dict[str, Any]) -> None:
        """A family is singular, and not larger than stated."""
        ring, forms = self.ring, self.forms(f)
        values, left = ring.where(forms)
        sums = [self.sum(terms, forms) for terms in f["sums"]]
        sums = [p for total in sums for p in ring.stripped(ring.put(total, values)) if p != 0]
        for minor in itertools.chain(*map(ring.stripped, self.minors(self.rank, values))):
            shown = any(ring.divides(p, minor) for p in sums) or ring.vanishes(minor, left)
            need(shown, f"family {f['name'][:20]} is not shown to be singular")
        least = f["least_codimension"] - len(values)
        need(ring.codimension_at_least(least, left), f"family {f['name'][:20]} may be larger")

    def forms(self, entry: dict[str, Any]) -> list[Poly]:
        """Forms of a family or a place."""
        return [pick(self.polys, k) for k in entry["forms"]]

    def sum(self, terms: list[Any], forms: list[Poly]) -> Poly:
        """A sum of multiples of forms."""
        products = (self.ring.times(self.ring.parse(c), pick(forms, k)) for c, k in terms)
        return sum(products, self.ring.zero)

    def check_place(self, number: int, place: dict[str, Any]) -> None:
        """Components of the singular set inside a place have their real points in families.

        In a place of points that is shown of all singular points, since there may be components
        that lie there in part.
        """
        ring, forms, points = self.ring, self.forms(place), place.get("points") is True
        values, left = ring.where(forms)
        if "family" in place:
            family = self.forms(pick(self.data["families"], place["family"]))
            return need(self.lies_in((values, left), family), "it is not in the family")
        if "too_small" in place:
            least = self.bound + 1 - len(values)
            return need(
                not points and ring.codimension_at_least(least, left), "not shown to be too small"
            )
        total = ring.zero
        for factor, source in place["sum"]:
            total += ring.times(ring.parse(factor), self.source(source, forms, points))
        if "squares" in place:
            parts = [(c, pick(self.polys, k)) for c, k in place["squares"]]
            need(all(POSITIVE.fullmatch(c) for c, _ in parts), "a factor is not positive")
            products = [ring.times(ring.number(c), g, g) for c, g in parts]
            found, points = sum(products, ring.zero), True
            cases = [([g for _, g in parts], place["then"])]
        else:
            factors = [(pick(self.polys, k), pick(range(100), n)) for k, n, _ in place["cases"]]
            found = ring.times(*(f for f, times in factors for _ in range(times)))
            cases = [([pick(self.polys, k)], then) for k, _, then in place["cases"]]
        need(total != 0 != found, "a form that is zero everywhere tells nothing")
        need(ring.same(*ring.stripped(total), *ring.stripped(found)), "the sum is something else")
        for more, then in cases:
            inside = ring.where([*forms, *more])
            if then is None:
                need(ring.empty(inside[1]), "a case leads nowhere")
                continue
            target = pick(self.data["places"], then)
            need(then > number, "a case leads back")
            need(not points or target.get("points") is True, "a case has no whole components")
            need(self.lies_in(inside, self.forms(target)), "a case is not where it leads to")

    def source(self, source: Any, forms: list[Poly], points: bool) -> Poly:
        """A form that is zero on every component inside a place."""
        ring = self.ring
        if type(source) is int:
            return pick(forms, source)
        if "resultant" in source:
            p, g, j = (*(pick(forms, k) for k in source["resultant"][:2]), source["resultant"][2])
            need(j in ring.joints(p) and j in ring.joints(g), "a resultant is none")
            return ring.resultant(p, g, j)
        values, left = ring.where(forms)
        rows, columns = (tuple(pick(range(22), k) for k in part) for part in source["minor"])
        in_order = all(list(part) == sorted({*part}) for part in (rows, columns))
        need(in_order and len(rows) == len(columns) == self.rank, "a minor is none")
        if "at" in source:  # as components are all of the place's own, free joints go all round
            at, rest = ring.where([pick(self.polys, k) for k in source["at"]])
            bound = {*values, *(j for p in left for j in ring.joints(p))}
            need(not rest and not bound & {*at} and not points, "a joint is not free")
            least = self.bound - len(values)
            need(ring.codimension_at_least(least, left), "a component may be only a part")
            values = {**values, **at}
        return self.at(values)(rows, columns)

    def lies_in(self, place: Where, forms: list[Poly]) -> bool:
        """Whether forms, of a family or of another place, are shown to vanish in a place."""
        images = (f for p in forms for f in self.ring.stripped(self.ring.put(p, place[0])))
        return all(self.ring.vanishes(f, place[1]) for f in images)


def explained(data: Any) -> str:
    """Which key of a file has not the types that the format says."""
    if type(data) is not dict or data.get("schema") != SCHEMA:
        return f"the schema is not {SCHEMA}"
    wrong = [k for k in {**SHAPE, **data} if not fits(data.get(k), SHAPE.get(k))]
    return f"not the types of the format: {', '.join(wrong)[:80]}"


def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object, if no key is there twice."""
    need(len(dict(pairs)) == len(pairs), "a key is there twice")
    return dict(pairs)


def inexact(text: str) -> None:
    """Numbers in a certificate are whole, or text."""
    raise Rejected(f"{text[:20]} is no exact number")


def verify(text: str) -> dict[str, Any]:
    """Check a certificate and return it; `Rejected` says what is wrong with it."""
    need(len(text) <= LONGEST_FILE, f"longer than {LONGEST_FILE} characters")
    try:
        data = json.loads(
            text, object_pairs_hook=unique, parse_float=inexact, parse_constant=inexact
        )
        need(fits(data, SHAPE), explained(data))
        Certificate(data).check()
        statement(data)  # names prove nothing, but are said
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        MemoryError,
        TypeError,
        ValueError,
        RecursionError,
    ) as error:
        raise Rejected(f"malformed ({type(error).__name__}: {str(error)[:80]})") from None
    return dict(data)


def statement(data: dict[str, Any]) -> str:
    """What a certificate that was accepted proves."""
    names = ", ".join(dict.fromkeys(str(f["name"]) for f in data["families"])) or "nothing"
    rows = " ".join(("vx", "vy", "vz", "wx", "wy", "wz")[r] for r in data["rows"])
    rows += " in the tip's axes" if type(data["tip"]) is dict else ""
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
