"""Hold closed forms of random structured chains against finite fields, or against real points.

    python scripts/oracle --chains 1000 [--first 0] [--workers 2] [--seconds 10] [--json FILE]
    python scripts/oracle --real --chains 200 --seconds 4
    python scripts/oracle --seed 17          # one chain, in full

Every chain is drawn from its seed (``oracle.chains``), its families are found, and the rank of
its Jacobian at random points over small finite fields is held against them
(``oracle.field``). A line is printed for each chain of which anything is to be said: a false
claim (a family that is missing though the answer says complete, a regular point on a family, a
wrong generic rank), an answer that is not complete, or time that was overrun.

With ``--real`` chains are stranger, and singular configurations that Newton's method finds alone
(``oracle.points``) are to be on the families; what the families give as their own points is to be
singular, and on them.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from oracle.chains import Spec, arm_of, random_spec, strange_spec
from oracle.field import contradictions
from oracle.points import generic_rank, ratios, singular_points

from pinsing.errors import OptionError
from pinsing.families import ClosedForm, closed_form
from pinsing.robot.task import parse_task

POINTS = 20_000
OVERRUN = 1.2
_SHARE = 10
_FALSE = ("missed", "false", "rank", "sample", "error")
_SAMPLES = 20
_SINGULAR = 1e-6
"""Ratio of a family's own points, which are given to half of the digits at least."""
_NEAR = 3e-3
"""Where a point that Newton's method found may be, of a set that it comes to slowly."""


@dataclass(frozen=True)
class Outcome:
    """What one chain came to.

    Attributes
    ----------
    verdict : str
        "complete", "not complete", "no motion", or a false claim: "missed", "false", "rank",
        "unconfirmed" (said by the smallest prime only), "sample" (a point of a family that is
        regular, or not on it), "error".
    """

    seed: int
    spec: str
    joints: int
    verdict: str
    families: int
    seconds: float
    overrun: bool
    note: str = ""


def components(form: ClosedForm) -> tuple[list[object], list[object]]:
    """All that the answer accounts for: sets that are said to be singular, and others.

    The others are families whose equations are stated together with the rank (``Family.confirm``),
    and what was left out since it has no real point.
    """
    stated = [f for f in form.families if not f.also_regular]
    by_rank = [c for f in form.families if f not in stated for c in f.components]
    return [c for f in stated for c in f.components], by_rank + list(form.left_out)


def judged(
    spec: Spec, seed: int, seconds: float, points: int = POINTS, real: bool = False
) -> Outcome:
    """Find the families of a chain and hold them against finite fields, or real points."""
    arm = arm_of(spec)
    started = time.monotonic()

    def outcome(verdict: str, form: ClosedForm | None, note: str = "") -> Outcome:
        taken = form.seconds if form is not None else time.monotonic() - started
        over = taken > OVERRUN * seconds
        count = len(form.families) if form is not None else 0
        return Outcome(seed, str(spec), len(spec.rows), verdict, count, taken, over, note)

    try:
        form = closed_form(arm, seconds=seconds, prove=False)
    except OptionError as error:
        return outcome("no motion" if "moves tip" in str(error) else "error", None, str(error))
    except Exception as error:  # a traceback is an outcome too
        return outcome("error", None, f"{type(error).__name__}: {error}")
    verdict, note = (by_points if real else by_fields)(form, spec, seed, points)
    return outcome(verdict, form, note)


def by_fields(form: ClosedForm, spec: Spec, seed: int, points: int) -> tuple[str, str]:
    """Verdict and note, by ranks over small finite fields."""
    # Without a claim that nothing is missing there are families only: fewer points, which are
    # enough for those, since their equations may have thousands of terms.
    kinds = ("missed", "false", "rank") if form.complete else ("false", "rank")
    share = points if form.complete else points // _SHARE
    rows, (stated, by_rank) = parse_task(spec.task).rows, components(form)
    said = contradictions(
        form.geometry, rows, form.generic_rank, stated, share, seed, kinds, by_rank
    )
    for kind in ("rank", "false", "missed"):
        if kind in said:
            counts = [
                f"mod {v.prime}: {len(v.missed)} missed, {len(v.false)} false, rank {v.rank}"
                for v in said[kind]
            ]
            return kind, "; ".join(counts)
    if not form.complete:
        return "not complete", "; ".join(form.gaps)
    if "unconfirmed" in said:
        v = said["unconfirmed"][0]
        return "unconfirmed", f"mod {v.prime}: {len(v.missed)} missed, {len(v.false)} false"
    return "complete", ""


def by_points(form: ClosedForm, spec: Spec, seed: int, points: int) -> tuple[str, str]:
    """Verdict and note, by singular configurations that Newton's method finds."""
    rank = generic_rank(spec)
    if rank != form.generic_rank:
        return "rank", f"{form.generic_rank} is said, and it is {rank}"
    rng = np.random.default_rng(seed)
    for family in form.families:
        q = family.sample(_SAMPLES, rng)
        if len(q) and (worst := float(ratios(spec, q, rank).max())) > _SINGULAR:
            return "sample", f"{family}: sigma ratio {worst:.1e} at its own point"
        if not (on := family.contains(q)).all():
            return "sample", f"{family}: does not contain its own {q[~on][0].tolist()}"
    q = singular_points(spec, seed)
    off = ~np.any([np.zeros(len(q), dtype=bool), *(f.contains(q, _NEAR) for f in form.families)], 0)
    # Newton's steps of `contains` may not end at multiple roots; incomplete answers claim nothing.
    for i in np.flatnonzero(off) if form.complete else ():
        off[i] = not any(f.distance(q[i]).upper <= _NEAR for f in form.families)
    note = f"{off.sum()} of {len(q)} singular points on no family"
    if off.any():
        note += f", such as {np.round(q[off][0], 9).tolist()}"
    if form.complete:
        return ("missed" if off.any() else "complete"), note
    return "not complete", f"{note}; {'; '.join(form.gaps)}"


def _one(task: tuple[int, float, int, bool]) -> Outcome:
    seed, seconds, points, real = task
    return judged((strange_spec if real else random_spec)(seed), seed, seconds, points, real)


def survey(
    seeds: Sequence[int], seconds: float, workers: int, points: int = POINTS, real: bool = False
) -> Iterator[Outcome]:
    """Outcomes of many chains, in the order in which they come."""
    tasks = [(s, seconds, points, real) for s in seeds]
    if workers < 2:
        yield from map(_one, tasks)
        return
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        yield from pool.imap_unordered(_one, tasks)


def table(outcomes: Sequence[Outcome]) -> str:
    """Markdown table: chains by number of joints."""
    kinds = [
        "complete",
        "not complete",
        "missed",
        "false",
        "rank",
        "sample",
        "unconfirmed",
        "error",
    ]
    heads = ["joints", "chains", *kinds, "over time", "median s", "largest s"]
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    moving = [o for o in outcomes if o.verdict != "no motion"]
    for n in [*sorted({o.joints for o in moving}), None]:
        mine = [o for o in moving if n in (None, o.joints)]
        count = Counter(o.verdict for o in mine)
        times = [o.seconds for o in mine]
        row = ["all" if n is None else str(n), str(len(mine)), *(str(count[k]) for k in kinds)]
        row += [str(sum(o.overrun for o in mine))]
        row += [f"{np.median(times):.3f}", f"{max(times):.1f}"] if times else ["", ""]
        lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines)


def read(file: Path) -> list[Outcome]:
    """Outcomes of an earlier run; the last of each chain, without a line that was cut off."""
    found = {}
    for line in file.read_text().splitlines() if file.exists() else []:
        try:
            outcome = Outcome(**json.loads(line))
        except ValueError:
            continue
        found[outcome.seed] = outcome
    return list(found.values())


def main() -> int:
    """See the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--chains", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--real", action="store_true", help="hold them against real points")
    parser.add_argument("--points", type=int, default=POINTS)
    parser.add_argument(
        "--json", type=Path, help="append outcomes here, one a line; what is there is not run again"
    )
    args = parser.parse_args()
    if args.seed is not None:
        spec = (strange_spec if args.real else random_spec)(args.seed)
        print(spec)
        print(closed_form(arm_of(spec), seconds=args.seconds))
        print(judged(spec, args.seed, args.seconds, args.points, args.real))
        return 0
    wanted = range(args.first, args.first + args.chains)
    before = read(args.json) if args.json else []
    outcomes = [o for o in before if o.seed in wanted]
    done = {o.seed for o in outcomes}
    out = args.json.open("a") if args.json else None
    left = [seed for seed in wanted if seed not in done]
    for o in survey(left, args.seconds, args.workers, args.points, args.real):
        outcomes.append(o)
        if out:
            out.write(json.dumps(asdict(o)) + "\n")
            out.flush()
        if o.verdict not in ("complete", "no motion") or o.overrun:
            print(f"{o.seed}: {o.verdict}, {o.seconds:.1f} s, {o.note} | {o.spec}", flush=True)
    print(table(outcomes))
    return int(any(o.verdict in _FALSE for o in outcomes))


if __name__ == "__main__":
    sys.exit(main())
