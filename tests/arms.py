"""Arms that the tests share, read by Pinocchio itself: no other part of pinsing is needed."""

import functools
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio as pin

from pinsing.robot.arm import Arm
from pinsing.robot.load import load

URDF = Path(__file__).parent.parent / "urdf"
_DATA = Path("cmeel.prefix/share/example-robot-data/robots")


@functools.cache
def textbook(name: str, task: str = "pose", length_scale: float = 1.0) -> Arm:
    """One of the arms in ``urdf/``."""
    model = pin.buildModelFromUrdf(str(URDF / f"{name}.urdf"))
    return load(model, task=task, length_scale=length_scale)


@functools.cache
def data_robot(path: str, tip: str | None = None, task: str = "pose") -> Arm:
    """A robot of example-robot-data, by its path below ``robots/``."""
    file = distribution("example-robot-data").locate_file(_DATA / path)
    return load(pin.buildModelFromUrdf(str(file)), tip=tip, task=task)


def ur5() -> Arm:
    return data_robot("ur_description/urdf/ur5_robot.urdf", tip="tool0")


def planar(lengths: tuple[float, ...], task: str = "position", limit: float = np.pi) -> Arm:
    """Planar arm of parallel revolute joints along z."""
    model = pin.Model()
    model.name = f"planar{len(lengths)}r"
    parent, x = 0, 0.0
    for i, length in enumerate(lengths):
        place = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        parent = model.addJoint(
            parent,
            pin.JointModelRZ(),
            place,
            f"q{i + 1}",
            np.full(1, 1e3),
            np.full(1, 1e3),
            np.full(1, -limit),
            np.full(1, limit),
        )
        x = length
    tip = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
    model.addFrame(pin.Frame("tip", parent, 0, tip, pin.FrameType.OP_FRAME))
    return load(model, tip="tip", task=task)


_BY_NAME = [
    "stanford", "surgical7", "puma560", "irb1400", "iiwa14", "planar3r", "scara", "ur5",
    "panda", "kinova", "xarm7", "z1", "talos_arm", "tiago", "so100", "so101",
    "hextilt",
]  # fmt: skip
CATALOGUE = [
    *((name, None) for name in _BY_NAME), ("pr2", "r_gripper_tool_frame"),
    ("baxter", "left_gripper_base_link"), ("icub", "l_gripper"), ("g1", "left_rubber_hand"),
]  # fmt: skip
"""Arms that come with pinsing and its data, with their tips where one has to be named."""


def draw(arm: Arm, rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.uniform(*arm.span, (count, arm.n))
