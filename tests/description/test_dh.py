"""DH tables: the URDF through Pinocchio equals DH mathematics written independently."""

import math
import pickle
import runpy
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml
from arms import serial
from dh_arms import row_matrix
from golden import Golden
from tiers import sampled, tiered

import pinsing
from pinsing.description.dh_table import dh_to_urdf, read_dh, urdf_folder
from pinsing.description.yaml_tree import parse_number
from pinsing.errors import RobotFileError

ROBOTS = ("stanford", "surgical7", "puma560", "irb1400", "iiwa14", "planar3r", "scara")
GENERATE = Path(__file__).parents[2] / "scripts" / "urdf"


def table_path(name: str) -> Path:
    return urdf_folder() / f"{name}.dh.yaml"


def reference(path: Path) -> pin.Model:
    """Pinocchio's joints where textbooks put them; no line of pinsing, not even to read it."""
    table = yaml.safe_load(path.read_text())
    angle = 1.0 if table["units"]["angle"] == "rad" else np.pi / 180
    length = 1.0 if table["units"]["length"] == "m" else 1e-3
    units = {"alpha": angle, "a": length, "d": length, "theta": angle}

    def number(value: object) -> float:
        return float(eval(str(value), {"pi": np.pi}))  # texts of this folder only

    def place(row: dict[str, object]) -> pin.SE3:
        return pin.SE3(row_matrix(convention, *(number(row[k]) * u for k, u in units.items())))

    convention, joints, beyond = table["convention"], [], pin.SE3.Identity()
    for row in table["rows"]:
        slides, here = row["type"] == "prismatic", place(row)
        limits = [number(x) * (length if slides else angle) for x in row.get("limits", ())]
        # The joint's own motion comes before the rest of a standard row, after that of a modified.
        at, beyond = (beyond, here) if convention == "standard" else (here, pin.SE3.Identity())
        joints.append((pin.JointModelPZ() if slides else pin.JointModelRZ(), at, *limits))
    tool = table.get("tool", {})
    if "alpha" in tool:
        beyond = beyond * place(tool)
    elif tool:
        turns, at = tool.get("rpy", (0, 0, 0)), tool.get("xyz", (0, 0, 0))
        R = pin.rpy.rpyToMatrix(*(number(x) * angle for x in turns))
        beyond = beyond * pin.SE3(R, np.array([number(x) * length for x in at]))
    return serial(joints, beyond)


def tip(model: pin.Model, v: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Placement (4, 4) and Jacobian (6, n) of a frame at the joint values v (n,)."""
    data = model.createData()
    q = pin.integrate(model, pin.neutral(model), v)
    pin.framesForwardKinematics(model, data, q)
    frame = model.getFrameId(name)
    J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
    return data.oMf[frame].homogeneous, J


def assert_same_kinematics(table: pin.Model, model: pin.Model, rng, count: int) -> None:
    assert model.nv == table.nv
    reach = [1 if joint.shortname() == "JointModelPZ" else 4 for joint in table.joints[1:]]
    for v in rng.uniform(-1, 1, (count, table.nv)) * reach:
        for found, expected in zip(tip(model, v, "tool0"), tip(table, v, "tip"), strict=True):
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", sampled(ROBOTS))
def test_shipped_urdf_equals_dh(name: str) -> None:
    table = reference(table_path(name))
    model = pin.buildModelFromUrdf(str(urdf_folder() / f"{name}.urdf"))
    assert_same_kinematics(table, model, np.random.default_rng(1), 150)
    np.testing.assert_allclose(model.lowerPositionLimit, table.lowerPositionLimit, rtol=1e-15)
    np.testing.assert_allclose(model.upperPositionLimit, table.upperPositionLimit, rtol=1e-15)
    assert model.name == name
    assert read_dh(table_path(name)).source


def random_table(rng: np.random.Generator) -> str:
    """A random DH table as YAML text: either convention and unit, all joint types, any tool."""
    degrees, mm = rng.random() < 0.5, rng.random() < 0.5

    def angle() -> str:
        if rng.random() < 0.5:
            quarters = int(rng.integers(-2, 3))
            return str(90 * quarters) if degrees else f"{quarters}*pi/2"
        return repr(float(rng.uniform(-200, 200) if degrees else rng.uniform(-3.5, 3.5)))

    def length() -> str:
        metres = 0.0 if rng.random() < 0.4 else float(rng.uniform(-0.6, 0.6))
        return repr(metres * (1000 if mm else 1))

    def row() -> str:
        return f"alpha: {angle()}, a: {length()}, d: {length()}, theta: {angle()}"

    lines = [
        "name: random", f"convention: {rng.choice(['standard', 'modified'])}",
        f"units: {{angle: {'deg' if degrees else 'rad'}, length: {'mm' if mm else 'm'}}}", "rows:",
    ]  # fmt: skip
    for _ in range(rng.integers(1, 9)):
        kind = rng.choice(["revolute", "prismatic", "continuous"], p=[0.6, 0.25, 0.15])
        limits = "" if kind == "continuous" else ", limits: [-1, 2.5]"
        lines.append(f"  - {{{row()}, type: {kind}{limits}}}")
    xyz, rpy = ([of() for _ in range(3)] for of in (length, angle))
    places = "", f"xyz: [{', '.join(xyz)}], rpy: [{', '.join(rpy)}]", row()
    place = places[rng.integers(3)]
    lines += [f"tool: {{{place}}}"] * bool(place)
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("seed", tiered(range(60), range(8)))
def test_random_tables_equal_dh(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    table = tmp_path / "random.dh.yaml"
    table.write_text(random_table(rng))
    model = pin.buildModelFromXML(dh_to_urdf(read_dh(table)))
    assert_same_kinematics(reference(table), model, rng, 20)


NONE = (
    "|-|pi pi|pi*pi|1/pi|1/0|--1|2**3|__import__('os')|0x10|1_000|1:30|true|nan|inf|1e9999"
    "|pi/2)|1+1|" + "9" * 90
)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("pi/2", math.pi / 2), ("-pi/2", -math.pi / 2), ("- pi", -math.pi),
        ("2*pi/3", 2 * math.pi / 3), ("pi*2/3", 2 * math.pi / 3), ("0.25 * pi", math.pi / 4),
        ("1/3", 1 / 3), ("+.5", 0.5), ("1e-3", 1e-3), ("12.", 12.0),
        *((text, None) for text in NONE.split("|")),
    ],
)  # fmt: skip
def test_numbers_are_exact_and_other_text_is_none(text: str, value: float | None) -> None:
    number = parse_number(text)
    assert value == (None if number is None else number.times())


GOOD = Golden(Path(__file__).with_name("said") / "arm.dh.yaml.txt").good


def test_good_table(tmp_path):
    path = tmp_path / "arm.dh.yaml"
    path.write_text(GOOD)
    table = read_dh(path)
    assert [row.name for row in table.rows] == ["q1", "d2", "spin"]
    assert pin.buildModelFromXML(dh_to_urdf(table)).velocityLimit[2] == 2.0
    # With a tool frame n stays as the flange.
    path.write_text(GOOD + "tool: {xyz: [0, 0, 0.25]}\n")
    model = pin.buildModelFromXML(dh_to_urdf(read_dh(path)))
    flange, tool = (model.frames[model.getFrameId(f)].placement for f in ("flange", "tool0"))
    np.testing.assert_allclose(flange.actInv(tool).translation, [0, 0, 0.25], atol=1e-15)


@pytest.fixture
def run_generate(monkeypatch, capsys):
    """The script in this process, which has imported what it needs."""
    monkeypatch.syspath_prepend(str(GENERATE.parent))

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", [str(GENERATE), *arguments])
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(GENERATE), run_name="__main__")
        return int(ended.value.code or 0), *capsys.readouterr()

    return run


@pytest.mark.slow
def test_shipped_urdfs_are_fresh(run_generate) -> None:
    """Bit for bit what the generator writes: chain, limits and shapes."""
    assert run_generate("--check") == (0, "", "")


@pytest.mark.slow
def test_the_script_lists_what_differs_and_says_what_is_wrong(tmp_path: Path, run_generate) -> None:
    folder = ("--folder", str(tmp_path))
    code, _, said = run_generate(*folder)
    assert (code, "no *.dh.yaml" in said) == (2, True)
    for name in ("planar3r", "scara"):
        (tmp_path / f"{name}.dh.yaml").write_text(table_path(name).read_text())
    code, listed, _ = run_generate("--check", *folder)
    assert (code, "planar3r.urdf" in listed) == (1, True)
    assert not list(tmp_path.glob("*.urdf"))
    assert run_generate(*folder)[0] == run_generate("--check", *folder)[0] == 0
    urdf = tmp_path / "scara.urdf"
    urdf.write_text(urdf.read_text().replace("0.387", "0.388"))
    code, listed, _ = run_generate("--check", *folder)
    assert (code, "scara.urdf" in listed, "planar3r" in listed) == (1, True, False)
    (tmp_path / "bad.dh.yaml").write_text("name: bad\n")
    code, _, said = run_generate(*folder)
    assert (code, "bad.dh.yaml:1: missing key 'convention'" in said) == (2, True)
    assert "Traceback" not in said


@pytest.mark.slow
def test_a_table_is_a_robot(tmp_path):
    path = urdf_folder() / "puma560.dh.yaml"
    by_table, by_urdf = pinsing.load(path), pinsing.load("puma560")
    Q = by_urdf.space.sample(5, np.random.default_rng(0))
    J = pinsing.kinematics.frame_jacobians(by_urdf, Q)
    for arm in (by_table, pickle.loads(pickle.dumps(by_table))):
        assert arm.joints == by_urdf.joints
        assert np.allclose(pinsing.kinematics.frame_jacobians(arm, Q), J, atol=1e-15)
    with pytest.raises(RobotFileError, match="xacro arguments"):
        pinsing.load(path, xacro_args={"a": "1"})
    broken = tmp_path / "x.yaml"
    broken.write_text("rows: [")
    for other in (urdf_folder() / "five_bar.loops.yaml", broken):
        with pytest.raises(RobotFileError):
            pinsing.load(other)
