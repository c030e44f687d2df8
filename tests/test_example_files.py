"""The files of examples/: short, and each run as a user would."""

import importlib.util
import json
import os
import re
import runpy
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from command_line import python
from tiers import tiered

EXAMPLES = Path(__file__).parent.parent / "examples"
RECORDED = EXAMPLES / "recorded"


def run(name: str, *words: object) -> str:
    done = python(EXAMPLES / name, *words, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_examples_are_short_and_each_is_run_by_a_test():
    tests = "".join(p.read_text() for p in Path(__file__).parent.rglob("test_*.py"))
    files = {f.name: f.read_text() for f in sorted(EXAMPLES.glob("*.py"))}
    assert len(files) >= 2
    assert [name for name in files if name not in tests] == []
    assert [name for name, text in files.items() if len(text.splitlines()) > 60] == []


# What each prints, whatever the machine; those that draw, ask or start more have a test below.
SAID = {
    "01_analyse.py": r"ur5: 3 families, complete: True\nF1 \(boundary, codimension 1\)",
    "02_view.py": r"shows P1, F1, F2, F3",
    "03_custom_model.py": r"F1: .*q2 = ±90°.*\n  at .*: singular",
    "04_trajectory.py": r"meets F2 at t = 1\.000 s\n.*different.*\n\d+ of its 20 samples",
    "05_guard_loop.py": r"warn, 0\.[\s\S]*nearest 0\.0[5-9]",
    "07_map_over_a_cluster.py": r"the same on threads: True",
    "08_closed_loop.py": r"2 assembly modes\n[\s\S]*inputs, in m², complete",
    "09_certificate.py": r"as it was: ACCEPTED: puma560[\s\S]*forged: REJECTED.*exit code 1",
    "10_posture_change.py": r"puma560: not cuspidal, proven[\s\S]*aspect: different",
    "11_pink_barrier.py": r"without .* 0\.[0-4]\d degrees[\s\S]*with .* ([5-9]|\d\d)\.\d\d degrees",
    "14_lerobot.py": r"clear: .*\nwarn: .*\nstop: at least .* from F1; elbow_flex \+ leads away",
    "15_rerun_log.py": r"stop at the end, 3\.4 deg",
    "16_mink_limit.py": r"limit: 0\.\d deg[\s\S]*limit: (9\.[89]|10\.[0-2]) deg",
    "17_scipy_posture.py": r"clearance 36\.\d -> 6\d\.\d deg .*\nthe tip moved by \S+e-0[6-9] m",
}
GIVEN = {
    "14_lerobot.py": [RECORDED / "so101.jsonl"],
    "15_rerun_log.py": [RECORDED / "ur5_joint_states.jsonl", "ur5.rrd"],
}
BESIDE = {
    "07_map_over_a_cluster.py": "distributed", "11_pink_barrier.py": "pink",
    "15_rerun_log.py": "rerun", "16_mink_limit.py": "mink",
}  # fmt: skip
"""The package that an example stands beside, where there is one."""


@pytest.mark.parametrize("name", tiered(SAID, {"03_custom_model.py", *list(BESIDE)[1:]}))
def test_an_example_says_what_it_found(name, tmp_path, monkeypatch):
    if name in BESIDE and importlib.util.find_spec(BESIDE[name]) is None:
        pytest.skip(f"{BESIDE[name]} is not installed")
    monkeypatch.chdir(tmp_path)
    assert re.search(SAID[name], run(name, *GIVEN.get(name, ()))), name
    assert all(file.read_bytes().startswith(b"RRF") for file in tmp_path.glob("*.rrd"))


@pytest.mark.slow
def test_through_singularities(tmp_path):
    picture = tmp_path / "speeds.png"
    said = run("06_through_singularities.py", picture)
    assert picture.read_bytes().startswith(b"\x89PNG")
    rows = re.findall(r"^(\w+) the (\w+) .*, (\w+): at most (\S+) rad/s, misses (\S+)$", said, re.M)
    assert len(rows) == 10
    for _, _, method, speed, missed in rows:
        if method == "pinv":  # follows, at any speed
            assert float(speed) > 1000
            assert float(missed) < 1e-5
        else:  # slow, and gives something up
            assert float(speed) < 2
            assert float(missed) > 1e-3


def test_ros2_diagnostics():
    """On a recorded stream, with stand-ins for the types of messages."""
    judge = runpy.run_path(str(EXAMPLES / "13_ros2_diagnostics.py"))["Judge"]
    status = type("DiagnosticStatus", (SimpleNamespace,), {"OK": 0, "WARN": 1, "ERROR": 2})
    judge_state = judge("ur5", status, SimpleNamespace)
    lines = (RECORDED / "ur5_joint_states.jsonl").read_text().splitlines()
    states = [SimpleNamespace(**json.loads(line)) for line in lines]
    said = [judge_state(state) for state in states]
    levels = [s.level for s in said]
    assert levels == sorted(levels)
    assert {*levels} == {0, 1, 2}
    start = "wrist: at least 3.4 deg away (proven), no contact before 0.16"
    assert said[-1].message.startswith(start)
    assert {v.key for v in said[-1].values} == {"family", "lower"}
    states[-1].velocity = [float("nan")] * 6  # as of a driver that measures none
    unmeasured = judge("ur5", status, SimpleNamespace)(states[-1])
    assert unmeasured.message.endswith("deg away (proven)")


def test_viser_families():
    viser = pytest.importorskip("viser")
    show = runpy.run_path(str(EXAMPLES / "18_viser_families.py"))["show"]
    server = viser.ViserServer(host="127.0.0.1", port=0)
    menu, slider, text = show(str(EXAMPLES.parent / "urdf" / "puma560.urdf"), server)
    assert [label.split()[0] for label in menu.options] == ["F1", "F2", "F3"]
    for label in menu.options:
        menu.value, slider.value = label, 3
        assert re.search(r"sigma_min \d\.\de-1[5-9]", text.content), text.content
    server.stop()


NOTEBOOK = EXAMPLES / "12_notebook.ipynb"


def cells(file: Path = NOTEBOOK) -> list[dict[str, Any]]:
    return list(json.loads(file.read_text(encoding="utf-8"))["cells"])


def shown(cell: dict[str, Any], kind: str) -> str:
    """What a cell shows as one kind of content."""
    return "".join("".join(o["data"].get(kind, "")) for o in cell["outputs"] if "data" in o)


def test_the_notebook_is_kept_without_outputs():
    for cell in cells():
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


@pytest.mark.slow
def test_every_cell_runs_and_shows_what_the_text_says(tmp_path):
    pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    done = shutil.copy(NOTEBOOK, tmp_path / "done.ipynb")
    own = {k: v for k, v in os.environ.items() if k != "MPLBACKEND"}  # the kernel's own is meant
    words = ("execute", "--inplace", "--timeout=240", "--kernel_name=python3", done)
    ran = python("-m", "jupyter", *words, timeout=300, env=own)
    assert ran.returncode == 0, ran.stderr
    code = [c for c in cells(done) if c["cell_type"] == "code"]
    assert [c["execution_count"] for c in code] == list(range(1, len(code) + 1))
    form, family, ratio, state, curve, crossings, page = code
    assert "<math>" in shown(form, "text/html")
    assert "proven" in shown(form, "text/html")
    assert "F3" in shown(family, "text/plain")
    assert float(shown(ratio, "text/plain")) < 1e-10
    assert "SINGULAR: rank 5 of 6" in shown(state, "text/plain")
    assert shown(curve, "image/png")
    assert shown(crossings, "text/plain") == "[('F2', 1.0)]"
    assert "<iframe" in shown(page, "text/html")
