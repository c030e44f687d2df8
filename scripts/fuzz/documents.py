"""Broken JSON made from good JSON: its tree is changed, then perhaps its text; from a seed."""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Callable
from typing import Any

VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**31, 2**53 + 1, 2**64, -(2**63) - 1, 10**400, 0.5, -0.0,
    1e-320, 1e308, -1e308, float("nan"), float("inf"), "", " ", "nan", "inf", "-inf", "1",
    "text", "\0", "\x1b[31m", "\u202e", "\ud800", "é" * 50, "a" * 5000, "9" * 400,
    "../../etc/passwd", "$x", "1/0", "pinsing/run/1", [], {}, [[]], [1, [2]], [None], {"": None},
    {"a": {"b": []}}, [0] * 1000, [[0.0] * 3] * 3, [[1, 2], [3]], ["nan"], [True],
    {"schema": "pinsing/state/1"},
)  # fmt: skip
TEXTS = (
    "", " ", "null", "true", "0", "[]", "{}", '""', "NaN", "[NaN]", "Infinity", "{", "[", '"',
    "[1,]", "{'a': 1}", "\ufeff{}", "{}{}", "[" * 100_000, '{"a":' * 50_000, "9" * 6000, "-",
    "1e999", "[" * 900 + "]" * 900, "\0", "// {}", '{"schema": 1}', '{"id": 1, "id": 2}',
    "\ud800",
)  # fmt: skip


def broken(rng: random.Random, text: str) -> str:
    """Return JSON text with something wrong in it, as a rule."""
    if rng.random() < 0.04:
        return rng.choice(TEXTS)
    try:
        tree = json.loads(text)
    except (ValueError, RecursionError):  # broken before
        return _other_text(rng, text)
    for _ in range(rng.choice([1, 1, 1, 2, 3, 8])):
        tree = changed(rng, tree)
    text = json.dumps(tree, ensure_ascii=rng.random() < 0.5)
    return _other_text(rng, text) if rng.random() < 0.1 else text


def changed(rng: random.Random, tree: Any) -> Any:
    """Return the tree with one change, in its place or anew."""
    holders = [node for node in _nodes(tree) if isinstance(node, dict | list) and node]
    if not holders or rng.random() < 0.01:
        return copy.deepcopy(rng.choice(VALUES))
    # Small holders are as likely as large ones: long lists of numbers do not hide the rest.
    holder = rng.choice(holders)
    key = rng.choice(list(holder) if isinstance(holder, dict) else range(len(holder)))
    rng.choice(CHANGES)(rng, holder, key, holders)
    return tree


def _nodes(tree: Any) -> list[Any]:
    found = [tree]
    for node in found:  # grows on the way
        inner = node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
        found.extend(inner)
        if len(found) > 20_000:
            break
    return found


def _other_value(rng: random.Random, holder: Any, key: Any, holders: list[Any]) -> None:
    holder[key] = copy.deepcopy(rng.choice(VALUES))


def _near_value(rng: random.Random, holder: Any, key: Any, holders: list[Any]) -> None:
    """Another value of the same type: what only a check of the meaning finds."""
    value = holder[key]
    if isinstance(value, bool) or value is None:
        holder[key] = not value
    elif isinstance(value, int):
        holder[key] = rng.choice([value + 1, value - 1, -value, value * 1000, value ^ 1])
    elif isinstance(value, float):
        holder[key] = rng.choice([-value, value * 2, value + 1e-9, 0.0, value * 1e300])
    elif isinstance(value, str):
        spot = rng.randrange(len(value) + 1)
        holder[key] = (
            value[:spot] + rng.choice(["", "0", "-", "/", " ", "x", "\n"]) + value[spot + 1 :]
        )
    elif isinstance(value, list):
        rng.shuffle(value)


def _remove(rng: random.Random, holder: Any, key: Any, holders: list[Any]) -> None:
    del holder[key]


def _double(rng: random.Random, holder: Any, key: Any, holders: list[Any]) -> None:
    value = copy.deepcopy(holder[key])
    if isinstance(holder, list):
        holder[key:key] = [value] * rng.choice([1, 1, 30])
    else:
        holder[rng.choice([f"{key}_", "", "schema", "id", "__class__", str(key).upper()])] = value


def _rename(rng: random.Random, holder: Any, key: Any, holders: list[Any]) -> None:
    if isinstance(holder, dict):
        other = rng.choice([str(x) for h in holders if isinstance(h, dict) for x in h])
        holder[other] = holder.pop(key)


def _exchange(rng: random.Random, holder: Any, key: Any, holders: list[Any]) -> None:
    other = rng.choice(holders)
    spot = rng.choice(list(other) if isinstance(other, dict) else range(len(other)) or [0])
    if other:  # copies: no tree may come to hold itself
        holder[key], other[spot] = copy.deepcopy(other[spot]), copy.deepcopy(holder[key])


def _nest(rng: random.Random, holder: Any, key: Any, holders: list[Any]) -> None:
    for _ in range(rng.choice([1, 1, 2, 20, 200])):
        holder[key] = [holder[key]] if rng.random() < 0.5 else {"a": holder[key]}


def _cut(rng: random.Random, holder: Any, key: Any, holders: list[Any]) -> None:
    if isinstance(holder, list):
        del holder[rng.randrange(len(holder)) :]
    else:
        holder.clear()


CHANGES: tuple[Callable[[random.Random, Any, Any, list[Any]], None], ...] = (
    _other_value, _other_value, _other_value, _near_value, _near_value, _near_value, _remove,
    _double, _rename, _exchange, _nest, _cut,
)  # fmt: skip


def _other_text(rng: random.Random, text: str) -> str:
    spot = rng.randrange(len(text) + 1)
    return rng.choice(
        [
            text[:spot],
            text[:spot] + chr(rng.randrange(0x250)) + text[spot + 1 :],
            text[:spot] + "\0" + text[spot:],
            "\ufeff" + text,
            text + text,
            text + " junk",
            text.replace(":", ": NaN", 1),
            text.replace("{", '{"schema": "x", ', 1),
        ]
    )
