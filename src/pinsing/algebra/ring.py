"""The polynomial ring of an arm: homogeneous half-angle coordinates over the rationals.

Where the arm has twists of 15 degrees or its multiples, the coefficients have square roots:
``surd_ring`` extends the ring by these.

A revolute joint has two variables x, y with ``cos = (x^2 - y^2) / w``, ``sin = 2 x y / w``,
``w = x^2 + y^2``, so that its angle is 2 atan2(y, x) and pi is as good a point as any other.
A prismatic joint has one variable, its value in metres.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar

from flint import Ordering, fmpq, fmpq_mpoly_ctx, fmpz_mod_mpoly_ctx, nmod_mpoly_ctx

from pinsing.algebra.budget import Budget
from pinsing.robot.nominal import PRIMES
from pinsing.robot.surd import Exact, Surd, residue


def terms_of(poly: Any) -> dict[Any, Any]:
    """Exponents, and coefficients as flint has them: what ``poly.to_dict()`` tells."""
    return dict(zip(poly.monoms(), poly.coeffs(), strict=True))


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
Monomial = tuple[int, ...]
Packed = list[tuple[Monomial, int, int]]
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


@dataclass(frozen=True)
class Ring:
    """Variables of one chain."""

    context: Any  # flint's ring
    prismatic: tuple[bool, ...]  # one entry a joint
    start: tuple[int, ...]  # index of each joint's first variable
    w: tuple[Poly | None, ...]  # x^2 + y^2 of each revolute joint
    # factors of the polynomials that were asked for before
    known: MadeOfEqual = field(default_factory=MadeOfEqual, init=False, compare=False, repr=False)

    nvars: int = field(init=False, compare=False)  # number of the joints' variables
    zero: Poly = field(init=False, compare=False, repr=False)
    one: Poly = field(init=False, compare=False, repr=False)
    # whether all coefficients are rational
    rational: ClassVar[bool] = True

    def __post_init__(self) -> None:
        constant = self.context.constant
        nvars = sum(1 if slides else 2 for slides in self.prismatic)
        self.__dict__.update(nvars=nvars, zero=constant(0), one=constant(1))

    def number(self, value: Exact | int) -> Poly:
        """A constant of the ring."""
        if isinstance(value, Surd):
            raise TypeError("a square root is no constant of a ring over the rationals")
        return self.context.constant(rational(value))

    def reduce(self, poly: Poly) -> Poly:
        """The unique form of an element that products came to; the same over the rationals."""
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
        return {tuple(int(e) for e in m): fraction(c) for m, c in terms_of(poly).items()}

    def monomials(self, poly: Poly) -> list[Monomial]:
        """Exponents of the joints' variables in each term; some perhaps several times."""
        return list(poly.monoms())

    def packed(self, poly: Poly) -> Packed:
        """The polynomial as plain integers, for another process."""
        return [(tuple(map(int, m)), int(c.p), int(c.q)) for m, c in terms_of(poly).items()]

    def unpacked(self, terms: Packed) -> Poly:
        """The polynomial of what ``packed`` gave."""
        return self.context.from_dict({m: fmpq(p, q) for m, p, q in terms})

    def is_constant(self, poly: Poly) -> bool:
        """Return True if no joint occurs."""
        return bool(poly.is_constant())

    def substitute(self, poly: Poly, values: Mapping[int, Value]) -> Poly:
        """Put exact joint values into ``poly``."""
        return self.putting(values)(poly)

    def putting(self, values: Mapping[int, Value]) -> Callable[[Poly], Poly]:
        """Return what puts exact joint values into one polynomial after the other."""
        names = self.context.names()
        found = {
            v: rational(x)  # type: ignore[arg-type]
            for j, value in values.items()
            for v, x in zip(self.variables(j), value, strict=True)
        }
        named = {names[v]: x for v, x in found.items()}

        def put(poly: Poly) -> Poly:
            if not poly or poly.is_constant():
                return poly
            degrees = poly.degrees()
            return poly.subs(named) if any(degrees[v] for v in found) else poly

        return put

    def nowhere_zero(self, poly: Poly) -> bool:
        """Return True if a polynomial is a nonzero constant times x^2 + y^2 of joints."""
        return self.is_constant(self.strip(poly))

    def coefficients(self, poly: Poly) -> Mapping[Monomial, Any]:
        """Exponents of the joints' variables, and coefficients that can be divided."""
        return terms_of(poly)

    def divides(self, p: Poly, poly: Poly) -> bool:
        """Return True if ``poly`` is a multiple of ``p``, one of the ``factors`` of something."""
        return bool(divmod(poly, p)[1] == 0)

    def quotient(self, poly: Poly, p: Poly) -> Poly:
        """``poly`` over ``p``, which divides it and came from ``factors`` or ``gcd``."""
        return poly / p

    def gcd(self, p: Poly, g: Poly) -> Poly:
        """Greatest common divisor."""
        return p.gcd(g)

    def resultant(self, p: Poly, g: Poly, variable: int) -> Poly:
        """Resultant with respect to a variable."""
        return p.resultant(g, self.context.names()[variable])

    def shared_joints(self, p: Poly, g: Poly) -> list[int]:
        """Joints that occur in both, those by which a resultant is simplest first."""

        def degree(j: int) -> int:
            v = self.variables(j)[-1]
            return int(p.degrees()[v]) * int(g.degrees()[v])

        return sorted(set(self.joints_of(p)) & set(self.joints_of(g)), key=degree)

    def eliminated(self, p: Poly, g: Poly, joint: int) -> Poly:
        """Resultant of two forms in the variables of one joint."""
        variables = self.variables(joint)
        if len(variables) == 2:
            put = {self.context.names()[variables[0]]: 1}
            p, g = p.subs(put), g.subs(put)
        return self.resultant(p, g, variables[-1])

    def strip(self, poly: Poly) -> Poly:
        """Divide out every x^2 + y^2, which no real angle makes zero."""
        if len(poly) < 2:
            return poly
        degrees = poly.degrees()
        for j, w in enumerate(self.w):
            # Only what has both squares is divided.
            if w is not None and min(degrees[v] for v in self.variables(j)) >= 2:
                poly = divided_by(poly, w)
        return poly

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
        degrees = poly.degrees()
        joints = zip(self.start, self.prismatic, strict=True)
        size = math.prod(degrees[v if slides else v + 1] + 1 for v, slides in joints)
        # Terms that a polynomial of some degrees can have in half-angle tangents, and has: up to so
        # many it is factored in milliseconds.
        return 1_000 if size <= 1_500 else None

    def _factors(self, poly: Poly) -> list[Poly]:
        """Over Q."""
        # Terms from which on a polynomial is factored as one in half-angle tangents.
        found = self._of_form(poly) if len(poly) >= 20 else None
        if found is None:
            found = self._irreducible(poly)
        return [f for f in found if not any(w is not None and f == w for w in self.w)]

    def _irreducible(self, poly: Poly) -> list[Poly]:
        """Irreducible factors of any polynomial."""
        return [f for f, _ in poly.factor()[1]]

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
        found = self._irreducible(rest.subs(self._at_one(tangents)))
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

    def _at_one(self, tangents: Sequence[int]) -> dict[str, int]:
        names = self.context.names()
        return {names[x]: 1 for x in tangents}

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

    def fixing(self, joint: int, value: Value) -> Poly:
        """The polynomial that is zero where a joint is at an exact value, and nowhere else."""
        x, *y = (self.context.gens()[v] for v in self.variables(joint))
        if not y:
            return x - self.number(value[0])
        return x * self.number(value[1]) - y[0] * self.number(value[0])

    def joint_value(self, poly: Poly) -> tuple[int, Value] | None:
        """The exact value that ``poly`` = 0 fixes one joint at, if it does just that."""
        # Terms that a polynomial over the rationals has at most that fixes a joint's value.
        if self.rational and len(poly) > 2:
            return None
        joints = self.joints_of(poly)
        if len(joints) != 1:
            return None
        j = joints[0]
        variables = self.variables(j)
        if sum(int(poly.degrees()[v]) for v in variables) > len(variables):
            return None
        terms = self.terms(poly)
        if max(sum(m) for m in terms) != 1:
            return None

        zero = Fraction(0)
        by = {m.index(1) if any(m) else None: c for m, c in terms.items()}
        if self.prismatic[j]:
            return j, (-by.get(None, zero) / by[variables[0]],)
        x, y = by.get(variables[1], zero), -by.get(variables[0], zero)
        # Canonical representative, so that equal values compare equal.
        lead = x if x != 0 else y
        return j, (x / lead, y / lead)


def layout(prismatic: Sequence[bool], roots: Sequence[int] = ()) -> tuple[Any, ...]:
    """Return the first fields of a chain's ring, whose last variables are square roots."""
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
    return context, kinds, tuple(start), norms


def make_ring(prismatic: Sequence[bool]) -> Ring:
    """Ring of a chain with these joints, over the rationals."""
    return Ring(*layout(prismatic))


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
