"""The public names: few, complete, lazy, never shadowed by a module, with advice for mistakes."""

import doctest
import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin  # noqa: F401  (the calls use it)
import pytest
from command_line import python
from public import documented
from tiers import tiered

import pinsing
from pinsing._batch import engine
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
    ("pinsing.check_trajectory(arm, [q], forms=other)", PinsingError, "of another arm"),
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
        **globals(), "arm": arm, "form": form, "q": q, "pose": np.eye(4),
        "wrapper": SimpleNamespace(model=arm.model), "state": pinsing.at(arm, q),
        "read": pinsing.ClosedForm.from_json(form.to_json()),
        "other": pinsing.closed_form(pinsing.load("planar3r")),
    }  # fmt: skip


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


# Docstrings: every argument is described, every function has an example that works ----------

# What other modules call and no user would: described, but without an example of its own.
PLUMBING = {
    "Arm.once", "Family.box", "Family.conditions", "MapPlan.configuration", "MapPlan.identity",
    "Mechanism.once",
}  # fmt: skip
# An example would need what a test run has not: a desktop, IPython, a browser.
ELSEWHERE = {"Viewer.jupyter_cell", "Viewer.open", "Viewer.save_png"}

# These take seconds each.
LONG = {
    *("Aspects.of", "analyze_mechanism", "aspects", "connect", "posture_changes"),
    *("write_report", "plot.inverse_count", "Cuspidality", "Cuspidality.text"),
}


def methods(kind: type) -> Iterator[tuple[str, Callable[..., Any]]]:
    for name in dir(kind):
        value = inspect.getattr_static(kind, name)
        value = getattr(value, "__func__", value)  # of a class method
        if inspect.isfunction(value) and value.__module__.startswith("pinsing.") and name[0] != "_":
            yield name, value


PUBLIC = documented()
"""Functions, methods and classes; inherited methods by the class that has them."""
CLASSES = {name for name, value in PUBLIC.items() if inspect.isclass(value)}
PUBLIC |= {f"{name}.{method}": f for name in CLASSES for method, f in methods(PUBLIC[name])}
DOC = {name: inspect.getdoc(value) or "" for name, value in PUBLIC.items()}
# Those that all results inherit are shown once, in the class that everybody meets first.
JSON = {"to_dict", "to_json", "from_dict", "from_json"}
SHARED = {n for n in PUBLIC if n.rpartition(".")[2] in JSON and not n.startswith("State.")}
SHARED |= {n for n, f in PUBLIC.items() if n.endswith(".text") and f.__name__ == "__str__"}
SHOWN = sorted(set(PUBLIC) - CLASSES - PLUMBING - ELSEWHERE - SHARED)


def section(doc: str, title: str) -> list[str]:
    """Lines of a section of a docstring in numpydoc style, without its heading."""
    lines = doc.splitlines()
    rules = [i for i, line in enumerate(lines) if re.fullmatch("-{3,}", line) and lines[i - 1]]
    for rule, end in pairwise([*rules, len(lines) + 1]):
        if lines[rule - 1] == title:
            return lines[rule + 1 : end - 1]
    return []


def described(doc: str) -> dict[str, str]:
    """What a docstring says of each argument: its sections Parameters and Attributes."""
    found: dict[str, list[str]] = {}
    names: list[str] = []
    for line in (*section(doc, "Parameters"), *section(doc, "Attributes")):
        if line[:1].strip():
            names = [name.strip(" *") for name in line.split(" : ")[0].split(",")]
            found |= {name: [] for name in names}
        elif line.strip():
            for name in names:
                found[name].append(line.strip())
    return {name: " ".join(words) for name, words in found.items()}


def test_every_argument_is_described():
    missing, invented = {}, {}
    for name in PUBLIC.keys() - {"PinsingError"}:  # an exception takes what Exception takes
        words, value = described(DOC[name]), PUBLIC[name]
        arguments = {*inspect.signature(value).parameters} - {"self", "cls"}
        missing[name] = {a for a in arguments if not words.get(a)}
        invented[name] = {w for w in words.keys() - arguments if not hasattr(value, w)}
        if invented[name]:
            invented[name] -= {*re.findall(r"self\.(\w+)", inspect.getsource(value))}
    assert {name: words for name, words in missing.items() if words} == {}
    assert {name: words for name, words in invented.items() if words} == {}


def referred(name: str, words: str) -> str | None:
    """Where "As in ``this``" leads: a public name, or another method of the same class."""
    found = re.match(r"As in ``([\w.]+)``", words)
    if found is None:
        return None
    here = f"{name.rpartition('.')[0]}.{found[1]}"
    assert {here, found[1]} & set(PUBLIC), f"{name}: there is no {found[1]} to look at"
    return here if here in PUBLIC else found[1]


def test_references_lead_to_a_description():
    for name in PUBLIC.keys() - CLASSES:
        for argument, words in described(DOC[name]).items():
            there = referred(name, words)
            if there is not None:
                found = described(DOC[there]).get(argument)
                assert found, f"{name}: {there} says nothing of {argument}"
                assert referred(there, found) != name, f"{name}: {argument}: a circle"


def test_every_function_says_what_it_returns():
    functions = [n for n in SHOWN if "." not in n.removeprefix("plot.")]
    for title in ("Returns", "Raises"):
        assert [n for n in functions if not section(DOC[n], title)] == []


def test_every_function_has_an_example():
    """One that shows a result, and can be read at a glance."""
    parse = doctest.DocTestParser().get_examples
    assert [n for n in SHOWN if not any(e.want for e in parse(DOC[n]))] == []
    assert [n for n in SHOWN if not 0 < len(section(DOC[n], "Examples")) <= 10] == []


EXAMPLES = [n for n in sorted(set(PUBLIC) - SHARED) if ">>>" in DOC[n]]


@pytest.mark.parametrize("name", tiered(EXAMPLES, set(EXAMPLES) - LONG))
def test_examples_are_true(name, tmp_path, monkeypatch):
    """Each by itself, as somebody would paste it: it imports what it needs."""
    monkeypatch.chdir(tmp_path)
    if name == "suggest" and not engine.available():
        pytest.skip("without the compiled kernel it finds less in its time")
    test = doctest.DocTestParser().get_doctest(DOC[name], {}, name, name, 0)
    said: list[str] = []
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    doctest.DocTestRunner(optionflags=flags).run(test, out=said.append)
    assert not said, "".join(said)


def test_the_lists_hold_nothing_else():
    assert set(PUBLIC) >= PLUMBING | ELSEWHERE
    shown = [n for n in PLUMBING | ELSEWHERE if section(DOC[n], "Examples")]
    assert not shown, f"these have an example by now: {', '.join(shown)}"


def test_no_example_stands_where_it_is_not_run():
    known = {inspect.unwrap(value) for value in PUBLIC.values()}
    homes = {Path(inspect.getsourcefile(v) or "") for v in known}
    source = Path(pinsing.__file__).parent
    elsewhere = [
        str(path.relative_to(source))
        for path in sorted(source.rglob("*.py"))
        if path not in homes and re.search(r"^ *>>> ", path.read_text(), re.MULTILINE)
    ]
    assert elsewhere == []
