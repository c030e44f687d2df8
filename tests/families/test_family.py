"""Families: membership, distance, samples, limits."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from arms import place, serial
from singular_sets import RIGHT, ROBOTS, Array, Joint, arm_of, build, closed
from tiers import tiered, tiered_rows

import pinsing
from pinsing import load
from pinsing.errors import ConfigurationError
from pinsing.families import ClosedForm, Family, closed_form

EQUATIONS = [("puma560", 2), ("ur5", 2), ("surgical7", 3), ("xarm7", 2), ("so101", 1)]


def offset(family: Family, a: Array, b: Array) -> Array:
    """Differences of joint vectors as ``distance`` counts them."""
    d = a - b
    wrapped = d - 2 * np.pi * np.round(d / (2 * np.pi))
    return np.where(family.prismatic, d / family.length_scale, wrapped)


@pytest.mark.parametrize(("name", "index"), tiered_rows(EQUATIONS, EQUATIONS[:3]))
def test_whole_turns_do_not_matter(name: str, index: int) -> None:
    family = closed_form(load(**ROBOTS[name], units="rad"), prove=False).families[index]
    rng = np.random.default_rng(14)
    on = family.points(10, rng)
    turns = np.where(family.prismatic, 0.0, 2 * np.pi * rng.integers(-2, 3, on.shape))
    assert family.contains(on + turns).all()
    q = rng.uniform(-3, 3, family.n)
    # The starts of the iteration turn along, so that the same minimum is found.
    assert family.distance(q + turns[0]).value == pytest.approx(family.distance(q).value, abs=1e-9)


def test_distance_of_a_slider_is_over_the_length_scale() -> None:
    long = closed_form(arm_of("stanford").with_task(length_scale=0.25))
    slide = next(f for f in long.families if f.prismatic[2] and f.values[0].keys() == {2})
    q = np.full(6, 0.7)
    found = slide.distance(q)
    assert (found.value, found.q[2]) == (pytest.approx(0.7 / 0.25), 0.0)
    np.testing.assert_array_equal(np.delete(found.q, 2), np.delete(q, 2))
    assert slide.contains(q * [1, 1, 1e-7, 1, 1, 1], tol=1e-6)
    assert not slide.contains(q * [1, 1, 1e-6, 1, 1, 1], tol=1e-6)
    with pytest.raises(ConfigurationError, match="one configuration"):
        slide.distance(np.stack([q, q]))


@pytest.mark.parametrize(
    "name", tiered(["ur5", "iiwa14", "surgical7", "xarm7", "so101"], ("ur5", "surgical7"))
)
def test_tolerance_of_contains_is_a_distance(name: str) -> None:
    rng = np.random.default_rng(16)
    for family in closed(name).families:
        base = family.points(12, rng)
        moved = base + rng.normal(size=base.shape) * 1e-3
        gaps = np.array([family.distance(q).value for q in moved])
        inside = np.array([bool(family.contains(q, 1e-3)) for q in moved])
        clear = np.abs(gaps - 1e-3) > 1e-4
        np.testing.assert_array_equal(inside[clear], (gaps < 1e-3)[clear])


def elbow(low: float, high: float) -> ClosedForm:
    links = [Joint(), Joint(a=0.4, limits=(low, high))]
    return closed_form(build(links, (0.3, 0.0, 0.0), "position"))


@pytest.mark.parametrize(
    ("low", "high", "reachable"),
    [
        (-1.0, 1.0, True), (0.1, 3.0, False), (0.1, 3.2, True), (6.0, 6.5, True),
        (15.0, 16.0, True), (-15.5, -13.0, False), (0.0, 0.0, True), (-20.0, 20.0, True),
        (-np.inf, np.inf, True),
    ],
)  # fmt: skip
def test_joint_values_within_limits(low: float, high: float, reachable: bool) -> None:
    (family,) = elbow(low, high).families
    assert family.is_reachable is reachable
    assert family.reachability == ("reachable" if reachable else "not reachable")
    inside = family.sample(9, np.random.default_rng(1))
    assert len(inside) == (9 if reachable else 0)
    assert (family.witness is not None) is reachable
    assert ((inside[:, 1] >= low - 1e-9) & (inside[:, 1] <= high + 1e-9)).all()
    assert np.isfinite(low) or (np.abs(inside) <= np.pi + 1e-9).all()
    np.testing.assert_allclose(np.sin(inside[:, 1]), 0.0, atol=1e-12)
    assert len(family.points(9, np.random.default_rng(1))) == 9


def shoulder(limits: tuple[float, float]) -> Family:
    """The locus 0.15 + 0.6 cos q2 + 0.5 cos(q2+q3) = 0 of an arm whose shoulder is offset."""
    arm = build(
        [Joint(), Joint(RIGHT, 0.15, limits=limits), Joint(a=0.6, limits=limits)],
        (0.5, 0.0, 0.0),
        "position",
    )
    return next(f for f in closed_form(arm).families if f.equations)


def test_a_family_without_real_points_says_so() -> None:
    family = shoulder((-3.0, 3.0))
    (branch,) = family.branches
    (equation,) = branch.equations
    lifted = replace(equation, cos=np.where(equation.cos == 0.15, 5.0, equation.cos))
    assert not np.array_equal(lifted.cos, equation.cos)
    empty = replace(family, branches=(replace(branch, equations=(lifted,)),))
    with pytest.raises(ConfigurationError, match="no real point"):
        empty.distance(np.zeros(3))
    assert not empty.contains(np.zeros((4, 3)), 1.0).any()
    assert len(empty.points(3, np.random.default_rng(1))) == 0


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
    """A turn and a slide along x; the tip is on the axis where d2 = -offset."""
    joints = [(pin.JointModelRZ(), place(), -3, 3), (pin.JointModelPX(), place(), lower, upper)]
    arm = pinsing.load(serial(joints, place((offset, 0, 0))), tip="tip", task="vx,vy")
    (family,) = pinsing.closed_form(arm).families
    assert family.reachability.name == ("INSIDE" if reached else "OUTSIDE")
    q = np.array([0.3, -offset])
    assert bool(family.contains(q))
    assert arm.within_limits(q) == reached
    drawn = family.sample(5, np.random.default_rng(1))
    assert len(drawn) == (5 if reached else 0)
    assert np.all(drawn[:, 1] == -offset)
    assert family.value_reach[0].reachability is family.reachability
