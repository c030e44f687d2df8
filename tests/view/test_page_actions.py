"""What one can do on the page: one list of actions, on the live page and on the one from a file.

Needs Chromium (or Chrome) and Playwright for Python; without them the tests are skipped.
"""

import contextlib
import functools
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import open_page, q_of, require_browser, text, until
from command_line import run
from mechanisms import analyzed, shipped

from pinsing import at, closed_form
from pinsing.robot.load import load
from pinsing.view import Viewer
from pinsing.view.mechanism_viewer import MechanismViewer

require_browser()


MAKE: dict[str, Callable[[], Viewer | MechanismViewer]] = {
    "arm": lambda: Viewer(load("stanford")),
    "mechanism": lambda: MechanismViewer(shipped("five_bar"), analyzed("five_bar")),
}


class Addresses(dict[str, str]):
    """Address of a page of an arm or of a mechanism, made when first asked for."""

    def __init__(self, live: bool, viewer: Callable[[str], Any], folder: Path) -> None:
        super().__init__()
        self.live, self.viewer, self.folder = live, viewer, folder

    def __missing__(self, name: str) -> str:
        file = self.folder / f"{name}.html"
        viewer = self.viewer(name)
        if not self.live:
            viewer.save_html(file)
        self[name] = viewer.url if self.live else file.as_uri()
        return self[name]


@pytest.fixture(scope="module")
def addresses(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, dict[str, str]]]:
    """Address of each kind of page, of an arm and of a mechanism."""
    folder = tmp_path_factory.mktemp("pages")
    with contextlib.ExitStack() as opened:
        viewer = functools.cache(lambda name: opened.enter_context(MAKE[name]()))
        yield {kind: Addresses(kind == "live", viewer, folder) for kind in ("file", "live")}


@pytest.fixture(params=["file", "live"])
def pages(request: pytest.FixtureRequest, addresses: dict[str, dict[str, str]]) -> dict[str, str]:
    return addresses[request.param]


def step_through(page: Any) -> None:
    """By buttons and keys, both ways and around the end."""
    until(page, "#playing", "F1, pose 1 of 3")
    for step, said in [
        ("ArrowRight", "F1, pose 2"),
        ("#next", "F1, pose 3"),
        ("n", "F2, pose 1"),
        ("ArrowLeft", "F1, pose 3"),
        ("#prev", "F1, pose 2"),
        ("p", "F1, pose 1"),
        ("p", "F3, pose 3"),
    ]:
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
    field = page.locator(".typed").nth(1)
    for keys, degrees in [("30,5", 30.5), ("12", 12), ("-7.25\u00b0", -7.25)]:
        field.fill(keys)
        field.press("Enter")
        page.wait_for_function(
            "(v) => Math.abs(window.pinsing.view.frame.q[1] * 180 / Math.PI - v) < 1e-9",
            arg=degrees,
        )
    page.locator(".joint input[type=range]").nth(1).focus()
    for keys, degrees in [("ArrowRight", -6.25), ("Shift+ArrowLeft", -6.35)]:
        page.keyboard.press(keys)
        page.wait_for_function(
            "(v) => Math.abs(window.pinsing.view.frame.q[1] * 180 / Math.PI - v) < 1e-6",
            arg=degrees,
        )
    field.fill("half")
    field.press("Enter")
    until(page, "#playing", "half is not a number")
    assert field.input_value() == "-6.35"
    slide = page.locator(".typed").nth(2)
    slide.fill("45\u00b0")
    slide.press("Enter")
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
    give(
        page,
        "way.csv",
        "\n".join(f"0.1,{x:.2f},0.3,0.2,0.7,0" for x in np.linspace(-0.55, 0.35, 10)),
    )
    until(page, "#path-verdict", "way.csv: crosses")
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


def linkage_drag(page: Any) -> None:
    before = q_of(page)
    page.locator(".joint input[type=range]").nth(0).fill("1.2")
    page.wait_for_function("() => window.pinsing.view.frame.q[0] === 1.2")
    assert np.abs(q_of(page) - before).max() > 0.05


def linkage_nearest(page: Any) -> None:
    there_and_back(page, ("#status", "singularity"), ("#status", "Regular"))


def linkage_clearest(page: Any) -> None:
    page.locator("#clearest-pose").click()
    until(page, "#playing", "at least")


def linkage_text(page: Any) -> None:
    said = page.evaluate("() => ['flag', 'link', 'json'].map((k) => window.pinsing.take.text(k))")
    q = q_of(page)
    assert [float(x) for x in said[0].removeprefix("--q=").split(",")] == pytest.approx(
        q[[0, 2]], abs=1e-9
    )
    assert len(said[1].split("#q=")[1].split(",")) == 4
    assert json.loads(said[2])["inputs"] == ["q1", "q2"]


def linkage_path(page: Any) -> None:
    rows = "q2,q1\n" + "\n".join(f"1.0,{x:.3f}" for x in np.linspace(1.0, 1.2, 9))
    csv = {"name": "way.csv", "mimeType": "text/csv", "buffer": rows.encode()}
    page.locator("#path-file").set_input_files(csv)
    until(page, "#playing", "9 samples")
    frames = page.evaluate("() => window.pinsing.path.frames.map((f) => [f.q[0], f.q[2]])")
    np.testing.assert_allclose(frames[-1], [1.2, 1.0], atol=1e-9)


def linkage_drag_output(page: Any) -> None:
    page.evaluate("() => window.pinsing.go(window.pinsing.page.engine.home)")
    before, after, goal = pull(page, 12, 8)
    assert np.linalg.norm(after - before) > 0.005
    np.testing.assert_allclose(after[:2], goal[:2], atol=1e-6)


LINKAGE = [
    linkage_drag, linkage_drag_output, linkage_nearest, linkage_clearest, linkage_text,
    linkage_path,
]  # fmt: skip


def run_all(page, address, actions, afresh=True):
    """Each on a page just opened, or one after the other on the same page."""
    broken: list[str] = []
    page.on("pageerror", lambda error: broken.append(str(error)))
    for k, action in enumerate(actions):
        if afresh or k == 0:
            page.goto("about:blank")
            open_page(page, address)
        action(page)
        assert not broken, (action.__name__, broken)


@pytest.mark.slow
def test_every_action_works_on_an_arm(page: Any, pages: dict[str, str]) -> None:
    run_all(page, pages["arm"], ACTIONS)


@pytest.mark.slow
def test_every_action_works_on_a_mechanism(page: Any, pages: dict[str, str]) -> None:
    run_all(page, pages["mechanism"], LINKAGE)


@pytest.mark.parametrize(
    ("kind", "actions"),
    [
        pytest.param("arm", ACTIONS, id="arm", marks=pytest.mark.slow),
        pytest.param("mechanism", LINKAGE[:-1], id="mechanism", marks=pytest.mark.slow),
        # From where the others have led it, its first sample is not reached in the mode it is in.
        pytest.param("mechanism", LINKAGE[-1:], id="path of a mechanism", marks=pytest.mark.slow),
    ],
)
def test_actions_work_one_after_the_other(page, addresses, kind, actions):
    run_all(page, addresses["file"][kind], actions, afresh=False)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["arm", "mechanism"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_has_no_serious_finding(page, addresses, kind, scheme):
    package = pytest.importorskip("axe_core_python", reason="needs axe-core-python")
    axe = (Path(package.__file__).parent / "axe.min.js").read_text(encoding="utf-8")
    page.emulate_media(color_scheme=scheme)
    for size in ((1280, 800), (400, 800)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        if page.url == "about:blank" or scheme == "dark":  # wider and narrower, and afresh
            open_page(page, addresses["file"][kind])
            page.evaluate(axe)
        page.wait_for_function("(w) => window.innerWidth === w", arg=size[0])
        found = page.evaluate("() => axe.run()")["violations"]
        serious = [(v["id"], v["nodes"][0]["target"]) for v in found
                   if v["impact"] in ("serious", "critical")]  # fmt: skip
        assert not serious


@pytest.mark.slow
def test_whoever_wants_no_motion_gets_the_end_of_it(page, addresses):
    page.emulate_media(reduced_motion="reduce")
    open_page(page, addresses["file"]["arm"])
    page.locator(".chosen .into").click()
    page.wait_for_function("() => window.pinsing.path?.kind === 'into'")
    assert page.evaluate("() => window.pinsing.running") is False
    assert text(page, "#status") == "Singular"
    assert page.locator("#scrub").is_enabled()


@pytest.mark.slow
def test_a_live_page_reads_files_as_the_command_line_does(page: Any, tmp_path: Path) -> None:
    """Degrees named in the head, decimal commas; the first line is that of `pinsing check`."""

    rows = "\n".join(f"{t};0;{-90 + 9 * t};80;10;{20 - 10 * t},5;5" for t in range(5))
    content = "time;" + ";".join(f"J{k} (deg)" for k in range(1, 7)) + "\n" + rows
    file = tmp_path / "tour.csv"
    file.write_text(content)
    said = run("check", "ur5", str(file)).stdout.splitlines()
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
