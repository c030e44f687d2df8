"""The reference of the JSON that results are written as, out of their classes."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator

from api_links import PLACES
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import pinsing
from pinsing.interface import JsonResult


class JsonSchemas(SphinxDirective):
    """A section for every schema: the class it belongs to, its keys, what they hold."""

    def run(self) -> list[nodes.Node]:
        """Make the sections."""
        sections: list[nodes.Node] = []
        for name, kind in sorted(schemas().items()):
            section = nodes.section(ids=[nodes.make_id(name)], names=[name])
            section += nodes.title(text=name)
            self.state.nested_parse(StringList(list(page(kind)), source=name), 0, section)
            self.state.document.note_explicit_target(section)
            sections.append(section)
        return sections


def schemas() -> dict[str, type[JsonResult]]:
    """Every result that is written as JSON, by its schema."""
    for module in pkgutil.walk_packages(pinsing.__path__, "pinsing."):
        if "_worker" not in module.name and not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    kinds = [JsonResult]
    for kind in kinds:
        kinds += kind.__subclasses__()
    return {kind.schema: kind for kind in kinds if "schema" in kind.__dict__}


def page(kind: type[JsonResult]) -> Iterator[str]:
    """Lines of Markdown about one schema."""
    doc = inspect.getdoc(kind) or ""
    place = PLACES.get(kind.__name__)
    name = f"{{py:class}}`{kind.__name__} <{place}>`" if place else kind.__name__
    yield from [f"{doc.partition(chr(10))[0]} ({name})", "", "| key | what it holds |", "|---|---|"]
    yield f'| `schema` | `"{kind.schema}"` |'
    words = described(doc)
    for field in dataclasses.fields(kind):  # type: ignore[arg-type]
        if field.metadata.get("json", True):
            yield f"| `{field.name}` | {words.get(field.name) or plain(field.type)} |"
    yield ""


def described(doc: str) -> dict[str, str]:
    """What a docstring's section Attributes or Parameters says of each name, in one line."""
    found: dict[str, list[str]] = {}
    names: list[str] = []
    parts = re.split(r"^(\w+)\n-{3,}\n", doc, flags=re.MULTILINE)
    for title, text in zip(parts[1::2], parts[2::2], strict=True):
        if title not in ("Attributes", "Parameters"):
            continue
        for line in text.splitlines():
            if line[:1].strip():
                head, _, kind = line.partition(" : ")
                names = [name.strip(" *") for name in head.split(",")]
                found |= {name: [f"{kind}."] if kind else [] for name in names}
            elif line.strip():
                for name in names:
                    found[name].append(line.strip())
    return {name: safe(" ".join(words)) for name, words in found.items()}


def plain(kind: object) -> str:
    """A type, as it stands in the source."""
    return f"`{kind}`".replace("|", "or")


def safe(words: str) -> str:
    """Text for a cell of a Markdown table."""
    words = re.sub(r"``([^`]+)``", r"`\1`", words)
    return re.sub(r"(?<!`)([|*<])(?!`)", r"\\\1", words)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_directive("json-schemas", JsonSchemas)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
