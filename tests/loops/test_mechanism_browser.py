"""A mechanism's tab in a real browser: it is dragged, put into modes, led to its singularities.

Needs Chromium (or Chrome) and Playwright for Python; without them the tests are skipped.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from chromium import open_page, picture, q_of, require_browser, text, until
from mechanisms import analyzed, shipped

from pinsing.loops import home, residual
from pinsing.view.mechanism_viewer import MechanismViewer

require_browser()

NAMES = ["five_bar", "four_bar", "planar_3rrr"]
# The quick tier drives one of them; the slow one all.
FIRST = ["five_bar", *(pytest.param(name, marks=pytest.mark.slow) for name in NAMES[1:])]


class Viewers(dict[str, MechanismViewer]):
    """A viewer of each mechanism, opened when first asked for."""

    def __missing__(self, name: str) -> MechanismViewer:
        self[name] = MechanismViewer(shipped(name), analyzed(name))
        return self[name]


@pytest.fixture(scope="module")
def viewers() -> Iterator[dict[str, MechanismViewer]]:
    opened = Viewers()
    yield opened
    for viewer in opened.values():
        viewer.close()


@pytest.fixture
def five_bar(viewers: dict[str, MechanismViewer]) -> MechanismViewer:
    return viewers["five_bar"]


def settled(page: Any) -> None:
    """Wait until what surrounds the pose shown is known."""
    page.wait_for_function("() => window.pinsing.known === window.pinsing.view.frame")


def open_at_home(page: Any, viewer: MechanismViewer) -> None:
    viewer.show(home(viewer.mechanism))
    open_page(page, viewer.url)
    settled(page)


def drag(page: Any, joint: int, degrees: float) -> None:
    """Move a slider as a hand does, and let go."""
    page.evaluate(
        """([k, v]) => { const { slider } = window.pinsing.panel.rows[k]; slider.value = v;
             slider.dispatchEvent(new Event("input")); }""",
        [joint, np.radians(degrees)],
    )
    page.wait_for_function("() => window.pinsing.wanted === null")
    page.evaluate(
        "(k) => window.pinsing.panel.rows[k].slider.dispatchEvent(new Event('change'))", joint
    )


def reached(page: Any, q: np.ndarray) -> None:
    """Wait until the mechanism is at a configuration, whole turns aside."""
    page.wait_for_function(
        """(q) => window.pinsing.view.frame.q.every(
             (v, i) => Math.abs(Math.sin((v - q[i]) / 2)) < 1e-9)""",
        arg=q.tolist(),
    )


def slider(page: Any, joint: int) -> float:
    script = "(k) => Number(window.pinsing.panel.rows[k].slider.value)"
    return float(np.degrees(page.evaluate(script, joint)))


@pytest.mark.parametrize("name", FIRST)
def test_the_page_loads_and_shows_a_mechanism(
    page: Any, viewers: dict[str, MechanismViewer], name: str
) -> None:
    viewer = viewers[name]
    open_at_home(page, viewer)
    mechanism = viewer.mechanism
    assert text(page, "#robot") == name
    assert text(page, "#status") == "Regular"
    assert "assembly +" in text(page, "#rank")
    assert "is nearest" in text(page, "#nearest")
    assert page.locator("#entries > li").count() == len(viewer.groups)
    sliders = page.locator(".joint:not(.pose-row) input[type=range]")
    assert sliders.count() == mechanism.n
    enabled = [sliders.nth(i).is_enabled() for i in range(mechanism.n)]
    assert enabled == [i < len(mechanism.inputs) for i in range(mechanism.n)]
    assert page.locator(".joint:not(.pose-row) .band .reach").count() == len(mechanism.inputs)
    assert page.locator(".pose-row .band .reach").count() > 0
    assert picture(page).std() > 10
    # Seen as a whole: no joint is outside of the picture.
    where = page.evaluate(
        """() => window.pinsing.view.frame.links.map((l) => new MeshCat.THREE.Vector3(
             l[0], l[2], -l[1]).project(window.pinsing.view.viewer.camera).toArray())"""
    )
    assert np.abs(np.array(where)[:, :2]).max() < 1


def lead(page: Any, k: int, value: float) -> None:
    """Move a slider of the output's pose as a hand does, and let go."""
    page.evaluate(
        """([k, v]) => { const { slider: s } = window.pinsing.panel.rows.slice(-2)[k]; s.value = v;
             s.dispatchEvent(new Event("input")); }""",
        [k, value],
    )
    page.wait_for_function("() => window.pinsing.wanted === null")


@pytest.mark.slow
def test_the_output_is_led_by_sliders_of_its_pose(page: Any, five_bar: MechanismViewer) -> None:
    mechanism = five_bar.mechanism
    open_at_home(page, five_bar)
    x, y = page.evaluate("() => window.pinsing.view.frame.pose")
    lead(page, 0, x - 0.2)
    tip = page.evaluate("() => window.pinsing.view.frame.tip")
    np.testing.assert_allclose(tip[:2], [x - 0.2, y], atol=1e-10)
    assert np.abs(residual(mechanism, q_of(page))).max() < 1e-10
    assert text(page, "#refused") == ""
    assert "mm" in page.locator(".pose-row .value").first.inner_text()
    settled(page)
    assert page.locator(".pose-row .band .reach").count() == 2
    # Where it cannot go on it stops, says why, and its slider goes back.
    lead(page, 1, 2.5)
    assert text(page, "#refused").startswith("infeasible: y = ")
    assert "type 1 singularity: the leg of q" in text(page, "#refused").replace("\n", "")
    assert np.abs(residual(mechanism, q_of(page))).max() < 1e-10
    page.evaluate(
        "() => window.pinsing.panel.rows.at(-1).slider.dispatchEvent(new Event('change'))"
    )
    reached_y = page.evaluate("() => window.pinsing.view.frame.pose[1]")
    value = page.evaluate("() => Number(window.pinsing.panel.rows.at(-1).slider.value)")
    assert value == pytest.approx(reached_y, abs=1e-6)
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
    drag(page, 0, slider(page, 0) - 10)
    settled(page)
    assert "is nearest" in text(page, "#nearest")
    assert page.locator(".pose-row .band .reach").count() == 2


@pytest.mark.slow
@pytest.mark.parametrize("name", FIRST)
def test_clicking_a_singular_pose_tells_its_type(
    page: Any, viewers: dict[str, MechanismViewer], name: str
) -> None:
    viewer = viewers[name]
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


@pytest.mark.parametrize("name", [FIRST[0], FIRST[2]])
@pytest.mark.slow
def test_an_infeasible_input_is_said_and_the_mechanism_stays(
    page: Any, viewers: dict[str, MechanismViewer], name: str
) -> None:
    viewer = viewers[name]
    mechanism = viewer.mechanism
    open_at_home(page, viewer)
    joint = mechanism.actuated[0]
    end = float(np.degrees(page.evaluate("() => window.pinsing.stretches[0].upper")))
    start = slider(page, joint)
    drag(page, joint, end + 15)
    assert (
        text(page, "#refused")
        .replace("\n", "")
        .startswith(f"infeasible: {mechanism.inputs[0]} = {end + 15:.1f}°")
    )
    assert f"{end:.2f}°" in text(page, "#refused")
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
    other = groups.nth(1).locator("option")
    labels = [label for label in other.all_inner_texts() if label != here]
    menu.select_option(label=labels[0])
    until(page, "#rank", labels[0])
    np.testing.assert_allclose(page.evaluate("() => window.pinsing.view.frame.tip"), tip, atol=1e-4)
    assert np.abs(q_of(page) - after)[[0, 2]].max() > 0.1


@pytest.mark.slow
def test_beyond_half_a_turn_the_slider_goes_on(page: Any, five_bar: MechanismViewer) -> None:
    open_at_home(page, five_bar)
    joint = five_bar.mechanism.actuated[1]
    for value in (120, 170, 200, 225):  # feasible up to 231.9 degrees
        drag(page, joint, value)
        assert slider(page, joint) == pytest.approx(value, abs=1e-6)
    assert text(page, "#refused") == ""
    typed = "() => [...document.querySelectorAll('.typed')].map((field) => field.value)"
    assert "225.00" in page.evaluate(typed)
