"""Aspects, ways between postures, inverse solutions and cuspidal arms."""

import json

import numpy as np
import pytest
from dh_arms import CRX, GOFA, along, arm_of, aspects_of, dh_arm, form_of
from tiers import sampled, tiered

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.equation import Equation
from pinsing.errors import ConfigurationError, OptionError, PinsingError
from pinsing.kinematics.inverse import one_sheet, regular_way
from pinsing.kinematics.jacobian import tip_placement
from pinsing.postures.boxes import Ground, Leaves, on_boxes, slope, sum_of
from pinsing.postures.joint_map import Divided, Wheel, partition, subdivide
from pinsing.proximity.clearance import watch

# Counts of the literature's method, on whole circles and within the limits.
COUNTS = {
    "ur5": (8, 16), "puma560": (8, 12), "irb1400": (8, 4), "z1": (8, 2), "kinova": (8, 12),
    "talos_arm": (16, 4), "stanford": (8, 8), "so100": (2, 2), "so101": (2, 2), "surgical7": (2, 2),
    "iiwa14": (2, 2), "panda": (1, 1), "xarm7": (1, 1),
}  # fmt: skip


def _slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


def orthogonal(d2, d3, d4, r2):
    return dh_arm([(-90, d2, 0), (90, d3, r2), (0, d4, 0)], task="position")


def signs_of_det(arm, path, count=60):
    return np.sign(np.linalg.det(pinsing.kinematics.task_jacobians(arm, along(path, count))))


@pytest.mark.parametrize("name", sampled(tiered(COUNTS, {"ur5", "puma560", "stanford", "kinova"})))
def test_counts(name):
    for limits, count in zip((False, True), COUNTS[name], strict=True):
        found = aspects_of(name, limits)
        assert found.proven
        assert found.lower == found.upper == count == len(found)
        assert [found.of(a.q) for a in found] == list(range(1, count + 1))
        assert all(a.clearance > 0 for a in found)


def made(frequencies, cos, sin=None, powers=None):
    f = np.array(frequencies, dtype=np.int64)
    p = np.zeros_like(f) if powers is None else np.array(powers)
    sin = np.zeros(len(f)) if sin is None else np.array(sin)
    return Equation(("q1", "q2"), f, p, np.array(cos), sin, np.zeros(2))


class TestSubdivision:
    def box(self, equation, low, high, circle=(False, False)):
        terms = sum_of(equation, (0, 1))
        return (Ground((terms,), np.array(low), np.array(high), np.array(circle), np.ones(2)),)

    @pytest.mark.parametrize(
        ("equation", "corner", "circle", "count"),
        [
            # cos q1 + cos q2 = 0.5: a closed curve about the origin; inside and outside.
            (made([[2, 0], [0, 2], [0, 0]], [1.0, 1.0, -0.5]), (3.0, 3.0), False, 2),
            # The outside of it in a small box is in four corners.
            (made([[2, 0], [0, 2], [0, 0]], [1.0, 1.0, -1.5]), (1.0, 1.0), False, 5),
            # Circles join what a box cuts: cos q1.
            (made([[2, 0]], [1.0]), (3.14, 1.0), False, 3),
            (made([[2, 0]], [1.0]), (np.pi, 1.0), True, 2),
            # A half angle has no sign round a circle: cos(q1 / 2) has one zero a turn.
            (made([[1, 0]], [1.0]), (np.pi, 1.0), True, 1),
        ],
    )
    def test_counts_of_pieces(self, equation, corner, circle, count):
        low = [-x for x in corner]
        found = subdivide(self.box(equation, low, corner, (circle, False)), Budget(5.0))
        assert found.proven
        assert found.lower == count

    def test_a_crossing_of_sheets_is_not_proven(self):
        # cos q1 = cos q2, as one equation: two lines that cross.
        e = made([[2, 0], [0, 2]], [1.0, -1.0])
        found = subdivide(self.box(e, [-1.0, -1.0], [1.1, 1.2]), Budget(0.3))
        assert not found.proven
        assert found.lower <= 4

    def test_small_boxes_of_many_joints_are_told_apart(self):
        index = np.array([[0, 0, 0, 0], [0, 0, 0, 2**17 - 2]])  # one integer of them overflows
        level = np.full(2, 14)
        leaves = Leaves(level, index, np.zeros((2, 1, 1), int), np.ones(2, bool))
        assert leaves.find(level, index).tolist() == [0, 1]
        assert leaves.find(level[:1], np.array([[2**13, 0, 0, 0]])).tolist() == [-1]

    def test_bounds_hold(self):
        """Value and slope on random boxes are within what is said of them; lengths, too."""
        rng = np.random.default_rng(0)
        slides = made([[2, 0], [0, 0], [4, 0]], [1.0, -0.3, 0.2], [0.4, 0.0, -0.1],
                      [[0, 2], [0, 1], [0, 3]])  # fmt: skip
        arms = [e for n in ("ur5", "puma560") for f in form_of(n).families for e in f.equations]
        for e in (*arms, slides):
            joints = [*e.involved]
            terms, d = sum_of(e, e.involved), len(joints)
            x, h = rng.uniform(-2, 2, (200, d)), rng.uniform(0, 0.4, (200, d))
            known, v = on_boxes(terms, x, h), rng.normal(size=(200, d))
            rise, error = slope(terms, x, h, v)

            def full(y, e=e, joints=joints):
                q = np.zeros((len(y), len(e.joints)))
                q[:, joints] = y
                return q

            np.testing.assert_allclose(known.value, e(full(x)), atol=1e-12)
            np.testing.assert_allclose(known.gradient, e.gradient(full(x))[:, joints], atol=1e-12)
            for _ in range(50):
                y = x + h * rng.uniform(-1, 1, x.shape)
                assert (np.abs(e(full(y)) - known.value) <= known.swing).all()
                along = np.einsum("nd,nd->n", e.gradient(full(y))[:, joints], v)
                assert (np.abs(along - rise) <= error + 1e-12).all()


@pytest.mark.slow
def test_an_offset_wrist_has_two_aspects_by_algebra():
    form = pinsing.closed_form(dh_arm(CRX))
    cut = partition(watch(form), limits=False)
    (part,) = [p for p in cut.parts if p.surfaces]
    found = pinsing.aspects(form, limits=False)
    (piece,) = [p for pieces in found._map.pieces for p in pieces if p.part.joints == part.joints]
    assert isinstance(piece, Wheel)
    assert found.proven
    assert found.lower == 2
    for name, across in (("ur5", True), ("irb1400", False)):
        each = [p for pieces in aspects_of(name)._map.pieces for p in pieces]
        assert across in {p.hub is not None for p in each if isinstance(p, Divided)}


class TestConnect:
    @pytest.mark.parametrize("name", ["puma560", _slow("ur5"), _slow("kinova")])
    @pytest.mark.parametrize("limits", [True, False])
    def test_every_pair_is_decided(self, name, limits):
        form, arm = form_of(name), arm_of(name)
        found = aspects_of(name, limits)
        rng = np.random.default_rng(5)
        Q = arm.space.sample(24, rng, not limits)
        answers = set()
        for a, b in zip(Q[::2], Q[1::2], strict=True):
            way = pinsing.connect(form, a, b, limits=limits, of=found)
            answers.add(way.answer)
            assert way.same is (found.of(a) == found.of(b))
            if way.same:
                self.check(arm, way, a, b, limits)
        assert "different" in answers

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("name", "limits"), [_slow("ur5", True), _slow("z1", False), ("puma560", True)]
    )
    def test_pairs_of_one_aspect(self, name, limits):
        form, arm = form_of(name), arm_of(name)
        found = aspects_of(name, limits)
        rng = np.random.default_rng(6)
        by = {}
        for q in arm.space.sample(90, rng, not limits):
            by.setdefault(found.of(q), []).append(q)
        bent = 0
        for group in by.values():
            for a, b in list(zip(group[::2], group[1::2], strict=False))[:2]:
                way = pinsing.connect(form, a, b, limits=limits, of=found)
                assert way.same
                self.check(arm, way, a, b, limits)
                bent += len(way.path) > 2
        assert bent or name != "ur5"

    def check(self, arm, way, a, b, limits):
        assert np.array_equal(way.path[0], a)
        assert np.abs(arm.space.wrap(way.path[-1] - b)).max() < 1e-9
        if limits:
            inside = (way.path >= arm.lower - 1e-9) & (way.path <= arm.upper + 1e-9)
            assert inside.all()
        signs = signs_of_det(arm, way.path)
        assert (signs == signs[0]).all()
        assert way.clearance > 0

    def test_the_clearance_of_a_way_holds(self):
        form, arm = form_of("puma560"), arm_of("puma560")
        rng = np.random.default_rng(8)
        found = aspects_of("puma560")
        ways = [
            pinsing.connect(form, a, b, of=found)
            for a, b in arm.space.sample(20, rng).reshape(-1, 2, 6)
        ]
        for way in (w for w in ways if w.same):
            upper = pinsing.clearance(form, along(way.path)).upper
            assert upper.min() >= way.clearance - 1e-12

    def test_json_and_back(self):
        form = form_of("puma560")
        way = pinsing.connect(form, [0, 0.1, 0.3, 0, 1, 0], [1, 0.3, 0.4, 0, 1, 0])
        again = pinsing.postures.Connection.from_dict(json.loads(json.dumps(way.to_dict())))
        assert again.answer == way.answer
        assert np.array_equal(again.path, way.path)
        found = aspects_of("puma560")
        assert pinsing.postures.Aspects.from_dict(found.to_dict()).lower == 12
        with pytest.raises(OptionError, match="read from JSON"):
            pinsing.postures.Aspects.from_dict(found.to_dict()).of([0.0] * 6)

    def test_bad_input(self):
        form, of = form_of("ur5"), aspects_of("ur5")
        with pytest.raises(ConfigurationError, match="outside its limits"):
            pinsing.connect(form, [0, 0, 9, 0, 0, 0], [0] * 6, of=of)
        with pytest.raises(PinsingError):
            pinsing.connect(form, [0, 0, 0], [0] * 6, of=of)
        with pytest.raises(OptionError, match="limits says otherwise"):
            pinsing.connect(form, [0.1] * 6, [0.2] * 6, of=aspects_of("ur5", False))


class TestCuspidality:
    @pytest.mark.parametrize("rows", [CRX, _slow(GOFA)])
    def test_offset_wrists_are_cuspidal(self, rows):
        arm = dh_arm(rows)
        found = pinsing.cuspidality(arm, poses=3)
        assert found.answer == "cuspidal"
        assert found.proven
        assert not any("certificate" in n or "practically singular" in n for n in found.notes)
        path = found.witness.path
        first, last = (tip_placement(arm, q).homogeneous for q in (path[0], path[-1]))
        assert np.abs(first - last).max() < 1e-9
        assert np.abs(arm.space.wrap(path[-1] - path[0])).max() > 1e-3
        signs = signs_of_det(arm, path, 10_000 // len(path))
        assert (signs == signs[0]).all()

    @pytest.mark.parametrize(
        ("lengths", "answer", "aspects", "most"),
        [
            ((1, 2, 1.5, 1), "cuspidal", 2, 4), _slow((1, 2, 0.2, 1), "not cuspidal", 2, 2),
            _slow((1, 2, 0.1, 1), "not cuspidal", 2, 2),
            _slow((1, 2, 1.5, 0), "not cuspidal", 4, 4),
        ],
    )  # fmt: skip
    def test_orthogonal_arms(self, lengths, answer, aspects, most):
        """Three orthogonal axes (Wenger): d2, d3, d4, r2."""
        arm = orthogonal(*lengths)
        found = pinsing.cuspidality(arm, poses=20)
        assert (found.answer, found.aspects) == (answer, aspects)
        assert found.most_solutions <= most

    @pytest.mark.parametrize("name", ["ur5", _slow("puma560"), _slow("irb1400")])
    def test_classic_arms_are_never_called_cuspidal(self, name):
        found = pinsing.cuspidality(arm_of(name), forms=form_of(name), poses=4)
        assert found.answer == "not cuspidal"
        assert found.proven
        assert not any("certificate" in n for n in found.notes)
        assert "3 signs" in found.reason
        assert found.most_solutions == 8
        assert found.witness is None

    def test_where_no_theorem_is_known_nothing_is_claimed(self):
        found = pinsing.cuspidality(arm_of("so101"), forms=form_of("so101"), poses=2)
        assert found.answer == "no evidence"
        assert not found.proven

    @pytest.mark.slow
    def test_an_arm_of_five_joints_says_what_its_answer_rests_on(self):
        """SO-100 reaches over its own base: over the top no rank is lost, the elbow stays."""
        arm = arm_of("so100")
        found = pinsing.cuspidality(arm, forms=form_of("so100"), poses=3)
        assert found.answer == "cuspidal"
        path = found.witness.path
        first, last = (tip_placement(arm, q).homogeneous for q in (path[0], path[-1]))
        assert np.abs(first - last).max() < 1e-9
        assert np.abs(arm.space.wrap(path[-1] - path[0])).max() > 1
        J = pinsing.kinematics.task_jacobians(arm, along(path, 2000))
        sizes = np.linalg.svd(J, compute_uv=False)
        assert sizes.shape[1] == 5
        assert sizes[:, 4].min() > 1e-5
        said = " ".join(found.notes)
        assert "with 5 joints regular means rank 5" in said
        assert "rests on numbers" in said
        assert "from the Jacobian of the arm itself" in said
        assert "no certificate" not in said

    @pytest.mark.slow
    def test_a_way_is_regular_only_where_no_family_is_met(self):
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

    def test_two_sheets_of_poses_that_cross_are_no_posture_change(self):
        """The tip of an arm of five joints leaves one way from one configuration."""
        arm = arm_of("so101")
        a, b = arm.space.sample(2, np.random.default_rng(0), True)
        assert one_sheet(arm, a, a)
        assert not one_sheet(arm, a, b)
        assert one_sheet(arm_of("ur5"), np.full(6, 0.3), np.full(6, 0.8))


@pytest.mark.slow
def test_posture_changes():
    q = [0.1, -1.0, 1.2, 0.3, 0.9, 0.2]
    found = pinsing.posture_changes(arm_of("ur5"), q, forms=form_of("ur5"))
    assert all(o.connection is None or o.connection.answer == "different" for o in found.others)
    arm = dh_arm(CRX)
    rng = np.random.default_rng(1)
    reached = 0
    for q in arm.space.sample(3, rng):
        ways = pinsing.posture_changes(arm, q, limits=False).others
        reached += sum(o.connection is not None and o.connection.same is True for o in ways)
    assert reached
