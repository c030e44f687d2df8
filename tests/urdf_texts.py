"""URDF texts for the tests: one good arm of three links, with one place to put a defect."""

from pathlib import Path

LIMIT = '<limit lower="-1" upper="2" effort="1" velocity="1"/>'


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
    (tmp_path / "secret.stl").write_text("secret")
    (folder / "secret.txt").write_text("secret")
    return folder


def three_joints(name: str, lower: float, upper: float) -> str:
    """An arm that spins, lifts within limits, and bends; its position has three freedoms."""
    return f"""<robot name="{name}">
  <link name="base"/><link name="a"/><link name="b"/><link name="c"/><link name="tool"/>
  <joint name="spin" type="continuous"><parent link="base"/><child link="a"/>
    <origin xyz="0 0 0.2"/><axis xyz="0 0 1"/></joint>
  <joint name="lift" type="revolute"><parent link="a"/><child link="b"/>
    <origin xyz="0.1 0 0.1"/><axis xyz="0 1 0"/>
    <limit lower="{lower}" upper="{upper}" velocity="1" effort="1"/></joint>
  <joint name="bend" type="continuous"><parent link="b"/><child link="c"/>
    <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/></joint>
  <joint name="end" type="fixed"><parent link="c"/><child link="tool"/>
    <origin xyz="0.3 0 0"/></joint>
</robot>"""
