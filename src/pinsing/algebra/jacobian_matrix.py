"""The task Jacobian as a matrix of polynomials, smaller ones for it, and their minors.

Every column is the joint's screw written in a frame in the middle of the chain (for the
full pose; the rank does not depend on the frame), times a product of x^2 + y^2, which no
real angle makes zero.

Constant entries are used up as pivots: what is left is a smaller matrix whose rank drops exactly
where that of the given one does. Its minors are made as they are asked for.
"""

from __future__ import annotations

import functools
import itertools
import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

from pinsing.algebra.budget import Budget
from pinsing.algebra.generic_points import SlicePoint
from pinsing.algebra.ring import MadeOnce, Matrix, Monomial, Poly, Ring, Value
from pinsing.robot.mimic import driven_by, drives
from pinsing.robot.nominal import Matrix as Rotation, Nominal
from pinsing.robot.surd import Exact
from pinsing.robot.task import Task

_NO_CONSTANT = 1000
"""What a pivot that is no constant costs more."""
_Place = tuple[int, Monomial]  # column and monomial


def dependent(
    lines: Sequence[Sequence[Poly]], ring: Ring, check: Callable[[], None] = lambda: None
) -> dict[int, dict[int, Any]]:
    """Return lines that are sums of multiples of earlier ones that stay, and these multiples."""
    basis: list[tuple[_Place, dict[_Place, Any], dict[int, Any]]] = []
    found: dict[int, dict[int, Any]] = {}
    for i, line in enumerate(lines):
        check()
        vector: dict[_Place, Any] = {
            (j, m): c for j, x in enumerate(line) for m, c in ring.coefficients(x).items()
        }
        terms: dict[int, Any] = {}
        for lead, other, its_terms in basis:
            if lead in vector:
                check()
                ratio = vector[lead] / other[lead]
                for place, value in other.items():
                    vector[place] = vector.get(place, 0) - ratio * value
                vector = {k: v for k, v in vector.items() if v != 0}
                for k, value in its_terms.items():
                    terms[k] = terms.get(k, 0) - ratio * value
        if vector:
            basis.append((next(iter(vector)), vector, {i: 1, **terms}))
        else:
            found[i] = {k: -c for k, c in terms.items() if c != 0}
    return found


def reduce_matrix(matrix: Matrix, rank: int, ring: Ring, time: Budget) -> tuple[Matrix, int]:
    """Use up pivots that never vanish: the rest is below its rank exactly where the given is."""
    rows, never = matrix, MadeOnce()
    while True:
        rows = [ring.stripped(row) for row in rows if any(row)]
        # Without combinations of others with constant factors no rank is lost.
        gone = dependent(rows, ring)
        rows = [row for i, row in enumerate(rows) if i not in gone]
        # Without columns of zeros: with them a bound on codimensions would be too large.
        filled = [ring.stripped(c) for c in zip(*rows, strict=True) if any(c)]
        rows = [list(row) for row in zip(*filled, strict=True)]
        if not rows or rank <= 0:
            return rows, rank
        time.check()
        if (pivot := _unit(rows, ring, never)) is None:
            return rows, rank
        i, j = pivot
        used = rows.pop(i)
        for k, row in enumerate(rows):
            longest = max(map(len, row)) * len(used[j]), len(row[j]) * max(map(len, used))
            time.check(max(longest) if row[j] else 0)
            if row[j]:
                both = zip(row, used, strict=True)
                row = [ring.reduce(x * used[j] - row[j] * y) for x, y in both]
            rows[k] = row[:j] + row[j + 1 :]
        rank -= 1


def _unit(rows: Matrix, ring: Ring, never: MadeOnce) -> tuple[int, int] | None:
    """Return the position of an entry that vanishes nowhere, which disturbs the rest least."""
    # What is known of entries is kept in ``never``.
    in_row = [sum(map(len, row)) for row in rows]
    in_column = [sum(map(len, column)) for column in zip(*rows, strict=True)]
    entries = ((i, j, x) for i, row in enumerate(rows) for j, x in enumerate(row) if x)
    costs = sorted(
        ((in_column[j] - len(x)) * in_row[i] + _NO_CONSTANT * (not ring.is_constant(x)), i, j)
        for i, j, x in entries
    )
    found = ((i, j) for _, i, j in costs if never.of(rows[i][j], ring.nowhere_zero))
    return next(found, None)


def in_axes(task: Task, at_tip: bool) -> tuple[int, ...]:
    """Rows whose set depends on axes, of those in base axes or those in the tip's."""
    return tuple(
        r
        for r, tip in zip(task.rows, task.tip_rows, strict=True)
        if tip is at_tip and not set(range(r - r % 3, r - r % 3 + 3)) <= set(task.rows)
    )


def round_about(rows: Sequence[int]) -> tuple[int, ...]:
    """Axes, out of 0, 1, 2, under turns about which a set of rows stays the same."""
    has = [r in rows for r in range(6)]
    others = {k: ((k + 1) % 3, (k + 2) % 3) for k in range(3)}
    return tuple(k for k, (i, j) in others.items() if has[i] == has[j] and has[3 + i] == has[3 + j])


def tip_axes(geometry: Nominal, task: Task) -> tuple[Rotation, bool]:
    """Return the rotation of the tip's axes behind the last joint, and if its turn is no matter."""
    # Where only the axis of that joint counts, the others are as simple as can be.
    rotation = geometry.tip_rotation
    for k in round_about(in_axes(task, True)):
        sign = _along_z(rotation, k, row=False)
        if sign:
            return _simple(k, sign), True
    return rotation, False


def _along_z(rotation: Rotation, k: int, row: bool) -> int:
    """1 or -1 if axis k of the rotation's outer (or inner) frame is the joint's, else 0."""
    line = [rotation[k][i] if row else rotation[i][k] for i in range(3)]
    return next((sign for sign in (1, -1) if line == [0, 0, Fraction(sign)]), 0)


def _simple(k: int, sign: int) -> Rotation:
    """A rotation whose column k is z, or minus z."""
    columns = {k: (0, 0, sign), (k + 1) % 3: (1, 0, 0), (k + 2) % 3: (0, sign, 0)}
    first, second, third = (tuple(Fraction(columns[j][i]) for j in range(3)) for i in range(3))
    return first, second, third  # type: ignore[return-value]


Row = list[Poly]


Pose = tuple[Matrix, Row, Poly]
"""Rigid motion with a common denominator: rotation R / d and position p / d, then d."""


class _Chain:
    """Poses along the nominal chain, as polynomials: each product asks the time first."""

    def __init__(
        self, geometry: Nominal, ring: Ring, time: Budget, leaders: Sequence[int] | None = None
    ) -> None:
        self.ring, self.geometry, self.time = ring, geometry, time
        self.n = len(geometry.prismatic)
        self.drives, _ = drives(geometry)
        self.pose = functools.cache(self._pose)
        if leaders is not None:
            self.drives = tuple(replace(d, leader=leaders[d.leader]) for d in self.drives)

    def of(self, x: Poly, y: Poly) -> Poly:
        """X times y."""
        self.time.check(len(x) * len(y))
        return x * y

    def dot(self, a: Sequence[Poly], b: Sequence[Poly]) -> Poly:
        """Sum of the products of pairs."""
        total = self.ring.zero
        for x, y in zip(a, b, strict=True):
            if x and y:
                total = total + self.of(x, y)
        return self.ring.reduce(total)

    def cross(self, a: Sequence[Poly], b: Sequence[Poly]) -> list[Poly]:
        """A x b."""
        turned = ((1, 2), (2, 0), (0, 1))
        return [self.ring.reduce(self.of(a[i], b[j]) - self.of(a[j], b[i])) for i, j in turned]

    def _pose(self, k: int, moves: bool, back: bool = False) -> Pose:
        """Constant placement C_k, or motion M_k of joint k of the chain if it ``moves``."""
        number, one, zero = self.ring.number, self.ring.one, self.ring.zero
        if back:  # what shifts has a denominator of one
            R, p, d = self.pose(k, moves)
            R = [list(column) for column in zip(*R, strict=True)]
            return R, [-self.dot(row, p) for row in R], d
        if not moves:
            lengths: Sequence[Any] = self.geometry.translation[k]  # or polynomials, of symbols
            known = [number(x) if isinstance(x, Fraction) else x for x in lengths]
            return [[number(x) for x in row] for row in self.geometry.rotation[k]], known, one
        gens, drive = self.ring.context.gens(), self.drives[k]
        v = self.ring.variables(drive.leader)
        if self.geometry.prismatic[k]:
            eye = [[one if a == b else zero for b in range(3)] for a in range(3)]
            along = gens[v[0]] * number(drive.multiple) + number(drive.shift)
            return eye, [zero, zero, along], one
        c, s, w = one, zero, one
        if drive.multiple:  # one that stands still may have a leader of any kind
            x, y = gens[v[0]], gens[v[1]]
            y = y if drive.multiple > 0 else -y
            once = x * x - y * y, 2 * x * y, x * x + y * y
            for _ in range(abs(int(drive.multiple))):
                c, s, w = c * once[0] - s * once[1], c * once[1] + s * once[0], w * once[2]
        a, b = (number(value) for value in drive.turn)
        c, s = self.ring.reduce(c * a - s * b), self.ring.reduce(c * b + s * a)
        return [[c, -s, zero], [s, c, zero], [zero, zero, w]], [zero] * 3, w

    def poses(self, j: int, middle: int, still: bool = False) -> Iterator[Pose]:
        """Lead from the frame of joint j to that of ``middle`` before its motion, one by one."""
        for k in range(j - 1, middle - 1, -1):
            yield self.pose(k + 1, False)
            yield self.pose(k, True)
        for k in range(j, middle):
            if k > j or still:
                yield self.pose(k, True, True)
            yield self.pose(k + 1, False, True)

    def tip(self, middle: int) -> tuple[list[Poly], Poly]:
        """The tip's position in the frame of joint ``middle`` before its motion, over a scale."""
        p, scale = [self.ring.zero] * 3, self.ring.one
        for R, shift, d in self.poses(self.n, middle):
            moved = zip(R, shift, strict=True)
            p = [self.dot(row, p) + self.ring.reduce(self.of(x, scale)) for row, x in moved]
            scale = self.of(scale, d)
        return p, scale

    def seen(
        self, v: list[Poly], w: list[Poly], j: int, middle: int, still: bool = False
    ) -> tuple[list[Poly], list[Poly]]:
        """A screw of the frame of joint j, in that of joint ``middle`` before its motion.

        Up to a factor that no real angle makes zero. Carried step by step: that is two vectors to
        turn, where a pose has three columns and a position. It moves with joint j, or is ``still``.
        """
        for R, p, _ in self.poses(j, middle, still):
            v, w = ([self.dot(row, x) for row in R] for x in (v, w))
            if any(p) and any(w):  # motions here turn or shift, so that p is over one
                v = [a + b for a, b in zip(v, self.cross(p, w), strict=True)]
        return v, w

    def scale(self, j: int, middle: int) -> Poly:
        """What a screw, as ``seen``, is over: x^2 + y^2 of each joint that turns on the way."""
        return functools.reduce(self.of, (d for *_, d in self.poses(j, middle)), self.ring.one)

    def directions(self, middle: int, task: Task) -> dict[int, Row]:
        """For each row that axes matter to, its direction, up to a factor that is never zero."""
        rotation, base = self.geometry.rotation[0], in_axes(task, False)
        # Whether the first joint's turn leaves the rows in base axes the same set.
        about = any(_along_z(rotation, k, row=True) for k in round_about(base))
        # The last placement does not turn: behind the last motion is where the tip is.
        turn, whole = tip_axes(self.geometry, task)
        end, columns = self.n - 1 if whole else self.n, list(zip(*turn, strict=True))
        from_base = {r: (rotation[r % 3], 0, not about) for r in base}
        axes = from_base | {r: (columns[r % 3], end, False) for r in in_axes(task, True)}
        none, number = [self.ring.zero] * 3, self.ring.number
        return {
            r: self.seen(none, [number(x) for x in axis], j, middle, still)[1]
            for r, (axis, j, still) in axes.items()
        }

    def columns(
        self, joints: Sequence[int], middle: int, rows: Callable[[Row, Row], Row]
    ) -> Matrix:
        """Columns of some of the arm's joints: ``rows`` of screws (v, w), up to factors."""
        none, axis, out = [self.ring.zero] * 3, [self.ring.zero, self.ring.zero, self.ring.one], []
        for joint in joints:
            self.time.check()
            moved = driven_by(self.drives, joint)
            slides = self.geometry.prismatic
            screws = [(axis, none) if slides[j] else (none, axis) for j in moved]
            seen = (self.seen(*s, j, middle) for s, j in zip(screws, moved, strict=True))
            found = [rows(v, w) for v, w in seen]
            total = found[0]
            if len(moved) > 1:  # a joint and its followers, each over a scale of its own
                scales = [self.scale(j, middle) for j in moved]
                total = [self.ring.zero] * len(total)
                for i, (j, column) in enumerate(zip(moved, found, strict=True)):
                    factors = [self.ring.number(self.drives[j].multiple), *scales]
                    factor = functools.reduce(self.of, factors[: i + 1] + factors[i + 2 :])
                    both = zip(total, column, strict=True)
                    total = [self.ring.reduce(t + self.of(x, factor)) for t, x in both]
            out.append(self.ring.stripped(total))
        return [list(row) for row in zip(*out, strict=True)]


def constants(geometry: Nominal, task: Task) -> list[Exact]:
    """The numbers of the geometry that the task Jacobian has in it, up to its rank."""
    first = 0 if in_axes(task, False) else 1
    placed = [x for R in geometry.rotation[first:] for row in R for x in row]
    if in_axes(task, True):
        placed += [x for row in tip_axes(geometry, task)[0] for x in row]
    return placed + [x for drive in drives(geometry)[0] for x in drive.turn]


def jacobian_matrix(
    geometry: Nominal, ring: Ring, task: Task, time: Budget, leaders: Sequence[int] | None = None
) -> Matrix:
    """Return the task Jacobian as polynomials, up to nonzero row operations and column factors.

    Columns are in the order of the ring's joints: ``leaders`` says which of these each joint of the
    chain is, where they do not stand there in the chain's order.

    The reference point is moved into the chain only for the full pose, and the axes only for all
    translations or all rotations: elsewhere the rank depends on them. A joint with mimic joints has
    the sum of their columns, by the chain rule; NotFollowed if one is no polynomial.
    """
    chain = _Chain(geometry, ring, time, leaders)
    joints, middle = sorted({drive.leader for drive in chain.drives}), chain.n // 2
    if task.name == "pose":
        return chain.columns(joints, middle, operator.add)
    directions = chain.directions(middle, task)
    tip, over = chain.tip(middle) if min(task.rows) < 3 else ([], ring.one)

    def rows(v: Row, w: Row) -> Row:
        if tip and any(w):  # of the tip, where ``v`` is of the frame's origin
            levered = zip(v, chain.cross(w, tip), strict=True)
            v, w = [chain.of(a, over) + b for a, b in levered], [chain.of(x, over) for x in w]
        six = v + w
        return [
            chain.dot(directions[r], v if r < 3 else w) if r in directions else six[r]
            for r in task.rows
        ]

    return chain.columns(joints, middle, rows)


def determinant(matrix: Matrix, ring: Ring, time: Budget) -> Poly:
    """Determinant of a square matrix."""
    every = tuple(range(len(matrix)))
    return Minors(matrix, len(matrix), ring, time).minor(every, every)


@dataclass(frozen=True, eq=False)
class SquareCorner:
    """A corner B of a matrix."""

    # rows and columns: of B, which is square; the other rows are zero in these columns
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    determinant: Poly  # of B, without factors that are nowhere zero
    rest: Matrix  # d: the other rows in the other columns


def corner(matrix: Matrix, ring: Ring, time: Budget) -> SquareCorner | None:
    """The smallest square corner beside which rows are zero, the shortest of these."""
    support = [
        frozenset(i for i, row in enumerate(matrix) if row[j] != 0) for j in range(len(matrix[0]))
    ]
    for size in range(1, len(matrix)):
        found = [
            (sum(len(matrix[i][j]) for j in columns for i in used), sorted(used), columns)
            for columns in itertools.combinations(range(len(support)), size)
            if len(used := frozenset().union(*(support[j] for j in columns))) == size
        ]
        if found:
            _, rows, columns = min(found)
            square = [[matrix[i][j] for j in columns] for i in rows]
            return SquareCorner(
                tuple(rows),
                columns,
                ring.strip(determinant(square, ring, time)),
                [
                    [x for j, x in enumerate(row) if j not in columns]
                    for i, row in enumerate(matrix)
                    if i not in rows
                ],
            )
    return None


Lines = tuple[tuple[int, ...], tuple[int, ...]]
"""Rows and columns of a minor."""
_LOOKED_AT = 12
"""Minors among which the simplest is looked for."""


class Minors:
    """A matrix, and its minors of one size, computed as they are asked for, the simplest first.

    Where all of them vanish its rank is below their size. What is made of it is made once.
    """

    def __init__(self, matrix: Matrix, size: int, ring: Ring, time: Budget) -> None:
        self.matrix, self.size, self.ring, self.time = matrix, size, ring, time
        self.sides = len(matrix), len(matrix[0]) if matrix else 0
        self._done: list[Poly] = []
        self._put: dict[object, Minors] = {}
        self._filled = [sum(x != 0 for x in row) for row in matrix]
        self._known: dict[Lines, Poly] = {}
        self._kept = 0

    def minor(self, rows: tuple[int, ...], columns: tuple[int, ...]) -> Poly:
        """The minor of some rows and as many columns, both ascending, from smaller ones."""
        if not rows:
            return self.ring.one
        # Rows with many zeros first: they ask for few minors of the others.
        i = min(range(len(rows)), key=lambda i: self._filled[rows[i]])
        first = self.matrix[rows[i]]
        if len(rows) == 1:
            return first[columns[0]]
        # Terms of minors that are kept at a time.
        if len(rows) == self.size and self._kept > 100_000:
            self._known.clear()
            self._kept = 0
        if (rows, columns) not in self._known:
            total = self.ring.zero
            for k, j in enumerate(columns):
                x, left = first[j], columns[:k] + columns[k + 1 :]
                if x != 0 and (rest := self.minor(rows[:i] + rows[i + 1 :], left)) != 0:
                    self.time.check(len(x) * len(rest))
                    total = total - x * rest if (i + k) % 2 else total + x * rest
            self._known[rows, columns] = total = self.ring.reduce(total)
            self._kept += len(total)
        return self._known[rows, columns]

    @cached_property
    def smaller(self) -> Minors:
        """Those of a smaller matrix whose rank drops in the same places."""
        rows, size = reduce_matrix(self.matrix, self.size, self.ring, self.time)
        found = Minors(rows, size, self.ring, self.time)
        found.smaller = found  # none smaller is to be had
        return found

    def at(self, values: Mapping[int, Value]) -> Minors:
        """Those of the matrix with some joints at values."""
        key = frozenset(values.items())
        if key not in self._put:
            put = self.ring.putting(values)
            rows = [[put(x) for x in row] for row in self.matrix]
            self._put[key] = Minors(rows, self.size, self.ring, self.time)
        return self._put[key]

    @property
    def bound(self) -> int:
        """Largest codimension of a component of where all vanish (Eagon, Northcott)."""
        return math.prod(side - self.size + 1 for side in self.sides)

    @cached_property
    def _left(self) -> list[Lines]:
        """Rows and columns of those that were not computed, the shortest first."""
        length = [[len(x) for x in row] for row in self.matrix]
        rows, columns = (itertools.combinations(range(k), self.size) for k in self.sides)
        return sorted(
            itertools.product(rows, columns),
            key=lambda c: sum(length[i][j] for i in c[0] for j in c[1]),
        )

    def __iter__(self) -> Iterator[Poly]:
        """All minors that are not identically zero."""
        i = 0
        while True:
            while i < len(self._done):
                yield self._done[i]
                i += 1
            if not self._left:
                return
            minor = self.minor(*self._left[0])
            del self._left[0]
            if minor != 0:
                self._done.append(self.ring.strip(minor))

    def simplest_cofactor(self, common: Poly) -> list[Poly]:
        """Factors of the minor, over the common factor, that branches into the least work."""
        best: list[Poly] | None = None
        for minor in itertools.islice(self, _LOOKED_AT):
            factors = self.ring.factors(self.ring.quotient(minor, common), self.time)
            if not factors:
                return []
            if best is None or cost(factors) < cost(best):
                best = factors
        return best or []

    def cutting(self, regular: Sequence[SlicePoint]) -> list[Poly] | None:
        """Factors of a minor that vanishes at none of some points, simple if there is a choice."""
        left = iter(self)
        while batch := list(itertools.islice(left, _LOOKED_AT)):
            for minor in sorted(batch, key=lambda m: self.effort(self.ring.factors(m, self.time))):
                self.time.check()
                if not any(s.is_zero(minor) for s in regular):
                    return self.ring.factors(minor, self.time)
        return None

    def effort(self, factors: list[Poly]) -> tuple[int, int]:
        """Return how much work it makes to cut with these factors; joint values make none."""
        return cost([f for f in factors if self.ring.joint_value(f) is None])


def cost(factors: list[Poly]) -> tuple[int, int]:
    """Return how much work branching on these factors makes."""
    return max((len(f) for f in factors), default=0), len(factors)


class NotSquare(Exception):
    """The task has more rows than its rank, and no constant combination of them is zero."""


class NearMinors:
    """Minors of as many columns as the whole chain's generic rank, at values of some joints."""

    def __init__(self, geometry: Nominal, ring: Ring, task: Task, rank: int, time: Budget) -> None:
        self.geometry, self.ring, self.task, self.rank, self.time = geometry, ring, task, rank, time
        self._columns = functools.cache(self._made)
        self._known: dict[object, Poly] = {}

    @cached_property
    def _whole(self) -> Matrix:
        return jacobian_matrix(self.geometry, self.ring, self.task, self.time)

    def _made(self, joints: tuple[int, ...]) -> Matrix:
        """Columns of some joints, up to row operations and factors that are nowhere zero."""
        if self.task.name != "pose":
            return [[row[j] for j in joints] for row in self._whole]
        # In the frame of a middle one: only what moves between the first and the last occurs.
        chain = _Chain(self.geometry, self.ring, self.time)
        every = sorted(j for a in joints for j in driven_by(chain.drives, a))
        return chain.columns(joints, every[len(every) // 2], operator.add)

    def minor(self, joints: Sequence[int], values: Mapping[int, Value]) -> Poly:
        """Return the minor of columns ``joints``, without units; NotSquare if there are several."""
        chosen, matter = tuple(sorted(joints)), set(values)
        if self.task.name == "pose":
            driven, _ = drives(self.geometry)
            rows = [row for a in chosen for row in driven_by(driven, a)]
            matter = {d.leader for d in driven[min(rows) + 1 : max(rows)]}
        inside = {j: v for j, v in values.items() if j in matter}
        key = chosen, frozenset(inside.items())
        if key not in self._known:
            self.time.check()
            whole = Minors(self._columns(chosen), self.rank, self.ring, self.time)
            small, found = whole.at(inside).smaller, self.ring.zero
            if small.size <= min(small.sides):
                if 0 < small.size < len(small.matrix):
                    raise NotSquare
                every = tuple(range(small.size))
                found = self.ring.strip(small.minor(every, every))
            self._known[key] = found
        return self._known[key]
