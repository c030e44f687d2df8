"""The page in a real browser: it draws, it answers clicks, it opens from a file.

Needs Chromium (or Chrome) and Playwright for Python; without them the tests are skipped.
"""

import io
import math
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import BLUE, PINK, near, open_page, picture, require_browser, show_only, text, until
from command_line import started
from test_page_actions import approach, move_within

from pinsing import Monitor, closed_form, zones
from pinsing.families.tube import Tube, TubeWidth
from pinsing.robot.load import load
from pinsing.view import Viewer
from pinsing.view.server import Server
from pinsing.view.tab import hand_over

require_browser()


NAME = '<img src=x onerror="window.hacked=1">'
"""Text in the page, and never markup."""


@pytest.fixture(scope="module")
def stanford() -> Iterator[Viewer]:
    with Viewer(replace(load("stanford"), name=NAME)) as viewer:
        yield viewer


@pytest.fixture(scope="module")
def static(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("page") / "scara.html"
    with Viewer(replace(load("scara"), name=NAME)) as viewer:
        viewer.save_html(file)
    return file


@pytest.mark.slow
def test_a_running_robot_is_followed(page: Any) -> None:
    words = ["-m", "pinsing", "view", "scara", "--skeleton", "--no-open", "--follow", "-", "--deg"]
    standing = "(t) => Math.abs(window.pinsing?.view?.frame?.q[3] - t) < 1e-9"
    with started(*words, stdin=subprocess.PIPE) as robot:
        try:
            open_page(page, robot.stdout.readline().strip())
            for line, what in (
                ("q4,q2,q3,q1\n40,20,0.1,10\n", math.radians(40)),
                ("1,2,3\n", "cannot read 1,2,3"),
                ('{"q1": 10, "q2": 20, "q3": 0.1, "q4": 50}\n', math.radians(50)),
            ):
                robot.stdin.write(line)
                robot.stdin.flush()
                if isinstance(what, str):
                    until(page, "#playing", what)
                else:
                    page.wait_for_function(standing, arg=what)
            until(page, "#playing", "no line for 1 s")
            robot.stdin.close()
            until(page, "#playing", "the stream has ended")
            page.reload()
            page.wait_for_function(standing, arg=math.radians(50))
            until(page, "#playing", "the stream has ended")
            robot.send_signal(signal.SIGINT)
            assert robot.wait(20) == 0
        finally:
            robot.kill()


# In the quick tier a mechanism's page is loaded from a server, and an arm's from a file.
@pytest.mark.slow
def test_the_page_loads_and_shows_numbers(page: Any, stanford: Viewer) -> None:
    open_page(page, stanford.url)
    assert text(page, "#robot") == NAME
    assert page.evaluate("() => window.hacked") is None
    assert text(page, "#status") == "Singular"
    assert "rank 5 of 6" in text(page, "#rank")
    assert text(page, "#nearest").replace("\n", "") == "on F1: shoulder: q2 = 0°"
    assert text(page, "#condition") == "∞"
    assert page.locator("#entries > li").count() == len(stanford.entries) == 3
    assert page.locator(".joint").count() == 6
    assert "wrist centre" in text(page, "#why")
    pixels = picture(page)
    assert pixels.std() > 10  # something is drawn, and it stands where its frame has it
    where = "() => window.pinsing.view.node('arm/6').position.toArray()"
    assert page.evaluate(where) == page.evaluate("() => window.pinsing.view.frame.links[5]")[:3]


@pytest.mark.slow
def test_the_browser_has_loaded_the_page_before_there_is_an_arm(page: Any) -> None:
    # Its tab shows a turning wheel until then, which costs a slow machine more than the arm.
    with Viewer(load("scara"), skeleton=True) as viewer:
        server = Server("scara", port=0)
        page.goto(server.url, wait_until="load")
        until(page, "#busy", "computing…")
        hand_over(viewer, server)
        page.wait_for_selector("body[data-ready=yes]", timeout=90_000)
        assert text(page, "#robot") == "scara"


@pytest.mark.slow
@pytest.mark.parametrize("missing", ["meshcat.js", "page.json"])
def test_a_page_whose_program_ends_at_once_says_so(browser: Any, missing: str) -> None:
    server = Server("scara", port=0)
    with browser.new_page() as tab:
        tab.route(f"**/{missing}", lambda route: route.abort())
        tab.goto(server.url)
        until(tab, "#busy", "this page has ended")
    server.close()


def test_the_static_page_opens_from_a_file(page: Any, static: Path) -> None:
    open_page(page, static.as_uri())
    assert text(page, "#robot") == NAME
    assert page.evaluate("() => window.hacked") is None
    assert text(page, "#status") == "Singular"
    assert picture(page).std() > 10
    page.locator(".pose").nth(1).click()
    until(page, "#playing", "pose 2")
    approach(page)
    move_within(page)
    # The sliders move it: nothing but the page computes.
    page.locator(".joint input[type=range]").nth(1).fill("0.5")
    until(page, "#status", "Regular")
    assert "° from F1" in text(page, "#nearest")


@pytest.mark.slow
def test_meshes_are_drawn_whole(page: Any) -> None:
    with Viewer(load("ur5"), poses=[[0, -1.2, 1.4, 0.3, 0.8, 0]]) as viewer:
        open_page(page, viewer.url)
        show_only(page, "visual")
        meshes = page.evaluate(
            """() => { const materials = [];
                 const keep = (o) => { if (o.isMesh) materials.push(o.material); };
                 window.pinsing.view.node("arm").traverse(keep);
                 const nested = materials.flat().filter((m) => Array.isArray(m));
                 return [nested.length, materials.length]; }"""
        )
        assert meshes[0] == 0
        assert meshes[1] > 7
        with_meshes = picture(page)
        show_only(page)
        assert (np.abs(picture(page) - with_meshes).sum(axis=-1) > 30).mean() > 0.02


@pytest.mark.slow
def test_the_nearest_of_listed_poses_where_no_family_is_known(page: Any, static: Path) -> None:
    """A search that finds single poses, and no condition, leaves entries without a family."""
    open_page(page, static.as_uri() + "#q=0.3,0.4,0.05,0.5")
    page.evaluate("() => { window.pinsing.page.engine.families = []; }")
    page.locator("#nearest-pose").click()
    until(page, "#status", "Singular")
    q = np.array(page.evaluate("() => window.pinsing.view.frame.q"))
    listed = page.evaluate("() => window.pinsing.page.entries.flatMap((e) => e.q)")
    turn = 2 * np.pi * np.array([1, 1, 0, 1])  # the third joint slides
    gaps = np.array(listed) - [0.3, 0.4, 0.05, 0.5]
    gaps -= turn * np.round(gaps / np.where(turn, turn, 1))
    best = int(np.linalg.norm(gaps, axis=1).argmin())
    np.testing.assert_allclose(q, listed[best], atol=1e-9)
    assert "nearest that is listed" in text(page, "#playing")
    page.evaluate("() => { window.pinsing.page.entries.forEach((e) => { e.into = false; }); }")
    page.evaluate("() => { window.pinsing.go([0.3, 0.4, 0.05, 0.5]); }")
    page.locator("#nearest-pose").click()
    assert text(page, "#playing") == "no singular pose was found"


@pytest.mark.slow
def test_the_legend_never_covers_the_label(page: Any, stanford: Viewer) -> None:
    for size in ((1280, 800), (400, 800)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        open_page(page, stanford.url)
        for _ in range(5):
            page.locator("#next").click()
            page.wait_for_timeout(150)
            boxes = page.evaluate(
                """() => ["label-lost", "legend"].map((id) => {
                     const b = document.getElementById(id).getBoundingClientRect();
                     return [b.left, b.top, b.right, b.bottom]; })"""
            )
            (left, top, right, bottom), (x0, y0, x1, y1) = boxes
            if right > left:
                assert right <= x0 or left >= x1 or bottom <= y0 or top >= y1


@pytest.mark.slow
def test_a_printed_page_has_its_picture(page: Any, stanford: Viewer) -> None:
    from PIL import Image

    open_page(page, stanford.url)
    page.emulate_media(media="print")
    page.evaluate("() => window.dispatchEvent(new Event('beforeprint'))")
    shot = Image.open(io.BytesIO(page.screenshot()))
    stage = page.locator("#stage").bounding_box()
    box = [stage["x"], stage["y"], stage["x"] + stage["width"], stage["y"] + stage["height"]]
    pixels = np.asarray(shot.crop(box).convert("RGB"), dtype=float)
    assert near(pixels, BLUE) > 200
    assert near(pixels, PINK) > 60
    assert page.locator("#player").is_hidden()
    panel = page.locator("#panel").bounding_box()
    assert panel["height"] > 500  # all of it, and not what fits a screen
    page.evaluate("() => window.dispatchEvent(new Event('afterprint'))")
    assert page.locator("#printed canvas").count() == 0


@pytest.mark.slow
def test_a_pose_at_rest_is_told_its_distance_for_sure(page: Any, tmp_path: Path) -> None:
    out = tmp_path / "panda.html"
    with Viewer(load("panda"), skeleton=True) as viewer:
        viewer.save_html(out)
    open_page(page, out.as_uri())
    # Without the work of a frame there is more to do at rest.
    q = [0.3, -0.6, 0.8, -1.4, 0.6, 1.9, 0.2]
    page.evaluate(
        """(q) => {
             const { engine } = window.pinsing;
             window.pinsing.compute = (x) => {
               const frame = Engine.frameAt(engine, x);
               return { ...frame, verdict: Engine.nearestFamily(engine, x, engine.families, 0) };
             };
             window.pinsing.go(q);
           }""",
        q,
    )
    assert "between" in text(page, "#nearest")
    page.wait_for_function("() => window.pinsing.view.frame.verdict.sure")
    assert "between" not in text(page, "#nearest")
    shown = page.evaluate("() => window.pinsing.view.frame.verdict")
    there = [f.distance(q) for f in closed_form(load("panda")).families]
    assert abs(shown["least"] - min(d.lower for d in there)) < 3e-6


@pytest.mark.slow
def test_where_a_monitor_sees_a_zone_the_slider_is_red(page: Any, tmp_path: Path) -> None:
    form = closed_form(load("scara"))
    found = zones(form, joint_speeds=[5, 5, 1, 10], within="q1=-1..1.2")
    with Viewer(form.loaded, form.families, zones=found, skeleton=True) as viewer:
        viewer.save_html(tmp_path / "scara.html")
    open_page(page, (tmp_path / "scara.html").as_uri())
    q = [0.3, 1.0, 0.1, 0.2]
    page.evaluate("(q) => window.pinsing.go(q)", q)
    page.wait_for_function("() => document.querySelectorAll('.band .zone').length === 3")
    assert "Red: too near for 0.25 m/s and 0.5 rad/s" in text(page, "#joints-note")
    red = page.evaluate("(q) => window.pinsing.zones(q)", q)
    monitor = Monitor(form, zones=found)
    for j, (low, high) in enumerate(zip(*form.loaded.span, strict=True)):
        for k in range(0, 240, 7):
            x = np.array(q)
            x[j] = low + (k + 0.5) * (high - low) / 240
            inside = any(a < x[j] < b for a, b in red[j])
            assert inside is (monitor.update(x).zones != ())
    page.evaluate("(q) => window.pinsing.go(q)", [2.0, 1.0, 0.1, 0.2])  # beyond their range
    page.wait_for_function("() => document.querySelectorAll('.band .zone').length === 5")


@pytest.mark.slow
def test_near_families_of_a_design_the_slider_is_red(page: Any, tmp_path: Path) -> None:
    form = closed_form(load("ur5e"))
    parts = tuple(TubeWidth(f.name, 0.1, 0.05, True) for f in form.families)
    tube = Tube(0.3, 0.05, True, parts, 0.2, "", (), 1)
    with Viewer(form.loaded, form.families, zones=tube, skeleton=True) as viewer:
        viewer.save_html(tmp_path / "tube.html")
    open_page(page, (tmp_path / "tube.html").as_uri())
    assert "lie within 5.8° of one of them (17.2° where two" in text(page, "#joints-note")
    for wrist, wide in ((0.5, 0.1), (0.15, 0.2)):  # far from it, and where it and the elbow meet
        q = [0, -1.2, 1, -1, wrist, 0]
        red = page.evaluate("(q) => window.pinsing.zones(q)", q)[2]
        (elbow,) = [b for b in red if b[0] < 0 < b[1]]
        assert elbow == pytest.approx([-wide, wide], abs=0.03)
