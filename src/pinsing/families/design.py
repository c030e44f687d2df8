"""Closed forms with lengths as symbols: the design of an arm, and where it changes the answer.

A length is one variable of the ring more, as the value of a joint that slides is. Factors without
any joint say at which lengths every configuration is singular; they are told as assumptions.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component
from pinsing.algebra.decompose import Decomposition
from pinsing.algebra.equation import Equation, equation
from pinsing.algebra.generic_points import Residues
from pinsing.algebra.jacobian_matrix import constants, jacobian_matrix
from pinsing.algebra.matrix import Matrix
from pinsing.algebra.mimic import own_offsets
from pinsing.algebra.ring import Poly, Ring
from pinsing.algebra.surd_ring import ring_of
from pinsing.families.design_form import EVERYWHERE, DesignChange, DesignFamily, DesignForm
from pinsing.families.design_lengths import Lengths

_SEED = 11
_FOR_SEARCH = 0.7
_DIGITS = 4
"""Characters of a coefficient up to which it is written exactly: lengths have more."""
_LONGEST = 24
"""Terms beyond which an equation is told by its size."""


@dataclass(frozen=True)
class _Design:
    """The names and offsets that polynomials of a design are written with."""

    ring: Ring
    n: int
    names: tuple[str, ...]
    offset: Array

    def equation(self, poly: Poly) -> Equation:
        return equation(poly, self.ring, self.names, self.offset)

    def text(self, poly: Poly) -> str:
        return text_of(self.equation(poly))

    def moves(self, poly: Poly) -> bool:
        """Whether a joint occurs."""
        return any(j < self.n for j in self.ring.joints_of(poly))


def text_of(e: Equation, latex: bool = False) -> str:
    """An equation as one reads it, its coefficients exact."""
    if len(e.cos) > _LONGEST and not latex:
        return f"f({', '.join(e.joints[j] for j in e.involved)}) = 0 [{len(e.cos)} terms]"
    whole = all(len(c) <= _DIGITS for pair in e.exact for c in pair)
    return (whole and e.exact_text(latex)) or (e.latex() if latex else e.text())


def design_form(lengths: Lengths, joints: Sequence[str], seconds: float) -> DesignForm:
    """Families of a chain whose lengths are symbols, and where special lengths change them."""
    began = time.monotonic()
    geometry = lengths.geometry
    arm, n = geometry.arm, geometry.arm.n
    budget = Budget(_FOR_SEARCH * seconds)
    slides = (*(bool(p) for p in arm.prismatic), *(True for _ in lengths.symbols))
    ring = ring_of(slides, constants(geometry, arm.task), budget)
    matrix = jacobian_matrix(_symbolic(lengths, ring), ring, arm.task, budget)
    rank = _rank(matrix, ring)
    offset = np.concatenate([own_offsets(geometry), np.zeros(len(lengths.symbols))])
    design = _Design(ring, n, (*joints, *lengths.symbols), offset)
    search = Decomposition(lambda: matrix, rank, ring, budget)
    gaps = list(dict.fromkeys(search.gaps))
    families, assumed = _stated(search.components, design)
    changes: list[DesignChange] = []
    rest = Budget(max(seconds - (time.monotonic() - began), 0.1 * seconds))
    try:
        for change in _changes(families, assumed, matrix, rank, design, rest):
            changes.append(change)
    except BudgetExceeded as reason:
        gaps.append(f"special lengths were not all looked at: {reason}")
    return DesignForm(
        robot=arm.name,
        joints=tuple(joints),
        symbols=lengths.symbols,
        values=lengths.values,
        generic_rank=rank,
        families=tuple(f.stated for f in families),
        assumed=tuple(design.text(p).replace(" = 0", " ≠ 0") for p in assumed),
        changes=tuple(changes),
        complete=not gaps,
        gaps=tuple(gaps),
        seconds=time.monotonic() - began,
    )


def _symbolic(lengths: Lengths, ring: Ring) -> Any:
    """The chain with polynomials for lengths."""
    n = len(lengths.geometry.arm.prismatic)
    gens = ring.context.gens()
    own = [gens[ring.variables(n + k)[0]] for k in range(len(lengths.symbols))]
    placed = []
    for i, vector in enumerate(lengths.rest):
        row = []
        for k, value in enumerate(vector):
            total = ring.number(value)
            for symbol, part in zip(own, lengths.parts, strict=True):
                if part[i][k] != 0:
                    total = total + symbol * ring.number(part[i][k])
            row.append(total)
        placed.append(tuple(row))
    translation: Any = tuple(placed)
    return replace(lengths.geometry, translation=translation)


def _rank(matrix: Matrix, ring: Ring) -> int:
    residues, rng = Residues(ring), np.random.default_rng(_SEED)
    return max(residues.generic_rank(matrix, rng) for _ in range(2))


@dataclass(frozen=True)
class _Family:
    """What is stated, and the polynomials of one equation that it is the zeros of, if it is one."""

    stated: DesignFamily
    polys: tuple[Poly, ...]


def _stated(components: Sequence[Component], design: _Design) -> tuple[list[_Family], list[Poly]]:
    """Families for lengths in general, and polynomials that must not be zero."""
    general: dict[object, list[Component]] = {}
    assumed: list[Poly] = []
    for c in components:
        polys = [*(_at_value(j, v, design.ring) for j, v in c.values.items()), *c.relations]
        if all(design.moves(p) for p in polys):
            general.setdefault((*sorted(c.values), *map(str, c.relations)), []).append(c)
        elif len(polys) == 1:  # others are special lengths, told as such
            assumed.append(polys[0])
    found = []
    for group in general.values():
        for joined in _joined(group, design.ring):
            equations = tuple(design.equation(_product(polys)) for polys in joined)
            stated = DesignFamily(
                name="",
                text=" and ".join(text_of(e) for e in equations),
                latex=r",\ ".join(text_of(e, latex=True) for e in equations),
                equations=equations,
                codimension=len(joined),
            )
            found.append(_Family(stated, tuple(joined[0]) if len(joined) == 1 else ()))
    found.sort(key=lambda f: (f.stated.codimension, sum(len(e.cos) for e in f.stated.equations)))
    return (
        [replace(f, stated=replace(f.stated, name=f"F{i}")) for i, f in enumerate(found, 1)],
        assumed,
    )


def _joined(group: Sequence[Component], ring: Ring) -> list[list[list[Poly]]]:
    """Components that differ in joint values only: for each family, factors of each equation.

    Where all combinations of the values occur they are one family: q5 = 0 and q5 = 180 degrees
    is sin q5 = 0.
    """
    joints = sorted(group[0].values)
    values = [list(dict.fromkeys(c.values[j] for c in group)) for j in joints]
    relations = [[p] for p in group[0].relations]
    if math.prod(len(v) for v in values) == len(group):
        each = [
            [_at_value(j, v, ring) for v in some] for j, some in zip(joints, values, strict=True)
        ]
        return [each + relations]
    return [[[_at_value(j, c.values[j], ring)] for j in joints] + relations for c in group]


def _at_value(joint: int, value: Any, ring: Ring) -> Poly:
    gens, variables = ring.context.gens(), ring.variables(joint)
    if ring.prismatic[joint]:
        return gens[variables[0]] - ring.number(value[0])
    x, y = (gens[v] for v in variables)
    return x * ring.number(value[1]) - y * ring.number(value[0])


def _product(polys: Sequence[Poly]) -> Poly:
    total = polys[0]
    for p in polys[1:]:
        total = total * p
    return total


def _changes(
    families: Sequence[_Family],
    assumed: Sequence[Poly],
    matrix: Matrix,
    rank: int,
    design: _Design,
    time_left: Budget,
) -> Iterator[DesignChange]:
    """What becomes of families of one equation where lengths are zero, or equal up to the sign."""
    used = {s for f in families for p in f.polys for s in design.ring.joints_of(p) if s >= design.n}
    used |= {s for p in assumed for s in design.ring.joints_of(p)}
    together = {
        pair
        for f in families
        for p in f.polys
        for pair in itertools.combinations(sorted(set(design.ring.joints_of(p)) & used), 2)
    }
    whole = set()
    for s in sorted(used):
        for change in _at(
            f"{design.names[s]} = 0", {s: None}, families, matrix, rank, design, time_left
        ):
            if change.kind == EVERYWHERE:
                whole.add(design.names[s])
            yield change
    for s, t in sorted(together):
        for sign in (1, -1):
            condition = f"{design.names[s]} = {'-' if sign < 0 else ''}{design.names[t]}"
            told = _at(condition, {s: (t, sign)}, families, matrix, rank, design, time_left)
            yield from (c for c in told if c.kind != "becomes")
        if design.names[s] not in whole and design.names[t] not in whole:
            time_left.check()
            if _rank(_put(matrix, {s: None, t: None}, design.ring), design.ring) < rank:
                both = f"{design.names[s]} = {design.names[t]} = 0"
                yield DesignChange(both, "", EVERYWHERE, ())


Special = Mapping[int, tuple[int, int] | None]
"""Symbols that are zero (None), or plus or minus another one."""


def _put(matrix: Matrix, special: Special, ring: Ring) -> Matrix:
    """A matrix at special lengths."""
    return [[_there(x, special, ring) for x in row] for row in matrix]


def _there(poly: Poly, special: Special, ring: Ring) -> Poly:
    if poly == 0:
        return poly
    images = list(ring.context.gens())
    for symbol, same in special.items():
        one = ring.zero if same is None else images[ring.variables(same[0])[0]] * same[1]
        images[ring.variables(symbol)[0]] = one
    return ring.reduce(poly.compose(*images, ctx=ring.context))


def _at(
    condition: str,
    special: Special,
    families: Sequence[_Family],
    matrix: Matrix,
    rank: int,
    design: _Design,
    time_left: Budget,
) -> Iterator[DesignChange]:
    """What becomes of the families at special lengths."""
    ring = design.ring
    time_left.check()
    if _rank(_put(matrix, special, ring), ring) < rank:
        yield DesignChange(condition, "", EVERYWHERE, ())
        return
    parts: dict[str, dict[str, Poly]] = {}
    for f in families:
        found: dict[str, Poly] = {}
        for p in f.polys:
            became = _there(p, special, ring)
            time_left.check_factor(len(became))
            found |= {str(h): h for h in ring.factors(became) if design.moves(h)}
        parts[f.stated.name] = found
    for f in families:
        if not f.polys:
            continue
        mine = parts[f.stated.name]
        if set(mine) == {str(p) for p in f.polys}:
            continue  # it is as it was
        before = {j for p in f.polys for j in ring.joints_of(p) if j < design.n}
        after = {j for p in mine.values() for j in ring.joints_of(p) if j < design.n}
        shared = [
            g.stated.name for g in families if g is not f and set(parts[g.stated.name]) & set(mine)
        ]
        texts = tuple(design.text(_product(group)) for group in _grouped(mine.values(), ring))
        name = f.stated.name
        if not mine:
            yield DesignChange(condition, name, "vanishes", ())
        elif len(texts) > 1:
            yield DesignChange(condition, name, "splits", texts)
        elif before != after:
            yield DesignChange(condition, name, "becomes", texts)
        if shared:
            yield DesignChange(condition, name, "merges", tuple(shared))


def _grouped(polys: Any, ring: Ring) -> list[list[Poly]]:
    """Values of one joint together, all else alone."""
    groups: dict[object, list[Poly]] = {}
    for p in polys:
        fixed = ring.joint_value(p)
        groups.setdefault(object() if fixed is None else fixed[0], []).append(p)
    return sorted(groups.values(), key=lambda g: (len(g[0]), str(g[0])))
