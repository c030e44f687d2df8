"""Jacobians and singular values of one arm on an engine that is fixed by name.

The one place where the compiled kernel and Pinocchio's loop part. All methods take joint vectors
Q (N, n) that have been checked.
"""

from __future__ import annotations

import numpy as np

from pinsing._batch import engine as kernel
from pinsing._batch.chain import FlatChain
from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.errors import EngineError
from pinsing.kinematics.engine import (
    PINOCCHIO,
    batch_chain,
    check_threads,
    fixed_engine,
    model_values,
    pinocchio_jacobians,
)
from pinsing.kinematics.own_scale import own_scale
from pinsing.kinematics.task_rows import task_rows, tip_rotations
from pinsing.robot.arm import Arm


@dataclass(frozen=True, eq=False)
class Batch:
    """One arm, one engine.

    Attributes
    ----------
    arm : Arm
        Any arm.
    engine : str
        ``pinocchio``, or an instruction set of the compiled kernel.
    threads : int or None
        Of the kernel; as many as the process may use by default. No result depends on it.
    """

    arm: Arm
    engine: str
    threads: int | None = None

    def model_jacobians(self, Q: Array) -> Array:
        """Frame Jacobians (N, 6, nv) by every velocity of the model, mimic joints on their own."""
        chain = self._chain()
        if chain is None:
            return pinocchio_jacobians(self.arm, Q)
        values = model_values(self.arm, Q)
        return kernel.jacobians(chain, values, threads=self.threads, isa=self.engine)

    def frame_jacobians(self, Q: Array) -> Array:
        """Frame Jacobians (N, 6, n) by the free joints."""
        J, coupling = self.model_jacobians(Q), self.arm.coupling
        return J if coupling is None else J @ coupling.matrix

    def sigma(self, Q: Array) -> Array:
        """Singular values (N, min(m, n)) of the task Jacobian at the arm's length scale."""
        arm, chain = self.arm, self._chain()
        if chain is None or arm.coupling is not None or arm.task.at_tip:
            return self._svd(scale_rows(arm, self.frame_jacobians(Q), Q, self._tip(Q)))
        return kernel.singular_values(
            chain,
            Q,
            rows=arm.task.rows,
            length_scale=arm.length_scale,
            threads=self.threads,
            isa=self.engine,
        )

    def own_sigma(self, Q: Array, sigma: Array | None = None) -> Array:
        """The same at the arm's own scale, without units; out of ``sigma`` where that will do."""
        arm, scale, chain = self.arm, own_scale(self.arm), self._chain()
        if scale.of_sigma is not None:
            sigma = self.sigma(Q) if sigma is None else sigma
            return sigma if scale.of_sigma == 1.0 else sigma * scale.of_sigma
        if chain is None or arm.coupling is not None or arm.task.at_tip:
            return self._svd(scale.apply(arm, self.frame_jacobians(Q), Q, self._tip(Q)))
        return kernel.singular_values(
            self.own_chain(),
            Q / scale.columns,
            rows=arm.task.rows,
            threads=self.threads,
            isa=self.engine,
        )

    def _tip(self, Q: Array) -> Array | None:
        """Rotations of the tip on this engine, where the task asks for its axes."""
        if not self.arm.task.at_tip:
            return None
        return tip_rotations(self.arm, Q, self.engine, self.threads)

    def own_chain(self) -> FlatChain:
        """The kernel's chain of the arm as it is in its own length."""
        return self.arm.once("own_chain", self._own_chain)

    def _own_chain(self) -> FlatChain:
        chain = self._chain()
        assert chain is not None  # only the kernel has one
        return FlatChain(chain.R, chain.t / own_scale(self.arm).length, chain.prismatic)

    def _chain(self) -> FlatChain | None:
        if self.engine == PINOCCHIO:
            return None
        chain, here = batch_chain(self.arm, "batch"), kernel.isa_names()
        if self.engine not in here:
            raise EngineError(
                f"the run was planned for {self.engine}, but this machine runs "
                f"{', '.join(here)}; start it with an engine that all machines have"
            )
        return chain

    def _svd(self, J: Array) -> Array:
        if self.engine == PINOCCHIO:
            return np.asarray(np.linalg.svd(J, compute_uv=False))
        return kernel.svdvals(J, threads=self.threads, isa=self.engine)


def batch(arm: Arm, engine: str = "auto", threads: int | None = None) -> Batch:
    """Fix the engine for ``arm``, as `pinsing.kinematics.engine.fixed_engine` does.

    Raises
    ------
    EngineError
        If the engine is not there, or disagrees with Pinocchio on this arm.
    OptionError
        If there is no such engine, or ``threads`` is below 1.
    """
    return Batch(arm, fixed_engine(arm, engine), check_threads(threads))


def scale_rows(arm: Arm, J: Array, Q: Array, R: Array | None = None) -> Array:
    """Task rows (..., m, n) of frame Jacobians J (..., 6, n), translations over length scale.

    Q (..., n) is where, and ``R`` the tip's rotation there where it is known.
    """
    factor = np.where(np.array(arm.task.rows) < 3, 1.0 / arm.length_scale, 1.0)
    return np.asarray(task_rows(arm, J, Q, R) * factor[:, None])
