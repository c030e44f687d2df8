"""Monitor: how far a running arm is from its singular configurations, tick by tick.

`Follower` reads configurations line by line, and gives a verdict of each. `export_guard` writes the
families as one file without dependencies, in C or in Python, for control loops.
"""

from __future__ import annotations

import io
import itertools
import json
import math
import re
import select
import textwrap
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from pinsing._batch import engine
from pinsing._version import __version__
from pinsing.algebra import trig_sum
from pinsing.algebra.conditions import Conditions, contact_along, two_sided
from pinsing.algebra.trig_sum import COMBINED
from pinsing.atomic_write import MEBIBYTE
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm
from pinsing.interface import JsonResult, checked, columns_of, encode, real_numbers
from pinsing.kinematics.jacobian import fingerprint, frame_jacobians
from pinsing.kinematics.tip_speed import TURN_SPEED, SpeedJudge, TipSpeeds, limits_of, speed_judge
from pinsing.measures import ROUNDING, Array, ArrayLike
from pinsing.prose import one_line, visible
from pinsing.proximity.clearance import (
    NAMING,
    Forms,
    Watched,
    certified,
    each_of,
    forms_of,
    nearest_family,
    quick,
    titled,
    watch,
)
from pinsing.proximity.crossings import FARTHEST
from pinsing.proximity.trajectory_file import (
    AROUND,
    NO_TIMES,
    ColumnHeads,
    is_number,
    require_seconds,
    stated_unit,
)
from pinsing.proximity.zones import Zones, zone_distances
from pinsing.robot.arm import Arm, chain_speeds, require_values, summarize
from pinsing.robot.nominal import nominal

CLEAR, WARN, STOP = LEVELS = ("clear", "warn", "stop")

_NOTHING = np.zeros(0)
_FLOAT = np.dtype(float)


@dataclass(frozen=True)
class Verdict(JsonResult):
    """What a `Monitor` says of one configuration.

    Attributes
    ----------
    level : str
        "clear", "warn" or "stop", with hysteresis.
    family : str
        The nearest family found, which need not be that of ``lower``; empty where there is none.
    lower : float
        Proven, rounding included: no configuration of a family is nearer; of the design alone with
        ``Monitor.nominal``. Radians, or metres over the length scale; infinite without families.
    upper : float
        A configuration of a family is as near as this; infinite where none was found. Of a copy of
        a design the family is the design's: its own nearest one may be farther.
    time_to_contact : float or None
        Seconds: going on at ``dq``, no family is met sooner, which is proven; where one lies ahead
        it is the time of contact but for some 1e-6 of it. The work of a call is bounded: far ahead,
        or along a family that is nearly touched, the time may be too early, never too late.
        Of a copy of a design (see ``notes``) it is ``lower`` over the joint speed, never the time
        of contact: finite on the way "away", too.
        Infinite where none is met within the horizon. None without ``dq``.
    trend : str or None
        "toward" or "away" from ``family``, or "steady"; None without ``dq``.
    rate : float or None
        How fast the distance from ``family`` grows, to first order, per second; negative on the
        way toward it. None without ``dq``.
    title : str
        "wrist", "elbow", "shoulder", or empty: as of the family.
    zones : tuple of str or None
        Families whose zone the configuration is in, by lower bounds of the distances: outside of
        all of them joint speed limits are kept. None without zones, and beyond their joint ranges.
    tip_speeds : TipSpeeds or None
        What the joint speed limits allow in every direction here; None unless asked for.
    """

    schema: ClassVar[str] = "pinsing/verdict/1"

    level: str
    family: str
    lower: float
    upper: float
    time_to_contact: float | None
    trend: str | None
    rate: float | None
    title: str = ""
    zones: tuple[str, ...] | None = None
    tip_speeds: TipSpeeds | None = None

    def __str__(self) -> str:
        said = f"{self.level}: at least {self.lower:.4g} from a singularity"
        said += f", the nearest family {titled(self.family, self.title)}" * bool(self.family)
        if self.time_to_contact is not None and math.isfinite(self.time_to_contact):
            said += f", in {self.time_to_contact:.3g} s at the soonest"
        return said


class Monitor:
    """Watches a running arm: call `update` in the control loop, some microseconds each time.

    Where two families are about as near, a search through at most 100 boxes names the nearer one:
    tenths of a millisecond, and of a second without the compiled kernel.

    The level is "stop" as soon as the proven clearance ``lower`` is at or below ``stop``, and
    "warn" at or below ``warn``. It falls again only once ``lower`` is above the bound by the share
    ``hysteresis`` of it, so that it does not chatter where an arm stays at a bound. Families
    of which no real point is known count as well: a guard errs on the side of care.

    A monitor belongs to one arm and one thread.

    Parameters
    ----------
    forms : ClosedForm or sequence of ClosedForm
        Of one arm, such as those of two tasks.
    warn, stop : float
        Clearances, radians (metres over the length scale): 0 <= stop <= warn.
    hysteresis : float
        Share of a bound by which it must be left, 0.1 for ten percent.
    horizon : float
        Seconds that are looked ahead with ``dq``.
    families : sequence of str, optional
        Names of the families that count; by default all.
    weights : (n,) array_like, optional
        What joint differences are multiplied by, as in ``Family.distance``.
    zones : Zones, optional
        Those of the arm, from `pinsing.zones`: verdicts then tell in which a configuration is.
        Zones within a posture or a box of the tip are refused.
    tip_speed, turn_speed : float, optional
        m/s and rad/s: verdicts then have ``tip_speeds``, which judge both at once, and take a
        millisecond.
    joint_speeds : (n,) array_like, optional
        Speed limits, rad/s and m/s; those of the description if not given.

    Attributes
    ----------
    level : str
        The level after the last update; "clear" before the first.
    joints : tuple of str
        Names of the joints, in the order of q.
    names : tuple of str
        The families that are watched.
    complete : bool
        Whether the closed forms are complete. Otherwise the level is never "clear", since other
        configurations may be singular; and where no family is known at all, ``lower`` is what the
        Jacobian tells (``regular_radius``).
    notes : tuple of str
        Which geometry the families are of if that is not the file's, and what is not known.
    nominal : bool
        Whether levels and bounds are of the nominal design alone, from which the file differs.

    Raises
    ------
    OptionError, UnknownNameError
        If bounds make no sense, or there is no family of a name.

    Examples
    --------
    >>> import pinsing
    >>> monitor = pinsing.Monitor(pinsing.closed_form(pinsing.load("ur5")), warn=0.2, stop=0.1)
    >>> monitor.update([0, -1.2, 1.3, -1, 0.15, 0], [0, 0, 0, 0, -0.3, 0]).level
    'warn'
    """

    @checked
    def __init__(
        self,
        forms: Forms,
        warn: float = math.radians(10),
        stop: float = math.radians(5),
        *,
        hysteresis: float = 0.1,
        horizon: float = 10.0,
        families: Sequence[str] | None = None,
        weights: ArrayLike | None = None,
        zones: Zones | None = None,
        tip_speed: float | None = None,
        turn_speed: float = TURN_SPEED,
        joint_speeds: ArrayLike | None = None,
    ) -> None:
        OptionError.refuse_if(
            not 0 <= stop <= warn < math.inf,
            f"need 0 <= stop <= warn, got stop {stop!r} and warn {warn!r}",
        )
        OptionError.refuse_if(
            not 0 <= hysteresis < math.inf, f"hysteresis must not be negative, got {hysteresis!r}"
        )
        OptionError.refuse_if(not horizon > 0, f"horizon must be positive, got {horizon!r}")
        watched = watch(forms, families, weights, real=False)
        if weights is None:
            watched.require_angle(warn, "warn")
        self._watched = watched
        self.notes, self.nominal = watched.notes, watched.nominal
        self.joints, self.names, self.complete = watched.joints, watched.names, watched.complete
        self._zones: Array | None = None
        if zones is not None:
            OptionError.refuse_if(
                weights is not None, "zones have their own metric: watch without weights"
            )
            first = forms if isinstance(forms, ClosedForm) else forms[0]
            self._zones = zone_distances(zones, first.arm, watched.arm, self.names)
            self._range = (zones.lower + zones.upper) / 2, (zones.upper - zones.lower) / 2
        self._judge: SpeedJudge | None = None
        if tip_speed is not None:
            self._speeds = tip_speed, turn_speed
            self._judge = speed_judge(watched.arm, *self._speeds, joint_speeds)
        self.level = CLEAR
        self.warn, self.stop = float(warn), float(stop)
        self.hysteresis, self.horizon = float(hysteresis), float(horizon)
        self._shape: tuple[int, ...] = ()  # until the first q was looked at
        self._moving = False  # until the first dq was
        self._weight = None if bool((watched.weight == 1).all()) else watched.weight
        self._x, self._v, self._out = np.empty(watched.n), np.empty(watched.n), np.empty(4)
        titles = (f.title for f in watched.families)
        self._listed = (*zip(watched.names, titles, strict=True), ("", ""))
        self._handle  # noqa: B018 (made here, not in a control loop's first update)

    @cached_property
    def _handle(self) -> Any | None:
        """What judges in the kernel; a margin is taken off in Python."""
        return self._watched.conditions.compiled if self._watched.margin is None else None

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k != "_handle"}

    def __repr__(self) -> str:
        of = " of the design" * bool(self._watched.tube)
        words = (
            f"{len(self.names)} families{of}, warn {self.warn:g}, stop {self.stop:g}: {self.level}"
        )
        return one_line("Monitor", words)

    def reset(self) -> None:
        """Forget the level, as before the first update.

        Examples
        --------
        >>> import pinsing
        >>> monitor = pinsing.Monitor(pinsing.closed_form(pinsing.load("scara")))
        >>> monitor.update([0, 0, 0.1, 0]).level
        'stop'
        >>> monitor.reset()
        >>> monitor.level
        'clear'
        """
        self.level, self._shape, self._moving = CLEAR, (), False

    def update(self, q: ArrayLike, dq: ArrayLike | None = None) -> Verdict:
        """Judge a configuration; a wrong one raises, and leaves the level as it was.

        Parameters
        ----------
        q : (n,) or (nq,) array_like
            Radians and metres, or a configuration of the whole model; an array (n,) of floats is
            fastest.
        dq : (n,) or (nv,) array_like, optional
            Joint speeds, rad/s and m/s, or those of the whole model.

        Returns
        -------
        Verdict
            Level, family, bounds, and with ``dq`` time to contact and trend.

        Raises
        ------
        ConfigurationError
            If q or dq has the wrong length, holds something else than numbers, or a value that is
            not finite; the joint is named. Also if the first q or dq, or one that changes the
            level, makes sense in degrees only (see ``units`` of ``load``).

        Examples
        --------
        >>> import pinsing
        >>> monitor = pinsing.Monitor(pinsing.closed_form(pinsing.load("ur5")))
        >>> verdict = monitor.update([0, -1.2, 1.3, -1, 0.5, 0], [0, 0, 0, 0, -0.25, 0])
        >>> verdict.family, verdict.trend, round(verdict.time_to_contact, 4)
        ('F2', 'toward', 2.0)
        """
        first = not self._shape
        self._take(q, "q", self._x)
        velocity = _NOTHING
        if dq is not None:
            velocity = self._v
            self._take(dq, "dq", velocity)
        if (handle := self._handle) is not None:
            work = self.horizon, NAMING.gap, NAMING.boxes
            family = handle.watch(self._x, velocity, *work, self._out, engine.isa_names()[-1])
        else:
            family = self._watch(velocity)
        if family == -2:  # a value is not finite
            require_values(self._x, self.joints, "q")
            require_values(velocity, self.joints, "dq")
        lower, upper, time, rate = self._out.tolist()
        hold = 1.0 + self.hysteresis
        if self._watched.elsewhere and family < 0:
            lower = float(self._watched.regular((self._x / self._watched.weight)[None])[0])
        if (conditions := self._watched.conditions).sure is not None:
            upper = float(two_sided(conditions, (self._x / self._watched.weight)[None]).upper[0])
        level = CLEAR
        if lower <= self.stop or (self.level == STOP and lower <= self.stop * hold):
            level = STOP
        elif (
            lower <= self.warn
            or (self.level != CLEAR and lower <= self.warn * hold)
            or not self.complete
        ):
            level = WARN
        if first or level != self.level or self._moving < (dq is not None):
            watched, x = self._watched, self._x
            if watched.arm is None or watched.arm.units is None:
                watched.space.require_radians(x / watched.weight, "q", endless=False)
                if velocity.size and watched.arm is not None:
                    self._require_radians(watched.arm, np.abs(velocity / watched.weight))
            self.level = level
            self._moving |= dq is not None
        name, title = self._listed[family]
        beside = title, self._inside(), self._allowed()
        if dq is None:
            return Verdict(level, name, lower, upper, None, None, None, *beside)
        trend = "steady"
        if rate != 0.0 and abs(rate) > 1e-6 * max(map(abs, velocity.tolist())):
            trend = "away" if rate > 0.0 else "toward"
        return Verdict(level, name, lower, upper, time, trend, rate, *beside)

    def _allowed(self) -> TipSpeeds | None:
        """Tip speeds that the joint speed limits allow at the last configuration."""
        if self._judge is None:
            return None
        q = self._x / self._watched.weight
        return self._judge.at(frame_jacobians(self._judge.arm, q)[0], q, *self._speeds)

    def _inside(self) -> tuple[str, ...] | None:
        """Names of the zones that the last configuration is in."""
        if self._zones is None:
            return None
        Q = (self._x / self._watched.weight)[None]
        middle, half = self._range
        if (np.abs(self._watched.space.wrap(Q[0] - middle)) > half + ROUNDING).any():
            return None
        low = two_sided(self._watched.conditions.zeros, Q, each=True).each[0, :, 0]
        return tuple(np.array(self.names)[(low <= self._zones) & (self._zones > 0)].tolist())

    def _take(self, values: Any, name: str, into: Array) -> None:
        if type(values) is np.ndarray:
            plain = values.dtype == _FLOAT and values.shape == self._shape
        else:
            plain = isinstance(values, list | tuple) and (len(values),) == self._shape
            plain = plain and all(type(value) is float for value in values)
        if not plain:
            values = real_numbers(columns_of(values, self.joints, name), name)
            n = len(self.joints)
            if name == "q" and values.ndim == 1:
                values = self._watched.check(values, name)
                self._shape = (n,)
            elif name == "dq" and (arm := self._watched.arm) is not None:
                values = chain_speeds(arm, values, name)
            ConfigurationError.refuse_if(
                values.shape != (n,),
                f"{name} needs {n} values for {', '.join(self.joints)}; got shape {values.shape}",
                lengths=(n,),
            )
        into[:] = values
        if self._weight is not None:
            into *= self._weight

    def _watch(self, velocity: Array) -> int:
        """As the compiled engine does it."""
        if not (np.isfinite(self._x).all() and np.isfinite(velocity).all()):
            return -2
        conditions = self._watched.conditions
        families, found = nearest_family(conditions, (self._x / self._watched.weight)[None])
        family = int(families[0])
        self._out[:2] = found.lower[0], found.upper[0]
        if velocity.size:
            self._out[2:] = contact_along(conditions, family, self._x, velocity, self.horizon)
            if conditions.margin is not None:  # no singular configuration is nearer than this
                soonest = found.lower[0] / max(float(conditions.size(velocity)), 1e-300)
                self._out[2] = soonest if soonest < self.horizon else math.inf
        return family

    def _require_radians(self, arm: Arm, speeds: Array) -> None:
        """Raise if speeds (n,) are far above their limits, and below if read as degrees."""
        limits = limits_of(arm)
        odd = (speeds > limits + 2 * np.pi) & (np.radians(speeds) <= limits) & ~arm.prismatic
        for j in np.flatnonzero(odd)[:1]:
            self._moving = False  # the next is the first again
            raise ConfigurationError(
                f"dq: {arm.joints[j]} at {speeds[j]:g} rad/s is {speeds[j] / limits[j]:.1f} times "
                f"its limit of {limits[j]:.4g} rad/s. For degrees use numpy.radians; if radians "
                'are meant, load(..., units="rad")',
                joint=arm.joints[j],
                value=float(speeds[j]),
            )


BACKLOG = 100
"""Lines of a live stream that may wait, a tenth of a second at 1 kHz; older ones are dropped."""
STALLED = 1.0
"""Seconds without a line after which it is said."""
_ROWS = tuple("{[+-.0123456789 \t")
"""How lines of values begin. Others may be names of columns, which are not dropped."""
_PIECE = re.compile(r"[-+.\deE\s]*")
"""A number, or what is left of one that a stream began, or broke off, in the middle of."""
_MEANT = re.compile(
    r"(joint_?)?names|angles?|((angles?|in|use|is)_?)?(units?|deg(rees)?|rad(ians)?)", re.IGNORECASE
)
"""Keys of an object that would change what its values mean; they are refused, not passed over."""
_SAID = ("level", "family", "title", "lower", "upper", "time_to_contact", "trend")
"""What is told of the monitor's verdict; ``trend`` is null where speeds are not known."""
_MOVE = 1e-3
"""Radians, or metres over the length scale: moves to see which leads away."""


def lines_of(raw: io.FileIO) -> Iterator[str]:
    """Lines of a file without buffer: none whose lock a thread that waits for a line would hold."""
    rest = b""
    while (data := raw.read(1 << 16)) != b"":
        if data is None:  # set not to wait by someone who shares it
            select.select([raw], [], [])
            continue
        *whole, rest = (rest + data).split(b"\n")
        yield from (line.decode(errors="replace") for line in whole)
        rest = rest[: 4 * MEBIBYTE + 1]
    if rest:
        yield rest.decode(errors="replace")


def latest(
    lines: Iterable[str], stalled: float = STALLED, backlog: int = BACKLOG
) -> Iterator[tuple[str | None, int]]:
    """Yield lines of a live stream, at most ``backlog`` late, each with how many were dropped."""
    # None stands for silence: once, after ``stalled`` seconds.
    lines = iter(lines)
    waiting: deque[Any] = deque()  # lines, and at last the error that ended them
    news = threading.Condition()
    dropped, taken = 0, False

    def read() -> None:
        nonlocal dropped
        end: Exception = EOFError()
        try:
            for line in lines:
                with news:
                    waiting.append(line)
                    if len(waiting) > backlog + (not taken):
                        late = range(not taken, len(waiting))
                        rows = (k for k in late if waiting[k].startswith(_ROWS))
                        del waiting[next(rows, late[0])]
                        dropped += 1
                    news.notify()
        except OSError as error:
            end = error
        with news:
            waiting.append(end)
            news.notify()

    threading.Thread(target=read, daemon=True).start()
    line: str | Exception | None = ""
    while True:
        with news:
            news.wait_for(lambda: waiting, None if line is None else stalled)
            line = waiting.popleft() if waiting else None
            count = dropped if taken else 0
            dropped -= count
            taken |= line is not None
        if isinstance(line, EOFError):
            return
        if isinstance(line, Exception):
            raise line
        yield line, count


class HeadError(ConfigurationError):
    """A row after names of columns that were not understood: it could mean anything."""


class Reader:
    """Reads configurations of an arm as text, a line each.

    A line is a JSON object, a list, or a row of a table, best after a line of column names; without
    names there is one column a joint, base to tip. A comment ``# units: degrees`` holds for all
    that follows; ``degrees`` for columns that do not tell. After names that are not understood rows
    are not read; after such units, nothing is. An object holds ``name`` and ``position`` as in
    ROS's JointState, perhaps ``velocity``, ``t`` or a stamped ``header``; or each joint by name, as
    in a trajectory file, the same in all objects. Other keys are ignored. Missing or null
    velocities are differences of successive samples with times.

    ``told`` gets notes, each once: up to 100 ignored names, and how far locked or following joints
    are from where the arm has them, again where it is ten times as much. ``t`` is the time of the
    last line, if any; ``measured``: its speeds are not differences.
    """

    def __init__(
        self, arm: Arm, degrees: bool | None, told: Callable[[str], None] | None = None
    ) -> None:
        self._arm, self._stated, self._told = arm, degrees, told
        self._called: list[str] | None = None
        self._names: tuple[list[str], ColumnHeads] | None = None
        self._columns: tuple[ColumnHeads, str | None] | None = None
        self._head: HeadError | None = None
        self._refused: HeadError | None = None
        self._last: tuple[float, Array] | None = None
        self.t: float | None = None
        self.measured = False
        self._noted: set[str] = set()
        self._off: dict[str, float] = {}

    def read(self, line: str) -> tuple[float | None, Array, Array | None] | None:
        """Return time, q (n,) and speeds (n,); None for an empty line, names, or a comment."""
        # HeadError for a row after names that were not understood, ConfigurationError for other bad
        # lines.
        ConfigurationError.refuse_if(
            len(line) > MEBIBYTE, f"the stream: a line of more than {MEBIBYTE:,} characters"
        )
        text, self.t = line.removeprefix("\ufeff").strip(), None
        if text[:1] == "[" and text[-1] == "]":
            text = text[1:-1]
        if text[:1] == "#":
            self._comment(text)
        if self._refused:
            raise self._refused
        if not text or text[0] == "#":
            return None
        found = self._object(text) if text[0] == "{" else self._row(text)
        if found is None:
            return None
        q, dq = found
        self._require_sense(q)
        t, last = self.t, self._last
        self._last = None if t is None else (t, q)
        self.measured = dq is not None
        if dq is None and last is not None and t is not None and t > last[0]:
            dq = self._arm.space.wrap(q - last[1]) / (t - last[0])
            if (step := t - last[0]) % 1 == 0:
                said = f"times step by {step:g} s, as they are taken for seconds"
                self._note(f"{said}: name the column 't (ms)' if they are in milliseconds", "step")
        return t, q, dq

    def _comment(self, text: str) -> None:
        """Take the unit of angles that a comment states."""
        try:
            stated = stated_unit("the stream", text, self._stated)
        except ConfigurationError as error:
            self._refused = HeadError(str(error))
            return
        if stated != self._stated:
            self._stated, self._last = stated, None
            self._note(f"a comment says that angles are in {'degrees' if stated else 'radians'}")

    def _require_sense(self, q: Array) -> None:
        """Refuse a joint more than a turn outside its limits, of --rad one that is no angle."""
        arm = self._arm
        far = np.abs(q) > FARTHEST
        if arm.units is None:
            arm.space.require_radians(q, "q", endless=False)
            far |= ~arm.prismatic & (np.maximum(q - arm.upper, arm.lower - q) > 2 * np.pi)
        if far.any():
            j = int(far.argmax())
            raise ConfigurationError(
                f"q: {arm.joints[j]} = {q[j]:.6g} is far outside its limits "
                f"({arm.lower[j]:.4g} to {arm.upper[j]:.4g})"
            )

    def _object(self, text: str) -> tuple[Array, Array | None]:
        try:
            data = json.loads(text, object_pairs_hook=_once)
        except (ValueError, RecursionError) as error:
            if isinstance(error, ConfigurationError):
                raise
            raise ConfigurationError(
                f"cannot read {text:.80}: it is no JSON object, which must be on one line"
            ) from None
        for key, value in data.items():
            ConfigurationError.refuse_if(
                _MEANT.fullmatch(key) and isinstance(value, (str, list, dict, bool)),
                f"the stream: {key!r} is not read: leave it out, with the joints in 'name' and "
                "angles in radians, or in degrees with --deg",
            )
        names, values, rates = list(data), list(data.values()), None
        if "position" in data:
            names, values = data.get("name", list(self._arm.joints)), data["position"]
            rates, t = data.get("velocity"), data.get("t", data.get("time", data.get("timestamp")))
            self._time(t, None, data)
            lists = isinstance(names, list) and isinstance(values, list)
            ConfigurationError.refuse_if(
                not lists or len(names) != len(values),
                "name and position must be lists of one length",
            )
        heads, speeds = self._heads(list(map(str, names))), None
        if "position" not in data:
            self._time(*_time_in(heads, values), data)
        q = self._values("q", heads, values)
        if rates is not None and rates != []:
            ConfigurationError.refuse_if(
                not isinstance(rates, list) or len(rates) != len(names),
                f"velocity needs {len(names)} values, as position has",
            )
            if not any(r is None or r != r or r in (np.inf, -np.inf) for r in rates):
                speeds = self._values("velocity", heads, rates)
        self._called = self._called or heads.called
        for now, before in zip(heads.called, self._called, strict=True):
            ConfigurationError.refuse_if(
                now != before,
                f"the stream: {now!r:.80} is {before!r:.80} in a line before: give the states "
                "of one robot",
            )
        return q, speeds

    def _time(self, t: Any, nanoseconds: Any, data: Mapping[str, Any]) -> None:
        """Set the time: t and ``nanoseconds``, or that of ROS's header in data."""
        header = data.get("header")
        if t is None and isinstance(header, Mapping) and isinstance(t := header.get("stamp"), dict):
            nanoseconds = t.get("nanosec", t.get("nsecs", 0))
            t = number(t.get("sec", t.get("secs")), "the time")
        if t is not None:
            t = number(t, "the time")
            t += 0.0 if nanoseconds is None else 1e-9 * number(nanoseconds, "the time")
            require_seconds("the stream", t)
        self.t = t

    def _values(self, what: str, heads: ColumnHeads, values: Sequence[Any]) -> Array:
        """Of the joints, base to tip, from those of columns."""
        arm, angle = self._arm, math.pi / 180 if self._stated else 1.0
        pairs = zip(arm.joints, heads.order, strict=True)
        q = [number(values[i], f"{what} of joint {j!r}") for j, i in pairs]
        usual = zip(np.where(arm.prismatic, 1.0, angle), heads.scales, strict=True)
        found = np.array(q) * [u if scale is None else scale for u, scale in usual]
        # Joints without a value in q may be elsewhere than the description has them.
        for held in heads.held if what == "q" else ():
            i = heads.others[held.name]
            if not is_number(word := str(values[i])):
                continue
            scale = math.pi / 180 if self._stated and not held.slides else 1.0
            off = abs(float(held.off(found, float(word) * (heads.units[i] or scale))))
            # Backlash, and encoders that are read some milliseconds apart, explain less.
            least = 1e-3 if held.slides else math.pi / 180
            if off > self._off.get(held.name, least):
                self._off[held.name] = 10 * off
                far = f"{1e3 * off:.3g} mm" if held.slides else f"{math.degrees(off):.3g} degrees"
                self._note(f"joint {held.name!r} {held.why}, the stream has it {far} elsewhere")
        return np.asarray(found)

    def _note(self, note: str, once: str = "") -> None:
        if (once or note) not in self._noted:
            self._noted.add(once or note)
            if self._told:
                self._told(f"note: {note}")

    def _heads(self, names: list[str]) -> ColumnHeads:
        if self._names is None or self._names[0] != names:
            ConfigurationError.refuse_if(
                len(names) > 10 * BACKLOG, f"the stream: a line of {len(names):,} columns"
            )
            heads = ColumnHeads("the stream", self._arm, names)
            self._names = names, heads
            for note in heads.notes:
                if note != NO_TIMES and len(self._noted) < BACKLOG:
                    self._note(note)
        return self._names[1]

    def _row(self, text: str) -> tuple[Array, None] | None:
        known = self._columns
        separator = known[1] if known else next((s for s in (";", "\t", ",") if s in text), None)
        words = text.split(separator)
        if known:  # with one word of a mode, say, or names once more: a recorder began anew
            named = len(words) > 1 and not any(map(is_number, words))
        else:
            named = not all(is_number(w) or _PIECE.fullmatch(w) for w in words)
        if named:
            self._columns = self._head = None
            try:
                self._columns = self._heads(words), separator
            except ConfigurationError as error:
                fix = f"give a line of names, as t,{','.join(self._arm.joints)}"
                self._head = HeadError(f"{error}; {fix}, or objects of JSON")
                raise ConfigurationError(str(self._head)) from None
            return None
        if self._head is not None:
            raise self._head
        if known is None:
            ConfigurationError.refuse_if(
                len(words) != self._arm.n,
                f"the stream: {len(words)} numbers without names for {self._arm.n} joints: "
                f"begin with a line of names, such as t,{','.join(self._arm.joints)}",
            )
            numbers = [str(k + 1) for k in range(len(words))]
            known = ColumnHeads("the stream", self._arm, numbers, numbers, first=words), separator
        heads, width = known[0], len(known[0].words)
        ConfigurationError.refuse_if(
            len(words) != width, f"cannot read {text:.80}: {width} columns are needed"
        )
        if not heads.first or any(words[i].strip(AROUND) != w for i, w in heads.labels.items()):
            heads = ColumnHeads("the stream", self._arm, heads.words, first=words)
        self._columns = heads, separator
        self._time(*_time_in(heads, words), {})
        return self._values("q", heads, words), None


def _time_in(heads: ColumnHeads, values: Sequence[Any]) -> tuple[float | None, Any]:
    """Seconds as the columns of ``values`` have them, and nanoseconds beside them, if any."""
    if heads.time is None or values[heads.time] is None:
        return None, None
    nanoseconds = None if heads.parts is None else values[heads.parts]
    return number(values[heads.time], "the time") * heads.time_scale, nanoseconds


def _once(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ConfigurationError(f"the stream: {twice!r:.80} is there twice")
    return found


def number(value: Any, called: str) -> float:
    """Return a finite number; ConfigurationError says what it is ``called``."""
    said = value if isinstance(value, str) else json.dumps(value)
    try:
        found = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        found = math.nan
    ConfigurationError.refuse_if(
        not math.isfinite(found), f"{called} is {said:.40}; every value must be a finite number"
    )
    return found


class Follower:
    """Judges each line of a running robot; ``degrees`` and ``told`` are those of `Reader`.

    At a clearance of ``near`` radians the level is "warn", at half of it "stop". ``more`` are
    options of `Monitor`: speeds, for ``tip_speeds``, and ``zones``.
    """

    def __init__(
        self,
        form: ClosedForm,
        arm: Arm,
        degrees: bool | None,
        near: float,
        told: Callable[[str], None] | None = None,
        **more: Any,
    ) -> None:
        self.reader = Reader(arm, degrees, told)
        self._monitor = Monitor(form, near, near / 2, **more)
        self._zoned = more.get("zones") is not None
        self._arm = arm
        names = [f.name for f in form.families]
        self._families = {name: replace(watch(form, [name]), margin=None) for name in names}
        self._steps = np.diag(_MOVE * np.where(arm.prismatic, arm.length_scale, 1.0))
        q = np.zeros(arm.n)
        self._monitor.update(q)
        self._monitor.reset()
        for family in self._families.values():
            certified(family, q[None], NAMING)
            self._away(q, family, q[None], 0.0)  # what is compiled at first is none of a verdict's

    def verdict(self, line: str) -> dict[str, Any] | None:
        """Return plain data of one line; None for a line without values."""
        # ``family`` is that of the nearest singular configuration found, ``lower`` holds for all.
        # ``move`` is the joint, and the sense, that leads away fastest within the limits.
        if (found := self.reader.read(line)) is None:
            return None
        t, q, dq = found
        try:
            said = self._monitor.update(q, dq)
        except ConfigurationError:
            if self.reader.measured:
                raise
            said = self._monitor.update(q)  # times that jitter make speeds that make no sense
        out: dict[str, Any] = {"t": t} | {k: getattr(said, k) for k in _SAID} | {"move": None}
        if said.family:
            watched = self._families[said.family]
            near, point = certified(watched, q[None], NAMING)
            out["upper"] = min(said.upper, float(near.upper[0]))
            out["move"] = self._away(q, watched, point, float(near.upper[0]))
        if self._zoned:
            out["zones"] = encode(said.zones)
        if said.tip_speeds is not None:
            out["tip_speeds"] = encode(said.tip_speeds)
        return {k: None if v in (np.inf, -np.inf) else v for k, v in out.items()}

    def _away(self, q: Array, family: Watched, point: Array, near: float) -> dict[str, Any] | None:
        """Return the joint to move from q (n,), ``near`` to a point (1, n) of the family."""
        arm, step = self._arm, np.diag(self._steps)
        Q = np.vstack([q, q + self._steps, q - self._steps])
        far = family.length(family.space.wrap(Q - point))
        if not _MOVE < near < np.inf:  # all ways lead away from a point, not from its family
            far = quick(family, Q).lower
        allowed = np.concatenate([q + step <= arm.upper, q - step >= arm.lower])
        gain = np.where(allowed, far[1:] - far[0], 0.0)
        back, j = divmod(int(gain.argmax()), arm.n)
        return {"joint": arm.joints[j], "direction": 1 - 2 * back} if gain.max() > 0 else None


def follow(follower: Follower, lines: Iterable[str], live: bool) -> Iterator[dict[str, Any]]:
    """Yield verdicts of a stream; of a live one with drops and silences, or ``error`` and line."""
    # HeadError, after the answer, for a row after names that were not understood.
    stream = latest(lines) if live else ((line, 0) for line in lines)
    total = number = 0
    for line, dropped in stream:
        total += dropped
        if line is None:
            yield {"stalled": STALLED}
            continue
        number += 1 + dropped
        try:
            said = follower.verdict(line)
        except ConfigurationError as error:
            t = {} if follower.reader.t is None else {"t": follower.reader.t}
            yield {"line": number, **t, "error": str(error)}
            if isinstance(error, HeadError):
                raise
            continue
        if said is not None:
            yield said | ({"dropped": total} if total else {})


@dataclass(frozen=True)
class Guard:
    """A file, ASCII only, and what one should know of it."""

    text: str
    complete: bool  # all singular configurations count; else nothing is ever clear
    word: str  # "proven", "probable" (perhaps "of the design") or "not complete"
    notes: tuple[str, ...]  # what is missing, and what was assumed


def _filled(name: str, parts: Mapping[str, str], prefix: str = "") -> str:
    """A template with its places filled in; places in what is filled in stay as they are."""
    text = (Path(__file__).parent / "templates" / name).read_text(encoding="ascii")
    text = text.replace("@p@", prefix).replace("@P@", prefix.upper())
    pieces = re.split("@([a-z_]+)@", text)
    pieces[1::2] = [parts[key] for key in pieces[1::2]]
    return "".join(pieces)


def _plain(text: str) -> str:
    """A text in ASCII, on one line."""
    readable = text.replace("°", " deg").replace("±", "+-").replace("π", "pi")
    return visible(readable).encode("ascii", "backslashreplace").decode("ascii")


_WIDTH = 96


def _c_text(f: Mapping[str, Any], c: Conditions, zones: Mapping[str, Any], p: str) -> str:
    """The header in C99 of facts, their conditions and zones (see `_python_text`)."""
    made = [
        f"Guard of {f['robot']}; task {f['task']}.",
        f"Made by pinsing {__version__}; do not edit, export it again.",
        f"Robot hash {f['robot_hash']}, length scale {f['length_scale']:g} m.",
    ]
    notes = [
        *(f"Note: {note}" for note in f["notes"]),
        "Families:" if f["families"] else "Families: none.",
        *(f"  {pair[0]}: {pair[1]}" for pair in zip(f["families"], f["texts"], strict=True)),
    ]
    tables = {"lower_limit": f["lower"], "upper_limit": f["upper"], **c.flat, "margin": f["margin"]}
    tables["branch_family"] = tables.pop("family")
    names = {"joint_name": "joints", "family_name": "families", "family_text": "texts"}
    parts = {
        "head": _comment(made),
        "notes": " *\n" + _comment(notes),
        "joints": str(len(f["joints"])),
        "families": str(len(f["families"])),
        "equations": str(len(c.sums)),
        "complete": str(int(f["complete"])),
        "word": _string(f["word"]),
        "version": _string(__version__),
        "hash": _string(f["robot_hash"]),
        "tolerance": repr(f["tolerance"]),
        "change": repr(f["jacobian_change"]),
        "combined": str(COMBINED),
        "branches": str(len(c.branches)),
        "name_tables": "\n".join(_strings(f"{p}_{name}", f[key]) for name, key in names.items()),
        "tables": "\n".join(_table(f"{p}_{name}", table) for name, table in tables.items()),
        "zones": "",
    }
    if zones:
        of = {**zones, "title": _comment([zones["title"]])}
        of["tables"] = "\n".join(_table(f"{p}_{k}", v) for k, v in zones["tables"].items())
        parts["zones"] = _filled("zones.h.in", of, p)
    return _filled("guard.h.in", parts, p)


def _comment(lines: Iterable[str]) -> str:
    """Lines inside of a comment, which none of them ends."""
    out: list[str] = []
    for line in lines:
        text = _plain(line)
        for mark, instead in (("*/", "* /"), ("/*", "/ *"), ("??", "? ?")):
            while mark in text:
                text = text.replace(mark, instead)
        indent = " * " + " " * (len(line) - len(line.lstrip()))
        wrapped = textwrap.wrap(
            text.strip(), _WIDTH, initial_indent=indent, subsequent_indent=indent + "  "
        )
        # Breaking a line must not put together what was taken apart, nor end it in a backslash.
        out += [part + "." if part.endswith("\\") else part for part in wrapped]
    return "\n".join(out)


def _string(text: str) -> str:
    """A string literal: any byte beside plain letters as three octal digits."""
    out = ""
    for byte in text.encode("utf-8", "backslashreplace"):
        letter = chr(byte)
        safe = 32 <= byte < 127 and letter not in '"\\?'
        out += letter if safe else f"\\{byte:03o}"
    return f'"{out}"'


def _strings(name: str, values: Sequence[str]) -> str:
    body = ",\n    ".join([_string(v) for v in values] or ['""'])
    return f"static const char *const {name}[] = {{\n    {body}\n}};"


def _table(name: str, values: ArrayLike) -> str:
    """An array of C; an empty one holds a zero."""
    array, kind = np.asarray(values), "double"
    words = [repr(v).replace("inf", "HUGE_VAL") for v in array.tolist()]
    if array.dtype.kind != "f":
        kind, words = "int", [str(int(v)) for v in array]
    head, inside = f"static const {kind} {name}[] = {{", ", ".join(words or ["0"])
    if len(head) + len(inside) + 4 <= _WIDTH:
        return f"{head} {inside} }};"
    body = textwrap.fill(inside, _WIDTH, initial_indent="    ", subsequent_indent="    ")
    return f"{head}\n{body}\n}};"


def _python_text(f: Mapping[str, Any], c: Conditions, zones: Mapping[str, Any], p: str) -> str:
    """The module for NumPy: facts as constants, and zones, empty or with ``title``, ``tables``."""
    numbers = itertools.pairwise(c.flat["equation_start"].tolist())
    branches = [
        (b.family, b.joints.tolist(), b.values.tolist(), [*range(*ends)])
        for b, ends in zip(c.branches, numbers, strict=True)
    ]
    sums = [
        (s.amplitude.tolist(), s.phase.tolist(), s.rate.tolist(), s.power.tolist(), s.noise)
        for s in c.sums
    ]
    code = Path(trig_sum.__file__).read_text(encoding="ascii")
    parts = {
        "constants": "\n".join(f"{name.upper()} = {v!a}" for name, v in f.items()),
        "code": code.partition("import Array, ArrayLike\n")[2].strip(),
        "branches": _rows(branches),
        "sums": _rows(sums),
        "zones": "",
    }
    if zones:
        title = textwrap.wrap(zones["title"], _WIDTH, initial_indent="# ", subsequent_indent="# ")
        of, tables = {**zones, "title": "\n".join(title)}, zones["tables"].items()
        of["tables"] = "\n".join(f"{k.upper()} = {tuple(v.tolist())}" for k, v in tables)
        parts["zones"] = _filled("zones.py.in", of)
    return _filled("guard.py.in", parts)


def _rows(values: Sequence[object]) -> str:
    return "(\n" + "".join(f"    {v},\n" for v in values) + ")" if values else "()"


MOST_TERMS = 20_000
"""Of all equations together; a family that goes beyond it is left out, and that is said."""

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_LONGEST = 31


@checked
def export_guard(
    arm: Arm,
    language: Literal["c", "python"] = "c",
    *,
    forms: Forms | None = None,
    families: Sequence[str] | None = None,
    prefix: str | None = None,
    zones: Zones | None = None,
) -> str:
    """Write the families of an arm as one self-contained file: a guard for a control loop.

    It holds f, gradient and proven distance of each family, the joint names and limits, the
    tolerance, the version and a hash of the robot; C99 without any allocation, or Python with
    NumPy. Its clearance is never above the distance to the families, rounding included; where
    some are known to be missing it is 0. How sure it is that they are all singular
    configurations is a constant of the file: "proven", "probable" or "not complete"; "proven of
    the design" where the robot's numbers differ from its nominal design and no tube is proven.

    Parameters
    ----------
    arm : Arm
        A serial arm.
    language : str
        "c" or "python".
    forms : ClosedForm or sequence of ClosedForm, optional
        Of the arm, such as those of two tasks; if not given they are computed, with a
        certificate where one is found in two seconds.
    families : sequence of str, optional
        Names of the families that count; by default all. A guard of some is not complete.
    prefix : str, optional
        What names in C begin with: letters, digits and underscores. By default the robot's name.
    zones : Zones, optional
        Those of the arm, from `pinsing.zones`: the file then tells whether a configuration is
        proven to be outside, where tip speeds keep the joint speed limits.

    Returns
    -------
    str
        The file.

    Raises
    ------
    OptionError, UnknownNameError
        If the prefix is no name in C, forms or zones are of another arm, or there is no family of a
        name.

    Examples
    --------
    >>> import pinsing
    >>> text = pinsing.export_guard(pinsing.load("ur5"), "c")
    >>> "ur5_clearance(const double q[UR5_JOINTS]" in text
    True
    """
    return make_guard(
        arm, language, forms=forms, families=families, prefix=prefix, zones=zones
    ).text


def make_guard(
    arm: Arm,
    language: str,
    *,
    forms: Forms | None = None,
    families: Sequence[str] | None = None,
    prefix: str | None = None,
    zones: Zones | None = None,
) -> Guard:
    """As `export_guard`, with what one should know of the file."""
    if prefix is None:
        prefix = re.sub(r"[^A-Za-z0-9]+", "_", arm.name).strip("_").lower()
        prefix = prefix if re.match(r"[a-z]", prefix) else f"robot_{prefix}"
        prefix = prefix[:_LONGEST].strip("_")
    OptionError.refuse_if(
        not _IDENTIFIER.fullmatch(prefix) or len(prefix) > _LONGEST or prefix.endswith("_"),
        f"prefix must be a name of at most {_LONGEST} letters, digits and underscores that "
        f"begins with a letter and does not end with an underscore, got {prefix!r:.60}",
    )
    forms = forms_of(arm, forms)
    all_of_them = watch(forms, real=False)
    watched = all_of_them if families is None else watch(forms, families)
    every, taken = each_of(forms), watched.margin
    notes: list[str] = []
    if not watched.complete:
        gaps = "; ".join(dict.fromkeys(gap for form in every for gap in form.gaps))
        notes.append(f"the closed form is not complete: {gaps or 'see pinsing families'}")
    if left := [name for name in all_of_them.names if name not in watched.names]:
        notes.append(f"not asked for: {', '.join(left)}")
    kept, room = [], MOST_TERMS
    for name, family in zip(watched.names, watched.families, strict=True):
        size = sum(len(e.cos) for e in family.equations)
        if size > room:
            notes.append(
                f"{name} is left out: its equations have {size} terms, too many for a file"
            )
        else:
            kept.append((name, family))
            room -= size
    tubes = [watched.tube] * (taken is not None)
    unbounded = taken is not None and math.isinf(taken.meeting)
    notes += tubes * unbounded
    complete = not notes
    unproven = [form.proof for form in every if form.word != "proven"]
    word = "not complete"
    if complete:  # of several forms the less sure one's
        word = "probable" if unproven else "proven"
    if watched.nominal:
        notes.append(f"distances are not of {summarize(arm).described} itself. {watched.tube}")
    if word == "probable":
        reasons = ["no certificate was looked for" if p is None else p.reason for p in unproven]
        because = "; ".join(dict.fromkeys(reasons))
        notes.append(f"that no family is missing is probable, not proven: {because}")
    word += " of the design" * (complete and watched.nominal)
    change = max(form.jacobian_change for form in every)
    if change > 1e-12 and taken is None:
        notes.append(
            f"the description is rounded; made exact this changes no column of the Jacobian by "
            f"more than {change:.1e}"
        )
    notes += tubes * (not unbounded)
    margin = (0.0, 0.0, 0.0, 0.0)
    if taken is not None:
        whole = len(kept) == len(watched.names)
        alone = float(taken.alone.max()) if whole else taken.meeting
        margin = (alone, taken.meeting, taken.near, float(taken.limits is not None))
    zoned: dict[str, Any] = {}
    if zones is not None:
        where = f"Zones, of {', '.join(zones.within) or 'all configurations'}."
        tables = {
            "zone": zone_distances(zones, every[0].arm, arm, [name for name, _ in kept]),
            "zone_middle": (zones.lower + zones.upper) / 2,
            "zone_half": (zones.upper - zones.lower) / 2 + ROUNDING,
        }
        zoned = {"title": _plain(where), "tables": tables}
        zoned |= {key: repr(getattr(zones, key)) for key in ("tip_speed", "turn_speed")}
    geometries = [form.geometry or nominal(arm) for form in every]
    conditions = Conditions.of([f.branches for _, f in kept], watched.prismatic, watched.weight)
    snaps = [s.size for g in geometries for s in g.snaps if s.what != "length"]
    facts: dict[str, Any] = {
        "robot": f"{arm.name} ({summarize(arm).described}), {arm.base} to {arm.tip}",
        "task": ", ".join(dict.fromkeys(form.arm.task for form in every)),
        "length_scale": arm.length_scale,
        "version": __version__,
        "robot_hash": f"sha256:{fingerprint(arm)}",
        "radians": arm.units is not None,
        "joints": arm.joints,
        "lower": tuple(arm.lower.tolist()),
        "upper": tuple(arm.upper.tolist()),
        "families": tuple(name for name, _ in kept),
        "texts": tuple(f"{f.title}: {f.text}" if f.title else f.text for _, f in kept),
        "complete": complete,
        "word": word,
        "notes": tuple(notes),
        "tolerance": max(snaps, default=0.0),
        "jacobian_change": change,
        "weight": tuple(conditions.weight.tolist()),
        "turn": tuple(conditions.turn.tolist()),
        "margin": margin,
    }
    write = _c_text if language == "c" else _python_text
    return Guard(write(facts, conditions, zoned, prefix), complete, word, tuple(notes))
