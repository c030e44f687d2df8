"""Rows of a task over a small finite field, every configuration of a slice visited."""

import itertools
import random
from fractions import Fraction

import pytest
from arms import planar
from flint import nmod_mat
from tiers import tiered

import pinsing
from pinsing.families.slices import ModularChain, joints_that_matter
from pinsing.robot.mimic import own_jacobian_modulo
from pinsing.robot.nominal import nominal

TASKS = [
    ("ur5", "vx,vy,vz,wz"), ("stanford", "position"), ("kinova", "tool-axis"),
    ("irb1400", "vx@tip,vy@tip,wz"), ("panda", "vz,wx@tip"), ("xarm7", "orientation"),
]  # fmt: skip


@pytest.mark.parametrize(("robot", "task"), TASKS)
@pytest.mark.parametrize("chosen", tiered([(4,), (1, 3), (2, 5), (0, 4)], {(4,)}))
def test_all_singular_points_of_a_slice_are_met_and_no_others(robot, task, chosen):
    arm, prime = pinsing.load(robot, task=task), 23
    geometry = nominal(arm)
    chain = ModularChain(geometry, arm.task, prime)
    x, y = chain.singular(chosen, random.Random(3))
    draw, values = random.Random(3), [chain.every(j) for j in range(arm.n)]
    at = [draw.randrange(len(v[0])) for v in values]
    expected = set()
    for picked in itertools.product(*(range(len(values[j][0])) for j in chosen)):
        for j, k in zip(chosen, picked, strict=True):
            at[j] = k
        point = [(int(v[0][k]), int(v[1][k])) for v, k in zip(values, at, strict=True)]
        exact = {
            j: tuple(map(Fraction, p[: 1 if slides else 2]))
            for j, (p, slides) in enumerate(zip(point, arm.prismatic, strict=True))
        }
        rows = own_jacobian_modulo(geometry, arm.task, prime, draw, exact)
        if nmod_mat(len(rows), arm.n, [*itertools.chain(*rows)], prime).rank() < len(rows):
            expected.add(tuple(p[0] for p in point) + tuple(p[1] for p in point))
    assert {(*a, *b) for a, b in zip(x.T.tolist(), y.T.tolist(), strict=True)} == expected


def test_slices_with_singular_points_and_lengths_that_are_zero():
    arm = pinsing.load("ur5", task="vx,vy,vz,wz")
    chain = ModularChain(nominal(arm), arm.task, 19)
    draw = random.Random(1)
    assert sum(chain.singular((2, 3, 4), draw)[0].shape[1] for _ in range(3))
    arm = planar((0.19, 0.3), "vx,vy")
    geometry = nominal(arm)
    assert ModularChain(geometry, arm.task, 19).short_everywhere()
    assert not ModularChain(geometry, arm.task, 23).short_everywhere()


@pytest.mark.parametrize(
    ("task", "expected"),
    [
        ("pose", (1, 2, 4)), ("position", (1, 2)), ("vx,vy,vz,wz", (1, 2, 3, 4)),
        ("vx,wz", (0, 1, 2, 3, 4)), ("tool-axis", (1, 2, 4, 5)), ("vx@tip", (1, 2, 3, 4, 5)),
    ],
)  # fmt: skip
def test_joints_that_matter(task, expected):
    arm = pinsing.load("puma560", task=task)  # its tip is where the axes of its wrist meet
    if task == "tool-axis":  # about x: the last joint turns about z
        arm = pinsing.load("puma560", task=task, tool_axis="x")
    assert joints_that_matter(nominal(arm), arm.task) == expected
