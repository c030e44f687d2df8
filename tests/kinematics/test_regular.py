"""Balls in which an arm is regular: never larger than the distance to what is singular."""

import numpy as np
import pytest
from tiers import sampled, tiered

import pinsing
from pinsing.kinematics import regular_radius

ARMS = (
    "ur5", "puma560", "stanford", "scara", "planar3r", "panda", "iiwa14", "xarm7", "ur5:position",
    "puma560:orientation",
)  # fmt: skip


@pytest.mark.parametrize("name", sampled(tiered(ARMS, (*ARMS[1:6], ARMS[-1]))))
def test_nothing_singular_is_nearer(name):
    robot, _, task = name.partition(":")
    arm = pinsing.load(robot, task=task or "pose")
    form = pinsing.closed_form(arm, prove=False)
    rng = np.random.default_rng(1)
    scale = np.where(arm.prismatic, arm.length_scale, 1.0)
    parts = [rng.uniform(*arm.span, (60, arm.n))]
    for family in form.families:
        points = family.points(25, rng)
        size = np.where(np.arange(len(points)) % 5, 0.02, 1e-6)[:, None]
        parts.append(points + size * scale * rng.normal(size=points.shape))
    for k, Q in enumerate(parts):
        far = pinsing.clearance(form, Q, certify=True).upper
        radius = regular_radius(form.geometry.arm, Q)  # files are rounded, families are not
        assert (radius <= far + 1e-12).all()
        assert np.median((radius / far)[far > 1e-4]) > (0.35 if k else 0.1)


def test_other_tasks_and_what_is_singular_have_none():
    arm = pinsing.load("ur5")
    assert regular_radius(arm, [0, -1, 0, 0, 1, 0]) == 0
    assert regular_radius(arm.with_task("tool-axis"), [[0, -1, 1, 0, 1, 0]]).tolist() == [0]
    planar = pinsing.load("planar3r").with_task("position")  # no motion along z
    assert regular_radius(planar, [0, 1, 1]) == 0


def test_weights_and_norms_of_an_incomplete_form():
    form = pinsing.closed_form(pinsing.load("ur5"), seconds=1e-9, prove=False)
    assert (form.complete, form.families) == (False, ())
    q, radius = [0, -1.2, 1.3, -1, -1.5, 0], {}
    for norm in ("euclidean", "max"):
        radius[norm] = float(pinsing.clearance(form, q, norm=norm).lower)
    assert radius["euclidean"] == pytest.approx(float(regular_radius(form.loaded, q)))
    assert radius["max"] == pytest.approx(radius["euclidean"] / np.sqrt(6))
    assert pinsing.clearance(form, q, weights=[2] * 6).lower == pytest.approx(
        2 * radius["euclidean"]
    )
    assert pinsing.is_clear(form, q, 0.1)
    assert not pinsing.is_clear(form, q, 0.3)
