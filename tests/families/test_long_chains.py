"""Chains of any number of joints: families from the axes of neighbours."""

import numpy as np
import pytest
from dh_arms import dh_arm, snake
from singular_sets import ring_for

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.families.describe import PieceMaker
from pinsing.families.long_chain import LongChain
from pinsing.families.zero_set import SearchBox, draw, peeled, system_of
from pinsing.kinematics.jacobian import generic_rank, ratios, task_jacobians
from pinsing.robot.nominal import nominal


def long_chain(arm):
    geometry, rank, ring, maker = parts_of(arm)
    return LongChain(geometry, arm.task, rank, ring, maker, Budget(60)), maker


def parts_of(arm):
    geometry = nominal(arm)
    ring = ring_for(geometry)
    rank = generic_rank(geometry.arm)
    maker = PieceMaker(geometry, ring, Budget(60), 2e-3)
    return geometry, rank, ring, maker


def on_any(branches, q):
    """Whether one point (n,) lies on some of the branches."""
    for branch in branches:
        away = [np.remainder(q[v.joint] - v.value + 1, 2 * np.pi) - 1 for v in branch.values]
        equations = branch.equations
        off = np.abs(system_of(equations).values(q[None])).max() if equations else 0.0
        if max(np.abs([*away, off])) < 1e-7:
            return True
    return False


@pytest.fixture(scope="module")
def nine():
    arm = snake(9)
    (family,) = pinsing.closed_form(arm, prove=False).families
    assert family.confirm is not None
    return arm, family


@pytest.fixture(scope="module")
def thirteen():
    arm = snake(13)
    return arm, pinsing.closed_form(arm, seconds=60)


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [{}, {"weights": np.arange(1.0, 10)}, {"norm": "max"}, {"within_limits": True}]
)
def test_the_nearest_point_of_equations_that_hold_elsewhere_too_is_singular(nine, options):
    arm, family = nine
    for q in np.random.default_rng(1).uniform(-1, 1, (2, 9)):
        found = family.distance(q, **options)
        assert ratios(arm, found.q[None])[0] < 1e-9
        away = np.abs(found.q - q) * options.get("weights", 1)
        far = away.max() if "norm" in options else np.linalg.norm(away)
        assert found.upper == pytest.approx(far)
        assert found.lower <= found.upper


@pytest.mark.slow
def test_thirteen_joints_are_answered(thirteen):
    arm, form = thirteen
    (family,) = form.families
    assert (form.complete, form.word) == (False, "not complete")
    assert any("13 joints" in gap and "not shown" in gap for gap in form.gaps)
    assert (family.codimension, family.real, family.is_reachable) == (8, True, True)
    hint = next(h for h in form.hints if "regular configurations" in h)
    assert hint.startswith("equations of F1")
    assert "drops below 6" in hint
    assert hint in form.to_dict()["hints"]
    # Points are singular, and others are not on it.
    Q = family.sample(40, np.random.default_rng(1))
    assert Q.shape == (40, 13)
    sigma = pinsing.singular_values(arm, Q)
    assert (sigma[:, 5] / sigma[:, 0]).max() < 1e-10
    assert family.contains(Q).all()
    assert not family.contains(np.random.default_rng(2).uniform(-2, 2, (20, 13))).any()
    near = Q[0] + 1e-3
    found = family.distance(near)
    assert 0 <= found.lower <= found.upper < 13**0.5 * 1e-3 * 1.5
    assert family.contains(found.q)
    # Which joints are free, and how the rest follow.
    said = family.at_once[0]
    assert [len(x) for x in (said.chosen, said.follow, said.steps)] == [5, 8, 8]
    assert all("two solutions given" in step for step in said.steps)
    assert "2^8 = 256" in said.lines()[-1]
    assert pinsing.Family.from_json(family.to_json()).at_once[0].lines() == said.lines()
    # A joint that one equation has alone is solved for last.
    equations, every = family.branches[0].equations, np.ones(13, dtype=bool)
    order = peeled(equations, every, 2)
    assert len(order) == len(equations)
    solved = [step.joint for step in order]
    for k, step in enumerate(order):
        assert not set(step.equation.involved) & set(solved[k + 1 :])
    # What is solved so far goes on with other values of the joints that are not used yet.
    low = np.full(13, -np.pi)
    q = draw(order, SearchBox(low, -low, every, np.zeros(13)), 40, np.random.default_rng(3))
    assert len(q) >= 40
    assert np.abs(system_of(equations).values(q)).max() < 1e-9
    assert len(np.unique(q[:, 1:-1].round(9), axis=0)) == len(q)  # no copies, end joints aside
    assert len(np.unique(q[:, order[0].joint].round(9))) >= 20
    sigma = pinsing.singular_values(arm, q)
    assert (sigma[:, 5] / sigma[:, 0]).max() < 1e-9


@pytest.mark.slow
def test_regular_points_of_the_equations_are_not_the_familys(thirteen):
    """Where five neighbouring axes depend on each other, the equations of both sides hold."""
    arm, form = thirteen
    family = form.families[0]
    maker = parts_of(arm)[3]
    points = np.concatenate([maker.thrown(family.branches[0], 40) for _ in range(2)])
    sigma = pinsing.singular_values(arm, points)
    regular = points[sigma[:, 5] / sigma[:, 0] > 1e-3]
    assert len(regular)  # there are some, else nothing is tried here
    assert not family.contains(regular).any()


@pytest.mark.parametrize("name", ["iiwa14", "surgical7"])
def test_neighbours_tell_the_same_as_all_minors(name):
    arm = pinsing.load(name)
    chain, maker = long_chain(arm)
    mine = [maker.branch_of(c.values, c.relations) for c in chain.components]
    families = pinsing.closed_form(arm).families
    for family in families:
        for q in family.points(8, np.random.default_rng(0)):
            assert on_any(mine, q), family
    theirs = [b for f in families for b in f.branches]
    for branch in mine:
        points = maker.find(branch, 4)
        assert len(points)
        # Values of several turns are taken for degrees by what is asked of them.
        assert (np.abs(maker.thrown(branch, 60)) < np.pi + 1e-6).all()
        assert all(on_any(theirs, q) for q in points)
    codimensions = sorted({c.codimension for c in chain.components})
    assert codimensions == sorted({f.codimension for f in families})


@pytest.mark.slow
def test_two_spherical_groups_make_a_larger_set():
    """Each force along the line of their centres is reciprocal to six joints, not to five."""
    ball = [(90, 0, 0), (-90, 0, 0)]
    links = [(90, 0.3, 0.1), (-90, 0.2, 0.15), (90, 0.15, 0.2), (90, 0.25, 0.1)]
    rows = [*ball, *links, *ball, (0, 0.1, 0.1)]
    arm = dh_arm(rows, limits=(-170, 170))
    chain, maker = long_chain(arm)
    larger = [c for c in chain.components if not c.values and c.codimension == 3]
    assert larger  # codimension 4 is what six axes and three more give
    # Where the six depend on each other in another way, the equations hold as well.
    points = maker.thrown(maker.branch_of({}, larger[0].relations), 60)
    singular = points[ratios(maker.geometry.arm, points) < 1e-9]
    assert len(singular) > 4
    J = task_jacobians(maker.geometry.arm, singular)[..., [0, 1, 2, 6, 7, 8]]
    sizes = np.linalg.svd(J, compute_uv=False)
    assert (sizes[:, 4] > 1e-6 * sizes[:, 0]).any()
