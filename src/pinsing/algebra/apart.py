"""Long algebra in a child process, so that it can be stopped at any moment.

A gcd, a factorization or a Groebner basis is one call into flint that neither looks at the clock
nor hears Ctrl-C. So a computation that turns out to be long is forked: the child goes on from
where it is, the parent waits, and kills the child when the time is up or at Ctrl-C. What the
child told on the way is not lost. Where processes cannot be forked (Windows, macOS, the browser)
all goes on in one process, and such a call ends when it ends.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pinsing._dataclass import dataclass
from pinsing.algebra.budget import Budget, BudgetExceeded

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

T = TypeVar("T")

_LOOK = 0.2
"""Seconds between looks at whether the child is still there."""
_GRACE = 0.1
"""Seconds that a child has after its time to say what it has."""
_MEMORY = 1_500_000_000
"""Bytes of data that a child may have: a step that needs more is given up."""
_DIE_WITH_PARENT = 1
"""Linux's PR_SET_PDEATHSIG."""


def possible() -> bool:
    """Whether processes can be forked without harm here."""
    return hasattr(os, "fork") and sys.platform == "linux"


@dataclass(frozen=True, eq=False)
class Outcome(Generic[T]):
    """What became of a computation.

    Attributes
    ----------
    result : T or None
        What it returned; None if it was stopped.
    told : list
        What it told on the way, while it was in a child.
    reason : str
        Why it was stopped.
    """

    result: T | None
    told: list[Any] = field(default_factory=list)
    reason: str = ""


class _HandedOver(BaseException):
    """Raised in the parent out of a computation that its child goes on with."""


class Apart:
    """One computation, that may go on in a child once it is long.

    Parameters
    ----------
    budget : Budget
        The computation's own; it says when things become long.
    seconds : float
        After this time the child is killed.
    hear : callable, optional
        Given what the child tells, as it does; else that is kept for the outcome.
    """

    def __init__(
        self, budget: Budget, seconds: float, hear: Callable[[Any], None] | None = None
    ) -> None:
        self._budget, self._hear = budget, hear
        self._until = time.monotonic() + seconds
        self._seconds = seconds
        self._to_parent: Connection | None = None
        self._from_child: Connection | None = None
        self._pid = 0

    @property
    def child(self) -> bool:
        """Whether this is the child."""
        return self._to_parent is not None

    def tell(self, what: Any) -> None:
        """Tell the parent something that can be pickled; nothing where there is none."""
        if self._to_parent is not None:
            self._to_parent.send(("told", what, self._budget.done))

    def run(self, work: Callable[[], T], at_once: bool = False) -> Outcome[T]:
        """Work's result, which can be pickled if ``child``.

        Parameters
        ----------
        work : callable
            The computation.
        at_once : bool
            Fork before it begins.
        """
        if possible():
            self._budget.when_long = self._fork
        try:
            if at_once and possible():
                self._fork()
            result = work()
        except _HandedOver:
            return self._wait()
        except BaseException as problem:
            if self.child:
                self._leave("problem", problem)
            raise
        finally:
            if not self.child:
                self._budget.when_long = None
        if self.child:
            self._leave("result", result)
        return Outcome(result)

    def _fork(self) -> None:
        from multiprocessing import Pipe  # most algebra is short, and does without

        self._budget.when_long = None
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
            self._to_parent.send((kind, what, self._budget.done))
        except BaseException:
            code = 1
        finally:
            os._exit(code)

    def _wait(self) -> Outcome[T]:
        assert self._from_child is not None
        told: list[Any] = []
        try:
            while True:
                left = self._until + _GRACE - time.monotonic()
                if left <= 0:
                    budget = f"the time budget of {self._seconds:.3g} s"
                    return Outcome(None, told, f"{budget} ran out in one step of the algebra")
                if not self._from_child.poll(min(left, _LOOK)):
                    continue
                kind, what, done = self._from_child.recv()
                self._budget.spend(done - self._budget.done)
                if kind == "result":
                    return Outcome(what, told)
                if kind == "problem":
                    raise what
                if self._hear is None:
                    told.append(what)
                else:
                    self._hear(what)
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
    """Let this process die with its parent, and not take the machine's memory."""
    import ctypes  # most algebra is short, and does without
    import resource

    ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    with open("/proc/self/statm", encoding="ascii") as file:
        used = int(file.read().split()[5]) * resource.getpagesize()
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = used + _MEMORY
    resource.setrlimit(resource.RLIMIT_DATA, (most if hard < 0 else min(most, hard), hard))
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # flint says on its own that memory is over


def in_child(work: Callable[[], T], budget: Budget, seconds: float) -> T:
    """What ``work`` returns (something that can be pickled), in a child that can be stopped.

    Parameters
    ----------
    work : callable
        One long computation.
    budget : Budget
        Its time.
    seconds : float
        After which it is stopped.

    Raises
    ------
    BudgetExceeded
        If it was.
    """
    outcome = Apart(budget, seconds).run(work, at_once=True)
    if outcome.result is None:
        raise BudgetExceeded(outcome.reason)
    return outcome.result
