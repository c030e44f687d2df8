"""Chains with mimic joints, short and long: closed forms follow them, or say which they cannot."""

import itertools
import math
import random

import numpy as np
import pytest
from command_line import run
from flint import nmod_mat
from singular_sets import check_all, finger, ring_for
from tiers import tiered_rows
from urdf_text import ZERO, X, Y, Z, chain_text, follows

from pinsing.algebra.budget import Budget
from pinsing.algebra.jacobian_matrix import NearMinors
from pinsing.families import closed_form
from pinsing.families.describe import PieceMaker
from pinsing.families.zero_set import OwnPoints, SearchBox
from pinsing.kinematics.jacobian import ratios, task_jacobians
from pinsing.robot.load import load
from pinsing.robot.mimic import NotFollowed, drives, own_jacobian_modulo
from pinsing.robot.nominal import PRIMES, nominal

TOOL = ("fixed", (0.3, 0, 0))
FOLLOWING = [
    (1, 0.0), (-1, 0.0), (2, 0.0), (-2, 0.0), (3, 0.5), (-1, 0.3), (1, np.pi / 4), (0, 0.7),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("multiplier", "offset"), tiered_rows(FOLLOWING, FOLLOWING[1:5:3]))
def test_a_planar_finger(multiplier, offset):
    """The last of three parallel axes is a multiple of the second."""
    arm = finger(mimic=follows(2, multiplier, offset))
    assert arm.n == 2
    form = closed_form(arm)
    on = check_all(arm, form)
    assert on > 20 or not form.families
    # By hand: the tip's lever about joint 1, crossed with its velocity by joint 2.
    m, o = multiplier, offset
    a = np.linspace(-3, 3, 4000)
    tip = 0.4 * np.exp(1j * a) + 0.3 * np.exp(1j * ((1 + m) * a + o))
    rate = 1j * (0.4 * np.exp(1j * a) + 0.3 * (1 + m) * np.exp(1j * ((1 + m) * a + o)))
    area = np.imag(np.conj(1j * (0.5 + tip)) * rate)
    crossings = int((np.diff(np.sign(area)) != 0).sum())
    roots = {round(v.value, 6) for f in form.families for b in f.branches for v in b.values}
    inside = [r for r in roots if abs(r) < 3]
    assert len(inside) == crossings
    assert np.allclose(np.interp(inside, a, area), 0, atol=1e-3)


@pytest.mark.slow
def test_a_wrist_that_is_driven_from_the_elbow():
    """Axes in space, a placement that turns about the axis, and an offset of a quarter turn."""
    rows = [
        ("revolute", (0, 0, 0.3), Z, (0, 0, 0.4)), ("revolute", ZERO, Y),
        ("revolute", (0.4, 0, 0), Y, (0, 0.2, 0)),
        ("revolute", (0.3, 0, 0), Y, ZERO, follows(3, -1, np.pi / 2)),
        ("revolute", (0.1, 0, 0.02), X, (0.3, 0, 0)), TOOL,
    ]  # fmt: skip
    arm = load(chain_text(rows), task="position")
    assert arm.n == 4
    assert check_all(arm, closed_form(arm)) > 20


def test_two_slides_that_open_together():
    rows = [("revolute", ZERO), ("prismatic", (0.2, 0, 0), X)]
    rows += [("prismatic", (0.1, 0, 0), X, ZERO, follows(2, 0.5, 0.02)), TOOL]
    arm = load(chain_text(rows), task="vx,vy")
    form = closed_form(arm)
    # Rank drops where the tip is on the axis: 0.6 + d + 0.5 d + 0.02 = 0.
    ((branch,),) = (f.branches for f in form.families)
    assert [v.value for v in branch.values] == pytest.approx([-0.62 / 1.5])
    check_all(arm, form)


@pytest.mark.parametrize(
    ("kind", "mimic", "said"),
    [
        ("revolute", follows(2, 0.5), "small integer"),
        ("revolute", follows(2, -0.25), "'j2' follows 'j3' by -4 instead"),
        ("revolute", follows(2, 1.5), "1.5, which is not a small integer$"),
        ("revolute", follows(2, 12), "small integer"),
        ("revolute", follows(2, 0.33333), "no simple ratio"),
        ("prismatic", follows(2, 0.5), "slides with a turn"),
    ],
)
def test_what_is_not_followed_is_said(kind, mimic, said):
    arm = finger(kind, mimic)
    form = closed_form(arm)
    assert (form.complete, form.families) == (False, ())
    for words in ("j3", said.rstrip("$"), "`pinsing analyze`"):
        assert words in form.gaps[0]
    with pytest.raises(NotFollowed, match=said):
        drives(nominal(arm))


@pytest.mark.parametrize("angle", [np.pi / 3, 1.0])
def test_an_offset_is_exact_or_said(angle):
    rows = [("revolute", ZERO), ("revolute", (0.5, 0, 0), Z, ZERO, follows(1, 1, angle)), TOOL]
    (_, drive), snaps = drives(nominal(load(chain_text(rows), task="position")))
    turn = [float(x) for x in drive.turn]
    assert turn == pytest.approx([np.cos(angle), np.sin(angle)], abs=1e-11)
    assert sum(x * x for x in drive.turn) == 1
    assert snaps == () or angle == 1.0
    assert all(s.size < 1e-11 for s in snaps)


def test_a_trajectory_across_a_family_gets_its_verdict(tmp_path):
    (tmp_path / "coupled.urdf").write_text(finger(mimic=follows(2, 1)).source.xml)
    (tmp_path / "a.csv").write_text("j1,j2\n0,-0.5\n0,0.5\n")
    arm, path = str(tmp_path / "coupled.urdf"), str(tmp_path / "a.csv")
    done = run("check", arm, path, "--task", "vx,vy")
    assert done.exit_code == 0, done.stderr
    assert "Keep away from F1, at sample 0.5; other postures are not" in done.stdout


LENGTHS, OFFSETS, TWISTS = (0.2, 0.15, 0.25), (0.1, 0.05), (90, -90)


def chain(joints, follow, slides=()):
    """A chain of perpendicular axes; ``follow``: joint to leader, multiplier, offset; from 1."""
    rows = []
    for i in range(1, joints + 1):
        kind = "prismatic" if i in slides else "revolute"
        at = (LENGTHS[i % 3] if i > 1 else 0, 0, OFFSETS[i % 2])
        rpy = (math.radians(TWISTS[i % 2]) if i > 1 else 0, 0, 0)
        rows.append((kind, at, Z, rpy, follows(*follow[i]) if i in follow else ""))
    return load(chain_text([*rows, ("fixed", (0.1, 0, 0.1))], (-2.9, 2.9)))


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
    for i in range(arm.n - 5):
        mine = maker.equation_of(minors.minor(range(i, i + 6), {}))(Q)
        theirs = np.linalg.det(J[..., i : i + 6])
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
    arm = chain(9, {7: (4, 0.5, 0.1)}, (4, 7))
    own = OwnPoints(arm)
    rng = np.random.default_rng(5)
    free = np.ones(arm.n, dtype=bool)
    q = own.drawn(24, SearchBox(arm.lower, arm.upper, free, np.zeros(arm.n)), rng)
    assert len(q) >= 3
    assert ratios(arm, q).max() < 1e-12
    assert arm.within_limits(q, 0).all()
    blunt = q + 1e-5 * rng.normal(size=q.shape)
    assert ratios(arm, own.sharpened(blunt, free)).max() < 1e-12


@pytest.mark.slow
def test_thirteen_joints_with_followers_are_stated():
    arm = chain(15, {6: (5, -1, 0.0), 10: (9, 1, 0.0)})
    assert arm.n == 13
    form = closed_form(arm, seconds=20)
    assert form.word == "not complete"
    (family,) = form.families
    assert (family.codimension, len(family.at_once[0].follow)) == (8, 8)
    rng = np.random.default_rng(6)
    Q = family.sample(4, rng)
    assert ratios(arm, Q).max() < 1e-9
    assert family.contains(Q).tolist() == [True] * 4
    assert not family.contains(rng.uniform(arm.lower, arm.upper, (20, arm.n))).any()
    near = family.distance(Q[0] + 1e-3)
    assert 0 <= near.lower <= near.upper < 13**0.5 * 1e-3 * 1.5
    assert family.contains(near.q)
