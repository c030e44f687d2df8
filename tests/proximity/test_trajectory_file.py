"""Trajectory files as people have them: what is a joint, what a time, and in which unit."""

import os
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from dh_arms import arm_of
from golden import Golden

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
FILES = Golden(Path(__file__).with_name("trajectory_files.txt"))


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


@pytest.mark.parametrize("head", FILES.cases)
def test_files_as_people_have_them(read, tmp_path, head):
    """Notes and times, and joint values where these are not those of ``Q``; or the error."""
    name, *words = head.split()
    said = dict(word.split("=", 1) for word in words)
    degrees = {"deg": True, "rad": False}.get(said.get("units"))
    columns = said["columns"].split(",") if "columns" in said else ()
    try:
        found = read(
            FILES.text(head), name, said.get("arm", "ur5"), degrees=degrees, columns=columns
        )
    except ConfigurationError as error:
        FILES.hold(head, f"error: {error}".replace(f"{tmp_path}/", ""))
        return
    lines = [*found.notes]
    if found.t is not None:
        lines.append(f"t: {found.t.round(6).tolist()}")
    if found.Q.shape != Q.shape or not np.allclose(found.Q, Q, rtol=0, atol=1e-6):
        lines.append(f"q: {found.Q.round(6).tolist()}")
    FILES.hold(head, "\n".join(lines))


def test_the_command_takes_columns_and_units_and_names_the_file_in_one_line(tmp_path):
    when = "when.csv units=deg columns=t=when,a,b,c,d,e,f"
    (tmp_path / "when.csv").write_text(FILES.text(when))
    (tmp_path / "axis.csv").write_text(FILES.text("axis.csv"))
    np.savez(tmp_path / "back.npz", q=Q, t=[1, 0])
    how = ("--units", "deg", "--columns", "t=when,a,b,c,d,e,f")
    for name, options, code, said in (
        ("when.csv", how, 0, "elbow_joint = 'c'"),
        ("axis.csv", (), 0, "elbow_joint = 'Axis 3 (deg)'"),
        ("missing.csv", (), 2, "cannot read"),
        (".", (), 2, "cannot read"),
        ("back.npz", (), 2, "back.npz: times must ascend"),
    ):
        done = run("check", "ur5", tmp_path / name, *options)
        assert (done.exit_code, done.stderr.count("error:")) == (code, code // 2), done.stderr
        assert said in done.stderr


def test_names_beside_an_array_are_the_joints(read):
    alphabet, timed = np.argsort(UR5), np.column_stack([T, Q])
    backward = {"q": Q[:, alphabet], "joint_names": np.take(UR5, alphabet)}
    np.testing.assert_allclose(read(backward, "a.npz").Q, Q)
    heads = ["t (ms)", *(f"J{k} (deg)" for k in range(1, 7))]
    times = np.column_stack([T * 1e3, DEG])
    parts = np.column_stack([np.floor(T), T % 1 * 1e9, DEG])
    for held in (
        {"q": times, "names": heads}, {"q": times[:, 1:], "names": heads[1:], "t": T},
        {"q": parts, "names": ["sec", "nanosec", *heads[1:]]},
    ):  # fmt: skip
        found = read(held, "a.npz")
        np.testing.assert_allclose(np.column_stack([found.t, found.Q]), timed)
    both = read({"q": times, "names": heads, "t": T + 1}, "a.npz")
    assert both.t.tolist() == (T + 1).tolist()
    assert both.notes[0].startswith("columns: shoulder_pan_joint = 'J1 (deg)'")
    assert both.notes[1:] == ("times are those of 't', not of the column of 'q'",)


def test_a_joint_that_is_locked_on_the_chain_has_to_stay_there(tmp_path: Path) -> None:
    arm = load("ur5", joints=[*UR5[:2], *UR5[3:]])
    path = tmp_path / "log.csv"
    path.write_text(",".join(UR5) + "\n5,5,0,5,5,5\n")
    np.testing.assert_allclose(read_trajectory(path, arm, True).Q, np.radians(5))
    for unit in ("", " (deg)"):
        path.write_text(f"{unit},".join(UR5) + unit + "\n10,10,5,10,10,10\n")
        with pytest.raises(ConfigurationError, match=f"log.csv: joint '{UR5[2]}' is locked"):
            read_trajectory(path, arm, True)


@pytest.mark.parametrize(
    ("name", "held", "said"),
    [
        ("no.npz", {"x": Q}, "array 'q'"),
        ("back.npz", {"q": Q, "t": [1, 0]}, "ascend"),
        ("nan.npz", {"q": Q, "t": [0, np.nan]}, "nan"),
        ("twice.npz", {"q": np.column_stack([T, Q]), "t": T}, "leave one out"),
        ("one.npz", {"q": Q, "t": 1.0}, "'t' needs 2 times, one a sample; got ..$"),
        ("across.npz", {"q": Q, "t": [[0, 1]]}, "got .1, 2."),
        ("five.npz", {"q": Q[:, :5], "names": UR5}, "each of the 6 names in 'names'"),
        ("objects.npy", np.array([{}]), "objects.npy"),
        ("hole.npy", np.where(Q == 0.5, np.inf, Q), "inf"),
        ("noise.npy", b"\x93NUMPY nonsense", "noise.npy"),
        ("noise.npz", b"PK nonsense", "noise.npz"),
        ("a.xlsx", b"PK\x03\x04\x14", "a workbook .*: save its table as CSV"),
        ("broken.yaml", b"joint_names: [a\n", "cannot read .*broken.yaml:2: not valid YAML"),
        ("marked.csv", "q1,q2\n0,1\n".encode("utf-16-le"), "UTF-16"),  # without a mark
    ],
)  # fmt: skip
def test_what_is_no_trajectory(read, name, held, said):
    def check():
        found = read(held, name)
        check_trajectory(arm_of("ur5"), found.Q, found.t)

    with pytest.raises(PinsingError, match=said) as raised:
        check()
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("code", ["utf-16", "utf-8-sig"])
def test_text_of_other_encodings_and_longer_numbers(read, code):
    text = "q1,q2,q3\n\n0,1,2\n"
    assert read(text.encode(code), arm="planar3r").Q.tolist() == [[0, 1, 2]]
    with pytest.raises(ConfigurationError, match=r":5: column 2: 'x' is no number"):
        read(f"{text}\n0,x,2\n".encode(code), arm="planar3r")
    read(np.full((2, 3), np.finfo(np.longdouble).max), "longer.npy", "planar3r")


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
