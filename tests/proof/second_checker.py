"""A second checker of certificates, written from docs/proof.md alone.

It shares no line with ``pinsing.proof.checker`` and imports nothing of pinsing: what both accept
does not rest on a slip of one of them. Where the page leaves a choice, such as which integers to
try, it takes its own. It looks for clarity first and speed second.
"""

import json
import re
import sys
from itertools import combinations

from flint import Ordering, fmpq, fmpq_mpoly_ctx

KEYS = {
    *("schema", "robot", "base", "tip_frame", "task", "joints", "square_roots", "chain", "tip"),
    *("rows", "axes", "rank", "row_steps", "column_steps", "polynomials", "families", "places"),
}
TERM = re.compile(r"(-?[0-9]{1,400}(?:/[1-9][0-9]{0,399})?)((?:[xys][0-9]+(?:\^[1-9][0-9]?)?)*)")
WEIGHT = re.compile("[1-9][0-9]*(/[1-9][0-9]*)?")
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
        self.place_of = {name: k for k, name in enumerate(names)}
        inverses = [f"w{j + 1}" for j in range(self.n)]  # of the units, while the matrix is made
        self.ctx = fmpq_mpoly_ctx.get(names + inverses, Ordering.lex)
        gens = self.ctx.gens()
        self.x, self.y = gens[0 : 2 * self.n : 2], gens[1 : 2 * self.n : 2]
        self.s, self.w = gens[2 * self.n :][:2], gens[2 * self.n + 2 :]
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
        found = []
        for term in text.split(" "):
            match = TERM.fullmatch(term)
            need(match, f"no term: {term!r}")
            exponents = [0] * self.ctx.nvars()
            for name, power in POWER.findall(match[2]):
                need(name in self.place_of, f"no variable: {name}")
                need(name[0] != "s" or int(name[1:]) in self.roots, f"no root: {name}")
                exponents[self.place_of[name]] += int(power or 1)
            top, _, bottom = match[1].partition("/")
            found.append((exponents, fmpq(int(top), int(bottom or 1))))
        for j in range(self.n):
            whole = max(sum(exponents[2 * j : 2 * j + 2]) for exponents, _ in found)
            for exponents, _ in found:
                exponents[2 * j] += whole - sum(exponents[2 * j : 2 * j + 2])
        terms = {}
        for exponents, number in found:
            terms[tuple(exponents)] = terms.get(tuple(exponents), 0) + number
        p = self.reduced(self.ctx.from_dict({k: c for k, c in terms.items() if c}))
        assert self.is_form(p)
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
        k = 2 * j
        wanted = ((m, c) for m, c in p.to_dict().items() if m[k : k + 2] == (0, power))
        return self.ctx.from_dict({(*m[:k], 0, 0, *m[k + 2 :]): c for m, c in wanted})

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
        flat = [f.subs({f"x{j + 1}": 1}) for f in (p, q)]
        tops = [self.coefficient(f, j, self.degree(f, j)) for f in (p, q)]
        result = flat[0].resultant(flat[1], f"y{j + 1}")
        for top, other in (tops, tops[::-1]):
            if not top:
                result *= other
        return self.reduced(result)


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

    def vanishes_put(self, f, more=()):
        """The same of a form with the values put in; more forms may be known to vanish."""
        f = self.ring.without_units(f)
        return not f or any(self.ring.divides(p, f) for p in [*self.forms, *more])

    def apart_from(self, f):
        """True if f, with the values put in, is shown to vanish on no component."""
        f = self.ring.without_units(f)
        return self.nowhere or self.codimension(len(self.forms) + 1, [*self.forms, f] if f else [])

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
        if plain.nowhere or not plain.forms:
            return plain.nowhere
        forms = plain.forms
        return self.missing(c, forms) or self.missing(c, [*forms, *self.eliminated(forms)])

    def eliminated(self, forms):
        """Resultants of all pairs in all joints of both, units out: zero on components, too."""
        found = [
            self.ring.without_units(self.ring.resultant(p, q, j))
            for p, q in combinations(forms, 2)
            for j in set(self.ring.joints(p)) & set(self.ring.joints(q))
        ]
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


def settled(ring, p):
    """With the inverse w of a unit u: w u = 1."""
    p = ring.reduced(p)
    for w, unit in zip(ring.w, ring.units, strict=True):
        p = divmod(p, w * unit - 1)[1] if p else p
    return p


def flipped(matrix):
    return [list(column) for column in zip(*matrix, strict=True)]


def identity(ring, n):
    return [[ring.one if i == k else ring.zero for k in range(n)] for i in range(n)]


def product(ring, a, b):
    def dot(row, column):
        return sum((f * g for f, g in zip(row, column, strict=True)), ring.zero)

    return [[settled(ring, dot(row, column)) for column in flipped(b)] for row in a]


def inverse(ring, placement):
    turn = flipped(row[:3] for row in placement[:3])
    back = product(ring, turn, [row[3:] for row in placement[:3]])
    return [*([*row, -p] for row, (p,) in zip(turn, back, strict=True)), placement[3]]


def placement_of(ring, item):
    """Of a link or the tip, 4 by 4."""
    r = [
        [ring.number(t) for t in listed(row, "rotation", 3)]
        for row in listed(item["rotation"], "rotation", 3)
    ]
    need(product(ring, r, flipped(r)) == identity(ring, 3), "rotation: not one")
    need(ring.reduced(determinant(ring, r)) == ring.one, "rotation: a mirror image")
    t = [ring.number(t) for t in listed(item["translation"], "translation", 3)]
    return [*([*row, p] for row, p in zip(r, t, strict=True)), [ring.zero] * 3 + [ring.one]]


def motion_of(ring, kind, j, text):
    """Of a multiple of joint j, 4 by 4, and the multiple."""
    multiple, zero, one = ring.number(text), ring.zero, ring.one
    x, y, w = ring.x[j], ring.y[j], ring.w[j]
    cos, sin, slide = one, zero, multiple * y * w
    if kind == "revolute":
        need(re.fullmatch(r"-?[0-6]", text), "multiple: not whole, or above 6")
        m, slide = int(text), zero
        c, s = (x * x - y * y) * w, (2 if m > 0 else -2) * x * y * w
        for _ in range(abs(m)):
            cos, sin = settled(ring, cos * c - sin * s), settled(ring, sin * c + cos * s)
    turn = [cos, -sin, zero, zero], [sin, cos, zero, zero]
    return [*turn, [zero, zero, one, slide], [zero, zero, zero, one]], multiple


def matrix_of(data, ring, kinds):
    """M before the steps, from the placements."""
    joints, multiples, moves = [], [], []
    for link in listed(data["chain"], "chain"):
        keyed(link, ["rotation", "translation", "joint", "multiple"], "link")
        j = whole(link["joint"], 0, ring.n - 1, "joint")
        motion, multiple = motion_of(ring, kinds[j], j, link["multiple"])
        moves.append(product(ring, placement_of(ring, link), motion))
        joints.append(j)
        multiples.append(multiple)
    need(0 < len(moves) <= 16, "chain: too long, or without a link")
    moves.append(placement_of(ring, keyed(data["tip"], ["rotation", "translation"], "tip")))
    a = whole(data["axes"], 0, len(moves), "axes")
    rows = [whole(k, 0, 5, "rows") for k in listed(data["rows"], "rows")]
    need(rows and rows == sorted(set(rows)), "rows: not in order")
    free = rows in ([0, 1, 2], [3, 4, 5], [0, 1, 2, 3, 4, 5])
    need(free or a in (0, len(moves)), "axes: not for such rows")
    frames = {a: identity(ring, 4)}
    for i in range(a, len(moves)):
        frames[i + 1] = product(ring, frames[i], moves[i])
    for i in range(a, 0, -1):
        frames[i - 1] = product(ring, frames[i], inverse(ring, moves[i - 1]))
    point = [ring.zero if len(rows) == 6 else row[3] for row in frames[len(moves)][:3]]
    columns = [[ring.zero] * 6 for _ in range(ring.n)]
    for i, (j, multiple) in enumerate(zip(joints, multiples, strict=True)):
        axis = [row[2] for row in frames[i + 1][:3]]
        screw = axis + [ring.zero] * 3
        if kinds[j] == "revolute":
            arm = [p - row[3] for p, row in zip(point, frames[i + 1][:3], strict=True)]
            screw = [axis[k - 2] * arm[k - 1] - axis[k - 1] * arm[k - 2] for k in range(3)] + axis
        columns[j] = [f + multiple * g for f, g in zip(columns[j], screw, strict=True)]
    lines = [forms_of(ring, [column[k] for k in rows]) for column in columns]
    return [divided(ring, row) for row in flipped(lines)]


def forms_of(ring, line):
    """Times the units that are divided by, and without those that all have."""
    line = [settled(ring, p) for p in line]
    for j, unit in enumerate(ring.units):
        top = max((p.degrees()[j - ring.n] for p in line if p), default=0)
        line = [settled(ring, p * unit**top) for p in line]
    return divided(ring, line)


def divided(ring, line):
    """A line of the matrix without the units that all its entries have."""
    if not any(line):
        return line
    for unit in ring.units:
        while all(not divmod(p, unit)[1] for p in line):
            line = [divmod(p, unit)[0] for p in line]
    return line


def stepped(matrix, steps, ring, what):
    """The rows of the matrix after the steps, without those that are zero."""
    matrix = [list(row) for row in matrix]
    for step in listed(steps, what):
        i, k, text = listed(step, what, 3)
        whole(i, 0, len(matrix) - 1, what)
        whole(k, 0, len(matrix) - 1, what)
        need(i != k, f"{what}: a line and itself")
        c = ring.number(text)
        pairs = list(zip(matrix[i], matrix[k], strict=True))
        alike = [
            all(ring.degree(p, j) == ring.degree(f, j) for j in range(ring.n))
            for p, f in pairs
            if p != 0 and f != 0
        ]
        need(any(alike), f"{what}: lines of different degrees")
        matrix[i] = [ring.reduced(p - c * f) for p, f in pairs]
    return [row for row in matrix if any(row)]


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
        need(data["schema"] == "pinsing/certificate/3", "another schema")
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
        matrix = stepped(matrix, data["row_steps"], ring, "row_steps")
        need(matrix, "no rows left")
        turned = stepped(flipped(matrix), data["column_steps"], ring, "column_steps")
        need(turned, "no columns left")
        self.m = flipped(turned)
        self.a, self.b = len(self.m), len(turned)
        self.r = whole(data["rank"], 1, min(self.a, self.b), "rank")
        self.bound = (self.a - self.r + 1) * (self.b - self.r + 1)
        self.polynomials = [ring.parse(t) for t in listed(data["polynomials"], "polynomials")]

    def run(self):
        self.rank()
        self.families = [self.family(f) for f in listed(self.data["families"], "families")]
        places = listed(self.data["places"], "places")
        need(places, "no place")
        keys = ["forms", "of_forms", "of_minors", "of_resultants", "cases"]
        self.places = [self.pick(keyed(p, keys, "place")["forms"], "place") for p in places]
        need(not self.places[0], "first place")
        self.real = set()  # of places whose real points all count
        for k, place in enumerate(places):
            self.place(place, k)

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

    def lines(self, pair):
        """Rows and columns of a minor."""
        rows, columns = listed(pair, "minor", 2)
        need(len(listed(rows, "rows")) == len(listed(columns, "columns")), "minor: not square")
        for chosen, count in ((rows, self.a), (columns, self.b)):
            for k in chosen:
                whole(k, 0, count - 1, "minor")
            need(chosen == sorted(set(chosen)), "minor: not in order")
        return rows, columns

    def total(self, terms, forms, what):
        total = self.ring.zero
        for pair in listed(terms, what):
            text, i = listed(pair, what, 2)
            form = forms[whole(i, 0, len(forms) - 1, what)]
            total += self.ring.mul(self.ring.parse(text), form)
        return total

    def family(self, family):
        keys = ["name", "forms", "least_codimension", "pivot", "apart", "multiples"]
        keyed(family, keys, "family")
        name = family["name"]
        need(type(name) is str, "family: no name")
        forms = self.pick(family["forms"], "family")
        where = Together(self.ring, forms)
        matrix = self.put(where.values)
        sums = [self.total(terms, forms, "multiples") for terms in listed(family["multiples"], "")]
        sums = [self.ring.without_units(self.ring.put(p, where.values)) for p in sums]
        apart = [self.ring.put(p, where.values) for p in self.pick(family["apart"], "apart")]
        rows, columns = self.lines(family["pivot"])
        need(len(rows) < self.r, f"family {name}: a large pivot")
        pivot = self.minor(rows, columns, matrix)
        need(all(map(where.apart_from, [pivot, *apart])), f"family {name}: zero on a component")
        for some in combinations(range(self.a), self.r):
            for others in combinations(range(self.b), self.r):
                if set(rows) <= set(some) and set(columns) <= set(others):
                    minor = self.minor(some, others, matrix)
                    for p in apart:
                        minor = self.ring.mul(minor, p)
                    shown = where.vanishes_put(minor, [p for p in sums if p])
                    need(shown, f"family {name}: not singular")
        least = whole(family["least_codimension"], 0, 99, "least_codimension")
        need(where.at_least(least), f"family {name}: a larger component")
        return forms

    def values_of_minor(self, free, place, where, number):
        """Joints at values: the place's, and free ones."""
        values = dict(where.values)
        if listed(free, "free"):
            need(number not in self.real, "free: in a real place")
            need(where.at_least(self.bound), "free: the place may be too large")
            busy = {j for p in place for j in self.ring.joints(p)}
            for p in self.pick(free, "free"):
                linear = where.linear(p)
                need(linear and linear[0] not in busy | set(values), "free: not free")
                values[linear[0]] = linear[1:]
        return values

    def place(self, place, number):
        ring, forms = self.ring, self.places[number]
        where = Together(ring, forms)
        total = self.total(place["of_forms"], forms, "of_forms")
        for item in listed(place["of_minors"], "of_minors"):
            text, lines, free = listed(item, "of_minors", 3)
            rows, columns = self.lines(lines)
            need(len(rows) == self.r, "minor: another size")
            values = self.values_of_minor(free, forms, where, number)
            matrix = self.put(values) if values else self.m
            total += ring.mul(ring.parse(text), self.minor(rows, columns, matrix))
        for item in listed(place["of_resultants"], "of_resultants"):
            text, i, k, j = listed(item, "of_resultants", 4)
            p, q = (forms[whole(m, 0, len(forms) - 1, "resultant")] for m in (i, k))
            whole(j, 0, ring.n - 1, "resultant")
            need(ring.degree(p, j) and ring.degree(q, j), "resultant: a form without the joint")
            total += ring.mul(ring.parse(text), ring.resultant(p, q, j))
        product = ring.one
        for case in listed(place["cases"], "cases"):
            zeros, weights, times, to, k = listed(case, "case", 5)
            parts = self.pick(zeros, "case")
            real = number in self.real
            if listed(weights, "weights"):
                need(len(weights) == len(parts), "weights: not one for each square")
                factor, real = ring.zero, True
                for text, part in zip(weights, parts, strict=True):
                    need(type(text) is str and WEIGHT.fullmatch(text), "weights: not positive")
                    factor += ring.reduced(ring.number(text) * part * part)
            else:
                need(len(parts) == 1, "case: not one form")
                factor = parts[0]
            for _ in range(whole(times, 0, 99, "times")):
                product = ring.without_units(ring.mul(product, factor))
            self.leads(number, [*forms, *parts], real, to, k)
        need(ring.without_units(total) == product, f"place {number}: another form")

    def leads(self, number, forms, real, to, k):
        together = Together(self.ring, forms)
        whole(k, -(10**9), 10**9, "case")
        if to == "nowhere":
            # Of points there is none where the codimension is more than all joints.
            least = (self.ring.n if real else self.bound) + 1
            need(together.at_least(least), f"place {number}: a case that is somewhere")
            return
        need(to in ("family", "place"), f"place {number}: a case that leads to nothing")
        if to == "place":
            whole(k, number + 1, len(self.places) - 1, "a place that is not later")
            target = self.places[k]
            if real:
                self.real.add(k)
        else:
            target = self.families[whole(k, 0, len(self.families) - 1, "family")]
        need(all(together.vanishes(f) for f in target), f"place {number}: not in {to} {k}")


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
