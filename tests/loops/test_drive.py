"""Driving a mechanism by its inputs: no mode is jumped, and its reach is known beforehand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mechanisms import analyzed, four_bar, shipped
from tiers import tiered

from pinsing.errors import PinsingError
from pinsing.loops import feasible, home, motions, residual
from pinsing.loops.modes import assembly_sign
from pinsing.loops.solve import drive, stretch
from pinsing.loops.trace import trace
from pinsing.robot.mechanism import Mechanism

NAMES = ["five_bar", "four_bar", "planar_3rrr"]
FIRST = [*NAMES[:2], pytest.param("planar_3rrr", marks=pytest.mark.slow)]


def moved(mechanism: Mechanism, q: np.ndarray, k: int, value: float) -> np.ndarray:
    inputs = q[list(mechanism.actuated)].copy()
    inputs[k] = value
    return inputs


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


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_stretch_ends_where_driving_does(name: str, rng: np.random.Generator) -> None:
    mechanism = shipped(name)
    q = home(mechanism)
    checked = 0
    for _ in range(5):
        for k in range(len(mechanism.inputs)):
            found = stretch(mechanism, q, k)
            assert found.name == mechanism.inputs[k]
            assert found.lower <= q[mechanism.actuated[k]] <= found.upper
            if found.whole:
                continue
            for end, inward in ((found.lower, 1), (found.upper, -1)):
                inside = drive(mechanism, moved(mechanism, q, k, end + 1e-4 * inward), q)
                outside = drive(mechanism, moved(mechanism, q, k, end - 1e-4 * inward), q)
                assert inside.converged
                assert not outside.converged
                checked += 1
        k = int(rng.integers(len(mechanism.inputs)))
        found = stretch(mechanism, q, k)
        value = rng.uniform(found.lower + 0.1, found.upper - 0.1)
        q = mechanism.fold(drive(mechanism, moved(mechanism, q, k, value), q).q)
    assert checked >= 10


def test_the_stretches_of_the_paper_s_five_bar_are_its_feasible_range() -> None:
    mechanism = shipped("five_bar")
    inputs = [np.pi / 3] * 2
    for k, found in enumerate(feasible(mechanism, inputs).values()):
        (interval,) = found
        here = stretch(mechanism, home(mechanism), k)
        assert here.lower == pytest.approx(interval.lower, abs=1e-9)
        assert here.upper == pytest.approx(interval.upper, abs=1e-9)


def test_singular_points_on_a_stretch_are_those_of_this_mode() -> None:
    mechanism = shipped("five_bar")
    found = stretch(mechanism, home(mechanism), 1)
    assert [p.kind for p in found.points] == ["type 2", "type 1", "type 1", "type 1", "type 2"]
    # The three of the paper's assembly mode; 2.70536 is in the other one.
    values = [p.q[mechanism.actuated[1]] for p in found.points]
    assert values[1:4] == pytest.approx([1.4092167, 1.9685594, 2.2456653], abs=1e-7)
    assert values[0] == pytest.approx(found.lower)
    assert values[-1] == pytest.approx(found.upper)  # beyond pi: in the turn of the stretch
    assert found.upper > np.pi


def test_a_crank_that_turns_round_has_no_ends() -> None:
    mechanism = four_bar(0.4, 0.1, 0.4, 0.3)  # Grashof: the shortest link turns round
    q = home(mechanism)
    found = stretch(mechanism, q, 0)
    assert found.whole
    assert found.upper - found.lower == pytest.approx(2 * np.pi)
    # Where crank and coupler are in line the rocker turns back: twice a turn.
    assert [p.kind for p in found.points] == ["type 1", "type 1"]
    assert drive(mechanism, q[[0]] + 2 * np.pi, q).converged


def test_limits_of_the_joint_end_a_stretch() -> None:
    whole = shipped("five_bar")
    low, high = whole.lower.copy(), whole.upper.copy()
    low[whole.actuated[0]], high[whole.actuated[0]] = 0.5, 1.2
    found = stretch(replace(whole, lower=low, upper=high), home(whole), 0)
    assert (found.lower, found.upper) == (0.5, 1.2)
    assert {p.kind for p in found.points} == {"type 1"}


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
        both = stretch(mechanism, point.q, k)
        assert min(abs(both.lower - point.inputs[k]), abs(both.upper - point.inputs[k])) < 1e-6


def test_no_curve_begins_at_open_loops() -> None:
    mechanism = shipped("five_bar")
    with pytest.raises(PinsingError, match="do not close at the start"):
        trace(mechanism, np.array([0.0, 0.0, np.pi, 0.0]), 0)
