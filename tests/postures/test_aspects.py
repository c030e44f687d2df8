"""Aspects, ways between them, and cuspidal arms; what is said where families lack."""

from dataclasses import replace

import numpy as np
import pytest
from dh_arms import CRX, GOFA, along, arm_of, aspects_of, dh_arm, form_of

import pinsing
from pinsing.errors import ConfigurationError, OptionError
from pinsing.kinematics.inverse import one_sheet, regular_way
from pinsing.kinematics.jacobian import ratios, tip_placement
from pinsing.postures.aspects import least, raised


def _slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


def signs_of_det(arm, path, count=60):
    return np.sign(np.linalg.det(pinsing.kinematics.task_jacobians(arm, along(path, count))))


def decided(name, limits, a, b):
    """The way between two configurations; that it is one, and as clear as is said."""
    form, arm, found = form_of(name), arm_of(name), aspects_of(name, limits)
    known = pinsing.connect(form, a, b, limits=limits, of=found)
    assert known.same is (found.of(a) == found.of(b))
    if not known.same:
        return known
    way = known.path
    assert np.array_equal(way[0], a)
    assert np.abs(arm.space.wrap(way[-1] - b)).max() < 1e-9
    assert not (limits and arm.space.outside(way).any())
    signs = signs_of_det(arm, way)
    assert (signs == signs[0]).all()
    # No configuration of a family is nearer to any point of the way than is said.
    assert 0 < known.clearance <= pinsing.clearance(form, along(way)).upper.min() + 1e-12
    ends = pinsing.clearance(form, np.stack([a, b])).lower.min()
    assert known.clearance > 0.1 * ends or name != "ur5"
    return known


@pytest.mark.parametrize(
    ("name", "count"),
    [("puma560", 44), *(_slow(name, 134) for name in ("puma560", "ur5", "kinova", "z1"))],
)
@pytest.mark.parametrize("limits", [True, False])
def test_every_pair_is_decided(name, count, limits):
    """Of many configurations also pairs of one aspect, of which some need a way round."""
    Q = arm_of(name).space.sample(count, np.random.default_rng(5), not limits)
    pairs, by = [*zip(Q[:44:2], Q[1:44:2], strict=True)], {}
    for q in Q[44:]:
        by.setdefault(aspects_of(name, limits).of(q), []).append(q)
    pairs += [pair for q in by.values() for pair in zip(q[:4:2], q[1:4:2], strict=False)]
    ways = [decided(name, limits, a, b) for a, b in pairs]
    assert {way.answer for way in ways} == {"same", "different"}
    assert any(way.same and len(way.path) > 2 for way in ways) or (name, limits) != ("ur5", True)


def test_bad_input():
    form, of, ends = form_of("ur5"), aspects_of("ur5"), ([0.1] * 6, [0.2] * 6)
    read = pinsing.postures.Aspects.from_dict(of.to_dict())
    for start, known, error, said in (
        ([0, 0, 9, 0, 0, 0], of, ConfigurationError, "outside its limits"),
        ([0, 0, 0], of, ConfigurationError, "needs 6 values"),
        (ends[0], aspects_of("ur5", False), OptionError, "limits says otherwise"),
        (ends[0], aspects_of("puma560"), OptionError, "another arm"),
        (ends[0], read, OptionError, "read from JSON"),
    ):
        with pytest.raises(error, match=said):
            pinsing.connect(form, start, ends[1], of=known)
    with pytest.raises(OptionError, match="another arm"):
        pinsing.postures.aspect_changes(form, ends, of=aspects_of("puma560"))
    again = pinsing.closed_form(replace(arm_of("ur5")))
    assert again is not form
    assert pinsing.connect(again, *ends, of=of).answer == "same"


def orthogonal(d2, d3, d4, r2):
    """Three orthogonal axes (Wenger)."""
    return dh_arm([(-90, d2, 0), (90, d3, r2), (0, d4, 0)], task="position")


ROUNDED = (-90, 0, 0), (0, 1, 0.2), (-90, 0.02, 0), (90, 0, 1), (-90, 1.0e-9, 0), (0, 0, 0)
# SO-100 reaches over its own base: over the top no rank is lost, the elbow stays.
FIVE = "with 5 joints regular means rank 5", "rests on numbers", "of the arm itself"
CUSPIDALITY = [
    (CRX, 3, "cuspidal", True, 2, 8, ()), _slow(GOFA, 3, "cuspidal", True, 2, 8, ()),
    _slow(ROUNDED, 5, "cuspidal", True, 2, 8, ("practically singular", "not cuspidal")),
    ((1, 2, 1.5, 1), 20, "cuspidal", True, 2, 4, ()),
    _slow((1, 2, 0.2, 1), 20, "not cuspidal", True, 2, 2, ()),
    _slow((1, 2, 0.1, 1), 20, "not cuspidal", True, 2, 2, ()),
    _slow((1, 2, 1.5, 0), 20, "not cuspidal", True, 4, 4, ()),
    ("ur5", 4, "not cuspidal", True, 8, 8, ("3 signs",)),
    _slow("puma560", 4, "not cuspidal", True, 8, 8, ("3 signs",)),
    _slow("irb1400", 4, "not cuspidal", True, 8, 8, ("3 signs",)),
    ("so101", 2, "no evidence", False, 2, 2, ()), _slow("so100", 3, "cuspidal", True, 2, 4, FIVE),
]  # fmt: skip


@pytest.mark.parametrize(
    ("given", "poses", "answer", "proven", "aspects", "most", "said"), CUSPIDALITY
)
def test_cuspidality(given, poses, answer, proven, aspects, most, said):
    named, point = isinstance(given, str), len(given) == 4
    arm = arm_of(given) if named else orthogonal(*given) if point else dh_arm(given)
    found = pinsing.cuspidality(arm, poses=poses, forms=form_of(given) if named else None)
    assert (found.answer, found.proven, found.aspects) == (answer, proven, aspects)
    assert found.most_solutions == most
    words = " ".join((found.reason, *found.notes))
    assert all(part in words for part in said)
    assert "certificate" not in words
    assert ("practically singular" in words) == (given is ROUNDED) == (found.least_ratio < 1e-5)
    assert (found.witness is None) == (answer != "cuspidal")
    if found.witness is not None:
        path = found.witness.path
        first, last = (tip_placement(arm, q).homogeneous for q in (path[0], path[-1]))
        reached = (slice(3), 3) if point else ...
        assert np.abs(first[reached] - last[reached]).max() < 1e-9
        apart = np.abs(arm.space.wrap(path[-1] - path[0])).max()
        assert apart > (1 if given == "so100" else 1e-3)
        least = pinsing.singular_values(arm, along(path, 10_000 // len(path)))[:, -1].min()
        assert (least > 1e-5) == (given is not ROUNDED)
        assert given == "so100" or len({*signs_of_det(arm, path, 10_000 // len(path))}) == 1


@pytest.mark.slow
def test_a_way_is_regular_only_where_no_family_is_met():
    arm = arm_of("ur5")
    q = np.array([0.1, -1.0, 1.2, 0.3, 0.9, 0.2])
    elbow, wrist = q.copy(), q.copy()
    elbow[2], wrist[4] = 0.8, -0.9
    assert regular_way(arm, np.array([q, elbow]))
    assert not regular_way(arm, np.array([q, wrist]))
    assert not regular_way(arm, np.array([q, elbow, wrist]))
    low = pinsing.robot.nominal(arm_of("so100")).arm
    family = next(f for f in form_of("so100").families if f.codimension == 2)
    middle = family.sample(1, np.random.default_rng(0))[0]
    aside = np.array([0.3, 0.2, 0.1, -0.2, 0.4])
    way = np.array([middle - aside, middle + aside])
    assert not regular_way(low, way)
    assert regular_way(low, np.array([middle + 0.5 * aside, middle + aside]))


def test_two_sheets_of_poses_that_cross_are_no_posture_change():
    """The tip of an arm of five joints leaves one way from one configuration."""
    arm = arm_of("so101")
    a, b = arm.space.sample(2, np.random.default_rng(0), True)
    assert one_sheet(arm, a, a)
    assert not one_sheet(arm, a, b)
    assert one_sheet(arm_of("ur5"), np.full(6, 0.3), np.full(6, 0.8))


EVERY = ("F1", "F2", "F3")


def lacking(name, *names):
    """A closed form as a search would leave it that had no time for some families."""
    form = form_of(name)
    kept = tuple(f for f in form.families if f.name not in names)
    assert len(kept) == len(form.families) - len(names)
    return replace(form, families=kept, complete=False, gaps=("the time ran out",))


def between(family):
    """Ends on either side of a configuration of a family, on one straight line with it."""
    rng, space = np.random.default_rng(1), arm_of("iiwa14").space
    Q = family.sample(60, np.random.default_rng(0))
    ends = np.stack([Q, Q], axis=1) + 0.1 * rng.normal(size=(60, 1, 7)) * [[-1], [1]]
    return next(pair for pair in ends if not space.outside(pair).any())


def test_ways_go_round_where_two_conditions_meet_at_once():
    arm, form, of = arm_of("iiwa14"), form_of("iiwa14"), aspects_of("iiwa14")
    thin = [f for f in form.families if f.codimension == 2]
    assert len(thin) == 3
    for family in thin:
        a, b = between(family)
        assert ratios(arm, along(np.stack([a, b]))).min() < 1e-4
        way = pinsing.connect(form, a, b, of=of)
        assert way.answer == "same"
        assert len(way.path) > 2
        assert regular_way(arm, way.path)
        assert 0 < way.clearance <= pinsing.clearance(form, along(way.path)).upper.min() + 1e-12


def test_what_is_singular_is_in_no_aspect():
    form, of = form_of("iiwa14"), aspects_of("iiwa14")
    singular = [0.1, 0.0, np.pi / 2, 1.0, 0.3, 0.5, 0.2]
    beside = [0.1, 0.1, np.pi / 2, 1.0, 0.3, 0.5, 0.2]
    assert of.of(singular) is None
    assert of.of(beside) is not None
    said = pinsing.connect(form, singular, beside, of=of)
    assert (said.answer, said.proven) == ("undecided", False)
    assert any("the start is singular, on F2" in n for n in said.notes)


def test_the_count_is_a_lower_bound():
    whole = pinsing.aspects(replace(form_of("puma560"), proof=None))
    assert (whole.word, whole.proven, whole.lower) == ("probable", True, 12)
    assert whole.text().startswith(
        "puma560: 12 aspects within the joint limits, proven for the families found; that "
        "these are all is probable\n"
    )
    for names in (("F1",), ("F2",), EVERY):
        found = pinsing.aspects(lacking("puma560", *names))
        assert (found.word, found.proven, found.upper) == ("not complete", False, None)
        assert found.lower < whole.lower
        assert found.text().startswith(f"puma560: at least {found.lower} aspect")
        assert "(the time ran out): a family that is missing may cut more" in found.text()


def test_with_a_certificate_nothing_is_left_to_say():
    form = pinsing.closed_form(arm_of("scara"), prove=True)
    found = pinsing.aspects(form)
    assert found.text().startswith("scara: 2 aspects within the joint limits, proven\n")
    stanford = pinsing.aspects(pinsing.closed_form(arm_of("stanford")))
    assert any("d3 in" in where for where in stanford[0].where)  # as its joints are called
    way = pinsing.connect(form, [0, 1, 0, 0], [0, 2, 0, 0], of=found)
    assert (way.answer, way.proven, way.notes) == ("same", True, ())


@pytest.mark.parametrize("names", [_slow(("F2",)), EVERY])
def test_same_is_said_only_where_the_jacobian_proves_it(names):
    arm, whole = arm_of("puma560"), aspects_of("puma560")
    form = lacking("puma560", *names)
    of = pinsing.aspects(form)
    rng = np.random.default_rng(2)
    answers = set()
    for a, b in arm.space.sample(24 if names == EVERY else 240, rng).reshape(-1, 2, 6):
        way = pinsing.connect(form, a, b, of=of)
        answers.add(way.answer)
        assert way.proven == (way.answer != "undecided")
        if names == EVERY and way.answer == "different":
            assert "(both of what is known as 1), proven" in way.text()
            assert "the determinant of the Jacobian is positive at one" in way.text()
        if way.answer == "undecided":
            assert way.path is None
            assert "not complete" in way.text()
        else:
            assert way.same == (whole.of(a) == whole.of(b))
    assert {"different", "undecided" if names == EVERY else "same"} <= answers


def test_no_posture_is_reached_through_what_lacks():
    arm = arm_of("puma560")
    q = [0.1, -0.6, 0.4, 0.2, 0.7, 0.3]
    found = pinsing.posture_changes(arm, q, forms=lacking("puma560", *EVERY))
    assert len(found.others) == 7
    assert " reached by " not in found.text()
    assert ": 0 reached without" in found.text()
    assert "a family that is missing may cut more" in found.text()


@pytest.mark.slow
def test_what_an_answer_rests_on_is_of_that_answer():
    form, of = replace(form_of("ur5"), proof=None), aspects_of("ur5")
    apart = pinsing.connect(form, [0, -1, 1, 0.3, 1, 0], [0, -1, 1, 0.3, -1, 0], of=of)
    assert (apart.answer, apart.proven, apart.notes) == ("different", True, ())
    found = pinsing.posture_changes(arm_of("ur5"), [0.1, -1, 1.2, 0.3, 0.9, 0.2], forms=form)
    assert not any("certificate" in n for n in found.notes)
    near = pinsing.connect(form, [0, -1, 1, 0.3, 1, 0], [0.2, -1, 1, 0.3, 1.1, 0], of=of)
    assert near.proven
    assert any("proven from the Jacobian" in n for n in near.notes)


@pytest.mark.slow
def test_those_are_held_without_which_the_others_reach_the_pose():
    arm = pinsing.load("ur5", task="position")
    found = pinsing.posture_changes(arm, [0.3, -1.0, 1.2, 0.4, 0.9, 0.2])
    assert len(found.others) <= 7
    assert not found.doubt
    (said,) = [n for n in found.notes if "held" in n]
    assert "wrist_3_joint" in said


@pytest.mark.slow
@pytest.mark.parametrize("q", [(0, 0, 0, 0, 0, 0), (0.1, -1, 1.2, 0.3, 0, 0.2)])
def test_singular_solutions_on_a_curve_are_examples_and_no_count(q):
    """With q5 = 0 joints 2, 3, 4 and 6 turn about parallel axes: one freedom more than needed."""
    arm = pinsing.load("ur5")
    found = pinsing.posture_changes(arm, q)
    regular = [other for other in found.others if other.solution.regular]
    singular = len(found.others) - len(regular)
    first, *rest = found.text().splitlines()
    assert singular > 4
    assert first.startswith(f"ur5: {len(regular)} other postures of this pose; this one is sing")
    assert any(f"Singular solutions too (examples, {singular} found)" in line for line in rest)
    assert "infinitely many" in found.doubt
    assert not any("was not found" in note for note in found.notes)


def test_a_way_round_a_singularity_is_raised_and_stays_a_way():
    """The elbow stays bent, and the wrist is taken near to q5 = 0 on purpose."""
    chosen = aspects_of("ur5")._map
    start = np.array([0.0, -1.0, 1.2, 0.3, 1.0, 0.0])
    end = start + np.array([0.4, 0.1, 0.2, 0.1, 0.2, 0.0])
    close = (start + end) / 2
    close[4] = 0.02
    path = np.stack([start, close, end])
    after = raised(chosen, path, iter(range(1000)))
    assert chosen.clear(path)
    assert chosen.clear(after)
    assert least(chosen, path) <= 0.02
    assert least(chosen, after) > 0.3
    assert np.array_equal(after[[0, -1]], [start, end])
