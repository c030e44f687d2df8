"""``pinsing view``: see an arm at its singular configurations."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import click

from pinsing.cli import completion
from pinsing.cli.mechanism import loops_option, view_loops
from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    command,
    deg_option,
    follow_option,
    joint_vector,
    output_option,
    parse_numbers,
    told_degrees,
)
from pinsing.cli.output import (
    followed,
    picture_size,
    read_json,
    say,
    served_ahead,
    stay,
    write_files,
)
from pinsing.cli.running import waiting
from pinsing.cli.zones import zones_option
from pinsing.errors import ConfigurationError, OptionError, ResultError

if TYPE_CHECKING:
    from pinsing.families import ClosedForm, Family
    from pinsing.proximity.zones import Zones
    from pinsing.robot.arm import Arm
    from pinsing.sampling.analyze import Analysis
    from pinsing.sampling.generalize import Finding
    from pinsing.view.viewer import Viewer

_PICTURE = 0.05
"""Seconds from a configuration of a stream that is shown to the next."""


@command("view")
@loops_option(view_loops)
@arm_options
@click.option(
    "--q",
    "poses",
    multiple=True,
    metavar="Q1,Q2,...",
    help="Show this configuration, first in the list; repeatable.",
)
@click.option(
    "--analysis",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE.json",
    help="Take the families from the JSON of `pinsing analyze` or `families`.",
)
@click.option(
    "--family",
    metavar="NAME",
    shell_complete=completion.families,
    help="Show this family first, such as F2.",
)
@zones_option
@follow_option("Show the configurations of STREAM as they come")
@click.option("--scale", type=float, default=1.0, show_default=True, help="Size of the ellipsoids.")
@click.option("--skeleton", is_flag=True, help="Without meshes: small pages.")
@click.option(
    "--size", default="1200x900", show_default=True, metavar="WxH", help="Of the picture."
)
@click.option("--panel", is_flag=True, help="Include the side panel in the picture.")
@click.option("--no-open", is_flag=True, help="Do not open a browser.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), help="[default: first free from 7000 on]")
@deg_option
@output_option(html=".html", png=".png")
def view_command(
    request: RobotRequest,
    poses: tuple[str, ...],
    analysis: Path | None,
    family: str | None,
    zones: Zones | None,
    follow: Path | None,
    scale: float,
    skeleton: bool,
    html: Path | None,
    png: Path | None,
    size: str,
    panel: bool,
    no_open: bool,
    host: str,
    port: int | None,
    deg: bool,
) -> None:
    """Show ROBOT at its singular configurations: poses, ellipsoids, lost motion.

    Opens a browser tab and serves it until Ctrl-C. With -o, writes a page that needs no server,
    or a picture (by Chromium), and ends. What is served can be reached from this computer only,
    unless --host says otherwise.

    With --loops the tab drives a mechanism: sliders for the actuated joints, the others follow;
    a menu of its modes; singular poses of type 1, 2 and 3. --q then gives the actuated joints.

    Example: pinsing view ur5 --q 0,-90,90,0,0,0 --deg
    """
    for text in poses:
        parse_numbers(text, "--q", deg)
    picture = picture_size(size)
    OptionError.refuse_if(
        follow is not None and (html or png), "--follow needs a page that is served: leave out -o"
    )
    arm = request.load()
    vectors = [joint_vector(arm, text, "--q", deg) for text in poses]
    saved = None if analysis is None else _read(analysis, arm)
    live = html is None and png is None
    # What is typed and can still be refused is judged before a browser opens.
    late = family is not None or zones is not None or not 0 < scale < math.inf
    with contextlib.ExitStack() as stack:
        page = served_ahead(arm.name, host, port, no_open)
        server = stack.enter_context(page) if live and not late else None
        # Half a second of imports, which the browser does not wait for.
        from pinsing.view.links import read_links_ahead

        if not skeleton:
            read_links_ahead(arm)  # a child process reads them meanwhile
        from pinsing.families.form import coverage_words
        from pinsing.view.viewer import Viewer

        with waiting() as at:
            families, findings, form = _find(arm, at) if saved is None else saved
            at("preparing the page")
            viewer = stack.enter_context(
                Viewer(
                    arm,
                    families,
                    vectors,
                    findings,
                    coverage=coverage_words(form),
                    zones=zones or form.tube,
                    scale=scale,
                    skeleton=skeleton,
                    host=host,
                    port=port,
                )
            )
            at("")
            for note in viewer.notes:
                say(f"note: {note}")
            if family is not None:
                viewer.show_family(family)
            write_files(viewer, html, png, picture, panel, at)
        if live:
            lead = None if follow is None else partial(_lead, viewer, follow, told_degrees(deg))
            stay(viewer, stack.enter_context(page) if server is None else server, lead)


def _lead(viewer: Viewer, file: Path, degrees: bool | None) -> None:
    """Show what comes, the newest of it; say what cannot be read, silences and the end."""
    # A file with times is played at them, one without picture by picture.
    from pinsing.proximity.monitor import STALLED, Reader, latest

    reader, skipped, problem, q = Reader(viewer.arm, degrees, say), 0, "", viewer.q
    # The clock where the file's is 0, and the file's time of the last picture.
    start, shown = 0.0, math.inf
    with followed(file) as (lines, live):
        for line, dropped in latest(lines, backlog=1) if live else ((x, 0) for x in lines):
            skipped += dropped
            if line is None:
                silence = f"no line for {STALLED:g} s"
                viewer.show(viewer.q, f"{silence}; {problem}" if problem else silence)
                continue
            try:
                if (found := reader.read(line)) is not None:
                    q, due = found[1], None if live else found[0]
                    if due is not None:
                        if shown <= due < shown + _PICTURE / 2:
                            skipped += 1
                            continue
                        if not shown <= due < shown + 60:  # the first, begun anew, or a long gap
                            start = time.monotonic() - due
                        time.sleep(max(0.0, start + due - time.monotonic()))
                        shown = due
                    problem = ""
                    word = "live" if live else "played"
                    viewer.show(q, word + f"; {skipped} lines skipped" * bool(skipped))
                    time.sleep(_PICTURE if due is None else 0.0)
            except ConfigurationError as error:
                if str(error) != problem:
                    say(f"warning: {error}")
                    viewer.show(viewer.q, problem := str(error))
                    time.sleep(_PICTURE)
    viewer.show(q, f"the stream has ended; {skipped} lines came faster than pictures")
    say(f"the stream has ended; {skipped} lines came faster than pictures, and were skipped")


_Listed: TypeAlias = "tuple[tuple[Family, ...], tuple[Finding, ...], ClosedForm]"
"""Families, findings, and the closed form, which says how sure it is that these are all."""


def _find(arm: Arm, at: Callable[[str], None]) -> _Listed:
    """Families by algebra; where that has gaps, what a sweep finds as well."""
    from pinsing.families import closed_form

    at("finding the singular families")
    found = closed_form(arm)
    at("")
    if found.complete:
        return found.families, (), found
    for gap in found.gaps:
        say(f"note: the closed forms have a gap, so a sweep runs too: {gap}")
    from pinsing.sampling.analyze import analyze

    at("sweeping")
    return *_parts(analyze(arm)), found


def _read(path: Path, arm: Arm) -> _Listed:
    """Families and findings of a saved analysis, or of a saved closed form, of the same arm."""
    from pinsing.families import ClosedForm
    from pinsing.sampling.analyze import Analysis

    data = read_json(path)
    schema = data.get("schema") if isinstance(data, dict) else None
    saved: Analysis | ClosedForm
    try:
        saved = (ClosedForm if schema == ClosedForm.schema else Analysis).from_dict(data)
    except ResultError as error:
        raise ResultError(f"{path}: {error}") from None
    ResultError.refuse_if(
        saved.arm.joints != arm.joints,
        f"{path} is of {saved.arm.name} with joints {', '.join(saved.arm.joints)}, "
        f"not of this arm with {', '.join(arm.joints)}",
    )
    if isinstance(saved, ClosedForm):
        return saved.families, (), saved
    return *_parts(saved), saved.closed_form


def _parts(analysis: Analysis) -> tuple[tuple[Family, ...], tuple[Finding, ...]]:
    """Families, and the findings that lie on none of them."""
    pairs = zip(analysis.findings, analysis.family_of, strict=True)
    return analysis.families, tuple(finding for finding, family in pairs if not family)
