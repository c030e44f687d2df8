"""Joint space as a product: joints that no equation joins are cut into arcs, each on its own.

Only what has codimension 1 separates. A joint value cuts its joint exactly; equations join the
joints that they share into a group, and a group is looked at on each box of arcs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from pinsing._types import Array
from pinsing.algebra.equation import Equation
from pinsing.proximity.watched import Watched

SLIVER = 1e-5
"""Radians or weighted lengths: a cut this near to a limit lies on it, and cuts nothing off."""


@dataclass(frozen=True)
class Arc:
    """An open range of one joint, between cuts or limits.

    Attributes
    ----------
    joint : int
        Index of the joint.
    low, high : float
        Radians or metres; infinite for a slide without an end.
    circle : bool
        Whether both ends are the same point: a joint that turns endlessly, and has no cut.
    """

    joint: int
    low: float
    high: float
    circle: bool = False

    @property
    def middle(self) -> float:
        """A value well inside."""
        if math.isfinite(self.low) and math.isfinite(self.high):
            return (self.low + self.high) / 2
        if math.isfinite(self.low):
            return self.low + 1.0
        return self.high - 1.0 if math.isfinite(self.high) else 0.0

    def put(self, value: float, endless: bool) -> float | None:
        """The value on this arc, by whole turns if the joint turns endlessly; None if it is off."""
        if self.circle:
            return value
        if endless:
            value += 2 * math.pi * math.ceil((self.low - value) / (2 * math.pi))
        return value if self.low < value < self.high else None


@dataclass(frozen=True, eq=False)
class Surface:
    """An equation that separates.

    Attributes
    ----------
    family : str
        Name of its family.
    equation : Equation
        It; its sign tells the sides apart.
    irreducible : bool
        Whether it is one factor over the field of the geometry, and known to be.
    """

    family: str
    equation: Equation
    irreducible: bool


@dataclass(frozen=True, eq=False)
class Part:
    """Joints that are told apart from the others: one joint, or a group that equations join.

    Attributes
    ----------
    joints : tuple of int
        Their indices, ascending.
    arcs : tuple of tuples of Arc
        What cuts and limits leave of each of them.
    surfaces : tuple of Surface
        Equations in these joints.
    """

    joints: tuple[int, ...]
    arcs: tuple[tuple[Arc, ...], ...]
    surfaces: tuple[Surface, ...]

    @property
    def boxes(self) -> tuple[tuple[Arc, ...], ...]:
        """Every choice of one arc of each joint."""
        return tuple(product(*self.arcs))


@dataclass(frozen=True, eq=False)
class Partition:
    """Joint space less what separates it, as a product of parts.

    Attributes
    ----------
    parts : tuple of Part
        They share no joint.
    low, high : (n,) arrays
        Ends of the joints: the limits, or infinite.
    endless : tuple of bool
        Which joints are circles where nothing cuts them.
    exact : bool
        Whether these are all that separates.
    notes : tuple of str
        What is not counted, or was taken for something else.
    cutting : tuple of str
        Families that separate.
    """

    parts: tuple[Part, ...]
    low: Array
    high: Array
    endless: tuple[bool, ...]
    exact: bool
    notes: tuple[str, ...]
    cutting: tuple[str, ...]


def partition(watched: Watched, limits: bool) -> Partition:
    """Cut joint space, within the limits or on whole circles.

    Parameters
    ----------
    watched : Watched
        The families.
    limits : bool
        Whether joints end at their limits; else revolute ones are circles and slides endless.
    """
    n = watched.n
    low = watched.lower if limits else np.full(n, -np.inf)
    high = watched.upper if limits else np.full(n, np.inf)
    turning = ~watched.prismatic
    endless = tuple(bool(b) for b in turning & ~(np.isfinite(low) & np.isfinite(high)))
    cuts: list[set[float]] = [set() for _ in range(n)]
    surfaces: list[Surface] = []
    notes: list[str] = []
    exact = watched.complete
    cutting: list[str] = []
    for name, family in zip(watched.names, watched.families, strict=True):
        if not family.real or family.codimension != 1:
            continue
        cutting.append(name)
        for branch in family.branches:
            if len(branch.values) == 1 and not branch.equations:
                cuts[branch.values[0].joint].add(branch.values[0].value)
            elif len(branch.equations) == 1 and not branch.values:
                whole = len(family.branches) == 1 and watched.complete
                surfaces.append(Surface(name, branch.equations[0], whole))
            else:
                exact = False
                notes.append(
                    f"{name} is stated by several equations: what it separates is not counted"
                )
    arcs = [
        _arcs(
            j,
            cuts[j],
            float(low[j]),
            float(high[j]),
            endless[j],
            bool(watched.prismatic[j]),
            notes,
            watched.joints[j],
        )
        for j in range(n)
    ]
    parts = []
    for joints in _groups(n, surfaces):
        mine = tuple(s for s in surfaces if set(s.equation.involved) <= set(joints))
        free = [j for j in joints if mine and any(math.isinf(a.high - a.low) for a in arcs[j])]
        if free:
            exact = False
            names = ", ".join(watched.joints[j] for j in free)
            notes.append(f"{names} has no limits: what equations separate is not counted")
            parts += [Part((j,), (arcs[j],), ()) for j in joints]
            continue
        parts.append(Part(joints, tuple(arcs[j] for j in joints), mine))
    return Partition(
        tuple(parts), low, high, endless, exact, tuple(notes), tuple(dict.fromkeys(cutting))
    )


def _arcs(
    joint: int,
    cuts: set[float],
    low: float,
    high: float,
    endless: bool,
    slides: bool,
    notes: list[str],
    name: str,
) -> tuple[Arc, ...]:
    turn = 2 * math.pi
    if endless:
        if not cuts:
            return (Arc(joint, -math.pi, math.pi, True),)
        ends = sorted(math.remainder(c, turn) for c in cuts)
        ends.append(ends[0] + turn)
        return tuple(Arc(joint, a, b) for a, b in pairwise(ends))
    inside = []
    for c in cuts:
        turns = [0]
        if not slides:
            turns = list(range(math.floor((low - c) / turn), math.ceil((high - c) / turn) + 1))
        for k in turns:
            v = c + turn * k
            if low + SLIVER < v < high - SLIVER:
                inside.append(v)
            elif low < v < high:
                notes.append(f"{name}: a singular value lies on the joint limit, within {SLIVER:g}")
    ends = [low, *sorted(inside), high]
    return tuple(Arc(joint, a, b) for a, b in pairwise(ends))


def _groups(n: int, surfaces: list[Surface]) -> list[tuple[int, ...]]:
    """Joints that share an equation, directly or by way of others."""
    groups = [{j} for j in range(n)]
    for s in surfaces:
        joined = [g for g in groups if not g.isdisjoint(s.equation.involved)]
        groups = [g for g in groups if g not in joined] + [set[int]().union(*joined)]
    return sorted(tuple(sorted(g)) for g in groups)
