"""From a robot to an arm: which chain, which tip, what is locked, and what is refused."""

import pickle
import re
import shlex
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from arms import pinocchio_jacobian, place, serial, told
from golden import Golden
from pinocchio.robot_wrapper import RobotWrapper
from test_chains import TOWARDS
from urdf_text import ZERO, X, Z, chain_text, follows
from urdf_texts import robot

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
from pinsing.kinematics.jacobian import frame_jacobian
from pinsing.robot.load import load
from pinsing.sampling import plan_map, plan_sweep

STEP = place((0.3, 0, 0))


COMPOSITE = pin.JointModelComposite()
COMPOSITE.addJoint(pin.JointModelRX(), STEP)
FREE = pin.JointModelSpherical(), pin.JointModelPlanar(), pin.JointModelTranslation()


@pytest.mark.parametrize(
    ("joint", "limits", "at", "message"),
    [
        *((joint, (-1, 1), STEP, "'j2'.*degrees of freedom") for joint in FREE),
        (pin.JointModelHZ(0.1), (-2, 2), STEP, "'j2': is a screw"),
        (COMPOSITE, (-2, 2), STEP, "'j2': is several joints"),
        (pin.JointModelRZ(), (np.nan, 1), STEP, "not numbers"),
        (pin.JointModelRZ(), (0, np.nan), STEP, "not numbers"),
        (pin.JointModelRZ(), (1, -1), STEP, "lower limit 1 is above upper limit -1"),
        (pin.JointModelRZ(), (-2, 2), place((np.inf, 0, 0)), "'j2': its placement is not finite"),
    ],
)
def test_joints_of_a_model_that_no_arm_can_have(joint, limits, at, message):
    hinge = pin.JointModelRX(), STEP
    model = serial([hinge, (joint, at, *limits), hinge])
    with pytest.raises(JointError, match=message) as caught:
        load(model, tip="tip")
    assert caught.value.joint == "j2"
    if joint in FREE:  # as the message advises
        assert load(model, tip="tip", base="j2").joints == ("j3",)


def test_no_limits_and_no_width():
    model = serial([(pin.JointModelRX(), STEP), (pin.JointModelRZ(), STEP)])
    model.lowerPositionLimit[0], model.upperPositionLimit[0] = -np.inf, np.inf
    model.lowerPositionLimit[1] = model.upperPositionLimit[1] = 0.5
    arm = load(model, tip="tip")
    cannot = "WARNING: joint j2 cannot move: both its limits are 0.5"
    assert arm.notes == ("joint j1 has no limits", cannot)
    assert arm.span[0].tolist() == pytest.approx([-np.pi, 0.5])
    model = serial([(pin.JointModelRZ(), STEP), (pin.JointModelRX(), STEP)], STEP)
    model.addFrame(pin.Frame("j1", 2, 0, STEP, pin.FrameType.OP_FRAME))  # j1 is a joint's as well
    arm = load(model, tip="j1")
    assert (arm.joints, arm.model.frames[arm.tip_id].parentJoint) == (("j1", "j2"), 2)


def test_models_without_frames_of_joints():
    limits, (one, two) = [np.ones(1)] * 2, (-np.ones(1), np.ones(1))
    model = pin.Model()
    for parent, name in ((0, "a"), (1, "b"), (0, "side")):
        joint = model.addJoint(parent, pin.JointModelRZ(), STEP, name, *limits, one, two)
        model.addFrame(pin.Frame(f"on {name}", joint, 0, STEP, pin.FrameType.BODY), False)
    arm = load(model, tip="on b")
    assert (arm.joints, arm.model.nframes) == (("a", "b"), 6)
    assert not any(frame.parentFrame for frame in arm.model.frames)
    model.frames[1].name = "universe"  # which the root is called, too
    again = load(model, tip="on b")
    np.testing.assert_array_equal(*(frame_jacobian(x, [1, 2]) for x in (again, arm)))


def test_models_that_pinocchio_reduced():
    """The frame of a joint that was locked is its own parent there."""
    arm = load("ur5")
    whole = arm.source.full_model
    reduced = load(pin.buildReducedModel(whole, [3], pin.neutral(whole)), tip="tool0")
    assert pinsing.robot.nominal(reduced).jacobian_change < 1e-10
    J = frame_jacobian(arm, [1, 1, 0, 1, 1, 1])[:, [0, 1, 3, 4, 5]]
    np.testing.assert_allclose(frame_jacobian(reduced, np.ones(5)), J, atol=1e-12)


def test_degrees_and_millimetres_of_a_file_are_doubted():
    def said(length: float, high: float) -> str:
        joints = [(pin.JointModelRZ(), STEP), (pin.JointModelRY(), place((length, 0, 0)))]
        model = serial(joints, upper=high)
        return "; ".join(n for n in load(model).notes if "WARNING" in n)

    assert not said(0.4, 4.0)
    assert "up to 180 rad: are they degrees?" in said(0.4, 180.0)
    assert "400 m in a row: are they millimetres?" in said(400.0, 4.0)


LOADED = Golden(Path(__file__).with_name("loaded.txt"))


@pytest.mark.parametrize("head", LOADED.heads())
def test_what_is_loaded(head):
    """A robot and options, as of the command line."""
    robot, *words = shlex.split(head.removesuffix(" (slow)"))
    given = dict(zip([word[2:] for word in words[::2]], words[1::2], strict=True))
    if "joints" in given:
        given["joints"] = [name for name in given["joints"].split(",") if name]
    try:
        arm = load(TOWARDS.get(robot, robot), **given)
    except PinsingError as error:
        LOADED.hold(head, re.sub(r"/\S*/", "", f"{type(error).__name__}: {error}"))
    else:
        LOADED.hold(head, "\n".join(told(arm)))
        if arm.coupling is None:
            assert tuple(arm.model.names)[1:] == arm.joints  # base to tip


def test_folding_by_whole_turns():
    arm = load("kinova")
    q = np.array([7.0, 9.0, 3.0, -10.0, 0.1, np.pi])
    folded = arm.fold(q)
    turns = (q - folded) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    assert (np.abs(folded[[0, 3, 5]]) <= np.pi).all()
    assert arm.within_limits(folded) == arm.within_limits(q)
    Q = np.zeros((100_000, 6))
    Q[40_000:41_000, 1] = -70
    with pytest.raises(ConfigurationError, match=r"Q\[40000\]: shoulder_lift_joint"):
        pinsing.singular_values(load("ur5"), Q)


def test_limits_count_values_as_they_are():
    arm = load("stanford")
    q = np.clip(np.full(6, 0.2), arm.lower, arm.upper)
    assert arm.within_limits(q)
    slide = int(np.flatnonzero(arm.prismatic)[0])
    for i in range(6):
        turned = q + 2 * np.pi * np.eye(6)[i]
        assert not arm.within_limits(turned)
        assert arm.within_limits(arm.fold(turned)) == (i != slide)
    out = q.copy()
    out[slide] = arm.upper[slide] + 0.1
    assert arm.within_limits(np.array([q, out])).tolist() == [True, False]


class Table:
    """What pinsing knows a DataFrame by."""

    def __init__(self, columns, values):
        self.columns, self.values = columns, np.asarray(values)

    def __getitem__(self, name):
        return self.values[..., self.columns.index(name)]

    def __array__(self, dtype=None, copy=None):
        return self.values


def test_columns_are_found_by_their_names():
    arm = load("ur5")
    form = pinsing.closed_form(arm)
    Q = np.random.default_rng(0).uniform(-2, 2, (5, 6))
    table, row = (Table(list(arm.joints[::-1]), x[..., ::-1]) for x in (Q, Q[0]))
    assert np.array_equal(pinsing.singular_values(arm, table), pinsing.singular_values(arm, Q))
    assert np.array_equal(pinsing.clearance(form, table).lower, pinsing.clearance(form, Q).lower)
    assert np.array_equal(pinsing.at(arm, row).q, Q[0])
    assert pinsing.Monitor(form).update(row) == pinsing.Monitor(form).update(Q[0])
    same = [pinsing.check_trajectory(arm, x, forms=form).to_dict() for x in (table, Q)]
    assert same[0] == same[1]
    family = form.families[0]
    assert family.distance(row).upper == family.distance(Q[0]).upper
    assert np.array_equal(family.contains(table), family.contains(Q))
    with pytest.raises(ConfigurationError, match=r"a dict: give a list.* order of arm\.joints"):
        pinsing.clearance(form, dict(zip(arm.joints, Q[0], strict=True)))
    numbered = Table(list(range(6)), Q)
    assert np.array_equal(pinsing.singular_values(arm, numbered), pinsing.singular_values(arm, Q))


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (["base", *load("ur5").joints[1:]], "has no column shoulder_pan_joint"),
        ([*load("ur5").joints, "time"], "has an unknown column time"),
        ([*load("ur5").joints, "elbow_joint"], "has twice column elbow_joint"),
    ],
)
def test_columns_that_do_not_fit_are_named(columns, words):
    arm = load("ur5")
    table = Table(columns, np.zeros((2, len(columns))))
    for take in (pinsing.singular_values, pinsing.check_trajectory):
        with pytest.raises(ConfigurationError, match=words):
            take(arm, table)


DEGREES = [0, -70, 75, -90, -80, 0]


def test_degrees_are_refused_and_radians_can_be_insisted_on():
    arm = load("ur5")
    form = pinsing.closed_form(arm)
    takes = [
        lambda a, f: pinsing.at(a, DEGREES), lambda a, f: pinsing.singular_values(a, [DEGREES] * 3),
        lambda a, f: pinsing.check_trajectory(a, [[0.0] * 6, DEGREES], forms=f),
        lambda a, f: pinsing.clearance(f, DEGREES), lambda a, f: pinsing.is_clear(f, DEGREES, 0.1),
        lambda a, f: pinsing.Monitor(f).update(DEGREES),
        lambda a, f: pinsing.Monitor(f).update(np.array(DEGREES, dtype=float)),
        lambda a, f: pinsing.Monitor(f).update([float(x) for x in DEGREES]),
        lambda a, f: pinsing.crossings(f, [DEGREES, DEGREES]),
    ]  # fmt: skip
    for take in takes:
        with pytest.raises(ConfigurationError, match=r"shoulder_lift_joint = -70 rad is -11\.1"):
            take(arm, form)
    insisting = load("ur5", units="rad")
    its_form = pinsing.closed_form(insisting)
    for take in takes:
        take(insisting, its_form)
    for q in ([9.0, 0, 0, 0, 0, 0], [0, 12.5, 0, 0, 0, 0], [0, 500.0, 0, 0, 0, 0]):
        assert not arm.within_limits(arm.check(q))  # outside, but not by the rule for degrees


def test_joints_without_limits_count_as_limited_to_a_turn():
    arm = load("kinova")
    endless = int(np.flatnonzero(~np.isfinite(arm.upper))[0])
    q = np.clip(np.zeros(arm.n), arm.lower, arm.upper)
    for value in (12.5, 361):
        q[endless] = value
        arm.check(q)
    for value in (12.6, -90):
        q[endless] = value
        with pytest.raises(ConfigurationError, match="no limits"):
            arm.check(q)


# The doors that Pinocchio users try first: their models, wrappers, texts and configurations ---


def model_of(name: str) -> pin.Model:
    return pin.buildModelFromUrdf(str(find_robot(name).path))


def test_a_wrapper_what_has_a_model_a_path_a_text_and_a_name_are_one_arm():
    """Text begins with blanks, a mark of its order of bytes, or a declaration, or with none."""
    path = find_robot("ur5").path
    text = path.read_text().partition("?>")[2].lstrip()
    latin = '  \n<?xml version="1.0" encoding="iso-8859-1"?>\n<!-- \u00e9 -->\n'
    begin = ("", "\n\n   \t", "\ufeff", '<?xml version="1.0"?>\n', latin)
    wrapper = RobotWrapper(model_of("ur5"))
    q = [0.1, -1.0, 1.2, 0.3, 0.5, 0.0]
    expected = pinsing.at(load("ur5"), q)
    anything = SimpleNamespace(model=wrapper.model)
    for given in (wrapper, wrapper.model, anything, path, str(path), *(b + text for b in begin)):
        arm = load(given)
        source = ("URDF text", None) if "<robot" in str(given) else None
        assert source in (None, (arm.source.label, arm.source.path))
        assert (arm.joints, arm.tip) == (expected.arm.joints, expected.arm.tip)
        assert np.allclose(pinsing.at(arm, q).J, expected.J, atol=1e-12)


@pytest.mark.parametrize("path", ["a/" * 3000, "a/\0b", "a/\x1b[2J\nb"])
def test_a_path_that_cannot_be_is_one_short_line(path):
    with pytest.raises(RobotFileError, match="no such file") as caught:
        load(path)
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
        arm = load(text)
        assert "mesh filename" not in arm.source.xml
        given = load(text.replace(address, "package://p/a.stl"), packages={"p": tmp_path})
        assert "mesh filename" in given.source.xml


def test_a_configuration_of_the_whole_model_is_one_of_the_arm(rng):
    """Panda has two fingers beside its seven joints, and some arms begin behind its first."""
    model = model_of("panda")
    arm, part = load(model), load(model, base="panda_link1", tip="panda_link8")
    assert (arm.n, part.n, model.nq) == (7, 6, 9)
    full = rng.uniform(-0.05, 0, 9) + model.upperPositionLimit
    q = full[:7]
    assert np.array_equal(arm.q_of(full), q)
    assert np.array_equal(arm.full_q(q, others=full), full)
    theirs = pinocchio_jacobian(arm, q)
    assert np.allclose(pinsing.frame_jacobian(arm, full), theirs, atol=1e-12)
    exact = pinsing.robot.nominal(part).arm
    assert np.array_equal([part.q_of(full), exact.q_of(full)], [q[1:], q[1:]])
    assert pinsing.singular_values(exact, full[None]).shape == (1, 6)


def test_continuous_joints_are_a_cosine_and_a_sine():
    """Chains of `test_chains` are looked at there."""
    kinds = (pin.JointModelRUBZ(), pin.JointModelRY(), pin.JointModelRUBY())
    arm = load(serial((kind, STEP) for kind in kinds), task="position")
    q = np.array([3.0, 0.5, -2.0])
    full = arm.full_q(q)
    assert np.allclose(pinsing.at(arm, full).sigma, pinsing.at(arm, q).sigma)
    assert np.allclose(arm.space.wrap(q + 2 * np.pi * np.array([1, -2, 100])), q)
    full[3:] = 0
    with pytest.raises(ConfigurationError, match="'j3' must be its cosine and sine") as caught:
        pinsing.at(arm, full)
    assert caught.value.joint == "j3"


def test_a_joint_that_is_locked_stands_where_it_was_locked():
    model = model_of("ur5")
    arm = load(model, joints=[n for n in list(model.names)[1:] if "elbow" not in n])
    full = arm.full_q(np.full(5, 0.3))
    assert np.allclose(arm.q_of(full), 0.3)
    full[2] += 0.5
    with pytest.raises(ConfigurationError, match="is locked in this arm") as caught:
        pinsing.singular_values(arm, full[None])
    assert (caught.value.joint, caught.value.value) == ("elbow_joint", pytest.approx(0.5))


def test_mimic_joints_follow_in_the_whole_model_too():
    arm = load(
        chain_text([("revolute", X, Z, ZERO, more) for more in ("", follows(1, -2, 0.25), "")]),
        task="vx,vy",
    )
    assert np.allclose(arm.full_q([0.1, 0.7]), [0.1, -0.2 + 0.25, 0.7])
    with pytest.raises(ConfigurationError, match="j2' follows 'j1' in the description") as caught:
        arm.q_of([0.1, 0.1, 0.7])
    assert caught.value.joint == "j2"


def floating() -> pin.Model:
    path = load("a1", tip="FL_foot").source.path
    return pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())


def following() -> pin.Model:
    text = chain_text([("revolute", X), ("revolute", X, Z, ZERO, follows(1, -2, 0.25))])
    model = pin.buildModelFromXML(text, mimic=True)
    assert any("Mimic" in joint.shortname() for joint in model.joints)
    return model


def reversed_limits() -> pin.Model:
    model = model_of("ur5")
    model.lowerPositionLimit[1], model.upperPositionLimit[1] = 1.0, -1.0
    return model


PUMA, BEYOND = load("puma560"), np.array([0, -1.5, 0, 0, 0, 0])
JOINT, SPECIAL = PUMA.joints[1], {PUMA.joints[1]: [-1.5]}
LIMITS = {"joint": JOINT, "value": -1.5, "limits": (PUMA.lower[1], PUMA.upper[1])}
TWO = {"tips": ("l_gripper_tool_frame", "r_gripper_tool_frame"), "lengths": (8, 8)}
APART = {"base": "l_wrist_roll_link", "tip": "l_gripper_palm_link"}
FINGER = {"tip": "panda_hand", "joints": ["panda_finger_joint1"]}
TOOL = {"kind": "frame", "name": "tool1", "close": ("tool0",)}


@pytest.mark.parametrize(
    ("call", "error", "words", "data"),
    [
        (lambda: load(pin.Model()), ChainError, "no movable joint", {}),
        (lambda: load(floating()), ChainError, r"4 chains.*--tip FL_foot \(3 joints\)", {}),
        (lambda: load("pr2"), ChainError, "2 chains", TWO),
        (lambda: load("panda", **FINGER), ChainError, None,
         {"joint": "panda_finger_joint1", "tips": (), "lengths": ()}),
        (lambda: load("pr2", **APART), ChainError, None, APART),
        (lambda: load("ur5", tip="tool1"), UnknownNameError, "tool1", TOOL),
        (lambda: load(reversed_limits()), JointError, "above",
         {"joint": "shoulder_lift_joint", "limits": (1.0, -1.0)}),
        (lambda: load(following()), PinsingError, "mimic=False", {}),
        (lambda: load(SimpleNamespace(model="ur5")), ArgumentError, "a file, the name", {}),
        (lambda: load(RobotWrapper), TypeError, None, {}),
        (lambda: pinsing.at(PUMA, [0, 0, np.nan, 0, 0, 0]), ConfigurationError, "nan",
         {"joint": PUMA.joints[2], "value": np.nan}),
        (lambda: pinsing.at(PUMA, [0, 90, 0, 0, 0, 0]), ConfigurationError, "For degrees",
         {**LIMITS, "value": 90.0}),
        (lambda: plan_sweep(PUMA, nominal=BEYOND), ConfigurationError, None, LIMITS),
        (lambda: plan_map(PUMA, q=BEYOND, joints=["q1"]), ConfigurationError, None, LIMITS),
        (lambda: plan_sweep(PUMA, special=SPECIAL), ConfigurationError, None, LIMITS),
        (lambda: load("a.urdf"), RobotFileError, "no such file", {"path": Path("a.urdf")}),
    ],
)  # fmt: skip
def test_errors_carry_data_also_home_from_workers(call, error, words, data):
    with pytest.raises(error, match=words) as caught:
        call()
    for found in (caught.value, pickle.loads(pickle.dumps(caught.value))):
        assert (type(found), str(found)) == (caught.type, str(caught.value))
        np.testing.assert_equal({name: getattr(found, name) for name in data}, data)
        np.testing.assert_equal(vars(found), vars(caught.value))


def test_a_chain_of_a_mechanism_says_what_is_left_out():
    assert "closed loops of delta.loops.yaml are left out" in str(pinsing.closed_form("delta"))
