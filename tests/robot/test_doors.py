"""The doors that Pinocchio users try first: their models, wrappers, texts and configurations."""

import pickle
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from arms import place, serial
from pinocchio.robot_wrapper import RobotWrapper
from urdf_texts import LIMIT, XACRO, robot

import pinsing
from pinsing.description.catalog import find_robot
from pinsing.errors import (
    ArgumentError,
    ChainError,
    ConfigurationError,
    JointError,
    PinsingError,
    RobotFileError,
    UnknownNameError,
)


def model_of(name: str, *base) -> pin.Model:
    return pin.buildModelFromUrdf(str(find_robot(name).path), *base)


def panda_q(rng, model) -> np.ndarray:
    q = pin.randomConfiguration(model)
    for i in range(model.nq):  # limits of fingers and all: drawn with the seed of the test
        low, high = model.lowerPositionLimit[i], model.upperPositionLimit[i]
        q[i] = rng.uniform(max(low, -3), min(high, 3))
    return q


def test_a_wrapper_a_model_a_path_a_text_and_a_name_are_one_arm():
    path = find_robot("ur5").path
    wrapper = RobotWrapper(model_of("ur5"))
    q = [0.1, -1.0, 1.2, 0.3, 0.5, 0.0]
    expected = pinsing.at(pinsing.load("ur5"), q)
    for given in (wrapper, wrapper.model, path, str(path), path.read_text()):
        arm = pinsing.load(given)
        assert (arm.joints, arm.tip) == (expected.arm.joints, expected.arm.tip)
        assert np.allclose(pinsing.at(arm, q).J, expected.J, atol=1e-12)


def test_any_object_with_a_model(write_urdf):
    arm = pinsing.load(SimpleNamespace(model=model_of("ur5")))
    assert arm.n == 6
    with pytest.raises(ArgumentError, match="robot must be a file, the name of a robot"):
        pinsing.load(SimpleNamespace(model="ur5"))
    with pytest.raises(TypeError):
        pinsing.load(RobotWrapper)
    turn = f'<origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>{LIMIT}'
    path = write_urdf([("revolute", turn), ("revolute", turn + MIMIC)])
    model = pin.buildModelFromUrdf(str(path), mimic=True)
    assert any("Mimic" in j.shortname() for j in model.joints)
    with pytest.raises(PinsingError, match="mimic=False"):
        pinsing.load(model)


TEXT = robot()


@pytest.mark.parametrize(
    "text",
    [
        TEXT, "\n\n   \t" + TEXT, "\ufeff" + TEXT, '<?xml version="1.0"?>\n' + TEXT,
        '  \n<?xml version="1.0" encoding="iso-8859-1"?>\n<!-- \u00e9 -->\n' + TEXT,
    ],
)  # fmt: skip
def test_text_of_a_urdf(text):
    arm = pinsing.load(text)
    assert arm.n > 0
    assert arm.source.label == "URDF text"
    assert arm.source.path is None


@pytest.mark.parametrize(
    ("text", "line", "expected"),
    [
        ("\n\n<robot name='r'>\n</robt>", 4, "mismatched tag"), ("<", None, "is not XML"),
        ("<!DOCTYPE robot [<!ENTITY a 'b'>]><robot/>", 1, "document types and entities"),
        ("<robot name='\ud800'/>", 1, "lone surrogate"),
        ('<?xml version="1.0"?>\n' + robot().replace(LIMIT, ""), None, "has no <limit>"),
        (XACRO.format('<xacro:property name="a" value="1"/>'), None, "is xacro: give the path"),
    ],
)  # fmt: skip
def test_text_that_is_no_robot(text, line, expected):
    with pytest.raises(RobotFileError, match=expected) as caught:
        pinsing.load(text)
    said = str(caught.value)
    assert said.startswith("URDF text:")
    assert "\n" not in said
    assert len(said) < 300
    if line is not None:
        assert caught.value.line == line


@pytest.mark.parametrize("path", ["a/" * 3000, "a/\0b", "a/\x1b[2J\nb"])
def test_a_path_that_cannot_be_is_one_short_line(path):
    with pytest.raises(RobotFileError, match="no such file") as caught:
        pinsing.load(path)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 300
    assert caught.value.path == Path(path)


def test_text_reads_no_meshes_of_the_working_folder(tmp_path, monkeypatch):
    """Text from a stranger has no folder: what lies where the user stands is not its own."""
    (tmp_path / "a.stl").write_bytes(b"solid a\nendsolid a\n")
    monkeypatch.chdir(tmp_path)
    for address in ("a.stl", "./a.stl", "file://a.stl", f"file://{tmp_path}/a.stl", "../a.stl"):
        visual = f'<visual><geometry><mesh filename="{address}"/></geometry></visual>'
        text = robot(links="ab", extra=f'<link name="c">{visual}</link>')
        arm = pinsing.load(text)
        assert "mesh filename" not in arm.source.xml
        given = pinsing.load(text.replace(address, "package://p/a.stl"), packages={"p": tmp_path})
        assert "mesh filename" in given.source.xml


def test_a_robot_that_nobody_knows():
    with pytest.raises(UnknownNameError, match=r"such as ur5, panda.*pinsing list") as caught:
        pinsing.load("nope")
    assert len(str(caught.value)) < 300
    assert (caught.value.name, "ur5" in caught.value.known) == ("nope", True)
    for asked, meant in [
        ("kuka", "iiwa14"), ("ur5x", "ur5"), ("Franka Emika", "panda"), ("pandda", "panda"),
        ("universal robots", "ur10"),
    ]:  # fmt: skip
        with pytest.raises(UnknownNameError, match="did you mean") as caught:
            pinsing.load(asked)
        assert meant in caught.value.close


def test_a_configuration_of_the_whole_model_is_one_of_the_arm(rng):
    """Panda has two fingers beside its seven joints."""
    model = model_of("panda")
    arm = pinsing.load(model)
    assert (arm.n, model.nq) == (7, 9)
    full = panda_q(rng, model)
    q = arm.q_of(full)
    assert np.array_equal(q, full[:7])
    assert np.array_equal(arm.full_q(q, others=full), full)
    assert np.array_equal(arm.q_of(arm.full_q(q)), q)
    data = model.createData()
    theirs = pin.computeFrameJacobian(
        model, data, full, model.getFrameId(arm.tip), pin.LOCAL_WORLD_ALIGNED
    )
    assert np.allclose(pinsing.frame_jacobian(arm, full), theirs[:, :7], atol=1e-12)


def test_continuous_joints_are_a_cosine_and_a_sine():
    kinds = (pin.JointModelRUBZ(), pin.JointModelRY(), pin.JointModelRUBY())
    *places, tip = (place((0, 0, z)) for z in (0, 0.4, 0.3, 0.2))
    model = serial(zip(kinds, places, strict=True), tip)
    arm = pinsing.load(model, task="position")
    assert (arm.n, model.nq) == (3, 5)
    q = np.array([3.0, 0.5, -2.0])
    full = arm.full_q(q)
    assert np.allclose(full, [np.cos(3), np.sin(3), 0.5, np.cos(-2), np.sin(-2)])
    assert np.allclose(arm.q_of(full), q)
    assert np.allclose(pinsing.at(arm, full).sigma, pinsing.at(arm, q).sigma)
    assert np.allclose(arm.q_of(pin.neutral(model)), 0)
    full[3:] = 0
    with pytest.raises(ConfigurationError, match="'j3' must be its cosine and sine") as caught:
        pinsing.at(arm, full)
    assert caught.value.joint == "j3"


def test_parts_of_the_whole_model(rng):
    model = model_of("ur5")
    some = [n for n in list(model.names)[1:] if "elbow" not in n]
    arm = pinsing.load(model, joints=some)
    full = arm.full_q(np.full(5, 0.3))
    assert np.allclose(arm.q_of(full), 0.3)
    full[2] += 0.5
    with pytest.raises(ConfigurationError, match="is locked in this arm") as caught:
        pinsing.singular_values(arm, full[None])
    assert (caught.value.joint, caught.value.value) == ("elbow_joint", pytest.approx(0.5))
    for name in ("ur5", "stanford", "puma560"):
        arm = pinsing.load(model_of(name))
        assert arm.n == arm.source.full_model.nq
        q = rng.uniform(-1, 1, arm.n)
        assert np.array_equal(arm.q_of(q), q)
        assert np.array_equal(arm.full_q(q), q)
    model = model_of("panda")
    arm = pinsing.load(model, base="panda_link1", tip="panda_link8")
    assert (arm.n, model.nq) == (6, 9)
    full = panda_q(rng, model)
    assert np.array_equal(arm.q_of(full), full[1:7])  # where joint 1 stands does not matter
    exact = pinsing.robot.nominal(arm).arm
    assert np.array_equal(exact.q_of(full), full[1:7])
    assert pinsing.singular_values(exact, full[None]).shape == (1, 6)


MIMIC = '<mimic joint="j1" multiplier="-2" offset="0.25"/>'


def test_mimic_joints_follow_in_the_whole_model_too(write_urdf):
    turn = f'<origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>{LIMIT}'
    path = write_urdf([("revolute", turn), ("revolute", turn + MIMIC), ("revolute", turn)])
    arm = pinsing.load(path, task="vx,vy")
    assert (arm.n, arm.source.full_model.nq) == (2, 3)
    full = arm.full_q([0.1, 0.7])
    assert np.allclose(full, [0.1, -0.2 + 0.25, 0.7])
    assert np.allclose(arm.q_of(full), [0.1, 0.7])
    with pytest.raises(ConfigurationError, match="j2' follows 'j1' in the description") as caught:
        arm.q_of([0.1, 0.1, 0.7])
    assert caught.value.joint == "j2"


@pytest.mark.parametrize("where", ["sweep", "map", "special"])
def test_errors_about_limits_have_joint_value_and_limits(where):
    arm = pinsing.load("puma560")
    q = np.zeros(6)
    q[1] = -1.5
    asked = {
        "sweep": lambda: pinsing.sampling.plan_sweep(arm, nominal=q),
        "map": lambda: pinsing.sampling.plan_map(arm, q=q, joints=[arm.joints[0]]),
        "special": lambda: pinsing.sampling.plan_sweep(arm, special={arm.joints[1]: [-1.5]}),
    }
    with pytest.raises(ConfigurationError) as caught:
        asked[where]()
    assert (caught.value.joint, caught.value.value) == (arm.joints[1], pytest.approx(-1.5))
    assert caught.value.limits == (arm.lower[1], arm.upper[1])


def test_errors_carry_data(write_urdf, tmp_path):
    arm = pinsing.load("ur5")
    with pytest.raises(ConfigurationError) as caught:
        pinsing.at(arm, [0, 0, np.nan, 0, 0, 0])
    assert caught.value.joint == arm.joints[2]
    assert np.isnan(caught.value.value)
    with pytest.raises(UnknownNameError) as frame:
        pinsing.load("ur5", tip="tool1")
    assert frame.value.kind == "frame"
    assert "tool0" in frame.value.close
    model = model_of("ur5")
    model.lowerPositionLimit[1], model.upperPositionLimit[1] = 1.0, -1.0
    with pytest.raises(JointError) as limits:
        pinsing.load(model)
    assert (limits.value.joint, limits.value.limits) == ("shoulder_lift_joint", (1.0, -1.0))
    path = tmp_path / "a.urdf"
    path.write_text("<robot>\n<link></robot>")
    with pytest.raises(RobotFileError) as damaged:
        pinsing.load(path)
    assert (damaged.value.path, damaged.value.line) == (path, 2)


@pytest.mark.parametrize(
    "error",
    [
        ArgumentError("arm", "an Arm", "None", "load one"),
        ConfigurationError("q", joint="j", value=1.0, limits=(0.0, 0.5)),
        JointError("j", "is odd", value=1.0),
        RobotFileError("is damaged", Path("a.urdf"), 3),
        UnknownNameError("robot", "nope", ["a", "b"]),
    ],
)
def test_errors_travel_with_their_data(error):
    """Workers send them home by pickle."""
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert again.__dict__ == error.__dict__


def test_an_error_about_chains_carries_what_could_be_asked_for():
    with pytest.raises(ChainError) as several:
        pinsing.load("pr2")
    error = several.value
    assert len(error.tips) == len(error.lengths) >= 2
    for tip, n in zip(error.tips, error.lengths, strict=True):
        assert pinsing.load("pr2", tip=tip).n == n
    for given, fault in (
        ({"joints": ["panda_finger_joint1"], "tip": "panda_hand"}, "panda_finger_joint1"),
        ({"joints": ["panda_joint1", "panda_joint1"]}, "panda_joint1"),
    ):
        with pytest.raises(ChainError, match=fault) as other:
            pinsing.load("panda", **given)
        assert other.value.joint == fault
        assert (other.value.tips, other.value.lengths) == ((), ())
    assert pickle.loads(pickle.dumps(error)).tips == error.tips
    with pytest.raises(ChainError) as apart:
        pinsing.load("pr2", base="l_wrist_roll_link", tip="l_gripper_palm_link")
    assert (apart.value.base, apart.value.tip) == ("l_wrist_roll_link", "l_gripper_palm_link")


def test_a_chain_of_a_mechanism_says_what_is_left_out():
    assert "closed loops of delta.loops.yaml are left out" in str(pinsing.closed_form("delta"))
