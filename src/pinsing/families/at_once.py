"""Long equations as a person uses them: solved for a joint, and several that hold at once.

Written out these fill pages and tell nobody anything. What one can use: how many motions stay,
which joints can be chosen, and how the others follow from them.

An equation is solved for a joint that enters it once, ``R cos(q2 - phi) = c``: where one angle
occurs as cos and sin of itself alone, f = A cos q + B sin q + C with A, B and C of the other
joints. With R cos phi = A, R sin phi = B and c = -C that is R cos(q - phi) = c: given the others, q
is one of two values. Where C is zero throughout they lie half a turn apart.

R and c are sums of products, one factor a joint, written as short as may be: ``cos(q2+q5) -
cos(q2-q5)`` is ``-2 sin q2 sin q5``: an equation of an arm whose wrist has an offset takes half the
room so, and shows which factors its terms share. Numbers are floats or exact.
"""

from __future__ import annotations

import functools
import itertools
import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from pinsing.algebra.conditions import Branch
from pinsing.algebra.equation import (
    Equation,
    format_angle,
    moved,
    signed_sum,
    sized,
    symbol_text,
)
from pinsing.families.zero_set import MOST_ORDERED, peeled, system_of
from pinsing.measures import Array
from pinsing.prose import listed
from pinsing.robot.surd import exact_of

Number: TypeAlias = Any
"""A float or an Exact; one expression has one kind alone."""
Factor = tuple[int, str, int]
"""Joint, function, multiple: cos and sin of a multiple, or pow for a length."""
Product = tuple[Factor, ...]
"""Sorted; a power is a factor as many times."""
Terms = Mapping[Product, Number]
"""A sum of products of functions of single joints: the number before each."""


def coefficients(
    equation: Equation, joint: int, exact: bool = False
) -> Mapping[tuple[str, int], Terms] | None:
    """Return the factor of each function of one joint, by function and multiple."""
    # ("cos", 1), ("sin", 1), ("pow", 1), ("one", 0), ("cos/2", 1). ``exact`` coefficients are whole
    # numbers for rational ones; None where they are not known.
    if exact and not equation.exact:
        return None
    terms, scale = equation.once(f"grouped by {joint}", lambda: _grouped(equation, joint))
    found: dict[tuple[str, int], dict[Product, Number]] = defaultdict(dict)
    for product, number in terms.items():
        key = next(((f, k) for j, f, k in product if j == joint), ("one", 0))
        shown = number if exact else float(number) * scale
        found[key][tuple(x for x in product if x[0] != joint)] = shown
    return found


def _grouped(equation: Equation, joint: int) -> tuple[Terms, float]:
    """Return the equation multiplied out, the shortest way, and what exact numbers are short of."""
    rough = np.stack([equation.cos, equation.sin], axis=1)
    numbers, scale, least = rough.tolist(), 1.0, 1e-11 * equation.size
    terms = _multiplied_out(equation, numbers)
    twice = {j for product in terms for j, f, k in product if f in ("cos", "sin") and k == 2}
    ways: list[tuple[Mapping[int, str], Terms]] = [({}, terms)]
    for j in sorted(twice - {joint})[-5:]:  # some hundred ways at most
        ways = [
            ({**chosen, j: square}, _squared(made, j, square))
            for chosen, made in ways
            for square in ("", "cos", "sin")
        ]
    shortest, terms = min(ways, key=lambda way: sum(abs(c) > least for c in way[1].values()))
    if not equation.exact:
        return {product: c for product, c in terms.items() if abs(c) > least}, scale
    # Once more exactly, so that what cancels does so. Whole ones are ints, which are cheap.
    numbers = [
        [int(x) if x.removeprefix("-").isdecimal() else exact_of(x) for x in pair]
        for pair in equation.exact
    ]
    terms = _multiplied_out(equation, numbers)
    for j, square in shortest.items():
        terms = _squared(terms, j, square)
    t, side = divmod(int(np.abs(rough).argmax()), 2)
    scale = float(rough[t, side]) / float(numbers[t][side])
    return {product: c for product, c in terms.items() if c != 0}, scale


def _multiplied_out(equation: Equation, numbers: Sequence[Sequence[Number]]) -> Terms:
    """Cosines and sines of sums of angles as products, with the numbers of each term put in."""
    out: dict[Product, Number] = {}
    for powers, frequencies, pair in zip(
        equation.powers.tolist(), equation.frequencies.tolist(), numbers, strict=True
    ):
        lengths = tuple((j, "pow", 1) for j, p in enumerate(powers) for _ in range(p))
        # exp(i sum) = prod (cos + i sin): every sine brings an i and the sign of its angle.
        products: list[tuple[Product, int]] = [(lengths, 0)]
        for j, f in enumerate(frequencies):
            if f:
                # Frequencies are twice the multiples: odd ones stay halves.
                half, k, turns = "/2" * (f % 2), abs(f) // (2 - f % 2), 1 if f > 0 else 3
                cos, sin = (j, "cos" + half, k), (j, "sin" + half, k)
                products = [
                    both
                    for factors, turned in products
                    for both in (((*factors, cos), turned), ((*factors, sin), turned + turns))
                ]
        for factors, turned in products:
            number = -pair[turned % 2] if turned % 4 > 1 else pair[turned % 2]
            if number != 0:
                product = tuple(sorted(factors)) if lengths else factors
                out[product] = out.get(product, 0) + number
    return out


def _squared(terms: Terms, joint: int, square: str) -> Terms:
    """Cosine and sine of twice a joint's angle by those of the angle, one squared; or as it is."""
    if not square:
        return terms
    sign, out = 1 if square == "cos" else -1, defaultdict[Product, Number](int)
    for product, number in terms.items():
        sums: list[tuple[Product, int]]
        if (joint, "cos", 2) in product:
            sums = [(((joint, square, 1),) * 2, 2 * sign), ((), -sign)]
        elif (joint, "sin", 2) in product:
            sums = [(((joint, "cos", 1), (joint, "sin", 1)), 2)]
        else:
            out[product] += number
            continue
        rest = tuple([x for x in product if x[0] != joint])
        for factors, weight in sums:
            out[tuple(sorted((*rest, *factors)))] += number * weight
    return out


# In words ------------------------------------------------------------------------------


def terms_text(terms: Terms, equation: Equation, latex: bool = False) -> str:
    """One line of terms: the factor that most share before a bracket, and so on within."""
    pieces: list[tuple[Number, str]] = []
    brackets, alone = _brackets(tuple(terms))
    for pull, within in brackets:
        inner = {rest: terms[product] for product, rest in within}
        negative, _ = sized(next(iter(inner.values())))
        if negative:
            inner = {product: -c for product, c in inner.items()}
        said = f"{_factors(pull, equation, latex)} ({terms_text(inner, equation, latex)})"
        pieces.append((-1.0 if negative else 1.0, said))
    pieces += [(terms[product], _factors(product, equation, latex)) for product in alone]
    return signed_sum(pieces, latex=latex)


def _factors(atoms: Product, equation: Equation, latex: bool) -> str:
    """A product in one line."""
    said = []
    for (j, function, k), power in Counter(atoms).items():
        name = symbol_text(equation.joints[j], latex)
        base, angle = name, ""
        if function != "pow":
            base = "\\" * latex + function[:3]
            shift = float(equation.shift[j])
            angle = name if k == 1 else f"{k} {name}"
            if shift:
                angle = moved(angle, shift, format_angle(k * abs(shift), latex))
            angle = angle if angle == name else f"({angle})"
            angle = f"({angle}/2)" if function.endswith("/2") else angle
            angle = angle if angle.startswith("(") and not latex else f" {angle}"
        raised = f"^{{{power}}}" if latex else {2: "²", 3: "³"}.get(power, f"^{power}")
        said.append(f"{base}{raised if power > 1 else ''}{angle}")
    return " ".join(said)


@functools.lru_cache(maxsize=512)
def _brackets(
    products: tuple[Product, ...],
) -> tuple[list[tuple[Product, list[tuple[Product, Product]]]], list[Product]]:
    """Return what is before brackets, with the products within and their rests; and the others."""
    # Found once for text and LaTeX, and for exact numbers as for floats.
    found = []
    left = list(products)
    while left:
        counts = Counter(atom for atoms in left for atom in dict.fromkeys(atoms))
        shared = [a for a, count in counts.items() if count > 1]
        if not shared:
            break
        atom = max(shared, key=lambda a: (counts[a], -a[0], a[1], a[2]))
        inner = [(atoms, _without(atoms, atom)) for atoms in left if atom in atoms]
        pull = [atom]
        while common := set.intersection(*(set(rest) for _, rest in inner)):
            more = min(common)
            pull.append(more)
            inner = [(atoms, _without(rest, more)) for atoms, rest in inner]
        left = [atoms for atoms in left if atom not in atoms]
        found.append((tuple(sorted(pull)), inner))
    return found, left


def _without(atoms: Product, atom: Factor) -> Product:
    at = atoms.index(atom)
    return atoms[:at] + atoms[at + 1 :]


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

    def text(self) -> str:
        """The condition in one line."""
        names = [name.removeprefix("R cos ") for name, _ in self.where if "sin" not in name]
        named = ["R", *names] if len(self.where) > 2 else names
        return f"{self.condition}, with {', '.join(named)} given by {listed(self.given)}"


def _entry(kind: str) -> tuple[str, str, int, dict[str, tuple[str, int]]]:
    """How an equation is stated for a joint that enters it once, see ``Equation.enters``.

    Condition, solution, number of values, and what is named, with the function of the joint that it
    is before; c is on the other side.
    """
    half = "/2" if kind == "half" else ""
    radius = {"R cos φ": ("cos" + half, 1), "R sin φ": ("sin" + half, 1)}
    c = {"c": ("one", 0)}
    two = "φ ± arccos(c/R) where |c| <= R: one of two values"
    opposite = "φ ± 90°: one of two values, half a turn apart,"
    return {
        "length": ("A {} = c", "c/A: one value", 1, {"A": ("pow", 1), **c}),
        "half": ("R cos({}/2 - φ) = 0", "2 φ + 180°: one value", 1, radius),
        "opposite": ("R cos({} - φ) = 0", opposite, 2, radius),
        "two": ("R cos({} - φ) = c", two, 2, radius | c),
    }[kind]


def _named(equation: Equation, joint: int, latex: bool = False) -> str:
    """A joint with what its angle is counted from."""
    name, shift = symbol_text(equation.joints[joint], latex), float(equation.shift[joint])
    if not shift:
        return name
    shown = moved(name, shift, format_angle(abs(shift), latex))
    return f"({shown})" if equation.enters(joint) == "half" else shown


def _stated(equation: Equation, joint: int) -> tuple[str, str]:
    """The condition for a joint, and what follows for it."""
    name = _named(equation, joint)
    condition, solution, _, _ = _entry(equation.enters(joint))
    others = listed([equation.joints[j] for j in equation.involved if j != joint])
    return condition.format(name), f"{name} = {solution} given {others}"


def solved(equation: Equation, joint: int | None = None) -> SolvedFor | None:
    """Return the equation as one for a joint that enters once, or None."""
    # By default one that has values for all others, else the first. None, too, if no others are
    # beside.
    return equation.once(f"solved for {joint}", lambda: _solved(equation, joint))


def _solved(equation: Equation, joint: int | None) -> SolvedFor | None:
    every = equation.involved if joint is None else (joint,)
    kinds = {j: kind for j in every if (kind := equation.enters(j))}
    if not kinds or (joint is None and len(every) < 2):
        return None
    first = next(iter(kinds))
    chosen = next((j for j, kind in kinds.items() if kind in ("opposite", "half")), first)
    form, _, values, named = _entry(kinds[chosen])

    def parts(exact: bool, latex: bool) -> tuple[tuple[str, str], ...]:
        if (found := coefficients(equation, chosen, exact)) is None:
            return ()
        signed = (
            (name, {p: -x if name == "c" else x for p, x in found.get(function, {}).items()})
            for name, function in named.items()
        )
        return tuple((name, terms_text(terms, equation, latex)) for name, terms in signed)

    def in_latex(exact: bool) -> str:
        whole = r",\ ".join([form, *(f"{name} = {{}}" for name in named)])
        whole = re.sub("(cos|sin) ?", r"\\\1 ", whole).replace("φ", r"\varphi")
        texts = (text for _, text in parts(exact, True))
        return whole.format(_named(equation, chosen, True), *texts)

    condition, solution = _stated(equation, chosen)
    return SolvedFor(
        joint=equation.joints[chosen],
        given=tuple(equation.joints[j] for j in equation.involved if j != chosen),
        values=values,
        condition=condition,
        solution=solution,
        where=parts(False, False),
        exact=parts(True, False),
        latex=in_latex(False),
        exact_latex=in_latex(True) if equation.exact else "",
    )


def long_form(equation: Equation) -> SolvedFor | None:
    """Return how a long equation is stated; None for short ones, and where no joint enters once."""
    return solved(equation) if len(equation.cos) > LONG else None


_INDEPENDENT = 1e-7
_SHORT = 4
"""Terms of an equation that is always written out."""


def rank_of(slopes: Array, least: float = _INDEPENDENT) -> int:
    """How many gradients (k, n) are independent: singular values relative to the largest count."""
    sizes = np.linalg.svd(slopes, compute_uv=False)
    return int((sizes > least * max(float(sizes[0]), 1e-300)).sum())


@dataclass(frozen=True)
class AtOnce:
    """Equations of a family that hold at once, near the configuration that stands with it.

    Attributes
    ----------
    terms : tuple of int
        Number of terms of each equation.
    chosen : tuple of str
        Symbols of joints that can be chosen there, each by itself.
    follow : tuple of str
        Symbols of the joints that then follow.
    steps : tuple of str
        How they follow one after the other, where each enters an equation once; empty where only
        solving all equations together tells.
    left : int
        Equations that the steps do not use: they say which of the values hold.
    """

    terms: tuple[int, ...]
    chosen: tuple[str, ...]
    follow: tuple[str, ...]
    steps: tuple[str, ...]
    left: int

    def lines(self) -> tuple[str, ...]:
        """Sentences for people."""
        verb = "follows" if len(self.follow) == 1 else "follow"
        can = f"{listed(self.chosen)} can be chosen" if self.chosen else "no joint can be chosen"
        near = f"dimension {len(self.chosen)}: near the configuration shown {can}"
        said = [f"{near}; {listed(self.follow)} {verb}", *self.steps]
        if len(self.steps) > MOST_ORDERED:
            doubles = sum("two solutions" in step for step in self.steps)
            said.append(
                f"so there are at most 2^{doubles} = {2**doubles} of these, given the others"
            )
        if not self.steps:
            said.append(
                "by solving the equations together: `Family.distance(q).q` gives the nearest "
                "solution, `Family.sample` gives many"
            )
        elif self.left:
            several = f"the other {self.left} equations say"
            more = "the other equation says" if self.left == 1 else several
            said.append(f"{more} which of these values hold")
        return tuple(said)


def long_ones(equations: Sequence[Equation]) -> list[Equation]:
    """Return the long equations of a system of several; all of many, which fill a page as well."""
    if len(equations) < 2:
        return []
    short = [e for e in equations if _SHORT < len(e.cos) <= LONG]
    many = sum(len(e.cos) for e in short) > 2 * LONG
    return [e for e in equations if len(e.cos) > (_SHORT if many else LONG)]


def at_once(branch: Branch, q: Array, symbols: Sequence[str]) -> AtOnce | None:
    """Return how a branch's equations can be used near a generic q (n,); None if not known."""
    equations = branch.equations
    if not long_ones(equations):
        return None
    slopes = system_of(equations).gradients(q[None])[0]
    rank, fixed = rank_of(slopes), {v.joint for v in branch.values}
    moving = [j for j in branch.involved if j not in fixed]
    if not 0 < rank <= len(moving):
        return None
    rows = sorted(
        zip(equations, slopes, strict=True), key=lambda r: (len(r[0].involved), len(r[0].cos))
    )
    found = (_in_turn if rank <= MOST_ORDERED else _peeled)(rows, rank)
    found = found or _together(slopes, rank, moving)
    if found is None:
        return None
    follow, steps = found
    return AtOnce(
        terms=tuple(len(e.cos) for e in equations),
        chosen=tuple(s for j, s in enumerate(symbols) if j not in fixed.union(follow)),
        follow=tuple(symbols[j] for j in follow),
        steps=steps,
        left=len(equations) - len(steps) if steps else 0,
    )


_Rows = Sequence[tuple[Equation, Array]]
"""Equations, the simplest first, and their gradients (n,)."""
_Following = tuple[tuple[int, ...], tuple[str, ...]]
"""Joints that follow, and how, step by step."""


def _in_turn(rows: _Rows, rank: int) -> _Following | None:
    """Joints that follow one after the other, each from an equation that it enters once."""
    once = [
        (e, slope, [j for j in e.involved if e.enters(j)])
        for e, slope in rows[:6]
        if len(e.involved) > 1
    ]
    choices = (
        (some, follow)
        for some in itertools.combinations(once, rank)
        for follow in itertools.product(*(joints for *_, joints in some))
        if len({*follow}) == rank
    )
    # Choices of joints that are tried, at most.
    for some, follow in itertools.islice(choices, 2000):
        # An equation may use joints that follow from those before it, and no later one.
        if any({*e.involved}.intersection(follow[k + 1 :]) for k, (e, *_) in enumerate(some)):
            continue
        if _regular(np.array([slope for _, slope, _ in some]), follow):
            told = [(len(e.cos), *_stated(e, j)) for (e, *_), j in zip(some, follow, strict=True)]
            return follow, tuple(f"{condition} [{n} terms]: {then}" for n, condition, then in told)
    return None


def _regular(slopes: Array, follow: Sequence[int]) -> bool:
    """Return True if the joints follow from the equations, to many digits."""
    return rank_of(slopes[:, list(follow)], 1e3 * _INDEPENDENT) == len(follow)


def _peeled(rows: _Rows, rank: int) -> _Following | None:
    """The same of many equations: the simplest that are independent, if they can be so solved."""
    some: list[tuple[Equation, Array]] = []
    for row in rows:
        if len(some) < rank and rank_of(np.array([s for _, s in (*some, row)])) > len(some):
            some.append(row)
    order = peeled([e for e, _ in some], np.ones(len(rows[0][1]), dtype=bool), 2)
    if order is None or len(some) < rank:
        return None
    told = []
    for step in order:
        names = step.equation.joints
        others = [names[j] for j in step.equation.involved if j != step.joint]
        given = f" given {listed(others)}" if others else ""
        count = "two solutions" if step.kind in ("two", "opposite") else "one solution"
        told.append(f"{names[step.joint]} has {count}{given} [{len(step.equation.cos)} terms]")
    return tuple(step.joint for step in order), tuple(told)


def _together(slopes: Array, rank: int, moving: Sequence[int]) -> _Following | None:
    """Joints that follow from all equations: those whose columns are the most independent."""
    left, follow = slopes[:, list(moving)].copy(), list[int]()
    for _ in range(rank):
        k = int(np.argmax(np.linalg.norm(left, axis=0)))
        if (size := float(np.linalg.norm(left[:, k]))) == 0.0:
            return None
        unit = left[:, k] / size
        left = left - np.outer(unit, unit @ left)
        follow.append(moving[k])
    return (tuple(sorted(follow)), ()) if _regular(slopes, follow) else None
