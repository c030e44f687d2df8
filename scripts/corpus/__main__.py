"""Freeze what pinsing answers, and show what a change of the code loses or gains.

    python scripts/corpus make FILE [--quick]        FILE is tests/corpus/answers.json.xz
    python scripts/corpus compare [FILE] [--quick]   prints differences; 1 where anything is lost
    python scripts/corpus renew [FILE] [--quick]     the same, and freezes anew where all is gain

Entries: every chain of example-robot-data, the arms of docs/tasks.md for their tasks, the
mechanisms of urdf/, random chains by seed, and a transcript per command. Families are compared as
sets, whatever their names, order, or how they are cut. Two processes work; one that takes too long
is killed, which is an answer too. Entries that are done are kept in build/ for this very code and
not computed again (``--fresh`` does). What seems lost is computed once more, alone and with three
times the seconds, before it is called lost. Texts of commands are shown for review only.
"""

from __future__ import annotations

import argparse
import difflib
import hashlib
import json
import lzma
import math
import os
import subprocess
import sys
import threading
import zlib
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from entries import ROOT, changes, entry, keys

FROZEN = ROOT / "tests" / "corpus" / "answers.json.xz"
WORKERS = 2
KILLED_AFTER = 60.0
RENEWED_AFTER = 100
QUICK = {"data": 16, "seed": 12, "task": 16, "loops": 2, "command": 5}
"""Of each kind one entry in so many belongs to the quick subset, by a hash of its key."""
QUICK_SECONDS = 8.0
"""What took longer when it was frozen is left out of a quick comparison."""

Entry = dict[str, Any]


class Worker:
    """A process that computes entries one by one, killed where it takes too long."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[str] | None = None
        self.done = 0

    def ask(self, key: str, patience: float, before: Entry | None) -> Entry:
        """Compute an entry, in a process that may have served others."""
        if self.process is None or self.done >= RENEWED_AFTER:
            self.stop()
            self.process = subprocess.Popen(
                [sys.executable, str(Path(__file__).parent), "work"],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                text=True,
            )  # fmt: skip
            self.done = 0
        process = self.process
        assert process.stdin is not None
        assert process.stdout is not None
        late = threading.Timer(KILLED_AFTER * patience, process.kill)
        late.start()
        try:
            process.stdin.write(json.dumps([key, patience, before]) + "\n")
            process.stdin.flush()
            line = process.stdout.readline()
        except BrokenPipeError:
            line = ""
        late.cancel()
        self.done += 1
        if line.endswith("\n"):
            return json.loads(line)  # type: ignore[no-any-return]
        killed = process.wait() == -9
        self.process = None
        return {"key": key, "outcome": "killed" if killed else "crashed", "seconds": KILLED_AFTER}

    def stop(self) -> None:
        """End the process."""
        if self.process is not None:
            assert self.process.stdin is not None
            self.process.stdin.close()
            self.process.wait()
            self.process = None


def work() -> None:
    """Answer what is asked on standard input, a line of JSON each."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    for line in sys.stdin:
        key, patience, before = json.loads(line)
        try:
            found = entry(key, patience, before)
        except Exception as error:
            found = {"key": key, "outcome": "crashed", "text": f"{error!r}", "seconds": 0}
        out.write(json.dumps(found) + "\n")
        out.flush()


def computed(
    wanted: Iterable[str], frozen: dict[str, Entry], options: argparse.Namespace
) -> dict[str, Entry]:
    """All entries wanted; those that this code has computed already are read."""
    about = hashlib.sha256(json.dumps([options.patience, sorted(frozen.items())]).encode())
    for path in sorted([*(ROOT / "src").rglob("*.*"), *Path(__file__).parent.glob("*.py")]):
        if path.suffix in (".py", ".so", ".cpp", ".hpp", ".js", ".html") and path.is_file():
            about.update(path.read_bytes())
    store = ROOT / "build" / f"corpus-{about.hexdigest()[:16]}.jsonl"
    store.parent.mkdir(exist_ok=True)
    if options.fresh:
        store.unlink(missing_ok=True)
    found: dict[str, Entry] = {}
    if store.exists():
        lines = store.read_text(encoding="utf-8").splitlines(keepends=True)
        found = {e["key"]: e for e in (json.loads(x) for x in lines if x.endswith("\n"))}
    left = [key for key in wanted if key not in found]
    own, lock, all_workers = threading.local(), threading.Lock(), list[Worker]()

    def one(key: str) -> None:
        if not hasattr(own, "worker"):
            own.worker = Worker()
            all_workers.append(own.worker)
        made = own.worker.ask(key, options.patience, frozen.get(key))
        with lock, store.open("a", encoding="utf-8") as file:
            file.write(json.dumps(made) + "\n")
            found[key] = made
            if sys.stderr.isatty():
                print(f"\r{len(found)} {key[:60]:60}", end="", file=sys.stderr, flush=True)

    with ThreadPoolExecutor(options.workers) as pool:
        list(pool.map(one, left))
    for worker in all_workers:
        worker.stop()
    if sys.stderr.isatty():
        print("\r" + " " * 72 + "\r", end="", file=sys.stderr)
    return {key: found[key] for key in wanted}


def chosen(among: Iterable[str], options: argparse.Namespace) -> list[str]:
    """Keys in their order."""
    out = [k for k in among if options.only in k]
    if options.quick:
        out = [k for k in out if zlib.crc32(k.encode()) % QUICK[k.split(" ")[0]] == 0]
    return out


def make(options: argparse.Namespace) -> int:
    """Write a corpus."""
    file, found = options.file, computed(chosen(keys(), options), {}, options)
    file.parent.mkdir(parents=True, exist_ok=True)
    write(file, found)
    said = f"{file}: {len(found)} entries, {file.stat().st_size / 1e6:.2f} MB"
    for outcome in ("refused", "killed", "crashed"):
        said += f", {sum(e['outcome'] == outcome for e in found.values())} {outcome}"
    print(said)
    return 0


def write(file: Path, entries: dict[str, Entry]) -> None:
    """Freeze entries."""
    data = json.dumps(list(entries.values()), sort_keys=True).encode()
    file.write_bytes(lzma.compress(data, preset=9 | lzma.PRESET_EXTREME))


def compare(options: argparse.Namespace) -> int:
    """Print losses, gains and what is to be reviewed; renew what has gains and no losses."""
    file = options.file
    frozen = {e["key"]: e for e in json.loads(lzma.decompress(file.read_bytes()))}
    most = QUICK_SECONDS if options.quick else math.inf
    wanted = [k for k in chosen(frozen, options) if frozen[k]["seconds"] <= most]
    now = computed(wanted, frozen, options)
    lost = renewed = 0
    worker = Worker()
    for key in wanted:
        found = list(changes(frozen[key], now[key]))
        if any(sort == "loss" for sort, _ in found):
            now[key] = worker.ask(key, 3 * options.patience, frozen[key])
            again = list(changes(frozen[key], now[key]))
            slow = not any(sort == "loss" for sort, _ in again)
            found = [("slow", words) for _, words in found] if slow else again
        if {sort for sort, _ in found} & {"gain", "loss"} == {"gain"} and options.what == "renew":
            frozen[key] = {name: x for name, x in now[key].items() if name != "kept"}
            renewed += 1
        for sort, words in found:
            lost += sort == "loss"
            print(f"{sort:6} {key}: {words}")
            if sort == "review" and words == "the text differs":
                pair = (x["text"].splitlines() for x in (frozen[key], now[key]))
                print(
                    "\n".join(f"       {x}" for x in difflib.unified_diff(*pair, n=0, lineterm=""))
                )
    worker.stop()
    if renewed:
        write(file, frozen)
    said = f"{len(wanted)} entries compared with {file.name}, {lost} losses, {renewed} renewed"
    print(said, file=sys.stderr)
    return 1 if lost else 0


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("make", "compare", "renew", "work"))
    parser.add_argument("file", nargs="?", type=Path, default=FROZEN)
    parser.add_argument("--quick", action="store_true", help="a subset, about a minute")
    parser.add_argument("--only", default="", metavar="PART", help="entries with this in the key")
    parser.add_argument("--fresh", action="store_true", help="nothing from build/")
    parser.add_argument("--patience", type=float, default=1.0, help="times all caps on seconds")
    parser.add_argument("--workers", type=int, default=WORKERS)
    options = parser.parse_args()
    if options.what == "work":
        work()
        return 0
    return (make if options.what == "make" else compare)(options)


if __name__ == "__main__":
    sys.exit(main())
