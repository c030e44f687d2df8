#!/usr/bin/env python3
"""Write docs/arms.md: the arms known by name with their families; takes about five minutes."""

from __future__ import annotations

from pathlib import Path

import pinsing
from pinsing.description.catalog import known_arms

PAGE = Path(__file__).resolve().parents[1] / "docs" / "arms.md"
HEAD = """# Arms by name

Made by `scripts/arms.py`; `urdf/arms.yaml` has the tables, limits and sources. "List" says how
the list of families is shown to be complete. Aspects are regions without singularities; a cuspidal
arm can change posture within one. Both are without joint limits.

|name|arm|joints|reach [m]|known for|families|list|aspects|cuspidal|
|---|---|---:|---:|---|---:|---|---:|---|
"""


def row(name: str) -> str:
    """Return the row of one arm."""
    known = known_arms()[name]
    arm = pinsing.load(name)
    form = pinsing.closed_form(arm)
    aspects = pinsing.aspects(form, limits=False)
    regions = str(aspects.lower) if aspects.proven else f"{aspects.lower} or more"
    cuspidal = ""
    if arm.n == form.generic_rank:
        found = pinsing.cuspidality(arm, forms=form, poses=20)
        cuspidal = {"cuspidal": "yes", "not cuspidal": "no"}.get(found.answer, "no evidence")
    title, reach = f"{known['maker']} {known['model']}", f"{known['reach']:.2f}"
    cells = (name, title, arm.n, reach, known["known_for"], len(form.families), form.word)
    return "|" + "|".join(map(str, (*cells, regions, cuspidal))) + "|\n"


if __name__ == "__main__":
    PAGE.write_text(HEAD + "".join(map(row, sorted(known_arms()))), encoding="utf-8")
