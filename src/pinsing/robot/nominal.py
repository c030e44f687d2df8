"""Nominal geometry: the chain of an arm with exact numbers, and what that changed.

Model files carry rounded angles (``rpy="1.5708"``) and the float noise of composed
placements. The nominal chain puts angles near multiples of 90 degrees exactly there,
keeps multiples of 15 degrees as the square roots that they are made of, leaves lengths at
their decimal value, and replaces any other twist by a rational point of the unit
circle. Everything that was moved is listed with its size.

A turn about a joint's own axis is no geometry at all: it only shifts where the joint's
zero is. Such turns are taken out of the placements and kept as joint offsets, so that a
link turned by 45 degrees about its axis stays exact.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pinsing._types import Array, Chain
from pinsing.arguments import checked
from pinsing.errors import OptionError
from pinsing.measures import SEED
from pinsing.notebook import one_line
from pinsing.robot.arm import Arm
from pinsing.robot.chain import (
    chain_model,
    flatten,
    jacobian_change,
    keep_chain,
    rotation_angle,
)
from pinsing.robot.exact_placements import ExactPlacements, Length3, Matrix, Snap, turn_about_z
from pinsing.robot.surd import Exact, residue
from pinsing.robot.task import Task

ANGLE_TOL = 2e-3
"""Default tolerance, radians, for moving an angle to a multiple of 90 degrees (1.57, 3.14)."""

USUAL = (ANGLE_TOL, 0.0)
_ITSELF = "nominal geometry of itself"


@dataclass(frozen=True, eq=False)
class Nominal:
    """Exact geometry of an arm.

    The tip placement is C_0 M_0(q_0 + offset_0) C_1 ... C_n up to the orientation of
    the tip frame itself, which only tasks with rows in the tip's axes depend on.

    Attributes
    ----------
    arm : Arm
        The same arm on the nominal geometry: same joint vectors, tip, task and limits.
    rotation : tuple of n + 1 exact 3x3 matrices
        Rotation of each C_i, of Fractions and, for twists of 15 degrees and its multiples,
        of Surds; the last is the identity.
    translation : tuple of n + 1 rational triples
        Translation of each C_i, metres.
    tip_rotation : exact 3x3 matrix
        Rotation of the tip frame after C_n, where the task has rows in its axes; else the identity.
    prismatic : tuple of bool
        Which joints slide.
    offset : (n,) array
        Radians; added to the joint vector of the model (zero for most arms); with mimic
        joints in the chain, n counts these too.
    snaps : tuple of Snap
        What was moved.
    jacobian_change : float
        Upper bound, at any configuration within the limits, of the change of any column
        of the scaled task Jacobian (translation rows over the length scale); infinite
        if a prismatic joint without limits makes it so.
    """

    arm: Arm
    rotation: tuple[Matrix, ...]
    translation: tuple[Length3, ...]
    tip_rotation: Matrix
    prismatic: tuple[bool, ...]
    offset: Array
    snaps: tuple[Snap, ...]
    jacobian_change: float

    def __repr__(self) -> str:
        moved = f"{len(self.snaps)} numbers moved" if self.snaps else "nothing moved"
        change = f"Jacobian columns change by at most {self.jacobian_change:.1e}"
        return one_line("Nominal", f"{self.arm.name}: {moved}, {change}")

    @property
    def exact(self) -> bool:
        """True if the nominal geometry agrees with the raw one to 1e-12."""
        return self.jacobian_change <= 1e-12


@checked
def nominal(arm: Arm, angle_tol: float = ANGLE_TOL, snap_length: float = 0.0) -> Nominal:
    """Make the geometry of ``arm`` exact. That of an arm made so stays.

    Parameters
    ----------
    arm : Arm
        Any arm.
    angle_tol : float
        Radians; an angle closer than this to a multiple of 90 degrees is put there. What is
        within 1e-9 always is.
    snap_length : float
        Metres; a coordinate of a placement shorter than this is put to zero. Off by default:
        lengths stay the decimals that the file has.

    Returns
    -------
    Nominal
        The exact chain, the arm on it, and what was moved.

    Raises
    ------
    OptionError
        If a tolerance is negative or not finite, or ``angle_tol`` is 45 degrees or more.

    Examples
    --------
    >>> import pinsing
    >>> exact = pinsing.robot.nominal(pinsing.load("ur5"))
    >>> exact.snaps[0].what, exact.snaps[0].nominal, exact.jacobian_change < 1e-10
    ('angle', 0.0, True)
    """
    OptionError.refuse_if(
        not 0 <= angle_tol < math.pi / 4,
        f"angle_tol must lie in [0, pi/4) radians, got {angle_tol!r}",
    )
    OptionError.refuse_if(
        not 0 <= snap_length < math.inf,
        f"snap_length must be zero or a positive length, got {snap_length!r}",
    )
    key = (float(angle_tol), float(snap_length))
    if key == USUAL and _ITSELF in arm.known:  # made for each who asks: an arm holds not itself
        return Nominal(arm=arm, **arm.known[_ITSELF], snaps=(), jacobian_change=0.0)
    return arm.once(f"nominal {key}", lambda: _on(arm, key))


def _on(arm: Arm, key: tuple[float, float]) -> Nominal:
    ends = [arm.base, *list(arm.model.names)[1:], arm.tip]
    places = [f"{a} to {b}" for a, b in itertools.pairwise(ends)]
    raw = flatten(arm)
    found = ExactPlacements(raw, places, *key, with_tip=bool(arm.task.at_tip), arm=arm)
    tip_turn, exact_tip, n = found.tip_turn, found.tip_rotation, raw.n
    offset = found.offset
    R = [np.array([[float(x) for x in row] for row in m]) for m in found.rotation]
    t = np.array([[float(x) for x in row] for row in found.translation])
    tip_angle = 0.0
    if exact_tip is not None:
        there = np.array([[float(x) for x in row] for row in exact_tip])
        tip_angle, tip_turn = rotation_angle(there.T @ tip_turn), there
    change = jacobian_change(found.turned, Chain(np.array(R), t, raw.prismatic), arm, tip_angle)
    if found.raw is not raw:
        change += jacobian_change(raw, found.raw, arm, rotation_angle(raw.R[n].T @ found.raw.R[n]))
    for i in range(n):
        if offset[i] != 0.0:  # fold the offset back: the arm keeps the user's joint zero
            R[i] = R[i] @ turn_about_z(float(offset[i]))
    R[n] = R[n] @ tip_turn
    chain = Chain(np.array(R), t, raw.prismatic)
    on_it = replace(arm, model=chain_model(chain, arm))
    exact: dict[str, Any] = {
        "rotation": found.rotation,
        "translation": found.translation,
        "tip_rotation": found.rotation[n] if exact_tip is None else exact_tip,
        "prismatic": tuple(bool(p) for p in raw.prismatic),
        "offset": offset,
    }
    on_it.known[_ITSELF] = exact
    keep_chain(on_it, chain)
    snaps = tuple(s for s in found.snaps if s.size > 0)
    return Nominal(arm=on_it, **exact, snaps=snaps, jacobian_change=change)


PRIMES = (4611686018427387817, 4611686018427387409)
"""The two largest primes below 2^62 that are 1 modulo 24."""

Vector = list[int]
Motion = tuple[int, ...]


def exact_generic_rank(geometry: Nominal, task: Task) -> int:
    """Return the rank of the task rows at almost every configuration; no mimic joints."""
    draw = random.Random(SEED)
    return max(_rank(geometry, task, prime, draw) for prime in PRIMES)


def _rank(geometry: Nominal, task: Task, p: int, draw: random.Random) -> int:
    # With flint, 40 ms to import, only where a rank is asked for that floats cannot show.
    from flint import nmod_mat

    rows = jacobian_modulo(geometry, task, p, draw)
    flat = [x for row in rows for x in row]
    return int(nmod_mat(len(rows), len(geometry.prismatic), flat, p).rank())


def jacobian_modulo(
    geometry: Nominal,
    task: Task,
    p: int,
    draw: random.Random,
    values: Mapping[int, Sequence[Exact]] | None = None,
) -> list[Vector]:
    """Return the task Jacobian modulo a prime at a random configuration; no mimic joints."""
    # ``values`` of joints that stand still: (x, y), the angle 2 atan2(y, x), or (metres,).
    values = values or {}
    motions: list[Motion] = []
    for j, slides in enumerate(geometry.prismatic):
        at = [residue(x, p) for x in values[j]] if j in values else None
        if slides:
            motions.append((draw.randrange(1, p) if at is None else at[0],))
        else:
            x, y = (1, draw.randrange(1, p)) if at is None else at
            motions.append(turned(x, y, p))
    return jacobian_at(geometry, task, p, motions)


def turned(x: int, y: int, p: int) -> Motion:
    """Cosine and sine of 2 atan2(y, x) modulo a prime."""
    over = pow(x * x + y * y, -1, p)
    return (x * x - y * y) * over % p, 2 * x * y * over % p


def jacobian_at(geometry: Nominal, task: Task, p: int, motions: Sequence[Motion]) -> list[Vector]:
    """Return the task Jacobian modulo a prime, where joints have (cos, sin) or (metres,)."""
    exact = np.vectorize(lambda x: residue(x, p), otypes=[object])
    turns, steps = exact(geometry.rotation), exact(geometry.translation)
    base = np.eye(3, dtype=object)
    R, o, axes = base, base[0] - base[0], []
    for slides, motion, C, c in zip(geometry.prismatic, motions, turns, steps, strict=False):
        R, o = R @ C % p, (o + R @ c) % p
        axes.append((R[:, 2], o))
        if slides:
            o = (o + motion[0] * R[:, 2]) % p
        else:
            cos, sin = motion
            R = R @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], dtype=object) % p
    R, o = R @ turns[-1] % p, (o + R @ steps[-1]) % p
    columns = []
    for (z, start), slides in zip(axes, geometry.prismatic, strict=True):
        x, y, w = o - start
        moved = [z[1] * w - z[2] * y, z[2] * x - z[0] * w, z[0] * y - z[1] * x, *z]
        columns.append([*z, 0, 0, 0] if slides else moved)
    J = np.array(columns, dtype=object).T.reshape(2, 3, -1)  # translations, then rotations
    tip = (R @ exact(geometry.tip_rotation)).T
    return [
        ((tip if at_tip else base)[r % 3] @ J[r // 3] % p).tolist()
        for r, at_tip in zip(task.rows, task.tip_rows, strict=True)
    ]
