"""Real points of components: exact, whatever is smaller than its complex set."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from singular_sets import Joint, build

from pinsing.algebra.budget import Budget
from pinsing.algebra.finite_system import NotFinite, real_solutions
from pinsing.algebra.real_hypersurface import changes_sign, isolated_zeros, semidefinite
from pinsing.algebra.ring import make_ring
from pinsing.algebra.surd_ring import ring_of
from pinsing.families import closed_form
from pinsing.geometry.surd import cosine
from pinsing.kinematics.jacobian import singular_values
from pinsing.robot.arm import Arm
from pinsing.robot.load import load

RIGHT = math.pi / 2


def iiwa_with_offset() -> Arm:
    """The KUKA of ROS-Industrial: axes 2 and 4 stand 0.436 mm beside the others."""
    model = pin.Model()
    model.name = "lbr_iiwa_14_r820"
    y, z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    off = 0.00043624
    rows = [
        ((0, 0, 0), z, 170),
        ((-off, 0, 0.36), y, 120),
        ((0, 0, 0), z, 170),
        ((off, 0, 0.42), -y, 120),
        ((0, 0, 0), z, 170),
        ((0, 0, 0.4), y, 120),
        ((0, 0, 0), z, 175),
    ]
    parent = 0
    for i, (at, axis, limit) in enumerate(rows, 1):
        parent = model.addJoint(
            parent,
            pin.JointModelRevoluteUnaligned(axis),
            pin.SE3(np.eye(3), np.array(at, dtype=float)),
            f"joint_a{i}",
            np.full(1, 1e3),
            np.full(1, 1e3),
            np.full(1, -math.radians(limit)),
            np.full(1, math.radians(limit)),
        )
    place = pin.SE3(np.eye(3), np.array([0, 0, 0.126]))
    model.addFrame(pin.Frame("tool0", parent, 0, place, pin.FrameType.OP_FRAME))
    return load(model, tip="tool0")


def test_joint_values_that_depend_on_each_other_are_stated_exactly():
    arm = iiwa_with_offset()
    form = closed_form(arm)
    assert form.complete, form.gaps
    family = next(f for f in form.families if set(f.joints) == {"joint_a2", "joint_a4"})
    found = sorted(tuple(np.degrees([v[1], v[3]])) for v in family.values)
    expected = [(0.0305, 0.0625), (1.2498, 179.9375), (178.7502, 179.9375), (179.9695, 0.0625)]
    np.testing.assert_allclose(found, expected, atol=6e-5)
    lines = {v.minimal for b in family.branches for v in b.values if v.joint == 3}
    assert lines == {(5453, -10_000_000, 5453)}
    rng = np.random.default_rng(1)
    q = family.points(40, rng)
    sigma = singular_values(form.geometry.arm, q)
    assert (sigma[:, 5] / sigma[:, 0]).max() < 1e-13
    for q2, q4 in ((found[0][0], found[1][1]), (found[1][0], found[0][1])):  # roots that do not fit
        q[:, 1], q[:, 3] = math.radians(q2), math.radians(q4)
        sigma = singular_values(form.geometry.arm, q)
        assert (sigma[:, 5] / sigma[:, 0]).min() > 1e-9
    assert any("snap-length 0.001" in line for line in form.hints)


def test_an_equation_with_a_single_real_point_is_no_surface():
    """0.3 cos q2 + 0.2 cos(q2+q3) + 0.5 is zero at q2 = 180, q3 = 0 only, which q3 = 0 holds."""
    rows = [Joint(d=0.4), Joint(alpha=RIGHT, a=0.5), Joint(a=0.3)]
    form = closed_form(build(rows, tip=(0.2, 0, 0), task="position"))
    assert form.complete
    assert [f.text for f in form.families] == ["q3 = 0° or 180°"]
    assert form.dropped == 1
    # A little longer, and the surface is there.
    rows[1] = Joint(alpha=RIGHT, a=0.4)
    form = closed_form(build(rows, tip=(0.2, 0, 0), task="position"))
    assert [f.codimension for f in form.families] == [1, 1]
    # A little shorter, and it is not.
    rows[1] = Joint(alpha=RIGHT, a=0.6)
    form = closed_form(build(rows, tip=(0.2, 0, 0), task="position"))
    assert len(form.families) == 1
    assert form.complete


@pytest.fixture
def ring():
    return make_ring((False, False, False))


def test_finite_systems(ring):
    x1, y1, x2, y2, *_ = ring.context.gens()
    time = Budget(30.0)
    circle = y1**2 * x2**2 + y2**2 * x1**2 - 5 * x1**2 * x2**2  # t1^2 + t2^2 = 5
    product = y1 * y2 - 2 * x1 * x2  # t1 t2 = 2
    found = real_solutions([circle, product], ring, time)
    tangents = sorted((float(s[0].ball), float(s[1].ball)) for s in found)
    assert tangents == [(-2, -1), (-1, -2), (1, 2), (2, 1)]
    assert all(v.rational for s in found for v in s.values())
    golden = y1**2 - x1 * y1 - x1**2
    found = real_solutions([golden, y1 * x2 - x1 * y2 * 3], ring, time)
    assert len(found) == 2
    assert {s[0].minimal for s in found} == {(-1, -1, 1)}
    assert not real_solutions([circle, y1 * y2 - 3 * x1 * x2], ring, time)  # complex only
    assert not real_solutions([golden, y1 - 2 * x1], ring, time)
    # x = 0 is an angle as good as any other.
    (both,) = real_solutions([x1, x2], ring, time)
    assert both[0].angle() == both[1].angle() == math.pi
    with pytest.raises(NotFinite):
        real_solutions([product], ring, time)
    # Double zeros count once.
    (once,) = real_solutions([(y1 - x1) ** 2, (y2 * x1 - y1 * x2) ** 2], ring, time)
    assert float(once[1].ball) == 1.0


def test_finite_systems_with_square_roots():
    root = cosine(3)  # sqrt(2) / 2
    ring = ring_of((False, False), [root], Budget(30.0))
    x1, y1, x2, y2, *_ = ring.context.gens()
    p = ring.reduce(y1 - ring.number(root) * x1)
    g = y2 * x1 - y1 * x2
    (found,) = real_solutions([p, g], ring, Budget(30.0))
    assert float(found[1].ball) == pytest.approx(math.sqrt(0.5))


def test_signs(ring):
    x1, y1, x2, y2, *_ = ring.context.gens()
    time = Budget(30.0)
    assert changes_sign(y1 * x2 - 2 * x1 * y2, ring)
    square = (y1 * x2 - 2 * x1 * y2) ** 2
    sum_of_squares = square + (y1 - x1) ** 2 * (x2**2 + y2**2)
    assert not changes_sign(sum_of_squares, ring)
    assert semidefinite(sum_of_squares, ring, time)
    (zero,) = isolated_zeros(sum_of_squares, ring, time)
    assert (float(zero[0].ball), float(zero[1].ball)) == (1.0, 0.5)
    hidden = sum_of_squares * 1000 - (x1**2 + y1**2) * (x2**2 + y2**2)  # negative nearby
    assert not semidefinite(hidden, ring, time)
