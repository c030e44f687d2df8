"""Closed forms: the complete singular set of an arm, as equations."""

from pinsing.closed_form.build import ClosedForm, closed_form, joint_symbols
from pinsing.closed_form.expression import Equation
from pinsing.closed_form.family import Branch, Distance, Family, JointValue

__all__ = [
    "Branch",
    "ClosedForm",
    "Distance",
    "Equation",
    "Family",
    "JointValue",
    "closed_form",
    "joint_symbols",
]
