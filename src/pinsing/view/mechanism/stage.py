"""A mechanism with its list of singular poses, as its page has it."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.loops.modes import home
from pinsing.loops.singular_points import SingularPoint
from pinsing.robot.mechanism import Mechanism
from pinsing.view.links import Links
from pinsing.view.mechanism.engine_data import mechanism_data
from pinsing.view.mechanism.groups import Group, point_words
from pinsing.view.mechanism.linkage import Linkage, plane_normal, side
from pinsing.view.sizes import ARROWS, LEAST, Sizes
from pinsing.view.stage import check_place


@dataclass
class MechanismStage:
    """A mechanism with its list of singular poses, at some configuration.

    Attributes
    ----------
    mechanism : Mechanism
        The mechanism.
    groups : tuple of Group
        The list of the page.
    links : Links
        Its visual geometry.
    sizes : Sizes
        How large things are drawn.
    skeleton : bool
        Leave shapes out.
    notes : tuple of str
        What could not be drawn.
    q : (n,) array
        The configuration shown, closed.
    chosen : (entry, pose) or None
        Where in the list that is.
    normal : (3,) array or None
        Of the plane of a planar mechanism.
    """

    mechanism: Mechanism
    groups: tuple[Group, ...]
    links: Links
    sizes: Sizes
    skeleton: bool
    notes: tuple[str, ...] = ()
    q: Array = field(init=False)
    chosen: tuple[int, int] | None = field(init=False, default=None)

    normal: Array | None = field(init=False)

    def __post_init__(self) -> None:
        self.normal = plane_normal(self.mechanism)
        self.q = home(self.mechanism)

    @property
    def name(self) -> str:
        """Name of the mechanism."""
        return self.mechanism.name

    def pose_q(self, entry: int, pose: int) -> Array:
        """Configuration (n,) of a pose of the list.

        Raises
        ------
        OptionError
            If there is none.
        """
        check_place(entry, pose, [len(g.points) for g in self.groups])
        return np.array(self.groups[entry].points[pose].q)

    def start(self) -> dict[str, Any]:
        """What a page shows first."""
        entry, pose = self.chosen if self.chosen is not None else (None, 0)
        return {"q": self.q.tolist(), "entry": entry, "pose": pose}

    def page(self, live: bool) -> dict[str, Any]:
        """The fixed part of a page."""
        m, sizes = self.mechanism, self.sizes
        linkage = Linkage(m)
        lower, upper = linkage.span
        turns = any(row >= 3 for row in m.task.rows)
        moves = any(row < 3 for row in m.task.rows)
        return {
            "live": live,
            "mechanism": True,
            "robot": {
                "name": m.name,
                "inputs": list(m.inputs),
                "output": m.output,
                "task": ", ".join(m.task.name.split(",")),
                "lengthScale": m.length_scale,
            },
            "joints": [
                {
                    "name": name,
                    "symbol": name,
                    "prismatic": bool(m.prismatic[i]),
                    "lower": float(lower[i]),
                    "upper": float(upper[i]),
                    "limited": bool(np.isfinite(m.lower[i]) and np.isfinite(m.upper[i])),
                }
                for i, name in enumerate(m.joints)
            ],
            "inputs": list(m.actuated),
            "settings": {
                "reach": sizes.reach,
                "translation": float(f"{sizes.translation:.3g}") if moves else None,
                "rotation": float(f"{sizes.rotation:.3g}") if turns else None,
                "thickness": 2 * LEAST * sizes.reach,
                "mode": "pure" if moves and turns else "all",
                "shapes": self.links.geometry is not None and not self.skeleton,
                "bare": list(self.links.bare(linkage)),
                "jointOf": list(range(m.n)),
                "lines": ARROWS,
                "side": list(side(self.normal)),
                "planar": self.normal is not None,
            },
            "entries": [self._entry(g) for g in self.groups],
            "engine": mechanism_data(m, sizes, self.normal),
            "notes": list(self.notes),
        }

    def _entry(self, group: Group) -> dict[str, Any]:
        return {
            "name": group.name,
            "text": group.text,
            "more": list(group.more),
            "reason": "",
            "poses": len(group.points),
            "q": [p.q.tolist() for p in group.points],
            "points": [
                {"kind": p.kind, "moving": self._moving(p), "converged": p.converged}
                for p in group.points
            ],
            "titles": [point_words(self.mechanism, p) for p in group.points],
            "into": bool(group.points),
            "along": bool(group.points) and len(self.mechanism.inputs) > 1,
        }

    def _moving(self, point: SingularPoint) -> int:
        """Place, among the inputs, of the one along which a pose was found; -1 for none."""
        return self.mechanism.inputs.index(point.moving) if point.moving else -1
