"""``pinsing plot``, ``view`` and ``report``: figures, a page in a browser, one file to read."""

from __future__ import annotations

import math
import shlex
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import click

from pinsing import families, kinematics, plot, proximity, report, robot, sampling, view
from pinsing.cli import completion
from pinsing.cli.families import algebra_options, prove_option
from pinsing.cli.mechanism import tell_of_limits, typed_inputs, view_loops
from pinsing.cli.motion import columns_option, read_samples, units_option, with_aspects
from pinsing.cli.options import (
    NAMES,
    VECTOR,
    JointValues,
    RobotRequest,
    Typed,
    argument,
    arm_options,
    at_joint,
    by_joint,
    command,
    deg_option,
    follow_option,
    group,
    in_degrees,
    joint_names,
    option,
    told_degrees,
    written,
    zones_option,
)
from pinsing.cli.output import (
    emit,
    emit_lines,
    followed,
    off_screen,
    picture_size,
    read_result,
    save_figure,
    say,
    show_page,
)
from pinsing.errors import ConfigurationError, OptionError, ResultError
from pinsing.prose import Page

if TYPE_CHECKING:
    from pinsing.families.solve import Prove
    from pinsing.measures import Array

_LOOP_PLOTS = ("map", "curves", "ellipsoids", "modes")


def plot_loops(
    mechanism: robot.Mechanism,
    kind: str,
    out: Path,
    configurations: Sequence[JointValues] = (),
    dpi: int = 200,
    deg: bool = False,
    over: Sequence[str] | None = None,
    ignore_limits: bool = False,
) -> None:
    """Draw ``plot --loops``: maps over the pose or the inputs, measures, the linkage, its modes.

    ``map --over x,y`` is a slice through the loci and aspects over two coordinates of the output's
    pose, for each working mode; the others are as at home, or as at ``--q``. Without ``--over``
    ``map`` shows both assembly modes of a 5R over its inputs, all poses of a mechanism of one
    freedom, else the first two coordinates. ``curves`` shows each input in turn, ``ellipsoids`` the
    linkage with its velocity ellipse in every assembly mode, ``modes`` all modes side by side.
    """
    OptionError.refuse_if(
        kind not in _LOOP_PLOTS,
        f"there is no {kind} plot of mechanisms: use {', '.join(_LOOP_PLOTS[:-1])} or "
        f"{_LOOP_PLOTS[-1]}",
    )
    OptionError.refuse_if(
        over is not None and kind != "map", "--over goes with plot map --loops: --over x,y"
    )
    if ignore_limits:
        mechanism = mechanism.without_limits()
    tell_of_limits(mechanism)
    inputs = typed_inputs(mechanism, configurations)
    off_screen()
    figure = _figure(mechanism, kind, inputs, bool(configurations), over, in_degrees(deg))
    save_figure(figure, out, dpi=dpi, bbox_inches="tight", pad_inches=0.04)


def _figure(
    mechanism: robot.Mechanism,
    kind: str,
    inputs: Array,
    asked: bool,
    names: Sequence[str] | None,
    degrees: bool,
) -> Any:
    import matplotlib.pyplot as plt

    from pinsing.loops import assemblies, curves, find_singular, ranks
    from pinsing.loops.closure import planar_dyad
    from pinsing.plot import mechanism as draw

    if kind == "modes":
        return draw.mode_sheet(mechanism, inputs if asked else None, degrees)
    if kind == "map":
        one_freedom = ranks(mechanism).mobility == 1
        if not one_freedom and (names is not None or planar_dyad(mechanism) is None):
            start = assemblies(mechanism, inputs)[0].q if asked else None
            return draw.pose_maps(mechanism, names, degrees, start)
        why = "all poses are on one curve" if one_freedom else "this map is over all inputs"
        OptionError.refuse_if(asked, f"--q does not go with this map: {why}")
        if one_freedom:
            return draw.motion_curve(mechanism, names, degrees).figure
        figure, axes = plt.subplots(1, 2, figsize=(11, 6.2))
        for ax, sign in zip(axes, "+-", strict=True):
            draw.input_map(mechanism, sign, ax, degrees=degrees)
            draw.map_legend(ax)
    elif kind == "curves":
        count = len(mechanism.inputs)
        figure, grid = plt.subplots(1, count, figsize=(5.2 * count, 4), squeeze=False)
        for k, ax in enumerate(grid[0]):
            found = curves(mechanism, inputs, k)
            draw.measure_curves(mechanism, found, find_singular(mechanism, found), ax, degrees)
    else:
        modes = assemblies(mechanism, inputs)
        figure, grid = plt.subplots(1, len(modes), figsize=(4.8 * len(modes), 4.8), squeeze=False)
        for ax, mode in zip(grid[0], modes, strict=True):
            draw.draw_linkage(mechanism, mode.q, ax)
            ax.set_title(mode.mode)
    figure.tight_layout()
    return figure


KINDS = (
    "curves", "map", "locus", "ellipsoids", "along", "workspace", "aspects", "solutions", "modes",
)  # fmt: skip
_STEPS = 400


@command("plot", mechanism=plot_loops, needs_output=True)
def plot_command(
    kind: str = argument(type=click.Choice(KINDS), metavar="WHAT"),
    request: RobotRequest = arm_options,
    out: Path = written(".png .svg .pdf"),
    configurations: tuple[JointValues, ...] = option(
        "Configuration: of the ellipsoids; where joints stay that a map or curves do not move; "
        "for along, the waypoints, at least two.",
        "--q",
        multiple=True,
        type=VECTOR,
    ),
    over: tuple[str, ...] | None = option(
        "map, locus, aspects: the two joints, by name or q1, q2, ... curves: those that move. "
        "With --loops: map over two of x, y, z, roll, pitch, yaw of the output.",
        type=NAMES,
        metavar="A,B",
        shell_complete=completion.joints,
    ),
    fixed: tuple[Callable[[robot.Arm], Any], ...] = option(
        "curves: joint held at a special value; repeatable.",
        multiple=True,
        type=at_joint("JOINT=VALUE", 1),
        shell_complete=completion.joint_value,
    ),
    only: tuple[str, ...] = option(
        "locus: which family, such as F1 or wrist. map: those shown; repeatable.  [default: all]",
        "--family",
        multiple=True,
        metavar="NAME",
    ),
    each: Callable[[robot.Arm], Any] | None = option(
        "locus: values of a third joint, a curve for each.",
        type=at_joint("JOINT=V1,V2,..."),
        shell_complete=completion.joint_value,
    ),
    ignore_limits: bool = option("curves, map, locus, aspects, solutions: ignore joint limits."),
    motions: Any = option(
        "ellipsoids: of pure motions (tool held, or tip held), or of all, as in the paper.  "
        "[default: pure for a pose]",
        type=click.Choice(("pure", "all")),
    ),
    measure: Any = option(
        "map, workspace: what is shown.", type=click.Choice(("sigma", "clearance")), default="sigma"
    ),
    dpi: int = option(type=click.IntRange(30, 1200), default=200),
    deg: bool = deg_option,
) -> None:
    """Draw a figure of ROBOT.

    \b
    curves      sigma_min along each joint, from a nominal configuration
    map         sigma_min (or clearance) over two joints, with the closed-form loci on top
    locus       a family as a curve over two joints, or several: one for each third value
    ellipsoids  velocity ellipsoids at a configuration
    along       singular values on straight joint motions between configurations, families marked
    workspace   the best sigma_min (or clearance) found at each place of the tip, in slices
    aspects     the aspects in colours over two joints
    solutions   of a 3-joint position arm: how many inverse solutions each place has
    modes       with --loops: the assembly and working modes side by side

    With --loops: map (over two coordinates of the output's pose, its aspects coloured by mode),
    curves, ellipsoids, modes.

    Example: pinsing plot map puma560 --over q2,q3 -o map.pdf
    """  # noqa: D301
    if kind in ("map", "aspects") and (over is None or len(over) != 2):
        what = "a map needs its" if kind == "map" else "aspects need their"
        raise OptionError(f"{what} two joints, such as --over q2,q3")
    OptionError.refuse_if(
        only and kind not in ("map", "locus"), f"--family is for map and locus, not for {kind}"
    )
    OptionError.refuse_if(
        kind == "modes", "modes are those of a mechanism: give its loops with --loops FILE.yaml"
    )
    OptionError.refuse_if(
        each is not None and kind != "locus", f"--each is for locus, not for {kind}"
    )
    OptionError.refuse_if(
        kind == "locus" and (len(only) != 1 or (over is not None and len(over) != 2)),
        "a locus needs one family, such as --family F1, and two joints if any",
    )
    OptionError.refuse_if(
        kind == "along" and len(configurations) < 2,
        "along needs two configurations or more: give --q twice",
    )
    OptionError.refuse_if(kind != "along" and len(configurations) > 1, f"{kind} takes one --q")
    arm = request.load()
    joints = None if over is None else list(joint_names(arm, over))
    off_screen()
    vectors = [values(arm) for values in configurations]
    q = vectors[0] if vectors else None
    held = {joint: value for joint, (value,) in by_joint(arm, fixed, "--fixed").items()}
    shown = _families(arm, only) if only else None
    degrees = in_degrees(deg)
    plane: dict[str, Any] = {"q": q, "ignore_limits": ignore_limits, "degrees": degrees}
    if kind == "map":
        axes = plot.sigma_plane(arm, *(joints or ()), families=shown, measure=measure, **plane)
    elif kind == "aspects":
        axes = plot.aspect_plane(arm, *(joints or ()), **plane)
    elif kind == "locus":
        third, values = (None, None) if each is None else each(arm)
        family, *others = shown or []
        names = " or ".join(one.name for one in shown or [])
        OptionError.refuse_if(others, f"several families are called {only[0]!r}: choose {names}")
        axes = plot.locus(arm, family, *(joints or ()), third=third, values=values, **plane)
    elif kind == "solutions":
        axes = plot.inverse_count(arm, limits=not ignore_limits)
    elif kind == "workspace":
        axes = plot.workspace(arm, measure=measure)
    elif kind == "along":
        from pinsing.families.solve import form_to_measure

        axes = plot.sigma_along(arm, _way(vectors), forms=form_to_measure(arm), degrees=degrees)
    elif kind == "ellipsoids":
        from pinsing.plot.plane import regular_configuration

        state = kinematics.at(arm, regular_configuration(arm) if q is None else q)
        axes = plot.ellipsoids(state, motions=motions, arm=arm)
    else:
        chosen: dict[str, Any] = {"levels": (max(len(held), 1),), "ignore_limits": ignore_limits}
        if held:
            special = {name: (x,) for name, x in held.items()}
            chosen |= {"special": special, "joints": tuple(arm.joints)}
        result = sampling.sweep(arm, nominal=q, prune=False, **chosen)
        axes = plot.sigma_curves(result, fixed=held, moving=joints, degrees=degrees, arm=arm)
    figure: Any = axes.figure
    save_figure(figure, out, dpi=dpi, bbox_inches="tight", pad_inches=0.04)


def _way(stations: list[Array]) -> Array:
    """Straight joint motions from each configuration to the next, (N, n)."""
    import numpy as np

    part = np.linspace(0, len(stations) - 1, _STEPS)
    columns = np.transpose(stations)
    return np.stack([np.interp(part, np.arange(len(stations)), x) for x in columns], axis=1)


def _families(arm: robot.Arm, names: tuple[str, ...]) -> list[families.Family]:
    """The families of these names or titles."""
    from pinsing.proximity.clearance import watch

    return list(watch(families.closed_form(arm, prove=False), names).families)


PAGES = ("inside", "beside", "none")


def _report_loops(
    mechanism: robot.Mechanism,
    html: Path | None = None,
    pdf: Path | None = None,
    page: str = "inside",
    skeleton: bool = False,
    poses: tuple[JointValues, ...] = (),
) -> None:
    """``report --loops``: of a mechanism."""
    _check_pdf(pdf)
    given = {
        f"given configuration {k}": typed_inputs(mechanism, [values])
        for k, values in enumerate(poses, 1)
    }
    _write(mechanism, html, pdf, page=page, skeleton=skeleton, poses=given)


@command("report", mechanism=_report_loops, needs_output=True)
def report_command(
    request: RobotRequest = arm_options,
    html: Path | None = written(".html .htm"),
    pdf: Path | None = written(".pdf"),
    page: str = option(
        "Where the interactive model goes: inside the report, into FILE-model.html, nowhere.",
        type=click.Choice(PAGES),
        default=PAGES[0],
    ),
    skeleton: bool = option("The model without meshes: under 3 MB."),
    poses: tuple[JointValues, ...] = option(
        "Judge this configuration too; repeatable.",
        "--q",
        multiple=True,
        type=VECTOR,
        shell_complete=completion.files,
    ),
    trajectory: Path | None = option(
        "Judge this trajectory too: what `pinsing check` reads.",
        type=click.Path(exists=True, dir_okay=False, path_type=Path),
        metavar="FILE",
    ),
    units: str | None = units_option,
    columns: tuple[str, ...] | None = columns_option,
    zones: Any = zones_option,
    prove: Prove = prove_option,
    algebra: dict[str, Any] = algebra_options,
    deg: bool = deg_option,
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
    arm = request.load()
    given = {f"given configuration {k}": values(arm) for k, values in enumerate(poses, 1)}
    from pinsing.report.arm_report import Trajectory

    OptionError.refuse_if(
        trajectory is None and (units or columns), "--units and --columns are of --trajectory FILE"
    )
    way = None if trajectory is None else read_samples(trajectory, arm, units, columns)
    forms = families.closed_form(arm, **algebra, prove=prove)
    judged = None
    if way is not None and trajectory is not None:
        check = proximity.check_trajectory(arm, way.Q, way.t, forms=forms)
        check = with_aspects(check, arm, forms, way.Q, way.t)
        judged = Trajectory(check, way.Q, way.t, trajectory.name, request.words, way.notes)
    _write(
        arm, html, pdf, page=page, skeleton=skeleton, poses=given, forms=forms, trajectory=judged,
        zones=zones,
    )  # fmt: skip
    from pinsing.families.form import answer_text

    file = "path.csv"
    if judged is not None:
        emit_lines("\n".join([*judged.answer, ""]))
        typed = {None: [], True: ["--deg"], False: ["--rad"]}[told_degrees()]
        typed += [f"--units={units}"] * bool(units) + [
            f"--columns={','.join(columns or ())}"
        ] * bool(columns)
        file = shlex.join([str(trajectory), *typed])
    emit(answer_text(forms, Page.of(), request.words, file))


def _check_pdf(pdf: Path | None) -> None:
    if pdf is not None:
        from pinsing.view.picture import check_browser

        check_browser(pdf)


def _write(
    subject: robot.Arm | robot.Mechanism, html: Path | None, pdf: Path | None, **content: Any
) -> None:
    off_screen()
    if html is None:  # nothing is interactive on paper
        content["page"] = "none"
    modelled = content["page"] != "none"
    say("computing families, pictures and the model" if modelled else "computing")
    for file in report.write_report(subject, html, pdf=pdf, **content):
        say(f"wrote {file}")


_PICTURE = 0.05
"""Seconds from a configuration of a stream that is shown to the next."""


@group
def page_options(
    size: Any = option("Of the picture.", default="1200x900", type=Typed("WxH", picture_size)),
    panel: bool = option("Include the side panel in the picture."),
    no_open: bool = option("Do not open a browser."),
    host: str = option("Address to listen on.", default="127.0.0.1"),
    port: int | None = option("[default: first free from 7000 on]", type=click.IntRange(0, 65535)),
) -> dict[str, Any]:
    """How a page is served, and pictures of it taken: arguments of `show_page`."""
    return {"size": size, "panel": panel, "no_open": no_open, "host": host, "port": port}


@command("view", mechanism=view_loops)
def view_command(
    request: RobotRequest = arm_options,
    poses: tuple[JointValues, ...] = option(
        "Show this configuration, first in the list; repeatable.", "--q", multiple=True, type=VECTOR
    ),
    analysis: Path | None = option(
        "Take the families from the JSON of `pinsing analyze` or `families`.",
        type=click.Path(exists=True, dir_okay=False, path_type=Path),
        metavar="FILE.json",
    ),
    family: str | None = option(
        "Show this family first, such as F2.", metavar="NAME", shell_complete=completion.families
    ),
    zones: proximity.Zones | None = zones_option,
    follow: Path | None = follow_option("Show the configurations of STREAM as they come"),
    scale: float = option("Size of the ellipsoids.", default=1.0),
    skeleton: bool = option("Without meshes: small pages."),
    page: dict[str, Any] = page_options,
    deg: bool = deg_option,
    html: Path | None = written(".html"),
    png: Path | None = written(".png"),
) -> None:
    """Show ROBOT at its singular configurations: poses, ellipsoids, lost motion.

    Opens a browser tab and serves it until Ctrl-C. With -o, writes a page that needs no server,
    or a picture (by Chromium), and ends. What is served can be reached from this computer only,
    unless --host says otherwise.

    With --loops the tab drives a mechanism: sliders for the actuated joints, the others follow;
    a menu of its modes; singular poses of type 1, 2 and 3. --q then gives the actuated joints.

    Example: pinsing view ur5 --q 0,-90,90,0,0,0 --deg
    """
    OptionError.refuse_if(
        follow is not None and (html or png), "--follow needs a page that is served: leave out -o"
    )
    arm = request.load()
    vectors = [values(arm) for values in poses]
    saved = None if analysis is None else _read(analysis, arm)
    # What is typed and can still be refused is judged before a browser opens.
    late = family is not None or zones is not None or not 0 < scale < math.inf

    def made(at: Callable[[str], None]) -> view.Viewer:
        # Half a second of imports, which the browser does not wait for.
        from pinsing.view.scene import read_links_ahead

        if not skeleton:
            read_links_ahead(arm)  # a child process reads them meanwhile
        from pinsing.families.form import coverage_words

        listed, findings, form = _find(arm, at) if saved is None else saved
        at("preparing the page")
        viewer = view.Viewer(
            arm,
            listed,
            vectors,
            findings,
            coverage=coverage_words(form),
            zones=zones or form.tube,
            scale=scale,
            skeleton=skeleton,
        )
        if family is not None:
            viewer.show_family(family)
        return viewer

    lead = None if follow is None else partial(_lead, file=follow, degrees=told_degrees())
    live = html is None and png is None
    show_page(arm.name, made, live, late=late, html=html, png=png, lead=lead, **page)


def _lead(viewer: view.Viewer, file: Path, degrees: bool | None) -> None:
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


_Listed: TypeAlias = (
    "tuple[tuple[families.Family, ...], tuple[sampling.Finding, ...], families.ClosedForm]"
)
"""Families, findings, and the closed form, which says how sure it is that these are all."""


def _find(arm: robot.Arm, at: Callable[[str], None]) -> _Listed:
    """Families by algebra; where that has gaps, what a sweep finds as well."""
    at("finding the singular families")
    found = families.closed_form(arm)
    at("")
    if found.complete:
        return found.families, (), found
    for gap in found.gaps:
        say(f"note: the closed forms have a gap, so a sweep runs too: {gap}")
    at("sweeping")
    return *_parts(sampling.analyze(arm)), found


def _read(path: Path, arm: robot.Arm) -> _Listed:
    """Families and findings of a saved analysis, or of a saved closed form, of the same arm."""
    from pinsing.proximity.clearance import forms_of

    saved = read_result(path, families.ClosedForm, sampling.Analysis)
    form = saved.closed_form if isinstance(saved, sampling.Analysis) else saved
    ResultError.refuse_if(
        form.arm.task != arm.task.name,
        f"{path} is for the task {form.arm.task}, not for {arm.task.name}: give --task",
    )
    try:
        forms_of(arm, form)
    except OptionError as other:
        raise ResultError(f"{path}: {other}") from None
    return (form.families, (), form) if form is saved else (*_parts(saved), form)


def _parts(
    analysis: sampling.Analysis,
) -> tuple[tuple[families.Family, ...], tuple[sampling.Finding, ...]]:
    """Families, and the findings that lie on none of them."""
    pairs = zip(analysis.findings, analysis.family_of, strict=True)
    return analysis.families, tuple(finding for finding, family in pairs if not family)
