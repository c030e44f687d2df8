"""Clearance: how far configurations are from the nearest singular one, from below and above.

Distances are taken to families of one or several closed forms; how far one configuration is from
each, in numbers and in words. `suggest` finds one that is far from all, such as for a home pose.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar, TypeAlias, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from pinsing.algebra.budget import PER_SECOND, Budget
from pinsing.algebra.conditions import (
    BOXES,
    GAP,
    WORK,
    Bounds,
    Conditions,
    Margin,
    SearchOptions,
    halved,
    nearest_points,
    two_sided,
)
from pinsing.errors import ConfigurationError, OptionError, ResultError
from pinsing.families import Branch, ClosedForm, Family
from pinsing.families.family import asked_for, distance_to, owned
from pinsing.families.solve import closed_form, form_to_measure
from pinsing.interface import (
    MAX_SEED,
    JsonResult,
    checked,
    columns_of,
    real_numbers,
    stands_for,
    typed,
    whole_number,
)
from pinsing.kinematics.jacobian import ratios, regular_radius
from pinsing.measures import ALIKE, NEAR_RTOL, ROUNDING, Array, ArrayLike, Bool, Ints, NDArray
from pinsing.prose import listed
from pinsing.robot.arm import Arm, ArmSummary, JointSpace, require_values, summarize
from pinsing.robot.nominal import chain_differs, placements_of

Forms: TypeAlias = ClosedForm | Sequence[ClosedForm]
"""A closed form; or several of the same arm, such as those of two tasks."""

T = TypeVar("T", bound=Forms)

_MADE: WeakKeyDictionary[ClosedForm, Watched] = WeakKeyDictionary()
"""All families of a closed form, made once."""


def each_of(forms: Forms) -> list[ClosedForm]:
    """Return the forms, one or several."""
    return [forms] if isinstance(forms, ClosedForm) else list(forms)


def titled(family: str, title: str) -> str:
    """Return ``wrist (F2)``, or ``F2``."""
    return f"{title} ({family})" if title else family


@dataclass(frozen=True, eq=False)
class Watched:
    """Families of one arm, and the metric in which distances to them are taken."""

    names: tuple[str, ...]  # after the task where several closed forms were given
    families: tuple[Family, ...]
    joints: tuple[str, ...]
    prismatic: Bool  # (n,)
    lower: Array  # (n,), radians or metres; infinite where continuous
    upper: Array
    weight: Array  # (n,), factors of joint differences
    norm: str  # "euclidean" or "max"
    complete: bool  # no singular configuration lies elsewhere
    arm: Arm | None  # as loaded; None for forms read from a file
    margin: Margin | None = None  # taken off distances to families of the design
    tube: str = ""  # words on the arm where families are of another geometry

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @cached_property
    def space(self) -> JointSpace:
        """Its joints alone."""
        return JointSpace(self.joints, self.prismatic, self.lower, self.upper, 1.0)

    @cached_property
    def conditions(self) -> Conditions:
        """All families as flat arrays."""
        branches = [f.branches for f in self.families]
        made = Conditions.of(branches, self.prismatic, self.weight, self.norm)
        if any(f.also_regular for f in self.families):
            made = replace(made, sure=np.array([not f.also_regular for f in self.families]))
        if self.margin is None:
            return made
        return replace(made, margin=replace(self.margin, own=self.regular))

    @cached_property
    def each(self) -> tuple[Conditions, ...]:
        """The same of each family alone, without a margin."""
        how = self.prismatic, self.weight, self.norm
        return tuple(Conditions.of([f.branches], *how) for f in self.families)

    @cached_property
    def used(self) -> Bool:
        """Which joints each family depends on, (families, n)."""
        involved = [[j for b in family.branches for j in b.involved] for family in self.families]
        used = [np.isin(np.arange(self.n), joints) for joints in involved]
        return np.array(used, dtype=bool).reshape(-1, self.n)

    def regular(self, Q: Array) -> Array:
        """No singular configuration, of a family or not, is nearer to Q (N, n) than this (N,)."""
        if (arm := self.arm) is None:
            return np.zeros(len(Q))
        least = (self.weight * np.where(self.prismatic, arm.length_scale, 1.0)).min()
        norm = math.sqrt(self.n) if self.norm == "max" else 1.0
        return regular_radius(arm, Q) * float(least) / norm * (1 - 1e-9)

    @property
    def nominal(self) -> bool:
        """Whether bounds are of another geometry than the file's, and no tube tells the rest."""
        return bool(self.tube) and self.margin is None

    @property
    def elsewhere(self) -> bool:
        """Whether singular configurations may lie where no family is."""
        return not self.complete or self.margin is not None

    @property
    def limits(self) -> tuple[Array, Array]:
        """Limits (n,) that count; (families, n) where those of families differ."""
        if all(f.limit_tolerance is None for f in self.families):
            return self.lower, self.upper
        both = [f.limits for f in self.families]
        return np.array([low for low, _ in both]), np.array([high for _, high in both])

    def check(self, Q: ArrayLike, name: str = "Q") -> Array:
        """Return joint vectors (..., n), given such or (..., nq); ConfigurationError for others."""
        if self.arm is not None:
            return self.arm.check(Q, name)
        array = real_numbers(columns_of(Q, self.joints, name), name)
        require_values(array, self.joints, name)
        self.space.require_radians(array, name)
        return array

    def known_along(self, Q: Array) -> Bool:
        """Return samples (N,) of a motion Q whose bounds hold on the way to their neighbours."""
        if self.margin is None:
            return np.ones(len(Q), dtype=bool)
        # Between a sample beyond the limits and one within there are others beyond.
        holds = self.margin.holds(Q)
        return np.asarray(holds & np.append(holds[1:], True) & np.append(True, holds[:-1]))

    def require_angle(self, value: float, called: str) -> None:
        """Raise OptionError if a clearance is over half a turn: nothing is so far, it is degrees.

        Not for arms that only slide, or were loaded with ``units="rad"``.
        """
        OptionError.refuse_if(
            value > np.pi and not (self.prismatic.all() or (self.arm and self.arm.units)),
            f"{called} is {value:g} rad, more than half a turn: for {value:g} degrees give "
            f"math.radians({value:g})",
        )

    @property
    def gaps(self) -> list[str]:
        """Sentences where singular configurations may lie beside families, or nothing bounds it."""
        said = "the closed form is not complete: other singular configurations may be met or nearer"
        unknown = "the form was read from a file, without the robot's Jacobian: bounds are lower"
        return [said] * (not self.complete) + [unknown] * (self.elsewhere and self.arm is None)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not known of the arm itself, in sentences."""
        return (*[self.tube] * bool(self.tube), *self.gaps)

    def length(self, Q: Array) -> Array:
        """Length of joint differences Q (..., n) in this metric."""
        return self.conditions.size(Q * self.weight)


def watch(
    forms: Forms,
    families: Sequence[str] | None = None,
    weights: ArrayLike | None = None,
    norm: str = "euclidean",
    real: bool = True,
) -> Watched:
    """Choose families of one arm's forms by name or title, by default all that have real points."""
    # ``weights`` (n,) replace 1 for revolute joints and 1 / length scale for prismatic ones. With
    # ``real`` False those without a known real point count as well.
    plain = isinstance(forms, ClosedForm) and families is None and weights is None and real
    if plain and norm == "euclidean" and (found := _MADE.get(forms)):  # type: ignore[arg-type]
        return found
    every = each_of(forms)
    OptionError.refuse_if(
        not every or not all(isinstance(f, ClosedForm) for f in every),
        "forms must be a ClosedForm, or several of one arm: see closed_form",
    )
    first = every[0]
    OptionError.refuse_if(
        any(f.arm.joints != first.arm.joints for f in every),
        "the closed forms are of arms with different joints",
    )
    named = _named(every)
    if families is None:
        names = tuple(name for name, family in named.items() if family.real or not real)
    else:
        asked = [families] if isinstance(families, str) else families
        names = asked_for(named, asked)
        OptionError.refuse_if(
            named and not names,
            "families is empty, so nothing would be watched: leave it out for all",
        )
    prismatic = np.array(first.arm.prismatic)
    weight = np.where(prismatic, 1 / first.arm.length_scale, 1.0)
    if weights is not None:
        weight = real_numbers(weights, "weights")
        OptionError.refuse_if(
            weight.shape != prismatic.shape,
            f"weights needs {len(prismatic)} numbers, got shape {weight.shape}",
        )
    chosen = Watched(
        names=names,
        families=tuple(named[name] for name in names),
        joints=first.arm.joints,
        prismatic=prismatic,
        lower=np.array(first.arm.lower),
        upper=np.array(first.arm.upper),
        weight=weight,
        norm=norm,
        complete=all(f.complete for f in every),
        arm=next((f.loaded for f in every if f.loaded is not None), None),
        margin=_margin(every, names, weight, np.stack([first.arm.lower, first.arm.upper])),
        tube="; ".join(dict.fromkeys(of for f in every if (of := _geometry(f)))),
    )
    _ = chosen.conditions  # says what is wrong with weights and norm
    if plain and norm == "euclidean":
        _MADE[first] = chosen
    return chosen


def _geometry(form: ClosedForm) -> str:
    """Return which geometry the families are of, where that is not the file's."""
    if form.tube is not None:
        # Which walls persist is told with the families.
        bare = tuple(replace(f, persists=False) for f in form.tube.families)
        return str(replace(form.tube, families=bare))
    moved = form.deviation
    if moved is None or max(moved.angle, moved.length, moved.twist) <= ROUNDING:
        return ""
    return f"The families, and bounds of distances from them, are of {moved}"


def _margin(
    forms: Sequence[ClosedForm], names: Sequence[str], weight: Array, limits: Array
) -> Margin | None:
    tubes = [f.tube for f in forms if f.tube is not None]
    if not tubes:
        return None
    margin, longest = tubes[0].margin, float(weight.max())
    if len(forms) > 1 or len(names) < len(margin.alone):  # which others are near is not known
        widest = max(t.width for t in tubes)
        margin = Margin(np.full(len(names), widest), widest, margin.near)
    if any(t.within_limits for t in tubes):
        margin = replace(margin, limits=limits)
    return margin.times(longest)


def metric_note(length_scale: float) -> str:
    """Return what a distance of an arm with sliding joints is, in a sentence."""
    return (
        f"distances count a slide of {length_scale:g} m (the length scale) as 1 rad, and are "
        "given as angles"
    )


def _named(forms: Sequence[ClosedForm]) -> dict[str, Family]:
    """Families by name, after the task where there are several forms."""
    several = len(forms) > 1
    return {
        (f"{form.arm.task} {family.name}" if several else family.name): family
        for form in forms
        for family in form.families
    }


def forms_of(
    arm: Arm, forms: T | None, find: Callable[[Arm], ClosedForm] = closed_form
) -> T | ClosedForm:
    """Return the forms of an arm, found unless given.

    OptionError if those given are of another arm: joints, base, tip or limits differ.
    """
    if forms is None:
        return find(arm)
    here = summarize(arm)
    for form in each_of(forms):
        if not isinstance(form, ClosedForm):
            continue  # `watch` says what is wrong
        there = form.arm
        for what in ("joints", "prismatic", "base", "tip", "name", "lower", "upper"):
            a, b = getattr(there, what), getattr(here, what)
            same = np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b
            OptionError.refuse_if(
                not same,
                f"the closed form is of another arm: {what} of {there.name!r} and of "
                f"{here.name!r} differ; make one of this arm with closed_form(arm)",
            )
        OptionError.refuse_if(
            form.loaded is not None and chain_differs(arm, placements_of(form.loaded)),
            f"the closed form is of a {there.name!r} with its joints in other places, as by "
            "another calibration; make one of this arm with closed_form(arm)",
        )
    return forms


# `clearance` is called often.
stands_for(Arm, ClosedForm, lambda arm: arm.once("closed form", lambda: closed_form(arm)))


NAMING = SearchOptions(gap=1e-4, boxes=100)
"""Work in the search for the nearest family where bounds do not tell it: half a millisecond."""
CLOSE = 1e-3
"""Radians between the bounds of a clearance that are as good as its value to people."""
STEP = 1e-5
"""Radians or metres: differences over it are right to some 1e-9."""


@dataclass(frozen=True, eq=False)
class Clearance(JsonResult):
    """Distance of configurations (...) from the nearest family.

    Attributes
    ----------
    lower : (...) array
        Proven, rounding included: no configuration of a family is nearer, nor of a robot within a
        tube of its design; of a design alone with ``nominal``. Where the tube is within the joint
        limits, none within them is nearer, and beyond them the Jacobian alone tells
        (``regular_radius``). Radians, or what the weights make of it; infinite where there is no
        family at all, or as far as the Jacobian tells if the closed form is then not complete.
    upper : (...) array
        A configuration of a family, of the design where there is one (``of_design``), is as near
        as this; the nearest singular one of a robot beside its design may be farther. Infinite
        where that was not found out.
    family : (...) array of int
        Index into ``names``: the family that ``lower`` is of, which need not be the nearest (see
        ``nearest``), or with ``certified`` that of the nearest configuration found; -1 for none.
    names : tuple of str
        The families that were looked at.
    certified : bool
        Whether the bounds were brought together by search.
    within_limits : bool
        Whether only configurations within the joint limits counted.
    complete : bool
        Whether the closed form is complete. Otherwise a singular configuration that belongs to
        no family may be nearer than ``lower``.
    notes : tuple of str
        Which geometry the families are of if that is not the file's, and what is not known.
    nominal : bool
        Whether ``lower`` is proven of the nominal design alone: the file's own numbers differ from
        it, and may be singular nearer.
    of_design : bool
        Whether families, and ``upper``, are of a design from which the robot differs.
    bound : callable or None
        ``lower`` at other configurations (N, n); with ``certified`` the distance from the nearest
        ones found. Not written to JSON.
    naming : callable or None
        `nearest_family` of the same families, for ``nearest``. Not written to JSON.
    at : (..., n) array or None
        Where this was computed. Not written to JSON.
    """

    schema: ClassVar[str] = "pinsing/clearance/1"

    lower: Array
    upper: Array
    family: Ints
    names: tuple[str, ...]
    certified: bool
    within_limits: bool
    complete: bool
    notes: tuple[str, ...] = field(default=(), metadata={"optional": True})
    nominal: bool = field(default=False, metadata={"optional": True})
    of_design: bool = field(default=False, metadata={"optional": True})
    bound: Callable[[Array], Array] | None = field(
        default=None, repr=False, metadata={"json": False}
    )
    naming: Callable[[Array], tuple[Ints, Bounds]] | None = field(
        default=None, repr=False, metadata={"json": False}
    )
    at: Array | None = field(default=None, repr=False, metadata={"json": False})

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "bound": None, "naming": None}

    @cached_property
    def gradient(self) -> Array:
        """Gradient (..., n) of ``lower``, by central differences; for barriers and planners.

        With ``certified``, that of the distance from the nearest configuration found, which in
        the norm "max" is another; NaN where none was found.

        Raises
        ------
        ResultError
            If this was read from a file, which has no families, or certified in the norm "max".

        Examples
        --------
        >>> import pinsing
        >>> form = pinsing.closed_form(pinsing.load("stanford"))
        >>> pinsing.clearance(form, [0, 1, 0.3, 1, -0.25, 0]).gradient.round(6) + 0.0
        array([ 0.,  0.,  0.,  0., -1.,  0.])
        """
        if self.bound is None or self.at is None:
            raise ResultError(
                "a clearance from JSON, or certified in the norm 'max', has no gradient: "
                "compute it again, without certify"
            )
        slopes = [
            (self.bound(self.at + step) - self.bound(self.at - step)) / (2 * STEP)
            for step in STEP * np.eye(self.at.shape[-1])
        ]
        return np.stack(slopes, axis=-1)

    @cached_property
    def nearest(self) -> NDArray[np.str_]:
        """Name of the nearest family found (...); empty for none.

        Where the bounds do not tell it, a search through 1000 boxes does. Within limits, and of a
        result read from a file, the name of ``family``.
        """
        family = self.family
        if self.naming is not None and self.at is not None:
            family = self.naming(self.at.reshape(-1, self.at.shape[-1]))[0].reshape(family.shape)
        return np.asarray(np.array([*self.names, ""])[family])

    def __str__(self) -> str:
        said = f" ({'; '.join(self.notes)})" * bool(self.notes)
        if not self.lower.size:
            return f"0 clearances{said}"
        least = int(np.argmin(self.lower))
        lower, upper = float(self.lower.ravel()[least]), float(self.upper.ravel()[least])
        name = str(self.nearest.ravel()[least]) or "no family"
        name += " of the design" * self.of_design
        if self.lower.size > 1:
            return f"{self.lower.size} clearances, the least {lower:.6g} rad from {name}{said}"
        return f"{lower:.6g} to {upper:.6g} rad from {name}{said}"


@checked
def clearance(
    forms: Forms,
    Q: ArrayLike,
    *,
    families: Sequence[str] | None = None,
    certify: bool = False,
    gap: float = GAP,
    boxes: int | None = None,
    within_limits: bool = False,
    weights: ArrayLike | None = None,
    norm: str = "euclidean",
) -> Clearance:
    """Return how far configurations are from the nearest family of singular ones.

    By default two bounds in closed form, from the value and the gradient of each equation and a
    bound of its second derivatives: tight near a family (lower over true distance 0.998 within
    0.3 degrees of a UR5's shoulder singularity), loose far away. They take nanoseconds. With
    ``certify`` boxes are ruled out until the bounds meet: milliseconds.

    Parameters
    ----------
    forms : ClosedForm or sequence of ClosedForm
        Of one arm.
    Q : (..., n) or (..., nq) array_like
        Radians and metres.
    families : sequence of str, optional
        Names of the families that count; by default all that have real points, whatever their
        codimension and wherever the joint limits are.
    certify : bool
        Whether to search until the bounds are within ``gap``.
    gap : float
        With ``certify``: upper less lower bound at which the search ends.
    boxes : int, optional
        With ``certify``: boxes for each configuration, after which the bounds reached so far are
        returned. By default 300,000, and fewer where equations are so long that these would take
        more than some seconds: the bounds of such an arm hold too, and more boxes bring them
        closer together.
    within_limits : bool
        Whether only singular configurations within the joint limits count. Without ``certify``
        that leaves out families that are proven to have none, and ``upper`` is infinite.
    weights, norm
        Metric, as in ``Family.distance``.

    Returns
    -------
    Clearance
        Arrays of shape (...).

    Raises
    ------
    ConfigurationError
        If Q has the wrong shape, or a value that is not finite.
    OptionError, UnknownNameError
        If an option makes no sense, or there is no family of a name.

    Examples
    --------
    >>> import numpy as np, pinsing
    >>> form = pinsing.closed_form(pinsing.load("ur5"))
    >>> round(float(pinsing.clearance(form, [0, -1.2, 0.1, -1, -1.5, 0]).upper), 3)
    0.1
    """
    watched = watch(forms, families, weights, norm)
    array = watched.check(Q)
    flat = array.reshape(-1, watched.n)
    nearest: Array | None = None
    if certify:
        found, nearest = certified(watched, flat, SearchOptions(gap, boxes, within_limits))
    else:
        found = quick(watched, flat, within_limits)
    shape = array.shape[:-1]

    def bound(Q: Array) -> Array:
        flat = Q.reshape(-1, watched.n)
        if nearest is None:
            return quick(watched, flat, within_limits).lower.reshape(shape)
        away = flat - nearest
        away = away if within_limits else watched.space.wrap(away)
        return watched.length(away).reshape(shape)

    return replace(
        found,
        bound=None if certify and norm == "max" else bound,
        naming=None
        if certify or within_limits
        else partial(nearest_family, watched.conditions, work=replace(NAMING, boxes=1000)),
        at=array,
        lower=found.lower.reshape(shape),
        upper=found.upper.reshape(shape),
        family=found.family.reshape(shape),
    )


def quick(watched: Watched, Q: Array, within_limits: bool = False) -> Clearance:
    """Two-sided bounds in closed form at Q (N, n)."""
    if not within_limits:
        found = two_sided(watched.conditions, Q)
        lower, upper, family = found.lower, found.upper, found.family
    else:
        every = two_sided(watched.conditions, Q, each=True).each
        # Near a family that just misses the limits a robot of that design may be singular.
        real = watched.margin is not None
        inside = np.array([real or f.is_reachable is not False for f in watched.families])
        least = np.where(inside, every[..., 0], np.inf)
        lower = least.min(axis=1, initial=np.inf)
        upper = np.full(len(Q), np.inf)
        family = least.argmin(axis=1) if least.shape[1] else np.full(len(Q), -1)
        family = np.where(np.isfinite(lower), family, -1)
    clear = _clearance(watched, Q, lower, upper, family, False, within_limits)
    if within_limits or watched.conditions.sure is None:
        return clear
    said = "some families' equations may be zero at regular configurations too: upper bounds "
    return replace(clear, notes=(*clear.notes, said + "count the others, unless certified"))


def nearest_family(
    conditions: Conditions, Q: Array, work: SearchOptions = NAMING
) -> tuple[Ints, Bounds]:
    """Return the index (N,) of the nearest family found at Q (N, n), -1 for none, and bounds."""
    # Where these leave doubt, a search may lower the upper one.
    bounds = two_sided(conditions, Q, each=True)
    family, upper = bounds.family.copy(), bounds.upper
    # Where several are not known to be farther than a point of the one of the least bound.
    own = np.arange(bounds.each.shape[1]) == family[:, None]
    reached = np.where(own, bounds.each[..., 1], np.inf).min(axis=1, initial=np.inf)
    doubtful = (bounds.each[..., 0] < reached[:, None]).sum(axis=1) > 1
    if doubtful.any():
        all_of_it = np.full(Q.shape[1], np.inf)
        found = nearest_points(conditions, Q[doubtful], -all_of_it, all_of_it, work)
        sure = conditions.sure is None or conditions.sure[found.family]
        upper[doubtful] = np.fmin(upper[doubtful], np.where(sure, found.upper, np.inf))
        family[doubtful] = np.where(found.family < 0, family[doubtful], found.family)
    return family, bounds


def certified(watched: Watched, Q: Array, options: SearchOptions) -> tuple[Clearance, Array]:
    """Bounds brought together by branch and bound at Q (N, n), and the nearest points (N, n)."""
    found = nearest_points(watched.conditions, Q, *watched.limits, options)
    # A search whose boxes end early may know less than the bounds in closed form.
    least = np.maximum(found.lower, two_sided(watched.conditions, Q).lower)
    upper, family, points = found.upper, found.family, found.q
    for i in np.flatnonzero(family >= 0):
        if not owned(watched.families[family[i]], points[i : i + 1])[0]:
            each = zip(watched.families, watched.each, strict=True)
            known = [distance_to(f, Q[i], conditions, options) for f, conditions in each]
            k = int(np.argmin([d.upper for d in known]))
            upper[i], points[i] = known[k].upper, known[k].q
            family[i] = k if np.isfinite(upper[i]) else -1
    bounds = np.minimum(least, upper), upper, family
    return _clearance(watched, Q, *bounds, True, options.within_limits), points


def _clearance(
    watched: Watched,
    Q: Array,
    lower: Array,
    upper: Array,
    family: Ints,
    search: bool,
    limited: bool,
) -> Clearance:
    if watched.elsewhere and (none := np.isinf(lower)).any():
        lower = lower.copy()
        lower[none] = watched.regular(Q[none])
    return Clearance(
        lower=lower,
        upper=upper,
        family=family.astype(np.int64),
        names=watched.names,
        certified=search,
        within_limits=limited,
        complete=watched.complete,
        notes=watched.notes,
        nominal=watched.nominal,
        of_design=bool(watched.tube),
    )


@checked
def is_clear(
    forms: Forms,
    q: ArrayLike,
    radius: float,
    *,
    families: Sequence[str] | None = None,
    within_limits: bool = False,
    weights: ArrayLike | None = None,
    norm: str = "euclidean",
) -> bool:
    """Return True if it is proven that no family has a point within ``radius`` of q (n,).

    The quick bounds decide where they can, a search where they cannot. False is the answer as
    well where the search ran out of boxes. Where the closed form is not complete, and no
    ``families`` are named, the Jacobian alone decides (``regular_radius``).
    Where a tube holds within the joint limits, singular configurations within them count. Where
    the file's numbers differ from the nominal design (`ClosedForm.deviation`) and no tube
    is proven, True is said of the design alone, as `Clearance.nominal` tells.

    Parameters
    ----------
    forms, families, within_limits, weights, norm
        As in ``clearance``.
    q : (n,) or (nq,) array_like
        Radians and metres.
    radius : float
        Not negative.

    Returns
    -------
    bool
        True only if it is proven.

    Raises
    ------
    ConfigurationError, OptionError, UnknownNameError
        As in ``clearance``.

    Examples
    --------
    >>> import pinsing
    >>> form = pinsing.closed_form(pinsing.load("stanford"))
    >>> pinsing.is_clear(form, [0, 1, 0.3, 1, 1, 0], 0.1)
    True
    """
    OptionError.refuse_if(not radius >= 0, f"radius must not be negative, got {radius!r}")
    watched = watch(forms, families, weights, norm)
    array = watched.check(q)
    OptionError.refuse_if(
        array.ndim != 1, f"is_clear takes one configuration, got shape {array.shape}"
    )
    if families is None and not watched.complete:
        return bool(watched.regular(array[None])[0] > radius)
    fast = quick(watched, array[None], within_limits)
    if fast.lower[0] > radius:
        return True
    if fast.upper[0] <= radius:
        return False
    options = SearchOptions(gap=max(1e-9, 1e-6 * radius), within_limits=within_limits)
    return bool(certified(watched, array[None], options)[0].lower[0] > radius)


@dataclass(frozen=True, eq=False)
class FamilyDistance:
    """Distance to one family."""

    family: str
    lower: float  # proven: none is nearer; radians, or metres over the length scale
    upper: float  # how far ``q`` is, on the family: of the design where there is one
    q: Array  # (n,), the nearest that was found
    reachability: str  # words: with which joint values it has points within the limits
    title: str = field(default="", metadata={"optional": True})
    # its condition with the values of joints at ``q``
    where: str = field(default="", metadata={"optional": True})


@dataclass(frozen=True, eq=False)
class Distances(JsonResult):
    """Distances from one configuration, nearest first.

    Attributes
    ----------
    q : (n,) array
        Radians and metres.
    families : tuple of FamilyDistance
        All that have real points; revolute differences are wrapped, limits not considered.
    complete : bool
        Whether the closed form is complete: else a singular configuration may be nearer.
    notes : tuple of str
        As of a Clearance.
    """

    schema: ClassVar[str] = "pinsing/distances/1"

    q: Array
    families: tuple[FamilyDistance, ...]
    complete: bool
    notes: tuple[str, ...] = field(default=(), metadata={"optional": True})


def distances(forms: Forms, q: ArrayLike, *, boxes: int | None = None) -> Distances:
    """Return certified distances from q (n,) to each family, nearest first."""
    # ``boxes`` is how many the search may look at for each.
    watched = watch(forms)
    x = watched.check(q)
    OptionError.refuse_if(x.ndim != 1, f"distances takes one configuration, got shape {x.shape}")
    found = []
    for name, family in zip(watched.names, watched.families, strict=True):
        d = family.distance(x, boxes=boxes)
        where = family.where(d.q) if math.isfinite(d.upper) else ""
        said = family.reach, family.title, where
        found.append(FamilyDistance(name, d.lower, d.upper, d.q, *said))
    if (margin := watched.conditions.margin) is not None:
        both = np.array([[(d.lower, d.upper) for d in found]])
        least = margin.take_off(x[None], both)[0].tolist()
        found = [replace(d, lower=low) for d, low in zip(found, least, strict=True)]
    found.sort(key=lambda d: (d.upper, d.lower))
    return Distances(x, tuple(found), watched.complete, watched.notes)


def distance_words(found: Distances, degrees: bool, space: JointSpace) -> list[str]:
    """One line a family: how far, how sure, which joints have to move, and past which limits."""
    lines, prismatic, names = [], space.prismatic, space.names
    for d in found.families:
        if not math.isfinite(d.upper):
            lines.append(
                f"{d.family}: at least {_length(d.lower, False, degrees)}, no configuration found"
            )
            continue
        moved = np.flatnonzero(np.abs(d.q - found.q) > 1e-9)
        slides, turns = bool(prismatic[moved].any()), not prismatic[moved].all()
        unit = 1.0 if turns else space.length_scale
        far = _length(unit * d.upper, slides, degrees)
        if d.upper - d.lower > 2 * GAP:
            far = f"{_length(unit * d.lower, slides, degrees)} to {far}"
        if slides:
            far += " (rad, and metres over the length scale)" if turns else " m"
        moves = [
            f"{names[j]} {step_text(float(d.q[j] - found.q[j]), degrees, bool(prismatic[j]))}"
            for j in moved
        ]
        way = f"by {', '.join(moves)}" if moves else "on it"
        beyond = [names[j] for j in moved if space.unreachable(d.q)[j]]
        way += f", outside the limits of {listed(beyond)}" if beyond else ""
        reach = re.sub(r"\bq(\d+)\b", lambda s: names[int(s[1]) - 1], d.reachability)
        lines.append(f"{d.family}: {far}, {way}; the family is {reach}")
    return lines


def _length(x: float, slides: bool, degrees: bool) -> str:
    if slides or not degrees:
        return f"{x:.4g}{'' if slides else ' rad'}"
    return f"{math.degrees(x):.4g}° ({x:.4g} rad)" if x else "0°"


def step_text(x: float, degrees: bool, slides: bool, sign: str = "+") -> str:
    """How far a joint moves, with its unit."""
    if slides:
        return f"{x:{sign}.4g} m"
    return f"{math.degrees(x):{sign}.4g}°" if degrees else f"{x:{sign}.4g} rad"


_CLIMBERS = 48
_STEPS = 25
_TRIED = 4
_BATCH = 256


@dataclass(frozen=True, eq=False)
class Room:
    """The configurations to choose from: a box and a ball, in weighted coordinates."""

    low: Array  # (n,), equal to ``high`` for joints that do not matter
    high: Array
    center: Array  # (n,), preferred where nothing else decides
    around: Array  # (n,), centre of the ball
    reach: float  # its radius; infinite without one

    def fit(self, X: Array) -> Array:
        """Move points X (N, n) into the box and the ball."""
        X = np.clip(X, self.low, self.high)
        if not np.isfinite(self.reach):
            return X
        far = np.linalg.norm(X - self.around, axis=1)
        left = self.reach - float(np.linalg.norm(self.center - self.around))
        size = np.maximum(np.linalg.norm(X - self.center, axis=1), 1e-300)
        share = np.where(far <= self.reach, 1.0, np.minimum(1.0, max(left, 0.0) / size))
        return np.asarray(self.center + share[:, None] * (X - self.center))


class Sites:
    """Points of the families, each with the joints that make it one: the others are free."""

    def __init__(self, watched: Watched, rng: np.random.Generator) -> None:
        self.watched = watched
        turn = watched.conditions.turn
        self.turn = np.where(turn > 0, turn, np.inf)
        self._groups: dict[tuple[int, tuple[int, ...]], Array] = {}
        for number, family in enumerate(watched.families):
            for branch in family.branches:
                count = 96 if branch.equations else 1
                found = replace(family, branches=(branch,)).points(count, rng)
                self._take(number, branch, found * watched.weight)

    def _take(self, family: int, branch: Branch, X: Array) -> None:
        joints = branch.involved
        old = self._groups.get((family, joints), np.zeros((0, len(joints))))
        self._groups[family, joints] = np.concatenate([old, self._folded(X)[:, list(joints)]])

    def add(self, X: Array, families: Ints) -> None:
        """Take points X (N, n) of families (N,), known by their number; -1 is none."""
        for x, number in zip(X, families, strict=True):
            if number >= 0:
                family = self.watched.families[int(number)]
                q = x / self.watched.weight
                parts = [replace(family, branches=(b,)) for b in family.branches]
                on = [p.branches[0] for p in parts if p.contains(q, 1e-9).item()]
                if on:
                    self._take(int(number), min(on, key=lambda b: len(b.involved)), x[None])

    def each(self, X: Array, half: Array | float = 0.0) -> Array:
        """No point of boxes around X (N, n), ``half`` (N, n) to each side, is farther: (N, F)."""
        X, half = self._folded(X), np.broadcast_to(half, X.shape)
        out = np.full((len(X), len(self.watched.families)), np.inf)
        for (family, joints), points in self._groups.items():
            total = np.zeros((len(X), len(points)))
            for k, j in enumerate(joints):
                off = np.abs(X[:, j, None] - points[:, k])
                off = np.minimum(off, self.turn[j] - off) + half[:, j, None]
                total += np.minimum(off, self.turn[j] / 2) ** 2
            out[:, family] = np.minimum(out[:, family], np.sqrt(total.min(axis=1, initial=np.inf)))
        return out

    def within(self, X: Array, half: Array | float = 0.0) -> Array:
        """The same of the nearest family: (N,)."""
        return np.asarray(self.each(X, half).min(axis=1))

    def _folded(self, X: Array) -> Array:
        """Values (N, n) of turning joints within half a turn of zero."""
        turns = np.round(X / self.turn)
        return np.asarray(X - np.where(turns == 0, 0.0, self.turn) * turns)


class RoomSearch:
    """Searches a room for a point with a large clearance, and for the most there can be.

    ``budget`` is for boxes. Where families of ``arm`` are missing, no singular configuration is
    chosen. ``best`` (n,) is the clearest point so far, weighted, ``lower`` bounds its clearance,
    and ``most`` that of all points.
    """

    def __init__(
        self, arm: Arm, watched: Watched, room: Room, rng: np.random.Generator, budget: Budget
    ) -> None:
        self.arm, self.watched, self.room, self.rng = arm, watched, room, rng
        self.budget = budget
        self.sites = Sites(watched, rng)
        self.best, self.lower, self.most = room.center, -np.inf, np.inf
        self.prove(room.center[None])
        self.climb()
        self.split()
        self.settle()

    def prove(self, X: Array) -> Array:
        """Lower bounds (N,) of the clearance at X, and sites where the nearest points are."""
        w = self.watched
        box = w.conditions.box
        boxes = min(BOXES, self.budget.left * PER_SECOND / (box * len(X)))
        options = SearchOptions(CLOSE, max(1, int(boxes)))
        found = nearest_points(w.conditions, X / w.weight, w.lower, w.upper, options)
        self.budget.spend(box * float(found.boxes.sum()))
        self.sites.add(found.q * w.weight, found.family)
        regular = w.complete or ratios(self.arm, X / w.weight) > NEAR_RTOL
        lower = np.where(regular, found.lower, -np.inf)
        k = int(np.argmax(lower))
        if lower[k] > self.lower:
            self.best, self.lower = X[k].copy(), float(lower[k])
        return lower

    def climb(self) -> None:
        """From many starts uphill on what the sites promise, proving the best."""
        room = self.room
        X = room.fit(self.rng.uniform(room.low, room.high, (4096, self.watched.n)))
        promise = np.concatenate([self.sites.within(x) for x in np.array_split(X, 16)])
        X = X[np.argsort(-promise, kind="stable")[:_CLIMBERS]]
        for round_ in range(12):
            sizes = (0.3 * 0.8**round_ * 0.85**step for step in range(_STEPS))
            promise = self._uphill(X, self.sites.within, sizes)
            order = np.argsort(-promise, kind="stable")
            if self.budget.over or promise[order[0]] <= self.lower + CLOSE:
                return
            chosen: list[int] = []  # not all in one place
            for i in order.tolist():
                if len(chosen) < _TRIED and (np.linalg.norm(X[i] - X[chosen], axis=1) > 0.1).all():
                    chosen.append(i)
            self.prove(X[chosen])

    def _uphill(
        self, X: Array, worth: Callable[[Array], Array], sizes: Iterable[float], some: bool = False
    ) -> Array:
        """Move points X by random steps, shares of the room, to where they are worth more: (N,)."""
        width, value = self.room.high - self.room.low, worth(X)
        for size in sizes:
            moved = self.rng.integers(2, size=X.shape) if some else 1  # some joints at a time
            tried = self.room.fit(X + moved * self.rng.normal(size=X.shape) * width * size)
            there = worth(tried)
            better = there > value
            X[better], value[better] = tried[better], there[better]
        return value

    def split(self) -> None:
        """Rule boxes out that promise no more than was proven; what is left bounds all."""
        room = self.room
        boxes = np.stack([room.low + room.high, room.high - room.low])[:, None] / 2
        bounds = self._promise(*boxes)
        for _ in range(40):
            keep = bounds > max(self.lower, 0.0) + CLOSE
            boxes, bounds = boxes[:, keep], bounds[keep]
            if not len(bounds) or self.budget.over:
                break
            order = np.argsort(-bounds, kind="stable")
            now, later = order[:_BATCH], order[_BATCH:]
            self.prove(room.fit(boxes[0, now[:2]]))
            parts = np.stack(halved(boxes[0, now], boxes[1, now], boxes[1, now].argmax(axis=1)))
            fresh = np.minimum(self._promise(*parts), np.tile(bounds[now], 2))
            boxes = np.concatenate([boxes[:, later], parts], axis=1)
            bounds = np.concatenate([bounds[later], fresh])
        goal = max(self.lower, 0.0) + CLOSE
        self.most = max(goal, float(bounds.max(initial=0.0))) + ALIKE

    def _promise(self, centers: Array, halves: Array) -> Array:
        out = self.sites.within(centers, halves * (1 + 1e-12))
        gap = np.maximum(np.abs(centers - self.room.around) - halves, 0.0)
        beyond = np.linalg.norm(gap, axis=1) > self.room.reach + ALIKE
        return np.where(beyond, -np.inf, out)

    def settle(self) -> None:
        """Farther from the other families too, and to where joints are preferred, at no cost."""
        enough = self.lower - CLOSE

        def worth(X: Array) -> Array:
            each = self.sites.each(X)
            off = np.linalg.norm(X - self.room.center, axis=1)
            # Of clearance that is given for being nearer to where joints are preferred.
            return np.where(each.min(axis=1) >= enough, each.sum(axis=1) - 0.05 * off, -np.inf)

        if np.isfinite(enough) and not self.budget.over:
            X = np.repeat(self.best[None], _CLIMBERS, axis=0)
            sizes = (0.5 * 0.93**step for step in range(3 * _STEPS))
            value = self._uphill(X, worth, sizes, some=True)
            tried = X[np.argsort(-value, kind="stable")[:_TRIED]]
            good = self.prove(tried) >= enough
            self.best = tried[good.argmax()] if good.any() else self.best


REACH = 0.5
"""How far from a given configuration one is suggested, radians."""


@dataclass(frozen=True, eq=False)
class Suggestion(JsonResult):
    """A configuration with a large clearance.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    q : (n,) array
        The configuration, radians and metres, within the joint limits.
    lower : float
        Proven, rounding included: no configuration of a family is nearer to ``q``. Radians, or
        metres over the length scale; infinite where there is no singular configuration at all.
    upper : float
        A configuration of a family is as near as this.
    most : float
        No configuration that was to choose from has a larger clearance; infinite where that was
        not found out.
    family : str
        The nearest family; empty for none.
    title : str
        "wrist", "elbow", "shoulder", or empty: as of the nearest family.
    families : tuple of str
        Those that were kept away from.
    sigma_ratio : float
        sigma_r / sigma_1 at ``q``: 1 is the best conditioned that there is.
    near : (n,) array or None
        The configuration that it was to be near.
    reach : float
        Within how far of ``near``; infinite without it.
    complete : bool
        Whether the families are all that there is. Otherwise ``lower`` is of those known.
    notes : tuple of str
        What was assumed, and what one should know.
    """

    schema: ClassVar[str] = "pinsing/suggestion/1"
    made_by: ClassVar[str] = "pinsing.suggest(arm)"

    arm: ArmSummary
    q: Array
    lower: float
    upper: float
    most: float
    family: str
    families: tuple[str, ...]
    sigma_ratio: float
    near: Array | None
    reach: float
    complete: bool
    notes: tuple[str, ...]
    title: str = field(default="", metadata={"optional": True})

    @checked
    def text(self, degrees: bool = False) -> str:
        """Return the answer in lines of text: the configuration to paste, and its proven clearance.

        Parameters
        ----------
        degrees : bool
            Angles in degrees.

        Examples
        --------
        >>> import pinsing
        >>> print(pinsing.suggest(pinsing.load("scara")).text(degrees=True).splitlines()[0])
        --deg --q 0,90,0.105,0
        """
        lines = [typed(self.q, self.arm.prismatic, degrees, digits=8)]
        if math.isinf(self.lower):
            lines.append("No configuration of this arm is singular.")
        elif not self.families:
            lines.append("Clearance unknown: no family of singular configurations is known.")
        else:
            lines.append(
                f"Proven: no singular configuration {'' if self.complete else 'that is known '}"
                f"within {_far(self.lower, degrees, math.floor)}; one was found at "
                f"{_far(self.upper, degrees, math.ceil)}, on {titled(self.family, self.title)}."
            )
        if math.isfinite(self.most):
            where = "Nowhere within the limits"
            if self.near is not None:
                reach = _far(self.reach, degrees, round)
                where = f"Nowhere within {reach} of the given configuration"
            most = _far(self.most, degrees, math.ceil)
            lines.append(f"{where} is the clearance above {most}.")
        lines.append(f"sigma_r/sigma_1 there: {self.sigma_ratio:.3g}")
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])


def _far(x: float, degrees: bool, to: Callable[[float], float]) -> str:
    """A distance with four places, rounded to the side that keeps it true."""
    if math.isinf(x):
        return "any distance"
    return f"{to(math.degrees(x) * 100) / 100:g}°" if degrees else f"{to(x * 1e4) / 1e4:g} rad"


@checked
def suggest(
    arm: Arm,
    *,
    near: ArrayLike | None = None,
    reach: float = REACH,
    forms: Forms | None = None,
    families: Sequence[str] | None = None,
    work: float = WORK,
    seed: int = 0,
) -> Suggestion:
    """Suggest a configuration within the joint limits that is far from all singular ones.

    Clearance is that of `clearance`: singular configurations beyond the limits count too, since
    an arm is slow and weak beside them all the same. Joints that no family depends on stay at
    zero, or in the middle of their limits, or as in ``near``.

    Parameters
    ----------
    arm : Arm
        A serial arm.
    near : (n,) or (nq,) array_like, optional
        A configuration that the answer should be near, radians and metres.
    reach : float
        With ``near``: the answer is no farther from it than this, radians (metres over the
        length scale), in the Euclidean norm and without whole turns.
    forms : ClosedForm or sequence of ClosedForm, optional
        Of the arm, such as those of two tasks; computed if not given.
    families : sequence of str, optional
        Names of the families that count; by default all that have real points.
    work : float
        Work after which the search ends, the same on every machine: in seconds of an idle one.
    seed : int
        Of the starts of the search.

    Returns
    -------
    Suggestion
        The configuration, its proven clearance, and a bound of what is possible.

    Raises
    ------
    ConfigurationError
        If ``near`` has the wrong length or a value that is not finite, or nothing within the
        limits is within ``reach`` of it.
    OptionError, UnknownNameError
        If an option makes no sense, forms are of another arm, or there is no family of a name.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.suggest(pinsing.load("puma560"))
    >>> found.lower > 1.4, found.lower <= found.upper <= found.most
    (True, True)
    """
    OptionError.refuse_if(
        not (math.isfinite(reach) and reach > 0), f"reach must be a positive number, got {reach!r}"
    )
    OptionError.refuse_if(not work > 0, f"work must be positive, got {work!r}")
    whole_number(seed, "seed", 0, MAX_SEED)
    target = None if near is None else arm.check_one(near, "near")
    watched = watch(forms_of(arm, forms, form_to_measure), families)
    notes: list[str] = []
    room = _room(arm, watched, target, reach, notes)
    rng = np.random.default_rng(seed)
    most, lower, upper, family = np.inf, np.inf, np.inf, ""
    if watched.families:
        budget = Budget(math.inf, work)
        search = RoomSearch(arm, watched, room, rng, budget)
        if budget.over:
            notes.append(f"the search ended after {budget.allowed}")
        q = _rounded(arm, watched, room, search.best / watched.weight)
        at = certified(watched, q[None], SearchOptions())[0]
        lower, upper, family = float(at.lower[0]), float(at.upper[0]), str(at.nearest[0])
        # Whether the box that was looked through holds all configurations, whole turns aside.
        endless = arm.prismatic & ~(np.isfinite(arm.lower) & np.isfinite(arm.upper))
        if not (endless & (watched.used.any(axis=0) | (not watched.complete))).any():
            most = max(search.most, upper) + (0.0 if near is None else _spare(arm, reach))
        if target is not None:  # the clearance changes by no more than one moves
            there = certified(watched, target[None], SearchOptions(gap=1e-3))[0]
            most = max(min(most, float(there.upper[0]) + reach), upper)
    elif watched.complete:
        q = _rounded(arm, watched, room, room.center / watched.weight)
    else:
        drawn = room.fit(rng.uniform(room.low, room.high, (2048, arm.n))) / watched.weight
        q = _rounded(arm, watched, room, drawn[int(np.argmax(ratios(arm, drawn)))])
        lower = 0.0
    return Suggestion(
        arm=summarize(arm),
        q=q,
        lower=lower,
        upper=upper,
        most=most,
        family=family,
        families=watched.names,
        sigma_ratio=float(ratios(arm, q[None])[0]),
        near=target,
        reach=float(reach) if target is not None else np.inf,
        complete=watched.complete,
        notes=(*notes, *watched.gaps),
        title=dict(zip(watched.names, (f.title for f in watched.families), strict=True)).get(
            family, ""
        ),
    )


def _room(arm: Arm, watched: Watched, near: Array | None, reach: float, notes: list[str]) -> Room:
    low, high = (limit.copy() for limit in arm.space.span)
    if near is None:
        # One turn is enough, about zero where that is within the limits.
        whole = ~arm.prismatic & (high - low >= 2 * np.pi)
        center = np.where(whole, np.clip(0.0, low + np.pi, high - np.pi), (low + high) / 2)
        low, high = np.where(whole, center - np.pi, low), np.where(whole, center + np.pi, high)
        around, radius = center, np.inf
    else:
        around, radius = arm.fold(near), reach - _spare(arm, reach)
        size = reach / watched.weight
        low = np.maximum(np.where(np.isfinite(arm.lower), arm.lower, -np.inf), around - size)
        high = np.minimum(np.where(np.isfinite(arm.upper), arm.upper, np.inf), around + size)
        center = np.clip(around, arm.lower, arm.upper)
        away = float(watched.length(center - around))
        if away > reach:
            j = int(np.argmax(np.abs(center - around)))
            raise ConfigurationError(
                f"near is {away:.4g} outside the joint limits ({arm.joints[j]!r} most), farther "
                f"than reach {reach:g}: nothing within the limits is that near",
                joint=arm.joints[j],
                value=float(around[j]),
                limits=(float(arm.lower[j]), float(arm.upper[j])),
            )
        if away > 0:
            notes.append("the given configuration is outside the joint limits")
        if not np.array_equal(around, near):
            notes.append("whole turns were taken off the given configuration, into the limits")
    still = watched.complete & ~watched.used.any(axis=0)
    low, high = np.where(still, center, low), np.where(still, center, high)
    w = watched.weight
    return Room(low * w, high * w, center * w, around * w, radius)


def _spare(arm: Arm, reach: float) -> float:
    """Return what is left free in the ball, so that a rounded configuration is in it as well."""
    return min(1e-4 * math.sqrt(arm.n), reach / 10)


def _rounded(arm: Arm, watched: Watched, room: Room, q: Array) -> Array:
    """The configuration with few digits, where these stay within the limits and the ball."""
    short = np.where(arm.prismatic, np.round(q, 4), np.radians(np.round(np.degrees(q), 2))) + 0.0
    inside = (short >= arm.lower) & (short <= arm.upper)
    short = np.where(inside, short, np.clip(q, arm.lower, arm.upper))
    away = float(np.linalg.norm(short * watched.weight - room.around))
    return short if away <= room.reach + _spare(arm, room.reach) else q
