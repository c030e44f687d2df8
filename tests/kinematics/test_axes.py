"""Which axes are dependent, and the words for it, on arms whose geometry is known."""

import functools
import itertools
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from arms import place, serial
from scipy.optimize import brentq

from pinsing.families import closed_form
from pinsing.kinematics.at import at
from pinsing.kinematics.jacobian import frame_jacobian, task_jacobian, tip_placement
from pinsing.kinematics.lost_motion import DEPENDENCE_RTOL, ColumnRanks, JointAxes, dependences_of
from pinsing.robot.arm import Arm, Coupling
from pinsing.robot.load import load
from pinsing.robot.nominal import nominal

HALF_PI = np.pi / 2


@functools.cache
def exact(name: str, task: str = "pose") -> Arm:
    return nominal(load(name, task=task)).arm


def axis_dependences(arm: Arm, q, rtol: float = DEPENDENCE_RTOL):
    J, tip = frame_jacobian(arm, q), np.array(tip_placement(arm, q).translation)
    (axes,) = JointAxes.each(J[None], arm.prismatic, tip)
    return dependences_of(arm, J, np.asarray(q, dtype=float), axes, rtol)


def dependent_axes(arm: Arm, q, rtol: float = DEPENDENCE_RTOL):
    return next(iter(axis_dependences(arm, q, rtol)), None)


def chain(*joints: tuple[object, tuple[float, float, float]], tip: tuple[float, float, float]):
    """A model of given joints, each placed after the one before without turning."""
    return serial([(joint, place(at)) for joint, at in joints], place(tip), -3, 3)


def only(name: str, q: list[float], task: str = "pose"):
    found = axis_dependences(exact(name, task), q)
    assert len(found) == 1
    return found[0]


@pytest.mark.parametrize(
    ("name", "q", "indices", "reason"),
    [
        ("puma560", [0.1, 0.2, 0.3, 0.4, 0, 0.5], (3, 5), "axes 4 and 6 are collinear"),
        ("stanford", [0.1, 0.7, 0.3, 0.4, 0, 0.5], (3, 5), "axes 4 and 6 are collinear"),
        ("stanford", [0.1, 0.7, 0, 0.4, 0.7, 0.5], (1, 3, 4, 5),
         "the wrist centre (where axes 4, 5 and 6 meet) lies on axis 2"),
        ("stanford", [0.1, 0, 0.3, 0.4, 0.7, 0.5], (0, 1, 3, 4, 5),
         "the wrist centre (where axes 4, 5 and 6 meet) lies in the plane of axes 1 and 2"),
        ("ur5", [0, -1, 1, 0.3, 0, 0.2], (1, 2, 3, 5), "axes 2, 3, 4 and 6 are parallel"),
        ("ur5", [0.1, -1, 0, 0.3, 1, 0.2], (1, 2, 3),
         "axes 2, 3 and 4 are parallel and lie in one plane"),
        ("planar3r", [0.1, 0, 0], (0, 1, 2), "axes 1, 2 and 3 are parallel and lie in one plane"),
        ("scara", [0.1, 0, 0.02, 0.3], (0, 1, 3),
         "axes 1, 2 and 4 are parallel and lie in one plane"),
    ],
)  # fmt: skip
def test_known_reasons(name, q, indices, reason):
    found = only(name, q)
    assert found.indices == indices
    assert found.joints == tuple(exact(name).joints[i] for i in indices)
    assert found.reason == str(found) == reason


@pytest.mark.parametrize(
    ("name", "q", "joint", "between", "reason"),
    [
        ("puma560", [0.1, 0.2, 0, 0.4, 0.9, 0.5], 2, (-1.7, -1.3),
         "the wrist centre (where axes 4, 5 and 6 meet) lies in the plane of the parallel axes 2 "
         "and 3"),
        ("puma560", [0.1, 0, 0.3, 0.4, 0.9, 0.5], 1, (0.5, 0.8),
         "the wrist centre (where axes 4, 5 and 6 meet) lies in the plane of axes 1 and 2"),
        ("irb1400", [0.1, 0, 0.3, 0.4, 0.9, 0.5], 1, (-1.3, -1.0),
         "the wrist centre (where axes 4, 5 and 6 meet) lies on axis 1"),
        ("ur5", [0.1, -1, 0, 0.3, 0.8, 0.2], 2, (-1.6, -1.3),
         "axes 1, 5 and 6 meet a common line, and axes 2, 3 and 4 are parallel to it"),
    ],
)  # fmt: skip
def test_reasons_off_the_special_angles(name, q, joint, between, reason):
    arm = exact(name)

    def det(x: float) -> float:
        return float(np.linalg.det(task_jacobian(arm, [*q[:joint], x, *q[joint + 1 :]])))

    q[joint] = brentq(det, *between, xtol=1e-15)
    assert only(name, q).reason == reason


def test_reasons_of_the_iiwa():
    q = np.array([0.1, 0.7, 0.3, 0.8, 0.4, 0.5, 0.6])
    elbow = only("iiwa14", [*q[:3], 0, *q[4:]])
    assert elbow.reason == (
        "axes 3 and 5 are collinear; "
        "axes 1, 2, 4, 6 and 7 meet a common line, and axes 3 and 5 are parallel to it"
    )
    both = only("iiwa14", [0.1, 0, 0.3, 0.8, 0.4, 0, 0.6])
    assert both.indices == (0, 2, 4, 6)
    assert both.reason.startswith("axes 1 and 3 are collinear; axes 5 and 7 are collinear; ")
    # Known negatives: collinear axes that the other joints make up for.
    for regular in ([0.1, 0, *q[2:]], [*q[:5], 0, 0.6]):
        assert dependent_axes(exact("iiwa14"), regular) is None


@pytest.mark.parametrize(
    ("name", "q"),
    [
        ("ur5", [0.3, -0.4, 0, 0.1, 0, 0.2]),
        ("stanford", [0, 0, 0, 0, 0, 0]),
        ("puma560", [0.1, 0.2, 0.3, 0.4, 0, 0.5]),
        ("stanford", [0.1, 0, 0.3, 0.4, 0.7, 0.5]),
    ],
)
def test_smallest_set_by_brute_force(name, q):
    arm = exact(name)
    J = task_jacobian(arm, q)
    zero = 1e-8 * np.linalg.norm(J, 2)

    def rank(ids):
        return int((np.linalg.svd(J[:, ids], compute_uv=False) > zero).sum())

    found = axis_dependences(arm, q)
    assert len(found) == 6 - rank(list(range(6)))  # one reason for each rank lost
    smallest = min(
        size
        for size in range(1, 7)
        for ids in itertools.combinations(range(6), size)
        if rank(list(ids)) < size
    )
    assert len(found[0].indices) == smallest
    for dependence in found:
        ids = list(dependence.indices)
        assert rank(ids) < len(ids)


RX, RY, RZ = pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ
PX, PY = pin.JointModelPX, pin.JointModelPY


HERE, AWAY = (0, 0, 0), (1, 0, 0)


@pytest.mark.parametrize(
    ("joints", "q", "reason"),
    [
        # A slider across two parallel axes, perpendicular to their plane at q2 = pi/2.
        ([(PX(), HERE), (RZ(), HERE), (RZ(), AWAY)], [0.1, HALF_PI, 0.3],
         "prismatic joint 1 is perpendicular to the plane of axes 2 and 3"),
        # A slider that the second joint turns into the plane of the others.
        ([(PX(), HERE), (PY(), HERE), (RZ(), HERE), (PX(), AWAY)], [0.1, 0.2, 0.3, 0.4], None),
        ([(PX(), HERE), (RZ(), HERE), (PX(), (0.4, 0, 0))], [0.1, 0, 0.3],
         "prismatic joints 1 and 3 are parallel"),
        # Three axes through one point, in one plane at q2 = 0.
        ([(RZ(), HERE), (RX(), HERE), (RY(), HERE)], [0.1, HALF_PI, 0.2],
         "axes 1 and 3 are collinear"),
    ],
)  # fmt: skip
def test_reasons_with_sliders_and_short_chains(joints, q, reason):
    arm = load(chain(*joints, tip=(0.3, 0.2, 0.1)))
    found = dependent_axes(arm, q)
    assert (found and found.reason) == reason


def test_near_a_singularity_the_words_are_of_the_singular_configuration_beside():
    """A hundredth off the wrist singularity loose ranks would blame joints 2, 4 and 6 together."""
    for robot in ("puma560", "irb1400", "rv7frl", "meca500"):
        arm = load(robot)
        wrist = closed_form(arm, prove=False)["wrist"]
        for q in wrist.points(5, np.random.default_rng(3)):
            state = at(arm, q + 0.01 * np.eye(6)[4])
            assert state.status == "near-singular"
            assert [d.reason for d in state.dependences] == ["axes 4 and 6 are collinear"]
            assert "near where" in state.text()


def test_mimic_joints_have_no_axis_of_their_own():
    model = chain((RZ(), HERE), (RZ(), AWAY), (RZ(), AWAY), tip=AWAY)
    free = load(model, tip="tip", task="position")
    first, follows = slice(0, 2), np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    arm = replace(
        free,
        joints=free.joints[first],
        prismatic=free.prismatic[first],
        lower=free.lower[first],
        upper=free.upper[first],
        coupling=Coupling(follows, np.zeros(3)),
    )
    found = dependent_axes(arm, [0.3, 0.0])
    assert found.reason == "joints 1 and 2 can move together with the tip at rest"


# Ranks of all sets of columns ------------------------------------------------------------


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(
    ("name", "q"),
    [
        ("puma560", [0.1, 0.2, 0.3, 0.4, 0, 0.5]),
        ("stanford", [0.1, 0, 0.3, 0.4, 0, 0.5]),
        ("iiwa14", [0.1, 0, 0.3, 1.4, np.pi / 2, 0, 0.5]),
        ("ur5", [0, 0, 0, 0, 0, 0]),
    ],
)
def test_ranks_of_all_sets_are_those_of_each(name, q, compiled, monkeypatch):
    """All sets at once, with or without the kernel, and each set by LAPACK."""
    if not compiled:
        monkeypatch.setattr("pinsing._batch.engine._missing", "not installed")
    arm = exact(name)
    found = ColumnRanks(arm, frame_jacobian(arm, q), np.array(q), 1e-8)
    for size in range(1, len(q) + 1):
        for ids in itertools.combinations(range(len(q)), size):
            sigma = np.linalg.svd(found.J[:, ids], compute_uv=False)
            assert found.rank(ids) == (sigma > found.zero).sum(), ids
            general = np.linalg.svd(found.generic[:, :, ids], compute_uv=False)
            assert found.generic_rank(ids) == (general > 1e-9 * general.max()).sum(axis=1).max()
    assert found.lost > 0
