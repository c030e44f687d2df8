"""A mechanism's tab: list, scene, server, command; in a browser, which needs Playwright, too."""

import contextlib
import functools
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import open_page, picture, q_of, text, until
from command_line import run
from mechanisms import URDF, analyzed, four_bar, shipped
from pages import baked
from tiers import tiered

from pinsing.cli.mechanism import view_loops
from pinsing.errors import ConfigurationError, OptionError, ResultError, UnknownNameError
from pinsing.loops import analyze_mechanism, home, mechanism_at, residual
from pinsing.loops.closure import at_zero, plane_normal
from pinsing.view.mechanism_viewer import MechanismViewer, groups, side
from pinsing.view.tab import SIDE

NAMES = ["five_bar", "four_bar", "planar_3rrr"]


@pytest.fixture(scope="module")
def viewers() -> Iterator[Callable[[str], MechanismViewer]]:
    """A viewer of each mechanism, opened when first asked for."""
    with contextlib.ExitStack() as opened:
        yield functools.cache(
            lambda name: opened.enter_context(MechanismViewer(shipped(name), analyzed(name)))
        )


@pytest.fixture
def five_bar(viewers: Any) -> MechanismViewer:
    return viewers("five_bar")


def test_points_are_listed_by_locus_and_none_is_forgotten() -> None:
    mechanism = shipped("five_bar")
    analysis = analyzed("five_bar")
    listed = groups(mechanism, analysis)
    assert [g.name for g in listed] == [f"L{k}" for k in range(1, len(listed) + 1)]
    assert [g.text for g in listed] == [f"{x.kind}: {x.words}" for x in analysis.forms.loci]
    poses = [p.q for g in listed for p in g.points]
    for point in analysis.points:
        assert min(np.abs(mechanism.fold(q - point.q)).max() for q in poses) < 1e-9
    for group in listed:
        assert all(group.text.startswith(p.kind) for p in group.points)


@pytest.mark.parametrize("name", tiered(NAMES, NAMES[:2]))
def test_a_page_has_what_its_program_asks_for(viewers: Any, name: str) -> None:
    viewer = viewers(name)
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
    for mechanism in (shipped("planar_3rrr"), four_bar(0.4, 0.1, 0.4, 0.3)):
        normal = plane_normal(mechanism, at_zero(mechanism).axis)
        assert normal == pytest.approx([0, 0, 1])
        assert side(normal)[1] > 0.9  # three.js: y is up
    assert side(None) == SIDE


@pytest.mark.slow
def test_python_leads(five_bar: MechanismViewer) -> None:
    five_bar.show_group("L3", pose=1)
    assert mechanism_at(five_bar.mechanism, five_bar.q).kind == "type 1"
    five_bar.show_inputs([1.0, 1.3])
    assert five_bar.q[list(five_bar.mechanism.actuated)] == pytest.approx([1.0, 1.3])
    five_bar.show(home(five_bar.mechanism))
    assert five_bar._start()["entry"] is None
    for act, error, words in (
        (lambda: five_bar.show_group("L9"), UnknownNameError, "L9"),
        (lambda: five_bar.show_group(0, pose=44), OptionError, "pose 44"),
        (lambda: five_bar.play("L1", "sideways"), OptionError, "sideways"),
        (lambda: five_bar.show([0.1, 0.2, 0.3, 0.4]), ConfigurationError, "close them first"),
        (lambda: five_bar.show_inputs(np.radians([100, 60])), ConfigurationError, "they close for"),
        (lambda: MechanismViewer(five_bar.mechanism, scale=0), OptionError, "scale"),
    ):
        with pytest.raises(error, match=words):
            act()


def test_a_model_without_a_file_is_shown_as_a_skeleton() -> None:
    made = four_bar(0.4, 0.1, 0.4, 0.3)
    made = replace(made, source=replace(made.source, path=None, shapes=None))
    with MechanismViewer(made, analyze_mechanism(made, seconds=1e-3)) as viewer:
        assert not viewer._page(live=True)["settings"]["shapes"]


def test_the_command_begins_at_the_inputs_that_are_typed(tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    done = run("view", URDF / "four_bar.urdf", "--loops", "--q", "40", "--deg", "-o", out)
    assert done.exit_code == 0
    assert baked(out.read_text())["start"]["q"][0] == pytest.approx(np.radians(40))


def test_a_saved_analysis_must_be_of_this_mechanism(tmp_path: Path) -> None:
    saved = tmp_path / "saved.json"
    saved.write_text(analyzed("four_bar").to_json())
    with pytest.raises(ResultError, match="not of this mechanism"):
        view_loops(shipped("five_bar"), analysis=saved)
    saved.write_text("{}")
    with pytest.raises(ResultError, match=r"saved\.json: expected data of schema"):
        view_loops(shipped("five_bar"), analysis=saved)


def settled(page: Any) -> None:
    """Wait until what surrounds the pose shown is known."""
    page.wait_for_function("() => window.pinsing.known === window.pinsing.view.frame")


def open_at_home(page: Any, viewer: MechanismViewer) -> None:
    viewer.show(home(viewer.mechanism))
    open_page(page, viewer.url)
    settled(page)


def slider(page: Any, row: int) -> Any:
    """Of a joint; the last are those of the output's pose."""
    return page.evaluate_handle("(k) => window.pinsing.panel.rows.at(k).slider", row)


def slide(page: Any, row: int, value: float) -> None:
    """Move a slider as a hand does that does not let go."""
    move = "(slider, v) => { slider.value = v; slider.dispatchEvent(new Event('input')); }"
    slider(page, row).evaluate(move, value)
    page.wait_for_function("() => window.pinsing.wanted === null")


def drag(page: Any, joint: int, degrees: float) -> None:
    slide(page, joint, np.radians(degrees))
    slider(page, joint).dispatch_event("change")


def reached(page: Any, q: np.ndarray) -> None:
    """Wait until the mechanism is at a configuration, whole turns aside."""
    page.wait_for_function(
        """(q) => window.pinsing.view.frame.q.every(
             (v, i) => Math.abs(Math.sin((v - q[i]) / 2)) < 1e-9)""",
        arg=q.tolist(),
    )


def degrees_of(page: Any, joint: int) -> float:
    return float(np.degrees(float(slider(page, joint).input_value())))


@pytest.mark.parametrize("name", tiered(NAMES, NAMES[:1]))
def test_the_page_loads_and_shows_a_mechanism(page: Any, viewers: Any, name: str) -> None:
    viewer = viewers(name)
    open_at_home(page, viewer)
    mechanism = viewer.mechanism
    assert text(page, "#robot") == name
    assert text(page, "#status") == "Regular"
    assert "assembly +" in text(page, "#rank")
    assert "is nearest" in text(page, "#nearest")
    assert page.locator("#entries > li").count() == len(viewer.groups)
    sliders = page.locator(".joint:not(.pose-row) input[type=range]")
    assert sliders.count() == mechanism.n
    inputs = len(mechanism.inputs)
    enabled = [sliders.nth(i).is_enabled() for i in range(mechanism.n)]
    assert enabled == [i < inputs for i in range(mechanism.n)]
    assert page.locator(".joint:not(.pose-row) .band .reach").count() == inputs
    assert page.locator(".pose-row .band .reach").count() > 0
    assert picture(page).std() > 10
    # Seen as a whole: no joint is outside of the picture.
    where = page.evaluate(
        """() => window.pinsing.view.frame.links.map((l) => new MeshCat.THREE.Vector3(
             l[0], l[2], -l[1]).project(window.pinsing.view.viewer.camera).toArray())"""
    )
    assert np.abs(np.array(where)[:, :2]).max() < 1


@pytest.mark.slow
def test_the_output_is_led_by_sliders_of_its_pose(page: Any, five_bar: MechanismViewer) -> None:
    mechanism = five_bar.mechanism
    open_at_home(page, five_bar)
    x, y = page.evaluate("() => window.pinsing.view.frame.pose")
    slide(page, -2, x - 0.2)
    tip = page.evaluate("() => window.pinsing.view.frame.tip")
    np.testing.assert_allclose(tip[:2], [x - 0.2, y], atol=1e-10)
    assert np.abs(residual(mechanism, q_of(page))).max() < 1e-10
    assert text(page, "#refused") == ""
    assert "mm" in page.locator(".pose-row .value").first.inner_text()
    settled(page)
    assert page.locator(".pose-row .band .reach").count() == 2
    # Where it cannot go on it stops, says why, and its slider goes back.
    slide(page, -1, 2.5)
    said = text(page, "#refused").replace("\n", "")
    assert said.startswith("infeasible: y = ")
    assert "type 1 singularity: the leg of q" in said
    assert np.abs(residual(mechanism, q_of(page))).max() < 1e-10
    slider(page, -1).dispatch_event("change")
    reached_y = page.evaluate("() => window.pinsing.view.frame.pose[1]")
    assert float(slider(page, -1).input_value()) == pytest.approx(reached_y, abs=1e-6)
    # The pose goes with what is copied.
    copied = page.evaluate("() => JSON.parse(window.pinsing.take.text('json'))")
    assert copied["pose"] == pytest.approx({"x": x - 0.2, "y": reached_y}, abs=1e-8)


@pytest.mark.slow
def test_what_takes_long_is_computed_beside_the_page(page: Any, five_bar: MechanismViewer) -> None:
    open_at_home(page, five_bar)
    assert page.evaluate("() => window.pinsing.aside.worker !== null && window.pinsing.aside.able")
    # Where a page may have no worker, it computes by itself.
    page.evaluate(
        """() => { const { aside } = window.pinsing;
             aside.stop(); aside.able = false; aside.worker = null; }"""
    )
    drag(page, 0, degrees_of(page, 0) - 10)
    settled(page)
    assert "is nearest" in text(page, "#nearest")
    assert page.locator(".pose-row .band .reach").count() == 2


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_clicking_a_singular_pose_tells_its_type(page: Any, viewers: Any, name: str) -> None:
    viewer = viewers(name)
    open_at_home(page, viewer)
    for index, group in enumerate(viewer.groups):
        kind = group.text.partition(":")[0]
        page.locator(".entry").nth(index).click()
        reached(page, group.points[0].q)
        assert text(page, "#status") == f"{kind.capitalize()} singularity"
        assert page.locator("#verdict").get_attribute("class") == "singular"
        number = "#one" if kind == "type 1" else "#two"
        assert float(text(page, number)) < 1e-9
        assert text(page, "#lost") != ""
        assert page.locator(".joint.hot").count() > 0
    if len(group.points) > 1:
        page.locator(".chosen .pose").nth(1).click()
        reached(page, group.points[1].q)
        assert text(page, "#playing") == f"{group.name}, pose 2 of {len(group.points)}"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["five_bar", "planar_3rrr"])
def test_an_infeasible_input_is_said_and_the_mechanism_stays(page, viewers, name):
    viewer = viewers(name)
    mechanism = viewer.mechanism
    open_at_home(page, viewer)
    joint = mechanism.actuated[0]
    end = float(np.degrees(page.evaluate("() => window.pinsing.stretches[0].upper")))
    start = degrees_of(page, joint)
    drag(page, joint, end + 15)
    said = text(page, "#refused").replace("\n", "")
    assert said.startswith(f"infeasible: {mechanism.inputs[0]} = {end + 15:.1f}°")
    assert f"{end:.2f}°" in said
    q = q_of(page)
    assert np.degrees(q[joint]) == pytest.approx(end, abs=0.01)
    assert np.abs(residual(mechanism, q)).max() < 1e-9
    # Let go, the slider is where the mechanism is.
    page.wait_for_function(
        "([k, v]) => Math.abs(window.pinsing.panel.rows[k].slider.value - v) < 1e-3",
        arg=[joint, np.radians(end)],
    )
    assert "assembly +" in text(page, "#rank")
    drag(page, joint, start)
    assert text(page, "#refused") == ""
    assert "assembly +" in text(page, "#rank")
    np.testing.assert_allclose(mechanism.fold(q_of(page) - home(mechanism)), 0, atol=1e-6)


@pytest.mark.slow
def test_modes_are_chosen_from_the_menu(page: Any, five_bar: MechanismViewer) -> None:
    open_at_home(page, five_bar)
    menu = page.locator("#mode-menu")
    groups = page.locator("#mode-menu optgroup")
    assert [groups.nth(i).locator("option").count() for i in range(groups.count())] == [2, 4]
    assert menu.locator("option:checked").first.inner_text() == "assembly +, elbows -+"
    before = q_of(page)
    menu.select_option(label="assembly -, elbows -+")
    until(page, "#rank", "assembly -")
    after = q_of(page)
    np.testing.assert_allclose(after[[0, 2]], before[[0, 2]], atol=1e-9)
    assert np.abs(after - before).max() > 0.5
    settled(page)
    # Another working mode: the inputs differ, the output stays.
    tip = page.evaluate("() => window.pinsing.view.frame.tip")
    here = menu.locator("option:checked").first.inner_text()
    labels = groups.nth(1).locator("option").all_inner_texts()
    other = next(label for label in labels if label != here)
    menu.select_option(label=other)
    until(page, "#rank", other)
    np.testing.assert_allclose(page.evaluate("() => window.pinsing.view.frame.tip"), tip, atol=1e-4)
    assert np.abs(q_of(page) - after)[[0, 2]].max() > 0.1


@pytest.mark.slow
def test_beyond_half_a_turn_the_slider_goes_on(page: Any, five_bar: MechanismViewer) -> None:
    open_at_home(page, five_bar)
    joint = five_bar.mechanism.actuated[1]
    for value in (120, 170, 200, 225):  # feasible up to 231.9 degrees
        drag(page, joint, value)
        assert degrees_of(page, joint) == pytest.approx(value, abs=1e-6)
    assert text(page, "#refused") == ""
    typed = "() => [...document.querySelectorAll('.typed')].map((field) => field.value)"
    assert "225.00" in page.evaluate(typed)
