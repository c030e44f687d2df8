"""Plots, by what is in them: artists, their data, labels; files; no text over another."""

import math
from collections.abc import Callable
from itertools import combinations, product
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from arms import URDF, textbook, ur5
from command_line import run
from dh_arms import dh_arm
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d import Axes3D
from tiers import tiered_rows

import pinsing
from pinsing import plot
from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.families import closed_form
from pinsing.kinematics.at import at
from pinsing.kinematics.jacobian import (
    frame_jacobian,
    singular_values,
    task_jacobian,
    tip_placement,
    tip_poses,
)
from pinsing.loops.solve import trace
from pinsing.plot.plane import Section, _numbers, reach_of, regular_configuration
from pinsing.plot.style import pi_text, pi_ticks
from pinsing.sampling.sweeps import sweep


def labels(ax: Axes) -> list[str]:
    return [t.get_text() for t in ax.get_legend().get_texts()] if ax.get_legend() else []


def marks(ax: Axes) -> list[Line2D]:
    return [line for line in ax.get_lines() if line.get_marker() == "o"]


def traced(ax: Axes) -> list[np.ndarray]:
    """Points of each curve where something is zero."""
    curves = (c for c in ax.collections if isinstance(c, ContourSet))
    return [np.concatenate([p.vertices for p in c.get_paths()]) for c in curves]


def at_values(q: Any, joints: Any, values: Any) -> np.ndarray:
    """A configuration with other values of some joints, once for each row."""
    Q = np.tile(q, (len(values), 1))
    Q[:, joints] = values
    return Q


def sigma_ratio(arm: pinsing.Arm, Q: np.ndarray) -> np.ndarray:
    sigma = singular_values(arm, Q)
    return sigma[:, -1] / sigma[:, 0]


def is_outside(ax: Axes) -> bool:
    """Whether the legend keeps off the data."""
    ax.figure.canvas.draw()
    return not ax.get_legend().get_window_extent().overlaps(ax.get_window_extent())


PUMA = "puma560"
CURVES = [("stanford", (1, 4), 61), ("surgical7", (3, 5), 61), ("ur5", (1,), 37)]


@pytest.mark.parametrize(("name", "moving", "samples"), tiered_rows(CURVES, CURVES[1:]))
def test_curves_are_of_the_sweep_and_true_zeros_alone_are_marked(name, moving, samples) -> None:
    """UR5: between samples, which nothing has refined; surgical7: not what other joints need."""
    arm = ur5() if name == "ur5" else textbook(name)
    result = sweep(arm, levels=1, samples=samples, prune=False)
    ax = plot.sigma_curves(result, moving=[arm.joints[j] for j in moving], arm=arm)
    lines, zeros = iter(ax.get_lines()), 0
    for j in moving:
        line, curve = next(lines), result.curve(None, arm.joints[j])
        assert line.get_label() == f"$q_{{{j + 1}}}$"
        np.testing.assert_array_equal(line.get_data(), (curve.x, curve.sigma_min))
        fine = np.linspace(curve.x[0], curve.x[-1], 20001)
        share = np.pad(sigma_ratio(arm, at_values(result.plan.nominal, j, fine)), 1, mode="reflect")
        dips = (share[1:-1] <= share[:-2]) & (share[1:-1] <= share[2:]) & (share[1:-1] < 1e-3)
        x = np.asarray(next(lines).get_xdata() if dips.any() else ())
        np.testing.assert_allclose(x, fine[dips], atol=1e-3)
        assert sigma_ratio(arm, at_values(result.plan.nominal, j, x)).max(initial=0) < 1e-9
        zeros += len(x)
    assert zeros > 1
    assert not list(lines)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("joint angle [rad]", r"$\sigma_{\min}$")
    said = ax.get_legend().get_title().get_text()
    assert "rests at" in said
    assert "$q_{5}$ = " in said
    assert name != "surgical7" or r"$q_{2}$ = $\pi/3$" in said
    assert is_outside(ax)
    assert ax.figure.get_size_inches()[0] == pytest.approx(3.5)


def drawn_on(ax: Axes) -> np.ndarray:
    """Places of a map where something is drawn as singular: curves, points and straight lines."""
    found = traced(ax) + [line.get_xydata() for line in marks(ax)]
    corners = np.array([ax.get_xlim(), ax.get_ylim()]).T
    for line in ax.get_lines():
        ends = line.get_xydata()
        if len(ends) == 2 and line not in marks(ax):  # straight, from side to side
            (x, y), (x1, _) = ends
            found.append(np.linspace(*corners, 400))
            found[-1][:, int(x != x1)] = x if x == x1 else y
    return np.concatenate(found)


PLANES = [("puma560", 1, 2, ["F1", "F3"]), ("stanford", 4, 2, ["F2", "F3"]),
          ("iiwa14", 1, 5, ["F3"])]  # fmt: skip


@pytest.mark.parametrize(("name", "a", "b", "names"), tiered_rows(PLANES, PLANES[1:]))
def test_a_map_is_sigma_min_and_curves_lie_in_its_valleys(name, a, b, names) -> None:
    arm = textbook(name)
    q = np.random.default_rng(1).uniform(0.2, 0.8, arm.n)
    one, two = arm.joints[a], arm.joints[b]
    ax = plot.sigma_plane(arm, one, two, q=q, samples=81, ignore_limits=True)
    low, high = arm.space.range(True)
    x, y = np.meshgrid(*(np.linspace(low[k], high[k], 81) for k in (a, b)))
    places = np.column_stack([x.ravel(), y.ravel()])
    Q = at_values(q, [a, b], places)
    values = np.asarray(ax.collections[0].get_array()).ravel()
    np.testing.assert_allclose(values, singular_values(arm, Q)[:, -1], atol=1e-12)
    curves = drawn_on(ax)
    assert sigma_ratio(arm, at_values(q, [a, b], curves)).max() < 2e-3
    # Where the arm is singular, or nearly, something is drawn.
    for place in places[sigma_ratio(arm, Q) < 1e-3]:
        assert np.linalg.norm(curves - place, axis=1).min() < 0.2
    assert sorted({text[:2] for text in labels(ax)}) == names
    assert is_outside(ax)
    unit = "[m]" if arm.prismatic[b] else "[rad]"
    assert ax.get_xlabel() == f"$q_{{{a + 1}}}$ [rad]"
    assert ax.get_ylabel().endswith(unit)
    assert ax.figure.axes[-1].get_xlabel() == r"$\sigma_{\min}$"


@pytest.mark.slow
def test_a_locus_is_where_the_arm_is_singular() -> None:
    """Every point of each curve, put into the arm, is singular; one curve for each third value."""
    arm = pinsing.load("panda")
    family = next(f for f in closed_form(arm).families if f.equations and len(f.joints) == 3)
    x, third, y = family.joints
    values = (np.pi / 2, -np.pi / 2)
    ax = plot.locus(arm, family, x, y, third=third, values=values, ignore_limits=True)
    assert len(labels(ax)) == 2
    joints = [arm.joints.index(name) for name in (x, y, third)]
    for value, places in zip(values, traced(ax), strict=True):
        rows = [[*place, value] for place in places[::40]]
        assert len(rows) > 10
        # The grid's width away from the true curve at most.
        assert sigma_ratio(arm, at_values(family.generic, joints, rows)).max() < 1e-3
    assert is_outside(ax)


def test_a_locus_says_where_there_is_none_and_where_all_of_it_is() -> None:
    arm = textbook("puma560")
    family = next(f for f in closed_form(arm).families if f.text.startswith("q5 ="))
    wrist = arm.joints[4]
    ax = plot.locus(arm, family, arm.joints[1], arm.joints[2], third=wrist, values=[0.0, 1.0])
    assert labels(ax)[0].endswith(": the whole plane")
    assert labels(ax)[1].endswith(": none")
    line = plot.locus(arm, family, wrist, arm.joints[0])
    assert any(np.allclose(one.get_xdata(), 0) for one in line.get_lines() if len(one.get_xdata()))


@pytest.mark.slow
def test_an_ellipsoid_has_the_radii_of_the_state(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = textbook("puma560")
    q = np.array([0.3, 0.4, 0.5, 0.6, 0.7, 0.8])
    drawn, original = [], Axes3D.plot_surface

    def record(self: Axes3D, X: Any, Y: Any, Z: Any, **style: Any) -> Any:
        drawn.append(np.stack([X, Y, Z], axis=-1).reshape(-1, 3))
        return original(self, X, Y, Z, **style)

    def on_it(points: np.ndarray, J: np.ndarray) -> np.ndarray:
        return np.einsum("ni,ij,nj->n", points, np.linalg.inv(J @ J.T), points)

    monkeypatch.setattr(Axes3D, "plot_surface", record)
    ax = plot.ellipsoids(at(arm, q), kind="translational", motions="all")
    J = frame_jacobian(arm, q)
    np.testing.assert_allclose(on_it(drawn.pop(), J[:3]), 1.0, atol=1e-9)
    assert not drawn
    assert ax.get_xlabel() == "$v_x$ [m/s]"
    assert len(ax.collections) == 1
    assert ax.get_title() == "translational part of all motions [m/s]"
    assert is_outside(ax)
    ax = plot.ellipsoids(at(arm, q), kind="rotational")  # a pose: pure motions
    assert ax.get_title() == "rotations, tip held [rad/s]"
    still = np.linalg.svd(J[:3])[2][3:].T
    np.testing.assert_allclose(on_it(drawn[0], J[3:] @ still), 1.0)


def test_the_arm_stands_in_the_picture_with_what_is_lost() -> None:
    arm = textbook("stanford")
    state = at(arm, [0.2, 1.0, 0.3, 0.4, 0.0, 0.6])
    ax = plot.ellipsoids(state, arm=arm)
    assert [other.get_xlabel() for other in ax.figure.axes] == ["$x$ [m]", "$x$ [m]"]
    lines = [np.array(line.get_data_3d()).T for line in ax.get_lines() if line.get_data_3d()]
    bones = next(line for line in lines if len(line) == arm.n + 2)
    np.testing.assert_allclose(bones[-1], state.tip_position)
    assert any(np.array_equal(line, bones[:1]) for line in lines)
    (legend,) = ax.figure.legends  # one, under both
    said = " ".join(" ".join(t.get_text() for t in legend.get_texts()).split())
    assert said.count(state.lost[0].words) == 1
    assert "joint axes that depend on each other" in said
    assert "is drawn" in said
    axes = [line for line in ax.get_lines() if line.get_color() == "#D55E00"]
    assert len(axes) == len({i for d in state.dependences for i in d.indices} - {2})


@pytest.mark.slow
def test_a_flat_ellipsoid_is_a_plate_with_its_lost_direction() -> None:
    state = at(textbook("planar3r", task="position"), [0.3, 0.0, 0.0])
    ax = plot.ellipsoids(state)
    assert [len(each.collections) for each in ax.figure.axes] == [1, 1]
    ax.figure.canvas.draw()  # a warning about a plate would be an error here
    arm = textbook("iiwa14", task="position")
    bent, stretched = at(arm, [0.1, 0.5, 0.2, 1.0, 0.3, 0.4, 0.0]), at(arm, 0.5 * np.eye(7)[1])
    assert not any("lost" in text for text in labels(plot.ellipsoids(bent)))
    ax = plot.ellipsoids(stretched, kind="translational")
    (line,) = (one for one in ax.get_lines() if "lost" in str(one.get_label()))
    ends = np.diff(line.get_data_3d(), axis=1)[:, 0]
    along = ends / np.linalg.norm(ends)
    assert abs(along @ [np.sin(0.5), 0, np.cos(0.5)]) == pytest.approx(1)  # it gets no longer
    assert "translational: lost direction" in labels(ax)


def test_singular_values_along_a_way_and_where_it_meets_families() -> None:
    arm = ur5()
    way = at_values([0.1, -1.0, 1.2, 0.3, 0.0, 0.2], 4, np.linspace(-0.5, 0.5, 8))
    for times, length, said in (
        (None, 1.0, "path length in joint space [rad]"),
        (np.linspace(0, 2, 8), 2.0, "time [s]"),
    ):
        ax = plot.sigma_along(arm, way, times=times, forms=closed_form(arm))
        assert (ax.get_yscale(), ax.get_xlabel()) == ("log", said)
        assert ax.get_xlim() == pytest.approx((0.0, length))
        places = {text.get_text(): text.xy[0] for text in ax.texts}
        assert places == {"F2": pytest.approx(length / 2)}
        # Between two configurations of the way: the line comes down to it all the same.
        (dot,) = marks(ax)
        np.testing.assert_allclose(np.asarray(dot.get_xdata()), [length / 2])
        (line,) = (x for x in ax.get_lines() if x.get_label() == r"$\sigma_{\min}$")
        values = line.get_ydata()
        assert (len(values), np.argmin(values)) == (9, 4)
        sigma = singular_values(arm, way)[:, -1]
        np.testing.assert_allclose(np.delete(values, 4), sigma)
        assert "near-singular" in labels(ax)
        assert is_outside(ax)


def test_a_slice_holds_the_best_of_each_place() -> None:
    arm = textbook("scara")
    ax = plot.workspace(arm, samples=4000)
    Q = arm.space.sample(4000, np.random.default_rng(2026))
    tips, sigma = tip_poses(arm, Q)[0], singular_values(arm, Q)[:, -1]
    np.testing.assert_allclose(tips[7], at(arm, Q[7]).tip_position)
    flat = ax.figure.axes[2]
    grid = np.asarray(flat.collections[0].get_array().filled(np.nan))
    assert (flat.get_xlabel(), flat.get_ylabel()) == ("x [m]", "y [m]")
    shown = grid[np.isfinite(grid)]
    assert set(np.round(shown, 9)) <= set(np.round(sigma, 9))
    assert np.isnan(grid).any()
    # The best of all lies in the slab, whose thickness holds all heights of a SCARA.
    assert shown.max() == pytest.approx(sigma.max())
    far = plot.workspace(arm, samples=500, measure="clearance")
    assert "clearance" in far.figure.axes[-1].get_ylabel()


def test_multiples_of_pi() -> None:
    said = [pi_text(x) for x in (*(k * np.pi / 4 for k in (-4, -1, 0, 2, 6)), 1.0)]
    assert said == [r"$-\pi$", r"$-\pi/4$", "0", r"$\pi/2$", r"$3\pi/2$", ""]
    ax = plt.figure().add_subplot()
    ax.set_xlim(-np.pi, np.pi)
    pi_ticks(ax.xaxis, -np.pi, np.pi)
    np.testing.assert_allclose(ax.get_xticks(), np.pi * np.arange(-2, 3) / 2)
    ax.figure.canvas.draw()
    assert ax.get_xticklabels()[0].get_text() == r"$-\pi$"


WRITTEN = [
    ("map puma560 --over q2,q3", "png"), ("curves scara", "pdf"),
    ("map scara --over q1,q2 --q 0,90,0.1,0 --deg", "svg"),
    ("map puma560 --over q2,q3 --family F1", "png"),
    ("locus puma560 --family F2 --each q4=0,60 --deg", "png"),
    ("curves stanford --fixed q4=0 --over q2,d3", "svg"),
    ("ellipsoids stanford --q 0,1,0,0.3,0.8,0", "png"),
    ("along scara --q 0,1,0.1,0 --q 0,-1,0.1,0", "svg"),
    ("workspace planar3r --task position", "png"), ("aspects scara --over q1,q2", "png"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "suffix"), tiered_rows(WRITTEN, [WRITTEN[4], WRITTEN[-1]]))
def test_the_command_writes_figures(tmp_path: Path, words: str, suffix: str) -> None:
    files = [tmp_path / f"{name}.{suffix}" for name in "ab"]
    for file in files:
        result = run("plot", *words.split(), "-o", file)
        assert result.exit_code == 0, result.output + repr(result.exception)
    first, second = (file.read_bytes() for file in files)
    assert first.startswith({"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix])
    assert len(first) > 3000
    assert first == second


COLOURED = [("puma560", True), ("stanford", False)]


@pytest.mark.parametrize(("name", "limits"), tiered_rows(COLOURED, COLOURED[1:]))
def test_colours_are_those_of_the_aspects(name, limits):
    """Random points of the grid, each asked by itself; few are on an edge."""
    arm = pinsing.load(name)
    found = pinsing.aspects(pinsing.closed_form(arm), limits)
    base = regular_configuration(arm)
    low, high = arm.space.range(not limits)
    a, b = (1, 2) if name == "puma560" else (1, 4)
    grid = np.meshgrid(*(np.linspace(low[k], high[k], 60) for k in (a, b)))
    Q = at_values(base, [a, b], np.column_stack([x.ravel() for x in grid])).reshape(60, 60, -1)
    numbers = _numbers(found, Q)
    rng = np.random.default_rng(0)
    same = [numbers[i, k] == (found.of(Q[i, k]) or 0) for i, k in rng.integers(1, 59, (80, 2))]
    assert np.mean(same) > 0.97
    assert len(np.unique(numbers)) >= 4


def test_the_legend_of_aspects_has_numbers_and_names():
    axes = plot.aspect_plane(pinsing.load("puma560"), "q2", "q3", samples=81)
    assert ["shoulder" in said for said in labels(axes)] == [True] * 6


def orthogonal(d2, d3, d4, r2, r3=0.0):
    """Rows of the arms of Wenger's figures."""
    return [(-90, d2, 0), (90, d3, r2), (0, d4, r3)]


TURNS = [(-90, 0.3, 0.1), (60, 0.7, 0.25), (0, 0.5, 0.2)]
SLIDES = [*TURNS[:2], (0, 0.1, 0, 0, "prismatic", (0.2, 1.0))]
REACHED = [
    # rows, whether limits count, cusps, nodes (or their heights), numbers of solutions; None: any
    (orthogonal(1, 2, 1.5, 1), False, 4, 0, {0, 2, 4}),
    (orthogonal(1, 2, 0.2, 1), False, 0, 0, {0, 2}),
    (orthogonal(1, 2, 1.5, 0), False, 0, None, {0, 2, 4}),
    (orthogonal(1, 1.5, 0.6, 0.3), False, 4, 2, {0, 2, 4}),
    (orthogonal(1, 0.5, 0.7, 0.2), False, 0, 0, {0, 2, 4}),
    ([(90, 0, 0.4), (0, 0.5, 0), (0, 0.4, 0)], False, None, None, {0, 4}),
    # What only rounding crosses is no node: curves on each other, and one of a single place.
    ([(-90, 0, 0), (90, 1, 0), (0, 1.5, 0.5)], False, None, [], None),
    ([(-90, 0, 0), (90, 1, 1), (0, 1.5, 0)], False, None, [-(0.125**0.5), 0.125**0.5], None),
    (TURNS, False, None, None, None), (SLIDES, True, None, None, None),
]  # fmt: skip


@pytest.mark.parametrize(
    ("rows", "limits", "cusps", "nodes", "counts"), tiered_rows(REACHED, REACHED[3:4])
)
def test_places_are_reached_in_as_many_ways_as_are_found(rows, limits, cusps, nodes, counts):
    """And cusps and nodes of orthogonal arms are those of the literature."""
    arm = dh_arm(rows, "position")
    found = reach_of(arm, 120, limits)
    rng, asked = np.random.default_rng(3), 0
    while asked < 12:
        k, j = rng.integers(3, 117, 2)
        if np.ptp(found.count[k - 2 : k + 3, j - 2 : j + 3]):
            continue
        asked += 1
        angle = rng.uniform(-3, 3)
        target = [found.r[j] * math.cos(angle), found.r[j] * math.sin(angle), found.z[k]]
        known = pinsing.inverse(arm, target)
        assert found.count[k, j] == sum(s.within_limits or not limits for s in known)
    if isinstance(nodes, list):
        assert np.sort(found.nodes[:, 1]) == pytest.approx(nodes)
    assert isinstance(nodes, list | None) or len(found.nodes) == nodes
    assert counts is None or set(np.unique(found.count)) == counts
    assert cusps is None or len(found.cusps) == cusps
    for q in found.cusp_joints:
        assert np.linalg.svd(task_jacobian(arm, [0.3, *q]))[1][-1] < 1e-7
    # Where there is a cusp three solutions meet, so that places near by have four.
    for r, z in found.cusps:
        near = np.hypot(found.r[None, :] - r, found.z[:, None] - z) < 0.4
        assert {2, 4} <= set(np.unique(found.count[near]))


def test_counts_are_right_where_joints_end():
    arm = dh_arm(orthogonal(1, 2, 1.5, 1), "position")
    found = reach_of(arm, 21, True)
    row = [len(pinsing.inverse(arm, [r, 0, 0])) for r in found.r]  # z is 0 where joint 2 ends
    assert found.z[10] == pytest.approx(0, abs=1e-12)
    assert found.count[10].tolist() == row


def test_the_section_is_the_arm():
    """Places against Pinocchio, and f against det J over the distance from the first axis."""
    arm = dh_arm(orthogonal(1, 2, 1.5, 1, 0.4), "position")
    section = Section.of(arm)
    rng = np.random.default_rng(0)
    shares = []
    for q in rng.uniform(-3, 3, (20, 3)):
        x, y, z = tip_placement(arm, q).translation
        assert section.place(q[1:]) == pytest.approx((math.hypot(x, y), z), abs=1e-12)
        det = float(np.linalg.det(task_jacobian(arm, q))) * arm.length_scale**3
        shares.append(det / float(section.singular(q[1:])))
    assert np.ptp(np.abs(shares)) < 1e-9 * np.abs(shares[0])


def puma_locus(*joints, of=PUMA, **options):
    return plot.locus(textbook(PUMA), closed_form(textbook(of)).families[0], *joints, **options)


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (lambda: plot.aspect_plane(textbook(PUMA), "q1", "q1"), "two different"),
        (lambda: puma_locus("q2", "q3", third="q5"), "belong together"),
        (lambda: puma_locus("q2", "q3", third="q2", values=[0.0]), "already"),
        (lambda: puma_locus("q2", "q3", third="q4", values=[]), "a row of 1 to 12"),
        (lambda: puma_locus("q2", "q2"), "two different joints"),
        (lambda: puma_locus("q2", "q3", of="planar3r"), "another arm"),
        (lambda: plot.sigma_along(textbook(PUMA), np.zeros((3, 6))), "no length"),
        (lambda: plot.sigma_curves(sweep(ur5(), levels=1, samples=5), arm=textbook(PUMA)),
         "other joints"),
        (lambda: plot.ellipsoids(at(ur5(), np.ones(6)), arm=textbook(PUMA)), "other joints"),
        (lambda: plot.workspace(textbook("planar3r"), [None], samples=500), "three"),
    ],
)  # fmt: skip
def test_what_cannot_be_drawn_is_refused(draw, words):
    with pytest.raises((OptionError, UnknownNameError, ConfigurationError), match=words):
        draw()


def written(figure: Figure) -> list[tuple[str, Bbox]]:
    """What is drawn of a figure's texts, box by box, pixels: a legend is one box."""
    with patch.object(Text, "draw", autospec=True, side_effect=Text.draw) as draw:
        figure.canvas.draw()
    legends, spaces = figure.findobj(Legend), figure.findobj(Axes3D)
    # Labels and texts of axes in space stand within the picture.
    within = {text for part in (*legends, *spaces) for text in part.findobj(Text)}
    within -= {title for ax in spaces for title in (ax.title, ax._left_title, ax._right_title)}
    texts = dict.fromkeys(call.args[0] for call in draw.call_args_list)
    said = [t for t in texts if t.get_visible() and t not in within and not is_mark(t)]
    found = [(t.get_text(), t.get_window_extent()) for t in said]
    found += [("legend", legend.get_window_extent()) for legend in legends]
    return [(name, box) for name, box in found if name and box.width > 1 and box.height > 1]


def is_mark(text: Text) -> bool:
    """Whether a text is a mark within the data, which may lie where data lie."""
    ax, middle = text.axes, text.get_window_extent().get_points().mean(0)
    return ax is not None and text in ax.texts and ax.get_window_extent().contains(*middle)


def overlaps(figure: Figure) -> list[str]:
    """Pairs of texts of which one covers more than two pixels of the other each way."""
    said = []
    for (one, a), (other, b) in combinations(written(figure), 2):
        both = Bbox.intersection(a, b)
        if both is not None and both.width > 2 and both.height > 2:
            said.append(f"{one!r} over {other!r}")
    return said


def test_overlaps_are_seen() -> None:
    figure, ax = plt.subplots()
    ax.plot([0, 1], label="a")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1))
    ax.text(0.5, -0.15, "a caption", transform=ax.transAxes, ha="center")
    assert "'a caption' over 'legend'" in overlaps(figure)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Figure]:
    """The figure that a command writes."""

    def draw(*words: object) -> Figure:
        kept: list[Figure] = []
        monkeypatch.setattr("pinsing.cli.show.save_figure", lambda f, *a, **k: kept.append(f))
        done = run("plot", *words, "-o", tmp_path / "a.png")
        if done.exit_code == 2:
            pytest.skip(done.output.strip().splitlines()[-1])
        assert done.exit_code == 0, done.output
        return kept[0]

    return draw


def words_of(kind: str, arm: pinsing.Arm) -> list[str]:
    """What a kind needs besides the robot."""
    over = ["--over", ",".join(arm.joints[1:3])]
    zero = ",".join("0" for _ in arm.joints)
    more = ",".join("0.4" for _ in arm.joints)
    along = [f"--q={zero}", f"--q={more}"]
    needed = {"map": over, "aspects": over, "locus": ["--family", "F1"], "along": along}
    return needed.get(kind, [])


SERIAL = ("planar3r", "scara", "stanford", "surgical7", "puma560", "irb1400", "iiwa14", "ur5",
          "panda", "xarm7", "kinova", "z1", "tiago", "so101", "talos_arm")  # fmt: skip
KINDS = ("curves", "map", "locus", "ellipsoids", "along", "workspace", "aspects", "solutions")
MECHANISMS = sorted(p.name.split(".")[0] for p in URDF.glob("*.loops.yaml"))
DRAWN = [*product(SERIAL, KINDS), *product(MECHANISMS, ("map", "curves", "ellipsoids", "modes"))]


@pytest.mark.parametrize(
    ("robot", "kind"), tiered_rows(DRAWN, [("surgical7", "curves"), ("scara", "map")])
)
def test_no_text_lies_over_another(drawn: Callable[..., Figure], robot: str, kind: str) -> None:
    loops = robot in MECHANISMS
    words = ["--loops"] if loops else words_of(kind, pinsing.load(robot))
    figure = drawn(kind, URDF / f"{robot}.urdf" if loops else robot, *words)
    assert overlaps(figure) == []


def test_angles_of_figures_are_in_degrees_unless_radians_are_asked_for(drawn, monkeypatch):
    for words, unit in (([], "deg"), (["--deg"], "deg"), (["--rad"], "rad")):
        for kind in ("map", "locus"):
            figure = drawn(kind, "planar3r", *words_of(kind, pinsing.load("planar3r")), *words)
            assert f"[{unit}]" in figure.axes[0].get_xlabel()
    monkeypatch.setattr("pinsing.loops.curves", lambda arm, _, k: (trace(arm, arm.home, k),))
    figure = drawn("curves", URDF / "four_bar.urdf", "--loops")
    assert any("deg" in ax.get_xlabel() for ax in figure.axes)
