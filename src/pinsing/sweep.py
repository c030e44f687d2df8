"""The paper's joint-angle parameterization method: run the plan, keep every distribution.

One, two, three, ... joints at special values while each remaining joint runs over its range
and the rest stay at the nominal configuration (paper, Section 3.2, steps (1) to (4)).
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from pinsing.chunks import finished_chunks, local_threads
from pinsing.condition import value_text
from pinsing.durable import Record, open_run, recorded
from pinsing.errors import OptionError, UnknownNameError
from pinsing.evaluate import Evaluator, evaluator, recorded_engine
from pinsing.measures import sigma_ratio
from pinsing.refine import Status, status_of
from pinsing.result import JsonResult
from pinsing.robot.arm import Arm, Array
from pinsing.robot.summary import ArmSummary
from pinsing.sweep_job import SweepJob, curve_axes, curve_specs, curves_per_chunk
from pinsing.sweep_plan import SAMPLES, SweepPlan, plan_sweep
from pinsing.sweep_values import SPECIAL_ANGLES, Special

Progress = Callable[[int, int], object]
"""Called with the number of Jacobians done, and of all, after each chunk."""

_CHUNK, _CHUNK_ON_DISK = 16_384, 65_536  # configurations: some ms of work, 1 MB of file


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


def run_sweep(
    arm: Arm,
    plan: SweepPlan,
    progress: Progress | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    engine: str = "auto",
    threads: int | None = None,
    executor: Executor | None = None,
    parallel: int | None = None,
    tell: Callable[[str], object] | None = None,
) -> SweepResult:
    """Run a plan that was made for ``arm``.

    The result does not depend on threads or executor, to the last bit.

    Parameters
    ----------
    arm, plan
        What to do.
    progress : callable, optional
        As for `sweep`.
    out : path-like, optional
        Folder that finished curves are put in. A run that was stopped, or killed, goes on when
        called again.
    engine : str
        ``auto``, ``batch``, ``pinocchio``, or an instruction set (``baseline``, ``avx2``,
        ``avx512``). A run that goes on keeps the one it began with.
    threads : int, optional
        As many as the process may use by default.
    executor : Executor, optional
        Takes the curves instead of threads: any ``concurrent.futures.Executor``.
    parallel : int, optional
        How many chunks it works on at once; the number of processors here by default.
    tell : callable, optional
        Called with sentences for people: how much was there already, what was damaged.

    Raises
    ------
    EngineError, OutputError, WorkerError
        As `pinsing.maps.sigma_map`.
    """
    if executor is not None and threads is not None:
        raise OptionError("give either threads or an executor, not both")
    known = None if out is None else recorded(out)
    size = curves_per_chunk(plan.samples, _CHUNK if out is None else _CHUNK_ON_DISK)
    fixed = evaluator(arm, recorded_engine(known, engine))
    job = SweepJob(plan, fixed, curve_specs(plan), size)
    uniform = _uniform(fixed, plan)
    found: dict[int, Record] = {}
    notes = list(plan.notes)
    done = 0
    with contextlib.ExitStack() as stack:
        folder = None
        if out is not None:
            folder = stack.enter_context(open_run(out, job.identity(), job.chunks))
        if executor is None:
            executor, parallel = stack.enter_context(local_threads(threads))
        chunks = stack.enter_context(
            contextlib.closing(finished_chunks(job, executor, folder, parallel, tell))
        )
        try:
            for index, record in chunks:
                found[index] = record
                done += len(job.span(index))
                if progress is not None:
                    progress(len(uniform) + done * plan.samples, plan.n_jacobians)
        except KeyboardInterrupt:
            notes.append(f"stopped after {done} of {len(job.specs)} curves")
    complete = done == len(job.specs)
    return SweepResult(plan, uniform, _curves(arm, job, found), complete, tuple(notes))


def _curves(arm: Arm, job: SweepJob, found: Mapping[int, Record]) -> tuple[SweepCurve, ...]:
    """Curves of the chunks that are done, in the order of the plan."""
    x = curve_axes(job.plan)
    curves = []
    for index in sorted(found):
        record = found[index]
        for k, number in enumerate(job.span(index)):
            spec = job.specs[number]
            curves.append(
                SweepCurve(
                    level=len(spec.joints),
                    fixed={arm.joints[j]: v for j, v in zip(spec.joints, spec.values, strict=True)},
                    forced=spec.forced,
                    moving=spec.moving,
                    x=x[spec.moving],
                    sigma_min=record["sigma_min"][k].astype(np.float64),
                    sigma_ratio=record["sigma_ratio"][k].astype(np.float64),
                )
            )
    return tuple(curves)


def _uniform(evaluator: Evaluator, plan: SweepPlan) -> tuple[UniformRow, ...]:
    if not len(plan.uniform):
        return ()
    sigma = evaluator.sigma(plan.uniform)
    return tuple(
        UniformRow(float(value), float(last), float(ratio), status_of(float(ratio)))
        for value, last, ratio in zip(
            plan.uniform_values, sigma[:, -1], sigma_ratio(sigma), strict=True
        )
    )
