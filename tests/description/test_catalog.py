"""Robots known by name, and what a user means by the text of a robot."""

import sys
from pathlib import Path

import pytest

from pinsing.description.catalog import data_folder, find_robot, known_robots, locate_robot
from pinsing.errors import RobotFileError, UnknownNameError

# Names that the loaders of example-robot-data give.
LOADERS = [
    "ur3", "ur5", "ur5_limited", "ur10", "panda", "xarm7", "z1", "talos", "talos_arm", "tiago",
    "tiago_no_hand", "tiago_pro", "pr2", "baxter", "romeo", "kinova", "icub", "g1", "so100",
    "so101", "anymal_kinova", "solo8",
]  # fmt: skip
OWN = {"stanford", "surgical7", "puma560", "irb1400", "iiwa14", "planar3r", "scara"}


def test_every_file_has_a_name_and_every_name_a_file():
    entries = known_robots()
    folder = data_folder()
    files = set(folder.rglob("*.urdf"))
    assert len(files) >= 69
    assert files <= {entry.path for entry in entries.values()}
    assert all(entry.path.is_file() and entry.name == name for name, entry in entries.items())
    assert list(entries) == sorted(entries)
    # exactly one name of each file is the main one
    own = [entry for entry in entries.values() if entry.path.suffix == ".urdf"]
    main = [entry.path for entry in own if entry.alias_of is None]
    assert len(main) == len(set(main)) == len({entry.path for entry in own})
    for entry in entries.values():
        if entry.alias_of is not None:
            assert entries[entry.alias_of].path == entry.path
            assert entries[entry.alias_of].alias_of is None


def test_entries():
    entries = known_robots()
    assert entries["anymal"].path.parts[-3] == "anymal_b_simple_description"
    assert entries["anymal_c"].path.parts[-3] == "anymal_c_simple_description"
    assert entries["iris"].path.name == "iris_simple.urdf"
    assert entries["iris_iris"].path.name == "iris.urdf"
    assert "take ur3" in entries["ur_ur3"].note
    assert set(entries) >= OWN
    assert all(entries[name].source == "pinsing" for name in OWN)
    assert entries["stanford"].title == "Stanford arm"
    for name in (*LOADERS, *OWN):  # found at once
        assert find_robot(name) == entries[name]


def test_what_a_user_means(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = locate_robot("ur5")
    assert not isinstance(found, Path)
    assert found.name == "ur5"
    (tmp_path / "panda").mkdir()
    assert not isinstance(locate_robot("panda"), Path)
    (tmp_path / "ur5").write_text("<robot/>")
    assert locate_robot("ur5") == Path("ur5")
    assert locate_robot(tmp_path / "ur5") == tmp_path / "ur5"
    assert locate_robot(str(tmp_path)) == tmp_path
    for title in ("LR Mate 200iD/7", "fanuc lr-mate 200iD/7", "LR Mate 200iD 7"):
        assert locate_robot(title).name == "lrmate200id"
    for title in ("M-10iD/12", "Fanuc M-10iD/12", "M-10/12-14D"):  # a title of two names
        assert locate_robot(title).name == "m10id"
    assert locate_robot("CRB 15000-10/1.52").name == "gofa10"
    with pytest.raises(UnknownNameError, match="did you mean 'gen3_6' or 'gen3_7'"):
        locate_robot("Kinova Gen3")
    assert locate_robot("CRX-10iA/L").name == "crx10ia_l"
    (tmp_path / "CRX-10iA").mkdir()
    (tmp_path / "CRX-10iA" / "L").write_text("<robot/>")
    assert locate_robot("CRX-10iA/L") == Path("CRX-10iA/L")
    plain = ("ur5.urdf", "./ur10", "./g1", "double/pendulum", "x/y", "my.XACRO")
    for path in (*plain, Path("double_pendulum"), Path("ur10")):
        with pytest.raises(RobotFileError, match="no such file") as caught:
            locate_robot(path)
        assert caught.value.path == Path(path)
    with pytest.raises(UnknownNameError, match="no file of that name either"):
        locate_robot("nonesuch")
    for text in ("a\0b", "~"):
        with pytest.raises(RobotFileError):
            locate_robot(text)
    assert locate_robot("") == Path()


def test_without_the_data_package(monkeypatch):
    monkeypatch.setattr(sys, "path", ["", str(Path(__file__).parent)])
    assert data_folder() is None
    assert set(known_robots()) >= OWN
    with pytest.raises(UnknownNameError):
        find_robot("ur5")
