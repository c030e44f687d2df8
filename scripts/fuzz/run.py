"""Feed pinsing with broken input of every kind that it reads, and count how each case ends.

Robot files (URDF, xacro, DH tables, loops), expressions of xacro, meshes, tables of numbers,
folders of runs, results and certificates as JSON. Every case must end in a
result, or in one clear line with exit code 2; within 10 seconds (of processor time; 45 on the
clock, whatever else runs) and 2 GiB; never in a traceback, a crash or a hang.

An input that reaches a line of pinsing's readers which none reached before is kept, and others are
made from it by further changes. A case is named by its seeds, the one that made it first and one
for each change: ``--one 7.19.3`` runs it again.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from fuzz.report import GOOD, KINDS, Outcome, report, table
from fuzz.worker import Worker, run_case, serve, sources

Case = tuple[str, tuple[int, ...]]

# Of the cases, where no kind is asked for.
SHARES = {"urdf": 0.05, "xacro": 0.03, "dh": 0.05, "loops": 0.04, "run": 0.008, "mesh": 0.004}
SHARES |= {"expression": 0.35, "result": 0.21, "certificate": 0.19, "table": 0.07}
_LONGEST_CHAIN = 12


class Feedback:
    """Makes cases, half of them out of earlier ones that reached something new.

    Parameters
    ----------
    cases : iterable of (kind, seed)
        What is to be run.
    """

    def __init__(self, cases: Iterable[tuple[str, int]]) -> None:
        self._cases = iter(cases)
        self._kept: dict[str, list[tuple[int, ...]]] = {}
        self.reached: set[str] = set()

    def __iter__(self) -> Iterator[Case]:
        for kind, seed in self._cases:
            rng, kept = random.Random(f"feedback {kind} {seed}"), self._kept.get(kind, [])
            if kept and rng.random() < 0.5:
                # The latest have been tried least.
                found = rng.choice(kept[-20:] if rng.random() < 0.5 else kept)
                yield kind, (*found, seed)
            else:
                yield kind, (seed,)

    def learn(self, outcome: Outcome, keep: bool) -> None:
        """Look at how a case ended."""
        new = set(outcome.fresh) - self.reached
        self.reached |= new
        if new and keep and len(outcome.chain) < _LONGEST_CHAIN:
            self._kept.setdefault(outcome.kind, []).append(outcome.chain)


def fuzz(cases: Iterable[tuple[str, int]], workers: int) -> Iterator[Outcome]:
    """Run cases over some worker processes; yield how each ended, in no certain order."""
    feedback = Feedback(cases)
    todo = iter(feedback)
    lock = threading.Lock()
    results: list[Outcome] = []
    done = threading.Semaphore(0)
    total = 0

    def work() -> None:
        own = Worker()
        try:
            while True:
                with lock:
                    case = next(todo, None)
                if case is None:
                    return
                outcome, keep = own.run(*case)
                with lock:
                    feedback.learn(outcome, keep)
                    results.append(outcome)
                done.release()
        finally:
            own.stop()
            done.release()

    threads = [threading.Thread(target=work) for _ in range(workers)]
    for thread in threads:
        thread.start()
    ended = 0
    while ended < workers:
        done.acquire()
        with lock:
            outcome = results[total] if total < len(results) else None
        if outcome is None:
            ended += 1
        else:
            total += 1
            yield outcome
    for thread in threads:
        thread.join()


def _until(limit: float, cases: Iterable[tuple[str, int]]) -> Iterator[tuple[str, int]]:
    for case in cases:
        if time.monotonic() >= limit:
            return
        yield case


def _planned(kinds: dict[str, int | None], cases: int, seed: int) -> list[tuple[str, int]]:
    whole = sum(SHARES[kind] for kind, count in kinds.items() if count is None)
    found = [
        (kind, seed + i)
        for kind, count in kinds.items()
        for i in range(round(cases * SHARES[kind] / whole) if count is None else count)
    ]
    random.Random(seed).shuffle(found)  # so that a part of them is of every kind
    return found


def _kind(text: str) -> tuple[str, int | None]:
    kind, colon, count = text.partition(":")
    if kind not in KINDS or (colon and not count.isdigit()):
        raise argparse.ArgumentTypeError(f"one of {', '.join(KINDS)}, perhaps with :COUNT")
    return kind, int(count) if colon else None


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=3000, help="in all")
    parser.add_argument("--minutes", type=float, default=math.inf, help="no new case after them")
    parser.add_argument("--seed", type=int, default=0, help="the first one")
    parser.add_argument(
        "--kind", type=_kind, action="append", metavar="KIND[:COUNT]", help="default: all kinds"
    )
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--log", type=Path, help="append every outcome there, a line each")
    parser.add_argument("--report", type=Path, help="write the Markdown report there")
    parser.add_argument("--of", type=Path, action="append", help="report on these logs; run none")
    parser.add_argument("--one", metavar="SEEDS", help="run the case of these seeds, and show it")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    if options.worker:
        serve()
        return 0
    kinds: dict[str, int | None] = dict(options.kind or [(kind, None) for kind in KINDS])
    if options.one is not None:
        chain = tuple(map(int, options.one.split(".")))
        with tempfile.TemporaryDirectory() as folder:
            for kind in kinds:
                print(kind, *run_case(kind, chain, sources(), Path(folder)), sep="\n")
        return 0
    if options.of:
        outcomes = [o for log in options.of for o in _read_log(log)]
    else:
        cases = _planned(kinds, options.cases, options.seed)
        outcomes = _run(cases, 60 * options.minutes, options.workers, options.log)
    print(table(outcomes))
    if options.report:
        options.report.write_text(report(outcomes), encoding="utf-8")
    return int(any(o.outcome not in GOOD for o in outcomes))


def _run(
    cases: list[tuple[str, int]], seconds: float, workers: int, log: Path | None
) -> list[Outcome]:
    limit = time.monotonic() + seconds
    outcomes = []
    with open(log or os.devnull, "a", encoding="utf-8") as lines:
        for number, o in enumerate(fuzz(_until(limit, cases), workers), 1):
            outcomes.append(o)
            lines.write(json.dumps(list(vars(o).values())) + "\n")
            if o.outcome not in GOOD:
                lines.flush()
                print(f"{o.kind} {'.'.join(map(str, o.chain))}: {o.outcome}: {o.said}", flush=True)
            if number % 500 == 0:
                print(f"{number} of {len(cases)}", file=sys.stderr, flush=True)
    return outcomes


def _read_log(log: Path) -> list[Outcome]:
    found = []
    for line in log.read_text(encoding="utf-8").splitlines():
        kind, chain, outcome, said, seconds, fresh = json.loads(line)
        found.append(Outcome(kind, tuple(chain), outcome, said, seconds, tuple(fresh)))
    return found


if __name__ == "__main__":
    sys.exit(main())
