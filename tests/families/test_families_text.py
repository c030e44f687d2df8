"""The list of families as it is printed: whose joint each symbol is, and why half angles occur."""

from pathlib import Path

import numpy as np
import pytest
from singular_sets import closed

import pinsing
from pinsing.families import ClosedForm
from pinsing.families.form import families_text

TABLE = Path(__file__).parents[2] / "examples/offset_wrist.dh.yaml"


@pytest.fixture(scope="module")
def equal_links(tmp_path_factory: pytest.TempPathFactory) -> ClosedForm:
    """Upper arm and forearm are equally long, so that they fold at one value of q3."""
    file = tmp_path_factory.mktemp("table") / "equal_links.dh.yaml"
    file.write_text(TABLE.read_text().replace("d: 0.54", "d: 0.71"))
    return pinsing.closed_form(pinsing.load(file), prove=False)


def test_names_of_joints_stand_before_the_families():
    text = families_text(closed("ur5"))
    assert text.index("joints: q1 = shoulder_pan_joint") < text.index("  F1  ")
    assert text.count("shoulder_pan_joint") == 1
    # where joints are called as their symbols are, there is nothing to say
    assert "joints:" not in families_text(closed("stanford"))


def test_half_angles_are_explained_where_they_are_printed(equal_links):
    assert equal_links.families[0].text == "q3 = 90°"
    text = " ".join(families_text(equal_links).split())
    assert "cos((3 q3)/2)" in text
    assert "half of q3 in F2: equations are factors of a longer one" in text
    assert "half of" not in families_text(closed("ur5"))
    equation = equal_links.families[1].branches[0].equations[0]
    q = np.array([0.3, 0.7, -1.1, 0.9, 1.3, 0.2])
    here, there = equation(q), equation(q + 2 * np.pi * np.eye(6)[2])
    assert abs(here) > 1e-3
    assert there == pytest.approx(-here)


@pytest.mark.slow
def test_a_single_term_has_no_number():
    form = pinsing.closed_form(pinsing.load("panda", task="position"), prove=False)
    assert " and sin(q3+q5) = 0" in " ".join(str(form).split())
