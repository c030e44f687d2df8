"""Compare what two installations say of the arms of docs/closed_forms.md.

    python scripts/bench/same_answers.py --write FOLDER      with what stood before
    python scripts/bench/same_answers.py --against FOLDER    with what stands now

``--write`` puts the text, the LaTeX and the JSON of each arm's closed form into a folder, without
times. ``--against`` makes them again and prints each line of text and each value of the JSON that
differs; numbers count as equal within 1e-9 of their size. It ends with 1 if anything differs, and
says how large the greatest difference of a number was. Proofs are not looked for here: they have
their own checker.
"""

from __future__ import annotations

import argparse
import difflib
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
from closed_form import ARMS

from pinsing.families import ClosedForm, closed_form
from pinsing.families.form import families_text
from pinsing.robot.load import load

_EQUAL = 1e-9
_SECONDS = 120.0
_TIMES = ("seconds",)


def answer(name: str) -> dict[str, Any]:
    """Text, LaTeX and JSON of one arm's closed form, without times."""
    form: ClosedForm = closed_form(load(**ARMS[name]), seconds=_SECONDS, prove=False)
    data = json.loads(form.to_json())
    for key in _TIMES:
        data.pop(key, None)
    text = re.sub(r"\d+ ms\b", "a time", families_text(form)).splitlines()
    return {"text": text, "latex": form.latex(legend=True, exact=True).splitlines(), "json": data}


def differences(before: Any, now: Any, where: str = "") -> Iterator[tuple[str, float]]:
    """Places of two JSON values that differ, with the size of the difference; inf for no number."""
    if isinstance(before, bool) or isinstance(now, bool):
        if before is not now:
            yield f"{where}: {before} became {now}", float("inf")
    elif isinstance(before, int | float) and isinstance(now, int | float):
        apart = abs(before - now)
        if apart:
            size = apart / max(abs(before), abs(now), 1.0)
            yield f"{where}: {before!r} became {now!r}", size
    elif isinstance(before, dict) and isinstance(now, dict) and before.keys() == now.keys():
        for key in before:
            yield from differences(before[key], now[key], f"{where}.{key}")
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for i, (b, n) in enumerate(zip(before, now, strict=True)):
            yield from differences(b, n, f"{where}[{i}]")
    elif before != now:
        yield f"{where}: {str(before)[:160]} became {str(now)[:160]}", float("inf")


def main() -> int:
    """Write or compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--write", type=Path, metavar="FOLDER")
    what.add_argument("--against", type=Path, metavar="FOLDER")
    parser.add_argument("arms", nargs="*", metavar="ARM", help="some of them, by a part of a name")
    chosen = parser.parse_args()
    names = [n for n in ARMS if not chosen.arms or any(a in n for a in chosen.arms)]
    wrong, greatest = 0, 0.0
    for name in names:
        now = answer(name)
        file = (chosen.write or chosen.against) / f"{name.replace(' ', '_').replace(',', '')}.json"
        if chosen.write:
            chosen.write.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(now, indent=1), encoding="utf-8")
            continue
        before = json.loads(file.read_text(encoding="utf-8"))
        said: list[str] = []
        for part in ("text", "latex"):
            said += [
                line
                for line in difflib.unified_diff(before[part], now[part], lineterm="", n=0)
                if not line.startswith(("---", "+++", "@@"))
            ]
        for place, size in differences(before["json"], json.loads(json.dumps(now["json"]))):
            if size > _EQUAL:
                said.append(place)
            else:
                greatest = max(greatest, size)
        wrong += bool(said)
        print(f"{name}: {'same' if not said else 'differs'}")
        for line in said:
            print(f"    {line}")
    if chosen.against:
        print(f"{len(names) - wrong} of {len(names)} the same; numbers within {greatest:.1e}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
