"""XML read with line numbers, and without what XML can do to its reader.

Expat checks the syntax; entities, document types, deep nesting and huge files are refused, and no
other file is ever opened. Text between tags is dropped: in a robot description all is in
attributes.

What all checks of a URDF share stands here too: errors at their line, numbers, counted notes.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from pinsing.errors import RobotFileError, shown_path

MAX_BYTES = 32 << 20
MAX_DEPTH = 100
MAX_ATTRIBUTES = 100
MAX_ELEMENTS = 500_000

_DECLARATION = re.compile(r"\ufeff?\s*(?:<\?xml\s[^>]*\?>)?")
_DECLARED = re.compile(rb"^\s*<\?xml[^>]*?encoding\s*=\s*[\"']([A-Za-z0-9._-]+)[\"']")
_ESCAPES = str.maketrans(
    {
        "&": "&amp;",
        "<": "&lt;",
        ">": "&gt;",
        '"': "&quot;",
        "\n": "&#10;",
        "\r": "&#13;",
        "\t": "&#9;",
    }
)


@dataclasses.dataclass(slots=True)
class Node:
    """An element: its tag as written, its attributes, its children, and its line in the file."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Node] = field(default_factory=list)

    def all(self, tag: str) -> list[Node]:
        """Return the children with this tag."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> Node | None:
        """Return the first child with this tag."""
        return next((child for child in self.children if child.tag == tag), None)

    def walk(self) -> Iterator[Node]:
        """Yield this node and all below it, in the order of the file."""
        stack = [self]
        while stack:
            node = stack.pop()
            yield node
            stack.extend(reversed(node.children))


def read_bytes(path: Path, most: int = 0, kind: str = "URDF or xacro file") -> bytes:
    """Return the content of a plain file of at most ``most`` bytes (32 MiB), not empty."""
    try:
        if path.is_dir():
            inside = sorted(f for ending in ("urdf", "xacro") for f in path.glob(f"*.{ending}"))
            which = f", such as {shown_path(inside[0])}" if inside else ""
            raise RobotFileError(f"is a folder: give the {kind} in it{which}", path)
        RobotFileError.refuse_if(not path.exists(), "no such file", path)
        RobotFileError.refuse_if(not path.is_file(), f"is not a plain file: give a {kind}", path)
        with path.open("rb") as stream:
            most = most or MAX_BYTES
            data = stream.read(most + 1)
    except (OSError, ValueError) as error:
        if isinstance(error, RobotFileError):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        raise RobotFileError(f"cannot be read: {reason}", path) from error
    _require_size(data, most, path)
    RobotFileError.refuse_if(not data.strip(b" \t\r\n\0"), "the file is empty", path)
    return data


def _require_size(data: bytes, most: int, path: Path) -> None:
    if len(data) > most:
        size = f"{most // 2**20} MiB" if most >= 2**20 else f"{most // 2**10} KiB"
        raise RobotFileError(f"is larger than {size}: not a robot description", path)


def parse_text(text: str, path: Path) -> Node:
    """Return the root element of XML text that was decoded already, whatever it declares."""
    head = _DECLARATION.match(text)
    if head is not None:  # an encoding that no longer holds, and blanks before it are no XML
        text = "\n" * head[0].count("\n") + text[head.end() :]
    try:
        data = text.encode()
    except UnicodeEncodeError as error:
        line = text.count("\n", 0, error.start) + 1
        raise RobotFileError("holds half a character (a lone surrogate)", path, line) from None
    _require_size(data, MAX_BYTES, path)
    return parse_xml(data, path)


def parse_xml(data: bytes, path: Path) -> Node:
    """Return the root of an XML document, encoded as declared or marked, UTF-8 otherwise."""
    parser = expat.ParserCreate()
    parser.buffer_text = True
    open_nodes: list[Node] = []
    roots: list[Node] = []
    count = 0

    def refuse(problem: str) -> RobotFileError:
        return RobotFileError(problem, path, parser.CurrentLineNumber)

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if len(open_nodes) >= MAX_DEPTH:
            raise refuse(f"elements are nested deeper than {MAX_DEPTH} levels")
        if count > MAX_ELEMENTS:
            raise refuse(f"more than {MAX_ELEMENTS} elements: not a robot description")
        if len(attributes) > MAX_ATTRIBUTES:
            raise refuse(f"<{tag[:40]}> has more than {MAX_ATTRIBUTES} attributes")
        node = Node(tag, attributes, parser.CurrentLineNumber)
        (open_nodes[-1].children if open_nodes else roots).append(node)
        open_nodes.append(node)

    def end(_tag: str) -> None:
        open_nodes.pop()

    def doctype(*_args: object) -> None:
        raise refuse(
            "document types and entities are not accepted: remove the <!DOCTYPE ...>, "
            "a robot description needs none"
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    parser.EntityDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise _syntax_error(error, data, path) from error
    except (LookupError, ValueError, UnicodeError) as error:
        if isinstance(error, RobotFileError):
            raise
        raise RobotFileError(f"the encoding of the file cannot be used: {error}", path, 1) from None
    return roots[0]


_TABLES = (".csv", ".tsv", ".txt", ".npy", ".npz", ".ls", ".script")


def _syntax_error(error: expat.ExpatError, data: bytes, path: Path) -> RobotFileError:
    if not re.search(rb"<\0?[A-Za-z_]", data):
        order = "; the robot comes first: pinsing check ROBOT FILE"
        said = "is not XML: no element found, so not a URDF"
        return RobotFileError(said + order * (path.suffix.lower() in _TABLES), path)
    reason = expat.ErrorString(error.code)
    declared = _DECLARED.match(data[:200])
    if reason in (
        expat.errors.XML_ERROR_UNKNOWN_ENCODING,
        expat.errors.XML_ERROR_INCORRECT_ENCODING,
    ):
        name = declared.group(1).decode() if declared else "?"
        return RobotFileError(f"the file is not in the encoding it declares ({name})", path, 1)
    if reason in (expat.errors.XML_ERROR_INVALID_TOKEN, expat.errors.XML_ERROR_PARTIAL_CHAR):
        encoding = declared.group(1).decode().lower() if declared else "utf-8"
        if encoding in ("utf-8", "utf8", "us-ascii"):
            try:
                data.decode("utf-8")
            except UnicodeDecodeError as undecodable:
                return RobotFileError(
                    f"byte 0x{data[undecodable.start]:02x} is not {encoding}: save the file as "
                    'UTF-8, or name its encoding in <?xml version="1.0" encoding="..."?>',
                    path,
                    data.count(b"\n", 0, undecodable.start) + 1,
                )
    return RobotFileError(
        f"is not well-formed XML: {reason} (column {error.offset + 1})", path, error.lineno
    )


def to_text(root: Node) -> str:
    """Return a node as XML text, one element a line."""
    pieces = ['<?xml version="1.0" encoding="utf-8"?>\n']
    stack: list[tuple[Node | str, int]] = [(root, 0)]
    while stack:
        node, depth = stack.pop()
        if isinstance(node, str):
            pieces.append(node)
            continue
        indent = "  " * depth
        attributes = "".join(f' {k}="{v.translate(_ESCAPES)}"' for k, v in node.attributes.items())
        if not node.children:
            pieces.append(f"{indent}<{node.tag}{attributes}/>\n")
            continue
        pieces.append(f"{indent}<{node.tag}{attributes}>\n")
        stack.append((f"{indent}</{node.tag}>\n", depth))
        stack.extend((child, depth + 1) for child in reversed(node.children))
    return "".join(pieces)


# As strict as urdfdom, which reads no "nan", "inf", hexadecimal or "1_000".
LONGEST_NUMBER = 1000
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(?:nan(?:\(.*\))?|inf|infinity)", re.IGNORECASE)
# No robot has a link, an angle or a mass of that size; a finger on the keyboard has.
LARGEST = 1e6
LARGEST_INERTIA = 1e12
SOLIDS = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
}
NUMBERS: dict[str, tuple[str, ...]] = {
    "origin": ("xyz", "rpy", "quat_xyzw"),
    "limit": ("lower", "upper"),
    "dynamics": ("damping", "friction"),
    "mimic": ("multiplier", "offset"),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "mesh": ("scale",),
    "color": ("rgba",),
    **SOLIDS,
}
"""Elements of a URDF, with those of their attributes that hold numbers."""


def show(text: str, length: int = 60) -> str:
    """Return text from a file as a quoted literal, cut to a length, control characters escaped."""
    return repr(text if len(text) <= length else text[: length - 3] + "...")


def suggestion(name: str, known: Iterable[str]) -> str:
    """Say which of the known names was probably meant, or list them all."""
    known = tuple(known)
    # A name of thousands of characters resembles none, and takes minutes to compare.
    if close := difflib.get_close_matches(name[:200], known, n=2, cutoff=0.5):
        return "did you mean " + " or ".join(repr(c) for c in close) + "?"
    return "known: " + ", ".join(known)


def has_control(name: str) -> bool:
    """Return True if a name holds a line break, a tab, an escape or the like."""
    return any(unicodedata.category(c) == "Cc" for c in name)


@dataclass
class UrdfSource:
    """The file under check, and what was noted about it."""

    path: Path  # the file as given
    # whether the text is what xacro made of the file, whose lines are not those of the file
    expanded: bool = False
    version: str = "1.0"  # version of the URDF format, as the file says
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
        """Return the numbers in an attribute, each finite and at most ``largest``."""
        # It is rewritten with single blanks between them, all that urdfdom can read.
        text = node.attributes[name]
        words = text.split()
        at = f"{what}: <{node.tag} {name}={show(text)}>"
        if len(words) != count:
            expected = "one number" if count == 1 else f"{count} numbers"
            raise self.error(f"{at} must have {expected}, separated by blanks", node)
        hint = ": a xacro expression? name the file .xacro" if "${" in text else ""
        for word in words:
            self.refuse_if(
                _NOT_FINITE.fullmatch(word), f"{at}: {word} is not a finite number", node
            )
            # The expression below would take the square of that many steps.
            self.refuse_if(
                len(word) > LONGEST_NUMBER and not word[:50].strip("+-.0123456789"),
                f"{at}: a number of {len(word):,} characters: round it",
                node,
            )
            self.refuse_if(
                not _NUMBER.fullmatch(word), f"{at}: {show(word, 30)} is not a number{hint}", node
            )
            self.refuse_if(
                abs(float(word)) > largest,
                f"{at}: {show(word, 30)} is too large, at most {largest:g}",
                node,
            )
        node.attributes[name] = " ".join(words)
        return tuple(map(float, words))

    def values(
        self, node: Node, what: str, largest: float = LARGEST, names: Sequence[str] = ()
    ) -> dict[str, tuple[float, ...]]:
        """Return the numbers in an element by attribute, those of `NUMBERS` that it has."""
        several = dict.fromkeys(("xyz", "rpy", "size", "scale"), 3) | {"rgba": 4, "quat_xyzw": 4}
        return {
            name: self.numbers(node, name, several.get(name, 1), what, largest)
            for name in names or NUMBERS[node.tag]
            if name in node.attributes
        }

    def one(self, node: Node, tag: str, what: str) -> Node | None:
        """Return the only child with a tag, None if there is none; refuse several."""
        found = node.all(tag)
        if len(found) > 1:
            raise self.error(f"{what} has {len(found)} <{tag}> elements: keep one", found[1])
        return found[0] if found else None

    def origin(self, node: Node, what: str) -> list[Node]:
        """Return a checked copy of the <origin> of a node, as a list of none or one."""
        if (origin := self.one(node, "origin", what)) is None:
            return []
        kept = Node("origin", dict(origin.attributes), origin.line)
        quaternion = "quat_xyzw" in kept.attributes
        # Readers of version 1.0 pass over it and lose the rotation without a word.
        self.refuse_if(
            quaternion and self.version not in ("1.1", "1.2"),
            f"{what}: <origin quat_xyzw> does not exist in URDF 1.0: "
            'write <robot version="1.1">, or give rpy',
            origin,
        )
        self.refuse_if(
            quaternion and "rpy" in kept.attributes,
            f"{what}: <origin> has both rpy and quat_xyzw: keep one",
            origin,
        )
        values = self.values(kept, what)
        self.refuse_if(
            quaternion and math.hypot(*values["quat_xyzw"]) < 1e-6,
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
