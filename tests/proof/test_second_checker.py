"""A second checker, written from docs/proof.md alone, says what the first one says."""

from __future__ import annotations

import copy

import pytest
from second_checker import second_verdict
from tiers import tiered

from pinsing import load
from pinsing.families import closed_form
from pinsing.proof.checker import Rejected, verify
from pinsing.proof.produce import text_of

ARMS = {
    "ur5": {"robot": "ur5"},
    "stanford": {"robot": "stanford"},
    "scara": {"robot": "scara"},
    "planar3r position": {"robot": "planar3r", "task": "position"},
    "planar3r one row": {"robot": "planar3r", "task": "vx"},
    "ur5 orientation": {"robot": "ur5", "task": "orientation"},
    "so101": {"robot": "so101"},
    # Rows in the tip's axes.
    "ur5 tool axis": {"robot": "ur5", "task": "tool-axis"},
    "planar3r tip": {"robot": "planar3r", "task": "vx@tip"},
    "surgical7": {"robot": "surgical7"},
    "iiwa14": {"robot": "iiwa14"},
    "panda": {"robot": "panda"},
}
LARGER = ["ur5", "stanford"]
SMALL = ["scara", "planar3r position", "planar3r tip"]
made: dict[str, dict] = {}


def certificate(name):
    if name not in made:
        form = closed_form(load(**ARMS.get(name, {"robot": name})), prove=True)
        assert form.word == "proven", form.proof.reason
        made[name] = form.certificate
    return copy.deepcopy(made[name])


def first_verdict(text):
    try:
        verify(text)
    except Rejected as reason:
        return str(reason)
    return ""


LONG = {"so101", "panda", "iiwa14", "surgical7", "xarm7"}


@pytest.mark.parametrize("name", tiered([*ARMS, "xarm7"], {*ARMS} - LONG))
def test_both_accept(name):
    assert second_verdict(text_of(certificate(name))) == ""


def mutants(name):
    """What is changed, and the certificate with that changed."""
    true = certificate(name)
    for k in range(len(true["families"])):
        data = certificate(name)
        data["families"].pop(k)
        for place in data["places"]:
            for case in place["cases"]:
                if case[3] == "family" and case[4] >= k:
                    case[4] = max(0, case[4] - 1)
        yield f"without family {k}", data
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
            data = certificate(name)
            if case[3] != "nowhere":
                data["places"][i]["cases"][k][3:] = ["nowhere", 0]
                yield f"place {i} with case {k} nowhere", data
        for key in ("of_forms", "of_minors", "of_resultants"):
            for k in range(len(place[key])):
                data = certificate(name)
                data["places"][i][key].pop(k)
                yield f"place {i} without number {k} {key}", data
    for k, text in enumerate(true["polynomials"]):
        data = certificate(name)
        data["polynomials"][k] = text.replace("x", "z").replace("y", "x").replace("z", "y")
        yield f"polynomial {k} mirrored", data
    for key, value in (("rank", 5), ("rank", 0), ("axes", 40), ("square_roots", [5])):
        data = certificate(name)
        if data[key] != value:
            data[key] = value
            yield f"{key} {value}", data
    data = certificate(name)
    data["rows"].pop()
    yield "without a row", data
    for i in range(len(true["chain"])):
        data = certificate(name)
        data["chain"][i]["rotation"][0][0] += " 1"
        yield f"link {i} not turned", data


@pytest.mark.parametrize("name", SMALL + [pytest.param(n, marks=pytest.mark.slow) for n in LARGER])
def test_both_reject(name):
    """Every mutant is false, but one: a polynomial that is a unit or a mirror image of itself."""
    count = 0
    for what, data in mutants(name):
        first, second = (say(text_of(data)) for say in (first_verdict, second_verdict))
        assert bool(first) == bool(second), (what, first, second)
        assert first or "mirrored" in what, what
        count += bool(first)
    assert count >= 15


@pytest.mark.parametrize("name", tiered(["scara", "stanford"], ("scara",)))
def test_both_say_the_same_of_other_lengths(name):
    """A length may matter or not: the two agree on which."""
    verdicts = set()
    for i in range(len(certificate(name)["chain"])):
        for axis in range(3):
            data = certificate(name)
            data["chain"][i]["translation"][axis] += " 1/50"
            text = text_of(data)
            first, second = first_verdict(text), second_verdict(text)
            assert bool(first) == bool(second), (i, axis, first, second)
            verdicts.add(bool(first))
    assert verdicts == {True, False}


SHAPES = [
    ("a text for a list", lambda d: d["chain"][0].update(rotation="10")),
    ("a list for a text", lambda d: d["chain"][0].update(multiple=["1"])),
    ("a whole number for a text", lambda d: d["chain"][0].update(multiple=1)),
    ("a truth for a text", lambda d: d["chain"][0].update(multiple=True)),
    ("a blank in a whole number", lambda d: d["chain"][0].update(multiple=" 1")),
    ("a zero before a whole number", lambda d: d["chain"][0].update(multiple="0_1")),
    ("a text for three numbers", lambda d: d["chain"][0].update(translation="000")),
    ("a text for rows", lambda d: d["chain"][0].update(rotation=["100", "010", "001"])),
    ("a text for the tip", lambda d: d["tip"].update(translation="000")),
    ("a tip without a rotation", lambda d: d["tip"].pop("rotation")),
    ("a truth for an index", lambda d: d["rows"].__setitem__(1, True)),
    ("a truth for a rank", lambda d: d.update(rank=True)),
    ("a text for the axes", lambda d: d.update(axes="0")),
    ("an object for steps", lambda d: d.update(row_steps={})),
    ("a number for a step", lambda d: d.update(row_steps=[[0, 1, 1]])),
    ("a text for square roots", lambda d: d.update(square_roots="")),
    ("an object for a list", lambda d: d.update(families={})),
    ("a key too many", lambda d: d.update(more=1)),
    ("a key too many in a link", lambda d: d["chain"][0].update(more=1)),
    ("a key too many in a family", lambda d: d["families"][0].update(more=1)),
    ("a key too many in a place", lambda d: d["places"][0].update(more=1)),
    ("a pivot of rows alone", lambda d: d["families"][0]["pivot"].pop()),
    ("a place without sources", lambda d: d["places"][-1].pop("of_minors")),
    ("no name", lambda d: d["joints"][0].update(name=None)),
    ("a number for a name", lambda d: d.update(robot=1)),
    ("a text for a sum", lambda d: d["places"][0].update(of_forms=["10"])),
    ("a text for a pair", lambda d: d["families"][0].update(multiples=[["10"]])),
    ("a text for a weight", lambda d: d["places"][0]["cases"][0].__setitem__(1, "1")),
    ("a number for a weight", lambda d: d["places"][0]["cases"][0].__setitem__(1, [1])),
    ("a text for a case", lambda d: d["places"][0]["cases"].__setitem__(0, "110")),
    ("a text for where a case leads", lambda d: d["places"][0]["cases"][0].__setitem__(4, "1")),
    ("no word for what a case leads to", lambda d: d["places"][0]["cases"][0].__setitem__(3, 1)),
    ("a case more", lambda d: d["places"][0]["cases"][0].append(0)),
    ("a truth for how often", lambda d: d["places"][0]["cases"][0].__setitem__(2, True)),
    ("a part of the base", lambda d: d.pop("base")),
]


@pytest.mark.parametrize(("what", "change"), SHAPES, ids=[what for what, _ in SHAPES])
def test_types_are_exact(what, change):
    data = certificate("ur5")
    change(data)
    assert first_verdict(text_of(data)), what
    assert second_verdict(text_of(data)), what
