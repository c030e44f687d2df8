"""XML read with line numbers, and without what XML can do to its reader.

Expat checks the syntax; entities, document types, deep nesting and huge files are refused, and no
other file is ever opened. Text between tags is dropped: in a robot description all is in
attributes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from pinsing.errors import RobotFileError

MAX_BYTES = 32 * 2**20
MAX_DEPTH = 100
MAX_ELEMENTS = 500_000
MAX_ATTRIBUTES = 100

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


@dataclass(slots=True)
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


def read_bytes(path: Path) -> bytes:
    """Return the content of a file that may be a robot description.

    Raises
    ------
    RobotFileError
        If it is missing, a folder, not a plain file, unreadable, empty, or larger than 32 MiB.
    """
    try:
        if path.is_dir():
            raise RobotFileError("is a folder: give the URDF or xacro file in it", path)
        if not path.exists():
            raise RobotFileError("no such file", path)
        if not path.is_file():
            raise RobotFileError("is not a plain file: give a URDF or xacro file", path)
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise RobotFileError(f"cannot be read: {reason}", path) from error
    if len(data) > MAX_BYTES:
        raise RobotFileError(
            f"is larger than {MAX_BYTES // 2**20} MiB: not a robot description", path
        )
    if not data.strip(b" \t\r\n\0"):
        raise RobotFileError("the file is empty", path)
    return data


def parse_text(text: str, path: Path) -> Node:
    """Return the root element of XML text that was decoded already, whatever it declares.

    Raises
    ------
    RobotFileError
        As `parse_xml`; ``path`` is what the message calls the text.
    """
    head = _DECLARATION.match(text)
    if head is not None:  # an encoding that no longer holds, and blanks before it are no XML
        text = "\n" * head[0].count("\n") + text[head.end() :]
    try:
        data = text.encode()
    except UnicodeEncodeError as error:
        line = text.count("\n", 0, error.start) + 1
        raise RobotFileError("holds half a character (a lone surrogate)", path, line) from None
    if len(data) > MAX_BYTES:
        raise RobotFileError(
            f"is larger than {MAX_BYTES // 2**20} MiB: not a robot description", path
        )
    return parse_xml(data, path)


def parse_xml(data: bytes, path: Path) -> Node:
    """Return the root element of an XML document.

    The encoding is that of the XML declaration or the byte order mark, UTF-8 otherwise.

    Raises
    ------
    RobotFileError
        With the line, if the text is not well-formed XML, cannot be decoded, declares a document
        type or entities, or is nested deeper or has more elements than any robot needs.
    """
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


def _syntax_error(error: expat.ExpatError, data: bytes, path: Path) -> RobotFileError:
    if not re.search(rb"<\0?[A-Za-z_]", data):
        return RobotFileError("is not XML: no element found, so not a URDF", path)
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
