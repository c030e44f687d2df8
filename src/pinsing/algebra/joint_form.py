"""An equation solved for a joint that enters it once: ``R cos(q2 - phi) = c``.

Where one angle occurs as cos and sin of itself alone, f = A cos q + B sin q + C with A, B and C of
the other joints. With R cos phi = A, R sin phi = B and c = -C that is R cos(q - phi) = c: given the
others, q is one of two values. Where C is zero throughout they lie half a turn apart.

Trigonometric polynomials as sums of products, one factor a joint, written as short as may be.

``cos(q2+q5) - cos(q2-q5)`` is ``-2 sin q2 sin q5``: an equation of an arm whose wrist has an offset
takes half the room so, and shows which factors its terms share. Numbers are floats or exact.
"""

from __future__ import annotations

import functools
import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np

from pinsing.algebra.equation import Equation, format_angle, joined, latex_symbol, moved, times
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
        for product, number in out.items():
            mine = (joint, "cos", 2) if (joint, "cos", 2) in product else (joint, "sin", 2)
            if mine not in product:
                after[product] = after.get(product, 0) + number
                continue
            rest = tuple([x for x in product if x[0] != joint])
            for factor, weight in _squares(mine, chosen):
                key = rest if factor is None else tuple(sorted((*rest, factor)))
                after[key] = after.get(key, 0) + number * weight
        out = after
    return out


def _squares(factor: Factor, chosen: str) -> list[tuple[Factor | None, int]]:
    """Cosine or sine of twice an angle as a sum of what it is, and how often."""
    j = factor[0]
    if factor[1] == "sin":
        return [((j, "sc", 1), 2)]
    return [((j, chosen, 1), 2 if chosen == "cc" else -2), (None, -1 if chosen == "cc" else 1)]


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
    """Return True if an equation of several joints can be solved for this one."""
    return len(equation.involved) > 1 and bool(_kind(equation, joint))


def _kind(equation: Equation, joint: int) -> str:
    """Return how a joint enters, if it does so once."""
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
