#!/usr/bin/env python3
"""Make every URDF of urdf/ from its DH table; with --check, only compare (exit code 1 if stale)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pinsing.description.dh_urdf import dh_to_urdf, read_dh
from pinsing.errors import RobotFileError


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing, list what differs")
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path(__file__).resolve().parents[1] / "urdf",
        help="folder of the *.dh.yaml tables (default: urdf/)",
    )
    options = parser.parse_args()
    tables = sorted(options.folder.glob("*.dh.yaml"))
    if not tables:
        print(f"{options.folder}: no *.dh.yaml here", file=sys.stderr)
        return 2
    stale = []
    for table in tables:
        urdf = table.with_name(table.name.removesuffix(".dh.yaml") + ".urdf")
        try:
            text = dh_to_urdf(read_dh(table))
        except RobotFileError as error:
            print(error, file=sys.stderr)
            return 2
        if urdf.is_file() and urdf.read_text(encoding="utf-8") == text:
            continue
        stale.append(urdf)
        if not options.check:
            urdf.write_text(text, encoding="utf-8")
    for urdf in stale:
        print(f"{urdf}: {'differs from its table' if options.check else 'written'}")
    return 1 if stale and options.check else 0


if __name__ == "__main__":
    sys.exit(main())
