#!/usr/bin/env python
"""Analyse every chain of every robot in example-robot-data, and write the table.

Each chain runs in a process of its own that is killed when its time is over. Results are appended
to a file of JSON lines as they come, and chains that are in it are not run again: stop and start
at will. The table is made of that file.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
SECONDS = 60.0
ANALYSIS_SECONDS = 30.0
PROOF_SECONDS = 20.0
MEMORY = 4 * 2**30


AGAIN: dict[str, Callable[[dict[str, Any]], bool]] = {
    "none": lambda entry: False,
    "bad": lambda entry: entry["outcome"] in ("killed", "crashed") or not entry.get("agree", True),
    "unproven": lambda entry: AGAIN["bad"](entry) or entry.get("word", "proven") != "proven",
    "incomplete": lambda entry: AGAIN["bad"](entry) or entry.get("word") == "not complete",
    "all": lambda entry: True,
}


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


def jobs() -> tuple[list[Job], dict[str, str]]:
    """Return every chain, and why a file has none."""
    from pinsing.description.catalog import data_folder
    from pinsing.description.urdf import read_description
    from pinsing.errors import PinsingError
    from pinsing.robot.build_model import build_model
    from pinsing.robot.subchains import all_chains

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
        found += [Job(file, c.tip, c.base) for c in chains]
    return found, without


def run(job: Job) -> dict[str, Any]:
    """Analyse one chain, in this process, and look for a certificate."""
    import pinsing
    from pinsing.description.catalog import data_folder
    from pinsing.families import prove

    folder = data_folder()
    assert folder is not None
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    try:
        arm = pinsing.load(folder / job.file, tip=job.tip, base=job.base)
        result = pinsing.analyze(arm, seconds=ANALYSIS_SECONDS)
    except pinsing.PinsingError as error:
        return {"outcome": "refused", "reason": str(error).replace(f"{folder}/", "")}
    found = result.closed_form
    if found.word != "proven":
        found = prove(found, PROOF_SECONDS)
    proof = found.proof
    return {
        "outcome": "done",
        "joints": arm.n,
        "rank": found.generic_rank,
        "families": len(found.families),
        "reachable": sum(f.is_reachable is True for f in found.families),
        "texts": [f.text for f in found.families],
        "word": found.word,
        "gaps": list(found.gaps),
        "unproven": "" if proof is None else proof.reason,
        "bytes": 0 if proof is None else proof.size,
        "find_seconds": 0.0 if proof is None else round(proof.seconds, 3),
        "check_seconds": 0.0 if proof is None else round(proof.check_seconds, 4),
        "algebra_seconds": round(found.seconds, 3),
        "agree": result.agree,
        "problems": list(result.problems),
        "findings": len(result.findings),
        "worst": max((c.nominal_ratio for c in result.checks), default=0.0),
        "unsampled": [c.family for c in result.checks if c.samples == 0],
        "missing": list(result.missing),
        "random": [result.random_search.singular, result.random_search.on_family],
        "coupled": arm.coupling is not None,
        "seconds": round(result.seconds, 2),
    }


def run_apart(job: Job, seconds: float) -> dict[str, Any]:
    """Analyse one chain in a process of its own, and tell how it ended."""
    started = time.monotonic()
    command = [sys.executable, __file__, "--one", json.dumps(asdict(job))]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    try:
        child = subprocess.run(
            command,
            capture_output=True,
            timeout=seconds,
            check=False,
            env={**os.environ, **threads},
        )
    except subprocess.TimeoutExpired:
        return {"outcome": "killed", "reason": f"not done after {seconds:g} s"}
    if child.returncode != 0:
        said = child.stderr.decode(errors="replace").strip().splitlines() or ["nothing said"]
        return {"outcome": "crashed", "reason": f"exit code {child.returncode}: {said[-1]}"}
    return {**json.loads(child.stdout), "wall": round(time.monotonic() - started, 2)}


def survey(store: Path, seconds: float, workers: int, only: str, again: str, step: int = 1) -> None:
    """Run what is not in the store yet, and again what ended badly where that is asked for."""
    done = {entry["key"] for entry in read(store) if not AGAIN[again](entry)}
    chains, _ = jobs()
    todo = [job for job in chains[::step] if job.key not in done and only in job.key]
    print(f"{len(chains)} chains, {len(todo)} to do")
    with ThreadPoolExecutor(workers) as pool, store.open("a", encoding="utf-8") as stream:
        for number, (job, answer) in enumerate(
            zip(todo, pool.map(lambda j: run_apart(j, seconds), todo), strict=True), 1
        ):
            stream.write(json.dumps({"key": job.key, **asdict(job), **answer}) + "\n")
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
        state += f", {answer['bytes']} bytes in {answer['find_seconds']} s, "
        state += f"checked in {answer['check_seconds']} s"
    else:
        state += ": " + "; ".join([*answer["gaps"], answer["unproven"]])
    agree = "agree" if answer["agree"] else "; ".join(answer["problems"])
    return f"{answer['families']} families, {state}, {agree}, {answer['wall']} s"


def main(argv: Iterable[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--store", type=Path, default=ROOT / "build" / "survey.jsonl")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="for each chain")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--sample", type=int, help="every so many-th chain only")
    parser.add_argument("--only", default="", help="chains whose file, tip or base has this text")
    parser.add_argument("--again", choices=AGAIN, default="none", help="what to run once more")
    parser.add_argument("--report", type=Path, help="write the table there, and run nothing")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    arguments = parser.parse_args(None if argv is None else list(argv))
    if arguments.report:
        sys.path.insert(0, str(Path(__file__).parent))
        from survey_report import report

        chains, without = jobs()
        order = {job.key: number for number, job in enumerate(chains)}
        entries = sorted(
            (e for e in read(arguments.store) if e["key"] in order), key=lambda e: order[e["key"]]
        )
        text = report(entries, without, (arguments.seconds, ANALYSIS_SECONDS, PROOF_SECONDS))
        arguments.report.write_text(text, encoding="utf-8")
        return 0
    if arguments.one:
        json.dump(run(Job(**json.loads(arguments.one))), sys.stdout)
        return 0
    arguments.store.parent.mkdir(parents=True, exist_ok=True)
    survey(
        arguments.store,
        arguments.seconds,
        arguments.workers,
        arguments.only,
        arguments.again,
        arguments.sample or 1,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
