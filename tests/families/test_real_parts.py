"""Real points of components: exact, whatever is smaller than its complex set."""

import math
import sys

import numpy as np
import pytest
from singular_sets import Joint, build, iiwa_with_offset

from pinsing.algebra.budget import Budget, Stages
from pinsing.algebra.real_roots import (
    NotFinite,
    changes_sign,
    isolated_zeros,
    real_solutions,
    semidefinite,
)
from pinsing.algebra.ring import make_ring
from pinsing.families import closed_form
from pinsing.families.form import families_text
from pinsing.kinematics.jacobian import ratios
from pinsing.robot.load import load
from pinsing.robot.surd import cosine
from pinsing.sampling.analyze import analysis_text, analyze
from pinsing.sampling.sweeps import sweep

RIGHT = math.pi / 2


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
def test_a_system_of_as_many_equations_as_its_codimension_falls_into_parts():
    """UR5, position: of three equations for q2 to q5 two are products but for the first.

    What is left are four points (q4, q5) with q3 = 0, and a curve with q2 = 90 degrees.
    """
    arm = load("ur5", task="position")
    form = closed_form(arm, seconds=300.0)
    assert form.complete
    assert form.fully_decomposed
    points = next(f for f in form.families if "q3 = 0° and q4 = -130.419°" in f.text)
    assert (len(points.branches), points.codimension) == (4, 3)
    curve = next(f for f in form.families if f.text.startswith("q2 = ±90° and q3 = 0° or 180° and"))
    assert (len(form.families), curve.codimension) == (4, 3)
    rng = np.random.default_rng(2)
    for family in (points, curve):
        assert ratios(form.geometry.arm, family.points(40, rng)).max() < 1e-13
    q = points.points(1, rng)[0]
    q[4] = -q[4]  # a value that goes with another one
    assert ratios(form.geometry.arm, q[None]).min() > 1e-4


@pytest.mark.slow
def test_an_equation_with_a_single_real_point_is_no_surface():
    """0.3 cos q2 + 0.2 cos(q2+q3) + 0.5 is zero at q2 = 180, q3 = 0 only, which q3 = 0 holds."""
    rows = [Joint(d=0.4), Joint(alpha=RIGHT, a=0.5), Joint(a=0.3)]
    form = closed_form(build(rows, tip=(0.2, 0, 0), task="position"))
    assert form.complete
    assert [f.text for f in form.families] == ["q3 = 0° or 180°"]
    assert form.dropped == 1
    # A little longer, and the surface is there.
    rows[1] = Joint(alpha=RIGHT, a=0.4)
    form = closed_form(build(rows, tip=(0.2, 0, 0), task="position"))
    assert [f.codimension for f in form.families] == [1, 1]
    # A little shorter, and it is not.
    rows[1] = Joint(alpha=RIGHT, a=0.6)
    form = closed_form(build(rows, tip=(0.2, 0, 0), task="position"))
    assert len(form.families) == 1
    assert form.complete
    rows = [Joint(d=0.4), Joint(alpha=RIGHT, a=0.6), Joint(a=0.3), Joint(a=0.2)]
    form = closed_form(build(rows, tip=(0.1, 0, 0), task="position"))
    assert form.complete
    assert [f.text for f in form.families] == ["q3 = 0° or 180° and q4 = 0° or 180°"]
    assert form.dropped == 1
    assert form.family_of([0.3, math.pi, 0, 0]) is not None
    assert form.family_of([0.3, 3.0, 0.1, 0.2]) is None


@pytest.fixture
def ring():
    return make_ring((False, False, False))


def test_finite_systems(ring):
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


def test_finite_systems_with_square_roots():
    root = cosine(3)  # sqrt(2) / 2
    ring = make_ring((False, False), [root], Budget(30.0))
    x1, y1, x2, y2, *_ = ring.context.gens()
    p = ring.reduce(y1 - ring.number(root) * x1)
    g = y2 * x1 - y1 * x2
    (found,) = real_solutions([p, g], ring, Budget(30.0))
    assert float(found[1].ball) == pytest.approx(math.sqrt(0.5))


def test_signs(ring):
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
    rows = [Joint(d=0.4), Joint(alpha=RIGHT, limits=(0.1, 1.570796325))]
    rows.append(Joint(alpha=-RIGHT, a=0.3))
    (family,) = closed_form(build(rows, task="orientation")).families
    assert family.text == "q2 = 0° or 180°"
    rows[1] = Joint(alpha=RIGHT, theta=RIGHT, limits=(0.1, 1.570796325))
    (family,) = closed_form(build(rows, task="orientation")).families
    assert (family.text, family.reachability) == ("q2 = ±90°", "at the joint limit")
    assert family.is_reachable
    for words in ("1.570796327", "1.570796325", "1.8e-09"):
        assert words in family.limits_met[0]
    rows[1] = Joint(alpha=RIGHT, theta=RIGHT, limits=(0.1, 1.5))  # 4 degrees short
    (family,) = closed_form(build(rows, task="orientation")).families
    assert family.reachability == "not reachable"
    arm = build([*rows[:1], Joint(alpha=RIGHT, limits=(0.1, 1.570796325)), rows[2]])
    values = sweep(arm, levels=1, samples=20).plan.effects[1].special
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
    assert found.missing[0] == "findings of the sweep: stopped before its end"
    assert not found.findings
    assert not found.problems
    stages = Stages(60.0)

    def stage() -> int:
        raise KeyboardInterrupt

    assert (stages.run("first", stage, 7), stages.run("second", lambda: 1, 0)) == (7, 0)
    assert stages.missing == ["first: stopped before its end", "second: not begun, stopped"]
