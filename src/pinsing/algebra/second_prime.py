"""The verdicts of random points, asked once more modulo another prime and with another seed.

A search decides at random points modulo a prime which systems of equations have singular
parts. Here each of these systems is met by other points modulo a second prime, and all that
was concluded is tried at the end: singular points must lie on the components that were found,
regular ones must not.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pinsing._dataclass import dataclass
from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, on_any
from pinsing.algebra.generic_points import Residues
from pinsing.algebra.matrix import Matrix
from pinsing.algebra.prime_field import SECOND_PRIME, WORD_PRIME
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.algebra.slices import Slices, slice_points
from pinsing.algebra.zeros import Undecided

FIRST_SEED = 7
SECOND_SEED = 11


@dataclass(frozen=True, eq=False)
class Question:
    """A system of equations at a place, whose points were judged.

    Attributes
    ----------
    relations : tuple of Poly
        The equations.
    values : mapping of joint to Value
        Joints at values, at which the matrix is.
    matrix : Matrix
        What becomes of the Jacobian there.
    rank : int
        Singular means: rank below this.
    count : int
        The codimension of the equations' common zeros.
    """

    relations: tuple[Poly, ...]
    values: Mapping[int, Value]
    matrix: Matrix
    rank: int
    count: int


@dataclass(frozen=True)
class RandomSteps:
    """What of an answer rests on random points of finite fields.

    Attributes
    ----------
    systems : int
        Systems of equations that were judged by random points; none: nothing rests on them.
    primes, seeds : tuples of int
        Modulo which primes, by which seeds.
    gaps : tuple of str
        What the second prime contradicted, or there was no time to ask it.
    """

    systems: int
    primes: tuple[int, ...]
    seeds: tuple[int, ...]
    gaps: tuple[str, ...] = ()


def together(steps: Iterable[RandomSteps]) -> RandomSteps:
    """The random steps of several searches as one."""
    some = [s for s in steps if s.systems]
    return RandomSteps(
        sum(s.systems for s in some),
        tuple(dict.fromkeys(p for s in some for p in s.primes)),
        tuple(dict.fromkeys(seed for s in some for seed in s.seeds)),
        tuple(dict.fromkeys(g for s in some for g in s.gaps)),
    )


def ask_again(
    asked: Sequence[Question], components: Sequence[Component], ring: Ring, time: Budget
) -> RandomSteps:
    """Put all questions of a search to a second prime, and hold its components against it."""
    if not asked:
        return RandomSteps(0, (), ())
    residues = Residues(ring, SECOND_PRIME)
    rng, slices = np.random.default_rng(SECOND_SEED), Slices()
    once = RandomSteps(len(asked), (WORD_PRIME,), (FIRST_SEED,))
    both = RandomSteps(len(asked), (WORD_PRIME, SECOND_PRIME), (FIRST_SEED, SECOND_SEED))
    told = f"random points modulo a second prime, {SECOND_PRIME},"
    try:
        for q in asked:
            asked_at = q.relations, residues, rng, q.values, time.check, q.count
            for s in slice_points(*asked_at, slices=slices):
                time.check()
                singular = s.rank(q.matrix) < q.rank
                if singular != on_any(components, s):
                    what = "are singular on no family" if singular else "are regular on a family"
                    return _with_gap(both, f"{told} {what}")
    except BudgetExceeded as reason:
        return _with_gap(once, f"{told} were not asked: {reason}")
    except Undecided:
        return _with_gap(once, f"{told} were not told apart")
    return both


def _with_gap(steps: RandomSteps, gap: str) -> RandomSteps:
    return RandomSteps(steps.systems, steps.primes, steps.seeds, (gap,))
