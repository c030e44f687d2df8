"""Every public function that takes joint values takes the whole model's configuration too."""

import pickle
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


SMALL = {"levels": 1, "samples": 5}
# Of joint vectors a and b: numbers, or a text of all that is in it.
TAKES: dict[tuple[str, str], str] = {
    ("analyze", "nominal"): "repr(analyze(arm, **SMALL, random_starts=2, nominal=a).findings)",
    ("at", "q"): "at(arm, a).sigma",
    ("clearance", "Q"): "clearance(form, [[a, b]]).lower",
    ("is_clear", "q"): "is_clear(form, a, 0.49)",
    ("check_line", "q0"): "check_line(arm, a, POSE).q",
    ("check_trajectory", "Q"): "repr(check_trajectory(arm, [a, b]).crossings)",
    ("crossings", "motion"): "repr(crossings(form, [a, b]))",
    ("frame_jacobian", "q"): "frame_jacobian(arm, a)",
    ("frame_jacobians", "Q"): "frame_jacobians(arm, [a, b])",
    ("generalize", "configuration"): "repr(generalize(arm, [*a[:-2], 0.0, a[-1]], samples=8))",
    ("Monitor.update", "q"): "repr(Monitor(form).update(a, (0.1, 0.2, 0.3)))",
    ("plan_map", "q"): "plan_map(arm, joints=['q2'], count=8, q=a).configurations(0, 8)",
    ("plan_sweep", "nominal"): "plan_sweep(arm, **SMALL, nominal=a).nominal",
    ("sweep", "nominal"): "sweep(arm, **SMALL, nominal=a).plan.nominal",
    ("refine", "q0"): "refine(arm, a).q",
    ("refine_many", "Q0"): "[found.q for found in refine_many(arm, [a, b])]",
    ("sigma_map", "q"): "sigma_map(arm, joints=['q2'], count=8, q=a).sigma_min.smallest.value",
    ("singular_values", "Q"): "singular_values(arm, [a, b])",
    ("aspect_changes", "Q"): "repr(aspect_changes(form, [a, b]))",
    ("line_postures", "q0"): "repr(line_postures(arm, a, POSE))",
    ("Aspects.of", "q"): "aspects(form).of(a)",
    ("connect", "qa"): "connect(form, a, A).same",
    ("connect", "qb"): "connect(form, A, b).same",
    ("inverse", "near"): "inverse(arm, POSE, near=a).q",
    ("posture_changes", "q"): "repr(posture_changes(arm, a))",
    ("suggest", "near"): "suggest(arm, forms=form, near=a).q",
    ("task_jacobian", "q"): "task_jacobian(arm, a)",
    ("task_jacobians", "Q"): "task_jacobians(arm, [a, b])",
    ("regular_radius", "Q"): "regular_radius(arm, [a, b])",
    ("tip_speeds", "q"): "tip_speeds(arm, a, joint_speeds=[1, 1, 1]).linear",
    ("write_report", "poses"): "reported(arm, form, poses={'mine': a})",
    ("write_report", "trajectory"): "reported(arm, form, trajectory=[a, b])",
    ("Viewer", "poses"): "shown(arm, poses=[a, b])",
    ("Viewer", "path"): "shown(arm, path=[a, b])",
    ("Viewer.show", "q"): "shown(arm, then=a)",
    ("Arm.check", "q"): "arm.check([a, b])",
    ("Arm.check_one", "q"): "arm.check_one(a)",
    ("Arm.check_many", "q"): "arm.check_many([a, b])",
    ("Arm.fold", "q"): "arm.fold(a)",
    ("Arm.full_q", "q"): "arm.full_q(a)",
    ("Arm.model_q", "q"): "arm.model_q(a)",
    ("Arm.within_limits", "q"): "arm.within_limits(a)",
    ("ClosedForm.family_of", "q"): "form.family_of(a)",
    ("Family.contains", "q"): "family.contains([a, b], 0.6)",
    ("Family.distance", "q"): "family.distance(a).value",
    ("Family.gradient", "q"): "family.gradient(a)",
    ("Family.where", "q"): "family.where(a)",
    ("plot.aspect_plane", "q"): "drawn(aspect_plane(arm, 'q2', 'q3', forms=form, samples=5, q=a))",
    ("plot.locus", "q"): "drawn(locus(arm, family, 'q1', 'q2', q=a, samples=9))",
    ("plot.sigma_along", "trajectory"): "drawn(sigma_along(arm, [a, b]))",
    ("plot.sigma_plane", "q"): "drawn(sigma_plane(arm, 'q2', 'q3', samples=5, q=a))",
}


def called(text: str, arm: pinsing.Arm, form: pinsing.ClosedForm, a: Any, b: Any) -> Any:
    """What a text of the table gives."""
    packages = (pinsing, pinsing.kinematics, pinsing.postures, pinsing.sampling, plot)
    names = {name: getattr(p, name) for p in packages for name in p.__all__}
    given = {"arm": arm, "form": form, "family": form.families[0], "a": a, "b": b}
    return eval(text, {**names, **globals(), **given})


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
    arrays = [x.get_array() for x in (*ax.collections, *ax.images)]
    return [*out, *(float(x) for a in arrays if a is not None for x in np.ma.filled(a, 0).ravel())]


def test_every_function_with_joint_values_is_tried():
    takes = public.PARAMETERS.items()
    found = {(name, p) for name, own in takes for p in own if p in JOINT_VALUES}
    assert OTHERS <= found <= TAKES.keys() | OTHERS


@pytest.mark.slow
def test_the_whole_models_configuration_is_taken_everywhere(arm, form, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = arm.source.full_model
    assert (arm.n, model.nq) == (3, 10)
    base = pin.randomConfiguration(model, np.full(10, -1.0), np.ones(10))
    for name, text in TAKES.items():
        plain = called(text, arm, form, A, B)
        whole = called(text, arm, form, arm.full_q(A, base), arm.full_q(B, base))
        if isinstance(plain, str) or plain is None:
            assert plain == whole, name
        else:
            assert np.size(plain), name
            np.testing.assert_allclose(plain, whole, atol=1e-12, err_msg=str(name))


def test_a_wrong_length_is_told_with_those_that_would_do(arm, form, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in TAKES.items():
        with pytest.raises(ConfigurationError, match=r"3 values.*or the whole model's 10") as bad:
            called(text, arm, form, np.zeros(4), np.zeros(4))
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
