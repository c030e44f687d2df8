"""``pinsing report``: one file that explains a robot's singular configurations."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pinsing.cli import completion
from pinsing.cli.check import file_options, read_samples, with_aspects
from pinsing.cli.mechanism import loops_option, read, typed_inputs
from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    command,
    deg_option,
    joint_vector,
    output_option,
    parse_numbers,
    told_degrees,
)
from pinsing.cli.output import emit, emit_lines, off_screen, say
from pinsing.cli.singularities import algebra_options, prove_option
from pinsing.cli.zones import zones_option
from pinsing.errors import OptionError
from pinsing.prose import Page

if TYPE_CHECKING:
    from pinsing.families.solve import Prove
    from pinsing.measures import Array

PAGES = ("inside", "beside", "none")


def _report_loops(
    loops: Path,
    html: Path | None = None,
    pdf: Path | None = None,
    page: str = "inside",
    skeleton: bool = False,
    poses: tuple[str, ...] = (),
    deg: bool = False,
    prove: Prove = "auto",
    **options: Any,
) -> None:
    """``report --loops``: of a mechanism."""
    _check_pdf(pdf)
    OptionError.refuse_if(
        prove != "auto", "--prove does not go with --loops: there are certificates of arms only"
    )
    for name in ("trajectory", "zones", "units", "columns"):
        OptionError.refuse_if(
            options[name] is not None,
            f"--{name} is for arms: leave it out, or take one with --no-loops",
        )
    mechanism = read(loops, options)
    given = {
        f"given configuration {k}": typed_inputs(mechanism, [text], deg)
        for k, text in enumerate(poses, 1)
    }
    _write(mechanism, html, pdf, page, skeleton, given, None)


@command("report")
@loops_option(_report_loops)
@arm_options
@output_option(required=True, html=".html .htm", pdf=".pdf")
@click.option(
    "--page",
    type=click.Choice(PAGES),
    default=PAGES[0],
    show_default=True,
    help="Where the interactive model goes: inside the report, into FILE-model.html, nowhere.",
)
@click.option("--skeleton", is_flag=True, help="The model without meshes: under 3 MB.")
@click.option(
    "--q",
    "poses",
    multiple=True,
    metavar="Q1,Q2,...",
    shell_complete=completion.files,
    help="Judge this configuration too; repeatable.",
)
@click.option(
    "--trajectory",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Judge this trajectory too: what `pinsing check` reads.",
)
@file_options
@zones_option
@prove_option
@algebra_options
@deg_option
def report_command(
    request: RobotRequest,
    html: Path | None,
    pdf: Path | None,
    page: str,
    skeleton: bool,
    poses: tuple[str, ...],
    trajectory: Path | None,
    units: str | None,
    columns: str | None,
    zones: Any,
    prove: Prove,
    algebra: dict[str, Any],
    deg: bool,
) -> None:
    """Write a report of ROBOT's singular configurations: one HTML file to send on.

    It holds a page for whoever decides, what a trajectory meets (--trajectory), maps, each family
    with its equation, in words and in a picture, verdicts at zero, mid-range and named
    configurations, how sure it is that nothing is missing with the certificate, the joints, what
    was assumed, the interactive model, and all of it as JSON. It needs no network. -o FILE.pdf
    prints it, by Chromium.

    Example: pinsing report ur5 -o report.html --skeleton
    """
    _check_pdf(pdf)
    for text in poses:
        parse_numbers(text, "--q", deg)
    arm = request.load()
    given = {
        f"given configuration {k}": joint_vector(arm, text, "--q", deg)
        for k, text in enumerate(poses, 1)
    }
    from pinsing.families import closed_form
    from pinsing.proximity.trajectory import check_trajectory
    from pinsing.report.info import Trajectory

    OptionError.refuse_if(
        trajectory is None and (units or columns), "--units and --columns are of --trajectory FILE"
    )
    way = None if trajectory is None else read_samples(trajectory, arm, deg, units, columns)
    forms = closed_form(arm, **algebra, prove=prove)
    judged = None
    if way is not None and trajectory is not None:
        check = check_trajectory(arm, way.Q, way.t, forms=forms)
        check = with_aspects(check, arm, forms, way.Q, way.t)
        judged = Trajectory(check, way.Q, way.t, trajectory.name, request.words, way.notes)
    _write(arm, html, pdf, page, skeleton, given, forms, judged, zones)
    from pinsing.families.form import answer_text

    file = "path.csv"
    if judged is not None:
        emit_lines("\n".join([*judged.answer, ""]))
        typed = {None: [], True: ["--deg"], False: ["--rad"]}[told_degrees(deg)]
        typed += [f"--units={units}"] * bool(units) + [f"--columns={columns}"] * bool(columns)
        file = shlex.join([str(trajectory), *typed])
    emit(answer_text(forms, Page.of(), request.words, file))


def _check_pdf(pdf: Path | None) -> None:
    if pdf is not None:
        from pinsing.view.picture import check_browser

        check_browser(pdf)


def _write(
    robot: Any,
    html: Path | None,
    pdf: Path | None,
    page: str,
    skeleton: bool,
    poses: dict[str, Array],
    forms: Any,
    trajectory: Any = None,
    zones: Any = None,
) -> None:
    from pinsing.report.arm_report import write_report

    off_screen()
    where = "none" if html is None else page  # nothing is interactive on paper
    say("computing families, pictures and the model" if where != "none" else "computing")
    write_report(
        robot,
        html,
        forms=forms,
        poses=poses,
        trajectory=trajectory,
        zones=zones,
        page=where,  # type: ignore[arg-type]
        skeleton=skeleton,
        pdf=pdf,
    )
    if where == "beside" and html is not None:
        say(f"wrote {html.with_name(f'{html.stem}-model.html')}")
    for written in (html, pdf):
        if written is not None:
            say(f"wrote {written}")
