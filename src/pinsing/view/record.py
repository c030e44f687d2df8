"""A stand-in for meshcat's window that keeps the drawing commands, and needs no server."""

from __future__ import annotations

from typing import Any

import meshcat
import umsgpack
from meshcat.path import Path


class Recorder:
    """Takes what `meshcat.Visualizer` sends.

    Attributes
    ----------
    commands : list of bytes
        The commands as msgpack, in order, as meshcat's page reads them.
    """

    def __init__(self) -> None:
        self.commands: list[bytes] = []

    def send(self, command: Any) -> None:
        """Keep a command."""
        self.commands.append(umsgpack.packb(command.lower()))

    def visualizer(self) -> Any:
        """A meshcat visualizer at the root that draws into this recorder."""
        return meshcat.Visualizer.view_into(self, Path(()))

    def packed(self) -> bytes:
        """All commands, each after its length as 4 bytes, little endian."""
        return b"".join(len(c).to_bytes(4, "little") + c for c in self.commands)
