"""Files from strangers: what they may not read, write, run, or make a terminal or a page show."""

import base64
import gzip
import html
import json
import re
import socket
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import pinocchio as pin
import pytest
from arms import serial
from command_line import python, run
from urdf_texts import SECRET, XACRO, drawn, joint, make_package, named as all_named, robot

from pinsing import Viewer, analyze, closed_form, load
from pinsing.description.urdf import read_description
from pinsing.errors import PinsingError, RobotFileError

DAE = (
    '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/>'
    '<library_images><image id="i"><init_from>{}</init_from></image></library_images></COLLADA>'
)

BOMBS = {
    "laughs": '[<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;">]',
    "external": '[<!ENTITY c SYSTEM "file:///etc/passwd">]',
    "parameter": '[<!ENTITY % p SYSTEM "http://127.0.0.1:9/x"> %p;]',
    "outside": 'SYSTEM "http://127.0.0.1:9/x.dtd"',
}


@pytest.mark.parametrize("bomb", BOMBS)
@pytest.mark.parametrize("where", ["urdf", "xacro", "include"])
def test_entities_are_refused_everywhere(bomb, where, tmp_path, monkeypatch):
    text = f'<?xml version="1.0"?>\n<!DOCTYPE robot {BOMBS[bomb]}>\n<robot name="&c;"/>'
    path = tmp_path / ("arm.urdf" if where == "urdf" else "arm.xacro")
    path.write_text(text)
    if where == "include":
        path = tmp_path / "whole.xacro"
        path.write_text(XACRO.format('<xacro:include filename="arm.xacro"/>'))
    asked = []
    monkeypatch.setattr(socket.socket, "connect", lambda *given: asked.append(given))
    with pytest.raises(RobotFileError, match="document types and entities are not accepted"):
        read_description(path)
    assert not asked


def page_of(arm) -> bytes:
    """All that a static page of an arm holds, unpacked."""
    with Viewer(arm, families=()) as viewer:
        text = viewer.html()
    packed = re.findall(r'type="application/octet-stream">([^<]*)<', text)
    parts = [text.encode(), *(gzip.decompress(base64.b64decode(part)) for part in packed)]
    assert len(parts) == 4  # the text; the skeleton, its start, and the meshes, packed
    return b"\n".join(parts)


def holds_secret(page: bytes) -> bool:
    return base64.b64encode(SECRET)[:40] in page or SECRET in page


@pytest.fixture
def package(tmp_path) -> Path:
    folder = make_package(tmp_path)
    (folder / "meshes" / "link.stl").symlink_to(tmp_path / "secret.stl")
    return folder


def with_mesh(package: Path, mesh: str, texture: str = "") -> Path:
    path = package / "urdf" / "arm.urdf"
    path.write_text(drawn(mesh, texture=texture))
    return path


@pytest.mark.parametrize(
    "address",
    [
        "package://../../secret.stl", "package://arm_description/../../secret.stl",
        "package://arm_description/meshes/../../../secret.stl",
        "package://arm_description/meshes/link.stl", "../../../secret.stl", "../meshes/link.stl",
        "{}/secret.stl", "file://{}/secret.stl", "file://{}/ws/arm_description/../../secret.stl",
        "file:///etc/passwd", "/dev/zero", "http://127.0.0.1:9/a.stl", "\\\\server\\share\\a.stl",
        "package://arm_description/secret.txt", "",
        "file://{}/ws/arm_description/meshes/%2e%2e/%2e%2e/%2e%2e/secret.stl",
    ],
)  # fmt: skip
def test_meshes_from_elsewhere_are_in_no_page(address, package, tmp_path):
    arm = load(with_mesh(package, address.format(tmp_path)))
    assert "mesh filename" not in arm.source.xml
    said = arm.source.mesh_notes
    assert any("not opened" in note or "not found" in note for note in said)
    assert set(said) <= set(Viewer(arm, families=[]).notes)
    assert not holds_secret(page_of(arm))


def test_a_good_mesh_is_in_the_page(package, tmp_path):
    arm = load(with_mesh(package, "package://arm_description/meshes/a.stl"))
    assert "mesh filename" in arm.source.xml
    assert len(page_of(arm)) > len(page_of(load(with_mesh(package, "nope.stl"))))
    path = with_mesh(package, "package://arm_description/meshes/a.stl", f"{tmp_path}/secret.png")
    assert "secret" not in read_description(path).xml


ENTITIES = DAE.replace("<COLLADA", '<!DOCTYPE x [<!ENTITY e "y">]><COLLADA')


@pytest.mark.parametrize(
    ("image", "taken"),
    [
        ("{}/secret.txt", False), ("{}/secret.png", False), ("../../../secret.png", False),
        ("/etc/passwd", False), ("../secret.txt", False),
        ("&#x2e;&#x2e;/../../secret.png", False), ("<b>{}/secret.png</b>", False),
        ("image.png", True), ("../meshes/image.png", True), ("not_there.png", True),
        # What cannot be judged is not opened: with entities, cut off, in another encoding.
        (ENTITIES.format("a.png").encode(), None), (DAE.format("a.png").encode()[:-10], None),
        (DAE.format("/etc/passwd").encode("utf-16"), None),
    ],
)  # fmt: skip
def test_images_that_a_mesh_refers_to_are_judged_as_well(image, taken, package, tmp_path):
    """The viewer embeds them: a Collada file may not reach for what the URDF may not."""
    (package / "meshes" / "image.png").write_bytes(b"\x89PNG an image of the robot's own")
    if isinstance(image, str):
        image = DAE.format(image.format(tmp_path)).encode()
    (package / "meshes" / "a.dae").write_bytes(image)
    found = read_description(with_mesh(package, "package://arm_description/meshes/a.dae"))
    assert ("mesh filename" in found.xml) == bool(taken)
    if taken is False:
        assert any("not opened" in note and "refers to a file" in note for note in found.notes)
        assert not holds_secret(page_of(load(found.path)))


NAMES = {
    "html": '<img src=x onerror="alert(1)">&amp;', "quotes": "a\"b'c`d",
    "marks": "\u202eevil\u200b", "latex": "\\input{/etc/passwd}%$#_{}",
    "mathtext": "$x^{$ $\\frac{$", "script": "</script><script>alert(1)</script><!--",
}  # fmt: skip


@pytest.fixture(params=NAMES)
def named(request, tmp_path) -> tuple[str, Path]:
    """A robot all of whose names are hostile."""
    name, path = NAMES[request.param], tmp_path / "arm.urdf"
    path.write_text(all_named(name), encoding="utf-8")
    return name, path


def test_names_are_text_in_the_terminal_and_in_json(named):
    name, path = named
    for words in (["list", str(path)], ["families", str(path)], ["list", str(path), "--tip", name]):
        ended = run(*words)
        assert ended.exit_code in (0, 2), ended.stderr
        for line in (ended.stdout + ended.stderr).split("\n"):
            assert all(c.isprintable() or c == "\t" for c in line), line
        if ended.exit_code == 2:  # there is no such frame, said in one line
            assert len(ended.stderr.strip().splitlines()) == 1
    data = run("list", str(path), "-o", "-")
    assert all(c.isprintable() or c == "\n" for c in data.stdout)
    assert json.loads(data.stdout)["arm"]["joints"] == [f"{name} {i}" for i in range(3)]


def test_names_are_text_in_pages_and_in_latex_and_the_arm_is_analysed(named):
    name, path = named
    arm = load(path)
    assert analyze(arm, random_starts=10, seconds=5).agree
    form = closed_form(arm, seconds=5)
    latex = form.latex(legend=True)
    for line in latex.splitlines():
        legend = line.startswith("% q")
        # What a name says stands behind the sign of a comment, or nowhere.
        assert legend or name not in line
        assert legend or "input" not in line
    with Viewer(arm, families=()) as viewer:
        page = viewer.html()
    title = re.search(r"<title>(.*?)</title>", page, re.DOTALL)
    assert html.escape(name) in title.group(1)
    assert "<img src=x" not in page
    assert "<script>alert" not in page


@pytest.mark.slow
@pytest.mark.parametrize("named", NAMES, indirect=True)
def test_names_are_text_in_figures(named, tmp_path):
    """Dollar signs are no mathematics, angle brackets no elements."""
    name, path = named
    out = tmp_path / "figure.svg"
    for kind in (["curves"], ["map", "--over", f"{name} 1,{name} 2"], ["ellipsoids"]):
        ended = run("plot", *kind, str(path), "-o", str(out))
        assert ended.exit_code == 0, ended.stderr
        assert {line.split(":")[0] for line in ended.stderr.splitlines()} == {"pinsing"}
        tags = {e.tag.rpartition("}")[2] for e in ElementTree.parse(out).iter()}
        assert "path" in tags
        assert not tags & {"script", "img", "a", "foreignObject"}


@pytest.mark.slow
def test_names_of_a_mechanism_are_text(tmp_path):
    hostile = """</script><img src=x onerror='alert(1)'>$x^{$\u202e"""
    folder = Path(__file__).parents[2] / "urdf"
    tree, loops = tmp_path / "tree.urdf", tmp_path / "loops.yaml"
    text = (folder / "five_bar.urdf").read_text(encoding="utf-8")
    table = (folder / "five_bar.loops.yaml").read_text(encoding="utf-8")
    text = text.replace('robot name="five_bar"', f"robot name={quoteattr(hostile)}")
    for name in ("q1", "q2", "b1", "b2", "P2", "P"):
        text = text.replace(f'"{name}"', quoteattr(f"{hostile} {name}"))
    body = [line for line in table[table.index("closed_loop:") :].splitlines() if line[0] != "#"]
    said = re.sub(r"\b([qb][12]|P2?)\b", lambda n: json.dumps(f"{hostile} {n[0]}"), "\n".join(body))
    tree.write_text(text, encoding="utf-8")
    loops.write_text(said, encoding="utf-8")
    words = [str(tree), "--loops", str(loops)]
    page = tmp_path / "page.html"
    for command in (
        ["analyze", *words],
        ["plot", "map", *words, "-o", str(tmp_path / "figure.svg")],
        ["plot", "curves", *words, "-o", str(tmp_path / "figure.svg")],
        ["view", *words, "-o", str(page)],
    ):
        ended = run(*command)
        assert ended.exit_code == 0, ended.stderr
        assert all(c.isprintable() or c == "\n" for c in ended.stdout + ended.stderr)
    assert "<img src=x" not in page.read_text(encoding="utf-8")


def test_letters_that_no_font_here_has_are_one_note(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(robot().replace('name="r"', 'name="\U00013000\U00013001"'), encoding="utf-8")
    ended = run("plot", "ellipsoids", str(path), "-o", str(tmp_path / "figure.png"))
    assert ended.exit_code == 0, ended.stderr
    assert ended.stderr.count("drawn as boxes") == 1
    assert "Warning" not in ended.stderr


@pytest.mark.parametrize("name", ["one\ntwo", "a\tb", "\x1b[31mred", "\x1b]0;title\x07", "\x9b31m"])
def test_control_characters_of_a_model_are_refused(name):
    model = serial([(pin.JointModelRZ(), pin.SE3.Random())])
    model.names[1] = name
    with pytest.raises(PinsingError, match="control character") as caught:
        load(model)
    assert all(c.isprintable() for c in str(caught.value))


@pytest.mark.slow
def test_nothing_is_written_but_the_named_output(tmp_path, monkeypatch):
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "arm.xacro"
    path.write_text(XACRO.format(robot().split("\n", 1)[1].rsplit("</robot>", 1)[0]))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path / "tmp"))
    monkeypatch.chdir(tmp_path / "in")
    (tmp_path / "tmp").mkdir()
    (tmp_path / "out").mkdir()
    ended = python("-m", "pinsing", "analyze", path, "-o", "../out/a.json", timeout=60)
    assert ended.returncode == 0, ended.stderr
    files = sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file())
    assert files == ["in/arm.xacro", "out/a.json"]


def test_a_long_name_makes_no_long_message(refused):
    long = "n" * 50_000
    assert len(str(refused(robot(joint(long, kind="ball"))))) < 400
    with pytest.raises(PinsingError) as chosen:
        load(robot(joint(long, "a"), joint("j3", "a", "d"), links="abcd"), tip="x" * 50_000)
    assert len(str(chosen.value)) < 400
