"""False certificates, made by somebody who has read the checker: each one is rejected."""

from __future__ import annotations

import copy
import json

import pytest

from pinsing import load
from pinsing.families import closed_form
from pinsing.proof.checker import Certificate, Rejected, verify
from pinsing.proof.produce import text_of


def made(name, **how):
    form = closed_form(load(name, **how), prove=True)
    assert form.word == "proven", form.proof.reason
    return form.certificate


@pytest.fixture(scope="module")
def ur5():
    return made("ur5")


@pytest.fixture(scope="module")
def panda():
    return made("panda")


def verdict(data):
    try:
        verify(text_of(data))
    except Rejected as reason:
        return str(reason)
    return ""


def changed(data, *changes):
    """A copy with (path, value) put in."""
    data = copy.deepcopy(data)
    for path, value in changes:
        at = data
        for key in path[:-1]:
            at = at[key]
        at[path[-1]] = value
    return data


def index(data, text):
    """Number of a polynomial, added if it is new."""
    if text not in data["polynomials"]:
        data["polynomials"].append(text)
    return data["polynomials"].index(text)


def squares_of(data):
    return next(i for i, p in enumerate(data["places"]) if "squares" in p)


WHOLE = {"minor": [[*range(6)], [*range(6)]]}


def test_what_is_true_stays_true(ur5, panda):
    assert verdict(ur5) == ""
    assert verdict(panda) == ""
    # One more family that is part of another one, and a split that is not needed, are no lies.
    data = copy.deepcopy(ur5)
    data["families"].append({**data["families"][0], "name": "again"})
    assert verdict(data) == ""
    empty = {"name": "nowhere", "sums": [], "least_codimension": 6}
    data["families"].append({**empty, "forms": [index(data, "1x1"), index(data, "1y1")]})
    assert verdict(data) == ""


@pytest.mark.parametrize("text", ["0", "1x1 -1x1", "0x1", "1s2^2 -2"])
def test_a_form_that_is_zero_is_no_family_and_no_case(ur5, text):
    data = copy.deepcopy(ur5)
    k = index(data, text)
    family = {"name": "all", "forms": [k], "sums": [], "least_codimension": 0}
    assert verdict({**data, "families": [*data["families"], family]})
    place = {"forms": [], "sum": [["1", WHOLE]], "cases": [[k, 1, None]]}
    assert verdict({**data, "places": [place]})
    place = {"forms": [], "sum": [["0", WHOLE]], "cases": [[k, 1, None]]}
    assert verdict({**data, "places": [place]})


def test_everything_is_no_family(ur5):
    family = {"name": "all", "forms": [], "sums": [], "least_codimension": 0}
    assert "not shown to be singular" in verdict({**ur5, "families": [family]})
    for sums in ([[["1", 0]]], [[["1", -1]]], [[]], [[["1x1", 0]]], [["1", 0]], None, 3):
        assert verdict(
            changed(ur5, (("families", 0, "forms"), []), (("families", 0, "sums"), sums))
        )


def test_sums_are_of_the_familys_own_forms(ur5):
    data = copy.deepcopy(ur5)
    family = data["families"][0]
    other = data["families"][1]["forms"]
    assert verdict(changed(data, (("families", 0), {**family, "sums": [[["1", 1]]]})))
    mixed = {**family, "forms": [index(data, "1x1 1y1")], "sums": [[["1", 0]]]}
    assert verdict(changed(data, (("families", 0), mixed)))
    both = {**family, "forms": [*family["forms"], *other], "sums": [[["1", 0], ["1", 1]]]}
    assert verdict(changed(data, (("families", 0), both)))  # smaller: places lie in it no more


def test_points_lead_to_points_only(panda):
    i = squares_of(panda)
    then = panda["places"][i]["then"]
    if then is not None:
        assert verdict(changed(panda, (("places", then, "points"), False)))
        assert verdict(changed(panda, (("places", then, "points"), 1)))
    for k, place in enumerate(panda["places"]):
        if "too_small" in place:
            assert verdict(changed(panda, (("places", k, "points"), True)))


@pytest.mark.parametrize(
    "factor", ["-1", "0", "1s2", "1x1", "", "1/0", "0/5", "1.5", " 1", 1, None]
)
def test_factors_of_squares_are_positive(panda, factor):
    i = squares_of(panda)
    data = copy.deepcopy(panda)
    data["places"][i]["squares"][0][0] = factor
    assert verdict(data)


def test_squares_may_not_change(panda):
    i = squares_of(panda)
    place = panda["places"][i]
    for k, (_, form) in enumerate(place["squares"]):
        less = [s for j, s in enumerate(place["squares"]) if j != k]
        assert verdict(changed(panda, (("places", i, "squares"), less)))
        data = copy.deepcopy(panda)
        data["places"][i]["squares"][k][1] = index(data, data["polynomials"][form])
        assert verdict(data) == ""
        data["places"][i]["squares"][k][1] = index(data, "1x1 1y1")
        assert verdict(data)
    for name in ("squares", "sum", "then"):
        data = copy.deepcopy(panda)
        del data["places"][i][name]
        assert verdict(data)


@pytest.mark.parametrize(
    "minor",
    [
        [[0, 1, 2, 3, 4, 4], [0, 1, 2, 3, 4, 5]],
        [[1, 0, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5]],
        [[0, 1, 2, 3, 4, -1], [0, 1, 2, 3, 4, 5]],
        [[0, 1, 2, 3, 4], [0, 1, 2, 3, 4]],
        [[0, 1, 2, 3, 4, 6], [0, 1, 2, 3, 4, 5]],
        [[0, 1, 2, 3, 4, True], [0, 1, 2, 3, 4, 5]],
        [[], []],
        [[0, 1, 2, 3, 4, 5]],
        None,
    ],
)
def test_minors_are_minors(ur5, minor):
    assert verdict(changed(ur5, (("places", 0, "sum", 0, 1, "minor"), minor)))


def test_other_sources_are_what_they_say(ur5):
    data = copy.deepcopy(ur5)
    a, b, c = (index(data, t) for t in ("1x1 1y1", "1x2 1y2", "1x1x2 1y1y2"))
    for forms, resultant in (
        ([a, b], [0, 1, 0]),
        ([a, b], [0, 1, 1]),
        ([a, b], [0, 1, 2]),
        ([a, b], [0, 0, 0]),
        ([a, c], [0, 1, 1]),
        ([a, c], [0, 2, 0]),
        ([a, c], [0, 1, -1]),
        ([a, c], [0, 1, "0"]),
    ):
        place = {"forms": forms, "sum": [["1", {"resultant": resultant}]], "cases": []}
        assert verdict({**data, "places": [*data["places"], place]}), resultant
    for source in (-1, 7, "0", None, [], {}, {"other": 1}, 0.0, True):
        place = {"forms": [a], "sum": [["1", source]], "cases": [[a, 1, None]]}
        assert verdict({**data, "places": [*data["places"], place]}), source


def test_joints_that_are_bound_are_not_put_at_values(ur5):
    """The minor of a 6-joint arm is its determinant: at q3 = 0 it is zero, elsewhere it is not."""
    data = copy.deepcopy(ur5)
    place = data["places"][0]
    for text in ("1x3", "1y3", "1x2 1y2", "1x2x4 1y2y4"):
        at = [index(data, text)]
        source = {**place["sum"][0][1], "at": at}
        assert verdict(changed(data, (("places", 0, "sum"), [["1", source]]))), text


def test_dependent_lines_are_dependent(ur5):
    for gone in ({"0": {}}, {"0": {"1": "1"}}, {"0": {"0": "1"}}, {"6": {}}, {"-1": {}}, [], None):
        assert verdict(changed(ur5, (("dependent_rows",), gone)))
        assert verdict(changed(ur5, (("dependent_columns",), gone)))
    planar = made("planar3r")
    rows = planar["dependent_rows"]
    assert rows
    for k in rows:
        assert verdict(changed(planar, (("dependent_rows", k), {k: "1"})))
        # With a row of zeros left in, Eagon and Northcott's bound is weaker; it still holds.
        less = {i: terms for i, terms in rows.items() if i != k}
        reason = verdict(changed(planar, (("dependent_rows",), less)))
        assert reason == "" or "place" in reason


def test_axes_may_not_change_the_task():
    one_row = made("planar3r", task="vx")
    assert one_row["axes"] == 0
    assert "axes" in verdict(changed(one_row, (("axes",), 1)))
    for axes in (-1, 99, "0", None, True, 1.0):
        assert verdict(changed(one_row, (("axes",), axes)))
    position = made("planar3r", task="position")
    for axes in range(4):
        assert Certificate(changed(position, (("axes",), axes))).rank == 2


def test_a_pose_is_the_same_in_any_axes(ur5):
    """Everything but the indices of minors of a square matrix is free of axes."""
    for axes in range(7):
        assert verdict(changed(ur5, (("axes",), axes))) == ""


@pytest.mark.parametrize(
    "rotation",
    [
        [["1", "0", "0"], ["0", "1", "0"], ["0", "0", "-1"]],
        [["1", "0", "0"], ["0", "1", "0"], ["0", "0", "1"], ["0", "0", "0"]],
        [["1", "0", "0"], ["0", "1", "0"]],
        [["1", "0"], ["0", "1"], ["0", "0"]],
        [["1", "0", "0", "0"], ["0", "1", "0", "0"], ["0", "0", "1", "0"]],
        [["2", "0", "0"], ["0", "1/2", "0"], ["0", "0", "1"]],
        [["1", "1", "0"], ["0", "1", "0"], ["0", "0", "1"]],
        [["0", "0", "0"], ["0", "0", "0"], ["0", "0", "0"]],
        [["1x1", "0", "0"], ["0", "1", "0"], ["0", "0", "1"]],
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        None,
    ],
)
def test_rotations_are_rotations(ur5, rotation):
    assert verdict(changed(ur5, (("chain", 1, "rotation"), rotation)))


def test_links_are_links(ur5):
    for key, values in {
        "translation": (["0", "0"], ["0"] * 4, None, ["0", "0", 0]),
        "multiple": ("7", "1/2", "1x1", "", 1, None, "99999999999"),
        "plus": (["1", "1"], ["1"], "1", ["1", "0", "0"], None),
        "joint": (6, -1, "0", None, 0.0),
    }.items():
        for value in values:
            assert verdict(changed(ur5, (("chain", 1, key), value))), (key, value)
    for chain in ([], None, ur5["chain"] * 3):
        assert verdict({**ur5, "chain": chain})
    for joints in ([], [{"name": "q", "kind": "ball"}] * 6, ur5["joints"] * 3, ur5["joints"][:5]):
        assert verdict({**ur5, "joints": joints})


def test_evidence_of_another_arm_does_not_fit(ur5, panda):
    other = made("ur10")
    for key in ("polynomials", "families", "places", "chain"):
        assert verdict({**ur5, key: panda[key]}), key
    # The tree of cases is the same for both arms, constants aside: it points to polynomials.
    assert verdict({**ur5, "places": other["places"]}) == ""
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


def test_tasks_are_not_others(ur5):
    for rows in (
        [0, 1, 2],
        [3, 4, 5],
        [0],
        [5, 4, 3, 2, 1, 0],
        [0, 0],
        [6],
        [-1],
        [True],
        [],
        None,
    ):
        assert verdict({**ur5, "rows": rows}), rows


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
