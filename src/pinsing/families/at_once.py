"""Several long equations that hold at once, as a person uses them.

Written out they fill pages and tell nobody anything. What one can use: how many motions stay, which
joints can be chosen, and how the others follow from them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from pinsing.algebra.conditions import Branch
from pinsing.algebra.equation import Equation
from pinsing.algebra.joint_form import JointForm, enters_once, joint_form
from pinsing.families.zero_set import MOST_ORDERED, Step, gradients, peeled
from pinsing.measures import Array
from pinsing.prose import listed

LONG = 12
"""An equation with more terms than this is stated for one of its joints, not written out."""


@dataclass(frozen=True)
class SolvedFor:
    """An equation that says what one joint is, given the others.

    Attributes
    ----------
    joint : str
        Symbol of the joint, as q2.
    given : tuple of str
        Symbols of the others.
    values : int
        How many values it has at most: 1 or 2.
    condition : str
        ``R cos(q2 - φ) = c``.
    solution : str
        What follows for the joint.
    where : tuple of (str, str)
        R cos φ, R sin φ and c, each with its expression in the other joints, up to one factor.
    exact : tuple of (str, str)
        The same with exact coefficients; empty where they are not known.
    latex, exact_latex : str
        The same in LaTeX.
    """

    joint: str
    given: tuple[str, ...]
    values: int
    condition: str
    solution: str
    where: tuple[tuple[str, str], ...]
    exact: tuple[tuple[str, str], ...]
    latex: str
    exact_latex: str


def long_form(equation: Equation) -> JointForm | None:
    """Return how a long equation is stated; None for short ones, and where no joint enters once."""
    return joint_form(equation) if len(equation.cos) > LONG else None


def solved_for(systems: Iterable[Sequence[Equation]]) -> tuple[SolvedFor, ...]:
    """Return the long equations that stand alone in a system: those leave the other joints free."""
    alone = [system[0] for system in systems if len(system) == 1]
    found: dict[SolvedFor, None] = {}
    for form in map(long_form, alone):
        if form is None:
            continue
        exact = form.parts(exact=True)
        one = SolvedFor(
            joint=form.equation.joints[form.joint],
            given=tuple(form.equation.joints[j] for j in form.given),
            values=form.solutions,
            condition=form.condition(),
            solution=form.solution(),
            where=form.parts(),
            exact=exact,
            latex=form.latex(),
            exact_latex=form.latex(exact=True) if exact else "",
        )
        found[one] = None
    return tuple(found)


_INDEPENDENT = 1e-7
_SHORT = 4
"""Terms of an equation that is always written out."""


@dataclass(frozen=True)
class AtOnce:
    """Equations of a family that hold at once, near the configuration that stands with it.

    Attributes
    ----------
    terms : tuple of int
        Number of terms of each equation.
    chosen : tuple of str
        Symbols of joints that can be chosen there, each by itself.
    follow : tuple of str
        Symbols of the joints that then follow.
    steps : tuple of str
        How they follow one after the other, where each enters an equation once; empty where only
        solving all equations together tells.
    left : int
        Equations that the steps do not use: they say which of the values hold.
    """

    terms: tuple[int, ...]
    chosen: tuple[str, ...]
    follow: tuple[str, ...]
    steps: tuple[str, ...]
    left: int

    def lines(self) -> tuple[str, ...]:
        """Sentences for people."""
        return tuple(self._said())

    def _said(self) -> Iterator[str]:
        verb = "follows" if len(self.follow) == 1 else "follow"
        can = f"{listed(self.chosen)} can be chosen" if self.chosen else "no joint can be chosen"
        yield (
            f"dimension {len(self.chosen)}: near the configuration shown {can}; "
            f"{listed(self.follow)} {verb}"
        )
        yield from self.steps
        if len(self.steps) > MOST_ORDERED:
            doubles = sum("two solutions" in step for step in self.steps)
            yield f"so there are at most 2^{doubles} = {2**doubles} of these, given the others"
        if not self.steps:
            yield (
                "by solving the equations together: `Family.distance(q).q` gives the nearest "
                "solution, `Family.sample` gives many"
            )
        elif self.left:
            more = (
                "the other equation says"
                if self.left == 1
                else (f"the other {self.left} equations say")
            )
            yield f"{more} which of these values hold"


def long_ones(equations: Sequence[Equation]) -> list[Equation]:
    """Return the long equations of a system of several; all of many, which fill a page as well."""
    if len(equations) < 2:
        return []
    short = [e for e in equations if _SHORT < len(e.cos) <= LONG]
    many = sum(len(e.cos) for e in short) > 2 * LONG
    return [e for e in equations if len(e.cos) > (_SHORT if many else LONG)]


def at_once(branch: Branch, q: Array, symbols: Sequence[str]) -> AtOnce | None:
    """Return how a branch's equations can be used near a generic q (n,); None if not known."""
    equations = branch.equations
    if not long_ones(equations):
        return None
    slopes = gradients(equations, q[None])[0]
    sizes = np.linalg.svd(slopes, compute_uv=False)
    rank = int((sizes > _INDEPENDENT * max(float(sizes[0]), 1e-300)).sum())
    fixed = {v.joint for v in branch.values}
    moving = [j for j in sorted({j for e in equations for j in e.involved}) if j not in fixed]
    if not 0 < rank <= len(moving):
        return None
    found = _in_turn(equations, slopes, rank) or _together(slopes, rank, moving)
    if found is None:
        return None
    follow, steps = found
    chosen = [j for j in range(len(q)) if j not in follow and j not in fixed]
    return AtOnce(
        terms=tuple(len(e.cos) for e in equations),
        chosen=tuple(symbols[j] for j in chosen),
        follow=tuple(symbols[j] for j in follow),
        steps=steps,
        left=len(equations) - len(steps) if steps else 0,
    )


def _regular(slopes: Array, follow: Sequence[int], rank: int) -> bool:
    sizes = np.linalg.svd(slopes[:, list(follow)], compute_uv=False)
    return bool(sizes[rank - 1] > 1e3 * _INDEPENDENT * max(float(sizes[0]), 1e-300))


def _in_turn(
    equations: Sequence[Equation], slopes: Array, rank: int
) -> tuple[tuple[int, ...], tuple[str, ...]] | None:
    """Joints that follow one after the other, each from an equation that it enters once."""
    rows = sorted(
        zip(equations, slopes, strict=True), key=lambda r: (len(r[0].involved), len(r[0].cos))
    )
    if rank > MOST_ORDERED:
        return _peeled(rows, rank)
    once = [(e, s, [j for j in e.involved if enters_once(e, j)]) for e, s in rows[:6]]
    tried = 0
    for some in combinations(once, rank):
        for follow in product(*(joints for _, _, joints in some)):
            if len({*follow}) < rank:
                continue
            tried += 1
            # Choices of joints that are tried, at most.
            if tried > 2000:
                return None
            # An equation may use joints that follow from those before it, and no later one.
            later = [set(follow[k + 1 :]) for k in range(rank)]
            if any(set(e.involved) & later[k] for k, (e, _, _) in enumerate(some)):
                continue
            if _regular(np.array([s for _, s, _ in some]), follow, rank):
                forms = [joint_form(e, j) for (e, _, _), j in zip(some, follow, strict=True)]
                if None not in forms:
                    return follow, tuple(
                        f"{f.condition()} [{len(f.equation.cos)} terms]: {f.solution()}"
                        for f in forms
                        if f is not None
                    )
    return None


def _peeled(
    rows: Sequence[tuple[Equation, Array]], rank: int
) -> tuple[tuple[int, ...], tuple[str, ...]] | None:
    """The same of many equations: the simplest that are independent, if they can be so solved."""
    some: list[tuple[Equation, Array]] = []
    for e, slope in rows:
        sizes = np.linalg.svd(np.array([*(s for _, s in some), slope]), compute_uv=False)
        if sizes[-1] > _INDEPENDENT * max(float(sizes[0]), 1e-300):
            some.append((e, slope))
        if len(some) == rank:
            break
    order = peeled([e for e, _ in some], np.ones(len(rows[0][1]), dtype=bool))
    if order is None or len(some) < rank:
        return None
    return tuple(step.joint for step in order), tuple(_told(step) for step in order)


def _told(step: Step) -> str:
    """Return what one of many equations says of a joint."""
    names = step.equation.joints
    others = [names[j] for j in step.equation.involved if j != step.joint]
    given = f" given {listed(others)}" if others else ""
    count = "two solutions" if step.kind == "once" else "one solution"
    return f"{names[step.joint]} has {count}{given} [{len(step.equation.cos)} terms]"


def _together(
    slopes: Array, rank: int, moving: Sequence[int]
) -> tuple[tuple[int, ...], tuple[str, ...]] | None:
    """Joints that follow from all equations: those whose columns are the most independent."""
    left, follow = slopes[:, list(moving)].copy(), list[int]()
    for _ in range(rank):
        k = int(np.argmax(np.linalg.norm(left, axis=0)))
        if (size := float(np.linalg.norm(left[:, k]))) == 0.0:
            return None
        unit = left[:, k] / size
        left = left - np.outer(unit, unit @ left)
        follow.append(moving[k])
    return (tuple(sorted(follow)), ()) if _regular(slopes, follow, rank) else None
