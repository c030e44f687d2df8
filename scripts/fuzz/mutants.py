"""Broken robot files made from good ones: URDF, xacro, DH tables, loop files; each from a seed."""

from __future__ import annotations

import random
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from pathlib import Path

MEGABYTE = 2**20

XACRO = """<?xml version="1.0"?>
<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="scale" default="1.5"/>
  <xacro:property name="length" value="${0.25 * 2}"/>
  <xacro:property name="limits" value="${dict(lower=-pi, upper=pi)}"/>
  <xacro:macro name="segment" params="n parent *axis kind:=revolute">
    <link name="link${n}"/>
    <joint name="joint${n}" type="${kind}">
      <parent link="${parent}"/>
      <child link="link${n}"/>
      <origin xyz="0 0 ${length * $(arg scale)}" rpy="0 ${pi / 2} 0"/>
      <xacro:insert_block name="axis"/>
      <limit lower="${limits['lower']}" upper="${limits['upper']}" effort="1" velocity="1"/>
    </joint>
  </xacro:macro>
  <link name="base"/>
  <xacro:segment n="1" parent="base"><axis xyz="0 0 1"/></xacro:segment>
  <xacro:if value="${length > 0.1}">
    <xacro:segment n="2" parent="link1"><axis xyz="0 1 0"/></xacro:segment>
  </xacro:if>
  <xacro:segment n="3" parent="link2" kind="prismatic"><axis xyz="0 0 1"/></xacro:segment>
  <xacro:segment n="4" parent="link3"><axis xyz="1 0 0"/></xacro:segment>
</robot>
"""

XACRO_MORE = """<?xml version="1.0"?>
<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="side" default="left"/>
  <xacro:arg name="count" default="${1 + 1}"/>
  <xacro:property name="table" value="${xacro.load_yaml('data.yaml')}"/>
  <xacro:property name="zero"><origin xyz="0 0 0" rpy="0 0 0"/></xacro:property>
  <xacro:property name="gone" value="1"/>
  <xacro:property name="gone" remove="true"/>
  <xacro:macro name="joint" params="n parent low:=^|-1 high:=${2 * 0.5} *place **more">
    <xacro:property name="last" value="link${n}" scope="parent"/>
    <link name="link${n}"/>
    <joint name="joint${n}" type="revolute">
      <parent link="${parent}"/><child link="link${n}"/>
      <xacro:insert_block name="place"/><xacro:insert_block name="more"/>
      <limit lower="${low}" upper="${high}" effort="1" velocity="${radians(90)}"/>
    </joint>
  </xacro:macro>
  <link name="base"/>
  <xacro:joint n="1" parent="base"><xacro:insert_block name="zero"/>
    <more><axis xyz="0 0 1"/></more></xacro:joint>
  <xacro:call macro="joint" n="2" parent="${last}" low="${table.low[0]}" high="${table['high']}">
    <origin xyz="${table.xyz}" rpy="0 ${table.angle} 0"/>
    <more><axis xyz="$(eval 1 if side == 'left' else 0) 0 0"/></more></xacro:call>
  <xacro:unless value="$(eval count > 3)">
    <xacro:element xacro:name="${'li' + 'nk'}" name="tool">
      <xacro:attribute name="id" value="$(optenv NO_SUCH_VARIABLE a)"/></xacro:element>
    <joint name="fixed" type="fixed"><parent link="${last}"/><child link="tool"/></joint>
  </xacro:unless>
  <!-- xacro:eval-comments --><!-- ${[i ** 2 for i in range(3)]} -->
  <gazebo reference="tool">$$(x) ${'%.3f' % pi} ${xacro.tokenize('a b')}</gazebo>
</robot>
"""
DATA = """low: [-0.5, {x: 1}]
high: 1.5
xyz: 0 0 0.3
angle: !degrees 90 / 2
length: !millimeters 5
base: &base {k: 1}
more: {<<: *base, l: 2}
"""

NUMBERS = (
    "nan|inf|-inf|Infinity|NaN(1)|1e308|-1e308|1e309|1e-320|1e999999999|0|-0|-1|1e7|0x10|1_0|1,5|"
    "1d3|٣|½|--1|+|.|e5|1e|" + "9" * 400 + "|0." + "0" * 400 + "1"
).split("|")
WORDS = (
    "| |0 0|0 0 0|0 0 0 0|text|universe|base_link|${x}|$(arg no)|<b>|&amp;|\x85|\u202e|\u200b|é|"
    "..|/|a/b|package://x/y.stl|package://../../etc/passwd|file:///etc/passwd|"
    "http://example.org/a.stl|model://x|\\|'|\"|%s|{0}|\n|\t|" + "a" * 5000
).split("|")
EXPRESSIONS = [
    "${1/0}",
    "${nothing}",
    "${length",
    "$(arg scale",
    "${[0] * 10**10}",
    "${'a' * 10**11}",
    "${2**10**8}",
    "${pi.real}",
    "${().__class__}",
    "${open('/etc/passwd')}",
    "${__import__('os').system('true')}",
    "$(env HOME)",
    "$(optenv NO_SUCH 1)",
    "$(find nothing)",
    "$(eval 1/0)",
    "$(cwd)",
    "${xacro.load_yaml('/etc/passwd')}",
    "${xacro.load_yaml('nothing.yaml')}",
    "${limits}",
    "${{}",
    "${''}",
    "${None}",
    "${float('nan')}",
    "${1e308*10}",
    "${sum(range(10**12))}",
    "${list(map(lambda f: f(f), [lambda f: f(f)]))}",
    "${length * n}",
    "$$(arg x)",
]
URDF_TAGS = ["joint", "link", "axis", "origin", "limit", "parent", "child", "mimic", "robot"]
X = "{http://www.ros.org/wiki/xacro}"
XACRO_TAGS = [
    f"{X}{tag}"
    for tag in ("macro", "property", "arg", "if", "unless", "include", "insert_block", "segment",
                "call", "element", "attribute")
]  # fmt: skip
YAML_VALUES = (
    "nan|.inf|-.inf|1e308|1e999|''|text|[]|{}|[1, 2]|{a: 1}|null|~|true|2020-01-01|0x10|1_000|"
    "pi|-pi/2|pi/0|pi*pi|2*pi/3|__import__('os')|!!python/object/apply:os.system ['true']|"
    "!!python/name:os.system|!!binary aGk=|*nothing|&a [*a]|\"\\0\"|'\\x1b[31m'|<b>|@|`|%|"
    + "9" * 400
    + "|"
    + "a" * 5000
    + "|"
    + "[" * 5000
).split("|")

Mutation = Callable[[random.Random, ET.Element], None]


def bases(urdfs: list[Path], tables: list[Path], loops: list[Path]) -> dict[str, list[str]]:
    """Good files by kind."""
    return {
        "urdf": [p.read_text(encoding="utf-8") for p in urdfs],
        "xacro": [XACRO, XACRO_MORE],
        "dh": [p.read_text(encoding="utf-8") for p in tables],
        "loops": [p.read_text(encoding="utf-8") for p in loops],
    }


def mutant(chain: Sequence[int], kind: str, text: str) -> bytes:
    """Return a broken file of a kind, the same for the same chain: each seed breaks it again."""
    data = text.encode()
    for seed in chain:
        rng = random.Random(f"{kind} {seed}")
        if kind in ("urdf", "xacro"):
            data = _xml(rng, kind, data)
        else:
            data = _yaml(rng, data.decode("utf-8", "replace"))
    return data


# XML --------------------------------------------------------------------------------


def _xml(rng: random.Random, kind: str, data: bytes) -> bytes:
    if rng.random() < 0.12:
        text = data.decode("utf-8", "replace")
        if "<robot" in text:
            return rng.choice(WHOLE_FILES)(rng, text).encode("utf-8", "surrogatepass")
    ET.register_namespace("xacro", X[1:-1])
    if b"<!DOCTYPE" in data:  # not to be expanded here
        return _bytes(rng, data)
    try:
        root = ET.fromstring(data)
    except (ET.ParseError, ValueError, LookupError):  # broken before
        return _bytes(rng, data or b"<")
    tags = URDF_TAGS if kind == "urdf" else URDF_TAGS + XACRO_TAGS
    acts = [_drop_attribute, _set_number, _set_number, _set_word, _remove, _duplicate, _move]
    acts += [_exchange, _loop, _rename, _copy_name]
    if kind == "xacro":
        acts += [_expression] * 3
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        act = rng.choice(acts)
        chosen = [e for e in root.iter() if isinstance(e.tag, str) and e.tag in tags]
        if chosen:
            act(rng, root, rng.choice(chosen), tags)
    for element in root.iter():  # what XML cannot hold at all is left to the bytes
        for key, value in element.attrib.items():
            element.attrib[key] = "".join(c for c in value if c in "\n\t" or ord(c) >= 32)
    encoding = rng.choice(["utf-8"] * 8 + ["utf-16", "iso-8859-1", "us-ascii", "cp1252"])
    try:
        data = ET.tostring(root, encoding=encoding)
    except RecursionError:  # nested deeply before
        return _bytes(rng, data)
    return _bytes(rng, data) if rng.random() < 0.12 else data


def _drop_attribute(rng: random.Random, root: ET.Element, e: ET.Element, tags: list[str]) -> None:
    if e.attrib:
        del e.attrib[rng.choice(list(e.attrib))]


def _set_number(rng: random.Random, root: ET.Element, e: ET.Element, tags: list[str]) -> None:
    """Put something odd in the place of one number."""
    if e.attrib:
        key = rng.choice(list(e.attrib))
        words = e.attrib[key].split() or [""]
        words[rng.randrange(len(words))] = rng.choice(NUMBERS)
        e.set(key, " ".join(words))


def _set_word(rng: random.Random, root: ET.Element, e: ET.Element, tags: list[str]) -> None:
    if e.attrib:
        e.set(rng.choice(list(e.attrib)), rng.choice(WORDS))


def _expression(rng: random.Random, root: ET.Element, e: ET.Element, tags: list[str]) -> None:
    holders = [x for x in root.iter() if x.attrib]
    if not holders:
        return
    holder = rng.choice(holders)
    key = rng.choice(list(holder.attrib))
    new = rng.choice(EXPRESSIONS)
    holder.set(key, new if rng.random() < 0.7 else holder.attrib[key] + new)


def _parents(root: ET.Element) -> dict[ET.Element, ET.Element]:
    return {child: parent for parent in root.iter() for child in parent}


def _remove(rng: random.Random, root: ET.Element, e: ET.Element, tags: list[str]) -> None:
    parent = _parents(root).get(e)
    if parent is not None:
        parent.remove(e)


def _duplicate(rng: random.Random, root: ET.Element, e: ET.Element, tags: list[str]) -> None:
    parent = _parents(root).get(e)
    if parent is not None:
        for _ in range(rng.choice([1, 1, 1, 50])):
            parent.append(e)


def _move(rng: random.Random, root: ET.Element, e: ET.Element, tags: list[str]) -> None:
    parent, other = _parents(root).get(e), rng.choice(list(root.iter()))
    if parent is not None and other not in set(e.iter()):
        parent.remove(e)
        other.append(e)


def _exchange(rng: random.Random, root: ET.Element, e: ET.Element, tags: list[str]) -> None:
    other = rng.choice([x for x in root.iter() if x.attrib] or [e])
    e.attrib, other.attrib = dict(other.attrib), dict(e.attrib)


def _loop(rng: random.Random, root: ET.Element, e: ET.Element, tags: list[str]) -> None:
    """Hang a joint somewhere else: a loop, a second parent, a link to itself."""
    ends = [x for x in root.iter() if x.tag in ("parent", "child") and "link" in x.attrib]
    if ends:
        rng.choice(ends).set("link", rng.choice(ends).get("link", ""))


def _rename(rng: random.Random, root: ET.Element, e: ET.Element, tags: list[str]) -> None:
    e.tag = rng.choice(tags)


def _copy_name(rng: random.Random, root: ET.Element, e: ET.Element, tags: list[str]) -> None:
    names = [x.get("name", "") for x in root.iter() if "name" in x.attrib]
    if names:
        e.set(rng.choice(["name", "link", "joint"]), rng.choice(names or [""]))


def _truncated(rng: random.Random, text: str) -> str:
    return text[: rng.randrange(len(text))]


def _deep(rng: random.Random, text: str) -> str:
    depth = rng.choice([90, 101, 1000, 200_000])
    return text.replace("</robot>", "<a>" * depth + "</a>" * depth + "</robot>")


def _long_comment(rng: random.Random, text: str) -> str:
    return text.replace("</robot>", "<!--" + "x" * (10 * MEGABYTE) + "--></robot>")


def _long_attribute(rng: random.Random, text: str) -> str:
    filler = rng.choice(["9", "0 ", "a", "&#10;"])
    return text.replace('xyz="', f'xyz="{filler * (10 * MEGABYTE // len(filler))}', 1)


def _many_elements(rng: random.Random, text: str) -> str:
    element = rng.choice(["<a/>", '<link name="a"/>', "<visual/>", '<material name="m"/>'])
    return text.replace("</robot>", element * (10 * MEGABYTE // len(element)) + "</robot>")


def _many_joints(rng: random.Random, text: str) -> str:
    """A long row, or a broad tree, of joints at the end."""
    count = rng.choice([200, 900, 4000, 12_000])
    broad = rng.random() < 0.5
    more = ['<link name="x0"/>']
    for i in range(count):
        parent = "x0" if broad else f"x{i}"
        more.append(
            f'<link name="x{i + 1}"/><joint name="y{i}" type="revolute"><parent link="{parent}"/>'
            f'<child link="x{i + 1}"/><limit lower="-1" upper="1"/></joint>'
        )
    head = '<?xml version="1.0"?><robot name="long">'
    return head + "".join(more) + "</robot>"


def _bomb(rng: random.Random, text: str) -> str:
    entities = '<!ENTITY a0 "ha">' + "".join(
        f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 12)
    )
    subsets = [
        f"[{entities}]",
        '[<!ENTITY a11 SYSTEM "file:///etc/passwd">]',
        '[<!ENTITY % p SYSTEM "http://127.0.0.1:9/x.dtd"> %p;]',
        'SYSTEM "http://127.0.0.1:9/x.dtd"',
        f'[<!ENTITY a11 "{"x" * 100_000}">]',
    ]
    body = text[text.index("<robot") :].replace('name="', 'name="&a11;', 1)
    return f'<?xml version="1.0"?><!DOCTYPE robot {rng.choice(subsets)}>{body}'


def _other_root(rng: random.Random, text: str) -> str:
    return rng.choice(
        ["", " ", "\0", "<robot", "<robot/>", "<sdf/>", "hello", "[1, 2]", '<robot name="">',
         "<robot>" * 3, "\ufeff<robot/>", "<?xml version='9'?><robot/>", "<robot xmlns='x:y'/>",
         "<html><robot/></html>", text + text, text + "junk", "<!-- -->", "{}", "\ud800"]
    )  # fmt: skip


def _include_itself(rng: random.Random, text: str) -> str:
    files = rng.choice(["arm.xacro", "*", "../*", "/etc/passwd", "/dev/zero", "nothing.xacro", ""])
    space = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    return text.replace("</robot>", f'<xacro:include {space} filename="{files}"/></robot>')


def _endless_macro(rng: random.Random, text: str) -> str:
    space = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    calls = '<xacro:m n="${n+1}"/>' * rng.choice([1, 2])
    macro = f'<xacro:macro {space} name="m" params="n">{calls}</xacro:macro>'
    return text.replace("</robot>", f'{macro}<xacro:m {space} n="1"/></robot>')


WHOLE_FILES: list[Callable[[random.Random, str], str]] = [
    _truncated, _truncated, _deep, _long_comment, _long_attribute, _many_elements, _many_joints,
    _bomb, _bomb, _other_root, _other_root, _include_itself, _endless_macro,
]  # fmt: skip


def _bytes(rng: random.Random, data: bytes) -> bytes:
    """Damage the bytes: cut, flip, wrong mark or declaration."""
    spot = rng.randrange(len(data))
    return rng.choice(
        [
            data[:spot],
            data[:spot] + bytes([rng.randrange(256)]) + data[spot + 1 :],
            data[:spot] + b"\0" + data[spot:],
            b"\xef\xbb\xbf" + data,
            b"\xff\xfe" + data,
            b'<?xml version="1.0" encoding="utf-16"?>' + data,
            b'<?xml version="1.0" encoding="ebcdic-cp-us"?>' + data,
        ]
    )


# YAML -------------------------------------------------------------------------------


def _yaml(rng: random.Random, text: str) -> bytes:
    lines = text.splitlines()
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        act = rng.randrange(13)
        spot = rng.randrange(len(lines)) if lines else 0
        if act == 0 and lines:
            del lines[spot]
        elif act == 1 and lines:
            lines.insert(rng.randrange(len(lines)), lines[spot])
        elif act in (2, 3, 4, 5) and lines:
            lines[spot] = _other_value(rng, lines[spot])
        elif act == 6 and lines:
            lines[spot] = rng.choice(["  ", "\t", "- ", "? ", "key: ", "!!str "]) + lines[spot]
        elif act == 7 and lines:
            lines[spot] = lines[spot].lstrip()
        elif act == 8:
            lines = "\n".join(lines)[: rng.randrange(len(text) + 1)].splitlines()
        elif act == 9 and lines:
            lines[spot] = lines[spot].replace(rng.choice(":,[]{}- "), rng.choice(["", ":", "{"]), 1)
        elif act == 10 and lines:
            other = rng.randrange(len(lines))
            lines[spot], lines[other] = lines[other], lines[spot]
        elif act == 11 and rng.random() < 0.3:
            lines = rng.choice(YAML_FILES)(lines)
        elif act == 12:
            data = "\n".join(lines).encode("utf-8", "surrogatepass")
            return _bytes(rng, data) if data else b""
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def _other_value(rng: random.Random, line: str) -> str:
    """Put something odd in the place of a value, or of a key."""
    for separator in rng.sample([": ", ", ", "["], 3):
        pieces = line.split(separator)
        if len(pieces) > 1:
            i = rng.randrange(1, len(pieces))
            end = next((pieces[i][k:] for k, c in enumerate(pieces[i]) if c in ",]}"), "")
            pieces[i] = rng.choice(YAML_VALUES) + (end if rng.random() < 0.9 else "")
            return separator.join(pieces)
    return rng.choice(YAML_VALUES)


YAML_FILES: list[Callable[[list[str]], list[str]]] = [
    lambda lines: [*lines, "# " + "x" * (10 * MEGABYTE)],
    lambda lines: [*lines, *["- {a: 1, b: [2, 3]}"] * 300_000],
    lambda lines: [*lines, *lines[-1:] * 20_000],
    lambda lines: ["[" * 100_000],
    lambda lines: ["{a: " * 20_000],
    lambda lines: ["- " * 20_000],
    lambda lines: [f"a{i}: &a{i} [{f'*a{i - 1}, ' * 9}1]" for i in range(1, 30)],
    lambda lines: ["a0: &a0 lol", *(f"a{i}: &a{i} [{f'*a{i - 1}, ' * 9}1]" for i in range(1, 30))],
    lambda lines: ["---", *lines, "---", *lines],
    lambda lines: [],
    lambda lines: ["- 1"],
    lambda lines: ["text"],
    lambda lines: ["%YAML 9.9", "---", *lines],
    lambda lines: ["<<: {name: x}", *lines],
    lambda lines: ["? [a, b]", ": c", *lines],
]
