"""Arms of ``urdf/arms.yaml``: their tables say what other descriptions of the same arms say."""

import zipfile
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml
from tiers import tiered

import pinsing
from pinsing.description import catalog
from pinsing.description.catalog import find_robot, known_arms, known_robots, locate_robot
from pinsing.description.dh_table import bare_urdf, known_table
from pinsing.errors import UnknownNameError
from pinsing.proof.checker import verify
from pinsing.robot.nominal import chain_model, flatten

SECOND = yaml.load(
    (Path(__file__).parent / "arms_second_source.yaml").read_text(), Loader=yaml.CSafeLoader
)
TABLES = sorted(name for name, arm in known_arms().items() if "rows" in arm)
DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "arms.md").read_text()
QUICK = ("crx10ia_l", "epson_gx4")


def motions(q: np.ndarray, prismatic: list[bool], axes: np.ndarray) -> pin.SE3:
    """Where the base's frame is carried when each joint moves by q from zero, base to tip."""
    moved = pin.SE3.Identity()
    for value, slides, (*point, x, y, z) in zip(q, prismatic, axes, strict=True):
        axis = np.array([x, y, z])
        around = np.cross(np.array(point) / 1000, axis)
        twist = [*axis, 0, 0, 0] if slides else [*around, *axis]
        moved = moved * pin.exp6(value * np.array(twist))
    return moved


def configurations(name: str, count: int) -> np.ndarray:
    rows = known_table(name).rows
    lower = [-np.pi if row.lower is None else row.lower for row in rows]
    upper = [np.pi if row.upper is None else row.upper for row in rows]
    return np.random.default_rng(7).uniform(lower, upper, (count, len(rows)))


def placements(name: str, qs: np.ndarray) -> list[pin.SE3]:
    model = pin.buildModelFromXML(bare_urdf(known_table(name)))
    data, tip = model.createData(), model.getFrameId("tool0")
    ends = []
    for q in qs:
        continuous = [joint.nq == 2 for joint in model.joints[1:]]
        full = [[np.cos(x), np.sin(x)] if c else [x] for x, c in zip(q, continuous, strict=True)]
        pin.framesForwardKinematics(model, data, np.concatenate(full))
        ends.append(data.oMf[tip].copy())
    return ends


@pytest.mark.parametrize("name", SECOND)
def test_forward_kinematics_agree_with_another_description(name: str) -> None:
    second = SECOND[name]
    *xyz, rx, ry, rz = second["base"]
    base = pin.SE3(pin.exp3(np.radians([rx, ry, rz])), np.array(xyz) / 1000)
    prismatic = [row.type == "prismatic" for row in known_table(name).rows]
    Q = np.vstack([0 * configurations(name, 1), configurations(name, 20)])
    apart = second["distance"]
    zero, *ends = placements(name, Q)
    for q, end in zip(Q[1:], ends, strict=True):
        found, expected = base * end, motions(q, prismatic, np.array(second["axes"])) * base * zero
        assert np.linalg.norm(found.translation - expected.translation) < apart / 1000
        assert np.abs(found.rotation - expected.rotation).max() < 1e-3 * apart
    if not name.startswith("dvrk_psm"):  # the description ends with the jaw, the table before it
        tip = (base * zero).translation - np.array(second["tip"]) / 1000
        assert np.linalg.norm(tip) < apart / 1000


def test_arms_stand_upright():
    """The base of the other description is that of the table, but for turns about z."""
    for name, second in SECOND.items():
        if name != "dvrk_psm":  # which lies at its remote centre
            assert np.abs(second["base"][3:5]).max() < 0.01, name


def test_entries_are_whole():
    for name, arm in known_arms().items():
        assert {"maker", "model", "known_for", "reach"} < set(arm)
        assert ("source" in arm) == ("rows" in arm) != ("joints" in arm), name
    assert len(TABLES) >= 50
    assert set(SECOND) <= set(TABLES)
    assert all(f"\n|{name}|" in PAGE for name in known_arms())
    entry = known_robots()["xarm7"]
    assert (entry.source == "example-robot-data") == (catalog.data_folder() is not None)
    for name in TABLES:
        reach = known_arms()[name]["reach"]
        ends = placements(name, configurations(name, 100))
        far = max(np.hypot(*end.translation[:2]) for end in ends)
        assert 0.5 * reach < far < reach + 0.001, name


def test_a_rebuilt_chain_keeps_names_limits_and_speeds():
    """As that of a calibrated robot, whose speeds are judged; names are those of its driver."""
    arm = pinsing.load("ur5e")
    made = chain_model(flatten(arm), arm)
    assert list(made.names)[1:] == list(arm.joints)
    assert made.names[5] == "wrist_2_joint"
    for limit in ("lowerPositionLimit", "upperPositionLimit", "velocityLimit"):
        assert np.array_equal(getattr(made, limit), getattr(arm.model, limit)), limit
    assert (made.velocityLimit == np.pi).all()


@pytest.mark.parametrize(
    ("said", "name"),
    [
        ("UR5e", "ur5e"), ("TX2-60", "tx2_60"), ("LR Mate 200iD", "lrmate200id"),
        ("xArm850", "uf850"), ("KR6 R900", "kr6_r900"), ("LBR iiwa 14 R820", "iiwa14"),
        ("KUKA KR 6 R900 sixx", "kr6_r900"), ("Franka Research 3", "fr3"), ("UR 10e", "ur10e"),
    ],
)  # fmt: skip
def test_names_are_found_as_people_write_them(said: str, name: str) -> None:
    assert find_robot(said).path == find_robot(name).path
    assert (find_robot(said).alias_of or find_robot(said).name) == name


@pytest.mark.parametrize(
    ("said", "name"),
    [
        ("Motoman HC10DTP", "hc10"), ("Motoman GP25", "gp25"), ("Kinova Gen3 7DoF", "gen3_7"),
        ("ABB IRB 1200-7/0.7", "irb1200"), ("KR 6 R900-2", "kr6_r900"), ("TX2-60L", "tx2_60"),
    ],
)  # fmt: skip
def test_names_of_arms_of_the_same_kind_are_suggested_first(said: str, name: str) -> None:
    with pytest.raises(UnknownNameError) as error:
        locate_robot(said)
    assert error.value.close[0] == name


@pytest.mark.parametrize("name", tiered(TABLES, QUICK))
def test_all_families_are_proven(name: str) -> None:
    arm = pinsing.load(name)
    assert arm.n == len(known_table(name).rows)
    form = pinsing.closed_form(arm)
    cells = next(row for row in PAGE.splitlines() if row.startswith(f"|{name}|")).split("|")
    assert (int(cells[6].partition(":")[0]), cells[7]) == (len(form.families), form.word)
    assert form.word == "proven"
    with zipfile.ZipFile(DOCS / "certificates.zip") as archive:
        data = verify(archive.read(f"{name}.json").decode())
    assert data["chain"] == form.proof.certificate["chain"]
    assert data["families"] == form.proof.certificate["families"]


def test_the_z_axis_of_every_tool0_points_out_of_the_flange() -> None:
    """Away from the axis before the last: what tool-down poses and `--tool` mean depends on it."""
    for name in TABLES:
        model = pin.buildModelFromXML(bare_urdf(known_table(name)))
        data = model.createData()
        pin.framesForwardKinematics(model, data, pin.neutral(model))
        tip = data.oMf[model.getFrameId("tool0")]
        before = data.oMi[model.njoints - 2].translation
        assert tip.rotation[:, 2] @ (tip.translation - before) > -1e-9, name


@pytest.mark.parametrize(
    ("makers", "rpy"),
    [
        ("ABB KUKA Mecademic", (0, 90, 0)),
        ("Fanuc Yaskawa", (180, -90, 0)),
        ("Doosan Stäubli Mitsubishi Denso Kawasaki", (0, 0, 0)),
        ("AUBO JAKA Techman Universal", (90, 0, 0)),
        ("UFACTORY", (180, 0, 0)),
    ],
)
def test_tool0_has_the_axes_of_its_maker(makers: str, rpy: tuple[float, float, float]) -> None:
    """At zero, as pendants show it and the descriptions named as sources have it."""
    other = {"iiwa7": (0, 0, 0), "hc10": (180, 0, 0)}
    for name in TABLES:
        if known_arms()[name]["maker"].split()[0] in makers.split():
            zero = placements(name, 0 * configurations(name, 1))[0]
            expected = pin.rpy.rpyToMatrix(*np.radians(other.get(name, rpy)))
            np.testing.assert_allclose(zero.rotation, expected, atol=1e-9, err_msg=name)
