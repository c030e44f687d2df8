"""Systems of equations: values, slopes, and points of their zero sets."""

from dataclasses import replace

import numpy as np
import pytest
from tiers import tiered_rows

from pinsing.algebra.conditions import Branch
from pinsing.algebra.equation import equation
from pinsing.algebra.ring import make_ring
from pinsing.families import closed_form
from pinsing.families.nearness import Starts
from pinsing.families.zero_set import System, fix_joint, project, search
from pinsing.robot.joint_space import JointSpace
from pinsing.robot.load import load


def system(name, **options):
    form = closed_form(load(name, **options), seconds=30)
    family = max(form.families, key=lambda f: len(f.branches[0].equations))
    return family.branches[0].equations


CASES = [("g1", {"tip": "left_rubber_hand", "base": "torso_link"}), ("so101", {})]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "options"), tiered_rows(CASES, CASES[1:]))
def test_values_and_slopes(name, options, rng):
    equations = system(name, **options)
    together = System(equations)
    Q = rng.uniform(-2, 2, (7, equations[0].frequencies.shape[1]))
    apart = np.stack([e(Q) / e.unit for e in equations], axis=-1)
    assert np.abs(together.values(Q) - apart).max() < 1e-13
    slopes = np.stack([e.gradient(Q) / e.unit for e in equations], axis=-2)
    assert np.abs(together.gradients(Q) - slopes).max() < 1e-12
    h = 1e-6
    for j in range(Q.shape[1]):
        step = np.zeros(Q.shape[1])
        step[j] = h
        difference = (together.values(Q + step) - together.values(Q - step)) / (2 * h)
        assert np.abs(together.gradients(Q)[..., j] - difference).max() < 1e-8


@pytest.mark.slow
def test_an_equation_that_all_but_cancels_says_how_accurate_it_is(rng):
    equations = system("g1", tip="left_rubber_hand", base="torso_link")
    e = equations[0]
    n, joint = e.frequencies.shape[1], e.involved[0]
    fixed = fix_joint(e, joint, 0.7)
    assert e.accuracy <= fixed.accuracy < 1e-13
    Q = rng.uniform(-2, 2, (5, n))
    Q[:, joint] = 0.7
    assert fixed(Q) == pytest.approx(e(Q), abs=1e-12 * e.size)
    small = e.scaled(1.0)
    assert small.unit == small.size
    assert replace(e, accuracy=1e-11).unit == pytest.approx(1e3 * e.size)
    low, high, free = np.full(n, -1.5), np.full(n, 1.5), np.arange(n) > 0
    Q = search(equations, low, high, free, np.full(n, 0.25), 20, rng)
    assert len(Q) == 20
    assert (Q[:, 0] == 0.25).all()
    assert (np.abs(Q) <= 1.5 + 1e-9).all()
    assert np.abs(System(equations).values(Q)).max() < 1e-12
    again, ok = project(equations, Q, free)
    assert ok.all()
    assert np.abs(again - Q).max() < 1e-9


def test_a_small_residual_is_not_yet_on_the_set(rng):
    """1 - cos q1 is 5e-9 at 1e-4: singular points of another set, where a family was, passed."""

    class Near:
        touching = False

        def __call__(self, points):
            return np.ones(len(points), dtype=bool)

        def drawn(self, starts, free, box):
            return np.where(np.arange(2) == 0, 1e-4, starts)

    ring = make_ring((False, False))
    _, y, *_ = ring.context.gens()
    branch = Branch((), (equation(2 * y**2, ring, ("q1", "q2"), np.zeros(2)),))
    high = np.full(2, np.pi)
    space = JointSpace(("q1", "q2"), np.zeros(2, dtype=bool), -high, high, 1.0)
    starts = Starts([(branch, np.zeros(2))], space, -high, high, False)
    q = starts.own(Near(), 10, rng, None)
    assert len(q) == 10
    assert np.abs(q[:, 0]).max() < 2e-5


@pytest.mark.slow
def test_points_of_a_long_chain_are_on_its_family():
    """Singular points of another set nearby, where residuals were small, passed for its own."""
    form = closed_form(load("iiwa14", task="vx,vy,wz"), seconds=4)
    for family in form.families:
        for seed in range(4):
            assert family.contains(family.sample(40, np.random.default_rng(seed))).all()
