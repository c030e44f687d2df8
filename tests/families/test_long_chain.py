"""Chains of any number of joints: families from the axes of neighbours, and planar chains."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
from arms import place, planar, serial
from dh_arms import dh_arm, snake
from singular_sets import ring_for
from tiers import sampled, tiered

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component
from pinsing.algebra.jacobian_matrix import NearMinors
from pinsing.families.describe import PieceMaker
from pinsing.families.long_chain import LongChain, ModularPoints, solving_order
from pinsing.families.zero_set import SearchBox, draw, peeled, system_of
from pinsing.kinematics.jacobian import generic_rank, ratios, singular_values, task_jacobians
from pinsing.robot.nominal import nominal


def maker_of(arm):
    geometry = nominal(arm)
    return PieceMaker(geometry, ring_for(geometry), Budget(60), 2e-3)


def long_chain(arm):
    maker = maker_of(arm)
    geometry = maker.geometry
    rank, ring = generic_rank(geometry.arm), ring_for(geometry)
    return LongChain(geometry, arm.task, rank, ring, maker, Budget(60)), maker


def solved_in_order(steps):
    """None of these (joints of an equation, the one that is solved for) has joints solved later."""
    for k, (involved, _) in enumerate(steps):
        assert not set(involved) & {joint for _, joint in steps[k + 1 :]}


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
def thirteen():
    arm = snake(13)
    return arm, pinsing.closed_form(arm, seconds=60)


@pytest.mark.slow
def test_the_nearest_point_of_equations_that_hold_elsewhere_too_is_singular():
    arm = snake(9)
    (family,) = pinsing.closed_form(arm, prove=False).families
    assert family.confirm is not None
    every = {}, {"weights": np.arange(1.0, 10)}, {"norm": "max"}, {"within_limits": True}
    points = np.random.default_rng(1).uniform(-1, 1, (2, 9))
    for q, options in itertools.product(points, every):
        found = family.distance(q, **options)
        assert ratios(arm, found.q[None])[0] < 1e-9, options
        away = np.abs(found.q - q) * options.get("weights", 1)
        far = away.max() if "norm" in options else np.linalg.norm(away)
        assert found.upper == pytest.approx(far), options
        assert found.lower <= found.upper, options


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
    assert ratios(arm, Q).max() < 1e-10
    assert family.contains(Q).tolist() == [True] * 40
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
    solved_in_order([(step.equation.involved, step.joint) for step in order])
    # What is solved so far goes on with other values of the joints that are not used yet.
    low = np.full(13, -np.pi)
    q = draw(order, SearchBox(low, -low, every, np.zeros(13)), 40, np.random.default_rng(3))
    assert len(q) >= 40
    assert np.abs(system_of(equations).values(q)).max() < 1e-9
    assert len(np.unique(q[:, 1:-1].round(9), axis=0)) == len(q)  # no copies, end joints aside
    assert len(np.unique(q[:, order[0].joint].round(9))) >= 20
    assert ratios(arm, q).max() < 1e-9


@pytest.mark.slow
def test_regular_points_of_the_equations_are_not_the_familys(thirteen):
    """Where five neighbouring axes depend on each other, the equations of both sides hold."""
    arm, form = thirteen
    family = form.families[0]
    maker = maker_of(arm)
    points = np.concatenate([maker.thrown(family.branches[0], 40) for _ in range(2)])
    regular = points[ratios(arm, points) > 1e-3]
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
    assert {c.codimension for c in chain.components} == {f.codimension for f in families}


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


@pytest.fixture(scope="module")
def ten():
    """Ten axes at right angles; and all minors of neighbours."""
    arm = snake(10)
    geometry = nominal(arm)
    ring = ring_for(geometry)
    minors = NearMinors(geometry, ring, arm.task, 6, Budget(60))
    return arm, geometry, ring, [minors.minor(range(i, i + 6), {}) for i in range(5)]


def test_joints_at_values_are_there(ten):
    arm, geometry, ring, minors = ten
    at = {3: (1, 0), 5: (2, 1)}
    put = [ring.strip(ring.putting(at)(m)) for m in minors[:2]]
    points = ModularPoints(geometry, arm.task, ring, 2).points(at, put, 3, Budget(60))
    assert len(points) == 3
    for p in points:
        assert p.on(Component(at, tuple(minors[:2]), False, 4))
        assert not p.on(Component({5: (1, 2)}, (), False, 1))
        assert all(p.is_zero(m) for m in minors[:2])  # before the values were put in, too


def test_no_order_no_points(ten):
    arm, geometry, ring, minors = ten
    order = solving_order(minors, ring)
    assert len({j for _, j in order}) == len(minors)
    solved_in_order([(ring.joints_of(poly), j) for poly, j in order])
    # Three equations in the same two joints: more than joints.
    x, y = ring.variables(2), ring.variables(3)
    gens = ring.context.gens()
    many = [gens[x[0]] * gens[y[0]] + k * gens[x[1]] * gens[y[1]] for k in (2, 3, 5)]
    assert solving_order(many, ring) is None
    assert ModularPoints(geometry, arm.task, ring, 3).points({}, many, 2, Budget(60)) is None


@pytest.mark.slow
def test_a_chain_is_stated_by_them_alone(ten, monkeypatch):
    """No real point is looked for: the general family of ten joints has five equations."""
    monkeypatch.setattr(LongChain, "_by_real_points", lambda self: self._later.clear())
    chain, maker = long_chain(ten[0])
    assert [c.codimension for c in chain.components] == [5]
    points = maker.thrown(maker.branch_of({}, chain.components[0].relations), 40)
    ratio = ratios(maker.geometry.arm, points)
    assert (ratio < 1e-9).sum() >= 3
    assert np.isfinite(ratio).all()


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


def agree(arm, rng):
    """Its form is one set; points of it are singular, and others are not."""
    form = pinsing.closed_form(arm, prove=False)
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
    return form, family


ALONG = "joints 1, 2, 3, 4, 5 and 6 move the tip along the same line"
FLAT = "links in line: all axes are parallel and lie in one plane"
EVEN = [(0.3, 0.0)] * 7
# Arms, what is told of their family, and why it is one.
IN_LINE = {
    **{f"{n}R": (planar(LENGTHS[:n]), f"q2 to q{n}", f"all links in line: {ALONG[:16]}")
       for n in (6, 7, 13, 9, 12, 20)},
    "rows of the plane": (planar(LENGTHS[:9], "vx,vy,wz"), "q2 to q8", FLAT),
    "pose": (planar(LENGTHS[:9], "pose"), "q2 to q8", FLAT),
    "a tip on the last axis": (planar((*LENGTHS[:6], 0.0)), "q2 to q6", ALONG),
    # In one direction the base or the tip counts as a link.
    "vx": (chain("RRRRRRR", "vx", sizes=EVEN), "q1 to q7", FLAT),
    "vx@tip": (chain("RRRRRRR", "vx@tip", sizes=EVEN), "q2 to q7", "links in line: axes 1, 2, 3, "),
    "vx,wz": (chain("RRRRRRR", "vx,wz", sizes=EVEN), "q1 to q6", FLAT),
}  # fmt: skip


@pytest.mark.parametrize("name", tiered(IN_LINE, ("6R", "7R", "13R")))
def test_links_in_line(name, rng):
    arm, joints, reason = IN_LINE[name]
    form, family = agree(arm, rng)
    first, last = (int(joint[1:]) for joint in joints.split(" to "))
    assert (family.text, family.codimension) == (f"{joints} each 0° or 180°", last - first + 1)
    assert family.reason.startswith(reason)
    assert family.is_reachable
    q = rng.uniform(-1, 1, arm.n)
    near = family.distance(q)
    held = np.arange(first - 1, last)
    np.testing.assert_allclose(near.q, np.where(np.isin(range(arm.n), held), 0, q), atol=1e-9)
    told = form.system("singular")
    assert all(f"  s{j + 1},\n" in told for j in held[:-1])


@pytest.mark.slow
def test_links_of_no_length_and_why_joints_move_no_row(rng):
    _, family = agree(planar((0.3, 0.2, 0.0, 0.4, 0.1, 0.0, 0.2)), rng)
    assert family.text == "sin q2 = 0 and sin(q3+q4) = 0 and sin q5 = 0 and sin(q6+q7) = 0"
    said = pinsing.at(chain("RRQR", "vx@tip", sizes=EVEN), [0.3, 0.0, 0.0, 0.0]).dependences[0]
    assert said.reason.startswith("joints 1, 2 and 3 move none of the rows vx@tip")


TILT = pin.rpy.rpyToMatrix(np.pi / 3, np.pi / 2, 0.0)
"""Of the plane of a chain."""
BENT = [("RrRRrRR", turn) for turn in (None, TILT)]
SLIDING = ["RPRRRR", "PRRRRR", "RRRPRR", "RRRRRP", "RPPRRRR", "QRRPRRR", "PPRRRRR", "RRPRQRR"]


@pytest.mark.parametrize("task", ["position", "pose"])
@pytest.mark.parametrize(("kinds", "turn"), [*BENT, *sampled((kinds, None) for kinds in SLIDING)])
def test_bent_links_axes_upside_down_slides_and_planes_that_lean(kinds, turn, task, rng):
    agree(chain(kinds, task, turn), rng)


@pytest.mark.parametrize("kinds", ["RPQRRRR", "PQRRRRR", "RRRRRPQ"])
def test_two_ways_to_slide_between_two_axes_are_never_lost(kinds, rng):
    arm = chain(kinds, "position")
    form = pinsing.closed_form(arm, prove=False)
    assert (form.complete, form.families) == (True, ())
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
        assert agree(arm, rng)[1].codimension > 4
        return
    # A slide, or the last link, that always moves the tip along the direction that counts.
    assert form.complete
    assert "P" in kinds or "Q" in kinds or task.endswith("@tip")
    assert ratio(arm, rng.uniform(-3, 3, (200, arm.n)), form.generic_rank).min() > 1e-6


def test_chains_that_only_look_planar_are_searched(rng):
    arm = chain("RRRRRP", "vx")
    form = pinsing.closed_form(arm, seconds=1, prove=False)
    assert form.generic_rank == 1
    assert not any("each 0°" in family.text for family in form.families)
