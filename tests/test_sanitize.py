"""The compiled kernel under AddressSanitizer and UndefinedBehaviorSanitizer."""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parent.parent / "scripts"


@pytest.mark.slow
def test_the_kernel_under_two_sanitizers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(SCRIPTS))
    reason = importlib.import_module("fuzz.sanitize").missing()
    if reason:
        pytest.skip(reason)
    done = subprocess.run(
        [
            sys.executable,
            str(SCRIPTS / "fuzz" / "sanitize.py"),
            "--", "-m", "not slow", "tests/test_batch.py", "tests/test_batch_roots.py",
            "tests/kinematics/test_refine.py",
        ],
        capture_output=True,
        text=True,
        timeout=1500,
        env={k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert " passed" in done.stdout
    assert "kernel: " in done.stdout
