"""analyze: closed forms, sweep and random search agree, and say so when they do not.

What a sweep has found, and generalisations, against determinants that are known in closed form.
"""

import sys
from dataclasses import replace

import arms
import numpy as np
import pinocchio as pin
import pytest
from dh_arms import dh_arm
from tiers import sampled, tiered

from pinsing.algebra.budget import Stages
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import closed_form
from pinsing.kinematics.jacobian import singular_values
from pinsing.kinematics.refine import refine, refine_many
from pinsing.measures import sigma_ratio
from pinsing.robot.load import load
from pinsing.robot.nominal import nominal
from pinsing.sampling.analyze import analyze, leads_down, random_search, singular_configurations
from pinsing.sampling.generalize import Generalization, generalize, value_text
from pinsing.sampling.sweeps import sweep

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


def shifted(families):
    first = families[0]
    value = first.branches[0].values[0]
    moved = replace(first.branches[0], values=(replace(value, value=0.3),))
    return replace(first, branches=(moved,)), *families[1:]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda families: families[:-1], ["the sweep found q5 = 0", "starts are on no family"]),
        (shifted, ["F1 has samples that Pinocchio finds regular"]),
    ],
    ids=["missing", "wrong"],
)
def test_a_family_that_is_missing_or_wrong_is_reported(change, said, monkeypatch):
    """The sweep and the random search notice the one, Pinocchio at its samples the other."""

    def changed(arm, **options):
        forms = closed_form(arm, **options)
        return replace(forms, families=change(forms.families))

    monkeypatch.setattr(sys.modules["pinsing.sampling.analyze"], "closed_form", changed)
    found = analyze(load("stanford"))
    assert not found.agree
    assert all(any(words in problem for problem in found.problems) for words in said)
    assert "CONTRADICTIONS" in str(found)


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
    less = replace(flat, families=flat.families[1:])
    assert len(random_search(flat.geometry.arm, less, 100, 3, Stages(60.0)).off) > 20


def test_a_set_that_meets_a_family_is_no_valley_of_it():
    form = closed_form(load("ur5"))
    elbow = next(f for f in form.families if f.joints == ("elbow_joint",))
    less = replace(form, families=(elbow,))
    for e in (1e-3, 1e-4):
        assert not leads_down(form.geometry.arm, less, [0.3, 0.8, e, 1.1, 0.0, 0.2])


PI = np.pi


def found(arm, **options):
    """Findings by their conditions, each of which holds on its representative; and the sweep."""
    result = sweep(arm, **options)
    findings = singular_configurations(arm, result)
    for f in findings:
        c = f.configuration
        assert (c.sigma_ratio <= 1e-9) == (f.status == "singular")
        at = [c.q[arm.joints.index(joint)] for joint in f.condition.fixed]
        away = np.subtract(at, list(f.condition.fixed.values()))
        assert f.status != "singular" or np.exp(1j * away) == pytest.approx(1, abs=1e-6)
        assert not f.reachable or arm.within_limits(c.q)
    return {str(f.condition): f for f in findings}, result


def test_surgical_arm():
    """All families of Table 2's geometry, those that the paper misses included."""
    arm = arms.textbook("surgical7")
    findings, _ = found(arm, nominal=[0.3, *[PI / 3] * 6], ignore_limits=True)
    tilt, over = "-11.5370 deg (-0.201358 rad)", "-168.4630 deg (-2.940235 rad)"
    straight = "0", "180 deg"
    assert set(findings) == {
        *(f"q4 = {a}" for a in straight),
        *(f"q2 = {a} and q3 = {b}" for a in straight for b in straight),
        *(f"q5 = {a} and q6 = {b}" for a in ("90 deg", "-90 deg") for b in (tilt, over)),
        *(f"q2 = {a} and a relation between q4, q5 and q6" for a in straight),
    }
    values = [f.condition.fixed["q6"] for f in findings.values() if "q6" in f.condition.fixed]
    np.testing.assert_allclose(np.sin(values), -0.2, atol=1e-12)


def test_puma_and_ur5():
    """One factor of each is a relation of several angles, where the paper's method fails."""
    puma, _ = found(arms.textbook("puma560"), ignore_limits=True)
    assert {"q5 = 0", "q5 = 180 deg", "a relation between q2 and q3"} < set(puma)
    low, high = sorted(f.condition.fixed["q3"] for f in puma.values() if "q3" in f.condition.fixed)
    assert high - low == pytest.approx(PI, abs=1e-9)
    assert len(puma) == 5
    assert puma["q5 = 180 deg"].reachable is False
    ur5, _ = found(arms.ur5())
    relation = "a relation between shoulder_lift_joint, elbow_joint and wrist_1_joint"
    values = {f"{j} = {x}" for j in ("elbow_joint", "wrist_2_joint") for x in ("0", "180 deg")}
    assert set(ur5) == {relation} | values
    shoulder = ur5[relation]
    assert shoulder.reachable
    q = shoulder.configuration.q
    assert sigma_ratio(singular_values(nominal(arms.ur5()).arm, q))[0] <= 1e-9


@pytest.mark.slow
def test_findings_of_a_file_that_is_rounded_and_of_others():
    assert all(found(arms.textbook(name))[0] for name in ("irb1400", "iiwa14"))
    rounded, _ = found(arms.data_robot("xarm_description/urdf/xarm7.urdf", tip="link7"))
    assert rounded
    for f in rounded.values():
        assert 1e-9 < f.raw_ratio < 1e-5
        assert "on the file as it is the ratio is" in str(f)


def test_singular_only_outside_the_limits():
    """Limits keep q2 away from 0 and 180 deg: both are found all the same, and labelled."""
    arm = arms.planar((1.0, 0.8))
    arm = replace(arm, lower=np.array([-3.0, 0.01]), upper=np.array([3.0, 3.0]))
    findings, result = found(arm)
    assert set(findings) == {"q2 = 0", "q2 = 180 deg"}
    assert all(f.reachable is False for f in findings.values())
    assert not any(f.configuration.within_limits for f in findings.values())
    assert all(arm.lower[1] <= c.x.min() for c in result.curves if c.moving == 1)


def test_valleys_without_a_singularity():
    """Three axes that are almost parallel: rank 3 everywhere, and almost lost where q2 = 0."""
    model = arms.planar((0.4, 0.3, 0.2), task="pose").model.copy()
    place = model.jointPlacements[2]
    place.rotation = pin.utils.rotate("x", 5e-3)
    model.jointPlacements[2] = place
    findings, _ = found(load(model, tip="tip"))
    for f in findings.values():
        assert f.status == f.configuration.status == "near-singular"
        assert 1e-4 < f.configuration.sigma_ratio < 1e-2
        assert set(f.condition.fixed) == {"q2"}
        assert f.condition.worst_ratio < 1e-2
        assert "near-singular, sigma_r/sigma_1 = " in str(f)
    ends = [abs(np.sin(f.condition.fixed["q2"])) for f in findings.values()]
    assert len(ends) == 2
    assert max(ends) < 0.05


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
        # That the paper cannot find.
        ("puma560", [0.3, 1.1086123528146912, -0.6, 0.7, 0.9, 0.9],
         {"a relation between q2 and q3"}),
        # The elbow hardly moves beside where it is stretched.
        ("gofa5", [0.3, 0.5, 1.80070075, 0, 0.7, 0.2],
         {"a relation between q2, q3, q4 and q5"}),
        ("planar3r", [0.3, PI, 0.5], {"q2 = 180 deg"}),
        ("scara", [0.3, 0.0, 0.1, 0.5], {"q2 = 0"}),
    ],
)  # fmt: skip
def test_known_families(name, q, expected):
    arm = load(name) if name == "gofa5" else arms.textbook(name)
    for seed in (0, 3, 4):
        found = generalize(arm, q, seed=seed).conditions
        assert {str(c) for c in found} == expected
        assert all(c.minimal == ("a relation" not in str(c)) for c in found)


@pytest.mark.parametrize("values", [{1: 0.0}, {5: 0.0}, {2: 0.0, 4: 0.0}, {1: 0.0, 2: 0.0}])
def test_iiwa_negatives(values):
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
    with pytest.raises(OptionError, match="has 6 joints"):
        generalize(shifted, [0.3, -5e-5], geometry=arms.textbook("stanford"))
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


def test_value_text():
    said = [value_text(x) for x in (0.0, PI, -PI / 2, 1.0)]
    assert said == ["0", "180 deg", "-90 deg", "57.2958 deg (1.000000 rad)"]
    assert value_text(0.25, prismatic=True) == "0.25 m"
