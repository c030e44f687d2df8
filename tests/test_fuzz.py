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


@pytest.mark.slow
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
