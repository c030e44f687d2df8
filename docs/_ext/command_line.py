"""The reference of the command line, out of the program itself."""

from __future__ import annotations

import re
from collections.abc import Iterator

import click
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from pinsing.cli.app import COMMANDS, VARIANTS, command_of


class CommandLine(SphinxDirective):
    """A section for every command of ``pinsing``: what it does, how it is called, its options."""

    def run(self) -> list[nodes.Node]:
        """Make the sections."""
        sections: list[nodes.Node] = []
        for name in (*COMMANDS, *VARIANTS):
            section = nodes.section(
                ids=[f"pinsing-{name.replace(' --', '-')}"], names=[f"pinsing {name}"]
            )
            section += nodes.title(text=f"pinsing {name}")
            lines = StringList(list(page(name, command_of(name))), source=name)
            self.state.nested_parse(lines, 0, section)
            self.state.document.note_explicit_target(section)
            sections.append(section)
        return sections


def page(name: str, part: click.Command) -> Iterator[str]:
    """Lines of Markdown about one command."""
    context = click.Context(
        part, info_name=f"pinsing {name}", max_content_width=90, terminal_width=90
    )
    context.meta["all options"] = True
    help_text = click.unstyle(part.get_help(context))
    usage, _, rest = help_text.partition("\n\n")
    words, _, options = rest.partition("\nOptions:\n")
    yield from ["```text", usage.removeprefix("Usage: "), "```", ""]
    for paragraph in re.split(r"\n\s*\n", words.strip("\n")):
        lines = [line[2:] for line in paragraph.splitlines()]
        example = re.fullmatch(r"Example: (pinsing .*)", " ".join(lines))
        if example:
            yield from ["```console", f"$ {example[1]}", "```", ""]
        elif any(line.startswith("  ") or "   " in line for line in lines):
            yield from ["```text", *lines, "```", ""]
        else:
            yield from [re.sub(r"`([^`]+)`", r"`\1`", " ".join(lines)), ""]
    yield from ["```text", *(line[2:] for line in options.splitlines()), "```", ""]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_directive("command-line", CommandLine)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
