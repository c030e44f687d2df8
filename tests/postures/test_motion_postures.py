"""Changes of aspect on the way, and other postures for a straight line of the tip."""

import json

import numpy as np
import pytest
from command_line import run

import pinsing
from pinsing.errors import ConfigurationError
from pinsing.kinematics.jacobian import tip_placement
from pinsing.proximity.trajectory import summary
from pinsing.view.trajectory import trajectory_data


@pytest.fixture(scope="module")
def puma():
    arm = pinsing.load("puma560")
    return arm, pinsing.closed_form(arm)


@pytest.mark.slow
def test_changes_are_where_the_signs_of_det_change(puma):
    arm, form = puma
    found = pinsing.aspects(form)
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
            assert c.before == number
            assert c.t >= at
            assert c.before != c.after
            assert c.names_before != c.names_after or c.before is None
            at, number = c.t, c.after
        assert number == found.of(Q[-1])
        seen += len(changes)
    assert seen > 5


def test_a_motion_back_and_forth_and_one_that_stays(puma):
    _, form = puma
    a, b = [0, 0.3, 0.2, 0, 0.8, 0], [0, 0.3, 0.2, 0, -0.4, 0]
    there, back = pinsing.postures.aspect_changes(form, [a, b, a], [0, 1, 2])
    assert (there.before, there.after) == (back.after, back.before)
    assert there.t == pytest.approx(2 / 3)
    assert back.t == pytest.approx(4 / 3)
    assert (there.names_before[-1], there.names_after[-1]) == ("wrist no-flip", "wrist flip")
    assert pinsing.postures.aspect_changes(form, [a, [1, 0.3, 0.2, 0, 0.7, 0]]) == ()
    assert pinsing.postures.aspect_changes(form, [a]) == ()
    with pytest.raises(ConfigurationError, match="shape"):
        pinsing.postures.aspect_changes(form, a)


def test_check_says_it(tmp_path):
    path = tmp_path / "way.csv"
    path.write_text("0,0.3,0.2,0,0.8,0\n0,0.3,0.2,0,-0.4,0\n")
    done = run("check", "puma560", str(path))
    assert "changes of aspect (as `pinsing postures` numbers them):" in done.output
    assert "wrist no-flip" in done.output
    path.write_text("J1,J2,J3,J4,J5,J6\n0,0,0,0,-60,0\n0,20,10,20,40,0\n")
    said = " ".join(run("check", "gp25", str(path), "--deg").stdout.split())
    assert " --q 0,0,0,180,60,-180 " in said  # 160 degrees from the end, not 200
    path.write_text("0,0.3,0.2,0,0.8,0\n0,0.3,0.2,0,-0.4,0\n")
    done = run("check", "puma560", str(path), "-o", "-")
    (change,) = json.loads(done.stdout)["aspect_changes"]
    assert change["t"] == pytest.approx(2 / 3)


def test_pages_and_reports_give_the_advice_of_the_terminal(tmp_path, monkeypatch):
    path, page = tmp_path / "way.csv", tmp_path / "page.html"
    path.write_text("0.1,-1.2,1.3,-1.5,-1,0.2\n0.1,-1.2,1.3,-1.5,1,0.2\n")
    said = " ".join(run("check", "ur5", str(path)).stdout.split())
    assert (advice := "Start in this posture, from which some motion reaches the end") in said
    assert " of the samples" in said
    assert " of the time" not in said
    given = []
    monkeypatch.setattr("pinsing.cli.show._write", lambda *args: given.append(args[7]))
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
        ("five_bar", "--trajectory", path, "--trajectory is for arms"),
    ):
        assert said in run("report", robot, "-o", page, *words).stderr


# The elbow of this posture of UR5 is stretched on the way; those with the wrist turned get there.
START, GOAL = [-2.6, -1.65, 0.95, 0.52, -2.55, -0.42], [-0.22, -0.19, 0.8]


@pytest.mark.slow
def test_a_line_that_needs_another_posture():
    arm = pinsing.load("ur5")
    form = pinsing.closed_form(arm)
    assert pinsing.check_line(arm, START, GOAL, forms=form).outcome == "singular"
    others = pinsing.postures.line_postures(arm, START, GOAL, forms=form)
    assert [p.outcome for p in others] == ["reached"] * 4 + ["singular"] * 3
    best = others[0]
    line = pinsing.check_line(arm, best.q, GOAL, forms=form)
    assert line.outcome == "reached"
    assert np.abs(line.q[-1] - line.q_end).max() == 0
    upper = pinsing.clearance(form, line.q).upper
    assert 0 < best.clearance <= upper.min()
    assert len({p.names for p in others}) == 7


def leaves(arm, q):
    return bool(((q < arm.lower - 1e-9) | (q > arm.upper + 1e-9)).any())


@pytest.mark.slow
def test_the_same_posture_whole_turns_away_would_do():
    """The last joint turns past its end; UR5 can begin a turn before that."""
    arm = pinsing.load("ur5")
    form = pinsing.closed_form(arm)
    q0 = np.array([0.1, -1.0, 1.2, 0.3, 0.9, 2 * np.pi - 0.05])
    start = tip_placement(arm, q0).homogeneous
    goal = start.copy()
    turn = 0.4
    goal[:3, :3] = start[:3, :3] @ [
        [np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1],
    ]  # fmt: skip
    line = pinsing.check_line(arm, q0, goal, forms=form)
    assert leaves(arm, line.q)
    others = pinsing.postures.line_postures(arm, q0, goal, forms=form)
    (same,) = [p for p in others if np.abs(arm.space.wrap(p.q - q0)).max() < 1e-9]
    assert same.q - q0 == pytest.approx([0, 0, 0, 0, 0, -2 * np.pi])
    assert same.within_limits
    line = pinsing.check_line(arm, same.q, goal, forms=form)
    assert line.outcome == "reached"
    assert not leaves(arm, line.q)


def test_a_line_that_no_posture_follows_says_so():
    done = run("line", "scara", "--q=0,1,0,0", "--to=5,0,0.1")
    assert "None of 1 other posture of the start follows it to its end" in done.output
