"""xacro files as they come: parts in packages, found in every way that ROS users know."""

from pathlib import Path

import pytest
from urdf_texts import LIMIT, XACRO, joint, make_package

from pinsing import load
from pinsing.description.urdf import read_description
from pinsing.errors import RobotFileError

PART = XACRO.format(
    '<xacro:macro name="arm" params="length:=0.2">\n'
    + "".join(f'<link name="{link}"/>' for link in "abc")
    + joint("j1", "a", "b")
    + joint("j2", "b", "c", inner='<origin xyz="0 0 ${length}"/><axis xyz="0 1 0"/>' + LIMIT)
    + "\n</xacro:macro>"
)
WHOLE = XACRO.format(
    '<xacro:arg name="length" default="0.3"/>\n'
    '<xacro:include filename="$(find arm_description)/urdf/arm.macro.xacro"/>\n'
    '<xacro:arm length="$(arg length)"/>'
)


@pytest.fixture(autouse=True)
def _no_environment(monkeypatch):
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)


@pytest.fixture
def package(tmp_path) -> Path:
    folder = make_package(tmp_path)
    (folder / "urdf" / "arm.macro.xacro").write_text(PART)
    return folder


@pytest.fixture
def elsewhere(tmp_path) -> Path:
    path = tmp_path / "far" / "away" / "robot.urdf.xacro"
    path.parent.mkdir(parents=True)
    path.write_text(WHOLE)
    return path


def test_package_by_the_environment(package, elsewhere, tmp_path, monkeypatch):
    for value in (package.parent, package, f"/no/such/folder:{package.parent}:"):
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(value))
        assert load(elsewhere).n == 2
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    share = tmp_path / "install" / "share"
    share.mkdir(parents=True)
    package.rename(share / "arm_description")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/no/such/folder:{tmp_path / 'install'}")
    assert load(elsewhere).n == 2


def test_package_by_a_search_upward(package):
    inside = package / "urdf" / "deep" / "robot.xacro"
    inside.parent.mkdir()
    inside.write_text(WHOLE)
    assert load(inside).n == 2
    sibling = package.parent / "other_package" / "robot.xacro"
    sibling.parent.mkdir()
    sibling.write_text(WHOLE)
    assert load(sibling).n == 2


def test_the_option_wins(package, elsewhere, tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(package.parent))
    mine = tmp_path / "mine"
    (mine / "urdf").mkdir(parents=True)
    (mine / "urdf" / "arm.macro.xacro").write_text(PART.replace("${length}", "0.9"))
    arm = load(elsewhere, packages={"arm_description": mine})
    assert arm.model.jointPlacements[2].translation[2] == 0.9


@pytest.mark.slow
def test_errors_name_the_file_and_the_line_they_are_in(package, elsewhere):
    part = package / "urdf" / "arm.macro.xacro"
    part.write_text(PART.replace("${length}", "${lenght}"))
    with pytest.raises(RobotFileError, match="name 'lenght' is not defined") as caught:
        load(elsewhere, packages={"arm_description": package})
    assert (caught.value.path, caught.value.line) == (part, 3)
    part.write_text(PART)
    elsewhere.write_text(WHOLE.replace("<xacro:arm ", "<xacro:arms "))
    with pytest.raises(RobotFileError, match="unknown macro name") as caught:
        load(elsewhere, packages={"arm_description": package})
    assert (caught.value.path, caught.value.line) == (elsewhere, 4)


@pytest.mark.parametrize("name", ["../arm_description", "/etc"])
def test_a_package_is_a_name_and_no_path(name, tmp_path):
    path = tmp_path / "robot.xacro"
    path.write_text(XACRO.format(f'<xacro:include filename="$(find {name})/x.xacro"/>'))
    with pytest.raises(RobotFileError) as caught:
        read_description(path)
    assert "\n" not in str(caught.value)
    assert "not found" in str(caught.value) or "find" in str(caught.value)


def test_a_folder_above_needs_a_package_xml_that_names_it(tmp_path):
    """Else a file could read whatever lies beside any folder above it."""
    for name in ("secret", "secret/robots", "other"):
        (tmp_path / name).mkdir()
    for folder in ("secret", "other"):
        (tmp_path / folder / "key.xml").write_text('<robot><link name="key"/></robot>')
    path = tmp_path / "secret" / "robots" / "a" / "b" / "arm.xacro"
    path.parent.mkdir(parents=True)
    for name in ("secret", "other"):
        path.write_text(XACRO.format(f'<xacro:include filename="$(find {name})/key.xml"/>'))
        with pytest.raises(RobotFileError, match=f"package '{name}' not found"):
            read_description(path)
        manifest = tmp_path / name / "package.xml"
        manifest.write_text("<package><name>different</name></package>")
        with pytest.raises(RobotFileError, match=f"package '{name}' not found"):
            read_description(path)
        manifest.write_text(f"<package><name>{name}</name></package>")
        with pytest.raises(RobotFileError, match="the robot has no joints"):
            read_description(path)
        manifest.unlink()


def test_wildcards_are_bounded_and_follow_no_link_out_of_the_folder(tmp_path):
    """Ten links to the folder itself: ten times as many names at every step."""
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / "link").symlink_to(tmp_path / "a")
    for k in range(10):
        (tmp_path / f"l{k}").symlink_to(".")
    path = tmp_path / "arm.xacro"
    path.write_text(XACRO.format(f'<xacro:include filename="{"*/" * 30}nothere.xml"/>'))
    with pytest.raises(RobotFileError, match="has no links"):
        read_description(path)
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "x.xml").write_text('<robot><link name="a"/></robot>')
    for name, said in (("arm.xacro", "has no joints"), ("robot/arm.xacro", "has no links")):
        path = tmp_path / name  # of the second a link leads out of the folder
        path.write_text(XACRO.format('<xacro:include filename="*/x.xml"/>'))
        with pytest.raises(RobotFileError, match=said):
            read_description(path)


@pytest.mark.slow
def test_wildcards_look_at_so_many_files_and_no_more(tmp_path):
    for name in range(150):
        (tmp_path / f"d{name}").mkdir()
        for inner in range(140):
            (tmp_path / f"d{name}" / f"{inner}").touch()
    path = tmp_path / "arm.xacro"
    path.write_text(XACRO.format('<xacro:include filename="*/*.xml"/>'))
    with pytest.raises(RobotFileError, match="looks at more than 20000 files"):
        read_description(path)
