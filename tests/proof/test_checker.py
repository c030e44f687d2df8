"""False certificates are rejected, and by a second checker, written from docs/proof.md alone."""

import json

import pytest
from certificates import certificate, family_of, longer, more, mutants, put, verdict, without
from tiers import tiered

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


def test_steps_keep_the_rank(ur5):
    """Multiples of one line are taken from another one: any such step is true, few are of use."""
    assert verdict(put(ur5, [[0, 1, "2/3"]], "row_steps")) == ""
    # Rows are divided by units, each by itself: a sum of two that differ would be no form.
    data = certificate("planar3r vx,vy,wz")
    assert verdict(data) == ""
    rows = Certificate(data).matrix
    assert [Certificate(data).ring.degrees(row[0]) for row in rows[1:]] == [[2, 2, 2], [0, 0, 0]]
    for step in ([1, 2, "1"], [2, 1, "1"]):
        assert "different degrees" in verdict(put(data, [step], "row_steps"))
    assert verdict(put(data, [[0, 1, "1"]], "row_steps")) == ""


def test_a_pose_has_the_same_rank_in_all_axes(ur5):
    for axes in range(7):
        assert verdict(put(ur5, axes, "axes")) == ""


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
