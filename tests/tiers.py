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
