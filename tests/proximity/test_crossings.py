"""Meetings of motions with families: none is missed, grazing ones among them.

Straight lines of the tip: ends, on the first family met; speeds, against differences.
"""

from collections import Counter
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicSpline, PPoly
from singular_sets import arm_of, closed
from tiers import tiered

import pinsing
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm, Family
from pinsing.kinematics.jacobian import tip_placement as tip
from pinsing.measures import Array
from pinsing.postures import line_postures
from pinsing.proximity.crossings import crossings
from pinsing.proximity.line import LineCheck, check_line
from pinsing.robot.arm import Arm


def changes(family: Family, Q: Array) -> int:
    """Changes of sign of the conditions of a family of codimension 1 along samples."""
    count = 0
    for branch in family.branches:
        if branch.equations:
            side = branch.equations[0](Q) > 0
        else:
            value = branch.values[0]
            off = Q[:, value.joint] - value.value
            side = off > 0 if family.prismatic[value.joint] else np.sin(off / 2) > 0
        count += int((side[1:] != side[:-1]).sum())
    return count


def passed(form: ClosedForm, found: pinsing.proximity.Crossings, family: Family) -> int:
    return sum(c.family == family.name and c.kind == "crossing" for c in found)


@pytest.mark.parametrize("name", ["ur5", "puma560", "stanford", "irb1400", "z1", "kinova"])
def test_no_crossing_of_straight_motions_is_missed(name: str) -> None:
    form = closed(name)
    rng = np.random.default_rng(1)
    s = np.linspace(0, 1, 20001)[:, None]
    for _ in range(12):
        a, b = rng.uniform(-3, 3, (2, form.arm.n))
        found = crossings(form, [a, b])
        for family in form.families:
            if family.codimension == 1:
                assert passed(form, found, family) == changes(family, a + s * (b - a))
        for c in found:
            assert form.families[int(c.family[1:]) - 1].contains(c.q, 1e-9)
            np.testing.assert_allclose(c.q, a + c.t * (b - a), atol=1e-12)


@pytest.mark.parametrize("name", tiered(["ur5", "puma560", "irb1400"], ("puma560",)))
@pytest.mark.parametrize("offset", tiered([1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 0.0], (1e-5, 1e-9, 0.0)))
def test_grazing_motions(name: str, offset: float) -> None:
    form = closed(name)
    family = next(f for f in form.families if f.equations)
    f = family.equations[0]
    rng = np.random.default_rng(3)
    s = np.linspace(0, 1, 40001)[:, None]
    for q in family.points(6, rng):
        g = f.gradient(q)
        u = rng.normal(size=len(q))
        u -= (u @ g) * g / (g @ g)
        u /= np.linalg.norm(u)
        for side in (1, -1):
            x = q + side * offset * g / np.linalg.norm(g)
            a, b = x - 0.3 * u, x + 0.3137 * u
            found = [c for c in crossings(form, [a, b]) if c.family == family.name]
            seen = changes(family, a + s * (b - a))
            crossed = sum(c.kind == "crossing" for c in found)
            # Rounding of the samples themselves is seen as changes of sign below 1e-9.
            if offset >= 1e-9:
                assert crossed >= seen
                assert (crossed - seen) % 2 == 0
            if offset == 0.0 or seen:
                assert found
                near = min(abs(c.t - 0.3 / 0.6137) for c in found)
                assert near < 0.05 or crossed >= seen


def test_crossings_at_waypoints() -> None:
    form = closed("ur5")
    base = np.array([0.3, -1.2, 1.0, 0.4, 0.0, 0.2])
    turn = np.array([0, 0, 0, 0, 0.5, 0])
    through = crossings(form, [base - turn, base, base + turn], families=["F2"])
    assert [c.kind for c in through] == ["crossing"]
    assert through[0].t == pytest.approx(1.0, abs=1e-12)
    for sign in (1, -1):
        near, far = base, base + sign * turn
        for way, t in (([far, near, far], 1), ([near, far], 0), ([far, near], 1)):
            found = crossings(form, way, families=["F2"])
            assert [c.kind for c in found] == ["touch"]
            assert found[0].t == pytest.approx(t, abs=1e-12)
    other = np.array([0.5, 0.2, 0.1, 0, 0, 0])
    along = crossings(form, [base + turn, base, base + other, base + other + turn], families=["F2"])
    assert [c.kind for c in along] == ["along"]
    assert (along[0].t, along[0].t_end) == pytest.approx((1.0, 2.0), abs=1e-6)
    rests = crossings(form, [base], families=["F2"])
    assert [c.kind for c in rests] == ["touch"]
    assert len(crossings(form, [base + turn], families=["F2"])) == 0


def test_a_motion_that_rests_at_a_meeting_goes_through_or_not() -> None:
    """Its sign was asked for as far off as it rests, beyond other meetings: a third was wrong."""
    form, rng = closed("ur5"), np.random.default_rng(0)
    for q in form.families[2].points(40, rng):
        u, v = rng.normal(size=(2, 6))
        found = crossings(form, [q - u, q, q, q + v], families=["F3"])
        met = next(c for c in found if c.t_end > 1 - 1e-6)
        through = changes(form.families[2], np.array([q - 1e-4 * u, q + 1e-4 * v]))
        assert met.kind == ("crossing" if through else "touch")


def test_splines_of_scipy() -> None:
    form = closed("ur5")
    rng = np.random.default_rng(4)
    times = np.cumsum(rng.uniform(0.1, 1, 40))
    spline = CubicSpline(times, rng.uniform(-2, 2, (40, 6)))
    found = crossings(form, spline)
    Q = spline(np.linspace(times[0], times[-1], 400001))
    for family in form.families:
        assert passed(form, found, family) == changes(family, Q) > 5
    for c in found:
        np.testing.assert_allclose(c.q, spline(c.t), atol=1e-9)
    assert [c.t for c in found] == sorted(c.t for c in found)


def test_families_of_several_conditions() -> None:
    form, rng = closed("panda"), np.random.default_rng(5)
    way, family = rng.uniform(-2, 2, (9, 7)), form.families[4]
    assert len(crossings(form, way)) == 0
    way[4] = family.points(1, rng)[0]
    (found,) = crossings(form, way)
    assert (round(found.t, 3), found.family) == (4.0, "F5")
    assert family.contains(found.q, 1e-4)
    way[4, family.branches[0].values[0].joint] += 1e-3
    assert len(crossings(form, way)) == 0


@pytest.mark.parametrize(
    ("motion", "t", "error", "words"),
    [
        (np.zeros((0, 6)), None, ConfigurationError, "no waypoint"),
        (np.zeros((3, 5)), None, ConfigurationError, "6 values"),
        (np.zeros(6), None, ConfigurationError, "waypoints"),
        (np.full((3, 6), np.nan), None, ConfigurationError, "nan"),
        ([[0] * 6, [0, 0, 1e300, 0, 0, 0]], None, ConfigurationError, "sample 2: elbow_joint is 1"),
        (np.zeros((3, 6)), [0, 2, 1], OptionError, "ascend"),
        (np.zeros((3, 6)), [0, 1, 1], OptionError, "ascend"),
        (np.zeros((3, 6)), [0, np.nan, 1], OptionError, "sample 2"),
        (np.zeros((3, 6)), [0, 1], OptionError, "3 times"),
        (PPoly(np.zeros((2, 1, 5)), [0, 1]), None, ConfigurationError, "coefficients"),
        (PPoly(np.zeros((2, 1, 6)), [0, 1]), [0, 1], OptionError, "leave out t"),
    ],
)  # fmt: skip
def test_bad_motions(motion: object, t: object, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        crossings(closed("ur5"), motion, t)


def random_line(arm: Arm, rng: np.random.Generator) -> tuple[Array, Array]:
    q = rng.uniform(-np.pi, np.pi, arm.n)
    u = rng.normal(size=3)
    return q, tip(arm, q).translation + 0.5 * u / np.linalg.norm(u)


def check_path(arm: Arm, line: LineCheck, q: Array, target: Array) -> None:
    """Every tracked configuration is on the line, none far from the one before."""
    start = tip(arm, q)
    u = (target - start.translation) / np.linalg.norm(target - start.translation)
    for s, x in zip(line.s, line.q, strict=True):
        here = tip(arm, x)
        np.testing.assert_allclose(here.translation, start.translation + s * u, atol=1e-9)
        np.testing.assert_allclose(here.rotation, start.rotation, atol=1e-9)
    assert np.abs(np.diff(line.q, axis=0)).max() < 0.3


@pytest.mark.slow
def test_lines_of_a_ur5_end_on_the_first_singularity_that_ends_them() -> None:
    arm, form = arm_of("ur5"), closed("ur5")
    rng = np.random.default_rng(1)
    ends: Counter[str] = Counter()
    for _ in range(25):
        q, target = random_line(arm, rng)
        line = check_line(arm, q, target, forms=form)
        check_path(arm, line, q, target)
        assert not any(changes(family, line.q[:-1]) for family in form.families)
        ends["reached" if line.outcome == "reached" else line.family] += 1
        if line.outcome == "reached":
            assert line.s_end == pytest.approx(0.5, abs=1e-12)
        elif line.family:
            assert line.located
            assert form[line.family].contains(line.q_end, 1e-9)
            assert line.crossings
    assert min(ends["F3"], ends["F1"]) >= 2
    assert ends["reached"] >= 5
    assert ends[""] <= 1


@pytest.mark.slow
def test_speeds_along_a_line() -> None:
    arm, form = arm_of("ur5"), closed("ur5")
    rng = np.random.default_rng(2)
    limits = np.asarray(arm.model.velocityLimit)
    seen = 0
    for _ in range(12):
        q, target = random_line(arm, rng)
        line = check_line(arm, q, target, speed=0.25, forms=form)
        rate = np.abs(np.diff(line.q, axis=0)) / np.diff(line.s)[:, None] * 0.25
        middle = (line.s[1:] + line.s[:-1]) / 2
        inside, clear = np.zeros(rate.shape, bool), np.abs(rate - limits) > 0.05 * limits
        for o in line.too_fast:
            inside[:, arm.joints.index(o.joint)] |= (o.s <= middle) & (middle <= o.s_end)
        assert (inside == (rate > limits))[clear].all()
        seen += inside[clear].sum()
        if line.outcome == "singular":
            assert line.allowed_speed == 0.0
        else:
            slow = check_line(arm, q, target, speed=0.99 * line.allowed_speed, forms=form)
            assert not slow.too_fast
            fast = check_line(arm, q, target, speed=1.01 * line.allowed_speed, forms=form)
            assert fast.too_fast
            assert min(o.allowed for o in fast.too_fast) == pytest.approx(line.allowed_speed)
    assert seen > 10


def test_turning_on_the_way() -> None:
    arm, form, q = arm_of("ur5"), closed("ur5"), np.array([0.1, -1.2, 1.3, -1.6, -1.4, 0.3])
    start, turn = tip(arm, q), np.array([0.2, -0.3, 0.1])
    goal = pin.SE3(start.rotation @ pin.exp3(turn), start.translation + 0.05)
    numbers = np.concatenate([goal.translation, pin.rpy.matrixToRpy(goal.rotation)])
    for pose in (goal.homogeneous, numbers):
        line = check_line(arm, q, pose, forms=form)
        assert line.outcome == "reached"
        np.testing.assert_allclose(tip(arm, line.q_end).homogeneous, goal.homogeneous, atol=1e-9)
        for s, x in zip(line.s, line.q, strict=True):
            turned = pin.log3(start.rotation.T @ tip(arm, x).rotation)
            np.testing.assert_allclose(turned, s / line.length * turn, atol=1e-9)
    only = check_line(arm, q, pin.SE3(goal.rotation, start.translation).homogeneous, forms=form)
    assert only.length == pytest.approx(np.linalg.norm(turn))


def test_a_planar_arm_stretches_to_its_end() -> None:
    arm, q = arm_of("planar3r").with_task("position"), np.array([0.3, 0.8, 0.5])
    start, longest = tip(arm, q).translation, tip(arm, np.zeros(3)).translation
    line = check_line(arm, q, 10 * start / np.linalg.norm(start))
    assert line.outcome == "singular"
    reached = np.linalg.norm(start) + line.s_end
    assert reached == pytest.approx(np.linalg.norm(longest), abs=1e-9)


START = np.array([0.1, -1.2, 1.3, -1.6, -1.4, 0.3])


@pytest.mark.parametrize(
    ("q", "pose", "speed", "error", "words"),
    [
        (START, None, 0.25, ConfigurationError, "no length"),
        (START, [400, 0, 300], 0.25, ConfigurationError, r"give metres, as 0\.4,0,0\.3$"),
        *((START, [0.1, 0.2, 0.3], speed, OptionError, "speed") for speed in (-1.0, np.inf)),
        # From a singular configuration it is not determined where the joints go.
        *((0 * START, pose, 0.25, ConfigurationError, r"a singular configuration \(on F1, F2")
          for pose in ([5.0, 0.0, 0.0], [0.3, 0.2, 0.4])),
    ],
)  # fmt: skip
def test_bad_lines(q, pose, speed, error, words) -> None:
    arm = arm_of("ur5")
    with pytest.raises(error, match=words):
        check_line(
            arm, q, tip(arm, q).translation if pose is None else pose, speed, forms=closed("ur5")
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "q", "to"),
    [
        ("rs007n", [54.1, -70.6, 122.6, 16.2, 45.2, 117.7], [-0.263, -0.259, -0.168]),
        ("xarm6", [124.8, -52.1, -6.7, 74, -76.1, -143.2], [-0.07, -0.067, 0.286]),
    ],
)
def test_the_closest_approach_of_a_line_is_that_of_dense_samples(name, q, to) -> None:
    # Found by a stranger: it was told where a loose lower bound is least.
    arm = pinsing.load(name)
    form = pinsing.closed_form(arm, prove=False)
    line = check_line(arm, np.radians(q), to, forms=form)
    for near in line.approaches:
        options = {"families": [near.family], "certify": True, "boxes": 5000}
        assert near.upper <= pinsing.clearance(form, line.q, **options).upper.min() + 1e-4


@pytest.mark.slow
def test_a_start_that_meets_a_singularity_is_not_suggested_and_all_that_is_met_is_named() -> None:
    arm, target, q = pinsing.load("gp25"), [0.9, 0.0, 1.2], np.radians([0, -40, 60, 0, 40, 0])
    postures = line_postures(arm, q, target)
    inside = [p for p in postures if p.outcome == "reached" and p.within_limits]
    assert [p.clearance for p in inside] == [0, 0]
    line = replace(check_line(arm, q, target), postures=postures)
    text = " ".join(line.text().split())
    assert "another posture" not in text
    assert "None of 7 other postures" in text
    again = check_line(arm, inside[0].q, target)
    assert {c.family for c in again.crossings} == {"F2", "F3"}
    head = again.text().split("\n\n")[0]
    assert all(f"the {c.title} singularity" in head for c in again.crossings)
    clear = replace(line, postures=(replace(inside[0], clearance=0.1),)).text()
    assert "it reaches its end clear of singularities: pinsing line gp25" in clear
