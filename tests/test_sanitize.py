"""The compiled kernel under AddressSanitizer and UndefinedBehaviorSanitizer."""

import importlib
import os
from pathlib import Path

import pytest
from command_line import python

SCRIPTS = Path(__file__).parent.parent / "scripts"


@pytest.mark.slow
def test_the_kernel_under_two_sanitizers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(SCRIPTS))
    reason = importlib.import_module("fuzz.sanitize").missing()
    if reason:
        pytest.skip(reason)
    files = ("batch/test_batch.py", "batch/test_batch_roots.py", "kinematics/test_refine.py")
    words = ["--", "-m", "not slow", *(f"tests/{file}" for file in files)]
    env = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}
    done = python(SCRIPTS / "fuzz" / "sanitize.py", *words, timeout=1500, env=env)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert " passed" in done.stdout
    assert "kernel: " in done.stdout
