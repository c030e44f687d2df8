"""Results that show themselves: one line as repr, HTML and LaTeX in notebooks."""

import html
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from chromium import serious_findings
from tiers import sampled
from urdf_texts import LIMIT, named

import pinsing
from pinsing.notebook import mathml
from pinsing.prose import one_line

HOSTILE = (
    """<img src=x onerror="window.attacked=1"></code></span></td></table>&amp;"""
    """<script>window.attacked=2</script><math href="javascript:window.attacked=3">$x^{$"""
)


def contrast(one: str, other: str) -> float:
    """Of colours ``#rrggbb``, WCAG 2."""
    parts = np.array([[*bytes.fromhex(color[1:])] for color in (one, other)]) / 255
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    low, high = sorted(linear @ [0.2126, 0.7152, 0.0722])
    return float((high + 0.05) / (low + 0.05))


def test_what_results_say_of_themselves():
    """That every one says something is in test_public_types."""
    arm = pinsing.load("stanford")
    form = pinsing.closed_form(arm)
    state = pinsing.at(arm, [0.1, 0.2, 0.3, 0.4, 0.0, 0.6])
    analysis = pinsing.analyze(arm, levels=1, samples=9, random_starts=5)
    for value in (arm, form.families[0], pinsing.load_mechanism("five_bar")):
        assert re.fullmatch(r"<(Arm|Family|Mechanism)\b[^\n]{,140}>", repr(value))
    assert repr(state).startswith("<State: stanford, SINGULAR: rank 5 of 6, sigma_6/sigma_1 = ")
    assert "; checks agree>" in repr(analysis)
    assert repr(pinsing.robot.nominal(arm)).startswith("<Nominal: stanford: ")
    bent, flat = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [0.1, 0.2, 0.3, 0.4, -0.5, 0.6]
    meets = f"meets {form.family_of(state.q).name}>"
    assert repr(pinsing.check_trajectory(arm, [bent, flat], forms=form)).endswith(meets)
    assert one_line("A", "") == "<A>"
    assert one_line("A", "x\x1b[31m") == "<A: x\\x1b[31m>"
    assert arm._repr_html_().endswith(f">{html.escape(str(arm))}</pre>")
    for result in (form, form.families[0], analysis, state):
        assert "<math>" in result._repr_html_()
        assert result._repr_latex_()
    assert all(mathml(f.latex) in form._repr_html_() for f in form.families)
    assert form.families[0].latex in form.families[0]._repr_latex_()
    assert form.word in form._repr_html_()
    assert "SINGULAR" in state._repr_html_()
    assert "agree" in analysis._repr_html_()
    dots = re.findall(r"color:(#\w+)[^>]*>●", form._repr_html_() + analysis._repr_html_())
    assert min(contrast(dot, page) for dot in dots for page in ("#ffffff", "#111111")) >= 3


def test_names_are_text_in_notebooks():
    """Neither elements nor mathematics: MathJax leaves code and its class alone."""
    turn = '<origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>' + LIMIT
    arm, flat = (
        pinsing.load(named(HOSTILE, *inner), task=task)
        for inner, task in (((), "position"), ((turn,), "vx,vy"))
    )
    analysis = pinsing.analyze(flat, levels=1, samples=5, random_starts=5)
    form = analysis.closed_form
    loaded, typeset = (
        pinsing.ClosedForm.from_json(form.to_json().replace("q_{2}", latex))
        for latex in ("<img src=y>\\\\evil{", "\\\\text{<img src=y>}")
    )
    assert "evil" in loaded._repr_latex_()
    states = (pinsing.at(arm, q) for q in ([0, 0, 0], [0.1, 0.4, 0.9]))
    forms = (pinsing.closed_form(arm, seconds=3), form, form.families[0], analysis, loaded, typeset)
    allowed = ["div", "p", "code", "span", "strong", "table", "thead", "tbody", "tr", "th", "td"]
    allowed += ["math", "mi", "mn", "mo", "msub", "msup", "mtext", "mrow", "mspace"]
    for result in (*forms, *states):
        shown = result._repr_html_()
        root = ElementTree.fromstring(f"<div>{shown}</div>")
        assert {e.tag for e in root.iter()} <= {*allowed}
        assert {name for e in root.iter() for name in e.attrib} <= {"class", "style", "width"}
        said = [e for e in root.iter() if e.text and re.search("onerror|evil", e.text)]
        assert said
        assert all(e.tag in ("code", "span") and "mathjax_ignore" in e.get("class") for e in said)
        assert HOSTILE not in result._repr_latex_()


def words(shown: str) -> str:
    """The text that is left where a page takes the elements away."""
    return " ".join("".join(ElementTree.fromstring(f"<p>{shown}</p>").itertext()).split())


@pytest.mark.parametrize(
    ("latex", "read"),
    [
        (r"q_{3} = 0^\circ\ \text{or}\ 180^\circ", "q3 = 0° or 180°"),
        (r"0.4 \cos q_{2} - 0.3 \sin (q_{2}+q_{12}) = 0", "0.4 cos q2 − 0.3 sin ( q2 + q12 ) = 0"),
        (r"q_{1}+q_{2} = -9.5^\circ \pmod{360^\circ}", "q1 + q2 = − 9.5° (mod 360°)"),
        (r"d_{3}^{2} = 0.1\,\mathrm{m}", "d32 = 0.1 m"),
        (r"\sigma_{6}/\sigma_1 = 2 \cdot 10^{-17}", "σ6 / σ1 = 2 · 10−17"),
        (r"q_{5} = \pm 90^\circ", "q5 = ± 90°"),
    ],
)
def test_mathml_of_what_pinsing_writes(latex, read):
    assert words(mathml(latex)) == read


@pytest.mark.parametrize(
    "latex",
    [
        r"\frac{1}{2}", "q_", "}", "{", "{" * 50_000, "_2", "q^}", r"\text{<b>", r"\text", "é",
        r"\href{x}{y}",
    ],
)  # fmt: skip
def test_mathml_shows_what_it_does_not_know_as_it_is(latex):
    shown = mathml(latex)
    assert words(shown) == latex
    assert shown.startswith('<code class="tex2jax_ignore mathjax_ignore">')


@pytest.mark.parametrize(
    "robot", sampled(["ur5", "puma560", "stanford", "surgical7", "panda", "scara"])
)
def test_mathml_knows_all_that_closed_forms_write(robot):
    form = pinsing.closed_form(pinsing.load(robot), seconds=5)
    assert form.families
    assert not any("<code" in mathml(f.latex) for f in form.families)
    assert all("<code" not in mathml(e.latex()) for f in form.families for e in f.equations)


# Results in a notebook's page, in a real browser: what a user sees, and what a file cannot do ---

STYLE = """
body { margin: 16px; font: 14px system-ui, sans-serif; background: #fff; color: #000 }
body.dark { background: #111; color: #ddd }
.output_html { overflow: auto; max-width: 900px }
.output_html table { border-collapse: collapse; font-size: 12px; table-layout: fixed }
.output_html td, .output_html th { text-align: right; padding: 0.5em; white-space: nowrap }
"""


def notebook(folder: Path, outputs: dict[str, Any], theme: str = "") -> str:
    """A page with outputs in it as nbconvert and front ends put them: HTML, as it comes.

    None of a notebook's scripts is there; where the HTML left anything to MathJax, its source
    would stand on the page.
    """
    cells = "".join(
        f'<pre>{html.escape(key)}</pre><div class="output_html" id="{key}">{result._repr_html_()}'
        "</div>"
        for key, result in outputs.items()
    )
    path = folder / "page.html"
    path.write_text(
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>x</title><style>{STYLE}'
        f'</style></head><body class="{theme}">{cells}</body></html>',
        encoding="utf-8",
    )
    return path.as_uri()


BOXES = """key => [...document.querySelectorAll(`#${key} math`)].filter(m => m.checkVisibility())
    .map(m => {
        const box = m.getBoundingClientRect();
        return m instanceof MathMLElement && box.width > 4 && box.height > 6 && box.right < 920;
    })"""
"""Of each equation that is unfolded, whether it is drawn, and no wider than the page."""
LOWER = """key => [...document.querySelectorAll(`#${key} msub`)].filter(m => m.checkVisibility())
    .map(m => {
        const [base, index] = [...m.children].map(c => c.getBoundingClientRect());
        return index.top > base.top && index.left > base.left && index.height <= base.height;
    })"""
VERDICTS = """() => Object.fromEntries([...document.querySelectorAll('strong')]
    .map(e => [e.textContent, getComputedStyle(e).backgroundColor]))"""


@pytest.mark.slow
def test_equations_are_typeset_without_a_script_and_all_can_be_read(page, tmp_path):
    found: dict[str, Any] = {"panda": pinsing.closed_form(pinsing.load("panda"))}
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
    for theme in ("", "dark"):
        page.goto(notebook(tmp_path, found, theme))
        for details in page.locator("#panda details").all():
            # Of fourteen terms and more it is named first, and written out by a click.
            assert not details.locator("math").last.is_visible()
            details.locator("summary").click()
            assert details.locator("math").last.is_visible()
        assert serious_findings(page) == []
        for key, result in found.items():
            for look in (BOXES, LOWER):
                fits = page.evaluate(look, key)
                assert fits, key
                assert all(fits), key
            said = str(page.locator(f"#{key}").inner_text())
            assert not {*"$\\{"} & {*said}
            assert page.evaluate("key => document.getElementById(key).scrollWidth", key) <= 900
            families = getattr(result, "families", ())
            assert all(family.reason in said for family in families)
        long = sum(bool(f.solved) for f in found["panda"].families)
        assert page.locator("#panda details").count() == long > 0
        # Every coefficient of the equation is on the page, with its sign.
        whole = page.evaluate("() => document.getElementById('family-ur5').textContent")
        for words in ("0.425", "+ 0.39225", "− 0.09465", "shoulder_lift_joint"):
            assert words in whole
        grounds = page.evaluate(VERDICTS)
        assert {"SINGULAR", "regular", "proven", "sweep and random search agree"} <= set(grounds)
        assert grounds["SINGULAR"] != grounds["regular"] == grounds["proven"]


@pytest.mark.slow
def test_a_viewer_is_a_page_within_the_notebook(page, tmp_path):
    """It computes, alone in its frame: no server, and no way into the notebook."""
    viewer = pinsing.Viewer(pinsing.load("scara"), skeleton=True)
    page.goto(notebook(tmp_path, {"viewer": viewer}))
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
