"""From one singular configuration to the joint values that force it, whatever the others.

All of it is tested on the nominal geometry, at many random values of all the other joints
over whole circles: a set of joint values *forces* the singularity if every one of those
configurations is singular to ``SINGULAR_RTOL``. A generic rank is reached almost everywhere,
so a set that does not force it fails with probability one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pinsing.errors import ConfigurationError, OptionError
from pinsing.interface import MAX_SEED, JsonResult, checked, whole_number
from pinsing.kinematics.jacobian import SINGULAR_RTOL, Status, own_scale, ratios
from pinsing.kinematics.refine import SingularConfiguration, approach
from pinsing.measures import Array, ArrayLike, Bool, Reachability
from pinsing.prose import Span, listed, unbroken, verdict
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import nominal
from pinsing.sampling.tally import BLOCK


@dataclass(frozen=True)
class JointCondition:
    """What forces a singularity, whatever the other joints."""

    fixed: Mapping[str, float]  # joints held at one value each, radians or metres
    # joints bound by one or more equations in several angles; empty if the values alone say it all.
    # The singular set then runs through these joints in a continuum
    related: tuple[str, ...]
    # the smallest set of joint values that forces it at the configuration itself: ``fixed``, and
    # the present values of ``related`` as far as they are needed
    forced_by: Mapping[str, float]
    prismatic: tuple[str, ...]  # which of the joints named here slide (metres)
    tested: int  # random configurations tested
    worst_ratio: float  # greatest sigma_r / sigma_1 among them

    @property
    def minimal(self) -> bool:
        """True if joint values alone force it, and none of them can be left out."""
        return not self.related

    @property
    def depends_on(self) -> tuple[str, ...]:
        """All joints that the condition speaks of."""
        return (*self.fixed, *self.related)

    def same_as(self, other: JointCondition, tol: float = 1e-5) -> bool:
        """True if both say the same: values agree to ``tol``, whole turns aside."""
        if self.related != other.related or set(self.fixed) != set(other.fixed):
            return False
        return all(self.distance(name, x) <= tol for name, x in other.fixed.items())

    def distance(self, joint: str, value: float) -> float:
        """Return the distance of ``value`` from that of ``joint``, whole turns aside."""
        return apart(value, self.fixed[joint], joint in self.prismatic)

    def __str__(self) -> str:
        parts = [
            f"{name} = {value_text(value, name in self.prismatic)}"
            for name, value in self.fixed.items()
        ]
        if self.related:
            parts.append(f"a relation between {listed(self.related)}")
        return " and ".join(parts) if parts else "every configuration"


def apart(one: float, other: float, slides: bool) -> float:
    """Difference of two values of a joint, whole turns aside."""
    return abs(one - other if slides else math.remainder(one - other, math.tau))


def value_text(value: float, prismatic: bool = False) -> str:
    """A joint value in degrees or metres, special angles short: ``0``, ``-90 deg``, ``0.1 m``."""
    if value == 0:
        return "0"
    if prismatic:
        return f"{value:.6g} m"
    degrees = math.degrees(value)
    if abs(degrees - round(degrees)) < 1e-9:
        return f"{round(degrees)} deg"
    return f"{degrees:.4f} deg ({value:.6f} rad)"


def tidy(value: float, prismatic: bool) -> float:
    """Value without whole turns, in (-pi, pi]; special angles exactly there."""
    if prismatic:
        return value + 0.0
    turned = math.remainder(value, math.tau)
    quarters = round(turned / (math.pi / 2))
    if abs(turned - quarters * math.pi / 2) < 1e-14:
        turned = (quarters if quarters > -2 else 2) * math.pi / 2
    return turned + 0.0


@dataclass(frozen=True, eq=False)
class Finding(JsonResult):
    """A set of singular (or near-singular) configurations that a sweep has found.

    Attributes
    ----------
    status : str
        ``singular`` or ``near-singular``.
    condition : JointCondition
        What forces it, whatever the other joints.
    configuration : SingularConfiguration
        A representative, on the nominal geometry; within the limits if one was found.
    raw_ratio : float
        sigma_r / sigma_1 of the representative on the raw geometry.
    reachable : bool or None
        Whether one exists within the limits (then the representative does), does not (a fixed
        value is outside: proven), or none was found.
    seen : int
        Number of dips, and of curves that are singular all along, that led here.
    curves : tuple of int
        Numbers of those curves in the plan: where all are kept, indices of the curves of the
        result.
    zeros : tuple of (int, float)
        Curve, and value of its moving joint at which it is zero itself: there only that joint
        had to move from where the dip was sampled.
    """

    schema: ClassVar[str] = "pinsing/finding/1"
    made_by: ClassVar[str] = "pinsing.sampling.singular_configurations(arm, result)"

    status: Status
    condition: JointCondition
    configuration: SingularConfiguration
    raw_ratio: float
    reachable: bool | None
    seen: int
    curves: tuple[int, ...]
    zeros: tuple[tuple[int, float], ...] = ()

    @property
    def reachability(self) -> Reachability:
        """The same as that of a family."""
        return Reachability.of(self.reachable)

    def __str__(self) -> str:
        return "".join(x if isinstance(x, str) else x.text for x in finding_spans(self)).replace(
            "\u00a0", " "
        )


def finding_spans(finding: Finding) -> tuple[Span, ...]:
    """Return what was found, with its verdict."""
    condition = f"{finding.condition}, whatever the others"
    reach = {True: "", False: ", outside the limits", None: ", none found within the limits"}
    where = reach[finding.reachable]
    if finding.status != "singular":
        ratio = unbroken(f"sigma_r/sigma_1 = {finding.configuration.sigma_ratio:.1e}")
        return f"{condition}: ", verdict(finding.status), f", {ratio}{where}"
    kind = finding.configuration.kind
    said = f" ({kind})" if kind != "undecided" else ""
    raw = "" if finding.raw_ratio <= SINGULAR_RTOL else (
        f"; on the file as it is the ratio is {finding.raw_ratio:.1e}"
    )  # fmt: skip
    return (f"{condition}{said}{where}{raw}",)


SNAP_TOL = 1e-4
"""Radians or metres: a value nearer than this to a special one is tried there first."""

DRAWS = 64
"""Random values of the other joints that a condition is tested at."""

_SCREEN = 3  # samples that sort out most subsets
_PUSHES = 8
_MAX_IN_SUBSETS = 12


@dataclass(frozen=True, eq=False)
class Generalization(JsonResult):
    """The conditions that one singular configuration is an instance of.

    Attributes
    ----------
    joints : tuple of str
        Names of the joints, base to tip.
    q : (n,) array
        The configuration, special values snapped where the test allows it.
    conditions : tuple of JointCondition
        All minimal ones; several where families meet.
    rtol : float
        Ratio sigma_r / sigma_1 that the tests ask for.
    nominal_ratio, raw_ratio : float
        Ratio at q on the nominal geometry, and on the raw one.
    seed : int
        Of the random values.
    """

    schema: ClassVar[str] = "pinsing/generalization/1"

    joints: tuple[str, ...]
    q: Array
    conditions: tuple[JointCondition, ...]
    rtol: float
    nominal_ratio: float
    raw_ratio: float
    seed: int

    def __str__(self) -> str:
        text = "; ".join(f"{c}, whatever the others" for c in self.conditions)
        if self.raw_ratio > self.rtol:
            text += f" (nominal geometry; the file itself reaches {self.raw_ratio:.1e})"
        return text


@checked
def generalize(
    arm: Arm,
    configuration: SingularConfiguration | ArrayLike,
    *,
    samples: int = DRAWS,
    rtol: float = SINGULAR_RTOL,
    seed: int = 0,
    joints: Sequence[str] | None = None,
    geometry: Arm | None = None,
) -> Generalization:
    """Find the smallest sets of joint values that alone force a singularity.

    Where only several angles together force it, and in a continuum (such as the shoulder
    singularity of the PUMA 560, an equation in q2 and q3), the condition says which joints
    are related, and no values.

    Parameters
    ----------
    arm : Arm
        Any arm.
    configuration : SingularConfiguration or (n,) array_like
        Singular on the nominal geometry, or next to a configuration that is.
    samples : int
        Random values of the other joints that each condition is tested at.
    rtol : float
        sigma_r / sigma_1 that counts as singular.
    seed : int
        Of the random values.
    joints : sequence of str, optional
        Joints that can matter; all by default.
    geometry : Arm, optional
        Geometry to test on, instead of the nominal one of ``arm``.

    Returns
    -------
    Generalization
        With the ratio that the raw geometry reaches.

    Raises
    ------
    ConfigurationError
        If the configuration is not singular, nor within 0.01 of one that is.
    OptionError
        If ``samples`` is not positive, more than 12 joints matter, or ``geometry`` has another
        number of joints.

    Examples
    --------
    >>> import pinsing
    >>> pinsing.sampling.generalize(pinsing.load("ur5"), [0.4, -1.2, 0.8, -1, 0, 0.3])
    <Generalization: wrist_2_joint = 0, whatever the others>
    """
    whole_number(seed, "seed", 0, MAX_SEED)
    candidates = range(arm.n) if joints is None else [arm.space.index(j) for j in joints]
    exact = nominal(arm).arm if geometry is None else geometry
    given = configuration.q if isinstance(configuration, SingularConfiguration) else configuration
    q = arm.fold(arm.check_one(given, "configuration"))
    OptionError.refuse_if(
        exact.n != arm.n,
        f"geometry has {exact.n} joints, {arm.name} has {arm.n}",
    )
    if _ratio(exact, q) > rtol:
        end = approach(exact, q)
        metric = own_scale(arm).columns
        # radians or length scales: how far a given configuration may be from singular
        if end.ratio[0] > rtol or np.linalg.norm((end.q[0] - q) / metric) > 0.01:
            raise ConfigurationError(
                f"{arm.name} is not singular there (sigma_r/sigma_1 = {_ratio(exact, q):.1e} on "
                "the nominal geometry); refine the configuration first"
            )
        q = end.q[0]
    tester = ConditionTester(exact, candidates, samples, rtol, seed)
    q = tester.snap(q)
    return Generalization(
        joints=arm.joints,
        q=q,
        conditions=tester.conditions(q),
        rtol=rtol,
        nominal_ratio=_ratio(exact, q),
        raw_ratio=_ratio(arm, q),
        seed=seed,
    )


class ConditionTester:
    """Tests joint values against the same random values of the other ``joints`` that matter.

    Values that are held are rows (n,), with NaN where a joint is free.
    """

    def __init__(
        self,
        arm: Arm,
        joints: Sequence[int] | range,
        samples: int = DRAWS,
        rtol: float = SINGULAR_RTOL,
        seed: int = 0,
    ) -> None:
        whole_number(samples, "samples", 1, 1_000_000)
        OptionError.refuse_if(
            len(joints) > _MAX_IN_SUBSETS,
            f"{len(joints)} joints have too many subsets; name at most {_MAX_IN_SUBSETS} joints",
        )
        self.arm, self.rtol, self.joints = arm, rtol, tuple(joints)
        rng = np.random.default_rng(seed)
        count = max(samples, _SCREEN, _PUSHES)
        self.others = arm.space.sample(count, rng, ignore_limits=True)  # whole circles
        self.pushes = rng.standard_normal((_PUSHES, arm.n))
        self.samples = samples
        self.metric = own_scale(arm).columns

    def worst_ratios(self, rows: Array, samples: int | None = None) -> Array:
        """Greatest sigma_r / sigma_1 (S,) with each of the rows (S, n) held."""
        others, found = self.others[: samples or self.samples], [np.zeros(0)]
        for start in range(0, len(rows), BLOCK):
            held = rows[start : start + BLOCK, None]
            Q = np.where(np.isnan(held), others, held)
            ratio = ratios(self.arm, Q.reshape(-1, self.arm.n))
            found.append(ratio.reshape(Q.shape[:2]).max(axis=1))
        return np.concatenate(found)

    def forces(self, row: Array) -> bool:
        """Tell if the values that a row holds force a singularity."""
        return bool(self.worst_ratios(row[None])[0] <= self.rtol)

    def snap(self, q: Array) -> Array:
        """Put values near special ones there, one by one, as long as q stays as singular."""
        # The nearest multiples of 90 degrees, or zero for a prismatic joint.
        snapped, quarter = q.copy(), np.pi / 2
        near = np.where(self.arm.prismatic, 0.0, np.round(q / quarter) * quarter) + 0.0
        for i in np.flatnonzero(np.abs(near - q) <= SNAP_TOL):
            trial = snapped.copy()
            trial[i] = near[i]
            if _ratio(self.arm, trial) <= max(self.rtol, _ratio(self.arm, snapped)):
                snapped = trial
        return snapped

    def minimal_sets(self, q: Array) -> list[Array]:
        """Rows of the fewest joints whose values at q (n,) force it, with those values polished."""
        found: list[Array] = []
        for size in range(len(self.joints) + 1):
            sets = [held(q, subset) for subset in itertools.combinations(self.joints, size)]
            sets = [row for row in sets if not any(np.isnan(f[np.isnan(row)]).all() for f in found)]
            if not sets:
                break
            rows = np.array(sets)
            screened = self.worst_ratios(rows, _SCREEN)
            loose = max(1e-6, self.rtol)  # ratio for candidates, before their values are polished
            for row in rows[screened <= loose]:
                ends = rows[:0] if self.forces(row) else self._push(row, 0.0)
                polished = np.where(np.isnan(row), np.nan, _middle(ends)) if len(ends) else row
                if self.forces(polished):
                    found.append(polished)
        return found

    def conditions(self, q: Array) -> tuple[JointCondition, ...]:
        """All conditions that q (n,) is an instance of."""
        found: list[JointCondition] = []
        for row in self.minimal_sets(q):
            condition = self.condition(row)
            if not any(condition.same_as(known) for known in found):
                found.append(condition)
        return tuple(found)

    def condition(self, row: Array) -> JointCondition:
        """Condition that the values of a row stand for: values, relation or both."""
        related, at = self._related(row), row
        # A special member of a relation may hide joints that it depends on: look at a generic one.
        points = self._push(row, 0.05) if related.any() else row[:0]
        wider = self.minimal_sets(points[0]) if len(points) else []
        for generic in [r for r in wider if not np.isnan(r[related]).all()][:1]:
            at, related = generic, self._related(generic)
        return self.stated(row, at, related)

    def stated(
        self, row: Array, at: Array | None = None, related: Bool | None = None
    ) -> JointCondition:
        """Condition of the values of a row: those of ``at`` but where joints are ``related``."""
        at = row if at is None else at
        related = np.zeros(len(row), dtype=bool) if related is None else related
        names, prismatic = self.arm.joints, self.arm.prismatic

        def by_name(values: Array) -> dict[str, float]:
            there = np.flatnonzero(~np.isnan(values))
            return {names[i]: tidy(float(values[i]), bool(prismatic[i])) for i in there}

        slides = prismatic & ~(np.isnan(at) & np.isnan(row))
        return JointCondition(
            fixed=by_name(np.where(related, np.nan, at)),
            related=tuple(names[i] for i in np.flatnonzero(related)),
            forced_by=by_name(row),
            prismatic=tuple(names[i] for i in np.flatnonzero(slides)),
            tested=self.samples,
            worst_ratio=float(self.worst_ratios(row[None])[0]),
        )

    def _push(self, row: Array, size: float) -> Array:
        """Singular configurations (P, n) near the values of a row, the other joints at random."""
        free = np.isnan(row)
        pushed = row + size * (self.pushes * self.metric)
        ends = approach(self.arm, np.where(free, self.others[:_PUSHES], pushed), ~free)
        return np.asarray(ends.q[ends.ratio <= self.rtol])

    def _related(self, row: Array) -> Bool:
        """Return joints (n,) of a row that do not come back when pushed a little off its values.

        A continuum lets no push come back; another family nearby can catch a large push, no small
        one.
        """
        there, size = ~np.isnan(row), 1e-3  # radians or length scales
        ends = self._push(row, size) if there.sum() > 1 else row[:0]
        if len(ends) < _PUSHES // 2:
            return np.zeros(len(row), dtype=bool)
        away = _middle(np.abs(ends - _middle(ends)) / self.metric)
        # Where none ends farther away than a tenth of the push the values are isolated; else, a
        # single value that hardly moves is fixed nevertheless: the others do by 1e-6 of it.
        return np.asarray(there & (away > 1e-7 * size) & (away[there].max() > 0.1 * size))


def held(q: Array, joints: Sequence[int]) -> Array:
    """Values of q (..., n) of some joints, NaN of the others."""
    return np.where(np.isin(np.arange(q.shape[-1]), joints), q, np.nan)


def _middle(rows: Array) -> Array:
    """Median of each column; np.median imports masked arrays for it."""
    ordered, half = np.sort(rows, axis=0), len(rows) // 2
    return ordered[half] if len(rows) % 2 else np.asarray((ordered[half - 1] + ordered[half]) / 2)


def _ratio(arm: Arm, q: Array) -> float:
    return float(ratios(arm, q)[0])
