"""The compiled kernel stands in for Pinocchio's loop only where it agrees with it."""

import shutil
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from kernel import needs_kernel

import pinsing
from pinsing._batch import engine as kernel
from pinsing._batch.built_from import SUFFIXES, fingerprint, why_stale
from pinsing.errors import EngineError, OptionError
from pinsing.kinematics import jacobian as kinematics
from pinsing.robot.load import load


def configurations(arm, n=200):
    return np.random.default_rng(1).uniform(-3, 3, (n, arm.n))


@needs_kernel
def test_a_kernel_that_differs_is_refused(monkeypatch):
    arm = load("ur5")
    honest = kernel.jacobians
    monkeypatch.setattr(kernel, "jacobians", lambda *a, **k: honest(*a, **k) + 1e-11)
    assert kinematics.fixed_engine(arm) == kinematics.PINOCCHIO
    assert "differs from Pinocchio" in kinematics.engine_name(arm)
    with pytest.raises(EngineError, match="differs from Pinocchio"):
        kinematics.frame_jacobians(arm, np.zeros((1, 6)), engine="batch")
    J = kinematics.frame_jacobians(arm, np.zeros((1, 6)))[0]
    np.testing.assert_array_equal(J, kinematics.frame_jacobian(arm, np.zeros(6)))


@needs_kernel
def test_a_kernel_of_other_sources_is_not_used(tmp_path):
    """In a copy of the folder where one line of C++ has changed since the build."""
    here = Path(kernel.__file__).parent
    built = fingerprint(here)
    if built is None:
        pytest.skip("an installation without sources")
    assert built == kernel._kernel.SOURCES  # CMake computes the same
    assert why_stale(built, here) is None
    assert "build it again with pip install" in why_stale(None, here)  # of before fingerprints
    assert "build it again with pip install" in why_stale("0" * 64, here)
    for file in here.iterdir():
        if file.suffix in SUFFIXES:
            shutil.copy(file, tmp_path)
    assert why_stale(built, tmp_path) is None
    with (tmp_path / "module.hpp").open("a") as file:
        file.write("// changed\n")
    assert "\n" not in why_stale(built, tmp_path)
    for file in tmp_path.iterdir():
        file.unlink()
    assert why_stale(built, tmp_path) is None  # a wheel without sources
    assert why_stale(None, tmp_path) is None


def test_a_kernel_of_other_sources_is_left_aside_and_zones_say_so(monkeypatch):
    monkeypatch.setattr(kernel, "_missing", "it is older than the sources")
    arm = load("scara")
    assert pinsing.at(arm, [0, 0.5, 0.1, 0]).q[1] == 0.5
    assert "older than the sources" in kinematics.engine_name(arm)
    form = pinsing.closed_form(arm)
    with pytest.raises(EngineError, match="zones need the compiled kernel: it is older"):
        pinsing.zones(form, joint_speeds=[5, 5, 1, 10])


@pytest.mark.parametrize("rounded", [-1e-12, 0.0, 1e-12])
def test_half_a_turn_is_negative_however_it_is_rounded(rounded):
    near = load("ur5").space.wrap(np.full(6, np.pi + rounded))
    np.testing.assert_allclose(near, -np.pi, atol=1e-9)


def test_without_the_kernel_pinocchio_runs(monkeypatch):
    monkeypatch.setattr(kernel, "unavailable_reason", lambda: "not built")
    arm = load("ur5")
    Q = configurations(arm, 3)
    assert kinematics.engine_name(arm) == "Pinocchio and NumPy (not built)"
    data = arm.model.createData()
    for q, J in zip(Q, kinematics.frame_jacobians(arm, Q), strict=True):
        expected = pin.computeFrameJacobian(arm.model, data, q, arm.tip_id, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_array_equal(J, expected)
    assert kinematics.singular_values(arm, Q).shape == (3, 6)
    with pytest.raises(EngineError, match="not built"):
        kinematics.singular_values(arm, Q, engine="batch")


def test_bad_options():
    arm = load("ur5")
    with pytest.raises(OptionError, match="unknown engine 'gpu'"):
        kinematics.frame_jacobians(arm, np.zeros((1, 6)), engine="gpu")
    with pytest.raises(OptionError, match="threads must be at least 1"):
        kinematics.singular_values(arm, np.zeros((1, 6)), threads=0)
