"""Documents of xacro whose elements know their lines; errors in one line with their place.

Runs in the xacro child process only.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from itertools import pairwise
from typing import Any
from xml.dom import Node, expatbuilder, minidom
from xml.dom.minicompat import NodeList
from xml.parsers import expat

from pinsing.description.xacro_expression import Refused


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


_QUOTED = re.compile(r"'([^'\n]+)'|\"([^\"\n]+)\"")
_LONGEST_SHOWN = 120


def explain(error: BaseException, xacro: Any, places: Places) -> dict[str, Any]:
    """Turn an exception into problem, file and line."""
    errors = causes(error)
    stack = xacro.macrostack or []  # innermost last, with the file that defines each macro
    macro = stack[-1].history[-1][-1] if stack and stack[-1].history else None
    files = [*dict.fromkeys(f for f in (macro, (xacro.filestack or [None])[-1]) if f)]
    problem = ""
    for found in errors:
        if isinstance(found, expat.ExpatError):
            problem = f"is not well-formed XML: {expat.ErrorString(found.code)}"
            return {"problem": problem, "file": files[-1] if files else None, "line": found.lineno}
        if isinstance(found, RefusedAt):
            return {"problem": str(found), "file": found.file, "line": found.line}
        if isinstance(found, Refused):
            problem = str(found)
        elif isinstance(found, RecursionError):
            problem = "macros, includes or elements without end (nested too deeply)"
        elif isinstance(found, MemoryError):
            problem = "an expression needs too much memory"
        elif isinstance(found, OSError) and found.filename:
            problem = f"cannot open {found.filename}: {found.strerror}"
    if not problem:
        problem = " ".join(str(errors[-1]).split()) or type(errors[-1]).__name__
    suffixes = [" ".join(str(getattr(e, "suffix", None) or "").split()) for e in errors]
    expressions = [suffix for suffix in suffixes if suffix]
    if expressions and expressions[-1] not in problem:
        problem += " " + _cut(expressions[-1])
    wanted = needles(" ".join([str(e) for e in errors] + [problem]), error)
    file, line = locate(files, wanted, places)
    return {"problem": f"xacro: {problem}", "file": file, "line": line}


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 4] + "...'"


def causes(error: BaseException) -> list[BaseException]:
    """Return an error and what caused it, outermost first (xacro keeps causes in ``exc``)."""
    errors: list[BaseException] = []
    current: BaseException | None = error
    while current is not None and current not in errors:
        errors.append(current)
        current = getattr(current, "exc", None) or current.__cause__
    return errors


def needles(message: str, error: BaseException) -> list[str]:
    """Return what to look for in the source to find the line that a message speaks of."""
    expressions = re.findall(r"evaluating expression '([^\n]*?)'(?:\s|$)", message)
    found = [start + text for text in expressions for start in ("${", "$(eval ")]
    names = re.findall(r"unknown macro name: xacro:(\S+)", message)
    names += [macro.body.getAttribute("name") for macro in getattr(error, "macros", [])]
    found += [f"<xacro:{name}{end}" for name in names for end in " />"]
    found += [
        f"$({command} {name})" for name in _texts(message) for command in ("arg", "find", "env")
    ]
    found += [os.path.basename(m) for m in re.findall(r"cannot open (\S+):", message)]
    return [n for n in found + _texts(message) if n]


def _texts(message: str) -> list[str]:
    return [a or b for a, b in _QUOTED.findall(message)]


def locate(files: list[str], wanted: list[str], places: Places) -> tuple[str | None, int | None]:
    """Return file and line of the first wanted text that stands on one line only.

    A text that occurs twice is looked for in the element that was being expanded, the one that
    occurs nowhere stands for that element.
    """
    current = places.current
    for needle in wanted:
        for file in files:
            lines = places.texts.get(file, "").splitlines()
            hits = [i for i, line in enumerate(lines, 1) if needle in line]
            if len(hits) == 1:
                return file, hits[0]
            if current is not None and file == current[0]:
                inside = [i for i in hits if current[1] <= i <= current[2]]
                if inside:
                    return file, inside[0]
    if current is not None:
        return current[0], current[1]
    return (files[-1] if files else None), None


_CHILDREN = frozenset(
    [Node.ELEMENT_NODE, Node.TEXT_NODE, Node.COMMENT_NODE, Node.CDATA_SECTION_NODE]
)


def replaces(slow: Callable[..., None]) -> Callable[..., None]:
    """Return what does the same as xacro's ``replace_node``, in one step for all children.

    xacro inserts children one by one, and each time minidom looks for the place from the first
    child on: half of the time of a file with some hundred links.
    """

    def replace_node(node: Any, by: Any, content_only: bool = False) -> None:
        parent = node.parentNode
        if by is None:
            sources: list[Any] = []
        else:
            sources = list(by) if isinstance(by, list) else [by]
        new = [c for s in sources for c in s.childNodes] if content_only else sources
        plain = isinstance(parent, minidom.Element) and (content_only or node not in new)
        if not plain or any(child.nodeType not in _CHILDREN for child in new):
            slow(node, by, content_only)
            return
        for child in new:
            if not content_only and child.parentNode is not None:
                child.parentNode.removeChild(child)
        if content_only:
            for source in sources:
                source.childNodes = NodeList()
        at = parent.childNodes.index(node)
        before, after = node.previousSibling, node.nextSibling
        parent.childNodes[at : at + 1] = new
        chain = [before, *new, after]
        for child in new:
            child.parentNode = parent
        for one, two in pairwise(chain):
            if one is not None:
                one.nextSibling = two
            if two is not None:
                two.previousSibling = one
        node.nextSibling = node.previousSibling = node.parentNode = None

    return replace_node
