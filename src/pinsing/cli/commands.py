"""The commands by name: each is imported when it is called, and not for another one or the list."""

from __future__ import annotations

import importlib
import itertools
import os
from collections.abc import Iterator, MutableMapping, Sequence

import click

COMMANDS: dict[str, tuple[str, str]] = {
    "families": ("families", "Find all families of singular configurations."),
    "at": ("at", "Analyze one configuration, or suggest one (--suggest)."),
    "check": ("check", "Check a trajectory for singularities."),
    "path": ("path", "Find the joint path of a toolpath with the largest clearance."),
    "zones": ("zones", "Find how near to singularities tip speeds are kept."),
    "line": ("line", "Check a straight line of the tip (MoveL)."),
    "postures": ("postures", "List the other postures of a pose, or the aspects of an arm."),
    "analyze": ("singularities", "Cross-check the families with a sweep of the joints (--sweep)."),
    "map": ("map", "Compute singular values over a grid or sample."),
    "view": ("view", "Show singular poses and velocity ellipsoids in a browser."),
    "plot": ("plot", "Draw curves, maps and ellipsoids."),
    "report": ("report", "Write a self-contained report."),
    "export": ("export", "Export a guard as C or Python, or a DH table as URDF."),
    "verify": ("families", "Check certificates."),
    "list": ("robots", "List the known robots, or show how one is interpreted."),
}
"""Module of `pinsing.cli` that holds the function NAME_command, and what it is for in a line."""

VARIANTS = {
    "analyze --sweep": ("singularities", "sweep"),
    "at --suggest": ("suggest", "suggest"),
    "postures --aspects": ("postures", "aspects"),
    "postures --cuspidal": ("postures", "cuspidal"),
    "export --urdf": ("robots", "dh"),
    "list --info": ("robots", "info"),
}
"""Flags that make a command answer a related question: module, and NAME of NAME_command."""

RENAMED = {
    "info": "list ROBOT",
    "sweep": "analyze ROBOT --sweep",
    "suggest": "at ROBOT --suggest",
    "aspects": "postures ROBOT --aspects",
    "cuspidal": "postures ROBOT --cuspidal",
    "dh": "export TABLE.dh.yaml -o ROBOT.urdf",
}
"""What to type instead of commands that there are no more."""


def variant_of(name: str, words: Sequence[str]) -> tuple[str, list[str]]:
    """Return the command that these words ask for, and the words that are left."""
    for variant in VARIANTS:
        command, flag = variant.split()
        if command == name and flag in words:
            return variant, [word for word in words if word != flag]
    if name == "export" and _written(words).lower().endswith(".urdf"):
        return "export --urdf", list(words)
    if name == "list" and words and _is_robot(words[0]):
        return "list --info", list(words)
    asks = any(word in ("-h", "--help", "--help-all") for word in words)
    if name == "postures" and words and not asks and not any(w.startswith("--q") for w in words):
        return "postures --aspects", list(words)
    return name, list(words)


def _written(words: Sequence[str]) -> str:
    """The file after ``-o``."""
    return next((b for a, b in itertools.pairwise(words) if a in ("-o", "--output")), "")


def _is_robot(word: str) -> bool:
    """Return True if a word names one robot: a file, or a name in full."""
    if word.startswith("-") or word.endswith(":"):
        return False
    if os.sep in word or os.path.isfile(word):
        return True
    from pinsing.description.catalog import described_entries, known_robots

    if word.startswith("rd:"):
        return any(word == entry.name for entry in described_entries())
    return word in known_robots()


class Commands(MutableMapping[str, click.Command]):
    """`COMMANDS` as click wants them, imported when looked at; `VARIANTS` as well, by name."""

    def __init__(self) -> None:
        self._found: dict[str, click.Command | None] = dict.fromkeys(COMMANDS)

    def __getitem__(self, name: str) -> click.Command:
        found = self._found.get(name)
        if found is None:
            place, called = VARIANTS.get(name) or (COMMANDS[name][0], name)
            module = importlib.import_module(f"pinsing.cli.{place}")
            found = getattr(module, f"{called}_command")
            if name in COMMANDS:
                self._found[name] = found
                found.short_help = COMMANDS[name][1]
        return found

    def __setitem__(self, name: str, command: click.Command) -> None:
        self._found[name] = command

    def __delitem__(self, name: str) -> None:
        del self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)
