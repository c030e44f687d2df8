"""Families of an arm whose lengths are symbols, and where the design changes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from pinsing.algebra.equation import Equation, equation, format_angle
from pinsing.algebra.ring import Poly, Ring
from pinsing.arguments import checked
from pinsing.errors import ConfigurationError, UnknownNameError
from pinsing.measures import Array, ArrayLike
from pinsing.serialization import JsonResult


@dataclass(frozen=True)
class DesignNames:
    """The names and offsets that polynomials of a design are written with."""

    ring: Ring  # of the polynomials: in joints, then in symbols
    n: int  # number of joints
    names: tuple[str, ...]  # of joints and symbols
    offset: Array  # radians added to each that is an angle

    def equation(self, poly: Poly) -> Equation:
        """The polynomial as a sum of cosines and sines."""
        return equation(poly, self.ring, self.names, self.offset)

    def text(self, poly: Poly) -> str:
        """Its zeros in one line."""
        return text_of(self.equation(poly))

    def moves(self, poly: Poly) -> bool:
        """Return True if a joint occurs."""
        return any(j < self.n for j in self.ring.joints_of(poly))


def text_of(e: Equation, latex: bool = False) -> str:
    """An equation as one reads it, its coefficients exact."""
    written = int((e.cos != 0).sum() + (e.sin != 0).sum())
    # Terms beyond which an equation is told by its size.
    if written > 24 and not latex:
        return f"f({', '.join(e.joints[j] for j in e.involved)}) = 0 [{len(e.cos)} terms]"
    # Characters of a coefficient up to which it is written exactly: lengths have more.
    whole = all(len(c) <= 4 for pair in e.exact for c in pair)
    return (whole and e.exact_text(latex)) or (e.latex() if latex else e.text())


EVERYWHERE = "singular everywhere"


@dataclass(frozen=True, eq=False)
class DesignFamily:
    """One family, for lengths in general.

    Attributes
    ----------
    name : str
        F1, F2, ...
    text, latex : str
        Its equations, exactly: ``a2 cos q2 + a3 cos(q2+q3) - d5 sin(q2+q3+q4) = 0``.
    equations : tuple of Equation
        In the joints, and after these the symbols, as in ``DesignForm.variables``.
    codimension : int
        How many equations it takes.
    """

    name: str
    text: str
    latex: str
    equations: tuple[Equation, ...]
    codimension: int

    def __str__(self) -> str:
        return f"{self.name}  {self.text}"


@dataclass(frozen=True)
class DesignChange:
    """What becomes of a family at special lengths.

    Attributes
    ----------
    condition : str
        ``a5 = 0``, ``a2 = -a3``.
    family : str
        Its name; empty where all of the arm is meant, or a family that is not there in general.
    kind : str
        ``splits``, ``merges``, ``becomes``, ``vanishes``, ``appears`` or ``singular everywhere``.
    into : tuple of str
        Equations, or names of families.
    """

    condition: str
    family: str
    kind: str
    into: tuple[str, ...]

    def __str__(self) -> str:
        into = "; ".join(self.into)
        more = "one family" if len(self.into) == 1 else f"{len(self.into)} families"
        return f"at {self.condition}: " + {
            "splits": f"{self.family} splits into {len(self.into)}: {into}",
            "merges": f"{self.family} is the same as, or has a part of, {into}",
            "becomes": f"{self.family} becomes {into}",
            "vanishes": f"{self.family} has no configuration any more",
            "appears": f"{more} more, {into}",
            EVERYWHERE: "every configuration is singular",
        }.get(self.kind, self.kind)


@dataclass(frozen=True, eq=False, repr=False)
class DesignForm(JsonResult):
    """Closed form of an arm whose lengths are symbols.

    Attributes
    ----------
    robot : str
        Name of the robot.
    joints : tuple of str
        Symbols of the joints, as q1, d3.
    symbols : tuple of str
        The lengths, and twists, that stayed symbols.
    values : tuple of float
        Their values in the file, metres and radians.
    generic_rank : int
        For lengths in general.
    families : tuple of DesignFamily
        Those that lengths in general have.
    assumed : tuple of str
        What was assumed, such as ``a2 ≠ 0``: else every configuration is singular.
    changes : tuple of DesignChange
        Where a length that is zero, or two that are equal but for the sign, change the answer. Of
        families of one equation; those of more are looked at by putting numbers in.
    complete : bool
        Whether the search ended.
    gaps : tuple of str
        What is missing, where it did not.
    seconds : float
        How long it took.
    angles : tuple of bool
        Which symbols are twists.
    """

    schema: ClassVar[str] = "pinsing/design/1"
    made_by: ClassVar[str] = "pinsing.closed_form(arm, symbols=True)"

    robot: str
    joints: tuple[str, ...]
    symbols: tuple[str, ...]
    values: tuple[float, ...]
    generic_rank: int
    families: tuple[DesignFamily, ...]
    assumed: tuple[str, ...]
    changes: tuple[DesignChange, ...]
    complete: bool
    gaps: tuple[str, ...]
    seconds: float
    angles: tuple[bool, ...] = field(default=(), metadata={"optional": True})

    @property
    def variables(self) -> tuple[str, ...]:
        """Variables of the equations: joints, then symbols."""
        return self.joints + self.symbols

    @checked
    def residuals(
        self, family: str, q: ArrayLike, lengths: Mapping[str, float] | None = None
    ) -> Array:
        """Return the values of the equations of a family at q with numbers put in for its symbols.

        Parameters
        ----------
        family : str
            Its name.
        q : (..., n) array_like
            Radians and metres.
        lengths : mapping of str to float, optional
            Metres, and radians for twists; those that are left out are as in the file.

        Returns
        -------
        (..., k) array
            Zero on the family, each over the sum of its coefficients' magnitudes.

        Raises
        ------
        UnknownNameError
            If there is no such family, or no such symbol.
        ConfigurationError
            If q has not n values.

        Examples
        --------
        >>> import pinsing
        >>> form = pinsing.closed_form(pinsing.load("ur5"), symbols=True)
        >>> form.families[1].text
        'sin q3 = 0'
        >>> form.residuals("F2", [0, 1, 0, 1, 1, 1], {"elbow_joint_x": 0.7})
        array([0.])
        """
        found = next((f for f in self.families if f.name == family), None)
        if found is None:
            raise UnknownNameError("family", family, tuple(f.name for f in self.families))
        given = dict(lengths or {})
        for name in given:
            UnknownNameError.refuse_if(name not in self.symbols, "length", name, self.symbols)
        array = np.asarray(q, dtype=float)
        ConfigurationError.refuse_if(
            array.shape[-1:] != (len(self.joints),),
            f"q needs {len(self.joints)} values for {', '.join(self.joints)}, got shape "
            f"{array.shape}",
        )
        numbers = [given.get(s, v) for s, v in zip(self.symbols, self.values, strict=True)]
        rest = np.broadcast_to(numbers, (*array.shape[:-1], len(numbers)))
        whole = np.concatenate([array, rest], axis=-1)
        return np.stack([e(whole) / e.size for e in found.equations], axis=-1)

    def __str__(self) -> str:
        angles = self.angles or (False,) * len(self.symbols)
        known = ", ".join(
            f"{s} = {format_angle(v) if angle else f'{v:g} m'}"
            for s, v, angle in zip(self.symbols, self.values, angles, strict=True)
        )
        what = "lengths and twists" if any(angles) else "lengths"
        word = "complete" if self.complete else "NOT complete"
        many = "family" if len(self.families) == 1 else "families"
        lines = [
            f"{self.robot}: {len(self.families)} {many} of singular configurations, {word}, for "
            f"{what} in general ({1e3 * self.seconds:.0f} ms)",
            f"  symbols, and what the file has: {known}",
            *(f"  {f}" for f in self.families),
        ]
        if self.assumed:
            lines.append(
                f"  assumed: {', '.join(self.assumed)} (else every configuration is singular)"
            )
        if self.changes:
            lines.append("  where the design changes the answer:")
            lines += [f"    {c}" for c in self.changes]
        lines += [f"  missing: {gap}" for gap in self.gaps]
        return "\n".join(lines)
