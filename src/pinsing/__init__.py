"""Find, state, prove and show the singular configurations of robot arms, on Pinocchio."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pinsing.analysis import Analysis, analyze
    from pinsing.closed_form import ClosedForm, Family, closed_form
    from pinsing.errors import PinsingError
    from pinsing.find import Finding, singular_configurations
    from pinsing.generalize import generalize
    from pinsing.kinematics import (
        frame_jacobian,
        frame_jacobians,
        generic_rank,
        singular_values,
        task_jacobian,
        task_jacobians,
    )
    from pinsing.refine import SingularConfiguration, refine, refine_many
    from pinsing.robot.arm import Arm
    from pinsing.robot.load import load
    from pinsing.robot.nominal import Nominal, nominal
    from pinsing.state import State, at
    from pinsing.sweep import SweepResult, sweep
    from pinsing.sweep_plan import SweepPlan, plan_sweep

__version__ = "0.1.0"

# Where each public name lives: imported when first used, so that `import pinsing` and the
# command line's --help wait for neither Pinocchio nor NumPy.
_HOME = {
    "Analysis": "pinsing.analysis",
    "Arm": "pinsing.robot.arm",
    "ClosedForm": "pinsing.closed_form",
    "Family": "pinsing.closed_form",
    "Finding": "pinsing.find",
    "Nominal": "pinsing.robot.nominal",
    "PinsingError": "pinsing.errors",
    "SingularConfiguration": "pinsing.refine",
    "State": "pinsing.state",
    "SweepPlan": "pinsing.sweep_plan",
    "SweepResult": "pinsing.sweep",
    "analyze": "pinsing.analysis",
    "at": "pinsing.state",
    "closed_form": "pinsing.closed_form",
    "frame_jacobian": "pinsing.kinematics",
    "frame_jacobians": "pinsing.kinematics",
    "generalize": "pinsing.generalize",
    "generic_rank": "pinsing.kinematics",
    "load": "pinsing.robot.load",
    "nominal": "pinsing.robot.nominal",
    "plan_sweep": "pinsing.sweep_plan",
    "refine": "pinsing.refine",
    "refine_many": "pinsing.refine",
    "singular_configurations": "pinsing.find",
    "singular_values": "pinsing.kinematics",
    "sweep": "pinsing.sweep",
    "task_jacobian": "pinsing.kinematics",
    "task_jacobians": "pinsing.kinematics",
}

__all__ = [
    "Analysis",
    "Arm",
    "ClosedForm",
    "Family",
    "Finding",
    "Nominal",
    "PinsingError",
    "SingularConfiguration",
    "State",
    "SweepPlan",
    "SweepResult",
    "analyze",
    "at",
    "closed_form",
    "frame_jacobian",
    "frame_jacobians",
    "generalize",
    "generic_rank",
    "load",
    "nominal",
    "plan_sweep",
    "refine",
    "refine_many",
    "singular_configurations",
    "singular_values",
    "sweep",
    "task_jacobian",
    "task_jacobians",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'pinsing' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
