"""Certificates of arms, made once, and false ones made of them."""

import copy
import functools
import re

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


@functools.cache
def _made(name):
    form = closed_form(load(**ARMS.get(name, {"robot": name})), prove=True)
    assert form.word == "proven", form.proof.reason
    return form.certificate


def certificate(name):
    return copy.deepcopy(_made(name))


def verdict(data):
    """What the checker says of a certificate or a text: empty if it accepts."""
    try:
        verify(data if isinstance(data, str) else text_of(data))
    except Rejected as reason:
        return str(reason)
    return ""


def _sign(text):
    """Another sign of the last term, or another variable where there is one alone."""
    if " " not in text:
        return text.replace("x", "y") if "x" in text else text.replace("y", "x")
    last = text.split(" ")[-1]
    return text.removesuffix(last) + (last[1:] if last.startswith("-") else f"-{last}")


def mutants(name, every=True):
    """What is changed, and the certificate with that changed; with ``every`` also what long
    certificates may do without."""
    true = certificate(name)
    for k, family in enumerate(true["families"]):
        data = certificate(name)
        data["families"].pop(k)
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
            data = certificate(name)
            moved = f"100x{joint} 1y{joint}" if "y" in text else f"1x{joint} 1/100y{joint}"
            data["polynomials"].append(moved)
            data["families"][k]["forms"][i] = len(data["polynomials"]) - 1
            yield f"family {k} with another value of {text}", data
        if every:
            data = certificate(name)
            data["families"][k]["least_codimension"] += 1
            yield f"family {k} smaller", data
            data = certificate(name)
            data["families"][k]["forms"].pop()
            yield f"family {k} larger", data
    for i, place in enumerate(true["places"]):
        for k, case in enumerate(place["cases"]):
            data = certificate(name)
            data["places"][i]["cases"].pop(k)
            yield f"place {i} without case {k}", data
            for b, other in enumerate(place["cases"][:k]):
                # Where a case is too small whatever comes after it, a place for it is no lie.
                if case[3:] != other[3:] and "nowhere" not in (case[3], other[3]):
                    data = certificate(name)
                    mine = data["places"][i]["cases"]
                    mine[k][3:], mine[b][3:] = other[3:], case[3:]
                    yield f"place {i} with cases {k} and {b} swapped", data
            if every and case[3] != "nowhere":
                data = certificate(name)
                data["places"][i]["cases"][k][3:] = ["nowhere", 0]
                yield f"place {i} with case {k} nowhere", data
        for key in ("of_forms", "of_minors", "of_resultants") if every else ():
            for k in range(len(place[key])):
                data = certificate(name)
                data["places"][i][key].pop(k)
                yield f"place {i} without number {k} {key}", data
    for k, text in enumerate(true["polynomials"]):
        data = certificate(name)
        data["polynomials"][k] = _sign(text)
        yield f"polynomial {k} with another sign", data
        data = certificate(name)
        data["polynomials"][k] = text.replace("x", "z").replace("y", "x").replace("z", "y")
        yield f"polynomial {k} mirrored", data
    changes = [*(("rank", rank) for rank in range(7)), ("rows", true["rows"][1:])]
    for key, value in [*changes, ("rows", true["rows"][:-1]), ("axes", 40), ("square_roots", [5])]:
        if value != true[key]:
            yield f"{key} {value}", {**certificate(name), key: value}
    for i in range(len(true["chain"])):
        data = certificate(name)
        data["chain"][i]["rotation"][0][0] += " 1"
        yield f"link {i} not turned", data
