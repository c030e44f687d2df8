"""Workspaces of 3-joint arms: counts against the inverse solutions, cusps and nodes."""

import math

import numpy as np
import pytest
from dh_arms import dh_arm
from tiers import tiered_rows

import pinsing
from pinsing import plot
from pinsing.errors import OptionError
from pinsing.kinematics.jacobian import task_jacobian, tip_placement
from pinsing.plot.plane import Section, reach_of


def orthogonal(d2, d3, d4, r2, r3=0.0):
    """The arms of Wenger's figures."""
    return dh_arm([(-90, d2, 0), (90, d3, r2), (0, d4, r3)], "position")


LITERATURE = [
    ((1, 2, 1.5, 1), 4, 0, {0, 2, 4}), ((1, 2, 0.2, 1), 0, 0, {0, 2}),
    ((1, 2, 1.5, 0), 0, None, {0, 2, 4}), ((1, 1.5, 0.6, 0.3), 4, 2, {0, 2, 4}),
    ((1, 0.5, 0.7, 0.2), 0, 0, {0, 2, 4}),
]  # fmt: skip
"""Lengths d2, d3, d4, r2; cusps, nodes (None: not said), numbers of solutions."""


@pytest.mark.parametrize(
    ("lengths", "cusps", "nodes", "counts"), tiered_rows(LITERATURE, [LITERATURE[3]])
)
def test_orthogonal_arms_are_as_in_the_literature(lengths, cusps, nodes, counts):
    arm = orthogonal(*lengths)
    found = reach_of(arm, 100, False)
    assert len(found.cusps) == cusps
    assert nodes is None or len(found.nodes) == nodes
    assert set(np.unique(found.count)) == counts
    for q in found.cusp_joints:
        J = task_jacobian(arm, [0.3, *q])
        assert np.linalg.svd(J)[1][-1] < 1e-7
    # Where there is a cusp three solutions meet, so that places near by have four.
    for r, z in found.cusps:
        near = np.hypot(found.r[None, :] - r, found.z[:, None] - z) < 0.4
        assert {2, 4} <= set(np.unique(found.count[near]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rows", "nodes"),
    [(((-90, 0, 0), (90, 1, 0), (0, 1.5, 0.5)), 0), (((-90, 0, 0), (90, 1, 1), (0, 1.5, 0)), 2)],
    ids=["curves on each other", "a curve of one place"],
)
def test_what_only_rounding_crosses_is_no_node(rows, nodes):
    places = reach_of(dh_arm(rows, "position"), 40, False).nodes
    assert len(places) == nodes
    if nodes:
        assert np.sort(places[:, 1]) == pytest.approx([-math.sqrt(1 / 8), math.sqrt(1 / 8)])


def test_counts_are_right_where_joints_end_and_beside_the_first_axis():
    elbow = dh_arm([(90, 0, 0.4), (0, 0.5, 0), (0, 0.4, 0)], "position")
    assert set(np.unique(reach_of(elbow, 133, False).count)) == {0, 4}
    arm = orthogonal(1, 2, 1.5, 1)
    found = reach_of(arm, 21, True)
    row = [len(pinsing.inverse(arm, [r, 0, 0])) for r in found.r]  # z is 0 where joint 2 ends
    assert found.z[10] == pytest.approx(0, abs=1e-12)
    assert found.count[10].tolist() == row


@pytest.mark.slow
@pytest.mark.parametrize("slides", [False, True])
def test_counts_are_those_of_the_inverse_solutions(slides):
    last = (0, 0.1, 0, 0, "prismatic", (0.2, 1.0)) if slides else (0, 0.5, 0.2)
    arm = dh_arm([(-90, 0.3, 0.1), (60, 0.7, 0.25), last], "position")
    found = reach_of(arm, 120, slides)
    rng = np.random.default_rng(3)
    asked = 0
    while asked < 12:
        k, j = int(rng.integers(3, 117)), int(rng.integers(3, 117))
        around = found.count[k - 2 : k + 3, j - 2 : j + 3]
        if around.min() != around.max():
            continue
        asked += 1
        angle = rng.uniform(-3, 3)
        place = Section.of(arm)
        assert place.slides == (False, slides)
        target = [found.r[j] * math.cos(angle), found.r[j] * math.sin(angle), found.z[k]]
        known = pinsing.inverse(arm, target)
        inside = sum(s.within_limits for s in known) if slides else len(known)
        assert inside == found.count[k, j]


def test_the_section_is_the_arm():
    """Places against Pinocchio, and f against det J over the distance from the first axis."""
    arm = orthogonal(1, 2, 1.5, 1, 0.4)
    section = Section.of(arm)
    rng = np.random.default_rng(0)
    shares = []
    for q in rng.uniform(-3, 3, (20, 3)):
        tip = tip_placement(arm, q).translation
        r, z = section.place(q[1:])
        assert math.hypot(tip[0], tip[1]) == pytest.approx(r, abs=1e-12)
        assert tip[2] == pytest.approx(z, abs=1e-12)
        det = float(np.linalg.det(task_jacobian(arm, q))) * arm.length_scale**3
        shares.append(det / float(section.singular(q[1:])))
    assert np.ptp(np.abs(shares)) < 1e-9 * np.abs(shares[0])


@pytest.mark.parametrize("name", ["ur5", "planar3r", "scara"])
def test_other_arms_are_refused(name):
    with pytest.raises(OptionError):
        plot.inverse_count(pinsing.load(name))
