"""Results that show themselves: one line as repr, HTML and LaTeX in notebooks."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import pytest
from urdf_texts import LIMIT, joint

import pinsing
from pinsing.notebook import one_line

HOSTILE = """<img src=x onerror="alert(1)">$x^{$</code></table>&amp;"""


@pytest.fixture(scope="module")
def results():
    arm = pinsing.load("stanford")
    form = pinsing.closed_form(arm)
    swept = pinsing.sweep(arm, levels=1, samples=9)
    analysis = pinsing.analyze(arm, levels=1, samples=9, random_starts=5)
    state = pinsing.at(arm, [0.1, 0.2, 0.3, 0.4, 0.0, 0.6])
    refined = pinsing.refine(arm, state.q)
    return [arm, form, form.families[0], swept, analysis, state, refined, swept.plan]


def test_every_repr_is_one_short_line(results):
    mechanism = pinsing.load_mechanism(Path(__file__).parent.parent / "urdf" / "five_bar.urdf")
    for result in (*results, mechanism, pinsing.sigma_map(results[0], count=4)):
        said = repr(result)
        assert said.startswith(f"<{type(result).__name__}")
        assert said.endswith(">")
        assert "\n" not in said
        assert len(said) < 150
    assert one_line("A", "") == "<A>"
    assert one_line("A", "x\x1b[31m") == "<A: x\\x1b[31m>"


def test_html_is_well_formed_and_has_the_equations(results):
    for result in results:
        if not hasattr(result, "_repr_html_"):
            continue
        shown = result._repr_html_()
        ElementTree.fromstring(f"<div>{shown}</div>")
        assert shown.count("$") % 2 == 0
        assert result._repr_latex_()
    _, form, family, _, analysis, state = results[:6]
    assert all(f.latex.split()[0] in form._repr_html_() for f in form.families)
    assert family.latex in family._repr_latex_()
    assert form.word in form._repr_html_()
    assert "SINGULAR" in state._repr_html_()
    assert "agree" in analysis._repr_html_()


def test_names_are_text_in_notebooks():
    """Neither elements nor mathematics: MathJax leaves code and its class alone."""
    said = quoteattr(HOSTILE, {'"': "&quot;"})[1:-1]
    turn = '<origin xyz="0.3 0 0.2" rpy="1.5707963267948966 0 0"/><axis xyz="0 0 1"/>' + LIMIT
    links = "".join(f'<link name="l{i}"/>' for i in range(4))
    joints = "".join(joint(f"{said} {i}", f"l{i}", f"l{i + 1}", inner=turn) for i in range(3))
    arm = pinsing.load(f'<robot name="{said}">{links}{joints}</robot>', task="position")
    for result in (
        pinsing.closed_form(arm, seconds=3),
        pinsing.at(arm, [0, 0, 0]),
        pinsing.at(arm, [0.1, 0.4, 0.9]),
    ):
        shown = result._repr_html_()
        root = ElementTree.fromstring(f"<div>{shown}</div>")
        allowed = {"div", "p", "code", "span", "strong", "table", "thead", "tbody"}
        assert {e.tag for e in root.iter()} <= allowed | {"tr", "th", "td"}
        named = [e for e in root.iter() if e.text and "onerror" in e.text]
        assert named
        assert all(e.tag in ("code", "span") and "mathjax_ignore" in e.get("class") for e in named)
        assert not re.search(r"<img", shown)
        assert HOSTILE not in result._repr_latex_()
