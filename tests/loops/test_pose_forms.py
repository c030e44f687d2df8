"""Singular loci over the pose in closed form, against geometry written here without pinsing."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pinocchio as pin
import pytest
from command_line import run
from mechanisms import URDF, from_model, planar_tree, shipped, value
from urdf_text import J, frame, loop_text, written

import pinsing
from pinsing.loops import PoseForms, mechanism_at, pose_forms, refine
from pinsing.loops.closure import Loops, random_closed
from pinsing.loops.legs import rods
from pinsing.loops.pose_loci import PoseRing, _loci, _split, _type1, variables_at
from pinsing.plot.mechanism import border_field, colors, regions
from pinsing.robot.mechanism import Loop


def rotation(e):
    """Of a unit quaternion, by its own formula."""
    w, v = e[0], np.array(e[1:])
    K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * K + 2 * K @ K


def pluecker(a, b):
    """Line through two points: direction and moment about the origin."""
    return np.concatenate([b - a, np.cross(a, b)])


def equation_values(forms, rows):
    """Product of all type 2 (and constraint) loci at rows of variables."""
    out = np.ones(len(rows))
    for locus in forms.loci:
        if locus.kind != "type 1":
            out *= [value(locus.equation, row) for row in rows]
    return out


def poses(count, rng):
    out = []
    for _ in range(count):
        e = rng.normal(size=4)
        out.append((rng.uniform(-1, 1, 3), e / np.linalg.norm(e)))
    return out


def named(at, e):
    return {**dict(zip("xyz", at, strict=True)), **{f"e{k}": v for k, v in enumerate(e)}}


@pytest.mark.slow
def test_fichters_turn_by_90_degrees_is_found_by_itself(rng):
    for name in ("gough_stewart", "stewart_6_3"):
        forms = pose_forms(shipped(name))
        words = [str(f) for f in forms.everywhere]
        assert "turned by ±90° about z: singular at every position" in words
        for angle, singular in ((90, True), (-90, True), (89, False), (30, False)):
            half = np.radians(angle) / 2
            e = (np.cos(half), 0, 0, np.sin(half))
            rows = [named(at, e) for at in rng.uniform(-1, 1, (5, 3))]
            values = np.abs(equation_values(forms, rows))
            assert (values < 1e-12).all() == singular
    # Level, only the plane of the base is singular.
    assert [str(x.equation) for x in pose_forms(shipped("gough_stewart")).level] == ["z = 0"]


def test_architecture_singularities_are_named():
    forms = pose_forms(shipped("griffis_duffy"))
    assert forms.architecture.startswith("architecture singularity: the leg lines are dependent")
    assert not forms.loci
    assert not pose_forms(shipped("gough_stewart")).architecture


def test_hunts_pose_of_the_6_3():
    """Two base points in the platform's plane: all six legs cut one edge of the platform."""
    forms = pose_forms(shipped("stewart_6_3"))
    a, b = (np.array([np.cos(t), np.sin(t), 0]) for t in np.radians([220, 260]))
    along, tilt = (b - a) / np.linalg.norm(b - a), 0.7
    for tilt in (0.4, 0.9):
        # Turned about the line through both points: the plane of the platform holds it.
        turn = pin.AngleAxis(tilt, along)
        at = a + turn.matrix() @ np.array([0.3, 0.9, 0.0])
        q = pin.Quaternion(turn.matrix())
        value = equation_values(forms, [named(at, (q.w, q.x, q.y, q.z))])
        assert abs(value[0]) < 1e-12
        off = at + 0.05 * turn.matrix() @ np.array([0.0, 0.0, 1.0])
        assert abs(equation_values(forms, [named(off, (q.w, q.x, q.y, q.z))])[0]) > 1e-5


@pytest.mark.parametrize("seed", range(3))
def test_random_3rrr_are_singular_where_rods_meet_or_cranks_are_stretched(seed):
    rng = np.random.default_rng(seed)
    pivots = np.round(rng.uniform(-1, 1, (3, 2)), 3)
    corners = np.round(rng.uniform(-0.3, 0.3, (3, 2)), 3)
    cranks, bars = np.round(rng.uniform(0.4, 0.8, (2, 3)), 3)
    chains = {
        "one": (tuple(pivots[0]), [("a1", cranks[0]), ("b1", bars[0]), ("c1", 0.0)]),
        "two": (tuple(pivots[1]), [("a2", cranks[1]), ("b2", bars[1])]),
        "three": (tuple(pivots[2]), [("a3", cranks[2]), ("b3", bars[2])]),
    }
    model = planar_tree(chains)
    top = model.getJointId("c1")
    for k in (1, 2):
        place = pin.SE3(np.eye(3), np.array([*(corners[k] - corners[0]), 0.0]))
        model.addFrame(pin.Frame(f"v{k}", top, 0, place, pin.FrameType.OP_FRAME))
    mechanism = from_model(
        model,
        [Loop("two_end", "v1", "3d"), Loop("three_end", "v2", "planar")],
        ["a1", "a2", "a3"],
        "one_end",
        "vx,vy,wz",
    )
    forms = pose_forms(mechanism)
    kinds = [x.kind for x in forms.loci]
    assert kinds.count("type 1") == 3
    rows, dets, arms = [], [], []
    for q in random_closed(mechanism, 10, rng)[:6]:
        at = variables_at(mechanism, q)
        rows.append(at)
        turn = np.array([[at["cos φ"], -at["sin φ"]], [at["sin φ"], at["cos φ"]]])
        lines = []
        for k, name in enumerate(("a1", "a2", "a3")):
            along = np.array([at[f"cos {name}"], at[f"sin {name}"]])
            C = pivots[k] + cranks[k] * along
            B = np.array([at["x"], at["y"]]) + turn @ (corners[k] - corners[0])
            d = B - C
            lines.append([*d, C[0] * d[1] - C[1] * d[0]])
            arms.append(along[0] * d[1] - along[1] * d[0])
            assert np.linalg.norm(d) == pytest.approx(bars[k])
        dets.append(np.linalg.det(lines))
    ratio = np.array(dets) / equation_values(forms, rows)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    stretched = [x for x in forms.loci if x.kind == "type 1"]
    for k, row in enumerate(rows):
        for i, locus in enumerate(stretched):
            here, first = (value(locus.equation, x) for x in (row, rows[0]))
            assert here * arms[i] == pytest.approx(first * arms[3 * k + i], abs=1e-9)


def test_3rpr_is_singular_where_its_lines_meet(rng):
    forms = pose_forms(shipped("planar_3rpr"))
    base = np.array([[0, 0], [1.5, 0], [0.6, 1.2]])
    platform = np.array([[-0.25, -0.2], [0.35, -0.2], [0, 0.3]])
    rows, dets = [], []
    for x, y, angle in rng.uniform(-2, 2, (8, 3)):
        c, s = np.cos(angle), np.sin(angle)
        ends = np.array([x, y]) + platform @ np.array([[c, s], [-s, c]])
        d = ends - base
        moment = base[:, 0] * d[:, 1] - base[:, 1] * d[:, 0]
        dets.append(np.linalg.det(np.column_stack([d, moment])))
        rows.append({"x": x, "y": y, "cos φ": c, "sin φ": s})
    ratio = np.array(dets) / equation_values(forms, rows)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    assert "meet in one point or are parallel" in forms.loci[0].words


def irregular_delta(off):
    """Rods of a Delta with legs at odd angles and unequal sizes; one foot off by ``off`` metres."""
    found = rods(shipped("delta"))
    out = []
    sizes = zip((0.0, 100.0, 215.0), (0.3, 0.25, 0.28), (0.14, 0.1, 0.12), strict=True)
    joints = dict.fromkeys(r.joint for r in found.rods)
    for joint, (angle, base, top) in zip(joints, sizes, strict=True):
        turn = np.radians(angle)
        out_, across = (np.array([np.cos(t), np.sin(t), 0]) for t in (turn, turn + np.pi / 2))
        for side in (0.06, -0.06):
            mine = next(r for r in found.rods if r.joint == joint)
            inner = base * out_ + side * across
            moved = {"first": 0.2 * out_, "second": np.array([0, 0, -0.2])}
            out.append(replace(mine, outer=top * out_ + side * across, inner=inner, **moved))
    out[-1] = replace(out[-1], outer=out[-1].outer + np.array([0, 0, off]))
    return PoseRing(replace(found, rods=tuple(out)), True)


def type2(ring):
    together = ring.multiplied_out(ring.lines())
    return _loci(ring, _split(ring, ring.without_norm(together)))


def test_rods_of_a_crank_that_rounding_tells_apart_are_parallel(rng):
    ring = irregular_delta(0.0)
    along = np.array([rod.outer - rod.inner for rod in ring.rods.rods])
    assert 0 < np.abs(along[::2] - along[1::2]).max() < 1e-11
    loci = [*type2(ring), *_type1(ring)]
    assert [x.kind for x in loci].count("type 1") == 3
    assert sorted(x.kind for x in loci if x.kind != "type 1") == ["constraint", "type 2"]
    # By Plücker lines computed here: the two factors together are their determinant.
    ratio = []
    for _ in range(8):
        at, angles = rng.uniform(-0.5, 0.5, 3), rng.uniform(-2, 2, 3)
        row, lines = named(at, (1, 0, 0, 0)), []
        for k, rod in enumerate(ring.rods.rods):
            a = angles[k // 2]
            name = ring.rods.mechanism.joints[rod.joint]
            row |= {f"cos {name}": np.cos(a), f"sin {name}": np.sin(a)}
            elbow = rod.inner + np.cos(a) * rod.first + np.sin(a) * rod.second
            lines.append(pluecker(elbow, at + rod.outer))
        values = [value(x.equation, row) for x in loci if x.kind != "type 1"]
        ratio.append(np.prod(values) / np.linalg.det(lines))
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)


@pytest.mark.slow
def test_rods_that_are_not_parallel_stay_so():
    ring = irregular_delta(1e-6)
    loci = type2(ring)
    assert [x.kind for x in loci] == ["type 2"]
    assert [x.kind for x in _type1(ring)].count("type 1") == 4


def test_loci_of_the_delta(rng):
    mechanism = shipped("delta")
    forms = pose_forms(mechanism)
    level, turned = forms.loci[:-2], forms.loci[-2:]
    kinds = [x.kind for x in level]
    assert sorted(kinds) == ["constraint", "type 1", "type 1", "type 1", "type 2"]
    assert [x.kind for x in turned] == ["type 2 or constraint", "type 1"]
    assert all("e0" in x.equation.names for x in turned)
    assert not any("e0" in x.equation.names for x in level)
    base, crank, top, apart = 0.2, 0.24, 0.05, 0.1
    two = next(x for x in forms.loci if x.kind == "type 2")
    turning = next(x for x in forms.loci if x.kind == "constraint")
    values = []
    for _ in range(6):
        at, angles = rng.uniform(-0.5, 0.5, 3), rng.uniform(-2, 2, 3)
        row = named(at, (1, 0, 0, 0))
        for k, a in enumerate(angles, 1):
            row |= {f"cos a{k}": np.cos(a), f"sin a{k}": np.sin(a)}
        directions, normals = [], []
        for k, (turn, a) in enumerate(zip(np.radians([0, 120, 240]), angles, strict=True), 1):
            out = np.array([np.cos(turn), np.sin(turn), 0])
            across = np.array([-np.sin(turn), np.cos(turn), 0])
            elbow = base * out + crank * (np.cos(a) * out + np.sin(a) * np.array([0, 0, 1]))
            d = at + top * out - elbow
            directions.append(d)
            normals.append(np.cross(apart * across, d))
            tangent = -np.sin(a) * out + np.cos(a) * np.array([0, 0, 1])
            locus = next(x for x in forms.loci if x.kind == "type 1" and f" a{k} " in x.words)
            values.append((k, value(locus.equation, row) / (d @ tangent)))
        for locus, expected in ((two, directions), (turning, normals)):
            values.append((locus.kind, value(locus.equation, row) / np.linalg.det(expected)))
        # Where the output is not turned the determinant of all lines is the product of both.
        whole = value(turned[0].equation, row)
        values.append(("both", whole / np.linalg.det(directions) / np.linalg.det(normals)))
    for key in (1, 2, 3, "type 2", "constraint", "both"):
        ratio = np.array([v for k, v in values if k == key])
        np.testing.assert_allclose(ratio, ratio[0], rtol=1e-8)


def test_loci_agree_with_the_measures_of_3rps(rng):
    """Zero exactly where the Jacobians of Pinocchio lose rank."""
    mechanism = shipped("rps3")
    forms = pose_forms(mechanism)
    for q in random_closed(mechanism, 6, rng):
        at = variables_at(mechanism, q)
        value = abs(equation_values(forms, [at])[0])
        assert (value > 1e-9) == (mechanism_at(mechanism, q).kind == "regular")
        loops = Loops(mechanism)
        assert np.abs(loops.scaled(q)[0]).max() < 1e-10


def hinged(rng):
    """Corners of the base, axes there and corners of the platform of a 3-RPS at random."""
    turns = np.array([0.0, 2.0, 4.2]) + rng.uniform(-0.2, 0.2, 3)
    hinges = np.stack([-np.sin(turns), np.cos(turns), 0 * turns], axis=1).round(2)
    base = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1).round(2)
    platform = 0.5 * base + np.round(rng.uniform(-0.1, 0.1, (3, 3)), 2)
    return base, hinges, platform


def rps(folder, base, hinges, platform, rows="vz, wx, wy"):
    """A general 3-RPS: feet, hinge axes (level) and platform points."""
    joints, loops = [], []
    for k, (a, n) in enumerate(zip(base, hinges, strict=True)):
        joints.append(J(f"r{k}", "base", f"c{k}", a, n))
        joints.append(J(f"p{k}", f"c{k}", f"rod{k}", axis=(0, 0, 1), kind="prismatic",
                        limits=(0.3, 3)))  # fmt: skip
        if k == 0:
            for axis, link in zip(np.eye(3), ("wa", "wb", "platform"), strict=True):
                joints.append(J(f"s{link}", joints[-1].child, link, axis=axis))
        else:
            joints.append(frame(f"b{k}", "platform", platform[k] - platform[0]))
            loops.append((f"rod{k}", f"b{k}"))
    joints.append(frame("out", "platform", -platform[0]))
    home = {f"p{k}": 0.8 for k in range(3)}
    text = loop_text(loops, ["p0", "p1", "p2"], "out", rows, home=home)
    return pinsing.load_mechanism(written(folder, joints, text))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_type_1_of_random_3rps_is_in_the_motions_that_the_hinges_allow(seed, tmp_path):
    rng = np.random.default_rng(seed)
    base, hinges, platform = hinged(rng)
    mechanism = rps(tmp_path, base, hinges, platform).without_limits()
    forms = pose_forms(mechanism)
    assert forms.complete
    ones = [x for x in forms.loci if x.kind == "type 1"]
    assert ones
    ratios, met = [], 0
    for q in random_closed(mechanism, 8, rng):
        for start in (q, refine(mechanism, q, "type 1").q):
            at = variables_at(mechanism, start)
            one = np.prod([value(x.equation, at) for x in ones])
            place = np.array([at[n] for n in "xyz"])
            ends = platform @ rotation([at[f"e{k}"] for k in range(4)]).T
            # What the hinges leave of the motions about the output's origin, on vz, wx, wy.
            ties = np.array([[*n, *np.cross(b, n)] for n, b in zip(hinges, ends, strict=True)])
            rest = np.eye(6)[[2, 3, 4]]
            own = np.linalg.det(np.vstack([ties, rest]))
            assert np.isfinite(place).all()
            if start is q:
                ratios.append(one / own)
                continue
            point = mechanism_at(mechanism, start) if closed(mechanism, start) else None
            if point is not None and point.kind == "type 1" and legs(mechanism, start) > 1e-3:
                met += 1
                assert abs(own) < 1e-7
                assert abs(one) < 1e-7
    assert met
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-6)


def closed(mechanism, q):
    return np.abs(Loops(mechanism).scaled(q)[0]).max() < 1e-10


def legs(mechanism, q):
    return np.abs(q[list(mechanism.actuated)]).min()


def test_rows_that_leave_type_1_of_hinged_legs_open_are_said(tmp_path):
    base = np.array([[1, 0, 0], [-0.5, 0.87, 0], [-0.5, -0.87, 0]])
    hinges = np.array([[0, 1, 0], [-0.87, -0.5, 0], [0.87, -0.5, 0]])
    forms = pose_forms(rps(tmp_path, base, hinges, 0.5 * base, "vx, vy, vz, wx, wy, wz"))
    assert not forms.complete
    assert any("type 1 is not in these equations" in x for x in forms.notes)


def test_what_passes_more_than_a_force_has_no_such_form():
    for name in ("bennett", "rssr"):
        assert pose_forms(shipped(name)) is None


def test_forms_survive_json():
    forms = pose_forms(shipped("gough_stewart"))
    again = PoseForms.from_json(forms.to_json())
    assert str(again) == str(forms)
    assert "sqrt(3)" not in forms.level[0].equation.coefficients
    np.testing.assert_array_equal(again.loci[0].equation.powers, forms.loci[0].equation.powers)


@pytest.mark.slow
def test_families_of_a_mechanism_at_the_command_line():
    def families(name, *more):
        return run("families", "-v", URDF / f"{name}.urdf", "--loops", *more)

    done = families("gough_stewart", "--fail-if-singular")
    assert done.exit_code == 1
    assert "turned by ±90° about z" in done.stdout
    assert "x^2" in families("planar_3rpr", "--exact").stdout
    assert PoseForms.from_json(families("planar_3rpr", "-o", "-").stdout).complete
    assert "B1, P, B2 in line" in families("five_bar").stdout
    done = families("bennett")
    assert done.exit_code == 0
    assert "rank of 9 x 4 entries below 4" in done.stdout
    done = families("bennett", "--prove")
    assert (done.exit_code, done.stdout) == (2, "")
    assert "no leg has a certificate of its own" in done.stderr
    assert families("planar_3rpr", "--latex").exit_code == 2


def test_regions_of_a_slice_are_parted_by_the_loci_alone():
    # Within a disc, parted by a line and by a circle that stays inside.
    x, y = np.meshgrid(np.linspace(-1, 1, 201), np.linspace(-1, 1, 201))
    inside = x**2 + y**2 < 0.9
    numbers, signs = regions(inside, [y - 0.2, (x - 0.1) ** 2 + (y + 0.4) ** 2 - 0.04])
    assert numbers.max() == len(signs) == 3
    assert (numbers[~inside] == 0).all()
    below, above, hole = (numbers[k] for k in ((60, 40), (150, 100), (60, 110)))
    assert len({below, above, hole}) == 3
    assert signs[above - 1] == signs[hole - 1] != signs[below - 1]
    assert len(set(colors([True, True, False]))) == 3
    # Round a whole turn the outer parts are one.
    band = [np.cos(np.pi * y)]
    assert regions(np.ones_like(inside), band)[0].max() == 3
    assert regions(np.ones_like(inside), band, (False, True))[0].max() == 2


def test_the_border_of_what_is_reached_is_where_type_1_is_zero():
    # A disc, and a half plane, whose left sides go to zero as roots of the distance do.
    x, y = np.meshgrid(np.linspace(-1, 1, 61), np.linspace(-1, 1, 61))
    r2, cell = x**2 + y**2, 2 / 60
    reached = (r2 < 0.61) & (x < 0.437)
    with np.errstate(invalid="ignore"):
        ones = [np.where(reached, np.sqrt(0.61 - r2), np.nan), np.sqrt(0.437 - x)]
    field = np.ma.masked_invalid(border_field(reached, ones))
    figure, ax = plt.subplots()
    (path,) = ax.contour(x, y, field, levels=[0.0]).get_paths()
    plt.close(figure)
    away = np.abs(np.hypot(*path.vertices.T) - np.sqrt(0.61))
    across = np.abs(path.vertices[:, 0] - 0.437)
    corner = np.hypot(path.vertices[:, 0] - 0.437, np.abs(path.vertices[:, 1]) - 0.647)
    off = np.minimum(away, across)[corner > 2 * cell]
    assert off.max() < 0.25 * cell
    assert off.mean() < 0.05 * cell
