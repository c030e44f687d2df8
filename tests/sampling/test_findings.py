"""What a sweep has found: the families of arms whose determinants are known, and no others."""

from dataclasses import replace

import arms
import numpy as np
import pinocchio as pin
import pytest
from singular_sets import dips

from pinsing.errors import OptionError, ResultError, UnknownNameError
from pinsing.families import closed_form
from pinsing.kinematics.jacobian import singular_values
from pinsing.measures import Reachability, sigma_ratio
from pinsing.robot.load import load
from pinsing.robot.nominal import nominal
from pinsing.sampling.analyze import singular_configurations
from pinsing.sampling.generalize import Finding
from pinsing.sampling.sweep_run import sweep

PI = np.pi
_ENDS = ("0", "180 deg")


def found(arm, **options):
    result = sweep(arm, **options)
    return {str(f.condition): f for f in singular_configurations(arm, result)}, result


def test_stanford():
    """det = d3^2 sin q2 sin q5, up to sign: five conditions, and q1, q4, q6 in none of them."""
    findings, result = found(arms.textbook("stanford"))
    assert list(findings) == ["q2 = 0", "q2 = 180 deg", "d3 = 0", "q5 = 0", "q5 = 180 deg"]
    for f in findings.values():
        assert f.reachable
        assert f.configuration.within_limits
        assert f.configuration.rank == 5
        assert f.raw_ratio <= 1e-9
        assert f.seen >= len(f.curves) > 0
        assert all(0 <= c < len(result.curves) for c in f.curves)
    kinds = [f.configuration.kind for f in findings.values()]
    assert kinds == ["boundary", "boundary", "undecided", "interior", "interior"]


def test_surgical_arm():
    """All families of Table 2's geometry, those that the paper misses included."""
    arm = arms.textbook("surgical7")
    findings, _ = found(arm, nominal=[0.3, *[PI / 3] * 6], ignore_limits=True)
    tilt, over = "-11.5370 deg (-0.201358 rad)", "-168.4630 deg (-2.940235 rad)"
    assert set(findings) == {
        "q4 = 0",
        "q4 = 180 deg",
        *(f"q2 = {a} and q3 = {b}" for a in ("0", "180 deg") for b in ("0", "180 deg")),
        *(f"q5 = {a} and q6 = {b}" for a in ("90 deg", "-90 deg") for b in (tilt, over)),
        "q2 = 0 and a relation between q4, q5 and q6",
        "q2 = 180 deg and a relation between q4, q5 and q6",
    }
    values = [f.condition.fixed["q6"] for f in findings.values() if "q6" in f.condition.fixed]
    np.testing.assert_allclose(np.sin(values), -0.2, atol=1e-12)


def test_puma_and_ur5():
    """One factor of each is a relation of several angles, where the paper's method fails."""
    puma, _ = found(arms.textbook("puma560"), ignore_limits=True)
    names = set(puma)
    assert {"q5 = 0", "q5 = 180 deg", "a relation between q2 and q3"} < names
    elbow = sorted(f.condition.fixed["q3"] for f in puma.values() if "q3" in f.condition.fixed)
    assert len(elbow) == 2
    assert elbow[1] - elbow[0] == pytest.approx(PI, abs=1e-9)
    assert len(names) == 5
    assert puma["q5 = 180 deg"].reachable is False
    ur5, _ = found(arms.ur5())
    assert set(ur5) == {
        "elbow_joint = 0",
        "elbow_joint = 180 deg",
        "wrist_2_joint = 0",
        "wrist_2_joint = 180 deg",
        "a relation between shoulder_lift_joint, elbow_joint and wrist_1_joint",
    }
    shoulder = ur5["a relation between shoulder_lift_joint, elbow_joint and wrist_1_joint"]
    assert shoulder.reachable
    q = shoulder.configuration.q
    assert sigma_ratio(singular_values(nominal(arms.ur5()).arm, q))[0] <= 1e-9


def test_iiwa_within_its_limits():
    findings, _ = found(arms.textbook("iiwa14"))
    assert set(findings) == {
        "q4 = 0", "q2 = 0 and q3 = 90 deg", "q2 = 0 and q3 = -90 deg", "q2 = 0 and q6 = 0",
        "q5 = 90 deg and q6 = 0", "q5 = -90 deg and q6 = 0",
    }  # fmt: skip
    assert all(f.reachable for f in findings.values())


def test_fewer_joints_and_other_tasks():
    scara, _ = found(arms.textbook("scara"))
    assert list(scara) == ["q2 = 0", "q2 = 180 deg"]
    assert [f.reachable for f in scara.values()] == [True, False]
    assert "outside the limits" in str(scara["q2 = 180 deg"])
    planar, _ = found(arms.planar((1.0, 0.8, 0.5)))
    assert set(planar) == {f"q2 = {a} and q3 = {b}" for a in _ENDS for b in _ENDS}
    assert planar["q2 = 0 and q3 = 0"].configuration.kind == "boundary"
    assert planar["q2 = 180 deg and q3 = 0"].configuration.kind == "interior"


def test_every_finding_holds_on_its_representative():
    for make in (arms.ur5, lambda: arms.textbook("irb1400"), lambda: arms.textbook("iiwa14")):
        arm = make()
        for f in found(arm)[0].values():
            c = f.configuration
            assert c.sigma_ratio <= 1e-9
            for name, value in f.condition.fixed.items():
                away = c.q[arm.joints.index(name)] - value
                assert abs(np.sin(away)) < 1e-6
                assert np.cos(away) > 0
            if f.reachable:
                assert arm.within_limits(c.q)


def test_raw_geometry_is_said():
    arm = arms.data_robot("xarm_description/urdf/xarm7.urdf", tip="link7")
    findings, _ = found(arm)
    assert findings
    for f in findings.values():
        assert f.configuration.sigma_ratio <= 1e-9
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
    arm = load(model, tip="tip")
    findings, _ = found(arm)
    assert findings
    for f in findings.values():
        assert f.status == f.configuration.status == "near-singular"
        assert 1e-4 < f.configuration.sigma_ratio < 1e-2
        assert set(f.condition.fixed) == {"q2"}
        assert f.condition.worst_ratio < 1e-2
        assert "near-singular, sigma_r/sigma_1 = " in str(f)
    ends = sorted(abs(np.sin(f.condition.fixed["q2"])) for f in findings.values())
    assert len(ends) == 2
    assert ends[1] < 0.05


@pytest.mark.slow
def test_random_starts_add_nothing_that_the_sweep_has_missed():
    arm = arms.textbook("surgical7")
    result = sweep(arm)
    plain = singular_configurations(arm, result)
    more = singular_configurations(arm, result, random_starts=300)
    assert {str(f.condition) for f in plain} == {str(f.condition) for f in more}


def test_interrupted_sweep_still_says_what_it_has():
    def stop(done, total):
        if done > total / 2:  # chunks may be done in any order, but the first is among them
            raise KeyboardInterrupt

    arm = arms.textbook("surgical7")
    result = sweep(arm, progress=stop)
    assert not result.complete
    assert {"q4 = 0", "q4 = 180 deg"} <= {
        str(f.condition) for f in singular_configurations(arm, result)
    }


def test_same_again_and_json():
    arm = arms.textbook("puma560")
    result = sweep(arm)
    one, two = (singular_configurations(arm, result) for _ in range(2))
    assert [f.to_json() for f in one] == [f.to_json() for f in two]
    for f in one:
        assert Finding.from_json(f.to_json()).to_json() == f.to_json()


def test_another_arm_is_refused():
    """Both have six joints: the numbers would fit, and mean nothing."""
    result = sweep(load("stanford"), levels=1, samples=7)
    with pytest.raises(OptionError, match=r"sweep is of stanford .* not of ur5"):
        singular_configurations(load("ur5"), result)
    with pytest.raises(UnknownNameError, match="unknown joint 'elbow_joint'"):
        result.set_text({"elbow_joint": 0.0})


def test_dips():
    assert dips(np.array([3.0, 1.0, 2.0, 0.5, 4.0])).tolist() == [1, 3]
    assert dips(np.array([1.0, 2.0, 1.0])).tolist() == [0, 2]
    assert dips(np.array([2.0, 1.0, 1.0, 2.0])).tolist() == [1]
    assert dips(np.full(5, 0.3)).tolist() == []


@pytest.mark.slow
def test_reachability_is_one_word_in_families_and_findings():
    """And JSON stays what it was: a text of a family, true, false or null of a finding."""
    arm = load("scara")
    findings = singular_configurations(arm, sweep(arm, levels=1, samples=9))
    assert {Reachability.INSIDE, Reachability.OUTSIDE} == {f.reachability for f in findings}
    for found in findings:
        data = found.to_dict()
        assert "reachability" not in data
        assert data["reachable"] is found.reachable is found.reachability.known
        assert Finding.from_dict(data).reachability is found.reachability
    form = closed_form(load("panda"))
    data = form.to_dict()["families"]
    assert {f["reachability"] for f in data} == {"reachable", "not reachable"}
    assert all(type(f["reachability"]) is str for f in data)
    again = type(form).from_json(form.to_json())
    assert [f.reachability for f in again.families] == [f.reachability for f in form.families]
    assert all(isinstance(f.reachability, Reachability) for f in again.families)
    with pytest.raises(ResultError, match="damaged"):
        type(form).from_json(form.to_json().replace('"not reachable"', '"perhaps"'))
    with pytest.raises(ResultError, match="damaged"):
        Finding.from_dict({**findings[0].to_dict(), "reachable": "yes"})
    assert [Reachability.of(r.known) for r in Reachability] == [
        Reachability.INSIDE,
        Reachability.INSIDE,
        Reachability.OUTSIDE,
        Reachability.UNKNOWN,
    ]
