"""A budget for algebra, counted in work: the same input gives the same answer on any machine.

Work is counted in products of terms, which every step says before it begins, and the time on the
clock is a cap beyond that: it strikes on slow or busy machines only, and for what was not foreseen.
`Stages` of an analysis, which sample too, have the clock alone.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

PER_SECOND = 1e7
"""Products of terms that one second of a budget stands for. A machine that has nothing else to do
takes about 0.6 s for them: a busy one does the same work before the clock strikes."""
_QUESTION = 6_000.0
"""Work that a question stands for besides: what lies between two of them takes some 0.4 ms."""
_CLOCK = 1.25
"""Seconds on the clock for a second of work."""
_LONG = 0.5
"""Seconds after which, or for a step of which, a computation counts as long."""


class BudgetExceeded(Exception):
    """What was allowed is over, or the next step would outlast it."""


@dataclass
class WorkMeter:
    """What all parts of a budget have together."""

    done: float = 0.0  # work
    # called before a step when the computation has become long, or is about to
    when_long: Callable[[], None] | None = None


class Budget:
    """Work left, in ``seconds`` on the clock or other seconds' worth of ``work``.

    Asked before every long step, such as factoring polynomials of ``long_to_factor`` terms.
    """

    # Terms from which on factoring may take long.
    def __init__(
        self, seconds: float, work: float | None = None, long_to_factor: int = 150
    ) -> None:
        self.seconds, self._long_to_factor = seconds if work is None else work, long_to_factor
        self._began = time.monotonic()
        self._deadline = self._began + (_CLOCK * seconds if work is None else seconds)
        # All parts together, those included that have a least share of the whole.
        self._end = self._began + (1.4 * seconds if work is None else seconds)
        self.meter = WorkMeter()
        self._most = PER_SECOND * self.seconds

    @property
    def left(self) -> float:
        """Seconds' worth of work left, 0 if there is none."""
        return max(0.0, self._most - self.meter.done) / PER_SECOND

    @property
    def on_clock(self) -> float:
        """Seconds left on the clock."""
        return max(0.0, self._deadline - time.monotonic())

    @property
    def over(self) -> bool:
        """True if work or time has run out."""
        return self.meter.done > self._most or time.monotonic() > self._deadline

    @property
    def allowed(self) -> str:
        """The work that was allowed, in words, or the time if that has struck."""
        if time.monotonic() > self._deadline:
            return f"{max(self._deadline - self._began, 0.0):.3g} s on the clock"
        return f"{self.seconds:.3g} s of work"

    def part(self, share: float, least: float = 0.0) -> Budget:
        """A share of what is left, or one of the whole if that is more; its work counts here."""
        found = Budget(
            max(share * self.left, least * self.seconds), long_to_factor=self._long_to_factor
        )
        found.meter, found._most = self.meter, self.meter.done + PER_SECOND * found.seconds
        clock = max(share * self.on_clock, _CLOCK * least * self.seconds)
        found._end = self._end
        found._deadline = min(found._began + clock, self._end)
        return found

    def at_most(self, seconds: float) -> Budget:
        """Return what is left, if no more than some seconds' worth."""
        found = self.part(1.0)
        found._most = min(found._most, self.meter.done + PER_SECOND * seconds)
        return found

    def spend(self, work: float) -> None:
        """Count work that was done."""
        self.meter.done += work

    def stop(self, work: float = 0.0) -> bool:
        """Count a step of so much work, and say whether the budget is over."""
        self.spend(_QUESTION + work)
        return self.over

    def check(self, term_products: float = 0.0) -> None:
        """Count a step of about so many term products; BudgetExceeded unless it fits in."""
        now = time.monotonic()
        if now > self._deadline:
            raise BudgetExceeded(
                "the time was over before this step"
                if self._deadline <= self._began
                else f"the time budget of {self._deadline - self._began:.3g} s ran out"
            )
        self.spend(_QUESTION + term_products)
        if self.meter.done > self._most:
            self.meter.done -= term_products  # it is not begun
            raise BudgetExceeded(f"the work budget of {self.seconds:.3g} s ran out")
        expected = term_products / PER_SECOND
        if self.meter.when_long is not None and max(now - self._began, expected) > _LONG:
            self.meter.when_long()

    def check_factor(self, terms: int, long: int | None = None) -> None:
        """Raise BudgetExceeded if a polynomial is too long to factor or to take a gcd of."""
        # Work that factoring, or a gcd, takes per term and its logarithm.
        self.check(5.0 * terms * max(terms, 1).bit_length())
        if self.meter.when_long is not None and terms > (long or self._long_to_factor):
            self.meter.when_long()
        if terms > 30_000:
            raise BudgetExceeded(f"a polynomial of {terms} terms was too long to factor")


T = TypeVar("T")

_MEMORY = 1_500_000_000
"""Bytes of data that a child may have: a step that needs more is given up."""


FORKS = hasattr(os, "fork") and sys.platform == "linux"
"""Whether processes can be forked without harm here."""


@dataclass(frozen=True, eq=False)
class Outcome(Generic[T]):
    """What became of a computation."""

    result: T | None  # what it returned; None if it was stopped
    # what it told on the way, while it was in a child
    told: list[Any] = field(default_factory=list)
    reason: str = ""  # why it was stopped


class _HandedOver(BaseException):
    """Raised in the parent out of a computation that its child goes on with."""


class Apart:
    """One computation that may go on in a child once it is long; killed after ``seconds``.

    ``hear`` is given what the child tells, as it does; else that is kept for the outcome.
    """

    def __init__(
        self, budget: Budget, seconds: float, hear: Callable[[Any], None] | None = None
    ) -> None:
        self._budget, self._hear = budget, hear
        self._until = time.monotonic() + seconds
        self._seconds = seconds
        self._to_parent: Connection | None = None  # in the child alone
        self._from_child: Connection | None = None
        self._pid = 0

    def tell(self, what: Any) -> None:
        """Tell the parent something that can be pickled, or ``hear`` where there is no child."""
        if self._to_parent is not None:
            self._to_parent.send(("told", what, self._budget.meter.done))
        elif self._hear is not None:
            self._hear(what)

    def run(self, work: Callable[[], T], at_once: bool = False) -> Outcome[T]:
        """The result of ``work``, to be pickled if from a child; forked first if ``at_once``."""
        if FORKS:
            self._budget.meter.when_long = self._fork
        try:
            if at_once and FORKS:
                self._fork()
            result = work()
        except _HandedOver:
            return self._wait()
        except BaseException as problem:
            if self._to_parent is not None:
                self._leave("problem", problem)
            raise
        finally:
            if self._to_parent is None:
                self._budget.meter.when_long = None
        if self._to_parent is not None:
            self._leave("result", result)
        return Outcome(result)

    def _fork(self) -> None:
        from multiprocessing import Pipe  # most algebra is short, and does without

        self._budget.meter.when_long = None
        reading, writing = Pipe(duplex=False)
        with warnings.catch_warnings():  # other threads do not matter to what the child does
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
        if pid == 0:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
            _confine()
            reading.close()
            self._to_parent = writing
            return
        writing.close()
        self._from_child, self._pid = reading, pid
        raise _HandedOver

    def _leave(self, kind: str, what: Any) -> None:
        """End the child, without anything that belongs to the parent."""
        code = 0
        try:
            assert self._to_parent is not None
            self._to_parent.send((kind, what, self._budget.meter.done))
        except BaseException:
            code = 1
        finally:
            os._exit(code)

    def _wait(self) -> Outcome[T]:
        assert self._from_child is not None
        told: list[Any] = []
        try:
            # Seconds that a child has after its time to say what it has.
            while self._from_child.poll(min(max(self._until + 0.1 - time.monotonic(), 0.0), 1e6)):
                kind, what, done = self._from_child.recv()
                self._budget.meter.done = done
                if kind == "result":
                    return Outcome(what, told)
                if kind == "problem":
                    raise what
                if self._hear is None:
                    told.append(what)
                else:
                    self._hear(what)
            budget = f"the time budget of {self._seconds:.3g} s"
            return Outcome(None, told, f"{budget} ran out in one step of the algebra")
        except (EOFError, MemoryError):
            return Outcome(None, told, "the process of the algebra was ended, perhaps for memory")
        finally:
            self._end()

    def _end(self) -> None:
        assert self._from_child is not None
        self._from_child.close()
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._pid, signal.SIGKILL)
        with contextlib.suppress(ChildProcessError):  # where somebody waits for all children
            os.waitpid(self._pid, 0)


def _confine() -> None:
    """Let this process die with its parent, and not take the machine's memory, where it can."""
    import ctypes  # most algebra is short, and does without

    with contextlib.suppress(AttributeError):
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # Linux's PR_SET_PDEATHSIG
    with contextlib.suppress(ImportError, OSError):
        import resource

        with open("/proc/self/statm", encoding="ascii") as file:
            used = int(file.read().split()[5]) * resource.getpagesize()
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        most = used + _MEMORY
        resource.setrlimit(resource.RLIMIT_DATA, (most if hard < 0 else min(most, hard), hard))
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # flint says on its own that memory is over


def in_child(work: Callable[[], T], budget: Budget, seconds: float) -> T:
    """Return what ``work`` returns (something that can be pickled), in a child stopped in time."""
    outcome = Apart(budget, seconds).run(work, at_once=True)
    if outcome.result is None:
        raise BudgetExceeded(outcome.reason)
    return outcome.result


class Stages:
    """Runs stages for ``seconds`` (None: no limit), or until Ctrl-C; lists what is missing."""

    def __init__(self, seconds: float | None) -> None:
        self.seconds = math.inf if seconds is None else seconds
        self.until = time.monotonic() + self.seconds
        self.missing: list[str] = []
        self.interrupted = False

    @property
    def over(self) -> bool:
        """True if nothing more should be begun."""
        return self.interrupted or time.monotonic() > self.until

    @property
    def why(self) -> str:
        """Reason for the end."""
        return "stopped" if self.interrupted else f"the time of {self.seconds:g} s was up"

    def run(self, name: str, stage: Callable[[], T], otherwise: T, whole: bool = False) -> T:
        """Return the result of a stage, or ``otherwise`` and a line on what is missing."""
        # A ``whole`` stage looks at no clock: its result has all of it, however late.
        if self.over:
            self.missing.append(f"{name}: not begun, {self.why}")
            return otherwise
        try:
            result = stage()
        except KeyboardInterrupt:
            self.interrupted = True
            self.missing.append(f"{name}: stopped before its end")
            return otherwise
        if self.over and not whole:
            self.missing.append(f"{name}: perhaps not all of it, {self.why}")
        return result

    def watched(self, progress: Callable[[int, int], None] | None) -> Callable[[int, int], None]:
        """A callback for a sweep that ends it, as Ctrl-C would, when the time is up."""

        def tell(done: int, count: int) -> None:
            if progress is not None:
                progress(done, count)
            if time.monotonic() > self.until and done < count:
                raise KeyboardInterrupt

        return tell
