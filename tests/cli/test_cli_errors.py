"""Bad input at the command line leaves nothing half-written; what is said is in `words`."""

import importlib

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
