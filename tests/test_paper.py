"""The page about the paper: its rows are computed, and say what they should."""

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "scripts"))

from paper import claims, parallel, printed, readings, stanford, surgical, table3  # noqa: E402
from paper.page import to_html, to_markdown  # noqa: E402
from paper.rows import AGREES, DIFFERS, EXTENDED, INCOMPLETE, Row, Section, judged  # noqa: E402

from pinsing.kinematics.jacobian import frame_jacobian  # noqa: E402
from pinsing.robot.load import load  # noqa: E402


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("figures")


@pytest.fixture(scope="module")
def made(folder) -> list[Section]:
    return [
        *stanford.make(folder),
        *surgical.make(folder, readings=False),
        *parallel.make(folder),
        *claims.make(folder),
    ]


def row(made: list[Section], start: str) -> Row:
    found = [r for s in made for r in s.rows if r.what.startswith(start)]
    assert len(found) == 1, [r.what for r in found]
    return found[0]


# The Stanford arm first.
ROWS = [
    ("σ_min, all revolute π/3, d3", DIFFERS, "0.163162"),
    ("σ_min, all revolute π/2, d3", AGREES, "0.20905"),
    ("Appendix A", AGREES, "below 1e-12"),
    ("Section 3.1: |J11|", AGREES, "-d3² sin q2"),
    ("Singular configurations, Sections 3.1", AGREES, "complete"),
    ("d1 = 0.3 m", DIFFERS, "outside"),
    ("Figure 6: σ_min over d1", AGREES, "below"),
    ("Figure 6: σ_min over q6", DIFFERS, "0.058"),
    ("Singular configuration q4 = q5", INCOMPLETE, "q4 = 0, ±π alone"),
    ("All singular configurations", INCOMPLETE, "sin q6 = -0.2"),
    ("Row 1:", AGREES, "K ∞"),
    ("Row 7:", DIFFERS, "K 30.84"),
    ("Row 8:", DIFFERS, "K ∞"),
    ("Rows 4 to 13", DIFFERS, "at most 3.67"),
    ("Figure 13", DIFFERS, "0.009619"),
    ("Figure 16", AGREES, "1.005"),
    ("σ_min of the first matrix", AGREES, "0.471384"),
    ("σ_min of the second matrix", AGREES, "0.848528"),
    ("Eq. (13)", DIFFERS, "J_q X' = J_x q'"),
    ("Table 4: q1 = pi/3, q2 = 1.40924", AGREES, "1.4092166545"),
    ("Table 4: q1 = pi/3, q2 = 2.70535", AGREES, "assembly -"),
    ("Type 1 points on the paper's own curves", INCOMPLETE, "2.2456653 (assembly +)"),
    ("“There is no mechanism singularity”", DIFFERS, "q2 = 0.6270392"),
    ("Figure 11: one curve over q2", DIFFERS, "assembly - above"),
    ("Table 5", AGREES, "surgical7 2 of 4"),
    ("Table 6 (analytical method): serial, not", EXTENDED, "surgical7: families 4"),
    ("Table 6 (analytical method): parallel", EXTENDED, "five_bar: loci 6"),
    ("Section 5, PUMA 560", EXTENDED, "family F3"),
    ("Section 5, ABB IRB 1400", EXTENDED, "family F3"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("start", "verdict", "contains"), ROWS)
def test_rows_of_the_page(made, start, verdict, contains):
    found = row(made, start)
    assert found.verdict == verdict
    assert contains in found.computed


@pytest.mark.slow
def test_table_3_has_all_its_rows(made):
    rows = [r for s in made for r in s.rows if r.what.startswith("Row ")]
    assert len(rows) == len(printed.TABLE_3) == 13
    assert [r.verdict for r in rows] == [AGREES] * 3 + [DIFFERS] * 10
    exact = [r for r in rows[3:] if "K ∞" in r.computed]
    assert len(exact) == 5  # every one of them has q4 = 0


@pytest.mark.slow
def test_every_figure_is_written_and_shown(made, folder):
    names = [f.name for s in made for f in s.figures]
    assert names[:3] == ["fig02", "fig03", "fig04"]
    for number in (2, 3, 4, 6, 7, 8, 9, 11, 13, 14, 15, 16):
        assert f"fig{number:02d}" in names
    for name in names:
        assert (folder / f"{name}.png").stat().st_size > 5_000


@pytest.mark.slow
def test_pages_hold_every_row_and_are_well_formed(made):
    import xml.etree.ElementTree as ET

    html, markdown = to_html(made, "paper"), to_markdown(made, "paper")
    body = html[html.index("<body>") : html.index("</html>")]
    body = body.replace("<br>", "<br/>")
    import re

    ET.fromstring(re.sub(r"(<img [^>]*)>", r"\1/>", body))
    rows = [r for s in made for r in s.rows]
    assert html.count('<td class="v ') == len(rows)
    assert sum(line.startswith("| ") and "| **" in line for line in markdown.splitlines()) == len(
        rows
    )
    assert "inf" not in markdown.replace("infinite", "").replace("information", "")


@pytest.mark.slow
def test_committed_page_is_the_one_that_is_made(made):
    """Every verdict of docs/paper.md is what the code says now."""
    text = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    for s in made:
        assert s.title in text
        for r in s.rows:
            cell = r.what.replace("|", "\\|")
            assert f"| {cell} |" in text
            line = next(x for x in text.splitlines() if x.startswith(f"| {cell} |"))
            assert f"| **{r.verdict}** |" in line
    for f in (x for s in made for x in s.figures):
        assert (ROOT / "docs" / "paper" / f"{f.name}.png").is_file()


def test_the_plain_reading_of_table_2_is_pinsings_jacobian():
    arm = load("surgical7")
    rng = np.random.default_rng(2)
    theta = rng.uniform(-np.pi, np.pi, (5, 7))
    theta[:, 0] = 0.0
    found = readings.jacobians(readings.ALPHA, theta, 1.0, True, 7)
    for t, J in zip(theta, found, strict=True):
        q = t.copy()
        q[0] = printed.SURGICAL_D1
        np.testing.assert_allclose(J, frame_jacobian(arm, q), atol=1e-12)


@pytest.mark.slow
def test_no_reading_without_offsets_gives_the_printed_values():
    found = readings.search(
        float(printed.SURGICAL_THIRD), float(printed.SURGICAL_HALF), offsets=False
    )
    assert found.count == 2 * 16 * 7 * 4 * 2 * 4 * 9
    assert found.within == 0
    plain = next(r for r in found.single if r.words == "as printed")
    assert plain.third == pytest.approx(0.061141, abs=1e-6)


@pytest.mark.slow
def test_the_search_finds_a_value_that_a_reading_does_give():
    """What it reports as absent it would have found."""
    known = readings.search(0.066929, 0.021200, offsets=False)
    assert known.within > 0
    assert "standard DH" in known.nearest[0].words


def test_the_bound_on_omega_k_holds(rng):
    arm = load("surgical7")
    bound = table3.bound(arm)
    Q = rng.uniform(-np.pi, np.pi, (2000, 7))
    J = np.array([frame_jacobian(arm, q) for q in Q])
    sigma = np.linalg.svd(J, compute_uv=False)
    product = sigma.prod(axis=1) * sigma[:, 0] / sigma[:, -1]
    assert product.max() <= bound
    assert product.max() > 0.02 * bound


def test_judged_compares_to_the_last_printed_digit():
    assert judged("x", "0.209", 0.20905).verdict == AGREES
    assert judged("x", "0.209", 0.2101).verdict == DIFFERS
    with pytest.raises(ValueError, match="unknown verdict"):
        Row("x", "1", "2", "maybe")


@pytest.mark.slow
def test_no_reading_at_all_gives_the_printed_values():
    found = readings.search(float(printed.SURGICAL_THIRD), float(printed.SURGICAL_HALF))
    assert found.count > 10_000_000
    assert found.within == 0
