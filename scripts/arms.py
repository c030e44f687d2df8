#!/usr/bin/env python3
"""Write docs/arms.md, the arms known by name with their families, and docs/certificates.zip.

Takes about five minutes. In the archive are the certificates of all families, an arm a file.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import pinsing
from pinsing.description.catalog import known_arms
from pinsing.families.certificate import text_of

PAGE = Path(__file__).resolve().parents[1] / "docs" / "arms.md"
ARCHIVE = PAGE.with_name("certificates.zip")
HEAD = """# Arms by name

Made by `scripts/arms.py`; `urdf/arms.yaml` has the tables, limits and sources. "List" says how
the list of families is shown to be complete; the certificates are in
[one archive](certificates.zip), to be checked by `pinsing verify *.json`, or one by one without
pinsing by `python checker.py FILE.json` (of `src/pinsing/proof`). Aspects are regions without
singularities; a cuspidal arm can change posture within one. Both are without joint limits.

|name|arm|joints|reach [m]|known for|families|list|aspects|cuspidal|
|---|---|---:|---:|---|---|---|---:|---|
"""


def row(name: str, archive: zipfile.ZipFile) -> str:
    """Return the row of one arm, and put its certificate into the archive."""
    known = known_arms()[name]
    arm = pinsing.load(name)
    form = pinsing.closed_form(arm)
    proof = form.proof
    if proof is not None and proof.certificate is not None:
        # a fixed date: the same certificates make the same archive
        member = zipfile.ZipInfo(f"{name}.json", (2026, 1, 1, 0, 0, 0))
        archive.writestr(member, text_of(proof.certificate) + "\n", zipfile.ZIP_DEFLATED)
    named = ", ".join(f.title for f in form.families if f.title)
    families = f"{len(form.families)}{named and ': ' + named}"
    aspects = pinsing.aspects(form, limits=False)
    regions = str(aspects.lower) if aspects.proven else f"{aspects.lower} or more"
    cuspidal = ""
    if arm.n == form.generic_rank:
        found = pinsing.cuspidality(arm, forms=form, poses=20)
        cuspidal = {"cuspidal": "yes", "not cuspidal": "no"}.get(found.answer, "no evidence")
    title, reach = f"{known['maker']} {known['model']}", f"{known['reach']:.2f}"
    cells = (name, title, arm.n, reach, known["known_for"], families, form.word)
    return "|" + "|".join(map(str, (*cells, regions, cuspidal))) + "|\n"


if __name__ == "__main__":
    with zipfile.ZipFile(ARCHIVE, "w") as archive:
        rows = "".join(row(name, archive) for name in sorted(known_arms()))
    PAGE.write_text(HEAD + rows, encoding="utf-8")
