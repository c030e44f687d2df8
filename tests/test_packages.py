"""Packages and meshes: found, missing, or outside the robot's folders."""

from __future__ import annotations

import pinocchio as pin
import pytest
from urdf_texts import make_package, robot

from pinsing.description.urdf import read_description
from pinsing.errors import RobotFileError
from pinsing.robot.build_model import build_model


def mesh_robot(*names: str) -> str:
    visuals = "".join(
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual>' for name in names
    )
    return robot(links="bc", extra=f'<link name="a">{visuals}</link>')


@pytest.fixture
def package(tmp_path):
    return make_package(tmp_path)


def test_meshes_are_found(package):
    file = package / "urdf" / "arm.urdf"
    absolute = package / "meshes" / "a.stl"
    names = [
        "package://arm_description/meshes/a.stl",
        "../meshes/a.stl",
        str(absolute),
        f"file://{absolute}",
    ]
    file.write_text(mesh_robot(*names))
    found = read_description(file)
    assert found.missing_meshes == ()
    assert found.notes == ()
    assert package.parent in found.package_dirs
    shapes = pin.buildGeomFromUrdfString(build_model(found), found.xml, pin.VISUAL)
    assert [shape.meshPath for shape in shapes.geometryObjects] == [str(absolute)] * 4


def test_missing_meshes_never_stop_anything(package):
    file = package / "urdf" / "arm.urdf"
    names = ["package://nowhere/a.stl", "b.stl", "package://arm_description/meshes/a.stl"]
    file.write_text(mesh_robot(*names))
    found = read_description(file)
    assert found.missing_meshes == ("package://nowhere/a.stl", "b.stl")
    assert len(found.notes) == 1
    assert "2 of 3 mesh files not found and not drawn" in found.notes[0]
    assert "package 'nowhere' not found" in found.notes[0]
    shapes = pin.buildGeomFromUrdfString(build_model(found), found.xml, pin.VISUAL)
    assert len(shapes.geometryObjects) == 1


def test_meshes_outside_the_robot_are_not_opened(package, tmp_path):
    (package / "meshes" / "link.stl").symlink_to(tmp_path / "secret.stl")
    names = [
        "package://arm_description/../../secret.stl",
        "package://../../secret.stl",
        "../../../secret.stl",
        str(tmp_path / "secret.stl"),
        f"file://{tmp_path}/secret.stl",
        f"file://{package}/meshes/%2e%2e/%2e%2e/%2e%2e/secret.stl",
        "package://arm_description/meshes/link.stl",
        "package://arm_description/secret.txt",
        "http://example.org/a.stl",
        "/etc/passwd",
        "",
    ]
    file = package / "urdf" / "arm.urdf"
    file.write_text(mesh_robot(*names))
    found = read_description(file)
    assert set(found.missing_meshes) == set(names)
    assert len(found.notes) == 1
    assert "mesh files not opened and not drawn" in found.notes[0]
    assert "secret" not in found.xml
    assert "passwd" not in found.xml


def test_packages_given_or_in_the_environment(package, tmp_path, monkeypatch):
    file = tmp_path / "elsewhere" / "arm.urdf"
    file.parent.mkdir()
    file.write_text(mesh_robot("package://arm_description/meshes/a.stl"))
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    assert read_description(file).missing_meshes
    assert not read_description(file, packages={"arm_description": package}).missing_meshes
    with pytest.raises(RobotFileError, match="folder given for package 'arm' does not exist"):
        read_description(file, packages={"arm": tmp_path / "nope"})
    for variable, value in (
        ("ROS_PACKAGE_PATH", package.parent),
        ("ROS_PACKAGE_PATH", package),
        ("AMENT_PREFIX_PATH", tmp_path / "install"),
    ):
        with monkeypatch.context() as patch:
            share = tmp_path / "install" / "share"
            share.mkdir(parents=True, exist_ok=True)
            if not (share / "arm_description").exists():
                (share / "arm_description").symlink_to(package)
            patch.setenv(variable, str(value))
            assert not read_description(file).missing_meshes
