"""Every public function, given what it cannot use, says which argument is wrong, in one line.

The test finds the functions by itself: those of the reference, and the methods of its classes.
A new one fails until there is a value, below, for each parameter that it must be given.
"""

import datetime
import functools
import inspect
import warnings
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot
from public import documented
from tiers import sampled, tiered

import pinsing
import pinsing.plot
from pinsing.errors import ArgumentError, PinsingError
from pinsing.postures.placement import place_at

FIVE_BAR = Path(__file__).parent.parent / "urdf" / "five_bar.urdf"


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


cached = functools.cache


Q, NEXT = (0.1, 0.5, 0.7), (0.2, -0.5, 0.7)
POSES = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (2, 1, 1))
POSES[:, :3, 3] = [[0.4, -0.1, 0.2], [0.4, 0.1, 0.2]]
LINE = (0.1, 0.7, 0.3, 0.2, 0.6, 0.1)
SHOULDER = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"]
arm = cached(lambda: pinsing.load("planar3r", task="position", joints=["q1", "q2", "q3"]))
regional = cached(lambda: pinsing.load("ur5", task="position", tip="tool0", joints=SHOULDER))
planar = cached(lambda: pinsing.load("planar3r"))
stanford = cached(lambda: pinsing.load("stanford"))
form = cached(lambda: pinsing.closed_form(arm()))
six_joints = cached(lambda: pinsing.closed_form(pinsing.load("ur5"), prove=False))
swept = cached(lambda: pinsing.sampling.sweep(arm(), levels=1, samples=5))
mapped = cached(lambda: pinsing.sampling.sigma_map(arm(), count=8))
mechanism = cached(lambda: pinsing.load_mechanism(FIVE_BAR))
OWNERS = {
    "Arm": arm,
    "Aspects": cached(lambda: pinsing.aspects(form())),
    "ClosedForm": form,
    "Connection": cached(lambda: pinsing.connect(form(), Q, Q)),
    "Cuspidality": cached(lambda: pinsing.cuspidality(planar(), poses=1)),
    "DesignForm": cached(lambda: pinsing.closed_form(arm(), symbols=True)),
    "Family": lambda: form().families[0],
    "InverseSolutions": cached(lambda: pinsing.inverse(planar(), Q)),
    "LineCheck": cached(lambda: pinsing.check_line(stanford(), LINE, [0.1, 0.2, 0.3])),
    "MapPlan": lambda: mapped().plan,
    "MapResult": mapped,
    "Mechanism": mechanism,
    "Monitor": lambda: pinsing.Monitor(form()),
    "Zones": cached(lambda: pinsing.zones(form(), joint_speeds=np.ones(3), boxes=200)),
    "PathPlan": cached(lambda: pinsing.plan_path(six_joints(), np.tile(np.eye(4), (2, 1, 1)))),
    "WorkpiecePlacement": lambda: place_at({"yaw": 0.1}, np.zeros(3)),
    "PostureChanges": cached(lambda: pinsing.posture_changes(planar(), Q)),
    "Suggestion": cached(lambda: pinsing.suggest(arm(), work=0.3)),
    "SweepPlan": lambda: swept().plan,
    "SweepResult": swept,
    "TrajectoryCheck": lambda: pinsing.check_trajectory(arm(), [Q, NEXT]),
    "Viewer": cached(lambda: pinsing.Viewer(arm(), families=form().families, skeleton=True)),
    "Viewer.save_html": cached(lambda: pinsing.Viewer(arm(), families=(), skeleton=True)),
}
"""Whose methods are called, by class, and by method where another one is quicker."""


FITS: dict[str, Any] = {
    "arm": arm, "form": form, "forms": form, "mechanism": mechanism, "result": swept,
    "state": lambda: pinsing.at(arm(), Q), "robot": "planar3r", "family": "F1",
    **dict.fromkeys(("q", "q0", "qa", "qb", "full_q", "pose"), Q), "Q": [Q], "Q0": [Q],
    "configuration": (0.1, 0.0, 0.0), "motion": [Q, NEXT], "trajectory": [Q, (0.2, 0.5, 0.7)],
    "poses": POSES, "J": np.eye(3), "twist": [0.1, 0.2, 0.3], "radius": 0.01,
    "path": "page.html", "within_limits": True, "n": 2, "rng": lambda: np.random.default_rng(0),
    "start": 0, "stop": 2, "inputs": (0, 1), "names": ("q1",), "fixed": (0,), "moving": "q2",
    "joint_a": "q2", "joint_b": "q3",
}  # fmt: skip
"""What fits a parameter of that name; a function makes it."""
MORE: dict[str, dict[str, Any]] = {
    "analyze": {"levels": 1, "samples": 5, "random_starts": 2, "seconds": 2.0},
    "analyze_mechanism": {"seconds": 100.0}, "mechanism_map": {"over": "inputs", "count": 8},
    "check_line": {"arm": stanford, "q0": LINE, "pose": [0.1, 0.2, 0.3]},
    "check_trajectory": {"Q": [Q, NEXT]}, "aspect_changes": {"Q": [Q, Q]},
    "DesignForm.residuals": {"lengths": {"q2_x": 0.5}}, "ClosedForm.latex": {"legend": True},
    "ClosedForm.system": {"language": "maple"}, "ClosedForm.family_of": {"q": np.array(Q)},
    "load_mechanism": {"robot": FIVE_BAR}, "Monitor.update": {"dq": (0.1, 0.2, 0.3)},
    "export_guard": {"language": "python", "prefix": "planar"}, "generalize": {"samples": 8},
    "plan_map": {"count": 8}, "sigma_map": {"count": 8}, "plan_path": {"form": six_joints},
    "plan_sweep": {"levels": 1, "samples": 5}, "sweep": {"levels": 1, "samples": 5},
    "inverse": {"arm": planar}, "line_postures": {"arm": planar, "pose": [0.1, 0.1, 0]},
    "posture_changes": {"arm": planar}, "cuspidality": {"arm": planar, "poses": 1},
    "suggest": {"work": 0.3}, "tip_speeds": {"joint_speeds": np.ones(3)},
    "zones": {"joint_speeds": np.ones(3), "boxes": 200},
    "write_report": {"robot": arm, "path": "report.html", "page": "none"},
    "Viewer": {"families": (), "skeleton": True}, "Viewer.save_png": {"path": "view.png"},
    "Arm.check_many": {"q": [Q]}, "SweepResult.curve": {"fixed": None},
    **{f"Mechanism.{name}": {"q": np.zeros(4)} for name in ("check", "fold", "model_q")},
    "SweepResult.set_text": {"fixed": {"q2": 0.0}},
    "plot.aspect_plane": {"forms": form, "samples": 5}, "plot.sigma_plane": {"samples": 5},
    "plot.inverse_count": {"arm": regional, "samples": 20}, "plot.workspace": {"samples": 500},
    "plot.locus": {
        "family": lambda: form().families[0], "joint_a": "q1", "joint_b": "q2",
        "third": "q3", "values": [0.0, 1.0], "samples": 5,
    },
}  # fmt: skip
"""Arguments of some, in place of those and beside them."""
FREE = {"crossings": {"motion"}, "Viewer": {"visualizer"}, "Arm.check_many": {"name", "own"}}
FREE |= {name: {"name"} for name in ("Arm.check", "Arm.check_one", "Mechanism.check")}
"""Parameters that may be anything."""
SLOW = {
    "analyze_mechanism", "mechanism_map", "check_line", "export_guard", "plan_path", "write_report",
    "Viewer.save_png", "plot.inverse_count",
}  # fmt: skip
"""What is right is tried in other tests."""


def close_again(**given: Any) -> None:
    pinsing.Viewer(**given).close()


def call(name: str, **given: Any) -> Any:
    owner, _, method = name.rpartition(".")
    if name == "Viewer":
        return close_again(**given)
    if owner in ("", "plot"):
        return PUBLIC[name](**given)
    return getattr(OWNERS.get(name, OWNERS.get(owner))(), method)(**given)


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


def needs(name: str) -> list[str]:
    """Those that must be given, and that no other value is given for."""
    own = {"self", *MORE.get(name, ())}
    return [p for p, x in PARAMETERS[name].items() if x.default is x.empty and p not in own]


def works(name: str) -> dict[str, Any]:
    """Arguments with which it works."""
    given = {p: FITS[p] for p in needs(name)} | MORE.get(name, {})
    return {p: value() if callable(value) else value for p, value in given.items()}


def test_every_public_function_has_a_call_that_works():
    assert {name for name in PUBLIC if not {*needs(name)} <= FITS.keys()} == set()
    assert PUBLIC.keys() >= MORE.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in PUBLIC if name not in SLOW])
def test_the_calls_work(name):
    call(name, **works(name))


def wrong(name: str, parameter: str, value: Any) -> PinsingError | None:
    """Call with one argument replaced: the error, None if the call ended well."""
    raised: PinsingError | None = None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            call(name, **{**works(name), parameter: value})
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
    "TrajectoryCheck.text", "Viewer", "analyze", "check_trajectory", "line_postures",
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
        if (name, value) != ("closed_form", "ur5"):  # it takes names
            told_what_belongs(name, parameter, value)


def told_what_belongs(name, parameter, value):
    if value is None and PARAMETERS[name][parameter].default is None:
        assert wrong(name, parameter, value) is None  # what may be left out may be None
        return
    error = wrong(name, parameter, value)
    assert isinstance(error, ArgumentError)
    assert isinstance(error, TypeError)
    assert error.argument == parameter
    assert MADE[parameter] in str(error)


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
