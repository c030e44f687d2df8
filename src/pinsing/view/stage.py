"""An arm with its list of singular poses, as its page has it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pinsing._types import Array
from pinsing.families import joint_symbols
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.measures import SINGULAR_RTOL, pure_ellipsoids
from pinsing.robot.arm import Arm
from pinsing.view.entries import Entry, Posture, engine_data, posture_data
from pinsing.view.links import Links
from pinsing.view.scene import ARROWS, LEAST, Sizes

if TYPE_CHECKING:
    from pinsing.proximity.suggestion import Suggestion

KINDS = ("into", "along")

SIDE = (0.74, 0.36, 0.57)
"""Where the camera looks from: three.js axes, y up."""


@dataclass
class Stage:
    """An arm with its list, at some configuration.

    Attributes
    ----------
    arm : Arm
        The arm.
    entries : tuple of Entry
        The list of the page.
    links : Links
        Its visual geometry.
    sizes : Sizes
        How large things are drawn.
    skeleton : bool
        Leave shapes out.
    notes : tuple of str
        What could not be drawn.
    way : (K, n) array, optional
        Poses of a motion that pages show first, radians and metres.
    samples : int
        How many samples that motion has.
    postures : tuple of Posture
        Inverse solutions of one pose, and ways to them.
    coverage : str
        How sure it is that the list holds all; empty where that is not known.
    clearest : Suggestion, optional
        The clearest configuration that was found before.
    q : (n,) array
        The configuration shown.
    chosen : (entry, pose) or None
        Where in the list that is.
    """

    arm: Arm
    entries: tuple[Entry, ...]
    links: Links
    sizes: Sizes
    skeleton: bool
    notes: tuple[str, ...] = ()
    way: Array | None = None
    samples: int = 0
    postures: tuple[Posture, ...] = ()
    coverage: str = ""
    clearest: Suggestion | None = None
    q: Array = field(init=False)
    chosen: tuple[int, int] | None = field(init=False)

    def __post_init__(self) -> None:
        self.chosen = next(((i, 0) for i, e in enumerate(self.entries) if e.poses), None)
        if self.chosen is not None:
            self.q = self.entries[self.chosen[0]].poses[0]
        else:
            lower, upper = self.arm.span
            self.q = (lower + upper) / 2

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.arm.name

    def start(self) -> dict[str, Any]:
        """What a page shows first."""
        entry, pose = self.chosen if self.chosen is not None else (None, 0)
        return {"q": self.q.tolist(), "entry": entry, "pose": pose}

    def page(self, live: bool) -> dict[str, Any]:
        """The fixed part of a page."""
        arm, sizes = self.arm, self.sizes
        lower, upper = arm.span
        names = list(arm.model.names)[1:]
        limited = np.isfinite(arm.lower) & np.isfinite(arm.upper)
        columns = zip(
            arm.joints, joint_symbols(arm), arm.prismatic, lower, upper, limited, strict=True
        )
        way = {} if self.way is None else {"rows": self.way.tolist(), "samples": self.samples}
        return {
            "live": live,
            "way": way or None,
            "postures": [posture_data(p) for p in self.postures],
            "robot": {
                "name": arm.name,
                "base": arm.base,
                "tip": arm.tip,
                "task": str(arm.task),
                "lengthScale": arm.length_scale,
            },
            "joints": [
                {
                    "name": name,
                    "symbol": symbol,
                    "prismatic": bool(slides),
                    "lower": float(low),
                    "upper": float(high),
                    "limited": bool(ends),
                }
                for name, symbol, slides, low, high, ends in columns
            ],
            "settings": {
                "reach": sizes.reach,
                "translation": float(f"{sizes.translation:.3g}"),
                "rotation": float(f"{sizes.rotation:.3g}"),
                "thickness": 2 * LEAST * sizes.reach,
                "mode": self.mode,
                "shapes": self.links.geometry is not None and not self.skeleton,
                "bare": list(self.links.bare(arm)),
                "jointOf": [arm.joints.index(n) if n in arm.joints else -1 for n in names],
                "lines": ARROWS,
                "side": list(SIDE),
            },
            "entries": [_entry(e, self.arm.n) for e in self.entries],
            "engine": engine_data(self.arm, self.entries, self.sizes),
            "notes": [*self.arm.notes, *self.notes],
            "coverage": self.coverage,
            "clearest": None
            if self.clearest is None
            else {"q": self.clearest.q.tolist(), "lower": float(self.clearest.lower)},
        }

    @cached_property
    def mode(self) -> str:
        """Pure motions of a pose task, where those of regular configurations fill a plane or more.

        They go flat, or to a line, where a motion is lost; those of an arm of three or four
        joints are lines or points everywhere.
        """
        if self.arm.task.name != "pose":
            return "all"
        rng = np.random.default_rng(0)
        lower, upper = self.arm.span
        for J in frame_jacobians(self.arm, rng.uniform(lower, upper, (4, self.arm.n))):
            if all(e.radii[1] > SINGULAR_RTOL * max(e.radii[0], 1e-9) for e in pure_ellipsoids(J)):
                return "pure"
        return "all"


def _more(entry: Entry) -> Iterator[str]:
    if entry.kind:
        yield entry.kind
    if entry.codimension:
        yield f"codimension {entry.codimension}"
    if entry.reach:
        yield entry.reach
    if entry.reachable is False:
        yield "out of reach of the limits"
    if entry.reachable is None:
        yield "no configuration found within the limits"


def _solved(entry: Entry) -> list[dict[str, Any]]:
    """Long equations, each as one for a joint: texts."""
    together = [
        {"condition": line, "solution": "", "where": [], "exact": []}
        for one in getattr(entry.family, "at_once", ())
        for line in one.lines()
    ]
    return together + [
        {
            "condition": one.condition,
            "solution": one.solution,
            "where": [list(part) for part in one.where],
            "exact": [list(part) for part in one.exact],
        }
        for one in getattr(entry.family, "solved", ())
    ]


def _entry(entry: Entry, n: int) -> dict[str, Any]:
    moves = bool(entry.poses) and not entry.name.startswith("P")
    return {
        "name": entry.name,
        "text": entry.text,
        "more": [*_more(entry)],
        "reason": entry.reason,
        "solved": _solved(entry),
        "poses": len(entry.poses),
        "q": [pose.tolist() for pose in entry.poses],
        "moved": list(entry.moved),
        "into": moves,
        "along": moves
        and entry.family is not None
        and (entry.codimension is None or entry.codimension < n),
    }
