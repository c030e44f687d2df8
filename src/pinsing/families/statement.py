"""Families for print: mirror images joined, conditions in words."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from pinsing.algebra.equation import LATEX, PLAIN, Equation, latex_symbol
from pinsing.families.at_once import LONG, long_form, long_ones
from pinsing.families.parts import Branch
from pinsing.families.pieces import SolvedPiece
from pinsing.prose import listed


def mirror_key(piece: SolvedPiece) -> object:
    """Equal for pieces that are mirror images: values up to sign and half turns."""
    if len(piece.solved) > 1:
        return object()
    values = {
        (v.joint, round(abs(math.remainder(v.value, math.pi)), 9))
        for b in piece.branches
        for v in b.values
    }
    relations = sorted(_signature(e) for b in piece.branches for e in b.equations)
    solved = sorted(_signature(e) for e in piece.solved)
    return (
        tuple(sorted(values)),
        tuple(relations[: len(piece.branches[0].equations)]),
        tuple(solved),
    )


def _signature(equation: Equation) -> tuple[tuple[tuple[int, ...], tuple[int, ...], float], ...]:
    size = np.hypot(equation.cos, equation.sin)
    size = size / size.max()
    return tuple(
        sorted(
            (tuple(int(k) for k in np.abs(f)), tuple(int(k) for k in p), round(float(c), 8))
            for f, p, c in zip(equation.frequencies, equation.powers, size, strict=True)
        )
    )


def statement(
    branches: Sequence[Branch],
    solved: Sequence[Equation],
    symbols: Sequence[str],
    prismatic: Sequence[bool],
    latex: bool = False,
) -> str:
    """The condition of a family in one line."""
    groups: dict[tuple[str, ...], list[Branch]] = {}
    for b, key in _sums_joined(branches, latex):
        groups.setdefault(key, []).append(b)
    parts = []
    for texts, members in groups.items():
        parts += [
            (r",\ " if latex else " and ").join(list(values) + list(texts))
            for values in _value_texts(members, solved, symbols, prismatic, latex)
        ]
    return (r"\ \text{or}\ " if latex else "; or ").join(parts)


def _sums_joined(branches: Sequence[Branch], latex: bool) -> list[tuple[Branch, tuple[str, ...]]]:
    """Branches with their equations in words; once, where only one sum of angles differs."""
    alike: dict[object, list[Branch]] = {}
    for b in branches:
        sums = [e for e in b.equations if e.angle_sum is not None]
        key: object = object()
        if len(sums) == 1:
            rest = tuple(e.text() for e in b.equations if e is not sums[0])
            values = tuple((v.joint, round(v.value, 12)) for v in b.values)
            key = (values, rest, sums[0].frequencies.tobytes())
        alike.setdefault(key, []).append(b)
    return [(members[0], _joined_texts(members, latex)) for members in alike.values()]


def _joined_texts(members: Sequence[Branch], latex: bool) -> tuple[str, ...]:
    equations = members[0].equations
    if len(members) == 1:
        return _written(equations, latex)
    said = next(e for e in equations if e.angle_sum is not None)
    angles = [e.angle_sum for b in members for e in b.equations if e.angle_sum is not None]
    rest = [e for e in equations if e is not said]
    return (said.angle_sum_text(angles, latex), *_written(rest, latex))


def _written(equations: Sequence[Equation], latex: bool) -> tuple[str, ...]:
    """Equations that hold at once: the short ones, and of several long ones how many."""
    straight = [e for e in equations if _half_turns(e)]
    # Joints that are each at 0 or 180 degrees, beyond which these are not listed one by one.
    if len(straight) > 3:
        rest = _written([e for e in equations if e not in straight], latex)
        return (_each_straight(straight, latex), *rest)
    long = long_ones(equations)
    if len(long) < 2:
        return tuple(_write(e, latex, len(equations) == 1) for e in equations)
    names = [long[0].joints[j] for j in sorted({j for e in long for j in e.involved})]
    sizes = sorted(len(e.cos) for e in long)
    size = f"{sizes[0]} to {sizes[-1]}" if sizes[0] < sizes[-1] else f"{sizes[0]}"
    if latex:
        symbols = ", ".join(map(latex_symbol, names))
        said = rf"{len(long)}\ \text{{equations at once in}}\ {symbols}"
    else:
        said = f"{len(long)} equations at once in {listed(names)} [{size} terms]"
    return (*(_write(e, latex, False) for e in equations if e not in long), said)


def _half_turns(equation: Equation) -> bool:
    """Return True if an equation says that one joint is at 0 or 180 degrees: sin q = 0."""
    # Twice the multiple of an angle that occurs as itself.
    return (
        len(equation.involved) == 1
        and len(equation.cos) == 1
        and not equation.powers.any()
        and abs(int(equation.frequencies[0][equation.involved[0]])) == 2
        and float(equation.cos[0]) == 0.0
        and not equation.shift[equation.involved[0]]
    )


def _each_straight(equations: Sequence[Equation], latex: bool) -> str:
    """``q2 to q20 each 0° or 180°``, of many joints."""
    joints = sorted({e.involved[0] for e in equations})
    runs: list[list[int]] = []
    for j in joints:
        if runs and j == runs[-1][-1] + 1:
            runs[-1].append(j)
        else:
            runs.append([j])
    symbols = equations[0].joints
    named = [latex_symbol(s) for s in symbols] if latex else list(symbols)
    to = r"\ \text{to}\ " if latex else " to "
    said = []
    for run in runs:
        ends = [named[j] for j in run]
        said += [f"{ends[0]}{to}{ends[-1]}"] if len(run) > 2 else ends
    if latex:
        return rf"{', '.join(said)}\ \text{{each}}\ 0^\circ\ \text{{or}}\ 180^\circ"
    return f"{listed(said)} each 0° or 180°"


def _write(equation: Equation, latex: bool, alone: bool) -> str:
    form = long_form(equation) if alone else None
    if form is not None:
        return form.latex() if latex else form.text()
    if len(equation.cos) > LONG and not latex:
        names = ", ".join(equation.joints[j] for j in equation.involved)
        return f"f({names}) = 0 [{len(equation.cos)} terms]"
    return equation.latex() if latex else equation.text()


def _value_texts(
    branches: Sequence[Branch],
    solved: Sequence[Equation],
    symbols: Sequence[str],
    prismatic: Sequence[bool],
    latex: bool,
) -> list[tuple[str, ...]]:
    """Conditions on single joints; one tuple if all combinations occur, else one a branch."""
    joints = [v.joint for v in branches[0].values]
    if not joints:
        return [()]
    sets = {
        j: sorted({round(v.value, 12) for b in branches for v in b.values if v.joint == j})
        for j in joints
    }
    combinations = {tuple(round(v.value, 12) for v in b.values) for b in branches}
    if combinations == set(itertools.product(*(sets[j] for j in joints))):
        # A mirror image has roots of its own, which the equation of the other one has not.
        equations = {e.involved[0]: e for e in solved if _holds(e, sets)}
        return [
            tuple(
                _joint_text(symbols[j], sets[j], prismatic[j], equations.get(j), latex)
                for j in joints
            )
        ]
    return [
        tuple(
            _joint_text(symbols[v.joint], [v.value], prismatic[v.joint], None, latex)
            for v in b.values
        )
        for b in branches
    ]


def _holds(equation: Equation, sets: dict[int, list[float]]) -> bool:
    """Return True if all values of its joint are roots of an equation."""
    values = sets[equation.involved[0]]
    q = np.zeros((len(values), len(equation.joints)))
    q[:, equation.involved[0]] = values
    return bool((np.abs(equation(q)) < 1e-9 * equation.size).all())


def _joint_text(
    symbol: str, values: Sequence[float], slides: bool, equation: Equation | None, latex: bool
) -> str:
    name = latex_symbol(symbol) if latex else symbol
    known = f"{name} = {_set_text(values, slides, latex)}"
    if equation is None or slides:
        return known
    simple = _sine_or_cosine(equation, name, latex)
    written = simple or (equation.latex() if latex else equation.text())
    return f"{written}\\ ({known})" if latex else f"{written} ({known})"


def _set_text(values: Sequence[float], slides: bool, latex: bool) -> str:
    if slides:
        unit = r"\,\mathrm{m}" if latex else " m"
        said = [f"{v:.6g}{unit}" if v else "0" for v in values]
        return (r"\ \text{or}\ " if latex else " or ").join(said)
    return (LATEX if latex else PLAIN).angles(values)


def _sine_or_cosine(equation: Equation, name: str, latex: bool) -> str | None:
    """``sin q6 = -0.2`` for an equation a sin q + b = 0 (or with cos)."""
    if len(equation.cos) != 2 or equation.shift[list(equation.involved)].any():
        return None
    moving = int(np.argmax(np.abs(equation.frequencies).sum(axis=1)))
    constant = 1 - moving
    if equation.frequencies[constant].any() or np.abs(equation.frequencies[moving]).sum() != 2:
        return None
    pair = (equation.cos[moving], equation.sin[moving])
    if (pair[0] == 0) == (pair[1] == 0):
        return None
    kind, head = ("sin", pair[1]) if pair[0] == 0 else ("cos", pair[0])
    value = -equation.cos[constant] / head
    return f"{chr(92) if latex else ''}{kind} {name} = {value:.10g}"
