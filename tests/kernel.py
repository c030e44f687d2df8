"""Tests that only the compiled kernel ends in seconds, or that are of it."""

import os

import pytest

from pinsing._batch import engine

needs_kernel = pytest.mark.skipif(not engine.available(), reason="no compiled kernel")


def require_kernel() -> None:
    """Skip a module where there is no kernel; fail where the environment says there must be one."""
    if not engine.available():
        if os.environ.get("PINSING_REQUIRE_ENGINE"):
            raise RuntimeError(engine.unavailable_reason())
        pytest.skip(f"{engine.unavailable_reason()}", allow_module_level=True)
