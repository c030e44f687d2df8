"""Planar chains of any length: singular where all links are in line.

All axes that turn are parallel, and all that slide are perpendicular to them. Seen along the axes,
joint j moves a point at right angles to the vector from it, so that the differences of neighbouring
columns are the links between them, turned by a right angle. Position is lost where all links up
to the tip and all directions of slides are parallel; position and orientation together where
those between the first and the last turning joint are. What lies between two turning joints has
one direction; each with the next gives one condition, on the sum of the angles between them, and
slides between the same two joints one on their lengths. No joint is in two of these: they are
independent, and nothing else is singular. Where only one direction of the plane counts, all have to
be at right angles to it as well: it is one more link, on the base or on the tip.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from pinsing.algebra.components import Component
from pinsing.algebra.ring import Poly, Ring, Value
from pinsing.robot.nominal import Nominal
from pinsing.robot.task import Task

Vector = npt.NDArray[np.object_]
"""Exact numbers: (3,), or (3, 3) for a rotation."""
_EYE: Vector = np.array([[Fraction(i == k) for k in range(3)] for i in range(3)])


@dataclass(frozen=True, eq=False)
class _Stretch:
    """What turns together: all between two turning joints.

    Attributes
    ----------
    link : Vector or None
        From one axis to the next, or to the tip, with slides at zero; None where it does not count.
    slides : tuple of (int, Vector)
        Prismatic joints of it, and their directions.
    """

    link: Vector | None
    slides: tuple[tuple[int, Vector], ...]


def planar_chain(
    geometry: Nominal, task: Task, rank: int, ring: Ring
) -> tuple[Component, ...] | None:
    """The singular set of a planar chain; None where the chain, or its task, is none.

    Parameters
    ----------
    geometry : Nominal
        A chain without mimic joints.
    task : Task
        Rows that count.
    rank : int
        Singular means: rank below this.
    ring : Ring
        Of its polynomials.

    Returns
    -------
    tuple of Component or None
        One, or none where the rank is the same everywhere. Its relations are products: sin q2,
        which is zero at 0 and at 180 degrees.
    """
    axes, places, tip_turn = _home(geometry)
    prismatic = geometry.prismatic
    turning = [j for j, slides in enumerate(prismatic) if not slides]
    if not turning:
        return None
    normal = axes[turning[0]]
    if any(_apart(axes[j], normal) for j in turning):
        return None
    if any(slides and axes[j] @ normal for j, slides in enumerate(prismatic)):
        return None
    counted = _counted(task, normal, tip_turn)
    if counted is None or rank != counted.directions + counted.turns:
        return None
    stretches = _stretches(axes, places, prismatic, normal, counted.turns)
    values: dict[int, Value] = {}
    relations: list[Poly] = []
    directions: list[tuple[int, Vector]] = []
    for last, stretch in stretches:
        found = _direction(stretch, normal, ring, values, relations)
        if found is None:
            return ()
        directions += [(last, found)] if found.any() else []
    if not directions:
        return None
    if counted.across is not None:
        directions += [(-1, counted.across), (turning[-1], counted.across)][counted.at_tip :][:1]
        directions.sort(key=lambda found: found[0])
    signs = [1 if axes[j] @ normal == 1 else -1 for j in range(len(prismatic))]
    for (first, v), (last, w) in itertools.pairwise(directions):
        between = [j for j in turning if first < j <= last]
        if between:
            relations.append(_parallel(v, w, between, signs, normal, ring))
        elif _apart(v, w):
            return ()
    if not values and not relations:
        return None
    return (Component(values, tuple(relations), True, len(values) + len(relations)),)


def turn_alike(geometry: Nominal) -> bool:
    """Whether all turning joints have parallel axes, found out from the first that has not."""
    turn: Vector | None = None  # from the first turning joint on
    for rotation, slides in zip(geometry.rotation, geometry.prismatic, strict=False):
        if turn is not None:
            turn = turn @ np.array(rotation)
            if not slides and (turn[0, 2] != 0 or turn[1, 2] != 0):
                return False
        elif not slides:
            turn = _EYE
    return True


def _home(geometry: Nominal) -> tuple[list[Vector], list[Vector], Vector]:
    """Axes, points on them with the tip's as the last, and the tip's axes, at the ring's zero."""
    turn, at = _EYE, _EYE[0] * 0
    axes, places = list[Vector](), list[Vector]()
    for rotation, translation in zip(geometry.rotation, geometry.translation, strict=True):
        at = at + turn @ np.array(translation)
        turn = turn @ np.array(rotation)
        places.append(at)
        axes.append(turn[:, 2])
    return axes[:-1], places, turn @ np.array(geometry.tip_rotation)


@dataclass(frozen=True, eq=False)
class _Counted:
    """What counts of the motions in a plane.

    Attributes
    ----------
    directions : int
        How many directions of the plane: 1 or 2.
    across : Vector or None
        Where it is one, the direction of the plane at right angles to it, at the ring's zero.
    at_tip : bool
        Whether that is fixed on the tip; else on the base.
    turns : bool
        Whether turns count.
    """

    directions: int
    across: Vector | None
    at_tip: bool
    turns: bool


def _counted(task: Task, normal: Vector, tip: Vector) -> _Counted | None:
    """What the rows of a task make of a plane; None if no direction counts, or of both ends."""
    across: list[tuple[bool, Vector]] = []
    turns = False
    for row, at_tip in zip(task.rows, task.tip_rows, strict=True):
        axis = tip[:, row % 3] if at_tip else _EYE[row % 3]
        if row >= 3:
            turns = turns or axis @ normal != 0
        elif _apart(normal, axis):
            across.append((at_tip, np.cross(normal, axis)))
    if len({at_tip for at_tip, _ in across}) != 1:
        return None
    at_tip, first = across[0]
    if any(_apart(first, other) for _, other in across):
        return _Counted(2, None, at_tip, turns)
    return _Counted(1, first, at_tip, turns)


def _stretches(
    axes: Sequence[Vector],
    places: Sequence[Vector],
    prismatic: Sequence[bool],
    normal: Vector,
    turns: bool,
) -> list[tuple[int, _Stretch]]:
    """Each with the last turning joint before it; -1 is the base."""
    ends = [-1, *(j for j, slides in enumerate(prismatic) if not slides), len(prismatic)]
    out = []
    for before, after in itertools.pairwise(ends):
        slides = tuple((j, axes[j]) for j in range(before + 1, after))
        counts = before >= 0 and not (turns and after == len(prismatic))
        link = None
        if counts:
            link = places[after] - places[before]
            link = link - (link @ normal) * normal
        out.append((before, _Stretch(link, slides)))
    return out


def _direction(
    stretch: _Stretch,
    normal: Vector,
    ring: Ring,
    values: dict[int, Value],
    relations: list[Poly],
) -> Vector | None:
    """Where its columns point, zero if it has none; None where they are never parallel.

    What its slides have to be goes into ``values`` or ``relations``.
    """
    across = normal * 0 if stretch.link is None else np.cross(normal, stretch.link)
    if not stretch.slides:
        return across
    _, d = stretch.slides[0]
    if any(_apart(d, e) for _, e in stretch.slides):
        return None
    if stretch.link is None:
        return d
    # The link has to be perpendicular to the slides, for its column to be along them.
    shares = [(j, d @ e) for j, e in stretch.slides]
    rest = d @ stretch.link
    if len(shares) == 1:
        (j, share) = shares[0]
        values[j] = (-rest / share,)
    else:
        gens = ring.context.gens()
        total = ring.number(rest)
        for j, share in shares:
            total = total + ring.number(share) * gens[ring.variables(j)[0]]
        relations.append(total)
    return d


def _parallel(
    v: Vector,
    w: Vector,
    between: Sequence[int],
    signs: Sequence[int],
    normal: Vector,
    ring: Ring,
) -> Poly:
    """That v is parallel to w, turned by the joints between: a polynomial in their half-angles."""
    gens = ring.context.gens()
    cos, sin = ring.one, ring.zero
    for j in between:
        x, y = (gens[k] for k in ring.variables(j))
        c, s = x * x - y * y, 2 * signs[j] * x * y
        cos, sin = cos * c - sin * s, sin * c + cos * s
    apart = ring.number(normal @ np.cross(v, w))
    along = ring.number(v @ w)
    product = ring.one
    for factor in ring.factors(ring.reduce(cos * apart + sin * along)):
        product = ring.reduce(product * factor)
    return product


def _apart(a: Vector, b: Vector) -> bool:
    """Return True unless two vectors are parallel."""
    return bool(np.cross(a, b).any())
