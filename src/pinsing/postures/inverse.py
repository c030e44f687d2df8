"""inverse: all joint values that bring the tip to a pose."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.arguments import MAX_SEED, checked, whole_number
from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.kinematics.jacobian import read_pose
from pinsing.kinematics.verdict import generic_rank
from pinsing.postures.decomposed import decomposed, exactly
from pinsing.postures.exact_chain import turns
from pinsing.postures.inverse_solutions import (
    ENOUGH,
    FoundSolutions,
    InverseSolution,
    InverseSolutions,
)
from pinsing.postures.ladder import ladder_of
from pinsing.postures.newton import Solver, Stalled
from pinsing.robot.arm import Arm, summarize
from pinsing.robot.nominal import nominal

_FREE = 1e-9


def drawn(
    arm: Arm, held: Array, count: int, rng: np.random.Generator, solver: Solver, lacking: int
) -> Array:
    """Random configurations (count, n) over whole circles: limits are judged after.

    Where solutions with one sign of the determinant lack, all starts have that sign, if it can be.
    """
    Q = arm.space.sample(count * (4 if lacking else 1), rng, True)
    Q = np.where(np.isnan(held), Q, held)
    if lacking:
        other = solver.signs(Q) * lacking <= 0
        Q = Q[np.argsort(other, kind="stable")][:count]
    return Q


def mirrored(solver: Solver, Q: Array) -> Array:
    """Mirror images (K, n) of configurations (N, n), near which other solutions often are.

    A wrist: of three axes the middle one takes the other value that leaves the angle of the outer
    ones, and these follow, so that the rotation stays. An elbow: a joint takes the other value
    that leaves the distance of its neighbours; the one before brings the farther one back into
    its direction, and the one after takes the turn back.
    """
    n, free = Q.shape[1], set(solver.free.tolist())
    turning = [j in free and not solver.chain.prismatic[j] for j in range(n)]
    out = [Q[:0]]
    for j in range(1, n - 1):
        if all(turning[j - 1 : j + 2]):
            out += [f(solver, Q, j) for f in (_mirrored_wrist, _mirrored_elbow)]
    return np.concatenate(out)


def _angle(v: Array) -> Array:
    return np.asarray(np.arctan2(v[..., 1], v[..., 0]))


def _mirrored_wrist(solver: Solver, Q: Array, j: int) -> Array:
    A, B = solver.chain.R[j], solver.chain.R[j + 1]
    a = A[2, 0] * B[0, 2] + A[2, 1] * B[1, 2]
    b = A[2, 1] * B[0, 2] - A[2, 0] * B[1, 2]
    if np.hypot(a, b) < _FREE:
        return Q[:0]
    X = Q.copy()
    X[:, j] = 2 * np.arctan2(b, a) - Q[:, j]
    was, now = (A @ turns(x[:, j]) @ B for x in (Q, X))
    X[:, j - 1] += _angle(was[:, :2, 2]) - _angle(now[:, :2, 2])
    X[:, j + 1] += _angle(now[:, 2, :2]) - _angle(was[:, 2, :2])
    return X


def _mirrored_elbow(solver: Solver, Q: Array, j: int) -> Array:
    C, inner, outer = solver.chain.R[j], solver.chain.t[j], solver.chain.t[j + 1]
    r = C.T @ inner
    a, b = r[:2] @ outer[:2], r[1] * outer[0] - r[0] * outer[1]
    if np.hypot(a, b) < _FREE * solver.scale**2:
        return Q[:0]
    X = Q.copy()
    X[:, j] = 2 * np.arctan2(b, a) - Q[:, j]
    was, now = (inner + turns(x[:, j]) @ outer @ C.T for x in (Q, X))
    X[:, j - 1] += _angle(was) - _angle(now)
    before, after = (np.sign(solver.chain.R[k][2, 2]) for k in (j, j + 1))
    bent = before * (X[:, j - 1] - Q[:, j - 1]) + X[:, j] - Q[:, j]
    X[:, j + 1] -= after * bent
    return X


STARTS = 256
MOST_STARTS = 4096


@checked
def inverse(
    arm: Arm,
    pose: npt.ArrayLike,
    *,
    fixed: Mapping[str, float] | None = None,
    starts: int = STARTS,
    seed: int = 0,
    near: npt.ArrayLike | None = None,
) -> InverseSolutions:
    """Find all inverse solutions of a pose.

    Arms that EAIK knows are solved by it (`pinsing.postures.decomposed`); random starts then only
    check that.

    Otherwise, damped Newton steps (Levenberg, 1944; Marquardt, 1963) from random starts, all at
    once, and from mirror images of each solution found. The starts are doubled until every
    solution was met several times, since one that is met k times out of N has a share of about
    k / N of the starts: a solution that was never met has a small one. Where all joints turn as
    many solutions must have a positive determinant as a negative one: where they do not, starts
    are drawn with the sign that lacks. That is no proof; `InverseSolutions.doubt` says where it
    is weak.

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
    position, rotation = _target(arm, pose)
    held = _held(arm, fixed or {})
    free = np.flatnonzero(np.isnan(held))
    rank = generic_rank(arm)
    if not arm.task.places:
        raise OptionError(
            f"task {arm.task} only says how the tip moves, not where it is: a pose needs all "
            "rows of a translation or rotation, or base axes, or tool-axis"
        )
    if len(free) != rank:
        more = len(free) - rank
        need = f"hold {more} more with fixed={{...}}" if more > 0 else "hold fewer"
        raise OptionError(
            f"{len(free)} joints are free and task {arm.task} has {rank} conditions that they can "
            f"meet: {need} (joints: {', '.join(arm.joints)})"
        )
    solver = Solver.of(arm, position, rotation, held, free)
    rng = np.random.default_rng(seed)
    found, stalled = FoundSolutions(solver, arm, held), Stalled(arm.space)
    geometry = nominal(arm)
    alone = len(free) == arm.n
    first, known = starts, -1
    robot = decomposed(arm) if alone and arm.task.name == "pose" else None
    if robot is not None:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = (np.eye(3) if rotation is None else rotation), position
        said = robot.IK(pose)
        found.add(*solver.solve(exactly(said, arm.n)))
        if len(said.Q) == len(found.q) and found.clear():
            # Share of the random starts that check solutions by EAIK: one in so many.
            known, first = len(found.q), max(1, starts // 8)
    if near is not None:
        own = arm.check_many(near, "near")
        found.add(*solver.solve(np.where(np.isnan(held), own, held), stalled=stalled))
    made, most = 0, max(starts, min(MOST_STARTS, 16 * starts))
    count = first
    while made < most:
        Q = drawn(arm, held, count, rng, solver, found.lacking)
        found.add(*solver.solve(Q, stalled=stalled))
        made += count
        if len(found.q) == known:
            break
        found.follow(lambda Q: mirrored(solver, Q))
        if (not found.q and made >= starts) or found.settled():
            break
        count = min(max(made, starts - made), most - made)
    solutions = found.judged()
    notes = list(_beyond(arm, held))
    ladder = ladder_of(geometry) if alone else None
    regular = sum(s.regular for s in solutions)
    full = ladder is not None and regular == ladder.most
    if ladder is not None and full:
        notes.append(f"there are no more regular ones: {ladder.kind}, at most {ladder.most}")
    sure = full or len(found.q) == known
    return InverseSolutions(
        arm=summarize(arm),
        position=position,
        rotation=rotation,
        fixed={arm.joints[j]: float(held[j]) for j in np.flatnonzero(~np.isnan(held))},
        solutions=solutions,
        starts=made,
        doubt=""
        if sure
        else _examples(len(solutions) - regular)
        or _doubt(solutions, made, found.lacking)
        or stalled.doubt(np.array([s.q for s in solutions])),
        notes=tuple(notes),
    )


def _examples(singular: int) -> str:
    """Where there are several singular solutions, there may be a curve of them."""
    if singular < 2:
        return ""
    return (
        f"{singular} of them are singular, and such are not isolated in general: they are examples "
        "of perhaps infinitely many"
    )


def _doubt(solutions: tuple[InverseSolution, ...], made: int, lacking: int) -> str:
    rare = [s.met for s in solutions if s.regular and s.met < ENOUGH]
    if lacking:
        return (
            "where all joints turn as many solutions have a positive determinant as a negative "
            f"one: of these {abs(lacking)} more are {'positive' if lacking < 0 else 'negative'}, "
            "so some were missed"
        )
    if not rare:
        return ""
    return (
        f"{len(rare)} of them {'was' if len(rare) == 1 else 'were'} met fewer than {ENOUGH} times "
        f"in {made} starts: others may have been missed"
    )


def _target(arm: Arm, pose: npt.ArrayLike) -> tuple[Array, Array | None]:
    position, rotation = read_pose(pose)
    if not any(r >= 3 for r in arm.task.rows):
        return position, None
    return position, np.eye(3) if rotation is None else rotation


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


def _beyond(arm: Arm, held: Array) -> Iterator[str]:
    """Say which joints are held outside their limits."""
    for j in np.flatnonzero((held < arm.lower) | (held > arm.upper)):
        yield (
            f"{arm.joints[j]} is held at {held[j]:.6g}, outside its limits "
            f"{arm.lower[j]:.6g} to {arm.upper[j]:.6g}: so is every solution"
        )
