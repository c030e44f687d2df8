"""Closed forms of six-joint arms for tasks of four and five rows, with the time that they take.

    python scripts/bench/tasks.py [ARM ...] [--task vx,vy,vz,wz] [--seconds 60]
    python scripts/bench/tasks.py --write docs/tasks.md
    python scripts/bench/tasks.py --positions --seconds 40

All arms of six joints in urdf/ and example-robot-data, and arms of published tables.
"""

from __future__ import annotations

import argparse
import datetime
import os
import platform
import resource
import sys
import time
from collections import Counter
from collections.abc import Iterator
from math import pi
from pathlib import Path

from postures import arms as with_offset_wrists

from pinsing.description.dh_table import DHRow, DHTable, Placement, bare_urdf
from pinsing.families import closed_form
from pinsing.robot.arm import Arm
from pinsing.robot.load import load

TASKS = ("vx,vy,vz,wz", "tool-axis", "position", "orientation")
LOADED = {
    "Stanford arm": "stanford",
    "PUMA 560": "puma560",
    "ABB IRB 1400": "irb1400",
    "UR3": "ur3",
    "UR5": "ur5",
    "UR10": "ur10",
    "Kinova Jaco j2s6s200": "kinova",
    "Unitree Z1": "z1",
    "Talos, left arm of 6 joints": "talos_arm",
}
POSITIONS: dict[str, dict[str, str]] = {
    "Franka Panda": {"robot": "panda"},
    "UFACTORY xArm 7": {"robot": "xarm7"},
    "KUKA iiwa 14": {"robot": "iiwa14"},
    "SO-101": {"robot": "so101"},
    "Baxter, left arm": {"robot": "baxter", "tip": "left_gripper"},
    "Tiago": {"robot": "tiago", "tip": "arm_tool_link", "base": "torso_lift_link"},
    "Tiago Pro, left arm": {
        "robot": "tiago_pro",
        "tip": "arm_left_tool_link",
        "base": "torso_lift_link",
    },
    "Talos, left arm of 7 joints": {
        "robot": "talos_full_v2",
        "tip": "gripper_left_base_link",
        "base": "torso_2_link",
    },
    "Unitree G1, left arm": {"robot": "g1", "tip": "left_rubber_hand", "base": "torso_link"},
}
OFFSET_WRISTS = ("Fanuc CRX-10iA/L", "ABB GoFa 5")

Rows = list[tuple[float, float, float]]


def _anthropomorphic(
    a: tuple[float, float, float], d: tuple[float, float, float], shoulder: float = 0.0
) -> Rows:
    """Alpha (degrees), a, d of an arm with a spherical wrist: the usual industrial one."""
    return [
        (-90, a[0], d[0]),
        (0, a[1], shoulder),
        (-90, a[2], 0),
        (90, 0, d[1]),
        (-90, 0, 0),
        (0, 0, d[2]),
    ]


# Lengths commonly given for these arms, metres; zeros of the joints are of no account here.
PUBLISHED: dict[str, Rows] = {
    "ABB IRB 1600-6/1.2": _anthropomorphic((0.15, 0.475, 0), (0.4865, 0.6, 0.065)),
    "ABB IRB 2600-12/1.65": _anthropomorphic((0.15, 0.7, 0.115), (0.445, 0.795, 0.085)),
    "KUKA KR 6 R900": _anthropomorphic((0.025, 0.455, 0.035), (0.4, 0.42, 0.08)),
    "Fanuc LR Mate 200iD": _anthropomorphic((0.05, 0.33, 0.035), (0.33, 0.335, 0.08)),
    "Stäubli TX60": _anthropomorphic((0, 0.29, 0), (0.375, 0.31, 0.07), shoulder=0.02),
    "UR5e": [
        (90, 0, 0.1625),
        (0, -0.425, 0),
        (0, -0.3922, 0),
        (90, 0, 0.1333),
        (-90, 0, 0.0997),
        (0, 0, 0.0996),
    ],
    "UFACTORY xArm 6": [
        (-90, 0, 0.267),
        (0, 0.28948866, 0),
        (-90, 0.0775, 0),
        (90, 0, 0.3425),
        (-90, 0.076, 0),
        (0, 0, 0.097),
    ],
}

TOOLS = ("UR5e", "KUKA KR 6 R900", "UFACTORY xArm 6")
TOOL = (0.06, 0.02, 0.12)
"""Of these arms again, metres, seen from the flange: the last joint matters then, too."""

PAGE = """# Tasks of four and five rows

Written by `python scripts/bench/tasks.py --write docs/tasks.md` on {date}, Python {python}, load
{load:.0f} on {cores} processors, at most {seconds:g} s on the clock an answer.

Arms of six joints, and tasks that leave motions free: `vx,vy,vz,wz` (a tool that stays upright
turns about the vertical), `tool-axis` (drilling, welding, polishing: the turn about the tool's own
axis is free; `--tool-axis x` for another axis), `position` and `orientation`. Each cell has the
word, the number of families and the seconds of processor time of the closed form, its child
process included, as `pinsing families` gives it. *proven*: a certificate was found and accepted.
*probable*: the search ended and nothing is known to be missing. *counted*: all minors took too
long; families come from neighbouring axes and from singular points on slices over small fields, and
that nothing is missing rests on a count of such points.

{said}

{table}

{gaps}\
CRX-10iA/L and GoFa 5 have the lengths of Elias and Wen (arXiv 2501.18505), the arms from ABB IRB
1600 on those commonly given for them, which were not held against a data sheet; the others are of
`pinsing list`. The tool off the flange is at {tool} mm from it.

{positions}
"""
SECTION = """## Positions of arms with more joints

The task is the position of the tip (`--task position`): singular where all axes meet one line
through it, or are parallel to it. At most {seconds:g} s on the clock, load {load:.0f}; the seconds
are of processor time, with a certificate looked for as far as a few seconds lead.

| arm | joints | families | word | s |
|---|---|---|---|---|
{table}
"""


def arms() -> Iterator[tuple[str, Arm]]:
    """Name and arm of each row."""
    for name, robot in LOADED.items():
        yield name, load(robot)
    yield from with_offset_wrists(list(OFFSET_WRISTS)).items()
    for name, rows in (
        PUBLISHED | {f"{n}, a tool off the flange": PUBLISHED[n] for n in TOOLS}
    ).items():
        off = name not in PUBLISHED
        table = DHTable(
            name="arm",
            convention="standard",
            tool=Placement(xyz=TOOL, rpy=(0.0, 0.0, 0.0)) if off else None,
            rows=tuple(
                DHRow(alpha * pi / 180, a, d, 0.0, "revolute", f"q{i}", -pi, pi)
                for i, (alpha, a, d) in enumerate(rows, 1)
            ),
        )
        yield name, load(bare_urdf(table), tip="tool0")


def positions(seconds: float) -> str:
    """The section on positions."""
    lines, gaps = [], []
    for name, words in POSITIONS.items():
        options = {k: v for k, v in words.items() if k != "robot"}
        arm = load(words["robot"], task="position", **options)
        start = processor_seconds()
        form = closed_form(arm, seconds=seconds)
        took = processor_seconds() - start
        counts = Counter(f.codimension for f in form.families)
        said = ", ".join(f"{k} of codimension {c}" for c, k in sorted(counts.items()))
        word = "counted" if form.complete and form.slice_count else form.word
        lines.append(f"| {name} | {arm.n} | {said or 'none'} | {word} | {took:.1f} |")
        gaps += [f"- Not complete: {name}: {gap}." for gap in form.gaps]
        print(lines[-1], file=sys.stderr, flush=True)
    text = SECTION.format(seconds=seconds, load=os.getloadavg()[0], table="\n".join(lines))
    return text + ("\n" + "\n".join(gaps) if gaps else "")


def processor_seconds() -> float:
    """Of this process, and of its children that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def main() -> None:
    """Print or write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("arms", nargs="*", metavar="ARM", help="part of a name; default all")
    parser.add_argument("--task", action="append", help="default all four")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--positions", action="store_true", help="that section alone")
    parser.add_argument("--write", type=Path, metavar="FILE")
    options = parser.parse_args()
    if options.positions:
        print(positions(options.seconds))
        return
    tasks = options.task or list(TASKS)
    lines, gaps = list[str](), list[str]()
    took, missing = dict[str, list[float]](), dict[str, int]()
    for name, arm in arms():
        if options.arms and not any(a.lower() in name.lower() for a in options.arms):
            continue
        cells = []
        for task in tasks:
            start = processor_seconds()
            form = closed_form(arm.with_task(task), seconds=options.seconds)
            seconds = processor_seconds() - start
            took.setdefault(task, []).append(seconds)
            missing[task] = missing.get(task, 0) + (not form.complete)
            word = "counted" if form.complete and form.slice_count else form.word
            cells.append(f"{word}, {len(form.families)}, {seconds:.2f}")
            gaps += [f"- Not complete: {name}, `{task}`: {gap}." for gap in form.gaps]
        lines.append(f"| {name} | {' | '.join(cells)} |")
        print(lines[-1], file=sys.stderr, flush=True)
    said = "; ".join(
        f"`{task}` complete on {len(s) - missing[task]} of {len(s)}, at most {max(s):.1f} s"
        for task, s in took.items()
    )
    head = f"| arm | {' | '.join(f'`{t}`' for t in tasks)} |\n|---|{'---|' * len(tasks)}"
    page = PAGE.format(
        date=datetime.datetime.now(tz=datetime.timezone.utc).date(),
        python=platform.python_version(),
        load=os.getloadavg()[0],
        cores=os.cpu_count(),
        seconds=options.seconds,
        said=f"{said[:1].upper()}{said[1:]}.",
        table="\n".join([head, *lines]),
        tool=", ".join(f"{1000 * x:.0f}" for x in TOOL),
        gaps="\n".join(gaps) + "\n\n" if gaps else "",
        positions="" if options.arms else positions(options.seconds),
    )
    if options.write:
        options.write.write_text(page.rstrip() + "\n", encoding="utf-8")
    else:
        print(page)


if __name__ == "__main__":
    main()
