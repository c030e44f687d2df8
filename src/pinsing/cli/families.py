"""``pinsing families``, ``analyze``, ``map``, ``verify`` and ``export``: of an arm as a whole.

Closed forms, certificates of them, guards; ``analyze``, with ``--sweep`` or not, and ``map`` over
all of the joints.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pinsing import families, proximity, robot, sampling
from pinsing.cli import STOPPED, completion
from pinsing.cli.mechanism import (
    analyze_loops,
    families_loops,
    map_loops,
)
from pinsing.cli.options import (
    NAMES,
    VECTOR,
    WHOLE,
    JointValues,
    RobotRequest,
    Typed,
    argument,
    arm_options,
    at_joint,
    by_joint,
    chosen_for,
    command,
    deg_option,
    fail_option,
    group,
    ignore_limits_option,
    in_degrees,
    joint_names,
    json_option,
    only_option,
    option,
    parse_numbers,
    verbose_option,
    whole_number,
    written,
    zones_option,
)
from pinsing.cli.output import (
    STDOUT,
    Place,
    emit,
    emit_json,
    emit_json_data,
    put,
    run_place,
    run_progress,
    say,
    stopped,
    waiting,
)
from pinsing.errors import OptionError, RobotFileError
from pinsing.prose import Page

if TYPE_CHECKING:
    from pinsing.families.solve import Prove


RAW_ANGLE_TOL = 1e-10
"""Radians: with --raw, only float noise is taken out of the angles that tests are run on."""


@group
def algebra_options(
    seconds: float | None = option(
        "Time for the answer.  [default: 10, analyze 60, with --loops none]", metavar="S"
    ),
    angle_tol: float | None = option(
        "Angles this close to a multiple of 90 degrees count as exact.  [default: 0.002]",
        metavar="RAD",
    ),
    snap_length: float | None = option(
        "Lengths below this count as zero: noise of the model file.  [default: off]",
        metavar="METRES",
    ),
) -> dict[str, Any]:
    """Options of closed forms that were given."""
    asked = {"seconds": seconds, "angle_tol": angle_tol, "snap_length": snap_length}
    return {name: value for name, value in asked.items() if value is not None}


prove_option = option(
    "Look for a certificate that no family is missing, for up to a minute (or --seconds), or not "
    "at all.  [default: as far as a few seconds lead]",
    "--prove/--no-prove",
    default=None,
    callback=lambda ctx, param, value: "auto" if value is None else value,
)
"""The command gets ``prove`` as `closed_form` takes it."""


def _special(text: str, option: str, degrees: bool | None) -> tuple[float, ...]:
    values = parse_numbers(text, option, degrees)
    return tuple(map(math.radians, values) if degrees else values)


def _levels(text: str, option: str, degrees: bool | None) -> tuple[int, ...]:
    """``1,2`` or ``1-3`` as numbers."""
    found: set[int] = set()
    for part in text.split(","):
        low, dash, high = part.strip().partition("-")
        OptionError.refuse_if(
            not low.isdigit() or (dash and not high.isdigit()),
            f"{option} {text!r} is not of the form 1,2 or 1-3",
        )
        found.update(range(int(low), int(high if dash else low) + 1))
    OptionError.refuse_if(not found, f"{option} {text!r} is empty; write it as 1,2 or 1-3")
    return tuple(sorted(found))


@group
def sweep_options(
    nominal_q: JointValues | None = option(
        "Where joints stay while others are swept.  [default: a regular configuration]", type=VECTOR
    ),
    special: tuple[float, ...] | None = option(
        "Special values of revolute joints.  [default: 0,pi/2,-pi/2,pi,-pi]",
        type=Typed("A,B,...", _special),
    ),
    levels: tuple[int, ...] | None = option(
        "How many joints are held at special values at a time.", type=Typed("1,2 or 1-3", _levels)
    ),
    samples: int | None = option("Points of each swept curve.", type=click.IntRange(min=2)),
    sweep_joints: tuple[str, ...] | None = option(
        "Joints that take part in the sweep.", type=NAMES, shell_complete=completion.joints
    ),
    ignore_limits: bool = ignore_limits_option,
    no_prune: bool = option("Also sweep sets that contain one already found singular."),
    seed: int = option(type=click.IntRange(min=0), default=0),
    raw: bool = option("Everything on the numbers of the file as they are."),
    nominal: bool = option("Everything on the nominal geometry: rounding taken out."),
) -> Callable[[robot.Arm], dict[str, Any]]:
    """What to sweep: of an arm, keyword arguments of `analyze`."""
    OptionError.refuse_if(raw and nominal, "--raw and --nominal exclude each other")

    def chosen(arm: robot.Arm) -> dict[str, Any]:
        given = chosen_for(
            arm,
            special=special,
            levels=levels,
            samples=samples,
            joints=None if sweep_joints is None else joint_names(arm, sweep_joints),
            nominal=nominal_q,
        )
        geometry = "raw" if raw else "nominal" if nominal else "both"
        given |= {"ignore_limits": ignore_limits, "prune": not no_prune, "seed": seed}
        return given | {"geometry": geometry}

    return chosen


@group
def place_options(
    engine: str = option(
        "auto, batch, pinocchio, or an instruction set: baseline, avx2, avx512.",
        default="auto",
        metavar="NAME",
        shell_complete=completion.choices(
            "auto", "batch", "pinocchio", "baseline", "avx2", "avx512"
        ),
    ),
    threads: int | None = option(
        "Threads.  [default: all processors]", type=click.IntRange(min=1), metavar="N"
    ),
    workers: int | None = option(
        "Worker processes instead of threads.", type=click.IntRange(min=1), metavar="N"
    ),
    dask: str | None = option(
        "Run on a dask.distributed cluster: tcp://HOST:PORT.", metavar="ADDRESS"
    ),
) -> Place:
    """Where a run takes place, to be called for a context of its keyword arguments."""
    where = {"threads": threads, "workers": workers, "dask": dask}
    given = [name for name, value in where.items() if value]
    if len(given) > 1:
        raise OptionError(f"--{given[0]} and --{given[1]} exclude each other")
    return functools.partial(run_place, engine, threads, workers, dask)


@command("sweep")
def sweep_command(
    request: RobotRequest = arm_options,
    sweep: Callable[[robot.Arm], dict[str, Any]] = sweep_options,
    no_keep: bool = option("Leave the curves out.  [default: kept up to 64 MiB]"),
    chunk: int | None = option(
        "Jacobians of a chunk, more or less.", type=click.IntRange(min=1), metavar="N"
    ),
    place: Place = place_options,
    deg: bool = deg_option,
    json_target: str | Path | None = written(".json"),
    npz: Path | None = written(".npz"),
    folder: Path | None = written("/"),
    fail_if_singular: bool = fail_option,
) -> int:
    """Sweep the joints of ROBOT level by level (joint-angle parameterization method).

    Every dip of sigma_min is refined to machine accuracy and generalised to the joint values
    that force it, whatever the others are. Takes any number of Jacobians in bounded memory.
    FILE.npz gets the curves of sigma_min; a folder gets each chunk as soon as it is done, and the
    same command resumes a sweep that was stopped or killed, with the same result. Ctrl-C stops
    the sweep and keeps what is done. With --fail-if-singular, exits with 1 if any singularity was
    found within the joint limits.
    """
    OptionError.refuse_if(
        npz is not None and folder is not None,
        f"-o {npz} and -o {folder}: the folder gets the curves already",
    )
    from pinsing.interface import encode
    from pinsing.sampling.execute import ctrl_c_afterwards
    from pinsing.sampling.sweeps import (
        CURVES,
        check_keep,
        plan_sweep,
        run_sweep,
        save_npz,
        sweep_text,
    )

    arm = request.load()
    chosen = sweep(arm)
    geometry = chosen.pop("geometry")
    tests = robot.nominal(arm, **({"angle_tol": RAW_ANGLE_TOL} if geometry == "raw" else {})).arm
    swept = tests if geometry == "nominal" else arm
    plan = plan_sweep(swept, **chosen, geometry=tests)
    say(f"{plan.n_curves} curves, {plan.n_jacobians} Jacobians")
    keep = False if no_keep else None
    if npz is not None:  # a file is asked for its curves
        check_keep(plan, not no_keep)
    result = None
    findings: tuple[sampling.Finding, ...] = ()
    told = False
    try:
        with place() as where, run_progress() as progress, ctrl_c_afterwards():
            result = run_sweep(
                swept, plan, progress, keep=keep, chunk=chunk, out=folder, tell=say, **where
            )
            file = None if npz is None else save_npz(result, npz)
        if file is not None:
            say(f"wrote {file}")
        if folder is not None and result.complete:
            say(f"wrote {folder / CURVES}")
        findings = sampling.singular_configurations(swept, result, geometry=tests)
        told = True
    except KeyboardInterrupt:  # what was swept is an answer without them
        if result is None:
            stopped(folder)
        note = "stopped before the dips were refined and generalised: there are no findings"
        result = replace(result, notes=(*result.notes, note))
    if json_target is None or not emit_json_data(
        {**result.to_dict(), "findings": encode(findings)}, json_target
    ):
        emit(sweep_text(result, findings if told else None, Page.of(), deg))
    if not (told and result.complete):
        stopped(folder)
    met = any(f.status == "singular" and f.reachable is True for f in findings)
    return int(fail_if_singular and met)


@command("analyze", mechanism=analyze_loops)
def analyze_command(
    all_joints: bool = option("With --loops: values of all joints in each mode."),
    request: RobotRequest = arm_options,
    sweep: Callable[[robot.Arm], dict[str, Any]] = sweep_options,
    algebra: dict[str, Any] = algebra_options,
    random_starts: int | None = option(
        "Random starts refined as an independent check.  [default: 300]",
        type=click.IntRange(min=0),
        metavar="N",
    ),
    deg: bool = deg_option,
    json_target: str | Path | None = json_option,
    fail_if_singular: bool = fail_option,
) -> int:
    """Find all singular configurations of ROBOT: closed forms and sweep, checking each other.

    With --fail-if-singular, exits with 1 if any is within the joint limits.
    """
    OptionError.refuse_if(
        all_joints, "--all-joints goes with --loops: a serial arm has no modes to list"
    )
    arm = request.load(quiet=True)  # the result repeats the notes
    chosen = sweep(arm) | algebra | chosen_for(arm, random_starts=random_starts)
    with run_progress() as progress:
        analysis = sampling.analyze(arm, progress=progress, **chosen)
    if not emit_json(analysis, json_target):
        from pinsing.sampling.analyze import analysis_text

        emit(analysis_text(analysis, Page.of(), deg, request.words))
    for problem in analysis.problems:
        say(f"WARNING: {problem}")
    if analysis.missing or not analysis.sweep_complete:
        return STOPPED
    return int(fail_if_singular and analysis.singular)


def _steps(text: str, option: str, degrees: bool | None) -> Any:
    """A number, or a function of an arm: numbers by joint."""
    if "=" not in text:
        return whole_number(text, option)
    parts = [part.partition("=") for part in text.split(",")]
    OptionError.refuse_if(
        not all(name.strip() and equals for name, equals, _ in parts),
        f"{option} {text!r} is not of the form 9 or A=9,B=5",
    )
    found = [(name.strip(), whole_number(number, option)) for name, _, number in parts]

    def each(arm: robot.Arm) -> dict[str, int]:
        joints = joint_names(arm, [name for name, _ in found])
        OptionError.refuse_if(
            len({*joints}) < len(joints), f"{option} {text!r} names a joint twice"
        )
        return dict(zip(joints, (number for _, number in found), strict=True))

    return each


@command("map", mechanism=map_loops)
def map_command(
    request: RobotRequest = arm_options,
    sampling: str = option(
        "sobol, random or grid.",
        default="sobol",
        metavar="NAME",
        shell_complete=completion.choices("sobol", "random", "grid"),
    ),
    measure: str = option(
        "clearance: bounds of the distance to the nearest family too.",
        type=click.Choice(("sigma", "clearance")),
        default="sigma",
    ),
    count: int | None = option("Configurations, such as 1e8.  [default: 2**20]", type=WHOLE),
    steps: Any = option("Values of each joint in a grid.", type=Typed("N|A=N,...", _steps)),
    map_joints: tuple[str, ...] | None = option(
        "Joints to map.  [default: all that matter]", type=NAMES, shell_complete=completion.joints
    ),
    ranges: tuple[Callable[[robot.Arm], Any], ...] = option(
        "Range of a joint instead of its limits; repeatable.",
        "--range",
        type=at_joint("JOINT=LOW,HIGH", 2),
        multiple=True,
        shell_complete=completion.joint_value,
    ),
    q: JointValues | None = option("Where joints that are not mapped stay.", type=VECTOR),
    ignore_limits: bool = ignore_limits_option,
    worst: int | None = option(
        "How many of the smallest ratios to keep.", type=click.IntRange(min=1), metavar="K"
    ),
    seed: int = option(type=click.IntRange(min=0), default=0),
    keep_values: bool = option("Keep all singular values in -o FOLDER too."),
    chunk: int | None = option("Configurations in a chunk.", type=WHOLE),
    place: Place = place_options,
    deg: bool = deg_option,
    json_target: str | Path | None = written(".json"),
    out: Path | None = written("/"),
    fail_if_singular: bool = fail_option,
    over: str | None = option(
        "With --loops: what is drawn at random.  [default: inputs]",
        type=click.Choice(("inputs", "poses")),
    ),
) -> int:
    """Compute how sigma_r of ROBOT is distributed over its joints, and where it is smallest.

    Takes any number of configurations in bounded memory. With -o FOLDER each finished chunk is
    kept, and the same command resumes a run that was stopped or killed, with the same result.
    With --fail-if-singular, exits with 1 if a configuration is singular. With --loops: of a
    mechanism, at inputs or poses of its output drawn at random (--count, --seed, --worst,
    --ignore-limits).
    """
    OptionError.refuse_if(over, "--over goes with --loops: an arm is mapped over its joints")
    OptionError.refuse_if(
        keep_values and out is None, "--keep-values needs a folder to keep them in: give -o FOLDER"
    )
    arm = request.load()
    chosen = chosen_for(
        arm,
        count=count,
        steps=steps,
        joints=None if map_joints is None else joint_names(arm, map_joints),
        ranges=by_joint(arm, ranges, "--range") or None,
        q=q,
        worst=worst,
        chunk=chunk,
        out=out,
    )
    chosen |= {"ignore_limits": ignore_limits, "seed": seed, "keep_values": keep_values}
    from pinsing.sampling import sigma_map
    from pinsing.sampling.execute import ctrl_c_afterwards

    result = None
    try:
        with place() as where, run_progress() as progress, ctrl_c_afterwards():
            result = sigma_map(
                arm, sampling, measure=measure, **chosen, **where, progress=progress, tell=say
            )
    except KeyboardInterrupt:  # what is complete is told, however late that came
        if result is None:
            stopped(out)
    if not emit_json(result, json_target):
        emit(result.text(Page.of(), in_degrees(deg)))
    if not result.complete:
        stopped(out)
    return int(fail_if_singular and result.singular > 0)


@command("families", mechanism=families_loops)
def families_command(
    request: RobotRequest = arm_options,
    verbose: bool = verbose_option,
    latex: bool = option("Equations as LaTeX."),
    exact: bool = option("Exact coefficients, up to a factor. (The JSON always has them.)"),
    symbolic: str | None = option(
        "Keep lengths as symbols: those named, or all that are not zero. Of a DH table they are "
        "a1, d1, a2, ..., and twists alpha1, ... can be named, too; else they are named after the "
        "joints.",
        is_flag=False,
        flag_value="all",
        metavar="[A2,D4,...]",
    ),
    algebra: dict[str, Any] = algebra_options,
    prove: Prove = prove_option,
    chosen: tuple[str, ...] = option(
        "With -o FILE.sing: only this family; repeatable.",
        "--family",
        multiple=True,
        metavar="NAME",
    ),
    deg: bool = deg_option,
    json_target: str | Path | None = written(".json"),
    certificate: Path | None = written(".cert.json"),
    system: Path | None = written(".sing .ms .mpl .sage"),
    fail_if_singular: bool = fail_option,
) -> int:
    """Find every family of singular configurations of ROBOT, as equations.

    "proven": an independent checker accepted a certificate of completeness. "probable": verified
    probabilistically (finite-field sampling). "NOT complete": says what is missing. The answer
    comes first, a proof that takes longer than a second or two after it.

    With -o, FILE.cert.json is the certificate, which `pinsing verify` checks (implies --prove);
    the equations go to FILE.sing for Singular, .ms for msolve, .mpl for Maple, .sage for Sage.

    With --loops, --prove looks at each leg of the mechanism as an arm (type 1 is a question about
    one leg), and NAME.cert.json stands for NAME_leg1.cert.json, NAME_leg2.cert.json and so on.

    With --fail-if-singular, exits with 1 if any family is reachable within the joint limits.
    """
    OptionError.refuse_if(
        certificate is not None and prove is False,
        "-o FILE.cert.json and --no-prove exclude each other",
    )
    OptionError.refuse_if(
        chosen and system is None,
        "--family goes with -o FILE.sing: it says which equations are written",
    )
    if symbolic is not None:
        OptionError.refuse_if(
            certificate is not None or prove is True or system is not None,
            "--symbolic has no --prove, certificate or file of equations: they need numbers",
        )
        bare = families.closed_form(request.load(), symbols=symbolic, **algebra)
        if json_target is None or not emit_json(bare, json_target):
            emit("\n".join(f.latex for f in bare.families) if latex else str(bare))
        return int(fail_if_singular and bool(bare.families))
    arm = request.load()
    from pinsing.families.certificate import LONG, text_of
    from pinsing.families.form import answer_text, certainty, families_text

    def written(form: families.ClosedForm, undecided: bool = False) -> str:
        if latex:
            return form.latex(legend=True, exact=exact)
        details = families_text(form, Page.of(), in_degrees(deg), exact=exact, undecided=undecided)
        if undecided:
            return details
        answer = answer_text(form, Page.of(), request.words)
        return f"{answer}\n\n{details}" if verbose or exact else answer

    long = prove is True or certificate is not None
    with waiting() as step:
        step("looking for families")
        found = families.closed_form(arm, **algebra, prove=prove and "auto")
    again = long and found.word != "proven"
    if json_target is None:
        emit(written(found, undecided=again))
    if again:
        with waiting() as step:
            told = functools.partial(step, "looking for a certificate")
            told()
            found = families.prove(found, algebra.get("seconds", LONG), told)
    if json_target is not None:
        if not emit_json(found, json_target):
            emit(written(found))
    elif again and not latex:
        emit(certainty(found, Page.of()))
    if certificate is not None:
        if found.certificate is None:
            reason = found.proof.reason if found.proof else ""
            raise OptionError(f"no certificate to write: {reason}")
        put(text_of(found.certificate) + "\n", certificate)
    if system is not None:
        from pinsing.families.system import language_of, system_text

        language = language_of(system)
        text, remarks = system_text(found, language, chosen or None)
        if language == "msolve":  # whose files have no comments
            for line in remarks:
                say(line.strip())
        put(text, system)
    return int(fail_if_singular and any(f.is_reachable for f in found.families))


@command("verify")
def verify_command(
    files: tuple[Path, ...] = argument(
        metavar="FILE.cert.json...", nargs=-1, required=True, type=click.Path(path_type=Path)
    ),
    seconds: float = option(
        "Time for each file.", type=click.FloatRange(min=0, min_open=True), default=60.0
    ),
) -> int:
    """Check certificates that `pinsing families ROBOT -o FILE.cert.json` wrote.

    Exits with 0 if the checker accepts all of them, with 1 if it rejects one or is not done in
    time, and says why in one line each. The checker is pinsing/proof/checker.py, which also runs
    alone: it imports nothing of pinsing.
    """
    results = [_verified(file, seconds) for file in files]
    for file, (_, text) in zip(files, results, strict=True):
        emit(text if len(files) == 1 else f"{file}: {text}")
    return 0 if all(accepted for accepted, _ in results) else 1


def _verified(file: Path, seconds: float) -> tuple[bool, str]:
    """Return whether a file is accepted, and what is said of it."""
    from pinsing.algebra.budget import Budget, BudgetExceeded, in_child
    from pinsing.proof.checker import LONGEST_FILE, Rejected, statement, verify

    started = time.perf_counter()
    try:
        with file.open(encoding="utf-8") as stream:
            text = stream.read(LONGEST_FILE + 1)
        data = in_child(lambda: verify(text), Budget(seconds), seconds)
    except OSError as error:
        made = f"; pinsing families {file} -o FILE.cert.json writes one" * (not file.suffix)
        raise RobotFileError(f"{error.strerror or 'cannot be read'}{made}", file) from None
    except UnicodeDecodeError:
        return False, "rejected: the file is no text"
    except Rejected as reason:
        made = "; pinsing families ROBOT -o FILE.cert.json writes one"
        return False, f"rejected: {reason}{made * str(reason).startswith('malformed')}"
    except BudgetExceeded:
        return False, f"not verified within {seconds:g} s, or the memory that is allowed"
    took = 1e3 * (time.perf_counter() - started)
    return True, f"proven ({len(text) / 1e3:.1f} kB, checked in {took:.0f} ms): {statement(data)}"


@command("export", needs_output=True)
def export_command(
    request: RobotRequest = arm_options,
    only: tuple[str, ...] = only_option,
    prefix: str | None = option(
        "What names in C begin with.  [default: the robot's name]", metavar="NAME"
    ),
    seconds: float | None = option("Time for the closed form.  [default: 10]", metavar="S"),
    zones: proximity.Zones | None = zones_option,
    prove: Prove = prove_option,
    c: str | Path | None = written(".h .c"),
    python: str | Path | None = written(".py"),
) -> None:
    """Write the singular families of ROBOT as one file without dependencies.

    It tells a control loop how far a configuration is from all of them, proven, rounding
    included: f, gradient and lower bound of each family. The file says how sure it is that
    no family is missing: proven, probable or not complete. FILE.h is a C99 header, FILE.py a
    module that needs NumPy alone. With -o FILE.urdf, ROBOT is a DH table to convert.

    Example: pinsing export ur5 -o guard.h -o guard.py
    """
    OptionError.refuse_if(c == python == STDOUT, "-o -.h and -o -.py both go to standard output")
    arm = request.load()
    from pinsing.proximity.monitor import make_guard

    with waiting() as step:
        step("looking for families")
        form = families.closed_form(arm, seconds=seconds, prove=prove)
    asked = only or None
    made = {
        language: (
            target,
            make_guard(arm, language, forms=form, families=asked, prefix=prefix, zones=zones),
        )
        for language, target in (("c", c), ("python", python))
        if target is not None
    }
    _, guard = next(iter(made.values()))
    for note in guard.notes:
        say(f"note: {note}")
    if not guard.complete:
        say("note: nothing is ever clear to this guard: its clearance is always 0")
    if guard.word.startswith("probable") and prove is False:
        say("note: --prove looks for a certificate for up to a minute")
    for target, one in made.values():
        put(one.text, target)
