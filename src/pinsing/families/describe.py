"""From pieces of the singular set to families with points, limits, kinds and words.

Configurations that show a family well, and the name that a roboticist gives it: wrist, elbow,
shoulder, decided from the geometry.

Only the full pose is named, and only where the geometry makes each condition below singular. With
C the wrist center:

- six joints whose axes 4, 5, 6 meet in one point C (spherical wrist), or whose axes 2, 3, 4 are
  parallel while axes 5 and 6 meet in C (offset wrist, as of a UR5): *wrist* where axes 4, 5 and 6
  are parallel to one plane, so that axes 4 and 6 line up in all usual wrists;
- if also axes 2 and 3 are parallel and axis 1 is not: *elbow* where C (with an offset wrist, axis
  4) lies in the plane of axes 2 and 3, with the links stretched or folded; *shoulder* where C lies
  in the plane through axis 1 parallel to axis 2, above axis 1 where the arm has no lateral offset.
  A prismatic third joint at right angles to axis 2 has a shoulder, and no elbow;
- seven revolute joints, of which the first three meet in S and the last three in C: *shoulder*
  and *wrist* where the three axes are parallel to one plane, *elbow* where S, C and axis 4 are in
  one plane.

A family has the name of the one condition that holds all over it, else none: two conditions at
once are no name. Legs have no names: their joints are hips, knees and ankles.
"""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from pinsing._types import Array, Bool
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.nearest import two_sided
from pinsing.configuration.at import Loss, State, loss_at
from pinsing.configuration.axis_dependence import generic_axes
from pinsing.configuration.lost_motion import STRUCTURE_TOL, JointAxes
from pinsing.configuration.refine import kinds_many
from pinsing.families.at_once import at_once, solved_for
from pinsing.families.family import Family
from pinsing.families.nearness import near
from pinsing.families.parts import Branch, KindPart, ValueReach, values_reached
from pinsing.families.pieces import PieceMaker, SolvedPiece
from pinsing.families.real_control import OwnPoints
from pinsing.families.statement import statement
from pinsing.families.zero_set import Stop, gradients, project, proven_empty, residuals
from pinsing.kinematics.batch import batch
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.kinematics.verdict import generic_rank, own_shares, ratios
from pinsing.measures import ALIKE, SEED, Reachability
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import Nominal

ORDER = ("wrist", "elbow", "shoulder", "")
"""Names in the order in which people are told of families."""

_LEG = re.compile("hip|knee|ankle|(^|_)leg", re.IGNORECASE)

Holds = Callable[[JointAxes, float], bool]


def title_of(arm: Arm, points: Array) -> str:
    """Return the name of the family that has these points (N, n), all over it; "" if none."""
    conditions = arm.once("named conditions", lambda: _conditions(arm))
    if not conditions or not len(points):
        return ""
    axes = [JointAxes.of(J, arm.prismatic, np.zeros(3)) for J in frame_jacobians(arm, points)]
    found = [name for name, holds in conditions.items() if all(holds(a, ALIKE) for a in axes)]
    return found[0] if len(found) == 1 else ""


def _conditions(arm: Arm) -> Mapping[str, Holds]:
    """The conditions that have a name for an arm; none where its geometry does not warrant it."""
    slides = arm.prismatic
    legs = any(_LEG.search(joint) for joint in arm.joints)
    if arm.task.name != "pose" or arm.coupling is not None or legs or arm.n not in (6, 7):
        return {}
    samples = generic_axes(arm)

    def meet(*ids: int) -> bool:
        return all(a.meeting_point(ids, STRUCTURE_TOL) is not None for a in samples)

    def parallel(*ids: int) -> bool:
        return all(a.parallel(ids, STRUCTURE_TOL) for a in samples)

    if arm.n == 7:
        if slides.any() or not (meet(0, 1, 2) and meet(4, 5, 6)):
            return {}
        return {"wrist": _flat(4, 5, 6), "elbow": _stretched, "shoulder": _flat(0, 1, 2)}
    if slides[3:].any():
        return {}
    spherical, offset = meet(3, 4, 5), not slides[1:].any() and parallel(1, 2, 3)
    found: dict[str, Holds] = {}
    if spherical or (offset and meet(4, 5)):
        found["wrist"] = _flat(3, 4, 5)
    planar = not slides[:2].any() and not parallel(0, 1)
    if slides[2]:
        planar = planar and all(a.perpendicular(1, a.direction[2], STRUCTURE_TOL) for a in samples)
    else:
        planar = planar and parallel(1, 2)
    if planar and spherical:
        found["shoulder"] = _above
        found["" if slides[2] else "elbow"] = _moves_center_one_way
    elif planar and offset:
        found["elbow"] = lambda a, tol: a.in_one_plane((1, 2, 3), tol)
        if meet(4, 5):
            found["shoulder"] = _above
    return found


def _flat(*ids: int) -> Holds:
    """Three axes are parallel to one plane."""
    return lambda a, tol: abs(np.linalg.det(a.direction[list(ids)])) <= tol


def _center(a: JointAxes, *ids: int) -> Array:
    met = a.meeting_point(ids, STRUCTURE_TOL)
    return np.full(3, np.nan) if met is None else met  # parallel there: no condition holds


def _above(a: JointAxes, tol: float) -> bool:
    """Axis 1 does not move the wrist center along axis 2."""
    return abs(float(a.velocity(0, _center(a, 4, 5)) @ a.direction[1])) <= tol * a.size


def _moves_center_one_way(a: JointAxes, tol: float) -> bool:
    """Joints 2 and 3 move the wrist center in one direction only, or not at all."""
    center = _center(a, 4, 5)
    return bool(np.isfinite(center).all()) and a.velocity_rank((1, 2), center, tol) < 2


def _stretched(a: JointAxes, tol: float) -> bool:
    """The centers of shoulder and wrist and axis 4 lie in one plane."""
    centers = _center(a, 0, 1, 2), _center(a, 4, 5, 6)
    return all(np.isfinite(c).all() for c in centers) and a.in_one_plane((3,), tol, *centers)


_APART = 0.12  # radians, about seven degrees


def telling_poses(
    arm: Arm, family: Family, count: int, others: Sequence[Family] = ()
) -> tuple[Array, ...]:
    """Return up to ``count`` configurations that show a family well, the same at every call."""
    # Preferably away from ``others``, above the floor, untwisted, and unlike each other.
    rng = np.random.default_rng(4)
    Q = family.sample(80, rng)
    witness = getattr(family, "witness", None)
    if not len(Q):
        return () if witness is None else (np.array(witness, dtype=float),)
    lower, upper = arm.span
    turns = np.where(arm.prismatic, 0.0, 2 * np.pi * np.round(Q / (2 * np.pi)))
    Q = np.where((Q - turns >= lower) & (Q - turns <= upper), Q - turns, Q)
    apart = _apart(arm, others, Q)
    alone = apart >= min(_APART, float(apart.max()))
    Q, apart = Q[alone], apart[alone]
    share = own_shares(arm, Q)
    # The singular value that should survive at a generic point of the family.
    drop = max(1, int(np.median((share <= 1e-7).sum(axis=1))))
    healthy = share[:, -1 - drop] if share.shape[1] > drop else 1.0
    half_turn = np.where(arm.prismatic | (lower > np.pi) | (upper < -np.pi), np.inf, np.pi)
    lower, upper = np.maximum(lower, -half_turn), np.minimum(upper, half_turn)
    middle, half = (lower + upper) / 2, np.maximum((upper - lower) / 2, 1e-9)
    twisted = np.abs((Q - middle) / half).mean(axis=1)
    score = np.minimum(healthy / 0.1, 1.0) + 2.0 * _above_floor(arm, Q) - 0.8 * twisted
    score += 0.5 * np.minimum(apart / (3 * _APART), 1.0)
    chosen = [int(np.argmax(score))]
    reach = np.where(arm.prismatic, half, np.pi)
    for _ in range(min(count, len(Q)) - 1):
        gap = np.min([np.linalg.norm((Q - Q[c]) / reach, axis=1) for c in chosen], axis=0)
        gap[chosen] = -np.inf
        chosen.append(int(np.argmax(score + 1.2 * np.minimum(gap, 1.0))))
    return tuple(Q[c] for c in chosen)


def _apart(arm: Arm, others: Sequence[Family], Q: Array) -> Array:
    """At least how far other families are from Q (N, n); (N,), radians."""
    if not others:
        return np.full(len(Q), np.inf)
    weight = np.where(arm.prismatic, 1 / arm.length_scale, 1.0)
    conditions = Conditions.of([f.branches for f in others], np.asarray(arm.prismatic), weight)
    return two_sided(conditions, Q).lower


def _above_floor(arm: Arm, Q: Array) -> Array:
    """1 where no joint and no tip is below the base, 0 from a tenth of the height on; (N,)."""
    data, heights = arm.model.createData(), []
    for q in Q:
        pin.framesForwardKinematics(arm.model, data, arm.model_q(q))
        z = [data.oMi[j].translation[2] for j in range(1, arm.model.njoints)]
        heights.append([*z, data.oMf[arm.tip_id].translation[2]])
    spread = float(np.ptp(heights)) or 1.0
    return np.asarray(np.clip(1 + 10 * np.min(heights, axis=1) / spread, 0.0, 1.0))


_SHORT = 60
"""Characters that a condition may have to be named as the place of a kind."""


def kinds_of(family: Family, points: Array, arm: Arm, maker: PieceMaker) -> tuple[KindPart, ...]:
    """Return the kinds of singularity at points (N, n), by branches, or as shares of the points."""
    # Points that are looked into of those where that takes longer, if all kinds agree then.
    kinds = kinds_many(arm, points, 6)
    rest = [i for i, kind in enumerate(kinds) if kind is None]
    if rest and (len(set(kinds)) > 2 or len(family.branches) > 2):  # each branch, or shares: all
        for i, kind in zip(rest, kinds_many(arm, points[rest]), strict=True):
            kinds[i] = kind
    points = points[[kind is not None for kind in kinds]]
    found = [kind for kind in kinds if kind is not None]
    counts = Counter(found)
    total = len(found)
    if len(counts) == 1:
        return (KindPart(found[0], "", 1.0, total),)
    owner = _owners(family, points)
    by_branch = {
        b: Counter(k for k, o in zip(found, owner, strict=True) if o == b)
        for b in dict.fromkeys(owner)
    }
    if len(by_branch) == len(family.branches) and all(len(c) == 1 for c in by_branch.values()):
        places = {
            kind: statement(
                ([family.branches[b] for b, c in by_branch.items() if kind in c]),
                (),
                maker.symbols,
                [bool(p) for p in maker.ring.prismatic],
            )
            for kind in counts
        }
        longest = max(places, key=lambda k: len(places[k]))
        if len(places[longest]) > _SHORT:
            places[longest] = ""  # named by what the others are not
        if all(len(place) <= _SHORT for place in places.values()):
            return tuple(
                KindPart(k, places[k] or "all other points", counts[k] / total, total)
                for k in sorted(places, key=lambda k: places[k] == "")
            )
    return tuple(KindPart(k, "", n / total, total) for k, n in counts.most_common())


def _owners(family: Family, points: Array) -> list[int]:
    """The branch that each point lies on."""
    off = np.empty((len(family.branches), len(points)))
    for i, branch in enumerate(family.branches):
        off[i] = np.linalg.norm(branch.off(points, family.space), axis=-1)
        if branch.equations:
            off[i] += np.abs(residuals(branch.equations, points)).max(axis=-1)
    return [int(i) for i in off.argmin(axis=0)]


def readable(family: Family, branch: Branch, q: Array, arm: Arm, within_limits: bool) -> Array:
    """Return a configuration near q (n,) on a branch, as singular, with round values where free."""
    # Joints in equations are solved for, one an equation. It is q itself if none was found.
    start = _unwound(family, q, within_limits)
    rounded = np.round(start / _grid(family)) * _grid(family)
    # Zero is where other families are.
    rounded = np.where(rounded == 0, np.where(start < 0, -1, 1) * _grid(family), rounded)
    held = [v.joint for v in branch.values]
    rounded[held] = start[held]
    rounded = _decimal(rounded, family)
    rounded[held] = start[held]
    tries = iter([rounded]) if not branch.equations else _solved(branch, rounded)
    for found in tries:
        if not (within_limits and arm.space.unreachable(found).any()) and _alike(arm, found, q):
            return np.asarray(found)
    return q


def _unwound(family: Family, q: Array, within_limits: bool) -> Array:
    """Q (n,) without whole turns, where the limits have room for that."""
    turned = q - 2 * np.pi * np.round(q / (2 * np.pi))
    inside = (turned >= family.lower) & (turned <= family.upper) | (not within_limits)
    return np.where(~family.prismatic & inside, turned, q)


def _grid(family: Family) -> Array:
    """Step (n,) of round values: a power of ten."""
    lower, upper = family.box(within_limits=True)
    span = np.where(upper > lower, np.minimum(upper - lower, 2 * np.pi), 1.0)
    span = np.where(family.prismatic & (upper > lower), upper - lower, span)
    # Round values that the range of a joint has at least.
    return np.asarray(10.0 ** np.floor(np.log10(span / 100)))


def _decimal(values: Array, family: Family) -> Array:
    """The floats nearest to the decimals that are meant."""
    places = -np.log10(_grid(family)).round().astype(int)
    return np.array([round(float(v), int(k)) for v, k in zip(values, places, strict=True)])


def _solved(branch: Branch, start: Array) -> Iterator[Array]:
    """Points of a branch that differ from ``start`` in as few joints as it has equations."""
    joints = sorted({j for e in branch.equations for j in e.involved})
    count = min(len(branch.equations), len(joints))
    slope = np.abs(gradients(branch.equations, start[None])[0]).sum(axis=0)
    order = sorted(joints, key=lambda j: -slope[j])
    for chosen in itertools.islice(itertools.combinations(order, count), 8):
        free = np.zeros(len(start), dtype=bool)
        free[list(chosen)] = True
        moved, ok = project(branch.equations, start[None], free)
        if ok[0]:
            yield np.where(free, moved[0], start)


def _alike(arm: Arm, found: Array, q: Array) -> bool:
    """Return True if two configurations have the same rank, the first one to all digits."""
    sigma = batch(arm, threads=1).sigma(np.stack([found, q]))[:, : generic_rank(arm)]
    ratio = sigma / sigma[:, :1].clip(min=1e-300)
    zeros = ratio <= 1e-8
    return bool((zeros[0] == zeros[1]).all() and (ratio[0][zeros[0]] <= 1e-11).all())


_WITNESSES = 32
_LOOKS = 0.4, 0.6, 0.8
"""Shares of a family's time by which looks within its limits, a little beyond them, and for a
proof that there is nothing have ended: what is left is for points anywhere."""


def describe(
    group: Sequence[SolvedPiece],
    maker: PieceMaker,
    arm: Arm,
    geometry: Nominal,
    confirm: OwnPoints | None = None,
) -> Family:
    """Return the family of mirrored pieces; ``confirm`` makes its points singular and sharp."""
    draft = stated(group, maker, arm)
    if confirm is not None:
        draft = replace(draft, confirm=confirm)
    rng = np.random.default_rng(SEED)
    if not draft.real:
        if not _drawn(draft, maker, rng):
            return draft
        draft = replace(draft, real=True)
    looks = [maker.time.part(share) for share in _LOOKS]
    inside = draft.points(_WITNESSES, rng, True, maker.rounds(), looks[0].stop)
    reachability = Reachability.INSIDE if len(inside) else Reachability.UNKNOWN
    if not len(inside):
        # Metres by which a family may lie beyond the limit of a prismatic joint and be at it.
        tolerance = np.where(arm.prismatic, 1e-6, maker.angle_tol)
        wider = replace(draft, limit_tolerance=tolerance)
        inside = wider.points(_WITNESSES, rng, True, maker.rounds(), looks[1].stop)
        if len(inside):
            draft, reachability = wider, Reachability.AT_LIMIT
            draft = replace(draft, limits_met=_limits_met(draft, inside[0], maker.symbols))
        elif not maker.time.over:
            reachability = _unreachable(wider, looks[2].stop)
    anywhere = maker.time.stop
    points = inside
    if not len(inside):
        points = draft.points(_WITNESSES, rng, rounds=maker.rounds(), stop=anywhere)
    if draft.confirm is None and _blunt(draft, points, geometry):
        return describe(group, maker, arm, geometry, OwnPoints(geometry.arm, touching=True))
    return _described(draft, reachability, inside, points, arm, geometry, maker)


def _blunt(draft: Family, points: Array, geometry: Nominal) -> bool:
    """Return True if points have half of their digits only, as where an equation touches zero."""
    if not len(points) or not any(b.equations for b in draft.branches):
        return False
    # sigma_r / sigma_1 of a point that has its digits.
    return bool((ratios(geometry.arm, points) > 1e-9).any())


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
    """Return True if ``sample`` finds points: no less may be said than samples show."""
    look = maker.time.part(_LOOKS[0])
    return any(
        len(draft.points(_WITNESSES, rng, within, maker.rounds(), look.stop))
        for within in (True, False)
    )


def _value_reach(
    family: Family, reachability: Reachability, inside: Array, maker: PieceMaker
) -> tuple[ValueReach, ...]:
    """Return which of the values that joints are at lie within the limits."""
    drawn: list[np.random.Generator] = []

    def met(branch: Branch) -> bool:
        if _on(family, branch, inside).any():
            return True
        rng = drawn[0] if drawn else np.random.default_rng(SEED)
        drawn[:] = [rng]
        alone = replace(family, branches=(branch,), reachability=reachability)
        return bool(len(alone.points(1, rng, True, maker.rounds(), maker.time.stop)))

    limits = family.limits
    return values_reached(family.branches, limits, family.prismatic, reachability, met)


def _limits_met(family: Family, q: Array, symbols: Sequence[str]) -> tuple[str, ...]:
    """Return which limits a point lies beyond, within the tolerance, with both numbers."""
    said = []
    for j, value in enumerate(q):
        for limit, beyond in ((family.lower[j], -1.0), (family.upper[j], 1.0)):
            if beyond * (value - limit) > 1e-9 / 10:
                unit = "m" if family.prismatic[j] else "rad"
                said.append(
                    f"{symbols[j]} = {value:.10g} {unit}, its limit {limit:.10g} {unit}, "
                    f"{abs(value - limit):.1e} {unit} apart"
                )
    return tuple(said)


def _unreachable(family: Family, stop: Stop) -> Reachability:
    """Return True if it is proven that no point lies within the limits."""
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
        title=title_of(exact, points[::4]),
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
    """Return which of some points (N, n) of a family are on one of its branches."""
    # Distance in joint space up to which a point is on a branch.
    return near((branch,), family.space, points, 1e-6, family.confirm)


def _codimension(branch: Branch, q: Array, complex_codimension: int) -> int:
    """Return joints fixed plus independent gradients at q, or the complex one where these vanish.

    A single equation that is left changes its sign: its set has the complex codimension.
    """
    if not branch.equations:
        return len(branch.values)
    if len(branch.equations) == 1:
        return complex_codimension
    sizes = np.linalg.svd(gradients(branch.equations, q[None])[0], compute_uv=False)
    # Singular values of gradients that count, relative to the largest.
    independent = int((sizes > 1e-7 * max(float(sizes[0]), 1e-300)).sum())
    return max(complex_codimension, len(branch.values) + independent)
