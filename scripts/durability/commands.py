"""Every command line that writes a file, and which of the program's outputs that covers.

What may write is found from the program itself: each kind of file that ``-o`` takes, and each
option that takes the name of a file and does not read it. `uncovered` names those that no command
line below uses, so that a new one cannot be forgotten.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

_URDF = Path(__file__).resolve().parents[2] / "urdf"
_LOOPS = ("FIVE_BAR", "--loops", "LOOPS")


@dataclass(frozen=True)
class Command:
    """A command line that writes.

    Attributes
    ----------
    words : tuple of str
        Its words; OUT stands for the file, OUT_LEGS for what files of legs are named after; TABLE,
        FIVE_BAR, LOOPS, PATH and POSES for what it reads.
    out : str
        Name of that file, or of the folder of a run.
    beside : tuple of str
        Names of further files that are written by the way, each with a word of its own, or none.
    is_run : bool
        Whether ``out`` is the folder of a run, which can be gone on with.
    """

    words: tuple[str, ...]
    out: str
    beside: tuple[str, ...] = ()
    is_run: bool = False

    def placed(self, folder: Path) -> list[str]:
        """The words, with the files in ``folder``; what is read lies beside that."""
        if "PATH" in self.words:
            (folder.parent / "path.csv").write_text("0,0.5,0.7\n0.2,0.6,0.9\n")
        if "POSES" in self.words:
            (folder.parent / "poses.csv").write_text(
                "x,y,z,qx,qy,qz,qw\n0.61775,0.11497,0.46622,-0.70195,0.70622,0.08521,-0.03534\n"
                "0.61486,0.12729,0.45695,-0.70809,0.69879,0.09179,-0.04332\n"
            )
        meant = {
            "OUT": folder / self.out,
            "OUT_LEGS": folder / "proof.cert.json",
            "TABLE": _URDF / "stanford.dh.yaml",
            "FIVE_BAR": _URDF / "five_bar.urdf",
            "LOOPS": _URDF / "five_bar.loops.yaml",
            "PATH": folder.parent / "path.csv",
            "POSES": folder.parent / "poses.csv",
            **{f"OUT{k}": folder / name for k, name in enumerate(self.beside, 2)},
        }
        return [str(meant.get(word, word)) for word in self.words]

    @property
    def covers(self) -> set[tuple[str, str, bool]]:
        """Command, name, and whether it is of a mechanism, for each file that is written."""
        loops = "--loops" in self.words
        return {(self.words[0], file, loops) for file in (self.out, *self.beside)}


def _json(*words: str) -> Command:
    return Command((*words, "-o", "OUT"), f"{words[0]}.json")


_MAP = ("map", "planar3r", "--count", "9000", "--chunk", "4096", "--threads", "1")
_SWEEP = ("analyze", "--sweep", "planar3r", "--levels", "1", "--samples", "21")
_FOLDER = ("--levels", "1", "--samples", "2001", "--chunk", "1", "--threads", "1")
_Q = ("--q", "0,1,0.5")

COMMANDS: dict[str, Command] = {
    "map FOLDER": Command((*_MAP, "-o", "OUT"), "run", is_run=True),
    "sweep FOLDER": Command(
        ("analyze", "--sweep", "planar3r", *_FOLDER, "-o", "OUT"), "run", is_run=True
    ),
    "sweep .npz": Command((*_SWEEP, "-o", "OUT"), "curves.npz"),
    "map .json": _json("map", "planar3r", "--count", "5000"),
    "zones .json": _json("zones", "planar3r", "--joint-speeds", "2,2,2"),
    "at .json": _json("at", "planar3r", "--q", "0,1,0"),
    "families .cert.json": Command(("families", "planar3r", "-o", "OUT"), "proof.cert.json"),
    "families --loops .cert.json": Command(
        ("families", *_LOOPS, "-o", "OUT_LEGS"), "proof_leg1.cert.json", ("proof_leg2.cert.json",)
    ),
    "families .sing": Command(("families", "planar3r", "-o", "OUT"), "equations.sing"),
    "view .html": Command(("view", "planar3r", "-o", "OUT"), "page.html"),
    "plot .png": Command(
        ("plot", "ellipsoids", "planar3r", "--q", "0,1,0", "--dpi", "30", "-o", "OUT"), "figure.png"
    ),
    "dh": Command(("export", "--urdf", "TABLE", "-o", "OUT"), "arm.urdf"),
    "info .json": _json("list", "planar3r"),
    "list .json": _json("list", "ur5"),
    "families .json": _json("families", "planar3r"),
    "sweep .json": _json(*_SWEEP),
    "aspects .json": _json("postures", "--aspects", "planar3r"),
    "postures .json": _json("postures", "planar3r", *_Q),
    "postures .html": Command(("postures", "planar3r", *_Q, "-o", "OUT"), "page.html"),
    "cuspidal .json": _json("postures", "--cuspidal", "planar3r", "--poses", "2"),
    "suggest .json": _json("at", "--suggest", "planar3r", "--task", "position"),
    "line .json": _json(
        *("line", "stanford", "--q", "0.1,0.7,0.3,0.2,0.6,0.1", "--to", "0.1,0.2,0.3")
    ),
    "check .json": _json("check", "planar3r", "PATH"),
    "check .png": Command(("check", "planar3r", "PATH", "-o", "OUT"), "check.png"),
    "check .html": Command(("check", "planar3r", "PATH", "-o", "OUT"), "check.html"),
    "path .json": _json("path", "ur5", "POSES"),
    "path .png": Command(("path", "ur5", "POSES", "-o", "OUT"), "path.png"),
    "path .csv": Command(("path", "ur5", "POSES", "-o", "OUT"), "joints.csv"),
    "export .h .py": Command(
        ("export", "planar3r", "-o", "OUT", "-o", "OUT2"), "guard.h", ("guard.py",)
    ),
    "analyze .json": _json(
        *("analyze", "planar3r", "--levels", "1", "--samples", "5", "--random-starts", "2")
    ),
    "view .png": Command(("view", "planar3r", "--skeleton", "-o", "OUT"), "view.png"),
    "report .html": Command(
        ("report", "planar3r", "-o", "OUT", "--page", "beside", "--skeleton"),
        "report.html",
        ("report-model.html",),
    ),
    "report .pdf": Command(
        ("report", "planar3r", "-o", "OUT", "-o", "OUT2", "--page", "none"),
        "report.html",
        ("report.pdf",),
    ),
    "analyze --loops .json": _json("analyze", *_LOOPS),
    "families --loops .json": _json("families", *_LOOPS),
    "map --loops .json": _json("map", *_LOOPS, "--count", "20"),
    "view --loops .html": Command(("view", *_LOOPS, "-o", "OUT"), "page.html"),
    "view --loops .png": Command(("view", *_LOOPS, "-o", "OUT"), "view.png"),
    "plot --loops": Command(("plot", "map", *_LOOPS, "-o", "OUT"), "figure.svg"),
    "report --loops": Command(
        ("report", *_LOOPS, "-o", "OUT", "-o", "OUT2", "--page", "none"),
        "report.html",
        ("report.pdf",),
    ),
}

BROWSER = {"view .png", "view --loops .png", "report .pdf", "report --loops"}
"""Those that need Chromium."""

# Options and arguments that name a file which is read.
_READ = {
    "--calibration",
    "--zones",
    "poses",
    "--loops",
    "--follow",
    "--trajectory",
    "--analysis",
    "--package",
    "file",
    "files",
    "table",
    "robot",
}
REFUSED = {"families": "system.sing", "map": "folder"}
"""Commands that refuse such a file of a mechanism, so that nothing is written."""


def uncovered(program: Any) -> list[str]:
    """What may write and is in none of the command lines above: files of one kind, by an ending."""
    missing = []
    context = click.Context(program)
    for name in program.list_commands(context):
        one = program.get_command(context, name)
        loops = any("--loops" in p.opts for p in one.params)
        for parameter in one.params:
            kind, said = type(parameter.type).__name__, str(parameter.metavar)
            reads = set(parameter.opts) & _READ
            file = any(word in kind for word in ("Path", "File")) or "FILE" in said
            if not file or reads:
                continue
            kinds = getattr(parameter, "kinds", {"": parameter.opts[0]})
            for mechanism in (False, True) if loops else (False,):
                done = {(name, REFUSED.get(name, ""))} if mechanism else set()
                done |= {
                    (c, file)
                    for k in COMMANDS.values()
                    for c, file, m in k.covers
                    if m is mechanism
                }
                written = {_kind(file, kinds) for command, file in done if command == name}
                missing += [
                    f"{name} {what}{' of a mechanism' * mechanism}"
                    for what in sorted(set(kinds.values()) - written)
                ]
    return missing


def _kind(file: str, kinds: dict[str, str]) -> str:
    """The argument of a command that a file goes to, as `pinsing.cli.options` has it."""
    longest = sorted(kinds, key=len, reverse=True)
    return next((kinds[end] for end in longest if end and file.endswith(end)), kinds.get("/", ""))
