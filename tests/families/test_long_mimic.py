"""Long chains with mimic joints: short equations of the arm's own joints, followers included."""

import itertools
import math
import random

import numpy as np
import pytest
from flint import nmod_mat
from singular_sets import ring_for
from test_closed_form_mimic import finger, follows
from urdf_text import J, Z, frame, urdf

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.jacobian_matrix import NearMinors
from pinsing.families.describe import PieceMaker
from pinsing.families.zero_set import OwnPoints, SearchBox
from pinsing.kinematics.jacobian import ratios, task_jacobians
from pinsing.robot.mimic import own_jacobian_modulo
from pinsing.robot.nominal import PRIMES, nominal

LENGTHS, OFFSETS, TWISTS = (0.2, 0.15, 0.25), (0.1, 0.05), (90, -90)


def chain(joints, follow, slides=(), limit=2.9):
    """A chain of perpendicular axes; ``follow``: joint to leader, multiplier, offset; from 1."""
    made = []
    for i in range(1, joints + 1):
        kind = "prismatic" if i in slides else "revolute"
        at = (LENGTHS[i % 3] if i > 1 else 0, 0, OFFSETS[i % 2])
        rpy = (math.radians(TWISTS[i % 2]) if i > 1 else 0, 0, 0)
        mimic = ""
        if i in follow:
            mimic = '<mimic joint="j{}" multiplier="{}" offset="{}"/>'.format(*follow[i])
        ends = (-limit, limit)
        made.append(J(f"j{i}", f"l{i - 1}", f"l{i}", at, Z, kind, ends, rpy, mimic))
    return pinsing.load(urdf([*made, frame("tip", f"l{joints}", (0.1, 0, 0.1))], "chain"))


@pytest.mark.parametrize(
    ("joints", "follow", "slides"),
    [
        (8, {5: (4, -1, 0.0)}, ()),
        (8, {3: (2, 1, 0.3), 7: (5, 2, 0.0)}, ()),
        (8, {6: (3, 0.5, 0.1), 4: (2, 0, 0.4)}, (3, 6)),
    ],
)
def test_minors_of_own_joints_are_those_of_pinocchios_jacobian(joints, follow, slides):
    arm = chain(joints, follow, slides)
    geometry = nominal(arm)
    ring = ring_for(geometry)
    maker = PieceMaker(geometry, ring, Budget(60), 2e-3)
    minors = NearMinors(geometry, ring, arm.task, 6, Budget(60))
    Q = np.random.default_rng(1).uniform(-2, 2, (12, arm.n))
    J = task_jacobians(geometry.arm, Q)
    windows = [tuple(range(i, i + 6)) for i in range(arm.n - 5)]
    for some in windows:
        minor = minors.minor(some, {})
        mine = maker.equation_of(minor)(Q)
        theirs = np.linalg.det(J[..., list(some)])
        factor = mine[0] / theirs[0]
        assert mine == pytest.approx(factor * theirs, rel=1e-8, abs=1e-9 * np.abs(mine).max())
        assert np.abs(theirs).min() > 1e-9  # regular: nothing is compared with zero


@pytest.mark.parametrize("slides", [(), (3, 4)])
def test_ranks_modulo_a_prime_count_followers(slides):
    arm = chain(8, {4: (3, 1, 0.2), 7: (6, -1, 0.0)}, slides)
    geometry = nominal(arm)
    rows = own_jacobian_modulo(geometry, arm.task, PRIMES[0], random.Random(3), {})
    assert len(rows[0]) == arm.n == 6
    Q = np.random.default_rng(4).uniform(-2, 2, (1, 6))
    J = task_jacobians(geometry.arm, Q)[0]
    for count in (2, 4, 6):
        for some in itertools.combinations(range(6), count):
            flat = [row[j] for row in rows for j in some]
            mine = nmod_mat(6, count, flat, PRIMES[0]).rank()
            assert mine == np.linalg.matrix_rank(J[:, some], tol=1e-9)


def test_ranks_drop_where_a_finger_is_stretched():
    arm = finger(mimic=follows(2, 1)).with_task("vx,vy")
    geometry = nominal(arm)

    def rank(values):
        rows = own_jacobian_modulo(geometry, arm.task, PRIMES[0], random.Random(1), values)
        return nmod_mat(2, 2, [x for row in rows for x in row], PRIMES[0]).rank()

    assert rank({}) == 2
    assert rank({1: (1, 0)}) == 1  # stretched
    assert rank({1: (0, 1)}) == 1  # q2 = q3 = 180 degrees: folded
    assert rank({1: (1, 1)}) == 2


def test_newtons_steps_of_sliders_are_in_metres():
    """The arm's own length is 10 m here: in its units they would be ten times as short."""
    arm = chain(9, {7: (4, 0.5, 0.1)}, (4, 7), limit=2.9)
    own = OwnPoints(arm)
    rng = np.random.default_rng(5)
    free = np.ones(arm.n, dtype=bool)
    q = own.drawn(24, SearchBox(arm.lower, arm.upper, free, np.zeros(arm.n)), rng)
    assert len(q) >= 3
    assert ratios(arm, q).max() < 1e-12
    assert (q >= arm.lower).all()
    assert (q <= arm.upper).all()
    blunt = q + 1e-5 * rng.normal(size=q.shape)
    assert ratios(arm, own.sharpened(blunt, free)).max() < 1e-12


@pytest.mark.slow
def test_thirteen_joints_with_followers_are_stated():
    arm = chain(15, {6: (5, -1, 0.0), 10: (9, 1, 0.0)})
    assert arm.n == 13
    form = pinsing.closed_form(arm, seconds=20)
    assert form.word == "not complete"
    (family,) = form.families
    assert (family.codimension, len(family.at_once[0].follow)) == (8, 8)
    rng = np.random.default_rng(6)
    Q = family.sample(4, rng)
    assert len(Q) == 4
    sigma = pinsing.singular_values(arm, Q)
    assert (sigma[:, 5] / sigma[:, 0]).max() < 1e-9
    assert family.contains(Q).all()
    assert not family.contains(rng.uniform(arm.lower, arm.upper, (20, arm.n))).any()
    near = family.distance(Q[0] + 1e-3)
    assert 0 <= near.lower <= near.upper < 13**0.5 * 1e-3 * 1.5
    assert family.contains(near.q)
