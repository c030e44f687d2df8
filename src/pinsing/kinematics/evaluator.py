"""Singular values on an engine that is fixed by name: the same bits wherever the work is done.

An `Evaluator` is small and can be pickled, so that it can be sent to other processes and
machines; the instruction set travels with it and is never replaced by another.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pinsing._batch import engine as kernel
from pinsing._types import Array
from pinsing._version import __version__
from pinsing.errors import EngineError, OptionError
from pinsing.geometry.chain import flatten
from pinsing.kinematics.engine import ENGINES, batch_chain, pinocchio_jacobians
from pinsing.kinematics.jacobian import generic_rank, scale_rows
from pinsing.robot.arm import Arm

PINOCCHIO = "pinocchio"


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
        arm = self.arm
        if self.engine == PINOCCHIO:
            J = pinocchio_jacobians(arm, Q)
            J = J if arm.coupling is None else J @ arm.coupling.matrix
            sigma = np.linalg.svd(scale_rows(arm, J), compute_uv=False)
            return np.asarray(sigma[:, : self.rank], dtype=np.float64)
        chain = batch_chain(arm, "batch")
        assert chain is not None  # "batch" raises where there is none
        here = kernel.isa_names()
        if self.engine not in here:
            raise EngineError(
                f"the run was planned for {self.engine}, but this machine runs "
                f"{', '.join(here)}; start it with an engine that all machines have"
            )
        if arm.coupling is None:
            sigma = kernel.singular_values(
                chain,
                Q,
                rows=arm.task.rows,
                length_scale=arm.length_scale,
                threads=1,
                isa=self.engine,
            )
        else:
            values = Q @ arm.coupling.matrix.T + arm.coupling.offset
            J = kernel.jacobians(chain, values, threads=1, isa=self.engine) @ arm.coupling.matrix
            sigma = kernel.svdvals(scale_rows(arm, J), threads=1, isa=self.engine)
        return np.asarray(sigma[:, : self.rank])


def evaluator(arm: Arm, engine: str = "auto") -> Evaluator:
    """Fix the engine for ``arm``.

    Parameters
    ----------
    engine : str
        ``auto`` or ``batch`` (the best instruction set here), ``pinocchio``, or an
        instruction set: ``baseline``, ``avx2``, ``avx512``.

    Raises
    ------
    EngineError
        If the engine is not there, or disagrees with Pinocchio on this arm.
    OptionError
        If there is no such engine.
    """
    return Evaluator(_lean(arm), generic_rank(arm), fixed_engine(arm, engine))


def fixed_engine(arm: Arm, engine: str = "auto") -> str:
    """``pinocchio`` or the instruction set that ``engine`` means here; as `evaluator`."""
    here = kernel.isa_names()
    if engine in here:
        batch_chain(arm, "batch")
        return engine
    if engine not in ENGINES:
        if engine in ("baseline", "avx2", "avx512"):
            has = ", ".join(here) or "no compiled kernel"
            raise EngineError(f"engine {engine} does not run on this machine; it has {has}")
        names = dict.fromkeys((*ENGINES, *here))
        raise OptionError(f"unknown engine {engine!r}: use one of {', '.join(names)}")
    return PINOCCHIO if batch_chain(arm, engine) is None else here[-1]


def fingerprint(arm: Arm) -> str:
    """SHA-256 of every number of the arm that its singular values depend on."""
    chain = flatten(arm)
    parts = [chain.R, chain.t, chain.prismatic, np.array(arm.task.rows), arm.length_scale]
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
        arm.source, path=None, xml=None, package_dirs=(), full_model=arm.model, locked=()
    )
    return replace(arm, source=source, notes=())
