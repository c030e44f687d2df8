"""What all checks of a URDF share: errors at their line, numbers, and notes that are counted."""

from __future__ import annotations

import math
import re
import unicodedata
from dataclasses import field
from pathlib import Path

from pinsing._dataclass import dataclass
from pinsing.description.xml_tree import Node
from pinsing.errors import RobotFileError

# As strict as urdfdom, which reads no "nan", "inf", hexadecimal or "1_000".
_LONGEST_NUMBER = 1000
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(?:nan(?:\(.*\))?|inf|infinity)", re.IGNORECASE)
# No robot has a link, an angle or a mass of that size; a finger on the keyboard has.
LARGEST = 1e6
LARGEST_INERTIA = 1e12


def show(text: str, length: int = 60) -> str:
    """Return text from a file as a quoted literal, cut to a length, control characters escaped."""
    return repr(text if len(text) <= length else text[: length - 3] + "...")


def has_control(name: str) -> bool:
    """Whether a name holds a line break, a tab, an escape or the like."""
    return any(unicodedata.category(c) == "Cc" for c in name)


@dataclass
class UrdfSource:
    """The file under check, and what was noted about it.

    Attributes
    ----------
    path : Path
        The file as given.
    expanded : bool
        Whether the text is what xacro made of the file, whose lines are not those of the file.
    version : str
        Version of the URDF format, as the file says.
    """

    path: Path
    expanded: bool = False
    version: str = "1.0"
    _findings: dict[str, list[str]] = field(default_factory=dict)

    def error(self, problem: str, node: Node | None = None) -> RobotFileError:
        """Return an error at the line of a node."""
        if node is None:
            return RobotFileError(problem, self.path)
        if self.expanded:
            where = f" (line {node.line} of what `xacro {self.path.name}` prints)"
            return RobotFileError(problem + where, self.path)
        return RobotFileError(problem, self.path, node.line)

    def refuse_if(self, wrong: object, problem: str, node: Node | None = None) -> None:
        """Raise an error at the line of a node if something is wrong with it."""
        if wrong:
            raise self.error(problem, node)

    def line(self, node: Node) -> int | None:
        """Return the line of a node in the file, None where xacro stands between."""
        return None if self.expanded else node.line

    def note(self, text: str, where: str = "") -> None:
        """Note something; the same text at several places becomes one note with its count."""
        self._findings.setdefault(text, []).append(where)

    def notes(self) -> tuple[str, ...]:
        """Return the notes in the order of their first finding."""
        return tuple(_note(text, places) for text, places in self._findings.items())

    def check_name(self, name: str, what: str, node: Node) -> None:
        """Refuse control characters, which terminals, LaTeX and tables obey or trip over."""
        self.refuse_if(
            has_control(name), f"{what}: the name holds a control character: rename it", node
        )

    def attribute(self, node: Node, name: str, what: str) -> str:
        """Return a required attribute that is not blank."""
        value = node.attributes.get(name, "")
        self.refuse_if(not value.strip(), f'{what}: <{node.tag}> has no {name}="..."', node)
        return value

    def numbers(
        self, node: Node, name: str, count: int, what: str, largest: float = LARGEST
    ) -> tuple[float, ...]:
        """Return the numbers in an attribute, each finite and at most ``largest``.

        The attribute is rewritten with single blanks between them, all that urdfdom can read.
        """
        text = node.attributes[name]
        words = text.split()
        at = f"{what}: <{node.tag} {name}={show(text)}>"
        if len(words) != count:
            expected = "one number" if count == 1 else f"{count} numbers"
            raise self.error(f"{at} must have {expected}, separated by blanks", node)
        values = []
        for word in words:
            self.refuse_if(
                _NOT_FINITE.fullmatch(word), f"{at}: {word} is not a finite number", node
            )
            if len(word) > _LONGEST_NUMBER and not word[:50].strip("+-.0123456789"):
                # The expression below would take the square of that many steps.
                raise self.error(f"{at}: a number of {len(word):,} characters: round it", node)
            if not _NUMBER.fullmatch(word):
                hint = ": a xacro expression? name the file .xacro" if "${" in text else ""
                raise self.error(f"{at}: {show(word, 30)} is not a number{hint}", node)
            value = float(word)
            self.refuse_if(
                not math.isfinite(value) or abs(value) > largest,
                f"{at}: {show(word, 30)} is too large, at most {largest:g}",
                node,
            )
            values.append(value)
        node.attributes[name] = " ".join(words)
        return tuple(values)

    def one(self, node: Node, tag: str, what: str) -> Node | None:
        """Return the only child with a tag, None if there is none; refuse several."""
        found = node.all(tag)
        if len(found) > 1:
            raise self.error(f"{what} has {len(found)} <{tag}> elements: keep one", found[1])
        return found[0] if found else None

    def origin(self, node: Node, what: str) -> list[Node]:
        """Return a checked copy of the <origin> of a node, as a list of none or one."""
        origin = self.one(node, "origin", what)
        if origin is None:
            return []
        kept = Node("origin", dict(origin.attributes), origin.line)
        for name in ("xyz", "rpy"):
            if name in kept.attributes:
                self.numbers(kept, name, 3, what)
        if "quat_xyzw" in kept.attributes:
            if self.version not in ("1.1", "1.2"):
                # Readers of version 1.0 pass over it and lose the rotation without a word.
                raise self.error(
                    f"{what}: <origin quat_xyzw> does not exist in URDF 1.0: "
                    'write <robot version="1.1">, or give rpy',
                    origin,
                )
            quaternion = self.numbers(kept, "quat_xyzw", 4, what)
            self.refuse_if(
                "rpy" in kept.attributes,
                f"{what}: <origin> has both rpy and quat_xyzw: keep one",
                origin,
            )
            self.refuse_if(
                math.hypot(*quaternion) < 1e-6,
                f"{what}: <origin quat_xyzw> is zero, so no rotation",
                origin,
            )
        return [kept]


def _note(text: str, places: list[str]) -> str:
    named = [p for p in places if p]
    if not named:
        return text
    more = f" and {len(named) - 3} more" if len(named) > 4 else ""
    shown = named if len(named) <= 4 else named[:3]
    return f"{text} {', '.join(shown)}{more}"
