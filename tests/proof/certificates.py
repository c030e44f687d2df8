"""Certificates of arms, made once, and false ones made of them."""

import copy
import functools
import itertools
import operator
import re

from second_checker import second_verdict

from pinsing import load
from pinsing.families import closed_form
from pinsing.families.certificate import text_of
from pinsing.proof.checker import Rejected, verify

ARMS = {
    "planar3r position": {"robot": "planar3r", "task": "position"},
    "planar3r one row": {"robot": "planar3r", "task": "vx"},
    "planar3r vx,vy,wz": {"robot": "planar3r", "task": "vx,vy,wz"},
    "ur5 orientation": {"robot": "ur5", "task": "orientation"},
    # Rows in the tip's axes.
    "ur5 tool axis": {"robot": "ur5", "task": "tool-axis"},
    "planar3r tip": {"robot": "planar3r", "task": "vx@tip"},
    # Zeros of its equations at complex infinity are no singular configurations.
    "head of alex": {"robot": "alex_nub_hands", "tip": "Head"},
}
"""What is not an arm at its defaults, called by its own name."""


def proven(form):
    """The certificate of a form that has one."""
    assert form.word == "proven", form.proof.reason
    return form.certificate


@functools.cache
def _made(name):
    return proven(closed_form(load(**ARMS.get(name, {"robot": name})), prove=True))


def certificate(name):
    return copy.deepcopy(_made(name))


def verdict(data):
    """What the checker says of a certificate or a text: empty if it accepts, as the second does."""
    text = data if isinstance(data, str) else text_of(data)
    reason = ""
    try:
        verify(text)
    except Rejected as why:
        reason = str(why)
    assert bool(second_verdict(text)) == bool(reason), (reason, second_verdict(text))
    return reason


def _sign(text):
    """Another sign of the last term, or another variable where there is one alone."""
    if " " not in text:
        return text.replace("x", "y") if "x" in text else text.replace("y", "x")
    last = text.split(" ")[-1]
    return text.removesuffix(last) + (last[1:] if last.startswith("-") else f"-{last}")


def put(data, value, *path):
    """A copy with a value put at a place."""
    data = copy.deepcopy(data)
    *way, last = path
    functools.reduce(operator.getitem, way, data)[last] = value
    return data


def without(data, *path):
    """A copy without what is at a place."""
    data = copy.deepcopy(data)
    *way, last = path
    functools.reduce(operator.getitem, way, data).pop(last)
    return data


def longer(data):
    """Copies with 20 mm more along one axis of a link, and of which."""
    for i, link in enumerate(data["chain"]):
        for axis, length in enumerate(link["translation"]):
            yield (i, axis), put(data, f"{length} 1/50", "chain", i, "translation", axis)


def more(data, key, *items):
    """A copy with more in one of its lists."""
    return {**data, key: [*data[key], *items]}


def place_of(forms, *cases, **sums):
    """One place; a case is its one form's number, or a case as it stands."""
    cases = [[[c], [], 1, "nowhere", 0] if type(c) is int else c for c in cases]
    none = {"of_forms": [], "of_minors": [], "of_resultants": []}
    return {"forms": forms, **none, "cases": cases, **sums}


def family_of(name, forms, least):
    """A family whose minors are multiples of its forms."""
    shown = {"pivot": [[], []], "apart": [], "multiples": []}
    return {"name": name, "forms": forms, "least_codimension": least, **shown}


def _others(value):
    """What else may stand in a place of a certificate."""
    yield None
    if isinstance(value, dict):
        yield {**value, "more": 1}
        yield from ({k: v for k, v in value.items() if k != key} for key in value)
    elif isinstance(value, list):
        for k in range(len(value)):
            yield value[:k] + value[k + 1 :]
            yield value[:k] + value[k : k + 2][::-1] + value[k + 2 :]
    elif isinstance(value, int):
        yield from (value - 1, value + 1)
    elif value in ("family", "place"):
        yield "nowhere"
    elif re.match("-?[0-9]", value):
        yield from (_sign(value), value.translate({ord("x"): "y", ord("y"): "x"}), f"{value} 1")


def _places(data, *path):
    """All of what stands in a certificate, and where."""
    value = functools.reduce(operator.getitem, path, data)
    yield path, value
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield from _places(data, *path, key)


def mutants(name, step):
    """Certificates with one thing changed, moved or left out: each so many of all such."""
    true = certificate(name)
    changes = ((v, path) for path, value in _places(true) for v in _others(value) if v != value)
    for value, path in itertools.islice(changes, 0, None, step):
        yield path, put(true, value, *path) if path else value
