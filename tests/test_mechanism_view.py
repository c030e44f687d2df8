"""A mechanism's tab without a browser: frames, list, paths, surroundings, server."""

from __future__ import annotations

import asyncio
import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import umsgpack
from mechanisms import URDF, analyzed, four_bar, shipped
from test_view import converse, get

from pinsing.cli.mechanism import view_loops
from pinsing.errors import ConfigurationError, OptionError, ResultError, UnknownNameError
from pinsing.mechanism import home, mechanism_at, motions
from pinsing.mechanism.lost_motion import free_motions, lost_motions
from pinsing.view.links import read_links
from pinsing.view.mechanism import MechanismViewer
from pinsing.view.mechanism.around import around
from pinsing.view.mechanism.frame import mechanism_frame
from pinsing.view.mechanism.groups import groups
from pinsing.view.mechanism.linkage import Linkage, linkage_sizes, plane_normal, side
from pinsing.view.mechanism.paths import along, into
from pinsing.view.record import Recorder
from pinsing.view.scene import draw_scene
from pinsing.view.stage import SIDE

NAMES = ["five_bar", "four_bar", "planar_3rrr"]


@pytest.fixture(scope="module", params=NAMES)
def viewer(request: pytest.FixtureRequest) -> Any:
    with MechanismViewer(shipped(request.param), analyzed(request.param)) as opened:
        yield opened


@pytest.fixture(scope="module")
def five_bar() -> Any:
    with MechanismViewer(shipped("five_bar")) as opened:
        yield opened


def singular(name: str, kind: str) -> np.ndarray:
    return next(p.q for p in analyzed(name).points if p.kind == kind)


# Frames -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_a_frame_says_what_the_state_says(name: str) -> None:
    mechanism = shipped(name)
    sizes = linkage_sizes(mechanism)
    for q in (home(mechanism), singular(name, "type 1"), singular(name, "type 2")):
        state = mechanism_at(mechanism, q)
        frame = mechanism_frame(mechanism, q, sizes, plane_normal(mechanism))
        json.dumps(frame, allow_nan=False)
        assert (frame["kind"], frame["mode"]) == (state.kind, state.mode)
        assert frame["status"] == ("regular" if state.kind == "regular" else "singular")
        assert frame["one"] == pytest.approx(state.output_ratio, rel=1e-4)
        assert frame["two"] == pytest.approx(state.input_ratio, rel=1e-4)
        assert bool(frame["lost"]) == (state.kind == "type 1")
        assert bool(frame["given"]) == (state.kind == "type 2")
        assert bool(frame["hot"]) == (state.kind != "regular")
        assert (frame["condition"] == "inf") == (state.kind != "regular")
        data = mechanism.model.createData()
        pin.forwardKinematics(mechanism.model, data, mechanism.model_q(q))
        for j, place in enumerate(frame["links"], 1):
            np.testing.assert_allclose(place, pin.SE3ToXYZQUAT(data.oMi[j]), atol=1e-5)


def test_the_ellipse_is_that_of_the_output_and_collapses_at_type_1() -> None:
    mechanism = shipped("five_bar")
    sizes = linkage_sizes(mechanism)
    q = home(mechanism)
    e = mechanism_frame(mechanism, q, sizes)["ellipsoids"]["all"]["translation"]
    velocity = mechanism_at(mechanism, q).velocity
    assert velocity is not None
    R = pin.Quaternion(np.array(e["turn"])).toRotationMatrix()
    drawn = (R @ np.diag(np.square(e["drawn"])) @ R.T)[:2, :2]
    scale = sizes.translation
    np.testing.assert_allclose(drawn, scale**2 * velocity @ velocity.T, atol=3e-4 * scale**2)
    assert e["flat"] is None

    q = singular("five_bar", "type 1")
    frame = mechanism_frame(mechanism, q, sizes)
    e = frame["ellipsoids"]["all"]["translation"]
    assert e["radii"][1] < 1e-9 * e["radii"][0]
    flat = pin.Quaternion(np.array(e["flat"])).toRotationMatrix()[:, 2]
    reached = pin.Quaternion(np.array(e["turn"])).toRotationMatrix()[:, 0]
    assert abs(flat @ reached) < 1e-4  # at right angles to all that is left
    assert min(e["drawn"]) > 0


def test_long_ellipses_are_cut_short() -> None:
    mechanism = shipped("five_bar")
    sizes = linkage_sizes(mechanism)
    path = into(mechanism, next(p for p in analyzed("five_bar").points if p.range_end))
    close = mechanism_frame(mechanism, path[-2], sizes)
    radii = close["ellipsoids"]["all"]["translation"]["radii"]
    assert radii[0] * sizes.translation > sizes.reach
    assert max(close["ellipsoids"]["all"]["translation"]["drawn"]) <= 0.6 * sizes.reach + 1e-6
    assert close["status"] in ("regular", "near-singular")


@pytest.mark.parametrize("name", NAMES)
def test_lost_wrenches_do_no_work_and_free_motions_need_no_motor(name: str) -> None:
    mechanism = shipped(name)
    rows = list(mechanism.task.rows)
    found = {kind: singular(name, kind) for kind in ("type 1", "type 2")}
    state = mechanism_at(mechanism, found["type 1"])
    (lost,) = lost_motions(mechanism, state)
    assert state.velocity is not None
    wrench = np.concatenate([lost.force, lost.moment])[rows]
    np.testing.assert_allclose(wrench @ state.velocity, 0, atol=1e-8)
    if lost.line is not None:  # the same force, on its line, has no moment left
        moment = np.cross(lost.line - state.position, lost.force)
        np.testing.assert_allclose(moment, lost.moment, atol=1e-9)

    state = mechanism_at(mechanism, found["type 2"])
    (free,) = free_motions(mechanism, state)
    motion = motions(mechanism, found["type 2"])
    z = np.linalg.svd(motion.inputs)[2][-1]
    expected = np.zeros(6)
    expected[rows] = motion.outputs @ z
    got = np.concatenate([free.velocity, free.turning])
    cosine = got @ expected / np.linalg.norm(got) / np.linalg.norm(expected)
    assert abs(cosine) == pytest.approx(1, abs=1e-9)
    if free.centre is not None:  # a point of the axis rests
        rest = free.velocity + np.cross(free.turning, free.centre - state.position)
        np.testing.assert_allclose(rest, 0, atol=1e-9)


def test_words_name_what_happens() -> None:
    mechanism = shipped("planar_3rrr")
    frame = mechanism_frame(mechanism, singular("planar_3rrr", "type 2"), linkage_sizes(mechanism))
    assert "center turns about z through (" in frame["given"][0]
    assert "with the actuators locked" in frame["given"][0]
    assert frame["why"] == ["b1, c1, b2 and b3 can move although the actuators are locked"]
    mechanism = shipped("four_bar")
    frame = mechanism_frame(mechanism, singular("four_bar", "type 1"), linkage_sizes(mechanism))
    assert frame["lost"][0]["words"] == "rocker_link cannot turn about z"
    assert frame["why"] == ["crank and coupler can move although rocker_link is locked"]


# List and paths ---------------------------------------------------------------------


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


def test_points_without_closed_forms_are_listed_by_what_is_in_line() -> None:
    mechanism = shipped("planar_3rrr")
    listed = groups(mechanism, analyzed("planar_3rrr"))
    assert [g.text for g in listed] == [
        "type 1: the leg of a1 in line",
        "type 1: the leg of a2 in line",
        "type 1: the leg of a3 in line",
        "type 2: the actuators do not hold the output",
    ]
    away = [np.linalg.norm(mechanism.fold(p.q - home(mechanism))) for p in listed[3].points]
    assert away == sorted(away)


@pytest.mark.parametrize("name", NAMES)
def test_paths_lead_into_singularities_and_along_them(name: str) -> None:
    mechanism = shipped(name)
    played = 0
    for group in groups(mechanism, analyzed(name)):
        for point in group.points[:1]:
            path = into(mechanism, point)
            if not len(path):
                assert "isolated points" in group.more
                continue
            assert mechanism_at(mechanism, path[0]).kind == "regular"
            assert mechanism_at(mechanism, path[-1]).kind == point.kind
            assert np.abs(np.diff(path, axis=0)).max() < 0.2
            singular_path = along(mechanism, point)
            assert bool(len(singular_path)) == (len(mechanism.inputs) > 1)
            for q in singular_path[::6]:
                assert mechanism_at(mechanism, q).kind == point.kind
            if len(singular_path):
                played += 1
                assert np.ptp(singular_path, axis=0).max() > 0.2
                closed = np.concatenate([singular_path, singular_path[:1]])
                assert np.abs(mechanism.fold(np.diff(closed, axis=0))).max() < 0.4
    assert played >= (3 if len(mechanism.inputs) > 1 else 0)


def test_one_input_has_no_path_along() -> None:
    mechanism = shipped("four_bar")
    point = analyzed("four_bar").points[0]
    assert along(mechanism, point).shape == (0, mechanism.n)


# Surroundings -----------------------------------------------------------------------


def test_surroundings_tell_reach_marks_and_modes() -> None:
    mechanism = shipped("five_bar")
    q = home(mechanism)
    found = around(mechanism, q)
    json.dumps(found, allow_nan=False)
    one, two = found["stretches"]
    assert one["upper"] == pytest.approx(1.3990140, abs=1e-6)
    assert two["lower"] == pytest.approx(0.6270392, abs=1e-6)
    assert [m["kind"] for m in one["marks"]] == ["type 2", "type 1", "type 2"]
    assert found["ahead"] == "type 1 is nearest: q1 − 10.5°"
    assert [m["name"] for m in found["assemblies"]] == [
        "assembly +, elbows -+",
        "assembly -, elbows -+",
    ]
    assert [m["here"] for m in found["assemblies"]] == [True, False]
    assert len(found["working"]) == 4
    place = mechanism_at(mechanism, q).position
    for mode in found["working"]:
        np.testing.assert_allclose(mechanism_at(mechanism, mode["q"]).position, place, atol=1e-9)


def test_surroundings_of_a_singular_pose_hold_the_pose_itself() -> None:
    mechanism = shipped("five_bar")
    q = singular("five_bar", "type 2")
    found = around(mechanism, q)
    assert found["ahead"] == ""
    (here,) = [m for m in found["assemblies"] if m["here"]]
    assert "assembly 0" in here["name"]
    np.testing.assert_allclose(mechanism.fold(np.array(here["q"]) - q), 0, atol=1e-9)


# Stage, scene, viewer ---------------------------------------------------------------


def test_infeasible_inputs_leave_it_at_the_last_feasible_pose(viewer: MechanismViewer) -> None:
    stage, mechanism = viewer._stage, viewer.mechanism
    q = home(mechanism)
    actuated = list(mechanism.actuated)
    reach = around(mechanism, q)["stretches"][0]
    inputs = q[actuated]
    inputs[0] = reach["upper"] + 0.3
    frame = stage.frame(q, inputs)
    assert frame["refused"].startswith(f"infeasible: {mechanism.inputs[0]} = ")
    assert f"close up to {np.degrees(reach['upper']):.2f}°" in frame["refused"]
    assert frame["q"][actuated[0]] == pytest.approx(reach["upper"], abs=1e-4)
    assert frame["mode"].split(",")[0] == "assembly +"
    # And back again, in the same mode.
    inputs[0] = q[actuated[0]]
    back = stage.frame(frame["q"], inputs)
    assert back["refused"] is None
    np.testing.assert_allclose(mechanism.fold(back["q"] - q), 0, atol=1e-8)


def test_a_page_has_what_its_program_asks_for(viewer: MechanismViewer) -> None:
    page = viewer._stage.page(live=True)
    json.dumps(page, allow_nan=False)
    assert page["mechanism"]
    assert [page["joints"][i]["name"] for i in page["inputs"]] == list(viewer.mechanism.inputs)
    assert page["settings"]["shapes"]
    assert page["settings"]["planar"]
    for entry, group in zip(page["entries"], viewer.groups, strict=True):
        assert entry["poses"] == len(entry["titles"]) == len(group.points)
        assert entry["along"] <= (len(page["inputs"]) > 1)


def test_the_scene_has_every_node_that_frames_place(viewer: MechanismViewer) -> None:
    paths, at = set(), 0
    while at < len(viewer._scene):
        size = int.from_bytes(viewer._scene[at : at + 4], "little")
        paths.add(umsgpack.unpackb(viewer._scene[at + 4 : at + 4 + size])["path"])
        at += 4 + size
    for j in range(1, viewer.mechanism.model.njoints):
        for part in ("visual", "bone", "axis", "hot"):
            assert any(p.startswith(f"/pinsing/arm/{j}/{part}") for p in paths), (j, part)
    for node in ("ellipsoid/translation", "ellipsoid/rotation/ring", "free/rotation"):
        assert any(p.startswith(f"/pinsing/{node}") for p in paths)


def test_bones_lead_to_the_frames_that_close_the_loops() -> None:
    mechanism = shipped("five_bar")
    linkage = Linkage(mechanism)
    recorder = Recorder()
    sizes = linkage_sizes(mechanism)
    draw_scene(recorder.visualizer(), linkage, read_links(linkage), sizes, linkage.ends)
    bones = {umsgpack.unpackb(c)["path"] for c in recorder.commands}
    last = {p.split("/")[3] for p in bones if "/bone/link" in p}
    names = list(mechanism.model.names)
    assert {str(names.index("b1")), str(names.index("b2"))} <= last


def test_a_plane_is_looked_at_from_above_and_space_from_the_side() -> None:
    mechanism = shipped("planar_3rrr")
    assert plane_normal(mechanism) == pytest.approx([0, 0, 1])
    assert side(plane_normal(mechanism))[1] > 0.9  # three.js: y is up
    assert side(None) == SIDE
    assert plane_normal(four_bar(0.4, 0.1, 0.4, 0.3)) == pytest.approx([0, 0, 1])


def test_python_leads(five_bar: MechanismViewer) -> None:
    five_bar.show_group("L3", pose=1)
    assert mechanism_at(five_bar.mechanism, five_bar.q).kind == "type 1"
    five_bar.show_inputs([1.0, 1.3])
    assert five_bar.q[list(five_bar.mechanism.actuated)] == pytest.approx([1.0, 1.3])
    five_bar.show(home(five_bar.mechanism))
    assert five_bar._stage.start()["entry"] is None
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
    with MechanismViewer(four_bar(0.4, 0.1, 0.4, 0.3)) as viewer:
        assert not viewer._stage.page(live=True)["settings"]["shapes"]


def test_the_link_answers(five_bar: MechanismViewer) -> None:
    q = home(five_bar.mechanism).tolist()
    for part in ("", "page.js", "page.json", "scene"):
        assert get(five_bar.url + part)[0] == 200
    frame, found, pose, path, start = asyncio.run(
        converse(
            five_bar.url,
            {"id": 1, "want": "frame", "q": q, "inputs": [1.1, 1.0]},
            {"id": 2, "want": "around", "q": q},
            {"id": 3, "want": "pose", "entry": 0, "pose": 0},
            {"id": 4, "want": "path", "entry": 0, "pose": 0, "kind": "into"},
            {"id": 5, "want": "start"},
        )
    )
    assert frame["answer"]["q"][0] == pytest.approx(1.1)
    assert found["answer"]["stretches"][0]["marks"]
    assert pose["answer"]["kind"] == "type 2"
    assert path["answer"][0]["status"] == "regular"
    assert start["answer"]["pose"] == 0


@pytest.mark.parametrize(
    "request_",
    [
        {"id": 1},
        {"id": 1, "want": "frame", "q": [0, 0, 0, 0]},
        {"id": 1, "want": "frame", "q": [0, 0, 0, 0], "inputs": [1]},
        {"id": 1, "want": "frame", "q": [0.0, 0.0, 3.0, 0.0], "inputs": [0.0, 3.0]},
        {"id": 1, "want": "around", "q": [0.0, 0.0, 3.0, 0.0]},
        {"id": 1, "want": "around", "q": "abc"},
        {"id": 1, "want": "pose", "entry": 99, "pose": 0},
        {"id": 1, "want": "pose", "entry": True, "pose": 0},
        {"id": 1, "want": "path", "entry": 0, "pose": 0, "kind": "x"},
        {"id": 1, "want": "rm"},
    ],
)
def test_bad_requests_are_refused_and_the_link_lives_on(
    five_bar: MechanismViewer, request_: dict[str, Any]
) -> None:
    answers = asyncio.run(converse(five_bar.url, request_, {"id": 2, "want": "start"}))
    assert "error" in answers[0]
    assert "answer" in answers[1]


# The command ------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_the_command_serves_until_it_is_ended() -> None:
    run = "import sys; from pinsing.cli.view import view_command; view_command(sys.argv[1:])"
    loops = str(URDF / "four_bar.loops.yaml")
    words = [str(URDF / "four_bar.urdf"), "--loops", loops, "--no-open", "--q", "40", "--deg"]
    process = subprocess.Popen(
        [sys.executable, "-c", run, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        url = process.stdout.readline().strip()
        assert get(url)[0] == 200
        (start,) = asyncio.run(converse(url, {"id": 1, "want": "start"}))
        assert start["answer"]["frame"]["q"][0] == pytest.approx(np.radians(40))
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
