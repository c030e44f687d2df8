"""Bad input at the command line: one clear line, exit code 2, nothing half-written."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from pinsing.cli.app import command

URDF = Path(__file__).parent.parent / "urdf"
FIVE_BAR = str(URDF / "five_bar.urdf")
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
AXIS = '<axis xyz="0 0 1"/>'
GOOD = AXIS + LIMIT
DH = """\
name: mine
convention: standard
units: {angle: deg, length: m}
rows:
  - {a: 0.4, alpha: 0, d: 0, theta: 0, type: revolute, limits: [-90, 90]}
"""


def run(*words: str) -> Result:
    return CliRunner().invoke(command, list(words), prog_name="pinsing")


def refused(*words: str) -> str:
    """Run what must be refused; return the one line."""
    done = run(*words)
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    errors = [line for line in done.stderr.splitlines() if "error: " in line]
    assert len(errors) == 1, done.stderr
    assert errors[0].startswith("pinsing: error: ")
    assert "Traceback" not in done.stderr
    return errors[0]


@pytest.fixture
def file(tmp_path):
    def write(text: str, name: str = "robot.urdf") -> str:
        path = tmp_path / name
        path.write_text(text)
        return str(path)

    return write


class TestRobotFiles:
    def test_missing_file(self, tmp_path):
        assert "no such file" in refused("list", str(tmp_path / "none.urdf"))

    def test_a_directory(self, tmp_path):
        assert "is a folder" in refused("list", str(tmp_path))

    def test_an_empty_file(self, file):
        assert "empty" in refused("list", file(""))

    def test_malformed_xml_with_its_line(self, file):
        assert "robot.urdf:2" in refused("list", file("<robot name='r'>\n<link name='a'"))

    def test_not_a_urdf(self, file):
        line = refused("list", file("<html><body/></html>"))
        assert "robot.urdf:1" in line
        assert "not a URDF" in line

    def test_no_joints(self, file):
        assert "joint" in refused("list", file('<robot name="r"><link name="a"/></robot>'))

    @pytest.mark.parametrize(
        ("inside", "said"),
        [
            ('<axis xyz="0 0 0"/>' + LIMIT, "axis"),
            ('<axis xyz="nan 0 1"/>' + LIMIT, "axis"),
            ('<origin xyz="nan 0 0"/>' + GOOD, "origin"),
            ('<origin xyz="inf 0 0"/>' + GOOD, "origin"),
            (AXIS, "limit"),
            (AXIS + '<limit effort="1" velocity="1"/>', "limit"),
            (AXIS + '<limit lower="2" upper="1" effort="1" velocity="1"/>', "lower"),
        ],
    )
    def test_bad_joints_are_named(self, write_urdf, inside, said):
        path = write_urdf([("revolute", GOOD), ("revolute", inside)])
        line = refused("list", str(path))
        assert "j2" in line
        assert said in line

    def test_a_loop_in_the_tree(self, write_urdf):
        more = '<joint name="back" type="fixed"><parent link="l2"/><child link="l0"/></joint>'
        path = write_urdf([("revolute", GOOD)] * 2, more=more)
        refused("list", str(path))

    def test_duplicate_names(self, write_urdf):
        path = write_urdf([("revolute", GOOD)] * 2, names=["same", "same"])
        assert "same" in refused("list", str(path))

    def test_xacro_errors(self, file):
        text = (
            '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><link name="${no}"/></robot>'
        )
        assert "no" in refused("list", file(text, "robot.xacro"))

    def test_missing_package(self, file):
        text = (
            '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro">'
            '<xacro:include filename="$(find nowhere_pkg)/a.xacro"/></robot>'
        )
        assert "nowhere_pkg" in refused("list", file(text, "robot.xacro"))

    def test_a_missing_mesh_never_stops(self, write_urdf):
        mesh = '<visual><geometry><mesh filename="package://none/a.stl"/></geometry></visual>'
        path = write_urdf([("revolute", GOOD)])
        path.write_text(
            path.read_text().replace('<link name="l1"/>', f'<link name="l1">{mesh}</link>')
        )
        done = run("at", str(path), "--q", "0.1")
        assert (done.exit_code, "mesh file" in done.output) == (0, False)
        done = run("list", str(path))
        assert (done.exit_code, "1 of 1 mesh files" in done.output) == (0, True)


class TestNames:
    def test_unknown_robot_with_close_matches(self):
        assert "did you mean 'panda'" in refused("list", "--info", "pandaa")

    def test_unknown_tip_with_close_matches(self):
        assert "tool0" in refused("list", "ur5", "--tip", "tool00")

    def test_unknown_base(self):
        assert "base_linkk" in refused("list", "ur5", "--base", "base_linkk")

    def test_unknown_joint_with_close_matches(self):
        assert "elbow_joint" in refused("list", "ur5", "--joints", "elbow_jiont")

    def test_no_joint_named(self):
        assert "--joints" in refused("list", "ur5", "--joints", " , ")

    def test_unknown_command_and_option(self):
        assert "did you mean 'analyze'" in refused("analyse")
        assert "--qq" in refused("at", "ur5", "--qq", "1")

    def test_missing_arguments(self):
        assert "ROBOT" in refused("list", "--info")
        assert "--q" in refused("at", "ur5")
        assert "-o" in refused("export", "--urdf", "table.yaml")


class TestValues:
    def test_q_of_the_wrong_length(self):
        line = refused("at", "ur5", "--q", "0,0,0")
        assert "needs 6 values" in line
        assert "got 3" in line

    @pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
    def test_q_that_is_not_finite(self, value):
        assert "elbow_joint" in refused("at", "ur5", "--q", f"0,0,{value},0,0,0")

    @pytest.mark.parametrize("value", ["zero", "pi/0", "1/2", "--"])
    def test_q_that_is_no_number(self, value):
        assert value in refused("at", "ur5", "--q", f"0,0,{value},0,0,0")

    def test_pi_in_degrees(self):
        assert "--deg" in refused("at", "ur5", "--deg", "--q", "0,0,pi,0,0,0")

    def test_task(self):
        assert "vx" in refused("list", "ur5", "--task", "positoin")

    @pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "long"])
    def test_length_scale(self, value):
        assert "length" in refused("list", "ur5", "--length-scale", value)

    @pytest.mark.parametrize("option", ["--rtol", "--near-rtol"])
    @pytest.mark.parametrize("value", ["-1", "nan", "2"])
    def test_tolerances(self, option, value):
        assert "rtol" in refused("at", "planar3r", "--q", "0,0,0", option, value)

    def test_pairs(self):
        assert "NAME=DIR" in refused("list", "ur5", "--package", "name")
        assert "K:=V" in refused("list", "ur5", "--xacro-arg", "k=v")

    def test_levels(self):
        for bad in ("a", "1-", "", "1,,2"):
            assert "--levels" in refused("analyze", "--sweep", "planar3r", "--levels", bad)

    @pytest.mark.parametrize("name", ["analyze"])
    def test_special_and_nominal_values_are_numbers(self, name):
        assert "--special" in refused(name, "planar3r", "--special", "0,x")
        assert "--nominal-q" in refused(name, "planar3r", "--nominal-q", "0,x")
        assert "needs 3 values" in refused(name, "planar3r", "--nominal-q", "0,0")

    def test_values_outside_the_limits_name_the_way_out(self):
        outside = ["0,0,9,0,0,0", "--nominal-q"]
        line = refused("analyze", "--sweep", "stanford", *reversed(outside))
        assert "d3" in line
        assert "ignore" in line

    def test_sweep_levels_and_joints(self):
        assert "level" in refused("analyze", "--sweep", "planar3r", "--levels", "9")
        assert "q2" in refused("analyze", "--sweep", "planar3r", "--sweep-joints", "q22")
        assert "samples" in refused("analyze", "--sweep", "planar3r", "--samples", "1")

    @pytest.mark.parametrize("name", ["families", "analyze"])
    @pytest.mark.parametrize(
        ("option", "value", "said"),
        [("seconds", "0", "seconds"), ("snap-length", "-1", "snap"), ("angle-tol", "2", "angle")],
    )
    def test_algebra(self, name, option, value, said):
        assert said in refused(name, "planar3r", f"--{option}", value)

    def test_one_geometry_at_a_time(self):
        assert "--raw" in refused("analyze", "planar3r", "--raw", "--nominal")


class TestTables:
    def test_missing_table(self, tmp_path):
        assert "no such file" in refused("export", "--urdf", str(tmp_path / "none.yaml"), "-o", "-")

    @pytest.mark.parametrize(
        ("old", "new", "said"),
        [
            ("alpha: 0, ", "", "alpha"),
            ("a: 0.4", "a: 0.4, b: 1", "'b'"),
            ("convention: standard\n", "", "convention"),
            ("standard", "sloppy", "sloppy"),
            ("a: 0.4", "a: .nan", "a"),
        ],
    )
    def test_bad_tables(self, file, tmp_path, old, new, said):
        table = file(DH.replace(old, new), "t.dh.yaml")
        out = tmp_path / "out.urdf"
        line = refused("export", "--urdf", table, "-o", str(out))
        assert "t.dh.yaml" in line
        assert said in line
        assert not out.exists()

    def test_the_table_itself_is_not_replaced(self, file):
        table = file(DH, "t.urdf")
        assert "input" in refused("export", "--urdf", table, "-o", table)
        assert Path(table).read_text() == DH

    def test_a_good_table(self, file, tmp_path):
        assert (
            run("export", "--urdf", file(DH, "t.dh.yaml"), "-o", str(tmp_path / "o.urdf")).exit_code
            == 0
        )


class TestOutput:
    @pytest.mark.parametrize(
        "name", ["at", "list --info", "analyze --sweep", "analyze", "families"]
    )
    def test_checked_before_the_robot_is_read(self, tmp_path, monkeypatch, name):
        def never(*_, **__):
            raise AssertionError("the robot was read")

        monkeypatch.setattr(sys.modules["pinsing.robot.load"], "load", never)
        q = ["--q", "0,0,0"] if name == "at" else []
        for bad in (tmp_path / "none" / "x.json",):
            assert "cannot write" in refused(*name.split(), "planar3r", *q, "-o", str(bad))
        if "sweep" in name:
            bad = tmp_path / "none" / "x.npz"
            assert "cannot write" in refused(*name.split(), "planar3r", "-o", str(bad))
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("name", ["figure.xyz", "figure", "-"])
    @pytest.mark.parametrize(
        "robot",
        [["ur5"], [str(URDF / "five_bar.urdf"), "--loops", str(URDF / "five_bar.loops.yaml")]],
        ids=["arm", "mechanism"],
    )
    def test_figures_are_png_svg_or_pdf(self, robot, name, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        said = refused("plot", "ellipsoids", *robot, "-o", name)
        assert (".png, .svg, .pdf" in said) or (name == "-" and "the name of a file" in said)
        assert list(tmp_path.iterdir()) == []

    def test_the_robot_itself_is_not_replaced(self, write_urdf):
        path = write_urdf([("revolute", GOOD)])
        path = path.rename(path.with_suffix(".json"))
        before = path.read_text()
        assert "robot itself" in refused("at", str(path), "--q", "0", "-o", str(path))
        assert path.read_text() == before
