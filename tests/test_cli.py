"""The command line as a user meets it."""

import json
import os
import shlex
import signal
import stat
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from arms import URDF
from command_line import python, run, settled, started
from kernel import needs_kernel
from tiers import sampled, tiered
from urdf_texts import LIMIT, XACRO, joint, robot

import pinsing
from pinsing.atomic_write import check_writable, write_text
from pinsing.cli.app import COMMANDS
from pinsing.cli.options import parse_numbers
from pinsing.errors import ConfigurationError, OutputError
from pinsing.kinematics.at import State
from pinsing.report.arm_report import ArmInfo
from pinsing.robot.load import load
from pinsing.sampling.analyze import Analysis
from pinsing.sampling.sweeps import load_npz


class TestProcess:
    def test_results_and_messages_do_not_mix(self):
        words = ["at", "ur5", "--q", "0,-1,1,0,0,0", "--no-distances", "-o", "-"]
        done = python("-m", "pinsing", *words)
        assert done.returncode == 0
        assert json.loads(done.stdout)["schema"] == "pinsing/state/1"
        assert "note: tip tool0 (" in done.stderr

    @pytest.mark.slow
    def test_names_that_the_terminal_cannot_show(self, tmp_path):
        path = tmp_path / "arm.urdf"
        path.write_text(robot(joint("gelenk_ä")), encoding="utf-8")
        env = {**os.environ, "PYTHONIOENCODING": "ascii"}
        done = python("-m", "pinsing", "list", path, env=env)
        assert done.returncode == 0
        assert "gelenk_\\xe4" in done.stdout


def test_sigint_while_it_runs():
    code = (
        "import importlib, time\n"
        "def slow(*a, **k):\n"
        "    print('ready', flush=True)\n"
        "    time.sleep(60)\n"
        "importlib.import_module('pinsing.robot.load').load = slow\n"
        "from pinsing.cli import main\n"
        "main(['at', 'ur5', '--q', '0,0,0,0,0,0'])"
    )
    child = started("-c", code)
    assert child.stdout.readline() == "ready\n"
    child.send_signal(signal.SIGINT)
    _, said = child.communicate(timeout=30)
    assert child.returncode == 130
    assert said.split() == ["pinsing:", "stopped"]


class TestAt:
    @needs_kernel
    def test_distances_to_all_families_nearest_first(self):
        q = [0.1, -1.0, 0.8, 0.3, 0.9, 0.2]
        words = ["at", "ur5", "--rad", "--q", ",".join(map(str, q))]
        found = json.loads(run(*words, "-o", "-").stdout)["distances"]
        form = pinsing.closed_form(load("ur5"))
        assert sorted(f["family"] for f in found["families"]) == ["F1", "F2", "F3"]
        assert found["complete"] is True
        for f in found["families"]:
            true = next(x for x in form.families if x.name == f["family"]).distance(q)
            assert (f["lower"], f["upper"]) == pytest.approx((true.lower, true.upper), abs=1e-6)
            assert f["upper"] - f["lower"] <= 1e-6
        far = [f["upper"] for f in found["families"]]
        assert far == sorted(far)
        assert "distance" not in run(*words, "--no-distances").stdout
        assert "distances" not in json.loads(run(*words, "--no-distances", "-o", "-").stdout)
        assert "F3: 0°, on it" in run("at", "stanford", "--q", "0,1,0.3,1,0,0").stdout

    def test_nominal_geometry(self):
        q = ["--q", "0.2,0,pi/2,0.9,pi/2,0,0.1", "-o", "-"]
        raw = State.from_json(run("at", "xarm7", *q).stdout)
        exact = State.from_json(run("at", "xarm7", "--nominal", *q).stdout)
        assert (raw.status, exact.status) == ("near-singular", "singular")

    @pytest.mark.slow
    def test_first_lines_are_of_the_same_unit_and_can_be_pasted(self):
        at = run("at", "irb120", "--q", "0,0,0,0,0,0").stdout.splitlines()
        assert at[1] == "  Lost: cannot move in direction base y with the tool's orientation held"
        turned = run("at", "gp7", "--rad", "--q", "9,0,0,0,0.5,0").stdout
        assert "pinsing view gp7 --rad --q 9,0" in turned
        assert "e.g. --deg --q" in run("families", "gp7", "-v").stdout
        assert run("at", "gp7", "--suggest", "--deg", "--q", "0,0,0,0,-90,0").exit_code == 0

    @pytest.mark.slow
    def test_no_posture_is_advised_where_none_is_within_the_limits(self, tmp_path):
        (tmp_path / "a.csv").write_text("10,20,30,5,40,0\n40,0,60,-20,-35,10\n")
        done = run("check", "irb120", str(tmp_path / "a.csv"), "--deg")
        assert "  Move the path: no other posture of its start" in done.stdout


def test_degrees_of_special_values():
    words = ["analyze", "--sweep", "puma560", "--levels", "1", "--samples", "11", "-o", "-"]
    in_degrees, in_radians = (
        json.loads(run(*words, "--special", *values).stdout)
        for values in (("0,90", "--deg"), ("0,pi/2",))
    )
    assert in_degrees == in_radians


def test_ctrl_c_keeps_what_is_done(monkeypatch, tmp_path):
    stop = Mock(side_effect=KeyboardInterrupt)
    monkeypatch.setattr("pinsing.sampling.sweeps.compute_curves", stop)
    out = tmp_path / "part.npz"
    done = run("analyze", "--sweep", "planar3r", "-o", out)
    assert done.exit_code == 130
    assert "stopped after 0 of" in done.stdout
    assert not load_npz(out).complete


class TestAnalyze:
    words = ("analyze", "planar3r", "--levels", "1", "--samples", "21", "--random-starts", "20")

    def test_json_and_exit_code(self):
        done = run(*self.words, "-o", "-", "--fail-if-singular")
        assert done.exit_code == 1
        analysis = Analysis.from_json(done.stdout)
        assert (analysis.complete, analysis.agree, analysis.geometry) == (True, True, "both")
        assert analysis.random_search.starts == 20

    @pytest.mark.parametrize("geometry", ["raw", "nominal"])
    def test_one_geometry_for_everything(self, geometry):
        done = run(*self.words, "-o", "-", f"--{geometry}")
        assert Analysis.from_json(done.stdout).geometry == geometry
        assert run("analyze", "--sweep", *self.words[1:-2], f"--{geometry}").exit_code == 0


class TestInfo:
    def test_chain_limits_rank_and_notes(self):
        done = run("list", "panda")
        assert (done.exit_code, done.stderr) == (0, "")
        for words in ("panda_joint4", "-176.001", "redundant by 1", "panda_finger_joint1"):
            assert words in done.stdout
        rows = [line.split() for line in run("list", "kinova", "--deg").stdout.splitlines()]
        assert ["1", "j2s6s200_joint_1", "continuous", "none", "none", "deg"] in rows
        assert ["2", "j2s6s200_joint_2", "revolute", "47", "313", "deg"] in rows

    def test_the_commands_work_as_they_stand(self, tmp_path):
        """With the options that the file needs, and names that a shell would take apart."""
        folder = tmp_path / "my packages" / "two arms"
        folder.mkdir(parents=True)
        links = ["base", *(f"${{side}} {i}" for i in range(4))]
        at = '<origin xyz="$(arg reach) 0 0"/><axis xyz="0 {} {}"/>'
        one = "".join(
            f'<link name="{link}"/>'
            + joint(f"${{side}} j{i}", links[i], link, inner=at.format(i % 2, 1 - i % 2) + LIMIT)
            for i, link in enumerate(links[1:])
        )
        macro = f'<xacro:macro name="arm" params="side">{one}</xacro:macro>'
        (folder / "arm.xacro").write_text(XACRO.format(macro))
        path = tmp_path / "both.xacro"
        include = '<xacro:include filename="$(find two_arms)/arm.xacro"/>'
        arms = '<xacro:arm side="left"/><xacro:arm side="right"/>'
        argument = '<xacro:arg name="reach" default=""/><link name="base"/>'
        path.write_text(XACRO.format(argument + include + arms))
        needs = ["--package", f"two_arms={folder}", "--xacro-arg", "reach:=0.3"]
        done = run("list", str(path), *needs)
        assert done.exit_code == 2
        commands = [line.partition(": pinsing ")[2] for line in done.stdout.splitlines()]
        commands = [shlex.split(command) for command in commands if command]
        assert [words[-2:] for words in commands] == [["--tip", "left 3"], ["--tip", "right 3"]]
        for words in commands:
            assert words[0] == "analyze"
            arm = json.loads(run("list", "--info", *words[1:], "-o", "-").stdout)["arm"]
            assert arm["joints"] == [f"{words[-1][:-2]} j{i}" for i in range(4)]

    def test_json_goes_back(self):
        text = run("list", "stanford", "-o", "-").stdout
        assert ArmInfo.from_json(text).to_json() + "\n" == text


class TestList:
    def test_one_word_narrows_or_is_the_robot(self):
        assert "gen3_lite" in run("list", "GEN-3").stdout
        assert run("list", "ur 5 e").stdout.split()[1] == "ur5e"

    @pytest.mark.parametrize("word", ["ur5ee", "nothing-like-this", "!!"])
    def test_an_unknown_name_is_refused(self, word):
        none = run("list", word, "-o", "-")
        assert (none.exit_code, none.stdout) == (2, "")
        assert f"unknown robot {word!r}: " in none.stderr
        assert ("did you mean 'ur5'" in none.stderr) == (word == "ur5ee")

    def test_json(self):
        data = json.loads(run("list", "-o", "-").stdout)
        assert data["schema"] == "pinsing/robots/1"
        assert {"name", "title", "source", "alias_of"} == set(data["robots"][0])


@pytest.mark.slow
def test_the_urdf_of_a_table_is_that_of_the_library(tmp_path):
    out, words = tmp_path / "arm.urdf", ["export", "--urdf", URDF / "stanford.dh.yaml", "-o"]
    done = run(*words, out)
    assert (done.exit_code, done.stdout) == (0, "")
    assert run(*words, "-").stdout == out.read_text() == (URDF / "stanford.urdf").read_text()


def test_no_command_shows_help_and_version_works():
    assert "Commands:" in run().output
    assert run().exit_code == 2
    assert run("--help").exit_code == 0
    done = run("--version")
    assert done.exit_code == 0
    assert done.stdout.startswith("pinsing ")


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("at puma560 --q 0.1,0.2,0.3,0.4,0,0.5", 1), ("families puma560", 1),
        ("at puma560 --q 0.1,0.2,0.3,0.4,0.5,0.5", 0), ("map ur5 --sampling grid --steps 4", 1),
        ("analyze --sweep planar3r --levels 1 --samples 21", 1),
    ],
)  # fmt: skip
def test_fail_if_singular(words, code):
    assert run(*words.split(), "--fail-if-singular").exit_code == code
    assert run(*words.split()).exit_code == 0


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name):
    done = run(name, "--help")
    assert done.exit_code == 0
    assert "Usage: pinsing " + name in done.stdout


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("1,2", [1, 2]), ("[ -0.3, .2e1 ]", [-0.3, 2]),
        ("pi, -pi/2 3pi/4 2*pi", [np.pi, -np.pi / 2, 3 * np.pi / 4, 2 * np.pi]),
    ],
)  # fmt: skip
def test_numbers_that_are_understood(text, values):
    assert parse_numbers(text, "--q") == pytest.approx(values)


@pytest.mark.parametrize("text", ["", "a", "1;2", "pi/0", "__import__('os')", "1,,x", "2*p"])
def test_numbers_that_are_not(text):
    with pytest.raises(ConfigurationError):
        parse_numbers(text, "--q")


def test_names_from_files_cannot_paint_the_terminal():
    done = run("list", "--info", "\x1b[31mred")
    assert "\x1b" not in done.output
    assert done.exit_code == 2


class TestFiles:
    def test_mode_and_links_are_kept(self, tmp_path):
        real, link = tmp_path / "real.txt", tmp_path / "link.txt"
        real.write_text("old")
        real.chmod(0o640)
        link.symlink_to(real)
        write_text(link, "new")
        assert link.is_symlink()
        assert real.read_text() == "new"
        assert stat.S_IMODE(real.stat().st_mode) == 0o640
        fresh = tmp_path / "fresh.txt"
        write_text(fresh, "x")
        mask = os.umask(0)
        os.umask(mask)
        assert stat.S_IMODE(fresh.stat().st_mode) == 0o666 & ~mask

    def test_a_device_is_written_to_and_not_replaced(self):
        write_text(os.devnull, "x")
        assert not Path(os.devnull).is_file()

    def test_places_that_cannot_be_written(self, tmp_path):
        for bad in (tmp_path / "no" / "x.json", tmp_path, "", "a\0b"):
            with pytest.raises(OutputError):
                check_writable(bad)
        source = tmp_path / "in.yaml"
        source.write_text("x")
        with pytest.raises(OutputError, match="input"):
            check_writable(source, inputs=(source,))


@pytest.mark.parametrize(
    ("words", "file"),
    [
        pytest.param("plot locus gp25", "a.png", marks=pytest.mark.slow),
        pytest.param("plot map gp25 --over q2,q3", "a.png", marks=pytest.mark.slow),
        pytest.param("view gp25 --skeleton", "a.html", marks=pytest.mark.slow),
        ("families gp25 --no-prove", "a.sing"),
        pytest.param("export gp25", "a.py", marks=pytest.mark.slow),
    ],
)
def test_every_family_option_takes_names_and_titles(words, file, tmp_path):
    written = []
    for name in ("elbow", "F1", "foot") if words == "export gp25" else ("elbow", "foot"):
        out = tmp_path / name / file
        out.parent.mkdir()
        done = run(*words.split(), "--family", name, "-o", out)
        assert done.exit_code == (2 if name == "foot" else 0), done.stderr
        written += [out.exists()]
    assert all(written[:-1])
    assert not written[-1]
    assert "unknown family 'foot'" in done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    sampled(
        [
            ("families ur5 -v", "wrist_2_joint = 0 or pi  "),
            ("at irb120 --q 0,0.2,0.3,0,0.05,0", "0.05 rad away: q5 by -0.05 rad"),
            ("zones irb120 --within q3=0.5..1.2 --boxes 2000", "between 0.5 rad and 1"),
            ("line irb120 --q 0,0.2,0.3,0,0.05,0 --to 0.45,0,0.4", "(q5 = 0)"),
            pytest.param("analyze puma560", "q3 = -1.524 rad or 1.618 rad", marks=pytest.mark.slow),
            ("postures irb120 --q 0,0.2,0.3,0,0.5,0", "--q -pi,-1.99105,0.3,-pi"),
        ]
    ),
)
def test_an_answer_in_radians_has_no_degree(words, said):
    """Conditions of families, which are kept in degrees, too; columns stay in line."""
    done = run(*words.split(), "--rad")
    assert done.exit_code == 0
    assert "\N{DEGREE SIGN}" not in done.output
    assert said in " ".join(done.stdout.split("\n"))


def test_of_options_given_twice_the_last_counts():
    done = run("map", "stanford", "--count", "20", "--count", "10", "-o", "-.json")
    assert done.exit_code == 0
    assert json.loads(done.stdout)["plan"]["count"] == 10


# What commands say, one transcript a command: ``PINSING_WORDS=1 pytest`` writes them anew.
FOLDER = Path(__file__).parent / "words"
NAMES = sorted(path.stem for path in FOLDER.glob("*.txt"))
_LINES = 14
"""Of each answer: its first screen."""


def said(line: str) -> str:
    done = run(*shlex.split(line)[2:])
    assert "Traceback" not in done.output
    if done.exit_code == 2:
        assert done.stderr.count("pinsing: error: ") == 1
    answer = done.stdout.splitlines()
    lines = answer[:_LINES] + ["..."] * (len(answer) > _LINES) + done.stderr.splitlines()
    text = "\n".join([line, *lines, *[f"exit {done.exit_code}"] * bool(done.exit_code)])
    return settled(text).rstrip()


@pytest.mark.parametrize("name", tiered(NAMES, {*NAMES} - {"check", "families", "line"}))
def test_words(name, monkeypatch):
    path = FOLDER / f"{name}.txt"
    monkeypatch.chdir(FOLDER)
    monkeypatch.setenv("COLUMNS", "100")
    before = path.read_text()
    lines = [line for line in before.splitlines() if line.startswith("$ pinsing")]
    assert lines
    there = sorted(FOLDER.rglob("*"))
    now = "\n\n".join(map(said, lines)) + "\n"
    assert sorted(FOLDER.rglob("*")) == there  # nothing is written
    if os.environ.get("PINSING_WORDS"):
        path.write_text(now)
    else:
        assert now == before
