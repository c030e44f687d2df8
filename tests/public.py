"""What is public: the names that the reference of the Python interface documents; scripts."""

import importlib
import re
import sys
from pathlib import Path
from typing import Any

from pinsing import plot

ROOT = Path(__file__).parents[1]
SCRIPTS = ROOT / "scripts"
REFERENCE = ROOT / "docs" / "reference" / "api.md"


def script(name: str) -> Any:
    """A module below ``scripts/``."""
    sys.path.insert(0, str(SCRIPTS))
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(SCRIPTS))


def documented() -> dict[str, Any]:
    """Functions and classes by name; those that draw as ``plot.NAME``."""
    found: dict[str, Any] = {}
    package = ""
    for directive, name in re.findall(r"^\.\. (\w+):: ([\w.]+)$", REFERENCE.read_text(), re.M):
        if directive == "currentmodule":
            package = name
        elif directive != "automodule":
            found[name] = getattr(importlib.import_module(package), name)
    return found | {f"plot.{name}": getattr(plot, name) for name in plot.__all__}
