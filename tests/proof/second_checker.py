"""A second checker of certificates, written from docs/proof.md alone.

It shares no line with ``pinsing.proof.checker`` and imports nothing of pinsing: what both accept
does not rest on a slip of one of them. Where the page leaves a choice, such as which integers to
try, it takes its own. It looks for clarity first and speed second.
"""

import json
import re
from itertools import combinations

from flint import Ordering, fmpq, fmpq_mpoly_ctx

NUMBER = "[1-9][0-9]{0,399}"
WEIGHT = re.compile(f"{NUMBER}(/{NUMBER})?")
TERM = re.compile(rf"(-?[0-9]{{1,400}}(?:/{NUMBER})?)((?:[xys][0-9]+(?:\^[1-9][0-9]?)?)*)")
POWER = re.compile(r"([xys][0-9]+)(?:\^([0-9]+))?")

# The tables of the page: a tuple is a list of just these, a list holds any number of its one entry.
SUM, MINOR, STEPS = [(str, int)], ([int], [int]), [(int, int, str)]
PLACEMENT = {"rotation": ((str,) * 3,) * 3, "translation": (str,) * 3}
FAMILY = {"name": str, "forms": [int], "least_codimension": int}
FAMILY |= {"pivot": MINOR, "apart": [int], "multiples": [SUM]}
PLACE = {"forms": [int], "of_forms": SUM, "of_minors": [(str, MINOR, [int])]}
PLACE |= {"of_resultants": [(str, int, int, int)], "cases": [([int], [str], int, str, int)]}
FORMAT = {
    **dict.fromkeys(("schema", "robot", "base", "tip_frame", "task"), str),
    "joints": [{"name": str, "kind": str}],
    "square_roots": [int],
    "chain": [{**PLACEMENT, "joint": int, "multiple": str}],
    "tip": PLACEMENT,
    "rows": [int],
    "axes": int,
    "row_steps": STEPS,
    "column_steps": STEPS,
    "rank": int,
    "polynomials": [str],
    "families": [FAMILY],
    "places": [PLACE],
}


class No(Exception):
    """The certificate is not accepted, and why."""


def need(condition, why):
    if not condition:
        raise No(why)


def entry(items, k, what):
    """Entry k, counted from 0."""
    need(0 <= k < len(items), f"{what}: no entry {k}")
    return items[k]


def need_format(value, pattern, what):
    """Of the types and the keys of a pattern: never a text for a list, nor true for 1."""
    if isinstance(pattern, type):
        need(type(value) is pattern, f"{what}: another type")
    elif type(pattern) is dict:
        need(type(value) is dict and set(value) == set(pattern), f"{what}: other keys")
        for key in pattern:
            need_format(value[key], pattern[key], key)
    else:
        need(type(value) is list, f"{what}: no list")
        each = pattern * len(value) if type(pattern) is list else pattern
        need(len(value) == len(each), f"{what}: another length")
        for item, of in zip(value, each, strict=True):
            need_format(item, of, what)


# Polynomials over K = Q(square roots): those of Q[x, y, s], with s reduced --------------------


class Ring:
    """K[x1, y1, x2, y2, ...], and the units of the joints."""

    def __init__(self, kinds, roots):
        self.n, self.roots = len(kinds), roots
        names = [f"{letter}{j + 1}" for j in range(self.n) for letter in "xy"]
        self.names = [*names, *(f"s{root}" for root in roots)]
        inverses = [f"w{j + 1}" for j in range(self.n)]  # of the units, while the matrix is made
        ctx = fmpq_mpoly_ctx.get([*self.names, *inverses], Ordering.lex)
        self.gens = ctx.gens()
        self.x, self.y = self.gens[0 : 2 * self.n : 2], self.gens[1 : 2 * self.n : 2]
        self.s, self.w = self.gens[2 * self.n : len(self.names)], self.gens[len(self.names) :]
        self.zero, self.one = ctx.constant(0), ctx.constant(1)
        self.units = [
            x * x + y * y if kind == "revolute" else x
            for kind, x, y in zip(kinds, self.x, self.y, strict=True)
        ]

    def reduced(self, p):
        for s, square in zip(self.s, self.roots, strict=True):
            p = divmod(p, s * s - square)[1]
        return p

    def mul(self, *factors):
        product = self.one
        for p in factors:
            product = self.reduced(product * p)
        return product

    def parse(self, text):
        """A form or a number from its text."""
        numbers, products = [], []
        for term in text.split(" "):
            match = TERM.fullmatch(term)
            need(match, f"no term: {term!r}")
            numbers.append(fmpq(match[1]))
            products.append(self.one)
            for name, power in POWER.findall(match[2]):
                gen = self.names.index(name) if name in self.names else -1
                products[-1] *= entry(self.gens, gen, name) ** int(power or 1)
        for j, x in enumerate(self.x):
            degrees = [self.degree(p, j) for p in products]
            lacking = [max(degrees) - degree for degree in degrees]
            products = [p * x**power for p, power in zip(products, lacking, strict=True)]
        terms = (c * p for c, p in zip(numbers, products, strict=True))
        return self.reduced(sum(terms, self.zero))

    def number(self, text):
        p = self.parse(text)
        need(not self.joints(p), f"not a number: {text!r}")
        return p

    def degree(self, form, j):
        """In x_j and y_j together: all terms have the same."""
        return sum(form.monomial(0)[2 * j : 2 * j + 2]) if form else 0

    def degrees(self, form):
        return [self.degree(form, j) for j in range(self.n)]

    def joints(self, form):
        return [j for j, degree in enumerate(self.degrees(form)) if degree]

    def without_units(self, *forms):
        """Forms without the units that all of them have."""
        for unit in self.units:
            while any(forms) and not any(divmod(p, unit)[1] for p in forms):
                forms = [divmod(p, unit)[0] for p in forms]
        return list(forms)

    def put(self, p, values):
        """P with joints at values {j: (x, y)}."""
        images = list(self.gens)
        for j, point in values.items():
            images[2 * j : 2 * j + 2] = point
        return self.reduced(p.compose(*images)) if values else p

    def divides(self, p, f):
        return not self.reduced(divmod(f, p)[1])

    def resultant(self, p, q, j):
        """Of two forms with respect to joint j; zero at x = 0 as well if both are.

        0, which tells nothing, where it would take long.
        """
        size = self.degree(p, j) + self.degree(q, j)
        if len(p) * len(q) * size > 10_000:
            return self.zero
        x, y = f"x{j + 1}", f"y{j + 1}"
        result = p.subs({x: 1}).resultant(q.subs({x: 1}), y)
        for form, other in ((p, q), (q, p)):
            if not form.subs({x: 0}):
                result *= other.subs({x: 0, y: 1})
        return self.reduced(result)


# Forms that vanish together --------------------------------------------------------------


class Together:
    """Forms, simplified: joints at values, and forms in the others."""

    def __init__(self, ring, forms):
        self.ring, self.values = ring, {}
        self.forms = self.clean(forms)
        while values := list(filter(None, map(self.value, self.forms))):
            self.values |= values[0]
            self.forms = self.clean(self.forms)
        self.nowhere = any(not ring.joints(f) for f in self.forms)

    def clean(self, forms):
        return [f for f in map(self.put, forms) if f]

    def value(self, f):
        """{j: (b, -a)} if f is a x_j + b y_j."""
        joints = self.ring.joints(f)
        if len(joints) != 1 or self.ring.degree(f, joints[0]) != 1:
            return {}
        (j,) = joints
        return {j: (f.derivative(2 * j + 1), -f.derivative(2 * j))}

    def put(self, f):
        """The form at the values, without units."""
        return self.ring.without_units(self.ring.put(f, self.values))[0]

    def vanishes(self, f, more=()):
        """True if f is shown to vanish where these forms, and more of them, do."""
        f = self.put(f)
        return not f or any(self.ring.divides(p, f) for p in [*self.forms, *more])

    def apart_from(self, f):
        """True if f is shown to vanish on no component."""
        return Together(self.ring, [*self.forms, self.put(f)]).at_least(len(self.forms) + 1)

    def at_least(self, c):
        """True if each component is shown to have codimension c or more."""
        c -= len(self.values)
        if self.nowhere or c <= 0:
            return True
        return self.missing(c, self.forms) or self.missing(c, [*self.forms, *self.eliminated()])

    def eliminated(self):
        """Resultants of all pairs in all joints of both, units out: zero on components, too."""
        found = [
            self.ring.without_units(self.ring.resultant(p, q, j))[0]
            for p, q in combinations(self.forms, 2)
            for j in set(self.ring.joints(p)) & set(self.ring.joints(q))
        ]
        return [r for r in found if r]

    def missing(self, c, forms):
        """For any c - 1 joints: no common zero at some values of the others."""
        joints = sorted({j for f in forms for j in self.ring.joints(f)})
        return all(
            any(self.none_at(seed, forms, kept, set(joints) - set(kept)) for seed in (1, 2, 3))
            for kept in combinations(joints, min(c - 1, len(joints)))
        )

    def none_at(self, seed, forms, kept, others):
        """No common zero with these other joints at integers."""
        ring = self.ring
        integers = [seed * 7 + 5 * k * k + 3 * k + 2 for k in range(len(others))]
        point = {j: (ring.one, i * ring.one) for j, i in zip(sorted(others), integers, strict=True)}
        return self.no_zero([ring.put(f, point) for f in forms], kept)

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
        p = divmod(p, w * unit - 1)[1]
    return p


def flipped(matrix):
    return [list(column) for column in zip(*matrix, strict=True)]


def identity(ring, n):
    return [[ring.one if i == k else ring.zero for k in range(n)] for i in range(n)]


def product(ring, a, b):
    def dot(row, column):
        return sum((f * g for f, g in zip(row, column, strict=True)), ring.zero)

    return [[settled(ring, dot(row, column)) for column in flipped(b)] for row in a]


def cross(a, b):
    return [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]


def determinant(ring, square):
    """By expansion along rows, from the last one; minors of the rows so far by their columns."""
    every = range(len(square))
    minors = {(): ring.one}
    for size, row in enumerate(reversed(square), 1):
        of_less, minors = minors, {}
        for columns in combinations(every, size):
            total = ring.zero
            for k, c in enumerate(columns):
                total += (-1) ** k * row[c] * of_less[columns[:k] + columns[k + 1 :]]
            minors[columns] = ring.reduced(total)
    return minors[tuple(every)]


def placement_of(ring, item):
    """Of a link or the tip, 4 by 4."""
    r = [[ring.number(text) for text in row] for row in item["rotation"]]
    need(product(ring, r, flipped(r)) == identity(ring, 3), "rotation: not one")
    need(determinant(ring, r) == ring.one, "rotation: a mirror image")
    t = [ring.number(text) for text in item["translation"]]
    return [*([*row, p] for row, p in zip(r, t, strict=True)), [ring.zero] * 3 + [ring.one]]


def inverse(ring, placement):
    turn = flipped(row[:3] for row in placement[:3])
    back = product(ring, turn, [row[3:] for row in placement[:3]])
    return [*([*row, -p] for row, (p,) in zip(turn, back, strict=True)), placement[3]]


def motion_of(ring, kind, j, text):
    """Of a multiple of joint j, 4 by 4."""
    zero, one, x, y, w = ring.zero, ring.one, ring.x[j], ring.y[j], ring.w[j]
    cos, sin, slide = one, zero, ring.number(text) * y * w
    if kind == "revolute":
        need(re.fullmatch(r"-?[0-6]", text), "multiple: not whole, or above 6")
        m, slide = int(text), zero
        c, s = (x * x - y * y) * w, (2 if m > 0 else -2) * x * y * w
        for _ in range(abs(m)):
            cos, sin = settled(ring, cos * c - sin * s), settled(ring, sin * c + cos * s)
    turn = [cos, -sin, zero, zero], [sin, cos, zero, zero]
    return [*turn, [zero, zero, one, slide], [zero, zero, zero, one]]


def matrix_of(data, ring, kinds):
    """M before the steps, from the placements."""
    chain, rows, a = data["chain"], data["rows"], data["axes"]
    need(len(chain) <= 16, "chain: too long")
    moves = []
    for link in chain:
        kind = entry(kinds, link["joint"], "joint")
        motion = motion_of(ring, kind, link["joint"], link["multiple"])
        moves.append(product(ring, placement_of(ring, link), motion))
    moves.append(placement_of(ring, data["tip"]))
    need(rows == sorted(set(rows)) and set(rows) <= set(range(6)), "rows: not in order")
    free = rows in ([0, 1, 2], [3, 4, 5], [0, 1, 2, 3, 4, 5])
    need(a in (range(len(moves) + 1) if free else (0, len(moves))), "axes: not for such rows")
    frames = {a: identity(ring, 4)}
    for i in range(a, len(moves)):
        frames[i + 1] = product(ring, frames[i], moves[i])
    for i in range(a, 0, -1):
        frames[i - 1] = product(ring, frames[i], inverse(ring, moves[i - 1]))
    point = [row[3] for row in frames[a if len(rows) == 6 else len(moves)][:3]]
    columns = [[ring.zero] * 6 for _ in kinds]
    for i, link in enumerate(chain, 1):
        j, multiple = link["joint"], ring.number(link["multiple"])
        axis, origin = ([row[k] for row in frames[i][:3]] for k in (2, 3))
        arm = [p - o for p, o in zip(point, origin, strict=True)]
        screw = cross(axis, arm) + axis if kinds[j] == "revolute" else axis + [ring.zero] * 3
        columns[j] = [f + multiple * g for f, g in zip(columns[j], screw, strict=True)]
    lines = [forms_of(ring, [column[k] for k in rows]) for column in columns]
    return [ring.without_units(*row) for row in flipped(lines)]


def forms_of(ring, line):
    """Times the units that are divided by, and without those that all have."""
    line = [settled(ring, p) for p in line]
    for w, unit in enumerate(ring.units, len(ring.names)):
        top = max((p.degrees()[w] for p in line if p), default=0)
        line = [settled(ring, p * unit**top) for p in line]
    return ring.without_units(*line)


def stepped(matrix, steps, ring):
    """The rows of the matrix after the steps, without those that are zero."""
    matrix = list(matrix)
    for i, k, text in steps:
        line, other = entry(matrix, i, "step"), entry(matrix, k, "step")
        need(i != k, "step: a line and itself")
        pairs = list(zip(line, other, strict=True))
        alike = any(p and f and ring.degrees(p) == ring.degrees(f) for p, f in pairs)
        need(alike, "step: lines of different degrees")
        matrix[i] = [ring.reduced(p - ring.number(text) * f) for p, f in pairs]
    return [row for row in matrix if any(row)]


# The check ----------------------------------------------------------------------------------


class Check:
    """One certificate."""

    def __init__(self, text):
        need(len(text) <= 4_000_000, "too long")
        data = self.data = read(text)
        need_format(data, FORMAT, "certificate")
        need(data["schema"] == "pinsing/certificate/3", "another schema")
        kinds, roots = [joint["kind"] for joint in data["joints"]], data["square_roots"]
        need(len(kinds) <= 16 and set(kinds) <= {"revolute", "prismatic"}, "joints: not such")
        need(roots in ([], [2], [3], [2, 3]), "square_roots: not such")
        ring = self.ring = Ring(kinds, roots)
        columns = flipped(stepped(matrix_of(data, ring, kinds), data["row_steps"], ring))
        self.m = flipped(stepped(columns, data["column_steps"], ring))
        self.sides = [range(len(lines)) for lines in (self.m, flipped(self.m))]
        self.r = data["rank"]
        need(1 <= self.r <= min(map(len, self.sides)), "rank: none")
        self.bound = (len(self.sides[0]) - self.r + 1) * (len(self.sides[1]) - self.r + 1)
        self.polynomials = [ring.parse(text) for text in data["polynomials"]]

    def run(self):
        ring = self.ring
        point = {j: (ring.one, (3 * j * j + 2 * j + 5) * ring.one) for j in range(ring.n)}
        need(any(self.minors(self.r, self.put(point))), "rank: not so large at a point")
        need(not any(self.minors(self.r + 1, self.m)), "rank: larger")
        self.families = [self.family(family) for family in self.data["families"]]
        self.places = [self.pick(place["forms"]) for place in self.data["places"]]
        need(self.places and not self.places[0], "first place")
        self.real = set()  # of places whose real points all count
        for number, place in enumerate(self.data["places"]):
            self.place(place, number)

    def pick(self, indices):
        return [entry(self.polynomials, k, "polynomials") for k in indices]

    def put(self, values):
        return [[self.ring.put(p, values) for p in row] for row in self.m]

    def minor(self, rows, columns, matrix):
        return determinant(self.ring, [[matrix[i][k] for k in columns] for i in rows])

    def minors(self, size, matrix, within=((), ())):
        """All of a size that have some rows and columns."""
        for rows in combinations(self.sides[0], size):
            for columns in combinations(self.sides[1], size):
                if set(within[0]) <= set(rows) and set(within[1]) <= set(columns):
                    yield self.minor(rows, columns, matrix)

    def lines(self, pair):
        """Rows and columns of a minor."""
        need(len(pair[0]) == len(pair[1]), "minor: not square")
        for chosen, side in zip(pair, self.sides, strict=True):
            need(chosen == sorted(set(chosen) & set(side)), "minor: not in order")
        return pair

    def total(self, terms, forms):
        products = (
            self.ring.mul(self.ring.parse(text), entry(forms, i, "forms")) for text, i in terms
        )
        return sum(products, self.ring.zero)

    def family(self, family):
        name, forms = family["name"], self.pick(family["forms"])
        where = Together(self.ring, forms)
        matrix = self.put(where.values)
        sums = [where.put(self.total(terms, forms)) for terms in family["multiples"]]
        apart = [self.ring.put(p, where.values) for p in self.pick(family["apart"])]
        pivot = self.lines(family["pivot"])
        need(len(pivot[0]) < self.r, f"family {name}: a large pivot")
        for form in (self.minor(*pivot, matrix), *apart):
            need(where.apart_from(form), f"family {name}: zero on a component")
        for minor in self.minors(self.r, matrix, pivot):
            shown = where.vanishes(self.ring.mul(minor, *apart), filter(None, sums))
            need(shown, f"family {name}: not singular")
        need(where.at_least(family["least_codimension"]), f"family {name}: a larger component")
        return forms

    def place(self, place, number):
        ring, forms = self.ring, self.places[number]
        where = Together(ring, forms)
        total = self.total(place["of_forms"], forms)
        for text, lines, free in place["of_minors"]:
            rows, columns = self.lines(lines)
            need(len(rows) == self.r, "minor: another size")
            values = where.values | self.free_values(free, forms, where, number)
            total += ring.mul(ring.parse(text), self.minor(rows, columns, self.put(values)))
        for text, i, k, j in place["of_resultants"]:
            p, q = (entry(forms, m, "resultant") for m in (i, k))
            both = set(ring.joints(p)) & set(ring.joints(q))
            need(j in both, "resultant: a form without the joint")
            total += ring.mul(ring.parse(text), ring.resultant(p, q, j))
        product = ring.one
        for zeros, weights, times, to, k in place["cases"]:
            parts = self.pick(zeros)
            need(len(parts) == (len(weights) or 1), "case: neither one form nor weighted squares")
            need(all(map(WEIGHT.fullmatch, weights)), "weights: not positive")
            squares = [
                ring.mul(ring.number(text), part, part)
                for text, part in zip(weights, parts, strict=False)
            ]
            factor = sum(squares, ring.zero) if weights else parts[0]
            need(0 <= times <= 99, "times: none")
            (product,) = ring.without_units(ring.mul(product, *[factor] * times))
            real = bool(weights) or number in self.real
            self.leads(number, Together(ring, [*forms, *parts]), real, to, k)
        need(ring.without_units(total) == [product], f"place {number}: another form")

    def free_values(self, free, forms, where, number):
        """Joints that the forms of a place leave free, at values."""
        values = Together(self.ring, self.pick(free))
        busy = {j for p in forms for j in self.ring.joints(p)}
        need(not values.forms and not busy & set(values.values), "free: not free")
        if free:
            need(number not in self.real, "free: in a real place")
            need(where.at_least(self.bound), "free: the place may be too large")
        return values.values

    def leads(self, number, together, real, to, k):
        if to == "nowhere":
            # Of points there is none where the codimension is more than all joints.
            least = (self.ring.n if real else self.bound) + 1
            need(together.at_least(least), f"place {number}: a case that is somewhere")
            return
        need(to in ("family", "place"), f"place {number}: a case that leads to nothing")
        if to == "place":
            need(k > number, f"place {number}: leads to one that is not later")
            if real:
                self.real.add(k)
        target = entry(self.families if to == "family" else self.places, k, to)
        need(all(together.vanishes(f) for f in target), f"place {number}: not in {to} {k}")


def read(text):
    def unique(pairs):
        need(len(dict(pairs)) == len(pairs), "a key twice")
        return dict(pairs)

    try:
        return json.loads(text, object_pairs_hook=unique)
    except (ValueError, RecursionError) as error:
        raise No(f"no JSON: {error}") from error


def second_verdict(text):
    """Empty if the certificate is accepted, or what is wrong with it."""
    try:
        Check(text).run()
    except No as reason:
        return str(reason) or "no"
    return ""
