"""Families as exact polynomial equations in sines and cosines, for other programs.

Inside, a revolute joint is a pair (x, y) in which polynomials are homogeneous, x : y = cos(q/2) :
sin(q/2). Of even degree they are polynomials in c = cos q and s = sin q: x x = (1 + c)/2,
x y = s/2, y y = (1 - c)/2. One of odd degree is zero where it is zero times x and times y, because
x and y are never zero together; these two are even. Nothing is rounded.

Systems of equations as text that Singular, msolve, Maple and Sage read.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from flint import Ordering, fmpq, fmpq_mpoly_ctx

from pinsing.algebra.budget import Budget
from pinsing.algebra.jacobian_matrix import constants
from pinsing.algebra.ring import Poly, Value, make_ring, rational
from pinsing.errors import OptionError
from pinsing.families.family import Family, asked_for
from pinsing.families.proof_forms import content
from pinsing.prose import visible
from pinsing.robot.mimic import own_rows
from pinsing.robot.nominal import Nominal
from pinsing.robot.surd import SQUARES, Exact, parts_of

_Values = tuple[dict[int, tuple[Value, ...]], tuple[Poly, ...]]
"""Joints, each at one of some values, and relations."""
Parts = dict[str, tuple[Poly, ...]]
"""Systems whose real zeros are a family, by name: the polynomials that vanish, whole numbers."""


class Systems:
    """Families as systems of equations in the same variables, those of sines and cosines."""

    def __init__(self, chosen: Sequence[Family], geometry: Nominal, symbols: Sequence[str]) -> None:
        self.symbols, self.prismatic = symbols, tuple(bool(p) for p in geometry.arm.prismatic)
        self.ring = make_ring(self.prismatic, constants(geometry, geometry.arm.task), Budget(10.0))
        components = [c for f in chosen for c in f.components]
        used = {j for c in components for r in c.relations for j in self.ring.joints_of(r)}
        self.joints = sorted(used.union(*(c.values for c in components)))
        offset = [float(a) for a in geometry.offset[own_rows(geometry)]]
        self.quarters = [round(a / (math.pi / 2)) for a in offset]
        self.shift = [a - k * math.pi / 2 for a, k in zip(offset, self.quarters, strict=True)]
        # Each variable, and what it stands for: ``c2``, ``cos(q2)``; of square roots only solutions
        # where they are positive are meant.
        self.variables = [(f"r{d}", f"sqrt({d})") for d in self.ring.roots]
        self.variables += [variable for j in self.joints for variable in self._named(j)]
        self.names = [name for name, _ in self.variables]
        self.context = fmpq_mpoly_ctx.get(self.names, Ordering.degrevlex)
        gens = iter(self.context.gens())
        self.root = {d: next(gens) for d in self.ring.roots}
        self.own = {
            j: tuple(next(gens) for _ in range(1 if self.prismatic[j] else 2)) for j in self.joints
        }
        # Polynomials that vanish at all configurations: ``c2^2 + s2^2 - 1``, ``r2^2 - 2``.
        self.circles = [g * g - d for d, g in self.root.items()]
        self.circles += [p[0] ** 2 + p[1] ** 2 - 1 for p in self.own.values() if len(p) == 2]
        self.families = [(f, self._parts(f)) for f in chosen]

    def _named(self, j: int) -> list[tuple[str, str]]:
        """Variables of a joint, and what they stand for."""
        symbol = self.symbols[j]
        if self.prismatic[j]:
            return [(symbol, f"{symbol}, metres")]
        angle, number = symbol, symbol[1:]
        if abs(self.shift[j]) > 1e-12:
            angle += f" {'+' if self.shift[j] > 0 else '-'} {abs(self.shift[j]):.17g}"
        return [(f"c{number}", f"cos({angle})"), (f"s{number}", f"sin({angle})")]

    def _parts(self, family: Family) -> Parts:
        """Systems of a family; mirror images that differ in one joint's value are one."""
        parts: dict[str, tuple[Poly, ...]] = {}
        given: list[_Values] = [
            ({j: (v,) for j, v in sorted(c.values.items())}, c.relations) for c in family.components
        ]
        for values, relations in _joined(given):
            polys = [p for j, several in values.items() for p in self._value(j, several)]
            polys += [p for r in relations for p in self._even(r)]
            whole = {str(p): p for p in (p / content(p) for p in polys if p != 0)}
            parts[str(list(whole))] = tuple(whole.values())
        names = [f"{family.name}_{i}" for i in range(1, len(parts) + 1)]
        names = names if len(parts) > 1 else [family.name]
        return dict(zip(names, parts.values(), strict=True))

    def _value(self, j: int, several: Sequence[Value]) -> list[Poly]:
        """That a joint has one of some exact values."""
        if self.prismatic[j] or len(several) > 1:
            product = math.prod(self.ring.fixing(j, value) for value in several)
            return self._even(self.ring.reduce(product))
        x, y = several[0]
        square = x * x + y * y
        c, s = self._circle(j)
        cos, sin = (x * x - y * y) / square, 2 * (x * y) / square
        return [c - self._number(cos), s - self._number(sin)]

    def _even(self, poly: Poly) -> list[Poly]:
        """A polynomial, times x and times y of each joint in which its degree is odd."""
        terms = self.ring.terms(poly)
        some = next(iter(terms))
        odd = [
            j
            for j in reversed(self.joints)
            if not self.prismatic[j] and sum(some[v] for v in self.ring.variables(j)) % 2
        ]
        polys = []
        for choice in itertools.product((0, 1), repeat=len(odd)):
            more, total = dict(zip(odd, choice, strict=True)), self.context.constant(0)
            for m, number in terms.items():
                term = self._number(number)
                for j in self.joints:
                    exponents = [int(m[v]) for v in self.ring.variables(j)]
                    if j in more:
                        exponents[more[j]] += 1
                    if any(exponents):
                        term = term * self._power(j, *exponents)
                total = total + term
            polys.append(total)
        return polys

    def _power(self, j: int, a: int, b: int = 0) -> Poly:
        """x^a y^b in sine and cosine, for a + b even; or a power of a length."""
        if self.prismatic[j]:
            return self.own[j][0] ** a
        c, s = self._circle(j)
        half = self.context.constant(fmpq(1, 2))
        out = (half * (1 + c)) ** (a // 2) * (half * (1 - c)) ** (b // 2)
        return half * out * s if a % 2 else out

    def _circle(self, j: int) -> tuple[Poly, Poly]:
        """Cosine and sine of the ring's angle, which is some right angles more than the joint's."""
        c, s = self.own[j]
        for _ in range(self.quarters[j] % 4):
            c, s = -s, c
        return c, s

    def _number(self, value: Exact) -> Poly:
        """A constant; square roots are variables."""
        out = self.context.constant(0)
        for square, part in zip(SQUARES, parts_of(value), strict=True):
            if part:
                term = self.context.constant(rational(part))
                for d, root in self.root.items():
                    term = term * root if square % d == 0 else term
                out = out + term
        return out


def _joined(found: Sequence[_Values]) -> Sequence[_Values]:
    """Join two that differ in the values of one joint, as long as there are such."""
    pairs = ((i, k) for k in range(len(found)) for i in range(k))
    for i, k in pairs:
        (values, relations), (others, same) = found[i], found[k]
        if values.keys() != others.keys() or {*map(str, relations)} != {*map(str, same)}:
            continue
        different = [j for j in values if values[j] != others[j]]
        if len(different) == 1 and len(values[different[0]]) == len(others[different[0]]):
            both = {j: values[j] + others[j] for j in different}
            joined = [*found[:i], (values | both, relations), *found[i + 1 :]]
            return _joined([*joined[:k], *joined[k + 1 :]])
    return found


SUFFIXES = {
    ".sing": "singular",
    ".lib": "singular",
    ".ms": "msolve",
    ".mpl": "maple",
    ".maple": "maple",
    ".sage": "sage",
    ".py": "sage",
}
LANGUAGES = ("singular", "msolve", "maple", "sage")
_PROGRAMS = {
    "singular": ("// ", "ring R = 0,({plain}),dp;", "ideal {} =", ";"),
    "maple": ("# ", "vars := [{spaced}]:", "{} := [", "]:"),
    "sage": (
        "# ",
        "from sage.all import PolynomialRing, QQ\n"
        "R = PolynomialRing(QQ, [{quoted}])\n({spaced},) = R.gens()",
        "{} = R.ideal([",
        "])",
    ),
}
"""How a comment begins, what comes first, and what each system begins and ends with."""
_WHICH = "k"
"""The variable of a file for msolve that says which of several systems a solution is of."""


def language_of(path: Path) -> str:
    """The language that the suffix of a file's name stands for."""
    given = f"ends in {path.suffix!r}" if path.suffix else "has no suffix"
    OptionError.refuse_if(
        path.suffix.lower() not in SUFFIXES,
        f"{visible(str(path))}: the name {given}; take .sing for Singular, .ms for "
        "msolve, .mpl for Maple or .sage for Sage",
    )
    return SUFFIXES[path.suffix.lower()]


def system_text(
    form: Any, language: str, names: Sequence[str] | None = None
) -> tuple[str, tuple[str, ...]]:
    """Return families of a `ClosedForm`, all or some, as a file for a program, and its comments."""
    OptionError.refuse_if(
        language not in LANGUAGES, f"no language {language!r}; there are {', '.join(LANGUAGES)}"
    )
    asked = asked_for({f.name: f for f in form.families}, names or ())
    chosen = [f for f in form.families if names is None or f.name in asked]
    arm = form.arm
    OptionError.refuse_if(
        not chosen, f"{arm.name}, task {arm.task}: there is no family to write equations of"
    )
    OptionError.refuse_if(
        form.geometry is None or not all(f.components for f in chosen),
        "the exact equations are not in a closed form that was read from a file: make it "
        "again with closed_form",
    )
    found = Systems(chosen, form.geometry, form.symbols)
    remarks = tuple(_remarks(form, found, language))
    if language == "msolve":
        return _msolve(found), remarks
    comment, first, begin, end = _PROGRAMS[language]
    plain, quoted = ",".join(found.names), ", ".join(f'"{name}"' for name in found.names)
    lines = [first.format(plain=plain, spaced=", ".join(found.names), quoted=quoted)]
    for name, part in (item for _, parts in found.families for item in parts.items()):
        polys = ",\n  ".join(map(str, (*part, *found.circles)))
        lines += [begin.format(name), f"  {polys}{end}"]
    body = "\n".join(lines)
    body = body.replace("^", "**") if language == "sage" else body
    return "".join(f"{comment}{line}\n" for line in remarks) + f"\n{body}\n", remarks


def _remarks(form: Any, found: Systems, language: str) -> Iterator[str]:
    """Return what a reader has to know of the equations, line by line."""
    arm = form.arm
    yield f"Singular configurations of {visible(arm.name)}, as exact equations (pinsing)"
    yield (
        f"robot {visible(arm.described)}, base {visible(arm.base)}, tip {visible(arm.tip)}, "
        f"task {arm.task}, generic rank {form.generic_rank}"
    )
    yield f"families: {form.word}"
    yield from (f"not complete: {visible(gap)}" for gap in form.gaps)
    named = zip(form.symbols, arm.joints, strict=True)
    yield "joints: " + ", ".join(f"{s} = {visible(joint)}" for s, joint in named)
    yield "variables: " + ", ".join(f"{name} = {what}" for name, what in found.variables)
    if free := [s for j, s in enumerate(form.symbols) if j not in found.joints]:
        yield f"in no equation, so free: {', '.join(free)}"
    if found.root:
        yield f"meant are solutions with {', '.join(f'r{d} > 0' for d in found.root)} alone"
    systems = [name for _, parts in found.families for name in parts]
    if language == "msolve" and len(systems) > 1:
        told = ", ".join(f"{i} = {name}" for i, name in enumerate(systems, 1))
        yield f"a file for msolve is one system; its first variable {_WHICH} says which: {told}"
    yield "meant are real solutions, within the joint limits or not"
    if form.snaps:
        yield "true of the nominal geometry, in which these numbers of the file were moved:"
        yield from (f"  {visible(snap)}" for snap in form.snaps)
        yield f"no column of the Jacobian changes by more than {form.jacobian_change:.1e} by that"
    known: dict[str, str] = {}
    for family, parts in found.families:
        yield f"{family.name}: {visible(family.text)}"
        if len(parts) > 1:
            yield f"  {family.name} is the union of {', '.join(parts)}"
        if not family.real:
            yield "  no real point of it is known"
        if family.also_regular:
            yield "  some solutions may be regular: singular are those at which the rank drops"
        same = known.setdefault(str([*parts.values()]), family.name)
        if same != family.name:
            yield f"  its equations are those of {same}: other real points of the same set"


def _msolve(found: Systems) -> str:
    """Return one system: that of the only family, or of all, told apart by one variable more."""
    # The polynomials of system i are multiplied by the product of k - m over all others m, so that
    # they must vanish where k = i alone; k is one of 1, 2, ...
    parts = [part for _, some in found.families for part in some.values()]
    names, polys = found.names, [*parts[0], *found.circles]
    if len(parts) > 1:
        names = [_WHICH, *names]
        context = fmpq_mpoly_ctx.get(names, Ordering.lex)
        apart = [context.gen(0) - i for i in range(1, len(parts) + 1)]
        polys = [math.prod(apart)]
        for i, part in enumerate(parts):
            others = math.prod(apart[:i] + apart[i + 1 :])
            polys += [others * p.project_to_context(context) for p in part]
        polys += [p.project_to_context(context) for p in found.circles]
    told = ",\n".join(str(p).replace(" ", "") for p in polys)
    return f"{','.join(names)}\n0\n{told}\n"
