"""Which chains a robot offers, and what is locked, followed or said of them."""

import shlex

import pinocchio as pin
import pytest
from public import script
from tiers import tiered
from urdf_texts import joint

from pinsing import load
from pinsing.description.catalog import find_robot
from pinsing.description.urdf import read_description
from pinsing.errors import ChainError
from pinsing.robot.models import arm_chains, build_model, chains_text, long_chain_note


def model_of(robot: str) -> tuple[pin.Model, list[str]]:
    description = read_description(find_robot(robot).path)
    return build_model(description), [j.name for j in description.joints if j.mimic is not None]


def write(tmp_path, joints: list[str], links: list[str], extra: str = ""):
    path = tmp_path / "arm.urdf"
    body = "".join(f'<link name="{link}"/>' for link in links)
    path.write_text(f'<robot name="r">{body}{"".join(joints)}{extra}</robot>')
    return path


def test_every_leaf_of_a_humanoid_is_a_chain():
    chains = script("oracle.survey").all_chains(*model_of("talos"))
    ends = {(tip, base): len(joints) for tip, base, joints in chains}
    assert (ends["left_sole_link", None], ends["wrist_left_ft_tool_link", None]) == (6, 9)
    assert ends["wrist_left_ft_tool_link", "torso_2_link"] == 7
    assert ends["rgbd_depth_frame", "torso_2_link"] == 2
    assert all(2 <= n <= 9 for n in ends.values())
    model, mimics = model_of("human")
    hands = [c for c in script("oracle.survey").all_chains(model, mimics) if c[0] == "left_hand"]
    assert [(base, len(joints)) for _, base, joints in hands] == [("middle_thorax", 8)]
    assert max(len(c.joints) for c in arm_chains(model, mimics)) == 13


@pytest.mark.parametrize(
    "robot",
    tiered(
        ["talos", "tiago_dual", "baxter", "anymal_kinova", "human", "icub", "panda"],
        ("baxter", "panda"),
    ),
)
def test_every_offer_loads_as_it_says(robot):
    model, mimics = model_of(robot)
    text = chains_text(arm_chains(model, mimics), robot)
    offers = [line.split(": pinsing analyze ") for line in text.splitlines() if "pinsing" in line]
    assert offers
    for count, command in offers:
        name, *options = shlex.split(command.partition("  (")[0])
        assert name == robot
        arm = load(robot, **dict(zip([o[2:] for o in options[::2]], options[1::2], strict=True)))
        assert arm.n == int(count.split()[-2])


def test_the_tree_shows_shared_joints_once_and_locked_ones():
    text = chains_text(arm_chains(*model_of("tiago_dual")), "tiago_dual --package 'a=b c'")
    assert text.count("torso_lift_joint\n") == 1
    assert "--tip wrist_left_ft_tool_link --base torso_lift_link" in text
    assert "pinsing analyze tiago_dual --package 'a=b c' --tip" in text
    assert "locked beyond it: hand_left_" in text


def test_a_long_chain_says_why_it_is_better_cut():
    arm = load("human", tip="left_hand")
    assert arm.n == 13
    note = next(n for n in arm.notes if "13 joints are many" in n)
    assert "--base middle_thorax (8 joints)" in note
    assert not any(
        "are many" in n for n in load("human", tip="left_hand", base="middle_thorax").notes
    )
    assert long_chain_note(*[model_of("ur5")[0], 6]) == ""


@pytest.mark.slow
def test_too_many_joints_in_a_row_are_refused(tmp_path):
    links = [f"l{i}" for i in range(101)]
    joints = [joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(100)]
    path = write(tmp_path, joints, links)
    with pytest.raises(ChainError, match="100 joints in a row: at most 64"):
        load(path)
    assert load(path, base="l60").n == 40
    links = ["a", *(f"l{i}" for i in range(3000))]
    joints = [joint(f"j{i}", "a", f"l{i}") for i in range(3000)]
    with pytest.raises(ChainError, match="3000 chains could be the arm"):
        load(write(tmp_path, joints, links))
