"""Robots of the package robot_descriptions, and MuJoCo models."""

import importlib.util
import re
import sys

import pytest
from arms import URDF
from command_line import run

import pinsing
from pinsing.errors import RobotFileError, UnknownNameError

MUJOCO = """<mujoco model="two_links">
  <worldbody>
    <body name="upper" pos="0 0 0.2">
      <joint name="shoulder" type="hinge" axis="0 0 1" range="-170 170" limited="true"/>
      <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03"/>
      <body name="lower" pos="0.4 0 0">
        <joint name="elbow" type="hinge" axis="0 0 1" range="-150 150" limited="true"/>
        <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03"/>
        <site name="hand" pos="0.4 0 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

STAND_IN = {
    "__init__": "from ._descriptions import DESCRIPTIONS\n",
    "_descriptions": """
class D:
    def __init__(self, robot, repository):
        self.maker, self.robot, self.repository = "Unimation", robot, repository
DESCRIPTIONS = {
    "puma_description": D("PUMA", "here"),
    "table_description": D("Table", "here"),
    "xacro_description": D("Arm", "here"),
    "broken_description": D("Broken", "here"),
    "far_description": D("Far", "there"),
    "shape_description": D("Shape", "here"),
}
""",
    "_repositories": """
class R:
    def __init__(self, url, cache_path):
        self.url, self.cache_path = url, cache_path
REPOSITORIES = {"here": R("https://e.org/here.git", "here"), "there": R("https://e.org/x", "x")}
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

XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="length" default="1"/>
  <xacro:include filename="$(find pack)/link.xacro"/>
  <link name="base"/><link name="hand"/>
  <joint name="q1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="end" type="fixed"><parent link="a"/><child link="hand"/>
    <origin xyz="$(arg length) 0 0"/></joint>
</robot>
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A stand-in for the package, whose one repository is in the cache."""
    folder, cache, pack = (tmp_path / n for n in ("robot_descriptions", "cache", "pack"))
    for place in (folder, cache / "here", pack):
        place.mkdir(parents=True)
    (tmp_path / "arm.xacro").write_text(XACRO)
    (pack / "link.xacro").write_text('<robot><link name="a"/></robot>')
    (tmp_path / "arm.xml").write_text(MUJOCO)
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


def test_a_described_robot_loads_by_name(package, capsys):
    arm = pinsing.load("rd:puma_description")
    assert (arm.name, arm.n) == ("rd:puma_description", 6)
    assert capsys.readouterr().out == ""
    own = pinsing.load("puma560")
    q = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    assert pinsing.kinematics.task_jacobian(arm, q) == pytest.approx(
        pinsing.kinematics.task_jacobian(own, q)
    )


@pytest.mark.slow
def test_its_other_robots(package):
    arm = pinsing.load("rd:xacro_description", task="vy")
    assert pinsing.kinematics.task_jacobian(arm, [0.0])[0, 0] == pytest.approx(0.7)
    arm = pinsing.load("rd:xacro_description", task="vy", xacro_args={"length": "0.2"})
    assert pinsing.kinematics.task_jacobian(arm, [0.0])[0, 0] == pytest.approx(0.2)
    assert pinsing.load("rd:table_description").joints == ("shoulder", "elbow")
    with pytest.raises(RobotFileError, match=r"https://e\.org/x would have to be downloaded"):
        pinsing.load("rd:far_description")
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


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("rd:broken_description", "the package robot_descriptions fails: no network"),
        ("rd:shape_description", "neither as a URDF, a xacro nor a MuJoCo model"),
        ("rd:pumma_description", "did you mean 'rd:puma_description'"),
        ("rd:", "unknown robot 'rd:'"),
    ],
)
def test_what_cannot_be_had_is_one_line(package, name, said):
    done = run("list", "--info", name)
    assert done.exit_code == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


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
