"""Figures, into files of the formats that papers take."""

from __future__ import annotations

import io
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pinsing.atomic_write import write_bytes
from pinsing.cli.output import say
from pinsing.errors import shown_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def off_screen() -> None:
    """Have figures drawn into files only, whatever windows the environment asks for."""
    os.environ["MPLBACKEND"] = "agg"  # it is read, and may be refused, when matplotlib comes in
    _leave_out_what_is_no_file()
    import logging  # here, as it comes with matplotlib

    # Where it keeps its fonts is of no interest to who wants a figure.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    import matplotlib

    matplotlib.use("agg")


def _leave_out_what_is_no_file() -> None:
    """Have matplotlib read no settings out of a device or pipe, which may have no end."""
    named = os.environ.get("MATPLOTLIBRC")
    if not named:
        return
    for path in (named, os.path.join(named, "matplotlibrc")):
        if os.path.exists(path) and not os.path.isdir(path):
            if not os.path.isfile(path):
                del os.environ["MATPLOTLIBRC"]
                say(f"note: MATPLOTLIBRC is ignored: {shown_path(path)} is no file")
            return


def save_figure(figure: Figure, out: Path, **options: Any) -> None:
    """Write a figure and close it, written or not; the same one gives the same bytes.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    import matplotlib
    from matplotlib import pyplot as plt

    # No date, and numbered marks.
    stamp = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    metadata = stamp.get(out.suffix.lower())
    picture = io.BytesIO()
    with (
        matplotlib.rc_context({"svg.hashsalt": "pinsing"}),
        warnings.catch_warnings(record=True) as heard,
    ):
        warnings.simplefilter("always")
        try:
            figure.savefig(picture, format=out.suffix[1:].lower(), metadata=metadata, **options)
        finally:
            plt.close(figure)
    write_bytes(out, picture.getvalue())
    # A robot may have a name in any script; matplotlib complains of each letter.
    missing = [w for w in heard if "missing from" in str(w.message)]
    for other in heard:
        if other not in missing:
            warnings.warn_explicit(other.message, other.category, other.filename, other.lineno)
    if missing:
        say("note: letters of a name that the figure's font lacks are drawn as boxes")
    say(f"wrote {out}")
