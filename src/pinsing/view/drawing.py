"""Meshcat's drawing commands, without the half of its import that only notebooks need.

``import meshcat`` brings IPython, for the one class ``IPython.display.HTML`` that two of its
methods return. A browser waits meanwhile, so that class is found when one of them is called.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import Any


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
