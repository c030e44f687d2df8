"""Conditions that fix one joint are values, also where others were put in to make them so."""

from fractions import Fraction

import numpy as np
import pytest
from singular_sets import RIGHT, Joint, build, check_families, drop

from pinsing.algebra.components import Component, settled
from pinsing.algebra.ring import make_ring
from pinsing.families import closed_form


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
