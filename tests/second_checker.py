"""A second checker of certificates, written from docs/proof.md alone.

It shares no line with ``pinsing.proof.checker`` and imports nothing of pinsing: what both accept
does not rest on a slip of one of them. Where the page leaves a choice, such as which integers to
try, it takes its own. It looks for clarity first and speed second.
"""

from __future__ import annotations

import json
import re
import sys
from itertools import combinations

from flint import Ordering, fmpq, fmpq_mpoly_ctx

KEYS = {
    *("schema", "robot", "base", "tip_frame", "task", "joints", "square_roots", "chain", "tip"),
    *("rows", "axes", "rank", "dependent_rows", "dependent_columns"),
    *("polynomials", "families", "places"),
}
TERM = re.compile(r"(-?[0-9]+(?:/[0-9]+)?)((?:[xys][0-9]+(?:\^[0-9]+)?)*)")
POWER = re.compile(r"([xys][0-9]+)(?:\^([0-9]+))?")


class No(Exception):
    """The certificate is not accepted, and why."""


def need(condition, why):
    if not condition:
        raise No(why)


def whole(value, low, high, what):
    need(type(value) is int and low <= value <= high, f"{what}: {value!r}")
    return value


def listed(value, what, length=None):
    need(type(value) is list and length in (None, len(value)), f"{what}: not such a list")
    return value


def keyed(value, keys, what, optional=()):
    need(type(value) is dict and set(keys) <= set(value) <= {*keys, *optional}, f"{what}: keys")
    return value


# Polynomials over K = Q(square roots): those of Q[x, y, s], with s reduced --------------------


class Ring:
    """K[x1, y1, x2, y2, ...], and the units of the joints."""

    def __init__(self, kinds, roots):
        self.n, self.roots = len(kinds), roots
        names = [f"{letter}{j + 1}" for j in range(self.n) for letter in "xy"] + ["s2", "s3"]
        self.ctx = fmpq_mpoly_ctx.get(names, Ordering.lex)
        gens = self.ctx.gens()
        self.place_of = {name: k for k, name in enumerate(names)}
        self.x, self.y, self.s = gens[0 : 2 * self.n : 2], gens[1 : 2 * self.n : 2], gens[-2:]
        self.zero, self.one = self.ctx.constant(0), self.ctx.constant(1)
        self.units = [
            x * x + y * y if kind == "revolute" else x
            for kind, x, y in zip(kinds, self.x, self.y, strict=True)
        ]

    def reduced(self, p):
        if self.roots and p:
            for s, square in zip(self.s, (2, 3), strict=True):
                p = divmod(p, s * s - square)[1]
        return p

    def mul(self, p, q):
        return self.reduced(p * q)

    def parse(self, text):
        """A form or a number from its text."""
        need(type(text) is str, f"no text: {text!r}")
        terms = {}
        for term in text.split(" "):
            match = TERM.fullmatch(term)
            need(match, f"no term: {term!r}")
            top, _, bottom = match[1].partition("/")
            need(not bottom or int(bottom), f"no number: {term!r}")
            exponents = [0] * (2 * self.n + 2)
            for name, power in POWER.findall(match[2]):
                need(name in self.place_of, f"no variable: {name}")
                need(name[0] != "s" or int(name[1:]) in self.roots, f"no root: {name}")
                need(1 <= int(power or 1) <= 99, f"no power: {term!r}")
                exponents[self.place_of[name]] += int(power or 1)
            key = tuple(exponents)
            terms[key] = terms.get(key, 0) + fmpq(int(top), int(bottom or 1))
        p = self.reduced(self.ctx.from_dict({k: c for k, c in terms.items() if c}))
        need(self.is_form(p), f"no form: {text[:40]!r}")
        return p

    def number(self, text):
        p = self.parse(text)
        need(not self.joints(p), f"not a number: {text!r}")
        return p

    def degree(self, p, j):
        """The degree of a form in x_j and y_j together."""
        return max((m[2 * j] + m[2 * j + 1] for m in p.monoms()), default=0)

    def is_form(self, p):
        return all(len({m[2 * j] + m[2 * j + 1] for m in p.monoms()}) <= 1 for j in range(self.n))

    def joints(self, p):
        degrees = p.degrees() if p else ()
        return [j for j in range(self.n) if p and degrees[2 * j] + degrees[2 * j + 1]]

    def without_units(self, p):
        for j in self.joints(p):
            while True:
                quotient, rest = divmod(p, self.units[j])
                if rest or not p:
                    break
                p = quotient
        return p

    def coefficient(self, p, j, power):
        """Of y_j^power x_j^0 in p: a form in the other joints."""
        terms = {}
        for m, c in p.to_dict().items():
            if m[2 * j] == 0 and m[2 * j + 1] == power:
                terms[(*m[: 2 * j], 0, 0, *m[2 * j + 2 :])] = c
        return self.ctx.from_dict(terms)

    def put(self, p, values):
        """P with joints at values {j: (x, y)}."""
        at = {}
        for j, (x, y) in values.items():
            at[f"x{j + 1}"], at[f"y{j + 1}"] = x, y
        return self.reduced(p.compose(*[at.get(str(g), g) for g in self.ctx.gens()])) if at else p

    def conjugates(self, p):
        """The product of the other conjugates of p, and that times p, which is over Q."""
        others = self.one
        for root, k in ((2, 0), (3, 1)):
            if root in self.roots:
                both = self.mul(p, others)
                gens = list(self.ctx.gens())
                gens[2 * self.n + k] = -self.s[k]
                others = self.mul(others, both.compose(*gens))
        return others, self.mul(p, others)

    def divides(self, p, f):
        if not self.roots:
            return not divmod(f, p)[1]
        others, norm = self.conjugates(p)
        return not divmod(self.mul(f, others), norm)[1]

    def resultant(self, p, q, j):
        """Of two forms with respect to joint j; zero at x = 0 as well if both are.

        0, which tells nothing, where it would take long.
        """
        size = self.degree(p, j) + self.degree(q, j)
        if len(p.monoms()) * len(q.monoms()) * size > 10_000:
            return self.zero
        ones = {f"x{j + 1}": self.one}
        flat = [f.compose(*[ones.get(str(g), g) for g in self.ctx.gens()]) for f in (p, q)]
        name = f"y{j + 1}"
        tops = [self.coefficient(f, j, self.degree(f, j)) for f in (p, q)]
        result = flat[0].resultant(flat[1], name)
        if not tops[0]:
            result *= tops[1]
        if not tops[1]:
            result *= tops[0]
        return self.reduced(result)

    def same(self, p, q):
        """The same but for units and a constant of K, and neither zero."""
        p, q = self.without_units(p), self.without_units(q)
        if not p or not q or set(self.joints(p)) != set(self.joints(q)):
            return False
        # p = c q for some c of K: compare with the coefficients of one monomial
        lead = {}
        for name, f in (("p", p), ("q", q)):
            parts = {}
            for m, c in f.to_dict().items():
                parts.setdefault(m[:-2], {})[(*[0] * (2 * self.n), *m[-2:])] = c
            lead[name] = {m: self.ctx.from_dict(d) for m, d in parts.items()}
        if set(lead["p"]) != set(lead["q"]):
            return False
        m = max(lead["p"])
        return not self.mul(p, lead["q"][m]) - self.mul(q, lead["p"][m])


# Forms that vanish together --------------------------------------------------------------


class Together:
    """Forms, simplified: joints at values, and forms in the others."""

    def __init__(self, ring, forms):
        self.ring, self.values = ring, {}
        self.forms = self.clean(forms)
        while linear := next((f for f in self.forms if self.linear(f)), None):
            j, x, y = self.linear(linear)
            self.values[j] = (x, y)
            self.forms = self.clean(ring.put(f, {j: (x, y)}) for f in self.forms)
        self.nowhere = any(not ring.joints(f) for f in self.forms)

    def clean(self, forms):
        out = []
        for f in map(self.ring.without_units, forms):
            if f and f not in out:
                out.append(f)
        return out

    def linear(self, f):
        """(j, b, -a) if f is a x_j + b y_j."""
        ring, joints = self.ring, self.ring.joints(f)
        if len(joints) != 1 or ring.degree(f, joints[0]) != 1:
            return None
        j = joints[0]
        a = ring.put(f, {j: (ring.one, ring.zero)})
        b = ring.put(f, {j: (ring.zero, ring.one)})
        return j, b, -a

    def vanishes(self, f):
        """True if f is shown to vanish where these forms do."""
        return self.vanishes_put(self.ring.put(f, self.values))

    def vanishes_put(self, f):
        ring = self.ring
        f = ring.without_units(f)
        if not f or self.nowhere or any(ring.divides(p, f) for p in self.forms):
            return True
        forms = sorted(self.forms, key=lambda p: len(ring.joints(p)))
        if not forms:
            return False
        leading = []
        for choice in self.choices(forms):
            rest, product = f, ring.one
            for p, j in reversed(list(zip(forms, choice, strict=True))):
                d = ring.degree(p, j)
                top = ring.coefficient(p, j, d)
                product = ring.mul(product, top)
                e = ring.degree(rest, j)
                while rest and e >= d:
                    c = ring.coefficient(rest, j, e)
                    rest = ring.mul(top, rest) - ring.mul(c, p) * ring.y[j] ** (e - d)
                    rest, over = divmod(ring.reduced(rest), ring.x[j])
                    need(not over, "a division that leaves something")
                    e -= 1
            if not rest:
                leading.append(product)
                if self.codimension(len(forms) + 1, [*forms, *leading]):
                    return True
        return False

    def choices(self, forms, taken=()):
        """A joint for each form, which the ones before it do not have."""
        if len(taken) == len(forms):
            yield taken
            return
        before = {j for p in forms[: len(taken)] for j in self.ring.joints(p)}
        for j in self.ring.joints(forms[len(taken)]):
            if j not in before:
                yield from self.choices(forms, (*taken, j))

    def at_least(self, c):
        """True if each component is shown to have codimension c or more."""
        return self.nowhere or self.codimension(c - len(self.values), self.forms)

    def codimension(self, c, forms):
        ring = self.ring
        if c <= 0:
            return True
        plain = Together(ring, forms)
        if plain.values and plain.forms != forms:
            return plain.at_least(c)
        if plain.nowhere:
            return True
        forms = plain.forms
        if len(forms) == 0:
            return False
        return self.missing(c, forms) or self.missing(c, [*forms, *self.eliminated(forms)])

    def eliminated(self, forms):
        """Resultants of all pairs in all joints of both, units out: zero on components, too."""
        found = []
        for p, q in combinations(forms, 2):
            for j in set(self.ring.joints(p)) & set(self.ring.joints(q)):
                found.append(self.ring.without_units(self.ring.resultant(p, q, j)))
        return [r for r in found if r]

    def missing(self, c, forms):
        """For any c - 1 joints: no common zero at some values of the others."""
        joints = sorted({j for f in forms for j in self.ring.joints(f)})
        return all(
            self.not_onto(forms, kept, [j for j in joints if j not in kept])
            for kept in combinations(joints, min(c - 1, len(joints)))
        )

    def not_onto(self, forms, kept, others):
        ring = self.ring
        for seed in (1, 2, 3):
            point = {
                j: (ring.one, ring.ctx.constant(seed * 7 + 5 * k * k + 3 * k + 2))
                for k, j in enumerate(others)
            }
            if self.no_zero([ring.put(f, point) for f in forms], kept):
                return True
        return False

    def no_zero(self, forms, joints):
        """No common zero, by elimination."""
        ring = self.ring
        forms = [f for f in forms if f]
        if any(not ring.joints(f) for f in forms):
            return True
        for j in sorted(joints, key=lambda j: sum(ring.degree(f, j) for f in forms)):
            having = [f for f in forms if ring.degree(f, j)]
            if len(having) < 2:
                continue
            rest = [f for f in forms if not ring.degree(f, j)]
            rest += [ring.resultant(p, q, j) for p, q in combinations(having, 2)]
            if self.no_zero(rest, [k for k in joints if k != j]):
                return True
        return False


# The matrix -------------------------------------------------------------------------------


class Quotients:
    """Quotients of forms by products of units: (numerator, exponent of each unit)."""

    def __init__(self, ring):
        self.ring = ring
        self.none = (0,) * ring.n

    def constant(self, p):
        return (p, self.none)

    def over(self, f, exponents):
        p, own = f
        for u, a, b in zip(self.ring.units, exponents, own, strict=True):
            p = p * u ** (a - b)
        return self.ring.reduced(p)

    def add(self, f, g):
        top = tuple(map(max, f[1], g[1]))
        return (self.over(f, top) + self.over(g, top), top)

    def sub(self, f, g):
        return self.add(f, (-g[0], g[1]))

    def mul(self, f, g):
        p = self.ring.mul(f[0], g[0])
        return (p, tuple(a + b for a, b in zip(f[1], g[1], strict=True)) if p else self.none)

    def dot(self, row, column):
        total = self.constant(self.ring.zero)
        for f, g in zip(row, column, strict=True):
            total = self.add(total, self.mul(f, g))
        return total

    def apply(self, matrix, vector):
        return [self.dot(row, vector) for row in matrix]

    def product(self, a, b):
        return [[self.dot(row, column) for column in zip(*b, strict=True)] for row in a]

    def plus(self, v, w):
        return [self.add(f, g) for f, g in zip(v, w, strict=True)]

    def cross(self, v, w):
        def minor(i, k):
            return self.sub(self.mul(v[i], w[k]), self.mul(v[k], w[i]))

        return [minor(1, 2), minor(2, 0), minor(0, 1)]


def links_of(data, ring, kinds):
    """Per link: joint, multiple, and the rotation and translation up to the link's own frame."""
    q = Quotients(ring)
    zero, one = q.constant(ring.zero), q.constant(ring.one)
    links = []
    for link in listed(data["chain"], "chain"):
        keyed(link, ["rotation", "translation", "joint", "multiple", "plus"], "link")
        r = [
            [ring.number(t) for t in listed(row, "rotation", 3)]
            for row in listed(link["rotation"], "rotation", 3)
        ]
        for i in range(3):
            for k in range(3):
                d = sum((r[i][m] * r[k][m] for m in range(3)), ring.zero)
                need(ring.reduced(d) == (ring.one if i == k else ring.zero), "rotation: not one")
        need(ring.reduced(determinant(ring, r)) == ring.one, "rotation: a mirror image")
        t = [ring.number(t) for t in listed(link["translation"], "translation", 3)]
        j = whole(link["joint"], 0, ring.n - 1, "joint")
        rotation = [[q.constant(p) for p in row] for row in r]
        translation = [q.constant(p) for p in t]
        multiple = ring.number(link["multiple"])
        if kinds[j] == "revolute":
            need(re.fullmatch(r"-?[0-9]+", link["multiple"]), "multiple: not whole")
            m = int(link["multiple"])
            need(abs(m) <= 6, "multiple: above 6")
            cos, sin = (ring.number(p) for p in listed(link["plus"], "plus", 2))
            need(ring.mul(cos, cos) + ring.mul(sin, sin) == ring.one, "plus: no angle")
            x, y = ring.x[j], ring.y[j] if m > 0 else -ring.y[j]
            for _ in range(2 * abs(m)):
                cos, sin = ring.reduced(cos * x - sin * y), ring.reduced(sin * x + cos * y)
            down = tuple(abs(m) if k == j else 0 for k in range(ring.n))
            c, s, minus = (cos, down), (sin, down), (-sin, down)
            turn = [[c, minus, zero], [s, c, zero], [zero, zero, one]]
            rotation = q.product(rotation, turn)
        else:
            slide = ring.mul(multiple, ring.y[j]) + ring.mul(ring.number(link["plus"]), ring.x[j])
            down = tuple(int(k == j) for k in range(ring.n))
            moved = q.apply(rotation, [zero, zero, (slide, down)])
            translation = q.plus(translation, moved)
        links.append((j, q.constant(multiple), rotation, translation))
    need(len(links) <= 16, "chain: too long")
    return links


def matrix_of(data, ring, kinds):
    """M before dependent lines are taken out, from the placements."""
    q = Quotients(ring)
    zero, one = q.constant(ring.zero), q.constant(ring.one)
    links = links_of(data, ring, kinds)
    a = whole(data["axes"], 0, len(links), "axes")
    rows = [whole(k, 0, 5, "rows") for k in listed(data["rows"], "rows")]
    need(rows and rows == sorted(set(rows)), "rows: not in order")
    need(a == 0 or rows in ([0, 1, 2], [3, 4, 5], [0, 1, 2, 3, 4, 5]), "axes: not for such rows")
    identity = [[one if i == k else zero for k in range(3)] for i in range(3)]
    frames = {a: (identity, [zero] * 3)}
    for i in range(a, len(links)):
        (r, p), (_, _, rotation, translation) = frames[i], links[i]
        frames[i + 1] = (q.product(r, rotation), q.plus(p, q.apply(r, translation)))
    for i in range(a, 0, -1):
        (r, p), (_, _, rotation, translation) = frames[i], links[i - 1]
        before = q.product(r, [list(column) for column in zip(*rotation, strict=True)])
        moved = q.apply(before, translation)
        frames[i - 1] = (before, [q.sub(f, g) for f, g in zip(p, moved, strict=True)])
    tip = [q.constant(ring.number(t)) for t in listed(data["tip"], "tip", 3)]
    end, origin = frames[len(links)]
    point = [zero] * 3 if len(rows) == 6 else q.plus(origin, q.apply(end, tip))
    columns = [[zero] * 6 for _ in range(ring.n)]
    for i, (j, multiple, _, _) in enumerate(links):
        r, p = frames[i + 1]
        axis = [q.mul(multiple, row[2]) for row in r]
        if kinds[j] == "revolute":
            arm = [q.sub(f, g) for f, g in zip(point, p, strict=True)]
            screw = q.cross(axis, arm) + axis
        else:
            screw = axis + [zero] * 3
        columns[j] = q.plus(columns[j], screw)
    forms = []
    for column in columns:
        wanted = [column[k] for k in rows]
        top = tuple(max(f[1][k] for f in wanted) for k in range(ring.n))
        forms.append(divided(ring, [q.over(f, top) for f in wanted]))
    return [divided(ring, list(row)) for row in zip(*forms, strict=True)]


def divided(ring, line):
    """A line of the matrix without the units that all its entries have."""
    if not any(line):
        return line
    for unit in ring.units:
        while all(not divmod(p, unit)[1] for p in line):
            line = [divmod(p, unit)[0] for p in line]
    return line


def independent(matrix, lines, ring, what):
    """The rows of the matrix without those that are shown to be sums of others."""
    need(type(lines) is dict, f"{what}: not an object")

    def index(text):
        need(type(text) is str and re.fullmatch("0|[1-9][0-9]*", text), f"{what}: {text!r}")
        return whole(int(text), 0, len(matrix) - 1, what)

    gone = {index(k): v for k, v in lines.items()}
    for k, combination in gone.items():
        need(type(combination) is dict, f"{what}: not an object")
        total = [ring.zero] * len(matrix[0])
        for other, number in combination.items():
            need(index(other) not in gone, f"{what}: a sum of lines that go")
            c = ring.number(number)
            total = [s + ring.mul(c, p) for s, p in zip(total, matrix[index(other)], strict=True)]
        need(total == matrix[k], f"{what}: line {k} is not that sum")
    return [row for k, row in enumerate(matrix) if k not in gone]


def determinant(ring, square):
    """By expansion along rows; minors of the last rows are computed once."""
    minors = {(): ring.one}
    n = len(square)
    for size in range(1, n + 1):
        row, new = square[n - size], {}
        for columns in combinations(range(n), size):
            total = ring.zero
            for k, c in enumerate(columns):
                if row[c]:
                    term = row[c] * minors[columns[:k] + columns[k + 1 :]]
                    total = total - term if k % 2 else total + term
            new[columns] = ring.reduced(total)
        minors = new
    return minors[tuple(range(n))]


# The check ----------------------------------------------------------------------------------


class Check:
    """One certificate."""

    def __init__(self, text):
        need(len(text) <= 4_000_000, "too long")
        data = self.data = keyed(read(text), KEYS, "certificate")
        need(data["schema"] == "pinsing/certificate/2", "another schema")
        for key in ("robot", "base", "tip_frame", "task"):
            need(type(data[key]) is str, f"{key}: no text")
        joints = listed(data["joints"], "joints")
        need(1 <= len(joints) <= 16, "joints: how many")
        for joint in joints:
            keyed(joint, ["name", "kind"], "joint")
            need(type(joint["name"]) is str, "joint: no name")
            need(joint["kind"] in ("revolute", "prismatic"), "joint: kind")
        roots = listed(data["square_roots"], "square_roots")
        need(all(type(k) is int for k in roots), "square_roots")
        need(roots in ([], [2], [3], [2, 3]), "square_roots")
        kinds = [joint["kind"] for joint in joints]
        ring = self.ring = Ring(kinds, roots)
        matrix = matrix_of(data, ring, kinds)
        matrix = independent(matrix, data["dependent_rows"], ring, "dependent_rows")
        need(matrix, "no rows left")
        turned = [list(column) for column in zip(*matrix, strict=True)]
        turned = independent(turned, data["dependent_columns"], ring, "dependent_columns")
        need(turned, "no columns left")
        self.m = [list(row) for row in zip(*turned, strict=True)]
        self.a, self.b = len(self.m), len(turned)
        self.r = whole(data["rank"], 1, min(self.a, self.b), "rank")
        self.bound = (self.a - self.r + 1) * (self.b - self.r + 1)
        self.polynomials = [ring.parse(t) for t in listed(data["polynomials"], "polynomials")]

    def run(self):
        self.rank()
        self.families = [self.family(f) for f in listed(self.data["families"], "families")]
        places = listed(self.data["places"], "places")
        need(places, "no place")
        for place in places:
            need(type(place) is dict, "place: not an object")
            need(place.get("points", True) is True, "points")
        need(places[0].get("forms") == [] and "points" not in places[0], "first place")
        for k in range(len(places)):
            self.place(places, k)

    def pick(self, indices, what):
        chosen = [whole(k, 0, len(self.polynomials) - 1, what) for k in listed(indices, what)]
        return [self.polynomials[k] for k in chosen]

    def minors(self, size, matrix=None):
        matrix = matrix or self.m
        for rows in combinations(range(self.a), size):
            for columns in combinations(range(self.b), size):
                yield self.minor(rows, columns, matrix)

    def minor(self, rows, columns, matrix):
        return determinant(self.ring, [[matrix[i][k] for k in columns] for i in rows])

    def put(self, values):
        return [[self.ring.put(p, values) for p in row] for row in self.m]

    def rank(self):
        ring = self.ring
        point = {j: (ring.one, ring.ctx.constant(3 * j * j + 2 * j + 5)) for j in range(ring.n)}
        need(any(self.minors(self.r, self.put(point))), "rank: not so large at a point")
        need(not any(self.minors(self.r + 1)), "rank: larger")

    def family(self, family):
        keyed(family, ["name", "forms", "sums", "least_codimension"], "family")
        need(type(family["name"]) is str, "family: no name")
        forms = self.pick(family["forms"], "family")
        need(all(forms), "family: a form that is zero")
        sums = []
        for entry in listed(family["sums"], "sums"):
            total = self.ring.zero
            for pair in listed(entry, "sums"):
                text, i = listed(pair, "sums", 2)
                form = forms[whole(i, 0, len(forms) - 1, "sums")]
                total += self.ring.mul(self.ring.parse(text), form)
            need(total and self.ring.is_form(total), "sums: zero or no form")
            sums.append(self.ring.without_units(total))
        where = Together(self.ring, forms)
        put = [self.ring.put(p, where.values) for p in sums]
        for minor in self.minors(self.r, self.put(where.values)):
            shown = any(not minor if not p else self.ring.divides(p, minor) for p in put)
            need(shown or where.vanishes_put(minor), f"family {family['name']}: not singular")
        least = whole(family["least_codimension"], 0, 99, "least_codimension")
        need(where.at_least(least), f"family {family['name']}: a larger component")
        return forms

    def source(self, source, place, where, points):
        ring = self.ring
        if type(source) is int:
            return place[whole(source, 0, len(place) - 1, "source")]
        need(type(source) is dict, "source")
        if "resultant" in source:
            i, k, j = listed(keyed(source, ["resultant"], "source")["resultant"], "resultant", 3)
            p, q = (place[whole(m, 0, len(place) - 1, "resultant")] for m in (i, k))
            whole(j, 0, ring.n - 1, "resultant")
            need(ring.degree(p, j) and ring.degree(q, j), "resultant: a form without the joint")
            return ring.resultant(p, q, j)
        keyed(source, ["minor"], "source", ["at"])
        rows, columns = listed(source["minor"], "minor", 2)
        for lines, count in ((rows, self.a), (columns, self.b)):
            for k in listed(lines, "minor", self.r):
                whole(k, 0, count - 1, "minor")
            need(lines == sorted(set(lines)), "minor: not in order")
        values = dict(where.values)
        if "at" in source:
            need(not points, "at: in a place of points")
            need(where.at_least(self.bound), "at: the place may be too large")
            busy = {j for p in place for j in ring.joints(p)}
            for p in self.pick(source["at"], "at"):
                linear = where.linear(p)
                need(linear and linear[0] not in busy | set(values), "at: not free")
                values[linear[0]] = linear[1:]
        return self.minor(rows, columns, self.put(values) if values else self.m)

    def place(self, places, number):
        ring, place = self.ring, places[number]
        points = "points" in place
        forms = self.pick(place.get("forms"), "place")
        where = Together(ring, forms)
        if "family" in place:
            keyed(place, ["forms", "family"], "place", ["points"])
            family = self.families[whole(place["family"], 0, len(self.families) - 1, "family")]
            need(all(where.vanishes(f) for f in family), f"place {number}: not in the family")
            return
        if "too_small" in place:
            keyed(place, ["forms", "too_small"], "place")
            need(place["too_small"] is True, "too_small")
            need(where.at_least(self.bound + 1), f"place {number}: not too small")
            return
        total = ring.zero
        for pair in listed(place.get("sum"), "sum"):
            text, source = listed(pair, "sum", 2)
            value = self.source(source, forms, where, points)
            total += ring.mul(ring.parse(text), value)
        need(total and ring.is_form(total), f"place {number}: a sum that is zero or no form")
        if "cases" in place:
            keyed(place, ["forms", "sum", "cases"], "place", ["points"])
            product = ring.one
            for case in listed(place["cases"], "cases"):
                k, times, to = listed(case, "case", 3)
                (p,) = self.pick([k], "case")
                for _ in range(whole(times, 1, 99, "times")):
                    product = ring.without_units(ring.mul(product, p))
                self.leads(places, number, [*forms, p], to, points)
        else:
            keyed(place, ["forms", "sum", "squares", "then"], "place", ["points"])
            product, roots = ring.zero, []
            for pair in listed(place["squares"], "squares"):
                text, k = listed(pair, "square", 2)
                need(type(text) is str and re.fullmatch("[0-9]+(/[0-9]+)?", text), "square")
                c = ring.number(text)
                need(c, "square: zero")
                roots += self.pick([k], "square")
                product += ring.reduced(c * roots[-1] * roots[-1])
            need(ring.is_form(product), "squares: no form")
            self.leads(places, number, [*forms, *roots], place["then"], True)
        need(ring.same(total, product), f"place {number}: another form")

    def leads(self, places, number, forms, to, points):
        together = Together(self.ring, forms)
        if to is None:
            need(together.nowhere, f"place {number}: a case that is somewhere")
            return
        whole(to, number + 1, len(places) - 1, "a place that is not later")
        need(not points or "points" in places[to], f"place {number}: back from points")
        target = self.pick(places[to].get("forms"), "place")
        need(all(together.vanishes(f) for f in target), f"place {number}: not in place {to}")


def read(text):
    def unique(pairs):
        need(len(dict(pairs)) == len(pairs), "a key twice")
        return dict(pairs)

    def refuse(number):
        raise No(f"not whole: {number}")

    try:
        return json.loads(text, object_pairs_hook=unique, parse_float=refuse, parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise No(f"no JSON: {error}") from error


def second_verdict(text):
    """Empty if the certificate is accepted, or what is wrong with it."""
    try:
        Check(text).run()
    except No as reason:
        return str(reason) or "no"
    return ""


if __name__ == "__main__":
    for path in sys.argv[1:]:
        with open(path, encoding="utf-8") as file:
            print(path, second_verdict(file.read()) or "ACCEPTED")
