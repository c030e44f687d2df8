"""Families: membership, distance, samples, limits, names; and closed forms in words."""

import itertools
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from arms import differences, place, serial
from click.testing import Result
from command_line import run
from dh_arms import CRX, dh_arm
from pages import baked
from public import script
from singular_sets import RIGHT, ROBOTS, Joint, arm_of, build, closed
from tiers import tiered, tiered_rows

import pinsing
from pinsing.algebra import budget
from pinsing.algebra.budget import Budget
from pinsing.description.catalog import data_folder
from pinsing.description.urdf import read_description
from pinsing.errors import ConfigurationError, PinsingError, ResultError, UnknownNameError
from pinsing.families import ClosedForm, certificate, closed_form
from pinsing.families.certificate import prove_briefly, within
from pinsing.families.form import certainty, families_text
from pinsing.measures import Reachability
from pinsing.proximity.monitor import make_guard
from pinsing.robot.load import load
from pinsing.robot.models import build_model

EQUATIONS = [("puma560", 2), ("ur5", 2), ("surgical7", 3), ("xarm7", 2), ("so101", 1)]


@pytest.mark.parametrize(("name", "index"), tiered_rows(EQUATIONS, EQUATIONS[:3]))
def test_whole_turns_do_not_matter(name: str, index: int) -> None:
    family = closed_form(load(**ROBOTS[name], units="rad"), prove=False).families[index]
    rng = np.random.default_rng(14)
    on = family.points(10, rng)
    turns = np.where(family.prismatic, 0.0, 2 * np.pi * rng.integers(-2, 3, on.shape))
    assert family.contains(on + turns).all()
    q = rng.uniform(-3, 3, family.n)
    # The starts of the iteration turn along, so that the same minimum is found.
    assert family.distance(q + turns[0]).value == pytest.approx(family.distance(q).value, abs=1e-9)


def test_distance_of_a_slider_is_over_the_length_scale() -> None:
    long = closed_form(arm_of("stanford").with_task(length_scale=0.25))
    slide = next(f for f in long.families if f.prismatic[2] and f.values[0].keys() == {2})
    q = np.full(6, 0.7)
    found = slide.distance(q)
    assert (found.value, found.q[2]) == (pytest.approx(0.7 / 0.25), 0.0)
    np.testing.assert_array_equal(np.delete(found.q, 2), np.delete(q, 2))
    assert slide.contains(q * [1, 1, 1e-7, 1, 1, 1], tol=1e-6)
    assert not slide.contains(q * [1, 1, 1e-6, 1, 1, 1], tol=1e-6)
    with pytest.raises(ConfigurationError, match="one configuration"):
        slide.distance(np.stack([q, q]))


@pytest.mark.parametrize(
    "name", tiered(["ur5", "iiwa14", "surgical7", "xarm7", "so101"], ("ur5", "surgical7"))
)
def test_tolerance_of_contains_is_a_distance(name: str) -> None:
    rng = np.random.default_rng(16)
    for family in closed(name).families:
        base = family.points(12, rng)
        moved = base + rng.normal(size=base.shape) * 1e-3
        gaps = np.array([family.distance(q).value for q in moved])
        inside = np.array([bool(family.contains(q, 1e-3)) for q in moved])
        clear = np.abs(gaps - 1e-3) > 1e-4
        np.testing.assert_array_equal(inside[clear], (gaps < 1e-3)[clear])


INF = np.inf
# Limits, whether a value is within them, and of a slide where that is.
LIMITS = [
    (-1.0, 1.0, True), (0.1, 3.0, False), (0.1, 3.2, True), (6.0, 6.5, True), (15.0, 16.0, True),
    (-15.5, -13.0, False), (0.0, 0.0, True), (-20.0, 20.0, True), (-INF, INF, True),
    # Also beyond what is drawn, where no limit ends it.
    (-INF, INF, True, -4.0), (-INF, INF, True, -40.0), (1.0, INF, True, 200.0),
    (-INF, 5.0, True, -200.0), (1.0, INF, False, -2.0), (-INF, 5.0, False, 5.5),
]  # fmt: skip


@pytest.mark.parametrize("case", LIMITS, ids=str)
def test_joint_values_within_limits(case: tuple[Any, ...]) -> None:
    """Two turns, or a turn and a slide along x: the tip is on the axis at one position."""
    low, high, reached, *position = case
    arm = build([Joint(), Joint(a=0.4, limits=(low, high))], (0.3, 0.0, 0.0), "position")
    if position:
        joints = [(pin.JointModelRZ(), place(), -3, 3), (pin.JointModelPX(), place(), low, high)]
        arm = load(serial(joints, place((-position[0], 0, 0))), tip="tip", task="vx,vy")
    (family,) = closed_form(arm).families
    assert (family.is_reachable, family.witness is not None) == (reached, reached)
    assert family.reachability == ("reachable" if reached else "not reachable")
    assert {value.reachability for value in family.value_reach} >= {family.reachability}
    inside = family.sample(9, np.random.default_rng(1))
    assert len(inside) == (9 if reached else 0)
    assert arm.within_limits(inside, 1e-9).all()
    points = family.points(9, np.random.default_rng(1))
    assert len(points) == 9
    assert family.contains(points).all()
    if position:
        assert (inside[:, 1] == position[0]).all()
    else:
        np.testing.assert_allclose(np.sin(inside[:, 1]), 0.0, atol=1e-12)
        assert np.isfinite(low) or (np.abs(inside) <= np.pi + 1e-9).all()


def test_a_family_without_real_points_says_so() -> None:
    """The locus 0.15 + 0.6 cos q2 + 0.5 cos(q2+q3) = 0 of an arm whose shoulder is offset."""
    arm = build([Joint(), Joint(RIGHT, 0.15), Joint(a=0.6)], (0.5, 0.0, 0.0), "position")
    family = next(f for f in closed_form(arm).families if f.equations)
    (branch,) = family.branches
    (equation,) = branch.equations
    lifted = replace(equation, cos=np.where(equation.cos == 0.15, 5.0, equation.cos))
    assert not np.array_equal(lifted.cos, equation.cos)
    empty = replace(family, branches=(replace(branch, equations=(lifted,)),))
    with pytest.raises(ConfigurationError, match="no real point"):
        empty.distance(np.zeros(3))
    assert not empty.contains(np.zeros((4, 3)), 1.0).any()
    assert len(empty.points(3, np.random.default_rng(1))) == 0


SCARA = [
    (0, 0.25, 0.35, 0, "revolute", (-152, 152)), (0, 0.225, 0, 0, "revolute", (-142, 142)),
    (0, 0, 0, 0, "prismatic", (-0.2, 0)), (0, 0, 0),
]  # fmt: skip


@pytest.mark.slow
def test_the_value_inside_is_named() -> None:
    (elbow,) = closed_form(dh_arm(SCARA)).families
    assert elbow.reachability is Reachability.INSIDE
    assert elbow.reach == "within the joint limits with q2 = 0° (not 180°)"
    turned = replace(elbow, lower=elbow.lower + math.tau, upper=elbow.upper + math.tau)
    assert turned.reach == "within the joint limits with q2 = 360° (not 180°)"
    assert [(v.joint, v.value, v.reachability) for v in elbow.value_reach] == [
        (1, 0.0, Reachability.INSIDE),
        (1, pytest.approx(math.pi), Reachability.OUTSIDE),
    ]


UR = {"shoulder": "wrist center above the base axis"}


def titles(arm: pinsing.Arm) -> dict[str, str]:
    """Title and condition of the families that have one."""
    return {f.title: f.where() for f in closed_form(arm, prove=False) if f.title}


def unproven(name: str) -> ClosedForm:
    return closed_form(load(name), prove=False)


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


NAMED = {
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
            model = build_model(read_description(path))
            for tip, base, _ in script("oracle.survey").all_chains(model, []):
                arm = load(path, tip=tip, base=base)
                if arm.n in (6, 7) and (found := titles(arm)):
                    named[arm.name, arm.tip] = found
        except PinsingError:
            continue
    for found in named.values():
        assert "elbow" not in found or ELBOW.search(found["elbow"])
    assert {robot for robot, _ in named} == NAMED, named


def test_lookup_and_json() -> None:
    form = unproven("ur5")
    assert form["wrist"] is form["F2"]
    assert all(name in form for name in ("wrist", "F2", form["F2"]))
    assert not any(name in form for name in ("Wrist", "F4", "", 2))
    assert [f.name for f in form] == ["F1", "F2", "F3"]
    with pytest.raises(UnknownNameError, match="elbow"):
        form["elbo"]
    again = pinsing.ClosedForm.from_json(form.to_json())
    assert again["shoulder"].name == "F3"
    q = np.array([0, -1.2, 1.3, -1, np.pi, 0])
    assert form["wrist"].where(q) == "wrist_2_joint = 180°"


@pytest.mark.parametrize("name", ["ur5", "stanford", "iiwa14"])
def test_gradients(name: str) -> None:
    form = unproven(name)
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
    said = unproven("xarm7")["F2"].where()
    assert said == "joint4 = 184.9328° and joint6 = -6.9298°"


# In words: how sure they are, in one word everywhere, and the list of families.


# The arms of the gallery, as its pages are made (`docs/_ext/gallery.py`), and some whose families
# are long or whose certificate takes long.
EVERYWHERE = ["ur5", "stanford", "scara", "panda", "iiwa14", "xarm7", "puma560", "surgical7"]
EVERYWHERE += ["so101", "examples/offset_wrist.dh.yaml", "kinova", "talos_arm"]


def written(*words: str | Path) -> Result:
    result = run(*map(str, words))
    assert result.exit_code == 0, result.output
    return result


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("robot", tiered(EVERYWHERE, {"scara"}))
def test_one_arm_has_one_word_everywhere(robot: str, tmp_path: Path) -> None:
    arm = pinsing.load(robot)
    form = pinsing.closed_form(arm)
    assert form.word == "proven", form.proof
    words = {
        "text": certainty(form).split(":")[0].strip(),
        "families": re.findall("proven|probable|NOT", written("families", robot).stdout)[0],
    }
    out = {name: tmp_path / name for name in ("a.json", "page.html", "report.html", "guard.h")}
    written("families", robot, "-o", out["a.json"])
    words["JSON"] = json.loads(out["a.json"].read_text())["word"]
    words["JSON, read"] = pinsing.ClosedForm.from_json(out["a.json"].read_text()).word
    written("view", robot, "--skeleton", "-o", out["page.html"])  # as the gallery's
    words["page"] = baked(out["page.html"].read_text())["coverage"].split(":")[0].lower()
    with pinsing.Viewer(arm, skeleton=True) as viewer:
        words["live page"] = viewer._coverage.split(":")[0].lower()
    words["analyze"] = pinsing.analyze(arm, levels=(1,), random_starts=2).closed_form.word
    written("report", robot, "--skeleton", "--page", "none", "-o", out["report.html"])
    badge = r'class="badge[^"]*">(proven|probable|not complete)<'
    (words["report"],) = {*re.findall(badge, out["report.html"].read_text(encoding="utf-8"))}
    written("export", robot, "-o", out["guard.h"])
    words["guard"] = re.findall(r'_WORD "(.*)"', out["guard.h"].read_text())[0]
    words["in Python"] = make_guard(arm, "c").word
    said = {re.split(" for | of the", word)[0] for word in words.values()}
    assert said == {form.word}, words


def test_the_word_does_not_hang_on_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work is counted the same by every clock; a cap on seconds is said to be one."""
    form = pinsing.closed_form(arm_of("puma560"), prove=False)
    spent = []
    for tick in (1e-5, 4e-4):
        clock = SimpleNamespace(monotonic=itertools.count(0.0, tick).__next__)
        with monkeypatch.context() as patch:
            patch.setattr(budget, "time", clock)
            whole = Budget(1000.0, certificate.SHORT)
            assert within(form, whole, None).word == "proven"
            spent.append(whole.meter.done)
    assert spent[0] == spent[1] > 1e4
    assert prove_briefly(form, 1e-9).proof.reason.startswith("none was found in")


def test_what_took_longer_has_one_headline_or_says_what_to_do(monkeypatch) -> None:
    """The search that nobody asked for never has the time."""
    monkeypatch.setattr(certificate, "SHORT", 0.0)
    text = " ".join(written("families", "puma560", "--prove").stdout.split())
    assert text.startswith("3 families of singular configurations (closed forms, ")
    assert "; whether these are all stands at the end: F1 " in text
    assert text.rpartition(" proven: ")[2].startswith("certificate of ")
    assert "probable" not in text
    assert "no certificate" not in text
    text = " ".join(written("families", "puma560", "-v").stdout.split())
    assert "no certificate: none was found in the 0 s of work allowed" in text
    assert "--prove, or prove=True, looks for one for 60 s" in text
    assert text.startswith("puma560: 3 families of singular configurations (probably complete)")


def test_a_search_that_failed_is_not_called_out_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise certificate.NotFound("a place could not be split")

    monkeypatch.setattr(certificate, "certificate", fail)
    form = prove_briefly(pinsing.closed_form(arm_of("puma560")), 100.0)
    assert form.proof.reason == "a place could not be split"
    assert not form.proof.out_of_time
    assert "no certificate: a place could not be split" in " ".join(certainty(form).split())


def test_half_angles_are_explained_where_they_are_printed():
    """Upper arm and forearm are equally long, so that they fold at one value of q3."""
    rows = [(*row[:2], 0.71) if row[2] == 0.54 else row for row in CRX]
    equal_links = pinsing.closed_form(dh_arm(rows), prove=False)
    assert equal_links.families[0].text == "q3 = 90°"
    text = " ".join(families_text(equal_links).split())
    assert "cos((3 q3)/2)" in text
    assert "half of q3 in F2: equations are factors of a longer one" in text
    text = families_text(closed("ur5"))
    assert "half of" not in text
    # Names of joints stand before the families, and nowhere where symbols are their names.
    assert text.index("joints: q1 = shoulder_pan_joint") < text.index("  F1  ")
    assert "joints:" not in families_text(closed("stanford"))
    equation = equal_links.families[1].branches[0].equations[0]
    q = np.array([0.3, 0.7, -1.1, 0.9, 1.3, 0.2])
    here, there = equation(q), equation(q + 2 * np.pi * np.eye(6)[2])
    assert abs(here) > 1e-3
    assert there == pytest.approx(-here)


@pytest.mark.slow
def test_a_single_term_has_no_number():
    form = pinsing.closed_form(pinsing.load("panda", task="position"), prove=False)
    assert " and sin(q3+q5) = 0" in " ".join(str(form).split())
