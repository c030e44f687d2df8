"""Which engine computes batches of Jacobians: the compiled kernel, or Pinocchio's own loop.

Pinocchio is the authority. Before the kernel is used for an arm it is compared with
``pin.computeFrameJacobian`` at random configurations, and refused if it differs.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pinsing._batch import engine as kernel
from pinsing._batch.engine import FlatChain
from pinsing._types import Array
from pinsing.errors import EngineError, OptionError
from pinsing.robot.arm import Arm
from pinsing.robot.chain import flatten

PINOCCHIO = "pinocchio"
ENGINES = ("auto", "batch", PINOCCHIO)
INSTRUCTION_SETS = ("baseline", "avx2", "avx512")
AGREEMENT = 1e-12
"""Largest difference from Pinocchio, relative to the largest placement or translation."""

_CONFIGURATIONS = 16
_SEED = 90210


def batch_chain(arm: Arm, engine: str = "auto") -> FlatChain | None:
    """Chain of ``arm`` for the compiled kernel, or None where Pinocchio's loop is to run.

    Parameters
    ----------
    engine : str
        "auto" (the kernel where it is installed and agrees), "batch" (the kernel or an
        error), or "pinocchio".

    Raises
    ------
    EngineError
        If "batch" is asked for and not installed, or it disagrees with Pinocchio.
    OptionError
        If there is no such engine.
    """
    if engine not in ENGINES:
        raise OptionError(f"unknown engine {engine!r}: use one of {', '.join(ENGINES)}")
    if engine == PINOCCHIO:
        return None
    reason = kernel.unavailable_reason()
    if reason is not None:
        if engine == "batch":
            raise EngineError(reason)
        return None
    found = arm.once("batch_chain", lambda: _verified(arm))
    if isinstance(found, FlatChain):
        return found
    if engine == "batch":
        raise EngineError(str(found))
    return None


def fixed_engine(arm: Arm, engine: str = "auto") -> str:
    """``pinocchio``, or the instruction set that an engine means here.

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
    here = kernel.isa_names()
    if engine in here:
        batch_chain(arm, "batch")
        return engine
    if engine not in ENGINES:
        if engine in INSTRUCTION_SETS:
            has = ", ".join(here) or "no compiled kernel"
            if here and engine not in kernel.built_names():
                raise EngineError(
                    f"engine {engine} was not compiled here; this installation has {has} "
                    "(pip install -e . in the clone compiles all)"
                )
            raise EngineError(f"engine {engine} does not run on this machine; it has {has}")
        names = dict.fromkeys((*ENGINES, *here))
        raise OptionError(f"unknown engine {engine!r}: use one of {', '.join(names)}")
    return PINOCCHIO if batch_chain(arm, engine) is None else here[-1]


def check_threads(threads: int | None) -> int | None:
    """``threads`` as it is, or an error if it is not a positive number of threads.

    Raises
    ------
    OptionError
        If it is below 1.
    """
    if threads is not None and threads < 1:
        raise OptionError(f"threads must be at least 1, got {threads}")
    return threads


def engine_name(arm: Arm) -> str:
    """Say in a few words what computes batches for ``arm`` on this machine."""
    if batch_chain(arm) is not None:
        return f"compiled batch kernel ({kernel.isa_names()[-1]}), checked against Pinocchio"
    reason = kernel.unavailable_reason() or str(arm.once("batch_chain", lambda: _verified(arm)))
    return f"Pinocchio and NumPy ({reason})"


def model_values(arm: Arm, Q: Array) -> Array:
    """Plain value of every joint of the model, mimic joints included: (N, n) -> (N, nv)."""
    return Q if arm.coupling is None else arm.coupling.values(Q)


def pinocchio_jacobians(arm: Arm, Q: Array) -> Array:
    """Frame Jacobians (N, 6, nv) by every velocity of the model, mimic joints on their own."""
    model, tip = arm.model, arm.tip_id
    data = model.createData()  # a Data of its own: threads may share the arm
    frame, compute = pin.LOCAL_WORLD_ALIGNED, pin.computeFrameJacobian
    out = np.empty((len(Q), 6, model.nv))
    for i, q in enumerate(arm.model_q(Q)):
        # Pinocchio drops the second axis of a single column.
        out[i] = compute(model, data, q, tip, frame).reshape(6, model.nv)
    return out


def _verified(arm: Arm) -> FlatChain | str:
    """The flat chain if the kernel agrees with Pinocchio on it, else why it may not be used."""
    plain = flatten(arm)
    try:
        chain = FlatChain(plain.R, plain.t, plain.prismatic)
    except ValueError as unfit:
        return f"the chain does not suit the compiled kernel: {unfit}"
    rng = np.random.default_rng(_SEED)
    size = float(np.abs(plain.t).max()) or 1.0
    Q = rng.uniform(-1, 1, (_CONFIGURATIONS, arm.n)) * np.where(arm.prismatic, size, 2 * np.pi)
    ours, theirs = kernel.jacobians(chain, model_values(arm, Q)), pinocchio_jacobians(arm, Q)
    moved, turned = np.abs(ours - theirs).max(axis=(0, 2)).reshape(2, 3).max(axis=1)
    error = max(float(turned), float(moved) / max(size, float(np.abs(theirs[:, :3]).max())))
    if not error <= AGREEMENT:
        return f"the compiled kernel differs from Pinocchio by {error:.1e} on this arm"
    return chain
