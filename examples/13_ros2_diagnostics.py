"""ROS 2: joint states in, a diagnostics topic out.

    python examples/13_ros2_diagnostics.py ur5

Publishes on /diagnostics how near the arm is to a singularity, and a time without contact.
"""

from __future__ import annotations

import math
import sys

import pinsing

LEVELS = {"clear": "OK", "warn": "WARN", "stop": "ERROR"}


class Judge:
    """Turns a JointState into a DiagnosticStatus."""

    def __init__(self, robot, status, pair):
        self.monitor = pinsing.Monitor(pinsing.closed_form(pinsing.load(robot)))
        self.robot, self.status, self.pair = robot, status, pair

    def __call__(self, state):
        at = [list(state.name).index(joint) for joint in self.monitor.joints]
        known = len(state.velocity) == len(state.name)  # NaN stands for not measured
        speeds = state.velocity if known else [math.nan] * len(state.name)
        q, dq = ([some[i] for i in at] for some in (state.position, speeds))
        v = self.monitor.update(q, dq if all(map(math.isfinite, dq)) else None)
        what = f"{v.title or v.family}: at least {math.degrees(v.lower):.1f} deg away (proven)"
        if v.time_to_contact is not None and math.isfinite(v.time_to_contact):
            what += f", no contact before {v.time_to_contact:.2f} s"
        pairs = [self.pair(key=key, value=str(getattr(v, key))) for key in ("family", "lower")]
        level, name = getattr(self.status, LEVELS[v.level]), f"pinsing: {self.robot}"
        return self.status(level=level, name=name, message=what, values=pairs)


def main():
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from sensor_msgs.msg import JointState

    rclpy.init()
    node = rclpy.create_node("pinsing")
    judge = Judge(sys.argv[1], DiagnosticStatus, KeyValue)
    topic = node.create_publisher(DiagnosticArray, "/diagnostics", 10)

    def heard(state):
        try:
            topic.publish(DiagnosticArray(header=state.header, status=[judge(state)]))
        except (ValueError, IndexError) as error:  # of other joints, too short, or not finite
            node.get_logger().warning(f"no verdict: {error}")

    node.create_subscription(JointState, "/joint_states", heard, 1)  # the newest alone counts
    rclpy.spin(node)


if __name__ == "__main__":
    main()
