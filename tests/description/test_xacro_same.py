"""Every xacro that the tests can install gives the same URDF as xacro by itself."""

import json
from pathlib import Path

import pytest
from command_line import python

from pinsing.description.catalog import data_folder
from pinsing.description.files import expand_xacro
from pinsing.errors import RobotFileError

# xacro as it comes, on files that we know; packages are the folders by their names.
PLAIN = """
import contextlib, io, json, sys, types
files, packages = json.load(sys.stdin)
module = types.ModuleType("ament_index_python.packages")
module.get_package_share_directory = packages.__getitem__
sys.modules["ament_index_python"] = types.ModuleType("ament_index_python")
sys.modules[module.__name__] = module
import xacro
found = {}
for file in files:
    xacro.filestack = xacro.macrostack = None
    try:
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
            document = xacro.process_file(file)
            found[file] = document.toprettyxml(indent="  ")
    except Exception as error:
        found[file] = None
print(json.dumps(found))
"""


def compare(root):
    """Count files that both turn into the same URDF, and tell why the others are refused."""
    files = sorted(root.rglob("*.xacro"))
    packages = {f.name: str(f) for f in sorted(root.rglob("*")) if f.is_dir()}
    packages[root.name] = str(root)
    given = json.dumps([[str(f) for f in files], packages])
    plain = json.loads(python("-c", PLAIN, input=given, check=True).stdout)
    refused: dict[str, str] = {}
    for file in files:
        if plain[str(file)] is None:
            with pytest.raises(RobotFileError) as caught:
                expand_xacro(file, packages)
            refused[str(file.relative_to(root))] = str(caught.value)
        else:
            assert expand_xacro(file, packages).xml == plain[str(file)], file
    return len(files) - len(refused), refused


@pytest.mark.slow
def test_example_robot_data():
    folder = data_folder()
    same, refused = compare(folder)
    assert same == len(refused) == 1  # the other includes package://..., xacro fails


# Of rtb-data, what no xacro can expand: the package that each needs does not come with it.
LACKING = {
    "abb_irb140_description/urdf/irb140.xacro": "abb_irb140",
    "clearpath_ridgeback_description/urdf/accessories/sick_lms1xx_mount.urdf.xacro": "lms1xx",
    "clearpath_ridgeback_description/urdf/accessories/sick_s300_mount.urdf.xacro": "lms1xx",
    "kuka_description/kuka_kr10/urdf/kr10r1100sixx.xacro": "kuka_kr10_support",
    "kuka_description/kuka_kr120/urdf/kr120r2500pro.xacro": "kuka_kr120_support",
    "kuka_description/kuka_kr150/urdf/kr150_2.xacro": "kuka_kr150_support",
    "kuka_description/kuka_kr16/urdf/kr16_2.xacro": "kuka_kr16_support",
    "kuka_description/kuka_kr210/urdf/kr210l150.xacro": "kuka_kr210_support",
    "kuka_description/kuka_kr3/urdf/kr3r540.xacro": "kuka_kr3_support",
    "kuka_description/kuka_kr5/urdf/kr5_arc.xacro": "kuka_kr5_support",
    "kuka_description/kuka_kr6/urdf/kr6r700sixx.xacro": "kuka_kr6_support",
    "kuka_description/kuka_kr6/urdf/kr6r900sixx.xacro": "kuka_kr6_support",
    "kuka_description/kuka_lbr_iiwa/urdf/lbr_iiwa_14_r820.xacro": "kuka_lbr_iiwa_support",
}


@pytest.mark.slow
def test_robotics_toolbox():
    same, reasons = compare(Path(pytest.importorskip("rtbdata").__file__).parent / "xacro")
    assert (same, sorted(reasons)) == (45, sorted(LACKING))
    for name, package in LACKING.items():
        assert f"package {package!r} not found" in reasons[name]


FEATURES = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro" xmlns:g="urn:g">
  <xacro:arg name="side" default="left"/>
  <xacro:arg name="count" default="${1 + 2}"/>
  <xacro:property name="t" value="${xacro.load_yaml('t.yaml')}"/>
  <xacro:property name="name" value="'quoted'"/>
  <xacro:property name="lazy" value="${name}_x"/>
  <xacro:property name="len" value="5"/>
  <xacro:property name="gone" value="1"/><xacro:property name="gone" remove="true"/>
  <xacro:property name="kept" value="1"/><xacro:property name="kept" default="2"/>
  <xacro:property name="block"><i a="${name}"/><j/></xacro:property>
  <xacro:include filename="part.xacro" ns="part"/>
  <xacro:include filename="part*.xacro"/>
  <xacro:include filename="nothing.xacro" optional="true"/>
  <xacro:macro name="m" params="a b:=7 c:='1 2' d:=^|9 e:=^ f:=${2*b} *one **many">
    <link name="${a} ${b} ${c} ${d} ${e}"><xacro:insert_block name="one"/>
      <xacro:insert_block name="many"/></link>
    <xacro:property name="up" value="${b + 1}" scope="parent"/>
    <xacro:property name="all" value="${b + 2}" scope="global"/>
  </xacro:macro>
  <xacro:property name="b" value="8"/><xacro:property name="d" value="${b}"/>
  <xacro:property name="e" value="E"/>
  <xacro:m a="$(arg side)"><x/><y><z v="${b}"/></y></xacro:m>
  <xacro:call macro="m" a="$(eval 2 * count + pi)" b="${t.a[1].c}"><x/><y/></xacro:call>
  <up v="${up} ${all} ${lazy} ${len} ${kept} ${part.inner} ${part.deep(2) if False else 0}"/>
  <xacro:part.pm v="1"/>
  <xacro:if value="${t.flag and not False}"><yes>${t.angle} ${t['length']}</yes></xacro:if>
  <xacro:unless value="$(eval side == 'right')"><no>$$(x) $${y} $ a</no></xacro:unless>
  <xacro:if value="0"/><xacro:if value="true"><t/></xacro:if>
  <xacro:element xacro:name="${'el' + 'em'}" k="v">
    <xacro:attribute name="n" value="n${[1, 2]}"/></xacro:element>
  <xacro:insert_block name="block"/>
  <!-- xacro:eval-comments --><!-- ${1 + 1} --><!-- xacro:eval-comments:off --><!-- ${1 + 1} -->
  <a b="${t}" c="${t.list}" d="${dict(a=1)}" e="${1e-7} ${1/3} ${True} ${None}" f="&lt;&amp;"/>
  <o v="$(optenv NO_SUCH_VAR a b) $(env ROS_HOME) $(cwd)" w="${xacro.abs_filename('x')}"/>
  <w v="${xacro.warning('note')}${xacro.message('m')}${xacro.tokenize('1,2;3 4')}"/>
  <d v="${sorted([2, 1])} ${list(range(3))} ${xacro.dotify(dict(q=1)).q} ${max(1, 2) ** 2}"/>
  <g:h xmlns:k="urn:k"/>${xacro.arg('side')} ${-3 // 2} ${'%.2f' % 1.005}
</robot>
"""
PART = """<p xmlns:xacro="http://www.ros.org/wiki/xacro" xmlns:q="urn:q">
<xacro:property name="inner" value="${3 * 2}"/><xacro:macro name="pm" params="v">
<pm v="${v} ${inner}"/></xacro:macro><q:z/></p>"""
TABLE = """a: [1, {c: 2.5}]
flag: true
angle: !degrees 90 / 2
length: !millimeters 5
list: [{x: 1}, 2001-01-01, null, 0x10, 1e3, "s"]
merge: &m {k: 1}
more: {<<: *m, l: 2}
"""


def test_every_feature(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_HOME", "somewhere")
    (tmp_path / "all.xacro").write_text(FEATURES)
    (tmp_path / "part.xacro").write_text(PART)
    (tmp_path / "t.yaml").write_text(TABLE)
    assert compare(tmp_path) == (2, {})
    assert 'name="elem"' not in expand_xacro(tmp_path / "all.xacro").xml
    assert "<elem " in expand_xacro(tmp_path / "all.xacro").xml
