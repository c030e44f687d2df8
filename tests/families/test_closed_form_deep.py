"""Singular sets in which three conditions and more meet: positions, and chains of 8 joints."""

import functools

import numpy as np
import pytest
from singular_sets import check_apart, check_beside, check_families, check_search, drop
from tiers import tiered

from pinsing.description.catalog import data_folder
from pinsing.families import closed_form
from pinsing.families.form import families_text
from pinsing.robot.load import load
from pinsing.robot.nominal import nominal
from pinsing.sampling.analyze import analyze

pytestmark = pytest.mark.slow

CHAINS = {
    "talos and its gripper": ("talos_full_v2", "gripper_left_motor_double_link", "torso_2_link"),
    "baxter and its finger": ("baxter", "l_gripper_l_finger_tip", None),
    "panda and its finger": ("panda", "panda_leftfinger", None),
    "tiago and its lift": ("tiago", "wrist_ft_tool_link", None),
}


@functools.cache
def position(name):
    arm = load(name, task="position")
    return arm, closed_form(arm, seconds=30)


@functools.cache
def chain(name):
    robot, tip, base = CHAINS[name]
    arm = load(robot, tip=tip, base=base)
    return arm, closed_form(arm, seconds=60)


@pytest.mark.parametrize(
    "name", tiered(["ur5", "z1", "irb1400", "so101", "surgical7"], ("irb1400",))
)
def test_positions_are_complete(name):
    arm, form = position(name)
    assert form.complete, form.gaps
    assert max(f.codimension for f in form.families) >= 3
    check_families(arm, form, 12 * len(form.families))
    assert check_search(arm, form, 60) >= 50
    check_apart(form, 20)
    check_beside(arm, form, 10, share=0.5)


@pytest.mark.parametrize("name", CHAINS)
def test_chains_of_eight_joints_are_complete(name):
    arm, form = chain(name)
    assert arm.n == 8
    assert form.complete, form.gaps
    check_families(arm, form, 4 * len(form.families))
    assert check_search(arm, form, 30, tol=1e-4) >= 20


NINE = {
    "alex, torso and arm": ("alex_nub_hands.urdf", "LeftWristRollLink"),
    "talos, torso and arm": ("talos_full_v2", "wrist_left_ft_tool_link"),
}


@functools.cache
def nine(name):
    robot, tip = NINE[name]
    return load(next(data_folder().rglob(robot)) if "." in robot else robot, tip=tip)


@pytest.mark.parametrize("name", NINE)
def test_nine_joints_are_complete_by_a_count(name):
    arm = nine(name)
    assert arm.n == 9
    form = closed_form(arm, seconds=300, prove=False)
    assert form.complete, form.gaps
    assert form.word == "probable"
    count = form.slice_count
    if count is None:  # all minors ended in the time: then nothing is left to count
        return
    assert (count.off, count.real_off, count.joints) == (0, 0, 4)  # none has more conditions
    assert count.real > 50
    assert count.slices >= 5 * count.choices
    assert len(count.primes) >= 3
    assert count.met >= 0.8 * count.known
    assert "it rests on a count: all" in " ".join(families_text(form).split())
    for family in form.families:
        Q = family.points(5, np.random.default_rng(0))
        assert drop(nominal(arm).arm, Q, form.generic_rank).max(initial=0.0) < 1e-9
    assert check_search(arm, form, 30, tol=1e-4) >= 20


def test_nine_joints_end_in_time_and_say_what_stopped_them():
    form = closed_form(nine("alex, torso and arm"), seconds=0.3)
    assert not form.complete
    assert any("budget of" in g or "told apart" in g for g in form.gaps)


@pytest.mark.parametrize(
    ("file", "tip", "base"),
    [
        # Most of an equation cancels at a joint's irrational value: its rounding is no residual.
        ("talos_data/robots/talos_reduced.urdf", "gripper_left_motor_double_link", "torso_2_link"),
        # sigma_r is below the tolerance 1e-3 away from where it is zero.
        ("romeo_description/urdf/romeo_laas_small.urdf", "RWristPitchSphereCollision_shape", None),
    ],
)
def test_what_a_search_finds_close_to_a_family_is_on_it(file, tip, base):
    result = analyze(load(data_folder() / file, tip=tip, base=base), seconds=240)
    assert result.complete
    assert result.agree, result.problems
    assert result.random_search.singular > 250
