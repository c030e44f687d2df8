"""Points that were met on some equations: real ones, or ones modulo a prime."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array, Bool
from pinsing.algebra.components import Component
from pinsing.algebra.ring import Poly
from pinsing.families.modular_points import ModularPoint
from pinsing.families.pieces import PieceMaker
from pinsing.families.zero_set import residuals

_REGULAR = 1e-5
_ON = 1e-8


class MetPoints(Protocol):
    """Some points of one set."""

    def __len__(self) -> int: ...

    def full(self, columns: Sequence[int]) -> Bool:
        """At which of them (N,) some columns of the Jacobian, as many as the rank, have it."""

    def on(self, component: Component) -> bool:
        """Whether all lie on a component."""

    def vanishes(self, poly: Poly) -> Bool:
        """At which of them (N,) a polynomial is zero."""


@dataclass(frozen=True, eq=False)
class RealPoints:
    """Real points q (N, n), to rounding."""

    maker: PieceMaker
    q: Array
    rank: int

    def __len__(self) -> int:
        return len(self.q)

    def full(self, columns: Sequence[int]) -> Bool:
        """See ``MetPoints``."""
        sizes = np.linalg.svd(self.maker.jacobians(self.q)[..., list(columns)], compute_uv=False)
        ratio = sizes[:, self.rank - 1] / np.maximum(sizes[:, 0], 1e-300)
        return np.asarray(ratio >= _REGULAR)

    def on(self, component: Component) -> bool:
        """See ``MetPoints``."""
        branch = self.maker.branch_of(component.values, component.relations)
        for v in branch.values:
            away = self.q[:, v.joint] - v.value
            if not self.maker.ring.prismatic[v.joint]:
                away = away - 2 * np.pi * np.round(away / (2 * np.pi))
            if (np.abs(away) > _ON).any():
                return False
        if not branch.equations:
            return True
        return bool((np.abs(residuals(branch.equations, self.q)) < _ON).all())

    def vanishes(self, poly: Poly) -> Bool:
        """See ``MetPoints``."""
        off = residuals([self.maker.equation_of(poly)], self.q)
        return np.asarray(np.abs(off)[:, 0] < _ON)


@dataclass(frozen=True, eq=False)
class PrimePoints:
    """Points modulo primes, exactly."""

    points: Sequence[ModularPoint]
    rank: int

    def __len__(self) -> int:
        return len(self.points)

    def full(self, columns: Sequence[int]) -> Bool:
        """See ``MetPoints``."""
        return np.array([p.rank(columns) == self.rank for p in self.points], dtype=bool)

    def on(self, component: Component) -> bool:
        """See ``MetPoints``."""
        return all(
            all(p.has(j, v) for j, v in component.values.items())
            and all(p.is_zero(r) for r in component.relations)
            for p in self.points
        )

    def vanishes(self, poly: Poly) -> Bool:
        """See ``MetPoints``."""
        return np.array([p.is_zero(poly) for p in self.points], dtype=bool)
