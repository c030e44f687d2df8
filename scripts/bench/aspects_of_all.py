"""Count the aspects of every chain of 3 to 7 joints in example-robot-data.

    python scripts/bench/aspects_of_all.py --store build/aspects.jsonl
    python scripts/bench/aspects_of_all.py --store build/aspects.jsonl --table

The task is the position of the tip for three joints, the pose for more. Each chain has a process
of its own that is ended at its time; what is in the store is not run again. A chain of the same
geometry, limits and task as an earlier one is listed with it.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import multiprocessing
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from oracle.survey import Job, identity, jobs, read

import pinsing
from pinsing.description.catalog import data_folder
from pinsing.errors import PinsingError
from pinsing.families import prove
from pinsing.kinematics.jacobian import generic_rank
from pinsing.robot.arm import Arm

SEARCH, PROOF, WHOLE = 8.0, 4.0, 40.0
"""Seconds on the clock: closed form, certificate, either count, a chain as a whole."""
POSES = 5
JOINTS = range(3, 8)


def same(arm: Arm) -> str:
    """What two chains share for which everything here is the same."""
    limits = [[round(float(x), 9) for x in end] for end in (arm.lower, arm.upper)]
    said = json.dumps([identity(arm), limits])
    return hashlib.sha256(said.encode()).hexdigest()[:16]


def load(job: Job) -> Arm:
    """The chain, with the position as its task if it has three joints."""
    folder = data_folder()
    assert folder is not None
    arm = pinsing.load(folder / job.file, tip=job.tip, base=job.base)
    if arm.n == 3:
        arm = arm.with_task("position")
    return arm


def counted(form: pinsing.ClosedForm, limits: bool) -> dict[str, Any]:
    """A count and its time."""
    begin = time.process_time()
    found = pinsing.aspects(form, limits)
    spent = round(1e3 * (time.process_time() - begin))
    return {"lower": found.lower, "upper": found.upper, "ms": spent}


def look(arm: Arm, send: Connection) -> None:
    """Say step by step what was found, so that an end in between loses only the rest."""
    try:
        begin = time.process_time()
        form = pinsing.closed_form(arm, seconds=SEARCH, prove=False)
        send.send({"form_ms": round(1e3 * (time.process_time() - begin)), "word": form.word})
        if form.complete:
            form = prove(form, PROOF)
            send.send({"word": form.word})
        send.send({"around": counted(form, False)})
        send.send({"within": counted(form, True)})
        if arm.n == generic_rank(arm) and (arm.n == 6 or arm.n == 3):
            if not form.complete:
                send.send({"cuspidal": "not asked: families not complete"})
                return
            found = pinsing.cuspidality(arm, forms=form, poses=POSES)
            word = found.answer + (", proven" if found.proven else f" in {found.poses} poses")
            send.send({"cuspidal": word})
    except PinsingError as error:
        send.send({"reason": str(error)})


def apart(arm: Arm) -> dict[str, Any]:
    """What one chain says within its time."""
    fork = multiprocessing.get_context("fork")
    receive, send = fork.Pipe(duplex=False)
    child = fork.Process(target=look, args=(arm, send))
    child.start()
    send.close()
    end = time.monotonic() + WHOLE
    answer: dict[str, Any] = {}
    try:
        while receive.poll(max(0.0, end - time.monotonic())):
            answer |= receive.recv()
        answer["late"] = True
        child.kill()
    except EOFError:
        pass
    child.join()
    return answer


def survey(store: Path, step: int, first: int) -> None:
    """Every chain that is not in the store."""
    store.parent.mkdir(parents=True, exist_ok=True)
    done = read(store)
    known = {e["same"]: e["key"] for e in done if "same" in e and "same_as" not in e}
    over = {e["key"] for e in done}
    todo = [job for job in jobs()[0][first::step] if job.key not in over]
    for number, job in enumerate(todo, 1):
        entry: dict[str, Any] = {"key": job.key}
        try:
            arm = load(job)
        except PinsingError as error:
            entry["refused"] = str(error).replace(f"{data_folder()}/", "")
        else:
            entry |= {"joints": arm.n, "task": arm.task.name if arm.n == 3 else "pose"}
            if arm.n in JOINTS:
                entry["same"] = same(arm)
                if entry["same"] in known:
                    entry["same_as"] = known[entry["same"]]
                else:
                    known[entry["same"]] = job.key
                    entry |= apart(arm)
        with store.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(entry) + "\n")
        print(f"{number}/{len(todo)} {json.dumps(entry)}", flush=True)


def said(count: dict[str, Any] | None) -> str:
    """Two cells."""
    if count is None:
        return "not reached | "
    if count["lower"] == count["upper"]:
        return f"{count['lower']} | {count['ms']}"
    end = "at least " if count["upper"] is None else ""
    to = "" if count["upper"] is None else f" to {count['upper']}"
    return f"{end}{count['lower']}{to} | {count['ms']}"


def table(entries: list[dict[str, Any]]) -> str:
    """Rows of Markdown, one for chains that are the same."""
    alike: dict[str, list[str]] = {}
    for e in entries:
        if "same_as" in e:
            alike.setdefault(e["same_as"], []).append(e["key"])
    lines = [
        "| chain | joints | same | families | aspects on circles | ms | within limits | ms "
        "| cuspidal |",
        "| --- | ---: | ---: | --- | ---: | ---: | ---: | ---: | --- |",
    ]
    for e in entries:
        if e.get("joints") not in JOINTS or "same_as" in e:
            continue
        more = len(alike.get(e["key"], ()))
        lines.append(
            f"| {e['key'].replace('_description/', '/')} | {e['joints']} | {more or ''} "
            f"| {e.get('word', e.get('reason', 'not reached'))} "
            f"| {said(e.get('around'))} | {said(e.get('within'))} | {e.get('cuspidal', '')} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Count, or print the table of what was counted."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--store", type=Path, default=Path("build", "aspects.jsonl"))
    parser.add_argument("--step", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    if options.table:
        print(table(read(options.store)))
    else:
        survey(options.store, options.step, options.first)


if __name__ == "__main__":
    main()
