"""Meshes are read in a child with limits; one that fails is left out and named. Collada files."""

import re
import struct
import time
from pathlib import Path
from types import SimpleNamespace

import coal
import numpy as np
import pinocchio as pin
import pytest
from arms import place
from command_line import python
from pages import baked
from tiers import tiered
from urdf_texts import robot

import pinsing
from pinsing import load
from pinsing.description import files as references
from pinsing.view import collada as collada_reader, meshes
from pinsing.view.collada import NotPlainError, Painted, packed, read_collada, unpacked
from pinsing.view.meshes import cache_folder, read_meshes
from pinsing.view.scene import Recorder, SceneNode, _surface, _textures, draw_links, read_links

NAN, INF = float("nan"), float("inf")


def stl(*corners: tuple[float, float, float]) -> bytes:
    """One triangle."""
    return bytes(80) + struct.pack("<I12fH", 1, 0, 0, 1, *np.ravel(corners), 0)


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
    "bomb.glb": bytes.fromhex("676c544602000000fffffffff0ffffff4a534f4e7b7d"),
    "text.stl": b"this is not a mesh",
    "nan.stl": stl((NAN, 0, 0), (1, 0, 0), (0, 1, 0)),
    "inf.stl": stl((INF, 0, 0), (1, 0, 0), (0, 1, 0)),
    "far.stl": stl((1e30, 0, 0), (1, 0, 0), (0, 1, 0)), "empty.stl": b"",
    "many.stl": bytes(80) + struct.pack("<I", 2**32 - 1) + GOOD[84:],
    "short.obj": b"v 0 0 0\nf 1 2 999999999\n",
    "nan.obj": b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "deep.dae": b"<COLLADA>" * 5000,
    "count.ply": PLY.replace(b"vertex 3", b"vertex 4000000000"),
}  # fmt: skip


SINGLY = [[name] for name in BAD]


@pytest.mark.parametrize("names", tiered([*SINGLY, list(BAD)], SINGLY[:1]), ids=" ".join)
def test_meshes_that_fail_are_named_and_the_others_are_read(names, tmp_path):
    """Beside what is no file: one in bad company, and all of them in one reading."""
    contents = {"first.stl": GOOD, **{name: BAD[name] for name in names}, "last.ply": PLY}
    paths = [tmp_path / name for name in contents]
    for path, content in zip(paths, contents.values(), strict=True):
        path.write_bytes(content)
    (tmp_path / "folder.stl").mkdir()
    paths[1:1] = [tmp_path / "folder.stl", tmp_path / "none.stl", Path("/dev/zero")]
    first, *failed, last = read_meshes(paths).values()
    assert first == ()  # the page gets the file
    assert len(failed) == len(names) + 3
    for bad in failed:
        assert re.fullmatch(".+", bad)
    assert last[0].vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 2, 0]]
    assert last[0].faces.tolist() == [[0, 1, 2]]
    assert meshes.MEMORY <= 2 * 2**30  # the bomb's reader may have no more; it asks for 4.3 GiB


IN_JAIL = f"""
import sys
sys.path.insert(0, {str(Path(meshes.child_jail.__file__).parent)!r})
import child_jail
"""
SPINS = """child_jail.begin_work(0.3)
sys.stdout.buffer.write(b"\\x90"), sys.stdout.flush()
while True: pass
"""
SLEEPS, DIES = "import time; time.sleep(60)", "import os; os.kill(os.getpid(), 11)"
OPEN = r'import sys; sys.stdout.buffer.write(b"\x91\xb5Landlock is not there")'


@pytest.mark.parametrize(
    ("code", "seconds", "found", "noted"),
    [
        pytest.param(SLEEPS, 0.3, "is not read within 0.3 s", [], marks=pytest.mark.slow),
        pytest.param(IN_JAIL + SPINS, 100.0, "not read within 100 s", [], marks=pytest.mark.slow),
        (DIES, 20.0, "breaks its reader", []),
        (OPEN, 20.0, "breaks its reader",
         ["meshes were read without all of the kernel's walls: Landlock is not there"]),
    ],
    ids=["does not end", "uses up its processor time", "dies", "has not all walls"],
)  # fmt: skip
def test_a_reader_that_fails_is_started_again(tmp_path, monkeypatch, code, seconds, found, noted):
    (tmp_path / "worker.py").write_text(code)
    monkeypatch.setattr(meshes, "_WORKER", tmp_path / "worker.py")
    monkeypatch.setattr(meshes, "SECONDS_EACH", seconds)
    paths, said = [tmp_path / "a.stl", tmp_path / "b.stl"], []
    for path in paths:
        path.write_bytes(GOOD)
    read = read_meshes(paths, said.append).values()
    assert [found in str(mesh) for mesh in read] == [True, True]
    assert said == noted


WALLS = """
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
    inside, link, outside = folder / "a.stl", folder / "link.stl", tmp_path / "secret"
    names = {"folder": folder, "inside": inside, "link": link, "outside": outside}
    done = python("-c", IN_JAIL + WALLS.format(**{k: str(v) for k, v in names.items()}))
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done.stderr
    if lines[0]:
        pytest.skip(lines[0])
    assert lines == ["", "open", "refused", "refused", "refused", "refused"]


@pytest.mark.slow
def test_bones_stand_for_meshes_that_are_missing_or_broken_and_we_alone_say_so(tmp_path):
    for name, content in BAD.items():
        (tmp_path / name).write_bytes(content)
    file, out = tmp_path / "arm.urdf", tmp_path / "page.html"
    visual = '<visual><geometry><mesh filename="{}"/></geometry></visual>'
    shapes = "".join(map(visual.format, ("package://nowhere/a.dae", *BAD)))
    file.write_text(robot(links="ac", extra=f'<link name="b">{shapes}</link>'))
    done = python("-m", "pinsing", "view", file, "--task", "wz", "-o", out, timeout=120)
    assert done.returncode == 0, done.stderr
    assert all(word not in done.stderr for word in ("Assimp", "assimp", "ERROR", "Traceback"))
    assert done.stderr.count("is not drawn") >= 3
    page = baked(out.read_text(encoding="utf-8"))
    assert page["settings"]["bare"] == [1, 2]
    for name in ("nowhere/a.dae", "text.stl"):
        assert any(name in note for note in page["notes"])


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
    monkeypatch.setenv("PINSING_CACHE", str(tmp_path))
    cache_folder().chmod(0o777)
    (tmp_path / "file").write_text("")
    for named in (tmp_path, "", tmp_path / "file"):
        monkeypatch.setenv("PINSING_CACHE", str(named))
        assert cache_folder() is None


def test_a_texture_is_an_image_from_beside_the_mesh(tmp_path: Path) -> None:
    inside, secret = tmp_path / "robot" / "meshes", tmp_path / "secret.png"
    inside.mkdir(parents=True)
    for image in (secret, inside / "real.png"):
        image.write_bytes(b"\x89PNG\r\n\x1a\n")
    (inside / "text.png").write_text("password")
    names = ["real.png", "text.png", "../../secret.png", str(secret), "none.png"]
    images = "".join(f"<image><init_from>{name}</init_from></image>" for name in names)
    file = inside / "link.dae"
    file.write_text(
        square("<library_eff", f"<library_images>{images}</library_images><library_eff")
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
    found = list(read_links(arm).geometry.geometryObjects)
    assert [type(g.geometry).__name__ for g in found] == ["Cylinder", "Sphere", "Sphere"]
    middle = place((0.1, 0.2, 0.3), pin.rpy.rpyToMatrix(0.4, 0.5, 0.6))
    for g, along in zip(found, (0.0, 0.2, -0.2), strict=True):
        expected = middle * place((0, 0, along))
        np.testing.assert_allclose(g.placement.homogeneous, expected.homogeneous, atol=1e-12)
        np.testing.assert_allclose(g.meshColor, [0.02, 0.02, 0.02, 1.0])
        assert g.geometry.radius == 0.05
    assert found[0].geometry.halfLength == pytest.approx(0.2)


def test_a_capsule_of_negative_length_is_left_out() -> None:
    arm = load(CAPSULE.format(0.05, -0.4), task="wz")
    geometry = read_links(arm).geometry
    assert geometry is None or not len(geometry.geometryObjects)
    assert any("cannot be read is left out" in note for note in arm.notes)


pytestmark = pytest.mark.filterwarnings("ignore:the matrix subclass")  # pycollada's

SQUARE = (Path(__file__).parent / "square.dae").read_text(encoding="utf-8")
INDEX = "0 0 1 0 2 0 3 0"


def square(*changes: str) -> str:
    """A painted square within one node; what stands there, and what shall, in turn."""
    text = SQUARE
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        assert old in text
        text = text.replace(old, new)
    return text


def read(text: str) -> tuple[Painted, ...]:
    return read_collada(text.encode())


def corners_of(part: Painted) -> np.ndarray:
    return part.vertices[:, :3] * part.place[3] + part.place[:3]


def area(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_a_polygon_is_painted_and_placed_by_its_node() -> None:
    node = "<translate>0 0 5</translate><rotate>1 0 0 90</rotate><scale>2 2 2</scale>"
    (part,) = read(square("<node>", f"<node>{node}"))
    assert (part.paint[0], len(part.faces)) == (0xFF8000, 2)
    # Scaled by two, turned about x (y becomes z), lifted by five.
    corners = {tuple(row) for row in np.round(corners_of(part), 3) + 0.0}
    assert corners == {(0, 0, 5), (2, 0, 5), (2, 0, 7), (0, 0, 7)}
    assert part.normals[:, :3].tolist() == [[0, -127, 0]] * 4


@pytest.mark.parametrize(
    ("more", "opacity"),
    [
        ("", 1.0),
        ("<transparency><float>0.25</float></transparency>", 0.25),
        ('<transparent opaque="RGB_ZERO"><color>0.25 0 0 1</color></transparent>', 0.75),
        ('<transparent opaque="A_ONE"><color>0 0 0 0.5</color></transparent>', 0.5),
        ("<transparency><float>0</float></transparency>", 1.0),  # nobody could see it
    ],
)
def test_opacity_is_that_of_the_specification(more: str, opacity: float) -> None:
    (part,) = read(square("</diffuse>", f"</diffuse>{more}"))
    assert part.paint[4] == pytest.approx(opacity)


@pytest.mark.parametrize(
    "changes",
    [
        (SQUARE, ""), (SQUARE, "<a/>"), ("<vcount>4", "<vcount>5"), (INDEX, "0 0 1 0 2 0 9 0"),
        (INDEX, "0 0 1 0 2 0 -1 0"), ('"#N"', '"#nothing"'), ("0 0 0 1 0 0", "0 0 nan 1 0 0"),
        ("#s", "#g"), ("</p>", " x</p>"),
        ("</phong>", '<ambient><texture texture="t"/></ambient></phong>'),
    ],
)  # fmt: skip
def test_what_is_not_plain_is_refused(changes: tuple[str, str]) -> None:
    with pytest.raises(NotPlainError):
        read(square(*changes))


@pytest.mark.slow
def test_meshes_of_robots_are_those_that_assimp_reads() -> None:
    shapes = read_links(pinsing.load("panda")).geometry.geometryObjects
    files = sorted({Path(g.meshPath) for g in shapes if g.meshPath.endswith(".dae")})[:2]
    assert len(files) == 2
    for file in files:
        parts = read_collada(file.read_bytes())
        mesh = coal.MeshLoader().load(str(file), np.ones(3))
        vertices = np.array(mesh.vertices())
        triangles = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
        faces = np.array([[t[0], t[1], t[2]] for t in triangles])
        assert sum(len(p.faces) for p in parts) == pytest.approx(len(faces), rel=0.01)
        areas = [area(corners_of(p), p.faces) for p in parts]
        assert sum(areas) == pytest.approx(area(vertices, faces), rel=1e-3)
        # Assimp turns y up to z up; the page does as Pinocchio's own viewer, which does not.
        every = np.concatenate([corners_of(p) for p in parts])
        mine, theirs = (np.sort(np.ptp(x, axis=0)) for x in (every, vertices))
        assert mine == pytest.approx(theirs, rel=1e-4)


def test_what_is_no_answer_is_not_taken_for_one():
    (one, *others), whole = read(square())[0], packed(read(square()))
    strangers = [b"x", whole[:-30], packed([one]), packed([(one.ravel(), *others)])]
    strangers.append(packed([(one, *others[:-1], np.array([np.nan]))]))
    assert [unpacked(data) for data in strangers] == [None] * 5


def test_polygons_of_all_sizes_take_time_by_their_corners() -> None:
    corners, triangles = 200_000, 200_000
    index = " ".join([INDEX] * (corners // 4) + ["0 0 1 0 2 0"] * triangles)
    sizes = f"<vcount>{corners}" + " 3" * triangles
    count = f'count="{triangles + 1}"'
    text = square("<vcount>4", sizes, 'count="1"', count, INDEX, index)
    begun = time.process_time()
    (part,) = read(text)
    assert time.process_time() - begun < 10
    assert len(part.faces) == corners - 2 + triangles
    first = np.round(corners_of(part)[part.faces[:3]], 3).tolist()
    a, b, c, d = [0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]
    assert first == [[a, b, c], [a, c, d], [a, d, a]]


@pytest.mark.slow
def test_one_geometry_used_very_often_is_refused() -> None:
    uses = '<instance_geometry url="#g"/>' * 50_000 + "</node>"
    sizes = "<vcount>" + "4 " * 10_000
    text = square("<vcount>4", sizes, INDEX, f"{INDEX} " * 10_000, "</node>", uses)
    begun = time.process_time()
    with pytest.raises(NotPlainError, match="too large"):
        read(text)
    assert time.process_time() - begun < 30


def test_no_collada_file_is_parsed_in_this_process(tmp_path, monkeypatch):
    """A stranger's file may be made to take any time: a child with limits reads it."""
    monkeypatch.setenv("PINSING_CACHE", "")
    monkeypatch.setattr(collada_reader, "read_collada", lambda _: pytest.fail("parsed here"))
    links = read_links(pinsing.load("panda"))
    recorder = Recorder()
    assert draw_links(recorder.root, links) == ()
    assert b"".join(recorder.parts()).count(b"MeshPhongMaterial") > 20
    monkeypatch.setattr(meshes, "SECONDS_EACH", 0.1)
    file = tmp_path / "slow.dae"
    file.write_text(square(INDEX, f"{INDEX} " * 1_000_000))
    assert "is not read within 0.1 s" in str(read_meshes([file])[file])


def test_each_paint_of_a_link_is_drawn():
    (one,) = read(square())
    sent = []
    SceneNode(sent.append, "/arm").draw(_surface(one, {}), _surface(one, {}))
    drawn = sent[0]["object"]
    assert len(drawn["object"]["children"]) == 2
    assert drawn["materials"][0]["color"] == 0xFF8000
    recorder = Recorder()
    recorder.root["pinsing/arm/3/visual/0"].show(False)
    recorder.root["pinsing/arm/3/bone"].show(False)
    scene, links = recorder.parts()
    assert b"bone" in scene
    assert b"visual" in links
    assert len(scene) + len(links) == sum(4 + len(c) for _, c in recorder.commands)


def test_a_mesh_is_refused_that_is_too_large_or_changes_while_it_is_read(tmp_path, monkeypatch):
    file = tmp_path / "arm.dae"
    file.write_text("<COLLADA></COLLADA>")
    assert references.image_references(file) == ()
    size = file.stat().st_size
    monkeypatch.setattr(references, "LARGEST", size)
    assert references.image_references(file) == ()
    monkeypatch.setattr(references, "LARGEST", size - 1)
    with pytest.raises(references.ColladaProblem, match="too large"):
        references.image_references(file)
    monkeypatch.undo()
    monkeypatch.setattr(references.os, "fstat", lambda _: SimpleNamespace(st_size=size - 3))
    with pytest.raises(references.ColladaProblem, match="changes"):
        references.image_references(file)
