"""Points modulo primes on which equations of long chains vanish, one solved after the other."""

import numpy as np
import pytest
from dh_arms import snake
from singular_sets import ring_for

from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component
from pinsing.algebra.jacobian_matrix import NearMinors
from pinsing.families.describe import PieceMaker
from pinsing.families.long_chain import LongChain, ModularPoints, solving_order
from pinsing.kinematics.jacobian import generic_rank, ratios
from pinsing.robot.nominal import nominal


@pytest.fixture(scope="module", name="snake")
def _snake():
    """Ten axes at right angles; and all minors of neighbours."""
    arm = snake(10)
    geometry = nominal(arm)
    ring = ring_for(geometry)
    minors = NearMinors(geometry, ring, arm.task, 6, Budget(60))
    return arm, geometry, ring, [minors.minor(range(i, i + 6), {}) for i in range(5)]


def test_joints_at_values_are_there(snake):
    arm, geometry, ring, minors = snake
    place = {3: (1, 0), 5: (2, 1)}
    put = [ring.strip(ring.putting(place)(m)) for m in minors[:2]]
    points = ModularPoints(geometry, arm.task, ring, 2).points(place, put, 3, Budget(60))
    assert len(points) == 3
    for p in points:
        assert p.on(Component({3: (1, 0), 5: (2, 1)}, tuple(minors[:2]), False, 4))
        assert not p.on(Component({5: (1, 2)}, (), False, 1))
        assert all(p.is_zero(m) for m in minors[:2])  # before the values were put in, too


def test_no_order_no_points(snake):
    arm, geometry, ring, minors = snake
    order = solving_order(minors, ring)
    solved = [j for _, j in order]
    assert len(set(solved)) == len(minors)
    for i, (poly, _) in enumerate(order):
        assert not set(ring.joints_of(poly)) & set(solved[i + 1 :])
    # Three equations in the same two joints: more than joints.
    x, y = ring.variables(2), ring.variables(3)
    gens = ring.context.gens()
    many = [gens[x[0]] * gens[y[0]] + k * gens[x[1]] * gens[y[1]] for k in (2, 3, 5)]
    assert solving_order(many, ring) is None
    assert ModularPoints(geometry, arm.task, ring, 3).points({}, many, 2, Budget(60)) is None


@pytest.mark.slow
def test_a_chain_is_stated_by_them_alone(snake, monkeypatch):
    """No real point is looked for: the general family of ten joints has five equations."""
    arm, geometry, ring, _ = snake
    maker = PieceMaker(geometry, ring, Budget(60), 2e-3)
    monkeypatch.setattr(LongChain, "_by_real_points", lambda self: self._later.clear())
    chain = LongChain(geometry, arm.task, generic_rank(geometry.arm), ring, maker, Budget(60))
    assert [c.codimension for c in chain.components] == [5]
    points = maker.thrown(maker.branch_of({}, chain.components[0].relations), 40)
    ratio = ratios(maker.geometry.arm, points)
    assert (ratio < 1e-9).sum() >= 3
    assert np.isfinite(ratio).all()
