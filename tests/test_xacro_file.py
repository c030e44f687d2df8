"""xacro files: arguments, includes, packages, and every way to go wrong."""

from __future__ import annotations

import subprocess
import sys

import pytest
from urdf_texts import LIMIT, joint, make_package, robot

from pinsing.description.urdf import Description, read_description
from pinsing.errors import RobotFileError
from pinsing.robot.build_model import build_model

XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n{}\n</robot>\n'
ARM = "".join(f'<link name="{link}"/>' for link in "abc") + joint("j1", "a", "b") + joint()


@pytest.fixture
def read(tmp_path):
    def write_and_read(text: str | bytes, name: str = "arm.urdf", **options) -> Description:
        file = tmp_path / name
        file.write_bytes(text.encode() if isinstance(text, str) else text)
        return read_description(file, **options)

    return write_and_read


def test_xacro_with_arguments_and_includes(read, tmp_path):
    part = '<xacro:property name="length" value="0.25"/>' + '<link name="a"/><link name="b"/>'
    (tmp_path / "part.xacro").write_text(XACRO.format(part))
    text = XACRO.format(
        '<xacro:arg name="scale" default="1"/>\n<xacro:include filename="part.xacro"/>'
        + joint("j1", "a", "b", inner='<origin xyz="0 0 ${length*$(arg scale)}"/>' + LIMIT)
    )
    for arguments, height in ((None, 0.25), ({"scale": "2"}, 0.5)):
        found = read(text, name="arm.urdf.xacro", xacro_args=arguments)
        assert build_model(found).jointPlacements[1].translation[2] == height
        assert found.joints[0].line is None
    # the element tells, whatever the suffix
    assert read(text).links == ("a", "b")


def test_xacro_error_in_what_it_makes_points_to_the_expansion(read):
    with pytest.raises(RobotFileError, match=r"joint 'j1'.*of what `xacro arm.xacro` prints"):
        read(XACRO.format(ARM.replace("0 0 1", "0 0 ${1-1}", 1)), name="arm.xacro")


def test_xacro_find(read, tmp_path):
    package = make_package(tmp_path)
    (package / "urdf" / "part.xacro").write_text(XACRO.format(ARM))
    include = '<xacro:include filename="$(find arm_description)/urdf/part.xacro"/>'
    found = read(XACRO.format(include), name="arm.xacro", packages={"arm_description": package})
    assert found.links == ("a", "b", "c")
    inside = package / "urdf" / "arm.xacro"
    inside.write_text(XACRO.format(include))
    assert read_description(inside).links == ("a", "b", "c")
    # what xacro turned into a path is still within a known package
    shown = '<visual><geometry><mesh filename="file://$(find arm_description)/meshes/a.stl"/>'
    text = ARM.replace('<link name="c"/>', f'<link name="c">{shown}</geometry></visual></link>')
    drawn = read(XACRO.format(text), name="b.xacro", packages={"arm_description": package})
    assert drawn.missing_meshes == ()
    assert "a.stl" in drawn.xml


# body after line 1 of the file, what the message must hold, line
BAD_XACRO = {
    "undefined": ('<link name="${foo}"/>', "name 'foo' is not defined", 2),
    "syntax": ('\n<link name="${1 +}"/>', "evaluating expression '1 +'", 3),
    "division": ('<link name="${1/0}"/>', "division by zero", 2),
    "argument": ('<link name="$(arg foo)"/>', "give --xacro-arg foo:=VALUE", 2),
    "argument in an expression": (
        "<link name=\"${xacro.arg('foo')}\"/>",
        "give --xacro-arg foo:=VALUE",
        2,
    ),
    "package": ('<link name="$(find foo)"/>', "give its folder with --package foo=DIR", 2),
    "environment": ('<link name="$(env NO_SUCH_VAR)"/>', "'NO_SUCH_VAR' is not set", 2),
    "macro": ("\n<xacro:foo/>", "unknown macro name: xacro:foo", 3),
    "parameter": (
        '<xacro:macro name="m" params="p"/>\n<xacro:m/>',
        "Undefined parameters [p]",
        3,
    ),
    "include": ('<xacro:include filename="nope.xacro"/>', "No such file or directory", 2),
    "yaml": ("<link name=\"${xacro.load_yaml('nope.yaml')}\"/>", "No such file or directory", 2),
    "recursion": (
        '<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>',
        "without end",
        None,
    ),
    "includes itself": ('<xacro:include filename="arm.xacro"/>', "without end", None),
    "condition": ('<xacro:if value="maybe"/>', "not a boolean expression", 2),
    "memory": ("<link name=\"${'a' * 10**11}\"/>", "too much memory", 2),
    "malformed": ("<xacro:if>", "mismatched tag", 3),
    "lambda": (
        '<link name="${(lambda: ().__class__.__base__.__subclasses__())()}"/>',
        "reaches for the internals of Python",
        2,
    ),
    "frames": (
        '<link name="${[g.gi_frame.f_back for g in [(x for x in [1])]]}"/>',
        "reaches for the internals of Python",
        2,
    ),
    "format": (
        r"""<link name="${'\x7b0.__class__\x7d'.format(1)}"/>""",
        "reaches for the internals of Python",
        2,
    ),
    "eval": ('<link name="$(eval pi.f_back)"/>', "internals of Python", 2),
    "entities": ("", "has no links", None),
}


@pytest.mark.parametrize("case", BAD_XACRO)
def test_bad_xacro(case, read, tmp_path, capfd):
    body, expected, line = BAD_XACRO[case]
    with pytest.raises(RobotFileError) as caught:
        read(XACRO.format(body), name="arm.xacro")
    message = str(caught.value)
    assert expected in message
    assert message.startswith(str(tmp_path / "arm.xacro"))
    assert "\n" not in message
    assert caught.value.line == line
    assert capfd.readouterr() == ("", "")


def test_error_in_an_included_file_names_that_file(read, tmp_path):
    part = tmp_path / "part.xacro"
    text = XACRO.format('<xacro:include filename="part.xacro"/>')
    for content, expected, line in (
        (XACRO.format('\n<link name="${foo}"/>'), "name 'foo' is not defined", 3),
        ("<robot>\n<link>\n</robot>", "mismatched tag", 3),
        ('\n<!DOCTYPE r [<!ENTITY a "b">]><robot/>', "document types and entities", 2),
    ):
        part.write_text(content)
        with pytest.raises(RobotFileError, match=expected) as caught:
            read(text, name="arm.xacro")
        assert caught.value.path == part
        assert caught.value.line == line


def test_xacro_arguments_that_do_not_exist(read):
    text = XACRO.format('<xacro:arg name="scale" default="1"/>' + ARM)
    with pytest.raises(RobotFileError, match=r"has no xacro argument scael \(it has: scale\)"):
        read(text, name="arm.xacro", xacro_args={"scael": "2"})
    with pytest.raises(RobotFileError, match="takes no xacro arguments"):
        read(robot(), xacro_args={"scale": "2"})


def test_xacro_that_does_not_end(read, monkeypatch):
    monkeypatch.setattr("pinsing.description.xacro.TIMEOUT_SECONDS", 1)
    with pytest.raises(RobotFileError, match="does not end within 1 s"):
        read(XACRO.format('<link name="${10**10**10}"/>'), name="arm.xacro")


def test_xacro_leaves_this_process_alone(read):
    code = (
        "import sys; from pinsing.description.urdf import read_description as r; r(sys.argv[1]);"
        "print([m for m in ('xacro', 'pinocchio', 'yourdfpy') if m in sys.modules])"
    )
    path = read(XACRO.format(ARM), name="arm.xacro").path
    run = [sys.executable, "-c", code, str(path)]
    done = subprocess.run(run, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    assert done.stderr == ""
