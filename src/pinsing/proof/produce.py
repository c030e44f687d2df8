"""Makes certificates: of an arm's chain and families, with the tree of cases that closes them."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component
from pinsing.algebra.ring import Ring, Value
from pinsing.proof.checker import MOST_WORK, Certificate, Rejected, verify
from pinsing.proof.forms import Forms, NotFound, Place, shown, vanishes
from pinsing.proof.minors import soundness
from pinsing.proof.skeleton import (
    Draft,
    NotStated,
    form_of,
    form_text,
    number_text,
    roots_in,
    skeleton,
    without_dependent_lines,
)
from pinsing.proof.tree import Tree
from pinsing.robot.nominal import Nominal


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
    budget: Budget,
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
    budget : Budget
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
    try:
        data = skeleton(geometry, rank, roots)
    except NotStated as reason:
        raise NotFound(str(reason)) from None
    try:
        data, jacobian = without_dependent_lines(data, budget)
        budget.check()
        draft = Draft(data, budget, jacobian)
        polynomials, tidy = _Table(), Forms(draft, budget)
        for s in stated:
            tidy.require_time()
            forms = [*_linear(draft, s.component.values)]
            forms += [form_of(p, ring, draft.ring.context, roots) for p in s.component.relations]
            forms = _without_implied(draft, tidy.place_of(forms))
            for part in tidy.parts(forms) if in_parts else [tidy.place_of(forms)]:
                why = soundness(draft, tidy, part, s.component.codimension)
                data["families"].append(
                    {
                        "name": s.name,
                        "forms": [polynomials.index(f) for f in part.forms],
                        "least_codimension": s.component.codimension,
                        "pivot": [list(lines) for lines in why.pivot],
                        "apart": [polynomials.index(f) for f in why.apart],
                        "multiples": why.multiples,
                    }
                )
        draft.polys = [draft.ring.parse(text) for text in polynomials.texts]
        data["polynomials"] = polynomials.texts
        root = Tree(tidy, progress).root()
    except Rejected as reason:
        raise NotFound(str(reason)) from None
    order = _ordered(root)
    number = {id(place): k for k, place in enumerate(order)}
    data["places"] = [_written(place, polynomials, number) for place in order]
    return data


def _linear(draft: Certificate, values: Mapping[int, Value]) -> Iterator[Any]:
    """Joint values as forms."""
    for j, v in values.items():
        (x, y), point = draft.ring.pairs[j], v if len(v) == 2 else (1, v[0])
        a, b = (draft.ring.number(number_text(c)) for c in point)
        yield draft.ring.reduced(b * x - a * y)


def _without_implied(draft: Certificate, family: Place) -> list[Any]:
    """Forms of a family without those that vanish wherever the shorter ones do.

    Soundness is shown by division, a form and a joint at a time: more forms than needed hinder it.
    """
    linear, rest = family.forms[: len(family.values)], family.relations
    kept: list[Any] = []
    for p in rest:
        implied = functools.partial(vanishes, draft.ring, p, kept)
        if not kept or not shown(draft.ring, implied, most=MOST_WORK):
            kept.append(p)
    return [*linear, *kept]


def _written(place: Place, polynomials: _Table, number: Mapping[int, int]) -> dict[str, Any]:
    """A place as it stands in the certificate."""
    entry: dict[str, Any] = {
        "forms": [polynomials.index(p) for p in place.forms],
        **{key: [] for key in ("of_forms", "of_minors", "of_resultants", "cases")},
    }
    for text, source in place.sum:
        if isinstance(source, int):
            entry["of_forms"].append([text, source])
        elif "resultant" in source:
            entry["of_resultants"].append([text, *source["resultant"]])
        else:
            free = [polynomials.index(p) for p in source.get("at", [])]
            entry["of_minors"].append([text, source["minor"], free])
    for f, times, then in place.cases:
        entry["cases"].append([[polynomials.index(f)], [], times, *_leads(then, number)])
    if place.squares:
        zeros = [polynomials.index(g) for _, g in place.squares]
        weights = [str(c) for c, _ in place.squares]
        entry["cases"].append([zeros, weights, 1, *_leads(place.then, number)])
    return entry


def _leads(then: Place | None, number: Mapping[int, int]) -> tuple[str, int]:
    """Where a case leads."""
    if then is None:
        return "nowhere", 0
    if then.family is not None:
        return "family", then.family
    return "place", number[id(then)]


class _Table:
    """Polynomials as texts, each once."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._known: dict[str, int] = {}

    def index(self, poly: Any) -> int:
        text = form_text(poly)
        if text not in self._known:
            self._known[text] = len(self.texts)
            self.texts.append(text)
        return self._known[text]


def _ordered(root: Place) -> list[Place]:
    """Places so that each stands before those that it leads to."""
    seen: set[int] = set()
    order: list[Place] = []

    def visit(place: Place) -> None:
        if id(place) in seen or place.family is not None:
            return
        seen.add(id(place))
        for then in [*(then for _, _, then in place.cases), place.then]:
            if then is not None:
                visit(then)
        order.append(place)

    visit(root)
    return order[::-1]


def text_of(data: Mapping[str, Any]) -> str:
    """A certificate as the text that is written and checked."""
    return json.dumps(data, ensure_ascii=True, separators=(",", ":"))


__all__ = ["NotFound", "Stated", "certificate", "text_of", "verify"]
