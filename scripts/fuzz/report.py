"""How the cases of a fuzzing run ended, and the page that says so."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from dataclasses import dataclass

from fuzz.meshes import MESHES_EACH
from fuzz.targets import TARGETS

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
- A URDF number of ten million digits took minutes to read. It is refused, in less than a second.
- A page that asks for what there is not got all of its own message back; 60 characters now.
- YAML nested thousands of times took 5 s of the processor (DH tables, loop files, `load_yaml` of
  xacro). More than 50 levels are refused where they begin.
- Trajectories: a damaged NPY header ended in a traceback (`TokenError` of NumPy's own reader, which
  chunks and saved sweeps have as well), a damaged NPZ file in one of zlib, and an NPZ file could
  unpack to any size. All are read within bounds now.
- A certificate with a thousand empty relations took 16 s, and a reason for a rejection could be as
  long as the file. That was the checker of format 1, which is gone: the certificates of the table
  are of that format, and those of format 2 are fuzzed from now on.
- A flat xacro of thousands of elements took time by the square of their number.
"""


def report(outcomes: list[Outcome]) -> str:
    """The whole report, as Markdown."""
    later = sum(len(o.chain) > 1 for o in outcomes)
    return f"""# Fuzzing: broken input, and how each ended

Made by `scripts/fuzz --log LOG`, then `--of LOG --report docs/fuzz.md`: {_inputs(outcomes):,}
inputs in {len(outcomes):,} cases, all made from good ones, by seed. Each case has
{SECONDS:g} s of processor time and {MEMORY // 2**30} GiB. Python's trace function says which lines
of pinsing's readers, and of xacro, an input reaches (in the child processes as well); one that
reaches a new line is kept, and others are made from it by further changes: {later:,} of the cases.

- *urdf, xacro, dh, loops*: attributes dropped, numbers turned to nan, inf, 1e308, nothing or text;
  elements and lines removed, moved, doubled, renamed; joints hung into loops; expressions that
  fail, never end, or reach for the machine; wrong encodings, truncated and flipped bytes, 10 MB of
  one thing, deep nesting, rows and crowds of thousands of joints, entities of all kinds. Each goes
  through `pinsing list` (every fortieth URDF and xacro through `pinsing analyze` as well), `pinsing
  dh` and then `info`, or the loading and closing of a mechanism.
- *run*: folders of `pinsing map` and `sweep`: files cut, flipped, exchanged, removed, replaced by
  links, pipes, folders and 8 GiB of nothing, plans changed, chunks forged with a right digest. The
  same command must go on to the same bytes, or refuse.
- *expression*: xacro expressions out of a grammar. The value of an ordinary one must be that of
  Python; a wild one gives plain data, or is refused.
- *result*, *certificate*: JSON with values, keys and whole branches changed, removed, doubled,
  exchanged, and its text damaged. What `from_json` accepts must be written, read and shown again.
- *message*: what a page may send to its server; always one answer of strict JSON.
- *table*: trajectories as CSV, NPY and NPZ, and saved sweeps.
- *mesh*: {MESHES_EACH} files in a case (STL of both kinds, OBJ, PLY, OFF, Collada), read by the
  child process; their reader is C++, whose lines are not seen.

{table(outcomes)}

*result*: exit code 0 and an answer. *refused*: exit code 2, or an error of pinsing's own, and one
line that is printable and shorter than 2,000 characters. All other columns have to be zero
(the late one is a xacro file without end, stopped at the 12 s that it may have); a shorter, seeded
run is part of the tests. Ten cases that had no answer within 45 s on the clock, and two in which
the fuzzer itself failed, were run again by themselves; their outcomes of then are in the table.

## The commonest refusals of robot files

| cases | line |
|---:|---|
{reasons(outcomes, 40)}
{_FOUND}"""


def _inputs(outcomes: list[Outcome]) -> int:
    return sum(MESHES_EACH if o.kind == "mesh" else 1 for o in outcomes)
