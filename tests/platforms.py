"""Platforms on legs, written as files in many ways, and what their loci are compared with."""

import itertools
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin
from mechanisms import assembled, closed_and_refined, value
from urdf_text import J, X, Y, Z, carried, frame, stewart, written

from pinsing.loops import joint_forms, mechanism_at, pose_forms, ranks
from pinsing.loops.closure import random_closed
from pinsing.loops.pose_loci import locus_distance, variables_at
from pinsing.robot.mechanism import Mechanism, load_mechanism

BASE = np.array([[0, 0], [1, 0.1], [0.4, 0.9]])
PLATFORM = np.array([[-0.2, -0.1], [0.25, -0.1], [0, 0.3]])


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def turned(axis, angle):
    return pin.AngleAxis(float(angle), axis).matrix()


def turned_in_plane(angle):
    return turned(np.eye(3)[2], angle)[:2, :2]


@dataclass(frozen=True, eq=False)
class Way:
    """How a planar platform is written, and its lengths."""

    legs: str  # rpr or rrr
    rpy: tuple[float, float, float] = (0, 0, 0)
    layers: float = 0.0
    from_platform: tuple[int, ...] = ()
    cut_at_elbow: tuple[int, ...] = ()
    driven: str = ""  # kind of the joints, or of each leg's
    kind: str = ""
    output_rpy: tuple[float, float, float] = (0, 0, 0)
    base: np.ndarray = field(default_factory=lambda: BASE, repr=False)
    platform: np.ndarray = field(default_factory=lambda: PLATFORM, repr=False)
    crank: float | np.ndarray = 0.5
    rod: float | np.ndarray = 0.45


def planar(folder, way: Way):
    joints = [J("mount", "world", "base", kind="fixed", rpy=way.rpy)]
    loops = []
    at = [(*p, way.layers * k) for k, p in enumerate(way.base)]
    on = [(*(p - way.platform[0]), 0.0) for p in way.platform]
    cranks, rods = (np.broadcast_to(x, 3) for x in (way.crank, way.rod))
    for k in range(3):
        tip, foot = f"e{k}", f"v{k}"
        if way.legs == "rpr":
            hangs = k in way.from_platform
            link, place = ("platform", on[k]) if hangs else ("base", at[k])
            joints.append(J(f"r{k}", link, f"c{k}", place))
            joints.append(J(f"p{k}", f"c{k}", tip, (0, 0, 0), X, "prismatic", (0.05, 3)))
            if hangs:
                joints.append(frame(foot, "base", at[k]))
        else:
            joints.append(J(f"a{k}", "base", f"c{k}", at[k]))
            if k in way.cut_at_elbow:
                joints.append(frame(foot, f"c{k}", (cranks[k], 0, 0)))
                joints.append(J(f"b{k}", "platform", f"rod{k}", on[k]))
            else:
                joints.append(J(f"b{k}", f"c{k}", f"rod{k}", (cranks[k], 0, 0)))
            joints.append(frame(tip, f"rod{k}", (rods[k], 0, 0)))
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
    inputs = [f"{(3 * driven)[k]}{k}" for k in range(3)]
    return assembled(folder, joints, loops, inputs, "out", rows, kind, start)


def on_legs(folder, legs, ends, inputs, rows, whole="", home=None):
    """A platform whose points are on legs; its output is the frame ``out``."""
    joints, loops = carried(legs, ends, whole)
    return assembled(folder, joints, loops, inputs, "out", rows, home=home)


def slides_in_the_plane(folder):
    """A 3-PRR, its slides driven: along axes that are not exact."""
    legs = []
    for k, at in enumerate(BASE):
        along = np.array([np.cos(0.3 + 2 * k), np.sin(0.3 + 2 * k), 0]).round(6)
        slide = J(f"d{k}", "base", f"s{k}", (*at, 0), along, "prismatic", (-3, 3))
        legs.append([slide, J(f"r{k}", f"s{k}", f"rod{k}"), frame(f"e{k}", f"rod{k}", (0.9, 0, 0))])
    return on_legs(folder, legs, PLATFORM, ["d0", "d1", "d2"], "vx, vy, wz")


def six(folder, legs, seed):
    """Rods at random on rails (``pus``: a hexaglide) or on cranks (``rus``); inputs q0, q1, ...

    Those of seed 0 have parallel axes.
    """
    rng = np.random.default_rng(seed)
    base = rng.uniform(-1, 1, (6, 3)).round(2) * (1, 1, 0.2)
    platform = rng.uniform(-0.4, 0.4, (6, 3)).round(2)
    axes = unit(rng.normal(size=(6, 3))) if seed else np.tile([1.0, 0.0, 0.0], (6, 1))
    how, arms = ("prismatic", (-1.5, 1.5)), np.zeros((6, 3))
    if legs == "rus":
        how, arms = ("continuous", None), rng.uniform(-0.3, 0.3, (6, 3)).round(2)
    rods = np.linalg.norm(platform + np.array([0, 0, 1]) - base - arms, axis=1).round(3)
    chains = [
        [
            J(f"q{k}", "base", f"car{k}", base[k], axes[k], *how),
            J(f"u{k}x", f"car{k}", f"cross{k}", arms[k], X),
            J(f"u{k}y", f"cross{k}", f"rod{k}", axis=Y),
            frame(f"e{k}", f"rod{k}", (0, 0, rods[k])),
        ]
        for k in range(6)
    ]
    inputs = [f"q{k}" for k in range(6)]
    return on_legs(folder, chains, platform, inputs, "vx, vy, vz, wx, wy, wz", "w")


def three(folder, legs, seed, driven="q"):
    """A random 3-PRS, 3-RRS, or 3-RPS driven in its feet (q0, q1, q2); the hinges lie level.

    A 3-RPS can be driven in its slides (p).
    """
    rng = np.random.default_rng(seed)
    turns = np.array([0.0, 2.0, 4.2]) + rng.uniform(-0.2, 0.2, 3)
    out = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    hinges = np.stack([-np.sin(turns), np.cos(turns), 0 * turns], axis=1)
    platform = (0.5 * out + rng.uniform(-0.05, 0.05, (3, 3))).round(2)
    rods = rng.uniform(0.8, 0.9, 3).round(2)
    if legs == "rps":
        return rps(folder, out.round(2), hinges.round(2), platform, driven=driven)
    axes, arms, how = unit(0.3 * out + np.array([0, 0, 1])), 0 * out, ("prismatic", (-1.5, 1.5))
    if legs == "rrs":
        axes, arms, how = hinges, 0.3 * unit(out + np.array([0, 0, 0.5])), ("continuous", None)
    chains = []
    for k, hinge in enumerate(hinges):
        # The hinge is beside the point that is straight across from the end.
        back = -0.1 * hinge
        chains.append([
            J(f"q{k}", "base", f"car{k}", out[k].round(2), axes[k], *how),
            J(f"r{k}", f"car{k}", f"rod{k}", arms[k] - back, hinge),
            frame(f"e{k}", f"rod{k}", np.array([0, 0, rods[k]]) + back),
        ])  # fmt: skip
    return on_legs(folder, chains, platform, ["q0", "q1", "q2"], "vz, wx, wy", "w")


def rps(folder, base, hinges, platform, rows="vz, wx, wy", driven="p"):
    """A general 3-RPS: feet, hinge axes (level) and platform points; slides p, hinges q."""
    legs = [
        [
            J(f"q{k}", "base", f"car{k}", base[k], hinges[k]),
            J(f"p{k}", f"car{k}", f"rod{k}", axis=Z, kind="prismatic", limits=(0.3, 3)),
        ]
        for k in range(3)
    ]
    home = {f"p{k}": 0.8 for k in range(3)} if driven == "p" else None
    return on_legs(folder, legs, platform, [f"{driven}{k}" for k in range(3)], rows, "s", home)


def random_3rps(folder, seed):
    # Without limits: a leg may reach with a negative length.
    return three(folder, "rps", seed, "p").without_limits()


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
    return assembled(folder, joints, loops, ["a0", "a1", "a2"], "platform", "wx, wy, wz")


def random_eye(folder, seed):
    return eye(folder, *unit(np.random.default_rng(seed).normal(size=(3, 3, 3))))


def ups(folder, base, platform, **options):
    """A 6-UPS by its points, as files."""
    return load_mechanism(written(folder, *stewart(base, platform, **options)))


def volume(M):
    """Product of the singular values: the determinant where rows are redundant too."""
    return float(np.prod(np.linalg.svd(M, compute_uv=False)[: M.shape[1]]))


def left_side(locus, mechanism, q):
    """Of a locus in the joint angles, the value as it is, but for its sign: no row scaled."""
    if locus.equation is not None:
        return float(locus.equation(q))
    return volume(locus.entries(q, mechanism.joints))


def of_velocity(loci, values):
    """Logarithm of what left sides of loci say of the output's velocity: type 1 over type 2."""
    said = 0.0
    for x, left in zip(loci, values, strict=True):
        # An elbow that is driven has two equations, stretched and folded: a sine squared.
        power = 0.5 if "actuated elbow" in x.words else 1
        power *= {"type 1": 1, "type 2": -1, "type 2 or constraint": -1}.get(x.kind, 0)
        said += power * np.log(abs(left))
    return said


def check_loci(mechanism: Mechanism, rng: np.random.Generator, *kinds: str) -> None:
    """Compare loci over the pose and in the joint angles with the Jacobians of Pinocchio.

    The output's velocity is type 1 over type 2: up to a constant, and up to powers of what is zero
    with the length of a leg or across a universal joint. Kinds that are asked for are met, too.
    """
    mechanism = mechanism.without_limits()
    forms, joints = pose_forms(mechanism), joint_forms(mechanism).loci
    assert forms.complete
    assert not forms.architecture
    assert ranks(mechanism).mobility == len(mechanism.actuated)
    loci = {
        there: [x for x in forms.loci if ("e0" in x.equation.names) == there] for there in (0, 1)
    }
    across = [j for j, name in enumerate(mechanism.joints) if name[0] == "u" and name[-1] == "y"]
    powers, over_pose, in_joints = [], [], []
    for q in itertools.chain.from_iterable(random_closed(mechanism, 8, rng) for _ in range(12)):
        state, at = mechanism_at(mechanism, q), variables_at(mechanism, q)
        if min(state.output_ratio, state.input_ratio, state.constraint_ratio) < 1e-4:
            continue  # both are zero to rounding
        np.testing.assert_allclose([value(x, at) for x in forms.closing], 0, atol=1e-8)
        # Some have equations of their own where the output is level.
        turned = bool(loci[1]) and not (loci[0] and abs(at["e0"]) > 1 - 1e-9)
        speed = np.log(volume(state.velocity))
        here = loci[turned]
        over_pose.append(speed - of_velocity(here, [value(x.equation, at) for x in here]))
        in_joints.append(speed - of_velocity(joints, [left_side(x, mechanism, q) for x in joints]))
        zeros = [*q[mechanism.prismatic], *np.cos(q[across])]
        powers.append([turned, not turned, *np.log(np.abs(zeros))])
        if len(powers) > len(powers[0]) + 5:
            break
    else:
        raise AssertionError(f"only {len(powers)} closed configurations")
    exponents = np.linalg.lstsq(np.array(powers), over_pose)[0]
    np.testing.assert_allclose(powers @ exponents, over_pose, atol=1e-6)
    np.testing.assert_allclose(exponents[2:], exponents[2:].round(), atol=1e-5)
    np.testing.assert_allclose(in_joints, in_joints[0], atol=1e-6)
    met = dict.fromkeys(kinds, 0)
    for kind, q, found in closed_and_refined(mechanism, 9, rng, *kinds):
        if kind == found and np.abs(q[mechanism.prismatic]).min(initial=1) > 1e-3:
            met[kind] += 1
            of_kind = tuple(x for x in forms.loci if kind in x.kind)
            assert locus_distance(mechanism, replace(forms, loci=of_kind), q) < 1e-7
            if min(met.values()) > 1:
                break
    assert all(met.values())
