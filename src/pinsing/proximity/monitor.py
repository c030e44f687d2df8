"""Monitor: how far a running arm is from its singular configurations, tick by tick."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from pinsing._batch import engine
from pinsing.algebra.conditions import contact_along
from pinsing.algebra.nearest import two_sided
from pinsing.arguments import checked, columns_of, real_numbers
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.kinematics.tip_speed import TURN_SPEED, SpeedJudge, TipSpeeds, limits_of, speed_judge
from pinsing.measures import ROUNDING, Array, ArrayLike
from pinsing.notebook import one_line
from pinsing.proximity.clearance import NAMING, nearest_family
from pinsing.proximity.watched import Forms, every_name, titled, watch
from pinsing.proximity.zones import Zones, zone_distances
from pinsing.robot.arm import Arm, WholeModel
from pinsing.serialization import JsonResult

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
        watched = watch(forms, every_name(forms) if families is None else families, weights)
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
        if family == -2:
            raise self._not_finite(velocity)
        lower, upper, time, rate = self._out.tolist()
        hold = 1.0 + self.hysteresis
        if self._watched.elsewhere and family < 0:
            lower = float(self._watched.regular((self._x / self._watched.weight)[None])[0])
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
        low = two_sided(self._watched.conditions.plain, Q, each=True).each[0, :, 0]
        return tuple(np.array(self.names)[(low <= self._zones) & (self._zones > 0)].tolist())

    def _take(self, values: ArrayLike, name: str, into: Array) -> None:
        if type(values) is np.ndarray and values.dtype == _FLOAT and values.shape == self._shape:
            into[:] = values
        elif not self._plain(values, into):
            array = real_numbers(columns_of(values, self.joints, name), name)
            n = len(self.joints)
            if name == "q" and array.ndim == 1:
                array = self._watched.check(array, name)
                self._shape = (n,)
            elif name == "dq" and (arm := self._watched.arm) is not None:
                whole = WholeModel(arm.source, arm.joints, arm.tip, arm.coupling)
                array = whole.chain_dq(array, name)
            if array.shape != (n,):
                raise ConfigurationError(
                    f"{name} needs {n} values for {', '.join(self.joints)}; got "
                    f"shape {array.shape}",
                    lengths=(n,),
                )
            into[:] = array
        if self._weight is not None:
            into *= self._weight

    def _plain(self, values: ArrayLike, into: Array) -> bool:
        """Take a list or tuple of floats without further ado."""
        if not isinstance(values, list | tuple) or (len(values),) != self._shape:
            return False
        if not all(type(value) is float for value in values):
            return False
        into[:] = values
        return True

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
                soonest = found.lower[0] / max(self._watched.length(velocity), 1e-300)
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

    def _not_finite(self, velocity: Array) -> ConfigurationError:
        name, array = ("q", self._x) if not np.isfinite(self._x).all() else ("dq", velocity)
        j = int(np.flatnonzero(~np.isfinite(array))[0])
        return ConfigurationError(
            f"{name} of joint {self.joints[j]!r} is {array[j]}; every value must be finite",
            joint=self.joints[j],
            value=float(array[j]),
        )
