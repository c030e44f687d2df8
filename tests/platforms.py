"""Platforms on legs, written as files in many ways, and their lines computed without pinsing."""

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from mechanisms import value
from urdf_text import J, X, Y, Z, carried, frame, loop_text, written

import pinsing

BASE = np.array([[0, 0], [1, 0.1], [0.4, 0.9]])
PLATFORM = np.array([[-0.2, -0.1], [0.25, -0.1], [0, 0.3]])


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def rotation(e):
    """Of a unit quaternion, by its own formula."""
    w, v = e[0], np.array(e[1:])
    K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * K + 2 * K @ K


def turned(axis, angle):
    return pin.AngleAxis(float(angle), axis).matrix()


def turned_in_plane(angle):
    return turned(np.eye(3)[2], angle)[:2, :2]


def pluecker(a, b):
    """Lines through two points each: direction and moment about the origin."""
    return np.concatenate([b - a, np.cross(a, b)], axis=-1)


def lines_in_plane(a, b):
    """The same of points (N, 2) in a plane (N, 3)."""
    return np.column_stack([b - a, a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]])


TURNS = np.linspace(-np.pi, np.pi, 20001) + 0.1234567


def circle(axis, arm):
    """The arm turned by all TURNS (N, 3)."""
    along = (arm @ axis) * axis
    c, s = np.cos(TURNS)[:, None], np.sin(TURNS)[:, None]
    return along + c * (arm - along) + s * np.cross(axis, arm)


def changes(values):
    """How often they change their sign."""
    return int((np.sign(values[1:]) != np.sign(values[:-1])).sum())


def poses(count, rng):
    """Positions and unit quaternions."""
    out = []
    for _ in range(count):
        e = unit(rng.normal(size=4))
        out.append((rng.uniform(-1, 1, 3), e))
    return out


def named(at, e):
    return {**dict(zip("xyz", at, strict=True)), **{f"e{k}": v for k, v in enumerate(e)}}


def equation_values(forms, rows):
    """Product of all type 2 (and constraint) loci at rows of variables."""
    loci = [x.equation for x in forms.loci if x.kind != "type 1"]
    return np.array([np.prod([value(x, row) for x in loci]) for row in rows])


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
    text = loop_text(loops, [f"{driven}{k}" for k in range(3)], "out", rows, kind, start)
    return pinsing.load_mechanism(written(folder, joints, text))


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
    legs = []
    kind, limits = ("prismatic", (-1.5, 1.5)) if t.legs in ("pus", "prs") else ("continuous", None)
    for k in range(len(t.base)):
        leg = [J(f"q{k}", "base", f"car{k}", t.base[k], t.axes[k], kind, limits)]
        back = np.zeros(3)
        if t.legs in ("pus", "rus"):
            leg.append(J(f"u{k}x", f"car{k}", f"cross{k}", t.arms[k], X))
            leg.append(J(f"u{k}y", f"cross{k}", f"rod{k}", axis=Y))
        else:
            # The hinge is beside the point that is straight across from the end.
            back = -0.1 * t.hinges[k]
            leg.append(J(f"r{k}", f"car{k}", f"rod{k}", t.arms[k] - back, t.hinges[k]))
        leg.append(frame(f"e{k}", f"rod{k}", np.array([0, 0, t.rods[k]]) + back))
        legs.append(leg)
    if t.legs == "rps":
        legs = [_hinged_leg(k, t.base[k], t.hinges[k], "q") for k in range(3)]
    joints, loops = carried(legs, t.platform, "w")
    inputs = [f"q{k}" for k in range(len(legs))]
    return pinsing.load_mechanism(written(folder, joints, loop_text(loops, inputs, "out", t.rows)))


def _hinged_leg(k, foot, hinge, name):
    slide = J(f"p{k}", f"car{k}", f"rod{k}", axis=Z, kind="prismatic", limits=(0.3, 3))
    return [J(f"{name}{k}", "base", f"car{k}", foot, hinge), slide]


def hinged(rng):
    """Corners of the base, axes there and corners of the platform of a 3-RPS at random."""
    turns = np.array([0.0, 2.0, 4.2]) + rng.uniform(-0.2, 0.2, 3)
    hinges = np.stack([-np.sin(turns), np.cos(turns), 0 * turns], axis=1).round(2)
    base = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1).round(2)
    return base, hinges, 0.5 * base + np.round(rng.uniform(-0.1, 0.1, (3, 3)), 2)


def rps(folder, base, hinges, platform, rows="vz, wx, wy"):
    """A general 3-RPS: feet, hinge axes (level) and platform points."""
    legs = [_hinged_leg(k, base[k], hinges[k], "r") for k in range(3)]
    joints, loops = carried(legs, platform, "s")
    text = loop_text(loops, ["p0", "p1", "p2"], "out", rows, home={f"p{k}": 0.8 for k in range(3)})
    return pinsing.load_mechanism(written(folder, joints, text))
