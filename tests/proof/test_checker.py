"""False certificates are rejected, and by a second checker, written from docs/proof.md alone."""

import itertools
import json
import re

import pytest
from certificates import certificate, find, longer, more, mutants, place_of, put, verdict, without
from tiers import tiered

from pinsing.proof.checker import Certificate

ur5, panda, surgical7 = (
    pytest.fixture(lambda name=name: certificate(name), name=name)
    for name in ("ur5", "panda", "surgical7")
)


def index(data, text):
    """Number of a polynomial, added if it is new."""
    if text not in data["polynomials"]:
        data["polynomials"].append(text)
    return data["polynomials"].index(text)


def family_of(name, forms, least):
    shown = {"pivot": [[], []], "apart": [], "multiples": []}
    return {"name": name, "forms": forms, "least_codimension": least, **shown}


WHOLE = ["1", [[*range(6)], [*range(6)]], []]


@pytest.mark.slow
def test_what_is_true_stays_true(ur5, panda):
    assert (verdict(ur5), verdict(panda)) == ("", "")
    # One more family that is part of another one, and a split that is not needed, are no lies.
    ur5["families"].append({**ur5["families"][0], "name": "again"})
    assert verdict(ur5) == ""
    ur5["families"].append(family_of("nowhere", [index(ur5, "1x1"), index(ur5, "1y1")], 6))
    assert verdict(ur5) == ""


@pytest.mark.parametrize("text", ["0", "1x1 -1x1", "0x1", "1s2^2 -2"])
def test_a_form_that_is_zero_is_no_family_and_no_case(ur5, text):
    k = index(ur5, text)
    assert verdict(more(ur5, "families", family_of("all", [k], 0)))
    assert verdict({**ur5, "places": [place_of([], k, of_minors=[WHOLE])]})
    assert verdict({**ur5, "places": [place_of([], k, of_minors=[["0", *WHOLE[1:]]])]})


def test_sums_that_show_too_little(ur5):
    every, (own, other) = family_of("all", [], 0), (f["forms"] for f in ur5["families"][:2])
    assert "not shown to be singular" in verdict({**ur5, "families": [every]})
    for sums in ([[["1", 0]]], [[["1", -1]]], [[]], [[["1x1", 0]]], [["1", 0]], None, 3):
        assert verdict(put(ur5, {**every, "multiples": sums}, "families", 0))
    for forms, terms in (
        (own, [["1", 1]]),
        ([index(ur5, "1x1 1y1")], [["1", 0]]),
        ([*own, *other], [["1", 0], ["1", 1]]),  # smaller: cases lie in it no more
    ):
        changed = {**ur5["families"][0], "forms": forms, "multiples": [terms]}
        assert verdict(put(ur5, changed, "families", 0))
    so101 = certificate("so101")
    k, sums = next((k, f["multiples"]) for k, f in enumerate(so101["families"]) if f["multiples"])
    for less in ([], [terms[:1] for terms in sums]):
        assert "singular" in verdict(put(so101, less, "families", k, "multiples"))


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


def test_after_squares_points_are_followed(ur5):
    """What is too small for a component still has points: after squares it is no end."""
    x, y = index(ur5, "1x1"), index(ur5, "1x2")
    first = len(ur5["places"])
    small = place_of([x, y], x, of_forms=[["1", 0]])
    for weights, accepted in (([], True), (["1"], False)):
        case = [[x], weights, 1 if weights else 2, "place", first + 1]
        square = place_of([x, y], case, of_forms=[["1x1", 0]])
        reason = verdict(more(ur5, "places", square, small))
        assert bool(reason) != accepted, reason
        # What was real stays so, place by place.
        on = place_of([x, y], [[x], [], 1, "place", first + 2], of_forms=[["1", 0]])
        reason = verdict(more(ur5, "places", square, on, small))
        assert bool(reason) != accepted, reason
        # Free joints at values are for whole components alone.
        free = place_of([x, y], x, of_minors=[[*WHOLE[:2], [index(ur5, "1x6")]]])
        assert verdict(more(ur5, "places", square, free))


def test_squares_are_as_they_stand(panda):
    i, k = find(panda, lambda i, case: case[1])
    at = ("places", i, "cases", k)
    forms, _, _, *to = panda["places"][i]["cases"][k]
    # They vanish nowhere: whatever family stands there is no lie.
    assert to == ["nowhere", 0]
    assert verdict(put(panda, "family", *at, 3)) == ""
    assert verdict(put(panda, [], *at, 1))
    for n, form in enumerate(forms):
        less = without(panda, *at, 0, n)
        assert verdict(less)
        assert verdict(without(less, *at, 1, n))
        same = index(panda, panda["polynomials"][form])
        assert verdict(put(panda, same, *at, 0, n)) == ""
        assert verdict(put(panda, index(panda, "1x1 1y1"), *at, 0, n))
    for factor in ("-1", "0", "1s2", "1x1", "", "1/0", "0/5", "1.5", " 1", 1, None):
        assert verdict(put(panda, factor, *at, 1, 0)), factor


def turned(*rows):
    """A rotation by the rows of its numbers, each a letter."""
    return [list(row) for row in rows]


WRONG = {
    ("places", 0, "of_minors", 0, 1): [
        *([[*range(5), last], [*range(6)]] for last in (4, -1, 6, True)),
        [[1, 0, 2, 3, 4, 5], [*range(6)]], [[*range(5)], [*range(5)]], [[], []], [[*range(6)]],
        None,
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
    **{(*path, "more"): [1] for path in ((), ("chain", 0), ("families", 0), ("places", 0))},
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
    ("square_roots",): [[5]],
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


def test_other_sources_are_what_they_say(ur5):
    a, b, c = (index(ur5, t) for t in ("1x1 1y1", "1x2 1y2", "1x1x2 1y1y2"))
    odd = [([a, b], [0, 1, joint]) for joint in range(3)] + [([a, b], [0, 0, 0])]
    odd += [([a, c], of) for of in ([0, 1, 1], [0, 2, 0], [0, 1, -1], [0, 1, "0"])]
    for forms, resultant in odd:
        place = place_of(forms, of_resultants=[["1", *resultant]])
        assert verdict(more(ur5, "places", place)), resultant
    for source in (-1, 7, "0", None, [], {}, {"other": 1}, 0.0, True):
        place = place_of([a], a, of_forms=[["1", source]])
        assert verdict(more(ur5, "places", place)), source


def test_joints_that_are_bound_are_not_put_at_values(ur5):
    """The minor of a 6-joint arm is its determinant: at q3 = 0 it is zero, elsewhere it is not."""
    for text in ("1x3", "1y3", "1x2 1y2", "1x2x4 1y2y4"):
        free = [index(ur5, text)]
        assert verdict(put(ur5, free, "places", 0, "of_minors", 0, 2)), text


def test_steps_keep_the_rank(ur5):
    """Multiples of one line are taken from another one: any such step is true, few are of use."""
    assert verdict(put(ur5, [[0, 1, "2/3"]], "row_steps")) == ""
    planar = certificate("planar3r")
    steps = planar["row_steps"] + planar["column_steps"]
    assert len(Certificate(planar).matrix) == planar["rank"] == 3
    assert not steps or verdict(put(put(planar, [], "row_steps"), [], "column_steps"))
    # Rows are divided by units, each by itself: a sum of two that differ would be no form.
    data = certificate("planar3r vx,vy,wz")
    assert verdict(data) == ""
    rows = Certificate(data).matrix
    assert [Certificate(data).ring.degrees(row[0]) for row in rows[1:]] == [[2, 2, 2], [0, 0, 0]]
    for step in ([1, 2, "1"], [2, 1, "1"]):
        assert "different degrees" in verdict(put(data, [step], "row_steps"))
    assert verdict(put(data, [[0, 1, "1"]], "row_steps")) == ""


def test_axes_may_not_change_the_task(ur5):
    one_row = certificate("planar3r one row")
    assert one_row["axes"] == 0
    assert "axes" in verdict(put(one_row, 1, "axes"))
    position = certificate("planar3r position")
    for axes in range(4):
        assert Certificate(put(position, axes, "axes")).rank == 2
    for axes in range(7):
        assert verdict(put(ur5, axes, "axes")) == ""


def test_a_chain_has_all_of_its_joints_and_no_more(ur5):
    for key in ("chain", "joints"):
        assert verdict({**ur5, key: ur5[key] * 3})
    assert verdict({**ur5, "joints": ur5["joints"][:5]})


def test_evidence_of_another_arm_does_not_fit(ur5, panda):
    other = certificate("ur10")
    for key in ("polynomials", "families", "places", "chain"):
        assert verdict({**ur5, key: panda[key]}), key
    # The tree of cases is the same for both arms but for one constant.
    mine, others = ur5["places"][0], other["places"][0]
    assert others["of_minors"][0][0] != mine["of_minors"][0][0]
    assert verdict(put(ur5, {**others, "of_minors": mine["of_minors"]}, "places", 0)) == ""
    # Lengths are in the polynomials.
    for key in ("places", "polynomials", "chain"):
        assert verdict({**ur5, key: other[key]}), key


@pytest.mark.slow
def test_least_codimension_is_a_bound(ur5, panda):
    for data, real in ((ur5, 1), (panda, 2)):
        for k in range(len(data["families"])):
            assert verdict(put(data, real + 1, "families", k, "least_codimension"))
            assert verdict(put(data, real - 1, "families", k, "least_codimension")) == ""


def test_a_relation_of_a_joint_that_is_fixed_counts_not_twice(ur5):
    family = ur5["families"][0]
    (form,) = family["forms"]
    twice = re.sub("(?<![0-9^xy/])1(?=[xy])", "2", ur5["polynomials"][form])
    for forms in ([form], [form, form], [form, index(ur5, twice)]):
        changed = {**family, "forms": forms, "least_codimension": 2}
        assert "larger" in verdict(put(ur5, changed, "families", 0))


def test_every_key_counts(ur5):
    for path in (("tip", "rotation"), ("places", -1, "of_minors"), ("families", 0, "name")):
        assert verdict(without(ur5, *path)), path
    for key in ur5:
        assert verdict(without(ur5, key)), key
        for value in (None, {}, [], 0, "", "1", True, [[]], {"0": {"0": "0"}}):
            if json.dumps(value) == json.dumps(ur5[key]):
                continue
            if key in {"robot", "base", "tip_frame", "task"} and isinstance(value, str):
                continue  # a label
            if (key, value) == ("axes", 0):
                continue  # a pose has the same rank in all axes
            assert verdict({**ur5, key: value}), (key, value)


MUTATED = {"scara": 4, "planar3r position": 7, "stanford": 4, "ur5": 1, "planar3r tip": 1}
MUTATED |= {"surgical7": 9, "iiwa14": 9, "panda": 49}
"""Each so many of an arm's mutants."""


@pytest.mark.parametrize("name", tiered(MUTATED, [*MUTATED][:3]))
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


def test_what_claims_without_proof_is_rejected(ur5):
    one = [["1", *WHOLE[1:]]]
    cases = [
        [[], [], 1, "nowhere", 0], [[], [], 1, "family", 0], [[0], [], 1, "family", 0],
        [[0], [], 1, "family", -1], [[0], [], 1, "place", 0], [[0], [], 1, "nowhere", 0],
        [[0], ["1"], 1, "family", 0], [[0, 1], [], 1, "family", 0],
    ]  # fmt: skip
    places = [place_of([]), place_of([], of_forms=[["1", 0]])]
    places += [place_of([], case, of_minors=one) for case in cases]
    for text, lines in (("0", WHOLE[1]), ("1", WHOLE[1]), ("1", [[], []]), ("1", [[0, 0], [0, 1]])):
        places.append(place_of([], of_minors=[[text, lines, []]]))
    for place, families in itertools.product(places, ([], ur5["families"])):
        assert verdict({**ur5, "families": families, "places": [place]}), place
    assert verdict({**ur5, "places": []})


def test_cases_lead_forward_only(surgical7):
    i, k = find(surgical7, lambda i, case: i and case[3] == "place")
    for then in (0, i, -1, 10**9, True, "1", 1.0, None):
        assert verdict(put(surgical7, then, "places", i, "cases", k, 4)), then
    for to in ("", "Place", "polynomials", None, 0):
        assert verdict(put(surgical7, to, "places", i, "cases", k, 3)), to


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
