"""Kinds of many configurations at once: those that are found one at a time."""

import numpy as np
import pytest
from tiers import sampled

from pinsing import closed_form, load
from pinsing.kinematics.refine import clear_kinds, describe_many
from pinsing.robot.nominal import nominal

CASES = {
    "6 joints": {"robot": "ur5"}, "a slider": {"robot": "stanford"},
    "7 joints": {"robot": "panda"}, "three rows": {"robot": "planar3r", "task": "vx,vy,wz"},
    "position of 6 joints": {"robot": "ur5", "task": "position"},
}  # fmt: skip
FEWER = {  # arms that miss some of the motions everywhere
    "5 joints": {"robot": "romeo_laas_small", "tip": "AccelerometerHead_sensor"},
    "a hand": {"robot": "tiago", "tip": "hand_thumb_flex_2_link", "base": "arm_7_link"},
    "a flying arm": {"robot": "hextilt"},
    "three rows of two": {"robot": "planar3r", "task": "vx,vy,vz"},
}


@pytest.mark.parametrize("case", sampled([*CASES.values(), *FEWER.values()]), ids=str)
def test_clear_kinds_are_those_of_one_at_a_time(case):
    loaded = load(**case)
    arm = nominal(loaded).arm
    rng = np.random.default_rng(6)
    Q = np.concatenate([f.points(20, rng) for f in closed_form(loaded).families])
    alone = [describe_many(arm, [q])[0].kind for q in Q]
    told = clear_kinds(arm, Q)
    clear = [kind is not None for kind in told]
    assert sum(clear) > 10
    assert [a for a, c in zip(alone, clear, strict=True) if c] == [k for k in told if k is not None]
    regular = rng.uniform(-1, 1, (5, arm.n))
    assert clear_kinds(arm, regular) == [None] * 5
