"""``pinsing export``: a guard for a control loop."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pinsing.atomic_write import write_text
from pinsing.cli.grouped import command
from pinsing.cli.options import RobotRequest, arm_options
from pinsing.cli.output import STDOUT, OutputFile, say
from pinsing.cli.singularities import prove_option
from pinsing.cli.waiting import waiting
from pinsing.errors import OptionError

if TYPE_CHECKING:
    from pinsing.families.solve import Prove


@command("export")
@arm_options
@click.option(
    "--c", "c", type=OutputFile(), metavar="FILE.h|-", help="Write a C99 header; - for stdout."
)
@click.option(
    "--python",
    "python",
    type=OutputFile(),
    metavar="FILE.py|-",
    help="Write a Python module that needs NumPy alone; - for stdout.",
)
@click.option(
    "--family", "families", multiple=True, metavar="NAME", help="Only this family; repeatable."
)
@click.option(
    "--prefix", metavar="NAME", help="What names in C begin with.  [default: the robot's name]"
)
@click.option("--seconds", type=float, metavar="S", help="Time for the closed form.  [default: 10]")
@prove_option
def export_command(
    request: RobotRequest,
    c: str | Path | None,
    python: str | Path | None,
    families: tuple[str, ...],
    prefix: str | None,
    seconds: float | None,
    prove: Prove,
) -> None:
    """Write the singular families of ROBOT as one file without dependencies.

    It tells a control loop how far a configuration is from all of them, proven, rounding
    included: f, gradient and lower bound of each family. The file says how sure it is that
    no family is missing: proven, probable or not complete.

    Example: pinsing export ur5 --c guard.h --python guard.py
    """
    if c is None and python is None:
        raise OptionError("nothing to write: give --c FILE.h, --python FILE.py or both")
    if c is not None and str(c) == str(python):
        where = "standard output" if c == STDOUT else str(c)
        raise OptionError(f"--c and --python both go to {where}")
    arm = request.load()
    from pinsing.families import closed_form
    from pinsing.proximity.guard import make_guard

    with waiting() as step:
        step("looking for families")
        form = closed_form(arm, seconds=seconds, prove=prove)
    asked = families or None
    made = {
        language: (target, make_guard(arm, language, forms=form, families=asked, prefix=prefix))
        for language, target in (("c", c), ("python", python))
        if target is not None
    }
    _, guard = next(iter(made.values()))
    for note in guard.notes:
        say(f"note: {note}")
    if not guard.complete:
        say("note: families are missing, so nothing is ever clear to this guard")
    if guard.word == "probable" and prove is False:
        say("note: --prove looks for a certificate for up to a minute")
    for target, one in made.values():
        if target == STDOUT:
            click.echo(one.text, nl=False)
        else:
            write_text(target, one.text)
            say(f"wrote {target}")
