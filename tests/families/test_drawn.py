"""Points of families in closed form: all joints drawn but as many as there are equations."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from singular_sets import terms

from pinsing.algebra.equation import Equation
from pinsing.families import zero_set
from pinsing.families.zero_set import SearchBox, draw, orders, project, search, system_of

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
    lower, upper = np.full(3, -width), np.full(3, width)
    for order in orders([e], FREE):
        q = draw(order, SearchBox(lower, upper, FREE, ZERO), 4000, np.random.default_rng(1))
        assert len(q) > 50
        assert np.abs(system_of([e]).values(q)).max() < 2e-13
        assert ((q >= lower - 1e-9) & (q <= upper + 1e-9)).all()
        solved = order[0].joint
        assert np.ptp(q[:, solved]) > 0.5


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
    for short, most in ((zero_set._PROOF_TERMS, 0), (1, 400)):
        moved: list[int] = []

        def counted(*given: Any, moved: list[int] = moved) -> Any:
            moved.append(len(given[1]))
            return project(*given)

        monkeypatch.setattr(zero_set, "_PROOF_TERMS", short)
        monkeypatch.setattr(zero_set, "project", counted)
        rng = RNG(5)
        assert len(search([ONCE], SearchBox(far - 0.15, far + 0.15, FREE, ZERO), 4, rng)) == 0
        assert sum(moved) >= most
        assert most or sum(moved) == 0
        drawn.append(rng.random(3).tolist())
    assert drawn[0] == drawn[1]
    # A zero just outside, that counts as inside, is no reason to say that there is none.
    on = q[0]
    assert len(search([ONCE], SearchBox(on, on, FREE, ZERO), 1, RNG(1), rounds=1)) == 1
