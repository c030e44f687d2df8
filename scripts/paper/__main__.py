"""Make the tables and figures of the paper again, and one page that compares them.

Writes paper.html and paper.md, with the pictures in paper/, into the folder given.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from paper import claims, parallel, stanford, surgical
from paper.page import to_html, to_markdown
from paper.rows import Section, count


def sections(pictures: Path, readings: bool = True) -> list[Section]:
    """All parts of the page; pictures are written on the way."""
    pictures.mkdir(parents=True, exist_ok=True)
    return [
        *stanford.make(pictures),
        *surgical.make(pictures, readings),
        *parallel.make(pictures),
        *claims.make(pictures),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("build/paper"), help="folder to write to")
    parser.add_argument(
        "--no-readings", action="store_true", help="leave out the search over readings of Table 2"
    )
    options = parser.parse_args()
    made = sections(options.out / "paper", not options.no_readings)
    for name, text in (
        ("paper.html", to_html(made, "paper")),
        ("paper.md", to_markdown(made, "paper")),
    ):
        (options.out / name).write_text(text, encoding="utf-8")
        print(options.out / name)
    print(", ".join(f"{n} {verdict}" for verdict, n in count(made).items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
