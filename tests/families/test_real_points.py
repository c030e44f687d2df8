"""Whether a family is real, and what its samples show, are one answer."""

from dataclasses import replace

import numpy as np
import pytest
from dh_arms import dh_arm

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.families.describe import describe
from pinsing.families.nearness import OwnPoints
from pinsing.families.solve import joint_symbols
from pinsing.families.steps import ComponentSearch
from pinsing.kinematics.jacobian import generic_rank
from pinsing.kinematics.verdict import ratios
from pinsing.robot.nominal import nominal


@pytest.fixture(scope="module")
def search():
    """The arm, its exact geometry, and the components that were found of it."""
    arm = pinsing.load("ur5")
    geometry = nominal(arm)
    rank = generic_rank(geometry.arm)
    return (
        arm,
        geometry,
        ComponentSearch(geometry, arm, rank, joint_symbols(arm), Budget(60.0), 0.002).run(),
    )


def test_what_a_first_look_missed_is_real_where_samples_are_found(search):
    arm, geometry, found = search
    with_equations = [c for c in found.components if c.relations]
    assert with_equations
    for component in with_equations:
        pieces = [replace(p, real=False) for p in found.maker.make(component)]
        family = describe(pieces, found.maker, arm, geometry)
        assert len(family.sample(4, np.random.default_rng(0))) == 4
        assert family.real
        assert family.reachability == "reachable"
        assert family.witness is not None


def test_equations_without_a_real_point_stay_so(search):
    arm, geometry, found = search
    x, y = (found.ring.context.gens()[v] for v in found.ring.variables(2))
    component = next(c for c in found.components if c.relations)
    piece = found.maker.make(component)[0]
    nowhere = found.maker.branch_of({}, [4 * x * x + 2 * y * y])  # 3 + cos q3, over the circle
    family = describe([replace(piece, branches=(nowhere,), real=False)], found.maker, arm, geometry)
    assert not family.real
    assert family.witness is None
    assert family.reachability == "none found"
    assert len(family.sample(4, np.random.default_rng(0))) == 0


def test_a_point_off_by_the_root_of_rounding_is_brought_to_all_digits(search):
    arm = search[1].arm
    own = OwnPoints(arm)
    elbow = np.array([0.3, -0.7, 2e-7, 0.5, 0.9, 0.1])
    regular = np.array([0.3, -0.7, 0.8, 0.5, 0.9, 0.1])
    every = np.ones(6, dtype=bool)
    blunt = np.stack([elbow, regular])
    assert own(blunt).tolist() == [True, False]
    sharp = own.sharpened(blunt, every)
    assert pinsing.singular_values(arm, blunt[:1])[0, -1] > 1e-9
    assert pinsing.singular_values(arm, sharp[:1])[0, -1] < 1e-14
    assert np.abs(sharp[0] - elbow).max() < 1e-6
    assert np.array_equal(sharp[1], regular)  # the singular ones are far away
    held = every.copy()
    held[2] = False
    assert own.sharpened(blunt, held)[0, 2] == elbow[2]


@pytest.mark.slow
def test_points_that_a_search_turned_beyond_the_limits_are_judged():
    """Six joints, vx,vz,wy: a sample of the search was turned by 1.75 turns, as if in degrees."""
    rows = [(0, 0.05, 0), (0, 0, -90), (-0.1, 0, 0), (0, 0, -90), (-0.1, 0, 90), (0, 0, -90)]
    arm = dh_arm([(alpha, a, d) for a, d, alpha in rows], "vx,vz,wy")
    far = np.full((1, 6), 0.3)
    far[0, 3] += 4 * np.pi
    assert ratios(arm, far) == pytest.approx(ratios(arm, far - [0, 0, 0, 4 * np.pi, 0, 0]))
    assert pinsing.closed_form(arm, seconds=4, prove=False).families
