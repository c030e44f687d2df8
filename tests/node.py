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


def ask(code: str, **seen: Any) -> Any:
    """What an expression is in the page's engine: it sees ``m``, and what is given by name."""
    assert NODE is not None
    modules = ", ".join(f'...await import("{FOLDER.as_uri()}/{n}.mjs")' for n in engine_modules())
    program = f"""
      import {{ readFileSync }} from "node:fs";
      const m = {{ {modules} }};
      const {{ {", ".join(seen)} }} = JSON.parse(readFileSync(0));
      console.log(JSON.stringify({code}));
    """
    done = subprocess.run(
        [NODE, "--input-type=module", "-e", program],
        input=json.dumps(seen, default=np.ndarray.tolist),
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
