"""``pinsing analyze``, ``pinsing sweep`` and ``pinsing families``: all singular configurations."""

from __future__ import annotations

import contextlib
import functools
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    deg_option,
    fail_option,
    joint_vector,
    json_option,
    parse_numbers,
)
from pinsing.cli.output import STOPPED, OutputFile, emit, emit_json, emit_json_data, say
from pinsing.errors import OptionError
from pinsing.report.text import is_rich

if TYPE_CHECKING:
    from pinsing.robot.arm import Arm

F = TypeVar("F", bound=Callable[..., Any])


def sweep_options(command: F) -> F:
    """Add the options of the sweep; they reach the command as keyword arguments of `sweep`."""

    @click.option(
        "--nominal-q",
        metavar="Q1,Q2,...",
        help="Configuration that joints rest at while others are swept; found if not given.",
    )
    @click.option(
        "--special",
        metavar="A,B,...",
        help="Special values of revolute joints.  [default: 0,pi/2,-pi/2,pi,-pi]",
    )
    @click.option(
        "--levels",
        metavar="1,2 or 1-3",
        help="How many joints are held at special values at a time.",
    )
    @click.option("--samples", type=click.IntRange(min=2), help="Points of each swept curve.")
    @click.option("--sweep-joints", metavar="A,B,...", help="Joints that take part in the sweep.")
    @click.option("--ignore-limits", is_flag=True, help="Sweep whole circles.")
    @click.option(
        "--no-prune", is_flag=True, help="Also sweep sets that contain one already singular."
    )
    @click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
    @functools.wraps(command)
    def wrapper(
        request: RobotRequest,
        nominal_q: str | None,
        special: str | None,
        levels: str | None,
        samples: int | None,
        sweep_joints: str | None,
        ignore_limits: bool,
        no_prune: bool,
        seed: int,
        deg: bool,
        **rest: Any,
    ) -> Any:
        # All that can be wrong without the robot is found before it is read.
        chosen: dict[str, Any] = {
            "ignore_limits": ignore_limits,
            "prune": not no_prune,
            "seed": seed,
        }
        if special is not None:
            values = parse_numbers(special, "--special", deg)
            factor = 3.141592653589793 / 180 if deg else 1.0
            chosen["special"] = tuple(value * factor for value in values)
        if levels is not None:
            chosen["levels"] = _levels(levels)
        if samples is not None:
            chosen["samples"] = samples
        if sweep_joints is not None:
            chosen["joints"] = tuple(s.strip() for s in sweep_joints.split(",") if s.strip())
        if nominal_q is not None:
            parse_numbers(nominal_q, "--nominal-q", deg)
        arm = request.load()
        if nominal_q is not None:
            chosen["nominal"] = joint_vector(arm, nominal_q, "--nominal-q", deg)
        return command(arm, chosen, deg=deg, **rest)

    return wrapper  # type: ignore[return-value]


def _levels(text: str) -> tuple[int, ...]:
    """``1,2`` or ``1-3`` as numbers."""
    found: set[int] = set()
    for part in text.split(","):
        low, dash, high = part.strip().partition("-")
        if not low.isdigit() or (dash and not high.isdigit()):
            raise OptionError(f"--levels {text!r} is not of the form 1,2 or 1-3")
        found.update(range(int(low), int(high if dash else low) + 1))
    if not found:
        raise OptionError(f"--levels {text!r} is empty; write it as 1,2 or 1-3")
    return tuple(sorted(found))


@contextlib.contextmanager
def _progress_bar() -> Iterator[Callable[[int, int], None] | None]:
    """Callback ``(done, total)`` that draws a bar on stderr, or None where nobody looks."""
    if not is_rich(sys.stderr):
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("Jacobians", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


@click.command("sweep", short_help="The joint-angle parameterization method.")
@arm_options
@sweep_options
@click.option(
    "--out",
    type=OutputFile(dash=False),
    metavar="FILE.npz",
    help="Keep the curves of sigma_min, as NumPy arrays.",
)
@deg_option
@json_option
@fail_option
def sweep_command(
    arm: Arm,
    chosen: dict[str, Any],
    deg: bool,
    out: Path | None,
    json_target: str | Path | None,
    fail_if_singular: bool,
) -> int:
    """The joint-angle parameterization method on ROBOT, level by level.

    Every dip of sigma_min is refined to machine accuracy and generalised: the joint values
    that force it, whatever the others. Ctrl-C stops the sweep and keeps what is done. With
    --fail-if-singular, exits with 1 if any singularity was found within the joint limits.
    """
    from pinsing.find import singular_configurations
    from pinsing.result import encode
    from pinsing.sweep import run_sweep
    from pinsing.sweep_file import save_npz
    from pinsing.sweep_plan import plan_sweep

    plan = plan_sweep(arm, **chosen)
    say(f"{plan.n_curves} curves, {plan.n_jacobians} Jacobians")
    with _progress_bar() as progress:
        result = run_sweep(arm, plan, progress)
    if out is not None:
        say(f"wrote {save_npz(result, out)}")
    findings = singular_configurations(arm, result)
    data = {**result.to_dict(), "findings": encode(findings)}
    if not emit_json_data(data, json_target):
        emit(str(result))
        emit("\nfound, refined and generalised:" if findings else "\nfound nothing singular")
        for finding in findings:
            emit(f"  {finding}")
    if not result.complete:
        return STOPPED
    met = any(f.status == "singular" and f.reachable is True for f in findings)
    return int(fail_if_singular and met)


@click.command("analyze", short_help="Find all singular configurations.")
@arm_options
@sweep_options
@deg_option
@json_option
@fail_option
def analyze_command(
    arm: Arm,
    chosen: dict[str, Any],
    deg: bool,
    json_target: str | Path | None,
    fail_if_singular: bool,
) -> int:
    """Find all singular configurations of ROBOT: closed forms and sweep, checking each other.

    With --fail-if-singular, exits with 1 if any is within the joint limits.
    """
    from pinsing.analysis import analyze

    with _progress_bar() as progress:
        analysis = analyze(arm, progress=progress, **chosen)
    if not emit_json(analysis, json_target):
        emit(str(analysis))
    return int(fail_if_singular and analysis.singular)


@click.command("families", short_help="All families as equations.")
@arm_options
@click.option("--latex", is_flag=True, help="Equations as LaTeX.")
@click.option("--seconds", type=float, metavar="S", help="Time for the algebra.  [default: 10]")
@click.option(
    "--snap-length",
    type=float,
    metavar="METRES",
    help="Take shorter lengths for zero: noise of the model file.  [default: off]",
)
@json_option
@fail_option
def families_command(
    request: RobotRequest,
    latex: bool,
    seconds: float | None,
    snap_length: float | None,
    json_target: str | Path | None,
    fail_if_singular: bool,
) -> int:
    """Closed forms: every family of singular configurations of ROBOT, as equations.

    With --fail-if-singular, exits with 1 if any family is reachable within the joint limits.
    """
    arm = request.load()
    from pinsing.closed_form import closed_form
    from pinsing.report.families import families_latex, families_text

    asked = {"seconds": seconds, "snap_length": snap_length}
    found = closed_form(arm, **{k: v for k, v in asked.items() if v is not None})
    if not emit_json(found, json_target):
        emit(families_latex(found) if latex else families_text(found))
    return int(fail_if_singular and any(f.is_reachable for f in found.families))
