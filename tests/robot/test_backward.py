"""Chains from anywhere to anywhere in a tree, joints on the way up backwards."""

import functools
import re
from importlib.metadata import distribution

import numpy as np
import pinocchio as pin
import pytest
from tiers import sampled
from urdf_text import J, X, Y, Z, urdf

import pinsing
from pinsing.errors import ChainError, JointError
from pinsing.kinematics.jacobian import tip_placement
from pinsing.view.meshes import read_geometry
from pinsing.view.scene import read_links


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


MIMIC = '<mimic joint="hip" multiplier="-2" offset="0.25"/>'
TOWARDS = {"tree": tree(), "mimic": tree(MIMIC)}

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
    return pinsing.load(TOWARDS.get(name, name), base=base, tip=tip)


def frames(arm):
    """The whole model, and indices of base and tip, told by name in Pinocchio itself."""
    model = arm.source.full_model
    kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
    at = [
        next(i for i, f in enumerate(model.frames) if f.name == name and f.type in kinds)
        for name in (arm.base, arm.tip)
    ]
    return model, *at


def placement(arm, q):
    """Tip in the base, by Pinocchio, of the whole model."""
    model, base, tip = frames(arm)
    data = model.createData()
    pin.framesForwardKinematics(model, data, arm.full_q(q))
    return data.oMf[base].inverse() * data.oMf[tip]


def relative_jacobian(arm, q):
    """J_tip - X J_base in the axes of the base, one column a joint of the arm."""
    model, base, tip = frames(arm)
    data = model.createData()
    pin.computeJointJacobians(model, data, arm.full_q(q))
    pin.updateFramePlacements(model, data)
    J_tip, J_base = (
        pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED) for f in (tip, base)
    )
    X = np.eye(6)
    X[:3, 3:] = -pin.skew(data.oMf[tip].translation - data.oMf[base].translation)
    J = np.kron(np.eye(2), data.oMf[base].rotation.T) @ (J_tip - X @ J_base)
    ids = [model.joints[model.getJointId(name)].idx_v for name in list(arm.model.names)[1:]]
    J = J[:, ids]
    return J if arm.coupling is None else J @ arm.coupling.matrix


def drawn(arm, rng, count):
    return rng.uniform(np.maximum(arm.lower, -3), np.minimum(arm.upper, 3), (count, arm.n))


CHAINS = (
    *HUMANOIDS,
    *((t, b, e) for t in TOWARDS for b, e in (("foot", "hand"), ("hand", "foot"))),
)


@pytest.mark.parametrize(("name", "base", "tip"), sampled(CHAINS))
def test_jacobians_are_those_of_the_tip_seen_from_the_base(name, base, tip, rng):
    arm = chain(name, base, tip)
    for q in drawn(arm, rng, 4):
        J = pinsing.frame_jacobian(arm, q)
        np.testing.assert_allclose(J, relative_jacobian(arm, q), atol=1e-12)
        here, there = tip_placement(arm, q).homogeneous, placement(arm, q).homogeneous
        np.testing.assert_allclose(here, there, atol=1e-12)
        many = pinsing.kinematics.frame_jacobians(arm, q[None])
        np.testing.assert_allclose(many[0], J, atol=1e-12)


@pytest.mark.parametrize(("name", "base", "tip"), CHAINS)
def test_joints_keep_names_limits_and_values(name, base, tip, rng):
    arm = chain(name, base, tip)
    model = arm.source.full_model
    for j, joint in enumerate(arm.joints):
        here = model.joints[model.getJointId(joint)]
        if here.nq == 1 and joint != "hip":  # whose follower's limits count as well
            assert arm.lower[j] == model.lowerPositionLimit[here.idx_q]
            assert arm.upper[j] == model.upperPositionLimit[here.idx_q]
    for q in drawn(arm, rng, 4):
        full = arm.full_q(q)
        for j, joint in enumerate(arm.joints):
            here = model.joints[model.getJointId(joint)]
            value = full[here.idx_q : here.idx_q + here.nq]
            expected = [q[j]] if here.nq == 1 else [np.cos(q[j]), np.sin(q[j])]
            np.testing.assert_allclose(value, expected, atol=1e-12)
        turn = 2 * np.pi * np.round((arm.q_of(full) - q) / (2 * np.pi))
        np.testing.assert_allclose(arm.q_of(full) - turn, q, atol=1e-12)


@pytest.mark.parametrize(
    ("base", "tip", "joints"), [("shank", "chest", 3), ("upper", "thigh", 3), ("foot", "fore", 6)]
)
def test_short_chains_across_are_complete(base, tip, joints, rng):
    arm = pinsing.load(TOWARDS["tree"], base=base, tip=tip)
    form = pinsing.closed_form(arm)
    assert arm.n == joints
    assert form.complete
    rank = form.generic_rank
    for q in drawn(arm, rng, 20):
        sizes = np.linalg.svd(relative_jacobian(arm, q), compute_uv=False)
        assert (sizes[rank - 1] < 1e-9) == (form.family_of(q) is not None)
    for family in form.families:
        for q in family.points(5, rng):
            sizes = np.linalg.svd(relative_jacobian(arm, q), compute_uv=False)
            assert sizes[rank - 1] < 1e-8


def test_a_floating_base_drops_out(rng):
    path = "cmeel.prefix/share/example-robot-data/robots/talos_data/robots/talos_reduced.urdf"
    file = str(distribution("example-robot-data").locate_file(path))
    fixed = pin.buildModelFromUrdf(file)
    floating = pin.buildModelFromUrdf(file, pin.JointModelFreeFlyer())
    ends = {"base": "left_sole_link", "tip": "gripper_right_base_link"}
    arms = [pinsing.load(model, **ends) for model in (fixed, floating)]
    assert arms[0].joints == arms[1].joints
    q = drawn(arms[0], rng, 1)[0]
    J = [pinsing.frame_jacobian(arm, q) for arm in arms]
    np.testing.assert_array_equal(*J)
    anywhere = pin.randomConfiguration(
        floating, np.full(floating.nq, -1.0), np.full(floating.nq, 1.0)
    )
    np.testing.assert_allclose(
        pinsing.frame_jacobian(arms[1], anywhere),
        pinsing.frame_jacobian(arms[1], arms[1].q_of(anywhere)),
    )


def test_only_some_joints_of_the_way(rng):
    ways = (("knee", "shoulder", "slide"), ("elbow", "slide"))
    for joints in ways:
        arm = pinsing.load(TOWARDS["tree"], base="foot", tip="hand", joints=[*joints[::-1]])
        assert arm.joints == joints
        for q in drawn(arm, rng, 3):
            J = relative_jacobian(arm, q)
            np.testing.assert_allclose(pinsing.frame_jacobian(arm, q), J, atol=1e-12)


def test_links_are_drawn_where_they_are(rng):
    box = '<visual><origin xyz="0.1 0.2 0.3" rpy="1 2 3"/><geometry><box size="1 1 1"/></geometry>'
    dressed = re.sub(r'<link name="(\w+)"/>', rf'<link name="\1">{box}</visual></link>', tree())
    arm = pinsing.load(dressed, base="foot", tip="hand")
    geometry = read_links(arm).geometry
    whole, base, _ = frames(arm)
    visual, _, _ = read_geometry(whole, arm.source.xml)
    places = {g.name: (g.parentJoint, g.placement) for g in visual.geometryObjects}
    q = drawn(arm, rng, 1)[0]
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


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"base": "foot", "tip": "foot"}, "no joint lies between the base and tip 'foot'"),
        ({"base": "hand"}, "no joint lies beyond the base; .* or name a tip .*--tip foot"),
        ({"base": "foot", "tip": "universe"}, "name a link or frame fixed to it, such as 'pelvis'"),
        ({"base": "foot", "tip": "pelvis", "joints": ["waist"]}, "'waist' is not between"),
        ({"base": "foot", "tip": "nose"}, "unknown frame 'nose'"),
        ({"base": "toe", "tip": "hand"}, "unknown frame 'toe'"),
    ],
)
def test_what_is_no_chain(options, said):
    with pytest.raises(Exception, match=said) as caught:
        pinsing.load(TOWARDS["tree"], **options)
    assert isinstance(caught.value, pinsing.PinsingError)


def test_a_ball_on_the_way_back_is_refused():
    model = pin.Model()
    root = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "root")
    ball = model.addJoint(root, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    hand = model.addJoint(root, pin.JointModelRX(), pin.SE3.Identity(), "wrist")
    for name, joint in (("foot", ball), ("hand", hand)):
        model.addFrame(pin.Frame(name, joint, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    with pytest.raises(JointError, match="ball"):
        pinsing.load(model, base="foot", tip="hand")
    model.addFrame(pin.Frame("world", 0, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    with pytest.raises((ChainError, JointError)):
        pinsing.load(model, base="foot", tip="world")
