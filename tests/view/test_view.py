"""The viewer without a browser: scene, frames, paths, pages, server, and how it ends."""

import html
import os
import re
import socket
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import click
import meshcat
import numpy as np
import pinocchio as pin
import pytest
from arms import textbook, ur5
from chromium import open_page, q_of, text
from command_line import run
from dh_arms import dh_text
from links import get
from pages import baked
from pinocchio.visualize import MeshcatVisualizer
from tiers import tiered

import pinsing
from pinsing.cli import output
from pinsing.cli.app import main
from pinsing.errors import ConfigurationError, OptionError, OutputError, UnknownNameError
from pinsing.families import closed_form
from pinsing.families.form import coverage_words
from pinsing.kinematics.jacobian import frame_jacobian, singular_values, tip_placement
from pinsing.measures import pure_ellipsoids, velocity_ellipsoid
from pinsing.robot.load import load
from pinsing.sampling.analyze import analyze, singular_configurations
from pinsing.sampling.sweeps import sweep
from pinsing.view import Viewer, scene
from pinsing.view.trajectory import dropped
from pinsing.view.viewer import family_entries, finding_entries


def test_pure_ellipsoids_collapse_along_the_wrench_that_needs_no_torque() -> None:
    arm = textbook("stanford")
    q = np.array([0.3, 0.9, 0.4, 0.5, 0.0, -0.7])  # the wrist is straight: axes 4 and 6 in line
    J = frame_jacobian(arm, q)
    wrench = np.linalg.svd(J)[0][:, -1]
    for part, ellipsoid in zip((wrench[:3], wrench[3:]), pure_ellipsoids(J), strict=True):
        assert ellipsoid.radii[2] <= 1e-5 * ellipsoid.radii[0] < ellipsoid.radii[1]
        assert abs(ellipsoid.axes[:, 2] @ part) == pytest.approx(np.linalg.norm(part), abs=1e-9)
    # Those of all motions stay round there: nothing would be seen in them.
    for rows in (J[:3], J[3:]):
        assert velocity_ellipsoid(rows).radii[2] > 1e-5


def test_sizes_of_what_is_drawn():
    for given, scale, expected in (
        ([2, 1, 0], 0.5, [1, 0.5, scene.FLATTEST]),
        ([0, 0, 0], 1.0, [0, 0, 0]),
        ([2, 0, 0], 0.05, [0.1, scene.LEAST, scene.LEAST]),
        ([2, 0, 0], 0.005, [0.01, 0.001, 0.001]),
        ([2, 1, 0.9], 0.05, [0.1, 0.05, 0.045]),  # no thinner than that: as it is
    ):
        radii = np.array(given, dtype=float)
        assert scene.drawn_radii(radii, scale, reach=1.0) == pytest.approx(expected)
        assert radii.tolist() == given
    arm = textbook("puma560")
    one, two = scene.sizes(arm), scene.sizes(arm, 2.0)
    twice = (2 * one.translation, 2 * one.rotation)
    assert (two.translation, two.rotation) == pytest.approx(twice)
    assert 0.5 < one.reach < 2.5


def test_findings_of_a_sweep_are_listed() -> None:
    arm = textbook("stanford")
    findings = singular_configurations(arm, sweep(arm, levels=1, samples=24))
    entries = finding_entries(arm, findings)
    assert {e.text for e in entries} >= {"q5 = 0", "d3 = 0"}
    poses = np.concatenate([entry.poses for entry in entries])
    assert singular_values(arm, poses)[:, -1].max() < 1e-9
    wrist = next(e for e in entries if e.text == "q5 = 0")
    assert wrist.family.distance([0, 1, 0.3, 0, 0.1, 0]).value == pytest.approx(0.1)


def test_the_scene_has_every_node_that_frames_place() -> None:
    arm = textbook("surgical7")
    recorder = scene.Recorder()
    links = scene.read_links(load("surgical7"))
    notes = scene.draw_scene(recorder.root, arm, links, scene.sizes(arm), [arm.tip_id])
    assert notes == ()
    paths = {path for path, _ in recorder.commands}
    for j in range(1, arm.model.njoints):
        for part in ("visual/", "bone/", "axis", "hot"):
            assert any(p.startswith(f"/pinsing/arm/{j}/{part}") for p in paths)
    assert {f"/pinsing/ellipsoid/{kind}/skin" for kind in ("translation", "rotation")} <= paths
    assert {f"/pinsing/lost/0/{part}" for part in ("arrow/shaft", "ring/ring", "line")} <= paths


UPPER = {"robot": "ur5", "base": "upper_arm_link"}
RIGHT = {"robot": "talos_full_v2", "tip": "gripper_right_base_link", "base": "torso_2_link"}


@pytest.mark.parametrize(
    "robot", tiered(["ur5", "panda", "so101", RIGHT, UPPER], (UPPER,)), ids=str
)
def test_links_look_and_stand_as_in_the_whole_robot_that_pinocchio_reads(
    robot: str | dict[str, str],
) -> None:
    arm = load(**robot) if isinstance(robot, dict) else load(robot)
    links = scene.read_links(arm)
    whole = pin.buildGeomFromUrdfString(arm.source.full_model, arm.source.xml, pin.VISUAL)
    q = np.random.default_rng(2).uniform(*arm.span)
    full, full_geometry = arm.source.full_model.createData(), whole.createData()
    pin.updateGeometryPlacements(
        arm.source.full_model, full, whole, full_geometry, scene.full_configuration(arm, q)
    )
    data, geometry = arm.model.createData(), links.geometry.createData()
    pin.updateGeometryPlacements(arm.model, data, links.geometry, geometry, arm.model_q(q))
    back = scene.base_placement(arm).inverse()
    assert len(links.geometry.geometryObjects) > 4
    for i, g in enumerate(links.geometry.geometryObjects):
        there = full_geometry.oMg[whole.getGeometryId(g.name)]
        assert (back * there).isApprox(geometry.oMg[i], 1e-9)
        theirs = whole.geometryObjects[whole.getGeometryId(g.name)]
        assert g.meshPath == theirs.meshPath
        np.testing.assert_array_equal(g.meshScale, theirs.meshScale)
        np.testing.assert_array_equal(g.meshColor, theirs.meshColor)


def test_show_and_show_family():
    with Viewer(textbook("stanford"), skeleton=True) as viewer:
        viewer.show([0, 1, 0.3, 0, 0.5, 0])
        np.testing.assert_allclose(viewer.q, [0, 1, 0.3, 0, 0.5, 0])
        viewer.show_family("F3")
        assert abs(np.sin(viewer.q[4])) < 1e-12
        viewer.show_family(viewer.entries[1].family, pose=1)
        np.testing.assert_array_equal(viewer.q, viewer.entries[1].poses[1])
        with pytest.raises(UnknownNameError, match="F9"):
            viewer.show_family("F9")
        with pytest.raises(OptionError, match="pose 7"):
            viewer.show_family(0, pose=7)
        with pytest.raises(ConfigurationError):
            viewer.show([1, 2, 3])
        with pytest.raises(OptionError):
            viewer.play("F1", "sideways")
        assert viewer._server is None  # nobody asked for an address yet
    for scale in (0.0, -1.0, np.nan):
        with pytest.raises(OptionError):
            Viewer(textbook("scara"), scale=scale)


def test_poses_are_on_their_family_inside_the_limits_and_the_same_every_time() -> None:
    arm = textbook("stanford")
    one, two = (family_entries(arm, closed_form(arm).families) for _ in range(2))
    assert any(entry.poses for entry in one)
    for entry, twin in zip(one, two, strict=True):
        np.testing.assert_array_equal(entry.poses, twin.poses)
        assert entry.family.contains(entry.poses).all()
        assert arm.within_limits(entry.poses).all()


def test_the_static_page_is_whole_and_escapes_names() -> None:
    arm = textbook("stanford")
    evil = replace(arm, name="</script><script>alert(1)</script><b>")
    with Viewer(evil, poses=[[0, 1, 0.3, 0, 0.5, 0]], skeleton=True) as viewer:
        text = viewer.html()
        assert viewer.html() == text  # the same every time
    assert "alert(1)" not in text.replace("&lt;/script&gt;&lt;script&gt;alert(1)", "")
    assert not re.search(r'(?:src|href)="(?!data:)', text)
    page = baked(text)
    assert page["robot"]["name"] == evil.name
    assert page["live"] is False
    assert page["entries"][0]["q"] == [[0, 1, 0.3, 0, 0.5, 0]]
    assert page["start"]["q"] == [0, 1, 0.3, 0, 0.5, 0]


def test_next_to_a_users_own_visualizer() -> None:
    arm = ur5()
    sent: list[dict[str, Any]] = []
    window = SimpleNamespace(send=lambda command: sent.append(command.lower()))
    visualizer = MeshcatVisualizer(arm.model, None, pin.GeometryModel())
    visualizer.initViewer(viewer=meshcat.Visualizer.view_into(window, meshcat.path.Path(())))
    visualizer.loadViewerModel()
    viewer = Viewer(arm, visualizer=visualizer)
    sent.clear()
    viewer.show_family("F2")
    places = ("tip", "arm/6", "ellipsoid/translation")
    moved = {c["path"]: np.reshape(c["matrix"], (4, 4)).T for c in sent if "matrix" in c}
    tip, link, shown = (moved[f"/pinsing/{path}"] for path in places)
    np.testing.assert_allclose(tip[:3, 3], tip_placement(arm, viewer.q).translation, atol=1e-9)
    np.testing.assert_allclose(visualizer.data.oMi[6].translation, link[:3, 3], atol=1e-9)
    (ellipsoid, _), scale = pure_ellipsoids(frame_jacobian(arm, viewer.q)), scene.sizes(arm)
    expected = scene.drawn_radii(ellipsoid.radii, scale.translation, scale.reach)
    np.testing.assert_allclose(np.linalg.norm(shown[:, :3], axis=0), expected, rtol=1e-6)
    assert viewer._server is None
    with pytest.raises(OptionError, match="initViewer"):
        Viewer(arm, visualizer=object())


def test_a_taken_port_is_passed_over_or_told_and_given_back_at_the_end() -> None:
    arm = textbook("scara")
    with Viewer(arm, skeleton=True) as one, Viewer(arm, skeleton=True) as two:
        assert one.url != two.url
        assert get(two.url)[0] == 200
        port = urlsplit(one.url).port
        for options, words in (({"port": port}, str(port)), ({"host": "no.invalid"}, "address")):
            with (
                Viewer(arm, skeleton=True, **options) as third,
                pytest.raises(OptionError, match=words),
            ):
                third.url  # noqa: B018
    one.close()  # once more
    with socket.socket() as again:
        again.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        again.bind(("127.0.0.1", port))


def test_a_notebook_gets_the_page_itself() -> None:
    viewer = Viewer(textbook("scara"), skeleton=True)
    for cell in (viewer._repr_html_(), viewer.jupyter_cell(height=300).data):
        frame = re.search(r'<iframe [^>]*srcdoc="([^"]*)"', cell)
        assert html.unescape(frame[1]) == viewer.html()
        assert "127.0.0.1" not in cell
    assert viewer._server is None
    with viewer:
        live = viewer.jupyter_cell(height=300, live=True).data
        assert viewer._server.framed_url != viewer.url
        assert f'src="{viewer._server.framed_url}"' in live
        assert get(viewer._server.framed_url)[0] == 200


def test_ctrl_c_between_the_address_and_the_page(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A page answers before its command has gone on, and warns: it may be ended there."""

    def interrupted(text: str, err: bool = False) -> None:
        if not err:
            socket.create_connection(("127.0.0.1", urlsplit(text).port), timeout=5).close()
            raise KeyboardInterrupt
        click.echo(text, err=True)

    words = SimpleNamespace(**{**vars(click), "echo": interrupted})
    monkeypatch.setattr(output, "click", words)
    with pytest.raises(SystemExit) as end:
        main(["view", "scara", "--no-open", "--skeleton", "--host", "0.0.0.0"])
    assert end.value.code == 0
    assert "warning: listening on 0.0.0.0" in capsys.readouterr().err


def test_a_picture_without_a_browser_says_what_is_missing(tmp_path, monkeypatch):
    junk, viewer = tmp_path / "junk", Viewer(textbook("scara"), skeleton=True)
    junk.write_bytes(b"\x7fELF")
    junk.chmod(0o755)
    missing = {None: "Chromium", str(junk): f"a.png: {junk}: ", "/bin/false": "a.png: .*at once"}
    for browser, said in missing.items():
        monkeypatch.setattr("pinsing.view.picture.find_browser", lambda found=browser: found)
        with viewer, pytest.raises(OutputError, match=said):
            viewer.save_png(tmp_path / "a.png")
    assert os.listdir(tmp_path) == ["junk"]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.csv", b"", "a.csv: no sample in it"),
        ("../../b.csv", b"x", "../../b.csv: unknown column 'x'"),
        ("c.npy", b"\x93NUMPY", "cannot read c.npy"),
        ("d.csv", b"0,-90,45", "If these are degrees, choose that beside the button."),
    ],
)
def test_a_dropped_file_that_cannot_be_read_says_why(name: str, content: bytes, said: str) -> None:
    answer = dropped(load("planar3r"), name, content, None)
    assert list(answer) == ["error"]
    assert said in answer["error"]
    assert "/tmp" not in answer["error"]


@pytest.fixture(scope="module")
def cuspidal(tmp_path_factory):
    """A cuspidal arm, at a pose with four solutions in two aspects."""
    path = tmp_path_factory.mktemp("arm") / "wenger.dh.yaml"
    path.write_text(dh_text([(-90, 1, 0), (90, 2, 1), (0, 1.5, 0)]))
    arm = pinsing.load(path, task="position")
    form = pinsing.closed_form(arm)
    q = [-1.37973247, -0.09304785, 3.02056091]
    found = pinsing.posture_changes(arm, q, forms=form, limits=False)
    assert len(found.others) == 3
    assert any(o.connection and o.connection.same for o in found.others)
    return path, arm, form, found


@pytest.mark.slow
def test_ways_of_the_page_are_those_found(cuspidal):
    _, arm, form, found = cuspidal
    with pinsing.Viewer(arm, form.families, postures=found, skeleton=True) as viewer:
        listed = [e for e in viewer._page(False)["entries"] if e["list"] == "postures"]
        assert viewer._start() == {"q": found.q.tolist(), "entry": None, "pose": 0}
    assert len(listed) == 4
    assert np.array_equal(listed[0]["q"], [found.q])
    ways = [p for p in listed if p["way"]]
    assert ways
    for shown in ways:
        way = np.array(shown["way"])
        assert np.array_equal(way[0], found.q)
        assert np.abs(arm.space.wrap(way[-1] - np.array(shown["q"][0]))).max() < 1e-9
        assert "without a singularity" in shown["more"][0]
        assert np.min(pinsing.clearance(form, way).lower) > 0
    assert sum("only by way of a singularity, proven" in p["more"][0] for p in listed) == 2


@pytest.mark.slow
def test_a_click_plays_the_way_to_a_posture(page: Any, cuspidal: Any) -> None:
    _, arm, form, found = cuspidal
    page.emulate_media(reduced_motion="reduce")  # its end at once
    with pinsing.Viewer(arm, form.families, postures=found, skeleton=True) as viewer:
        listed = [e for e in viewer._page(False)["entries"] if e["list"] == "postures"]
        open_page(page, viewer.url)
        assert page.locator("#postures > li").count() == 4
        assert text(page, "#postures-count") == "(4)"
        for k in (next(i for i, p in enumerate(listed) if p["way"]), 3):
            page.locator("#postures > li button").nth(k).click()
            assert page.locator("#postures > li.chosen").count() == 1
            q = q_of(page)
            assert np.abs(arm.space.wrap(q - np.array(listed[k]["q"][0]))).max() < 1e-9
            assert f"posture {k + 1}" in text(page, "#playing")
            assert page.evaluate("() => window.pinsing.running") is False
            last = int(page.locator("#scrub").get_attribute("max") or 0)
            assert (last > 50) == page.locator("#scrub").is_enabled() == bool(listed[k]["way"])


PAGES = ["check", "form", "postures", "analysis"]


@pytest.mark.parametrize("what", tiered(PAGES, PAGES[:3]))
def test_every_page_says_how_complete_its_list_is(cuspidal: Any, tmp_path: Path, what: str) -> None:
    path, _, _, found = cuspidal
    page, given = tmp_path / "page.html", tmp_path / "given"
    shown = "--analysis", given, "--skeleton", "-o", page
    form = closed_form(load("scara"))
    content, words, said = {
        "check": ("0,0.1,0.2\n0.1,0.3,0.9\n", ["check", "planar3r", given, "-o", page], "Proven"),
        "form": (form.to_json(), ["view", "scara", *shown], coverage_words(form)),
        "postures": ("", ["postures", path, "--task", "position", "--ignore-limits", "-o", page,
                          f"--q={','.join(map(str, found.q))}"], ("Proven", "Probable", "NOT")),
        "analysis": ("", ["view", "planar3r", *shown], ("Proven", "Probable")),  # no certificate
    }[what]  # fmt: skip
    given.write_text(content or analyze(load("planar3r")).to_json())
    result = run(*words)
    assert result.exit_code == 0, result.output
    assert page.stat().st_size > 100_000
    coverage = baked(page.read_text(encoding="utf-8"))["coverage"]
    assert coverage.startswith(said)
    if what == "form":
        assert coverage == said
        given.write_text("{")
        assert "not JSON" in run("view", "scara", *shown).stderr


@pytest.mark.slow
def test_the_page_has_the_statement_of_a_long_equation() -> None:
    arm = load("panda")
    page = Viewer(arm, skeleton=True)._page(live=False)
    (said,) = [e["solved"] for e in page["entries"] if e["solved"]]
    assert said[0]["condition"].startswith("R cos(q3")
    assert said[0]["solution"].startswith("q3 = ")
    assert [name for name, _ in said[0]["where"]] == ["R cos \u03c6", "R sin \u03c6"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("ur10", "name of 'ur5' and of 'ur10'"),
        ("scara", "joints of"),
        ("ur5 --task vx", "task pose"),
    ],
)
def test_an_analysis_is_of_this_arm_and_task(tmp_path: Path, words: str, said: str) -> None:
    given, page = tmp_path / "form.json", tmp_path / "page.html"
    given.write_text(closed_form(load("ur5")).to_json())
    result = run("view", *words.split(), "--analysis", given, "--skeleton", "-o", page)
    assert (result.exit_code, page.exists()) == (2, False)
    assert f"{given}" in result.output
    assert said in result.output
