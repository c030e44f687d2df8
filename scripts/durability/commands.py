"""Every command line that writes a file, and which of the program's options that covers.

What may write is found from the program itself: each option that takes the name of a file or
folder and does not read it. `uncovered` names those that no command line below uses, so that a
new one cannot be forgotten.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
            "OUT_LEGS": folder / "certificate.json",
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
        """Command, option, and whether it is of a mechanism, for each file that is written."""
        loops = "--loops" in self.words
        ends = [k for k, word in enumerate(self.words) if word.startswith("OUT")]
        return {(self.words[0], self.words[k - 1], loops) for k in ends}


def _json(*words: str) -> Command:
    return Command((*words, "--json", "OUT"), f"{words[0]}.json")


_MAP = ("map", "planar3r", "--count", "9000", "--chunk", "4096", "--threads", "1")
_SWEEP = ("analyze", "--sweep", "planar3r", "--levels", "1", "--samples", "21")
_FOLDER = ("--levels", "1", "--samples", "2001", "--chunk", "1", "--threads", "1")
_Q = ("--q", "0,1,0.5")

COMMANDS: dict[str, Command] = {
    "map --out DIR": Command((*_MAP, "--out", "OUT"), "run", is_run=True),
    "sweep --out DIR": Command(
        ("analyze", "--sweep", "planar3r", *_FOLDER, "--out", "OUT"), "run", is_run=True
    ),
    "sweep --out FILE.npz": Command((*_SWEEP, "--out", "OUT"), "curves.npz"),
    "map --json": _json("map", "planar3r", "--count", "5000"),
    "at --json": _json("at", "planar3r", "--q", "0,1,0"),
    "families --certificate": Command(
        ("families", "planar3r", "--certificate", "OUT"), "certificate.json"
    ),
    "families --loops --certificate": Command(
        ("families", *_LOOPS, "--certificate", "OUT_LEGS"),
        "certificate_leg1.json",
        ("certificate_leg2.json",),
    ),
    "families --system": Command(("families", "planar3r", "--system", "OUT"), "equations.sing"),
    "view --html": Command(("view", "planar3r", "--html", "OUT"), "page.html"),
    "plot .png": Command(
        ("plot", "ellipsoids", "planar3r", "--q", "0,1,0", "--dpi", "30", "--out", "OUT"),
        "figure.png",
    ),
    "dh": Command(("export", "--urdf", "TABLE", "-o", "OUT"), "arm.urdf"),
    "info --json": _json("list", "planar3r"),
    "list --json": _json("list", "ur5"),
    "families --json": _json("families", "planar3r"),
    "sweep --json": _json(*_SWEEP),
    "aspects --json": _json("postures", "--aspects", "planar3r"),
    "postures --json": _json("postures", "planar3r", *_Q),
    "postures --html": Command(("postures", "planar3r", *_Q, "--html", "OUT"), "page.html"),
    "cuspidal --json": _json("postures", "--cuspidal", "planar3r", "--poses", "2"),
    "suggest --json": _json("at", "--suggest", "planar3r", "--task", "position"),
    "line --json": _json(
        *("line", "stanford", "--q", "0.1,0.7,0.3,0.2,0.6,0.1", "--to", "0.1,0.2,0.3")
    ),
    "check --json": _json("check", "planar3r", "PATH"),
    "check --plot": Command(("check", "planar3r", "PATH", "--plot", "OUT"), "check.png"),
    "check --html": Command(("check", "planar3r", "PATH", "--html", "OUT"), "check.html"),
    "path --json": _json("path", "ur5", "POSES"),
    "path --plot": Command(("path", "ur5", "POSES", "--plot", "OUT"), "path.png"),
    "path -o": Command(("path", "ur5", "POSES", "-o", "OUT"), "joints.csv"),
    "export --c --python": Command(
        ("export", "planar3r", "--c", "OUT", "--python", "OUT2"), "guard.h", ("guard.py",)
    ),
    "analyze --json": _json(
        *("analyze", "planar3r", "--levels", "1", "--samples", "5", "--random-starts", "2")
    ),
    "view --png": Command(("view", "planar3r", "--skeleton", "--png", "OUT"), "view.png"),
    "report -o": Command(
        ("report", "planar3r", "-o", "OUT", "--page", "beside", "--skeleton"),
        "report.html",
        ("report-model.html",),
    ),
    "report --pdf": Command(
        ("report", "planar3r", "-o", "OUT", "--pdf", "OUT2", "--page", "none"),
        "report.html",
        ("report.pdf",),
    ),
    "analyze --loops --json": _json("analyze", *_LOOPS),
    "families --loops --json": _json("families", *_LOOPS),
    "map --loops --json": _json("map", *_LOOPS, "--count", "20"),
    "view --loops --html": Command(("view", *_LOOPS, "--html", "OUT"), "page.html"),
    "view --loops --png": Command(("view", *_LOOPS, "--png", "OUT"), "view.png"),
    "plot --loops": Command(("plot", "map", *_LOOPS, "--out", "OUT"), "figure.svg"),
    "report --loops": Command(
        ("report", *_LOOPS, "-o", "OUT", "--pdf", "OUT2", "--page", "none"),
        "report.html",
        ("report.pdf",),
    ),
}

BROWSER = {name for name, c in COMMANDS.items() if {"--png", "--pdf"} & set(c.words)}
"""Those that need Chromium."""

# Options and arguments that name a file which is read.
_READ = {"poses", "--loops", "--analysis", "--package", "file", "files", "table", "robot"}
REFUSED = {("families --system", True), ("map --out", True)}
"""Options that are refused for mechanisms, so that nothing is written."""


def leaves(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command of a click program: its words, and itself."""
    for name, one in group.commands.items():
        if hasattr(one, "commands"):
            yield from leaves(one, (*path, name))
        else:
            yield (*path, name), one


def writers(program: Any) -> dict[tuple[str, bool], set[str]]:
    """Every option of a click program that takes a file to write, as (command, of mechanisms)."""
    found = {}
    for path, one in leaves(program):
        for parameter in one.params:
            kind, said = type(parameter.type).__name__, str(parameter.metavar)
            names = set(parameter.opts) | set(parameter.secondary_opts)
            file = any(word in kind for word in ("Path", "File", "Output"))
            if (file or "FILE" in said or "DIR" in said) and not names & _READ:
                for loops in (False, True):
                    if not loops or any("--loops" in p.opts for p in one.params):
                        found[" ".join(path) + " " + min(names, key=len), loops] = {
                            f"{' '.join(path)} {name}" for name in names
                        }
    return found


def uncovered(program: Any) -> list[str]:
    """What may write and is in none of the command lines above."""
    covered = {
        (f"{command} {option}", loops)
        for c in COMMANDS.values()
        for command, option, loops in c.covers
    }
    return sorted(
        f"{name}{' of a mechanism' if loops else ''}"
        for (name, loops), same in writers(program).items()
        if not any((one, loops) in covered | REFUSED for one in same)
    )
