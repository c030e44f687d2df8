"""Generalisations against the determinants that are known in closed form."""

import arms
import numpy as np
import pytest

from pinsing.errors import ConfigurationError, OptionError
from pinsing.kinematics.jacobian import singular_values
from pinsing.kinematics.refine import refine, refine_many
from pinsing.measures import sigma_ratio
from pinsing.robot.load import load
from pinsing.robot.nominal import nominal
from pinsing.sampling.generalize import Generalization, generalize, value_text

PI = np.pi


def texts(arm, q, **options):
    return {str(c) for c in generalize(arm, q, **options).conditions}


@pytest.mark.parametrize(
    ("name", "q", "expected"),
    [
        ("stanford", [0.3, 0.0, 0.3, 0.7, 0.9, 0.2], {"q2 = 0"}),
        ("stanford", [0.3, PI, 0.3, 0.7, 0.9, 0.2], {"q2 = 180 deg"}),
        ("stanford", [0.3, 0.8, 0.0, 0.7, 0.9, 0.2], {"d3 = 0"}),
        ("stanford", [0.3, 0.8, 0.3, 0.7, -PI, 0.2], {"q5 = 180 deg"}),
        ("stanford", [0.3, 0.0, 0.0, 0.7, 0.9, 0.2], {"q2 = 0", "d3 = 0"}),
        ("surgical7", [0.05, 0.5, 0.3, 0.0, 0.9, 0.2, 0.2], {"q4 = 0"}),
        ("surgical7", [0.05, 0.0, PI, 0.7, 0.9, 0.2, 0.2], {"q2 = 0 and q3 = 180 deg"}),
        # The paper's three sets, none of which is minimal.
        ("surgical7", [0.05, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0], {"q4 = 0", "q2 = 0 and q3 = 0"}),
        ("surgical7", [0.05, 0.0, PI, 1.0, PI / 2, 1.0, 1.0], {"q2 = 0 and q3 = 180 deg"}),
        ("surgical7", [0.05, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0], {"q4 = 0"}),
        # A value that is not special, which the paper misses.
        ("surgical7", [0.05, 0.5, 0.3, 0.8, PI / 2, -np.arcsin(0.2), 0.2],
         {"q5 = 90 deg and q6 = -11.5370 deg (-0.201358 rad)"}),
        # A special member of a relation of four joints: q2 = 0, and q4, q5, q6.
        ("surgical7", [0.05, 0.0, 0.3, -PI / 6, PI / 2, 0.7, 0.2],
         {"q2 = 0 and a relation between q4, q5 and q6"}),
        ("iiwa14", [0.3, 0.5, 0.3, 0.0, 0.9, 0.2, 0.2], {"q4 = 0"}),
        ("iiwa14", [0.3, 0.0, PI / 2, 0.7, 0.9, 0.2, 0.2], {"q2 = 0 and q3 = 90 deg"}),
        ("iiwa14", [0.3, 0.4, 0.5, 0.7, -PI / 2, 0.0, 0.2], {"q5 = -90 deg and q6 = 0"}),
        ("iiwa14", [0.3, 0.0, 0.5, 0.7, 0.5, PI, 0.2], {"q2 = 0 and q6 = 180 deg"}),
        ("puma560", [0.3, 0.4, -0.5, 0.7, 0.0, 0.9], {"q5 = 0"}),
        ("planar3r", [0.3, PI, 0.5], {"q2 = 180 deg"}),
        ("scara", [0.3, 0.0, 0.1, 0.5], {"q2 = 0"}),
    ],
)  # fmt: skip
def test_known_families(name, q, expected):
    assert texts(arms.textbook(name), q) == expected


def test_the_relation_of_the_puma_that_the_paper_cannot_find():
    arm = arms.textbook("puma560")
    found = refine(arm, [0.3, 1.3, -0.6, 0.7, 0.9, 0.9], fixed=["q3", "q5"])
    (condition,) = generalize(arm, found).conditions
    assert str(condition) == "a relation between q2 and q3"
    assert not condition.minimal
    assert condition.fixed == {}
    assert condition.depends_on == ("q2", "q3")
    assert set(condition.forced_by) == {"q2", "q3"}


def test_a_joint_that_hardly_moves_in_a_relation_is_of_it():
    """The elbow of the GoFa, beside where it is stretched."""
    arm, q = load("gofa5"), [0.3, 0.5, 1.80070075, 0, 0.7, 0.2]
    for seed in (3, 4):
        (condition,) = generalize(arm, q, seed=seed).conditions
        assert str(condition) == "a relation between q2, q3, q4 and q5"


@pytest.mark.parametrize("values", [{1: 0.0}, {5: 0.0}, {2: 0.0, 4: 0.0}, {1: 0.0, 2: 0.0}])
def test_iiwa_negatives(values, rng):
    """What looks singular and is not: regular, so not to be generalised."""
    arm = arms.textbook("iiwa14")
    q = np.full(7, 0.7)
    q[list(values)] = list(values.values())
    assert sigma_ratio(singular_values(arm, q))[0] > 1e-3
    with pytest.raises(ConfigurationError, match="not singular"):
        generalize(arm, q)


def test_conditions_hold_at_other_random_values(rng):
    """The claim itself, with random values that the search has not seen."""
    for name in ("surgical7", "iiwa14", "puma560"):
        arm = arms.textbook(name)
        low, high = np.where(arm.prismatic, -0.1, -PI), np.where(arm.prismatic, 0.1, PI)
        starts = rng.uniform(low, high, (12, arm.n))
        for found in refine_many(arm, starts, ignore_limits=True):
            for condition in generalize(arm, found).conditions:
                Q = arm.space.sample(100, rng, ignore_limits=True)
                at = [arm.joints.index(j) for j in condition.forced_by]
                Q[:, at] = list(condition.forced_by.values())
                assert sigma_ratio(singular_values(arm, Q)).max() <= 1e-9
                assert condition.worst_ratio <= 1e-9
                for i in at:  # and none of the values can be left out
                    free = Q.copy()
                    free[:, i] = rng.uniform(low[i], high[i], 100)
                    assert sigma_ratio(singular_values(arm, free)).max() > 1e-6


def test_snap_to_special_values_is_tested_not_assumed():
    arm = arms.textbook("surgical7")
    near = generalize(arm, refine(arm, [0.05, 0.5, 0.3, 1e-3, 0.9, 0.2, 0.2]))
    assert near.conditions[0].fixed == {"q4": 0.0}
    assert near.q[3] == 0.0
    # A singular value beside zero stays where it is: an offset of 1e-5 radian in the zero of q2.
    model = arms.planar((1.0, 0.8)).model.copy()
    turned = model.jointPlacements[2]
    c, s = np.cos(5e-5), np.sin(5e-5)
    turned.rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    model.jointPlacements[2] = turned
    shifted = load(model, tip="tip", task="position")
    condition = generalize(shifted, [0.3, -5e-5], geometry=shifted).conditions[0]
    assert condition.fixed["q2"] == pytest.approx(-5e-5, abs=1e-9)
    ratio = sigma_ratio(singular_values(shifted, [0.7, condition.fixed["q2"]]))[0]
    assert ratio <= 1e-9


def test_raw_geometry_is_judged_too():
    arm = arms.data_robot("xarm_description/urdf/xarm7.urdf", tip="link7")
    q = np.array([0.3, 0.5, 0.4, 2.7, 0.1, 0.8, 0.2])
    result = generalize(arm, refine(nominal(arm).arm, q))
    assert result.nominal_ratio <= 1e-9
    assert 1e-9 < result.raw_ratio < 1e-5
    assert "the file itself reaches" in str(result)
    exact = generalize(arms.textbook("stanford"), [0.3, 0.0, 0.3, 0.7, 0.9, 0.2])
    assert exact.raw_ratio <= 1e-9
    assert str(exact) == "q2 = 0, whatever the others"


def test_same_seed_same_answer_and_json():
    arm = arms.textbook("surgical7")
    q = refine(arm, [0.05, 0.1, 1.3, 0.7, 1.2, 0.3, 0.2], fixed=["q3"]).q
    one, two = generalize(arm, q, seed=5), generalize(arm, q, seed=5)
    assert one.to_json() == two.to_json()
    assert Generalization.from_json(one.to_json()).to_json() == one.to_json()
    assert texts(arm, q, seed=6) == {str(c) for c in one.conditions}


def test_wrong_input():
    arm = arms.textbook("stanford")
    with pytest.raises(OptionError, match="samples"):
        generalize(arm, [0.3, 0.0, 0.3, 0.7, 0.9, 0.2], samples=0)
    with pytest.raises(ConfigurationError, match="needs 6 values"):
        generalize(arm, [0.0])


def test_value_text():
    assert value_text(0.0) == "0"
    assert value_text(PI) == "180 deg"
    assert value_text(-PI / 2) == "-90 deg"
    assert value_text(0.25, prismatic=True) == "0.25 m"
    assert value_text(1.0) == "57.2958 deg (1.000000 rad)"
