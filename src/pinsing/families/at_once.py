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
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np

from pinsing.algebra.conditions import Branch
from pinsing.algebra.equation import Equation, format_angle, joined, latex_symbol, moved, times
from pinsing.families.zero_set import MOST_ORDERED, Step, peeled, system_of
from pinsing.measures import Array, ArrayLike
from pinsing.prose import listed
from pinsing.robot.surd import exact_of, parts_of

Number: TypeAlias = Any
"""A float or an Exact; one expression has one kind alone."""
Factor = tuple[int, str, int]
"""Joint, function, multiple: cos and sin of a multiple, cc, ss and sc for squares and products of
the two of the angle itself, pow for a power of a length."""
Product = tuple[Factor, ...]


@dataclass(frozen=True)
class Expression:
    """A sum of products of functions of single joints."""

    terms: tuple[tuple[Number, Product], ...]  # coefficients and factors
    joints: tuple[str, ...]  # symbols of all joints
    shift: tuple[float, ...]  # radians added to each angle

    def __call__(self, q: ArrayLike) -> Array:
        """Value at q (..., n): (...)."""
        q = np.asarray(q, dtype=float)
        total = np.zeros(q.shape[:-1])
        for number, product in self.terms:
            value = np.full(q.shape[:-1], float(number))
            for j, function, k in product:
                value = value * _VALUE[function](q[..., j] + self.shift[j], k)
            total = total + value
        return np.asarray(total)

    @property
    def involved(self) -> tuple[int, ...]:
        """Joints that occur."""
        return tuple(sorted({j for _, product in self.terms for j, _, _ in product}))

    def negative(self) -> Expression:
        """Minus the expression."""
        return Expression(tuple((-c, p) for c, p in self.terms), self.joints, self.shift)

    def text(self, latex: bool = False) -> str:
        """One line: common factors before brackets."""
        writer = _Writer(self, latex)
        return _nested({writer.atoms(p): c for c, p in self.terms}, writer)


def expressions(
    equation: Equation, joint: int, exact: bool = False
) -> dict[tuple[str, int], Expression] | None:
    """Return the factor of each function of one joint, by function and multiple."""
    # ("cos", 1), ("sin", 1), ("pow", 1), ("one", 0), ("cos/2", 1). ``exact`` coefficients are whole
    # numbers for rational ones; None where they are not known.
    if exact and not equation.exact:
        return None
    table, scale = equation.once(f"grouped by {joint}", lambda: _grouped(equation, joint))
    factor = None if exact else scale
    best: dict[tuple[str, int], dict[Product, Number]] = {}
    for product, number in table.items():
        mine = [(f, k) for j, f, k in product if j == joint]
        key = mine[0] if mine else ("one", 0)
        shown = (
            (Fraction(number) if isinstance(number, int) else number)
            if factor is None
            else float(number) * factor
        )
        best.setdefault(key, {})[tuple(x for x in product if x[0] != joint)] = shown
    shift = tuple(float(s) for s in equation.shift)
    return {
        key: Expression(tuple((c, p) for p, c in part.items()), equation.joints, shift)
        for key, part in best.items()
    }


def _grouped(equation: Equation, joint: int) -> tuple[dict[Product, Number], float | None]:
    """Return the equation multiplied out, the shortest way, and a factor; exact where known."""
    rough = list(zip(equation.cos.tolist(), equation.sin.tolist(), strict=True))
    numbers: list[tuple[Number, Number]] = rough
    if equation.exact:  # so that what cancels does so
        numbers = [(_plain(c), _plain(s)) for c, s in equation.exact]
    largest = equation.size
    products = _products(equation)
    table = _gathered(products, rough)
    doubled = sorted(
        {j for p in table for j, f, k in p if j != joint and f in ("cos", "sin") and k == 2}
    )
    ways = itertools.islice(_ways(table, doubled), 243)
    chosen, _ = min(ways, key=lambda way: len(_kept(way[1], largest)))
    if numbers is not rough:
        table = _gathered(products, numbers)
    table = _rebased(table, dict(zip(doubled, chosen, strict=True)))
    if not equation.exact:
        return _kept(table, largest), None
    return {p: c for p, c in table.items() if float(c)}, _factor(rough, numbers)


def _ways(
    table: dict[Product, Number], joints: Sequence[int], chosen: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], dict[Product, Number]]]:
    """Return what a table becomes in each way to write twice the angles of some joints."""
    if not joints:
        yield chosen, table
        return
    for way in ("cos", "cc", "ss"):
        yield from _ways(_rebased(table, {joints[0]: way}), joints[1:], (*chosen, way))


def _plain(text: str) -> Number:
    """The exact number of a text, whole ones as ints: their sums and products are cheap."""
    if text.removeprefix("-").isdecimal():
        return int(text)
    number = exact_of(text)
    whole = isinstance(number, Fraction) and number.denominator == 1
    return number.numerator if isinstance(number, Fraction) and whole else number


def _factor(rough: Sequence[tuple[float, float]], exact: Sequence[tuple[Number, Number]]) -> float:
    """Return what exact coefficients are to be multiplied by."""
    flat = [(a, float(b)) for pair, other in zip(rough, exact, strict=True)
            for a, b in zip(pair, other, strict=True)]  # fmt: skip
    a, b = max(flat, key=lambda both: abs(both[0]))
    return a / b


def _kept(table: Mapping[Product, Number], largest: float) -> dict[Product, Number]:
    least = 1e-11 * largest
    return {p: c for p, c in table.items() if abs(float(c)) > least}


_Part = tuple[Product, int, int, int]
"""A product, the term that it comes from, whether from its cosine (0) or sine (1), and the sign."""


def _products(equation: Equation) -> list[_Part]:
    """Return cosines and sines of sums of angles multiplied out, whatever they are times."""
    # A joint with half-angles has odd multiples of half of it; they are left as they are.
    out: list[_Part] = []
    for t in range(len(equation.cos)):
        lengths = tuple((j, "pow", int(p)) for j, p in enumerate(equation.powers[t]) if p)
        # exp(i sum) = prod (cos + i sin): every sine brings an i and the sign of its angle.
        products: list[tuple[Product, int]] = [(lengths, 0)]
        for j, f in enumerate(equation.frequencies[t].tolist()):
            if not f:
                continue
            # Frequencies are twice the multiples: odd ones stay halves.
            half, k = ("/2", abs(f)) if f % 2 else ("", abs(f) // 2)
            cos, sin = (j, "cos" + half, k), (j, "sin" + half, k)
            turns = 1 if f > 0 else 3
            products = [
                both
                for factors, power in products
                for both in (((*factors, cos), power), ((*factors, sin), power + turns))
            ]
        for factors, power in products:
            whole = tuple(sorted(factors)) if lengths else factors
            out.append((whole, t, power % 2, -1 if power % 4 > 1 else 1))
    return out


def _gathered(
    parts: Sequence[_Part], numbers: Sequence[tuple[Number, Number]]
) -> dict[Product, Number]:
    """Their sum, with the numbers of the cosine and the sine of each term."""
    out: dict[Product, Number] = {}
    for product, t, which, sign in parts:
        number = numbers[t][which] * sign
        if float(number) != 0:
            out[product] = out.get(product, 0) + number
    return out


def _rebased(table: Mapping[Product, Number], way: Mapping[int, str]) -> dict[Product, Number]:
    """Cosine and sine of twice an angle, joint by joint, as squares where that is chosen."""
    out: dict[Product, Number] = dict(table)
    for joint, chosen in way.items():
        if chosen == "cos":
            continue
        after: dict[Product, Number] = {}
        # Cosine and sine of twice the angle as sums of these, and how often.
        sign = 1 if chosen == "cc" else -1
        of_cosine: list[tuple[Factor | None, int]] = [((joint, chosen, 1), 2 * sign), (None, -sign)]
        of_sine: list[tuple[Factor | None, int]] = [((joint, "sc", 1), 2)]
        for product, number in out.items():
            mine = (joint, "cos", 2) if (joint, "cos", 2) in product else (joint, "sin", 2)
            if mine not in product:
                after[product] = after.get(product, 0) + number
                continue
            rest = tuple([x for x in product if x[0] != joint])
            for factor, weight in of_cosine if mine[1] == "cos" else of_sine:
                key = rest if factor is None else tuple(sorted((*rest, factor)))
                after[key] = after.get(key, 0) + number * weight
        out = after
    return out


_VALUE: dict[str, Callable[[Array, int], Any]] = {
    "cos": lambda x, k: np.cos(k * x),
    "sin": lambda x, k: np.sin(k * x),
    "cos/2": lambda x, k: np.cos(k * x / 2),
    "sin/2": lambda x, k: np.sin(k * x / 2),
    "cc": lambda x, k: np.cos(x) ** 2,
    "ss": lambda x, k: np.sin(x) ** 2,
    "sc": lambda x, k: np.sin(x) * np.cos(x),
    "pow": lambda x, k: x**k,
}


# In words ------------------------------------------------------------------------------


class _Writer:
    """Factors and numbers of an expression as text or LaTeX."""

    def __init__(self, expression: Expression, latex: bool) -> None:
        self.joints, self.shift, self.latex = expression.joints, expression.shift, latex

    def atoms(self, product: Product) -> tuple[tuple[int, str, int], ...]:
        """Factors such that squares and products of sine and cosine can share one."""
        out: list[tuple[int, str, int]] = []
        for j, function, k in product:
            if function in ("cc", "ss", "sc"):
                out += [(j, "cos" if c == "c" else "sin", 1) for c in function]
            elif function == "pow":
                out += [(j, "pow", 1)] * k
            else:
                out.append((j, function, k))
        return tuple(sorted(out))

    def factors(self, atoms: Sequence[tuple[int, str, int]]) -> str:
        said = []
        for atom in dict.fromkeys(atoms):
            j, function, k = atom
            times = list(atoms).count(atom)
            name = latex_symbol(self.joints[j]) if self.latex else self.joints[j]
            if function == "pow":
                said.append(self._power(name, times))
                continue
            head = self._power(f"\\{function[:3]}" if self.latex else function[:3], times)
            angle = self._angle(j, name, k, function.endswith("/2"))
            gap = "" if angle.startswith("(") and not self.latex else " "
            said.append(f"{head}{gap}{angle}")
        return " ".join(said)

    def _power(self, base: str, times: int) -> str:
        if times == 1:
            return base
        if self.latex:
            return f"{base}^{{{times}}}"
        return base + {2: "²", 3: "³"}.get(times, f"^{times}")

    def _angle(self, j: int, name: str, k: int, half: bool) -> str:
        body = name if k == 1 else f"{k} {name}"
        if shift := self.shift[j]:
            body = moved(body, shift, format_angle(k * abs(shift), self.latex))
        inner = body if body == name else f"({body})"
        return f"({inner}/2)" if half else inner

    def number(self, value: Number) -> str:
        """The size of a number, without its sign where it has one."""
        if isinstance(value, float | int):
            return f"{abs(value):.6g}"
        roots = [(p, s) for p, s in zip(parts_of(value), (1, 2, 3, 6), strict=True) if p]
        said = ""
        for part, square in roots:
            sign = ("" if not said else " + ") if part > 0 or len(roots) == 1 else " - "
            size = abs(part)
            shown = str(size)
            root = "" if square == 1 else (rf"\sqrt{{{square}}}" if self.latex else f"√{square}")
            shown = root if root and size == 1 else f"{shown} {root}".strip()
            said += sign + shown
        return said if len(roots) == 1 else f"({said.strip()})"


def _nested(terms: Mapping[tuple[tuple[int, str, int], ...], Number], writer: _Writer) -> str:
    """A sum with the factor that most terms share before a bracket, and so on within."""
    pieces: list[tuple[bool, str]] = []
    brackets, alone = _brackets(tuple(terms))
    for pull, within in brackets:
        inner = {rest: terms[atoms] for atoms, rest in within}
        negative = _is_negative(next(iter(inner.values())))
        if negative:
            inner = {atoms: -c for atoms, c in inner.items()}
        pieces.append((negative, f"{writer.factors(pull)} ({_nested(inner, writer)})"))
    for atoms in alone:
        number = terms[atoms]
        pieces.append((_is_negative(number), times(writer.number(number), writer.factors(atoms))))
    return joined(pieces)


_Atoms = tuple[tuple[int, str, int], ...]


@functools.lru_cache(maxsize=512)
def _brackets(
    products: tuple[_Atoms, ...],
) -> tuple[list[tuple[_Atoms, list[tuple[_Atoms, _Atoms]]]], list[_Atoms]]:
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


def _is_negative(number: Number) -> bool:
    """Return True if a minus stands before it: sums with roots keep their signs inside."""
    parts = [p for p in parts_of(number) if p] if not isinstance(number, float | int) else []
    return len(parts) < 2 and float(number) < 0


def _without(
    atoms: tuple[tuple[int, str, int], ...], atom: tuple[int, str, int]
) -> tuple[tuple[int, str, int], ...]:
    left = list(atoms)
    left.remove(atom)
    return tuple(left)


@dataclass(frozen=True, eq=False)
class JointForm:
    """An equation as one for one of its joints."""

    equation: Equation
    joint: int  # the joint that it is solved for
    # "two": two values, or none where |c| > R. "opposite": two values half a turn apart. "half":
    # one value, of half of the angle. "length": one value of a prismatic joint
    kind: str
    # a, b and c: f = a cos q + b sin q + c ("two"); without c ("opposite"); with q/2 for q
    # ("half"); f = a q + c ("length"). What is zero is None
    a: Expression | None
    b: Expression | None
    c: Expression | None

    @property
    def given(self) -> tuple[int, ...]:
        """The other joints of the equation."""
        return tuple(j for j in self.equation.involved if j != self.joint)

    @property
    def solutions(self) -> int:
        """Largest number of values."""
        return 2 if self.kind in ("two", "opposite") else 1

    def solve(self, q: ArrayLike) -> Array:
        """Return values of the joint, (..., solutions), given the others of q (..., n)."""
        # Angles in (-pi, pi]; NaN where there is none, or where every value does.
        q = np.asarray(q, dtype=float)
        a, b, c = (np.zeros(q.shape[:-1]) if x is None else x(q) for x in (self.a, self.b, self.c))
        if self.kind == "length":
            with np.errstate(divide="ignore", invalid="ignore"):
                value = np.where(a == 0, np.nan, -c / a)
            return np.asarray(value[..., None])
        radius, phase = np.hypot(a, b), np.arctan2(b, a)
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.arccos(np.where(radius == 0, np.nan, -c / radius))
        if self.kind == "half":
            angles = 2 * (phase + np.pi / 2)[..., None]
            angles = np.where(radius[..., None] == 0, np.nan, angles)
        else:
            angles = np.stack([phase + turn, phase - turn], axis=-1)
        angles = angles - self.equation.shift[self.joint]
        return np.asarray(np.pi - (np.pi - angles) % (2 * np.pi))

    def parts(self, exact: bool = False, latex: bool = False) -> tuple[tuple[str, str], ...]:
        """Return R, phi and c as pairs of name and expression; empty if not known exactly."""
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
        return {
            "length": f"A {name} = c",
            "half": f"R {cos}({name}/2 - {phi}) = 0",
            "opposite": f"R {cos}({name} - {phi}) = 0",
            "two": f"R {cos}({name} - {phi}) = c",
        }[self.kind]

    def solution(self) -> str:
        """``q2 = φ ± arccos(c/R) where |c| <= R``, and the like."""
        values = {
            "length": "c/A: one value",
            "half": "2 φ + 180°: one value",
            "opposite": "φ ± 90°: one of two values, half a turn apart,",
            "two": "φ ± arccos(c/R) where |c| <= R: one of two values",
        }
        return f"{self._name(False)} = {values[self.kind]} given {self._given()}"

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
        shown = moved(name, shift, format_angle(abs(shift), latex))
        return f"({shown})" if self.kind == "half" else shown


def joint_form(
    equation: Equation, joint: int | None = None, exact: bool = False
) -> JointForm | None:
    """Return the equation as one for a joint that enters once, or None."""
    # By default one that has values for all others, else the first. None, too, if no others are
    # beside, or ``exact`` coefficients are not known.
    return equation.once(f"joint form {joint} {exact}", lambda: _joint_form(equation, joint, exact))


def _joint_form(equation: Equation, joint: int | None, exact: bool) -> JointForm | None:
    if joint is None:
        found = [(j, equation.enters(j)) for j in equation.involved]
        every = [j for j, kind in found if kind in ("opposite", "half")]
        once = [j for j, kind in found if kind]
        if not once or len(equation.involved) < 2:
            return None
        joint = (every or once)[0]
    kind = equation.enters(joint)
    parts = expressions(equation, joint, exact) if kind else None
    if parts is None:
        return None
    half = "/2" if kind == "half" else ""
    first = ("pow", 1) if kind == "length" else (f"cos{half}", 1)
    return JointForm(
        equation, joint, kind, parts.get(first), parts.get((f"sin{half}", 1)), parts.get(("one", 0))
    )


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
    """Return how a long equation is stated; None for short ones, and where no joint enters once."""
    return joint_form(equation) if len(equation.cos) > LONG else None


def solved_for(systems: Iterable[Sequence[Equation]]) -> tuple[SolvedFor, ...]:
    """Return the long equations that stand alone in a system: those leave the other joints free."""
    alone = [system[0] for system in systems if len(system) == 1]
    found: dict[SolvedFor, None] = {}
    for form in map(long_form, alone):
        if form is None:
            continue
        exact = form.parts(exact=True)
        one = SolvedFor(
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
        found[one] = None
    return tuple(found)


_INDEPENDENT = 1e-7
_SHORT = 4
"""Terms of an equation that is always written out."""


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
        return tuple(self._said())

    def _said(self) -> Iterator[str]:
        verb = "follows" if len(self.follow) == 1 else "follow"
        can = f"{listed(self.chosen)} can be chosen" if self.chosen else "no joint can be chosen"
        yield (
            f"dimension {len(self.chosen)}: near the configuration shown {can}; "
            f"{listed(self.follow)} {verb}"
        )
        yield from self.steps
        if len(self.steps) > MOST_ORDERED:
            doubles = sum("two solutions" in step for step in self.steps)
            yield f"so there are at most 2^{doubles} = {2**doubles} of these, given the others"
        if not self.steps:
            yield (
                "by solving the equations together: `Family.distance(q).q` gives the nearest "
                "solution, `Family.sample` gives many"
            )
        elif self.left:
            more = (
                "the other equation says"
                if self.left == 1
                else (f"the other {self.left} equations say")
            )
            yield f"{more} which of these values hold"


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
    sizes = np.linalg.svd(slopes, compute_uv=False)
    rank = int((sizes > _INDEPENDENT * max(float(sizes[0]), 1e-300)).sum())
    fixed = {v.joint for v in branch.values}
    moving = [j for j in sorted({j for e in equations for j in e.involved}) if j not in fixed]
    if not 0 < rank <= len(moving):
        return None
    found = _in_turn(equations, slopes, rank) or _together(slopes, rank, moving)
    if found is None:
        return None
    follow, steps = found
    chosen = [j for j in range(len(q)) if j not in follow and j not in fixed]
    return AtOnce(
        terms=tuple(len(e.cos) for e in equations),
        chosen=tuple(symbols[j] for j in chosen),
        follow=tuple(symbols[j] for j in follow),
        steps=steps,
        left=len(equations) - len(steps) if steps else 0,
    )


def _regular(slopes: Array, follow: Sequence[int], rank: int) -> bool:
    sizes = np.linalg.svd(slopes[:, list(follow)], compute_uv=False)
    return bool(sizes[rank - 1] > 1e3 * _INDEPENDENT * max(float(sizes[0]), 1e-300))


def _in_turn(
    equations: Sequence[Equation], slopes: Array, rank: int
) -> tuple[tuple[int, ...], tuple[str, ...]] | None:
    """Joints that follow one after the other, each from an equation that it enters once."""
    rows = sorted(
        zip(equations, slopes, strict=True), key=lambda r: (len(r[0].involved), len(r[0].cos))
    )
    if rank > MOST_ORDERED:
        return _peeled(rows, rank)
    several = [(e, s) for e, s in rows[:6] if len(e.involved) > 1]
    once = [(e, s, [j for j in e.involved if e.enters(j)]) for e, s in several]
    tried = 0
    for some in itertools.combinations(once, rank):
        for follow in itertools.product(*(joints for _, _, joints in some)):
            if len({*follow}) < rank:
                continue
            tried += 1
            # Choices of joints that are tried, at most.
            if tried > 2000:
                return None
            # An equation may use joints that follow from those before it, and no later one.
            later = [set(follow[k + 1 :]) for k in range(rank)]
            if any(set(e.involved) & later[k] for k, (e, _, _) in enumerate(some)):
                continue
            if _regular(np.array([s for _, s, _ in some]), follow, rank):
                forms = [joint_form(e, j) for (e, _, _), j in zip(some, follow, strict=True)]
                if None not in forms:
                    return follow, tuple(
                        f"{f.condition()} [{len(f.equation.cos)} terms]: {f.solution()}"
                        for f in forms
                        if f is not None
                    )
    return None


def _peeled(
    rows: Sequence[tuple[Equation, Array]], rank: int
) -> tuple[tuple[int, ...], tuple[str, ...]] | None:
    """The same of many equations: the simplest that are independent, if they can be so solved."""
    some: list[tuple[Equation, Array]] = []
    for e, slope in rows:
        sizes = np.linalg.svd(np.array([*(s for _, s in some), slope]), compute_uv=False)
        if sizes[-1] > _INDEPENDENT * max(float(sizes[0]), 1e-300):
            some.append((e, slope))
        if len(some) == rank:
            break
    order = peeled([e for e, _ in some], np.ones(len(rows[0][1]), dtype=bool))
    if order is None or len(some) < rank:
        return None
    return tuple(step.joint for step in order), tuple(_told(step) for step in order)


def _told(step: Step) -> str:
    """Return what one of many equations says of a joint."""
    names = step.equation.joints
    others = [names[j] for j in step.equation.involved if j != step.joint]
    given = f" given {listed(others)}" if others else ""
    count = "two solutions" if step.kind in ("two", "opposite") else "one solution"
    return f"{names[step.joint]} has {count}{given} [{len(step.equation.cos)} terms]"


def _together(
    slopes: Array, rank: int, moving: Sequence[int]
) -> tuple[tuple[int, ...], tuple[str, ...]] | None:
    """Joints that follow from all equations: those whose columns are the most independent."""
    left, follow = slopes[:, list(moving)].copy(), list[int]()
    for _ in range(rank):
        k = int(np.argmax(np.linalg.norm(left, axis=0)))
        if (size := float(np.linalg.norm(left[:, k]))) == 0.0:
            return None
        unit = left[:, k] / size
        left = left - np.outer(unit, unit @ left)
        follow.append(moving[k])
    return (tuple(sorted(follow)), ()) if _regular(slopes, follow, rank) else None
