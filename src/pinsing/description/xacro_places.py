"""Where in which file xacro is: documents whose elements know their lines.

Runs in the xacro child process only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from xml.dom import expatbuilder, minidom

from pinsing.description.xacro_values import Refused


class RefusedAt(Refused):
    """Something refused at a known place."""

    def __init__(self, problem: str, file: str | None, line: int | None = None) -> None:
        self.file, self.line = file, line
        super().__init__(problem)


class Places:
    """Where in which file the expansion is: elements keep their file and lines."""

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}
        self.current: tuple[str, int, int] | None = None

    def enter(self, node: Any) -> tuple[str, int, int] | None:
        """Go to an element; return where the expansion was before."""
        before = self.current
        self.current = getattr(node, "place", None) or before
        return before

    def follow(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Wrap a function of an element; a failure leaves the place where it happened."""

        def followed(node: Any, *args: Any, **options: Any) -> Any:
            before = self.enter(node)
            result = function(node, *args, **options)
            self.current = before
            return result

        return followed


class Builder(expatbuilder.ExpatBuilderNS):
    """Builds a document whose elements know their place; refuses document types."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self.file = file

    def start_element_handler(self, name: str, attributes: Any) -> None:
        """Note the line at which an element starts."""
        super().start_element_handler(name, attributes)
        node: Any = self.curNode
        line = self.getParser().CurrentLineNumber
        node.place = (self.file, line, line)

    def end_element_handler(self, name: str) -> None:
        """Note the line at which an element ends."""
        node: Any = self.curNode
        super().end_element_handler(name)
        file, line, _ = node.place
        node.place = (file, line, self.getParser().CurrentLineNumber)

    def start_doctype_decl_handler(self, *_args: Any) -> None:
        """Refuse a document type."""
        raise RefusedAt(
            "document types and entities are not accepted: remove the <!DOCTYPE ...>, "
            "a robot description needs none",
            self.file,
            self.getParser().CurrentLineNumber,
        )


def keep_places() -> None:
    """Let copies of an element, as macros make them, know the place of the original."""
    clone = minidom._clone_node  # type: ignore[attr-defined]

    def placed(node: Any, deep: Any, owner: Any) -> Any:
        copy = clone(node, deep, owner)
        if hasattr(node, "place"):
            copy.place = node.place
        return copy

    minidom._clone_node = placed  # type: ignore[attr-defined]
