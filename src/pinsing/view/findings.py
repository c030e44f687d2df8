"""What a sweep has found, as entries of the list: where no closed form covers it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.families import Branch, JointValue, joint_symbols
from pinsing.families.telling_poses import telling_poses
from pinsing.robot.arm import Arm
from pinsing.sampling.finding import Finding
from pinsing.view.entries import Entry


class _Nearest(NamedTuple):
    value: float
    q: Array


@dataclass(frozen=True, eq=False)
class FixedJoints:
    """Singular set of some joints at fixed values, the others anywhere within the limits."""

    name: str
    text: str
    arm: Arm
    fixed: Mapping[str, float]

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints held."""
        return tuple(self.fixed)

    @property
    def values(self) -> tuple[dict[int, float], ...]:
        """Their values by index."""
        return ({self.arm.joints.index(name): x for name, x in self.fixed.items()},)

    @property
    def branches(self) -> tuple[Branch, ...]:
        """The set as the one branch of a family."""
        values = (JointValue(j, float(x), False) for j, x in self.values[0].items())
        return (Branch(tuple(values), ()),)

    def distance(self, q: npt.ArrayLike) -> _Nearest:
        """Distance of q (n,), radians, or metres over the length scale; and the nearest q."""
        q = np.array(q, dtype=float)
        gaps = []
        for j, value in self.values[0].items():
            gap = q[j] - value
            if not self.arm.prismatic[j]:
                gap -= 2 * np.pi * np.round(gap / (2 * np.pi))
            q[j] -= gap
            gaps.append(gap / self.arm.length_scale if self.arm.prismatic[j] else gap)
        return _Nearest(float(np.linalg.norm(gaps)), q)

    def contains(self, q: npt.ArrayLike, tol: float = 1e-6) -> npt.NDArray[np.bool_]:
        """Tell for q (n,) or (N, n) whether it belongs to the set."""
        array = np.asarray(q, dtype=float)
        flat = [self.distance(x).value <= tol for x in array.reshape(-1, self.arm.n)]
        return np.array(flat).reshape(array.shape[:-1])

    def sample(self, n: int, rng: np.random.Generator) -> Array:
        """Configurations (n, n_joints) within the limits, none if a value is outside."""
        Q = self.arm.space.sample(n, rng)
        for j, value in self.values[0].items():
            Q[:, j] = value
        return Q[~self.arm.space.unreachable(Q).any(axis=1)]


def finding_entries(arm: Arm, findings: Iterable[Finding]) -> tuple[Entry, ...]:
    """List singular findings of a sweep, named S1, S2, ..."""
    symbols = joint_symbols(arm)
    out = []
    singular = [f for f in findings if f.status == "singular"]
    for number, finding in enumerate(singular, 1):
        name, text = f"S{number}", str(finding.condition)
        condition = finding.condition
        family = FixedJoints(name, text, arm, condition.fixed) if condition.minimal else None
        poses = () if family is None else telling_poses(arm, family, 3)
        if not poses and finding.reachable:
            poses = (np.array(finding.configuration.q),)
        out.append(
            Entry(
                name=name,
                text=text,
                poses=poses,
                moved=tuple(
                    i for i, joint in enumerate(arm.joints) if joint in condition.depends_on
                ),
                symbols=symbols,
                prismatic=arm.prismatic,
                kind=finding.configuration.kind,
                codimension=len(condition.fixed) if condition.minimal else None,
                reachable=True if poses else finding.reachable,
                family=family,
            )
        )
    return tuple(out)
