"""Hold closed forms of random structured chains against finite fields.

    python scripts/oracle.py --chains 1000 [--first 0] [--workers 2] [--seconds 10] [--table FILE]
    python scripts/oracle.py --seed 17          # one chain, in full

Every chain is drawn from its seed (``oracle_chains``), its families are found, and the rank of
its Jacobian at random points over small finite fields is held against them
(``oracle_field``). A line is printed for each chain of which anything is to be said: a false
claim (a family that is missing though the answer says complete, a regular point on a family, a
wrong generic rank), an answer that is not complete, or time that was overrun.
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
from oracle_chains import Spec, arm_of, random_spec
from oracle_field import contradictions

from pinsing.errors import OptionError
from pinsing.families import ClosedForm, closed_form

POINTS = 20_000
OVERRUN = 1.2
_SHARE = 10


@dataclass(frozen=True)
class Outcome:
    """What one chain came to.

    Attributes
    ----------
    verdict : str
        "complete", "not complete", "no motion", or a false claim: "missed", "false", "rank",
        "unconfirmed" (said by the smallest prime only), "error".
    """

    seed: int
    spec: str
    joints: int
    verdict: str
    families: int
    seconds: float
    overrun: bool
    note: str = ""


def components(form: ClosedForm) -> list[object]:
    """All that the answer accounts for: families, and what was proven to have no real point."""
    return [c for f in form.families for c in f.components] + list(form.left_out)


def judged(spec: Spec, seed: int, seconds: float, points: int = POINTS) -> Outcome:
    """Find the families of a chain and hold them against finite fields."""
    arm = arm_of(spec)
    started = time.monotonic()

    def outcome(verdict: str, form: ClosedForm | None, note: str = "") -> Outcome:
        taken = form.seconds if form is not None else time.monotonic() - started
        over = taken > OVERRUN * seconds
        count = len(form.families) if form is not None else 0
        return Outcome(seed, str(spec), len(spec.rows), verdict, count, taken, over, note)

    try:
        form = closed_form(arm, seconds=seconds)
    except OptionError as error:
        return outcome("no motion" if "moves tip" in str(error) else "error", None, str(error))
    except Exception as error:  # a traceback is an outcome too
        return outcome("error", None, f"{type(error).__name__}: {error}")
    # Without a claim that nothing is missing there are families only: fewer points, which are
    # enough for those, since their equations may have thousands of terms.
    kinds = ("missed", "false", "rank") if form.complete else ("false", "rank")
    share = points if form.complete else points // _SHARE
    said = contradictions(
        form.geometry, arm.task.rows, form.generic_rank, components(form), share, seed, kinds
    )
    for kind in ("rank", "false", "missed"):
        if kind in said:
            counts = [
                f"mod {v.prime}: {len(v.missed)} missed, {len(v.false)} false, rank {v.rank}"
                for v in said[kind]
            ]
            return outcome(kind, form, "; ".join(counts))
    if not form.complete:
        return outcome("not complete", form, "; ".join(form.gaps))
    if "unconfirmed" in said:
        v = said["unconfirmed"][0]
        return outcome(
            "unconfirmed", form, f"mod {v.prime}: {len(v.missed)} missed, {len(v.false)} false"
        )
    return outcome("complete", form)


def _one(task: tuple[int, float, int]) -> Outcome:
    seed, seconds, points = task
    return judged(random_spec(seed), seed, seconds, points)


def survey(
    seeds: Sequence[int], seconds: float, workers: int, points: int = POINTS
) -> Iterator[Outcome]:
    """Outcomes of many chains, in the order in which they come."""
    tasks = [(s, seconds, points) for s in seeds]
    if workers < 2:
        yield from map(_one, tasks)
        return
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        yield from pool.imap_unordered(_one, tasks)


def table(outcomes: Sequence[Outcome]) -> str:
    """Markdown table: chains by number of joints."""
    kinds = ["complete", "not complete", "missed", "false", "rank", "unconfirmed", "error"]
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
    parser.add_argument("--points", type=int, default=POINTS)
    parser.add_argument(
        "--json", type=Path, help="append outcomes here, one a line; what is there is not run again"
    )
    args = parser.parse_args()
    if args.seed is not None:
        spec = random_spec(args.seed)
        print(spec)
        print(closed_form(arm_of(spec), seconds=args.seconds))
        print(judged(spec, args.seed, args.seconds, args.points))
        return 0
    wanted = range(args.first, args.first + args.chains)
    before = read(args.json) if args.json else []
    outcomes = [o for o in before if o.seed in wanted]
    done = {o.seed for o in outcomes}
    out = args.json.open("a") if args.json else None
    left = [seed for seed in wanted if seed not in done]
    for o in survey(left, args.seconds, args.workers, args.points):
        outcomes.append(o)
        if out:
            out.write(json.dumps(asdict(o)) + "\n")
            out.flush()
        if o.verdict not in ("complete", "no motion") or o.overrun:
            print(f"{o.seed}: {o.verdict}, {o.seconds:.1f} s, {o.note} | {o.spec}", flush=True)
    print(table(outcomes))
    return int(any(o.verdict in ("missed", "false", "rank", "error") for o in outcomes))


if __name__ == "__main__":
    sys.exit(main())
