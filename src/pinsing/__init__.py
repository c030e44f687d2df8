"""Find, state, prove and show the singular configurations of robot arms, on Pinocchio."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from pinsing._version import __version__ as __version__

if TYPE_CHECKING:
    from pinsing.configuration.at import State, at
    from pinsing.configuration.refine import SingularConfiguration, refine, refine_many
    from pinsing.errors import PinsingError
    from pinsing.families import ClosedForm, DesignForm, Family, closed_form
    from pinsing.kinematics.inverse_velocity import InverseVelocity, inverse_velocity
    from pinsing.kinematics.jacobian import (
        frame_jacobian,
        frame_jacobians,
        generic_rank,
        singular_values,
        task_jacobian,
        task_jacobians,
    )
    from pinsing.loops import (
        MechanismAnalysis,
        MechanismMap,
        Modes,
        analyze_mechanism,
        assembly_modes,
        mechanism_map,
        working_modes,
    )
    from pinsing.postures.aspects import Aspects, aspects
    from pinsing.postures.changes import PostureChanges, posture_changes
    from pinsing.postures.connection import Connection, connect
    from pinsing.postures.cuspidal import Cuspidality, cuspidality
    from pinsing.postures.inverse import inverse
    from pinsing.postures.inverse_solutions import InverseSolutions
    from pinsing.postures.motions import aspect_changes, line_postures
    from pinsing.postures.toolpath import plan_path
    from pinsing.proximity.clearance import Clearance, clearance, is_clear
    from pinsing.proximity.crossings import Crossing, Crossings, crossings
    from pinsing.proximity.guard import export_guard
    from pinsing.proximity.line import LineCheck, check_line
    from pinsing.proximity.monitor import Monitor, Verdict
    from pinsing.proximity.suggestion import Suggestion, suggest
    from pinsing.proximity.trajectory import TrajectoryCheck, check_trajectory
    from pinsing.report.write import write_report
    from pinsing.robot.arm import Arm
    from pinsing.robot.load import load
    from pinsing.robot.load_mechanism import Mechanism, load_mechanism
    from pinsing.robot.nominal import Nominal, nominal
    from pinsing.sampling import (
        MapResult,
        plan_map,
        sigma_map,
    )
    from pinsing.sampling.analyze import Analysis, analyze
    from pinsing.sampling.findings import singular_configurations
    from pinsing.sampling.generalize import Finding, generalize
    from pinsing.sampling.sweep_plan import SweepPlan, plan_sweep
    from pinsing.sampling.sweep_run import SweepResult, sweep
    from pinsing.view.viewer import Viewer

# Where each public name lives: imported when first used, so that `import pinsing` and the
# command line's --help wait for neither Pinocchio nor NumPy.
_HOME = {
    "Analysis": "pinsing.sampling.analyze",
    "Arm": "pinsing.robot.arm",
    "Aspects": "pinsing.postures.aspects",
    "Clearance": "pinsing.proximity.clearance",
    "ClosedForm": "pinsing.families",
    "Connection": "pinsing.postures.connection",
    "Crossing": "pinsing.proximity.crossings",
    "Crossings": "pinsing.proximity.crossings",
    "Cuspidality": "pinsing.postures.cuspidal",
    "DesignForm": "pinsing.families",
    "Family": "pinsing.families",
    "Finding": "pinsing.sampling.generalize",
    "InverseSolutions": "pinsing.postures.inverse_solutions",
    "InverseVelocity": "pinsing.kinematics.inverse_velocity",
    "LineCheck": "pinsing.proximity.line",
    "MapResult": "pinsing.sampling",
    "Mechanism": "pinsing.robot.load_mechanism",
    "MechanismAnalysis": "pinsing.loops",
    "MechanismMap": "pinsing.loops",
    "Modes": "pinsing.loops",
    "Monitor": "pinsing.proximity.monitor",
    "Nominal": "pinsing.robot.nominal",
    "PinsingError": "pinsing.errors",
    "PostureChanges": "pinsing.postures.changes",
    "SingularConfiguration": "pinsing.configuration.refine",
    "State": "pinsing.configuration.at",
    "Suggestion": "pinsing.proximity.suggestion",
    "SweepPlan": "pinsing.sampling.sweep_plan",
    "SweepResult": "pinsing.sampling.sweep_run",
    "TrajectoryCheck": "pinsing.proximity.trajectory",
    "Verdict": "pinsing.proximity.monitor",
    "Viewer": "pinsing.view.viewer",
    "analyze": "pinsing.sampling.analyze",
    "analyze_mechanism": "pinsing.loops",
    "assembly_modes": "pinsing.loops",
    "aspect_changes": "pinsing.postures.motions",
    "aspects": "pinsing.postures.aspects",
    "at": "pinsing.configuration.at",
    "check_line": "pinsing.proximity.line",
    "check_trajectory": "pinsing.proximity.trajectory",
    "clearance": "pinsing.proximity.clearance",
    "closed_form": "pinsing.families",
    "connect": "pinsing.postures.connection",
    "crossings": "pinsing.proximity.crossings",
    "cuspidality": "pinsing.postures.cuspidal",
    "export_guard": "pinsing.proximity.guard",
    "frame_jacobian": "pinsing.kinematics.jacobian",
    "frame_jacobians": "pinsing.kinematics.jacobian",
    "generalize": "pinsing.sampling.generalize",
    "generic_rank": "pinsing.kinematics.jacobian",
    "inverse": "pinsing.postures.inverse",
    "inverse_velocity": "pinsing.kinematics.inverse_velocity",
    "is_clear": "pinsing.proximity.clearance",
    "line_postures": "pinsing.postures.motions",
    "load": "pinsing.robot.load",
    "load_mechanism": "pinsing.robot.load_mechanism",
    "mechanism_map": "pinsing.loops",
    "nominal": "pinsing.robot.nominal",
    "plan_map": "pinsing.sampling",
    "plan_path": "pinsing.postures.toolpath",
    "plan_sweep": "pinsing.sampling.sweep_plan",
    "posture_changes": "pinsing.postures.changes",
    "refine": "pinsing.configuration.refine",
    "refine_many": "pinsing.configuration.refine",
    "sigma_map": "pinsing.sampling",
    "singular_configurations": "pinsing.sampling.findings",
    "singular_values": "pinsing.kinematics.jacobian",
    "suggest": "pinsing.proximity.suggestion",
    "sweep": "pinsing.sampling.sweep_run",
    "task_jacobian": "pinsing.kinematics.jacobian",
    "task_jacobians": "pinsing.kinematics.jacobian",
    "working_modes": "pinsing.loops",
    "write_report": "pinsing.report.write",
}

__all__ = [
    "Analysis",
    "Arm",
    "Aspects",
    "Clearance",
    "ClosedForm",
    "Connection",
    "Crossing",
    "Crossings",
    "Cuspidality",
    "DesignForm",
    "Family",
    "Finding",
    "InverseSolutions",
    "InverseVelocity",
    "LineCheck",
    "MapResult",
    "Mechanism",
    "MechanismAnalysis",
    "MechanismMap",
    "Modes",
    "Monitor",
    "Nominal",
    "PinsingError",
    "PostureChanges",
    "SingularConfiguration",
    "State",
    "Suggestion",
    "SweepPlan",
    "SweepResult",
    "TrajectoryCheck",
    "Verdict",
    "Viewer",
    "analyze",
    "analyze_mechanism",
    "aspect_changes",
    "aspects",
    "assembly_modes",
    "at",
    "check_line",
    "check_trajectory",
    "clearance",
    "closed_form",
    "connect",
    "crossings",
    "cuspidality",
    "export_guard",
    "frame_jacobian",
    "frame_jacobians",
    "generalize",
    "generic_rank",
    "inverse",
    "inverse_velocity",
    "is_clear",
    "line_postures",
    "load",
    "load_mechanism",
    "mechanism_map",
    "nominal",
    "plan_map",
    "plan_path",
    "plan_sweep",
    "posture_changes",
    "refine",
    "refine_many",
    "sigma_map",
    "singular_configurations",
    "singular_values",
    "suggest",
    "sweep",
    "task_jacobian",
    "task_jacobians",
    "working_modes",
    "write_report",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'pinsing' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
