"""The paper's joint-angle parameterization method: run the plan, keep every distribution.

One, two, three, ... joints at special values while each remaining joint runs over its range
and the rest stay at the nominal configuration (paper, Section 3.2, steps (1) to (4)).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing.condition import value_text
from pinsing.errors import OptionError, UnknownNameError
from pinsing.kinematics import singular_values
from pinsing.measures import sigma_ratio
from pinsing.refine import Status, status_of
from pinsing.result import JsonResult
from pinsing.robot.arm import Arm, Array
from pinsing.robot.summary import ArmSummary
from pinsing.sweep_plan import NOT_ASKED, SAMPLES, SweepPlan, plan_sweep
from pinsing.sweep_values import SPECIAL_ANGLES, Special

Progress = Callable[[int, int], object]
"""Called with the number of Jacobians done, and of all, after each chunk."""

_CHUNK = 16_384  # configurations a batch: some 10 MB


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
    """

    level: int
    fixed: Mapping[str, float]
    forced: bool
    moving: int
    x: Array
    sigma_min: Array
    sigma_ratio: Array


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
class SweepResult(JsonResult):
    """All that a sweep has computed.

    Attributes
    ----------
    plan : SweepPlan
        What was asked for.
    uniform : tuple of UniformRow
        All joints at each special value.
    curves : tuple of SweepCurve
        In the order of the plan.
    complete : bool
        False if the sweep was stopped.
    notes : tuple of str
        The notes of the plan, and what happened on the way.
    """

    schema: ClassVar[str] = "pinsing/sweep/1"

    plan: SweepPlan
    uniform: tuple[UniformRow, ...]
    curves: tuple[SweepCurve, ...]
    complete: bool
    notes: tuple[str, ...]

    @property
    def arm(self) -> ArmSummary:
        """The arm that was swept."""
        return self.plan.arm

    def curve(self, fixed: Mapping[str, float] | None, moving: str | int) -> SweepCurve:
        """Look up the curve of joint ``moving`` with ``fixed`` at special values.

        Parameters
        ----------
        fixed : mapping of str to float
            Radians or metres; values of revolute joints up to whole turns. Empty for level 0.
        moving : str or int
            Name or index of the joint.

        Raises
        ------
        UnknownNameError
            If a joint does not exist.
        OptionError
            If there is no such curve.
        """
        names = self.arm.joints
        wanted = dict(fixed or {})
        for name in (*wanted, *([moving] if isinstance(moving, str) else [])):
            if name not in names:
                raise UnknownNameError("joint", name, names)
        index = names.index(moving) if isinstance(moving, str) else int(moving)
        for curve in self.curves:
            if curve.moving == index and self._same(curve.fixed, wanted):
                return curve
        raise OptionError(
            f"there is no curve of {names[index]} with {self.set_text(wanted) or 'no joint fixed'}"
            ": outside the plan, or left out because a part of it is singular already"
        )

    def set_text(self, fixed: Mapping[str, float]) -> str:
        """Such as ``q2 = 0, q3 = 90 deg``."""
        sliding = dict(zip(self.arm.joints, self.arm.prismatic, strict=True))
        return ", ".join(f"{n} = {value_text(v, bool(sliding[n]))}" for n, v in fixed.items())

    def _same(self, one: Mapping[str, float], other: Mapping[str, float]) -> bool:
        if set(one) != set(other):
            return False
        sliding = dict(zip(self.arm.joints, self.arm.prismatic, strict=True))
        turns = np.array([0.0 if sliding[n] else one[n] - other[n] for n in one])
        shifts = np.array([one[n] - other[n] if sliding[n] else 0.0 for n in one])
        turns -= 2 * np.pi * np.round(turns / (2 * np.pi))
        return bool((np.abs(turns) < 1e-9).all() and (np.abs(shifts) < 1e-9).all())

    def __str__(self) -> str:
        plan = self.plan
        nominal = ", ".join(
            f"{name} = {x:.6g}" for name, x in zip(self.arm.joints, plan.nominal, strict=True)
        )
        lines = [
            f"sweep of {self.arm.name}: {plan}",
            f"nominal configuration ({plan.nominal_origin}): {nominal}; "
            f"sigma_min = {plan.nominal_sigma[-1]:.6g}",
        ]
        lines += [
            f"all joints at {value_text(row.value)}: sigma_min = {row.sigma_min:.3g}, {row.status}"
            for row in self.uniform
        ]
        lines += [f"{self.set_text(fixed)}: singular whatever the others" for fixed in plan.forced]
        lines += [f"note: {note}" for note in self.notes]
        return "\n".join(lines)


def sweep(
    arm: Arm,
    nominal: npt.ArrayLike | None = None,
    special: Special = SPECIAL_ANGLES,
    levels: int | Iterable[int] | None = None,
    samples: int = SAMPLES,
    joints: Sequence[str] | None = None,
    ignore_limits: bool = False,
    prune: bool = True,
    progress: Progress | None = None,
    seed: int = 0,
    geometry: Arm | None = None,
) -> SweepResult:
    """Sweep an arm the paper's way, level by level.

    Parameters
    ----------
    arm : Arm
        Any arm; the curves are of its own (raw) geometry.
    nominal : (n,) array_like, optional
        Configuration that the joints rest at, radians or metres; found if not given: pi/3 for
        all revolute joints (the paper's choice) if that will do.
    special : sequence of float, or mapping of joint names to such
        Special values of the revolute joints, radians, or of single joints. Prismatic joints
        take 0 and the middle of their range.
    levels : int or iterable of int, optional
        How many joints are at special values at once; an int means 1 up to it. 1 and 2 by
        default, up to n - 1.
    samples : int
        Points of a curve.
    joints : sequence of str, optional
        Joints that take part; all that change sigma_min by default.
    ignore_limits : bool
        Sweep whole circles.
    prune : bool
        Leave out sets that contain one that is singular whatever the others. False keeps
        everything, as the paper's figures do.
    progress : callable, optional
        Called with (Jacobians done, all of them).
    seed : int
        Of all random values.
    geometry : Arm, optional
        Geometry for the tests whether a set is singular whatever the others, instead of the
        nominal geometry of ``arm``.

    Returns
    -------
    SweepResult
        After Ctrl-C, what was done until then, with ``complete`` False.

    Raises
    ------
    ConfigurationError, OptionError, UnknownNameError
        As ``plan_sweep``.
    """
    plan = plan_sweep(
        arm, nominal, special, levels, samples, joints, ignore_limits, prune, seed, geometry
    )
    return run_sweep(arm, plan, progress)


def run_sweep(arm: Arm, plan: SweepPlan, progress: Progress | None = None) -> SweepResult:
    """Run a plan that was made for ``arm``."""
    uniform = _uniform(arm, plan)
    jobs = _jobs(plan)
    x = {i: np.linspace(e.range[0], e.range[1], plan.samples) for i, e in enumerate(plan.effects)}
    size = max(1, _CHUNK // plan.samples)
    curves: list[SweepCurve] = []
    notes = list(plan.notes)
    try:
        for start in range(0, len(jobs), size):
            chunk = jobs[start : start + size]
            Q = np.tile(plan.nominal, (len(chunk), plan.samples, 1))
            for row, job in zip(Q, chunk, strict=True):
                row[:, list(job.joints)] = job.values
                row[:, job.moving] = x[job.moving]
            sigma = singular_values(arm, Q.reshape(-1, arm.n))
            sigma = sigma.reshape(len(chunk), plan.samples, -1)
            ratio = sigma_ratio(sigma)
            curves += [
                SweepCurve(
                    level=len(job.joints),
                    fixed={arm.joints[j]: v for j, v in zip(job.joints, job.values, strict=True)},
                    forced=job.forced,
                    moving=job.moving,
                    x=x[job.moving],
                    sigma_min=sigma[k, :, -1],
                    sigma_ratio=ratio[k],
                )
                for k, job in enumerate(chunk)
            ]
            if progress is not None:
                progress(len(uniform) + len(curves) * plan.samples, plan.n_jacobians)
    except KeyboardInterrupt:
        notes.append(f"stopped after {len(curves)} of {len(jobs)} curves")
    return SweepResult(plan, uniform, tuple(curves), len(curves) == len(jobs), tuple(notes))


@dataclass(frozen=True)
class _Job:
    joints: tuple[int, ...]
    values: tuple[float, ...]
    forced: bool
    moving: int


def _jobs(plan: SweepPlan) -> list[_Job]:
    """All curves of a plan: first each joint from the nominal configuration, then by level."""
    jobs = [_Job((), (), False, i) for i, e in enumerate(plan.effects) if e.reason != NOT_ASKED]
    for level in plan.levels:
        if not level.swept:
            continue
        rows = zip(level.joints.tolist(), level.values.tolist(), level.forced.tolist(), strict=True)
        for joints, values, forced in rows:
            jobs += [_Job(tuple(joints), tuple(values), forced, m) for m in plan.moving(joints)]
    return jobs


def _uniform(arm: Arm, plan: SweepPlan) -> tuple[UniformRow, ...]:
    if not len(plan.uniform):
        return ()
    sigma = singular_values(arm, plan.uniform)
    return tuple(
        UniformRow(float(value), float(last), float(ratio), status_of(float(ratio)))
        for value, last, ratio in zip(
            plan.uniform_values, sigma[:, -1], sigma_ratio(sigma), strict=True
        )
    )
