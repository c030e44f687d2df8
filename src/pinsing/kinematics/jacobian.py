"""Jacobians of an arm, their singular values, and the verdicts that stand on these.

Every Jacobian here is the frame Jacobian of the tip: (6, n), translation rows first,
LOCAL_WORLD_ALIGNED, in the axes of the arm's base, metres and radians. The *task*
Jacobian has the rows of the arm's task, translation rows divided by its length scale.

Batches are computed by the compiled kernel, or by Pinocchio's own loop, which is the authority:
before the kernel is used for an arm it is compared with ``pin.computeFrameJacobian`` at random
configurations, and refused if it differs.

Singular, near-singular or regular is decided here for everything that asks. The measure is sigma_r
/ sigma_1 of the task Jacobian at the arm's own scale (`OwnScale`), with r the generic rank. The
length scale changes sigma, and not the verdict. Where all of the task can vanish, sigma_1 counts as
no smaller than it commonly is.

How far around a configuration an arm is regular is proven from its Jacobian alone.
With the Jacobian J = U S V^T at q and h = S^(-1/2), J + D has the rank of J where
``|h U^T D V h| < 1``: ``h U^T (J + D) V h`` is then the identity and less, so regular. Along joint
steps d, ``D = sum d_k J_k + R`` with the derivatives J_k, which are Lie brackets of screws (Murray,
Li, Sastry, "A Mathematical Introduction to Robotic Manipulation", 1994, ch. 3), and a rest
``|R| <= K |d|^2 / 2``. Screws are written in the frame of a link in the middle of the chain, from
where fewer joints move each of them: K is small. The rank is the same in all frames.
It asks for no family and no design: a calibrated arm, or one whose families are not all known.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from pinsing._batch import engine as kernel
from pinsing._version import __version__
from pinsing.errors import ConfigurationError, EngineError, OptionError
from pinsing.interface import checked
from pinsing.measures import (
    ALIKE,
    NEAR_RTOL as NEAR_RTOL,
    NOISE,
    ROUNDING,
    SEED,
    SINGULAR_RTOL as SINGULAR_RTOL,
    Array,
    ArrayLike,
    Bool,
    Chain,
    Status as Status,
    sigma_ratio,
    status_of as status_of,
)
from pinsing.robot.arm import Arm, kept, model_q, model_values
from pinsing.robot.mimic import exact_generic_rank
from pinsing.robot.nominal import flatten, nominal
from pinsing.robot.task import Task

PINOCCHIO = "pinocchio"
ENGINES = ("auto", "batch", PINOCCHIO)
INSTRUCTION_SETS = ("baseline", "avx2", "avx512")


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


def pinocchio_jacobians(arm: Arm, Q: Array) -> Array:
    """Frame Jacobians (N, 6, nv) by every velocity of the model, mimic joints on their own."""
    model, tip = arm.model, arm.tip_id
    data = model.createData()  # a Data of its own: threads may share the arm
    frame, compute = pin.LOCAL_WORLD_ALIGNED, pin.computeFrameJacobian
    out = np.empty((len(Q), 6, model.nv))
    for i, q in enumerate(model_q(model, model_values(arm, Q))):
        # Pinocchio drops the second axis of a single column.
        out[i] = compute(model, data, q, tip, frame).reshape(6, model.nv)
    return out


@kept
def _chain_or_reason(arm: Arm) -> Chain | str:
    """The flat chain if the kernel agrees with Pinocchio on it, else why it may not be used."""
    if reason := kernel.unavailable_reason():
        return reason
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
        for i, q in enumerate(model_q(arm.model, model_values(arm, Q))):
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

    def own_sigma(self, Q: Array, sigma: Array | None = None) -> Array:
        """`sigma` at the arm's own scale, without units; out of ``sigma`` where that will do."""
        factor = own_scale(self.arm).of_sigma
        if factor is None:
            return self.sigma(Q, own=True)
        sigma = self.sigma(Q) if sigma is None else sigma
        return sigma if factor == 1.0 else sigma * factor

    def sigma(self, Q: Array, own: bool = False) -> Array:
        """Singular values (N, min(m, n)) of the task Jacobian at the arm's length or own scale."""
        arm, chain, scale = self.arm, self._chain(), own_scale(self.arm)
        if chain is None or arm.coupling is not None or arm.task.at_tip:
            at_tip, J = arm.task.at_tip, self.frame_jacobians(Q)
            R = tip_rotations(arm, Q, self.engine, self.threads) if at_tip else None
            J = scale_rows(arm, J, Q, R, own)
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


def scale_rows(arm: Arm, J: Array, Q: Array, R: Array | None = None, own: bool = False) -> Array:
    """Return task rows (..., m, n) of J (..., 6, n) at Q, translations over the length scale.

    Without units if at the ``own`` scale; R (..., 3, 3) is the tip's rotation where known.
    """
    rows = task_rows(arm, J, Q, R)
    if own:
        return np.asarray(rows * own_scale(arm).rows[:, None] * own_scale(arm).columns)
    factor = np.where(np.array(arm.task.rows) < 3, 1.0 / arm.length_scale, 1.0)
    return np.asarray(rows * factor[:, None])


class Measured(NamedTuple):
    """What is measured at N configurations."""

    sigma: Array  # (N, r), at the arm's length scale, largest first
    ratio: Array  # (N,), sigma_r / sigma_1 at its own scale: verdicts stand on it


@checked
@kept
def generic_rank(arm: Arm) -> int:
    """Return the rank of the task Jacobian at almost every configuration.

    Taken on the nominal geometry, exactly (`pinsing.robot.nominal`): no tolerance, no
    length scale. On the raw geometry a rounded angle could pretend a motion of relative size
    1e-6. Where it is not full, with mimic joints it is the greatest rank of random configurations
    at the own scale.

    Parameters
    ----------
    arm : Arm
        The arm, from ``load``.

    Returns
    -------
    int
        r; a configuration is singular where the rank is below it.

    Raises
    ------
    OptionError
        If it is zero: no joint moves the tip in any row of the task.

    Examples
    --------
    >>> import pinsing
    >>> pinsing.kinematics.generic_rank(pinsing.load("planar3r"))
    3
    """
    geometry = nominal(arm)
    if geometry.arm is not arm:
        return generic_rank(geometry.arm)
    # Floats alone prove that the rank is as great as the size of J allows: rounding moves no
    # singular value by more than about 1e-14 sigma_1 of all six rows (Weyl's inequality), which is
    # about one at the arm's own scale: the task's rows may be nothing but rounding. So where the
    # last one is 1e-6 of that, and of the task's sigma_1, at a single configuration, J has full
    # rank there, and thereby at almost every one.
    sigma = Batch(arm, PINOCCHIO).own_sigma(random_turns(arm, 6))
    if (sigma[:, -1] > ALIKE * np.maximum(sigma[:, 0], 1.0)).any():
        rank = min(len(arm.task.rows), arm.n)
    elif arm.coupling is not None:
        rank = int((sigma > SINGULAR_RTOL * np.maximum(sigma[:, :1], 1.0)).sum(axis=1).max())
    else:
        rank = exact_generic_rank(geometry, arm.task)
    OptionError.refuse_if(
        rank == 0,
        f"task {arm.task}: no joint of {arm.name} moves tip {arm.tip!r} in any of its "
        "rows; choose other rows",
    )
    return rank


@kept
def task_size(arm: Arm) -> float:
    """Return the median of sigma_1 at the arm's own scale; 0 for ``pose``, which never vanishes."""
    if arm.task.name == "pose":
        return 0.0
    found = Batch(arm, PINOCCHIO).own_sigma(random_turns(arm, 15))
    return float(np.median(found[:, 0]))


def ratio_of(arm: Arm, own_sigma: ArrayLike) -> Array:
    """Measure of verdicts (...,) from singular values (..., k >= r) at the arm's own scale."""
    return sigma_ratio(own_sigma, generic_rank(arm), task_size(arm))


def rank_of(arm: Arm, own_sigma: Array, rtol: float = SINGULAR_RTOL) -> int:
    """Return the number of singular values (k,) above ``rtol``, at the arm's own scale."""
    return int((own_sigma > zero_of(arm, own_sigma, rtol)).sum())


def zero_of(arm: Arm, own_sigma: Array, rtol: float = SINGULAR_RTOL) -> float:
    """Up to what a singular value is zero, beside ``own_sigma`` (k,) of the whole Jacobian."""
    return rtol * max(float(own_sigma[0]), task_size(arm))


def own_shares(arm: Arm, Q: ArrayLike) -> Array:
    """sigma_k / sigma_1 for k = 1 ... r at the arm's own scale, (N, r); the last are the ratios."""
    own = batch(arm).own_sigma(np.atleast_2d(arm.check(Q)))
    count = range(1, generic_rank(arm) + 1)
    size = task_size(arm)
    return np.stack([sigma_ratio(own, k, size) for k in count], axis=1)


def measured(on: Batch, Q: Array) -> Measured:
    """Singular values and ratios at Q (N, n), on an engine that is fixed."""
    sigma = on.sigma(Q)
    ratio = ratio_of(on.arm, on.own_sigma(Q, sigma))
    return Measured(np.asarray(sigma[:, : generic_rank(on.arm)]), ratio)


def measure(arm: Arm, Q: ArrayLike, engine: str = "auto") -> Measured:
    """Singular values and ratios at Q (N, n), radians and metres."""
    return measured(batch(arm, engine), np.atleast_2d(arm.check(Q)))


def ratios(arm: Arm, Q: Array, engine: str = "auto") -> Array:
    """Measure of verdicts (N,) at Q (N, n) or (n,), radians and metres, however many turns away."""
    Q = np.atleast_2d(arm.space.fold(Q))
    return ratio_of(arm, batch(arm, engine).own_sigma(Q)) if len(Q) else np.zeros(0)


def scale_notes(arm: Arm) -> Iterator[str]:
    """Say where sigma and verdicts stand on different lengths."""
    scale = own_scale(arm)
    if scale.of_sigma is None:
        yield (
            "sigma_r/sigma_1, which singular and near-singular are judged by, is taken at the "
            f"arm's own length of {scale.length:g} m, sigma at length scale {arm.length_scale:g} m"
        )


def fixed_batch(arm: Arm, engine: str = "auto") -> Batch:
    """Return a Batch on this thread alone, on a `fixed_engine`, without what only drawing needs."""
    source = replace(
        arm.source,
        path=None,
        shapes=None,
        full_model=arm.model,
        locked=(),
        reference=pin.neutral(arm.model),
        base="universe",
    )
    lean = replace(arm, source=source, notes=())
    lean.known.update(arm.known)  # of the same numbers
    return Batch(lean, fixed_engine(arm, engine), 1)


def fingerprint(arm: Arm) -> str:
    """SHA-256 of every number of the arm that its singular values depend on."""
    chain = flatten(arm)
    parts = [chain.R, chain.t, chain.prismatic, np.array(arm.task.rows), arm.length_scale]
    if arm.task.at_tip:
        parts.append(np.array(arm.task.at_tip))
    if arm.coupling is not None:
        parts += [arm.coupling.matrix, arm.coupling.offset]
    digest = hashlib.sha256()
    for part in parts:
        array = np.ascontiguousarray(part, dtype=np.float64)
        digest.update(f"{array.shape};".encode() + array.tobytes())
    return digest.hexdigest()


def run_identity(kind: str, on: Batch) -> dict[str, Any]:
    """Return what a folder records of how a run computes, as plain JSON values."""
    return {
        "kind": kind,
        "pinsing": __version__,
        "engine": on.engine,
        "robot": fingerprint(on.arm),
        "rank": generic_rank(on.arm),
    }


ROWS = 2000
"""Configurations at a time: their brackets take some megabytes."""


@checked
def regular_radius(arm: Arm, Q: ArrayLike) -> Array:
    """Return how far around configurations no other one is singular, proven.

    Of the geometry of the file, whatever is known of its singular configurations. The true
    distance is larger: in the median 1.03 to 2.6 times within 3 degrees of a family, 2 to 6 times
    elsewhere.

    Parameters
    ----------
    arm : Arm
        A serial arm without mimic joints; its task is the full pose, position or orientation.
    Q : (..., n) or (..., nq) array_like
        Radians and metres.

    Returns
    -------
    (...) array
        Euclidean length of joint differences, radians, or metres over the length scale; 0 where
        nothing is known, and for other arms and tasks.

    Raises
    ------
    ConfigurationError
        If Q has the wrong shape, or a value that is not finite.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("ur5")
    >>> radius = pinsing.kinematics.regular_radius(arm, [0, -1.2, 1.3, -1, -1.5, 0])
    >>> bool(0.1 < radius < pinsing.clearance(arm, [0, -1.2, 1.3, -1, -1.5, 0]).upper)
    True
    """
    array = arm.check(Q, "Q")
    flat, found = array.reshape(-1, arm.n), np.zeros(array.shape[:-1]).reshape(-1)
    if (frame := arm.once("frame of a ball", lambda: _Frame.of(arm))) is not None:
        for first in range(0, len(flat), ROWS):
            part = slice(first, first + ROWS)
            found[part] = frame.radius(flat[part])
    return found.reshape(array.shape[:-1])


@dataclass(frozen=True, eq=False)
class _Frame:
    """A link in whose frame screws are written, translations first."""

    chain: Chain
    link: int  # screws refer to the origin of this joint from 0, or the tip, before it moves
    metre: float  # units of length in a metre: lengths count like angles
    slide: float  # factor of steps of a sliding joint
    rows: slice
    moves: Array  # (n, n), [k, j]: 1 where k moves screw j away from the base, -1 towards it

    @classmethod
    def of(cls, arm: Arm) -> _Frame | None:
        """The frame in which bends are least; None where nothing is known of the arm."""
        parts = {(0, 1, 2, 3, 4, 5): slice(0, 6), (0, 1, 2): slice(0, 3), (3, 4, 5): slice(3, 6)}
        rows = parts.get(tuple(arm.task.rows))
        if rows is None or arm.coupling is not None:
            return None
        chain, n = flatten(arm), arm.n
        size = float(np.linalg.norm(chain.t[1:], axis=1).sum())
        k, j = np.indices((n, n))
        frames = []
        for link in range(n + 1) if rows.stop == 6 else [n]:  # positions are those of the tip
            moves = np.where((link <= k) & (k < j), 1.0, 0.0) - ((j < k) & (k < link))
            metre = 4 / size if size else 1.0
            frames.append(cls(chain, link, metre, arm.length_scale, rows, moves))
        return min(frames, key=lambda f: float(f.bend(np.zeros((1, n)))[0]))

    def bend(self, Q: Array) -> Array:
        """Bound (N,) second derivatives of the Jacobian along unit steps, at Q and within 1.

        A vector that turns with f joints has second derivatives of at most ``f |d|^2``, for the sum
        of f parts of a unit step is at most the root of f. The steps of the two sides of the link
        share ``|d|^2``.
        """
        chain, n = self.chain, self.chain.n
        slides = chain.prismatic
        between = np.abs(self.moves) > 0
        turning, sliding = between[~slides].sum(axis=0), between[slides].sum(axis=0)
        steps = np.linalg.norm(chain.t, axis=1)[None, 1:] + np.where(
            slides, np.abs(Q) + self.slide, 0.0
        )
        reach = np.concatenate([np.zeros((len(Q), 1)), np.cumsum(steps, axis=1)], axis=1)
        far = np.abs(reach[:, :n] - reach[:, self.link : self.link + 1])
        arm = turning * far + 2 * np.sqrt(turning * sliding) * self.slide
        moment = self.metre * np.where(slides, turning * self.slide, arm)
        turn = np.where(slides, 0, turning)
        parts = [moment] * (self.rows.start == 0) + [turn] * (self.rows.stop == 6)
        square = np.sum([p**2 + np.zeros((len(Q), n)) for p in parts], axis=0)
        sides = square[:, : self.link].sum(axis=1), square[:, self.link :].sum(axis=1)
        return np.asarray(np.sqrt(np.maximum(*sides)))

    def screws(self, Q: Array) -> tuple[Array, Array]:
        """Translations and rotations (N, n, 3) of unit steps, in the axes of the base."""
        R, p = joint_frames(self.chain, Q)
        a, slides = R[:, :-1, :, 2], self.chain.prismatic[:, None]
        off = p[:, :-1] - p[:, self.link, None]
        v = np.where(slides, self.slide * a, np.cross(off, a))
        return self.metre * v, np.where(slides, 0.0, a)

    def radius(self, Q: Array) -> Array:
        """How far (N,) around Q (N, n) the rank is that of Q."""
        v, w = self.screws(Q)
        J = np.concatenate([v, w], axis=2)[..., self.rows]
        V, S, Ut = np.linalg.svd(J, full_matrices=False)
        sound: Bool = S[:, -1] > SINGULAR_RTOL * S[:, 0]
        h = 1 / np.sqrt(np.maximum(S, np.where(sound, 0.0, 1.0)[:, None]))
        # Screws of joint j as joint k moves them, [k, j]; the rotation of a screw carries both.
        turned = [np.cross(w[:, :, None], x[:, None]) for x in (v, w)]
        turned[0] += np.cross(v[:, :, None], w[:, None])
        D = (self.moves[..., None] * np.concatenate(turned, axis=3))[..., self.rows]
        right, left = h[:, :, None] * Ut, V * h[:, None]
        G = np.swapaxes(left, 1, 2)[:, None] @ D @ np.swapaxes(right, 1, 2)[:, None]
        beside = np.einsum("nkij,nkil->njl", G, G), np.einsum("nkij,nklj->nil", G, G)
        most = np.minimum(*(np.linalg.eigvalsh(M)[:, -1] for M in beside))
        g, K = np.sqrt(np.maximum(most, 0.0)), self.bend(Q) * h[:, -1] ** 2
        reach = 2 / (g + np.sqrt(g**2 + 2 * K) + 1e-9)
        # Entries are right to some hundred units in the last place of the largest singular value.
        off = 1e-9 + 1e-13 * S[:, 0] * h[:, -1] ** 2
        return np.where(sound, np.minimum(reach * (1 - off), 1.0), 0.0)


@checked
def tip_placement(arm: Arm, q: ArrayLike) -> pin.SE3:
    """Placement of the tip in the base at q (n,)."""
    data = arm.model.createData()
    pin.forwardKinematics(arm.model, data, arm.model_q(arm.check_one(q)))
    return pin.SE3(pin.updateFramePlacement(arm.model, data, arm.tip_id))


def tip_and_jacobian(arm: Arm, q: Array) -> tuple[Array, Array, Array]:
    """Return position (3,), rotation (3, 3) and `frame_jacobian` of a checked q (n,), in one go."""
    model, tip = arm.model, arm.tip_id
    data = model.createData()
    at = model_q(model, model_values(arm, q))
    found = pin.computeFrameJacobian(model, data, at, tip, pin.LOCAL_WORLD_ALIGNED)
    J = np.array(found).reshape(6, model.nv)  # Pinocchio drops the second axis of a single column
    place = pin.updateFramePlacement(model, data, tip)
    J = J if arm.coupling is None else J @ arm.coupling.matrix
    return np.array(place.translation), np.array(place.rotation), J


def tip_poses(arm: Arm, Q: Array) -> tuple[Array, Array]:
    """Positions (N, 3), metres, and rotations (N, 3, 3) of the tip in the base at Q (N, n)."""
    rotations, origins = joint_frames(flatten(arm), model_values(arm, Q))
    return origins[:, -1], rotations[:, -1]


@checked
def frame_jacobian(arm: Arm, q: ArrayLike) -> Array:
    """Return the frame Jacobian of the tip at one configuration.

    Parameters
    ----------
    arm : Arm
        The arm, from ``load``.
    q : (n,) or (nq,) array_like
        Radians or metres.

    Returns
    -------
    (6, n) array
        Rows vx, vy, vz (m/s), wx, wy, wz (rad/s) per unit joint speed, base axes
        (``pin.computeFrameJacobian``, LOCAL_WORLD_ALIGNED).

    Raises
    ------
    ConfigurationError
        If q has the wrong length or is not finite.

    Examples
    --------
    >>> import pinsing
    >>> J = pinsing.frame_jacobian(pinsing.load("planar3r"), [0, 0.5, 1])
    >>> J[[0, 1, 5]].round(3)  # vx, vy, wz
    array([[-0.343, -0.343, -0.199],
           [ 0.677,  0.277,  0.014],
           [ 1.   ,  1.   ,  1.   ]])
    """
    return np.asarray(Batch(arm, PINOCCHIO).frame_jacobians(arm.check_one(q)[None])[0])


@checked
def frame_jacobians(
    arm: Arm, Q: ArrayLike, *, engine: str = "auto", threads: int | None = None
) -> Array:
    """Return the frame Jacobians of the tip at many configurations.

    Parameters
    ----------
    arm : Arm
        The arm, from ``load``.
    Q : (N, n) or (N, nq) array_like
        Radians or metres; or (N, nq), the whole model's configurations.
    engine : str
        "auto", "batch" (the compiled kernel), "pinocchio" or an instruction set; see
        `fixed_engine`.
    threads : int, optional
        Threads of the compiled kernel; as many as the process may use by default. The
        result does not depend on it.

    Returns
    -------
    (N, 6, n) array
        As ``frame_jacobian``.

    Raises
    ------
    ConfigurationError
        If Q is not of that shape or not finite.
    EngineError
        If the engine asked for is not there, or disagrees with Pinocchio.

    Examples
    --------
    >>> import numpy as np, pinsing
    >>> Q = np.random.default_rng(0).uniform(-1, 1, (1000, 6))
    >>> pinsing.kinematics.frame_jacobians(pinsing.load("ur5"), Q).shape
    (1000, 6, 6)
    """
    return batch(arm, engine, threads).frame_jacobians(arm.check_many(Q, "Q", own=False))


@checked
def task_jacobian(arm: Arm, q: ArrayLike) -> Array:
    """Return the task Jacobian at one configuration: the rows of the task, translation rows scaled.

    Parameters
    ----------
    arm : Arm
        The arm, from ``load``.
    q : (n,) or (nq,) array_like
        Radians or metres; or (nq,), the whole model's configuration.

    Returns
    -------
    (m, n) array
        The m rows of ``arm.task`` out of ``frame_jacobian``, those with ``@tip`` in the tip's
        axes; rows vx, vy, vz divided by ``arm.length_scale``.

    Raises
    ------
    ConfigurationError
        If q has the wrong length or is not finite.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("planar3r", task="vx,vy")
    >>> pinsing.kinematics.task_jacobian(arm, [0, 0.5, 1]).round(3)
    array([[-0.343, -0.343, -0.199],
           [ 0.677,  0.277,  0.014]])
    """
    q = arm.check_one(q)
    return scale_rows(arm, frame_jacobian(arm, q), q)


@checked
def task_jacobians(
    arm: Arm, Q: ArrayLike, *, engine: str = "auto", threads: int | None = None
) -> Array:
    """Return the task Jacobians at many configurations.

    Parameters
    ----------
    arm, Q, engine, threads
        As in ``frame_jacobians``.

    Returns
    -------
    (N, m, n) array
        As ``task_jacobian``.

    Raises
    ------
    ConfigurationError, EngineError
        As ``frame_jacobians``.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("planar3r", task="vx,vy")
    >>> pinsing.kinematics.task_jacobians(arm, [[0, 0.5, 1], [0, 0.1, 1]]).shape
    (2, 2, 3)
    """
    Q = arm.check_many(Q, "Q", own=False)
    return scale_rows(arm, frame_jacobians(arm, Q, engine=engine, threads=threads), Q)


@checked
def singular_values(
    arm: Arm, Q: ArrayLike, *, engine: str = "auto", threads: int | None = None
) -> Array:
    """Return the singular values of the task Jacobian at many configurations, largest first.

    Parameters
    ----------
    arm, Q, engine, threads
        As in ``frame_jacobians``.

    Returns
    -------
    (N, r) array
        r is the generic rank: the last column is the measure sigma_r that vanishes at singular
        configurations (sigma_min in the paper).

    Raises
    ------
    ConfigurationError, EngineError
        As ``frame_jacobians``.
    OptionError
        If no joint moves the tip in any row of the task.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("planar3r")
    >>> pinsing.singular_values(arm, [[0, 0, 1], [0, 1, 1]])[:, -1].round(3)
    array([0.   , 0.128])
    """
    sigma = batch(arm, engine, threads).sigma(arm.check_many(Q, "Q", own=False))
    return np.asarray(sigma[:, : generic_rank(arm)])


def jacobian_derivative(J: ArrayLike) -> Array:
    """Return derivatives (..., 6, n, n), [row, i, j] by q_j, of frame Jacobians (..., 6, n).

    With columns (v_i, w_i) of a serial chain, base to tip, LOCAL_WORLD_ALIGNED, for j <= i: d v_i /
    d q_j = w_j x v_i and d w_i / d q_j = w_j x w_i; for j > i: d v_i / d q_j = w_i x v_j and d w_i
    / d q_j = 0 (Bruyninckx and De Schutter, "Symbolic differentiation of the velocity mapping for a
    serial kinematic chain", 1996). The same as Pinocchio's frame kinematic Hessian.
    """
    J = np.asarray(J, dtype=float)
    n = J.shape[-1]
    v, w = J[..., :3, :], J[..., 3:, :]
    later = np.arange(n)[:, None] >= np.arange(n)[None, :]  # [i, j]: j <= i
    moved = each_cross(w, v)  # [i, j]: w_j x v_i
    dv = np.where(later, moved, np.swapaxes(moved, -1, -2))
    return np.concatenate([dv, np.where(later, each_cross(w, w), 0.0)], axis=-3)


def own_jacobians_and_derivatives(on: Batch, Q: Array) -> tuple[Array, Array]:
    """Return task Jacobians (N, m, n) and derivatives (N, m, n, n) at Q, at `OwnScale`."""
    arm, J = on.arm, on.model_jacobians(Q)
    scale = own_scale(arm)
    H = jacobian_derivative(J)
    if arm.coupling is not None:
        matrix = arm.coupling.matrix
        J = J @ matrix
        H = np.einsum("...rij,ia,jb->...rab", H, matrix, matrix)
    rows, at_tip = list(arm.task.rows), arm.task.at_tip
    slopes = H[:, rows]
    if at_tip:
        # With dR/dq_j = [w_j] R the rows R^T v_i change by R^T (dv_i/dq_j - w_j x v_i).
        back = np.swapaxes(tip_rotations(arm, Q, on.engine, on.threads), 1, 2)
        parts = (H[:, k : k + 3] - each_cross(J[:, 3:], J[:, k : k + 3]) for k in (0, 3))
        both = [np.einsum("...ab,...bij->...aij", back, carried) for carried in parts]
        turned = np.concatenate(both, axis=1)[:, rows]
        slopes = np.where(np.array(at_tip)[:, None, None], turned, slopes)
    slopes = slopes * scale.rows[:, None, None]
    return scale_rows(arm, J, Q, own=True), slopes * scale.columns[:, None] * scale.columns


@dataclass(frozen=True, eq=False)
class GenericTask:
    """What an arm does in its task at almost every configuration, on the nominal geometry."""

    J: Array  # (k, m, n), without units, at random configurations
    moving: tuple[int, ...]  # joints (indices) that move the task at some configuration
    never: Array  # (m, d), orthonormal directions that are produced at no configuration


@kept
def generic_task(arm: Arm) -> GenericTask:
    """Return the task of an arm in general."""
    exact = nominal(arm).arm
    Q = random_turns(exact, 6)
    J = scale_rows(exact, Batch(exact, PINOCCHIO).frame_jacobians(Q), Q, own=True)
    general = np.linalg.norm(J, axis=1).max(axis=0)
    moving = np.flatnonzero(general > SINGULAR_RTOL * general.max()).tolist()
    U, sigma, _ = np.linalg.svd(np.concatenate(list(J), axis=1))
    return GenericTask(J, tuple(moving), U[:, int((sigma > SINGULAR_RTOL * sigma[0]).sum()) :])


def read_pose(pose: ArrayLike) -> tuple[Array, Array | None]:
    """Return position (3,), and rotation (3, 3) if given; ConfigurationError if it is no pose."""
    given = np.array(pose, dtype=float)
    ConfigurationError.refuse_if(
        not np.isfinite(given).all(), "the pose has a value that is not finite"
    )
    # squares of positions have to be floats
    ConfigurationError.refuse_if(
        (np.abs(given) > 1e9).any(),
        "the pose has a value beyond 1e+09 (metres, radians), which no arm reaches",
    )
    if given.shape == (3,):
        return given, None
    if given.shape == (6,):
        return given[:3], np.array(pin.rpy.rpyToMatrix(*given[3:]))
    if given.shape == (4, 4):
        R = given[:3, :3]
        proper = np.abs(R @ R.T - np.eye(3)).max() < 1e-6 and np.linalg.det(R) > 0
        if proper and np.allclose(given[3], [0, 0, 0, 1]):
            u, _, v = np.linalg.svd(R)
            return given[:3, 3], u @ v
        raise ConfigurationError("the 4 x 4 matrix is not a rotation and a translation")
    raise ConfigurationError(
        "one pose is 3 numbers (x, y, z), 6 (and roll, pitch, yaw) or a 4 x 4 matrix; "
        f"got shape {given.shape}"
        + ": for x, y, z and a quaternion give pin.XYZQUATToSE3(pose)"
        * (given.shape == (7,))
    )
