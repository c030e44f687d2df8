"""Of values that the limits do not allow nobody says that the family is within them."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from singular_sets import arm_of, closed

import pinsing
from pinsing.cli.app import command
from pinsing.families import Branch, Family
from pinsing.families.parts import JointValue, reach_words, values_reached
from pinsing.measures import Reachability
from pinsing.proximity.clearance import distance_words, distances
from pinsing.view.entries import family_entries
from pinsing.view.tab import _more

SCARA = """
name: short_elbow
convention: standard
units: {angle: deg, length: m}
rows:
  - {alpha: 0, a: 0.25, d: 0.35, theta: 0, type: revolute, limits: [-152, 152]}
  - {alpha: 0, a: 0.225, d: 0, theta: 0, type: revolute, limits: [-142, 142]}
  - {alpha: 0, a: 0, d: 0, theta: 0, type: prismatic, limits: [-0.2, 0]}
  - {alpha: 0, a: 0, d: 0, theta: 0, type: revolute, limits: [-180, 180]}
"""
SAID = "within the joint limits with q2 = 0° (not 180°)"


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scara") / "short_elbow.dh.yaml"
    path.write_text(SCARA, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def elbow(table: Path) -> Family:
    (family,) = pinsing.closed_form(pinsing.load(table)).families
    return family


def test_the_value_inside_is_named(elbow: Family) -> None:
    assert elbow.reachability is Reachability.INSIDE
    assert elbow.reach == SAID
    assert [(v.joint, v.value, v.reachability) for v in elbow.value_reach] == [
        (1, 0.0, Reachability.INSIDE),
        (1, pytest.approx(math.pi), Reachability.OUTSIDE),
    ]


def test_in_text_at_page_and_notebook(table: Path, elbow: Family) -> None:
    done = CliRunner().invoke(command, ["families", "-v", str(table), "--no-prove"])
    assert f"boundary, {SAID}; codimension 1 of 4" in done.stdout
    words = ["at", str(table), "--deg", "--q", "0,180,-0.1,0"]
    done = CliRunner().invoke(command, words)
    assert f"F1: 0°, on it; the family is {SAID}" in " ".join(done.stdout.split())
    arm = pinsing.load(table)
    (entry,) = family_entries(arm, [elbow])
    assert SAID in [*_more(entry)]
    assert SAID in elbow._repr_html_()


def test_in_json_and_back(elbow: Family) -> None:
    data = json.loads(elbow.to_json())
    assert [v["reachability"] for v in data["value_reach"]] == ["reachable", "not reachable"]
    again = Family.from_json(elbow.to_json())
    assert again.reach == SAID
    del data["value_reach"]  # what was saved before
    assert Family.from_json(json.dumps(data)).reach == "within the joint limits"


def test_in_the_report(table: Path, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    done = CliRunner().invoke(command, ["report", str(table), "-o", str(path)])
    assert done.exit_code == 0, done.stderr
    assert SAID in path.read_text(encoding="utf-8")


def test_where_all_values_are_inside_nothing_is_added() -> None:
    for family in closed("ur5").families:
        assert family.reach == "within the joint limits"
    found = distances(closed("ur5"), np.full(6, 0.3))
    assert all(d.reachability == "within the joint limits" for d in found.families)
    assert len(distance_words(found, True, arm_of("ur5").prismatic)) == 3


def test_a_whole_turn_more_is_within() -> None:
    limits = np.array([math.radians(190)]), np.array([math.radians(370)])
    branches = [Branch((JointValue(0, v, True),), ()) for v in (0.0, math.pi, -math.pi / 2, 1.0)]
    slides = np.zeros(1, dtype=bool)
    found = values_reached(branches, limits, slides, Reachability.INSIDE, lambda b: True)
    inside = {round(math.degrees(v.value)): v.reachability is Reachability.INSIDE for v in found}
    assert inside == {0: True, 180: False, -90: True, 57: False}
    words = reach_words(Reachability.INSIDE, found, slides)
    assert words == "within the joint limits with q1 = 0° or -90° (not 57.2958° or 180°)"


def test_a_value_goes_with_the_others_of_its_branch() -> None:
    """q1 = 0 only occurs with q2 = 180°, which is outside: so q1 = 0 is not within reach."""
    limits = np.array([-3.0, -3.0]), np.array([3.0, 3.0])
    pairs = ((0.0, math.pi), (1.0, 0.0))
    branches = [Branch((JointValue(0, a, True), JointValue(1, b, True)), ()) for a, b in pairs]
    slides = np.zeros(2, dtype=bool)
    found = values_reached(branches, limits, slides, Reachability.INSIDE, lambda b: True)
    assert reach_words(Reachability.INSIDE, found, slides) == (
        "within the joint limits with q1 = 57.2958° (not 0°) and q2 = 0° (not 180°)"
    )


def test_where_no_point_was_met_that_is_said() -> None:
    equation = closed("ur5").families[2].branches[0].equations
    branches = [Branch((JointValue(4, v, True),), equation) for v in (0.0, 1.0)]
    limits = np.full(6, -3.0), np.full(6, 3.0)
    slides = np.zeros(6, dtype=bool)
    found = values_reached(
        branches, limits, slides, Reachability.INSIDE, lambda b: b.values[0].value == 0
    )
    assert reach_words(Reachability.INSIDE, found, slides) == (
        "within the joint limits with q5 = 0° (none found with 57.2958°)"
    )


def test_slides_are_metres() -> None:
    branches = [Branch((JointValue(0, v, True),), ()) for v in (0.0, 0.5)]
    limits = np.array([-0.1]), np.array([0.1])
    slides = np.ones(1, dtype=bool)
    found = values_reached(branches, limits, slides, Reachability.INSIDE, lambda b: True)
    words = reach_words(Reachability.INSIDE, found, slides)
    assert words == "within the joint limits with d1 = 0 (not 0.5 m)"
