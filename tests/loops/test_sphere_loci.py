"""Spherical 3-RRR over the orientation, against geometry written here without pinsing."""

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import left_sides, placed, shipped
from test_pose_forms import rotation
from tiers import tiered
from urdf_text import J, frame, loop_text, written

import pinsing
from pinsing.loops import joint_forms, mechanism_at, pose_forms, refine
from pinsing.loops.closure import random_closed


def eye(folder, base, middle, outer):
    """Three legs by unit vectors (3, 3) each, with all joints at zero; the output is the base."""
    joints, loops = [], []
    for k in range(3):
        joints.append(J(f"a{k}", "base", f"arm{k}", axis=base[k]))
        joints.append(J(f"v{k}", f"arm{k}", f"bar{k}", axis=middle[k]))
        if k == 0:
            joints.append(J("w", "bar0", "platform", axis=outer[0]))
        else:
            joints.append(frame(f"e{k}", f"bar{k}", outer[k]))
            joints.append(frame(f"b{k}", "platform", outer[k]))
            loops.append((f"e{k}", f"b{k}"))
    text = loop_text(loops, [f"a{k}" for k in range(3)], "platform", "wx, wy, wz")
    return pinsing.load_mechanism(written(folder, joints, text))


def rotations(mechanism, q):
    """Rotation of the output, and of each arm."""
    data = placed(mechanism, q)
    arms = [data.oMi[mechanism.model.getJointId(f"a{k}")].rotation for k in range(3)]
    return data.oMf[mechanism.output_id].rotation, arms


@pytest.mark.slow
@pytest.mark.parametrize("seed", tiered(range(4), (1,)))
def test_random_spherical_legs_against_their_moments(seed, tmp_path):
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(3, 3, 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    base, middle, outer = axes
    mechanism = eye(tmp_path, base, middle, outer)
    forms = pose_forms(mechanism)
    assert forms.complete
    found = random_closed(mechanism, 6, rng)
    two, ones = [], []
    for q in found:
        R, arms = rotations(mechanism, q)
        moments = [np.cross(A @ m, R @ w) for A, m, w in zip(arms, middle, outer, strict=True)]
        one, both = (np.prod(left_sides(mechanism, forms, q, k)) for k in ("type 1", "type 2"))
        two.append(both / np.linalg.det(moments))
        ones.append(one / np.prod([u @ n for u, n in zip(base, moments, strict=True)]))
        for kind in ("type 1", "type 2"):
            point = refine(mechanism, q, kind)
            if point.converged:
                assert np.abs(left_sides(mechanism, forms, point.q)).min() < 1e-6
    assert len(found) >= 3
    np.testing.assert_allclose(two, two[0], rtol=1e-6)
    np.testing.assert_allclose(ones, ones[0], rtol=1e-6)


@pytest.mark.slow
def test_the_agile_eye_is_singular_where_a_middle_joint_is_at_a_right_angle(tmp_path, rng):
    """Type 2 over the orientation is a sum of squares: it has no zeros of its own."""
    mechanism = shipped("agile_eye")
    forms = pose_forms(mechanism)
    (note,) = [x for x in forms.notes if "sum of squares" in x]
    assert "f0^2 f1^2 f2^2 + f0^2 f1^2 f3^2 + f0^2 f2^2 f3^2 + f1^2 f2^2 f3^2 = 0" in note
    assert forms.variables == ("e0", "e1", "e2", "e3")
    (two,) = [x for x in forms.loci if x.kind == "type 2"]
    # The same by hand, from axes of its own: moments without the middle axes.
    base, middle, outer = np.eye(3), np.eye(3)[[1, 2, 0]], np.eye(3)[[2, 0, 1]]
    own = pose_forms(eye(tmp_path, base, middle, outer))
    assert [str(x) for x in own.loci if x.kind == "type 2"] == [str(two)]
    ratios = []
    for _ in range(20):
        e = rng.normal(size=4)
        e /= np.linalg.norm(e)
        turned = [rotation(e) @ w for w in outer]
        moments = [np.cross(np.cross(u, w), w) for u, w in zip(base, turned, strict=True)]
        ratios.append(float(two.equation(e)) / np.linalg.det(moments))
        assert abs(np.linalg.det(moments)) > 0
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-6)
    assert len({np.sign(float(two.equation(rng.normal(size=4)))) for _ in range(100)}) == 1
    proven = joint_forms(mechanism).notes
    assert any(
        "singular if and only if cos v1 = 0 or cos v2 = 0 or cos v3 = 0" in x for x in proven
    )
    free = mechanism.without_limits()
    met = 0
    for q in random_closed(free, 10, rng):
        point = refine(free, q, "type 2")
        if point.converged:
            met += 1
            places = [free.joints.index(f"v{k}") for k in (1, 2, 3)]
            assert np.abs(np.cos(point.q[places])).min() < 1e-6
        elif mechanism_at(free, q).kind == "regular":
            places = [free.joints.index(f"v{k}") for k in (1, 2, 3)]
            assert np.abs(np.cos(q[places])).min() > 1e-9
    assert met


@pytest.mark.parametrize("seed", tiered(range(6), (0,)))
def test_working_modes_of_spherical_legs_are_two_a_leg(seed, tmp_path):
    rng = np.random.default_rng(40 + seed)
    axes = rng.normal(size=(3, 3, 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    base, middle, outer = axes
    mechanism = eye(tmp_path, base, middle, outer)
    q = random_closed(mechanism, 1, rng)[0]
    R, _ = rotations(mechanism, q)
    found = pinsing.loops.working_modes(mechanism, pin.SE3(R, np.zeros(3)).homogeneous)
    # By turning each actuated joint all round: where v . w passes its value.
    count = 1
    turns = np.linspace(0, 2 * np.pi, 20_001)
    for u, v, w in zip(base, middle, outer, strict=True):
        turned = (
            np.outer(np.cos(turns), v - (u @ v) * u)
            + np.outer(np.sin(turns), np.cross(u, v))
            + (u @ v) * u
        )
        off = turned @ (R @ w) - v @ w
        count *= int((np.sign(off[:-1]) != np.sign(off[1:])).sum())
    assert found.complete
    assert len(found.modes) == count == 8
    direct = pinsing.loops.assembly_modes(mechanism, q[list(mechanism.actuated)], starts=60)
    assert direct.bound == 8
    assert len(direct.modes) <= 8


def test_other_angles_of_the_links_are_no_sum_of_squares(tmp_path):
    base, outer = np.eye(3), np.eye(3)[[1, 2, 0]]
    middle = np.array([[0, 0.6, 0.8], [0.8, 0, 0.6], [0.6, 0.8, 0]])
    mechanism = eye(tmp_path, base, middle, outer)
    forms = pose_forms(mechanism)
    assert not any("sum of squares" in x for x in forms.notes)
    assert "cos a1" in forms.variables
    assert not any("proven over" in x for x in joint_forms(mechanism).notes)
