"""Components: conditions that fix one joint are values; what lies in others is left out."""

from fractions import Fraction

import numpy as np
import pytest
from singular_sets import RIGHT, Joint, build, check_families, drop

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component, inside, settled
from pinsing.algebra.ring import make_ring
from pinsing.families import closed_form
from pinsing.families.slices import without_inner


@pytest.fixture(scope="module")
def arm():
    """Seven joints, two of them slides: four rows of it have families at q3 = 0 and 180°."""
    return build(
        [
            Joint(a=-0.06, d=-0.31), Joint(RIGHT, 0.06, slides=True), Joint(np.pi, 0.37, 0.53),
            Joint(a=0.39, d=0.13), Joint(-RIGHT, 0.3), Joint(), Joint(RIGHT, slides=True),
        ],
        tip=(0.19, -0.02, 0.14),
        task="vx,vy,vz,wz",
    )  # fmt: skip


@pytest.fixture(scope="module")
def form(arm):
    return closed_form(arm, seconds=60, prove=False)


def test_a_value_that_another_one_leaves_is_a_value():
    ring = make_ring([False] * 3 + [True])
    x1, y1, x2, y2, x3, y3, d4 = ring.context.gens()
    c = Component({}, (x1 - y1, x1 * x2 + y1 * x2, x2 * d4 + 2 * y2 * d4 - y2, y3 - x3), False, 4)
    found = settled(c, ring)
    one, none = Fraction(1), Fraction(0)
    assert found.values == {
        0: (one, one),
        1: (none, one),  # 2 x2 = 0 once q1 is put in
        2: (one, one),
        3: (Fraction(1, 2),),  # once q2 is
    }
    assert (found.relations, found.codimension) == ((), 4)


def test_what_fixes_no_joint_stays():
    ring = make_ring([False] * 2)
    x1, y1, x2, y2 = ring.context.gens()
    # Of the second two values, of which none is exact.
    for relation in (x1 * x2 - 3 * y1 * y2, x1 * x1 - 2 * y1 * y1):
        assert settled(c := Component({}, (relation,), True, 1), ring) == c


@pytest.mark.slow
def test_no_value_of_a_joint_is_lost(arm, form, rng):
    """q3 = 180° came out as "2 x3 = 0", of which no real value was found: the answer was called
    complete without it."""
    assert form.complete
    for q3 in (0.0, np.pi, RIGHT, -RIGHT):
        for q4 in (RIGHT, -RIGHT):
            q = rng.uniform(-1, 1, (20, 7))
            q[:, 2], q[:, 3] = q3, q4
            turned = q[:, 4] + q[:, 5]
            q[:, 6] = -(0.3 + 0.19 * np.cos(turned) + 0.14 * np.sin(turned)) / np.sin(turned)
            assert drop(arm, q).max() < 1e-9
            on = np.zeros(20, dtype=bool)
            for family in form.families:
                on |= family.contains(q)
            assert on.all(), (q3, q4)
            q[:, 2] += 0.01
            assert drop(arm, q).min() > 1e-7
    check_families(arm, form, 40)


def _some():
    ring = make_ring([False] * 3)
    x1, y1, x2, y2, x3, y3 = ring.context.gens()
    small = 3 * x1**2 + x1 * y1 - 2 * y1**2
    tied = x1 * x2 - 5 * y1 * y2
    other = x1 * x2 - 7 * y1 * y2
    # Zero where both are, but a multiple of neither.
    mixed = small * (x2**2 + 2 * x2 * y2) * x3 + tied * x1 * (4 * x2 * y3 - y2 * x3)
    large = Component({}, (mixed,), True, 1)
    inner = Component({}, (small, tied), True, 2)
    apart = Component({}, (small, other), True, 2)
    return ring, large, inner, apart


def test_points_tell_what_division_does_not():
    ring, large, inner, apart = _some()
    assert not inside(inner, large, ring)
    every = [large, inner, apart]
    assert without_inner(every, [inner, apart], ring, Budget(5)) == [large, apart]
    # What is not doubted stays, and so does all without time.
    assert without_inner(every, [], ring, Budget(5)) == every
    assert without_inner(every, [inner, apart], ring, Budget(0)) == every
    # Of two statements of one set one stays.
    a, b = inner.relations
    twin = Component({}, (a, a * ring.context.gens()[3] + b * ring.context.gens()[1]), True, 2)
    assert without_inner([inner, twin], [inner, twin], ring, Budget(5)) in ([inner], [twin])


@pytest.mark.slow
@pytest.mark.parametrize("tip", ["left_hand_index_1_link", "right_hand_middle_1_link"])
def test_pieces_of_a_stopped_search_do_not_keep_an_answer_open(tip):
    """All minors of these nine joints have two seconds here, and leave isolated values behind."""
    arm = pinsing.load("g1_29dof_with_hand_rev_1_0", tip=tip, base="torso_link")
    form = pinsing.closed_form(arm, seconds=20)
    assert form.slice_count is not None
    assert form.complete
