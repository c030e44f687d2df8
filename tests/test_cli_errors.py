"""Bad input at the command line leaves nothing half-written; what is said is in `words`."""

import importlib
import re
from pathlib import Path

import pytest
from command_line import run
from urdf_texts import LIMIT


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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("at gp25 --q 0,0,0,0,0,0 --deg --rad", "--deg and --rad exclude each other"),
        ("families gp25 --prove --no-prove", "--prove and --no-prove exclude each other"),
        ("at gp25 --q 0,-1e20,0,0,0,0", "--q: q2 is -1e.20; values beyond 1e.09"),
        ("view gp25 --trajectory a.csv", "pinsing check ROBOT FILE judges one, and with --view"),
        ("guard gp25", "type pinsing export ROBOT -o guard.h"),
        ("families arm", f"arm: is a folder: .* such as {Path('arm/six.urdf')}"),
    ],
)
def test_what_cannot_be_meant_is_refused(words, said, tmp_path, monkeypatch):
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm/six.urdf").write_text("")
    monkeypatch.chdir(tmp_path)
    assert re.search(said, refused(*words.split()))


class TestOutput:
    @pytest.mark.parametrize(
        "name", ["at", "list --info", "analyze --sweep", "analyze", "families"]
    )
    def test_checked_before_the_robot_is_read(self, tmp_path, monkeypatch, name):
        def never(*_, **__):
            raise AssertionError("the robot was read")

        monkeypatch.setattr(importlib.import_module("pinsing.robot.load"), "load", never)
        q = ["--q", "0,0,0"] if name == "at" else []
        for end in ("json", "npz") if "sweep" in name else ("json",):
            bad = tmp_path / "none" / f"x.{end}"
            assert "cannot write" in refused(*name.split(), "planar3r", *q, "-o", str(bad))
        assert list(tmp_path.iterdir()) == []

    def test_the_robot_itself_is_not_replaced(self, write_urdf):
        path = write_urdf([("revolute", '<axis xyz="0 0 1"/>' + LIMIT)])
        path = path.rename(path.with_suffix(".json"))
        before = path.read_text()
        assert "robot itself" in refused("at", str(path), "--q", "0", "-o", str(path))
        assert path.read_text() == before
