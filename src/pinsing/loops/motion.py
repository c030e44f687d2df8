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

The pose of the output is a position and a unit quaternion; people type it, and read it in tables.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from pinsing._types import Array, ArrayLike, NDArray
from pinsing.arguments import real_numbers
from pinsing.errors import ConfigurationError
from pinsing.kinematics.jacobian import read_pose as arm_pose
from pinsing.loops.closure import (
    BatchLoops,
    Loops,
    ball_jacobians,
    hinge_rates,
    locked,
    random_closed,
    ranks,
)
from pinsing.loops.modes import home, mode_of
from pinsing.loops.structure import output_pose
from pinsing.measures import ALIKE, NEAR_RTOL, ROUNDING, SINGULAR_RTOL
from pinsing.prose import Page, Table
from pinsing.robot.mechanism import Mechanism
from pinsing.robot.task import ROW_NAMES
from pinsing.serialization import JsonResult


@dataclass(frozen=True, eq=False)
class Motions:
    """Motions that the loops allow, without units (lengths over the length scale)."""

    # (n, d): orthonormal joint velocities; d is the mobility, more at a constraint singularity.
    # Beside the gimbal lock of a ball what its hinges show of them (`whole_balls`)
    basis: Array
    inputs: Array  # (n_a, d): their actuated part, S N
    outputs: Array  # (m, d): the output velocity, J N
    constraint_ratio: float  # sigma_r / sigma_1 of the constraint Jacobian
    # smallest singular value of S N, in [0, 1]: sine of the angle between the motions and those
    # that leave all actuators at rest. Zero at type 2
    input_ratio: float
    # smallest generic singular value of J N over the largest of J. Zero at type 1
    output_ratio: float

    def kind(self, rtol: float = SINGULAR_RTOL) -> str:
        """``regular``, ``type 1``, ``type 2``, ``type 3`` or ``constraint``."""
        return str(_kinds(np.array(self.ratios), rtol))

    @property
    def ratios(self) -> tuple[float, float, float]:
        """Measures of type 1, type 2 and constraint singularities."""
        return self.output_ratio, self.input_ratio, self.constraint_ratio


def _kinds(ratios: Array, rtol: float) -> Any:
    """Kinds (...) by the measures (3, ...) of type 1, type 2 and constraint singularities."""
    one, two, constraint = ratios <= rtol
    names = ["constraint", "type 3", "type 1", "type 2"]
    return np.select([constraint, one & two, one, two], names, "regular")


def motions(mechanism: Mechanism, q: ArrayLike, rtol: float = SINGULAR_RTOL) -> Motions:
    """Return the motions at a closed configuration q (n,), with the measures of singularity."""
    return _motions(Loops(mechanism), mechanism.check(q), rtol)


def _motions(loops: Loops, q: Array, rtol: float) -> Motions:
    mechanism = loops.mechanism
    found = _measured(mechanism, loops.scaled(q)[1], loops.output_scaled(q), rtol)
    batch = mechanism.once("ball_loops", lambda: BatchLoops(mechanism))
    if min(found.ratios) > NEAR_RTOL or not locked(batch, q[None])[0]:
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


def input_output(mechanism: Mechanism, q: ArrayLike) -> tuple[Array, Array]:
    """Return A, B of A x' = B q' without passive velocities; rows of [A, -B] are orthonormal.

    Returns
    -------
    A : (m, m_out) array
    B : (m, n_a) array
        A is singular at type 2, B at type 1; lengths are over the length scale.
    """
    found = motions(mechanism, q)
    U, sigma, _ = np.linalg.svd(np.vstack([found.outputs, found.inputs]))
    rows = U[:, int((sigma > SINGULAR_RTOL * sigma[0]).sum()) :].T
    m = found.outputs.shape[0]
    return rows[:, :m], -rows[:, m:]


def leg_form(mechanism: Mechanism, q: ArrayLike) -> tuple[Array, Array]:
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
        ConfigurationError.refuse_if(
            A.shape[0] != n_a or not free or size <= SINGULAR_RTOL,
            f"{mechanism.name}: {mechanism.inputs[i]} has no output force of its own here "
            f"(input ratio {found.input_ratio:.1e}, output ratio {found.output_ratio:.1e}): "
            "use input_output",
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


def mechanism_at(mechanism: Mechanism, q: ArrayLike, rtol: float = SINGULAR_RTOL) -> MechanismState:
    """State of a mechanism at a closed configuration q (n,).

    Raises
    ------
    ConfigurationError
        If q has the wrong length, or the loops do not close there.
    """
    q = mechanism.check(q)
    loops = Loops(mechanism)
    closure = float(np.abs(loops.scaled(q)[0]).max())
    # over the length scale
    ConfigurationError.refuse_if(
        closure > 1e-6,
        f"{mechanism.name}: the loops miss by {closure:.2g} at this configuration: "
        "close them first (solve)",
    )
    found = _motions(loops, q, rtol)
    generic = ranks(mechanism)
    U, sigma_out, _ = np.linalg.svd(found.outputs)
    reached = int((sigma_out > rtol * float(np.linalg.norm(loops.output_scaled(q), 2))).sum())
    _, sigma_in, Vt = np.linalg.svd(found.inputs)
    controlled = int((sigma_in > rtol).sum())
    velocity = None
    if controlled == found.basis.shape[1]:
        scale = loops.task_scale[:, None] * loops.column_scale[list(mechanism.actuated)]
        velocity = found.outputs @ np.linalg.pinv(found.inputs) / scale
    kind = found.kind(rtol)
    return MechanismState(
        name=mechanism.name,
        joints=mechanism.joints,
        q=q,
        inputs=q[list(mechanism.actuated)],
        position=np.array(loops.output(q)[0].translation),
        closure=closure,
        kind=kind,
        near=kind == "regular" and min(found.ratios) <= NEAR_RTOL,
        mode=mode_of(mechanism, q),
        constraint_ratio=found.constraint_ratio,
        input_ratio=found.input_ratio,
        output_ratio=found.output_ratio,
        velocity=velocity,
        lost=U[:, reached : generic.output],
        uncontrolled=found.outputs @ Vt[controlled:].T,
    )


def kinds_of(ratios: Array) -> NDArray[np.str_]:
    """Kinds (N,) by measures (3, N): those of `Motions.kind`, and ``near``."""
    found = _kinds(ratios, SINGULAR_RTOL)
    return np.where((found == "regular") & (ratios.min(axis=0) <= NEAR_RTOL), "near", found)


def measure_many(loops: BatchLoops, Q: Array, rtol: float = SINGULAR_RTOL) -> Array:
    """Return measures (3, N) at closed configurations Q (N, n): type 1, type 2, constraint."""
    mechanism = loops.mechanism
    placed = loops.place(Q)
    J = loops.output(Q, placed)[2][:, list(mechanism.task.rows)]
    ratios = _ratios(mechanism, loops.closure(Q, placed=placed)[1], J)
    beside = ratios.min(axis=0) <= NEAR_RTOL
    beside[beside] = locked(loops, Q[beside])
    if beside.any():  # a ball that is locked as written turns as a ball does
        ratios[:, beside] = _ratios(mechanism, *ball_jacobians(loops, Q[beside]))
    for k in np.flatnonzero(ratios[2] <= rtol).tolist():  # more motions than the mobility; few are
        ratios[:, k] = motions(mechanism, Q[k], rtol).ratios
    return ratios


def _ratios(mechanism: Mechanism, G: Array, J: Array) -> Array:
    """Measures (3, N), in their order, from Jacobians of closure (N, k, n) and output (N, m, n)."""
    generic = ranks(mechanism)
    r = generic.constraint
    # Where as many rows as the rank are not zero, G' = Q R has both singular values and kernel in
    # two thirds of the time: the values of R, the last columns of Q.
    rows = np.flatnonzero(np.abs(G).max(axis=(0, 2)) > 1e-12)
    if len(rows) == r:
        Q, R = np.linalg.qr(np.swapaxes(G[:, rows], 1, 2), mode="complete")
        sigma, N = np.linalg.svd(R[:, :r], compute_uv=False), Q[:, :, r:]
    else:
        _, sigma, Vt = np.linalg.svd(G, full_matrices=True)
        N = np.swapaxes(Vt[:, r:], 1, 2)
    top, d = sigma[:, 0], N.shape[2]
    size = np.sqrt(np.maximum(np.linalg.eigvalsh(J @ np.swapaxes(J, 1, 2))[:, -1], 0.0))
    moved = np.linalg.svd(J @ N, compute_uv=False)
    held = np.linalg.svd(N[:, list(mechanism.actuated)], compute_uv=False)
    two = held[:, d - 1] if d <= held.shape[1] else np.zeros(len(G))
    with np.errstate(divide="ignore", invalid="ignore"):
        one = np.where(size > 0, moved[:, generic.output - 1] / size, 0.0)
        constraint = np.where(top > 0, sigma[:, r - 1] / top, 0.0)
    return np.array([one, two, constraint], dtype=float)


COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")


@dataclass(frozen=True)
class Pose:
    """A pose of the output in the axes of the base.

    Attributes
    ----------
    position : tuple of 3 floats
        Metres.
    quaternion : tuple of 4 floats
        Unit quaternion (e0, e1, e2, e3), the scalar e0 first and not negative.
    """

    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    @property
    def angles(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw, radians: the rotation is Rz(yaw) Ry(pitch) Rx(roll)."""
        r, p, y = pin.rpy.matrixToRpy(self.se3.rotation)
        return float(r), float(p), float(y)

    @property
    def se3(self) -> pin.SE3:
        """As Pinocchio's placement."""
        e0, e1, e2, e3 = self.quaternion
        return pin.SE3(pin.Quaternion(e0, e1, e2, e3).matrix(), np.array(self.position))

    def __str__(self) -> str:
        x = ", ".join(f"{v + 0.0:.6g}" for v in np.round(self.position, 12))
        r = ", ".join(f"{v + 0.0:.6g}" for v in np.round(self.angles, 12))
        return f"({x}) m, roll, pitch, yaw ({r})"


def pose_of(placement: pin.SE3) -> Pose:
    """The pose of a placement."""
    turn = pin.Quaternion(np.array(placement.rotation))
    e = np.array([turn.w, turn.x, turn.y, turn.z])
    e /= np.linalg.norm(e)
    e = e * np.sign(e[int(np.argmax(np.abs(e) > 1e-9))]) + 0.0
    x, y, z = (float(v) for v in placement.translation)
    return Pose((x, y, z), (float(e[0]), float(e[1]), float(e[2]), float(e[3])))


def read_pose(mechanism: Mechanism, pose: ArrayLike | None) -> pin.SE3:
    """What a user means by a pose (see `working_modes`)."""
    at_home = output_pose(mechanism, home(mechanism))
    if pose is None:
        return at_home
    if isinstance(pose, pin.SE3):
        return pin.SE3(pose)
    values = real_numbers(pose, "pose")
    rows = mechanism.task.rows
    ConfigurationError.refuse_if(
        not np.isfinite(values).all(), "pose holds a value that is not finite"
    )
    if values.shape in ((4, 4), (6,)):
        return pin.SE3(*arm_pose(values)[::-1])
    if values.shape == (7,):
        e = values[3:]
        size = float(np.linalg.norm(e))
        ConfigurationError.refuse_if(
            size <= ALIKE, "the quaternion of the pose is zero: give e0, e1, e2, e3"
        )
        return pin.SE3(pin.Quaternion(*(e / size)).matrix(), values[:3])
    if values.shape == (len(rows),):
        full = np.concatenate([at_home.translation, pin.rpy.matrixToRpy(at_home.rotation)])
        full[list(rows)] = values
        return pin.SE3(pin.rpy.rpyToMatrix(*full[3:]), full[:3])
    named = {"v": "", "w": "turn about "}
    names = ", ".join(named[ROW_NAMES[r][0]] + ROW_NAMES[r][1] for r in rows)
    shapes = {0: "a single number", 1: f"{values.size} numbers"}
    got = shapes.get(values.ndim, f"an array {values.shape}")
    raise ConfigurationError(
        f"a pose of {mechanism.output} has {len(rows)} numbers ({names}), 6 (x, y, z, roll, pitch, "
        f"yaw), 7 (x, y, z and a quaternion) or is a matrix (4, 4); got {got}"
    )


def led_pose(mechanism: Mechanism) -> dict[str, Any]:
    """Return rows of the output that can be led independently, and its turns, ready for JSON.

    Keys: ``rows``, as many as it has freedoms, those that move most at home; ``turn``, None where
    it does not turn, else ``kind``: ``full`` (all three, led as a rotation), ``axis`` (about one
    axis of the base always: ``at`` is the angle at the rotation ``zero``), or ``angles`` (some of
    roll, pitch and yaw; the others follow).
    """
    start, loops = home(mechanism), BatchLoops(mechanism)

    def moves(q: Array) -> Array:
        """Velocities (6, d) of the output over the motions that the loops allow."""
        return np.asarray(loops.output(q[None])[2][0] @ motions(mechanism, q).basis)

    rest = moves(start)[list(mechanism.task.rows)]
    chosen: set[int] = set()
    for _ in range(min(ranks(mechanism).output, len(rest))):
        # Of rows that move alike the earlier one is taken, whatever rounding says.
        k = int(np.argmax(np.round(np.linalg.norm(rest, axis=1), 9)))
        chosen.add(int(mechanism.task.rows[k]))
        size = float(np.linalg.norm(rest[k]))
        if size > 0:
            rest = rest - np.outer(rest @ rest[k], rest[k]) / size**2
    rows = sorted(chosen)
    turning = [row for row in rows if row >= 3]
    if not turning:
        return {"rows": rows, "turn": None}
    if len(turning) == 3:
        return {"rows": rows, "turn": {"kind": "full"}}
    others = [row for row in (3, 4, 5) if row not in turning]
    samples = [start, *random_closed(mechanism, 4, np.random.default_rng(673))]
    if len(turning) > 1 or any(np.abs(moves(q)[others]).max() > 1e-8 for q in samples):
        return {"rows": rows, "turn": {"kind": "angles"}}
    R = np.array(output_pose(mechanism, start).rotation)
    angle = float(pin.rpy.matrixToRpy(R)[turning[0] - 3])
    return {"rows": rows, "turn": {"kind": "axis", "at": angle, "zero": R.tolist()}}


@dataclass(frozen=True)
class Column:
    """Numbers of a table, one for each row: metres, or radians where it ``turns``."""

    title: str
    values: Sequence[float]
    turns: bool

    def shown(self, degrees: bool) -> list[float]:
        """As they are printed."""
        unit = 180 / math.pi if degrees and self.turns else 1.0
        return [unit * v for v in self.values]


def pose_table(
    poses: Sequence[Pose],
    more: Sequence[Sequence[str]],
    titles: Sequence[str],
    degrees: bool = False,
    width: int = 100,
    columns: Sequence[Column] = (),
) -> list[str]:
    """Return table lines with a number, the coordinates that are not all zero, and more."""
    # Where it would be wider than ``width`` with columns of numbers, coordinates that are the same
    # in all rows are in a line above it.
    if not poses:
        return []
    # A half turn is always the positive one.
    values = [
        [*p.position, *(math.pi if v < ROUNDING - math.pi else v for v in p.angles)] for p in poses
    ]
    shown = [k for k in range(6) if any(abs(v[k]) > ROUNDING for v in values)] or [0, 1, 2]
    pose = [Column(COORDINATES[k], [v[k] for v in values], k > 2) for k in shown]
    changing = [c for c in pose if max(c.values) - min(c.values) > 1e-7]
    alike = [c for c in pose if c not in changing] if columns and len(poses) > 1 else []
    for left in ([], alike) if alike else ([],):
        said = ", ".join(f"{c.title} = {_number(c.shown(degrees)[0], 5)}" for c in left)
        head = [f"each at {said}"] if left else []
        numbers = [*(c for c in pose if c not in left), *columns]
        cells = list(zip(*(c.shown(degrees) for c in numbers), strict=True))
        for digits in (5, 4, 3):
            rows = [
                (str(i), *(_number(v, digits) for v in row), *extra)
                for i, (row, extra) in enumerate(zip(cells, more, strict=True), 1)
            ]
            titled = ("", *(c.title for c in numbers), *titles)
            lines = aligned(titled, rows, len(numbers) + 2)
            if max(map(len, lines)) <= width:
                # Spaces that do not break keep a row on its line.
                return [*head, *(line.replace(" ", "\u00a0") for line in lines)]
    return [*head, *lines]


def aligned(header: tuple[str, ...], rows: Sequence[tuple[str, ...]], right: int) -> list[str]:
    """Lines of a table, as wide as they come, whose first columns, so many, are of numbers."""
    table = Table(header, tuple(rows), frozenset(range(right)))
    return Page(10**6).table(table).split("\n")


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text
