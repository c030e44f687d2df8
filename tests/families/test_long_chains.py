"""Chains of any number of joints: families from the axes of neighbours."""

from __future__ import annotations

import numpy as np
import pytest

import pinsing
from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.jacobian_matrix import constants, jacobian_matrix, neighbouring_screws
from pinsing.algebra.surd_ring import ring_of
from pinsing.families.drawn import draw, peeled
from pinsing.families.long_chain import LongChain
from pinsing.families.pieces import PieceMaker
from pinsing.families.solve import joint_symbols
from pinsing.families.zero_set import residuals
from pinsing.kinematics.jacobian import generic_rank
from pinsing.robot.nominal import nominal


def table(folder, name, rows):
    """A DH table of (alpha in degrees, a, d)."""
    lines = [
        f"  - {{alpha: {alpha}, a: {a}, d: {d}, theta: 0, type: revolute, limits: [-170, 170]}}"
        for alpha, a, d in rows
    ]
    path = folder / f"{name}.dh.yaml"
    head = f"name: {name}\nconvention: standard\nunits: {{angle: deg, length: m}}\nrows:\n"
    path.write_text(head + "\n".join(lines) + "\n")
    return path


def snake(folder, joints):
    """Neighbouring axes at right angles and at a distance: no three meet or are parallel."""
    lengths = [(0.2, 0.15, 0.25)[i % 3] for i in range(joints)]
    rows = [((90, -90)[i % 2], a, (0.1, 0.05)[i % 2]) for i, a in enumerate(lengths)]
    return table(folder, f"snake{joints}", rows)


def long_chain(arm):
    geometry, rank, ring, maker = parts_of(arm)
    return LongChain(geometry, arm.task, rank, ring, maker, Budget(60)), maker


def parts_of(arm):
    geometry = nominal(arm)
    slides = tuple(bool(p) for p in arm.prismatic)
    ring = ring_of(slides, constants(geometry, arm.task), Budget(60))
    rank = generic_rank(geometry.arm)
    maker = PieceMaker(geometry, ring, rank, joint_symbols(arm), 20, Budget(60), 2e-3)
    return geometry, rank, ring, maker


def on_any(branches, q):
    """Whether one point (n,) lies on some of the branches."""
    for branch in branches:
        away = [np.remainder(q[v.joint] - v.value + 1, 2 * np.pi) - 1 for v in branch.values]
        equations = branch.equations
        off = np.abs(residuals(equations, q[None])).max() if equations else 0.0
        if max(np.abs([*away, off])) < 1e-7:
            return True
    return False


@pytest.fixture(scope="module")
def thirteen(tmp_path_factory):
    arm = pinsing.load(snake(tmp_path_factory.mktemp("snake"), 13))
    return arm, pinsing.closed_form(arm, seconds=60)


@pytest.mark.slow
def test_thirteen_joints_are_answered(thirteen):
    form = thirteen[1]
    assert len(form.families) == 1
    assert not form.complete
    assert form.word == "not complete"
    assert any("13 joints" in gap and "not shown" in gap for gap in form.gaps)
    family = form.families[0]
    assert family.codimension == 8  # five motions stay
    assert family.real
    assert family.is_reachable
    hint = next(h for h in form.hints if "regular configurations" in h)
    assert hint.startswith("equations of F1")
    assert "drops below 6" in hint
    assert hint in form.to_dict()["hints"]


@pytest.mark.slow
def test_its_points_are_singular_and_others_are_not_on_it(thirteen):
    arm, form = thirteen
    family = form.families[0]
    Q = family.sample(40, np.random.default_rng(1))
    assert Q.shape == (40, 13)
    sigma = pinsing.singular_values(arm, Q)
    assert (sigma[:, 5] / sigma[:, 0]).max() < 1e-10
    assert family.contains(Q).all()
    assert not family.contains(np.random.default_rng(2).uniform(-2, 2, (20, 13))).any()
    near = Q[0] + 1e-3
    found = family.distance(near, seconds=0.2)
    assert 0 <= found.lower <= found.upper < 13**0.5 * 1e-3 * 1.5
    assert family.contains(found.q)


@pytest.mark.slow
def test_which_joints_are_free_and_how_the_rest_follow(thirteen):
    said = thirteen[1].families[0].at_once[0]
    assert len(said.chosen) == 5
    assert len(said.follow) == len(said.steps) == 8
    assert all("two solutions given" in step for step in said.steps)
    assert "2^8 = 256" in said.lines()[-1]
    text = str(pinsing.Family.from_json(thirteen[1].families[0].to_json()).at_once[0].lines())
    assert "can be chosen" in text


@pytest.mark.slow
def test_regular_points_of_the_equations_are_not_the_familys(thirteen):
    """Where five neighbouring axes depend on each other, the equations of both sides hold."""
    arm, form = thirteen
    family = form.families[0]
    thrown = []
    maker = parts_of(arm)[3]
    branch = family.branches[0]
    for _ in range(2):
        thrown.append(maker.thrown(branch, 40))
    points = np.concatenate(thrown)
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
        assert all(on_any(theirs, q) for q in points)
    codimensions = sorted({c.codimension for c in chain.components})
    assert codimensions == sorted({f.codimension for f in families})


def test_two_spherical_groups_make_a_larger_set(tmp_path):
    """Each force along the line of their centres is reciprocal to six joints, not to five."""
    ball = [(90, 0, 0), (-90, 0, 0)]
    links = [(90, 0.3, 0.1), (-90, 0.2, 0.15), (90, 0.15, 0.2), (90, 0.25, 0.1)]
    rows = [*ball, *links, *ball, (0, 0.1, 0.1)]
    arm = pinsing.load(table(tmp_path, "balls", rows))
    chain, maker = long_chain(arm)
    larger = [c for c in chain.components if not c.values and c.codimension == 3]
    assert larger  # codimension 4 is what six axes and three more give
    # Where the six depend on each other in another way, the equations hold as well.
    points = maker.thrown(maker.branch_of({}, larger[0].relations), 60)
    singular = points[maker.ratios(points) < 1e-9]
    assert len(singular) > 4
    J = maker.jacobians(singular)[..., [0, 1, 2, 6, 7, 8]]
    sizes = np.linalg.svd(J, compute_uv=False)
    assert (sizes[:, 4] > 1e-6 * sizes[:, 0]).any()


@pytest.mark.slow
def test_a_joint_that_one_equation_has_alone_is_solved_for_last(thirteen):
    equations = thirteen[1].families[0].branches[0].equations
    order = peeled(equations, np.ones(13, dtype=bool))
    assert order is not None
    assert len(order) == len(equations)
    solved = [step.joint for step in order]
    for k, step in enumerate(order):
        assert not set(step.equation.involved) & set(solved[k + 1 :])


@pytest.mark.slow
def test_points_of_many_equations_come_in_numbers_and_differ(thirteen):
    """What is solved so far goes on with other values of the joints that are not used yet."""
    arm, form = thirteen
    equations = form.families[0].branches[0].equations
    every = np.ones(13, dtype=bool)
    order = peeled(equations, every)
    low = np.full(13, -np.pi)
    q = draw(order, low, -low, every, np.zeros(13), 40, np.random.default_rng(3))
    assert len(q) >= 40
    assert np.abs(residuals(equations, q)).max() < 1e-9
    assert len(np.unique(q[:, 1:-1].round(9), axis=0)) == len(q)  # no copies, end joints aside
    assert len(np.unique(q[:, order[0].joint].round(9))) >= 20
    sigma = pinsing.singular_values(arm, q)
    assert (sigma[:, 5] / sigma[:, 0]).max() < 1e-9


class NoLongProduct(Budget):
    """As one that has little time left, whatever the clock says."""

    def check(self, term_products=0.0):
        self.asked = max(getattr(self, "asked", 0.0), term_products)
        if term_products > 5_000:
            raise BudgetExceeded("too long")


def test_products_of_a_long_jacobian_are_asked_of_the_time(tmp_path):
    rows = [(52 + 7 * i, 0.1 + 0.03 * i, 0.2 - 0.05 * i) for i in range(12)]
    arm = pinsing.load(str(table(tmp_path, "twelve", rows)), task="vx@tip,wz")
    exact = nominal(arm)
    budget = NoLongProduct(1e6)
    ring = ring_of((False,) * 12, constants(exact, arm.task), Budget(1e6))
    with pytest.raises(BudgetExceeded):
        jacobian_matrix(exact, ring, arm.task, budget)
    assert budget.asked < 1e6  # it ends before products that take minutes
    with pytest.raises(BudgetExceeded):
        neighbouring_screws(exact, ring, tuple(range(12)), Budget(-1.0))
    assert len(neighbouring_screws(exact, ring, (0, 1, 2), NoLongProduct(1e6))) == 6
