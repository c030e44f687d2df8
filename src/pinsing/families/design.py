"""Closed forms with lengths as symbols, and what becomes of families at special values.

A length is one variable of the ring more, as the value of a joint that slides is; a twist is two,
as a joint that turns. Factors without any joint say at which of them every configuration is
singular; they are told as assumptions.

Placements depend on the lengths of a table linearly while its angles stand. So what a length does
is seen from the chain in which it is 1 m and all others are zero: whatever the convention, and
wherever the way from table to placements puts it. A twist turns what comes after it as a joint
does: it is one of the chain that is looked at, about x, that does not count as a motion.
"""

from __future__ import annotations

import functools
import itertools
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin
from flint import Ordering, fmpq_mpoly_ctx

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, decompose
from pinsing.algebra.equation import Equation, equation, format_angle
from pinsing.algebra.generic_points import Residues
from pinsing.algebra.jacobian_matrix import constants, jacobian_matrix
from pinsing.algebra.ring import Matrix, Poly, Ring, make_ring
from pinsing.description.dh_table import (
    BASE,
    FLANGE,
    TIP,
    DHTable,
    Placement,
    bare_urdf,
    read_dh,
    with_turns,
)
from pinsing.errors import ConfigurationError, OptionError, PinsingError, UnknownNameError
from pinsing.interface import JsonResult, checked
from pinsing.measures import Array, ArrayLike
from pinsing.robot.arm import Arm
from pinsing.robot.load import load
from pinsing.robot.mimic import own_rows
from pinsing.robot.nominal import ExactPlacements, Length3, Nominal, flatten, nominal


@dataclass(frozen=True)
class DesignNames:
    """The names and offsets that polynomials of a design are written with."""

    ring: Ring  # of the polynomials: in joints, then in symbols
    n: int  # number of joints
    names: tuple[str, ...]  # of joints and symbols
    offset: Array  # radians added to each that is an angle

    def equation(self, poly: Poly) -> Equation:
        """The polynomial as a sum of cosines and sines."""
        return equation(poly, self.ring, self.names, self.offset)

    def text(self, poly: Poly) -> str:
        """Its zeros in one line."""
        return text_of(self.equation(poly))

    def moves(self, poly: Poly) -> bool:
        """Return True if a joint occurs."""
        return any(j < self.n for j in self.ring.joints_of(poly))


def text_of(e: Equation, latex: bool = False) -> str:
    """An equation as one reads it, its coefficients exact."""
    written = int((e.cos != 0).sum() + (e.sin != 0).sum())
    # Terms beyond which an equation is told by its size.
    if written > 24 and not latex:
        return f"f({', '.join(e.joints[j] for j in e.involved)}) = 0 [{len(e.cos)} terms]"
    # Characters of a coefficient up to which it is written exactly: lengths have more.
    whole = all(len(c) <= 4 for pair in e.exact for c in pair)
    return (whole and e.exact_text(latex)) or (e.latex() if latex else e.text())


EVERYWHERE = "singular everywhere"


@dataclass(frozen=True, eq=False)
class DesignFamily:
    """One family, for lengths in general.

    Attributes
    ----------
    name : str
        F1, F2, ...
    text, latex : str
        Its equations, exactly: ``a2 cos q2 + a3 cos(q2+q3) - d5 sin(q2+q3+q4) = 0``.
    equations : tuple of Equation
        In the joints, and after these the symbols, as in ``DesignForm.variables``.
    codimension : int
        How many equations it takes.
    """

    name: str
    text: str
    latex: str
    equations: tuple[Equation, ...]
    codimension: int

    def __str__(self) -> str:
        return f"{self.name}  {self.text}"


@dataclass(frozen=True)
class DesignChange:
    """What becomes of a family at special lengths.

    Attributes
    ----------
    condition : str
        ``a5 = 0``, ``a2 = -a3``.
    family : str
        Its name; empty where all of the arm is meant, or a family that is not there in general.
    kind : str
        ``splits``, ``merges``, ``becomes``, ``vanishes``, ``appears`` or ``singular everywhere``.
    into : tuple of str
        Equations, or names of families.
    """

    condition: str
    family: str
    kind: str
    into: tuple[str, ...]

    def __str__(self) -> str:
        into = "; ".join(self.into)
        more = "one family" if len(self.into) == 1 else f"{len(self.into)} families"
        return f"at {self.condition}: " + {
            "splits": f"{self.family} splits into {len(self.into)}: {into}",
            "merges": f"{self.family} is the same as, or has a part of, {into}",
            "becomes": f"{self.family} becomes {into}",
            "vanishes": f"{self.family} has no configuration any more",
            "appears": f"{more} more, {into}",
            EVERYWHERE: "every configuration is singular",
        }.get(self.kind, self.kind)


@dataclass(frozen=True, eq=False, repr=False)
class DesignForm(JsonResult):
    """Closed form of an arm whose lengths are symbols.

    Attributes
    ----------
    robot : str
        Name of the robot.
    joints : tuple of str
        Symbols of the joints, as q1, d3.
    symbols : tuple of str
        The lengths, and twists, that stayed symbols.
    values : tuple of float
        Their values in the file, metres and radians.
    generic_rank : int
        For lengths in general.
    families : tuple of DesignFamily
        Those that lengths in general have.
    assumed : tuple of str
        What was assumed, such as ``a2 ≠ 0``: else every configuration is singular.
    changes : tuple of DesignChange
        Where a length that is zero, or two that are equal but for the sign, change the answer. Of
        families of one equation; those of more are looked at by putting numbers in.
    complete : bool
        Whether the search ended.
    gaps : tuple of str
        What is missing, where it did not.
    seconds : float
        How long it took.
    angles : tuple of bool
        Which symbols are twists.
    """

    schema: ClassVar[str] = "pinsing/design/1"
    made_by: ClassVar[str] = "pinsing.closed_form(arm, symbols=True)"

    robot: str
    joints: tuple[str, ...]
    symbols: tuple[str, ...]
    values: tuple[float, ...]
    generic_rank: int
    families: tuple[DesignFamily, ...]
    assumed: tuple[str, ...]
    changes: tuple[DesignChange, ...]
    complete: bool
    gaps: tuple[str, ...]
    seconds: float
    angles: tuple[bool, ...] = field(default=(), metadata={"optional": True})

    @property
    def variables(self) -> tuple[str, ...]:
        """Variables of the equations: joints, then symbols."""
        return self.joints + self.symbols

    @checked
    def residuals(
        self, family: str, q: ArrayLike, lengths: Mapping[str, float] | None = None
    ) -> Array:
        """Return the values of the equations of a family at q with numbers put in for its symbols.

        Parameters
        ----------
        family : str
            Its name.
        q : (..., n) array_like
            Radians and metres.
        lengths : mapping of str to float, optional
            Metres, and radians for twists; those that are left out are as in the file.

        Returns
        -------
        (..., k) array
            Zero on the family, each over the sum of its coefficients' magnitudes.

        Raises
        ------
        UnknownNameError
            If there is no such family, or no such symbol.
        ConfigurationError
            If q has not n values.

        Examples
        --------
        >>> import pinsing
        >>> form = pinsing.closed_form(pinsing.load("ur5"), symbols=True)
        >>> form.families[1].text
        'sin q3 = 0'
        >>> form.residuals("F2", [0, 1, 0, 1, 1, 1], {"elbow_joint_x": 0.7})
        array([0.])
        """
        found = next((f for f in self.families if f.name == family), None)
        if found is None:
            raise UnknownNameError("family", family, tuple(f.name for f in self.families))
        given = dict(lengths or {})
        for name in given:
            UnknownNameError.refuse_if(name not in self.symbols, "length", name, self.symbols)
        array = np.asarray(q, dtype=float)
        ConfigurationError.refuse_if(
            array.shape[-1:] != (len(self.joints),),
            f"q needs {len(self.joints)} values for {', '.join(self.joints)}, got shape "
            f"{array.shape}",
        )
        numbers = [given.get(s, v) for s, v in zip(self.symbols, self.values, strict=True)]
        rest = np.broadcast_to(numbers, (*array.shape[:-1], len(numbers)))
        whole = np.concatenate([array, rest], axis=-1)
        return np.stack([e(whole) / e.size for e in found.equations], axis=-1)

    def __str__(self) -> str:
        angles = self.angles or (False,) * len(self.symbols)
        known = ", ".join(
            f"{s} = {format_angle(v) if angle else f'{v:g} m'}"
            for s, v, angle in zip(self.symbols, self.values, angles, strict=True)
        )
        what = "lengths and twists" if any(angles) else "lengths"
        word = "complete" if self.complete else "NOT complete"
        many = "family" if len(self.families) == 1 else "families"
        lines = [
            f"{self.robot}: {len(self.families)} {many} of singular configurations, {word}, for "
            f"{what} in general ({1e3 * self.seconds:.0f} ms)",
            f"  symbols, and what the file has: {known}",
            *(f"  {f}" for f in self.families),
        ]
        if self.assumed:
            lines.append(
                f"  assumed: {', '.join(self.assumed)} (else every configuration is singular)"
            )
        if self.changes:
            lines.append("  where the design changes the answer:")
            lines += [f"    {c}" for c in self.changes]
        lines += [f"  missing: {gap}" for gap in self.gaps]
        return "\n".join(lines)


_AXES = dict(zip("xyz", np.eye(3), strict=True))


@dataclass(frozen=True, eq=False)
class Lengths:
    """A chain whose placements are sums of symbols."""

    # the chain with the numbers of its file; twists that are symbols are joints of it
    geometry: Nominal
    symbols: tuple[str, ...]  # names of the lengths and twists
    angles: tuple[bool, ...]  # which of them are twists
    values: tuple[float, ...]  # their values in the file, metres and radians
    # for each joint of the chain its number among the arm's own, or theirs and the symbols' number
    # after these
    order: tuple[int, ...]
    # for each symbol by what it counts in each coordinate of each placement
    parts: tuple[tuple[Length3, ...], ...]
    rest: tuple[Length3, ...]  # what is no symbol, metres

    @property
    def joints(self) -> int:
        """Number of joints of the arm."""
        return len(self.geometry.prismatic) - sum(self.angles)

    @property
    def offset(self) -> Array:
        """Radians added to each joint of the arm and to each symbol that is a twist; else zero."""
        offset = np.zeros(self.joints + len(self.symbols))
        offset[list(self.order)] = self.geometry.offset[own_rows(self.geometry)]
        return offset


def of_table(arm: Arm, table: DHTable, chosen: Sequence[str] | None, angle_tol: float) -> Lengths:
    """Lengths a1, d1, a2, ... and twists alpha1, ...; by default all lengths that are not zero."""
    # A joint that slides has no d but its value.
    rows = dict(enumerate(table.rows, 1))
    known = {f"{x}{i}": getattr(row, x) for i, row in rows.items() for x in "ad"
             if x == "a" or row.type != "prismatic"}  # fmt: skip
    twists = {f"alpha{i}": row.alpha for i, row in rows.items()}
    names = _chosen(known, twists, chosen)
    turning = [i for i, name in enumerate(twists, 1) if name in names]

    def exact(values: Mapping[str, float], **changed: Any) -> tuple[Length3, ...]:
        some = [
            replace(row, a=values[f"a{i}"], d=values.get(f"d{i}", row.d)) for i, row in rows.items()
        ]
        urdf = bare_urdf(replace(table, rows=tuple(some), **changed), turning)
        made = replace(arm, model=pin.buildModelFromXML(urdf))
        raw = flatten(made)
        return ExactPlacements(raw, ["a placement"] * len(raw.R), angle_tol, arm=made).translation

    zero = dict.fromkeys((f"{x}{i}" for i in rows for x in "ad"), 0.0)
    try:
        if turning:
            arm = load(bare_urdf(table, turning), tip=arm.tip).with_task(arm.task)
        geometry = nominal(arm, angle_tol)
    except PinsingError as error:
        raise OptionError(f"the table makes no chain: {error}") from None
    parts = [
        exact({**zero, name: 1.0} if name in known else zero, tool=table.tool and Placement())
        for name in names
    ]
    rest = exact({name: 0.0 if name in names else v for name, v in known.items()})
    place = {f"{i}_twist": len(rows) + names.index(f"alpha{i}") for i in turning}
    own = itertools.count()
    chain = [name for name, axis, _ in with_turns(table, turning) if axis]
    values = {**known, **twists}
    made = Lengths(
        geometry=geometry,
        symbols=names,
        angles=tuple(name in twists for name in names),
        values=tuple(values[name] for name in names),
        order=tuple(place[name] if name in place else next(own) for name in chain),
        parts=tuple(parts),
        rest=rest,
    )
    # Whether the sums are the chain: else a length stands where angles were moved.
    whole, plain, each = (np.array(x, dtype=float) for x in (geometry.translation, rest, parts))
    off = np.abs(plain + np.tensordot(made.values, each, 1) - whole)
    OptionError.refuse_if(
        bool((off > 1e-9 * np.maximum(1.0, np.abs(whole))).any()),
        "the placements of the table are no plain sums of its lengths: its angles are "
        "too far from exact ones for symbols",
    )
    return made


def of_arm(arm: Arm, chosen: Sequence[str] | None, angle_tol: float) -> Lengths:
    """Return the lengths of an arm, of its DH table or named after joints (elbow_joint_x, tool_x).

    Along the axes of the exact frames, z the joint's, from the axis before to this one.
    """
    path = Path(arm.source.label)
    whole = arm.base == BASE and arm.tip in (TIP, FLANGE)
    if whole and path.suffix.lower() in (".yaml", ".yml") and path.is_file():
        table = read_dh(path)
        if [row.name for row in table.rows] == list(arm.joints):
            return of_table(arm, table, chosen, angle_tol)
    geometry = nominal(arm, angle_tol)
    ends = ["base", *list(arm.model.names)[1:], "tool"]
    found: dict[str, tuple[int, int, Fraction]] = {}
    for i, vector in enumerate(geometry.translation[1:], 1):
        for k, value in enumerate(vector):
            if value != 0:
                found[f"{ends[i + 1]}_{'xyz'[k]}"] = i, k, value
    names = _chosen({n: float(abs(v)) for n, (_, _, v) in found.items()}, {}, chosen)
    parts, rest = [], [list(v) for v in geometry.translation]
    for name in names:
        i, k, value = found[name]
        part = [[Fraction(0)] * 3 for _ in geometry.translation]
        part[i][k] = Fraction(1 if value > 0 else -1)
        rest[i][k] = Fraction(0)
        parts.append(_triples(part))
    return Lengths(
        geometry=geometry,
        symbols=names,
        angles=(False,) * len(names),
        values=tuple(float(abs(found[n][2])) for n in names),
        order=tuple(range(len(geometry.prismatic))),
        parts=tuple(parts),
        rest=_triples(rest),
    )


def _chosen(
    known: dict[str, float], twists: dict[str, float], chosen: Sequence[str] | None
) -> tuple[str, ...]:
    if chosen is None:
        names = tuple(n for n, v in known.items() if v != 0)
    else:
        names = tuple(dict.fromkeys(n.strip() for n in chosen if n.strip()))
        for name in names:
            UnknownNameError.refuse_if(
                name not in known and name not in twists, "length", name, (*known, *twists)
            )
    OptionError.refuse_if(not names, "no length is to be a symbol: all are zero, or none was named")
    return names


def _triples(rows: Sequence[Sequence[Fraction]]) -> tuple[Length3, ...]:
    return tuple((r[0], r[1], r[2]) for r in rows)


Images = Mapping[int, Poly]
"""For some variables a number times another variable, or a number alone."""


Found = Sequence[tuple[DesignFamily, tuple[Poly, ...]]]
"""What is stated, and the polynomials of one equation that it is the zeros of, if it is one."""


class Changes:
    """Looks at special values of families of one equation, within a time.

    ``assumed`` are polynomials without a joint that must not be zero.
    """

    def __init__(
        self,
        families: Mapping[str, Sequence[Poly]],
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
        """Return the changes at lengths that are zero or equal but for sign, and right twists."""
        n, names, ring = self.names.n, self.names.names, self.ring
        polys = itertools.chain(*self.families.values())
        within = [{s for s in ring.joints_of(p) if s >= n} for p in polys]
        used = set().union(*within, *(ring.joints_of(p) for p in self.assumed))
        everywhere: list[set[int]] = []  # smallest sets of lengths that, zero at once, make all so
        for s in sorted(used):
            for condition, images in self._alone(s):
                for change in self._at(condition, (s,), images):
                    if change.kind == EVERYWHERE:
                        everywhere.append({s})
                    yield change
        lengths = [s for s in range(n, len(names)) if ring.prismatic[s]]
        pairs = itertools.combinations(lengths, 2)
        for s, t in (pair for pair in pairs if any(some >= {*pair} for some in within)):
            first, second = (ring.variables(k)[0] for k in (s, t))
            for sign, minus in ((1, ""), (-1, "-")):
                images = {first: sign * ring.context.gen(second)}
                changes = self._at(f"{names[s]} = {minus}{names[t]}", (s, t), images)
                yield from (c for c in changes if c.kind != "becomes")
        # Lengths that are zero at once, at most, where it is asked whether all is singular.
        for size in range(1, 3 + 1):
            for zero in itertools.combinations(lengths, size):
                if any(known <= {*zero} for known in everywhere):
                    continue
                self.time.check()
                if self._everywhere({ring.variables(s)[0]: ring.zero for s in zero}):
                    everywhere.append({*zero})
                    condition = " = ".join(names[s] for s in zero)
                    yield DesignChange(f"{condition} = 0", "", EVERYWHERE, ())

    def _alone(self, s: int) -> Iterator[tuple[str, Images]]:
        """Special values of one symbol: ``a5 = 0``, ``alpha4 = 90°``, and what they put in."""
        name, variables = self.names.names[s], self.ring.variables(s)
        if self.ring.prismatic[s]:
            yield f"{name} = 0", {variables[0]: self.ring.zero}
            return
        # Right angles that a twist is tried at.
        for turn in (0, 2, 1, -1):
            quarters = turn + float(self.names.offset[s]) / (math.pi / 2)
            if abs(quarters - round(quarters)) < 1e-9:
                # Half-angle coordinates of no, one, two and three right angles.
                point = ((1, 0), (1, 1), (0, 1), (1, -1))[round(quarters) % 4]
                images = {v: self.ring.number(x) for v, x in zip(variables, point, strict=True)}
                yield f"{name} = {90 * turn}°", images

    def _at(self, condition: str, symbols: Sequence[int], images: Images) -> Iterator[DesignChange]:
        """Return what becomes of the families at special values of some symbols."""
        self.time.check()
        ring = self.ring
        if self._everywhere(images):
            yield DesignChange(condition, "", EVERYWHERE, ())
            return
        # Families of which special values say anything but the name of a symbol: what has one of
        # two symbols alone only has another name for it.
        touched = [
            name
            for name, polys in self.families.items()
            if all(any(s in ring.joints_of(p) for p in polys) for s in symbols)
        ]
        parts = {
            name: self._parts(polys, images, name in touched)
            for name, polys in (self.families if touched else {}).items()
        }
        for name in touched:
            polys, mine = self.families[name], parts[name]
            if len(mine) == len(polys) and all(_has(polys, p) for p in mine):
                continue  # it is as it was
            before, after = (
                {j for p in some for j in ring.joints_of(p) if j < self.names.n}
                for some in (polys, mine)
            )
            groups = sorted(_grouped(mine, ring), key=lambda g: (len(g[0]), min(g[0].monoms())))
            into = tuple(self.names.text(math.prod(g)) for g in groups)
            if not mine:
                yield DesignChange(condition, name, "vanishes", ())
            elif len(groups) > 1:
                yield DesignChange(condition, name, "splits", into)
            elif before != after:
                yield DesignChange(condition, name, "becomes", into)
            shared = tuple(
                other
                for other, theirs in parts.items()
                if other != name and any(_has(theirs, p) for p in mine)
            )
            if shared:
                yield DesignChange(condition, name, "merges", shared)

    def _parts(self, polys: Sequence[Poly], images: Images, touched: bool) -> list[Poly]:
        """The irreducible polynomials with joints that it is the zeros of there."""
        found: list[Poly] = []
        for p in polys:
            became = p
            if any(p.degrees()[v] for v in images):
                put = [images.get(v, gen) for v, gen in enumerate(self.ring.context.gens())]
                composed = p.compose(*put, ctx=self.ring.context)
                became = self.ring.strip(self.ring.reduce(composed))
            if became == 0:
                continue
            self.time.check_factor(len(became))
            factors = self.ring.factors(became) if touched and became != p else [became]
            found += [h for h in factors if self.names.moves(h) and h not in found]
        return found

    def _everywhere(self, images: Images) -> bool:
        """Return True if the rank is less at all configurations."""
        for _ in range(2):  # one that is regular is enough
            point = self._residues.random_point(self._rng)
            for v, image in images.items():
                point[v] = int(self._residues.of(image)(*point)) if image != 0 else 0
            if self._residues.rank_at(self.matrix, point) >= self.rank:
                return False
        return True


def _grouped(polys: Sequence[Poly], ring: Ring) -> list[list[Poly]]:
    """Values of one joint, or twist, together, all else alone."""
    groups: dict[object, list[Poly]] = {}
    for p in polys:
        fixed = ring.joint_value(p)
        groups.setdefault(str(p) if fixed is None else fixed[0], []).append(p)
    return list(groups.values())


def _has(polys: Sequence[Poly], p: Poly) -> bool:
    """Return True if one of some polynomials is a multiple of another one by a number."""
    lead = p.leading_coefficient()
    same = (q for q in polys if len(p) == len(q) and p.degrees() == q.degrees())
    return any(p * q.leading_coefficient() == q * lead for q in same)


def unreal(e: Equation, n: int) -> str:
    """Return the lengths at which an equation in n joints has no solution; empty if not decided."""
    # Such as ``|a1| > |a2| + sqrt(d4^2 + a3^2)``.
    if e.powers[:, :n].any() or e.frequencies[:, n:].any() or not e.exact or not e.powers.any():
        return ""
    context = fmpq_mpoly_ctx.get(list(e.joints[n:]), Ordering.lex)
    # What cosine and sine of each angle are multiplied by: polynomials in the lengths.
    found: dict[tuple[int, ...], list[Poly]] = {}
    for f, p, pair in zip(e.frequencies.tolist(), e.powers.tolist(), e.exact, strict=True):
        both = found.setdefault(tuple(f), [context.constant(0)] * 2)
        for k, number in enumerate(pair):
            try:
                both[k] += int(number) * context.term(exp_vec=p[n:])
            except ValueError:  # with a square root
                return ""
    constant = found.pop((0,) * e.frequencies.shape[1], None)
    # Phases beyond which nobody reads the condition.
    if constant is None or not 0 < len(found) <= 3:
        return ""
    if np.linalg.matrix_rank(np.array(list(found))) < len(found):
        return ""
    parts = [part for pair in (constant, *found.values()) for part in pair if part != 0]
    shared = functools.reduce(lambda a, b: a.gcd(b), (part.term_content() for part in parts))
    first, *others = (_size([p / shared for p in pair]) for pair in (constant, *found.values()))
    return f"{first} > " + " + ".join(others)


def _size(pair: Sequence[Poly]) -> str:
    """The largest value of A cos + B sin, written out, with first terms that are positive."""
    signed = [-p if p.leading_coefficient() < 0 else p for p in pair if p != 0]
    parts = [str(p).replace("*", " ") for p in signed]
    if len(parts) == 1:
        return f"|{parts[0]}|" if not parts[0].isdigit() else parts[0]
    squares = [f"{p}^2" if p.isidentifier() or p.isdigit() else f"({p})^2" for p in parts]
    return f"sqrt({' + '.join(squares)})"


def design_form(lengths: Lengths, joints: Sequence[str], seconds: float) -> DesignForm:
    """Families of a chain whose lengths are symbols, and where special lengths change them."""
    began = time.monotonic()
    geometry, n = lengths.geometry, lengths.joints
    task = geometry.arm.task
    # Terms from which on factoring may take long: lengths make many terms of few different powers.
    time_left = Budget(seconds, long_to_factor=300)
    budget = time_left.part(0.7)
    slides = [not angle for angle in (*(True for _ in joints), *lengths.angles)]
    for j, slide in zip(lengths.order, geometry.prismatic, strict=True):
        slides[j] = slide
    ring = make_ring(tuple(slides), constants(geometry, task), budget)
    whole = jacobian_matrix(_symbolic(lengths, ring), ring, task, budget, lengths.order)
    matrix = [row[:n] for row in whole]
    residues, rng = Residues(ring), np.random.default_rng(11)
    rank = max(residues.generic_rank(matrix, rng) for _ in range(2))
    design = DesignNames(ring, n, (*joints, *lengths.symbols), lengths.offset)
    search = decompose(lambda: matrix, rank, ring, budget)
    gaps = list(dict.fromkeys(search.gaps))
    families, assumed, changes = _stated(search.components, design)
    rest = time_left.part(1.0, 0.1)
    single = {f.name: polys for f, polys in families if polys}
    try:
        changes.extend(Changes(single, assumed, matrix, rank, design, rest).all())
    except BudgetExceeded as reason:
        gaps.append(f"special lengths were not all looked at: {reason}")
    changes += [
        DesignChange(condition, f.name, "vanishes", ())
        for f, _ in families
        for e in f.equations
        if (condition := unreal(e, n))
    ]
    return DesignForm(
        robot=geometry.arm.name,
        joints=tuple(joints),
        symbols=lengths.symbols,
        values=lengths.values,
        angles=lengths.angles,
        generic_rank=rank,
        families=tuple(f for f, _ in families),
        assumed=tuple(
            design.text(math.prod(g)).replace(" = ", " ≠ ") for g in _grouped(assumed, ring)
        ),
        changes=tuple(changes),
        complete=not gaps,
        gaps=tuple(gaps),
        seconds=time.monotonic() - began,
    )


def _symbolic(lengths: Lengths, ring: Ring) -> Any:
    """The chain with polynomials for lengths."""
    gens = ring.context.gens()
    own = [
        (gens[ring.variables(lengths.joints + k)[0]], part)
        for k, (part, angle) in enumerate(zip(lengths.parts, lengths.angles, strict=True))
        if not angle
    ]

    def length(i: int, k: int) -> Poly:
        parts = (symbol * ring.number(p[i][k]) for symbol, p in own if p[i][k] != 0)
        return sum(parts, start=ring.number(lengths.rest[i][k]))

    translation: Any = tuple(
        tuple(length(i, k) for k in range(len(row))) for i, row in enumerate(lengths.rest)
    )
    return replace(lengths.geometry, translation=translation)


def _stated(
    components: Sequence[Component], design: DesignNames
) -> tuple[Found, list[Poly], list[DesignChange]]:
    """Return families for general lengths, polynomials that must not be zero, and other changes."""
    # Zeros of a polynomial without a joint make every configuration singular.
    groups: dict[object, list[Component]] = {}
    for c in components:
        groups.setdefault((*sorted(c.values), *map(str, c.relations)), []).append(c)
    found: list[tuple[DesignFamily, tuple[Poly, ...]]] = []
    assumed, appearing = list[Poly](), dict[str, list[str]]()
    for group in groups.values():
        for joined in _joined(group, design.ring):
            moving = [polys for polys in joined if any(map(design.moves, polys))]
            if not moving:
                assumed += joined[0] if len(joined) == 1 else []
                continue
            equations = tuple(design.equation(math.prod(polys)) for polys in moving)
            text = " and ".join(text_of(e) for e in equations)
            if len(moving) < len(joined):
                fixed = [design.text(math.prod(p)) for p in joined if p not in moving]
                appearing.setdefault(" and ".join(fixed), []).append(text)
                continue
            if at := _only_at([math.prod(polys) for polys in moving], design):
                appearing.setdefault(at, []).append(text)
                continue
            stated = DesignFamily(
                name="",
                text=text,
                latex=r",\ ".join(text_of(e, latex=True) for e in equations),
                equations=equations,
                codimension=len(joined),
            )
            found.append((stated, tuple(joined[0]) if len(joined) == 1 else ()))
    found.sort(key=lambda f: (f[0].codimension, sum(len(e.cos) for e in f[0].equations)))
    named = [(replace(f, name=f"F{i}"), polys) for i, (f, polys) in enumerate(found, 1)]
    more = [DesignChange(at, "", "appears", tuple(into)) for at, into in appearing.items()]
    return named, assumed, more


def _only_at(equations: Sequence[Poly], design: DesignNames) -> str:
    """Return the condition on symbols at which equations hold together; empty if they always do."""
    # More equations than joints leave one: a resultant, where they are two in one joint.
    ring = design.ring
    joints = [{j for j in ring.joints_of(e) if j < design.n} for e in equations]
    for count in range(2, len(equations) + 1):
        for some in itertools.combinations(range(len(equations)), count):
            shared = set().union(*(joints[k] for k in some))
            if len(shared) >= count:
                continue
            if count == 2 and len(shared) == 1:
                p, g = (equations[k] for k in some)
                left = ring.strip(ring.eliminated(p, g, *shared))
                parts = [f for f in ring.factors(left) if not _positive(f)] if left != 0 else []
                if parts:
                    return " or ".join(design.text(f) for f in parts)
            return "values for which they hold together"
    return ""


def _positive(poly: Poly) -> bool:
    """Return True if a polynomial is a sum of even powers of one sign and a number."""
    signs = {c > 0 for c in poly.coeffs()}
    even = all(not k % 2 for monomial in poly.monoms() for k in monomial)
    return len(signs) == 1 and even and any(not any(m) for m in poly.monoms())


def _joined(group: Sequence[Component], ring: Ring) -> list[list[list[Poly]]]:
    """Return components that differ in joint values only as factors of equations, by family."""
    # Where all combinations occur: q5 = 0 and q5 = 180 degrees is sin q5 = 0.
    joints = sorted(group[0].values)
    values = [list(dict.fromkeys(c.values[j] for c in group)) for j in joints]
    relations = [[p] for p in group[0].relations]
    if math.prod(len(v) for v in values) == len(group):
        each = [[ring.fixing(j, v) for v in some] for j, some in zip(joints, values, strict=True)]
        return [each + relations]
    return [[[ring.fixing(j, c.values[j])] for j in joints] + relations for c in group]
