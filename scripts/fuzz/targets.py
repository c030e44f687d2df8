"""What is fuzzed besides robot files: how a broken input of each kind is made, fed in, and judged.

A target gets one source of chance or several: the first makes an input, each further one changes
it again. It raises what no input may lead to; it returns "result" or "refused", and what was said.
"""

from __future__ import annotations

import functools
import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fuzz import expressions as fuzz_expressions
from fuzz.documents import broken
from fuzz.judge import Ended, Wrong, refused
from fuzz.meshes import mesh
from fuzz.tables import table

# Expressions of xacro ---------------------------------------------------------------


@functools.cache
def _expression_names() -> tuple[Any, dict[str, Any], dict[str, Any]]:
    import xacro

    from pinsing.description.xacro_expression import FUNCTIONS, MATH, Kinds

    space = xacro.NameSpace()
    for name, value in MATH.items():
        dict.__setitem__(space, name, value)
    data = xacro.YamlListWrapper.wrap({"a": {"b": [1, {"c": 2.5}]}, "size": 3, "name": "arm"})
    own = {"data": data, "side": "left", "n": 3, "xyz": "0.1 0.2 0.3"}
    plain = {k: v for k, v in vars(math).items() if k[0] != "_"}
    kinds = Kinds(xacro.YamlDictWrapper, xacro.YamlListWrapper, xacro.NameSpace)
    return kinds, {**FUNCTIONS, **MATH, "math": space, **own}, {**plain, "math": math, **own}


def expression(rngs: list[random.Random], folder: Path) -> Ended:
    """Ordinary ones have the value that Python gives them; wild ones are plain data or refused."""
    from pinsing.description.xacro_expression import PLAIN, Refused, evaluate

    kinds, names, plain = _expression_names()
    first, *others = rngs
    known = first.random() < 0.5 and not others
    text = fuzz_expressions.ordinary(first) if known else fuzz_expressions.wild(first)
    for rng in others:
        text = fuzz_expressions.changed(rng, text)
    errors = (SyntaxError, NameError, TypeError, ValueError, ArithmeticError, LookupError)
    said, value, failed = "", None, False
    try:
        value = evaluate(text, names, kinds)
    except (Refused, AttributeError, *errors) as error:
        failed, said = True, f"{type(error).__name__}: {error}"
    if known:
        try:
            expected = eval(text, {}, dict(plain))  # of our own grammar
        except errors:
            if not failed:
                raise Wrong(f"{text} is {value!r}; Python refuses it") from None
        else:
            if not failed and (type(value) is not type(expected) or repr(value) != repr(expected)):
                raise Wrong(f"{text} is {value!r}; Python says {expected!r}")
            if failed and not said.startswith("Refused"):
                raise Wrong(f"{text}: {said}; Python says {expected!r}")
    if failed:
        return "refused", said[:200]
    _only_data(value, PLAIN | {kinds.dotted, kinds.listed, type(names["abs"])}, text)
    return "result", ""


def _only_data(value: Any, types: frozenset[type], text: str) -> None:
    todo, seen = [value], 0
    while todo and seen < 10_000:
        item = todo.pop()
        seen += 1
        if type(item) not in types:
            raise Wrong(f"{text[:300]} gives a {type(item).__name__}")
        if isinstance(item, dict):
            todo += [*dict.keys(item), *dict.values(item)]
        elif isinstance(item, list | tuple | set | frozenset):
            todo += list(list.__iter__(item) if isinstance(item, list) else item)


# Results and certificates ----------------------------------------------------------


@functools.cache
def _results() -> list[tuple[type[Any], str]]:
    import numpy as np

    import pinsing
    from pinsing.families import closed_form

    arm = pinsing.load("planar3r")
    form = closed_form(arm)
    path = np.linspace([-1.0, -0.5, 0.4], [1.0, 0.6, -0.3], 5)
    made: list[Any] = [
        form,
        pinsing.at(arm, [0.1, 0.0, 0.2]),
        pinsing.kinematics.refine(arm, [0.1, 0.0, 0.1]),
    ]
    made += [pinsing.clearance(form, path), pinsing.crossings(form, path)]
    made += [pinsing.check_trajectory(arm, path), pinsing.sampling.sigma_map(arm, count=500)]
    made += [pinsing.sampling.sweep(arm, levels=[1], samples=11), form.families[0]]
    return [(type(result), result.to_json()) for result in made if result is not None]


def result(rngs: list[random.Random], folder: Path) -> Ended:
    """What is accepted can be written, read and shown again."""
    from pinsing.errors import PinsingError

    kind, text = rngs[0].choice(_results())
    for rng in rngs:
        text = broken(rng, text)
    try:
        made = kind.from_json(text)
    except PinsingError as error:
        return refused(str(error))
    again = made.to_json()
    if kind.from_json(again).to_json() != again:
        raise Wrong(f"{kind.__name__} is not the same after it was written")
    for shown in (str(made), repr(made)):
        if not isinstance(shown, str):
            raise Wrong("no text")
    return "result", ""


@functools.cache
def _certificates() -> list[str]:
    import pinsing
    from pinsing.families import closed_form
    from pinsing.families.certificate import text_of

    forms = [closed_form(pinsing.load(name)) for name in ("planar3r", "stanford", "scara")]
    return [text_of(form.certificate) for form in forms if form.certificate is not None]


def certificate(rngs: list[random.Random], folder: Path) -> Ended:
    """Accepted or rejected, and by nothing but `Rejected`."""
    from pinsing.proof.checker import Rejected, statement, verify

    text = rngs[0].choice(_certificates())
    for rng in rngs:
        text = broken(rng, text)
    try:
        data = verify(text)
    except Rejected as reason:
        return refused(str(reason)) if str(reason).isprintable() else ("refused", repr(str(reason)))
    if not statement(data).isprintable():
        raise Wrong("a statement that cannot be printed")
    return "result", ""


TARGETS: dict[str, Callable[[list[random.Random], Path], Ended]] = {
    "expression": expression,
    "result": result,
    "certificate": certificate,
    "table": table,
    "mesh": mesh,
}
