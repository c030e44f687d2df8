"""Postures next to singular configurations, of nearly singular arms, and what was asked wrongly."""

from dataclasses import replace

import pytest
from dh_arms import arm_of, aspects_of, dh_arm, form_of

import pinsing
from pinsing.errors import OptionError

PUMA_LIKE = [
    (-90, 0, 0), (0, 1, 0.2), (-90, 0.02, 0), (90, 0, 1), (-90, 1.0e-9, 0), (0, 0, 0),
]  # fmt: skip


def test_aspects_of_another_arm_are_refused():
    ur5 = form_of("ur5")
    with pytest.raises(OptionError, match="another arm"):
        pinsing.connect(form_of("puma560"), [0.1] * 6, [0.2] * 6, of=aspects_of("ur5"))
    with pytest.raises(OptionError, match="another arm"):
        pinsing.postures.aspect_changes(
            form_of("puma560"), [[0.1] * 6, [0.2] * 6], of=aspects_of("ur5")
        )
    again = pinsing.closed_form(replace(arm_of("ur5")))
    assert again is not ur5
    way = pinsing.connect(again, [0.1] * 6, [0.2] * 6, of=aspects_of("ur5"))
    assert way.answer == "same"


@pytest.mark.slow
def test_an_arm_that_rounding_made_cuspidal():
    found = pinsing.cuspidality(dh_arm(PUMA_LIKE), poses=5)
    assert found.answer == "cuspidal"
    assert found.proven
    assert found.least_ratio < 1e-5
    (said,) = [n for n in found.notes if "practically singular" in n]
    assert "not cuspidal" in said


@pytest.mark.slow
@pytest.mark.parametrize("q", [(0, 0, 0, 0, 0, 0), (0.1, -1, 1.2, 0.3, 0, 0.2)])
def test_singular_solutions_on_a_curve_are_examples_and_no_count(q):
    """With q5 = 0 joints 2, 3, 4 and 6 turn about parallel axes: one freedom more than needed."""
    arm = pinsing.load("ur5")
    found = pinsing.posture_changes(arm, q)
    regular = [other for other in found.others if other.solution.regular]
    singular = len(found.others) - len(regular)
    first, *rest = found.text().splitlines()
    assert singular > 4
    assert first.startswith(f"ur5: {len(regular)} other postures of this pose; this one is sing")
    assert any(f"Singular solutions too (examples, {singular} found)" in line for line in rest)
    assert "infinitely many" in found.doubt
    assert not any("was not found" in note for note in found.notes)
