"""The table of the survey, out of its results."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from importlib.metadata import version
from typing import Any

HEAD = """# Survey: every chain of every robot in example-robot-data

Made by `scripts/survey.py` with pinsing {pinsing}, example-robot-data {data}, Pinocchio {pin}; each
chain in a process of its own, {seconds:g} s at most on one core, of which {algebra:g} s for the
algebra. Chains of 2 to 9 joints that end in a leaf or a tool frame, from the root and from the last
branching before the end (from every branching, where the whole is longer). The task is the pose.

- **families**: families of singular configurations, and how many of them the joint limits let
  through.
- **complete**: nothing can be missing; else see the reasons below.
- **agree**: every sample of every family is singular in Pinocchio, and, where complete, everything
  that the sweep and the search from 300 random starts found lies on a family.

"""

WHY = {
    "A": ("equations were not told apart", "redundant chains: some common zeros of several "
          "polynomials are more than can be told apart"),
    "B": ("were not searched", "sets inside the regular part of equations that have a singular "
          "part too are not searched"),
    "C": ("equations hold at regular", "a set was found whose equations also hold elsewhere; it is "
          "left out rather than stated wrongly"),
    "D": ("does not follow a mimic joint", "a mimic joint follows by what is no small integer; "
          "sweep, states and maps follow it"),
    "E": ("time budget", "the algebra did not end in time"),
    "F": ("too long to factor", "a polynomial was too long"),
    "G": ("no single minor", "no minor was found that cuts all of several polynomials' zeros"),
}  # fmt: skip

REFUSED = {
    "follows one outside it": "fingers that all follow one joint outside the chain: nothing in the "
    "chain moves by itself; take the chain from farther in",
    "mimics joint": "the file lets a joint mimic one that does not exist",
    "has a <limit> without": "the file gives a revolute joint no range; `continuous` was meant, or "
    "numbers are missing",
}


def report(
    entries: list[dict[str, Any]], without: dict[str, str], seconds: float, algebra: float
) -> str:
    """Return the report as Markdown."""
    text = HEAD.format(
        pinsing=version("pinsing"),
        data=version("example-robot-data"),
        pin=version("pin"),
        seconds=seconds,
        algebra=algebra,
    )
    return text + "\n".join([*_numbers(entries), "", *_reasons(entries, without), *_table(entries)])


def _numbers(entries: list[dict[str, Any]]) -> list[str]:
    done = [e for e in entries if e["outcome"] == "done"]
    outcome = Counter(e["outcome"] for e in entries)
    times = sorted(e["wall"] for e in done)
    return [
        f"{len(entries)} chains of {len({e['file'] for e in entries})} files: "
        f"{len(done)} analysed, {outcome['refused']} refused with a reason, "
        f"{outcome['killed']} out of time, "
        f"{outcome['crashed']} crashed.",
        f"Of those analysed, {sum(e['complete'] for e in done)} are complete and "
        f"{sum(e['agree'] for e in done)} agree; {sum(e['families'] for e in done)} families, the "
        f"largest sigma_r / sigma_1 on any sample of them {max(e['worst'] for e in done):.0e}. "
        f"Median time {times[len(times) // 2]:.1f} s, slowest {times[-1]:.1f} s.",
    ]


def _reasons(entries: list[dict[str, Any]], without: dict[str, str]) -> list[str]:
    lines = ["Why not complete:", ""]
    gaps = Counter(key for e in entries for key in _keys(e))
    lines += [
        f"- **{key}** ({gaps[key]} chains): {why}." for key, (_, why) in WHY.items() if gaps[key]
    ]
    other = {
        g for e in entries for g in e.get("gaps", []) if not any(w[0] in g for w in WHY.values())
    }
    lines += [f"- {gap}" for gap in sorted(other)]
    lines += ["", "Why refused:", ""]
    counts: dict[str, int] = defaultdict(int)
    for e in entries:
        if e["outcome"] == "refused":
            known = (why for part, why in REFUSED.items() if part in e["reason"])
            counts[next(known, e["reason"])] += 1
    lines += [f"- {n} chains: {why}." for why, n in sorted(counts.items(), key=lambda x: -x[1])]
    lines += ["", "Files without a chain:", ""]
    lines += [f"- `{file}`: {_plain(reason, file)}" for file, reason in without.items()]
    return [*lines, ""]


def _keys(entry: dict[str, Any]) -> str:
    return "".join(
        key for key, (part, _) in WHY.items() if any(part in gap for gap in entry.get("gaps", []))
    )


def _table(entries: list[dict[str, Any]]) -> list[str]:
    lines = []
    files: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for e in entries:
        files[e["file"]].append(e)
    for file, found in sorted(files.items()):
        lines += [
            f"### {file.removesuffix('.urdf').replace('_description/', ': ', 1)}",
            "",
            "| tip | base | joints | families (within limits) | complete | agree | s |",
            "|---|---|---:|---:|---|---|---:|",
        ]
        lines += [_row(e) for e in found]
        lines.append("")
    return lines


def _row(e: dict[str, Any]) -> str:
    ends = f"| {e['tip']} | {e['base'] or 'root'} |"
    if e["outcome"] != "done":
        return f"{ends} | {e['outcome']}: {_plain(e['reason'], e['file'])} | | | |"
    complete = "yes" if e["complete"] else _keys(e) or "no"
    agree = "yes" if e["agree"] else "**NO**"
    return (
        f"{ends} {e['joints']} | {e['families']} ({e['reachable']}) | {complete} | {agree} | "
        f"{e['wall']:.1f} |"
    )


def _plain(reason: str, file: str) -> str:
    text = re.sub(rf"^{re.escape(file)}:?", "", reason).strip()
    text = re.sub(r"^(\d+): ", r"line \1: ", text)
    return text.replace("|", "/").replace("<", "&lt;")
