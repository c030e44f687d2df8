"""Systems of equations as text that Singular, msolve, Maple and Sage read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pinsing.errors import OptionError, UnknownNameError
from pinsing.families.family import Family
from pinsing.families.system import FamilySystem, Systems, Terms, systems
from pinsing.prose import visible
from pinsing.robot.arm import ArmSummary
from pinsing.robot.nominal import Nominal

SUFFIXES = {
    ".sing": "singular",
    ".lib": "singular",
    ".ms": "msolve",
    ".mpl": "maple",
    ".maple": "maple",
    ".sage": "sage",
    ".py": "sage",
}
LANGUAGES = ("singular", "msolve", "maple", "sage")
_COMMENT = {"singular": "// ", "maple": "# ", "sage": "# "}
_WHICH = "k"
"""The variable of a file for msolve that says which of several systems a solution is of."""


def language_of(path: Path) -> str:
    """The language that the suffix of a file's name stands for.

    Raises
    ------
    OptionError
        If it stands for none.
    """
    found = SUFFIXES.get(path.suffix.lower())
    if found is None:
        given = f"ends in {path.suffix!r}" if path.suffix else "has no suffix"
        raise OptionError(
            f"{visible(str(path))}: the name {given}; take .sing for Singular, .ms for "
            "msolve, .mpl for Maple or .sage for Sage"
        )
    return found


@dataclass(frozen=True)
class SystemHead:
    """What a file of equations tells of its arm.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    rank : int
        Singular means: rank below this.
    word : str
        How sure it is that no family is missing.
    gaps : tuple of str
        Why some may be.
    snaps : tuple of str
        What was moved to be exact.
    change : float
        Bound of what that changes in any column of the task Jacobian.
    symbols : tuple of str
        Of the joints.
    """

    arm: ArmSummary
    rank: int
    word: str
    gaps: tuple[str, ...]
    snaps: tuple[str, ...]
    change: float
    symbols: tuple[str, ...]


def system_text(
    stated: SystemHead,
    families: Sequence[Family],
    geometry: Nominal | None,
    language: str,
    names: Sequence[str] | None = None,
) -> tuple[str, tuple[str, ...]]:
    """Families as a file for another program, and its comments.

    Parameters
    ----------
    stated : SystemHead
        What is told of the arm.
    families : sequence of Family
        All of them.
    geometry : Nominal or None
        Of the arm; None where the closed form was read from a file.
    language : str
        One of ``LANGUAGES``.
    names : sequence of str, optional
        Which families; all if not given.

    Returns
    -------
    text : str
        The file.
    remarks : tuple of str
        What its comments say, or would if it could have any.

    Raises
    ------
    OptionError
        If the language is none of these, or there is nothing to write.
    UnknownNameError
        If there is no family of a name.
    """
    if language not in LANGUAGES:
        raise OptionError(f"no language {language!r}; there are {', '.join(LANGUAGES)}")
    known = [f.name for f in families]
    for name in names or ():
        if name not in known:
            raise UnknownNameError("family", name, known)
    chosen = [f for f in families if names is None or f.name in names]
    arm = stated.arm
    if not chosen:
        raise OptionError(f"{arm.name}, task {arm.task}: there is no family to write equations of")
    if geometry is None or not all(f.components for f in chosen):
        raise OptionError(
            "the exact equations are not in a closed form that was read from a file: make it "
            "again with closed_form"
        )
    found = systems(chosen, geometry, stated.symbols)
    remarks = tuple(_remarks(stated, found, language))
    if language == "msolve":
        return _msolve(found), remarks
    head = "".join(f"{_COMMENT[language]}{line}\n" for line in remarks)
    body = {"singular": _singular, "maple": _maple, "sage": _sage}[language](found)
    return f"{head}\n{body}", remarks


def _remarks(stated: SystemHead, found: Systems, language: str) -> Iterator[str]:
    """What a reader has to know of the equations, line by line."""
    arm = stated.arm
    yield f"Singular configurations of {visible(arm.name)}, as exact equations (pinsing)"
    yield (
        f"robot {visible(arm.source)}, base {visible(arm.base)}, tip {visible(arm.tip)}, "
        f"task {arm.task}, generic rank {stated.rank}"
    )
    yield f"families: {stated.word}"
    yield from (f"not complete: {visible(gap)}" for gap in stated.gaps)
    named = zip(stated.symbols, arm.joints, strict=True)
    yield "joints: " + ", ".join(f"{s} = {visible(joint)}" for s, joint in named)
    yield "variables: " + ", ".join(f"{name} = {what}" for name, what in found.variables)
    if found.free:
        yield f"in no equation, so free: {', '.join(found.free)}"
    if found.roots:
        yield f"meant are solutions with {', '.join(f'{r} > 0' for r in found.roots)} alone"
    if language == "msolve":
        yield from _numbered(found)
    yield "meant are real solutions, within the joint limits or not"
    if stated.snaps:
        yield "true of the nominal geometry, in which these numbers of the file were moved:"
        yield from (f"  {visible(snap)}" for snap in stated.snaps)
        yield f"no column of the Jacobian changes by more than {stated.change:.1e} by that"
    known: dict[object, str] = {}
    for one in found.families:
        yield from _of(one)
        same = known.setdefault(one.parts, one.family.name)
        if same != one.family.name:
            yield f"  its equations are those of {same}: other real points of the same set"


def _numbered(found: Systems) -> Iterator[str]:
    """Which number stands for which system."""
    names = [name for one in found.families for name in _names(one)]
    if len(names) > 1:
        told = ", ".join(f"{i} = {name}" for i, name in enumerate(names, 1))
        yield f"a file for msolve is one system; its first variable {_WHICH} says which: {told}"


def _of(one: FamilySystem) -> Iterator[str]:
    """What is said of a family."""
    family = one.family
    yield f"{family.name}: {visible(family.text)}"
    if len(one.parts) > 1:
        yield f"  {family.name} is the union of {', '.join(_names(one))}"
    if not family.real:
        yield "  no real point of it is known"
    if family.confirm is not None and not family.confirm.touching:
        yield "  some solutions may be regular: singular are those at which the rank drops"


def _names(one: FamilySystem) -> list[str]:
    if len(one.parts) == 1:
        return [one.family.name]
    return [f"{one.family.name}_{i}" for i in range(1, len(one.parts) + 1)]


def _each(found: Systems, power: str = "^") -> Iterator[tuple[str, list[str]]]:
    """Name and polynomials of each system, those of the circles included."""
    names = [name for name, _ in found.variables]
    for one in found.families:
        for name, part in zip(_names(one), one.parts, strict=True):
            yield name, [_written(p, names, power) for p in (*part, *found.circles)]


def _written(poly: Terms, names: Sequence[str], power: str = "^") -> str:
    """``203*c2*c3 - 4318*s2^2 + 1``."""
    out = ""
    for coefficient, exponents in poly:
        factors = [
            name if e == 1 else f"{name}{power}{e}"
            for name, e in zip(names, exponents, strict=True)
            if e
        ]
        size = abs(coefficient)
        body = "*".join([str(size)] * (size != 1 or not factors) + factors)
        sign = "-" if coefficient < 0 else "+"
        out += f" {sign} {body}" if out else f"{'-' if sign == '-' else ''}{body}"
    return out


def _singular(found: Systems) -> str:
    lines = [f"ring R = 0,({','.join(name for name, _ in found.variables)}),dp;"]
    for name, part in _each(found):
        lines += [f"ideal {name} =", *_listed(part, ";")]
    return "\n".join(lines) + "\n"


def _maple(found: Systems) -> str:
    lines = [f"vars := [{', '.join(name for name, _ in found.variables)}]:"]
    for name, part in _each(found):
        lines += [f"{name} := [", *_listed(part, "]:")]
    return "\n".join(lines) + "\n"


def _sage(found: Systems) -> str:
    names = [name for name, _ in found.variables]
    quoted = ", ".join(f'"{name}"' for name in names)
    lines = [
        "from sage.all import PolynomialRing, QQ",
        f"R = PolynomialRing(QQ, [{quoted}])",
        f"({', '.join(names)},) = R.gens()",
    ]
    for name, part in _each(found, "**"):
        lines += [f"{name} = R.ideal([", *_listed(part, "])")]
    return "\n".join(lines) + "\n"


def _listed(part: Sequence[str], end: str) -> list[str]:
    return [f"  {p}{',' if i < len(part) else end}" for i, p in enumerate(part, 1)]


def _msolve(found: Systems) -> str:
    """One system: that of the only family, or of all, told apart by one variable more.

    The polynomials of system i are multiplied by the product of k - m over all others m, so that
    they must vanish where k = i alone; k is one of 1, 2, ...
    """
    parts = [part for one in found.families for part in one.parts]
    names = [name for name, _ in found.variables]
    polys = [*parts[0], *found.circles]
    if len(parts) > 1:
        names = [_WHICH, *names]
        numbers = range(1, len(parts) + 1)
        one: Terms = ((1, (0,) * len(found.variables)),)
        polys = [_times(numbers, one)]
        polys += [
            _times([m for m in numbers if m != i], p) for i, q in enumerate(parts, 1) for p in q
        ]
        polys += [_times((), p) for p in found.circles]
    told = ",\n".join(_written(p, names).replace(" ", "") for p in polys)
    return f"{','.join(names)}\n0\n{told}\n"


def _times(values: Sequence[int], poly: Terms) -> Terms:
    """A polynomial times k - m for some m, with k as its first variable."""
    product = [1]
    for m in values:
        product = [a - m * b for a, b in zip([0, *product], [*product, 0], strict=True)]
    return tuple(
        (k * c, (e, *m)) for e, k in reversed(list(enumerate(product))) if k for c, m in poly
    )
