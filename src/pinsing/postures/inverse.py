"""inverse: all joint values that bring the tip to a pose."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._types import Array, Bool, Ints
from pinsing.arguments import MAX_SEED, checked, whole_number
from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.geometry.nominal import nominal
from pinsing.joint_text import typed
from pinsing.kinematics.verdict import generic_rank, ratios
from pinsing.postures.kantorovich import radii
from pinsing.postures.ladder import ladder_of
from pinsing.postures.newton import Solver
from pinsing.robot.arm import Arm
from pinsing.robot.arm_summary import ArmSummary, summarize
from pinsing.serialization import JsonResult

STARTS = 256
MOST_STARTS = 4096

_APART = 1e-4
_ENOUGH = 5
_SINGULAR_LISTED = 32
_REGULAR = 1e-6
"""sigma_r / sigma_1 above which a solution is regular: of a singular one half the digits hold."""


@dataclass(frozen=True, eq=False)
class InverseSolution:
    """One configuration that reaches the pose.

    Attributes
    ----------
    q : (n,) array
        Joint values; by whole turns within the limits where that can be.
    regular : bool
        Whether it is not singular: then it is isolated, and moves smoothly with the pose.
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
        of q in joint space (`pinsing.postures.kantorovich`); infinite where that is not proven.
    """

    q: Array
    regular: bool
    sigma_ratio: float
    within_limits: bool
    met: int
    error: float
    radius: float = field(default=math.inf, metadata={"optional": True})


@dataclass(frozen=True, eq=False)
class InverseSolutions(JsonResult):
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
        What speaks against that these are all; empty where every one was met several times.
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
    made_by: ClassVar[str] = "pinsing.inverse(arm, pose)"

    arm: ArmSummary
    position: Array
    rotation: Array | None
    fixed: dict[str, float]
    solutions: tuple[InverseSolution, ...]
    starts: int
    doubt: str
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.solutions)

    def __iter__(self) -> Iterator[InverseSolution]:
        return iter(self.solutions)

    def __getitem__(self, index: int) -> InverseSolution:
        return self.solutions[index]

    @property
    def certified(self) -> int:
        """How many different regular solutions are proven to exist: there are no fewer."""
        turns = ~self.arm.prismatic
        kept: list[InverseSolution] = []
        for s in self.solutions:
            apart = math.isfinite(s.radius)
            for k in kept:
                gap = s.q - k.q
                gap[turns] = np.remainder(gap[turns] + math.pi, 2 * math.pi) - math.pi
                apart &= bool(np.linalg.norm(gap) > s.radius + k.radius)
            if apart:
                kept.append(s)
        return len(kept)

    @property
    def q(self) -> Array:
        """All of them, (K, n)."""
        n = len(self.arm.joints)
        return np.array([s.q for s in self.solutions]).reshape(-1, n)

    @checked
    def text(self, degrees: bool = False) -> str:
        """Lines for people.

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
        count = len(self.solutions)
        if not count:
            head = f"no inverse solution was found from {self.starts} starts"
            lines = [f"{head}: the pose seems out of reach"]
        else:
            inside = sum(s.within_limits for s in self.solutions)
            lines = [
                f"{count} inverse solution{'s' * (count != 1)} found from {self.starts} starts, "
                f"{inside} within the joint limits"
            ]
        for k, s in enumerate(self.solutions, 1):
            said = [] if s.regular else ["SINGULAR"]
            said += [] if s.within_limits else ["outside the limits"]
            tail = f"   ({', '.join(said)})" if said else ""
            lines.append(f"{k:>4}  {typed(s.q, self.arm.prismatic, degrees, digits=6)}{tail}")
        if self.doubt:
            lines.append(f"note: {self.doubt}")
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])

    def __str__(self) -> str:
        return self.text()


@checked
def inverse(
    arm: Arm,
    pose: npt.ArrayLike,
    *,
    fixed: Mapping[str, float] | None = None,
    starts: int = STARTS,
    seed: int = 0,
) -> InverseSolutions:
    """Find all inverse solutions of a pose.

    Damped Newton steps (Levenberg, 1944; Marquardt, 1963) from random starts, all at once; the
    starts are doubled until every solution was met several times, since one that is met k times
    out of N has a share of about k / N of the starts: a solution that was never met has a small
    one. That is no proof; `InverseSolutions.doubt` says where it is weak.

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
        Random starts to begin with.
    seed : int
        Of the starts.

    Returns
    -------
    InverseSolutions
        None of them where the pose is out of reach: that is an answer.

    Raises
    ------
    ConfigurationError
        If the pose makes no sense.
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
    position, rotation = _target(arm, pose)
    held = _held(arm, fixed or {})
    free = np.flatnonzero(np.isnan(held))
    rank = generic_rank(arm)
    if len(free) != rank:
        more = len(free) - rank
        need = f"hold {more} more with fixed={{...}}" if more > 0 else "hold fewer"
        raise OptionError(
            f"{len(free)} joints are free and task {arm.task} has {rank} conditions that they can "
            f"meet: {need} (joints: {', '.join(arm.joints)})"
        )
    solver = Solver.of(arm, position, rotation, held, free)
    rng = np.random.default_rng(seed)
    found = _Found(arm, free)
    made, most = 0, max(starts, min(MOST_STARTS, 16 * starts))
    while made < most:
        count = min(starts if made == 0 else made, most - made)
        Q = _drawn(arm, held, count, rng)
        found.add(*solver.solve(Q))
        made += count
        if not found.hits and made >= starts:
            break
        if found.settled():
            break
    solutions = _judged(arm, found, solver)
    notes = []
    ladder = ladder_of(nominal(arm)) if len(free) == arm.n else None
    count = sum(s.regular for s in solutions)
    odd = _odd(arm, np.array([s.regular for s in solutions], dtype=bool))
    full = ladder is not None and count == ladder.most
    if ladder is not None and full:
        notes.append(f"there are no more regular ones: {ladder.kind}, at most {ladder.most}")
    curves = sum(not s.regular for s in solutions)
    if curves > 1:
        notes.append(
            "singular solutions are not isolated in general: those given are examples of them"
        )
    return InverseSolutions(
        arm=summarize(arm),
        position=position,
        rotation=rotation,
        fixed={arm.joints[j]: float(held[j]) for j in np.flatnonzero(~np.isnan(held))},
        solutions=solutions,
        starts=made,
        doubt="" if full else _doubt(solutions, made, odd),
        notes=tuple(notes),
    )


def _odd(arm: Arm, regular: Bool) -> bool:
    """Whether regular solutions are odd in number where that cannot be.

    Where all joints turn and do not end, joint space is compact and poses are not: the map has
    degree zero, and as many regular solutions have a positive determinant as a negative one.
    """
    whole = arm.n == len(arm.task.rows) and not arm.prismatic.any()
    return whole and bool(regular.all()) and int(regular.sum()) % 2 == 1


def _doubt(solutions: tuple[InverseSolution, ...], made: int, odd: bool) -> str:
    rare = [s.met for s in solutions if s.regular and s.met < _ENOUGH]
    if odd:
        return "their number is odd, and where all joints turn it is even: one was missed"
    if not rare:
        return ""
    return (
        f"{len(rare)} of them {'was' if len(rare) == 1 else 'were'} met fewer than {_ENOUGH} times "
        f"in {made} starts: others may have been missed"
    )


def _target(arm: Arm, pose: npt.ArrayLike) -> tuple[Array, Array | None]:
    given = np.array(pose, dtype=float)
    if not np.isfinite(given).all():
        raise ConfigurationError("the pose has a value that is not finite")
    turns = any(r >= 3 for r in arm.task.rows)
    if given.shape == (3,):
        return given, np.eye(3) if turns else None
    if given.shape == (6,):
        return given[:3], np.array(pin.rpy.rpyToMatrix(*given[3:])) if turns else None
    if given.shape == (4, 4):
        R = given[:3, :3]
        proper = np.abs(R @ R.T - np.eye(3)).max() < 1e-6 and np.linalg.det(R) > 0
        if proper and np.allclose(given[3], [0, 0, 0, 1]):
            u, _, v = np.linalg.svd(R)
            return given[:3, 3], u @ v if turns else None
        raise ConfigurationError("the 4 x 4 matrix is not a rotation and a translation")
    raise ConfigurationError(
        "one pose is 3 numbers (x, y, z), 6 (and roll, pitch, yaw) or a 4 x 4 matrix; "
        f"got shape {given.shape}"
    )


def _held(arm: Arm, fixed: Mapping[str, float]) -> Array:
    held = np.full(arm.n, np.nan)
    for name, value in fixed.items():
        if name not in arm.joints:
            raise UnknownNameError("joint", str(name), arm.joints)
        number = float(value)
        if not math.isfinite(number):
            raise ConfigurationError(f"joint {name!r} is held at {number}", joint=name)
        held[arm.joints.index(name)] = number
    return held


def _drawn(arm: Arm, held: Array, count: int, rng: np.random.Generator) -> Array:
    """Random configurations over whole circles, whatever the limits: those are judged after."""
    Q = arm.space.sample(count, rng, True)
    return np.where(np.isnan(held), Q, held)


class _Found:
    """Solutions so far, each with how often it was met."""

    def __init__(self, arm: Arm, free: Ints) -> None:
        self.arm, self.free = arm, free
        self.q: list[Array] = []
        self.left: list[float] = []
        self.hits: list[int] = []

    def add(self, Q: Array, left: Array) -> None:
        """Sort reached configurations into those known and new ones."""
        Q = self.arm.space.wrap(Q)
        for q, e in zip(Q, left, strict=True):
            if self.q:
                gap = np.abs(self.arm.space.wrap(np.array(self.q) - q)).max(axis=1)
                k = int(np.argmin(gap))
                if gap[k] < _APART:
                    self.hits[k] += 1
                    if e < self.left[k]:
                        self.q[k], self.left[k] = q, float(e)
                    continue
            if len(self.q) < 4096:
                self.q.append(q)
                self.left.append(float(e))
                self.hits.append(1)

    def settled(self) -> bool:
        """Whether every regular solution was met several times."""
        if not self.q:
            return False
        regular = ratios(self.arm, np.array(self.q)) > _REGULAR
        if _odd(self.arm, regular):
            return False
        return bool((np.array(self.hits)[regular] >= _ENOUGH).all())


def _judged(arm: Arm, found: _Found, solver: Solver) -> tuple[InverseSolution, ...]:
    if not found.q:
        return ()
    Q = arm.fold(np.array(found.q))
    measure = ratios(arm, Q)
    regular: Bool = np.greater(measure, _REGULAR)
    outside: Bool = np.asarray(arm.space.outside(Q).any(axis=1))
    sure = radii(solver, Q)
    order = np.lexsort((-measure, outside))
    out, singular = [], 0
    for k in order:
        singular += not regular[k]
        if not regular[k] and singular > _SINGULAR_LISTED:
            continue
        out.append(
            InverseSolution(
                q=Q[k],
                regular=bool(regular[k]),
                sigma_ratio=float(measure[k]),
                within_limits=not bool(outside[k]),
                met=found.hits[k],
                error=found.left[k],
                radius=float(sure[k]) if regular[k] else math.inf,
            )
        )
    return tuple(out)
