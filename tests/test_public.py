"""The public names: few, complete, lazy, never shadowed by a module, with advice for mistakes."""

import doctest
import importlib
import inspect
import os
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
import test_result
from command_line import python, settled
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

MISTAKES = Path(__file__).parent / "mistakes.txt"
CALLS = re.findall(r"^>>> (.*)\n(.*)$", MISTAKES.read_text(), re.MULTILINE)


@pytest.fixture(scope="module")
def names():
    arm = pinsing.load("ur5")
    q = np.array([0.1, -1, 1, 0.2, 1, 0])
    form = pinsing.closed_form(arm, prove=False)
    return {
        **vars(test_result), **globals(), "arm": arm, "form": form, "q": q, "pose": np.eye(4),
        "wrapper": SimpleNamespace(model=arm.model), "state": pinsing.at(arm, q),
        "read": pinsing.ClosedForm.from_json(form.to_json()),
        "planar": (planar := pinsing.load("planar3r")), "other": pinsing.closed_form(planar),
        "stanford": (stanford := pinsing.load("stanford")), "surgical": pinsing.load("surgical7"),
        "swept": pinsing.sampling.sweep(stanford, levels=1, samples=9),
    }  # fmt: skip


@pytest.mark.parametrize(("call", "line"), CALLS, ids=[call for call, _ in CALLS])
def test_a_mistake_has_one_line_that_says_what_to_do(call, line, names):
    with pytest.raises((PinsingError, AttributeError, TypeError, pinsing.proof.Rejected)) as caught:
        eval(call, dict(names))
    said = settled(f"{caught.type.__name__}: {caught.value}")
    assert len(said) < 400
    if os.environ.get("PINSING_WORDS"):
        text = MISTAKES.read_text()
        MISTAKES.write_text(text.replace(f">>> {call}\n{line}", f">>> {call}\n{said}"))
    else:
        assert said == line


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
