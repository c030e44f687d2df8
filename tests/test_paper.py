"""The page about the paper: its rows are computed, and say what they should."""

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "scripts"))

from paper import claims, parallel, printed, readings, stanford, surgical, table3  # noqa: E402
from paper.rows import AGREES, DIFFERS, Section  # noqa: E402

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


@pytest.mark.slow
def test_table_3_has_all_its_rows(made):
    rows = [r for s in made for r in s.rows if r.what.startswith("Row ")]
    assert len(rows) == len(printed.TABLE_3) == 13
    assert [r.verdict for r in rows] == [AGREES] * 3 + [DIFFERS] * 10
    exact = [r for r in rows[3:] if "K ∞" in r.computed]
    assert len(exact) == 5  # every one of them has q4 = 0


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


def test_the_bound_on_omega_k_holds(rng):
    arm = load("surgical7")
    bound = table3.bound(arm)
    Q = rng.uniform(-np.pi, np.pi, (2000, 7))
    J = np.array([frame_jacobian(arm, q) for q in Q])
    sigma = np.linalg.svd(J, compute_uv=False)
    product = sigma.prod(axis=1) * sigma[:, 0] / sigma[:, -1]
    assert product.max() <= bound
    assert product.max() > 0.02 * bound
