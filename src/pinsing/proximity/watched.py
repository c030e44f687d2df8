"""The families that distances are taken to, out of one or several closed forms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias
from weakref import WeakKeyDictionary

import numpy as np

from pinsing.algebra.conditions import Conditions, Margin
from pinsing.arguments import columns_of, real_numbers, stands_for
from pinsing.errors import OptionError
from pinsing.families import ClosedForm, Family
from pinsing.families.family import asked_for
from pinsing.families.solve import closed_form
from pinsing.kinematics.verdict import regular_radius
from pinsing.measures import ROUNDING, Array, ArrayLike, Bool
from pinsing.robot.arm import Arm, summarize
from pinsing.robot.chain import chain_differs, placements_of
from pinsing.robot.joint_space import JointSpace, require_values

Forms: TypeAlias = ClosedForm | Sequence[ClosedForm]
"""A closed form; or several of the same arm, such as those of two tasks."""

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
        used = np.zeros((len(self.families), self.n), dtype=bool)
        for i, family in enumerate(self.families):
            used[i, [j for b in family.branches for j in b.involved]] = True
        return used

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
        scaled = np.abs(Q * self.weight)
        if self.norm == "max":
            return np.asarray(scaled.max(axis=-1))
        return np.asarray(np.linalg.norm(scaled, axis=-1))


def watch(
    forms: Forms,
    families: Sequence[str] | None = None,
    weights: ArrayLike | None = None,
    norm: str = "euclidean",
) -> Watched:
    """Choose families of one arm's forms by name or title, by default all that have real points."""
    # ``weights`` (n,) replace 1 for revolute joints and 1 / length scale for prismatic ones.
    plain = isinstance(forms, ClosedForm) and families is None and weights is None
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
        names = tuple(name for name, family in named.items() if family.real)
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


def every_name(forms: Forms) -> list[str] | None:
    """Names of all families, those without a known real point included; None if forms are none."""
    every = each_of(forms)
    if not every or not all(isinstance(form, ClosedForm) for form in every):
        return None  # `watch` says what is wrong
    return list(_named(every))


def require_forms_of(forms: Forms, arm: Arm) -> None:
    """Raise OptionError if forms are of another arm: joints, base, tip or limits differ."""
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


# `clearance` is called often.
stands_for(Arm, ClosedForm, lambda arm: arm.once("closed form", lambda: closed_form(arm)))
