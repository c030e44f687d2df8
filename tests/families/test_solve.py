"""Closed forms: as known ones, against Pinocchio, and against a search that knows no algebra."""

import itertools
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from arms import place, serial
from dh_arms import HOLLOW, dh_arm
from singular_sets import (
    RIGHT,
    ROBOTS,
    Joint,
    arm_of,
    build,
    check_all,
    check_apart,
    check_beside,
    check_families,
    check_search,
    closed,
    drop,
    moves,
    random_arm,
)
from tiers import tiered, tiered_rows

from pinsing.algebra.components import Component
from pinsing.description.catalog import data_folder
from pinsing.families import ClosedForm, closed_form, prove
from pinsing.families.family import latex_lines
from pinsing.families.form import coverage_words, families_text
from pinsing.families.solve import STEPS, ComponentSearch, all_minors
from pinsing.robot.load import load
from pinsing.robot.nominal import nominal
from pinsing.sampling.analyze import analyze

PI, R = np.pi, RIGHT
ELBOW = ["q3 = 0° or 180°", "q5 = 0° or 180°"]
STRETCHED = ["q2 = 0° or 180° and q3 = 0° or 180°"]
KNOWN = {
    "stanford": ["q2 = 0° or 180°", "d3 = 0", "q5 = 0° or 180°"],
    "puma560": [
        "0.4318 cos q3 + 0.0203 sin q3 = 0 (q3 = -87.3084° or 92.6916°)", "q5 = 0° or 180°",
        "0.4318 cos q2 + 0.0203 cos(q2+q3) - 0.4318 sin(q2+q3) = 0",
    ],
    "irb1400": [
        "0.72 cos q3 + 0.12 sin q3 = 0 (q3 = -80.5377° or 99.4623°)", "q5 = 0° or 180°",
        "0.6 sin q2 + 0.72 cos(q2+q3) + 0.12 sin(q2+q3) + 0.15 = 0",
    ],
    "ur5": [*ELBOW, "0.425 cos q2 + 0.39225 cos(q2+q3) - 0.09465 sin(q2+q3+q4) = 0"],
    "ur10": [*ELBOW, "0.612 cos q2 + 0.5723 cos(q2+q3) - 0.1157 sin(q2+q3+q4) = 0"],
    **{name: STRETCHED for name in ("planar3r", "four parallel joints")},
    **{name: ["q2 = 0° or 180°"] for name in ("scara", "wrist alone", "two joints, position")},
}  # fmt: skip
"""As textbooks have them: that the numbers of families are those of their texts is tested apart."""


@pytest.mark.parametrize("name", KNOWN)
def test_known_forms(name: str) -> None:
    form = closed_form(AWKWARD[name]) if name in AWKWARD else closed(name)
    assert [family.text for family in form.families] == KNOWN[name]


def test_steps_are_named_as_in_the_documentation() -> None:
    assert closed("ur5").steps == ("all minors",)
    page = (Path(__file__).parents[2] / "docs/explain/complete.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1].strip() for line in page.splitlines() if line.startswith("| ")]
    assert rows[1:] == list(STEPS)


def test_each_family_names_the_step_that_found_it(monkeypatch) -> None:
    def first(search: ComponentSearch) -> bool:
        all_minors(search)
        found[:] = search.components
        search.components, search.closed = found[-1:], False
        return True

    def second(search: ComponentSearch) -> bool:
        search.components = found
        return True

    found: list[Component] = []
    monkeypatch.setattr("pinsing.families.solve.STEPS", {"first": first, "second": second})
    form = closed_form(load("ur5"), prove=False)
    assert form.steps == ("first", "second")
    assert sorted(form.step_of.values()) == ["first", "second", "second"]
    assert list(form.step_of) == [f.name for f in form.families]
    assert ClosedForm.from_json(form.to_json()).step_of == form.step_of


def test_a_long_statement_in_latex_has_lines_that_fit_a_page() -> None:
    terms = [rf"{k}.5 \cos (2 q_{{{k}}}) \sin q_{{{k}}}" for k in range(1, 8)]
    long = rf"R \cos (q_{{2}} - \varphi) = 0,\ R \cos \varphi = a ({' + '.join(terms)} - 2) - 1"
    lines = latex_lines(long)
    assert lines[0] == r"R \cos (q_{2} - \varphi) = 0"
    assert " ".join(lines[1:]) == long.split(r",\ ")[1]
    assert max(map(len, lines)) < 130
    assert all(line.count("{") == line.count("}") for line in lines)
    together = r"\text{" + 100 * "a" + " + b}"  # braces are never torn
    assert latex_lines(together) == [together]


AWKWARD = {
    "one joint": build([Joint()]),
    "two parallel joints": build([Joint(), Joint(a=0.3)], (0.2, 0.0, 0.0)),
    "two joints, position": build([Joint(), Joint(a=0.3)], (0.2, 0.0, 0.0), "position"),
    "sliders only": build([Joint(slides=True), Joint(R, slides=True), Joint(R, slides=True)]),
    "slider twice": build([Joint(slides=True), Joint(slides=True, d=0.2), Joint(R)]),
    "wrist alone": build([Joint(), Joint(R), Joint(-R)]),
    "wrist, orientation": build([Joint(), Joint(R), Joint(-R)], task="orientation"),
    "four parallel joints": build([Joint(a=0.3)] * 4, (0.2, 0.0, 0.0)),
    "the same axis twice": build([Joint(), Joint(d=0.1), Joint(R, 0.2), Joint(R, 0.3)]),
    "five in two parallel groups": build(
        [Joint(), Joint(a=0.3), Joint(a=0.2), Joint(R, 0.1), Joint(a=0.25)], (0.1, 0.0, 0.0)
    ),
    "links turned by 45 degrees": build(
        [Joint(theta=PI / 4), Joint(R, 0.1, theta=PI / 4), Joint(a=0.4, theta=-PI / 4),
         Joint(R, 0.02, 0.4, theta=PI / 4), Joint(-R, theta=PI / 4), Joint(R)]
    ),
    "no elbow singularity": build(  # the reach of the second link exceeds what the first has
        [Joint(), Joint(R, 0.1), Joint(R, 0.5, 0.1)], (0.1, 0.02, 0.3), "position"
    ),
    # Where a row of the Jacobian, or all of it, vanishes.
    "all of the task lost": build([Joint(-R, 0.02), Joint(-R, d=-0.18)], task="vx,vy,wz"),
    "a column vanishes": build(
        [Joint(PI), Joint(R), Joint(R, 0.32)], (-0.16, -0.09, -0.2), "vx,vy"
    ),
    "one minor entry": build(
        [Joint(-R), Joint(-R), Joint(PI, 0.2, 0.1, slides=True), Joint(-R, -0.29, 0.39)],
        (0.09, -0.11, 0.18), "position",
    ),
    "RPR, position": build(
        [Joint(), Joint(R, slides=True), Joint(-R, 0.3)], (0.5, 0.1, 0), "vx,vy"
    ),
    "columns vanish, seven joints": build(
        [Joint(-R, d=0.4), Joint(R), Joint(R, -0.35, -0.17), Joint(-R), Joint(-R, d=-0.02),
         Joint(R, slides=True), Joint(-R, 0.35, -0.15)]
    ),
    "rows used up": build(
        [Joint(R, -0.09, -0.28), Joint(0, -0.14, -0.42), Joint(-R, d=-0.09), Joint(R, 0.3),
         Joint(R, -0.35, -0.46), Joint()]
    ),
    # Where roots are double, or three equations meet in points.
    "double roots": build(
        [Joint(R, d=0.01), Joint(PI, -0.47, 0.13, slides=True), Joint(R, d=-0.4),
         Joint(-R, d=-0.21), Joint(-R, d=0.35), Joint(R), Joint(R, d=0.48)],
        (-0.04, -0.21, 0.19),
    ),
    "three equations in two joints": build(
        [Joint(-R, 0.42, -0.06), Joint(R, 0.26, 0.08), Joint(R, -0.44, -0.07),
         Joint(-R, -0.37, slides=True), Joint(), Joint(R, 0.2)]
    ),
}  # fmt: skip
OPEN = {"five in two parallel groups", "rows used up"}
"""Arms for which an honest "not complete" will do."""
NOWHERE_SINGULAR = {"one joint", "two parallel joints", "sliders only", "slider twice"}


@pytest.mark.parametrize("name", tiered(AWKWARD, {*AWKWARD} - {"rows used up", "double roots"}))
def test_awkward_arms(name: str) -> None:
    arm = AWKWARD[name]
    form = closed_form(arm)
    check_families(arm, form, 120)
    if name not in OPEN:
        assert form.complete, form.gaps
    if form.complete:
        check_search(arm, form, 60)
    if name in NOWHERE_SINGULAR:
        assert not form.families
        assert "no singular configurations: the rank is the same everywhere" in str(form)
        assert "no singular configurations known" in form.latex()


SLIDERS = [
    (-1.0, 1.0, "reachable"), (0.1, 0.2, "reachable"), (2.0, 3.0, "not reachable"),
    (-np.inf, np.inf, "reachable"), (0.5, np.inf, "none found"), (-np.inf, 0.25, "reachable"),
]  # fmt: skip


@pytest.mark.parametrize(("low", "high", "word"), tiered_rows(SLIDERS, SLIDERS[::4]))
def test_limits_of_a_slider_hide_no_family(low: float, high: float, word: str) -> None:
    """Turntable, radial slider, and a link of 0.3 m that swings up: d2 + 0.3 cos q3 = 0."""
    slide = Joint(R, theta=R, slides=True, limits=(low, high))
    arm = build([Joint(), slide, Joint(-R, theta=R)], (0.3, 0.0, 0.0), "position")
    form = closed_form(arm)
    assert (form.complete, form.dropped) == (True, 0)
    (mixed,) = (f for f in form.families if f.equations)
    assert mixed.reachability == word
    assert len(mixed.points(20, np.random.default_rng(1))) == 20
    inside = mixed.sample(20, np.random.default_rng(1))
    assert len(inside) == (20 if word == "reachable" else 0)
    assert ((inside[:, 1] >= low - 1e-9) & (inside[:, 1] <= high + 1e-9)).all()


def test_lengths_snapped_away_may_lower_the_rank() -> None:
    arm = build([Joint(), Joint(a=0.001), Joint(R, 0.3)], (0.3, 0.0, 0.0))
    assert closed_form(arm).generic_rank == 3
    form = closed_form(arm, snap_length=0.01)
    assert (form.generic_rank, form.complete, form.families) == (2, True, ())
    assert form.snaps


TASKS = ("position", "orientation", "vx,vy", "vx,vy,wz", "vz", "vx,vy,vz,wx")


def check_random(seed: int, kind: str, task: str = "pose", joints: int | None = None) -> bool:
    """Whatever is said about an arm drawn at random is true; returns whether all was said."""
    arm = random_arm(seed, kind, task, joints)
    if not moves(arm):
        return True
    form = closed_form(arm, seconds=5.0)
    # Surfaces that touch each other tell their common points to half of the digits; and near
    # them sigma_r grows with the square of the distance.
    exact = task == "pose" and form.fully_decomposed
    check_families(arm, form, 60, tol=1e-9 if exact else 1e-5)
    if form.complete:
        check_search(arm, form, 40, tol=1e-5 if exact else 1e-3)
    return form.complete or form.generic_rank < 6


@pytest.mark.parametrize("seed", tiered(range(16), (0, 2, 5, 7)))
def test_random_arms(seed: int) -> None:
    assert check_random(500 + seed, ("right", "tilted", "turned", "right")[seed % 4])


@pytest.mark.parametrize("seed", tiered(range(8), {*range(8)} - {5}))
def test_random_tasks(seed: int) -> None:
    check_random(700 + seed, "right", TASKS[seed % len(TASKS)], joints=2 + seed % 3)


SYSTEMS = {"baxter", "g1", "tiago_pro"}
"""Arms of which one family stays a system of several equations."""
LONG = {
    "baxter", "g1", "icub_left", "icub_right", "so101", "talos_left", "tiago", "tiago_pro", "xarm7",
}  # fmt: skip
"""Arms whose closed forms take half a second and more: looked at in the slow tier."""
QUICK = set(ROBOTS) - LONG


@pytest.mark.parametrize("name", tiered(ROBOTS, QUICK))
def test_all_families_of_a_robot(name: str) -> None:
    arm, form = arm_of(name), closed(name)
    assert form.complete, form.gaps
    assert form.families
    assert form.fully_decomposed or name in SYSTEMS | {"so101"}
    for family in form.families:
        assert family.real
        assert family.contains(family.generic)
        assert family.rank < form.generic_rank
        assert family.lost
        assert family.reason
        assert family.kind in ("boundary", "interior", "undecided", "varies")
        assert 1 <= family.codimension <= arm.n
    check_apart(form, 6, 1e-7)
    check_families(arm, form, 12 if name in SYSTEMS else 60)
    if name not in SYSTEMS:
        check_beside(arm, form, 20)
    assert check_search(arm, form, 60) >= 50


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_a_thousand_points_and_three_hundred_searches(name: str) -> None:
    check_families(arm_of(name), closed(name), 1000, seed=2)
    assert check_search(arm_of(name), closed(name), 320, seed=3) >= 300


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(["xarm7", "icub_left", "so101", "g1"], ("xarm7",)))
def test_raw_ratio_is_told_where_the_file_is_not_exact(name: str) -> None:
    form = closed(name)
    assert form.snaps
    assert form.jacobian_change > 1e-12
    for family in form.families:
        assert family.raw_ratio <= np.sqrt(arm_of(name).n) * form.jacobian_change
    for exact in ("iiwa14", "panda"):
        assert all(f.raw_ratio is None for f in closed(exact).families)


def test_budget_is_kept_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock of its own: each look at it is a millisecond, and soon nothing looks any more."""
    looks = itertools.count()
    clock = SimpleNamespace(monotonic=lambda: next(looks) * 1e-3, process_time=lambda: 0.0)
    monkeypatch.setattr("pinsing.algebra.budget.time", clock)
    form = closed_form(arm_of("g1"), seconds=0.05)
    assert not form.complete
    assert any("time" in gap for gap in form.gaps)
    assert next(looks) < 3 * 50


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", tiered(["ur5", "z1", "irb1400", "so101", "surgical7"], ("irb1400",))
)
def test_positions_are_complete(name):
    arm = load(name, task="position")
    form = closed_form(arm, seconds=30)
    assert max(f.codimension for f in form.families) >= 3
    assert form.fully_decomposed or name != "ur5"
    assert check_all(arm, form) >= 250
    check_apart(form, 20)


EIGHT = {
    "talos and its gripper": ("talos_full_v2", "gripper_left_motor_double_link", "torso_2_link"),
    "baxter and its finger": ("baxter", "l_gripper_l_finger_tip", None),
    "panda and its finger": ("panda", "panda_leftfinger", None),
    "tiago and its lift": ("tiago", "wrist_ft_tool_link", None),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EIGHT)
def test_chains_of_eight_joints_are_complete(name):
    robot, tip, base = EIGHT[name]
    arm = load(robot, tip=tip, base=base)
    form = closed_form(arm, seconds=60)
    assert arm.n == 8
    assert form.complete, form.gaps
    check_families(arm, form, 4 * len(form.families))
    assert check_search(arm, form, 30, tol=1e-4) >= 20


NINE = {
    "alex_nub_hands": "LeftWristRollLink", "talos_full_v2": "wrist_left_ft_tool_link",
}  # fmt: skip
"""Torsos with an arm, and their tips."""


@pytest.mark.slow
@pytest.mark.parametrize("name", NINE)
def test_nine_joints_are_complete_by_a_count(name):
    arm = load(name, tip=NINE[name])
    assert arm.n == 9
    form = closed_form(arm, seconds=300, prove=False)
    assert form.complete, form.gaps
    assert form.word == "probable"
    count = form.slice_count
    if count is None:  # all minors ended in the time: then nothing is left to count
        return
    assert (count.off, count.real_off, count.joints) == (0, 0, 4)  # none has more conditions
    assert count.real > 50
    assert count.slices >= 5 * count.choices
    assert len(count.primes) >= 3
    assert count.met >= 0.8 * count.known
    assert "it rests on a count: all" in " ".join(families_text(form).split())
    for family in form.families:
        Q = family.points(5, np.random.default_rng(0))
        assert drop(nominal(arm).arm, Q, form.generic_rank).max(initial=0.0) < 1e-9
    assert check_search(arm, form, 30, tol=1e-4) >= 20


@pytest.mark.slow
def test_nine_joints_end_in_time_and_say_what_stopped_them():
    form = closed_form(load("alex_nub_hands", tip=NINE["alex_nub_hands"]), seconds=0.3)
    assert not form.complete
    assert any("budget of" in g or "told apart" in g for g in form.gaps)


@pytest.mark.slow
def test_what_a_search_finds_close_to_a_family_is_on_it():
    """At Romeo's wrist sigma_r is below the tolerance 1e-3 away from where it is zero."""
    file = data_folder() / "romeo_description/urdf/romeo_laas_small.urdf"
    result = analyze(load(file, tip="RWristPitchSphereCollision_shape"), seconds=240)
    assert result.complete
    assert result.agree, result.problems
    assert result.random_search.singular > 250


CARRIERS = {
    "rail": ["PY"], "two rails": ["PX", "PY"], "gantry": ["PX", "PY", "PZ"],
    "positioner": ["RY", "RZ"], "mobile base": ["PX", "PY", "RZ"],
}  # fmt: skip


def carried(carrier, robot, **spec):
    arm = load(robot, **spec)
    joints = (getattr(pin, f"JointModel{kind}")() for kind in CARRIERS[carrier])
    places = [place(), *[place((0.05, 0.02, 0.1))] * 2]
    model = serial(zip(joints, places, strict=False), name=f"{robot} on a {carrier}", names="c")
    whole = pin.appendModel(model, arm.model, model.getFrameId("tip"), place((0.1, 0.05, 0.4)))
    return load(whole, tip=arm.tip)


CARRIED = [
    ("rail", "ur5", [2] * 5), ("rail", "iiwa14", [2, 2, 3, 3, 3, 3, 3]),
    ("two rails", "irb1400", [2, 3, 3, 3]), ("gantry", "irb1400", [3]), ("gantry", "panda", [5]),
    ("positioner", "ur5", [3] * 7), ("mobile base", "ur5", [2, 3, 3]),
]  # fmt: skip


@pytest.mark.parametrize(("carrier", "robot", "codimensions"), tiered_rows(CARRIED, CARRIED[:1]))
def test_all_families_of_a_carried_arm(carrier, robot, codimensions):
    spec = {"tip": "panda_hand_tcp"} if robot == "panda" else {}
    arm = carried(carrier, robot, **spec)
    assert arm.n == len(CARRIERS[carrier]) + load(robot, **spec).n
    form = closed_form(arm, seconds=120)
    assert form.complete, form.gaps
    assert sorted(f.codimension for f in form.families) == codimensions
    check_families(arm, form, 4 * len(form.families))
    check_beside(arm, form, 20)


JACO = [(90, 0, 0.2755), (180, 0.41, 0), (90, 0, -0.0098), (60, 0, -0.2501)]
JACO += [(60, 0, -0.0856), (180, 0, -0.2028)]
SEVEN = [(90, 0, 0.3), (60, 0, 0), (-60, 0, 0.4), (90, 0, 0), (-90, 0, 0.4), (90, 0, 0)]
TOOL = (0, 0, 0.1)


def swapped(rows, new):
    """With twists of another size in place of those of 60 degrees."""
    return [(math.copysign(new, al) if abs(al) == 60 else al, a, d) for al, a, d in rows]


PUMAS = {"q5 = 0° or 180°", "0.43 cos q2 + 0.02 cos(q2+q3) - 0.43 sin(q2+q3) = 0"}
# Rows, task, texts of some families, codimensions of all.
TWISTED = {
    # Three wrist axes through one point, at any twist: the families of a PUMA.
    **{
        f"hollow wrist, {twist}°": ([*swapped(HOLLOW, twist), TOOL], "pose", PUMAS, [1, 1, 1])
        for twist in (15, 30, 45, 60, 75)
    },
    # Kinova's Jaco with the 60 degree wrist: one surface that does not fall apart.
    "a wrist without a centre": (JACO, "pose", set(), [1]),
    **{
        f"seven joints, {twist}°": ([*swapped(SEVEN, twist), TOOL], "pose", set(), [1, 2, 2, 2])
        for twist in (30, 45, 60)
    },
    # They lie in a plane at half turns only.
    "axes that meet": ([(30, 0, 0.2), (60, 0, 0), TOOL], "orientation", {"q2 = 0° or 180°"}, [1]),
}


@pytest.mark.parametrize("name", tiered(TWISTED, {"a wrist without a centre", "axes that meet"}))
def test_axes_at_other_angles(name):
    rows, task, texts, codimensions = TWISTED[name]
    arm = dh_arm(rows, task)
    found = closed_form(arm)
    assert (found.snaps, found.fully_decomposed) == ((), True)
    assert {f.proof for f in found.families} == {"algebra"}
    assert sorted(f.codimension for f in found.families) == codimensions
    assert texts <= {f.text for f in found.families}
    assert check_all(arm, found, 1e-10) > 100


@pytest.mark.slow
def test_a_bennett_linkage_stays_closed():
    """Of a geometry 1.5e-12 beside it, the surface on which it moves is two isolated curves."""
    found = closed_form(dh_arm([(90, 0.4, 0), (30, 0.2, 0)] * 2, "vx,vy,vz,wx,wz"))
    assert found.complete
    assert found.families[0].text == "cos((q2+q3)/2) + 0.267949 cos((q2-q3)/2) = 0"
    q = [1.84617633, 2.74673804, 0.66704847, 1.46702977]
    assert found.family_of(q, tol=1e-6) is not None


def test_an_answer_about_another_geometry_says_so_first():
    arm = dh_arm([(90, 0, 0.3), (0, 0.4, 0), (0, 0.3, 0), (0, 0.1, 0)])
    exact = closed_form(arm)
    assert exact.deviation is None
    assert "design" not in str(exact)
    model = arm.model.copy()
    model.jointPlacements[2] = pin.SE3(pin.utils.rotate("x", 1.5708), np.array([0, 0, 0.3]))
    design = prove(closed_form(load(model, tip=arm.tip)))
    assert (design.word, design.deviation.angle) == ("proven", pytest.approx(3.673e-6, rel=1e-3))
    assert "proven for the nominal design" in " ".join(str(design).split())
    said = "the nominal design: angles moved by at most 3.7e-06 rad (0.0002°), lengths as written"
    for text in (str(design), design.certificate["robot"], design._repr_html_()):
        assert said in text
    assert coverage_words(design).startswith("Proven for the nominal design (angles moved by")
    assert ClosedForm.from_json(design.to_json()).deviation == design.deviation
    twisted = closed_form(dh_arm([(90, 0, 0.3), (52, 0.4, 0), (0, 0.3, 0), (0, 0.1, 0)]))
    assert twisted.deviation.angle == twisted.deviation.length == 0
    assert 0 < twisted.deviation.twist < 1e-11
    said = "a rational geometry beside the file's: twists by at most"
    assert said in " ".join(str(twisted).split())
