"""Maps of the clearance: the bounds of each configuration, reduced; resumed; refused."""

import dataclasses
import math
from pathlib import Path

import arms
import numpy as np
import pytest

from pinsing import clearance, closed_form, plot
from pinsing.errors import OptionError, OutputError
from pinsing.robot.load import load
from pinsing.sampling import MapResult, sigma_map
from pinsing.sampling.maps import BLOCK


@pytest.mark.slow
def test_a_map_of_the_clearance_is_that_of_each_configuration() -> None:
    arm = arms.ur5()
    form = closed_form(arm)
    result = sigma_map(arm, measure="clearance", forms=form, count=3 * BLOCK + 7, worst=9, seed=4)
    found = clearance(form, result.plan.configurations(0, result.done))
    spread = result.clearance
    assert spread.families == found.names
    assert spread.complete
    order = np.lexsort((np.arange(result.done), found.lower))[:9]
    assert [p.index for p in spread.nearest] == order.tolist()
    for point, i in zip(spread.nearest, order, strict=True):
        assert (point.lower, point.upper) == (found.lower[i], found.upper[i])
        assert point.family == found.nearest[i]
    assert spread.lower.smallest.value == found.lower.min()
    assert spread.lower.largest.value == found.lower.max()
    assert spread.upper.largest.value == found.upper.max()
    assert spread.lower.counts.sum() == spread.upper.counts.sum() == result.done
    assert np.isclose(spread.lower.quantile(0.5), np.median(found.lower), rtol=5e-3)
    plain = sigma_map(arm, count=3 * BLOCK + 7, worst=9, seed=4)
    assert plain.clearance is None
    assert plain.ratio.smallest.value == result.ratio.smallest.value
    assert MapResult.from_json(result.to_json()).to_json() == result.to_json()
    old = plain.to_dict()
    del old["clearance"]  # as the version before wrote it
    assert MapResult.from_dict(old).clearance is None
    text = result.text(degrees=True)
    assert "distance to the nearest of F1, F2, F3, in degrees" in text
    assert f"{math.degrees(found.lower.min()):.4g}" in text


def test_a_map_of_the_clearance_goes_on_in_its_folder(tmp_path: Path) -> None:
    arm = arms.textbook("stanford")
    options: dict[str, object] = {"measure": "clearance", "count": 5 * BLOCK, "chunk": 1}
    whole = sigma_map(arm, **options).to_json()
    assert sigma_map(arm, **options, out=tmp_path / "run").to_json() == whole
    (tmp_path / "run" / "result.json").unlink()
    kept = sorted((tmp_path / "run" / "chunks").glob("*.npz"))
    assert len(kept) == 5
    kept[1].unlink()
    kept[3].write_bytes(b"not a chunk")
    told: list[str] = []
    again = sigma_map(arm, **options, out=tmp_path / "run", tell=told.append)
    assert again.to_json() == whole
    assert told
    with pytest.raises(OutputError):  # the same folder without the clearance is another run
        sigma_map(arm, count=5 * BLOCK, chunk=1, out=tmp_path / "run")


def test_unknown_bounds_are_said_and_not_counted_as_numbers() -> None:
    form = closed_form(load("puma560"))
    # Of its shoulder alone the closed formula knows no upper bound.
    only = dataclasses.replace(form, families=form.families[2:])
    result = sigma_map(load("puma560"), measure="clearance", forms=only, count=BLOCK)
    spread = result.clearance
    assert np.isinf(spread.upper.largest.value)
    assert spread.upper.quantile(1.0) == np.inf
    row = next(line for line in str(result).splitlines() if line.split()[:1] == ["largest"])
    assert row.split()[-1] == "-"


def test_a_plane_shows_the_proven_bound_of_each_configuration() -> None:
    arm = arms.ur5()
    q = np.array([0.1, -1.2, 1.3, -1.6, -1.4, 0.3])
    axes = plot.sigma_plane(
        arm, "elbow_joint", "wrist_2_joint", q=q, measure="clearance", samples=31
    )
    shown = np.asarray(axes.collections[0].get_array()).reshape(31, 31)
    x, y = np.linspace(-np.pi, np.pi, 31), np.linspace(-2 * np.pi, 2 * np.pi, 31)
    for i, k in ((3, 5), (15, 2), (30, 29)):
        there = q.copy()
        there[2], there[4] = x[k], y[i]
        bound = math.degrees(float(clearance(closed_form(arm), there).lower))
        assert shown[i, k] == pytest.approx(bound, abs=1e-9)
    with pytest.raises(OptionError, match="measure"):
        plot.sigma_plane(arm, "elbow_joint", "wrist_2_joint", measure="distance")
