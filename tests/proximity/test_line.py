"""Straight lines of the tip: ends, against a quadratic; speeds, against differences."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from singular_sets import arm_of, closed

import pinsing
from pinsing.errors import ConfigurationError, OptionError
from pinsing.measures import Array
from pinsing.postures import line_postures
from pinsing.proximity.line import LineCheck, check_line
from pinsing.robot.arm import Arm


def tip(arm: Arm, q: Array) -> pin.SE3:
    """Placement of the tip at q (n,), by Pinocchio alone."""
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, arm.model_q(q))
    return pin.SE3(data.oMf[arm.tip_id])


def wrist(arm: Arm, q: Array) -> Array:
    """Origin of joint 6 of a UR5: |its x, y| is one length on the shoulder singularity."""
    data = arm.model.createData()
    pin.forwardKinematics(arm.model, data, q)
    return np.array(data.oMi[6].translation)


def random_line(arm: Arm, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    q = rng.uniform(-np.pi, np.pi, arm.n)
    u = rng.normal(size=3)
    u /= np.linalg.norm(u)
    return q, u, tip(arm, q).translation + 0.5 * u


def check_path(arm: Arm, line: LineCheck, q: Array, target: Array) -> None:
    """Every tracked configuration is on the line, none far from the one before."""
    start = tip(arm, q)
    u = (target - start.translation) / np.linalg.norm(target - start.translation)
    for s, x in zip(line.s, line.q, strict=True):
        here = tip(arm, x)
        np.testing.assert_allclose(here.translation, start.translation + s * u, atol=1e-9)
        np.testing.assert_allclose(here.rotation, start.rotation, atol=1e-9)
    assert np.abs(np.diff(line.q, axis=0)).max() < 0.3


@pytest.mark.slow
def test_lines_of_a_ur5_end_where_the_quadratic_says() -> None:
    arm, form = arm_of("ur5"), closed("ur5")
    on = form.families[2].points(20, np.random.default_rng(0))
    d = np.array([np.linalg.norm(wrist(arm, q)[:2]) for q in on])
    np.testing.assert_allclose(d, d[0], atol=1e-9)
    rng = np.random.default_rng(1)
    ends = {"reached": 0, "F1": 0, "F2": 0, "F3": 0, "": 0}
    for _ in range(25):
        q, u, target = random_line(arm, rng)
        line = check_line(arm, q, target, forms=form)
        check_path(arm, line, q, target)
        w = wrist(arm, q)
        a, b, c = u[0] ** 2 + u[1] ** 2, 2 * (w[0] * u[0] + w[1] * u[1]), w[0] ** 2 + w[1] ** 2
        D = b * b - 4 * a * (c - d[0] ** 2)
        roots = [(-b + side * np.sqrt(D)) / (2 * a) for side in (-1, 1)] if D >= 0 else []
        ahead = [r for r in roots if 1e-9 < r < line.s_end - 1e-9]
        assert not ahead  # no line passes through the shoulder's cylinder
        if line.outcome == "reached":
            assert line.s_end == pytest.approx(0.5, abs=1e-12)
            ends["reached"] += 1
            continue
        ends[line.family] += 1
        if line.family:
            assert line.located
            family = form.families[int(line.family[1:]) - 1]
            assert family.contains(line.q_end, 1e-9)
            assert line.crossings
        if line.family == "F3":
            assert min(abs(r - line.s_end) for r in roots) < 1e-9
    assert ends["F3"] >= 2
    assert ends["F1"] >= 2
    assert ends["reached"] >= 5
    assert ends[""] <= 1


@pytest.mark.slow
def test_speeds_along_a_line() -> None:
    arm, form = arm_of("ur5"), closed("ur5")
    rng = np.random.default_rng(2)
    limits = np.asarray(arm.model.velocityLimit)
    seen = 0
    for _ in range(12):
        q, _, target = random_line(arm, rng)
        line = check_line(arm, q, target, speed=0.25, forms=form)
        rate = np.abs(np.diff(line.q, axis=0)) / np.diff(line.s)[:, None] * 0.25
        middle = (line.s[1:] + line.s[:-1]) / 2
        for j in range(6):
            for s, v in zip(middle, rate[:, j], strict=True):
                inside = any(
                    o.joint == arm.joints[j] and o.s <= s <= o.s_end for o in line.too_fast
                )
                if abs(v - limits[j]) > 0.05 * limits[j]:
                    assert inside == (v > limits[j])
                    seen += inside
        if line.outcome == "singular":
            assert line.allowed_speed == 0.0
        else:
            slow = check_line(arm, q, target, speed=0.99 * line.allowed_speed, forms=form)
            assert not slow.too_fast
            fast = check_line(arm, q, target, speed=1.01 * line.allowed_speed, forms=form)
            assert fast.too_fast
            assert min(o.allowed for o in fast.too_fast) == pytest.approx(line.allowed_speed)
    assert seen > 10


def test_turning_on_the_way() -> None:
    arm, form = arm_of("ur5"), closed("ur5")
    q = np.array([0.1, -1.2, 1.3, -1.6, -1.4, 0.3])
    start = tip(arm, q)
    goal = pin.SE3(start.rotation @ pin.exp3(np.array([0.2, -0.3, 0.1])), start.translation + 0.05)
    for pose in (
        goal.homogeneous,
        np.concatenate([goal.translation, pin.rpy.matrixToRpy(goal.rotation)]),
    ):
        line = check_line(arm, q, pose, forms=form)
        assert line.outcome == "reached"
        np.testing.assert_allclose(tip(arm, line.q_end).homogeneous, goal.homogeneous, atol=1e-9)
        for s, x in zip(line.s, line.q, strict=True):
            share = s / line.length
            turned = start.rotation.T @ tip(arm, x).rotation
            np.testing.assert_allclose(
                pin.log3(turned), share * np.array([0.2, -0.3, 0.1]), atol=1e-9
            )
    only = check_line(arm, q, pin.SE3(goal.rotation, start.translation).homogeneous, forms=form)
    assert only.length == pytest.approx(np.linalg.norm([0.2, -0.3, 0.1]))
    again = pinsing.proximity.LineCheck.from_json(only.to_json())
    np.testing.assert_array_equal(again.q, only.q)


def test_a_planar_arm_stretches_to_its_end() -> None:
    arm = arm_of("planar3r").with_task("position")
    q = np.array([0.3, 0.8, 0.5])
    start = tip(arm, q).translation
    far = start / np.linalg.norm(start) * 10
    line = check_line(arm, q, far)
    assert line.outcome == "singular"
    longest = np.linalg.norm(tip(arm, np.zeros(3)).translation)
    assert np.linalg.norm(start) + line.s_end == pytest.approx(longest, abs=1e-9)


def test_other_bad_input() -> None:
    arm, form = arm_of("ur5"), closed("ur5")
    q = np.array([0.1, -1.2, 1.3, -1.6, -1.4, 0.3])
    with pytest.raises(ConfigurationError, match="no length"):
        check_line(arm, q, tip(arm, q).translation, forms=form)
    with pytest.raises(ConfigurationError, match=r"millimetres: give metres, as 0\.4,0,0\.3$"):
        check_line(arm, q, [400, 0, 300], forms=form)
    for speed in (-1.0, np.inf):
        with pytest.raises(OptionError, match="speed"):
            check_line(arm, q, [0.1, 0.2, 0.3], speed, forms=form)
    # From a singular configuration it is not determined where the joints go.
    for pose in ([5.0, 0.0, 0.0], [0.3, 0.2, 0.4]):
        with pytest.raises(
            ConfigurationError, match=r"starts at a singular configuration \(on F1, F2"
        ):
            check_line(arm, np.zeros(6), pose, forms=form)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "q", "to"),
    [
        ("rs007n", [54.1, -70.6, 122.6, 16.2, 45.2, 117.7], [-0.263, -0.259, -0.168]),
        pytest.param(
            *("xarm6", [124.8, -52.1, -6.7, 74, -76.1, -143.2], [-0.07, -0.067, 0.286]),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_closest_approach_of_a_line_is_that_of_dense_samples(name, q, to) -> None:
    # Found by a stranger: it was told where a loose lower bound is least.
    arm = pinsing.load(name)
    form = pinsing.closed_form(arm, prove=False)
    line = check_line(arm, np.radians(q), to, forms=form)
    for near in line.approaches:
        every = pinsing.clearance(
            form, line.q, families=[near.family], certify=True, boxes=5000
        ).upper
        assert near.upper <= every.min() + 1e-4


@pytest.mark.slow
def test_a_start_that_meets_a_singularity_is_not_suggested_and_all_that_is_met_is_named() -> None:
    arm, target = pinsing.load("gp25"), [0.9, 0.0, 1.2]
    q = np.radians([0, -40, 60, 0, 40, 0])
    postures = line_postures(arm, q, target)
    inside = [p for p in postures if p.outcome == "reached" and p.within_limits]
    line = replace(check_line(arm, q, target), postures=postures)
    assert [p.clearance for p in inside] == [0, 0]
    text = " ".join(line.text().split())
    assert "another posture" not in text
    assert "None of 7 other postures" in text
    again = check_line(arm, inside[0].q, target)
    assert {c.family for c in again.crossings} == {"F2", "F3"}
    head = again.text().split("\n\n")[0]
    assert all(f"the {c.title} singularity" in head for c in again.crossings)
    clear = replace(line, postures=(replace(inside[0], clearance=0.1),)).text()
    assert "it reaches its end clear of singularities: pinsing line gp25" in clear
