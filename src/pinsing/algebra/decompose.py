"""From a polynomial matrix to the components of the set where its rank drops, within a time.

The search itself is in ``search``. Here it may go on in a child process, is stopped when time is
over, and what it decided at random points is asked again modulo a second prime.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pinsing.algebra.budget import Apart, Budget, BudgetExceeded
from pinsing.algebra.components import (
    FIRST_SEED,
    Component,
    FoundComponents,
    RandomSteps,
    ask_again,
    inside,
)
from pinsing.algebra.matrix import Matrix, reduce_matrix
from pinsing.algebra.place import SearchPlace, bound
from pinsing.algebra.prime_field import WORD_PRIME
from pinsing.algebra.ring import Packed, Ring, Value
from pinsing.algebra.search import Search

_TO_ASK = 0.1
"""Share of the time for asking the second prime, however long the search took."""

PackedComponent = tuple[Mapping[int, Value], list[Packed], bool, int]


def _packed(c: Component, ring: Ring) -> PackedComponent:
    return c.values, [ring.packed(r) for r in c.relations], c.proven, c.codimension


def _unpacked(packed: PackedComponent, ring: Ring) -> Component:
    values, relations, proven, codimension = packed
    return Component(values, tuple(ring.unpacked(r) for r in relations), proven, codimension)


@dataclass(frozen=True)
class Within:
    """Joint values inside which alone is searched.

    Attributes
    ----------
    values : mapping of joint to Value
        Of these joints; the matrix is the one there.
    limit : int
        Largest codimension of what is looked for; the joints at values count.
    known : sequence of Component
        What was found before: nothing that lies in one of these is looked into.
    """

    values: Mapping[int, Value]
    limit: int
    known: Sequence[Component]


class Decomposition:
    """Runs the search and collects components, and what stopped it where it did not finish."""

    def __init__(
        self,
        matrix: Matrix | Callable[[], Matrix],
        rank: int,
        ring: Ring,
        time: Budget,
        within: Within | None = None,
    ) -> None:
        self.ring = ring
        self.time = time
        self._within = within
        self._apart = Apart(time, time.on_clock + _TO_ASK * time.seconds)
        self._found = FoundComponents(ring, self._tell)
        for c in () if within is None else within.known:
            self._found.add(c.values, c.relations, c.proven, c.codimension)
        self._search = Search(ring, time, self._found)
        self.gaps = self._search.gaps
        self.stopped = False
        self.bound = 1
        self.components: list[Component] = []
        self.second = RandomSteps(0, (), ())
        ended = self._apart.run(lambda: self._ended(matrix, rank))
        if ended.result is None:
            self._stop(ended.told, ended.reason)
        elif ended.result is not self:
            self._take(ended.result)

    def _ended(self, matrix: Matrix | Callable[[], Matrix], rank: int) -> Any:
        """Itself after the search; what can be pickled of it, in a child."""
        search = self._search
        try:
            given = matrix() if callable(matrix) else matrix
            # That it is the generic rank is confirmed below.
            rows, reduced = reduce_matrix(given, rank, self.ring, self.time, generic=True)
            self.bound = bound(rows, reduced) if reduced > 0 and rows else 1
            inside = self._within
            if inside is None:
                everywhere = SearchPlace({}, rows, reduced, self.bound, reduced=True)
                search.confirm(everywhere, rank)
                search.run(everywhere)
            else:
                search.run(SearchPlace(inside.values, rows, reduced, inside.limit, reduced=True))
        except BudgetExceeded as reason:
            self.stopped = True
            self.gaps.append(
                f"{reason} among sets inside {search.depth} simultaneous equations or more"
                if search.depth
                else str(reason)
            )
        self.components = self._found.irredundant(self.time)
        time = self.time.part(1.0, _TO_ASK)
        self.second = ask_again(search.asked, self.components, self.ring, time)
        self.gaps += self.second.gaps
        if not self._apart.child:
            return self
        packed = [_packed(c, self.ring) for c in self.components]
        return packed, self.gaps, self.stopped, self.second, self.bound

    def _tell(self, component: Component) -> None:
        """What a child found, in case that it is stopped."""
        if self._apart.child:
            self._apart.tell(_packed(component, self.ring))

    def _take(self, found: Any) -> None:
        """What the child found."""
        packed, self.gaps, self.stopped, self.second, self.bound = found
        self.components = [_unpacked(c, self.ring) for c in packed]

    def _stop(self, told: Sequence[PackedComponent], reason: str) -> None:
        """What is left of a search that was stopped: components, as far as they were told of.

        Points that some of them were found by are gone with the child: of these nothing but what
        division shows is known to lie in another one.
        """
        found = self._found.all + [_unpacked(t, self.ring) for t in told]
        for c in sorted(found, key=lambda c: (c.codimension, len(c.relations))):
            if not any(inside(c, k, self.ring) for k in self.components):
                self.components.append(c)
        self.stopped = True
        self.gaps.append(reason)
        self.second = RandomSteps(
            len(self._search.asked) + 1, (WORD_PRIME,), (FIRST_SEED,), (reason,)
        )
