"""Equations of singular loci in the joint angles of a mechanism, as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.algebra.equation import Equation
from pinsing.loops.pose_equation import PoseEquation
from pinsing.serialization import JsonResult

_VANISHES = 1e-6
"""A row shorter than this, relative to the sum of its coefficients, is not made longer."""


@dataclass(frozen=True, eq=False)
class JointLocus:
    """One singular locus in the joint angles.

    Attributes
    ----------
    kind : str
        ``type 1``, ``type 2``, or ``passive``: joints that carry no load are dependent by
        themselves, and move with the actuators locked.
    words : str
        What happens there.
    joints : tuple of str
        Joints that occur.
    equation : Equation or None
        Zero exactly there; None where the determinant is left as it is.
    matrix : tuple of tuple of PoseEquation
        Entries of the determinant that is zero exactly there; with more rows than columns its
        columns are dependent exactly there. Empty where ``equation`` is short, or one of several
        factors.
    """

    kind: str
    words: str
    joints: tuple[str, ...]
    equation: Equation | None
    matrix: tuple[tuple[PoseEquation, ...], ...] = field(default=(), metadata={"optional": True})

    def entries(self, q: npt.ArrayLike, joints: Sequence[str]) -> Array:
        """The matrix (..., k, m) at configurations q (..., n) of joints with these names."""
        q = np.asarray(q, dtype=float)
        at = {}
        for k, name in enumerate(joints):
            at[name], at[f"cos {name}"], at[f"sin {name}"] = (
                q[..., k], np.cos(q[..., k]), np.sin(q[..., k])
            )  # fmt: skip
        rows = []
        for row in self.matrix:
            entries = []
            for x in row:
                values = [at[n] for n in x.names]
                entries.append(
                    x(np.stack(values, axis=-1)) if values
                    else np.full(q.shape[:-1], float(x.values.sum()))
                )  # fmt: skip
            rows.append(np.stack(entries, axis=-1))
        return np.stack(rows, axis=-2)

    def scaled(self, M: Array) -> Array:
        """The matrix (..., k, m) with rows of unit length; those that vanish stay small."""
        sums = [[np.abs(x.values).sum() for x in row] for row in self.matrix]
        whole = np.linalg.norm(np.array(sums, dtype=float), axis=1)
        size = np.maximum(np.linalg.norm(M, axis=-1), _VANISHES * whole)
        return np.asarray(M / np.where(size > 0, size, 1.0)[..., None])

    def ratio(self, q: npt.ArrayLike, joints: Sequence[str]) -> Array:
        """How near it is (...) at q (..., n): a value over its size, or the least singular value.

        Zero on the locus, 1 at most.
        """
        if self.equation is not None:
            return np.asarray(np.abs(self.equation(q)) / self.equation.size)
        sigma = np.linalg.svd(self.scaled(self.entries(q, joints)), compute_uv=False)
        return np.asarray(sigma[..., -1] / np.maximum(sigma[..., 0], _VANISHES))

    def __str__(self) -> str:
        return f"{self.kind}, {self.words}: {self.statement()}"

    def statement(self) -> str:
        """The equation, or the size of the determinant and the joints in it."""
        if self.equation is not None and not self.matrix:
            return str(self.equation)
        size, columns = len(self.matrix), len(self.matrix[0])
        if size > columns:
            return f"rank of {size} x {columns} entries below {columns} in {', '.join(self.joints)}"
        return f"determinant of {size} x {size} entries = 0 in {', '.join(self.joints)}"

    def rows(self) -> list[str]:
        """The rows of the determinant as text."""
        return [f"({', '.join(x.text() for x in row)})" for row in self.matrix]


@dataclass(frozen=True, eq=False)
class JointForms(JsonResult):
    """All singular loci of a mechanism in its joint angles.

    Attributes
    ----------
    joints : tuple of str
        All joints, in the order of configurations.
    loci : tuple of JointLocus
        A configuration that closes the loops is singular if and only if one of them is zero.
    complete : bool
        Whether that holds; without it there are none, and the notes say why.
    notes : tuple of str
        What was assumed.
    """

    schema: ClassVar[str] = "pinsing/joint-forms/1"

    joints: tuple[str, ...]
    loci: tuple[JointLocus, ...]
    complete: bool
    notes: tuple[str, ...]

    def values(self, q: npt.ArrayLike) -> Array:
        """Left sides (..., number of loci) at configurations q (..., n), radians and metres.

        Those of determinants have their rows scaled to unit length first, rows of rounding aside.
        Of a matrix with more rows than columns it is the product of the singular values, which is
        never negative.
        """
        q = np.asarray(q, dtype=float)
        out = []
        for locus in self.loci:
            if locus.equation is not None:
                out.append(locus.equation(q) / locus.equation.size)
                continue
            M = locus.entries(q, self.joints)
            M = locus.scaled(M)
            if M.shape[-2] > M.shape[-1]:
                out.append(np.prod(np.linalg.svd(M, compute_uv=False), axis=-1))
            else:
                out.append(np.linalg.det(M))
        return np.stack(out, axis=-1) if out else np.zeros((*q.shape[:-1], 0))

    def __str__(self) -> str:
        return "\n".join([*(str(x) for x in self.loci), *self.notes])
