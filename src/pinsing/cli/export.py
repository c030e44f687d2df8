"""``pinsing export``: a guard for a control loop."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pinsing.cli.options import RobotRequest, arm_options, command, output_option
from pinsing.cli.output import STDOUT, put, say
from pinsing.cli.running import waiting
from pinsing.cli.singularities import prove_option
from pinsing.cli.zones import zones_option
from pinsing.errors import OptionError

if TYPE_CHECKING:
    from pinsing.families.solve import Prove
    from pinsing.proximity.zones import Zones


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
