"""Sliders without limits: what they reach does not end at the range that points are drawn from."""

import numpy as np
import pinocchio as pin
import pytest
from arms import place, serial

import pinsing


def _arm(lower: float, upper: float, offset: float) -> pinsing.Arm:
    """A turn and a slide along x; the tip is on the axis where d2 = -offset."""
    joints = [(pin.JointModelRZ(), place(), -3, 3), (pin.JointModelPX(), place(), lower, upper)]
    return pinsing.load(serial(joints, place((offset, 0, 0))), tip="tip", task="vx,vy")


@pytest.mark.parametrize(
    ("lower", "upper", "offset", "reached"),
    [
        (-np.inf, np.inf, 4.0, True), (-np.inf, np.inf, 40.0, True), (1.0, np.inf, -200.0, True),
        (-np.inf, 5.0, 200.0, True), (1.0, np.inf, 2.0, False), (-np.inf, 5.0, -5.5, False),
    ],
)  # fmt: skip
def test_a_value_beyond_the_drawn_range_is_reached_where_no_limit_ends_it(
    lower, upper, offset, reached
):
    arm = _arm(lower, upper, offset)
    (family,) = pinsing.closed_form(arm).families
    assert family.reachability.name == ("INSIDE" if reached else "OUTSIDE")
    q = np.array([0.3, -offset])
    assert bool(family.contains(q))
    assert arm.within_limits(q) == reached
    drawn = family.sample(5, np.random.default_rng(1))
    assert len(drawn) == (5 if reached else 0)
    assert np.all(drawn[:, 1] == -offset)
    assert family.value_reach[0].reachability is family.reachability
