"""Every public function that takes joint values takes the whole model's configuration too."""

import inspect
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import test_public_types as public
from pinocchio.robot_wrapper import RobotWrapper

import pinsing
from pinsing import plot
from pinsing.description.catalog import find_robot
from pinsing.errors import ConfigurationError

# Parameters that are joint values of an arm.
JOINT_VALUES = {
    *("q", "Q", "q0", "Q0", "qa", "qb", "near", "nominal", "configuration", "trajectory"),
    *("motion", "poses", "path"),
}
# What has such a name and is none: a number, a file; or what knows no model.
OTHERS = {
    ("cuspidality", "poses"),
    ("plan_path", "poses"),
    *((name, "near") for name in ("check_line", "check_trajectory")),
    *((name, "path") for name in ("write_report", "Viewer.save_html", "Viewer.save_png")),
    ("DesignForm.residuals", "q"),
    *((f"Mechanism.{name}", "q") for name in ("check", "fold", "model_q")),
}

A, B = np.array([0.1, 0.5, 0.7]), np.array([0.2, -0.5, 0.7])
POSE = [0.3, 0.3, 0.0]


@pytest.fixture(scope="module")
def arm() -> pinsing.Arm:
    """Three joints on a base that floats: ten numbers of the model, of which the last three."""
    base = pin.JointModelFreeFlyer()
    model = pin.buildModelFromXML(find_robot("planar3r").path.read_text(), base)
    return pinsing.load(RobotWrapper(model))


@pytest.fixture(scope="module")
def form(arm: pinsing.Arm) -> pinsing.ClosedForm:
    return pinsing.closed_form(arm)


Of = Callable[..., Any]
SMALL = {"levels": 1, "samples": 5}

# What each gives for joint vectors a and b: numbers, or a text of all that is in it.
TAKES: dict[tuple[str, str], Of] = {
    ("analyze", "nominal"): lambda arm, form, a, b: repr(
        pinsing.analyze(arm, **SMALL, random_starts=2, seconds=60, nominal=a).findings
    ),
    ("at", "q"): lambda arm, form, a, b: pinsing.at(arm, a).sigma,
    ("clearance", "Q"): lambda arm, form, a, b: pinsing.clearance(form, [[a, b]]).lower,
    ("is_clear", "q"): lambda arm, form, a, b: pinsing.is_clear(form, a, 0.49),
    ("check_line", "q0"): lambda arm, form, a, b: pinsing.check_line(arm, a, POSE).q,
    ("check_trajectory", "Q"): lambda arm, form, a, b: repr(
        pinsing.check_trajectory(arm, [a, b]).crossings
    ),
    ("crossings", "motion"): lambda arm, form, a, b: repr(pinsing.crossings(form, [a, b])),
    ("frame_jacobian", "q"): lambda arm, form, a, b: pinsing.frame_jacobian(arm, a),
    ("frame_jacobians", "Q"): lambda arm, form, a, b: pinsing.kinematics.frame_jacobians(
        arm, [a, b]
    ),
    ("generalize", "configuration"): lambda arm, form, a, b: repr(
        pinsing.sampling.generalize(arm, stretched(a), samples=8)
    ),
    ("Monitor.update", "q"): lambda arm, form, a, b: repr(
        pinsing.Monitor(form).update(a, (0.1, 0.2, 0.3))
    ),
    ("plan_map", "q"): lambda arm, form, a, b: pinsing.sampling.plan_map(
        arm, joints=["q2"], count=8, q=a
    ).configurations(0, 8),
    ("plan_sweep", "nominal"): lambda arm, form, a, b: (
        pinsing.sampling.plan_sweep(arm, **SMALL, nominal=a).nominal
    ),
    ("sweep", "nominal"): lambda arm, form, a, b: (
        pinsing.sampling.sweep(arm, **SMALL, nominal=a).plan.nominal
    ),
    ("refine", "q0"): lambda arm, form, a, b: pinsing.kinematics.refine(arm, a).q,
    ("refine_many", "Q0"): lambda arm, form, a, b: [
        r.q for r in pinsing.kinematics.refine_many(arm, [a, b])
    ],
    ("sigma_map", "q"): lambda arm, form, a, b: (
        pinsing.sampling.sigma_map(arm, joints=["q2"], count=8, q=a).sigma_min.smallest.value
    ),
    ("singular_values", "Q"): lambda arm, form, a, b: pinsing.singular_values(arm, [a, b]),
    ("aspect_changes", "Q"): lambda arm, form, a, b: repr(
        pinsing.postures.aspect_changes(form, [a, b])
    ),
    ("line_postures", "q0"): lambda arm, form, a, b: repr(
        pinsing.postures.line_postures(arm, a, POSE)
    ),
    ("Aspects.of", "q"): lambda arm, form, a, b: pinsing.aspects(form).of(a),
    ("connect", "qa"): lambda arm, form, a, b: pinsing.connect(form, a, A).same,
    ("connect", "qb"): lambda arm, form, a, b: pinsing.connect(form, A, b).same,
    ("inverse", "near"): lambda arm, form, a, b: pinsing.inverse(arm, POSE, near=a).q,
    ("posture_changes", "q"): lambda arm, form, a, b: repr(pinsing.posture_changes(arm, a)),
    ("suggest", "near"): lambda arm, form, a, b: pinsing.suggest(arm, forms=form, near=a).q,
    ("task_jacobian", "q"): lambda arm, form, a, b: pinsing.kinematics.task_jacobian(arm, a),
    ("task_jacobians", "Q"): lambda arm, form, a, b: pinsing.kinematics.task_jacobians(arm, [a, b]),
    ("regular_radius", "Q"): lambda arm, form, a, b: pinsing.kinematics.regular_radius(arm, [a, b]),
    ("tip_speeds", "q"): lambda arm, form, a, b: (
        pinsing.kinematics.tip_speeds(arm, a, joint_speeds=np.ones(arm.n)).linear
    ),
    ("write_report", "poses"): lambda arm, form, a, b: reported(arm, form, poses={"mine": a}),
    ("write_report", "trajectory"): lambda arm, form, a, b: reported(arm, form, trajectory=[a, b]),
    ("Viewer", "poses"): lambda arm, form, a, b: shown(arm, poses=[a, b]),
    ("Viewer", "path"): lambda arm, form, a, b: shown(arm, path=[a, b]),
    ("Viewer.show", "q"): lambda arm, form, a, b: shown(arm, then=a),
    ("Arm.check", "q"): lambda arm, form, a, b: arm.check([a, b]),
    ("Arm.check_one", "q"): lambda arm, form, a, b: arm.check_one(a),
    ("Arm.check_many", "q"): lambda arm, form, a, b: arm.check_many([a, b]),
    ("Arm.fold", "q"): lambda arm, form, a, b: arm.fold(a),
    ("Arm.full_q", "q"): lambda arm, form, a, b: arm.full_q(a),
    ("Arm.model_q", "q"): lambda arm, form, a, b: arm.model_q(a),
    ("Arm.within_limits", "q"): lambda arm, form, a, b: arm.within_limits(a),
    ("ClosedForm.family_of", "q"): lambda arm, form, a, b: form.family_of(a),
    ("Family.contains", "q"): lambda arm, form, a, b: form.families[0].contains([a, b], 0.6),
    ("Family.distance", "q"): lambda arm, form, a, b: form.families[0].distance(a).value,
    ("Family.gradient", "q"): lambda arm, form, a, b: form.families[0].gradient(a),
    ("Family.where", "q"): lambda arm, form, a, b: form.families[0].where(a),
    ("plot.aspect_plane", "q"): lambda arm, form, a, b: drawn(
        plot.aspect_plane(arm, "q2", "q3", forms=form, samples=5, q=a)
    ),
    ("plot.locus", "q"): lambda arm, form, a, b: drawn(
        plot.locus(arm, form.families[0], "q1", "q2", q=a, samples=9)
    ),
    ("plot.sigma_along", "trajectory"): lambda arm, form, a, b: drawn(
        plot.sigma_along(arm, [a, b])
    ),
    ("plot.sigma_plane", "q"): lambda arm, form, a, b: drawn(
        plot.sigma_plane(arm, "q2", "q3", samples=5, q=a)
    ),
}


def stretched(q: np.ndarray) -> np.ndarray:
    """Singular: the last but one of its values is q2."""
    return np.array([*q[:-2], 0.0, q[-1]])


def shown(arm: pinsing.Arm, then: Any = None, **given: Any) -> list[Any]:
    """What a page holds of the values that it was given."""
    with pinsing.Viewer(arm, families=(), skeleton=True, **given) as viewer:
        if then is not None:
            viewer.show(then)
        return [*viewer.q, *(x for e in viewer.entries for pose in e.poses for x in pose)]


def reported(arm: pinsing.Arm, form: pinsing.ClosedForm, **given: Any) -> str:
    """The part of a report that is about a pose or a trajectory."""
    pinsing.write_report(arm, "report.html", forms=form, **given, page="none")
    text = Path("report.html").read_text()
    place = "mine" if "poses" in given else 'id="trajectory"'
    return text[text.index(place) :][:2000]


def drawn(ax: Any) -> list[float]:
    """Every number of a picture's lines and areas."""
    out = [float(x) for line in ax.lines for x in np.ravel(line.get_data())]
    out += [float(x) for c in ax.collections for x in values_of(c)]
    return [*out, *(float(x) for image in ax.images for x in np.ravel(image.get_array()))]


def values_of(collection: Any) -> list[Any]:
    """Colours of cells, zero where there is none."""
    values = collection.get_array()
    return [] if values is None else list(np.ma.filled(values, 0).ravel())


def of_public() -> set[tuple[str, str]]:
    """Each public function with a parameter that sounds like joint values."""
    takes = {name: inspect.signature(public.PUBLIC[name]).parameters for name in public.CALLS}
    return {(name, p) for name, own in takes.items() for p in own if p in JOINT_VALUES}


def test_every_function_with_joint_values_is_tried():
    assert of_public() <= TAKES.keys() | OTHERS
    assert of_public() >= OTHERS


DEAR = {("write_report", "poses"), ("write_report", "trajectory")}


@pytest.mark.slow
@pytest.mark.parametrize(
    "names",
    [TAKES.keys() - DEAR, pytest.param(DEAR, marks=pytest.mark.slow)],
    ids=["all but reports", "reports"],
)
def test_the_whole_models_configuration_is_taken_everywhere(
    arm, form, names, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    model = arm.source.full_model
    assert (arm.n, model.nq) == (3, 10)
    base = pin.randomConfiguration(model, np.full(10, -1.0), np.ones(10))
    for name in sorted(names):
        call = TAKES[name]
        plain = call(arm, form, A, B)
        whole = call(arm, form, arm.full_q(A, base), arm.full_q(B, base))
        if isinstance(plain, str) or plain is None:
            assert plain == whole, name
        else:
            assert np.size(plain), name
            np.testing.assert_allclose(plain, whole, atol=1e-12, err_msg=str(name))


def test_a_wrong_length_is_told_with_those_that_would_do(arm, form, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, call in TAKES.items():
        with pytest.raises(ConfigurationError, match=r"3 values.*or the whole model's 10") as bad:
            call(arm, form, np.zeros(4), np.zeros(4))
        assert bad.value.lengths == (3, 10), name


def test_what_is_read_from_a_file_knows_no_model(arm, form):
    again = pinsing.ClosedForm.from_json(form.to_json())
    whole = arm.full_q(A)
    assert again.families[0].distance(A).value == form.families[0].distance(A).value
    for call in (again.families[0].distance, again.family_of, pinsing.Monitor(again).update):
        with pytest.raises(ConfigurationError, match="q needs 3 values") as bad:
            call(whole)
        assert bad.value.lengths == (3,)


def test_an_arm_can_be_sent_to_another_process_whatever_was_asked_of_it(arm, form):
    pinsing.posture_changes(arm, A)
    again = pickle.loads(pickle.dumps(arm))
    np.testing.assert_array_equal(again.q_of(arm.full_q(A)), A)
    family = pickle.loads(pickle.dumps(form)).families[0]
    assert family.distance(A).value == form.families[0].distance(A).value
