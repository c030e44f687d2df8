"""Meshcat's drawing commands, without the half of its import that only notebooks need.

``import meshcat`` brings IPython, for the one class ``IPython.display.HTML`` that two of its
methods return. A browser waits meanwhile, so that class is found when one of them is called.
"""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Iterable
from types import ModuleType
from typing import Any

import umsgpack


def _html(*args: Any, **kwargs: Any) -> Any:
    return importlib.import_module("IPython.display").HTML(*args, **kwargs)


def _import_meshcat() -> Any:
    if "IPython" in sys.modules or "meshcat" in sys.modules:
        return importlib.import_module("meshcat")
    package, display = ModuleType("IPython"), ModuleType("IPython.display")
    package.display, display.HTML = display, _html  # type: ignore[attr-defined]
    stand_ins = {module.__name__: module for module in (package, display)}
    sys.modules.update(stand_ins)
    try:
        return importlib.import_module("meshcat")
    finally:
        for name, module in stand_ins.items():
            if sys.modules.get(name) is module:
                del sys.modules[name]


meshcat: Any = _import_meshcat()
geometry: Any = meshcat.geometry


_SHAPES = re.compile(r"/arm/\d+/visual/")


class Recorder:
    """Takes what `meshcat.Visualizer` sends.

    Attributes
    ----------
    commands : list of (str, bytes)
        Where each draws, and the command as msgpack, in order, as meshcat's page reads them.
    """

    def __init__(self) -> None:
        self.commands: list[tuple[str, bytes]] = []

    def send(self, command: Any) -> None:
        """Keep a command."""
        lowered = command.lower()
        self.commands.append((str(lowered.get("path", "")), umsgpack.packb(lowered)))

    def visualizer(self) -> Any:
        """A meshcat visualizer at the root that draws into this recorder."""
        return meshcat.Visualizer.view_into(self, meshcat.path.Path(()))

    def packed(self) -> bytes:
        """All commands, each after its length as 4 bytes, little endian."""
        return _packed(command for _, command in self.commands)

    def parts(self) -> tuple[bytes, bytes]:
        """The same in two: what can be shown at once, and the shapes of links, which are large."""
        shapes = [_SHAPES.search(path) is not None for path, _ in self.commands]
        each = list(zip(shapes, self.commands, strict=True))
        return (
            _packed(command for shape, (_, command) in each if not shape),
            _packed(command for shape, (_, command) in each if shape),
        )


def _packed(commands: Iterable[bytes]) -> bytes:
    return b"".join(len(c).to_bytes(4, "little") + c for c in commands)
