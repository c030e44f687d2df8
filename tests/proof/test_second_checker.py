"""A second checker, written from docs/proof.md alone, says what the first one says."""

import pytest
from certificates import certificate, mutants, verdict
from second_checker import second_verdict
from tiers import tiered

from pinsing.families.certificate import text_of

QUICK = ["ur5", "stanford", "scara", "planar3r position", "planar3r one row", "ur5 orientation"]
QUICK += ["ur5 tool axis", "planar3r tip"]
SMALL = ["scara", "planar3r position"]


@pytest.mark.parametrize(
    "name", tiered([*QUICK, "so101", "panda", "iiwa14", "surgical7", "xarm7"], QUICK)
)
def test_both_accept(name):
    assert second_verdict(text_of(certificate(name))) == ""


@pytest.mark.parametrize("name", tiered([*SMALL, "planar3r tip", "ur5", "stanford"], SMALL[:1]))
def test_both_reject(name):
    count = 0
    for what, data in mutants(name):
        first, second = verdict(data), second_verdict(text_of(data))
        assert bool(first) == bool(second), (what, first, second)
        count += bool(first)
    assert count >= 15


@pytest.mark.parametrize("name", tiered(["scara", "stanford"], ("scara",)))
def test_both_say_the_same_of_other_lengths(name):
    verdicts = set()
    for i in range(len(certificate(name)["chain"])):
        for axis in range(3):
            data = certificate(name)
            data["chain"][i]["translation"][axis] += " 1/50"
            first, second = verdict(data), second_verdict(text_of(data))
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
    ("a family without a name", lambda d: d["families"][0].pop("name")),
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
    assert verdict(data), what
    assert second_verdict(text_of(data)), what
