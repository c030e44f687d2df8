"""Robots that are imperfect copies of a design: the tube about its families, and what is told."""

import importlib
import math
import pickle
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command_line import run
from public import ROOT, script
from tiers import tiered

import pinsing
from pinsing.algebra.trig_sum import TrigSum
from pinsing.errors import OptionError, RobotFileError
from pinsing.families import tube as tubes
from pinsing.families.family import Family
from pinsing.families.form import coverage_words, families_text
from pinsing.proximity.clearance import distances
from pinsing.proximity.monitor import make_guard
from pinsing.report.arm_report import describe, gather, robot
from pinsing.robot.arm import Arm
from pinsing.robot.calibration import calibrated, known_like
from pinsing.robot.nominal import assumed_design, design_of, differences, flatten, on_chain

designs = importlib.import_module("pinsing.robot.nominal")
Q = np.array([0.0, -1.2, 1.3, -1.0, -1.5, 0.0])
FILE = ROOT / "tests" / "words" / "files" / "ur5e.calibration.yaml"
"""A calibration of a UR5e."""


@pytest.fixture(scope="module")
def attack():
    """The script that attacks tubes."""
    return script("tube")


@pytest.fixture(scope="module", autouse=True)
def few_boxes() -> Iterator[None]:
    """Tubes are wide, and as true; that of a robot about a design is found once."""
    known: dict[bytes, tubes.Tube] = {}

    def once(robot: Arm, design: Arm, families: Sequence[Family]) -> tubes.Tube:
        key = pickle.dumps((flatten(robot), flatten(design), *robot.span))
        if key not in known:
            known[key] = tubes.find_tube(robot, design, families)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tubes, "MOST", 40_000)
        patch.setattr("pinsing.families.solve.find_tube", once)
        yield


@pytest.fixture(scope="module")
def form() -> pinsing.ClosedForm:
    """A calibrated UR5e."""
    return pinsing.closed_form(calibrated(pinsing.load("ur5e"), FILE))


def guard_of(form: pinsing.ClosedForm) -> Callable[[np.ndarray], np.ndarray]:
    """Clearance by an exported guard."""
    guard: dict[str, Any] = {}
    exec(pinsing.export_guard(form.loaded, "python", forms=form), guard)
    return guard["clearance"]


def test_tube_is_proven_and_holds_every_singular_configuration(form, attack):
    assert form.tube.proven
    assert all(f.persists and f.lower < f.width <= form.tube.width for f in form.tube.families)
    product = tubes.factorize(form.loaded, form.geometry.arm, form.families)
    # None is claimed of tubes that hold every configuration.
    assert tubes._two_sides(product, np.full(4, 0.1), 0.2) == [True] * 3
    assert tubes._two_sides(product, np.full(4, np.pi), np.pi) == [False] * 3
    found = attack.find_singular(form.loaded, np.random.default_rng(5).uniform(-3, 3, (150, 6)))
    wrong, (_, far) = attack.outside(form, found)
    assert (len(found) > 50, wrong) == (True, 0)
    assert 0.001 < far < form.tube.width
    # Paths across its walls meet one.
    wrong, tried = attack.unmet(form, 300, np.random.default_rng(7))
    assert (wrong, tried > 30) == (0, True)


@pytest.mark.parametrize(
    "name", tiered(["ur5e", "crx10ia", "xarm6", "iiwa14", "panda"], {"xarm6", "iiwa14"})
)
def test_boxes_keep_their_zeros_and_none_is_farther_than_told(name, attack):
    arm, rng = pinsing.load(name), np.random.default_rng(2)
    families = pinsing.closed_form(arm, prove=False).families
    product, F = tubes.factorize(attack.perturb(arm, rng), arm, families), len(families)
    d = len(product.joints)
    starts = rng.uniform(0, 6, (800 // (d - 3) ** 2, d))
    zeros = product.search(starts)
    if product.arm is None:
        # And those of a robot between the design and this one: that walls persist rests on them.
        plain, r, h = product.sums
        half_rest = TrigSum(r.amplitude / 2, r.phase, r.rate, r.power, r.noise)
        between = replace(product, sums=(plain, half_rest, h)).search(starts)
        zeros = np.concatenate([zeros, between])
    far = tubes._proven(product, families, zeros)
    near = tubes._about(product, zeros)[..., 0].min(axis=1)
    assert (near <= far.min(axis=1) * 1.1 + 1e-3).mean() > 0.8
    for size in (0.3, 0.03, 0.003):
        half = rng.uniform(0.1, 1, zeros.shape) * size
        boxes = np.zeros((len(zeros), 12 + F))
        boxes[:, :d], boxes[:, 5 : 5 + d] = zeros + half * rng.uniform(-1, 1, half.shape), half
        boxes[:, 10:-1], boxes[:, -1] = 1e9, (split := rng.integers(0, d, len(zeros)))
        side = np.take_along_axis(zeros > boxes[:, :d], split[:, None], axis=1)[:, 0]
        found = tubes.halve(product, boxes).reshape(-1, 2, 12 + F)[range(len(zeros)), side * 1]
        assert (abs(zeros - found[:, :d]) <= found[:, 5 : 5 + d] + 1e-12).all()
        assert (far.min(axis=1) <= found[:, 10 + F] + 1e-12).all()
        for k in range(F):
            alone = (np.delete(far, k, axis=1) > np.maximum(far[:, [k]], tubes.NEAR)).all(axis=1)
            assert (far[alone, k] <= found[alone, 10 + k] + 1e-12).all()


@pytest.mark.slow
def test_one_curved_family_is_not_told_wider_than_it_has_to_be(attack, monkeypatch) -> None:
    """An arm whose only family is a surface shows what each part of the search is worth."""
    monkeypatch.setattr(tubes, "MOST", 1_000_000)
    design = pinsing.load("gofa5")
    robot = attack.perturb(design, np.random.default_rng(0))
    tube = pinsing.closed_form(robot, design=design, prove=False).tube
    assert tube.proven
    assert math.degrees(tube.width) < 10.5  # 10.04; without some parts of it 20 and more


def test_bounds_are_about_the_robot(form, attack) -> None:
    found = attack.find_singular(form.loaded, np.random.default_rng(6).uniform(-3, 3, (60, 6)))
    near = found + 0.05 * np.eye(6)[np.arange(len(found)) % 6]
    for certify in (False, True):
        assert not pinsing.clearance(form, found, certify=certify).lower.any()
        assert (pinsing.clearance(form, near, certify=certify).lower <= 0.05).all()
    monitor = pinsing.Monitor(form, warn=0.2, stop=0)
    assert {monitor.update(q).lower for q in found} == {0.0}
    guard = guard_of(form)
    assert not guard(found).any()
    there = pinsing.clearance(form, Q)
    assert guard(Q) == pytest.approx(float(there.lower), abs=1e-9)
    assert (there.nominal, there.of_design) == (False, True)
    assert " rad from F3 of the design (" in str(there)
    assert "3 families of the design" in repr(monitor)
    assert "the nearest family shoulder (F3)" in str(monitor.update(Q))
    said = pinsing.Monitor(form, weights=np.full(6, 0.5)).update(Q, np.eye(6)[1])
    assert said.time_to_contact == pytest.approx(said.lower / 0.5)  # at the speed, weighted once


def test_a_motion_meets_the_robots_own_singular_configuration(form, attack):
    wrist = np.random.default_rng(6).uniform(-3, 3, (60, 6)) * (1, 1, 1, 1, 0, 1)
    found = attack.find_singular(form.loaded, wrist)
    # From the singular configuration towards the wrist of the design, which is not met.
    q = next(q for q in found if 1e-4 < q[4] < 0.02 and abs(q[2]) > 0.5)
    Q = q + np.outer([2, -0.9], q * (0, 0, 0, 0, 1, 0))
    check = pinsing.check_trajectory(form.loaded, Q, [0, 2.9], forms=form)
    (own,) = check.own_crossings
    assert (check.crossings, own.family) == ((), "F2")
    assert own.t == pytest.approx(2, abs=1e-3)
    assert math.isinf(max(e.worst for e in check.costly))
    said = check.text()
    assert "crosses a singular configuration of this robot itself at t = 2" in said
    across = pinsing.check_trajectory(form.loaded, [Q[0], 2 * q - Q[0]], [0, 2.9], forms=form)
    assert "(this robot itself at t = " in across.text().replace("\n  ", " ")


def test_far_from_other_families_the_width_of_the_nearest_is_taken_off(form):
    near = np.random.default_rng(1).uniform(-3, 3, (400, 6))
    others = pinsing.clearance(form, near, families=["elbow", "wrist"]).lower
    found = pinsing.clearance(form, near, certify=True)
    alone = others > found.upper + tubes.NEAR
    assert alone.sum() > 20
    assert (found.lower >= found.upper - form.tube.alone - 1e-3)[alone].all()


def test_without_a_tube_the_robots_jacobian_bounds_its_clearance(attack, monkeypatch):
    # As where nothing is compiled.
    nothing = SimpleNamespace(available=lambda: False, unavailable_reason=lambda: "no compiler")
    monkeypatch.setattr(tubes, "engine", nothing)
    panda = pinsing.load("panda")
    rng = np.random.default_rng(3)
    robot = attack.perturb(panda, rng)
    assumed = pinsing.load(robot.model).design
    # Its elbow's two offsets cancel, as they do not with the lengths of the robot.
    design = pinsing.closed_form(panda, prove=False)
    form = pinsing.closed_form(replace(robot, design=assumed), prove=False)
    each = [
        [[(c.joint, round(c.value, 2)) for c in f.branches[0].values] for f in of.families]
        for of in (form, design)
    ]
    assert each[0] == each[1]
    assert not form.tube.proven
    assert "from these is NOT proven: no compiler." in str(form.tube)
    q = [0, -0.5, 0.3, -2, 0.4, 1.5, 0]
    radius = pinsing.kinematics.regular_radius(form.loaded, q)
    assert radius > 0.1
    for certify in (False, True):
        assert pinsing.clearance(form, q, certify=certify).lower == pytest.approx(radius)
    assert pinsing.Monitor(form).update(q).level == "clear"
    assert distances(form, np.array(q)).families[0].lower == pytest.approx(radius)
    found = attack.find_singular(form.loaded, rng.uniform(panda.lower, panda.upper, (60, 7)))
    steps = 0.05 * rng.normal(size=found.shape)
    lower = pinsing.clearance(form, found + steps).lower
    assert (lower <= np.linalg.norm(steps, axis=1)).all()
    assert (len(found) > 20, np.median(lower) > 0.02) == (True, True)


def test_a_tube_within_the_limits_is_not_taken_off_beyond_them(form) -> None:
    upper = np.where(np.arange(6) == 2, np.pi, form.loaded.upper)
    loaded = replace(form.loaded, upper=upper)
    tube = replace(form.tube, within_limits=True, reason="it was too wide")
    of = replace(form, tube=tube, loaded=loaded, arm=replace(form.arm, upper=upper))
    assert "of this robot within its joint limits lies within" in str(of.tube)
    assert "beyond the limits: on full circles it was too wide." in str(of.tube)
    assert type(of).from_json(of.to_json()).tube == of.tube
    half = np.array([0.0, -1.2, np.pi, -1.0, -1.5, 0.0])  # the elbow at its limit
    ways = np.stack([half - d * np.eye(6)[2] for d in (1.0, 0.5, 1e-6, -1e-6, -0.1)])
    lower, whole = pinsing.clearance(of, ways).lower, pinsing.clearance(form, ways).lower
    assert lower[:3] == pytest.approx(whole[:3])
    radius = pinsing.kinematics.regular_radius(form.loaded, ways)
    upper = pinsing.clearance(of, ways).upper
    assert lower[3:] == pytest.approx(np.minimum(radius, upper)[3:])
    near = half - 0.8 * np.eye(6)[2]
    assert pinsing.clearance(of, near, certify=True).lower > radius[0]
    assert pinsing.Monitor(of, warn=0.2, stop=0).update(ways[4]).lower == lower[4]
    guarded = guard_of(of)(ways)
    assert guarded[3:].tolist() == [0.0, 0.0]
    assert guarded[0] > 0.4
    aside = ways + np.array([0.0, 0.0, 0.2, 0.0, 0.0, 0.0])  # ends 0.3 rad beyond
    for way, proven in ((ways[:2], True), (aside[[1, 4]], False)):
        checks = (pinsing.check_trajectory(f, way) for f in (form, of))
        plain, limited = (min(a.lower for a in c.approaches) for c in checks)
        assert (limited == plain > 0) == proven
        assert proven or limited == 0


def test_lengths_that_may_be_one_are_in_a_found_design() -> None:
    t = np.array([[0.0832, 0, 0.3], [-0.0820, 0.1, 0.0]])  # each within a millimetre of one
    assert designs._with_equal_lengths(t, 1e-3)[:, 0].tolist() == [0.0826, -0.0826]


@pytest.mark.slow
def test_the_design_is_found_or_refused() -> None:
    ur5e = pinsing.load("ur5e")
    assert pinsing.closed_form(ur5e, design=True, prove=False).tube is None
    assert not any(pinsing.load(name).design for name in ("ur5e", "crx10ia", "panda"))
    chain = flatten(ur5e)
    t = chain.t + np.random.default_rng(4).uniform(-8e-5, 8e-5, chain.t.shape)
    # As an export from CAD.
    assert assumed_design(on_chain(ur5e, replace(chain, t=t)))
    assert max(d.angle for d in differences(ur5e, design_of(ur5e, pinsing.load("ur5e")))) < 1e-9
    for name, said in (("puma560", "another robot"), ("panda", "7 joints")):
        with pytest.raises(OptionError, match=said):
            design_of(ur5e, pinsing.load(name))


def test_list_says_of_the_design_what_families_say(form) -> None:
    arm = form.loaded
    found = replace(arm, design=assumed_design(arm))  # as of a URDF
    for each in (form, pinsing.closed_form(found, prove=False)):
        info = describe(each.loaded)
        by_axis = designs.assumptions(each.tube.assumed)
        assert info.geometry() == f"families are of {each.deviation}; {by_axis}"
        assert by_axis in " ".join(families_text(each).split())
        assert type(info).from_json(info.to_json()).geometry() == info.geometry()
    same = replace(pinsing.load("ur5e"), design=pinsing.load("ur5e"))
    assert "families are of" not in describe(same).geometry()


def test_a_calibration_is_named_with_the_robot(form) -> None:
    shown = run("list", "ur5e", "--calibration", FILE).stdout
    assert f"arms.yaml with calibration {FILE}" in " ".join(shown.split())
    assert "moved: " not in shown
    arm = form.loaded
    for text in (make_guard(arm, "python", forms=form).text, robot(gather(arm, form))[-1]):
        assert f"ur5e with calibration {FILE}" in text
    assert form.arm.typed == f"ur5e --tip tool0 --calibration {FILE}"
    with pinsing.Viewer(arm, form.families, coverage=coverage_words(form), skeleton=True) as viewer:
        page = viewer._page(live=False)
    assert f"described by ur5e with calibration {FILE}" in page["notes"]
    assert str(form.tube) in page["coverage"]


@pytest.mark.slow
def test_calibrations_are_read_strictly(form, tmp_path: Path) -> None:
    arm, ur5e = form.loaded, pinsing.load("ur5e")
    assert calibrated(ur5e, FILE).design is ur5e
    assert assumed_design(arm)
    one, other = (pinsing.kinematics.frame_jacobian(a, np.zeros(6)) for a in (ur5e, arm))
    assert 1e-4 < np.abs(one - other).max() < 1e-2
    bad = tmp_path / "bad.yaml"
    for old, new, words in (
        ("roll: 1.5708,", "roll: 90,", "wrist_2: roll: 90 is no angle in radians"),
        ("  wrist_3: {", "  # {", "missing key 'wrist_3'"),
    ):
        bad.write_text(FILE.read_text().replace(old, new))
        with pytest.raises(RobotFileError, match=words):
            calibrated(ur5e, bad)
    for of, words in (
        (pinsing.load("puma560"), rf"{FILE.name}: 'puma560' is another robot"),
        (arm, "is itself off one, as after a calibration"),
        (pinsing.load("panda"), "is for a UR robot"),
    ):
        with pytest.raises(OptionError, match=words):
            calibrated(of, FILE)
    chain = flatten(arm)
    for much, odd in ((0.0, False), (3e-3, True)):
        heavy = replace(chain, t=chain.t + much * np.sin(np.arange(21)).reshape(7, 3))
        loose = on_chain(arm, heavy, design=None)
        loose = replace(loose, design=assumed_design(loose))
        assert designs.is_odd(loose) == odd
        assert known_like(loose)[0] == "ur5e"


@pytest.mark.slow
def test_two_walls_may_be_passed_where_they_meet(form) -> None:
    assert "across one of them by more than that, away from the others" in str(form.tube)
    ends = [0.9, -0.5, 0.2, 1.1, -0.2, -0.9], [0.9, -0.5, -0.2, 1.1, 0.2, -0.9]
    found = pinsing.postures.connect(form, *ends)
    assert (found.answer, found.proven) == ("different", False)
    assert "different aspects" in found.text()
    assert "of the design: every path" in found.text()
    assert any("may pass between them" in note for note in found.notes)
