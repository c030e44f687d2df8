"""Signs that tell inverse solutions apart, and the names that the field has for them."""

import numpy as np
import pytest
from dh_arms import dh_arm
from tiers import sampled, tiered

import pinsing
from pinsing.kinematics.jacobian import tip_placement
from pinsing.kinematics.ladder import ExactChain, Point, ladder_of, one_root_left, posture_names


def share(arm, count=60):
    """det J over the product of what the signs are taken of, at random configurations."""
    nominal = pinsing.robot.nominal(arm)
    ladder = ladder_of(nominal)
    Q = nominal.arm.space.sample(count, np.random.default_rng(3), True)
    J = pinsing.kinematics.task_jacobians(nominal.arm, Q)
    rows = np.abs(J).max(axis=(0, 2)) > 1e-12
    det = np.linalg.det(J[:, rows])
    return det / np.prod([s.value(Q) for s in ladder.stages], axis=0)


ARMS = ["ur5", "puma560", "irb1400", "kinova", "z1", "talos_arm", "stanford", "scara"]


@pytest.mark.parametrize("name", ARMS)
def test_the_determinant_is_the_product_of_the_signed_values(name):
    """So they are zero exactly where the arm is singular: up to one constant, of one size."""
    ratio = share(pinsing.load(name))
    assert np.ptp(np.abs(ratio)) < 1e-9 * np.abs(ratio[0])


POSITION = {
    "first axes parallel": [(0, 1, 0), (90, 0.7, 0.2), (0, 0.5, 0.1)],
    "first axes cross": [(90, 0, 0.3), (60, 0.7, 0.2), (0, 0.5, 0.1)],
    "last axes parallel": [(90, 0.4, 0.3), (0, 0.7, 0.2), (0, 0.5, 0.1)],
    "twisted, last axes parallel": [(60, 0.4, 0.3), (0, 0.7, 0.2), (0, 0.5, 0.1)],
    "orthogonal, no offset": [(-90, 1, 0), (90, 2, 0), (0, 1.5, 0)],
    "few solutions": [(-90, 1, 0), (90, 2, 1), (0, 0.1, 0)],
    "a slide, the first axes cross": [(90, 0, 0), (90, 0.3, 0.2), (0, 0, 0.5, 0, "prismatic")],
    "a slide, offset": [(90, 0.4, 0), (90, 0, 0.2), (0, 0, 0.5, 0, "prismatic")],
}


@pytest.mark.parametrize("name", tiered(POSITION, {"a slide, offset"}))
def test_no_two_solutions_of_a_point_agree_in_all_signs(name):
    """The theorem, at random points; with the product of the values against det J."""
    rows = POSITION[name]
    arm = dh_arm(rows, "position")
    ladder = ladder_of(pinsing.robot.nominal(arm))
    assert ladder is not None
    ratio = share(arm)
    assert (ratio > 0).all() or (ratio < 0).all() or rows[0][0] == 0
    rng = np.random.default_rng(1)
    most = 0
    for q in arm.space.sample(6, rng, True):
        found = [s.q for s in pinsing.inverse(arm, tip_placement(arm, q).translation) if s.regular]
        signs = ladder.signs(np.array(found))
        assert len({tuple(s) for s in signs}) == len(found)
        most = max(most, len(found))
    assert 2 <= most <= ladder.most


@pytest.mark.slow
def test_what_is_left_of_the_equation_has_the_roots_of_the_others():
    """The sign of its discriminant against the number of solutions found, arm with 2 and 4."""
    arm = dh_arm([(-90, 1, 0), (90, 2, 1), (0, 1.5, 0)], "position")
    chain = ExactChain.of(pinsing.robot.nominal(arm))
    cubic = Point.of(chain, chain.translation[3]).numbers
    assert not one_root_left(cubic)
    counts = set()
    for q in arm.space.sample(12, np.random.default_rng(2), True):
        sign = float(cubic.discriminant(chain.values(q[None])[:, 1:])[0])
        known = pinsing.inverse(arm, tip_placement(arm, q).translation)
        counts.add(len(known))
        assert len(known) == (2 if sign < 0 else 4)
    assert counts == {2, 4}


def test_the_discriminant_is_the_sum_that_stands_for_it():
    chain = ExactChain.of(
        pinsing.robot.nominal(dh_arm([(-70, 1, 0.2), (80, 2, 1), (0, 1.5, 0)], "position"))
    )
    cubic = Point.of(chain, chain.translation[3]).numbers
    x = np.random.default_rng(0).uniform(-4, 4, (2000, 2))
    value, (amplitude, phase, rate) = cubic.discriminant(x), cubic.expanded()
    assert np.abs(np.cos(x @ rate.T + phase) @ amplitude - value).max() < 12 * cubic.rounding
    assert cubic.rounding < 1e-8 * np.abs(value).max()
    for first, second in ((-90, 90), (60, 30)):  # the sine of 60 degrees has a square root
        rows = [(first, 1, 0), (second, 2, 1), (0, 1.5, 0.1 * (first > 0))]
        assert ladder_of(pinsing.robot.nominal(dh_arm(rows, "position"))) is None
    for name in ("so101", "panda", "iiwa14"):
        assert ladder_of(pinsing.robot.nominal(pinsing.load(name))) is None


class TestNames:
    def names(self, name, q):
        return posture_names(pinsing.robot.nominal(pinsing.load(name)), np.array([q]))[0]

    @pytest.mark.parametrize(
        ("name", "q"),
        sampled([
            ("rs007n", (0, 20, -80, 0, -80, 0)), ("a0509", (0, 20, 90, 0, 70, 0)),
            ("z1", (0, 90, -90, 0, 30, 0)), ("uf850", (0, -20, -90, 0, 70, 0)),
        ]),
    )  # fmt: skip
    def test_an_arm_at_work_has_its_shoulder_in_front(self, name, q):
        """Also one that stands on its first axis at zero, or with the wrist a little behind it."""
        said = self.names(name, np.radians(q))
        assert "shoulder front" in said
        assert "elbow up" in said

    def test_elbow_up_is_up(self):
        """Height of the elbow over the line from shoulder to wrist, while the wrist is ahead."""
        arm = pinsing.robot.nominal(pinsing.load("irb1400")).arm
        geometry = pinsing.robot.nominal(pinsing.load("irb1400"))
        chain = ExactChain.of(geometry)
        Q = arm.space.sample(200, np.random.default_rng(0))
        R, p = chain.frames(chain.values(Q))
        place, height = ladder_of(geometry).point
        p[:, 3] = p[:, place] + height * R[:, place, :, 2]  # the centre of the wrist
        inner = np.linalg.norm(p[:, 3, :2] - p[:, 1, :2], axis=1)
        ahead = (p[:, 1, :2] * p[:, 3, :2]).sum(axis=1) > 0
        beyond = np.linalg.norm(p[:, 3, :2], axis=1) > np.linalg.norm(p[:, 1, :2], axis=1)
        plain = ahead & beyond & (inner > 0.1)
        rise = (p[:, 3, 2] - p[:, 1, 2]) / inner
        toward = (p[:, 3, :2] - p[:, 1, :2]) / inner[:, None]
        at = ((p[:, 2, :2] - p[:, 1, :2]) * toward).sum(axis=1)
        above = p[:, 2, 2] > p[:, 1, 2] + rise * at
        names = posture_names(geometry, Q)
        assert plain.sum() > 20
        for said, up, use in zip(names, above, plain, strict=True):
            if use:
                assert (said[1], said[0]) == ("elbow up" if up else "elbow down", "shoulder front")

    @pytest.mark.parametrize("name", ["ur5", "puma560", "kinova", "z1"])
    def test_eight_postures_of_a_pose_have_eight_names(self, name):
        arm = pinsing.load(name)
        q = arm.space.sample(1, np.random.default_rng(11), True)[0]
        found = [s.q for s in pinsing.inverse(arm, tip_placement(arm, q).homogeneous)]
        names = posture_names(pinsing.robot.nominal(arm), np.array(found))
        assert len(found) >= 4
        assert len(set(names)) == len(found)

    @pytest.mark.parametrize("name", tiered(["ur5", "puma560", "kinova", "z1"], ("ur5",)))
    def test_they_change_at_singular_configurations_alone(self, name):
        arm = pinsing.load(name)
        form = pinsing.closed_form(arm)
        found = pinsing.aspects(form, limits=False)
        Q = arm.space.sample(200, np.random.default_rng(4), True)
        pairs = {
            (found.of(q), said) for q, said in zip(Q, posture_names(form.geometry, Q), strict=True)
        }
        assert len({number for number, _ in pairs}) == len({n for _, n in pairs}) == len(pairs) == 8

    @pytest.mark.parametrize("name", ["lrmate200id", "m10id", "r2000ic"])
    def test_a_fanucs_pendant_shows_no_flip_with_the_tool_down(self, name):
        geometry = pinsing.robot.nominal(pinsing.load(name))
        down = [0, -0.2, -0.3, 0, -np.pi / 2, 0]
        (said,) = posture_names(geometry, np.array([down]))
        assert said == ("shoulder front", "elbow up", "wrist no-flip")
