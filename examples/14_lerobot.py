"""LeRobot: an SO-101 by motor names, in degrees, judged as it moves.

python examples/14_lerobot.py /dev/ttyACM0      # the arm (pip install 'lerobot[feetech]')
python examples/14_lerobot.py recorded.jsonl    # observations, one JSON object a line
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import pinsing


def live(port):
    from lerobot.robots.so_follower import SO101Follower, SO101FollowerConfig

    robot = SO101Follower(SO101FollowerConfig(port=port, use_degrees=True))
    robot.connect()
    try:
        while True:
            yield robot.get_observation()
    finally:
        robot.disconnect()


def main(source):
    """Say when the level changes, and which joint leads away."""
    form = pinsing.closed_form(pinsing.load("so101"))
    monitor = pinsing.Monitor(form, warn=math.radians(15), stop=math.radians(5))
    recorded = Path(source).suffix == ".jsonl"
    lines = Path(source).read_text().splitlines() if recorded else ()
    level = None
    for seen in map(json.loads, lines) if recorded else live(source):
        q = [math.radians(seen[f"{motor}.pos"]) for motor in monitor.joints]
        verdict = monitor.update(q)
        if verdict.level == level:
            continue
        level = verdict.level
        slope = pinsing.clearance(form, q, families=[verdict.family]).gradient
        j = int(abs(slope).argmax())
        print(
            f"{level}: at least {math.degrees(verdict.lower):.1f} deg from {verdict.family}; "
            f"{monitor.joints[j]} {'+' if slope[j] > 0 else '-'} leads away"
        )


if __name__ == "__main__":
    main(sys.argv[1])
