"""How the cases of a fuzzing run ended, and the page that says so."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from dataclasses import dataclass

from fuzz_meshes import MESHES_EACH
from fuzz_targets import TARGETS

SECONDS = 10.0
MEMORY = 2 * 2**30
FILES = ("urdf", "xacro", "dh", "loops")
KINDS = (*FILES, "run", *TARGETS)
GOOD = ("result", "refused")


@dataclass(frozen=True)
class Outcome:
    """How a case ended: result, refused, or one of the ways that must not be.

    Attributes
    ----------
    chain : tuple of int
        Its seeds: the first made it, each further one changed it again.
    fresh : tuple of str
        Lines of the readers that it reached first.
    """

    kind: str
    chain: tuple[int, ...]
    outcome: str
    said: str
    seconds: float
    fresh: tuple[str, ...] = ()


def table(outcomes: list[Outcome]) -> str:
    """Counts by kind of file, as Markdown."""
    columns = [*GOOD, "traceback", "unclear", "late", "hang", "crash"]
    lines = [
        "| file | cases | " + " | ".join(columns) + " | slowest |",
        "|---|" + "---:|" * (len(columns) + 2),
    ]
    for kind in (*KINDS, "all"):
        chosen = [o for o in outcomes if kind in (o.kind, "all")]
        if chosen:
            count = Counter(o.outcome for o in chosen)
            slowest = max(o.seconds for o in chosen)
            cells = [str(count[c]) for c in columns]
            lines.append(f"| {kind} | {len(chosen)} | {' | '.join(cells)} | {slowest:.1f} s |")
    return "\n".join(lines)


def reasons(outcomes: list[Outcome], limit: int) -> str:
    """The commonest refusals, their names and numbers left out, as Markdown."""
    groups: dict[str, list[Outcome]] = defaultdict(list)
    for o in outcomes:
        if o.outcome == "refused" and o.kind in FILES:
            text = re.sub(r"^\S*/(arm|made)\.\w+(\.yaml)?(:\d+)?: ", "", o.said)
            text = re.sub(r"(\"|').*?\1|<[^>]*>|[-+]?\d[\d.e+-]*", "…", text).replace("|", "/")
            groups[text[:110]].append(o)
    common = sorted(groups.items(), key=lambda g: -len(g[1]))[:limit]
    return "\n".join(f"| {len(found)} | {text} |" for text, found in common)


_FOUND = """
## What was found, and mended

- A result out of JSON whose parts do not fit each other (rows too few, two names for three joints)
  was accepted, and failed when it was shown. `from_json` says so now.
- Refusals repeated whatever was in the JSON at any length. They quote 200 characters at most.
- A certificate whose families lack their names was accepted, and then could not be told of.
- A URDF number of ten million digits took minutes to read (the one hang in the table, on the
  version before). It is refused, in less than a second.
- A page that asks for what there is not got all of its own message back; 60 characters now.
"""


def report(outcomes: list[Outcome], seed: int) -> str:
    """The whole report, as Markdown."""
    return f"""# Fuzzing: broken input, and how each ended

Made by `scripts/fuzz.py --seed {seed} --report docs/fuzz.md`: {_inputs(outcomes):,} inputs in
{len(outcomes):,} cases, all made from good ones, by seed. Each case runs in a process with
{SECONDS:g} s of processor time and {MEMORY // 2**30} GiB.

- *urdf, xacro, dh, loops*: attributes dropped, numbers turned to nan, inf, 1e308, nothing or text;
  elements and lines removed, moved, doubled, renamed; joints hung into loops; expressions that
  fail, never end, or reach for the machine; wrong encodings, truncated and flipped bytes, 10 MB of
  one thing, deep nesting, rows and crowds of thousands of joints, entities of all kinds. Each goes
  through `pinsing info` (every eighth URDF and xacro through `pinsing analyze` as well), `pinsing
  dh` and then `info`, or the loading and closing of a mechanism.
- *run*: folders of `pinsing map` and `sweep`: files cut, flipped, exchanged, removed, replaced by
  links, pipes, folders and 8 GiB of nothing, plans changed, chunks forged with a right digest. The
  same command must go on to the same bytes, or refuse.
- *expression*: xacro expressions out of a grammar. The value of an ordinary one must be that of
  Python; a wild one gives plain data, or is refused.
- *result*, *certificate*: JSON with values, keys and whole branches changed, removed, doubled,
  exchanged, and its text damaged. What `from_json` accepts must be written, read and shown again.
- *message*: what a page may send to its server; always one answer of strict JSON.
- *mesh*: {MESHES_EACH} files in a case (STL of both kinds, OBJ, PLY, OFF, Collada), read by the
  child process.

{table(outcomes)}

*result*: exit code 0 and an answer. *refused*: exit code 2, or an error of pinsing's own, and one
line that is printable and shorter than 2,000 characters. All other columns have to be zero; a
shorter, seeded run is part of the tests.

## The commonest refusals of robot files

| cases | line |
|---:|---|
{reasons(outcomes, 40)}
{_FOUND}"""


def _inputs(outcomes: list[Outcome]) -> int:
    return sum(MESHES_EACH if o.kind == "mesh" else 1 for o in outcomes)
