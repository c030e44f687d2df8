"""Polynomials whose coefficients have square roots of 2 and 3: twists of 15 degrees.

Each root is one more variable of flint's ring, after the joints' variables in the
lexicographic order, with its relation s^2 = 2 or 3. A polynomial whose leading coefficient is
1 then divides others by flint's own division, with the roots along as coefficients.

Flint neither factors such polynomials nor takes their gcd. The gcd is taken modulo a prime at
which 2 and 3 are squares, and its coefficients are traced back to the smallest numbers
a + b sqrt(2) + ... that have these residues, by a reduced lattice basis (Lenstra, Lenstra and
Lovasz, 1982); division has the last word. Factors come from those of the norm, one root at a
time (Trager, 1976).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar

from flint import fmpz_mat

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.ring import (
    WORD_PRIME,
    Monomial,
    Poly,
    Ring,
    Value,
    coefficients_by,
    fraction,
    image,
    layout,
    make_ring,
    rational,
    terms_of,
    whole_terms,
)
from pinsing.robot.surd import SQUARES, Exact, Surd, parts_of, root_modulo, roots_of, surd

_EXPONENTS = (276, 534, 2208, 2816)
"""3 * 2^k + 1 is prime for these k, and 2 and 3 are squares modulo it."""
_SPARE_BITS = 40


@dataclass(frozen=True)
class SurdRing(Ring):
    """Ring of a chain with square roots among its coefficients."""

    roots: tuple[int, ...]  # what the roots are of, (2,), (3,) or (2, 3): flint's last variables
    time: Budget = field(compare=False)  # asked within factors and divisors, which can be long

    rational: ClassVar[bool] = False

    @property
    def basis(self) -> tuple[int, ...]:
        """Positions among SQUARES of the square roots in the coefficients, 1 first."""
        return {(2,): (0, 1), (3,): (0, 2), (2, 3): (0, 1, 2, 3)}[self.roots]

    def number(self, value: Exact | int) -> Poly:
        """A constant of the ring."""
        return self._poly({(0,) * self.nvars: value})

    def reduce(self, poly: Poly) -> Poly:
        """The form that has every root to the power of one at most."""
        gens = self.context.gens()[self.nvars :]
        for s, d, degree in zip(gens, self.roots, poly.degrees()[self.nvars :], strict=True):
            if degree > 1:
                poly = divmod(poly, s * s - d)[1]
        return poly

    def terms(self, poly: Poly) -> dict[Monomial, Exact]:
        """Exponents of the joints' variables, and coefficients."""
        gathered: dict[Monomial, list[Fraction]] = {}
        nvars, zero = self.nvars, Fraction(0)
        for m, c in terms_of(poly).items():
            square = math.prod(d for d, e in zip(self.roots, m[nvars:], strict=True) if e)
            parts = gathered.setdefault(tuple(map(int, m[:nvars])), [zero] * 4)
            parts[SQUARES.index(square)] = fraction(c)
        return {m: surd(*parts) for m, parts in gathered.items()}

    def monomials(self, poly: Poly) -> list[Monomial]:
        """Exponents of the joints' variables in each term; some perhaps several times."""
        return [m[: self.nvars] for m in poly.monoms()]

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

    def is_constant(self, poly: Poly) -> bool:
        """Return True if no joint occurs."""
        return all(d <= 0 for d in poly.degrees()[: self.nvars])

    def putting(self, values: Mapping[int, Value]) -> Callable[[Poly], Poly]:
        """Return what puts exact joint values into one polynomial after the other."""
        plain = {j: v for j, v in values.items() if not any(isinstance(x, Surd) for x in v)}
        left = {j: v for j, v in values.items() if j not in plain}
        put_plain = super().putting(plain)
        if not left:
            return put_plain
        images = list(self.context.gens())
        for j, value in left.items():
            for v, x in zip(self.variables(j), value, strict=True):
                images[v] = self.number(x)

        def put(poly: Poly) -> Poly:
            return self.reduce(put_plain(poly).compose(*images, ctx=self.context))

        return put

    def coefficients(self, poly: Poly) -> Mapping[Monomial, Any]:
        """Exponents of the joints' variables, and coefficients that can be divided."""
        return self.terms(poly)

    def monic(self, poly: Poly) -> Poly:
        """The multiple with a leading coefficient of 1; zero stays."""
        terms = self.terms(poly)
        if not terms:
            return poly
        lead = terms[max(terms)]
        return poly if lead == 1 else self.reduce(poly * self.number(1 / lead))

    def divides(self, p: Poly, poly: Poly) -> bool:
        """Return True if ``poly`` is a multiple of ``p``, one of the ``factors`` of something."""
        return bool(self.reduce(divmod(poly, p)[1]) == 0)

    def quotient(self, poly: Poly, p: Poly) -> Poly:
        """``poly`` over ``p``, which divides it and came from ``factors`` or ``gcd``."""
        return self.reduce(divmod(poly, p)[0])

    def resultant(self, p: Poly, g: Poly, variable: int) -> Poly:
        """Resultant with respect to a variable."""
        return self.reduce(super().resultant(p, g, variable))

    def gcd(self, p: Poly, g: Poly) -> Poly:
        """Greatest common divisor, its leading coefficient 1."""
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
                at = self._at_one(tangents)
                found = self._form(self.gcd(p.subs(at), g.subs(at)), tangents)
                return self.monic(found * self.context.term(exp_vec=powers))
        p, g = self.monic(p), self.monic(g)
        if not any(p.degrees()[self.nvars :]) and not any(g.degrees()[self.nvars :]):
            return self.monic(p.gcd(g))
        # Terms from which on a gcd may take long: one of two polynomials of 150 took minutes.
        self.time.check_factor(max(len(p), len(g)), 60)
        if image(p, self, WORD_PRIME).gcd(image(g, self, WORD_PRIME)).is_constant():
            return self.one
        for prime in _primes(min(self._bits_needed(p), self._bits_needed(g))):
            self.time.check()
            found = self._lift(image(p, self, prime).gcd(image(g, self, prime)), prime)
            if found is not None and self.divides(found, p) and self.divides(found, g):
                return found
        raise BudgetExceeded("a polynomial with square roots in it has too long coefficients")

    def long_to_factor(self, poly: Poly) -> int | None:
        """Terms from which on a polynomial may take long to factor: as a budget says."""
        return None

    def _factors(self, poly: Poly) -> list[Poly]:
        """Over the field of the roots."""
        stripped = self.strip(poly)
        found = self._of_form(stripped)
        if found is None:
            found = self._irreducible(stripped)
        found = [self.monic(f) for f in found]
        return [f for f in found if not any(w is not None and f == w for w in self.w)]

    def _irreducible(self, poly: Poly) -> list[Poly]:
        """Irreducible factors of any polynomial, over the field of the roots."""
        found: list[Poly] = []
        for f in self._factor(self.monic(poly), len(self.roots)):
            if f not in found:
                found.append(f)
        return found

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
            if self._has_square(self._norm(shifted, level), joint):
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

    def _has_square(self, poly: Poly, joint: int) -> bool:
        """Return True if some factor with a joint in it is there more than once, modulo a prime."""
        reduced = image(poly, self, WORD_PRIME)
        return not reduced.gcd(reduced.derivative(self._variable(poly, joint))).is_constant()

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


def ring_of(prismatic: Sequence[bool], numbers: Sequence[Exact], time: Budget) -> Ring:
    """Ring of a chain, with the square roots that its constants have."""
    if not (roots := roots_of(numbers)):
        return make_ring(prismatic)
    context, slides, start, w = layout(prismatic, roots)
    return SurdRing(context, slides, start, w, roots, time)


def _primes(bits: int) -> Iterator[int]:
    """The known primes up to the first that is at least as long: mostly a short one will do."""
    for k in _EXPONENTS:
        yield 3 * 2**k + 1
        if k >= bits:
            return
