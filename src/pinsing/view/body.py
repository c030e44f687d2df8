"""What can be drawn: a tree of joints with links, be it an arm or a mechanism."""

from __future__ import annotations

from typing import Any, Protocol

import pinocchio as pin

from pinsing._types import Array
from pinsing.robot.source import Source


class Body(Protocol):
    """The part of an arm that drawing needs; a mechanism fulfils it by way of `Linkage`."""

    @property
    def model(self) -> pin.Model:
        """The tree of joints, from the base on."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that can be moved."""

    @property
    def tip_id(self) -> int:
        """Index, in ``model.frames``, of the frame whose motion counts."""

    @property
    def span(self) -> tuple[Array, Array]:
        """Finite limits, lower and upper (n,), radians and metres."""

    @property
    def known(self) -> dict[str, Any]:
        """What was computed of it before."""

    @property
    def source(self) -> Source:
        """Where it comes from."""

    @property
    def base(self) -> str:
        """Frame that it is seen from; ``universe`` for the root."""
