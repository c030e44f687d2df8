"""See it: an arm, its singular poses and its velocity ellipsoids, in a browser tab.

`Viewer` is imported when it is first asked for: a server can start, and a browser with it, before
the algebra and what draws are there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pinsing.view.viewer import Viewer

__all__ = ["Viewer"]


def __getattr__(name: str) -> Any:
    if name == "Viewer":
        from pinsing.view.viewer import Viewer

        return Viewer
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
