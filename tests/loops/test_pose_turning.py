"""Loci over pose and inputs of legs on rails, cranks and driven feet, against lines of our own."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import pytest
from command_line import run
from mechanisms import URDF, left_sides, placed, shipped, value
from test_parallel_geometry import BASE, PLATFORM, Way, planar
from tiers import tiered, tiered_rows
from urdf_text import J, X, Y, Z, ball, frame, loop_text, stewart, written

import pinsing
from pinsing.loops import PoseForms, mechanism_at, pose_forms, ranks, refine
from pinsing.loops.closure import random_closed, residual
from pinsing.loops.pose_loci import locus_distance, variables_at


@dataclass(frozen=True, eq=False)
class Table:
    """A platform of six rods on rails or cranks (``pus``, ``rus``), or of three hinged legs."""

    legs: str
    base: np.ndarray
    axes: np.ndarray
    arms: np.ndarray
    hinges: np.ndarray
    platform: np.ndarray
    rods: np.ndarray
    rows: str = "vx, vy, vz, wx, wy, wz"


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def turned(axis, angle):
    return pin.AngleAxis(float(angle), axis).matrix()


def six(legs, seed, parallel=False):
    """A random hexaglide, or a 6-RUS."""
    rng = np.random.default_rng(seed)
    base = rng.uniform(-1, 1, (6, 3)).round(2) * (1, 1, 0.2)
    platform = rng.uniform(-0.4, 0.4, (6, 3)).round(2)
    axes = unit(rng.normal(size=(6, 3)))
    if parallel:
        axes = np.tile([1.0, 0.0, 0.0], (6, 1))
    arms = np.zeros((6, 3)) if legs == "pus" else rng.uniform(-0.3, 0.3, (6, 3)).round(2)
    rods = np.linalg.norm(platform + np.array([0, 0, 1]) - base - arms, axis=1).round(3)
    return Table(legs, base, axes, arms, np.zeros((6, 3)), platform, rods)


def three(legs, seed):
    """A random 3-PRS, 3-RRS, or 3-RPS driven in its feet; the hinges lie level."""
    rng = np.random.default_rng(seed)
    turns = np.array([0.0, 2.0, 4.2]) + rng.uniform(-0.2, 0.2, 3)
    out = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    hinges = np.stack([-np.sin(turns), np.cos(turns), 0 * turns], axis=1)
    axes = hinges if legs == "rrs" else unit(0.3 * out + np.array([0, 0, 1]))
    arms = 0.3 * unit(out + np.array([0, 0, 0.5])) if legs == "rrs" else 0 * out
    platform = (0.5 * out + rng.uniform(-0.05, 0.05, (3, 3))).round(2)
    rods = rng.uniform(0.8, 0.9, 3).round(2)
    return Table(legs, out.round(2), axes, arms, hinges, platform, rods, "vz, wx, wy")


def made(folder, t: Table):
    """The same as a robot file and a loop file; inputs q0, q1, ..."""
    joints, loops = [], []
    count = len(t.base)
    for k in range(count):
        kind = "prismatic" if t.legs in ("pus", "prs") else "continuous"
        limits = (-1.5, 1.5) if kind == "prismatic" else None
        if t.legs == "rps":
            joints.append(J(f"q{k}", "base", f"car{k}", t.base[k], t.hinges[k]))
            joints.append(J(f"p{k}", f"car{k}", f"rod{k}", axis=Z, kind="prismatic",
                            limits=(0.3, 3)))  # fmt: skip
            joints.append(frame(f"e{k}", f"rod{k}", (0, 0, 0)))
        else:
            joints.append(J(f"q{k}", "base", f"car{k}", t.base[k], t.axes[k], kind, limits))
            if t.legs in ("pus", "rus"):
                joints.append(J(f"u{k}x", f"car{k}", f"cross{k}", t.arms[k], X))
                joints.append(J(f"u{k}y", f"cross{k}", f"rod{k}", axis=Y))
            else:
                # The hinge is beside the point that is straight across from the end.
                at = t.arms[k] + 0.1 * t.hinges[k]
                joints.append(J(f"r{k}", f"car{k}", f"rod{k}", at, t.hinges[k]))
            back = (0, 0, 0) if t.legs in ("pus", "rus") else -0.1 * t.hinges[k]
            joints.append(frame(f"e{k}", f"rod{k}", np.array([0, 0, t.rods[k]]) + back))
        if k == 0:
            joints += ball("w", "e0", "platform")
        else:
            joints.append(frame(f"b{k}", "platform", t.platform[k] - t.platform[0]))
            loops.append((f"e{k}", f"b{k}"))
    joints.append(frame("out", "platform", -t.platform[0]))
    inputs = [f"q{k}" for k in range(count)]
    return pinsing.load_mechanism(written(folder, joints, loop_text(loops, inputs, "out", t.rows)))


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
    rng = np.random.default_rng(seed)
    ratios, arms, met = [], [], {"type 1": 0, "type 2": 0}
    inputs = list(mechanism.actuated)
    for q in random_closed(mechanism, 9, rng)[:6]:
        p, R = output(mechanism, q)
        lines, felt, errors = geometry(t, p, R, q[inputs])
        assert np.abs(errors).max(initial=0) < 1e-8
        at = variables_at(mechanism, q)
        closing = [value(x, at) for x in forms.closing]
        assert np.abs(closing).max(initial=0) < 1e-8
        ratios.append(np.linalg.det(lines) / left_sides(mechanism, forms, q, "type 2")[0])
        ones = left_sides(mechanism, forms, q, "type 1")
        arms.append(felt / ones if len(felt) == 6 else at_rest(t, p, lines, felt) / ones)
        assert mechanism_at(mechanism, q).kind == "regular"
        for kind in met:
            point = refine(mechanism, q, kind)
            if np.abs(residual(mechanism, point.q)).max() > 1e-9:
                continue
            if mechanism_at(mechanism, point.q).kind != kind:
                continue
            if legs == "rps" and np.abs(point.q[mechanism.prismatic]).min() < 1e-3:
                continue
            met[kind] += 1
            assert locus_distance(mechanism, forms, point.q) < 1e-7
            p, R = output(mechanism, point.q)
            lines, felt, _ = geometry(t, p, R, point.q[inputs])
            if kind == "type 2":
                assert abs(np.linalg.det(unit(lines))) < 1e-7
            elif len(felt) == 6:
                assert np.abs(felt).min() < 1e-7
            else:
                assert abs(at_rest(t, p, lines, felt)) < 1e-7
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-5)
    np.testing.assert_allclose(arms, np.broadcast_to(arms[0], np.shape(arms)), rtol=1e-5)
    assert met["type 2"]
    assert met["type 1"]


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
            lines.append([*(B - C), *np.cross(C, B)])
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
    made = written(tmp_path, *stewart(base, platform, driven=inputs))
    mechanism = pinsing.load_mechanism(made).without_limits()
    forms = pose_forms(mechanism)
    assert forms.complete
    ratios, met = [], 0
    for q in random_closed(mechanism, 8, rng):
        for start in (q, refine(mechanism, q, "type 2").q):
            if np.abs(residual(mechanism, start)).max() > 1e-9:
                continue
            p, R = output(mechanism, start)
            lines = []
            for names, C, B in zip(driven, base, p + platform @ R.T, strict=True):
                d = B - C
                # The hinge across the leg, and what is across both.
                hinge = np.cross(X, d)
                force = {"p": d, "ux": hinge, "uy": np.cross(hinge, d)}
                for name in names:
                    f = force[name]
                    lines.append([*f, *np.cross(B, f)])
            two = left_sides(mechanism, forms, start, "type 2")[0]
            if start is q:
                ratios.append(np.linalg.det(lines) / two)
            elif mechanism_at(mechanism, start).kind == "type 2":
                met += 1
                assert locus_distance(mechanism, forms, start) < 1e-7
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
    for q in random_closed(mechanism, 9, rng):
        for start in (q, refine(mechanism, q, "type 2").q):
            if np.abs(residual(mechanism, start)).max() > 1e-9:
                continue
            p, R = output(mechanism, start)
            ends = p[:2] + PLATFORM @ R[:2, :2].T
            d = ends - BASE
            own = np.linalg.det(np.column_stack([-d[:, 1], d[:, 0], (ends * d).sum(axis=1)]))
            if start is q:
                ratios.append(own / np.prod(left_sides(mechanism, forms, q, "type 2")))
            elif mechanism_at(mechanism, start).kind == "type 2":
                met += 1
                assert abs(own) < 1e-8
                assert locus_distance(mechanism, forms, start) < 1e-7
    assert met
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-6)


@pytest.mark.slow
def test_what_is_written_of_determinants(tmp_path):
    t = six("pus", 0, parallel=True)
    mechanism = made(tmp_path, t)
    forms = pose_forms(mechanism)
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
    for more, rows in (([], 0), (["--exact"], 6)):
        done = run("families", "-v", tmp_path / "made.urdf", "--loops", *more)
        assert done.exit_code == 0
        over_pose = done.stdout.partition("Closed forms in the joint angles")[0]
        assert "determinant of 6 x 6 entries" in over_pose
        assert ("(1) x " in over_pose) == bool(rows)
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
    for q in random_closed(mechanism, 6, np.random.default_rng(1)):
        for start in (q, refine(mechanism, q, "type 1").q, refine(mechanism, q, "type 2").q):
            if np.abs(residual(mechanism, start)).max() > 1e-9:
                continue
            kind = mechanism_at(mechanism, start).kind
            met.add(kind)
            assert (locus_distance(mechanism, forms, start) < 1e-7) == (kind != "regular")
    assert {"regular", "type 1", "type 2"} <= met
