"""What each joint of the chain does when the arm's own joints move: itself, or a multiple.

A joint that mimics another one is turned by a whole multiple of the other's angle and a
constant, so that its sine and cosine are polynomials in the other's. Other multiples are not:
with half of an angle, a whole turn of the leader is none of the follower.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from pinsing.errors import Refusal
from pinsing.measures import NOISE, SEED
from pinsing.robot.nominal import FIFTEEN, PRIMES, Nominal, Snap
from pinsing.robot.surd import Exact, cosine, residue, sine
from pinsing.robot.task import Task

_LARGEST_MULTIPLE = 6


class NotFollowed(Refusal):
    """A mimic joint that polynomials in its leader's half-angle cannot follow."""


@dataclass(frozen=True)
class Drive:
    """How one joint of the chain moves."""

    leader: int  # index of the arm's joint that it follows, or is
    multiple: Fraction  # its motion for one of the leader; whole for revolute joints
    # (cos, sin): of the constant angle that is added, where it is revolute
    turn: tuple[Exact, Exact] = (Fraction(1), Fraction(0))
    shift: Fraction = Fraction(0)  # metres that are added, where it is prismatic


def drives(geometry: Nominal) -> tuple[tuple[Drive, ...], tuple[Snap, ...]]:
    """Return how each joint of the chain is driven, and what was moved to say so exactly."""
    # NotFollowed if a follower's multiple is not whole, too large, or mixes angles and lengths.
    coupling = geometry.arm.coupling
    if coupling is None:
        return tuple(Drive(j, Fraction(1)) for j in range(len(geometry.prismatic))), ()
    names = list(geometry.arm.model.names)[1:]
    own = own_rows(geometry)
    out: list[Drive] = []
    snaps: list[Snap] = []
    for row, name in enumerate(names):
        moved = np.flatnonzero(coupling.matrix[row])
        leader = int(moved[0]) if len(moved) else 0
        factor = float(coupling.matrix[row, leader]) if len(moved) else 0.0
        multiple = Fraction(factor).limit_denominator(1000)
        NotFollowed.refuse_if(
            abs(float(multiple) - factor) > NOISE,
            f"joint {name!r} follows by {factor!r}, which is no simple ratio",
        )
        slides, led_by_slide = geometry.prismatic[row], geometry.prismatic[own[leader]]
        NotFollowed.refuse_if(
            multiple != 0 and slides != led_by_slide,
            f"joint {name!r} slides with a turn, or turns with a slide",
        )
        added = float(coupling.offset[row])
        if slides:
            out.append(Drive(leader, multiple, shift=Fraction(repr(added))))
            continue
        if multiple.denominator != 1 or abs(multiple) > _LARGEST_MULTIPLE:
            back, other = 1 / multiple, names[own[leader]]
            hint = f" (it can be followed where {other!r} follows {name!r} by {back} instead)"
            whole = back.denominator == 1 and abs(back) <= _LARGEST_MULTIPLE
            said = f"joint {name!r} follows by {factor:g}, which is not a small integer"
            raise NotFollowed(said + hint * whole)
        added += float(geometry.offset[row]) - factor * float(geometry.offset[own[leader]])
        turn, exact = _turn(added)
        if abs(exact - added) > NOISE:
            snaps.append(Snap(f"mimic joint {name}", "angle", added, exact))
        out.append(Drive(leader, multiple, turn=turn))
    return tuple(out), tuple(snaps)


def own_rows(geometry: Nominal) -> list[int]:
    """Return where in the chain the arm's own joints are."""
    if geometry.arm.coupling is None:
        return list(range(len(geometry.prismatic)))
    names = list(geometry.arm.model.names)[1:]
    return [names.index(j) for j in geometry.arm.joints]


def driven_by(driven: Sequence[Drive], own: int) -> list[int]:
    """Joints of the chain that one of the arm's own joints moves: it, and its followers."""
    moved = [row for row, d in enumerate(driven) if d.leader == own and d.multiple]
    return moved or [row for row, d in enumerate(driven) if d.leader == own]


def own_jacobian_modulo(
    geometry: Nominal,
    task: Task,
    p: int,
    draw: random.Random,
    values: Mapping[int, Sequence[Exact]],
) -> list[list[int]]:
    """Return the task Jacobian modulo a prime, a column for each of the arm's own joints."""
    # Joints at no value, (x, y) or (metres,), are at random ones. A column is the sum of a joint's
    # and its followers', by the chain rule.
    exact = np.vectorize(lambda x: residue(x, p), otypes=[object])
    at: list[Sequence[int]] = []
    for a, row in enumerate(own_rows(geometry)):
        drawn = [] if a in values else [draw.randrange(1, p)]
        start = [] if a in values or geometry.prismatic[row] else [1]
        at.append([*start, *drawn, *(residue(x, p) for x in values.get(a, ()))])
    numbers = geometry.rotation, geometry.translation, geometry.tip_rotation
    turns, steps, tip_turn = geometry.arm.once(f"chain modulo {p}", lambda: [*map(exact, numbers)])
    base = np.eye(3, dtype=object)
    R, o, axes, starts = base, base[0] - base[0], [], []
    driven, slides = drives(geometry)[0], np.array(geometry.prismatic)[:, None]
    for drive, slide, C, c in zip(driven, geometry.prismatic, turns, steps, strict=False):
        R, o = R @ C % p, (o + R @ c) % p
        axes.append(R[:, 2])
        starts.append(o)
        led = at[drive.leader]
        if slide:  # one that stands still may have a leader of any kind
            way = residue(drive.shift, p) + residue(drive.multiple, p) * led[0]
            o = (o + R[:, 2] * way) % p
            continue
        cos, sin = (residue(x, p) for x in drive.turn)
        if drive.multiple:  # de Moivre's formula
            x, y = led[0], led[1] if drive.multiple > 0 else -led[1]
            over = pow(x * x + y * y, -1, p)
            c, s = (x * x - y * y) * over % p, 2 * x * y * over % p
            for _ in range(abs(int(drive.multiple))):
                cos, sin = (cos * c - sin * s) % p, (cos * s + sin * c) % p
        R = R @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], dtype=object) % p
    R, o = R @ turns[-1] % p, (o + R @ steps[-1]) % p
    z = np.array(axes)
    screws = [np.where(slides, z, np.cross(z, o - np.array(starts))), np.where(slides, 0, z)]
    J = np.zeros((2, 3, len(at)), dtype=object)  # translations, then rotations
    for k, drive in enumerate(driven):
        J[..., drive.leader] += residue(drive.multiple, p) * np.array([half[k] for half in screws])
    tip = (R @ tip_turn).T
    return [
        ((tip if at_tip else base)[r % 3] @ J[r // 3] % p).tolist()
        for r, at_tip in zip(task.rows, task.tip_rows, strict=True)
    ]


def exact_generic_rank(geometry: Nominal, task: Task) -> int:
    """Return the rank of the task rows at almost every configuration."""
    # With flint, 40 ms to import, only where a rank is asked for that floats cannot show.
    from flint import nmod_mat

    draw, ranks = random.Random(SEED), []
    for p in PRIMES:
        rows = own_jacobian_modulo(geometry, task, p, draw, {})
        ranks.append(int(nmod_mat(rows, p).rank()))
    return max(ranks)


def _turn(angle: float) -> tuple[tuple[Exact, Exact], float]:
    """Exact (cos, sin) of an angle, or of one very close, and that angle."""
    steps = round(angle / FIFTEEN)
    if abs(angle - steps * FIFTEEN) <= NOISE * max(1.0, abs(angle)):
        return (cosine(steps), sine(steps)), angle
    whole = math.remainder(angle, 2 * math.pi)
    half = Fraction(math.tan(whole / 2)).limit_denominator(10**6)
    turn = (1 - half**2) / (1 + half**2), 2 * half / (1 + half**2)
    return turn, angle - whole + 2 * math.atan(half)
