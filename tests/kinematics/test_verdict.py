"""One verdict: all that judge a configuration give the same answer to the same question."""

import arms
import matplotlib as mpl
import numpy as np
import pinocchio as pin
import pytest
from tiers import sampled, tiered

mpl.use("Agg")

from pinsing import at
from pinsing.kinematics import generic_rank
from pinsing.kinematics.jacobian import (
    fixed_batch,
    measure,
    measured,
    own_scale,
    own_shares,
    ratios,
)
from pinsing.kinematics.refine import describe
from pinsing.measures import status_of
from pinsing.robot.arm import Arm
from pinsing.robot.load import load
from pinsing.sampling import plan_map, sigma_map, sweep
from pinsing.sampling.analyze import singular_configurations

TASKS = ("pose", "position", "orientation", "vx", "vx,wz", "vz,wx")
SCALES = (1e-10, 1.0, 3e8)


def scaled(arm: Arm, factor: float) -> Arm:
    """The same arm in another unit of length: joint 1 of 0.3 m is then 0.3 * factor long."""
    model = pin.Model(arm.model)
    for i in range(1, model.njoints):
        model.jointPlacements[i].translation *= factor
    for frame in model.frames:
        frame.placement.translation *= factor
    for i, slides in enumerate(arm.prismatic):
        if slides:
            model.lowerPositionLimit[i] *= factor
            model.upperPositionLimit[i] *= factor
    return load(model, tip=arm.tip, task=arm.task.name)


def questions(arm: Arm) -> np.ndarray:
    """Configurations to ask about: of special and other values, and some at random."""
    rng = np.random.default_rng(5)
    Q = rng.choice([0.0, 0.4, np.pi / 2], (20, arm.n))
    low, high = arm.span
    Q[:, arm.prismatic] = (low + rng.choice([0.5, 0.7], (20, 1)) * (high - low))[:, arm.prismatic]
    return np.concatenate([Q, rng.uniform(low, high, (5, arm.n))])


CASES = [
    ("planar3r", "position", 1), ("planar3r", "vx", 1), ("planar3r", "vx,wz", 1),
    ("planar3r", "orientation", 1), ("stanford", "pose", 1), ("stanford", "position", 1),
    ("stanford", "vz,wx", 1), ("scara", "pose", 1), ("surgical7", "pose", 1),
    ("puma560", "orientation", 1), ("ur5", "pose", 1), ("ur5", "pose", 1e-8),
    ("stanford", "pose", 1e-8),
]  # fmt: skip
"""Robots, tasks, and the length of what the file calls a metre."""


def judged(name: str, task: str, metre: float, length_scale: float) -> Arm:
    arm = arms.ur5() if name == "ur5" else arms.textbook(name, task)
    return (arm if metre == 1 else scaled(arm, metre)).with_task(length_scale=length_scale)


@pytest.mark.parametrize("length_scale", tiered(SCALES, (1.0,)))
@pytest.mark.parametrize(("name", "task", "metre"), sampled(CASES))
def test_all_that_judge_agree(name: str, task: str, metre: float, length_scale: float) -> None:
    arm = judged(name, task, metre, length_scale)
    Q = questions(arm)
    states = [at(arm, q) for q in Q]
    expected = [s.status for s in states]
    assert "regular" in expected
    assert "singular" in expected or (str(arm.task) == "orientation" and arm.n == 3)
    assert [status_of(float(r)) for r in ratios(arm, Q)] == expected
    assert [status_of(float(r)) for r in ratios(arm, Q, engine="pinocchio")] == expected
    assert [status_of(float(r)) for r in measured(fixed_batch(arm), Q).ratio] == expected
    assert [status_of(float(r)) for r in own_shares(arm, Q)[:, -1]] == expected
    assert [describe(arm, q).status for q in Q] == expected
    for state, q in zip(states, Q, strict=True):
        assert state.singular == (state.rank < state.generic_rank) == describe(arm, q).singular
        assert bool(state.lost) == (state.status != "regular")
        assert bool(state.dependences) or not state.singular


@pytest.mark.parametrize("length_scale", tiered([1e-10, 3e8], {3e8}))
@pytest.mark.parametrize(("name", "task", "metre"), [CASES[1], CASES[4], CASES[-1]])
def test_maps_and_sweeps_count_what_at_says(name, task, metre, length_scale: float) -> None:
    arm = judged(name, task, metre, length_scale)
    plan = plan_map(arm, "grid", steps=3, joints=arm.joints[-3:], ignore_limits=True)
    here = [at(arm, q).status for q in plan.configurations(0, plan.count)]
    found = sigma_map(arm, "grid", steps=3, joints=arm.joints[-3:], ignore_limits=True)
    assert found.singular == here.count("singular")
    assert found.near_singular == here.count("near-singular")
    assert all(p.status == at(arm, p.q).status for p in found.worst)
    swept = sweep(arm, levels=1, samples=5, ignore_limits=True)
    for curve in swept.curves[:3]:
        Q = np.tile(swept.plan.nominal, (len(curve.x), 1))
        for name, value in curve.fixed.items():
            Q[:, arm.joints.index(name)] = value
        Q[:, curve.moving] = curve.x
        states = [at(arm, q) for q in Q]
        assert [status_of(float(r)) for r in curve.sigma_ratio] == [s.status for s in states]
        sigma = [s.sigma[s.generic_rank - 1] for s in states]
        atol = 1e-13 * max(float(s.sigma[0]) for s in states)
        np.testing.assert_allclose(curve.sigma_min, sigma, rtol=1e-6, atol=atol)
    for row, q in zip(swept.uniform, swept.plan.uniform, strict=True):
        assert row.status == at(arm, q).status
    for point in swept.summary.worst:
        assert point.status == at(arm, point.q).status


@pytest.mark.parametrize("task", sampled(TASKS))
@pytest.mark.parametrize("name", ["planar3r", "stanford", "puma560", "surgical7"])
def test_the_length_scale_changes_sigma_and_no_verdict(name: str, task: str) -> None:
    if name == "planar3r" and task == "vz,wx":
        pytest.skip("a planar arm moves in neither row")
    plain = arms.textbook(name, task)
    Q = questions(plain)
    expected = ratios(plain, Q)
    rows = np.array(plain.task.rows)
    for length_scale in SCALES:
        arm = plain.with_task(length_scale=length_scale)
        assert generic_rank(arm) == generic_rank(plain)
        np.testing.assert_allclose(ratios(arm, Q), expected, rtol=1e-9, atol=1e-15)
        sigma = measure(arm, Q).sigma
        if (rows < 3).all():
            np.testing.assert_allclose(
                sigma * length_scale, measure(plain, Q).sigma, rtol=1e-9, atol=1e-15
            )
        elif (rows >= 3).all():
            np.testing.assert_array_equal(sigma, measure(plain, Q).sigma)


@pytest.mark.parametrize("power", [-8, -3, 3])
@pytest.mark.parametrize("name", ["stanford", "scara", "puma560", "surgical7"])
def test_the_unit_of_the_file_changes_no_verdict(name: str, power: int) -> None:
    plain = arms.textbook(name)
    other = scaled(plain, 10.0**power)
    assert own_scale(other).length == pytest.approx(own_scale(plain).length * 10.0**power)
    Q = questions(plain)
    there = Q * np.where(plain.prismatic, 10.0**power, 1.0)
    np.testing.assert_allclose(ratios(other, there), ratios(plain, Q), rtol=1e-6, atol=1e-14)
    assert generic_rank(other) == generic_rank(plain)


@pytest.mark.slow
def test_a_task_that_can_vanish_is_singular_there_for_all():
    """Planar 3R, vx alone: J is zero where the tip is on the y axis; rounding has no ratio."""
    arm = arms.textbook("planar3r", "vx")
    q = np.zeros(3)  # stretched along x: no joint moves the tip along x
    assert at(arm, q).singular
    found = sigma_map(arm, "grid", steps=9, ignore_limits=True)
    plan = plan_map(arm, "grid", steps=9, ignore_limits=True)
    wanted = sum(at(arm, x).singular for x in plan.configurations(0, plan.count))
    assert found.singular == wanted > 0
    arm = arms.textbook("stanford")
    result = sweep(arm, levels=1, samples=61)
    assert {row.status for row in result.uniform} > {"regular"}
    findings = singular_configurations(arm, result)
    assert [str(f.condition) for f in findings if f.status == "singular"]
    assert all(
        describe(arm, f.configuration.q).singular for f in findings if f.status == "singular"
    )
