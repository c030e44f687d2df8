"""How near is too near: distances beyond which no tip motion exceeds the joint speed limits.

They are found by branch and bound over boxes of joint space. A box is done where the joint speeds
that the tip motions take are proven to stay within their limits, or where all of it is nearer to a
family than the distance that is looked for is going to be: distance to a family grows no faster
than the joints that it depends on move. A configuration that does exceed a limit bounds the answer
from below.

Joint speeds in a box: with the Jacobian J(q) = J + D, and A a right inverse of J, of a square one
the inverse, joint velocities ``z = A X x - A D z`` make the twist x, which X(q) takes to the point
that J(q) is for: those of a redundant arm are no others than ``A (J(q) A)^(-1) X x``, so that
limits which they keep can be kept. With ``A D = E = E1 + E2 + E3`` (the first order, the second,
the rest), put into itself twice this is
``z = b - E1 b + P b - P E z + E1 (E2 + E3) z - E3 z`` where ``b = A X x`` and ``P = E1^2 - E2``, of
size Q. Its first and second order are looked at, and where ``F + T y <= y`` for a bound F of what
is known and T the sizes of the others, all z are at most y, and J(q) A is nowhere singular (the
theorem of Perron and Frobenius, as in Krawczyk's method). J is written in the axes of a link in the
middle, of twists at a point of that link: columns then change by the joints between alone. Where
the task has not all rotations that the arm makes, the link is the last one, and the point the tip.
Each product of floats is charged with ``NOISE`` times the sum of the sizes of its terms, which
covers a thousand operations, and A with twice what J A misses.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from pinsing._batch import engine
from pinsing.algebra.conditions import BOXES as NEAREST, SearchOptions, nearest_points, two_sided
from pinsing.algebra.trig_sum import TINY, off_values
from pinsing.errors import EngineError, OptionError
from pinsing.families import ClosedForm, Family
from pinsing.interface import JsonResult, checked
from pinsing.kinematics.jacobian import (
    frame_jacobians,
    random_turns,
    singular_values,
    tip_poses,
    tip_rotations,
)
from pinsing.kinematics.ladder import posture_names
from pinsing.kinematics.tip_speed import TIP_SPEED, TURN_SPEED, SpeedJudge, speed_judge
from pinsing.measures import NOISE, ROUNDING, Array, ArrayLike, Bool, Ints
from pinsing.prose import listed, one_line
from pinsing.proximity.clearance import Watched, metric_note, titled, watch
from pinsing.proximity.trajectory import angle_text
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.robot.nominal import chain_differs, flatten, placements_of

if TYPE_CHECKING:
    from scipy.spatial import KDTree


@dataclass(frozen=True, eq=False)
class Zones(JsonResult):
    """Distances from singularities beyond which tip motions keep the joint speed limits.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    placements : (n + 1, 3, 4) array
        Of each joint in the one before, and of the tip: rotations, and metres.
    tip_speed, turn_speed : float
        m/s and rad/s of the tip, at once and in any directions.
    joint_speeds : (n,) array
        Speed limits, rad/s and m/s. A redundant arm exceeds one if all joint speeds that make a
        motion do.
    within : tuple of str
        Where the answer holds, in words; empty for all of joint space.
    lower, upper : (n,) arrays
        The same as joint values.
    tip_lower, tip_upper : (3,) arrays
        The same as positions of the tip in the base, metres; infinite where all count.
    posture : tuple of str
        The same as names of the posture, such as "elbow up"; empty for all.
    distances : dict of str to float
        Proven: farther than these from the families, radians (or metres over the length scale),
        no limit is exceeded. 0 where the family need not be kept away from.
    exceeding : dict of str to float
        A configuration that exceeds a limit is this far from the family, and farther than
        ``distances`` from the others; 0 where none was found.
    common, common_exceeding : float
        The same with one distance for all families.
    worst : (n,) array
        The configuration that exceeds a limit farthest from all families; empty if none was found.
    sigma_min, sigma_min_proven : float
        The least singular value found outside the zones, and a proven bound of all.
    condition_number : float
        The largest found outside the zones.
    titles : dict of str to str
        What families are called, with their condition where it is short.
    complete : bool
        Whether the closed form is: it does not matter to the proof.
    boxes : int
        Work: boxes that were looked at, two for each configuration that was tried, and an eighth of
        those that distances took.
    notes : tuple of str
        What was assumed, and where the search ended before the gap was reached.
    """

    schema: ClassVar[str] = "pinsing/zones/2"

    arm: ArmSummary
    placements: Array
    tip_speed: float
    turn_speed: float
    joint_speeds: Array
    within: tuple[str, ...]
    lower: Array
    upper: Array
    tip_lower: Array
    tip_upper: Array
    posture: tuple[str, ...]
    distances: dict[str, float]
    exceeding: dict[str, float]
    common: float
    common_exceeding: float
    worst: Array
    sigma_min: float
    sigma_min_proven: float
    condition_number: float
    titles: dict[str, str]
    complete: bool
    boxes: int
    notes: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        said = ", ".join(f"{name} {d:.3g}" for name, d in self.distances.items())
        return one_line("Zones", f"{self.arm.name}, {said}")

    @property
    def speeds(self) -> str:
        """Speeds of the tip, in words."""
        return f"{self.tip_speed:g} m/s and {self.turn_speed:g} rad/s"

    @checked
    def text(self, degrees: bool = True) -> str:
        """Return the answer in lines.

        Parameters
        ----------
        degrees : bool
            Angles in degrees, or in radians.

        Examples
        --------
        >>> import pinsing
        >>> form = pinsing.closed_form(pinsing.load("scara"))
        >>> print(pinsing.zones(form, joint_speeds=[5, 5, 1, 10]).text().splitlines()[0])
        scara: keep 20.3° from F1: q2 = 0° or 180° (proven)
        """
        far = partial(angle_text, degrees=degrees)
        kept = [n for n, d in self.distances.items() if d > 0]
        where = f"with {listed(self.within)}, " if self.within else ""
        exceeded, found = self.common_exceeding, math.isfinite(self.sigma_min)
        notes = [f"note: {n}" for n in self.notes]
        if kept and not found:
            lines = [
                f"{self.arm.name}: {where}no useful distance was found",
                "",
                f"  {self.speeds} exceed a limit nearly everywhere, or the search ended too early:",
                "  try lower --tip-speed and --turn-speed, a smaller --within, or more --boxes "
                f"({self.boxes:,} here)",
                f"  A joint speed limit is exceeded even {far(exceeded)} from all families",
            ]
            return "\n".join([*lines[: 5 if exceeded else 4], *notes])
        head = "no distance need be kept (proven)" if found else "no configuration was found"
        if kept:
            away = listed([f"{far(self.distances[n])} from {self.titles[n]}" for n in kept])
            head = f"keep {away} (proven)"
        then = f"  Then {self.speeds} of the tip, in any directions, exceed no joint speed limit"
        lines = [f"{self.arm.name}: {where}{head}", "", *[then] * found]
        for name in kept:
            short = "no configuration found that exceeds one"
            if self.exceeding[name]:
                short = f"a limit is exceeded at {far(self.exceeding[name])}"
            lines.append(f"  {self.titles[name]}: {far(self.distances[name])}; {short}")
        short = f"; a limit is exceeded at {far(exceeded)}" * bool(exceeded)
        lines.append(f"  One distance for all: {far(self.common)}{short}")
        if found:
            lines.append(
                f"  Outside: sigma_min down to {self.sigma_min:.3g} (at least "
                f"{self.sigma_min_proven:.3g}, proven), condition number up to "
                f"{self.condition_number:.3g} (found)"
            )
        return "\n".join([*lines, *notes])


def zone_distances(
    zones: Zones, arm: ArmSummary, loaded: Arm | None, names: Sequence[str]
) -> Array:
    """Return distances (F,) of zones to named families, 0 where none is kept."""
    # OptionError for another arm or families, or zones that depend on a posture or on the tip.
    require_zones_of(zones, arm, loaded, names)
    if zones.posture or np.isfinite(zones.tip_lower).any():
        raise OptionError(f"zones of {', '.join(zones.within)}: give those of joint ranges")
    return np.array([zones.distances.get(name, 0.0) for name in names])


def require_zones_of(
    zones: Zones, arm: ArmSummary, loaded: Arm | None, names: Sequence[str]
) -> None:
    """Raise OptionError unless zones are of this arm, and of families of these names."""
    mine, other = (
        (a.name, a.joints, a.base, a.tip, a.task, a.length_scale) for a in (zones.arm, arm)
    )
    kept = {name for name, far in zones.distances.items() if far > 0}
    if mine != other or kept - set(names):
        raise OptionError(
            f"zones are of {zones.arm.name}, base {zones.arm.base}, tip {zones.arm.tip}, task "
            f"{zones.arm.task}, and families {', '.join(sorted(kept))}, not of {arm.name}, base "
            f"{arm.base}, tip {arm.tip}, task {arm.task}, and {', '.join(names)}"
        )
    OptionError.refuse_if(
        loaded is not None and chain_differs(loaded, zones.placements),
        f"zones are of {zones.arm.name} with its joints in other places, as by another "
        "calibration: make them of this robot, with the options that it has here",
    )


Records: TypeAlias = Any
"""An np.recarray: named numbers of each of N boxes."""


class SpeedBounds:
    """Bounds the joint speeds that tip motions (m/s and rad/s, any directions) of one arm take.

    ``travel`` (n,): half the range of prismatic joints, metres. ``moving`` (n,): joints that the
    shares depend on.
    """

    def __init__(
        self, judge: SpeedJudge, tip_speed: float, turn_speed: float, travel: Array
    ) -> None:
        EngineError.refuse_if(
            not engine.available(), f"zones need the compiled kernel: {engine.unavailable_reason()}"
        )
        self.judge, arm = judge, judge.arm
        self.v, self.w = tip_speed, turn_speed
        chain, task = flatten(arm), arm.task
        OptionError.refuse_if(
            arm.coupling is not None, f"{arm.name} has mimic joints: their speeds are not judged"
        )
        self.axis = task.tool_axis if task.at_tip else None
        OptionError.refuse_if(
            task.at_tip and (self.axis is None or len(task.translation) != 3),
            f"task {task}: give one with rows in base axes, or tool-axis",
        )
        OptionError.refuse_if(
            self.axis is not None and judge.rank < 5,
            f"{arm.name}: the arm cannot move its tip in every direction of the task {task} "
            f"({judge.rank} of 5): choose one that it can, such as position",
        )
        # Rows in base axes; a turn about the tool's axis is a joint of its own, without a limit.
        rows = np.zeros((6, len(task.rows)))
        rows[list(task.rows), range(len(task.rows))] = 1.0
        self.rows = (
            np.eye(6) if self.axis is not None else np.ascontiguousarray((rows @ judge.basis).T)
        )
        self.linear: Bool = np.asarray(self.rows[:, :3].any(axis=1))
        ways, axes = np.split(frame_jacobians(arm, random_turns(arm, 4)), 2, axis=1)
        # Rotations by the joints have to leave the rows of the task among themselves.
        for block in (self.rows[self.linear, :3], self.rows[~self.linear, 3:]):
            turned = np.cross(np.swapaxes(axes, 1, 2)[:, :, None], block)
            OptionError.refuse_if(
                np.abs(turned - turned @ block.T @ block).max(initial=0.0) > NOISE,
                f"the rows of the task {task.name} turn with the arm: give pose",
            )
        angular = self.rows[~self.linear, 3:]
        left = np.abs(axes - angular.T @ (angular @ axes)).max(initial=0.0)
        steps = np.linalg.norm(chain.t, axis=1) + np.append(0.0, np.where(arm.prismatic, travel, 0))
        reach = np.cumsum(steps[::-1])[::-1][1:]  # from each joint to the tip
        across = np.linalg.norm(chain.t[1:, :2], axis=1) + reach - steps[1:]
        self.far = np.append(np.where(arm.prismatic, 1.0, across), [0.0] * (self.axis is not None))
        count, most = len(self.far), engine.module().SPEED_COLUMNS
        OptionError.refuse_if(count > most, f"zones: an arm may have {most} joints, not {count}")
        self.turns: Bool = np.append(~arm.prismatic, np.ones(int(self.axis is not None), bool))
        self.middle = (count - 1) // (1 if left > NOISE else 2)
        self.moving: Bool = np.arange(arm.n) > 0
        # The last joint has no effect where it moves the tip along the axes of all turns, or not.
        swept = np.abs(np.cross(axes, ways[:, :, -1:], axis=1)).max()
        self.moving[-1] &= self.axis is not None or swept > NOISE / 10 or count == 1

    def jacobians(self, Q: Array) -> Array:
        """Jacobians (N, 6, k), the turn about the tool's axis as the last column."""
        J = frame_jacobians(self.judge.arm, Q)
        if self.axis is None:
            return J
        spin = tip_rotations(self.judge.arm, Q)[:, :, self.axis]
        return np.concatenate([J, np.concatenate([0 * spin, spin], axis=1)[:, :, None]], axis=2)

    def of(self, C: Array, R: Array) -> Records:
        """Shares of the limits in boxes of centres C (N, n) and half widths R (N, n).

        ``center`` (N,): above 1 a limit is exceeded. ``first`` (N,): in all of the box by the first
        order. ``most`` (N,): proven for all of the box; infinite where not, or over 1. ``pull``
        (N, n): how much of the bound is due to the width of each joint.
        """
        # Two choices of a right inverse are looked at, and 13 where limits are nearly reached:
        # speeds that are least at the centre change more than others do in all of a wide box. Of
        # one joint to spare the best choice is known.
        found = self._of(C, R, 2)
        close = np.flatnonzero((found.most > 1) & (found.center > 0.9))
        spare = len(self.far) - len(self.rows)
        if spare and len(close):
            found[close] = self._of(C[close], R[close], 13 if spare > 1 else 0)
        return found

    def _of(self, C: Array, R: Array, rounds: int) -> Records:
        out = engine.module().joint_speeds(
            *(self.rows, self.linear.sum(), self.judge.limits, self.far, self.turns, self.moving),
            *([self.v, self.w], self.middle, rounds, self.jacobians(C)),
            *(np.ascontiguousarray(R), engine.isa_names()[-1], engine.cpu_count()),
        )
        names = [(name, float) for name in ("center", "first", "most")]
        return out.view([*names, ("pull", float, C.shape[1:])])[:, 0].view(np.recarray)


def sums_behind(x: Array) -> Array:
    """Sums (N, k) of what stands behind each place of x (N, k)."""
    return np.asarray(np.cumsum(x[:, ::-1], axis=1)[:, ::-1] - x)


GAP = 0.05
"""Share of a distance within which a configuration that exceeds a limit is looked for."""
BOXES = 2_000_000
"""Work for all distances together, as many boxes; within limits a UR5 takes 130,000 and an xArm 7
nearly all, 2.5 s and 45 s of one processor."""


@checked
def zones(
    form: ClosedForm,
    linear: float = TIP_SPEED,
    angular: float = TURN_SPEED,
    *,
    joint_speeds: ArrayLike | None = None,
    within: Mapping[str, tuple[float, float] | None] | str | None = None,
    boxes: int = BOXES,
    progress: Callable[[str, int, int], None] | None = None,
) -> Zones:
    """Find the distances from singularities beyond which joint speed limits are kept.

    First the least common distance, then that of each family, in the order of the form, lowered as
    far as it goes with those of the others as they are.

    Parameters
    ----------
    form : ClosedForm
        Of the arm.
    linear, angular : float
        Tip speeds, m/s and rad/s, at once and in any directions.
    joint_speeds : (n,) array_like, optional
        Speed limits, rad/s and m/s; those of the description if not given.
    within : mapping or str, optional
        Where; else whole circles. Parts between commas are "limits" (the joint limits), names of
        the posture ("elbow up, wrist no-flip"), and ranges of joints and of the tip's position in
        the base ("elbow_joint=0.7..2.4, z=0.1..0.5", radians and metres). A mapping has ranges by
        name, ``{"elbow_joint": (0.7, 2.4)}``, and None for a word. Prismatic joints always keep
        their limits.
    boxes : int
        Most work, half of it for the common distance of several families: boxes looked at, two for
        each configuration that is tried, and an eighth of those that distances take. The answer is
        proven with less, but larger.
    progress : callable
        Told what is done, how far it is, and how far that goes.

    Returns
    -------
    Zones
        With what was assumed in ``notes``.

    Raises
    ------
    OptionError, UnknownNameError
        If speeds or ranges make no sense, speed limits are not known, the arm has a task that
        is not covered, or its postures have no such names.
    EngineError
        Without the compiled kernel.

    Examples
    --------
    >>> import pinsing
    >>> form = pinsing.closed_form(pinsing.load("scara"))
    >>> found = pinsing.zones(form, joint_speeds=[5, 5, 1, 10])
    >>> found.common_exceeding <= found.common
    True
    """
    judge = bounds_of(form.loaded, linear, angular, joint_speeds).judge
    parts = parts_of(within) if isinstance(within, str) else within or {}
    region = Region(form, judge.arm, parts)
    bounds = SpeedBounds(judge, linear, angular, _travel(judge.arm, region.lower, region.upper))
    return _Search(form, bounds, region, boxes, progress).zones()


def bounds_of(
    arm: Arm | None, linear: float, angular: float, joint_speeds: ArrayLike | None
) -> SpeedBounds:
    """Return what bounds the joint speeds of an arm, or raise OptionError if nothing does."""
    judge = speed_judge(arm, linear, angular, joint_speeds)
    arm = judge.arm
    missing = [n for n, c in zip(arm.joints, judge.limits, strict=True) if not math.isfinite(c)]
    OptionError.refuse_if(
        missing, f"no speed limit is known of {listed(missing)}: give joint_speeds"
    )
    travel = _travel(arm, arm.lower, arm.upper)
    OptionError.refuse_if(
        not np.isfinite(travel).all(), f"{arm.name} has a prismatic joint without limits"
    )
    return SpeedBounds(judge, linear, angular, travel)


def _travel(arm: Arm, lower: Array, upper: Array) -> Array:
    """How far (n,) prismatic joints are at most from zero, metres."""
    return np.where(arm.prismatic, np.maximum(np.abs(lower), np.abs(upper)), 0.0)


def parts_of(
    within: str, numbers: Callable[[str, str], float] = lambda name, text: float(text)
) -> dict[str, tuple[float, float] | None]:
    """Return ranges by name, read by ``numbers``, and words with None, of text between commas."""
    out: dict[str, tuple[float, float] | None] = {}
    for part in within.split(","):
        name, found, ends = part.partition("=")
        low, dots, high = ends.partition("..")
        name = " ".join(name.split())
        if found and not dots:
            raise OptionError(f"within {part.strip()}: write JOINT=A..B, such as q3=40..140")
        OptionError.refuse_if(found and name in out, f"within: {name} has two ranges")
        try:
            out[name] = (numbers(name, low), numbers(name, high)) if found else None
        except ValueError:
            raise OptionError(f"within {part.strip()}: {ends!r} is no range of numbers") from None
    return out


def is_of_tip(arm: Arm, name: str) -> bool:
    """Return True if a range of this name is one of the tip's position."""
    return name in ("x", "y", "z") and name not in arm.joints


class Region:
    """Where zones are asked for: ranges of joints and of the tip's position, and a posture.

    ``lower`` and ``upper`` (n,) bound joints, ``tip`` (2, 3) its position in the base; ``moving``
    (n,) joints move it along bounded axes. ``words`` say all.
    """

    def __init__(
        self,
        form: ClosedForm,
        arm: Arm,
        parts: Mapping[str, tuple[float, float] | None],
        what: str = "within",
    ) -> None:
        self.form, self.arm = form, arm
        self.lower = np.where(arm.prismatic, arm.lower, -np.pi)
        self.upper = np.where(arm.prismatic, arm.upper, np.pi)
        self.tip = np.outer([-np.inf, np.inf], np.ones(3))
        ranges = {name: ends for name, ends in parts.items() if ends is not None}
        joints = [arm.space.index(name) for name in ranges if not is_of_tip(arm, name)]
        OptionError.refuse_if(
            len({*joints}) < len(joints), f"within {listed([*ranges])}: a joint has two ranges"
        )
        words = [name for name, ends in parts.items() if ends is None]
        self.words: tuple[str, ...] = ()
        if "limits" in words and what == "within":
            words.remove("limits")
            real = np.isfinite(arm.lower) & (arm.upper - arm.lower < 2 * np.pi)
            self.lower = np.where(real, arm.lower, self.lower)
            self.upper = np.where(real, arm.upper, self.upper)
            self.words = ("the joint limits kept",)
        self.posture = tuple(words)
        if words:
            self._require_postures(what)
        self.words += self.posture + tuple(self._narrowed(n, *e) for n, e in ranges.items())
        tested = frame_jacobians(arm, random_turns(arm, 20))[:, :3][:, np.isfinite(self.tip[0])]
        self.moving: Bool = np.asarray((np.abs(tested) > ROUNDING).any(axis=(0, 1)))

    def _require_postures(self, what: str) -> None:
        """Raise unless the words are names of postures, and each ends at families only."""
        OptionError.refuse_if(
            not self.form.complete or self.arm.task.name != "pose",
            f"{what} {listed(self.posture)}: a posture needs a complete closed form of the task "
            "pose",
        )
        geometry = self.form.geometry
        names = () if geometry is None else posture_names(geometry, random_turns(self.arm, 200))
        known = sorted({name for each in names for name in each})
        hint = ", ".join(known) or "joint values: its postures have no names"
        if what == "within":
            hint = f"limits, {hint}, ranges such as q3=0.7..2.4 (radians) or z=0.1..0.5"
        for word in self.posture:
            OptionError.refuse_if(
                word not in known, f"{what} {word!r}: of {self.arm.name} it may be {hint}"
            )
        kinds = {word.split()[0] for word in self.posture}
        OptionError.refuse_if(
            len(kinds) < len(self.posture), f"{what}: no posture is {' and '.join(self.posture)}"
        )

    def _narrowed(self, name: str, a: float, b: float) -> str:
        """Set one range, and return it in words."""
        if not (math.isfinite(a) and math.isfinite(b) and a < b):
            raise OptionError(f"within: {name} needs two ascending values, got {a:g} and {b:g}")
        if is_of_tip(self.arm, name):
            self.tip[:, "xyz".index(name)] = a, b
            return f"{name} of the tip between {a:.4g} m and {b:.4g} m"
        j = self.arm.space.index(name)
        slides = bool(self.arm.prismatic[j])
        whole = not slides and b - a >= 2 * np.pi
        self.lower[j], self.upper[j] = (-np.pi, np.pi) if whole else (a, b)
        unit, factor = (" m", 1.0) if slides else ("°", 180 / np.pi)
        return f"{self.arm.joints[j]} between {factor * a:.4g}{unit} and {factor * b:.4g}{unit}"

    def holds(self, Q: Array) -> Bool:
        """Whether the posture and the tip of each of Q (N, n) are the ones asked for."""
        return self.has_posture(Q) & (self.outside(Q) <= 0).all(axis=1)

    def has_posture(self, Q: Array) -> Bool:
        """Whether the posture of each of Q (N, n) is the one asked for."""
        geometry, wanted = self.form.geometry, set(self.posture)
        if not wanted or geometry is None:
            return np.ones(len(Q), dtype=bool)
        return np.array([wanted <= set(n) for n in posture_names(geometry, Q)], dtype=bool)

    def outside(self, Q: Array) -> Array:
        """How far (N, 3) the tip is outside of its ranges, metres."""
        if not self.moving.any():
            return np.zeros((len(Q), 3))
        places = tip_poses(self.arm, Q)[0]
        return np.asarray(np.maximum(self.tip[0] - places, places - self.tip[1]))


def _cells(C: Array, R: Array, families: int) -> Records:
    """Boxes of centres C (N, n) and half widths R (N, n), of which nothing is known.

    ``ceiling`` (N,): how far from the families any of it may be. ``points`` (N, F, n): one near
    each family, weighted; infinite where none is known. ``slack`` (N, F): how far the family may
    be from there. ``asked`` (N, F): size of the box when points were last looked for elsewhere.
    """
    size, each = C.shape[1:], (families,)
    numbers = [("C", float, size), ("R", float, size), ("ceiling", float)]
    numbers += [("points", float, each + size), ("slack", float, each), ("asked", float, each)]
    out = np.full(len(C), np.inf, numbers).view(np.recarray)
    out.C, out.R, out.slack = C, R, 0.0
    return out


def _take(x: Records, family: int, points: Array, slack: Array, scale: Array) -> None:
    """Take points (N, n), ``slack`` (N,) off a family, that are nearer than the ones of boxes."""
    X = x.C * scale
    was = np.linalg.norm((x.points[:, family] - X)[:, scale > 0], axis=1)
    now = np.linalg.norm((points - X)[:, scale > 0], axis=1)
    nearer = now + slack < was + x.slack[:, family]
    x.points[nearer, family], x.slack[nearer, family] = points[nearer], slack[nearer]


class _Search:
    """Branch and bound for one arm.

    Boxes of width ``wide`` (radians, or metres over the length scale) at first, ``chunk`` in one
    call. ``best`` of ``samples`` configurations are followed by steps to ``finest``, at most
    ``certified`` of them proven to ``sure`` (radians). ``few`` boxes for what is proven of many,
    ``cheap`` of them as much work as one of joint speeds. ``cloud`` points of each surface are
    known at first.
    """

    chunk, wide, finest, sure = 8192, 0.8, 3e-3, 1e-8
    few, cheap, cloud = 60, 8, 20_000
    samples, best, certified = 4096, 20, 3

    def __init__(
        self,
        form: ClosedForm,
        bounds: SpeedBounds,
        region: Region,
        boxes: int,
        progress: Callable[[str, int, int], None] | None,
    ) -> None:
        self.bounds, self.judge, self.region = bounds, bounds.judge, region
        self.arm, self.speeds = bounds.judge.arm, (bounds.v, bounds.w)
        self.low, self.high = region.lower, region.upper
        self.most, self.progress = boxes, progress or (lambda *_: None)
        self.watched: Watched = watch(form)
        self.each, self.used = self.watched.each, self.watched.used
        self.active: Bool = self.bounds.moving | self.used.any(axis=0) | region.moving
        self.surfaces: Bool = np.array(
            [any(b.sums for b in c.branches) for c in self.each], dtype=bool
        )
        self.rng = np.random.default_rng(36)
        self.seen = 0
        # Points of surfaces, to begin steps near the nearest ones.
        self.clouds: dict[int, tuple[KDTree, Array, Array]] = {}
        self._learn(random_turns(self.arm, self.cloud))

    def _learn(self, Q: Array) -> None:
        """Keep the points of surfaces that steps from Q (N, n) lead to."""
        from scipy.spatial import KDTree

        self._follow(found := _cells(Q, 0 * Q, len(self.each)))
        for f in np.flatnonzero(self.surfaces).tolist():
            some = found[np.isfinite(found.points[:, f]).all(axis=1)]
            self._follow(some, f, 1.0)
            # One that is far off the surface would stand for others.
            some = some[some.slack[:, f] < self.finest]
            points, slack = some.points[:, f], some.slack[:, f]
            if f in self.clouds:
                _, *known = self.clouds[f]
                points, slack = map(np.concatenate, zip(known, (points, slack), strict=True))
            if len(points):
                turn = self.watched.conditions.turn[self.used[f]]
                places = points[:, self.used[f]]
                places = np.where(turn > 0, places % np.maximum(turn, 1.0), places)
                tree = KDTree(places, boxsize=turn, balanced_tree=False, compact_nodes=False)
                self.clouds[f] = tree, points, slack

    def zones(self) -> Zones:
        """Solve for the common distance, then for each."""
        names, count = self.watched.names, len(self.each)
        notes: list[str] = []
        loose: list[str] = []
        half = self.most // (2 if count > 1 else 1)
        every = np.full(count, np.inf)
        proven, reached, worst = self._least(None, every, "one distance from all families", half)
        OptionError.refuse_if(
            not count and proven > 0,
            f"{self.arm.name} has no family to keep away from, and {self.speeds[0]:g} m/s and "
            f"{self.speeds[1]:g} rad/s of the tip may exceed a joint speed limit: lower them, or "
            "give a smaller part (within)",
        )
        far = np.full(count, proven)
        found = np.zeros(count)
        for k, name in enumerate(names):
            # The first zone to be lowered is mostly the one that takes the most boxes.
            share = (self.most - self.seen) // (2 if k < count - 1 else 1)
            title = f"{name}, {k + 1} of {count} families"
            lowest, found[k], q = proven, reached, worst
            if count > 1:
                lowest, found[k], q = self._least(k, far, title, share)
            far[k] = min(far[k], lowest)
            least = min(found[k], np.delete(far, k).min(initial=np.inf))
            if least > reached:
                reached, worst = float(least), q
            if far[k] > (1 + GAP) * found[k] + self.sure:
                loose.append(name)
        sigma, condition = self._measures(far)
        if loose and math.isfinite(sigma):
            notes.append(
                f"after {self.seen} boxes proven distances from {listed(loose)} may be over "
                f"{GAP:.0%} more than needed: try more boxes, lower speeds or a smaller part "
                "(within)"
            )
        if self.judge.rank < self.arm.n:
            notes.append("a motion counts as possible if any joint speeds that make it are")
        if self.arm.prismatic.any():
            notes.append(metric_note(self.arm.length_scale))
        L = self.arm.length_scale
        needed = max(L / v if (v := self.speeds[0]) else 0.0, 1 / w if (w := self.speeds[1]) else 0)
        both = all(self.speeds) or not (self.bounds.linear.any() and not self.bounds.linear.all())
        length = float(np.linalg.norm(self.judge.limits))
        return Zones(
            arm=summarize(self.arm),
            placements=placements_of(self.arm),
            tip_speed=self.speeds[0],
            turn_speed=self.speeds[1],
            joint_speeds=self.judge.limits,
            within=self.region.words,
            lower=self.low,
            upper=self.high,
            tip_lower=self.region.tip[0],
            tip_upper=self.region.tip[1],
            posture=self.region.posture,
            distances=dict(zip(names, far.tolist(), strict=True)),
            exceeding=dict(zip(names, found.tolist(), strict=True)),
            common=proven,
            common_exceeding=reached,
            worst=worst,
            sigma_min=sigma,
            sigma_min_proven=1 / (length * needed) if both and needed else 0.0,
            condition_number=condition,
            titles=dict(zip(names, map(_called, self.watched.families), strict=True)),
            complete=self.watched.complete,
            boxes=self.seen,
            notes=tuple(notes),
        )

    def _random(self, count: int) -> Array:
        spread = self.rng.uniform(self.low, self.high, (count, self.arm.n))
        return np.where(self.active, spread, (self.low + self.high) / 2)

    def _objective(self, k: int | None, far: Array, distances: Array) -> Array:
        """What is made large (N,): the least distance, or that of family k outside the others."""
        if k is None:
            return np.asarray(distances.min(axis=1, initial=np.inf))
        others = np.arange(len(far)) != k
        outside = (distances[:, others] > far[others]).all(axis=1)
        return np.where(outside, distances[:, k], -np.inf)

    def _climb(
        self, k: int | None, far: Array, Q: Array, step: float, best: tuple[float, Array]
    ) -> tuple[float, Array]:
        """The largest objective proven where a limit is exceeded: ``best``, or near Q (N, n)."""
        aim = far + 2 * self.sure  # what is found must hold of proven distances, too
        while True:
            Q = Q[self.bounds.of(Q, np.zeros_like(Q)).center > 1]
            if self.judge.rank < self.arm.n:  # perhaps with other joint speeds it does not
                Q = Q[self.judge.shares(Q, *self.speeds).max(axis=1) > 1]
            value = self._guessed(k, aim, Q)
            first = np.argsort(-value, kind="stable")[: min(self.best, (value > -np.inf).sum())]
            good = Q[first]
            if not len(good) or step < self.finest:
                break
            moves = self.rng.normal(size=(10, *good.shape)) * self.active * step
            moved = np.clip(good + moves, self.low, self.high).reshape(-1, self.arm.n)
            Q, step = np.concatenate([good, moved]), step * 0.7
        for _ in range(self.certified if len(good) else 0):
            value = self._guessed(k, aim, good)
            q = good[value.argmax()]
            # A proof takes as long as thousands of boxes; guesses nearby learn from it.
            if value.max() <= best[0]:
                break
            lower, points = self._nearest(q[None], self.sure, NEAREST)
            proven = float(self._objective(k, far, lower)[0])
            best = (proven, q) if proven > best[0] else best
            self._learn(points[np.isfinite(points).all(axis=1)])
        return best

    def _guessed(self, k: int | None, far: Array, Q: Array) -> Array:
        """The objective of Q (N, n) by the nearest points that are found."""
        self.seen += 2 * len(Q)  # as long as that takes
        x = _cells(Q, 0 * Q, len(far))
        self._follow(x)
        self._begin_elsewhere(x)
        value = self._objective(k, far, self._upper(x)[0])
        return np.where(self.region.holds(Q), value, -np.inf)

    def _nearest(self, Q: Array, gap: float, boxes: int) -> tuple[Array, Array]:
        """Lower bounds (N, F) of distances of Q (N, n), mostly within ``gap``; points (F N, n)."""
        limits, search = (self.watched.lower, self.watched.upper), SearchOptions(gap, boxes)
        found = [nearest_points(c, Q, *limits, search) for c in self.each]
        self.seen += sum(int(near.boxes.sum()) for near in found) // self.cheap
        lower = np.reshape([near.lower for near in found], (len(found), len(Q))).T
        return lower, np.reshape([near.q for near in found], (-1, self.arm.n))

    def _least(self, k: int | None, far: Array, what: str, most: int) -> tuple[float, float, Array]:
        """Return the least distance of family k (of all), those of the others being ``far``.

        It is proven; then how far one is that exceeds a limit, and that configuration.
        """
        # Farther than ``far`` from family k and the others nothing exceeds a limit.
        cap = np.inf if k is None else float(far[k])
        reached, q = self._climb(k, far, self._random(self.samples), 0.3, (0.0, np.empty(0)))
        C, R = self._first_boxes()
        boxes = _cells(C, R, len(far))
        begin, most = self.seen, max(most, len(C))
        while True:
            boxes = boxes[boxes.ceiling > self._target(reached)]
            if not len(boxes.C) or self.seen - begin >= most:
                break
            # Those that may be farthest first; an eighth at once, since all are copied each time.
            left = len(boxes.C)
            count = min(max(self.chunk, left // 8), left, begin + most - self.seen)
            pick = np.argpartition(-boxes.ceiling, count - 1)
            made = [boxes[pick[count:]]]
            for part in np.array_split(pick[:count], math.ceil(count / self.chunk)):
                halves, guess, centers = self._halves(k, far, cap, boxes[part], reached)
                made.append(halves)
                ahead = centers[guess > (1 + GAP / 5) * reached]
                if len(ahead):
                    reached, q = self._climb(k, far, ahead, 0.05, (reached, q))
            self.seen += count
            self.progress(what, min(self.seen - begin, most), most)
            boxes = np.concatenate(made).view(np.recarray)
        proven = max((1 + GAP) * reached, float(boxes.ceiling.max(initial=0.0)))
        return proven + ROUNDING if proven else 0.0, reached, q

    def _target(self, reached: float) -> float:
        return max((1 + GAP) * reached, ROUNDING)

    def _halves(
        self, k: int | None, far: Array, cap: float, boxes: Records, reached: float
    ) -> tuple[Records, Array, Array]:
        """What is left of boxes, in halves; centres that exceed, farthest first, and how far."""
        target, weight = self._target(reached), self.watched.weight
        kept = np.where(np.arange(len(far)) == k, target, np.minimum(far, 1e9))
        kept = np.full(len(far), target) if k is None else kept
        x = boxes.copy()
        x.C, x.R = c, r = self._trimmed(boxes.C, boxes.R, kept)
        reach: Array = np.sqrt((r * weight) ** 2 @ self.used.T)
        each = two_sided(self.watched.conditions.zeros, c, each=True).each
        low, known = each[..., 0], each[..., 1]
        over = self._upper(x, known, reach)[1]
        x.ceiling[:] = np.minimum(np.minimum(x.ceiling, cap), self._objective(k, far, over))
        alive = (x.ceiling > target) & self._may_hold(c, r, np.all(low > reach, axis=1))
        if k is not None:
            alive &= low[:, k] - reach[:, k] <= cap
        x, low, known, reach = x[alive], low[alive], known[alive], reach[alive]
        found = self.bounds.of(x.C, x.R)
        open_ = found.most > 1
        x, low, known, reach, found = (y[open_] for y in (x, low, known, reach, found))
        # Where the lower bounds decide nothing else, closer upper ones do not either.
        up, over, steps = self._upper(x, known, reach)
        least = np.where(self.surfaces, low, up)
        closer = self._objective(k, far, least) < self._objective(k, far, up)
        closer |= self._objective(k, far, least + reach) < x.ceiling
        for look in (self._follow, self._begin_elsewhere):
            rows = np.flatnonzero(closer)
            near = x[rows]
            look(near)
            x[rows] = near
            up[rows], over[rows], steps[rows] = self._upper(near, known[rows], reach[rows])
            x.ceiling[:] = np.minimum(x.ceiling, self._objective(k, far, over))
            closer &= x.ceiling > target
        guess = np.where(found.center > 1, self._objective(k, far, up), -np.inf)
        farther = np.flatnonzero(guess > reached)
        guess[farther[~self.region.holds(x.C[farther])]] = -np.inf
        best = np.argsort(-guess, kind="stable")[: 10 * self.best]
        half = np.eye(self.arm.n)[self._longest(x.R, up, over, steps, kept, found)] * x.R / 2
        made = x[np.tile(np.arange(len(x)), 2)]
        made.R -= np.concatenate([half, half])
        made.C += np.concatenate([-half, half])
        return made[made.ceiling > target], guess[best], x.C[best]

    def _upper(
        self, x: Records, known: Array | float = np.inf, reach: Array | float = 0.0
    ) -> tuple[Array, Array, Array]:
        """Upper bounds (N, F) of distances of centres, and of all of boxes; the ways to points.

        They are at most ``known`` at the centres, and ``reach`` more all over the boxes.
        """
        weight = self.watched.weight
        steps = np.where(self.used, np.abs(x.points - (x.C * weight)[:, None]), 0.0)
        ends = steps + (x.R * weight)[:, None] * self.used
        way, end = (np.linalg.norm(y, axis=2) for y in (steps, ends))
        over = np.fmin((end + x.slack) * (1 + ROUNDING), known + reach)
        return np.fmin(way + x.slack, known), over, steps

    def _follow(self, x: Records, only: int | None = None, share: float = 0.0) -> None:
        """Step from centres, or from a share of the way to points of a family, to nearer ones."""
        conditions, families = self.watched.conditions.zeros, range(len(self.each))
        at = X = x.C * (weight := self.watched.weight)
        if only is not None:
            conditions, families = self.each[only], range(only, only + 1)
            at = np.where(self.used[only], X + share * (x.points[:, only] - X), X)
        found = two_sided(conditions, at / weight, each=True, points=True)
        for i, f in enumerate(families):
            points = found.points[:, i]
            way = np.linalg.norm((points - at)[:, self.used[f]], axis=1)
            slack = np.maximum(found.each[:, i, 1] - way, 0.0)
            _take(x, f, points, slack, weight * self.used[f])

    def _begin_elsewhere(self, x: Records) -> None:
        """Step near the nearest of the points that are known of each surface."""
        # Steps from the centre may lead to a point that is not the nearest. Halves know it, until
        # they are much smaller.
        X, turn = x.C * self.watched.weight, self.watched.conditions.turn
        for f, (tree, points, slack) in self.clouds.items():
            own, whole = self.used[f], np.maximum(turn, 1.0)
            size = np.prod((x.R * self.watched.weight)[:, own] + ROUNDING, axis=1)
            some = np.flatnonzero(size < x.asked[:, f] / 2 ** own.sum())
            x.asked[some, f], at = size[some], X[some]
            i = tree.query(np.where(turn > 0, at % whole, at)[:, own])[1]
            begin = points[i] + turn * np.round((at - points[i]) / whole)
            near, found = x[some], x[some]
            found.points[:, f], found.slack[:, f] = begin, slack[i]
            # Near a centre of curvature steps gain little from near the point, and miss from afar.
            for share in (0.7, 0.5, 0.3, 0.3, 0.3):
                self._follow(found, f, share)
            _take(near, f, found.points[:, f], found.slack[:, f], self.watched.weight * own)
            x[some] = near

    def _longest(
        self, r: Array, up: Array, over: Array, steps: Array, kept: Array, speeds: Records
    ) -> Ints:
        """Return the joint along which each box is halved."""
        # By what the first order says is sooner true of all of it: that speeds keep their limits,
        # or that it is nearer than ``kept`` (F,) to a family; rather along what is wider, since one
        # alone may never be true.
        w, rows = r * self.watched.weight, np.arange(len(r))
        j = np.where(self.active, speeds.pull + ROUNDING * w, -1.0).argmax(axis=1)
        if not len(kept):
            return np.asarray(j)
        families = _times(over - np.where(np.isfinite(up), up, 0.0), kept - up)
        steps = np.where(np.isfinite(steps), steps, 0.0)
        i = (w[:, None] * (steps + w[:, None]) * self.used).argmax(axis=2)
        families = families / np.maximum(w[rows[:, None], i], TINY)
        f = families.argmin(axis=1)
        by_speeds = _times(speeds.first - speeds.center, 1 - speeds.center)
        sooner = families[rows, f] < by_speeds / np.maximum(w[rows, j], TINY)
        return np.asarray(np.where(sooner, i[rows, f], j))

    def _may_hold(self, C: Array, R: Array, clear: Bool) -> Bool:
        """Return whether the region may have points of boxes; a posture needs clear ones."""
        # A joint moves the tip no faster than it is far from its axis, by what follows it.
        out = self.region.has_posture(C) | ~clear
        if self.region.moving.any():
            n = self.arm.n
            here = np.linalg.norm(frame_jacobians(self.arm, C)[:, :3], axis=1)
            speed = np.where(self.arm.prismatic, 1.0, here + sums_behind(R * self.bounds.far[:n]))
            slack = (R * speed).sum(axis=1, keepdims=True) + ROUNDING
            out &= (self.region.outside(C) <= slack).all(axis=1)
        return np.asarray(out)

    def _trimmed(self, C: Array, R: Array, kept: Array) -> tuple[Array, Array]:
        """Return boxes without what is nearer than ``kept`` (F,) to families of joint values."""
        low, high, weight = C - R, C + R, self.watched.weight
        turn = self.watched.conditions.turn
        for branch in self.watched.conditions.branches:
            js = branch.joints
            if branch.sums or not len(js):
                continue
            value = (
                C[:, js]
                - off_values(C[:, js] * weight[js], branch.values, turn[js])[0] / weight[js]
            )
            for i, j in enumerate(js):
                # How far others are at most from their values leaves this one a part of the zone.
                most = np.maximum(value - low[:, js], high[:, js] - value) * weight[js]
                most[:, i] = 0.0
                room = np.maximum(kept[branch.family] ** 2 - (most**2).sum(axis=1), 0.0)
                part = np.sqrt(room) / weight[j]
                a, b = value[:, i] - part, value[:, i] + part
                lower = (low[:, j] >= a) & (low[:, j] < b) & (high[:, j] > b)
                upper = (high[:, j] <= b) & (high[:, j] > a) & (low[:, j] < a)
                low[lower, j], high[upper, j] = b[lower], a[upper]
        return (low + high) / 2, (high - low) / 2 * (1 + 1e-12)

    def _first_boxes(self) -> tuple[Array, Array]:
        """Centres and half widths (N, n) of boxes that cover the ranges, up to symmetries."""
        C, R = ((self.low + self.high) / 2)[None], ((self.high - self.low) / 2)[None]
        R, alike = np.where(self.active, R, 0.0), self._symmetries()
        for j in np.flatnonzero(self.active):
            moves = np.unique(alike[:, :, j], axis=0)
            if len(moves) > 1:
                R[0, j] /= len(moves) // 2 * 2
                C[:, j] += R[0, j] - moves[0, 1] / 2
            # What moves this joint needs all of the ranges of others.
            alike = alike[(alike[:, :, j] == [1, 0]).all(axis=1)]
            parts = max(1, math.ceil(2 * R[0, j] * self.watched.weight[j] / self.wide))
            if len(C) * parts > self.chunk:
                continue
            half = R[0, j] / parts
            offsets = (2 * np.arange(parts) - parts + 1) * half
            C, R = np.repeat(C, parts, axis=0), np.repeat(R, parts, axis=0)
            C[:, j] += np.tile(offsets, len(C) // parts)
            R[:, j] = half * (1 + 1e-12) + 1e-15
        return C, R

    def _symmetries(self) -> Array:
        """Maps (s, 2, n) of configurations to others of the same speeds and distances.

        Signs of joints, about the middle of their ranges, and shifts. They hold of a few random
        configurations, so that they hold of all: both sides are analytic.
        """
        middle, slides = (self.low + self.high) / 2, self.arm.prismatic
        whole = ~slides & (self.high - self.low >= 2 * np.pi)
        moves = [(1, 0), (-1, 0), (1, np.pi), (-1, np.pi)]
        each = [
            moves[: (4 if w else 2) if a else 1] for a, w in zip(self.active, whole, strict=True)
        ]
        all_of_it = not self.region.posture and np.isinf(self.region.tip).all()
        if not all_of_it or math.prod(map(len, each)) > self.samples:
            each = [moves[:1]] * self.arm.n
        maps = np.swapaxes(np.array(list(itertools.product(*each)), dtype=float), 1, 2)

        def shares(Q: Array) -> Array:
            return self.judge.shares(Q, *self.speeds)

        # Squares leave signs open that the shares of speed limits tell.
        for q, what in itertools.product(random_turns(self.arm, 8), (self._unmoved, shares)):
            moved = middle + maps[:, 0] * (q - middle) + maps[:, 1]
            same = np.isclose(what(moved), what(q[None]), rtol=ROUNDING, atol=ROUNDING)
            maps = maps[same.all(axis=1)]
        return maps

    def _unmoved(self, Q: Array) -> Array:
        """What speeds and distances of Q (N, n) rest on, whatever the axes and signs of joints."""
        M = self.bounds.rows @ self.bounds.jacobians(Q)
        v, w = (
            np.swapaxes(x, 1, 2) @ x for x in (M[:, self.bounds.linear], M[:, ~self.bounds.linear])
        )
        each = two_sided(self.watched.conditions.zeros, Q, each=True).each
        return np.concatenate([x.reshape(len(Q), -1) for x in (v * v, w * w, v * w, each)], axis=1)

    def _measures(self, far: Array) -> tuple[float, float]:
        """Return the least sigma and largest condition number found outside the zones."""
        # They are extreme where zones meet: many random starts are followed, along some joints each
        # time, since a zone may end at a value of a joint.
        begin = self._random(4 * self.samples)
        some = self.most // 20
        begin = begin[self._outside(far, begin, self.seen + some)]
        if not len(begin):
            return math.inf, math.nan
        found, n = [], self.arm.n
        for power in (0, 1):
            last = self.seen + some
            value = self._measured(begin, power)
            best = np.argsort(-value, kind="stable")[: 6 * self.best]
            Q, value, step = begin[best], value[best], 0.3
            while step > self.finest:
                size = (8, *Q.shape)
                moves = self.rng.normal(size=size) * (self.rng.random(size) < 0.5) * self.active
                moved = np.clip(Q + moves * step, self.low, self.high).reshape(-1, n)
                new = self._measured(moved, power)
                better = np.flatnonzero(new > np.tile(value, 8))
                out = better[self._outside(far, moved[better], last)]
                new[np.delete(np.arange(len(new)), out)] = 0.0
                which = (new.reshape(8, -1).argmax(axis=0), np.arange(len(Q)))
                better = new.reshape(8, -1)[which] > value
                Q = np.where(better[:, None], moved.reshape(size)[which], Q)
                value, step = np.where(better, new.reshape(8, -1)[which], value), step * 0.85
            found.append(float(value.max()))
        return 1 / found[0], found[1]

    def _measured(self, Q: Array, power: int) -> Array:
        """1 / the least sigma of Q (N, n) for power 0, and the condition number for 1."""
        sigma = np.asarray(singular_values(self.arm, Q))[:, : self.judge.rank]
        return np.asarray(sigma[:, 0] ** power / np.maximum(sigma[:, -1], 1e-300))

    def _outside(self, far: Array, Q: Array, last: int) -> Bool:
        """Whether Q (N, n) are in the region and proven outside the zones, by ``last`` boxes."""
        each = two_sided(self.watched.conditions.zeros, Q, each=True, points=True).each
        low, up = each[..., 0], each[..., 1]
        out = np.asarray((low > far).all(axis=1))
        # What only may be outside is looked at closely, some of it.
        most = 16 * self.few
        many = min(self.chunk // 8, max(0, last - self.seen) * self.cheap // most)
        maybe = np.flatnonzero((up > far).all(axis=1) & ~out)[:many]
        out[maybe] = (self._nearest(Q[maybe], self.finest, most)[0] > far).all(axis=1)
        out[out] = self.region.holds(Q[out])
        return out


def _called(family: Family) -> str:
    """Name of a family, with its condition unless that is a long equation."""
    name = titled(family.name, family.title)
    plain = family.title or not any(branch.equations for branch in family.branches)
    return f"{name}: {family.where(every=True)}" if plain else name


def _times(more: Array, room: Array) -> Array:
    """Return more / room, infinite without room."""
    return np.asarray(np.where(room > 0, more / np.maximum(room, ROUNDING), np.inf))
