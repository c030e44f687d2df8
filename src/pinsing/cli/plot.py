"""``pinsing plot``: figures for papers and reports."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pinsing.cli import completion
from pinsing.cli.mechanism import loops_option, read, tell_of_limits, typed_inputs
from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    command,
    deg_option,
    in_degrees,
    joint_names,
    joint_vector,
    output_option,
    parse_numbers,
)
from pinsing.cli.output import off_screen, save_figure
from pinsing.errors import OptionError

if TYPE_CHECKING:
    from pinsing.families import Family
    from pinsing.measures import Array
    from pinsing.robot.arm import Arm
    from pinsing.robot.mechanism import Mechanism


_LOOP_PLOTS = ("map", "curves", "ellipsoids", "modes")
_ARM_PLOTS: dict[str, Any] = {
    "fixed": (), "families": (), "each": None, "motions": None, "measure": "sigma",
}  # fmt: skip
_PLOT_OPTIONS = {"families": "family"}


def plot_loops(
    loops: Path,
    kind: str,
    out: Path,
    configurations: Sequence[str] = (),
    dpi: int = 200,
    deg: bool = False,
    over: str | None = None,
    ignore_limits: bool = False,
    **options: Any,
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
    given = [name for name, usual in _ARM_PLOTS.items() if options.get(name, usual) != usual]
    if given:
        raise OptionError(
            f"{'--' + _PLOT_OPTIONS.get(given[0], given[0])} does not go with plot --loops"
        )
    mechanism = read(loops, options)
    if ignore_limits:
        mechanism = mechanism.without_limits()
    tell_of_limits(mechanism)
    inputs = typed_inputs(mechanism, configurations, deg)
    off_screen()
    names = None if over is None else [name.strip() for name in over.split(",")]
    figure = _figure(mechanism, kind, inputs, bool(configurations), names, in_degrees(deg))
    save_figure(figure, out, dpi=dpi, bbox_inches="tight", pad_inches=0.04)


def _figure(
    mechanism: Mechanism,
    kind: str,
    inputs: Array,
    asked: bool,
    names: list[str] | None,
    degrees: bool,
) -> Any:
    import matplotlib.pyplot as plt

    from pinsing.loops import assemblies, curves, find_singular, ranks
    from pinsing.loops.loop_forms import planar_dyad
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
            draw.map_legend(ax, mechanism)
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


@command("plot")
@click.argument("kind", type=click.Choice(KINDS), metavar="WHAT")
@loops_option(plot_loops)
@arm_options
@output_option(required=True, out=".png .svg .pdf")
@click.option(
    "--q",
    "configurations",
    multiple=True,
    metavar="Q1,Q2,...",
    help="Configuration: of the ellipsoids; where joints stay that a map or curves do not move; "
    "for along, the waypoints, at least two.",
)
@click.option(
    "--over",
    metavar="A,B",
    shell_complete=completion.joints,
    help="map, locus, aspects: the two joints, by name or q1, q2, ... curves: those that move. "
    "With --loops: map over two of x, y, z, roll, pitch, yaw of the output.",
)
@click.option(
    "--fixed",
    multiple=True,
    metavar="JOINT=VALUE",
    shell_complete=completion.joint_value,
    help="curves: joint held at a special value; repeatable.",
)
@click.option(
    "--family",
    "families",
    multiple=True,
    metavar="NAME",
    help="locus: which family, such as F1 or wrist. map: those shown; repeatable.  [default: all]",
)
@click.option(
    "--each",
    metavar="JOINT=V1,V2,...",
    shell_complete=completion.joint_value,
    help="locus: values of a third joint, a curve for each.",
)
@click.option(
    "--ignore-limits",
    is_flag=True,
    help="curves, map, locus, aspects, solutions: ignore joint limits.",
)
@click.option(
    "--motions",
    type=click.Choice(("pure", "all")),
    help="ellipsoids: of pure motions (tool held, or tip held), or of all, as in the paper.  "
    "[default: pure for a pose]",
)
@click.option(
    "--measure",
    type=click.Choice(("sigma", "clearance")),
    default="sigma",
    show_default=True,
    help="map, workspace: what is shown.",
)
@click.option("--dpi", type=click.IntRange(30, 1200), default=200, show_default=True)
@deg_option
def plot_command(
    request: RobotRequest,
    kind: str,
    out: Path,
    configurations: tuple[str, ...],
    over: str | None,
    fixed: tuple[str, ...],
    families: tuple[str, ...],
    each: str | None,
    ignore_limits: bool,
    motions: Any,
    measure: Any,
    dpi: int,
    deg: bool,
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
    for text in configurations:
        parse_numbers(text, "--q", deg)
    given = None if over is None else [name for name in over.split(",") if name.strip()]
    if kind in ("map", "aspects") and (given is None or len(given) != 2):
        what = "a map needs its" if kind == "map" else "aspects need their"
        raise OptionError(f"{what} two joints, such as --over q2,q3")
    OptionError.refuse_if(
        families and kind not in ("map", "locus"), f"--family is for map and locus, not for {kind}"
    )
    OptionError.refuse_if(
        kind == "modes", "modes are those of a mechanism: give its loops with --loops FILE.yaml"
    )
    OptionError.refuse_if(
        each is not None and kind != "locus", f"--each is for locus, not for {kind}"
    )
    OptionError.refuse_if(
        kind == "locus" and (len(families) != 1 or (given is not None and len(given) != 2)),
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
    vectors = [joint_vector(arm, text, "--q", deg) for text in configurations]
    q = vectors[0] if vectors else None
    held = dict(_fixed(arm, text, deg) for text in fixed)
    shown = _families(arm, families) if families else None
    degrees = in_degrees(deg)
    plane: dict[str, Any] = {"q": q, "ignore_limits": ignore_limits, "degrees": degrees}
    from pinsing import plot

    if kind == "map":
        axes = plot.sigma_plane(arm, *(joints or ()), families=shown, measure=measure, **plane)
    elif kind == "aspects":
        axes = plot.aspect_plane(arm, *(joints or ()), **plane)
    elif kind == "locus":
        third, values = (None, None) if each is None else _joint_values(arm, each, "--each", deg)
        family = _only(shown or [], families[0])
        axes = plot.locus(arm, family, *(joints or ()), third=third, values=values, **plane)
    elif kind == "solutions":
        axes = plot.inverse_count(arm, limits=not ignore_limits)
    elif kind == "workspace":
        axes = plot.workspace(arm, measure=measure)
    elif kind == "along":
        from pinsing.families.solve import form_to_measure

        axes = plot.sigma_along(arm, _way(vectors), forms=form_to_measure(arm), degrees=degrees)
    elif kind == "ellipsoids":
        from pinsing.kinematics.at import at
        from pinsing.plot.plane import regular_configuration

        state = at(arm, regular_configuration(arm) if q is None else q)
        axes = plot.ellipsoids(state, motions=motions, arm=arm)
    else:
        from pinsing.sampling.sweeps import sweep

        chosen: dict[str, Any] = {"levels": (max(len(held), 1),), "ignore_limits": ignore_limits}
        if held:
            special = {name: (x,) for name, x in held.items()}
            chosen |= {"special": special, "joints": tuple(arm.joints)}
        result = sweep(arm, nominal=q, prune=False, **chosen)
        axes = plot.sigma_curves(result, fixed=held, moving=joints, degrees=degrees, arm=arm)
    figure: Any = axes.figure
    save_figure(figure, out, dpi=dpi, bbox_inches="tight", pad_inches=0.04)


def _way(stations: list[Array]) -> Array:
    """Straight joint motions from each configuration to the next, (N, n)."""
    import numpy as np

    part = np.linspace(0, len(stations) - 1, _STEPS)
    columns = np.transpose(stations)
    return np.stack([np.interp(part, np.arange(len(stations)), x) for x in columns], axis=1)


def _families(arm: Arm, names: tuple[str, ...]) -> list[Family]:
    """The families of these names or titles."""
    from pinsing.families import closed_form
    from pinsing.proximity.clearance import watch

    return list(watch(closed_form(arm, prove=False), names).families)


def _only(found: list[Family], name: str) -> Family:
    """The one family of a name or title."""
    names = " or ".join(family.name for family in found)
    OptionError.refuse_if(len(found) > 1, f"several families are called {name!r}: choose {names}")
    return found[0]


def _fixed(arm: Arm, text: str, deg: bool) -> tuple[str, float]:
    name, values = _joint_values(arm, text, "--fixed", deg)
    OptionError.refuse_if(len(values) != 1, f"--fixed {text!r} needs one value")
    return name, values[0]


def _joint_values(arm: Arm, text: str, option: str, deg: bool) -> tuple[str, list[float]]:
    """``JOINT=V1,V2`` as a name and radians or metres."""
    import math

    name, equals, numbers = text.partition("=")
    OptionError.refuse_if(not equals, f"{option} {text!r} is not of the form JOINT=VALUE")
    (name,) = joint_names(arm, name) or ("",)
    values = parse_numbers(numbers, option, deg)
    turns = deg and not arm.prismatic[arm.joints.index(name)]
    return name, [math.radians(v) if turns else float(v) for v in values]
