"""MuJoCo models: read as MuJoCo reads them, or refused in one sentence with the line."""

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from command_line import run
from golden import Golden

import pinsing
from pinsing.kinematics.jacobian import tip_placement

GOOD = Golden(Path(__file__).parents[1] / "description" / "said" / "arm.xml.txt").good
Q = np.array([0.4, -0.7, 0.06])


def load_with_the_tool_in_place(folder: Path, text: str) -> None:
    """The tool of `GOOD` is at `Q` where it is by hand, and so is its z axis."""
    file = folder / "arm.xml"
    file.write_text(text)
    arm = pinsing.load(file, tip="tool", task="vx,vy,vz")
    R = pin.utils.rotate("z", math.pi / 2 + Q[0])
    x = [0.1, 0, 0.5] + R @ [0.4, 0, 0]
    R = R @ pin.utils.rotate("y", Q[1] - math.radians(30))
    found = tip_placement(arm, Q)
    np.testing.assert_allclose(found.translation, x + R @ [0, 0, 0.4 + Q[2]], atol=1e-12)
    np.testing.assert_allclose(found.rotation[:, 2], R @ [1, 0, 0], atol=1e-12)


def refused(folder: Path, text: str) -> str:
    file = folder / "arm.xml"
    file.write_text(text)
    done = run("list", str(file))
    assert done.exit_code == 2, (done.stdout, done.exception)
    (line,) = done.stderr.strip().splitlines()
    return line


def changed(old: str, new: str, text: str = GOOD) -> str:
    assert text.count(old) == 1, old
    return text.replace(old, new)


NUMBERS = [
    'pos="0 0 0.2"', 'pos="0.1 0 0.3"', 'euler="0 0 90"', 'quat="1 0 0 0"', 'range="-170 170"',
    'ref="30"', 'axis="0 0 2"', 'zaxis="1 0 0"', 'axis="0 1 0"', 'range="-120 120"',
]  # fmt: skip
BAD = {
    "few": lambda w: w[:-1], "many": lambda w: [*w, "0"], "letters": lambda w: ["a", *w[1:]],
    "nan": lambda w: ["nan", *w[1:]], "infinite": lambda w: [*w[:-1], "inf"],
    "comma": lambda w: [*w[:-1], "0,3"], "huge": lambda w: ["1e308", *w[1:]],
}  # fmt: skip


@pytest.mark.parametrize("how", BAD)
@pytest.mark.parametrize("attribute", NUMBERS)
def test_a_broken_number_is_refused_where_it_stands(tmp_path, attribute, how):
    name, _, value = attribute.strip('"').partition('="')
    words = BAD[how](value.split())
    said = refused(tmp_path, changed(attribute, f'{name}="{" ".join(words)}"'))
    assert f"arm.xml:{GOOD.partition(attribute)[0].count(chr(10)) + 1}: " in said
    assert f" {name}=" in said
    reason = {"few": "must have", "many": "must have", "huge": "is too large"}
    reason |= dict.fromkeys(("nan", "infinite"), "not a finite")
    assert reason.get(how, "is not a number") in said


def test_an_included_file_is_read_and_its_lines_are_named(tmp_path):
    load_with_the_tool_in_place(tmp_path, GOOD)  # others that say the same are in ``arm.xml.txt``
    inner = GOOD[GOOD.index('<body name="hand"') : GOOD.index("</body>") + len("</body>")]
    (tmp_path / "parts").mkdir()
    part = tmp_path / "parts" / "hand.xml"
    part.write_text(f"<mujocoinclude>\n{inner}\n</mujocoinclude>")
    text = GOOD.replace(inner, '<include file="parts/hand.xml"/>')
    load_with_the_tool_in_place(tmp_path, text)
    part.write_text(part.read_text().replace("0 0 2", "0 0 nan"))
    assert f"{part}:3: joint 'j3': <joint axis='0 0 nan'>" in refused(tmp_path, text)


def test_includes_lead_nowhere_else_and_end(tmp_path):
    (tmp_path / "secret.xml").write_text("<mujocoinclude/>")
    inner = tmp_path / "model"
    inner.mkdir()
    (inner / "link.xml").symlink_to(tmp_path / "secret.xml")
    text = changed("<geom", '<include file="link.xml"/><geom')
    assert "outside the folder of the model" in refused(inner, text)
    (tmp_path / "a.xml").write_text('<mujocoinclude><include file="a.xml"/></mujocoinclude>')
    said = refused(tmp_path, changed("<geom", '<include file="a.xml"/><geom'))
    assert "a.xml:1: <include file='a.xml'>: that file is included already" in said
