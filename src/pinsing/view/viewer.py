"""Viewer: an arm in a browser tab, and what its page lists and computes from.

Families, findings or single configurations, each with its poses, ellipsoids and lost motions.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from pinsing.algebra.conditions import weighted_sum
from pinsing.algebra.equation import Equation
from pinsing.errors import ArgumentError, OptionError
from pinsing.families import Branch, Family, JointValue, joint_symbols
from pinsing.families.describe import telling_poses
from pinsing.families.form import coverage_words
from pinsing.families.tube import Tube
from pinsing.interface import checked, shown
from pinsing.kinematics.jacobian import (
    NEAR_RTOL,
    SINGULAR_RTOL,
    frame_jacobians,
    generic_rank,
    generic_task,
    own_scale,
    task_size,
)
from pinsing.kinematics.lost_motion import arm_centres
from pinsing.kinematics.tip_speed import TIP_SPEED, TURN_SPEED, SpeedJudge
from pinsing.measures import Array, ArrayLike, Reachability, pure_ellipsoids
from pinsing.proximity.clearance import Suggestion
from pinsing.proximity.zones import Zones, zone_distances
from pinsing.robot.arm import Arm, summarize
from pinsing.robot.mechanism import Mechanism
from pinsing.robot.models import joint_axis
from pinsing.robot.nominal import nominal
from pinsing.sampling.generalize import Finding
from pinsing.view.scene import FLATTEST, LEAST, SLIM, Overlay, Sizes, read_links_ahead, sizes
from pinsing.view.tab import Tab

if TYPE_CHECKING:
    from pinsing.postures.changes import PostureChanges

_LONGEST = 72


@dataclass(frozen=True, eq=False)
class Entry:
    """A line of the list: a family or a configuration, with the poses to step through.

    Attributes
    ----------
    name : str
        ``F1``, or ``P1`` for a configuration.
    text : str
        The condition.
    poses : tuple of (n,) arrays
        Configurations, none where nothing is within reach.
    moved : tuple of int
        Joints that the condition is about.
    kind, reason : str
        boundary, interior or undecided, of each piece where they differ; which axes line up.
        Empty where not known.
    codimension : int or None
        Number of independent conditions.
    reachable : bool or None
        Whether the limits allow it; None where that is not known.
    reach : str
        In words, where they allow it with some of its joint values only; else empty.
    family : Family or None
        The family itself, where there is one.
    """

    name: str
    text: str
    poses: tuple[Array, ...]
    moved: tuple[int, ...]
    kind: str = ""
    reason: str = ""
    codimension: int | None = None
    reachable: bool | None = True
    reach: str = ""
    family: Family | None = None


def _value(value: float, slides: bool) -> str:
    return f"{value:g} m" if slides else f"{round(math.degrees(value), 4):g}°"


def family_entries(arm: Arm, families: Iterable[Family], poses: int = 3) -> tuple[Entry, ...]:
    """List families of an arm, with up to ``poses`` telling configurations of each."""
    families, out = tuple(families), []
    for family in families:
        others = [f for f in families if f is not family and f.real]
        chosen = telling_poses(arm, family, poses, others)
        kinds = {
            "varies": "; ".join(map(str, family.kinds)),
            "undecided": "boundary or interior: undecided",
        }
        out.append(
            Entry(
                name=family.name,
                text=f"{family.title}: {family.text}" if family.title else family.text,
                poses=chosen,
                moved=tuple(i for i, name in enumerate(arm.joints) if name in family.joints),
                kind=kinds.get(family.kind, family.kind),
                reason=family.reason,
                codimension=family.codimension,
                reachable=True if chosen else family.is_reachable,
                # What there is to say of the limits beside that they allow it, or do not.
                reach="" if family.reach == family.reachability.words else family.reach,
                family=family,
            )
        )
    return tuple(out)


def pose_entries(arm: Arm, configurations: Iterable[ArrayLike]) -> tuple[Entry, ...]:
    """List single configurations."""
    symbols = joint_symbols(arm)

    def text(q: Array) -> str:
        values = zip(symbols, q, arm.prismatic, strict=True)
        return ", ".join(f"{s} = {_value(x, bool(p))}" for s, x, p in values)

    every, given = tuple(range(arm.n)), (arm.check_one(q, "poses") for q in configurations)
    return tuple(Entry(f"P{number}", text(q), (q,), every) for number, q in enumerate(given, 1))


def finding_entries(arm: Arm, findings: Iterable[Finding]) -> tuple[Entry, ...]:
    """List singular findings of a sweep, named S1, S2, ..."""
    out = []
    singular = [f for f in findings if f.status == "singular"]
    for number, finding in enumerate(singular, 1):
        name, condition = f"S{number}", finding.condition
        poses, fixed = (
            (np.array(finding.configuration.q),) * bool(finding.reachable),
            condition.fixed,
        )
        family = None
        if condition.minimal:
            # The singular set of some joints at fixed values, the others anywhere in the limits.
            values = [JointValue(arm.joints.index(j), float(x), False) for j, x in fixed.items()]
            family = Family(
                name=name,
                text=str(condition),
                latex="",
                branches=(Branch(tuple(values), ()),),
                joints=tuple(fixed),
                codimension=len(fixed),
                proof="",
                real=True,
                reachability=Reachability.UNKNOWN,
                witness=None,
                generic=None,
                rank=None,
                lost=(),
                kind="",
                reason="",
                raw_ratio=None,
                lower=arm.lower,
                upper=arm.upper,
                prismatic=arm.prismatic,
                length_scale=arm.length_scale,
            )
            poses = telling_poses(arm, family, 3) or poses
        out.append(
            Entry(
                name=name,
                text=str(condition),
                poses=poses,
                moved=tuple(i for i, j in enumerate(arm.joints) if j in condition.depends_on),
                kind=finding.configuration.kind,
                codimension=len(fixed) if condition.minimal else None,
                reachable=True if poses else finding.reachable,
                family=family,
            )
        )
    return tuple(out)


FRAMES = 160
"""Poses of a way between two postures."""


def listed_postures(arm: Arm, found: PostureChanges) -> tuple[dict[str, Any], ...]:
    """Return postures in the order of `posture_changes`, the current one first, as pages list them.

    Each has its number as ``name``, words of the field as ``text``, what ``more`` there is to say
    (its aspect, and if it can be reached without a singularity), and the ``way`` (K, n) to it from
    the first posture that is on no family, or None.
    """
    # Few pages have any, and a browser would wait for an import as long as that of the families.
    from pinsing.postures.changes import PostureChanges

    if not isinstance(found, PostureChanges):
        hint = "pinsing.posture_changes(arm, q) gives one"
        raise ArgumentError("postures", "a PostureChanges", shown(found), hint)
    OptionError.refuse_if(
        len(found.q) != arm.n, f"the postures are of {len(found.q)} joints; {arm.name} has {arm.n}"
    )
    here = "singular" if found.aspect is None else f"aspect {found.aspect}"
    listed: list[tuple[Array, Sequence[str], str, Array | None]] = [
        (found.q, found.names, f"{here}: where it starts", None)
    ]
    for other in found.others:
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
        listed.append((s.q, other.names, said, path))
    return tuple(
        {
            "list": "postures",
            "name": str(number),
            "text": words if way is None else f"{words} ▶",
            "more": [more],
            "said": f"posture {number}: {words}; {more}",
            "reason": "Show it" if way is None else "Play the way to it",
            "poses": 1,
            "q": [q.tolist()],
            "way": None if way is None else way.tolist(),
        }
        for number, (q, names, more, way) in enumerate(listed, 1)
        for words in [", ".join(names) or f"posture {number}"]
    )


def fine(path: Array, arm: Arm) -> Array:
    """Poses along a polyline, evenly by its length, with its corners."""
    weight = np.where(arm.prismatic, 1 / arm.length_scale, 1.0)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0) * weight, axis=1)))
    at = np.union1d(np.linspace(0.0, along[-1], FRAMES), along)
    return np.stack([np.interp(at, along, column) for column in path.T], axis=1)


SCHEMA = "pinsing/engine/1"


def engine_data(arm: Arm, entries: Sequence[Entry], sizes: Sizes) -> dict[str, Any]:
    """Return all that the page's engine needs to compute frames by itself, ready for JSON.

    Keys: ``schema``; ``chain`` (placements of the model's joints, metres, and how each follows q)
    and ``nominal``, the same of the nominal geometry where that differs; ``task`` (rows of the
    frame Jacobian, which are in the tip's axes, length scale, generic rank, joints that ever move
    it, task directions never produced, (k, 6)); ``judge`` (tolerances of the verdict, and the arm's
    own scale); ``joints`` (`joint_data`); ``speeds`` (of `SpeedJudge`, and what is
    asked); ``families`` (branches: joint values and equations as `equation_data`; ``confirm``: only
    zeros at which the arm is singular count, and ``points`` are some); ``centres`` (joints whose
    axes always meet, with a name); ``sizes``; ``design`` (families are of the design).
    """
    exact = nominal(arm)
    found = generic_task(arm).never
    never = np.zeros((found.shape[1], 6))
    never[:, list(arm.task.rows)] = found.T
    return {
        "schema": SCHEMA,
        "chain": arm_chain(arm),
        "nominal": None if exact.exact else arm_chain(exact.arm),
        "task": {
            "rows": list(arm.task.rows),
            "atTip": list(arm.task.tip_rows),
            "lengthScale": arm.length_scale,
            "rank": generic_rank(arm),
            "used": list(generic_task(arm).moving),
            "never": never.tolist(),
        },
        "judge": {
            "rtol": SINGULAR_RTOL,
            "nearRtol": NEAR_RTOL,
            "size": task_size(arm),
            "length": own_scale(arm).length,
            "columns": own_scale(arm).columns.tolist(),
        },
        "joints": joint_data(arm, joint_symbols(arm)),
        "speeds": _speeds(SpeedJudge(arm)),
        "families": [
            _family(index, entry, entry.family, joint_symbols(arm))
            for index, entry in enumerate(entries)
            if entry.family is not None and entry.family.branches
        ],
        "centres": [{"name": c.short, "joints": list(c.ids)} for c in arm_centres(arm) if c.short],
        "sizes": sizes_data(sizes),
        "design": arm.design is not None,
    }


def _speeds(judge: SpeedJudge) -> dict[str, Any] | None:
    """What tip speeds are told from; None where they are not, or would take a page too long."""
    if judge.reason or judge.arm.n > 12:  # with 12 joints 792 facets, some milliseconds
        return None
    return {
        "basis": judge.basis.T.tolist(),
        "linear": judge.linear.tolist(),
        "limits": [float(c) if np.isfinite(c) else None for c in judge.limits],
        "asked": [TIP_SPEED, TURN_SPEED],
    }


def sizes_data(sizes: Sizes) -> dict[str, float]:
    """How large things are drawn."""
    return {
        "reach": sizes.reach,
        "translation": sizes.translation,
        "rotation": sizes.rotation,
        "floor": FLATTEST,
        "least": LEAST * sizes.reach,
        "slim": SLIM,
    }


def arm_chain(arm: Arm) -> dict[str, Any]:
    """`chain_data` of an arm's model, with its mimic joints."""
    tied = arm.coupling
    return chain_data(arm.model, arm.tip_id, *((tied.matrix, tied.offset) if tied else ()))


def chain_data(
    model: pin.Model, tip_id: int, matrix: Array | None = None, offset: Array | None = None
) -> dict[str, Any]:
    """Return joints of a model, root to leaves, with the frame ``tip_id``, numbers to the last bit.

    A joint stands at row . q + offset, with its row of ``matrix``; at its own q by default.
    """
    matrix = np.eye(model.nv) if matrix is None else matrix
    offset = np.zeros(model.nv) if offset is None else offset
    joints = []
    for j in range(1, model.njoints):
        axis, slides = joint_axis(model.joints[j], model.names[j])
        place = model.jointPlacements[j]
        row = model.joints[j].idx_v
        joints.append(
            {
                "parent": int(model.parents[j]) - 1,
                "R": place.rotation.tolist(),
                "t": place.translation.tolist(),
                "axis": axis.tolist(),
                "prismatic": slides,
                "weights": matrix[row].tolist(),
                "offset": float(offset[row]),
            }
        )
    return {"joints": joints, "tip": frame_data(model, tip_id)}


def frame_data(model: pin.Model, frame_id: int) -> dict[str, Any]:
    """A frame of a model: its joint (-1: the root) and its placement there."""
    frame = model.frames[frame_id]
    return {
        "parent": int(frame.parentJoint) - 1,
        "R": frame.placement.rotation.tolist(),
        "t": frame.placement.translation.tolist(),
    }


def joint_data(robot: Arm | Mechanism, symbols: Sequence[str]) -> list[dict[str, Any]]:
    """Joints as sliders of a page have them, with their limits; None where one is infinite."""
    several = list(robot.joints) if len(symbols) > 1 else []
    alike = os.path.commonprefix(several)  # noqa: RUF071 (of letters)
    prefix = re.sub(r"[^_\-./:\s]*$", "", alike)  # up to a mark that separates words
    prefix = "" if prefix in robot.joints else prefix
    return [
        {
            "name": name,
            "symbol": symbol,
            "label": "" if name == symbol else name.removeprefix(prefix),
            "prismatic": bool(slides),
            "lower": float(low) if np.isfinite(low) else None,
            "upper": float(high) if np.isfinite(high) else None,
            "span": span,
        }
        for name, symbol, slides, low, high, span in zip(
            robot.joints,
            symbols,
            robot.prismatic,
            robot.lower,
            robot.upper,
            np.transpose(robot.space.span).tolist(),
            strict=True,
        )
    ]


def _family(index: int, entry: Entry, family: Family, symbols: Sequence[str]) -> dict[str, Any]:
    branches = family.branches
    # Families that were read from a file do not say that their equations are not enough.
    confirm = family.confirm is not None or any(len(b.equations) > 1 for b in branches)
    return {
        "entry": index,
        "name": entry.name,
        "text": entry.text,
        "reason": entry.reason,
        "reachable": entry.reachable is not False,
        "moved": list(entry.moved),
        "confirm": confirm,
        "points": [pose.tolist() for pose in entry.poses] if confirm else [],
        "where": [_where(entry, family, b, symbols) for b in branches],
        "branches": [
            {
                "values": [{"joint": v.joint, "value": v.value} for v in b.values],
                "equations": [equation_data(e) for e in b.equations],
            }
            for b in branches
        ],
    }


def equation_data(equation: Equation) -> dict[str, Any]:
    """An equation as a `TrigSum` of joint values, ready for JSON."""
    s = weighted_sum(equation, np.ones(len(equation.shift)))
    return {
        **{k: getattr(s, k).tolist() for k in ("amplitude", "phase", "rate")},
        "power": s.power.tolist() if len(s.slides) else None,
        **{k: getattr(s, k) for k in ("noise", "reach", "curvature")},
        "size": float(s.amplitude.sum()),
    }


def _where(entry: Entry, family: Family, branch: Branch, symbols: Sequence[str]) -> str:
    """The part of the condition that a branch of the family is about."""
    if branch.values:
        words = " and ".join(
            f"{symbols[v.joint]} = {_value(v.value, bool(family.prismatic[v.joint]))}"
            for v in branch.values
        )
        # The rest is an equation, which the list has in full.
        words += "" if {v.joint for v in branch.values} == set(entry.moved) else " and …"
    elif family.title:
        words = family.where()
    else:
        long = len(entry.text) > _LONGEST
        words = f"{entry.text[: _LONGEST - 2].rstrip()} …" if long else entry.text
    return f"{family.title}: {words}" if family.title else words


def _solved(entry: Entry) -> list[dict[str, Any]]:
    """Long equations, each as one for a joint: texts."""
    if entry.family is None:
        return []
    lines = [line for one in entry.family.at_once for line in one.lines()]
    together = [{"condition": x, "solution": "", "where": [], "exact": []} for x in lines]
    names = ("condition", "solution", "where", "exact")
    return together + [{k: getattr(one, k) for k in names} for one in entry.family.solved]


def _entry(entry: Entry, n: int) -> dict[str, Any]:
    moves = bool(entry.poses) and not entry.name.startswith("P")
    told = (
        (entry.kind, entry.kind),
        (entry.codimension, f"codimension {entry.codimension}"),
        (entry.reach, entry.reach),
        (entry.reachable is False, "out of reach of the limits"),
        (entry.reachable is None, "no configuration found within the limits"),
    )
    return {
        "name": entry.name,
        "text": entry.text,
        "list": "given" if entry.name.startswith("P") else "entries",
        "more": [words for there, words in told if there],
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


class Viewer(Tab):
    """Shows an arm at singular configurations.

    The page lists the families, plays motions, and has sliders; `show` and `show_family`
    lead every open tab. A server is started when its address is first asked for (`url`,
    `open`, or a notebook that displays the viewer), inside this process and on loopback only.

    Parameters
    ----------
    arm : Arm
        The arm.
    families : iterable of Family, optional
        What to list; by default all families of ``closed_form(arm)``, unless ``poses`` or
        ``findings`` are given.
    poses : iterable of (n,) array_like, optional
        Configurations to list, radians and metres.
    findings : iterable of Finding, optional
        What a sweep has found, to be listed as well.
    path : (N, n) array_like, optional
        A joint motion, radians and metres, linear between its samples: pages open with what
        `check_trajectory` says of it, show it as a line of the tip coloured by clearance, and
        play it.
    times : (N,) array_like, optional
        Its times, seconds.
    shown : mapping, optional
        The same as `trajectory_data` gave it, where it was checked before.
    postures : PostureChanges, optional
        Inverse solutions of one pose, by `posture_changes`: pages list them, and play the way to
        each that can be reached without a singularity.
    coverage : str
        How sure it is that the families are all, which pages say above the list; by default what
        ``closed_form(arm)`` says where the families are its own.
    clearest : Suggestion, optional
        A clear configuration, by `suggest`: the page's button leads to none that is worse.
    zones : Zones or Tube, optional
        Those of the arm and of joint ranges, from `pinsing.zones`, or where the singular
        configurations of a robot are beside its design's (`form.tube`): red at the sliders.
    visualizer : pinocchio MeshcatVisualizer or meshcat.Visualizer, optional
        Draw into this one as well: axes, ellipsoids and lost motions below its node
        ``pinsing``. One that displays the robot of the arm is moved along.
    scale : float
        Size of the ellipsoids; 1 is about a quarter of the reach.
    skeleton : bool
        Leave out meshes: small pages.
    host, port : str, int
        Where to listen; by default loopback, the first free port from 7000 on.

    Attributes
    ----------
    arm : Arm
        The arm.
    entries : tuple of Entry
        What the page lists.

    Examples
    --------
    >>> import pinsing
    >>> with pinsing.Viewer(pinsing.load("planar3r"), skeleton=True) as viewer:
    ...     print([entry.name for entry in viewer.entries])
    ['F1']
    """

    @checked
    def __init__(
        self,
        arm: Arm,
        families: Iterable[Family] | None = None,
        poses: Iterable[ArrayLike] | None = None,
        findings: Iterable[Finding] | None = None,
        *,
        path: ArrayLike | None = None,
        times: ArrayLike | None = None,
        shown: Mapping[str, Any] | None = None,
        postures: PostureChanges | None = None,
        coverage: str = "",
        clearest: Suggestion | None = None,
        zones: Zones | Tube | None = None,
        visualizer: Any = None,
        scale: float = 1.0,
        skeleton: bool = False,
        host: str = "127.0.0.1",
        port: int | None = None,
    ) -> None:
        OptionError.refuse_if(
            not 0 < scale < 1e6, f"scale must be a positive number, got {scale!r}"
        )
        self.arm = arm
        if not skeleton:
            read_links_ahead(arm)
        if families is None and poses is None and findings is None:
            from pinsing.families import closed_form

            form = closed_form(arm)
            families, coverage = form.families, coverage or coverage_words(form)
        self.entries = (
            *pose_entries(arm, () if poses is None else poses),
            *family_entries(arm, () if families is None else families),
            *finding_entries(arm, () if findings is None else findings),
        )
        OptionError.refuse_if(
            clearest is not None and clearest.arm.joints != arm.joints,
            "clearest is of another arm",
        )
        self._postures = () if postures is None else listed_postures(arm, postures)
        super().__init__(arm, sizes(arm, scale), skeleton, [arm.tip_id], host, port)
        if path is not None:
            from pinsing.proximity.trajectory import check_trajectory
            from pinsing.view.trajectory import trajectory_data

            Q = np.atleast_2d(arm.check(path))
            t = None if times is None else np.asarray(times, dtype=float)
            shown = trajectory_data(arm, check_trajectory(arm, Q, t), Q, t)
        self._way, self._coverage, self._clearest = shown, coverage, clearest
        # Bands at the sliders: joint ranges, distances, and why.
        self._zones = None if zones is None else _bands(zones, arm, [e.name for e in self.entries])
        self._overlay = None if visualizer is None else Overlay(visualizer, arm, self._sizes)
        # Where pages begin: at the pose whose postures are listed, or the first one of the list.
        first = ((e.poses[0], (i, 0)) for i, e in enumerate(self.entries) if e.poses)
        middle = np.mean(arm.span, axis=0), None
        self._move(*(next(first, middle) if postures is None else (postures.q, None)))

    @checked
    def show(self, q: ArrayLike, words: str = "") -> None:
        """Move the arm, in every open tab.

        Parameters
        ----------
        q : (n,) or (nq,) array_like
            Radians and metres.
        words : str
            A line for the page to say; the camera then stays as it is.

        Raises
        ------
        ConfigurationError
            If q has the wrong length or is not finite.

        Examples
        --------
        >>> import pinsing
        >>> viewer = pinsing.Viewer(pinsing.load("planar3r"), skeleton=True)
        >>> viewer.show([0, 0.5, 1])
        >>> viewer.q
        array([0. , 0.5, 1. ])
        """
        self._move(self.arm.check_one(q), None, words)

    @checked
    def show_family(self, family: Family | str | int, pose: int = 0) -> None:
        """Move the arm to a pose of a family.

        Parameters
        ----------
        family : Family, str or int
            The family, its name, or its place in the list.
        pose : int
            Which of its poses, counted from 0.

        Raises
        ------
        UnknownNameError
            If the list has no such family.
        OptionError
            If it has no such pose within the limits.

        Examples
        --------
        >>> import pinsing
        >>> viewer = pinsing.Viewer(pinsing.load("planar3r"), skeleton=True)
        >>> viewer.show_family("F1")
        >>> pinsing.at(viewer.arm, viewer.q).status
        'singular'
        """
        self._go(family, pose)

    @checked
    def play(self, family: Family | str | int, kind: str = "into", pose: int = 0) -> None:
        """Play a motion in every open tab.

        Parameters
        ----------
        family : Family, str or int
            The family, its name, or its place in the list.
        kind : str
            ``into`` the singular pose, or ``along`` the family.
        pose : int
            Which of its poses, counted from 0.

        Raises
        ------
        UnknownNameError
            If the list has no such family.
        OptionError
            If there is no such pose, or no such kind of motion.

        Examples
        --------
        >>> import pinsing
        >>> viewer = pinsing.Viewer(pinsing.load("planar3r"), skeleton=True)
        >>> viewer.play("F2")
        Traceback (most recent call last):
        pinsing.errors.UnknownNameError: unknown family 'F2': did you mean 'F1'?
        """
        self._play(family, kind, pose)

    def _dropped(self, name: str, content: bytes, degrees: bool | None) -> dict[str, Any]:
        """What a page shows of a file that was dropped onto it."""
        from pinsing.view.trajectory import dropped

        return dropped(self.arm, name, content, degrees)

    def _page(self, live: bool) -> dict[str, Any]:
        arm = self.arm
        return {
            "live": live,
            "way": self._way,
            "robot": {
                "name": arm.name,
                "base": arm.base,
                "tip": arm.tip,
                "task": str(arm.task),
                "lengthScale": arm.length_scale,
            },
            "settings": self._settings(self._mode),
            "entries": [*(_entry(e, arm.n) for e in self.entries), *self._postures],
            "engine": engine_data(arm, self.entries, self._sizes),
            "notes": [
                *arm.notes,
                *self.notes,
                *[f"described by {summarize(arm).described}"] * bool(arm.source.calibration),
            ],
            "coverage": self._coverage,
            "zones": self._zones,
            "clearest": None
            if self._clearest is None
            else {"q": self._clearest.q.tolist(), "lower": float(self._clearest.lower)},
        }

    @cached_property
    def _mode(self) -> str:
        """Return pure motions of a pose task where regular ones fill a plane or more."""
        # They go flat, or to a line, where a motion is lost; those of an arm of three or four
        # joints are lines or points everywhere.
        arm, rng = self.arm, np.random.default_rng(0)
        if arm.task.name != "pose":
            return "all"
        for J in frame_jacobians(arm, rng.uniform(*arm.span, (4, arm.n))):
            if all(e.radii[1] > SINGULAR_RTOL * max(e.radii[0], 1e-9) for e in pure_ellipsoids(J)):
                return "pure"
        return "all"

    def _move(self, q: Array, chosen: tuple[int, int] | None, words: str = "") -> None:
        super()._move(q, chosen, words)
        if self._overlay is not None:
            self._overlay.show(q, self._mode)


def _bands(of: Zones | Tube, arm: Arm, names: Sequence[str]) -> dict[str, Any] | None:
    """What is red at the sliders of an arm whose page lists entries of these names."""
    if isinstance(of, Tube):
        if not of.proven:
            return None
        return {
            "middle": [0.0] * arm.n,
            "half": [1e9] * arm.n,
            "far": {f.family: of.alone for f in of.families if f.family in names},
            "meeting": {"more": of.width - of.alone, "near": of.near - of.alone},
            "why": f"near the design's families; singular configurations of {of.whose} lie "
            f"{of.where}",
        }
    zone_distances(of, summarize(arm), arm, names)
    return {
        "middle": ((of.lower + of.upper) / 2).tolist(),
        "half": ((of.upper - of.lower) / 2).tolist(),
        "far": of.distances,
        "why": f"too near for {of.speeds}, or not proven to be far enough",
    }
