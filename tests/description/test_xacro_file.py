"""xacro files: arguments, includes, packages, and every way to go wrong."""

from xml.etree import ElementTree

import pytest
from command_line import python
from tiers import tiered
from urdf_texts import LIMIT, XACRO, joint, make_package, robot

from pinsing.description.files import expand_xacro
from pinsing.description.urdf import read_description
from pinsing.errors import RobotFileError
from pinsing.robot.models import build_model

ARM = "".join(f'<link name="{link}"/>' for link in "abc") + joint("j1", "a", "b") + joint()


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


def test_other_errors_point_to_where_they_are(read):
    with pytest.raises(RobotFileError, match=r"joint 'j1'.*of what `xacro arm.xacro` prints"):
        read(XACRO.format(ARM.replace("0 0 1", "0 0 ${1-1}", 1)), name="arm.xacro")
    text = '<xacro:property name="p" value="${nope}"/>\n\n<link name="${p}"/>'
    with pytest.raises(RobotFileError, match="name 'nope' is not defined") as caught:
        read(XACRO.format(text), name="arm.xacro")
    assert caught.value.line == 2
    text = XACRO.format('<xacro:arg name="scale" default="1"/>' + ARM)
    with pytest.raises(RobotFileError, match=r"has no xacro argument scael \(it has: scale\)"):
        read(text, name="arm.xacro", xacro_args={"scael": "2"})
    with pytest.raises(RobotFileError, match="takes no xacro arguments"):
        read(robot(), xacro_args={"scale": "2"})


@pytest.mark.slow
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
        "<link name=\"${xacro.arg('foo')}\"/>", "give --xacro-arg foo:=VALUE", 2,
    ),
    "package": ('<link name="$(find foo)"/>', "give its folder with --package foo=DIR", 2),
    "environment": ('<link name="$(env NO_SUCH_VAR)"/>', "'NO_SUCH_VAR' is not set", 2),
    "macro": ("\n<xacro:foo/>", "unknown macro name: xacro:foo", 3),
    "parameter": ('<xacro:macro name="m" params="p"/>\n<xacro:m/>', "Undefined parameters [p]", 3),
    "include": ('<xacro:include filename="nope.xacro"/>', "No such file or directory", 2),
    "yaml": ("<link name=\"${xacro.load_yaml('nope.yaml')}\"/>", "No such file or directory", 2),
    "recursion": ('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>', "without end", 2),
    "includes itself": ('<xacro:include filename="arm.xacro"/>', "without end", 2),
    "condition": ('<xacro:if value="maybe"/>', "not a boolean expression", 2),
    "memory": ("<link name=\"${'a' * 10**11}\"/>", "too much memory", 2),
    "malformed": ("<xacro:if>", "mismatched tag", 3),
    "half a character": (r"""<link name="${'\ud800'}"/>""", "half of a character", 2),
    "lambda": (
        '<link name="${(lambda: ().__class__.__base__.__subclasses__())()}"/>',
        "calling a Lambda is not accepted when evaluating expression '(lambda: ().__class__", 2,
    ),
    "frames": (
        '<link name="${[g.gi_frame.f_back for g in [(x for x in [1])]]}"/>',
        "attribute 'gi_frame' of a list is not accepted", 2,
    ),
    "format": (r"""<link name="${'\x7b0'.format(1)}"/>""", "method 'format' of a str is not", 2),
    "eval": ('<link name="$(eval pi.f_back)"/>', "evaluating expression 'pi.f_back'", 2),
    "a line that occurs twice": (
        '<link name="${1}"/>\n<link name="${x}"/>\n<xacro:if value="${y}"/>',
        "name 'x' is not defined when evaluating expression 'x'", 3,
    ),
    "the second of two": (
        '<xacro:macro name="m" params="p"><xacro:if value="${p}"><link name="${p.q}"/></xacro:if>'
        '</xacro:macro>\n<xacro:m p="${False}"/>\n<b c="${[1][0]}"/>\n'
        '<xacro:if value="${[1][1]}"/>',
        "list index out of range", 5,
    ),
    "outside": (
        '<xacro:include filename="/etc/passwd"/>', "/etc/passwd lies outside the robot's folder", 2,
    ),
    "yaml outside": (
        "<link name=\"${xacro.load_yaml('../../secret.yaml')}\"/>",
        "give the folder it is in with --package NAME=DIR", 2,
    ),
    "a device": ('<xacro:include filename="/dev/zero"/>', "lies outside", 2),
    "wildcards outside": ('<xacro:include filename="/etc/*.conf"/>', "lies outside", 2),
    "wildcards upward": ('<xacro:include filename="*/../../*"/>', "leads upward", 2),
}  # fmt: skip


@pytest.mark.parametrize(
    "case", tiered(BAD_XACRO, {"undefined", "recursion", "outside", "lambda", "the second of two"})
)
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


@pytest.mark.slow
def test_xacro_that_does_not_end(read, monkeypatch):
    monkeypatch.setattr("pinsing.description.files.TIMEOUT_SECONDS", 1)
    twice = '<xacro:m n="${n - 1}"/>' * 2
    macro = f'<xacro:macro name="m" params="n"><xacro:if value="${{n}}">{twice}</xacro:if>'
    with pytest.raises(RobotFileError, match="does not end within 1 s"):
        read(XACRO.format(macro + '</xacro:macro><xacro:m n="${60}"/>'), name="arm.xacro")


READS = (
    '<link name="$(env {0})"/>',
    '<link name="$(optenv {0} none)"/>',
    '<xacro:arg name="a" default="$(env {0})"/><link name="$(arg a)"/>',
)


@pytest.mark.parametrize("text", tiered(READS, READS[:1]))
def test_a_file_reads_no_environment_variable_that_is_not_for_it(read, tmp_path, monkeypatch, text):
    monkeypatch.delenv("NOT_SET", raising=False)
    (tmp_path / "a.xacro").write_text(XACRO.format('<link name="$(optenv NOT_SET a b)"/>'))
    assert 'name="a b"' in expand_xacro(tmp_path / "a.xacro").xml
    monkeypatch.setenv("AWS_SECRET", "p4ssw0rd")
    monkeypatch.setenv("ROS_MODEL", "seven")
    monkeypatch.delenv("PINSING_XACRO_ENV", raising=False)
    with pytest.raises(RobotFileError) as caught:
        read(XACRO.format(text.format("AWS_SECRET")), name="arm.xacro")
    assert "'AWS_SECRET' is not shown to files: set PINSING_XACRO_ENV=AWS" in str(caught.value)
    assert "p4ssw0rd" not in str(caught.value)
    assert caught.value.line == 2
    file = tmp_path / "b.xacro"
    file.write_text(XACRO.format(text.format("ROS_MODEL")))
    assert 'name="seven"' in expand_xacro(file).xml
    file.write_text(XACRO.format(text.format("AWS_SECRET")))
    for named in ("AWS_SECRET", "OTHER, AWS_*"):
        monkeypatch.setenv("PINSING_XACRO_ENV", named)
        assert 'name="p4ssw0rd"' in expand_xacro(file).xml


@pytest.mark.slow
def test_thousands_of_macros_in_a_row(tmp_path):
    macro = '<xacro:macro name="m" params="n"><link name="l${n}"/></xacro:macro>'
    file = tmp_path / "arm.xacro"
    file.write_text(XACRO.format(macro + "".join(f'<xacro:m n="{i}"/>' for i in range(3000))))
    names = [e.get("name") for e in ElementTree.fromstring(expand_xacro(file).xml)]
    assert names == [f"l{i}" for i in range(3000)]


def test_a_link_that_came_with_the_file_leads_nowhere(read, tmp_path):
    (tmp_path / "robot").mkdir()
    (tmp_path / "secret.yaml").write_text("a: 1")
    (tmp_path / "robot" / "inner.yaml").symlink_to(tmp_path / "secret.yaml")
    text = XACRO.format("<link name=\"${xacro.load_yaml('inner.yaml')}\"/>")
    with pytest.raises(RobotFileError, match="lies outside the robot's folder"):
        read(text, name="robot/arm.xacro")
    # in a folder that the user names, links are the user's own
    named = {"anything": tmp_path / "robot"}
    with pytest.raises(RobotFileError, match="has no joints"):
        read(text, name="robot/arm.xacro", packages=named)


@pytest.mark.parametrize(
    ("content", "expected", "line"),
    [
        ("a: !!python/object/apply:os.system ['true']", "python/object/apply:os.system", 1),
        ("a: 1\nb: [", "not valid YAML", 2),
        ("a: 1\nb: &x [*x]", "holds itself", 2),
        ("a: 1\nb: " + "9" * 5000, "a number of 5,000 characters is too long", 2),
        ("a: 1\nb: !degrees 1 +", "'1 \\+'", 2),
        ("\n".join(["a0: &a0 [1]"] + [f"a{i}: &a{i} [{f'*a{i - 1},' * 9}]" for i in range(1, 9)]),
         "more than 200000 values", None),
        (b"\xff\xfe\x00", "is not UTF-8 text", None),
        ("[" * 5000, "nested too deeply", None), ("{a: " * 3000, "nested too deeply", None),
    ],
)  # fmt: skip
def test_bad_yaml(content, expected, line, read, tmp_path):
    table = tmp_path / "t.yaml"
    table.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(RobotFileError, match=expected) as caught:
        read(XACRO.format("<link name=\"${xacro.load_yaml('t.yaml')}\"/>"), name="arm.xacro")
    if line is not None:
        assert (caught.value.path, caught.value.line) == (table, line)


def test_the_wall_is_there_and_its_absence_is_said(read, monkeypatch):
    assert not any("wall" in note for note in read(XACRO.format(ARM), name="arm.xacro").notes)
    monkeypatch.setattr("pinsing.description.files._WALL", False)
    assert any("white list alone" in note for note in read(XACRO.format(ARM), name="a.xacro").notes)


def test_xacro_leaves_this_process_alone(read):
    code = (
        "import sys; from pinsing.description.urdf import read_description as r; r(sys.argv[1]);"
        "print([m for m in ('xacro', 'pinocchio', 'yourdfpy') if m in sys.modules])"
    )
    path = read(XACRO.format(ARM), name="arm.xacro").path
    done = python("-c", code, path, check=True)
    assert (done.stdout.strip(), done.stderr) == ("[]", "")
