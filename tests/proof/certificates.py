"""Certificates of arms, made once, and false ones made of them."""

import copy
import functools
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


def find(data, wanted):
    """Place and case of the first (place, case) that is wanted."""
    places = enumerate(data["places"])
    every = ((i, k, case) for i, place in places for k, case in enumerate(place["cases"]))
    return next((i, k) for i, k, case in every if wanted(i, case))


def place_of(forms, *cases, **sums):
    """One place; a case is its one form's number, or a case as it stands."""
    cases = [[[c], [], 1, "nowhere", 0] if type(c) is int else c for c in cases]
    none = {"of_forms": [], "of_minors": [], "of_resultants": []}
    return {"forms": forms, **none, "cases": cases, **sums}


def mutants(name, every=True):
    """What is changed, and the certificate with that changed; with ``every`` also what long
    certificates may do without."""
    true = certificate(name)
    for k, family in enumerate(true["families"]):
        data = without(true, "families", k)
        for place in data["places"]:
            for case in place["cases"]:
                if case[3] == "family" and case[4] >= k:
                    case[4] = max(0, case[4] - 1)
        yield f"without family {k}", data
        for i, form in enumerate(family["forms"]):
            text = true["polynomials"][form]
            joints = {*re.findall(r"[xy](\d+)", text)}
            if len(re.findall("[xy]", text)) > 2 or len(joints) > 1:
                continue  # no joint's value
            (joint,) = joints
            moved = f"100x{joint} 1y{joint}" if "y" in text else f"1x{joint} 1/100y{joint}"
            data = put(true, [*true["polynomials"], moved], "polynomials")
            data["families"][k]["forms"][i] = len(data["polynomials"]) - 1
            yield f"family {k} with another value of {text}", data
        if every:
            more = {**family, "least_codimension": family["least_codimension"] + 1}
            yield f"family {k} smaller", put(true, more, "families", k)
            yield f"family {k} larger", without(true, "families", k, "forms", -1)
    for i, place in enumerate(true["places"]):
        cases = place["cases"]
        for k, case in enumerate(cases):
            yield f"place {i} without case {k}", without(true, "places", i, "cases", k)
            for b, other in enumerate(cases[:k]):
                # Where a case is too small whatever comes after it, a place for it is no lie.
                if case[3:] != other[3:] and "nowhere" not in (case[3], other[3]):
                    swapped = [*cases]
                    swapped[k], swapped[b] = case[:3] + other[3:], other[:3] + case[3:]
                    data = put(true, swapped, "places", i, "cases")
                    yield f"place {i} with cases {k} and {b} swapped", data
            if every and case[3] != "nowhere":
                data = put(true, [*case[:3], "nowhere", 0], "places", i, "cases", k)
                yield f"place {i} with case {k} nowhere", data
        for key in ("of_forms", "of_minors", "of_resultants") if every else ():
            for k in range(len(place[key])):
                yield f"place {i} without number {k} {key}", without(true, "places", i, key, k)
    for k, text in enumerate(true["polynomials"]):
        yield f"polynomial {k} with another sign", put(true, _sign(text), "polynomials", k)
        mirrored = text.translate({ord("x"): "y", ord("y"): "x"})
        yield f"polynomial {k} mirrored", put(true, mirrored, "polynomials", k)
    changes = [*(("rank", rank) for rank in range(7)), ("rows", true["rows"][1:])]
    for key, value in [*changes, ("rows", true["rows"][:-1]), ("axes", 40), ("square_roots", [5])]:
        if value != true[key]:
            yield f"{key} {value}", put(true, value, key)
    for i, link in enumerate(true["chain"]):
        turned = link["rotation"][0][0] + " 1"
        yield f"link {i} not turned", put(true, turned, "chain", i, "rotation", 0, 0)
