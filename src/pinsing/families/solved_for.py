"""A long equation as a person uses it: solved for a joint that enters once, given the others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pinsing._dataclass import dataclass
from pinsing.algebra.equation import Equation
from pinsing.algebra.joint_form import JointForm, joint_form

LONG = 12
"""An equation with more terms than this is stated for one of its joints, not written out."""


@dataclass(frozen=True)
class SolvedFor:
    """An equation that says what one joint is, given the others.

    Attributes
    ----------
    joint : str
        Symbol of the joint, as q2.
    given : tuple of str
        Symbols of the others.
    values : int
        How many values it has at most: 1 or 2.
    condition : str
        ``R cos(q2 - φ) = c``.
    solution : str
        What follows for the joint.
    where : tuple of (str, str)
        R cos φ, R sin φ and c, each with its expression in the other joints, up to one factor.
    exact : tuple of (str, str)
        The same with exact coefficients; empty where they are not known.
    latex, exact_latex : str
        The same in LaTeX.
    """

    joint: str
    given: tuple[str, ...]
    values: int
    condition: str
    solution: str
    where: tuple[tuple[str, str], ...]
    exact: tuple[tuple[str, str], ...]
    latex: str
    exact_latex: str


def long_form(equation: Equation) -> JointForm | None:
    """How a long equation is stated; None for short ones, and where no joint enters once."""
    return joint_form(equation) if len(equation.cos) > LONG else None


def solved_for(systems: Iterable[Sequence[Equation]]) -> tuple[SolvedFor, ...]:
    """The long equations that stand alone in a system, each once.

    Several that hold at once do not each leave the other joints free.
    """
    alone = [system[0] for system in systems if len(system) == 1]
    found = [form for e in alone if (form := long_form(e)) is not None]
    return tuple(dict.fromkeys(_stated(form) for form in found))


def _stated(form: JointForm) -> SolvedFor:
    exact = form.parts(exact=True)
    return SolvedFor(
        joint=form.equation.joints[form.joint],
        given=tuple(form.equation.joints[j] for j in form.given),
        values=form.solutions,
        condition=form.condition(),
        solution=form.solution(),
        where=form.parts(),
        exact=exact,
        latex=form.latex(),
        exact_latex=form.latex(exact=True) if exact else "",
    )
