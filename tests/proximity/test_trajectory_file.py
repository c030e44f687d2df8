"""Trajectory files as people have them: what is a joint, what a time, and in which unit."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from dh_arms import arm_of

from pinsing import load
from pinsing.errors import ConfigurationError, PinsingError
from pinsing.proximity.trajectory import check_trajectory
from pinsing.proximity.trajectory_file import read_trajectory

UR5 = [
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint",
    "wrist_3_joint",
]  # fmt: skip
Q = np.array([[0.1, -1.2, 1.3, -0.4, 0.5, 0.7], [0.2, -1.1, 1.2, -0.3, 0.4, 0.6]])
T = np.array([0.0, 0.25])
DEG = np.degrees(Q)


def table(heads, rows, sep=","):
    numbers = ([f"{x:.12g}" for x in row] for row in rows)
    return "".join(sep.join(row) + "\n" for row in (heads, *numbers))


def timed(rows=Q, t=T):
    return np.column_stack([t, rows])


def below(text, units):
    return text.replace("\n", f"\n{units}\n", 1)


def clocked(first, second, sep=","):
    head, *rows = table(["time", *UR5], timed(), sep).splitlines()
    said = zip((first, second), rows, strict=True)
    return "\n".join([head, *(word + row[row.index(sep) :] for word, row in said)]) + "\n"


def numbered(pattern, first=1):
    return [pattern.format(k) for k in range(first, first + 6)]


def yaml_points(stamp, names=UR5, rows=Q):
    points = [
        f"- positions: {q.tolist()}\n  velocities: []\n  time_from_start: {stamp(t)}"
        for q, t in zip(rows, T, strict=True)
    ]
    return f"joint_names: {json.dumps(names)}\npoints:\n" + "\n".join(points) + "\n"


def states():
    one = "header:\n  stamp:\n    sec: {}\n    nanosec: {}\nname: {}\nposition: {}\nvelocity: []\n"
    backward = json.dumps(UR5[::-1])
    return "---\n".join(
        one.format(1_700_000_000, int(t * 1e9), backward, q[::-1].tolist())
        for q, t in zip(Q, T, strict=True)
    )


def script(value, rows=Q):
    moves = [", ".join(value.format(x) for x in q) for q in rows]
    return "def path():\n" + "".join(f"  movej([{m}], a=1.4, v=1.05)\n" for m in moves) + "end\n"


def fanuc():
    def point(k, q):
        joints = ",\n\t".join(f"J{j}= {x:9.6f} deg" for j, x in enumerate(np.degrees(q), 1))
        return f"P[{k}]{{\n   GP1:\n\tUF : 0, UT : 1,\t\n\t{joints}\n}};\n"

    moves = "   1:J P[1] 100% FINE    ;\n   2:J P[2] 50% CNT10 ;\n"
    return f"/PROG  PATH\n/MN\n{moves}/POS\n{point(1, Q[0])}{point(2, Q[1])}/END\n"


ROSBAG = [
    "%time", *numbered("field.name{}", 0), *numbered("field.position{}", 0), "field.velocity0",
]  # fmt: skip
RTDE = [
    "timestamp", *numbered("actual_q_{}", 0), *numbered("actual_qd_{}", 0),
    *numbered("target_q_{}", 0), "robot_mode", *numbered("actual_TCP_force_{}", 0),
    *numbered("joint_temperatures_{}", 0), "runtime_state", "elbow_position_0",
]  # fmt: skip
ALPHABET = np.argsort(UR5)


def rosbag(order):
    """Rows of rostopic, whose drivers publish joints in an order of their own."""
    times = [f"{1.7e18 + t * 1e9:.0f}" for t in T]
    rows = zip(times, Q[:, order].astype(str), strict=True)
    return "".join(",".join([t, *np.take(UR5, order), *q, "0.5"]) + "\n" for t, q in rows)


BAG = ",".join(ROSBAG) + "\n" + rosbag(ALPHABET)
TIMED = {
    "names.csv": table(["t", *UR5], timed()),
    "q.csv": table(["time", *numbered("q{}")], timed()),
    "J_brackets.csv": table(["Time [ms]", *numbered("J{}[deg]")], timed(DEG, T * 1e3)),
    "prefix.csv": table(["t", *(f"left_ur5_{j}" for j in UR5)], timed()),
    "plotjuggler.csv": table(
        ["__time", *(f"/joint_states/{j}/position" for j in UR5)], timed(t=T + 1.7e9)
    ),
    "plotjuggler_all.csv": table(
        ["__time", *(f"/joint_states/{j}/{x}" for j in UR5 for x in ("position", "velocity"))],
        np.column_stack([T, np.kron(Q, [1, 9])]),
    ),
    "ros2bag.csv": table(["t", *numbered("/joint_states.position[{}]", 0)], timed()),
    "rosbag.csv": BAG,
    "plotjuggler_names.csv": BAG.replace("field.", "/joint_states/"),
    "ros2bag_names.csv": re.sub(r"field\.(name|position)(\d)", r"/joint_states.\1[\2]", BAG),
    "names_and_q.tsv": re.sub(r"field\.(\w+?)(\d)", r"\1_\2", BAG)
    .replace("position", "q")
    .replace(",", "\t"),
    "rtde.csv": table(RTDE, np.column_stack([T, Q, Q, Q + 1, T, Q, Q, T, T]), " "),
    "positions.csv": table(["Zeit", *(f"{j}_pos" for j in UR5)], timed()),
    "achsen.csv": table(["Zeit", *numbered("Achse {} [Grad]")], timed(DEG), ";"),
    "axis.csv": table(["t", *numbered("Axis {} (deg)")], timed(DEG)),
    "quoted.csv": re.sub("[^,\n]+", r'"\g<0>"', table(["t", *UR5], timed())),
    "sep.csv": "sep=;\n" + table(["t", *UR5], timed(), ";"),
    "semicolons.csv": table(["t", *UR5], timed(), ";"),
    "tabs.tsv": table(["t", *UR5], timed(), "\t"),
    "excel.csv": "\ufeff" + table(["time(s)", *UR5], timed(), ";").replace(".", ","),
    "bare_comma.csv": table([], timed(), ";")[1:].replace(".", ","),
    "below.csv": below(table(["t", *UR5], timed(DEG)), "\ns" + ",deg" * 6),
    "brackets_below.tsv": below(
        table(["t", *UR5], timed(Q, 1e3 * T), "\t"), "[ms]" + "\t[rad]" * 6
    ),
    "dates.csv": clocked("2024-02-29 23:59:59.9", "2024-03-01 00:00:00.15"),
    "iso.csv": clocked("2024-02-29T23:59:59,9+01:00", "2024-02-29T23:00:00,15Z", ";"),
    "clock.csv": clocked("9:59:59.9", "10:00:00.15"),
    "midnight.csv": clocked("23:59:59.9", "00:00:00.15"),
    "bare_clock.csv": clocked("9:59:59.9", "10:00:00.15").partition("\n")[2],
    "stamps.csv": table(
        ["Time", "header/stamp/sec", "header/stamp/nanosec", *UR5],
        np.column_stack([T, T, T, Q]),
    ),
    "stamp.csv": table(
        ["/stamp/sec", "/stamp/nanosec", *UR5], np.column_stack([0 * T, 1e9 * T, Q])
    ),
    "yaskawa.csv": table(["t", *"SLURBT"], timed()),
    "comment.csv": "# units: deg, s\n" + table(["t", *UR5], timed(DEG)),
    "comment.yaml": "# units: radians\n" + yaml_points(float),
    "units.yaml": yaml_points(float, [f"{j} (deg)" for j in UR5], DEG),
    "moveit.yaml": yaml_points(lambda t: f"{{secs: 0, nsecs: {int(t * 1e9)}}}"),
    "ros2.yaml": yaml_points(lambda t: f"{{sec: 0, nanosec: {int(t * 1e9)}}}"),
    "plan.yaml": "trajectory:\n- joint_trajectory:\n"
    + "".join(f"    {line}\n" for line in yaml_points(float).splitlines()),
    "echo.yaml": states(),
    "plan.json": json.dumps(
        {
            "joint_names": UR5,
            "points": [
                {"positions": [*q], "time_from_start": t}
                for q, t in zip(Q, (1e-7, 0.25), strict=True)
            ],
        }
    ),
    "pandas.csv": table(["", "t", *UR5], np.column_stack([T, timed()])),
    "resaved.csv": table(["Unnamed: 0", "t", *UR5], np.column_stack([T, timed()])),
}
BARE = {
    "backward.csv": table(UR5[::-1], Q[:, ::-1]),
    "kawasaki.csv": table(numbered("JT{} (deg)"), DEG),
    "rapid.csv": table(numbered("rax_{} (deg)"), DEG),
    "q0.csv": table(numbered("q{}", 0), Q),
    "J.csv": table(numbered("J{}"), Q),
    "J_deg.csv": table(numbered("J{} (deg)"), DEG),
    "axes.csv": table(numbered("axis_{}_deg"), DEG),
    "kuka.csv": table(numbered("A{}"), Q),
    "joint_1.csv": table(numbered("joint_{}"), Q),
    "short.csv": table([j.removesuffix("_joint") for j in UR5], Q),
    "Case.csv": table([j.title() for j in UR5], Q),
    "windows.csv": table([f"{j} (degrés)" for j in UR5], DEG),
    "joint_angle.csv": table(numbered("Joint angle {}_degree"), DEG),
    "J_actual.csv": table(numbered("J{}_actual"), Q),
    "J_pos.csv": table(numbered("J{}_pos"), Q),
    "angle.csv": table(numbered("Joint {} angle [°]"), DEG),
    "in_words.csv": table(numbered("Gelenk{} in Grad"), DEG),
    "AxisActual.csv": table(numbered("AxisActual_A{}"), Q),
    "theta.csv": "% MATLAB\n" + table(numbered("θ{}°"), DEG),
    "comma_tabs.txt": table(numbered("q{}"), Q, "\t").replace(".", ","),
    "bare.csv": table([], Q)[1:],
    "yaskawa_deg.csv": table([f"{a} (deg)" for a in "SLURBT"], DEG),
    "comment_below.csv": table(UR5, DEG).replace("\n", "\n# Unit = degrees\n", 1),
    "trailing.csv": table(UR5, Q).replace("\n", ",\n"),
    "path.ls": fanuc(),
    "path.script": script("{}"),
    "degrees.script": script("d2r({})", DEG),
}


@pytest.fixture
def read(tmp_path):
    """Write a file, of text or of arrays, and read it for an arm."""

    def of(held, name="a.csv", arm="ur5", **how):
        file = tmp_path / name
        if isinstance(held, dict):
            np.savez(file, **held)
        elif isinstance(held, np.ndarray):
            np.save(file, held)
        elif isinstance(held, bytes):
            file.write_bytes(held)
        else:
            file.write_text(held, encoding="cp1252" if name == "windows.csv" else "utf-8")
        return read_trajectory(file, arm_of(arm), **how)

    return of


@pytest.mark.slow
def test_a_program_for_a_fanuc_by_name_counts_j3_from_the_horizontal(read):
    found = read(fanuc(), "p.ls", "m10id")
    np.testing.assert_allclose(found.Q, Q + np.outer(Q[:, 1], np.eye(6)[2]), atol=1e-6)
    assert "J2 + J3 is taken" in found.notes[0]


@pytest.mark.slow
@pytest.mark.parametrize(("arm", "told"), [("lrmate200id", True), ("gp7", False)])
def test_a_table_for_a_fanuc_by_name_may_be_a_pendants(read, arm, told):
    notes = read("J1,J2,J3,J4,J5,J6\n0,0.1,0.2,0.3,0.4,0.5\n", arm=arm).notes
    assert any("from the horizontal" in x for x in notes) == told


@pytest.mark.parametrize("name", [*TIMED, *BARE])
def test_files_as_people_have_them(read, name):
    found = read(TIMED.get(name) or BARE[name], name)
    np.testing.assert_allclose(found.Q, Q, atol=1e-6)
    assert (found.t is not None) == (name in TIMED)
    assert any("from the horizontal" in note for note in found.notes) == (name == "path.ls")
    if found.t is not None:
        np.testing.assert_allclose(found.t, T, atol=1e-6)


def test_a_quote_that_nothing_ends_takes_no_samples(read):
    text = table([*UR5, "note"], np.tile(np.column_stack([Q, T]), (2, 1)))
    assert len(read(text.replace(",0.25", ',"0.25', 1), columns=UR5).Q) == 4


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", table(numbered("q{}", 2), Q), "unknown column 'q2'"),
        ("a.csv", table([*numbered("q{}"), "q7"], Q[:, [*range(6), 0]]), "'q1' .7 are"),
        ("a.csv", table([*UR5[:5], "wrist_joint"], Q), "unknown column 'wrist_joint'"),
        ("a.csv", table([*UR5[:5], "left_elbow_joint"], Q), "could both be joint 'elbow_joint'"),
        ("a.csv", table([*UR5, "gripper"], np.column_stack([Q, T])), "unknown column 'gripper'"),
        ("a.csv", table(UR5, Q, ";").replace(".", ",").replace("1,3", "1.000,3"), "is no number"),
        ("a.yaml", "joint_names: [a, b]\npoints: [{positions: [1, 2]}]", "unknown column 'a'"),
        ("a.yaml", "hello: 1", "neither a trajectory"),
        ("a.yaml", "joint_names: [a\n", "cannot read"),
        ("a.yaml", f"joint_names: {UR5}\npoints: [{{positions: [1, 2]}}]", "sample 1 needs a num"),
        ("a.yaml", f"joint_names: {UR5}\npoints: []", "no sample"),
        ("a.yaml", states() + "---\n" + states().replace('_joint"', '_joint_deg"'),
         "sample 3 names other units of joints"),
        ("a.ls", "/POS\nP[1]{\n GP1:\n X = 1 mm, Y = 2 mm, W = 0 deg\n};",
         "pose of the tool: export .*pinsing path"),
        ("a.script", "movej([1, 2], a=1)", "move 1 has 2 joint values"),
        ("a.script", "movel(p[1, 2, 3, 0, 0, 0])", "movel goes to a pose"),
        ("a.script", "if x:\nmovej([1, 2, 3, 4, 5, 6])\nend", "without branches"),
        ("a.script", "movej([1, 2, 3, 4, 5, 6])\nspeedj([1, 2, 3, 4, 5, 6], 1)", "only movej"),
        ("a.script", "# movej([1, 2, 3, 4, 5, 6])", "no sample"),
        ("a.ls", fanuc().replace("J P[1]", "L P[1]"), "only joint moves.*'pinsing line"),
        ("a.ls", fanuc().replace("J P[1]", "J P[9]"), "no position"),
        ("a.ls", fanuc().replace("GP1", "GP2"), "GP1 alone"),
        ("a.ls", fanuc().replace("/POS", "   2:  CALL X ;\n/POS"), "CALL X"),
        ("a.csv", BAG + rosbag(range(6)).split("\n")[0], "a.csv:4: column 2 names 'shoulder_pan_j"),
        ("a.csv", BAG.replace("elbow", "x_a"), "'field.position0' of 'x_a_joint': .*--columns"),
        ("a.csv", ",".join([*numbered("q{}"), "name"]) + f'\n1,1,1,1,1,1,"{UR5[::-1]}"\n',
         "'q1' is numbered, and the first sample names joints, .*: say with --columns"),
        ("a.csv", re.sub(r",[a-z]\w+_joint", ",", BAG), "or leaves names empty"),
        ("a.csv", table(numbered("q{} (rev)"), Q), "'q1 .rev.' is in 'rev', which .*deg or rad"),
        ("a.csv", table(numbered("q{}_mrad"), Q), "is in 'mrad', which is not known"),
        ("a.csv", table(["t [min]", *UR5], timed()), "'t .min.' is in 'min', .* ms, us or ns"),
        ("a.csv", '{"points": []}', "if it is JSON, name it .json"),
        ("a.txt", states(), "a.txt:1: is no table: if it is YAML, name it .yaml"),
        ("a.dat", "DEFDAT P\nDECL E6AXIS XP1={A1 0,A2 -40}", "robot program"),
        ("a.csv", table([*UR5, "vel_1"], timed()).replace("0.", "0,"),
         "11 numbers in the first sample, and 7 names: .* semicolons"),
        ("a.csv", table(UR5, Q).replace("0.1", '"0.1°"'), "is no number: write numbers alone, and"),
        ("a.csv", f"# {UR5[::-1]}\n" + table([], Q)[1:], "a comment names the joints in another"),
        ("a.csv", "# t [s] J1 [deg]\n" + table([], Q)[1:], "speaks of degrees: say '--units deg'"),
        ("a.csv", "# J1_deg, J2_deg\n" + table([], Q)[1:], "speaks of degrees"),
        ("a.csv", "# all in degrees\n" + table(["t", *UR5], timed()), "speaks of degrees"),
        ("a.csv", below(table(UR5, Q), "# in degrees"), "speaks of degrees"),
        ("a.csv", table(["sec", "nanosec", *UR5], np.column_stack([T, timed()])), "not whole"),
        ("a.csv", "# radians\n" + table(numbered("J{} (deg)"), DEG), "of radians, the heads do"),
        ("a.csv", table(["timestamp", *UR5], timed(t=T + 1.7e18)), "not in seconds"),
        ("a.csv", table([], timed(Q[::-1]))[1:], "last ascend.*--columns t=1,2,3,4,5,6,7"),
        ("a.csv", table([], timed(t=T[::-1]))[1:], "first does not ascend"),
        ("a.csv", table([], timed()[:1])[1:], "more than one sample"),
        ("a.csv", table(UR5, Q) + "\n# x\n1,2,3\n", "a.csv:6: 3 columns, and 6 in"),
        ("a.csv", table([*UR5, "vel_1"], timed()) + "1,2\n", "a.csv:4: 2 columns, and 7 in"),
        ("a.yaml", yaml_points(float) + "points: []\n", "a.yaml:9: .*'points' is given twice"),
        ("a.csv", "# units: mm\n" + table(UR5, Q), "a.csv:1: units 'mm' are not"),
        ("a.csv", "# units: deg\n# units: rad\n" + table(UR5, Q), "a.csv:2: .*one before"),
        ("a.csv", "# units: rad\n" + table(numbered("J{} (deg)"), Q), "correct one of them"),
        ("a.script", "movej(p[1, 2, 3, 0, 0, 0], a=1)", "pose of the tool: export .*pinsing path"),
        ("a.csv", table([*numbered("J{} (deg)")[:5], "J6"], DEG), "others none"),
        ("a.csv", table([*UR5[:5], "wrist_3_joint (mm)"], Q), "is in mm.* which turns"),
        ("a.ls", fanuc().replace(" deg", " mm"), "'J1' is in mm.* which turns"),
        ("a.csv", table([], Q)[1:].replace("-1.2", "tool"), "a.csv:1: there is no line of names"),
        ("a.csv", table(["x", "y", "z", "rx", "ry", "rz"], Q), "poses of the tool.* 'pinsing path"),
        ("a.csv", below(table(["t", *UR5], timed()), "s" + ",rev" * 6), "'rev', which"),
        ("a.csv", below(table(["t", *UR5], timed()), "s,rad" + "," * 5), "others none"),
        ("a.csv", below(table(numbered("J{} (deg)"), DEG), "rad," * 5 + "rad"), "unit than 'rad'"),
        ("a.csv", clocked("9:00:00", "5.5"), "a.csv:3: time '5.5': give all in seconds"),
        ("a.csv", clocked("5.5", "9:00:00"), "a.csv:3: column 1: '9:00:00' is no number"),
        ("a.csv", clocked("3/4/2024 9:00:00", "3/4/2024 9:00:01"), "a.csv:2: time '3/4/2024 9:0"),
        ("a.csv", clocked("2024-01-01 9:00:00", "9:00:01"), "a.csv:3: time '9:00:01'"),
        ("a.csv", clocked("9:00:00", "9:00:01").replace("time", "time (ms)"), "have no unit"),
        ("a.csv", table([*"SLURBE"], Q), "unknown column 'S'"),
        ("a.csv", "MODULE M\nCONST jointtarget j0:=[[10,1]];", "robot program.* .ls of FANUC"),
        ("a.csv", "DEF T()\nPTP {A1 1,A2 1}", "robot program"),
        ("a.csv", "/JOB\n//NAME TEST\n", "robot program"),
        ("a.xlsx", "PK\x03\x04\x14", "a workbook .*: save its table as CSV"),
    ],
)  # fmt: skip
def test_broken_ones_are_refused_in_one_line(read, name, text, said):
    with pytest.raises(ConfigurationError, match=said) as raised:
        read(text, name)
    assert "\n" not in str(raised.value)


def test_columns_can_be_said(read):
    heads = ["when", *"abcdef"]
    for columns in (["t=when", *"abcdef"], ["t=1", *"234567"]):
        found = read(table(heads, timed(DEG)), degrees=True, columns=columns)
        np.testing.assert_allclose(found.Q, Q)
        np.testing.assert_allclose(found.t, T)
    bare, how = DEG.round() + 2, {"degrees": True, "columns": ["t=1", *"765432"]}
    found = read(table([], timed(bare, [2, 1]))[1:], **how)
    np.testing.assert_allclose(found.Q, np.radians(bare)[:, ::-1])
    with pytest.raises(ConfigurationError, match="--columns has 2"):
        read(table(heads, timed(DEG)), degrees=True, columns=["a", "b"])
    with pytest.raises(ConfigurationError, match="no column 'x'"):
        read(table(heads, timed(DEG)), degrees=True, columns=[*"abcde", "x"])


def test_units_can_be_said(read):
    for name, text, few in (
        ("a.yaml", yaml_points(float), True), ("b.csv", table(UR5, DEG), False),
    ):  # fmt: skip
        notes = read(text, name, degrees=True).notes
        assert any(note.startswith("no angle exceeds 6.3°") for note in notes) is few
    with pytest.raises(ConfigurationError, match="a comment says units: degrees, the option"):
        read("# units: deg\n" + table(UR5, DEG), degrees=False)
    with pytest.raises(ConfigurationError, match="says degrees"):
        read(table(numbered("J{} (deg)"), DEG), degrees=False)
    for program in ("path.script", "degrees.script"):
        with pytest.raises(ConfigurationError, match="says radians"):
            read(BARE[program], program, degrees=True)
        notes = read(BARE[program], program).notes
        assert notes == (f"{len(Q)} joint moves, joints base to tip; no times",)
    found = read("# at 9 deg/s\n" + table([], Q, " ")[1:], "comment.txt")
    np.testing.assert_allclose(found.Q, Q)
    found = read("# J1 [deg] J2 [deg]\n" + table([], DEG, " ")[1:], "comment.txt", degrees=True)
    np.testing.assert_allclose(found.Q, Q)


def test_the_command_takes_columns_and_units(tmp_path):
    (tmp_path / "a.csv").write_text(table(["when", *"abcdef"], timed(DEG)))
    (tmp_path / "deg.csv").write_text(table(numbered("J{} (deg)"), DEG))
    how = ("--units", "deg", "--columns", "t=when,a,b,c,d,e,f")
    done = run("check", "ur5", tmp_path / "a.csv", *how)
    plain = run("check", "ur5", tmp_path / "deg.csv")
    assert done.exit_code == 0, done.stderr
    assert "elbow_joint = 'c'" in done.stderr
    assert plain.exit_code == 0, plain.stderr


@pytest.mark.parametrize(
    ("head", "t", "said"),
    [
        ("timestamp", [0, 8], True), ("t", [0, 1000.5], True), ("t", [0, 1.5], False),
        ("t [s]", [0, 2000], False),
    ],
)  # fmt: skip
def test_times_that_may_be_milliseconds_are_said_to_be_taken_as_seconds(read, head, t, said):
    notes = read(table([head, *UR5], timed(t=t))).notes
    assert any("t is taken as seconds" in note for note in notes) == said


def test_names_beside_an_array_are_the_joints(read):
    backward = {"q": Q[:, ALPHABET], "joint_names": np.take(UR5, ALPHABET)}
    np.testing.assert_allclose(read(backward, "a.npz").Q, Q)
    heads, times = ["t (ms)", *numbered("J{} (deg)")], timed(DEG, T * 1e3)
    parts = np.column_stack([np.floor(T), T % 1 * 1e9, DEG])
    for held in (
        {"q": times, "names": heads}, {"q": times[:, 1:], "names": heads[1:], "t": T},
        {"q": parts, "names": ["sec", "nanosec", *heads[1:]]},
    ):  # fmt: skip
        found = read(held, "a.npz")
        np.testing.assert_allclose(np.column_stack([found.t, found.Q]), timed())
    both = read({"q": times, "names": heads, "t": T + 1}, "a.npz")
    assert both.t.tolist() == (T + 1).tolist()
    assert both.notes[0].startswith("columns: shoulder_pan_joint = 'J1 (deg)'")
    assert both.notes[1:] == ("times are those of 't', not of the column of 'q'",)
    with pytest.raises(ConfigurationError, match="each of the 6 names in 'names'"):
        read({"q": Q[:, :5], "names": UR5}, "a.npz")


def test_a_joint_that_slides_takes_no_angles(read):
    assert arm_of("stanford").prismatic.tolist() == [False, False, True, False, False, False]
    text = table([*numbered("J{} (deg)")[:5], "J6 (mm)"], DEG)
    with pytest.raises(ConfigurationError, match=r"'J3 .deg.* which slides.*--columns"):
        read(text, arm="stanford")
    found = read(text, arm="stanford", columns=[*"126345"])
    np.testing.assert_allclose(found.Q[:, 2:4], DEG[:, [5, 2]] * [1e-3, np.pi / 180])


def test_a_joint_that_is_locked_on_the_chain_has_to_stay_there(tmp_path: Path) -> None:
    arm = load("ur5", joints=[*UR5[:2], *UR5[3:]])
    path, right = tmp_path / "log.csv", np.full((3, 6), 5.0)
    right[:, 2] = 0
    path.write_text(table(UR5, right))
    np.testing.assert_allclose(read_trajectory(path, arm, True).Q, np.radians(5))
    for unit in ("", " (deg)"):
        path.write_text(table([name + unit for name in UR5], right + 5))
        with pytest.raises(ConfigurationError, match=f"log.csv: joint '{UR5[2]}' is locked"):
            read_trajectory(path, arm, True)


@pytest.mark.parametrize(
    ("name", "held", "said"),
    [
        ("no.npz", {"x": Q}, "array 'q'"),
        ("back.npz", {"q": Q, "t": [1, 0]}, "ascend"),
        ("nan.npz", {"q": Q, "t": [0, np.nan]}, "nan"),
        ("one.npz", {"q": Q, "t": 1.0}, "'t' needs 2 times, one a sample; got ..$"),
        ("across.npz", {"q": Q, "t": [[0, 1]]}, "got .1, 2."),
        ("objects.npy", np.array([{}]), "objects.npy"),
        ("hole.npy", np.where(Q == 0.5, np.inf, Q), "inf"),
        ("noise.npy", b"\x93NUMPY nonsense", "noise.npy"),
        ("noise.npz", b"PK nonsense", "noise.npz"),
    ],
)
def test_arrays_that_are_no_trajectory(read, name, held, said):
    def check(found):
        return check_trajectory(arm_of("ur5"), found.Q, found.t)

    with pytest.raises(PinsingError, match=said) as raised:
        check(read(held, name))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("missing.csv", "cannot read"),
        (".", "cannot read"),
        ("back.npz", "back.npz: times must ascend"),
    ],
)
def test_the_command_names_the_file_in_one_line(tmp_path, name, said):
    np.savez(tmp_path / "back.npz", q=Q, t=[1, 0])
    done = run("check", "ur5", tmp_path / name)
    assert (done.exit_code, done.stderr.count("error:")) == (2, 1)
    assert said in done.stderr


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("empty.csv", "", "no sample"),
        ("comment.csv", "# nothing\n\n", "no sample"),
        ("names.csv", "t,a,b\n1,2,3\n", "unknown column 'a'"),
        ("few.csv", "1,2\n", "3 columns"),
        ("short.csv", "1,2,3\n1,2\n", "line"),
        ("lacking.csv", "q1,q2\n1,2\n", "no column for joint"),
        ("twice.csv", "t,t,q1\n1,2,3\n", "twice"),
        ("extra.csv", "q1,q2,q3,extra\n0,1,2,foo\n", "extra"),
        ("bytes.npy", "no array at all", "no NPY file"),
        ("a.csv", "q1,q2,q3\n\n0,1,2\n# so\n0,x,2\n", "a.csv:5: column 2: 'x' is no number"),
        ("a.csv", "0,1,2\n0,1,0x1\n", "a.csv:2: column 3: '0x1' is no number"),
        ("a.csv", "t,q1,q2,q3,time\n0,1,2,3,4\n", "'t' and 'time' are both times"),
        ("a.csv", "q1,q2,q3,q1\n0,1,2,3\n", "'q1' is there twice"),
    ],
)
def test_what_strangers_wrote(read, name, text, said):
    with pytest.raises(ConfigurationError, match=said):
        read(text, name, "planar3r")


def test_text_of_other_encodings_and_longer_numbers(tmp_path):
    arm, path = arm_of("planar3r"), tmp_path / "a.csv"
    path.write_bytes("q1,q2,q3\n0,1,2\n".encode("utf-16-le"))  # without a mark
    with pytest.raises(ConfigurationError, match="UTF-16"):
        read_trajectory(path, arm)
    for code in ("utf-16", "utf-8-sig"):
        path.write_bytes("q1,q2,q3\n\n0,1,2\n".encode(code))
        assert read_trajectory(path, arm).Q.tolist() == [[0, 1, 2]]
        path.write_bytes("q1,q2,q3\n\n0,1,2\n\n0,x,2\n".encode(code))
        with pytest.raises(ConfigurationError, match=r":5: column 2: 'x' is no number"):
            read_trajectory(path, arm)
    np.save(tmp_path / "longer.npy", np.full((2, 3), np.finfo(np.longdouble).max))
    read_trajectory(tmp_path / "longer.npy", arm)


def test_a_pipe_is_read_only_where_the_shell_has_made_it(tmp_path):
    arm = arm_of("planar3r")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ConfigurationError, match="is a pipe"):
        read_trajectory(tmp_path / "pipe", arm)
    out, into = os.pipe()
    os.write(into, b"0,1,2\n0,1,2\n")
    os.close(into)
    assert read_trajectory(Path(f"/dev/fd/{out}"), arm).Q.shape == (2, 3)
    os.close(out)
