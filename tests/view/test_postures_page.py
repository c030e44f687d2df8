"""The postures of a pose in the page: data, and a click in a real browser."""

from typing import Any

import numpy as np
import pytest
from chromium import open_page, q_of, text
from command_line import run
from dh_arms import dh_text
from pages import baked

import pinsing


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
        listed = viewer._page(False)["postures"]
        assert viewer._start() == {"q": found.q.tolist(), "entry": None, "pose": 0}
    assert len(listed) == 4
    assert np.array_equal(listed[0]["q"], found.q)
    ways = [p for p in listed if p["way"]]
    assert ways
    for shown in ways:
        way = np.array(shown["way"])
        assert np.array_equal(way[0], found.q)
        assert np.abs(arm.space.wrap(way[-1] - np.array(shown["q"]))).max() < 1e-9
        assert "without a singularity" in shown["more"]
        assert np.min(pinsing.clearance(form, way).lower) > 0
    assert sum("only by way of a singularity, proven" in p["more"] for p in listed) == 2


@pytest.mark.slow
def test_a_click_plays_the_way_to_a_posture(page: Any, cuspidal: Any) -> None:
    _, arm, form, found = cuspidal
    page.emulate_media(reduced_motion="reduce")  # its end at once
    with pinsing.Viewer(arm, form.families, postures=found, skeleton=True) as viewer:
        listed = viewer._page(False)["postures"]
        open_page(page, viewer.url)
        assert page.locator("#postures > li").count() == 4
        assert text(page, "#postures-count") == "(4)"
        for k in (next(i for i, p in enumerate(listed) if p["way"]), 3):
            page.locator("#postures > li button").nth(k).click()
            assert page.locator("#postures > li.chosen").count() == 1
            q = q_of(page)
            assert np.abs(arm.space.wrap(q - np.array(listed[k]["q"]))).max() < 1e-9
            assert f"posture {k + 1}" in text(page, "#playing")
            last = int(page.locator("#scrub").get_attribute("max") or 0)
            assert (last > 50) == (listed[k]["way"] is not None)


def test_the_command_writes_a_page(cuspidal, tmp_path):
    path, _, _, found = cuspidal
    out = tmp_path / "a.html"
    q = ",".join(map(repr, map(float, found.q)))
    words = ["postures", str(path), "--task", "position", "--ignore-limits", f"--q={q}"]
    done = run(*words, "-o", str(out))
    assert done.exit_code == 0, done.output
    assert out.stat().st_size > 100_000
    shown = baked(out.read_text(encoding="utf-8"))
    assert shown["coverage"].startswith(("Proven", "Probable", "NOT"))
