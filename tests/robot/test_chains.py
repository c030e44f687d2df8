"""Which chains a robot offers, and what is locked, followed or said of them."""

import functools
import re
import shlex

import numpy as np
import pinocchio as pin
import pytest
from arms import draw
from public import script
from tiers import tiered
from urdf_text import ZERO, J, X, Y, Z, chain_text, follows, urdf

import pinsing
from pinsing import load
from pinsing.description.catalog import find_robot
from pinsing.description.urdf import read_description
from pinsing.errors import ChainError, JointError
from pinsing.kinematics.jacobian import tip_placement
from pinsing.robot.models import arm_chains, build_model, chains_text
from pinsing.view.meshes import read_geometry
from pinsing.view.scene import read_links


def model_of(robot: str) -> tuple[pin.Model, list[str]]:
    description = read_description(find_robot(robot).path)
    return build_model(description), [j.name for j in description.joints if j.mimic is not None]


def test_every_leaf_of_a_humanoid_is_a_chain():
    chains = script("oracle.survey").all_chains(*model_of("talos"))
    ends = {(tip, base): len(joints) for tip, base, joints in chains}
    assert (ends["left_sole_link", None], ends["wrist_left_ft_tool_link", None]) == (6, 9)
    assert ends["wrist_left_ft_tool_link", "torso_2_link"] == 7
    assert ends["rgbd_depth_frame", "torso_2_link"] == 2
    assert all(2 <= n <= 9 for n in ends.values())
    model, mimics = model_of("human")
    hands = [c for c in script("oracle.survey").all_chains(model, mimics) if c[0] == "left_hand"]
    assert [(base, len(joints)) for _, base, joints in hands] == [("middle_thorax", 8)]
    assert max(len(c.joints) for c in arm_chains(model, mimics)) == 13


@pytest.mark.parametrize(
    "robot",
    tiered(
        ["talos", "tiago_dual", "baxter", "anymal_kinova", "human", "icub", "panda"],
        ("baxter", "panda"),
    ),
)
def test_every_offer_loads_as_it_says(robot):
    model, mimics = model_of(robot)
    given = f"{robot} --package 'a=b c'"
    text = chains_text(arm_chains(model, mimics), given)
    assert text.count("pinsing analyze ") == text.count(f"pinsing analyze {given} --")
    lines = text.replace(given, robot).splitlines()
    offers = [line.split(": pinsing analyze ") for line in lines if "pinsing" in line]
    assert offers
    if robot == "tiago_dual":  # shared joints once, and locked ones
        assert text.count("torso_lift_joint\n") == 1
        assert "--tip wrist_left_ft_tool_link --base torso_lift_link" in text
        assert "locked beyond it: hand_left_" in text
    for count, command in offers:
        name, *options = shlex.split(command.partition("  (")[0])
        assert name == robot
        arm = load(robot, **dict(zip([o[2:] for o in options[::2]], options[1::2], strict=True)))
        assert arm.n == int(count.split()[-2])


@pytest.mark.slow
def test_too_many_joints_in_a_row_are_refused():
    row = urdf([J(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(100)])
    with pytest.raises(ChainError, match="100 joints in a row: at most 64"):
        load(row)
    assert load(row, base="l60").n == 40
    with pytest.raises(ChainError, match="3000 chains could be the arm"):
        load(urdf([J(f"j{i}", "a", f"l{i}") for i in range(3000)]))


# Chains from anywhere to anywhere in a tree, joints on the way up backwards --------------


def tree(more: str = "") -> str:
    """Two chains from a pelvis, to a foot and to a hand; more of the joint between them."""
    return urdf(
        [
            J("hip", "pelvis", "thigh", (0, 0.1, -0.2), Y, "revolute", (-1, 2), (0.3, 0, 0)),
            J("knee", "thigh", "shank", (0.05, 0, -0.4), (0, 0.6, 0.8), "prismatic", (-0.1, 0.3),
              (0, 0.2, 0.1)),
            J("ankle", "shank", "foot", (0, 0, -0.3), X),
            J("waist", "pelvis", "chest", (0, 0, 0.3), (0, 0, -1), "revolute", (-0.5, 1.5),
              more=more),
            J("shoulder", "chest", "upper", (0, 0.2, 0.1), Y, rpy=(0, 0, 0.4)),
            J("elbow", "upper", "fore", (0.3, 0, 0), Z, "revolute", (-2, 2)),
            J("slide", "fore", "hand", (0.2, 0, 0.05), X, "prismatic", (0, 0.4)),
        ],
        "tree",
    )  # fmt: skip


def led(lower: float, upper: float, multiplier: float) -> str:
    """A leader, and a follower whose limits count."""
    leader = J("j1", "l0", "l1", X, kind="revolute", limits=(-1, 2))
    limits = (lower, upper)
    follower = J("j2", "l1", "l2", X, kind="revolute", limits=limits, more=follows(1, multiplier))
    return urdf([leader, follower])


HINGE, AT = "revolute", (0.3, 0, 0)
CROSSED = chain_text([(HINGE, AT, axis) for axis in (Z, Y, X, Y, Z)], (-1, 2))
TOWARDS = {
    "TREE": tree(), "LINKED": tree('<mimic joint="hip" multiplier="-2" offset="0.25"/>'),
    # The hand stays level: its joint undoes those of shoulder and elbow, by way of another.
    "PALLETIZER": chain_text([
        (HINGE, (0, 0, 0.3)), (HINGE, (0.1, 0, 0.2), Y), (HINGE, (0, 0, 0.6), Y),
        (HINGE, AT, Y, ZERO, follows(3, -0.5, 0.2)), (HINGE, (0.1, 0, 0)),
        ("prismatic", AT, Z, ZERO, follows(4, 0.1, 0.05)), (HINGE, AT, X),
    ], (-1, 2)),
    "NARROW": led(-0.3, 0.4, -0.5), "APART": led(1.5, 1.9, 0.1),
    "SHARED": CROSSED.replace('joint name="j', 'joint name="l'),  # with links, by their names
    "ENDLESS": chain_text([
        ("continuous", AT), ("continuous", AT, Z, ZERO, follows(1, -2, 0.6)),
        ("continuous", AT, Y), (HINGE, AT),
    ]),
    "SIDE": urdf([
        J("side", "l0", "s", kind=HINGE, limits=(-1, 2)),
        J("j1", "l0", "l1", AT, kind=HINGE, limits=(-1, 2)),
        J("j2", "l1", "l2", AT, X, HINGE, (-1, 2), more='<mimic joint="side" offset="0.7"/>'),
        J("j3", "l2", "l3", AT, kind=HINGE, limits=(-1, 2)),
    ]),
}  # fmt: skip

HUMANOIDS = (
    ("talos", "left_sole_link", "gripper_left_base_link"),
    ("talos", "right_sole_link", "gripper_left_base_link"),
    ("icub", "l_sole", "r_hand"),
    ("g1", "left_ankle_roll_link", "right_rubber_hand"),
    ("pr2", "l_gripper_tool_frame", "r_gripper_tool_frame"),
    ("ur5", "tool0", "base_link"),
    # From the base outwards, with joints before it.
    ("ur5", "upper_arm_link", "tool0"),
    ("baxter", "left_arm_mount", "left_gripper_base_link"),
    ("tiago", "torso_lift_link", "wrist_ft_tool_link"),
    ("pr2", "r_shoulder_pan_link", "r_gripper_tool_frame"),
    ("kinova", "j2s6s200_link_1", "j2s6s200_end_effector"),
    ("ur5", "wrist_3_link", "forearm_link"),
)


@functools.cache
def chain(name, base, tip):
    """What follows a colon of the name are joints to keep."""
    name, _, joints = name.partition(":")
    given = {"joints": joints.split(",")[::-1]} if joints else {}
    arm = load(TOWARDS.get(name, name), base=base, tip=tip, **given)
    assert not joints or arm.joints == (*joints.split(","),)
    return arm


def frames(arm):
    """The whole model, and indices of base and tip, told by name in Pinocchio itself."""
    model = arm.source.full_model
    kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
    at = [
        next(i for i, f in enumerate(model.frames) if f.name == name and f.type in kinds)
        for name in (arm.base, arm.tip)
    ]
    return model, *at


def seen_from_base(arm, q):
    """The tip's place, and J_tip - X J_base in the axes of the base, a column a joint of the arm.

    Both by Pinocchio, of the whole model.
    """
    model, base, tip = frames(arm)
    data = model.createData()
    pin.computeJointJacobians(model, data, arm.full_q(q))
    pin.updateFramePlacements(model, data)
    here, there = data.oMf[base], data.oMf[tip]
    J_tip, J_base = (
        pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED) for f in (tip, base)
    )
    X = np.eye(6)
    X[:3, 3:] = -pin.skew(there.translation - here.translation)
    J = np.kron(np.eye(2), here.rotation.T) @ (J_tip - X @ J_base)
    J = J[:, [model.joints[model.getJointId(name)].idx_v for name in list(arm.model.names)[1:]]]
    J = J if arm.coupling is None else J @ arm.coupling.matrix
    return here.inverse() * there, J


CHAINS = (
    *HUMANOIDS,
    *((t, b, e) for t in ("TREE", "LINKED") for b, e in (("foot", "hand"), ("hand", "foot"))),
    *((f"TREE:{joints}", "foot", "hand") for joints in ("knee,shoulder,slide", "elbow,slide")),
    ("PALLETIZER", "l0", "l7"), ("SHARED", "l0", "l5"),
    ("ENDLESS", "l0", "l4"), ("SIDE", "l0", "l3"),
)  # fmt: skip


@pytest.mark.parametrize(("name", "base", "tip"), CHAINS)
def test_the_tip_is_seen_from_the_base_and_joints_keep_names_limits_and_values(
    name, base, tip, rng
):
    arm = chain(name, base, tip)
    model = arm.source.full_model
    theirs = [model.joints[model.getJointId(name)] for name in arm.joints]
    for j, (name, here) in enumerate(zip(arm.joints, theirs, strict=True)):
        if here.nq == 1 and name != "hip":  # whose follower's limits count as well
            assert arm.lower[j] == model.lowerPositionLimit[here.idx_q]
            assert arm.upper[j] == model.upperPositionLimit[here.idx_q]
    for q in draw(arm, rng, 4):
        J = pinsing.frame_jacobian(arm, q)
        place, expected = seen_from_base(arm, q)
        np.testing.assert_allclose(J, expected, atol=1e-12)
        there = tip_placement(arm, q).homogeneous
        np.testing.assert_allclose(there, place.homogeneous, atol=1e-12)
        many = pinsing.kinematics.frame_jacobians(arm, q[None])
        np.testing.assert_allclose(many[0], J, atol=1e-12)
        full = arm.full_q(q)
        for value, here in zip(q, theirs, strict=True):
            values = [value] if here.nq == 1 else [np.cos(value), np.sin(value)]
            stands = full[here.idx_q : here.idx_q + here.nq]
            np.testing.assert_allclose(stands, values, atol=1e-12)
        turn = 2 * np.pi * np.round((arm.q_of(full) - q) / (2 * np.pi))
        np.testing.assert_allclose(arm.q_of(full) - turn, q, atol=1e-12)


def test_a_floating_base_drops_out(rng):
    file = str(find_robot("talos").path)
    floating = pin.buildModelFromUrdf(file, pin.JointModelFreeFlyer())
    ends = {"base": "left_sole_link", "tip": "gripper_right_base_link"}
    fixed, arm = (load(model, **ends) for model in (pin.buildModelFromUrdf(file), floating))
    assert fixed.joints == arm.joints
    q, ones = draw(arm, rng, 1)[0], np.ones(floating.nq)
    np.testing.assert_array_equal(*(pinsing.frame_jacobian(x, q) for x in (fixed, arm)))
    anywhere = pin.randomConfiguration(floating, -ones, ones)
    J = [pinsing.frame_jacobian(arm, q) for q in (anywhere, arm.q_of(anywhere))]
    np.testing.assert_allclose(*J)


def test_links_are_drawn_where_they_are(rng):
    box = '<visual><origin xyz="0.1 0.2 0.3" rpy="1 2 3"/><geometry><box size="1 1 1"/></geometry>'
    dressed = re.sub(r'<link name="(\w+)"/>', rf'<link name="\1">{box}</visual></link>', tree())
    arm = load(dressed, base="foot", tip="hand")
    geometry = read_links(arm).geometry
    whole, base, _ = frames(arm)
    visual, _, _ = read_geometry(whole, arm.source.xml)
    places = {g.name: (g.parentJoint, g.placement) for g in visual.geometryObjects}
    q = draw(arm, rng, 1)[0]
    here, there = arm.model.createData(), whole.createData()
    pin.forwardKinematics(arm.model, here, arm.model_q(q))
    pin.framesForwardKinematics(whole, there, arm.full_q(q))
    assert len(geometry.geometryObjects) == len(places) == 8
    carriers = set()
    for g in geometry.geometryObjects:
        joint, place = places[g.name]
        expected = there.oMf[base].inverse() * there.oMi[joint] * place
        found = here.oMi[g.parentJoint] * g.placement
        np.testing.assert_allclose(found.homogeneous, expected.homogeneous, atol=1e-12)
        carriers.add(int(g.parentJoint))
    assert carriers == set(range(8))


def test_a_ball_on_the_way_back_is_refused():
    model = pin.Model()
    root = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "root")
    ball = model.addJoint(root, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    hand = model.addJoint(root, pin.JointModelRX(), pin.SE3.Identity(), "wrist")
    for name, on in (("foot", ball), ("hand", hand)):
        model.addFrame(pin.Frame(name, on, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    with pytest.raises(JointError, match="ball"):
        load(model, base="foot", tip="hand")
    model.addFrame(pin.Frame("world", 0, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    with pytest.raises((ChainError, JointError)):
        load(model, base="foot", tip="world")
