"""Toolpaths: the joint path through given poses that stays farthest from singularities.

Between poses joints move linearly. What is free (the rotation about the tool's z axis, a redundant
joint, or the branch alone) takes values on a grid; the path with the greatest least clearance is
found by dynamic programming over poses, values and branches. An edge exists where the motion keeps
joint limits and speeds and is proven clear: distance to the families changes no faster than joints
move, so that it is at least (a + b - d) / 2 on a segment of length d between clearances a and b;
segments too long for that are halved. Between poses far apart all nodes are looked at that may have
more than a path on a part of the grid. Joint values that differ by whole turns are one node, until
the best path winds a joint beyond its limits: then each turn of that joint is a branch.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from pinsing._batch import engine
from pinsing.algebra.conditions import SearchOptions, two_sided
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm
from pinsing.interface import JsonResult, checked
from pinsing.kinematics.inverse import InverseMany
from pinsing.kinematics.jacobian import tip_placement, tip_poses
from pinsing.kinematics.ladder import posture_names
from pinsing.kinematics.tip_speed import limits_of
from pinsing.measures import PRACTICAL, ROUNDING, Array, ArrayLike, Bool, Ints
from pinsing.postures.placement import TRIED, WorkpiecePlacement, check_ranges, place_at, search
from pinsing.prose import listed, one_line
from pinsing.proximity.clearance import CLOSE, certified, clearance, quick, titled, watch
from pinsing.proximity.crossings import BISECTED, crossings, least_along
from pinsing.proximity.trajectory import angle_text
from pinsing.proximity.zones import Region
from pinsing.robot.arm import Arm, ArmSummary, summarize

STEP = np.radians(1.0)
"""Default distance of two values of what is free, radians."""
_TURNS = 8
"""Turns of what is free that a path may take in all: no more work than three steps of 1 degree
at each of 1,000 poses."""
_ALIKE = 1e-3
"""Relative difference of bounds that are as good as an estimate."""
_MARGIN = 0.01
"""Radians below the path on a part of the grid at which that on the whole is looked for first."""
_THINNED = 6
"""One value and one pose in so many are looked at first."""
_FOUND = {
    **dict.fromkeys(("clear", "likely", "highest"), -np.inf),
    **{"between": np.inf, "seen": True},
}
"""What is found out of each node, and what there is without one."""
_LONG = 20_000
"""Motions that are halved at most, of those looked at where there is no path without them."""
_COARSE = 40, np.radians(10.0)
"""Poses, and the distance of values of what is free, at which placements are compared."""


@dataclass(frozen=True, eq=False)
class PathPlan(JsonResult):
    """The joint path through a toolpath's poses that stays farthest from singularities.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    free : str
        What was free: "roll", the name of a joint, or "branch".
    q : (N, n) array
        The path, radians and metres; between poses joints move linearly. Empty if there is none.
    values : (N,) array
        What is free along the path: radians from the given pose, or the joint's value.
    t : (N,) array
        Seconds, where the feed was given; else the number of the pose.
    clearance : float
        Proven, between poses too: the path is nowhere nearer to a family of singular
        configurations. Radians, as in `pinsing.clearance`; 0 if there is no path.
    where : float
        Number of the pose (or a place between two) where it is nearest.
    family : str
        The family there.
    bound : float
        No path through these poses stays farther away, by a search and not proven: what may be
        better is divided in thirds, arcs taken as chords and a tenth, or as twice as bent as three
        neighbouring values are; radians.
    fixed : tuple of float
        Distances to the nearest points found from the poses of the paths along which what is free
        keeps its value (the start's; else that of the poses as given, or the middle of a joint's
        range), radians, one for each branch that may begin; 0 where such a path ends early.
    reason : str
        Why there is no path; empty if there is one.
    nodes : int
        Configurations that were compared.
    notes : tuple of str
        What was assumed.
    title : str
        "wrist", "elbow", "shoulder", or empty: as of ``family``.
    placement : WorkpiecePlacement or None
        Where the workpiece was moved to, if it might be: then all else is of the moved poses.
    grid : (G,) array
        The values of what is free that were compared; not written to JSON.
    room : (N, G) array
        The greatest clearance over the branches there, estimated, of a long path at every few
        poses; -inf where the pose is not reached within the joint limits. Not written to JSON.
    kept : (B, N) array
        Clearance along the paths of ``fixed``, NaN from where one ends on.
    """

    schema: ClassVar[str] = "pinsing/path_plan/1"

    arm: ArmSummary
    free: str
    q: Array
    values: Array
    t: Array
    clearance: float
    where: float
    family: str
    bound: float
    fixed: tuple[float, ...]
    reason: str
    nodes: int
    notes: tuple[str, ...] = field(default=())
    title: str = field(default="", metadata={"optional": True})
    placement: WorkpiecePlacement | None = field(default=None, metadata={"optional": True})
    grid: Array = field(default_factory=lambda: np.empty(0), repr=False, metadata={"json": False})
    room: Array = field(
        default_factory=lambda: np.empty((0, 0)), repr=False, metadata={"json": False}
    )
    kept: Array = field(
        default_factory=lambda: np.empty((0, 0)), repr=False, metadata={"json": False}
    )

    def __repr__(self) -> str:
        said = self.reason or f"clearance {self.clearance:.3g}, bound {self.bound:.3g}"
        return one_line("PathPlan", f"{self.arm.name}, {len(self.t)} poses, {self.free}: {said}")

    @checked
    def text(self, degrees: bool = True) -> str:
        """Return the answer in lines.

        Parameters
        ----------
        degrees : bool
            Angles in degrees, or in radians.

        Examples
        --------
        >>> import numpy as np, pinsing
        >>> form = pinsing.closed_form(pinsing.load("ur5"))
        >>> print(pinsing.plan_path(form, np.tile(np.eye(4), (2, 1, 1))).text())
        No path: pose 0 at (0, 0, 0) m is out of reach.
        """
        angle = partial(angle_text, degrees=degrees)
        if self.reason:
            return f"No path: {self.reason}."
        best = max(self.fixed, default=0.0)
        kept = angle(best) if best > 0 else "no path"
        kept = "" if self.free == "branch" else f"; with {self.free} kept: {kept}"
        family = f"{self.title} ({self.family})" if self.title else self.family
        lines = [
            f"{self.arm.name}: the path through {len(self.t)} poses stays at least "
            f"{angle(self.clearance)} from singularities (proven)",
            "",
            f"  Closest approach: {family}, at pose {self.where:.4g}",
            f"  Bound of all paths: {angle(self.bound)} (searched, not proven){kept}",
        ]
        if self.placement is not None:
            moved, before = self.placement.text(degrees), self.placement.before
            gain = f"clearance {angle(before)} becomes {angle(self.clearance)}"
            if not before:
                gain = "there is no path where it is"
            lines.append(
                f"  Move the workpiece by {moved}: {gain}"
                if moved
                else "  Leave the workpiece where it is: no placement that was tried is better"
            )
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])


@checked
def plan_path(
    form: ClosedForm,
    poses: ArrayLike,
    *,
    free: str = "branch",
    step: float = STEP,
    start: ArrayLike | str | None = None,
    t: ArrayLike | None = None,
    arm: Arm | None = None,
    tool: ArrayLike | None = None,
    place: Mapping[str, tuple[float, float]] | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> PathPlan:
    """Find the joint path through poses that stays farthest from singular configurations.

    Parameters
    ----------
    form : ClosedForm
        Of the arm.
    poses : (N, 4, 4) array_like
        Poses of the tool in the base frame, metres; at least two.
    free : str
        "branch": the inverse kinematics solution alone is chosen; "roll": the rotation about the
        tool's z axis, too; or the name of a joint of an arm that has a seventh one.
    step : float
        Distance of the values of what is free that are compared: radians, metres of a prismatic
        joint.
    start : (n,) array_like or str, optional
        Configuration at the first pose, where the path begins, or names of its posture, such as
        "elbow up, wrist no-flip", which then stays; otherwise any.
    t : (N,) array_like, optional
        Seconds at the poses: joint speed limits are then kept.
    arm : Arm, optional
        The arm that shall reach the poses; the form's own nominal geometry if not given.
    tool : (4, 4) array_like, optional
        Pose of the tool in the tip frame, metres; the tip itself if not given.
    place : mapping, optional
        Ranges in which the workpiece may be moved for more clearance, by name: "x", "y",
        "z" (metres along the axes of the base), "roll", "pitch", "yaw" (radians about them, through
        the middle of the path), such as ``{"x": (-0.1, 0.1), "yaw": (-0.5, 0.5)}``. Placements all
        over the ranges are compared, then some near the best; the best one found is planned as any
        path, and given back unless the poses as they are, where the ranges allow them, have more.
    progress : callable
        Told what is done, how far it is, and how far that goes.

    Returns
    -------
    PathPlan
        With ``reason`` where there is no path.

    Raises
    ------
    ConfigurationError
        If the poses are no rigid motions, or ``start`` does not reach the first.
    EngineError
        Without the compiled kernel.
    OptionError
        If ``free`` names nothing that can be free, the arm has another number of joints, a range of
        ``place`` has no such name or is empty, or ``start`` is given along with it.

    Examples
    --------
    >>> import numpy as np, pinsing
    >>> arm = pinsing.load("ur5")
    >>> T = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (5, 1, 1))
    >>> T[:, :3, 3] = [[0.4, y, 0.2] for y in np.linspace(-0.1, 0.1, 5)]
    >>> plan = pinsing.plan_path(pinsing.closed_form(arm), T)
    >>> plan.q.shape, plan.clearance <= plan.bound
    ((5, 6), True)
    """
    if arm is None:
        if form.loaded is None:
            raise OptionError("a form that was read from JSON has no robot: give arm=")
        arm = form.loaded
    back: Array = np.eye(4)
    if tool is not None:
        back = np.linalg.inv(rigid_motions(np.asarray(tool)[None], "tool")[0])
    T = rigid_motions(poses, "poses")
    if len(T) < 2:
        raise ConfigurationError("a path has two poses at least")
    planner = _Planner(form, arm, T, back, free, step, t, progress or (lambda *_: None))
    if place is None:
        return planner.plan(start)
    check_ranges(place)
    if start is not None:
        raise OptionError("start is at the first pose, which place moves: give one of them")
    return _placed(planner, place)


def _placed(planner: _Planner, ranges: Mapping[str, tuple[float, float]]) -> PathPlan:
    """Plan the path where the workpiece is put best."""
    T = planner.T
    about = (T[:, :3, 3].min(axis=0) + T[:, :3, 3].max(axis=0)) / 2
    coarse, count = planner.thinned(), 0

    def value(values: dict[str, float]) -> float:
        """Clearance on a coarse grid; without a path, less the fewer poses are reached."""
        nonlocal count
        count += 1
        planner.progress("placements", min(count, TRIED), TRIED)
        return coarse.moved(place_at(values, about).transform).estimate()

    given = planner.plan(None)
    values, tried = search(value, ranges)
    at = place_at(values, about, given.clearance, tried)
    plan = planner.moved(at.transform).plan(None)
    if all(low <= 0 <= high for low, high in ranges.values()) and (
        given.clearance >= plan.clearance
    ):
        at, plan = place_at({}, about, given.clearance, tried), given
    if plan.reason:
        reason = f"none of the {tried} placements tried has one; at the best of them {plan.reason}"
        return replace(plan, reason=reason)
    return replace(plan, placement=at)


class _Planner:
    """Nodes (N, M) of the poses of a toolpath, their clearance, and which are neighbours.

    At first each value of what is free has the same number of ``slots``; what is divided of these
    nodes has one row for each pose as well, and ends in places without a node.
    """

    def __init__(
        self,
        form: ClosedForm,
        arm: Arm,
        T: Array,
        back: Array,
        free: str,
        step: float,
        t: ArrayLike | None,
        progress: Callable[[str, int, int], None],
    ) -> None:
        if not step > 0:
            raise OptionError(f"step must be positive, got {step!r}")
        if free not in ("branch", "roll", *arm.joints):
            raise OptionError(
                f"free={free!r} is neither branch, roll, nor a joint ({', '.join(arm.joints)})"
            )
        self.form, self.arm, self.T, self.back = form, arm, T, back
        self.free, self.progress, self.watched = free, progress, watch(form)
        self.t = np.arange(len(T), dtype=float) if t is None else np.asarray(t, dtype=float)
        if self.t.shape != (len(T),) or not (np.diff(self.t) > 0).all():
            raise OptionError(f"t needs {len(T)} increasing times")
        self.timed = t is not None
        held = arm.joints.index(free) if free in arm.joints else None
        self.solver = InverseMany(arm, held)
        self.rough = False
        self.cyclic = free == "roll"
        self.grid: Array = np.zeros(1)
        self.rolled: Ints = np.zeros(len(T), dtype=int)
        if self.cyclic:
            self.grid = np.linspace(0, 2 * np.pi, max(3, round(2 * np.pi / step)), endpoint=False)
            roll = _rolls(T)
            if np.abs(np.diff(roll)).max() > _TURNS * np.pi / len(T):  # more than values looked at
                self.rolled = -np.rint(roll / self.grid[1]).astype(int)
                self.T = T.copy()
                for pose, angle in zip(self.T, self.rolled * self.grid[1], strict=True):
                    pose[:3, :3] = pose[:3, :3] @ pin.utils.rotate("z", angle)
        elif held is not None:
            low, high = (x[held] for x in arm.space.span)
            self.grid = np.linspace(low, high, max(2, 1 + round((high - low) / step)))
        self.held = held
        self.kept = 0 if held is None else len(self.grid) // 2
        whole = np.isfinite(arm.lower) & (arm.upper - arm.lower < 2 * np.pi)
        self.bounded: Bool = whole | np.asarray(arm.prismatic, dtype=bool)
        self.turn = np.where(self.bounded, 0.0, 2 * np.pi)
        self.start: Array | None = None
        self.posture: Region | None = None
        self.floor = -np.inf
        self.edges: list[Ints] = []
        self.every = 1  # of the given poses
        self.near: Array = np.empty(0)
        self.scale = np.where(arm.prismatic, 1 / arm.length_scale, 1.0)
        self.whole = np.where(arm.prismatic, 0.0, 2 * np.pi)

    def moved(self, transform: Array) -> _Planner:
        """Return the planner of poses moved in the base frame."""
        out = copy.copy(self)
        out.T = transform @ self.T
        return out

    def thinned(self) -> _Planner:
        """Return the planner of some of the poses and values, which are enough to compare."""
        count, step = _COARSE
        some = np.unique(np.linspace(0, len(self.T) - 1, min(count, len(self.T))).astype(int))
        out = copy.copy(self)
        out.T, out.t = self.T[some], self.t[some]
        if len(self.grid) > 1:
            out.grid = self.grid[:: max(1, round(step / (self.grid[1] - self.grid[0])))]
        out.progress, out.rough = lambda *_: None, True
        return out

    def estimate(self) -> float:
        """Return the proven clearance of the best path on the grid; without one, at most zero."""
        # The less, the fewer poses have a solution.
        found = self._chosen()
        if isinstance(found, str):
            return float(self.usable.any(axis=1).mean()) - 1
        return self._proven(found[1])[0]

    def plan(self, start: ArrayLike | str | None) -> PathPlan:
        """Solve the grid, find the best path on it, prove its clearance, and bound all others."""
        if isinstance(start, str):
            words = dict.fromkeys(word.strip() for word in start.split(","))
            self.posture = Region(self.form, self.arm, words, "start")
        elif start is not None:
            self._begin(self.arm.check_one(start, "start"))
        chosen = self._chosen()
        notes = [] if self.solver.exact else [
            "inverse kinematics by continuation from solutions at some poses: others may exist"
        ]  # fmt: skip
        if not self.form.complete:
            notes.append("the closed form is not complete: other singularities may be nearer")
        if self.idle:
            notes.append(
                f"rolling turns {self.arm.joints[-1]} alone (the tool's z axis is its axis): it "
                "changes no clearance, only whether that joint keeps its limits"
            )
        proven = where = reached = 0.0
        if not isinstance(chosen, str):
            (proven, where), reached = self._proven(chosen[1]), self.reached
        bound, parts, idle = max(self.relaxed, proven), [self], 0
        while bound > reached + np.radians(0.5) and parts:
            if (part := parts[-1].finer(reached, bound)) is None:
                parts.pop()
                continue
            better, gap = part.path(), bound - reached
            if part.relaxed > part.floor:
                parts.append(part)
            bound = max(min(bound, max(part.relaxed, part.floor)), proven)
            if not isinstance(better, str) and part.reached > reached:
                reached = part.reached
                least, at = self._proven(better[1])
                if least > proven:
                    chosen, proven, where = better, least, at
            idle = idle + 1 if bound - reached > 0.9 * gap else 0
            if idle > 1:
                break
        if isinstance(chosen, str):
            return self._none(chosen, notes)
        values, q = chosen
        bound = max(bound, proven)
        turned = self.arm.space.wrap(q)  # many turns would read as degrees
        notes += self._strayed(q) + self._sunken(turned)
        near, kept = clearance(self.form, turned[round(where)]), self._kept()
        family = str(near.nearest)
        return replace(
            self._none("", notes),
            q=q,
            values=values + self.rolled * (self.grid[1] if self.cyclic else 0.0),
            clearance=proven,
            where=where,
            family=family,
            bound=bound,
            fixed=tuple(np.nan_to_num(kept).min(axis=1).tolist()),
            kept=kept,
            title=self.form[family].title if family else "",
            grid=self.grid,
            room=self._shown(),
        )

    def _shown(self) -> Array:
        """Return the greatest clearance (N, G) over the branches, of poses with room for one."""
        # Of long paths estimated at some poses, and taken over for those behind them.
        shape = len(self.T), len(self.grid), self.slots
        usable, likely, highest, seen = (
            x.reshape(shape) for x in (self.usable, self.likely, self.highest, self.seen)
        )
        likely = np.where(usable, likely, -np.inf)
        more = usable & ~seen & (highest > likely.max(axis=2, keepdims=True))
        every = 1 + int(more.sum()) // 100_000  # half a second
        likely, more = likely[::every], more[::every]
        q = self.Q.reshape(*shape, -1)[::every][more]
        likely[more] = np.minimum(highest[::every][more], self._closest(q)[0])
        rolled = zip(likely.max(axis=2), self.rolled[::every], strict=True)
        return np.repeat([np.roll(x, k) for x, k in rolled], every, axis=0)[: len(self.T)]

    def _strayed(self, q: Array) -> list[str]:
        """Say how far halfway between poses the tool is from their middle, if by over 1 mm."""
        position, rotation = tip_poses(self.arm, self.arm.space.wrap((q[:-1] + q[1:]) / 2))
        at, off = self.T[:, :3, 3], np.linalg.inv(self.back)[:3, 3]
        far = np.linalg.norm(position + rotation @ off - (at[:-1] + at[1:]) / 2, axis=1)
        k, most = int(far.argmax()), 1e3 * far.max()
        return [
            f"halfway between poses {k} and {k + 1} the tool is {most:.1f} mm off the straight "
            "line, since joints are taken to move linearly there: give poses closer together"
        ] * bool(most > 1)

    def _sunken(self, q: Array) -> list[str]:
        """Say that joints go below the base and the tip, where the floor may be."""
        arm, data = self.arm, self.arm.model.createData()
        low = np.empty((len(q), arm.model.njoints))
        for k, row in enumerate(arm.model_q(q)):
            pin.framesForwardKinematics(arm.model, data, row)
            low[k] = [M.translation[2] for M in data.oMi]
            low[k, 0] = min(0.0, data.oMf[arm.tip_id].translation[2])
        below = low[:, 0] - low.min(axis=1)
        if below.max() < arm.length_scale / 20:
            return []
        k = int(below.argmax())
        return [
            f"{arm.model.names[int(low[k].argmin())]} is {-low[k].min():.2f} m below the base at "
            f"pose {k}: if the floor is there, begin in another posture, such as --start 'elbow up'"
        ]

    def _begin(self, start: Array) -> None:
        """Begin at a configuration (n,) of the first pose; its value joins the grid."""
        tip, value = tip_placement(self.arm, start), 0.0
        if self.held is not None:
            value = float(start[self.held])
        elif self.cyclic:
            turned = self.T[0, :3, :3].T @ tip.rotation @ self.back[:3, :3].T
            value = float(np.arctan2(turned[1, 0], turned[0, 0]))
        position, rotation = self._targets(self.T[:1], np.array([value]))
        off = np.abs(position - tip.translation).max() / self.arm.length_scale
        if max(off, np.abs(rotation - tip.rotation).max()) > 1e-4:  # of numbers that people type
            raise ConfigurationError("start does not reach the first pose")
        self.start = start
        if self.cyclic:
            self.grid = self.grid + value
        elif self.held is not None:
            self.kept = int(np.abs(self.grid - value).argmin())
            if abs(self.grid[self.kept] - value) > PRACTICAL:
                self.kept = int(np.searchsorted(self.grid, value))
                self.grid = np.insert(self.grid, self.kept, value)
            self.grid[self.kept] = value

    def _chosen(self) -> tuple[Array, Array] | str:
        """Solve the grid: values (N,) and configurations (N, n) of its best path; else a reason."""
        # Nothing is known yet of these poses, whatever this planner, or that of others, found out.
        self.known: list[tuple[int, Array, int]] = []  # pose, near singular configuration, family
        self.passing: Array | None = None
        self.least: float | None = None
        self.counted: Bool = np.zeros(self.arm.n, dtype=bool)
        self.turns: Ints = np.zeros((1, 0), dtype=int)
        self.reached = self.relaxed = -np.inf
        self.long = False
        position, rotation = self._targets(self.T, self.grid)
        Q = self.solver.solve(
            position, rotation, None if self.held is None else self.grid,
            lambda k, n: self.progress("inverse kinematics", k, n),
        )  # fmt: skip
        if self.start is not None:
            Q, at = self._started(Q, self.start)
        self.slots, self.Q = Q.shape[2], Q.reshape(len(Q), -1, self.arm.n)
        self.values = np.broadcast_to(np.repeat(self.grid, self.slots), self.Q.shape[:2])
        self._bounds()
        self.first = np.isfinite(self.clear[0])
        if self.start is not None:
            self.first[:] = False
            self.first[self.kept * self.slots + at] = True
        elif self.posture is not None:
            self.first[self.first] = self.posture.has_posture(self.Q[0][self.first])
        self.idle = self.cyclic and self._roll_moves_the_last_joint()
        if (reason := self._unreached()) is not None:
            return reason
        if self.posture is not None and not self.first.any():
            return f"no solution at pose 0 is {', '.join(self.posture.posture)}"
        self._link()
        return self.path()

    def _started(self, Q: Array, start: Array) -> tuple[Array, int]:
        """Make the start the solution it is of the first pose: Q (N, G, S, n), and its slot."""
        q = self.arm.space.fold(self.arm.space.wrap(start))
        apart = np.abs(self.arm.space.wrap(Q[0, self.kept] - q)).max(axis=-1)
        at = int(np.nan_to_num(apart, nan=np.inf).argmin())
        if not apart[at] < CLOSE:  # near a singular configuration none may have been found
            at = len(apart)
            Q = np.pad(Q, ((0, 0), (0, 0), (0, 1), (0, 0)), constant_values=np.nan)
        Q[0, self.kept, at] = q
        return Q, at

    def path(self) -> tuple[Array, Array] | str:
        """Return values (N,) and configurations (N, n) of the best path; else a reason."""
        while True:
            path = self._searched()
            if isinstance(path, str):
                return path
            node, turns = path
            at = np.arange(len(self.T)), node
            q = self._unwrapped(self.Q[at], turns)
            beyond = np.asarray(self.arm.space.outside(q).any(axis=0))
            if not beyond.any() and self.relaxed > self.reached + STEP:
                # What others seem to have may be beyond the limits of the joint that winds most.
                free = self.bounded | self.counted.any() | np.isinf(self.arm.upper - self.arm.lower)
                wound = np.where(free, 0.0, np.ptp(q, axis=0))
                beyond = wound >= max(wound.max(), np.pi)
            if not beyond.any():
                return self.values[at], q
            self._count_turns(beyond)

    def _none(self, reason: str, notes: Sequence[str]) -> PathPlan:
        n = self.arm.n
        return PathPlan(
            arm=summarize(self.arm), free=self.free, q=np.empty((0, n)), values=np.empty(0),
            t=self.t, clearance=0.0, where=0.0, family="", bound=0.0, fixed=(), reason=reason,
            nodes=int(np.isfinite(self.clear).sum()), notes=tuple(notes),
        )  # fmt: skip

    # -- the grid ---------------------------------------------------------------------------------

    def _targets(self, T: Array, values: Array) -> tuple[Array, Array]:
        """Return positions (N, G, 3), rotations (N, G, 3, 3) at poses T, values (G,) or (N, G)."""
        spin = np.broadcast_to(np.eye(3), (*values.shape, 3, 3)).copy()
        if self.cyclic:
            spin[..., 0, 0] = spin[..., 1, 1] = np.cos(values)
            spin[..., 1, 0] = np.sin(values)
            spin[..., 0, 1] = -spin[..., 1, 0]
        rotation = T[:, None, :3, :3] @ spin
        position = T[:, None, :3, 3] + rotation @ self.back[:3, 3]
        return position, rotation @ self.back[:3, :3]

    def _bounds(self) -> None:
        """Bound the clearance of all nodes: ``clear`` from below, ``highest`` from above."""
        self.clear, self.highest = np.full((2, *self.Q.shape[:-1]), -np.inf)
        self.between, self.off = np.full((2, *self.clear.shape), np.inf)
        for k in self._blocks():
            there, q = np.isfinite(self.Q[k, ..., 0]), self.Q[k]
            found = quick(self.watched, q[there])
            self.clear[k][there], self.highest[k][there] = found.lower, found.upper
            self.off[k] = self._beyond(q)
        self.usable = self.off <= 0
        self.likely, self.seen = self.clear.copy(), ~np.isfinite(self.clear)

    def _blocks(self) -> list[slice]:
        """Some poses at a time, for all processors."""
        rows = max(1, 50_000 // self.clear.shape[1])
        return [slice(first, first + rows) for first in range(0, len(self.T), rows)]

    def _searched(self) -> tuple[Ints, Ints] | str:
        """Return the best path on the grid; else why there is none."""
        # What surely has less clearance than a path on a part of the grid, or else than the best of
        # all, is not refined.
        if self.least is None:
            self.least = self._best_on_a_part() - _MARGIN
            for near in self.known:
                self._lower(*near)
        lower = _MARGIN
        while True:
            self._estimate_all(self.least)
            path = self._best_path(self.least)
            if self.reached < self.least > self.floor:
                lower *= 4
                self.least = max(self.reached, self.least - lower)
                self.least = max(self.least if self.least > 0 else -np.inf, self.floor)
                continue
            if isinstance(path, str):
                if self.long or self.edges:
                    self.long = False
                    return path
                self.long = True
                continue
            least = self.reached - _MARGIN
            if least > max(self.least, 0.0) + _MARGIN:
                left = (self.through > least).sum(axis=1)
                few = left[1:] * left[:-1] <= self.motions // (4 * len(left))
                if (few & self.crowded[1:]).any():  # from more nodes each, of fewer
                    self.least = least
                    continue
            found = self._certify(path[0])
            if found >= self.reached - BISECTED:
                return path
            self.least = max(self.least, found - BISECTED)

    def _certify(self, node: Ints) -> float:
        """Search at a path's nodes (N,), and return the path's clearance."""
        # A singular configuration found from one of them is near to others of its pose, too.
        at = np.arange(len(self.T)), node
        more = self.usable[at] & (self.highest[at] > self.clear[at] + CLOSE)
        some = tuple(x[more & (self.highest[at] >= self.least)] for x in at)
        found, near = certified(self.watched, self.Q[some], SearchOptions(gap=CLOSE))
        self.clear[some] = np.maximum(self.clear[some], found.lower)
        self.seen[some] = True
        less = found.upper < self.highest[some] - _ALIKE
        self.highest[some] = np.minimum(self.highest[some], found.upper)
        self.likely[some] = self.highest[some]
        for k, q, family in zip(*(x[less] for x in (some[0], near, found.family)), strict=True):
            self._lower(k, q, family)
            self.known.append((k * self.every, q, family))
        np.minimum(self.likely, self.highest, out=self.likely)
        return float(self.likely[at].min())

    def _lower(self, k: int, q: Array, family: int) -> None:
        """Bound the clearance of a pose's nodes by a singular configuration (n,) of a family."""
        off = self.arm.space.wrap(self.Q[k] - q) * self.watched.used[family]
        self.highest[k] = np.fmin(self.highest[k], self._size(off))

    def _best_on_a_part(self) -> float:
        """The clearance of the best path on a part of the grid, -inf if there is none."""
        columns = _THINNED
        if self.cyclic:
            columns = max(d for d in range(1, _THINNED + 1) if len(self.grid) % d == 0)
        rows = _THINNED if len(self.T) > _THINNED**2 else 1
        nodes = np.arange(len(self.grid))[::columns, None] * self.slots + np.arange(self.slots)
        of = np.ix_(range(0, len(self.T), rows), nodes.ravel())
        if len(of[0]) < 2 or self.clear[of].size * _THINNED > self.clear.size:
            return -np.inf
        part = copy.copy(self)
        for name in ("Q", "values", "usable", "off", *_FOUND):
            setattr(part, name, getattr(self, name)[of])
        part.grid, part.T, part.t = self.grid[::columns], self.T[::rows], self.t[::rows]
        part.every = rows
        part._link()
        part.reach *= columns  # it only says what is looked for first
        part.first, part.least = np.isfinite(part.clear[0]), -np.inf
        found = part._searched()
        for name in _FOUND:
            getattr(self, name)[of] = getattr(part, name)
        return -np.inf if isinstance(found, str) else part.reached

    def _estimate_all(self, least: float) -> None:
        """Estimate the clearance of nodes that may have ``least``."""
        # Steps may end beside the nearest point: ``likely``, the estimate, is an upper bound.
        # ``highest`` is what no node exceeds: the bound of other paths rests on it.
        for part in self._blocks():
            rows = self.highest[part] > np.maximum(self.clear[part] * (1 + _ALIKE), least)
            pose, at = node = np.nonzero(rows & ~self.seen[part])
            pose += part.start
            q = self.Q[node]
            upper, near = self._closest(q)
            most = np.maximum(self.clear[node], upper)
            self.likely[node] = self.highest[node] = np.minimum(self.highest[node], most)
            self.seen[node] = True
            # The most that there may be halfway to both neighbours: as far more as the ends are
            # from the point found, and half as far as branches bend; infinite where they bend much.
            halves = _unturned(self._neighbors(pose, at) - q[:, None], self.whole) / 2
            ends = (q - near)[:, None] + halves
            farther = self._size(ends).max(axis=1) - self._size(q - near)
            bend = self._size(halves.sum(axis=1)) / 2
            self.between[node] = np.where(
                2 * bend < self.way[node], upper + np.maximum(farther, 0) + bend, np.inf
            )
        for k in range(1, len(self.Q)):  # by that of those they are a step away from
            most = self.highest[k - 1, self.before[k]] + self.step[k]
            self.highest[k] = np.fmin(self.highest[k], most)
        np.minimum(self.likely, self.highest, out=self.likely)

    def _unreached(self) -> str | None:
        """The first pose without a usable node, in words."""
        if self.start is not None and (out := self.arm.space.outside(self.start)).any():
            return (
                f"start is outside the limits of {listed(np.array(self.arm.joints)[out].tolist())}"
            )
        reached = np.isfinite(self.clear).any(axis=1)
        within = self.usable.any(axis=1)
        if within.all():
            return None
        k = int(np.argmin(within))
        if not reached[k]:
            at = ", ".join(f"{x:.4g}" for x in self.T[k, :3, 3])
            return f"pose {k} at ({at}) m is out of reach" + (
                "" if self.free == "branch" else f" for every value of {self.free}"
            )
        q = self.Q[k][np.isfinite(self.clear[k])]
        outside = self.arm.space.outside(q)
        often = int(outside.sum(axis=0).argmax())
        most = "the limits of " if outside[:, often].all() else "joint limits, most often of "
        return f"at pose {k} every solution is outside {most}{self.arm.joints[often]}"

    def _gap(self, difference: Array) -> Array:
        """Motions between nodes: whole turns aside for joints that have room for them."""
        return _unturned(difference, self.turn)

    def _length(self, difference: Array) -> Array:
        """Lengths of motions between nodes: no clearance changes by more."""
        return self._size(self._gap(difference))

    def _size(self, move: Array) -> Array:
        """Lengths of motions (..., n)."""
        if self.arm.prismatic.any():
            move = move * self.scale
        return np.asarray(np.sqrt(np.einsum("...j,...j", move, move)))

    # -- the path ---------------------------------------------------------------------------------

    def _best_path(self, floor: float) -> tuple[Ints, Ints] | str:
        """Return nodes and turns (N,) of the best path; else why there is none.

        ``relaxed`` bounds paths between the grid's values: nodes have half of the way to their
        neighbours more, and one value more may be passed at a time. Values below ``floor`` are left
        out.
        """
        N, M = self.clear.shape
        self.crowded: Bool = np.zeros(N, dtype=bool)
        nodes = np.stack([self.likely[0], self._room(0)])[..., None]
        best = np.where(self.first[:, None] & self._within(0, np.arange(M)), nodes, -np.inf)
        back: list[tuple[Ints, Ints]] = []
        self.through, reason = np.full((N, M), -np.inf), ""
        self.through[0] = best[1].max(axis=-1)
        self.reached = self.relaxed = -np.inf
        for k in range(1, N):
            room = self._room(k)
            here = np.flatnonzero((room > -np.inf) & (room >= floor))
            self._pool(k, here, floor)
            source, far = self._sources(k, here)
            led = (self.through[k - 1, source] > -np.inf).any(axis=0)
            here, begin = here[led], (source[:, led].copy(), far[:, led].copy())
            new, from_, other = self._onward(k, here, begin, best, room, floor)
            if not (reason or np.isfinite(new).any()):
                reason = "none" if self.edges else self._why(k, best[0])
            best = np.full(best.shape, -np.inf)
            best[0, here] = new
            best[1, here] = np.maximum(other, new)
            self.through[k] = best[1].max(axis=-1)
            back.append((here, from_))
            if k % 20 == 0:
                self.progress("best path", k, N)
        self.reached, self.relaxed = float(best[0].max()), float(best[1].max())
        if reason:
            return reason
        path = np.full(N, best[0].argmax())
        for k in range(N - 1, 0, -1):
            here, from_ = back[k - 1]
            node, turn = divmod(path[k], best.shape[2])
            path[k - 1] = from_[np.searchsorted(here, node), turn]
        return np.divmod(path, best.shape[2])

    def _onward(
        self, k: int, here: Ints, begin: tuple[Ints, Bool], best: Array, room: Array, floor: float
    ) -> tuple[Array, Ints, Array]:
        """Return what paths from `_sources` to nodes ``here`` (M,) have, whence, relaxed."""
        # Each is (M, T); ``best`` (2, M, T) is what they have at the pose before.
        new, other = np.empty((2, len(here), len(self.turns)))
        from_ = np.empty(new.shape, dtype=np.int64)
        nodes = self.likely[k, here], room[here], self._within(k, here)
        states = best, *nodes, floor, _MARGIN, new, from_, other
        proofs, bounds = self._motions(k, here).onward(*begin, *states)
        long = proofs[3] >= 0
        keep = np.ones(len(long), dtype=bool)
        if self.long and not self.edges:  # between values that are not all alike
            every = max(1, round(len(self.grid) * _COARSE[1] / (2 * np.pi)))
            ends = np.stack([here[proofs[0] // len(self.turns)], proofs[2] // len(self.turns)])
            ends //= self.slots
            keep = ~long | (ends % every == 0).all(axis=0)
        if long.any():
            share = len(here) / (len(self.T) * (room >= floor).sum())
            most = max(int(_LONG * share), self.slots)
            if (long & keep).sum() > most:  # those that lack the least
                keep &= ~long | (proofs[3] <= np.partition(proofs[3][long & keep], most)[most])
        cell, held, edge = (x[keep] for x in proofs[:3])
        self._prove_edges(k, here, cell, held, edge, new.ravel(), from_.ravel())
        value = bounds[3].reshape(-1, len(self.turns))
        more = (value > np.maximum(np.maximum(other, new), floor)[bounds[0]]).any(axis=1)
        near = [x[more] for x in bounds[:3]]
        cap = self._cap(k, here, *near)[:, None]
        np.maximum.at(other, near[0], np.minimum(value[more], cap))
        return new, from_, other

    def _motions(self, k: int, here: Ints) -> Any:
        """Return motions to nodes ``here`` (M,) of a pose for the kernel."""
        near, to = (np.stack([self.clear[i], 0.55 * self.way[i]]) for i in (k - 1, k))
        joints = np.stack([self.turn, self.scale, self._farthest(k)])
        turns = np.flatnonzero(self.counted), self.turns
        nodes = self.Q[k - 1], self.Q[k, here], near, to[:, here].copy()
        return engine.module().Motions(*nodes, joints, *turns)

    def _pool(self, k: int, here: Ints, floor: float) -> None:
        """Look at motions to nodes ``here`` (M,) of a pose far from the last from all, if few."""
        self.pool[k] = None
        source = np.flatnonzero(self.through[k - 1] > floor)
        if len(here) and len(source) and self.far[k]:
            few = len(source) * len(here) <= self.motions // (4 * len(self.T))
            self.pool[k] = source if few else None
            self.crowded[k] = not few

    def _cap(self, k: int, here: Ints, node: Ints, source: Ints, slack: Array) -> Array:
        """Bound the clearance (K,) on motions near those from sources to nodes of ``here``."""
        q = self.Q[k - 1, source]
        return self._least_seen(q, self._gap(self.Q[k, here[node]] - q)) + slack

    def _least_seen(self, q: Array, move: Array, close: bool = False) -> Array:
        """Return the least bound of the clearance (M,) at three places of motions (M, n)."""
        if not len(q):
            return np.empty(0)
        every = np.concatenate([q + s * move for s in (1 / 4, 1 / 2, 3 / 4)])
        if close:
            return np.asarray(self._closest(every)[0].reshape(3, -1).min(axis=0))
        return np.asarray(quick(self.watched, every).upper.reshape(3, -1).min(axis=0))

    def _closest(self, Q: Array) -> tuple[Array, Array]:
        """Bound the clearance of Q (N, n) from above, without a search, from points (N, n)."""
        # Families are no farther from these than the bounds are longer than the ways there.
        found = two_sided(self.watched.conditions.zeros, Q, each=True, points=True)
        points = found.points / self.watched.conditions.weight
        return found.upper, points[np.arange(len(Q)), found.each[..., 1].argmin(axis=1)]

    def _sources(self, k: int, here: Ints) -> tuple[Ints, Bool]:
        """Return nodes (D, M) before pose k at which motions to nodes ``here`` (M,) begin.

        And which of these motions only bound other paths: beyond ``window`` values.
        """
        pool = self.edges[k][:, here] if self.edges else self.pool[k]
        if pool is not None:
            every = pool if self.edges else pool[:, None].repeat(len(here), axis=1)
            source = every.astype(np.int64, order="C")
            off = self.values[k, here] - self.values[k - 1][source]
            off -= 2 * np.pi * np.rint(off / (2 * np.pi)) if self.cyclic else 0.0
            return source, np.asarray(np.abs(off) > self.reach + ROUNDING)
        # Those of the same branch up to ``window`` values away, and last the next ones.
        whole, ends = self.slots * self.long, [self.before[k, here]] * 2
        found = [ends[0], *self.before[k][self.beside[k][:, here]]]
        found += [here // whole * whole + s for s in range(whole)]
        for _ in range(self.window + 1 if len(self.grid) > 1 else 0):
            ends = [side[end] for side, end in zip(self.beside[k - 1], ends, strict=True)]
            found += ends
        far = np.arange(len(found)) >= len(found) - 2 * (len(self.grid) > 1)
        return np.array(found, dtype=np.int64), np.repeat(far[:, None], len(here), axis=1)

    def _within(self, k: int, here: Ints) -> Bool:
        """Which turns of nodes (M,) of pose k a path may have, and one between (2, M, T)."""
        q = self.Q[k, here][:, None, self.counted] + 2 * np.pi * self.turns
        low, high = (
            x[self.counted] for x in (self.arm.lower - ROUNDING, self.arm.upper + ROUNDING)
        )
        off = np.maximum(low - q, q - high).max(axis=-1, initial=-np.inf)
        room = 0.55 * self.way[k, here]
        out = np.maximum(off, self.off[k, here, None]) <= np.stack([0 * room, room])[..., None]
        if k == 0 and self.start is not None:
            out &= (np.abs(q - self.start[self.counted]) < np.pi).all(axis=-1)
        return np.ascontiguousarray(out)  # which joints are counted decides how it lies

    def _count_turns(self, joints: Bool) -> None:
        """Tell the turns of joints apart, which the best path winds beyond their limits."""
        self.counted = self.counted | joints
        most = ((self.arm.upper - self.arm.lower)[self.counted] / (2 * np.pi)).clip(0, _TURNS)
        self.turns = np.array(list(product(*(range(-int(m), int(m) + 1) for m in most))))

    # -- between the values of the grid ------------------------------------------------------------

    def finer(self, reached: float, bound: float) -> _Planner | None:
        """Return a planner of thirds of a step, for paths better than ``reached``; or None."""
        # Nodes that stay farther than ``bound`` are not divided; of too many, those of most room
        # are kept.
        N, n = len(self.T), self.arm.n
        if len(self.grid) < 2 or self.idle:
            return None
        least, clear = max(reached + BISECTED, self.floor), self.clear
        wide = np.array([len(self._sources(max(k, 1), np.arange(1))[0]) for k in range(N)])
        nodes = np.minimum(self.most // N, self.motions // (3 * wide * N))  # at each pose
        passing = self._passed(least)
        alive = passing > least
        split = alive & (clear < bound) & (self.way > PRACTICAL)
        split[0] &= self.start is None
        if ((alive + 2 * split).sum(axis=1) > nodes).any():
            split[np.where(alive, clear, 0.0).max(axis=1) >= bound] = False
            order = np.argsort(-passing, axis=1)
            size = np.take_along_axis(alive + 2 * split, order, axis=1).cumsum(axis=1)
            left_out = np.take_along_axis(passing, order, axis=1)[size > nodes[:, None]]
            least = max(least, float(left_out.max(initial=-np.inf)))
            alive, split = alive & (passing > least), split & (passing > least)
        if least > bound - PRACTICAL or not split.any() or not alive.any(axis=1).all():
            return None
        pose, at = np.nonzero(alive)
        pieces = np.full((len(pose), 5, n), np.nan)
        pieces[:, 2] = self.Q[pose, at]
        some = np.flatnonzero(split[pose, at])
        thirds = self._thirds(pose[some], at[some])
        whole = np.isfinite(thirds[:, 1:4]).all(axis=(1, 2))
        some = some[whole]
        if not len(some):
            return None
        pieces[some] = thirds[whole]
        parts = np.isfinite(pieces[:, 1:4, 0])
        node, third = np.nonzero(parts)
        new, side, pose, at = parts[node, 0], third - 1, pose[node], at[node]
        slot = np.arange(len(pose)) - np.searchsorted(pose, pose)
        most = int(slot.max()) + 2  # the last one of each pose is none
        q, ends = pieces[node, third + 1], pieces[node[:, None], third[:, None] + [0, 2]]
        near = np.where(np.isnan(ends), self._neighbors(pose, at), ends)
        moved = self._length(q - pieces[node, 2])
        half = self.half[pose, at] / np.where(new, 3, 1)
        value = self.values[pose, at] + 2 * side * half
        if self.held is not None:
            value = q[:, self.held]
            ends = np.nan_to_num(near[..., self.held] - value[:, None])
            ends = (np.abs(ends).max(axis=1) + np.abs(ends.sum(axis=1))) / 2
            half = np.where(new, ends, half)

        out = copy.copy(self)
        out.floor, out.least, out.passing, out.far = least, least, None, np.zeros(N, dtype=bool)
        out.pool = [None] * N
        way = self.way[pose, at]
        way[new] = self._longer(near[new] - q[new, None])
        of = {name: getattr(self, name)[pose, at] for name in _FOUND}
        aside = moved > 0
        found = quick(self.watched, q[aside])
        of["clear"][aside] = np.maximum(found.lower, (of["clear"] - moved)[aside])
        of["highest"][aside] = np.minimum(found.upper, (of["highest"] + moved)[aside])
        of["likely"][aside] = of["clear"][aside]
        of["between"][new] = np.inf
        of["seen"] &= ~new
        of |= {"Q": q, "near": near, "values": value, "half": half, "way": way}
        of["off"] = self._beyond(q)
        for name, x in of.items():  # a row for each pose
            rows = np.full((N, most, *x.shape[1:]), _FOUND.get(name, np.nan), dtype=x.dtype)
            rows[pose, slot] = x
            setattr(out, name, rows)
        out.usable, out.slots = out.off <= 0, 1
        out.first = np.zeros(most, dtype=bool)
        out.first[slot[pose == 0]] = self.first[at[pose == 0]]
        part = np.full((*alive.shape, 3), -1)
        part[pose, at] = np.where(new[:, None], part[pose, at], slot[:, None])
        part[pose, at, third] = slot
        out.before = np.zeros((N, most), dtype=np.int32)
        out.edges = [np.empty((0, 0), dtype=np.int32)]
        start = np.searchsorted(pose, np.arange(N + 1))
        for k in range(1, N):
            here = at[start[k] : start[k + 1]]
            spans = out.values[k, : len(here)], out.half[k, : len(here)], out.values[k - 1]
            how = out.half[k - 1], self.reach + ROUNDING, self.cyclic, most - 1, out.before[k]
            edges = engine.module().divided(self._sources(k, here)[0], part[k - 1], *spans, *how)
            out.edges.append(edges.reshape(-1, len(here)))
        out.step = np.zeros((N, most))
        out.step[pose, slot] = self._length(q - out.Q[pose - 1, out.before[pose, slot]])
        return out

    def _thirds(self, pose: Ints, at: Ints) -> Array:
        """Return configurations (M, 5, n) about nodes (M,), a third of a step apart, or NaN."""
        n, count = self.arm.n, np.array([-2, -1, 1, 2])
        q = self.Q[pose, at][:, None]
        near = self._neighbors(pose, at)
        toward = np.nan_to_num(self.arm.space.wrap(near - q))
        unknown = self._length(toward)[..., None] == 0  # straight on from the other side
        toward = np.where(unknown, -toward[:, ::-1], toward)[:, [0, 0, 1, 1]]
        guess = q + toward * np.abs(count)[:, None] / 3
        value = self.values[pose, at][:, None]
        value = value + count * (2 / 3) * self.half[pose, at][:, None]
        p, R = self._targets(self.T[pose], value)
        found = self.solver.continued(
            guess.reshape(-1, n),
            np.broadcast_to(p, (*value.shape, 3)).reshape(-1, 3),
            np.broadcast_to(R, (*value.shape, 3, 3)).reshape(-1, 3, 3),
        ).reshape(guess.shape)
        found[self._length(found - guess) > self._length(toward) / 2 + BISECTED] = np.nan
        if self.held is not None:  # what is divided reaches as far as before
            ends, inner = near - found[:, ::3], found[:, 1:3] - q
            short = self._longer(ends[:, :, None]) > 2 * self._longer(inner[:, :, None]) + BISECTED
            found[:, 1:3][short & ~unknown[..., 0]] = np.nan
        there = np.isfinite(found[..., 0])
        found[there] = self.arm.space.fold(found[there])
        return np.concatenate([found[:, :2], q, found[:, 2:]], axis=1)

    def _longer(self, ends: Array) -> Array:
        """Return the longer of the motions (M, 2, n) to a node's neighbors on its branch."""
        way = self._size(_unturned(ends, self.whole))
        way[np.isnan(way)] = 2 * np.pi
        return np.asarray(np.maximum(way[..., 0], way[..., -1]))

    def _passed(self, least: float) -> Array:
        """Return the most room (N, M) of paths through nodes, where that is more than ``least``.

        Found once, with the first ``least`` asked for.
        """
        if self.passing is None:
            passing = self.through.copy()
            for k in range(len(self.T) - 1, 0, -1):
                here = np.flatnonzero(passing[k] > least)
                onward = np.full(passing.shape[1], -np.inf)
                ends = self.through[k - 1], passing[k, here], self._room(k)[here]
                motions, source = self._motions(k, here), self._sources(k, here)[0]
                *near, value = motions.onward_back(source, *ends, least, onward)
                np.maximum.at(onward, near[1], np.minimum(value, self._cap(k, here, *near)))
                passing[k - 1] = np.minimum(passing[k - 1], onward)
            self.passing = passing
        return self.passing

    def _link(self) -> None:
        """Find the neighbours of all nodes, and the longer ``way`` (N, M) along the grid."""
        # ``beside`` (N, 2, M) them both ways, and of their value at the pose ``before`` (N, M).
        # From all nodes of poses ``far`` (N,) from the one before motions are looked at.
        (N, M), G = self.clear.shape, len(self.grid)
        self.beside, self.way = np.empty((N, 2, M), dtype=np.int32), np.zeros((N, M))
        self.ended = np.zeros(self.beside.shape, dtype=bool)
        self.before, self.step = np.empty((N, M), dtype=np.int32), np.zeros((N, M))
        self.window = 0 if G == 1 else min(G // 2, max(3, -(-_TURNS * G // N)))
        steps = np.diff(self.grid) if G > 1 else np.zeros(1)
        half = np.fmax(np.append(steps, steps[-1:]), np.append(steps[:1], steps))[:G] / 2
        self.half = np.broadcast_to(np.repeat(half, self.slots), self.way.shape)
        self.reach = self.window * steps.max() if self.window < G // 2 else np.inf
        self.pool: list[Ints | None] = [None] * N
        self.most = max(self.clear.size, 400_000) // 4
        self.motions = max(self.clear.size * 32, 8_000_000)

        ends = self.ended.copy()
        found = self.before, self.step, self.beside, ends, self.way, engine.cpu_count()
        how = self.turn, self.whole, self.scale, self.cyclic
        engine.module().link_nodes(self.Q.reshape(N, G, self.slots, -1), *how, *found)
        self.ended = ends & (self.beside != np.arange(M)) & (not self.cyclic)
        k, at = np.nonzero(self.ended.any(axis=1))
        near = self._neighbors(k, at) - self.Q[k, at][:, None]
        near[(ends & ~self.ended)[k, :, at]] = np.nan
        self.way[k, at] = self._longer(near)
        nodes = np.isfinite(self.clear)
        far = (nodes & ~(self.step <= _COARSE[1])).sum(axis=1) > nodes.sum(axis=1) / 2
        self.far = far & (not self.rough)
        if self.start is not None:
            self.way[0] = 0.0

    def _room(self, k: int) -> Array:
        """Return the most clearance (M,) that there may be up to halfway to a neighbouring value.

        As far as the ends are from the point that was found, and twice how far the branch bends; a
        tenth more than half of the chord where no point was looked for.
        """
        way = 0.55 * self.way[k] * (not self.idle)  # the last joint changes no clearance
        room = np.minimum(self.highest[k] + way, self.between[k])
        return np.where(self.off[k] <= 0.55 * self.way[k], room, -np.inf)

    def _neighbors(self, k: Ints, at: Ints) -> Array:
        """Return configurations (M, 2, n) on both sides of nodes (M,), two half widths away."""
        if self.edges:
            return np.asarray(self.near[k, at])
        link = self.beside[k, :, at]
        near: Array = self.Q[k[:, None], link]
        if self.cyclic:
            return near
        # A branch goes on beyond the value of a joint where it turns back, straight on from here
        # as far as its middle moved between the last two values at most.
        ended = self.ended[k, :, at]
        m, j = np.nonzero(ended & ~ended[:, ::-1])
        q, to, k = self.Q[k[m], at[m]], near[m, j], k[m]
        other = to - self.Q[k, self.beside[k, 1 - j, link[m, j]]]
        on, other, across = (self.arm.space.wrap(x) for x in (q - near[m, 1 - j], other, to - q))
        size, far = self._length(on), self._length(across)
        share = (far + np.minimum(self._length(on + other), size)) / np.where(size > 0, size, 1.0)
        near[m, j] = np.where((far < size / 2)[:, None], q + on * share[:, None], to)
        return near

    def _beyond(self, Q: Array) -> Array:
        """How far nodes (..., n) are from within the limits at least; zero or less within."""
        here, inside = self.bounded, Q[..., self.bounded]
        low, high = self.arm.lower[here] - ROUNDING, self.arm.upper[here] + ROUNDING
        off = np.maximum(low - inside, inside - high) * self.scale[here]
        return np.asarray(off.max(axis=-1, initial=-np.inf) + 0 * Q[..., 0])

    def _prove_edges(
        self, k: int, here: Ints, cell: Ints, value: Array, edge: Ints, new: Array, from_: Ints
    ) -> None:
        """Take those edges to pose k that halving proves clear: values and numbers of states."""
        T, order = len(self.turns), np.lexsort((-value, cell))
        cell, value, edge = cell[order], value[order], edge[order]
        while len(more := np.flatnonzero(value > new[cell])):  # each state's best candidate first
            cell, value, edge = cell[more], value[more], edge[more]
            at = np.unique(cell, return_index=True)[1]
            pairs = (k - 1, edge[at] // T), (k, here[cell[at] // T])
            q, to = (self.Q[pair] for pair in pairs)
            clear, move = [self.clear[pair] for pair in pairs], self._gap(to - q)
            found = np.minimum(value[at], self._least_seen(q, move))
            value[at] = -np.inf
            better = found > new[cell[at]]
            ends = (x[better] for x in clear)
            better[better] = self._is_clear(q[better], move[better], *ends)
            close = self._least_seen(q[better], move[better], close=True)
            found[better] = np.minimum(found[better], close)
            better &= found > new[cell[at]]
            at, found = at[better], found[better]
            new[cell[at]], from_[cell[at]] = found, edge[at]

    def _is_clear(self, q: Array, move: Array, *ends: Array) -> Bool:
        """Which motions (M, n) from q (M, n), clear at both ends, are proven so by halving."""
        out: Bool = np.ones(len(q), dtype=bool)
        edge = np.arange(len(q))
        for _ in range(6):
            left = ends[0] + ends[1] <= self._size(move)
            out[edge[left & (np.minimum(*ends) <= 0)]] = False
            left &= out[edge]
            if not left.any():
                return out
            edge, q, move, (a, b) = edge[left], q[left], move[left] / 2, (x[left] for x in ends)
            middle = quick(self.watched, q + move).lower
            edge, q, move = np.tile(edge, 2), np.concatenate([q, q + move]), np.tile(move, (2, 1))
            ends = np.concatenate([a, middle]), np.concatenate([middle, b])
        out[edge[ends[0] + ends[1] <= self._size(move)]] = False
        return out

    def _farthest(self, k: int) -> Array:
        """How far joints (n,) may move to pose k: half a turn, within their speed limits."""
        most: Array = np.where(self.arm.prismatic, np.inf, np.pi)  # `check` calls more a jump
        if self.timed:
            fast = limits_of(self.arm) * (self.t[k] - self.t[k - 1]) * self.scale
            most = np.minimum(most, fast)
        return most

    def _why(self, k: int, best: Array) -> str:
        """Why no node of pose k is reached from those of the pose before."""
        names = np.array(self.arm.joints)
        if self.counted.any():
            wound = " or ".join(names[self.counted])
            return f"every path to pose {k} winds {wound} beyond its limits"
        source = np.isfinite(best).any(axis=-1)
        target = self.usable[k]
        q, to = self.Q[k - 1][source], self.Q[k][target]
        if not len(q) or not len(to):
            return f"no motion between poses {k - 1} and {k} is proven clear"
        gap = self._gap(to[None] - q[:, None])
        near = np.unravel_index(int(np.linalg.norm(gap, axis=-1).argmin()), gap.shape[:2])
        a, move = q[near[0]], gap[near]
        apart = f"{np.degrees(np.linalg.norm(move)):.3g}°"
        out = self.Q[k][np.isfinite(self.clear[k]) & ~target]
        far = np.linalg.norm(self._gap(out[None] - q[:, None]), axis=-1)
        if 2 * far.min(initial=np.inf) < np.linalg.norm(move):
            left = names[self.arm.space.outside(out[far.min(axis=0).argmin()])].tolist()
            return (
                f"between poses {k - 1} and {k} the way on leaves the limits of {listed(left)}: "
                f"within them the nearest solution is {apart} away"
            )
        met = crossings(self.form, np.array([a, a + move])).events
        ends = names[np.minimum(a - self.arm.lower, self.arm.upper - a) <= ROUNDING].tolist()
        between = (
            f", with {listed(ends)} at the limit" if ends else "; give more poses between them"
        )
        if met:
            title = self.form[met[0].family].title
            family = titled(met[0].family, title)
            geometry = self.form.geometry
            sides = [
                {w for names in posture_names(geometry, x) for w in names if w.split()[0] == title}
                for x in (q, to)
                if geometry is not None
            ]
            if len(sides) == 2 and len(sides[0]) == len(sides[1]) == 1 and sides[0] != sides[1]:
                return (
                    f"every path that is proven clear so far crosses {family} between poses "
                    f"{k - 1} and {k}"
                )
            between = f", with {family} between them"
        share = np.abs(move) * self.scale / self._farthest(k)
        if share.max() > 1:
            j = int(share.argmax())
            turned = not self.arm.prismatic[j] and abs(move[j]) > np.pi
            how = "turn by over half a turn" if turned else "exceed its speed limit"
            return f"{names[j]} would {how} between poses {k - 1} and {k}"
        return (
            f"no motion between poses {k - 1} and {k} is proven clear: the nearest solutions are "
            f"{apart} apart{between}"
        )

    def _unwrapped(self, q: Array, turns: Ints) -> Array:
        """The path (N, n) without jumps by whole turns: from the start, or within limits if so."""
        steps = self._gap(np.diff(q, axis=0))
        path: Array = np.concatenate([q[:1], q[0] + np.cumsum(steps, axis=0)])
        if self.start is not None:
            return np.asarray(path + self.turn * np.rint((self.start - q[0]) / (2 * np.pi)))
        path[:, self.counted] += 2 * np.pi * self.turns[turns[0]]
        free = (self.turn > 0) & ~self.counted
        return np.asarray(path + np.where(free, self.arm.space.turns_within(path), 0.0))

    # -- what others reach ------------------------------------------------------------------------

    def _kept(self) -> Array:
        """Return clearance (B, N) at poses with what is free kept, of each branch it may begin on.

        NaN from where there is no solution, or no motion to the next pose that is clear, slow
        enough, and within the limits.
        """
        i = (self.kept - self.rolled) % len(self.grid)
        poses, nodes = np.arange(len(i)), i[:, None] * self.slots + np.arange(self.slots)
        at = poses[:, None], nodes
        rows = tuple(x[~self.seen[at]] for x in np.broadcast_arrays(*at))
        self.likely[rows] = np.minimum(self.highest[rows], self._closest(self.Q[rows])[0])
        slots = [nodes[0, self.usable[0, nodes[0]] & self.first[nodes[0]]]]
        for k in range(1, len(i)):  # the nearest ones
            gap = self.Q[k, nodes[k]] - self.Q[k - 1, slots[-1]][:, None]
            way = np.where(self.usable[k, nodes[k]], self._length(gap), np.inf)
            slots.append(nodes[k, way.argmin(axis=1)])
        at = poses, np.stack(slots, axis=1)
        q, clear = self.Q[at], self.clear[at]
        move = self._gap(np.diff(q, axis=1))
        path = np.concatenate([q[:, :1], q[:, :1] + np.cumsum(move, axis=1)], axis=1)
        if self.start is not None:
            path += self.turn * np.rint((self.start - q[:, :1]) / (2 * np.pi))
        high, low = np.maximum.accumulate(path, axis=1), np.minimum.accumulate(path, axis=1)
        ends = np.stack([self.arm.upper - high, low - self.arm.lower])[:, :, 1:]
        turns = np.floor(ends / (2 * np.pi) + 1e-9)
        fits = (turns.sum(axis=0) if self.start is None else turns.min(axis=0)) >= 0
        farthest = np.array([self._farthest(k) for k in range(1, len(i))])
        fits = (fits | self.bounded) & (np.abs(move * self.scale) <= farthest)
        goes = np.logical_and.accumulate(fits.all(axis=2) & self.usable[at][:, 1:], axis=1)
        long = goes & (self._size(move) >= clear[:, :-1] + clear[:, 1:])
        ends_of = q[:, :-1][long], move[long], clear[:, :-1][long], clear[:, 1:][long]
        goes[long] = self._is_clear(*ends_of)
        goes = np.logical_and.accumulate(goes, axis=1)
        out: Array = self.likely[at]
        out[:, 1:][~goes] = np.nan
        return out

    def _roll_moves_the_last_joint(self) -> bool:
        """Return True if all nodes of the first pose differ in the last joint alone."""
        Q = self.Q[0].reshape(-1, self.arm.n)
        Q = Q[np.isfinite(Q[:, 0])]
        apart = np.abs(self.arm.space.wrap(Q[:, None] - Q[None, :1]))[..., :-1].max(axis=-1)
        return len(Q) > 0 and len(np.unique(np.round(apart, 6))) <= 16

    def _proven(self, q: Array) -> tuple[float, float]:
        """The least clearance along a path (N, n), between poses too, and at which pose it is."""

        def bounded(x: Array) -> Array:
            turned = self.arm.space.wrap(x)
            return clearance(self.form, turned, certify=True, gap=CLOSE).lower

        lower = bounded(q)
        return least_along(q, lower, float(lower.min()), self._size, bounded)


def _unturned(difference: Array, turn: Array) -> Array:
    """Take as many turns (n,) off joint values (..., n) as leave the least; of 0 none."""
    turns: Array = np.rint(difference * (0.5 / np.pi))
    turns *= turn
    return np.asarray(np.subtract(difference, turns, out=turns))


def _rolls(T: Array) -> Array:
    """Return how far poses (N, 4, 4) have turned about z, beside what turns z: radians (N,)."""
    R, z = T[:, :3, :3], T[:, :3, 2]
    axis, both = np.cross(z[:-1], z[1:]), 1 + (z[:-1] * z[1:]).sum(axis=1)
    K = np.stack([np.cross(axis, e) for e in np.eye(3)], axis=-1)
    x = R[:-1, :, 0] + (K @ R[:-1, :, :1])[..., 0]
    x += (K @ K @ R[:-1, :, :1])[..., 0] / np.maximum(both, PRACTICAL)[:, None]
    x, y = (x * R[1:, :, 0]).sum(axis=1), -(x * R[1:, :, 1]).sum(axis=1)
    return np.concatenate([[0.0], np.cumsum(np.arctan2(y, x))])


def rigid_motions(poses: ArrayLike, name: str) -> Array:
    """Return poses as an array (N, 4, 4); ConfigurationError with ``name`` if they are none."""
    T: Array = np.asarray(poses, dtype=float)
    if T.ndim != 3 or T.shape[1:] != (4, 4):
        raise ConfigurationError(f"{name} needs 4x4 matrices, got shape {T.shape}")
    R = T[:, :3, :3]
    off = np.abs(R @ R.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
    bad = ~np.isfinite(T).all(axis=(1, 2)) | ~(off < 1e-6) | ~(np.linalg.det(R) > 0)
    bad |= ~np.isclose(T[:, 3], [0, 0, 0, 1]).all(axis=1)
    if bad.any():
        raise ConfigurationError(f"{name}: number {int(bad.argmax())} is no rigid motion")
    return T
