"""Which lengths of a chain stay symbols, and how its exact placements depend on them.

Placements depend on the lengths of a table linearly while its angles stand. So what a length does
is seen from the chain in which it is 1 m and all others are zero: whatever the convention, and
wherever the way from table to placements puts it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from pinsing._dataclass import dataclass
from pinsing.description.dh_table import DHTable, read_dh
from pinsing.description.dh_urdf import bare_urdf
from pinsing.errors import OptionError, PinsingError, UnknownNameError
from pinsing.geometry.exact_placements import Length3
from pinsing.geometry.nominal import Nominal, nominal
from pinsing.robot.arm import Arm
from pinsing.robot.load import load

_ALIKE = 1e-9


@dataclass(frozen=True, eq=False)
class Lengths:
    """A chain whose placements are sums of symbols.

    Attributes
    ----------
    geometry : Nominal
        The chain with the numbers of its file.
    symbols : tuple of str
        Names of the lengths.
    values : tuple of float
        Their values in the file, metres.
    parts : tuple of tuples of n + 1 triples
        For each symbol by what it counts in each coordinate of each placement.
    rest : tuple of n + 1 triples
        What is no symbol, metres.
    """

    geometry: Nominal
    symbols: tuple[str, ...]
    values: tuple[float, ...]
    parts: tuple[tuple[Length3, ...], ...]
    rest: tuple[Length3, ...]


def of_table(table: DHTable, chosen: Sequence[str] | None, angle_tol: float) -> Lengths:
    """The lengths a1, d1, a2, ... of a table; by default those that are not zero.

    Raises
    ------
    UnknownNameError
        If there is no length of a name.
    OptionError
        If no length is left, or the chain is not what the table says.
    """
    known = lengths_of(table)
    names = _chosen(known, chosen)
    real = _geometry(table, angle_tol)
    zero = dict.fromkeys(known, 0.0)
    bare = replace(table, tool=None)
    parts = tuple(
        _geometry(_with(bare, {**zero, name: 1.0}), angle_tol).translation for name in names
    )
    left = {n: 0.0 if n in names else v for n, v in known.items()}
    rest = _geometry(_with(table, left), angle_tol).translation
    made = Lengths(real, names, tuple(known[n] for n in names), parts, rest)
    _check(made)
    return made


def of_arm(arm: Arm, chosen: Sequence[str] | None, angle_tol: float) -> Lengths:
    """Lengths of an arm: of its DH table where it was made of one, else named after its joints.

    ``elbow_joint_x`` is how far the axis of elbow_joint is from the one before along x of the
    chain's exact frames (z is along that axis), and ``tool_x`` where the tip is from the last.

    Raises
    ------
    UnknownNameError, OptionError
        As `of_table`.
    """
    path = Path(arm.source.label)
    if path.suffix.lower() in (".yaml", ".yml") and path.is_file():
        table = read_dh(path)
        if len(table.rows) == arm.n and arm.task.name == "pose":
            return of_table(table, chosen, angle_tol)
    geometry = nominal(arm, angle_tol)
    ends = ["base", *list(arm.model.names)[1:], "tool"]
    found: dict[str, tuple[int, int, Fraction]] = {}
    for i, vector in enumerate(geometry.translation[1:], 1):
        for k, value in enumerate(vector):
            if value != 0:
                found[f"{ends[i + 1]}_{'xyz'[k]}"] = i, k, value
    names = _chosen({n: float(abs(v)) for n, (_, _, v) in found.items()}, chosen)
    parts, rest = [], [list(v) for v in geometry.translation]
    for name in names:
        i, k, value = found[name]
        part = [[Fraction(0)] * 3 for _ in geometry.translation]
        part[i][k] = Fraction(1 if value > 0 else -1)
        rest[i][k] = Fraction(0)
        parts.append(_triples(part))
    values = tuple(float(abs(found[n][2])) for n in names)
    return Lengths(geometry, names, values, tuple(parts), _triples(rest))


def lengths_of(table: DHTable) -> dict[str, float]:
    """Lengths of a table by name: a1, d1, a2, ...; a joint that slides has no d but its value."""
    found = {}
    for i, row in enumerate(table.rows, 1):
        found[f"a{i}"] = row.a
        if row.type != "prismatic":
            found[f"d{i}"] = row.d
    return found


def _chosen(known: dict[str, float], chosen: Sequence[str] | None) -> tuple[str, ...]:
    if chosen is None:
        names = tuple(n for n, v in known.items() if v != 0)
    else:
        names = tuple(dict.fromkeys(n.strip() for n in chosen if n.strip()))
        for name in names:
            if name not in known:
                raise UnknownNameError("length", name, tuple(known))
    if not names:
        raise OptionError("no length is to be a symbol: all are zero, or none was named")
    return names


def _with(table: DHTable, values: dict[str, float]) -> DHTable:
    rows = [
        replace(row, a=values[f"a{i}"], d=values.get(f"d{i}", row.d))
        for i, row in enumerate(table.rows, 1)
    ]
    return replace(table, rows=tuple(rows))


def _geometry(table: DHTable, angle_tol: float) -> Nominal:
    try:
        return nominal(load(bare_urdf(table), tip="tool0"), angle_tol)
    except PinsingError as error:
        raise OptionError(f"the table makes no chain: {error}") from None


def _check(made: Lengths) -> None:
    """Whether the sums are the chain: else a length stands where angles were moved."""
    for i, vector in enumerate(made.geometry.translation):
        for k, value in enumerate(vector):
            total = float(made.rest[i][k])
            total += sum(v * float(p[i][k]) for v, p in zip(made.values, made.parts, strict=True))
            if abs(total - float(value)) > _ALIKE * max(1.0, abs(float(value))):
                raise OptionError(
                    "the placements of the table are no plain sums of its lengths: its angles are "
                    "too far from exact ones for symbols"
                )


def _triples(rows: Sequence[Sequence[Fraction]]) -> tuple[Length3, ...]:
    return tuple((r[0], r[1], r[2]) for r in rows)
