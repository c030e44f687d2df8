"""A family of singular configurations: its equations, and what is known of it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.algebra.components import Component
from pinsing.algebra.equation import Equation
from pinsing.algebra.equation_text import latex_symbol
from pinsing.arguments import checked
from pinsing.errors import ConfigurationError
from pinsing.families.at_once import LONG, AtOnce, SolvedFor, long_form, long_ones
from pinsing.families.members import Members
from pinsing.families.nearness import Confirm
from pinsing.families.parts import Branch, KindPart, ValueReach, reach_words
from pinsing.measures import Reachability
from pinsing.notebook import formula, legend, marked, name, table, text
from pinsing.prose import listed
from pinsing.robot.arm import Arm
from pinsing.serialization import JsonResult

_HEADER = ("", "singular where", "kind", "reachable", "why")
_TONES: dict[bool | None, str] = {True: "alarm", False: "good"}


def families_table(rows: Iterable[Sequence[str]], named: Iterable[tuple[str, str]]) -> str:
    """Rows of families with their header, and the joints that their symbols stand for."""
    where = legend((latex_symbol(symbol), joint) for symbol, joint in named if symbol != joint)
    return table(rows, _HEADER) + where


def family_row(
    called: str, latex: str, short: str, kind: str, inside: bool | None, reach: str, reason: str
) -> tuple[str, ...]:
    """The cells of a family: its equations behind ``short``, where that is given."""
    tone = _TONES.get(inside)
    reachable = marked(reach, tone) if tone else text(reach)
    return name(called), formula(latex, short), text(kind), reachable, text(reason)


@dataclass(frozen=True, eq=False)
class Family(Members, JsonResult):
    """A component of the singular set of an arm, joined with its mirror images.

    Attributes
    ----------
    name : str
        ``F1``, ``F2``, ... in the order of the closed form.
    text, latex : str
        The condition in one line.
    branches : tuple of Branch
        The pieces whose union the family is.
    joints : tuple of str
        Names, in the model, of the joints involved.
    codimension : int
        Number of joints minus the dimension at a generic real point.
    proof : str
        "algebra" if every minor was shown to vanish by division; "generic points" if that was
        decided at random points of every component, exactly, modulo a prime of 62 bits.
    real : bool
        Whether a real point was found; looked for as ``sample`` looks, but within the time of the
        closed form. False does not prove that there is none.
    reachability : Reachability
        A text too: "reachable" (with ``witness``), "at the joint limit" (beyond it by less
        than the angle tolerance, as by a rounded 1.5708; see ``limits_met``), "not reachable"
        (proven), or "none found".
    limit_tolerance : (n,) array or None
        By how much the limits count as wider; None: by nothing.
    value_reach : tuple of ValueReach
        Each value that the family fixes a joint at, and whether the limits allow it.
    limits_met : tuple of str
        Limits that the family lies a little beyond, with both numbers.
    witness : (n,) array or None
        A configuration of the family inside the joint limits, wider by ``limit_tolerance`` where
        the family is at them.
    generic : (n,) array or None
        A generic configuration of it; the witness where there is one.
    rank : int or None
        Rank of the task Jacobian at the generic point.
    lost : tuple of str
        The motion lost there, in words.
    kind : str
        "boundary", "interior" or "undecided" where all points that were looked at, 32 at most,
        agree, which is no proof for the others; else "varies", and ``kinds`` says where, or how
        often.
    kinds : tuple of KindPart
        Each kind that was met.
    reason : str
        Which joint axes are dependent there, and why.
    raw_ratio : float or None
        Largest sigma_r / sigma_1 over sample points, on the geometry as given in the file;
        None where it agrees with the nominal one.
    lower, upper : (n,) arrays
        Joint limits.
    prismatic : (n,) array of bool
        Which joints slide.
    length_scale : float
        Metres.
    components : tuple of Component
        The same in exact polynomials of the half-angles; not written to JSON.
    confirm : callable or None
        Where equations of neighbouring axes hold at regular configurations too (where five of
        these axes depend on each other): which points of them (N, n) are singular, by the
        rank. Where equations touch zero (``confirm.touching``): what gives their points all
        digits. Not written to JSON.
    solved : tuple of SolvedFor
        Its long equations, each solved for a joint that enters once.
    at_once : tuple of AtOnce
        Of several long equations that hold at once: which joints can be chosen, and how the
        others follow; empty where there are none.
    title : str
        "wrist", "elbow" or "shoulder" where the geometry warrants it (`pinsing.families.naming`
        has the rule); else empty.
    arm : Arm or None
        The arm, whose whole model's configurations are taken too; None where the family was read
        from a file.
    """

    schema: ClassVar[str] = "pinsing/family/1"
    made_by: ClassVar[str] = "pinsing.closed_form(arm).families"

    name: str
    text: str
    latex: str
    branches: tuple[Branch, ...]
    joints: tuple[str, ...]
    codimension: int
    proof: str
    real: bool
    reachability: Reachability
    witness: Array | None
    generic: Array | None
    rank: int | None
    lost: tuple[str, ...]
    kind: str
    reason: str
    raw_ratio: float | None
    lower: Array
    upper: Array
    prismatic: npt.NDArray[np.bool_]
    length_scale: float
    kinds: tuple[KindPart, ...] = ()
    limit_tolerance: Array | None = None
    limits_met: tuple[str, ...] = ()
    components: tuple[Component, ...] = field(default=(), repr=False, metadata={"json": False})
    confirm: Confirm | None = field(default=None, repr=False, metadata={"json": False})
    solved: tuple[SolvedFor, ...] = field(default=(), metadata={"optional": True})
    at_once: tuple[AtOnce, ...] = field(default=(), metadata={"optional": True})
    arm: Arm | None = field(default=None, repr=False, metadata={"json": False})
    value_reach: tuple[ValueReach, ...] = field(default=(), metadata={"optional": True})
    title: str = field(default="", metadata={"optional": True})

    def __getstate__(self) -> dict[str, Any]:
        # Exact polynomials live in a ring of this process: like JSON, pickles go without them,
        # and without the arm's model.
        return {**self.__dict__, "components": (), "arm": None, "confirm": None}

    @property
    def is_reachable(self) -> bool | None:
        """True, False (proven), or None if no point within the limits was found."""
        return self.reachability.known

    @property
    def reach(self) -> str:
        """Reachability in words, with the joint values that it is true of where not of all."""
        return reach_words(self.reachability, self.value_reach, self.prismatic)

    @property
    def label(self) -> str:
        """What people call it: ``F2 (wrist)``, or ``F2`` where it has no title."""
        return f"{self.name} ({self.title})" if self.title else self.name

    @checked
    def where(self, q: npt.ArrayLike | None = None) -> str:
        """Return its condition with the joints' own names, in degrees and metres.

        Parameters
        ----------
        q : (n,) or (nq,) array_like, optional
            A configuration on it: then the joints at their values there.

        Raises
        ------
        ConfigurationError
            If q has the wrong length or is not finite.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.closed_form(pinsing.load("ur5"))["wrist"].where()
        'wrist_2_joint = 0° or 180°'
        """
        names = dict(
            zip(sorted({j for b in self.branches for j in b.involved}), self.joints, strict=False)
        )
        fixed = {v.joint for b in self.branches for v in b.values}
        equations = any(b.equations for b in self.branches)
        if self.title in _PLACES and equations:
            return _PLACES[self.title]
        if q is not None and not equations:
            at = self._check(q)
            if at.ndim != 1:
                raise ConfigurationError(f"q is one configuration, got shape {at.shape}")
            return " and ".join(f"{names[j]} = {self._value(at, j)}" for j in sorted(fixed))
        said = [m[1] if (m := _SOLVED.search(t)) else t for t in self.text.split(" and ")]
        if equations and (len(self.text) > 72 or "φ" in self.text):
            others = listed([names[j] for j in names if j not in fixed])
            said = [*said[: len(fixed)], f"an equation in {others}"]
        return _NUMBERED.sub(lambda s: names.get(int(s[1]) - 1, s[0]), " and ".join(said))

    def _value(self, q: Array, j: int) -> str:
        if self.prismatic[j]:
            return f"{q[j]:.4g} m"
        return f"{round(math.degrees(-self.space.wrap(-q)[j]), 2) + 0.0:g}°"

    @property
    def equations(self) -> tuple[Equation, ...]:
        """All equations of all branches; each is callable on arrays q (..., n)."""
        return tuple(e for b in self.branches for e in b.equations)

    @property
    def values(self) -> tuple[dict[int, float], ...]:
        """Fixed joint values of each branch, by joint index."""
        return tuple({v.joint: v.value for v in b.values} for b in self.branches)

    @property
    def abridged(self) -> bool:
        """Whether ``text`` leaves long equations out, and says how many terms they have."""
        return any(
            bool(long_ones(b.equations))
            or any(len(e.cos) > LONG and long_form(e) is None for e in b.equations)
            for b in self.branches
        )

    def __str__(self) -> str:
        return f"{self.label}: {self.text}"

    def _repr_latex_(self) -> str:
        """For notebooks."""
        return f"$${self.latex}$$"

    def _repr_html_(self) -> str:
        """For notebooks, which prefer it: the equations typeset, and what else is known."""
        involved = sorted({j for b in self.branches for j in b.involved})
        symbols = [f"{'d' if self.prismatic[j] else 'q'}{j + 1}" for j in involved]
        return families_table([html_row(self)], zip(symbols, self.joints, strict=False))


_NUMBERED = re.compile(r"\b[qd](\d+)\b")
_SOLVED = re.compile(r"\(([qd]\d+ = [^()]*)\)$")
"""``0.4 cos q3 + 0.02 sin q3 = 0 (q3 = 92.7°)``: what is left is in the last parentheses."""
_PLACES = {"shoulder": "wrist center above the base axis"}
"""What is said of families that have a name and equations in several joints."""


def html_row(family: Family) -> tuple[str, ...]:
    """Its cells in a table of families."""
    varies = family.kind == "varies"
    kind = "; ".join(str(part) for part in family.kinds) if varies else family.kind
    short = family.text if family.solved or family.abridged else ""
    cells = family.name, family.latex, short, kind
    return family_row(*cells, family.is_reachable, family.reach, family.reason)


_TERM = re.compile(r"(?= [+-] )")
_HALF = re.compile(r"(?:cos|sin)\(([^()/]*|\([^()/]*\))/2\)")
_SYMBOL = re.compile(r"q[0-9]+")
_COMMAND = re.compile(r"\\[a-zA-Z]+ ?|[{}_^\\]")


def written_out(family: Family) -> tuple[str, ...]:
    """What long equations are, solved for a joint, line by line."""
    alone = tuple(
        line
        for one in family.solved
        for line in (one.solution, *(f"{a} = {b}" for a, b in one.where))
    )
    return (*alone, *(line for one in family.at_once for line in one.lines()))


def exactly(family: Family, latex: bool = False) -> tuple[str, ...]:
    """The equations of a family with exact coefficients, line by line.

    Parameters
    ----------
    family : Family
        The family.
    latex : bool
        As LaTeX, one line an equation.
    """
    lines: list[str] = []
    for one in family.solved:
        if latex:
            lines += [one.exact_latex] if one.exact_latex else []
        else:
            parts = one.exact or one.where
            lines += [one.solution, *(f"{a} = {b}" for a, b in parts)]
            lines += [] if one.exact else ["(its coefficients are known as decimals only)"]
    short = [e for e in family.equations if not family.solved or long_form(e) is None]
    for e in short:
        # Of a long one that no name stands for decimals are better than nothing.
        brief = len(e.cos) <= LONG
        text = e.exact_text(latex) or ("" if brief else e.latex() if latex else e.text())
        lines += [text] if text else []
    return tuple(dict.fromkeys(lines))


def latex_lines(latex: str) -> list[str]:
    """A long statement in LaTeX as lines of a page's width, broken at commas and between terms."""
    lines: list[str] = []
    for part in latex.split(r",\ "):
        whole = [""]
        for term in _TERM.split(part):
            here = whole[-1]
            # Round brackets may close on another line, braces may not.
            closed = here.count("{") == here.count("}")
            # Characters of a line that a printed page has room for.
            if here.strip() and closed and _seen(here) + _seen(term) > 80:
                whole.append("")
            whole[-1] += term
        lines += [line.strip() for line in whole]
    return lines


def _seen(latex: str) -> int:
    """About how many characters of it are seen; a name such as sin counts as three."""
    return len(_COMMAND.sub(lambda m: "abc" if m[0][1:].strip() in ("sin", "cos") else "", latex))


def meaning(family: Family) -> Iterator[str]:
    """Kind, reach, codimension and reason, line by line."""
    n = family.n
    if not family.real:
        yield "no real point found in the time given, which does not prove that there is none"
        return
    if family.kind == "varies":
        kind = "; ".join(str(part) for part in family.kinds) + ", "
    else:
        kind = f"{family.kind}, " if family.kind != "undecided" else ""
    size = f"codimension {family.codimension} of {n}"
    proof = "" if family.proof == "algebra" else ", checked at generic points"
    yield f"{kind}{family.reach}; {size}{proof}"
    yield from family.limits_met
    if family.reason:
        yield family.reason


def half_angles(families: Iterable[Family]) -> Iterator[str]:
    """Why there are half angles in equations that are printed, where there are any."""
    where: dict[str, set[str]] = {}
    for family in families:
        for line in (family.text, *written_out(family)):
            for angle in _HALF.findall(line):
                where.setdefault(family.name, set()).update(_SYMBOL.findall(angle))
    if not where:
        return
    joints = sorted(set().union(*where.values()), key=lambda symbol: int(symbol[1:]))
    yield (
        f"half of {', '.join(joints)} in {', '.join(where)}: equations are factors of a longer "
        "one, and in a factor half of an angle may be left, as where another is zero at a single "
        "value of that joint; a whole turn changes the sign of such an equation, "
        "never whether it holds"
    )
