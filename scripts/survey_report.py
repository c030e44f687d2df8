"""The table of the survey, out of its results."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from importlib.metadata import version
from typing import Any

HEAD = """# Survey: every chain of every robot in example-robot-data

Made by `scripts/survey.py` with pinsing {pinsing}, example-robot-data {data}, Pinocchio {pin}; each
chain in a process of its own, {whole:g} s at most on the clock, of which {search:g} s for the
search for families, and {proof:g} s of processor time for that for a certificate. Chains of 2 to
9 joints that end in a leaf or a tool frame, from the root and from the last branching before the
end (from every branching, where the whole is longer). The task is the pose.

- **families**: families of singular configurations, whether joint limits let them through or not.
- **word**: *proven* (a certificate that the independent checker accepts; its size, and the
  processor time of the check), *probable* (the search ended, no certificate was found), *not
  complete*, *not tried*.
- "as ..." is a chain of the same exact geometry as the named one, whose certificate holds for it.

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
        search=seconds[1],
        proof=seconds[2],
    )
    return text + "\n".join([*_numbers(entries), "", *_reasons(entries, without), *_table(entries)])


def _numbers(entries: list[dict[str, Any]]) -> list[str]:
    done = [e for e in entries if e["outcome"] == "done"]
    outcome = Counter(e["outcome"] for e in entries)
    alike = [e for e in done if e.get("same_as")]
    loads = sorted(e["load"] for e in done if "load" in e)
    lines = [
        f"{len(entries)} chains of {len({e['file'] for e in entries})} files: "
        f"{len(done)} searched, {len(alike)} of them by a chain of the same geometry; "
        f"{outcome['refused']} refused with a reason, {outcome['killed']} out of time, "
        f"{outcome['crashed']} crashed, {outcome['not tried']} not tried."
    ]
    if loads:
        lines[0] += f" Load of the machine meanwhile: {loads[0]:g} to {loads[-1]:g}."
    held = [e for e in done if "agree" in e]
    if held:
        lines.append(
            f"Held against Pinocchio: {len(held)}, of which {sum(e['agree'] for e in held)} agree; "
            f"the largest sigma_r / sigma_1 on any sample {max(e['worst'] for e in held):.0e}."
        )
    return [*lines, "", *_words(done)]


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
    contrary = [e for e in entries if not e.get("agree", True)]
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
            f"## {file.removesuffix('.urdf').replace('_description/', ': ', 1)}",
            "",
            "| tip | base | joints | families | word | kB | check, ms |",
            "|---|---|---:|---:|---|---:|---:|",
        ]
        lines += [_row(e) for e in found]
        lines.append("")
    return lines


def _row(e: dict[str, Any]) -> str:
    ends = f"| {e['tip']} | {e['base'] or 'root'} |"
    if e["outcome"] != "done":
        said = f"{e['outcome']}: {_plain(e['reason'], e['file'])}"
        return f"{ends} {e.get('joints', '')} | | {said} | | |"
    word = e["word"]
    if e.get("same_as"):
        return f"{ends} {e['joints']} | {e['families']} | {word}, as {e['same_as']} | | |"
    cost = f"{e['bytes'] / 1e3:.1f} | {1e3 * e['check_seconds']:.0f}" if e["bytes"] else "|"
    return f"{ends} {e['joints']} | {e['families']} | {word} | {cost} |"


def _plain(reason: str, file: str) -> str:
    text = re.sub(rf"^{re.escape(file)}:?", "", reason).strip()
    text = re.sub(r"^(\d+): ", r"line \1: ", text)
    return text.replace("|", "/").replace("<", "&lt;")
