"""Assembly and working modes: the discrete choices between which a mechanism is locked.

The *assembly mode* changes at type 2 singularities: the sign of the determinant of the passive
columns of the constraints, counted from the home configuration. The *working mode* changes at
type 1 singularities: for each actuated joint that a turning one follows, to which side that elbow
is bent; of a driven slide, whether its rod leans ahead along it or back.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from pinsing._types import Array, ArrayLike, Bool
from pinsing.errors import ConfigurationError
from pinsing.loops.closure import (
    BatchLoops,
    Loops,
    gauss_newton,
    near_home,
    newton,
    random_closed,
    ranks,
)
from pinsing.loops.structure import Leg, groups, likeness, structure
from pinsing.measures import ALIKE, ROUNDING, SEED, SOLVED
from pinsing.robot.mechanism import Mechanism, Sample, closing, joint_axes, path_to
from pinsing.robot.source import kept

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
    yield mechanism.home, np.isin(np.arange(mechanism.n), mechanism.passive)
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
    grouped = [_grouped(mechanism, leg, mine, solutions) for solutions in found]
    return [_without_curves(mechanism, mine, modes) for modes in grouped]


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


def _grouped(mechanism: Mechanism, leg: Leg, mine: Bool, solutions: list[Array]) -> list[LegMode]:
    folded = [mechanism.space.fold(q) for q in solutions]
    inside = [q for q in folded if not mechanism.space.unreachable(q)[mine].any()]
    alike = (
        groups([likeness(mechanism, q, leg.joints) for q in inside])
        if len(inside) > 1  # rarely
        else [[0]] * len(inside)
    )
    return [LegMode(inside[group[0]], len(group)) for group in alike]
