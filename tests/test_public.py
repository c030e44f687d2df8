"""The public names: complete, lazy, and never shadowed by a module of the same name."""

from __future__ import annotations

import subprocess
import sys

import pytest
from tiers import tiered

import pinsing


@pytest.mark.parametrize("name", pinsing.__all__)
def test_every_public_name_is_there(name):
    value = getattr(pinsing, name)
    assert callable(value)
    assert value.__doc__
    assert name in dir(pinsing)


@pytest.mark.parametrize(
    "first",
    tiered(
        ["pinsing.sampling.analyze", "pinsing.sampling.sweep_run", "pinsing.families"],
        ("pinsing.sampling.sweep_run",),
    ),
)
def test_modules_do_not_shadow_functions(first):
    """Whatever was imported before: pinsing.sweep is the function."""
    code = (
        f"import importlib, pinsing; importlib.import_module({first!r})\n"
        "from pinsing import sweep, refine, generalize, closed_form\n"
        "assert all(map(callable, (sweep, refine, generalize, closed_form)))\n"
        "arm = pinsing.load('planar3r')\n"
        "pinsing.analyze(arm)\n"
        "assert pinsing.closed_form(arm).families and pinsing.sweep(arm).curves\n"
        "from pinsing.sampling.sweep_run import SweepResult\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="no attribute 'sweeep'"):
        _ = pinsing.sweeep
