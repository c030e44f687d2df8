"""The notebook of examples/: run by a real kernel from its first cell to its last."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
from command_line import python

NOTEBOOK = Path(__file__).parent.parent / "examples" / "12_notebook.ipynb"
NEEDS = ("nbclient", "ipykernel")

# Its own process, as a user's `jupyter execute` is: no warning filters or event loops of pytest's.
RUN = """
import sys, nbformat, nbclient
notebook = nbformat.read(sys.argv[1], as_version=4)
nbclient.NotebookClient(notebook, timeout=240, kernel_name="python3").execute()
nbformat.write(notebook, sys.argv[2])
"""


def cells() -> list[dict[str, Any]]:
    return list(json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"])


def shown(cell: dict[str, Any], kind: str) -> str:
    """What a cell shows as one kind of content."""
    return "".join("".join(o["data"].get(kind, "")) for o in cell["outputs"] if "data" in o)


def test_it_is_kept_without_outputs():
    for cell in cells():
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


@pytest.mark.slow
def test_every_cell_runs_and_shows_what_the_text_says(tmp_path):
    for name in NEEDS:
        pytest.importorskip(name)
    done = tmp_path / "done.ipynb"
    own = {k: v for k, v in os.environ.items() if k != "MPLBACKEND"}  # the kernel's own is meant
    ran = python("-c", RUN, NOTEBOOK, done, timeout=300, cwd=tmp_path, env=own)
    assert ran.returncode == 0, ran.stderr
    code = [c for c in json.loads(done.read_text())["cells"] if c["cell_type"] == "code"]
    assert [c["execution_count"] for c in code] == list(range(1, len(code) + 1))
    form, family, ratio, state, curve, crossings, page = code
    assert "<math>" in shown(form, "text/html")
    assert "proven" in shown(form, "text/html")
    assert "F3" in shown(family, "text/plain")
    assert float(shown(ratio, "text/plain")) < 1e-10
    assert "SINGULAR: rank 5 of 6" in shown(state, "text/plain")
    assert shown(curve, "image/png")
    assert shown(crossings, "text/plain") == "[('F2', 1.0)]"
    assert "<iframe" in shown(page, "text/html")
