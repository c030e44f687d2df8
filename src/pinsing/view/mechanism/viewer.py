"""MechanismViewer: a mechanism with closed loops, live in a browser tab."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.errors import OptionError
from pinsing.loops.analysis import analyze_mechanism
from pinsing.loops.loop_forms import Locus
from pinsing.loops.modes import STRAIGHT, elbow_sines, elbows, home
from pinsing.loops.motion import mechanism_at
from pinsing.loops.problems import assemblies
from pinsing.loops.result import MechanismAnalysis
from pinsing.loops.singular_points import SingularPoint
from pinsing.loops.solve import drive
from pinsing.robot.mechanism import Mechanism
from pinsing.view.links import Links, Recorder, read_links
from pinsing.view.mechanism.linkage import (
    Linkage,
    draw_linkage_marks,
    linkage_sizes,
    mechanism_data,
    plane_normal,
    side,
)
from pinsing.view.scene import ARROWS, LEAST, Sizes, draw_scene
from pinsing.view.tab import Tab, place_in_list

_SAME = 1e-6
_MEANING = {
    "type 1": "the output loses a direction",
    "type 2": "the actuators do not hold the output",
    "type 3": "type 1 and type 2 at once",
    "constraint": "the linkage gains a motion",
}


@dataclass(frozen=True, eq=False)
class Group:
    """A line of the list.

    Attributes
    ----------
    name : str
        ``L1``.
    text : str
        What is singular, and how.
    more : tuple of str
        The equation, and what else there is to say.
    points : tuple of SingularPoint
        Poses to step through, those near home first.
    """

    name: str
    text: str
    more: tuple[str, ...]
    points: tuple[SingularPoint, ...]


def groups(mechanism: Mechanism, analysis: MechanismAnalysis) -> tuple[Group, ...]:
    """Singular points of an analysis by locus: by equation if there is one, else by kind."""
    start = home(mechanism)
    points = sorted(
        analysis.points, key=lambda p: float(np.linalg.norm(mechanism.space.wrap(p.q - start)))
    )
    found: list[tuple[str, tuple[str, ...], list[SingularPoint]]] = []
    for locus in () if analysis.forms is None else analysis.forms.loci:
        mine = [p for p in points if _on(locus, p)]
        if not mine and locus.witness is not None:
            mine = [locus.witness]
        points = [p for p in points if not any(p is x for x in mine)]
        more: tuple[str, ...] = (str(locus.equation),)
        if locus.points_only:
            more += ("isolated points",)
        if not mine:
            more += ("no configuration found where the loops close",)
        found.append((f"{locus.kind}: {locus.words}", more, mine))
    said = _over_pose(analysis)
    rest: dict[str, list[SingularPoint]] = {}
    for point in points:
        told = said.get(point.kind)
        rest.setdefault(told[0] if told else _words(mechanism, point), []).append(point)
    more_of = dict(said.values())
    found += [(text, more_of.get(text, ()), rest[text]) for text in sorted(rest)]
    out = []
    for number, (text, more, mine) in enumerate(found, 1):
        many = (f"{len(mine)} poses",) if len(mine) > 1 else ()
        out.append(Group(f"L{number}", text, (*more, *many), _distinct(mechanism, mine)))
    return tuple(out)


def _over_pose(analysis: MechanismAnalysis) -> dict[str, tuple[str, tuple[str, ...]]]:
    """By kind, where one locus over the pose is all of that kind: its words, and what is known."""
    forms = analysis.pose_forms
    if forms is None or analysis.forms is not None:
        return {}
    out: dict[str, tuple[str, tuple[str, ...]]] = {}
    for kind in ("type 2", "constraint", "type 2 or constraint"):
        mine = [x for x in forms.loci if x.kind == kind]
        if len(mine) != 1:
            continue
        more = [str(mine[0].equation)]
        if kind != "constraint":
            more += [str(x) for x in forms.everywhere]
        for each in ("type 2", "constraint") if kind == "type 2 or constraint" else (kind,):
            out.setdefault(each, (f"{each}: {mine[0].words}", tuple(more)))
    if forms.architecture:
        out["type 2"] = (f"type 2: {forms.architecture}", ())
    return out


def point_words(mechanism: Mechanism, point: SingularPoint) -> str:
    """One line about a pose: its inputs, its mode, and whether a range ends there."""
    values = ", ".join(
        f"{name} = {input_text(mechanism, k, float(value))}"
        for k, (name, value) in enumerate(zip(mechanism.inputs, point.inputs, strict=True))
    )
    end = f"; the range of {point.moving} ends here" if point.range_end else ""
    return f"{point.kind} at {values}; {point.mode}{end}"


def input_text(mechanism: Mechanism, k: int, value: float, digits: int = 1) -> str:
    """A value of input k, degrees or millimetres, with its unit."""
    if mechanism.prismatic[mechanism.actuated[k]]:
        return f"{1000 * value:.{digits}f} mm"
    return f"{np.degrees(value) + 0.0:.{digits}f}°"


def _on(locus: Locus, point: SingularPoint) -> bool:
    if point.kind not in (locus.kind, "type 3"):
        return False
    return abs(float(locus.equation(point.inputs))) <= 1e-7 * locus.equation.size


def _words(mechanism: Mechanism, point: SingularPoint) -> str:
    if point.kind != "type 1":
        return f"{point.kind}: {_MEANING[point.kind]}"
    sines = elbow_sines(mechanism, point.q)
    # Refined poses are straight to rounding of the root, not of the sine itself.
    straight = [
        e for e, s in zip(elbows(mechanism), sines, strict=True) if abs(s) <= max(STRAIGHT, _SAME)
    ]
    if not straight:
        return f"type 1: {_MEANING['type 1']}"
    ways = (
        ("the leg of", "in line", [e for e in straight if not e.slides and not e.turns_freely]),
        ("the rod of", "in a plane with the axis of its crank",
         [e for e in straight if not e.slides and e.turns_freely]),
        ("the rod of", "square to its slide", [e for e in straight if e.slides]),
    )  # fmt: skip
    said = [
        f"{what} {' and '.join(mechanism.joints[e.crank - 1] for e in here)} {how}"
        for what, how, here in ways
        if here
    ]
    return f"type 1: {' and '.join(said)}"


def _distinct(mechanism: Mechanism, points: list[SingularPoint]) -> tuple[SingularPoint, ...]:
    out: list[SingularPoint] = []
    for p in points:
        if all(np.abs(mechanism.space.wrap(p.q - x.q)).max() > _SAME for x in out):
            out.append(p)
    return tuple(out)


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
        """Configuration (n,) of a pose of the list."""
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
            "entries": [
                {
                    "name": group.name,
                    "text": group.text,
                    "more": list(group.more),
                    "reason": "",
                    "poses": len(group.points),
                    "q": [p.q.tolist() for p in group.points],
                    "points": [
                        {
                            "kind": p.kind,
                            # Place, among the inputs, of the one along which it was found.
                            "moving": m.inputs.index(p.moving) if p.moving else -1,
                            "converged": p.converged,
                        }
                        for p in group.points
                    ],
                    "titles": [point_words(m, p) for p in group.points],
                    "into": bool(group.points),
                    "along": bool(group.points) and len(m.inputs) > 1,
                }
                for group in self.groups
            ],
            "engine": mechanism_data(m, sizes, self.normal),
            "notes": list(self.notes),
        }


class MechanismViewer(Tab):
    """Shows a mechanism: sliders for the actuated joints, modes, and its singular poses.

    `show` and `show_group` lead every open tab. A server is started when its address is first
    asked for (`url`, `open`, or a notebook that displays the viewer), inside this process and
    on loopback only.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    analysis : MechanismAnalysis, optional
        What to list; by default that of ``analyze_mechanism(mechanism)``.
    scale : float
        Size of the velocity ellipses; 1 is about a quarter of the mechanism.
    skeleton : bool
        Leave out the shapes of the links.
    host, port : str, int
        Where to listen; by default loopback, the first free port from 7000 on.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        analysis: MechanismAnalysis | None = None,
        *,
        scale: float = 1.0,
        skeleton: bool = False,
        host: str = "127.0.0.1",
        port: int | None = None,
    ) -> None:
        if not (np.isfinite(scale) and scale > 0):
            raise OptionError(f"scale must be a positive number, got {scale!r}")
        self.mechanism = mechanism
        if analysis is None:
            analysis = analyze_mechanism(mechanism)
            if analysis.missing:  # Ctrl-C
                raise KeyboardInterrupt
        listed = groups(mechanism, analysis)
        size = linkage_sizes(mechanism, scale)
        linkage = Linkage(mechanism)
        links = Links(None) if skeleton else read_links(linkage)
        recorder = Recorder()
        root = recorder.visualizer()
        notes = draw_scene(root, linkage, links, size, linkage.ends)
        draw_linkage_marks(root["pinsing"], mechanism, size)
        self._stage = MechanismStage(mechanism, listed, links, size, skeleton, notes)
        super().__init__(self._stage, *recorder.parts(), host, port)

    @property
    def groups(self) -> tuple[Group, ...]:
        """What the page lists."""
        return self._stage.groups

    def show(self, q: npt.ArrayLike) -> None:
        """Move the mechanism, in every open tab, to the closed configuration q (n,).

        Raises
        ------
        ConfigurationError
            If q has the wrong length, or the loops do not close there.
        """
        q = mechanism_at(self.mechanism, q).q  # refuses open loops
        self._move(q, None)

    def show_inputs(self, inputs: npt.ArrayLike) -> None:
        """Drive the mechanism to inputs (n_a,) in its mode, or put it together there in another.

        Raises
        ------
        InfeasibleError
            If the loops close there in no mode.
        """
        inputs = self.mechanism.check_inputs(inputs)
        found = drive(self.mechanism, inputs, self.q)
        q = found.q if found.converged else assemblies(self.mechanism, inputs)[0].q
        self._move(q, None)

    def show_group(self, group: str | int, pose: int = 0) -> None:
        """Move the mechanism to a pose of the list.

        Parameters
        ----------
        group : str or int
            Name, such as ``L1``, or place in the list.
        pose : int
            Which of its poses, counted from 0.

        Raises
        ------
        UnknownNameError
            If the list has no such group.
        OptionError
            If it has no such pose.
        """
        index = self._index(group, pose)
        self._move(self._stage.pose_q(index, pose), (index, pose))

    def play(self, group: str | int, kind: str = "into", pose: int = 0) -> None:
        """Play a motion in every open tab: ``into`` the singular pose, or ``along`` its locus."""
        self._play(self._index(group, pose), pose, kind)

    def _index(self, group: str | int, pose: int) -> int:
        return place_in_list([(g.name, len(g.points)) for g in self.groups], group, pose)
