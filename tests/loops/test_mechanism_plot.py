"""Pictures of mechanisms: slices through the workspace by mode, curves, modes side by side."""

import matplotlib as mpl
import numpy as np
import pytest
from mechanisms import shipped
from tiers import tiered
from urdf_text import J, Y, frame, loop_text, written

from pinsing.errors import OptionError
from pinsing.loops import home, mechanism_at, mode_of, refine
from pinsing.loops.closure import Loops, output_pose, planar_dyad
from pinsing.loops.map import pose_slice
from pinsing.loops.motion import COORDINATES, pose_of
from pinsing.loops.solve import working_modes
from pinsing.plot.mechanism import (
    MINUS,
    PLUS,
    TYPE_1,
    draw_linkage,
    driven_bodies,
    input_map,
    is_left,
    map_legend,
    mode_sheet,
    motion_curve,
    panels,
    pose_maps,
)
from pinsing.robot.mechanism import load_mechanism

OVER = {
    "five_bar": ("x", "y"), "planar_3rrr": ("x", "y"), "planar_3rpr": ("y", "yaw"),
    "gough_stewart": ("z", "pitch"), "stewart_6_3": ("x", "roll"), "delta": ("x", "z"),
    "rps3": ("roll", "pitch"), "agile_eye": ("yaw", "roll"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(OVER, ("planar_3rpr",)))
def test_each_pose_of_a_slice_is_closed_and_has_its_coordinates(name: str) -> None:
    mechanism = shipped(name)
    start = home(mechanism)
    found = pose_slice(mechanism, OVER[name], [start], samples=31)
    assert found.inside.any()
    loops, rows = Loops(mechanism), [COORDINATES.index(n) for n in found.names]
    reached = np.argwhere(np.isfinite(found.q[0]).all(axis=-1))
    for j, i in reached[:: max(1, len(reached) // 60)]:
        q = found.q[0, j, i]
        assert np.abs(loops.scaled(q)[0]).max() <= 1e-8
        pose = pose_of(output_pose(mechanism, q))
        wanted = [found.x[i], found.y[j]]
        got = [[*pose.position, *pose.angles][row] for row in rows]
        if abs(pose.angles[1]) < 1.5 and all(abs(w) < 1.5 for w in wanted):
            np.testing.assert_allclose(got, wanted, atol=1e-7)
        outside = mechanism.space.outside(q).any()
        assert found.inside[0, j, i] == (not outside)
        assert (found.margin[0, j, i] >= -1e-9) == (not outside)


@pytest.mark.slow
def test_a_five_bar_reaches_what_its_legs_reach_in_each_working_mode() -> None:
    """Each leg reaches a ring about its pivot: the workspace is where the rings meet."""
    mechanism = shipped("five_bar")
    dyad = planar_dyad(mechanism)
    assert dyad is not None
    modes = working_modes(mechanism).modes
    assert len(modes) == 4
    found = pose_slice(mechanism, ("x", "y"), [m.q for m in modes], samples=61)
    x, y = np.meshgrid(found.x, found.y)
    rings = np.ones_like(x, dtype=bool)
    sure = np.ones_like(rings)
    for side in dyad.sides:
        away, arm, rod = abs(x + 1j * y - side.pivot), abs(side.arm), abs(side.rod)
        most, least = arm + rod, abs(arm - rod)
        rings &= (away < most) & (away > least)
        sure &= (np.abs(away - most) > 0.03) & (np.abs(away - least) > 0.03)
    # The picture holds all of it.
    assert not rings[[0, -1]].any()
    assert not rings[:, [0, -1]].any()
    for k, mode in enumerate(modes):
        assert (found.inside[k] == rings)[sure].all()
        elbows = mode.mode.partition("elbows ")[2]
        places = np.argwhere(found.inside[k] & sure)
        for j, i in places[:: len(places) // 25]:
            assert mode_of(mechanism, found.q[k, j, i]).endswith(f"elbows {elbows}")


@pytest.mark.slow
def test_an_aspect_has_one_sign_of_type_2_and_the_lines_are_singular() -> None:
    mechanism = shipped("five_bar")
    found = pose_slice(mechanism, ("x", "y"), [home(mechanism)], samples=61)
    panel = panels(mechanism, found, ["home"])[0]
    assert panel.numbers.max() == len(panel.positive) >= 2
    assert set(panel.positive) == {True, False}
    for number, plus in enumerate(panel.positive, 1):
        places = np.argwhere(panel.numbers == number)
        for j, i in places[:: max(1, len(places) // 20)]:
            state = mechanism_at(mechanism, found.q[0, j, i])
            assert state.mode.startswith("assembly +" if plus else "assembly -")
    # Between neighbours of other signs there is a configuration of type 2.
    left = next(left for kind, left in panel.lefts if kind == "type 2")
    change = np.argwhere(left[:, 1:] * left[:, :-1] < 0)
    assert len(change) > 20
    for j, i in change[::10]:
        point = refine(mechanism, found.q[0, j, i], "type 2")
        assert point.converged
        at = output_pose(mechanism, point.q).translation[:2]
        away = np.linalg.norm(at - [found.x[i], found.y[j]])
        assert away < 2 * np.hypot(found.x[1] - found.x[0], found.y[1] - found.y[0])


def test_what_cannot_be_sliced_is_said() -> None:
    with pytest.raises(OptionError, match="goes over two of x, y, yaw; got x, z"):
        pose_maps(shipped("planar_3rpr"), ("x", "z"))
    with pytest.raises(OptionError, match="goes over two of z, roll, pitch; got x, y"):
        pose_maps(shipped("rps3"), ("x", "y"))
    with pytest.raises(OptionError, match="one degree of freedom: its poses are a curve"):
        pose_maps(shipped("bennett"), ("x", "y"))


# One freedom, and modes ---------------------------------------------------------------


def test_a_four_bar_is_drawn_over_its_input_by_assembly_mode() -> None:
    mechanism = shipped("four_bar")
    ax = motion_curve(mechanism, None)
    colors = {line.get_color() for line in ax.lines}
    assert {PLUS, MINUS} <= colors
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
    with pytest.raises(OptionError, match="x does not move"):
        motion_curve(mechanism, ("x", "y"))
    for wrong in (("crank", "rocker"), ()):
        with pytest.raises(OptionError, match="goes over two of crank, x, y"):
            motion_curve(mechanism, wrong)
    with pytest.raises(OptionError, match="has 2 degrees of freedom"):
        motion_curve(shipped("five_bar"))


def test_modes_are_drawn_side_by_side() -> None:
    figure = mode_sheet(shipped("five_bar"))
    titles = [ax.get_title().replace("\xa0", " ") for b in figure.subfigs for ax in b.axes]
    assert [len(block.axes) for block in figure.subfigs] == [2, 4]
    assert titles[0].startswith("1: assembly +, elbows -+\nx 0.60, y 1.6")
    assert titles[5].startswith("4: ")
    assert "q1 " in titles[5]
    assert figure.subfigs[0].get_suptitle().startswith("At these inputs: 2 assembly modes")


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
    text = loop_text([("back", "end")], ["m1", "m2"], "tool", "vx, vz")
    return load_mechanism(written(folder, joints, text))


def test_a_map_over_the_inputs_is_of_the_output_and_not_of_the_pin(tmp_path):
    mechanism = _upright_arm(tmp_path)
    dyad = planar_dyad(mechanism)
    ax = input_map(mechanism, "+", samples=181, degrees=False)
    map_legend(ax)
    said = [t.get_text() for t in ax.get_legend().get_texts()]
    assert "type 1: the output loses a direction" in said
    assert not any("leg" in text for text in said)
    lines = [
        p.vertices
        for c in ax.collections
        if len(c.get_edgecolor())
        and np.allclose(c.get_edgecolor()[0][:3], mpl.colors.to_rgb(TYPE_1))
        for p in c.get_paths()
    ]
    inputs = np.concatenate([x for x in lines if len(x)])[::7]
    left = is_left(mechanism, dyad)
    told = 0
    for at in inputs:
        q = dyad.configuration(at, left)
        if not np.isfinite(q).all():
            continue
        state = mechanism_at(mechanism, q)
        if state.constraint_ratio > 0.05:  # elsewhere the parallelogram is flat
            assert state.output_ratio < 0.03
            told += 1
    assert told > 20


def test_driven_links_alone_are_blue() -> None:
    # A slide lengthens both its links; of what turns only the crank itself is driven.
    for name, count in (("four_bar", 1), ("planar_3rpr", 6), ("five_bar", 2)):
        mechanism = shipped(name)
        driven = {mechanism.joints[body - 1] for body in driven_bodies(mechanism)}
        assert set(mechanism.inputs) <= driven
        assert len(driven) == count


def test_what_stands_upright_is_drawn_over_x_and_z(tmp_path):
    mechanism = _upright_arm(tmp_path)
    ax = draw_linkage(mechanism, home(mechanism), ellipse=0)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "z [m]")
    drawn = np.concatenate(
        [line.get_xydata() for line in ax.lines] + [p.get_xy() for p in ax.patches]
    )
    # The tool is no loose dot: the forearm goes from its back end over the elbow to it.
    for corner in ((0.6, 0.7), (-0.15, 0.5), (0, 0.5), (0, 0), (-0.15, 0)):
        assert np.abs(drawn - corner).max(axis=1).min() < 1e-9
    (forearm,) = ax.patches
    assert len({tuple(np.round(p, 9)) for p in forearm.get_xy()}) == 3
