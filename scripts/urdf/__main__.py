"""Make the URDFs of urdf/ from their tables; with --check, only compare (exit code 1 if stale).

Arms come from DH tables (``*.dh.yaml``), mechanisms with closed loops and their loop files from
tables of their points (``*.mechanism.yaml``).
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from urdf.kinds import read_table

from pinsing.description.dh_table import dh_to_urdf, read_dh
from pinsing.errors import RobotFileError


def _plain(text: str) -> str:
    """The text with twelve digits of each number: processors differ in the last ones."""
    return re.sub(r"-?\d+\.\d+(e-?\d+)?", lambda m: f"{float(m[0]):.12g}", text)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing, list what differs")
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path(__file__).resolve().parents[2] / "urdf",
        help="folder of the *.dh.yaml tables (default: urdf/)",
    )
    options = parser.parse_args()
    if not any(options.folder.glob("*.dh.yaml")):
        print(f"{options.folder}: no *.dh.yaml here", file=sys.stderr)
        return 2
    stale = []
    try:
        for path, text in texts(options.folder):
            if path.is_file() and _plain(path.read_text(encoding="utf-8")) == _plain(text):
                continue
            stale.append(path)
            if not options.check:
                path.write_text(text, encoding="utf-8")
    except RobotFileError as error:
        print(error, file=sys.stderr)
        return 2
    for path in stale:
        print(f"{path}: {'differs from its table' if options.check else 'written'}")
    return 1 if stale and options.check else 0


def texts(folder: Path) -> Iterator[tuple[Path, str]]:
    """Each file that a table of the folder means, and its text."""
    for table in sorted(folder.glob("*.dh.yaml")):
        yield (
            table.with_name(table.name.removesuffix(".dh.yaml") + ".urdf"),
            dh_to_urdf(read_dh(table)),
        )
    for table in sorted(folder.glob("*.mechanism.yaml")):
        name = table.name.removesuffix(".mechanism.yaml")
        for suffix, text in zip((".urdf", ".loops.yaml"), read_table(table), strict=True):
            yield table.with_name(name + suffix), text


if __name__ == "__main__":
    sys.exit(main())
