"""A task of a chain over a small finite field, where every configuration can be visited.

The rows of a task are six-vectors that a screw is multiplied with: where the tip is says how it
moves, and the axes of base or tip along which direction that counts. Both sides of the chain are
gone through once; where the rows turn with the far side alone, its own columns must fall short of
the rank first, which few of them do.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np
import numpy.typing as npt
from flint import nmod_mat

from pinsing.algebra.row_axes import in_axes
from pinsing.families.modular_chain import (
    Coordinates,
    Ints,
    ModularChain,
    Pairs,
    short,
)
from pinsing.robot.nominal import PRIMES, Nominal, jacobian_modulo
from pinsing.robot.surd import residue
from pinsing.robot.task import Task

_CHUNK = 100_000
"""Pairs of values of the two sides whose columns are made at once."""
_LOOKS = 3
"""Random configurations at which a joint is moved, to see whether that matters to the rank."""
_POINTS = 12
"""At which all of a chain is looked at: that each is singular by chance is 1 in 1e10."""
_LOOK_SEED = 11


class ModularRows(ModularChain):
    """A chain and rows of its Jacobian modulo a prime.

    Parameters
    ----------
    geometry : Nominal
        The chain, each of whose joints moves on its own.
    task : Task
        The rows: as many as their generic rank.
    prime : int
        The field.

    Raises
    ------
    ValueError
        If the prime divides a denominator of the chain.
    """

    def __init__(self, geometry: Nominal, task: Task, prime: int) -> None:
        super().__init__(geometry, prime)
        self.task = task
        self._with_base = bool(in_axes(task, False))
        self._with_tip = set(in_axes(task, True))
        self._tip_turn = np.array(
            [[residue(v, prime) for v in row] for row in geometry.tip_rotation]
        )

    def _met(self, middle: int, near: Sequence[Coordinates], far: Sequence[Coordinates]) -> Pairs:
        p = self.p
        before, R = self._near(middle, near)
        base = self.turn[0] @ R % p  # its rows are the base's axes, seen from the middle
        behind, tip_axes, tip = self._far_side(middle, far)
        # The middle joint's own axis stands still in its frame: it counts on the far side.
        still = np.broadcast_to(before[:, :1][:1], (len(behind), 1, 6))
        before, behind = before[:, 1:], np.concatenate([still, behind], axis=1)
        left = np.arange(len(behind))
        if not self._with_base:
            L = self._rows(base[:1], tip_axes, tip)
            left = left[short(self._columns(L, behind), p)]
        out = []
        step = max(1, _CHUNK // max(1, len(before)))
        for first in range(0, len(left), step):
            some = left[first : first + step]
            i, k = (a.ravel() for a in np.meshgrid(np.arange(len(before)), some, indexing="ij"))
            L = self._rows(base[i if len(base) > 1 else np.zeros_like(i)], tip_axes[k], tip[k])
            J = self._columns(L, np.concatenate([before[i], behind[k]], axis=1))
            singular = short(J, p)
            out.append(np.stack([i[singular], k[singular]], axis=1))
        return np.concatenate(out) if out else np.zeros((0, 2), dtype=np.intp)

    def _far_side(self, middle: int, far: Sequence[Coordinates]) -> tuple[Ints, Ints, Ints]:
        """Screws behind the middle joint, axes of the tip as rows, and where it is."""
        p = self.p
        behind, R, o = self._far(middle, far)
        M, t = self._motion(self.n - 1, far[self.n - 1])
        o = ((R @ t[:, :, None])[:, :, 0] + o) % p
        R = R @ M % p
        o = (R @ self.shift[self.n] + o) % p
        R = R @ self.turn[self.n] % p @ self._tip_turn % p
        count = max(len(behind), len(R), len(o))
        axes = np.broadcast_to(R, (count, 3, 3)).transpose(0, 2, 1)
        return np.broadcast_to(behind, (count, *behind.shape[1:])), axes, _as_many(o, count)

    def _rows(self, base: Ints, tip_axes: Ints, tip: Ints) -> Ints:
        """What screws (v, w) are multiplied with (N, rows, 6), in the middle joint's frame."""
        count = max(len(base), len(tip))
        whole = np.eye(3, dtype=np.int64)[None]  # all three directions span the same in any axes
        out = []
        for r, at_tip in zip(self.task.rows, self.task.tip_rows, strict=True):
            triple = set(range(r - r % 3, r - r % 3 + 3))
            axes = whole if triple <= set(self.task.rows) else tip_axes if at_tip else base
            along = _as_many(axes[:, r % 3], count)
            none = np.zeros_like(along)
            if r < 3:  # along . (v + w x tip) = along . v + (tip x along) . w
                turned = np.cross(_as_many(tip, count), along) % self.p
                out.append(np.concatenate([along, turned], axis=1))
            else:
                out.append(np.concatenate([none, along], axis=1))
        return np.stack(out, axis=1)

    def _columns(self, rows: Ints, screws: Ints) -> npt.NDArray[np.int16]:
        """Rows of the Jacobian (rows, columns, N): sums of six products are exact in floats."""
        J = rows.astype(np.float32) @ screws.astype(np.float32).transpose(0, 2, 1)
        return np.asarray((J % self.p).astype(np.int16).transpose(1, 2, 0))


def _as_many(a: Ints, count: int) -> Ints:
    return np.broadcast_to(a, (count, *a.shape[1:]))


def short_everywhere(chain: ModularChain, geometry: Nominal, task: Task) -> bool:
    """Whether the rank of a chain's rows is short at all of some random points over its field.

    So it is where the prime divides a length without which the chain is another one.
    """
    draw, rows = random.Random(_LOOK_SEED), len(task.rows)
    for _ in range(_POINTS):
        at: dict[int, tuple[Fraction, ...]] = {}
        for j, slides in enumerate(geometry.prismatic):
            x, y = chain.every(j)
            k = draw.randrange(len(x))
            at[j] = (Fraction(int(x[k])),) if slides else (Fraction(int(x[k])), Fraction(int(y[k])))
        J = jacobian_modulo(geometry, task, chain.p, draw, at)
        flat = [v for row in J for v in row]
        if nmod_mat(rows, len(geometry.prismatic), flat, chain.p).rank() == rows:
            return False
    return True


def joints_that_matter(geometry: Nominal, task: Task) -> tuple[int, ...]:
    """Joints on which the rank of some rows depends: not those whose motion turns all axes alike.

    Turned axes leave each minor as it is, up to one sign; asked at random points modulo a prime.
    """
    draw = random.Random(_LOOK_SEED)
    n, prime = len(geometry.prismatic), PRIMES[0]

    def drawn(j: int) -> tuple[Fraction, ...]:
        first = Fraction(draw.randrange(1, prime))
        return (first,) if geometry.prismatic[j] else (Fraction(1), first)

    mixing = nmod_mat(n, len(task.rows), [draw.randrange(prime) for _ in task.rows * n], prime)

    def volume(values: Mapping[int, Sequence[Fraction]]) -> int:
        """A sum of all minors, each with a factor of its own, up to its sign."""
        rows = jacobian_modulo(geometry, task, prime, draw, values)
        flat = [x for row in rows for x in row]
        size = int((nmod_mat(len(rows), n, flat, prime) * mixing).det())
        return min(size, prime - size)

    matter = set[int]()
    for _ in range(_LOOKS):
        at = {j: drawn(j) for j in range(n)}
        here = volume(at)
        for j in range(n):
            if j not in matter and volume({**at, j: drawn(j)}) != here:
                matter.add(j)
    return tuple(sorted(matter))
