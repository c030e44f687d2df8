"""Singular values on an engine that is fixed by name: the same bits wherever the work is done.

An `Evaluator` is small and can be pickled, so that it can be sent to other processes and
machines; the instruction set travels with it and is never replaced by another.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing._version import __version__
from pinsing.kinematics.batch import Batch
from pinsing.kinematics.engine import PINOCCHIO
from pinsing.kinematics.engine import fixed_engine as fixed_engine
from pinsing.kinematics.verdict import Measured, basis, generic_rank, measured
from pinsing.robot.arm import Arm
from pinsing.robot.chain import flatten


@dataclass(frozen=True, eq=False)
class Evaluator:
    """Singular values of the task Jacobian of one arm on one engine.

    Attributes
    ----------
    arm : Arm
        Without what is only needed to draw it.
    rank : int
        Its generic rank r.
    engine : str
        ``pinocchio``, or the instruction set of the compiled kernel.
    """

    arm: Arm
    rank: int
    engine: str

    def sigma(self, Q: Array) -> Array:
        """Singular values (N, r) at Q (N, n), largest first, on the calling thread alone.

        Raises
        ------
        EngineError
            If this machine cannot run the engine.
        """
        return np.asarray(Batch(self.arm, self.engine, 1).sigma(Q)[:, : self.rank])

    def measure(self, Q: Array) -> Measured:
        """Singular values, as `sigma`, and what is singular is judged by."""
        return measured(Batch(self.arm, self.engine, 1), Q)

    def last_and_ratio(self, Q: Array) -> tuple[Array, Array]:
        """Return sigma_r (N,) of configurations Q (N, n), and the ratio (N,) of verdicts."""
        found = self.measure(Q)
        return found.sigma[:, -1], found.ratio


def evaluator(arm: Arm, engine: str = "auto") -> Evaluator:
    """Fix the engine for ``arm``.

    Parameters
    ----------
    engine : str
        As in `fixed_engine`, which says what is raised, too.
    """
    return Evaluator(_lean(arm), generic_rank(arm), fixed_engine(arm, engine))


def fingerprint(arm: Arm) -> str:
    """SHA-256 of every number of the arm that its singular values depend on."""
    chain = flatten(arm)
    parts = [chain.R, chain.t, chain.prismatic, np.array(arm.task.rows), arm.length_scale]
    if arm.task.at_tip:
        parts.append(np.array(arm.task.at_tip))
    if arm.coupling is not None:
        parts += [arm.coupling.matrix, arm.coupling.offset]
    digest = hashlib.sha256()
    for part in parts:
        array = np.ascontiguousarray(part, dtype=np.float64)
        digest.update(f"{array.shape};".encode() + array.tobytes())
    return digest.hexdigest()


def run_identity(kind: str, evaluator: Evaluator) -> dict[str, Any]:
    """What a folder records of how a run computes, as plain JSON values."""
    return {
        "kind": kind,
        "pinsing": __version__,
        "engine": evaluator.engine,
        "robot": fingerprint(evaluator.arm),
        "rank": evaluator.rank,
    }


def recorded_engine(known: Mapping[str, Any] | None, asked: str) -> str:
    """Engine to go on with: that of the run on disk, unless another is asked for by name."""
    if known is None or asked not in ("auto", "batch"):
        return asked
    engine = str(known.get("engine", asked))
    return asked if asked == "batch" and engine == PINOCCHIO else engine


def _lean(arm: Arm) -> Arm:
    source = replace(
        arm.source,
        path=None,
        shapes=None,
        full_model=arm.model,
        locked=(),
        reference=pin.neutral(arm.model),
        base="universe",
    )
    lean = replace(arm, source=source, notes=())
    lean.known.update(basis(arm))
    return lean
