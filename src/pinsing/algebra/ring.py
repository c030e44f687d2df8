"""The polynomial ring of an arm: homogeneous half-angle coordinates over the rationals.

A revolute joint has two variables x, y with ``cos = (x^2 - y^2) / w``, ``sin = 2 x y / w``,
``w = x^2 + y^2``, so that its angle is 2 atan2(y, x) and pi is as good a point as any other.
A prismatic joint has one variable, its value in metres.

Where the arm has twists of 15 degrees or its multiples, the coefficients have square roots of 2
and 3. Each root is one more variable of flint's ring, after the joints' variables in the
lexicographic order, with its relation s^2 = 2 or 3. A polynomial whose leading coefficient is
1 then divides others by flint's own division, with the roots along as coefficients.

Flint neither factors such polynomials nor takes their gcd. The gcd is taken modulo a prime at
which 2 and 3 are squares, and its coefficients are traced back to the smallest numbers
a + b sqrt(2) + ... that have these residues, by a reduced lattice basis (Lenstra, Lenstra and
Lovasz, 1982); division has the last word. Factors come from those of the norm, one root at a
time (Trager, 1976).
"""

from __future__ import annotations

import copyreg
import functools
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from flint import (
    Ordering,
    fmpq,
    fmpq_mpoly,
    fmpq_mpoly_ctx,
    fmpz_mat,
    fmpz_mod_mpoly_ctx,
    nmod_mpoly_ctx,
)

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.robot.nominal import PRIMES
from pinsing.robot.surd import SQUARES, Exact, Surd, parts_of, residue, root_modulo, roots_of, surd


def terms_of(poly: Any) -> dict[Any, Any]:
    """Exponents, and coefficients as flint has them: what ``poly.to_dict()`` tells."""
    return dict(zip(poly.monoms(), poly.coeffs(), strict=True))


def _packed(poly: Any) -> tuple[Any, ...]:
    """What another process makes a polynomial of."""
    context = poly.context()
    return _unpacked, (context.names(), context.ordering(), terms_of(poly))


def _unpacked(names: Sequence[str], order: Ordering, terms: dict[Any, Any]) -> Any:
    return fmpq_mpoly_ctx.get(names, order).from_dict(terms)


copyreg.pickle(fmpq_mpoly, _packed)


def whole_terms(poly: Any) -> dict[Any, int]:
    """Exponents, and coefficients times the least number that makes them whole."""
    terms = terms_of(poly)
    scale = math.lcm(*(int(c.q) for c in terms.values()))
    return {m: int(c.p) * (scale // int(c.q)) for m, c in terms.items()}


def coefficients_by(poly: Any, variables: Sequence[int]) -> dict[tuple[int, ...], Any]:
    """Return what each product of powers of some variables is multiplied by, by their exponents."""
    parts: dict[tuple[int, ...], dict[tuple[int, ...], Any]] = {}
    for m, c in terms_of(poly).items():
        rest = [0 if v in variables else int(e) for v, e in enumerate(m)]
        parts.setdefault(tuple(int(m[v]) for v in variables), {})[tuple(rest)] = c
    return {powers: poly.context().from_dict(terms) for powers, terms in parts.items()}


def line_of(terms: Mapping[Any, Any], variable: int) -> list[int]:
    """Whole coefficients of a polynomial in one variable, or of a form in two; the lowest first."""
    powers = {int(m[variable]): int(c) for m, c in terms.items()}
    return [powers.get(k, 0) for k in range(max(powers) + 1)]


def divided_by(poly: Any, factor: Any) -> Any:
    """Divide by a factor, which is no constant, as often as it goes."""
    while poly != 0:
        quotient, rest = divmod(poly, factor)
        if rest != 0:
            break
        poly = quotient
    return poly


class MadeOnce(dict[int, tuple[Any, Any]]):
    """What was made of objects, once of each; these are kept, so that their ids stay their own."""

    def of(self, given: Any, make: Callable[[Any], Any]) -> Any:
        """Return what was made of an object."""
        if id(given) not in self:
            self[id(given)] = given, make(given)
        return self[id(given)][1]


class MadeOfEqual(dict[object, list[tuple[Any, Any]]]):
    """What was made of polynomials, once of equal ones: these are found by size and degrees."""

    def of(self, poly: Any, make: Callable[[Any], Any]) -> Any:
        """Return what was made of a polynomial."""
        alike = self.setdefault((len(poly), poly.degrees()), [])
        for other, made in alike:
            if other == poly:
                return made
        alike.append((poly, make(poly)))
        return alike[-1][1]


Poly = Any  # fmpq_mpoly; python-flint ships no types
Matrix = list[list[Poly]]
Monomial = tuple[int, ...]
Value = tuple[Exact, ...]
"""Exact value of a joint: (x, y) of a revolute one, (metres,) of a prismatic one."""


def rational(value: Fraction | int) -> Any:
    """Flint's rational for a Fraction or an int."""
    if type(value) is not Fraction:  # making a Fraction of one takes longer than all the rest
        value = Fraction(value)
    return fmpq(value.numerator, value.denominator)


def fraction(value: Any) -> Fraction:
    """Fraction of a flint rational."""
    value = fmpq(value)
    return Fraction(int(value.p), int(value.q))


_EXPONENTS = (276, 534, 2208, 2816)
"""3 * 2^k + 1 is prime for these k, and 2 and 3 are squares modulo it."""
_SPARE_BITS = 40


_ENDLESS = Budget(math.inf)


@dataclass(frozen=True)
class Ring:
    """Variables of one chain."""

    context: Any  # flint's ring
    prismatic: tuple[bool, ...]  # one entry a joint
    start: tuple[int, ...]  # index of each joint's first variable
    w: tuple[Poly | None, ...]  # x^2 + y^2 of each revolute joint
    # what square roots among the coefficients are of, (2,), (3,) or (2, 3): flint's last variables
    roots: tuple[int, ...] = ()
    # asked within factors and divisors of polynomials with roots, which can be long
    time: Budget = field(default=_ENDLESS, compare=False, repr=False)
    # factors of the polynomials that were asked for before
    known: MadeOfEqual = field(default_factory=MadeOfEqual, init=False, compare=False, repr=False)
    # polynomials of joints at values that were asked for before
    fixed: dict[tuple[int, Value], Poly] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )

    nvars: int = field(init=False, compare=False)  # number of the joints' variables
    zero: Poly = field(init=False, compare=False, repr=False)
    one: Poly = field(init=False, compare=False, repr=False)
    rational: bool = field(init=False, compare=False)  # whether all coefficients are rational

    def __post_init__(self) -> None:
        constant = self.context.constant
        nvars = sum(1 if slides else 2 for slides in self.prismatic)
        known = {"nvars": nvars, "zero": constant(0), "one": constant(1)}
        self.__dict__.update(known, rational=not self.roots)

    def number(self, value: Exact | int) -> Poly:
        """A constant of the ring."""
        if not isinstance(value, Surd):
            return self.context.constant(rational(value))
        return self._poly({(0,) * self.nvars: value})

    def reduce(self, poly: Poly) -> Poly:
        """The unique form of an element that products came to: roots to the power of one."""
        if self.roots:
            gens = self.context.gens()[self.nvars :]
            for s, d, degree in zip(gens, self.roots, poly.degrees()[self.nvars :], strict=True):
                if degree > 1:
                    poly = divmod(poly, s * s - d)[1]
        return poly

    def variables(self, joint: int) -> tuple[int, ...]:
        """Indices of a joint's variables."""
        first = self.start[joint]
        return (first,) if self.prismatic[joint] else (first, first + 1)

    def joints_of(self, poly: Poly) -> tuple[int, ...]:
        """Joints whose variables occur in ``poly``."""
        degrees = poly.degrees()
        return tuple(
            [
                j
                for j, (v, slides) in enumerate(zip(self.start, self.prismatic, strict=True))
                if degrees[v] or (not slides and degrees[v + 1])
            ]
        )

    def terms(self, poly: Poly) -> dict[Monomial, Exact]:
        """Exponents of the joints' variables, and coefficients."""
        if self.rational:
            return {tuple(int(e) for e in m): fraction(c) for m, c in terms_of(poly).items()}
        gathered: dict[Monomial, list[Fraction]] = {}
        nvars, zero = self.nvars, Fraction(0)
        for m, c in terms_of(poly).items():
            square = math.prod(d for d, e in zip(self.roots, m[nvars:], strict=True) if e)
            parts = gathered.setdefault(tuple(map(int, m[:nvars])), [zero] * 4)
            parts[SQUARES.index(square)] = fraction(c)
        return {m: surd(*parts) for m, parts in gathered.items()}

    def is_constant(self, poly: Poly) -> bool:
        """Return True if no joint occurs."""
        if self.rational:
            return bool(poly.is_constant())
        return all(d <= 0 for d in poly.degrees()[: self.nvars])

    def putting(self, values: Mapping[int, Value]) -> Callable[[Poly], Poly]:
        """Return what puts exact joint values into one polynomial after the other."""
        given = {
            v: x
            for j, value in values.items()
            for v, x in zip(self.variables(j), value, strict=True)
        }
        names, images = self.context.names(), list(self.context.gens())
        roots = any(isinstance(x, Surd) for x in given.values())
        if roots:
            for v, x in given.items():
                images[v] = self.number(x)
        named = {names[v]: rational(x) for v, x in given.items() if not isinstance(x, Surd)}

        def put(poly: Poly) -> Poly:
            degrees = poly.degrees()
            if not any(degrees[v] > 0 for v in given):
                return poly
            return (
                self.reduce(poly.compose(*images, ctx=self.context)) if roots else poly.subs(named)
            )

        return put

    def nowhere_zero(self, poly: Poly) -> bool:
        """Return True if a polynomial is a nonzero constant times x^2 + y^2 of joints."""
        return self.is_constant(self.strip(poly))

    def coefficients(self, poly: Poly) -> Mapping[Monomial, Any]:
        """Exponents of the joints' variables, and coefficients that can be divided."""
        return terms_of(poly) if self.rational else self.terms(poly)

    def divides(self, p: Poly, poly: Poly) -> bool:
        """Return True if ``poly`` is a multiple of ``p``, one of the ``factors`` of something."""
        return bool(self.reduce(divmod(poly, p)[1]) == 0)

    def quotient(self, poly: Poly, p: Poly) -> Poly:
        """``poly`` over ``p``, which divides it and came from ``factors`` or ``gcd``."""
        return self.reduce(divmod(poly, p)[0])

    def monic(self, poly: Poly) -> Poly:
        """The multiple with a leading coefficient of 1; zero stays."""
        terms = self.terms(poly)
        if not terms:
            return poly
        lead = terms[max(terms)]
        return poly if lead == 1 else self.reduce(poly * self.number(1 / lead))

    def gcd(self, p: Poly, g: Poly) -> Poly:
        """Greatest common divisor; with roots its leading coefficient is 1."""
        if self.rational:
            return p.gcd(g)
        if p == 0 or g == 0:
            return self.monic(p + g)
        if self.is_constant(p) or self.is_constant(g):
            return self.one
        of_p, of_g = self._tangents(p), self._tangents(g)
        if of_p is not None and of_g is not None:
            degrees = zip(p.degrees(), g.degrees(), strict=True)
            tangents = [x for x, d in enumerate(degrees) if x in {*of_p, *of_g} and any(d)]
            if tangents:  # powers of x are lost at x = 1, and those of y are not
                contents = zip(p.term_content().degrees(), g.term_content().degrees(), strict=True)
                powers = [min(c) if x in tangents else 0 for x, c in enumerate(contents)]
                # Flint's gcd of forms modulo a prime may not end where that of the same in half-
                # angle tangents takes less than a millisecond.
                at = {self.context.names()[x]: 1 for x in tangents}
                found = self._form(self.gcd(p.subs(at), g.subs(at)), tangents)
                return self.monic(found * self.context.term(exp_vec=powers))
        p, g = self.monic(p), self.monic(g)
        if not any(p.degrees()[self.nvars :]) and not any(g.degrees()[self.nvars :]):
            return self.monic(p.gcd(g))
        # Terms from which on a gcd may take long: one of two polynomials of 150 took minutes.
        self.time.check_factor(max(len(p), len(g)), 60)
        if image(p, self, WORD_PRIME).gcd(image(g, self, WORD_PRIME)).is_constant():
            return self.one
        # The known primes up to the first that is long enough: mostly a short one will do.
        needed = min(self._bits_needed(p), self._bits_needed(g))
        for k in _EXPONENTS:
            self.time.check()
            prime = 3 * 2**k + 1
            found = self._lift(image(p, self, prime).gcd(image(g, self, prime)), prime)
            if found is not None and self.divides(found, p) and self.divides(found, g):
                return found
            if k >= needed:
                break
        raise BudgetExceeded("a polynomial with square roots in it has too long coefficients")

    def resultant(self, p: Poly, g: Poly, variable: int) -> Poly:
        """Resultant with respect to a variable."""
        return self.reduce(p.resultant(g, self.context.names()[variable]))

    def eliminated(self, p: Poly, g: Poly, joint: int) -> Poly:
        """Resultant of two forms in the variables of one joint."""
        variables = self.variables(joint)
        if len(variables) == 2:
            put = {self.context.names()[variables[0]]: 1}
            p, g = p.subs(put), g.subs(put)
        return self.resultant(p, g, variables[-1])

    def strip(self, poly: Poly) -> Poly:
        """Divide out every x^2 + y^2, which no real angle makes zero."""
        return self.stripped([poly])[0]

    def stripped(self, line: Sequence[Poly]) -> list[Poly]:
        """Divide out every x^2 + y^2 that all of some polynomials share."""
        line, filled = list(line), [x for x in line if x]
        if not filled or min(map(len, filled)) == 1:  # a multiple has two terms at least
            return line
        degrees = [x.degrees() for x in filled]
        for j, w in enumerate(self.w):
            # Only what has both squares can be a multiple.
            if w is None or any(d[v] < 2 for v in self.variables(j) for d in degrees):
                continue
            parts = [divmod(x, w) for x in line]
            while all(r == 0 for _, r in parts):
                line = [q for q, _ in parts]
                parts = [divmod(x, w) for x in line]
        return line

    def factors(self, poly: Poly, time: Budget | None = None) -> list[Poly]:
        """Irreducible factors, without multiplicity and without any x^2 + y^2.

        BudgetExceeded where there is a ``time``, and none for them.
        """
        if time is not None:
            time.check_factor(len(poly), self.long_to_factor(poly))
        return list(self.known.of(poly, self._factors))

    def long_to_factor(self, poly: Poly) -> int | None:
        """Return terms from which on a polynomial may take long to factor; None: as a budget says.

        Low degrees in few joints bound what it can take: some 15 ms for a thousand terms.
        """
        if self.roots:
            return None
        degrees = poly.degrees()
        joints = zip(self.start, self.prismatic, strict=True)
        size = math.prod(degrees[v if slides else v + 1] + 1 for v, slides in joints)
        # Terms that a polynomial of some degrees can have in half-angle tangents, and has: up to so
        # many it is factored in milliseconds.
        return 1_000 if size <= 1_500 else None

    def _factors(self, poly: Poly) -> list[Poly]:
        """See ``factors``."""
        poly = poly if self.rational else self.strip(poly)
        forms = None if self.rational else self._of_form(poly)
        found = self._irreducible(poly) if forms is None else forms
        found = found if self.rational else list(map(self.monic, found))
        return [f for f in found if not any(w is not None and f == w for w in self.w)]

    def fixing(self, joint: int, value: Value) -> Poly:
        """The polynomial that is zero where a joint is at an exact value, and nowhere else."""
        if (joint, value) not in self.fixed:
            gens = (self.context.gens()[v] for v in self.variables(joint))
            x, y, *_ = (*gens, self.one)  # a length is one over one
            first, second, *_ = map(self.number, (*value, 1))
            self.fixed[joint, value] = x * second - y * first
        return self.fixed[joint, value]

    def joint_value(self, poly: Poly) -> tuple[int, Value] | None:
        """The exact value that ``poly`` = 0 fixes one joint at, if it does just that."""
        # Terms that a polynomial over the rationals has at most that fixes a joint's value.
        if self.rational and len(poly) > 2:
            return None
        joints = self.joints_of(poly)
        if len(joints) != 1 or poly.total_degree() > 1 + len(self.roots):
            return None
        terms = self.terms(poly)
        if max(map(sum, terms)) != 1:
            return None
        j, zero = joints[0], Fraction(0)
        by = {m.index(1) if any(m) else None: c for m, c in terms.items()}
        first, *second = (by.get(v, zero) for v in self.variables(j))
        if not second:
            return j, (-by.get(None, zero) / first,)
        x, y = *second, -first
        # Canonical representative, so that equal values compare equal.
        lead = x or y
        return j, (x / lead, y / lead)

    # Square roots ----------------------------------------------------------------------

    def _irreducible(self, poly: Poly) -> list[Poly]:
        """Irreducible factors of any polynomial, over the field of the roots."""
        if self.rational:
            return [f for f, _ in poly.factor()[1]]
        found: list[Poly] = []
        for f in self._factor(self.monic(poly), len(self.roots)):
            if f not in found:
                found.append(f)
        return found

    def _of_form(self, poly: Poly) -> list[Poly] | None:
        """Return irreducible factors of a form in each turning joint's variables, or None."""
        # Those that are no variable are forms in the tangents alone, with half as many variables.
        gens, content = self.context.gens(), poly.term_content().degrees()
        least = [e if v < self.nvars else 0 for v, e in enumerate(content)]
        factors = [gens[v] for v, e in enumerate(least) if e]
        rest = poly / self.context.term(exp_vec=least) if factors else poly
        tangents = self._tangents(rest)
        if tangents is None:
            return None
        names = self.context.names()
        found = self._irreducible(rest.subs({names[x]: 1 for x in tangents}))
        forms = [self._form(f, tangents) for f in found]
        factors += [-f if f.leading_coefficient() < 0 else f for f in forms]
        # In the order that flint has them in: the last joints first, of a joint y before x.
        return sorted(factors, key=self._place)

    def _tangents(self, poly: Poly) -> list[int] | None:
        """First variables of the turning joints in a form; None if it is none in one of them."""
        gens, degrees, first = self.context.gens(), poly.degrees(), poly.monomial(0)
        tangents = []
        for x, slides in zip(self.start, self.prismatic, strict=True):
            if slides or not (degrees[x] or degrees[x + 1]):
                continue
            # Euler: a form of degree d is what its derivatives by x and y make of it, over d.
            made = gens[x] * poly.derivative(x) + gens[x + 1] * poly.derivative(x + 1)
            if made != poly * (first[x] + first[x + 1]):
                return None
            tangents.append(x)
        return tangents

    def _form(self, poly: Poly, tangents: Sequence[int]) -> Poly:
        """A polynomial in tangents y with as much of each x as makes it a form."""
        degrees = poly.degrees()
        most = {x: degrees[x + 1] for x in tangents}
        terms = {
            tuple([most[v] - m[v + 1] if v in most else e for v, e in enumerate(m)]): c
            for m, c in terms_of(poly).items()
        }
        return self.context.from_dict(terms)

    def _place(self, factor: Poly) -> tuple[int, int, int]:
        joint = min(self.joints_of(factor), default=-1)
        return -joint, len(factor), -next((v for v, e in enumerate(factor.degrees()) if e), 0)

    @property
    def basis(self) -> tuple[int, ...]:
        """Positions among SQUARES of the square roots in the coefficients, 1 first."""
        return {(2,): (0, 1), (3,): (0, 2), (2, 3): (0, 1, 2, 3)}[self.roots]

    def _poly(self, terms: Mapping[Monomial, Exact | int]) -> Poly:
        """The polynomial of these terms."""
        found: dict[Monomial, Any] = {}
        for m, c in terms.items():
            for square, part in zip(SQUARES, parts_of(c), strict=True):
                if part:
                    powers = tuple(int(square % d == 0) for d in self.roots)
                    if math.prod(d for d, e in zip(self.roots, powers, strict=True) if e) != square:
                        raise ValueError(f"the ring has no square root of {square}")
                    found[m + powers] = part
        return self.context.from_dict({m: rational(c) for m, c in found.items()})

    def _factor(self, poly: Poly, level: int) -> list[Poly]:
        """Irreducible factors over the rationals with the first ``level`` roots adjoined."""
        if self.is_constant(poly):
            return []
        self.time.check_factor(len(poly))
        if level == 0:
            return [self.monic(f) for f, _ in poly.factor()[1]]
        if self._surely_irreducible(poly):
            return [poly]
        # What has nothing of the last root in it falls apart without it first.
        plain, times_root = self._parts(poly, level)
        common = self.gcd(plain, times_root)
        found = [f for h in self._factor(common, level - 1) for f in self._split(h, level)]
        if times_root != 0:
            found += self._by_norm(self.quotient(poly, common), level)
        return found

    def _by_norm(self, poly: Poly, level: int) -> list[Poly]:
        """Return irreducible factors of a polynomial whose norm has no square in it."""
        # The norm, poly times its image under s -> -s, is free of the last root s; each factor of
        # it shares one with the polynomial (Trager, 1976).
        if self.is_constant(poly):
            return []
        return [self.gcd(poly, f) for f in self._factor(self._norm(poly, level), level - 1)]

    def _split(self, poly: Poly, level: int) -> list[Poly]:
        """Irreducible factors, with the last root, of what is irreducible without it."""
        if self._surely_irreducible(poly):
            return [poly]
        joint = self.joints_of(poly)[0]
        for k in itertools.count(1):  # all but finitely many k make the norm free of squares
            shifted = self._shifted(poly, joint, k, level)
            norm = self._norm(shifted, level)
            # Whether some factor with the joint in it is there more than once, modulo a prime.
            reduced = image(norm, self, WORD_PRIME)
            slope = reduced.derivative(self._variable(norm, joint))
            if not reduced.gcd(slope).is_constant():
                continue
            pieces = self._by_norm(shifted, level)
            if len(pieces) == 1:
                return [poly]
            return [self.monic(self._shifted(f, joint, -k, level)) for f in pieces]
        raise AssertionError("unreachable")

    def _surely_irreducible(self, poly: Poly) -> bool:
        """Return True if it is irreducible modulo a prime at which our roots have values."""
        try:
            return [k for _, k in image(poly, self, WORD_PRIME).factor()[1]] == [1]
        except OverflowError:  # python-flint 0.9 cannot sort factors of the same shape
            return False

    def _parts(self, poly: Poly, level: int) -> tuple[Poly, Poly]:
        """Return what 1 and the last root multiply."""
        parts = coefficients_by(poly, (self.nvars + level - 1,))
        return parts.get((0,), self.zero), parts.get((1,), self.zero)

    def _norm(self, poly: Poly, level: int) -> Poly:
        """Product of the two images under a change of the last root's sign."""
        plain, times_root = self._parts(poly, level)
        # Term products that one with square roots costs.
        self.time.check(3.0 * (len(plain) ** 2 + len(times_root) ** 2))
        return self.reduce(plain * plain - self.roots[level - 1] * times_root * times_root)

    def _shifted(self, poly: Poly, joint: int, k: int, level: int) -> Poly:
        """X + k s y for x, or z + k s for z (and for a tangent), with the last root s."""
        self.time.check()
        gens = self.context.gens()
        first = self._variable(poly, joint)
        images = list(gens)
        step = k * gens[self.nvars + level - 1]
        form = first == self.start[joint] and not self.prismatic[joint]
        images[first] = gens[first] + (step * gens[first + 1] if form else step)
        return self.reduce(poly.compose(*images, ctx=self.context))

    def _variable(self, poly: Poly, joint: int) -> int:
        """The first of a joint's variables that occurs: y of a polynomial in tangents."""
        degrees = poly.degrees()
        return next(v for v in self.variables(joint) if degrees[v])

    def _bits_needed(self, poly: Poly) -> int:
        """Return the length of a prime by which the coefficients of any factor are told for sure.

        A factor's integers are below 2^(sum of degrees) times those of the polynomial (Gelfond,
        1952); made monic, their parts are below that to the power of the field's degree; the
        lattice has one dimension more than that.
        """
        degree = len(self.basis)
        height = max(map(abs, whole_terms(poly).values()))
        bits = height.bit_length() + sum(int(d) for d in poly.degrees()[: self.nvars]) + 2
        return (degree + 1) * (degree * bits + degree + 1) + _SPARE_BITS

    def _lift(self, residues: Poly, prime: int) -> Poly | None:
        """Return the polynomial with a leading coefficient of 1 that has these residues."""
        # None if the prime is too short to tell; even what comes out is to be tried by division.
        terms = {tuple(int(e) for e in m): int(c) for m, c in terms_of(residues).items()}
        inverse = pow(terms[max(terms)], -1, prime)
        lifted: dict[Monomial, Exact] = {}
        for m, c in terms.items():
            self.time.check()
            number = self._lift_number(c * inverse % prime, prime)
            if number is None:
                return None
            lifted[m] = number
        return self._poly(lifted)

    def _lift_number(self, residue: int, prime: int) -> Exact | None:
        """The smallest number of the field with a residue: the shortest vector of a lattice."""
        if residue == 1:
            return Fraction(1)
        values = [root_modulo(SQUARES[k], prime) for k in self.basis[1:]]
        size = len(values) + 2
        rows = [[0] * size for _ in range(size)]  # columns: denominator, 1, roots
        rows[0][0], rows[0][1] = 1, residue
        rows[1][1] = prime
        for i, value in enumerate(values):
            rows[2 + i][1], rows[2 + i][2 + i] = -value, 1
        basis = fmpz_mat(rows).lll()
        shortest = [int(basis[0, k]) for k in range(size)]
        # Any residue has numbers of about this length: only a shorter one means something.
        longest = max(abs(x) for x in shortest).bit_length()
        if shortest[0] == 0 or size * longest > prime.bit_length() - _SPARE_BITS:
            return None
        parts = [Fraction(0)] * 4
        for k, part in zip(self.basis, shortest[1:], strict=True):
            parts[k] = Fraction(part, shortest[0])
        return surd(*parts)


def make_ring(
    prismatic: Sequence[bool], numbers: Sequence[Exact] = (), time: Budget = _ENDLESS
) -> Ring:
    """Ring of a chain with these joints, and with the square roots that some numbers have."""
    roots = roots_of(numbers)
    names: list[str] = []
    start: list[int] = []
    for j, slides in enumerate(prismatic, 1):
        start.append(len(names))
        names += [f"z{j}"] if slides else [f"x{j}", f"y{j}"]
    order = Ordering.lex if roots else Ordering.degrevlex
    context = fmpq_mpoly_ctx.get([*names, *(f"s{d}" for d in roots)], order)
    gens, kinds = context.gens(), tuple(bool(p) for p in prismatic)
    both = zip(start, kinds, strict=True)
    norms = tuple(None if slides else gens[s] ** 2 + gens[s + 1] ** 2 for s, slides in both)
    return Ring(context, kinds, tuple(start), norms, roots, time)


WORD_PRIME, SECOND_PRIME = PRIMES
"""Both have roots of 2 and 3; what points modulo the first say is asked again modulo the second."""


def image(poly: Poly, ring: Ring, prime: int) -> Any:
    """A polynomial modulo a prime, in the joints' variables."""
    if ring.rational:
        inverse: dict[Any, int] = {}
        terms = {}
        for m, c in terms_of(poly).items():
            if c.q not in inverse:
                inverse[c.q] = pow(int(c.q), -1, prime)
            terms[m] = int(c.p) * inverse[c.q] % prime
    else:
        terms = {m: residue(c, prime) for m, c in ring.terms(poly).items()}
    names = tuple(ring.context.names()[: ring.nvars])
    return modular_context(names, prime).from_dict({m: c for m, c in terms.items() if c})


@functools.cache
def modular_context(names: tuple[str, ...], prime: int) -> Any:
    """Flint's ring of polynomials modulo a prime, lexicographic order."""
    kind = nmod_mpoly_ctx if prime.bit_length() < 64 else fmpz_mod_mpoly_ctx
    return kind.get(list(names), prime, Ordering.lex)
