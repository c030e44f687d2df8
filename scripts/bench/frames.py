"""How smoothly the tab moves: pictures a second while a slider is led to and fro.

python scripts/bench/frames.py [ROBOT ...] [--seconds 6]

A pull moves the slider once a picture, as a hand does. With its pace the page draws with fewer
points while it moves where the graphics are slow; without it always with all. Beside them stands
the floor: the same page at rest, its camera going round, which computes nothing. Milliseconds:
between two pictures in the browser (median, 95 of 100), and of all scripts of the page for one
picture: joints, loops, readings, and what WebGL is told. What is left is drawing, which a graphics
card does. Needs Playwright for Python and Chromium, which draws by software here.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import sync_playwright

from pinsing.view.picture import find_browser

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

from chromium import FLAGS, open_page

SIZE = {"width": 1280, "height": 800}
LEAD = """([seconds, still]) => new Promise((done) => {
  const { panel, view } = window.pinsing;
  const { viewer } = view;
  const { slider } = panel.rows.find((r) => !r.slider.disabled);
  const centre = Number(slider.value), begin = performance.now(), gaps = [];
  let before = 0;
  const tick = (at) => {
    if (before) gaps.push(at - before);
    before = at;
    const t = (performance.now() - begin) / 1e3;
    if (t > seconds) {
      slider.dispatchEvent(new Event("change"));
      done(gaps);
      return;
    }
    if (still) {
      const { position } = viewer.camera, a = 0.02, [x, z] = [position.x, position.z];
      position.x = x * Math.cos(a) - z * Math.sin(a);
      position.z = x * Math.sin(a) + z * Math.cos(a);
      viewer.set_dirty();
    } else {
      slider.value = centre + 8 * Math.sin(2 * t);
      slider.dispatchEvent(new Event("input"));
    }
    requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
})"""


def scripts_so_far(session: Any) -> float:
    """Seconds that the page's scripts have taken."""
    metrics = session.send("Performance.getMetrics")["metrics"]
    return float(next(m["value"] for m in metrics if m["name"] == "ScriptDuration"))


def led(page: Any, seconds: float, still: bool) -> tuple[np.ndarray, float]:
    """Milliseconds between pictures, and of all scripts for one."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")
    before = scripts_so_far(session)
    gaps = np.asarray(page.evaluate(LEAD, [seconds, still]))
    return gaps, 1e3 * (scripts_so_far(session) - before) / len(gaps)


def main() -> None:
    """Print a row for each robot and way of drawing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robots", nargs="*", default=["gough_stewart", "delta", "ur5"])
    parser.add_argument("--seconds", type=float, default=6.0)
    options = parser.parse_args()
    print("| robot | how | pictures a second | between two | 95 of 100 | scripts |")
    print("|---|---|---:|---:|---:|---:|")
    with sync_playwright() as play, tempfile.TemporaryDirectory() as folder:
        browser = play.chromium.launch(executable_path=find_browser(), args=FLAGS)
        for robot in options.robots:
            file = Path(folder, "page.html")
            command = [sys.executable, "-m", "pinsing", "view", robot, "-o", str(file)]
            subprocess.run(command, check=True, capture_output=True)
            for how in ("at rest, the camera moves", "with its pace", "always all points"):
                page = browser.new_page(viewport=SIZE)
                open_page(page, file.as_uri())
                page.wait_for_timeout(3000)
                if how.startswith("always"):
                    page.evaluate("() => { window.pinsing.view.pace.ratio = () => {}; }")
                gaps, scripts = led(page, options.seconds, how.startswith("at rest"))
                print(
                    f"| {robot} | {how} | {1e3 / gaps.mean():.0f} | {np.median(gaps):.0f} "
                    f"| {np.percentile(gaps, 95):.0f} | {scripts:.1f} |",
                    flush=True,
                )
                page.close()


if __name__ == "__main__":
    main()
