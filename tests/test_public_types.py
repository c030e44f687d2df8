"""Every public function, given what it cannot use, says which argument is wrong, in one line.

The test finds the functions by itself: those of the reference, and the methods of its classes.
What each is called with is what the example in its docstring calls it with.
"""

import ast
import datetime
import doctest
import functools
import inspect
import re
import warnings
from collections.abc import Callable, Sequence
from decimal import Decimal
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib import pyplot
from public import documented
from tiers import sampled, tiered

import pinsing
import pinsing.plot
from pinsing.errors import ArgumentError, PinsingError


class Unfit:
    def __repr__(self) -> str:
        return "Unfit()"


def holding_itself() -> list[Any]:
    loop: list[Any] = [0.0]
    loop += [loop, loop]
    return loop


# Never right, wherever they are given.
NEVER = {
    "object": Unfit(), "bytes": b"ur5", "complex": 1j, "complex array": np.full(3, 1j),
    "date": datetime.datetime(2020, 1, 1), "dates": np.full(3, np.datetime64("2020-01-01")),
    "objects": np.full(3, Unfit(), dtype=object),
    "masked": np.ma.masked_array(np.zeros(3), [0, 1, 0]),
    "masked in a list": [np.ma.masked, 0.0, 0.0], "set": {Unfit()},
    "span of time": np.timedelta64(1, "s"), "spans of time": [np.timedelta64(1, "s")] * 3,
    "list of itself": holding_itself(), "more than a float": 10**400,
    "more than can be printed": 10**5000, "numbers too large": [10**400] * 3,
}  # fmt: skip
# Right in some places; a call that takes them ends well.
ODD = {
    "None": None, "text": "ur5", "empty": "", "number": 2.5, "nan": float("nan"),
    "inf": float("inf"), "minus": -1, "zero": 0, "huge": 10**30, "yes": True,
    "fractions": [Decimal(1), Decimal(0), Decimal(0)], "nans": np.full(3, np.nan),
    "texts": np.array(["a", "b", "c"]), "numbers as text": ["0.1", "0.2", "0.3"],
    "ragged": [[1.0], [1.0, 2.0]], "list": [], "one": np.zeros(1), "cube": np.zeros((2, 2, 2, 3)),
    "mapping": {"q1": "x"}, "float32": np.zeros(3, dtype=np.float32), "ints": [0, 1, 2],
    "largest": [1e308] * 3, "half a character": "\ud800", "half characters": ["\ud800"],
}  # fmt: skip
# Used up by one call; those that are never right but empty ones may be.
ONCE: dict[str, Callable[[], Any]] = {
    "generator": lambda: (x for x in ("q1", "q2")),
    "empty generator": lambda: iter(()),
}


@pytest.fixture(autouse=True)
def _somewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


VIEWER = ">>> pinsing.Viewer(pinsing.load('planar3r'), skeleton=True)"
INSTEAD = {
    "Arm.check": ">>> pinsing.load('planar3r').check([0, 0.5, 0.7])",
    "Aspects.of": ">>> pinsing.aspects(pinsing.closed_form('planar3r')).of([0, 0.5, 0.7])",
    "connect": ">>> pinsing.connect(pinsing.closed_form('planar3r'), [0, 0.5, 0.7], [0, 0.6, 0.7])",
    "Family.box": ">>> pinsing.closed_form('planar3r').families[0].box(True)",
    "Family.conditions": ">>> pinsing.closed_form('planar3r').families[0].conditions()",
    "Viewer.jupyter_cell": f"{VIEWER}.jupyter_cell()",
    "Viewer.save_png": f"{VIEWER}.save_png('view.png')",
    "Viewer.play": f"{VIEWER}.play('F1')",
}
"""Of functions whose own example is none, or is of an error, or needs what it made before."""
QUICKER: dict[str, dict[str, Any]] = {
    "analyze": {"levels": 1, "samples": 5, "random_starts": 2, "seconds": 2.0},
    "zones": {"boxes": 200}, "suggest": {"work": 0.3}, "cuspidality": {"poses": 1},
    "Viewer": {"families": (), "skeleton": True},
    "plot.aspect_plane": {"samples": 5}, "plot.sigma_plane": {"samples": 5},
    "write_report": {"page": "none"},
}  # fmt: skip
FREE = {"crossings": {"motion"}, "Viewer": {"visualizer"}, "Arm.check_many": {"name", "own"}}
FREE |= {name: {"name"} for name in ("Arm.check", "Arm.check_one", "Mechanism.check")}
"""Parameters that may be anything."""
SLOW = {
    "analyze_mechanism", "mechanism_map", "check_line", "export_guard", "plan_path", "write_report",
    "Viewer.save_png", "plot.inverse_count",
}  # fmt: skip
"""What is right is tried in other tests."""


@functools.cache
def example(name: str) -> tuple[Callable[..., Any], dict[str, Any]]:
    """A function, or a method of an object, and arguments with which it works."""
    text = INSTEAD.get(name) or inspect.getdoc(PUBLIC[name]) or ""
    shown = [e.source for e in doctest.DocTestParser().get_examples(text)]
    for k, source in enumerate(shown):
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Call) and re.fullmatch(
                rf"(.*\.)?{name.rpartition('.')[2]}", ast.unparse(node.func)
            ):
                names: dict[str, Any] = {"pinsing": pinsing}
                exec("".join(shown[:k]), names)
                function = eval(ast.unparse(node.func), names)
                names["bound"] = inspect.signature(function).bind
                node.func = ast.Name("bound")
                given = eval(ast.unparse(node), names).arguments
                return function, given | QUICKER.get(name, {})
    raise AssertionError(f"{name} has no example")


def call(name: str, **given: Any) -> Any:
    made = example(name)[0](**given)
    if name == "Viewer":
        made.close()
    return made


@functools.cache
def arm() -> Any:
    return pinsing.load("planar3r", task="position")


INTERNAL = {"once", "configuration"}  # of `Memory` and of `MapPlan`: for other modules alone


def public() -> dict[str, Any]:
    """All that takes arguments, by name; results are made by functions, not by hand."""
    found = {}
    for name, value in documented().items():
        if not inspect.isclass(value):
            found[name] = value
            continue
        if name == "Viewer":
            found[name] = value
        for method, function in inspect.getmembers(value, inspect.isfunction):
            given = set(inspect.signature(function).parameters) - {"self"}
            shared = function.__module__ == "pinsing.interface"  # one for all: tested below
            if given and not shared and method[0] != "_" and method not in INTERNAL:
                found[f"{name}.{method}"] = function
    return found


PUBLIC = public()
PARAMETERS = {name: inspect.signature(function).parameters for name, function in PUBLIC.items()}
OF = {
    name: [p for p in parameters if p not in {"self", *FREE.get(name, ())}]
    for name, parameters in PARAMETERS.items()
}
"""Parameters of each function."""


def wrong(name: str, parameter: str, value: Any) -> PinsingError | None:
    """Call with one argument replaced: the error, None if the call ended well."""
    raised: PinsingError | None = None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            call(name, **{**example(name)[1], parameter: value})
        except PinsingError as error:
            raised = error
    if raised is not None:
        assert "\n" not in str(raised)
        assert len(str(raised)) < 500
        str(raised).encode()
    return raised


@pytest.mark.parametrize("name", sampled(OF))
def test_what_never_fits_is_refused_by_name(name):
    for parameter in OF[name]:
        for what, value in NEVER.items():
            error = wrong(name, parameter, value)
            assert error is not None, (parameter, what)
            assert parameter in str(error), (parameter, what, str(error))


FITTED = [name for name in OF if name not in SLOW]
LONG = {
    "TrajectoryCheck.text", "Viewer", "analyze", "aspects", "check_trajectory", "connect",
    "line_postures", "posture_changes",
    "plot.aspect_plane", "plot.sigma_plane", "suggest", "zones",
}  # fmt: skip


@pytest.mark.parametrize("name", sampled(tiered(FITTED, set(FITTED) - LONG)))
def test_what_may_fit_is_taken_or_refused(name):
    for parameter in OF[name]:
        default = PARAMETERS[name][parameter].default
        for value in ODD.values():
            if value is not default:
                wrong(name, parameter, value)
        for make in ONCE.values():
            wrong(name, parameter, make())
        pyplot.close("all")


MADE = {
    "arm": 'pinsing.load("ur5")', "mechanism": "pinsing.load_mechanism(",
    "result": "pinsing.sampling.sweep(arm)", "state": "pinsing.at(arm, q)",
}  # fmt: skip
TAKERS = [(name, p) for name, parameters in OF.items() for p in parameters if p in MADE]


@pytest.mark.parametrize("value", ["ur5", None, 3.0, Unfit()], ids=repr)
def test_what_belongs_there_is_told(value):
    for name, parameter in TAKERS:
        if (name, value) == ("closed_form", "ur5"):  # it takes names
            continue
        error = wrong(name, parameter, value)
        if value is None and PARAMETERS[name][parameter].default is None:
            assert error is None  # what may be left out may be None
            continue
        assert isinstance(error, ArgumentError), (name, parameter)
        assert isinstance(error, TypeError)
        assert error.argument == parameter
        assert MADE[parameter] in str(error)


RETURNED = {
    name: documented().get(str(inspect.signature(function).return_annotation).split(" | ")[0])
    for name, function in PUBLIC.items()
}
RESULTS = [name for name, kind in RETURNED.items() if callable(getattr(kind, "from_json", None))]
RESULTS.remove("ClosedForm.family_of")  # a family has a text, and no other
SCHEMAS = {f"pinsing/{name}" for name in (
    "analysis/1", "aspects/1", "clearance/1", "closed_form/2", "connection/1", "crossings/1",
    "cuspidality/1", "distance/1", "generalization/1", "inverse/1", "inverse_solution/1",
    "inverse_velocity/1", "line_check/1", "map-plan/1", "map/1", "mechanism-analysis/2",
    "mechanism-map/2", "mechanism-modes/1", "path_plan/1", "posture_changes/1",
    "singular-configuration/1", "state/1", "suggestion/1", "sweep-plan/1", "sweep/1",
    "trajectory_check/1", "verdict/1", "zones/2",
)}  # fmt: skip


@pytest.mark.parametrize("name", tiered(RESULTS, {*RESULTS} - SLOW - {"posture_changes"}))
def test_a_result_prints_its_text_and_shows_it_in_a_notebook(name):
    made = call(name, **example(name)[1])
    for result in (made, *(made if isinstance(made, Sequence) else ())):
        said = str(result)
        assert result.text() == said
        assert 10 < len(said) < 6000
        assert not re.search(r"array\(|None|dtype|ROBOT", said)
        assert type(result).from_json(result.to_json()).to_json() == result.to_json()
        assert re.fullmatch(rf"<{type(result).__name__}\b[^\n]{{,140}}>", repr(result))
        shown = result._repr_html_()
        ElementTree.fromstring(f"<div>{shown}</div>")
        assert "$" not in shown  # nothing waits for MathJax
        assert result.schema in SCHEMAS, "what was saved before has to be read too"


JSON_ELSE = {**NEVER, "None": None, "number": 3, "braces": "{}", "list": [], "dict": {}}


@pytest.mark.parametrize("what", JSON_ELSE)
def test_json_of_anything_else(what):
    for read in (pinsing.State.from_json, pinsing.State.from_dict):
        with pytest.raises(PinsingError):
            read(JSON_ELSE[what])


def test_numbers_of_every_kind_count():
    reference = pinsing.at(arm(), [0.0, 1.0, 2.0]).sigma
    typed = (np.arange(3, dtype=kind) for kind in (int, np.float32, np.uint8, object))
    mixed = [np.float64(0), np.int32(1), 2]
    for q in ((0, 1, 2), *typed, np.arange(3.0)[::-1][::-1], mixed):
        assert np.allclose(pinsing.at(arm(), q).sigma, reference)
    assert pinsing.sampling.plan_sweep(arm(), levels=np.int64(1), samples=np.int32(5)).samples == 5
