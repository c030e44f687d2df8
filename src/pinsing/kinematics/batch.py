"""Jacobians and singular values of one arm on an engine that is fixed by name.

The one place where the compiled kernel and Pinocchio's loop part. All methods take joint vectors
Q (N, n) that have been checked.

Which engine computes batches of Jacobians: the compiled kernel, or Pinocchio's own loop.

Pinocchio is the authority. Before the kernel is used for an arm it is compared with
``pin.computeFrameJacobian`` at random configurations, and refused if it differs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from pinsing._batch import engine as kernel
from pinsing.errors import EngineError, OptionError
from pinsing.measures import NOISE, ROUNDING, SEED, Array, Chain
from pinsing.robot.arm import Arm
from pinsing.robot.chain import flatten
from pinsing.robot.source import kept
from pinsing.robot.task import Task

PINOCCHIO = "pinocchio"
ENGINES = ("auto", "batch", PINOCCHIO)
INSTRUCTION_SETS = ("baseline", "avx2", "avx512")


def _chain_or_reason(arm: Arm) -> Chain | str:
    """The arm's chain for the kernel, or why there is none."""
    # A kernel that does not match the sources cannot be verified.
    return kernel.unavailable_reason() or _verified(arm)


def kernel_chain(arm: Arm) -> Chain:
    """The arm's chain for the kernel; EngineError if there is none, or it is not Pinocchio's."""
    found = _chain_or_reason(arm)
    if isinstance(found, str):
        raise EngineError(found)
    return found


def fixed_engine(arm: Arm, engine: str = "auto") -> str:
    """Return ``pinocchio``, or the best or given instruction set (baseline, avx2, avx512)."""
    # EngineError if it is not there, or disagrees with Pinocchio on this arm.
    here = kernel.isa_names()
    if engine == PINOCCHIO or (engine == "auto" and isinstance(_chain_or_reason(arm), str)):
        return PINOCCHIO
    if engine in (*here, "auto", "batch"):
        kernel_chain(arm)
        return engine if engine in here else here[-1]
    if engine in INSTRUCTION_SETS:
        has = ", ".join(here) or "no compiled kernel"
        EngineError.refuse_if(
            here and engine not in kernel.built_names(),
            f"engine {engine} was not compiled here; this installation has {has} "
            "(pip install -e . in the clone compiles all)",
        )
        raise EngineError(f"engine {engine} does not run on this machine; it has {has}")
    names = dict.fromkeys((*ENGINES, *here))
    raise OptionError(f"unknown engine {engine!r}: use one of {', '.join(names)}")


def engine_name(arm: Arm) -> str:
    """Say in a few words what computes batches for ``arm`` on this machine."""
    found = _chain_or_reason(arm)
    if isinstance(found, Chain):
        return f"compiled batch kernel ({kernel.isa_names()[-1]}), checked against Pinocchio"
    return f"Pinocchio and NumPy ({found})"


def model_values(arm: Arm, Q: Array) -> Array:
    """Plain value of every joint of the model, mimic joints included: (N, n) -> (N, nv)."""
    return Q if arm.coupling is None else arm.coupling.values(Q)


def pinocchio_jacobians(arm: Arm, Q: Array) -> Array:
    """Frame Jacobians (N, 6, nv) by every velocity of the model, mimic joints on their own."""
    model, tip = arm.model, arm.tip_id
    data = model.createData()  # a Data of its own: threads may share the arm
    frame, compute = pin.LOCAL_WORLD_ALIGNED, pin.computeFrameJacobian
    out = np.empty((len(Q), 6, model.nv))
    for i, q in enumerate(arm.model_q(Q)):
        # Pinocchio drops the second axis of a single column.
        out[i] = compute(model, data, q, tip, frame).reshape(6, model.nv)
    return out


@kept
def _verified(arm: Arm) -> Chain | str:
    """The flat chain if the kernel agrees with Pinocchio on it, else why it may not be used."""
    chain, rng = flatten(arm), np.random.default_rng(SEED)
    size = float(np.abs(chain.t).max()) or 1.0
    Q = rng.uniform(-1, 1, (_SAMPLES, arm.n)) * np.where(arm.prismatic, size, 2 * np.pi)
    ours, theirs = kernel.jacobians(chain, model_values(arm, Q)), pinocchio_jacobians(arm, Q)
    moved, turned = np.abs(ours - theirs).max(axis=(0, 2)).reshape(2, 3).max(axis=1)
    error = max(float(turned), float(moved) / max(size, float(np.abs(theirs[:, :3]).max())))
    if not error <= NOISE:
        return f"the compiled kernel differs from Pinocchio by {error:.1e} on this arm"
    return chain


def joint_frames(chain: Chain, Q: Array) -> tuple[Array, Array]:
    """Rotations (N, n + 1, 3, 3) and origins (N, n + 1, 3) of joints before they move, and tip."""
    R = np.broadcast_to(chain.R[0], (len(Q), 3, 3))
    p = np.broadcast_to(chain.t[0], (len(Q), 3))
    rotations, origins = [R], [p]
    for j, slides in enumerate(chain.prismatic):
        if slides:
            p = p + R[:, :, 2] * Q[:, j, None]
        else:
            c, s = np.cos(Q[:, j, None]), np.sin(Q[:, j, None])
            x, y, z = np.moveaxis(R, 2, 0)
            R = np.stack([x * c + y * s, y * c - x * s, z], axis=2)
        p = p + R @ chain.t[j + 1]
        R = R @ chain.R[j + 1]
        rotations.append(R)
        origins.append(p)
    return np.stack(rotations, axis=1), np.stack(origins, axis=1)


def tip_rotations(arm: Arm, Q: Array, engine: str = "auto", threads: int | None = None) -> Array:
    """Rotations (N, 3, 3) of the tip in the base at Q (N, n): columns are its axes."""
    engine = fixed_engine(arm, engine)
    if engine == PINOCCHIO:
        data = arm.model.createData()
        found = np.empty((len(Q), 3, 3))
        for i, q in enumerate(arm.model_q(Q)):
            pin.forwardKinematics(arm.model, data, q)
            found[i] = pin.updateFramePlacement(arm.model, data, arm.tip_id).rotation
        return found
    # Three slides along the tip's axes, behind it: their columns are those axes.
    chain = _with_tip_axes(arm)
    values = np.concatenate([model_values(arm, Q), np.zeros((len(Q), 3))], axis=1)
    return kernel.jacobians(chain, values, threads=threads, isa=engine)[:, :3, -3:]


def task_rows(arm: Arm, J: Array, Q: Array, R: Array | None = None) -> Array:
    """Return the task's rows (..., m, k) of J (..., 6, k), which is in base axes."""
    # ``Q`` (..., n), or ``R`` (..., 3, 3) where known, is where the tip's axes are taken.
    if arm.task.at_tip and R is None:
        flat = np.asarray(Q, dtype=float).reshape(-1, arm.n)
        R = tip_rotations(arm, flat).reshape(*np.shape(Q)[:-1], 3, 3)
    return picked(arm.task, J, R)


def picked(task: Task, J: Array, R: Array | None) -> Array:
    """The same of a task alone, with the tip's rotation R (..., 3, 3) where it counts."""
    rows = list(task.rows)
    if not task.at_tip or R is None:
        return np.asarray(J[..., rows, :])
    back = np.swapaxes(R, -1, -2)
    turned = np.concatenate([back @ J[..., :3, :], back @ J[..., 3:, :]], axis=-2)
    if all(task.at_tip):
        return np.asarray(turned[..., rows, :])
    return np.where(np.array(task.at_tip)[:, None], turned[..., rows, :], J[..., rows, :])


def in_base(arm: Arm, U: Array, q: Array) -> Array:
    """Wrenches (6, d) in base axes that the task rows U (m, d) at q (n,) are components of."""
    if arm.task.at_tip:
        return np.asarray(task_rows(arm, np.eye(6), q).T @ U)
    out = np.zeros((6, U.shape[1]))
    out[list(arm.task.rows)] = U
    return out


def turned_slopes(arm: Arm, J: Array, H: Array, Q: Array) -> Array:
    """Return derivatives (N, m, n, n) of task rows, from J (N, 6, n) and H (N, 6, n, n)."""
    # With dR/dq_j = [w_j] R the rows R^T v_i change by R^T (dv_i/dq_j - w_j x v_i).
    task = arm.task
    rows = list(task.rows)
    if not task.at_tip:
        return np.asarray(H[..., rows, :, :])
    back = np.swapaxes(tip_rotations(arm, Q), -1, -2)
    w = J[..., 3:, :]
    parts = (H[..., k : k + 3, :, :] - each_cross(w, J[..., k : k + 3, :]) for k in (0, 3))
    both = [np.einsum("...ab,...bij->...aij", back, carried) for carried in parts]
    turned = np.concatenate(both, axis=-3)[..., rows, :, :]
    return np.where(np.array(task.at_tip)[:, None, None], turned, H[..., rows, :, :])


def turn_left(task: Task, R: Array, goal: Array) -> Array:
    """Return rotation vectors (N, 3), base axes, from tips R (N, 3, 3) to a task's ``goal``."""
    # Where the turn about an axis of the tip is free: the shortest that brings this axis there.
    axis = task.tool_axis
    if axis is None or not task.at_tip:
        return rotation_vectors(np.broadcast_to(goal, R.shape) @ np.swapaxes(R, -1, -2))
    other = R[..., :, (axis + 1) % 3]  # any way out of half a turn will do
    return least_turns(R[..., :, axis], np.broadcast_to(goal, R.shape)[..., :, axis], other)


def least_turns(here: Array, there: Array, other: Array) -> Array:
    """Least rotation vectors (N, 3) between unit vectors (N, 3); half turns about ``other``."""
    across = np.cross(here, there)
    sine = np.linalg.norm(across, axis=-1)
    angle = np.arctan2(sine, (here * there).sum(axis=-1))
    out = across * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-300), 1.0)[..., None]
    half = (sine <= 1e-9) & (angle > 1)
    out[half] = math.pi * other[half]
    return np.asarray(out)


def rotation_vectors(R: Array) -> Array:
    """Rotation vectors (N, 3) of rotations (N, 3, 3), of half a turn too."""
    v = np.stack(
        [R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1
    )
    sine = np.linalg.norm(v, axis=1) / 2
    angle = np.arctan2(sine, (np.trace(R, axis1=1, axis2=2) - 1) / 2)
    factor = np.where(sine > 1e-9, angle / np.maximum(2 * sine, 1e-300), 0.5)
    out = v * factor[:, None]
    half = (sine <= 1e-9) & (angle > 1)
    if half.any():  # then the axis is each column of R + 1
        columns = R[half] + np.eye(3)
        axis = columns[np.arange(len(columns)), :, np.einsum("nii->ni", columns).argmax(axis=1)]
        out[half] = math.pi * axis / np.linalg.norm(axis, axis=1, keepdims=True)
    return np.asarray(out)


def each_cross(a: Array, b: Array) -> Array:
    """Products a_j x b_i (..., 3, n, n), entry [:, i, j], of columns of a and b (..., 3, n)."""
    ax, ay, az = (a[..., k, None, :] for k in range(3))
    bx, by, bz = (b[..., k, :, None] for k in range(3))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-3)


@kept
def _with_tip_axes(arm: Arm) -> Chain:
    chain = kernel_chain(arm)
    cycle = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # its z axis is the x axis before it
    steps = [chain.R[-1] @ cycle, cycle, cycle, np.eye(3)]
    return Chain(
        np.concatenate([chain.R[:-1], np.array(steps)]),
        np.concatenate([chain.t, np.zeros((3, 3))]),
        np.concatenate([chain.prismatic, np.ones(3, dtype=bool)]),
    )


_SAMPLES = 16


@dataclass(frozen=True, eq=False)
class OwnScale:
    """How a frame Jacobian of one arm is made free of units.

    ``length``: the greatest distance of the tip from an axis that it turns about, rounded to a
    power of ten, metres, by which units of length differ.
    """

    length: float
    rows: Array  # (m,), factors: 1 / length for translations, else 1
    columns: Array  # (n,), factors: length for prismatic joints, else 1
    of_sigma: float | None  # factor from sigma at the arm's length scale; None if there is none

    def apply(self, arm: Arm, J: Array, Q: Array, R: Array | None = None) -> Array:
        """Return task rows (..., m, n) without units of J (..., 6, n) at Q, R its rotation."""
        return np.asarray(task_rows(arm, J, Q, R) * self.rows[:, None] * self.columns)


@kept
def own_scale(arm: Arm) -> OwnScale:
    """The own scale of ``arm``, which its task rows and length scale leave as it is."""
    rng = np.random.default_rng(SEED)
    bounded = arm.prismatic & np.isfinite(arm.lower) & np.isfinite(arm.upper)
    half = np.where(arm.prismatic, 0.0, np.pi)
    low, high = np.where(bounded, arm.lower, -half), np.where(bounded, arm.upper, half)
    J = pinocchio_jacobians(arm, rng.uniform(low, high, (_SAMPLES, arm.n)))
    chain = flatten(arm)
    reach = float(np.linalg.norm(J[:, :3, ~chain.prismatic], axis=1).max(initial=0.0))
    length = 1.0  # if it turns about the tip alone: any length will do
    if reach > ROUNDING * float(np.abs(chain.t).max()):
        length = 10.0 ** round(math.log10(reach))
    translation = np.array(arm.task.rows) < 3
    rows = np.where(translation, 1.0 / length, 1.0)
    columns = np.where(arm.prismatic, length, 1.0)
    factors = rows / np.where(translation, 1.0 / arm.length_scale, 1.0)
    alike = (factors == factors[0]).all() and (columns == 1.0).all()
    return OwnScale(length, rows, columns, float(factors[0]) if alike else None)


def random_turns(arm: Arm, count: int, seed: int = SEED) -> Array:
    """Random configurations (count, n): whole circles, and as far as the arm is long."""
    reach = np.where(arm.prismatic, own_scale(arm).length, np.pi)
    return np.random.default_rng(seed).uniform(-1, 1, (count, arm.n)) * reach


@dataclass(frozen=True, eq=False)
class Batch:
    """One arm on one engine: ``pinocchio``, or an instruction set of the kernel."""

    arm: Arm
    engine: str
    threads: int | None = None  # of the kernel, by default all; results do not depend on it

    def model_jacobians(self, Q: Array) -> Array:
        """Frame Jacobians (N, 6, nv) by every velocity of the model, mimic joints on their own."""
        if (chain := self._chain()) is None:
            return pinocchio_jacobians(self.arm, Q)
        values = model_values(self.arm, Q)
        return kernel.jacobians(chain, values, threads=self.threads, isa=self.engine)

    def frame_jacobians(self, Q: Array) -> Array:
        """Frame Jacobians (N, 6, n) by the free joints."""
        J, coupling = self.model_jacobians(Q), self.arm.coupling
        return J if coupling is None else J @ coupling.matrix

    def sigma(self, Q: Array) -> Array:
        """Singular values (N, min(m, n)) of the task Jacobian at the arm's length scale."""
        return self._sigma(Q, False)

    def own_sigma(self, Q: Array, sigma: Array | None = None) -> Array:
        """The same at the arm's own scale, without units; out of ``sigma`` where that will do."""
        factor = own_scale(self.arm).of_sigma
        if factor is None:
            return self._sigma(Q, True)
        sigma = self.sigma(Q) if sigma is None else sigma
        return sigma if factor == 1.0 else sigma * factor

    def _sigma(self, Q: Array, own: bool) -> Array:
        arm, chain, scale = self.arm, self._chain(), own_scale(self.arm)
        if chain is None or arm.coupling is not None or arm.task.at_tip:
            at_tip, J = arm.task.at_tip, self.frame_jacobians(Q)
            R = tip_rotations(arm, Q, self.engine, self.threads) if at_tip else None
            J = scale.apply(arm, J, Q, R) if own else scale_rows(arm, J, Q, R)
            if chain is None:
                return np.asarray(np.linalg.svd(J, compute_uv=False))
            return kernel.svdvals(J, threads=self.threads, isa=self.engine)
        return kernel.singular_values(
            self.own_chain() if own else chain,
            Q / scale.columns if own else Q,
            rows=arm.task.rows,
            length_scale=1.0 if own else arm.length_scale,
            threads=self.threads,
            isa=self.engine,
        )

    def own_chain(self) -> Chain:
        """The kernel's chain of the arm as it is in its own length."""
        chain, length = kernel_chain(self.arm), own_scale(self.arm).length
        return self.arm.once("own_chain", lambda: Chain(chain.R, chain.t / length, chain.prismatic))

    def _chain(self) -> Chain | None:
        if self.engine == PINOCCHIO:
            return None
        chain, here = kernel_chain(self.arm), kernel.isa_names()
        EngineError.refuse_if(
            self.engine not in here,
            f"the run was planned for {self.engine}, but this machine runs "
            f"{', '.join(here)}; start it with an engine that all machines have",
        )
        return chain


def batch(arm: Arm, engine: str = "auto", threads: int | None = None) -> Batch:
    """Return a Batch with a `fixed_engine`; OptionError if ``threads`` is below 1."""
    OptionError.refuse_if(
        threads is not None and threads < 1, f"threads must be at least 1, got {threads}"
    )
    return Batch(arm, fixed_engine(arm, engine), threads)


def scale_rows(arm: Arm, J: Array, Q: Array, R: Array | None = None) -> Array:
    """Return task rows (..., m, n) of J (..., 6, n) at Q, translations over the length scale."""
    factor = np.where(np.array(arm.task.rows) < 3, 1.0 / arm.length_scale, 1.0)
    return np.asarray(task_rows(arm, J, Q, R) * factor[:, None])
