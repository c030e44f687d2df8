"""What the page lists: families, findings or single configurations, each with its poses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.families import Branch, Family, joint_symbols
from pinsing.families.paths import FamilyLike
from pinsing.families.telling_poses import telling_poses
from pinsing.robot.arm import Arm

_LONGEST = 72


@dataclass(frozen=True, eq=False)
class Entry:
    """A line of the list: a family or a configuration, with the poses to step through.

    Attributes
    ----------
    name : str
        ``F1``, or ``P1`` for a configuration.
    text : str
        The condition.
    poses : tuple of (n,) arrays
        Configurations, none where nothing is within reach.
    moved : tuple of int
        Joints that the condition is about.
    symbols : tuple of str
        Symbols of all joints, base to tip.
    prismatic : (n,) array of bool
        Which joints slide.
    kind, reason : str
        boundary, interior or undecided, of each piece where they differ; which axes line up.
        Empty where not known.
    codimension : int or None
        Number of independent conditions.
    lost : tuple of str
        Motions lost at a generic point.
    reachable : bool or None
        Whether the limits allow it; None where that is not known.
    reach : str
        In words, where they allow it with some of its joint values only; else empty.
    family : FamilyLike or None
        The family itself, where there is one.
    """

    name: str
    text: str
    poses: tuple[Array, ...]
    moved: tuple[int, ...]
    symbols: tuple[str, ...]
    prismatic: npt.NDArray[np.bool_]
    kind: str = ""
    reason: str = ""
    codimension: int | None = None
    lost: tuple[str, ...] = ()
    reachable: bool | None = True
    reach: str = ""
    family: FamilyLike | None = None

    def where(self, q: Array) -> str:
        """The part of the condition that holds at q: ``q5 = 180°`` out of ``q5 = 0 or 180°``."""
        for values in self.family.values if self.family is not None else ():
            if values and all(
                _same(q[j], value, bool(self.prismatic[j])) for j, value in values.items()
            ):
                return self._words(values)
        return self._words({})

    def where_branch(self, branch: Branch) -> str:
        """The part of the condition that a branch of the family is about."""
        return self._words({v.joint: v.value for v in branch.values})

    def _words(self, values: Mapping[int, float]) -> str:
        if not values:
            long = len(self.text) > _LONGEST
            return f"{self.text[: _LONGEST - 2].rstrip()} …" if long else self.text
        words = " and ".join(
            f"{self.symbols[j]} = {_value(v, bool(self.prismatic[j]))}" for j, v in values.items()
        )
        # The rest is an equation, which the list has in full.
        return words if set(values) == set(self.moved) else f"{words} and …"


def _same(a: float, b: float, slides: bool) -> bool:
    gap = a - b if slides else math.remainder(a - b, 2 * math.pi)
    return abs(gap) < 1e-6


def _value(value: float, slides: bool) -> str:
    return f"{value:g} m" if slides else f"{round(math.degrees(value), 4):g}°"


def family_entries(arm: Arm, families: Iterable[FamilyLike], poses: int = 3) -> tuple[Entry, ...]:
    """List families of an arm, with up to ``poses`` telling configurations of each."""
    symbols = joint_symbols(arm)
    families, out = tuple(families), []
    for family in families:
        others = [f for f in families if f is not family and isinstance(f, Family) and f.real]
        chosen = telling_poses(arm, family, poses, others)
        reachable = getattr(family, "is_reachable", None)
        out.append(
            Entry(
                name=family.name,
                text=family.text,
                poses=chosen,
                moved=tuple(i for i, name in enumerate(arm.joints) if name in family.joints),
                symbols=symbols,
                prismatic=arm.prismatic,
                kind=_kind(family),
                reason=str(getattr(family, "reason", "") or ""),
                codimension=getattr(family, "codimension", None),
                lost=tuple(getattr(family, "lost", ())),
                reachable=True if chosen else reachable,
                reach=_reach(family),
                family=family,
            )
        )
    return tuple(out)


def pose_entries(arm: Arm, configurations: Iterable[npt.ArrayLike]) -> tuple[Entry, ...]:
    """List single configurations."""
    symbols = joint_symbols(arm)
    out = []
    for number, q in enumerate(configurations, 1):
        q = arm.check_one(q, "poses")
        text = ", ".join(
            f"{s} = {_value(x, bool(p))}" for s, x, p in zip(symbols, q, arm.prismatic, strict=True)
        )
        everything = tuple(range(arm.n))
        out.append(Entry(f"P{number}", text, (q,), everything, symbols, arm.prismatic))
    return tuple(out)


def _reach(family: FamilyLike) -> str:
    """What there is to say of the limits beside that they allow the family, or do not."""
    if not isinstance(family, Family) or family.reach == family.reachability.words:
        return ""
    return family.reach


def _kind(family: FamilyLike) -> str:
    if isinstance(family, Family) and family.kind == "varies":
        return "; ".join(str(part) for part in family.kinds)
    kind = str(getattr(family, "kind", "") or "")
    return "boundary or interior: undecided" if kind == "undecided" else kind
