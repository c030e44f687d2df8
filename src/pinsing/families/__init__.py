"""Closed forms: the complete singular set of an arm, as equations."""

from pinsing.algebra.equation import Equation
from pinsing.families.family import Branch, Distance, Family, JointValue
from pinsing.families.proving import Proof, prove
from pinsing.families.solve import ClosedForm, closed_form, joint_symbols

__all__ = [
    "Branch",
    "ClosedForm",
    "Distance",
    "Equation",
    "Family",
    "JointValue",
    "Proof",
    "closed_form",
    "joint_symbols",
    "prove",
]
