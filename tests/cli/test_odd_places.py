"""Odd places for output, and odd things in messages: one line that names the reason."""

import contextlib
import os
from pathlib import Path

import pytest

import pinsing
from pinsing.atomic_write import check_writable, write_text
from pinsing.cli import output as figure
from pinsing.cli.output import say
from pinsing.errors import OutputError, PinsingError, ResultError


def refused(path: str | Path) -> str:
    with pytest.raises(OutputError) as raised:
        check_writable(path)
    assert "\n" not in str(raised.value)
    return str(raised.value)


def test_links_that_lead_nowhere(tmp_path):
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "far").symlink_to("no/where")
    (tmp_path / "new").symlink_to("target")
    assert "leads to itself" in refused(tmp_path / "loop")
    with pytest.raises(OutputError, match="leads to itself"):
        write_text(tmp_path / "loop", "x")
    assert (tmp_path / "loop").is_symlink()
    assert "no such folder" in refused(tmp_path / "far")
    write_text(check_writable(tmp_path / "new"), "x")  # the file it stands for is made
    assert (tmp_path / "new").is_symlink()
    assert (tmp_path / "target").read_text() == "x"


def test_names_that_cannot_be_printed(tmp_path, capsys):
    assert "half a character" in refused("\ud800.html")
    assert len(refused("x" * 10**6)) < 300
    assert r"a\nb" in refused(tmp_path / "a\nb" / "c.txt")
    say(f"wrote {tmp_path}/a\nb")
    assert capsys.readouterr().err.count("\n") == 1
    message = str(PinsingError("no \ud800\x1b[2J\nhere" + "x" * 10**6))
    assert message.encode().isascii()
    assert message.isprintable()
    assert len(message) < 5000


def test_a_map_into_what_is_no_folder(tmp_path):
    arm = pinsing.load("planar3r", task="position")
    (tmp_path / "link").symlink_to("no")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "file").write_text("")
    for name, why in (("link", "not there"), ("pipe", "pipe"), ("file", "it is a file")):
        with pytest.raises(OutputError, match=why):
            pinsing.sampling.sigma_map(arm, count=8, out=tmp_path / name)
    for bad in ("\ud800", "x" * 10**6, "a/" * 10**5):
        with pytest.raises(OutputError) as raised:
            pinsing.sampling.sigma_map(arm, count=8, out=bad)
        assert str(raised.value).isprintable()
        assert len(str(raised.value)) < 500


def test_settings_of_figures_are_read_from_files_alone(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MPLBACKEND", "agg")
    os.mkfifo(tmp_path / "matplotlibrc")
    for named in ("/dev/full", str(tmp_path), str(tmp_path / "matplotlibrc")):
        monkeypatch.setenv("MATPLOTLIBRC", named)
        figure.off_screen()
        assert "MATPLOTLIBRC" not in os.environ
        assert capsys.readouterr().err.count("MATPLOTLIBRC is ignored") == 1
    mine = tmp_path / "mine"
    mine.write_text("")
    monkeypatch.setenv("MATPLOTLIBRC", str(mine))
    figure.off_screen()
    assert os.environ["MATPLOTLIBRC"] == str(mine)


def test_half_a_character_in_a_result():
    arm = pinsing.load("planar3r", task="position")
    state = pinsing.at(arm, [0.1, 0.2, 0.3])
    form = pinsing.closed_form(arm)
    for result, old in ((state, '"q2"'), (form, '"planar3r"'), (form.families[0], '"q2"')):
        text = result.to_json(indent=None)
        assert old in text
        with pytest.raises(ResultError, match="half a character"):
            type(result).from_json(text.replace(old, r'"\ud800"'))


def test_numbers_in_a_result_that_cannot_be_reckoned_with(recwarn):
    state = pinsing.at(pinsing.load("planar3r", task="position"), [0.1, 0.2, 0.3]).to_dict()

    def huge(value):
        if isinstance(value, dict):
            return {k: huge(v) for k, v in value.items()}
        if isinstance(value, list):
            return [huge(v) for v in value]
        return 1e308 if isinstance(value, float) else value

    for key in state:
        with contextlib.suppress(ResultError):
            pinsing.State.from_dict({**state, key: huge(state[key])})
    assert not recwarn.list
