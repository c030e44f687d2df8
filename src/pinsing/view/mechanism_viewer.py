"""MechanismViewer: a mechanism with closed loops, live in a browser tab."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from pinsing.errors import OptionError
from pinsing.loops.analysis import MechanismAnalysis, analyze_mechanism
from pinsing.loops.closure import (
    at_zero,
    extent,
    groups as alike_groups,
    hinged_balls,
    output_pose,
    plane_normal,
    random_closed,
    ranks,
    structure,
)
from pinsing.loops.motion import assembly_rows, elbow_sines, elbows, home, led_pose, mechanism_at
from pinsing.loops.solve import SingularPoint, assemblies, drive
from pinsing.measures import ALIKE, NEAR_RTOL, ROUNDING, SINGULAR_RTOL, Array, ArrayLike
from pinsing.robot.mechanism import Mechanism, closing
from pinsing.view.scene import (
    HOT,
    ROTATION,
    SceneNode,
    Sizes,
    painted,
    raised,
    ring,
    ring_arrow,
    straight_arrow,
)
from pinsing.view.tab import SIDE, Tab
from pinsing.view.viewer import chain_data, frame_data, joint_data, sizes_data

SCHEMA = "pinsing/mechanism-engine/1"


def mechanism_data(mechanism: Mechanism, sizes: Sizes, normal: Array | None) -> dict[str, Any]:
    """Return all that the page's engine needs to move a mechanism by itself, ready for JSON.

    Keys: ``schema``; ``chain``, as of an arm, its tip the output; ``loops``, each with ``kind`` and
    the two frames; ``task``, ``metric`` (what counts as one radian, per joint), ``joints``
    (`joint_data`), ``actuated``; generic ``ranks``; ``judge``, tolerances of the verdict; ``home``
    (n,), closed; ``assembly``, rows of the closure whose determinant tells assembly modes apart,
    and its sign at home, or None; ``pose``, coordinates that lead the output (see `led_pose`);
    ``balls`` written as three hinges, their centres in the frame of the first; ``legs``, the joints
    of each; ``elbows``; ``normal`` (3,) of the plane of a planar mechanism, which is drawn with
    turning as a ring in it; ``sizes``.
    """
    m, model = mechanism, mechanism.model
    generic = ranks(m)
    rows, sign = assembly_rows(m)
    return {
        "schema": SCHEMA,
        "output": m.output,
        "chain": chain_data(model, m.output_id),
        "loops": [
            {"kind": loop.kind, "a": frame_data(model, a), "b": frame_data(model, b)}
            for loop, a, b in zip(m.loops, *closing(m), strict=True)
        ],
        "task": {"rows": list(m.task.rows), "lengthScale": m.length_scale},
        "metric": m.space.metric.tolist(),
        "joints": joint_data(m, m.joints),
        "actuated": list(m.actuated),
        "ranks": {
            "constraint": generic.constraint,
            "mobility": generic.mobility,
            "output": generic.output,
        },
        "judge": {"rtol": SINGULAR_RTOL, "nearRtol": NEAR_RTOL},
        "home": home(m).tolist(),
        "assembly": None if rows is None else {"rows": rows, "sign": sign},
        "pose": _led(m, sizes.reach, normal is not None),
        "balls": [
            {"joints": list(ball.joints), "centre": ball.point.tolist()} for ball in hinged_balls(m)
        ],
        "legs": [list(leg.joints) for leg in structure(m).legs],
        "elbows": [
            {
                "crank": e.crank - 1,
                "elbow": e.elbow - 1,
                "endJoint": e.end_joint - 1,
                "end": list(e.end),
                "slides": e.slides,
            }
            for e in elbows(m)
        ],
        "normal": None if normal is None else normal.tolist(),
        "sizes": sizes_data(sizes),
    }


def _led(mechanism: Mechanism, reach: float, planar: bool) -> dict[str, Any]:
    """`led_pose`, with its ``coordinates`` as `joint_data` has joints."""
    led, place = led_pose(mechanism), output_pose(mechanism, home(mechanism)).translation

    def coordinate(row: int) -> dict[str, Any]:
        symbol = "turn" if planar and row >= 3 else ("x", "y", "z", "roll", "pitch", "yaw")[row]
        # Pitch beyond a quarter of a turn is another roll and yaw.
        most = np.pi / 2 if row == 4 and led["turn"]["kind"] != "axis" else None
        middle, half = (float(place[row]), reach) if row < 3 else (0.0, most or np.pi)
        return {
            "name": f"{symbol} of {mechanism.output}",
            "symbol": symbol,
            "prismatic": row < 3,
            "lower": None if most is None else -most,
            "upper": most,
            "span": [middle - half, middle + half],
        }

    return {**led, "coordinates": [coordinate(row) for row in led["rows"]]}


def linkage_sizes(mechanism: Mechanism, scale: float = 1.0) -> Sizes:
    """Return sizes for a mechanism: ellipsoids of about a quarter of its extent, by ``scale``."""
    # For unit input speed at random regular configurations.
    rng = np.random.default_rng(377)
    samples = [home(mechanism), *random_closed(mechanism, 16, rng)]
    velocities = [mechanism_at(mechanism, q).velocity for q in samples]
    reach, rows, usual = extent(mechanism, samples[0]), np.array(mechanism.task.rows), []
    for part in (rows < 3, rows >= 3):
        known = [v[part] for v in velocities if v is not None and part.any()]
        speeds = [float(np.linalg.norm(v, 2)) for v in known]
        # The median; home's, the first of them, is to be seen well: at most twice that.
        middle = float(np.median(speeds)) if speeds else 1.0
        seen = 2 * speeds[0] if speeds and speeds[0] > 0 else middle
        usual.append(max(min(middle, seen), 1e-9))
    return Sizes(
        reach=reach,
        translation=scale * 0.2 * reach / usual[0],
        rotation=scale * 0.2 * reach / usual[1],
    )


def side(normal: Array | None) -> tuple[float, ...]:
    """Where the camera looks from (three.js axes, y up): across the plane, if there is one."""
    if normal is None:
        return SIDE
    x, y, z = normal
    across = np.array([x, z, -y])
    # A little off the normal, so that what stands on the plane is seen as well.
    tilt = np.array([0.0, 0.0, 1.0]) if abs(z) > 0.7 else np.array([0.0, 1.0, 0.0])
    return tuple(float(v) for v in across + 0.42 * tilt)


def draw_linkage_marks(node: SceneNode, mechanism: Mechanism, size: Sizes) -> None:
    """Draw arrows of motions that actuators do not hold; in a plane, adapt the scene to it.

    A ring, whose radius is the speed about the normal, replaces an ellipsoid that would be a
    needle, and the floor goes below the linkage. ``node`` is ``pinsing`` of the scene that
    `draw_scene` drew.
    """
    straight_arrow(node["free/translation"], size.reach, HOT)
    ring_arrow(node["free/rotation"], size.reach, HOT)
    normal = plane_normal(mechanism, at_zero(mechanism).axis)
    if normal is None:
        return
    turning = node["ellipsoid/rotation"]
    for part in ("skin", "xy", "yz", "zx"):
        turning[part].delete()
    turning["ring"].draw(painted(ring(1.0, 0.035), ROTATION))
    if abs(normal[2]) > 1 - 1e-9:
        node["floor"].move(raised(-0.06 * size.reach))


_MEANING = {
    "type 1": "the output loses a direction",
    "type 2": "the actuators do not hold the output",
    "type 3": "type 1 and type 2 at once",
    "constraint": "the linkage gains a motion",
}


@dataclass(frozen=True, eq=False)
class Group:
    """A line of the list."""

    name: str  # such as ``L1``
    text: str  # what is singular, and how
    more: tuple[str, ...]  # the equation, and what else there is to say
    points: tuple[SingularPoint, ...]  # poses to step through, those near home first

    @property
    def poses(self) -> tuple[Array, ...]:
        """Their configurations."""
        return tuple(p.q for p in self.points)


def groups(mechanism: Mechanism, analysis: MechanismAnalysis) -> tuple[Group, ...]:
    """Singular points of an analysis by locus: by equation if there is one, else by kind."""
    start = home(mechanism)
    points = sorted(
        analysis.points, key=lambda p: float(np.linalg.norm(mechanism.space.wrap(p.q - start)))
    )
    found: list[tuple[str, tuple[str, ...], list[SingularPoint]]] = []
    for locus in () if analysis.forms is None else analysis.forms.loci:
        mine = [
            p
            for p in points
            if p.kind in (locus.kind, "type 3")
            and abs(float(locus.equation(p.inputs))) <= 1e-7 * locus.equation.size
        ]
        if not mine and locus.witness is not None:
            mine = [locus.witness]
        points = [p for p in points if not any(p is x for x in mine)]
        notes = ["isolated points"] * locus.points_only
        notes += ["no configuration found where the loops close"] * (not mine)
        found.append((f"{locus.kind}: {locus.words}", (str(locus.equation), *notes), mine))
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
        apart = alike_groups((p.q for p in mine), wrap=mechanism.space.wrap)
        shown = tuple(mine[alike[0]] for alike in apart)
        out.append(Group(f"L{number}", text, (*more, *many), shown))
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
    slides = mechanism.prismatic[list(mechanism.actuated)]
    values = ", ".join(
        f"{name} = {1000 * x:.1f} mm" if mm else f"{name} = {np.degrees(x) + 0.0:.1f}°"
        for name, x, mm in zip(mechanism.inputs, point.inputs, slides, strict=True)
    )
    end = f"; the range of {point.moving} ends here" if point.range_end else ""
    return f"{point.kind} at {values}; {point.mode}{end}"


def _words(mechanism: Mechanism, point: SingularPoint) -> str:
    if point.kind != "type 1":
        return f"{point.kind}: {_MEANING[point.kind]}"
    sines = elbow_sines(mechanism, point.q)
    # Refined poses are straight to rounding of the root, not of the sine itself.
    straight = [
        e for e, s in zip(elbows(mechanism), sines, strict=True) if abs(s) <= max(ROUNDING, ALIKE)
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
        OptionError.refuse_if(
            not (np.isfinite(scale) and scale > 0),
            f"scale must be a positive number, got {scale!r}",
        )
        self.mechanism = mechanism
        if analysis is None:
            analysis = analyze_mechanism(mechanism)
            if analysis.missing:  # Ctrl-C
                raise KeyboardInterrupt
        self.entries = self.groups = groups(mechanism, analysis)
        # Links end where they close loops, and at the output.
        pairs = zip(*closing(mechanism), strict=True)
        ends = list(dict.fromkeys([*chain(*pairs), mechanism.output_id]))
        super().__init__(mechanism, linkage_sizes(mechanism, scale), skeleton, ends, host, port)
        self._normal = plane_normal(mechanism, at_zero(mechanism).axis)
        draw_linkage_marks(self._drawn.root["pinsing"], mechanism, self._sizes)
        self._q = home(mechanism)

    def show(self, q: ArrayLike) -> None:
        """Move the mechanism, in every open tab, to the closed configuration q (n,).

        Raises
        ------
        ConfigurationError
            If q has the wrong length, or the loops do not close there.
        """
        q = mechanism_at(self.mechanism, q).q  # refuses open loops
        self._move(q, None)

    def show_inputs(self, inputs: ArrayLike) -> None:
        """Drive the mechanism to inputs (n_a,) in its mode, or put it together there in another.

        Raises
        ------
        InfeasibleError
            If the loops close there in no mode.
        """
        inputs = self.mechanism.check_inputs(inputs)
        found = drive(self.mechanism, inputs, self.q)
        self._move(found.q if found.converged else assemblies(self.mechanism, inputs)[0].q, None)

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
        self._go(group, pose)

    def play(self, group: str | int, kind: str = "into", pose: int = 0) -> None:
        """Play a motion in every open tab: ``into`` the singular pose, or ``along`` its locus."""
        self._play(group, kind, pose)

    def _page(self, live: bool) -> dict[str, Any]:
        m = self.mechanism
        turns = any(row >= 3 for row in m.task.rows)
        moves = any(row < 3 for row in m.task.rows)
        mode = "pure" if moves and turns else "all"
        settings = self._settings(mode, side(self._normal))
        none = dict.fromkeys(["translation"] * (not moves) + ["rotation"] * (not turns))
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
            "settings": {**settings, **none, "planar": self._normal is not None},
            "entries": [
                {
                    "list": "entries",
                    "name": group.name,
                    "text": group.text,
                    "more": list(group.more),
                    "reason": "",
                    "poses": len(group.points),
                    "q": [q.tolist() for q in group.poses],
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
            "engine": mechanism_data(m, self._sizes, self._normal),
            "notes": list(self.notes),
        }
