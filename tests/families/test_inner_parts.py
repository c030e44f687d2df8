"""Components of which generic points say that they lie in others."""

import pytest

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component, inside
from pinsing.algebra.ring import make_ring
from pinsing.families.slice_search import without_inner


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
