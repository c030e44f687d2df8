"""A running robot: a verdict for each line, drops and silences said."""

import json
import os
import signal
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from command_line import python, run, started
from urdf_texts import LIMIT

import pinsing
from pinsing.kinematics import tip_speeds
from pinsing.proximity.monitor import BACKLOG, Follower, HeadError, Reader, follow, latest, lines_of

Q = np.array([0.0, -1.2, 1.3, -1.0, 0.15, 0.0])
SPEED = np.array([0.0, 0.0, 0.0, 0.0, -0.3, 0.0])
COMMAND = ["-c", "from pinsing.cli import program; program()", "check", "ur5", "--follow", "-"]


@pytest.fixture(scope="module")
def form():
    return pinsing.closed_form(pinsing.load("ur5"))


def said(form, lines, **options):
    follower = Follower(form, form.loaded, options.pop("degrees", False), np.radians(10))
    return list(follow(follower, lines, options.pop("live", False)))


def row(t, q):
    return ",".join(map(str, [t, *q]))


def line(t, q):
    return json.dumps({"t": t, "position": q.tolist()})


NAMES = pinsing.load("ur5").joints
HEAD = "t," + ",".join(f"q{k} (deg)" for k in range(1, 7))


def test_times_that_jitter_do_not_cost_a_verdict(form):
    """Differences over them make no sense as speeds: the line is judged without."""
    on = Q * [1, 1, 1, 1, 0, 1]
    first, second = said(form, [line(0.0, Q + 0.3), line(0.005, on)])
    assert (first["level"], second["level"], second["trend"]) == ("clear", "stop", None)
    measured = json.dumps({"t": 1, "position": on.tolist(), "velocity": [90.0] * 6})
    assert "error" in said(form, [line(0.0, Q + 0.3), measured])[1]


@pytest.mark.parametrize(
    "lines",
    [
        ["t,q1,q2,q3,q4,q5,q6", *(row(t, Q + SPEED * t) for t in (0, 0.01))],
        [HEAD, *(row(t, np.degrees(Q + SPEED * t)) for t in (0, 0.01))],
        [line(t, Q + SPEED * t) for t in (0, 0.01)],
        [
            json.dumps({"t": t, "position": (Q + SPEED * t).tolist(), "velocity": SPEED.tolist()})
            for t in (0, 0.01)
        ],
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


def test_numbers_without_names_are_joints_and_never_times(form):
    bare, named = said(form, [row(0, Q)[2:], line(0, Q)])
    assert bare["lower"] == named["lower"]
    (wrong,) = said(form, [row(0, Q)])
    assert "7 numbers without names for 6 joints: begin with a line of names" in wrong["error"]


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


@pytest.mark.parametrize("torn", ["", "-", ".2,1.3,-1,0.15,0", "e-05,1.3,-1,0.15,0,0", ",1", "2,1"])
def test_a_row_that_was_torn_is_no_line_of_names(form, torn):
    assert said(form, [torn, row(0, Q)[2:]])[-1]["family"] == "F2"


def of(q=Q, **more):
    return json.dumps({"name": [*NAMES], "position": [*q]} | more)


def test_a_comment_states_the_unit_of_angles(form):
    rows = ["# units: degrees", row(0, Q)[2:], of()]
    expected = said(form, rows[1:], degrees=True)
    for degrees in (None, True):
        assert said(form, rows, degrees=degrees) == expected
    for degrees, comment in ((False, rows[0]), (None, "# units: ticks")):
        with pytest.raises(HeadError, match="units"):
            said(form, [comment, of()], degrees=degrees)


def test_a_line_may_be_a_list(form):
    head = ",".join(NAMES[::-1])
    lists = ["[]", json.dumps(Q.tolist()), head, json.dumps(Q[::-1].tolist())]
    assert said(form, lists) == said(form, [of()] * 2)


def test_times_by_whole_seconds_may_be_milliseconds_and_guessed_names_are_told(form):
    notes = []
    follower = Follower(form, form.loaded, False, 0.1, notes.append)
    table = ["t," + ",".join(f"q{k}" for k in range(1, 7)), *(row(10 * k, Q) for k in range(4))]
    list(follow(follower, table, False))
    columns, steps = notes
    assert "columns: shoulder_pan_joint = 'q1'" in columns
    assert "times step by 10 s" in steps


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (of([0, -80, 60, -100, 10, 0]), "For degrees add --deg"),
        (of([0, 0, 80, 0, 0, 0], t=3), "elbow_joint = 80"),
        (of([1e18, 0, 0, 0, 0, 0]), "shoulder_pan_joint = 1e"),
        (of([None, 0, 0, 0, 0, 0]), "joint 'shoulder_pan_joint' is null"),
        (of(["abc", 0, 0, 0, 0, 0]), "joint 'shoulder_pan_joint' is abc"),
        (of([10**400, 0, 0, 0, 0, 0]), "joint 'shoulder_pan_joint' is 1000"),
        (of(Q[:5]), "lists of one length"),
        (of(velocity=[1]), "velocity needs 6"),
        (of(t="x"), "the time is x"),
        (of(t=1.7e18), "the time 1.7e+18 is not in seconds"),
        ("[1", "no column for joint"),
        (of(name=[f"right_{n}" for n in NAMES]), "'shoulder_pan_joint' in a line before"),
        (json.dumps({f"{n}_ticks": 1 for n in NAMES}), "'shoulder_pan_joint_ticks' is none: after"),
        ("\x00\x01" * 100_000, "a column's name has more than 300 characters"),
        *((of(**{key: "deg"}), f"{key!r} is not read") for key in ("angle_units", "deg", "angles")),
        ("{", "it is no JSON object, which must be on one line"),
        (of()[:-1] + ', "position": [1, 1, 1, 1, 1, 1]}', "'position' is there twice"),
        (of(joint_names=list(NAMES[::-1])), "'joint_names' is not read"),
        (of(units="deg"), "'units' is not read"),
        (json.dumps(dict(zip(NAMES, Q.tolist(), strict=True)) | {"unit": "deg"}), "'unit' is not"),
        (of(junk="x" * (1 << 20)), "a line of more than 1,048,576 characters"),
        *((bad, "") for bad in ("1,2", '{"t": 1}', '{"position": 3}', "a,b,c,d,e,f,g", "\0")),
        *((bad, "") for bad in ("nan,0,0,0,0,0", "0,1,2,3,4,5,6", "{}", of([], name=[]))),
    ],
)
def test_errors_say_the_line_and_the_joint(form, bad, words):
    _, error, last = said(form, [of(), bad, of()])
    assert error["line"] == 2
    assert error.get("t") == (3 if "80, 0, 0" in bad and "t" in json.loads(bad) else None)
    assert words in error["error"]
    assert "Error" not in error["error"]
    assert "\n" not in error["error"]
    assert last["family"] == "F2"


@pytest.mark.parametrize("first", [[], [of()]])
def test_speeds_in_degrees_are_refused_from_the_first_line_that_has_some(form, first):
    for error in said(form, first + [of(velocity=[100, 0, 0, 0, 0, 0])] * 2)[len(first) :]:
        assert "at 100 rad/s" in error["error"]


@pytest.mark.parametrize(
    ("stamp", "t", "unknown"),
    [
        ({"sec": 1, "nanosec": 500000000}, 1.5, float("nan")),
        ({"secs": 1, "nsecs": 500000000}, 1.5, None),  # as JSON of rosbridge has it
        (2.5, 2.5, float("inf")),
    ],
)
def test_stamps_of_ros_and_speeds_that_are_not_measured(form, stamp, t, unknown):
    (one,) = said(form, [of(header={"stamp": stamp}, velocity=[0.0] * 5 + [unknown])])
    assert (one["t"], one["time_to_contact"]) == (t, None)


@pytest.mark.slow
def test_what_is_no_joint_is_passed_over_once(form):
    notes = []
    follower = Follower(form, form.loaded, False, 0.1, notes.append)
    head = "\ufeff" + ",".join([*NAMES[::-1], "gripper"])
    rows = ["# said", head, row(0, Q[::-1])[2:] + ",open", "# more", row(1, Q[::-1])[2:] + ",open"]
    table = list(follow(follower, rows, False))
    each = {f"{n}.pos": x for n, x in zip(NAMES, Q.tolist(), strict=True)} | {"gripper.pos": 1}
    assert [v["lower"] for v in table] == [said(form, [json.dumps(each)])[0]["lower"]] * 2
    assert notes == ["note: no positions in 'gripper': not used"]
    lines = [json.dumps(each | {f"k{k}": 1}) for k in range(2 * BACKLOG)]
    many = json.dumps(each | {f"k{k}": 1 for k in range(50_000)})
    *_, last = follow(follower, [*lines, many], False)
    assert last["error"] == "the stream: a line of 50,007 columns"
    assert len(notes) == BACKLOG


@pytest.mark.parametrize(("head", "unit"), [("{}.pos", 1), ("{} (deg)", np.degrees(1))])
def test_joints_that_contradict_the_description_are_noted(write_urdf, head, unit):
    axis = f'<axis xyz="0 0 1"/>{LIMIT}'
    mimic = axis + '<mimic joint="j1" multiplier="-2" offset="0.25"/>'
    kinds = ["revolute"] * 3 + ["prismatic", "revolute"]
    parts = list(zip(kinds, (axis, mimic, axis, axis, axis), strict=True))
    arm = pinsing.load(write_urdf(parts), task="vx,vy", joints=["j1", "j5"])
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
    lines = [f"{k}" for k in range(1000)]
    kept = []
    stream = latest(lines)
    kept.append(next(stream))
    time.sleep(0.2)  # all of them have come by the time the next is asked for
    kept += stream
    time.sleep(0.2)
    assert (kept[0], kept[-1][0]) == (("0", 0), "999")
    assert sum(count for _, count in kept) + len(kept) == 1000
    assert [int(word) for word, _ in kept] == sorted(int(word) for word, _ in kept)
    assert BACKLOG <= len(kept) <= 1000


@pytest.mark.slow
def test_silence_is_said_once_and_a_file_is_read_whole(form, tmp_path: Path):
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
    (wrist,) = said(form, [json.dumps({"position": at.tolist()})])
    assert (wrist["lower"], wrist["move"]["joint"]) == (0, "wrist_2_joint")
    arm = pinsing.load("panda")
    panda = pinsing.closed_form(arm)
    for q in (arm.lower, arm.upper):
        (one,) = said(panda, [json.dumps({"position": q.tolist()})])
        sign = one["move"]["direction"]
        assert sign == (1 if q is arm.lower else -1)
    (elbow,) = said(form, [json.dumps({"position": edge.tolist()})])
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
    found = pinsing.proximity.Zones.from_json(zones.read_text())
    monitor = pinsing.Monitor(pinsing.closed_form(pinsing.load("scara")), zones=found)
    told = [json.loads(text)["zones"] for text in done.stdout.splitlines()]
    assert told == [["F1"], [], None]
    assert [None if z is None else tuple(z) for z in told] == [
        monitor.update(q).zones for q in rows
    ]
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
            return (
                b"\xff" * size if self.left else b"," + row(0, Q).encode() + b"\n" + of().encode()
            )

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


def test_a_second_head_is_taken_or_ends_the_stream(form):
    near = Q + 0.4 * SPEED
    rows = [row(0, Q), f"t,{','.join(NAMES[::-1])}", row(0.1, near[::-1])]
    one, two = said(form, [f"t,{','.join(NAMES)}", *rows])
    assert (one["level"], two["level"], two["family"]) == ("warn", "stop", "F2")
    assert two["upper"] == pytest.approx(0.03)
    with pytest.raises(HeadError, match="give a line of names"):
        said(form, [f"t,{','.join(NAMES)}", rows[0], "t,a,b,c,d,e,f", rows[0]])


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
    import pinsing.cli.show as module

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
    monkeypatch.setattr(module, "time", clock)
    file, places = tmp_path / "run.jsonl", np.arange(7 if times is None else len(times)) / 10
    states = [{"position": [x, *Q[1:]]} for x in places]
    states[0] |= {"name": [*NAMES, "gripper"], "position": [*states[0]["position"], 1]}
    for state, t in zip(states, times or [], strict=False):
        state["t"] = t
    file.write_text("\n".join(map(json.dumps, states)))
    module._lead(Screen(), file, False)
    assert capsys.readouterr().err.count("no positions in 'gripper': not used") == 1
    np.testing.assert_allclose(Screen.shown[:-1], list(zip(steps, places[kept], strict=True)))
    assert Screen.shown[-1][1] == places[-1]  # the last one, skipped or not


@pytest.mark.parametrize("options", [[], ["--tip-speed", "0.6"], ["--joint-speeds", "1,1,1,1,1,2"]])
def test_tip_speeds_are_told_where_they_are_asked_for(form, tmp_path, options):
    file = tmp_path / "run.jsonl"
    file.write_text(line(0, Q))
    (one,) = map(json.loads, run("check", "ur5", "--follow", file, *options).stdout.splitlines())
    if not options:
        assert "tip_speeds" not in one
        return
    typed = {"--tip-speed": {"tip_speed": 0.6}, "--joint-speeds": {"joint_speeds": [1] * 5 + [2]}}
    right = tip_speeds(form.loaded, Q, **typed[options[0]])
    told = one["tip_speeds"]
    assert (told["tip_speed"], told["linear"]) == (right.tip_speed, pytest.approx(right.linear))
    assert told["share"] == pytest.approx(right.share)
