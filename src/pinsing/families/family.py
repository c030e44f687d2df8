"""A family of singular configurations: its equations, and what is known of it; kinds on its parts.

Which configurations belong to a family: tests, distances, samples.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from pinsing.algebra.components import Component
from pinsing.algebra.conditions import GAP, Branch, Conditions, SearchOptions, nearest_points
from pinsing.algebra.equation import Equation, angles_text, format_angle, symbol_text
from pinsing.errors import ConfigurationError, OptionError, ResultError, UnknownNameError
from pinsing.families.at_once import LONG, AtOnce, SolvedFor, long_form, long_ones
from pinsing.families.zero_set import (
    ROUNDS,
    Distance,
    OwnPoints,
    SearchBox,
    Stop,
    near,
    own_drawn,
    own_nearest,
    search,
)
from pinsing.interface import JsonResult, checked, columns_of, real_numbers, whole_number
from pinsing.measures import ROUNDING, Array, ArrayLike, Bool, Reachability
from pinsing.notebook import formula, legend, marked, name, table
from pinsing.prose import html_text as text, listed
from pinsing.robot.arm import Arm, JointSpace, require_values


@dataclass(frozen=True)
class KindPart:
    """Boundary or interior on a part of a family.

    Attributes
    ----------
    kind : str
        "boundary", "interior" or "undecided".
    where : str
        The condition of the part; empty if it is all of the family, or just a share of it.
    share : float
        Of the points that were looked at.
    points : int
        How many were looked at in all.
    """

    kind: str
    where: str
    share: float
    points: int

    def __str__(self) -> str:
        if self.where:
            return f"{self.kind} at {self.where}"
        count = round(self.share * self.points)
        return self.kind if count == self.points else f"{self.kind} at {count} of {self.points}"


@dataclass(frozen=True)
class ValueReach:
    """One value of one joint that a family fixes, and whether the limits allow it.

    Attributes
    ----------
    joint : int
        Index of the joint.
    value : float
        Radians in (-pi, pi], or metres.
    reachability : Reachability
        As of a family, of its configurations with this value.
    """

    joint: int
    value: float
    reachability: Reachability


_BEST_FIRST = (
    Reachability.INSIDE, Reachability.AT_LIMIT, Reachability.UNKNOWN, Reachability.OUTSIDE
)  # fmt: skip


def values_reached(family: Family, met: Callable[[Branch], bool]) -> tuple[ValueReach, ...]:
    """Return each value at which branches fix a joint, and whether the limits allow it."""
    # ``met`` tells if a configuration within the limits was found on such a branch.
    known: dict[tuple[int, float], tuple[float, Reachability]] = {}
    reached, space, box = family.reachability, family.space, family.box(within_limits=True)
    settled = reached in (Reachability.OUTSIDE, Reachability.UNKNOWN)
    for branch in family.branches:
        fits = [settled or bool(Branch((v,), ()).held(space, box)) for v in branch.values]
        here: Reachability = reached
        # A branch is where all its values are, so one that is outside takes it all there.
        if not all(fits):
            here = Reachability.OUTSIDE
        elif fits and not settled and branch.equations and not met(branch):
            here = Reachability.UNKNOWN
        for v, within in zip(branch.values, fits, strict=True):
            key = v.joint, round(v.value, 9)
            _, before = known.get(key, (0.0, here))
            best = min(before, here, key=_BEST_FIRST.index)
            known[key] = v.value, best if within else Reachability.OUTSIDE
    return tuple(ValueReach(joint, *known[joint, value]) for joint, value in sorted(known))


def reach_words(reached: Reachability, values: Sequence[ValueReach], prismatic: Bool) -> str:
    """Return "within the joint limits", perhaps "with q2 = 0° (not 180°)", and the like."""
    if reached not in (Reachability.INSIDE, Reachability.AT_LIMIT):
        return reached.words
    parts = []
    for joint in sorted({v.joint for v in values}):
        slides, by_known = bool(prismatic[joint]), dict[bool | None, list[str]]()
        for v in sorted(values, key=lambda v: (abs(v.value), v.value)):
            if v.joint == joint:
                size = f"{v.value:.6g} m" if v.value else "0"
                said = size if slides else format_angle(v.value)
                by_known.setdefault(v.reachability.known, []).append(said)
        good, never, other = (" or ".join(by_known.get(x, [])) for x in (True, False, None))
        if good and (never or other):
            less = [f"not {never}"] * bool(never) + [f"none found with {other}"] * bool(other)
            parts.append(f"{'d' if slides else 'q'}{joint + 1} = {good} ({', '.join(less)})")
    return reached.words + (f" with {' and '.join(parts)}" if parts else "")


def spread(
    held: Sequence[tuple[Branch, SearchBox]],
    n: int,
    count: int,
    rng: np.random.Generator,
    rounds: int,
    stop: Stop | None = None,
    own: OwnPoints | None = None,
) -> Array:
    """Return up to ``count`` ``own`` points (k, n), about as many of each branch in its box."""
    alive = [held[i] for i in rng.permutation(len(held))]
    parts = [np.zeros((0, n))]
    missing = count
    for _ in range(4):  # what one branch lacks, the others give in the next pass
        share = np.full(len(alive), missing // max(1, len(alive)))
        share[: missing - share.sum()] += 1
        for (branch, box), some in zip(tuple(alive), share, strict=True):
            if some == 0:
                continue
            part = search(branch.equations, box, int(some), rng, rounds, stop)
            if not len(part):
                alive = [a for a in alive if a[1] is not box]
            parts.append(part if own is None else part[own(part)])
            missing -= len(parts[-1])
        if missing == 0 or not alive or (stop is not None and stop()):
            break
    return np.concatenate(parts)


def asked_for(families: Mapping[str, Family], names: Iterable[str]) -> tuple[str, ...]:
    """Names of the families that are asked for by name or title, such as F2 or wrist."""
    found: list[str] = []
    known = [w for k, f in families.items() for w in (k, f.title) if w]
    for word in names:
        alike = [k for k, f in families.items() if word and word in (k, f.title)]
        UnknownNameError.refuse_if(not alike, "family", str(word), known)
        found += alike
    return tuple(dict.fromkeys(found))


_HEADER = ("", "singular where", "kind", "reachable", "why")
_TONES: dict[bool | None, str] = {True: "alarm", False: "good"}


def families_table(rows: Iterable[Sequence[str]], named: Iterable[tuple[str, str]]) -> str:
    """Rows of families with their header, and the joints that their symbols stand for."""
    where = legend((symbol_text(symbol), joint) for symbol, joint in named if symbol != joint)
    return table(rows, _HEADER) + where


@dataclass(frozen=True, eq=False)
class Family(JsonResult):
    """A component of the singular set of an arm, joined with its mirror images.

    Attributes
    ----------
    name : str
        ``F1``, ``F2``, ... in the order of the closed form.
    text, latex : str
        The condition in one line.
    branches : tuple of Branch
        The pieces whose union the family is.
    joints : tuple of str
        Names, in the model, of the joints involved.
    codimension : int
        Number of joints minus the dimension at a generic real point.
    proof : str
        "algebra" if every minor was shown to vanish by division; "generic points" if that was
        decided at random points of every component, exactly, modulo a prime of 62 bits.
    real : bool
        Whether a real point was found; looked for as ``sample`` looks, but within the time of the
        closed form. False does not prove that there is none.
    reachability : Reachability
        A text too: "reachable" (with ``witness``), "at the joint limit" (beyond it by less
        than the angle tolerance, as by a rounded 1.5708; see ``limits_met``), "not reachable"
        (proven), or "none found".
    limit_tolerance : (n,) array or None
        By how much the limits count as wider; None: by nothing.
    value_reach : tuple of ValueReach
        Each value that the family fixes a joint at, and whether the limits allow it.
    limits_met : tuple of str
        Limits that the family lies a little beyond, with both numbers.
    witness : (n,) array or None
        A configuration of the family inside the joint limits, wider by ``limit_tolerance`` where
        the family is at them.
    generic : (n,) array or None
        A generic configuration of it; the witness where there is one.
    rank : int or None
        Rank of the task Jacobian at the generic point.
    lost : tuple of str
        The motion lost there, in words.
    kind : str
        "boundary", "interior" or "undecided" where all points that were looked at, 32 at most,
        agree, which is no proof for the others; else "varies", and ``kinds`` says where, or how
        often.
    kinds : tuple of KindPart
        Each kind that was met.
    reason : str
        Which joint axes are dependent there, and why.
    raw_ratio : float or None
        Largest sigma_r / sigma_1 over sample points, on the geometry as given in the file;
        None where it agrees with the nominal one.
    lower, upper : (n,) arrays
        Joint limits.
    prismatic : (n,) array of bool
        Which joints slide.
    length_scale : float
        Metres.
    components : tuple of Component
        The same in exact polynomials of the half-angles; not written to JSON.
    confirm : callable or None
        Which points (N, n) of equations are singular, by the rank, where these hold at regular
        configurations too; and what gives points all digits where equations touch zero. Not
        written to JSON.
    also_regular : bool
        Whether equations, those of neighbouring axes or of slices, may hold at regular
        configurations too; joints at values alone are singular throughout. Of a family read from a
        file nobody knows then which points are its own.
    solved : tuple of SolvedFor
        Its long equations, each solved for a joint that enters once.
    at_once : tuple of AtOnce
        Of several long equations that hold at once: which joints can be chosen, and how the
        others follow; empty where there are none.
    title : str
        "wrist", "elbow" or "shoulder" where the geometry warrants it (`pinsing.families.describe`
        has the rule); else empty.
    arm : Arm or None
        The arm, whose whole model's configurations are taken too; None where the family was read
        from a file.
    """

    schema: ClassVar[str] = "pinsing/family/1"
    made_by: ClassVar[str] = "pinsing.closed_form(arm).families"

    name: str
    text: str
    latex: str
    branches: tuple[Branch, ...]
    joints: tuple[str, ...]
    codimension: int
    proof: str
    real: bool
    reachability: Reachability
    witness: Array | None
    generic: Array | None
    rank: int | None
    lost: tuple[str, ...]
    kind: str
    reason: str
    raw_ratio: float | None
    lower: Array
    upper: Array
    prismatic: Bool
    length_scale: float
    kinds: tuple[KindPart, ...] = ()
    limit_tolerance: Array | None = None
    limits_met: tuple[str, ...] = ()
    components: tuple[Component, ...] = field(default=(), repr=False, metadata={"json": False})
    confirm: OwnPoints | None = field(default=None, repr=False, metadata={"json": False})
    also_regular: bool = field(default=False, metadata={"optional": True})
    solved: tuple[SolvedFor, ...] = field(default=(), metadata={"optional": True})
    at_once: tuple[AtOnce, ...] = field(default=(), metadata={"optional": True})
    arm: Arm | None = field(default=None, repr=False, metadata={"json": False})
    value_reach: tuple[ValueReach, ...] = field(default=(), metadata={"optional": True})
    title: str = field(default="", metadata={"optional": True})

    def __getstate__(self) -> dict[str, Any]:
        # Exact polynomials live in a ring of this process: like JSON, pickles go without them,
        # and without the arm as loaded.
        return {**self.__dict__, "components": (), "arm": None}

    @property
    def n(self) -> int:
        """Number of joints of the arm."""
        return len(self.lower)

    @cached_property
    def space(self) -> JointSpace:
        """Its joints alone, by number: limits, metric, values at random."""
        names = tuple(f"q{i + 1}" for i in range(self.n))
        return JointSpace(names, self.prismatic, self.lower, self.upper, self.length_scale)

    @checked
    def contains(self, q: ArrayLike, tol: float = 1e-6) -> Bool:
        """Tell for q (..., n) whether a point of the family is within ``tol`` of it.

        Revolute joints count modulo whole turns; limits are not considered.

        Parameters
        ----------
        q : (..., n) or (..., nq) array_like
            Radians and metres.
        tol : float
            Distance in joint space (radians; metres over the length scale).

        Returns
        -------
        (...) array of bool
            True where the family is that near.

        Raises
        ------
        ConfigurationError
            If q has the wrong length or is not finite.
        ResultError
            If the family is ``also_regular`` and was read from a file.

        Examples
        --------
        >>> import pinsing
        >>> wrist = pinsing.closed_form(pinsing.load("stanford")).families[2]  # q5 = 0, 180°
        >>> wrist.contains([[0, 1, 0.3, 1, 0, 0], [0, 1, 0.3, 1, 0.1, 0]])
        array([ True, False])
        """
        q = self._check(q)
        self._require_own()
        found = near(self.branches, self.space, q.reshape(-1, self.n), tol, self.confirm)
        return found.reshape(q.shape[:-1])

    @checked
    def distance(
        self,
        q: ArrayLike,
        *,
        gap: float = GAP,
        boxes: int | None = None,
        within_limits: bool = False,
        weights: ArrayLike | None = None,
        norm: str = "euclidean",
    ) -> Distance:
        """Return the distance from q (n,) to the family, bounded on both sides, with its point.

        Exact for families of joint values. Where equations are involved, boxes of
        configurations are ruled out by Taylor's theorem until the bounds are within ``gap``, or
        ``boxes`` were looked at: then what was reached is returned.

        Parameters
        ----------
        q : (n,) or (nq,) array_like
            Radians and metres.
        gap : float
            Largest ``upper - lower`` at which the search ends by itself.
        boxes : int, optional
            Boxes that the search may look at; by default as many as `clearance` does.
        within_limits : bool
            Whether only configurations within the joint limits count, wider by
            ``limit_tolerance`` where the family is only at them; then revolute
            differences are not wrapped, and joints that do not matter to the family but are
            outside their limits count as well. The answer is infinite where there are none.
        weights : (n,) array_like, optional
            What joint differences are multiplied by, instead of 1 for revolute joints and
            1 / length scale for prismatic ones.
        norm : str
            "euclidean", or "max" for the largest weighted difference of a joint.

        Returns
        -------
        Distance
            ``lower`` and ``upper`` bounds, and the nearest point ``q`` (n,).

        Raises
        ------
        ConfigurationError
            If q has the wrong length or is not finite, or no real point is known at all.
        OptionError
            If an option makes no sense.

        Examples
        --------
        >>> import pinsing
        >>> wrist = pinsing.closed_form(pinsing.load("stanford")).families[2]  # q5 = 0, 180°
        >>> wrist.distance([0, 1, 0.3, 1, 0.25, 0]).value
        0.25
        """
        q = self._check(q)
        ConfigurationError.refuse_if(
            q.ndim != 1, f"distance takes one configuration, got shape {q.shape}"
        )
        options = SearchOptions(gap, boxes, within_limits)
        found = distance_to(self, q, self.conditions(weights, norm), options)
        ConfigurationError.refuse_if(
            found.upper == np.inf and not (within_limits or self.also_regular),
            f"family {self.name}: no real point was found on it",
        )
        return found

    @checked
    def gradient(self, q: ArrayLike) -> Array:
        """Return the gradient (n,) of the distance from q (n,) to the family.

        Parameters
        ----------
        q : (n,) or (nq,) array_like
            Radians and metres.

        Returns
        -------
        (n,) array
            Radians (metres over the length scale) per radian or metre; zero on the family, NaN
            where no point of it was found.

        Raises
        ------
        ConfigurationError
            If q has the wrong length or is not finite, or no real point is known at all.

        Examples
        --------
        >>> import pinsing
        >>> wrist = pinsing.closed_form(pinsing.load("stanford"))["wrist"]  # q5 = 0, 180°
        >>> wrist.gradient([0, 1, 0.3, 1, -0.25, 0])
        array([ 0.,  0.,  0.,  0., -1.,  0.])
        """
        q = self._check(q)
        away = self.space.wrap(q - self.distance(q).q) / self.space.metric
        size = float(np.linalg.norm(away))
        return np.zeros(self.n) if size <= ROUNDING else away / self.space.metric / size

    @checked
    def conditions(self, weights: ArrayLike | None = None, norm: str = "euclidean") -> Conditions:
        """Return what holds on the family, as flat arrays that bounds are computed with.

        Parameters
        ----------
        weights, norm
            As in ``distance``.

        Returns
        -------
        Conditions
            Flat arrays of this family alone.

        Raises
        ------
        OptionError
            If an option makes no sense.
        """
        if weights is None and norm == "euclidean":
            return self._conditions
        weight = 1.0 / self.space.metric if weights is None else real_numbers(weights, "weights")
        OptionError.refuse_if(
            weight.shape != (self.n,), f"weights needs {self.n} numbers, got shape {weight.shape}"
        )
        return Conditions.of([self.branches], self.prismatic, weight, norm)

    @cached_property
    def _conditions(self) -> Conditions:
        return Conditions.of([self.branches], self.prismatic, 1.0 / self.space.metric)

    @checked
    def sample(self, n: int, rng: np.random.Generator) -> Array:
        """Return configurations of the family inside the joint limits, to rounding (1e-9).

        Where the family is only at the joint limit, limits are wider by ``limit_tolerance``.

        Parameters
        ----------
        n : int
            How many.
        rng : np.random.Generator
            Where they are drawn from.

        Returns
        -------
        (k, n) array
            k is ``n``, or less (down to 0) where a bounded number of random starts did not find
            ``n``: compare ``len`` with ``n``. ``reachability`` says whether that there are none is
            proven. Where the equations alone hold at regular points as well, as of long chains,
            only singular points are taken, so that k is less more often.

        Raises
        ------
        OptionError
            If ``n`` is negative.

        Examples
        --------
        >>> import numpy as np, pinsing
        >>> family = pinsing.closed_form(pinsing.load("stanford")).families[0]
        >>> Q = family.sample(5, np.random.default_rng(0))
        >>> Q.shape, bool(family.contains(Q).all())
        ((5, 6), True)
        """
        return self.points(n, rng, within_limits=True)

    @checked
    def points(
        self,
        n: int,
        rng: np.random.Generator,
        within_limits: bool = False,
        rounds: int = ROUNDS,
        stop: Callable[[], bool] | None = None,
    ) -> Array:
        """Return configurations of the family, over whole circles unless ``within_limits``.

        Parameters
        ----------
        n : int
            How many.
        rng : np.random.Generator
            Where they are drawn from.
        within_limits : bool
            Whether only configurations within the joint limits count, as in ``sample``.
        rounds : int
            Number of batches of random starts after which a branch is given up.
        stop : callable, optional
            Asked now and then; once it returns True the search ends with what it has. A first look
            at short equations is taken all the same.

        Returns
        -------
        (k, n) array
            k is ``n``, or less (down to 0) where ``n`` were not found. Sliding joints leave their
            limits where no point is found otherwise.

        Raises
        ------
        OptionError
            If ``n`` is negative.
        ResultError
            As in ``contains``.

        Examples
        --------
        >>> import numpy as np, pinsing
        >>> family = pinsing.closed_form(pinsing.load("ur5")).families[2]
        >>> Q = family.points(5, np.random.default_rng(0))
        >>> bool(abs(family.equations[0](Q)).max() < 1e-9)
        True
        """
        whole_number(n, "n", 0, 10_000_000)
        if n == 0 or (within_limits and self.reachability is Reachability.OUTSIDE):
            return np.zeros((0, self.n))
        self._require_own()
        lower, upper = box = self.box(within_limits)
        copies = [b.held(self.space, box) if within_limits else [None] for b in self.branches]
        usable = [(b, v) for b, each in zip(self.branches, copies, strict=True) for v in each]
        # Sliders that may go on below and above the range that points are drawn from.
        below = above = self.prismatic
        if within_limits:
            below, above = below & np.isinf(self.lower), above & np.isinf(self.upper)
        for widen in (0.0, 1.0, 10.0):  # sliders may have to leave their limits
            far = widen * self.length_scale
            low, high = lower - far * below, upper + far * above
            held = [(b, SearchBox.of(b, low, high, v)) for b, v in usable]
            found = spread(held, self.n, n, rng, rounds, stop, self.confirm)
            if len(found) < n and self.confirm is not None:
                given = self.space, within_limits, self.confirm, n - len(found), rng, stop
                found = np.concatenate([found, own_drawn(held, *given)])
            if len(found) or not (below.any() or above.any()):
                break
        return found if self.confirm is None else self._sharpened(found, within_limits)

    def _sharpened(self, points: Array, within_limits: bool) -> Array:
        """Its own points (k, n) to all digits, without those that leave the limits for that."""
        if self.confirm is None or not len(points):
            return points
        free = np.ones(self.n, dtype=bool)
        free[[v.joint for branch in self.branches for v in branch.values]] = False
        sharp = self.confirm.sharpened(points, free)
        # Else another singular set is near.
        stays = near(self.branches, self.space, sharp, ROUNDING)
        sharp = np.where(stays[:, None], sharp, points)
        lower, upper = self.limits
        outside = ((sharp < lower - 1e-9) | (sharp > upper + 1e-9)).any(axis=-1)
        return sharp[~outside] if within_limits else sharp

    @checked
    def box(self, within_limits: bool) -> tuple[Array, Array]:
        """Return the range of each joint that points are drawn from: the limits, or whole circles.

        Where a limit is infinite, a whole turn (or two length scales) from the other one; a slider
        without a limit goes as far beyond as a value takes it that a branch fixes it at.

        Parameters
        ----------
        within_limits : bool
            The limits, instead of whole circles.

        Returns
        -------
        (n,) array, (n,) array
            Lower and upper ends, radians and metres.
        """
        lower, upper = (np.array(end) for end in self.space.range(not within_limits))
        for value in (v for branch in self.branches for v in branch.values):
            j = value.joint
            if self.prismatic[j] and np.isinf(self.lower[j]):
                lower[j] = min(lower[j], value.value - self.length_scale)
            if self.prismatic[j] and np.isinf(self.upper[j]):
                upper[j] = max(upper[j], value.value + self.length_scale)
        wider = self.limit_tolerance if within_limits else None
        return (lower, upper) if wider is None else (lower - wider, upper + wider)

    @property
    def limits(self) -> tuple[Array, Array]:
        """Limits (n,) that count for this family: those of the joints, perhaps a little wider.

        Wider by ``limit_tolerance`` where the family is "at the joint limit"; infinite for
        continuous joints.
        """
        if self.limit_tolerance is None:
            return self.lower, self.upper
        return self.lower - self.limit_tolerance, self.upper + self.limit_tolerance

    def _require_own(self) -> None:
        ResultError.refuse_if(
            self.also_regular and self.confirm is None,
            f"family {self.name}: its equations may hold at regular configurations too, and "
            "which are singular only the arm tells: make the form again with closed_form(arm)",
        )

    def _check(self, q: ArrayLike) -> Array:
        if self.arm is not None:
            return self.arm.check(q)
        array = real_numbers(columns_of(q, self.space.names, "q"), "q")
        require_values(array, self.space.names, "q")
        return array

    @property
    def is_reachable(self) -> bool | None:
        """True, False (proven), or None if no point within the limits was found."""
        return self.reachability.known

    @property
    def reach(self) -> str:
        """Reachability in words, with the joint values that it is true of where not of all."""
        near = [replace(v, value=self._copy(v.value, v.joint)) for v in self.value_reach]
        return reach_words(self.reachability, near, self.prismatic)

    @property
    def label(self) -> str:
        """Name and title: ``F2 (wrist)``, or ``F2`` without a title."""
        return f"{self.name} ({self.title})" if self.title else self.name

    @checked
    def where(self, q: ArrayLike | None = None, *, every: bool = False) -> str:
        """Return its condition with the joints' own names, in degrees and metres.

        Parameters
        ----------
        q : (n,) or (nq,) array_like, optional
            A configuration on it: then the joints at their values there.
        every : bool
            Values outside the joint limits, too: what is within them may be near to those. Without
            it they are left out of a family that has others.

        Raises
        ------
        ConfigurationError
            If q has the wrong length or is not finite.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.closed_form(pinsing.load("ur5"))["wrist"].where()
        'wrist_2_joint = 0° or 180°'
        """
        names = dict(
            zip(sorted({j for b in self.branches for j in b.involved}), self.joints, strict=False)
        )
        fixed = {v.joint for b in self.branches for v in b.values}
        equations = any(b.equations for b in self.branches)
        if self.title in _PLACES and equations:
            return _PLACES[self.title]
        if q is not None and not equations:
            at = self._check(q)
            ConfigurationError.refuse_if(
                at.ndim != 1, f"q is one configuration, got shape {at.shape}"
            )
            said = []
            for j in sorted(fixed):
                angle = self._copy(float(-self.space.wrap(-at)[j]), j)
                degrees = f"{round(math.degrees(angle), 2) + 0.0:g}°"
                value = f"{at[j]:.4g} m" if self.prismatic[j] else degrees
                said.append(f"{names[j]} = {value}")
            return " and ".join(said)
        # Its conditions one by one, where they hold at once.
        parts = [self.text] if "; or " in self.text else self.text.split(" and ")
        solved = [(t, _VALUES.search(t)) for t in parts]
        said = [t if m is None else m[1] if every else self._reached(m) for t, m in solved]
        if equations and (len(self.text) > 72 or "φ" in self.text):
            others = listed([names[j] for j in names if j not in fixed])
            said = [*said[: len(fixed)], f"an equation in {others}"]
        return _NUMBERED.sub(lambda s: names.get(int(s[1]) - 1, s[0]), " and ".join(said))

    def _reached(self, said: re.Match[str]) -> str:
        """``q3 = 5.3849°`` of ``q3 = 5.3849° or -174.6151°``, where limits exclude the other."""
        j = int(said[2]) - 1
        of = [v for v in self.value_reach if v.joint == j]
        left = [self._copy(v.value, j) for v in of if v.reachability is not Reachability.OUTSIDE]
        return said[1] if self.prismatic[j] or not left else f"q{j + 1} = {angles_text(left)}"

    def _copy(self, angle: float, j: int) -> float:
        """The angle, by whole turns within the limits where one is."""
        low, high = float(self.lower[j]) - ROUNDING, float(self.upper[j]) + ROUNDING
        if low <= angle <= high or math.isinf(low) or self.prismatic[j]:
            return angle
        moved = angle + math.tau * math.ceil((low - angle) / math.tau)
        return moved if moved <= high else angle

    @property
    def equations(self) -> tuple[Equation, ...]:
        """All equations of all branches; each is callable on arrays q (..., n)."""
        return tuple(e for b in self.branches for e in b.equations)

    @property
    def values(self) -> tuple[dict[int, float], ...]:
        """Fixed joint values of each branch, by joint index."""
        return tuple({v.joint: v.value for v in b.values} for b in self.branches)

    @property
    def abridged(self) -> bool:
        """True if ``text`` leaves long equations out, and says how many terms they have."""
        return any(
            bool(long_ones(b.equations))
            or any(len(e.cos) > LONG and long_form(e) is None for e in b.equations)
            for b in self.branches
        )

    def __str__(self) -> str:
        return f"{self.label}: {self.text}"

    def _repr_latex_(self) -> str:
        """For notebooks."""
        return f"$${self.latex}$$"

    def _repr_html_(self) -> str:
        """For notebooks, which prefer it: the equations typeset, and what else is known."""
        involved = sorted({j for b in self.branches for j in b.involved})
        symbols = [f"{'d' if self.prismatic[j] else 'q'}{j + 1}" for j in involved]
        return families_table([html_row(self)], zip(symbols, self.joints, strict=False))


_NUMBERED = re.compile(r"\b[qd](\d+)\b")
_VALUES = re.compile(r"(?:\(|^)([qd](\d+) = (?:±|-?\d)[^();]*)\)?$")
"""``0.4 cos q3 + 0.02 sin q3 = 0 (q3 = 92.7°)``: what is left is in the last parentheses."""
_PLACES = {"shoulder": "wrist center above the base axis"}
"""What is said of families that have a name and equations in several joints."""


def html_row(family: Family) -> tuple[str, ...]:
    """Its cells in a table of families."""
    kind = "; ".join(str(part) for part in family.kinds) if family.kind == "varies" else family.kind
    short = family.text if family.solved or family.abridged else ""
    tone = _TONES.get(family.is_reachable)
    reach = marked(family.reach, tone) if tone else text(family.reach)
    cells = name(family.name), formula(family.latex, short), text(kind)
    return (*cells, reach, text(family.reason))


_TERM = re.compile(r"(?= [+-] )")
_HALF = re.compile(r"(?:cos|sin)\(([^()/]*|\([^()/]*\))/2\)")
_SYMBOL = re.compile(r"q[0-9]+")
_COMMAND = re.compile(r"\\[a-zA-Z]+ ?|[{}_^\\]")


def written_out(family: Family) -> tuple[str, ...]:
    """Return what long equations are, solved for a joint, line by line."""
    alone = tuple(
        line
        for one in family.solved
        for line in (one.solution, *(f"{a} = {b}" for a, b in one.where))
    )
    return (*alone, *(line for one in family.at_once for line in one.lines()))


def exactly(family: Family, latex: bool = False) -> tuple[str, ...]:
    """The equations of a family with exact coefficients, line by line."""
    lines: list[str] = []
    for one in family.solved:
        if latex:
            lines += [one.exact_latex] if one.exact_latex else []
        else:
            lines += [one.solution, *(f"{a} = {b}" for a, b in one.exact or one.where)]
            lines += [] if one.exact else ["(its coefficients are known as decimals only)"]
    short = [e for e in family.equations if not family.solved or long_form(e) is None]
    for e in short:
        # Of a long one that no name stands for decimals are better than nothing.
        brief = len(e.cos) <= LONG
        text = e.exact_text(latex) or ("" if brief else e.latex() if latex else e.text())
        lines += [text] if text else []
    return tuple(dict.fromkeys(lines))


def latex_lines(latex: str) -> list[str]:
    """A long statement in LaTeX as lines of a page's width, broken at commas and between terms."""
    lines: list[str] = []
    for part in latex.split(r",\ "):
        whole = [""]
        for term in _TERM.split(part):
            here = whole[-1]
            # Round brackets may close on another line, braces may not.
            closed = here.count("{") == here.count("}")
            # Characters of a line that a printed page has room for.
            if here.strip() and closed and _seen(here) + _seen(term) > 80:
                whole.append("")
            whole[-1] += term
        lines += [line.strip() for line in whole]
    return lines


def _seen(latex: str) -> int:
    """About how many characters of it are seen; a name such as sin counts as three."""
    return len(_COMMAND.sub(lambda m: "abc" if m[0][1:].strip() in ("sin", "cos") else "", latex))


def meaning(family: Family) -> Iterator[str]:
    """Kind, reach, codimension and reason, line by line."""
    n = family.n
    if not family.real:
        yield "no real point found in the time given, which does not prove that there is none"
        return
    kind = "; ".join(map(str, family.kinds)) if family.kind == "varies" else family.kind
    kind = f"{kind}, " if kind != "undecided" else ""
    size = f"codimension {family.codimension} of {n}"
    proof = "" if family.proof == "algebra" else ", checked at generic points"
    yield f"{kind}{family.reach}; {size}{proof}"
    yield from family.limits_met
    if family.reason:
        yield family.reason


def half_angles(families: Iterable[Family]) -> Iterator[str]:
    """Why there are half angles in equations that are printed, where there are any."""
    where: dict[str, set[str]] = {}
    for family in families:
        for line in (family.text, *written_out(family)):
            for angle in _HALF.findall(line):
                where.setdefault(family.name, set()).update(_SYMBOL.findall(angle))
    if not where:
        return
    joints = sorted(set().union(*where.values()), key=lambda symbol: int(symbol[1:]))
    yield (
        f"half of {', '.join(joints)} in {', '.join(where)}: equations are factors of a longer "
        "one, and in a factor half of an angle may be left, as where another is zero at a single "
        "value of that joint; a whole turn changes the sign of such an equation, "
        "never whether it holds"
    )


def owned(family: Family, points: Array) -> Bool:
    """Return which points (N, n) of the equations are the family's own: singular."""
    if not family.also_regular:
        return np.ones(len(points), dtype=bool)
    return np.zeros(len(points), dtype=bool) if family.confirm is None else family.confirm(points)


def distance_to(
    family: Family, q: Array, conditions: Conditions, options: SearchOptions
) -> Distance:
    """`Family.distance`, under its conditions; infinite where no point was found."""
    found = nearest_points(conditions, q[None], *family.limits, options)
    upper, point = float(found.upper[0]), found.q[0]
    if found.family[0] < 0:
        point = np.full(family.n, np.nan)
    # Among joint values what was found is the nearest.
    exact = all(not b.equations for b in family.branches)
    distance = Distance(upper, point, exact, upper if exact else float(found.lower[0]), upper)
    if found.family[0] < 0 or owned(family, found.q)[0]:
        return distance
    if family.confirm is None:
        nowhere = np.full(family.n, np.nan)
        return replace(distance, value=np.inf, q=nowhere, exact=False, upper=np.inf)
    limits = family.limits if options.within_limits else None
    return own_nearest(
        distance, conditions, family.branches, family.space, q, limits, family.confirm
    )
