"""YAML read strictly: every complaint names the file, the line and the key.

The document is composed by the safe loader and never built into objects, so that each value keeps
its line and its digits as written (``90`` degrees become the double nearest to pi/2, ``431.8``
millimetres the double 0.4318).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import yaml

from pinsing.description.xml_tree import read_bytes, show, suggestion
from pinsing.errors import RobotFileError


class Loader(yaml.SafeLoader):
    """Refuses what is nested more than 50 levels, as soon as it gets there."""

    _level = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Compose one value."""
        self._level += 1
        if self._level > 50:
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(problem="nested too deeply", problem_mark=mark)
        node = super().compose_node(parent, index)
        self._level -= 1
        return node


class QuickLoader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Builds plain values, by LibYAML where it is there, and refuses a key given twice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Any:
        """Construct one mapping."""
        taken = set()
        for key, _ in node.value:
            name = (key.tag, str(key.value))
            if name in taken:
                problem = f"key {show(name[1])} is given twice: remove one"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            taken.add(name)
        return super().construct_mapping(node, deep)


MAX_BYTES = 65536
"""The YAML reader takes up to 3 s for this much, and no table comes near it."""

_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?")
_OPERATOR = re.compile(r"\s*([*/])\s*")
_PI = Fraction(math.pi)


@dataclass(frozen=True)
class Number:
    """A number as written: ``value``, times pi where ``pi`` is true."""

    value: Fraction
    pi: bool = False

    def times(self, factor: Fraction | int = 1) -> float:
        """Return the double nearest to ``factor`` times this number (pi is ``math.pi``)."""
        return float(self.value * factor * (_PI if self.pi else 1))


def parse_number(text: str) -> Number | None:
    """Return a decimal number, ``pi``, or a product or quotient (``-pi/2``), or None; no eval."""
    text = text.strip()
    if len(text) > 80:
        return None
    value, pi = Fraction(-1 if text.startswith("-") else 1), False
    text = text[1:].lstrip() if text[:1] in ("-", "+") else text
    parts = _OPERATOR.split(text)
    for operator, factor in zip(["*", *parts[1::2]], parts[0::2], strict=True):
        if factor == "pi" and operator == "*" and not pi:
            pi = True
        elif _NUMBER.fullmatch(factor) and (operator == "*" or Fraction(factor)):
            value = value * Fraction(factor) if operator == "*" else value / Fraction(factor)
        else:
            return None
    return Number(value, pi)


@dataclass(frozen=True)
class YamlNode:
    """One value of a YAML file, with its place."""

    node: yaml.Node  # the value as composed
    path: Path  # the file
    # where in the document, in words ("row 3: alpha"); empty for the document itself
    label: str = ""

    @property
    def line(self) -> int:
        """Line of the file, counted from 1."""
        return int(self.node.start_mark.line) + 1

    def error(self, problem: str) -> RobotFileError:
        """Return the error that says what is wrong with this value."""
        return RobotFileError(
            f"{self.label}: {problem}" if self.label else problem, self.path, self.line
        )

    def refuse_if(self, wrong: object, problem: str) -> None:
        """Raise the error that says what is wrong with this value, if something is."""
        if wrong:
            raise self.error(problem)

    def _child(self, node: yaml.Node, label: str) -> YamlNode:
        child = YamlNode(node, self.path, f"{self.label}: {label}" if self.label else label)
        child.refuse_if(
            not node.tag.startswith("tag:yaml.org,2002:"),
            f"the YAML tag {node.tag[:60]} is not understood: write the plain value",
        )
        return child

    @property
    def _found(self) -> str:
        if isinstance(self.node, yaml.ScalarNode):
            return show(self.node.value) if self.node.value else "nothing"
        return "a list" if isinstance(self.node, yaml.SequenceNode) else "keys and values"

    def mapping(self, required: Iterable[str], optional: Iterable[str] = ()) -> dict[str, YamlNode]:
        """Return the values by key."""
        required, known = tuple(required), (*required, *optional)
        if not isinstance(self.node, yaml.MappingNode):
            raise self.error(f"expected the keys {', '.join(known)}, found {self._found}")
        values: dict[str, YamlNode] = {}
        for key_node, value_node in self.node.value:
            key = key_node.value if isinstance(key_node, yaml.ScalarNode) else "?"
            here = YamlNode(key_node, self.path, self.label)
            if key not in known:
                raise here.error(f"unknown key {show(key)}: {suggestion(key, known)}")
            if key in values:
                raise here.error(f"key {show(key)} is given twice: remove one")
            values[key] = self._child(value_node, key)
        self.require(values, required)
        return values

    def require(
        self, values: Mapping[str, YamlNode], required: Iterable[str], **hints: str
    ) -> None:
        """Raise the error that names all keys that are missing, and what some may be."""
        missing = [key for key in required if key not in values]
        add = "them" if len(missing) > 1 else "it"
        what = "; ".join(f"{key}: {hints[key]}" for key in missing if key in hints)
        self.refuse_if(
            missing,
            f"missing key {', '.join(map(repr, missing))}: add {add}{', ' * bool(what)}{what}",
        )

    @property
    def empty_list(self) -> bool:
        """True if this is a list without entries."""
        return isinstance(self.node, yaml.SequenceNode) and not self.node.value

    def keys(self) -> tuple[str, ...]:
        """Return the keys of a mapping as written, without judging them; empty otherwise."""
        if not isinstance(self.node, yaml.MappingNode):
            return ()
        return tuple(str(key.value) for key, _ in self.node.value)

    def items(self, noun: str, length: int | None = None) -> list[YamlNode]:
        """Return the entries of a list, labelled ``noun 1``, ``noun 2``, ..."""
        if not isinstance(self.node, yaml.SequenceNode):
            raise self.error(f"expected a list, found {self._found}")
        entries = self.node.value
        self.refuse_if(
            length is not None and len(entries) != length,
            f"expected a list of {length} values, found {len(entries)}",
        )
        self.refuse_if(not entries, "the list is empty: give at least one")
        return [self._child(entry, f"{noun} {i}") for i, entry in enumerate(entries, start=1)]

    def text(self) -> str:
        """Return the value as text."""
        if not isinstance(self.node, yaml.ScalarNode) or not self.node.value.strip():
            raise self.error(f"expected text, found {self._found}")
        return str(self.node.value).strip()

    def choice(self, options: Iterable[str]) -> str:
        """Return the value, which must be one of the options."""
        text, options = self.text(), tuple(options)
        if text not in options:
            raise self.error(f"unknown value {show(text)}: {suggestion(text, options)}")
        return text

    def number(self, factor: Fraction | int = 1, pi: int | None = None) -> float:
        """Return ``factor`` times the number, rounded once to a double.

        ``factor`` is the unit in SI units, ``pi`` the power of pi in it: 1 for degrees (``factor``
        = 1/180). With None or 1 the text may not hold ``pi``; with 0 (radians) it may.
        """
        text = self.node.value if isinstance(self.node, yaml.ScalarNode) else None
        number = parse_number(text) if text is not None else None
        if number is None:
            self.refuse_if(
                text is not None and text.lower().lstrip("+-.") in ("nan", "inf", "infinity"),
                f"{text} is not a finite number",
            )
            hint = " (or such as pi/2)" if pi == 0 else ""
            raise self.error(f"expected a number{hint}, found {self._found}")
        self.refuse_if(
            number.pi and pi != 0,
            f"{show(text or '')} holds pi, which only an angle in radians may: "
            "write a plain number in the unit of the table",
        )
        try:
            return Number(number.value, number.pi or pi == 1).times(factor)
        except OverflowError:
            raise self.error(f"{show(text or '')} is not a finite number") from None


def compose(path: str | Path) -> YamlNode:
    """Read a YAML file."""
    path = Path(path)
    try:
        text = read_bytes(path, MAX_BYTES, "YAML file").decode("utf-8-sig")
        node = yaml.compose(text, Loader=Loader)
    except UnicodeDecodeError:
        raise RobotFileError("is not UTF-8 text: give a YAML file", path) from None
    except yaml.YAMLError as error:
        raise RobotFileError(*yaml_problem(error, text, path)) from None
    if node is None:
        raise RobotFileError("is empty: nothing to read", path)
    return YamlNode(node, path)


def yaml_problem(error: yaml.YAMLError, text: str, file: Path) -> tuple[str, Path, int | None]:
    """Return what is no YAML in a text, its file, and its line."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    line = None if mark is None else mark.line + 1
    if isinstance(error, yaml.reader.ReaderError):
        line = text.count("\n", 0, error.position) + 1
    problem = getattr(error, "problem", None) or getattr(error, "reason", None) or error
    return f"not valid YAML: {problem}", file, line
