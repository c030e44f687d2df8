"""Suggested configurations: their clearance against a search of its own, odd arms, the command."""

import dataclasses
import json
import re
import shlex

import numpy as np
import pytest
from command_line import run
from dh_arms import dh_arm
from kernel import needs_kernel
from singular_sets import Joint, arm_of, build, closed
from tiers import tiered

import pinsing
from pinsing.errors import PinsingError
from pinsing.robot.arm import Arm

pytestmark = needs_kernel  # without it a suggestion takes minutes


def holds(arm: Arm, found: pinsing.proximity.Suggestion, forms: object) -> None:
    """What a suggestion says is so, asked of `clearance` anew."""
    assert ((found.q >= arm.lower) & (found.q <= arm.upper)).all()
    true = pinsing.clearance(forms, found.q, certify=True)
    assert found.lower <= float(true.upper) + 1e-12
    assert found.lower >= float(true.lower) - 1e-3
    assert found.lower <= found.upper <= found.most
    assert pinsing.at(arm, found.q).status != "singular"


ARMS = ["ur5", "puma560", "stanford", "irb1400", "scara", "z1", "surgical7", "panda"]


@pytest.mark.parametrize("name", tiered(ARMS, ("puma560", "stanford", "scara")))
def test_no_random_configuration_is_clearer_than_is_said_to_be_possible(name: str) -> None:
    arm, form = arm_of(name), closed(name)
    found = pinsing.suggest(arm, forms=form)
    holds(arm, found, form)
    rng = np.random.default_rng(1)
    Q = rng.uniform(*arm.space.span, (400, arm.n))
    seen = pinsing.clearance(form, Q, certify=True, gap=1e-3)
    assert seen.upper.max() <= found.most + 1e-9
    assert found.lower >= seen.lower.max() - 2e-3
    assert found.most - found.lower < (0.2 if name == "panda" else 0.1)  # little more is possible


def test_known_best_clearances():
    scara = pinsing.suggest(arm_of("scara"))
    assert scara.lower == pytest.approx(np.pi / 2, abs=3e-3)
    assert abs(abs(scara.q[1]) - np.pi / 2) < 3e-3
    stanford = pinsing.suggest(arm_of("stanford"), families=["F1", "F3"])
    assert stanford.families == ("F1", "F3")
    assert np.abs(np.sin(stanford.q[[1, 4]])) == pytest.approx([1, 1], abs=1e-4)
    found = pinsing.suggest(arm_of("stanford"))
    assert found.family == "F2"
    assert np.abs(np.sin(found.q[[1, 4]])) == pytest.approx([1, 1], abs=1e-2)


@pytest.mark.parametrize("name", ["ur5", "puma560", "stanford"])
def test_near_a_given_one(name: str) -> None:
    arm, form = arm_of(name), closed(name)
    near, reach = np.zeros(arm.n), 0.3
    found = pinsing.suggest(arm, forms=form, near=near, reach=reach)
    holds(arm, found, form)
    weight = 1 / arm.space.metric
    assert np.linalg.norm((found.q - near) * weight) <= reach + 1e-9
    assert found.most <= reach + 1e-6  # the zero pose of each is singular
    rng = np.random.default_rng(2)
    step = rng.normal(size=(2000, arm.n))
    step *= reach * rng.random((2000, 1)) ** 0.2 / np.linalg.norm(step, axis=1, keepdims=True)
    Q = near + step / weight
    Q = Q[((arm.lower <= Q) & (arm.upper >= Q)).all(axis=1)]
    assert pinsing.clearance(form, Q).lower.max() <= min(found.most, found.lower + 5e-3)
    matter = {j for f in form.families for b in f.branches for j in b.involved}
    idle = [j for j in range(arm.n) if j not in matter]
    assert (found.q[idle] == 0).all()  # what does not matter stays


def test_arms_without_limits_and_continuous_joints() -> None:
    bounded = build(
        [Joint(d=0.2), Joint(np.pi / 2, 0.1), Joint(a=0.4)], (0.3, 0, 0), task="position"
    )
    rows = (90, 0.3, 0.1), (0, 0.3, 0.1), (0, 0.2, 0)
    free = dh_arm([(*row, 0, "continuous") for row in rows], "position")
    assert np.isinf(free.lower).all()
    for arm in (bounded, free):
        found = pinsing.suggest(arm)
        assert np.isfinite(found.q).all()
        assert 0.3 < found.lower <= found.upper <= found.most
        assert pinsing.at(arm, found.q).status == "regular"


def test_an_arm_that_is_never_singular():
    arm = build([Joint(d=0.2)])
    found = pinsing.suggest(arm)
    assert (found.lower, found.families) == (np.inf, ())
    assert "No configuration of this arm is singular" in str(found)
    assert json.loads(found.to_json())["lower"] == "inf"
    arm = build([Joint(), Joint(a=0.4, limits=(0.3, 0.3)), Joint(a=0.3)], (0.2, 0, 0), "vx,vy")
    found = pinsing.suggest(arm)
    assert found.q[1] == 0.3
    slides = build([Joint(slides=True), Joint(alpha=np.pi / 2, slides=True)])
    assert pinsing.suggest(slides).lower == np.inf


def test_families_that_are_missing_are_said() -> None:
    arm = arm_of("panda")
    poor = pinsing.closed_form(arm, seconds=0.02)
    assert not poor.complete
    found = pinsing.suggest(arm, forms=poor)
    assert not found.complete
    assert any("not complete" in n for n in found.notes)
    assert pinsing.at(arm, found.q).status == "regular"
    # What is missing only makes clearances less: the bound from above holds.
    known = dataclasses.replace(closed("ur5"), complete=False)
    assert pinsing.suggest(arm_of("ur5"), forms=known, work=1.0).most < 1.6
    if not found.families:
        assert found.lower == 0.0
        assert "Clearance unknown" in str(found)


@pytest.mark.slow
def test_thirteen_joints_get_one_without_a_proof() -> None:
    rng = np.random.default_rng(0)
    arm = build([Joint(rng.uniform(-1, 1), rng.uniform(0, 0.3)) for _ in range(13)])
    found = pinsing.suggest(arm)
    assert not found.complete
    assert found.lower <= found.upper
    assert pinsing.at(arm, found.q).status == "regular"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"near": [0, 0]}, "near needs 6 values"), ({"near": [0, 0, 0, 0, np.nan, 0]}, "nan"),
        ({"near": [0, 0, 0, 0, 0, 0], "reach": 0.0}, "reach must be a positive number"),
        ({"near": [0, 0, 0, 0, 0, 0], "reach": np.inf}, "reach must be a positive number"),
        ({"seed": -1}, "seed"), ({"work": 0.0}, "work must be positive"),
        ({"families": ["F9"]}, "F9"), ({"forms": []}, "forms"),
    ],
)  # fmt: skip
def test_bad_input(options: dict[str, object], said: str) -> None:
    with pytest.raises(PinsingError, match=said):
        pinsing.suggest(arm_of("ur5"), **options)


@pytest.mark.slow
@pytest.mark.parametrize(("words", "unit"), [([], np.radians(1)), (["--rad"], 1.0)])
def test_what_is_printed_can_be_pasted(words: list[str], unit: float) -> None:
    done = run("at", "--suggest", "puma560", *words)
    assert done.exit_code == 0
    first = done.stdout.splitlines()[0]
    at = run("at", "puma560", *shlex.split(first))
    assert at.exit_code == 0
    assert "regular" in at.stdout
    said = re.search(r"Proven: no singular configuration within ([\d.]+)", done.stdout)
    q = first.split("--q ")[1].replace("pi/2", f"{np.pi / 2}").split(",")
    true = pinsing.clearance(closed("puma560"), unit * np.array(q, dtype=float), certify=True)
    assert unit * float(said[1]) <= float(true.upper)
