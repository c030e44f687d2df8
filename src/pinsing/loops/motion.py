"""What a mechanism is and can do at a configuration: its mode, singularity type, measures.

The *assembly mode* changes at type 2 singularities: the sign of the determinant of the passive
columns of the constraints, counted from the home configuration. The *working mode* changes at
type 1 singularities: for each actuated joint that a turning one follows, to which side that elbow
is bent; of a driven slide, whether its rod leans ahead along it or back.

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

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from pinsing.errors import ConfigurationError
from pinsing.interface import JsonResult, real_numbers
from pinsing.kinematics.jacobian import read_pose as arm_pose
from pinsing.loops.closure import (
    BatchLoops,
    Leg,
    Loops,
    ball_jacobians,
    gauss_newton,
    groups,
    hinge_rates,
    likeness,
    locked,
    near_home,
    newton,
    output_pose,
    passive_joints,
    random_closed,
    ranks,
    structure,
)
from pinsing.measures import (
    ALIKE,
    NEAR_RTOL,
    ROUNDING,
    SEED,
    SINGULAR_RTOL,
    SOLVED,
    Array,
    ArrayLike,
    Bool,
    NDArray,
)
from pinsing.prose import Page, Table
from pinsing.robot.arm import kept
from pinsing.robot.mechanism import Mechanism, Sample, closing, joint_axes, path_to
from pinsing.robot.task import ROW_NAMES

_HOME_STARTS = 60
_MORE_STARTS = 4000
_NO_ELBOW = "."


@dataclass(frozen=True)
class Elbow:
    """An actuated joint, the turning one after it, and what follows that."""

    # crank and elbow: indices of the two joints in the model
    crank: int
    elbow: int
    end_joint: int  # joint of the model whose placement ``end`` is given in
    # where the distal link leads to: the next joint, or the frame that closes the loop. Where all
    # axes meet in one point, the direction of the third one
    end: tuple[float, float, float]
    # whether the actuated joint is a slide: its two ways meet where the rod is square to it
    slides: bool = False

    @property
    def turns_freely(self) -> bool:
        """Whether several axes meet at the elbow, so that the rod leaves the crank's plane."""
        return self.end_joint != self.elbow


@dataclass(frozen=True)
class ModeSigns:
    """A mode as data."""

    # ``+`` (as at home), ``-``, ``0`` at a type 2 singularity, ``?`` where there is no sign
    assembly: str
    # ``+``, ``-`` or, at a type 1 singularity, ``0`` for each input, in their order; ``.`` for one
    # without an elbow where others have one; empty where none has
    elbows: tuple[str, ...]

    @property
    def order(self) -> tuple[int, ...]:
        """What modes are listed by: the home assembly first, elbows to the left first."""
        return tuple({"-": 1, "?": 2}.get(sign, 0) for sign in (self.assembly, *self.elbows))

    def __str__(self) -> str:
        assembly = f"assembly {self.assembly}"
        return f"{assembly}, elbows {''.join(self.elbows)}" if self.elbows else assembly


def elbows(mechanism: Mechanism) -> tuple[Elbow, ...]:
    """Elbows of a mechanism, in the order of its inputs."""
    model = mechanism.model
    out = []
    for a in mechanism.actuated:
        crank = a + 1
        after = [int(j) for j in model.children[crank]]
        if len(after) != 1 or mechanism.prismatic[after[0] - 1]:
            continue
        elbow = after[0]
        slides = bool(mechanism.prismatic[a])
        if slides and not set(path_to(mechanism, crank)) <= set(mechanism.actuated):
            continue
        beyond = [int(j) for j in model.children[elbow]]
        last = elbow
        # After a slide, or at the end of a crank, a rod may turn about several crossed axes.
        carried = slides or not _meets(model, elbow)
        while carried and len(beyond) == 1 and _meets(model, beyond[0]):
            last = beyond[0]
            beyond = [int(j) for j in model.children[last]]
        pairs = zip(*closing(mechanism), strict=True)
        ends = (model.frames[k] for k in itertools.chain(*pairs))
        here = [model.jointPlacements[j] for j in beyond[:1]] or [
            f.placement for f in ends if f.parentJoint == last
        ]
        if not here:
            continue
        end = here[0].translation
        if np.linalg.norm(end) <= ROUNDING and (slides or beyond):
            # Two axes through one point: a ball has no elbow, a leg on a sphere has.
            if slides or not _meets(model, elbow):
                continue
            end = here[0].rotation @ joint_axes(mechanism)[beyond[0] - 1]
        x, y, z = (float(v) for v in end)
        out.append(Elbow(crank, elbow, last, (x, y, z), slides))
    return tuple(out)


def _meets(model: pin.Model, joint: int) -> bool:
    """Whether a joint stands where the one before it stands."""
    return bool(np.linalg.norm(model.jointPlacements[joint].translation) <= ROUNDING)


def elbow_sines(mechanism: Mechanism, q: ArrayLike) -> Array:
    """Return the sine of each elbow angle at q (n,): positive to the left about the crank's axis.

    In space it is the volume of crank, rod and axis, over the lengths of the two. Of a leg whose
    axes meet in one point it is that of their directions: crank, elbow, end. Of a slide it is the
    cosine between the rod and the slide.
    """
    sample, out = Sample(mechanism, np.asarray(q, dtype=float)), []
    for e in elbows(mechanism):
        axis, bent = sample.axis[[e.crank - 1, e.elbow - 1]]
        start = sample.joints[e.elbow].translation
        first = start - sample.joints[e.crank].translation
        second = sample.joints[e.end_joint].act(np.array(e.end)) - start
        reach, size = float(np.linalg.norm(second)), float(np.linalg.norm(first))
        if e.slides:
            out.append(float(axis @ second) / max(reach, ROUNDING))
        elif size <= ROUNDING:
            out.append(float(np.cross(axis, bent) @ second) / max(reach, ROUNDING))
        else:
            out.append(float(np.cross(first, second) @ axis) / (size * reach) if reach > 0 else 0.0)
    return np.array(out)


@kept
def assembly_rows(mechanism: Mechanism) -> tuple[list[int] | None, float]:
    """Return closure rows whose determinant tells assemblies apart (or None), and its home sign."""
    loops = Loops(mechanism)
    rank = ranks(mechanism).constraint
    samples = random_closed(mechanism, 6, np.random.default_rng(SEED))
    stack = np.stack([loops.scaled(q)[1] for q in [home(mechanism), *samples]])
    rows = [int(i) for i in np.flatnonzero(np.abs(stack).max(axis=(0, 2)) > 1e-9)]
    if len(rows) != rank or rank != len(mechanism.passive):
        return None, 0.0
    at_home = float(np.linalg.det(stack[0][np.ix_(rows, list(mechanism.passive))]))
    return rows, 1.0 if at_home >= 0 else -1.0


def assembly_sign(mechanism: Mechanism, q: ArrayLike) -> str:
    """``+`` (as at home), ``-``, ``0`` at a type 2 singularity, ``?`` where there is no sign."""
    # The determinant of the passive constraint columns has one where as many closure equations as
    # passive joints do not vanish identically (planar loops); elsewhere the rows that count change.
    rows, sign = assembly_rows(mechanism)
    if rows is None:
        return "?"
    G = Loops(mechanism).scaled(mechanism.check(q))[1]
    return _sign(sign * float(np.linalg.det(G[np.ix_(rows, list(mechanism.passive))])))


def mode_at(mechanism: Mechanism, q: ArrayLike) -> ModeSigns:
    """Assembly and working mode at a closed configuration q (n,)."""
    sines = elbow_sines(mechanism, q).tolist()
    signs = {e.crank - 1: _sign(s) for e, s in zip(elbows(mechanism), sines, strict=True)}
    named = tuple(signs.get(a, _NO_ELBOW) for a in mechanism.actuated) if signs else ()
    return ModeSigns(assembly_sign(mechanism, q), named)


def _sign(value: float) -> str:
    return "0" if abs(value) <= ROUNDING else "+" if value > 0 else "-"


def mode_of(mechanism: Mechanism, q: ArrayLike) -> str:
    """Name of the mode at a closed configuration: ``assembly +, elbows -+``."""
    return str(mode_at(mechanism, q))


def home(mechanism: Mechanism) -> Array:
    """Return the home configuration with its loops closed, within the limits if one can be found.

    Where home leads nowhere, or beyond a limit, a random one within the limits; where there is
    none either, one beyond them.
    """
    return np.array(_home(mechanism))


def home_outside(mechanism: Mechanism) -> str:
    """Which limits home breaks, in words; empty where it keeps them all."""
    q = home(mechanism)
    outside = np.flatnonzero(mechanism.space.unreachable(q))
    if not len(outside):
        return ""
    named = ", ".join(
        f"{mechanism.joints[k]} = {q[k]:.6g} is not in "
        f"[{mechanism.lower[k]:.6g}, {mechanism.upper[k]:.6g}]"
        for k in outside.tolist()
    )
    return (
        f"home is beyond the joint limits ({named}): the loops closed nowhere within all of them, "
        f"from home and {_HOME_STARTS + _MORE_STARTS} random starts"
    )


def home_error(mechanism: Mechanism) -> ConfigurationError:
    """That home breaks limits, as an error, for what is asked of configurations within them."""
    return ConfigurationError(
        f"{mechanism.name}: {home_outside(mechanism)}; widen the limits, or ignore them "
        "(--ignore-limits, without_limits())"
    )


def closed_from_random(
    loops: BatchLoops,
    begin: Array,
    free: Bool,
    count: int,
    rng: np.random.Generator,
    target: tuple[Array, Array, tuple[int, ...]] | None = None,
    steps: int = 60,
) -> Array:
    """Return closed configurations (N, n) from home, first, and random starts."""
    # Joints that are not ``free`` stay as in begin; ``target`` and ``steps`` are those of `newton`.
    mechanism = loops.mechanism
    drawn = mechanism.space.sample(count, rng)
    drawn[0] = home(mechanism)
    Q, size = newton(loops, np.where(free, drawn, begin), free, target=target, steps=steps)
    return Q[size <= ROUNDING]


def _home_starts(mechanism: Mechanism) -> Iterator[tuple[Array, Bool]]:
    """Configurations from which home is sought, and the joints that may move."""
    space, everything = mechanism.space, np.ones(mechanism.n, dtype=bool)
    # The inputs stay as given if they can.
    yield mechanism.home, passive_joints(mechanism)
    yield mechanism.home, everything
    rng = np.random.default_rng(SEED)
    yield from ((start, everything) for start in space.sample(_HOME_STARTS, rng))
    # Where few of the poses are within the limits: many starts, all at once.
    Q, size = newton(BatchLoops(mechanism), space.sample(_MORE_STARTS, rng), everything)
    for q in Q[size <= ROUNDING]:
        if not space.unreachable(space.fold(q)).any():
            yield q, everything


@kept
def _home(mechanism: Mechanism) -> Array:
    loops, space = Loops(mechanism), mechanism.space
    spare: list[Array] = []
    for start, free in _home_starts(mechanism):
        found, error = gauss_newton(loops, start, free)
        found = space.fold(found)
        if error <= SOLVED:
            if not space.unreachable(found).any():
                return found
            if start is mechanism.home:
                spare.append(found)
    spare = spare or random_closed(mechanism, 30, np.random.default_rng(SEED))
    if not spare:
        # The reason is said there; where ranks are known, loops close near home.
        ranks(mechanism)
        spare = near_home(mechanism)
    return mechanism.space.fold(spare[0])


MANY = 8
"""More solutions at which something moves by itself are points of curves."""


@dataclass(frozen=True, eq=False)
class LegMode:
    """Solutions of one leg that differ in flipped passive joints only."""

    q: Array  # (n,): one of them; joints of other legs have no meaning
    ways: int  # how many were found
    # whether the leg moves by itself there, and this is one point for a curve of them
    loose: bool = False


def leg_modes(
    mechanism: Mechanism, reached: Array, free: Bool, rng: np.random.Generator, starts: int
) -> list[list[list[LegMode]]]:
    """Return solutions within the limits, for each configuration, for each leg.

    The pose of the output at ``reached`` (N, n) is the one to reach; joints that are not ``free``
    (n,) stay as there. Of each leg's ``starts`` the first is there, the others are random; balls
    and universal joints are flipped besides.
    """
    loops = BatchLoops(mechanism)
    by_leg = [
        _solutions(loops, leg, reached, free, rng, starts) for leg in structure(mechanism).legs
    ]
    return [list(modes) for modes in zip(*by_leg, strict=True)]


def _solutions(
    loops: BatchLoops, leg: Leg, reached: Array, free: Bool, rng: np.random.Generator, count: int
) -> list[list[LegMode]]:
    mechanism = loops.mechanism
    mine = np.isin(np.arange(mechanism.n), leg.joints) & free
    starts = np.repeat(reached, count, axis=0)
    drawn = mechanism.space.sample(len(starts), rng)
    drawn[::count] = reached
    starts[:, mine] = drawn[:, mine]
    R, p, _ = loops.output(reached)
    pose = np.repeat(np.arange(len(reached)), count)
    found: list[list[Array]] = [[] for _ in reached]
    for _ in range(3):
        target = (R[pose], p[pose], tuple(range(6))) if leg.carries else None
        Q, size = newton(loops, starts, mine, leg.loops, target)
        flips: list[tuple[int, Array]] = []
        for i, q in zip(pose[size <= ROUNDING].tolist(), Q[size <= ROUNDING], strict=True):
            away = mechanism.space.wrap(np.reshape(found[i], (-1, mechanism.n)) - q)
            if not (np.abs(away / mechanism.space.metric).max(axis=1) <= 1e-5).any():
                found[i].append(q)
                flips += [(i, x) for x in _flipped(mechanism, q, mine)]
        if not flips:
            break
        pose, starts = np.array([i for i, _ in flips]), np.array([x for _, x in flips])
    owner = np.repeat(np.arange(len(found)), [len(solutions) for solutions in found])
    Q = mechanism.space.fold(np.reshape(list(itertools.chain(*found)), (-1, mechanism.n)))
    inside = ~mechanism.space.unreachable(Q)[:, mine].any(axis=1)
    Q, owner = Q[inside], owner[inside]
    marks, out = likeness(mechanism, Q, leg.joints), []
    for i in range(len(reached)):
        here = np.flatnonzero(owner == i)
        alike = [here[group] for group in groups(marks[here])]
        modes = [LegMode(Q[group[0]], len(group)) for group in alike]
        out.append(_without_curves(mechanism, mine, modes))
    return out


def _without_curves(mechanism: Mechanism, mine: Bool, modes: list[LegMode]) -> list[LegMode]:
    """Of many configurations at which the leg moves by itself, one: they are points of curves."""
    if len(modes) <= MANY:
        return modes
    loops = Loops(mechanism)

    def is_loose(mode: LegMode) -> bool:
        rows = np.vstack([loops.scaled(mode.q)[1], loops.output(mode.q)[1]])[:, mine]
        sigma = np.linalg.svd(rows, compute_uv=False)
        return len(sigma) < mine.sum() or bool(sigma[-1] <= ALIKE * sigma[0])

    loose = [mode for mode in modes if is_loose(mode)]
    one = [replace(mode, loose=True) for mode in loose[:1]]
    return modes if len(loose) <= MANY else [*one, *(mode for mode in modes if mode not in loose)]


def _flipped(mechanism: Mechanism, q: Array, mine: Bool) -> Iterator[Array]:
    """Starts near the other solutions of balls and universal joints with crossed axes."""
    crossed = ([j for j in c.joints if mine[j]] for c in structure(mechanism).centres)
    for first, second, *others in (joints for joints in crossed if len(joints) > 1):
        for middle in (-q[second], np.pi - q[second]):
            x = q.copy()
            x[[first, *others[:1]]] += np.pi  # the first, and the third of a ball
            x[second] = middle
            yield x


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
    _, sigma, Vt = np.linalg.svd(G)
    r = ranks(mechanism).constraint
    generic = sigma[r - 1] > rtol * sigma[0]
    N = Vt[r if generic else int((sigma > rtol * sigma[0]).sum()) :].T
    one, two, constraint = _ratios(mechanism, sigma, N, J).tolist()
    return Motions(N, N[list(mechanism.actuated)], J @ N, constraint, two, one)


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
    ratios = _ratios_of_many(mechanism, loops.closure(Q, placed=placed)[1], J)
    beside = ratios.min(axis=0) <= NEAR_RTOL
    beside[beside] = locked(loops, Q[beside])
    if beside.any():  # a ball that is locked as written turns as a ball does
        ratios[:, beside] = _ratios_of_many(mechanism, *ball_jacobians(loops, Q[beside]))
    for k in np.flatnonzero(ratios[2] <= rtol).tolist():  # more motions than the mobility; few are
        ratios[:, k] = motions(mechanism, Q[k], rtol).ratios
    return ratios


def _ratios_of_many(mechanism: Mechanism, G: Array, J: Array) -> Array:
    """Measures (3, N), in their order, from Jacobians of closure (N, k, n) and output (N, m, n)."""
    r = ranks(mechanism).constraint
    # Where as many rows as the rank are not zero, G' = Q R has both singular values and kernel in
    # two thirds of the time: the values of R, the last columns of Q.
    rows = np.flatnonzero(np.abs(G).max(axis=(0, 2)) > 1e-12)
    if len(rows) == r:
        Q, R = np.linalg.qr(np.swapaxes(G[:, rows], 1, 2), mode="complete")
        return _ratios(mechanism, np.linalg.svd(R[:, :r], compute_uv=False), Q[:, :, r:], J)
    _, sigma, Vt = np.linalg.svd(G)
    return _ratios(mechanism, sigma, np.swapaxes(Vt[:, r:], 1, 2), J)


def _ratios(mechanism: Mechanism, sigma: Array, N: Array, J: Array) -> Array:
    """Measures (3, ...): of closure the singular values (..., k), of motions N (..., n, d)."""
    generic, top, d = ranks(mechanism), sigma[..., 0], N.shape[-1]
    size = np.sqrt(np.maximum(np.linalg.eigvalsh(J @ np.swapaxes(J, -1, -2))[..., -1], 0.0))
    moved = np.linalg.svd(J @ N, compute_uv=False)
    held = np.linalg.svd(N[..., list(mechanism.actuated), :], compute_uv=False)
    two = held[..., d - 1] if d <= held.shape[-1] else np.zeros_like(top)
    with np.errstate(divide="ignore", invalid="ignore"):
        one = np.where(size > 0, moved[..., generic.output - 1] / size, 0.0)
        constraint = np.where(top > 0, sigma[..., generic.constraint - 1] / top, 0.0)
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


def pose_table(
    poses: Sequence[Pose],
    more: Sequence[Sequence[str]],
    titles: Sequence[str],
    degrees: bool = False,
    width: int = 100,
    columns: Sequence[tuple[str, Sequence[float]]] = (),
) -> list[str]:
    """Return table lines with a number, the coordinates that are not all zero, and more."""
    # ``columns`` are titles and numbers as they are shown. Where it would be wider than ``width``
    # with them, coordinates that are the same in all rows are in a line above it.
    if not poses:
        return []
    values = np.array([[*p.position, *p.angles] for p in poses])
    values[:, 3:] += 2 * math.pi * (values[:, 3:] < ROUNDING - math.pi)  # a half turn is positive
    units = [1.0] * 3 + [180 / math.pi if degrees else 1.0] * 3
    shown = [k for k in range(6) if np.abs(values[:, k]).max() > ROUNDING] or [0, 1, 2]
    alike = [k for k in shown if np.ptp(values[:, k]) <= 1e-7] if columns and len(poses) > 1 else []
    for left in ([], alike) if alike else ([],):
        said = (f"{COORDINATES[k]} = {_number(units[k] * values[0, k], 5)}" for k in left)
        head = [f"each at {', '.join(said)}"] if left else []
        kept = [k for k in shown if k not in left]
        numbers = [*((COORDINATES[k], units[k] * values[:, k]) for k in kept), *columns]
        cells = list(zip(*(column for _, column in numbers), strict=True))
        for digits in (5, 4, 3):
            rows = [
                (str(i), *(_number(v, digits) for v in row), *extra)
                for i, (row, extra) in enumerate(zip(cells, more, strict=True), 1)
            ]
            titled = ("", *(title for title, _ in numbers), *titles)
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
