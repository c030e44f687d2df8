"""MuJoCo models: read as MuJoCo reads them, or refused in one sentence with the line."""

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from command_line import run
from golden import Golden

import pinsing
from pinsing.errors import PinsingError
from pinsing.kinematics.jacobian import tip_placement

GOOD = Golden(Path(__file__).parents[1] / "description" / "said" / "arm.xml.txt").good
Q = np.array([0.4, -0.7, 0.06])


def load(folder: Path, text: str) -> pinsing.Arm:
    file = folder / "arm.xml"
    file.write_text(text)
    return pinsing.load(file, tip="tool", task="vx,vy,vz")


def load_with_the_tool_in_place(folder: Path, text: str) -> pinsing.Arm:
    """The tool of `GOOD` is at `Q` where it is by hand, and so is its z axis."""
    R = pin.utils.rotate("z", math.pi / 2 + Q[0])
    x = [0.1, 0, 0.5] + R @ [0.4, 0, 0]
    R = R @ pin.utils.rotate("y", Q[1] - math.radians(30))
    arm = load(folder, text)
    found = tip_placement(arm, Q)
    np.testing.assert_allclose(found.translation, x + R @ [0, 0, 0.4 + Q[2]], atol=1e-12)
    np.testing.assert_allclose(found.rotation[:, 2], R @ [1, 0, 0], atol=1e-12)
    return arm


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


def line_of(old: str) -> int:
    return GOOD[: GOOD.index(old)].count("\n") + 1


NUMBERS = {
    'pos="0 0 0.2"': 3, 'pos="0.1 0 0.3"': 3, 'euler="0 0 90"': 3, 'quat="1 0 0 0"': 4,
    'range="-170 170"': 2, 'ref="30"': 1, 'axis="0 0 2"': 3, 'zaxis="1 0 0"': 3,
    'axis="0 1 0"': 3, 'range="-120 120"': 2,
}  # fmt: skip
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
    assert f"arm.xml:{line_of(attribute)}: " in said
    assert f" {name}=" in said
    reason = {"few": "must have", "many": "must have", "huge": "is too large"}
    reason |= dict.fromkeys(("nan", "infinite"), "not a finite")
    assert reason.get(how, "is not a number") in said


SAME = [
    ('pos="0 0 0.2"', 'pos="  0\t0 2e-1 "'),
    ('euler="0 0 90"', 'axisangle="0 0 3 90"'),
    ('euler="0 0 90"', 'xyaxes="0 2 0 -1 5 0"'),
    ('euler="0 0 90"', 'quat="5 0 0 5"'),
    (' quat="1 0 0 0"', ""),
    ('zaxis="1 0 0"', 'euler="0 90 0"'),
    ('pos="0 0 0.1" zaxis="1 0 0"', 'fromto="0.5 0 0.1 -0.5 0 0.1"'),
    ('axis="0 0 2"', 'class="main"'),
    (' damping="1"', ' damping="nan"'),
    ('<geom size="0.1"/>', '<replicate count="2"><geom size="0.1"/></replicate>'),
    ('<body name="hand" pos="0 0 0.3">', '<body name="hand" pos="0 0 0.3"><frame pos="0 0 0"/>'),
    ('name="j2" ref', 'name="j2" class="side" ref'),
    ('<joint name="j1" pos="0 0 0.05"', '<joint name="j1" type="hinge" pos="0 0 -7"'),
    ('<site name="tool" pos="0 0 0.1" zaxis="1 0 0"/>',
     '<frame pos="0 0 0.1" euler="0 90 0"><site name="tool"/></frame>'),
    ("<actuator>", "<worldbody><geom/></worldbody><actuator>"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new"), SAME)
def test_other_words_for_the_same_give_the_same(tmp_path, old, new):
    arm = load_with_the_tool_in_place(tmp_path, changed(old, new))
    assert arm.joints == ("j1", "j2", "j3")
    degrees = np.radians([170, 120])
    np.testing.assert_allclose(arm.upper, [*degrees, 0.1])
    np.testing.assert_allclose(arm.lower, [*-degrees, -0.1])


@pytest.mark.parametrize(("sequence", "turns"), [("zyx", "90 0 0"), ("XZY", "0 90 0")])
def test_the_sequence_of_euler_angles_counts(tmp_path, sequence, turns):
    text = changed('angle="degree"', f'angle="degree" eulerseq="{sequence}"')
    load_with_the_tool_in_place(tmp_path, changed('euler="0 0 90"', f'euler="{turns}"', text))


def test_other_settings_of_the_compiler(tmp_path):
    text = changed('autolimits="true"', 'autolimits="false"')
    assert "arm.xml:13: joint 'j1' has a range, and autolimits" in refused(tmp_path, text)
    text = changed('angle="degree"', 'angle="radian"')
    text = text.replace('euler="0 0 90"', 'euler="0 0 1.5707963267948966"')
    text = text.replace('ref="30"', f'ref="{math.pi / 6!r}"').replace('range="-170 170"', "")
    arm = load_with_the_tool_in_place(tmp_path, text)
    np.testing.assert_allclose(arm.upper, [np.inf, 120, 0.1])


def test_an_included_file_is_read_and_its_lines_are_named(tmp_path):
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
    for name, other in (("a", "b"), ("b", "a")):
        text = f'<mujocoinclude><include file="{other}.xml"/></mujocoinclude>'
        (tmp_path / f"{name}.xml").write_text(text)
    said = refused(tmp_path, changed("<geom", '<include file="a.xml"/><geom'))
    assert "b.xml:1: <include file='a.xml'>: that file is included already" in said


def test_two_joints_of_a_body_and_a_free_base(tmp_path):
    text = changed(
        '<body name="hand" pos="0 0 0.3">\n            <joint',
        '<body name="hand" pos="0 0 0.3">\n<joint name="j0" type="slide" axis="1 0 0"/><joint',
    )
    assert load(tmp_path, text).joints == ("j1", "j2", "j0", "j3")
    text = changed('<geom size="0.1"/>', '<freejoint name="free"/><geom size="0.1"/>')
    arm = load(tmp_path, text)
    assert any("floating base: joint free is locked" in note for note in arm.notes)
    with pytest.raises(PinsingError, match="aligned with its inertia"):
        load(tmp_path, text.replace("<freejoint", '<freejoint align="true"'))
