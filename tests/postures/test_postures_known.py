"""What is said about postures where families lack, and where they separate nothing."""

from dataclasses import replace

import numpy as np
import pytest
from dh_arms import along, arm_of, aspects_of, form_of

import pinsing
from pinsing.kinematics.inverse import columns, regular_way
from pinsing.kinematics.jacobian import ratios

EVERY = ("F1", "F2", "F3")


def lacking(name, *names):
    """A closed form as a search would leave it that had no time for some families."""
    form = form_of(name)
    kept = tuple(f for f in form.families if f.name not in names)
    assert len(kept) == len(form.families) - len(names)
    return replace(form, families=kept, complete=False, gaps=("the time ran out",))


class TestFamiliesThatSeparateNothing:
    """Two conditions at once: a way can go round, and must."""

    def between(self, family):
        """Ends on either side of a configuration of a family, on one straight line with it."""
        rng = np.random.default_rng(1)
        arm = arm_of("iiwa14")
        for q in family.sample(60, np.random.default_rng(0)):
            ends = [q - 0.1 * rng.normal(size=7)]
            ends.append(2 * q - ends[0])
            if not arm.space.outside(np.array(ends)).any():
                return ends
        raise AssertionError("no configuration is far enough from the limits")

    def test_ways_go_round(self):
        arm, form, of = arm_of("iiwa14"), form_of("iiwa14"), aspects_of("iiwa14")
        thin = [f for f in form.families if f.codimension == 2]
        assert len(thin) == 3
        for family in thin:
            a, b = self.between(family)
            assert ratios(arm, along(np.stack([a, b]))).min() < 1e-4
            way = pinsing.connect(form, a, b, of=of)
            assert way.answer == "same"
            assert len(way.path) > 2
            assert regular_way(arm, way.path)
            assert 0 < way.clearance <= pinsing.clearance(form, along(way.path)).upper.min() + 1e-12

    def test_what_is_singular_is_in_no_aspect(self):
        form, of = form_of("iiwa14"), aspects_of("iiwa14")
        singular = [0.1, 0.0, np.pi / 2, 1.0, 0.3, 0.5, 0.2]
        beside = [0.1, 0.1, np.pi / 2, 1.0, 0.3, 0.5, 0.2]
        assert of.of(singular) is None
        assert of.of(beside) is not None
        said = pinsing.connect(form, singular, beside, of=of)
        assert said.answer == "undecided"
        assert not said.proven
        assert any("the start is singular, on F2" in n for n in said.notes)


class TestFamiliesThatLack:
    def test_the_count_is_a_lower_bound(self):
        whole = pinsing.aspects(replace(form_of("puma560"), proof=None))
        assert (whole.word, whole.proven, whole.lower) == ("probable", True, 12)
        assert whole.text().startswith(
            "puma560: 12 aspects within the joint limits, proven for the families found; that "
            "these are all is probable\n"
        )
        for names in (("F1",), ("F2",), EVERY):
            found = pinsing.aspects(lacking("puma560", *names))
            assert found.word == "not complete"
            assert not found.proven
            assert found.upper is None
            assert found.lower < whole.lower
            assert found.text().startswith(f"puma560: at least {found.lower} aspect")
            assert "(the time ran out): a family that is missing may cut more" in found.text()

    def test_with_a_certificate_nothing_is_left_to_say(self):
        form = pinsing.closed_form(arm_of("scara"), prove=True)
        found = pinsing.aspects(form)
        assert found.word == "proven"
        assert found.text().startswith("scara: 2 aspects within the joint limits, proven\n")
        stanford = pinsing.aspects(pinsing.closed_form(arm_of("stanford")))
        assert any("d3 in" in where for where in stanford[0].where)  # as its joints are called
        way = pinsing.connect(form, [0, 1, 0, 0], [0, 2, 0, 0], of=found)
        assert (way.answer, way.proven, way.notes) == ("same", True, ())

    @pytest.mark.parametrize("names", [pytest.param(("F2",), marks=pytest.mark.slow), EVERY])
    def test_same_is_said_only_where_the_jacobian_proves_it(self, names):
        arm, whole = arm_of("puma560"), aspects_of("puma560")
        form = lacking("puma560", *names)
        of = pinsing.aspects(form)
        rng = np.random.default_rng(2)
        answers = set()
        for a, b in arm.space.sample(24 if names == EVERY else 240, rng).reshape(-1, 2, 6):
            way = pinsing.connect(form, a, b, of=of)
            answers.add(way.answer)
            assert way.proven == (way.answer != "undecided")
            if way.answer == "undecided":
                assert way.path is None
                assert "not complete" in way.text()
            else:
                assert way.same == (whole.of(a) == whole.of(b))
        assert {"different", "undecided" if names == EVERY else "same"} <= answers

    def test_a_pair_without_any_family_between_is_told_by_the_determinant(self):
        form = lacking("puma560", *EVERY)
        a, b = [0.1, -0.6, 0.4, 0.2, 0.7, 0.3], [0.1, -0.6, 0.4, 0.2, -0.7, 0.3]
        J = columns(arm_of("puma560"), np.array([a, b]))
        assert np.linalg.det(J[0]) * np.linalg.det(J[1]) < 0
        way = pinsing.connect(form, a, b)
        assert (way.answer, way.aspects) == ("different", (1, 1))
        assert "both of what is known as 1" in way.text()

    def test_no_posture_is_reached_through_what_lacks(self):
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


class TestJointsThatAreHeld:
    @pytest.mark.slow
    def test_those_are_held_without_which_the_others_reach_the_pose(self):
        arm = pinsing.load("ur5", task="position")
        found = pinsing.posture_changes(arm, [0.3, -1.0, 1.2, 0.4, 0.9, 0.2])
        assert len(found.others) <= 7
        assert not found.doubt
        (said,) = [n for n in found.notes if "held" in n]
        assert "wrist_3_joint" in said
