"""The monitor of a control loop: bounds, time to contact, hysteresis, speed, bad input.

And a running robot that is followed: a verdict for each line, drops and silences said.
"""

import copy
import json
import os
import pickle
import re
import signal
import subprocess
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import python, run, started
from golden import Golden
from singular_sets import Joint, arm_of, build, closed, sliding_equation
from urdf_text import ZERO, Z, chain_text, follows

import pinsing
from pinsing._batch import engine
from pinsing.algebra.conditions import contact_along
from pinsing.cli import show
from pinsing.errors import ConfigurationError, OptionError, PinsingError, UnknownNameError
from pinsing.families import Branch
from pinsing.kinematics import tip_speeds
from pinsing.measures import Array
from pinsing.proximity.monitor import BACKLOG, Follower, HeadError, Reader, follow, latest, lines_of

QUICK = ["ur5", "panda", "stanford", "scara"]  # six and seven joints, a prismatic one, four
LONG = ["puma560", "surgical7", "z1", "baxter"]
ARMS = [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in LONG)]


Q = np.array([0.0, -1.2, 1.3, -1.0, 0.15, 0.0])
SPEED = np.array([0.0, 0.0, 0.0, 0.0, -0.3, 0.0])


def states(form: pinsing.ClosedForm, count: int, seed: int = 0) -> tuple[Array, Array]:
    """Configurations and joint speeds; a third of them near a family, some on one."""
    rng = np.random.default_rng(seed)
    Q = rng.uniform(-3, 3, (count, form.arm.n))
    each = max(1, count // (3 * len(form.families)))
    near_by = np.concatenate([f.points(each, rng) for f in form.families])
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
    Q, _ = states(form, 40)
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


def slides() -> pinsing.ClosedForm:
    """d3^2 + 0.5 d3 cos q2 - 0.3 = 0, made up, in place of the families of the Stanford arm."""
    form = closed("stanford")
    family = replace(
        form.families[0], branches=(Branch((), (sliding_equation(form),)),), length_scale=0.5
    )
    return replace(form, families=(family,), arm=replace(form.arm, length_scale=0.5))


@pytest.mark.parametrize("name", [*ARMS, "slides", pytest.param("irb1400", marks=pytest.mark.slow)])
def test_contact_is_when_it_is_said_with_the_kernel_or_without(name: str) -> None:
    form, met = slides() if name == "slides" else closed(name), 0
    slow, fast = (monitor_of(form, compiled, horizon=1.0) for compiled in (False, True))
    for q, v in zip(*states(form, 25, 4), strict=True):
        a, b = fast.update(q, v), slow.update(q, v)
        assert (a.level, a.family) == (b.level, b.family)
        assert a.lower == pytest.approx(b.lower, rel=1e-9, abs=1e-12)
        assert a.time_to_contact == pytest.approx(b.time_to_contact, rel=1e-4, abs=1e-7)
        if a.lower > 1e-9:
            # Many equations for few directions: what solves them is known to less digits.
            assert a.rate == pytest.approx(b.rate, rel=1e-2 if name == "baxter" else 1e-5, abs=1e-6)
        if (until := min(a.time_to_contact, 1.0)) > 1e-6:
            t = np.linspace(0, until * (1 - 1e-6), 200)[:, None]
            upper = pinsing.clearance(form, q + t * v).upper
            assert upper.min() > 0  # an upper bound of zero is a contact
        if a.lower > 1e-7 and np.isfinite(a.time_to_contact) and name != "baxter":
            there = pinsing.clearance(form, q + a.time_to_contact * v).lower
            assert there < 1e-4 * max(1.0, np.abs(v).max())
            met += 1
    assert met > 3 or name in ("panda", "baxter")  # families of several conditions
    if name == "slides":  # joints that are not in it
        still = [m.update(np.full(6, 0.4), [99, 0, 0, 99, 99, 99]) for m in (slow, fast)]
        assert [v.time_to_contact for v in still] == [np.inf] * 2


def test_hysteresis() -> None:
    monitor = pinsing.Monitor(closed("stanford"), warn=0.2, stop=0.1, hysteresis=0.2)
    for level, wrists in (
        ("clear", [0.3, 0.21]), ("warn", [0.199, 0.21, 0.239]), ("clear", [0.241, 0.21]),
        ("stop", [0.05, 0.11, 0.119]), ("warn", [0.121, 0.23]), ("clear", [0.3]),
        ("stop", [0.05]), ("clear", [0.3]), ("stop", [0.05]),
    ):  # fmt: skip
        for wrist in wrists:
            assert monitor.update([0, 1.4, 0.5, 1, wrist, 0]).level == level
    monitor.reset()
    assert monitor.level == "clear"


@pytest.mark.parametrize("more", [{}, {"tip_speed": 0.25, "joint_speeds": [1] * 6}])
def test_a_monitor_goes_into_other_processes_with_its_level(more: dict[str, Any]) -> None:
    monitor = pinsing.Monitor(closed("ur5"), **more)
    said = monitor.update(Q, SPEED)
    for other in (pickle.loads(pickle.dumps(monitor)), copy.deepcopy(monitor)):
        assert other.level == said.level == "warn"
        assert other.update(Q, SPEED).to_json() == said.to_json()


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(
    ("wrist", "joint", "speed", "trend", "time"),
    [
        (0.0, 4, 0.0, "steady", np.inf), (0.0, 4, 1.0, "away", 0.0), (0.0, 0, 1.0, "steady", 0.0),
        (0.5, 4, -1e-320, "toward", np.inf),
        *((0.5, 4, -size, "toward", 0.5 / size) for size in (1e-300, 1e-9, 1e9, 1e300)),
    ],
)  # fmt: skip
def test_trend_and_time_at_a_singular_configuration_and_at_speeds_of_any_size(
    wrist: float, joint: int, speed: float, trend: str, time: float, compiled: bool
) -> None:
    monitor = monitor_of(closed("ur5"), compiled, horizon=np.inf)
    verdict = monitor.update([0, -1.2, 1.3, -1, wrist, 0], speed * np.eye(6)[joint])
    assert (verdict.trend, verdict.time_to_contact) == (trend, pytest.approx(time, rel=1e-6))
    assert (verdict.family, verdict.lower) == ("F2", pytest.approx(wrist, rel=1e-9))
    assert verdict.level == ("clear" if wrist else "stop")
    assert verdict.upper < wrist + 1e-14
    if speed == 0:
        assert verdict.rate == 0.0
        conditions, x = closed("ur5").families[0].conditions(), np.zeros(6)
        assert contact_along(conditions, 0, x, x, 1.0) == (np.inf, 0.0)


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
    nothing = pinsing.Monitor(replace(poor, families=()))
    verdict = nothing.update(np.ones(7))
    radius = pinsing.kinematics.regular_radius(arm_of("panda"), np.ones(7))
    assert (verdict.level, verdict.lower) == ("warn", pytest.approx(float(radius)))
    assert str(verdict) == f"warn: at least {verdict.lower:.4g} from a singularity"
    monitor = pinsing.Monitor(pinsing.closed_form(build([Joint(d=0.2)])))
    assert monitor.complete
    verdict = monitor.update([0.3], [1.0])
    assert (verdict.level, verdict.lower, verdict.time_to_contact) == ("clear", np.inf, np.inf)
    form = closed("stanford")
    unsure = replace(form.families[2], real=False)
    form = replace(form, families=(*form.families[:2], unsure))
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
        ({"warn": np.nan}, PinsingError), ({"warn": 20, "stop": 5}, OptionError),  # degrees
    ],
)  # fmt: skip
def test_bad_options(options: dict[str, object], error: type[Exception]) -> None:
    with pytest.raises(error):
        pinsing.Monitor(closed("ur5"), **options)
    with pytest.raises(PinsingError):
        pinsing.Monitor([])


def test_degrees_are_refused():
    with pytest.raises(OptionError, match="near is 5 rad"):
        pinsing.check_trajectory(arm_of("ur5"), [[0.1] * 6], forms=closed("ur5"), near=5)
    pinsing.Monitor(closed("ur5"), warn=20, stop=5, weights=[100] * 6)  # other units
    monitor = pinsing.Monitor(closed("ur5"))
    assert monitor.update(np.zeros(6)).level == "stop"
    path = np.outer(np.arange(50), [0, -2.0, 1.5, -2.0, -1.7, 0])
    with pytest.raises(ConfigurationError, match="add --deg"):
        [monitor.update(q) for q in path]
    monitor, q = pinsing.Monitor(closed("ur5")), [0, -1.2, 1.3, -1, 0.5, 0]
    said = r"dq: wrist_2_joint at 30 rad/s is 9\.\d times"
    for _ in range(2):  # the next is judged again
        with pytest.raises(ConfigurationError, match=said):
            monitor.update(q, [0, 0, 0, 0, -30, 0])
    assert monitor.update(q, [3.5] * 6).level == "clear"  # too fast, but no degrees
    radians = pinsing.Monitor(pinsing.closed_form(pinsing.load("ur5", units="rad")))
    assert radians.update(q, [0, 0, 0, 0, -30, 0]).trend == "toward"


def test_endless_joints_may_turn_on():
    """A controller counts turns; that stops no loop."""
    form = pinsing.closed_form(pinsing.load("kinova"))
    endless = ~np.isfinite(form.arm.upper)
    low, high = np.where(endless, -1, form.arm.lower), np.where(endless, 1, form.arm.upper)
    s = np.linspace(0.05, 0.95, 400)[:, None]
    monitor, way = pinsing.Monitor(form), np.where(endless, 100 * s, low + s * (high - low))
    assert len({monitor.update(q).level for q in way}) > 1
    monitor = pinsing.Monitor(pinsing.closed_form(pinsing.load("ur5", units="rad")))
    for turns in (-3, 1, 100):
        verdict = monitor.update(Q + 2 * np.pi * turns, SPEED)
        assert verdict.lower == pytest.approx(0.15, abs=1e-12)
        assert verdict.time_to_contact == pytest.approx(0.5, abs=1e-9)


def test_speeds_of_the_whole_model_do_as_well():
    arm, whole = pinsing.load("ur5", base="upper_arm_link"), pinsing.load("ur5").joints
    form, own = pinsing.closed_form(arm), [whole.index(name) for name in arm.joints]
    rng = np.random.default_rng(5)
    for _ in range(5):
        q, dq = rng.uniform(-1, 1, (2, 6))
        monitor = pinsing.Monitor(form)
        one, other = monitor.update(q, dq), monitor.update(q[own], dq[own])
        assert (one.rate, one.time_to_contact) == (other.rate, other.time_to_contact)
    with pytest.raises(ConfigurationError, match="or the whole model's 6; got shape"):
        monitor.update(q[own], np.zeros(8))
    arm = pinsing.load("ur5", joints=[*whole[:2], *whole[3:]])
    monitor = pinsing.Monitor(pinsing.closed_form(arm))
    q, dq = np.array([0.1, 0.2, 0.0, 0.4, 0.5, 0.6]), np.zeros(6)
    monitor.update(q, dq)
    dq[2] = 0.1
    with pytest.raises(ConfigurationError, match="is locked in this arm, but the whole model's dq"):
        monitor.update(q, dq)


COMMAND = ["-c", "from pinsing.cli import program; program()", "check", "ur5", "--follow", "-"]


@pytest.fixture(scope="module")
def form():
    return closed("ur5")


def said(form, lines, degrees=False):
    return list(follow(Follower(form, form.loaded, degrees, np.radians(10)), lines, False))


def row(t, q):
    return ",".join(map(str, [t, *q]))


def line(t, q, **more):
    return json.dumps({"t": t, "position": [*q], **more})


NAMES = pinsing.load("ur5").joints


def of(q=Q, **more):
    return json.dumps({"name": [*NAMES], "position": [*q]} | more)


HEAD = "t," + ",".join(f"q{k} (deg)" for k in range(1, 7))
MOVED = [(t, Q + SPEED * t) for t in (0, 0.01)]


@pytest.mark.parametrize(
    "lines",
    [
        ["t,q1,q2,q3,q4,q5,q6", *(row(t, q) for t, q in MOVED)],
        [HEAD, *(row(t, np.degrees(q)) for t, q in MOVED)],
        [line(t, q) for t, q in MOVED],
        [line(t, q, velocity=[*SPEED]) for t, q in MOVED],
    ],
    ids=["head", "head in degrees", "positions", "positions and speeds"],
)
def test_a_verdict_says_what_a_monitor_says(form, lines):
    last = said(form, lines)[-1]
    monitor = pinsing.Monitor(form, np.radians(10), np.radians(5))
    right = monitor.update(Q + SPEED * 0.01, SPEED)
    assert last["level"] == right.level == "warn"
    assert (last["family"], last["title"]) == ("F2", "wrist")
    assert last["lower"] == pytest.approx(right.lower)
    assert last["time_to_contact"] == pytest.approx(0.49, abs=1e-6)
    assert last["move"] == {"joint": "wrist_2_joint", "direction": 1}


@pytest.mark.parametrize("torn", [0, 3, 9, 40, 130, 150, 160, 170, 177, "robot ready", "a,b", "{"])
def test_a_stream_that_begins_in_the_middle_of_a_line_goes_on(form, torn):
    state = of(t=0.5)
    first = state[torn:] if isinstance(torn, int) else torn
    *broken, last = said(form, [first, state])
    assert len(broken) == 1
    assert ("error" in broken[0]) == (torn != 0)
    head = f"t,{','.join(NAMES[::-1])}"
    *_, named = said(form, [first, head, row(0.5, Q[::-1])])
    assert last == named


STREAMS = Golden(Path(__file__).with_name("streams.txt"))


@pytest.mark.parametrize("head", STREAMS.cases)
def test_what_is_said_of_a_stream(form, head):
    """Verdicts, errors and notes; angles are in radians but where the head says otherwise."""
    degrees = {"deg": True, "auto": None}.get(head.rpartition("units=")[2], False)
    heard = []
    follower = Follower(form, form.loaded, degrees, np.radians(10), heard.append)
    try:
        for found in follow(follower, STREAMS.text(head).splitlines(), False):
            if "error" in found:
                at = ", ".join(f"{key} {found[key]}" for key in ("line", "t") if key in found)
                heard.append(f"{at}: {found['error']}")
            else:
                verdict = f"{found['level']}, {found['upper']:.4f} from {found['family']}"
                if found["time_to_contact"] is not None:
                    verdict += f", {found['trend']}, contact in {found['time_to_contact']:.4f}"
                heard.append(f"t {found['t']}: {verdict}")
    except HeadError as error:
        heard.append(f"it ends: {error}")
    STREAMS.hold(head, "\n".join(heard))


@pytest.mark.parametrize(
    "bad", ["\0", "\x00\x01" * 100_000, of([10**400, 0, 0, 0, 0, 0]), of(junk="x" * (1 << 20))]
)
def test_what_is_long_or_odd_is_said_in_one_line(form, bad):
    _, error, last = said(form, [of(), bad, of()])
    assert error["line"] == 2
    assert re.search(
        "no column|than 300 characters|is 1000|than 1,048,576 characters", error["error"]
    )
    assert "\n" not in error["error"]
    assert last["family"] == "F2"


@pytest.mark.slow
def test_what_is_no_joint_is_noted_so_often_at_the_most(form):
    notes = []
    follower = Follower(form, form.loaded, False, 0.1, notes.append)
    each = {f"{n}.pos": x for n, x in zip(NAMES, Q.tolist(), strict=True)}
    lines = [json.dumps(each | {f"k{k}": 1}) for k in range(2 * BACKLOG)]
    many = json.dumps(each | {f"k{k}": 1 for k in range(50_000)})
    *_, last = follow(follower, [*lines, many], False)
    assert last["error"] == "the stream: a line of 50,006 columns"
    assert len(notes) == BACKLOG


@pytest.mark.parametrize(("head", "unit"), [("{}.pos", 1), ("{} (deg)", np.degrees(1))])
def test_joints_that_contradict_the_description_are_noted(head, unit):
    hinge, follower = ("revolute", ZERO), ("revolute", ZERO, Z, ZERO, follows(1, -2, 0.25))
    text = chain_text([hinge, follower, hinge, ("prismatic", ZERO), hinge], (-1, 2))
    arm = pinsing.load(text, task="vx,vy", joints=["j1", "j5"])
    notes = []
    reader = Reader(arm, False, notes.append)
    reader.read(",".join("j4" if k == 4 else head.format(f"j{k}") for k in range(1, 6)))
    for off in np.radians([0.9, 1.2, 11, 13]):
        row = [0.1, 0.05 - off, off, np.degrees(off) / 1e3 / unit, 0.7]
        reader.read(",".join(str(x * unit) for x in row))
    reader.read(f"{0.1 * unit},null,,x,{0.7 * unit}")  # what is not measured
    locked = "is locked in this arm"
    whys = [(2, "follows 'j1' in the description", "degrees"), (3, locked, "degrees")]
    assert notes == [
        f"note: joint 'j{k}' {why}, the stream has it {far} {of} elsewhere"
        for far in ("1.2", "13")
        for k, why, of in (*whys, (4, locked, "mm"))
    ]


def test_a_fast_producer_is_thinned_and_counted():
    stream = latest([f"{k}" for k in range(1000)])
    kept = [next(stream)]
    time.sleep(0.2)  # all of them have come by the time the next is asked for
    kept += stream
    assert (kept[0], kept[-1][0]) == (("0", 0), "999")
    assert sum(count for _, count in kept) + len(kept) == 1000
    words = [int(word) for word, _ in kept]
    assert words == sorted(words)
    assert BACKLOG <= len(kept) <= 1000


@pytest.mark.slow
def test_silence_is_said_once_and_a_file_is_read_whole(tmp_path: Path):
    def slow():
        yield line(0, Q)
        yield line(1, Q)
        time.sleep(0.5)
        yield line(2, Q)

    words = [text for text, _ in latest(slow(), stalled=0.1)]
    assert (words.count(None), words[-1]) == (1, line(2, Q))
    file = tmp_path / "log.csv"
    file.write_text("\n".join(line(k / 100, Q) for k in range(3 * BACKLOG)))
    with file.open() as stream:
        done = python(*COMMAND, stdin=stream, timeout=60)
    assert done.returncode == 0, done.stderr
    out = [json.loads(text) for text in done.stdout.splitlines()]
    assert len(out) == 3 * BACKLOG
    assert out[-1]["t"] == pytest.approx(2.99)
    assert "dropped" not in out[-1]


@pytest.mark.slow
def test_the_move_leads_away_also_from_the_singularity_itself_and_within_limits(form):
    at, edge = Q * [1, 1, 1, 1, 0, 1], Q * [1, 1, 0, 1, 1, 1]
    (wrist,) = said(form, [line(0, at)])
    assert (wrist["lower"], wrist["move"]["joint"]) == (0, "wrist_2_joint")
    arm, panda = arm_of("panda"), closed("panda")
    for q in (arm.lower, arm.upper):
        (one,) = said(panda, [line(0, q)])
        assert one["move"]["direction"] == (1 if q is arm.lower else -1)
    (elbow,) = said(form, [line(0, edge)])
    assert (elbow["title"], elbow["move"]["joint"]) == ("elbow", "elbow_joint")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_also_where_nobody_takes_its_verdicts(number):
    with started(*COMMAND, stdin=subprocess.PIPE) as robot:
        for k in range(2000):
            robot.stdin.write(line(k, Q) + "\n")
        robot.stdin.flush()
        first = robot.stdout.readline()
        time.sleep(1)  # by now it waits for somebody who reads
        robot.send_signal(number)
        assert robot.wait(5) == 128 + number
        times = [json.loads(text)["t"] for text in (first, *robot.stdout)]
    assert times[0] == 0
    assert len(times) > 100
    assert len(set(times)) == len(times)


@pytest.mark.slow
def test_each_verdict_says_which_zones_it_is_in(form, tmp_path):
    file, zones = tmp_path / "run.jsonl", tmp_path / "zones.json"
    made = ["zones", "scara", "--joint-speeds", "5,5,1,10", "--within", "q1=-1..1"]
    assert run(*made, "-o", zones).exit_code == 0
    rows = [[0, 0.1, 0.1, 0], [0, 1.5, 0.1, 0], [2, 0.1, 0.1, 0]]
    file.write_text("\n".join(json.dumps({"position": q}) for q in rows))
    done = run("check", "scara", "--follow", file, "--zones", zones)
    assert [json.loads(text)["zones"] for text in done.stdout.splitlines()] == [["F1"], [], None]
    assert "zones" not in said(form, [of()])[0]
    other = run("check", "ur5", "--follow", file, "--zones", zones)
    assert (other.exit_code, other.stdout) == (2, "")
    assert "zones are of scara" in other.stderr
    alone = run("check", "scara", file, "--zones", zones)
    assert (alone.exit_code, "--zones is for --follow" in alone.stderr) == (2, True)


@pytest.mark.slow
def test_a_long_line_is_one_that_cannot_be_read_and_takes_no_memory(form):
    class Long:
        left = 1000

        def read(self, size):
            self.left -= 1
            last = f",{row(0, Q)}\n{of()}".encode()
            return b"\xff" * size if self.left else last

    lines = lines_of(Long())
    long = next(lines)
    Long.left = 0
    assert (1 << 22) < len(long) < (1 << 22) + (1 << 17)
    error, good = said(form, [long, of()])
    assert "more than 1,048,576 characters" in error["error"]
    assert good["family"] == "F2"


def test_a_stream_that_is_set_not_to_wait_goes_on():
    end, start = os.pipe()
    os.set_blocking(end, False)
    writer = threading.Timer(0.1, lambda: (os.write(start, b"one\n"), os.close(start)))
    writer.start()
    with open(end, "rb", buffering=0) as stream:
        assert list(lines_of(stream)) == ["one"]


@pytest.mark.parametrize(
    ("times", "steps", "kept"),
    [
        ([9, 9.5, 9.501, 11, 9, 9.25, 9.251], [0, 0.5, 2, 2, 2.25], [0, 1, 3, 4, 5]),
        ([0, 0.5, 1.7e9, 1.7e9 + 1], [0, 0.5, 0.5, 1.5], range(4)),  # a clock that was set
        (None, 0.05 * np.arange(7), range(7)),
    ],
)
def test_a_file_is_drawn_at_its_own_times_or_line_by_line(
    form, tmp_path, monkeypatch, capsys, times, steps, kept
):
    class Clock:
        now = 7.0

        def monotonic(self):
            return self.now

        def sleep(self, seconds):
            self.now += seconds

    class Screen:
        arm, q, shown = form.loaded, Q, []

        def show(self, q, said):
            self.shown.append((round(clock.now - 7.0, 9), q[0]))

    clock = Clock()
    monkeypatch.setattr(show, "time", clock)
    file, places = tmp_path / "run.jsonl", np.arange(7 if times is None else len(times)) / 10
    states = [{"position": [x, *Q[1:]]} for x in places]
    states[0] |= {"name": [*NAMES, "gripper"], "position": [*states[0]["position"], 1]}
    for state, t in zip(states, times or [], strict=False):
        state["t"] = t
    file.write_text("\n".join(map(json.dumps, states)))
    show._lead(Screen(), file, False)
    assert capsys.readouterr().err.count("no positions in 'gripper': not used") == 1
    np.testing.assert_allclose(Screen.shown[:-1], list(zip(steps, places[kept], strict=True)))
    assert Screen.shown[-1][1] == places[-1]  # the last one, skipped or not


@pytest.mark.parametrize(
    ("options", "typed"),
    [
        ("", None),
        ("--tip-speed 0.6", {"tip_speed": 0.6}),
        ("--joint-speeds 1,1,1,1,1,2", {"joint_speeds": [1] * 5 + [2]}),
    ],
)
def test_tip_speeds_are_told_where_they_are_asked_for(form, tmp_path, options, typed):
    file = tmp_path / "run.jsonl"
    file.write_text(line(0, Q))
    told = json.loads(run("check", "ur5", "--follow", file, *options.split()).stdout)
    assert ("tip_speeds" in told) == (typed is not None)
    if typed is not None:
        right, told = tip_speeds(form.loaded, Q, **typed), told["tip_speeds"]
        assert (told["tip_speed"], told["linear"]) == (right.tip_speed, pytest.approx(right.linear))
        assert told["share"] == pytest.approx(right.share)
