"""Results in a notebook's page, in a real browser: what a user sees, and what a file cannot do."""

import html
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import pytest
from urdf_texts import LIMIT, joint

import pinsing

pytestmark = pytest.mark.slow

STYLE = """
body { margin: 16px; font: 14px system-ui, sans-serif; background: #fff; color: #000 }
body.dark { background: #111; color: #ddd }
.output_html { overflow: auto; max-width: 900px }
.output_html table { border-collapse: collapse; font-size: 12px; table-layout: fixed }
.output_html td, .output_html th { text-align: right; padding: 0.5em; white-space: nowrap }
"""
HOSTILE = (
    """<img src=x onerror="window.attacked=1"></code></span></td></table>"""
    """<script>window.attacked=2</script><math href="javascript:window.attacked=3">$x^{$"""
)
PAGES = ("", "dark")


def notebook(folder: Path, results: dict[str, Any], theme: str) -> str:
    """A page with outputs in it as nbconvert and front ends put them: HTML, as it comes.

    None of a notebook's scripts is there; where the HTML left anything to MathJax, its source
    would stand on the page.
    """
    cells = "".join(
        f"<div class=input><pre>{html.escape(key)}</pre></div>"
        f'<div class="output_html" id="{key}">{result._repr_html_()}</div>'
        for key, result in results.items()
    )
    path = folder / "page.html"
    path.write_text(
        f'<!doctype html><html><head><meta charset="utf-8"><style>{STYLE}</style></head>'
        f'<body class="{theme}">{cells}</body></html>',
        encoding="utf-8",
    )
    return path.as_uri()


@pytest.fixture(scope="module")
def results() -> dict[str, Any]:
    found: dict[str, Any] = {}
    for robot in ("ur5", "puma560"):
        arm = pinsing.load(robot)
        analysis = pinsing.analyze(arm, levels=1, samples=9, random_starts=5)
        form = analysis.closed_form
        found |= {
            f"form-{robot}": form,
            f"family-{robot}": form.families[-1],
            f"analysis-{robot}": analysis,
            f"singular-{robot}": pinsing.at(arm, form.families[0].witness),
            f"regular-{robot}": pinsing.at(arm, [0.1, -0.7, 0.8, 0.4, 0.5, 0.6]),
        }
    return found


def shown(page: Any, key: str) -> str:
    return str(page.locator(f"#{key}").inner_text())


def luminance(color: str) -> float:
    """Relative luminance of ``rgb(r, g, b)``, WCAG 2."""
    inside = color.partition("(")[2].rstrip(")")
    parts = [float(x) / 255 for x in inside.split(",")[:3]]
    linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


BOXES = """key => [...document.getElementById(key).querySelectorAll('math')].map(m => {
    const box = m.getBoundingClientRect();
    return {native: m instanceof MathMLElement, width: box.width, height: box.height,
            right: box.right, text: m.textContent};
})"""
LOWER = """key => [...document.getElementById(key).querySelectorAll('msub')].map(m => {
    const [base, index] = [...m.children].map(c => c.getBoundingClientRect());
    return {below: index.bottom - base.bottom, after: index.left - base.left,
            smaller: index.height / base.height};
})"""


@pytest.mark.parametrize("theme", PAGES)
def test_equations_are_typeset_without_a_script(page, tmp_path, results, theme):
    page.goto(notebook(tmp_path, results, theme))
    for key, result in results.items():
        boxes = page.evaluate(BOXES, key)
        assert boxes, key
        assert all(b["native"] and b["width"] > 4 and b["height"] > 6 for b in boxes), key
        assert all(b["right"] < 920 for b in boxes), key  # none is wider than the page
        scripts = page.evaluate(LOWER, key)
        assert scripts
        assert all(s["below"] > 0 and s["after"] > 0 and s["smaller"] <= 1 for s in scripts), key
        said = shown(page, key)
        assert "$" not in said
        assert "\\" not in said
        assert "{" not in said
        wide = page.evaluate("key => document.getElementById(key).scrollWidth", key)
        assert wide <= 900, key
        for family in getattr(result, "families", ()):
            assert family.reason in said
    # Every coefficient of the equation is on the page, with its sign.
    whole = page.evaluate("() => document.getElementById('family-ur5').textContent")
    for number in ("0.425", "+ 0.39225", "− 0.09465"):
        assert number in whole
    assert "shoulder_lift_joint" in whole


@pytest.mark.parametrize("theme", PAGES)
def test_verdicts_are_coloured_and_can_be_read(page, tmp_path, results, theme):
    page.goto(notebook(tmp_path, results, theme))
    colors = {}
    for key in results:
        for words, ground, ink in page.evaluate(
            """key => [...document.getElementById(key).querySelectorAll('strong')].map(e => {
                const s = getComputedStyle(e);
                return [e.textContent, s.backgroundColor, s.color];
            })""",
            key,
        ):
            if ground != "rgba(0, 0, 0, 0)":
                assert contrast(ground, ink) >= 4.5, words
                colors[words] = ground
    assert {"SINGULAR", "regular", "proven", "sweep and random search agree"} <= set(colors)
    assert colors["SINGULAR"] != colors["regular"] == colors["proven"]
    # The rest takes the colour of the page, equations too.
    ground = page.evaluate("() => getComputedStyle(document.body).backgroundColor")
    inks = page.evaluate(
        """() => [...document.querySelectorAll('math, td > span, code')].map(
            e => getComputedStyle(e).color)"""
    )
    assert inks
    assert all(contrast(ground, ink) >= 4.5 for ink in inks)
    dots = page.evaluate(
        """() => [...document.querySelectorAll('td span')].filter(
            e => e.textContent === '●').map(e => getComputedStyle(e).color)"""
    )
    assert dots
    assert all(contrast(ground, dot) >= 3 for dot in dots)


def hostile() -> pinsing.Arm:
    said = quoteattr(HOSTILE, {'"': "&quot;"})[1:-1]
    turn = '<origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>' + LIMIT
    links = "".join(f'<link name="l{i}"/>' for i in range(4))
    joints = "".join(joint(f"{said} {i}", f"l{i}", f"l{i + 1}", inner=turn) for i in range(3))
    return pinsing.load(f'<robot name="{said}">{links}{joints}</robot>', task="vx,vy")


def test_names_out_of_a_file_are_text(page, tmp_path):
    arm = hostile()
    analysis = pinsing.analyze(arm, levels=1, samples=5, random_starts=5)
    form = analysis.closed_form
    loaded = pinsing.ClosedForm.from_json(form.to_json().replace("q_{2}", "<img src=y>\\\\evil{"))
    assert "evil" in loaded._repr_latex_()
    found = {
        "form": form,
        "family": form.families[0],
        "analysis": analysis,
        "state": pinsing.at(arm, [0, 0, 0]),
        "loaded": loaded,
    }
    page.goto(notebook(tmp_path, found, ""))
    page.wait_for_timeout(200)
    assert page.evaluate("() => window.attacked") is None
    assert page.locator("img, script, a, [href], [onerror], iframe").count() == 0
    for key in ("form", "family", "analysis", "state"):
        assert HOSTILE in shown(page, key)
        # None has closed the cell that it stands in: all of it is still within its output.
        assert page.evaluate(
            "key => document.getElementById(key).parentNode === document.body", key
        )
    assert "evil" in shown(page, "loaded")


def test_a_long_equation_unfolds(page, tmp_path):
    """Fourteen terms and more are named first, and written out by a click."""
    form = pinsing.closed_form(pinsing.load("panda"))
    long = [f for f in form.families if f.solved]
    assert long
    page.goto(notebook(tmp_path, {"panda": form}, ""))
    details = page.locator("#panda details")
    assert details.count() == len(long)
    inside = details.first.locator("math").last
    assert not inside.is_visible()
    details.first.locator("summary").click()
    assert inside.is_visible()
    assert page.evaluate("() => document.getElementById('panda').scrollWidth") <= 900


def test_a_viewer_is_a_page_within_the_notebook(page, tmp_path):
    """It computes, alone in its frame: no server, and no way into the notebook."""
    viewer = pinsing.Viewer(pinsing.load("scara"), skeleton=True)
    page.goto(notebook(tmp_path, {"viewer": viewer}, ""))
    frame = next(f for f in page.frames if f is not page.main_frame)
    frame.wait_for_selector("body[data-ready=yes]", state="attached", timeout=90_000)
    assert frame.locator("#robot").inner_text() == "scara"
    before = frame.locator(".joint .typed").first.input_value()
    frame.evaluate("() => window.pinsing.move(0, 0.5)")
    frame.wait_for_function(
        "(b) => document.querySelector('.joint .typed').value !== b", arg=before
    )
    frame.locator("#copy-as").select_option("link")
    frame.locator("#copy").click()
    frame.wait_for_function("() => document.getElementById('copied').textContent.length > 0")
    closed = "() => { try { return parent.document.title } catch (e) { return e.name } }"
    assert frame.evaluate(closed) == "SecurityError"
