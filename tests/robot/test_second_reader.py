"""yourdfpy beside Pinocchio: they agree on what is read, and what differs is seen."""

import json
from dataclasses import replace
from typing import Any

import pytest
from command_line import run
from dh_arms import dh_text
from tiers import tiered
from urdf_text import J, urdf

import pinsing
from pinsing.description.catalog import known_robots
from pinsing.errors import PinsingError
from pinsing.robot.arm import Arm
from pinsing.robot.second_reader import second_reading

QUICK = ("tiago", "stanford", "ur5")
ROBOTS = sorted(entry.name for entry in known_robots().values() if not entry.alias_of)


@pytest.mark.parametrize("name", tiered(ROBOTS, QUICK))
def test_both_read_the_same_in_every_arm_of_the_catalogue(name: str) -> None:
    try:
        arm = pinsing.load(name)
    except PinsingError:
        pytest.skip("no single arm by default")
    found = second_reading(arm)
    if found is None:
        assert arm.source.path is None or arm.source.path.suffix != ".urdf"
        pytest.skip("no URDF: a table or a MuJoCo model")
    assert (found.note, found.differences) == ("", ())
    assert len(found.links) >= len(arm.source.kept)
    assert max(found.translation, found.rotation) < 1e-12


def planar(length: float = 0.3, kind: str = "revolute", upper: float = 2, last: str = "j2") -> Arm:
    at = (length, 0, 0)
    first = J("j1", "l0", "l1", at, kind="revolute", limits=(-2, 2))
    other = J(last, "l1", "l2", at, kind=kind, limits=(-2, upper))
    return pinsing.load(urdf([first, other], "planar"), task="vx,vy")


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"length": 0.31}, "links are up to 0.0"),
        ({"upper": 2.5}, "limits of j2 are -2.0 to 2.5, not -2.0 to 2.0"),
        ({"kind": "prismatic"}, "joint j2 is prismatic"),
        ({"last": "j3"}, "there is no joint j2"),
    ],
)
def test_what_differs_is_said(other: dict[str, Any], said: str) -> None:
    # The model says one thing and the file another, as by a reader's fault.
    source = replace(planar().source, shapes=planar(**other).source.shapes)
    found = second_reading(replace(planar(), source=source))
    assert said in str(found)
    assert "DIFFERS" in str(found)
    found = second_reading(planar())
    assert found.differences == ()
    assert "agrees: joints, limits, and 2 links at 20 random configurations" in str(found)


def test_a_file_that_it_cannot_read_is_a_note(capfd: pytest.CaptureFixture[str]) -> None:
    arm = planar()
    for text in ("<robot", '<robot name="a"/>', "<robot><joint/></robot>"):
        broken = replace(arm.source, shapes=replace(arm.source.shapes, text=text))
        found = second_reading(replace(arm, source=broken))
        assert found.note or found.differences
    assert capfd.readouterr().err == ""


def test_what_is_no_urdf_has_no_second_reading(tmp_path) -> None:
    data = json.loads(run("list", "stanford", "-o", "-").stdout)
    assert (data["second_reading"]["seed"], data["second_reading"]["differences"]) == (20, [])
    assert "second reader" in run("list", "stanford").stdout
    table = tmp_path / "arm.yaml"
    table.write_text(dh_text([(0, 1, 0)] * 2))
    assert second_reading(pinsing.load(table)) is None
    assert second_reading(pinsing.load(planar().model)) is None
