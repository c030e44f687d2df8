"""Time two installations of pinsing against each other, in turns.

    python scripts/bench/before_after.py --before OTHER/bin/python [closed kernel functions start]
    python scripts/bench/before_after.py --before OTHER/bin/python survey --rounds 2

One process of each installation stands by and is asked in turns, so that a change of clock rate or
another program on the machine touches both alike; starts are processes of their own, in turns too.
Times are those of the processor, children included, and minima over the rounds: read the ratios.
Only what `pinsing` itself exports is used, so that an older version may be compared.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # for survey

ARMS: dict[str, dict[str, str]] = {
    "Stanford arm": {"robot": "stanford"},
    "PUMA 560": {"robot": "puma560"},
    "ABB IRB 1400": {"robot": "irb1400"},
    "UR5": {"robot": "ur5"},
    "surgical arm of 7 joints": {"robot": "surgical7"},
    "KUKA iiwa 14": {"robot": "iiwa14"},
    "Franka Panda": {"robot": "panda"},
    "UFACTORY xArm 7": {"robot": "xarm7"},
    "Talos, left arm of 7 joints": {
        "robot": "talos_full_v2",
        "tip": "gripper_left_base_link",
        "base": "torso_2_link",
    },
    "Tiago, 8 joints": {"robot": "tiago", "tip": "arm_tool_link"},
}
VALUES = ("UR5", "Franka Panda", "PUMA 560", "KUKA iiwa 14", "SCARA", "SO-101", "planar 3R")
MORE = {
    "SCARA": {"robot": "scara"},
    "SO-101": {"robot": "so101"},
    "planar 3R": {"robot": "planar3r"},
}
STARTS = (
    ["--help"],
    ["families", "ur5"],
    ["at", "ur5", "--q", "0,-1,1,0,1,0"],
    ["analyze", "ur5"],
    ["analyze", "panda"],
)
COUNT = 5_000


def _named(package: Any, name: str) -> Any:
    """A public function, wherever a version has it."""
    homes = [package, *(getattr(package, m, None) for m in ("kinematics", "sampling"))]
    return next(getattr(home, name) for home in homes if hasattr(home, name))


SURVEY_STEP = 3
SURVEY_JOINTS = 8
SURVEY_SECONDS = 20.0
"""Every so many-th geometry of so many joints at most, as the survey tells them apart."""
FUNCTIONS: dict[str, Callable[[Any, Any, Any], object]] = {
    "`at`, of one configuration": lambda p, arm, Q: p.at(arm, Q[0]),
    f"`task_jacobians`, {COUNT:,}": lambda p, arm, Q: _named(p, "task_jacobians")(
        arm, Q, threads=1
    ),
    "`refine_many`, 50": lambda p, arm, Q: _named(p, "refine_many")(arm, Q[:50]),
    "`sweep`, one joint at a time": lambda p, arm, Q: _named(p, "sweep")(arm, levels=1),
    "`sigma_map`, 10^6": lambda p, arm, Q: _named(p, "sigma_map")(arm, count=10**6, threads=1),
    "`sigma_map`, 10^6, every joint": lambda p, arm, Q: _named(p, "sigma_map")(
        arm, count=10**6, joints=arm.joints, threads=1
    ),
}
"""What both installations export: asked with the module, an arm and its configurations."""
OF_FUNCTIONS = ("UR5", "Franka Panda", "Stanford arm")


def used() -> float:
    """Processor time of this process and of its children that have ended, seconds."""
    own, others = resource.getrusage(resource.RUSAGE_SELF), os.times()
    spent = own.ru_utime + own.ru_stime
    return float(spent + others.children_user + others.children_system)


def instruction_sets(pinsing: Any, arm: Any) -> Callable[[str], str]:
    """What `engine` is to be for an instruction set: older versions take none by name."""
    from pinsing._batch import engine

    def named(isa: str) -> str:
        engine._isa = lambda name: isa if name is None else name
        return "batch"

    try:
        pinsing.singular_values(arm, [[0.0] * arm.n], engine="baseline")
    except pinsing.PinsingError:
        return named
    return lambda isa: isa


def work() -> None:
    """Body of the process that stands by: a question a line, seconds as the answer."""
    import numpy as np

    import pinsing

    arms: dict[str, Any] = {}
    Q: dict[str, Any] = {}
    for line in sys.stdin:
        task, name, isa = json.loads(line)
        if task == "survey":  # a new arm each time: what is found once an arm counts
            arm = pinsing.load(**name)
            began = used()
            pinsing.closed_form(arm, seconds=SURVEY_SECONDS, prove=False)
            print(json.dumps(used() - began), flush=True)
            continue
        if name not in arms:
            arms[name] = pinsing.load(**{**ARMS, **MORE}[name])
            Q[name] = np.random.default_rng(0).uniform(-3, 3, (COUNT, arms[name].n))
        arm = arms[name]
        if task == "closed":
            began = used()
            pinsing.closed_form(arm, seconds=60, prove=False)
            spent = used() - began
        elif task in FUNCTIONS:
            began = used()
            FUNCTIONS[task](pinsing, arm, Q[name])
            spent = used() - began
        else:
            values = pinsing.singular_values
            of_set = instruction_sets(pinsing, arm)
            began = time.process_time()
            values(arm, Q[name], engine=of_set(isa), threads=1)
            spent = time.process_time() - began
        print(json.dumps(spent), flush=True)


class Asked:
    """A process of one installation."""

    def __init__(self, python: str) -> None:
        self.python = python
        command = [python, str(Path(__file__).resolve()), "--work"]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def ask(self, task: str, name: str | dict[str, Any], isa: str = "auto") -> float:
        """Seconds of one task on one arm, in the process that stands by."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps([task, name, isa]) + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise SystemExit(f"{self.python}: ended at {task} {name}")
        return float(json.loads(answer))

    def start(self, arguments: Sequence[str]) -> float:
        """Processor time of one command, from its start to its end."""
        code = (
            "import sys, pinsing.cli as cli; sys.argv[0] = 'pinsing'; "
            "getattr(cli, 'program', cli.main)()"
        )
        began = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([self.python, "-c", code, *arguments], check=False, capture_output=True)
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        return ended.ru_utime - began.ru_utime + ended.ru_stime - began.ru_stime


def row(name: str, pairs: Sequence[tuple[float, float]], unit: float, digits: int) -> str:
    """A line of a table: minima, and the ratio of these."""
    before, after = (min(pair[k] for pair in pairs) for k in (0, 1))
    shown = f"{before * unit:.{digits}f} | {after * unit:.{digits}f}"
    return f"| {name} | {shown} | {after / before:.2f} |"


def surveyed() -> list[dict[str, Any]]:
    """What to load for every third geometry of the robots of example-robot-data."""
    from oracle import survey

    import pinsing
    from pinsing.description.catalog import data_folder

    folder = data_folder()
    assert folder is not None, "example-robot-data is not installed"
    found: dict[str, dict[str, Any]] = {}
    for job in survey.jobs()[0]:
        given = {"robot": str(folder / job.file), "tip": job.tip, "base": job.base}
        try:
            arm = pinsing.load(**given)
        except pinsing.PinsingError:
            continue
        if arm.n <= SURVEY_JOINTS:
            found.setdefault(survey.identity(arm), given)
    return [*found.values()][::SURVEY_STEP]


def survey_table(both: tuple[Asked, Asked], rounds: int) -> None:
    """Medians over chains, of times and of ratios, and what takes longer than before."""
    least: list[tuple[str, float, float]] = []
    for given in surveyed():
        pairs = [[asked.ask("survey", given) for asked in both] for _ in range(rounds)]
        before, after = (min(pair[k] for pair in pairs) for k in (0, 1))
        name = f"{Path(given['robot']).stem} {given['tip']}"
        least.append((name, 1e3 * before, 1e3 * after))
        print(f"{name}: {before * 1e3:.1f} {after * 1e3:.1f} ms", file=sys.stderr, flush=True)
    times = [statistics.median(entry[k] for entry in least) for k in (1, 2)]
    ratios = [after / before for _, before, after in least]
    long = [after / before for _, before, after in least if before > 50]
    print(f"\nsurvey, {len(least)} chains: medians {times[0]:.1f} ms before, {times[1]:.1f} after,")
    print(f"    {times[1] / times[0]:.2f} of it; median ratio {statistics.median(ratios):.2f}")
    print(f"    of {len(long)} chains above 50 ms before: {statistics.median(long):.2f}")
    for name, before, after in least:
        if after > 1.1 * before:
            print(f"    slower: {name}, {before:.1f} before, {after:.1f} after")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("tables", nargs="*", default=["closed", "kernel", "functions", "start"])
    parser.add_argument("--before", metavar="PYTHON", help="interpreter of the other installation")
    parser.add_argument("--rounds", type=int, default=12)
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        work()
        return
    if not options.before:
        parser.error("say which installation to compare with: --before OTHER/bin/python")
    both = Asked(options.before), Asked(sys.executable)

    def measured(ask: Any, rounds: int) -> list[tuple[float, float]]:
        return [(ask(both[0]), ask(both[1])) for _ in range(rounds)]

    if "closed" in options.tables:
        print("| closed form, ms | before | after | after / before |\n|---|---:|---:|---:|")
        for name in ARMS:
            pairs = measured(lambda a, n=name: a.ask("closed", n), options.rounds)
            print(row(name, pairs, 1e3, 0), flush=True)
    if "kernel" in options.tables:
        from pinsing._batch import engine

        print("\n| singular values, us | before | after | after / before |\n|---|---:|---:|---:|")
        for name in VALUES:
            for isa in engine.isa_names():
                ask = lambda a, n=name, i=isa: a.ask("kernel", n, i)  # noqa: E731
                pairs = measured(ask, 10 * options.rounds)
                print(row(f"{name}, {isa}", pairs, 1e6 / COUNT, 3), flush=True)
    if "functions" in options.tables:
        print("\n| function, ms | before | after | after / before |\n|---|---:|---:|---:|")
        for task in FUNCTIONS:
            for name in OF_FUNCTIONS:
                pairs = measured(lambda a, t=task, n=name: a.ask(t, n), options.rounds)
                print(row(f"{task}: {name}", pairs, 1e3, 1), flush=True)
    if "survey" in options.tables:
        survey_table(both, options.rounds)
    if "start" in options.tables:
        print("\n| command, s | before | after | after / before |\n|---|---:|---:|---:|")
        for arguments in STARTS:
            pairs = measured(lambda a, x=arguments: a.start(x), max(3, options.rounds // 3))
            print(row(f"`{' '.join(arguments)}`", pairs, 1.0, 2), flush=True)


if __name__ == "__main__":
    main()
