"""Results that show themselves: one line as repr, HTML and LaTeX in notebooks."""

import html
import re
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import pytest
from tiers import sampled
from urdf_texts import LIMIT, joint

import pinsing
from pinsing.notebook import mathml
from pinsing.prose import one_line

HOSTILE = """<img src=x onerror="alert(1)">$x^{$</code></table>&amp;"""


@pytest.fixture(scope="module")
def results():
    arm = pinsing.load("stanford")
    form = pinsing.closed_form(arm)
    swept = pinsing.sampling.sweep(arm, levels=1, samples=9)
    analysis = pinsing.analyze(arm, levels=1, samples=9, random_starts=5)
    state = pinsing.at(arm, [0.1, 0.2, 0.3, 0.4, 0.0, 0.6])
    refined = pinsing.kinematics.refine(arm, state.q)
    return [arm, form, form.families[0], swept, analysis, state, refined, swept.plan]


def test_every_repr_is_one_short_line(results):
    mechanism = pinsing.load_mechanism(Path(__file__).parent.parent / "urdf" / "five_bar.urdf")
    for result in (*results, mechanism, pinsing.sampling.sigma_map(results[0], count=4)):
        said = repr(result)
        assert said.startswith(f"<{type(result).__name__}")
        assert said.endswith(">")
        assert "\n" not in said
        assert len(said) < 150
    arm, form, _, _, analysis, state = results[:6]
    assert repr(state).startswith("<State: stanford, SINGULAR: rank 5 of 6, sigma_6/sigma_1 = ")
    assert "; checks agree>" in repr(analysis)
    assert repr(pinsing.robot.nominal(arm)).startswith("<Nominal: stanford: ")
    bent, flat = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [0.1, 0.2, 0.3, 0.4, -0.5, 0.6]
    meets = f"meets {form.family_of(state.q).name}>"
    assert repr(pinsing.check_trajectory(arm, [bent, flat], forms=form)).endswith(meets)
    assert one_line("A", "") == "<A>"
    assert one_line("A", "x\x1b[31m") == "<A: x\\x1b[31m>"


def test_html_is_well_formed_and_has_the_equations(results):
    assert results[0]._repr_html_().endswith(f">{html.escape(str(results[0]))}</pre>")
    for result in results:
        shown = result._repr_html_()
        ElementTree.fromstring(f"<div>{shown}</div>")
        assert "$" not in shown  # nothing waits for MathJax
        if not hasattr(result, "_repr_latex_"):
            continue
        assert "<math>" in shown
        assert result._repr_latex_()
    _, form, family, _, analysis, state = results[:6]
    assert all(mathml(f.latex) in form._repr_html_() for f in form.families)
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
    states = (pinsing.at(arm, q) for q in ([0, 0, 0], [0.1, 0.4, 0.9]))
    allowed = set(
        ["div", "p", "code", "span", "strong", "table", "thead", "tbody", "tr", "th", "td"]
    )
    allowed |= {"math", "mi", "mn", "mo", "msub", "msup", "mtext", "mrow", "mspace"}
    for result in (pinsing.closed_form(arm, seconds=3), *states):
        shown = result._repr_html_()
        root = ElementTree.fromstring(f"<div>{shown}</div>")
        assert {e.tag for e in root.iter()} <= allowed
        named = [e for e in root.iter() if e.text and "onerror" in e.text]
        assert named
        assert all(e.tag in ("code", "span") and "mathjax_ignore" in e.get("class") for e in named)
        assert not re.search(r"<img", shown)
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
