"""Loci of platforms written in many ways, against the Jacobians, and lines without pinsing."""

from dataclasses import replace

import numpy as np
import pytest
from command_line import run
from mechanisms import URDF, assembled, shipped
from platforms import (
    BASE,
    Way,
    check_loci,
    eye,
    on_legs,
    planar,
    random_3rps,
    random_eye,
    six,
    three,
    turned_in_plane,
    ups,
)
from tiers import tiered
from urdf_text import J, X, Y, frame

import pinsing
from pinsing.loops import joint_forms, mechanism_at, pose_forms, ranks, refine
from pinsing.loops.closure import random_closed, residual, without_length
from pinsing.loops.legs import rods
from pinsing.loops.pose_loci import locus_distance

UNEQUAL = {"crank": np.array([0.39, 0.37, 0.4]), "rod": np.array([0.42, 0.36, 0.44])}
ONE_ELBOW = Way("rrr", driven="aba", **UNEQUAL)
WAYS = {
    "upright": Way("rpr", rpy=(np.pi / 2, 0, 0)), "oblique": Way("rpr", rpy=(0.4, 0.3, 0.2)),
    "in layers": Way("rpr", layers=0.1), "from the platform": Way("rpr", from_platform=(1, 2)),
    "output turned": Way("rpr", output_rpy=(0.7, 0.5, 0.3)), "feet": Way("rpr", driven="r"),
    "cranks": Way("rrr", rpy=(0.4, 0.3, 0.2)), "cut at an elbow": Way("rrr", cut_at_elbow=(2,)),
    "cut at two": Way("rrr", cut_at_elbow=(1, 2), rpy=(np.pi / 2, 0, 0)),
    "cut, oblique": Way("rrr", cut_at_elbow=(1, 2), rpy=(0.4, 0.3, 0.2)),
}  # fmt: skip


def random_rrr(folder, seed):
    rng = np.random.default_rng(seed)
    pivots = np.round(rng.uniform(-1, 1, (3, 2)), 3)
    corners = np.round(rng.uniform(-0.3, 0.3, (3, 2)), 3)
    cranks, bars = np.round(rng.uniform(0.4, 0.8, (2, 3)), 3)
    way = Way("rrr", base=pivots, platform=corners, crank=cranks, rod=bars)
    return planar(folder, way)


def random_stewart(folder, seed):
    """Level ones and others; some of the legs written from the platform."""
    rng = np.random.default_rng(seed)
    base = np.round(rng.uniform(-1, 1, (6, 3)) * [1, 1, seed % 2], 2)
    platform = np.round(rng.uniform(-0.5, 0.5, (6, 3)) * [1, 1, seed % 3], 2)
    return ups(folder, base, platform, hanging=(1, 2, 3, 4, 5)[: (seed + 1) % 6])


def driven_feet(folder, driven):
    """Legs of which each foot, or slide, or both are driven."""
    rng = np.random.default_rng(7)
    base = rng.uniform(-1, 1, (len(driven), 3)).round(2)
    platform = rng.uniform(-0.4, 0.4, (len(driven), 3)).round(2)
    inputs = [f"{n[0]}{k}{n[1:]}" for k, names in enumerate(driven) for n in names]
    return ups(folder, base, platform, driven=inputs)


def turned_delta(folder):
    """Its loci are not over a level output: cranks shared by two rods, and freedoms of three."""
    text = (URDF / "delta.urdf").read_text()
    start = text.index("<origin ", text.index('name="platform_center_mount"')) + len("<origin ")
    (folder / "delta.urdf").write_text(f'{text[:start]}rpy="0 0 0.5" {text[start:]}')
    (folder / "delta.loops.yaml").write_text((URDF / "delta.loops.yaml").read_text())
    return pinsing.load_mechanism(folder / "delta.urdf")


def irregular_delta(folder, off=0.0):
    """A Delta with legs at odd angles and of unequal sizes; one foot is off by some metres."""
    legs, ends = [], []
    for k, (angle, base, top) in enumerate([(0, 0.3, 0.14), (100, 0.25, 0.1), (215, 0.28, 0.12)]):
        out, across = turned_in_plane(np.radians(angle)).T @ np.eye(2, 3)
        crank = [J(f"a{k}", "base", f"crank{k}", base * out, -across)]
        for side, name in ((0.06, f"{k}l"), (-0.06, f"{k}r")):
            up = np.array([0, 0, off if name == "2r" else 0])
            legs.append([
                *crank,
                J(f"u{name}x", f"crank{k}", f"cross{name}", 0.2 * out + side * across, X),
                J(f"u{name}y", f"cross{name}", f"rod{name}", axis=Y),
                frame(f"e{name}", f"rod{name}", (0, 0, 0.5)),
            ])  # fmt: skip
            ends.append(top * out + side * across + up)
            crank = []
    return on_legs(folder, legs, np.array(ends), ["a0", "a1", "a2"], "vx, vy, vz", "w")


def from_the_shelf(_, name):
    return shipped(name)


ONE, TWO, BOTH = ("type 1",), ("type 2",), ("type 1", "type 2")
UPS = [["ux"], ["uy"], ["p"], ["ux"], ["uy"], ["p"]]
LOCI = {
    **{f"planar, {name}": (planar, way, TWO) for name, way in WAYS.items()},
    **{f"3-RRR {seed}": (random_rrr, seed, BOTH) for seed in range(3)},
    **{f"6-UPS {seed}": (random_stewart, seed, TWO) for seed in range(7)},
    **{f"3-RPS {seed}": (random_3rps, seed, ONE) for seed in range(4)},
    **{f"spherical {seed}": (random_eye, seed, BOTH) for seed in range(4)},
    **{f"{legs} {n}": (six, legs, n, BOTH) for legs in ("pus", "rus") for n in range(2)},
    **{f"{legs} {n}": (three, legs, n, BOTH) for legs in ("prs", "rrs", "rps") for n in range(2)},
    **{name: (from_the_shelf, name, TWO) for name in ("gough_stewart", "stewart_6_3", "rps3")},
    **{name: (from_the_shelf, name, BOTH) for name in ("planar_3rrr", "hexaglide", "rus6")},
    "planar_3rpr": (from_the_shelf, "planar_3rpr", TWO),
    "delta": (from_the_shelf, "delta", (*BOTH, "constraint")),
    "delta, irregular": (irregular_delta, (*BOTH, "constraint")),
    "delta, output turned": (turned_delta, BOTH),
    "one elbow": (planar, ONE_ELBOW, BOTH),
    "elbows": (planar, replace(ONE_ELBOW, driven="b"), BOTH),
    "feet, one each": (driven_feet, UPS, TWO),
    "feet, two each": (driven_feet, [["ux", "uy"], ["p", "ux"], ["uy", "p"]], TWO),
    "feet across": (driven_feet, [["uy"]] * 6, TWO),
}  # fmt: skip
QUICK = ("planar, output turned", "3-RRR 0", "6-UPS 6", "rrs 0", "rps3", "delta", "one elbow")


@pytest.mark.parametrize("case", tiered(LOCI, QUICK))
def test_loci_are_where_the_velocity_of_the_output_is_zero_or_ends(case, tmp_path, rng):
    build, *given, kinds = LOCI[case]
    check_loci(build(tmp_path, *given), rng, *kinds)


@pytest.mark.slow
def test_a_delta_has_loci_of_a_level_output_where_rods_of_a_crank_are_parallel(tmp_path):
    irregular = irregular_delta(tmp_path)
    along = np.array([rod.outer - rod.inner for rod in rods(irregular).rods])
    assert 0 < np.abs(along[::2] - along[1::2]).max() < 1e-11  # rounding tells them apart
    for mechanism in (shipped("delta"), irregular):
        *level, both, one = pose_forms(mechanism).loci
        kinds = sorted(x.kind for x in level)
        assert kinds == ["constraint", "type 1", "type 1", "type 1", "type 2"]
        assert (both.kind, one.kind) == ("type 2 or constraint", "type 1")
        assert all("e0" in x.equation.names for x in (both, one))
        assert not any("e0" in x.equation.names for x in level)
    both, one = pose_forms(irregular_delta(tmp_path, 1e-6)).loci
    assert (both.kind, one.kind) == ("type 2 or constraint", "type 1")


def test_similar_hexagons_are_singular_everywhere_on_a_conic_only(tmp_path):
    rng = np.random.default_rng(5)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 6))
    ellipse = np.round(np.stack([np.cos(angles), 0.6 * np.sin(angles), 0 * angles], axis=1), 12)
    loose = np.round(rng.uniform(-1, 1, (6, 3)) * [1, 1, 0], 2)
    for base, everywhere in ((ellipse, True), (loose, False)):
        mechanism = ups(tmp_path, base, 0.5 * base)
        forms = pose_forms(mechanism)
        for q in random_closed(mechanism, 8, rng):
            assert (mechanism_at(mechanism, q).input_ratio < 1e-9) == everywhere
        if everywhere:
            assert "platform and base hexagons are similar" in forms.architecture
        else:
            assert not forms.architecture
            # Not turned about the normal they are dependent all the same.
            assert any(str(x.equation) == "e3 = 0" for x in forms.loci)


@pytest.mark.slow
def test_an_equation_of_one_term_says_how_near_it_is(tmp_path):
    """A platform like its base: not turned at all it is singular at every position."""
    mechanism = planar(tmp_path, Way("rpr", platform=0.5 * (BASE - BASE.mean(axis=0))))
    forms = pose_forms(mechanism)
    assert any(len(x.equation.values) == 1 for x in forms.loci)
    found = pinsing.loops.analyze_mechanism(mechanism)
    assert all(check.passed for check in found.checks)
    assert max(locus_distance(mechanism, forms, p.q) for p in found.points) < 1e-7
    for q in random_closed(mechanism, 6, np.random.default_rng(3)):
        if mechanism_at(mechanism, q).input_ratio > 1e-2:
            assert locus_distance(mechanism, forms, q) > 1e-4


def rod_on_three_cranks(folder, third=0.4, crank=1.0):
    """The coupling rod of a locomotive on three cranks; rigid where one has another length."""
    pivots = [(0.0, 0.0), (1.0, 0.0), (0.5, 0.2)]
    joints = [J(f"r{k}", "base", f"crank{k}", (x, y, 0)) for k, (x, y) in enumerate(pivots)]
    joints.append(J("rod", "crank0", "rod_link", (0.4, 0, 0)))
    for k, (x, y) in enumerate(pivots[1:], 1):
        joints.append(frame(f"on{k}", "rod_link", (x, y, 0)))
        joints.append(frame(f"end{k}", f"crank{k}", (0.4 if k == 1 else third, 0, 0)))
    home = {"r0": crank, "r1": crank, "r2": crank, "rod": -crank}
    loops = [(f"on{k}", f"end{k}") for k in (1, 2)]
    return assembled(folder, joints, loops, ["r0"], "rod_link", "vx", home=home)


@pytest.mark.parametrize("crank", tiered([1.0, 2.5, -0.7], (1.0,)))
def test_a_loop_that_moves_only_on_the_branch_of_home_moves(crank, tmp_path):
    mechanism = rod_on_three_cranks(tmp_path, crank=crank)
    found = ranks(mechanism)
    assert (found.mobility, found.constraint, found.output) == (1, 3, 1)
    q = np.full(4, 0.3)
    q[mechanism.joints.index("rod")] = -0.3
    assert np.abs(residual(mechanism, q)).max() < 1e-12
    assert mechanism_at(mechanism, q).kind == "regular"
    with pytest.raises(pinsing.PinsingError, match=r"leave no motion|close nowhere"):
        ranks(rod_on_three_cranks(tmp_path, third=0.41))


def test_a_crank_without_length_is_named(tmp_path):
    mechanism = planar(tmp_path, Way("rrr", crank=0.0))
    words = (
        "a0 and b0, a1 and b1, a2 and b2 turn about one axis: the link between them has no length"
    )
    (note,) = joint_forms(mechanism).notes
    assert words in note
    assert without_length(mechanism).startswith(words)
    assert without_length(planar(tmp_path, Way("rrr"))) == ""


def test_a_rod_without_length_is_an_error(tmp_path):
    mechanism = planar(tmp_path, Way("rrr", rod=0.0))
    loops = pinsing.loops
    for ask in (pose_forms, joint_forms, loops.assembly_modes, loops.analyze_mechanism):
        with pytest.raises(pinsing.PinsingError, match="b0 and turn turn about one axis"):
            ask(mechanism)


@pytest.mark.slow
def test_what_is_written_of_determinants(tmp_path):
    forms = pose_forms(six(tmp_path, "pus", 0))
    two = forms.loci[0].equation
    x = np.random.default_rng(2).normal(size=(3, len(two.names)))
    assert two.entries(x).shape == (3, 6, 6)
    assert two.degree(("q3",)) == 1
    assert set(two.used) == set(two.names)
    assert "the six rod lines belong to one linear complex" in str(forms)
    assert "rod 3 is across the slide q2" in str(forms)
    for more, rows in (([], False), (["--exact"], True)):
        done = run("families", "-v", tmp_path / "made.urdf", "--loops", *more)
        assert done.exit_code == 0
        over_pose = done.stdout.partition("Closed forms in the joint angles")[0]
        assert "determinant of 6 x 6 entries" in over_pose
        assert ("(1) x " in over_pose) == rows
        assert "it closes where |B - C| = " in " ".join(over_pose.split())
    assert "along the axis of its first joint" in str(pose_forms(driven_feet(tmp_path, UPS)))
    elbows = pose_forms(planar(tmp_path, ONE_ELBOW))
    assert not any("nowhere else" in x for x in elbows.notes)


@pytest.mark.slow
def test_the_agile_eye_is_singular_where_a_middle_joint_is_at_a_right_angle(tmp_path, rng):
    """Type 2 over the orientation is a sum of squares: it has no zeros of its own."""
    mechanism = shipped("agile_eye")
    forms = pose_forms(mechanism)
    (note,) = [x for x in forms.notes if "sum of squares" in x]
    assert "f0^2 f1^2 f2^2 + f0^2 f1^2 f3^2 + f0^2 f2^2 f3^2 + f1^2 f2^2 f3^2 = 0" in note
    assert forms.variables == ("e0", "e1", "e2", "e3")
    (two,) = [x for x in forms.loci if x.kind == "type 2"]
    # The same by hand, from axes of its own.
    own = pose_forms(eye(tmp_path, np.eye(3), np.eye(3)[[1, 2, 0]], np.eye(3)[[2, 0, 1]]))
    assert [str(x) for x in own.loci if x.kind == "type 2"] == [str(two)]
    assert len(set(np.sign(two.equation(rng.normal(size=(100, 4)))))) == 1
    only = "singular if and only if cos v1 = 0 or cos v2 = 0 or cos v3 = 0"
    assert any(only in x for x in joint_forms(mechanism).notes)
    free = mechanism.without_limits()
    places = [free.joints.index(f"v{k}") for k in (1, 2, 3)]
    met = 0
    for q in random_closed(free, 10, rng):
        point = refine(free, q, "type 2")
        if point.converged:
            met += 1
            assert np.abs(np.cos(point.q[places])).min() < 1e-6
        elif mechanism_at(free, q).kind == "regular":
            assert np.abs(np.cos(q[places])).min() > 1e-9
    assert met


def test_other_angles_of_the_links_are_no_sum_of_squares(tmp_path):
    base, outer = np.eye(3), np.eye(3)[[1, 2, 0]]
    middle = np.array([[0, 0.6, 0.8], [0.8, 0, 0.6], [0.6, 0.8, 0]])
    mechanism = eye(tmp_path, base, middle, outer)
    forms = pose_forms(mechanism)
    assert not any("sum of squares" in x for x in forms.notes)
    assert "cos a1" in forms.variables
    assert pinsing.loops.assembly_modes(mechanism, starts=9).bound == 8
    assert not any("proven over" in x for x in joint_forms(mechanism).notes)
