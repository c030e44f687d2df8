"""The page in a real browser: it draws, it answers clicks, it opens from a file."""

import contextlib
import functools
import json
import math
import signal
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import (
    BLUE,
    PINK,
    near,
    open_page,
    picture,
    pixels,
    q_of,
    serious_findings,
    text,
    until,
)
from command_line import run, started
from matplotlib.transforms import Bbox
from mechanisms import analyzed, shipped

from pinsing import Monitor, at, closed_form, zones
from pinsing.families.tube import Tube, TubeWidth
from pinsing.robot.load import load
from pinsing.view import Viewer
from pinsing.view.mechanism_viewer import MechanismViewer
from pinsing.view.server import Server
from pinsing.view.tab import hand_over

NAME = '<img src=x onerror="window.hacked=1">'
"""Text in the page, and never markup."""


MAKE: dict[str, Callable[[], Viewer | MechanismViewer]] = {
    "arm": lambda: Viewer(load("stanford")),
    "named": lambda: Viewer(replace(load("stanford"), name=NAME)),
    "scara": lambda: Viewer(replace(load("scara"), name=NAME)),
    "mechanism": lambda: MechanismViewer(shipped("five_bar"), analyzed("five_bar")),
}


@pytest.fixture(scope="module")
def addresses(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str, str], str]]:
    """Address of each kind of page, live or in a file, made when first asked for."""
    folder = tmp_path_factory.mktemp("pages")
    with contextlib.ExitStack() as opened:
        viewer = functools.cache(lambda name: opened.enter_context(MAKE[name]()))

        @functools.cache
        def address(kind: str, name: str) -> str:
            file = folder / f"{name}.html"
            if kind == "file":
                viewer(name).save_html(file)
            return viewer(name).url if kind == "live" else file.as_uri()

        yield address


def saved(folder: Path, *given: Any, skeleton: bool = True, **more: Any) -> str:
    """Address of a page from a file."""
    file = folder / "page.html"
    with Viewer(*given, skeleton=skeleton, **more) as viewer:
        viewer.save_html(file)
    return file.as_uri()


@pytest.mark.slow
def test_a_running_robot_is_followed(page: Any) -> None:
    words = ["-m", "pinsing", "view", "scara", "--skeleton", "--no-open", "--follow", "-", "--deg"]
    standing = "(t) => Math.abs(window.pinsing?.view?.frame?.q[3] - t) < 1e-9"
    with started(*words, stdin=subprocess.PIPE) as robot:
        try:
            open_page(page, robot.stdout.readline().strip())
            for line, degrees in (
                ("q4,q2,q3,q1\n40,20,0.1,10\n", 40),
                ("1,2,3\n", None),
                ('{"q1": 10, "q2": 20, "q3": 0.1, "q4": 50}\n', 50),
            ):
                robot.stdin.write(line)
                robot.stdin.flush()
                if degrees is None:
                    until(page, "#playing", "cannot read 1,2,3")
                else:
                    page.wait_for_function(standing, arg=math.radians(degrees))
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
def test_the_page_loads_shows_numbers_and_is_printed(page: Any, addresses: Any) -> None:
    open_page(page, addresses("live", "named"))
    assert text(page, "#robot") == NAME
    assert page.evaluate("() => window.hacked") is None
    assert text(page, "#status") == "Singular"
    assert "rank 5 of 6" in text(page, "#rank")
    assert text(page, "#nearest").replace("\n", "") == "on F1: shoulder: q2 = 0°"
    assert text(page, "#condition") == "∞"
    assert page.locator("#entries > li").count() == 3
    assert page.locator(".joint").count() == 6
    assert "wrist centre" in text(page, "#why")
    assert picture(page).std() > 10  # something is drawn, and it stands where its frame has it
    where = "() => window.pinsing.view.node('arm/6').position.toArray()"
    assert page.evaluate(where) == page.evaluate("() => window.pinsing.view.frame.links[5]")[:3]
    # Printed it has its picture, and all of its panel.
    page.emulate_media(media="print")
    page.evaluate("() => window.dispatchEvent(new Event('beforeprint'))")
    shown = pixels(page.locator("#stage").screenshot())
    assert near(shown, BLUE) > 200
    assert near(shown, PINK) > 60
    assert page.locator("#player").is_hidden()
    panel = page.locator("#panel").bounding_box()
    assert panel["height"] > 500  # all of it, and not what fits a screen
    page.evaluate("() => window.dispatchEvent(new Event('afterprint'))")
    assert page.locator("#printed canvas").count() == 0


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


def test_the_static_page_opens_from_a_file(page: Any, addresses: Any) -> None:
    open_page(page, addresses("file", "scara"))
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
        nested, meshes = page.evaluate(
            """() => { const materials = [];
                 const keep = (o) => { if (o.isMesh) materials.push(o.material); };
                 window.pinsing.view.node("arm").traverse(keep);
                 const nested = materials.flat().filter((m) => Array.isArray(m));
                 return [nested.length, materials.length]; }"""
        )
        assert nested == 0
        assert meshes > 7
        with_meshes = picture(page)
        page.evaluate("() => window.pinsing.view.set('visual', false)")
        assert (np.abs(picture(page) - with_meshes).sum(axis=-1) > 30).mean() > 0.02


@pytest.mark.slow
def test_the_nearest_of_listed_poses_where_no_family_is_known(page: Any, addresses: Any) -> None:
    """A search that finds single poses, and no condition, leaves entries without a family."""
    open_page(page, addresses("file", "scara"))
    page.evaluate("() => { window.pinsing.page.engine.families = []; }")
    listed = page.evaluate("() => window.pinsing.page.entries.flatMap((e) => e.q)")
    # A turn is no way.
    beside = np.add(listed[-1], [2 * np.pi + 0.01, -0.02, 0.001, 0.01])
    page.evaluate("(q) => { window.pinsing.go(q); }", beside.tolist())
    page.locator("#nearest-pose").click()
    until(page, "#status", "Singular")
    np.testing.assert_allclose(q_of(page), listed[-1], atol=1e-9)
    assert "nearest that is listed" in text(page, "#playing")
    page.evaluate("() => { window.pinsing.page.entries.forEach((e) => { e.into = false; }); }")
    page.evaluate("() => { window.pinsing.go([0.3, 0.4, 0.05, 0.5]); }")
    page.locator("#nearest-pose").click()
    assert text(page, "#playing") == "no singular pose was found"


# The legend is put where the label is, which goes elsewhere.
COVER = """([label, legend]) => {
  const { x, y } = label.getBoundingClientRect(), { view } = window.pinsing;
  Object.assign(legend.style, { left: `${x - 5}px`, top: `${y - 5}px`, right: "auto" });
  view.labels.place(view.viewer.camera); }"""


@pytest.mark.slow
def test_the_legend_never_covers_the_label(page: Any, addresses: Any) -> None:
    for width in (1280, 400):
        page.set_viewport_size({"width": width, "height": 800})
        open_page(page, addresses("live", "named"))
        parts = [page.locator(name) for name in ("#label-lost", "#legend")]
        for _ in range(5):
            page.locator("#next").click()
            page.wait_for_timeout(150)
            page.evaluate(COVER, [part.element_handle() for part in parts])
            label, legend = (p.is_visible() and [*p.bounding_box().values()] for p in parts)
            assert not (label and Bbox.from_bounds(*label).overlaps(Bbox.from_bounds(*legend)))


@pytest.mark.slow
def test_a_pose_at_rest_is_told_its_distance_for_sure(page: Any, tmp_path: Path) -> None:
    open_page(page, saved(tmp_path, load("panda")))
    # Without the work of a frame there is more to do at rest.
    q = [0.3, -0.6, 0.8, -1.4, 0.6, 1.9, 0.2]
    less = """(q) => { const { engine } = window.pinsing;
      window.pinsing.compute = (x) => ({ ...Engine.frameAt(engine, x),
        verdict: Engine.nearestFamily(engine, x, engine.families, 0) });
      window.pinsing.go(q); }"""
    page.evaluate(less, q)
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
    open_page(page, saved(tmp_path, form.loaded, form.families, zones=found))
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
    open_page(page, saved(tmp_path, form.loaded, form.families, zones=tube))
    assert "lie within 5.8° of one of them (17.2° where two" in text(page, "#joints-note")
    for wrist, wide in ((0.5, 0.1), (0.15, 0.2)):  # far from it, and where it and the elbow meet
        q = [0, -1.2, 1, -1, wrist, 0]
        red = page.evaluate("(q) => window.pinsing.zones(q)", q)[2]
        (elbow,) = [b for b in red if b[0] < 0 < b[1]]
        assert elbow == pytest.approx([-wide, wide], abs=0.03)


def step_through(page: Any) -> None:
    """By buttons and keys, both ways and around the end."""
    until(page, "#playing", "F1, pose 1 of 3")
    for step, said in [
        ("ArrowRight", "F1, pose 2"), ("#next", "F1, pose 3"), ("n", "F2, pose 1"),
        ("ArrowLeft", "F1, pose 3"), ("#prev", "F1, pose 2"), ("p", "F1, pose 1"),
        ("p", "F3, pose 3"),
    ]:  # fmt: skip
        page.locator(step).click() if step[0] == "#" else page.keyboard.press(step)
        until(page, "#playing", said)


def click_a_family(page: Any) -> None:
    # Left while a path into it is still to be computed.
    page.evaluate("() => { const a = window.pinsing; a.play('into'); a.go(a.view.frame.q); }")
    page.locator(".entry").nth(2).click()
    until(page, "#nearest", "on F3")


def approach(page: Any) -> None:
    page.locator(".chosen .into").click()
    page.wait_for_function("() => window.pinsing.path?.kind === 'into'")
    page.evaluate("() => { window.pinsing.pause(); window.pinsing.at(0); }")
    assert text(page, "#status") == "Regular"
    page.evaluate("() => window.pinsing.at(1e9)")
    assert text(page, "#status") == "Singular"


def move_within(page: Any) -> None:
    page.locator(".chosen .along").click()
    page.wait_for_function("() => window.pinsing.path?.kind === 'along'")
    statuses = page.evaluate("() => window.pinsing.path.frames.map((f) => f.status)")
    assert set(statuses) == {"singular"}
    page.keyboard.press("Space")  # on the button that was clicked: the same once more is an end
    page.wait_for_function("() => !window.pinsing.running")
    page.wait_for_timeout(300)
    assert not page.evaluate("() => window.pinsing.running")  # and it does not begin anew


def meet_another_family(page: Any) -> None:
    page.locator(".chosen .meet").first.click()
    until(page, "#playing", "meet, pose 1")
    arm = load("stanford")
    name, other = text(page, "#playing").split("where ")[1].split(" meet")[0].split(" and ")
    q = q_of(page)
    on = {f.name for f in closed_form(arm).families if bool(f.contains(q))}
    assert {name, other} <= on
    assert arm.within_limits(q)
    assert at(arm, q).rank <= 5


def drag(page: Any) -> None:
    page.locator(".joint input[type=range]").nth(4).fill("1.2")
    page.locator(".joint input[type=range]").nth(1).fill("0.9")
    until(page, "#nearest", "from")
    np.testing.assert_allclose(q_of(page)[[1, 4]], [0.9, 1.2])


# The grip is where the tip is drawn, which is some pictures after a pose.
DRAWN = """() => {
  const { drag, view } = window.pinsing, box = drag.grip.getBoundingClientRect();
  const [x, y] = drag.pixels(view.frame.tip, view.viewer.camera);
  return Math.hypot(box.x + box.width / 2 - x, box.y + box.height / 2 - y) < 1;
}"""


def pull(page: Any, dx: float, dy: float) -> np.ndarray:
    """Drag the tip by a real pointer; where it was, where it is, and where it should be."""
    page.wait_for_function(DRAWN)
    box = page.locator("#grip").bounding_box()
    before = page.evaluate("() => window.pinsing.view.frame.tip")
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + dx, y + dy, steps=6)
    page.wait_for_timeout(700)
    goal = page.evaluate("() => window.pinsing.drag.goal")
    page.mouse.up()
    return np.array([before, page.evaluate("() => window.pinsing.view.frame.tip"), goal])


def drag_the_tip(page: Any) -> None:
    page.evaluate("() => window.pinsing.go([0.2, 0.8, 0.5, 0.3, 0.9, 0])")
    turned = "() => window.pinsing.hold(window.pinsing.view.frame.q)"
    rotation = page.evaluate(turned)
    before, after, goal = pull(page, -40, 30)
    assert np.linalg.norm(goal - before) > 0.01
    np.testing.assert_allclose(after, goal, atol=2e-3)
    np.testing.assert_allclose(page.evaluate(turned), rotation, atol=1e-3)
    # Farther than it reaches it lags, says so, and no joint leaves its limits.
    _, after, goal = pull(page, -300, -280)
    assert np.linalg.norm(goal - after) > 0.1
    assert "mm behind" in text(page, "#playing")
    assert load("stanford").within_limits(q_of(page))
    # Along a motion that is lost the tip stays where it is.
    page.evaluate("() => window.pinsing.go([0.2, 0, 0.5, 0.3, 0.9, 0])")
    lost = """() => { const { engine } = window.pinsing.page, q = [0.2, 0, 0.5, 0.3, 0.9, 0];
      const frame = Engine.frameAt(engine, q), tip = frame.tip;
      return [frame.status, ...[0, 1, 2].map((k) => Engine.ledTip(engine, q,
        tip.map((v, i) => v + (i === k ? 0.1 : 0)), Engine.tipRotation(engine, q)).left)]; }"""
    status, *left = page.evaluate(lost)
    assert status == "singular"
    assert max(left) > 0.05 > 4 * min(left)


def type_and_step(page: Any) -> None:
    def typed(joint: int, keys: str) -> Any:
        field = page.locator(".typed").nth(joint)
        field.fill(keys)
        field.press("Enter")
        return field

    standing = "(v) => Math.abs(window.pinsing.view.frame.q[1] * 180 / Math.PI - v) < 1e-6"
    for keys, degrees in [("30,5", 30.5), ("12", 12), ("-7.25\u00b0", -7.25)]:
        typed(1, keys)
        page.wait_for_function(standing.replace("1e-6", "1e-9"), arg=degrees)
    page.locator(".joint input[type=range]").nth(1).focus()
    for keys, degrees in [("ArrowRight", -6.25), ("Shift+ArrowLeft", -6.35)]:
        page.keyboard.press(keys)
        page.wait_for_function(standing, arg=degrees)
    field = typed(1, "half")
    until(page, "#playing", "half is not a number")
    assert field.input_value() == "-6.35"
    typed(2, "45\u00b0")
    until(page, "#playing", "45\u00b0 is not a number")


def nearest_and_back(page: Any) -> None:
    drag(page)
    there_and_back(page, ("#status", "Singular"), ("#nearest", "from"))


def there_and_back(page: Any, there: tuple[str, str], back: tuple[str, str]) -> None:
    before = q_of(page)
    for said in (there, back):
        page.locator("#nearest-pose").click()
        until(page, *said)
    np.testing.assert_array_equal(q_of(page), before)


def clearest(page: Any) -> None:
    page.locator("#clearest-pose").click()
    until(page, "#playing", "at least")
    assert text(page, "#status") == "Regular"


def take_the_pose(page: Any) -> None:
    drag(page)
    kinds = "['flag', 'python', 'json', 'link']"
    said = page.evaluate(f"() => {kinds}.map((k) => window.pinsing.take.text(k))")
    q = q_of(page).round(9)
    np.testing.assert_allclose([float(x) for x in said[0].removeprefix("--q=").split(",")], q)
    space: dict[str, Any] = {"np": np}
    exec(said[1], space)
    np.testing.assert_allclose(space["q"], q)
    np.testing.assert_allclose(json.loads(said[2])["q"], q, atol=1e-9)
    assert said[3].split("#q=")[1] == said[0].removeprefix("--q=")
    page.locator("#copy").click()
    until(page, "#copied", said[0])


def follow_an_address_and_go_back(page: Any) -> None:
    for k in (1, 2):
        page.evaluate("(k) => { location.hash = `q=0.${k},0.5,0.3,0.2,0.7,0`; }", k)
        page.wait_for_function("(k) => window.pinsing.view.frame.q[0] === k / 10", arg=k)
    page.go_back()
    page.wait_for_function("() => window.pinsing.view.frame.q[0] === 0.1")
    page.evaluate("() => { location.hash = 'q=1,2'; }")
    until(page, "#playing", "2 values; this robot has 6 joints")


def save_a_picture(page: Any) -> None:
    with page.expect_download() as caught:
        page.locator("#save-picture").click()
    assert caught.value.suggested_filename == "stanford.png"
    assert Path(caught.value.path()).read_bytes()[:4] == b"\x89PNG"


def give(page: Any, name: str, content: str) -> None:
    page.locator("#path-file").set_input_files(
        {"name": name, "mimeType": "text/csv", "buffer": content.encode()}
    )


def open_a_path(page: Any) -> None:
    rows = (f"0.1,{x:.2f},0.3,0.2,0.7,0" for x in np.linspace(-0.55, 0.35, 10))
    give(page, "way.csv", "\n".join(rows))
    until(page, "#path-verdict", "way.csv: ")
    assert text(page, "#path-verdict").split()[1] in ("crosses", "meets")  # by command, by page
    assert page.locator("#path-box.singular").is_visible()
    assert page.locator("#spans .meets").count() == 1
    assert text(page, "#clock") == "sample 0 of 9"
    assert text(page, "#status") == "Regular"
    for _ in range(2):  # also after the arm was moved by hand
        page.locator("#path-stops .meets").click()
        until(page, "#status", "Singular")
        assert text(page, "#clock") == "sample 5.5 of 9"
        drag(page)
    # A bad one is said to be, and leaves what is there.
    give(page, "bad.csv", "1,2,3")
    until(page, "#playing", "bad.csv: ")
    assert "columns" in text(page, "#playing")
    if page.locator("#path-units").is_hidden():  # no program behind the page
        assert text(page, "#playing").endswith("pinsing check ROBOT FILE -o page.html")
    give(page, "degrees.csv", "0,-90,0.3,90,45,0")
    until(page, "#playing", "degrees")
    assert text(page, "#path-verdict").startswith("way.csv")
    give(page, "beyond.csv", "0,7,0.3,0.2,0.7,0")
    until(page, "#path-verdict", "beyond.csv: ")
    assert "limits" in text(page, "#path-box")
    page.evaluate("""() => {
      const transfer = new DataTransfer();
      transfer.items.add(new File(["1,2"], "dropped.csv"));
      document.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer })); }""")
    until(page, "#playing", "dropped.csv: ")


def look_at_parts(page: Any) -> None:
    below = page.evaluate("""() => {
      const of = (what) => document.querySelector(`.named ${what}`), limits = of(".limits");
      const pad = parseFloat(getComputedStyle(limits).paddingTop);
      const [low, high] = [limits, of(".typed")].map((e) => e.getBoundingClientRect());
      return low.top + pad - high.bottom; }""")
    assert below >= 0  # the line under a value does not cross its limits
    size = page.viewport_size
    page.set_viewport_size({"width": 768, "height": 1024})
    gaps = page.evaluate("""() => {
      const busy = document.querySelector("#busy").cloneNode();
      document.querySelector("#busy").after(busy);
      Object.assign(busy, { hidden: false, className: "aside", textContent: "loading shapes" });
      const { top, bottom } = busy.getBoundingClientRect();
      busy.remove();
      const of = (what) => document.querySelector(what).getBoundingClientRect();
      return [top - of("#legend").bottom, of("#player").top - bottom]; }""")
    assert min(gaps) >= 0  # what the page is busy with covers neither legend nor player
    page.set_viewport_size(size)
    page.locator("#show-bone").check()
    page.locator("#show-axes").check()
    page.locator("input[name=mode][value=all]").check()
    until(page, "#key-translation", "whatever the rotation")


ACTIONS = [
    step_through, click_a_family, approach, move_within, meet_another_family, drag,
    nearest_and_back, clearest, take_the_pose, follow_an_address_and_go_back, save_a_picture,
    open_a_path, look_at_parts, drag_the_tip, type_and_step,
]  # fmt: skip


def linkage_nearest(page: Any) -> None:
    there_and_back(page, ("#status", "singularity"), ("#status", "Regular"))


def linkage_text(page: Any) -> None:
    said = page.evaluate("() => ['flag', 'link', 'json'].map((k) => window.pinsing.take.text(k))")
    q = q_of(page)
    inputs = [float(x) for x in said[0].removeprefix("--q=").split(",")]
    assert inputs == pytest.approx(q[[0, 2]], abs=1e-9)
    assert len(said[1].split("#q=")[1].split(",")) == 4
    assert json.loads(said[2])["inputs"] == ["q1", "q2"]


def linkage_path(page: Any) -> None:
    rows = "q2,q1\n" + "\n".join(f"1.0,{x:.3f}" for x in np.linspace(1.0, 1.2, 9))
    give(page, "way.csv", rows)
    until(page, "#playing", "9 samples")
    frames = page.evaluate("() => window.pinsing.path.frames.map((f) => [f.q[0], f.q[2]])")
    np.testing.assert_allclose(frames[-1], [1.2, 1.0], atol=1e-9)


def linkage_drag_output(page: Any) -> None:
    page.evaluate("() => window.pinsing.go(window.pinsing.page.engine.home)")
    before, after, goal = pull(page, 12, 8)
    assert np.linalg.norm(after - before) > 0.005
    np.testing.assert_allclose(after[:2], goal[:2], atol=1e-6)


LINKAGE = [
    linkage_drag_output, linkage_nearest, clearest, linkage_text, linkage_path,
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("how", ["file", "live", "one after the other"])
@pytest.mark.parametrize(("of", "actions"), [("arm", ACTIONS), ("mechanism", LINKAGE)])
def test_every_action_works(page: Any, addresses: Any, of: str, actions: Any, how: str) -> None:
    """Each on a page just opened, or all on the same page, which ends if an error comes."""
    afresh = how != "one after the other"
    for k, action in enumerate(actions):
        # From where the others have led it, its first sample is not reached in its mode.
        if afresh or k == 0 or action is linkage_path:
            page.goto("about:blank")
            open_page(page, addresses(how if afresh else "file", of))
        action(page)


@pytest.mark.slow
def test_a_linkage_that_comes_to_rest_twice_is_told_its_own_ranges(
    page: Any, addresses: Any
) -> None:
    """As where a path is played and paused at one frame: answers to one went to the other."""
    open_page(page, addresses("file", "mechanism"))
    rests = """async (gap) => {
      const app = window.pinsing, after = new Promise((done) => setTimeout(done, gap));
      await Promise.all([app.rest(app.view.frame), after.then(() => app.rest(app.view.frame))]);
      return [...document.querySelectorAll(".joint")].map((row) => row.title); }"""
    told = [page.evaluate(rests, gap) for gap in (1000, 20, 150)]
    assert told[0] == told[1] == told[2]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["arm", "mechanism"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_has_no_serious_finding(page, addresses, kind, scheme):
    page.emulate_media(color_scheme=scheme)
    for width in (1280, 400):
        page.set_viewport_size({"width": width, "height": 800})
        if page.url == "about:blank" or scheme == "dark":  # wider and narrower, and afresh
            open_page(page, addresses("file", kind))
        page.wait_for_function("(w) => window.innerWidth === w", arg=width)
        assert serious_findings(page) == []


@pytest.mark.slow
def test_a_live_page_reads_files_as_the_command_line_does(page: Any, tmp_path: Path) -> None:
    """Degrees named in the head, decimal commas; the first line is that of `pinsing check`."""
    rows = "\n".join(f"{t};0;{-90 + 9 * t};80;10;{20 - 10 * t},5;5" for t in range(5))
    content = "time;" + ";".join(f"J{k} (deg)" for k in range(1, 7)) + "\n" + rows
    file = tmp_path / "tour.csv"
    file.write_text(content)
    said = run("check", "ur5", file).stdout.splitlines()
    with Viewer(load("ur5"), skeleton=True) as viewer:
        open_page(page, viewer.url)
        give(page, "tour.csv", content)
        until(page, "#path-verdict", "tour.csv: crosses the wrist singularity")
        assert text(page, "#path-verdict") == said[0]
        until(page, "#path-notes", "decimal commas")
        page.locator("#path-stops .meets").click()
        assert text(page, "#status") == "Singular"
        assert text(page, "#clock") == "2.05 of 4.00 s"
        assert "0° from" in text(page, "#nearest") or "on F2" in text(page, "#nearest")
