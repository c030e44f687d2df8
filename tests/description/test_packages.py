"""Packages and meshes: found, missing, or outside the robot's folders."""

import json

import pinocchio as pin
import pytest
from command_line import run
from urdf_texts import make_package, robot

import pinsing
from pinsing.description.files import PackageIndex
from pinsing.description.urdf import read_description
from pinsing.errors import RobotFileError
from pinsing.robot.models import build_model
from pinsing.view.scene import read_links


def mesh_robot(*names: str) -> str:
    visuals = "".join(
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual>' for name in names
    )
    return robot(links="bc", extra=f'<link name="a">{visuals}</link>')


@pytest.fixture
def package(tmp_path):
    return make_package(tmp_path)


def test_meshes_are_found(package):
    file, absolute = package / "urdf" / "arm.urdf", package / "meshes" / "a.stl"
    names = ("package://arm_description/meshes/a.stl", "../meshes/a.stl", absolute)
    file.write_text(mesh_robot(*map(str, names), f"file://{absolute}"))
    found = read_description(file)
    assert (found.missing_meshes, found.notes) == ((), ())
    shapes = pin.buildGeomFromUrdfString(build_model(found), found.xml, pin.VISUAL)
    assert [shape.meshPath for shape in shapes.geometryObjects] == [str(absolute)] * 4


def test_packages_given(package, tmp_path, monkeypatch):
    """Those of the environment are tried with xacro files."""
    file = tmp_path / "elsewhere" / "arm.urdf"
    file.parent.mkdir()
    file.write_text(mesh_robot("package://arm_description/meshes/a.stl"))
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    assert read_description(file).missing_meshes
    assert not read_description(file, packages={"arm_description": package}).missing_meshes
    with pytest.raises(RobotFileError, match="folder given for package 'arm' does not exist"):
        read_description(file, packages={"arm": tmp_path / "nope"})
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(package))
    assert not read_description(file).missing_meshes


def test_meshes_are_looked_for_when_the_robot_is_drawn_and_not_before(package, monkeypatch):
    file = package / "urdf" / "arm.urdf"
    file.write_text(mesh_robot("package://arm_description/meshes/a.stl", "b.stl"))
    asked = []
    search = PackageIndex.mesh
    monkeypatch.setattr(
        PackageIndex, "mesh", lambda index, uri: (asked.append(uri), search(index, uri))[1]
    )
    arm = pinsing.load(file)
    str(pinsing.at(arm, [0.1] * arm.n))
    str(pinsing.closed_form(arm))
    assert not asked
    assert not any("drawn" in note for note in arm.notes)
    notes = read_links(arm).notes
    assert asked == ["package://arm_description/meshes/a.stl", "b.stl"]
    assert "1 of 2 mesh files not found and not drawn, as 'b.stl' (no such file)" in notes
    assert arm.source.mesh_notes == notes
    assert len(asked) == 2  # once is enough


def test_only_info_and_view_say_which_meshes_are_missing(package):
    file = package / "urdf" / "arm.urdf"
    file.write_text(mesh_robot("b.stl"))
    said = "1 of 1 mesh files not found and not drawn, as 'b.stl' (no such file)"
    for words, told in (["list"], True), (["families"], False), (["at", "--q", "0,0"], False):
        done = run(words[0], str(file), *words[1:])
        assert done.exit_code == 0
        assert (said in " ".join(done.output.split())) == told
    done = run("list", str(file), "-o", "-")
    assert said in json.loads(done.stdout)["arm"]["notes"]
    page = package / "page.html"
    done = run("view", str(file), "-o", str(page))
    assert done.exit_code == 0
    assert f"note: {said}" in done.stderr


def test_a_texture_that_is_not_there_leaves_the_shape(package):
    file = package / "urdf" / "arm.urdf"
    texture = '<material name="m"><texture filename="no.png"/></material>'
    shape = f"<visual><geometry><sphere radius='1'/></geometry>{texture}</visual>"
    file.write_text(robot(links="ab", extra=f'{texture}<link name="c">{shape}</link>'))
    found = read_description(file)
    assert found.missing_meshes == ("no.png",)
    assert "texture" not in found.xml
    assert "sphere" in found.xml
    shapes = pin.buildGeomFromUrdfString(build_model(found), found.xml, pin.VISUAL)
    assert len(shapes.geometryObjects) == 1
