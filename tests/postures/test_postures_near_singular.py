"""Postures next to singular configurations, of nearly singular arms, and what was asked wrongly."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from dh_arms import arm_of, aspects_of, dh_arm, form_of
from tiers import sampled, tiered

import pinsing
from pinsing.errors import ConfigurationError, OptionError
from pinsing.kinematics.inverse import inverse
from pinsing.kinematics.jacobian import tip_placement

# The upper arm and the forearm of PUMA 560 are of almost one length: its elbow folded, the wrist
# is half a millimetre from the axis of joint 2, and the pose tells little about two joints.
FOLDED = np.pi / 2 + np.arctan2(0.0203, 0.4318)

PUMA_LIKE = [
    (-90, 0, 0), (0, 1, 0.2), (-90, 0.02, 0), (90, 0, 1), (-90, 1.0e-9, 0), (0, 0, 0),
]  # fmt: skip


def pose_of(arm, q):
    return tip_placement(arm, np.array(q)).homogeneous


def nearest(arm, found, q):
    return min(np.abs(arm.space.wrap(s.q - np.array(q))).max() for s in found)


@pytest.mark.parametrize("q5", sampled([1e-7, 3e-8, 1e-8, 1e-9, 0.0]))
def test_next_to_the_wrist_singularity_a_solution_is_found_and_flagged(q5):
    arm = arm_of("puma560")
    q = [0.3, 0.4, -0.5, 0.2, q5, 0.1]
    found = pinsing.inverse(arm, pose_of(arm, q))
    assert sum(s.regular for s in found) == 6
    straight = [s for s in found if abs(s.q[4]) < 1e-6]
    assert straight
    assert not any(s.regular for s in straight)
    if q5 > 1e-8:
        assert nearest(arm, found, q) < 1e-6


class TestInverseThatStalls:
    @pytest.mark.slow
    @pytest.mark.parametrize("e", tiered([3e-3, 1e-3, 1e-4], (3e-3, 1e-4)))
    def test_reachable_is_not_called_out_of_reach(self, e):
        arm = arm_of("puma560")
        q = [0.3, 0.4, FOLDED + e, 0.2, 0.5, 0.1]
        found = pinsing.inverse(arm, pose_of(arm, q))
        assert len(found) or ("stalled" in found.doubt and "out of reach" not in str(found))
        again = pinsing.inverse(arm, pose_of(arm, q), near=q)
        assert nearest(arm, again, q) < 1e-6

    @pytest.mark.slow
    def test_huge_poses_overflow_nothing(self):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for pose in ([9e8] * 6, [1e9, -1e9, 0, 1e8, 0, 0], [1e6, 0, 0, 0, 0, 0]):
                assert len(pinsing.inverse(arm_of("puma560"), pose)) == 0
            assert len(pinsing.inverse(arm_of("stanford"), [9e8] * 6)) == 0
            with pytest.raises(ConfigurationError, match="which no arm reaches"):
                pinsing.inverse(arm_of("puma560"), [1e300] * 6)


def test_a_joint_held_outside_its_limits_stays_there_and_is_flagged():
    arm = pinsing.load("iiwa14", units="rad")
    q = np.array([0.1, 0.5, 0.3, -1, 0.2, 0.7, 0.4])
    pose = pose_of(arm, q)
    found = inverse(arm, pose, fixed={arm.joints[2]: 0.3 + 4 * np.pi})
    assert len(found) == 8
    assert all(s.q[2] == 0.3 + 4 * np.pi for s in found)
    assert not any(s.within_limits for s in found)
    assert any("outside its limits" in n for n in found.notes)
    inside = inverse(arm, pose, fixed={arm.joints[2]: 0.3})
    assert any(s.within_limits for s in inside)
    assert not any("outside its limits" in n for n in inside.notes)


def test_aspects_of_another_arm_are_refused():
    ur5 = form_of("ur5")
    with pytest.raises(OptionError, match="another arm"):
        pinsing.connect(form_of("puma560"), [0.1] * 6, [0.2] * 6, of=aspects_of("ur5"))
    with pytest.raises(OptionError, match="another arm"):
        pinsing.postures.aspect_changes(
            form_of("puma560"), [[0.1] * 6, [0.2] * 6], of=aspects_of("ur5")
        )
    again = pinsing.closed_form(replace(arm_of("ur5")))
    assert again is not ur5
    way = pinsing.connect(again, [0.1] * 6, [0.2] * 6, of=aspects_of("ur5"))
    assert way.answer == "same"


@pytest.mark.slow
def test_an_arm_that_rounding_made_cuspidal():
    found = pinsing.cuspidality(dh_arm(PUMA_LIKE), poses=5)
    assert found.answer == "cuspidal"
    assert found.proven
    assert found.least_ratio < 1e-5
    (said,) = [n for n in found.notes if "practically singular" in n]
    assert "not cuspidal" in said


@pytest.mark.slow
@pytest.mark.parametrize("q", [(0, 0, 0, 0, 0, 0), (0.1, -1, 1.2, 0.3, 0, 0.2)])
def test_singular_solutions_on_a_curve_are_examples_and_no_count(q):
    """With q5 = 0 joints 2, 3, 4 and 6 turn about parallel axes: one freedom more than needed."""
    arm = pinsing.load("ur5")
    found = pinsing.posture_changes(arm, q)
    regular = [other for other in found.others if other.solution.regular]
    singular = len(found.others) - len(regular)
    first, *rest = found.text().splitlines()
    assert singular > 4
    assert first.startswith(f"ur5: {len(regular)} other postures of this pose; this one is sing")
    assert any(f"Singular solutions too (examples, {singular} found)" in line for line in rest)
    assert "infinitely many" in found.doubt
    assert not any("was not found" in note for note in found.notes)
