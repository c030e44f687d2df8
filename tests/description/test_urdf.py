"""Reading and checking robot descriptions: what is refused, mended, noted, and left alone."""

import json
import pickle
from dataclasses import replace
from unittest.mock import Mock

import pinocchio as pin
import pytest
from command_line import run
from tiers import sampled, tiered
from urdf_texts import LIMIT, drawn, joint, make_package, robot

import pinsing
from pinsing.description.catalog import data_folder
from pinsing.description.dh_table import read_dh
from pinsing.description.files import PackageIndex
from pinsing.description.urdf import read_description
from pinsing.errors import RobotFileError, UnknownNameError
from pinsing.robot.models import build_model
from pinsing.view.scene import read_links

DATA = data_folder()
ALL_URDFS = sorted(DATA.rglob("*.urdf"))
WITHOUT_JOINTS = {"quadrotor_base.urdf", "ur3.urdf"}


def test_good_file(read, tmp_path):
    """What arms are made of it, and what is noted of others, is in ``said``."""
    found = read(robot(joint(inner='<origin xyz="1 2 3"/><axis xyz="0 -1 0"/>' + LIMIT)))
    assert (found.links, found.path, found.notes) == (("a", "b", "c"), tmp_path / "arm.urdf", ())
    assert (found.joint("j2").axis, found.joint("j2").line) == ((0.0, -1.0, 0.0), 5)
    found.require_usable(["j1", "j2"])
    with pytest.raises(UnknownNameError, match="did you mean 'j1'"):
        found.require_usable(["j11"])
    assert pickle.loads(pickle.dumps(found)) == found
    assert read(robot(joint(inner=LIMIT))).joint("j2").axis == (1.0, 0.0, 0.0)
    long = read(robot(joint(inner='<axis xyz="2 -3 6"/>' + LIMIT))).joint("j2").axis
    assert long == pytest.approx((2 / 7, -3 / 7, 6 / 7), abs=1e-16)
    unnamed = read(robot(head=""), name="my_arm.v2.urdf")
    assert build_model(unnamed).name == unnamed.name == "my_arm"


def test_what_is_no_readable_file(tmp_path, monkeypatch):
    for path, said in [
        (tmp_path / "nope.urdf", "no such file"), ("nul\0byte.urdf", "no such file"),
        (tmp_path, "is a folder"), ("/dev/zero", "not a plain file"),
    ]:  # fmt: skip
        for reader in (read_description, read_dh):
            with pytest.raises(RobotFileError, match=said):
                reader(path)
    file = tmp_path / "huge.urdf"
    file.write_text(robot())
    monkeypatch.setattr("pinsing.description.xml_tree.MAX_BYTES", 100)
    with pytest.raises(RobotFileError, match="larger than"):
        read_description(file)


@pytest.mark.parametrize(
    "text",
    [
        robot(extra="<!-- \xe9 -->").encode(), b"\xef\xbb\xbf" + robot().encode(),
        ('<?xml version="1.0" encoding="latin-1"?>' + robot(head='name="\xe9"')).encode("latin1"),
        ('<?xml version="1.0" encoding="cp1252"?>' + robot(head='name="\u20ac"')).encode("cp1252"),
        robot(head='name="\xe9"').encode("utf-16"),
    ],
    ids=["utf-8", "bom", "latin-1", "windows-1252", "utf-16"],
)  # fmt: skip
def test_encodings(text, read):
    found = read(text)
    assert found.name in ("r", "\xe9", "\u20ac")
    assert build_model(found).name == found.name


@pytest.mark.parametrize(
    ("inner", "note"),
    [("", "no usable limits"), (LIMIT + '<mimic joint="zz"/>', "a joint that does not exist")],
    ids=["without limits", "mimics nobody"],
)
def test_a_joint_that_cannot_be_analysed_can_be_locked(inner, note):
    arm = pinsing.load(robot(joint(inner=inner)), joints=["j1"], tip="c")
    assert any(note in text and "'j2'" in text for text in arm.notes)
    assert (arm.joints, arm.source.full_model.nv) == (("j1",), 2)


def test_joints_that_no_arm_can_have(read):
    found = read(
        robot(joint(kind="floating", inner=""), joint("j3", "c", "d", "planar"), links="abcd")
    )
    assert [entry.kind for entry in found.joints] == ["revolute", "floating", "planar"]
    assert found.joint("j2").axis is None
    assert build_model(found).nv == 1 + 6 + 3


def test_build_model_names_what_it_cannot_build(read):
    """It is silent: `test_said`."""
    found = read(robot())
    broken = replace(found, shapes=replace(found.shapes, text=robot(joint(inner=""))))
    with pytest.raises(RobotFileError, match=r"arm\.urdf: Pinocchio cannot build it: [^\n]+$"):
        build_model(broken)


@pytest.mark.parametrize(
    "file",
    sampled(tiered(ALL_URDFS, ALL_URDFS[::3])),
    ids=lambda file: f"{file.parts[-3]}-{file.stem}",
)
def test_every_robot_of_example_robot_data(file):
    if file.name in WITHOUT_JOINTS:
        with pytest.raises(RobotFileError, match="nothing to analyse"):
            read_description(file)
        return
    found = read_description(file)
    ours, theirs = build_model(found), pin.buildModelFromUrdf(str(file))
    assert list(ours.names) == list(theirs.names)
    assert [j.shortname() for j in ours.joints] == [j.shortname() for j in theirs.joints]
    assert [(f.name, f.type) for f in ours.frames] == [(f.name, f.type) for f in theirs.frames]
    assert [*ours.jointPlacements] == [*theirs.jointPlacements]
    assert [f.placement for f in ours.frames] == [f.placement for f in theirs.frames]
    moving = [j for j in found.joints if j.kind in ("revolute", "prismatic") and not j.problem]
    for entry in moving:
        index = theirs.joints[theirs.getJointId(entry.name)].idx_q
        assert entry.lower == theirs.lowerPositionLimit[index] == ours.lowerPositionLimit[index]
        assert entry.upper == theirs.upperPositionLimit[index] == ours.upperPositionLimit[index]
    assert found.root == theirs.frames[1].name


# Packages and meshes: found, missing, or outside the robot's folders ---------------------


@pytest.fixture
def package(tmp_path):
    return make_package(tmp_path)


def test_meshes_are_found(package):
    file, absolute = package / "urdf" / "arm.urdf", package / "meshes" / "a.stl"
    names = ("package://arm_description/meshes/a.stl", "../meshes/a.stl", absolute)
    file.write_text(drawn(*names, f"file://{absolute}"))
    found = read_description(file)
    assert (found.missing_meshes, found.notes) == ((), ())
    shapes = pin.buildGeomFromUrdfString(build_model(found), found.xml, pin.VISUAL)
    assert [shape.meshPath for shape in shapes.geometryObjects] == [str(absolute)] * 4


def test_packages_given(package, tmp_path, monkeypatch):
    """Those of the environment are tried with xacro files, which look in the same places."""
    file = tmp_path / "elsewhere" / "arm.urdf"
    file.parent.mkdir()
    file.write_text(drawn("package://arm_description/meshes/a.stl"))
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    assert read_description(file).missing_meshes
    assert not read_description(file, packages={"arm_description": package}).missing_meshes
    with pytest.raises(RobotFileError, match="folder given for package 'arm' does not exist"):
        read_description(file, packages={"arm": tmp_path / "nope"})


def test_meshes_are_looked_for_when_the_robot_is_drawn_and_not_before(package, monkeypatch):
    file = package / "urdf" / "arm.urdf"
    file.write_text(drawn("package://arm_description/meshes/a.stl", "b.stl"))
    search = Mock(side_effect=PackageIndex.mesh)
    monkeypatch.setattr(PackageIndex, "mesh", lambda *given: search(*given))
    arm = pinsing.load(file)
    str(pinsing.at(arm, [0.1] * arm.n))
    str(pinsing.closed_form(arm))
    assert not search.called
    assert not any("drawn" in note for note in arm.notes)
    notes = read_links(arm).notes
    assert "1 of 2 mesh files not found and not drawn, as 'b.stl' (no such file)" in notes
    assert arm.source.mesh_notes == notes
    asked = [call.args[1] for call in search.call_args_list]  # once is enough
    assert asked == ["package://arm_description/meshes/a.stl", "b.stl"]


def test_only_info_and_view_say_which_meshes_are_missing(package):
    file = package / "urdf" / "arm.urdf"
    file.write_text(drawn("b.stl"))
    said = "1 of 1 mesh files not found and not drawn, as 'b.stl' (no such file)"
    for words, told in (["list"], True), (["families"], False), (["at", "--q", "0,0"], False):
        done = run(words[0], file, *words[1:])
        assert done.exit_code == 0
        assert (said in " ".join(done.output.split())) == told
    assert said in json.loads(run("list", file, "-o", "-").stdout)["arm"]["notes"]
    assert f"note: {said}" in run("view", file, "-o", package / "page.html").stderr


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
