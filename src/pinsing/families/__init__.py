"""Closed forms: the complete singular set of an arm, as equations."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.algebra.conditions import Branch as Branch, JointValue as JointValue
    from pinsing.algebra.equation import Equation as Equation
    from pinsing.families.certificate import prove as prove
    from pinsing.families.describe import joint_symbols as joint_symbols
    from pinsing.families.design import (
        DesignChange as DesignChange,
        DesignFamily as DesignFamily,
        DesignForm as DesignForm,
    )
    from pinsing.families.family import Family as Family
    from pinsing.families.form import ClosedForm as ClosedForm, Proof as Proof
    from pinsing.families.solve import closed_form as closed_form
    from pinsing.families.zero_set import Distance as Distance

public(
    __name__,
    {
        "pinsing.algebra.conditions": "Branch JointValue",
        "pinsing.algebra.equation": "Equation",
        "certificate": "prove",
        "design": "DesignChange DesignFamily DesignForm",
        "family": "Family",
        "form": "ClosedForm Proof",
        "zero_set": "Distance",
        "solve": "closed_form",
        "describe": "joint_symbols",
    },
    called="pinsing.closed_form(arm).families",
)
