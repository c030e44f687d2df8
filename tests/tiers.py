"""Cases of a test in two tiers: some in the quick one, the others in the slow one."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def tiered(cases: Iterable[Any], quick: Collection[Any]) -> list[Any]:
    """The cases for ``parametrize``, those that are not ``quick`` marked slow."""
    cases = list(cases)
    assert all(q in cases for q in quick)
    return [c if c in quick else pytest.param(c, marks=pytest.mark.slow) for c in cases]


def tiered_rows(cases: Iterable[tuple[Any, ...]], quick: Collection[tuple[Any, ...]]) -> list[Any]:
    """The same for cases of several arguments."""
    cases = list(cases)
    assert all(q in cases for q in quick)
    return [c if c in quick else pytest.param(*c, marks=pytest.mark.slow) for c in cases]


def sampled(cases: Iterable[Any]) -> list[Any]:
    """Every third case in the quick tier, beginning with the first; rows are tuples."""
    rows = [case if isinstance(case, type(pytest.param())) else _row(case) for case in cases]
    quick = [row for row in rows if not row.marks][::3]
    return [
        row if row in quick else pytest.param(*row.values, id=row.id, marks=pytest.mark.slow)
        for row in rows
    ]


def _row(case: Any) -> Any:
    return pytest.param(*case if isinstance(case, tuple) else (case,))
