"""Singular configurations on random slices, over small finite fields, held against the families.

All joints but a few are put at random values of a field, and the few at all of its values: a
slice. Each singular configuration on it must lie on a family. A family of codimension k has about
one point on a slice of k joints, for some choice of k joints: so many slices are gone through, over
several fields, and how seldom a family that is known was met says how likely one was missed.

Short equations of neighbouring axes tell the large families of a long chain. Smaller ones, on which
several groups of axes are special at once, are no factors of them. But they have points on random
slices over small fields, and in these points some joint is at a value that occurs in a factor of a
minor: 0, 90 or 180 degrees, or where an axis passes through a wrist. At that value the search by
all minors takes seconds, where in general it would take hours.

Slices are gone through until nothing new turns up over several fields. A component that has points
over none of these may have real ones: those on no family lead on in the same way. A component whose
joint values are roots of an equation has points over the fields only that have these roots; over
the real numbers random starts meet it where it has real points at all.

Over a small finite field every configuration can be visited. The joints on the near side of a
middle one fix the wrenches that do no work at any of their axes; those on its far side must leave
one of these over. So both sides are gone through once, and each pair is a product of small
matrices.
"""

from __future__ import annotations

import math
import random
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import combinations, islice
from typing import Any

import numpy as np
from flint import fmpz, nmod_mat

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import (
    SECOND_SEED,
    Component,
    RandomSteps,
    decompose,
    merged,
    on_any,
    settled,
    vanishing,
)
from pinsing.algebra.conditions import Branch
from pinsing.algebra.generic_points import Residues, Undecided, slice_points
from pinsing.algebra.jacobian_matrix import NearMinors, NotSquare, in_axes, jacobian_matrix
from pinsing.algebra.ring import (
    MadeOnce,
    Matrix,
    Poly,
    Ring,
    Value,
    image,
    terms_of,
    whole_terms,
)
from pinsing.families.describe import PieceMaker
from pinsing.families.proof_forms import roots_in
from pinsing.families.zero_set import BLUNT, OwnPoints, SearchBox
from pinsing.measures import Array, Bool, Ints, NDArray
from pinsing.prose import listed
from pinsing.robot.mimic import own_jacobian_modulo
from pinsing.robot.nominal import PRIMES, Nominal
from pinsing.robot.surd import residue
from pinsing.robot.task import Task

_CHECKED = 4_000
"""Singular points of one slice that are held against the families."""

Pairs = NDArray[np.intp]
Frames = list[tuple[Ints, Ints]]
"""Turns (N, 3, 3) of frames, and where they are (N, 3)."""


class ModularChain:
    """A chain modulo a prime, each of whose joints moves on its own, and independent rows.

    Points are half-angle coordinates x and y of each joint, of a slider its length and 0.
    """

    def __init__(self, geometry: Nominal, task: Task, prime: int) -> None:
        self.p, self.task, self.slides = prime, task, geometry.prismatic
        self.n = len(geometry.prismatic)
        exact = np.vectorize(lambda x: residue(x, prime), otypes=[np.int64])
        self._turns, self._shifts = exact(geometry.rotation), exact(geometry.translation)
        self._turns[-1] = self._turns[-1] @ exact(geometry.tip_rotation) % prime
        self._inverse = np.array([0, *(pow(v, -1, prime) for v in range(1, prime))])

    def singular(self, chosen: Sequence[int], draw: random.Random) -> Ints:
        """Return singular points (2, n, N), the other joints at random values."""
        # A sample of them where there are very many.
        values = [self.every(j) for j in range(self.n)]
        point = np.stack([v[:, draw.randrange(v.shape[1])] for v in values], axis=1)
        half = len(chosen) // 2
        near, far = self.grid(point, chosen[:half]), self.grid(point, chosen[half:])
        pairs = self._met(chosen[half], near, far)
        if len(pairs) > _CHECKED:
            pairs = pairs[sorted(draw.sample(range(len(pairs)), _CHECKED))]
        out, some = far[..., pairs[:, 1]], list(chosen[:half])
        out[:, some] = near[:, some][..., pairs[:, 0]]
        return out

    def short_everywhere(self) -> bool:
        """Return True if the rank is short on some random slices: the prime divides a length."""
        draw, middle = random.Random(SECOND_SEED), self.n // 2
        # That all points of so many are singular by chance is unlikely.
        found = (self.singular([middle], draw).shape[2] for _ in range(12))
        return all(count == self.every(middle).shape[1] for count in found)

    def every(self, j: int) -> Ints:
        """All values (2, N) of a joint."""
        t = np.arange(self.p, dtype=np.int64)
        if self.slides[j]:
            return np.stack([t, np.zeros_like(t)])
        t = t[(t * t + 1) % self.p != 0]  # no angle is where x^2 + y^2 is zero
        return np.stack([np.append(np.ones_like(t), 0), np.append(t, 1)])

    def grid(self, point: Ints, joints: Sequence[int]) -> Ints:
        """Points (2, n, N): some joints at all of their values, the others as at one (2, n)."""
        values = [self.every(j) for j in joints]
        sizes = [v.shape[1] for v in values]
        count = math.prod(sizes)
        out = np.repeat(point[..., None], count, axis=2)
        for j, v, index in zip(joints, values, np.indices(sizes).reshape(-1, count), strict=True):
            out[:, j] = v[:, index]
        return out

    def _frames(self, joints: range, at: Ints, turn: Ints, place: Ints) -> Frames:
        """The frame of the first joint, as given, and that behind the motion of each."""
        R, o = np.repeat(turn[None], at.shape[2], axis=0), np.repeat(place[None], at.shape[2], 0)
        found = [(R, o)]
        for j in joints:
            x, y = at[:, j]
            if self.slides[j]:
                o = o + R[:, :, 2] * x[:, None]
            else:
                over = self._inverse[(x * x + y * y) % self.p]
                c, s = ((x * x - y * y) * over)[:, None], (2 * x * y * over)[:, None]
                first, second = R[:, :, 0] * c + R[:, :, 1] * s, R[:, :, 1] * c - R[:, :, 0] * s
                R = np.stack([first, second, R[:, :, 2]], axis=2) % self.p
            o = (o + R @ self._shifts[j + 1]) % self.p
            R = R @ self._turns[j + 1] % self.p
            found.append((R, o))
        return found

    def _screws(self, joints: range, frames: Frames) -> Ints:
        """Screws (N, k, 6) of joints in their frames."""
        out = np.zeros((len(frames[0][0]), len(joints), 6), dtype=np.int64)
        for k, j in enumerate(joints):
            R, o = frames[k]
            w = R[:, :, 2]
            out[:, k, :3] = w if self.slides[j] else np.cross(o, w)
            out[:, k, 3:] = 0 if self.slides[j] else w
        return out % self.p

    def _met(self, middle: int, near: Ints, far: Ints) -> Pairs:
        """Indices (k, 2) of the values of the two sides that are singular together."""
        # All in the middle joint's frame before its motion: its axis stands still there, and counts
        # on the side where it costs least.
        pose = self.task.name == "pose"
        own = middle + 1 if pose else middle
        frames = self._frames(range(middle), near, self._turns[0], self._shifts[0])
        base, place = frames[-1]
        back = np.swapaxes(base, 1, 2)
        seen = [
            (back @ R % self.p, (back @ (o - place)[..., None])[..., 0] % self.p) for R, o in frames
        ]
        before = self._screws(range(own), seen)
        eye = np.eye(3, dtype=np.int64)
        frames = self._frames(range(middle, self.n), far, eye, 0 * eye[0])
        behind = self._screws(range(own, self.n), frames[own - middle :])
        return (
            self._by_wrenches(before, behind)
            if pose
            else self._by_rows(before, behind, base, *frames[-1])
        )

    def _by_wrenches(self, near: Ints, far: Ints) -> Pairs:
        """See ``_met``: where all screws together have no rank 6."""
        p = self.p
        wrenches: dict[int, tuple[list[int], list[Any]]] = {}
        for i, screws in enumerate(near.tolist()):
            free, count = nmod_mat(len(screws), 6, [v for s in screws for v in s], p).nullspace()
            if count:
                rows = [[int(free[r, c]) for r in range(6)] for c in range(int(count))]
                index, found = wrenches.setdefault(int(count), ([], []))
                index.append(i)
                found.append(rows)
        k, kept = far.shape[1], np.arange(len(far))
        if k >= 6:  # most of them leave no wrench over by themselves
            kept = np.flatnonzero(self._short(far.transpose(2, 1, 0).astype(np.int16)))
            far = far[kept]
        columns = far.reshape(-1, 6).T.astype(np.float32)  # sums of six products are exact
        out = [np.zeros((0, 2), dtype=np.intp)]
        for count, (index, found) in wrenches.items():
            # Numbers in one product of matrices.
            step = max(1, 4_000_000 // max(1, count * columns.shape[1]))
            for first in range(0, len(index), step):
                some = np.array(found[first : first + step], dtype=np.float32)
                work = (some.reshape(-1, 6) @ columns).astype(np.int16) % np.int16(p)
                work = work.reshape(len(some), count, len(far), k).transpose(1, 3, 0, 2)
                a, b = np.nonzero(self._short(work))
                out.append(np.stack([np.array(index)[first + a], kept[b]], axis=1))
        return np.concatenate(out)

    def _by_rows(self, near: Ints, far: Ints, base: Ints, tip_turn: Ints, tip: Ints) -> Pairs:
        """See ``_met``: the base's axes are the rows of one turn, the tip's the columns of one."""
        axes, left = np.swapaxes(tip_turn, 1, 2), np.arange(len(far))
        if not in_axes(self.task, False):  # then rows are the same whatever the near side does
            left = left[self._short(self._columns(axes, axes, tip, far))]
        out = [np.zeros((0, 2), dtype=np.intp)]
        # Pairs of values of the two sides whose columns are made at once.
        step = max(1, 100_000 // max(1, len(near)))
        for first in range(0, len(left), step):
            some = left[first : first + step]
            i, k = (a.ravel() for a in np.meshgrid(np.arange(len(near)), some, indexing="ij"))
            screws = np.concatenate([near[i], far[k]], axis=1)
            singular = self._short(self._columns(base[i], axes[k], tip[k], screws))
            out.append(np.stack([i[singular], k[singular]], axis=1))
        return np.concatenate(out)

    def _columns(self, base: Ints, tip_axes: Ints, tip: Ints, screws: Ints) -> NDArray[np.int16]:
        """Rows of the Jacobian (rows, columns, N): sums of six products are exact in floats."""
        rows = []
        whole = np.broadcast_to(np.eye(3, dtype=np.int64), base.shape)
        for r, at_tip in zip(self.task.rows, self.task.tip_rows, strict=True):
            triple = set(range(r - r % 3, r - r % 3 + 3))
            # All three directions span the same in any axes.
            axes = whole if triple <= set(self.task.rows) else tip_axes if at_tip else base
            along = axes[:, r % 3]
            # along . (v + w x tip) = along . v + (tip x along) . w
            both = (along, np.cross(tip, along) % self.p) if r < 3 else (0 * along, along)
            rows.append(np.concatenate(both, axis=1))
        L = np.stack(rows, axis=1).astype(np.float32)
        J = L @ screws.astype(np.float32).transpose(0, 2, 1)
        return np.asarray((J % self.p).astype(np.int16).transpose(1, 2, 0))

    def _short(self, A: NDArray[np.int16]) -> Bool:
        """Return where matrices (m, k, ...) have a rank below m."""
        if len(A) == 1:
            return np.asarray(~A[0].any(axis=0))
        inverse, p = self._inverse.astype(np.int16), np.int16(self.p)
        A = A.copy()
        rank = np.zeros(A.shape[2:], dtype=np.int64)
        left = np.ones((len(A), *A.shape[2:]), dtype=bool)
        for j in range(A.shape[1]):
            usable = (A[:, j] != 0) & left
            pivot = usable.argmax(axis=0)
            has = usable.any(axis=0)
            row = np.take_along_axis(A, pivot[None, None], axis=0)[0]
            over = np.where(has, inverse[row[j]], np.int16(0))
            left &= ~((np.arange(len(A)).reshape(-1, *[1] * rank.ndim) == pivot) & has)
            factor = np.where(left, A[:, j] * over % p, np.int16(0))
            A[:, j + 1 :] = (A[:, j + 1 :] - factor[:, None] * row[None, j + 1 :]) % p
            rank += has
        return np.asarray(rank < len(A))


class ModularSet:
    """A component modulo a prime."""

    def __init__(self, component: Component, ring: Ring, prime: int) -> None:
        self.p = prime
        self.relations = [_residues(r, ring, prime) for r in vanishing(component, ring)]
        joints = [j for j in range(len(ring.prismatic)) for _ in ring.variables(j)]
        self.variables = [(v - ring.start[j], j) for v, j in enumerate(joints)]
        most = max((int(exponents.max()) for exponents, _ in self.relations), default=0)
        powers = [[pow(x, k, prime) for x in range(prime)] for k in range(most + 1)]
        self._powers = np.array(powers, dtype=np.int16)

    def holds(self, points: Ints) -> Bool:
        """Return which of some points (2, n, N) lie on it."""
        on = np.ones(points.shape[2], dtype=bool)
        for exponents, factors in self.relations:
            left = np.flatnonzero(on)
            # Terms at points that are computed at once.
            step = max(1, 2_000_000 // len(factors))
            for some in (left[first : first + step] for first in range(0, len(left), step)):
                terms = np.repeat(factors[:, None], len(some), axis=1)
                for v in np.flatnonzero(exponents.any(axis=0)):
                    side, joint = self.variables[v]
                    powers = self._powers[exponents[:, v]][:, points[side, joint, some]]
                    terms = terms * powers % np.int16(self.p)
                on[some] = terms.sum(axis=0) % self.p == 0
        return on


def _residues(poly: Poly, ring: Ring, prime: int) -> tuple[Ints, NDArray[np.int16]]:
    """Return exponents (K, V) of a polynomial's terms, and coefficients (K,) modulo a prime."""
    # Not all are multiples of the prime. If square roots make all zero nevertheless, it counts as
    # nowhere zero: points are left over rather than taken in.
    terms = whole_terms(poly)
    common = math.gcd(*terms.values())
    plain = ring.context.from_dict({m: c // common for m, c in terms.items()})
    found = terms_of(image(plain, ring, prime)) or {(0,) * ring.nvars: 1}
    exponents = np.array([*found], dtype=np.int64)
    return exponents, np.array([*map(int, found.values())], dtype=np.int16)


def joints_that_matter(geometry: Nominal, task: Task) -> tuple[int, ...]:
    """Return joints on which the rows' rank depends: not those that turn all axes alike."""
    # These leave each minor as it is, up to one sign; decided at random points modulo a prime.
    draw = random.Random(SECOND_SEED)
    n, prime = len(geometry.prismatic), PRIMES[0]

    mixing = nmod_mat(n, len(task.rows), [draw.randrange(prime) for _ in task.rows * n], prime)

    def volume(values: Mapping[int, Sequence[Fraction]]) -> int:
        """A sum of all minors, each with a factor of its own, up to its sign."""
        rows = own_jacobian_modulo(geometry, task, prime, draw, values)
        flat = [x for row in rows for x in row]
        size = int((nmod_mat(len(rows), n, flat, prime) * mixing).det())
        return min(size, prime - size)

    matter = set[int]()
    # Random configurations at which a joint is moved, to see whether that matters to the rank.
    for _ in range(3):
        values = (Fraction(draw.randrange(1, prime)) for _ in range(n))
        both = zip(values, geometry.prismatic, strict=True)
        at = {j: (x,) if slides else (Fraction(1), x) for j, (x, slides) in enumerate(both)}
        here = volume(at)
        # What has no value is drawn.
        matter |= {j for j in at if volume({k: v for k, v in at.items() if k != j}) != here}
    return tuple(sorted(matter))


FIELDS = tuple(p for p in range(7, 48) if fmpz(p).is_prime())
"""Primes: one may divide what must not vanish, such as a sum of lengths: what it alone contradicts
may be its own doing. Families whose joint values are roots have points over some of them only."""
ASKED = 23, 47
"""Where slices are gone through once: the second where the first contradicts."""
SEED = 31
MOST_JOINTS = 4
"""Joints of a slice of a chain of which no more is asked: one more is some 20 times the work."""
NEEDED = 3
"""Fields over which no point may be left over, where nothing contradicts."""
_FEW_JOINTS = 3
"""Slices of so few joints are small: in larger fields less is special by chance."""


@dataclass(frozen=True)
class SliceCount:
    """What was counted.

    Attributes
    ----------
    joints : int
        That vary on each slice: sets of no larger codimension are met.
    slices, choices : int
        How many slices were gone through, and how many choices of so many joints there are.
    points : int
        Singular configurations on them that were held against the families.
    off : int
        Those that lie on none: something is missing unless it is 0.
    prime, seed : int
        The field, and what the slices were drawn from.
    primes : tuple of int
        All fields, where there are several.
    known, met : int
        How many components the families have, and how many of them were met on some slice: the
        others have no points over these fields, or were missed as one that is not known may be.
    real, real_off : int
        Singular configurations over the real numbers that random starts led to, and those of them
        that lie on none: families whose joint values are roots may have no points over the fields.
    """

    joints: int
    slices: int
    choices: int
    points: int
    off: int
    prime: int
    seed: int
    primes: tuple[int, ...] = field(default=(), metadata={"optional": True})
    known: int = field(default=0, metadata={"optional": True})
    met: int = field(default=0, metadata={"optional": True})
    real: int = field(default=0, metadata={"optional": True})
    real_off: int = field(default=0, metadata={"optional": True})

    def evidence(self) -> str:
        """The same, said to be no proof, or where nothing was met no evidence."""
        return f"{'evidence, no proof' if self.points else 'no evidence'}: {self.sentence()}"

    def sentence(self) -> str:
        """Return what it says, in words."""
        slices = "one random slice" if self.slices == 1 else f"{self.slices} random slices"
        several = len(self.primes) > 1
        fields = f"{'fields' if several else 'field'} of "
        fields += listed([str(p) for p in self.primes]) if several else str(self.prime)
        where = (
            f"on {slices} of {self.joints} joints ({self.choices} choices of joints) over the "
            f"{fields} elements (seed {self.seed})"
        )
        if not self.points:
            return f"no singular point was met {where}"
        if self.off:
            lie = "lies" if self.off == 1 else "lie"
            return f"{self.off} of {self.points:,} singular points {where} {lie} on no family"
        said = f"all {self.points:,} singular points {where} lie on the families"
        if self.known:
            said += f", {self.met} of whose {self.known} components were met"
        if self.real and not self.real_off:
            said += f", and so do {self.real} real ones found from random starts"
        return said


@dataclass(frozen=True, eq=False)
class SlicePoints:
    """Singular points of slices over one field, one slice for each choice of joints."""

    of: Slices
    prime: int
    slices: int  # how many there were
    chosen: Ints  # (N, k): the joints that vary on the slice of each point
    q: Ints  # (2, n, N): the points
    known: MadeOnce = field(default_factory=MadeOnce)  # which of them lie on components asked for

    def __len__(self) -> int:
        return len(self.chosen)

    def at(self, points: Bool) -> SlicePoints:
        """Some of the points."""
        return replace(self, chosen=self.chosen[points], q=self.q[..., points], known=MadeOnce())

    def held(self, component: Component) -> Bool:
        """Return which points (N) lie on a component, computed once."""
        holds = self.of.modular(component, self.prime).holds
        return self.known.of(component, lambda _: holds(self.q))  # type: ignore[no-any-return]

    def on(self, components: Sequence[Component]) -> Bool:
        """Which points lie on each of some components: (C, N)."""
        held = [*map(self.held, components)]
        return np.array(held, dtype=bool).reshape(len(held), len(self))

    def left(self, components: Sequence[Component]) -> SlicePoints:
        """Those that lie on none of some components."""
        return self.at(np.asarray(~self.on(components).any(axis=0)))

    def regular_too(self, component: Component) -> bool:
        """Return True if a component has points on their one slice that are regular."""
        every = self.of.chains[self.prime].grid(self.q[..., 0], self.chosen[0])
        holds = self.of.modular(component, self.prime).holds
        return bool(holds(every).sum() > self.held(component).sum())

    def varies(self, joint: int) -> Bool:
        """Return at which points (N) a joint varies on their slice."""
        return np.asarray((self.chosen == joint).any(axis=1))


class Slices:
    """Random slices, of so many ``joints``, of a chain without mimics and with independent rows."""

    def __init__(self, geometry: Nominal, task: Task, ring: Ring, joints: int) -> None:
        self.geometry, self.task, self.ring = geometry, task, ring
        n = len(geometry.prismatic)
        # The first and the last joint move all axes of a pose, or none.
        inner = range(1, n - 1) if task.name == "pose" else joints_that_matter(geometry, task)
        self.joints = min(joints, len(inner))
        self._draw = random.Random(SEED)
        self.choices = list(combinations(inner, self.joints))
        self._draw.shuffle(self.choices)
        self.chains: dict[int, ModularChain] = {}
        self._sets = defaultdict[int, MadeOnce](MadeOnce)

    @property
    def fields(self) -> tuple[int, ...]:
        """Those over which a slice is not too large."""
        # Slices of so few joints are small: in larger fields less is special by chance.
        few = self.joints <= _FEW_JOINTS
        squares = roots_in(self.geometry)  # they have roots by Euler's criterion
        known = [
            p
            for p in FIELDS
            if (p >= 17 or not few) and all(pow(s, (p - 1) // 2, p) == 1 for s in squares)
        ]
        # Of one slice: beyond the first number it is gone through only where few fields are as
        # small.
        small, larger = (
            tuple(p for p in known if (p + 1) ** self.joints <= most)
            for most in (350_000, 3_500_000)
        )
        chosen = small if len(small) >= NEEDED else larger
        lengths = [Fraction(x) for row in self.geometry.translation for x in row if x != 0]
        whole = tuple(p for p in chosen if all(x.numerator * x.denominator % p for x in lengths))
        return whole if few and len(whole) >= NEEDED else chosen

    def turn(self, prime: int, time: Budget) -> SlicePoints:
        """Return points of one slice for each choice of joints, as many as there is time for."""
        # ValueError if the prime divides a denominator of the chain, or a length its rank needs.
        if prime not in self.chains:
            chain = ModularChain(self.geometry, self.task, prime)
            if chain.short_everywhere():
                raise ValueError(f"modulo {prime} all configurations are singular")
            self.chains[prime] = chain
        chosen = [np.zeros((0, self.joints), dtype=np.int64)]
        found = [np.zeros((2, len(self.geometry.prismatic), 0), dtype=np.int64)]
        for some in self.choices:
            # Work that each point of a slice is asked with, in products of terms.
            if time.stop(3.0 * prime ** len(some)):
                break
            found.append(self.chains[prime].singular(some, self._draw))
            chosen.append(np.tile(some, (found[-1].shape[2], 1)))
        every = np.concatenate(chosen), np.concatenate(found, axis=2)
        return SlicePoints(self, prime, len(found) - 1, *every)

    def modular(self, component: Component, prime: int) -> ModularSet:
        """Return a component modulo a prime, made once."""
        made = self._sets[prime].of(component, lambda c: ModularSet(c, self.ring, prime))
        return made  # type: ignore[no-any-return]

    def count(self, points: Sequence[SlicePoints], components: Sequence[Component]) -> SliceCount:
        """Hold the points of slices against components."""
        on = [p.on(components) for p in points]
        met = np.any([m.any(axis=1) for m in on], axis=0) if on else np.zeros(0)
        primes = tuple(dict.fromkeys(p.prime for p in points if p.slices))
        return SliceCount(
            self.joints,
            sum(p.slices for p in points),
            len(self.choices),
            sum(map(len, points)),
            sum(int((~m.any(axis=0)).sum()) for m in on),
            primes[0] if primes else FIELDS[0],
            SEED,
            primes if len(primes) > 1 else (),
            len(components),
            int(met.sum()),
        )


def without_parts(
    points: Sequence[SlicePoints],
    components: Sequence[Component],
    off: Callable[[list[Component]], Bool] | None = None,
) -> list[Component]:
    """Return components but for those of whose points, which are many, one other has all."""
    # Two searches state one set in two ways: the shorter is kept. Values that differ may agree
    # over one small field: points over two must say it, and real ones, of those ``off`` tells.
    left = sorted(components, key=lambda c: (c.codimension, sum(map(len, c.relations))))
    for c in reversed(tuple(left)):
        # Points of one field, and such fields, that a component must have been met at to be
        # told from others by them.
        met = Counter[int]()
        for p in points:
            met[p.prime] += int(p.held(c).sum())
        if sum(count >= 12 for count in met.values()) < 2:
            continue
        for k in left:
            if k is c or any((p.held(c) & ~p.held(k)).any() for p in points):
                continue
            if off is None or not (~off([c]) & off([k])).any():
                left = [x for x in left if x is not c]
                break
    return [c for c in components if any(c is k for k in left)]


def count_on_slices(
    geometry: Nominal,
    task: Task,
    ring: Ring,
    components: Sequence[Component],
    most: int,
    time: Budget,
) -> SliceCount | None:
    """Count singular points of a chain on slices, within a time; no mimics, independent rows.

    ``most``: the largest codimension of a component. None where the field does not know the chain's
    numbers (denominators, roots), or one field contradicts and there is no time to ask the other.
    """
    counted: list[SliceCount] = []
    for prime in ASKED:
        slices = Slices(geometry, task, ring, min(most, MOST_JOINTS))
        try:
            again = slices.count([slices.turn(prime, time)], components)
        except ValueError:  # a denominator that the prime divides
            continue
        if again.slices:
            counted.append(again)
        if not again.off:
            return counted[-1] if counted and not counted[-1].off else None
    # What one field alone contradicts may be its own doing: then nothing is said.
    return counted[-1] if len(counted) == len(ASKED) else None


def without_inner(
    components: Sequence[Component], doubtful: Sequence[Component], ring: Ring, time: Budget
) -> list[Component]:
    """Return components without ``doubtful`` ones whose points all lie on others that are left."""
    # Points of random slices modulo a prime of 62 bits decide; what is undecided in time stays.
    left = list(components)
    residues, rng = Residues(ring), np.random.default_rng(43)
    for c in sorted(doubtful, key=lambda c: -c.codimension):
        # Terms of a component's relations up to which its points are looked for: others are no
        # pieces.
        if not c.relations or sum(map(len, c.relations)) > 200:
            continue
        others = [k for k in left if k is not c]
        count = c.codimension - len(c.values)
        try:
            found = slice_points(c.relations, residues, rng, c.values, time.check, count)
            points = [on_any(others, s) for s in found]
        except (BudgetExceeded, Undecided):
            continue
        if points and all(points):
            left = others
    return left


@dataclass(frozen=True, eq=False)
class RandomSingular:
    """Singular configurations that random starts led to."""

    maker: PieceMaker  # of the chain
    q: Array  # (k, n): the configurations

    @classmethod
    def of(cls, maker: PieceMaker) -> RandomSingular:
        """Those that random starts over whole circles lead to."""
        box = SearchBox.of(Branch((), ()), maker.lower, maker.upper)
        drawn = OwnPoints(maker.geometry.arm).drawn(400, box, np.random.default_rng(37))
        return cls(maker, drawn)

    def __len__(self) -> int:
        return len(self.q)

    def left(self, components: Sequence[Component]) -> RandomSingular:
        """Those that are clearly on none of some components."""
        return replace(self, q=self.q[self.off(components)])

    def off(self, components: Sequence[Component]) -> Bool:
        """Return which of them are clearly on none of some components: (k,)."""
        off = np.ones(len(self.q), dtype=bool)
        for c in components:
            off[off] = self.maker.off(self.q[off], c.values, c.relations) > BLUNT
        return off

    def held(self, component: Component) -> Bool:
        """Return which of them may be on a component: (k,)."""
        return ~self.off([component])

    def varies(self, joint: int) -> Bool:
        """All of them: no joint is at a value that was chosen."""
        return np.ones(len(self.q), dtype=bool)

    def gap(self, missed: Bool) -> list[str]:
        """Return what missed ones say, with one of them; nothing where none was missed."""
        if not missed.any():
            return []
        q = self.q[int(np.argmax(missed))]
        shown = ", ".join(f"{x:.4g}" for x in self.maker.space.wrap(q))
        return [
            f"{int(missed.sum())} of {len(self.q)} singular configurations that random starts led "
            f"to lie on no family, such as q = {shown}: something is missing"
        ]


_FOR_VALUES = 0.1
"""Share of the time that minors have which say at what values of joints axes are special."""

Near = Callable[[Mapping[int, Value], Budget], Sequence[Component]]


class SliceSearch:
    """Goes through slices, and searches at joint values to which points on no family lead.

    The chain is as of ``Slices``; ``limit`` is the largest codimension of a component. ``unseen``
    are components if they have points that lie on no other. ``near`` is a search by neighbours,
    asked before all minors are. ``real`` configurations on no component lead on when slices no
    longer do. ``count``: slices against ``components``, without a field that alone contradicts.
    ``enough``: times, and fields, after which nothing is open. ``steps``: what else rests on
    random points.
    """

    def __init__(
        self,
        geometry: Nominal,
        task: Task,
        ring: Ring,
        components: Sequence[Component],
        limit: int,
        time: Budget,
        unseen: Sequence[Component] = (),
        near: Near | None = None,
        real: RandomSingular | None = None,
    ) -> None:
        self.near, self.real = near, real
        self.geometry, self.task, self.ring = geometry, task, ring
        self.components, self.limit, self.time = list(components), limit, time
        self.slices = Slices(geometry, task, ring, limit)
        self.steps: list[RandomSteps] = []
        self.count: SliceCount | None = None
        self.enough = False
        self._unseen = list(unseen)
        self.kept: dict[int, list[SlicePoints]] = defaultdict(list)
        self._turns: Counter[int] = Counter()
        self._open: set[int] = set()
        self._unfollowed = False  # time ended before all that contradicts was followed
        self._tried: list[Component] = []

    def run(self) -> None:
        """Go through slices until nothing new turns up, or the time is over."""
        fields = list(self.slices.fields)
        while not self.time.stop() and not self._done():
            if len(fields) < NEEDED + len(self._open):
                break  # so many contradict that too few are left to say otherwise
            # Times that a field is asked before a larger one.
            prime = min(fields, key=lambda p: (self._turns[p] // 2, p))
            try:
                new = self.slices.turn(prime, self.time)
            except ValueError:  # a denominator that the prime divides
                fields.remove(prime)
                continue
            self.kept[prime].append(new)
            if new.slices == len(self.slices.choices):
                self._turns[prime] += 1
            off = self._taken_in(new.left(self.components))
            # Searches of many joints after which another field is asked: one alone may be
            # misleading.
            most = None if self.near is None else 2
            if self._follow(off, most):  # what no value explains
                self._open.add(prime)
                self._turns.pop(prime, None)
                fields.remove(prime)
        if self.real is not None and not self.time.over:
            self._follow(self.real.left(self.components))
        clean = [p for p in self.kept if p not in self._open]
        counted = [s for p in (clean or self.kept) for s in self.kept[p]]
        if not sum(s.slices for s in counted) or (
            self._open and not clean and len(self._open) < NEEDED
        ):
            return
        unmet = [c for c in self.components if not any(p.held(c).any() for p in counted)]
        # Share of the time for whether components that were not met are parts of others.
        time = self.time.part(1.0, 0.03)
        self.components = without_inner(self.components, unmet, self.ring, time)
        self.components = without_parts(
            counted, self.components, None if self.real is None else self.real.off
        )
        self.count = count = self.slices.count(counted, self.components)
        # Share of the components that must have been met: of those not known, as many may have
        # been.
        met = count.met >= 0.8 * count.known
        self.enough = self._enough() and not count.off and met and not self._unfollowed

    def _done(self) -> bool:
        """Return True if slices were gone through often enough."""
        if not self._enough():
            return False
        count = self.slices.count([s for p in self._turns for s in self.kept[p]], self.components)
        # One of the components may be met on none: then it ends after more times.
        return count.met == count.known or sum(self._turns.values()) >= 7

    def _enough(self) -> bool:
        """Return True if slices were gone through as often as must be, over as many fields."""
        # Times that all slices are gone through, each over another field or with other values.
        return sum(self._turns.values()) >= 5 and len(+self._turns) >= NEEDED + len(self._open)

    def _follow(self, off: SlicePoints | RandomSingular, most: int | None = None) -> bool:
        """Search where points on no family lead to, ``most`` in vain; whether some are left."""
        in_vain = 0
        while len(off):
            self._unfollowed = self._unfollowed or self.time.stop()
            at = None if self._unfollowed else self._most_shared(off)
            if at is None or in_vain == most:
                return True
            self._tried.append(at)
            before = self.components
            self._search(at.values)
            in_vain += 1
            if self.components != before:
                off, in_vain = off.left(self.components), 0
        return False

    def _most_shared(self, off: SlicePoints | RandomSingular) -> Component | None:
        """The value of a joint that most of some points share, of those not tried."""
        places = self._values
        held = [(next(iter(c.values)), off.held(c)) for c in places]
        shared = [int((on & off.varies(j)).sum()) for j, on in held]
        share = Counter[int]()  # of the points at whose slices a joint varies
        for (j, _), count in zip(held, shared, strict=True):
            share[j] += count / (off.varies(j).sum() + 1)
        left = [k for k, c in enumerate(places) if shared[k] and c not in self._tried]
        # The joint at whose values all missing points are, first.
        best = max(left, key=lambda k: (share[held[k][0]], shared[k]), default=None)
        return None if best is None else places[best]

    def _taken_in(self, off: SlicePoints) -> SlicePoints:
        """Return what is left of points when systems that have some of them are components, too."""
        while len(off) and self._unseen and not self.time.stop():
            has = off.on(self._unseen).sum(axis=1).tolist()
            best = max(range(len(has)), key=lambda i: (has[i], self._unseen[i].codimension))
            if not has[best]:
                break
            c = self._unseen.pop(best)
            of = map(tuple, off.chosen[off.held(c)].tolist())
            ((most, _),) = Counter(of).most_common(1)
            on = off.at((off.chosen == most).all(axis=1))
            if c.codimension < self.limit and on.regular_too(c):
                self._unseen += self._cut(c)  # what is singular of it is smaller
            else:
                self.components.append(c)
                off = off.left(self.components)
        return off

    def _cut(self, c: Component) -> list[Component]:
        """A system with one equation more: each factor of a short minor that is not zero on it."""
        factored = self._factored(c.values, self.time.part(_FOR_VALUES))
        new = (
            factors
            for minor, factors in factored
            if minor != 0 and not any(self.ring.divides(r, minor) for r in c.relations)
        )
        # Minors that are not zero on a system, among which the shortest cuts it.
        some = islice(new, 3)
        shortest = min(some, key=lambda fs: max(map(len, fs), default=0), default=[])
        cuts = (Component(c.values, (*c.relations, f), False, c.codimension + 1) for f in shortest)
        return [settled(cut, self.ring) for cut in cuts]

    def _factored(
        self, values: Mapping[int, Value], time: Budget
    ) -> Iterator[tuple[Poly, list[Poly]]]:
        """Minors of near joints at values, the nearest first, and their factors."""
        rank, n = len(self.task.rows), len(self.ring.prismatic)
        minors = NearMinors(self.geometry, self.ring, self.task, rank, time)
        for some in sorted(combinations(range(n), rank), key=lambda c: c[-1] - c[0]):
            if time.stop():
                return
            minors.time = time.at_most(0.2)  # seconds that one of them may take
            try:
                minor = minors.minor(some, values)
                minors.time.check_factor(len(minor))
                yield minor, self.ring.factors(minor) if minor != 0 else []
            except (BudgetExceeded, NotSquare):
                continue

    @cached_property
    def _values(self) -> list[Component]:
        """Joints at values where axes are special: quarter turns, and factors of minors."""
        one, none = Fraction(1), Fraction(0)
        turns: list[Value] = [(one, none), (none, one), (one, one), (one, -one)]
        found = [
            (j, value)
            for j, slides in enumerate(self.ring.prismatic)
            for value in ([(none,)] if slides else turns)
        ]
        for _, factors in self._factored({}, self.time.part(_FOR_VALUES)):
            found += filter(None, map(self.ring.joint_value, factors))
        each = sorted(dict.fromkeys(found), key=lambda at: at[0])
        return [Component({j: v}, (), False, 1) for j, v in each]

    @cached_property
    def _matrix(self) -> Matrix:
        """The Jacobian."""
        return jacobian_matrix(self.geometry, self.ring, self.task, self.time)

    def _search(self, values: Mapping[int, Value]) -> None:
        """All components at a joint's value, or, if they are new, those that neighbours tell."""
        # Shares of what time is left that the search at one value may take, by neighbours and else.
        if self.near is not None:
            before = self.components
            found = self.near(values, self.time.part(0.1))
            self.components = merged(before, found, self.ring)
            if self.components != before:
                return
        time = self.time.part(0.4)
        put = self.ring.putting(values)
        try:
            matrix = [[put(x) for x in row] for row in self._matrix]
        except BudgetExceeded:
            return
        given = len(self.task.rows), self.ring, time, (values, self.limit), self.components
        decomposed = decompose(lambda: matrix, *given)
        self.components = decomposed.components
        self.steps.append(decomposed.second)
