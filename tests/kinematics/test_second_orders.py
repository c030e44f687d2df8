"""Kinds in the compiled kernel: what NumPy says, on each instruction set, lane by lane."""

import arms
import numpy as np
import pytest
from tiers import sampled

from pinsing import closed_form, load
from pinsing._batch import engine as kernel
from pinsing.kinematics.batch import batch, own_scale
from pinsing.kinematics.refine import _told, clear_kinds, describe_many
from pinsing.kinematics.verdict import SINGULAR_RTOL, task_size
from pinsing.robot.nominal import nominal

pytestmark = pytest.mark.skipif(not kernel.available(), reason="needs the compiled kernel")

CASES = {
    "6 joints": {"robot": "ur5"}, "a slider": {"robot": "stanford"},
    "7 joints": {"robot": "panda"}, "three rows": {"robot": "planar3r", "task": "vx,vy,wz"},
    "position of 6 joints": {"robot": "ur5", "task": "position"},
}  # fmt: skip


@pytest.fixture(scope="module", params=CASES, ids=str)
def told(request):
    """A nominal arm and points of its families."""
    arm = load(**CASES[request.param])
    rng = np.random.default_rng(5)
    points = [family.points(40, rng) for family in closed_form(arm, prove=False).families]
    return nominal(arm).arm, np.concatenate(points)


def compiled(arm, Q, isa):
    return kernel.second_orders(
        batch(arm).own_chain(),
        Q / own_scale(arm).columns,
        rows=arm.task.rows,
        zero=SINGULAR_RTOL,
        size=task_size(arm),
        threads=1,
        isa=isa,
    )


@pytest.mark.parametrize("isa", sampled(kernel.isa_names() if kernel.available() else ()))
def test_what_is_told_is_what_numpy_says(told, isa):
    arm, Q = told
    ours, theirs = compiled(arm, Q, isa), _told(arm, Q)
    np.testing.assert_array_equal(ours[:, 0], theirs[:, 0])
    once = theirs[:, 0] == len(arm.task.rows) - 1
    assert once.sum() > 30
    ours, theirs = ours[once], theirs[once]
    # The lost direction has no sign: with the other one both ends change places.
    turned = np.stack([-theirs[:, 2], -theirs[:, 1]], axis=1)
    apart = [np.abs(ours[:, 1:3] - ends).max(axis=1) for ends in (theirs[:, 1:3], turned)]
    size = theirs[:, 5]
    assert (np.minimum(*apart) <= 1e-9 * size).all()
    assert (np.abs(ours[:, 4:] - theirs[:, 4:]).max(axis=1) <= 1e-9 * size).all()
    # The largest entry depends on the basis of the self-motions, up to their number.
    spread = arm.n - len(arm.task.rows) + 1
    assert (ours[:, 3] <= spread * theirs[:, 3] + 1e-9 * size).all()
    assert (theirs[:, 3] <= spread * ours[:, 3] + 1e-9 * size).all()


def test_what_does_not_fit_is_refused():
    arm = nominal(load("ur5")).arm
    with pytest.raises(ValueError, match="Q must have shape"):
        kernel.second_orders(
            batch(arm).own_chain(), np.zeros((2, 5)), rows=range(6), zero=1e-9, size=0.0
        )
    with pytest.raises(ValueError, match="not finite"):
        compiled(arm, np.full((1, 6), np.nan), None)
    with pytest.raises(ValueError, match="rows"):
        kernel.second_orders(
            batch(arm).own_chain(), np.zeros((1, 6)), rows=(0, 9), zero=1e-9, size=0.0
        )
    planar = arms.planar((1.0, 0.8))
    with pytest.raises(ValueError, match="too many joints, or rows"):
        kernel.second_orders(
            batch(planar).own_chain(), np.zeros((1, 2)), rows=range(6), zero=1e-9, size=0.0
        )


FEWER = {
    "5 joints": {"robot": "romeo_laas_small", "tip": "AccelerometerHead_sensor"},
    "a hand": {"robot": "tiago", "tip": "hand_thumb_flex_2_link", "base": "arm_7_link"},
    "a flying arm": {"robot": "hextilt"},
    "three rows of two": {"robot": "planar3r", "task": "vx,vy,vz"},
}


@pytest.mark.parametrize("case", sampled(FEWER), ids=str)
def test_kinds_of_arms_that_miss_motions_are_those_of_one_at_a_time(case):
    loaded = load(**FEWER[case])
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
