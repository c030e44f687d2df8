"""Meetings of motions with families: none is missed, grazing ones among them."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PPoly
from singular_sets import closed
from tiers import tiered

import pinsing
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families import ClosedForm, Family
from pinsing.measures import Array
from pinsing.proximity.crossings import crossings


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
    form = closed("panda")
    rng = np.random.default_rng(5)
    way = rng.uniform(-2, 2, (9, 7))
    assert len(crossings(form, way)) == 0
    family = form.families[4]
    way[4] = family.points(1, rng)[0]
    found = crossings(form, way)
    assert [(round(c.t, 3), c.family) for c in found] == [(4.0, "F5")]
    assert family.contains(found[0].q, 1e-4)
    value = family.branches[0].values[0].joint
    way[4, value] += 1e-3
    assert len(crossings(form, way)) == 0


@pytest.mark.parametrize(
    ("motion", "t", "error", "words"),
    [
        (np.zeros((0, 6)), None, ConfigurationError, "no waypoint"),
        (np.zeros((3, 5)), None, ConfigurationError, "6 values"),
        (np.zeros(6), None, ConfigurationError, "waypoints"),
        (np.full((3, 6), np.nan), None, ConfigurationError, "nan"),
        (
            [[0] * 6, [0, 0, 1e300, 0, 0, 0]], None, ConfigurationError,
            "sample 2: elbow_joint is 1e",
        ),
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
