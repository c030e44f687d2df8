"""Robots known by name, and what a user means by the text of a robot."""

import importlib.util
import re
import sys
import zipfile
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml
from arms import URDF, told
from command_line import run
from golden import Golden
from tiers import tiered
from urdf_texts import XACRO, joint

import pinsing
from pinsing.description import catalog
from pinsing.description.dh_table import bare_urdf, known_table
from pinsing.errors import PinsingError, RobotFileError, UnknownNameError
from pinsing.proof.checker import verify

# Names that the loaders of example-robot-data give.
LOADERS = [
    "ur3", "ur5", "ur5_limited", "ur10", "panda", "xarm7", "z1", "talos", "talos_arm", "tiago",
    "tiago_no_hand", "tiago_pro", "pr2", "baxter", "romeo", "kinova", "icub", "g1", "so100",
    "so101", "anymal_kinova", "solo8",
]  # fmt: skip
OWN = {"stanford", "surgical7", "puma560", "irb1400", "iiwa14", "planar3r", "scara"}


def test_every_file_has_a_name_and_every_name_a_file():
    entries = catalog.known_robots()
    folder = catalog.data_folder()
    files = set(folder.rglob("*.urdf"))
    assert len(files) >= 69
    assert files <= {entry.path for entry in entries.values()}
    assert all(entry.path.is_file() and entry.name == name for name, entry in entries.items())
    assert list(entries) == sorted(entries)
    # exactly one name of each file is the main one
    own = [entry for entry in entries.values() if entry.path.suffix == ".urdf"]
    main = [entry.path for entry in own if entry.alias_of is None]
    assert len(main) == len(set(main)) == len({entry.path for entry in own})
    for entry in entries.values():
        if entry.alias_of is not None:
            assert entries[entry.alias_of].path == entry.path
            assert entries[entry.alias_of].alias_of is None
    assert entries["anymal"].path.parts[-3] == "anymal_b_simple_description"
    assert entries["anymal_c"].path.parts[-3] == "anymal_c_simple_description"
    assert entries["iris"].path.name == "iris_simple.urdf"
    assert entries["iris_iris"].path.name == "iris.urdf"
    assert "take ur3" in entries["ur_ur3"].note
    assert entries["stanford"].title == "Stanford arm"
    for name in (*LOADERS, *OWN):  # found at once
        assert catalog.find_robot(name) == entries[name]
        assert (entries[name].source == "pinsing") == (name in OWN)


def test_what_a_user_means(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert catalog.locate_robot("ur5") == catalog.find_robot("ur5")
    (tmp_path / "panda").mkdir()
    assert not isinstance(catalog.locate_robot("panda"), Path)
    (tmp_path / "ur5").write_text("<robot/>")
    assert catalog.locate_robot("ur5") == Path("ur5")
    assert catalog.locate_robot(tmp_path / "ur5") == tmp_path / "ur5"
    assert catalog.locate_robot(str(tmp_path)) == tmp_path
    assert catalog.locate_robot("CRX-10iA/L").name == "crx10ia_l"
    (tmp_path / "CRX-10iA").mkdir()
    (tmp_path / "CRX-10iA" / "L").write_text("<robot/>")
    assert catalog.locate_robot("CRX-10iA/L") == Path("CRX-10iA/L")
    plain = ("ur5.urdf", "./ur10", "./g1", "double/pendulum", "x/y", "my.XACRO")
    for path in (*plain, Path("double_pendulum"), Path("ur10")):
        with pytest.raises(RobotFileError, match="no such file") as caught:
            catalog.locate_robot(path)
        assert caught.value.path == Path(path)
    for text in ("a\0b", "~"):
        with pytest.raises(RobotFileError):
            catalog.locate_robot(text)
    assert catalog.locate_robot("") == Path()


def test_without_the_data_package(monkeypatch):
    monkeypatch.setattr(sys, "path", ["", str(Path(__file__).parent)])
    assert catalog.data_folder() is None
    assert set(catalog.known_robots()) >= OWN
    with pytest.raises(UnknownNameError):
        catalog.find_robot("ur5")


# Arms of ``urdf/arms.yaml``: their tables say what other descriptions of the same arms say ---

HERE = Path(__file__).parent
NAMES, DESCRIBED = (Golden(HERE / "said" / f"{name}.txt") for name in ("names", "described"))
SECOND = yaml.load((HERE / "arms_second_source.yaml").read_text(), Loader=yaml.CSafeLoader)
TABLES = sorted(name for name, arm in catalog.known_arms().items() if "rows" in arm)
DOCS = HERE.parents[1] / "docs"
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
        pin.framesForwardKinematics(model, data, pin.integrate(model, pin.neutral(model), q))
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
    if name != "dvrk_psm":  # which lies at its remote centre; others stand upright
        assert np.abs(second["base"][3:5]).max() < 0.01
    if not name.startswith("dvrk_psm"):  # the description ends with the jaw, the table before it
        tip = (base * zero).translation - np.array(second["tip"]) / 1000
        assert np.linalg.norm(tip) < apart / 1000


def test_entries_are_whole():
    for name, arm in catalog.known_arms().items():
        assert {"maker", "model", "known_for", "reach"} < set(arm)
        assert ("source" in arm) == ("rows" in arm) != ("joints" in arm), name
    assert len(TABLES) >= 50
    assert set(SECOND) <= set(TABLES)
    assert all(f"\n|{name}|" in PAGE for name in catalog.known_arms())
    entry = catalog.known_robots()["xarm7"]
    assert (entry.source == "example-robot-data") == (catalog.data_folder() is not None)
    for name in TABLES:
        reach = catalog.known_arms()[name]["reach"]
        ends = placements(name, configurations(name, 100))
        far = max(np.hypot(*end.translation[:2]) for end in ends)
        assert 0.5 * reach < far < reach + 0.001, name
        # The z axis of tool0 points out of the flange, away from the axis before the last: what
        # tool-down poses and `--tool` mean depends on it.
        model = pin.buildModelFromXML(bare_urdf(known_table(name)))
        data, (tip,) = model.createData(), placements(name, 0 * configurations(name, 1))
        pin.forwardKinematics(model, data, pin.neutral(model))
        before = data.oMi[model.njoints - 2].translation
        assert tip.rotation[:, 2] @ (tip.translation - before) > -1e-9, name


@pytest.mark.parametrize("head", NAMES.heads())
def test_names_are_found_as_people_write_them(head: str) -> None:
    """And those of arms of the same kind are suggested first."""
    try:
        entry = catalog.locate_robot(head)
    except UnknownNameError as error:
        NAMES.hold(head, str(error))
    else:
        NAMES.hold(head, entry.alias_of or entry.name)


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
        if catalog.known_arms()[name]["maker"].split()[0] in makers.split():
            zero = placements(name, 0 * configurations(name, 1))[0]
            expected = pin.rpy.rpyToMatrix(*np.radians(other.get(name, rpy)))
            np.testing.assert_allclose(zero.rotation, expected, atol=1e-9, err_msg=name)


# Robots of the package robot_descriptions, and MuJoCo models -----------------------------

STAND_IN = {
    "__init__": "from ._descriptions import DESCRIPTIONS\n",
    "_descriptions": """
from types import SimpleNamespace as D
DESCRIPTIONS = {
    f"{name.lower()}_description": D(maker="Unimation", robot=name, repository=repository)
    for repository, names in (("here", "PUMA Table Xacro Broken Shape"), ("there", "Far"))
    for name in names.split()
}
""",
    "_repositories": """
from types import SimpleNamespace as R
REPOSITORIES = {
    "here": R(url="https://e.org/here.git", cache_path="here"),
    "there": R(url="https://e.org/x", cache_path="x"),
}
""",
    "puma_description": "print('noise')\nURDF_PATH = {puma!r}\nPACKAGE_PATH = {urdf!r}\n",
    "xacro_description": (
        "XACRO_PATH = {xacro!r}\nPACKAGE_PATH = {pack!r}\nXACRO_ARGS = {{'length': '0.7'}}\n"
    ),
    "broken_description": "raise RuntimeError('no\\nnetwork')\n",
    "far_description": "raise SystemExit('must not be imported')\n",
    "shape_description": "SDF_PATH = 'x.sdf'\n",
    "table_description": "MJCF_PATH = {mjcf!r}\n",
}

ARM = XACRO.format(
    '<xacro:arg name="length" default="1"/><xacro:include filename="$(find pack)/link.xacro"/>'
    '<link name="base"/><link name="hand"/>'
    + joint("q1", "base", "a")
    + joint("end", "a", "hand", "fixed", '<origin xyz="$(arg length) 0 0"/>')
)


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A stand-in for the package, whose one repository is in the cache."""
    folder, cache, pack = (tmp_path / n for n in ("robot_descriptions", "cache", "pack"))
    for place in (folder, cache / "here", pack):
        place.mkdir(parents=True)
    (tmp_path / "arm.xacro").write_text(ARM)
    (pack / "link.xacro").write_text('<robot><link name="a"/></robot>')
    (tmp_path / "arm.xml").write_text(Golden(HERE / "said" / "arm.xml.txt").good)
    places = {
        "puma": str(URDF / "puma560.urdf"), "urdf": str(URDF), "xacro": str(tmp_path / "arm.xacro"),
        "pack": str(pack), "mjcf": str(tmp_path / "arm.xml"),
    }  # fmt: skip
    for name, text in STAND_IN.items():
        text = text.format(**places) if "{" in text and name[0] != "_" else text
        (folder / f"{name}.py").write_text(text)
    for name in [m for m in sys.modules if m.partition(".")[0] == "robot_descriptions"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(cache))
    yield
    for name in [m for m in sys.modules if m.partition(".")[0] == "robot_descriptions"]:
        del sys.modules[name]


@pytest.mark.parametrize("head", DESCRIBED.heads())
def test_what_is_said_of_described_robots(package, head, capsys):
    """Robots, and arguments of xacro; of them alone, not by them."""
    name, *given = head.removesuffix(" (slow)").split()
    try:
        arm = pinsing.load(name, xacro_args=dict(word.split("=") for word in given))
    except PinsingError as error:
        DESCRIBED.hold(head, str(error))
    else:
        DESCRIBED.hold(head, "\n".join(told(arm)))
    assert capsys.readouterr().out == ""


def test_described_robots_are_listed(package):
    done = run("list", "rd:")
    assert re.search(r"rd:puma_description +Unimation PUMA", done.stdout)
    assert "Unimation Far (not on this computer)" in done.stdout


def test_a_clone_that_is_not_whole_fetches_nothing(package, tmp_path):
    """A folder that holds a `.git` alone: the package would ask the network for the rest."""
    folder = tmp_path / "robot_descriptions"
    (folder / "_cache.py").write_text(
        "def clone_to_directory(repo_url, target_dir, commit=None):\n"
        "    raise SystemExit('the network was asked')\n"
        "def clone_to_cache(name, commit=None):\n"
        f"    return clone_to_directory('url', {str(tmp_path / 'cache' / 'here')!r}).working_dir\n"
    )
    (folder / "puma_description.py").write_text(
        "from os import path\n"
        "from ._cache import clone_to_cache\n"
        "URDF_PATH = path.join(clone_to_cache('here'), 'puma.urdf')\n"
    )
    (tmp_path / "cache" / "here" / ".git").mkdir()
    done = run("list", "rd:puma_description")
    assert done.exit_code == 2
    assert "puma.urdf. What is missing would have to be downloaded" in done.stderr
    assert "`robot_descriptions pull puma_description` does it" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    text = (URDF / "puma560.urdf").read_text()
    (tmp_path / "cache" / "here" / "puma.urdf").write_text(text)
    assert pinsing.load("rd:puma_description").n == 6
    cache = sys.modules["robot_descriptions._cache"]
    with pytest.raises(SystemExit):
        cache.clone_to_directory("url", "folder")


def test_without_the_package_the_line_says_so(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(RobotFileError, match=r"pip install 'pinsing\[descriptions\]'"):
        pinsing.load("rd:ur5_description")
    assert "rd:" not in run("list").stdout


@pytest.mark.skipif(
    importlib.util.find_spec("robot_descriptions") is None,
    reason="robot_descriptions is not installed",
)
def test_the_real_package_is_understood(tmp_path, monkeypatch):
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path))
    with pytest.raises(RobotFileError, match=r"ros2_kortex\.git would have to be downloaded"):
        pinsing.load("rd:gen3_description")
    with pytest.raises(UnknownNameError, match="rd:gen3_description"):
        pinsing.load("rd:gen3_descriptio")
    assert list(tmp_path.iterdir()) == []
