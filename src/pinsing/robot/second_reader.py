"""A second opinion on a file: what yourdfpy, which shares no code with ours, reads in it."""

from __future__ import annotations

import logging
import warnings
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from pinsing.measures import ROUNDING, SEED
from pinsing.robot.arm import Arm
from pinsing.robot.models import joint_value

if TYPE_CHECKING:
    from yourdfpy import URDF

CONFIGURATIONS = 20
_TABLES = {".yaml", ".yml"}
# Both read the same decimals, and multiply some twenty matrices of entries up to a few metres.


@dataclass(frozen=True)
class SecondReading:
    """Joints, limits and forward kinematics by yourdfpy, compared with Pinocchio's."""

    reader: str  # name and version
    seed: int
    configurations: int
    links: tuple[str, ...]  # compared with the root link at each configuration
    translation: float  # metres, largest
    rotation: float  # radians, largest
    differences: tuple[str, ...]
    note: str  # why yourdfpy could not read the file

    def __str__(self) -> str:
        if self.note:
            return f"{self.reader} cannot read the file: {self.note}"
        return (
            f"{self.reader} DIFFERS: {'; '.join(self.differences)}"
            if self.differences
            else f"{self.reader} agrees: joints, limits, and {len(self.links)} links at "
            f"{self.configurations} random configurations (seed {self.seed}) within "
            f"{self.translation:.0e} m and {self.rotation:.0e} rad"
        )


def second_reading(arm: Arm) -> SecondReading | None:
    """Compare Pinocchio's reading of a URDF with yourdfpy's; None for other arms."""
    # yourdfpy gets the text of our strict reader, not the file: no entities, no network, no meshes.
    path, shapes = arm.source.path, arm.source.shapes
    if shapes is None or (path is not None and path.suffix.lower() in _TABLES):
        return None
    from importlib.metadata import version

    import yourdfpy  # brings trimesh and SciPy: half a second

    reader = f"yourdfpy {version('yourdfpy')}"
    logging.getLogger("yourdfpy").setLevel(logging.CRITICAL)  # what it warns of is compared
    links: tuple[str, ...] = ()
    moved = turned = 0.0
    differences: list[str] = []
    note = ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            robot = yourdfpy.URDF.load(BytesIO(shapes.text.encode()), load_meshes=False)
        differences = [*_joints(arm, robot), *_limits(arm, robot)]
        if not differences:
            names = [robot.joint_map[arm.source.full_model.names[j]].child for j in arm.source.kept]
            # What the joints of the chain move, and the tip if it is a link.
            links = tuple(dict.fromkeys(n for n in (*names, arm.tip) if n in robot.link_map))
            moved, turned = _placements(arm, robot, links)
            if max(moved, turned) > ROUNDING:
                differences.append(f"links are up to {moved:.3g} m and {turned:.3g} rad apart")
    except Exception as error:  # another's code: whatever it raises is no fault of the robot
        note = f"{type(error).__name__} {error}"
    return SecondReading(
        reader, SEED, CONFIGURATIONS, links, moved, turned, tuple(differences), note
    )


def _joints(arm: Arm, robot: URDF) -> list[str]:
    """Joints of the chain that the other has not, or of another kind or direction of motion."""
    model = arm.source.full_model
    said = []
    for j in arm.source.kept:
        name, kind = model.names[j], model.joints[j].shortname()
        if (other := robot.joint_map.get(name)) is None:
            said.append(f"there is no joint {name}")
        elif (other.type == "prismatic") != kind.startswith("JointModelP"):
            said.append(f"joint {name} is {other.type}, not {kind}")
    return said


def _limits(arm: Arm, robot: URDF) -> list[str]:
    model = arm.source.full_model
    said = []
    for j in arm.source.kept:
        other = robot.joint_map.get(model.names[j])
        if other is None or other.type == "continuous" or model.nqs[j] != 1:
            continue
        at = model.idx_qs[j]
        own = (float(model.lowerPositionLimit[at]), float(model.upperPositionLimit[at]))
        limit = other.limit
        their = (None, None) if limit is None else (limit.lower or 0.0, limit.upper or 0.0)
        if their != own:
            said.append(
                f"limits of {other.name} are {their[0]} to {their[1]}, not {own[0]} to {own[1]}"
            )
    return said


def _placements(arm: Arm, robot: URDF, links: tuple[str, ...]) -> tuple[float, float]:
    """Largest differences of links' placements in the root link [m], [rad]."""
    model = arm.source.full_model
    data, names = model.createData(), model.names
    told = [
        j
        for j, name in enumerate(names)
        if j and name in robot.actuated_joint_names and model.nqs[j] <= 2
    ]
    moved = turned = 0.0
    for q in arm.space.sample(CONFIGURATIONS, np.random.default_rng(SEED)):
        full = arm.full_q(q)
        pin.framesForwardKinematics(model, data, full)
        robot.update_cfg({names[j]: float(joint_value(model, j, full)) for j in told})
        for link in links:
            own = data.oMf[model.getFrameId(link, pin.FrameType.BODY)]
            their = robot.get_transform(link)
            moved = max(moved, float(np.linalg.norm(own.translation - their[:3, 3])))
            turned = max(turned, float(np.linalg.norm(pin.log3(own.rotation.T @ their[:3, :3]))))
    return moved, turned
