"""What Tab offers, by click's own interface and by that of the shell."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from arms import URDF
from click.shell_completion import BashComplete
from urdf_text import J, urdf

from pinsing.cli.app import command


def offered(line: str) -> list[str]:
    """Values that click offers for the last word of a line; an empty one after a space."""
    *words, last = line.split(" ")
    complete = BashComplete(command, {}, "pinsing", "_PINSING_COMPLETE")
    return [item.value for item in complete.get_completions(words, last)]


@pytest.mark.parametrize(
    ("line", "some", "none"),
    [
        ("an", {"analyze"}, {"at"}),
        ("analyze ur", {"ur5", "ur10"}, {"panda", "unitree_z1"}),
        ("analyze fran", {"franka", "franka_panda"}, set()),
        ("at ur5 --tip w", {"wrist_1_link", "world"}, {"ee_link"}),
        ("at --tip tool0 ur5 --base ", {"world", "base_link"}, set()),
        ("families ur5 --joints elbow_joint,", {"elbow_joint,wrist_1_joint"}, {"elbow_joint"}),
        ("analyze ur5 --task po", {"pose", "position"}, {"orientation"}),
        ("analyze ur5 --task vx,v", {"vx,vy", "vx,vz"}, {"vx,vx", "vx,wx"}),
        ("view ur5 --family F", {"F1", "F2", "F3"}, {"F4"}),
        ("plot map puma560 --over q2,", {"q2,q3"}, {"q2,q2"}),
        ("plot curves puma560 --fixed q", {"q1=", "q6="}, set()),
        ("map ur5 --sampling ", {"sobol", "random", "grid"}, set()),
        ("analyze ur5 --sweep --engine b", {"batch", "baseline"}, {"auto"}),
        ("list talos_a", {"talos_arm"}, set()),
        ("view ur5 --", {"--family", "--output", "--deg"}, set()),
        ("at ur5 --q 0,1 --q 0,2 --", {"--deg"}, set()),
        (f"families {URDF}/five_bar.urdf --tip ", {"P"}, set()),
    ],
)
def test_what_is_offered(line, some, none):
    found = set(offered(line))
    assert some <= found
    assert not none & found


@pytest.mark.parametrize(
    ("line", "all_of_them"),
    [
        ("view nowhere --analysis a.json --family ", ["F7"]),
        ("view nowhere --analysis bad.json --family ", []),
        ("families mi", ["mine.urdf", "mine.xacro"]),
        ("families hostile.urdf --tip ", ["base", "ok_link"]),
        ("at nope --tip ", []), ("at nope --joints ", []), ("view nope --family ", []),
        ("plot map --over ", []), ("at --tip ", []),
    ],
)  # fmt: skip
def test_what_is_offered_of_files_here(line, all_of_them, tmp_path, monkeypatch, capfd):
    """No name from a file that a shell would take apart, and not a word where nothing is known."""
    hostile = ("a$(touch x)", "b;reboot", "c d", "*", "ok_link")
    joints = [J(f"j{k}", "base", name, kind="fixed") for k, name in enumerate(hostile)]
    form = '{"closed_form": {"families": [{"name": "F7", "text": "q5 = 0"}]}}'
    files = {"a.json": form, "bad.json": "{", "hostile.urdf": urdf(joints)}
    files |= dict.fromkeys(("mine.urdf", "mine.xacro", "mine.txt"), "x")
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    assert sorted(offered(line)) == all_of_them
    assert capfd.readouterr() == ("", "")


def shell(folder: Path, words: list[str], **more: str) -> str:
    """What a command prints where `pinsing` is on the path."""
    program = folder / "pinsing"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m pinsing "$@"\n')
    program.chmod(0o755)
    env = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", **more}
    return subprocess.run(words, capture_output=True, text=True, env=env).stdout


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash(tmp_path):
    """The script that README has people put into ~/.bashrc, in a real bash."""
    script = """
eval "$(_PINSING_COMPLETE=bash_source pinsing)"
complete -p pinsing
for line in "pinsing analyze ur5 --tip wri" "pinsing families pum"; do
  COMP_WORDS=($line); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMPREPLY=()
  _pinsing_completion pinsing
  echo "= ${COMPREPLY[*]}"
done
"""
    said = shell(tmp_path, ["bash", "-c", script])
    assert "-F _pinsing_completion pinsing" in said
    assert "= wrist_1_link wrist_2_link wrist_3_link\n" in said
    assert "= puma560\n" in said


def test_fish_takes_values_with_commas_whole(tmp_path):
    source = shell(tmp_path, ["pinsing"], _PINSING_COMPLETE="fish_source")
    assert source.count('(string split --max 1 "," $completion)') == 1
    if shutil.which("fish") is None:
        return
    script = source + '\ncomplete -C "pinsing families ur5 --joints elbow_joint,wrist_1"'
    said = shell(tmp_path, ["fish", "-c", script])
    assert said.split("\t")[0] == "elbow_joint,wrist_1_joint"
