"""How long after ``pinsing view`` there is an address, a first picture, and the whole robot.

python scripts/bench/first_picture.py [ROBOT ...] [--rounds 4]

Needs Playwright for Python and Chromium, which draws by software here. With them stands the floor:
meshcat's own viewer without any robot, in a page from a file, drawn once by the same browser. An
idle machine is needed: a browser is four processes that wait for each other.
"""

from __future__ import annotations

import argparse
import contextlib
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

from pinsing.view.picture import find_browser
from pinsing.view.server import meshcat_script

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

from chromium import FLAGS

SIZE = {"width": 1280, "height": 800}
DRAWN = "new Promise((r) => requestAnimationFrame(() => requestAnimationFrame(r)))"
EMPTY = """<!doctype html><body style="margin: 0"><div id="v" style="width: 860px; height: 800px">
</div><script>{script}</script><script>
const viewer = new MeshCat.Viewer(document.getElementById("v"));
viewer.render();
requestAnimationFrame(() => requestAnimationFrame(() => performance.mark("first picture")));
</script>"""
MARK = "performance.getEntriesByName('first picture')[0]?.startTime ?? null"


@contextlib.contextmanager
def served(robot: str) -> Iterator[tuple[str, float]]:
    """The address that the command prints, and when it began (Unix time)."""
    began = time.time()
    words = [sys.executable, "-m", "pinsing", "view", robot, "--no-open"]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as run:
        assert run.stdout is not None
        try:
            yield next(m[0] for line in run.stdout if (m := re.search(r"http://\S+", line))), began
        finally:
            run.terminate()


def first_picture(page: Any, address: str) -> float:
    """When the page at an address has its first picture (Unix time)."""
    page.goto(address, wait_until="commit")
    while (mark := page.evaluate(MARK)) is None:
        page.wait_for_timeout(20)
    return float((page.evaluate("performance.timeOrigin") + mark) / 1e3)


def main() -> None:
    """Print the least of some rounds, seconds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robots", nargs="*", default=["ur5", "panda"])
    parser.add_argument("--rounds", type=int, default=4)
    options = parser.parse_args()
    with sync_playwright() as play, tempfile.TemporaryDirectory() as folder:
        empty = Path(folder, "empty.html")
        empty.write_text(EMPTY.format(script=meshcat_script()), encoding="utf-8")
        browser = play.chromium.launch(executable_path=find_browser(), args=FLAGS)
        context = browser.new_context(viewport=SIZE)
        floors = []
        for _ in range(options.rounds):
            page = context.new_page()
            began = time.time()
            floors.append(first_picture(page, empty.as_uri()) - began)
            page.close()
        print(f"floor: meshcat without a robot {min(floors):.2f}")
        for robot in options.robots:
            rows = []
            for _ in range(options.rounds):
                page = context.new_page()
                with served(robot) as (address, began):
                    named = time.time() - began
                    picture = first_picture(page, address) - began
                    page.wait_for_selector("body[data-ready=yes]", timeout=120_000)
                    page.evaluate(DRAWN)
                    rows.append((named, picture, time.time() - began))
                page.close()
            least = [min(column) for column in zip(*rows, strict=True)]
            print(f"{robot}: address {least[0]:.2f}, picture {least[1]:.2f}, whole {least[2]:.2f}")
        browser.close()


if __name__ == "__main__":
    main()
