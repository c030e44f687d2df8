"""What random starts meet: on a family, in a valley of one, or on none."""

import dataclasses

import pytest
from dh_arms import dh_arm

from pinsing import load
from pinsing.algebra.budget import Stages
from pinsing.families import closed_form
from pinsing.sampling.analyze import leads_down, random_search


@pytest.fixture(scope="module")
def flat():
    """An arm whose row falls like the cube of the distance beside q2 = 0, q3 = 180 degrees."""
    rows = (90, 0.1, 0.3), (90, 0.2, 0), (0, 0.2, 0.1)
    return closed_form(dh_arm([(*row, 0, "continuous") for row in rows], "vz"))


def test_ends_in_a_flat_valley_belong_to_the_family_at_its_end(flat):
    found = random_search(flat.geometry.arm, flat, 60, 3, Stages(60.0))
    assert found.singular > 40
    assert len(found.off) == 0


def test_a_family_that_is_missing_is_noticed(flat):
    less = dataclasses.replace(flat, families=flat.families[1:])
    found = random_search(flat.geometry.arm, less, 100, 3, Stages(60.0))
    assert len(found.off) > 20


def test_a_set_that_meets_a_family_is_no_valley_of_it():
    form = closed_form(load("ur5"))
    elbow = next(f for f in form.families if f.joints == ("elbow_joint",))
    less = dataclasses.replace(form, families=(elbow,))
    for e in (1e-3, 1e-4):
        assert not leads_down(form.geometry.arm, less, [0.3, 0.8, e, 1.1, 0.0, 0.2])
