"""Distances with a proof: bounds against dense searches, both engines, metrics, bad input."""

import copy
import dataclasses
import pickle

import numpy as np
import pytest
from kernel import needs_kernel
from singular_sets import RIGHT, Joint, build, closed, terms

import pinsing
from pinsing._batch import engine
from pinsing.algebra import conditions as search
from pinsing.algebra.budget import PER_SECOND
from pinsing.errors import ConfigurationError, OptionError, ResultError, UnknownNameError
from pinsing.families import Branch, Family
from pinsing.families.zero_set import OwnPoints
from pinsing.proximity.clearance import distance_words, distances
from pinsing.proximity.monitor import make_guard

ARMS = [
    "ur5", "puma560", "panda", "stanford", "surgical7", "irb1400", "z1", "iiwa14", "xarm7",
    "talos_arm",
]  # fmt: skip


def copied(part: Family, q: np.ndarray, points: np.ndarray, limited: bool) -> np.ndarray:
    """Points of a part (one branch), the free joints where they are nearest to q: differences."""
    d = points - q
    if not limited:
        d = np.where(part.prismatic, d, d - 2 * np.pi * np.round(d / (2 * np.pi)))
    free = np.setdiff1d(np.arange(part.n), part.branches[0].involved)
    stay = np.clip(q, *part.limits) if limited else q
    d[:, free] = (stay - q)[free]
    return d


@pytest.mark.parametrize(
    ("name", "count"),
    [("ur5", 2000), ("puma560", 2000), ("stanford", 2000)]
    + [pytest.param(name, 20_000, marks=pytest.mark.slow) for name in ARMS],
)
def test_bounds_against_points_of_each_family(name: str, count: int) -> None:
    sure = count > 2000 and engine.available()
    form = closed(name)
    rng = np.random.default_rng(4)
    for family in form.families:
        for branch in family.branches[: None if sure else 2]:
            part = dataclasses.replace(family, branches=(branch,))
            own = np.where(part.prismatic, 1 / part.length_scale, 1.0)
            for limited in (False, True):
                points = part.points(count, rng, within_limits=limited)
                low, high = part.box(within_limits=True)
                for k in range(0, 10 if len(points) else 0, 1 if sure else 4):
                    q = rng.uniform(low - 0.2 * (k % 3 == 0), high)  # also outside the limits
                    weights = own if k % 2 else rng.uniform(0.3, 3, part.n)
                    norm, order = ("max", np.inf) if k > 7 else ("euclidean", 2)
                    options = {"weights": weights, "norm": norm}
                    options["boxes"] = 3_000_000 if sure else 150_000
                    found = part.distance(q, within_limits=limited, **options)
                    seen = np.linalg.norm(copied(part, q, points, limited) * weights, order, axis=1)
                    assert found.lower <= seen.min() + 1e-12
                    assert not sure or found.upper - found.lower <= 1e-6
                    assert found.lower <= found.upper == found.value
                    assert bool(part.contains(found.q, 1e-7))
                    length = np.linalg.norm((found.q - q) * weights, order)
                    assert length == pytest.approx(found.upper, abs=1e-9)
                    if limited:
                        assert (found.q >= part.limits[0] - 1e-8).all()
                        assert (found.q <= part.limits[1] + 1e-8).all()
                    else:
                        quick = search.two_sided(part.conditions(weights, norm), q[None])
                        assert quick.lower[0] <= found.upper + 1e-12
                        assert quick.upper[0] >= found.lower - 1e-12


@needs_kernel
def test_where_boxes_end_all_families_have_been_looked_at() -> None:
    """The bound is that of the nearest box left, and never less than the one in closed form."""
    form = closed("panda")
    Q = np.random.default_rng(1).uniform(-3, 3, (60, 7))
    whole = pinsing.clearance(form, Q, certify=True).lower
    for boxes, share in ((100, 0.46), (1000, 0.8)):
        found = pinsing.clearance(form, Q, certify=True, boxes=boxes)
        assert (found.lower >= np.minimum(pinsing.clearance(form, Q).lower, whole)).all()
        assert (found.lower >= share * whole).all()
        assert (found.lower <= whole * (1 + 1e-6)).all()


def test_long_equations_end_a_search_by_their_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """A finger of Alex (8 joints) took a minute a point: fewer boxes, unless told how many."""
    family = next(f for f in closed("panda").families if f.branches[0].equations)
    conditions = family.conditions(None, "euclidean")
    Q = np.random.default_rng(1).uniform(-3, 3, (4, 7))

    def found(boxes: int | None = None, compiled: bool = True) -> search.Nearest:
        options = search.SearchOptions(gap=1e-9, boxes=boxes)
        return search.nearest_points(conditions, Q, *family.limits, options, compiled=compiled)

    assert conditions.box == pytest.approx(20 + sum(s.rate.size for s in conditions.sums) / 6)
    monkeypatch.setattr(search, "WORK", 20 * conditions.box / PER_SECOND)
    for compiled in (True, False):
        few, many = found(compiled=compiled), found(5000, compiled)
        assert (few.boxes <= 20 + (2 if compiled else 512)).all()
        assert (few.boxes < many.boxes).any()
        assert (few.lower <= many.upper).all()
        assert (many.lower <= few.upper).all()


@pytest.mark.parametrize("compiled", [True, False])
def test_limits_of_several_turns_and_none(compiled: bool) -> None:
    """Copies of a value within +-2 pi, and joints that turn endlessly."""
    family = closed("stanford").families[2]  # q5 = 0, 180°
    wide, endless = (
        dataclasses.replace(family, lower=np.full(6, -end), upper=np.full(6, end))
        for end in (2 * np.pi + 0.1, np.inf)
    )
    for turn in (-7.0, -6.2, -3.0, 2.9, 6.2, 7.5, 1e9):
        q = np.array([0, 1, 0.3, 1, turn, 0])
        options = search.SearchOptions(within_limits=True)
        for limited, values in ((wide, np.arange(-2, 3)), (endless, np.round(turn / np.pi))):
            found = search.nearest_points(
                limited.conditions(), q[None], *limited.limits, options, compiled=compiled
            )
            true = np.abs(values * np.pi - turn).min()
            assert found.upper[0] == pytest.approx(true, rel=1e-12, abs=1e-12)
            assert found.lower[0] <= true * (1 + 1e-15)


@pytest.mark.parametrize("compiled", [True, False])
def test_points_beyond_where_a_slide_is_looked_at_count(compiled: bool) -> None:
    """A slide without limits is looked at as far as 100; a point known farther off changes that."""
    none = [0, 0, 0]
    e = terms((none, [0, 1, 0], 1, 0), (none, none, -0.15, 0), ([2, 0, 0], none, 0.001, 0))
    families = [[Branch((), (e,))], [Branch((search.JointValue(2, 2.0, True),), ())]]
    slides, weight = np.array([False, True, False]), np.array([100.0, 1000.0, 100.0])
    made, free = search.Conditions.of(families, slides, weight), np.full(3, np.inf)
    found = search.nearest_points(
        made, np.zeros((1, 3)), -free, free, search.SearchOptions(), compiled=compiled
    )
    assert found.lower[0] <= 149 <= found.upper[0]


def test_a_family_at_the_joint_limit_is_as_near_within_limits_as_its_points() -> None:
    """The limits count as wider by what "at the joint limit" allows, here as in ``sample``."""
    base = closed("stanford").families[2]
    lower, upper = base.lower.copy(), base.upper.copy()
    lower[4], upper[4] = -2.0, -1e-7
    outside = dataclasses.replace(base, lower=lower, upper=upper)
    q = np.array([0, 1, 0.3, 1, -0.25, 0])
    nowhere = outside.distance(q, within_limits=True)
    assert nowhere.lower == np.inf
    assert repr(nowhere) == "<Distance: infinite, none within the limits>"
    met = dataclasses.replace(outside, limit_tolerance=np.full(6, 1e-6))
    near = met.distance(q, within_limits=True)
    assert near.value == pytest.approx(0.25, abs=1e-12)
    assert repr(near) == "<Distance: 0.25 (exact), to q = 0, 1, 0.3, 1, 0, 0>"


@needs_kernel
@pytest.mark.parametrize("name", ARMS)
def test_the_compiled_bounds_are_those_of_numpy(name: str) -> None:
    form = closed(name)
    rng = np.random.default_rng(7)
    Q = rng.uniform(-7, 7, (500, form.arm.n))
    for norm in ("euclidean", "max"):
        weight = np.where(form.arm.prismatic, 3.0, rng.uniform(0.5, 2, form.arm.n))
        branches = [f.branches for f in form.families]
        conditions = search.Conditions.of(branches, form.arm.prismatic, weight, norm)
        a = search.two_sided(conditions, Q, each=True)
        b = search.two_sided(conditions, Q, each=True, compiled=False)
        np.testing.assert_allclose(a.each, b.each, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(a.lower, a.each[..., 0].min(axis=1))
        np.testing.assert_allclose(a.upper, a.each[..., 1].min(axis=1))
        picked = a.each[np.arange(len(Q)), a.family, 0]
        np.testing.assert_array_equal(picked, a.lower)


@needs_kernel
def test_a_certified_gradient_is_the_slope_and_never_another() -> None:
    form, q = closed("ur5"), np.array([0, -1.2, 1.6, -1, 1.2, 0])
    options = {"certify": True, "weights": [1, 2, 0.5, 1.5, 1, 1]}
    gradient = pinsing.clearance(form, q, **options).gradient
    assert np.count_nonzero(gradient) == 3  # the shoulder's
    ends = [pinsing.clearance(form, q + s * 1e-3 * gradient, **options).upper for s in (1, -1)]
    assert (ends[0] - ends[1]) / 2e-3 == pytest.approx(gradient @ gradient, rel=1e-2)
    with pytest.raises(ResultError, match="norm 'max'"):
        _ = pinsing.clearance(form, q, certify=True, norm="max").gradient


@needs_kernel
def test_clearance_of_many() -> None:
    form = closed("ur5")
    rng = np.random.default_rng(11)
    Q = rng.uniform(-3, 3, (4, 5, 6))
    found = pinsing.clearance(form, Q)
    assert found.lower.shape == found.upper.shape == found.family.shape == (4, 5)
    assert set(found.nearest.ravel()) <= {"F1", "F2", "F3"}
    sure = pinsing.clearance(form, Q, certify=True)
    assert sure.certified
    assert (sure.upper - sure.lower <= 1e-6).all()
    assert (found.lower <= sure.upper).all()
    assert (found.upper >= sure.lower).all()
    each = [min(f.distance(q).upper for f in form.families) for q in Q.reshape(-1, 6)]
    np.testing.assert_allclose(sure.upper.ravel(), each, atol=1e-6)
    wrist = pinsing.clearance(form, Q, families=["F2"])
    np.testing.assert_allclose(wrist.upper, np.abs(np.arcsin(np.sin(Q[..., 4]))), atol=1e-12)
    assert pinsing.clearance(form, np.zeros((0, 6))).lower.shape == (0,)


def test_families_out_of_reach_do_not_count_within_limits() -> None:
    form = closed("z1")
    assert [f.reachability for f in form.families][:2] == ["not reachable"] * 2
    q = form.families[2].witness
    inside = pinsing.clearance(form, q, within_limits=True)
    assert str(inside.nearest) == "F3"
    assert inside.lower <= 1e-9
    # No singular configuration at all within the limits: proven, infinitely far.
    none = pinsing.clearance(form, q, families=["F1"], within_limits=True, certify=True)
    assert none.lower == np.inf
    assert form.families[0].distance(q, within_limits=True).lower == np.inf


def test_a_form_that_is_not_complete_calls_nothing_clear() -> None:
    form, q = closed("planar3r"), [0.3, 1.0, 0.4]
    assert pinsing.is_clear(form, q, 0.1)
    for families in (form.families, ()):
        poor = dataclasses.replace(form, complete=False, families=families)
        assert not pinsing.is_clear(poor, q, 0.1)
        assert "not complete" in str(pinsing.clearance(poor, q))
        assert "not complete" in repr(pinsing.check_trajectory(poor, [q, q]))
    assert pinsing.clearance(poor, q).lower == 0.0
    assert "not complete" in pinsing.proximity.crossings(poor, [q, q]).text()


def test_points_of_equations_that_are_not_singular_are_none_of_a_family() -> None:
    """Equations of a wrist singularity that are zero at wrist_2_joint = 1 rad as well."""
    form = closed("ur5")
    wrist = form["wrist"]
    decoy = Branch((search.JointValue(4, 1.0, False),), ())
    own = OwnPoints(form.loaded)
    wrist = dataclasses.replace(
        wrist, branches=(*wrist.branches, decoy), confirm=own, also_regular=True
    )
    form = dataclasses.replace(form, families=(wrist,))
    q = np.array([0, -1.2, 1.3, -1, 0.9, 0])
    quick, sure = (pinsing.clearance(form, q, certify=certify) for certify in (False, True))
    assert quick.lower == sure.lower == pytest.approx(0.1)
    assert quick.upper == pinsing.Monitor(form).update(q).upper == np.inf
    assert "zero at regular configurations too" in str(quick)
    assert 0.9 <= sure.upper < 0.91
    spread = pinsing.sampling.sigma_map(
        form.loaded, count=128, measure="clearance", forms=form
    ).clearance
    assert spread.upper.smallest.value == np.inf
    both = dataclasses.replace(form, families=(wrist, closed("ur5")["elbow"]))
    quick = pinsing.clearance(both, q)
    assert quick.upper == pinsing.Monitor(both).update(q).upper == pytest.approx(1.3, abs=0.05)
    read = pinsing.ClosedForm.from_json(form.to_json())
    assert pinsing.clearance(read, q).upper == np.inf
    assert pinsing.clearance(read, q, certify=True).upper == np.inf
    far = read.families[0].distance(q)
    assert (far.exact, far.upper) == (False, np.inf)
    with pytest.raises(pinsing.PinsingError, match="only the arm tells"):
        read.families[0].contains(q)
    with pytest.raises(pinsing.PinsingError, match="only the arm tells"):
        read.families[0].sample(1, np.random.default_rng(0))
    less = dataclasses.replace(read, complete=False)  # what is known of families still holds
    assert pinsing.clearance(less, q, certify=True).lower == pytest.approx(0.1)
    assert np.isnan(read.families[0].gradient(q)).all()
    assert "no configuration found" in distance_words(distances(read, q), False, wrist.space)[0]
    for again in (pickle.loads(pickle.dumps(form)), copy.deepcopy(form)):
        assert again.families[0].contains([q, 0 * q]).tolist() == [False, True]
    elbow = dataclasses.replace(closed("ur5")["elbow"], also_regular=True)
    two = dataclasses.replace(form, families=(elbow, wrist))
    two = pinsing.ClosedForm.from_json(two.to_json())
    through = pinsing.check_trajectory(form.loaded, [q, q + 0.05 * np.eye(6)[5]], forms=two)
    assert [a.family for a in through.approaches] == [wrist.name, elbow.name]
    through = pinsing.check_trajectory(form.loaded, [q, q + 0.2 * np.eye(6)[4]], forms=form)
    assert not through.crossings
    assert 0.9 < through.approaches[0].upper <= 1
    into = pinsing.check_trajectory(form.loaded, [q, q - np.eye(6)[4]], forms=form)
    assert [c.kind for c in into.crossings] == ["crossing"]
    # Along a zero of the equations that singular configurations are on as well.
    along = dataclasses.replace(wrist, branches=(Branch((search.JointValue(0, 0.0, False),), ()),))
    form = dataclasses.replace(form, families=(along,))
    (met,) = pinsing.proximity.crossings(form, [q, q - 1.5 * np.eye(6)[4]])
    assert met.kind == "along"
    assert not pinsing.proximity.crossings(form, [q, q - 0.5 * np.eye(6)[4]])


def test_what_is_of_the_nominal_design_says_so() -> None:
    rows = [(0, 0, 0), (RIGHT, 0, 0), (0.0015, 0.3, 0), (0, 0.3, 0), (RIGHT, 0, 0.1), (RIGHT, 0, 0)]
    arm = build([Joint(*row) for row in rows], tip=(0, 0, 0.1))
    form = pinsing.closed_form(arm)
    found = pinsing.clearance(form, [0.1] * 6)
    monitor = pinsing.Monitor(form)
    assert found.notes == monitor.notes
    assert (found.nominal, monitor.nominal, found.to_dict()["nominal"]) == (True, True, True)
    assert " of the design (" in str(found)
    assert "families of the design" in repr(monitor)
    for language in ("c", "python"):
        guard = make_guard(arm, language, forms=form)
        assert guard.word == "proven of the design"
        assert guard.word in guard.text
        assert f"distances are not of {arm.source.label} itself. {found.notes[0]}" in guard.notes
    exact = pinsing.clearance(closed("ur5"), [0.1] * 6)
    assert (exact.nominal, exact.notes) == (False, ())
    assert "bounds of distances from them, are of" in str(found)
    assert "angles moved by at most 1.5e-03 rad" in str(found)
    check = pinsing.check_trajectory(form, [[0.1] * 6, [0.2] * 6])
    said = check.text().splitlines()
    assert "meets no singular configuration of the design" in said[0]
    assert any("proven of the design" in line for line in said)
    assert not any("proven)" in line.replace("of the design)", "") for line in said[1:])
    assert found.notes[0] in said[2]


@pytest.mark.parametrize(
    ("Q", "options", "error"),
    [
        *((np.zeros(6), *case) for case in (
            ({"families": ["F9"]}, UnknownNameError), ({"families": []}, OptionError),
            ({"weights": [1, 1]}, OptionError), ({"weights": [1, 1, 1, 1, 1, 0]}, OptionError),
            ({"weights": [1, 1, 1, 1, 1, np.nan]}, OptionError), ({"norm": "2"}, OptionError),
            ({"certify": True, "gap": 0.0}, OptionError),
            ({"certify": True, "boxes": 0}, OptionError),
        )),
        *((bad, {}, ConfigurationError) for bad in (np.zeros(5), np.full(6, np.nan), 3.0, "none")),
    ],
)  # fmt: skip
def test_bad_input(Q: object, options: dict[str, object], error: type[Exception]) -> None:
    with pytest.raises(error):
        pinsing.clearance(closed("ur5"), Q, **options)
