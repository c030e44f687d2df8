"""The safe YAML loader, with an end to nesting: PyYAML takes seconds for thousands of levels.

The xacro child process loads this module by its folder.
"""

from __future__ import annotations

from typing import Any

import yaml

DEEPEST = 50


class NestedError(yaml.MarkedYAMLError):
    """Lists or keys within each other, more than any table needs."""


class Loader(yaml.SafeLoader):
    """Refuses what is nested more than `DEEPEST` levels, as soon as it gets there."""

    _level = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Compose one value."""
        self._level += 1
        if self._level > DEEPEST:
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise NestedError(problem="nested too deeply", problem_mark=mark)
        node = super().compose_node(parent, index)
        self._level -= 1
        return node
