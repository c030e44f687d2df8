"""Cells of joint space: counts of aspects against a flood fill that shares no code with them.

Sections across a joint have the components that boxes find, and a flood fill of their own.
"""

import functools
import itertools
import math

import numpy as np
import pytest
from dh_arms import along, dh_arm
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from singular_sets import terms as equation_of
from tiers import tiered, tiered_rows

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.trig_sum import TrigSum
from pinsing.postures import joint_map
from pinsing.postures.boxes import Ground, Leaves, is_regular, on_boxes, slope, sum_of

# The flood fill. Joints that one equation joins make a group, any other joint that matters is one
# alone; what the groups are cut into multiplies. A group is put on a grid; neighbours are joined
# where no equation changes its sign and no singular joint value lies between them, and a joint
# that turns endlessly is closed to a ring. The grid is made finer until two of them agree; pieces
# thinner than a cell in each direction, which a grid tears, do not count. That the equations are
# all there is to the sign of the determinant is asked of the Jacobian at random configurations.
ENDLESS_SLIDE = (-3.3, 3.7)
POINTS = {1: (20_000, 50_000), 2: (160, 240, 360, 540), 3: (40, 56, 80, 112)}
"""Cells for each turn of a joint, by the number of joints of a group.

One joint alone is cut finely: two singular values of the Talos arm are 0.14 degrees apart.
"""


FEET = {"leg of ANYmal": ("anymal", "LF_FOOT"), "solo12": ("solo12", "FL_FOOT")}


@functools.cache
def arm_of(name):
    """One of ``ARMS``."""
    if name.startswith("3R"):
        d2, d3, d4, r2 = (float(x) for x in name[3:].split(","))
        return dh_arm([(-90, d2, 0), (90, d3, r2), (0, d4, 0)], "position")
    if name in FEET:
        robot, tip = FEET[name]
        return pinsing.load(robot, tip=tip, task="position")
    return pinsing.load(name)


@functools.cache
def form_of(name):
    return pinsing.closed_form(arm_of(name))


def cuts(form):
    """Equations, and singular values by joint, of the families that can separate."""
    equations, values = [], {}
    for family in form.families:
        for branch in family.branches if family.real and family.codimension == 1 else ():
            assert len(branch.equations) + len(branch.values) == 1
            equations += branch.equations
            for value in branch.values:
                values.setdefault(value.joint, set()).add(value.value)
    return equations, values


def groups(equations, values):
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


def codes(form, q, joints):
    """On which side of each family that separates q (..., n) is: signs, and turns past values."""
    equations, values = cuts(form)
    found = [e(q) for e in equations if {*e.involved} <= {*joints}]
    assert all((value != 0).all() for value in found)
    found = [value > 0 for value in found]
    for j in joints:
        for v in values.get(j, ()):
            x = q[..., j] - v
            found.append(x > 0 if form.arm.prismatic[j] else np.floor(x / (2 * math.pi)))
    return np.stack(found, axis=-1).astype(np.int64)


def kinds(form, joints, axes):
    """One number for all of these, for each node of the grid: some nodes at a time."""
    count = math.ceil(math.prod(map(len, axes)) / 200_000)
    found = []
    for part in np.array_split(axes[0], count):
        mesh = np.meshgrid(part, *axes[1:], indexing="ij")
        q = np.zeros((*mesh[0].shape, form.arm.n))
        q[..., joints] = np.stack(mesh, axis=-1)
        code = codes(form, q, joints)
        found.append((code + 2) @ 8 ** np.arange(code.shape[-1]))
    return np.concatenate(found)


def components(kind, rings):
    """A number for each node of a grid, the same for those that are joined over faces."""
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
    return connected_components(graph, directed=False)[1].reshape(kind.shape)


def fill(kind, rings):
    """Number of pieces that hold a node with all its neighbours."""
    cross = {"footprint": ndimage.generate_binary_structure(kind.ndim, 1), "mode": "nearest"}
    inner = ndimage.minimum_filter(kind, **cross) == ndimage.maximum_filter(kind, **cross)
    return len(np.unique(components(kind, rings)[inner]))


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
    "panda", "xarm7", "leg of ANYmal", "solo12",
    "3R 1,2,1.5,1", "3R 1,2,0.2,1", "3R 1,2,1.5,0", "3R 1,1.5,0.6,0.3",
    "3R 0.971,0.798,1.372,0.84",  # singular at values of the elbow alone, where boxes end
]  # fmt: skip
QUICK = [("ur5", False), ("stanford", True), ("panda", True)]
OBLONG = "so100", "so101", "iiwa14", "surgical7", "planar3r", "scara", "panda", "xarm7"


@pytest.mark.parametrize(
    ("name", "limits"), tiered_rows(itertools.product(ARMS, (False, True)), QUICK)
)
def test_a_count_is_that_of_a_flood_fill(name, limits):
    """Each aspect has a number and an example; what is clear of all families is in one of them."""
    arm, form = arm_of(name), form_of(name)
    joined = groups(*cuts(form))
    assert all(len(g) <= 3 for g in joined)
    counted = pinsing.aspects(form, limits)
    assert counted.proven
    assert math.prod(pieces(form, g, limits) for g in joined) == counted.lower == counted.upper
    assert [counted.of(a.q) for a in counted] == list(range(1, counted.lower + 1))
    assert all(a.clearance > 0 for a in counted)
    Q = arm.space.sample(40, np.random.default_rng(5), not limits)
    clear = Q[np.asarray(pinsing.clearance(form, Q).lower) > 0.02]
    assert len(clear) > 10
    within = [counted.of(q) for q in clear]
    assert None not in within
    if name not in OBLONG:
        J = pinsing.kinematics.task_jacobians(arm, clear)
        signs = zip(within, np.sign(np.linalg.det(J)), strict=True)
        assert len({*signs}) == len({*within})


def random_part(rng, d, low, high):
    """A box and R cos(q1 - phi) with random lengths: q1 once in every term."""
    sizes, phase = rng.normal(size=2 + 2 * d), rng.uniform(0, 2 * math.pi, 2 + 2 * d)
    f = np.zeros((2 + 2 * d, d), dtype=np.int64)
    f[:, 0] = 2
    f[range(2, len(f)), rng.integers(1, d, 2 * d)] = 2 * rng.integers(-1, 2, 2 * d)
    e = equation_of(*zip(f, f * 0, sizes * np.cos(phase), sizes * np.sin(phase), strict=True))
    arcs = tuple(joint_map.Arc(float(low[j]), float(high[j])) for j in range(d))
    return joint_map.Part(
        tuple(range(d)), tuple((a,) for a in arcs), (joint_map.Surface("F1", e, True),)
    ), arcs


def flood(terms, low, high, n):
    """Sizes of the components of equal sign on a grid."""
    axes = (np.linspace(a, b, n) for a, b in zip(low, high, strict=True))
    kind = np.sign(terms(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)))
    return np.bincount(components(kind, [False] * kind.ndim).ravel())


@pytest.mark.parametrize("seed", tiered(range(6), (0, 4)))
def test_the_components_are_those_of_boxes_and_of_a_flood_fill(seed):
    rng = np.random.default_rng(seed)
    low = np.array([-rng.uniform(0.5, 6.2), -rng.uniform(1, 3)])
    high = np.array([rng.uniform(0.5, 6.2), rng.uniform(1, 3)])
    part, box = random_part(rng, 2, low, high)
    hub = joint_map.across(part, box)
    assert hub is not None
    found = joint_map.divided(part, box, hub, np.ones(2), Budget(5.0)).found
    terms = sum_of(part.surfaces[0].equation, part.joints)
    whole = joint_map.divided(part, box, None, np.ones(2), Budget(5.0)).found
    assert found.proven
    assert (whole.proven, whole.lower) == (True, found.lower)
    sizes = flood(terms, low, high, 241)
    # A grid may miss a sliver, or tear one; it holds every piece that is larger.
    assert (sizes > 40).sum() <= found.lower <= len(sizes)


def test_a_component_has_points_of_its_sign_and_ways_between_them():
    rng = np.random.default_rng(5)
    low, high = np.array([-4.0, -3.0, -2.0]), np.array([5.0, 3.0, 2.5])
    part, box = random_part(rng, 3, low, high)
    hub = joint_map.across(part, box)
    piece = joint_map.divided(part, box, hub, np.ones(3), Budget(5.0))
    assert piece.found.proven
    terms = sum_of(part.surfaces[0].equation, part.joints)

    def clear(X):
        signs = np.sign(terms(along(X, 60)))
        return bool((signs == signs[0]).all())

    assert piece.found.lower > 1
    for c in range(piece.found.upper):
        x = piece.examples(c)
        assert (np.sign(terms(x)) == piece.signs(c)[0]).all()
        assert ((low <= x) & (x <= high)).all()
        for a, b in zip(x[:8], x[::-1][:8], strict=False):
            assert piece.locate(a, clear) == c
            way = piece.route(a, b, clear)
            assert clear(way)
            assert np.array_equal(way[0], a)
            assert np.allclose(way[-1], b)
            assert ((low - 1e-9 <= way) & (way <= high + 1e-9)).all()


def test_a_saddle_on_a_limit_has_no_largest_value_and_a_hill_has_one():
    """sin q1 sin q2 at its crossing bends both ways; cos q1 cos q2 is largest at 0."""
    f = np.array([[1.0, -1.0], [1.0, 1.0]])
    power = np.zeros((2, 2), dtype=np.int64)
    crossing = TrigSum([0.5, 0.5], [0.0, math.pi], f, power, 1e-12)
    hill = TrigSum([0.5, 0.5], np.zeros(2), f, power, 1e-12)
    x, h = np.zeros((1, 2)), np.full((1, 2), 0.05)
    # Where both joints are at their ends there is no line left to bend along.
    for terms, side, regular in ((crossing, 0.0, True), (hill, 0.0, False), (crossing, 1.0, False)):
        ground = Ground((terms,), x[0], x[0], np.zeros(2, dtype=bool), np.ones(2))
        known, sides = [on_boxes(terms, x, h)], np.full((1, 2), side)
        assert is_regular(ground, known, [0], x, h, sides).all() == regular


def made(frequencies, cos, sin=(0, 0, 0), powers=((0, 0),) * 3):
    return equation_of(*zip(frequencies, powers, cos, sin, strict=False))


def box(equation, low, high, circle=(False, False)):
    terms = sum_of(equation, (0, 1))
    return (Ground((terms,), np.array(low), np.array(high), np.array(circle), np.ones(2)),)


@pytest.mark.parametrize(
    ("equation", "corner", "circle", "count"),
    [
        # cos q1 + cos q2 = 0.5: a closed curve about the origin; inside and outside.
        (made([[2, 0], [0, 2], [0, 0]], [1.0, 1.0, -0.5]), (3.0, 3.0), False, 2),
        # The outside of it in a small box is in four corners.
        (made([[2, 0], [0, 2], [0, 0]], [1.0, 1.0, -1.5]), (1.0, 1.0), False, 5),
        # Circles join what a box cuts: cos q1.
        (made([[2, 0]], [1.0]), (3.14, 1.0), False, 3),
        (made([[2, 0]], [1.0]), (np.pi, 1.0), True, 2),
        # A half angle has no sign round a circle: cos(q1 / 2) has one zero a turn.
        (made([[1, 0]], [1.0]), (np.pi, 1.0), True, 1),
    ],
)
def test_counts_of_pieces(equation, corner, circle, count):
    low = [-x for x in corner]
    found = joint_map.subdivide(box(equation, low, corner, (circle, False)), Budget(5.0))
    assert found.proven
    assert found.lower == count


def test_a_crossing_of_sheets_is_not_proven():
    # cos q1 = cos q2, as one equation: two lines that cross.
    e = made([[2, 0], [0, 2]], [1.0, -1.0])
    found = joint_map.subdivide(box(e, [-1.0, -1.0], [1.1, 1.2]), Budget(0.3))
    assert not found.proven
    assert found.lower <= 4


def test_small_boxes_of_many_joints_are_told_apart():
    index = np.array([[0, 0, 0, 0], [0, 0, 0, 2**17 - 2]])  # one integer of them overflows
    level = np.full(2, 14)
    leaves = Leaves(level, index, np.zeros((2, 1, 1), int), np.ones(2, bool))
    assert leaves.find(level, index).tolist() == [0, 1]
    assert leaves.find(level[:1], np.array([[2**13, 0, 0, 0]])).tolist() == [-1]


def test_bounds_hold():
    """Value and slope on random boxes are within what is said of them; lengths, too."""
    rng = np.random.default_rng(0)
    slides = made([[2, 0], [0, 0], [4, 0]], [1.0, -0.3, 0.2], [0.4, 0.0, -0.1],
                  [[0, 2], [0, 1], [0, 3]])  # fmt: skip
    arms = [e for n in ("ur5", "puma560") for f in form_of(n).families for e in f.equations]
    for e in (*arms, slides):
        joints = [*e.involved]
        terms, d = sum_of(e, e.involved), len(joints)
        x, h = rng.uniform(-2, 2, (200, d)), rng.uniform(0, 0.4, (200, d))
        known, v = on_boxes(terms, x, h), rng.normal(size=(200, d))
        rise, error = slope(terms, x, h, v)

        def full(y, e=e, joints=joints):
            q = np.zeros((len(y), len(e.joints)))
            q[:, joints] = y
            return q

        np.testing.assert_allclose(known.value, e(full(x)), atol=1e-12)
        np.testing.assert_allclose(known.gradient, e.gradient(full(x))[:, joints], atol=1e-12)
        for _ in range(50):
            y = x + h * rng.uniform(-1, 1, x.shape)
            assert (np.abs(e(full(y)) - known.value) <= known.swing).all()
            along = np.einsum("nd,nd->n", e.gradient(full(y))[:, joints], v)
            assert (np.abs(along - rise) <= error + 1e-12).all()
