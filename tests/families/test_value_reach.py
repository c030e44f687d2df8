"""Of values that the limits do not allow nobody says that the family is within them."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dh_arms import dh_text

import pinsing
from pinsing.families import Branch, Family, JointValue
from pinsing.families.family import reach_words, values_reached
from pinsing.measures import Reachability

SCARA = [
    (0, 0.25, 0.35, 0, "revolute", (-152, 152)), (0, 0.225, 0, 0, "revolute", (-142, 142)),
    (0, 0, 0, 0, "prismatic", (-0.2, 0)), (0, 0, 0),
]  # fmt: skip
SAID = "within the joint limits with q2 = 0° (not 180°)"


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scara") / "short_elbow.dh.yaml"
    path.write_text(dh_text(SCARA, name="short_elbow"))
    return path


@pytest.fixture(scope="module")
def elbow(table: Path) -> Family:
    (family,) = pinsing.closed_form(pinsing.load(table)).families
    return family


@pytest.mark.slow
def test_the_value_inside_is_named(elbow: Family) -> None:
    assert elbow.reachability is Reachability.INSIDE
    assert elbow.reach == SAID
    turned = replace(elbow, lower=elbow.lower + math.tau, upper=elbow.upper + math.tau)
    assert turned.reach == SAID.replace("0° (", "360° (", 1)
    assert [(v.joint, v.value, v.reachability) for v in elbow.value_reach] == [
        (1, 0.0, Reachability.INSIDE),
        (1, pytest.approx(math.pi), Reachability.OUTSIDE),
    ]


def within(values, low, high, slides=False, met=lambda b: True, equations=()):
    """Words about branches of joint values, one mapping each."""
    branches = [
        Branch(tuple(JointValue(j, v, True) for j, v in b.items()), equations) for b in values
    ]
    box, prismatic = (np.full(6, low), np.full(6, high)), np.full(6, slides)
    found = values_reached(branches, box, prismatic, Reachability.INSIDE, met)
    return reach_words(Reachability.INSIDE, found, prismatic).removeprefix(
        "within the joint limits "
    )
