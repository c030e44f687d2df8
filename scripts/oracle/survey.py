#!/usr/bin/env python
"""Prove the closed form of every chain of every robot in example-robot-data; write the table.

Each chain runs in a process of its own that is killed when its time is over. Results are appended
to a file of JSON lines as they come, and chains that are in it are not run again: stop and start
at will. A chain of the same exact geometry as one that is proven already is not run again either:
the same certificate holds for it, names aside. The table is made of that file.

With --analyse each chain is analysed as well: samples, sweep and random starts are held against
the closed form in Pinocchio.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 160.0
SEARCH_SECONDS = 40.0
PROOF_SECONDS = 100.0
MEMORY = 4 * 2**30


AGAIN: dict[str, Callable[[dict[str, Any]], bool]] = {
    "none": lambda entry: False,
    "bad": lambda entry: entry["outcome"] in ("killed", "crashed") or not entry.get("agree", True),
    "unproven": lambda entry: AGAIN["bad"](entry) or entry.get("word", "proven") != "proven",
    "incomplete": lambda entry: AGAIN["bad"](entry) or entry.get("word") == "not complete",
    "all": lambda entry: True,
}


@dataclass(frozen=True)
class Budget:
    """Seconds for one chain.

    Its process as a whole and the search for families are timed on the clock, the search for a
    certificate by the processor time it takes: what else the machine does changes little.
    """

    whole: float
    search: float
    proof: float


@dataclass(frozen=True)
class Job:
    """One chain: the URDF below the folder of robots, tip, and base (None for the root)."""

    file: str
    tip: str
    base: str | None

    @property
    def key(self) -> str:
        """What tells it from the others."""
        return f"{self.file} {self.tip} {self.base or ''}".strip()


def all_chains(
    model: Any, mimics: Collection[str], shortest: int = 2, longest: int = 9
) -> list[tuple[str, str | None, tuple[str, ...]]]:
    """Return tip, base and joints of each chain that ends in a leaf or tool frame."""
    # Each starts at the root and at the last branching; where the root is too far, at all near
    # ones.
    from pinsing.robot import models as chains

    tools = {c.path[-1]: c.tip for c in chains.candidates(model, mimics)}
    leaves = {j for j in range(1, model.njoints) if not len(model.children[j])}
    found = []
    for end in sorted({*leaves, *tools}):
        tip = tools.get(end) or chains.choose_tip(model, end)
        starts = chains.branchings(model, chains.joint_path(model, end))
        if len(chains._moving(model, chains.joint_path(model, end))) <= longest:
            starts = starts[-1:]
        for start in (0, *starts):
            joints = chains._moving(model, chains.joint_path(model, end, start))
            if shortest <= len(joints) <= longest:
                base = None if start == 0 else chains._link_of(model, start)
                found.append((tip, base, joints))
    return found


def jobs() -> tuple[list[Job], dict[str, str]]:
    """Return every chain, and why a file has none."""
    from pinsing.description.catalog import data_folder
    from pinsing.description.urdf import read_description
    from pinsing.errors import PinsingError
    from pinsing.robot.models import build_model

    folder = data_folder()
    assert folder is not None, "example-robot-data is not installed"
    found: list[Job] = []
    without: dict[str, str] = {}
    for path in sorted(folder.rglob("*.urdf")):
        file = path.relative_to(folder).as_posix()
        try:
            description = read_description(path)
            model = build_model(description)
        except PinsingError as error:
            without[file] = str(error).replace(f"{folder}/", "")
            continue
        mimics = [j.name for j in description.joints if j.mimic is not None]
        chains = all_chains(model, mimics)
        if not chains:
            without[file] = f"no chain of 2 to 9 joints ({model.njoints - 1} joints in all)"
        found += [Job(file, tip, base) for tip, base, _ in chains]
    return found, without


def run(job: Job, done: Collection[str], budget: Budget, analyse: bool) -> dict[str, Any]:
    """Prove one chain, in this process, unless its geometry is among those that are done."""
    import pinsing
    from pinsing.algebra.budget import Budget as Time
    from pinsing.description.catalog import data_folder
    from pinsing.families.certificate import text_of, within
    from pinsing.proof.checker import verify

    folder = data_folder()
    assert folder is not None
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    try:
        arm = pinsing.load(folder / job.file, tip=job.tip, base=job.base)
        about = {"outcome": "done", "joints": arm.n, "geometry": identity(arm)}
        if about["geometry"] in done and not analyse:
            return about
        result = pinsing.analyze(arm, seconds=budget.search) if analyse else None
        found = (
            pinsing.closed_form(arm, seconds=budget.search, prove=False) if result is None else None
        )
    except pinsing.PinsingError as error:
        return {"outcome": "refused", "reason": str(error).replace(f"{folder}/", "")}
    found = result.closed_form if result is not None else found
    if found.word != "proven":
        found = within(found, Time(budget.proof), None)
    proof = found.proof
    about |= {
        "rank": found.generic_rank,
        "families": len(found.families),
        "texts": [f.text for f in found.families],
        "word": found.word,
        "gaps": list(found.gaps),
        "unproven": "" if proof is None else proof.reason,
        "bytes": 0 if proof is None else proof.size,
        "find_seconds": 0.0 if proof is None else round(proof.seconds, 3),
        "algebra_seconds": round(found.seconds, 3),
        "load": round(os.getloadavg()[0], 1),
        "budget": [budget.search, budget.proof],
    }
    if found.word == "proven":
        text, started = text_of(found.certificate), time.process_time()
        verify(text)
        about["check_seconds"] = round(time.process_time() - started, 4)
    if result is not None:
        about |= {
            "agree": result.agree,
            "problems": list(result.problems),
            "findings": len(result.findings),
            "worst": max((c.nominal_ratio for c in result.checks), default=0.0),
            "missing": list(result.missing),
            "random": [result.random_search.singular, result.random_search.on_family],
        }
    return about


def identity(arm: Any) -> str:
    """What two chains share for which the same certificate holds: all it states, names aside."""
    from pinsing.families.proof_forms import roots_in, skeleton
    from pinsing.robot.nominal import nominal

    geometry = nominal(arm)
    stated = skeleton(geometry, 1, roots_in(geometry))
    kinds = [joint["kind"] for joint in stated["joints"]]
    parts = [stated["chain"], stated["tip"], stated["rows"], kinds]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


def run_apart(
    job: Job, budget: Budget, done: Mapping[str, dict[str, Any]], analyse: bool
) -> dict[str, Any]:
    """Prove one chain in a process of its own, and tell how it ended."""
    started = time.monotonic()
    question = [asdict(job), [*done], asdict(budget), analyse]
    command = [sys.executable, __file__, "--one", json.dumps(question)]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    try:
        child = subprocess.run(
            command,
            capture_output=True,
            timeout=budget.whole,
            check=False,
            env={**os.environ, **threads},
        )
    except subprocess.TimeoutExpired:
        return {"outcome": "killed", "reason": f"not done after {budget.whole:g} s"}
    if child.returncode != 0:
        said = child.stderr.decode(errors="replace").strip().splitlines() or ["nothing said"]
        return {"outcome": "crashed", "reason": f"exit code {child.returncode}: {said[-1]}"}
    answer = json.loads(child.stdout)
    if answer["outcome"] == "done" and "word" not in answer:
        answer = {**answer, **alike(done[answer["geometry"]])}
    return {**answer, "wall": round(time.monotonic() - started, 2)}


def alike(entry: dict[str, Any]) -> dict[str, Any]:
    """What a chain has in common with one of the same geometry."""
    same = ("rank", "families", "word", "gaps", "unproven", "bytes", "check_seconds", "budget")
    return {"same_as": entry["key"], **{k: entry[k] for k in same if k in entry}}


def survey(
    store: Path,
    budget: Budget,
    workers: int,
    only: str,
    again: str,
    step: int = 1,
    analyse: bool = False,
) -> None:
    """Run what is not in the store yet, and again what ended badly where that is asked for."""
    known = read(store)
    done = {entry["key"] for entry in known if not AGAIN[again](entry)}
    # A geometry is tried once: what is proven stays so, what is not is not tried twice in one run.
    tried = {e["geometry"]: e for e in known if e.get("word") == "proven" and not e.get("same_as")}
    chains, _ = jobs()
    todo = [job for job in chains[::step] if job.key not in done and only in job.key]
    print(f"{len(chains)} chains, {len(todo)} to do")
    with ThreadPoolExecutor(workers) as pool, store.open("a", encoding="utf-8") as stream:
        answers = pool.map(lambda job: run_apart(job, budget, tried, analyse), todo)
        for number, (job, answer) in enumerate(zip(todo, answers, strict=True), 1):
            entry = {"key": job.key, **asdict(job), **answer}
            if "word" in entry and "same_as" not in entry:
                tried[entry["geometry"]] = entry
            stream.write(json.dumps(entry) + "\n")
            stream.flush()
            print(f"{number}/{len(todo)} {job.key}: {_short(answer)}", flush=True)


def read(store: Path) -> list[dict[str, Any]]:
    """Return the results so far, the last of each chain."""
    if not store.exists():
        return []
    entries = [json.loads(line) for line in store.read_text(encoding="utf-8").splitlines()]
    return list({entry["key"]: entry for entry in entries}.values())


def _short(answer: dict[str, Any]) -> str:
    if answer["outcome"] != "done":
        return f"{answer['outcome']}: {answer['reason']}"
    state = answer["word"]
    if state == "proven":
        state += f", {answer['bytes']} bytes, checked in {answer['check_seconds']} s"
    else:
        state += ": " + "; ".join([*answer["gaps"], answer["unproven"]])
    if "agree" in answer:
        state += ", agree" if answer["agree"] else ", " + "; ".join(answer["problems"])
    return f"{answer['families']} families, {state}, {answer['wall']} s"


def main(argv: Iterable[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--store", type=Path, default=ROOT / "build" / "survey.jsonl")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="for each chain")
    parser.add_argument("--search", type=float, default=SEARCH_SECONDS, help="of these, families")
    parser.add_argument("--proof", type=float, default=PROOF_SECONDS, help="of a processor")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--sample", type=int, help="every so many-th chain only")
    parser.add_argument("--only", default="", help="chains whose file, tip or base has this text")
    parser.add_argument("--again", choices=AGAIN, default="none", help="what to run once more")
    parser.add_argument("--analyse", action="store_true", help="hold it against Pinocchio, too")
    parser.add_argument("--report", type=Path, help="write the table there, and run nothing")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    arguments = parser.parse_args(None if argv is None else list(argv))
    budget = Budget(arguments.seconds, arguments.search, arguments.proof)
    if arguments.report:
        sys.path.insert(0, str(ROOT / "scripts"))
        from oracle.survey_report import report

        chains, _ = jobs()
        order = {job.key: number for number, job in enumerate(chains)}
        entries = sorted(
            (e for e in read(arguments.store) if e["key"] in order), key=lambda e: order[e["key"]]
        )
        text = report(entries, (budget.whole, budget.search, budget.proof))
        arguments.report.write_text(text, encoding="utf-8")
        return 0
    if arguments.one:
        job, done, limits, analyse = json.loads(arguments.one)
        json.dump(run(Job(**job), done, Budget(**limits), analyse), sys.stdout)
        return 0
    arguments.store.parent.mkdir(parents=True, exist_ok=True)
    survey(
        arguments.store,
        budget,
        arguments.workers,
        arguments.only,
        arguments.again,
        arguments.sample or 1,
        arguments.analyse,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
