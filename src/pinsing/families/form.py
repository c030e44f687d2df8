"""A closed form: all families of an arm, how sure they are all, and their text for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from pinsing import notebook
from pinsing.algebra.components import Component, RandomSteps
from pinsing.errors import ArgumentError, ConfigurationError, OptionError
from pinsing.families.describe import ORDER
from pinsing.families.family import (
    Family,
    asked_for,
    exactly,
    families_table,
    half_angles,
    html_row,
    latex_lines,
    meaning,
    written_out,
)
from pinsing.families.slices import SliceCount
from pinsing.families.system import system_text
from pinsing.families.tube import Tube
from pinsing.interface import JsonResult, checked, shown, stands_for, typed
from pinsing.measures import SINGULAR_RTOL, ArrayLike
from pinsing.prose import (
    PLAIN,
    Page,
    Span,
    caution,
    formula,
    good,
    html_text,
    measured,
    unbroken,
    visible,
)
from pinsing.robot.arm import Arm, ArmSummary
from pinsing.robot.load import LOOPS
from pinsing.robot.nominal import Deviation, Nominal, assumptions


@dataclass(frozen=True)
class Proof:
    """Outcome of the search for a certificate.

    Attributes
    ----------
    accepted : bool
        Whether there is one, and the checker accepted it.
    reason : str
        Why there is none; empty where there is.
    size : int
        Bytes of the certificate; 0 if there is none.
    places : int
        Case splits and what ends them.
    seconds : float
        Time that finding it took.
    check_seconds : float
        Time that the checker took.
    primes : tuple of int
        Primes modulo which the families were found: what rests on, where there is none.
    certificate : dict or None
        It; not written to JSON with the rest, but to a file of its own.
    out_of_time : bool
        Whether there is none because the search was stopped; more time may find one.
    """

    accepted: bool
    reason: str
    size: int
    places: int
    seconds: float
    check_seconds: float
    primes: tuple[int, ...]
    certificate: dict[str, Any] | None = field(default=None, repr=False, metadata={"json": False})
    out_of_time: bool = field(default=False, metadata={"optional": True})


@dataclass(frozen=True, eq=False)
class ClosedForm(JsonResult):
    """The singular set of an arm, as families.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    symbols : tuple of str
        How the equations name its joints, base to tip: q1, q2, d3, ...
    generic_rank : int
        Singular means: rank below this.
    families : tuple of Family
        Their union is the singular set, where ``complete``.
    complete : bool
        Whether nothing can be missing: the search ended, and every branch was decided.
    fully_decomposed : bool
        Whether every family has joint values and at most one equation.
    gaps : tuple of str
        Why not complete.
    dropped : int
        Components over the complex numbers that were proven to have no real point, or to have
        all of them on a family that is stated.
    snaps : tuple of str
        What the nominal geometry moved, with sizes.
    jacobian_change : float
        Bound of what that changes in any column of the task Jacobian.
    seconds : float
        Time it took.
    left_out : tuple of Component
        The components that ``dropped`` counts, exactly; not written to JSON.
    geometry : Nominal or None
        The exact chain that all of this is true of; not written to JSON.
    loaded : Arm or None
        The arm as it was given; not written to JSON. Functions of an arm take the form instead.
    hints : tuple of str
        What might be worth trying, such as ``snap_length`` for the small offsets of a drawing.
    random_steps : RandomSteps or None
        What of the answer rests on random points of finite fields: how many systems of
        equations, modulo which primes, by which seeds; None where no search was begun.
    proof : Proof or None
        What became of the search for a certificate; None where there was none.
    slice_count : SliceCount or None
        Of a long chain: singular configurations on random slices over small finite fields, and
        how many of them lie on the families. Evidence, no proof; where all slices were gone through
        often enough, the word "probable" rests on it.
    deviation : Deviation or None
        How far the geometry that all of this is true of is from the file's: largest angle and
        length moved; None where they agree to 1e-9.
    steps : tuple of str
        Names of the steps of the search that were taken, such as "all minors", in their order.
    step_of : mapping of str to str
        The step that found each family, by the family's name.
    faithful : tuple of Family or None
        The families, if each was seen to be its exact components; not written to JSON.
    tube : Tube or None
        Where the families are of the arm's design: how far from these the singular configurations
        of the arm are.

    Examples
    --------
    >>> import pinsing
    >>> for family in pinsing.closed_form(pinsing.load("ur5")).families:
    ...     print(family.name, family.text, family.kind)
    F1 q3 = 0° or 180° boundary
    F2 q5 = 0° or 180° interior
    F3 0.425 cos q2 + 0.39225 cos(q2+q3) - 0.09465 sin(q2+q3+q4) = 0 boundary
    """

    schema: ClassVar[str] = "pinsing/closed_form/2"
    made_by: ClassVar[str] = "pinsing.closed_form(arm)"

    arm: ArmSummary
    symbols: tuple[str, ...]
    generic_rank: int
    families: tuple[Family, ...]
    complete: bool
    fully_decomposed: bool
    gaps: tuple[str, ...]
    dropped: int
    snaps: tuple[str, ...]
    jacobian_change: float
    seconds: float
    left_out: tuple[Component, ...] = field(default=(), repr=False, metadata={"json": False})
    geometry: Nominal | None = field(default=None, repr=False, metadata={"json": False})
    loaded: Arm | None = field(default=None, repr=False, metadata={"json": False})

    def __getstate__(self) -> dict[str, Any]:
        # As in `Family`: exact polynomials stay in this process, and what was proven with them.
        return {**self.__dict__, "left_out": (), "geometry": None, "faithful": None}

    proof: Proof | None = field(default=None)
    hints: tuple[str, ...] = ()
    random_steps: RandomSteps | None = None
    slice_count: SliceCount | None = None
    deviation: Deviation | None = field(default=None, metadata={"optional": True})
    steps: tuple[str, ...] = field(default=(), metadata={"optional": True})
    step_of: Mapping[str, str] = field(default_factory=dict, metadata={"optional": True})
    faithful: tuple[Family, ...] | None = field(default=None, repr=False, metadata={"json": False})
    tube: Tube | None = field(default=None, metadata={"optional": True})

    @property
    def word(self) -> str:
        """Completeness of the families: proven, probable, or not complete."""
        if not self.complete:
            return "not complete"
        return "proven" if self.proof is not None and self.proof.accepted else "probable"

    def to_dict(self) -> dict[str, Any]:
        """Return a dictionary, ready for ``json.dumps``, with the ``word`` beside the fields."""
        return {**super().to_dict(), "word": self.word}

    @property
    def certificate(self) -> dict[str, Any] | None:
        """Certificate for an independent checker; None where nothing is proven."""
        return None if self.proof is None else self.proof.certificate

    @property
    def legend(self) -> tuple[tuple[str, str], ...]:
        """Symbol and joint name, base to tip."""
        return tuple(zip(self.symbols, self.arm.joints, strict=True))

    def __getitem__(self, name: str) -> Family:
        """Return the family of a name or title.

        Parameters
        ----------
        name : str
            Such as ``"F2"``, or ``"wrist"`` where the arm has one.

        Raises
        ------
        UnknownNameError
            If there is none.
        OptionError
            If several families have the title, as wrists of some arms with seven joints.

        Examples
        --------
        >>> import pinsing
        >>> form = pinsing.closed_form(pinsing.load("ur5"))
        >>> form["wrist"] is form["F2"]
        True
        """
        if not isinstance(name, str):
            hint = f"form.families[{name}]" if isinstance(name, int) else "see form.families"
            raise ArgumentError("family", "a name such as 'F1'", shown(name), hint)
        families = {f.name: f for f in self.families}
        found = asked_for(families, [name])
        several = f"several families are called {name!r}: choose {' or '.join(found)}"
        OptionError.refuse_if(len(found) > 1, several)
        return families[found[0]]

    def __contains__(self, name: object) -> bool:
        return bool(name) and any(name in (f, f.name, f.title) for f in self.families)

    def __iter__(self) -> Iterator[Family]:
        return iter(self.families)

    @checked
    def family_of(self, q: ArrayLike, tol: float = 1e-6) -> Family | None:
        """Return the first family that has a point within ``tol`` of q (n,), if any.

        Parameters
        ----------
        q : (n,) or (nq,) array_like
            Radians and metres, or a configuration of the whole model; what was read from JSON
            knows no model, and takes (n,) alone.
        tol : float
            Distance in joint space (radians; metres over the length scale).

        Raises
        ------
        ConfigurationError
            If q has the wrong length or is not finite.

        Examples
        --------
        >>> import pinsing
        >>> form = pinsing.closed_form(pinsing.load("stanford"))
        >>> form.family_of([0, 1, 0.3, 1, 0, 0])
        <Family: F3 (wrist): q5 = 0° or 180°>
        """
        ConfigurationError.refuse_if(
            np.ndim(q) != 1, f"q must be one joint vector, got shape {np.shape(q)}"
        )
        if self.geometry is not None:
            q = self.geometry.arm.check(q)
        return next((f for f in self.families if bool(f.contains(q, tol))), None)

    @checked
    def latex(self, legend: bool = False, exact: bool = False) -> str:
        """Return all families as a LaTeX ``align*`` environment, every equation written out.

        Parameters
        ----------
        legend : bool
            Whether comments before it say which joint each symbol is.
        exact : bool
            Whether a row with exact coefficients follows each family whose equations have some.

        Examples
        --------
        >>> import pinsing
        >>> "q_{2} = 0" in pinsing.closed_form(pinsing.load("scara")).latex()
        True
        """
        rows = []
        for f in self.families:
            rows += _rows(f.name, f.latex, bool(f.solved))
            for line in exactly(f, latex=True) if exact else ():
                rows += _rows("exactly", line, bool(f.solved))
        rows = rows or [r"  & \text{no singular configurations known}"]
        # A line break in a name would end the comment, and what follows would be run.
        said = [f"% {s} = {visible(joint)}" for s, joint in self.legend if legend and s != joint]
        return "\n".join([*said, r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"])

    @checked
    def system(self, language: str = "singular", families: Sequence[str] | None = None) -> str:
        """Export the exact equations of all families, as text for another program.

        A revolute joint q2 is c2 = cos q2 and s2 = sin q2, a prismatic one d3 its metres;
        coefficients are whole numbers, and what square roots they need are variables too.
        Each family is an ideal, a list, or several where it is a union; the circles
        c2^2 + s2^2 - 1 are among them. Comments say which robot and chain, and what was assumed.

        Parameters
        ----------
        language : str
            "singular", "maple", "sage", or "msolve". A file for msolve has no comments and one
            system: several are told apart by a variable more, k = 1, 2, ...
        families : sequence of str, optional
            Which of them, such as ["F3"]; all if not given.

        Raises
        ------
        OptionError
            If the language is another one, there is no family, or this was read from a file.
        UnknownNameError
            If there is no family of a name.

        Examples
        --------
        >>> import pinsing
        >>> form = pinsing.closed_form(pinsing.load("stanford"))
        >>> print(form.system("msolve", families=["F3"]), end="")
        c5,s5
        0
        s5,
        c5^2+s5^2-1
        """
        return system_text(self, language, families)[0]

    def _repr_latex_(self) -> str:
        """For notebooks."""
        return self.latex()

    def _repr_html_(self) -> str:
        """For notebooks, which prefer it: the families in a table, equations typeset."""
        return families_html(self)

    def __str__(self) -> str:
        return families_text(self, brief=True)


PLACE = {
    "interior": "inside the workspace",
    "boundary": "edge of reach in this posture",
    "varies": "edge or inside",
    "undecided": "edge or inside, undecided",
}
_MOST_ROWS = 5


def answer_text(
    forms: ClosedForm, page: Page = PLAIN, robot: str = "", file: str = "path.csv"
) -> str:
    """Return the summary of an arm's singularities, at most eight lines, with commands to type."""
    robot = robot or forms.arm.typed
    count = len(forms.families)
    what = "no singular configurations" if not count and forms.complete else _many(forms)
    lines = [page.paragraph(f"{forms.arm.name}: {what} (", _word(forms, " complete"), ")")]
    lines += _geometry(forms, page)
    if forms.gaps:
        lines.append(page.paragraph(f"missing: {forms.gaps[0]}", first="  "))
    joints = len(forms.symbols)
    if forms.arm.task == "pose" and forms.generic_rank < 6:
        rank = forms.generic_rank
        said = f"{joints} joints: {rank} of 6 motions of the tip; singular where one more is lost"
        lines.append(page.paragraph(f"{said} (or try --task position)", first="  "))
    shown = sorted(forms.families, key=lambda f: ORDER.index(f.title))
    outside: dict[bool | None, str] = {False: "outside the joint limits"}
    rows = [
        [f.title, f.name, f.where(), outside.get(f.is_reachable, PLACE.get(f.kind, ""))]
        for f in shown[: _MOST_ROWS + (count == _MOST_ROWS + 1)]
    ]
    if not any(row[0] for row in rows):
        rows = [row[1:] for row in rows]
    room = page.width - max((len(row[-1]) for row in rows), default=0)
    short = [row for row in rows if sum(map(len, row[:-1])) + 2 * len(row) <= room]
    for cells in rows:  # a long one takes two lines, and no part in the columns
        sizes = [max(len(row[k]) for row in short) if short else 0 for k in range(len(cells) - 1)]
        text = "  ".join(c.ljust(w) for c, w in zip(cells[:-1], sizes, strict=True))
        if cells in short:
            lines.append(page.fitted(f"  {text}  {cells[-1]}".rstrip()))
        else:
            lines += [page.fitted(f"  {text.rstrip()}"), f"      {cells[-1]}".rstrip()]
    if len(rows) < count:
        lines.append(f"  and {count - len(rows)} more")
    path = f"pinsing check {robot} {file}"
    following = [f"pinsing view {robot}", path, f"pinsing families {robot} -v"]
    one = f"  Next: {'  |  '.join(following)}"
    each = [f"  Next: {following[0]}", *(f"        {x}" for x in following[1:])]
    ends = [one] if len(one) <= page.width else [page.fitted(line) for line in each]
    return "\n".join([lines[0], "", *lines[1:], "", *ends])


def families_text(
    forms: ClosedForm,
    page: Page = PLAIN,
    degrees: bool = False,
    brief: bool = False,
    exact: bool = False,
    undecided: bool = False,
) -> str:
    """Return the families with their meanings and poses; ``brief``: conditions and arm alone."""
    # ``undecided`` leaves out how sure completeness is: a proof is still looked for.
    lines = [page.paragraph(*_head(forms, brief, undecided))]
    lines += _geometry(forms, page)
    if forms.tube is not None:
        lines.append(page.paragraph(assumptions(forms.tube.assumed), first="  "))
    if not undecided and (forms.gaps or not brief):
        lines.append(certainty(forms, page))
    named = [unbroken(f"{symbol} = {name}") for symbol, name in forms.legend if symbol != name]
    if named and forms.families:
        lines.append(page.paragraph("joints: " + ", ".join(named), first="  ", rest=" " * 10))
    for family in forms.families:
        lines.append(page.paragraph(formula(family.text), first=f"  {family.name}  "))
        if not brief:
            written = exactly(family) if exact else written_out(family)
            lines += [page.paragraph(formula(w), first="      ", rest=" " * 10) for w in written]
            lines += [page.paragraph(text, first="      ") for text in meaning(family)]
            lines += _example(family, forms, page, degrees)
    long = [f.name for f in forms.families if f.abridged]
    if long and not exact:
        lines.append(
            page.paragraph(
                f"the equations of {', '.join(long)}: `pinsing families --exact` writes them out, "
                "-o FILE.json has them as numbers; .sing, .ms, .mpl, .sage for algebra systems",
                first="  ",
            )
        )
    if not brief:
        lines += [page.paragraph(t, first="  ") for t in half_angles(forms.families)]
    lines += [page.paragraph(hint, first="  ") for hint in forms.hints]
    return "\n".join(lines)


def _geometry(forms: ClosedForm, page: Page) -> list[str]:
    """Return what the families are of, where that is not the file, and what it says of the arm."""
    said = [str(forms.deviation)] * (forms.deviation is not None)
    # As where somebody wrote 1.57.
    if forms.tube is None and forms.deviation is not None and forms.deviation.angle > 1e-4:
        said.append("of the file's own numbers: --design none; how far these are: --design auto")
    if forms.tube is not None:
        said = [str(forms.tube), *said]
    said += [note for note in forms.arm.notes if LOOPS in note]
    return [page.paragraph(text, first="  ") for text in said]


def _many(forms: ClosedForm) -> str:
    count = len(forms.families)
    return f"{count} famil{'y' if count == 1 else 'ies'} of singular configurations"


def _of(forms: ClosedForm) -> str:
    """Of which geometry it is true, if that is not the file's."""
    return "" if forms.deviation is None else f" for {forms.deviation.geometry}"


def _head(forms: ClosedForm, brief: bool, undecided: bool) -> tuple[Span, ...]:
    took = unbroken(f"{1e3 * forms.seconds:.0f} ms")
    if undecided and not brief:
        return (f"{_many(forms)} (closed forms, {took}); whether these are all stands at the end:",)
    none = not forms.families and forms.complete
    what = "no singular configurations: the rank is the same everywhere (" * none
    what, word = what or f"{_many(forms)}, ", _word(forms)
    if brief:
        arm = f"{forms.arm.name}, task {forms.arm.task} (generic rank {forms.generic_rank}): "
        return arm, what, word, ")" * none
    end = f"; closed forms, {took})." if none else f" (closed forms, {took}):"
    return what.capitalize(), word, end


def _word(forms: ClosedForm, complete: str = "") -> Span:
    """Proven, probable or NOT complete, and of which geometry if that is not the file's."""
    if not forms.complete:
        return caution("NOT complete")
    if forms.word == "proven":
        return good(f"proven{complete}{_of(forms)}")
    return f"{'probably' if complete else 'probable'}{complete}{_of(forms)}"


def _example(family: Family, forms: ClosedForm, page: Page, degrees: bool) -> Iterator[str]:
    """A configuration of the family, to be pasted after ``pinsing at``, and what is lost there."""
    if family.generic is None:
        return
    rounded = family.raw_ratio is not None and family.raw_ratio > SINGULAR_RTOL
    first = f"      e.g. {'--nominal ' if rounded else ''}"
    loose = set(range(family.n)).difference(*(b.involved for b in family.branches))
    q = typed(family.generic, family.prismatic, degrees, loose=loose, room=page.width - len(first))
    yield page.paragraph(q, first=first, rest=" " * 13)
    for text in family.lost:
        yield page.paragraph(measured(text), first="        ")


def coverage_words(forms: ClosedForm) -> str:
    """Return how sure it is that none is missing, in a few words for a page that lists families."""
    how = "" if forms.deviation is None else f" ({forms.deviation.change})"
    of, robot = _of(forms) + how, "" if forms.tube is None else f" {forms.tube}"
    if not forms.complete:
        return (
            f"NOT complete{of}: {'; '.join(forms.gaps)}. Distances are to what is listed: other "
            "singular configurations may be nearer."
        )
    if forms.word == "proven":
        return f"Proven{of}: there are no others.{robot}"
    sure = "nothing is known to be missing, but there is no certificate"
    return f"Probable{of}: {sure}.{robot}"


def certainty(forms: ClosedForm, page: Page = PLAIN) -> str:
    """Return how sure it is that none is missing, and what that rests on, or what is missing."""
    proof, count, random = forms.proof, forms.slice_count, forms.random_steps
    if not forms.complete:
        gaps: list[tuple[Span, ...]] = [(caution("not complete"), ": ", g) for g in forms.gaps]
        gaps += [(count.evidence(),)] if count is not None and not count.off else []
        return "\n".join(page.paragraph(*gap, first="  ") for gap in gaps)
    if proof is not None and proof.accepted:
        size, took = f"{proof.size / 1e3:.1f} kB", f"{1e3 * proof.check_seconds:.0f} ms"
        rest = f": certificate of {unbroken(size)}, checked in {unbroken(took)}"
        return page.paragraph(good("proven"), f"{_of(forms)}{rest}", first="  ")
    counted = "" if count is None else f"; it rests on a count: {count.sentence()}"
    if proof is None:
        return page.paragraph(f"probable: no certificate was looked for{counted}", first="  ")
    if random is None or not random.systems:
        rests = counted.removeprefix("; ") or "no step of the search rested on random points"
    else:
        primes, seeds = (" and ".join(map(str, x)) for x in (random.primes, random.seeds))
        systems = "one system" if random.systems == 1 else f"{random.systems} systems"
        rests = (
            f"{systems} of equations rested on random points modulo {primes} (seeds {seeds}), "
            f"where one is wrong with a chance below {CHANCE:.0e} unless a prime divides what must "
            f"not vanish{counted}"
        )
    return page.paragraph(
        f"probable: nothing is known to be missing, but {rests}; no certificate: {proof.reason}",
        first="  ",
    )


CHANCE = 1e-12
"""Bound of the chance that a random point modulo one prime misleads: degree / prime (Schwartz,
1980; Zippel, 1979), with degrees
below 4e6 (eliminants are cut off at 3,000) and primes of 62 bits."""


def families_html(forms: ClosedForm) -> str:
    """The families in a table, and how sure it is that none is missing."""
    text = html_text
    tone = {"proven": "good", "not complete": "caution"}.get(forms.word)
    said = forms.word if forms.complete else "NOT complete"
    state = notebook.verdict(said, tone) if tone else f"<strong>{text(said)}</strong>"
    what = text(f"(task {forms.arm.task}, generic rank {forms.generic_rank}): {_many(forms)},")
    head = f"{notebook.name(forms.arm.name)} {what} {state}"
    if forms.deviation is not None:
        head += f" {text(f'for {forms.deviation}')}"
    gaps = "".join(
        f"<p>{notebook.verdict('not complete:', 'caution')} {text(g)}</p>" for g in forms.gaps
    )
    if forms.slice_count is not None and not forms.slice_count.off:
        gaps += f"<p>{text(forms.slice_count.evidence())}</p>"
    rows = [html_row(f) for f in forms.families]
    shown = families_table(rows, forms.legend) if rows else ""
    return f"<p>{head}</p>{shown}{gaps}"


def _rows(name: str, latex: str, long: bool) -> list[str]:
    """Rows of an ``align*``: one, or those that a long statement needs."""
    lines = latex_lines(latex) if long else [latex]
    return [
        rf"  \text{{{name}:}} \quad & {lines[0]}",
        *(rf"  & \qquad {line}" for line in lines[1:]),
    ]


def _arm_of(form: ClosedForm) -> Arm:
    if form.loaded is None:
        raise ArgumentError("arm", "an Arm", "a closed form read from JSON", "load the robot too")
    return form.loaded


def _refuse(summary: ArmSummary) -> Arm:
    hint = "use the arm that pinsing.load gave, or the closed form itself"
    raise ArgumentError("arm", "an Arm", "the summary of one that a result has", hint)


stands_for(ClosedForm, Arm, _arm_of)
stands_for(ArmSummary, Arm, _refuse)
