"""An equation solved for a joint that enters it once: ``R cos(q2 - phi) = c``.

Where one angle occurs as cos and sin of itself alone, f = A cos q + B sin q + C with A, B and C of
the other joints. With R cos phi = A, R sin phi = B and c = -C that is R cos(q - phi) = c: given the
others, q is one of two values. Where C is zero throughout they lie half a turn apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.algebra.equation import Equation
from pinsing.algebra.equation_text import format_angle, latex_symbol
from pinsing.algebra.product_form import Expression, expressions
from pinsing.prose import listed


@dataclass(frozen=True, eq=False)
class JointForm:
    """An equation as one for one of its joints.

    Attributes
    ----------
    equation : Equation
        It.
    joint : int
        The joint that it is solved for.
    kind : str
        "two": two values, or none where |c| > R. "opposite": two values half a turn apart.
        "half": one value, of half of the angle. "length": one value of a prismatic joint.
    a, b, c : Expression or None
        f = a cos q + b sin q + c ("two"); without c ("opposite"); with q/2 for q ("half");
        f = a q + c ("length"). What is zero is None.
    """

    equation: Equation
    joint: int
    kind: str
    a: Expression | None
    b: Expression | None
    c: Expression | None

    @property
    def given(self) -> tuple[int, ...]:
        """The other joints of the equation."""
        return tuple(j for j in self.equation.involved if j != self.joint)

    @property
    def solutions(self) -> int:
        """How many values there are, at most."""
        return 2 if self.kind in ("two", "opposite") else 1

    def solve(self, q: npt.ArrayLike) -> Array:
        """Values of the joint, given the others of q (..., n): (..., solutions).

        Angles in (-pi, pi]; NaN where there is none, or where every value does.
        """
        q = np.asarray(q, dtype=float)
        a, b, c = (np.zeros(q.shape[:-1]) if x is None else x(q) for x in (self.a, self.b, self.c))
        if self.kind == "length":
            with np.errstate(divide="ignore", invalid="ignore"):
                value = np.where(a == 0, np.nan, -c / a)
            return np.asarray(value[..., None])
        radius, phase = np.hypot(a, b), np.arctan2(b, a)
        with np.errstate(divide="ignore", invalid="ignore"):
            cosine = np.where(radius == 0, np.nan, -c / radius)
            turn = np.arccos(cosine)
        if self.kind == "half":
            angles = 2 * (phase + np.pi / 2)[..., None]
            angles = np.where(radius[..., None] == 0, np.nan, angles)
        else:
            angles = np.stack([phase + turn, phase - turn], axis=-1)
        angles = angles - self.equation.shift[self.joint]
        return np.asarray(np.pi - (np.pi - angles) % (2 * np.pi))

    def parts(self, exact: bool = False, latex: bool = False) -> tuple[tuple[str, str], ...]:
        """What R, phi and c are, as pairs of a name and an expression; empty if not known exactly.

        Parameters
        ----------
        exact : bool
            With exact coefficients; all of them up to one factor, which cancels.
        latex : bool
            As LaTeX.
        """
        form = joint_form(self.equation, self.joint, exact) if exact else self
        if form is None:
            return ()
        phi = r"\varphi" if latex else "φ"
        cos, sin = (r"\cos ", r"\sin ") if latex else ("cos ", "sin ")

        def said(x: Expression | None, minus: bool = False) -> str:
            return "0" if x is None else (x.negative() if minus else x).text(latex)

        if self.kind == "length":
            return (("A", said(form.a)), ("c", said(form.c, True)))
        found = [(f"R {cos}{phi}", said(form.a)), (f"R {sin}{phi}", said(form.b))]
        return (*found, ("c", said(form.c, True))) if self.kind == "two" else tuple(found)

    def condition(self, latex: bool = False) -> str:
        """``R cos(q2 - φ) = c``, and the like."""
        phi = r"\varphi" if latex else "φ"
        cos = r"\cos " if latex else "cos"
        name = self._name(latex)
        if self.kind == "length":
            return f"A {name} = c"
        if self.kind == "half":
            return f"R {cos}({name}/2 - {phi}) = 0"
        return f"R {cos}({name} - {phi}) = {'c' if self.kind == 'two' else '0'}"

    def solution(self) -> str:
        """``q2 = φ ± arccos(c/R) where |c| <= R``, and the like."""
        name, given = self._name(False), self._given()
        if self.kind == "length":
            return f"{name} = c/A: one value given {given}"
        if self.kind == "half":
            return f"{name} = 2 φ + 180°: one value given {given}"
        if self.kind == "opposite":
            return f"{name} = φ ± 90°: one of two values, half a turn apart, given {given}"
        return f"{name} = φ ± arccos(c/R) where |c| <= R: one of two values given {given}"

    def text(self) -> str:
        """The condition in one line."""
        names = "A, c" if self.kind == "length" else "R, φ, c" if self.kind == "two" else "φ"
        return f"{self.condition()}, with {names} given by {self._given()}"

    def latex(self, exact: bool = False) -> str:
        """The condition with what R, phi and c are."""
        parts = self.parts(exact, latex=True)
        return r",\ ".join([self.condition(latex=True), *(f"{a} = {b}" for a, b in parts)])

    def _given(self) -> str:
        return listed([self.equation.joints[j] for j in self.given])

    def _name(self, latex: bool) -> str:
        name = self.equation.joints[self.joint]
        name = latex_symbol(name) if latex else name
        shift = float(self.equation.shift[self.joint])
        if not shift:
            return name
        sign = "+" if shift > 0 else "-"
        shown = f"{name} {sign} {format_angle(abs(shift), latex)}"
        return f"({shown})" if self.kind == "half" else shown


def joint_form(
    equation: Equation, joint: int | None = None, exact: bool = False
) -> JointForm | None:
    """The equation as one for a joint; None if it does not enter once, or has no others beside.

    Parameters
    ----------
    equation : Equation
        The equation.
    joint : int, optional
        By default one that has values for all others, else the first that enters once.
    exact : bool
        With exact coefficients; None if they are not known.
    """
    return equation.once(f"joint form {joint} {exact}", lambda: _joint_form(equation, joint, exact))


def _joint_form(equation: Equation, joint: int | None, exact: bool) -> JointForm | None:
    if joint is None:
        found = [(j, _kind(equation, j)) for j in equation.involved]
        every = [j for j, kind in found if kind in ("opposite", "half")]
        once = [j for j, kind in found if kind]
        if not once or len(equation.involved) < 2:
            return None
        joint = (every or once)[0]
    kind = _kind(equation, joint)
    parts = expressions(equation, joint, exact) if kind else None
    if parts is None:
        return None
    half = "/2" if kind == "half" else ""
    first = ("pow", 1) if kind == "length" else (f"cos{half}", 1)
    return JointForm(
        equation, joint, kind, parts.get(first), parts.get((f"sin{half}", 1)), parts.get(("one", 0))
    )


def enters_once(equation: Equation, joint: int) -> bool:
    """Whether an equation of several joints can be solved for this one."""
    return len(equation.involved) > 1 and bool(_kind(equation, joint))


def _kind(equation: Equation, joint: int) -> str:
    """How a joint enters, if it does so once."""
    frequencies = {int(f) for f in equation.frequencies[:, joint]}
    powers = {int(p) for p in equation.powers[:, joint]}
    if powers == {0, 1} and frequencies == {0}:
        return "length"
    if powers != {0} or frequencies == {0}:
        return ""
    if frequencies <= {1, -1}:
        return "half"
    if frequencies <= {0, 2, -2}:  # twice its multiples
        return "two" if 0 in frequencies else "opposite"
    return ""
