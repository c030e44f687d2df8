"""Other postures of a pose, every whole-turn copy among them; changes of aspect on the way.

And other postures for a straight line of the tip.
"""

import json
from dataclasses import replace
from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from command_line import run
from dh_arms import along, arm_of, aspects_of, dh_arm, form_of

import pinsing
from pinsing.errors import ConfigurationError
from pinsing.kinematics.jacobian import tip_placement
from pinsing.postures.aspects import map_of
from pinsing.postures.changes import PostureChange, whole_turns
from pinsing.proximity.trajectory import summary
from pinsing.view.trajectory import trajectory_data

# Its second posture is in another aspect as it is, and in this one a turn of joint 3 away.
START = [0.8605556614246863, -2.8929454751927572, -5.768296820021047]


@pytest.fixture(scope="module")
def wide():
    first = (-90, 1, 0, 0, "revolute", (-180, 180))
    arm = dh_arm([first, (90, 2, 1), (0, 1.5, 0)], "position", (-360, 360))
    form = pinsing.closed_form(arm)
    return arm, form, pinsing.aspects(form)


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
    arm, form, of = arm_of("ur5"), form_of("ur5"), aspects_of("ur5")
    start = np.array([0.1, -1.0, 1.2, 0.3, 0.9, 0.2])
    told = whole_turns(map_of(of, form), start, start)
    there = numbers(of, arm, start)
    assert told.total == len(there) == 32
    assert told.joined == there.count(of.of(start)) > 1
    assert told.apart == len(there) - told.joined > 1
    assert len(told.likely) == 8
    assert np.array_equal(told.likely[0], start)
    far = [np.linalg.norm(copy - start) for copy in told.likely]
    alike = copies_of(arm, start)[np.array(there) == of.of(start)]
    assert far == pytest.approx(sorted(np.linalg.norm(alike - start, axis=1))[:8])
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
    form = form_of("scara")
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


@pytest.mark.slow
def test_changes_are_where_the_signs_of_det_change():
    arm, form, found = arm_of("puma560"), form_of("puma560"), aspects_of("puma560")
    rng = np.random.default_rng(1)
    seen = 0
    for _ in range(6):
        Q = arm.space.sample(4, rng)
        changes = pinsing.postures.aspect_changes(form, Q, of=found)
        t = np.linspace(0, 3, 1201)
        fine = np.array([np.interp(t, range(4), Q[:, j]) for j in range(6)]).T
        sign = np.sign(np.linalg.det(pinsing.kinematics.task_jacobians(arm, fine)))
        flips = t[1:][sign[1:] != sign[:-1]]
        assert len(flips) <= len(changes)
        for at in flips:
            assert min(abs(c.t - at) for c in changes) < 3 / 1200 + 1e-6
        at, number = 0.0, found.of(Q[0])
        for c in changes:
            assert c.before == number != c.after
            assert c.t >= at
            assert c.names_before != c.names_after or c.before is None
            at, number = c.t, c.after
        assert number == found.of(Q[-1])
        seen += len(changes)
    assert seen > 5


def test_a_motion_back_and_forth_and_one_that_stays():
    form = form_of("puma560")
    a, b = [0, 0.3, 0.2, 0, 0.8, 0], [0, 0.3, 0.2, 0, -0.4, 0]
    there, back = pinsing.postures.aspect_changes(form, [a, b, a], [0, 1, 2])
    assert (there.before, there.after) == (back.after, back.before)
    assert (there.t, back.t) == pytest.approx((2 / 3, 4 / 3))
    assert (there.names_before[-1], there.names_after[-1]) == ("wrist no-flip", "wrist flip")
    assert pinsing.postures.aspect_changes(form, [a, [1, 0.3, 0.2, 0, 0.7, 0]]) == ()
    assert pinsing.postures.aspect_changes(form, [a]) == ()
    with pytest.raises(ConfigurationError, match="shape"):
        pinsing.postures.aspect_changes(form, a)


def test_check_says_it(tmp_path):
    path = tmp_path / "way.csv"
    path.write_text("0,0.3,0.2,0,0.8,0\n0,0.3,0.2,0,-0.4,0\n")
    done = run("check", "puma560", path)
    assert "changes of aspect (as `pinsing postures` numbers them):" in done.output
    assert "wrist no-flip" in done.output
    (change,) = json.loads(run("check", "puma560", path, "-o", "-").stdout)["aspect_changes"]
    assert change["t"] == pytest.approx(2 / 3)
    path.write_text("J1,J2,J3,J4,J5,J6\n0,0,0,0,-60,0\n0,20,10,20,40,0\n")
    said = " ".join(run("check", "gp25", str(path), "--deg").stdout.split())
    assert " --q 0,0,0,180,60,-180 " in said  # 160 degrees from the end, not 200


def test_pages_and_reports_give_the_advice_of_the_terminal(tmp_path, monkeypatch):
    path, page = tmp_path / "way.csv", tmp_path / "page.html"
    path.write_text("0.1,-1.2,1.3,-1.5,-1,0.2\n0.1,-1.2,1.3,-1.5,1,0.2\n")
    said = " ".join(run("check", "ur5", str(path)).stdout.split())
    assert (advice := "Start in this posture, from which some motion reaches the end") in said
    assert " of the samples" in said
    assert " of the time" not in said
    given = []
    write = "pinsing.cli.show._write"
    monkeypatch.setattr(write, lambda *_, **content: given.append(content["trajectory"]))
    told = run("report", "ur5", "-o", str(page), "--trajectory", str(path)).stdout
    assert told.startswith("way.csv: crosses the wrist singularity")
    assert advice in " ".join(told.splitlines()[:4])
    arm, way = pinsing.load("ur5"), given[0]
    assert advice in summary(way.check)
    assert advice in trajectory_data(arm, way.check, way.Q)["lines"][-1]
    typed = [str(path), "--rad", "--units=rad", "--columns=1,2,3,4,5,6"]
    done = run("report", "ur5", "-o", str(page), "--trajectory", *typed)
    assert f"check ur5 {' '.join(typed)}" in " ".join(done.stdout.split())
    assert "pinsing: note: columns: shoulder_pan_joint = '1'" in done.stderr
    for robot, *words, said in (
        ("ur5", "--columns", 1, "--units and --columns are of --trajectory"),
        ("five_bar", "--trajectory", path, "--trajectory does not go with --loops"),
    ):
        assert said in run("report", robot, "-o", page, *words).stderr


# The elbow of this posture of UR5 is stretched on the way; those with the wrist turned get there.
BEGIN, GOAL = [-2.6, -1.65, 0.95, 0.52, -2.55, -0.42], [-0.22, -0.19, 0.8]


@pytest.mark.slow
def test_a_line_that_needs_another_posture():
    arm, form = arm_of("ur5"), form_of("ur5")
    assert pinsing.check_line(arm, BEGIN, GOAL, forms=form).outcome == "singular"
    others = pinsing.postures.line_postures(arm, BEGIN, GOAL, forms=form)
    assert [p.outcome for p in others] == ["reached"] * 4 + ["singular"] * 3
    line = pinsing.check_line(arm, others[0].q, GOAL, forms=form)
    assert line.outcome == "reached"
    assert (line.q[-1] == line.q_end).all()
    assert 0 < others[0].clearance <= pinsing.clearance(form, line.q).upper.min()
    assert len({p.names for p in others}) == 7


@pytest.mark.slow
def test_the_same_posture_whole_turns_away_would_do():
    """The last joint turns past its end; UR5 can begin a turn before that."""
    arm, form = arm_of("ur5"), form_of("ur5")
    q0 = np.array([0.1, -1.0, 1.2, 0.3, 0.9, 2 * np.pi - 0.05])
    goal = tip_placement(arm, q0).homogeneous
    goal[:3, :3] = goal[:3, :3] @ pin.utils.rotate("z", 0.4)
    assert arm.space.outside(pinsing.check_line(arm, q0, goal, forms=form).q).any()
    others = pinsing.postures.line_postures(arm, q0, goal, forms=form)
    (same,) = [p for p in others if np.abs(arm.space.wrap(p.q - q0)).max() < 1e-9]
    assert same.q - q0 == pytest.approx([0, 0, 0, 0, 0, -2 * np.pi])
    assert same.within_limits
    line = pinsing.check_line(arm, same.q, goal, forms=form)
    assert line.outcome == "reached"
    assert not arm.space.outside(line.q).any()
