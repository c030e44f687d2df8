"""What is stated is the exact components and their real points: checked, and by other oracles.

Finite fields and real points know nothing of the search.
"""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from public import script
from singular_sets import RIGHT, Joint, build, iiwa_with_offset, ring_for
from tiers import tiered, tiered_rows
from urdf_text import X, Y, Z, chain_text

from pinsing.algebra.budget import Budget
from pinsing.algebra.components import decompose
from pinsing.algebra.jacobian_matrix import corner
from pinsing.algebra.real_roots import (
    NotFinite,
    changes_sign,
    isolated_zeros,
    real_solutions,
    semidefinite,
)
from pinsing.algebra.ring import make_ring
from pinsing.families import closed_form, describe
from pinsing.families.faithful import disagreements
from pinsing.families.form import families_text
from pinsing.kinematics.jacobian import ratios
from pinsing.postures import aspects
from pinsing.robot.load import load
from pinsing.robot.surd import cosine
from pinsing.robot.task import parse_task
from pinsing.sampling.analyze import analysis_text, analyze
from pinsing.sampling.sweeps import sweep

EVEN = [(0, 0, 0.2, 0), (0, 0, 0.2, -90), (0, 0, 0.2, 90), (0, 0, 0, 0)]
"""Links alike: all of q3 = 180° is singular, and of q3 = 0 what has q2 = 0 or 180°."""


oracle, field, chains = (script(f"oracle.{name}") for name in ("run", "field", "chains"))


def spec_of(rows, task="pose"):
    return chains.Spec(tuple(chains.Row(*row) for row in rows), task)


def chain(rows, task="pose"):
    return chains.arm_of(spec_of(rows, task))


def on_no_family(form, **degrees):
    """How many of 40 singular points with joints at values lie on no family, and of how many."""
    q = np.random.default_rng(0).uniform(-3, 3, (40, len(form.symbols)))
    for name, value in degrees.items():
        q[:, int(name[1:]) - 1] = math.radians(value)
    q = q[ratios(form.loaded, q) < 1e-12]
    return sum(form.family_of(x) is None for x in q), len(q)


SYMMETRIC = [(0, 0.4, 0, 90), (-90, 0, 0.3, -90), *[(0, 0.25, 0.2, 180)] * 2, (-90, 0, 0.3, -90)]
SYMMETRIC += [(0, 0.4, 0, 90)]
THIRD = 2 * math.degrees(math.atan(1 / 3))
HELD = {
    # 0 was taken for 180 degrees, and a component dropped as a part of q3 = 180 degrees.
    "a rational value": (EVEN, "pose", [{"q2": 0, "q3": 0}, {"q2": 180, "q3": 0}, {"q3": 180}]),
    # sin q3 = 0 was solved as q3 = 0.
    "a product": (
        SYMMETRIC, "vx,vy,vz,wz",
        [{"q3": q3, "q4": 0, "q5": q5} for q3 in (0, 180) for q5 in (THIRD, THIRD - 180)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", tiered(HELD, {"a rational value"}))
def test_no_value_of_a_joint_is_lost(name):
    rows, task, values = HELD[name]
    form = closed_form(chain(rows, task), seconds=60, prove=False)
    assert form.complete, form.gaps
    assert [on_no_family(form, **degrees) for degrees in values] == [(0, 40)] * len(values)


@pytest.mark.slow
def test_what_is_nearly_zero_is_no_error():
    """An equation is 1e-11 of its terms at a joint value without singular configurations."""
    a, d = (0, 0, 0.0825, -0.0835, 0, 0.088, 0), (0.333, 0, 0.316, 0, 0.384, 0, 0.107)
    alpha = (-90, 90, 90, -90, 90, 90, 0)
    form = closed_form(chain([(0, *row) for row in zip(d, a, alpha, strict=True)]))
    assert (form.word, len(form.families)) == ("proven", 4)


def test_a_value_read_wrongly_is_no_complete_answer(monkeypatch):
    real = describe.PieceMaker._at_exact_values

    def at_half_a_turn(self, branch, components):
        held = [replace(v, exact=(0, 1)) if v.joint == 2 else v for v in branch.values]
        return real(self, replace(branch, values=tuple(held)), components)

    monkeypatch.setattr(describe.PieceMaker, "_at_exact_values", at_half_a_turn)
    form = closed_form(chain(EVEN), seconds=60, prove=True)
    assert not form.complete
    assert "on no family that is stated" in " ".join(form.gaps)


TOLD = [("ur5", "pose"), ("puma560", "position"), ("panda", "pose")]


@pytest.mark.parametrize(("name", "task"), tiered_rows(TOLD, TOLD[:2]))
def test_a_branch_that_is_missing_or_another_is_told(name, task):
    form = closed_form(load(name, task=task), seconds=60)
    geometry = form.geometry
    ring = ring_for(geometry)

    def said(families):
        return disagreements(families, form.left_out, ring, geometry, form.symbols)

    assert said(form.families) == []
    for i, family in enumerate(form.families):
        others = [*form.families[:i], *form.families[i + 1 :]]
        for k, branch in enumerate(family.branches):
            less = family.branches[:k] + family.branches[k + 1 :]
            assert said([*others, replace(family, branches=less)])
            if branch.values:
                first = branch.values[0]
                moved = replace(first, value=first.value + 0.3)
                wrong = replace(branch, values=(moved, *branch.values[1:]))
            else:
                e = branch.equations[0]
                off = e.cos + np.where(np.arange(len(e.cos)) == 0, 1e-3, 0.0)
                wrong = replace(branch, equations=(replace(e, cos=off), *branch.equations[1:]))
            assert said([*others, replace(family, branches=(*less, wrong))])


def test_isolated_zeros_of_a_touching_equation_are_held_against_it():
    """3 + cos q1 + cos q2 ... has none; 2 + cos q1 + cos q2 one, at which its slope is zero."""
    ring = make_ring((False, False))
    x, y, u, v = ring.context.gens()
    poly = 4 * x**2 * u**2 + 2 * x**2 * v**2 + 2 * y**2 * u**2
    form = closed_form(chain([(0, 0, 0.2, 0), (0, 0, 0.2, 0)], "position"))
    component = replace(form.families[0].components[0], values={}, relations=(poly,), codimension=1)
    at = ring, form.geometry, form.symbols
    (found,) = disagreements([], [component], *at)
    assert "on no family that is stated" in found
    empty = replace(component, relations=(poly + x**2 * u**2 + y**2 * v**2,))
    assert disagreements([], [empty], *at) == []


@pytest.mark.slow
def test_joint_values_that_depend_on_each_other_are_stated_exactly():
    arm = iiwa_with_offset()
    form = closed_form(arm)
    assert form.complete, form.gaps
    family = next(f for f in form.families if set(f.joints) == {"joint_a2", "joint_a4"})
    found = sorted(tuple(np.degrees([v[1], v[3]])) for v in family.values)
    expected = [(0.0305, 0.0625), (1.2498, 179.9375), (178.7502, 179.9375), (179.9695, 0.0625)]
    np.testing.assert_allclose(found, expected, atol=6e-5)
    lines = {v.minimal for b in family.branches for v in b.values if v.joint == 3}
    assert lines == {(5453, -10_000_000, 5453)}
    rng = np.random.default_rng(1)
    q = family.points(40, rng)
    assert ratios(form.geometry.arm, q).max() < 1e-13
    for q2, q4 in ((found[0][0], found[1][1]), (found[1][0], found[0][1])):  # roots that do not fit
        q[:, 1], q[:, 3] = math.radians(q2), math.radians(q4)
        assert ratios(form.geometry.arm, q).min() > 1e-9
    assert any("snap-length 0.001" in line for line in form.hints)


@pytest.mark.slow
def test_an_equation_with_a_single_real_point_is_no_surface():
    """0.3 cos q2 + 0.2 cos(q2+q3) + 0.5 is zero at q2 = 180, q3 = 0 only, which q3 = 0 holds."""

    def found(first, *others, tip):
        rows = [Joint(d=0.4), Joint(alpha=RIGHT, a=first), *(Joint(a=a) for a in others)]
        form = closed_form(build(rows, tip=(tip, 0, 0), task="position"))
        assert form.complete
        return form, [f.text for f in form.families]

    form, texts = found(0.5, 0.3, tip=0.2)
    assert (form.dropped, texts) == (1, ["q3 = 0° or 180°"])
    # A little longer, and the surface is there.
    form, _ = found(0.4, 0.3, tip=0.2)
    assert [f.codimension for f in form.families] == [1, 1]
    # A little shorter, and it is not.
    assert len(found(0.6, 0.3, tip=0.2)[1]) == 1
    form, texts = found(0.6, 0.3, 0.2, tip=0.1)
    assert (form.dropped, texts) == (1, ["q3 = 0° or 180° and q4 = 0° or 180°"])
    assert form.family_of([0.3, math.pi, 0, 0]) is not None
    assert form.family_of([0.3, 3.0, 0.1, 0.2]) is None


def test_finite_systems():
    ring = make_ring((False, False, False))
    x1, y1, x2, y2, *_ = ring.context.gens()
    time = Budget(30.0)
    circle = y1**2 * x2**2 + y2**2 * x1**2 - 5 * x1**2 * x2**2  # t1^2 + t2^2 = 5
    product = y1 * y2 - 2 * x1 * x2  # t1 t2 = 2
    found = real_solutions([circle, product], ring, time)
    tangents = sorted((float(s[0].ball), float(s[1].ball)) for s in found)
    assert tangents == [(-2, -1), (-1, -2), (1, 2), (2, 1)]
    assert all(v.exact(False) is not None for s in found for v in s.values())
    golden = y1**2 - x1 * y1 - x1**2
    found = real_solutions([golden, y1 * x2 - x1 * y2 * 3], ring, time)
    assert (len(found), {s[0].minimal for s in found}) == (2, {(-1, -1, 1)})
    assert not real_solutions([circle, y1 * y2 - 3 * x1 * x2], ring, time)  # complex only
    assert not real_solutions([golden, y1 - 2 * x1], ring, time)
    # x = 0 is an angle as good as any other.
    (both,) = real_solutions([x1, x2], ring, time)
    assert both[0].angle() == both[1].angle() == math.pi
    with pytest.raises(NotFinite):
        real_solutions([product], ring, time)
    # Double zeros count once.
    (once,) = real_solutions([(y1 - x1) ** 2, (y2 * x1 - y1 * x2) ** 2], ring, time)
    assert float(once[1].ball) == 1.0
    root = cosine(3)  # sqrt(2) / 2
    ring = make_ring((False, False), [root], Budget(30.0))
    x1, y1, x2, y2, *_ = ring.context.gens()
    p = ring.reduce(y1 - ring.number(root) * x1)
    (found,) = real_solutions([p, y2 * x1 - y1 * x2], ring, time)
    assert float(found[1].ball) == pytest.approx(math.sqrt(0.5))


def test_signs():
    ring = make_ring((False, False, False))
    x1, y1, x2, y2, *_ = ring.context.gens()
    time = Budget(30.0)
    assert changes_sign(y1 * x2 - 2 * x1 * y2, ring)
    square = (y1 * x2 - 2 * x1 * y2) ** 2
    sum_of_squares = square + (y1 - x1) ** 2 * (x2**2 + y2**2)
    assert not changes_sign(sum_of_squares, ring)
    assert semidefinite(sum_of_squares, ring, time)
    (zero,) = isolated_zeros(sum_of_squares, ring, time)
    assert (float(zero[0].ball), float(zero[1].ball)) == (1.0, 0.5)
    hidden = sum_of_squares * 1000 - (x1**2 + y1**2) * (x2**2 + y2**2)  # negative nearby
    assert not semidefinite(hidden, ring, time)


def test_boundary_or_interior_is_said_of_each_piece():
    """The stretched arm is at the boundary of its workspace, the folded one is not."""
    form = closed_form(load("planar3r", task="position"))
    (family,) = form.families
    assert family.kind == "varies"
    boundary, interior = family.kinds
    assert (boundary.kind, boundary.where) == ("boundary", "q2 = 0° and q3 = 0°")
    assert interior.kind == "interior"
    text = families_text(form)
    assert "boundary at q2 = 0" in text.replace("\u00a0", " ")
    puma = closed_form(load("puma560"))
    assert [f.kind for f in puma.families] == ["boundary", "interior", "boundary"]


def test_a_rounded_limit_is_met():
    """Limits of 1.570796325, 1.8e-9 short of 90 degrees, as a published PUMA has them."""

    def arm(theta, upper, task="orientation"):
        second = Joint(alpha=RIGHT, theta=theta, limits=(0.1, upper))
        return build([Joint(d=0.4), second, Joint(alpha=-RIGHT, a=0.3)], task=task)

    cases = (0, 1.570796325), (RIGHT, 1.570796325), (RIGHT, 1.5)  # the last is 4 degrees short
    forms = [closed_form(arm(*case)) for case in cases]
    (plain,), (family,), (beyond,) = (form.families for form in forms)
    assert plain.text == "q2 = 0° or 180°"
    assert (family.text, family.reachability) == ("q2 = ±90°", "at the joint limit")
    assert family.is_reachable
    for words in ("1.570796327", "1.570796325", "1.8e-09"):
        assert words in family.limits_met[0]
    assert beyond.reachability == "not reachable"
    values = sweep(arm(*cases[0], "pose"), levels=1, samples=20).plan.effects[1].special
    assert np.isclose(values, RIGHT, atol=1e-8).any()


def test_an_analysis_gives_what_it_has_when_the_time_is_up():
    arm = load("iiwa14")
    found = analyze(arm, seconds=0.01)
    assert found.missing
    assert "time of 0.01 s was up" in analysis_text(found).replace("\u00a0", " ")


def test_ctrl_c_keeps_the_closed_forms(monkeypatch):
    def interrupted(*args: object, **rest: object) -> None:
        raise KeyboardInterrupt

    module = sys.modules["pinsing.sampling.analyze"]
    monkeypatch.setattr(module, "singular_configurations", interrupted)
    found = analyze(load("stanford"), seconds=120.0)
    assert len(found.families) == 3
    rest = ("random search", "samples of the families", "families of the findings")
    left_out = [f"{stage}: not begun, stopped" for stage in rest]
    assert list(found.missing) == ["findings of the sweep: stopped before its end", *left_out]
    assert not found.findings
    assert not found.problems


GROUPS, CHAINS = 30, 2


@pytest.mark.parametrize("group", tiered(range(GROUPS), {0}))
def test_random_structured_chains_have_no_false_claim(group):
    for seed in range(group, GROUPS * CHAINS, GROUPS):
        outcome = oracle.judged(chains.random_spec(seed), seed, seconds=1.0, points=2_000)
        assert outcome.verdict in ("complete", "not complete", "unconfirmed", "no motion"), outcome


def test_a_family_that_no_order_of_its_equations_divides_is_proven():
    """Three equations in the same joints: linear algebra finds what sums of these minors are."""
    assert closed_form(chains.arm_of(chains.random_spec(26))).word == "proven"


def test_what_no_box_shows_is_one_aspect_at_least():
    found = aspects(closed_form(chains.arm_of(chains.random_spec(287)), prove=False), work=0.01)
    assert (found.lower, found.upper) == (1, None)
    assert str(found).startswith("chain: at least 1 aspect within")


def test_the_oracle_of_real_points_moves_as_pinocchio_does():
    """Its Jacobians, of every task, and singular points of a chain with a known family."""
    points = script("oracle.points")
    rng = np.random.default_rng(0)
    for seed in range(30):
        spec = chains.strange_spec(seed)
        model = chains.arm_of(replace(spec, task="pose")).model
        data, frame = model.createData(), model.getFrameId("tip")
        q = rng.uniform(-3, 3, len(spec.rows))
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        pin.updateFramePlacements(model, data)
        turned = data.oMf[frame].rotation[:, :2].T @ J[3:]
        if spec.task == "tool-axis":
            J = np.concatenate([J[:3], turned])
        else:
            J = J[list(parse_task(spec.task).rows)]
        assert points.jacobians(spec, q[None])[0] == pytest.approx(J, abs=1e-12)


@pytest.mark.parametrize("seed", tiered(range(20), {0}))
def test_singular_points_that_newton_finds_are_on_families(seed):
    outcome = oracle.judged(chains.strange_spec(seed), seed, seconds=2.0, real=True)
    assert outcome.verdict in ("complete", "not complete", "no motion"), outcome


@pytest.mark.slow
def test_a_family_that_is_dropped_is_noticed_by_real_points():
    spec = spec_of([(0, 0, 0.2, 0), (0, 0, 0.3, 90), (0, 0, 0.2, 0)], "position")
    form = closed_form(chains.arm_of(spec))
    assert oracle.by_points(form, spec, 1, 0)[0] == "complete"
    for i in range(len(form.families)):
        less = replace(form, families=form.families[:i] + form.families[i + 1 :])
        assert oracle.by_points(less, spec, 1, 0)[0] == "missed"


OFFSET_WRIST = str(Path(__file__).parents[2] / "examples" / "offset_wrist.dh.yaml")
TOOL = ((0.06, 0.02, 0.12),)
"""Off the flange's axis, so that the last joint matters, too."""
WITH_TOOLS = {
    "three parallel axes and a tool": [
        ((0, 0, 0.09), Z), ((0, 0.12, 0), Y), ((0, -0.09, 0.425), Y), ((0, 0, 0.39), Y),
        ((0, 0.08, 0), Z), ((0, 0, 0.095), Y), TOOL,
    ],
    "offset wrist and a tool": [
        ((0, 0, 0.3), Z), ((0.1, 0, 0), Y), ((0, 0, 0.5), Y), ((0.05, 0, 0.1), X),
        ((0.4, 0, 0.03), Y), ((0.07, 0, 0.02), X), TOOL,
    ],
}  # fmt: skip
"""Places of the joints, metres, each seen from the one before, and their axes."""
FOUR_ROWS = ("stanford", "ur5", "irb1400", "kinova", "z1", OFFSET_WRIST, *WITH_TOOLS)
FIELDS = [("puma560", "pose"), ("iiwa14", "pose"), *((name, "vx,vy,vz,wz") for name in FOUR_ROWS)]


@pytest.mark.parametrize(("source", "task"), tiered_rows(FIELDS, FIELDS[:1]))
def test_a_family_that_is_dropped_or_too_large_is_noticed(source, task):
    if source in WITH_TOOLS:
        *turning, tool = WITH_TOOLS[source]
        source = chain_text([*(("continuous", *row) for row in turning), ("fixed", *tool)])
    arm = load(source, task=task)
    form = closed_form(arm, seconds=300.0, prove=False)  # more than enough: idle it takes 1 to 8 s
    parts, by_rank = oracle.components(form)
    # With slices the search states equations and asks points of them for their rank.
    assert not form.slice_count or any("some regular configurations" in h for h in form.hints)

    def against(parts, others=by_rank, rank=form.generic_rank):
        """At how many of six primes points say what, against components."""
        geometry, rows, count = form.geometry, arm.task.rows, 3_000 if task == "pose" else 10_000
        said = field.contradictions(geometry, rows, rank, parts, count, 0, by_rank=others)
        return {kind: len(primes) for kind, primes in said.items()}

    before = against(parts)
    # Two primes divide sums of lengths (23 the 161 mm of the Z1), and make special arms of it.
    assert before == ({"missed": 2} if source == "z1" else {})
    for i, part in enumerate(parts):
        if part.codimension > 2:  # too few points to be sure of
            continue
        others = [p for k, p in enumerate(parts) if k != i]
        assert against(others)["missed"] > before.get("missed", 1)
        if part.values:
            less = {"values": dict([*part.values.items()][1:])}
        else:
            less = {"relations": part.relations[1:]}
        assert "false" in against([*others, replace(part, **less)])
    if by_rank and by_rank[0].codimension < 3:
        assert against(parts, by_rank[1:])["missed"] > 1
    assert "rank" in against(parts, rank=form.generic_rank - 1)


def test_a_place_that_is_singular_without_a_zero_matrix_is_found():
    """Where nothing more may be fixed, the minors say whether all of the place is singular."""
    ring = make_ring((False,) * 4)
    x1, y1, x2, y2, x3, y3, x4, y4 = ring.context.gens()
    a, b, c = x3, y3 + 2 * x3, (x3 + 5 * y3) * (x3 + 6 * y3)
    k = (x1 * x2 + 2 * y1 * y2) * (x4 + 9 * y4)
    p, g = y1 * x2 + y2 * x1, x2 * x4 + 2 * y2 * y4
    second = k * b + p * (x3 + 7 * y3) * (x4 + 4 * y4)
    third = k * c + y1 * g * (x3 + 11 * y3) * (x3 + 12 * y3)
    matrix = [[a, b, c], [k * a, second, third]]
    found = decompose(lambda: matrix, 2, ring, Budget(60.0))
    assert not found.gaps
    assert any(part.values == {0: (1, 0), 1: (1, 0)} for part in found.components)


def test_a_corner_beside_which_rows_are_zero():
    ring = make_ring((True,) * 4)
    a, b, c, d = (ring.context.gens()[ring.variables(j)[0]] for j in range(4))
    zero = ring.zero
    matrix = [[zero, a + b, b, c], [a, zero, b, d], [zero, zero, zero, c]]
    found = corner(matrix, ring, Budget(9))
    assert (found.rows, found.columns) == ((1,), (0,))  # beside it all other rows are zero
    assert (found.determinant, found.rest) == (a, [[a + b, b, c], [zero, zero, c]])
    assert corner([[a, b], [c, d]], ring, Budget(9)) is None


def test_the_regular_part_of_a_system_is_searched(rng):
    """Inside x (y + z) = 0 and x (y - w) = 0 the part x = 0 is singular, and a curve is not all."""
    ring = make_ring((True,) * 4)
    x, y, z, w = (ring.context.gens()[ring.variables(j)[0]] for j in range(4))
    matrix = [[x, y + z, ring.zero], [ring.zero, x * (z - 1), y - w]]
    result = decompose(lambda: matrix, 2, ring, Budget(60))
    assert not result.gaps
    for _ in range(2000):
        point = [int(v) for v in rng.integers(-2, 3, 4)]
        values = [[0 if e == 0 else int(str(e(*point))) for e in row] for row in matrix]
        singular = np.linalg.matrix_rank(np.array(values, dtype=float)) < 2
        on = any(
            all(point[j] == v[0] for j, v in c.values.items())
            and all(r(*point) == 0 for r in c.relations)
            for c in result.components
        )
        assert on == singular, point
