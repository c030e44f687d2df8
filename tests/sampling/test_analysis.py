"""analyze: closed forms, sweep and random search agree, and say so when they do not."""

import sys
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from dh_arms import dh_arm
from tiers import sampled, tiered

from pinsing.algebra.budget import Stages
from pinsing.errors import OptionError
from pinsing.families import closed_form
from pinsing.robot.load import load
from pinsing.sampling.analyze import analyze, leads_down, random_search

ARMS = ("stanford", "surgical7", "puma560", "scara", "planar3r", "iiwa14", "ur5", "so101", "z1")


@pytest.mark.parametrize(
    "name", sampled(tiered(ARMS, ("stanford", "puma560", "scara", "planar3r", "ur5")))
)
def test_all_three_agree(name):
    found = analyze(load(name), random_starts=100)
    assert found.problems == ()
    assert found.agree
    assert found.complete
    assert all(found.family_of)
    assert found.random_search.on_family == found.random_search.singular > 0
    assert all(c.samples > 0 and c.nominal_ratio <= 1e-9 for c in found.checks)
    assert [c.family for c in found.checks] == [f.name for f in found.families]


def test_a_missing_family_is_reported(monkeypatch):
    """Take a family away: the sweep and the random search must both notice."""
    honest = closed_form

    def forgetful(arm, **options):
        forms = honest(arm, **options)
        return replace(forms, families=forms.families[:-1])

    monkeypatch.setattr(sys.modules["pinsing.sampling.analyze"], "closed_form", forgetful)
    found = analyze(load("stanford"))
    assert not found.agree
    assert any("the sweep found q5 = 0" in p for p in found.problems)
    assert any("random starts are on no family" in p for p in found.problems)
    assert "CONTRADICTIONS" in str(found)


def test_a_wrong_family_is_reported(monkeypatch):
    """Shift a family's value: its samples are regular in Pinocchio."""
    honest = closed_form

    def wrong(arm, **options):
        forms = honest(arm, **options)
        first = forms.families[0]
        value = first.branches[0].values[0]
        moved = replace(first.branches[0], values=(replace(value, value=0.3),))
        return replace(forms, families=(replace(first, branches=(moved,)), *forms.families[1:]))

    monkeypatch.setattr(sys.modules["pinsing.sampling.analyze"], "closed_form", wrong)
    found = analyze(load("stanford"))
    assert any("F1 has samples that Pinocchio finds regular" in p for p in found.problems)


@pytest.mark.slow
def test_snap_length_takes_noise_out():
    """An iiwa whose elbow is 0.4 mm off: S-R-S families come back with snap_length."""
    model = load("iiwa14").source.full_model.copy()
    shifted = pin.SE3(model.jointPlacements[4])
    shifted.translation = shifted.translation + np.array([0.000436, 0.0, 0.0])
    model.jointPlacements[4] = shifted
    arm = load(model)
    texts = [f.text for f in closed_form(arm, snap_length=1e-3).families]
    assert texts == [f.text for f in closed_form(load("iiwa14")).families]
    assert [f.text for f in closed_form(arm).families] != texts
    found = analyze(arm, snap_length=1e-3, random_starts=20)
    assert found.agree
    assert found.closed_form.snaps
    worst = max(c.raw_ratio for c in found.checks)
    assert 1e-6 < worst < 1e-2  # a near-singular valley, not a singularity, of the file


def test_stopped_sweep_keeps_what_is_done():
    def impatient(done: int, total: int) -> None:
        if done > 0:
            raise KeyboardInterrupt

    found = analyze(load("ur5"), progress=impatient, random_starts=10)
    assert not found.sweep_complete
    assert found.complete
    assert "stopped before its end" in str(found)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"geometry": "both of them"}, "geometry must be"),
        ({"random_starts": -1}, "random_starts"),
        ({"seconds": 0}, "seconds must be positive"),
        ({"angle_tol": 2.0}, "angle_tol"),
        ({"snap_length": -1.0}, "snap_length"),
    ],
)
def test_bad_options(options, message):
    with pytest.raises(OptionError, match=message):
        analyze(load("planar3r"), **options)


# ---- what random starts meet: on a family, in a valley of one, or on none


@pytest.fixture(scope="module")
def flat():
    """An arm whose row falls like the cube of the distance beside q2 = 0, q3 = 180 degrees."""
    rows = (90, 0.1, 0.3), (90, 0.2, 0), (0, 0.2, 0.1)
    return closed_form(dh_arm([(*row, 0, "continuous") for row in rows], "vz"))


def test_ends_in_a_flat_valley_belong_to_the_family_at_its_end(flat):
    found = random_search(flat.geometry.arm, flat, 60, 3, Stages(60.0))
    assert found.singular > 40
    assert len(found.off) == 0
    hurried = random_search(flat.geometry.arm, flat, 60, 3, Stages(1e-9))
    assert hurried.singular < found.singular, "ends that no time was left to follow are not told"
    assert len(hurried.off) == 0


def test_a_family_that_is_missing_is_noticed(flat):
    less = replace(flat, families=flat.families[1:])
    found = random_search(flat.geometry.arm, less, 100, 3, Stages(60.0))
    assert len(found.off) > 20


def test_a_set_that_meets_a_family_is_no_valley_of_it():
    form = closed_form(load("ur5"))
    elbow = next(f for f in form.families if f.joints == ("elbow_joint",))
    less = replace(form, families=(elbow,))
    for e in (1e-3, 1e-4):
        assert not leads_down(form.geometry.arm, less, [0.3, 0.8, e, 1.1, 0.0, 0.2])
