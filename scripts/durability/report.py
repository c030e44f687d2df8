"""docs/durability.md, out of what was measured."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

_ENDS = ("SIGKILL", "SIGINT", "SIGINT twice", "SIGKILL of a worker")


def report(found: dict[str, Any]) -> str:
    """The whole page, as Markdown; parts that were not measured say so."""
    parts = [
        "# What failures, kills and a loss of power leave\n\n"
        "Made by `scripts/durability` (`python -m durability kills|failures|cuts`, then `report`)."
        " Every file that pinsing writes goes through one function: written under another name in "
        "the same folder, flushed, renamed, and the folder flushed.\n",
        _kills(found),
        _failures(found),
        _cuts(found),
    ]
    return "\n".join(parts)


def _kills(found: dict[str, Any]) -> str:
    rows = found.get("kills")
    if rows is None:
        return "## Kills\n\nNot measured.\n"
    lines = [
        "## Kills\n",
        "Runs in a folder are ended at random moments by SIGKILL, Ctrl-C, Ctrl-C twice, or a "
        "SIGKILL of one of their worker processes (a Dask worker is replaced, and the run goes "
        "on without a stop), one life in ten anywhere from its start, the others while chunks come "
        "in; then the same command is run again, until the run is complete. Every file of the "
        "folder must then be byte for byte that of a run at one stretch, with nothing else beside "
        "it.\n",
        "| run | chunks | SIGKILL | Ctrl-C | Ctrl-C, ended at once | SIGKILL of a worker | kills "
        "| before its plan | runs completed, all identical |",
        "|---|" + "---:|" * 8,
    ]
    rows = _by_kind(rows)
    total = sum(row["kills"] for row in rows)
    for row in rows:
        ends = [row["ends"].get(name, 0) for name in _ENDS]
        cells = [row["chunks"], *ends, row["kills"], row["early"], row["runs"]]
        lines.append(f"| {row['kind']} | {' | '.join(map(str, cells))} |")
    wrong = found.get("kills_wrong", [])
    lines.append(f"\n{total:,} kills in all; {len(wrong)} that went wrong.\n")
    notes = [f"{note}\n" for note in found.get("kills_notes", [])]
    return "\n".join([*lines, *(f"- {line}" for line in wrong), *notes])


def _by_kind(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row of each kind, whose campaigns are added up."""
    kinds: dict[str, dict[str, Any]] = {}
    for row in rows:
        whole = kinds.setdefault(
            row["kind"], {**row, "ends": {}, "kills": 0, "early": 0, "runs": 0}
        )
        for name, count in row["ends"].items():
            whole["ends"][name] = whole["ends"].get(name, 0) + count
        for name in ("kills", "early", "runs"):
            whole[name] += row[name]
    return list(kinds.values())


def _failures(found: dict[str, Any]) -> str:
    rows = found.get("failures")
    if rows is None:
        return "## Each operation fails in turn\n\nNot measured.\n"
    lines = [
        "## Each operation fails in turn\n",
        "Each operation on a file of each command fails once in each of these ways. Afterwards "
        "the old file is whole or the new one is, no other file is left, the message is one line "
        "and the exit code 2; a run in a folder goes on to identical bytes. A folder that may be "
        "written to but not read (EACCES when it is opened) is not flushed, and is no error.\n",
        "| command | operations that fail | cases | as it must be |",
        "|---|---|---:|---:|",
    ]
    commands: dict[str, set[str]] = defaultdict(set)
    for row in rows:
        commands[row["command"]].add(row["operation"])
    for names in dict.fromkeys(map(frozenset, commands.values())):
        alike = [command for command in commands if commands[command] == names]
        of = [row for row in rows if row["command"] in alike]
        cases, good = (sum(row[key] for row in of) for key in ("cases", "good"))
        told = ", ".join(f"`{command}`" for command in alike)
        lines.append(f"| {told} | {', '.join(sorted(names))} | {cases} | {good} |")
    count: dict[str, int] = defaultdict(int)
    for row in rows:
        count["cases"] += row["cases"]
        count["good"] += row["good"]
    lines.append(f"\n{count['cases']:,} cases; {count['cases'] - count['good']} that went wrong.\n")
    return "\n".join(lines)


def _cuts(found: dict[str, Any]) -> str:
    rows = found.get("cuts")
    if rows is None:
        return "## Loss of power\n\nNot measured.\n"
    lines = [
        "## Loss of power\n",
        "After a random number of the operations of a run, the disk is put into a state that a "
        "file system may come up with: of files that were not flushed nothing, a part, or zeros; "
        "of folders that were not flushed any of the new names, in any order. The same command "
        "must then go on to identical bytes.\n",
        "| command | operations of a run | cuts | gone on to identical bytes |",
        "|---|---:|---:|---:|",
    ]
    for row in rows:
        cells = [f"`{row['command']}`", row["operations"], row["cuts"], row["good"]]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines) + "\n"
