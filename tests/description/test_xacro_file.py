"""xacro files: arguments, includes, packages, and every way to go wrong."""

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from command_line import python
from golden import Golden
from tiers import tiered
from urdf_texts import LIMIT, XACRO, drawn, joint, make_package, robot

from pinsing import load
from pinsing.description.catalog import data_folder
from pinsing.description.files import expand_xacro
from pinsing.errors import RobotFileError


@pytest.fixture(autouse=True)
def _no_environment(monkeypatch):
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "PINSING_XACRO_ENV", "NOT_SET"):
        monkeypatch.delenv(name, raising=False)


ARM = "".join(f'<link name="{link}"/>' for link in "abc") + joint("j1", "a", "b") + joint()


def test_arguments_that_a_file_does_not_take(refused):
    text = XACRO.format('<xacro:arg name="scale" default="1"/>' + ARM)
    said = str(refused(text, xacro_args={"scael": "2"}))  # elements tell, whatever the suffix
    assert "has no xacro argument scael (it has: scale)" in said
    assert "takes no xacro arguments" in str(refused(robot(), xacro_args={"scale": "2"}))


@pytest.mark.slow
def test_what_xacro_turned_into_a_path_is_still_within_a_known_package(read, tmp_path):
    packages = {"arm_description": make_package(tmp_path)}
    text = drawn("file://$(find arm_description)/meshes/a.stl").replace(
        "<robot", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"'
    )
    found = read(text, "b.xacro", packages=packages)
    assert found.missing_meshes == ()
    assert "a.stl" in found.xml


@pytest.mark.slow
def test_xacro_that_does_not_end(refused, monkeypatch):
    monkeypatch.setattr("pinsing.description.files.TIMEOUT_SECONDS", 1)
    twice = '<xacro:m n="${n - 1}"/>' * 2
    macro = f'<xacro:macro name="m" params="n"><xacro:if value="${{n}}">{twice}</xacro:if>'
    text = XACRO.format(macro + '</xacro:macro><xacro:m n="${60}"/>')
    assert "does not end within 1 s" in str(refused(text, "arm.xacro"))


READS = (
    '<link name="$(env {0})"/>',
    '<link name="$(optenv {0} none)"/>',
    '<xacro:arg name="a" default="$(env {0})"/><link name="$(arg a)"/>',
)


@pytest.mark.parametrize("text", tiered(READS, READS[:1]))
def test_a_file_reads_no_variable_that_is_not_for_it(refused, tmp_path, monkeypatch, text):
    (tmp_path / "a.xacro").write_text(XACRO.format('<link name="$(optenv NOT_SET a b)"/>'))
    assert 'name="a b"' in expand_xacro(tmp_path / "a.xacro").xml
    monkeypatch.setenv("AWS_SECRET", "p4ssw0rd")
    monkeypatch.setenv("ROS_MODEL", "seven")
    error = refused(XACRO.format(text.format("AWS_SECRET")), "arm.xacro")
    assert "'AWS_SECRET' is not shown to files: set PINSING_XACRO_ENV=AWS" in str(error)
    assert "p4ssw0rd" not in str(error)
    assert error.line == 2
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


def test_a_link_that_came_with_the_file_leads_nowhere(refused, tmp_path):
    (tmp_path / "robot").mkdir()
    (tmp_path / "secret.yaml").write_text("a: 1")
    (tmp_path / "robot" / "inner.yaml").symlink_to(tmp_path / "secret.yaml")
    text = XACRO.format("<link name=\"${xacro.load_yaml('inner.yaml')}\"/>")
    assert "lies outside the robot's folder" in str(refused(text, "robot/arm.xacro"))
    # in a folder that the user names, links are the user's own
    named = {"anything": tmp_path / "robot"}
    assert "has no joints" in str(refused(text, "robot/arm.xacro", packages=named))


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


# xacro files as they come: parts in packages, found in every way that ROS users know -----

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


def test_package_by_the_environment_and_by_a_search_upward(
    package, elsewhere, tmp_path, monkeypatch
):
    for value in (package.parent, package, f"/no/such/folder:{package.parent}:"):
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(value))
        assert load(elsewhere).n == 2
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    for folder in (package / "urdf" / "deep", package.parent / "other_package"):  # upward
        folder.mkdir()
        (folder / "robot.xacro").write_text(WHOLE)
        assert load(folder / "robot.xacro").n == 2
    share = tmp_path / "install" / "share"
    share.mkdir(parents=True)
    package.rename(share / "arm_description")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/no/such/folder:{tmp_path / 'install'}")
    assert load(elsewhere).n == 2


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


def test_a_folder_above_needs_a_package_xml_that_names_it(refused, tmp_path):
    """Else a file could read whatever lies beside any folder above it."""
    for name in ("secret", "secret/robots", "other"):
        (tmp_path / name).mkdir()
    for folder in ("secret", "other"):
        (tmp_path / folder / "key.xml").write_text('<robot><link name="key"/></robot>')
    place = "secret/robots/a/b/arm.xacro"
    (tmp_path / place).parent.mkdir(parents=True)
    for name in ("secret", "other"):
        text = XACRO.format(f'<xacro:include filename="$(find {name})/key.xml"/>')
        assert f"package '{name}' not found" in str(refused(text, place))
        manifest = tmp_path / name / "package.xml"
        manifest.write_text("<package><name>different</name></package>")
        assert f"package '{name}' not found" in str(refused(text, place))
        manifest.write_text(f"<package><name>{name}</name></package>")
        assert "the robot has no joints" in str(refused(text, place))
        manifest.unlink()


def test_wildcards_are_bounded_and_follow_no_link_out_of_the_folder(refused, tmp_path):
    """Ten links to the folder itself: ten times as many names at every step."""
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / "link").symlink_to(tmp_path / "a")
    for k in range(10):
        (tmp_path / f"l{k}").symlink_to(".")
    text = XACRO.format(f'<xacro:include filename="{"*/" * 30}nothere.xml"/>')
    assert "has no links" in str(refused(text, "arm.xacro"))
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "x.xml").write_text('<robot><link name="a"/></robot>')
    text = XACRO.format('<xacro:include filename="*/x.xml"/>')
    assert "has no joints" in str(refused(text, "arm.xacro"))
    # beside a link that leads out of the folder
    assert "has no links" in str(refused(text, "robot/arm.xacro"))


@pytest.mark.slow
def test_wildcards_look_at_so_many_files_and_no_more(refused, tmp_path):
    for name in range(150):
        (tmp_path / f"d{name}").mkdir()
        for inner in range(140):
            (tmp_path / f"d{name}" / f"{inner}").touch()
    text = XACRO.format('<xacro:include filename="*/*.xml"/>')
    assert "looks at more than 20000 files" in str(refused(text, "arm.xacro"))


# Every xacro that the tests can install gives the same URDF as xacro by itself -----------

# xacro as it comes, on files that we know; packages are the folders by their names.
PLAIN = """
import contextlib, io, json, sys, types
files, packages = json.load(sys.stdin)
module = types.ModuleType("ament_index_python.packages")
module.get_package_share_directory = packages.__getitem__
sys.modules["ament_index_python"] = types.ModuleType("ament_index_python")
sys.modules[module.__name__] = module
import xacro
found = {}
for file in files:
    xacro.filestack = xacro.macrostack = None
    try:
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
            document = xacro.process_file(file)
            found[file] = document.toprettyxml(indent="  ")
    except Exception as error:
        found[file] = None
print(json.dumps(found))
"""


def compare(root):
    """Count files that both turn into the same URDF, and tell why the others are refused."""
    files = sorted(root.rglob("*.xacro"))
    packages = {f.name: str(f) for f in sorted(root.rglob("*")) if f.is_dir()}
    packages[root.name] = str(root)
    given = json.dumps([[str(f) for f in files], packages])
    plain = json.loads(python("-c", PLAIN, input=given, check=True).stdout)
    refused: dict[str, str] = {}
    for file in files:
        if plain[str(file)] is None:
            with pytest.raises(RobotFileError) as caught:
                expand_xacro(file, packages)
            refused[str(file.relative_to(root))] = str(caught.value)
        else:
            assert expand_xacro(file, packages).xml == plain[str(file)], file
    return len(files) - len(refused), refused


@pytest.mark.slow
def test_example_robot_data():
    folder = data_folder()
    same, refused = compare(folder)
    assert same == len(refused) == 1  # the other includes package://..., xacro fails


LACKING = Golden(Path(__file__).with_name("said") / "toolbox.txt")
"""Of rtb-data, what no xacro can expand: the package that each needs does not come with it."""


@pytest.mark.slow
def test_robotics_toolbox():
    root = Path(pytest.importorskip("rtbdata").__file__).parent / "xacro"
    same, reasons = compare(root)
    assert (same, sorted(reasons)) == (45, sorted(LACKING.cases))
    for name, reason in reasons.items():
        LACKING.hold(name, reason.removeprefix(f"{root}/"))


def test_every_feature(monkeypatch):
    monkeypatch.setenv("ROS_HOME", "somewhere")
    folder = Path(__file__).with_name("features")
    assert compare(folder) == (2, {})
    expanded = expand_xacro(folder / "all.xacro").xml
    assert "<elem " in expanded
    assert 'name="elem"' not in expanded
