"""A Rerun log of a motion: joints, proven clearance and level along the time (rerun-sdk).

python examples/15_rerun_log.py examples/recorded/ur5_joint_states.jsonl ur5.rrd && rerun ur5.rrd
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import rerun as rr

import pinsing


def main(stream, out):
    """Write a log that the Rerun viewer opens."""
    monitor = pinsing.Monitor(pinsing.closed_form(pinsing.load("ur5")))
    rr.init("pinsing")
    rr.save(out)
    for line in Path(stream).read_text().splitlines():
        state = json.loads(line)
        at = dict(zip(state["name"], state["position"], strict=True))
        speed = dict(zip(state["name"], state["velocity"], strict=True))
        q, dq = ([some[joint] for joint in monitor.joints] for some in (at, speed))
        verdict = monitor.update(q, dq)
        rr.set_time("t", duration=state["t"])
        for joint, value in at.items():
            rr.log(f"joints/{joint}", rr.Scalars(np.degrees(value)))
        rr.log("clearance/lower", rr.Scalars(np.degrees(verdict.lower)))
        rr.log("clearance/upper", rr.Scalars(np.degrees(verdict.upper)))
        if np.isfinite(verdict.time_to_contact):
            rr.log("contact", rr.Scalars(verdict.time_to_contact))
        level = {"clear": "INFO", "warn": "WARN", "stop": "ERROR"}[verdict.level]
        rr.log("level", rr.TextLog(f"{verdict.family} {verdict.title}", level=level))
    rr.disconnect()  # the file is whole
    print(f"wrote {out}: {verdict.level} at the end, {np.degrees(verdict.lower):.1f} deg")


if __name__ == "__main__":
    main(*sys.argv[1:])
