"""All ways in which the legs of a mechanism reach one pose of the output.

With the pose given, legs do not know of each other: each is solved alone, and what the whole can
do is the product.
"""

from __future__ import annotations

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool
from pinsing.loops.batch import BatchLoops, newton
from pinsing.loops.closure import Loops
from pinsing.loops.likeness import likeness, same
from pinsing.loops.structure import Leg, structure
from pinsing.robot.mechanism import Mechanism

_STARTS = 24
_CLOSED = 1e-9
_EQUAL = 1e-5
_FREE = 1e-6
_POINTS = 8


@dataclass(frozen=True, eq=False)
class LegMode:
    """Solutions of one leg that differ in flipped passive joints only.

    Attributes
    ----------
    q : (n,) array
        One of them; joints of other legs have no meaning.
    ways : int
        How many were found.
    loose : bool
        Whether the leg moves by itself there, and this is one point for a curve of them.
    """

    q: Array
    ways: int
    loose: bool = False


def leg_modes(
    mechanism: Mechanism, reached: Array, free: Bool, rng: np.random.Generator
) -> list[list[list[LegMode]]]:
    """Solutions within the limits, for each configuration, for each leg.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    reached : (N, n) array
        Closed configurations; the pose of the output there is the one to reach.
    free : (n,) array of bool
        Joints that may move; the others stay as in ``reached``.
    rng : Generator
        For the starts.
    """
    loops = BatchLoops(mechanism)
    legs = structure(mechanism).legs
    by_leg = [_solutions(loops, leg, reached, free, rng) for leg in legs]
    return [[by_leg[k][i] for k in range(len(legs))] for i in range(len(reached))]


def _solutions(
    loops: BatchLoops, leg: Leg, reached: Array, free: Bool, rng: np.random.Generator
) -> list[list[LegMode]]:
    mechanism = loops.mechanism
    mine = np.isin(np.arange(mechanism.n), leg.joints) & free
    count = len(reached)
    starts = np.repeat(reached, _STARTS, axis=0)
    low, high = mechanism.space.span
    drawn = rng.uniform(low, high, starts.shape)
    # The first start is the configuration itself.
    drawn[::_STARTS] = reached
    starts[:, mine] = drawn[:, mine]
    R, p, _ = loops.output(reached)
    pose = np.repeat(np.arange(count), _STARTS)
    found: list[list[Array]] = [[] for _ in range(count)]
    for _ in range(3):
        Q, size = _close(loops, leg, starts, mine, R[pose], p[pose])
        fresh: list[tuple[int, Array]] = []
        for i, q, error in zip(pose.tolist(), Q, size, strict=True):
            if error <= _CLOSED and _add(mechanism, found[i], q):
                fresh.append((i, q))
        flips = [(i, x) for i, q in fresh for x in _flipped(mechanism, q, mine)]
        if not flips:
            break
        pose = np.array([i for i, _ in flips])
        starts = np.array([x for _, x in flips])
    grouped = [_grouped(mechanism, leg, mine, solutions) for solutions in found]
    return [_without_curves(mechanism, mine, modes) for modes in grouped]


def _without_curves(mechanism: Mechanism, mine: Bool, modes: list[LegMode]) -> list[LegMode]:
    """Of many configurations at which the leg moves by itself, one: they are points of curves."""
    if len(modes) <= _POINTS:
        return modes
    loops = Loops(mechanism)
    loose = []
    for mode in modes:
        rows = np.vstack([loops.scaled(mode.q)[1], loops.output(mode.q)[1]])[:, mine]
        sigma = np.linalg.svd(rows, compute_uv=False)
        loose.append(len(sigma) < mine.sum() or bool(sigma[-1] <= _FREE * sigma[0]))
    if sum(loose) <= _POINTS:
        return modes
    first = loose.index(True)
    kept = [mode for mode, free in zip(modes, loose, strict=True) if not free]
    return [LegMode(modes[first].q, modes[first].ways, True), *kept]


def _close(
    loops: BatchLoops, leg: Leg, starts: Array, mine: Bool, R: Array, p: Array
) -> tuple[Array, Array]:
    if not mine.any():
        return starts, np.zeros(len(starts))
    target = (R, p, tuple(range(6))) if leg.carries else None
    return newton(loops, starts, mine, leg.loops, target)


def _add(mechanism: Mechanism, found: list[Array], q: Array) -> bool:
    if found:
        away = np.abs(mechanism.space.wrap(np.array(found) - q)) / mechanism.space.metric
        if (away.max(axis=1) <= _EQUAL).any():
            return False
    found.append(q)
    return True


def _flipped(mechanism: Mechanism, q: Array, mine: Bool) -> list[Array]:
    """Starts near the other solutions of balls and universal joints with crossed axes."""
    out = []
    for centre in structure(mechanism).centres:
        joints = [j for j in centre.joints if mine[j]]
        if len(joints) < 2:
            continue
        for middle in (-q[joints[1]], np.pi - q[joints[1]]):
            x = q.copy()
            x[joints[0]] += np.pi
            x[joints[1]] = middle
            if len(joints) > 2:
                x[joints[2]] += np.pi
            out.append(x)
    return out


def _grouped(mechanism: Mechanism, leg: Leg, mine: Bool, solutions: list[Array]) -> list[LegMode]:
    groups: list[tuple[Array, list[Array]]] = []
    for q in solutions:
        q = mechanism.space.fold(q)
        if mechanism.space.unreachable(q)[mine].any():
            continue
        mark = likeness(mechanism, q, leg.joints, pose=False)
        for other, members in groups:
            if same(mark, other):
                members.append(q)
                break
        else:
            groups.append((mark, [q]))
    return [LegMode(members[0], len(members)) for _, members in groups]
