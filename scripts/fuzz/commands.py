"""Robot files through the command line, in this process, and how a command ended."""

from __future__ import annotations

import contextlib
import io
import sys
import traceback
from pathlib import Path

from fuzz.judge import Ended

TREES = ("four_bar", "five_bar", "planar_3rrr")


def calls(kind: str, seed: int, index: int, path: Path) -> list[list[str]]:
    """Command lines that a file of a kind goes through, one after the other."""
    if kind == "dh":
        made = str(path.with_name("made.urdf"))
        return [["export", "--urdf", str(path), "-o", made], ["list", made]]
    if kind == "loops":
        return [["", TREES[index], str(path)]]
    # One in forty is analysed, with bounds that suit the time.
    if seed % 40 == 0:
        quick = ["--seconds", "1", "--samples", "9", "--random-starts", "20", "--levels", "1"]
        return [["list", str(path)], ["analyze", str(path), *quick]]
    return [["list", str(path)]]


def call(words: list[str]) -> Ended:
    """Run a command line; a mechanism, where its first word is empty."""
    from pinsing.cli import main

    out, err = io.StringIO(), io.StringIO()
    code: object = 0
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            if words[0]:
                main(words)
            else:
                code = _mechanism(words[1], words[2])
    except SystemExit as ended:
        code = ended.code
    except Exception:
        return "traceback", traceback.format_exc(limit=-4)
    return judge(code, out.getvalue(), err.getvalue())


def _mechanism(tree: str, loops: str) -> int:
    """Load a mechanism as the command line would, and close its loops once."""
    import numpy as np

    from pinsing.description.dh_table import urdf_folder
    from pinsing.errors import PinsingError
    from pinsing.loops.closure import Loops
    from pinsing.robot.mechanism import load_mechanism

    try:
        mechanism = load_mechanism(urdf_folder() / f"{tree}.urdf", loops)
        residual, jacobian = Loops(mechanism).at(mechanism.home)
        assert np.isfinite(residual).all()
        assert np.isfinite(jacobian).all()
        print(mechanism)
    except PinsingError as error:
        print(f"pinsing: error: {error}", file=sys.stderr)
        return 2
    return 0


def judge(code: object, out: str, err: str) -> Ended:
    """Return the outcome of a call by its exit code and streams."""
    lines = err.splitlines()
    errors = [line for line in lines if line.startswith("pinsing: error: ")]
    others = [line for line in lines if not line.startswith("pinsing: ")]
    if any("Traceback" in line for line in lines):
        return "traceback", err[-2000:]
    # An analysis whose time is up ends with 130, and with what it has.
    if code in (0, 130) and (out.strip() or "pinsing: wrote " in err) and not errors:
        return "result", ""
    if code == 2 and len(errors) == 1 and not others:
        message = errors[0].removeprefix("pinsing: error: ")
        if len(message) > 2000:
            return "unclear", f"a message of {len(message)} characters: {message[:200]}"
        if not message.strip() or any(not c.isprintable() for c in message):
            return "unclear", repr(message[:200])
        return "refused", message
    return "unclear", f"exit code {code}, stderr {err[-500:]!r}, stdout {out[:200]!r}"
