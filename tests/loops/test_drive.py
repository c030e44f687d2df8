"""Driving a mechanism by its inputs: no mode is jumped, and its reach is known beforehand."""

import numpy as np
import pytest
from mechanisms import analyzed, shipped
from tiers import tiered

from pinsing.errors import PinsingError
from pinsing.loops import home, motions, residual
from pinsing.loops.motion import assembly_sign
from pinsing.loops.solve import drive, trace
from pinsing.robot.mechanism import Mechanism

NAMES = ["five_bar", "four_bar", "planar_3rrr"]


def moved(mechanism: Mechanism, q: np.ndarray, k: int, value: float) -> np.ndarray:
    inputs = q[list(mechanism.actuated)].copy()
    inputs[k] = value
    return inputs


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(NAMES, ("five_bar",)))
def test_long_drags_never_change_the_assembly_mode(name: str, rng: np.random.Generator) -> None:
    mechanism = shipped(name)
    q = home(mechanism)
    mode, stopped = assembly_sign(mechanism, q), 0
    for _ in range(60):
        k = int(rng.integers(len(mechanism.inputs)))
        here = q[mechanism.actuated[k]]
        found = drive(mechanism, moved(mechanism, q, k, here + rng.uniform(-1.5, 1.5)), q)
        assert np.abs(residual(mechanism, found.q)).max() < 1e-9
        assert assembly_sign(mechanism, found.q) == mode
        if not found.converged:
            stopped += 1
            # It stops where the mode ends.
            assert motions(mechanism, found.q).input_ratio < 0.02
        q = mechanism.fold(found.q)
    assert 5 < stopped < 55


@pytest.mark.parametrize("name", tiered(NAMES, ("four_bar",)))
def test_type_2_is_left_to_where_the_loops_close(name: str) -> None:
    mechanism = shipped(name)
    ends = [p for p in analyzed(name).points if p.range_end]
    assert ends
    for point in ends:
        k = mechanism.inputs.index(point.moving)
        ways = [
            drive(mechanism, moved(mechanism, point.q, k, point.inputs[k] + step), point.q)
            for step in (-0.1, 0.1)
        ]
        assert sorted(w.converged for w in ways) == [False, True]
        inside = next(w for w in ways if w.converged)
        assert motions(mechanism, inside.q).kind() == "regular"


def test_no_curve_begins_at_open_loops() -> None:
    mechanism = shipped("five_bar")
    with pytest.raises(PinsingError, match="do not close at the start"):
        trace(mechanism, np.array([0.0, 0.0, np.pi, 0.0]), 0)
