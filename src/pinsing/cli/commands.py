"""The commands by name: each is imported when it is called, and not for another one or the list."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, MutableMapping

import click

COMMANDS: dict[str, tuple[str, str]] = {
    "info": ("robots", "What pinsing makes of a robot, before any analysis."),
    "analyze": ("singularities", "Find all singular configurations."),
    "at": ("at", "Everything about one configuration."),
    "check": ("check", "Whether a trajectory meets or nears singularities."),
    "path": (
        "path",
        "The joint path through a toolpath that stays farthest from them.",
    ),
    "line": ("line", "Whether the tip can follow a straight line (MoveL)."),
    "suggest": ("suggest", "A configuration far from all singular ones."),
    "aspects": ("postures", "The pieces that singularities cut joint space into."),
    "postures": ("postures", "The other postures of a pose, and ways to them."),
    "cuspidal": ("postures", "Whether the arm changes posture without a singularity."),
    "export": ("export", "A guard for a control loop, in C or Python."),
    "sweep": ("singularities", "The joint-angle parameterization method."),
    "map": ("map", "Singular values over a grid or sample of any size."),
    "families": ("families", "All families as equations."),
    "verify": ("families", "Check certificates."),
    "view": ("view", "See singular poses and velocity ellipsoids in a browser."),
    "plot": ("plot", "Curves, maps and ellipsoids as PNG, SVG or PDF."),
    "report": ("report", "One file that explains it all, to send on."),
    "dh": ("robots", "DH table to URDF."),
    "list": ("robots", "Robots known by name."),
}
"""Module of `pinsing.cli` that holds the function NAME_command, and what it is for in a line."""


class Commands(MutableMapping[str, click.Command]):
    """`COMMANDS` as click wants them, imported when looked at."""

    def __init__(self) -> None:
        self._found: dict[str, click.Command | None] = dict.fromkeys(COMMANDS)

    def __getitem__(self, name: str) -> click.Command:
        found = self._found[name]
        if found is None:
            place, short = COMMANDS[name]
            module = importlib.import_module(f"pinsing.cli.{place}")
            found = self._found[name] = getattr(module, f"{name}_command")
            found.short_help = short
        return found

    def __setitem__(self, name: str, command: click.Command) -> None:
        self._found[name] = command

    def __delitem__(self, name: str) -> None:
        del self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)
