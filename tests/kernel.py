"""Tests that only the compiled kernel ends in seconds, or that are of it."""

import pytest

from pinsing._batch import engine

needs_kernel = pytest.mark.skipif(not engine.available(), reason="no compiled kernel")
