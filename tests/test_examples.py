"""Docstrings of the public API: every argument described, every function with a working example."""

import doctest
import inspect
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from matplotlib import pyplot
from public import documented
from tiers import tiered

import pinsing
from pinsing._batch import engine

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

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@dataclass(frozen=True)
class Public:
    """A public function, method or class; inherited methods by the class that has them."""

    name: str
    value: Callable[..., Any]

    @property
    def doc(self) -> str:
        return inspect.getdoc(self.value) or ""

    @property
    def arguments(self) -> tuple[str, ...]:
        names = inspect.signature(self.value).parameters
        return tuple(n for n in names if n not in ("self", "cls"))


def methods(name: str, kind: type) -> Iterator[Public]:
    for attribute in dir(kind):
        value = inspect.getattr_static(kind, attribute)
        value = getattr(value, "__func__", value)  # of a class method
        if attribute.startswith("_") or not inspect.isfunction(value):
            continue
        if value.__module__.startswith("pinsing."):
            yield Public(f"{name}.{attribute}", value)


def public() -> dict[str, Public]:
    found: dict[str, Public] = {}
    for label, value in documented().items():
        found[label] = Public(label, value)
        if inspect.isclass(value):
            found |= {m.name: m for m in methods(label, value)}
    return found


PUBLIC = public()
CLASSES = {name for name, p in PUBLIC.items() if inspect.isclass(p.value)}
# Those that all results inherit are shown once, in the class that everybody meets first.
JSON = {"to_dict", "to_json", "from_dict", "from_json"}
SHARED = {n for n in PUBLIC if n.rpartition(".")[2] in JSON and not n.startswith("State.")}
SHARED |= {n for n, p in PUBLIC.items() if n.endswith(".text") and p.value.__name__ == "__str__"}
SHOWN = sorted(set(PUBLIC) - CLASSES - PLUMBING - ELSEWHERE - SHARED)


def section(doc: str, title: str) -> list[str]:
    """Lines of a section of a docstring in numpydoc style, without its heading."""
    lines = doc.splitlines()
    heads = [
        i
        for i, (text, rule) in enumerate(pairwise(lines))
        if text.strip() and re.fullmatch("-{3,}", rule)
    ]
    for head, end in pairwise([*heads, len(lines)]):
        if lines[head] == title:
            return lines[head + 2 : end]
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


def of_each(names: Iterable[str]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """One test that looks at every name, and tells of all that fail; or at the one given."""

    def decorate(check: Callable[[str], None]) -> Callable[..., None]:
        def test(one: str = "") -> None:
            wrong = []
            for name in [one] if one else names:
                try:
                    check(name)
                except AssertionError as error:
                    wrong.append(str(error).partition("\nassert")[0])
            assert not wrong, "\n".join(wrong)

        test.__name__, test.__doc__ = check.__name__, check.__doc__
        return test

    return decorate


def examples(p: Public) -> list[doctest.Example]:
    return doctest.DocTestParser().get_examples(p.doc, p.name)


@of_each(sorted(PUBLIC))
def test_every_argument_is_described(name):
    p = PUBLIC[name]
    if name == "PinsingError":
        return  # an exception takes what Exception takes
    words = described(p.doc)
    missing = [a for a in p.arguments if not words.get(a)]
    assert not missing, f"{name}: the docstring says nothing of {', '.join(missing)}"
    invented = {w for w in words if w not in p.arguments and not hasattr(p.value, w)}
    if invented:
        invented -= set(re.findall(r"self\.(\w+)", inspect.getsource(p.value)))
    assert not invented, f"{name}: there is no argument {', '.join(invented)}"


def referred(name: str, words: str) -> Public | None:
    """Where "As in ``this``" leads: a public name, or another method of the same class."""
    found = re.match(r"As in ``([\w.]+)``", words)
    if found is None:
        return None
    here = f"{name.rpartition('.')[0]}.{found[1]}"
    assert {here, found[1]} & set(PUBLIC), f"{name}: there is no {found[1]} to look at"
    return PUBLIC.get(here) or PUBLIC[found[1]]


@of_each(sorted(set(PUBLIC) - CLASSES))
def test_references_lead_to_a_description(name):
    for argument, words in described(PUBLIC[name].doc).items():
        there = referred(name, words)
        if there is not None:
            found = described(there.doc).get(argument)
            assert found, f"{name}: {there.name} says nothing of {argument}"
            assert referred(there.name, found) is not PUBLIC[name], f"{name}: {argument}: a circle"


@of_each([n for n in SHOWN if "." not in n.removeprefix("plot.")])
def test_every_function_says_what_it_returns(name):
    assert section(PUBLIC[name].doc, "Returns"), f"{name}: no section Returns"
    assert section(PUBLIC[name].doc, "Raises"), f"{name}: no section Raises"


@of_each(SHOWN)
def test_every_function_has_an_example(name):
    lines = section(PUBLIC[name].doc, "Examples")
    assert lines, f"{name}: the docstring has no section Examples"
    found = examples(PUBLIC[name])
    assert any(e.want for e in found), f"{name}: its example shows no result, and proves nothing"
    assert len(lines) <= 10, f"{name}: its example is too long to be read at a glance"


EXAMPLES = [n for n in sorted(set(PUBLIC) - SHARED) if ">>>" in PUBLIC[n].doc]


@pytest.mark.parametrize("name", tiered(EXAMPLES, set(EXAMPLES) - LONG))
def test_examples_are_true(name, tmp_path, monkeypatch):
    """Each by itself, as somebody would paste it: it imports what it needs."""
    monkeypatch.chdir(tmp_path)
    if name == "suggest" and not engine.available():
        pytest.skip("without the compiled kernel it finds less in its time")
    p = PUBLIC[name]
    test = doctest.DocTestParser().get_doctest(p.doc, {}, name, name, 0)
    said: list[str] = []
    doctest.DocTestRunner(optionflags=FLAGS).run(test, out=said.append)
    pyplot.close("all")
    assert not said, "".join(said)


def test_the_lists_hold_nothing_else():
    assert set(PUBLIC) >= PLUMBING | ELSEWHERE
    shown = [n for n in PLUMBING | ELSEWHERE if section(PUBLIC[n].doc, "Examples")]
    assert not shown, f"these have an example by now: {', '.join(shown)}"


def test_no_example_stands_where_it_is_not_run():
    known = {inspect.unwrap(p.value) for p in PUBLIC.values()}
    homes = {Path(inspect.getsourcefile(v) or "") for v in known}
    source = Path(pinsing.__file__).parent
    elsewhere = [
        str(path.relative_to(source))
        for path in sorted(source.rglob("*.py"))
        if path not in homes and re.search(r"^ *>>> ", path.read_text(), re.MULTILINE)
    ]
    assert elsewhere == []
