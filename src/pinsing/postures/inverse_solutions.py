"""Inverse solutions of a pose: what `pinsing.inverse` answers, and how it is gathered."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from pinsing._types import Array, Bool
from pinsing.arguments import checked
from pinsing.joint_text import typed
from pinsing.kinematics.verdict import generic_rank, ratios
from pinsing.postures.newton import POSE, Solver, radii
from pinsing.robot.arm import Arm, ArmSummary
from pinsing.serialization import JsonResult


@dataclass(frozen=True, eq=False)
class InverseSolution:
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
        How many starts led here, random or made.
    error : float
        What is left of the pose, radians and metres over the length scale.
    radius : float
        A true solution of the pose, regular and the only one, is proven to be within this distance
        of q in joint space (`pinsing.postures.newton`); infinite where that is not proven.
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
            lines = [head if self.doubt else f"{head}: the pose seems out of reach"]
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


ENOUGH = 5
"""A solution that was met so often has a share of the starts that is not small."""

_REGULAR = 1e-6
"""sigma_r / sigma_1 above which a solution is regular: of a singular one half the digits hold."""


class FoundSolutions:
    """Solutions so far, each with how often it was met.

    Parameters
    ----------
    solver : Solver
        Of the pose.
    arm : Arm
        The arm.
    held : (n,) array
        Values of joints that are held; NaN for those that are free.
    """

    def __init__(self, solver: Solver, arm: Arm, held: Array) -> None:
        self.solver, self.arm, self.held = solver, arm, held
        self.q: list[Array] = []
        self.left: list[float] = []
        self.sign: list[float] = []
        self.hits: list[int] = []
        self._followed = 0

    def add(self, Q: Array, left: Array) -> None:
        """Sort reached configurations into those known and new ones.

        Two that are close are one, unless both are regular and their determinants differ in sign:
        near a singularity solutions come in such pairs.
        """
        if not len(Q):
            return
        Q = self.arm.space.wrap(Q)
        for q, e, sign in zip(Q, left, self._signs(Q), strict=True):
            if self.q:
                gap = np.abs(self.arm.space.wrap(np.array(self.q) - q)).max(axis=1)
                gap[np.array(self.sign) * sign < 0] = np.inf
                k = int(np.argmin(gap))
                if gap[k] < 1e-4:
                    self.hits[k] += 1
                    if e < self.left[k]:
                        self.q[k], self.left[k], self.sign[k] = q, float(e), float(sign)
                    continue
            if len(self.q) < 4096:
                self.q.append(q)
                self.left.append(float(e))
                self.sign.append(float(sign))
                self.hits.append(1)

    def _signs(self, Q: Array) -> Array:
        """Signs of the determinant, (N,); zero where there is none, or it is noise."""
        if len(self.solver.task.rows) != len(self.solver.free):
            return np.zeros(len(Q))
        return np.where(self._measure(Q) > _REGULAR, self.solver.signs(Q), 0.0)

    def _measure(self, Q: Array) -> Array:
        """sigma_r / sigma_1 (N,): where joints are held the less of the arm's and the others'."""
        own = ratios(self.arm, Q)
        if len(self.solver.free) == self.arm.n or not len(Q):
            return own
        sizes = np.linalg.svd(self.solver.linear(Q)[1], compute_uv=False)
        rank = generic_rank(self.arm)
        others = sizes[:, rank - 1] / np.maximum(sizes[:, 0], 1e-300)
        return np.asarray(np.minimum(own, others))

    def follow(self, images: Callable[[Array], Array]) -> None:
        """Start from images of each solution that is new since the last time, and of theirs."""
        for _ in range(4):
            new = np.array(self.q[self._followed :])
            self._followed = len(self.q)
            # Singular solutions lie on curves, of which there is no end.
            new = new[self._measure(new) > _REGULAR] if len(new) else new
            if not len(new):
                return
            start = images(new)
            gap = self.arm.space.wrap(start[:, None] - np.array(self.q))
            start = start[np.abs(gap).max(axis=2).min(axis=1) > 0.1] if len(start) else start
            if len(start):
                # Steps from an image: it is near a solution, or of no use.
                self.add(*self.solver.solve(start, 30))

    @property
    def regular(self) -> Bool:
        """Which of them are regular, (K,)."""
        if not self.q:
            return np.zeros(0, dtype=bool)
        return np.greater(self._measure(np.array(self.q)), _REGULAR)

    def clear(self) -> bool:
        """Whether there are some, and none is nearly double, as next to a singularity."""
        return bool(self.q) and bool((self._measure(np.array(self.q)) > 1e-4).all())

    @property
    def lacking(self) -> int:
        """How many solutions with a positive determinant lack, negative: with a negative one.

        Where all free joints turn and do not end, joint space is compact and poses are not: the
        map has degree zero, and as many regular solutions have a positive determinant as a
        negative one. Zero where that says nothing.
        """
        rows = self.solver.task.rows
        square = len(rows) == len(self.solver.free) and (rows == POSE or max(rows) < 3)
        if not self.q or not square or self.arm.prismatic[self.solver.free].any():
            return 0
        if not all(self.sign):
            return 0
        return -round(sum(self.sign))

    def settled(self) -> bool:
        """Whether every regular solution was met several times, and none is known to lack."""
        if not self.q or self.lacking:
            return False
        return bool((np.array(self.hits)[self.regular] >= ENOUGH).all())

    def judged(self) -> tuple[InverseSolution, ...]:
        """Those within the limits first, best conditioned first; not all singular ones."""
        if not self.q:
            return ()
        arm, held = self.arm, self.held
        Q = np.where(np.isnan(held), arm.fold(np.array(self.q)), held)
        measure = self._measure(Q)
        regular: Bool = np.greater(measure, _REGULAR)
        outside: Bool = np.asarray(arm.space.outside(Q).any(axis=1))
        outside |= bool(np.any((held < arm.lower) | (held > arm.upper)))
        sure = radii(self.solver, Q)
        out, singular = [], 0
        for k in np.lexsort((-measure, outside)):
            singular += not regular[k]
            if not regular[k] and singular > 32:
                continue
            out.append(
                InverseSolution(
                    q=Q[k],
                    regular=bool(regular[k]),
                    sigma_ratio=float(measure[k]),
                    within_limits=not bool(outside[k]),
                    met=self.hits[k],
                    error=self.left[k],
                    radius=float(sure[k]) if regular[k] else math.inf,
                )
            )
        return tuple(out)
