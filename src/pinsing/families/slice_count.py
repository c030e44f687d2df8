"""Singular configurations on random slices, over small finite fields, counted against the families.

All joints but a few are put at random values of a field, and the few at all of its values: a
slice. Each singular configuration on it must lie on a family. A family of codimension k has about
one point on a slice of k joints, for some choice of k joints: so many slices are gone through, over
several fields, and how seldom a family that is known was met says how likely one was missed.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from flint import fmpz

from pinsing._types import Bool, Ints
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component
from pinsing.algebra.ring import Ring
from pinsing.families.modular_chain import (
    ModularChain,
    ModularRows,
    ModularSet,
    joints_that_matter,
    short_everywhere,
)
from pinsing.families.proof_forms import roots_in
from pinsing.robot.nominal import Nominal
from pinsing.robot.surd import root_modulo
from pinsing.robot.task import Task

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

Bools = Bool


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
        where = (
            f"on {slices} of {self.joints} joints ({self.choices} choices of joints) over the "
            f"{self._fields()} elements (seed {self.seed})"
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

    def _fields(self) -> str:
        if len(self.primes) < 2:
            return f"field of {self.prime}"
        *first, last = self.primes
        return f"fields of {', '.join(map(str, first))} and {last}"


@dataclass(frozen=True, eq=False)
class Slice:
    """Singular points of one slice."""

    prime: int
    chosen: tuple[int, ...]  # joints that vary
    # x and y: (n, N): the points, in half-angle coordinates; of a slider its length and 0
    x: Ints
    y: Ints

    def at(self, points: Bools) -> Slice:
        """Some of the points."""
        return Slice(self.prime, self.chosen, self.x[:, points], self.y[:, points])


class Slices:
    """Random slices, of so many ``joints``, of a chain without mimics and with independent rows."""

    def __init__(self, geometry: Nominal, task: Task, ring: Ring, joints: int) -> None:
        self.geometry, self.task, self.ring = geometry, task, ring
        n = len(geometry.prismatic)
        # The first and the last joint move all axes of a pose, or none.
        inner = range(1, n - 1) if task.name == "pose" else joints_that_matter(geometry, task)
        self.joints = min(joints, len(inner))
        self._draw = random.Random(SEED)
        self.choices = list(itertools.combinations(inner, self.joints))
        self._draw.shuffle(self.choices)
        self._chains: dict[int, ModularChain] = {}
        self._sets: dict[tuple[int, int], tuple[Component, ModularSet]] = {}
        self._held: dict[int, tuple[Component, dict[int, tuple[Slice, Bools]]]] = {}

    @property
    def fields(self) -> tuple[int, ...]:
        """Those over which a slice is not too large."""
        # Slices of so few joints are small: in larger fields less is special by chance.
        least = 17 if self.joints <= _FEW_JOINTS else FIELDS[0]
        known = [p for p in FIELDS if p >= least and _has_roots(self.geometry, p)]
        # Of one slice: beyond the first number it is gone through only where few fields are as
        # small.
        within = [
            tuple(p for p in known if (p + 1) ** self.joints <= most)
            for most in (350_000, 3_500_000)
        ]
        chosen = within[0] if len(within[0]) >= NEEDED else within[1]
        if self.joints > _FEW_JOINTS:
            return chosen
        whole = tuple(p for p in chosen if not self._divides_a_length(p))
        return whole if len(whole) >= NEEDED else chosen

    def _divides_a_length(self, prime: int) -> bool:
        """Return True if a length of the chain is zero modulo a prime, or none there."""
        lengths = (Fraction(x) for row in self.geometry.translation for x in row if x != 0)
        return any(x.numerator % prime == 0 or x.denominator % prime == 0 for x in lengths)

    def turn(self, prime: int, time: Budget) -> list[Slice]:
        """Return one slice for each choice of joints, as many as there is time for."""
        # ValueError if the prime divides a denominator of the chain, or a length its rank needs.
        if prime not in self._chains:
            pose = self.task.name == "pose"
            chain = (
                ModularChain(self.geometry, prime)
                if pose
                else ModularRows(self.geometry, self.task, prime)
            )
            if short_everywhere(chain, self.geometry, self.task):
                raise ValueError(f"modulo {prime} all configurations are singular")
            self._chains[prime] = chain
        out = []
        for chosen in self.choices:
            # Work that each point of a slice is asked with, in products of terms.
            if time.stop(3.0 * prime ** len(chosen)):
                break
            out.append(Slice(prime, chosen, *self._chains[prime].singular(chosen, self._draw)))
        return out

    def off(self, on: Slice, components: Sequence[Component]) -> Bools:
        """Return which points of a slice lie on none of some components."""
        off = np.ones(on.x.shape[1], dtype=bool)
        for c in components:
            off &= ~self.held([on], c)[0]
        return off

    def held(self, slices: Sequence[Slice], component: Component) -> list[Bools]:
        """Return which points of slices lie on a component, computed once a field."""
        of = self._held.setdefault(id(component), (component, {}))[1]  # kept, and so is its id
        for prime in dict.fromkeys(s.prime for s in slices):
            new = [s for s in slices if s.prime == prime and id(s) not in of]
            if not new:
                continue
            x, y = (np.concatenate([a[k] for a in ((s.x, s.y) for s in new)], 1) for k in (0, 1))
            holds = self._modular(component, prime).holds(x, y)
            ends = np.cumsum([s.x.shape[1] for s in new])[:-1]
            for s, mask in zip(new, np.split(holds, ends), strict=True):
                of[id(s)] = (s, mask)
        return [of[id(s)][1] for s in slices]

    def regular_too(self, on: Slice, component: Component) -> bool:
        """Return True if a component has points on a slice, some singular, that are regular."""
        chain = self._chains[on.prime]
        x, y = (np.repeat(a[:, :1], 1, axis=1) for a in (on.x, on.y))
        for j in on.chosen:
            every = chain.every(j)
            count = len(every[0])
            x, y = (np.repeat(a, count, axis=1) for a in (x, y))
            for a, values in zip((x, y), every, strict=True):
                a[j] = np.tile(values, a.shape[1] // count)
        singular = self.held([on], component)[0].sum()
        return bool(self._modular(component, on.prime).holds(x, y).sum() > singular)

    def without_parts(
        self,
        slices: Sequence[Slice],
        components: Sequence[Component],
        off: Callable[[list[Component]], Bools] | None = None,
    ) -> list[Component]:
        """Return components but for those of whose points, which are many, one other has all."""
        # Two searches state one set in two ways: the shorter is kept. Values that differ may agree
        # over one small field: points over two must say it, and real ones, of those ``off`` tells.
        left = sorted(components, key=lambda c: (c.codimension, sum(map(len, c.relations))))
        of = [np.full(s.x.shape[1], s.prime) for s in slices]
        primes = np.concatenate(of) if of else np.zeros(0, dtype=np.int64)
        for c in reversed(tuple(left)):
            own = np.concatenate(self.held(slices, c)) if slices else np.zeros(0, dtype=bool)
            # Points of one field, and such fields, that a component must have been met at to be
            # told from others by them.
            if len([p for p in set(primes[own].tolist()) if (primes[own] == p).sum() >= 12]) < 2:
                continue
            for k in left:
                if k is c or not np.concatenate(self.held(slices, k))[own].all():
                    continue
                if off is None or not (~off([c]) & off([k])).any():
                    left = [x for x in left if x is not c]
                    break
        return [c for c in components if any(c is k for k in left)]

    def count(self, slices: Sequence[Slice], components: Sequence[Component]) -> SliceCount:
        """Hold the points of slices against components."""
        points = off = 0
        met = [False] * len(components)
        masks = [self.held(slices, c) for c in components]
        for k, one in enumerate(slices):
            left = np.ones(one.x.shape[1], dtype=bool)
            for i in range(len(components)):
                met[i] |= bool(masks[i][k].any())
                left &= ~masks[i][k]
            points += one.x.shape[1]
            off += int(left.sum())
        primes = tuple(dict.fromkeys(one.prime for one in slices))
        return SliceCount(
            self.joints,
            len(slices),
            len(self.choices),
            points,
            off,
            primes[0] if primes else FIELDS[0],
            SEED,
            primes if len(primes) > 1 else (),
            len(components),
            sum(met),
        )

    def _modular(self, component: Component, prime: int) -> ModularSet:
        key = (id(component), prime)  # the component is kept, so that its id stays its own
        if key not in self._sets:
            self._sets[key] = component, ModularSet(component, self.ring, prime)
        return self._sets[key][1]


def _has_roots(geometry: Nominal, prime: int) -> bool:
    """Return True if the square roots of a chain are numbers modulo a prime."""
    try:
        return all(root_modulo(square, prime) for square in roots_in(geometry))
    except ValueError:
        return False


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
            again = slices.count(slices.turn(prime, time), components)
        except ValueError:  # a denominator that the prime divides
            continue
        if again.slices:
            counted.append(again)
        if not again.off:
            return counted[-1] if counted and not counted[-1].off else None
    # What one field alone contradicts may be its own doing: then nothing is said.
    return counted[-1] if len(counted) == len(ASKED) else None
