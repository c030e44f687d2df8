"""Formulas of the site in Chromium: what is written over a letter is seen."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import require_browser

latex = pytest.importorskip("docutils.utils.math.latex2mathml", reason="needs docutils")
require_browser()

STYLE = (Path(__file__).parents[1] / "docs/_static/pages.css").read_text(encoding="utf-8")


def parts(page: Any, formula: str, style: str) -> int:
    """How many pieces of ink stand above one another."""
    from PIL import Image

    markup = latex.tex2mathml(formula)
    page.set_content(
        f"<meta charset=utf-8><style>{style} body {{ font-size: 160px; margin: 80px; }}"
        f"</style><span id=f>{markup}</span>"
    )
    box = page.locator("#f math").bounding_box()
    clip = {"x": box["x"], "y": 0, "width": box["width"], "height": 600}
    shot = Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("L")
    inked = (np.asarray(shot) < 128).any(axis=1)
    return int((np.diff(inked.astype(int)) == 1).sum())


@pytest.mark.slow
@pytest.mark.parametrize("formula", [r"\dot q", r"\dot x"])
def test_the_dot_of_a_speed_does_not_lie_on_its_letter(page: Any, formula: str) -> None:
    assert parts(page, formula, STYLE) == 2
    assert parts(page, formula[-1], STYLE) == 1
