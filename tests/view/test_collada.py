"""Collada files as triangles: against Assimp, and what is left to three.js."""

import time
from pathlib import Path
from types import SimpleNamespace

import coal
import numpy as np
import pytest

import pinsing
from pinsing.description import files as references
from pinsing.view import collada as collada_reader, meshes
from pinsing.view.collada import NotPlainError, Painted, packed, read_collada
from pinsing.view.meshes import read_meshes
from pinsing.view.scene import Recorder, SceneNode, _surface, draw_links, read_links

pytestmark = pytest.mark.filterwarnings("ignore:the matrix subclass")  # pycollada's

HEAD = '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
PAINT = """
<library_effects><effect id="e"><profile_COMMON><technique sid="c"><phong>
  <diffuse><color>1 0.5 0 1</color></diffuse>{more}
</phong></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
"""
SOURCE = """<source id="{name}"><float_array id="{name}a" count="{count}">{values}</float_array>
<technique_common><accessor source="#{name}a" count="4" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source>"""
SQUARE = SOURCE.format(name="P", count=12, values="0 0 0 1 0 0 1 1 0 0 1 0") + SOURCE.format(
    name="N", count=3, values="0 0 1"
)
POLYGON = """<polylist material="x" count="1"><input semantic="VERTEX" source="#V" offset="0"/>
<input semantic="NORMAL" source="#N" offset="1"/><vcount>4</vcount>
<p>0 0 1 0 2 0 3 0</p></polylist>"""


def collada(shape: str = POLYGON, node: str = "", more: str = "") -> str:
    """A painted square within one node."""
    return (
        f"{HEAD}{PAINT.format(more=more)}<library_geometries><geometry id='g'><mesh>{SQUARE}"
        f"<vertices id='V'><input semantic='POSITION' source='#P'/></vertices>{shape}</mesh>"
        f"</geometry></library_geometries><library_visual_scenes><visual_scene id='s'><node>{node}"
        "<instance_geometry url='#g'><bind_material><technique_common>"
        "<instance_material symbol='x' target='#m'/></technique_common></bind_material>"
        "</instance_geometry></node></visual_scene></library_visual_scenes>"
        "<scene><instance_visual_scene url='#s'/></scene></COLLADA>"
    )


def read(text: str) -> tuple[Painted, ...]:
    return read_collada(text.encode())


def corners_of(part: Painted) -> np.ndarray:
    return part.vertices[:, :3] * part.place[3] + part.place[:3]


def area(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_a_polygon_is_painted_and_placed_by_its_node() -> None:
    node = "<translate>0 0 5</translate><rotate>1 0 0 90</rotate><scale>2 2 2</scale>"
    (part,) = read(collada(node=node))
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
    (part,) = read(collada(more=more))
    assert part.paint[4] == pytest.approx(opacity)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<a/>",
        collada(more="<ambient><texture texture='t'/></ambient>"),
        collada(POLYGON.replace("<vcount>4", "<vcount>5")),
        collada(POLYGON.replace("0 0 1 0 2 0 3 0", "0 0 1 0 2 0 9 0")),
        collada(POLYGON.replace("0 0 1 0 2 0 3 0", "0 0 1 0 2 0 -1 0")),
        collada(POLYGON.replace("#N", "#nothing")),
        collada().replace("0 0 0 1 0 0", "0 0 nan 1 0 0"),
        collada().replace("#s", "#g"),
        collada(POLYGON.replace("</p>", " x</p>")),
    ],
)
def test_what_is_not_plain_is_refused(text: str) -> None:
    with pytest.raises(NotPlainError):
        read(text)


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
        assert sum(area(corners_of(p), p.faces) for p in parts) == pytest.approx(
            area(vertices, faces), rel=1e-3
        )
        # Assimp turns y up to z up; the page does as Pinocchio's own viewer, which does not.
        every = np.concatenate([corners_of(p) for p in parts])
        assert np.sort(np.ptp(every, axis=0)) == pytest.approx(
            np.sort(np.ptp(vertices, axis=0)), rel=1e-4
        )


def test_a_cache_of_something_else_is_not_taken(tmp_path, monkeypatch):
    monkeypatch.setenv("PINSING_CACHE", str(tmp_path / "cache"))
    file = tmp_path / "square.dae"
    file.write_text(collada())
    whole = packed(read(collada()))
    one, *others = read(collada())[0]
    strangers = [b"x", whole[:-30], packed([one]), packed([(one.ravel(), *others)])]
    for data in [*strangers, packed([(*read(collada())[0][:4], np.array([np.nan]))])]:
        monkeypatch.setattr(meshes, "kept", lambda file, data=data: meshes.unpacked(data))
        (part,) = read_meshes([file])[file]
        assert len(part.faces) == 2


def test_polygons_of_all_sizes_take_time_by_their_corners() -> None:
    corners, triangles = 200_000, 200_000
    index = " ".join(["0 0 1 0 2 0 3 0"] * (corners // 4) + ["0 0 1 0 2 0"] * triangles)
    shape = POLYGON.replace("<vcount>4", f"<vcount>{corners}" + " 3" * triangles)
    shape = shape.replace('count="1"', f'count="{triangles + 1}"')
    begun = time.process_time()
    (part,) = read(collada(shape.replace("0 0 1 0 2 0 3 0", index)))
    assert time.process_time() - begun < 10
    assert len(part.faces) == corners - 2 + triangles
    first = np.round(corners_of(part)[part.faces[:3]], 3).tolist()
    a, b, c, d = [0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]
    assert first == [[a, b, c], [a, c, d], [a, d, a]]


@pytest.mark.slow
def test_one_geometry_used_very_often_is_refused() -> None:
    use = "<instance_geometry url='#g'/>"
    shape = POLYGON.replace("<vcount>4", "<vcount>" + "4 " * 10_000).replace(
        "0 0 1 0 2 0 3 0", "0 0 1 0 2 0 3 0 " * 10_000
    )
    text = collada(shape).replace("</node>", use * 50_000 + "</node>")
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
    file.write_text(collada(POLYGON.replace("0 0 1 0 2 0 3 0", "0 0 1 0 2 0 3 0 " * 1_000_000)))
    assert "is not read within 0.1 s" in str(read_meshes([file])[file])


def test_each_paint_of_a_link_is_drawn():
    (one,) = read(collada())
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
