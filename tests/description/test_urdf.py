"""Reading and checking robot descriptions: what is refused, mended, noted, and left alone."""

import json
import pickle
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pinocchio as pin
import pytest
from command_line import run
from tiers import sampled, tiered
from urdf_texts import LIMIT, drawn, joint, make_package, robot

import pinsing
from pinsing.description.catalog import data_folder
from pinsing.description.files import PackageIndex
from pinsing.description.urdf import read_description
from pinsing.errors import RobotFileError, UnknownNameError
from pinsing.robot.models import build_model
from pinsing.view.scene import read_links

DATA = data_folder()
ALL_URDFS = sorted(DATA.rglob("*.urdf"))
WITHOUT_JOINTS = {"quadrotor_base.urdf", "ur3.urdf"}


def test_good_file(read, tmp_path):
    found = read(robot(joint(inner='<origin xyz="1 2 3"/><axis xyz="0 -1 0"/>' + LIMIT)))
    assert (found.name, found.links, found.root) == ("r", ("a", "b", "c"), "a")
    assert (found.path, found.notes) == (tmp_path / "arm.urdf", ())
    entry = found.joints[1]
    assert (entry.name, entry.kind, entry.parent, entry.child) == ("j2", "revolute", "b", "c")
    assert (entry.axis, entry.lower, entry.upper, entry.line) == ((0.0, -1.0, 0.0), -1.0, 2.0, 5)
    assert entry.mimic is entry.problem is None
    found.require_usable(["j1", "j2"])
    with pytest.raises(UnknownNameError, match="did you mean 'j1'"):
        found.require_usable(["j11"])
    model = build_model(found)
    assert list(model.names) == ["universe", "j1", "j2"]
    np.testing.assert_array_equal(model.jointPlacements[2].translation, [1, 2, 3])
    np.testing.assert_array_equal(model.upperPositionLimit, [2, 2])
    assert pickle.loads(pickle.dumps(found)) == found
    assert read(robot(joint(inner=LIMIT))).joint("j2").axis == (1.0, 0.0, 0.0)
    unnamed = read(robot(head=""), name="my_arm.v2.urdf")
    assert "called 'my_arm' after its file" in unnamed.notes[0]
    assert build_model(unnamed).name == unnamed.name == "my_arm"


# What stands in joint j2 before its limits, or the joint; what is said. All are on line 5.
BAD_JOINTS = {
    "zero axis": ('<axis xyz="0 0 0"/>', "axis is zero"),
    "tiny axis": ('<axis xyz="1e-200 0 0"/>', "axis is zero"),
    "nan axis": ('<axis xyz="nan 0 1"/>', "nan is not a finite number"),
    "two numbers": ('<axis xyz="0 1"/>', "must have 3 numbers"),
    "commas": ('<axis xyz="0,0,1"/>', "separated by blanks"),
    "axis without xyz": ("<axis/>", 'has no xyz="..."'),
    "two axes": ('<axis xyz="1 0 0"/><axis xyz="0 1 0"/>', "2 <axis>"),
    "nan origin": ('<origin xyz="0 nan 0"/>', "nan is not a finite number"),
    "inf origin": ('<origin xyz="0 0 -inf"/>', "-inf is not a finite number"),
    "inf rpy": ('<origin rpy="Infinity 0 0"/>', "not a finite number"),
    "overflow": ('<origin xyz="1e999 0 0"/>', "too large"),
    "absurd": ('<origin xyz="1e308 0 0"/>', "too large, at most 1e+06"),
    "text": ('<origin xyz="one 0 0"/>', "'one' is not a number"),
    "a number without end": (f'<origin xyz="{"9" * 2_000_000}x 0 0"/>', "of 2,000,001 characters"),
    "python number": ('<origin xyz="1_0 0 0"/>', "'1_0' is not a number"),
    "hexadecimal": ('<origin xyz="0x1 0 0"/>', "'0x1' is not a number"),
    "other digits": ('<origin xyz="١ 0 0"/>', "is not a number"),
    "expression": ('<origin xyz="${x} 0 0"/>', "name the file .xacro"),
    "two origins": ("<origin/><origin/>", "has 2 <origin>"),
    "ignored quaternion": ('<origin quat_xyzw="1 0 0 0"/>', 'version="1.1"'),
    "ignored quaternion of three": ('<origin quat_xyzw="1 0 0"/>', 'version="1.1"'),
    "crossed limits": (
        joint(inner=LIMIT.replace("-1", "3")), "limit 3 is above upper limit 2: exchange them",
    ),
    "nan limit": (joint(inner='<limit lower="nan" upper="1"/>'), "nan is not a finite number"),
    "inf limit": (joint(inner='<limit lower="-inf" upper="inf"/>'), "-inf is not a finite number"),
    "text limit": (joint(inner='<limit lower="low" upper="1"/>'), "'low' is not a number"),
    "unknown type": (joint(kind="ball"), "unknown type 'ball': known: revolute, continuous"),
    "mistyped origin": ('<orgin xyz="0 0 1"/>', "did you mean 'origin'?"),
    "mistyped xyz": ('<origin xzy="0 0 1"/>', "did you mean 'xyz'?"),
    "mistyped lower": (joint(inner=LIMIT.replace("lower", "Lower")), "did you mean 'lower'?"),
    "mistyped type": (joint(kind="Revolute "), "did you mean 'revolute'?"),
    "no type": (joint().replace('type="revolute"', ""), 'has no type="..."'),
    "no name": (joint().replace('name="j2"', ""), "a <joint> has no name"),
    "blank name": (joint(name=" "), "a <joint> has no name"),
    "reserved name": (joint(name="universe"), "rename the joint"),
    "same name": (joint(name="j1"), "two joints are named 'j1' (the first is on line 4)"),
    "no parent": (joint().replace('<parent link="b"/>', ""), "has no <parent"),
    "no child": (joint().replace('<child link="c"/>', ""), "has no <child"),
    "parent without link": (joint().replace('<parent link="b"/>', "<parent/>"), 'no link="..."'),
    "two parents given": (joint().replace("<parent", '<parent link="a"/><parent'), "2 <parent> el"),
    "unknown parent": (joint(parent="zz"), "unknown parent link 'zz': no link has that name"),
    "unknown child": (joint(child="C1"), "unknown child link 'C1'"),
    "itself": (joint(parent="c"), "joins link 'c' to itself"),
    "two parents": (joint(child="b", parent="c"), "two parents, by joints 'j1' and 'j2'"),
    "mimics itself": ('<mimic joint="j2"/>', "'j2' follows 'j2'"),
    "mimic without joint": ("<mimic/>", '<mimic> has no joint="..."'),
    "mimic nan": ('<mimic joint="j1" offset="nan"/>', "not a finite number"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_JOINTS)
def test_bad_joint_is_refused_with_its_line(case, refused):
    text, expected = BAD_JOINTS[case]
    text = text if text.startswith("<joint") else joint(inner=text + LIMIT)
    error = refused(robot(text))
    assert expected in str(error)
    assert ("arm.urdf:5: " in str(error), error.line) == (True, 5)
    if "j2" in text and case not in ("same name", "two parents", "mimics itself"):
        assert "joint 'j2'" in str(error)


def heavy(mass: object, ixz: object) -> str:
    """A file whose last link has a mass and an inertia."""
    inertia = f'<inertia ixx="1" ixy="0" ixz="{ixz}" iyy="1" iyz="0" izz="1"/>'
    inertial = f'<inertial><mass value="{mass}"/>{inertia}</inertial>'
    return robot(links="bc", extra=f'<link name="a">{inertial}</link>')


# whole files: text, what the message must hold, line
BAD_FILES = {
    "empty": ("", "the file is empty", None),
    "blank": (" \n\t\n", "the file is empty", None),
    "not xml": ("hello", "is not XML", None),
    "binary": (bytes(range(256)), "is not XML", None),
    "truncated": (robot()[:-5], "is not well-formed XML", 6),
    "mismatched": ("<robot>\n<link>\n</robot>", "mismatched tag", 3),
    "sdf": ("<sdf><model/></sdf>", "is an SDF file, not a URDF", 1),
    "mjcf": ("<mujoco/>", "is a MuJoCo model, not a URDF", 1),
    "other": ("\n<foo/>", "has the root element <foo>, not a URDF", 2),
    "no links": ('<robot name="r"/>', "has no links", 1),
    "no joints": ('<robot name="r"><link name="a"/></robot>', "has no joints", 1),
    "link without name": (robot(extra="<link/>"), "a <link> has no name", 6),
    "same link twice": (robot(extra='<link name="b"/>'), "two links are named 'b'", 6),
    "two roots": (robot(links="abcd"), "2 links have no parent ('a', 'd')", None),
    "whole loop": (robot(joint("j3", "b", "a"), links="ab"), "joints 'j1', 'j3' form a loop", 4),
    "loop aside": (
        robot(joint("j3", "d", "c"), joint("j4", "c", "d"), links="abcd"), "a URDF is a tree", 6,
    ),
    "mimic round about": (
        robot(
            joint("j2", inner=LIMIT + '<mimic joint="j3"/>'),
            joint("j3", "c", "d", inner=LIMIT + '<mimic joint="j2"/>'), links="abcd",
        ),
        "'j2' follows 'j3' follows 'j2'", 5,
    ),
    "nan mass": (heavy("nan", 0), "link 'a': <mass value='nan'>: nan is not a finite number", 6),
    "infinite inertia": (heavy(1, "inf"), "inf is not a finite number", 6),
    "absurd mass": (heavy("1e308", 0), "is too large", 6),
    "mass with an inertia": (heavy('1" ixx="q', 0), "link 'a': <mass ixx='q'>: 'q' is not", 6),
    "universe": (robot(joint(child="universe"), links=["a", "b", "universe"]), "rename", None),
    "entity": ('<?xml version="1.0"?>\n<!DOCTYPE r []><robot/>', "remove the <!DOCTYPE", 2),
    "zero quaternion": (
        robot(joint(inner='<origin quat_xyzw="0 0 0 0"/>' + LIMIT), head='version="1.1"'),
        "joint 'j2': <origin quat_xyzw> is zero", 5,
    ),
    "both rotations": (
        robot(joint(inner='<origin rpy="0 0 0" quat_xyzw="1 0 0 0"/>'), head='version="1.2"'),
        "has both rpy and quat_xyzw", 5,
    ),
    "deep": ("<robot>\n" + "<a>" * 100_000, "nested deeper than 100 levels", 2),
    "wide": ("<robot>" + "<a/>" * 500_001, "more than 500000 elements", 1),
    "too many attributes": (
        "<robot " + " ".join(f'a{i}=""' for i in range(101)) + "/>", "more than 100 attributes", 1,
    ),
    "not utf-8": (robot(extra="<!-- \xe9 -->").encode("latin-1"), "byte 0xe9 is not utf-8", 6),
    "unknown encoding": ('<?xml version="1.0" encoding="klingon"?><robot/>', "encoding", 1),
    "wrong encoding": ('<?xml version="1.0" encoding="utf-16"?><robot/>', "utf-16", 1),
    "long arm": (
        '<robot name="r">'
        + "".join(f'<link name="l{i}"/>' for i in range(1003))
        + "".join(joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(1002))
        + "</robot>",
        "1002 joints in a row: at most 1000", None,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", tiered(BAD_FILES, {*BAD_FILES} - {"wide"}))
def test_bad_file_is_refused(case, refused):
    text, expected, line = BAD_FILES[case]
    error = refused(text)
    assert expected in str(error)
    assert error.line == line


def test_what_is_no_readable_file(tmp_path, monkeypatch):
    for path, said in [
        (tmp_path / "nope.urdf", "no such file"), ("nul\0byte.urdf", "no such file"),
        (tmp_path, "is a folder"), ("/dev/zero", "not a plain file"),
    ]:  # fmt: skip
        with pytest.raises(RobotFileError, match=said):
            read_description(path)
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


def test_names_with_odd_characters_reach_pinocchio_unchanged(read):
    name = "<b> & \"q\" 'x' \u202e \\input{x} %"
    escaped = name.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    found = read(robot(joint(name=escaped)))
    assert found.joints[1].name == name
    assert list(build_model(found).names)[2] == name


@pytest.mark.parametrize("mark", ["&#10;", "&#9;", "&#13;", "\x85", "\x9b"])
def test_control_characters_in_names_are_refused(mark, refused):
    for text in (
        robot(joint(name=f"a{mark}b")),
        robot(head=f'name="a{mark}b"'),
        robot(links="bc", extra=f'<link name="a{mark}b"/>'),
    ):
        said = str(refused(text))
        assert "control character" in said
        assert said.isprintable()


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize(
    ("limit", "reason"),
    [
        ("", "has no <limit>"),
        ('<limit effort="1" velocity="1"/>', "without lower and upper"),
        ('<limit lower="-1e16" upper="1e16" effort="1" velocity="1"/>', "which are none"),
    ],
    ids=["none", "empty", "endless"],
)
def test_joint_without_limits_can_be_locked_but_not_analysed(kind, limit, reason, read):
    found = read(robot(joint(kind=kind, inner=limit)))
    entry = found.joint("j2")
    assert (entry.lower, entry.upper) == (None, None)
    assert any("no usable limits" in note and "'j2'" in note for note in found.notes)
    found.require_usable(["j1"])
    with pytest.raises(RobotFileError, match=reason) as caught:
        found.require_usable(["j1", "j2"])
    assert caught.value.line == 5
    assert "joint 'j2'" in str(caught.value)
    assert ("continuous" in str(caught.value)) == (kind == "revolute")
    assert build_model(found).nv == 2


def test_limits_that_need_a_word(read):
    equal = read(robot(joint(inner='<limit lower="0" upper="0" effort="1" velocity="1"/>')))
    assert equal.notes == ()  # it matters to a chain only, which says so
    half = read(robot(joint(inner='<limit upper="2" effort="1" velocity="1"/>')))
    assert (half.joint("j2").lower, half.joint("j2").upper) == (0.0, 2.0)
    assert "the other taken as 0" in half.notes[0]
    endless = read(robot(joint(kind="continuous", inner='<axis xyz="0 0 1"/>' + LIMIT)))
    assert endless.joint("j2").upper is None
    assert "limits are ignored" in endless.notes[0]
    bare = read(robot(joint(inner='<limit lower="-1" upper="1"/>')))
    assert any("no usable effort" in note for note in bare.notes)
    assert build_model(bare).upperPositionLimit[1] == 1.0


@pytest.mark.parametrize(
    ("axis", "unit", "kind"),
    [
        ("0 0 2", (0, 0, 1), "JointModelRZ"),
        ("0 -3 0", (0, -1, 0), "JointModelRevoluteUnaligned"),
        ("3 4 0", (0.6, 0.8, 0), "JointModelRevoluteUnaligned"),
    ],
)
def test_axis_is_normalised_as_pinocchio_does(axis, unit, kind, read):
    text = robot(joint(inner=f'<axis xyz="{axis}"/>' + LIMIT))
    found = read(text)
    assert found.joint("j2").axis == pytest.approx(unit, abs=1e-16)
    assert found.notes == ("axis not of unit length, normalised, in joint 'j2'",)
    ours, theirs = build_model(found), pin.buildModelFromXML(text)
    assert ours.joints[2].shortname() == kind
    q = np.array([0.3, -0.4])
    np.testing.assert_allclose(
        pin.computeJointJacobians(ours, ours.createData(), q),
        pin.computeJointJacobians(theirs, theirs.createData(), q),
        atol=1e-15,
    )


def test_mimic(read):
    good = read(robot(joint(inner=LIMIT + '<mimic joint="j1" multiplier="-2" offset="0.5"/>')))
    mimic = good.joint("j2").mimic
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("j1", -2.0, 0.5)
    unknown = read(robot(joint(inner=LIMIT + '<mimic joint="zz"/>')))
    assert unknown.joint("j2").mimic is None
    assert "mimics a joint that does not exist" in unknown.notes[0]
    with pytest.raises(RobotFileError, match="mimics joint 'zz', which does not exist"):
        unknown.require_usable(["j2"])
    assert build_model(unknown).nv == 2


def test_other_joints_and_rotations(read):
    found = read(
        robot(joint(kind="floating", inner=""), joint("j3", "c", "d", "planar"), links="abcd")
    )
    assert [entry.kind for entry in found.joints] == ["revolute", "floating", "planar"]
    assert found.joint("j2").axis is None
    assert build_model(found).nv == 1 + 6 + 3
    found = read(robot(joint(kind="fixed", inner='<axis xyz="0 0 0"/><limit effort="x"/>')))
    assert build_model(found).nv == 1
    text = robot(
        joint(inner='<origin quat_xyzw="1 0 0 0"/>' + LIMIT), head='version="1.1" name="r"'
    )
    rotation = build_model(read(text)).jointPlacements[2].rotation
    np.testing.assert_allclose(rotation, np.diag([1.0, -1.0, -1.0]), atol=1e-15)


SHAPES = {
    "unknown": "<geometry><foo/></geometry>", "none": "", "empty": "<geometry/>",
    "text": '<geometry><box size="1 x 1"/></geometry>',
    "nan": '<geometry><sphere radius="nan"/></geometry>',
    "negative": '<geometry><cylinder radius="-1" length="1"/></geometry>',
    "no size": '<geometry><cylinder radius="1"/></geometry>',
    "origin": '<origin xyz="inf 0 0"/><geometry><sphere radius="1"/></geometry>',
    "scale": '<geometry><mesh filename="x.stl" scale="1 1"/></geometry>',
}  # fmt: skip


@pytest.mark.parametrize("case", SHAPES)
@pytest.mark.parametrize("tag", ["visual", "collision"])
def test_bad_shape_is_left_out(case, tag, read):
    good = '<visual><geometry><sphere radius="0.1"/></geometry></visual>'
    bad = f"<{tag}>{SHAPES[case]}</{tag}>"
    found = read(robot(links="bc", extra=f'<link name="a">{bad}{good}</link>'))
    assert found.notes == (f"a <{tag}> that cannot be read is left out of link 'a'",)
    shapes = pin.buildGeomFromUrdfString(build_model(found), found.xml, pin.VISUAL)
    assert len(shapes.geometryObjects) == 1


@pytest.mark.parametrize("dynamics", ['damping="x"', 'friction="-1"', 'damping="-1e-9"'])
def test_what_kinematics_does_not_need_never_stops_it(read, dynamics):
    inner = LIMIT + f'<dynamics {dynamics}/><safety_controller/><calibration rising="y"/>'
    extra = (
        '<material name="m"><color rgba="0 0 9 1"/></material>'
        '<material name="m"><color/></material>'
        '<gazebo><a b="nan"/></gazebo><transmission><joint name="?"/></transmission>'
    )
    link = '<link name="a"><inertial><mass value="1"/></inertial></link>'
    head = 'name="r" version="7"'
    found = read(robot(joint(inner=inner), links="bc", extra=extra + link, head=head))
    assert any("unreadable <dynamics>" in note for note in found.notes)
    assert any("incomplete <inertial>" in note for note in found.notes)
    assert build_model(found).nv == 2


def test_build_model_is_silent_and_names_what_it_cannot_build(read, capfd):
    found = read(robot())
    build_model(found)
    assert capfd.readouterr() == ("", "")
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
    """Those of the environment are tried with xacro files."""
    file = tmp_path / "elsewhere" / "arm.urdf"
    file.parent.mkdir()
    file.write_text(drawn("package://arm_description/meshes/a.stl"))
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
