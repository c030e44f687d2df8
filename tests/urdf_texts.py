"""URDF texts for the tests: one good arm of three links, with one place to put a defect."""

from pathlib import Path
from xml.sax.saxutils import quoteattr

LIMIT = '<limit lower="-1" upper="2" effort="1" velocity="1"/>'
XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n{}\n</robot>\n'


def joint(
    name: str = "j2",
    parent: str = "b",
    child: str = "c",
    kind: str = "revolute",
    inner: str = '<axis xyz="0 0 1"/>' + LIMIT,
) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inner}</joint>'


def robot(*joints: str, links: str = "abc", extra: str = "", head: str = 'name="r"') -> str:
    """Return a URDF of three links; the joint under test is on line 5, what is extra on line 6."""
    first = joint("j1", "a", "b")
    body = "".join(f'<link name="{link}"/>' for link in links)
    tested = "\n".join(joints) if joints else joint()
    return f"<robot {head}>\n{body}\n\n{first}\n{tested}\n{extra}</robot>\n"


def make_package(tmp_path: Path) -> Path:
    """A package with a mesh and a folder for its URDF, beside a secret that is no part of it."""
    folder = tmp_path / "ws" / "arm_description"
    (folder / "urdf").mkdir(parents=True)
    (folder / "meshes").mkdir()
    (folder / "package.xml").write_text("<package><name>arm_description</name></package>")
    stl = b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    (folder / "meshes" / "a.stl").write_bytes(stl + b"endloop\nendfacet\nendsolid x\n")
    (tmp_path / "secret.stl").write_bytes(stl + b"endloop\n" + SECRET)
    for name in ("secret.png", "secret.txt", "ws/arm_description/secret.txt"):
        (tmp_path / name).write_bytes(SECRET)
    return folder


SECRET = b"the secret that no page may hold, 2f9c61"
UPRIGHT = '<origin xyz="0.3 0 0.2" rpy="1.5707963267948966 0 0"/><axis xyz="0 0 1"/>' + LIMIT


def named(name: str, inner: str = UPRIGHT) -> str:
    """Return a URDF of three joints: all names in it begin with one that may be hostile."""
    said = quoteattr(name, {'"': "&quot;"})[1:-1]
    links = [f"{said} link {i}" for i in range(4)]
    joints = [joint(f"{said} {i}", links[i], links[i + 1], inner=inner) for i in range(3)]
    body = "".join(f'<link name="{link}"/>' for link in links)
    return f'<robot name="{said}">{body}{"".join(joints)}</robot>'


def drawn(*meshes: object, texture: str = "") -> str:
    """Return a URDF of three links, the first of which is drawn as meshes."""
    material = f'<material name="m"><texture filename="{texture}"/></material>' if texture else ""
    visual = f'<visual><geometry><mesh filename="{{}}"/></geometry>{material}</visual>'
    return robot(links="bc", extra=f'<link name="a">{"".join(map(visual.format, meshes))}</link>')
