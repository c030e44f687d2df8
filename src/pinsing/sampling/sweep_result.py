"""What a sweep has found: how sigma_r is distributed, where it dips, and its curves if kept."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.arguments import checked, whole_number
from pinsing.errors import OptionError, UnknownNameError
from pinsing.joint_text import typed
from pinsing.kinematics.verdict import Status
from pinsing.prose import PLAIN, Page, Span, alarm, unbroken, verdict
from pinsing.robot.arm import ArmSummary
from pinsing.sampling.curves import Candidates, CurveTable, axis_values
from pinsing.sampling.generalize import Finding, finding_spans, value_text
from pinsing.sampling.sweep_plan import SweepPlan
from pinsing.sampling.tally import Distribution, WorstPoint
from pinsing.serialization import JsonResult

HOW_TO_KEEP = (
    "sweep fewer of them, or keep them in a folder (keep=True with out=FOLDER, --keep -o FOLDER) "
    "and read them one by one with pinsing.sampling.npz.kept_curves(DIR)"
)
"""What is to be done where curves are needed and there are none."""

CURVES = "sweep.npz"
"""File of the folder of a complete sweep that holds its result, with the curves if kept in it."""


@dataclass(frozen=True, eq=False)
class SweepCurve:
    """Distribution of sigma_r along one joint.

    Attributes
    ----------
    level : int
        Number of joints at special values; 0 for the curves from the nominal configuration.
    fixed : mapping of str to float
        Joints at special values, radians or metres.
    forced : bool
        ``fixed`` alone is singular whatever the others, and so is the whole curve.
    moving : int
        Index of the joint that moves.
    x : (samples,) array
        Its values, radians or metres.
    sigma_min : (samples,) array
        sigma_r of the task Jacobian, raw geometry.
    sigma_ratio : (samples,) array
        sigma_r / sigma_1.
    number : int
        Its place in the plan.
    """

    level: int
    fixed: Mapping[str, float]
    forced: bool
    moving: int
    x: Array
    sigma_min: Array
    sigma_ratio: Array
    number: int


@dataclass(frozen=True)
class UniformRow:
    """All revolute joints at one special value: step (2).

    Attributes
    ----------
    value : float
        Radians.
    sigma_min, sigma_ratio : float
        sigma_r, and sigma_r / sigma_1.
    status : str
        ``singular``, ``near-singular`` or ``regular``.
    """

    value: float
    sigma_min: float
    sigma_ratio: float
    status: Status


@dataclass(frozen=True, eq=False)
class SweepSummary:
    """How sigma_r is distributed over the samples of all curves.

    Curves whose special values alone are singular whatever the others are left out: all of
    them is rounding. The number of a configuration is that of its curve times the samples of a
    curve, plus that of the sample.

    Attributes
    ----------
    count : int
        Configurations.
    singular, near_singular : int
        How many of them are that (ratio at most 1e-9; above it and at most 1e-2).
    sigma_min, ratio : Distribution
        Of sigma_r, and of sigma_r / sigma_1.
    worst : tuple of WorstPoint
        Those of smallest ratio, smallest first, the first of equals first.
    """

    count: int
    singular: int
    near_singular: int
    sigma_min: Distribution
    ratio: Distribution
    worst: tuple[WorstPoint, ...]

    def __str__(self) -> str:
        ratio = self.ratio
        shown = ", ".join(
            f"{name} {ratio.quantile(p):.3g}"
            for p, name in ((0.01, "1 %"), (0.1, "10 %"), (0.5, "median"))
        )
        return (
            f"sigma_r/sigma_1 over {self.count:,} configurations: "
            f"smallest {ratio.smallest.value:.3g}, {shown}, largest {ratio.largest.value:.3g}; "
            f"{self.singular:,} singular, {self.near_singular:,} near-singular"
        )


@dataclass(frozen=True, eq=False)
class SweepResult(JsonResult):
    """All that a sweep has computed.

    Attributes
    ----------
    plan : SweepPlan
        What was asked for.
    uniform : tuple of UniformRow
        All joints at each special value.
    curves : tuple of SweepCurve
        In the order of the plan; empty if they are not kept.
    complete : bool
        False if the sweep was stopped.
    notes : tuple of str
        The notes of the plan, and what happened on the way.
    engine : str
        ``pinocchio``, or the instruction set: the same one gives the same bits.
    kept : bool
        Whether ``curves`` has them.
    done : int
        Jacobians computed.
    summary : SweepSummary or None
        How sigma_r is distributed over the curves; None if there was no curve to look at.
    candidates : Candidates
        The dips of the curves.
    """

    schema: ClassVar[str] = "pinsing/sweep/1"
    made_by: ClassVar[str] = "pinsing.sampling.sweep(arm)"

    plan: SweepPlan
    uniform: tuple[UniformRow, ...]
    curves: tuple[SweepCurve, ...]
    complete: bool
    notes: tuple[str, ...]
    engine: str
    kept: bool
    done: int
    summary: SweepSummary | None
    candidates: Candidates

    @property
    def arm(self) -> ArmSummary:
        """The arm that was swept."""
        return self.plan.arm

    @checked
    def curve(self, fixed: Mapping[str, float] | None, moving: str | int) -> SweepCurve:
        """Look up the curve of joint ``moving`` with ``fixed`` at special values.

        Parameters
        ----------
        fixed : mapping of str to float
            Radians or metres; values of revolute joints up to whole turns. Empty for level 0.
        moving : str or int
            Name or index of the joint.

        Returns
        -------
        SweepCurve
            Its ``x`` and ``sigma_min``, among others.

        Raises
        ------
        UnknownNameError
            If a joint does not exist.
        OptionError
            If there is no such curve, or the curves are not kept.

        Examples
        --------
        >>> import pinsing
        >>> curve = pinsing.sampling.sweep(pinsing.load("planar3r")).curve({}, "q2")
        >>> curve.x.shape, curve.sigma_min.max().round(3).item()
        ((181,), 0.206)
        """
        names = self.arm.joints
        wanted = dict(fixed or {})
        self._known((*wanted, *([moving] if isinstance(moving, str) else [])))
        index = (
            names.index(moving)
            if isinstance(moving, str)
            else whole_number(moving, "moving", 0, len(names) - 1)
        )
        for curve in self.curves:
            if curve.moving == index and self._same(curve.fixed, wanted):
                return curve
        if not self.kept:
            raise OptionError(
                f"the curves of this sweep are not kept ({self.plan.n_jacobians:,} Jacobians); "
                f"{HOW_TO_KEEP}"
            )
        raise OptionError(
            f"there is no curve of {names[index]} with {self.set_text(wanted) or 'no joint fixed'}"
            ": outside the plan, or left out because a part of it is singular already"
        )

    @checked
    def set_text(self, fixed: Mapping[str, float]) -> str:
        """Special values in words.

        Parameters
        ----------
        fixed : mapping of str to float
            Radians or metres, by names of joints.

        Raises
        ------
        UnknownNameError
            If a joint does not exist.

        Examples
        --------
        >>> import math, pinsing
        >>> pinsing.sampling.sweep(pinsing.load("planar3r")).set_text({"q2": 0, "q3": math.pi / 2})
        'q2 = 0, q3 = 90 deg'
        """
        self._known(fixed)
        sliding = dict(zip(self.arm.joints, self.arm.prismatic, strict=True))
        return ", ".join(f"{n} = {value_text(v, bool(sliding[n]))}" for n, v in fixed.items())

    def _known(self, joints: Iterable[str]) -> None:
        for name in joints:
            if name not in self.arm.joints:
                raise UnknownNameError("joint", name, self.arm.joints)

    def _same(self, one: Mapping[str, float], other: Mapping[str, float]) -> bool:
        if set(one) != set(other):
            return False
        sliding = dict(zip(self.arm.joints, self.arm.prismatic, strict=True))
        turns = np.array([0.0 if sliding[n] else one[n] - other[n] for n in one])
        shifts = np.array([one[n] - other[n] if sliding[n] else 0.0 for n in one])
        turns -= 2 * np.pi * np.round(turns / (2 * np.pi))
        return bool((np.abs(turns) < 1e-9).all() and (np.abs(shifts) < 1e-9).all())

    def __str__(self) -> str:
        return sweep_text(self)


def sweep_text(
    result: SweepResult,
    findings: Sequence[Finding] | None = None,
    page: Page = PLAIN,
    degrees: bool = False,
) -> str:
    """What was swept, what was found, and what was left out.

    Parameters
    ----------
    result : SweepResult
        What to print.
    findings : sequence of Finding, optional
        What `singular_configurations` made of it, if that was asked.
    page : Page
        What it is fitted to.
    degrees : bool
        Configurations in degrees.
    """
    room = page.width - 2
    lines = [page.paragraph(*spans, rest="  ") for spans in _swept(result, degrees, room)]
    if findings is not None:
        title: Span = "Found, refined and generalised:" if findings else "Nothing singular found."
        lines += ["", page.paragraph(title)]
        lines += [page.paragraph(*finding_spans(f), first="  - ") for f in findings]
    if result.notes:
        lines += ["", "Notes:"]
        lines += [page.paragraph(note, first="  - ") for note in result.notes]
    return "\n".join(lines)


def _swept(result: SweepResult, degrees: bool, room: int) -> Iterator[tuple[Span, ...]]:
    plan = result.plan
    yield (f"sweep of {result.arm.name}: {plan}",)
    at = typed(plan.nominal, result.arm.prismatic, degrees, 9, room=room)
    origin = {
        "given": "as given",
        "pi/3": "60 degrees, as in the paper",
        "random": "the best conditioned of some random ones",
    }.get(plan.nominal_origin, plan.nominal_origin)
    sigma = unbroken(f"sigma_min = {plan.nominal_sigma[-1]:.6g}")
    yield (f"nominal configuration ({origin}): {at}; {sigma}",)
    for row in result.uniform:
        value = unbroken(value_text(row.value))
        yield (
            f"all joints at {value}: {unbroken(f'sigma_min = {row.sigma_min:.3g}')}, ",
            verdict(row.status),
        )
    for fixed in plan.forced:
        condition = unbroken(result.set_text(fixed)).replace(",\u00a0", ", ")
        yield f"{condition}: ", alarm("singular"), " whatever the others"
    if result.summary is not None:
        yield (str(result.summary).replace(" %", "\u00a0%"),)


def curves_of(
    table: CurveTable,
    numbers: npt.ArrayLike,
    x: Array,
    sigma_min: Iterable[Array],
    sigma_ratio: Iterable[Array],
) -> Iterator[SweepCurve]:
    """Curves ``numbers`` (C,) of a table, from their values and those (n, S) of all joints."""
    rows = table.rows(numbers)
    values = zip(rows.numbers.tolist(), sigma_min, sigma_ratio, strict=True)
    for k, (number, last, ratio) in enumerate(values):
        yield SweepCurve(
            level=int(rows.fixed[k].sum()),
            fixed=table.fixed_values(rows, k),
            forced=bool(rows.forced[k]),
            moving=int(rows.moving[k]),
            x=x[rows.moving[k]],
            sigma_min=last,
            sigma_ratio=ratio,
            number=number,
        )


def pack_sweep(result: SweepResult) -> bytes:
    """Bytes of the file that `save_npz` writes."""
    joints = result.arm.joints
    samples = result.plan.samples if result.curves else 0
    fixed = np.full((len(result.curves), len(joints)), np.nan)
    ranges = np.array([e.range for e in result.plan.effects], dtype=float)
    for row, curve in zip(fixed, result.curves, strict=True):
        row[[joints.index(name) for name in curve.fixed]] = list(curve.fixed.values())
    header = replace(result, curves=()).to_dict()
    arrays = {
        "header": np.array(json.dumps(header, allow_nan=False).encode()),
        "number": np.array([c.number for c in result.curves], dtype=np.int64),
        "level": np.array([c.level for c in result.curves], dtype=np.int64),
        "moving": np.array([c.moving for c in result.curves], dtype=np.int64),
        "forced": np.array([c.forced for c in result.curves], dtype=bool),
        "fixed": fixed,
        "x": axis_values(ranges, result.plan.samples, np.arange(samples)[None]),
        "sigma_min": np.array([c.sigma_min for c in result.curves]).reshape(len(fixed), samples),
        "sigma_ratio": np.array([c.sigma_ratio for c in result.curves]).reshape(
            len(fixed), samples
        ),
    }
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)  # type: ignore[arg-type]
    return packed.getvalue()
