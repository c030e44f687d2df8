"""Plots, by what is in them: artists, their data, labels; and files that come out."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arms import textbook, ur5
from click.testing import CliRunner
from command_line import python
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.contour import ContourSet
from mpl_toolkits.mplot3d import Axes3D
from tiers import tiered_rows

import pinsing
from pinsing import plot
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import closed_form
from pinsing.kinematics.at import at
from pinsing.kinematics.jacobian import frame_jacobian, singular_values
from pinsing.plot.style import pi_text, pi_ticks
from pinsing.sampling.sweeps import SweepResult, sweep


@pytest.fixture(scope="module")
def stanford_sweep() -> SweepResult:
    return sweep(textbook("stanford"), levels=1, samples=61, prune=False)


def labels(ax: Axes) -> list[str]:
    return [t.get_text() for t in ax.get_legend().get_texts()] if ax.get_legend() else []


def is_outside(ax: Axes) -> bool:
    """Whether the legend keeps off the data."""
    ax.figure.canvas.draw()
    return not ax.get_legend().get_window_extent().overlaps(ax.get_window_extent())


@pytest.mark.slow
def test_curves_carry_the_data_of_the_sweep(stanford_sweep: SweepResult) -> None:
    ax = plot.sigma_curves(stanford_sweep)
    q5 = next(line for line in ax.get_lines() if line.get_label() == "$q_{5}$")
    curve = stanford_sweep.curve(None, "q5")
    np.testing.assert_array_equal(q5.get_xdata(), curve.x)
    np.testing.assert_array_equal(q5.get_ydata(), curve.sigma_min)
    assert ax.get_xlabel() == "joint angle [rad]"
    assert ax.get_ylabel() == r"$\sigma_{\min}$"
    assert is_outside(ax)
    assert ax.figure.get_size_inches()[0] == pytest.approx(3.5)


def test_singular_points_that_need_other_joints_are_not_marked() -> None:
    """sin q6 = -1/5 of the surgical arm is singular at q5 = ±90° only, off these curves."""
    arm = textbook("surgical7")
    result = sweep(arm, levels=1, samples=61)
    ax = plot.sigma_curves(result, moving=["q4", "q6"], arm=arm)
    marks = [line for line in ax.get_lines() if line.get_marker() == "o" and len(line.get_xdata())]
    x = np.concatenate([np.asarray(line.get_xdata()) for line in marks])
    np.testing.assert_allclose(np.unique(np.round(x, 6)), [-3.141593, 0, 3.141593], atol=1e-6)
    assert r"$q_{2}$ = $\pi/3$" in ax.get_legend().get_title().get_text()


def test_every_true_zero_is_marked_with_the_arm_alone() -> None:
    """UR5: q2 meets the shoulder family between samples, which nothing has refined."""
    arm = ur5()
    result = sweep(arm, levels=1, samples=37)
    ax = plot.sigma_curves(result, moving=[arm.joints[1]], arm=arm)
    (mark,) = (line for line in ax.get_lines() if line.get_marker() == "o")
    Q = np.tile(result.plan.nominal, (len(mark.get_xdata()), 1))
    Q[:, 1] = mark.get_xdata()
    sigma = singular_values(arm, Q)
    assert (sigma[:, -1] / sigma[:, 0]).max() < 1e-9
    shoulder = closed_form(arm).families[2].equations[0]
    fine = np.linspace(*ax.get_xlim(), 20001)
    Q = np.tile(result.plan.nominal, (len(fine), 1))
    Q[:, 1] = fine
    f = shoulder(Q)
    assert len(mark.get_xdata()) == (f[:-1] * f[1:] < 0).sum() >= 2
    said = ax.get_legend().get_title().get_text()
    assert "rests at" in said
    assert "$q_{1}$ = " in said
    with pytest.raises(OptionError, match="other joints"):
        plot.sigma_curves(result, arm=textbook("planar3r"))


@pytest.mark.slow
def test_the_curve_of_the_puma_lies_in_the_valley() -> None:
    arm = textbook("puma560")
    q = np.array([0.0, 0.0, 0.0, 0.4, 1.0, 0.0])
    ax = plot.sigma_plane(arm, "q2", "q3", q=q, samples=81)
    paths = [p for c in ax.collections if isinstance(c, ContourSet) for p in c.get_paths()]
    points = np.concatenate([p.vertices for p in paths if len(p.vertices)])
    assert len(points) > 40
    Q = np.tile(q, (len(points), 1))
    Q[:, 1:3] = points
    sigma = singular_values(arm, Q)
    on_it = sigma[:, -1] / sigma[:, 0]
    beside = np.concatenate([Q + s * np.eye(6)[1] for s in (-0.2, 0.2)])
    off = singular_values(arm, beside)
    assert on_it.max() < 2e-3
    assert np.median(off[:, -1] / off[:, 0]) > 0.02
    # The elbow is a straight line: q3 alone.
    levels = [line.get_ydata()[0] for line in ax.get_lines() if len(line.get_ydata()) == 2]
    assert any(abs(y - np.arctan2(-0.4318, 0.0203)) < 1e-9 for y in levels)
    assert {text.split(":")[0].split()[0] for text in labels(ax)} == {"F1", "F3"}
    assert is_outside(ax)


def test_the_map_shows_sigma_min_and_its_axes() -> None:
    arm = textbook("stanford")
    q = np.array([0.1, 0.9, 0.3, 0.4, 0.5, 0.2])
    ax = plot.sigma_plane(arm, "q5", "d3", q=q, samples=31)
    mesh = ax.collections[0]
    x, y = np.linspace(-np.pi, np.pi, 31), np.linspace(-0.5, 0.5, 31)
    values = np.asarray(mesh.get_array()).reshape(31, 31)
    probe = q.copy()
    probe[4], probe[2] = x[7], y[20]
    assert values[20, 7] == pytest.approx(singular_values(arm, probe[None])[0, -1], abs=1e-12)
    assert ax.get_xlabel() == "$q_{5}$ [rad]"
    assert ax.get_ylabel() == "$d_{3}$ [m]"
    verticals = sorted(
        line.get_xdata()[0]
        for line in ax.get_lines()
        if len(line.get_xdata()) == 2 and line.get_xdata()[0] == line.get_xdata()[1]
    )
    np.testing.assert_allclose(verticals, [-np.pi, 0, np.pi])
    bar = ax.figure.axes[-1]
    assert bar.get_xlabel() == r"$\sigma_{\min}$"


def test_a_family_of_two_values_is_a_set_of_points() -> None:
    arm = textbook("iiwa14")
    q = np.array([0.3, 0.5, 0.4, 1.0, 0.6, 0.7, 0.2])
    families = [f for f in closed_form(arm).families if set(f.joints) == {"q2", "q6"}]
    assert len(families) == 1
    ax = plot.sigma_plane(arm, "q2", "q6", q=q, samples=21, families=families, ignore_limits=True)
    points = np.concatenate(
        [np.column_stack(line.get_data()) for line in ax.get_lines() if line.get_marker() == "o"]
    )
    assert len(points) == 9
    for point in points:
        probe = q.copy()
        probe[[1, 5]] = point
        assert singular_values(arm, probe[None])[0, -1] < 1e-9


@pytest.mark.slow
def test_a_locus_is_where_the_arm_is_singular() -> None:
    """Every point of each curve, put into the arm, is singular; one curve for each third value."""
    arm = pinsing.load("panda")
    family = next(f for f in closed_form(arm).families if f.equations and len(f.joints) == 3)
    x, third, y = family.joints
    values = (np.pi / 2, -np.pi / 2)
    assert family.generic is not None
    ax = plot.locus(arm, family, x, y, third=third, values=values, ignore_limits=True)
    curves = [c for c in ax.collections if isinstance(c, ContourSet)]
    assert len(curves) == len(values) == len(labels(ax))
    for value, curve in zip(values, curves, strict=True):
        places = np.concatenate([path.vertices for path in curve.get_paths()])[::40]
        assert len(places) > 10
        Q = np.tile(family.generic, (len(places), 1))
        Q[:, arm.joints.index(third)] = value
        Q[:, [arm.joints.index(x), arm.joints.index(y)]] = places
        ratio = singular_values(arm, Q)[:, -1] / singular_values(arm, Q)[:, 0]
        assert (ratio < 1e-3).all()  # the grid's width away from the true curve at most
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


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"third": "q5"}, "belong together"),
        ({"third": "q2", "values": [0.0]}, "already"),
        ({"third": "q4", "values": []}, "a row of 1 to 12"),
        ({"joint_b": "q2"}, "two different joints"),
        ({"family": closed_form(pinsing.load("planar3r")).families[0]}, "another arm"),
    ],
)
def test_a_locus_refuses_what_makes_no_sense(given: dict[str, Any], words: str) -> None:
    arm = pinsing.load("puma560")
    names = dict(zip([f"q{k}" for k in range(1, 7)], arm.joints, strict=True))
    options = {"joint_a": "q2", "joint_b": "q3", "family": closed_form(arm).families[0], **given}
    options = {k: names.get(v, v) if isinstance(v, str) else v for k, v in options.items()}
    with pytest.raises(OptionError, match=words):
        plot.locus(arm, **options)


@pytest.mark.slow
def test_an_ellipsoid_has_the_radii_of_the_state(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = textbook("puma560")
    q = np.array([0.3, 0.4, 0.5, 0.6, 0.7, 0.8])
    drawn = []
    original = Axes3D.plot_surface

    def record(self: Axes3D, X: Any, Y: Any, Z: Any, **style: Any) -> Any:
        drawn.append(np.stack([X, Y, Z], axis=-1).reshape(-1, 3))
        return original(self, X, Y, Z, **style)

    monkeypatch.setattr(Axes3D, "plot_surface", record)
    ax = plot.ellipsoids(at(arm, q), kind="translational", motions="all")
    (points,) = drawn
    J = frame_jacobian(arm, q)[:3]
    inverse = np.linalg.inv(J @ J.T)
    on_it = np.einsum("ni,ij,nj->n", points, inverse, points)
    np.testing.assert_allclose(on_it, 1.0, atol=1e-9)
    assert ax.get_xlabel() == "$v_x$ [m/s]"
    assert len(ax.collections) == 1
    assert ax.get_title() == "translational part of all motions [m/s]"
    assert is_outside(ax)
    drawn.clear()
    ax = plot.ellipsoids(at(arm, q), kind="rotational")  # a pose: pure motions
    assert ax.get_title() == "rotations, tip held [rad/s]"
    J = frame_jacobian(arm, q)
    still = np.linalg.svd(J[:3])[2][3:].T
    inverse = np.linalg.inv(J[3:] @ still @ still.T @ J[3:].T)
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", drawn[0], inverse, drawn[0]), 1.0)


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
    with pytest.raises(OptionError, match="other joints"):
        plot.ellipsoids(state, arm=textbook("planar3r"))


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
    x, y, z = line.get_data_3d()
    ends = np.array([x, y, z])
    along = (ends[:, 1] - ends[:, 0]) / np.linalg.norm(ends[:, 1] - ends[:, 0])
    assert abs(along @ [np.sin(0.5), 0, np.cos(0.5)]) == pytest.approx(1)  # it gets no longer
    assert "translational: lost direction" in labels(ax)


@pytest.mark.slow
def test_singular_values_along_a_way() -> None:
    arm = ur5()
    way = np.zeros((41, 6))
    way[:] = [0.1, -1.0, 1.2, 0.3, 0.0, 0.2]
    way[:, 4] = np.linspace(-0.5, 0.5, 41)
    ax = plot.sigma_along(arm, way, times=np.linspace(0, 2, 41))
    (line,) = (one for one in ax.get_lines() if one.get_label() == r"$\sigma_{\min}$")
    sigma = singular_values(arm, way)
    np.testing.assert_allclose(line.get_ydata(), np.maximum(sigma[:, -1], 1e-12))
    assert ax.get_yscale() == "log"
    assert ax.get_xlabel() == "time [s]"
    (mark,) = (one for one in ax.get_lines() if one.get_marker() == "o")
    np.testing.assert_allclose(np.asarray(mark.get_xdata()), [1.0])
    assert "near-singular" in labels(ax)
    assert is_outside(ax)


def test_families_are_marked_where_a_way_meets_them() -> None:
    arm = ur5()
    way = np.linspace([0.1, -1.0, 1.2, 0.3, -0.5, 0.2], [0.1, -1.0, 1.2, 0.3, 0.5, 0.2], 8)
    ax = plot.sigma_along(arm, way, forms=closed_form(arm))
    assert ax.get_xlabel() == "path length in joint space [rad]"
    assert ax.get_xlim() == pytest.approx((0.0, 1.0))
    marks = {text.get_text(): text.xy[0] for text in ax.texts}
    assert marks == {"F2": pytest.approx(0.5)}
    # Between two configurations of the way: the line comes down to it all the same.
    (dot,) = (one for one in ax.get_lines() if one.get_marker() == "o")
    np.testing.assert_allclose(np.asarray(dot.get_xdata()), [0.5])
    (line,) = (one for one in ax.get_lines() if one.get_label() == r"$\sigma_{\min}$")
    assert len(np.asarray(line.get_xdata())) == 9
    assert np.argmin(line.get_ydata()) == 4
    with pytest.raises(ConfigurationError, match="no length"):
        plot.sigma_along(arm, np.zeros((3, 6)))


def test_a_slice_holds_the_best_of_each_place() -> None:
    from pinsing.kinematics.jacobian import tip_poses

    arm = textbook("scara")
    ax = plot.workspace(arm, samples=4000)
    Q = arm.space.sample(4000, np.random.default_rng(2026))
    tips, sigma = tip_poses(arm, Q)[0], singular_values(arm, Q)[:, -1]
    np.testing.assert_allclose(tips[7], at(arm, Q[7]).tip_position)
    flat = ax.figure.axes[2]
    grid = np.asarray(flat.collections[0].get_array().filled(np.nan))
    assert flat.get_xlabel() == "x [m]"
    assert flat.get_ylabel() == "y [m]"
    shown = grid[np.isfinite(grid)]
    assert set(np.round(shown, 9)) <= set(np.round(sigma, 9))
    assert np.isnan(grid).any()
    # The best of all lies in the slab, whose thickness holds all heights of a SCARA.
    assert shown.max() == pytest.approx(sigma.max())
    far = plot.workspace(arm, samples=500, measure="clearance")
    assert "clearance" in far.figure.axes[-1].get_ylabel()
    with pytest.raises(OptionError, match="three"):
        plot.workspace(arm, [ax], samples=500)


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
    ("workspace planar3r --task position", "png"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "suffix"), tiered_rows(WRITTEN, WRITTEN[4:5]))
def test_the_command_writes_figures(tmp_path: Path, words: str, suffix: str) -> None:
    from pinsing.cli.show import plot_command

    first, second = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    for file in (first, second):
        result = CliRunner().invoke(plot_command, [*words.split(), "-o", str(file)])
        assert result.exit_code == 0, result.output + repr(result.exception)
    heads = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    assert first.read_bytes().startswith(heads[suffix])
    assert first.stat().st_size > 3000
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.slow
def test_a_command_draws_whatever_backend_the_environment_names(tmp_path: Path) -> None:
    out = tmp_path / "a.png"
    words = ["-m", "pinsing", "plot", "ellipsoids", "planar3r", "--q", "0,1,0", "-o", out]
    done = python(*words, env={**os.environ, "MPLBACKEND": "junk"})
    assert done.returncode == 0, done.stderr
    assert out.read_bytes().startswith(b"\x89PNG")
