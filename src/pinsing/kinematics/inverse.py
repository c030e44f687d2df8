"""inverse: all joint values that bring the tip to a pose, and to many poses at once.

EAIK (Ostermeier, https://github.com/OstermD/EAIK) decomposes arms of six revolute joints into
subproblems. It is given the nominal chain, whose axes meet or are parallel exactly.

Solutions of other arms are found by damped Newton steps to a pose, from many starts at once; starts
that came near and did not reach it say how complete the search is. Solutions of many poses come
from EAIK, or else by continuation. Each is brought to the arm itself by Newton steps, and kept only
if forward kinematics gives the pose.

That a true solution is near a computed one, and only one: by the theorem of Kantorovich (1948).
F(q) is what is left of the pose: the position over the length scale, and half the difference of
R and its transpose as a vector, R the rotation that is left. F = 0 there means that the pose is
reached, since R is near the identity. With b at least the norm of the inverse of F', e at least
the length of the Newton step, and K a bound of all second derivatives: where 2 b K e < 1 there is
one zero of F within 2 e, and F' is regular there.

Second derivatives: by two turns the position changes by no more than its distance from the outer
axis, R by no more than one; by a turn and a slide the position by no more than one.

That no configuration on a way is singular is proven from the Jacobian of the arm itself. The
singular values of a matrix change by no more than its norm does (Weyl, 1912). With K a bound of the
second derivatives, the Jacobian has rank r within h of a configuration where ``sigma_r > K h``.
Straight pieces are halved until that holds for each from its middle. No closed form is needed, and
families of every codimension count.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import pairwise, product
from typing import Any, ClassVar

import numpy as np

from pinsing._batch import engine
from pinsing.errors import ConfigurationError, EngineError, OptionError, UnknownNameError
from pinsing.interface import MAX_SEED, JsonResult, Sequenced, checked, typed, whole_number
from pinsing.kinematics.jacobian import (
    ROWS,
    generic_rank,
    joint_frames,
    picked,
    ratios,
    read_pose,
    task_jacobian,
    turn_left,
)
from pinsing.kinematics.ladder import ladder_of
from pinsing.measures import (
    ALIKE,
    FLOAT_NOISE,
    PRACTICAL,
    ROUNDING,
    SOLVED,
    Array,
    ArrayLike,
    Bool,
    Ints,
)
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.robot.nominal import flatten, nominal
from pinsing.robot.task import POSE, POSITION

_STEP = 0.7


class Solver:
    """Damped Newton steps to one pose for many configurations at once.

    ``held`` (n,) is NaN for joints that are free, ``rotation`` None where it does not count.

    Newton's steps stall where J is nearly singular: what is left of the pose is small along a
    valley. So a small rest means that a solution may be near, not that the pose is out of reach.
    """

    def __init__(
        self,
        arm: Arm,
        position: Array,
        rotation: Array | None = None,
        held: Array | None = None,
    ) -> None:
        OptionError.refuse_if(
            arm.coupling is not None,
            f"{arm.name}: inverse solutions are found for arms whose joints are all "
            "revolute or prismatic, none a mimic",
        )
        self.arm, self.position, self.rotation = arm, position, rotation
        self.chain, self.task, self.scale = flatten(arm), arm.task, arm.length_scale
        self.held = np.full(arm.n, np.nan) if held is None else held
        self.free = np.flatnonzero(np.isnan(self.held))
        self.weight = np.where(arm.prismatic, 1 / self.scale, 1.0)[self.free]
        self._stalled = np.empty((0, arm.n + 1))  # ends (K, n) of starts, and what was left there

    def solve(self, Q: Array, remember: bool = False) -> tuple[Array, Array]:
        """Return solutions (K, n) reached from starts Q (N, n), and residuals (K,)."""
        # Of others ``doubt`` knows if asked to. A pose whose squares overflow is reached by none.
        with np.errstate(over="ignore", invalid="ignore"):
            Q, left = self._descend(Q.copy())
        good = left < SOLVED
        if remember:
            # What is left of the pose below which a start all but reached it: radians, or length
            # scales.
            ends = np.column_stack([Q, left])[~good & (left < 1e-5)]
            self._stalled = np.concatenate([self._stalled, ends])[:512]
        return Q[good], left[good]

    def doubt(self, solutions: Array) -> str:
        """Return the doubts that solutions (K, n) are all; empty if there are none."""
        gaps = self.arm.space.wrap(self._stalled[:, None, :-1] - solutions)
        # Beside a solution a start that stalled says nothing more than that.
        left = self._stalled[(np.abs(gaps).max(axis=2) > 0.1).all(axis=1), -1]
        if not len(left):
            return ""
        count = f"{len(left)} start{'s' * (len(left) != 1)}"
        return (
            f"{count} came within {left.min():.1g} of the pose and stalled, as happens next to "
            "singular configurations: there may be a solution there"
        )

    def beside(self, rng: np.random.Generator) -> Array:
        """Return starts (200 K, n) along motions of K stalled ones that leave the tip at rest."""
        ends = self._stalled[:4, :-1]
        still = np.zeros_like(ends)
        still[:, self.free] = np.linalg.svd(self.linear(ends)[1])[2][:, -1] / self.weight
        still /= np.maximum(np.abs(still).max(axis=1, keepdims=True), 1e-300)
        turns = np.linspace(-np.pi, np.pi, 200, endpoint=False)[:, None]
        Q = (ends[:, None] + turns * still[:, None]).reshape(-1, self.arm.n)
        return Q + 1e-3 * rng.normal(size=Q.shape)

    def _descend(self, Q: Array) -> tuple[Array, Array]:
        damping = np.full(len(Q), 1e-2)
        error, J = self.linear(Q)
        cost = (error**2).sum(axis=1)
        alive = np.isfinite(cost)
        for _ in range(60):
            live = np.flatnonzero(alive)
            if not len(live):
                break
            e, A = error[live], J[live]
            step = _damped(A, e, damping[live])
            step *= np.minimum(1.0, _STEP / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
            trial = Q[live].copy()
            trial[:, self.free] += step / self.weight
            new_error, new_J = self.linear(trial)
            new_cost = (new_error**2).sum(axis=1)
            better = new_cost < cost[live]
            rows = live[better]
            Q[rows], error[rows], J[rows] = trial[better], new_error[better], new_J[better]
            cost[rows] = new_cost[better]
            tiny = np.where(cost[live] > 1e-8, 1e-14, 1e-300)
            damping[live] = np.where(
                better, np.maximum(damping[live] * 0.2, tiny), np.maximum(damping[live], 1e-6) * 5
            )
            done = (cost[live] < 1e-28) | (damping[live] > 10.0) | (~better & (cost[live] < 1e-22))
            alive[live[done]] = False
        return Q, np.sqrt(cost)

    def signs(self, Q: Array) -> Array:
        """Signs (N,) of the determinant at configurations (N, n), of a square task."""
        return np.asarray(np.sign(np.linalg.det(self.linear(Q)[1])))

    def linear(self, Q: Array) -> tuple[Array, Array]:
        """Return the residual of the pose (N, m), and its derivatives by the free joints."""
        R, p = joint_frames(self.chain, Q)
        z, R, tip, slides = R[:, :-1, :, 2], R[:, -1], p[:, -1], self.chain.prismatic[:, None]
        # By components: np.cross costs more than all else here.
        (a, b, c), (d, e, f) = (np.moveaxis(x, 2, 0) for x in (z, tip[:, None] - p[:, :-1]))
        moved = np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=2)
        columns = np.where(slides, z, moved) / self.scale, np.where(slides, 0.0, z)
        J = np.concatenate(columns, axis=2).transpose(0, 2, 1)
        error = np.zeros((len(Q), 6))
        error[:, :3] = (self.position - tip) / self.scale
        if self.rotation is not None:
            error[:, 3:] = turn_left(self.task, R, self.rotation)
        wanted = picked(self.task, error[:, :, None], R)[:, :, 0]
        return wanted, picked(self.task, J, R)[:, :, self.free] / self.weight


def _damped(J: Array, e: Array, damping: Array) -> Array:
    """Return steps (N, k) that solve (J'J + damping) step = J'e, for J (N, m, k) and e (N, m)."""
    # J'J is known to rounding of its trace: with less damping J is decomposed itself.
    transposed = J.transpose(0, 2, 1)
    gram = transposed @ J
    little = damping <= FLOAT_NOISE * np.trace(gram, axis1=1, axis2=2)
    gram += np.where(little, 1.0, damping)[:, None, None] * np.eye(J.shape[2])
    step = np.asarray(np.linalg.solve(gram, transposed @ e[..., None])[..., 0])
    if little.any():
        u, s, v = np.linalg.svd(J[little], full_matrices=False)
        along = (u.transpose(0, 2, 1) @ e[little][..., None])[..., 0]
        along *= s / np.maximum(s * s + damping[little][:, None], 1e-300)
        step[little] = (v.transpose(0, 2, 1) @ along[..., None])[..., 0]
    return step


def radii(solver: Solver, Q: Array) -> Array:
    """Distance (K,) in joint space to a true solution near Q (K, n); infinite where not proven."""
    rows = solver.task.rows
    out = np.full(len(Q), np.inf)
    if not len(Q) or rows not in (POSE, POSITION) or len(rows) != len(solver.free):
        return out
    error, J = solver.linear(Q)
    reach = _reach(solver, Q)
    # Of F and F', relative to the size of the chain over the length scale; with room.
    left = np.linalg.norm(error, axis=1) + 1e-13 * (1 + reach.max(axis=1) / solver.scale)
    least = np.linalg.svd(J, compute_uv=False)[:, -1] - 4 * left
    bend = _bend(solver, reach)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / least
        step = inverse * left
        good = (least > 0) & (2 * inverse * bend * step < 0.5)
    # The weight of a slide is at most what makes its length one radian: in joint space, over it.
    out[good] = (2 * step / min(1.0, float(solver.weight.min())))[good]
    return out


def _reach(solver: Solver, Q: Array) -> Array:
    """Return how far the tip can be from each joint, (K, n)."""
    step = np.linalg.norm(solver.chain.t, axis=1)[1:]
    slide = np.where(solver.chain.prismatic, np.abs(Q) + 0.1, 0.0)
    return np.asarray(np.cumsum((step + slide)[:, ::-1], axis=1)[:, ::-1])


def _bend(solver: Solver, reach: Array) -> Array:
    """Bound (K,) of the second derivative of F by weighted joints."""
    turns = ~np.asarray(solver.chain.prismatic)[solver.free]
    far = reach[:, solver.free] / solver.scale
    n = len(solver.free)
    outer = np.maximum.outer(np.arange(n), np.arange(n))
    both = turns[:, None] & turns[None, :]
    one = turns[:, None] ^ turns[None, :]
    spin = 1.0 if max(solver.task.rows) >= len(POSITION) else 0.0
    if solver.task.at_tip:
        # In the tip's axes a column v_i changes by w_i x v_j - w_j x v_i, with joint j behind it.
        lever = far[:, :, None] + far[:, None, :]
    else:
        lever = far[:, outer]
    size = np.where(both, np.hypot(lever, spin), np.where(one, 1 / solver.scale, 0.0))
    if solver.task.at_tip and not all(solver.task.at_tip):
        size *= np.sqrt(2.0)  # some rows of each
    return np.asarray(np.linalg.norm(size / np.outer(solver.weight, solver.weight), axis=(1, 2)))


_MOST = 200_000


def regular_way(arm: Arm, path: Array, most: int = _MOST) -> bool:
    """Return True if a polyline (K, n) has the generic rank, proven by ``most`` pieces at most."""
    solver, rank = Solver(arm, np.zeros(3)), generic_rank(arm)
    # Of second derivatives wherever joints turn, and slides by less than 0.1 m more.
    steep = float(_bend(solver, _reach(solver, path)).max())
    ends = np.array(list(pairwise(path)))
    done = 0
    while len(ends):
        done += len(ends)
        a, b = ends[:, 0], ends[:, 1]
        middle = (a + b) / 2
        half = np.linalg.norm((b - a) * solver.weight, axis=1) / 2
        sizes = np.linalg.svd(solver.linear(middle)[1], compute_uv=False)
        open_ = sizes[:, rank - 1] - 1e-12 * sizes[:, 0] <= steep * half
        # Half a piece, radians: where that is not short enough a configuration is as good as
        # singular.
        if done > most or (half[open_] < 1e-8).any():
            return False
        a, b, middle = a[open_], b[open_], middle[open_]
        ends = np.concatenate([np.stack([a, middle], 1), np.stack([middle, b], 1)])
    return True


def one_sheet(arm: Arm, a: Array, b: Array) -> bool:
    """Return True if the tip can leave a pose in the same directions from two configurations."""
    # An arm with fewer joints than pose conditions reaches a surface; where two sheets of it cross,
    # poses near by have only one of the two.
    J = columns(arm, np.stack([a, b]))
    if J.shape[1] <= generic_rank(arm):
        return True
    u, v = (np.linalg.svd(A)[0][:, : generic_rank(arm)] for A in J)
    return bool(np.abs(v - u @ (u.T @ v)).max() < 1e-6)


def columns(arm: Arm, Q: Array) -> Array:
    """Task Jacobians (N, m, n) of a serial arm whose joints are independent; joints weighted."""
    return Solver(arm, np.zeros(3)).linear(Q)[1]


def decomposed(
    arm: Arm, held: int | None = None, value: float = 1.0
) -> Callable[[Array], tuple[Ints, Array, list[Any]]] | None:
    """Return EAIK's inverse kinematics of an arm, a joint held at a value; None if it has none.

    For poses (M, 4, 4) it returns solution counts (M,), all of them (K, n), the held joint
    included, and EAIK's answers (M,). At 0 arms may decompose that do at no other value.
    """
    try:
        from eaik.IK_Homogeneous import HomogeneousRobot
    except ImportError:
        return None
    chain = flatten(nominal(arm).arm)
    if chain.prismatic.any() or arm.coupling is not None or arm.n - (held is not None) != 6:
        return None
    R, t = (x[0] for x in joint_frames(chain, np.zeros((1, arm.n))))  # axes along z
    signs = np.ones(arm.n)
    for j in range(1, arm.n):
        # Of opposite axes EAIK takes one joint value for its negative.
        if signs[j - 1] * (R[j, :, 2] @ R[j - 1, :, 2]) < ROUNDING - 1:
            signs[j] = -1
    R[:-1, :, 1:] *= signs[:, None, None]
    fixed = [] if held is None else [(held, value * signs[held])]
    robot = HomogeneousRobot(homogeneous(t, R), fixed_axes=fixed)
    if not robot.hasKnownDecomposition():
        return None

    def solutions(T: Array) -> tuple[Ints, Array, list[Any]]:
        found = robot.IK_batched(T, min(len(T), engine.cpu_count()))
        rows = [x.Q for x in found]
        Q = np.concatenate([np.empty((0, arm.n)), *filter(len, rows)])
        return np.array(list(map(len, rows))), signs * Q, found

    return solutions


def homogeneous(position: Array, rotation: Array) -> Array:
    """Return matrices (..., 4, 4) of positions (..., 3) and rotations (..., 3, 3)."""
    T = np.zeros((*position.shape[:-1], 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = rotation, position, 1.0
    return T


@dataclass(frozen=True, eq=False)
class InverseSolution(JsonResult):
    """One configuration that reaches the pose.

    Attributes
    ----------
    q : (n,) array
        Joint values; of copies that differ by whole turns one, within the limits where one is:
        from -pi to pi if that is within, else nearest to the middle of the limits.
    regular : bool
        Whether it is not singular: then it is isolated, and moves smoothly with the pose. Where
        joints are held this is about the others: they meet all conditions.
    sigma_ratio : float
        sigma_r / sigma_1: what the verdict stands on.
    within_limits : bool
        Whether all joints are within their limits.
    met : int
        How many starts led here.
    error : float
        What is left of the pose, radians and metres over the length scale.
    radius : float
        A true solution of the pose, regular and the only one, is proven to be within this distance
        of q in joint space (see the module); infinite where that is not proven.
    """

    schema: ClassVar[str] = "pinsing/inverse_solution/1"

    q: Array
    regular: bool
    sigma_ratio: float
    within_limits: bool
    met: int
    error: float
    radius: float = field(default=math.inf, metadata={"optional": True})

    def __str__(self) -> str:
        return f"{', '.join(f'{value:.6g}' for value in self.q)}{self.doubts}"

    @property
    def doubts(self) -> str:
        """What is to be said of it, in brackets; empty where nothing is."""
        said = [] if self.regular else ["SINGULAR"]
        said += [] if self.within_limits else ["outside the limits"]
        return f"   ({', '.join(said)})" if said else ""


@dataclass(frozen=True, eq=False)
class InverseSolutions(JsonResult, Sequenced[InverseSolution]):
    """The inverse solutions of a pose, as far as they were found.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    position : (3,) array
        Of the tip in the base frame, metres.
    rotation : (3, 3) array or None
        Of the tip; None where it does not matter to the task.
    fixed : dict of str to float
        Joints that were held, where the arm has more than the task needs.
    solutions : tuple of InverseSolution
        Those within the limits first, best conditioned first.
    starts : int
        Random starts that were made.
    doubt : str
        What speaks against that these are all; empty where nothing does.
    notes : tuple of str
        What one should know.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("ur5")
    >>> len(pinsing.inverse(arm, [0.3, 0.2, 0.4, 3, 0.2, 0.1]))
    8
    """

    schema: ClassVar[str] = "pinsing/inverse/1"
    _items: ClassVar[str] = "solutions"
    made_by: ClassVar[str] = "pinsing.inverse(arm, pose)"

    arm: ArmSummary
    position: Array
    rotation: Array | None
    fixed: dict[str, float]
    solutions: tuple[InverseSolution, ...]
    starts: int
    doubt: str
    notes: tuple[str, ...]

    @property
    def certified(self) -> int:
        """Number of different regular solutions that are proven to exist."""
        kept: list[InverseSolution] = []
        for s in self.solutions:
            gaps = (np.linalg.norm(self.arm.space.wrap(s.q - k.q)) - k.radius for k in kept)
            if s.radius < min(gaps, default=math.inf):
                kept.append(s)
        return len(kept)

    @property
    def q(self) -> Array:
        """All of them, (K, n)."""
        return np.array([s.q for s in self.solutions]).reshape(-1, len(self.arm.joints))

    @checked
    def text(self, degrees: bool = False) -> str:
        """Return the answer in lines of text.

        Parameters
        ----------
        degrees : bool
            Angles in degrees.

        Examples
        --------
        >>> import pinsing
        >>> arm = pinsing.load("scara")
        >>> print(pinsing.inverse(arm, [9, 0, 0, 0, 0, 0]).text().splitlines()[0])
        no inverse solution was found from 256 starts: the pose seems out of reach
        """
        if not (count := len(self.solutions)):
            head = f"no inverse solution was found from {self.starts} starts"
            lines = [head if self.doubt else f"{head}: the pose seems out of reach"]
        else:
            inside = sum(s.within_limits for s in self.solutions)
            lines = [
                f"{count} inverse solution{'s' * (count != 1)} found from {self.starts} starts, "
                f"{inside} within the joint limits"
            ]
        for k, s in enumerate(self.solutions, 1):
            lines.append(f"{k:>4}  {typed(s.q, self.arm.prismatic, degrees, digits=6)}{s.doubts}")
        if self.doubt:
            lines.append(f"note: {self.doubt}")
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])


ENOUGH = 5
"""A solution that was met so often has a share of the starts that is not small."""


class FoundSolutions:
    """Solutions so far, each with how often it was met."""

    def __init__(self, solver: Solver) -> None:
        self.solver, self.arm = solver, solver.arm
        numbers = [(name, float) for name in ("left", "measure", "sign", "hits")]
        self.met = np.empty(0, [("q", float, (solver.arm.n,)), *numbers])

    def add(self, Q: Array, left: Array) -> None:
        """Sort reached configurations into known and new ones."""
        # Close ones are one, unless both are regular and their determinants differ in sign: near a
        # singularity solutions come in such pairs.
        new = np.zeros(len(Q), self.met.dtype)
        new["q"], new["left"], new["hits"] = self.arm.space.wrap(Q), left, 1
        new["measure"] = self._measure(new["q"])
        if len(self.solver.task.rows) == len(self.solver.free):  # elsewhere it is noise
            new["sign"] = np.where(new["measure"] > ALIKE, self.solver.signs(new["q"]), 0.0)
        for one in new:
            gap = np.abs(self.arm.space.wrap(self.met["q"] - one["q"])).max(axis=1)
            gap[self.met["sign"] * one["sign"] < 0] = np.inf
            if gap.min(initial=np.inf) < 1e-4:
                k = int(gap.argmin())
                self.met["hits"][k] += 1
                one["hits"] = self.met["hits"][k]
                if one["left"] < self.met["left"][k]:
                    self.met[k] = one
            elif len(self.met) < 4096:
                self.met = np.append(self.met, one)

    def _measure(self, Q: Array) -> Array:
        """sigma_r / sigma_1 (N,): where joints are held the less of the arm's and the others'."""
        own = ratios(self.arm, Q)
        if len(self.solver.free) == self.arm.n or not len(Q):
            return own
        sizes = np.linalg.svd(self.solver.linear(Q)[1], compute_uv=False)
        others = sizes[:, generic_rank(self.arm) - 1] / np.maximum(sizes[:, 0], 1e-300)
        return np.asarray(np.minimum(own, others))

    def clear(self) -> bool:
        """Return True if there are some, and none is nearly double, as next to a singularity."""
        return len(self.met) > 0 and bool(self.met["measure"].min() > 1e-4)

    @property
    def lacking(self) -> int:
        """Return the number of missing solutions with a positive determinant; below 0: negative."""
        # If all free joints turn endlessly, joint space is compact and poses are not: the map has
        # degree zero, with as many regular solutions of either sign. Zero where that says nothing.
        rows, sign = self.solver.task.rows, self.met["sign"]
        square = len(rows) == len(self.solver.free) and (rows == POSE or max(rows) < 3)
        if not square or self.arm.prismatic[self.solver.free].any():
            return 0
        return -round(sign.sum()) if sign.all() else 0

    def settled(self) -> bool:
        """Return True if every regular solution was met several times, and none is missing."""
        often = (self.met["hits"] >= ENOUGH) | (self.met["measure"] <= ALIKE)
        return len(often) > 0 and bool(often.all()) and not self.lacking

    def judged(self) -> tuple[InverseSolution, ...]:
        """Return those within the limits first, best conditioned first; not all singular ones."""
        arm, held, measure = self.arm, self.solver.held, self.met["measure"]
        Q = np.where(np.isnan(held), arm.fold(self.met["q"]), held)
        regular: Bool = measure > ALIKE
        outside: Bool = np.asarray(arm.space.outside(Q).any(axis=1))
        outside |= bool(np.any((held < arm.lower) | (held > arm.upper)))
        sure = np.where(regular, radii(self.solver, Q), math.inf)
        # Flips of a wrist are conditioned alike: rounding must not order them.
        order = np.lexsort((*np.round(Q.T[::-1], 6), -np.round(measure, 9), outside))
        few = np.cumsum(~regular[order]) <= 32
        return tuple(
            InverseSolution(
                q=Q[k],
                regular=bool(regular[k]),
                sigma_ratio=float(measure[k]),
                within_limits=not bool(outside[k]),
                met=int(self.met["hits"][k]),
                error=float(self.met["left"][k]),
                radius=float(sure[k]),
            )
            for k in order[regular[order] | few]
        )


def drawn(solver: Solver, count: int, rng: np.random.Generator, lacking: int) -> Array:
    """Return random configurations (count, n) over whole circles: limits are judged after."""
    # Of the sign of the determinant that lacks, if possible.
    Q = solver.arm.space.sample(count * (4 if lacking else 1), rng, True)
    Q = np.where(np.isnan(solver.held), Q, solver.held)
    if lacking:
        Q = Q[np.argsort(solver.signs(Q) * lacking <= 0, kind="stable")][:count]
    return Q


STARTS = 256
MOST_STARTS = 4096


@checked
def inverse(
    arm: Arm,
    pose: ArrayLike,
    *,
    fixed: Mapping[str, float] | None = None,
    starts: int = STARTS,
    seed: int = 0,
    near: ArrayLike | None = None,
) -> InverseSolutions:
    """Find all inverse solutions of a pose.

    Arms that EAIK knows are solved by it (see the module), and next to a singular wrist by starts
    beside what it has in the sense of least squares; random starts then only check that.

    Otherwise, damped Newton steps (Levenberg, 1944; Marquardt, 1963) from random starts, all at
    once. The starts are doubled until every solution was met several times, since one that is met
    k times out of N has a share of about k / N of the starts: a solution that was never met has a
    small one. Where all joints turn as many solutions must have a positive determinant as a
    negative one: where they do not, starts are drawn with the sign that lacks. That is no proof;
    `InverseSolutions.doubt` says where it is weak.

    Solutions are counted modulo whole turns, and one copy of each is given: a joint that turns has
    its value from -pi to pi where the limits hold that, else the one nearest to the middle of the
    limits. Where limits are wider than a turn they hold other copies too, which may be in other
    aspects: `posture_changes` looks at all of them.

    Parameters
    ----------
    arm : Arm
        A serial arm; its task says what of the pose counts.
    pose : (3,), (6,) or (4, 4) array_like
        Position in the base frame (the rotation of the tip then does not count, or is that of
        the base); position and roll, pitch, yaw; or a homogeneous matrix.
    fixed : mapping of str to float, optional
        Joints to hold, by name, where the arm has more joints than the task has conditions.
    starts : int
        Random starts to begin with; an eighth of them where EAIK gave all solutions.
    seed : int
        Of the starts.
    near : (n,) or (N, n), or (nq,) or (N, nq) array_like, optional
        Configurations to start from as well: one that reaches the pose is among the solutions.

    Returns
    -------
    InverseSolutions
        None of them where the pose is out of reach: that is an answer.

    Raises
    ------
    ConfigurationError
        If the pose makes no sense, or a joint is held, or a start of ``near`` is, at no number.
    OptionError
        If joints and conditions do not agree in number: the message says how many to hold.
    UnknownNameError
        If there is no joint of a name in ``fixed``.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("puma560")
    >>> found = pinsing.inverse(arm, [0.4, 0.2, 0.3, 0.1, 0.2, 0.3])
    >>> len(found), all(s.regular for s in found)
    (8, True)
    """
    whole_number(starts, "starts", 1, 1_000_000)
    whole_number(seed, "seed", 0, MAX_SEED)
    position, rotation = read_pose(pose)
    if not any(r >= 3 for r in arm.task.rows):
        rotation = None
    elif rotation is None:
        rotation = np.eye(3)
    held, rank = _held(arm, fixed or {}), generic_rank(arm)
    free = int(np.isnan(held).sum())
    OptionError.refuse_if(
        not arm.task.places,
        f"task {arm.task} only says how the tip moves, not where it is: a pose needs all "
        "rows of a translation or rotation, or base axes, or tool-axis",
    )
    if free != rank:
        more = free - rank
        need = f"hold {more} more with fixed={{...}}" if more > 0 else "hold fewer"
        raise OptionError(
            f"{free} joints are free and task {arm.task} has {rank} conditions that they can "
            f"meet: {need} (joints: {', '.join(arm.joints)})"
        )
    solver, rng = Solver(arm, position, rotation, held), np.random.default_rng(seed)
    found, alone, rough = FoundSolutions(solver), free == arm.n, np.empty((0, arm.n))
    first, known = starts, -1
    robot = decomposed(arm) if alone and arm.task.name == "pose" else None
    if robot is not None:
        turned = np.eye(3) if rotation is None else rotation
        _, said, (answer,) = robot(homogeneous(position, turned)[None])
        inexact = np.array(answer.is_LS, dtype=bool)
        # In the sense of least squares only: next to a singular wrist all of its solutions are.
        rough, said = said[inexact], said[~inexact]
        found.add(*solver.solve(said))
        if len(said) == len(found.met) and found.clear():
            # Share of the random starts that check solutions by EAIK: one in so many.
            known, first = len(found.met), max(1, starts // 8)
    if near is not None:
        own = arm.check_many(near, "near")
        found.add(*solver.solve(np.where(np.isnan(held), own, held), remember=True))
    made, most = 0, max(starts, min(MOST_STARTS, 16 * starts))
    count = first
    while made < most:
        Q = drawn(solver, count, rng, found.lacking)
        found.add(*solver.solve(np.concatenate([rough, Q]), remember=True))
        if len(rough):
            found.add(*solver.solve(solver.beside(rng)))
            rough = rough[:0]
        made += count
        nothing = not len(found.met) and made >= starts
        if len(found.met) == known or nothing or found.settled():
            break
        count = min(max(made, starts - made), most - made)
    solutions = found.judged()
    notes = [
        f"{arm.joints[j]} is held at {held[j]:.6g}, outside its limits {arm.lower[j]:.6g} to "
        f"{arm.upper[j]:.6g}: so is every solution"
        for j in np.flatnonzero((held < arm.lower) | (held > arm.upper))
    ]
    ladder = ladder_of(nominal(arm)) if alone else None
    regular = sum(s.regular for s in solutions)
    full = ladder is not None and regular == ladder.most
    if ladder is not None and full:
        notes.append(f"there are no more regular ones: {ladder.kind}, at most {ladder.most}")
    return InverseSolutions(
        arm=summarize(arm),
        position=position,
        rotation=rotation,
        fixed={arm.joints[j]: float(held[j]) for j in np.flatnonzero(~np.isnan(held))},
        solutions=solutions,
        starts=made,
        doubt="" if full else _doubt(found, solutions, made, len(found.met) == known),
        notes=tuple(notes),
    )


def _doubt(
    found: FoundSolutions, solutions: tuple[InverseSolution, ...], made: int, known: bool
) -> str:
    """What speaks against that these are all, from ``made`` starts; empty where nothing does."""
    # Of solutions ``known`` in closed form only starts that stalled tell that others are missing.
    stalled = found.solver.doubt(np.array([s.q for s in solutions]).reshape(-1, found.arm.n))
    if known:
        return stalled
    singular = sum(not s.regular for s in solutions)
    if singular > 1:  # there may be a curve of them
        return (
            f"{singular} of them are singular, and such are not isolated in general: they are "
            "examples of perhaps infinitely many"
        )
    if lacking := found.lacking:
        return (
            "where all joints turn as many solutions have a positive determinant as a negative "
            f"one: of these {abs(lacking)} more are {'positive' if lacking < 0 else 'negative'}, "
            "so some were missed"
        )
    if rare := sum(s.regular and s.met < ENOUGH for s in solutions):
        return (
            f"{rare} of them {'was' if rare == 1 else 'were'} met fewer than {ENOUGH} times "
            f"in {made} starts: others may have been missed"
        )
    return stalled


def _held(arm: Arm, fixed: Mapping[str, float]) -> Array:
    held = np.full(arm.n, np.nan)
    for name, value in fixed.items():
        UnknownNameError.refuse_if(name not in arm.joints, "joint", str(name), arm.joints)
        number = float(value)
        if not math.isfinite(number):
            raise ConfigurationError(f"joint {name!r} is held at {number}", joint=name)
        held[arm.joints.index(name)] = number
    return held


# Many poses at once -----------------------------------------------------------------

_NEAR = 1e-2
"""Residual from which a few Newton steps lead to a solution, if there is one."""
_ROWS = 5_000
"""Poses in one call of EAIK: some megabytes."""
Progress = Callable[[int, int], None]


class InverseMany:
    """All inverse solutions on a grid: poses times values of the ``held`` joint, if any."""

    def __init__(self, arm: Arm, held: int | None = None) -> None:
        EngineError.refuse_if(
            not engine.available(),
            f"toolpaths need the compiled kernel: {engine.unavailable_reason()}",
        )
        spare, reaches = arm.n - (held is not None), arm.task.name == "pose"
        reaches = reaches and generic_rank(arm) == 6
        names = list(arm.joints)
        if reaches and arm.n == 7:  # what may be held while the others move the tip in all ways
            J = task_jacobian(arm, np.cos(1.0 + np.arange(arm.n)))
            least = [np.linalg.svd(np.delete(J, j, axis=1))[1][-1] for j in range(arm.n)]
            names = [j for j, sigma in zip(names, least, strict=True) if sigma > PRACTICAL]
        with_it = "" if held is None else f" with {arm.joints[held]} held"
        free = f"; free (--free) may be one of {', '.join(names)}" * (reaches and arm.n == 7)
        OptionError.refuse_if(
            not reaches or spare != 6,
            f"{arm.name}{with_it} has {spare} free joints for the task {arm.task}: a path of "
            f"poses needs six and the task pose{free}",
        )
        OptionError.refuse_if(
            held is not None and arm.joints[held] not in names,
            f"the other joints of {arm.name}{with_it} do not move the tip in all directions{free}",
        )
        self.arm, self.held = arm, held
        self.free = np.array([j for j in range(arm.n) if j != held])
        self.exact = decomposed(arm, held) is not None

    def solve(
        self,
        position: Array,
        rotation: Array,
        values: Array | None = None,
        progress: Progress | None = None,
    ) -> Array:
        """Return solutions (N, G, S, n) at a grid of poses, NaN where there are fewer than S."""
        # Positions (N, G, 3) and rotations (N, G, 3, 3) in the base frame; ``values`` (G,) of the
        # held joint. ``progress`` counts rows or columns.
        solve = self._decomposed if self.exact else self._continued
        return np.ascontiguousarray(_filled(solve(position, rotation, values, progress)))

    def continued(self, Q: Array, position: Array, rotation: Array) -> Array:
        """Return the solutions at poses (M) beside configurations Q (M, n), all joints free."""
        # NaN where Newton's steps lead to none.
        return self._polished(Q.copy(), position, rotation, 1.0, np.arange(self.arm.n))

    def _verified(self, Q: Array, position: Array, rotation: Array) -> Array:
        """Solutions Q (M, S, n) brought to the poses (M), each once; NaN behind them."""
        flat = self._polished(Q.reshape(-1, self.arm.n), position, rotation)
        return _distinct(flat.reshape(Q.shape), self.arm)

    def _decomposed(
        self, position: Array, rotation: Array, values: Array | None, progress: Progress | None
    ) -> Array:
        N, G = position.shape[:2]
        position, rotation = position.reshape(-1, 3), rotation.reshape(-1, 3, 3)
        nodes = np.arange(N * G).reshape(N, G)
        parts = list(nodes.T)  # another robot for each value of the held joint
        if values is None:
            parts = np.array_split(nodes.ravel(), -(-nodes.size // ROWS))

        def solutions(part: Ints, value: float) -> Array:
            robot = decomposed(self.arm, self.held, value)
            if robot is None:
                return np.full((len(part), 1, self.arm.n), np.nan)
            # Solutions in the sense of least squares are among them: forward kinematics tells.
            counts, every, _ = robot(homogeneous(position[part], rotation[part]))
            Q = np.full((len(part), max(1, counts.max()), self.arm.n), np.nan)
            Q[np.arange(Q.shape[1]) < counts[:, None]] = every
            return self._verified(Q, position[part], rotation[part])

        found: list[Array] = []
        with ThreadPoolExecutor(engine.cpu_count()) as pool:
            every = [0.0] * len(parts) if values is None else values
            for q in pool.map(solutions, parts, every):
                found.append(q)
                if progress is not None:
                    progress(len(found), len(parts))
        whole = np.full((nodes.size, max(q.shape[1] for q in found), self.arm.n), np.nan)
        for part, q in zip(parts, found, strict=True):
            whole[part, : q.shape[1]] = q
        return whole.reshape(N, G, *whole.shape[1:])

    def _continued(
        self, position: Array, rotation: Array, values: Array | None, progress: Progress | None
    ) -> Array:
        """Solve some nodes one by one, and follow their solutions over the grid, both ways."""
        N, G = position.shape[:2]
        T = homogeneous(position, rotation)
        rows = np.unique(np.linspace(0, N - 1, min(N, 5)).astype(int))
        columns = np.unique(np.linspace(0, G - 1, min(G, 9)).astype(int))
        nodes: dict[tuple[int, int], list[Array]] = {}
        for k, i in product(rows, columns):
            fixed = {} if values is None else {self.arm.joints[self.held or 0]: values[i]}
            nodes[k, i] = [s.q for s in inverse(self.arm, T[k, i], fixed=fixed) if s.regular]
        slots = 2 * max(1, *map(len, nodes.values()))
        Q = np.full((N, G, slots, self.arm.n), np.nan)
        for (k, i), q in nodes.items():
            Q[k, i, : len(q)] = np.reshape(q, (-1, self.arm.n))

        def follow(to: tuple[Any, ...], source: Array) -> None:
            """Continue solutions (M, S, n) of neighbours to the nodes ``to`` that lack them."""
            source, there = _filled(source).copy(), _filled(Q[to])
            gaps = np.abs(self.arm.space.wrap(source[:, :, None] - there[:, None])).max(axis=-1)
            # A solution within 0.05 rad continues that of a neighbour; NaN is near nothing.
            source[(gaps < 0.05).any(axis=2)] = np.nan
            lacking = np.isfinite(source[..., 0]).any(axis=1)
            to, source = tuple(x[lacking] for x in to), source[lacking]
            if values is not None:
                here = np.broadcast_to(values, (N, G))[to]
                source[..., self.held] = np.where(
                    np.isfinite(source[..., 0]), here[:, None], np.nan
                )
            flat = source.reshape(-1, self.arm.n)
            moved = self._polished(flat, position[to], rotation[to], near=1.0)
            both = np.concatenate([Q[to], moved.reshape(source.shape)], axis=1)
            Q[to] = _distinct(both, self.arm)[..., :slots, :]

        for sweep in (range(1, 2 * G), range(2 * G, 0, -1)):  # round the circle, both ways
            for i in sweep:
                to = i % G
                near = (i - 1) % G if sweep.step > 0 else (i + 1) % G
                if values is None or abs(to - near) == 1:
                    follow((rows, np.full(len(rows), to)), Q[rows, near])
        every = np.arange(G)
        for sweep in (range(1, N), range(N - 2, -1, -1)):
            for k in sweep:
                follow((np.full(G, k), every), Q[k - sweep.step])
                if progress is not None:
                    progress(k, N)
        flat = Q.reshape(-1, slots, self.arm.n)
        return self._verified(flat, position.reshape(-1, 3), rotation.reshape(-1, 3, 3)).reshape(
            Q.shape
        )

    def _polished(
        self,
        Q: Array,
        position: Array,
        rotation: Array,
        near: float = _NEAR,
        free: Ints | None = None,
    ) -> Array:
        """Move Q (M S, n) to the poses (M), in place, by Newton steps; NaN where that fails."""
        # Least squares near no solution stay where they are, and are none.
        arm, free, slower = self.arm, self.free if free is None else free, near / _NEAR
        chain, moving = flatten(arm), np.isin(np.arange(arm.n), free)
        poses = map(np.ascontiguousarray, (position, rotation))
        how = arm.length_scale, ROUNDING, near, slower, Q, engine.cpu_count()
        engine.module().to_poses(chain.R, chain.t, chain.prismatic, moving, *poses, *how)
        return Q


def _filled(Q: Array) -> Array:
    """Return nodes (..., S, n) without the slots at the end that none of them needs."""
    return Q[..., : max(1, int(np.isfinite(Q[..., 0]).sum(axis=-1).max(initial=0))), :]


def _distinct(Q: Array, arm: Arm) -> Array:
    """Solutions Q (M, S, n), in place, within limits where whole turns allow it, each once."""
    how = *arm.space.span, ROUNDING, PRACTICAL, engine.cpu_count()
    engine.module().distinct(Q, arm.space.prismatic, *how)
    return Q
