"""``pinsing path``: the best joint path through a toolpath; ``pinsing line``: a straight line."""

from __future__ import annotations

import io
import math
import re
import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pinsing.cli.check import angle
from pinsing.cli.options import (
    RobotRequest,
    arm_options,
    command,
    deg_option,
    doubt_degrees,
    fail_option,
    in_degrees,
    joint_names,
    joint_vector,
    json_option,
    once_option,
    output_option,
    parse_numbers,
)
from pinsing.cli.output import STDOUT, emit_json, emit_lines, off_screen, save_figure, say
from pinsing.cli.running import doing, waiting
from pinsing.errors import OptionError

if TYPE_CHECKING:
    from pinsing.measures import Array


@command("path")
@arm_options
@click.argument("poses", type=click.Path(path_type=Path))
@click.option(
    "--free",
    default="branch",
    show_default=True,
    metavar="roll|JOINT|branch",
    help="What may be chosen: the rotation about the tool's z axis, a seventh joint, or only the "
    "inverse kinematics branch.",
)
@click.option("--step", default="1deg", show_default=True, metavar="ANGLE", help="Its grid.")
@click.option("--tool", metavar="X,Y,Z[,R,P,Y]", help="Pose of the tool in the tip frame, metres.")
@click.option(
    "--base-frame",
    metavar="X,Y,Z[,R,P,Y]",
    help="Frame of the poses, in the base frame of the robot, metres.",
)
@click.option(
    "--start",
    metavar="Q1,Q2,...",
    help="Configuration at the first pose, or its posture: elbow up, wrist no-flip.",
)
@click.option(
    "--place",
    metavar="x=A..B,yaw=A..B",
    help="Move the workpiece for more clearance (searched), in ranges of x, y, z (metres along the "
    "axes of the base) and roll, pitch, yaw (about them, through the middle of the path).",
)
@click.option("--feed", type=float, metavar="M/S", help="Tool speed: joint speed limits are kept.")
@click.option("--mm", is_flag=True, help="x, y, z of the file are millimetres.")
@deg_option
@output_option(csv=".csv", json_target=".json", plot=".png .svg .pdf")
def path_command(
    request: RobotRequest,
    poses: Path,
    csv: str | Path | None,
    free: str,
    step: str,
    tool: str | None,
    base_frame: str | None,
    start: str | None,
    place: str | None,
    feed: float | None,
    mm: bool,
    plot: Path | None,
    deg: bool,
    json_target: str | Path | None,
) -> int:
    """Find the joint path through POSES that stays farthest from singularities.

    POSES is a CSV file with a header: x, y, z and qx, qy, qz, qw, or roll, pitch, yaw, or i, j, k
    (of length 1, from the cutter into the tool, its -z; tool0's z points out of the flange); t, if
    there is one, gives seconds. The exit code is 1 if there is no path.

    Example: pinsing path ur5 seam.csv --free roll --tool 0,0.05,0.15,45,0,0 --deg -o joints.csv
    """
    import numpy as np

    grid = angle(step, "--step", True)
    if feed is not None and not feed > 0:
        raise OptionError(f"--feed must be positive, got {feed:g}")
    in_tip = _frame(tool, "--tool", deg)
    in_base = _frame(base_frame, "--base-frame", deg)
    ranges = None if place is None else _ranges(place, deg)
    arm = request.load()
    from pinsing.families.solve import form_to_measure
    from pinsing.postures.placement import read_poses
    from pinsing.postures.toolpath import plan_path

    read = read_poses(poses, degrees=deg, millimetres=mm)
    OptionError.refuse_if(
        not read.has_roll and free != "roll",
        f"{poses} has no rotation about the tool: add --free roll",
    )
    T, t = in_base @ read.poses, read.t
    if feed is not None:
        moved = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1) / feed
        OptionError.refuse_if(
            not (moved > 0).all(),
            "--feed needs poses at different positions: give times in a column t",
        )
        OptionError.refuse_if(
            t is not None, f"{poses} has times in a column t: leave out --feed, or the column"
        )
        t = np.concatenate([[0.0], np.cumsum(moved)])
    q0: Array | str | None = start
    if start is not None and not re.search("[a-z]{3}", start):  # letters of numbers are pi at most
        q0 = joint_vector(arm, start, "--start", deg)
    with waiting() as step_to:
        free = free if free in ("roll", "branch") else joint_names(arm, free)[0]
        step_to("families")
        form = form_to_measure(arm)
        plan = plan_path(
            form, T, free=free, step=grid, start=q0, t=t, arm=arm, tool=in_tip, place=ranges,
            progress=lambda what, k, n: step_to(what, f"{100 * k // n} %"),
        )  # fmt: skip
    if not emit_json(plan, json_target):
        emit_lines(plan.text(in_degrees(deg)))
        if plan.placement is not None:
            frame = _typed(plan.placement.transform @ in_base, deg)
            emit_lines(f"  The poses are then in --base-frame {frame}")
    if plan.reason:
        return 1
    if csv is not None:
        factor = np.where(arm.prismatic, 1.0, 180 / math.pi) if deg else np.ones(arm.n)
        columns = plan.q * factor
        names = [j if f == 1 else f"{j} (deg)" for j, f in zip(arm.joints, factor, strict=True)]
        if t is not None:
            columns, names = np.column_stack([t, columns]), ["t", *names]
        text = io.StringIO()
        np.savetxt(text, columns, fmt="%.12g", delimiter=",", header=",".join(names), comments="")
        _write(csv, text.getvalue())
        if csv != STDOUT:
            say(f"wrote {csv}")
            if json_target != STDOUT:
                file, page = (shlex.quote(str(f)) for f in (csv, Path(csv).with_suffix(".html")))
                check = f"pinsing check {request.words} {file} {'--deg' if deg else '--rad'}"
                emit_lines(f"  Next, to play the path: {check} -o {page}")
    elif json_target != STDOUT:
        emit_lines("  Next: the same with -o joints.csv, which writes the joint values")
    if plot is not None:
        off_screen()
        from pinsing.plot.curves import path_sheet

        save_figure(path_sheet(plan, form), plot)
    return 0


def _write(target: str | Path, text: str) -> None:
    if target == STDOUT:
        emit_lines(text.rstrip("\n"))
    else:
        from pinsing.atomic_write import write_text

        write_text(target, text)


def _ranges(text: str, degrees: bool) -> dict[str, tuple[float, float]]:
    """Ranges by name from ``x=-0.1..0.1,yaw=-30..30``, in metres and radians."""
    from pinsing.postures.placement import ANGLES

    out: dict[str, tuple[float, float]] = {}
    for part in text.split(","):
        name, _, ends = (word.strip() for word in part.partition("="))
        turns = name in ANGLES
        values = parse_numbers(ends.replace("..", " "), f"--place {name}", degrees and turns)
        OptionError.refuse_if(
            ends.count("..") != 1 or len(values) != 2 or name in out,
            f"--place {part!r}: write each range once, as in x=-0.1..0.1",
        )
        OptionError.refuse_if(
            turns and not degrees and max(map(abs, values)) > 2 * math.pi,
            f"--place {part} is over a turn: for degrees add --deg",
        )
        low, high = (math.radians(v) if degrees and turns else v for v in values)
        out[name] = (low, high)
    return out


def _typed(T: Array, degrees: bool) -> str:
    """A pose (4, 4) as `_frame` reads it."""
    import pinocchio as pin

    angles = pin.rpy.matrixToRpy(T[:3, :3]) * (180 / math.pi if degrees else 1.0)
    return ",".join(f"{x + 0.0:.6g}" for x in (*T[:3, 3], *angles.round(9)))


def _frame(text: str | None, option: str, degrees: bool) -> Array:
    """A pose (4, 4) from three numbers, or six with roll, pitch, yaw; the identity from None."""
    import numpy as np

    T = np.eye(4)
    if text is None:
        return T
    values = _pose(text, option, degrees)
    if max(map(abs, values[:3])) > 20:
        metres = ",".join(f"{x / 1000:g}" for x in values[:3])
        raise OptionError(
            f"{option} {text}: its lengths are metres, with --mm too: for millimetres type {metres}"
        )
    T[:3, 3] = values[:3]
    if len(values) == 6:
        import pinocchio as pin

        T[:3, :3] = pin.rpy.rpyToMatrix(np.array(values[3:]))
    return T


def _pose(text: str, option: str, degrees: bool) -> list[float]:
    """Three numbers, or six with roll, pitch, yaw, in metres and radians."""
    values = parse_numbers(text, option, degrees)
    OptionError.refuse_if(
        len(values) not in (3, 6),
        f"{option} needs 3 numbers (x, y, z) or 6 (and roll, pitch, yaw): {text!r}",
    )
    if degrees:
        doubt_degrees(values[3:], option)
    elif max(map(abs, values[3:]), default=0.0) > 2 * math.pi:
        raise OptionError(f"{option} {text}: angles over a turn: for degrees add --deg")
    return [*values[:3], *(map(math.radians, values[3:]) if degrees else values[3:])]


@command("line")
@arm_options
@once_option(
    "--q",
    "q",
    required=True,
    metavar="Q1,Q2,...",
    help="Where it starts: joint values, base to tip, radians (or --deg) and metres.",
)
@once_option(
    "--to",
    "target",
    required=True,
    metavar="X,Y,Z[,R,P,Y]",
    help="Target of the tip in the base frame: metres; roll, pitch, yaw, or as it is.",
)
@click.option(
    "--speed", type=float, default=0.25, show_default=True, metavar="M/S", help="Tip speed."
)
@deg_option
@json_option
@fail_option
def line_command(
    request: RobotRequest,
    q: str,
    target: str,
    speed: float,
    deg: bool,
    json_target: str | Path | None,
    fail_if_singular: bool,
) -> int:
    """Follow a straight line of the tip: where it ends, what it meets, which speed is possible.

    Example: pinsing line ur5 --q 10,-70,75,-90,-80,0 --deg --to 0.3,0.2,0.5
    """
    parse_numbers(q, "--q", deg)
    pose, degrees = _pose(target, "--to", deg), in_degrees(deg)
    shown = [*pose[:3], *map(math.degrees, pose[3:])] if degrees else pose
    arm = request.load()
    from pinsing.families.solve import form_to_measure
    from pinsing.postures.changes import line_postures
    from pinsing.proximity.line import check_line, left_limits, line_details, line_summary, stopped

    start = joint_vector(arm, q, "--q", deg)
    with doing("following the line"):
        form = form_to_measure(arm)
        line = check_line(arm, start, pose, speed, forms=form)
    if line.outcome != "reached" or stopped(line) or left_limits(line):
        with doing("following the line from the other postures"):
            line = replace(line, postures=line_postures(arm, start, pose, forms=form))
    if not emit_json(line, json_target):
        same = f"--to {','.join(f'{x:.6g}' for x in shown)} --speed {speed:g}"
        answer = line_summary(line, degrees, request.words, same)
        emit_lines(f"{answer}\n\n{line_details(line, degrees)}")
    return int(fail_if_singular and (line.outcome == "singular" or bool(line.crossings)))
