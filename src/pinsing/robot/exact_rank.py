"""The generic rank of a chain's Jacobian, without floats and without a length scale.

The Jacobian of the nominal chain is built from its exact placements modulo a prime of 62 bits,
at half-angle tangents and lengths drawn at random, and its rank is taken there. Modulo a prime
and at one point a rank is never more than the generic one; that it is less has a chance of
about 1e-16 for each draw (Schwartz, 1980; Zippel, 1979), and two primes must both be wrong.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence

from pinsing.robot.nominal import Nominal
from pinsing.robot.residue import residue
from pinsing.robot.surd import Exact
from pinsing.robot.task import Task

PRIMES = (4611686018427387817, 4611686018427387409)
"""The two largest primes below 2^62 that are 1 modulo 24."""
SEED = 20231

Vector = list[int]
Motion = tuple[int, ...]


def exact_generic_rank(geometry: Nominal, task: Task) -> int:
    """Rank of the task rows of the Jacobian at almost every configuration.

    Parameters
    ----------
    geometry : Nominal
        A chain in which every joint moves on its own.
    task : Task
        Rows of the frame Jacobian at the tip.
    """
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
    """Task rows of the Jacobian modulo a prime, at a configuration drawn at random.

    Parameters
    ----------
    geometry : Nominal
        A chain in which every joint moves on its own.
    task : Task
        Rows of the frame Jacobian at the tip.
    p : int
        The prime.
    draw : random.Random
        Where the configuration is drawn from.
    values : mapping of int to (x, y) or (metres,), optional
        Joints that stand still: at the angle 2 atan2(y, x), or the length.
    """
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
    """Task rows of the Jacobian modulo a prime, a column for each joint of the chain.

    Parameters
    ----------
    geometry : Nominal
        A chain; of one with mimic joints these count as well.
    task : Task
        Rows of the frame Jacobian at the tip.
    p : int
        The prime.
    motions : sequence of (cos, sin) or (metres,)
        What each joint of the chain does.
    """
    R = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    o = [0, 0, 0]
    axes: list[tuple[Vector, Vector]] = []
    for j, (C, c) in enumerate(zip(geometry.rotation, geometry.translation, strict=True)):
        step = [residue(x, p) for x in c]
        o = [
            (a + sum(x * y for x, y in zip(row, step, strict=True))) % p
            for a, row in zip(o, R, strict=True)
        ]
        turn = [[residue(x, p) for x in row] for row in C]
        R = [[sum(row[k] * turn[k][i] for k in range(3)) % p for i in range(3)] for row in R]
        if j == len(geometry.prismatic):
            break
        z = [row[2] for row in R]
        axes.append((z, o))
        if geometry.prismatic[j]:
            t = motions[j][0]
            o = [(a + t * b) % p for a, b in zip(o, z, strict=True)]
            continue
        cos, sin = motions[j]
        R = [[(a * cos + b * sin) % p, (b * cos - a * sin) % p, d] for a, b, d in R]
    columns = []
    for (z, start), slides in zip(axes, geometry.prismatic, strict=True):
        if slides:
            columns.append([*z, 0, 0, 0])
            continue
        x, y, w = (a - b for a, b in zip(o, start, strict=True))
        columns.append([z[1] * w - z[2] * y, z[2] * x - z[0] * w, z[0] * y - z[1] * x, *z])
    last = [[residue(x, p) for x in row] for row in geometry.tip_rotation]
    tip = [[sum(row[k] * last[k][i] for k in range(3)) % p for i in range(3)] for row in R]
    rows = []
    for r, at_tip in zip(task.rows, task.tip_rows, strict=True):
        along = [int(r % 3 == k) for k in range(3)] if not at_tip else [row[r % 3] for row in tip]
        first = r - r % 3
        rows.append([sum(a * c[first + k] for k, a in enumerate(along)) % p for c in columns])
    return rows
