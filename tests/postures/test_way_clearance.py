"""Ways are pushed away from what is near; every bound holds at points of the way."""

import numpy as np
import pytest
from dh_arms import along

import pinsing
from pinsing.postures.aspects import least, raised


@pytest.fixture(scope="module")
def ur5():
    arm = pinsing.load("ur5")
    form = pinsing.closed_form(arm)
    return arm, form, pinsing.aspects(form)


def test_a_way_round_a_singularity_is_raised_and_stays_a_way(ur5):
    """The elbow stays bent, and the wrist is taken near to q5 = 0 on purpose."""
    chosen = ur5[2]._map
    assert chosen is not None
    start = np.array([0.0, -1.0, 1.2, 0.3, 1.0, 0.0])
    end = start + np.array([0.4, 0.1, 0.2, 0.1, 0.2, 0.0])
    close = (start + end) / 2
    close[4] = 0.02
    path = np.stack([start, close, end])
    assert chosen.clear(path)
    before = least(chosen, path)
    after = raised(chosen, path, iter(range(1000)))
    assert before <= 0.02
    assert chosen.clear(after)
    assert least(chosen, after) > 0.3
    assert np.array_equal(after[0], start)
    assert np.array_equal(after[-1], end)


@pytest.mark.slow
def test_connections_within_limits_are_decided_and_clear(ur5):
    arm, form, found = ur5
    rng, joined = np.random.default_rng(4), 0
    while joined < 6:
        qa, qb = arm.space.sample(2, rng)
        known = pinsing.connect(form, qa, qb, of=found)
        assert known.answer in ("same", "different")
        assert (known.answer == "same") == (found.of(qa) == found.of(qb))
        if known.path is None:
            continue
        joined += 1
        way = known.path
        ends = float(np.min(pinsing.clearance(form, np.stack([qa, qb])).lower))
        assert known.clearance > 0.1 * ends
        assert not arm.space.outside(way).any()
        # No configuration of a family is nearer to any point of the way than is said.
        assert known.clearance <= float(pinsing.clearance(form, along(way)).upper.min()) + 1e-12
