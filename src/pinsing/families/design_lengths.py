"""Which lengths and twists of a chain stay symbols, and how its exact placements depend on them.

Placements depend on the lengths of a table linearly while its angles stand. So what a length does
is seen from the chain in which it is 1 m and all others are zero: whatever the convention, and
wherever the way from table to placements puts it. A twist turns what comes after it as a joint
does: it is one of the chain that is looked at, about x, that does not count as a motion.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.algebra.mimic import own_offsets
from pinsing.description.dh_table import BASE, FLANGE, TIP, DHTable, bare_urdf, read_dh, with_turns
from pinsing.errors import OptionError, PinsingError, UnknownNameError
from pinsing.robot.arm import Arm
from pinsing.robot.chain import Chain
from pinsing.robot.exact_placements import ExactPlacements, Length3
from pinsing.robot.joints import axis_rotation
from pinsing.robot.load import load
from pinsing.robot.nominal import Nominal, nominal

_AXES = dict(zip("xyz", np.eye(3), strict=True))


@dataclass(frozen=True, eq=False)
class Lengths:
    """A chain whose placements are sums of symbols."""

    # the chain with the numbers of its file; twists that are symbols are joints of it
    geometry: Nominal
    symbols: tuple[str, ...]  # names of the lengths and twists
    angles: tuple[bool, ...]  # which of them are twists
    values: tuple[float, ...]  # their values in the file, metres and radians
    # for each joint of the chain its number among the arm's own, or theirs and the symbols' number
    # after these
    order: tuple[int, ...]
    # for each symbol by what it counts in each coordinate of each placement
    parts: tuple[tuple[Length3, ...], ...]
    rest: tuple[Length3, ...]  # what is no symbol, metres

    @property
    def joints(self) -> int:
        """Number of joints of the arm."""
        return len(self.geometry.prismatic) - sum(self.angles)

    @property
    def offset(self) -> Array:
        """Radians added to each joint of the arm and to each symbol that is a twist; else zero."""
        offset = np.zeros(self.joints + len(self.symbols))
        offset[list(self.order)] = own_offsets(self.geometry)
        return offset


def of_table(arm: Arm, table: DHTable, chosen: Sequence[str] | None, angle_tol: float) -> Lengths:
    """Lengths a1, d1, a2, ... and twists alpha1, ...; by default all lengths that are not zero."""
    known = lengths_of(table)
    twists = {f"alpha{i}": row.alpha for i, row in enumerate(table.rows, 1)}
    names = _chosen(known, twists, chosen)
    turning = [i for i, name in enumerate(twists, 1) if name in names]
    try:
        if turning:
            text = bare_urdf(table, turning)
            arm = load(text, tip=arm.tip).with_task(arm.task)
        real = nominal(arm, angle_tol)
    except PinsingError as error:
        raise OptionError(f"the table makes no chain: {error}") from None
    end = arm.tip == TIP
    zero = dict.fromkeys(known, 0.0)
    bare = replace(table, tool=None)

    def translation(values: dict[str, float], of: DHTable) -> tuple[Length3, ...]:
        return _translation(_with(of, values), turning, end, arm, angle_tol)

    parts = tuple(
        translation({**zero, name: 1.0} if name in known else zero, bare) for name in names
    )
    rest = translation({n: 0.0 if n in names else v for n, v in known.items()}, table)
    n = len(table.rows)
    place = {f"{i}_twist": n + names.index(f"alpha{i}") for i in turning}
    own = itertools.count()
    chain = [name for name, axis, _ in with_turns(table, turning) if axis]
    made = Lengths(
        geometry=real,
        symbols=names,
        angles=tuple(name in twists for name in names),
        values=tuple({**known, **twists}[name] for name in names),
        order=tuple(place[name] if name in place else next(own) for name in chain),
        parts=parts,
        rest=rest,
    )
    _check(made)
    return made


def of_arm(arm: Arm, chosen: Sequence[str] | None, angle_tol: float) -> Lengths:
    """Return the lengths of an arm, of its DH table or named after joints (elbow_joint_x, tool_x).

    Along the axes of the exact frames, z the joint's, from the axis before to this one.
    """
    path = Path(arm.source.label)
    whole = arm.base == BASE and arm.tip in (TIP, FLANGE)
    if whole and path.suffix.lower() in (".yaml", ".yml") and path.is_file():
        table = read_dh(path)
        if [row.name for row in table.rows] == list(arm.joints):
            return of_table(arm, table, chosen, angle_tol)
    geometry = nominal(arm, angle_tol)
    ends = ["base", *list(arm.model.names)[1:], "tool"]
    found: dict[str, tuple[int, int, Fraction]] = {}
    for i, vector in enumerate(geometry.translation[1:], 1):
        for k, value in enumerate(vector):
            if value != 0:
                found[f"{ends[i + 1]}_{'xyz'[k]}"] = i, k, value
    names = _chosen({n: float(abs(v)) for n, (_, _, v) in found.items()}, {}, chosen)
    parts, rest = [], [list(v) for v in geometry.translation]
    for name in names:
        i, k, value = found[name]
        part = [[Fraction(0)] * 3 for _ in geometry.translation]
        part[i][k] = Fraction(1 if value > 0 else -1)
        rest[i][k] = Fraction(0)
        parts.append(_triples(part))
    return Lengths(
        geometry=geometry,
        symbols=names,
        angles=(False,) * len(names),
        values=tuple(float(abs(found[n][2])) for n in names),
        order=tuple(range(len(geometry.prismatic))),
        parts=tuple(parts),
        rest=_triples(rest),
    )


def lengths_of(table: DHTable) -> dict[str, float]:
    """Lengths of a table by name: a1, d1, a2, ...; a joint that slides has no d but its value."""
    found = {}
    for i, row in enumerate(table.rows, 1):
        found[f"a{i}"] = row.a
        if row.type != "prismatic":
            found[f"d{i}"] = row.d
    return found


def _chosen(
    known: dict[str, float], twists: dict[str, float], chosen: Sequence[str] | None
) -> tuple[str, ...]:
    if chosen is None:
        names = tuple(n for n, v in known.items() if v != 0)
    else:
        names = tuple(dict.fromkeys(n.strip() for n in chosen if n.strip()))
        for name in names:
            if name not in known and name not in twists:
                raise UnknownNameError("length", name, (*known, *twists))
    if not names:
        raise OptionError("no length is to be a symbol: all are zero, or none was named")
    return names


def _with(table: DHTable, values: dict[str, float]) -> DHTable:
    rows = [
        replace(row, a=values[f"a{i}"], d=values.get(f"d{i}", row.d))
        for i, row in enumerate(table.rows, 1)
    ]
    return replace(table, rows=tuple(rows))


def _translation(
    table: DHTable, turning: Collection[int], end: bool, arm: Arm, angle_tol: float
) -> tuple[Length3, ...]:
    """Exact translations of the chain of a table, to its tool if ``end``, else to its flange."""
    shown = table if end else replace(table, tool=None)
    rotations, translations, sliding = [], [], []
    kinds = {row.name: row.type == "prismatic" for row in table.rows}
    place, before = pin.SE3.Identity(), np.eye(3)
    for name, axis, fixed in with_turns(shown, turning):
        place = place * pin.SE3(pin.rpy.rpyToMatrix(*fixed.rpy), np.array(fixed.xyz))
        if axis:
            turned = axis_rotation(_AXES[axis])
            rotations.append(before.T @ place.rotation @ turned)
            translations.append(before.T @ place.translation)
            sliding.append(kinds.get(name, False))
            place, before = pin.SE3.Identity(), turned
    rotations.append(before.T @ place.rotation)
    translations.append(before.T @ place.translation)
    raw = Chain(np.array(rotations), np.array(translations), np.array(sliding, dtype=bool))
    places = ["a placement"] * (raw.n + 1)
    return ExactPlacements(raw, places, angle_tol).translation


def _check(made: Lengths) -> None:
    """Return whether the sums are the chain: else a length stands where angles were moved."""
    for i, vector in enumerate(made.geometry.translation):
        for k, value in enumerate(vector):
            total = float(made.rest[i][k])
            total += math.fsum(
                v * float(p[i][k]) for v, p in zip(made.values, made.parts, strict=True)
            )
            if abs(total - float(value)) > 1e-9 * max(1.0, abs(float(value))):
                raise OptionError(
                    "the placements of the table are no plain sums of its lengths: its angles are "
                    "too far from exact ones for symbols"
                )


def _triples(rows: Sequence[Sequence[Fraction]]) -> tuple[Length3, ...]:
    return tuple((r[0], r[1], r[2]) for r in rows)
