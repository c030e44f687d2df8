"""Where Linux's own modules and calls are missing, as on macOS, the work is the same."""

import json
import subprocess
from pathlib import Path

import pytest
from command_line import python

HIDING = """
import builtins, ctypes, os, sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name in {"fcntl", "resource"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

class Library(ctypes.CDLL):
    def __getattr__(self, name):
        if name in {"prctl", "syscall"}:
            raise AttributeError(name)
        return super().__getattr__(name)

def kept(path, *rest, **options):
    if isinstance(path, (str, os.PathLike)) and str(path).startswith("/proc"):
        raise FileNotFoundError(path)
    return opened(path, *rest, **options)

import multiprocessing.resource_tracker, platform, sysconfig
sysconfig.get_config_vars()  # of the system that this is
opened, builtins.open = builtins.open, kept
sys.meta_path.insert(0, Hidden())
for name in ("fcntl", "resource"):
    sys.modules.pop(name, None)
ctypes.CDLL = Library
"""
XACRO = Path(__file__).parent.parent / "urdf" / "stanford.urdf"


ONE = "from pinsing.cli import program; program()"
MANY = """
import json
from click.testing import CliRunner
from pinsing.cli.app import command
done = [CliRunner().invoke(command, words) for words in json.loads(sys.argv[1])]
print(json.dumps([(one.exit_code, one.output) for one in done]))
"""


def run(
    tmp_path: Path, *words: str, system: str = "darwin", call: str = ONE
) -> subprocess.CompletedProcess[str]:
    """The command in a process where those modules are hidden; of many one after the other."""
    env = {"MPLBACKEND": "Agg", "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
    code = f"{HIDING}\nsys.platform = {system!r}\n{call}"
    return python("-c", code, *words, env=env, cwd=tmp_path, timeout=120)


ANSWERS = [
    ("families ur5", "proven complete"), ("families panda", "proven complete"),
    ("at stanford --q 0,1,0.3,1,0,0", "wrist"), ("postures ur5", "aspects"),
    ("list arm.xacro", "links"), ("families arm.xacro", "proven complete"),
    ("analyze planar3r --sweep --levels 1", "planar3r"),
    ("families ur5 -o proof.cert.json", "proven"), ("verify proof.cert.json", "proven"),
    ("path ur5 poses.csv", "49.4°"), ("plot curves planar3r -o out.png", ""),
    ("zones planar3r --joint-speeds 1,1,1", "no useful distance was found"),
    ("check planar3r --follow run.csv", '"level": "clear"'),
    ("report planar3r -o out.html", "proven"), ("view planar3r -o view.html", "wrote view.html"),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("system", ["darwin", "linux"])  # as in a container
def test_commands_answer_without_what_only_linux_has(tmp_path, system):
    (tmp_path / "arm.xacro").write_text(XACRO.read_text(encoding="utf-8"), encoding="utf-8")
    rows = [f"0.4,{y},0.3,3.1,0,0" for y in (0.2, 0.1, 0)]
    (tmp_path / "poses.csv").write_text("\n".join(["x,y,z,roll,pitch,yaw", *rows]))
    (tmp_path / "run.csv").write_text("q1,q2,q3\n0.1,1,0.3\n")
    words = json.dumps([words.split() for words, _ in ANSWERS])
    done = run(tmp_path, words, system=system, call=MANY)
    assert done.returncode == 0, done.stderr
    for (code, said), (asked, answer) in zip(json.loads(done.stdout), ANSWERS, strict=True):
        assert code == 0, (asked, said)
        assert answer in said, asked


@pytest.mark.slow
def test_a_folder_that_cannot_be_locked_is_refused(tmp_path):
    assert run(tmp_path, "map", "planar3r", "--count", "64").returncode == 0
    done = run(tmp_path, "map", "planar3r", "--count", "64", "-o", "runs")
    assert done.returncode == 2
    assert "need Linux or macOS" in done.stderr
    assert not (tmp_path / "runs").exists()
