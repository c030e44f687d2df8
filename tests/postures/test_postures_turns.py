"""Postures where limits are wider than a turn: every whole-turn copy counts."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from dh_arms import along, dh_arm

import pinsing
from pinsing.kinematics.jacobian import tip_placement
from pinsing.postures.aspects import map_of
from pinsing.postures.changes import PostureChange, whole_turns

# Its second posture is in another aspect as it is, and in this one a turn of joint 3 away.
START = [0.8605556614246863, -2.8929454751927572, -5.768296820021047]


def orthogonal(limits):
    first = (-90, 1, 0, 0, "revolute", (-180, 180))
    arm = dh_arm([first, (90, 2, 1), (0, 1.5, 0)], "position", limits)
    form = pinsing.closed_form(arm)
    return arm, form, pinsing.aspects(form)


@pytest.fixture(scope="module")
def wide():
    return orthogonal((-360, 360))


@pytest.fixture(scope="module")
def found(wide):
    arm, form, _ = wide
    return pinsing.posture_changes(arm, START, forms=form)


def copies_of(arm, q):
    """Every whole-turn copy within the limits, the plain way."""
    turns = 2 * np.pi * np.arange(-4, 5)
    each = zip(q, arm.lower, arm.upper, strict=True)
    kept = [[x + t for t in turns if low <= x + t <= high] for x, low, high in each]
    return np.array(list(product(*kept)))


def numbers(found, arm, q):
    return [found.of(copy) for copy in copies_of(arm, q)]


def test_a_posture_that_is_reached_a_turn_away(wide, found):
    arm = wide[0]
    first, *rest = found.others
    assert first.answer == "same"
    assert first.solution.q == pytest.approx([2.43303, -0.831081, 2.21324 - 2 * np.pi], abs=1e-4)
    way = first.connection
    assert np.array_equal(way.path[-1], first.solution.q)
    assert np.array_equal(way.path[0], START)
    assert ((arm.lower <= way.path) & (way.path <= arm.upper)).all()
    ends = [tip_placement(arm, q).translation for q in (START, first.solution.q)]
    assert np.abs(ends[1] - ends[0]).max() < 1e-9
    J = pinsing.kinematics.task_jacobians(arm, along(way.path))
    signs = np.sign(np.linalg.det(J))
    assert (signs == signs[0]).all()
    assert (first.copies, first.copies_in_aspect, first.copies_undecided) == (4, 2, 0)
    assert [other.answer for other in rest] == ["different"] * 2
    text = " ".join(found.text().split())
    assert "(4 whole-turn copies within the limits, 2 in the aspect of the start)" in text
    assert "The same holds with joints turned by whole turns: up to 4 per posture" in text
    assert "are 3 more copies of this configuration, not listed: 1 in its aspect, 2 in" in text


@pytest.mark.slow
def test_what_is_said_holds_of_each_copy(wide):
    arm, form, of = wide
    answers = set()
    for q in [START, *arm.space.sample(4, np.random.default_rng(4))]:
        found = pinsing.posture_changes(arm, q, forms=form)
        assert found.aspect == of.of(q)
        for other in found.others:
            there = numbers(of, arm, other.solution.q)
            assert None not in there
            assert (other.copies, other.copies_undecided) == (len(there), 0)
            assert other.copies_in_aspect == there.count(found.aspect)
            assert (other.answer == "different") == (found.aspect not in there)
            assert other.aspect == of.of(other.solution.q)
            answers.add(other.answer)
        own = numbers(of, arm, q)
        inside = own.count(found.aspect)
        (note,) = [n for n in found.notes if "of this configuration" in n]
        assert f"{len(own) - 1} more" in note
        assert f"{inside - 1} in its aspect, {len(own) - inside} in others" in note
    assert answers == {"same", "different"}


@pytest.mark.slow
def test_parts_of_joint_space_are_told_apart_one_by_one():
    """UR5 has up to 64 copies of a configuration in four parts of joint space."""
    arm = pinsing.load("ur5")
    form = pinsing.closed_form(arm)
    of = pinsing.aspects(form)
    start = np.array([0.1, -1.0, 1.2, 0.3, 0.9, 0.2])
    told = whole_turns(map_of(of, form), start, start)
    there = numbers(of, arm, start)
    assert told.total == len(there) == 32
    assert told.joined == there.count(of.of(start)) > 1
    assert told.apart == len(there) - told.joined > 1
    assert len(told.likely) == 8
    assert np.array_equal(told.likely[0], start)
    far = [np.linalg.norm(copy - start) for copy in told.likely]
    every = sorted(
        np.linalg.norm(copy - start)
        for copy, number in zip(copies_of(arm, start), there, strict=True)
        if number == of.of(start)
    )
    assert far == pytest.approx(every[:8])
    held = whole_turns(map_of(of, form), start, start, held=range(5))
    assert (held.total, held.joined, held.apart) == (2, 2, 0)


def test_what_was_not_looked_at_is_not_proven(wide, found, monkeypatch):
    arm, form, of = wide
    solution = found.others[1].solution
    q = solution.q
    chosen = map_of(of, form)
    known = whole_turns(chosen, q, np.array(START))
    assert (known.total, known.apart, known.likely) == (4, 4, ())
    with monkeypatch.context() as patch:
        patch.setattr("pinsing.postures.changes._LOOKED", 2)
        few = whole_turns(chosen, q, np.array(START))
        assert (few.total, few.apart, few.likely) == (4, 2, ())
        (first, *_) = pinsing.posture_changes(arm, START, forms=form).others
        assert (first.answer, first.copies, first.copies_in_aspect) == ("same", 4, 1)
    far = pinsing.connect(form, START, q, of=of)
    assert far.answer == "different"
    other = PostureChange(solution, 5, far, (), copies=4, copies_undecided=1)
    assert other.answer == "undecided"
    assert replace(other, copies_undecided=0).answer == "different"


def test_a_way_from_what_is_singular_is_not_looked_for():
    form = pinsing.closed_form(pinsing.load("scara"))
    at, fine = [0.1, 0.0, 0.1, 0.2], [0.1, 1.0, 0.1, 0.2]
    for a, b, head in (
        (at, fine, "the start is singular, on F1, and belongs to no aspect"),
        (fine, at, "the end is singular, on F1, and belongs to no aspect"),
        (at, at, "the start and the end are singular, on F1 and F1, and belong to no aspect"),
    ):
        way = pinsing.connect(form, a, b)
        assert (way.answer, way.text().splitlines()[0]) == ("undecided", head)
        assert "no path was found" not in way.text()
        assert way.singular == ("F1" * (a is at), "F1" * (b is at))
