"""Platforms written in many ways, against lines and planes computed here without pinsing."""

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import left_sides, placed
from test_pose_forms import equation_values, named, pluecker, poses, rotation
from tiers import tiered
from urdf_text import J, X, Z, frame, loop_text, stewart, written

import pinsing
from pinsing.loops import joint_forms, mechanism_at, pose_forms, ranks, refine
from pinsing.loops.closure import random_closed, residual, without_length
from pinsing.loops.pose_loci import locus_distance

BASE = np.array([[0, 0], [1, 0.1], [0.4, 0.9]])
PLATFORM = np.array([[-0.2, -0.1], [0.25, -0.1], [0, 0.3]])


@dataclass(frozen=True, eq=False)
class Way:
    """How a planar platform is written, and its lengths."""

    legs: str  # rpr or rrr
    rpy: tuple[float, float, float] = (0, 0, 0)
    layers: float = 0.0
    from_platform: tuple[int, ...] = ()
    cut_at_elbow: tuple[int, ...] = ()
    driven: str = ""
    kind: str = ""
    output_rpy: tuple[float, float, float] = (0, 0, 0)
    base: np.ndarray = field(default_factory=lambda: BASE, repr=False)
    platform: np.ndarray = field(default_factory=lambda: PLATFORM, repr=False)
    crank: float = 0.5
    rod: float = 0.45


def planar(folder, way: Way):
    joints = [J("mount", "world", "base", kind="fixed", rpy=way.rpy)]
    loops = []
    at = [(*p, way.layers * k) for k, p in enumerate(way.base)]
    on = [(*(p - way.platform[0]), 0.0) for p in way.platform]
    for k in range(3):
        tip, foot = f"e{k}", f"v{k}"
        if k in way.from_platform:
            joints.append(J(f"r{k}", "platform", f"c{k}", on[k]))
            joints.append(J(f"p{k}", f"c{k}", tip, (0, 0, 0), X, "prismatic", (0.05, 3)))
            joints.append(frame(foot, "base", at[k]))
        elif way.legs == "rpr":
            joints.append(J(f"r{k}", "base", f"c{k}", at[k]))
            joints.append(J(f"p{k}", f"c{k}", tip, (0, 0, 0), X, "prismatic", (0.05, 3)))
        else:
            joints.append(J(f"a{k}", "base", f"c{k}", at[k]))
            if k in way.cut_at_elbow:
                joints.append(frame(foot, f"c{k}", (way.crank, 0, 0)))
                joints.append(J(f"b{k}", "platform", f"rod{k}", on[k]))
            else:
                joints.append(J(f"b{k}", f"c{k}", f"rod{k}", (way.crank, 0, 0)))
            joints.append(frame(tip, f"rod{k}", (way.rod, 0, 0)))
        if k == 0:
            joints.append(J("turn", tip, "platform", axis=Z))
            continue
        if k not in way.from_platform and k not in way.cut_at_elbow:
            joints.append(frame(foot, "platform", on[k]))
        loops.append((tip, foot))
    centre = (*-way.platform[0], 0)
    joints.append(J("at_out", "platform", "out", centre, kind="fixed", rpy=way.output_rpy))
    driven = way.driven or ("p" if way.legs == "rpr" else "a")
    rows = "vx, vz, wy" if way.rpy == (np.pi / 2, 0, 0) else "vx, vy, wz"
    start = {"p0": 0.6} if way.legs == "rpr" else {"a0": 1, "a1": 2, "a2": -1}
    kind = way.kind or ("planar" if way.layers else "3d")
    text = loop_text(loops, [f"{driven}{k}" for k in range(3)], "out", rows, kind, start)
    return pinsing.load_mechanism(written(folder, joints, text))


def in_plane(mechanism, q, way):
    """Position and angle of ``out`` in the plane of the table, and the legs' force lines."""
    mount = pin.rpy.rpyToMatrix(*way.rpy)
    place = placed(mechanism, q).oMf[mechanism.output_id]
    own = pin.rpy.rpyToMatrix(*way.output_rpy)
    R, p = mount.T @ place.rotation @ own.T, mount.T @ place.translation
    ends = p[:2] + way.platform @ R[:2, :2].T
    inner = way.base
    if way.legs == "rrr" and way.driven != "b":
        cranks = [q[mechanism.joints.index(f"a{k}")] for k in range(3)]
        inner = inner + way.crank * np.stack([np.cos(cranks), np.sin(cranks)], axis=1)
    lines = [
        [*(e - a), a[0] * e[1] - a[1] * e[0]] / np.linalg.norm(e - a)
        for a, e in zip(inner, ends, strict=True)
    ]
    return np.linalg.det(lines)


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
    assert forms is not None
    assert forms.complete
    ratios = []
    for q in random_closed(mechanism, 12, rng):
        # The lines' lengths are no matter: the equation has those of the file.
        two = np.prod(left_sides(mechanism, forms, q, "type 2"))
        ratios.append(np.sign(two) * np.sign(in_plane(mechanism, q, way)))
    assert len(ratios) > 4
    assert len(set(ratios)) == 1
    found = 0
    for q in random_closed(mechanism, 8, rng):
        point = refine(mechanism, q, "type 2")
        slides = np.abs(point.q[mechanism.prismatic])
        if np.abs(residual(mechanism, point.q)).max() > 1e-9 or slides.min(initial=1.0) < 1e-3:
            continue
        if mechanism_at(mechanism, point.q).input_ratio > 1e-9:
            # Not found, or where a leg has no length.
            continue
        found += 1
        assert abs(in_plane(mechanism, point.q, way)) < 1e-6
        assert np.abs(left_sides(mechanism, forms, point.q)).min() < 1e-6
    assert found


@pytest.mark.parametrize("seed", tiered(range(7), (6,)))
def test_random_stewart_platforms_are_singular_where_their_lines_are_dependent(seed, tmp_path):
    """Level ones and others; some of the legs written from the platform."""
    rng = np.random.default_rng(seed)
    base = np.round(rng.uniform(-1, 1, (6, 3)) * [1, 1, seed % 2], 2)
    platform = np.round(rng.uniform(-0.5, 0.5, (6, 3)) * [1, 1, seed % 3], 2)
    hanging = (1, 2, 3, 4, 5)[: (seed + 1) % 6]
    made = written(tmp_path, *stewart(base, platform, hanging=hanging))
    forms = pose_forms(pinsing.load_mechanism(made))
    assert forms is not None
    assert forms.complete
    assert not forms.architecture
    rows, lines = [], []
    for at, e in poses(12, rng):
        rows.append(named(at, e))
        ends = at + platform @ rotation(e).T
        lines.append(np.linalg.det([pluecker(a, b) for a, b in zip(base, ends, strict=True)]))
    # One polynomial is the other times a constant.
    ratio = np.array(lines) / equation_values(forms, rows)
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
        made = pinsing.load_mechanism(written(tmp_path, *stewart(base, platform), name=f"m{k}"))
        forms = pose_forms(made)
        # By the lines alone, at poses turned about all axes.
        sigma = []
        for at, e in poses(6, rng):
            ends = at + platform @ rotation(e).T
            rows = np.array([pluecker(a, b) for a, b in zip(base, ends, strict=True)])
            rows /= np.linalg.norm(rows, axis=1)[:, None]
            sigma.append(np.linalg.svd(rows, compute_uv=False)[-1])
        assert (max(sigma) < 1e-9) == everywhere
        assert bool(forms.architecture) == everywhere
        if everywhere:
            assert "platform and base hexagons are similar" in forms.architecture
        else:
            # Not turned about the normal they are dependent all the same.
            assert any(str(x.equation) == "e3 = 0" for x in forms.loci)


@pytest.mark.slow
def test_an_equation_of_one_term_says_how_near_it_is(tmp_path):
    """A platform like its base: not turned at all it is singular at every position."""
    mechanism = planar(tmp_path, Way("rpr", platform=0.5 * (BASE - BASE.mean(axis=0))))
    forms = pose_forms(mechanism)
    assert any(len(x.equation.values) == 1 for x in forms.loci)
    found = pinsing.loops.analyze_mechanism(mechanism)
    assert found.points
    assert all(check.passed for check in found.checks)
    distances = [locus_distance(mechanism, forms, p.q) for p in found.points]
    assert max(distances) < 1e-7
    for q in random_closed(mechanism, 6, np.random.default_rng(3)):
        if mechanism_at(mechanism, q).input_ratio > 1e-2:
            assert locus_distance(mechanism, forms, q) > 1e-4


def rod_on_three_cranks(folder, third=0.4, crank=1.0):
    """The coupling rod of a locomotive on three cranks; rigid where one has another length."""
    pivots, joints = [(0.0, 0.0), (1.0, 0.0), (0.5, 0.2)], []
    for k, (x, y) in enumerate(pivots):
        joints.append(J(f"r{k}", "base", f"crank{k}", (x, y, 0)))
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
    for run in (pose_forms, joint_forms, loops.assembly_modes, loops.analyze_mechanism):
        with pytest.raises(pinsing.PinsingError, match="b0 and turn turn about one axis"):
            run(mechanism)
