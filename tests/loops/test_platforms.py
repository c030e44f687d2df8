"""Loci of platforms written in many ways, against lines and planes computed without pinsing."""

import numpy as np
import pinocchio as pin
import pytest
from command_line import run
from mechanisms import URDF, closed_and_refined, left_sides, placed, shipped, value
from platforms import (
    BASE,
    PLATFORM,
    Table,
    Way,
    changes,
    circle,
    equation_values,
    lines_in_plane,
    made,
    named,
    planar,
    pluecker,
    poses,
    rotation,
    six,
    three,
    turned,
    unit,
)
from tiers import tiered, tiered_rows
from urdf_text import J, X, frame, loop_text, stewart, written

import pinsing
from pinsing.loops import PoseForms, joint_forms, mechanism_at, pose_forms, ranks, refine
from pinsing.loops.closure import random_closed, residual, without_length
from pinsing.loops.pose_loci import locus_distance, variables_at


def in_plane(mechanism, q, way):
    """The legs' force lines in the plane of the table: their determinant, of lines of length 1."""
    mount = pin.rpy.rpyToMatrix(*way.rpy)
    place = placed(mechanism, q).oMf[mechanism.output_id]
    own = pin.rpy.rpyToMatrix(*way.output_rpy)
    R, p = mount.T @ place.rotation @ own.T, mount.T @ place.translation
    ends = p[:2] + way.platform @ R[:2, :2].T
    inner = way.base
    if way.legs == "rrr" and way.driven != "b":
        cranks = [q[mechanism.joints.index(f"a{k}")] for k in range(3)]
        inner = inner + way.crank * np.stack([np.cos(cranks), np.sin(cranks)], axis=1)
    lengths = np.linalg.norm(ends - inner, axis=1)
    return np.linalg.det(lines_in_plane(inner, ends) / lengths[:, None])


WAYS = [
    Way("rpr", rpy=(np.pi / 2, 0, 0)), Way("rpr", rpy=(0.4, 0.3, 0.2)), Way("rpr", layers=0.1),
    Way("rpr", from_platform=(1, 2)), Way("rrr", rpy=(0.4, 0.3, 0.2)),
    Way("rrr", cut_at_elbow=(2,)), Way("rrr", cut_at_elbow=(1, 2), rpy=(np.pi / 2, 0, 0)),
    Way("rrr", driven="b"), Way("rpr", output_rpy=(0.7, 0.5, 0.3)),
]  # fmt: skip


@pytest.mark.parametrize("way", tiered(WAYS, (WAYS[8],)), ids=str)
def test_a_planar_platform_is_the_same_however_it_is_written(way, tmp_path, rng):
    mechanism = planar(tmp_path, way)
    assert ranks(mechanism).mobility == 3
    forms = pose_forms(mechanism)
    assert forms.complete
    ratios, found = [], 0
    for asked, q, kind in closed_and_refined(mechanism, 12, rng, "type 2"):
        if not asked:
            # The lines' lengths are no matter: the equation has those of the file.
            two = np.prod(left_sides(mechanism, forms, q, "type 2"))
            ratios.append(np.sign(two) * np.sign(in_plane(mechanism, q, way)))
        elif kind == asked and np.abs(q[mechanism.prismatic]).min(initial=1.0) >= 1e-3:
            found += 1
            assert abs(in_plane(mechanism, q, way)) < 1e-6
            assert np.abs(left_sides(mechanism, forms, q)).min() < 1e-6
    assert len(ratios) > 4
    assert len(set(ratios)) == 1
    assert found


@pytest.mark.parametrize("seed", tiered(range(7), (6,)))
def test_random_stewart_platforms_are_singular_where_their_lines_are_dependent(seed, tmp_path):
    """Level ones and others; some of the legs written from the platform."""
    rng = np.random.default_rng(seed)
    base = np.round(rng.uniform(-1, 1, (6, 3)) * [1, 1, seed % 2], 2)
    platform = np.round(rng.uniform(-0.5, 0.5, (6, 3)) * [1, 1, seed % 3], 2)
    hanging = (1, 2, 3, 4, 5)[: (seed + 1) % 6]
    files = written(tmp_path, *stewart(base, platform, hanging=hanging))
    forms = pose_forms(pinsing.load_mechanism(files))
    assert forms.complete
    assert not forms.architecture
    drawn = poses(12, rng)
    lines = [np.linalg.det(pluecker(base, at + platform @ rotation(e).T)) for at, e in drawn]
    # One polynomial is the other times a constant.
    ratio = np.array(lines) / equation_values(forms, [named(at, e) for at, e in drawn])
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    assert sum(x.equation.degree(("x", "y", "z")) for x in forms.loci) == 3
    assert any("linear complex" in x.words for x in forms.loci)


def test_similar_hexagons_are_singular_everywhere_on_a_conic_only(tmp_path):
    rng = np.random.default_rng(5)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 6))
    ellipse = np.round(np.stack([np.cos(angles), 0.6 * np.sin(angles), 0 * angles], axis=1), 12)
    loose = np.round(rng.uniform(-1, 1, (6, 3)) * [1, 1, 0], 2)
    for k, (base, everywhere) in enumerate(((ellipse, True), (loose, False))):
        platform = 0.5 * base
        files = written(tmp_path, *stewart(base, platform), name=f"m{k}")
        forms = pose_forms(pinsing.load_mechanism(files))
        # By the lines alone, at poses turned about all axes.
        lines = [pluecker(base, at + platform @ rotation(e).T) for at, e in poses(6, rng)]
        sigma = np.linalg.svd(unit(np.array(lines)), compute_uv=False)[:, -1]
        assert (max(sigma) < 1e-9) == everywhere
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
    text = loop_text(loops, ["r0"], "rod_link", "vx", home=home)
    return pinsing.load_mechanism(written(folder, joints, text))


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


def output(mechanism, q):
    """Position and rotation of ``out`` by Pinocchio."""
    place = placed(mechanism, q).oMf[mechanism.output_id]
    return place.translation, place.rotation


def geometry(t: Table, p, R, inputs):
    """Lines (6, 6), what the actuators feel of the rods, and whether the loops close: errors."""
    ends = p + t.platform @ R.T
    lines, felt, errors = [], [], []
    for k, B in enumerate(ends):
        if t.legs in ("pus", "prs"):
            C, motion = t.base[k] + inputs[k] * t.axes[k], t.axes[k]
        else:
            arm = turned(t.axes[k], inputs[k]) @ t.arms[k]
            C, motion = t.base[k] + arm, np.cross(t.axes[k], arm)
        force = B - C
        if t.legs == "rps":
            force = np.cross(t.hinges[k], B - t.base[k])
        else:
            errors.append(np.linalg.norm(force) - t.rods[k])
        felt.append(force @ motion if t.legs != "rps" else force @ force)
        lines.append([*force, *np.cross(B, force)])
        if len(ends) == 3:
            errors.append((B - C if t.legs != "rps" else B - t.base[k]) @ t.hinges[k])
            lines.append([*t.hinges[k], *np.cross(B, t.hinges[k])])
    return np.array(lines), np.array(felt), np.array(errors)


def at_rest(t: Table, p, lines, felt):
    """Of three hinged legs: zero where a motion leaves vz, wx, wy at rest."""
    rows = []
    for k, line in enumerate(lines):
        moment = line[3:] - np.cross(p, line[:3])
        feels = np.zeros(3)
        if k % 2 == 0:
            feels[k // 2] = felt[k // 2]
        elif t.legs == "prs":
            feels[k // 2] = t.hinges[k // 2] @ t.axes[k // 2]
        rows.append([line[0], line[1], moment[2], *feels])
    return np.linalg.det(rows)


CASES = [("pus", 0), ("pus", 1), ("rus", 0), ("rus", 1), ("prs", 0), ("rrs", 0), ("rps", 0),
         ("prs", 1), ("rrs", 1), ("rps", 1)]  # fmt: skip


@pytest.mark.parametrize(("legs", "seed"), tiered_rows(CASES, (("rrs", 0),)))
def test_random_platforms_are_singular_where_their_lines_are_dependent(legs, seed, tmp_path):
    t = six(legs, seed, seed == 0) if legs in ("pus", "rus") else three(legs, seed)
    mechanism = made(tmp_path, t).without_limits()
    assert ranks(mechanism).mobility == len(mechanism.actuated)
    forms = pose_forms(mechanism)
    assert forms.complete
    assert not forms.architecture
    ratios, arms, met = [], [], {"type 1": 0, "type 2": 0}
    rng = np.random.default_rng(seed)
    for asked, q, kind in closed_and_refined(mechanism, 9, rng, *met):
        p, R = output(mechanism, q)
        lines, felt, errors = geometry(t, p, R, q[list(mechanism.actuated)])
        if not asked:
            if len(ratios) == 6:
                break
            assert np.abs(errors).max(initial=0) < 1e-8
            at = variables_at(mechanism, q)
            assert np.abs([value(x, at) for x in forms.closing]).max(initial=0) < 1e-8
            ratios.append(np.linalg.det(lines) / left_sides(mechanism, forms, q, "type 2")[0])
            ones = left_sides(mechanism, forms, q, "type 1")
            arms.append(felt / ones if len(felt) == 6 else at_rest(t, p, lines, felt) / ones)
            assert kind == "regular"
            continue
        if kind != asked or (legs == "rps" and np.abs(q[mechanism.prismatic]).min() < 1e-3):
            continue
        met[kind] += 1
        assert locus_distance(mechanism, forms, q) < 1e-7
        if kind == "type 2":
            own = np.linalg.det(unit(lines))
        else:
            own = np.abs(felt).min() if len(felt) == 6 else at_rest(t, p, lines, felt)
        assert abs(own) < 1e-7
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-5)
    np.testing.assert_allclose(arms, np.broadcast_to(arms[0], np.shape(arms)), rtol=1e-5)
    assert all(met.values())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hexaglide", "rus6"])
def test_the_shelfs_platforms_on_rods(name):
    """Their matrices, with square roots of 3 in one of them, against placements by Pinocchio."""
    mechanism = shipped(name).without_limits()
    forms = pose_forms(mechanism)
    assert forms.complete
    assert [x.kind for x in forms.loci] == ["type 2", *["type 1"] * 6]
    frames = {f.name: k for k, f in enumerate(mechanism.model.frames)}
    ratios = []
    for q in random_closed(mechanism, 6, np.random.default_rng(3)):
        data, lines = placed(mechanism, q), []
        for k in range(1, 7):
            C = data.oMi[mechanism.model.getJointId(f"u{k}x")].translation
            B = data.oMf[frames["ball_a" if k == 1 else f"b{k}"]].translation
            lines.append(pluecker(C, B))
        matrix = forms.loci[0].equation
        at = variables_at(mechanism, q)
        np.testing.assert_allclose(matrix.entries([at[n] for n in matrix.names]), lines, atol=1e-9)
        ratios.append(np.linalg.det(lines) / left_sides(mechanism, forms, q, "type 2")[0])
    np.testing.assert_allclose(ratios, 1, rtol=1e-5)


FEET = [
    [["ux"], ["uy"], ["p"], ["ux"], ["uy"], ["p"]],
    [["ux", "uy"], ["p", "ux"], ["uy", "p"]],
    [["uy"]] * 6,
]


@pytest.mark.slow
@pytest.mark.parametrize("driven", tiered(FEET, (FEET[1],)), ids=str)
def test_legs_that_are_driven_at_the_foot(driven, tmp_path):
    rng = np.random.default_rng(7)
    base = rng.uniform(-1, 1, (len(driven), 3)).round(2)
    platform = rng.uniform(-0.4, 0.4, (len(driven), 3)).round(2)
    inputs = [f"{n[0]}{k}{n[1:]}" for k, names in enumerate(driven) for n in names]
    files = written(tmp_path, *stewart(base, platform, driven=inputs))
    mechanism = pinsing.load_mechanism(files).without_limits()
    forms = pose_forms(mechanism)
    assert forms.complete
    ratios, met = [], 0
    for asked, q, kind in closed_and_refined(mechanism, 8, rng, "type 2"):
        p, R = output(mechanism, q)
        lines = []
        for names, C, B in zip(driven, base, p + platform @ R.T, strict=True):
            d = B - C
            # The hinge across the leg, and what is across both.
            hinge = np.cross(X, d)
            force = {"p": d, "ux": hinge, "uy": np.cross(hinge, d)}
            lines += [[*force[name], *np.cross(B, force[name])] for name in names]
        if not asked:
            ratios.append(np.linalg.det(lines) / left_sides(mechanism, forms, q, "type 2")[0])
        elif kind == asked:
            met += 1
            assert locus_distance(mechanism, forms, q) < 1e-7
            assert abs(np.linalg.det(unit(np.array(lines)))) < 1e-7
    assert met
    np.testing.assert_allclose(np.abs(ratios), abs(ratios[0]), rtol=1e-5)
    assert "along the axis of its first joint" in str(forms)


def test_a_platform_in_the_plane_that_is_driven_at_its_feet(tmp_path, rng):
    """3-RPR with its first joints driven: the forces are across the legs."""
    mechanism = planar(tmp_path, Way("rpr", driven="r")).without_limits()
    forms = pose_forms(mechanism)
    assert forms.complete
    assert any("where a leg has no length" in x for x in forms.notes)
    ratios, met = [], 0
    for asked, q, kind in closed_and_refined(mechanism, 9, rng, "type 2"):
        p, R = output(mechanism, q)
        ends = p[:2] + PLATFORM @ R[:2, :2].T
        d = ends - BASE
        own = np.linalg.det(np.column_stack([-d[:, 1], d[:, 0], (ends * d).sum(axis=1)]))
        if not asked:
            ratios.append(own / np.prod(left_sides(mechanism, forms, q, "type 2")))
        elif kind == asked:
            met += 1
            assert abs(own) < 1e-8
            assert locus_distance(mechanism, forms, q) < 1e-7
    assert met
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-6)


@pytest.mark.slow
def test_what_is_written_of_determinants(tmp_path):
    forms = pose_forms(made(tmp_path, six("pus", 0, parallel=True)))
    again = PoseForms.from_json(forms.to_json())
    assert str(again) == str(forms)
    two = forms.loci[0].equation
    x = np.random.default_rng(2).normal(size=(3, len(two.names)))
    np.testing.assert_allclose(again.loci[0].equation(x), two(x))
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


@pytest.mark.slow
def test_a_delta_whose_output_frame_is_turned(tmp_path):
    """Its loci are not over a level output: cranks shared by two rods, and freedoms of three."""
    text = (URDF / "delta.urdf").read_text()
    start = text.index("<origin ", text.index('name="platform_center_mount"')) + len("<origin ")
    (tmp_path / "delta.urdf").write_text(f'{text[:start]}rpy="0 0 0.5" {text[start:]}')
    (tmp_path / "delta.loops.yaml").write_text((URDF / "delta.loops.yaml").read_text())
    mechanism = pinsing.load_mechanism(tmp_path / "delta.urdf").without_limits()
    forms = pose_forms(mechanism)
    assert forms.complete
    assert [x.kind for x in forms.loci] == ["type 2 or constraint", "type 1"]
    assert len(forms.closing) == 6
    met = set()
    rng = np.random.default_rng(1)
    for _, q, kind in closed_and_refined(mechanism, 6, rng, "type 1", "type 2"):
        met.add(kind)
        assert (locus_distance(mechanism, forms, q) < 1e-7) == (kind != "regular")
    assert {"regular", "type 1", "type 2"} <= met


def eye(folder, base, middle, outer):
    """Three legs by unit vectors (3, 3) each, with all joints at zero; the output is the base."""
    joints, loops = [], []
    for k in range(3):
        joints.append(J(f"a{k}", "base", f"arm{k}", axis=base[k]))
        joints.append(J(f"v{k}", f"arm{k}", f"bar{k}", axis=middle[k]))
        if k == 0:
            joints.append(J("w", "bar0", "platform", axis=outer[0]))
        else:
            joints.append(frame(f"e{k}", f"bar{k}", outer[k]))
            joints.append(frame(f"b{k}", "platform", outer[k]))
            loops.append((f"e{k}", f"b{k}"))
    text = loop_text(loops, [f"a{k}" for k in range(3)], "platform", "wx, wy, wz")
    return pinsing.load_mechanism(written(folder, joints, text))


def random_eye(folder, rng):
    """Its mechanism, and unit vectors: base, middle, outer."""
    axes = unit(rng.normal(size=(3, 3, 3)))
    return eye(folder, *axes), *axes


def rotations(mechanism, q):
    """Rotation of the output, and of each arm."""
    data = placed(mechanism, q)
    arms = [data.oMi[mechanism.model.getJointId(f"a{k}")].rotation for k in range(3)]
    return data.oMf[mechanism.output_id].rotation, arms


@pytest.mark.slow
@pytest.mark.parametrize("seed", tiered(range(4), (1,)))
def test_random_spherical_legs_against_their_moments(seed, tmp_path):
    rng = np.random.default_rng(seed)
    mechanism, base, middle, outer = random_eye(tmp_path, rng)
    forms = pose_forms(mechanism)
    assert forms.complete
    two, ones = [], []
    for asked, q, kind in closed_and_refined(mechanism, 6, rng, "type 1", "type 2"):
        if asked:
            assert kind == "regular" or np.abs(left_sides(mechanism, forms, q)).min() < 1e-6
            continue
        R, arms = rotations(mechanism, q)
        moments = [np.cross(A @ m, R @ w) for A, m, w in zip(arms, middle, outer, strict=True)]
        one, both = (np.prod(left_sides(mechanism, forms, q, k)) for k in ("type 1", "type 2"))
        two.append(both / np.linalg.det(moments))
        ones.append(one / np.prod([u @ n for u, n in zip(base, moments, strict=True)]))
    assert len(two) >= 3
    np.testing.assert_allclose(two, two[0], rtol=1e-6)
    np.testing.assert_allclose(ones, ones[0], rtol=1e-6)


@pytest.mark.slow
def test_the_agile_eye_is_singular_where_a_middle_joint_is_at_a_right_angle(tmp_path, rng):
    """Type 2 over the orientation is a sum of squares: it has no zeros of its own."""
    mechanism = shipped("agile_eye")
    forms = pose_forms(mechanism)
    (note,) = [x for x in forms.notes if "sum of squares" in x]
    assert "f0^2 f1^2 f2^2 + f0^2 f1^2 f3^2 + f0^2 f2^2 f3^2 + f1^2 f2^2 f3^2 = 0" in note
    assert forms.variables == ("e0", "e1", "e2", "e3")
    (two,) = [x for x in forms.loci if x.kind == "type 2"]
    # The same by hand, from axes of its own: moments without the middle axes.
    base, middle, outer = np.eye(3), np.eye(3)[[1, 2, 0]], np.eye(3)[[2, 0, 1]]
    own = pose_forms(eye(tmp_path, base, middle, outer))
    assert [str(x) for x in own.loci if x.kind == "type 2"] == [str(two)]
    ratios = []
    for _ in range(20):
        e = unit(rng.normal(size=4))
        turned = outer @ rotation(e).T
        moments = np.linalg.det(np.cross(np.cross(base, turned), turned))
        ratios.append(float(two.equation(e)) / moments)
        assert abs(moments) > 0
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-6)
    assert len({np.sign(float(two.equation(rng.normal(size=4)))) for _ in range(100)}) == 1
    proven = joint_forms(mechanism).notes
    only = "singular if and only if cos v1 = 0 or cos v2 = 0 or cos v3 = 0"
    assert any(only in x for x in proven)
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


@pytest.mark.parametrize("seed", tiered(range(6), (0,)))
def test_working_modes_of_spherical_legs_are_two_a_leg(seed, tmp_path):
    rng = np.random.default_rng(40 + seed)
    mechanism, base, middle, outer = random_eye(tmp_path, rng)
    q = random_closed(mechanism, 1, rng)[0]
    R, _ = rotations(mechanism, q)
    found = pinsing.loops.working_modes(mechanism, pin.SE3(R, np.zeros(3)).homogeneous)
    # By turning each actuated joint all round: where v . w passes its value.
    legs = zip(base, middle, outer, strict=True)
    count = np.prod([changes(circle(u, v) @ (R @ w) - v @ w) for u, v, w in legs])
    assert found.complete
    assert len(found.modes) == count == 8
    direct = pinsing.loops.assembly_modes(mechanism, q[list(mechanism.actuated)], starts=60)
    assert len(direct.modes) <= direct.bound == 8


def test_other_angles_of_the_links_are_no_sum_of_squares(tmp_path):
    base, outer = np.eye(3), np.eye(3)[[1, 2, 0]]
    middle = np.array([[0, 0.6, 0.8], [0.8, 0, 0.6], [0.6, 0.8, 0]])
    mechanism = eye(tmp_path, base, middle, outer)
    forms = pose_forms(mechanism)
    assert not any("sum of squares" in x for x in forms.notes)
    assert "cos a1" in forms.variables
    assert not any("proven over" in x for x in joint_forms(mechanism).notes)
