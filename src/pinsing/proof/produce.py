"""Makes certificates: of an arm's chain and families, with the tree of cases that closes them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pinsing.algebra.components import Component
from pinsing.algebra.ring import Ring, Value
from pinsing.geometry.nominal import Nominal
from pinsing.proof.checker import Certificate, Rejected, Values, verify
from pinsing.proof.reduction import find_reduction
from pinsing.proof.skeleton import form_of, number_text, roots_in, skeleton
from pinsing.proof.tree import NotFound, Place, Tree


@dataclass(frozen=True)
class Stated:
    """A component that is stated, and the name of the family it is a part of."""

    name: str
    component: Component


def certificate(
    geometry: Nominal,
    ring: Ring,
    rank: int,
    stated: Sequence[Stated],
    seconds: float,
    progress: Callable[[str], None] | None = None,
    in_parts: bool = False,
) -> dict[str, Any]:
    """A certificate that the singular set of an arm is the union of some components.

    Parameters
    ----------
    geometry : Nominal
        The arm in exact numbers.
    ring : Ring
        What the components' polynomials are of.
    rank : int
        Generic rank of the task Jacobian.
    stated : sequence of Stated
        The components.
    seconds : float
        Time for the search of a tree of cases.
    progress : callable
        Told now and then how far that is.
    in_parts : bool
        State each component as the union of simpler ones where its equations fall apart. That
        finds proofs where the equations as they are do not, and the other way round.

    Raises
    ------
    NotFound
        If there is none, or time was over: with what is missing.
    """
    roots = roots_in(geometry)
    data = skeleton(geometry, rank, roots)
    try:
        draft = Certificate(data)
        data["reduction"] = find_reduction(draft)
        context = draft.ring.context
        polynomials = _Table()
        tidy = Tree(draft, seconds)
        for s in stated:
            c = s.component
            forms = [form_of(p, ring, context, roots) for p in c.relations]
            values = _constants(draft, c.values)
            whole = [Place(values, [tidy.tidy(f) for f in forms])]
            for part in tidy.parts(values, forms) if in_parts else whole:
                entry = {"name": s.name, **_where(part, polynomials)}
                data["families"].append({**entry, "least_codimension": c.codimension})
        data["polynomials"] = polynomials.texts
        read = Certificate(data)
        root = Tree(read, seconds, progress).root()
    except Rejected as reason:
        raise NotFound(str(reason)) from None
    order = _ordered(root)
    number = {id(place): k for k, place in enumerate(order)}
    for place in order:
        entry = {**_where(place, polynomials), **place.entry}
        if not any(key in entry for key in ("family", "too_small", "no_real_point")):
            entry["cases"] = [
                [polynomials.index(f), times, None if then is None else number[id(then)]]
                for f, times, then in place.cases
            ]
        data["places"].append(entry)
    return data


def _constants(draft: Certificate, values: Mapping[int, Value]) -> Values:
    """Joint values as points of the certificate's ring."""
    points = {j: v if len(v) == 2 else (1, v[0]) for j, v in values.items()}
    number = draft.ring.constant
    return {j: (number(number_text(x)), number(number_text(y))) for j, (x, y) in points.items()}


def _where(place: Place, polynomials: _Table) -> dict[str, Any]:
    return {
        "values": {str(j): [str(x), str(y)] for j, (x, y) in sorted(place.values.items())},
        "relations": [polynomials.index(p) for p in place.relations],
    }


class _Table:
    """Polynomials as texts, each once."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._known: dict[str, int] = {}

    def index(self, poly: Any) -> int:
        text = str(poly)
        if text not in self._known:
            self._known[text] = len(self.texts)
            self.texts.append(text)
        return self._known[text]


def _ordered(root: Place) -> list[Place]:
    """Places so that each stands before those that it leads to."""
    seen: set[int] = set()
    order: list[Place] = []

    def visit(place: Place) -> None:
        if id(place) in seen:
            return
        seen.add(id(place))
        for _, _, then in place.cases:
            if then is not None:
                visit(then)
        order.append(place)

    visit(root)
    return order[::-1]


def text_of(data: Mapping[str, Any]) -> str:
    """A certificate as the text that is written and checked."""
    return json.dumps(data, ensure_ascii=True, separators=(",", ":"))


__all__ = ["NotFound", "Stated", "certificate", "text_of", "verify"]
