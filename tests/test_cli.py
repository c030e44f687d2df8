"""The command line as a user meets it."""

import json
import os
import shlex
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from arms import URDF
from command_line import python, run, settled
from kernel import needs_kernel
from tiers import tiered
from urdf_texts import LIMIT, XACRO, joint, robot

import pinsing
from pinsing.cli.app import COMMANDS
from pinsing.cli.options import parse_numbers
from pinsing.report.arm_report import ArmInfo
from pinsing.robot.load import load
from pinsing.sampling.analyze import Analysis
from pinsing.sampling.sweeps import load_npz


def test_results_and_messages_do_not_mix():
    words = ["at", "ur5", "--q", "0,-1,1,0,0,0", "--no-distances", "-o", "-"]
    done = python("-m", "pinsing", *words)
    assert done.returncode == 0
    assert json.loads(done.stdout)["schema"] == "pinsing/state/1"
    assert "note: tip tool0 (" in done.stderr


@pytest.mark.slow
def test_names_that_the_terminal_cannot_show(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(robot(joint("gelenk_ä")), encoding="utf-8")
    env = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = python("-m", "pinsing", "list", path, env=env)
    assert done.returncode == 0
    assert "gelenk_\\xe4" in done.stdout


@needs_kernel
def test_distances_to_all_families_nearest_first():
    q = [0.1, -1.0, 0.8, 0.3, 0.9, 0.2]
    words = ["at", "ur5", "--rad", "--q", ",".join(map(str, q)), "-o", "-"]
    found = json.loads(run(*words).stdout)["distances"]
    form = pinsing.closed_form(load("ur5"))
    assert sorted(f["family"] for f in found["families"]) == ["F1", "F2", "F3"]
    assert found["complete"] is True
    for f in found["families"]:
        true = form[f["family"]].distance(q)
        assert (f["lower"], f["upper"]) == pytest.approx((true.lower, true.upper), abs=1e-6)
        assert f["upper"] - f["lower"] <= 1e-6
    far = [f["upper"] for f in found["families"]]
    assert far == sorted(far)
    assert "distances" not in json.loads(run(*words, "--no-distances").stdout)


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


@pytest.mark.parametrize("geometry", ["both", "raw", "nominal"])
def test_the_result_of_analyze(geometry):
    words = ["planar3r", "--levels", "1", "--samples", "21"]
    words += [f"--{geometry}"] * (geometry != "both")
    done = run("analyze", *words, "--random-starts", "20", "-o", "-", "--fail-if-singular")
    assert done.exit_code == 1
    analysis = Analysis.from_json(done.stdout)
    assert (analysis.complete, analysis.agree, analysis.geometry) == (True, True, geometry)
    assert analysis.random_search.starts == 20
    assert run("analyze", "--sweep", *words).exit_code == 0


def test_the_commands_of_a_list_work_as_they_stand(tmp_path):
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


def test_the_list_of_joints_and_what_is_left_out_of_them():
    said = run("list", "panda").stdout
    for words in ("panda_joint4", "-176.001", "redundant by 1", "panda_finger_joint1"):
        assert words in said
    rows = [line.split() for line in run("list", "kinova", "--deg").stdout.splitlines()]
    assert ["1", "j2s6s200_joint_1", "continuous", "none", "none", "deg"] in rows
    assert ["2", "j2s6s200_joint_2", "revolute", "47", "313", "deg"] in rows


def test_one_word_narrows_a_list_or_is_the_robot():
    assert "gen3_lite" in run("list", "GEN-3").stdout
    assert run("list", "ur 5 e").stdout.split()[1] == "ur5e"
    text = run("list", "stanford", "-o", "-").stdout
    assert ArmInfo.from_json(text).to_json() + "\n" == text
    data = json.loads(run("list", "-o", "-").stdout)
    assert data["schema"] == "pinsing/robots/1"
    assert {"name", "title", "source", "alias_of"} == set(data["robots"][0])


@pytest.mark.parametrize("word", ["nothing-like-this", "!!", "\x1b[31mred"])
def test_an_unknown_name_is_refused_and_cannot_paint_the_terminal(word):
    none = run("list", word, "-o", "-")
    assert (none.exit_code, none.stdout) == (2, "")
    assert repr(word) in none.stderr
    assert "\x1b" not in none.stderr


@pytest.mark.slow
def test_the_urdf_of_a_table_is_that_of_the_library(tmp_path):
    out, words = tmp_path / "arm.urdf", ["export", "--urdf", URDF / "stanford.dh.yaml", "-o"]
    done = run(*words, out)
    assert (done.exit_code, done.stdout) == (0, "")
    assert run(*words, "-").stdout == out.read_text() == (URDF / "stanford.urdf").read_text()


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_every_command_explains_itself(name):
    done = run(*name.split(), "--help")
    assert done.exit_code == 0
    assert "Usage: pinsing " + name in done.stdout
    assert name or (run().exit_code, run().output) == (2, done.output)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("1,2", [1, 2]), ("[ -0.3, .2e1 ]", [-0.3, 2]),
        ("pi, -pi/2 3pi/4 2*pi", [np.pi, -np.pi / 2, 3 * np.pi / 4, 2 * np.pi]),
    ],
)  # fmt: skip
def test_numbers_that_are_understood(text, values):
    assert parse_numbers(text, "--q") == pytest.approx(values)


FILES = {
    "plot locus gp25": "a.png", "plot map gp25 --over q2,q3": "a.png",
    "view gp25 --skeleton": "a.html", "families gp25 --no-prove": "a.sing", "export gp25": "a.py",
}  # fmt: skip


@pytest.mark.parametrize("words", tiered(FILES, {"families gp25 --no-prove"}))
def test_every_family_option_takes_names_and_titles(words, tmp_path):
    for name in ("elbow", "F1"):
        out = tmp_path / f"{name}{FILES[words]}"
        done = run(*words.split(), "--family", name, "-o", out)
        assert done.exit_code == 0, done.stderr
        assert out.exists()


# What commands say, one transcript a command: ``PINSING_WORDS=1 pytest`` writes them anew.
FOLDER = Path(__file__).parent / "words"
NAMES = sorted(path.stem for path in FOLDER.glob("*.txt"))
_LINES = 14
"""Of each answer: its first screen."""


def said(line: str) -> str:
    done = run(*shlex.split(line)[2:])
    assert "Traceback" not in done.output
    assert "--rad" not in line or "\N{DEGREE SIGN}" not in done.output
    if done.exit_code == 2:
        assert done.stderr.count("pinsing: error: ") == 1
    answer = done.stdout.splitlines()
    lines = answer[:_LINES] + ["..."] * (len(answer) > _LINES) + done.stderr.splitlines()
    text = "\n".join([line, *lines, *[f"exit {done.exit_code}"] * bool(done.exit_code)])
    return settled(text).rstrip()


@pytest.mark.parametrize(
    "name", tiered(NAMES, {*NAMES} - {"calibration", "check", "families", "line"})
)
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
