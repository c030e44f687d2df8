"""Aspects in colours over two joints."""

import numpy as np
import pytest
from command_line import run
from tiers import tiered_rows

import pinsing
from pinsing import plot
from pinsing.errors import OptionError, UnknownNameError
from pinsing.plot.plane import _numbers, regular_configuration

COLOURED = [("puma560", True), ("stanford", False)]


@pytest.mark.parametrize(("name", "limits"), tiered_rows(COLOURED, COLOURED[1:]))
def test_colours_are_those_of_the_aspects(name, limits):
    """Random points of the grid, each asked by itself; few are on an edge."""
    arm = pinsing.load(name)
    found = pinsing.aspects(pinsing.closed_form(arm), limits)
    base = regular_configuration(arm)
    low, high = arm.space.range(not limits)
    a, b = (1, 2) if name == "puma560" else (1, 4)
    Q = np.tile(base, (60, 60, 1))
    Q[..., a] = np.linspace(low[a], high[a], 60)[None, :]
    Q[..., b] = np.linspace(low[b], high[b], 60)[:, None]
    numbers = _numbers(found, Q)
    rng = np.random.default_rng(0)
    same = [numbers[i, k] == (found.of(Q[i, k]) or 0) for i, k in rng.integers(1, 59, (80, 2))]
    assert np.mean(same) > 0.97
    assert len(np.unique(numbers)) >= 4


def test_the_legend_has_numbers_and_names():
    axes = plot.aspect_plane(pinsing.load("puma560"), "q2", "q3", samples=81)
    said = [t.get_text() for t in axes.get_legend().get_texts()]
    assert len(said) == 6
    assert all("shoulder" in s for s in said)


def test_bad_input():
    arm = pinsing.load("scara")
    with pytest.raises(OptionError, match="two different"):
        plot.aspect_plane(arm, "q1", "q1")
    with pytest.raises(UnknownNameError):
        plot.aspect_plane(arm, "q1", "nope")


def test_the_command_writes_a_picture(tmp_path):
    out = tmp_path / "a.png"
    done = run("plot", "aspects", "scara", "--over", "q1,q2", "-o", out)
    assert done.exit_code == 0
    assert out.stat().st_size > 5000
