"""Forged certificates, each wrong in one thing, which one condition of the checker sees."""

from unittest.mock import patch

import pytest
from certificates import certificate, family_of, more, place_of, put, verdict, without

from pinsing.families.certificate import text_of
from pinsing.proof import checker

SIX, ONE, END = [*range(6)], ([0], [0]), ["nowhere", 0]


def split(forms, number="1/4", lines=(SIX, SIX), free=(), cases=range(5)):
    """A place of Stanford: its determinant is 4 y2 x2 y3^2 y5 x5, and each factor is a family."""
    cases = [[[k], [], 1 + (k == 2), "family", k] for k in cases]
    return place_of(forms, *cases, of_minors=[[number, [*lines], [*free]]])


def stanford(*places, **changes):
    data = certificate("stanford")
    data["polynomials"] += ["1", "1 1y5", "1 -1y5", "1x5y5", "0", "1x2y2", "1x1y1"]
    return {**data, "places": [*places] or [split([])], **changes}


def lost(*cases, places=(), **more):
    """Without the last family, x5: other cases stand for it."""
    first = split([], **{"cases": range(4), **more})
    first["cases"] += [[zeros, [*weights], 1, *to] for zeros, weights, *to in cases]
    return without(stanford(first, *places), "families", 4)


def part(forms=(), **more):
    """The same with joint 5 at a value."""
    return split([*forms], **{"number": "-1/4", "free": [6], "cases": range(3), **more})


def beside(*places):
    return stanford(split([]), *places)


def resultant(joint, *cases):
    return beside(place_of([0, 3], *cases, of_resultants=[["1", 0, 1, joint]]))


def small(to, weights=()):
    """Too small for a component."""
    return place_of([0, 3], [[0], [*weights], 2 - len(weights), *to], of_forms=[["1y2", 0]])


def with_family(data, forms, pivot=([], []), apart=()):
    added = {**family_of("more", forms, 0), "pivot": [*pivot], "apart": [*apart]}
    return more(data, "families", added)


def with_minor(data, *lines):
    data["places"][0]["of_minors"].append(["1", [*lines], []])
    return data


def planar(task="vx,vy,wz", **changes):
    return {**certificate(f"planar3r {task}"), **changes}


def never(rows, lines=ONE, **changes):
    """A minor that is 1: nothing is singular."""
    place = place_of([], of_minors=[["1", [*lines], []]])
    return planar(rows=rows, rank=len(lines[0]), families=[], places=[place], **changes)


def tilted(**changes):
    """The third row is a multiple of the second one."""
    data = planar("position", axes=4, square_roots=[2])
    turn = [["1", "0", "0"], ["0", "1/2s2", "-1/2s2"], ["0", "1/2s2", "1/2s2"]]
    data["tip"]["rotation"] = turn
    for place in data["places"]:
        place["of_minors"][0][0] += "s2"
    return {**data, **changes}


def everywhere(rank):
    all_of_it, place = family_of("all", [], 0), place_of([], [[0], [], 1, "family", 0])
    return tilted(rank=rank, polynomials=["0"], families=[all_of_it], places=[place])


def tip(*diagonal):
    rotation = [[d if i == k else "0" for k in range(3)] for i, d in enumerate(diagonal)]
    return put(stanford(), rotation, "tip", "rotation")


def turned(multiple, number):
    return put(stanford(split([], number)), multiple, "chain", -1, "multiple")


OWN = place_of([0], [[0], [], 1, "family", 0], of_forms=[["1", 0]])
BOTH = split([], cases=range(3))
BOTH["cases"].append([[8], [], 1, "place", 1])
SQUARE = place_of([10], [[10], ["1"], 1, "place", 2], of_forms=[["1x2y2", 0]])
TWICE = [[0], ["1", "1"], 1, "family", 0]
ON = ["place", 2], ["place", 3]
CASE = "places", 0, "cases", 0
LINK = {"rotation": [[*"100"], [*"010"], [*"001"]], "translation": [*"000"], "joint": 0}
FORGED = {
    # Singular configurations are lost.
    "no case": ("something else", lambda: lost()),
    "some are left": ("too small", lambda: lost([[4], "", *END])),
    "another family": ("where it leads", lambda: lost([[4], "", "family", 3])),
    "back to itself": ("leads back", lambda: lost([[4], "", "place", 0])),
    "a difference": ("weight", lambda: lost([[6, 7], ["1/4", "-1/4"], *END], number="1/4y5")),
    "a sum below 0": ("weight", lambda: lost([[6, 7], ["1/4", "1/4 -1/2"], *END], number="1/4y5")),
    "a weight of 0": ("weight", lambda: lost([[4, 5], "10", *END], number="1/4x5")),
    "too few weights": ("neither", lambda: lost([[4, 5], "1", *END], number="1/4x5")),
    "two factors": ("neither", lambda: lost([[4, 5], "", *END])),
    "everywhere": ("only a part", lambda: without(stanford(part()), "families", 4)),
    "at a value": ("not free", lambda: lost([[4], "", "place", 1], places=[part([4])])),
    "in a form": ("not free", lambda: {**lost(), "places": [BOTH, part([8])]}),
    "a smaller minor": ("another size", lambda: lost(number="1", lines=([], []), cases=())),
    "points": ("too small", lambda: beside(small(ON[0], "1"), small(END))),
    "points of points": ("too small", lambda: beside(small(ON[0], "1"), small(ON[1]), small(END))),
    "first place": ("first place", lambda: without(stanford(OWN), "families", 4)),
    "no resultant": ("resultant", lambda: resultant(0)),
    # Regular ones are added.
    "a form": ("not shown", lambda: with_family(stanford(), [11])),
    "not apart": ("zero", lambda: with_family(stanford(), [6], apart=[6])),
    "some minors": ("minor", lambda: with_family(planar("one row"), [1], ([], [0]))),
    # The rank is not what is stated.
    "rank 3 of 2": ("rank is less", lambda: everywhere(3)),
    "rank 4 of 3 lines": ("rank is less", lambda: everywhere(4)),
    "rank 1 of 2": ("rank is more", lambda: never([0, 5], ([1], [0]))),
    "rank 0": ("impossible", lambda: never([2], ([], []))),
    "a line less itself": ("itself", lambda: never([0, 5], row_steps=[[0, 0, "1"]])),
    "a row twice": ("rows", lambda: never([2, 2, 5])),
    "rows in disorder": ("rows", lambda: never([5, 2])),
    "other axes": ("axes", lambda: never([5], axes=1)),
    # What is against the format, and harmless here.
    "too many weights": ("neither", lambda: put(stanford(split([], "1/4y2")), TWICE, *CASE)),
    "a free joint of points": ("not free", lambda: beside(SQUARE, part([10]))),
    "a free form": ("not free", lambda: beside(split([10], free=[11]))),
    "a free number": ("not free", lambda: beside(split([10], free=[5]))),
    "first without": ("resultant", lambda: resultant(4, [[0], [], 1, "family", 0])),
    "second without": ("resultant", lambda: resultant(1, [[3], [], 1, "family", 3])),
    "a large pivot": ("too large", lambda: with_family(stanford(), [3, 4], (SIX, SIX))),
    "a larger minor": ("another size", lambda: with_minor(tilted(), [0, 1, 2], [0, 1, 2])),
    "more rows": ("a minor is none", lambda: with_minor(stanford(), SIX, SIX[1:])),
    "lines in disorder": ("lines", lambda: stanford(split([], "-1/4", ([1, 0, *SIX[2:]], SIX)))),
    "an index below 0": ("no index", lambda: put(stanford(), -12, *CASE, 0, 0)),
    "another word": ("leads nowhere", lambda: put(beside(OWN), [[0], [], 1, "", 1], *CASE)),
    "a mirror image": ("rotation", lambda: tip("1", "1", "-1")),
    "longer": ("rotation", lambda: tip("2", "1/2", "1")),
    "shorter": ("rotation", lambda: tip("1/2", "2", "1")),
    "7 turns": ("turns", lambda: turned("7", "1/28")),
    "10 turns": ("turns", lambda: turned("10", "1/40")),
    "17 joints": ("16", lambda: more(stanford(), "joints", *stanford()["joints"][:1] * 11)),
    "17 links": ("16", lambda: more(stanford(), "chain", *[{**LINK, "multiple": "0"}] * 11)),
    "a large bound": ("larger", lambda: put(stanford(), 2, "families", 0, "least_codimension")),
    "an old schema": ("schema", lambda: stanford(schema="pinsing/certificate/2")),
    "a new schema": ("schema", lambda: stanford(schema="pinsing/certificate/4")),
    "a key twice": ("twice", lambda: '{"robot":"ur10",' + text_of(stanford())[1:]),
    "4 MB and 1": ("4000000", lambda: text_of(stanford()).ljust(4_000_001)),
}  # fmt: skip


@pytest.mark.parametrize("name", FORGED)
def test_one_condition_sees_it(name):
    """Without that condition the checker accepts it."""
    reason, forged = FORGED[name]
    data = forged()
    assert reason in verdict(data)
    need = checker.need
    with patch.object(checker, "need", lambda truth, why: need(truth or reason in why, why)):
        checker.verify(data if isinstance(data, str) else text_of(data))


def test_others_that_are_false_and_true():
    assert "no index" in verdict(never([6]))
    numbers = place_of([6, 7], of_resultants=[["1/2", 0, 1, 4]])
    every = beside(numbers, part([10]), small(["place", 4]), small(END))
    for data in (tilted(), every, with_family(stanford(), [3, 4])):
        assert verdict(data) == ""
