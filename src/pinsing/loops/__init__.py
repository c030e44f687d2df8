"""Closed loops: solving, modes and singularities of mechanisms."""

from pinsing.loops.analysis import MechanismAnalysis, analyze_mechanism
from pinsing.loops.closure import constraint_jacobian, output_jacobian, ranks, residual, split
from pinsing.loops.drive import Stretch, drive, stretch
from pinsing.loops.feasible import curves, feasible
from pinsing.loops.loci import Locus, LoopForms, loop_forms
from pinsing.loops.modes import home, mode_of
from pinsing.loops.motion import MechanismState, input_output, leg_form, mechanism_at, motions
from pinsing.loops.singular import SingularPoint, find_singular, refine
from pinsing.loops.solve import InfeasibleError, Solution, assemblies, follow, solve
from pinsing.loops.trace import Trace, trace

__all__ = [
    "InfeasibleError",
    "Locus",
    "LoopForms",
    "MechanismAnalysis",
    "MechanismState",
    "SingularPoint",
    "Solution",
    "Stretch",
    "Trace",
    "analyze_mechanism",
    "assemblies",
    "constraint_jacobian",
    "curves",
    "drive",
    "feasible",
    "find_singular",
    "follow",
    "home",
    "input_output",
    "leg_form",
    "loop_forms",
    "mechanism_at",
    "mode_of",
    "motions",
    "output_jacobian",
    "ranks",
    "refine",
    "residual",
    "solve",
    "split",
    "stretch",
    "trace",
]
