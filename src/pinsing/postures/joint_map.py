"""Joint space as a product of parts, each with its pieces: where a configuration is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.errors import ConfigurationError, OptionError
from pinsing.postures.boxes import Ground, sum_of
from pinsing.postures.divided import Divided, Sectioned
from pinsing.postures.partition import Arc, Part, Partition, partition
from pinsing.postures.pieces import Clear, Piece, Plain, Wheel, hub_of
from pinsing.postures.subdivision import across, sections, subdivide
from pinsing.proximity.clearance import quick
from pinsing.proximity.crossings import crossings_of, motion_of
from pinsing.proximity.watched import Forms, Watched, watch


def make_piece(part: Part, box: tuple[Arc, ...], scale: Array, until: float) -> Piece:
    """Find the components of a box of arcs.

    Parameters
    ----------
    part : Part
        Joints and equations.
    box : tuple of Arc
        An arc of each of its joints.
    scale : (n,) array
        What counts as one radian, of all joints of the arm.
    until : float
        Time by ``time.monotonic`` at which to stop.
    """
    if not part.surfaces:
        return Plain(part, box)
    if len(part.surfaces) == 1:
        hub = hub_of(part, box)
        if hub is not None:
            return Wheel(part, box, hub)
    hub = across(part, box)
    if hub is not None:
        mine = scale[list(part.joints)]
        return Sectioned(part, box, hub, sections(part, box, hub, mine, until))
    ground = Ground(
        terms=tuple(sum_of(s.equation, part.joints) for s in part.surfaces),
        low=np.array([a.low for a in box]),
        high=np.array([a.high for a in box]),
        circle=np.array([a.circle for a in box]),
        scale=scale[list(part.joints)],
    )
    return Divided(part, box, subdivide(ground, until))


_SAME = 1e-9


def require_same_families(asked: Watched, given: Watched) -> None:
    """Refuse aspects (their families ``given``) that are not those of the forms ``asked`` about.

    Arms may share the names of their joints and all their limits, and differ in lengths: so the
    families are compared themselves.

    Raises
    ------
    OptionError
        Saying what differs.
    """
    if asked is given:
        return
    for what in ("joints", "prismatic", "lower", "upper"):
        if not np.array_equal(getattr(asked, what), getattr(given, what)):
            raise OptionError(f"the aspects given are of another arm: {_PLURAL[what]} differ")
    if not _same_families(asked, given):
        raise OptionError("the aspects given are of another arm: what is singular differs")


_PLURAL = {
    "joints": "its joints",
    "prismatic": "the kinds of its joints",
    "lower": "its joint limits",
    "upper": "its joint limits",
}


def _same_families(a: Watched, b: Watched) -> bool:
    """Compare what separates, number by number."""
    one, other = _numbers(a), _numbers(b)
    return all(
        one[k].shape == other[k].shape and np.allclose(one[k], other[k], rtol=1e-9, atol=1e-9)
        for k in one
    )


def _numbers(watched: Watched) -> dict[str, npt.NDArray[Any]]:
    branches = [f.branches for f in watched.families if f.real and f.codimension == 1]
    flat = Conditions.of(branches, watched.prismatic, watched.weight).flat
    return {**flat, "phase": np.exp(1j * flat["phase"])}  # -pi is pi


@dataclass(frozen=True, eq=False)
class Map:
    """Joint space as a product of parts, each with its pieces: where a configuration is."""

    watched: Watched
    partition: Partition
    pieces: tuple[tuple[Piece, ...], ...]

    @cached_property
    def cutting(self) -> Watched:
        """The families that separate."""
        keep = [i for i, n in enumerate(self.watched.names) if n in self.partition.cutting]
        return replace(
            self.watched,
            names=tuple(self.watched.names[i] for i in keep),
            families=tuple(self.watched.families[i] for i in keep),
        )

    @cached_property
    def counts(self) -> tuple[int, ...]:
        """Components of each part."""
        return tuple(sum(p.upper for p in pieces) for pieces in self.pieces)

    def check(self, q: npt.ArrayLike) -> Array:
        """A configuration (n,) within the limits that count.

        Raises
        ------
        ConfigurationError
            If it is not one.
        """
        found = self.watched.check(q, "q")
        if found.ndim != 1:
            raise ConfigurationError(f"one configuration is wanted, got shape {found.shape}")
        low, high = self.partition.low, self.partition.high
        for j in np.flatnonzero((found < low - 1e-9) | (found > high + 1e-9)):
            raise ConfigurationError(
                f"joint {self.watched.joints[j]!r} is {found[j]:.6g}, outside its limits "
                f"{low[j]:g} to {high[j]:g}: aspects within the limits do not hold it",
                joint=self.watched.joints[j],
                value=float(found[j]),
                limits=(float(low[j]), float(high[j])),
            )
        return np.clip(found, low, high)

    def clear(self, Q: Array) -> bool:
        """Whether a polyline (K, n) meets no family that separates, with proof."""
        if len(Q) == 1 or not self.cutting.families:
            return True
        return len(crossings_of(self.cutting, motion_of(self.cutting, Q, None))) == 0

    def regular(self, Q: Array) -> bool:
        """Whether a polyline (K, n) meets no family at all, with proof."""
        if not self.watched.families:
            return True
        return len(crossings_of(self.watched, motion_of(self.watched, Q, None))) == 0

    def on(self, q: Array) -> str:
        """Name of a family that a configuration is on, within 1e-9 rad; empty where on none."""
        if not self.watched.families:
            return ""
        for event in crossings_of(self.watched, motion_of(self.watched, np.stack([q, q]), None)):
            return event.family
        near = quick(self.watched, q[None])
        # Distance, radians, within which a configuration is on a family: files round their
        # limits.
        return self.watched.names[int(near.family[0])] if float(near.upper[0]) <= 1e-9 else ""

    def clear_in(self, part: Part, q: Array) -> Clear:
        """The same for the joints of a part, with the others as in q."""
        columns = list(part.joints)

        def clear(X: Array) -> bool:
            Q = np.repeat(q[None], len(X), axis=0)
            Q[:, columns] = X
            return self.clear(Q)

        return clear

    def place(self, q: Array) -> tuple[tuple[int, int], ...] | None:
        """Box and component of each part; None on a family, or where it cannot be told."""
        if self.on(q):
            return None
        out = []
        for part, pieces in zip(self.partition.parts, self.pieces, strict=True):
            found = self.located(part, pieces, q)
            if found is None:
                return None
            out.append(found)
        return tuple(out)

    def located(self, part: Part, pieces: tuple[Piece, ...], q: Array) -> tuple[int, int] | None:
        """Box and component of one part, of a configuration that is on no family."""
        found = self._box(part, pieces, q)
        if found is None:
            return None
        box, x = found
        component = pieces[box].locate(x, self.clear_in(part, q))
        return None if component is None else (box, component)

    @staticmethod
    def apart(pieces: tuple[Piece, ...], a: tuple[int, int], b: tuple[int, int]) -> bool:
        """Whether a part with these pieces proves that two places are of different aspects."""
        (box, one), (other_box, other) = a, b
        if box != other_box:
            return True
        piece = pieces[box]
        if one == other:
            return False
        signs = zip(piece.signs(one), piece.signs(other), strict=True)
        if any(s * t < 0 for s, t in signs):
            return True
        return piece.closed and piece.lower == piece.upper

    def _box(self, part: Part, pieces: tuple[Piece, ...], q: Array) -> tuple[int, Array] | None:
        for k, piece in enumerate(pieces):
            x = self.on_arcs(part, piece.box, q)
            if x is not None:
                return k, x
        return None

    def on_arcs(self, part: Part, box: tuple[Arc, ...], q: Array) -> Array | None:
        """The values (d,) of q on a box of arcs, by whole turns; None if they are not on it."""
        x = np.empty(len(box))
        for k, (j, arc) in enumerate(zip(part.joints, box, strict=True)):
            edge = not self.partition.endless[j]
            value = float(q[j])
            put = arc.put(value, self.partition.endless[j])
            if put is None and edge:
                # Limits belong to joint space, and what lies on one is cut off by nothing.
                low = value == self.partition.low[j] == arc.low
                put = value if low or value == self.partition.high[j] == arc.high else None
            if put is None:
                return None
            x[k] = put
        return x

    def number(self, place: tuple[tuple[int, int], ...]) -> int:
        """Place in the list of aspects, from 1 on."""
        out = 0
        for (box, component), pieces, count in zip(place, self.pieces, self.counts, strict=True):
            out = out * count + sum(p.upper for p in pieces[:box]) + component
        return out + 1

    def places(self) -> Iterator[tuple[tuple[int, int], ...]]:
        """All of them, in order."""
        each = [
            [(b, c) for b, p in enumerate(pieces) for c in range(p.upper)] for pieces in self.pieces
        ]
        return product(*each)


def make_map(forms: Forms, limits: bool, until: float) -> Map:
    """The pieces of every part of joint space."""
    watched = watch(forms)
    cut = partition(watched, limits)
    scale = 1 / watched.weight
    pieces = tuple(
        tuple(make_piece(part, box, scale, until) for box in part.boxes) for part in cut.parts
    )
    return Map(watched, cut, pieces)
