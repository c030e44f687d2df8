"""Modes by algebra against those that are found, and loci over the lengths of legs."""

import itertools
import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import assembled, closed_and_refined, placed, shipped
from platforms import (
    Way,
    check_loci,
    planar,
    random_3rps,
    random_eye,
    turned,
    turned_in_plane,
    unit,
)
from tiers import tiered, tiered_rows
from urdf_text import J, X, Y, frame

import pinsing
from pinsing.loops import mechanism_at, pose_forms
from pinsing.loops.closure import output_pose, random_closed
from pinsing.loops.legs import input_loci


def one_rod(folder, ends, seed):
    """A rod with a universal joint and a ball between two cranks (RSSR), or a crank and a slide."""
    rng = np.random.default_rng(seed)
    axes = unit(rng.normal(size=(2, 3)).round(1))
    arms = rng.uniform(-0.5, 0.5, (2, 3)).round(2)
    foot = rng.uniform(-0.5, 0.5, 3).round(2)
    # The row of the output is the motion of its joint: about, or along, x.
    axes[1] = X
    apart = foot + turned(axes[1], 0.3) @ arms[1] - turned(axes[0], 0.4) @ arms[0]
    length = round(float(np.linalg.norm(apart)), 4)
    kind = "continuous" if ends == "crank" else "prismatic"
    limits = None if ends == "crank" else (-9, 9)
    joints = [
        J("crank", "base", "arm", (0, 0, 0), axes[0]),
        J("ux", "arm", "cross", arms[0], X),
        J("uy", "cross", "rod", axis=Y),
        frame("tip", "rod", (0, 0, length)),
        J("other", "base", "rocker", foot, axes[1], kind, limits),
        frame("pin", "rocker", arms[1]),
    ]
    rows = "wx" if ends == "crank" else "vx"
    return assembled(folder, joints, [("tip", "pin")], ["crank"], "rocker", rows)


@pytest.mark.slow
def test_elbows_of_cranks_with_rods_that_leave_their_plane():
    """Each of the 64 working modes has a name of its own: the sign of crank, rod and axis."""
    mechanism = shipped("rus6").without_limits()
    found = pinsing.loops.working_modes(mechanism, starts=4)
    assert len({m.mode for m in found.modes}) == len(found.modes) == 64
    for mode in found.modes[::9]:
        data, signs = placed(mechanism, mode.q), ""
        columns = pin.computeJointJacobians(mechanism.model, data)
        for k in range(1, 7):
            foot, cross, rod = map(mechanism.model.getJointId, (f"a{k}", f"u{k}x", f"u{k}y"))
            arm = data.oMi[cross].translation - data.oMi[foot].translation
            axis = columns[3:, mechanism.model.joints[foot].idx_v]
            signs += "+" if np.cross(arm, data.oMi[rod].rotation[:, 2]) @ axis > 0 else "-"
        assert mode.mode.endswith(f"elbows {signs}")


def triangles(seed):
    """A planar platform at random; with an odd seed of equilateral triangles, unlike turned."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        third = 2 * np.pi * np.arange(3) / 3
        corners = np.stack([np.cos(third), np.sin(third)], axis=1)
        platform = 0.45 * corners @ turned_in_plane(np.pi / 3).T
        return Way("rpr", base=corners, platform=platform)
    base, platform = rng.uniform(-1, 1, (3, 2)), rng.uniform(-0.5, 0.5, (3, 2))
    return Way("rpr", base=base.round(2), platform=platform.round(2))


def lengths(way, at, angle):
    return np.linalg.norm(at + way.platform @ turned_in_plane(angle).T - way.base, axis=1)


def relative(equation, values):
    size = np.abs(np.prod(values**equation.powers, axis=1) * equation.values).sum()
    return abs(float(equation(values))) / size


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_leg_lengths_at_which_the_lines_meet_are_on_the_locus(seed, tmp_path):
    rng = np.random.default_rng(seed)
    mechanism = planar(tmp_path, triangles(seed)).without_limits()
    found = input_loci(mechanism)
    on, beside = [], []
    for asked, q, kind in closed_and_refined(mechanism, 16, rng, "type 2"):
        place = on if kind == "type 2" else beside
        if asked in ("", kind):
            place.append(min(relative(x, q[list(mechanism.actuated)]) for x in found))
    if seed % 2:  # turned alike, every position is
        alike = lengths(triangles(seed), rng.uniform(-1, 1, 2), -np.pi / 3)
        on.append(min(relative(x, alike) for x in found))
    assert min(len(on), len(beside)) > 5
    # Of degree 24, so that terms cancel to many digits everywhere.
    assert max(on) < 1e-14
    assert np.median(beside) > 1e4 * max(on)
    if seed % 2 == 0:
        # Twelve in the squares of the lengths, dense.
        (one,) = found
        assert (len(one.values), one.degree(one.names)) == (455, 24)


def test_mirrored_poses_of_points_in_lines_are_on_no_locus(tmp_path):
    """With one orientation and the same lengths, but apart; where the lines are parallel."""
    base, platform = (np.outer(row, [1.0, 0.0]) for row in ((0, 0.4, 1), (-0.2, 0.1, 0.3)))
    way = Way("rpr", base=base, platform=platform)
    (found,) = input_loci(planar(tmp_path, way))
    for angle in (0.0, np.pi):
        assert relative(found, lengths(way, np.array([0.3, 0.5]), angle)) > 1e-6


@pytest.mark.slow
def test_the_modes_say_that_they_are_all():
    for name, working in (("planar_3rrr", 8), ("planar_3rpr", 1), ("gough_stewart", 1)):
        found = pinsing.loops.working_modes(shipped(name))
        assert (len(found.modes), found.complete) == (working, True)
        assert "all there are, by the two solutions of each leg" in found.statement
    for name in ("planar_3rrr", "planar_3rpr"):
        found = pinsing.loops.assembly_modes(shipped(name))
        assert (len(found.modes), found.complete) == (2, True)
        assert "the real roots of a polynomial of degree 6" in found.statement
    # With one start not all are found, and it says how many there are.
    few = pinsing.loops.assembly_modes(shipped("planar_3rrr"), starts=1)
    assert (len(few.modes), few.complete) == (1, False)
    assert "there are 2, by the real roots" in few.statement


PLANES = {
    "level": ((0.0, 0.0, 0.0), "vx, vy"),
    "upright": ((math.pi / 2, 0.0, 0.0), "vx, vz"),
    "oblique": ((0.3, 0.4, 0.5), "vx, vy, vz"),
}


def legs_in_a_plane(folder, kinds, cut, plane):
    """Two legs, each a crank or a slide with a rod; the second written from the pin."""
    rng = np.random.default_rng(5)
    feet = np.array([[0.0, 0.0], [0.6, 0.0]]) + rng.uniform(-0.1, 0.1, (2, 2))
    yaw, cranks, rods = rng.uniform([[-0.6], [0.2], [0.4]], [[0.6], [0.35], [0.6]], (3, 2))
    axes = [(0, 0, s) for s in rng.choice([1, -1], 2)]
    turn, rows = PLANES[plane]
    raised = 0.05  # of the second leg's foot
    joints = [J("w", "world", "base", (0.1, 0.2, 0.3), kind="fixed", rpy=turn)]
    ends = [(cranks[k] if kinds[k] == "R" else 0, 0, 0) for k in (0, 1)]
    for k in (0, 1):
        how = (axes[k], "continuous", None) if kinds[k] == "R" else (X, "prismatic", (-1, 1))
        foot = (*feet[k], raised * k)
        joints.append(J(f"m{k}", "base", f"c{k}", foot, *how, (0, 0, yaw[k])))
    joints += [J("b0", "c0", "r0", ends[0], axes[0]), frame("p0", "r0", (rods[0], 0, 0))]
    if cut == "pin":
        joints.append(J("b1", "c1", "r1", ends[1], axes[1], rpy=(0, 0, 0.4)))
        joints.append(frame("p1", "r1", (0, rods[1], -raised)))
        loop, output = ("p0", "p1"), "p1"
    else:
        joints.append(J("pin", "p0", "r1", axis=axes[1]))
        joints.append(frame("e1", "r1", (rods[1], 0, raised)))
        kind = "fixed" if cut == "elbow" else "continuous"
        joints.append(J("b1", "c1", "s1", ends[1], axes[1], kind))
        loop, output = ("e1", "s1"), "r1"
    kind = "6d" if cut == "weld" else "3d"
    return assembled(folder, joints, [loop], ["m1", "m0"], output, rows, kind)


CASES = [
    ("PP", "pin", "upright"), ("PP", "elbow", "level"), ("RP", "elbow", "level"),
    ("PR", "elbow", "upright"), ("RR", "elbow", "oblique"), ("RP", "pin", "oblique"),
    ("PR", "weld", "upright"), ("RR", "weld", "oblique"),
]  # fmt: skip


@pytest.mark.parametrize(("kinds", "cut", "plane"), tiered_rows(CASES, CASES[2:3]))
def test_loci_of_two_legs_in_a_plane(tmp_path: Path, kinds: str, cut: str, plane: str) -> None:
    mechanism = legs_in_a_plane(tmp_path, kinds, cut, plane)
    forms = pose_forms(mechanism)
    assert [x.kind for x in forms.loci] == ["type 2", "type 1", "type 1"]
    assert any("in the plane of the mechanism" in n for n in forms.notes) == (plane != "level")
    check_loci(mechanism, np.random.default_rng(8), "type 1", "type 2")


LEG, ROD = "the two solutions of each leg", "the quadratic equation of its rod"
COUNTED = {
    **{f"3-RPR {seed}": (planar, triangles(seed), "the real roots", LEG) for seed in (0, 2, 4, 6)},
    **{f"3-RPS {seed}": (random_3rps, seed, "", "the planes of its hinges") for seed in range(4)},
    **{f"spherical {seed}": (random_eye, seed, "", LEG) for seed in range(6)},
    **{f"crank to crank {seed}": (one_rod, "crank", seed, ROD, ROD) for seed in range(4)},
    **{f"crank to slide {seed}": (one_rod, "slide", seed, ROD, ROD) for seed in range(4)},
    **{" ".join(case): (legs_in_a_plane, *case, "the triangle", LEG) for case in CASES},
}  # fmt: skip


@pytest.mark.parametrize("case", tiered(COUNTED, ("3-RPR 2", "3-RPS 1", "spherical 0")))
def test_modes_that_are_found_are_as_many_as_algebra_counts(case, tmp_path, rng):
    """By Newton's method from many starts, at inputs and poses at random."""
    build, *given, direct, inverse = COUNTED[case]
    mechanism, asked, numbers = build(tmp_path, *given), 0, set()
    for q in itertools.chain.from_iterable(random_closed(mechanism, 10, rng) for _ in range(20)):
        state = mechanism_at(mechanism, q)
        if mechanism.space.outside(q).any() or state.kind != "regular" or state.near:
            continue
        pose = output_pose(mechanism, q)
        solved = {inverse: pinsing.loops.working_modes(mechanism, pose.homogeneous)}
        if direct:
            solved[direct] = pinsing.loops.assembly_modes(mechanism, q[list(mechanism.actuated)])
        for by, found in solved.items():
            assert found.complete
            assert f"all there are, by {by}" in found.statement
            places = [mode.pose.se3 for mode in found.modes]
            assert any(place.isApprox(pose, 1e-6) for place in places)
            numbers.add((by, len(places)))
        asked += 1
        if asked == 4:
            break
    assert asked == 4
    assert max(number for _, number in numbers) > 1


def two_slides(folder: Path, limits: tuple[float, float] = (-9, 9)) -> pinsing.robot.Mechanism:
    """Slides along x, the second at y = 0.3; rods of 0.5 and 0.6."""
    joints = [
        J("d1", "base", "s1", axis=X, kind="prismatic", limits=limits),
        J("a1", "s1", "r1"),
        frame("p1", "r1", (0.5, 0, 0)),
        J("d2", "base", "s2", (0, 0.3, 0), X, "prismatic", limits),
        J("a2", "s2", "r2", axis=(0, 0, -1)),
        frame("p2", "r2", (0, 0.6, 0)),
    ]
    return assembled(folder, joints, [("p1", "p2")], ["d1", "d2"], "p1", "vx, vy")


def test_limits_leave_some_working_modes(tmp_path: Path) -> None:
    back = pinsing.loops.working_modes(two_slides(tmp_path, (-0.3, 0.3)), [0.1, 0.35])
    # d1 = 0.1 +- sqrt(0.25 - 0.1225), d2 = 0.1 +- sqrt(0.36 - 0.0025)
    reach = [0.1 + sign * math.sqrt(x) for x in (0.1275, 0.3575) for sign in (1, -1)]
    assert len(back.modes) == math.prod(
        sum(abs(d) <= 0.3 for d in part) for part in (reach[:2], reach[2:])
    )


def test_a_double_solution_is_one_mode(tmp_path: Path) -> None:
    """Rods in line: Newton's method ends with half of the digits, in as many places as starts."""
    mechanism = two_slides(tmp_path)
    far = math.sqrt(1.1**2 - 0.3**2)
    found = pinsing.loops.assembly_modes(mechanism, [0.0, far])
    assert len(found.modes) == 1
    assert found.complete
    near = pinsing.loops.assembly_modes(mechanism, [0.0, far - 1e-6])  # two of them, 0.8 mm apart
    assert len(near.modes) == 2
