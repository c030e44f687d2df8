"""A short, seeded run of scripts/fuzz, and proof that it would notice."""

import ast
import importlib
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

SCRIPTS = Path(__file__).parent.parent / "scripts"


@pytest.fixture(scope="module")
def fuzz() -> ModuleType:
    sys.path.insert(0, str(SCRIPTS))
    try:
        return importlib.import_module("fuzz.run")
    finally:
        sys.path.remove(str(SCRIPTS))


@pytest.fixture(scope="module")
def mutants(fuzz: ModuleType) -> SimpleNamespace:
    """Names out of the fuzzer's other modules."""
    found: dict[str, Any] = {}
    for name in ("fuzz.mutants", "fuzz.commands", "fuzz.coverage", "fuzz.report"):
        found |= vars(sys.modules[name])
    return SimpleNamespace(**{k: v for k, v in found.items() if k[0] != "_"})


@pytest.mark.slow
def test_broken_files_end_in_a_result_or_in_one_clear_line(fuzz):
    share = {"urdf": 70, "xacro": 25, "dh": 40, "loops": 45}
    cases = [(kind, 70_000 + i) for kind, count in share.items() for i in range(count)]
    outcomes = list(fuzz.fuzz(cases, workers=2))
    assert Counter((o.kind, o.chain[-1]) for o in outcomes) == Counter(cases)
    assert [o for o in outcomes if o.outcome not in fuzz.GOOD] == []
    for kind in share:  # it reaches past the readers, and it does break files
        ended = Counter(o.outcome for o in outcomes if o.kind == kind)
        assert ended["result"] > 0, kind
        assert ended["refused"] > ended["result"] // 4, kind


MORE = {"expression": 1000, "result": 120, "certificate": 120, "table": 60}
FEWER = {"expression": 100, "result": 15, "certificate": 40, "table": 20}


@pytest.mark.parametrize(
    "counts",
    [
        FEWER,
        *(pytest.param({kind: count}, marks=pytest.mark.slow) for kind, count in MORE.items()),
        pytest.param({"run": 25}, marks=pytest.mark.slow),
        pytest.param({"mesh": 2}, marks=pytest.mark.slow),
    ],
    ids=" ".join,
)
def test_other_broken_input_ends_so_too(fuzz, counts):
    cases = [(kind, 70_000 + i) for kind, count in counts.items() for i in range(count)]
    outcomes = list(fuzz.fuzz(cases, workers=1))
    assert len(outcomes) == len(cases)
    assert [o for o in outcomes if o.outcome not in fuzz.GOOD] == []
    for kind in counts:
        ended = {o.outcome for o in outcomes if o.kind == kind}
        assert ended == set(fuzz.GOOD) or kind == "mesh", kind


def test_an_expression_with_another_value_is_noticed(fuzz, monkeypatch):
    import operator

    from pinsing.description import xacro_expression

    other = {**xacro_expression._OPERATORS, ast.FloorDiv: operator.truediv}
    monkeypatch.setattr(xacro_expression, "_OPERATORS", other)
    outcomes = [fuzz.run_case("expression", (seed,), {}, Path()) for seed in range(400)]
    assert any("Python says" in said for outcome, said, _ in outcomes if outcome == "unclear")


@pytest.mark.slow
def test_a_run_that_believes_its_folder_is_noticed(fuzz, monkeypatch, tmp_path):
    """Chunks that are not judged: some forged one comes through, or ends in a traceback."""
    from pinsing.sampling import execute as run_folder

    read = run_folder.RunFolder.read
    believing = lambda self, index, check=None, room=1 << 28: read(self, index)  # noqa: E731
    monkeypatch.setattr(run_folder.RunFolder, "read", believing)
    cases = (fuzz.run_case("run", (seed,), {}, tmp_path)[0] for seed in range(60))
    assert any(outcome not in fuzz.GOOD for outcome in cases)


@pytest.mark.slow
def test_the_same_seeds_make_the_same_file(fuzz, mutants):
    files = fuzz.sources()
    for kind in mutants.FILES:
        for chain in ((), (5,), (5, 9)):
            chains = [(*chain, seed) for seed in range(20)]
            made = [mutants.mutant(c, kind, files[kind][0]) for c in chains]
            assert made == [mutants.mutant(c, kind, files[kind][0]) for c in chains]
            assert len(set(made)) > 10


@pytest.mark.slow
def test_inputs_that_reach_something_new_are_gone_on_from(fuzz):
    """Their seeds come first in later cases, which reach more lines than they did."""
    cases = [("certificate", 90_000 + i) for i in range(150)]
    outcomes = list(fuzz.fuzz(cases, workers=1))
    kept = {o.chain for o in outcomes if o.fresh}
    later = [o for o in outcomes if len(o.chain) > 1]
    assert len(kept) >= 3
    assert later
    assert all(o.chain[:-1] in kept for o in later)
    fresh = [line for o in outcomes for line in o.fresh]
    assert len(fresh) == len(set(fresh))
    assert any(line.startswith("proof/checker.py:") for line in fresh)


def test_lines_in_forked_processes_count(mutants, tmp_path):
    import os

    source = tmp_path / "reader.py"
    source.write_text("def read(x):\n    if x:\n        return 1\n    return 2\n")
    lines = mutants.Lines([source])
    space: dict = {}
    exec(compile(source.read_text(), str(source), "exec"), space)
    child = os.fork()
    if child == 0:
        lines.watch()
        space["read"](0)
        os._exit(0)
    os.waitpid(child, 0)
    assert {line.rpartition(":")[2] for line in lines.fresh()} >= {"2", "4"}
    assert lines.fresh() == []
    assert mutants.executable_lines([source]) == 4


@pytest.mark.parametrize(
    ("code", "out", "err", "outcome"),
    [
        (0, "families\n", "pinsing: note: x\n", "result"),
        (2, "", "pinsing: note: x\npinsing: error: arm.urdf:3: no axis\n", "refused"),
        (0, "", "", "unclear"),
        (130, "what there is\n", "", "result"),
        (130, "", "", "unclear"),
        (0, "ok\n", "pinsing: error: no\n", "unclear"),
        (1, "", "pinsing: error: no\n", "unclear"),
        (2, "", "", "unclear"),
        (2, "", "pinsing: error: a\npinsing: error: b\n", "unclear"),
        (2, "", "pinsing: error: a\nand more\n", "unclear"),
        (2, "", "pinsing: error: " + "x" * 3000 + "\n", "unclear"),
        (2, "", "pinsing: error: \x1b[31m\n", "unclear"),
        (1, "", "Traceback (most recent call last):\n  KeyError\n", "traceback"),
    ],
)
def test_the_judge(mutants, code, out, err, outcome):
    assert mutants.judge(code, out, err)[0] == outcome


@pytest.mark.slow
def test_a_worker_that_dies_is_told_and_replaced(fuzz):
    worker = fuzz.Worker()
    try:
        assert worker.run("no such kind", (1,))[0].outcome == "crash"
        assert worker.run("loops", (70_000,))[0].outcome in fuzz.GOOD
    finally:
        worker.stop()
