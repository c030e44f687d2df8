"""What the tests of closed forms share: arms, and checks of families against Pinocchio.

The checks judge singularity on their own, from Pinocchio's Jacobians alone: a singular
value counts as zero relative to the largest one that the arm has anywhere, so that a task
whose Jacobian vanishes altogether is judged rightly too.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import pinocchio as pin
from arms import place, serial
from urdf_text import ZERO, Z, chain_text

from pinsing.algebra.budget import Budget
from pinsing.algebra.equation import Equation
from pinsing.algebra.jacobian_matrix import constants
from pinsing.algebra.ring import Poly, Ring, make_ring
from pinsing.families import ClosedForm, closed_form
from pinsing.kinematics.jacobian import generic_rank, task_jacobians
from pinsing.kinematics.refine import walk
from pinsing.measures import Array
from pinsing.robot.arm import Arm
from pinsing.robot.load import load
from pinsing.robot.nominal import ANGLE_TOL, Nominal, nominal
from pinsing.sampling.tally import minima

RIGHT = np.pi / 2

# Name of the test, and how to load the arm: the robot, its tip and base where they are chosen.
_WHOLE = (
    "stanford puma560 irb1400 iiwa14 surgical7 scara ur5 ur10 panda xarm7 z1 talos_arm so101 kinova"
)
ROBOTS: dict[str, dict[str, str]] = {
    **{name: {"robot": name} for name in _WHOLE.split()},
    "planar3r": {"robot": "planar3r", "task": "position"},
    "talos_left": {
        "robot": "talos_full_v2",
        "tip": "gripper_left_base_link",
        "base": "torso_2_link",
    },
    "tiago": {"robot": "tiago", "tip": "arm_tool_link", "base": "torso_lift_link"},
    "tiago_pro": {"robot": "tiago_pro", "tip": "arm_left_tool_link", "base": "torso_lift_link"},
    "pr2": {"robot": "pr2", "tip": "r_gripper_tool_frame", "base": "torso_lift_link"},
    "baxter": {"robot": "baxter", "tip": "left_gripper"},
    "romeo": {"robot": "romeo", "tip": "l_wrist", "base": "torso"},
    "g1": {"robot": "g1", "tip": "left_rubber_hand", "base": "torso_link"},
    "icub_left": {"robot": "icub", "tip": "l_hand", "base": "chest"},
    "icub_right": {"robot": "icub", "tip": "r_hand", "base": "chest"},
}


@functools.cache
def arm_of(name: str) -> Arm:
    return load(**ROBOTS[name])


@functools.cache
def closed(name: str) -> ClosedForm:
    return closed_form(arm_of(name))


@dataclass(frozen=True)
class Joint:
    """Row of a modified DH table: a along x, alpha about x, then d along and theta about z."""

    alpha: float = 0.0
    a: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    slides: bool = False
    limits: tuple[float, float] | None = None


def build(
    joints: Sequence[Joint],
    tip: Sequence[float] = (0.0, 0.0, 0.0),
    task: str = "pose",
    length_scale: float = 1.0,
) -> Arm:
    """Serial arm of a modified DH table."""
    rows = []
    for joint in joints:
        at = place((joint.a, 0, 0), pin.utils.rotate("x", joint.alpha))
        at = at * place((0, 0, joint.d), pin.utils.rotate("z", joint.theta))
        reach = 1.0 if joint.slides else np.pi
        kind = pin.JointModelPZ() if joint.slides else pin.JointModelRZ()
        rows.append((kind, at, *(joint.limits or (-reach, reach))))
    model = serial(rows, place(tip), name="built")
    return load(model, tip="tip", task=task, length_scale=length_scale)


def finger(kind: str = "revolute", mimic: str = "") -> Arm:
    """Position of three parallel axes, of which the last may follow."""
    rows = [("revolute", ZERO), ("revolute", (0.5, 0, 0)), (kind, (0.4, 0, 0), Z, ZERO, mimic)]
    return load(chain_text([*rows, ("fixed", (0.3, 0, 0))]), task="position")


# Cosine and sine are short decimals, so that intersecting axes intersect in decimals too.
TILTS = (0.0, RIGHT, -RIGHT, np.arctan2(0.6, 0.8), np.arctan2(0.8, 0.6), -np.arctan2(0.28, 0.96))


def iiwa_with_offset() -> Arm:
    """The KUKA of ROS-Industrial: axes 2 and 4 stand 0.436 mm beside the others."""
    y, z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    off = 0.00043624
    rows = [
        ((0, 0, 0), z, 170), ((-off, 0, 0.36), y, 120), ((0, 0, 0), z, 170),
        ((off, 0, 0.42), -y, 120), ((0, 0, 0), z, 170), ((0, 0, 0.4), y, 120), ((0, 0, 0), z, 175),
    ]  # fmt: skip
    joints = [
        (pin.JointModelRevoluteUnaligned(axis), place(at), *np.radians([-limit, limit]))
        for at, axis, limit in rows
    ]
    model = serial(joints, place((0, 0, 0.126)), name="lbr_iiwa_14_r820", names="joint_a")
    return load(model, tip="tip")


def random_arm(seed: int, kind: str, task: str = "pose", joints: int | None = None) -> Arm:
    """Arm drawn from a seed; ``kind`` is "right" (twists of 90 degrees), "tilted" or "turned".

    Half of the offsets are zero, so that axes meet, coincide and are parallel often.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8)) if joints is None else joints
    rows = []
    for _ in range(n):
        if kind == "tilted":
            alpha = float(rng.choice(TILTS))
        else:
            alpha = float(rng.choice([0.0, RIGHT, -RIGHT, np.pi], p=[0.2, 0.35, 0.35, 0.1]))
        a, d = (0.0 if rng.random() < 0.5 else round(rng.uniform(-0.5, 0.5), 2) for _ in range(2))
        theta = float(rng.choice([0.0, RIGHT, np.pi / 4])) if kind == "turned" else 0.0
        rows.append(Joint(alpha, a, d, theta, slides=bool(rng.random() < 0.15)))
    tip = np.round(rng.uniform(-0.3, 0.3, 3), 2) if rng.random() < 0.5 else np.zeros(3)
    return build(rows, tip, task)


def moves(arm: Arm) -> bool:
    """Whether the joints move the tip in any row of the task, at random configurations."""
    q = np.random.default_rng(5).uniform(-1, 1, (4, arm.n))
    return bool(np.abs(task_jacobians(arm, q)).max() > 1e-9)


def typical(arm: Arm) -> float:
    """Largest singular value of the task Jacobian, the median of random configurations."""
    rng = np.random.default_rng(5)
    reach = np.where(arm.prismatic, arm.length_scale, np.pi)
    J = task_jacobians(arm, rng.uniform(-1, 1, (8, arm.n)) * reach)
    return float(np.median(np.linalg.svd(J, compute_uv=False)[:, 0]))


def drop(arm: Arm, Q: Array, rank: int | None = None) -> Array:
    """sigma_r at Q (N, n) over the typical size of the task Jacobian."""
    rank = generic_rank(arm) if rank is None else rank
    sigma = np.linalg.svd(task_jacobians(arm, Q), compute_uv=False)
    return sigma[:, rank - 1] / typical(arm)


def random_singular(arm: Arm, count: int, seed: int) -> Array:
    """Singular configurations reached from random starts on whole circles: (k, n)."""
    rng = np.random.default_rng(seed)
    reach = np.where(arm.prismatic, arm.length_scale, np.pi)
    found = walk(arm, rng.uniform(-1, 1, (count, arm.n)) * reach, ignore_limits=True).q
    return found[drop(arm, found) <= 1e-9]


def check_families(
    arm: Arm, form: ClosedForm, count: int, seed: int = 1, tol: float = 1e-9
) -> None:
    """``count`` points over all families are singular; so are as many within the limits."""
    geometry = nominal(arm)
    rng = np.random.default_rng(seed)
    real = [f for f in form.families if f.real]
    share = -(-count // max(1, len(real)))
    for family in real:
        inside = family.sample(share, rng)
        assert len(inside) == (share if family.is_reachable else 0), family
        # "At the joint limit": beyond it by less than the angle tolerance.
        slack = ANGLE_TOL if family.reachability == "at the joint limit" else 1e-6
        assert arm.within_limits(inside, slack).all(), family
        points = family.points(share, rng)
        assert len(points) == share, family
        for Q in (points, inside):
            if not len(Q):
                continue
            ratio = drop(geometry.arm, Q, form.generic_rank)
            assert ratio.max() <= tol, f"{family}: a configuration with {ratio.max():.1e}"
            assert family.contains(Q, 1e-6 if tol <= 1e-9 else 1e-3).all(), family
            if np.isfinite(geometry.jacobian_change):
                # No singular value moves by more than the Frobenius norm of the change.
                sigma = np.linalg.svd(task_jacobians(arm, Q), compute_uv=False)
                bound = np.sqrt(arm.n) * geometry.jacobian_change + tol * typical(arm)
                assert (sigma[:, form.generic_rank - 1] <= bound).all(), family


def check_search(arm: Arm, form: ClosedForm, count: int, seed: int = 1, tol: float = 1e-5) -> int:
    """Singular configurations that a search finds lie on the families; returns how many."""
    found = random_singular(nominal(arm).arm, count, seed)
    covered = np.zeros(len(found), dtype=bool)
    for family in form.families:
        covered |= family.contains(found, tol)
    missed = found[~covered]
    assert not len(missed), f"{len(missed)} of {len(found)} on no family, such as {missed[0]}"
    return len(found)


def check_beside(arm: Arm, form: ClosedForm, count: int, share: float = 0.9) -> None:
    """A random step of 0.05 in the joints that matter leaves the singular set, but by chance."""
    exact, rng = nominal(arm).arm, np.random.default_rng(4)
    for family in form.families:
        Q = family.points(count, rng)
        step = rng.normal(size=Q.shape) * [name in family.joints for name in arm.joints]
        moved = Q + 0.05 * step / np.linalg.norm(step, axis=1, keepdims=True)
        regular = drop(exact, moved, form.generic_rank) > 1e-7
        assert regular.mean() >= share, family
        assert not family.contains(moved[regular], 1e-9).any(), family


def check_apart(form: ClosedForm, count: int, tol: float = 1e-9) -> None:
    """No family lies in another one."""
    rng = np.random.default_rng(5)
    for family in form.families:
        Q = family.points(count, rng)
        for other in form.families:
            inside = other is not family and len(Q) and other.contains(Q, tol).all()
            assert not inside, (family, other)


def check_all(arm: Arm, form: ClosedForm, tol: float = 1e-9) -> int:
    """Families are singular, steps beside them are not, a search ends on them; how many it ends."""
    assert form.complete, form.gaps
    check_families(arm, form, 100 * len(form.families), tol=tol)
    check_beside(arm, form, 100, share=0.5)
    return check_search(arm, form, 300)


def dips(values: np.ndarray) -> np.ndarray:
    """Local minima of a curve that is singular nowhere."""
    return np.flatnonzero(minima(values[None], np.ones((1, len(values))))[0])


def terms(*rows: tuple[Any, ...], joints: Sequence[str] = (), shift: Any = 0.0) -> Equation:
    """An equation of terms: doubled frequencies, powers, factors of the cosine and of the sine."""
    frequencies, powers, cos, sin = (np.array(column) for column in zip(*rows, strict=True))
    n = frequencies.shape[1]
    names = tuple(joints) or tuple(f"q{i + 1}" for i in range(n))
    shift = np.broadcast_to(np.asarray(shift, dtype=float), (n,))
    return Equation(names, frequencies, powers, cos.astype(float), sin.astype(float), shift)


def sliding_equation(form: ClosedForm) -> Equation:
    """d3^2 + 0.5 d3 cos q2 - 0.3, of an arm with six joints."""
    none, q2, d3 = [0] * 6, [0, 2, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0]
    square = [0, 0, 2, 0, 0, 0]
    rows = (none, square, 1.0, 0.0), (q2, d3, 0.5, 0.0), (none, none, -0.3, 0.0)
    return terms(*rows, joints=form.symbols)


def ring_for(geometry: Nominal) -> Any:
    """The ring that an arm's Jacobian is over."""
    slides = tuple(bool(p) for p in geometry.arm.prismatic)
    return make_ring(slides, constants(geometry, geometry.arm.task), Budget(60))


def random_form(ring: Ring, rng: np.random.Generator, degrees: Sequence[int], count: int) -> Poly:
    """Of given degrees in each revolute joint's pair, of all up to them in slides; random terms."""
    gens = ring.context.gens()
    total = ring.zero
    for _ in range(count):
        number = Fraction(int(rng.choice([-1, 1]) * rng.integers(1, 41)), int(rng.integers(1, 10)))
        term = ring.number(number)
        for j, degree in enumerate(degrees):
            k = int(rng.integers(0, degree + 1))
            x, *y = ring.variables(j)
            term = term * gens[x] ** k
            if not ring.prismatic[j]:
                term = term * gens[y[0]] ** (degree - k)
        total = total + term
    return total
