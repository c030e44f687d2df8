"""Closed loops: solving, modes and singularities of mechanisms."""

from pinsing._package import public
from pinsing.loops.analysis import MechanismAnalysis, analyze_mechanism
from pinsing.loops.closure import ranks, residual
from pinsing.loops.forms import JointForms, JointLocus, PoseEquation, PoseForms, PoseLocus
from pinsing.loops.joint_loci import Locus, LoopForms, joint_forms, loop_forms
from pinsing.loops.map import MechanismMap, WorstConfiguration, mechanism_map
from pinsing.loops.motion import (
    MechanismState,
    Pose,
    home,
    input_output,
    leg_form,
    mechanism_at,
    mode_of,
    motions,
)
from pinsing.loops.pose_loci import pose_forms
from pinsing.loops.solve import (
    InfeasibleError,
    Modes,
    SingularPoint,
    Solution,
    Trace,
    assemblies,
    assembly_modes,
    curves,
    drive,
    feasible,
    find_singular,
    follow,
    refine_point as refine,
    solve,
    trace,
    working_modes,
)

__all__ = [
    "InfeasibleError",
    "JointForms",
    "JointLocus",
    "Locus",
    "LoopForms",
    "MechanismAnalysis",
    "MechanismMap",
    "MechanismState",
    "Modes",
    "Pose",
    "PoseEquation",
    "PoseForms",
    "PoseLocus",
    "SingularPoint",
    "Solution",
    "Trace",
    "WorstConfiguration",
    "analyze_mechanism",
    "assemblies",
    "assembly_modes",
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
    "mechanism_map",
    "mode_of",
    "motions",
    "pose_forms",
    "ranks",
    "refine",
    "residual",
    "solve",
    "trace",
    "working_modes",
]

public(__name__, {}, called="pinsing.load_mechanism(robot)")
