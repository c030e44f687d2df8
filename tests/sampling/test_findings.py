"""What a sweep has found: the families of arms whose determinants are known, and no others."""

from dataclasses import replace

import arms
import numpy as np
import pinocchio as pin
import pytest

from pinsing.kinematics.jacobian import singular_values
from pinsing.measures import sigma_ratio
from pinsing.robot.load import load
from pinsing.robot.nominal import nominal
from pinsing.sampling.analyze import singular_configurations
from pinsing.sampling.sweeps import sweep

PI = np.pi


def found(arm, **options):
    result = sweep(arm, **options)
    return {str(f.condition): f for f in singular_configurations(arm, result)}, result


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


@pytest.mark.slow
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


@pytest.mark.slow
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
