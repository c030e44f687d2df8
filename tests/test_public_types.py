"""Every public function, given what it cannot use, says which argument is wrong, in one line.

The test finds the functions by itself: those of the reference, and the methods of its classes.
A new one fails until it is given a call that works, below.
"""

from __future__ import annotations

import datetime
import functools
import inspect
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from public import documented
from tiers import tiered

import pinsing
import pinsing.plot
from pinsing.errors import ArgumentError, PinsingError

matplotlib.use("agg")
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
    "object": Unfit(),
    "bytes": b"ur5",
    "complex": 1j,
    "complex array": np.full(3, 1j),
    "date": datetime.datetime(2020, 1, 1),
    "dates": np.full(3, np.datetime64("2020-01-01")),
    "objects": np.full(3, Unfit(), dtype=object),
    "masked": np.ma.masked_array(np.zeros(3), [0, 1, 0]),
    "masked in a list": [np.ma.masked, 0.0, 0.0],
    "set": {Unfit()},
    "span of time": np.timedelta64(1, "s"),
    "spans of time": [np.timedelta64(1, "s")] * 3,
    "list of itself": holding_itself(),
    "more than a float": 10**400,
    "more than can be printed": 10**5000,
    "numbers too large": [10**400] * 3,
}
# Right in some places; a call that takes them ends well.
ODD = {
    "None": None,
    "text": "ur5",
    "empty": "",
    "number": 2.5,
    "nan": float("nan"),
    "inf": float("inf"),
    "minus": -1,
    "zero": 0,
    "huge": 10**30,
    "yes": True,
    "fractions": [Decimal(1), Decimal(0), Decimal(0)],
    "nans": np.full(3, np.nan),
    "texts": np.array(["a", "b", "c"]),
    "numbers as text": ["0.1", "0.2", "0.3"],
    "ragged": [[1.0], [1.0, 2.0]],
    "list": [],
    "one": np.zeros(1),
    "cube": np.zeros((2, 2, 2, 3)),
    "mapping": {"q1": "x"},
    "float32": np.zeros(3, dtype=np.float32),
    "ints": [0, 1, 2],
    "largest": [1e308] * 3,
    "half a character": "\ud800",
    "half characters": ["\ud800"],
}
# Used up by one call; those that are never right but empty ones may be.
ONCE: dict[str, Callable[[], Any]] = {
    "generator": lambda: (x for x in ("q1", "q2")),
    "empty generator": lambda: iter(()),
}


@pytest.fixture(autouse=True)
def _somewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@functools.cache
def arm():
    return pinsing.load("planar3r", task="position", joints=["q1", "q2", "q3"])


@functools.cache
def regional():
    joints = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"]
    return pinsing.load("ur5", task="position", tip="tool0", joints=joints)


@functools.cache
def planar():
    return pinsing.load("planar3r")


@functools.cache
def swept():
    return pinsing.sampling.sweep(arm(), levels=1, samples=5)


@functools.cache
def six_joints():
    return pinsing.closed_form(pinsing.load("ur5"), prove=False)


@functools.cache
def form():
    return pinsing.closed_form(arm())


@functools.cache
def design():
    return pinsing.closed_form(arm(), symbols=True)


@functools.cache
def mechanism():
    return pinsing.load_mechanism(FIVE_BAR)


@functools.cache
def mapped():
    return pinsing.sampling.sigma_map(arm(), count=8)


@functools.cache
def viewer():
    return pinsing.Viewer(arm(), families=form().families, skeleton=True)


@functools.cache
def aspects():
    return pinsing.aspects(form())


@functools.cache
def connection():
    return pinsing.connect(form(), Q, Q)


@functools.cache
def solutions():
    return pinsing.inverse(planar(), Q)


@functools.cache
def changes():
    return pinsing.posture_changes(planar(), Q)


@functools.cache
def cuspidality():
    return pinsing.cuspidality(planar(), poses=1)


@functools.cache
def toolpath():
    return pinsing.plan_path(six_joints(), np.tile(np.eye(4), (2, 1, 1)))


@functools.cache
def line():
    return pinsing.check_line(pinsing.load("stanford"), LINE, [0.1, 0.2, 0.3])


@functools.cache
def suggestion():
    return pinsing.suggest(arm(), seconds=0.3)


@functools.cache
def page():
    """A viewer whose page is quickly written."""
    return pinsing.Viewer(arm(), families=(), skeleton=True)


Q = (0.1, 0.5, 0.7)
POSES = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (2, 1, 1))
POSES[:, :3, 3] = [[0.4, -0.1, 0.2], [0.4, 0.1, 0.2]]
LINE = (0.1, 0.7, 0.3, 0.2, 0.6, 0.1)


@dataclass(frozen=True)
class Call:
    """A call that works: who is called, and how."""

    of: Callable[[], Any]
    args: Callable[[], dict[str, Any]] = field(default=dict)
    free: frozenset[str] = frozenset()  # parameters that may be anything
    slow: bool = False  # what is right is tried in other tests


def with_arm(**more: Any) -> Callable[[], dict[str, Any]]:
    return lambda: {"arm": arm(), **more}


CALLS = {
    "analyze": Call(
        lambda: pinsing.analyze, with_arm(levels=1, samples=5, random_starts=2, seconds=2.0)
    ),
    "analyze_mechanism": Call(
        lambda: pinsing.loops.analyze_mechanism,
        lambda: {"mechanism": mechanism(), "seconds": 100.0},
        slow=True,
    ),
    "assembly_modes": Call(
        lambda: pinsing.loops.assembly_modes, lambda: {"mechanism": mechanism()}
    ),
    "mechanism_map": Call(
        lambda: pinsing.loops.mechanism_map,
        lambda: {"mechanism": mechanism(), "over": "inputs", "count": 8},
        slow=True,
    ),
    "working_modes": Call(lambda: pinsing.loops.working_modes, lambda: {"mechanism": mechanism()}),
    "at": Call(lambda: pinsing.at, with_arm(q=Q)),
    "clearance": Call(lambda: pinsing.clearance, lambda: {"forms": form(), "Q": [Q]}),
    "inverse_velocity": Call(
        lambda: pinsing.inverse_velocity, lambda: {"J": np.eye(3), "twist": [0.1, 0.2, 0.3]}
    ),
    "is_clear": Call(lambda: pinsing.is_clear, lambda: {"forms": form(), "q": Q, "radius": 0.01}),
    "check_line": Call(
        lambda: pinsing.check_line,
        lambda: {"arm": pinsing.load("stanford"), "q0": LINE, "pose": [0.1, 0.2, 0.3]},
        slow=True,
    ),
    "check_trajectory": Call(lambda: pinsing.check_trajectory, with_arm(Q=[Q, (0.2, -0.5, 0.7)])),
    "LineCheck.text": Call(lambda: line().text),
    "TrajectoryCheck.text": Call(
        lambda: pinsing.check_trajectory(arm(), [Q, (0.2, -0.5, 0.7)]).text
    ),
    "DesignForm.residuals": Call(
        lambda: design().residuals, lambda: {"family": "F1", "q": Q, "lengths": {"q2_x": 0.5}}
    ),
    "ClosedForm.latex": Call(lambda: form().latex, lambda: {"legend": True}),
    "ClosedForm.system": Call(lambda: form().system, lambda: {"language": "maple"}),
    "crossings": Call(
        lambda: pinsing.crossings,
        lambda: {"forms": form(), "motion": [Q, (0.2, -0.5, 0.7)]},
        frozenset({"motion"}),
    ),
    "closed_form": Call(lambda: pinsing.closed_form, with_arm()),
    "frame_jacobian": Call(lambda: pinsing.frame_jacobian, with_arm(q=Q)),
    "frame_jacobians": Call(lambda: pinsing.kinematics.frame_jacobians, with_arm(Q=[Q])),
    "generalize": Call(
        lambda: pinsing.sampling.generalize, with_arm(configuration=(0.1, 0.0, 0.0), samples=8)
    ),
    "generic_rank": Call(lambda: pinsing.kinematics.generic_rank, with_arm()),
    "load": Call(lambda: pinsing.load, lambda: {"robot": "planar3r"}),
    "load_mechanism": Call(lambda: pinsing.load_mechanism, lambda: {"robot": FIVE_BAR}),
    "nominal": Call(lambda: pinsing.robot.nominal, with_arm()),
    "Monitor.update": Call(
        lambda: pinsing.Monitor(form()).update, lambda: {"q": Q, "dq": (0.1, 0.2, 0.3)}
    ),
    "export_guard": Call(
        lambda: pinsing.export_guard, with_arm(language="python", prefix="planar"), slow=True
    ),
    "plan_map": Call(lambda: pinsing.sampling.plan_map, with_arm(count=8)),
    "plan_path": Call(
        lambda: pinsing.plan_path,
        lambda: {"form": six_joints(), "poses": POSES},
        slow=True,
    ),
    "plan_sweep": Call(lambda: pinsing.sampling.plan_sweep, with_arm(levels=1, samples=5)),
    "refine": Call(lambda: pinsing.configuration.refine, with_arm(q0=Q)),
    "refine_many": Call(lambda: pinsing.configuration.refine_many, with_arm(Q0=[Q])),
    "sigma_map": Call(lambda: pinsing.sampling.sigma_map, with_arm(count=8)),
    "singular_configurations": Call(
        lambda: pinsing.sampling.singular_configurations, lambda: {"arm": arm(), "result": swept()}
    ),
    "singular_values": Call(lambda: pinsing.singular_values, with_arm(Q=[Q])),
    "aspects": Call(lambda: pinsing.aspects, lambda: {"forms": form()}),
    "aspect_changes": Call(
        lambda: pinsing.postures.aspect_changes, lambda: {"forms": form(), "Q": [Q, Q]}
    ),
    "line_postures": Call(
        lambda: pinsing.postures.line_postures,
        lambda: {"arm": planar(), "q0": Q, "pose": [0.1, 0.1, 0]},
    ),
    "Aspects.of": Call(lambda: aspects().of, lambda: {"q": Q}),
    "Aspects.text": Call(lambda: aspects().text),
    "connect": Call(lambda: pinsing.connect, lambda: {"forms": form(), "qa": Q, "qb": Q}),
    "Connection.text": Call(lambda: connection().text),
    "inverse": Call(lambda: pinsing.inverse, lambda: {"arm": planar(), "pose": Q}),
    "InverseSolutions.text": Call(lambda: solutions().text),
    "posture_changes": Call(lambda: pinsing.posture_changes, lambda: {"arm": planar(), "q": Q}),
    "PostureChanges.text": Call(lambda: changes().text),
    "cuspidality": Call(lambda: pinsing.cuspidality, lambda: {"arm": planar(), "poses": 1}),
    "Cuspidality.text": Call(lambda: cuspidality().text),
    "suggest": Call(lambda: pinsing.suggest, with_arm(seconds=0.3)),
    "Suggestion.text": Call(lambda: suggestion().text),
    "sweep": Call(lambda: pinsing.sampling.sweep, with_arm(levels=1, samples=5)),
    "task_jacobian": Call(lambda: pinsing.kinematics.task_jacobian, with_arm(q=Q)),
    "task_jacobians": Call(lambda: pinsing.kinematics.task_jacobians, with_arm(Q=[Q])),
    "write_report": Call(
        lambda: pinsing.write_report,
        lambda: {"robot": arm(), "path": "report.html", "page": "none"},
        slow=True,
    ),
    "Viewer": Call(
        lambda: closing(pinsing.Viewer),
        lambda: {"arm": arm(), "families": (), "skeleton": True},
        frozenset({"visualizer"}),
    ),
    "Viewer.jupyter_cell": Call(lambda: viewer().jupyter_cell),
    "Viewer.play": Call(lambda: viewer().play, lambda: {"family": "F1"}),
    "Viewer.save_html": Call(lambda: page().save_html, lambda: {"path": "page.html"}),
    "Viewer.save_png": Call(lambda: page().save_png, lambda: {"path": "view.png"}, slow=True),
    "Viewer.show": Call(lambda: viewer().show, lambda: {"q": Q}),
    "Viewer.show_family": Call(lambda: viewer().show_family, lambda: {"family": "F1"}),
    "Arm.check": Call(lambda: arm().check, lambda: {"q": Q}, frozenset({"name"})),
    "Arm.check_one": Call(lambda: arm().check_one, lambda: {"q": Q}, frozenset({"name"})),
    "Arm.check_many": Call(
        lambda: arm().check_many, lambda: {"q": [Q]}, frozenset({"name", "own"})
    ),
    "Arm.fold": Call(lambda: arm().fold, lambda: {"q": Q}),
    "Arm.full_q": Call(lambda: arm().full_q, lambda: {"q": Q}),
    "Arm.model_q": Call(lambda: arm().model_q, lambda: {"q": Q}),
    "Arm.q_of": Call(lambda: arm().q_of, lambda: {"full_q": Q}),
    "Arm.with_task": Call(lambda: arm().with_task),
    "Arm.within_limits": Call(lambda: arm().within_limits, lambda: {"q": Q}),
    "ClosedForm.family_of": Call(lambda: form().family_of, lambda: {"q": np.array(Q)}),
    "Family.box": Call(lambda: form().families[0].box, lambda: {"within_limits": True}),
    "Family.conditions": Call(lambda: form().families[0].conditions),
    "Family.contains": Call(lambda: form().families[0].contains, lambda: {"q": Q}),
    "Family.distance": Call(lambda: form().families[0].distance, lambda: {"q": Q}),
    "Family.gradient": Call(lambda: form().families[0].gradient, lambda: {"q": Q}),
    "Family.points": Call(
        lambda: form().families[0].points, lambda: {"n": 2, "rng": np.random.default_rng(0)}
    ),
    "Family.where": Call(lambda: form().families[0].where, lambda: {}),
    "Family.sample": Call(
        lambda: form().families[0].sample, lambda: {"n": 2, "rng": np.random.default_rng(0)}
    ),
    "MapPlan.configurations": Call(
        lambda: mapped().plan.configurations, lambda: {"start": 0, "stop": 2}
    ),
    "PathPlan.text": Call(lambda: toolpath().text),
    "MapResult.head": Call(lambda: mapped().head),
    "MapResult.tail": Call(lambda: mapped().tail),
    "MapResult.text": Call(lambda: mapped().text),
    "Mechanism.check": Call(
        lambda: mechanism().check, lambda: {"q": np.zeros(4)}, frozenset({"name"})
    ),
    "Mechanism.check_inputs": Call(lambda: mechanism().check_inputs, lambda: {"inputs": (0, 1)}),
    "Mechanism.fold": Call(lambda: mechanism().fold, lambda: {"q": np.zeros(4)}),
    "Mechanism.model_q": Call(lambda: mechanism().model_q, lambda: {"q": np.zeros(4)}),
    "Mechanism.with_actuated": Call(lambda: mechanism().with_actuated, lambda: {"names": ("q1",)}),
    "SweepPlan.moving": Call(lambda: swept().plan.moving, lambda: {"fixed": (0,)}),
    "SweepResult.curve": Call(lambda: swept().curve, lambda: {"fixed": None, "moving": "q2"}),
    "SweepResult.set_text": Call(lambda: swept().set_text, lambda: {"fixed": {"q2": 0.0}}),
    "plot.aspect_plane": Call(
        lambda: pinsing.plot.aspect_plane,
        lambda: {"arm": arm(), "joint_a": "q2", "joint_b": "q3", "forms": form(), "samples": 5},
    ),
    "plot.ellipsoids": Call(
        lambda: pinsing.plot.ellipsoids, lambda: {"state": pinsing.at(arm(), Q)}
    ),
    "plot.inverse_count": Call(
        lambda: pinsing.plot.inverse_count,
        lambda: {"arm": regional(), "samples": 20},
        slow=True,
    ),
    "plot.locus": Call(
        lambda: pinsing.plot.locus,
        lambda: {
            "arm": arm(),
            "family": form().families[0],
            "joint_a": "q1",
            "joint_b": "q2",
            "third": "q3",
            "values": [0.0, 1.0],
            "samples": 5,
        },
    ),
    "plot.sigma_along": Call(
        lambda: pinsing.plot.sigma_along, with_arm(trajectory=[Q, (0.2, 0.5, 0.7)])
    ),
    "plot.sigma_curves": Call(lambda: pinsing.plot.sigma_curves, lambda: {"result": swept()}),
    "plot.workspace": Call(lambda: pinsing.plot.workspace, with_arm(samples=500)),
    "plot.sigma_plane": Call(
        lambda: pinsing.plot.sigma_plane, with_arm(joint_a="q2", joint_b="q3", samples=5)
    ),
}


def closing(make: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(make)
    def made(**kwargs: Any) -> None:
        make(**kwargs).close()

    return made


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
            if (
                method.startswith("_")
                or method in INTERNAL
                or not set(inspect.signature(function).parameters) - {"self"}
            ):
                continue
            if function.__module__ == "pinsing.serialization":
                continue  # one for all: tested below
            found[f"{name}.{method}"] = function
    return found


PUBLIC = public()
CASES = [
    (name, parameter)
    for name, call in CALLS.items()
    for parameter in inspect.signature(PUBLIC[name]).parameters
    if parameter not in ("self", *call.free)
    if name in PUBLIC
]
# Parameters of each function.
OF: dict[str, list[str]] = {}
for _name, _parameter in CASES:
    OF.setdefault(_name, []).append(_parameter)


def test_every_public_function_is_here():
    assert sorted(PUBLIC) == sorted(CALLS)


@pytest.mark.parametrize("name", [name for name, call in CALLS.items() if not call.slow])
def test_the_calls_work(name):
    call = CALLS[name]
    call.of()(**call.args())
    import matplotlib.pyplot as plt

    plt.close("all")


def wrong(name: str, parameter: str, value: Any) -> PinsingError | None:
    """Call with one argument replaced: the error, None if the call ended well."""
    call = CALLS[name]
    raised: PinsingError | None = None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            call.of()(**{**call.args(), parameter: value})
        except PinsingError as error:
            raised = error
    if raised is not None:
        assert "\n" not in str(raised)
        assert len(str(raised)) < 500
        str(raised).encode()
    return raised


@pytest.mark.parametrize("name", OF)
def test_what_never_fits_is_refused_by_name(name):
    for parameter in OF[name]:
        for what, value in NEVER.items():
            error = wrong(name, parameter, value)
            assert error is not None, (parameter, what)
            assert parameter in str(error), (parameter, what, str(error))


FITTED = [name for name in OF if not CALLS[name].slow]
LONG = {"analyze", "line_postures", "check_trajectory", "plot.sigma_plane"}


@pytest.mark.parametrize("name", tiered(FITTED, set(FITTED) - LONG))
def test_what_may_fit_is_taken_or_refused(name):
    import matplotlib.pyplot as plt

    for parameter in OF[name]:
        default = inspect.signature(PUBLIC[name]).parameters[parameter].default
        for value in ODD.values():
            if value is not default:
                wrong(name, parameter, value)
        for make in ONCE.values():
            wrong(name, parameter, make())
        plt.close("all")


MADE = {
    "arm": 'pinsing.load("ur5")',
    "mechanism": "pinsing.load_mechanism(",
    "result": "pinsing.sampling.sweep(arm)",
    "state": "pinsing.at(arm, q)",
}
TAKERS = [case for case in CASES if case[1] in MADE]


@pytest.mark.parametrize("value", ["ur5", None, 3.0, Unfit()], ids=repr)
def test_what_belongs_there_is_told(value):
    """A name, None or a number where an arm belongs: how to get one, and a TypeError too."""
    for name, parameter in TAKERS:
        told_what_belongs(name, parameter, value)


def told_what_belongs(name, parameter, value):
    if value is None and inspect.signature(PUBLIC[name]).parameters[parameter].default is None:
        assert wrong(name, parameter, value) is None  # what may be left out may be None
        return
    error = wrong(name, parameter, value)
    assert isinstance(error, ArgumentError)
    assert isinstance(error, TypeError)
    assert error.argument == parameter
    assert MADE[parameter] in str(error)


def test_the_name_given_is_the_name_to_load():
    for given, said in [("panda", "panda"), (Path("a/b.urdf"), "a/b.urdf"), ("x" * 99, "ur5")]:
        with pytest.raises(ArgumentError, match=rf'pinsing\.load\("{said}"\)'):
            pinsing.at(given, [0])
    with pytest.raises(ArgumentError, match=r'pinsing\.load\("ur5"\)'):
        pinsing.at("<robot>\n</robot>", [0])


JSON_ELSE = {**NEVER, "None": None, "number": 3, "braces": "{}", "list": [], "dict": {}}


@pytest.mark.parametrize("what", JSON_ELSE)
def test_json_of_anything_else(what):
    value = JSON_ELSE[what]
    with pytest.raises(PinsingError):
        pinsing.State.from_json(value)
    with pytest.raises(PinsingError):
        pinsing.State.from_dict(value)


def test_numbers_of_every_kind_count():
    reference = pinsing.at(arm(), [0.0, 1.0, 2.0]).sigma
    for q in (
        (0, 1, 2),
        np.arange(3),
        np.arange(3, dtype=np.float32),
        np.arange(3, dtype=np.uint8),
        np.arange(3, dtype=object),
        np.arange(3.0)[::-1][::-1],
        [np.float64(0), np.int32(1), 2],
    ):
        assert np.allclose(pinsing.at(arm(), q).sigma, reference)
    assert pinsing.sampling.plan_sweep(arm(), levels=np.int64(1), samples=np.int32(5)).samples == 5


def test_another_thread_may_be_importing_masked_arrays(monkeypatch):
    """The module is known before its classes are: seen in a worker of Dask with two threads."""
    import sys
    import types

    monkeypatch.setitem(sys.modules, "numpy.ma", types.ModuleType("numpy.ma"))
    assert pinsing.at(arm(), list(Q)).sigma.size > 0
