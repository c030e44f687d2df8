"""False certificates, made by somebody who has read the checker: each one is rejected."""

import copy
import json

import pytest
from certificates import certificate, verdict

from pinsing.proof.checker import Certificate


def changed(data, *changes):
    """A copy with (path, value) put in."""
    data = copy.deepcopy(data)
    for path, value in changes:
        at = data
        for key in path[:-1]:
            at = at[key]
        at[path[-1]] = value
    return data


ur5, panda, surgical7 = (
    pytest.fixture(lambda name=name: certificate(name), name=name)
    for name in ("ur5", "panda", "surgical7")
)


def index(data, text):
    """Number of a polynomial, added if it is new."""
    if text not in data["polynomials"]:
        data["polynomials"].append(text)
    return data["polynomials"].index(text)


def squares_of(data):
    """Place and case of a sum of squares."""
    return next(
        (i, k)
        for i, place in enumerate(data["places"])
        for k, case in enumerate(place["cases"])
        if case[1]
    )


def place_of(forms, *cases, of_forms=(), of_minors=(), of_resultants=()):
    """One place; a case is its one form's number, or a case as it stands."""
    return {
        "forms": forms,
        "of_forms": list(of_forms),
        "of_minors": list(of_minors),
        "of_resultants": list(of_resultants),
        "cases": [[[c], [], 1, "nowhere", 0] if type(c) is int else c for c in cases],
    }


def family_of(name, forms, least, pivot=([], []), apart=(), multiples=()):
    return {
        "name": name,
        "forms": forms,
        "least_codimension": least,
        "pivot": list(pivot),
        "apart": list(apart),
        "multiples": list(multiples),
    }


WHOLE = ["1", [[*range(6)], [*range(6)]], []]


@pytest.mark.slow
def test_what_is_true_stays_true(ur5, panda):
    assert (verdict(ur5), verdict(panda)) == ("", "")
    # One more family that is part of another one, and a split that is not needed, are no lies.
    data = copy.deepcopy(ur5)
    data["families"].append({**data["families"][0], "name": "again"})
    assert verdict(data) == ""
    data["families"].append(family_of("nowhere", [index(data, "1x1"), index(data, "1y1")], 6))
    assert verdict(data) == ""


@pytest.mark.parametrize("text", ["0", "1x1 -1x1", "0x1", "1s2^2 -2"])
def test_a_form_that_is_zero_is_no_family_and_no_case(ur5, text):
    data = copy.deepcopy(ur5)
    k = index(data, text)
    assert verdict({**data, "families": [*data["families"], family_of("all", [k], 0)]})
    assert verdict({**data, "places": [place_of([], k, of_minors=[WHOLE])]})
    assert verdict({**data, "places": [place_of([], k, of_minors=[["0", *WHOLE[1:]]])]})


def test_sums_that_show_too_little(ur5):
    family = family_of("all", [], 0)
    assert "not shown to be singular" in verdict({**ur5, "families": [family]})
    for sums in ([[["1", 0]]], [[["1", -1]]], [[]], [[["1x1", 0]]], [["1", 0]], None, 3):
        wrong = {**family, "multiples": sums}
        assert verdict(changed(ur5, (("families", 0), wrong)))
    data = copy.deepcopy(ur5)
    family = data["families"][0]
    other = data["families"][1]["forms"]
    assert verdict(changed(data, (("families", 0), {**family, "multiples": [[["1", 1]]]})))
    mixed = {**family, "forms": [index(data, "1x1 1y1")], "multiples": [[["1", 0]]]}
    assert verdict(changed(data, (("families", 0), mixed)))
    both = {**family, "forms": [*family["forms"], *other], "multiples": [[["1", 0], ["1", 1]]]}
    assert verdict(changed(data, (("families", 0), both)))  # smaller: cases lie in it no more
    data = certificate("so101")
    k = next(k for k, family in enumerate(data["families"]) if family["multiples"])
    family = data["families"][k]
    assert "singular" in verdict(changed(data, (("families", k, "multiples"), [])))
    less = [terms[:1] for terms in family["multiples"]]
    assert "singular" in verdict(changed(data, (("families", k, "multiples"), less)))


def test_a_pivot_is_zero_on_no_component(ur5, surgical7):
    """Of a family that is regular, pivots that are zero there show nothing."""
    data = copy.deepcopy(ur5)
    rows = [*range(5)]
    every = family_of("all", [index(data, "1x1 1y1")], 1)
    pivots = [(rows, [c for c in range(6) if c != k]) for k in range(6)]
    for pivot in (*pivots, ([*range(6)], [*range(6)]), ([0], []), ([0, 0], [0, 1]), ([7], [0])):
        assert verdict({**data, "families": [*data["families"], {**every, "pivot": list(pivot)}]})
    for text in ("1x1 1y1", "0", "1x2 -1x2", "1x1x2 1y1x2"):
        wrong = {**every, "apart": [index(data, text)]}
        assert verdict({**data, "families": [*data["families"], wrong]}), text
    # A form that is zero only elsewhere is no lie where the family is singular anyhow.
    family = data["families"][0]
    apart = {**family, "apart": [index(data, "1x1 1y1")]}
    assert verdict(changed(data, (("families", 0), apart))) == ""
    for k, family in enumerate(surgical7["families"]):
        wrong = {**family, "apart": [family["forms"][0]]}
        assert verdict(changed(surgical7, (("families", k), wrong))), k


def test_after_squares_points_are_followed(ur5):
    """What is too small for a component still has points: after squares it is no end."""
    data = copy.deepcopy(ur5)
    x, y = index(data, "1x1"), index(data, "1x2")
    places = data["places"]
    first = len(places)
    small = place_of([x, y], x, of_forms=[["1", 0]])
    for weights, accepted in (([], True), (["1"], False)):
        case = [[x], weights, 1 if weights else 2, "place", first + 1]
        square = place_of([x, y], case, of_forms=[["1x1", 0]])
        reason = verdict({**data, "places": [*places, square, small]})
        assert bool(reason) != accepted, reason
        # What was real stays so, place by place.
        on = place_of([x, y], [[x], [], 1, "place", first + 2], of_forms=[["1", 0]])
        reason = verdict({**data, "places": [*places, square, on, small]})
        assert bool(reason) != accepted, reason
        # Free joints at values are for whole components alone.
        free = place_of([x, y], x, of_minors=[[*WHOLE[:2], [index(data, "1x6")]]])
        assert verdict({**data, "places": [*places, square, free]})


def test_squares_lead_where_they_vanish(panda):
    i, k = squares_of(panda)
    leads = panda["places"][i]["cases"][k][3:]
    # They vanish nowhere: whatever family stands there is no lie.
    assert leads == ["nowhere", 0]
    assert verdict(changed(panda, (("places", i, "cases", k, 3), "family"))) == ""
    for n in range(len(panda["places"][i]["cases"][k][0])):
        data = copy.deepcopy(panda)
        for part in data["places"][i]["cases"][k][:2]:
            part.pop(n)
        assert verdict(data), n


@pytest.mark.parametrize(
    "factor", ["-1", "0", "1s2", "1x1", "", "1/0", "0/5", "1.5", " 1", 1, None]
)
def test_factors_of_squares_are_positive(panda, factor):
    i, k = squares_of(panda)
    data = copy.deepcopy(panda)
    data["places"][i]["cases"][k][1][0] = factor
    assert verdict(data)


def test_squares_may_not_change(panda):
    i, k = squares_of(panda)
    zeros, weights, *_ = panda["places"][i]["cases"][k]
    at = ("places", i, "cases", k)
    for n, form in enumerate(zeros):
        less = [[x for j, x in enumerate(part) if j != n] for part in (zeros, weights)]
        assert verdict(changed(panda, ((*at, 0), less[0]), ((*at, 1), less[1])))
        assert verdict(changed(panda, ((*at, 0), less[0])))
        data = copy.deepcopy(panda)
        data["places"][i]["cases"][k][0][n] = index(data, data["polynomials"][form])
        assert verdict(data) == ""
        data["places"][i]["cases"][k][0][n] = index(data, "1x1 1y1")
        assert verdict(data)
    assert verdict(changed(panda, ((*at, 1), [])))


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
        turned(["1", "0", "0"], ["0", "1", "0"], ["0", "0", "-1"]),
        turned("100", "010", "001", "000"), turned("100", "010"), turned("10", "01", "00"),
        turned("1000", "0100", "0010"), turned(["2", "0", "0"], ["0", "1/2", "0"], "001"),
        turned("110", "010", "001"), turned("000", "000", "000"),
        turned(["1x1", "0", "0"], "010", "001"), [[1, 0, 0], [0, 1, 0], [0, 0, 1]], None,
    ],
    ("chain", 1, "translation", 0): [
        "NaN", "1e400", "1/0", "0x10", "", "--1", "1//2", "1.5", "1x1", "9" * 5000, "1s2", "inf",
    ],
    ("chain", 1, "translation"): [["0", "0"], ["0"] * 4, None, ["0", "0", 0]],
    ("chain", 1, "multiple"): ["7", "1/2", "1x1", "", 1, None, "99999999999"],
    ("chain", 1, "joint"): [6, -1, "0", None, 0.0],
    ("chain",): [[], None],
    ("joints",): [[], [{"name": "q", "kind": "ball"}] * 6],
    ("rows",): [
        [0, 1, 2], [3, 4, 5], [0], [*range(5, -1, -1)], [0, 0], [6], [-1], [True], [], None,
    ],
    ("polynomials", 0): [
        *("", " ", "x1", "1x1 1", "1x1^999y1", "1x1**2", "1x99", "1x1 ", "1x1 - 1y1", "1x1*1"),
        *("1é", "1x1^-1", "1x0", "1x1^0", "1/0x1", "1.0x1", "1z1", 1, None, [], "１x1", "1x1\n"),
    ],
}  # fmt: skip
"""By its place in a certificate: what may not stand there."""


@pytest.mark.parametrize(
    ("path", "value"),
    [pytest.param(p, v, id=f"{p[-1]} {v!r:.30}") for p, some in WRONG.items() for v in some],
)
def test_what_may_not_stand_there_is_rejected(ur5, path, value):
    assert verdict(changed(ur5, (path, value)))


def test_other_sources_are_what_they_say(ur5):
    data = copy.deepcopy(ur5)
    a, b, c = (index(data, t) for t in ("1x1 1y1", "1x2 1y2", "1x1x2 1y1y2"))
    odd = [([a, b], [0, 1, joint]) for joint in range(3)] + [([a, b], [0, 0, 0])]
    odd += [([a, c], of) for of in ([0, 1, 1], [0, 2, 0], [0, 1, -1], [0, 1, "0"])]
    for forms, resultant in odd:
        place = place_of(forms, of_resultants=[["1", *resultant]])
        assert verdict({**data, "places": [*data["places"], place]}), resultant
    for source in (-1, 7, "0", None, [], {}, {"other": 1}, 0.0, True):
        place = place_of([a], a, of_forms=[["1", source]])
        assert verdict({**data, "places": [*data["places"], place]}), source


def test_joints_that_are_bound_are_not_put_at_values(ur5):
    """The minor of a 6-joint arm is its determinant: at q3 = 0 it is zero, elsewhere it is not."""
    data = copy.deepcopy(ur5)
    place = data["places"][0]
    for text in ("1x3", "1y3", "1x2 1y2", "1x2x4 1y2y4"):
        minor = [*place["of_minors"][0][:2], [index(data, text)]]
        assert verdict(changed(data, (("places", 0, "of_minors"), [minor]))), text


def test_steps_keep_the_rank(ur5):
    """Multiples of one line are taken from another one: any such step is true, few are of use."""
    bad = ([0, 0, "1"], [0, 6, "1"], [-1, 0, "1"], [0, 1, "1x1"], [0, 1], [0, 1, 1])
    for steps in (*([step] for step in bad), {"0": {"1": "1"}}, None):
        assert verdict(changed(ur5, (("row_steps",), steps)))
        assert verdict(changed(ur5, (("column_steps",), steps)))
    assert verdict(changed(ur5, (("row_steps",), [[0, 1, "2/3"]]))) == ""
    planar = certificate("planar3r")
    steps = planar["row_steps"] + planar["column_steps"]
    assert len(Certificate(planar).matrix) == planar["rank"] == 3
    assert not steps or verdict(changed(planar, (("row_steps",), []), (("column_steps",), [])))


def test_steps_take_lines_of_the_same_degrees_alone():
    """Rows are divided by units, each by itself: a sum of two that differ would be no form."""
    data = certificate("planar3r vx,vy,wz")
    assert verdict(data) == ""
    rows = Certificate(data).matrix
    assert [Certificate(data).ring.degrees(row[0]) for row in rows[1:]] == [[2, 2, 2], [0, 0, 0]]
    for step in ([1, 2, "1"], [2, 1, "1"]):
        assert "different degrees" in verdict(changed(data, (("row_steps",), [step])))
    assert verdict(changed(data, (("row_steps",), [[0, 1, "1"]]))) == ""


def test_axes_may_not_change_the_task(ur5):
    one_row = certificate("planar3r one row")
    assert one_row["axes"] == 0
    assert "axes" in verdict(changed(one_row, (("axes",), 1)))
    for axes in (-1, 99, "0", None, True, 1.0):
        assert verdict(changed(one_row, (("axes",), axes)))
    position = certificate("planar3r position")
    for axes in range(4):
        assert Certificate(changed(position, (("axes",), axes))).rank == 2
    for axes in range(7):
        assert verdict(changed(ur5, (("axes",), axes))) == ""


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
    assert verdict({**ur5, "places": other["places"]})
    assert verdict(changed(ur5, (("places", 0), {**others, "of_minors": mine["of_minors"]}))) == ""
    assert verdict({**ur5, "polynomials": other["polynomials"]})
    # The whole evidence with the other arm's chain: lengths are in its polynomials.
    assert verdict({**ur5, "chain": other["chain"]})


@pytest.mark.slow
def test_least_codimension_is_a_bound(ur5, panda):
    for data, real in ((ur5, 1), (panda, 2)):
        for k in range(len(data["families"])):
            assert verdict(changed(data, (("families", k, "least_codimension"), real + 1)))
            assert verdict(changed(data, (("families", k, "least_codimension"), real - 1))) == ""
            for odd in ("1", None, [], 10**30):
                assert verdict(changed(data, (("families", k, "least_codimension"), odd)))


def test_every_key_counts(ur5):
    for key in ur5:
        data = {k: v for k, v in ur5.items() if k != key}
        assert verdict(data), key
        for value in (None, {}, [], 0, "", "1", True, [[]], {"0": {"0": "0"}}):
            if json.dumps(value) == json.dumps(ur5[key]):
                continue
            if key in {"robot", "base", "tip_frame", "task"} and isinstance(value, str):
                continue  # a label
            if (key, value) == ("axes", 0):
                continue  # a pose has the same rank in all axes
            assert verdict({**ur5, key: value}), (key, value)
