"""What the page lists: families, findings or single configurations, each with its poses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.families import Branch, joint_symbols
from pinsing.families.paths import FamilyLike
from pinsing.kinematics.jacobian import tip_placement
from pinsing.kinematics.verdict import own_shares
from pinsing.robot.arm import Arm

_SEED = 4
_SAMPLES = 80
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
        boundary, interior or undecided; which axes line up. Empty where not known.
    codimension : int or None
        Number of independent conditions.
    lost : tuple of str
        Motions lost at a generic point.
    reachable : bool or None
        Whether the limits allow it; None where that is not known.
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
    out = []
    for family in families:
        chosen = choose_poses(arm, family, poses)
        reachable = getattr(family, "is_reachable", None)
        out.append(
            Entry(
                name=family.name,
                text=family.text,
                poses=chosen,
                moved=tuple(i for i, name in enumerate(arm.joints) if name in family.joints),
                symbols=symbols,
                prismatic=arm.prismatic,
                kind=str(getattr(family, "kind", "") or ""),
                reason=str(getattr(family, "reason", "") or ""),
                codimension=getattr(family, "codimension", None),
                lost=tuple(getattr(family, "lost", ())),
                reachable=True if chosen else reachable,
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


def choose_poses(arm: Arm, family: FamilyLike, count: int) -> tuple[Array, ...]:
    """Configurations of a family that show it well.

    They are away from other singularities, above the floor, not twisted up, and unlike
    each other; the same ones at every call.
    """
    rng = np.random.default_rng(_SEED)
    Q = family.sample(_SAMPLES, rng)
    witness = getattr(family, "witness", None)
    if not len(Q):
        return () if witness is None else (np.array(witness, dtype=float),)
    share = own_shares(arm, Q)
    # The singular value that should survive at a generic point of the family.
    drop = max(1, int(np.median((share <= 1e-7).sum(axis=1))))
    healthy = share[:, -1 - drop] if share.shape[1] > drop else 1.0
    lower, upper = arm.span
    middle, half = (lower + upper) / 2, np.maximum((upper - lower) / 2, 1e-9)
    twisted = np.abs((Q - middle) / half).mean(axis=1)
    score = np.minimum(healthy / 0.1, 1.0) + 0.7 * _above_floor(arm, Q) - 0.8 * twisted
    chosen = [int(np.argmax(score))]
    reach = np.where(arm.prismatic, half, np.pi)
    for _ in range(min(count, len(Q)) - 1):
        gap = np.min([np.linalg.norm((Q - Q[c]) / reach, axis=1) for c in chosen], axis=0)
        gap[chosen] = -np.inf
        chosen.append(int(np.argmax(score + 1.2 * np.minimum(gap, 1.0))))
    return tuple(Q[c] for c in chosen)


def _above_floor(arm: Arm, Q: Array) -> Array:
    """1 where the tip is above the base, 0 where far below it; (N,)."""
    z = np.array([tip_placement(arm, q).translation[2] for q in Q])
    spread = float(np.ptp(z)) or 1.0
    return np.clip((z + 0.1 * spread) / (0.2 * spread), 0.0, 1.0)
