"""``pinsing families``, ``verify`` and ``export``: closed forms, certificates of them, guards."""

from __future__ import annotations

import functools
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pinsing.cli.mechanism import families_loops, loops_option
from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    command,
    deg_option,
    fail_option,
    in_degrees,
    output_option,
    verbose_option,
)
from pinsing.cli.output import STDOUT, emit, emit_json, put, say
from pinsing.cli.running import waiting
from pinsing.cli.singularities import algebra_options, prove_option
from pinsing.cli.zones import zones_option
from pinsing.errors import OptionError, RobotFileError
from pinsing.prose import Page

if TYPE_CHECKING:
    from pinsing.families import ClosedForm
    from pinsing.families.solve import Prove
    from pinsing.proximity.zones import Zones


@command("families")
@loops_option(families_loops)
@arm_options
@verbose_option
@click.option("--latex", is_flag=True, help="Equations as LaTeX.")
@click.option(
    "--exact", is_flag=True, help="Exact coefficients, up to a factor. (The JSON always has them.)"
)
@click.option(
    "--symbolic",
    is_flag=False,
    flag_value="all",
    metavar="[A2,D4,...]",
    help="Keep lengths as symbols: those named, or all that are not zero. Of a DH table they are "
    "a1, d1, a2, ..., and twists alpha1, ... can be named, too; else they are named after the "
    "joints.",
)
@algebra_options
@prove_option
@click.option(
    "--family",
    "chosen",
    multiple=True,
    metavar="NAME",
    help="With -o FILE.sing: only this family; repeatable.",
)
@deg_option
@output_option(json_target=".json", certificate=".cert.json", system=".sing .ms .mpl .sage")
@fail_option
def families_command(
    request: RobotRequest,
    verbose: bool,
    latex: bool,
    exact: bool,
    symbolic: str | None,
    deg: bool,
    algebra: dict[str, Any],
    prove: Prove,
    certificate: Path | None,
    system: Path | None,
    chosen: tuple[str, ...],
    json_target: str | Path | None,
    fail_if_singular: bool,
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
        return _symbolic(request, symbolic, latex, algebra, json_target, fail_if_singular)
    arm = request.load()
    from pinsing.families import closed_form, prove as add_proof
    from pinsing.families.certificate import LONG
    from pinsing.families.form import answer_text, certainty, families_text

    def written(form: ClosedForm, undecided: bool = False) -> str:
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
        found = closed_form(arm, **algebra, prove=prove and "auto")
    again = long and found.word != "proven"
    if json_target is None:
        emit(written(found, undecided=again))
    if again:
        with waiting() as step:
            told = functools.partial(step, "looking for a certificate")
            told()
            found = add_proof(found, algebra.get("seconds", LONG), told)
    if json_target is not None:
        if not emit_json(found, json_target):
            emit(written(found))
    elif again and not latex:
        emit(certainty(found, Page.of()))
    if certificate is not None:
        _write(found.certificate, found.proof.reason if found.proof else "", certificate)
    if system is not None:
        _write_system(found, chosen, system)
    return int(fail_if_singular and any(f.is_reachable for f in found.families))


def _symbolic(
    request: RobotRequest,
    symbols: str,
    latex: bool,
    algebra: dict[str, Any],
    json_target: str | Path | None,
    fail_if_singular: bool,
) -> int:
    """Families with lengths as symbols."""
    from pinsing.families import closed_form

    found = closed_form(request.load(), symbols=symbols, **algebra)
    if json_target is None or not emit_json(found, json_target):
        emit("\n".join(f.latex for f in found.families) if latex else str(found))
    return int(fail_if_singular and bool(found.families))


def _write_system(form: ClosedForm, chosen: tuple[str, ...], path: Path) -> None:
    from pinsing.families.system import language_of, system_text

    language = language_of(path)
    text, remarks = system_text(form, language, chosen or None)
    if language == "msolve":  # whose files have no comments
        for line in remarks:
            say(line.strip())
    put(text, path)


def _write(data: dict[str, Any] | None, reason: str, path: Path) -> None:
    from pinsing.families.certificate import text_of

    if data is None:
        raise OptionError(f"no certificate to write: {reason}")
    put(text_of(data) + "\n", path)


@command("verify")
@click.argument(
    "files", metavar="FILE.cert.json...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
@click.option(
    "--seconds",
    type=click.FloatRange(min=0, min_open=True),
    default=60.0,
    show_default=True,
    help="Time for each file.",
)
def verify_command(files: tuple[Path, ...], seconds: float) -> int:
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


@command("export")
@arm_options
@click.option(
    "--family", "families", multiple=True, metavar="NAME", help="Only this family; repeatable."
)
@click.option(
    "--prefix", metavar="NAME", help="What names in C begin with.  [default: the robot's name]"
)
@click.option("--seconds", type=float, metavar="S", help="Time for the closed form.  [default: 10]")
@zones_option
@prove_option
@output_option(required=True, c=".h .c", python=".py")
def export_command(
    request: RobotRequest,
    c: str | Path | None,
    python: str | Path | None,
    families: tuple[str, ...],
    prefix: str | None,
    seconds: float | None,
    zones: Zones | None,
    prove: Prove,
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
    from pinsing.families import closed_form
    from pinsing.proximity.guard import make_guard

    with waiting() as step:
        step("looking for families")
        form = closed_form(arm, seconds=seconds, prove=prove)
    asked = families or None
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
