"""Families whose equations touch zero, as 1 - sin q3 sin q4 does: their points have all digits."""

import numpy as np
import pytest
from singular_sets import RIGHT, Joint, build, drop

from pinsing.families import closed_form
from pinsing.families.form import families_text

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def arm():
    return build(
        [
            Joint(-RIGHT, -0.14, -0.16),
            Joint(a=0.46, d=0.37),
            Joint(np.pi, 0.15),
            Joint(RIGHT),
            Joint(-RIGHT, d=-0.42),
            Joint(slides=True),
        ],
        task="vx,vy,wx,wy",
    )


@pytest.fixture(scope="module")
def form(arm):
    return closed_form(arm, seconds=60)


def touched(form):
    return [f for f in form.families if f.confirm is not None]


def test_their_points_are_singular_to_rounding(arm, form, rng):
    (family,) = touched(form)
    assert family.confirm.touching
    for q in (family.sample(20, rng), family.points(20, rng)):
        assert len(q) == 20
        assert drop(arm, q).max() < 1e-12  # it was 4e-7
        assert family.contains(q).all()
        # At the extremum of sin q3 sin q4, to all digits.
        assert np.abs(np.abs(np.sin(q[:, 2:4])) - 1).max() < 1e-12
        assert np.abs(np.cos(q[:, 2:4])).max() < 1e-7
        q[:, 2] += 0.01
        assert drop(arm, q).min() > 1e-6
        assert not family.contains(q).any()


def test_their_equations_are_not_said_to_hold_elsewhere(form):
    assert "regular configurations" not in families_text(form)


def test_other_families_are_drawn_as_ever(form):
    assert len(touched(form)) < len(form.families)
    assert all(f.confirm is None for f in form.families if f not in touched(form))
