"""Closed forms of long chains and of positions: what is found in a given time.

    python scripts/bench/long_chains.py [CHAIN ...] [--seconds 60]
    python scripts/bench/long_chains.py --write

Chains from a foot to a hand, torso and arm, planar arms of many links, positions of arms with seven
joints. The search ends by the clock, so that on a busy machine less is found.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin

from pinsing.families import ClosedForm, closed_form
from pinsing.robot.arm import Arm
from pinsing.robot.load import load

CHAINS: dict[str, dict[str, str]] = {
    "UR5, from the tool back to the base": {"robot": "ur5", "base": "tool0", "tip": "base_link"},
    "Talos, left foot to right foot": {
        "robot": "talos",
        "base": "left_sole_link",
        "tip": "right_sole_link",
    },
    "Talos, torso and left arm": {"robot": "talos_full_v2", "tip": "wrist_left_ft_tool_link"},
    "iCub, torso and left arm": {"robot": "icub", "base": "root_link", "tip": "l_hand"},
    "Talos, left foot to left hand": {
        "robot": "talos",
        "base": "left_sole_link",
        "tip": "gripper_left_base_link",
    },
    "Unitree G1, left foot to left hand": {
        "robot": "g1",
        "base": "left_ankle_roll_link",
        "tip": "left_rubber_hand",
    },
    "Baxter, left arm, position": {"robot": "baxter", "tip": "left_gripper", "task": "position"},
    "Unitree G1, left arm, position": {
        "robot": "g1",
        "tip": "left_rubber_hand",
        "base": "torso_link",
        "task": "position",
    },
    "Tiago Pro, left arm, position": {
        "robot": "tiago_pro",
        "tip": "arm_left_tool_link",
        "base": "torso_lift_link",
        "task": "position",
    },
}
_X, _Y, _Z = pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ
CARRIERS = {
    "a rail": (_Y,),
    "two rails": (_X, _Y),
    "a gantry": (_X, _Y, _Z),
    "a positioner of two turns": (pin.JointModelRY, pin.JointModelRZ),
    "a mobile base (x, y, turn)": (_X, _Y, pin.JointModelRZ),
}
CARRIED: dict[str, dict[str, str]] = {
    "ur5": {},
    "irb1400": {},
    "iiwa14": {},
    "panda": {"tip": "panda_hand_tcp"},
}
PLANAR = (6, 12, 20)

PAGE = Path(__file__).resolve().parents[2] / "docs" / "long_chains.md"


def planar(n: int) -> Arm:
    """A planar arm of n links from 0.3 m on, each 10 mm longer than the one before it."""
    model = pin.Model()
    model.name = f"planar {n}R"
    parent, x = 0, 0.0
    for i in range(n):
        place = pin.SE3(pin.SE3.Identity().rotation, x * pin.utils.eye(3)[:, 0])
        parent = model.addJoint(parent, pin.JointModelRZ(), place, f"q{i + 1}")
        model.lowerPositionLimit[i], model.upperPositionLimit[i] = -3, 3
        x = 0.3 + 0.01 * i
    place = pin.SE3(pin.SE3.Identity().rotation, x * pin.utils.eye(3)[:, 0])
    model.addFrame(pin.Frame("tip", parent, 0, place, pin.FrameType.OP_FRAME))
    return load(model, tip="tip", task="position")


def carried(carrier: str, robot: str) -> Arm:
    """An arm whose base stands on joints of their own, 0.4 m above the last one."""
    arm = load(robot, **CARRIED[robot])
    model, parent = pin.Model(), 0
    model.name = f"{robot} on {carrier}"
    for i, kind in enumerate(CARRIERS[carrier]):
        step = (0.05, 0.02, 0.1) if i else (0.0, 0.0, 0.0)
        place = pin.SE3(pin.utils.eye(3), np.array(step))
        parent = model.addJoint(parent, kind(), place, f"carrier{i + 1}")
        model.lowerPositionLimit[-1], model.upperPositionLimit[-1] = -2, 2
    model.addFrame(pin.Frame("mount", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    place = pin.SE3(pin.utils.eye(3), np.array((0.1, 0.05, 0.4)))
    whole = pin.appendModel(model, arm.model, model.getFrameId("mount"), place)
    return load(whole, tip=arm.tip)


def chains() -> Iterator[tuple[str, Arm]]:
    """Name and arm of each row."""
    for n in PLANAR:
        yield f"planar {n}R, position", planar(n)
    for name, spec in CHAINS.items():
        yield name, load(**spec)
    for carrier in CARRIERS:
        for robot in CARRIED:
            yield f"{robot} on {carrier}", carried(carrier, robot)


def row(name: str, form: ClosedForm) -> str:
    """Its line of the table."""
    codimensions = sorted(f.codimension for f in form.families)
    said = ", ".join(
        f"{codimensions.count(c)} of codimension {c}" for c in sorted(set(codimensions))
    )
    count = f"{len(form.families)} ({said})" if said else "0"
    chain = f"{form.arm.base} to {form.arm.tip}"
    return f"| {name} | {chain} | {form.arm.n} | {form.generic_rank} | {count} | {form.word} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("chains", nargs="*", metavar="CHAIN", help="part of a name; default all")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--write", action="store_true", help="the table in docs/long_chains.md")
    options = parser.parse_args()
    rows = ["| arm | chain | joints | rank | families | word |", "|---|---|---|---|---|---|"]
    for name, arm in chains():
        if options.chains and not any(c.lower() in name.lower() for c in options.chains):
            continue
        started = time.process_time()
        rows.append(row(name, closed_form(arm, seconds=options.seconds)))
        took = time.process_time() - started
        print(f"{rows[-1]} {took:.1f} s of processor time", file=sys.stderr, flush=True)
    table = "\n".join(rows) + "\n"
    if options.write:
        head = PAGE.read_text(encoding="utf-8").partition("| arm |")[0]
        PAGE.write_text(head + table, encoding="utf-8")
    else:
        print(table)


if __name__ == "__main__":
    main()
