"""The public names: few, complete, lazy, never shadowed by a module, with advice for mistakes."""

import importlib
import pkgutil
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from command_line import python
from tiers import tiered

import pinsing
from pinsing.errors import PinsingError

PACKAGES = set(pinsing._packages)


def test_dir_has_public_names_and_packages_and_no_more():
    shown = {name for name in dir(pinsing) if not name.startswith("__")}
    assert shown == {*pinsing.__all__, *PACKAGES}
    assert len(pinsing.__all__) <= 32
    modules = {m.name for m in pkgutil.iter_modules(pinsing.__path__)}
    assert modules >= PACKAGES


@pytest.mark.parametrize("package", ["", *sorted(PACKAGES - {"errors"})])
def test_every_public_name_is_there(package):
    module = importlib.import_module(f"pinsing.{package}".rstrip("."))
    assert module.__doc__
    for name in module.__all__:
        value = getattr(module, name)
        assert callable(value)
        assert value.__doc__
        assert name in dir(module)


FIRST = ["pinsing.sampling.analyze", "pinsing.kinematics.refine", "pinsing.families"]


@pytest.mark.parametrize("first", tiered(FIRST, FIRST[1:2]))
def test_modules_do_not_shadow_functions(first):
    """Whatever was imported before: pinsing.kinematics.refine is the function."""
    code = (
        f"import importlib, pinsing; importlib.import_module({first!r})\n"
        "from pinsing.kinematics import at, refine\n"
        "from pinsing.sampling import analyze, generalize\n"
        "assert all(map(callable, (at, refine, analyze, generalize, pinsing.robot.load)))\n"
        "arm = pinsing.load('planar3r')\n"
        "assert pinsing.closed_form(arm).families\n"
        "assert pinsing.sampling.sweep(arm, levels=1, samples=11).curves\n"
        "from pinsing.kinematics.refine import SingularConfiguration\n"
    )
    done = python("-c", code)
    assert done.returncode == 0, done.stderr


# Mistakes ---------------------------------------------------------------------------------

MISTAKES = [
    # Names that moved, that people guess, or that are modules.
    ("pinsing.sweep(arm)", AttributeError, "pinsing.sampling.sweep"),
    ("pinsing.sweeep(arm)", AttributeError, "pinsing.sampling.sweep"),
    ("pinsing.refine(arm, q)", AttributeError, "pinsing.kinematics.refine"),
    ("pinsing.task_jacobian(arm, q)", AttributeError, "pinsing.kinematics.task_jacobian"),
    ("pinsing.Mechanism", AttributeError, "pinsing.robot.Mechanism"),
    ("pinsing.assembly_modes(arm)", AttributeError, "pinsing.loops.assembly_modes"),
    ("pinsing.workspace(arm)", AttributeError, "pinsing.plot.workspace"),
    ("pinsing.JointError", AttributeError, "pinsing.errors.JointError"),
    ("pinsing.check(arm, q)", AttributeError, "pinsing.check_trajectory(arm, Q)"),
    ("pinsing.singularities(arm)", AttributeError, "pinsing.closed_form(arm)"),
    ("pinsing.is_singular(arm, q)", AttributeError, "pinsing.at(arm, q)"),
    ("pinsing.from_urdf('a.urdf')", AttributeError, "pinsing.load(path)"),
    ("pinsing.jacobian(arm, q)", AttributeError, "pinsing.frame_jacobian(arm, q)"),
    ("pinsing.manipulability(arm, q)", AttributeError, "pinsing.at(arm, q).manipulability"),
    ("pinsing.ik(arm, pose)", AttributeError, "pinsing.inverse(arm, pose)"),
    ("pinsing.distance(form, q)", AttributeError, "pinsing.clearance(form, q)"),
    ("pinsing.export(arm)", AttributeError, "use pinsing.export_guard(form)"),
    ("pinsing.list()", AttributeError, "use `pinsing list` in a terminal"),
    ("pinsing.verify('a.json')", AttributeError, "pinsing.proof.verify"),
    ("pinsing.proof.verify(form)", pinsing.proof.Rejected, "no text of at most"),
    ("pinsing.write_report(arm, 'a.docx')", PinsingError, "a report is .html or .pdf"),
    ("pinsing.Load('ur5')", AttributeError, "pinsing.load"),
    ("pinsing.postures.sweep(arm)", AttributeError, "no attribute 'sweep'"),
    ("pinsing.families(arm)", TypeError, "a module, not a function: use pinsing.closed_form"),
    ("pinsing.postures(arm, pose)", TypeError, "pinsing.inverse(arm, pose)"),
    ("pinsing.view(arm)", TypeError, "pinsing.Viewer(arm)"),
    ("pinsing.report(arm)", TypeError, "pinsing.write_report"),
    ("pinsing.robot('ur5')", TypeError, "pinsing.load"),
    ("pinsing.plot(arm)", TypeError, "pinsing.plot.sigma_plane"),
    ("pinsing.loops(arm)", TypeError, "pinsing.load_mechanism"),
    # Robots, joints, frames, tasks and files that are not there.
    ("pinsing.load('ur55')", PinsingError, "unknown robot 'ur55': did you mean"),
    ("pinsing.load('my_robot.urdf')", PinsingError, "my_robot.urdf"),
    ("pinsing.load(None)", TypeError, "robot must be a file, the name of a robot"),
    ("pinsing.load('ur5', tip='tool')", PinsingError, "unknown frame 'tool': did you mean"),
    ("pinsing.load('ur5', base='world2')", PinsingError, "unknown frame 'world2'"),
    ("pinsing.load('ur5', joints=['elbow'])", PinsingError, "'elbow_joint'"),
    ("pinsing.load('ur5', joints='elbow_joint,q')", PinsingError, "unknown joint"),
    ("pinsing.load('ur5', task='positon')", PinsingError, "position"),
    ("pinsing.load('ur5', task='vx,vq')", PinsingError, "vq"),
    ("pinsing.load('ur5', length_scale=0)", PinsingError, "length_scale"),
    ("pinsing.load('ur5', units='grad')", PinsingError, "units"),
    ("pinsing.load('pr2')", PinsingError, "tip"),
    ("pinsing.load_mechanism('ur5')", PinsingError, "loop"),
    # What belongs elsewhere: names, results, forms and arms mixed up.
    ("pinsing.at('ur5', q)", TypeError, 'load it first, pinsing.load("ur5")'),
    ("pinsing.at(q, arm)", TypeError, "arm must be an Arm"),
    ("pinsing.at(form.arm, q)", TypeError, "use the arm that pinsing.load gave"),
    ("pinsing.at(read, q)", TypeError, "a closed form read from JSON"),
    ("pinsing.closed_form(pinsing.load)", TypeError, "arm must be"),
    ("pinsing.clearance(q, form)", TypeError, "pinsing.closed_form(arm) gives one"),
    ("pinsing.clearance(other, [q])", PinsingError, "needs"),
    ("pinsing.check_trajectory(arm, [q], forms=other)", PinsingError, "an arm with other joints"),
    ("pinsing.Monitor(q)", TypeError, "forms must be"),
    ("pinsing.inverse(arm, form)", PinsingError, "pose must be numbers"),
    ("pinsing.plan_path(form, q)", PinsingError, "poses"),
    ("pinsing.Viewer(form.families)", TypeError, "arm must be an Arm"),
    # What users of Pinocchio give.
    ("pinsing.closed_form(pin.Model)", TypeError, "pinsing.load(pin.buildModelFromUrdf(path))"),
    ("pinsing.closed_form(arm.model)", TypeError, "load it first, pinsing.load(model)"),
    ("pinsing.at(arm.model.createData(), q)", TypeError, "Data is not needed"),
    ("pinsing.closed_form(wrapper)", TypeError, "load it first, pinsing.load(robot)"),
    ("pinsing.load(arm.model, arm.model.createData())", TypeError, "a frame's name, such as"),
    ("pinsing.load(arm.model, tip=5)", TypeError, "model.frames[i].name"),
    ("pinsing.load(arm.model, joints=[1, 2])", TypeError, "model.names[i]"),
    ("pinsing.inverse(arm, [0, 0, 0, 0, 0, 0, 1])", PinsingError, "pin.XYZQUATToSE3(pose)"),
    ("pinsing.buildModelFromUrdf('a.urdf')", AttributeError, "use pinsing.load(path)"),
    # Configurations of the wrong shape, unit or kind.
    ("pinsing.at(arm, q[:5])", PinsingError, "q needs 6 values"),
    ("pinsing.at(arm, [q, q])", PinsingError, "one joint vector (6,)"),
    ("pinsing.at(arm, [0, -90, 90, 0, 45, 0])", PinsingError, "degrees"),
    ("pinsing.check_trajectory(arm, [[0, -90, 90, 0, 45, 0]] * 2)", PinsingError, "degrees"),
    ("pinsing.Monitor(form, warn=20, stop=5)", PinsingError, "radians"),
    ("pinsing.at(arm, ['0', '1', '0', '0', '0', '0'])", PinsingError, "q must be numbers"),
    ("pinsing.at(arm, {'elbow_joint': 1.0})", PinsingError, "q must be numbers"),
    ("pinsing.at(arm, [np.nan] * 6)", PinsingError, "every value must be finite"),
    ("pinsing.check_trajectory(arm, 'path.csv')", PinsingError, "Q must be numbers"),
    ("pinsing.check_trajectory(arm, q)", PinsingError, "a trajectory has shape (N, 6)"),
    ("pinsing.check_trajectory(arm, [q, q], t=[1, 0])", PinsingError, "times must ascend"),
    ("pinsing.inverse(arm, [0.3, 0.1])", PinsingError, "pose"),
    ("pinsing.inverse(arm, np.eye(4) * 2)", PinsingError, "not a rotation"),
    ("pinsing.singular_values(arm, q[:3])", PinsingError, "Q needs 6 values"),
    ("pinsing.clearance(form, [q], families=['F9'])", PinsingError, "unknown family 'F9'"),
    ("pinsing.clearance(form, [q], families=['elbo'])", PinsingError, "unknown family 'elbo'"),
    # The wrong attribute or method of a result.
    ("form['wirst']", PinsingError, "did you mean 'wrist'"),
    ("form['F7']", PinsingError, "unknown family 'F7'"),
    ("form[0]", PinsingError, "form.families[0]"),
    ("form.family", AttributeError, "or families"),
    ("form.wrist", AttributeError, "use form['wrist']"),
    ("form.F2", AttributeError, "use form['F2']"),
    ("form.distance(q)", AttributeError, "use pinsing.clearance(form, q)"),
    ("form.aspects()", AttributeError, "use pinsing.aspects"),
    ("arm.fk(q)", AttributeError, "Arm has no attribute 'fk': use pinsing.at(arm, q).tip_position"),
    ("arm.jacobian(q)", AttributeError, "use pinsing.frame_jacobian(arm, q)"),
    ("arm.limits", AttributeError, "use lower and upper"),
    ("arm.at(q)", AttributeError, "use pinsing.at"),
    ("arm.joint_names", AttributeError, "use joints"),
    ("arm.families", AttributeError, "use pinsing.closed_form(arm).families"),
    ("arm.view()", AttributeError, "use pinsing.Viewer(arm)"),
    ("pinsing.at(arm, q).jacobian", AttributeError, "State has no attribute 'jacobian': use J"),
    ("form.plot()", AttributeError, "pinsing.plot"),
    ("form.save('a.json')", AttributeError, "to_json"),
    ("form.arm.jnts", AttributeError, "jnts"),
    ("pinsing.ClosedForm.from_json('closed.json')", PinsingError, "not JSON"),
    ("pinsing.ClosedForm.from_json(state.to_json())", PinsingError, "pinsing/closed_form"),
    ("pinsing.export_guard(arm, 'rust')", PinsingError, "'c' or 'python'"),
]


@pytest.fixture(scope="module")
def names():
    arm = pinsing.load("ur5")
    q = np.array([0.1, -1, 1, 0.2, 1, 0])
    form = pinsing.closed_form(arm, prove=False)
    return {
        "np": np,
        "pin": pin,
        "pinsing": pinsing,
        "wrapper": SimpleNamespace(model=arm.model),
        "arm": arm,
        "q": q,
        "pose": np.eye(4),
        "form": form,
        "state": pinsing.at(arm, q),
        "read": pinsing.ClosedForm.from_json(form.to_json()),
        "other": pinsing.closed_form(pinsing.load("planar3r")),
    }


@pytest.mark.parametrize(("call", "error", "words"), MISTAKES, ids=[m[0] for m in MISTAKES])
def test_a_mistake_has_one_line_that_says_what_to_do(call, error, words, names):
    with pytest.raises(error) as caught:
        eval(call, dict(names))
    said = str(caught.value)
    assert words in said
    assert "\n" not in said
    assert len(said) < 400


def test_a_form_stands_for_its_arm_and_an_arm_for_its_form(names):
    arm, form, q = names["arm"], names["form"], names["q"]
    assert pinsing.at(form, q).to_dict() == pinsing.at(arm, q).to_dict()
    assert pinsing.clearance(arm, [q]).lower == pinsing.clearance(form, [q]).lower
    assert pinsing.check_trajectory(form, [q, q]).to_json()
    assert len(pinsing.inverse(form, pinsing.at(arm, q).tip_position).q) > 0
    assert str(pinsing.Monitor(arm)) == str(pinsing.Monitor(form))
    assert pinsing.aspects(arm).word == "proven"
