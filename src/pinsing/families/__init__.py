"""Closed forms: the complete singular set of an arm, as equations."""

from typing import TYPE_CHECKING, Any

from pinsing.algebra.equation import Equation
from pinsing.families.certainty import Proof
from pinsing.families.family import Family
from pinsing.families.form import ClosedForm
from pinsing.families.nearness import Distance
from pinsing.families.parts import Branch, JointValue
from pinsing.families.proving import prove
from pinsing.families.solve import closed_form, joint_symbols

if TYPE_CHECKING:
    from pinsing.families.design_form import DesignChange, DesignFamily, DesignForm

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


def __getattr__(name: str) -> Any:
    """Import what lengths as symbols need where they are asked for."""
    if name not in ("DesignChange", "DesignFamily", "DesignForm"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from pinsing.families import design_form

    return getattr(design_form, name)
