"""Wrist, elbow and shoulder: given where the geometry warrants it, and nowhere else."""

import re

import numpy as np
import pytest
from arms import differences
from dh_arms import CRX, dh_arm
from public import script

import pinsing
from pinsing.description.catalog import data_folder
from pinsing.description.urdf import read_description
from pinsing.errors import PinsingError, ResultError, UnknownNameError
from pinsing.robot.load import load
from pinsing.robot.models import build_model

UR = {"shoulder": "wrist center above the base axis"}


def titles(arm: pinsing.Arm) -> dict[str, str]:
    """Title and condition of the families that have one."""
    form = pinsing.closed_form(arm, prove=False)
    return {f.title: f.where() for f in form if f.title}


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("ur5", UR | {"wrist": "wrist_2_joint = 0° or 180°", "elbow": "elbow_joint = 0° or 180°"}),
        ("puma560", UR | {"wrist": "q5 = 0°", "elbow": "q3 = -87.3084°"}),
        ("irb1400", UR | {"wrist": "q5 = 0°", "elbow": "q3 = -80.5377° or 99.4623°"}),
        ("z1", UR | {"wrist": "joint5 = ±90°", "elbow": "joint3 = 14.653° or -165.347°"}),
        ("kinova", UR | {
            "wrist": "j2s6s200_joint_5 = 180°", "elbow": "j2s6s200_joint_3 = 180°",
        }),
        ("stanford", {"wrist": "q5 = 0° or 180°", "shoulder": "q2 = 0° or 180°"}),
        ("iiwa14", {
            "elbow": "q4 = 0°", "shoulder": "q2 = 0° and q3 = ±90°",
            "wrist": "q5 = ±90° and q6 = 0°",
        }),
        *((name, {}) for name in ("surgical7", "scara", "planar3r", "panda", "xarm7", "so101")),
    ],
)  # fmt: skip
def test_catalogue(name: str, wanted: dict[str, str]) -> None:
    assert titles(load(name)) == wanted


@pytest.mark.slow
def test_negatives() -> None:
    assert titles(dh_arm(CRX)) == titles(load("puma560", task="position")) == {}
    slide = (90, 0, 0, 0, "prismatic")
    gantry = dh_arm([slide, slide, slide, (90, 0, 0), (-90, 0, 0), (0, 0, 0)])
    assert titles(gantry) == {"wrist": "q5 = 0° or 180°"}


ROBOTS = {
    *("ur3", "ur5", "ur10", "z1_description", "b1_description", "kinova", "anymal"),
    *("romeo", "iCub", "simple_humanoid", "simple_humanoid_classical", "talos", "so_arm100"),
    "so101_new_calib",
}
ELBOW = re.compile("elbow|joint_?3 |LARM_ELBOW|RARM_ELBOW|q3", re.IGNORECASE)


@pytest.mark.slow
def test_chains_of_example_robot_data() -> None:
    named = {}
    for path in sorted(data_folder().rglob("*.urdf")):
        try:
            for tip, base, _ in script("oracle.survey").all_chains(
                build_model(read_description(path)), []
            ):
                arm = load(path, tip=tip, base=base)
                if arm.n in (6, 7) and (found := titles(arm)):
                    named[arm.name, arm.tip] = found
        except PinsingError:
            continue
    for found in named.values():
        assert "elbow" not in found or ELBOW.search(found["elbow"])
    assert {robot for robot, _ in named} == ROBOTS, named


def test_lookup_and_json() -> None:
    form = pinsing.closed_form(load("ur5"), prove=False)
    assert form["wrist"] is form["F2"]
    assert all(name in form for name in ("wrist", "F2", form["F2"]))
    assert not any(name in form for name in ("Wrist", "F4", "", 2))
    assert form["F2"].title == "wrist"
    assert [f.name for f in form] == ["F1", "F2", "F3"]
    with pytest.raises(UnknownNameError, match="elbow"):
        form["elbo"]
    again = pinsing.ClosedForm.from_json(form.to_json())
    assert again["shoulder"].name == "F3"
    q = np.array([0, -1.2, 1.3, -1, np.pi, 0])
    assert form["wrist"].where(q) == "wrist_2_joint = 180°"


@pytest.mark.parametrize("name", ["ur5", "stanford", "iiwa14"])
def test_gradients(name: str) -> None:
    form = pinsing.closed_form(load(name), prove=False)
    q = np.random.default_rng(1).uniform(-1.5, 1.5, form.families[0].n)
    for family in form:
        wanted = differences(lambda x, f=family: f.distance(x).upper, q, 1e-2)
        assert np.allclose(family.gradient(q), wanted, atol=2e-3)
        assert not family.gradient(family.generic).any()
    quick = pinsing.clearance(form, q)
    wanted = differences(lambda x: float(pinsing.clearance(form, x).lower), q, 1e-4)
    assert np.allclose(quick.gradient, wanted, atol=1e-6)
    sharp = pinsing.clearance(form, q, certify=True)
    assert np.allclose(sharp.gradient, form[str(sharp.nearest)].gradient(q), atol=1e-3)
    again = pinsing.Clearance.from_json(quick.to_json())
    with pytest.raises(ResultError, match="compute it again"):
        _ = again.gradient


def test_a_value_is_told_by_whole_turns_within_the_limits() -> None:
    said = pinsing.closed_form(load("xarm7"), prove=False)["F2"].where()
    assert said == "joint4 = 184.9328° and joint6 = -6.9298°"
