"""Kill, break and cut off everything that writes; docs/durability.md says how it ended.

python -m durability kills --kills 1000 --json kills.json    (from scripts/, minutes to hours)
python -m durability failures --json failures.json           (minutes)
python -m durability cuts --json cuts.json                   (minutes)
python -m durability report kills.json failures.json cuts.json --out ../docs/durability.md
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parts = parser.add_subparsers(dest="what", required=True)
    for name in ("kills", "failures", "cuts"):
        part = parts.add_parser(name)
        part.add_argument("--json", type=Path, required=True)
        part.add_argument("--seed", type=int, default=1)
        if name == "kills":
            part.add_argument("--kills", type=int, default=1000)
            part.add_argument(
                "--minutes", type=float, default=math.inf, help="of each kind at most"
            )
            part.add_argument("--kind", action="append", help="one of them only; repeatable")
        if name == "cuts":
            part.add_argument("--cuts", type=int, default=200)
        if name == "failures":
            part.add_argument("--command", action="append", help="one of them only; repeatable")
    part = parts.add_parser("report")
    part.add_argument("files", type=Path, nargs="+")
    part.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    # Before NumPy comes in: what is forked must not have threads.
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    if options.what == "report":
        from durability.report import report

        found: dict[str, Any] = {}
        for file in options.files:
            for key, value in json.loads(file.read_text()).items():
                found[key] = found[key] + value if key in found else value
        options.out.write_text(report(found), encoding="utf-8")
        return 0
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="pinsing-durability-") as folder:
        rows, wrong = {"kills": _kills, "failures": _failures, "cuts": _cuts}[options.what](
            options, Path(folder)
        )
    minutes = (time.monotonic() - began) / 60
    data = {options.what: rows, f"{options.what}_wrong": wrong, f"{options.what}_minutes": minutes}
    options.json.write_text(json.dumps(data, indent=1) + "\n")
    for line in wrong:
        print(line, file=sys.stderr)
    return int(bool(wrong))


def _kills(options: argparse.Namespace, folder: Path) -> tuple[list[Any], list[str]]:
    from durability.kills import KINDS, campaign

    for module in (
        "pinsing.cli.app",
        "pinsing.sampling",
        "pinsing.sampling.analyze",
        "distributed",
    ):
        importlib.import_module(module)  # each life is forked with them
    rows, wrong = [], []
    share = dict.fromkeys(KINDS, 0.2)
    share |= {"map, forked worker processes": 0.1, "map, one forked worker killed": 0.1}
    # They start slowly.
    share |= {"map, worker processes": 0.03, "map, one worker process killed": 0.03}
    share |= {"sweep, Dask": 0.11, "sweep, one Dask worker killed": 0.03}
    for kind in options.kind or KINDS:
        place = folder / kind.replace(", ", "_").replace(" ", "_")
        place.mkdir()
        wanted = round(options.kills * share[kind])
        found = campaign(kind, wanted, options.seed, place, 60 * options.minutes)
        row = {"kind": kind, "chunks": found.chunks, "runs": found.runs, "early": found.early}
        rows.append({**row, "ends": dict(found.ends), "kills": found.kills})
        wrong += [f"{kind}: {line}" for line in found.wrong]
        print(rows[-1], *found.wrong, sep="\n", flush=True)
    return rows, wrong


def _failures(options: argparse.Namespace, folder: Path) -> tuple[list[Any], list[str]]:
    from durability.failures import COMMANDS, failures

    rows, wrong = [], []
    for command in options.command or COMMANDS:
        found, bad = failures(command, folder)
        rows += found
        wrong += bad
        print(command, len(found), "rows", len(bad), "wrong", flush=True)
    return rows, wrong


def _cuts(options: argparse.Namespace, folder: Path) -> tuple[list[Any], list[str]]:
    from durability.power import RUNS, cuts

    rows, wrong = [], []
    for run in RUNS:
        found, bad = cuts(run, options.cuts, options.seed, folder)
        rows.append(found)
        wrong += bad
        print(found, flush=True)
    return rows, wrong


if __name__ == "__main__":
    sys.exit(main())
