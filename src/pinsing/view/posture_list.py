"""The postures of one pose as a page lists them: click one, watch the way."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.errors import OptionError
from pinsing.robot.arm import Arm

FRAMES = 160
"""Poses of a way between two postures."""


@dataclass(frozen=True, eq=False)
class Posture:
    """An inverse solution of the pose that a page was opened at.

    Attributes
    ----------
    q : (n,) array
        It, radians and metres.
    name : str
        Words of the field, or its number.
    more : str
        Its aspect, and whether it can be reached without a singularity.
    way : (K, n) array or None
        Poses from the first posture to it, on no family; None where there is no way.
    """

    q: Array
    name: str
    more: str
    way: Array | None


class _Changes(Protocol):
    """What `posture_changes` returns."""

    @property
    def q(self) -> Array:
        """The configuration that was given."""

    @property
    def aspect(self) -> int | None:
        """Its aspect."""

    @property
    def names(self) -> tuple[str, ...]:
        """Words of the field for it."""

    @property
    def others(self) -> tuple[Any, ...]:
        """The other solutions."""


def listed_postures(arm: Arm, found: _Changes) -> tuple[Posture, ...]:
    """The postures of a pose in the order of `posture_changes`, that at hand first.

    Raises
    ------
    OptionError
        If they are of an arm with other joints.
    """
    if len(found.q) != arm.n:
        raise OptionError(f"the postures are of {len(found.q)} joints; {arm.name} has {arm.n}")
    here = "singular" if found.aspect is None else f"aspect {found.aspect}"
    out = [
        Posture(found.q, ", ".join(found.names) or "posture 1", f"{here}: where it starts", None)
    ]
    for number, other in enumerate(found.others, 2):
        s, way = other.solution, other.connection
        path = None
        if not s.regular:
            said = "singular"
        elif way is None:
            said = "outside the limits" if not s.within_limits else "the start is singular"
        elif way.path is not None:
            path = fine(way.path, arm)
            how = "without a singularity" if way.proven else "without meeting a known family"
            said = f"aspect {other.aspect}: reached {how}"
        elif other.answer == "different":
            said = f"aspect {other.aspect}: only by way of a singularity, proven"
        else:
            said = "undecided"
        out.append(Posture(s.q, ", ".join(other.names) or f"posture {number}", said, path))
    return tuple(out)


def fine(path: Array, arm: Arm) -> Array:
    """Poses along a polyline, evenly by its length, with its corners."""
    weight = np.where(arm.prismatic, 1 / arm.length_scale, 1.0)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0) * weight, axis=1)))
    at = np.union1d(np.linspace(0.0, along[-1], FRAMES), along)
    return np.stack([np.interp(at, along, column) for column in path.T], axis=1)


def posture_data(posture: Posture) -> dict[str, Any]:
    """A posture ready for JSON."""
    return {
        "q": posture.q.tolist(),
        "name": posture.name,
        "more": posture.more,
        "way": None if posture.way is None else posture.way.tolist(),
    }
