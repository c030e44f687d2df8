"""Numbers of modes by algebra against counts of sign changes made here without pinsing."""

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import placed, shipped
from test_pose_forms import hinged, rps
from test_pose_turning import turned
from tiers import tiered
from urdf_text import J, X, Y, frame, loop_text, written

import pinsing

TURNS = np.linspace(-np.pi, np.pi, 20001) + 0.1234567


def circle(axis, arm):
    """The arm turned by all TURNS (N, 3)."""
    along = (arm @ axis) * axis
    c, s = np.cos(TURNS)[:, None], np.sin(TURNS)[:, None]
    return along + c * (arm - along) + s * np.cross(axis, arm)


def changes(values):
    return int((np.sign(values[1:]) != np.sign(values[:-1])).sum())


def one_rod(folder, rng, ends):
    """A rod with a universal joint and a ball between two cranks (RSSR), or a crank and a slide."""
    a, b = rng.normal(size=(2, 3)).round(1)
    axes = [v / np.linalg.norm(v) for v in (a, b)]
    arms = rng.uniform(-0.5, 0.5, (2, 3)).round(2)
    foot = rng.uniform(-0.5, 0.5, 3).round(2)
    # The row of the output is the motion of its joint: about, or along, x.
    axes[1] = np.array(X, dtype=float)
    apart = foot + turned(axes[1], 0.3) @ arms[1] - turned(axes[0], 0.4) @ arms[0]
    length = round(float(np.linalg.norm(apart)), 4)
    kind = "continuous" if ends == "crank" else "prismatic"
    limits = None if ends == "crank" else (-9, 9)
    joints = [
        J("crank", "base", "arm", (0, 0, 0), axes[0]),
        J("ux", "arm", "cross", arms[0], X),
        J("uy", "cross", "rod", axis=Y),
        frame("tip", "rod", (0, 0, length)),
        J("other", "base", "rocker", foot, axes[1], kind, limits),
        frame("pin", "rocker", arms[1]),
    ]
    rows = "wx" if ends == "crank" else "vx"
    text = loop_text([("tip", "pin")], ["crank"], "rocker", rows)
    return pinsing.load_mechanism(written(folder, joints, text)), axes, arms, foot, length


@pytest.mark.slow
@pytest.mark.parametrize("ends", tiered(["crank", "slide"], {"crank"}))
@pytest.mark.parametrize("seed", tiered(range(4), (0,)))
def test_one_rod_between_two_joints(ends, seed, tmp_path):
    mechanism, axes, arms, foot, length = one_rod(tmp_path, np.random.default_rng(seed), ends)
    home = pinsing.loops.assembly_modes(mechanism).modes[0].q
    crank, other = (mechanism.joints.index(n) for n in ("crank", "other"))
    direct = pinsing.loops.assembly_modes(mechanism, [home[crank]])
    C = turned(axes[0], home[crank]) @ arms[0]
    if ends == "crank":
        at = foot + circle(axes[1], arms[1])
    else:
        at = foot + arms[1] + np.linspace(-9, 8.9876, 20001)[:, None] * axes[1]
    number = changes(np.linalg.norm(at - C, axis=1) - length)
    assert number == len(direct.modes) == 2
    assert direct.complete
    assert "all there are, by the quadratic equation of its rod" in direct.statement
    inverse = pinsing.loops.working_modes(mechanism)
    B = foot + (turned(axes[1], home[other]) @ arms[1] if ends == "crank" else
                arms[1] + home[other] * axes[1])  # fmt: skip
    number = changes(np.linalg.norm(circle(axes[0], arms[0]) - B, axis=1) - length)
    assert number == len(inverse.modes)
    assert inverse.complete


@pytest.mark.parametrize("seed", tiered(range(4), (1,)))
def test_working_modes_of_three_legs_on_hinges(seed, tmp_path):
    rng = np.random.default_rng(seed)
    base, hinges, platform = hinged(rng)
    mechanism = rps(tmp_path, base, hinges, platform).without_limits()
    tilt = rng.uniform(-0.3, 0.3, 2)
    found = pinsing.loops.working_modes(mechanism, [0.9, *tilt])
    R = pin.rpy.rpyToMatrix(*tilt, 0.0)
    left = []
    for yaw in TURNS[::10]:
        away = platform @ (pin.rpy.rpyToMatrix(0, 0, yaw) @ R).T + [0, 0, 0.9] - base
        # The first two hinges give x and y, the third is left.
        xy = np.linalg.solve(hinges[:2, :2], -(hinges[:2] * away[:2]).sum(axis=1))
        left.append(hinges[2, :2] @ xy + hinges[2] @ away[2])
    assert len(found.modes) == 8 * changes(np.array(left))
    assert found.complete
    assert "by the planes of its hinges and the two solutions of each leg" in found.statement


@pytest.mark.slow
def test_elbows_of_cranks_with_rods_that_leave_their_plane():
    """Each of the 64 working modes has a name of its own: the sign of crank, rod and axis."""
    mechanism = shipped("rus6").without_limits()
    found = pinsing.loops.working_modes(mechanism, starts=4)
    assert len({m.mode for m in found.modes}) == len(found.modes) == 64
    for mode in found.modes[::9]:
        data, signs = placed(mechanism, mode.q), ""
        for k in range(1, 7):
            foot, C = (data.oMi[mechanism.model.getJointId(n)] for n in (f"a{k}", f"u{k}x"))
            rod = data.oMi[mechanism.model.getJointId(f"u{k}y")].rotation[:, 2]
            arm = C.translation - foot.translation
            axis = foot.rotation @ axis_of(mechanism, f"a{k}")
            signs += "+" if np.cross(arm, rod) @ axis > 0 else "-"
        assert mode.mode.endswith(f"elbows {signs}")


def axis_of(mechanism, name):
    """Axis of a joint in its own frame, from a small turn."""
    j = mechanism.joints.index(name)
    turned = np.eye(mechanism.n)[j]
    before, after = (placed(mechanism, x * turned).oMi[j + 1] for x in (0.0, 0.1))
    return pin.log3(before.rotation.T @ after.rotation) / 0.1
