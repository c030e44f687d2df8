"""The polynomial ring of an arm: homogeneous half-angle coordinates over the rationals.

A revolute joint has two variables x, y with ``cos = (x^2 - y^2) / w``, ``sin = 2 x y / w``,
``w = x^2 + y^2``, so that its angle is 2 atan2(y, x) and pi is as good a point as any other.
A prismatic joint has one variable, its value in metres.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flint import Ordering, fmpq, fmpq_mpoly_ctx

Poly = Any  # fmpq_mpoly; python-flint ships no types
Value = tuple[Fraction, ...]
"""Rational value of a joint: (x, y) of a revolute one, (metres,) of a prismatic one."""


def rational(value: Fraction | int) -> Any:
    """Flint's rational for a Fraction or an int."""
    value = Fraction(value)
    return fmpq(value.numerator, value.denominator)


def fraction(value: Any) -> Fraction:
    """Fraction of a flint rational."""
    value = fmpq(value)
    return Fraction(int(value.p), int(value.q))


@dataclass(frozen=True)
class Ring:
    """Variables of one chain.

    Attributes
    ----------
    context : fmpq_mpoly_ctx
        Flint's ring.
    prismatic : tuple of bool
        One entry a joint.
    start : tuple of int
        Index of each joint's first variable.
    w : tuple of Poly or None
        x^2 + y^2 of each revolute joint.
    """

    context: Any
    prismatic: tuple[bool, ...]
    start: tuple[int, ...]
    w: tuple[Poly | None, ...]

    @property
    def one(self) -> Poly:
        """The constant 1."""
        return self.context.constant(1)

    @property
    def zero(self) -> Poly:
        """The constant 0."""
        return self.context.constant(0)

    def variables(self, joint: int) -> tuple[int, ...]:
        """Indices of a joint's variables."""
        first = self.start[joint]
        return (first,) if self.prismatic[joint] else (first, first + 1)

    def joints_of(self, poly: Poly) -> tuple[int, ...]:
        """Joints whose variables occur in ``poly``."""
        degrees = poly.degrees()
        return tuple(
            j for j in range(len(self.prismatic)) if any(degrees[v] > 0 for v in self.variables(j))
        )

    def substitute(self, poly: Poly, values: Mapping[int, Value]) -> Poly:
        """Put rational joint values into ``poly``."""
        names = self.context.names()
        found = {
            names[v]: rational(x)
            for j, value in values.items()
            for v, x in zip(self.variables(j), value, strict=True)
        }
        return poly.subs(found)

    def strip(self, poly: Poly) -> Poly:
        """Divide out every x^2 + y^2, which no real angle makes zero."""
        degrees = poly.degrees()
        for j, w in enumerate(self.w):
            if w is None or poly == 0:
                continue
            x, y = self.variables(j)
            if degrees[x] < 2 or degrees[y] < 2:  # w divides only what has both squares
                continue
            while True:
                quotient, remainder = divmod(poly, w)
                if remainder != 0:
                    break
                poly = quotient
        return poly

    def factors(self, poly: Poly) -> list[Poly]:
        """Irreducible factors over Q, without multiplicity and without any x^2 + y^2."""
        _, found = poly.factor()
        return [f for f, _ in found if not any(w is not None and f == w for w in self.w)]

    def joint_value(self, poly: Poly) -> tuple[int, Value] | None:
        """The rational value that ``poly`` = 0 fixes one joint at, if it does just that."""
        joints = self.joints_of(poly)
        if len(joints) != 1 or poly.total_degree() != 1:
            return None
        j = joints[0]
        variables = self.variables(j)
        terms = poly.to_dict()
        nvars = self.context.nvars()

        def coefficient(v: int | None) -> Fraction:
            key = tuple(int(v == k) for k in range(nvars))
            return fraction(terms.get(key, 0))

        if self.prismatic[j]:
            return j, (-coefficient(None) / coefficient(variables[0]),)
        x, y = coefficient(variables[1]), -coefficient(variables[0])
        # Canonical representative, so that equal values compare equal.
        lead = x if x != 0 else y
        return j, (x / lead, y / lead)


def make_ring(prismatic: Sequence[bool]) -> Ring:
    """Ring of a chain with these joints."""
    names: list[str] = []
    start = []
    for j, slides in enumerate(prismatic, 1):
        start.append(len(names))
        names += [f"z{j}"] if slides else [f"x{j}", f"y{j}"]
    context = fmpq_mpoly_ctx.get(names, Ordering.degrevlex)
    gens = context.gens()
    w = tuple(
        None if slides else gens[s] ** 2 + gens[s + 1] ** 2
        for s, slides in zip(start, prismatic, strict=True)
    )
    return Ring(context, tuple(bool(p) for p in prismatic), tuple(start), w)
