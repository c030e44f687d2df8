"""Programs of scripts/: a set-up, the corpus of answers, broken input, the page about the paper."""

import ast
import copy
import json
import lzma
import operator
import os
import re
import shutil
import subprocess
import sys
import venv
from collections import Counter
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from command_line import python
from public import ROOT, SCRIPTS, script

from pinsing.description import xacro_expression
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.robot.load import load

# Stands for pip: notes how it was called, and installs as an editable installation does.
PIP = """
import pathlib, shutil, sys
place = pathlib.Path(__file__).parents[1]
with open("calls.txt", "a") as calls:
    print(sys.argv[-1], file=calls)
shutil.rmtree(place / "pinsing", ignore_errors=True)
(place / "src.pth").write_text(str(pathlib.Path("src").resolve()))
"""


def calls(clone: Path, *extra: str) -> list[str]:
    """What pip is asked for by a set-up."""
    (clone / "calls.txt").write_text("")
    subprocess.run(["bash", "scripts/setup", *extra], cwd=clone, check=True, timeout=120)
    return (clone / "calls.txt").read_text().split()


def test_a_set_up_installs_once_and_again_where_the_sources_are_not_used(tmp_path: Path):
    clone, other = tmp_path / "clone", tmp_path / "other/src/pinsing"
    for name in ("scripts/setup", "pyproject.toml", "CMakeLists.txt"):
        (clone / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, clone / name)
    batch = "src/pinsing/_batch"
    shutil.copytree(ROOT / batch, clone / batch, ignore=shutil.ignore_patterns("*.py*", "__*"))
    (clone / "src/pinsing/__init__.py").write_text("")
    venv.create(clone / ".venv", symlinks=True)
    (packages,) = (clone / ".venv/lib").glob("python*/site-packages")
    (packages / "pip").mkdir()
    (packages / "pip/__main__.py").write_text(PIP)

    for word, code in (("--help", 0), ("tests", 2)):
        done = subprocess.run(["bash", "scripts/setup", word], cwd=clone, capture_output=True)
        assert (done.returncode, done.stdout[:20]) == (code, b"usage: scripts/setup")
    assert calls(clone) == ["."]
    assert calls(clone) == []
    (packages / "pinsing").mkdir()  # `pip install .`: a copy, found before src/
    (packages / "pinsing/__init__.py").write_text("")
    assert calls(clone) == ["."]
    other.mkdir(parents=True)  # an environment that uses another clone
    (other / "__init__.py").write_text("")
    (packages / "src.pth").write_text(str(other.parent))
    assert calls(clone) == ["."]
    assert calls(clone, "dev") == [".[dev]"]  # more than is there
    assert calls(clone) == calls(clone, "dev") == []  # or no more
    (clone / "src/pinsing/_batch/kernel.cpp").write_text("// other\n")
    assert calls(clone, "test") == [".[test]"]


# scripts/corpus: what counts as lost when frozen answers are held against new ones.
KEY = "seed 17"
HERE = [0.3, 1.1, -0.7, 0.9, 2.0, 0.4]  # a regular configuration of it, as is twice it


@pytest.fixture(scope="module")
def entries():
    before = list(sys.path)
    yield script("corpus.entries")
    sys.path[:] = before


@pytest.fixture(scope="module")
def frozen(entries):
    return entries.entry(KEY, 1.0)


def sorts(entries, old, **changed) -> set[str]:
    new = {**entries.entry(KEY, 1.0, old), **changed}
    return {s for s, _ in entries.changes(old, new)}


def test_the_same_code_loses_and_gains_nothing(entries, frozen):
    assert len(frozen["families"]) == 2
    assert frozen["singular"]
    assert frozen["regular"] == 0
    assert sorts(entries, frozen) == set()
    assert "loss" in sorts(entries, frozen, regular=1)  # a regular point stated as singular


def scaled(numbers, share):
    return [x * share for x in numbers]


@pytest.mark.parametrize(
    "change",
    [
        lambda old: old["families"].append(
            {**old["families"][0], "text": "gone", "points": [scaled(HERE, 1), scaled(HERE, 2)]}
        ),
        lambda old: old["singular"].append({"q": HERE, "codimension": 1}),
        # 5 % from below is what was proven, and the true distance allows it.
        lambda old: old["bounds"].update(
            lower=scaled(old["bounds"]["lower"], 1.05), upper=scaled(old["bounds"]["upper"], 1.2)
        ),
        lambda old: old["families"][0].update(codimension=2),
        lambda old: old["families"][0]["kinds"].append("other"),
        lambda old: old.update(rank=old["rank"] - 1),
        lambda old: old.update({"aspects on circles": [999, 999]}),
        lambda old: old.update(singular=[{**s, "codimension": 2} for s in old["singular"]]),
    ],
)
def test_what_was_there_and_is_not_is_a_loss(entries, frozen, change):
    old = copy.deepcopy(frozen)
    change(old)
    assert "loss" in sorts(entries, old)


def test_words_lower_are_losses_and_higher_are_gains(entries, frozen):
    new = entries.entry(KEY, 1.0, frozen)
    for (i, old), (k, now) in product(enumerate(entries.WORDS), repeat=2):
        found = {s for s, _ in entries.changes({**frozen, "word": old}, {**new, "word": now})}
        assert found == ({"loss"} if k < i else {"gain"} if k > i else set())


@pytest.mark.slow
def test_the_command_freezes_resumes_and_compares(tmp_path):
    file = tmp_path / "corpus.json.xz"
    for words in (["make", file], ["compare", file, "--fresh"]):
        done = python(SCRIPTS / "corpus", *words, "--only", "seed 171")
        assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "0 losses" in done.stderr
    (frozen,) = json.loads(lzma.decompress(file.read_bytes()))
    file.write_bytes(lzma.compress(json.dumps([{**frozen, "word": "not complete"}]).encode()))
    assert "became" in python(SCRIPTS / "corpus", "compare", file, "--only", "seed 171").stdout
    assert "1 renewed" in python(SCRIPTS / "corpus", "renew", file, "--only", "seed 171").stderr
    (again,) = json.loads(lzma.decompress(file.read_bytes()))
    assert {**again, "seconds": 0} == {**frozen, "seconds": 0}


# A short, seeded run of scripts/fuzz, and proof that it would notice.
fuzz = script("fuzz.run")


FILES = {"urdf": 70, "xacro": 25, "dh": 40, "loops": 45}
MORE = {"expression": 1000, "result": 120, "certificate": 120, "table": 60}
FEWER = {"expression": 100, "result": 15, "certificate": 40, "table": 20}


@pytest.mark.slow
@pytest.mark.parametrize(
    "counts",
    [FILES, FEWER, *({kind: count} for kind, count in MORE.items()), {"run": 25}, {"mesh": 2}],
    ids=" ".join,
)
def test_broken_input_ends_in_a_result_or_in_one_clear_line(counts):
    cases = [(kind, 70_000 + i) for kind, count in counts.items() for i in range(count)]
    outcomes = list(fuzz.fuzz(cases, workers=2 if counts is FILES else 1))
    assert Counter((o.kind, o.chain[-1]) for o in outcomes) == Counter(cases)
    assert [o for o in outcomes if o.outcome not in fuzz.GOOD] == []
    # Nothing that our own checks passed may fail later.
    assert [o for o in outcomes if "Pinocchio cannot build" in o.said] == []
    for kind in counts:  # it reaches past the readers, and it does break files
        ended = Counter(o.outcome for o in outcomes if o.kind == kind)
        assert set(ended) == set(fuzz.GOOD) or kind == "mesh", kind
        assert counts is not FILES or ended["refused"] > ended["result"] // 4, kind


def test_an_expression_with_another_value_is_noticed(monkeypatch):
    other = {**xacro_expression._OPERATORS, ast.FloorDiv: operator.truediv}
    monkeypatch.setattr(xacro_expression, "_OPERATORS", other)
    outcomes = [fuzz.run_case("expression", (seed,), {}, Path()) for seed in range(200, 300)]
    assert any("Python says" in said for outcome, said, _ in outcomes if outcome == "unclear")


@pytest.mark.slow
def test_the_kernel_under_two_sanitizers() -> None:
    """Of addresses, and of undefined behaviour."""
    if reason := script("fuzz.sanitize").missing():
        pytest.skip(reason)
    files = "batch/test_batch.py", "kinematics/test_refine.py", "proximity/test_clearance.py"
    words = ["--", "-m", "not slow", *(f"tests/{file}" for file in files)]
    env = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}
    done = python(SCRIPTS / "fuzz" / "sanitize.py", *words, timeout=1500, env=env)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert " passed" in done.stdout
    assert "kernel: " in done.stdout


# scripts/paper: its page is what the code computes.
printed, readings = (script(f"paper.{name}") for name in ("printed", "readings"))


@pytest.mark.slow
def test_committed_page_is_the_one_that_is_made(tmp_path):
    """All of docs/paper.md but its section 3, the search over readings, which takes minutes."""
    made = script("paper.__main__").sections(tmp_path, readings=False)
    page = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    page = re.sub(r"(?ms)^## 3\. .*?(?=^## )", "", page)
    now = script("paper.page").to_markdown(made, "paper")
    assert [re.sub(r"^## \d+", "##", x) for x in page.splitlines()] == [
        re.sub(r"^## \d+", "##", x) for x in now.splitlines()
    ]
    for picture in tmp_path.glob("*.png"):
        assert (ROOT / "docs" / "paper" / picture.name).is_file()


def test_the_plain_reading_of_table_2_is_pinsings_jacobian():
    arm = load("surgical7")
    rng = np.random.default_rng(2)
    theta = rng.uniform(-np.pi, np.pi, (5, 7))
    theta[:, 0] = 0.0
    found = readings.jacobians(readings.ALPHA, theta, 1.0, True, 7)
    theta[:, 0] = printed.SURGICAL_D1
    np.testing.assert_allclose(found, frame_jacobians(arm, theta), atol=1e-12)


@pytest.mark.slow
def test_no_reading_without_offsets_gives_the_printed_values():
    found = readings.search(
        float(printed.SURGICAL_THIRD), float(printed.SURGICAL_HALF), offsets=False
    )
    assert found.count == 2 * 16 * 7 * 4 * 2 * 4 * 9
    assert found.within == 0
    plain = next(r for r in found.single if r.words == "as printed")
    assert plain.third == pytest.approx(0.061141, abs=1e-6)


def test_the_bound_on_omega_k_holds(rng):
    arm = load("surgical7")
    bound = script("paper.table3").bound(arm)
    Q = rng.uniform(-np.pi, np.pi, (2000, 7))
    J = frame_jacobians(arm, Q)
    sigma = np.linalg.svd(J, compute_uv=False)
    product = sigma.prod(axis=1) * sigma[:, 0] / sigma[:, -1]
    assert product.max() <= bound
    assert product.max() > 0.02 * bound
