"""Pictures of mechanisms: maps, slices through the workspace by mode, curves, modes."""

import itertools
import sys

import click
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from click.testing import CliRunner
from mechanisms import analyzed, assembled, hexagons, shipped
from tiers import sampled, tiered, tiered_rows
from urdf_text import J, Y, frame

from pinsing import loops
from pinsing.cli.mechanism import analyze_loops, view_loops
from pinsing.cli.options import argument, command, joint_values, option
from pinsing.cli.show import plot_loops
from pinsing.errors import OptionError, PinsingError
from pinsing.loops.closure import BatchLoops, Loops, output_pose, planar_dyad, random_closed
from pinsing.loops.map import cannot_close, pose_slice
from pinsing.loops.motion import COORDINATES, kinds_of, measure_many, pose_of
from pinsing.loops.solve import working_modes
from pinsing.plot import mechanism as plots

MEASURED = ["five_bar", "planar_3rrr", "gough_stewart", "bennett", "agile_eye", "rssr"]
CLOSING = ["gough_stewart", "stewart_6_3", "planar_3rrr", "planar_3rpr", "hexaglide", "delta"]


@pytest.mark.parametrize("name", sampled(MEASURED))
def test_many_at_once_equal_one_by_one(name, rng):
    mechanism = shipped(name).without_limits()
    Q = random_closed(mechanism, 6, rng)
    for kind in ("type 1", "type 2"):
        point = loops.refine(mechanism, Q[0], kind)
        Q += [point.q] if point.converged else []
    found = measure_many(BatchLoops(mechanism), np.array(Q))
    kinds = kinds_of(found)
    for q, measures, kind in zip(Q, found.T, kinds, strict=True):
        state = loops.mechanism_at(mechanism, q)
        one = (state.output_ratio, state.input_ratio, state.constraint_ratio)
        assert measures == pytest.approx(one, rel=1e-7, abs=1e-11)
        assert kind == ("near" if state.near else state.kind)
    assert {*kinds.tolist()} != {"regular"} or name in ("gough_stewart", "bennett")


def test_a_map_is_that_of_its_seed_and_more_actuators_hold_at_least_as_well():
    plain = shipped("planar_3rrr")
    extra = plain.with_actuated(["a1", "a2", "a3", "b1"])
    one, again, more = (loops.mechanism_map(m, count=100) for m in (plain, plain, extra))
    other = loops.mechanism_map(plain, count=100, seed=6)
    assert one.to_json() == again.to_json() != other.to_json()
    assert "\u00a0" not in str(one)
    assert more.closed == one.closed > 10
    assert (more.input_ratio >= one.input_ratio - 1e-12).all()
    # Poses are drawn where the limits let the platform go.
    poses = loops.mechanism_map(shipped("planar_3rpr"), "poses", 100)
    within, two = poses.closed - poses.beyond, poses.near["type 2"]
    assert min(within - 50, two) > 0
    assert f"type 2 {two} ({100 * two / within:.3g} %)" in " ".join(str(poses).split())


@pytest.mark.parametrize("name", sampled(CLOSING))
def test_what_closes_is_never_said_to_be_impossible(name, rng):
    mechanism = shipped(name).without_limits()
    actuated = list(mechanism.actuated)
    closed = np.array(random_closed(mechanism, 40, rng))[:, actuated]
    assert len(closed) > 5
    assert not cannot_close(mechanism, closed).any()


def test_impossible_inputs_of_a_platform_are_those_of_the_triangle(rng):
    """The points of the 6-3 are pairs that share one: the triangle's inequality, from the table."""
    mechanism, both = shipped("stewart_6_3"), list(hexagons("stewart_6_3"))
    inputs = rng.uniform(0.3, 2.5, (300, 6))
    open_ = np.zeros(300, dtype=bool)
    for pair in itertools.combinations(range(6), 2):
        apart = [np.linalg.norm(np.subtract(*points[[*pair]])) for points in both]
        sides = np.column_stack([np.tile(apart, (300, 1)), inputs[:, pair]])
        open_ |= 2 * sides.max(axis=1) > sides.sum(axis=1) + 1e-9
    assert 100 < open_.sum() < 300
    assert (cannot_close(mechanism, inputs) == open_).all()


OVER = {
    "five_bar": ("x", "y"), "planar_3rrr": ("x", "y"), "planar_3rpr": ("y", "yaw"),
    "gough_stewart": ("z", "pitch"), "stewart_6_3": ("x", "roll"), "delta": ("x", "z"),
    "rps3": ("roll", "pitch"), "agile_eye": ("yaw", "roll"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", OVER)
def test_each_pose_of_a_slice_is_closed_and_has_its_coordinates(name: str) -> None:
    mechanism = shipped(name)
    start = loops.home(mechanism)
    found = pose_slice(mechanism, OVER[name], [start], samples=31)
    assert found.inside.any()
    closing, rows = Loops(mechanism), [COORDINATES.index(n) for n in found.names]
    reached = np.argwhere(np.isfinite(found.q[0]).all(axis=-1))
    for j, i in reached[:: max(1, len(reached) // 60)]:
        q = found.q[0, j, i]
        assert np.abs(closing.scaled(q)[0]).max() <= 1e-8
        pose = pose_of(output_pose(mechanism, q))
        wanted = np.array([found.x[i], found.y[j]])
        if abs(pose.angles[1]) < 1.5 and np.abs(wanted).max() < 1.5:
            got = np.array([*pose.position, *pose.angles])[rows]
            np.testing.assert_allclose(got, wanted, atol=1e-7)
        kept = not mechanism.space.outside(q).any()
        assert found.inside[0, j, i] == (found.margin[0, j, i] >= -1e-9) == kept


@pytest.mark.slow
def test_a_five_bar_reaches_what_its_legs_reach_in_each_working_mode() -> None:
    """Each leg reaches a ring about its pivot: the workspace is where the rings meet."""
    mechanism = shipped("five_bar")
    dyad = planar_dyad(mechanism)
    modes = working_modes(mechanism).modes
    assert len(modes) == 4
    found = pose_slice(mechanism, ("x", "y"), [m.q for m in modes], samples=61)
    x, y = np.meshgrid(found.x, found.y)
    rings = np.ones_like(x, dtype=bool)
    sure = np.ones_like(rings)
    for pivot, arm, rod in zip(dyad.pivots, abs(dyad.arms), dyad.rods, strict=True):
        away = abs(x + 1j * y - pivot)
        most, least = arm + rod, abs(arm - rod)
        rings &= (away < most) & (away > least)
        sure &= (np.abs(away - most) > 0.03) & (np.abs(away - least) > 0.03)
    assert not np.concatenate([rings[[0, -1]], rings[:, [0, -1]].T]).any()  # it holds all of it
    for k, mode in enumerate(modes):
        assert (found.inside[k] == rings)[sure].all()
        elbows = mode.mode.partition("elbows ")[2]
        places = np.argwhere(found.inside[k] & sure)
        for j, i in places[:: len(places) // 25]:
            assert loops.mode_of(mechanism, found.q[k, j, i]).endswith(f"elbows {elbows}")


@pytest.mark.slow
def test_an_aspect_has_one_sign_of_type_2_and_the_lines_are_singular() -> None:
    mechanism = shipped("five_bar")
    found = pose_slice(mechanism, ("x", "y"), [loops.home(mechanism)], samples=61)
    panel = plots.panels(mechanism, found, ["home"])[0]
    assert panel.numbers.max() == len(panel.positive) >= 2
    assert set(panel.positive) == {True, False}
    for number, plus in enumerate(panel.positive, 1):
        places = np.argwhere(panel.numbers == number)
        for j, i in places[:: max(1, len(places) // 20)]:
            state = loops.mechanism_at(mechanism, found.q[0, j, i])
            assert state.mode.startswith("assembly +" if plus else "assembly -")
    # Between neighbours of other signs there is a configuration of type 2.
    left = next(left for kind, left in panel.lefts if kind == "type 2")
    change = np.argwhere(left[:, 1:] * left[:, :-1] < 0)
    assert len(change) > 20
    for j, i in change[::10]:
        point = loops.refine(mechanism, found.q[0, j, i], "type 2")
        assert point.converged
        at = output_pose(mechanism, point.q).translation[:2]
        away = np.linalg.norm(at - [found.x[i], found.y[j]])
        assert away < 2 * np.hypot(found.x[1] - found.x[0], found.y[1] - found.y[0])


REFUSED = [
    (plots.pose_maps, "planar_3rpr", ("x", "z"), "over two of x, y, yaw; got x, z"),
    (plots.pose_maps, "rps3", ("x", "y"), "over two of z, roll, pitch; got x, y"),
    (plots.pose_maps, "bennett", ("x", "y"), "freedom: its poses are a curve"),
    (plots.motion_curve, "four_bar", ("x", "y"), "x does not move"),
    (plots.motion_curve, "four_bar", ("crank", "rocker"), "of crank, x, y"),
    (plots.motion_curve, "four_bar", (), "goes over two of crank, x, y"),
    (plots.motion_curve, "five_bar", None, "has 2 degrees of freedom"),
    (plots.input_map, "planar_3rrr", "+", "two cranks"),
    (plots.input_map, "five_bar", "left", r"must be \+ or -"),
]


@pytest.mark.parametrize(("draw", "name", "over", "words"), REFUSED)
def test_what_cannot_be_drawn_is_said(draw, name, over, words) -> None:
    with pytest.raises(OptionError, match=words):
        draw(shipped(name), over)


def test_a_four_bar_is_drawn_over_its_input_by_assembly_mode() -> None:
    mechanism = shipped("four_bar")
    ax = plots.motion_curve(mechanism, None)
    assert {plots.PLUS, plots.MINUS} <= {line.get_color() for line in ax.lines}
    said = [t.get_text() for t in ax.get_legend().get_texts()]
    assert {"type 1", "type 2"} <= set(said)
    ends = [line.get_data() for line in ax.lines if line.get_marker() == "o"]
    at = sorted(abs(float(x[0])) for x, _ in ends)
    # The ends of the crank's range, and where crank and coupler are in line.
    np.testing.assert_allclose(at, [40.9746, 40.9746, 82.8192, 82.8192], atol=1e-3)
    # Each lies on the curve.
    curve = np.concatenate(
        [np.column_stack(line.get_data()) for line in ax.lines if line.get_marker() != "o"]
    )
    for x, y in ends:
        assert np.nanmin(np.linalg.norm(curve - [x[0], y[0]], axis=1)) < 3.5  # NaN: gaps


def test_modes_are_drawn_side_by_side() -> None:
    figure = plots.mode_sheet(shipped("five_bar"))
    titles = [ax.get_title().replace("\xa0", " ") for b in figure.subfigs for ax in b.axes]
    assert [len(block.axes) for block in figure.subfigs] == [2, 4]
    assert titles[0].startswith("1: assembly +, elbows -+\nx 0.60, y 1.6")
    assert titles[5].startswith("4: ")
    assert "q1 " in titles[5]
    assert figure.subfigs[0].get_suptitle().startswith("At these inputs: 2 assembly modes")


def contour(ax, color: str) -> np.ndarray:
    """Points of the contour lines of a colour."""
    wanted = mpl.colors.to_rgb(color)
    out = []
    for c in ax.collections:
        edge = c.get_edgecolor()
        if len(edge) and np.allclose(edge[0][:3], wanted) and c.get_array() is not None:
            out += [p.vertices for p in c.get_paths() if len(p.vertices)]
    return np.concatenate(out)


def _upright_arm(folder):
    """A palletizer in x and z: the forearm is held by a parallelogram, the tool is at its end."""
    joints = [
        J("m1", "base", "upper", axis=Y),
        J("elbow", "upper", "fore", (0, 0, 0.5), Y),
        frame("tool", "fore", (0.6, 0, 0.2)),
        frame("back", "fore", (-0.15, 0, 0)),
        J("m2", "base", "crank", axis=Y),
        J("knee", "crank", "push", (-0.15, 0, 0), Y),
        frame("end", "push", (0, 0, 0.5)),
    ]
    return assembled(folder, joints, [("back", "end")], ["m1", "m2"], "tool", "vx, vz")


MAPS = [("five_bar", "+"), ("five_bar", "-"), ("upright", "+")]


@pytest.mark.parametrize(("name", "sign"), tiered_rows(MAPS, MAPS[1:]))
def test_lines_of_a_map_over_the_inputs_are_singular_in_its_mode(name, sign, tmp_path):
    """Of a palletizer the output, which is not the pin of both legs, loses a direction."""
    mechanism = _upright_arm(tmp_path) if name == "upright" else shipped(name)
    dyad = planar_dyad(mechanism)
    ax = plots.input_map(mechanism, sign, samples=181, degrees=False)
    plots.map_legend(ax)
    said = [t.get_text() for t in ax.get_legend().get_texts()]
    assert any("leg" in text for text in said) == (name == "five_bar")
    assert ("type 1: the output loses a direction" in said) == (name == "upright")
    left = plots.is_left(mechanism, dyad) == (sign == "+")
    both = ((plots.TYPE_1, "output_ratio"), (plots.TYPE_2, "input_ratio"))
    for color, measure in both[: 1 + (name == "five_bar")]:
        lines = [dyad.configuration(at, left) for at in contour(ax, color)[::7]]
        states = [loops.mechanism_at(mechanism, q) for q in lines if np.isfinite(q).all()]
        # Elsewhere a parallelogram is flat.
        found = [getattr(s, measure) for s in states if s.constraint_ratio > 0.05]
        assert len(found) > 20
        assert np.quantile(found, 0.95) < 0.02
    # None is missing: singular points that are known lie on lines.
    known = analyzed("five_bar").points if name == "five_bar" else ()
    ones = [p.inputs for p in known if (p.kind, p.mode[9:10]) == ("type 1", sign)]
    away = [
        np.abs(np.angle(np.exp(1j * (contour(ax, plots.TYPE_1) - x)))).max(axis=1).min()
        for x in ones
    ]
    assert max(away, default=0) < 0.1
    assert len(away) > 3 or name == "upright"


def test_driven_links_alone_are_blue() -> None:
    # A slide lengthens both its links; of what turns only the crank itself is driven.
    for name, count in (("four_bar", 1), ("planar_3rpr", 6), ("five_bar", 2)):
        mechanism = shipped(name)
        driven = {mechanism.joints[body - 1] for body in plots.driven_bodies(mechanism)}
        assert set(mechanism.inputs) <= driven
        assert len(driven) == count


def test_what_stands_upright_is_drawn_over_x_and_z(tmp_path):
    mechanism = _upright_arm(tmp_path)
    ax = plots.draw_linkage(mechanism, loops.home(mechanism), ellipse=0)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "z [m]")
    (forearm,) = ax.patches
    drawn = np.concatenate([*(line.get_xydata() for line in ax.lines), forearm.get_xy()])
    # The tool is no loose dot: the forearm goes from its back end over the elbow to it.
    for corner in ((0.6, 0.7), (-0.15, 0.5), (0, 0.5), (0, 0), (-0.15, 0)):
        assert np.abs(drawn - corner).max(axis=1).min() < 1e-9
    assert len({tuple(np.round(p, 9)) for p in forearm.get_xy()}) == 3


@pytest.mark.parametrize("kind", tiered(["map", "curves", "ellipsoids"], {"ellipsoids"}))
def test_plots_are_written(kind, tmp_path):
    out = tmp_path / f"{kind}.png"
    asked = [] if kind == "map" else [joint_values("60,60", "--q", True)]
    plot_loops(shipped("five_bar"), kind=kind, out=out, configurations=asked, deg=True, dpi=50)
    assert out.stat().st_size > 5_000


def test_loops_alone_means_the_file_beside_and_its_absence_is_said():
    def told(mechanism, robot, html):
        click.echo(f"{mechanism.loop_file.name} of {robot} to {html}")

    @command("arm", mechanism=told)
    def of_arm(robot: str = argument(), html: str | None = option(None, "-o")) -> None:
        click.echo(f"arm {robot}")

    def said(words):
        return CliRunner().invoke(of_arm, words.split())

    taken = "gough_stewart.loops.yaml of gough_stewart to {}\n"
    assert said("gough_stewart --loops -o a").output == taken.format("a")
    assert said("gough_stewart -o a --loops").output == taken.format("a")
    # Without it the file is found, which is said; --no-loops leaves the loops out.
    done = said("gough_stewart")
    assert done.stdout == taken.format(None)
    assert "--no-loops takes a serial chain" in done.stderr
    assert said("gough_stewart --no-loops").output == "arm gough_stewart\n"
    for robot in ("ur5", ".", "<robot/>"):
        assert said(robot).output == f"arm {robot}\n"
        assert isinstance(said(f"{robot} --loops").exception, PinsingError)


def test_what_the_time_of_an_analysis_leaves_out_is_said_and_the_rest_kept(capsys):
    assert analyze_loops(shipped("five_bar"), "five_bar", seconds=1e-9) == 130
    said = " ".join(capsys.readouterr().out.split())
    assert "2 assembly modes" in said
    assert "Missing: - working modes: not begun, the time of 1e-09 s was up" in said
    assert "closed forms over the inputs: not begun" in said
    assert "curves of q1, its range and singular points: not begun" in said
    for claim in ("none (neither", "missed", "in nothing"):
        assert claim not in said
    with pytest.raises(OptionError, match="seconds must be positive, got 0"):
        analyze_loops(shipped("five_bar"), "five_bar", seconds=0.0)
    # The curves end with those that are followed.
    mechanism, calls = shipped("four_bar"), iter(range(10_000))
    q = loops.home(mechanism)[list(mechanism.actuated)]
    assert loops.curves(mechanism, q, 0, over=lambda: next(calls) > 5) == ()
    assert loops.find_singular(mechanism, loops.curves(mechanism, q, 0), over=lambda: True) == ()


@pytest.mark.slow
def test_ctrl_c_keeps_what_an_analysis_has_done(monkeypatch, capsys, tmp_path):
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    whole = analyzed("five_bar")
    assert whole.missing == ()
    monkeypatch.setattr(sys.modules["pinsing.loops.solve"], "refine_point", stopped)
    cut = loops.analyze_mechanism(shipped("five_bar"))
    assert cut.missing == (
        "curves of q1, its range and singular points: stopped before its end",
        "curves of q2, its range and singular points: not begun, stopped",
    )
    assert [s.mode for s in cut.working] == [s.mode for s in whole.working]
    assert len(cut.forms.loci) == len(whole.forms.loci)
    assert (cut.points, cut.ranges) == ((), {})
    assert all(c.passed for c in cut.checks)
    assert loops.MechanismAnalysis.from_dict(cut.to_dict()).missing == cut.missing
    # A page or a report of half an analysis is none.
    with pytest.raises(KeyboardInterrupt):
        view_loops(shipped("five_bar"), html=tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


def test_regions_of_a_slice_are_parted_by_the_loci_alone():
    # Within a disc, parted by a line and by a circle that stays inside.
    x, y = np.meshgrid(np.linspace(-1, 1, 201), np.linspace(-1, 1, 201))
    inside = x**2 + y**2 < 0.9
    numbers, signs = plots.regions(inside, [y - 0.2, (x - 0.1) ** 2 + (y + 0.4) ** 2 - 0.04])
    assert numbers.max() == len(signs) == 3
    assert (numbers[~inside] == 0).all()
    below, above, hole = (numbers[k] for k in ((60, 40), (150, 100), (60, 110)))
    assert len({below, above, hole}) == 3
    assert signs[above - 1] == signs[hole - 1] != signs[below - 1]
    assert len(set(plots.colors([True, True, False]))) == 3
    # Round a whole turn the outer parts are one.
    band = [np.cos(np.pi * y)]
    assert plots.regions(np.ones_like(inside), band)[0].max() == 3
    assert plots.regions(np.ones_like(inside), band, (False, True))[0].max() == 2


def test_the_border_of_what_is_reached_is_where_type_1_is_zero():
    # A disc, and a half plane, whose left sides go to zero as roots of the distance do.
    x, y = np.meshgrid(np.linspace(-1, 1, 61), np.linspace(-1, 1, 61))
    r2, cell = x**2 + y**2, 2 / 60
    reached = (r2 < 0.61) & (x < 0.437)
    with np.errstate(invalid="ignore"):
        ones = [np.where(reached, np.sqrt(0.61 - r2), np.nan), np.sqrt(0.437 - x)]
    field = np.ma.masked_invalid(plots.border_field(reached, ones))
    figure, ax = plt.subplots()
    (path,) = ax.contour(x, y, field, levels=[0.0]).get_paths()
    plt.close(figure)
    away = np.abs(np.hypot(*path.vertices.T) - np.sqrt(0.61))
    across = np.abs(path.vertices[:, 0] - 0.437)
    corner = np.hypot(path.vertices[:, 0] - 0.437, np.abs(path.vertices[:, 1]) - 0.647)
    off = np.minimum(away, across)[corner > 2 * cell]
    assert off.max() < 0.25 * cell
    assert off.mean() < 0.05 * cell
