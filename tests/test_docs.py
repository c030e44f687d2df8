"""Every block of the README and of the site does what it shows, and the pages hold together."""

import ast
import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import python
from pages import NOT_RUN, ROOT, Reader, blocks, commands, reader as reader
from public import REFERENCE, documented
from tiers import tiered

import pinsing
from pinsing import kinematics, plot, postures, proximity, robot, sampling

DOCS = ROOT / "docs"
README = (ROOT / "README.md").read_text(encoding="utf-8")
# Reports, written by programs: what they quote is what those ran.
REPORTS = set(re.findall(r"^(\w+)$", (DOCS / "evidence.md").read_text(), re.MULTILINE))
PAGES = sorted(
    str(path.relative_to(DOCS))
    for path in DOCS.rglob("*.md")
    if path.parent != DOCS or path.stem not in REPORTS
)
RUN = [p for p in PAGES if any(b.kind not in ("text",) for b in blocks((DOCS / p).read_text()))]
# Less than a second each; the others are in the slow tier.
QUICK = {
    "explain/method.md", "how-to/own-model.md", "how-to/singular-pose.md",
    "how-to/terminal.md", "reference/certificate.md", "reference/exit-codes.md",
    "reference/json.md",
}  # fmt: skip


@pytest.mark.parametrize("page", tiered(RUN, QUICK))
def test_a_page_does_what_it_shows(page: str, reader: Reader):
    reader.read((DOCS / page).read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", [*PAGES, "../README.md"])
def test_a_block_pasted_alone_has_its_imports(page: str):
    for block in blocks((DOCS / page).read_text(encoding="utf-8")):
        if block.kind == "python":
            tree = list(ast.walk(ast.parse(block.text)))
            used = {node.id for node in tree if isinstance(node, ast.Name)}
            found = [a for n in tree if isinstance(n, ast.Import | ast.ImportFrom) for a in n.names]
            imported = {(a.asname or a.name).partition(".")[0] for a in found}
            assert used & {"pinsing", "pin", "np", "plt", "Path"} <= imported, block.text


def test_reports_are_those_of_the_list():
    assert {"closed_forms", "survey", "proof", "paper", "speed"} <= REPORTS
    for name in REPORTS:
        assert (DOCS / f"{name}.md").exists()


def test_every_public_name_is_in_the_reference():
    text = REFERENCE.read_text(encoding="utf-8")
    for module in (pinsing, kinematics, postures, proximity, robot, sampling):
        assert set(module.__all__) <= documented().keys()
    members = re.search(r"pinsing\.plot\n   :members: (.*)", text)
    assert set(members[1].split(", ")) == set(plot.__all__)


def test_what_is_not_run_stands_somewhere():
    pages = [(DOCS / p).read_text() for p in PAGES] + [(ROOT / "README.md").read_text()]
    text = "\n".join(pages)
    assert [words for words in sorted(NOT_RUN) if words not in text] == []


def test_dead_links_and_foreign_files_are_found(tmp_path: Path):
    check = (ROOT / "scripts/check_site.py", tmp_path)
    good = '<h1 id="top">x</h1><a href="#top">y</a><a href="https://e.org">z</a>'
    (tmp_path / "index.html").write_text(good)
    assert python(*check, timeout=60).returncode == 0
    (tmp_path / "bad.html").write_text(
        '<a href="gone.html">x</a><a href="index.html#gone">y</a><img src="https://e.org/x.png">'
    )
    (tmp_path / "bad.css").write_text("@import url(//fonts.e.org/a.css);")
    done = python(*check, timeout=60)
    assert done.returncode == 1
    assert len(done.stdout.splitlines()) == 4


def test_the_readme_does_what_it_shows(reader: Reader):
    """In its order: later commands use files of earlier ones."""
    reader.read(README)


def test_its_session_leaves_nothing_out():
    shown = [text for b in blocks(README) if b.kind == "console" for *_, text in commands(b.text)]
    assert "3 families" in shown[2]
    assert not [text for text in shown if "..." in text]


@pytest.mark.parametrize("target", re.findall(r"\]\((?!https?:)([^)#]+)\)", README))
def test_links_lead_somewhere(target):
    assert (ROOT / target).exists(), f"README links to {target}"


# Formulas of the site in Chromium: what is written over a letter is seen -----------------

STYLE = (Path(__file__).parents[1] / "docs/_static/pages.css").read_text(encoding="utf-8")


def parts(page: Any, formula: str, style: str) -> int:
    """How many pieces of ink stand above one another."""
    from PIL import Image

    reason = "needs docutils"
    latex = pytest.importorskip("docutils.utils.math.latex2mathml", reason=reason)
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
