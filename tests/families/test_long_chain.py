"""Chains of any number of joints: families from the axes of neighbours, planar ones, mimics.

Of chains with mimic joints, short and long, families follow, or it is said which cannot.
"""

import itertools
import random

import numpy as np
import pinocchio as pin
import pytest
from arms import place, planar, serial
from command_line import run
from dh_arms import dh_arm, snake
from flint import nmod_mat
from singular_sets import RIGHT, check_all, finger, ring_for
from tiers import sampled, tiered, tiered_rows
from urdf_text import ZERO, X, Y, Z, chain_text, follows

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component
from pinsing.algebra.jacobian_matrix import NearMinors
from pinsing.families import closed_form
from pinsing.families.describe import PieceMaker, SolvedPiece, stated
from pinsing.families.long_chain import LongChain, ModularPoints, solving_order
from pinsing.families.zero_set import OwnPoints, SearchBox, draw, peeled, system_of
from pinsing.kinematics.jacobian import generic_rank, ratios, singular_values, task_jacobians
from pinsing.robot.load import load
from pinsing.robot.mimic import NotFollowed, drives, own_jacobian_modulo
from pinsing.robot.nominal import PRIMES, nominal


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


@pytest.fixture(scope="module", params=["alone", "followed"])
def thirteen(request):
    two = {6: (5, -1, 0.0), 10: (9, 1, 0.0)}
    arm = snake(13) if request.param == "alone" else following_chain(15, two)
    return arm, pinsing.closed_form(arm, seconds=20)


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
def test_thirteen_joints_are_answered(thirteen, rng):
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
    Q = family.sample(40, rng)
    assert ratios(arm, Q).max() < 1e-9
    assert family.contains(Q).tolist() == [True] * 40
    assert not family.contains(rng.uniform(-2, 2, (20, 13))).any()
    near = Q[0] + 1e-3
    found = family.distance(near)
    assert 0 <= found.lower <= found.upper < 13**0.5 * 1e-3 * 1.5
    assert family.contains(found.q)
    # Which joints are free, and how the rest follow.
    said = family.at_once[0]
    assert [len(said.chosen), len(said.follow)] == [5, 8]
    assert pinsing.Family.from_json(family.to_json()).at_once[0].lines() == said.lines()
    equations, every = family.branches[0].equations, np.ones(13, dtype=bool)
    order = peeled(equations, every, 2)
    assert len(said.steps) == len(order or ()) == (8 if arm.coupling is None else 0)
    if not order:
        return
    assert all("two solutions given" in step for step in said.steps)
    assert "2^8 = 256" in said.lines()[-1]
    # A joint that one equation has alone is solved for last.
    solved_in_order([(step.equation.involved, step.joint) for step in order])
    # What is solved so far goes on with other values of the joints that are not used yet.
    low = np.full(13, -np.pi)
    q = draw(order, SearchBox(low, -low, every, np.zeros(13)), 40, rng)
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


def test_joints_at_values_alone_are_singular_throughout_or_not_at_all():
    maker = maker_of(arm := load("ur5"))
    maker.confirm = OwnPoints(maker.geometry.arm)
    for at, doubted in (({4: (1, 0)}, False), ({4: (1, 1)}, True)):  # the wrist; 90 degrees
        one = SolvedPiece((maker.branch_of(at, ()),), (), True, 1, Component(at, (), False, 1))
        assert stated([one], maker, arm).also_regular is doubted


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


def following_chain(joints, follow, slides=()):
    """A chain of perpendicular axes; ``follow``: joint to leader, multiplier, offset; from 1."""
    rows = [("prismatic" if 1 in slides else "revolute", (0, 0, 0.05), Z, ZERO)]
    for i in range(2, joints + 1):
        kind = "prismatic" if i in slides else "revolute"
        at, turn = ((0.2, 0.15, 0.25)[i % 3], 0, (0.1, 0.05)[i % 2]), (RIGHT, -RIGHT)[i % 2]
        rows.append((kind, at, Z, (turn, 0, 0), follows(*follow[i]) if i in follow else ""))
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
    arm = following_chain(joints, follow, slides)
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
    arm = following_chain(8, {4: (3, 1, 0.2), 7: (6, -1, 0.0)}, slides)
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
    # A finger: anywhere, stretched, folded as q2 = q3 = 180 degrees, at right angles.
    arm, ranks = finger(mimic=follows(2, 1)).with_task("vx,vy"), []
    for values in ({}, {1: (1, 0)}, {1: (0, 1)}, {1: (1, 1)}):
        rows = own_jacobian_modulo(nominal(arm), arm.task, PRIMES[0], random.Random(1), values)
        ranks.append(nmod_mat(2, 2, [x for row in rows for x in row], PRIMES[0]).rank())
    assert ranks == [2, 1, 1, 2]


def test_newtons_steps_of_sliders_are_in_metres():
    """The arm's own length is 10 m here: in its units they would be ten times as short."""
    arm = following_chain(9, {7: (4, 0.5, 0.1)}, (4, 7))
    own = OwnPoints(arm)
    rng = np.random.default_rng(5)
    free = np.ones(arm.n, dtype=bool)
    q = own.drawn(24, SearchBox(arm.lower, arm.upper, free, np.zeros(arm.n)), rng)
    assert len(q) >= 3
    assert ratios(arm, q).max() < 1e-12
    assert arm.within_limits(q, 0).all()
    blunt = q + 1e-5 * rng.normal(size=q.shape)
    assert ratios(arm, own.sharpened(blunt, free)).max() < 1e-12
