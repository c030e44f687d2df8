"""The table of the survey, out of its results."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from importlib.metadata import version
from typing import Any

HEAD = """# Survey: every chain of every robot in example-robot-data

Made by `scripts/survey.py` with pinsing {pinsing}, example-robot-data {data}, Pinocchio {pin}; each
chain in a process of its own, {whole:g} s at most on one core, of which {analysis:g} s for the
analysis and {proof:g} s for a certificate. Chains of 2 to 9 joints that end in a leaf or a tool
frame, from the root and from the last branching before the end (from every branching, where the
whole is longer). The task is the pose.

- **families**: families of singular configurations, and how many of them the joint limits let
  through.
- **word**: *proven* (a certificate that the independent checker accepts; its size, and how long
  the check took), *probable* (the search ended, no certificate was found), *not complete*.
- **agree**: every sample of every family is singular in Pinocchio, and, where complete, everything
  that the sweep and the search from 300 random starts found lies on a family.

"""

REFUSED = {
    "follows one outside it": "fingers that all follow one joint outside the chain: nothing in the "
    "chain moves by itself; take the chain from farther in",
    "mimics joint": "the file lets a joint mimic one that does not exist",
    "has a <limit> without": "the file gives a revolute joint no range; `continuous` was meant, or "
    "numbers are missing",
}


def report(
    entries: list[dict[str, Any]], without: dict[str, str], seconds: tuple[float, float, float]
) -> str:
    """Return the report as Markdown."""
    text = HEAD.format(
        pinsing=version("pinsing"),
        data=version("example-robot-data"),
        pin=version("pin"),
        whole=seconds[0],
        analysis=seconds[1],
        proof=seconds[2],
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
        f"Of those analysed, {sum(e['agree'] for e in done)} agree; "
        f"{sum(e['families'] for e in done)} families, the "
        f"largest sigma_r / sigma_1 on any sample of them {max(e['worst'] for e in done):.0e}. "
        f"Median time {times[len(times) // 2]:.1f} s, slowest {times[-1]:.1f} s.",
        "",
        *_words(done),
    ]


def _words(done: list[dict[str, Any]]) -> list[str]:
    """How many chains of how many joints are proven, and what certificates cost."""
    lines = [
        "| joints | chains | proven | probable | not complete |",
        "|---|---:|---:|---:|---:|",
    ]
    groups = [("2 to 8", [e for e in done if e["joints"] <= 8])]
    groups += [(str(n), [e for e in done if e["joints"] == n]) for n in range(2, 10)]
    for name, chains in groups:
        if not chains:
            continue
        count = Counter(e["word"] for e in chains)
        share = f"{count['proven']} ({100 * count['proven'] / len(chains):.1f} %)"
        lines.append(
            f"| {name} | {len(chains)} | {share} | {count['probable']} | {count['not complete']} |"
        )
    proven = [e for e in done if e["word"] == "proven"]
    if proven:
        sizes = sorted(e["bytes"] for e in proven)
        checks = sorted(e["check_seconds"] for e in proven)
        middle = len(proven) // 2
        lines += [
            "",
            f"Certificates: median {sizes[middle] / 1e3:.1f} kB, largest {sizes[-1] / 1e3:.1f} kB; "
            f"checked in {1e3 * checks[middle]:.0f} ms (median), {checks[-1]:.2f} s at most; "
            f"{sum(x >= 100_000 for x in sizes)} of 100 kB or more, "
            f"{sum(x >= 1.0 for x in checks)} that took 1 s or more to check.",
        ]
    return lines


def _reasons(entries: list[dict[str, Any]], without: dict[str, str]) -> list[str]:
    lines = ["Not proven, each with its reason:", ""]
    for e in entries:
        if e["outcome"] != "done" or e["word"] == "proven":
            continue
        said = "; ".join([*e["gaps"], *([e["unproven"]] if e["unproven"] else [])])
        name = f"`{e['file']}` {e['tip']} from {e['base'] or 'root'}"
        lines.append(f"- {name} ({e['joints']} joints, {e['word']}): {_plain(said, e['file'])}")
    for e in entries:
        if e["outcome"] in ("killed", "crashed"):
            name = f"`{e['file']}` {e['tip']} from {e['base'] or 'root'}"
            lines.append(f"- {name}: {e['outcome']}, {_plain(e['reason'], e['file'])}")
    contrary = [e for e in entries if e["outcome"] == "done" and not e["agree"]]
    if contrary:
        lines += ["", "Do not agree:", ""]
        lines += [
            f"- `{e['file']}` {e['tip']} from {e['base'] or 'root'}: {'; '.join(e['problems'])}"
            for e in contrary
        ]
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


def _table(entries: list[dict[str, Any]]) -> list[str]:
    lines = []
    files: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for e in entries:
        files[e["file"]].append(e)
    for file, found in sorted(files.items()):
        lines += [
            f"### {file.removesuffix('.urdf').replace('_description/', ': ', 1)}",
            "",
            "| tip | base | joints | families (within limits) | word | kB, check ms | agree | s |",
            "|---|---|---:|---:|---|---|---|---:|",
        ]
        lines += [_row(e) for e in found]
        lines.append("")
    return lines


def _row(e: dict[str, Any]) -> str:
    ends = f"| {e['tip']} | {e['base'] or 'root'} |"
    if e["outcome"] != "done":
        return f"{ends} | {e['outcome']}: {_plain(e['reason'], e['file'])} | | | | |"
    proven = e["word"] == "proven"
    cost = f"{e['bytes'] / 1e3:.1f}, {1e3 * e['check_seconds']:.0f}" if proven else ""
    agree = "yes" if e["agree"] else "**NO**"
    return (
        f"{ends} {e['joints']} | {e['families']} ({e['reachable']}) | {e['word']} | {cost} | "
        f"{agree} | {e['wall']:.1f} |"
    )


def _plain(reason: str, file: str) -> str:
    text = re.sub(rf"^{re.escape(file)}:?", "", reason).strip()
    text = re.sub(r"^(\d+): ", r"line \1: ", text)
    return text.replace("|", "/").replace("<", "&lt;")
