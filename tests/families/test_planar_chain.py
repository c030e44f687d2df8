"""Planar chains of any length: singular where all links are in line, and nowhere else."""

import numpy as np
import pinocchio as pin
import pytest
from arms import place, planar, serial
from tiers import sampled, tiered

import pinsing
from pinsing.kinematics.jacobian import singular_values

LENGTHS = tuple(0.3 + 0.01 * i for i in range(20))
SIZES = [(0.3, 0.1), (0.2, -0.2), (0.1, 0.4), (0.1, 0.1), (0.3, 0.0), (0.2, 0.1), (0.15, 0.3)]


def chain(kinds, task, turn=None, tip=(0.4, 0.0, 0.0), sizes=SIZES):
    """Joints R, P along x, Q along y, r about -z, in a plane that ``turn`` (3, 3) tilts."""
    joints, at = [], place() if turn is None else place((1, 2, 3), turn)
    for kind, (x, y) in zip(kinds, sizes, strict=False):
        axis = {"R": [0, 0, 1], "r": [0, 0, -1], "P": [1, 0, 0], "Q": [0, 1, 0]}[kind]
        make = pin.JointModelRevoluteUnaligned if kind in "Rr" else pin.JointModelPrismaticUnaligned
        joints.append((make(np.array(axis, dtype=float)), at))
        at = place((x, y, 0.1))
    model = serial(joints, at * place(tip), -3, 3, "planar")
    return pinsing.load(model, tip="tip", task=task)


def ratio(arm, q, rank):
    s = singular_values(arm, np.atleast_2d(q))
    return s[:, rank - 1] / (s[:, 0] if rank > 1 else 1.0)  # metres, where it is a single row


def agree(form, arm, rng):
    """Its points are singular, all that a search meets is on it, and it is one set."""
    assert form.complete, form.gaps
    (family,) = form.families
    rank = form.generic_rank
    points = family.points(30, rng)
    assert len(points) == 30
    assert ratio(arm, points, rank).max() < 1e-8
    Q = rng.uniform(-3, 3, (200, arm.n))
    assert ratio(arm, Q, rank).min() > 1e-8
    assert not family.contains(Q).any()
    for branch in family.branches:
        # One condition after the other is left: none of them is idle.
        for skipped in branch.equations:
            q = points[0].copy()
            q[skipped.involved[-1]] += 0.3
            assert ratio(arm, q, rank)[0] > 1e-8
            assert not family.contains(q)
    return family


@pytest.mark.parametrize("n", tiered([6, 7, 9, 12, 13, 20], (6, 7, 13)))
def test_position_of_nr(n, rng):
    arm = planar(LENGTHS[:n])
    form = pinsing.closed_form(arm, prove=False)
    family = agree(form, arm, rng)
    assert (family.codimension, family.text) == (n - 1, f"q2 to q{n} each 0° or 180°")
    assert family.reason.startswith("all links in line: joints 1, 2,")
    assert family.is_reachable
    q = rng.uniform(-1, 1, n)
    near = family.distance(q)
    np.testing.assert_allclose(near.q[1:], 0, atol=1e-9)
    assert near.q[0] == pytest.approx(q[0])
    told = form.system("singular")
    assert all(f"  s{j},\n" in told for j in range(2, n + 1))


@pytest.mark.slow
def test_other_links_in_line(rng):
    """By pose; words of a short one; a tip on the last axis; links of no length join angles."""
    for task in ("vx,vy,wz", "pose"):
        arm = planar(LENGTHS[:9], task=task)
        family = agree(pinsing.closed_form(arm, prove=False), arm, rng)
        assert family.text == "q2 to q8 each 0° or 180°"
        assert family.reason == "links in line: all axes are parallel and lie in one plane"
    (family,) = pinsing.closed_form(planar(LENGTHS[:4]), prove=False).families
    said = "all links in line: joints 1, 2, 3 and 4 move the tip along the same line"
    assert family.reason == said
    arm = planar((0.3, 0.2, 0.25, 0.4, 0.1, 0.2, 0.0))
    family = agree(pinsing.closed_form(arm, prove=False), arm, rng)
    assert family.text == "q2 to q6 each 0° or 180°"
    arm = planar((0.3, 0.2, 0.0, 0.4, 0.1, 0.0, 0.2))
    family = agree(pinsing.closed_form(arm, prove=False), arm, rng)
    involved = {e.involved for b in family.branches for e in b.equations}
    assert (family.codimension, involved) == (4, {(1,), (2, 3), (4,), (5, 6)})


@pytest.mark.parametrize("task", ["position", "pose"])
@pytest.mark.parametrize("tilted", [False, True])
def test_links_that_are_bent_axes_upside_down_and_planes_that_lean(task, tilted, rng):
    turn = pin.rpy.rpyToMatrix(np.pi / 3, np.pi / 2, 0.0) if tilted else None
    arm = chain("RrRRrRR", task, turn)
    agree(pinsing.closed_form(arm, prove=False), arm, rng)


@pytest.mark.parametrize("task", ["position", "pose"])
@pytest.mark.parametrize(
    "kinds",
    sampled(["RPRRRR", "PRRRRR", "RRRPRR", "RRRRRP", "RPPRRRR", "QRRPRRR", "PPRRRRR", "RRPRQRR"]),
)
def test_slides(kinds, task, rng):
    arm = chain(kinds, task)
    agree(pinsing.closed_form(arm, prove=False), arm, rng)


@pytest.mark.parametrize("kinds", ["RPQRRRR", "PQRRRRR", "RRRRRPQ"])
def test_two_ways_to_slide_between_two_axes_are_never_lost(kinds, rng):
    arm = chain(kinds, "position")
    form = pinsing.closed_form(arm, prove=False)
    assert form.complete
    assert not form.families
    assert ratio(arm, rng.uniform(-3, 3, (200, arm.n)), form.generic_rank).min() > 1e-3


@pytest.mark.parametrize("task", ["vx", "vy@tip", "vx,wz", "vy@tip,wz", "vy,wx,wz"])
@pytest.mark.parametrize(
    "kinds", tiered(["RRRRRRR", "RPRrRRR", "QRRPRRR", "RRRRrRP"], ("RPRrRRR",))
)
@pytest.mark.parametrize("tilted", tiered([False, True], {True}))
def test_one_direction_of_the_plane(kinds, task, tilted, rng):
    turn = pin.rpy.rpyToMatrix(0.0, np.pi / 3, 0.0) if tilted else None
    tip = (0.4, 0.0, 0.0) if kinds.endswith("R") else (0.0, 0.4, 0.0)
    arm = chain(kinds, task, turn, tip, [*SIZES[:-1], (0.0, 0.3)])
    form = pinsing.closed_form(arm, prove=False)
    if form.families:
        family = agree(form, arm, rng)
        assert family.codimension > 4
        return
    # A slide, or the last link, that always moves the tip along the direction that counts.
    assert form.complete
    assert "P" in kinds or "Q" in kinds or task.endswith("@tip")
    assert ratio(arm, rng.uniform(-3, 3, (200, arm.n)), form.generic_rank).min() > 1e-6


@pytest.mark.slow
def test_in_one_direction_the_base_or_the_tip_counts_as_a_link():
    arm = chain("RRRRRRR", "vx", sizes=[(0.3, 0.0)] * 7)
    assert pinsing.closed_form(arm, prove=False).families[0].text == "q1 to q7 each 0° or 180°"
    (family,) = pinsing.closed_form(arm.with_task("vx@tip"), prove=False).families
    assert family.text == "q2 to q7 each 0° or 180°"
    sliding = chain("RRQR", "vx@tip", sizes=[(0.3, 0.0)] * 4)
    said = pinsing.at(sliding, [0.3, 0.0, 0.0, 0.0]).dependences[0].reason
    assert said.startswith("joints 1, 2 and 3 move none of the rows vx@tip")
    (family,) = pinsing.closed_form(arm.with_task("vx,wz"), prove=False).families
    assert family.text == "q1 to q6 each 0° or 180°"


def test_chains_that_only_look_planar_are_searched(rng):
    arm = chain("RRRRRP", "vx")
    form = pinsing.closed_form(arm, seconds=1, prove=False)
    assert form.generic_rank == 1
    assert not any("each 0°" in family.text for family in form.families)
