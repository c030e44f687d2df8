"""Find, state, prove and show the singular configurations of robot arms, on Pinocchio."""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
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
    from pinsing.loops import MechanismAnalysis, analyze_mechanism
    from pinsing.maps import MapPlan, MapResult, plan_map, sigma_map
    from pinsing.refine import SingularConfiguration, refine, refine_many
    from pinsing.robot.arm import Arm
    from pinsing.robot.load import load
    from pinsing.robot.loops import Mechanism, load_mechanism
    from pinsing.robot.nominal import Nominal, nominal
    from pinsing.state import State, at
    from pinsing.sweep import SweepResult, sweep
    from pinsing.sweep_plan import SweepPlan, plan_sweep
    from pinsing.view.viewer import Viewer

__version__ = "0.1.0"

# Where each public name lives: imported when first used, so that `import pinsing` and the
# command line's --help wait for neither Pinocchio nor NumPy.
_HOME = {
    "Analysis": "pinsing.analysis",
    "Arm": "pinsing.robot.arm",
    "ClosedForm": "pinsing.closed_form",
    "Family": "pinsing.closed_form",
    "Finding": "pinsing.find",
    "MapPlan": "pinsing.maps",
    "MapResult": "pinsing.maps",
    "Mechanism": "pinsing.robot.loops",
    "MechanismAnalysis": "pinsing.loops",
    "Nominal": "pinsing.robot.nominal",
    "PinsingError": "pinsing.errors",
    "SingularConfiguration": "pinsing.refine",
    "State": "pinsing.state",
    "SweepPlan": "pinsing.sweep_plan",
    "SweepResult": "pinsing.sweep",
    "Viewer": "pinsing.view.viewer",
    "analyze": "pinsing.analysis",
    "analyze_mechanism": "pinsing.loops",
    "at": "pinsing.state",
    "closed_form": "pinsing.closed_form",
    "frame_jacobian": "pinsing.kinematics",
    "frame_jacobians": "pinsing.kinematics",
    "generalize": "pinsing.generalize",
    "generic_rank": "pinsing.kinematics",
    "load": "pinsing.robot.load",
    "load_mechanism": "pinsing.robot.loops",
    "nominal": "pinsing.robot.nominal",
    "plan_map": "pinsing.maps",
    "plan_sweep": "pinsing.sweep_plan",
    "refine": "pinsing.refine",
    "refine_many": "pinsing.refine",
    "sigma_map": "pinsing.maps",
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
    "MapPlan",
    "MapResult",
    "Mechanism",
    "MechanismAnalysis",
    "Nominal",
    "PinsingError",
    "SingularConfiguration",
    "State",
    "SweepPlan",
    "SweepResult",
    "Viewer",
    "analyze",
    "analyze_mechanism",
    "at",
    "closed_form",
    "frame_jacobian",
    "frame_jacobians",
    "generalize",
    "generic_rank",
    "load",
    "load_mechanism",
    "nominal",
    "plan_map",
    "plan_sweep",
    "refine",
    "refine_many",
    "sigma_map",
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


class _Package(ModuleType):
    """Keeps a module from shadowing the public function that it is named after.

    Importing ``pinsing.sweep`` would make the module the attribute ``sweep`` of the package.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
