"""Points of families: drawn in closed form, on their zero sets, singular to all digits."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from singular_sets import RIGHT, Joint, build, drop, terms

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.conditions import Branch
from pinsing.algebra.equation import Equation, System, equation
from pinsing.algebra.ring import make_ring
from pinsing.families import closed_form, zero_set
from pinsing.families.describe import describe
from pinsing.families.form import families_text
from pinsing.families.solve import ComponentSearch
from pinsing.families.zero_set import OwnPoints, SearchBox, draw, orders, project, search, system_of
from pinsing.robot.arm import JointSpace
from pinsing.robot.load import load
from pinsing.robot.nominal import nominal

SHIFT = (-0.3, 0.05, 0.4)
ONCE = terms(((2, 0, 0), (0, 0, 0), 0.5, 0.2), ((0, 2, 2), (0, 0, 0), 0.3, -0.4), shift=SHIFT)
HALF = terms(((1, 1, 0), (0, 0, 0), 1.0, 0.3), ((1, -1, 0), (0, 0, 0), 0.2, 0.9), shift=SHIFT)
LENGTH = terms(((0, 2, 0), (1, 0, 0), 1.0, 0.3), ((0, 2, 2), (0, 0, 0), 0.7, 0.0), shift=SHIFT)
TWICE = terms(((4, 0, 0), (0, 0, 0), 1.0, 0.0), ((2, 0, 0), (0, 0, 0), 0.0, 0.5), shift=SHIFT)
FREE = np.ones(3, dtype=bool)
ZERO = np.zeros(3)
WIDE = np.full(3, 3.0)
RNG = np.random.default_rng


@pytest.mark.parametrize("e", [ONCE, HALF, LENGTH])
@pytest.mark.parametrize("width", [2.0, 3.2, 20.0])
def test_points_are_on_the_set_and_in_the_box(e: Equation, width: float) -> None:
    e = replace(e, shift=np.where(e.powers.any(0), 0, e.shift))
    high = np.full(3, width)
    for order in orders([e], FREE):
        q = draw(order, SearchBox(-high, high, FREE, ZERO), 4000, RNG(1))
        assert len(q) > 50
        assert np.abs(system_of([e]).values(q)).max() < 2e-13
        assert (np.abs(q) <= width + 1e-9).all()
        assert np.ptp(q[:, order[0].joint]) > 0.5


def test_what_is_solved_for_and_in_which_order() -> None:
    """No joint that enters twice, none that is held; and one equation after the other."""
    assert orders([TWICE], FREE) == orders([], FREE) == []
    assert {o[0].joint for o in orders([ONCE], FREE)} == {0, 1, 2}
    assert all(o[0].joint != 1 for o in orders([ONCE], np.array([True, False, True])))
    found = orders([ONCE, HALF], FREE)
    assert found
    for order in found:
        q = draw(order, SearchBox(-WIDE, WIDE, FREE, ZERO), 3000, RNG(2))
        assert len(q) > 100
        assert np.abs(system_of([ONCE, HALF]).values(q)).max() < 1e-14
    both = terms(((2, 2, 2), (0, 0, 0), 0.5, 0.2), ((0, 0, 0), (0, 0, 0), 0.1, 0.0), shift=SHIFT)
    assert orders([both, ONCE], FREE) == []  # each joint of the one is in the other
    free, fixed = np.array([True, True, False]), np.array([0.0, 0.0, 1.25])
    (order, *_) = orders([ONCE], free)
    assert (draw(order, SearchBox(-WIDE, WIDE, free, fixed), 500, RNG(3))[:, 2] == 1.25).all()


def test_a_box_with_nothing_in_it_is_not_searched_at_random(monkeypatch):
    middle = np.array([0.3, -0.2, 0.1])
    q = draw(orders([ONCE], FREE)[0], SearchBox(middle - 3, middle + 3, FREE, ZERO), 500, RNG(2))
    far = middle + np.array([0.4, 0.9, 0.9])
    values = system_of([ONCE]).values(RNG(3).uniform(far - 0.15, far + 0.15, (4000, 3)))
    assert len(q)
    assert np.abs(values).min() > 0.01
    drawn = []
    for short, searched in ((zero_set._PROOF_TERMS, False), (1, True)):
        monkeypatch.setattr(zero_set, "_PROOF_TERMS", short)
        rng = RNG(5)
        with patch.object(zero_set, "project", side_effect=project) as moved:
            box = SearchBox(far - 0.15, far + 0.15, FREE, ZERO)
            assert len(search([ONCE], box, 4, rng)) == 0
        points = sum(len(call.args[1]) for call in moved.call_args_list)
        assert points >= 400 if searched else points == 0
        drawn.append(rng.random(3).tolist())
    assert drawn[0] == drawn[1]
    # A zero just outside, that counts as inside, is no reason to say that there is none.
    on = q[0]
    assert len(search([ONCE], SearchBox(on, on, FREE, ZERO), 1, RNG(1), rounds=1)) == 1


@pytest.mark.slow
def test_an_equation_that_all_but_cancels_says_how_accurate_it_is(rng):
    form = closed_form(load("g1", tip="left_rubber_hand", base="torso_link"), seconds=30)
    equations = max((f.branches[0].equations for f in form.families), key=len)
    e = equations[0]
    n, joint = e.frequencies.shape[1], e.involved[0]
    fixed = zero_set.fix_joint(e, joint, 0.7)
    assert e.accuracy <= fixed.accuracy < 1e-13
    Q = rng.uniform(-2, 2, (5, n))
    Q[:, joint] = 0.7
    assert fixed(Q) == pytest.approx(e(Q), abs=1e-12 * e.size)
    small = e.scaled(1.0)
    assert small.unit == small.size
    assert replace(e, accuracy=1e-11).unit == pytest.approx(1e3 * e.size)
    low, high, free = np.full(n, -1.5), np.full(n, 1.5), np.arange(n) > 0
    Q = search(equations, SearchBox(low, high, free, np.full(n, 0.25)), 20, rng)
    assert Q[:, 0].tolist() == [0.25] * 20
    assert (np.abs(Q) <= 1.5 + 1e-9).all()
    assert np.abs(System(equations).values(Q)).max() < 1e-12
    again, ok = project(equations, Q, free)
    assert ok.all()
    assert np.abs(again - Q).max() < 1e-9


def test_a_small_residual_is_not_yet_on_the_set(rng):
    """1 - cos q1 is 5e-9 at 1e-4: singular points of another set, where a family was, passed."""

    class Near:
        def __call__(self, points):
            return np.ones(len(points), dtype=bool)

        def drawn(self, count, box, rng):
            return np.where(np.arange(2) == 0, 1e-4, box.drawn(count, rng))

    ring = make_ring((False, False))
    _, y, *_ = ring.context.gens()
    branch = Branch((), (equation(2 * y**2, ring, ("q1", "q2"), np.zeros(2)),))
    high = np.full(2, np.pi)
    space = JointSpace(("q1", "q2"), np.zeros(2, dtype=bool), -high, high, 1.0)
    held = [(branch, SearchBox.of(branch, -high, high))]
    q = zero_set.own_drawn(held, space, False, Near(), 10, rng, None)
    assert q[:, 0] == pytest.approx(np.zeros(10), abs=2e-5)


@pytest.fixture(scope="module")
def sought():
    """The arm, and the components that were found of it."""
    arm = pinsing.load("ur5")
    return arm, ComponentSearch(nominal(arm), Budget(60.0), 0.002).run()


def test_what_a_first_look_missed_is_real_where_samples_are_found(sought):
    arm, found = sought
    with_equations = [c for c in found.components if c.relations]
    assert with_equations
    for component in with_equations:
        pieces = [replace(p, real=False) for p in found.maker.make(component)]
        family = describe(pieces, found.maker, arm)
        assert len(family.sample(4, np.random.default_rng(0))) == 4
        assert (family.real, family.reachability) == (True, "reachable")
        assert family.witness is not None


def test_equations_without_a_real_point_stay_so(sought):
    arm, found = sought
    x, y = (found.ring.context.gens()[v] for v in found.ring.variables(2))
    component = next(c for c in found.components if c.relations)
    piece = found.maker.make(component)[0]
    nowhere = found.maker.branch_of({}, [4 * x * x + 2 * y * y])  # 3 + cos q3, over the circle
    family = describe([replace(piece, branches=(nowhere,), real=False)], found.maker, arm)
    assert (family.real, family.witness, family.reachability) == (False, None, "none found")
    assert len(family.sample(4, np.random.default_rng(0))) == 0


def test_a_point_off_by_the_root_of_rounding_is_brought_to_all_digits(sought):
    arm = sought[1].arm
    own = OwnPoints(arm)
    elbow = np.array([0.3, -0.7, 2e-7, 0.5, 0.9, 0.1])
    regular = np.array([0.3, -0.7, 0.8, 0.5, 0.9, 0.1])
    blunt = np.stack([elbow, regular])
    assert own(blunt).tolist() == [True, False]
    sharp = own.sharpened(blunt, np.ones(6, dtype=bool))
    before, after = (pinsing.singular_values(arm, q)[0, -1] for q in (blunt, sharp))
    assert before > 1e-9
    assert after < 1e-14
    assert np.abs(sharp[0] - elbow).max() < 1e-6
    assert np.array_equal(sharp[1], regular)  # the singular ones are far away
    assert own.sharpened(blunt, np.arange(6) != 2)[0, 2] == elbow[2]


@pytest.mark.slow
def test_points_of_touching_equations_are_singular_to_rounding(rng):
    """Equations of one family touch zero, as 1 - sin q3 sin q4 does."""
    rows = [
        Joint(-RIGHT, -0.14, -0.16), Joint(a=0.46, d=0.37), Joint(np.pi, 0.15), Joint(RIGHT),
        Joint(-RIGHT, d=-0.42), Joint(slides=True),
    ]  # fmt: skip
    arm = build(rows, task="vx,vy,wx,wy")
    form = closed_form(arm, seconds=60)
    (family,) = (f for f in form.families if f.confirm is not None)
    assert not family.also_regular
    assert "regular configurations" not in families_text(form)
    assert len(form.families) > 1
    for q in (family.sample(20, rng), family.points(20, rng)):
        assert len(q) == 20
        assert drop(arm, q).max() < 1e-12
        assert family.contains(q).all()
        # At the extremum of sin q3 sin q4, to all digits.
        assert np.abs(np.abs(np.sin(q[:, 2:4])) - 1).max() < 1e-12
        assert np.abs(np.cos(q[:, 2:4])).max() < 1e-7
        q[:, 2] += 0.01
        assert drop(arm, q).min() > 1e-6
        assert not family.contains(q).any()


def test_random_starts_that_go_several_turns_round_are_not_taken_for_degrees(monkeypatch, rng):
    model = load("ur5").model.copy()
    model.lowerPositionLimit[:], model.upperPositionLimit[:] = -0.3, 0.3
    arm = nominal(load(model, tip="tool0")).arm
    (branch,) = next(f for f in closed_form(arm, prove=False).families if f.equations).branches
    thrown, whole = zero_set.thrown, np.full(6, np.pi)
    monkeypatch.setattr(zero_set, "thrown", lambda *given: thrown(*given) + 4 * np.pi)
    monkeypatch.setattr(OwnPoints, "drawn", lambda *given: np.zeros((0, 6)))
    held = [(branch, SearchBox.of(branch, -whole, whole))]
    found = zero_set.own_drawn(held, arm.space, False, OwnPoints(arm), 5, rng, None)
    assert len(pinsing.singular_values(arm, found)) == 5
