"""A running robot: configurations line by line, and a verdict for each."""

from __future__ import annotations

import io
import json
import math
import threading
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pinsing._types import Array
from pinsing.errors import ConfigurationError
from pinsing.families.form import ClosedForm
from pinsing.proximity.clearance import quick
from pinsing.proximity.monitor import Monitor
from pinsing.proximity.trajectory_file import ColumnHeads, is_number
from pinsing.proximity.watched import Watched, watch
from pinsing.robot.arm import Arm

BACKLOG = 100
"""Lines of a live stream that may wait, a tenth of a second at 1 kHz; older ones are dropped."""
STALLED = 1.0
"""Seconds without a line after which it is said."""
_LONGEST = 1 << 20
"""Bytes of a line; what is longer is cut, and answered as lines that cannot be read."""
_MOVE = 1e-3
"""Radians, or metres over the length scale: moves to see which leads away."""


def lines_of(raw: io.FileIO) -> Iterator[str]:
    """Lines of a file without buffer: none whose lock a thread that waits for a line would hold."""
    rest = b""
    while data := raw.read(1 << 16):
        *whole, rest = (rest + data).split(b"\n")
        if len(rest) > _LONGEST:
            whole, rest = [*whole, rest], b""
        yield from (line.decode(errors="replace") for line in whole)
    if rest:
        yield rest.decode(errors="replace")


def latest(
    lines: Iterable[str], stalled: float = STALLED, backlog: int = BACKLOG
) -> Iterator[tuple[str | None, int]]:
    """Lines of a live stream, at most ``backlog`` of them late, each with how many were dropped.

    Without one for ``stalled`` seconds, None comes in its place, once for each silence.
    """
    lines = iter(lines)
    for head in lines:  # the names of columns are never dropped
        yield head, 0
        break
    waiting: deque[str] = deque()
    news = threading.Condition()
    dropped, ended = 0, False

    def read() -> None:
        nonlocal dropped, ended
        for line in lines:
            with news:
                if len(waiting) == backlog:
                    waiting.popleft()
                    dropped += 1
                waiting.append(line)
                news.notify()
        with news:
            ended = True
            news.notify()

    threading.Thread(target=read, daemon=True).start()
    silent = True  # before the first line nothing has stalled
    while True:
        with news:
            came = news.wait_for(lambda: waiting or ended, None if silent else stalled)
            line = waiting.popleft() if waiting else None
            count, dropped = dropped, 0
        if line is None and came:
            return
        silent = line is None
        yield line, count


class Reader:
    """Reads configurations of an arm as text.

    A line is a JSON object or a row of a table, best after a line of column names; without names
    there is one column a joint, base to tip. An object holds
    ``name`` and ``position`` as in ROS's JointState, or each joint by its name; and perhaps ``t``,
    ``velocity``. Without velocities they are differences of successive samples with times.

    Parameters
    ----------
    arm : Arm
        The arm.
    degrees : bool
        Whether angles are in degrees where the names of columns do not tell.
    """

    def __init__(self, arm: Arm, degrees: bool) -> None:
        self._arm = arm
        self._scale = np.where(arm.prismatic, 1.0, np.pi / 180 if degrees else 1.0)
        self._columns: tuple[list[int], int | None, float, str | None] | None = None
        self._names: tuple[Any, list[int]] = (None, [])
        self._last: tuple[float, Array] | None = None

    def read(self, line: str) -> tuple[float | None, Array, Array | None] | None:
        """Return time, q (n,) and speeds (n,); None for a line of column names or an empty one.

        Raises
        ------
        ConfigurationError
            If the line cannot be read, or holds no configuration of the arm.
        """
        text = line.strip()
        if not text:
            return None
        try:
            found = self._object(json.loads(text)) if text[0] == "{" else self._row(text)
        except (ValueError, TypeError, LookupError, OverflowError, RecursionError) as error:
            if isinstance(error, ConfigurationError):
                raise
            reason = f"{type(error).__name__}: {error}"
            raise ConfigurationError(f"cannot read {text:.80}: {reason:.120}") from None
        if found is None:
            return None
        t, q, dq = found
        if t is not None and not math.isfinite(t):
            raise ConfigurationError(f"the time is {t}; every value must be finite")
        last, self._last = self._last, None if t is None else (t, q)
        if dq is None and last is not None and t is not None and t > last[0]:
            dq = self._arm.space.wrap(q - last[1]) / (t - last[0])
        return t, q, dq

    def _object(self, data: Mapping[str, Any]) -> tuple[float | None, Array, Array | None]:
        arm, speeds, t = self._arm, None, data.get("t", data.get("time"))
        whole = "position" in data
        values = data["position"] if whole else list(data.values())
        order = self._order(list(data.get("name", arm.joints) if whole else data))
        q = np.array([values[i] for i in order], dtype=float) * self._scale
        if len(data.get("velocity") or ()) == len(values):
            speeds = np.array([data["velocity"][i] for i in order], dtype=float) * self._scale
        return None if t is None else float(t), q, speeds

    def _order(self, names: list[str]) -> list[int]:
        """Where the joints are among names: by their own, or as columns of a file are read."""
        arm = self._arm
        if self._names[0] != names:
            exact = set(arm.joints) <= set(names)
            order = [] if exact else ColumnHeads("the stream", arm, names).order
            self._names = names, order or [names.index(joint) for joint in arm.joints]
        return self._names[1]

    def _row(self, text: str) -> tuple[float | None, Array, None] | None:
        if self._columns is None:
            separator = next((s for s in (";", "\t", ",") if s in text), None)
            words = text.split(separator)
            if all(map(is_number, words)):
                if len(words) != self._arm.n:
                    raise ConfigurationError(
                        f"the stream: {len(words)} numbers without names for {self._arm.n} joints: "
                        f"begin with a line of names, such as t,{','.join(self._arm.joints)}"
                    )
                self._columns = list(range(len(words))), None, 1.0, separator
                return self._row(text)
            heads = ColumnHeads("the stream", self._arm, words)
            self._columns = heads.order, heads.time, heads.time_scale, separator
            named = [s is not None for s in heads.scales]
            self._scale = np.where(named, np.array(heads.scales, dtype=float), self._scale)
            return None
        order, time_at, scale, separator = self._columns
        words = text.split(separator)
        if len(words) <= max(order):
            raise ConfigurationError(f"cannot read {text:.80}: {len(words)} columns are too few")
        q = np.array([float(words[i]) for i in order]) * self._scale
        return None if time_at is None else float(words[time_at]) * scale, q, None


class Follower:
    """Judges each line of a running robot.

    Parameters
    ----------
    form : ClosedForm
        Of the arm.
    arm : Arm
        The arm.
    degrees : bool
        As of `Reader`.
    near : float
        Clearance, radians, at or below which the level is "warn"; half of it is "stop".
    """

    def __init__(self, form: ClosedForm, arm: Arm, degrees: bool, near: float) -> None:
        self._reader, self._monitor = Reader(arm, degrees), Monitor(form, near, near / 2)
        self._arm = arm
        each = {f.name: watch(form, [f.name]) for f in form.families}
        self._families = {name: replace(w, margin=None) for name, w in each.items()}
        self._steps = np.diag(_MOVE * np.where(arm.prismatic, arm.length_scale, 1.0))
        for family in self._families.values():
            self._away(np.zeros(arm.n), family)  # what is compiled at first is none of a verdict's

    def verdict(self, line: str) -> dict[str, Any] | None:
        """Return plain data of one line; None for a line of column names or an empty one.

        ``move`` is the joint, and the sense, that leads away from the family fastest within the
        limits.

        Raises
        ------
        ConfigurationError
            As of `Reader.read`.
        """
        found = self._reader.read(line)
        if found is None:
            return None
        t, q, dq = found
        said = self._monitor.update(q, dq)
        out: dict[str, Any] = {"t": t, "level": said.level, "family": said.family}
        out |= {"title": said.title, "lower": said.lower, "upper": said.upper}
        out["time_to_contact"] = said.time_to_contact
        out["move"] = self._away(q, self._families[said.family]) if said.family else None
        return {k: None if v in (np.inf, -np.inf) else v for k, v in out.items()}

    def _away(self, q: Array, family: Watched) -> dict[str, Any] | None:
        arm, step = self._arm, np.diag(self._steps)
        far = quick(family, np.vstack([q, q + self._steps, q - self._steps])).lower
        allowed = np.concatenate([q + step <= arm.upper, q - step >= arm.lower])
        gain = np.where(allowed, far[1:] - far[0], 0.0)
        back, j = divmod(int(gain.argmax()), arm.n)
        return {"joint": arm.joints[j], "direction": 1 - 2 * back} if gain.max() > 0 else None


def follow(follower: Follower, lines: Iterable[str], live: bool) -> Iterator[dict[str, Any]]:
    """Verdicts of a stream; of a live one with drops and silences.

    A line that cannot be read is answered by ``error``, and the next one is read.
    """
    stream = latest(lines) if live else ((line, 0) for line in lines)
    total = 0
    for line, dropped in stream:
        total += dropped
        if line is None:
            yield {"stalled": STALLED}
            continue
        try:
            said = follower.verdict(line)
        except ConfigurationError as error:
            said = {"error": str(error)}
        if said is not None:
            yield said | ({"dropped": total} if total else {})
