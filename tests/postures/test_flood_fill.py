"""Counts of aspects against a flood fill that shares no code with `pinsing.postures`.

Joints that one equation joins make a group, any other joint that matters is one alone; what the
groups are cut into multiplies. A group is put on a grid; neighbours are joined where no equation
changes its sign and no singular joint value lies between them, and a joint that turns endlessly is
closed to a ring. The grid is made finer until two of them agree; pieces thinner than a cell in
each direction, which a grid tears, do not count. That the equations are all there is to the sign
of the determinant is asked of Pinocchio, at random values of all joints.
"""

import functools
import itertools
import math

import numpy as np
import pinocchio as pin
import pytest
from dh_arms import dh_arm
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from tiers import tiered_rows

import pinsing

ENDLESS_SLIDE = (-3.3, 3.7)
POINTS = {1: (20_000, 50_000), 2: (160, 240, 360, 540), 3: (40, 56, 80, 112)}
"""Cells for each turn of a joint, by the number of joints of a group.

One joint alone is cut finely: two singular values of the Talos arm are 0.14 degrees apart.
"""


@functools.cache
def arm_of(name):
    """One of ``ARMS``."""
    if name.startswith("3R"):
        d2, d3, d4, r2 = (float(x) for x in name[3:].split(","))
        rows = ((-90, d2, 0), (90, d3, r2), (0, d4, 0))
        return dh_arm(rows, "position")
    if name.startswith("leg"):
        return pinsing.load("anymal", tip="LF_FOOT", task="position")
    if name.startswith("solo12"):
        return pinsing.load("solo12", tip="FL_FOOT", task="position")
    return pinsing.load(name)


@functools.cache
def form_of(name):
    return pinsing.closed_form(arm_of(name))


def cuts(form):
    """Equations, and singular values by joint, of the families that can separate."""
    equations, values = [], {}
    for family in form.families:
        if not family.real or family.codimension != 1:
            continue
        for branch in family.branches:
            if branch.equations:
                assert len(branch.equations) == 1
                assert not branch.values
                equations.append(branch.equations[0])
            else:
                (value,) = branch.values
                values.setdefault(value.joint, set()).add(value.value)
    return equations, values


def groups(n, equations, values):
    """Joints that equations join, and those that have singular values."""
    found = [{j} for j in values]
    for equation in equations:
        mine = set(equation.involved)
        for other in [g for g in found if g & mine]:
            mine |= other
            found.remove(other)
        found.append(mine)
    return [sorted(g) for g in found]


def nodes(arm, j, limits, cells):
    """Values of a joint on the grid, and whether the last one is the first, a turn on."""
    low, high = float(arm.lower[j]), float(arm.upper[j])
    ends = math.isfinite(low) and math.isfinite(high)
    if arm.prismatic[j]:
        low, high = (low, high) if limits and ends else ENDLESS_SLIDE
        return np.linspace(low, high, cells + 1)[:-1] + (high - low) / (2 * cells), False
    if limits and ends:
        n = math.ceil(cells * (high - low) / (2 * math.pi))
        return low + (np.arange(n) + 0.5) * (high - low) / n, False
    return -math.pi + 0.0123 + np.arange(cells + 1) * 2 * math.pi / cells, True


def kinds(form, joints, axes):
    """One number for all signs and ranges, for each node of the grid."""
    count = math.ceil(math.prod(map(len, axes)) / 200_000)
    parts = np.array_split(axes[0], count)
    return np.concatenate([slab(form, joints, [x, *axes[1:]]) for x in parts])


def slab(form, joints, axes):
    """The same for some of the grid, so that it has room."""
    equations, values = cuts(form)
    mesh = np.meshgrid(*axes, indexing="ij")
    q = np.zeros((*mesh[0].shape, form.arm.n))
    for j, x in zip(joints, mesh, strict=True):
        q[..., j] = x
    kind = np.zeros(mesh[0].shape, dtype=np.int64)
    for equation in equations:
        if set(equation.involved) <= set(joints):
            value = np.asarray(equation(q))
            assert (value != 0).all()
            kind = 2 * kind + (value > 0)
    for j, x in zip(joints, mesh, strict=True):
        between = np.zeros(x.shape, dtype=np.int64)
        for v in values.get(j, ()):
            below = x > v if form.arm.prismatic[j] else np.floor((x - v) / (2 * math.pi))
            between += np.asarray(below, dtype=np.int64)
        kind = 64 * kind + between + 16
    return kind


def fill(kind, rings):
    """Number of pieces that hold a node with all its neighbours."""
    number = np.arange(kind.size).reshape(kind.shape)
    ends = []
    for axis, ring in enumerate(rings):
        at, sort = np.moveaxis(number, axis, 0), np.moveaxis(kind, axis, 0)
        alike = sort[1:] == sort[:-1]
        ends.append((at[:-1][alike], at[1:][alike]))
        if ring:
            ends.append((at[0].ravel(), at[-1].ravel()))
    near, far = (np.concatenate(side) for side in zip(*ends, strict=True))
    graph = coo_array((np.ones(len(near), dtype=bool), (near, far)), shape=(kind.size,) * 2)
    label = connected_components(graph, directed=False)[1].reshape(kind.shape)
    inner = np.ones(kind.shape, dtype=bool)
    for axis in range(kind.ndim):
        for step in (1, -1):
            shifted = np.roll(kind, step, axis)
            edge = [slice(None)] * kind.ndim
            edge[axis] = 0 if step == 1 else -1
            same = shifted == kind
            same[tuple(edge)] = True
            inner &= same
    return len(np.unique(label[inner]))


def pieces(form, joints, limits):
    """The number on which two grids agree."""
    before = 0
    for cells in POINTS[len(joints)]:
        made = [nodes(form.arm, j, limits, cells) for j in joints]
        kind = kinds(form, joints, [x for x, _ in made])
        found = fill(kind, [ring for _, ring in made])
        if found == before:
            return found
        before = found
    raise AssertionError(f"no two grids agree about joints {joints}")


ARMS = [
    "ur3", "ur5", "ur10", "ur3_limited", "ur5_limited", "puma560", "irb1400", "kinova", "z1",
    "talos_arm", "stanford", "scara", "so100", "so101", "iiwa14", "surgical7", "planar3r",
    "leg of ANYmal", "solo12", "3R 1,2,1.5,1", "3R 1,2,0.2,1", "3R 1,2,1.5,0", "3R 1,1.5,0.6,0.3",
]  # fmt: skip


SQUARE = [*ARMS]
for _name in ("so100", "so101", "iiwa14", "surgical7", "planar3r", "scara"):
    SQUARE.remove(_name)


def sides(form, q):
    """For each family that separates, its sign at q (K, n), whole turns aside."""
    equations, values = cuts(form)
    found = [np.sign(e(q)) for e in equations]
    for j, every in values.items():
        for v in every:
            x = q[:, j] - v
            found.append(np.sign(x if form.arm.prismatic[j] else np.sin(x / 2)))
    return np.array(found).T


@pytest.mark.slow
@pytest.mark.parametrize("name", SQUARE)
def test_the_sign_of_the_determinant_is_that_of_the_families(name):
    """Pinocchio's determinant has one sign where these have one: nothing else separates."""
    form, arm = form_of(name), arm_of(name)
    rng = np.random.default_rng(7)
    low = np.where(arm.prismatic, 0.1, -math.pi)
    high = np.where(arm.prismatic, 1.0, math.pi)
    q = rng.uniform(low, high, (4000, arm.n))
    data = arm.model.createData()
    rows = list(arm.task.rows)
    det = []
    for x in q:
        where = arm.model_q(x)
        J = pin.computeFrameJacobian(
            arm.model, data, where, arm.tip_id, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        det.append(np.linalg.det(J[rows]))
    of_det = np.sign(det)
    known = {}
    for side, sign in zip(map(tuple, sides(form, q)), of_det, strict=True):
        assert known.setdefault(side, sign) == sign
    assert set(known.values()) == {-1.0, 1.0}


@pytest.mark.parametrize(
    ("name", "limits"), tiered_rows(itertools.product(ARMS, (False, True)), [("ur5", False)])
)
def test_a_count_is_that_of_a_flood_fill(name, limits):
    form = form_of(name)
    arm = form.arm
    joined = groups(arm.n, *cuts(form))
    assert all(len(g) <= 3 for g in joined)
    counted = pinsing.aspects(form, limits)
    assert counted.proven
    assert math.prod(pieces(form, g, limits) for g in joined) == counted.lower
