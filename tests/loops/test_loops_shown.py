"""Mechanisms in figures, on pages and at the command line."""

import sys

import click
import matplotlib as mpl
import numpy as np
import pytest
from click.testing import CliRunner
from mechanisms import URDF, analyzed, shipped
from tiers import tiered

from pinsing.cli.mechanism import analyze_loops, loops_option, view_loops
from pinsing.cli.options import joint_values
from pinsing.cli.show import plot_loops
from pinsing.errors import OptionError, PinsingError
from pinsing.loops import (
    MechanismAnalysis,
    analyze_mechanism,
    curves,
    find_singular,
    home,
    loop_forms,
)
from pinsing.plot.mechanism import input_map

FIVE_BAR = {"robot": str(URDF / "five_bar.urdf")}
LOOPS = URDF / "five_bar.loops.yaml"


def paths(ax, color: str) -> list[np.ndarray]:
    """Points of the contour lines of a colour, degrees."""
    wanted = mpl.colors.to_rgb(color)
    out = []
    for c in ax.collections:
        edge = c.get_edgecolor()
        if len(edge) and np.allclose(edge[0][:3], wanted) and c.get_array() is not None:
            out += [p.vertices for p in c.get_paths() if len(p.vertices)]
    return out


@pytest.mark.slow
@pytest.mark.parametrize("sign", tiered("+-", "+"))
def test_lines_of_the_map_lie_on_the_closed_forms(sign):
    from pinsing.plot.mechanism import TYPE_1, TYPE_2

    mechanism = shipped("five_bar")
    forms = loop_forms(mechanism)
    ax = input_map(mechanism, sign, samples=241)
    for kind, color in (("type 1", TYPE_1), ("type 2", TYPE_2)):
        lines = np.radians(np.concatenate(paths(ax, color)))
        assert len(lines) > 200
        values = np.min(
            [np.abs(x.equation(lines)) / x.equation.size for x in forms.loci if x.kind == kind],
            axis=0,
        )
        assert np.quantile(values, 0.9) < 1e-2


def test_maps_of_the_two_modes_differ_and_are_mirror_images():
    mechanism = shipped("five_bar")
    found = []
    for sign in "+-":
        ax = input_map(mechanism, sign, samples=121)
        found.append(np.concatenate(paths(ax, "#c0392b")))
    # The mechanism upside down is the other mode: both inputs change sign.
    one, two = found[0], -found[1]
    near = np.array([np.abs(two - p).sum(axis=1).min() for p in one[::10]])
    assert np.quantile(near, 0.9) < 3
    assert np.quantile([np.abs(found[1] - p).sum(axis=1).min() for p in one[::10]], 0.5) > 5


def test_map_refuses_what_has_none():
    with pytest.raises(OptionError, match="two cranks"):
        input_map(shipped("planar_3rrr"))
    with pytest.raises(OptionError, match=r"must be \+ or -"):
        input_map(shipped("five_bar"), "left")


@pytest.mark.parametrize("kind", tiered(["map", "curves", "ellipsoids"], {"ellipsoids"}))
def test_plots_are_written(kind, tmp_path):
    out = tmp_path / f"{kind}.png"
    asked = [] if kind == "map" else [joint_values("60,60", "--q", True)]
    plot_loops(LOOPS, kind=kind, out=out, configurations=asked, deg=True, dpi=50, **FIVE_BAR)
    assert out.stat().st_size > 5_000


def test_loops_alone_means_the_file_beside_and_its_absence_is_said():
    @click.command()
    @loops_option(lambda loops, **options: click.echo(f"{loops.name} {sorted(options.items())}"))
    @click.argument("robot")
    @click.option("-o", "html")
    def command(robot: str, html: str | None) -> None:
        click.echo(f"arm {robot}")

    runner = CliRunner()
    for words in (["gough_stewart", "--loops", "-o", "a"], ["gough_stewart", "-o", "a", "--loops"]):
        done = runner.invoke(command, words, catch_exceptions=False)
        assert (
            done.output == "gough_stewart.loops.yaml [('html', 'a'), ('robot', 'gough_stewart')]\n"
        )
    # Without it the file is found, which is said; --no-loops leaves the loops out.
    done = runner.invoke(command, ["gough_stewart"], catch_exceptions=False)
    assert done.stdout.startswith("gough_stewart.loops.yaml [")
    assert "--no-loops takes a serial chain" in done.stderr
    assert runner.invoke(command, ["gough_stewart", "--no-loops"]).output == "arm gough_stewart\n"
    for robot in ("ur5", ".", "<robot/>"):
        assert runner.invoke(command, [robot]).output == f"arm {robot}\n"
        refused = runner.invoke(command, [robot, "--loops"]).exception
        assert isinstance(refused, PinsingError)


def test_what_the_time_of_an_analysis_leaves_out_is_said_and_the_rest_kept(capsys):
    assert analyze_loops(LOOPS, seconds=1e-9, **FIVE_BAR) == 130
    said = " ".join(capsys.readouterr().out.split())
    assert "2 assembly modes" in said
    assert "Missing: - working modes: not begun, the time of 1e-09 s was up" in said
    assert "closed forms over the inputs: not begun" in said
    assert "curves of q1, its range and singular points: not begun" in said
    for claim in ("none (neither", "missed", "in nothing"):
        assert claim not in said
    with pytest.raises(OptionError, match="seconds must be positive, got 0"):
        analyze_loops(LOOPS, seconds=0.0, **FIVE_BAR)


@pytest.mark.slow
def test_ctrl_c_keeps_what_an_analysis_has_done(monkeypatch, capsys, tmp_path):
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    whole = analyzed("five_bar")
    assert whole.missing == ()
    monkeypatch.setattr(sys.modules["pinsing.loops.solve"], "refine_point", stopped)
    cut = analyze_mechanism(shipped("five_bar"))
    assert cut.missing == (
        "curves of q1, its range and singular points: stopped before its end",
        "curves of q2, its range and singular points: not begun, stopped",
    )
    assert [s.mode for s in cut.working] == [s.mode for s in whole.working]
    assert len(cut.forms.loci) == len(whole.forms.loci)
    assert (cut.points, cut.ranges) == ((), {})
    assert all(c.passed for c in cut.checks)
    assert MechanismAnalysis.from_dict(cut.to_dict()).missing == cut.missing
    # A page or a report of half an analysis is none.
    with pytest.raises(KeyboardInterrupt):
        view_loops(LOOPS, html=tmp_path / "page.html", **FIVE_BAR)
    assert not (tmp_path / "page.html").exists()


@pytest.mark.slow
def test_the_time_ends_the_curves_with_those_that_are_followed():
    mechanism = shipped("four_bar")
    q = home(mechanism)[list(mechanism.actuated)]
    calls = iter(range(10_000))
    assert curves(mechanism, q, 0, over=lambda: next(calls) > 5) == ()
    assert find_singular(mechanism, curves(mechanism, q, 0), over=lambda: True) == ()
