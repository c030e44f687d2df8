"""What becomes of an arm's families where lengths or twists have special values."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pinsing.algebra.budget import Budget
from pinsing.algebra.generic_points import Residues
from pinsing.algebra.matrix import Matrix
from pinsing.algebra.ring import Poly
from pinsing.families.design_form import EVERYWHERE, DesignChange, DesignFamily, DesignNames

Images = Mapping[int, tuple[int, int | None]]
"""For some variables a number times another variable, or a number alone."""


@dataclass(frozen=True)
class SpecialDesign:
    """Special values of symbols.

    Attributes
    ----------
    condition : str
        ``a5 = 0``, ``a2 = -a3``, ``alpha4 = 90°``.
    symbols : tuple of int
        Which symbols it is about.
    images : Images
        What it puts in for variables.
    renames : bool
        Whether it is about two symbols: what has one of them alone only has another name for it.
    """

    condition: str
    symbols: tuple[int, ...]
    images: Images
    renames: bool = False


@dataclass(frozen=True)
class FoundFamily:
    """What is stated, and the polynomials of one equation that it is the zeros of, if it is one."""

    stated: DesignFamily
    polys: tuple[Poly, ...]

    @property
    def name(self) -> str:
        """F1, F2, ..."""
        return self.stated.name


class Changes:
    """Looks at special values, one after the other.

    Parameters
    ----------
    families : sequence of FoundFamily
        Those of one equation.
    assumed : sequence of Poly
        What must not be zero, without a joint.
    matrix : Matrix
        The Jacobian.
    rank : int
        In general.
    names : DesignNames
        What it is written with.
    time : Budget
        After which it ends.
    """

    def __init__(
        self,
        families: Sequence[FoundFamily],
        assumed: Sequence[Poly],
        matrix: Matrix,
        rank: int,
        names: DesignNames,
        time: Budget,
    ) -> None:
        self.families, self.assumed, self.matrix, self.rank = families, assumed, matrix, rank
        self.names, self.ring, self.time = names, names.ring, time
        self._residues = Residues(self.ring)
        self._rng = np.random.default_rng(11)

    def all(self) -> Iterator[DesignChange]:
        """Return the changes at lengths that are zero or equal but for sign, and at right twists.

        Raises
        ------
        BudgetExceeded
            If time is over.
        """
        n, slides = self.names.n, self.ring.prismatic
        within = [
            {s for s in self.ring.joints_of(p) if s >= n} for f in self.families for p in f.polys
        ]
        used = set().union(*within, *(self.ring.joints_of(p) for p in self.assumed))
        whole = set()
        for s in sorted(used):
            for special in self._alone(s):
                for change in self._at(special):
                    if change.kind == EVERYWHERE:
                        whole.add(s)
                    yield change
        lengths = [sorted(s for s in some if slides[s]) for some in within]
        together = {pair for some in lengths for pair in itertools.combinations(some, 2)}
        for s, t in sorted(together):
            for sign in (1, -1):
                yield from (c for c in self._at(self._equal(s, t, sign)) if c.kind != "becomes")
        yield from self._without_lengths(whole)

    def _without_lengths(self, told: Collection[int]) -> Iterator[DesignChange]:
        """Lengths that make every configuration singular when they are zero at once.

        Whatever the families are; fewest first, and of those that do so no larger sets. Those that
        do so alone and were told are left out.
        """
        lengths = [s for s in range(self.names.n, len(self.names.names)) if self.ring.prismatic[s]]
        enough = [{s} for s in told]
        # Lengths that are zero at once, at most, where it is asked whether all is singular.
        for size in range(1, 3 + 1):
            for some in itertools.combinations(lengths, size):
                if any(known <= set(some) for known in enough):
                    continue
                self.time.check()
                if self._everywhere({self.ring.variables(s)[0]: (0, None) for s in some}):
                    enough.append(set(some))
                    condition = " = ".join(self.names.names[s] for s in some)
                    yield DesignChange(f"{condition} = 0", "", EVERYWHERE, ())

    def _alone(self, s: int) -> Iterator[SpecialDesign]:
        """Special values of one symbol."""
        name, variables = self.names.names[s], self.ring.variables(s)
        if self.ring.prismatic[s]:
            yield SpecialDesign(f"{name} = 0", (s,), {variables[0]: (0, None)})
            return
        # Right angles that a twist is tried at.
        for turn in (0, 2, 1, -1):
            quarters = turn + float(self.names.offset[s]) / (math.pi / 2)
            if abs(quarters - round(quarters)) < 1e-9:
                # Half-angle coordinates of no, one, two and three right angles.
                point = ((1, 0), (1, 1), (0, 1), (1, -1))[round(quarters) % 4]
                images = {v: (x, None) for v, x in zip(variables, point, strict=True)}
                yield SpecialDesign(f"{name} = {90 * turn}°", (s,), images)

    def _equal(self, s: int, t: int, sign: int) -> SpecialDesign:
        """Two lengths that are equal but for a sign."""
        names = self.names.names
        images = {self.ring.variables(s)[0]: (sign, self.ring.variables(t)[0])}
        minus = "-" if sign < 0 else ""
        return SpecialDesign(f"{names[s]} = {minus}{names[t]}", (s, t), images, renames=True)

    def _at(self, special: SpecialDesign) -> Iterator[DesignChange]:
        """Return what becomes of the families at special values."""
        self.time.check()
        condition, ring = special.condition, self.ring
        if self._everywhere(special.images):
            yield DesignChange(condition, "", EVERYWHERE, ())
            return
        touched = [f for f in self.families if self._touches(f, special)]
        if not touched:
            return
        parts = {f.name: self._parts(f, special) for f in self.families}
        for f in touched:
            mine = parts[f.name]
            if len(mine) == len(f.polys) and all(_has(f.polys, p) for p in mine):
                continue  # it is as it was
            before = {j for p in f.polys for j in ring.joints_of(p) if j < self.names.n}
            after = {j for p in mine for j in ring.joints_of(p) if j < self.names.n}
            groups = self._grouped(mine)
            if not mine:
                yield DesignChange(condition, f.name, "vanishes", ())
            elif len(groups) > 1:
                yield DesignChange(condition, f.name, "splits", self._texts(groups))
            elif before != after:
                yield DesignChange(condition, f.name, "becomes", self._texts(groups))
            others = [g.name for g in self.families if g is not f]
            shared = tuple(g for g in others if any(_has(parts[g], p) for p in mine))
            if shared:
                yield DesignChange(condition, f.name, "merges", shared)

    def _touches(self, family: FoundFamily, special: SpecialDesign) -> bool:
        """Return True if special values say anything of a family but the name of a symbol."""
        known = {s for p in family.polys for s in self.ring.joints_of(p)}
        need = all if special.renames else any
        return need(s in known for s in special.symbols)

    def _parts(self, family: FoundFamily, special: SpecialDesign) -> list[Poly]:
        """The irreducible polynomials with joints that it is the zeros of there."""
        found: list[Poly] = []
        touched = self._touches(family, special)
        for p in family.polys:
            became = self._there(p, special.images)
            if became == 0:
                continue
            self.time.check_factor(len(became))
            if became == p or not touched or self._irreducible(became):
                factors = [became]
            else:
                factors = self.ring.factors(became)
            found += [h for h in factors if self.names.moves(h) and h not in found]
        return found

    def _irreducible(self, poly: Poly) -> bool:
        """Return True if a polynomial is A s + B in a length s, without a common factor.

        To see that takes a fraction of the time that factoring does.
        """
        degrees, gens = poly.degrees(), self.ring.context.gens()
        best: tuple[Poly, Poly] | None = None
        for s, slides in enumerate(self.ring.prismatic):
            (v, *_) = self.ring.variables(s)
            if not slides or degrees[v] != 1:
                continue
            lead = poly.derivative(v)
            low = poly - gens[v] * lead
            if low != 0 and (best is None or len(lead) < len(best[0])):
                best = lead, low
        return best is not None and self.ring.is_constant(self.ring.gcd(*best))

    def _everywhere(self, images: Images) -> bool:
        """Return True if the rank is less at all configurations."""
        for _ in range(2):  # one that is regular is enough
            point = self._residues.random_point(self._rng)
            for v, (number, other) in images.items():
                point[v] = number * (1 if other is None else point[other]) % self._residues.prime
            if self._residues.rank_at(self.matrix, point) >= self.rank:
                return False
        return True

    def _there(self, poly: Poly, images: Images) -> Poly:
        """A polynomial at special values."""
        degrees = poly.degrees()
        if not any(degrees[v] for v in images):
            return poly
        put = list(self.ring.context.gens())
        for v, (number, other) in images.items():
            put[v] = self.ring.one * number if other is None else put[other] * number
        return self.ring.strip(self.ring.reduce(poly.compose(*put, ctx=self.ring.context)))

    def _texts(self, groups: Sequence[Sequence[Poly]]) -> tuple[str, ...]:
        return tuple(self.names.text(math.prod(g[1:], start=g[0])) for g in groups)

    def _grouped(self, polys: Sequence[Poly]) -> list[list[Poly]]:
        """Values of one joint together, all else alone."""
        groups: dict[object, list[Poly]] = {}
        for p in polys:
            fixed = self.ring.joint_value(p)
            groups.setdefault(object() if fixed is None else fixed[0], []).append(p)
        return sorted(groups.values(), key=lambda g: (len(g[0]), min(g[0].monoms())))


def _alike(p: Poly, q: Poly) -> bool:
    """Return True if one is a multiple of the other by a number."""
    if len(p) != len(q) or p.degrees() != q.degrees():
        return False
    return bool(p * q.leading_coefficient() == q * p.leading_coefficient())


def _has(polys: Sequence[Poly], p: Poly) -> bool:
    return any(_alike(p, q) for q in polys)
