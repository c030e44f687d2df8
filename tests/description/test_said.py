"""What is said of broken and of odd robot files: all of it, and where it is wrong."""

from pathlib import Path

import pytest
from arms import told
from golden import Golden
from urdf_texts import XACRO, joint, robot

from pinsing import load
from pinsing.description.yaml_tree import MAX_BYTES
from pinsing.errors import PinsingError, RobotFileError
from pinsing.view.scene import read_links

SAID = Path(__file__).with_name("said")
READ = ("arm.urdf", "arm.xacro", "arm.dh.yaml", "arm.xml", "table.yaml", "text")
FILES = {name: Golden(SAID / f"{name}.txt") for name in READ}


def said(file: Path, given: str | bytes) -> str:
    """An arm and its notes, or the error alone, without the folder of the file."""
    whole = file
    if file.name == "table.yaml":
        whole = file.with_name("arm.xacro")
        whole.write_text(XACRO.format("<link name=\"${xacro.load_yaml('table.yaml')}\"/>"))
    if file.name != "text":
        file.write_bytes(given.encode() if isinstance(given, str) else given)
    try:
        arm = load(given if file.name == "text" else whole)
    except PinsingError as error:
        line = str(error)
        assert line.isprintable()
        assert len(line) < 700
        if isinstance(error, RobotFileError):
            place = [error.path or "URDF text", *[error.line] * (error.line is not None)]
            assert line.startswith(":".join(map(str, place)))
        return line.replace(f"{file.parent}/", "").replace(str(file.parent), "FOLDER")
    shapes = getattr(read_links(arm).geometry, "geometryObjects", ())
    return "\n".join([*told(arm), f"shapes: {len(shapes)}"])


@pytest.mark.parametrize(
    ("name", "head"), [case for name, file in FILES.items() for case in file.heads(name)]
)
def test_what_is_said(name: str, head: str, tmp_path: Path, capfd):
    FILES[name].hold(head, said(tmp_path / name, FILES[name].text(head)))
    assert capfd.readouterr() == ("", "")


def laughs(items: int) -> str:
    """Each of the lists holds the one before nine times."""
    lists = [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, items)]
    return "\n".join(["a0: &a0 [lol]", *lists])


ROW = "".join(f'<link name="l{i}"/>' for i in range(1003))
ROW += "".join(joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(1002))
TOO_MUCH = {
    "number": ("arm.urdf", robot(joint(inner=f'<origin xyz="{"9" * 2_000_000}x 0 0"/>'))),
    "depth": ("arm.urdf", "<robot>\n" + "<a>" * 100_000),
    "width": ("arm.urdf", "<robot>" + "<a/>" * 500_001),
    "attributes": ("arm.urdf", "<robot " + " ".join(f'a{i}=""' for i in range(101)) + "/>"),
    "joints": ("arm.urdf", f'<robot name="r">{ROW}</robot>'),
    "bytes": ("arm.urdf", bytes(range(256))),
    "latin-1": ("arm.urdf", robot(extra="<!-- \xe9 -->").encode("latin-1")),
    "half a character": ("text", "<robot name='\ud800'/>"),
    "laughs in rows": ("arm.dh.yaml", laughs(25)),
    "lists in rows": ("arm.dh.yaml", "[" * 50_000),
    "size": ("arm.dh.yaml", "# " + "x" * MAX_BYTES),
    "key": ("arm.dh.yaml", "k" * 300 + ": 1"),
    "nul": ("arm.dh.yaml", "name: \0"),
    "bytes in rows": ("arm.dh.yaml", b"name: \xff\xfe\n"),
    "laughs": ("table.yaml", laughs(9)),
    "digits": ("table.yaml", "a: 1\nb: " + "9" * 5000),
    "bytes in a table": ("table.yaml", b"\xff\xfe\x00"),
    "lists": ("table.yaml", "[" * 5000),
    "maps": ("table.yaml", "{a: " * 3000),
}


ANSWERS = Golden(SAID / "too_much.txt")


@pytest.mark.parametrize("head", ANSWERS.heads())
def test_what_no_robot_needs(head: str, tmp_path: Path):
    name, given = TOO_MUCH[head.removesuffix(" (slow)")]
    ANSWERS.hold(head, said(tmp_path / name, given))
