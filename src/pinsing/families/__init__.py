"""Closed forms: the complete singular set of an arm, as equations."""

from pinsing.algebra.equation import Equation
from pinsing.families.design_form import DesignChange, DesignFamily, DesignForm
from pinsing.families.family import Family
from pinsing.families.form import ClosedForm
from pinsing.families.nearness import Distance
from pinsing.families.parts import Branch, JointValue
from pinsing.families.proof import Proof
from pinsing.families.proving import prove
from pinsing.families.solve import closed_form, joint_symbols

__all__ = [
    "Branch",
    "ClosedForm",
    "DesignChange",
    "DesignFamily",
    "DesignForm",
    "Distance",
    "Equation",
    "Family",
    "JointValue",
    "Proof",
    "closed_form",
    "joint_symbols",
    "prove",
]
