"""A short, seeded run of scripts/fuzz, and proof that it would notice."""

import ast
import operator
from collections import Counter
from pathlib import Path

import pytest
from public import script

from pinsing.description import xacro_expression

fuzz = script("fuzz.run")


@pytest.mark.slow
def test_broken_files_end_in_a_result_or_in_one_clear_line():
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
def test_other_broken_input_ends_so_too(counts):
    cases = [(kind, 70_000 + i) for kind, count in counts.items() for i in range(count)]
    outcomes = list(fuzz.fuzz(cases, workers=1))
    assert len(outcomes) == len(cases)
    assert [o for o in outcomes if o.outcome not in fuzz.GOOD] == []
    for kind in counts:
        ended = {o.outcome for o in outcomes if o.kind == kind}
        assert ended == set(fuzz.GOOD) or kind == "mesh", kind


def test_an_expression_with_another_value_is_noticed(monkeypatch):
    other = {**xacro_expression._OPERATORS, ast.FloorDiv: operator.truediv}
    monkeypatch.setattr(xacro_expression, "_OPERATORS", other)
    outcomes = [fuzz.run_case("expression", (seed,), {}, Path()) for seed in range(200, 300)]
    assert any("Python says" in said for outcome, said, _ in outcomes if outcome == "unclear")
