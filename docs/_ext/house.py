"""The picture of the house: packages on the floors that their imports put them on."""

from __future__ import annotations

import ast
import html
from functools import cache
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import pinsing

SOURCE = Path(pinsing.__file__).parent
ROOM, HEIGHT, GAP, WIDTH = 118, 34, 10, 760


def rooms() -> dict[str, set[str]]:
    """Packages, and loose modules without underscore, each with those that it imports."""
    found: dict[str, set[str]] = {}
    names = {p.name for p in SOURCE.iterdir() if (p / "__init__.py").exists()}
    for name in sorted(names):
        imported = set()
        for file in (SOURCE / name).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pinsing."):
                    imported.add((node.module or "").split(".")[1])
        found[name] = (imported & names) - {name}
    return found


def floors() -> list[list[str]]:
    """Names of the rooms, floor by floor from the ground."""
    below = rooms()

    @cache
    def floor(name: str) -> int:
        return 1 + max((floor(other) for other in below[name]), default=-1)

    levels = sorted({floor(name) for name in below})
    return [sorted(n for n in below if floor(n) == level) for level in levels]


def picture() -> str:
    """SVG of the house, the ground floor at the bottom."""
    levels = floors()
    height = len(levels) * (HEIGHT + GAP) + GAP
    parts = [
        f'<svg class="house" viewBox="0 0 {WIDTH} {height}" role="img" '
        f'aria-label="Packages of pinsing; each imports only what stands below it">'
    ]
    for level, names in enumerate(levels):
        y = height - (level + 1) * (HEIGHT + GAP)
        x = (WIDTH - len(names) * ROOM - (len(names) - 1) * GAP) / 2
        for name in names:
            parts.append(
                f'<g><rect x="{x:g}" y="{y}" width="{ROOM}" height="{HEIGHT}" rx="5"/>'
                f'<text x="{x + ROOM / 2:g}" y="{y + HEIGHT / 2 + 5}">{name}</text></g>'
            )
            x += ROOM + GAP
    return "\n".join([*parts, "</svg>"])


def purposes() -> list[tuple[str, str]]:
    """Each package, from the ground up, with the first line of its docstring."""
    found = []
    for name in (n for level in floors() for n in level):
        tree = ast.parse((SOURCE / name / "__init__.py").read_text(encoding="utf-8"))
        found.append((name, (ast.get_docstring(tree) or "").partition("\n")[0]))
    return found


class House(SphinxDirective):
    """The picture, and what each package is for."""

    def run(self) -> list[nodes.Node]:
        """Draw it from the imports as they are."""
        rows = "".join(
            f"<tr><td><code>{n}</code></td><td>{html.escape(text.replace('`', ''))}</td></tr>"
            for n, text in reversed(purposes())
        )
        table = f'<div class="table-wrapper"><table class="docutils">{rows}</table></div>'
        drawn = f'<div class="house">{picture()}</div>'
        return [nodes.raw("", drawn + table, format="html")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_directive("house", House)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
