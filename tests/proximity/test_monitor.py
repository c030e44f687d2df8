"""The monitor of a control loop: bounds, time to contact, hysteresis, speed, bad input."""

import copy
import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest
from kernel import needs_kernel
from singular_sets import Joint, arm_of, build, closed, sliding_equation
from tiers import tiered

import pinsing
from pinsing._batch import engine
from pinsing.algebra.conditions import contact_along
from pinsing.errors import ConfigurationError, OptionError, PinsingError, UnknownNameError
from pinsing.families import Branch
from pinsing.measures import Array

QUICK = ["ur5", "panda", "stanford", "scara"]  # six and seven joints, a prismatic one, four
LONG = ["puma560", "surgical7", "z1", "baxter"]
ARMS = [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in LONG)]


def states(name: str, count: int, seed: int = 0) -> tuple[Array, Array]:
    """Configurations and joint speeds; a third of them near a family, some on one."""
    form = closed(name)
    rng = np.random.default_rng(seed)
    Q = rng.uniform(-3, 3, (count, form.arm.n))
    near = [f.points(max(1, count // (3 * len(form.families))), rng) for f in form.families]
    near_by = np.concatenate(near)
    near_by[::2] += rng.normal(size=near_by[::2].shape) * 1e-3
    Q = np.concatenate([Q, near_by])
    V = rng.normal(size=Q.shape)
    V[::5] *= rng.random(V[::5].shape) < 0.4  # joints that rest
    return Q, V


def monitor_of(form: pinsing.ClosedForm, compiled: bool, **options: float) -> pinsing.Monitor:
    """A monitor that judges in the kernel, or in NumPy."""
    monitor = pinsing.Monitor(form, **options)
    if not compiled:
        monitor._handle = None
    return monitor


@pytest.mark.parametrize("name", ARMS)
def test_lower_is_never_above_the_distance(name: str) -> None:
    form = closed(name)
    monitor = pinsing.Monitor(form)
    Q, _ = states(name, 40)
    quick = pinsing.clearance(form, Q)
    true = pinsing.clearance(form, Q[::5], certify=True, gap=1e-3)
    for i, q in enumerate(Q):
        verdict = monitor.update(q)
        # NumPy sums rows of a batch in another order than one alone; the kernel does not.
        slack = 0.0 if engine.available() else 1e-12
        assert verdict.lower == pytest.approx(quick.lower[i], rel=slack, abs=0.0)
        assert verdict.upper <= quick.upper[i] * (1 + slack)
        assert (verdict.family, verdict.rate) == (quick.nearest[i], None)
        if i % 5 == 0:
            assert verdict.lower <= true.upper[i // 5]
            far = pinsing.clearance(form, q, families=[verdict.family], certify=True)
            assert far.lower <= true.upper[i // 5] + 1e-4  # no other family is nearer


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    tiered(["ur5", "stanford", "surgical7", "puma560", "z1", "irb1400"], {"ur5", "stanford"}),
)
def test_time_to_contact_is_that_of_the_first_crossing(name: str) -> None:
    form = pinsing.closed_form(pinsing.load(name, units="rad"))  # some states are far out
    single = [
        f.name for f in form.families if f.codimension == 1 and len(f.branches[0].equations) <= 1
    ]
    monitor = pinsing.Monitor(form, families=single, horizon=2.0)
    Q, V = states(name, 60, 1)
    met = 0
    for q, v in zip(Q, V, strict=True):
        verdict = monitor.update(q, v)
        said = verdict.time_to_contact
        assert said is not None
        if verdict.lower < 1e-7:
            continue  # met already, to rounding
        found = pinsing.crossings(form, np.stack([q, q + 2.0 * v]), families=single)
        times = [2.0 * c.t for c in found.events]
        first = min(times, default=np.inf)
        assert said <= first + 1e-9  # never later
        if np.isfinite(said):
            close = pinsing.clearance(form, q + said * v, families=single)
            assert close.lower < 1e-4 * max(1.0, np.abs(v).max())
            met += 1
        else:
            assert not times
    assert met > 10


@pytest.mark.parametrize("name", ARMS)
def test_no_contact_before_it_is_said(name: str) -> None:
    form = closed(name)
    monitor = pinsing.Monitor(form, horizon=1.0)
    Q, V = states(name, 12, 2)
    for q, v in zip(Q, V, strict=True):
        time = monitor.update(q, v).time_to_contact
        assert time is not None
        until = min(time, 1.0)
        if until < 1e-6:
            continue
        t = np.linspace(0, until * (1 - 1e-6), 200)[:, None]
        upper = pinsing.clearance(form, q + t * v).upper
        assert upper.min() > 0  # an upper bound of zero is a contact


@needs_kernel
@pytest.mark.parametrize("name", ARMS)
def test_the_same_without_the_compiled_engine(name: str) -> None:
    form = closed(name)
    fast, slow = (monitor_of(form, compiled) for compiled in (True, False))
    Q, V = states(name, 25, 4)
    for q, v in zip(Q, V, strict=True):
        a, b = fast.update(q, v), slow.update(q, v)
        assert (a.level, a.family) == (b.level, b.family)
        assert a.lower == pytest.approx(b.lower, rel=1e-9, abs=1e-12)
        assert a.time_to_contact is not None
        if a.time_to_contact != b.time_to_contact:
            assert a.time_to_contact == pytest.approx(b.time_to_contact, rel=1e-4, abs=1e-7)
        if a.lower > 1e-9:
            # Many equations for few directions: what solves them is known to less digits.
            assert a.rate == pytest.approx(b.rate, rel=1e-2 if name == "baxter" else 1e-5, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [True, False])
def test_prismatic_joints_in_equations(compiled: bool) -> None:
    """d3^2 + 0.5 d3 cos q2 - 0.3 = 0, made up, in place of the families of the Stanford arm."""
    form = closed("stanford")
    equation = sliding_equation(form)
    family = dataclasses.replace(
        form.families[0], branches=(Branch((), (equation,)),), length_scale=0.5
    )
    summary = dataclasses.replace(form.arm, length_scale=0.5)
    form = dataclasses.replace(form, families=(family,), arm=summary)
    monitor = monitor_of(form, compiled, horizon=3.0)
    rng = np.random.default_rng(5)
    met = 0
    for _ in range(60):
        q, v = rng.uniform(-1, 1, (2, 6))
        said = monitor.update(q, v).time_to_contact
        assert said is not None
        found = pinsing.crossings(form, np.stack([q, q + 3.0 * v]))
        first = min((3.0 * c.t for c in found.events), default=np.inf)
        assert said <= first + 1e-9
        met += np.isfinite(said)
        if np.isfinite(first) and np.isfinite(said):
            assert said == pytest.approx(first, rel=1e-4, abs=1e-6)
    assert met > 5


def test_hysteresis() -> None:
    monitor = pinsing.Monitor(closed("stanford"), warn=0.2, stop=0.1, hysteresis=0.2)

    def level(wrist: float) -> str:
        return monitor.update([0, 1.4, 0.5, 1, wrist, 0]).level

    heard = [level(x) for x in (0.3, 0.21, 0.199, 0.21, 0.239, 0.241, 0.21)]
    assert heard == ["clear", "clear", "warn", "warn", "warn", "clear", "clear"]
    heard = [level(x) for x in (0.05, 0.11, 0.119, 0.121, 0.23, 0.3, 0.05, 0.3)]
    assert heard == ["stop", "stop", "stop", "warn", "warn", "clear", "stop", "clear"]
    monitor.reset()
    assert monitor.level == "clear"


@pytest.mark.parametrize("more", [{}, {"tip_speed": 0.25, "joint_speeds": [1] * 6}])
def test_a_monitor_goes_into_other_processes_with_its_level(more: dict[str, Any]) -> None:
    monitor = pinsing.Monitor(closed("ur5"), **more)
    said = monitor.update([0, -1.2, 1.3, -1, 0.15, 0], [0, 0, 0, 0, -0.3, 0])
    for other in (pickle.loads(pickle.dumps(monitor)), copy.deepcopy(monitor)):
        assert other.level == said.level == "warn"
        again = other.update([0, -1.2, 1.3, -1, 0.15, 0], [0, 0, 0, 0, -0.3, 0])
        assert again.to_json() == said.to_json()


def test_at_a_singular_configuration():
    monitor = pinsing.Monitor(closed("ur5"))
    q = np.array([0, -1.2, 1.3, -1, 0.0, 0])
    resting = monitor.update(q, np.zeros(6))
    assert (resting.level, resting.family, resting.lower) == ("stop", "F2", 0.0)
    assert resting.upper < 1e-14
    assert (resting.time_to_contact, resting.trend, resting.rate) == (np.inf, "steady", 0.0)
    leaving = monitor.update(q, [0, 0, 0, 0, 1, 0])
    assert (leaving.time_to_contact, leaving.trend) == (0.0, "away")
    within = monitor.update(q, [1, 0, 0, 0, 0, 0])
    assert (within.time_to_contact, within.trend) == (0.0, "steady")
    conditions = closed("ur5").families[0].conditions()
    x = np.zeros(6)
    assert contact_along(conditions, 0, x, np.zeros(6), 1.0) == (np.inf, 0.0)


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("size", [1e-320, 1e-300, 1e-9, 1e9, 1e300])
def test_speeds_of_any_size(size: float, compiled: bool) -> None:
    monitor = monitor_of(closed("ur5"), compiled, horizon=np.inf)
    verdict = monitor.update([0, -1.2, 1.3, -1, 0.5, 0], np.array([0, 0, 0, 0, -1.0, 0]) * size)
    assert verdict.trend == "toward"
    assert verdict.time_to_contact is not None
    assert not np.isnan(verdict.time_to_contact)
    if size > 1e-300:
        assert verdict.time_to_contact == pytest.approx(0.5 / size, rel=1e-6)


@pytest.mark.parametrize("compiled", [True, False])
def test_huge_joint_values_are_never_said_to_be_clear_wrongly(compiled: bool) -> None:
    monitor = monitor_of(closed("ur5"), compiled)
    for size in (1e6, 1e12, 1e17, 1e300):
        verdict = monitor.update(np.full(6, size), np.ones(6))
        assert not np.isnan(verdict.lower)
        if size > 1e16:
            assert verdict.level == "stop"


def test_what_is_missing_is_said():
    poor = pinsing.closed_form(arm_of("panda"), seconds=0.02)
    monitor = pinsing.Monitor(poor)
    assert monitor.complete is poor.complete is False
    for q in np.random.default_rng(0).uniform(-2, 2, (50, 7)):
        assert monitor.update(q).level != "clear"
    nothing = pinsing.Monitor(dataclasses.replace(poor, families=()))
    verdict = nothing.update(np.ones(7))
    radius = pinsing.kinematics.regular_radius(arm_of("panda"), np.ones(7))
    assert (verdict.level, verdict.lower) == ("warn", pytest.approx(float(radius)))
    assert str(verdict) == f"warn: at least {verdict.lower:.4g} from a singularity"
    monitor = pinsing.Monitor(pinsing.closed_form(build([Joint(d=0.2)])))
    assert monitor.complete
    verdict = monitor.update([0.3], [1.0])
    assert (verdict.level, verdict.lower, verdict.time_to_contact) == ("clear", np.inf, np.inf)
    form = closed("stanford")
    unsure = dataclasses.replace(form.families[2], real=False)
    form = dataclasses.replace(form, families=(*form.families[:2], unsure))
    assert pinsing.Monitor(form).names == ("F1", "F2", "F3")
    assert pinsing.Monitor(form).update([0, 1, 0.5, 1, 0, 0]).level == "stop"


@pytest.mark.parametrize(
    ("q", "dq", "said"),
    [
        ([0, 0, np.nan, 0, 0, 0], None, "q of joint 'elbow_joint' is nan"),
        ([0, 0, 0, 0, 0, np.inf], None, "q of joint 'wrist_3_joint' is inf"),
        (np.zeros(6), [0, -np.inf, 0, 0, 0, 0], "dq of joint 'shoulder_lift_joint' is -inf"),
        ([0, 0, 0], None, "q needs 6 values for shoulder_pan_joint, .*got 3"),
        (np.zeros((1, 6)), None, r"got shape \(1, 6\)"), (0.0, None, "q needs 6 values"),
        (np.zeros(6), np.zeros(7), "dq needs 6 values"), (["a"] * 6, None, "q must be numbers"),
        (None, None, "q must be numbers"), ([0, 0, 0, 0, 0, 10**400], None, "q"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("compiled", [True, False])
def test_bad_configurations(q: object, dq: object, said: str, compiled: bool) -> None:
    monitor = monitor_of(closed("ur5"), compiled)
    monitor.update([0, -1.2, 1.3, -1, 0.0, 0])
    with pytest.raises(ConfigurationError, match=said) as raised:
        monitor.update(q, dq)
    assert "\n" not in str(raised.value)
    assert monitor.level == "stop"


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"warn": 0.1, "stop": 0.2}, OptionError), ({"warn": -1.0, "stop": -2.0}, OptionError),
        ({"warn": np.inf}, OptionError), ({"hysteresis": -0.1}, OptionError),
        ({"horizon": 0.0}, OptionError), ({"weights": [1, 2]}, OptionError),
        ({"weights": [1, 1, 1, 1, 0, 1]}, OptionError), ({"families": ["F8"]}, UnknownNameError),
        ({"warn": np.nan}, PinsingError),
    ],
)  # fmt: skip
def test_bad_options(options: dict[str, object], error: type[Exception]) -> None:
    with pytest.raises(error):
        pinsing.Monitor(closed("ur5"), **options)
    with pytest.raises(PinsingError):
        pinsing.Monitor([])


def test_degrees_are_refused():
    with pytest.raises(OptionError, match=r"warn is 20 rad.*math\.radians\(20\)"):
        pinsing.Monitor(closed("ur5"), warn=20, stop=5)
    with pytest.raises(OptionError, match="near is 5 rad"):
        pinsing.check_trajectory(arm_of("ur5"), [[0.1] * 6], forms=closed("ur5"), near=5)
    pinsing.Monitor(closed("ur5"), warn=20, stop=5, weights=[100] * 6)  # other units
    monitor = pinsing.Monitor(closed("ur5"))
    assert monitor.update(np.zeros(6)).level == "stop"
    path = np.outer(np.arange(50), [0, -2.0, 1.5, -2.0, -1.7, 0])
    with pytest.raises(ConfigurationError, match="add --deg"):
        [monitor.update(q) for q in path]
    monitor, q, slow = pinsing.Monitor(closed("ur5")), [0, -1.2, 1.3, -1, 0.5, 0], np.zeros(6)
    for _ in range(2):  # the next is judged again
        with pytest.raises(
            ConfigurationError, match=r"dq: wrist_2_joint at 30 rad/s is 9\.\d times"
        ):
            monitor.update(q, [0, 0, 0, 0, -30, 0])
    assert monitor.update(q, slow + 3.5).level == "clear"  # too fast, but no degrees
    radians = pinsing.Monitor(pinsing.closed_form(pinsing.load("ur5", units="rad")))
    assert radians.update(q, [0, 0, 0, 0, -30, 0]).trend == "toward"


def test_endless_joints_may_turn_on():
    """A controller counts turns; that stops no loop."""
    form = pinsing.closed_form(pinsing.load("kinova"))
    endless = ~np.isfinite(form.arm.upper)
    monitor, levels = pinsing.Monitor(form), set()
    low, high = np.where(endless, -1, form.arm.lower), np.where(endless, 1, form.arm.upper)
    for s in np.linspace(0.05, 0.95, 400):
        q = low + s * (high - low)
        levels.add(monitor.update(np.where(endless, 100 * s, q)).level)
    assert len(levels) > 1
    monitor = pinsing.Monitor(pinsing.closed_form(pinsing.load("ur5", units="rad")))
    q = np.array([0, -1.2, 1.3, -1, 0.3, 0])
    for turns in (-3, 1, 100):
        verdict = monitor.update(q + 2 * np.pi * turns, [0, 0, 0, 0, -1, 0])
        assert verdict.lower == pytest.approx(0.3, abs=1e-12)
        assert verdict.time_to_contact == pytest.approx(0.3, abs=1e-9)


def test_speeds_of_the_whole_model_do_as_well():
    arm = pinsing.load("ur5", base="upper_arm_link")
    whole = pinsing.load("ur5")
    form = pinsing.closed_form(arm)
    rng = np.random.default_rng(5)
    for _ in range(5):
        q, dq = rng.uniform(-1, 1, (2, 6))
        own = [whole.joints.index(name) for name in arm.joints]
        monitor = pinsing.Monitor(form)
        one, other = monitor.update(q, dq), monitor.update(q[own], dq[own])
        assert (one.rate, one.time_to_contact) == (other.rate, other.time_to_contact)
    with pytest.raises(ConfigurationError, match="or the whole model's 6; got shape"):
        monitor.update(q[own], np.zeros(8))
    whole = pinsing.load("ur5").joints
    arm = pinsing.load("ur5", joints=[*whole[:2], *whole[3:]])
    monitor = pinsing.Monitor(pinsing.closed_form(arm))
    q, dq = np.array([0.1, 0.2, 0.0, 0.4, 0.5, 0.6]), np.zeros(6)
    monitor.update(q, dq)
    dq[2] = 0.1
    with pytest.raises(ConfigurationError, match="is locked in this arm, but the whole model's dq"):
        monitor.update(q, dq)
