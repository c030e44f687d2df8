"""Runs functions of the page's engine under Node."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pinsing
from pinsing.view.server import engine_modules

FOLDER = Path(pinsing.__file__).parent / "view" / "engine"
NODE = shutil.which("node")

needs_node = pytest.mark.skipif(NODE is None, reason="Node.js is not installed")


def run(code: str, data: Any) -> Any:
    """What a function of the engine's modules returns: ``code`` sees ``m`` and ``data``."""
    assert NODE is not None
    modules = ", ".join(f'...await import("{FOLDER.as_uri()}/{n}.mjs")' for n in engine_modules())
    program = f"""
      import {{ readFileSync }} from "node:fs";
      const m = {{ {modules} }};
      const data = JSON.parse(readFileSync(0));
      const found = ({code})(m, data);
      console.log(JSON.stringify(found));
    """
    done = subprocess.run(
        [NODE, "--input-type=module", "-e", program],
        input=json.dumps(data, default=np.ndarray.tolist),
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def ask(code: str, **seen: Any) -> Any:
    """What an expression is in the page's engine: it sees ``m``, and what is given by name."""
    return run(f"(m, {{ {', '.join(seen)} }}) => {code}", seen)
