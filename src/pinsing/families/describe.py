"""From pieces of the singular set to families with points, limits, kinds and words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pinsing._types import Array, Bool
from pinsing.algebra.budget import Budget
from pinsing.configuration.at import Loss, loss_at
from pinsing.configuration.state import State
from pinsing.families.at_once import at_once
from pinsing.families.empty_box import Stop, proven_empty
from pinsing.families.example import readable
from pinsing.families.family import Family
from pinsing.families.kinds import kinds_of
from pinsing.families.nearness import near
from pinsing.families.own_points import OwnPoints
from pinsing.families.parts import Branch
from pinsing.families.pieces import PieceMaker, SolvedPiece
from pinsing.families.solved_for import solved_for
from pinsing.families.statement import statement
from pinsing.families.value_reach import ValueReach, values_reached
from pinsing.families.zero_set import gradients
from pinsing.kinematics.verdict import ratios
from pinsing.measures import Reachability
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import Nominal

_SEED = 20
_WITNESSES = 32
_LENGTH_TOL = 1e-6
"""Metres by which a family may lie beyond the limit of a prismatic joint and be at it."""
_LOOKS = 0.4, 0.6, 0.8
"""Shares of a family's time by which looks within its limits, a little beyond them, and for a
proof that there is nothing have ended: what is left is for points anywhere."""
_SHARP = 1e-9
"""sigma_r / sigma_1 of a point that has its digits."""
_SAME = 1e-9
_ON_BRANCH = 1e-6
"""Distance in joint space up to which a point is on a branch."""
_INDEPENDENT = 1e-7
"""Singular values of gradients that count, relative to the largest."""


def describe(
    group: Sequence[SolvedPiece],
    maker: PieceMaker,
    arm: Arm,
    geometry: Nominal,
    confirm: OwnPoints | None = None,
) -> Family:
    """The family of some pieces that are mirror images of each other.

    Its points are confirmed and made sharp by ``confirm``, where that is given.
    """
    draft = stated(group, maker, arm)
    if confirm is not None:
        draft = replace(draft, confirm=confirm)
    rng = np.random.default_rng(_SEED)
    if not draft.real:
        if not _drawn(draft, maker, rng):
            return draft
        draft = replace(draft, real=True)
    looks = [maker.time.part(share) for share in _LOOKS]
    inside = draft.points(_WITNESSES, rng, True, maker.rounds(), _until(looks[0]))
    reachability = Reachability.INSIDE if len(inside) else Reachability.UNKNOWN
    if not len(inside):
        tolerance = np.where(arm.prismatic, _LENGTH_TOL, maker.angle_tol)
        wider = replace(draft, limit_tolerance=tolerance)
        inside = wider.points(_WITNESSES, rng, True, maker.rounds(), _until(looks[1]))
        if len(inside):
            draft, reachability = wider, Reachability.AT_LIMIT
            draft = replace(draft, limits_met=_limits_met(draft, inside[0], maker.symbols))
        elif not maker.time.over:
            reachability = _unreachable(wider, _until(looks[2]))
    anywhere = _until(maker.time)
    points = inside
    if not len(inside):
        points = draft.points(_WITNESSES, rng, rounds=maker.rounds(), stop=anywhere)
    if draft.confirm is None and _blunt(draft, points, geometry):
        return describe(group, maker, arm, geometry, OwnPoints(geometry.arm, touching=True))
    return _described(draft, reachability, inside, points, arm, geometry, maker)


def _blunt(draft: Family, points: Array, geometry: Nominal) -> bool:
    """Whether points have half of their digits only, as where an equation touches zero."""
    if not len(points) or not any(b.equations for b in draft.branches):
        return False
    return bool((ratios(geometry.arm, points) > _SHARP).any())


def stated(group: Sequence[SolvedPiece], maker: PieceMaker, arm: Arm) -> Family:
    """The family of some pieces as far as its condition goes: no points, and not what is lost."""
    branches = tuple(b for p in group for b in p.branches)
    solved = group[0].solved
    prismatic = [bool(p) for p in arm.prismatic]
    involved = sorted({j for b in branches for j in b.involved})
    return Family(
        name="",
        text=statement(branches, solved, maker.symbols, prismatic),
        latex=statement(branches, solved, maker.symbols, prismatic, latex=True),
        branches=branches,
        joints=tuple(arm.joints[j] for j in involved),
        codimension=group[0].codimension,
        proof=min((p.proof for p in group), key=["generic points", "algebra"].index),
        real=any(p.real for p in group),
        reachability=Reachability.UNKNOWN,
        witness=None,
        generic=None,
        rank=None,
        lost=(),
        kind="undecided",
        reason="",
        raw_ratio=None,
        lower=np.array(arm.lower),
        upper=np.array(arm.upper),
        prismatic=np.array(arm.prismatic),
        length_scale=arm.length_scale,
        components=tuple(p.component for p in group),
        confirm=maker.confirm,
        solved=solved_for(b.equations for b in branches),
        arm=arm,
    )


def _drawn(draft: Family, maker: PieceMaker, rng: np.random.Generator) -> bool:
    """Whether points are found as ``sample`` finds them, where a shorter look found none.

    What is said of a family must not be less than what its own samples show.
    """
    look = maker.time.part(_LOOKS[0])
    return any(
        len(draft.points(_WITNESSES, rng, within, maker.rounds(), _until(look)))
        for within in (True, False)
    )


def _value_reach(
    family: Family, reachability: Reachability, inside: Array, maker: PieceMaker
) -> tuple[ValueReach, ...]:
    """Which of the values that joints are at lie within the limits."""
    drawn: list[np.random.Generator] = []

    def met(branch: Branch) -> bool:
        if _on(family, branch, inside).any():
            return True
        rng = drawn[0] if drawn else np.random.default_rng(_SEED)
        drawn[:] = [rng]
        alone = replace(family, branches=(branch,), reachability=reachability)
        return bool(len(alone.points(1, rng, True, maker.rounds(), _until(maker.time))))

    limits = family.limits
    return values_reached(family.branches, limits, family.prismatic, reachability, met)


def _limits_met(family: Family, q: Array, symbols: Sequence[str]) -> tuple[str, ...]:
    """Which limits a point lies beyond, within the tolerance, with both numbers."""
    said = []
    for j, value in enumerate(q):
        for limit, beyond in ((family.lower[j], -1.0), (family.upper[j], 1.0)):
            if beyond * (value - limit) > _SAME / 10:
                unit = "m" if family.prismatic[j] else "rad"
                said.append(
                    f"{symbols[j]} = {value:.10g} {unit}, its limit {limit:.10g} {unit}, "
                    f"{abs(value - limit):.1e} {unit} apart"
                )
    return tuple(said)


def _until(time: Budget) -> Stop:
    return time.stop


def _unreachable(family: Family, stop: Stop) -> Reachability:
    """Whether that no point lies within the limits can be proven."""
    lower, upper = family.box(within_limits=True)
    endless = family.prismatic & ~(np.isfinite(family.lower) & np.isfinite(family.upper))
    for branch in family.branches:
        cut = any(endless[list(e.involved)].any() for e in branch.equations)
        if branch.held(family.space, (lower, upper)) and not (
            branch.equations and not cut and proven_empty(branch.equations, lower, upper, stop=stop)
        ):
            return Reachability.UNKNOWN
    return Reachability.OUTSIDE


def _described(
    draft: Family,
    reachability: Reachability,
    inside: Array,
    points: Array,
    arm: Arm,
    geometry: Nominal,
    maker: PieceMaker,
) -> Family:
    if not len(points):
        return replace(draft, reachability=reachability)
    exact = geometry.arm
    branches = draft.branches
    branch = branches[0]
    if len(branches) > 1:
        branch = next((b for b in branches if _on(draft, b, points[:1])[0]), branch)
    strictly = bool(len(inside)) and reachability is Reachability.INSIDE
    generic = readable(draft, branch, points[0], exact, within_limits=strictly)
    loss = loss_at(exact, generic, rtol=1e-8)
    raw = None
    if not geometry.exact:
        raw = float(maker.ratios(points, arm).max())
    kinds = kinds_of(draft, points, exact, maker)
    return replace(
        draft,
        value_reach=_value_reach(draft, reachability, inside, maker),
        at_once=() if (said := at_once(branch, generic, maker.symbols)) is None else (said,),
        codimension=_codimension(branch, generic, draft.codimension),
        reachability=reachability,
        witness=generic if len(inside) else None,
        generic=generic,
        rank=loss.rank,
        lost=(*(str(x) for x in loss.lost), *missing_everywhere(loss)),
        kind=kinds[0].kind if len(kinds) == 1 else "varies",
        kinds=kinds,
        reason="; ".join(str(d) for d in loss.dependences),
        raw_ratio=raw,
    )


def missing_everywhere(loss: Loss | State) -> list[str]:
    """A remark where some of the motions lost at a point are lost at every other as well."""
    if loss.always_missing == 0 or not loss.lost:
        return []
    return [f"{loss.always_missing} of these {len(loss.lost)} is missing at every configuration"]


def _on(family: Family, branch: Branch, points: Array) -> Bool:
    """Which of some points (N, n) of a family are on one of its branches."""
    return near((branch,), family.space, points, _ON_BRANCH, family.confirm)


def _codimension(branch: Branch, q: Array, complex_codimension: int) -> int:
    """Joints fixed plus independent gradients at q; the complex one where gradients vanish.

    A single equation that is left by now changes its sign, or nothing better is known of it:
    its set has the codimension of the complex one.
    """
    if not branch.equations:
        return len(branch.values)
    if len(branch.equations) == 1:
        return complex_codimension
    sizes = np.linalg.svd(gradients(branch.equations, q[None])[0], compute_uv=False)
    independent = int((sizes > _INDEPENDENT * max(float(sizes[0]), 1e-300)).sum())
    return max(complex_codimension, len(branch.values) + independent)
