"""Meshes are read in a child with limits; one that fails is left out and named."""

import json
import struct
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from command_line import python
from urdf_texts import LIMIT, joint

from pinsing import load
from pinsing.view import meshes
from pinsing.view.meshes import read_meshes
from pinsing.view.scene import read_links

NAN, INF = float("nan"), float("inf")
ROBOT = '<robot name="r">{}</robot>'
BOMB = bytes.fromhex("676c544602000000fffffffff0ffffff4a534f4e7b7d")


def stl(*corners: tuple[float, float, float]) -> bytes:
    count = len(corners) // 3
    body = b"".join(
        struct.pack("<12fH", 0, 0, 1, *corners[3 * i], *corners[3 * i + 1], *corners[3 * i + 2], 0)
        for i in range(count)
    )
    return bytes(80) + struct.pack("<I", count) + body


def glb() -> bytes:
    """One triangle, the binary form of glTF."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
    bounds = {"min": [0, 0, 0], "max": [1, 1, 0]}
    accessor = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", **bounds}
    header = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "accessors": [accessor],
        "bufferViews": [{"buffer": 0, "byteLength": len(points)}],
        "buffers": [{"byteLength": len(points)}],
    }  # fmt: skip
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text
    body += struct.pack("<II", len(points), 0x004E4942) + points
    return struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body


GOOD = stl((0, 0, 0), (1, 0, 0), (0, 1, 0))
PLY = b"""ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 2 0
3 0 1 2
"""
BAD = {
    "bomb.glb": BOMB, "text.stl": b"this is not a mesh",
    "nan.stl": stl((NAN, 0, 0), (1, 0, 0), (0, 1, 0)),
    "inf.stl": stl((INF, 0, 0), (1, 0, 0), (0, 1, 0)),
    "far.stl": stl((1e30, 0, 0), (1, 0, 0), (0, 1, 0)), "empty.stl": b"",
    "many.stl": bytes(80) + struct.pack("<I", 2**32 - 1) + GOOD[84:],
    "short.obj": b"v 0 0 0\nf 1 2 999999999\n",
    "nan.obj": b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "deep.dae": b"<COLLADA>" * 5000,
    "count.ply": PLY.replace(b"vertex 3", b"vertex 4000000000"),
}  # fmt: skip


def robot_with(*names: str, scale: str = "1 1 1") -> str:
    shapes = "".join(
        f'<visual><geometry><mesh filename="{name}" scale="{scale}"/></geometry></visual>'
        for name in names
    )
    links = f'<link name="a"/><link name="b">{shapes}</link><link name="c"/>'
    end = joint("j2", "b", "c", inner='<origin xyz="0 0 1"/><axis xyz="0 1 0"/>' + LIMIT)
    return ROBOT.format(links + joint("j1", "a", "b") + end)


@pytest.mark.slow
@pytest.mark.parametrize("names", [BAD, *(pytest.param([n], marks=pytest.mark.slow) for n in BAD)])
def test_meshes_that_fail_are_named_and_the_others_are_read(names, tmp_path):
    """One in bad company, and all of them in one reading."""
    contents = {"first.stl": GOOD, **{name: BAD[name] for name in names}, "last.ply": PLY}
    paths = [tmp_path / name for name in contents]
    for path, content in zip(paths, contents.values(), strict=True):
        path.write_bytes(content)
    first, *failed, last = read_meshes(paths).values()
    assert first == ()  # the page gets the file
    assert len(failed) == len(names)
    for bad in failed:
        assert isinstance(bad, str)
        assert bad
        assert "\n" not in bad
    np.testing.assert_array_equal(last[0].vertices, [[0, 0, 0], [1, 0, 0], [0, 2, 0]])
    np.testing.assert_array_equal(last[0].faces, [[0, 1, 2]])


def test_a_bomb_finds_no_memory_and_what_is_no_file_no_reader(tmp_path):
    (tmp_path / "a.glb").write_bytes(BOMB)
    (tmp_path / "folder.stl").mkdir()
    names = [tmp_path / name for name in ("a.glb", "none.stl", "folder.stl")]
    assert all(
        isinstance(found, str) for found in read_meshes([*names, Path("/dev/zero")]).values()
    )
    assert meshes.MEMORY <= 2 * 2**30  # its reader may have no more; it asks for 4.3 GiB


def by_another(tmp_path, monkeypatch, code, seconds=None, said=lambda note: None):
    """What is said of good files that another program reads."""
    (tmp_path / "worker.py").write_text(code)
    monkeypatch.setattr(meshes, "_WORKER", tmp_path / "worker.py")
    if seconds is not None:
        monkeypatch.setattr(meshes, "SECONDS_EACH", seconds)
    paths = [tmp_path / "a.stl", tmp_path / "b.stl"]
    for path in paths:
        path.write_bytes(GOOD)
    return [str(found) for found in read_meshes(paths, said).values()]


@pytest.mark.slow
def test_a_reader_that_does_not_end_is_ended(tmp_path, monkeypatch):
    found = by_another(tmp_path, monkeypatch, "import time; time.sleep(60)", 0.3)
    assert all("not read within 0.3 s" in text for text in found)


@pytest.mark.slow
def test_processor_time_is_what_a_mesh_may_use_up(tmp_path, monkeypatch):
    jail = Path(meshes.child_jail.__file__)
    code = (
        f"import sys; sys.path.insert(0, {str(jail.parent)!r}); import child_jail\n"
        "child_jail.begin_work(0.3)\nprint('{\"no_wall\": []}', flush=True)\nwhile True: pass\n"
    )
    found = by_another(tmp_path, monkeypatch, code, 100.0)
    assert all("is not read within 100 s" in text for text in found)


WALLS = """
import sys
sys.path.insert(0, {jail!r})
import child_jail
print(child_jail.read_only_below([{folder!r}, "/nowhere"]), flush=True)
for name in ({inside!r}, {outside!r}, {link!r}, "/etc/passwd"):
    try:
        open(name).close()
        print("open")
    except PermissionError:
        print("refused")
try:
    open({inside!r} + "2", "w")
    print("open")
except PermissionError:
    print("refused")
"""


def test_the_reader_of_meshes_sees_their_folders_only(tmp_path):
    folder = tmp_path / "meshes"
    folder.mkdir()
    (folder / "a.stl").write_bytes(GOOD)
    (tmp_path / "secret").write_text("password")
    (folder / "link.stl").symlink_to(tmp_path / "secret")
    script = WALLS.format(
        jail=str(Path(meshes.child_jail.__file__).parent),
        folder=str(folder),
        inside=str(folder / "a.stl"),
        outside=str(tmp_path / "secret"),
        link=str(folder / "link.stl"),
    )
    done = python("-c", script)
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done.stderr
    if lines[0]:
        pytest.skip(lines[0])
    assert lines == ["", "open", "refused", "refused", "refused", "refused"]


def test_a_wall_that_is_not_there_is_said(tmp_path, monkeypatch):
    said = []
    code = """print('{"no_wall": ["Landlock is not there"]}', flush=True)"""
    by_another(tmp_path, monkeypatch, code, said=said.append)
    assert set(said) == {
        "meshes were read without all of the kernel's walls: Landlock is not there"
    }


def test_a_reader_that_dies_is_started_again(tmp_path, monkeypatch):
    found = by_another(tmp_path, monkeypatch, "import os; os.kill(os.getpid(), 11)")
    assert all("breaks its reader" in text for text in found)


@pytest.mark.slow
def test_nothing_is_said_on_stderr_but_by_us(tmp_path):
    for name, content in BAD.items():
        (tmp_path / name).write_bytes(content)
    file = tmp_path / "arm.urdf"
    file.write_text(robot_with(*BAD))
    words = ["view", file, "--task", "wx,wz", "-o", tmp_path / "page.html"]
    done = python("-m", "pinsing", *words, timeout=120)
    assert done.returncode == 0, done.stderr
    assert all(word not in done.stderr for word in ("Assimp", "assimp", "ERROR", "Traceback"))
    assert done.stderr.count("is not drawn") >= 3


@pytest.mark.slow
def test_geometry_is_that_of_pinocchio(tmp_path):
    (tmp_path / "good.stl").write_bytes(GOOD)
    (tmp_path / "part.ply").write_bytes(PLY)
    file = tmp_path / "arm.urdf"
    file.write_text(robot_with("good.stl", "part.ply", scale="0.5 2 1"))
    source = load(file, task="wx,wz").source
    ours, read, notes = meshes.read_geometry(source.full_model, source.xml)
    theirs = pin.buildGeomFromUrdfString(source.full_model, source.xml, pin.VISUAL)
    assert notes == ()
    assert [g.name for g in ours.geometryObjects] == [g.name for g in theirs.geometryObjects]
    for mine, their in zip(ours.geometryObjects, theirs.geometryObjects, strict=True):
        assert (mine.meshPath, mine.parentJoint) == (their.meshPath, their.parentJoint)
        assert mine.placement.isApprox(their.placement)
        np.testing.assert_array_equal(mine.meshScale, their.meshScale)
        np.testing.assert_array_equal(mine.meshColor, their.meshColor)
    (part,) = read[tmp_path / "part.ply"]
    np.testing.assert_array_equal(part.vertices, [[0, 0, 0], [1, 0, 0], [0, 2, 0]])


def test_meshes_read_once_are_read_from_the_disk(tmp_path, monkeypatch):
    monkeypatch.setenv("PINSING_CACHE", str(tmp_path / "cache"))
    file = tmp_path / "one.ply"
    file.write_bytes(PLY)
    (first,) = meshes.read_meshes([file])[file]
    (kept,) = (tmp_path / "cache" / "meshes").iterdir()
    asked: list[object] = []
    monkeypatch.setattr(meshes, "_ask_child", lambda paths, _: asked.append(paths) or {})
    (again,) = meshes.read_meshes([file])[file]
    for new, old in zip(again, first, strict=True):
        np.testing.assert_array_equal(new, old)
    assert not asked
    # Neither a damaged entry nor another content is taken for it.
    kept.write_bytes(kept.read_bytes()[:-1] + b"x")
    meshes.read_meshes([file])
    assert len(asked) == 1
    file.write_text(file.read_text().replace("1 0 0", "2 0 0"))
    meshes.read_meshes([file])
    assert len(asked) == 2


def test_a_cache_that_others_may_write_is_not_used(tmp_path, monkeypatch):
    from pinsing.view.meshes import cache_folder

    monkeypatch.setenv("PINSING_CACHE", str(tmp_path))
    folder = cache_folder()
    folder.chmod(0o777)
    assert cache_folder() is None
    monkeypatch.setenv("PINSING_CACHE", "")
    assert cache_folder() is None
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("PINSING_CACHE", str(tmp_path / "file"))
    assert cache_folder() is None


def test_a_texture_is_an_image_from_beside_the_mesh(tmp_path: Path) -> None:
    from pinsing.view.scene import _textures

    inside = tmp_path / "robot" / "meshes"
    inside.mkdir(parents=True)
    (tmp_path / "secret.png").write_bytes(b"\x89PNG\r\n\x1a\n secret")
    (inside / "real.png").write_bytes(b"\x89PNG\r\n\x1a\n real")
    (inside / "text.png").write_text("password")
    names = ["real.png", "text.png", "../../secret.png", str(tmp_path / "secret.png"), "none.png"]
    images = "".join(f"<image><init_from>{name}</init_from></image>" for name in names)
    file = inside / "link.dae"
    file.write_text(
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">'
        f"<library_images>{images}</library_images></COLLADA>"
    )
    assert list(_textures(file)) == ["real.png"]


CAPSULE = """<robot name="pill"><link name="base"/><link name="arm"><visual>
<origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/><geometry><capsule radius="{}" length="{}"/></geometry>
<material name="black"><color rgba="0.02 0.02 0.02 1"/></material></visual></link>
<joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
</joint></robot>"""


@pytest.mark.parametrize("turn", ['rpy="0.4 0.5 0.6"', 'quat_xyzw="{} {} {} {}"'])
def test_a_capsule_is_a_cylinder_with_round_ends(turn: str) -> None:
    turn = turn.format(*pin.Quaternion(pin.rpy.rpyToMatrix(0.4, 0.5, 0.6)).coeffs())
    text = CAPSULE.replace("<robot", '<robot version="1.1"').replace('rpy="0.4 0.5 0.6"', turn)
    arm = load(text.format(0.05, 0.4), task="wz")
    geometry = read_links(arm).geometry
    found = list(geometry.geometryObjects)
    assert [type(g.geometry).__name__ for g in found] == ["Cylinder", "Sphere", "Sphere"]
    place = pin.SE3(pin.rpy.rpyToMatrix(0.4, 0.5, 0.6), np.array([0.1, 0.2, 0.3]))
    for g, along in zip(found, (0.0, 0.2, -0.2), strict=True):
        expected = place * pin.SE3(np.eye(3), np.array([0.0, 0.0, along]))
        np.testing.assert_allclose(g.placement.homogeneous, expected.homogeneous, atol=1e-12)
        np.testing.assert_allclose(g.meshColor, [0.02, 0.02, 0.02, 1.0])
        assert g.geometry.radius == 0.05
    assert found[0].geometry.halfLength == pytest.approx(0.2)


def test_a_capsule_of_negative_length_is_left_out() -> None:
    arm = load(CAPSULE.format(0.05, -0.4), task="wz")
    geometry = read_links(arm).geometry
    assert geometry is None or not len(geometry.geometryObjects)
    assert any("cannot be read is left out" in note for note in arm.notes)
