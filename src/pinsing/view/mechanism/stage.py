"""What the page of a mechanism asks for: frames, poses, paths, and what surrounds a pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.errors import OptionError
from pinsing.mechanism.drive import drive
from pinsing.mechanism.modes import home
from pinsing.mechanism.solve import Solution
from pinsing.robot.mechanism import Mechanism
from pinsing.view.ellipsoids import FLOOR, Sizes
from pinsing.view.frame import ARROWS
from pinsing.view.links import Links
from pinsing.view.mechanism.around import around
from pinsing.view.mechanism.frame import mechanism_frame
from pinsing.view.mechanism.groups import Group, input_text, point_words
from pinsing.view.mechanism.linkage import Linkage, plane_normal, side
from pinsing.view.mechanism.paths import along, into
from pinsing.view.stage import KINDS, check_place


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

    def answer(self, request: Mapping[str, Any]) -> Any:
        """Answer a question of a page.

        Beside those of an arm's page (``frame`` with the closed configuration ``q`` to come
        from and the ``inputs`` wanted): ``around``, how far each input can go from ``q``, and
        the other modes there.

        Raises
        ------
        OptionError
            If the question is not known, or the list has no such pose.
        ConfigurationError
            If a configuration makes no sense.
        """
        want = request["want"]
        if want == "frame":
            return self.frame(request["q"], request["inputs"])
        if want == "around":
            return around(self.mechanism, self.mechanism.check(request["q"]))
        if want == "pose":
            return self.pose(request["entry"], request["pose"])
        if want == "path":
            return self.path(request["entry"], request["pose"], request["kind"])
        if want == "start":
            return self.start()
        raise OptionError(f"unknown request {want!r}")

    def frame(self, q: npt.ArrayLike, inputs: npt.ArrayLike | None = None) -> dict[str, Any]:
        """Everything at a closed q (n,), or where it gets to from there on the way to inputs.

        Inputs out of reach in this mode leave it at the last configuration before; ``refused``
        then says so.
        """
        m = self.mechanism
        q = m.check(q)
        if inputs is None:
            return self._frame(q)
        actuated = list(m.actuated)
        wanted = np.clip(m.check_inputs(inputs), m.lower[actuated], m.upper[actuated])
        found = drive(m, wanted, q)
        frame = self._frame(found.q)
        if not found.converged:
            frame["refused"] = self._refused(found, q[actuated])
        return frame

    def _frame(self, q: Array) -> dict[str, Any]:
        return mechanism_frame(self.mechanism, q, self.sizes, self.normal)

    def pose(self, entry: int, pose: int) -> dict[str, Any]:
        """Everything at a pose of the list."""
        return self.frame(self.pose_q(entry, pose))

    def pose_q(self, entry: int, pose: int) -> Array:
        """Configuration (n,) of a pose of the list.

        Raises
        ------
        OptionError
            If there is none.
        """
        check_place(entry, pose, [len(g.points) for g in self.groups])
        return np.array(self.groups[entry].points[pose].q)

    def path(self, entry: int, pose: int, kind: str) -> list[dict[str, Any]]:
        """Frames of a path into, or along, a locus."""
        self.pose_q(entry, pose)
        if kind not in KINDS:
            raise OptionError(f"unknown kind of path {kind!r}: into or along")
        point = self.groups[entry].points[pose]
        rows = (into if kind == "into" else along)(self.mechanism, point)
        return [self._frame(q) for q in rows]

    def start(self) -> dict[str, Any]:
        """What a page shows first."""
        entry, pose = self.chosen if self.chosen is not None else (None, 0)
        return {"frame": self.frame(self.q), "entry": entry, "pose": pose}

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
                "floor": FLOOR,
                "mode": "pure" if moves and turns else "all",
                "shapes": self.links.geometry is not None and not self.skeleton,
                "bare": list(self.links.bare(linkage)),
                "jointOf": list(range(m.n)),
                "lines": ARROWS,
                "side": list(side(self.normal)),
                "planar": self.normal is not None,
            },
            "entries": [self._entry(g) for g in self.groups],
            "notes": list(self.notes),
        }

    def _entry(self, group: Group) -> dict[str, Any]:
        return {
            "name": group.name,
            "text": group.text,
            "more": list(group.more),
            "reason": "",
            "poses": len(group.points),
            "titles": [point_words(self.mechanism, p) for p in group.points],
            "into": bool(group.points),
            "along": bool(group.points) and len(self.mechanism.inputs) > 1,
        }

    def _refused(self, found: Solution, before: Array) -> str:
        """Which input stopped where."""
        m = self.mechanism
        reached = found.q[list(m.actuated)]
        k = int(np.argmax(np.abs(found.inputs - before)))
        return (
            f"infeasible: {m.inputs[k]} = {input_text(m, k, float(found.inputs[k]))}. In this mode "
            f"the loops close up to {input_text(m, k, float(reached[k]), 2)}, the others held; "
            "the mechanism stays there."
        )
