"""Arms that the tests share, read by Pinocchio itself: no other part of pinsing is needed."""

import functools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing.kinematics.jacobian import tip_placement
from pinsing.robot.arm import Arm, Coupling
from pinsing.robot.load import load

URDF = Path(__file__).parent.parent / "urdf"
_DATA = Path("cmeel.prefix/share/example-robot-data/robots")


@functools.cache
def textbook(name: str, task: str = "pose") -> Arm:
    """One of the arms in ``urdf/``."""
    return load(pin.buildModelFromUrdf(str(URDF / f"{name}.urdf")), task=task)


@functools.cache
def data_robot(path: str, tip: str | None = None) -> Arm:
    """A robot of example-robot-data, by its path below ``robots/``."""
    file = distribution("example-robot-data").locate_file(_DATA / path)
    return load(pin.buildModelFromUrdf(str(file)), tip=tip)


def ur5() -> Arm:
    return data_robot("ur_description/urdf/ur5_robot.urdf", tip="tool0")


def place(xyz: Sequence[float] = (0.0, 0.0, 0.0), R: np.ndarray | None = None) -> pin.SE3:
    return pin.SE3(np.eye(3) if R is None else R, np.array(xyz, dtype=float))


def serial(
    joints: Iterable[tuple[Any, ...]],
    tip: pin.SE3 | None = None,
    lower: float = -2.0,
    upper: float = 2.0,
    name: str = "made",
    names: str = "j",
) -> pin.Model:
    """A chain of joints: Pinocchio's, where each stands, and its own limits where it has some."""
    model, parent = pin.Model(), 0
    model.name = name
    for i, (joint, at, *own) in enumerate(joints, 1):
        wrapped, (low, high) = pin.JointModel(joint), own or (lower, upper)
        effort, ones = np.full(wrapped.nv, 1e3), np.ones(wrapped.nq)
        limits = (effort, effort, low * ones, high * ones)
        parent = model.addJoint(parent, joint, at, f"{names}{i}", *limits)
        model.addJointFrame(parent)
    model.addFrame(pin.Frame("tip", parent, 0, tip or place(), pin.FrameType.OP_FRAME))
    return model


def planar(lengths: tuple[float, ...], task: str = "position", limit: float = np.pi) -> Arm:
    """Planar arm of parallel revolute joints along z."""
    *places, tip = (place((x, 0, 0)) for x in (0.0, *lengths))
    joints = [(pin.JointModelRZ(), p) for p in places]
    model = serial(joints, tip, -limit, limit, f"planar{len(lengths)}r", "q")
    return load(model, tip="tip", task=task)


def pinocchio_jacobian(arm: Arm, q: np.ndarray) -> np.ndarray:
    """By other calls than ours: configuration by integration, all Jacobians, then the frame's."""
    model, data = arm.model, arm.model.createData()
    full = pin.integrate(model, pin.neutral(model), np.asarray(q, dtype=float))
    pin.computeJointJacobians(model, data, full)
    pin.updateFramePlacements(model, data)
    return pin.getFrameJacobian(model, data, arm.tip_id, pin.LOCAL_WORLD_ALIGNED)


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


def differences(f: Callable[[np.ndarray], Any], q: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Derivative of f at q (..., n), along its own last axis, by central differences."""
    each = step * np.eye(q.shape[-1])
    return np.stack([(f(q + e) - f(q - e)) / (2 * step) for e in each], axis=-1)


def draw(arm: Arm, rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.uniform(*arm.span, (count, arm.n))


def coupled(arm: Arm, matrix: np.ndarray, offset: np.ndarray) -> Arm:
    """The arm with joints that all follow its first ones, as mimic joints do."""
    cut = ("joints", "prismatic", "lower", "upper")
    first = {name: getattr(arm, name)[: matrix.shape[1]] for name in cut}
    return replace(arm, **first, coupling=Coupling(matrix, offset))


def told(arm: Arm) -> list[str]:
    """An arm in words: its ends, its joints with their limits, and what is noted of it."""
    rows = zip(arm.joints, arm.lower, arm.upper, arm.prismatic, strict=True)
    joints = [
        f"{name} {low:.4g} to {high:.4g}{' m' if slides else ''}"
        for name, low, high, slides in rows
    ]
    notes = [f"note: {note}" for note in arm.notes]
    q = np.arange(1, arm.n + 1) / 10
    place = tip_placement(arm, q)
    numbers = np.round([place.translation, *place.rotation.T[[0, 2]]], 4) + 0.0
    at, x, z = (" ".join(f"{number:g}" for number in row) for row in numbers)
    where = f"at 0.1, 0.2, ... the tip is at {at}, with its x along {x} and z along {z}"
    return [f"{arm.name}, from {arm.base} to {arm.tip}", ", ".join(joints), where, *notes]
