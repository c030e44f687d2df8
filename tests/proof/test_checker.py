"""False certificates are rejected, and by a second checker, written from docs/proof.md alone.

Forged ones are each wrong in one thing, which one condition of the checker sees.
"""

from unittest.mock import patch

import pytest
from certificates import (
    certificate,
    family_of,
    longer,
    more,
    mutants,
    place_of,
    put,
    verdict,
    without,
)
from tiers import tiered

from pinsing.families.certificate import text_of
from pinsing.proof import checker
from pinsing.proof.checker import Certificate

ur5, surgical7 = (
    pytest.fixture(lambda name=name: certificate(name), name=name) for name in ("ur5", "surgical7")
)


def index(data, text):
    """Number of a polynomial, added if it is new."""
    if text not in data["polynomials"]:
        data["polynomials"].append(text)
    return data["polynomials"].index(text)


def test_a_pivot_is_zero_on_no_component(ur5, surgical7):
    """Of a family that is regular, pivots that are zero there show nothing."""
    every = family_of("all", [index(ur5, "1x1 1y1")], 1)
    pivots = [([*range(5)], [c for c in range(6) if c != k]) for k in range(6)]
    for pivot in (*pivots, ([*range(6)], [*range(6)]), ([0], []), ([0, 0], [0, 1]), ([7], [0])):
        assert verdict(more(ur5, "families", {**every, "pivot": list(pivot)}))
    for text in ("1x1 1y1", "0", "1x2 -1x2", "1x1x2 1y1x2"):
        assert verdict(more(ur5, "families", {**every, "apart": [index(ur5, text)]})), text
    # A form that is zero only elsewhere is no lie where the family is singular anyhow.
    apart = [index(ur5, "1x1 1y1")]
    assert verdict(put(ur5, apart, "families", 0, "apart")) == ""
    for k, family in enumerate(surgical7["families"]):
        assert verdict(put(surgical7, family["forms"][:1], "families", k, "apart")), k


def turned(*rows):
    """A rotation by the rows of its numbers, each a letter."""
    return [list(row) for row in rows]


WRONG = {
    ("places", 0, "of_minors", 0, 1): [
        [[*range(5), 6], [*range(6)]], [[*range(5), True], [*range(6)]], [[*range(6)]], None,
    ],
    ("chain", 1, "rotation"): [
        "10", ["100", "010", "001"],
        turned(["1", "0", "0"], ["0", "1", "0"], ["0", "0", "-1"]),
        turned("100", "010", "001", "000"), turned("100", "010"), turned("10", "01", "00"),
        turned("1000", "0100", "0010"), turned(["2", "0", "0"], ["0", "1/2", "0"], "001"),
        turned("110", "010", "001"), turned("000", "000", "000"),
        turned(["1x1", "0", "0"], "010", "001"), [[1, 0, 0], [0, 1, 0], [0, 0, 1]], None,
    ],
    ("chain", 1, "translation", 0): [
        "NaN", "1e400", "1/0", "0x10", "", "--1", "1//2", "1.5", "1x1", "9" * 5000, "1s2", "inf",
    ],
    ("chain", 1, "translation"): [["0", "0"], ["0"] * 4, None, ["0", "0", 0], "000"],
    ("chain", 1, "multiple"): [
        "7", "1/2", "1x1", "", 1, None, "99999999999", ["1"], True, " 1", "0_1",
    ],
    ("chain", 1, "joint"): [6, -1, "0", None, 0.0],
    ("tip", "translation"): ["000"],
    ("joints",): [[{"name": "q", "kind": "ball"}] * 6],
    ("joints", 0, "name"): [None],
    ("robot",): [1],
    ("axes",): ["0", -1, 99, 1.0],
    **{
        (f"{lines}_steps",): [
            *([step] for step in (
                [0, 0, "1"], [0, 6, "1"], [-1, 0, "1"], [0, 1, "1x1"], [0, 1], [0, 1, 1],
            )),
        ]
        for lines in ("row", "column")
    },
    ("square_roots",): [[1], [4], [5], [1, 3], [2, 2], [2, 4], [3, 2], [3, 3]],
    ("families", 0, "pivot"): [[[]]],
    ("families", 0, "least_codimension"): ["1", None, [], 10**30],
    ("families", 0, "multiples"): [[["10"]]],
    ("places", 0, "of_forms"): [["10"]],
    ("places", 0, "cases", 0): ["110", [[2], [], 1, "family", 2, 0]],
    **{("places", 0, "cases", 0, k): [v] for k, v in ((2, True), (3, 1), (4, "1"))},
    ("places", 0, "cases", 0, 1): ["1", [1]],
    ("rows", 1): [True],
    ("rows",): [
        [0, 1, 2], [3, 4, 5], [0], [*range(5, -1, -1)], [0, 0], [6], [-1], [True], [], None,
    ],
    ("polynomials", 0): [
        *("", " ", "x1", "1x1 1", "1x1^999y1", "1x1**2", "1x99", "1x1 ", "1x1 - 1y1", "1x1*1"),
        *("1é", "1x1^-1", "1x0", "1x1^0", "1/0x1", "1.0x1", "1z1", 1, None, [], "１x1", "1x1\n"),
        *("1/05x1", "1x1^01", "9" * 401 + "x1"),
    ],
}  # fmt: skip
"""By its place in a certificate: what may not stand there."""


@pytest.mark.parametrize(
    ("path", "value"),
    [pytest.param(p, v, id=f"{p[-1]} {v!r:.30}") for p, some in WRONG.items() for v in some],
)
def test_what_may_not_stand_there_is_rejected_by_both(ur5, path, value):
    data = put(ur5, value, *path)
    assert verdict(data)


def test_steps_keep_the_rank_and_axes_that_of_a_pose(ur5):
    """Multiples of one line are taken from another one: any such step is true, few are of use."""
    # Rows are divided by units, each by itself: a sum of two that differ would be no form.
    data = certificate("planar3r vx,vy,wz")
    rows = Certificate(data).matrix
    assert [Certificate(data).ring.degrees(row[0]) for row in rows[1:]] == [[2, 2, 2], [0, 0, 0]]
    for step in ([1, 2, "1"], [2, 1, "1"]):
        assert "different degrees" in verdict(put(data, [step], "row_steps"))
    true = [put(data, [[0, 1, "1"]], "row_steps"), put(ur5, [[0, 1, "2/3"]], "row_steps")]
    true += [put(ur5, axes, "axes") for axes in range(7)]
    assert [verdict(data) for data in true] == [""] * 9


MUTATED = {"planar3r vx,vy,wz": 1, "scara": 5, "planar3r position": 9, "stanford": 5, "ur5": 1}
MUTATED |= {"planar3r tip": 1, "surgical7": 9, "iiwa14": 9, "panda": 49}
"""Each so many of an arm's mutants."""


@pytest.mark.parametrize("name", tiered(MUTATED, [*MUTATED][:4]))
def test_nothing_may_change(name):
    """Both checkers say the same of each, and of few that it is as true: bounds that are less."""
    rejected = [bool(verdict(data)) for _, data in mutants(name, MUTATED[name])]
    assert len(rejected) > 50
    assert sum(rejected) > 0.85 * len(rejected)


def determinant(data):
    """The one minor of an arm with as many joints as rows."""
    read = Certificate(data)
    (minor,) = read.minors(read.rank, {})
    return read.ring.stripped(minor)[0]


@pytest.mark.parametrize("name", tiered(["ur5", "puma560", "stanford"], ("puma560",)))
def test_a_length_may_not_change(name):
    """Accepted if and only if the determinant stays what it was: then what it says is true."""
    accepted = []
    true = certificate(name)
    before = determinant(true)
    for where, data in longer(true):
        after = determinant(data)
        same = after.leading_coefficient() * before == before.leading_coefficient() * after
        assert bool(verdict(data)) != same, where
        accepted.append(same)
    assert 4 <= sum(accepted) <= len(accepted) - 4
    tip = true["tip"]["translation"][0] + " 1/50"
    assert verdict(put(true, tip, "tip", "translation", 0)) == ""  # no matter for the pose
    # Of several minors some lengths are in none.
    assert {bool(verdict(data)) for _, data in longer(certificate("scara"))} == {True, False}


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[]", "null", "1", "NaN", '{"schema": "pinsing/certificate/1"}',
        '{"schema": "pinsing/certificate/2"}', '{"schema": "pinsing/certificate/3"}',
        '{"schema": 1, "schema": 2}', "[" * 100_000, '{"a":' * 50_000, '{"rank": 1e5}',
        '{"rank": Infinity}', " " * 5_000_000,
    ],
)  # fmt: skip
def test_what_is_no_certificate_is_rejected(text):
    reason = verdict(text)
    assert reason
    assert "\n" not in reason
    assert len(reason) < 300
    if text.endswith(('/1"}', '/2"}')):  # an old format is named
        assert "pinsing/certificate/3" in reason
        assert "anew" in reason


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
