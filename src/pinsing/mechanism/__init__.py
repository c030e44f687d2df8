"""Closed loops: solving, modes and singularities of mechanisms."""

from pinsing.mechanism.analysis import analyze_mechanism
from pinsing.mechanism.closure import constraint_jacobian, output_jacobian, ranks, residual, split
from pinsing.mechanism.drive import Stretch, drive, stretch
from pinsing.mechanism.feasible import curves, feasible
from pinsing.mechanism.joint_forms import JointForms, JointLocus
from pinsing.mechanism.joint_loci import joint_forms
from pinsing.mechanism.loci import Locus, LoopForms, loop_forms
from pinsing.mechanism.modes import home, mode_of
from pinsing.mechanism.motion import MechanismState, input_output, leg_form, mechanism_at, motions
from pinsing.mechanism.pose import Pose
from pinsing.mechanism.pose_equation import PoseEquation
from pinsing.mechanism.pose_forms import PoseForms, PoseLocus
from pinsing.mechanism.pose_loci import pose_forms
from pinsing.mechanism.problems import Modes, assemblies, assembly_modes, working_modes
from pinsing.mechanism.result import MechanismAnalysis
from pinsing.mechanism.singular_points import SingularPoint, find_singular
from pinsing.mechanism.singular_points import refine_point as refine
from pinsing.mechanism.solve import InfeasibleError, Solution, follow, solve
from pinsing.mechanism.trace import Trace, trace

__all__ = [
    "InfeasibleError",
    "JointForms",
    "JointLocus",
    "Locus",
    "LoopForms",
    "MechanismAnalysis",
    "MechanismState",
    "Modes",
    "Pose",
    "PoseEquation",
    "PoseForms",
    "PoseLocus",
    "SingularPoint",
    "Solution",
    "Stretch",
    "Trace",
    "analyze_mechanism",
    "assemblies",
    "assembly_modes",
    "constraint_jacobian",
    "curves",
    "drive",
    "feasible",
    "find_singular",
    "follow",
    "home",
    "input_output",
    "joint_forms",
    "leg_form",
    "loop_forms",
    "mechanism_at",
    "mode_of",
    "motions",
    "output_jacobian",
    "pose_forms",
    "ranks",
    "refine",
    "residual",
    "solve",
    "split",
    "stretch",
    "trace",
    "working_modes",
]
