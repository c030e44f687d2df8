"""A mechanism's tab without a browser: list, scene, server, command."""

import asyncio
import json
import signal
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import started
from links import get, heard
from mechanisms import URDF, analyzed, four_bar, shipped
from tiers import tiered

from pinsing.cli.mechanism import view_loops
from pinsing.errors import ConfigurationError, OptionError, ResultError, UnknownNameError
from pinsing.loops import analyze_mechanism, home, mechanism_at
from pinsing.loops.closure import at_zero, plane_normal
from pinsing.view.mechanism_viewer import MechanismViewer, groups, side
from pinsing.view.tab import SIDE

NAMES = ["five_bar", "four_bar", "planar_3rrr"]


@pytest.fixture(scope="module", params=tiered(NAMES, ("five_bar", "four_bar")))
def viewer(request: pytest.FixtureRequest) -> Any:
    with MechanismViewer(shipped(request.param), analyzed(request.param)) as opened:
        yield opened


@pytest.fixture(scope="module")
def five_bar() -> Any:
    with MechanismViewer(shipped("five_bar"), analyzed("five_bar")) as opened:
        yield opened


# List ---------------------------------------------------------------------


def test_points_are_listed_by_locus_and_none_is_forgotten() -> None:
    mechanism = shipped("five_bar")
    analysis = analyzed("five_bar")
    listed = groups(mechanism, analysis)
    assert [g.name for g in listed] == [f"L{k}" for k in range(1, len(listed) + 1)]
    assert analysis.forms is not None
    assert [g.text for g in listed] == [f"{x.kind}: {x.words}" for x in analysis.forms.loci]
    poses = [p.q for g in listed for p in g.points]
    for point in analysis.points:
        assert min(np.abs(mechanism.fold(q - point.q)).max() for q in poses) < 1e-9
    for group in listed:
        assert all(group.text.startswith(p.kind) for p in group.points)


# Stage, scene, viewer ---------------------------------------------------------------


def test_a_page_has_what_its_program_asks_for(viewer: MechanismViewer) -> None:
    page, inputs = viewer._page(live=True), list(viewer.mechanism.inputs)
    json.dumps(page, allow_nan=False)
    assert page["mechanism"]
    assert [page["engine"]["joints"][i]["name"] for i in page["engine"]["actuated"]] == inputs
    assert page["settings"]["shapes"]
    assert page["settings"]["planar"]
    for entry, group in zip(page["entries"], viewer.groups, strict=True):
        assert entry["poses"] == len(entry["titles"]) == len(group.points)
        assert entry["along"] <= (len(inputs) > 1)


def test_a_plane_is_looked_at_from_above_and_space_from_the_side() -> None:
    mechanism = shipped("planar_3rrr")
    assert plane_normal(mechanism, at_zero(mechanism).axis) == pytest.approx([0, 0, 1])
    assert side(plane_normal(mechanism, at_zero(mechanism).axis))[1] > 0.9  # three.js: y is up
    assert side(None) == SIDE
    bar = four_bar(0.4, 0.1, 0.4, 0.3)
    assert plane_normal(bar, at_zero(bar).axis) == pytest.approx([0, 0, 1])


@pytest.mark.slow
def test_python_leads(five_bar: MechanismViewer) -> None:
    five_bar.show_group("L3", pose=1)
    assert mechanism_at(five_bar.mechanism, five_bar.q).kind == "type 1"
    five_bar.show_inputs([1.0, 1.3])
    assert five_bar.q[list(five_bar.mechanism.actuated)] == pytest.approx([1.0, 1.3])
    five_bar.show(home(five_bar.mechanism))
    assert five_bar._start()["entry"] is None
    with pytest.raises(UnknownNameError, match="L9"):
        five_bar.show_group("L9")
    with pytest.raises(OptionError, match="pose 44"):
        five_bar.show_group(0, pose=44)
    with pytest.raises(OptionError, match="sideways"):
        five_bar.play("L1", "sideways")
    with pytest.raises(ConfigurationError, match="close them first"):
        five_bar.show([0.1, 0.2, 0.3, 0.4])
    with pytest.raises(ConfigurationError, match="they close for"):
        five_bar.show_inputs([np.radians(100), np.pi / 3])
    with pytest.raises(OptionError, match="scale"):
        MechanismViewer(five_bar.mechanism, scale=0)


def test_a_model_without_a_file_is_shown_as_a_skeleton() -> None:
    made = four_bar(0.4, 0.1, 0.4, 0.3)
    with MechanismViewer(made, analyze_mechanism(made, seconds=1e-3)) as viewer:
        assert not viewer._page(live=True)["settings"]["shapes"]


# The command ------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_the_command_serves_until_it_is_ended() -> None:
    run = "import sys; from pinsing.cli.show import view_command; view_command(sys.argv[1:])"
    loops = str(URDF / "four_bar.loops.yaml")
    words = [str(URDF / "four_bar.urdf"), "--loops", loops, "--no-open", "--q", "40", "--deg"]
    process = started("-c", run, *words)
    try:
        url = process.stdout.readline().strip()
        assert get(url)[0] == 200
        assert get(url + "page.json")[0] == 200  # comes when there is a mechanism to ask for
        start, *_ = asyncio.run(heard(url))
        assert start["q"][0] == pytest.approx(np.radians(40))
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=10)
        assert process.returncode == 0
    finally:
        process.kill()
        process.communicate()


def test_a_saved_analysis_must_be_of_this_mechanism(tmp_path: Path) -> None:
    saved = tmp_path / "saved.json"
    saved.write_text(analyzed("four_bar").to_json())
    options = {"robot": str(URDF / "five_bar.urdf"), "analysis": saved}
    with pytest.raises(ResultError, match="not of this mechanism"):
        view_loops(URDF / "five_bar.loops.yaml", **options)
    saved.write_text("{}")
    with pytest.raises(ResultError, match=r"saved\.json: expected data of schema"):
        view_loops(URDF / "five_bar.loops.yaml", **options)
