"""Makes certificates: of an arm's chain and families, with the tree of cases that closes them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pinsing.algebra.components import Component
from pinsing.algebra.ring import Ring
from pinsing.geometry.nominal import Nominal
from pinsing.proof.checker import Certificate, Rejected, verify
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
        for s in stated:
            c = s.component
            forms = [form_of(p, ring, context, roots) for p in c.relations]
            data["families"].append(
                {
                    "name": s.name,
                    "values": {
                        str(j): [number_text(x) for x in (v if len(v) == 2 else (1, v[0]))]
                        for j, v in sorted(c.values.items())
                    },
                    "relations": [polynomials.index(_tidied(draft, f)) for f in forms],
                    "least_codimension": c.codimension,
                }
            )
        data["polynomials"] = polynomials.texts
        read = Certificate(data)
        root = Tree(read, seconds, progress).root()
    except Rejected as reason:
        raise NotFound(str(reason)) from None
    order = _ordered(root)
    number = {id(place): k for k, place in enumerate(order)}
    for place in order:
        data["places"].append(
            {
                "values": {str(j): [str(x), str(y)] for j, (x, y) in sorted(place.values.items())},
                "relations": [polynomials.index(p) for p in place.relations],
                **place.entry,
            }
        )
        if place.cases or not _is_leaf(place.entry):
            data["places"][-1]["cases"] = [
                [polynomials.index(f), times, None if then is None else number[id(then)]]
                for f, times, then in place.cases
            ]
    return data


def _is_leaf(entry: Mapping[str, Any]) -> bool:
    return any(key in entry for key in ("family", "too_small", "no_real_point"))


def _tidied(draft: Certificate, form: Any) -> Any:
    return Tree(draft, 1.0, None).tidy(form)


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
