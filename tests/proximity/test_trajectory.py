"""Trajectories checked: what they meet, and the command."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from kernel import needs_kernel
from singular_sets import arm_of, closed
from tiers import tiered

import pinsing
from pinsing.errors import ConfigurationError, OptionError
from pinsing.measures import Array
from pinsing.proximity import trajectory
from pinsing.proximity.trajectory import check_trajectory, details, summary

CLEAR = np.array([0.1, -1.2, 1.3, -1.6, -1.4, 0.3])


def path(n: int, wrist: tuple[float, float]) -> tuple[Array, Array]:
    """A UR5 whose wrist goes from one angle to another while the rest moves a little."""
    s = np.linspace(0, 1, n)
    Q = CLEAR + 0.1 * np.sin(3 * s)[:, None] * np.ones(6)
    Q[:, 4] = wrist[0] + (wrist[1] - wrist[0]) * s
    return Q, 4.0 * s


def test_a_clear_path_is_proven_clear() -> None:
    Q, t = path(201, (-1.4, -0.4))
    form = closed("ur5")
    check = check_trajectory(arm_of("ur5"), Q, t, forms=form)
    assert not check.crossings
    assert check.trend == "toward"
    a, b = Q[:-1:10], Q[1::10]
    dense = (a + np.linspace(0, 1, 5)[:, None, None] * (b - a)).reshape(-1, 6)
    for approach in check.approaches:
        true = pinsing.clearance(form, dense, families=[approach.family], certify=True)
        assert approach.lower <= true.upper.min() + 1e-9
        assert approach.upper <= true.upper.min() + 1e-6
        assert approach.lower >= 0.5 * approach.upper
        here = pinsing.clearance(form, approach.q, families=[approach.family], certify=True)
        assert approach.upper == pytest.approx(float(here.upper), abs=1e-5)
    nearest = check.approaches[0]
    assert (nearest.family, nearest.upper) == ("F2", pytest.approx(0.4, abs=1e-9))
    assert nearest.t == pytest.approx(4.0)
    assert 0 < check.clearance <= 0.4
    assert "meets no singular configuration (proven between samples)" in summary(check)


@pytest.mark.slow
def test_pieces_of_any_size_say_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.linspace(0, 10, 901)
    Q = np.stack([np.sin((i + 1) * 0.6 * t + i) * 2 for i in range(6)], axis=1)
    arm, form = arm_of("ur5"), closed("ur5")
    whole = check_trajectory(arm, Q, t, forms=form)
    assert len(whole.crossings) > 5
    for size in (7, 100, 450):
        monkeypatch.setattr(trajectory, "_CHUNK", size)
        part = check_trajectory(arm, Q, t, forms=form)
        for a, b in zip(part.crossings, whole.crossings, strict=True):
            assert (a.family, a.kind, a.t) == (b.family, b.kind, pytest.approx(b.t, abs=1e-9))
        for a, b in zip(part.stretches, whole.stretches, strict=True):
            assert (a.t, a.t_end) == pytest.approx((b.t, b.t_end), abs=1e-3)
        for a, b in zip(part.too_fast, whole.too_fast, strict=True):
            assert (a.joint, a.t, a.t_end) == (b.joint, b.t, b.t_end)
        for a, b in zip(part.approaches, whole.approaches, strict=True):
            assert a.upper == pytest.approx(b.upper, abs=1e-6)
    assert len(whole.stretches) <= 1000


@pytest.mark.slow
@needs_kernel
def test_speeds_jumps_and_limits() -> None:
    arm = arm_of("ur5")
    limit = float(np.asarray(arm.model.velocityLimit)[0])
    Q = np.tile(CLEAR, (101, 1))
    t = np.linspace(0, 1, 101)
    Q[:, 0] += 0.5 * limit * t
    Q[50:61, 0] += np.linspace(0, 1, 11) * 1.0 * 0.1 * limit  # 1.5 times the limit for 0.1 s
    Q[61:, 0] += 0.1 * limit
    check = check_trajectory(arm, Q, t, forms=closed("ur5"))
    (fast,) = check.too_fast
    assert fast.joint == arm.joints[0]
    assert (fast.t, fast.t_end) == pytest.approx((0.5, 0.6))
    assert fast.worst == pytest.approx(1.5 * limit)
    assert not check.jumps
    assert not check_trajectory(arm, Q, 2 * t, forms=closed("ur5")).too_fast
    sharp = check_trajectory(arm, Q, t, forms=closed("ur5"), acceleration_limits=np.full(6, 5.0))
    assert {round(e.t, 2) for e in sharp.too_abrupt} == {0.5, 0.6}
    Q[70:, 5] -= 2 * np.pi
    Q[:, 1] -= 7.0
    wrong = check_trajectory(arm, Q, t, forms=closed("ur5"))
    assert [(j.joint, j.t) for j in wrong.jumps] == [(arm.joints[5], pytest.approx(0.69))]
    assert "wrapped by a turn?" in str(wrong)
    assert {e.joint for e in wrong.outside} == {arm.joints[1]}
    Q[70:, 5] += 2 * np.pi - 0.5
    assert "at t = 0.69 s: are samples missing" in str(check_trajectory(arm, Q, t))
    untimed = check_trajectory(arm, Q, forms=closed("ur5"))
    assert (untimed.timed, untimed.too_fast) == (False, ())
    assert any("no times" in note for note in untimed.notes)


def test_where_tip_speeds_cost_too_much() -> None:
    Q, t = path(201, (-1.0, 1.0))
    arm = arm_of("ur5")
    check = check_trajectory(arm, Q, t, forms=closed("ur5"), tip_speed=0.25, turn_speed=0.5)
    assert check.costly
    # By hand, at every sample: the rows of the inverse.
    inverse = np.linalg.pinv(pinsing.kinematics.task_jacobians(arm, Q))
    linear, angular = (np.linalg.norm(x, axis=2) for x in np.split(inverse, 2, axis=2))
    rows = 0.25 * linear + 0.5 * angular
    over = rows > np.asarray(arm.model.velocityLimit)
    for j, name in enumerate(arm.joints):
        own = [e for e in check.costly if e.joint == name]
        told = np.any([(t >= e.t) & (t <= e.t_end) for e in own] or [t < 0], axis=0)
        # On the singularity itself some velocity cannot be had at all.
        assert told[over[:, j]].all()
        assert not told[~over[:, j] & (np.abs(Q[:, 4]) > 1e-6)].any()


@pytest.mark.slow
@pytest.mark.parametrize("count", tiered([2, 4, 5], (4, 5)))
def test_tip_speeds_without_bound_are_told_at_each_meeting_whatever_the_samples(count: int) -> None:
    ends = np.radians([[0, -20, -20, 0, -40, 0], [20, 20, 90, 10, 40, 0]])
    s = np.linspace(0, 1, count)
    Q = ends[0] + s[:, None] * (ends[1] - ends[0])
    check = check_trajectory(pinsing.load("gp25"), Q, 3 * s)
    times = [c.t for c in check.crossings]
    assert [c.title for c in check.crossings] == ["wrist", "elbow"]
    for t, joints in zip(times, ({"q4", "q6"}, {"q2", "q3", "q4", "q5", "q6"}), strict=True):
        found = [e for e in check.costly if np.isinf(e.worst) and abs(e.t_worst - t) < 1e-9]
        assert sorted(e.joint for e in found) == sorted(joints)
    assert "q4: without bound at t = 1.5 s (wrist) (limit" in details(check)
    beside = check_trajectory(pinsing.load("gp25"), np.radians([[0, -20, -20, 0, 0.5, 0]]))
    assert {e.joint for e in beside.costly if np.isfinite(e.worst)} == {"q4", "q6"}


@pytest.mark.slow
def test_what_is_proven_is_close_to_what_is_found_also_of_a_long_recording() -> None:
    arm = pinsing.load("h2515")
    for count, turns in ((101, 0.0), (60_000, 0.05)):
        s = np.linspace(0, 2 if count == 101 else 60, count)[:, None]
        start = np.radians([10, -80, 90, -90, 40, 0])
        Q = start + np.radians([10, 5, 0, 2, 5, 15]) * s * (turns == 0)
        Q = Q + 0.5 * np.sin((turns + 0.05 * np.arange(6)) * s) * (turns > 0)
        check = check_trajectory(arm, Q)
        assert not check.crossings
        for near in check.approaches:
            assert near.upper - np.radians(0.11) <= near.lower <= near.upper, near.family


def test_bad_arrays() -> None:
    arm, form = arm_of("ur5"), closed("ur5")
    wide = replace(form, arm=replace(form.arm, upper=form.arm.upper + 1))
    for shape, t, options, error, said in (
        ((0, 6), None, {}, ConfigurationError, "no sample"),
        ((4, 7), None, {}, ConfigurationError, r"Q needs 6 values .*got 7"),
        ((2, 6), [1.0, 0.5], {}, OptionError, "ascend"),
        ((2, 6), None, {"forms": closed("puma560")}, OptionError, "joints of 'puma560'"),
        ((2, 6), None, {"forms": wide}, OptionError, "another arm: upper of"),
        ((2, 6), None, {"near": -1.0}, OptionError, "near"),
    ):
        with pytest.raises(error, match=said):
            check_trajectory(arm, np.zeros(shape), t, **{"forms": form, **options})


def test_the_first_line_says_the_worst_and_what_was_not_looked_at():
    arm = pinsing.load("h2515")
    Q = np.radians([[10, -80, 90, 0, -12, 0], [30, -70, 90, 5, 13, 30]])
    assert check_trajectory(arm, Q).text().startswith("h2515: crosses the wrist")
    said = check_trajectory(arm, Q, families=["elbow"]).text().splitlines()[0]
    assert said.startswith("h2515: meets no elbow (F1) (proven")
    assert said.endswith("wrist (F2) and shoulder (F3) not looked at")
    arm = arm_of("ur5")
    stay = [[pan, -1, 1, 0, w, 0] for pan, w in enumerate((0.5, 0, 0, -0.5))]
    said = " ".join(check_trajectory(arm, stay, np.arange(4.0)).text().split())
    assert "on the wrist singularity (wrist_2_joint = 0°) from 1 s to 2 s" in said
    Q, t = path(51, (-1.4, -0.4))
    away = np.array([7.0, 0, 0, 0, 0, 0])

    def first(Q: Array, t: Array | None, **options: object) -> str:
        return summary(check_trajectory(arm, Q, t, forms=closed("ur5"), **options)).split("\n")[0]

    assert first(Q, t) == "ur5: meets no singular configuration (proven between samples)"
    assert "but exceeds joint speed limits" in first(Q, t / 100)
    assert "but leaves joint limits" in first(Q + away, t)
    assert "but comes within 30° of one" in first(Q, t, near=np.radians(30))
    abrupt = first(Q, t, acceleration_limits=np.full(6, 1e-9))
    assert "but exceeds joint acceleration limits" in abrupt
    crossed, t = path(51, (-1.0, 1.0))
    both = first(crossed + away, t)
    assert both.startswith("ur5: crosses the wrist singularity")
    assert both.endswith("; also leaves joint limits")
    Q, t = path(51, (-1.4, -0.1))
    text = summary(check_trajectory(arm_of("ur5"), Q, t, forms=closed("ur5"), near=0.01))
    assert "Joint speeds and limits are kept" in text
    assert "worst directions" not in text


def test_the_command(tmp_path: Path) -> None:
    Q, t = path(51, (-1.4, -0.4))
    file = tmp_path / "path.npz"
    np.savez(file, q=Q, t=t)
    for code, words in ((0, ()), (0, ("--fail-within", "3deg")), (1, ("--fail-within", "30deg"))):
        done = run("check", "ur5", file, *words)
        assert done.exit_code == code
        assert done.stdout.startswith("path.npz: meets no singular configuration")
    done = run("check", "ur5", file, "-o", "-", "--near", "0.5rad", "--family", "F2")
    data = json.loads(done.stdout)
    assert data["schema"] == "pinsing/trajectory_check/1"
    assert [a["family"] for a in data["approaches"]] == ["F2"]
    assert len(data["stretches"]) == 1
    picture = tmp_path / "a.png"
    assert run("check", "ur5", file, "-o", picture).exit_code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    np.savez(file, q=np.degrees(Q), t=t)
    assert run("check", "ur5", file, "--deg", "--fail-within", "3deg").exit_code == 0
    assert "leaves joint limits" in " ".join(run("check", "ur5", file, "--rad").stdout.split())


def test_a_crossing_and_the_ends_of_the_stretch_about_it():
    check = check_trajectory(arm_of("ur5"), [[0, -1, 1, 0, 1, 0], [0, -1, 1, 0, -1, 0]])
    (met,), (stretch,), nearest = check.crossings, check.stretches, check.approaches[0]
    assert (met.family, met.kind, met.t) == ("F2", "crossing", pytest.approx(0.5, abs=1e-9))
    assert (nearest.family, nearest.lower, nearest.upper, check.clearance) == ("F2", 0, 0, 0)
    reach = check.near / 2
    assert 0.5 - reach - 1e-4 <= stretch.t <= 0.5 - reach
    assert 0.5 + reach <= stretch.t_end <= 0.5 + reach + 1e-4
    assert (stretch.family, stretch.clearance) == ("F2", 0.0)
    assert "F2" in details(check)
    text = summary(check)
    assert len(text.splitlines()) <= 6
    assert text.startswith("ur5: crosses the wrist singularity (wrist_2_joint = 0°) at ")
    assert "Closest approach elsewhere: elbow (F1), 57.3°" in text
    # Of several stretches the nearest is named.
    near = [[0, -1.2, 1.3, -1, wrist, 0] for wrist in (0.07, 1, 0.03)]
    text = summary(check_trajectory(arm_of("ur5"), near))
    assert "keep away from wrist (F2), from sample 1.94" in text


@pytest.mark.parametrize("step", tiered([0.1, 0.5, 1.5], {0.5}))
def test_stretches_of_random_walks(step):
    """Nothing that is near lies outside the stretches, and no clearance is larger than true."""
    arm, form = arm_of("puma560"), closed("puma560")
    rng = np.random.default_rng(3)
    for _ in range(6):
        Q = rng.uniform(-2, 2, 6) + np.cumsum(rng.normal(size=(12, 6)) * step / 2.5, axis=0)
        check = check_trajectory(arm, Q, forms=form)
        t = np.linspace(0, 11, 3000)
        fine = np.stack([np.interp(t, np.arange(12), q) for q in Q.T], axis=1)
        upper = pinsing.clearance(form, fine).upper
        inside = np.zeros(len(t), dtype=bool)
        for s in check.stretches:
            mine = (t >= s.t) & (t <= s.t_end)
            inside |= mine
            assert upper[mine].min(initial=np.inf) >= s.clearance - 1e-9
        assert (upper[~inside] >= check.near - 1e-9).all()
        for c in check.crossings:
            assert any(s.t <= c.t <= s.t_end and s.clearance == 0 for s in check.stretches)


@needs_kernel
def test_a_second_meeting_is_named_and_speeds_have_no_powers_of_ten():
    Q = np.linspace([0, -1, 0.5, -0.4, 0.7, 0], [0.2, -1, -0.9, -0.3, -0.2, 0.1], 40)
    check = check_trajectory(arm_of("ur5"), Q, np.linspace(0, 4, 40), forms=closed("ur5"))
    first = summary(check).splitlines()[0]
    assert len(check.crossings) == 2
    assert "crosses the elbow singularity (elbow_joint = 0°) at t = 1.4" in first
    assert re.search(r"; also wrist \(F2\) at t = 3\.1\d* s$", first)
    assert "without bound" in details(check)
    Q[0, 2] = 0.002
    close = check_trajectory(arm_of("ur5"), Q[:1], forms=closed("ur5"))
    assert re.search(r": \d+,\d{3} deg/s at", details(close))
    assert "e+0" not in details(check) + details(close)
