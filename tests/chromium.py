"""Eyes for the pages that tests open in Chromium: what is drawn, and what is said."""

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SIZE = {"width": 1000, "height": 700}
BLUE, PINK = (0x00, 0x72, 0xB2), (0xC4, 0x18, 0x7C)


def open_page(page: Any, url: str) -> None:
    page.goto(url)
    page.wait_for_selector("body[data-ready=yes]", timeout=90_000)


def pixels(image: bytes) -> np.ndarray:
    """An image as (height, width, 3)."""
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(image)).convert("RGB"), dtype=float)


def picture(page: Any) -> np.ndarray:
    """The view as pixels, drawn afresh."""
    shot = page.evaluate("() => window.pinsing.view.viewer.capture_image()")
    return pixels(base64.b64decode(shot.split(",")[1]))


def serious_findings(page: Any) -> list[Any]:
    """What axe finds serious: contrast, names, roles; of what, and where first."""
    package = pytest.importorskip("axe_core_python", reason="needs axe-core-python")
    page.evaluate((Path(package.__file__).parent / "axe.min.js").read_text(encoding="utf-8"))
    found = page.evaluate("() => axe.run()")["violations"]
    grave = [v for v in found if v["impact"] in ("serious", "critical")]
    return [(v["id"], v["nodes"][0]["target"], len(v["nodes"])) for v in grave]


def near(shown: np.ndarray, color: tuple[int, int, int]) -> int:
    """Pixels whose hue is that of a colour, whatever it is mixed with."""
    centred = shown - shown.mean(axis=-1, keepdims=True)
    aim = np.array(color) - np.mean(color)
    length = np.linalg.norm(centred, axis=-1)
    cosine = centred @ (aim / np.linalg.norm(aim)) / np.maximum(length, 1e-9)
    return int(((cosine > 0.93) & (length > 25)).sum())


def text(page: Any, selector: str) -> str:
    return str(page.locator(selector).inner_text())


def until(page: Any, selector: str, words: str) -> None:
    """Wait until an element says this."""
    page.wait_for_function(
        "([s, w]) => document.querySelector(s).textContent.includes(w)", arg=[selector, words]
    )


def q_of(page: Any) -> np.ndarray:
    """The configuration shown."""
    return np.array(page.evaluate("() => window.pinsing.view.frame.q"))
