"""What a mechanism can do at a configuration: input-output relation, singularity type, mode.

Passive velocities are eliminated through the motions that the loops allow: with N a basis of the
null space of the constraint Jacobian, inputs move as S N and the output as J N (S picks the
actuated joints). After Gosselin and Angeles, "Singularity analysis of closed-loop kinematic
chains" (1990), and Zlatanov, Fenton and Benhabib (1995):

type 1
    J N loses rank: some motion leaves the output at rest, a direction of the output is lost;
type 2
    S N loses rank: the output moves while all actuators are held;
type 3
    both;
constraint singularity
    the constraint Jacobian itself loses rank: more motions than the mobility.

What is near one of them is judged with balls as balls: that three hinges which are written for one
lie in a plane (a gimbal lock) takes no freedom from the mechanism.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.errors import ConfigurationError
from pinsing.loops.closure import BatchLoops, Loops, ball_jacobians, hinge_rates, locked, ranks
from pinsing.loops.modes import mode_of
from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL
from pinsing.robot.mechanism import Mechanism
from pinsing.serialization import JsonResult


@dataclass(frozen=True, eq=False)
class Motions:
    """Motions that the loops allow, without units (lengths over the length scale).

    Attributes
    ----------
    basis : (n, d) array
        Orthonormal joint velocities; d is the mobility, more at a constraint singularity. Beside
        the gimbal lock of a ball what its hinges show of them (`whole_balls`).
    inputs : (n_a, d) array
        Their actuated part, S N.
    outputs : (m, d) array
        The output velocity, J N.
    constraint_ratio : float
        sigma_r / sigma_1 of the constraint Jacobian.
    input_ratio : float
        Smallest singular value of S N, in [0, 1]: sine of the angle between the motions and
        those that leave all actuators at rest. Zero at type 2.
    output_ratio : float
        Smallest generic singular value of J N over the largest of J. Zero at type 1.
    """

    basis: Array
    inputs: Array
    outputs: Array
    constraint_ratio: float
    input_ratio: float
    output_ratio: float

    def kind(self, rtol: float = SINGULAR_RTOL) -> str:
        """``regular``, ``type 1``, ``type 2``, ``type 3`` or ``constraint``."""
        return str(_kinds(self.output_ratio, self.input_ratio, self.constraint_ratio, rtol))


def _kinds(one: npt.ArrayLike, two: npt.ArrayLike, constraint: npt.ArrayLike, rtol: float) -> Any:
    """Kinds (...) by the measures (...) of type 1, type 2 and constraint singularities."""
    low = [np.asarray(x) <= rtol for x in (constraint, one, two)]
    names = ["constraint", "type 3", "type 1", "type 2"]
    return np.select([low[0], low[1] & low[2], low[1], low[2]], names, "regular")


def motions(mechanism: Mechanism, q: npt.ArrayLike, rtol: float = SINGULAR_RTOL) -> Motions:
    """Return the motions at a closed configuration q (n,), with the measures of singularity."""
    return _motions(Loops(mechanism), mechanism.check(q), rtol)


def _motions(loops: Loops, q: Array, rtol: float) -> Motions:
    mechanism = loops.mechanism
    found = _measured(mechanism, loops.scaled(q)[1], loops.output_scaled(q), rtol)
    least = min(found.constraint_ratio, found.input_ratio, found.output_ratio)
    batch = mechanism.once("ball_loops", lambda: BatchLoops(mechanism))
    if least > NEAR_RTOL or not locked(batch, q[None])[0]:
        return found
    G, J = ball_jacobians(batch, q[None])
    whole = _measured(mechanism, G[0], J[0], rtol)
    return replace(whole, basis=hinge_rates(batch, q, whole.basis))


def _measured(mechanism: Mechanism, G: Array, J: Array, rtol: float) -> Motions:
    """From the constraint Jacobian (k, n) and the output's (m, n), without units."""
    generic = ranks(mechanism)
    _, sigma, Vt = np.linalg.svd(G, full_matrices=True)
    r = generic.constraint
    ratio = float(sigma[r - 1] / sigma[0]) if sigma[0] > 0 else 0.0
    N = Vt[r if ratio > rtol else int((sigma > rtol * sigma[0]).sum()) :].T
    inputs = N[list(mechanism.actuated)]
    outputs = J @ N
    size = float(np.linalg.norm(J, 2))
    sigma_in = np.linalg.svd(inputs, compute_uv=False)
    sigma_out = np.linalg.svd(outputs, compute_uv=False)
    d = N.shape[1]
    return Motions(
        basis=N,
        inputs=inputs,
        outputs=outputs,
        constraint_ratio=ratio,
        input_ratio=float(sigma_in[d - 1]) if d <= len(sigma_in) else 0.0,
        output_ratio=float(sigma_out[generic.output - 1] / size) if size > 0 else 0.0,
    )


def input_output(mechanism: Mechanism, q: npt.ArrayLike) -> tuple[Array, Array]:
    """Return A, B of A x' = B q' without passive velocities; rows of [A, -B] are orthonormal.

    Returns
    -------
    A : (m, m_out) array
    B : (m, n_a) array
        A is singular at type 2, B at type 1; lengths are over the length scale.
    """
    found = motions(mechanism, q)
    relation = np.vstack([found.outputs, found.inputs])
    U, sigma, _ = np.linalg.svd(relation)
    rank = int((sigma > SINGULAR_RTOL * sigma[0]).sum())
    rows = U[:, rank:].T
    m = found.outputs.shape[0]
    return rows[:, :m], -rows[:, m:]


def leg_form(mechanism: Mechanism, q: npt.ArrayLike) -> tuple[Array, Array]:
    """Return A x' = B q' with one row per actuator: unit forces over diagonal moment arms.

    Row i is the unit force (wrench) at the output that only actuator i feels, and B[i, i] the
    torque it needs per unit of that force. For the planar 5R they are the forces along the
    distal links: paper Eq. (13) is this, each row times the length r2 of the distal link, with
    A the matrix that the paper calls mechanism Jacobian ``J_q`` and B the one that it calls
    configuration Jacobian ``J_x`` (up to sign).

    Returns
    -------
    A : (n_a, m) array
        Rows of unit length.
    B : (n_a, n_a) array
        Diagonal; both in metres and radians.

    Raises
    ------
    ConfigurationError
        At configurations where an actuator has no force of its own.
    """
    loops = Loops(mechanism)
    q = mechanism.check(q)
    found = _motions(loops, q, SINGULAR_RTOL)
    A, B = input_output(mechanism, q)
    A = A * loops.task_scale
    B = B / loops.column_scale[list(mechanism.actuated)]
    n_a = B.shape[1]
    rows, arms = np.zeros((n_a, A.shape[1])), np.zeros(n_a)
    for i in range(n_a):
        others = [j for j in range(n_a) if j != i]
        U, sigma, _ = np.linalg.svd(B[:, others]) if others else (np.eye(1), np.zeros(0), None)
        # The combination of rows that no other actuator feels.
        weight = U[:, len(others)]
        force = weight @ A
        size = float(np.linalg.norm(force))
        free = bool((sigma > SINGULAR_RTOL).all())
        if A.shape[0] != n_a or not free or size <= SINGULAR_RTOL:
            raise ConfigurationError(
                f"{mechanism.name}: {mechanism.inputs[i]} has no output force of its own here "
                f"(input ratio {found.input_ratio:.1e}, output ratio {found.output_ratio:.1e}): "
                "use input_output"
            )
        rows[i], arms[i] = force / size, weight @ B[:, i] / size
    return rows, np.diag(arms)


@dataclass(frozen=True, eq=False)
class MechanismState(JsonResult):
    """A mechanism at one configuration.

    Attributes
    ----------
    name : str
        Name of the mechanism.
    joints : tuple of str
        All joints.
    q : (n,) array
        Configuration, radians and metres.
    inputs : (n_a,) array
        Its actuated part.
    position : (3,) array
        Origin of the output frame, metres.
    closure : float
        Loop-closure error, over the length scale.
    kind : str
        ``regular``, ``type 1``, ``type 2``, ``type 3`` or ``constraint``.
    near : bool
        Whether a measure is below the near-singular threshold without being singular.
    mode : str
        Assembly and working mode.
    constraint_ratio, input_ratio, output_ratio : float
        Measures of the constraint, type 2 and type 1 singularities.
    velocity : (m, n_a) array or None
        Output velocity per unit input speed, metres and radians; None at type 2.
    lost : (m, k) array
        Output directions that no motion reaches (type 1); columns, without units.
    uncontrolled : (m, k) array
        Output velocities with all actuators at rest (type 2); columns, without units.
    """

    schema: ClassVar[str] = "pinsing/mechanism-state/1"

    name: str
    joints: tuple[str, ...]
    q: Array
    inputs: Array
    position: Array
    closure: float
    kind: str
    near: bool
    mode: str
    constraint_ratio: float
    input_ratio: float
    output_ratio: float
    velocity: Array | None
    lost: Array
    uncontrolled: Array

    def __str__(self) -> str:
        values = ", ".join(f"{n} {v:.6g}" for n, v in zip(self.joints, self.q, strict=True))
        what = self.kind + (" (near-singular)" if self.near else "")
        return (
            f"{self.name} at {values}: {what}; {self.mode}; "
            f"type 1 measure {self.output_ratio:.3g}, type 2 measure {self.input_ratio:.3g}, "
            f"constraint measure {self.constraint_ratio:.3g}"
        )


def mechanism_at(
    mechanism: Mechanism, q: npt.ArrayLike, rtol: float = SINGULAR_RTOL
) -> MechanismState:
    """State of a mechanism at a closed configuration q (n,).

    Raises
    ------
    ConfigurationError
        If q has the wrong length, or the loops do not close there.
    """
    q = mechanism.check(q)
    loops = Loops(mechanism)
    closure = float(np.abs(loops.scaled(q)[0]).max())
    if closure > 1e-6:  # over the length scale
        raise ConfigurationError(
            f"{mechanism.name}: the loops miss by {closure:.2g} at this configuration: "
            "close them first (solve)"
        )
    found = _motions(loops, q, rtol)
    generic = ranks(mechanism)
    U, sigma_out, _ = np.linalg.svd(found.outputs)
    size = float(np.linalg.norm(loops.output_scaled(q), 2))
    reached = int((sigma_out > rtol * size).sum())
    _, sigma_in, Vt = np.linalg.svd(found.inputs)
    controlled = int((sigma_in > rtol).sum())
    velocity = None
    if controlled == found.basis.shape[1]:
        scale = loops.task_scale[:, None] * loops.column_scale[list(mechanism.actuated)]
        velocity = found.outputs @ np.linalg.pinv(found.inputs) / scale
    kind = found.kind(rtol)
    measures = (found.constraint_ratio, found.input_ratio, found.output_ratio)
    return MechanismState(
        name=mechanism.name,
        joints=mechanism.joints,
        q=q,
        inputs=q[list(mechanism.actuated)],
        position=np.array(loops.output(q)[0].translation),
        closure=closure,
        kind=kind,
        near=kind == "regular" and min(measures) <= NEAR_RTOL,
        mode=mode_of(mechanism, q),
        constraint_ratio=found.constraint_ratio,
        input_ratio=found.input_ratio,
        output_ratio=found.output_ratio,
        velocity=velocity,
        lost=U[:, reached : generic.output],
        uncontrolled=found.outputs @ Vt[controlled:].T,
    )


@dataclass(frozen=True, eq=False)
class ManyMeasures:
    """Measures of N configurations, without units.

    Attributes
    ----------
    output_ratio, input_ratio, constraint_ratio : (N,) arrays
        Zero at type 1, type 2 and constraint singularities, as of `Motions`.
    """

    output_ratio: Array
    input_ratio: Array
    constraint_ratio: Array

    def kinds(self, rtol: float = SINGULAR_RTOL) -> npt.NDArray[np.str_]:
        """``regular``, ``near``, ``type 1``, ``type 2``, ``type 3`` or ``constraint``, each."""
        least = np.minimum(np.minimum(self.output_ratio, self.input_ratio), self.constraint_ratio)
        found = _kinds(self.output_ratio, self.input_ratio, self.constraint_ratio, rtol)
        return np.where((found == "regular") & (least <= NEAR_RTOL), "near", found)


def measure_many(loops: BatchLoops, Q: Array, rtol: float = SINGULAR_RTOL) -> ManyMeasures:
    """Measures at closed configurations Q (N, n)."""
    mechanism = loops.mechanism
    placed = loops.place(Q)
    J = loops.output(Q, placed)[2][:, list(mechanism.task.rows)]
    ratios = _ratios(mechanism, loops.closure(Q, placed=placed)[1], J)
    beside = ratios.min(axis=0) <= NEAR_RTOL
    beside[beside] = locked(loops, Q[beside])
    if beside.any():  # a ball that is locked as written turns as a ball does
        ratios[:, beside] = _ratios(mechanism, *ball_jacobians(loops, Q[beside]))
    lost = np.flatnonzero(ratios[2] <= rtol)
    if len(lost):
        for k in lost.tolist():  # more motions than the mobility; few are
            found = motions(mechanism, Q[k], rtol)
            ratios[:, k] = found.output_ratio, found.input_ratio, found.constraint_ratio
    return ManyMeasures(*ratios)


def _ratios(mechanism: Mechanism, G: Array, J: Array) -> Array:
    """Measures (3, N), in their order, from Jacobians of closure (N, k, n) and output (N, m, n)."""
    generic = ranks(mechanism)
    r = generic.constraint
    sigma, N = _motions_many(G, r)
    top = sigma[:, 0]
    inputs = N[:, list(mechanism.actuated)]
    size = np.sqrt(np.maximum(np.linalg.eigvalsh(J @ np.swapaxes(J, 1, 2))[:, -1], 0.0))
    moved = np.linalg.svd(J @ N, compute_uv=False)
    held = np.linalg.svd(inputs, compute_uv=False)
    d = N.shape[2]
    two = held[:, d - 1] if d <= held.shape[1] else np.zeros(len(G))
    with np.errstate(divide="ignore", invalid="ignore"):
        one = np.where(size > 0, moved[:, generic.output - 1] / size, 0.0)
        constraint = np.where(top > 0, sigma[:, r - 1] / top, 0.0)
    return np.array([one, two, constraint], dtype=float)


def _motions_many(G: Array, rank: int) -> tuple[Array, Array]:
    """Singular values of G (N, k, n), and a basis (N, n, n - rank) of what it sends to zero.

    Where as many rows as the rank are other than zero, those of the triangle of G' = Q R are those
    of G, and the last columns of Q are the basis: that takes two thirds of the time.
    """
    rows = np.flatnonzero(np.abs(G).max(axis=(0, 2)) > 1e-12)
    if len(rows) != rank:
        _, sigma, Vt = np.linalg.svd(G, full_matrices=True)
        return sigma, np.swapaxes(Vt[:, rank:], 1, 2)
    Q, R = np.linalg.qr(np.swapaxes(G[:, rows], 1, 2), mode="complete")
    return np.linalg.svd(R[:, :rank], compute_uv=False), Q[:, :, rank:]
